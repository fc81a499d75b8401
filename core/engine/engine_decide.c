/* Deciding whether what a view needs on the ladder's rung fits the pools.
 *
 * What a picture's rays want while something is missing depends on what stands in for it, and so on what earlier views
 * left in the pools. Rays that end where something is missing (karst_cast_view.ends_at_missing) stamp and want nothing
 * but parts of what the settled picture uses, the working set. So here each round recycles whatever they did not stamp,
 * and makes some of what they want. What they stamp grows from round to round, until they want nothing (then all of the
 * working set is there), or stamp more than a settled picture may use (then it never fits). Either is of view, world
 * and pools alone. */
#include "core/engine/engine_parts.h"

/* Of a frame. */
#define MAX_ROUNDS 64

void karst_engine_usable_slots(const karst_engine *engine, uint32_t *num_tiles, uint32_t *num_bricks)
{
    const karst_cache_buffers *buffers = karst_cache_get_buffers(engine->cache);
    *num_tiles = buffers->num_tiles - 1;
    *num_bricks = karst_engine_usable_bricks(buffers);
}

/* Bounces of the picture's rays: they themselves; once they want nothing those that start where they end, to the sun
 * and mirrored; and once these do not either those to the sun from where mirrored ones end. Paths are followed
 * whole from the hits: one that lacks something ends there. Of clear matter all that follow one another, of which only
 * those go on that want nothing. */
typedef enum { PICTURE, FROM_HITS, FROM_MIRRORED, THROUGH_CLEAR } sure_rays;

static sure_rays last_rays(const karst_engine *engine)
{
    if (engine->clear)
        return THROUGH_CLEAR;
    if (engine->shadows && engine->bounce)
        return FROM_MIRRORED;
    return engine->shadows || engine->bounce || engine->paths || engine->occlusion ? FROM_HITS : PICTURE;
}

/* `again`: only those that wanted anything, as far as that is known. */
static bool cast_sure(karst_engine *engine, sure_rays rays, bool again, karst_error *error)
{
    karst_cast_view view;
    karst_pinhole pinhole;
    karst_engine_picture_view(engine, &view, &pinhole);
    view.ends_at_missing = 1;
    if (rays == last_rays(engine) && !karst_engine_look_at_photons(engine, &view, &pinhole, error))
        return false;
    if (rays == THROUGH_CLEAR)
        return karst_engine_trace_clear(engine, &view, &pinhole, again ? KARST_FOLLOW_LACKING : KARST_FOLLOW_AGAIN,
                                        error);
    if (rays == FROM_MIRRORED)
        return karst_engine_look_at_mirrored_shadows(engine, &view, &pinhole, error);
    if (rays == PICTURE)
        return (again ? karst_cast_again(engine->caster, &view, &pinhole, engine->asked, error)
                      : karst_cast_picture(engine->caster, &view, &pinhole, NULL, engine->asked, NULL, error)) &&
               karst_engine_cast_into_clear(engine, &view, &pinhole, false, error) &&
               karst_engine_look_at_media(engine, &view, &pinhole, error);
    const karst_light light = karst_engine_light(engine);
    const bool cast = !engine->shadows ||
                      (again ? karst_cast_shadows_again(engine->caster, &view, &pinhole, &light, engine->shadow_rays,
                                                        engine->shadows_asked, error)
                             : karst_cast_picture_shadows(engine->caster, &view, &pinhole, &light, engine->shadow_rays,
                                                          NULL, engine->shadows_asked, NULL, error));
    return cast && (!engine->bounce || karst_engine_look_at_mirrored(engine, &view, &pinhole, error)) &&
           karst_engine_look_at_occlusion(engine, &view, error) &&
           karst_engine_look_at_paths(engine, &view, &pinhole, false, error);
}

static bool round_of_sure_rays(karst_engine *engine, sure_rays rays, bool again, karst_allowance *left,
                               karst_work *work, karst_error *error)
{
    uint64_t start_ns = karst_engine_cpu_ns(engine);
    if (!cast_sure(engine, rays, again, error) || !karst_finish(engine->context, error))
        return false;
    uint64_t taken_ns = karst_engine_cpu_ns(engine) - start_ns;
    engine->made.again_cpu_ns += taken_ns;
    left->ns -= (double)taken_ns;
    return karst_engine_answer_round(engine, &engine->camera.position, left, work, error);
}

static bool may_go_on(const karst_engine *engine, karst_allowance *left)
{
    left->over = left->over || (engine->goes_on && !engine->goes_on(engine->patience));
    return !left->over && left->bricks > 0 && left->tiles > 0 && (engine->budget_ns == 0 || left->ns > 0);
}

/* Of who waits for the settled picture nobody sees how often others are drawn. */
static bool draw_anew(karst_engine *engine, karst_error *error)
{
    karst_engine_next_serial(engine);
    if (!karst_engine_end_picture(engine, error) || !karst_engine_draw(engine, error) ||
        !karst_engine_end_picture(engine, error))
        return false;
    karst_engine_next_serial(engine);
    return true;
}

bool karst_engine_decide(karst_engine *engine, karst_allowance *left, karst_work *work, karst_error *error)
{
    sure_rays rays = PICTURE;
    bool again = false, made = false;
    uint32_t num_tiles, num_bricks;
    karst_engine_usable_slots(engine, &num_tiles, &num_bricks);
    karst_engine_next_serial(engine); /* the picture's stamps are not sure */
    for (int i = 0; i < MAX_ROUNDS && (i == 0 || may_go_on(engine, left)); i++) {
        if (!round_of_sure_rays(engine, rays, again, left, work, error))
            return false;
        const uint32_t num_starved = work->num_starved_bricks + work->num_starved_tiles;
        const uint32_t num_granted = work->num_loads + work->num_subdivides;
        made = made || num_granted > 0;
        const bool all = !again;
        again = true;
        if (work->num_used_bricks > num_bricks || karst_engine_stores_overflow(engine) ||
            (num_granted == 0 && num_starved > 0)) {
            engine->verdict = KARST_LADDER_TOO_LARGE;
            break;
        }
        if (work->num_requests > 0) {
            engine->stats.num_requests += num_granted;
            continue;
        }
        /* Of clear matter not all rays were followed then: all of them have to want nothing. */
        if (rays == THROUGH_CLEAR && !all) {
            again = false;
            continue;
        }
        if (rays == last_rays(engine)) {
            engine->verdict = KARST_LADDER_FITS;
            break;
        }
        /* If anything was made rays end elsewhere, and those after them start there. */
        if (made && !(engine->settles && engine->budget_ns == 0))
            break;
        if (made && !draw_anew(engine, error))
            return false;
        rays = made ? PICTURE : rays == FROM_HITS && engine->clear ? THROUGH_CLEAR : (sure_rays)(rays + 1);
        again = made = false;
    }
    return true;
}
