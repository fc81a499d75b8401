/* Entry points of shading: shadow rays from hits, and pixels from both. See raycast/shade.h. */
#include "raycast/shade_shared.h"
#include "raycast/light.clh"
#include "raycast/surface.clh"
/* The world's own colours: empty if it has none. */
#include "world.clh"
#ifdef SHADE_WORLD_COLOUR
#include "raycast/exact.clh"
#endif

/* The sun is 0.53 degrees wide: what a shadow ray meets at distance t is blurred over this share of it. */
#define SUN_CONE 0.0093f
/* Shadow rays leave the surface by this many voxels of its level: the facets of a coarser level reach that high. */
#define SHADOW_OFFSET 1.5f

#ifdef SHADE_WORLD_COLOUR
/* The world's colour at the hits, level by level, of which there are at most a few in one packet; blended as the hits
 * are. */
RAY_INLINE colour world_albedo(K_GLOBAL const ulong *data, const karst_shade_anchor *anchor, const surface_hits *s,
                               const vector3 *direction, vint hit)
{
    world_point_at place;
    colour albedo = {(vfloat)(0.0f), (vfloat)(0.0f), (vfloat)(0.0f)};
    vfloat t = v_select(hit, s->t, (vfloat)(0.0f));
    exact_places(&place, anchor, direction, t);
    vint own = hit, next = hit & v_gt(s->weight, (vfloat)(0.0f));
    while (v_any(own | next)) {
        vfloat left = v_select(own, v_to_float(s->level), v_select(next, v_to_float(s->level + 1), (vfloat)(1000.0f)));
        int level = (int)v_min_across(left);
        vint from_own = own & v_eq(s->level, (vint)(level)), from_next = next & v_eq(s->level, (vint)(level - 1));
        vfloat red, green, blue;
        world_colour(data, &place, level, s->normal.x, s->normal.y, s->normal.z, &red, &green, &blue);
        vfloat share = v_select(from_own, 1.0f - s->weight, v_select(from_next, s->weight, (vfloat)(0.0f)));
        albedo.r = k_fma(share, lane_unit(red), albedo.r);
        albedo.g = k_fma(share, lane_unit(green), albedo.g);
        albedo.b = k_fma(share, lane_unit(blue), albedo.b);
        own &= ~from_own;
        next &= ~from_next;
    }
    return albedo;
}
#endif

#if LANES == 16
#define FIRST_LANE(v) ((uint)(v).s0)
#else
#define FIRST_LANE(v) ((uint)(v))
#endif

/* Stores in lanes: whole rows of a packet where all of it lies in the picture. */
#if LANES == 16
#define PIXEL_(l)                        \
    if (valid.l) {                       \
        pixels[index.l] = (uint)bytes.l; \
        depth[index.l] = distance.l;     \
    }
RAY_INLINE void store_pixels(K_GLOBAL uint *pixels, K_GLOBAL float *depth, vint index, vint valid, int width,
                             vint bytes, vfloat distance)
{
    if (v_all(valid)) {
        K_GLOBAL int *p = (K_GLOBAL int *)pixels + index.s0;
        K_GLOBAL float *d = depth + index.s0;
        vstore4(bytes.s0123, 0, p);
        vstore4(bytes.s4567, 0, p + width);
        vstore4(bytes.s89ab, 0, p + 2 * width);
        vstore4(bytes.scdef, 0, p + 3 * width);
        vstore4(distance.s0123, 0, d);
        vstore4(distance.s4567, 0, d + width);
        vstore4(distance.s89ab, 0, d + 2 * width);
        vstore4(distance.scdef, 0, d + 3 * width);
    } else {
        EACH_LANE(PIXEL_)
    }
}
#define RAY_(l)                                                                                                       \
    if (valid.l) {                                                                                                    \
        K_GLOBAL float *w = (K_GLOBAL float *)(rays + place.l);                                                       \
        vstore4((float4)(origin.x.l, origin.y.l, origin.z.l, t_min.l), 0, w);                                         \
        vstore4((float4)(light.sun_direction[0], light.sun_direction[1], light.sun_direction[2], t_max.l), 0, w + 4); \
        vstore4((float4)(width.l, cone, as_float(pixel.l), 0.0f), 0, w + 8);                                          \
    }
#define STORE_RAYS() EACH_LANE(RAY_)
#else
RAY_INLINE void store_pixels(K_GLOBAL uint *pixels, K_GLOBAL float *depth, vint index, vint valid, int width,
                             vint bytes, vfloat distance)
{
    if (valid) {
        pixels[index] = (uint)bytes;
        depth[index] = distance;
    }
}
#define STORE_RAYS()                                                                               \
    if (valid) {                                                                                   \
        karst_ray ray = {{origin.x, origin.y, origin.z},                                           \
                         t_min,                                                                    \
                         {light.sun_direction[0], light.sun_direction[1], light.sun_direction[2]}, \
                         t_max,                                                                    \
                         width,                                                                    \
                         cone,                                                                     \
                         (uint)pixel,                                                              \
                         0u};                                                                      \
        rays[place] = ray;                                                                         \
    }
#endif

/* What surfaces are read with: the pools, the view's detail and blend. */
#define SURFACE_PARAMETERS                                                                           \
    BRICK_PARAMETERS, K_GLOBAL const karst_node *nodes, K_GLOBAL const karst_brick_info *brick_info, \
        K_GLOBAL const karst_tile_info *tile_info, float detail, float blend
#define SURFACE_FIELDS                                                          \
    {                                                                           \
        BRICK_FIELDS, nodes, brick_info, tile_info, pinhole.cone *detail, blend \
    }

__kernel K_WIDE void shade_shadow_rays(SURFACE_PARAMETERS, karst_pinhole pinhole, karst_light light,
                                       K_GLOBAL const karst_hit *hits, K_GLOBAL karst_ray *rays)
{
    const surface_source source = SURFACE_FIELDS;
    vint x, y;
    vint valid = packet_pixels((uint)get_global_id(0), pinhole.width_px, pinhole.height_px, &x, &y);
    if (!v_any(valid))
        return;
    vector3 direction = pinhole_direction(&pinhole, x, y);
    vint place = v_select(valid, packet_order(x, y, pinhole.width_px, pinhole.height_px), (vint)(0));
    prefetch_surface(hits, &source, FIRST_LANE(place), (uint)(pinhole.width_px * pinhole.height_px));
    surface_hits s = load_surface(hits, &source, place, &direction);
    vint sunny = v_ne(s.kind, (vint)((int)KARST_HIT_MISS)) & v_gt(dot3(&s.normal, light.sun_direction), (vfloat)(0.0f));
    vfloat voxel = v_as_float((s.level + 127) << 23);
    vfloat offset = voxel * k_fma(s.weight, (vfloat)(SHADOW_OFFSET), (vfloat)(SHADOW_OFFSET));
    vector3 origin;
    origin.x = k_fma(direction.x, s.t, s.normal.x * offset);
    origin.y = k_fma(direction.y, s.t, s.normal.y * offset);
    origin.z = k_fma(direction.z, s.t, s.normal.z * offset);
    vfloat t_min = (vfloat)(0.0f), t_max = v_select(sunny, (vfloat)(light.shadow_distance), t_min);
    /* The level of the hit or coarser, from the first step on. */
    vfloat width = lane_max(s.t * pinhole.cone, voxel * (1.0001f / detail));
    float cone = pinhole.cone > SUN_CONE ? pinhole.cone : SUN_CONE;
    vint pixel = y * pinhole.width_px + x;
    STORE_RAYS()
}

/* Entries are thin: PoCL compiles an entry, and whatever it takes in, three times. */
#if LANES == 16
#define SHADE_CALL static K_WIDE __attribute__((noinline))
#else
#define SHADE_CALL RAY_INLINE
#endif

/* The pixels of a packet. counts: hits, provisional, incomplete, coarser than own_detail. */
SHADE_CALL void shade_packet(const surface_source *source, const karst_pinhole *pinhole, const karst_light *light,
                             K_GLOBAL const karst_hit *hits, K_GLOBAL const karst_hit *shadow_hits, int has_shadows,
                             K_GLOBAL uint *pixels, K_GLOBAL float *depth, const karst_shade_anchor *anchor,
                             K_GLOBAL const ulong *data, float own_detail, uint packet, __local uint *counts)
{
    vint x, y;
    vint valid = packet_pixels(packet, pinhole->width_px, pinhole->height_px, &x, &y);
    if (v_any(valid)) {
        vector3 direction = pinhole_direction(pinhole, x, y);
        vint place = v_select(valid, packet_order(x, y, pinhole->width_px, pinhole->height_px), (vint)(0));
        prefetch_surface(hits, source, FIRST_LANE(place), (uint)(pinhole->width_px * pinhole->height_px));
        surface_hits s = load_surface(hits, source, place, &direction);
        vint hit = v_ne(s.kind, (vint)((int)KARST_HIT_MISS)) & valid;
        vfloat to_sun = dot3(&direction, light->sun_direction);
        colour c = sky_colour(light, &direction, to_sun);
        if (v_any(hit)) {
            vfloat lit = lane_max(dot3(&s.normal, light->sun_direction), (vfloat)(0.0f));
            if (has_shadows) {
#if LANES == 16
                /* as load_surface does for the hits */
                for (int line = 0; line < 8; line++)
                    RAY_PREFETCH((K_GLOBAL const char *)(shadow_hits + FIRST_LANE(place)) + 2048 + 64 * line);
#endif
                vint blocked = v_gather_int((K_GLOBAL const int *)shadow_hits,
                                            place * (int)(sizeof(karst_hit) / sizeof(int)) + 1) &
                               0xff;
                lit = v_select(v_eq(blocked, (vint)((int)KARST_HIT_MISS)), lit, (vfloat)(0.0f));
            }
#ifdef SHADE_WORLD_COLOUR
            colour albedo = world_albedo(data, anchor, &s, &direction, hit);
#else
            colour albedo = plain_albedo(light, &s.normal);
#endif
            colour ground = ground_colour(light, &s.normal, albedo, lit);
            ground = hazy_colour(light, ground, &direction, to_sun, s.t);
            c.r = v_select(hit, ground.r, c.r);
            c.g = v_select(hit, ground.g, c.g);
            c.b = v_select(hit, ground.b, c.b);
        }
        vfloat dither = tone_dither(x, y);
        vint bytes =
            tone_byte(c.r, dither) | tone_byte(c.g, dither) << 8 | tone_byte(c.b, dither) << 16 | (int)0xff000000;
        store_pixels(pixels, depth, y * pinhole->width_px + x, valid, pinhole->width_px, bytes,
                     v_select(hit, s.t, (vfloat)(INFINITY)));
        counts[0] = (uint)count_lanes(hit);
        counts[1] = (uint)count_lanes(hit & v_eq(s.kind, (vint)((int)KARST_HIT_PROVISIONAL)));
        counts[2] = (uint)count_lanes(valid & v_ne(s.word & (int)KARST_HIT_INCOMPLETE, (vint)(0)));
        /* A proof of solid needs no finer level. */
        vfloat wanted = s.t * (pinhole->cone * own_detail * 1.0001f), voxel = v_as_float((s.level + 127) << 23);
        vint coarser =
            hit & (v_eq(s.kind, (vint)((int)KARST_HIT_PROVISIONAL)) |
                   (v_eq(s.kind, (vint)((int)KARST_HIT_SURFACE)) & v_lt(wanted, voxel) & v_gt(s.level, (vint)(0))));
        if (own_detail > 0.0f)
            counts[3] = (uint)count_lanes(coarser);
    }
}

__kernel K_WIDE void shade_pixels(SURFACE_PARAMETERS, karst_pinhole pinhole, karst_light light,
                                  K_GLOBAL const karst_hit *hits, K_GLOBAL const karst_hit *shadow_hits,
                                  int has_shadows, K_GLOBAL uint *pixels, K_GLOBAL float *depth,
                                  K_GLOBAL uint *counters, karst_shade_anchor anchor, K_GLOBAL const ulong *data,
                                  float own_detail)
{
    const surface_source source = SURFACE_FIELDS;
    /* Each work-item has counters of its own: adding to shared ones would make it wait. */
    __local uint counts[KARST_PACKET_RAYS * KARST_GROUP_PACKETS / LANES][4];
    __local uint *mine = counts[get_local_id(0)];
    for (int i = 0; i < 4; i++)
        mine[i] = 0;

    shade_packet(&source, &pinhole, &light, hits, shadow_hits, has_shadows, pixels, depth, &anchor, data, own_detail,
                 (uint)get_global_id(0), mine);
    barrier(CLK_LOCAL_MEM_FENCE);
    if (get_local_id(0) == 0)
        for (int i = 0; i < 4; i++) {
            uint sum = 0;
            for (uint item = 0; item < get_local_size(0); item++)
                sum += counts[item][i];
            if (sum)
                atomic_add(&counters[i], sum);
        }
}
