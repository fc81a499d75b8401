/* Rays inside clear matter whose index of refraction varies: in place of casting a stream straight.
 *
 * A path is followed by steps (raycast/light/bend.clh) as long as one chord can stand for it, to a quarter of a voxel;
 * the chord is cast into land and clear matter as any ray is, so that nothing that it meets is lost; and if it met
 * nothing, the path goes on. All rays of a stream do so together, in place. What they are left as are their last
 * stretches, with hits to which the stages that follow need not know that there was more. Where a path leaves clear
 * matter its steps have found the surface of the true density themselves, and its normal.
 *
 * Steps are as long as bounds of the cube around allow, so that each is off by a known share of its length at most.
 * What is approximate: where a chord meets land, or clear matter ends on a chord and not where the path's own steps
 * say, place and direction are right to the quarter of a voxel that chords are. A body of another index inside clear
 * matter may be lost where it is thinner than an eighth of a voxel along a path, a voxel being as wide as a pixel
 * there; or, where nothing bounds the index, than four. */
#ifndef KARST_RAYCAST_BEND_H
#define KARST_RAYCAST_BEND_H

#include "raycast/cast/cast.h"
#include "raycast/light/bend_shared.h"
#include "raycast/light/bounce.h"
#include "raycast/rays_shared.h"
#include "raycast/shade_shared.h"

typedef struct karst_bender karst_bender;

/* Clear matter and its index. */
typedef struct {
    /* Text as of karst_refine_world, of clear matter's density; and the same of the index as other_point and
     * other_surface; and world_ranges, bounds over any cube of the index, of its gradient per metre along each axis and
     * of clear matter. Borrowed during creation. */
    const char *source, *options;
    const karst_buffer *data, *index_data, *bound_data; /* borrowed for the bender's life */
    double voxel_m;                        /* of level 0 */
} karst_bend_world;

/* Errors: KARST_FAILED. */
karst_bender *karst_bender_create(karst_context *context, const karst_bend_world *world, float tolerance,
                                  karst_error *error);
void karst_bender_destroy(karst_bender *bender); /* NULL is fine */
/* Room for so many rays, each of which takes so much; nothing is done where there is. Errors: KARST_FAILED. */
#define KARST_BEND_RAY_BYTES (sizeof(karst_bend) + 2 * sizeof(karst_hit) + 2 * sizeof(uint32_t))
bool karst_bender_set_room(karst_bender *bender, uint32_t num_rays, karst_error *error);
/* Numbers of surfaces that the rays of the stream at hand have met, and of the next one's: a word each. */
karst_buffer *karst_bender_met(const karst_bender *bender);
karst_buffer *karst_bender_next_met(const karst_bender *bender);
void karst_bender_exchange(karst_bender *bender); /* the next stream is at hand */

/* A stream at hand; all borrowed for a call. */
typedef struct {
    const karst_cast_view *view;
    const karst_bounce_stream *stream;
    karst_buffer *ways, *over_hits, *counters;
    const karst_shade_anchor *anchor;
    uint32_t sample, branch, most_met;
    int x0_px, y0_px;
    /* Casts the rays as they are, into land and clear matter. */
    bool (*cast)(void *user, karst_error *error);
    void *user;
} karst_bend_stream;

/* Casts a stream by chords. Waits for the device, now and then. Errors: KARST_FAILED. */
bool karst_bend_cast(karst_bender *bender, const karst_bend_stream *stream, karst_error *error);
/* How often the index was below 1, or no number, since this was last asked; then where first, from the anchor, in
 * level-0 voxels. Waits for the device. Errors: KARST_FAILED. */
bool karst_bender_faults(karst_bender *bender, uint32_t *num, float place[3], karst_error *error);

#endif
