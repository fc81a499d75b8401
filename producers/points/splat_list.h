/* The models of a scene that are shown as discs: their trees, made of imported files, as one block for devices
 * (core/points/splat_shared.h), and where they stand. Not thread-safe. */
#ifndef KARST_PRODUCERS_POINTS_SPLAT_LIST_H
#define KARST_PRODUCERS_POINTS_SPLAT_LIST_H

#include "core/points/splat_shared.h"
#include "producers/points/model_list.h"

typedef struct {
    karst_model model;
    bool culls, is_deep, has_backs; /* as karst_splat_tree_build, and karst_splat_model */
} karst_splat_source;

/* What became of points. */
typedef struct {
    uint64_t num_points; /* of the finest levels that are shown */
    uint64_t num_discs, num_copies, num_culled, num_leaves; /* of all levels; copies are discs, too */
} karst_splat_counts;

typedef struct {
    uint64_t *data; /* head first */
    size_t size_bytes;
    uint32_t num_models;
    karst_model_record *places; /* where each stands */
    karst_splat_counts counts;
} karst_splat_list;

/* Reads the files and makes their trees; models of one file share its tree where they cull alike. Fine levels that do
 * not fit max_bytes are left out, which the log is told. Errors: as karst_model_list_init. */
bool karst_splat_list_init(karst_splat_list *list, const karst_splat_source *sources, size_t num, int voxel_log2_m,
                           uint64_t max_bytes, const karst_log *log, karst_error *error);
void karst_splat_list_finish(karst_splat_list *list); /* a zeroed one is fine */

#endif
