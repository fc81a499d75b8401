/* Ctrl-C and its like. */
#include "command.h"

#include <signal.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

/* Whoever is asked to end does so between two frames. A frame of a huge world, or a driver that compiles one, can take
 * minutes: then it ends without. */
#define PATIENCE_S 5u

/* timeout(1) asks a program and then the program's group: the two are one. */
#define SAME_NS 250000000u

static volatile sig_atomic_t interrupted;
static volatile uint64_t asked_ns; /* written before `interrupted` */

static void interrupt(int signal_number)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    uint64_t now_ns = (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
    if (!interrupted) {
        asked_ns = now_ns;
        interrupted = 1;
        alarm(PATIENCE_S);
    } else if (now_ns - asked_ns > SAME_NS) { /* a second one ends the program at once */
        signal(signal_number, SIG_DFL);
        raise(signal_number);
    }
}

static void give_up(int signal_number)
{
    static const char text[] = "karst: interrupted in the middle of a long step, which could not be finished\n";
    (void)signal_number;
    ssize_t written = write(STDERR_FILENO, text, sizeof text - 1);
    (void)written;
    _Exit(KARST_FAILED);
}

void command_catch_interrupts(void)
{
    signal(SIGALRM, give_up);
    signal(SIGINT, interrupt);
    signal(SIGTERM, interrupt);
}

bool command_interrupted(void)
{
    if (interrupted)
        alarm(0); /* it has been seen */
    return interrupted;
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
