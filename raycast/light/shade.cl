/* Entry point of shading: pixels, and shadow rays, from hits. See raycast/light/shade.h. */
#include "raycast/shade_shared.h"
#include "raycast/light/light.clh"
#include "raycast/shadow_shared.h"
#if defined(SHADE_MIRROR) || defined(SHADE_PATHS)
#define SHADE_STREAMS
#include "raycast/cast/packing.clh"
#include "raycast/light/radiance_shared.h"
#endif
#include "raycast/light/facing.clh"
#include "raycast/light/surface.clh"
#ifdef SHADE_PAINT
#include "raycast/light/paint.clh"
#define SHADE_PAINT_PARAMETERS , PAINT_PARAMETERS
#define SHADE_PAINT_TAKES , const paint_source *paint
#define SHADE_PAINT_HERE const paint_source paint = PAINT_FIELDS;
#define SHADE_PAINT_SOURCE , &paint
#else
#define SHADE_PAINT_PARAMETERS
#define SHADE_PAINT_TAKES
#define SHADE_PAINT_HERE
#define SHADE_PAINT_SOURCE
#endif
#include "raycast/light/through.clh"
/* The world's own colours: empty if it has none. */
#include "world.clh"
#ifdef SHADE_WORLD_COLOUR
#include "raycast/cast/exact.clh"
#endif

#if defined(SHADE_STREAMS) && defined(WORLD_OUTPUT_MIRROR)
#define OWN_MIRROR
#if defined(SHADE_PATHS) && defined(WORLD_OUTPUT_GLOSS)
#define OWN_GLOSS
#define OWN_MIRROR_IS(mirror) vfloat mirror = (vfloat)(0.0f), mirror##_gloss = (vfloat)(0.0f)
#define OWN_MIRROR_TAKEN , vfloat *mirror, vfloat *gloss
#define OWN_MIRROR_OF(mirror) , &mirror, &mirror##_gloss
#else
#define OWN_MIRROR_IS(mirror) vfloat mirror = (vfloat)(0.0f)
#define OWN_MIRROR_TAKEN , vfloat *mirror
#define OWN_MIRROR_OF(mirror) , &mirror
#endif
#else
#define OWN_MIRROR_TAKEN
#define OWN_MIRROR_OF(mirror)
#endif

/* Surfaces that let a share of the light pass straight (raycast/light/pass.h). */
#if defined(SHADE_PASS) && defined(WORLD_OUTPUT_TRANSPARENCY)
#define OWN_PASS
#define OWN_PASS_TAKEN , vfloat *passes
#define OWN_PASS_OF(passes) , &passes
#else
#define OWN_PASS_TAKEN
#define OWN_PASS_OF(passes)
#endif

#ifdef SHADE_WORLD_COLOUR
/* The world's colour at the hits, which lie along `direction` from the anchor and were met along `look`; level by
 * level, of which there are at most a few in one packet; blended as the hits are. `glow`: 0, to which what the surface
 * gives off is added; so is to *mirror the share of light that it mirrors, if it says, and to *passes the share that
 * passes it. */
RAY_INLINE colour world_albedo(K_GLOBAL const ulong *data, __local const near_octave *octaves,
                               const karst_shade_anchor *anchor, const surface_hits *s, const vector3 *direction,
                               const vector3 *look, vint hit, colour *glow OWN_MIRROR_TAKEN OWN_PASS_TAKEN)
{
    world_point_at place;
    world_near_at near;
    colour albedo = {(vfloat)(0.0f), (vfloat)(0.0f), (vfloat)(0.0f)};
    vfloat t = v_select(hit, s->t, (vfloat)(0.0f));
    exact_steps(&near, anchor, direction, t, v_max_across(t));
    if (WORLD_COLOUR_TAKES_PLACES || near.is_far)
        exact_places(&place, anchor, direction, t);
    vfloat facing[KARST_FACING_FLOATS];
    face_look(&s->normal, look, facing);
    vint own = hit, next = hit & v_gt(s->weight, (vfloat)(0.0f));
    while (v_any(own | next)) {
        vfloat left = v_select(own, v_to_float(s->level), v_select(next, v_to_float(s->level + 1), (vfloat)(1000.0f)));
        int level = (int)v_min_across(left);
        vint from_own = own & v_eq(s->level, (vint)(level)), from_next = next & v_eq(s->level, (vint)(level - 1));
#ifdef WORLD_NUM_OUTPUTS
        vfloat values[WORLD_NUM_OUTPUTS];
        world_outputs(data, &near, octaves, &place, level, facing, values);
#else
        vfloat values[3];
        world_colour(data, &near, octaves, &place, level, facing, values);
#endif
        vfloat share = v_select(from_own, 1.0f - s->weight, v_select(from_next, s->weight, (vfloat)(0.0f)));
        albedo.r = k_fma(share, lane_unit(values[0]), albedo.r);
        albedo.g = k_fma(share, lane_unit(values[1]), albedo.g);
        albedo.b = k_fma(share, lane_unit(values[2]), albedo.b);
#ifdef WORLD_OUTPUT_EMISSION
        glow->r = k_fma(share, own_light(values[WORLD_OUTPUT_EMISSION]), glow->r);
        glow->g = k_fma(share, own_light(values[WORLD_OUTPUT_EMISSION + 1]), glow->g);
        glow->b = k_fma(share, own_light(values[WORLD_OUTPUT_EMISSION + 2]), glow->b);
#endif
#ifdef OWN_MIRROR
        *mirror = k_fma(share, lane_unit(values[WORLD_OUTPUT_MIRROR]), *mirror);
#endif
#ifdef OWN_GLOSS
        *gloss = k_fma(share, lane_unit(values[WORLD_OUTPUT_GLOSS]), *gloss);
#endif
#ifdef OWN_PASS
        *passes = k_fma(share, lane_unit(values[WORLD_OUTPUT_TRANSPARENCY]), *passes);
#endif
        own &= ~from_own;
        next &= ~from_next;
    }
    return albedo;
}
#else
typedef int near_octave;
#define WORLD_NEAR_OCTAVES 0
#endif

#ifdef SHADE_PAINT
/* Lays what is painted at hits over the world's colours; what it covers gives off no light. Returns the share that
 * still shows. */
RAY_INLINE vfloat lay_paint(const paint_source *paint, const karst_light *light, K_GLOBAL const karst_hit *hits,
                            vint index, vint hit, vfloat weight, colour *albedo, colour *glow)
{
    colour over;
    const vfloat shows = paint_at_hits(paint, hits, index, hit, weight, &over);
    *albedo = add_colour(over, *albedo, shows * (1.0f - light->paint_alone));
    glow->r *= shows, glow->g *= shows, glow->b *= shows;
    return shows;
}
#endif

/* The ground's colour and what it gives off. */
#ifdef WORLD_OUTPUT_EMISSION
RAY_INLINE colour glowing_colour(const karst_light *light, const vector3 *normal, colour albedo, const colour *glow,
                                 vfloat lit)
{
    return add_colour(ground_colour(light, normal, albedo, lit), *glow, (vfloat)(1.0f - light->sun_direction[3]));
}
#else
#define glowing_colour(light, normal, albedo, glow, lit) ground_colour(light, normal, albedo, lit)
#endif

/* Of pixels, how open they are. */
#ifdef SHADE_OCCLUSION
#define SHADE_OPEN_PARAMETERS , K_GLOBAL const float *open_pixels
#define SHADE_OPEN , open_pixels
#define FIND_OPEN(place, valid) \
    const vfloat open = lane_max(load_ordered(open_pixels, place, valid), (vfloat)(light->sun_direction[3]))
#define AS_OPEN(ground, normal, albedo) without_hidden(light, normal, albedo, open, ground)
#else
#define SHADE_OPEN_PARAMETERS
#define SHADE_OPEN
#define FIND_OPEN(place, valid)
#define AS_OPEN(ground, normal, albedo) ground
#endif

/* Stores in lanes: whole rows of a packet where all of it lies in the picture. */
#if LANES == 16
#define PIXEL_(l) \
    if (valid.l)  \
        to[index.l] = v.l;
RAY_INLINE void store_rows(K_GLOBAL int *to, vint index, vint valid, int width, vint v)
{
    if (v_all(valid)) {
        K_GLOBAL int *p = to + index.s0;
        vstore4(v.s0123, 0, p);
        vstore4(v.s4567, 0, p + width);
        vstore4(v.s89ab, 0, p + 2 * width);
        vstore4(v.scdef, 0, p + 3 * width);
    } else {
        EACH_LANE(PIXEL_)
    }
}
#else
RAY_INLINE void store_rows(K_GLOBAL int *to, vint index, vint valid, int width, vint v)
{
    if (valid)
        to[index] = v;
}
#endif

#ifdef SHADE_SHADOWS
/* Shadow rays leave the surface by this many voxels of its level: the facets of a coarser level reach that high. */
#define SHADOW_OFFSET 1.5f
/* And rise at least so fast above it, as casting sees it: less light than that is not looked at so closely. */
#define LEAST_RISE 0.02f

/* Of the lanes that face the sun: what they are if it is hidden, and the cosine of the angle between it and the normal.
 */
typedef struct {
    vint sunny, dark;
    vfloat lit;
} facing_sun;

/* Writes the shadow rays of a packet, towards the sun from just above the surface. */
RAY_INLINE void store_shadow_rays(K_GLOBAL float *rays, size_t plane, vint order, vint valid, float cone, float detail,
                                  const surface_hits *s, const vector3 *direction, const facing_sun *facing)
{
    vfloat voxel = v_as_float((s->level + 127) << 23);
    /* The level of the hit or coarser, from the first step on. */
    vfloat width = lane_max(s->t * cone, voxel * (1.0001f / detail));
    store_ordered(rays + KARST_SHADOW_WIDTH * plane, order, valid, v_select(facing->sunny, width, (vfloat)(0.0f)));
    if (!v_any(facing->sunny))
        return;
    vfloat offset = voxel * k_fma(s->weight, (vfloat)(SHADOW_OFFSET), (vfloat)(SHADOW_OFFSET));
    store_ordered(rays + KARST_SHADOW_ORIGIN * plane, order, valid, k_fma(direction->x, s->t, s->normal.x * offset));
    store_ordered(rays + (KARST_SHADOW_ORIGIN + 1) * plane, order, valid,
                  k_fma(direction->y, s->t, s->normal.y * offset));
    store_ordered(rays + (KARST_SHADOW_ORIGIN + 2) * plane, order, valid,
                  k_fma(direction->z, s->t, s->normal.z * offset));
    store_ordered(rays + KARST_SHADOW_DARK * plane, order, valid, v_as_float(facing->dark));
    store_ordered(rays + KARST_SHADOW_RISE * plane, order, valid, lane_max(facing->lit, (vfloat)(LEAST_RISE)));
}
#endif

RAY_INLINE vint pixel_bytes(const colour *c, vfloat dither)
{
    return tone_byte(c->r, dither) | tone_byte(c->g, dither) << 8 | tone_byte(c->b, dither) << 16 | (int)0xff000000;
}

#ifdef SHADE_RADIANCE
/* What pixels are without the sun, and what it adds where it is not hidden: linear light, plane by plane in packet
 * order. */
RAY_INLINE void store_radiance(K_GLOBAL float *parts, size_t plane, vint order, vint valid, const colour *base,
                               const colour *sun)
{
    store_ordered(parts, order, valid, base->r);
    store_ordered(parts + plane, order, valid, base->g);
    store_ordered(parts + 2 * plane, order, valid, base->b);
#ifdef SHADE_SHADOWS
    store_ordered(parts + 3 * plane, order, valid, sun->r);
    store_ordered(parts + 4 * plane, order, valid, sun->g);
    store_ordered(parts + 5 * plane, order, valid, sun->b);
#else
    (void)sun;
#endif
}
#endif

#ifdef SHADE_STREAMS
#define NUM_COUNTS 9 /* as KARST_SHADE_COUNTERS */
#define MIRRORED 5   /* those of a stream: the same numbers from here on */
#define NO_COUNTS                 \
    {                             \
        0, 0, 0, 0, 0, 0, 0, 0, 0 \
    }
#else
#define NUM_COUNTS 5
#define NO_COUNTS     \
    {                 \
        0, 0, 0, 0, 0 \
    }
#endif

/* Entries are thin: PoCL compiles an entry, and whatever it takes in, three times. */
#if LANES == 16
#define SHADE_CALL static K_WIDE __attribute__((noinline))
#else
#define SHADE_CALL RAY_INLINE
#endif

/* What all packets of a launch have in common. */
typedef struct {
    const karst_pinhole *pinhole;
    const karst_light *light;
    K_GLOBAL const karst_hit *hits;
    K_GLOBAL float *shadow_rays;
    const karst_shade_anchor *anchor;
    K_GLOBAL const ulong *data;
    __local const near_octave *octaves;
    float detail, own_detail, blend;
} shade_scene;

/* The same for names of its fields, which no store can change. */
#define SHADE_SCENE(scene)                              \
    const karst_pinhole *pinhole = (scene)->pinhole;    \
    const karst_light *light = (scene)->light;          \
    K_GLOBAL const karst_hit *hits = (scene)->hits;     \
    K_GLOBAL float *shadow_rays = (scene)->shadow_rays; \
    const float detail = (scene)->detail, own_detail = (scene)->own_detail, blend = (scene)->blend;

/* The pixels of a packet as they are out of all shadows, and its shadow rays. Adds to
 * counts: hits, provisional, incomplete, coarser than own_detail, shadow rays. */
SHADE_CALL void shade_packet(const shade_scene *scene, K_GLOBAL uint *pixels, K_GLOBAL float *depth, uint packet,
                             uint counts[NUM_COUNTS] SHADE_SKY_TAKES SHADE_OPEN_PARAMETERS)
{
    SHADE_SCENE(scene)
    vint x, y;
    vint valid = packet_pixels(packet, pinhole->width_px, pinhole->height_px, &x, &y);
    if (v_any(valid)) {
        vector3 direction = pinhole_direction(pinhole, x, y);
        vint place = packet_order(x, y, pinhole->width_px, pinhole->height_px);
        surface_hits s = load_surface(hits, place, valid, &direction, pinhole->cone * detail, blend);
        vint hit = v_mask(v_ne(s.kind, (vint)((int)KARST_HIT_MISS))) & valid;
        vfloat to_sun = dot3(&direction, light->sun_direction);
        colour c = {(vfloat)(0.0f), (vfloat)(0.0f), (vfloat)(0.0f)};
        if (v_any(valid & ~hit))
            c = SKY_OF(&direction, to_sun);
#ifndef SHADE_RADIANCE
        vfloat dither = tone_dither(x + pinhole->x0_px, y + pinhole->y0_px);
#endif
        vint sunny = (vint)(0), dark = (vint)(1);
        colour sun = {(vfloat)(0.0f), (vfloat)(0.0f), (vfloat)(0.0f)};
#ifdef SHADE_MIRROR
        vfloat mirrored = (vfloat)(0.0f);
#endif
#ifdef SHADE_PASS
        vfloat passing = (vfloat)(0.0f);
#endif
        vfloat lit = (vfloat)(0.0f); /* cosine of the angle between the surface's normal and the sun */
        if (v_any(hit)) {
            lit = lane_max(dot3(&s.normal, light->sun_direction), (vfloat)(0.0f));
            colour glow = {(vfloat)(0.0f), (vfloat)(0.0f), (vfloat)(0.0f)};
#ifdef OWN_MIRROR
            OWN_MIRROR_IS(mirror);
#elif defined(SHADE_MIRROR)
            const vfloat mirror = (vfloat)(light->mirror);
#endif
#ifdef OWN_PASS
            vfloat passes = (vfloat)(0.0f);
#endif
#ifdef SHADE_WORLD_COLOUR
            colour albedo = world_albedo(scene->data, scene->octaves, scene->anchor, &s, &direction, &direction, hit,
                                         &glow OWN_MIRROR_OF(mirror) OWN_PASS_OF(passes));
#else
            colour albedo = plain_albedo(light, &s.normal);
#endif
#ifdef SHADE_PAINT
            const vfloat shows = lay_paint(paint, light, hits, place, hit, s.weight, &albedo, &glow);
#ifdef OWN_MIRROR
            mirror *= shows;
#else
            (void)shows;
#endif
#ifdef OWN_PASS
            passes *= shows;
#endif
#endif
            FIND_WAY(&direction, to_sun, s.t);
#ifdef SHADE_MIRROR
#ifdef OWN_MIRROR
            mirror *= 1.0f - light->sun_direction[3];
#endif
            const vfloat rest = 1.0f - mirror;
            albedo.r *= rest, albedo.g *= rest, albedo.b *= rest;
            mirrored = v_select(hit, mirror * CLEAR(&direction, s.t), mirrored);
#endif
#ifdef OWN_PASS
            passes *= 1.0f - light->sun_direction[3];
            passing = v_select(hit, passes * CLEAR(&direction, s.t), passing);
            passes = 1.0f - passes; /* what is left for the surface */
            albedo.r *= passes, albedo.g *= passes, albedo.b *= passes;
            glow.r *= passes, glow.g *= passes, glow.b *= passes;
#ifdef SHADE_MIRROR
            mirrored *= v_select(hit, passes, (vfloat)(1.0f));
#endif
#endif
            FIND_OPEN(place, valid);
            colour ground = AS_OPEN(glowing_colour(light, &s.normal, albedo, &glow, lit), &s.normal, albedo);
            ground = HAZY(ground, &direction, to_sun, s.t);
            c.r = v_select(hit, ground.r, c.r);
            c.g = v_select(hit, ground.g, c.g);
            c.b = v_select(hit, ground.b, c.b);
#ifdef SHADE_SHADOWS
            sunny = hit & v_gt(lit, (vfloat)(0.0f));
            if (v_any(sunny)) {
                ground = AS_OPEN(glowing_colour(light, &s.normal, albedo, &glow, (vfloat)(0.0f)), &s.normal, albedo);
                ground = HAZY(ground, &direction, to_sun, s.t);
#ifdef SHADE_RADIANCE
                sun.r = v_select(sunny, c.r - ground.r, sun.r);
                sun.g = v_select(sunny, c.g - ground.g, sun.g);
                sun.b = v_select(sunny, c.b - ground.b, sun.b);
                c.r = v_select(sunny, ground.r, c.r);
                c.g = v_select(sunny, ground.g, c.g);
                c.b = v_select(sunny, ground.b, c.b);
#else
                dark = pixel_bytes(&ground, dither);
#endif
            }
#endif
        }
#ifdef SHADE_SHADOWS
        const facing_sun facing = {sunny, dark, lit};
        store_shadow_rays(shadow_rays, (size_t)pinhole->width_px * (size_t)pinhole->height_px, place, valid,
                          pinhole->cone, detail, &s, &direction, &facing);
#endif
        const vint index = y * pinhole->width_px + x;
#ifdef SHADE_RADIANCE
        store_radiance(depth, (size_t)pinhole->width_px * (size_t)pinhole->height_px, place, valid, &c, &sun);
#ifdef SHADE_MIRROR
        store_ordered(depth + KARST_RADIANCE_MIRROR_PLANE * (size_t)pinhole->width_px * (size_t)pinhole->height_px,
                      place, valid, mirrored);
#ifdef SHADE_PASS
        store_ordered(depth + KARST_RADIANCE_PASS_PLANE * (size_t)pinhole->width_px * (size_t)pinhole->height_px,
                      place, valid, passing);
#endif
#endif
#ifdef SHADE_SHADOWS
        store_rows((K_GLOBAL int *)pixels, index, valid, pinhole->width_px, (vint)(0));
#endif
#else
        store_rows((K_GLOBAL int *)pixels, index, valid, pinhole->width_px, pixel_bytes(&c, dither));
        if (depth)
            store_rows((K_GLOBAL int *)depth, index, valid, pinhole->width_px,
                       v_as_int(v_select(hit, s.t, (vfloat)(INFINITY))));
#endif
        counts[0] += (uint)count_lanes(hit);
        counts[1] += (uint)count_lanes(hit & v_mask(v_eq(s.kind, (vint)((int)KARST_HIT_PROVISIONAL))));
        counts[2] += (uint)count_lanes(valid & v_mask(v_ne(s.word & (int)KARST_HIT_INCOMPLETE, (vint)(0))));
        /* A proof of solid needs no finer level. */
        vfloat wanted = s.t * (pinhole->cone * own_detail * 1.0001f), voxel = v_as_float((s.level + 127) << 23);
        vint coarser = hit & (v_mask(v_eq(s.kind, (vint)((int)KARST_HIT_PROVISIONAL))) |
                              (v_mask(v_eq(s.kind, (vint)((int)KARST_HIT_SURFACE))) & v_mask(v_lt(wanted, voxel)) &
                               v_mask(v_gt(s.level, (vint)(0)))));
        if (own_detail > 0.0f)
            counts[3] += (uint)count_lanes(coarser);
#ifdef SHADE_SHADOWS
        counts[4] += (uint)count_lanes(sunny);
#endif
    }
}

#if LANES == 16
RAY_INLINE void add_counts(K_GLOBAL uint *counters, const uint counts[NUM_COUNTS])
{
    for (int i = 0; i < NUM_COUNTS; i++)
        if (counts[i])
            atomic_add(&counters[i], counts[i]);
}
#else
RAY_INLINE void add_group_counts(K_GLOBAL uint *counters, const uint counts[NUM_COUNTS],
                                 __local uint sums[][NUM_COUNTS])
{
    for (int i = 0; i < NUM_COUNTS; i++)
        sums[get_local_id(0)][i] = counts[i];
    barrier(CLK_LOCAL_MEM_FENCE);
    if (get_local_id(0) == 0)
        for (int i = 0; i < NUM_COUNTS; i++) {
            uint sum = 0;
            for (uint item = 0; item < get_local_size(0); item++)
                sum += sums[item][i];
            if (sum)
                atomic_add(&counters[i], sum);
        }
}
#endif

/* With packets as lanes, work-items take parts of part_packets from a counter until none are left, whatever their
 * number: `taken` is 0 before a launch and after it, and the size of work-groups is 1. Rays as work-items are a whole
 * number of groups, and a work-group is one. */
__kernel K_WIDE void shade_pixels(float detail, float blend, karst_pinhole pinhole, karst_light light,
                                  K_GLOBAL const karst_hit *hits, K_GLOBAL float *shadow_rays, K_GLOBAL uint *pixels,
                                  K_GLOBAL float *depth, K_GLOBAL uint *counters, karst_shade_anchor anchor,
                                  K_GLOBAL const ulong *data, float own_detail, K_GLOBAL uint *taken, uint num_packets,
                                  uint part_packets SHADE_SKY_PARAMETERS SHADE_OPEN_PARAMETERS)
{
    __local near_octave known[WORLD_NEAR_OCTAVES + 1];
    /* Not an address that compilers know: PoCL 3.1 gives work-groups memory by changing the kernel alone, and misses
     * what its optimisers have put in functions that it calls. */
    __local near_octave *octaves = known + (get_num_groups(0) == 0 ? 1 : 0);
    uint counts[NUM_COUNTS] = NO_COUNTS;
    SHADE_PAINT_HERE
    const shade_scene scene = {&pinhole, &light, hits, shadow_rays, &anchor, data, octaves, detail, own_detail, blend};
#if LANES == 16
    const uint num_parts = (num_packets + part_packets - 1) / part_packets;
    uint part = atomic_inc(taken);
#ifdef SHADE_WORLD_COLOUR
    if (part < num_parts)
        world_colour_prepare(data, anchor.voxel, anchor.fraction, octaves, 0, 1);
#endif
    for (; part < num_parts; part = atomic_inc(taken)) {
        const uint first = part * part_packets, left = num_packets - first;
        for (uint i = 0; i < part_packets && i < left; i++)
            shade_packet(&scene, pixels, depth, first + i, counts SHADE_SKY SHADE_OPEN);
    }
    /* Each item is refused once, and the last of them leaves the word as it was. */
    if (part == num_parts + (uint)get_num_groups(0) - 1)
        atomic_xchg(taken, 0u);
    add_counts(counters, counts);
#else
    (void)taken;
    (void)num_packets;
    (void)part_packets;
#ifdef SHADE_WORLD_COLOUR
    world_colour_prepare(data, anchor.voxel, anchor.fraction, octaves, (uint)get_local_id(0), (uint)get_local_size(0));
    barrier(CLK_LOCAL_MEM_FENCE);
#endif
    /* Packets past the picture's end have no valid pixel. */
    shade_packet(&scene, pixels, depth, (uint)get_global_id(0), counts SHADE_SKY SHADE_OPEN);
    /* Each work-item has counters of its own: adding to shared ones would make it wait. */
    __local uint sums[KARST_PACKET_RAYS * KARST_GROUP_PACKETS][NUM_COUNTS];
    add_group_counts(counters, counts, sums);
#endif
}

#ifdef SHADE_MIRROR
/* One number for each ray of a stream's packet, to where its pixel has it. */
RAY_INLINE void scatter_float(K_GLOBAL float *plane, vint place, uint lanes, vfloat v)
{
    int at[LANES];
    float value[LANES];
    v_store_int(place, at);
    v_store_float(v, value);
    for (int lane = 0; lane < LANES; lane++)
        if (lanes >> lane & 1u)
            plane[at[lane]] = value[lane];
}

RAY_INLINE void add_at_pixels(K_GLOBAL float *plane, vint place, uint lanes, vfloat v)
{
    scatter_float(plane, place, lanes, v_gather_float(plane, place) + v);
}

/* Field `word` of the stream's rays in the lanes, as floats. */
#define STREAM_WORD(word) v_gather_float(words, first + (word))

/* A stream whose rays are shaded, and where what they see goes. */
typedef struct {
    K_GLOBAL const karst_ray *rays;
    uint num_rays;
    K_GLOBAL float *suns; /* planes of `room` rays, as the shadow rays' */
    uint room;
    K_GLOBAL float *parts;
} shade_stream;

/* Adds to the pixels of a packet of a stream what its rays see without the sun; what that adds, and the shadow rays
 * that ask for it, are in the stream's own order. */
SHADE_CALL void shade_ray_packet(const shade_scene *scene, const shade_stream *stream, uint packet,
                                 uint counts[NUM_COUNTS] SHADE_SKY_TAKES)
{
    SHADE_SCENE(scene)
    K_GLOBAL const karst_ray *rays = stream->rays;
    K_GLOBAL float *suns = stream->suns, *parts = stream->parts;
    const uint num_rays = stream->num_rays, room = stream->room;
    const size_t plane = (size_t)pinhole->width_px * (size_t)pinhole->height_px;
    const uint lowest = packet * LANES;
    if (lowest >= num_rays)
        return;
    const vint index = V_LANE + (int)lowest, valid = v_mask(v_lt(index, (vint)((int)num_rays)));
    const uint lanes = mask_bits(valid);
    K_GLOBAL const float *words = (K_GLOBAL const float *)(rays + lowest);
    const vint first = v_select(valid, index - (int)lowest, (vint)(0)) * (int)(sizeof(karst_ray) / sizeof(float));
    const vector3 origin = {STREAM_WORD(0), STREAM_WORD(1), STREAM_WORD(2)},
                  direction = {STREAM_WORD(4), STREAM_WORD(5), STREAM_WORD(6)};
    const vfloat width = STREAM_WORD(8), cone = STREAM_WORD(9);
    const vint pixel = v_as_int(STREAM_WORD(10));
    const vint place = packet_order(pixel & 0xffff, pixel >> 16, pinhole->width_px, pinhole->height_px);
    const colour throughput = {STREAM_WORD(12), STREAM_WORD(13), STREAM_WORD(14)};
    surface_hits s = load_surface(hits, index, valid, &direction, 0.0f, 0.0f);
    const vfloat footprint = k_fma(s.t, cone, width);
    if (blend > 0.0f)
        s.weight = v_select(v_eq(s.word & (int)(0xffu | KARST_HIT_UNBLENDED), (vint)((int)KARST_HIT_SURFACE)),
                            level_weight(blend, footprint * detail, s.level), s.weight);
    const vint hit = v_mask(v_ne(s.kind, (vint)((int)KARST_HIT_MISS))) & valid;
    const vfloat to_sun = dot3(&direction, light->sun_direction);
    colour c = SKY_OF(&direction, to_sun), sun = {(vfloat)(0.0f), (vfloat)(0.0f), (vfloat)(0.0f)};
    vint sunny = (vint)(0);
    vector3 to = {k_fma(direction.x, s.t, origin.x), k_fma(direction.y, s.t, origin.y),
                  k_fma(direction.z, s.t, origin.z)};
    vfloat lit = (vfloat)(0.0f);
    if (v_any(hit)) {
        lit = lane_max(dot3(&s.normal, light->sun_direction), (vfloat)(0.0f));
        colour glow = {(vfloat)(0.0f), (vfloat)(0.0f), (vfloat)(0.0f)};
#ifdef SHADE_WORLD_COLOUR
        /* as seen from the anchor */
        surface_hits seen = s;
        seen.t = lane_max(k_sqrt(k_fma(to.x, to.x, k_fma(to.y, to.y, to.z * to.z))), (vfloat)(1.0e-6f));
        const vfloat per = 1.0f / seen.t;
        const vector3 way = {to.x * per, to.y * per, to.z * per};
#ifdef OWN_MIRROR
        OWN_MIRROR_IS(mirror); /* which nothing sees a second time */
#endif
#ifdef OWN_PASS
        vfloat passes = (vfloat)(0.0f);
#endif
        colour albedo = world_albedo(scene->data, scene->octaves, scene->anchor, &seen, &way, &direction, hit,
                                     &glow OWN_MIRROR_OF(mirror) OWN_PASS_OF(passes));
#else
        colour albedo = plain_albedo(light, &s.normal);
#endif
#ifdef SHADE_PAINT
        const vfloat shows = lay_paint(paint, light, hits, index, hit, s.weight, &albedo, &glow);
#ifdef OWN_PASS
        passes *= shows;
#else
        (void)shows;
#endif
#endif
#ifdef OWN_PASS
        passes = 1.0f - passes; /* what is left for the surface */
        albedo.r *= passes, albedo.g *= passes, albedo.b *= passes;
        glow.r *= passes, glow.g *= passes, glow.b *= passes;
#endif
        FIND_WAY_BETWEEN(&origin, &to, &direction, to_sun, s.t);
        colour ground = THROUGH(glowing_colour(light, &s.normal, albedo, &glow, lit), to_sun);
        c.r = v_select(hit, ground.r, c.r), c.g = v_select(hit, ground.g, c.g), c.b = v_select(hit, ground.b, c.b);
#ifdef SHADE_SHADOWS
        sunny = hit & v_gt(lit, (vfloat)(0.0f));
        ground = THROUGH(glowing_colour(light, &s.normal, albedo, &glow, (vfloat)(0.0f)), to_sun);
        sun.r = v_select(sunny, c.r - ground.r, sun.r), sun.g = v_select(sunny, c.g - ground.g, sun.g);
        sun.b = v_select(sunny, c.b - ground.b, sun.b);
        c.r = v_select(sunny, ground.r, c.r), c.g = v_select(sunny, ground.g, c.g);
        c.b = v_select(sunny, ground.b, c.b);
#endif
    }
    add_at_pixels(parts, place, lanes, c.r * throughput.r);
    add_at_pixels(parts + plane, place, lanes, c.g * throughput.g);
    add_at_pixels(parts + 2 * plane, place, lanes, c.b * throughput.b);
#ifdef SHADE_SHADOWS
    if (v_any(sunny)) {
        const vfloat voxel = v_as_float((s.level + 127) << 23);
        const vfloat offset = voxel * k_fma(s.weight, (vfloat)(SHADOW_OFFSET), (vfloat)(SHADOW_OFFSET));
        store_ordered(suns, index, valid, sun.r * throughput.r);
        store_ordered(suns + room, index, valid, sun.g * throughput.g);
        store_ordered(suns + 2 * (size_t)room, index, valid, sun.b * throughput.b);
        store_ordered(shadow_rays + KARST_SHADOW_WIDTH * (size_t)room, index, valid,
                      v_select(sunny, lane_max(footprint, voxel * (1.0001f / detail)), (vfloat)(0.0f)));
        store_ordered(shadow_rays + KARST_SHADOW_ORIGIN * (size_t)room, index, valid, k_fma(s.normal.x, offset, to.x));
        store_ordered(shadow_rays + (KARST_SHADOW_ORIGIN + 1) * (size_t)room, index, valid,
                      k_fma(s.normal.y, offset, to.y));
        store_ordered(shadow_rays + (KARST_SHADOW_ORIGIN + 2) * (size_t)room, index, valid,
                      k_fma(s.normal.z, offset, to.z));
        store_ordered(shadow_rays + KARST_SHADOW_DARK * (size_t)room, index, valid,
                      v_as_float(pixel | (int)KARST_SHADOW_OF_PIXEL));
        store_ordered(shadow_rays + KARST_SHADOW_RISE * (size_t)room, index, valid,
                      lane_max(lit, (vfloat)(LEAST_RISE)));
        counts[4] += (uint)count_lanes(sunny);
    } else {
        store_ordered(suns, index, valid, (vfloat)(0.0f));
        store_ordered(suns + room, index, valid, (vfloat)(0.0f));
        store_ordered(suns + 2 * (size_t)room, index, valid, (vfloat)(0.0f));
    }
#else
    (void)shadow_rays;
    (void)suns;
    (void)room;
    (void)sun;
#endif
    const vint provisional = hit & v_mask(v_eq(s.kind, (vint)((int)KARST_HIT_PROVISIONAL)));
    counts[MIRRORED + 1] += (uint)count_lanes(provisional);
    counts[MIRRORED + 2] += (uint)count_lanes(valid & v_mask(v_ne(s.word & (int)KARST_HIT_INCOMPLETE, (vint)(0))));
    if (own_detail > 0.0f)
        counts[MIRRORED + 3] += (uint)count_lanes(
            provisional |
            (hit & v_mask(v_eq(s.kind, (vint)((int)KARST_HIT_SURFACE))) & v_mask(v_gt(s.level, (vint)(0))) &
             v_mask(v_lt(footprint * (own_detail * 1.0001f), v_as_float((s.level + 127) << 23)))));
}

/* As shade_pixels, of the `count` rays of a stream. */
__kernel K_WIDE void shade_rays(float detail, float blend, karst_pinhole pinhole, karst_light light,
                                K_GLOBAL const karst_ray *rays, K_GLOBAL const uint *count,
                                K_GLOBAL const karst_hit *hits, K_GLOBAL float *shadow_rays, K_GLOBAL float *suns,
                                uint room, K_GLOBAL float *parts, K_GLOBAL uint *counters, karst_shade_anchor anchor,
                                K_GLOBAL const ulong *data, float own_detail, K_GLOBAL uint *taken,
                                uint part_packets SHADE_SKY_PARAMETERS)
{
    __local near_octave known[WORLD_NEAR_OCTAVES + 1];
    __local near_octave *octaves = known + (get_num_groups(0) == 0 ? 1 : 0); /* as in shade_pixels */
    uint counts[NUM_COUNTS] = NO_COUNTS;
    SHADE_PAINT_HERE
    const uint num_rays = *count;
    const shade_scene scene = {&pinhole, &light, hits, shadow_rays, &anchor, data, octaves, detail, own_detail, blend};
    const shade_stream stream = {rays, num_rays, suns, room, parts};
#if LANES == 16
    const uint num_packets = (num_rays + LANES - 1) / LANES;
    const uint num_parts = (num_packets + part_packets - 1) / part_packets;
    uint part = atomic_inc(taken);
#ifdef SHADE_WORLD_COLOUR
    if (part < num_parts)
        world_colour_prepare(data, anchor.voxel, anchor.fraction, octaves, 0, 1);
#endif
    for (; part < num_parts; part = atomic_inc(taken)) {
        const uint first = part * part_packets, left = num_packets - first;
        for (uint i = 0; i < part_packets && i < left; i++)
            shade_ray_packet(&scene, &stream, first + i, counts SHADE_SKY);
    }
    if (part == num_parts + (uint)get_num_groups(0) - 1)
        atomic_xchg(taken, 0u);
    add_counts(counters, counts);
#else
    (void)taken;
    (void)part_packets;
#ifdef SHADE_WORLD_COLOUR
    world_colour_prepare(data, anchor.voxel, anchor.fraction, octaves, (uint)get_local_id(0), (uint)get_local_size(0));
    barrier(CLK_LOCAL_MEM_FENCE);
#endif
    shade_ray_packet(&scene, &stream, (uint)get_global_id(0), counts SHADE_SKY);
    __local uint sums[KARST_PACKET_RAYS * KARST_GROUP_PACKETS][NUM_COUNTS];
    add_group_counts(counters, counts, sums);
#endif
}
#endif

#ifdef SHADE_PASS
#include "raycast/light/passing.clh"
#endif
#ifdef SHADE_PATHS
#include "raycast/light/paths.clh"
#endif
