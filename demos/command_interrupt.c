/* Ctrl-C and its like. */
#include "command.h"

#include <signal.h>

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
