/* Ctrl-C and its like. */
#include "command.h"

#include <limits.h>
#include <signal.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

/* Whoever is asked to end does so between two frames. A frame of a huge world, or a driver that compiles one, can take
 * minutes: then it ends without. */
#define PATIENCE_MS 750u
#define LONG_PATIENCE_MS 5000u

/* timeout(1) sends SIGTERM to a program and then to its group. These two are one request; on a busy machine they come a
 * while apart. */
#define SAME_REQUEST_NS 250000000u
#define SAME_TERM_NS (PATIENCE_MS * 1000000u)

#define MAX_TEMPORARIES 4

static volatile sig_atomic_t interrupted; /* by which signal; 0: by none */
static volatile sig_atomic_t is_held, has_much_to_lose, is_all_saved, is_part_of_job;
static volatile uint64_t asked_ns; /* written before `interrupted` */

/* Files that are to go with the process. A name is written before its flag. */
static struct {
    char path[PATH_MAX];
    volatile sig_atomic_t is_there;
} temporaries[MAX_TEMPORARIES];

static void set_timer(unsigned ms)
{
    const struct itimerval timer = {.it_value = {.tv_sec = ms / 1000, .tv_usec = (suseconds_t)(ms % 1000) * 1000}};
    setitimer(ITIMER_REAL, &timer, NULL);
}

static void remove_temporaries(void)
{
    for (int i = 0; i < MAX_TEMPORARIES; i++)
        if (temporaries[i].is_there)
            if (unlink(temporaries[i].path) != 0)
                rmdir(temporaries[i].path);
}

/* Ends by the signal, as who started this program may want to know. */
static void end_by(int signal_number)
{
    sigset_t set;
    remove_temporaries();
    if (is_part_of_job && signal_number == SIGTERM)
        _Exit(COMMAND_AGAIN);
    signal(signal_number, SIG_DFL);
    sigemptyset(&set);
    sigaddset(&set, signal_number);
    pthread_sigmask(SIG_UNBLOCK, &set, NULL);
    raise(signal_number);
    _Exit(128 + signal_number);
}

static void interrupt(int signal_number)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    uint64_t now_ns = (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
    if (!interrupted) {
        asked_ns = now_ns;
        interrupted = signal_number;
        set_timer(has_much_to_lose ? LONG_PATIENCE_MS : PATIENCE_MS);
        return;
    }
    const bool is_term = signal_number == SIGTERM && interrupted == SIGTERM;
    if (now_ns - asked_ns > (is_term ? SAME_TERM_NS : SAME_REQUEST_NS)) { /* a second one ends the program at once */
        karst_driver_end();
        end_by(signal_number);
    }
}

static void give_up(int signal_number)
{
    static const char text[] = "karst: interrupted in the middle of a long step, which could not be finished\n";
    (void)signal_number;
    if (is_held) {
        set_timer(PATIENCE_MS);
        return;
    }
    remove_temporaries();
    karst_driver_end();
    if (is_all_saved && interrupted != SIGINT)
        _Exit(KARST_OK);
    if (is_all_saved)
        end_by(interrupted);
    ssize_t written = write(STDERR_FILENO, text, sizeof text - 1);
    (void)written;
    end_by(interrupted);
}

void command_catch_interrupts(void)
{
    signal(SIGALRM, give_up);
    signal(SIGINT, interrupt);
    signal(SIGTERM, interrupt);
    if (signal(SIGHUP, interrupt) == SIG_IGN) { /* nohup */
        /* LLVM, in a driver's compiler, handles it all the same, and takes away what it writes: it must not come. */
        sigset_t set;
        signal(SIGHUP, SIG_IGN);
        sigemptyset(&set);
        sigaddset(&set, SIGHUP);
        pthread_sigmask(SIG_BLOCK, &set, NULL);
    }
}

bool command_interrupted(void)
{
    if (interrupted)
        set_timer(has_much_to_lose ? LONG_PATIENCE_MS : PATIENCE_MS); /* it has been seen: so long for cleaning up */
    return interrupted;
}

void command_be_part_of_job(void) { is_part_of_job = true; }
void command_hold_interrupts(bool held) { is_held = held; }
void command_have_much_to_lose(bool much) { has_much_to_lose = much; }

void command_have_all_saved(void)
{
    is_all_saved = true;
    if (interrupted)
        set_timer(PATIENCE_MS);
}

void command_end_if_interrupted(bool done)
{
    if (!interrupted || (done && interrupted != SIGINT))
        return;
    set_timer(0);
    fflush(NULL);
    end_by(interrupted);
}

void command_add_temporary(const char *path)
{
    for (int i = 0; i < MAX_TEMPORARIES && strlen(path) < PATH_MAX; i++)
        if (!temporaries[i].is_there) {
            strcpy(temporaries[i].path, path);
            temporaries[i].is_there = true;
            return;
        }
}

void command_drop_temporary(const char *path)
{
    for (int i = 0; i < MAX_TEMPORARIES; i++)
        if (temporaries[i].is_there && strcmp(temporaries[i].path, path) == 0)
            temporaries[i].is_there = false;
}

bool command_fail_interrupted(karst_error *error, const char *format, ...)
{
    char message[sizeof error->message];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    *error = (karst_error){0};
    return karst_fail(error, KARST_FAILED, "%s", message);
}
