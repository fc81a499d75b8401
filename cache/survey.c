/* Survey: launchers of survey.cl, and what is read of it. */
#include "cache/survey.h"

#include <stdlib.h>

#define STAGE KARST_STAGE_COLLECT

bool karst_survey_init(karst_survey *survey, karst_context *context, const karst_cache_buffers *pools, bool has_tiles,
                       karst_error *error)
{
    *survey = (karst_survey){.context = context, .shape = karst_pass_shape_of(context), .pools = pools};
    survey->num_slots[KARST_SURVEY_TILES] = has_tiles ? pools->num_tiles : 0;
    survey->num_slots[KARST_SURVEY_BRICKS] = pools->num_bricks;
    survey->num_request_chunks = (uint32_t)(pools->want_chunk->size_bytes / sizeof(uint32_t));
    size_t num_chunks = karst_pass_chunks(&survey->shape, survey->num_request_chunks);
    for (uint32_t kind = 0; kind < 2; kind++) {
        uint32_t num = survey->num_slots[kind];
        size_t size_bytes = (num ? num : 1) * sizeof(karst_survey_slot); /* no buffer is empty */
        num_chunks += karst_pass_chunks(&survey->shape, num);
        survey->found[kind] = karst_buffer_create(context, "usage_lists", size_bytes, NULL, error);
        survey->pieces[kind] = karst_buffer_create(context, "usage_lists", size_bytes, NULL, error);
        if (!survey->found[kind] || !survey->pieces[kind])
            return false;
        survey->lists[kind].slots = malloc(size_bytes);
        if (!survey->lists[kind].slots)
            return karst_fail(error, KARST_FAILED, "out of memory for a list of %u slots", num);
    }
    size_t active_bytes = survey->num_request_chunks * sizeof(uint32_t);
    survey->scan = karst_scan_best();
    survey->host_active = malloc(active_bytes);
    if (!survey->host_active)
        return karst_fail(error, KARST_FAILED, "out of memory for a list of request chunks");
    survey->counts = karst_buffer_create(context, "usage_lists", num_chunks * sizeof(cl_uint4), NULL, error);
    survey->result = karst_buffer_create(context, "usage_lists", sizeof(karst_survey_result), NULL, error);
    survey->active = karst_buffer_create(context, "requests", active_bytes, NULL, error);
    survey->active_pieces = karst_buffer_create(context, "requests", active_bytes, NULL, error);
    return survey->counts && survey->result && survey->active && survey->active_pieces;
}

bool karst_survey_take_kernels(karst_survey *survey, karst_program *program, karst_error *error)
{
    return (survey->look = karst_program_kernel(program, "karst_survey", error)) &&
           (survey->pack = karst_program_kernel(program, "karst_survey_pack", error));
}

void karst_survey_finish(karst_survey *survey)
{
    if (survey->look)
        clReleaseKernel(survey->look);
    if (survey->pack)
        clReleaseKernel(survey->pack);
    karst_buffer_destroy(survey->counts);
    karst_buffer_destroy(survey->result);
    karst_buffer_destroy(survey->active);
    karst_buffer_destroy(survey->active_pieces);
    for (uint32_t kind = 0; kind < 2; kind++) {
        karst_buffer_destroy(survey->found[kind]);
        karst_buffer_destroy(survey->pieces[kind]);
        free(survey->lists[kind].slots);
    }
    free(survey->host_active);
    *survey = (karst_survey){0};
}

static bool launch(karst_survey *survey, karst_error *error)
{
    const karst_cache_buffers *pools = survey->pools;
    const karst_survey_ask *ask = &survey->ask;
    uint32_t num_items = 0;
    for (uint32_t kind = 0; kind < KARST_SURVEY_KINDS; kind++)
        num_items += karst_pass_chunks(&survey->shape, ask->num[kind]);
    return KARST_ARGUMENTS(
               survey->look, error, KARST_BUFFER_ARG(pools->tile_stamp), KARST_BUFFER_ARG(pools->brick_stamp),
               KARST_BUFFER_ARG(pools->brick_fallback), KARST_BUFFER_ARG(pools->want_chunk), KARST_VALUE_ARG(*ask),
               KARST_BUFFER_ARG(survey->counts), KARST_BUFFER_ARG(survey->pieces[KARST_SURVEY_TILES]),
               KARST_BUFFER_ARG(survey->pieces[KARST_SURVEY_BRICKS]), KARST_BUFFER_ARG(survey->active_pieces)) &&
           karst_launch(survey->context, survey->look, STAGE, num_items, survey->shape.chunk_local, error) &&
           KARST_ARGUMENTS(survey->pack, error, KARST_VALUE_ARG(*ask), KARST_BUFFER_ARG(survey->counts),
                           KARST_BUFFER_ARG(survey->pieces[KARST_SURVEY_TILES]),
                           KARST_BUFFER_ARG(survey->pieces[KARST_SURVEY_BRICKS]),
                           KARST_BUFFER_ARG(survey->active_pieces), KARST_BUFFER_ARG(survey->found[KARST_SURVEY_TILES]),
                           KARST_BUFFER_ARG(survey->found[KARST_SURVEY_BRICKS]), KARST_BUFFER_ARG(survey->active),
                           KARST_BUFFER_ARG(survey->result)) &&
           karst_launch(survey->context, survey->pack, STAGE, survey->shape.scan_width, survey->shape.scan_width,
                        error);
}

static void take_ask(karst_survey *survey, const karst_survey_ask *asked)
{
    karst_survey_ask *ask = &survey->ask;
    *ask = *asked;
    ask->num[KARST_SURVEY_TILES] = survey->num_slots[KARST_SURVEY_TILES];
    ask->num[KARST_SURVEY_BRICKS] = survey->num_slots[KARST_SURVEY_BRICKS];
    ask->num[KARST_SURVEY_REQUESTS] = survey->num_request_chunks;
}

bool karst_survey_begin(karst_survey *survey, const karst_survey_ask *asked, karst_error *error)
{
    const karst_survey_ask *ask = &survey->ask;
    take_ask(survey, asked);
    if (!launch(survey, error))
        return false;
    /* Some more than there were last time: mostly these are all. */
    for (uint32_t kind = 0; kind < 2; kind++) {
        karst_survey_list *list = &survey->lists[kind];
        if (!ask->ages[kind])
            continue;
        uint32_t ahead = list->num + list->num / 4 + 256, num = survey->num_slots[kind];
        list->num_read = ahead < num ? ahead : num;
        if (!karst_buffer_fetch(survey->found[kind], 0, list->slots, list->num_read * sizeof(*list->slots), error))
            return false;
    }
    return true;
}

/* What is known of the lists by now. */
static void enter_lists(karst_survey *survey)
{
    const karst_survey_result *result = &survey->host_result;
    const karst_survey_ask *ask = &survey->ask;
    for (uint32_t kind = 0; kind < 2; kind++)
        if (ask->ages[kind]) {
            karst_survey_list *list = &survey->lists[kind];
            list->num = result->num_found[kind];
            list->num_left_out = result->num_left_out[kind];
            list->age = ask->ages[kind];
            list->stand_ins = ask->stand_ins;
            list->valid = true;
        }
}

bool karst_survey_end(karst_survey *survey, karst_error *error)
{
    if (!karst_buffer_read(survey->result, 0, &survey->host_result, sizeof(survey->host_result), error))
        return false;
    enter_lists(survey);
    return true;
}

void karst_survey_by_host(karst_survey *survey, const karst_survey_ask *ask, const karst_mapped *mapped)
{
    uint64_t start_ns = karst_clock_ns();
    const uint32_t *const stamps[2] = {mapped->tile_stamp, mapped->brick_stamp};
    const uint32_t *const others[2] = {mapped->tile_stamp, mapped->brick_fallback};
    karst_survey_result *result = &survey->host_result;
    take_ask(survey, ask);
    for (uint32_t kind = 0; kind < 2; kind++) {
        karst_survey_list *list = &survey->lists[kind];
        /* A list that is not asked for stays as it is, and nothing is written to it. */
        karst_scan_counts counts =
            karst_scan_slots(survey->scan, stamps[kind], others[kind], &survey->ask, kind, list->slots);
        result->num_used[kind] = counts.num_used;
        result->num_found[kind] = counts.num_found;
        result->num_left_out[kind] = counts.num_left_out;
        if (ask->ages[kind])
            list->num_read = counts.num_found;
    }
    result->num_active =
        karst_scan_list(survey->scan, mapped->want_chunk, survey->num_request_chunks, ask->serial, survey->host_active);
    enter_lists(survey);
    karst_profile_add_host(survey->context, STAGE, karst_clock_ns() - start_ns);
}

bool karst_survey_read_found(karst_survey *survey, uint32_t kind, karst_error *error)
{
    karst_survey_list *list = &survey->lists[kind];
    uint32_t have = list->num_read;
    if (have >= list->num)
        return true;
    list->num_read = list->num;
    return karst_buffer_read(survey->found[kind], have * sizeof(*list->slots), list->slots + have,
                             (list->num - have) * sizeof(*list->slots), error);
}
