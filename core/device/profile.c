/* Device time by stage: one profiling event for each command, START to END (PoCL's JIT falls before START). */
#include "core/device/profile.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/* Callers that never collect must not pile up events: the older half of this many is folded into the sums. */
#define MAX_PENDING 4096
/* Spans of one collection; more are dropped. */
#define MAX_SPANS 8192

typedef struct {
    cl_event event;
    karst_stage stage;
    karst_stream stream; /* KARST_NUM_STREAMS: none */
    char name[48]; /* of the kernel; only while tracing */
} timed_event;

struct karst_profile {
    timed_event *events; /* in order of enqueueing */
    size_t num_events, capacity;
    uint64_t ns[KARST_NUM_STAGES]; /* folded events and host time since the last collect */
    karst_stream stream;           /* of the launches to come */
    uint64_t stream_ns[KARST_NUM_STREAMS + 1];
    karst_span *spans;             /* NULL: no tracing */
    size_t num_spans;
    bool collected;     /* the spans are those of a collection that is over: the next one begins anew */
    int64_t to_host_ns; /* what to add to the device's times: nothing ends after it was waited for */
    bool has_to_host;
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
    if (profile)
        profile->stream = KARST_NUM_STREAMS;
    else
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
    free(profile->spans);
    free(profile);
}

bool karst_profile_trace(karst_context *context, bool tracing, karst_error *error)
{
    struct karst_profile *profile = context->profile;
    profile->num_spans = 0;
    if (tracing && !profile->spans) {
        profile->spans = malloc(MAX_SPANS * sizeof *profile->spans);
        return profile->spans || karst_fail(error, KARST_FAILED, "out of memory for a trace");
    }
    if (!tracing) {
        free(profile->spans);
        profile->spans = NULL;
    }
    return true;
}

size_t karst_profile_spans(const karst_context *context, karst_span *spans, size_t max_spans)
{
    const struct karst_profile *profile = context->profile;
    size_t num = profile->num_spans < max_spans ? profile->num_spans : max_spans;
    if (num > 0)
        memcpy(spans, profile->spans, num * sizeof *spans);
    return profile->num_spans;
}

static void add_span(struct karst_profile *profile, karst_track track, karst_stage stage, const char *name,
                     uint64_t start_ns, uint64_t end_ns)
{
    if (!profile->spans)
        return;
    if (profile->collected)
        profile->num_spans = 0;
    profile->collected = false;
    if (profile->num_spans == MAX_SPANS)
        return;
    karst_span *span = &profile->spans[profile->num_spans++];
    *span = (karst_span){.track = track, .stage = stage, .start_ns = start_ns, .end_ns = end_ns};
    snprintf(span->name, sizeof span->name, "%s", name);
}

/* Moves the queue's spans to the host's clock: the last command ended before it was known to have. */
static void move_to_host_clock(struct karst_profile *profile)
{
    uint64_t now_ns = karst_clock_ns(), last_ns = 0;
    for (size_t i = 0; i < profile->num_spans; i++)
        if (profile->spans[i].track == KARST_TRACK_QUEUE && profile->spans[i].end_ns > last_ns)
            last_ns = profile->spans[i].end_ns;
    if (last_ns == 0)
        return;
    int64_t to_host_ns = (int64_t)(now_ns - last_ns);
    /* The shortest wait tells best; but the clocks drift apart. */
    if (!profile->has_to_host || to_host_ns < profile->to_host_ns)
        profile->to_host_ns = to_host_ns;
    else
        profile->to_host_ns += (to_host_ns - profile->to_host_ns) / 8;
    profile->has_to_host = true;
    for (size_t i = 0; i < profile->num_spans; i++)
        if (profile->spans[i].track == KARST_TRACK_QUEUE) {
            profile->spans[i].start_ns += (uint64_t)profile->to_host_ns;
            profile->spans[i].end_ns += (uint64_t)profile->to_host_ns;
        }
}

/* Adds a finished event's time to its stage and releases it. */
static bool fold_event(struct karst_profile *profile, const timed_event timed, karst_error *error)
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
    if (end > start) {
        profile->ns[timed.stage] += end - start;
        profile->stream_ns[timed.stream] += end - start;
    }
    add_span(profile, KARST_TRACK_QUEUE, timed.stage, timed.name, start, end > start ? end : start);
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

bool karst_profile_add_event(karst_context *context, karst_stage stage, cl_kernel kernel, cl_event event,
                             karst_error *error)
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
    timed_event *timed = &profile->events[profile->num_events++];
    timed->event = event;
    timed->stage = stage;
    timed->stream = profile->stream;
    timed->name[0] = 0;
    if (profile->spans &&
        clGetKernelInfo(kernel, CL_KERNEL_FUNCTION_NAME, sizeof timed->name, timed->name, NULL) != CL_SUCCESS)
        snprintf(timed->name, sizeof timed->name, "%s", karst_stage_name(stage));
    return true;
}

void karst_profile_add_host(karst_context *context, karst_stage stage, uint64_t ns)
{
    if ((unsigned)stage >= KARST_NUM_STAGES)
        return;
    uint64_t now_ns = karst_clock_ns();
    context->profile->ns[stage] += ns;
    add_span(context->profile, KARST_TRACK_HOST, stage, karst_stage_name(stage), now_ns - ns, now_ns);
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
    if (profile->spans && !profile->collected) {
        move_to_host_clock(profile);
        profile->collected = true;
    }
    return ok;
}

void karst_profile_set_stream(karst_context *context, karst_stream stream) { context->profile->stream = stream; }

void karst_profile_take_streams(karst_context *context, uint64_t ns[KARST_NUM_STREAMS])
{
    memcpy(ns, context->profile->stream_ns, KARST_NUM_STREAMS * sizeof *ns);
    memset(context->profile->stream_ns, 0, sizeof context->profile->stream_ns);
}
