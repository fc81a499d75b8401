/* Media from inside: what its files have in common. */
#ifndef KARST_RAYCAST_MEDIA_INTERNAL_H
#define KARST_RAYCAST_MEDIA_INTERNAL_H

#include "raycast/media/media.h"

typedef struct karst_fluence karst_fluence; /* raycast/media/fluence.h */

struct karst_media {
    karst_context *context;
    karst_media_config config;
    karst_cache_buffers air, land;
    karst_program *marching, *lighting;
    cl_kernel rays, look, sun, pixels, stream, add_lamps, meet, turn, dim;
    cl_mem data;
    karst_buffer *view, *asked, *counters, *grids, *states, *used;
    karst_buffer *lamps; /* NULL without */
    karst_fluence *fluence; /* likewise */
    karst_buffer *looks, *chosen; /* of groups alone: packets that looked at a slot; as `used`, what is made */
    karst_cast_view sent; /* what the queued write reads */
    float direction[3];
    uint32_t sun_number; /* counts places of the sun, from 1 */
};

/* The pools, in the order of POOL_PARAMETERS (raycast/cast/pools.clh). */
#define POOL_ARGUMENTS(c, asked)                                                                                    \
    KARST_BUFFER_ARG((c).nodes), KARST_BUFFER_ARG((c).brick_info), KARST_BUFFER_ARG((c).bricks[0]),                 \
        KARST_BUFFER_ARG((c).bricks[1]), KARST_BUFFER_ARG((c).bricks[2]), KARST_BUFFER_ARG((c).bricks[3]),          \
        KARST_BUFFER_ARG((c).bricks[4]), KARST_BUFFER_ARG((c).bricks[5]), KARST_BUFFER_ARG((c).bricks[6]),          \
        KARST_BUFFER_ARG((c).bricks[7]), KARST_VALUE_ARG((c).bricks_per_segment), KARST_BUFFER_ARG((c).tile_stamp), \
        KARST_BUFFER_ARG((c).brick_stamp), KARST_BUFFER_ARG((c).brick_fallback), KARST_BUFFER_ARG((c).want_brick),  \
        KARST_BUFFER_ARG((c).want_children), KARST_BUFFER_ARG((c).want_chunk), KARST_BUFFER_ARG((c).want_rays),     \
        KARST_BUFFER_ARG((c).tile_info), KARST_BUFFER_ARG(asked)

/* media_light.c: the kernel of karst_media_pixels. Does nothing where nothing is shaded. */
bool karst_media_build_light(karst_media *media, uint32_t segments, karst_error *error);
/* media_paths.c: the kernels for paths. */
bool karst_media_build_paths(karst_media *media, uint32_t segments, karst_error *error);
/* media_groups.c. Which of the bricks that were looked at with `serial` have their grids made: as media->chosen. Waits.
 * Errors: KARST_FAILED. */
bool karst_media_choose(karst_media *media, uint32_t serial, karst_error *error);
/* media_launch.c */
bool karst_media_has_fluence(const karst_media *media);
/* What is scattered once is found along rays: of what comes more often nothing is told by octaves. */
bool karst_media_scatters_once(const karst_media *media);
bool karst_media_send_view(karst_media *media, const karst_cast_view *view, karst_error *error);
karst_media_task karst_media_task_of(const karst_media *media, float metres, float detail, float most_depth);
karst_shade_anchor karst_media_anchor(const karst_position *position);
/* A work-item for `beam` packets of a picture, or for each of its rays where kernels have one lane. */
bool karst_media_launch_picture(karst_media *media, cl_kernel kernel, const karst_pinhole *pinhole, uint32_t beam,
                                karst_error *error);

#endif
