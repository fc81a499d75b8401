/* The models of a scene on the host: imported points, loaded and checked, as devices read them. Not thread-safe. */
#ifndef KARST_PRODUCERS_POINTS_MODEL_LIST_H
#define KARST_PRODUCERS_POINTS_MODEL_LIST_H

#include "cache/cache.h"
#include "core/points/points_file.h"
#include "karst/log.h"
#include "karst/position.h"
#include "producers/points/points_shared.h"

/* An imported file of points, and where it stands. */
typedef struct {
    const char *path;
    karst_position at;  /* of its centre */
    double turn_deg[3]; /* about the x, the y, then the z axis; about y as a camera's yaw turns */
    double scale;       /* of the file's lengths to metres, > 0 */
    bool is_whole;      /* what its points enclose is matter, too (model_solid.h): all or none of a list */
} karst_model;

#define KARST_MAX_MODELS 256u

/* From a model's axes to the world's: about x, then y, then z. Quarter turns are exact. */
void karst_model_rotation(const double turn_deg[3], double r[3][3]);
/* Where a model of a file with this head stands, whose points reach so far from its centre: all of the record but its
 * levels. Errors: KARST_USAGE (too large or too small for the world's voxels, too far out). */
bool karst_model_place(const karst_model *model, const karst_points_head *head, const double half_units[3],
                       int voxel_log2_m, karst_model_record *record, karst_error *error);
/* Bytes of sRGB to what they stand for (IEC 61966-2-1). */
void karst_fill_linear(float linear[256]);

/* What a device reads is one block of memory, head first (points_shared.h). */
typedef struct {
    uint64_t *data; /* whole pages */
    size_t size_bytes;
    uint32_t num_models, num_maps;
    struct karst_model_map {
        void *at;
        size_t num_bytes;
    } * maps; /* parts of the block that are files' own pages: read when they are looked at, never written */
} karst_model_list;

/* Files up to this are read and checked whole. Larger ones are mapped, so that opening one takes as long as its coarse
 * levels do, and memory what is looked at; of these the head and all small levels are checked (karst_points_describe
 * checks all). */
#define KARST_MODEL_MOST_READ_BYTES ((uint64_t)64 << 20)

/* Opens the files of all models; models of one file share its points. Fine levels that do not fit max_bytes are left
 * out, which the log is told; and so are those of whole models that would take too many cells. Errors: KARST_BAD_DATA
 * (files that are missing or damaged), KARST_USAGE (models too large or too small for the world's voxels, too many),
 * KARST_FAILED. */
bool karst_model_list_init(karst_model_list *list, const karst_model *models, size_t num, int voxel_log2_m,
                           uint64_t max_bytes, const karst_log *log, karst_error *error);
/* The same with another limit than KARST_MODEL_MOST_READ_BYTES for all files together: for tests. */
bool karst_model_list_init_reading(karst_model_list *list, const karst_model *models, size_t num, int voxel_log2_m,
                                   uint64_t max_bytes, uint64_t most_read_bytes, const karst_log *log,
                                   karst_error *error);
void karst_model_list_finish(karst_model_list *list); /* a zeroed one is fine */
/* Lets go of mapped pages; they are read again when they are looked at. May be called while others look. */
void karst_model_list_let_go(const karst_model_list *list);

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

/* model_places.c: at exact places rather than at samples. All of these may be called by many threads at once.
 * The density there with all models, band-limited to a level's voxel (-1: as to level 0's), from the world's own;
 * `gradient` is that, per metre, and becomes the model's where the model's value is the larger one; it may be NULL. */
float karst_model_list_at(const karst_model_list *list, const karst_position *at, int level, float density,
                          float gradient[3]);
/* The models' colours laid over `over`: red, green and blue (linear), each times coverage, and coverage. */
void karst_model_list_colour(const karst_model_list *list, const karst_position *at, int level, float density,
                             float over[4]);
/* What models make of a range of densities in a closed box at every footprint from 0 to a level's voxel; conservative:
 * its upper end is no larger than the supports that reach the box. */
void karst_model_list_range(const karst_model_list *list, const karst_position *centre, const double half_voxels[3],
                            int level, double range[2]);
/* The tree holds its points, and covers hold what they say. Errors: KARST_FAILED, with what is wrong. */
bool karst_model_list_check(const karst_model_list *list, karst_error *error);

#endif
