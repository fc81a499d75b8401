/* Paths through clear matter: what raycast/light/paths.h follows where a world has some.
 *
 * Each generation is cast into clear matter, too, and the nearer hit counts. One that is clear scatters nothing: the
 * path is reflected as often as Fresnel's equations say, else refracted, and nothing is lost at it. On its way inside
 * a path loses what Beer's and Lambert's law says; where the index varies, it is followed by chords
 * (raycast/light/bend.h).
 *
 * Rays to lamps end at clear matter: light that comes through it does so turned. So a path that has met clear matter
 * since it was scattered last, and only such a one, sees lamps itself: the disc of a sun, the ball of a point or a
 * spot, as bright as they are. Each way from a surface to a lamp is then found in one manner, and none twice. A lamp
 * without shadows shines through all matter, and is found by rays to it alone; one without a size is found by no path.
 *
 * What leaves clear matter is as bright as it was inside: the square of the index by which light is packed more closely
 * there is left out on both ways, as it is in direct light. */
#ifndef KARST_RAYCAST_CLEAR_PATHS_H
#define KARST_RAYCAST_CLEAR_PATHS_H

#include "raycast/light/clear.h"
#include "raycast/light/clear_paths_shared.h"
#include "raycast/light/path_media.h"

typedef struct karst_clear_paths karst_clear_paths;

/* Errors: KARST_FAILED. */
karst_clear_paths *karst_clear_paths_create(karst_context *context, karst_error *error);
void karst_clear_paths_destroy(karst_clear_paths *paths); /* NULL is fine */
/* Room for so many rays; and what each takes. Errors: KARST_FAILED. */
bool karst_clear_paths_set_room(karst_clear_paths *paths, uint32_t num_rays, karst_error *error);
size_t karst_clear_paths_ray_bytes(void);

/* Clear matter that paths go through; all of it borrowed for a call. */
typedef struct {
    karst_caster *caster;
    karst_clear_shader *shader; /* its anchor is set: */
    karst_shade_anchor anchor;
    karst_refiner *refiner; /* for rays; NULL: surfaces are as bricks have them */
    karst_bender *bender;   /* with a shader that bends; else NULL */
    bool is_inside;         /* the eye is in it */
    float absorption_per_m[3]; /* there */
    double voxel_m;
} karst_path_clear;

/* A generation of paths. */
typedef struct {
    const karst_path_clear *clear;
    karst_caster *land;
    const karst_cast_view *view;
    const karst_pinhole *pinhole;
    karst_buffer *rays, *count; /* at most max_rays, which the word says */
    karst_buffer *hits;         /* where the paths' hits go */
    const karst_buffer *lamps;
    karst_buffer *parts, *counters;
    uint32_t max_rays, max_bounces;
    karst_clear_path_task task;
    const karst_path_media *media; /* NULL: none. What to_media lacks of hits and ways is filled in */
    karst_path_media_stream *to_media;
} karst_clear_path_stream;
/* The task of a picture's first generation; num_lamps and the flags are the caller's to set. */
karst_clear_path_task karst_clear_paths_task(const karst_path_clear *clear, const karst_cast_view *view,
                                             const karst_pinhole *pinhole);

/* The camera's rays begin where the eye is. Asynchronous, as all that follow but where the index varies; errors of
 * all: KARST_FAILED. */
bool karst_clear_paths_begin(karst_clear_paths *paths, const karst_clear_path_stream *stream, karst_error *error);
/* Casts a generation, into land only if its hits there (land_hits) are not given, which must be unless it comes from
 * karst_clear_paths_go_on; and leaves in stream->hits the nearer ones, those of clear matter with
 * KARST_PATH_HIT_CLEAR. Rays have what is left of their light there. Adds to the parts what paths see of lamps. */
bool karst_clear_paths_cast(karst_clear_paths *paths, const karst_clear_path_stream *stream,
                            const karst_buffer *land_hits, karst_error *error);
/* After karst_shade_paths: rays that go on from clear matter, or in it, get their ways; rays to lamps that it hides
 * bring no light. */
bool karst_clear_paths_go_on(karst_clear_paths *paths, const karst_clear_path_stream *stream, karst_buffer *next,
                             karst_buffer *to_lamps, karst_error *error);
/* Moves `next` to stream->rays without gaps, as `begins` (where each of num_blocks blocks of block_rays begins) has it.
 */
bool karst_clear_paths_pack(karst_clear_paths *paths, const karst_clear_path_stream *stream, const karst_buffer *next,
                            const karst_buffer *begins, uint32_t num_blocks, karst_error *error);

#endif
