/* Shading: hit records into pixels and depth. */
#ifndef KARST_RAYCAST_SHADE_H
#define KARST_RAYCAST_SHADE_H

#include "cache/colours.h"
#include "raycast/cast/cast.h"
#include "raycast/light/paths_shared.h"
#include "raycast/light/skies.h"
#include "raycast/shade_shared.h"

typedef struct karst_shader karst_shader;

/* A world's own colours. */
typedef struct {
    /* Text in the lane dialect that defines, with LANES lanes and the types of producers/steps/density.clh,
     *     void world_colour(world_data data, const world_near_at *near, __local const near_octave *octaves,
     *                       const world_point_at *place, int level,
     *                       const vfloat facing[KARST_FACING_FLOATS], vfloat values[3]);
     * the albedo (linear RGB) at places, band-limited to voxels of a level. Or, with WORLD_NUM_OUTPUTS defined, the
     * same with `vfloat values[WORLD_NUM_OUTPUTS]`, under the name world_outputs: from 0 on the albedo, and where they
     * are defined, from WORLD_OUTPUT_EMISSION on what the surface gives off (linear RGB), at WORLD_OUTPUT_MIRROR the
     * share of light that it mirrors, and so on (producers/language/graph/entries.h). `place` is only looked at where
     * near->is_far says so, or if WORLD_COLOUR_TAKES_PLACES is 1. Of the anchor (level-0 voxel, fraction in 2^-32)
     *     void world_colour_prepare(world_data data, const long anchor[3], const uint fraction[3],
     *                               __local near_octave *octaves, uint item, uint num_items);
     * has made WORLD_NEAR_OCTAVES octaves: each of num_items work-items, from 0, its part, and a barrier after that.
     * near_octave is the text's own type. Borrowed during creation. */
    const char *source;
    const char *options;      /* build options for it */
    const karst_buffer *data; /* borrowed for the shader's life */
} karst_shade_colour;

/* What a shading kernel is built for: to make shadow rays, too; to write linear light (karst_radiance_parts), not
 * bytes; and for land that mirrors, which takes the latter. */
#define KARST_SHADE_SHADOWS 1u
#define KARST_SHADE_RADIANCE 2u
#define KARST_SHADE_MIRROR 4u
#define KARST_SHADE_PAINT 16u     /* land has colours of karst_shader_set_colours over the world's */
#define KARST_SHADE_ATMOSPHERE 8u /* the sky and what is before land are those of karst_shader_set_skies */
#define KARST_SHADE_PATHS 32u     /* for karst_shade_paths */
#define KARST_SHADE_PASS 256u /* land lets a share of the light pass, where its text says so: raycast/light/pass.h */
#define KARST_SHADE_THROUGH_CLEAR 128u /* paths go through clear matter: raycast/light/clear_paths.h */
#define KARST_SHADE_SPLATS 512u /* hits on discs have colours of their own; takes paint */
#define KARST_SHADE_OCCLUSION 64u /* pixels are as open as karst_shader_set_occlusion says; takes radiance */

/* Builds the shading kernel for `ways` (KARST_SHADE_*). Errors: KARST_FAILED. */
karst_shader *karst_shader_create(karst_context *context, unsigned ways, karst_error *error);
/* The same for a world with colours of its own: the light's ground colours then only matter for what the ground throws
 * back. Whoever uses it sets the anchor of each view (karst_shader_set_anchor) before it shades. */
karst_shader *karst_shader_create_coloured(karst_context *context, unsigned ways, const karst_shade_colour *colour,
                                           karst_error *error);
void karst_shader_set_anchor(karst_shader *shader, const karst_position *anchor);
/* Of a shader for an atmosphere: borrowed until the next call. Until the first the sky is black. */
void karst_shader_set_skies(karst_shader *shader, karst_skies *skies);
/* Of a shader for paint: the colours of these pools' bricks, borrowed. Until then nothing is painted. */
void karst_shader_set_colours(karst_shader *shader, const karst_colours *colours, const karst_cache_buffers *bricks);
/* Of a shader for occlusion: how open the picture's pixels are (raycast/light/occlusion.h), borrowed until the next
 * call. It is called before karst_shade_pixels. */
void karst_shader_set_occlusion(karst_shader *shader, const karst_buffer *open);
void karst_shader_destroy(karst_shader *shader); /* NULL is fine */

/* Beside those of karst_shade_pixels: mirrored rays, by karst_bounce_mirror, and by karst_shade_rays what of their hits
 * is provisional, incomplete, coarser. */
#define KARST_SHADE_COUNTERS 9

/* Pixels: RGBA8, top row first, width * height, into `pixels` (any cl_mem: a mapped pixel buffer or plain memory);
 * depth in level-0 voxels along the ray, INFINITY for none; NULL: it is not wanted. counters (KARST_SHADE_COUNTERS
 * uints, zeroed by the caller's engine beforehand): hits, provisional, incomplete, coarser than view->own_detail,
 * shadow rays. shadow_rays (karst_cast_shadow_bytes): NULL exactly if the shader was made without shadows. Else pixels
 * are as they are in the sun, and each hit that faces it gets a ray, which starts at the hit's level and grows coarser
 * with the sun's own width; karst_cast_shadows then darkens the pixels that lie in shadow. A shader for radiance writes
 * no bytes: `depth` gets the parts of a sample instead, and `pixels`, with shadows, marks that are 0
 * (raycast/light/radiance_shared.h), where karst_cast_shadows notes which rays end. */
bool karst_shade_pixels(karst_shader *shader, const karst_cast_view *view, const karst_pinhole *pinhole,
                        const karst_light *light, karst_buffer *hits, karst_buffer *shadow_rays, cl_mem pixels,
                        karst_buffer *depth, karst_buffer *counters, karst_error *error);

/* Rays of which there are as many as the word `count` holds (max_rays at most), their hits, and where what the sun adds
 * goes, to `suns`, and the shadow rays that ask for it, to shadow_rays, whose widths must be 0: three planes, and those
 * of raycast/shadow_shared.h, of `room` rays in the stream's order; both NULL without shadows. */
typedef struct {
    const karst_buffer *rays, *count, *hits;
    uint32_t max_rays, room;
    karst_buffer *shadow_rays, *suns;
} karst_shade_stream;
/* Adds to parts what the rays of a stream see, each times its throughput, at its `pixel` (y << 16 | x). Adds to
 * counters 4 and 6 to 8. For shaders that mirror. Asynchronous. Errors: KARST_FAILED. */
bool karst_shade_rays(karst_shader *shader, const karst_cast_view *view, const karst_pinhole *pinhole,
                      const karst_light *light, const karst_shade_stream *stream, karst_buffer *parts,
                      karst_buffer *counters, karst_error *error);

/* The shares of light that the surfaces let pass which the rays of a stream hit: a float for each ray, 0 where there is
 * none. by_haze: times what of the light what lies before the surface lets through. For shaders of KARST_SHADE_PASS.
 * Asynchronous. Errors: KARST_FAILED. */
typedef struct {
    const karst_buffer *rays, *count, *hits;
    uint32_t max_rays;
    bool by_haze;
} karst_share_stream;
bool karst_shade_shares(karst_shader *shader, const karst_cast_view *view, const karst_light *light,
                        const karst_share_stream *stream, karst_buffer *shares, karst_error *error);

/* With task->each_lamp: the light of each lamp on the surfaces of a part of the stream. Lamps that cast no shadows add
 * theirs to parts, whether or not `next` is there. Of each other lamp, in their order, `to_lamps` has task->num_packets
 * packets of rays, and `shining` a word for each packet: bits of the lanes that have a ray. Adds to counter 4 alone.
 *
 * Without: surfaces of one generation of paths: rays as karst_shade_rays has them, whose flags are those of
 * raycast/light/paths_shared.h. Adds to parts (three planes) what they see of sky and emission, and leaves in
 * `to_lamps` and, unless it is the last generation, in `next` a ray for each of them, which may be idle: to a lamp,
 * whose light is its throughput, and on from the surface. lamps: task->num_lamps of karst_lamp. Adds to counters: of
 * the first generation as karst_shade_pixels, of others 6 to 8; and rays to lamps to 4. For shaders for paths.
 * Asynchronous. Errors: KARST_FAILED. */
typedef struct {
    const karst_buffer *rays, *count, *hits, *lamps;
    uint32_t max_rays;
    karst_buffer *next, *to_lamps;
    karst_buffer *shining; /* of task->each_lamp; else NULL */
} karst_path_streams;
bool karst_shade_paths(karst_shader *shader, const karst_cast_view *view, const karst_pinhole *pinhole,
                       const karst_light *light, const karst_path_task *task, const karst_path_streams *streams,
                       karst_buffer *parts, karst_buffer *counters, karst_error *error);

#endif
