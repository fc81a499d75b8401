/* Paths: light that goes from surface to surface, by chance, as it is (raycast/light/paths.clh has what happens at
 * surfaces).
 *
 * A sample of a picture is one path for each pixel. All paths go on together, a generation at a time: a stream of rays
 * is cast, shading makes of each hit one ray to a lamp and one that goes on, and those that do go on are packed without
 * gaps, in their order, by prefix sums. Random numbers follow from the pixel, the sample's number and the generation
 * alone. Where paths end is by chance, so that the mean of samples tends to what all orders of light add up to (J.
 * Kajiya, "The rendering equation", 1986; direct light as P. Shirley, C. Wang and K. Zimmerman, "Monte Carlo techniques
 * for direct lighting calculations", 1996). */
#ifndef KARST_RAYCAST_PATHS_H
#define KARST_RAYCAST_PATHS_H

#include "raycast/cast/cast.h"
#include "raycast/light/clear_paths.h"
#include "raycast/light/pass.h"
#include "raycast/light/path_starts.h"
#include "raycast/light/path_media.h"
#include "raycast/light/shade.h"

typedef struct karst_paths karst_paths;

/* clear: for pictures with clear matter that paths go through, too; media: with media. Errors: KARST_FAILED. */
karst_paths *karst_paths_create(karst_context *context, bool clear, bool media, karst_error *error);
void karst_paths_destroy(karst_paths *paths); /* NULL is fine */
/* Room for pictures of so many pixels. Errors: KARST_FAILED. */
bool karst_paths_set_room(karst_paths *paths, size_t num_pixels, karst_error *error);
/* Rays of a stream that there is room for then. Thread-safe. */
uint32_t karst_paths_room(size_t num_pixels);
/* What that takes. Thread-safe. */
double karst_paths_bytes(size_t num_pixels, bool clear, bool media);
/* What shines from now on, KARST_MOST_LAMPS at most: copied. Errors: KARST_FAILED. */
bool karst_paths_set_lamps(karst_paths *paths, const karst_lamp *lamps, uint32_t num, karst_error *error);

/* The picture that paths are of: what they are cast and shaded by, and where their light goes (three planes of parts,
 * raycast/light/radiance_shared.h). */
typedef struct {
    karst_caster *caster;
    karst_shader *shader;
    const karst_cast_view *view;
    const karst_pinhole *pinhole;
    const karst_light *light;
    const karst_buffer *hits; /* of the pinhole's rays */
    karst_buffer *parts, *counters;
    bool mirrors; /* surfaces do, if they say so */
    karst_caster *over; /* of clear matter that hides lamps, as land does; NULL: none does */
    karst_pass_picture pass; /* land lets light pass; its pass NULL: nothing does */
    const karst_path_clear *clear; /* that paths go through (shader and paths are made for it); NULL: none */
    const karst_path_media *media; /* that they may collide with (paths are made for it), or that dims
                                    * lamps; NULL: none */
    bool again;   /* for stamps and wishes alone: parts and counters stay as they are */
    bool only_lacking; /* of pixels alone whose paths lacked something, in this sample of this picture: with `again`,
                        * when they were last followed; else since they were last drawn, and the parts of others stay,
                        * as do the counters of the first surfaces. Where there are media: of all. */
    /* Paths start at what the hits are on, and what falls there is the light, but that of lamps: the pinhole's sample
     * is that of the paths, and the hits are of the pixels' centres. NULL: they start at the eye. */
    karst_path_starts *starts;
} karst_path_picture;

/* Follows one path for each pixel, sample max(1, pinhole->sample), beyond at most max_bounces surfaces and collisions
 * with media, and overwrites
 * the parts with its light. counters as karst_shade_paths; rays that go on are added to counters[5], those from clear
 * matter also to KARST_CLEAR_COUNT_RAYS. Waits now and then for how many do. Errors: KARST_FAILED. */
bool karst_paths_follow(karst_paths *paths, const karst_path_picture *picture, uint32_t max_bounces,
                        karst_error *error);

/* Adds to the parts, which shading has written, what each lamp does to surfaces, one after the other: to those of the
 * picture; or of a stream, whose rays are of no more than its pixels, each times its throughput. Asynchronous. Errors:
 * KARST_FAILED. */
bool karst_paths_add_lamps(karst_paths *paths, const karst_path_picture *picture, karst_error *error);
bool karst_paths_add_lamps_of(karst_paths *paths, const karst_path_picture *picture, const karst_buffer *rays,
                              const karst_buffer *count, const karst_buffer *hits, karst_error *error);

/* A stream of rays that start in the surfaces of another's hits, along their normals, each with the share of what light
 * falls there that reaches its pixel; idle where nothing was hit. Surfaces count as ones that do not mirror, and rays
 * are those of the picture if `rays` is NULL. The buffers are the paths', until lamps are added or paths are followed.
 * Asynchronous. Errors: KARST_FAILED. */
typedef struct {
    const karst_buffer *rays, *count;
    uint32_t max_rays;
} karst_path_stream;
bool karst_paths_look_along_normals(karst_paths *paths, const karst_path_picture *picture, const karst_buffer *rays,
                                    const karst_buffer *count, const karst_buffer *hits, karst_path_stream *stream,
                                    karst_error *error);

#endif
