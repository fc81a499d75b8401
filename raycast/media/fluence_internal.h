/* Light that media scatter often, from inside: what its files have in common. */
#ifndef KARST_RAYCAST_MEDIA_FLUENCE_INTERNAL_H
#define KARST_RAYCAST_MEDIA_FLUENCE_INTERNAL_H

#include "raycast/media/fluence.h"

/* What is next. */
typedef enum { KARST_FLUENCE_FILL, KARST_FLUENCE_OPEN, KARST_FLUENCE_TRACE, KARST_FLUENCE_REST } karst_fluence_step;

/* A box in the world: level-0 voxels. */
typedef struct {
    int64_t corner[3];
    int size[3]; /* in cells */
    int cell_log2;
} karst_fluence_place;

/* The light that packets are made of. */
typedef struct {
    float direction[3], sun[3], above[3], below[3];
} karst_fluence_source;

typedef struct {
    karst_fluence_step step;
    bool is_known;  /* what is shown is of this medium, maybe at an earlier time or in other light */
    bool is_stale;  /* the medium has moved since the cells were filled */
    bool is_behind; /* what is to be found next has not been begun */
    karst_fluence_place region, box, shown, shown_region;
    float coarser; /* voxels that its cells were filled from, as the picture's */
    uint32_t num_fills, num_outer_fills; /* how often its cells have been filled; those that it was traced in */
    karst_fluence_source light;
    karst_light lit; /* the same, for kernels */
    karst_fluence_task task;
    uint32_t num_traced;
    double unit; /* of a quantum, in units of colour across a cell */
} karst_fluence_grid;

struct karst_fluence {
    karst_media *media;
    karst_program *filling, *tracing;
    cl_kernel fill, open, bound, trace, pack;
    karst_buffer *extinction, *look, *open_shares, *bounds, *sums, *ledger, *found, *words;
    karst_fluence_grid grids[KARST_FLUENCE_GRIDS];
    uint32_t num_packets; /* of each */
};

/* fluence_fill.c: the kernels that fill cells. */
bool karst_fluence_build_fill(karst_fluence *fluence, karst_error *error);
size_t karst_fluence_num_cells(const karst_fluence_place *place);
bool karst_fluence_is_same(const karst_fluence_place *a, const karst_fluence_place *b);
/* A place's cells, as seen from a voxel of level 0 and a fraction of one in 2^-32; `region`: where they were looked
 * for. */
karst_fluence_box karst_fluence_box_from(const karst_fluence_place *place, const karst_fluence_place *region,
                                         const int64_t voxel[3], const uint32_t fraction[3]);
/* From its own corner. */
karst_fluence_box karst_fluence_own_box(const karst_fluence_grid *grid);
/* The number of its first cell, of all. */
cl_uint karst_fluence_base(const karst_fluence *fluence, const karst_fluence_grid *grid);
/* Of one item for each of num_items. */
bool karst_fluence_launch(const karst_fluence *fluence, cl_kernel kernel, size_t num_items, karst_error *error);
/* Where an eye looks for a medium: all that it may see, or what is near. */
karst_fluence_place karst_fluence_region(const karst_media_picture *picture, bool is_near);
/* Fills the cells of the grid's box, which is fitted to what is found: the smallest that are few enough. *done: nothing
 * is missing, and the box stays as it is. Waits. Errors: KARST_FAILED. */
bool karst_fluence_fill(karst_fluence *fluence, karst_fluence_grid *grid, const karst_media_picture *picture,
                        bool *done, karst_error *error);
/* Where land hides the sun from its cells, if that is asked for. *done: nothing is missing. Waits. Errors:
 * KARST_FAILED. */
bool karst_fluence_look_for_sun(karst_fluence *fluence, const karst_fluence_grid *grid,
                                const karst_media_picture *picture, bool *done, karst_error *error);

#endif
