/* Light maps: what light falls on surfaces, known beforehand at points of them.
 *
 * A map stands for light that comes from all around: of the sky, and of what surfaces throw back and glow. Lamps are
 * looked for as ever. At a place of a surface the points within their own radii are averaged, those that face the same
 * way: each counts by (1 - (d/r)^2)^2 and the cosine between the normals, over r^2, so that where points of a near
 * and of a far view meet, the denser ones decide. Where no point reaches, light from around is what shading takes it to
 * be, and at a map's edge the one goes over into the other.
 *
 * Points lie in a table of cells, hashed: those of one level are twice as wide as those of the one below, and each
 * point lies in the level that its radius says, in each cell that it reaches. So a place looks into one cell of each
 * level.
 * Sums go by the points' order: neither lanes nor devices leave a trace. */
#ifndef KARST_RAYCAST_LIGHT_MAP_H
#define KARST_RAYCAST_LIGHT_MAP_H

#include "raycast/cast/cast.h"
#include "raycast/cast/pinhole.h"
#include "raycast/light/light_map_shared.h"
#include "raycast/shade_shared.h"

typedef struct karst_light_map karst_light_map;

/* A point of a map. */
typedef struct {
    double place[3];  /* from the map's anchor, level-0 voxels */
    double radius;    /* level-0 voxels; above 0 */
    double normal[3]; /* any length but 0 */
    double light[3];  /* of a white surface: linear red, green, blue */
} karst_light_map_point;

/* Of 1 to KARST_LIGHT_MAP_MOST points, which are copied. Errors: KARST_FAILED. */
#define KARST_LIGHT_MAP_MOST (1u << 22)
karst_light_map *karst_light_map_create(karst_context *context, const karst_light_map_point *points, size_t num,
                                        karst_error *error);
void karst_light_map_destroy(karst_light_map *map); /* NULL is fine */

/* Adds to the picture's parts what the map has more than shading takes to come from around, for surfaces that rays
 * stand for as karst_paths_look_along_normals leaves them. offset: from the anchor of the picture to that of the map,
 * level-0 voxels. Asynchronous. Errors: KARST_FAILED. */
bool karst_light_map_gather(karst_light_map *map, const karst_buffer *rays, const karst_buffer *count,
                            uint32_t max_rays, const float offset[3], const karst_pinhole *pinhole,
                            const karst_light *light, karst_buffer *parts, karst_error *error);

#endif
