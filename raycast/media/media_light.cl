/* Entry point of media: what they make of a picture. See raycast/media/media.h. */
#define MEDIA_HAS_LIGHT
#include "raycast/media/land_pools.clh"
#include "raycast/media/march.clh"
#include "raycast/light/radiance_shared.h"
#include "raycast/light/surface.clh"
#ifdef SHADE_ATMOSPHERE
#include "raycast/light/atmosphere.clh"
#endif
#ifdef MEDIA_STREAMS
#include "raycast/light/clear_shared.h"
#include "raycast/light/path_rays.clh"
#endif
#include "world.clh"
#include "raycast/cast/exact.clh"
#include "raycast/media/look.clh"

MEDIA_FUNCTION void walk_light(const pools *pool, const media_frame *frame, const media_rays *rays, const vint *lanes,
                               uint num, const media_lighting *light, media_sums *sums)
{
    walk_rays(WALK_LIGHT, pool, frame, rays, lanes, num, light, sums);
}

#ifdef MEDIA_FREE
#include "raycast/media/scatter.clh"
#endif

/* How voxels grow from land towards the sun, per unit of t. */
#define LAND_CONE 0.03f

/* The light of a sky that comes from all around: half from above, half thrown back by the ground. */
RAY_INLINE colour light_all_around(const karst_light *light)
{
    const vector3 level = {(vfloat)(1.0f), (vfloat)(0.0f), (vfloat)(0.0f)};
    const colour white = {(vfloat)(1.0f), (vfloat)(1.0f), (vfloat)(1.0f)};
    return ground_colour(light, &level, white, (vfloat)(0.0f));
}

#ifdef MEDIA_ALONE
/* What is seen of media alone, in place of all that shading made of the pixels. */
RAY_INLINE void lay_alone(const media_sums *sums, const karst_light *light, float most_depth, vint order, vint valid,
                          size_t plane, uint has_sun, uint has_mirror, K_GLOBAL float *parts)
{
    const vfloat none = (vfloat)(0.0f);
    const vfloat kept = v_select(v_gt(sums->tau, (vfloat)(most_depth)), none, tone_exp2_minus(sums->tau * LOG2_E));
    const vfloat own[3] = {sums->light.r, sums->light.g, sums->light.b};
    const uint num = has_mirror ? 7u : has_sun ? 6u : 3u;
    for (uint c = 0; c < num; c++)
        store_ordered(parts + c * plane, order, valid,
                      c < 3 ? k_fma((vfloat)(light->sky_zenith[c]), kept, own[c]) : none);
}
#endif

/* A packet of a picture. */
typedef struct {
    vint x, y, valid, order;
    vint lit; /* land that faces the sun */
    vector3 direction;
    vfloat t, end; /* of the hit; of the ray */
    vfloat from_sun;
} media_pixel;

/* Fills in what follows from x, y and valid. */
RAY_INLINE void begin_pixel(const karst_pinhole *pinhole, K_GLOBAL const karst_cast_view *view,
                            const karst_light *light, K_GLOBAL const karst_hit *hits,
                            K_GLOBAL const karst_hit *over_hits, media_pixel *at)
{
    at->order = packet_order(at->x, at->y, pinhole->width_px, pinhole->height_px);
    at->direction = pinhole_direction(pinhole, at->x, at->y);
    const surface_hits s =
        load_surface(hits, at->order, at->valid, &at->direction, pinhole->cone * view->detail, view->blend);
    at->t = s.t;
    at->from_sun = (vfloat)(1.0f);
#ifdef MEDIA_ALONE
    vint hit = (vint)(0);
#else
    vint hit = v_mask(v_ne(s.kind, (vint)((int)KARST_HIT_MISS))) & at->valid;
#endif
    at->end = v_select(hit, s.t, (vfloat)(pinhole->t_max));
#ifdef MEDIA_STREAMS
    /* Behind clear matter a stream goes on. */
    if (over_hits) {
        const surface_hits over = load_surface(over_hits, at->order, at->valid, &at->direction, 0.0f, 0.0f);
        const vint covered = v_mask(v_ne(over.kind, (vint)((int)KARST_HIT_MISS))) & at->valid & v_lt(over.t, at->end);
        at->end = v_select(covered, over.t, at->end);
        hit &= ~covered;
    }
#else
    (void)over_hits;
#endif
    at->lit = hit & v_gt(dot3(&s.normal, light->sun_direction), (vfloat)(0.0f));
}

#if MEDIA_MODE == KARST_MEDIA_FULL
/* What is left of the sun where it shines on land: of packets with `lanes`, `num` of them. */
RAY_INLINE void dim_sun(const pools *pool, const media_frame *frame, const karst_light *light, float detailed_cone,
                        const media_lighting *lighting, uint num, media_pixel *pixels, vint *missing)
{
    media_rays ways[MEDIA_BEAM];
    media_sums sums[MEDIA_BEAM];
    vint lanes[MEDIA_BEAM], any = (vint)(0);
    media_lighting above = *lighting;
    for (uint p = 0; p < num; p++) {
        const media_pixel *at = pixels + p;
        const media_sums empty = EMPTY_SUMS;
        const media_rays to_sun = {{at->direction.x * at->t, at->direction.y * at->t, at->direction.z * at->t},
                                   {(vfloat)(light->sun_direction[0]), (vfloat)(light->sun_direction[1]),
                                    (vfloat)(light->sun_direction[2])},
                                   (vfloat)(0.0f),
                                   (vfloat)(light->shadow_distance),
                                   lane_max(at->t * (2.0f * detailed_cone), (vfloat)(1.0f)),
                                   (vfloat)(LAND_CONE)};
        lanes[p] = at->lit;
        any |= at->lit;
        ways[p] = to_sun;
        sums[p] = empty;
    }
    if (!v_any(any))
        return;
    above.most_depth = 16.0f;
    above.used = 0;
    walk_depths(pool, frame, ways, lanes, num, &above, sums);
    for (uint p = 0; p < num; p++) {
        missing[p] |= sums[p].missing & lanes[p];
        pixels[p].from_sun =
            v_select(lanes[p], tone_exp2_minus(sums[p].tau * LOG2_E), pixels[p].from_sun);
    }
}
#endif

/* own: what is seen of the medium, through what is before it. */
RAY_INLINE void store_pixel(const media_pixel *at, const media_sums *sums, const colour *own, float most_depth,
                            size_t plane, uint has_sun, uint has_mirror, vint veiled, K_GLOBAL float *parts)
{
    const vfloat kept =
        v_select(v_gt(sums->tau, (vfloat)(most_depth)), (vfloat)(0.0f), tone_exp2_minus(sums->tau * LOG2_E));
    const vfloat added[3] = {own->r * sums->weight, own->g * sums->weight, own->b * sums->weight};
    K_UNROLL
    for (int c = 0; c < 3; c++) {
        K_GLOBAL float *part = parts + (size_t)c * plane;
        store_ordered(part, at->order, veiled, k_fma(load_ordered(part, at->order, veiled), kept, added[c]));
        if (has_sun) {
            part += 3 * plane;
            store_ordered(part, at->order, veiled, load_ordered(part, at->order, veiled) * kept * at->from_sun);
        }
    }
    if (has_mirror) {
        K_GLOBAL float *part = parts + KARST_RADIANCE_MIRROR_PLANE * plane;
        store_ordered(part, at->order, veiled, load_ordered(part, at->order, veiled) * kept);
#ifdef MEDIA_PASSES
        part = parts + KARST_RADIANCE_PASS_PLANE * plane;
        store_ordered(part, at->order, veiled, load_ordered(part, at->order, veiled) * kept);
#endif
    }
}

/* Lays the media before the pixels of a sample, part by part (raycast/light/radiance_shared.h): MEDIA_BEAM packets. */
__kernel K_WIDE void media_pixels(POOL_PARAMETERS, K_GLOBAL const karst_cast_view *view, karst_media_task task,
                                  karst_pinhole pinhole, karst_light light, K_GLOBAL const karst_hit *hits,
                                  K_GLOBAL float *parts, uint has_sun, uint has_mirror, karst_shade_anchor anchor,
                                  K_GLOBAL const uint *grids, K_GLOBAL const karst_sun_depth *states,
                                  K_GLOBAL const karst_brick_owner *owners, K_GLOBAL uint *used,
                                  K_GLOBAL uint *looks, K_GLOBAL uint *counters,
                                  K_GLOBAL const ulong *data
#ifdef MEDIA_FLUENCE
                                  ,
                                  karst_fluence_boxes fluence_boxes, K_GLOBAL const uint *fluence_words
#endif
#ifdef MEDIA_STREAMS
                                  ,
                                  K_GLOBAL const karst_hit *over_hits, float4 absorption
#endif
#ifdef SHADE_ATMOSPHERE
                                  ,
                                  karst_sky sky, K_GLOBAL const float *sky_table
#endif
#ifdef MEDIA_PATHS
                                  ,
                                  uint with_land, LAND_PARAMETERS
#endif
)
{
    const pools pool = POOL_FIELDS;
#ifdef MEDIA_PATHS
    const pools land = LAND_FIELDS;
#endif
    __local near_octave known[WORLD_NEAR_OCTAVES + 1];
    __local near_octave *octaves = known + (get_num_groups(0) == 0 ? 1 : 0); /* as shade.cl */
    world_colour_prepare(data, anchor.voxel, anchor.fraction, octaves, (uint)get_local_id(0), (uint)get_local_size(0));
    barrier(CLK_LOCAL_MEM_FENCE);
    const size_t plane = (size_t)pinhole.width_px * (size_t)pinhole.height_px;
    const vfloat none = (vfloat)(0.0f);
    media_frame frame;
    media_pixel pixels[MEDIA_BEAM];
    media_rays ways[MEDIA_BEAM];
    media_sums sums[MEDIA_BEAM];
    media_lighting lighting[MEDIA_BEAM];
    vint lanes[MEDIA_BEAM], missing[MEDIA_BEAM];
    uint num = 0; /* packets that lie in the picture */
    for (uint p = 0; p < MEDIA_BEAM; p++) {
        media_pixel *at = pixels + num;
        const media_sums empty = EMPTY_SUMS;
        media_lighting *lit = lighting + num;
        at->valid = packet_pixels((uint)get_global_id(0) * MEDIA_BEAM + p, pinhole.width_px, pinhole.height_px, &at->x,
                                  &at->y);
        if (!v_any(at->valid))
            continue;
#ifdef MEDIA_STREAMS
        begin_pixel(&pinhole, view, &light, hits, over_hits, at);
#else
        begin_pixel(&pinhole, view, &light, hits, 0, at);
#endif
        lit->most_depth = task.most_depth;
        lit->metres = task.metres;
        lit->grids = grids;
        lit->grid_states = states;
        lit->owners = owners;
        lit->used = used;
        lit->looks = looks;
        lit->serial = view->serial;
        lit->sun = task.sun;
        lit->sun_colour = uniform_colour(light.sun_colour);
#ifdef MEDIA_ALONE
        lit->sky_colour.r = lit->sky_colour.g = lit->sky_colour.b = none;
#else
        lit->sky_colour = light_all_around(&light);
#endif
        lit->to_sun = dot3(&at->direction, light.sun_direction);
        lit->direction = &at->direction;
        lit->data = data;
        lit->anchor = &anchor;
        lit->octaves = octaves;
#ifdef MEDIA_FLUENCE
        lit->fluence.words = fluence_words;
        lit->fluence.boxes = fluence_boxes;
#endif
#ifdef MEDIA_STREAMS
        lit->origin = 0;
#endif
        const media_rays way = {{none, none, none},    at->direction, none,
                                at->end, none, (vfloat)(pinhole.cone * task.detail)};
        ways[num] = way;
        sums[num] = empty;
        lanes[num] = at->valid;
        num++;
    }
    if (!num)
        return;
    media_frame_of_view(&frame, view);
    walk_light(&pool, &frame, ways, lanes, num, lighting, sums);
    for (uint p = 0; p < num; p++) {
        const media_pixel *at = pixels + p;
#ifdef MEDIA_FREE
        const scatter_pixel pixel = {at->x + pinhole.x0_px, at->y + pinhole.y0_px, pinhole.sample};
#endif
#ifdef MEDIA_ONCE
        mend_once(&pool, &frame, ways + p, at->valid, lighting + p, &light, &pixel, sums + p);
#endif
        missing[p] = sums[p].missing;
#ifdef MEDIA_PATHS
        const colour scattered = scattered_light(&pool, &frame, ways + p, at->valid, lighting + p, &light, sums[p].tau,
                                                 &pixel, with_land ? &land : 0, missing + p);
        sums[p].light = add_colour(sums[p].light, scattered, (vfloat)(1.0f));
#endif
    }
#if MEDIA_MODE == KARST_MEDIA_FULL
    if (has_sun)
        dim_sun(&pool, &frame, &light, pinhole.cone * task.detail, lighting, num, pixels, missing);
#endif
    uint num_missing = 0;
    for (uint p = 0; p < num; p++) {
        const media_pixel *at = pixels + p;
        num_missing += (uint)count_lanes(missing[p] & at->valid);
#ifdef MEDIA_ALONE
        lay_alone(sums + p, &light, task.most_depth, at->order, at->valid, plane, has_sun, has_mirror, parts);
        const vint veiled = (vint)(0);
#else
        const vint veiled = at->valid & (v_gt(sums[p].tau, none) | v_lt(at->from_sun, (vfloat)(1.0f)));
#endif
        if (!v_any(veiled))
            continue;
        /* As far as its light comes from, in the mean, the medium is seen through the air before it. */
        const vfloat mean_t = sums[p].reach / lane_max(sums[p].weight, (vfloat)(1.0e-12f));
        const vfloat share = lane_max(sums[p].weight, (vfloat)(1.0e-6f));
        colour own = {sums[p].light.r / share, sums[p].light.g / share, sums[p].light.b / share};
#ifdef SHADE_ATMOSPHERE
        const air_way way = air_way_of(&sky, sky_table, &at->direction, lighting[p].to_sun, mean_t);
        own = air_through(&way, own);
#else
        own = hazy_colour(&light, own, &at->direction, lighting[p].to_sun, mean_t);
#endif
#ifdef MEDIA_STREAMS
        own.r *= tone_exp2_minus(mean_t * (absorption.x * LOG2_E));
        own.g *= tone_exp2_minus(mean_t * (absorption.y * LOG2_E));
        own.b *= tone_exp2_minus(mean_t * (absorption.z * LOG2_E));
#endif
        store_pixel(at, sums + p, &own, task.most_depth, plane, has_sun, has_mirror, veiled, parts);
    }
    if (num_missing)
        atomic_add(counters + KARST_MEDIA_LACKING, num_missing);
}

#ifdef MEDIA_STREAMS
/* What is left of the light of a stream's rays, from where the medium scatters it, inside of clear matter. */
RAY_INLINE colour left_on_way(K_GLOBAL const karst_clear_way *ways, const path_rays *r, vfloat t)
{
    K_GLOBAL const float *words = (K_GLOBAL const float *)ways;
    const vint at = v_select(r->valid, r->index, (vint)(0)) * (int)(sizeof(karst_clear_way) / sizeof(float));
    const colour left = {tone_exp2_minus(v_gather_float(words, at) * t * LOG2_E),
                         tone_exp2_minus(v_gather_float(words, at + 1) * t * LOG2_E),
                         tone_exp2_minus(v_gather_float(words, at + 2) * t * LOG2_E)};
    return left;
}

/* Where rays end: on land, or (over_hits, 0: there is none) on clear matter before it. */
RAY_INLINE vfloat end_of_rays(K_GLOBAL const karst_hit *hits, K_GLOBAL const karst_hit *over_hits, const path_rays *r)
{
    const vint at = v_select(r->valid, r->index, (vint)(0)) * (int)(sizeof(karst_hit) / sizeof(float));
    const vfloat land = lane_min(v_gather_float((K_GLOBAL const float *)hits, at), r->t_max);
    return over_hits ? lane_min(land, v_gather_float((K_GLOBAL const float *)over_hits, at)) : land;
}

/* Lays media before what a stream's rays see: adds their light to the rays' pixels, and takes from the rays'
 * throughput what they hide. `adds` 0: neither, for what rays ask for. */
__kernel K_WIDE void media_stream(POOL_PARAMETERS, K_GLOBAL const karst_cast_view *view, karst_media_task task,
                                  karst_pinhole pinhole, karst_light light, K_GLOBAL karst_ray *rays,
                                  K_GLOBAL const uint *count, K_GLOBAL const karst_hit *hits,
                                  K_GLOBAL const karst_hit *over_hits, K_GLOBAL const karst_clear_way *ways,
                                  K_GLOBAL float *parts, uint adds, karst_shade_anchor anchor,
                                  K_GLOBAL const uint *grids, K_GLOBAL const karst_sun_depth *states,
                                  K_GLOBAL const karst_brick_owner *owners, K_GLOBAL uint *used,
                                  K_GLOBAL uint *looks, K_GLOBAL uint *counters, K_GLOBAL const ulong *data
#ifdef MEDIA_FLUENCE
                                  ,
                                  karst_fluence_boxes fluence_boxes, K_GLOBAL const uint *fluence_words
#endif
#ifdef SHADE_ATMOSPHERE
                                  ,
                                  karst_sky sky, K_GLOBAL const float *sky_table
#endif
#ifdef MEDIA_PATHS
                                  ,
                                  uint with_land, LAND_PARAMETERS
#endif
)
{
    const pools pool = POOL_FIELDS;
#ifdef MEDIA_PATHS
    const pools land = LAND_FIELDS;
#endif
    __local near_octave known[WORLD_NEAR_OCTAVES + 1];
    __local near_octave *octaves = known + (get_num_groups(0) == 0 ? 1 : 0); /* as shade.cl */
    const uint num_rays = *count, lowest = (uint)get_global_id(0) * LANES;
    world_colour_prepare(data, anchor.voxel, anchor.fraction, octaves, (uint)get_local_id(0), (uint)get_local_size(0));
    barrier(CLK_LOCAL_MEM_FENCE);
    if (lowest >= num_rays)
        return;
    const path_rays r = load_paths(rays, lowest, num_rays);
    const vfloat end = end_of_rays(hits, over_hits, &r);
    const vector3 *direction = &r.direction, *origin = &r.origin;
    media_frame frame;
    media_sums sums = EMPTY_SUMS;
    media_lighting lighting;
    lighting.most_depth = task.most_depth;
    lighting.metres = task.metres;
    lighting.grids = grids;
    lighting.grid_states = states;
    lighting.owners = owners;
    lighting.used = used;
    lighting.looks = looks;
    lighting.serial = view->serial;
    lighting.sun = task.sun;
    lighting.sun_colour = uniform_colour(light.sun_colour);
    lighting.sky_colour = light_all_around(&light);
    lighting.to_sun = dot3(direction, light.sun_direction);
    lighting.direction = direction;
    lighting.origin = origin;
    lighting.data = data;
    lighting.anchor = &anchor;
    lighting.octaves = octaves;
#ifdef MEDIA_FLUENCE
    lighting.fluence.words = fluence_words;
    lighting.fluence.boxes = fluence_boxes;
#endif
    media_frame_of_view(&frame, view);
    const media_rays way = {*origin, *direction, (vfloat)(0.0f), end, r.width * task.detail, r.cone * task.detail};
    walk_light(&pool, &frame, &way, &r.valid, 1u, &lighting, &sums);
#ifdef MEDIA_FREE
    const scatter_pixel pixel = {(r.pixel & 0xffff) + pinhole.x0_px, (r.pixel >> 16) + pinhole.y0_px, pinhole.sample};
#endif
#ifdef MEDIA_ONCE
    mend_once(&pool, &frame, &way, r.valid, &lighting, &light, &pixel, &sums);
#endif
#ifdef MEDIA_PATHS
    const colour scattered =
        scattered_light(&pool, &frame, &way, r.valid, &lighting, &light, sums.tau, &pixel, with_land ? &land : 0,
                        &sums.missing);
    sums.light = add_colour(sums.light, scattered, (vfloat)(1.0f));
#endif

    const uint num_missing = (uint)count_lanes(sums.missing & r.valid);
    if (num_missing)
        atomic_add(counters + KARST_MEDIA_LACKING, num_missing);
    const uint veiled = mask_bits(r.valid & v_gt(sums.tau, (vfloat)(0.0f)));
    if (!adds || !veiled)
        return;
    const vfloat kept =
        v_select(v_gt(sums.tau, (vfloat)(task.most_depth)), (vfloat)(0.0f), tone_exp2_minus(sums.tau * LOG2_E));
    const vfloat mean_t = sums.reach / lane_max(sums.weight, (vfloat)(1.0e-12f));
    const vfloat share = lane_max(sums.weight, (vfloat)(1.0e-6f));
    const vector3 middle = {k_fma(direction->x, mean_t, origin->x), k_fma(direction->y, mean_t, origin->y),
                            k_fma(direction->z, mean_t, origin->z)};
    colour own = {sums.light.r / share, sums.light.g / share, sums.light.b / share};
#ifdef SHADE_ATMOSPHERE
    const air_way air = air_way_between(&sky, sky_table, origin, &middle, direction, lighting.to_sun, mean_t);
    own = air_through(&air, own);
#else
    own = colour_through_haze(&light, own, lighting.to_sun, haze_clear_between(&light, origin, &middle, mean_t));
#endif
    own.r *= sums.weight, own.g *= sums.weight, own.b *= sums.weight;
    if (ways) {
        const colour left = left_on_way(ways, &r, mean_t);
        own.r *= left.r, own.g *= left.g, own.b *= left.b;
    }
    add_paths(parts, (size_t)pinhole.width_px * (size_t)pinhole.height_px, pinhole.width_px, pinhole.height_px, &r,
              veiled, &own);
    float through[LANES];
    v_store_float(kept, through);
    for (uint l = 0; l < LANES; l++)
        for (int c = 0; c < 3 && (veiled >> l & 1u); c++)
            rays[lowest + l].throughput[c] *= through[l];
}
#endif

#ifdef MEDIA_LAMPS
MEDIA_FUNCTION void walk_lamps(const pools *pool, const media_frame *frame, const media_rays *rays, vint lanes,
                               const media_lighting *light, media_sums *sums)
{
    walk_rays(WALK_LAMPS, pool, frame, rays, &lanes, 1u, light, sums);
}

/* Adds what media before the pixels of a sample scatter of the lamps' light. */
__kernel K_WIDE void media_lamps(POOL_PARAMETERS, LAND_PARAMETERS, K_GLOBAL const karst_cast_view *view,
                                 karst_media_task task, karst_pinhole pinhole, karst_light light,
                                 K_GLOBAL const karst_hit *hits, K_GLOBAL const karst_hit *over_hits,
                                 K_GLOBAL const karst_lamp *lamps, uint num_lamps, uint with_land,
                                 K_GLOBAL float *parts, karst_shade_anchor anchor, K_GLOBAL uint *counters,
                                 K_GLOBAL const ulong *data
#ifdef SHADE_ATMOSPHERE
                                 ,
                                 karst_sky sky, K_GLOBAL const float *sky_table
#endif
)
{
    const pools pool = POOL_FIELDS, land = LAND_FIELDS;
    __local near_octave known[WORLD_NEAR_OCTAVES + 1];
    __local near_octave *octaves = known + (get_num_groups(0) == 0 ? 1 : 0); /* as shade.cl */
    world_colour_prepare(data, anchor.voxel, anchor.fraction, octaves, (uint)get_local_id(0), (uint)get_local_size(0));
    barrier(CLK_LOCAL_MEM_FENCE);
    vint x, y;
    const vint valid = packet_pixels((uint)get_global_id(0), pinhole.width_px, pinhole.height_px, &x, &y);
    if (!v_any(valid))
        return;
    const vint order = packet_order(x, y, pinhole.width_px, pinhole.height_px);
    const vint at = v_select(valid, order, (vint)(0)) * (int)(sizeof(karst_hit) / sizeof(float));
    const size_t plane = (size_t)pinhole.width_px * (size_t)pinhole.height_px;
    const vector3 direction = pinhole_direction(&pinhole, x, y);
    const vfloat none = (vfloat)(0.0f);
    vfloat end = lane_min(v_gather_float((K_GLOBAL const float *)hits, at), (vfloat)(pinhole.t_max));
    if (over_hits)
        end = lane_min(end, v_gather_float((K_GLOBAL const float *)over_hits, at));
    media_frame frame;
    media_sums sums = EMPTY_SUMS;
    media_lighting lighting;
    lighting.most_depth = task.most_depth;
    lighting.metres = task.metres;
    lighting.used = 0;
    lighting.to_sun = none;
    lighting.direction = &direction;
#ifdef MEDIA_STREAMS
    lighting.origin = 0;
#endif
    lighting.data = data;
    lighting.anchor = &anchor;
    lighting.octaves = octaves;
    lighting.lamps.lamps = lamps;
    lighting.lamps.num = num_lamps;
    lighting.lamps.seed = lamps_hash((v_int_to_uint(x + pinhole.x0_px) * 0x9e3779b1u) ^
                                     (v_int_to_uint(y + pinhole.y0_px) * 0x85ebca77u) ^
                                     (vuint)(pinhole.sample * 0xc2b2ae3du));
    media_frame_of_view(&frame, view);
    const media_rays way = {{none, none, none}, direction, none, end, none, (vfloat)(pinhole.cone * task.detail)};
    walk_lamps(&pool, &frame, &way, valid, &lighting, &sums);

    vint missing = sums.missing;
    const lit_segments *lit = &sums.lit;
    const vint lanes = valid & v_gt(lit->total, none);
    if (v_any(lanes)) {
        vector3 from, to;
        vfloat t;
        vint shadowed;
        rays_to_lamps(&lighting.lamps, &direction, lit, lanes, pinhole.t_max, &from, &to, &t, &shadowed);
        const media_rays to_lamp = {from, to, none, t,
                                    lane_max(lit->t * (pinhole.cone * task.detail), (vfloat)(1.0f)),
                                    (vfloat)(LAND_CONE)};
        media_sums between = EMPTY_SUMS, hidden = EMPTY_SUMS;
        lighting.most_depth = 16.0f;
        walk_depth(&pool, &frame, &to_lamp, lanes, &lighting, &between);
        if (with_land && v_any(shadowed))
            walk_land(&land, &frame, &to_lamp, shadowed, &lighting, &hidden);
        missing |= (between.missing | hidden.missing) & lanes;
        const vfloat strength =
            v_select(lanes & ~hidden.done, lit->total * tone_exp2_minus(between.tau * LOG2_E), none);
        const vfloat mean_t = sums.reach / lane_max(sums.weight, (vfloat)(1.0e-12f));
        const vfloat share = lane_max(sums.weight, (vfloat)(1.0e-6f)), per = strength / share;
        colour own = {lit->hue.r * per, lit->hue.g * per, lit->hue.b * per};
        const colour black = {none, none, none};
#ifdef SHADE_ATMOSPHERE
        const vfloat to_sun = dot3(&direction, light.sun_direction);
        const air_way air = air_way_of(&sky, sky_table, &direction, to_sun, mean_t);
        const colour through = air_through(&air, own), before = air_through(&air, black);
#else
        const vfloat to_sun = dot3(&direction, light.sun_direction);
        const colour through = hazy_colour(&light, own, &direction, to_sun, mean_t),
                     before = hazy_colour(&light, black, &direction, to_sun, mean_t);
#endif
        /* What lies before the medium has been added with the light of the sun and the sky. */
        const vfloat added[3] = {through.r - before.r, through.g - before.g, through.b - before.b};
        for (int c = 0; c < 3; c++) {
            K_GLOBAL float *part = parts + (size_t)c * plane;
            store_ordered(part, order, lanes, k_fma(added[c], share, load_ordered(part, order, lanes)));
        }
    }
    const uint num_missing = (uint)count_lanes(missing & valid);
    if (num_missing)
        atomic_add(counters + KARST_MEDIA_LACKING, num_missing);
}
#endif
