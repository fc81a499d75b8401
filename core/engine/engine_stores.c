/* Stores beside the land: what the engine keeps for each content that its world has, and their part of each round.
 *
 * An engine has stores for what its first world has; what another world has more is not shown. A content that the
 * present world lacks keeps its store, empty. Without any, nothing of this costs anything. */
#include <math.h>
#include <stdio.h>

#include "core/engine/engine_parts.h"
#include "producers/points/points_kind.h"
#include "producers/steps/medium.h"
#include "producers/stores.h"

/* While a store lacked something in its last round, the others leave it so much of what a round may make. */
#define KEPT_SHARE 0.25

unsigned karst_engine_contents_of(const karst_world_file *file)
{
    unsigned contents = 0;
    for (int i = 0; i < KARST_NUM_CONTENTS; i++)
        contents |= file->content[i] ? 1u << i : 0u;
    return contents;
}

uint32_t karst_engine_num_contents(unsigned contents) { return (uint32_t)__builtin_popcount(contents); }

unsigned karst_engine_contents(const karst_engine *engine)
{
    unsigned contents = 0;
    for (int i = 0; i < KARST_NUM_CONTENTS; i++)
        contents |= engine->stores[i].store ? 1u << i : 0u;
    return contents;
}

bool karst_engine_has_content(const karst_engine *engine, int content)
{
    return engine->stores[content].store && engine->shown.content[content].producer;
}

bool karst_engine_create_stores(karst_engine *engine, const karst_engine_config *config, uint32_t num_bricks,
                                const char *cast_options, karst_error *error)
{
    for (int i = 0; i < KARST_NUM_CONTENTS; i++) {
        const karst_store_config store = {.name = karst_content_names[i],
                                          .num_bricks = num_bricks,
                                          .max_segment_bytes = config->max_segment_bytes,
                                          .brick_bits = config->brick_bits};
        karst_engine_store *of = &engine->stores[i];
        if (!engine->shown.file->content[i])
            continue;
        of->store = karst_cache_add_store(engine->cache, &store, error);
        if (i == KARST_CONTENT_AIR) { /* rays march through it in their own way: engine_media.c */
            if (!of->store)
                return false;
            continue;
        }
        of->caster = of->store ? karst_caster_create_with(engine->context, karst_store_get_buffers(of->store),
                                                          cast_options, error)
                               : NULL;
        if (!of->caster)
            return false;
    }
    return true;
}

void karst_engine_destroy_stores(karst_engine *engine)
{
    for (int i = 0; i < KARST_NUM_CONTENTS; i++)
        karst_caster_destroy(engine->stores[i].caster);
}

/* ---- what fills them ---- */

karst_world_build karst_engine_air_build(const karst_cache_buffers *buffers, char finalise[64])
{
    snprintf(finalise, 64, "%s " KARST_MEDIUM_OPTION, karst_cache_brick_option(buffers));
    return (karst_world_build){.shape = KARST_SHAPE_AUTO, .options = KARST_MEDIUM_OPTION, .finalise_options = finalise};
}

/* `finalise` holds its options, which are borrowed. */
static karst_world_build build_of(const karst_cache_buffers *buffers, const karst_engine_wishes *wishes, int content,
                                  bool has_layers, char finalise[64])
{
    if (content == KARST_CONTENT_AIR)
        return karst_engine_air_build(buffers, finalise);
    return (karst_world_build){.shape = KARST_SHAPE_AUTO,
                               .finalise_options = karst_cache_brick_option(buffers),
                               .in_two_steps = has_layers,
                               .start_on_host = wishes->start_on_host && !has_layers};
}

bool karst_engine_world_build_contents(karst_engine_world *world, karst_context *context,
                                       const karst_cache_buffers *buffers, const karst_engine_wishes *wishes,
                                       karst_error *error)
{
    for (int i = 0; i < KARST_NUM_CONTENTS; i++) {
        char finalise[64];
        const bool has_layers =
            i == KARST_CONTENT_CLEAR && karst_clear_points_kind.is_named(world->file->program);
        const karst_world_build build = build_of(buffers, wishes, i, has_layers, finalise);
        const karst_world_file *file = world->file->content[i];
        if (!file || !(wishes->contents >> i & 1u))
            continue;
        world->content[i].producer =
            karst_world_file_producer_built(context, file, world->seed, wishes->max_loads, &build, error);
        if (!world->content[i].producer)
            return false;
    }
    return true;
}

void karst_engine_world_close_contents(karst_engine_world *world)
{
    for (int i = 0; i < KARST_NUM_CONTENTS; i++) {
        karst_producer_destroy(world->content[i].producer);
        karst_oracle_destroy(world->content[i].oracle);
        karst_fingerprint_finish(&world->content[i].fingerprint);
    }
}

bool karst_engine_world_mark_contents(karst_engine_world *world, const karst_number *values, uint32_t seed)
{
    for (int i = 0; i < KARST_NUM_CONTENTS; i++) {
        const karst_world_file *file = world->file->content[i];
        karst_fingerprint fingerprint;
        if (!file)
            continue;
        if (!karst_fingerprint_init(&fingerprint, file->program, values, seed))
            return false;
        karst_fingerprint_finish(&world->content[i].fingerprint);
        world->content[i].fingerprint = fingerprint;
        karst_oracle_destroy(world->content[i].oracle);
        world->content[i].oracle =
            karst_oracle_create(&file->program->world, values, seed, world->file->info.voxel_log2_m, NULL);
        if (!world->content[i].oracle)
            return false;
    }
    return true;
}

bool karst_engine_compile_contents(karst_engine *engine, uint64_t most_ns, karst_error *error)
{
    for (int i = 0; i < KARST_NUM_CONTENTS; i++)
        if (karst_engine_has_content(engine, i) &&
            !karst_density_producer_compile(engine->shown.content[i].producer, most_ns, error))
            return false;
    return true;
}

bool karst_engine_answer_stores(karst_engine *engine, const karst_engine_store *asking, const karst_work *work,
                                karst_error *error)
{
    karst_store_source sources[1 + KARST_NUM_CONTENTS];
    karst_store *land = karst_cache_find_store(engine->cache, KARST_STORE_LAND);
    size_t num = 0;
    sources[num++] = (karst_store_source){land, engine->producer};
    for (int i = 0; i < KARST_NUM_CONTENTS; i++)
        if (karst_engine_has_content(engine, i))
            sources[num++] = (karst_store_source){engine->stores[i].store, engine->shown.content[i].producer};
    return karst_stores_answer(sources, num, asking ? asking->store : land, work, error);
}

/* ---- whether they hold what they should ---- */

double karst_engine_land_share(const karst_engine *engine)
{
    double share = 1;
    for (int i = 0; i < KARST_NUM_CONTENTS; i++)
        share -= karst_engine_has_content(engine, i) && engine->stores[i].lacks ? KEPT_SHARE : 0;
    return share;
}

bool karst_engine_stores_overflow(const karst_engine *engine)
{
    for (int i = 0; i < KARST_NUM_CONTENTS; i++)
        if (karst_engine_has_content(engine, i) &&
            engine->stores[i].num_used_bricks >
                karst_engine_usable_bricks(karst_store_get_buffers(engine->stores[i].store)))
            return true;
    return false;
}

void karst_engine_fullest_store(const karst_engine *engine, uint64_t *num_used, uint64_t *num_total)
{
    for (int i = 0; i < KARST_NUM_CONTENTS; i++) {
        if (!karst_engine_has_content(engine, i))
            continue;
        const uint64_t used = engine->stores[i].num_used_bricks,
                       total = karst_engine_usable_bricks(karst_store_get_buffers(engine->stores[i].store));
        if (used * *num_total > *num_used * total)
            *num_used = used, *num_total = total;
    }
}

/* ---- rays of the camera ---- */

bool karst_engine_cast_into_stores(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                                   karst_error *error)
{
    for (int i = 0; i < KARST_NUM_CONTENTS; i++)
        if (karst_engine_has_content(engine, i) && engine->stores[i].caster &&
            !karst_cast_pinhole(engine->stores[i].caster, view, pinhole, NULL, error))
            return false;
    return true;
}

/* ---- changes ---- */

bool karst_engine_forget_contents(karst_engine *engine, const bool changed[KARST_NUM_CONTENTS], karst_error *error)
{
    engine->media_is_stale = true;
    for (int i = 0; i < KARST_NUM_CONTENTS; i++)
        if (changed[i] && engine->stores[i].store && !karst_store_forget(engine->stores[i].store, error))
            return false;
    return true;
}

void karst_engine_changed_contents(const karst_engine_world *from, const karst_engine_world *to,
                                   bool changed[KARST_NUM_CONTENTS])
{
    for (int i = 0; i < KARST_NUM_CONTENTS; i++) {
        const karst_fingerprint *a = &from->content[i].fingerprint, *b = &to->content[i].fingerprint;
        changed[i] = a->bytes && b->bytes ? !karst_fingerprint_same(a, b) : a->bytes != b->bytes;
    }
}

bool karst_engine_set_content_parameters(karst_engine *engine, const karst_number *values, karst_error *error)
{
    karst_engine_world *shown = &engine->shown;
    engine->media_is_stale = true;
    karst_engine_world before = {.file = NULL};
    bool changed[KARST_NUM_CONTENTS];
    for (int i = 0; i < KARST_NUM_CONTENTS; i++) {
        before.content[i].fingerprint = shown->content[i].fingerprint;
        shown->content[i].fingerprint = (karst_fingerprint){0};
    }
    const bool marked = karst_engine_world_mark_contents(shown, values, shown->seed);
    karst_engine_changed_contents(&before, shown, changed);
    karst_engine_world_close_contents(&before);
    if (!marked)
        return karst_fail(error, KARST_FAILED, "out of memory");
    for (int i = 0; i < KARST_NUM_CONTENTS; i++) {
        const karst_world_file *file = shown->file->content[i];
        if (karst_engine_has_content(engine, i) &&
            (!karst_world_file_set_parameters(shown->content[i].producer, file, values, shown->seed, error) ||
             (changed[i] && !karst_store_forget(engine->stores[i].store, error))))
            return false;
    }
    return true;
}

/* ---- statistics ---- */

void karst_engine_begin_store_stats(karst_engine *engine)
{
    for (int i = 0; i < KARST_NUM_CONTENTS; i++)
        engine->stores[i].stats.num_requests = engine->stores[i].stats.num_produced = 0;
}

/* Once a world: such densities are air, and where the first of them lies is what helps to mend it. */
void karst_engine_report_non_finite(const karst_engine *engine, karst_producer *producer, const char *what,
                                    bool *reported)
{
    int64_t voxel[3];
    int level;
    double voxel_m = exp2(engine->world->voxel_log2_m);
    if (*reported || !karst_density_producer_first_non_finite(producer, voxel, &level))
        return;
    *reported = true;
    karst_log_print(
        engine->log, KARST_LOG_WARNING,
        "%s: the %s is not finite in places, which are taken as air; the first is at %.17g,%.17g,%.17g "
        "(look with karst sample)",
        engine->world->name, what, (double)voxel[0] * voxel_m, (double)voxel[1] * voxel_m, (double)voxel[2] * voxel_m);
}

static void fill_pool(karst_engine_store *of)
{
    const karst_cache_buffers *b = karst_store_get_buffers(of->store);
    karst_stats_store *s = &of->stats;
    snprintf(s->name, sizeof s->name, "%s", karst_store_name(of->store));
    s->num_resident_bricks = karst_store_count_resident(of->store);
    s->bricks.num_total = b->num_bricks - 1;
    s->bricks.size_bytes = b->nodes->size_bytes + b->brick_info->size_bytes + b->brick_owner->size_bytes;
    for (uint32_t segment = 0; segment < b->num_segments; segment++)
        s->bricks.size_bytes += b->bricks[segment]->size_bytes;
}

void karst_engine_end_store_stats(karst_engine *engine)
{
    karst_stats *stats = &engine->stats;
    for (int i = 0; i < KARST_NUM_CONTENTS; i++) {
        uint64_t num_raised, num_given_up;
        if (!engine->stores[i].store)
            continue;
        fill_pool(&engine->stores[i]);
        stats->stores[stats->num_stores++] = engine->stores[i].stats;
        if (!karst_engine_has_content(engine, i))
            continue;
        karst_producer *producer = engine->shown.content[i].producer;
        karst_density_producer_thin(producer, &num_raised, &num_given_up);
        stats->num_thin_raised += num_raised;
        stats->num_thin_given_up += num_given_up;
        stats->num_non_finite += karst_density_producer_non_finite(producer);
        karst_engine_report_non_finite(engine, producer, karst_content_names[i],
                                       &engine->stores[i].reported_non_finite);
    }
}
