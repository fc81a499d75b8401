/* Discs in pictures: a second caster of the streams that land is cast for. Whatever a caster with discs casts, discs
 * hide: hits become KARST_HIT_SPLAT where a disc is nearer, marks and dark pixels are set where one is met.
 *
 * A ray takes the discs of each node that are no farther apart than what it asks for there, so models cost the same
 * from near and from afar. KARST_SIDE_FRONT and KARST_SIDE_BACK meet that side of a disc alone; KARST_SIDE_ANY meets
 * fronts, and backs where a model says so, whose normal is then turned towards it. Rays that have to leave a surface
 * (karst_ray.rise) are stopped by both; by a disc that is no wall to them not before they have risen by its radius. So
 * nothing meets what it starts on, and no distance is chosen for that.
 *
 * Whatever is cast has the same bits with 1 lane and 16, and at any distance from the origin. Nothing is asked for:
 * all discs are there from the start. */
#ifndef KARST_RAYCAST_SPLATS_H
#define KARST_RAYCAST_SPLATS_H

#include "core/points/splat_shared.h"
#include "raycast/cast/cast.h"

/* Where a model stands: a voxel's place v becomes (matrix (v - at) + offset) / 2^shift units. */
typedef struct {
    int64_t at[3], matrix[9], offset[3];
    int shift;
} karst_splat_place;

/* Of a block as core/points/splat_shared.h has it, which is copied to the device, and where its models stand. Errors:
 * KARST_FAILED. */
karst_splats *karst_splats_create(karst_context *context, const uint64_t *data, size_t size_bytes,
                                  const karst_splat_place *places, uint32_t num_models, karst_error *error);
void karst_splats_destroy(karst_splats *splats); /* NULL is fine */

/* After land was cast with the same arguments, as casters do it: see karst_cast_pinhole, karst_cast_stream (count NULL:
 * num_rays) and karst_cast_shadows; the sun is as kernels take it. Asynchronous. Errors: KARST_FAILED. */
bool karst_splats_pinhole(karst_splats *splats, const karst_cast_view *view, const karst_pinhole *pinhole,
                          const karst_buffer *hits, karst_error *error);
bool karst_splats_rays(karst_splats *splats, const karst_cast_view *view, const karst_buffer *rays, uint32_t num_rays,
                       cl_mem count, uint32_t wanted, const karst_buffer *hits, karst_error *error);
bool karst_splats_shadows(karst_splats *splats, const karst_cast_view *view, const karst_shadow_sun *sun,
                          const karst_buffer *rays, cl_mem pixels, karst_error *error);

#endif
