/* What land lets straight through: a surface may say that a share of the light passes it as if it were not there
 * (`transparency`).
 *
 * A ray that passes goes on inside matter, looking for its end (KARST_SIDE_BACK), and from there as any ray. Matter
 * takes its share where light enters it; what leaves it passes whole. So a sheet takes its share once, however thick it
 * is, and rays that never come out are dark.
 *
 * Streams that may have such rays are first cast to where these come out (karst_pass_leave). Rays to lamps are followed
 * through what lets light pass, surface by surface, and lose what that keeps (karst_pass_to_lamps); so are those to the
 * sun that land hides (karst_pass_sun).
 *
 * What is done between casts is done ray by ray, in place: it does not depend on lanes. */
#ifndef KARST_RAYCAST_PASS_H
#define KARST_RAYCAST_PASS_H

#include "raycast/cast/cast.h"
#include "raycast/light/shade.h"

typedef struct karst_pass karst_pass;

/* Errors: KARST_FAILED. */
karst_pass *karst_pass_create(karst_context *context, karst_error *error);
void karst_pass_destroy(karst_pass *pass); /* NULL is fine */
/* Room for streams of so many rays; nothing is done where there is. Errors: KARST_FAILED. */
bool karst_pass_set_room(karst_pass *pass, uint32_t num_rays, karst_error *error);
/* What that takes. Thread-safe. */
double karst_pass_bytes(double num_rays);

/* What a picture's rays pass, and by what that is known; all of it borrowed. The shader is made with KARST_SHADE_PASS,
 * and its anchor is set. counters: as of karst_shade_rays. */
typedef struct {
    karst_pass *pass;
    karst_caster *land;
    karst_shader *shader;
    const karst_cast_view *view;
    const karst_pinhole *pinhole;
    const karst_light *light;
    karst_buffer *counters;
} karst_pass_picture;

/* Of a stream of as many rays as the word `count` holds, max_rays at most: rays that are inside land leave it, and from
 * there on look for land from air. Those that do not come out are idle, and have no light. Asynchronous. Errors of all:
 * KARST_FAILED. */
bool karst_pass_leave(const karst_pass_picture *picture, karst_buffer *rays, const karst_buffer *count,
                      uint32_t max_rays, karst_error *error);
/* The share that passes of the surfaces that the rays of a stream hit, a float for each ray; 0 where there is none.
 * by_haze: what lies before the surface takes its part of it. The pass's, until the next call. Asynchronous. */
const karst_buffer *karst_pass_find_shares(const karst_pass_picture *picture, const karst_buffer *rays,
                                           const karst_buffer *count, const karst_buffer *hits, uint32_t max_rays,
                                           bool by_haze, karst_error *error);
/* Rays to lamps, each with a lamp's light as its throughput: leaves what of it arrives, which is nothing where land
 * keeps all of it, or after KARST_PASS_MOST surfaces. Those with light keep a length above 0. Waits. */
#define KARST_PASS_MOST 16
bool karst_pass_to_lamps(const karst_pass_picture *picture, karst_buffer *rays, const karst_buffer *count,
                         uint32_t max_rays, karst_error *error);

/* Shadow rays that end, by their marks, and what the sun would have added: to the picture, or to what a stream sees.
 * suns: three planes of `stride` floats in the rays' order, from `first` on. */
typedef struct {
    const karst_buffer *shadow_rays, *marks, *suns;
    size_t first, stride;
    const karst_pinhole *pinhole; /* that the rays are laid out as */
    bool of_stream;
} karst_pass_dark;
/* Adds to the parts what of the sun comes through to them. Waits. */
bool karst_pass_sun(const karst_pass_picture *picture, const karst_pass_dark *dark, karst_buffer *parts,
                    karst_error *error);

#endif
