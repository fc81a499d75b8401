/* Occlusion: how much of all that a surface looks up to is open, weighted by the cosine to its normal.
 *
 * There are 64 directions, spread over the sphere. Of every 32 pixels (8x4) one is a probe: it casts one cone, in one
 * direction, or away from it, if it would lead into its surface: a ray whose footprint grows by KARST_OCCLUSION_CONE of
 * its way, so that it goes through ever coarser bricks. Which direction follows from the probe's place: any 8x8 probes
 * have one each (interleaved sampling: A. Keller and W. Heidrich, 2001). At every second probe of every second row a
 * plane is fitted to what the cones of 15x15 probes around it found, over their directions, by least squares: level +
 * slope . direction. Cones of any few probes lie unevenly on the hemisphere, and their plain mean leans to where more
 * of them are; the fit does not. What a cone met counts in the direction in which the fit's own surface sees it: where
 * walls are as near as those probes are, that is another one. For a surface whose normal is n, the mean by cosine of
 * such a plane is level + 2/3 slope . n, so that rough land is as dark as it is turned away. A pixel takes that of the
 * four fits around it, as far as they are about as far from the eye.
 *
 * Cones begin some pixels wide, above the surface. What hides a pixel nearer than that is found in the picture itself
 * (raycast/light/occlusion_near.clh): in eight directions, how far other pixels' surfaces rise above its own plane.
 * Samples of a picture turn the sphere.
 *
 * Cones are rays as all others are: they start a little above the surface as those to the sun do, ask for what they
 * lack, and stamp what they use; a settled picture knows nothing of its history. Windows of a picture look at some
 * pixels more all around, and their probes are the whole picture's. */
#ifndef KARST_RAYCAST_OCCLUSION_H
#define KARST_RAYCAST_OCCLUSION_H

#include "raycast/cast/cast.h"
#include "raycast/light/occlusion_shared.h"

/* Growth of footprints per unit of t: as of the rays that full light scatters. Twice as much is hardly faster. */
#define KARST_OCCLUSION_CONE 0.0625f
/* As karst_cast_view.blend_below: cones pass a level on a brick's width, and do not blend. */
#define KARST_OCCLUSION_BLENDS_BELOW(detail) (0.5f * KARST_OCCLUSION_CONE * (detail))

typedef struct karst_occlusion karst_occlusion;

/* Errors: KARST_FAILED. */
karst_occlusion *karst_occlusion_create(karst_context *context, karst_error *error);
void karst_occlusion_destroy(karst_occlusion *occlusion); /* NULL is fine */
/* Room for pictures of that size; nothing is done where there is. has_window: they are windows, which have hits of
 * their own (karst_occlusion_hits). Errors: KARST_FAILED. */
bool karst_occlusion_set_room(karst_occlusion *occlusion, int width_px, int height_px, bool has_window,
                              karst_error *error);
/* What that takes. Thread-safe. */
double karst_occlusion_bytes(int width_px, int height_px, bool has_window);

/* Of windows: hits of what is looked at, which the caller casts. */
karst_buffer *karst_occlusion_hits(karst_occlusion *occlusion);
/* How open the picture's pixels are, 0 to 1, in packet order; 1 where nothing is hit. */
karst_buffer *karst_occlusion_open(karst_occlusion *occlusion);

/* Makes a cone for each probe of `seen`: the picture, or the window with what is around it, which begins at a probe.
 * hits: of its rays.
 * Asynchronous, as those that follow. Errors: KARST_FAILED. */
bool karst_occlusion_aim(karst_occlusion *occlusion, const karst_cast_view *view, const karst_pinhole *seen,
                         const karst_buffer *hits, karst_error *error);
/* Casts them. `again`: for what they ask for. */
bool karst_occlusion_cast(karst_occlusion *occlusion, karst_caster *caster, const karst_cast_view *view, bool again,
                          karst_error *error);
/* From cones to how open the picture's pixels are, which begin at (left_px, top_px) of what was looked at. hits: as of
 * karst_occlusion_aim. */
bool karst_occlusion_gather(karst_occlusion *occlusion, const karst_pinhole *picture, const karst_buffer *hits,
                            int left_px, int top_px, karst_error *error);
/* Cones of what was aimed last. */
uint32_t karst_occlusion_num_cones(const karst_occlusion *occlusion);

#endif
