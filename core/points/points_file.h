/* The file format of imported points (docs/POINTS.md): a head of 1,536 bytes, then the levels, the finest first: its
 * points, then the nodes of the tree over them. */
#ifndef KARST_CORE_POINTS_POINTS_FILE_H
#define KARST_CORE_POINTS_POINTS_FILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "core/points/record_shared.h"
#include "karst/error.h"
#include "karst/points.h"

typedef struct {
    uint64_t offset, num; /* bytes from the file's begin, a multiple of 8; points */
    uint64_t sum;         /* karst_points_sum of them */
    uint64_t spacing;     /* units: samples up to some 1.3 of it apart are told a surface by this level */
} karst_points_level;

/* Integers and floats are little-endian. */
typedef struct {
    char magic[8]; /* KARST_POINTS_MAGIC */
    uint32_t version, record_bytes;
    uint32_t flags, num_levels;
    double unit, centre[3]; /* of the input's lengths; what its places have less than the input's */
    double spacing, min[3], max[3];
    uint64_t num_read, num_withheld, num_invalid, num_far, num_duplicates, num_outliers, num_parts;
    double share_unsure;
    karst_points_level levels[KARST_POINTS_MAX_LEVELS];
    uint64_t tree_sums[KARST_POINTS_MAX_LEVELS]; /* of each level's nodes */
    uint64_t reserved[49];
    uint64_t sum; /* of all before it */
} karst_points_head;
_Static_assert(sizeof(karst_points_head) == 1536, "as on disk");

#define KARST_POINTS_MAGIC "KarstPts"
#define KARST_POINTS_VERSION 2u
#define KARST_POINTS_HAS_COLOURS 1u
#define KARST_POINTS_HAS_GIVEN_NORMALS 2u

/* A sum of bytes that goes on from `sum`; 0 at first. Only the last part's length may be other than a multiple of 8. */
uint64_t karst_points_sum(uint64_t sum, const void *data, size_t num_bytes);

/* Reads and checks a head: sums, sizes against the file's, numbers in their ranges. Returns a file descriptor that is
 * open for reading, or -1. Errors: KARST_BAD_DATA. */
int karst_points_open(const char *path, karst_points_head *head, karst_error *error);
/* Where a level's nodes begin, and where it ends, in bytes from the file's begin. */
uint64_t karst_points_tree_offset(const karst_points_level *level);
uint64_t karst_points_level_end(const karst_points_level *level);
/* A level's points, malloc'ed, with their sum and each number checked. Errors: KARST_BAD_DATA, KARST_FAILED. */
karst_point *karst_points_load_level(int fd, const char *path, const karst_points_head *head, uint32_t level,
                                     karst_error *error);
/* Checks a level that lies in memory from its offset on: sums, numbers, and that each node holds what is below it.
 * Errors: KARST_BAD_DATA. */
bool karst_points_check_level(const char *path, const karst_points_head *head, uint32_t level, const void *data,
                              karst_error *error);
void karst_points_tell(const karst_points_head *head, karst_points_about *about);

#endif
