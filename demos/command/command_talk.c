/* Messages for people, on stderr. */
#include "command.h"

#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#define PROGRESS_INTERVAL_NS 100000000u

uint64_t command_clock_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

void command_talk_init(command_talk *talk)
{
    const char *no_colour = getenv("NO_COLOR"), *terminal = getenv("TERM");
    *talk = (command_talk){.on_terminal = isatty(STDERR_FILENO) && terminal && strcmp(terminal, "dumb") != 0};
    talk->colour = talk->on_terminal && !(no_colour && *no_colour);
}

void command_end_progress(command_talk *talk)
{
    if (talk->progress_shown)
        fputs("\r\033[K", stderr);
    talk->progress_shown = false;
}

void command_progress(command_talk *talk, const char *format, ...)
{
    uint64_t now_ns = command_clock_ns();
    if (talk->quiet || !talk->on_terminal ||
        (talk->progress_shown && now_ns - talk->shown_at_ns < PROGRESS_INTERVAL_NS))
        return;
    va_list arguments;
    va_start(arguments, format);
    fputs("\r\033[K", stderr);
    vfprintf(stderr, format, arguments);
    fflush(stderr);
    va_end(arguments);
    talk->progress_shown = true;
    talk->shown_at_ns = now_ns;
}

void command_say(command_talk *talk, const char *format, ...)
{
    if (talk->quiet)
        return;
    command_end_progress(talk);
    va_list arguments;
    va_start(arguments, format);
    vfprintf(stderr, format, arguments);
    fputc('\n', stderr);
    va_end(arguments);
}

static void say_coloured(command_talk *talk, const char *colour, const char *label, const char *message)
{
    command_end_progress(talk);
    fprintf(stderr, "%skarst:%s %s%s\n", talk->colour ? colour : "", talk->colour ? "\033[0m" : "", label, message);
}

void command_say_error(command_talk *talk, const char *message) { say_coloured(talk, "\033[1;31m", "", message); }

void command_warn(command_talk *talk, const char *message) { say_coloured(talk, "\033[1;33m", "warning: ", message); }

static bool is_diagnostic(const char *line)
{
    return line[0] == ' ' || strstr(line, ": error: ") || strstr(line, ": warning: ");
}

const char *command_name_stdin(const char *line, char *text, size_t size_bytes)
{
    const char *file = command_stdin_file(), *at = *file ? strstr(line, file) : NULL;
    if (!at)
        return line;
    snprintf(text, size_bytes, "%.*sstdin%s", (int)(at - line), line, at + strlen(file));
    return text;
}

void command_say_diagnostic(command_talk *talk, const char *given)
{
    char renamed[2048];
    const char *line = command_name_stdin(given, renamed, sizeof renamed);
    command_end_progress(talk);
    const char *what = strstr(line, ": error: "), *label = "error:", *colour = "\033[1;31m";
    if (what && !*talk->said)
        snprintf(talk->said, sizeof talk->said, "%.*s: %s", (int)(what - line), line, what + strlen(": error: "));
    if (!what) {
        what = strstr(line, ": warning: ");
        label = "warning:";
        colour = "\033[1;33m";
    }
    if (what && talk->colour)
        fprintf(stderr, "%.*s: %s%s\033[0m%s\n", (int)(what - line), line, colour, label, what + 2 + strlen(label));
    else
        fprintf(stderr, "%s\n", line);
}

void command_say_failure(command_talk *talk, const char *given)
{
    char renamed[2048];
    const char *message = command_name_stdin(given, renamed, sizeof renamed);
    command_say_error(talk, strcmp(message, talk->said) == 0 ? "this world cannot be used as it stands" : message);
}

static void write_log(void *user, karst_log_level level, const char *line)
{
    command_talk *talk = user;
    /* What failed comes back as karst_error and is printed once; the log's lines only say more of it. */
    if (level == KARST_LOG_ERROR && talk->verbose)
        say_coloured(talk, "\033[1;31m", "", line);
    else if (level == KARST_LOG_WARNING && is_diagnostic(line))
        command_say_diagnostic(talk, line);
    else if (level == KARST_LOG_WARNING)
        command_warn(talk, line);
    else if (level > KARST_LOG_WARNING)
        say_coloured(talk, "\033[2m", "", line);
}

karst_log command_log(command_talk *talk)
{
    return (karst_log){
        .write = write_log, .user = talk, .max_level = talk->verbose ? KARST_LOG_DEBUG : KARST_LOG_WARNING};
}
