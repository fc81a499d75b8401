/* A file of imported points (docs/POINTS.md) as host and devices read it: its points, and the trees over them. Compiled
 * twice: see core/device/dialect.h. */
#ifndef KARST_CORE_POINTS_RECORD_SHARED_H
#define KARST_CORE_POINTS_RECORD_SHARED_H

#include "core/device/dialect.h"

/* Places are whole units from the model's centre, a unit being a power of two: |at| is at most 2^27, so that a place
 * and what reaches beyond it fit 32 bits. */
#define KARST_POINTS_MAX_AT (1 << 27)

/* A point, in the order of a space-filling curve (Morton). */
typedef struct {
    int at[3];
    float radius;    /* units: to the ninth neighbour */
    short normal[3]; /* times 32767, outwards; all 0: not known */
    uchar rgb[3];    /* sRGB */
    uchar is_found;  /* while importing: the normal is from neighbours, and not turned yet; else 0 */
    ushort pad;
} karst_point;
K_ASSERT_SIZE(karst_point, 28);

/* The hull of eight points that follow one another, or of eight such nodes. */
#define KARST_POINTS_FAN 8u
#define KARST_POINTS_MAX_TREE 11
typedef struct {
    int min[3], max[3]; /* of places, without supports */
    int reach;          /* the largest */
    /* Of the points that these are averages of, at any finer level: no support goes farther from these than `cover`,
     * and no place lies farther from them than `spread`. */
    int cover, spread;
    int pad;
} karst_point_node;
K_ASSERT_SIZE(karst_point_node, 40);

/* The radius of a point's support, units: twice its own, rounded up. What is no radius has the least. */
K_INLINE int karst_point_reach(float radius)
{
    const float most = 2.0f * (float)KARST_POINTS_MAX_AT, twice = 2.0f * radius;
    float reach = twice > 1.0f ? -k_floor(-twice) : 1.0f;
    return (int)(reach < most ? reach : most);
}

/* How many nodes each level of the tree over so many points has, leaves first; returns how many levels. */
K_INLINE int karst_points_tree(uint num, uint counts[KARST_POINTS_MAX_TREE])
{
    int levels = 0;
    do {
        num = (num + KARST_POINTS_FAN - 1u) / KARST_POINTS_FAN;
        counts[levels++] = num;
    } while (num > 1u && levels < KARST_POINTS_MAX_TREE);
    return levels;
}

#endif
