/* Entry point of media: what they make of a picture. See raycast/media/media.h. */
#define MEDIA_HAS_LIGHT
#include "raycast/media/march.clh"
#include "raycast/light/radiance_shared.h"
#include "raycast/light/surface.clh"
#ifdef SHADE_ATMOSPHERE
#include "raycast/light/atmosphere.clh"
#endif
#include "world.clh"
#include "raycast/cast/exact.clh"

/* Orders of scattering after the first: each is seen through half the depth, is half as strong, and goes half as much
 * forwards. */
RAY_INLINE void phases(vfloat g, vfloat cosine, vfloat albedo, vfloat phase[4])
{
    vfloat share = (vfloat)(0.25f);
    K_UNROLL
    for (int i = 0; i < 4; i++) {
        const vfloat g2 = g * g, d = lane_max(1.0f + g2 - 2.0f * g * cosine, (vfloat)(1.0e-4f));
        phase[i] = share * (1.0f - g2) / (d * k_sqrt(d));
        g *= 0.5f;
#if defined MEDIA_ONCE || defined MEDIA_PATHS
        share = (vfloat)(0.0f);
#else
        share *= 0.5f * albedo;
#endif
    }
}

#define MOST_G 0.95f

RAY_INLINE media_look look_at_medium(const media_lighting *light, vfloat t, int level, vint lanes)
{
    world_point_at place;
    world_near_at near;
    media_look look;
    const vfloat none = (vfloat)(0.0f), at = v_select(lanes, t, none);
    vfloat g = none;
    exact_steps(&near, light->anchor, light->direction, at, v_max_across(at));
    if (WORLD_COLOUR_TAKES_PLACES || near.is_far)
        exact_places(&place, light->anchor, light->direction, at);
    __local const near_octave *octaves = (__local const near_octave *)light->octaves;
    look.emission.r = look.emission.g = look.emission.b = none;
#ifdef WORLD_NUM_OUTPUTS
    vfloat values[WORLD_NUM_OUTPUTS];
    world_outputs(light->data, &near, octaves, &place, level, none, (vfloat)(1.0f), none, values);
#ifdef WORLD_OUTPUT_MIRROR
    g = lane_min(lane_max(values[WORLD_OUTPUT_MIRROR], (vfloat)(-MOST_G)), (vfloat)(MOST_G));
#endif
#ifdef WORLD_OUTPUT_EMISSION
    look.emission.r = own_light(values[WORLD_OUTPUT_EMISSION]);
    look.emission.g = own_light(values[WORLD_OUTPUT_EMISSION + 1]);
    look.emission.b = own_light(values[WORLD_OUTPUT_EMISSION + 2]);
#endif
#else
    vfloat values[3];
    world_colour(light->data, &near, octaves, &place, level, none, (vfloat)(1.0f), none, values);
#endif
    look.albedo.r = lane_unit(values[0]);
    look.albedo.g = lane_unit(values[1]);
    look.albedo.b = lane_unit(values[2]);
    look.g = g;
    phases(g, light->to_sun, look.albedo.g, look.phase);
    return look;
}

MEDIA_FUNCTION void walk_light(const pools *pool, const media_frame *frame, const media_rays *rays, vint lanes,
                               const media_lighting *light, media_sums *sums)
{
    walk_rays(WALK_LIGHT, pool, frame, rays, lanes, light, sums);
}

#ifdef MEDIA_PATHS
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

/* Lays the media before the pixels of a sample, part by part (raycast/light/radiance_shared.h). */
__kernel K_WIDE void media_pixels(POOL_PARAMETERS, K_GLOBAL const karst_cast_view *view, karst_media_task task,
                                  karst_pinhole pinhole, karst_light light, K_GLOBAL const karst_hit *hits,
                                  K_GLOBAL float *parts, uint has_sun, uint has_mirror, karst_shade_anchor anchor,
                                  K_GLOBAL const uint *grids, K_GLOBAL const karst_sun_depth *states,
                                  K_GLOBAL const karst_brick_owner *owners, K_GLOBAL uint *used,
                                  K_GLOBAL uint *looks, K_GLOBAL uint *counters,
                                  K_GLOBAL const ulong *data
#ifdef SHADE_ATMOSPHERE
                                  ,
                                  karst_sky sky, K_GLOBAL const float *sky_table
#endif
)
{
    const pools pool = POOL_FIELDS;
    __local near_octave known[WORLD_NEAR_OCTAVES + 1];
    __local near_octave *octaves = known + (get_num_groups(0) == 0 ? 1 : 0); /* as shade.cl */
    world_colour_prepare(data, anchor.voxel, anchor.fraction, octaves, (uint)get_local_id(0), (uint)get_local_size(0));
    barrier(CLK_LOCAL_MEM_FENCE);
    vint x, y;
    const vint valid = packet_pixels((uint)get_global_id(0), pinhole.width_px, pinhole.height_px, &x, &y);
    if (!v_any(valid))
        return;
    const vint order = packet_order(x, y, pinhole.width_px, pinhole.height_px);
    const size_t plane = (size_t)pinhole.width_px * (size_t)pinhole.height_px;
    const vector3 direction = pinhole_direction(&pinhole, x, y);
    const surface_hits s = load_surface(hits, order, valid, &direction, pinhole.cone * view->detail, view->blend);
    const vint hit = v_mask(v_ne(s.kind, (vint)((int)KARST_HIT_MISS))) & valid;
    const vfloat none = (vfloat)(0.0f);
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
    lighting.to_sun = dot3(&direction, light.sun_direction);
    lighting.direction = &direction;
    lighting.data = data;
    lighting.anchor = &anchor;
    lighting.octaves = octaves;
    media_frame_of_view(&frame, view);
    const media_rays way = {{none, none, none},
                            direction,
                            none,
                            v_select(hit, s.t, (vfloat)(pinhole.t_max)),
                            none,
                            (vfloat)(pinhole.cone * task.detail)};
    walk_light(&pool, &frame, &way, valid, &lighting, &sums);

    vint missing = sums.missing;
#ifdef MEDIA_PATHS
    const scatter_pixel pixel = {x + pinhole.x0_px, y + pinhole.y0_px, pinhole.sample};
    const colour scattered = scattered_light(&pool, &frame, &way, valid, &lighting, &light, sums.tau, &pixel, &missing);
    sums.light = add_colour(sums.light, scattered, (vfloat)(1.0f));
#endif
    vfloat from_sun = (vfloat)(1.0f);
#if MEDIA_MODE == KARST_MEDIA_FULL
    /* What is left of the sun where it shines on land. */
    const vint lit = hit & v_gt(dot3(&s.normal, light.sun_direction), none);
    if (has_sun && v_any(lit)) {
        const media_rays to_sun = {{direction.x * s.t, direction.y * s.t, direction.z * s.t},
                                   {(vfloat)(light.sun_direction[0]), (vfloat)(light.sun_direction[1]),
                                    (vfloat)(light.sun_direction[2])},
                                   none,
                                   (vfloat)(light.shadow_distance),
                                   lane_max(s.t * (2.0f * pinhole.cone * task.detail), (vfloat)(1.0f)),
                                   (vfloat)(LAND_CONE)};
        media_sums above = EMPTY_SUMS;
        lighting.most_depth = 16.0f;
        lighting.used = 0;
        walk_depth(&pool, &frame, &to_sun, lit, &lighting, &above);
        missing |= above.missing & lit;
        from_sun = v_select(lit, tone_exp2_minus(above.tau * LOG2_E), from_sun);
    }
#endif
    const vint veiled = valid & (v_gt(sums.tau, none) | v_lt(from_sun, (vfloat)(1.0f)));
    if (v_any(veiled)) {
        const vfloat kept =
            v_select(v_gt(sums.tau, (vfloat)(task.most_depth)), none, tone_exp2_minus(sums.tau * LOG2_E));
        /* As far as its light comes from, in the mean, the medium is seen through the air before it. */
        const vfloat mean_t = sums.reach / lane_max(sums.weight, (vfloat)(1.0e-12f));
        const vfloat share = lane_max(sums.weight, (vfloat)(1.0e-6f));
        colour own = {sums.light.r / share, sums.light.g / share, sums.light.b / share};
#ifdef SHADE_ATMOSPHERE
        const air_way way = air_way_of(&sky, sky_table, &direction, lighting.to_sun, mean_t);
        own = air_through(&way, own);
#else
        own = hazy_colour(&light, own, &direction, lighting.to_sun, mean_t);
#endif
        const vfloat added[3] = {own.r * sums.weight, own.g * sums.weight, own.b * sums.weight};
        K_UNROLL
        for (int c = 0; c < 3; c++) {
            K_GLOBAL float *part = parts + (size_t)c * plane;
            store_ordered(part, order, veiled, k_fma(load_ordered(part, order, veiled), kept, added[c]));
            if (has_sun) {
                part += 3 * plane;
                store_ordered(part, order, veiled, load_ordered(part, order, veiled) * kept * from_sun);
            }
        }
        if (has_mirror) {
            K_GLOBAL float *part = parts + KARST_RADIANCE_MIRROR_PLANE * plane;
            store_ordered(part, order, veiled, load_ordered(part, order, veiled) * kept);
        }
    }
    const uint num_missing = (uint)count_lanes(missing & valid);
    if (num_missing)
        atomic_add(counters + KARST_MEDIA_LACKING, num_missing);
}
