/* Device time by stage: one profiling event for each command, START to END (PoCL's JIT falls before START). */
#include "core/profile.h"

#include <stdlib.h>
#include <string.h>
#include <time.h>

/* Callers that never collect must not pile up events: the older half of this many is folded into the sums. */
#define MAX_PENDING 4096

typedef struct {
    cl_event event;
    karst_stage stage;
} timed_event;

struct karst_profile {
    timed_event *events; /* in order of enqueueing */
    size_t num_events, capacity;
    uint64_t ns[KARST_NUM_STAGES]; /* folded events and host time since the last collect */
};

uint64_t karst_clock_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

struct karst_profile *karst_profile_create(karst_error *error)
{
    struct karst_profile *profile = calloc(1, sizeof(*profile));
    if (!profile)
        karst_fail(error, KARST_FAILED, "out of memory");
    return profile;
}

void karst_profile_destroy(struct karst_profile *profile)
{
    if (!profile)
        return;
    for (size_t i = 0; i < profile->num_events; i++)
        clReleaseEvent(profile->events[i].event);
    free(profile->events);
    free(profile);
}

/* Adds a finished event's time to its stage and releases it. */
static bool fold_event(struct karst_profile *profile, timed_event timed, karst_error *error)
{
    cl_int status = CL_COMPLETE;
    cl_int code = clGetEventInfo(timed.event, CL_EVENT_COMMAND_EXECUTION_STATUS, sizeof(status), &status, NULL);
    cl_ulong start = 0, end = 0;
    if (code == CL_SUCCESS && status >= 0)
        code = clGetEventProfilingInfo(timed.event, CL_PROFILING_COMMAND_START, sizeof(start), &start, NULL);
    if (code == CL_SUCCESS && status >= 0)
        code = clGetEventProfilingInfo(timed.event, CL_PROFILING_COMMAND_END, sizeof(end), &end, NULL);
    clReleaseEvent(timed.event);
    if (status < 0)
        return karst_fail(error, KARST_FAILED, "the device failed during %s: %s", karst_stage_name(timed.stage),
                          karst_cl_error_name(status));
    if (code != CL_SUCCESS)
        return karst_fail(error, KARST_FAILED, "cannot time %s: %s", karst_stage_name(timed.stage),
                          karst_cl_error_name(code));
    if (end > start)
        profile->ns[timed.stage] += end - start;
    return true;
}

/* Folds the `count` oldest events, which must be finished. Goes on after a failure, so that none is kept. */
static bool fold_oldest(struct karst_profile *profile, size_t count, karst_error *error)
{
    bool ok = true;
    for (size_t i = 0; i < count; i++)
        ok = fold_event(profile, profile->events[i], error) && ok;
    profile->num_events -= count;
    if (profile->num_events > 0)
        memmove(profile->events, profile->events + count, profile->num_events * sizeof(*profile->events));
    return ok;
}

bool karst_profile_add_event(karst_context *context, karst_stage stage, cl_event event, karst_error *error)
{
    struct karst_profile *profile = context->profile;
    if (profile->num_events == MAX_PENDING) {
        size_t half = MAX_PENDING / 2;
        /* The queue is in order: once the last of them is done, all are. What failed shows in its own status. */
        clWaitForEvents(1, &profile->events[half - 1].event);
        if (!fold_oldest(profile, half, error)) {
            clReleaseEvent(event);
            return false;
        }
    }
    if (profile->num_events == profile->capacity) {
        size_t capacity = profile->capacity ? profile->capacity * 2 : 64;
        timed_event *grown = realloc(profile->events, capacity * sizeof(*grown));
        if (!grown) {
            clReleaseEvent(event);
            return karst_fail(error, KARST_FAILED, "out of memory");
        }
        profile->events = grown;
        profile->capacity = capacity;
    }
    profile->events[profile->num_events++] = (timed_event){event, stage};
    return true;
}

void karst_profile_add_host(karst_context *context, karst_stage stage, uint64_t ns)
{
    if ((unsigned)stage < KARST_NUM_STAGES)
        context->profile->ns[stage] += ns;
}

bool karst_profile_collect(karst_context *context, uint64_t ns[KARST_NUM_STAGES], karst_error *error)
{
    struct karst_profile *profile = context->profile;
    bool ok = karst_finish(context, error);
    ok = fold_oldest(profile, profile->num_events, error) && ok;
    for (int stage = 0; stage < KARST_NUM_STAGES; stage++) {
        ns[stage] += profile->ns[stage];
        profile->ns[stage] = 0;
    }
    return ok;
}
