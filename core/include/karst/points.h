/* Models made of points: importing files of scanned points, and what an imported file (.karstpoints) holds.
 *
 * A world file names imported files in its header ("models"), and they are part of its land: docs/POINTS.md. */
#ifndef KARST_POINTS_H
#define KARST_POINTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "karst/error.h"

#ifdef __cplusplus
extern "C" {
#endif

/* How the axes of a file become Karst's, which are x right, y up, z forward (left-handed). */
typedef enum {
    KARST_POINTS_AXES_OF_FORMAT, /* Y_UP for PLY and OBJ, Z_UP for LAS and text */
    KARST_POINTS_Y_UP,           /* right-handed, y up: z is negated */
    KARST_POINTS_Z_UP,           /* right-handed, z up, as maps are: y and z change places */
    KARST_POINTS_AS_THEY_ARE
} karst_points_axes;

/* How normals that a file lacks are turned outwards. */
typedef enum {
    KARST_POINTS_TURN_TOGETHER, /* from neighbour to neighbour, the topmost of each connected part upwards */
    KARST_POINTS_TURN_UP        /* each upwards: for ground that is seen from the air */
} karst_points_turn;

/* Zeros are defaults. */
typedef struct {
    const char *input;  /* .ply, .obj, .las; .xyz, .txt, .csv, .pts or .asc for text. Must be set */
    const char *output; /* the file to be made; must be set. Temporary files lie in the same folder */
    karst_points_axes axes;
    karst_points_turn turn;
    bool keep_outliers;   /* points far from all others stay */
    uint32_t num_threads; /* 0: one for each core, 64 at most */
    /* Called now and then by the calling thread, with what is being done and its share, 0 to 1; returning false ends
     * the import. NULL: nobody asks. */
    bool (*progress)(void *user, const char *what, double share);
    void *user;
    /* What is done lies in a folder named OUTPUT.import, with checkpoints: an import that was stopped, killed, or
     * failed for want of room goes on from there when it is called again for the same input and output, and makes the
     * same bytes. The folder vanishes once the output is there, and when the input turns out to be bad; another input,
     * other options, or a start of the machine in between begin anew. */
    bool resumable;
} karst_points_import_config;

#define KARST_POINTS_MAX_LEVELS 24

/* What an imported file holds, and what became of what was imported. Lengths are those of the input's unit. */
typedef struct {
    uint64_t num_points;     /* of the finest level */
    uint64_t num_read;       /* points that the input had, */
    uint64_t num_withheld;   /* of which it said itself that they are not to be used (more beside num_read), */
    uint64_t num_invalid;    /* of which were left out: places that are not finite, */
    uint64_t num_far;        /* thousands of times as far out as nearly all others, */
    uint64_t num_duplicates; /* at a place that another has, */
    uint64_t num_outliers;   /* far from their neighbours */
    uint32_t num_levels;     /* each averages the one before in cells twice as wide; the finest is level 0 */
    uint64_t num_of_level[KARST_POINTS_MAX_LEVELS];
    double spacing;        /* of neighbours at the finest level: the median */
    double min[3], max[3]; /* of places, in Karst's axes */
    double centre[3];      /* of those: what `at` of a world file places */
    bool has_colours;
    bool has_given_normals; /* they are the input's; else they were found from neighbours */
    uint64_t num_parts;     /* connected parts that normals were turned in; 0 where none were */
    double share_unsure;    /* of pairs of neighbours whose normals disagree although they were turned together: above
                             * some 0.05 the points are no surface with an inside */
} karst_points_about;

/* Imports a file of points: reads it once, sorts it on disk, finds normals and radii, builds the levels. Needs free
 * space of some four times the output, in its folder; memory is some hundreds of MiB, whatever the number of points.
 * The output appears whole or not at all. Without `resumable` nothing else is left, however it ends. *about may be
 * NULL. Errors: KARST_USAGE (names, configuration), KARST_BAD_DATA (the input, with the place), KARST_FAILED (disk,
 * memory, stopped by progress, another process at the same output). Thread-safe for distinct outputs. Sources:
 * docs/POINTS.md. */
bool karst_points_import(const karst_points_import_config *config, karst_points_about *about, karst_error *error);

/* What an imported file holds; looks at its sums. Errors: KARST_BAD_DATA (no such file, or a damaged one). Thread-safe.
 */
bool karst_points_describe(const char *path, karst_points_about *about, karst_error *error);
/* Whether a name ends in .karstpoints. */
bool karst_points_is_name(const char *name);

#ifdef __cplusplus
}
#endif
#endif
