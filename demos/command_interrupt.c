/* Ctrl-C and its like. */
#include "command.h"

#include <signal.h>
#include <stdarg.h>
#include <stdio.h>

static volatile sig_atomic_t interrupted;

static void interrupt(int signal_number)
{
    interrupted = 1;
    /* A second one ends the program at once. */
    signal(signal_number, SIG_DFL);
}

void command_catch_interrupts(void)
{
    signal(SIGINT, interrupt);
    signal(SIGTERM, interrupt);
}

bool command_interrupted(void) { return interrupted; }

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
