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

static void write_log(void *user, karst_log_level level, const char *line)
{
    command_talk *talk = user;
    /* What failed comes back as karst_error and is printed once; the log's lines only say more of it. */
    if (level == KARST_LOG_ERROR && talk->verbose)
        say_coloured(talk, "\033[1;31m", "", line);
    else if (level == KARST_LOG_WARNING) /* what is said of a world's text says itself what it is, and how it goes on */
        say_coloured(
            talk, "\033[1;33m",
            line[0] == ' ' || strstr(line, ": error: ") || strstr(line, ": warning: ") ? "" : "warning: ", line);
    else if (level > KARST_LOG_WARNING)
        say_coloured(talk, "\033[2m", "", line);
}

karst_log command_log(command_talk *talk)
{
    return (karst_log){
        .write = write_log, .user = talk, .max_level = talk->verbose ? KARST_LOG_DEBUG : KARST_LOG_WARNING};
}
