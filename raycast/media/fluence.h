/* Light that media scatter more than once, on its way through a coarse grid: KARST_SCATTERING_FLUENCE.
 *
 * The box around all of a medium that a view may see is cut into cells, as small as their number allows, and these are
 * filled from bricks: with the mean extinction, and what the medium looks like. Packets of light then enter the box,
 * from the sun and from all around, and are followed by delta tracking from collision to collision until they leave.
 * Where a packet has been scattered before, what it carries adds to its cell's fluence, which is so an unbiased
 * estimate of the cell's mean. Rays that march add it to what is scattered once, which is theirs to find.
 *
 * As for paths (raycast/media/scatter.clh) land hides the sun and stands in no packet's way, what of the medium lies in
 * land counts as none, and light that comes from below is what the ground throws back.
 *
 * Where the medium goes on as far as a view does cells are wide, and what of it is near has a grid of its own, an
 * eighth as far. Its packets are aimed at it, and come to it through the other one's cells.
 *
 * What is found depends on the medium, on the light, and on where the eye is, in steps of an eighth of what a grid
 * reaches. While it is traced anew the last one is shown. */
#ifndef KARST_RAYCAST_MEDIA_FLUENCE_H
#define KARST_RAYCAST_MEDIA_FLUENCE_H

#include "raycast/media/fluence_shared.h"
#include "raycast/media/media_internal.h"

/* Packets that are followed for a grid, unless the configuration says, and in a frame that somebody watches. */
#define KARST_FLUENCE_PACKETS (1u << 20)
#define KARST_FLUENCE_FRAME_PACKETS (1u << 14)

/* `media` has its programs' options, and outlives it. Errors: KARST_FAILED. */
karst_fluence *karst_fluence_create(karst_media *media, karst_error *error);
void karst_fluence_destroy(karst_fluence *fluence); /* NULL is fine */
/* The medium has changed: at once (what was traced is of no more use), or as it moves. */
void karst_fluence_change(karst_fluence *fluence, bool at_once);
/* Before a picture is drawn: goes on with what is to be found for it; to the end, with picture->makes_all, or until
 * bricks lack, which are asked for. Waits. Errors: KARST_FAILED. */
bool karst_fluence_advance(karst_fluence *fluence, const karst_media_picture *picture, karst_error *error);
/* What rays look up, as seen from an anchor. */
karst_fluence_boxes karst_fluence_boxes_from(const karst_fluence *fluence, const karst_position *anchor);
const karst_buffer *karst_fluence_words(const karst_fluence *fluence);
/* Whether the picture's is not all there. */
bool karst_fluence_lacks(const karst_fluence *fluence);
/* Of a grid: its cells on each side (0: there is none), and where the energy of the packets went that were followed
 * last for it, by KARST_FLUENCE_GIVEN and so on. Waits. Errors: KARST_FAILED. */
bool karst_fluence_sums(const karst_fluence *fluence, int grid, int size[3], uint64_t sums[KARST_FLUENCE_SUMS],
                        karst_error *error);

#endif
