/* Refining: hits moved from the bricks' surface to that of the true density, with its exact gradient as normal.
 *
 * A brick's surface errs by what interpolation and 16 bits make of the density. At each hit the density itself is
 * evaluated, band-limited to the hit's level, with its gradient: two steps along the ray (Newton's, then the secant's)
 * find its zero. Where levels blend it is the two levels' densities, blended by the same weight. Where the steps do
 * not lead nearer (grazes, folds) the nearest change of sign within four voxels is bracketed and narrowed; from air
 * just behind matter it is the one before that matter. A hit that has none (a surface that only the brick has) stays as
 * it was. */
#ifndef KARST_RAYCAST_REFINE_H
#define KARST_RAYCAST_REFINE_H

#include "raycast/cast/cast.h"
#include "raycast/shade_shared.h"

typedef struct karst_refiner karst_refiner;

/* A world's true density. */
typedef struct {
    /* Text in the lane dialect that defines, with LANES lanes and the types of producers/steps/density.clh,
     *     vfloat world_point(world_data data, const world_point_at *place, int level);
     *     vfloat world_surface(world_data data, const world_point_at *place, int level, vfloat gradient[3]);
     * the density, and the same with its gradient per metre. Borrowed during creation. */
    const char *source;
    const char *options;      /* build options for it */
    const karst_buffer *data; /* borrowed for the refiner's life */
    double voxel_m;           /* of level 0 */
    /* The text also defines, of what layers (producers/layer.h) make of the density, from data of their own,
     *     vfloat layer_density(K_GLOBAL const ulong *layer, K_GLOBAL const ulong *beneath,
     *                          const world_point_at *place, int level, vfloat density);
     *     vfloat layer_surface(K_GLOBAL const ulong *layer, K_GLOBAL const ulong *beneath,
     *                          const world_point_at *place, int level, vfloat density, vfloat gradient[3]);
     * the density with the layers, the latter with its gradient in place of the density's. */
    bool has_layer;
    /* Of rays: matter may be thin, and its surface far within what bricks show of it. KARST_HIT_THIN says where. */
    bool may_be_thin;
} karst_refine_world;

/* Errors: KARST_FAILED. */
karst_refiner *karst_refiner_create(karst_context *context, const karst_refine_world *world, karst_error *error);
/* The same for rays that start anywhere, and leave matter as well as enter it (karst_ray.side). */
karst_refiner *karst_refiner_create_for_rays(karst_context *context, const karst_refine_world *world,
                                             karst_error *error);
void karst_refiner_destroy(karst_refiner *refiner); /* NULL is fine */

/* Of a refiner with layers: the data to read from now on, borrowed until the next call. `beneath` is those of a second
 * one, and may be NULL where the text reads `layer` alone. */
void karst_refiner_set_layer(karst_refiner *refiner, const karst_buffer *layer, const karst_buffer *beneath);

/* Refines the hits of a cast with this view and pinhole in place: t and the normal. Asynchronous on the context's
 * queue. Errors: KARST_FAILED (also: hits too small, or a layer without data). */
bool karst_refine_hits(karst_refiner *refiner, const karst_cast_view *view, const karst_pinhole *pinhole,
                       const karst_shade_anchor *anchor, karst_buffer *hits, karst_error *error);

/* With a refiner for rays: refines the hits of a stream, of as many as the word `count` holds (max_rays at most), or of
 * a camera's rays, which start in matter if is_inside: t and the normal. No levels are blended. Likewise. */
bool karst_refine_rays(karst_refiner *refiner, const karst_buffer *rays, const karst_buffer *count, uint32_t max_rays,
                       const karst_shade_anchor *anchor, karst_buffer *hits, karst_error *error);
bool karst_refine_camera(karst_refiner *refiner, const karst_pinhole *pinhole, bool is_inside,
                         const karst_shade_anchor *anchor, karst_buffer *hits, karst_error *error);

#endif
