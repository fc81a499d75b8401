/* The file format of imported points (docs/POINTS.md): a head of 1,536 bytes, then the levels, the finest first. */
#ifndef KARST_CORE_POINTS_POINTS_FILE_H
#define KARST_CORE_POINTS_POINTS_FILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "karst/error.h"
#include "karst/points.h"

/* Places are whole units from the model's centre, a unit being a power of two: |at| is at most 2^27, so that a place
 * and what reaches beyond it fit 32 bits. */
#define KARST_POINTS_MAX_AT (1 << 27)

/* A point on disk, in the order of a space-filling curve (Morton). */
typedef struct {
    int32_t at[3];
    float radius;      /* units: to the ninth neighbour */
    int16_t normal[3]; /* times 32767, outwards; all 0: not known */
    uint8_t rgb[3];
    uint8_t is_found; /* while importing: the normal is from neighbours, and not turned yet; else 0 */
    uint16_t pad;
} karst_point;
_Static_assert(sizeof(karst_point) == 28, "as on disk");

typedef struct {
    uint64_t offset, num; /* bytes from the file's begin; points */
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
    uint64_t reserved[73];
    uint64_t sum; /* of all before it */
} karst_points_head;
_Static_assert(sizeof(karst_points_head) == 1536, "as on disk");

#define KARST_POINTS_MAGIC "KarstPts"
#define KARST_POINTS_VERSION 1u
#define KARST_POINTS_HAS_COLOURS 1u
#define KARST_POINTS_HAS_GIVEN_NORMALS 2u

/* A sum of bytes that goes on from `sum`; 0 at first. Only the last part's length may be other than a multiple of 8. */
uint64_t karst_points_sum(uint64_t sum, const void *data, size_t num_bytes);

/* Reads and checks a head: sums, sizes against the file's, numbers in their ranges. Returns a file descriptor that is
 * open for reading, or -1. Errors: KARST_BAD_DATA. */
int karst_points_open(const char *path, karst_points_head *head, karst_error *error);
/* A level's points, malloc'ed, with their sum and each number checked. Errors: KARST_BAD_DATA, KARST_FAILED. */
karst_point *karst_points_load_level(int fd, const char *path, const karst_points_head *head, uint32_t level,
                                     karst_error *error);
void karst_points_tell(const karst_points_head *head, karst_points_about *about);

#endif
