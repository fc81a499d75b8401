/* Launching the kernel that looks at bricks along the sun's direction. */
#include "raycast/cast/sunward.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define LOCAL_SIZE 1 /* a brick is thousands of cells */

struct karst_sunward {
    karst_context *context;
    karst_cache_buffers cache;
    karst_program *program;
    cl_kernel survey;
    karst_buffer *bricks;
    bool aimed;
    float direction[3];
};

karst_sunward *karst_sunward_create(karst_context *context, const karst_cache_buffers *cache, karst_error *error)
{
    karst_sunward *sunward = calloc(1, sizeof(*sunward));
    if (!sunward) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    char options[128];
    snprintf(options, sizeof options, "-DSEGMENTS=%u %s", cache->num_segments, karst_cache_brick_option(cache));
    sunward->context = context;
    sunward->cache = *cache;
    size_t num_slots = (size_t)cache->num_bricks + KARST_CACHE_ROOT_BRICKS;
    sunward->bricks = karst_buffer_create_blank(context, "sunward", num_slots * sizeof(karst_sunward_brick), error);
    sunward->program = karst_program_build(context, "raycast/cast/sunward.cl", options, NULL, 0, error);
    if (sunward->program)
        sunward->survey = karst_program_kernel(sunward->program, "survey_sunward", error);
    if (!sunward->bricks || !sunward->survey) {
        karst_sunward_destroy(sunward);
        return NULL;
    }
    return sunward;
}

void karst_sunward_destroy(karst_sunward *sunward)
{
    if (!sunward)
        return;
    if (sunward->survey)
        clReleaseKernel(sunward->survey);
    karst_program_destroy(sunward->program);
    karst_buffer_destroy(sunward->bricks);
    free(sunward);
}

/* `loads`: NULL for all slots with an owner. */
static bool survey(karst_sunward *sunward, const karst_work *loads, karst_error *error)
{
    const karst_cache_buffers *c = &sunward->cache;
    karst_sunward_task task = {.from_loads = loads != NULL,
                               .num = loads ? loads->num_loads
                                            : (uint32_t)(c->brick_owner->size_bytes / sizeof(karst_brick_owner))};
    memcpy(task.direction, sunward->direction, sizeof sunward->direction);
    const karst_buffer *slots = loads ? loads->load_slots : c->brick_owner,
                       *results = loads ? loads->load_results : c->brick_owner; /* which is not looked at */
    return KARST_ARGUMENTS(sunward->survey, error, KARST_VALUE_ARG(task), KARST_BUFFER_ARG(slots),
                           KARST_BUFFER_ARG(results), KARST_BUFFER_ARG(c->brick_owner), KARST_BUFFER_ARG(c->brick_info),
                           KARST_BUFFER_ARG(c->bricks[0]), KARST_BUFFER_ARG(c->bricks[1]),
                           KARST_BUFFER_ARG(c->bricks[2]), KARST_BUFFER_ARG(c->bricks[3]),
                           KARST_BUFFER_ARG(c->bricks[4]), KARST_BUFFER_ARG(c->bricks[5]),
                           KARST_BUFFER_ARG(c->bricks[6]), KARST_BUFFER_ARG(c->bricks[7]),
                           KARST_VALUE_ARG(c->bricks_per_segment), KARST_BUFFER_ARG(sunward->bricks)) &&
           karst_launch(sunward->context, sunward->survey, KARST_STAGE_FINALISE, task.num, LOCAL_SIZE, error);
}

bool karst_sunward_is_aimed(const karst_sunward *sunward, const float direction[3])
{
    return sunward->aimed && !memcmp(direction, sunward->direction, sizeof sunward->direction);
}

bool karst_sunward_aim(karst_sunward *sunward, const float direction[3], karst_error *error)
{
    if (karst_sunward_is_aimed(sunward, direction))
        return true;
    memcpy(sunward->direction, direction, sizeof sunward->direction);
    sunward->aimed = survey(sunward, NULL, error);
    return sunward->aimed;
}

bool karst_sunward_note(karst_sunward *sunward, const karst_work *work, karst_error *error)
{
    return !sunward->aimed || !work->num_loads || survey(sunward, work, error);
}

const karst_buffer *karst_sunward_bricks(const karst_sunward *sunward) { return sunward->bricks; }
