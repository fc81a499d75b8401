/* A second process that compiles kernels for this one.
 *
 * PoCL compiles under one lock for a whole process, and keeps what it compiled on disk, where any process finds it. So
 * where nothing is compiled yet, two processes on two cores start in not much more than half the time. A helper is
 * started only if a program asks for one, only with PoCL, and only once building something takes long, which says that
 * it is not in the store. It is this same program once more (/proc/self/exe), without arguments, input, output or open
 * files. It ends by itself, with its helper object, or with the process that started it; if it dies or hangs, what it
 * should have compiled is compiled here, as without it. What is drawn is the same in every bit.
 *
 *     int main(void)
 *     {
 *         if (karst_helper_is_this_process())
 *             return karst_helper_run();
 *         karst_helper *helper = karst_helper_create(&error);
 *         karst_engine_config config = {.world = "hills", .helper = helper};
 *         ...
 *
 * Linux only: elsewhere none is ever started. */
#ifndef KARST_HELPER_H
#define KARST_HELPER_H

#include <stdbool.h>

#include "karst/error.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct karst_helper karst_helper;

/* Starts nothing yet. For one engine at a time, and for the first that compiles. Errors: KARST_FAILED. */
karst_helper *karst_helper_create(karst_error *error);
/* Ends the process if it still runs. NULL is fine; after its engines. */
void karst_helper_destroy(karst_helper *helper);

/* Whether this process was started as a helper: then its main function is to return karst_helper_run() before it does
 * anything else. */
bool karst_helper_is_this_process(void);
/* Compiles what the engine of the other process will need. Returns the exit code. */
int karst_helper_run(void);

#ifdef __cplusplus
}
#endif
#endif
