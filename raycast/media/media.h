/* What fills the space outside matter, seen along rays: a store of extinction (cache/cache.h) whose bricks are built
 * with KARST_MEDIUM_OPTION (producers/steps/medium.h).
 *
 * Optical depth is exact for the samples that there are. Light that is scattered once is summed segment by segment by
 * the phase function of Henyey and Greenstein ("Diffuse radiation in the galaxy", 1941), with the depth towards the sun
 * of grids beside bricks; what is scattered more often is told by three octaves of it, after Wrenninge, Kulla and
 * Lundqvist ("Oz: the great and volumetric", 2013), by paths, one a sample (scatter.clh), or by a coarse grid of what
 * goes to and fro in the medium (fluence.h). Not thread-safe. */
#ifndef KARST_RAYCAST_MEDIA_H
#define KARST_RAYCAST_MEDIA_H

#include "cache/cache.h"
#include "karst/engine.h"
#include "raycast/cast/cast.h"
#include "raycast/light/shade.h"
#include "raycast/light/path_media.h"
#include "raycast/light/paths_shared.h"
#include "raycast/media/media_shared.h"

typedef struct karst_media karst_media;

/* Rays end where they came through more than this: what is behind is at most 1/4096 of what is seen. */
#define KARST_MEDIA_MOST_DEPTH 8.3178f

typedef struct {
    const karst_cache_buffers *air;  /* the store's; borrowed */
    const karst_cache_buffers *land; /* NULL: no land shadows media. Its samples have as many bits */
    uint32_t mode;                   /* KARST_MEDIA_BASIC and so on */
    karst_scattering scattering;
    bool has_atmosphere;             /* what is before media is as KARST_SHADE_ATMOSPHERE has it */
    bool glows;       /* the look has emission */
    bool has_phase;   /* the look has g */
    bool has_lamps;   /* karst_media_add_lamps is wanted */
    bool has_streams; /* karst_media_stream_rays is wanted, and hits of clear matter */
    bool has_paths;   /* karst_media_meet_paths and karst_media_turn_paths are wanted, and nothing else that shades */
    bool passes;      /* of pictures whose land lets light pass: parts have a plane of shares for that */
    bool is_alone; /* pictures show media alone, lit by the sun alone, before a wall that glows as the sky's zenith */
    karst_shade_colour look; /* the air's albedo, g and emission, as colour, mirror and emission; source NULL: nothing
                              * is shaded, and only depths are asked for */
    uint32_t fluence_packets; /* of light, that are followed for KARST_SCATTERING_FLUENCE; 0: a million */
    uint32_t groups;         /* 2 or more: when the sun or content moves, a picture makes this part of the grids anew,
                              * the oldest first and of these the most looked at; 0, 1: all of them */
} karst_media_config;

/* Errors: KARST_FAILED. */
karst_media *karst_media_create(karst_context *context, const karst_media_config *config, karst_error *error);
void karst_media_destroy(karst_media *media); /* NULL is fine */

/* Device memory that grids take for each brick of the store. */
#define KARST_MEDIA_BRICK_BYTES (KARST_SUN_DEPTH_PLACES * 4 + 16)

/* Optical depths of rays (karst_ray) of a stream, which is anchored as `view` says, into `depths` (floats). metres: in
 * a level-0 voxel; extinction is per metre. Level l is asked for where footprint * view->detail is 2^l or more. Stamps
 * and wants are the store's. *num_missing: rays that met what is not there yet, whose depth is what is known. Waits.
 * Errors: KARST_FAILED. */
bool karst_media_depths(karst_media *media, const karst_cast_view *view, const karst_buffer *rays, uint32_t num_rays,
                        float metres, karst_buffer *depths, uint32_t *num_missing, karst_error *error);

/* The sun is there: grids of other places are made anew. */
void karst_media_aim(karst_media *media, const float direction[3]);

/* A sample of a picture as shading left it (karst_shade_pixels). All is borrowed during the calls. */
typedef struct {
    const karst_cast_view *view;
    const karst_pinhole *pinhole;
    const karst_light *light;
    const karst_position *anchor;
    karst_skies *skies;  /* of an atmosphere */
    float metres, detail; /* in a level-0 voxel; voxels of media may be so many times as wide as the view's */
    const karst_buffer *hits;
    karst_buffer *parts;
    bool has_sun, has_mirror; /* which planes its parts have */
    const karst_buffer *over_hits; /* of clear matter, which may lie before those; NULL: there is none */
    float absorption[3];           /* of what the eye is in, per level-0 voxel */
    bool makes_all;           /* without groups, as nobody watches */
    float coarser; /* voxels that the pools hold are so many times as wide as is asked for: so are those of fluence */
} karst_media_picture;

/* Before the next: goes on with what KARST_SCATTERING_FLUENCE needs for it, and does nothing for others. What lacks
 * counts in karst_media_take_counts. Waits. Errors: KARST_FAILED. */
bool karst_media_find_fluence(karst_media *media, const karst_media_picture *picture, karst_error *error);
/* Lays media before the sample. Asynchronous. Errors: KARST_FAILED. */
bool karst_media_pixels(karst_media *media, const karst_media_picture *picture, karst_error *error);
/* After karst_media_pixels, with has_lamps: adds what media scatter once of the light of these lamps, suns, points and
 * spots, KARST_MOST_LAMPS at most, whose places are from the picture's anchor. What is between them is looked for from
 * one place of each pixel's ray a sample. Errors: KARST_FAILED. */
bool karst_media_add_lamps(karst_media *media, const karst_media_picture *picture, const karst_lamp *lamps,
                           uint32_t num, karst_error *error);
/* Between casting and shading a stream of next rays: lays media before what they see, which shading then weakens by as
 * much. hits: where they end on land; over_hits: on clear matter (NULL: there is none); ways: karst_clear_way (NULL:
 * no ray is in clear matter); max_rays: as many as the word `count` holds, or more. adds false: rays ask for what they
 * look at, and nothing else changes. With has_streams alone; else nothing is done. Asynchronous. Errors:
 * KARST_FAILED. */
typedef struct {
    karst_buffer *rays;
    const karst_buffer *count, *hits, *over_hits, *ways;
    uint32_t max_rays;
    bool adds;
} karst_media_stream;
bool karst_media_stream_rays(karst_media *media, const karst_media_picture *picture, const karst_media_stream *stream,
                             karst_error *error);
/* Rays to lamps (as many as the word says, max_rays at most) lose what media take of their throughput. Asynchronous.
 * Errors: KARST_FAILED. */
bool karst_media_dim(karst_media *media, const karst_media_picture *picture, karst_buffer *rays,
                     const karst_buffer *count, uint32_t max_rays, karst_error *error);
/* For paths, with has_paths, as raycast/light/path_media.h has it: in bricks collisions are found by delta tracking
 * (raycast/media/track.clh). Rays that lacked something are counted unless the stream is for wishes alone.
 * Asynchronous. Errors: KARST_FAILED. */
bool karst_media_meet_paths(karst_media *media, const karst_media_picture *picture,
                            const karst_path_media_stream *stream, karst_error *error);
bool karst_media_turn_paths(karst_media *media, const karst_media_picture *picture,
                            const karst_path_media_stream *stream, karst_error *error);
/* The pixels' rays ask for what the same would, with nothing drawn: light and parts may be missing. What they look at
 * counts as used, for karst_media_survey_sun. */
bool karst_media_look(karst_media *media, const karst_media_picture *picture, karst_error *error);
/* After karst_media_pixels: makes the grids of the bricks that were used and have none, or one that lacked something.
 * Stamps and wants are the store's, and the land's. Asynchronous. Errors: KARST_FAILED. */
bool karst_media_survey_sun(karst_media *media, const karst_media_picture *picture, karst_error *error);
/* What the last two found: rays that lacked something, and grids that were made. Waits. A picture is whole once both
 * are 0. Errors: KARST_FAILED. */
bool karst_media_take_counts(karst_media *media, uint32_t *num_lacking, uint32_t *num_made, karst_error *error);
/* Content moves: grids are of an earlier time, and count until they are made anew. */
void karst_media_age(karst_media *media);
/* What is known of the sun is forgotten, as content changed. Errors: KARST_FAILED. */
bool karst_media_forget(karst_media *media, karst_error *error);

#endif
