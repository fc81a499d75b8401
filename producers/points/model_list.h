/* The models of a scene on the host: imported points, loaded and checked, as devices read them. Not thread-safe. */
#ifndef KARST_PRODUCERS_POINTS_MODEL_LIST_H
#define KARST_PRODUCERS_POINTS_MODEL_LIST_H

#include "cache/cache.h"
#include "karst/log.h"
#include "karst/position.h"

/* An imported file of points, and where it stands. */
typedef struct {
    const char *path;
    karst_position at;  /* of its centre */
    double turn_deg[3]; /* about the x, the y, then the z axis; about y as a camera's yaw turns */
    double scale;       /* of the file's lengths to metres, > 0 */
} karst_model;

#define KARST_MAX_MODELS 256u

/* What a device reads is one block of memory, head first (points_shared.h). */
typedef struct {
    uint64_t *data;
    size_t size_bytes;
    uint32_t num_models;
} karst_model_list;

/* Loads the files of all models; models of one file share its points. Fine levels that do not fit max_bytes are left
 * out, which the log is told. Errors: KARST_BAD_DATA (files that are missing or damaged), KARST_USAGE (models too large
 * or too small for the world's voxels, too many), KARST_FAILED. */
bool karst_model_list_init(karst_model_list *list, const karst_model *models, size_t num, int voxel_log2_m,
                           uint64_t max_bytes, const karst_log *log, karst_error *error);
void karst_model_list_finish(karst_model_list *list); /* a zeroed one is fine */

/* What model number `index` changes, at any level: for karst_cache_drop. */
karst_drop_box karst_model_list_box(const karst_model_list *list, uint32_t index);
/* The density at a voxel's corner with all models, from the world's own, as samples of a level have it: the bits of
 * devices. */
float karst_model_list_density(const karst_model_list *list, const int64_t voxel[3], int level, float density);
/* The same with the models' colours laid over `colour`: red, green and blue (linear), each times coverage, and
 * coverage. */
float karst_model_list_coloured_density(const karst_model_list *list, const int64_t voxel[3], int level, float density,
                                        float colour[4]);
bool karst_model_list_has_colours(const karst_model_list *list);
/* The tree holds its points, and covers hold what they say. Errors: KARST_FAILED, with what is wrong. */
bool karst_model_list_check(const karst_model_list *list, karst_error *error);

#endif
