/* The steps of an import (core/points/import.c), and what they share. */
#ifndef KARST_CORE_POINTS_IMPORT_INTERNAL_H
#define KARST_CORE_POINTS_IMPORT_INTERNAL_H

#include "core/points/points_file.h"

/* Neighbours of a point that normals are turned along, and whose places they are found from. */
#define POINTS_LINKS 8
#define POINTS_NEAREST 16
#define POINTS_RADIUS_OF 9 /* the radius is the distance to this neighbour */

typedef struct {
    const karst_points_import_config *config;
    karst_points_head head;
    char *temporary; /* the output's name until it is whole */
    int fd;          /* of it; -1: not open */
    bool stopped;
} points_import;

/* Whether to go on: asks config.progress. Errors: KARST_FAILED once it says no. */
bool karst_points_go_on(points_import *import, const char *what, double share, karst_error *error);

/* A file beside the output that has no name, so that nothing is left of it whatever happens; -1 on errors. */
int karst_points_scratch(const points_import *import, karst_error *error);
/* The same as memory, zeroed; NULL on errors. karst_points_unmap frees it. */
void *karst_points_scratch_map(const points_import *import, size_t num_bytes, karst_error *error);
void *karst_points_map(int fd, size_t num_bytes, karst_error *error);
void karst_points_unmap(void *map, size_t num_bytes); /* NULL is fine */
bool karst_points_write(const points_import *import, int fd, const void *data, size_t num_bytes, uint64_t offset,
                        karst_error *error);
bool karst_points_read(const points_import *import, int fd, void *data, size_t num_bytes, uint64_t offset,
                       karst_error *error);

/* A parallel loop over [0, num) in blocks; `work` is called by several threads. */
typedef void (*karst_points_work)(void *user, uint64_t begin, uint64_t end);
bool karst_points_in_parallel(points_import *import, const char *what, uint64_t num, uint64_t block,
                              karst_points_work work, void *user, karst_error *error);

/* sort.c: the points of `from`, in any order, into `to` from byte `offset` on, in Morton order; of points at one place
 * the first is kept, and head.num_duplicates counts the rest. *num becomes how many are left. Closes `from`. */
bool karst_points_sort(points_import *import, int from, uint64_t *num, int to, uint64_t offset, karst_error *error);

/* near.c: of each of the points, which are in Morton order: radius, the normal (if it is 0), and POINTS_LINKS nearest
 * neighbours (UINT32_MAX: there are fewer). */
bool karst_points_look_around(points_import *import, karst_point *points, uint32_t num, uint32_t *links,
                              karst_error *error);
/* turn.c: turns normals outwards; fills in num_parts and share_unsure. */
bool karst_points_turn_together(points_import *import, karst_point *points, uint32_t num, const uint32_t *links,
                                karst_error *error);
/* The few that had none: as those of their neighbours that had one. */
void karst_points_turn_like_given(karst_point *points, uint32_t num, const uint32_t *links);
void karst_points_turn_up(karst_point *points, uint32_t num);
/* levels.c: appends the coarser levels to the output. */
bool karst_points_add_levels(points_import *import, karst_error *error);

#endif
