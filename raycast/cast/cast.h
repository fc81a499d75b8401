/* Casting: streams of rays through the pools into hit records.
 *
 * A hit depends on the ray, on the integer cell and on its eight samples; not on what else lies in the pools, on the
 * packet a ray travels in, nor on LANES. */
#ifndef KARST_RAYCAST_CAST_H
#define KARST_RAYCAST_CAST_H

#include "cache/cache.h"
#include "raycast/cast/cast_shared.h"
#include "raycast/rays_shared.h"
#include "raycast/shade_shared.h"
#include "raycast/shadow_shared.h"
#include "raycast/cast/sunward.h"

/* The last part of each level in which it turns into the next one, unless a view is to do without: at one pixel a
 * voxel, some 65 voxels of 1000 from the camera. Many frames of walking and some of flying, while few rays look at two
 * levels (an eighth was measured to cost 6 to 9 % of a settled frame, and 7 % of what it takes of the pools). */
#define KARST_BLEND_SHARE 0.0625f

typedef struct karst_caster karst_caster;
typedef struct karst_splats karst_splats; /* raycast/cast/splats.h */

/* Builds the cast kernels for the context's lanes. The buffers stay the cache's and must outlive the caster. Errors:
 * KARST_FAILED. */
karst_caster *karst_caster_create(karst_context *context, const karst_cache_buffers *cache, karst_error *error);
/* An option for the latter: each packet of rays walks the tree by itself, not in a beam of packets. Slower, and the
 * same in every bit. */
#define KARST_CAST_NO_BEAM "-DCAST_NO_BEAM"
/* Leave out what karst_cast_rays or karst_cast_shadows take, which then fail: there is less to compile. */
#define KARST_CAST_NO_STREAMS "-DCAST_NO_STREAMS"
#define KARST_CAST_NO_SHADOWS "-DCAST_NO_SHADOWS"
/* An option for karst_cast_rays_from_anchor, which fails without it. */
#define KARST_CAST_FROM_ANCHOR "-DCAST_FROM_ANCHOR"
/* Shadow rays of a picture's samples (karst_pinhole.sample) go to different places on the sun, not to its centre: what
 * is known of bricks towards the sun does not help then. */
#define KARST_CAST_SUN_DISC "-DCAST_SUN_DISC"
/* And one with a factor (printf's %g) on the steps that slopes prove to be safe: 0 for none. */
#define KARST_CAST_SAFE_STEPS "-DKARST_SAFE_STEP_FACTOR=((float)%g)"
/* The same with further build options (tests and measurements), such as "-DKARST_SAFE_STEP_SHARE=0.5f". */
karst_caster *karst_caster_create_with(karst_context *context, const karst_cache_buffers *cache, const char *options,
                                       karst_error *error);
void karst_caster_destroy(karst_caster *caster); /* NULL is fine */

/* Rays that are sure. Where something is missing rays march what stands in for it: they may end elsewhere than they
 * will once it is there, or go on, and stamp and want what nobody needs then. With view->ends_at_missing they end
 * there, and all that they stamp and want is part of what the picture needs, in whatever state the pools are. */

/* Localises an anchor against the root tile (child 0 = node `root_corner` of `top_level`), exactly, on the host.
 * finest_level 0; serial and detail are the caller's to fill. */
void karst_cast_view_init(karst_cast_view *view, const karst_position *anchor, const int64_t root_corner[3],
                          int top_level);

/* Casts all rays; writes one karst_hit for each (at karst_packet_order(x, y, width, height)) and the stamps; the latter
 * alone, for less, where hits is NULL. Asynchronous on the context's queue; the view and the pinhole are copied.
 * Errors: KARST_FAILED (also: hits too small). */
bool karst_cast_pinhole(karst_caster *caster, const karst_cast_view *view, const karst_pinhole *pinhole,
                        karst_buffer *hits, karst_error *error);
/* The same, noting in `asked` which parts of the picture asked for anything; and in `hints` what its rays read, which
 * is prefetched when a picture of that size is cast again with them (NULL: nothing is). Nothing but time depends on
 * what they hold. */
bool karst_cast_picture(karst_caster *caster, const karst_cast_view *view, const karst_pinhole *pinhole,
                        karst_buffer *hits, karst_buffer *asked, karst_buffer *hints, karst_error *error);
/* Casts the parts once more that asked for anything when that picture, or this, was cast last: with the same view,
 * serial included, and pinhole; no hits are written. Where nothing was evicted since, the others would ask for nothing
 * now. */
bool karst_cast_again(karst_caster *caster, const karst_cast_view *view, const karst_pinhole *pinhole,
                      karst_buffer *asked, karst_error *error);
/* What `asked` takes; zeros at first. Thread-safe. */
size_t karst_cast_asked_bytes(const karst_context *context, int width_px, int height_px);
/* What `hints` take; zeros at first. 0: such a device, or such bricks, have no use for them. Thread-safe. */
size_t karst_cast_hint_bytes(const karst_context *context, const karst_cache_buffers *cache, int width_px,
                             int height_px);
/* The same as karst_cast_pinhole for a buffer of karst_ray. any_hit: t and position may stop at the entry of the
 * surface's cell. Neighbours in the buffer travel together. */
bool karst_cast_rays(karst_caster *caster, const karst_cast_view *view, karst_buffer *rays, uint32_t num_rays,
                     bool any_hit, karst_buffer *hits, karst_error *error);
/* The same of rays that all start at the anchor, with one footprint and t_min, and without a side: as fast as a
 * picture's. */
bool karst_cast_rays_from_anchor(karst_caster *caster, const karst_cast_view *view, const karst_buffer *rays,
                                 uint32_t num_rays, karst_buffer *hits, karst_error *error);
/* The same as karst_cast_rays of as many rays as the device knows: the word `count` holds, num_rays at most. hits NULL:
 * the stamps alone. */
bool karst_cast_stream(karst_caster *caster, const karst_cast_view *view, const karst_buffer *rays, uint32_t num_rays,
                       const karst_buffer *count, karst_buffer *hits, karst_error *error);
/* The same, if all that is wanted is whether rays end: a word for each, not 0 where it does. marks NULL: as above. */
bool karst_cast_stream_marks(karst_caster *caster, const karst_cast_view *view, const karst_buffer *rays,
                             uint32_t num_rays, const karst_buffer *count, karst_buffer *marks, karst_error *error);

/* Where they go (of_stream: as of karst_cast_stream_shadows), for who follows them further. Thread-safe. */
karst_shadow_sun karst_cast_shadow_sun(const karst_caster *caster, const karst_pinhole *pinhole,
                                       const karst_light *light, bool of_stream);
/* What a picture's shadow rays take (raycast/shadow_shared.h). Thread-safe. */
size_t karst_cast_shadow_bytes(int width_px, int height_px);
/* Errors: KARST_FAILED if the buffer is too small for them. */
bool karst_cast_check_shadow_rays(const karst_buffer *rays, const karst_pinhole *pinhole, karst_error *error);
/* From now on shadow rays look at bricks by these records while they are aimed at the light's sun: faster, and the same
 * but for rays that touch a surface within the rounding of floats. They are of all bricks of the caster's pools, and
 * outlive the caster; NULL: none. */
void karst_caster_set_sunward(karst_caster *caster, const karst_sunward *sunward);
/* From now on all that is cast with hits, marks or pixels to write meets these discs, too (raycast/cast/splats.h).
 * Borrowed; NULL: none. */
void karst_caster_set_splats(karst_caster *caster, karst_splats *splats);
/* From now on rays of streams, each of pixel (KARST_RAY_X, KARST_RAY_Y) of a picture, set bit 0 of the word that this
 * pixel has in packet order if they, or neighbours that are cast with them, want something that is missing. Borrowed;
 * NULL: none. */
void karst_caster_note_lacking(karst_caster *caster, const karst_buffer *lacking, int width_px, int height_px);
/* Casts the shadow rays that karst_shade_pixels made with the same view, pinhole and light, and writes the pixels whose
 * rays end before the sun; stamps as other casts do. Asynchronous likewise. Errors: KARST_FAILED. */
bool karst_cast_shadows(karst_caster *caster, const karst_cast_view *view, const karst_pinhole *pinhole,
                        const karst_light *light, const karst_buffer *rays, cl_mem pixels, karst_error *error);
/* The same of a stream's: the pinhole is as high as there may be rays of it, and KARST_STREAM_WIDTH_PX wide. */
#define KARST_STREAM_WIDTH_PX (KARST_GROUP_SIDE * KARST_BEAM_ACROSS)
bool karst_cast_stream_shadows(karst_caster *caster, const karst_cast_view *view, const karst_pinhole *pinhole,
                               const karst_light *light, const karst_buffer *rays, cl_mem marks, karst_error *error);
/* The same, noting in an `asked` and `hints` of its own as karst_cast_picture does; and once more those that asked for
 * anything, as karst_cast_again, which leaves pixels alone, as NULL does in both. */
bool karst_cast_picture_shadows(karst_caster *caster, const karst_cast_view *view, const karst_pinhole *pinhole,
                                const karst_light *light, const karst_buffer *rays, cl_mem pixels,
                                karst_buffer *asked, karst_buffer *hints, karst_error *error);
bool karst_cast_shadows_again(karst_caster *caster, const karst_cast_view *view, const karst_pinhole *pinhole,
                              const karst_light *light, const karst_buffer *rays, karst_buffer *asked,
                              karst_error *error);

/* Looks at the bricks of slots first to end - 1 (end may lie beyond the pool) that were written since they were looked
 * at last: how steep they are along each axis (karst_brick_info.slopes), by which the camera's rays skip more of them.
 * What casts give does not depend on it. On a CPU it takes a microsecond a brick, and pays off after some dozens of
 * pictures. Asynchronous. Errors: KARST_FAILED. */
bool karst_caster_survey_slopes(karst_caster *caster, uint32_t first, uint32_t end, karst_error *error);

#endif
