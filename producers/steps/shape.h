/* The two shapes in which bricks are produced. Both give the same bits. */
#ifndef KARST_PRODUCERS_SHAPE_H
#define KARST_PRODUCERS_SHAPE_H

#include <stdbool.h>
#include <stddef.h>

typedef enum {
    KARST_SHAPE_AUTO,  /* what suits the device */
    KARST_SHAPE_ROWS,  /* CPU: one work-item a brick, rows of LANES samples on tables made once a brick */
    KARST_SHAPE_GROUPS /* GPU: one work-group a brick, its work-items take samples in turn */
} karst_shape;

/* Work-items that share a brick in KARST_SHAPE_GROUPS. */
#define KARST_SHAPE_GROUP_SIZE 64

/* Work-items a brick. */
static inline size_t karst_shape_group_size(karst_shape shape, bool is_cpu)
{
    bool rows = shape == KARST_SHAPE_ROWS || (shape == KARST_SHAPE_AUTO && is_cpu);
    return rows ? 1 : KARST_SHAPE_GROUP_SIZE;
}

#endif
