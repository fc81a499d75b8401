#include "core/export/crew.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <unistd.h>

enum { MAX_THREADS = 256, PARTS_OF_THREAD = 64, MOST_OF_PART = 4096 };
#define STACK_BYTES (8u << 20)

typedef struct {
    const karst_query_config *config;
    void (*work)(void *user, karst_sampler *sampler, size_t first, size_t end);
    void *user;
    size_t num, part;
    atomic_size_t next;
    atomic_bool is_stopped;
} crew;

typedef struct {
    crew *c;
    karst_sampler *sampler;
    bool is_leader; /* on the calling thread */
} member;

static void *run_member(void *argument)
{
    const member *m = argument;
    crew *c = m->c;
    for (size_t first; (first = atomic_fetch_add(&c->next, c->part)) < c->num && !atomic_load(&c->is_stopped);) {
        c->work(c->user, m->sampler, first, c->num - first < c->part ? c->num : first + c->part);
        if (m->is_leader && c->config->progress &&
            !c->config->progress(c->config->user, (double)first / (double)c->num))
            atomic_store(&c->is_stopped, true);
    }
    return NULL;
}

static int choose_num_threads(const karst_query_config *config)
{
    const long cores = sysconf(_SC_NPROCESSORS_ONLN);
    if (config->num_threads)
        return config->num_threads;
    return cores < 1 ? 1 : cores > MAX_THREADS ? MAX_THREADS : (int)cores;
}

static karst_sampler *create_sampler(const karst_world *world, const karst_query_config *config, karst_error *error)
{
    karst_sampler *sampler = karst_sampler_create(world, error);
    if (sampler && config->num_edits && !karst_sampler_set_edits(sampler, config->edits, config->num_edits, error)) {
        karst_sampler_destroy(sampler);
        return NULL;
    }
    return sampler;
}

bool karst_crew_run(const karst_world *world, const karst_query_config *config, size_t num,
                    void (*work)(void *user, karst_sampler *sampler, size_t first, size_t end), void *user,
                    karst_error *error)
{
    if (config->num_threads < 0 || config->num_threads > MAX_THREADS)
        return karst_fail(error, KARST_USAGE, "%d threads: 0 to %d", config->num_threads, MAX_THREADS);
    const int num_threads = choose_num_threads(config);
    size_t part = num / ((size_t)num_threads * PARTS_OF_THREAD) + 1;
    crew c = {.config = config,
              .work = work,
              .user = user,
              .num = num,
              .part = part > MOST_OF_PART ? MOST_OF_PART : part};
    member members[MAX_THREADS] = {{0}};
    pthread_t threads[MAX_THREADS];
    bool is_running[MAX_THREADS] = {false}, done = true;
    pthread_attr_t attributes;
    if (pthread_attr_init(&attributes) != 0)
        return karst_fail(error, KARST_FAILED, "out of memory");
    pthread_attr_setstacksize(&attributes, STACK_BYTES);
    for (int i = 0; i < num_threads && done; i++) {
        members[i] = (member){&c, create_sampler(world, config, error), i == 0};
        done = members[i].sampler;
    }
    /* Where a thread cannot be started, the others do its work. */
    for (int i = 1; i < num_threads && done; i++)
        is_running[i] = pthread_create(&threads[i], &attributes, run_member, &members[i]) == 0;
    if (done)
        run_member(&members[0]);
    for (int i = 0; i < num_threads; i++) {
        if (is_running[i])
            pthread_join(threads[i], NULL);
        karst_sampler_destroy(members[i].sampler);
    }
    pthread_attr_destroy(&attributes);
    if (done && atomic_load(&c.is_stopped))
        return karst_fail(error, KARST_FAILED, "it was stopped");
    return done;
}
