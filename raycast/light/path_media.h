/* What fills the space that paths go through, as raycast/light/paths.h asks for it: who knows media
 * (raycast/media/media_paths.c) answers.
 *
 * A path may collide before it comes to a surface. Then it is there as at one: what surfaces make of it is nothing, one
 * ray goes from there to a lamp, and one goes on. */
#ifndef KARST_RAYCAST_PATH_MEDIA_H
#define KARST_RAYCAST_PATH_MEDIA_H

#include "core/device/context.h"
#include "raycast/light/paths_shared.h"

/* Errors of the functions: KARST_FAILED. */
typedef struct karst_path_media_stream {
    karst_buffer *rays;
    const karst_buffer *count; /* as many as the word says, max_rays at most */
    uint32_t max_rays;
    const karst_buffer *hits;      /* where they end on land; */
    const karst_buffer *over_hits; /* on clear matter; NULL: there is none; */
    const karst_buffer *ways;      /* and what of it they are in (karst_clear_way): with over_hits */
    karst_buffer *collisions;      /* a karst_path_collision for each ray */
    karst_buffer *next, *to_lamps; /* rays that go on; and those to lamps */
    const karst_buffer *lamps;
    karst_buffer *parts; /* where light goes */
    karst_path_task task;
} karst_path_media_stream;

typedef struct {
    /* Before shading: finds the rays that collide, and adds what media give off before. With over_hits whoever merges
     * the hits takes these rays' throughput from them; without it is done here. */
    bool (*meet)(void *user, const karst_path_media_stream *stream, karst_error *error);
    /* After shading: rays that collided go on from there, and look for lamps; rays to lamps, all of them, lose what
     * media take. */
    bool (*turn)(void *user, const karst_path_media_stream *stream, karst_error *error);
    /* Where paths are not followed: rays to lamps lose what media take. */
    bool (*dim)(void *user, karst_buffer *rays, const karst_buffer *count, uint32_t max_rays, karst_error *error);
    void *user;
} karst_path_media;

#endif
