/* Threads: what the steps of an import run on. Only the thread that called asks for progress. */
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <unistd.h>

#include "core/points/import_internal.h"

#define MAX_THREADS 64u

static uint32_t num_threads_of(const points_import *import)
{
    long cores = sysconf(_SC_NPROCESSORS_ONLN);
    uint32_t num = import->config->num_threads ? import->config->num_threads : cores > 0 ? (uint32_t)cores : 1;
    return num < MAX_THREADS ? num : MAX_THREADS;
}

/* More may be begun than there is. */
static double share_of(uint64_t done, const points_loop *loop)
{
    return done < loop->num ? (double)done / (double)loop->num : 1;
}

/* ---- blocks in any order ---- */

typedef struct {
    atomic_uint_fast64_t next;
    atomic_bool stopped;
    const points_loop *loop;
    karst_points_work work;
    void *user;
} crew;

static bool do_a_block(crew *c)
{
    const points_loop *loop = c->loop;
    uint64_t begin = atomic_fetch_add(&c->next, loop->block);
    if (begin >= loop->end || atomic_load(&c->stopped))
        return false;
    c->work(c->user, begin, loop->end - begin < loop->block ? loop->end : begin + loop->block);
    return true;
}

static void *help(void *user)
{
    while (do_a_block(user))
        ;
    return NULL;
}

bool karst_points_in_parallel(points_import *import, const points_loop *loop, karst_points_work work, void *user,
                              karst_error *error)
{
    crew c = {.next = loop->first, .loop = loop, .work = work, .user = user};
    pthread_t threads[MAX_THREADS];
    const uint32_t num_threads = num_threads_of(import);
    uint32_t num_started = 0;
    while (num_started + 1 < num_threads && pthread_create(&threads[num_started], NULL, help, &c) == 0)
        num_started++;
    bool goes_on = karst_points_go_on(import, loop->what, share_of(loop->first, loop), error);
    while (goes_on && do_a_block(&c)) {
        if (loop->maps)
            karst_points_stay_small(import);
        goes_on = karst_points_go_on(import, loop->what, share_of(atomic_load(&c.next), loop), error);
    }
    if (!goes_on)
        atomic_store(&c.stopped, true);
    for (uint32_t i = 0; i < num_started; i++)
        pthread_join(threads[i], NULL);
    return goes_on;
}

/* ---- blocks in turns ---- */

typedef struct {
    const points_turns *turns;
    void *user;
    pthread_mutex_t taking; /* guards next, num_taken, at_end, share; held while a block is taken */
    uint64_t next, num_taken;
    bool at_end;
    double share;
    pthread_mutex_t putting; /* guards num_put and why; not held while a block is put: only one has its turn */
    pthread_cond_t was_put;
    uint64_t num_put;
    karst_error why; /* the first failure */
    atomic_bool stopped;
} turns_crew;

static void stop(turns_crew *c, const karst_error *why)
{
    pthread_mutex_lock(&c->putting);
    if (why && !atomic_load(&c->stopped))
        c->why = *why;
    atomic_store(&c->stopped, true);
    pthread_cond_broadcast(&c->was_put);
    pthread_mutex_unlock(&c->putting);
}

/* Takes the next block, which has a number; false: there is none, or taking failed. */
static bool take(turns_crew *c, points_block *block, uint64_t *number)
{
    const points_turns *turns = c->turns;
    const points_loop *loop = &turns->loop;
    karst_error why = {0};
    pthread_mutex_lock(&c->taking);
    bool done = true, has = !c->at_end && !atomic_load(&c->stopped);
    if (has && turns->take) {
        done = turns->take(c->user, block, &c->share, &has, &why);
    } else if (has && (has = c->next < loop->end)) {
        block->begin = c->next;
        block->end = loop->end - c->next < loop->block ? loop->end : c->next + loop->block;
        c->next = block->end;
        c->share = share_of(block->begin, loop);
    }
    c->at_end = c->at_end || !has || !done;
    *number = c->num_taken;
    c->num_taken += done && has;
    pthread_mutex_unlock(&c->taking);
    if (!done)
        stop(c, &why);
    return done && has;
}

/* Once all blocks before are put. */
static bool put_in_turn(turns_crew *c, points_block *block, uint64_t number, karst_error *why)
{
    pthread_mutex_lock(&c->putting);
    while (c->num_put != number && !atomic_load(&c->stopped))
        pthread_cond_wait(&c->was_put, &c->putting);
    bool done = !atomic_load(&c->stopped);
    pthread_mutex_unlock(&c->putting);
    if (!done || (c->turns->put && !c->turns->put(c->user, block, why)))
        return false;
    pthread_mutex_lock(&c->putting);
    c->num_put++;
    pthread_cond_broadcast(&c->was_put);
    pthread_mutex_unlock(&c->putting);
    return true;
}

/* A block from begin to end; false: there is none, or something failed. */
static bool do_a_turn(turns_crew *c, points_block *block)
{
    karst_error why = {0};
    uint64_t number;
    if (!take(c, block, &number))
        return false;
    bool done = !c->turns->work || c->turns->work(c->user, block, &why);
    done = done && put_in_turn(c, block, number, &why);
    if (!done)
        stop(c, &why);
    return done;
}

static bool open_slot(turns_crew *c, points_block *block)
{
    const karst_error why = {.status = KARST_FAILED, .message = "out of memory"};
    *block = (points_block){.slot = calloc(1, c->turns->slot_bytes + 1)};
    if (!block->slot)
        stop(c, &why);
    return block->slot != NULL;
}

static void close_slot(turns_crew *c, points_block *block)
{
    if (block->slot && c->turns->clear)
        c->turns->clear(block->slot);
    free(block->slot);
}

static void *help_in_turns(void *user)
{
    turns_crew *c = user;
    points_block block;
    if (open_slot(c, &block))
        while (do_a_turn(c, &block))
            ;
    close_slot(c, &block);
    return NULL;
}

static double share_taken(turns_crew *c)
{
    pthread_mutex_lock(&c->taking);
    double share = c->share;
    pthread_mutex_unlock(&c->taking);
    return share;
}

bool karst_points_in_turns(points_import *import, const points_turns *turns, void *user, karst_error *error)
{
    turns_crew c = {.turns = turns, .user = user, .next = turns->loop.first};
    pthread_t threads[MAX_THREADS];
    points_block block;
    uint32_t num_threads = num_threads_of(import), num_started = 0;
    if (turns->most_threads && num_threads > turns->most_threads)
        num_threads = turns->most_threads;
    pthread_mutex_init(&c.taking, NULL);
    pthread_mutex_init(&c.putting, NULL);
    pthread_cond_init(&c.was_put, NULL);
    while (num_started + 1 < num_threads && pthread_create(&threads[num_started], NULL, help_in_turns, &c) == 0)
        num_started++;
    bool goes_on = true, is_open = open_slot(&c, &block);
    while (is_open && (goes_on = karst_points_go_on(import, turns->loop.what, share_taken(&c), error)) &&
           do_a_turn(&c, &block))
        if (turns->loop.maps)
            karst_points_stay_small(import);
    if (!goes_on)
        stop(&c, NULL);
    for (uint32_t i = 0; i < num_started; i++)
        pthread_join(threads[i], NULL);
    close_slot(&c, &block);
    const bool done = !atomic_load(&c.stopped);
    pthread_cond_destroy(&c.was_put);
    pthread_mutex_destroy(&c.putting);
    pthread_mutex_destroy(&c.taking);
    return done || (goes_on && karst_fail(error, c.why.status, "%s", c.why.message));
}
