/* Rows of a picture, which threads take one after the other. */
#ifndef KARST_REFERENCE_ROWS_H
#define KARST_REFERENCE_ROWS_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>

#include "karst/error.h"

#define KARST_ROWS_MAX_THREADS 256

/* All but num_rows begins as zeros. */
typedef struct {
    int num_rows;
    atomic_int next, done;
    atomic_bool stop; /* whether nobody wants the rest */
} karst_rows;

/* The number of threads for a caller who asked for so many; 0: as many as there are cores. */
int karst_rows_num_threads(int asked);

/* For a worker: its next row, or -1 if there is none. */
int karst_rows_take(karst_rows *rows);
/* It is done with one. */
void karst_rows_finish(karst_rows *rows);

/* Runs `work` on threads of their own, each with one of num_threads workers of worker_bytes each, and returns when all
 * of them have. Meanwhile `progress`, which may be NULL, hears of the share of rows that are done; if it returns false,
 * the rest is left out and the call fails with KARST_FAILED, as it does if no thread can be started. */
bool karst_rows_run(karst_rows *rows, void *(*work)(void *worker), void *workers, size_t worker_bytes, int num_threads,
                    bool (*progress)(void *user, double share), void *user, karst_error *error);

#endif
