/* Openness, bounded: how much of what a surface looks up to is open at least, and at most, as bricks prove it.
 *
 * Openness is that of karst_occlusion_*: the share, by cosine, of directions in which rays from the surface meet
 * nothing, where rays' footprints begin as wide as a pixel (or the voxel that was hit) and grow by KARST_OCCLUSION_CONE
 * of their way, and do not blend levels (karst_cast_view.blend_below). So at each distance they see one level of the
 * land, the same one in all directions.
 *
 * Directions come in cells, which are cut up as long as it helps, and as the task allows. A cell is open where a chain
 * of balls around its middle ray, each as wide as the cell is there, leads to where the view ends, in all of which
 * there is air alone: nodes that are air, or bricks whose samples are farther from 0 than their slopes could make up
 * for (karst_brick_info.safe_cells). Near the surface there is no room for balls: there the gradient is bounded, and
 * rays are in air as long as the field falls along all of the cell's. A cell is hidden where at some distance there is
 * cells of matter alone in such a ball. Rays that the rest of the directions hold may end or not.
 *
 * What is missing is asked for, as rays do, and is taken as undecided. */
#ifndef KARST_RAYCAST_OPENNESS_H
#define KARST_RAYCAST_OPENNESS_H

#include "raycast/cast/cast.h"
#include "raycast/light/openness_shared.h"

typedef struct karst_openness karst_openness;

/* The buffers stay the cache's and must outlive it. Errors: KARST_FAILED. */
karst_openness *karst_openness_create(karst_context *context, const karst_cache_buffers *cache, karst_error *error);
void karst_openness_destroy(karst_openness *openness); /* NULL is fine */

/* Of the picture's hits. depth: of the finest cells, 0 to KARST_OPENNESS_DEPTH. bounds: two floats a pixel, in packet
 * order: the least and the most; 1 where nothing is hit. cells: what was found of each pixel's KARST_OPENNESS_CELLS, a
 * byte each, which nothing is written of where no surface is hit; or NULL. Asynchronous. Errors: KARST_FAILED. */
bool karst_openness_bound(karst_openness *openness, const karst_cast_view *view, const karst_pinhole *pinhole,
                          const karst_buffer *hits, float cone, int depth, karst_buffer *bounds, karst_buffer *cells,
                          karst_error *error);

#endif
