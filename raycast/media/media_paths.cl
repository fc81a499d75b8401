/* Entry points of media for paths: where rays collide with them, and what becomes of those that do. See
 * raycast/light/path_media.h. Built with MEDIA_TRACKS and MEDIA_STREAMS. */
#include "raycast/media/march.clh"
#include "raycast/light/clear_shared.h"
#include "raycast/light/path_rays.clh"
#include "raycast/light/through.clh"
#include "raycast/shadow_shared.h"
#include "raycast/media/lamps.clh"
#include "world.clh"
#include "raycast/cast/exact.clh"
#include "raycast/media/look.clh"

#ifdef SHADE_ATMOSPHERE
#define WAY_KEPT passage.kept
#else
#define WAY_KEPT {clear, clear, clear}
#endif

/* How voxels grow along a path that was scattered, per unit of t. */
#define TURNED_CONE 0.03f
/* Paths that count less are ended by chance, and others count more. */
#define LEAST_THROUGHPUT 0.25f
/* What comes to less of a lamp's light than exp of minus this is not followed further. */
#define DEPTH_TO_LAMPS 16.0f

MEDIA_FUNCTION void walk_track(const pools *pool, const media_frame *frame, const media_rays *rays, vint lanes,
                               const media_lighting *light, media_sums *sums)
{
    walk_rays(WALK_TRACK, pool, frame, rays, &lanes, 1u, light, sums);
}

RAY_INLINE media_lighting lighting_of(const karst_media_task *task, K_GLOBAL const ulong *data,
                                      const karst_shade_anchor *anchor, __local const near_octave *octaves)
{
    media_lighting l;
    l.most_depth = task->most_depth;
    l.metres = task->metres;
    l.used = 0;
    l.to_sun = (vfloat)(0.0f);
    l.data = data;
    l.anchor = anchor;
    l.octaves = octaves;
    return l;
}

/* Numbers of a ray's own: they follow from pixel, sample and generation. */
RAY_INLINE vuint chance_of_rays(const path_rays *r, const karst_pinhole *pinhole, const karst_path_task *task)
{
    const scatter_pixel pixel = {(r->pixel & 0xffff) + pinhole->x0_px, (r->pixel >> 16) + pinhole->y0_px,
                                 task->sample ^ karst_path_purpose(task->bounce, KARST_PATH_OF_MEDIA)};
    return scatter_seed(&pixel);
}

/* ---- where rays collide ---- */

/* What air there is before media, in haze or an atmosphere. */
typedef struct {
    colour added, kept;
} air_before;

RAY_INLINE air_before find_air_before(const karst_light *light, const path_rays *r, vfloat t SHADE_SKY_TAKES)
{
    const colour black = {(vfloat)(0.0f), (vfloat)(0.0f), (vfloat)(0.0f)};
    const vfloat to_sun = dot3(&r->direction, light->sun_direction);
    const vector3 to = {k_fma(r->direction.x, t, r->origin.x), k_fma(r->direction.y, t, r->origin.y),
                        k_fma(r->direction.z, t, r->origin.z)};
    FIND_WAY_BETWEEN(&r->origin, &to, &r->direction, to_sun, t);
    const colour kept = WAY_KEPT;
    const air_before air = {THROUGH(black, to_sun), kept};
    return air;
}

#ifdef MEDIA_GLOWS
/* What media gave off before rays collided, through the air and the clear matter before it: as if all of it came from
 * where it does in the mean. */
RAY_INLINE colour glow_before(const media_sums *sums, const karst_light *light, const path_rays *r,
                              K_GLOBAL const karst_clear_way *ways SHADE_SKY_TAKES)
{
    const vfloat t = sums->reach / lane_max(sums->weight, (vfloat)(1.0e-12f));
#ifdef SHADE_ATMOSPHERE
    const air_before air = find_air_before(light, r, t, sky, sky_table);
#else
    const air_before air = find_air_before(light, r, t);
#endif
    colour c = {sums->light.r * air.kept.r, sums->light.g * air.kept.g, sums->light.b * air.kept.b};
    if (ways) {
        K_GLOBAL const float *words = (K_GLOBAL const float *)ways;
        const vint at = v_select(r->valid, r->index, (vint)(0)) * (int)(sizeof(karst_clear_way) / sizeof(float));
        c.r *= tone_exp2_minus(v_gather_float(words, at) * t * LOG2_E);
        c.g *= tone_exp2_minus(v_gather_float(words, at + 1) * t * LOG2_E);
        c.b *= tone_exp2_minus(v_gather_float(words, at + 2) * t * LOG2_E);
    }
    return c;
}
#endif

RAY_INLINE void store_collisions(K_GLOBAL karst_path_collision *collisions, const path_rays *r, vint met, vfloat t,
                                 const colour *throughput)
{
    float words[4][LANES];
    int index[LANES];
    v_store_float(v_select(met, t, (vfloat)(KARST_PATH_GOES_BY)), words[0]);
    v_store_float(throughput->r, words[1]), v_store_float(throughput->g, words[2]);
    v_store_float(throughput->b, words[3]);
    v_store_int(r->index, index);
    for (int l = 0; l < LANES; l++)
        if (r->lanes >> l & 1u) {
            const karst_path_collision c = {words[0][l], {words[1][l], words[2][l], words[3][l]}};
            collisions[index[l]] = c;
        }
}

/* Rays that collide before they end on land, or on clear matter (over_hits; 0: there is none). Without clear matter
 * they lose their throughput here, so that nothing is made of the surfaces behind. */
__kernel K_WIDE void media_meet(POOL_PARAMETERS, K_GLOBAL const karst_cast_view *view, karst_media_task task,
                                karst_pinhole pinhole, karst_light light, karst_path_task path,
                                K_GLOBAL karst_ray *rays, K_GLOBAL const uint *count, K_GLOBAL const karst_hit *hits,
                                K_GLOBAL const karst_hit *over_hits, K_GLOBAL const karst_clear_way *ways,
                                K_GLOBAL karst_path_collision *collisions, K_GLOBAL float *parts,
                                karst_shade_anchor anchor, K_GLOBAL uint *counters,
                                K_GLOBAL const ulong *data SHADE_SKY_PARAMETERS)
{
    const pools pool = POOL_FIELDS;
    __local near_octave known[WORLD_NEAR_OCTAVES + 1];
    __local near_octave *octaves = known + (get_num_groups(0) == 0 ? 1 : 0); /* as shade.cl */
    const uint num_rays = *count, lowest = (uint)get_global_id(0) * LANES;
#ifdef MEDIA_GLOWS
    world_colour_prepare(data, anchor.voxel, anchor.fraction, octaves, (uint)get_local_id(0), (uint)get_local_size(0));
    barrier(CLK_LOCAL_MEM_FENCE);
#endif
    if (lowest >= num_rays)
        return;
    const path_rays r = load_paths(rays, lowest, num_rays);
    const vint at = v_select(r.valid, r.index, (vint)(0)) * (int)(sizeof(karst_hit) / sizeof(float));
    vfloat end = lane_min(v_gather_float((K_GLOBAL const float *)hits, at), r.t_max);
    if (over_hits)
        end = lane_min(end, v_gather_float((K_GLOBAL const float *)over_hits, at));
    media_frame frame;
    media_sums sums = EMPTY_SUMS;
    media_lighting lighting = lighting_of(&task, data, &anchor, octaves);
    lighting.direction = &r.direction;
    lighting.origin = &r.origin;
    sums.chance = chance_of_rays(&r, &pinhole, &path);
    media_frame_of_view(&frame, view);
    const media_rays way = {r.origin,        r.direction, (vfloat)(0.0f), end, r.width * task.detail,
                            r.cone * task.detail};
    walk_track(&pool, &frame, &way, r.valid, &lighting, &sums);

    /* What is sure ends where something is missing. */
    const vint lost = view->ends_at_missing ? sums.missing & r.valid : (vint)(0);
    const vint met = sums.done & r.valid & ~lost;
    const air_before air = find_air_before(&light, &r, v_select(met, sums.met_at, (vfloat)(1.0f)) SHADE_SKY);
    const colour throughput = {r.throughput.r * air.kept.r, r.throughput.g * air.kept.g, r.throughput.b * air.kept.b};
    store_collisions(collisions, &r, met, sums.met_at, &throughput);
    if (!path.again) {
        const vfloat none = (vfloat)(0.0f);
        colour c = {v_select(met, air.added.r, none), v_select(met, air.added.g, none),
                    v_select(met, air.added.b, none)};
#ifdef MEDIA_GLOWS
        c = add_colour(c, glow_before(&sums, &light, &r, ways SHADE_SKY), (vfloat)(1.0f));
#endif
        add_paths(parts, (size_t)pinhole.width_px * (size_t)pinhole.height_px, pinhole.width_px, pinhole.height_px, &r,
                  r.lanes, &c);
        const uint num_missing = (uint)count_lanes(sums.missing & r.valid);
        if (num_missing)
            atomic_add(counters + KARST_MEDIA_LACKING, num_missing);
    }
    const uint ended = over_hits ? mask_bits(lost) : mask_bits(met | lost);
    for (uint l = 0; l < LANES; l++)
        for (int c = 0; c < 3 && (ended >> l & 1u); c++)
            rays[lowest + l].throughput[c] = 0.0f;
}

/* ---- what becomes of them ---- */

/* As choose_lamp, of lamps that light a place in a medium, as it scatters towards where a ray comes from. */
RAY_INLINE lamp_choice choose_lamp_for(K_GLOBAL const karst_lamp *lamps, uint num, const vector3 *place,
                                       const vector3 *direction, vfloat g, vfloat pick, const jitter *at)
{
    const vfloat zero = (vfloat)(0.0f);
    vfloat total = zero, before = zero;
    for (uint i = 0; i < num; i++) {
        const karst_lamp lamp = lamps[i];
        const lamp_light l = lamp_at(&lamp, place, direction, at);
        total += l.strength * lamps_phase(g, dot_of(&l.direction, direction)) *
                 most_colour(uniform_colour(lamp.colour));
    }
    const vfloat target = pick * total;
    lamp_choice c = {{*direction, zero, zero}, {zero, zero, zero}};
    for (uint i = 0; i < num; i++) {
        const karst_lamp lamp = lamps[i];
        const lamp_light l = lamp_at(&lamp, place, direction, at);
        const colour own = uniform_colour(lamp.colour);
        const vfloat arriving = l.strength * lamps_phase(g, dot_of(&l.direction, direction)),
                     weight = arriving * most_colour(own);
        const vint take = v_gt(weight, zero) & v_ge(target, before);
        const vfloat share = arriving * (total / lane_max(weight, (vfloat)(1.0e-30f)));
        c.light.direction.x = v_select(take, l.direction.x, c.light.direction.x);
        c.light.direction.y = v_select(take, l.direction.y, c.light.direction.y);
        c.light.direction.z = v_select(take, l.direction.z, c.light.direction.z);
        c.light.t = v_select(take, lamp.shadow ? l.t : (vfloat)(1.0e-30f), c.light.t);
        c.arriving.r = v_select(take, own.r * share, c.arriving.r);
        c.arriving.g = v_select(take, own.g * share, c.arriving.g);
        c.arriving.b = v_select(take, own.b * share, c.arriving.b);
        before += weight;
    }
    return c;
}

/* From the collisions of `met`: *l to a lamp, idle where none shines, and *out further. at: their rays, with the
 * collisions' throughput. */
RAY_INLINE void scatter_paths(const path_rays *at, vint met, vfloat t, const media_lighting *lighting,
                              const karst_light *light, const karst_pinhole *pinhole, const karst_path_task *task,
                              K_GLOBAL const karst_lamp *lamps, path_rays *l, path_rays *out)
{
    const vfloat zero = (vfloat)(0.0f), one = (vfloat)(1.0f);
    const vint x = (at->pixel & 0xffff) + pinhole->x0_px, y = (at->pixel >> 16) + pinhole->y0_px;
    const vector3 place = {k_fma(at->direction.x, t, at->origin.x), k_fma(at->direction.y, t, at->origin.y),
                           k_fma(at->direction.z, t, at->origin.z)};
    const media_look look = look_at_place(lighting, light, &place, &at->direction, met);
    *out = *at;
    out->origin = place;
    out->width = k_fma(t, at->cone, at->width);
    out->flags = (vint)(0);
    out->lanes = mask_bits(met);
    out->throughput.r *= look.albedo.r, out->throughput.g *= look.albedo.g, out->throughput.b *= look.albedo.b;
    *l = *out;

    const jitter on =
        jitter_on_disc(jitter_of(x, y, task->sample, karst_path_purpose(task->bounce, KARST_PATH_OF_LAMP)));
    const jitter pick = jitter_of(x, y, task->sample, karst_path_purpose(task->bounce, KARST_PATH_OF_PICK));
    const lamp_choice lamp = choose_lamp_for(lamps, task->num_lamps, &place, &at->direction, look.g, pick.u, &on);
    l->direction = lamp.light.direction;
    l->throughput.r *= lamp.arriving.r, l->throughput.g *= lamp.arriving.g, l->throughput.b *= lamp.arriving.b;
    l->t_max = v_select(met & v_gt(most_colour(l->throughput), zero),
                        lane_min(lamp.light.t, to_end_of_view(pinhole, &place, &l->direction)), zero);
    l->cone = (vfloat)(pinhole->cone > KARST_SUN_CONE ? pinhole->cone : KARST_SUN_CONE);

    const vfloat most = most_colour(out->throughput);
    const vfloat likely = lane_min(most * (1.0f / LEAST_THROUGHPUT), one);
    const vfloat per = one / lane_max(likely, (vfloat)(1.0e-12f));
    const vint goes = met & v_lt(pick.v, likely);
    out->throughput.r *= per, out->throughput.g *= per, out->throughput.b *= per;
    out->direction = scatter_direction(
        jitter_of(x, y, task->sample, karst_path_purpose(task->bounce, KARST_PATH_OF_DIRECTION)), look.g,
        &at->direction);
    out->t_max = v_select(goes, to_end_of_view(pinhole, &place, &out->direction), zero);
    out->cone = lane_max(at->cone, (vfloat)(TURNED_CONE));
}

/* Rays that collided go on, and look for a lamp, in place of those of the surfaces behind; and rays to lamps lose what
 * media take. */
__kernel K_WIDE void media_turn(POOL_PARAMETERS, K_GLOBAL const karst_cast_view *view, karst_media_task task,
                                karst_pinhole pinhole, karst_light light, karst_path_task path,
                                K_GLOBAL const karst_ray *rays, K_GLOBAL const uint *count,
                                K_GLOBAL const karst_path_collision *collisions, K_GLOBAL const karst_lamp *lamps,
                                K_GLOBAL karst_ray *next, K_GLOBAL karst_ray *to_lamps, karst_shade_anchor anchor,
                                K_GLOBAL uint *counters, K_GLOBAL const ulong *data)
{
    const pools pool = POOL_FIELDS;
    __local near_octave known[WORLD_NEAR_OCTAVES + 1];
    __local near_octave *octaves = known + (get_num_groups(0) == 0 ? 1 : 0); /* as shade.cl */
    const uint num_rays = *count, lowest = (uint)get_global_id(0) * LANES;
    const vfloat none = (vfloat)(0.0f);
    world_colour_prepare(data, anchor.voxel, anchor.fraction, octaves, (uint)get_local_id(0), (uint)get_local_size(0));
    barrier(CLK_LOCAL_MEM_FENCE);
    if (lowest >= num_rays)
        return;
    path_rays r = load_paths(rays, lowest, num_rays), to_lamp = load_paths(to_lamps, lowest, num_rays);
    K_GLOBAL const float *words = (K_GLOBAL const float *)(collisions + lowest);
    const vint first = v_select(r.valid, V_LANE, (vint)(0)) * (int)(sizeof(karst_path_collision) / sizeof(float));
    const vfloat t = v_gather_float(words, first);
    const vint met = r.valid & v_lt(t, (vfloat)(KARST_PATH_GOES_BY));
    media_lighting lighting = lighting_of(&task, data, &anchor, octaves);
    lighting.most_depth = DEPTH_TO_LAMPS;
    lighting.origin = 0;
    if (v_any(met)) {
        path_rays l, out;
        r.throughput.r = v_gather_float(words, first + 1), r.throughput.g = v_gather_float(words, first + 2);
        r.throughput.b = v_gather_float(words, first + 3);
        scatter_paths(&r, met, v_select(met, t, none), &lighting, &light, &pinhole, &path, lamps, &l, &out);
        if (!path.is_last)
            store_paths(next, &out, KARST_SIDE_FRONT);
        store_paths(to_lamps, &l, KARST_SIDE_FRONT);
        to_lamp = load_paths(to_lamps, lowest, num_rays);
    }
    const vint shines = r.valid & v_gt(to_lamp.t_max, none);
    if (!v_any(shines))
        return;
    media_frame frame;
    media_sums sums = EMPTY_SUMS;
    media_frame_of_view(&frame, view);
    lighting.direction = &to_lamp.direction;
    const media_rays way = {to_lamp.origin, to_lamp.direction,         none, to_lamp.t_max,
                            to_lamp.width * task.detail, to_lamp.cone * task.detail};
    walk_depth(&pool, &frame, &way, shines, &lighting, &sums);
    float left[LANES];
    v_store_float(tone_exp2_minus(sums.tau * LOG2_E), left);
    const uint dimmed = mask_bits(shines & v_gt(sums.tau, none));
    for (uint i = 0; i < LANES; i++)
        for (int c = 0; c < 3 && (dimmed >> i & 1u); c++)
            to_lamps[lowest + i].throughput[c] *= left[i];
    const uint num_missing = (uint)count_lanes(sums.missing & shines);
    if (num_missing && !path.again)
        atomic_add(counters + KARST_MEDIA_LACKING, num_missing);
}
