#include "cache/commit.h"

#include <pthread.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

/* At once, so that an end need not wait for long. */
#define STEP_SLOTS 64u
/* Behind whatever draws; but when memory is needed at last, it must not have starved. */
#define NICENESS 10

struct karst_commit {
    karst_cache_buffers buffers;
    pthread_t thread;
    pthread_mutex_t lock;
    pthread_cond_t changed;
    uint32_t wanted_end, end; /* slots below which memory is asked for, and is there */
    bool stops;
};

/* Slots first to end, which may lie in two segments. */
static void commit_slots(const karst_cache_buffers *b, uint32_t first, uint32_t end)
{
    const size_t brick_bytes = KARST_BRICK_BYTES((size_t)b->brick_bits);
    while (first < end) {
        uint32_t segment = first / b->bricks_per_segment, in_segment = first % b->bricks_per_segment;
        uint32_t rest = b->bricks_per_segment - in_segment, count = end - first < rest ? end - first : rest;
        karst_buffer_commit(b->bricks[segment], in_segment * brick_bytes, count * brick_bytes);
        first += count;
    }
}

/* What there is of each slot beside its brick: little, all over the pools and read from the first frames on. */
static void commit_tables(const karst_cache_buffers *b)
{
    karst_buffer *const tables[] = {b->nodes,       b->tile_info,   b->brick_info, b->brick_owner,   b->tile_stamp,
                                    b->brick_stamp, b->brick_fallback, b->want_brick, b->want_children, b->want_rays};
    for (size_t i = 0; i < sizeof tables / sizeof *tables; i++)
        karst_buffer_commit(tables[i], 0, tables[i]->size_bytes);
}

static void *run(void *user)
{
    karst_commit *commit = user;
    /* On Linux a priority is a thread's. */
    setpriority(PRIO_PROCESS, (id_t)syscall(SYS_gettid), NICENESS);
    commit_tables(&commit->buffers);
    pthread_mutex_lock(&commit->lock);
    while (!commit->stops) {
        uint32_t first = commit->end, end = commit->wanted_end;
        if (first >= end) {
            pthread_cond_wait(&commit->changed, &commit->lock);
            continue;
        }
        end = end - first > STEP_SLOTS ? first + STEP_SLOTS : end;
        pthread_mutex_unlock(&commit->lock);
        commit_slots(&commit->buffers, first, end);
        pthread_mutex_lock(&commit->lock);
        commit->end = end;
        pthread_cond_broadcast(&commit->changed);
    }
    pthread_mutex_unlock(&commit->lock);
    return NULL;
}

karst_commit *karst_commit_create(const karst_cache_buffers *buffers)
{
    karst_commit *commit = calloc(1, sizeof *commit);
    if (!commit)
        return NULL;
    commit->buffers = *buffers;
    pthread_mutex_init(&commit->lock, NULL);
    pthread_cond_init(&commit->changed, NULL);
    if (pthread_create(&commit->thread, NULL, run, commit) == 0)
        return commit;
    pthread_cond_destroy(&commit->changed);
    pthread_mutex_destroy(&commit->lock);
    free(commit);
    return NULL;
}

void karst_commit_destroy(karst_commit *commit)
{
    if (!commit)
        return;
    pthread_mutex_lock(&commit->lock);
    commit->stops = true;
    pthread_cond_broadcast(&commit->changed);
    pthread_mutex_unlock(&commit->lock);
    pthread_join(commit->thread, NULL);
    pthread_cond_destroy(&commit->changed);
    pthread_mutex_destroy(&commit->lock);
    free(commit);
}

void karst_commit_until(karst_commit *commit, uint32_t end)
{
    pthread_mutex_lock(&commit->lock);
    if (end > commit->wanted_end) {
        commit->wanted_end = end;
        pthread_cond_broadcast(&commit->changed);
    }
    pthread_mutex_unlock(&commit->lock);
}

uint32_t karst_commit_wait(karst_commit *commit)
{
    pthread_mutex_lock(&commit->lock);
    while (commit->end < commit->wanted_end)
        pthread_cond_wait(&commit->changed, &commit->lock);
    uint32_t end = commit->end;
    pthread_mutex_unlock(&commit->lock);
    return end;
}
