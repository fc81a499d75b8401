#include "reference/rows.h"

#include <pthread.h>
#include <time.h>
#include <unistd.h>

int karst_rows_num_threads(int asked)
{
    const int num = asked ? asked : (int)sysconf(_SC_NPROCESSORS_ONLN);
    return num < 1 ? 1 : num > KARST_ROWS_MAX_THREADS ? KARST_ROWS_MAX_THREADS : num;
}

int karst_rows_take(karst_rows *rows)
{
    const int y = atomic_load(&rows->stop) ? rows->num_rows : atomic_fetch_add(&rows->next, 1);
    return y < rows->num_rows ? y : -1;
}

void karst_rows_finish(karst_rows *rows) { atomic_fetch_add(&rows->done, 1); }

/* Until all rows are done, or `progress` has had enough. */
static bool watch(karst_rows *rows, bool (*progress)(void *user, double share), void *user, karst_error *error)
{
    const struct timespec pause = {.tv_nsec = 5000000};
    while (atomic_load(&rows->done) < rows->num_rows) {
        if (progress && !progress(user, (double)atomic_load(&rows->done) / rows->num_rows)) {
            atomic_store(&rows->stop, true);
            return karst_fail(error, KARST_FAILED, "interrupted");
        }
        nanosleep(&pause, NULL);
    }
    return true;
}

bool karst_rows_run(karst_rows *rows, void *(*work)(void *worker), void *workers, size_t worker_bytes, int num_threads,
                    bool (*progress)(void *user, double share), void *user, karst_error *error)
{
    pthread_t threads[KARST_ROWS_MAX_THREADS];
    int started = 0;
    for (; started < num_threads; started++)
        if (pthread_create(&threads[started], NULL, work, (char *)workers + (size_t)started * worker_bytes) != 0)
            break;
    const bool good = started > 0 ? watch(rows, progress, user, error)
                                  : karst_fail(error, KARST_FAILED, "no thread could be started");
    for (int i = 0; i < started; i++)
        pthread_join(threads[i], NULL);
    return good;
}
