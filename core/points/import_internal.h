/* The steps of an import (core/points/import.c), and what they share.
 *
 * Each step reads files that an earlier one left, and writes others. What is done is noted in a checkpoint (work.c), so
 * that an import that was cut off, at whatever moment, goes on from there and makes the same bytes: a step that is not
 * done begins anew, at its own begin or at a place that it has noted, and never changes what it read in a way that
 * counts twice. Memory is bounded whatever the number of points: what is large lies in files. */
#ifndef KARST_CORE_POINTS_IMPORT_INTERNAL_H
#define KARST_CORE_POINTS_IMPORT_INTERNAL_H

#include "core/points/points_file.h"

/* Neighbours of a point that normals are turned along, and whose places they are found from. */
#define POINTS_LINKS 8
#define POINTS_NEAREST 16
#define POINTS_RADIUS_OF 9 /* the radius is the distance to this neighbour */
#define POINTS_FEWEST 16u

/* Files of an import's work. */
typedef enum {
    POINTS_RAW,    /* points as they were read */
    POINTS_SPREAD, /* in whole units, by ranges of their keys */
    POINTS_RANGES, /* which ranges those are */
    POINTS_SORTED, /* in order, and later with radii and normals */
    POINTS_KEPT,   /* those without outliers, if there are any */
    POINTS_NEAR,   /* of each its nearest neighbours */
    POINTS_BENDS,  /* of each how its normal and those of its neighbours differ */
    POINTS_TURNS,  /* of each which part it is of, and whether its normal turns over */
    POINTS_QUEUES, /* who waits to be turned */
    POINTS_COVERS, /* of each of a level's points, points_extent; of even levels, */
    POINTS_COVERS_ODD,
    POINTS_MODEL, /* the output until it is whole */
    POINTS_NUM_FILES
} points_work_file;

typedef enum {
    POINTS_READ,
    POINTS_MEASURE,
    POINTS_SPREAD_OUT,
    POINTS_SORT,
    POINTS_LOOK,
    POINTS_LEAVE_OUT,
    POINTS_LOOK_AGAIN,
    POINTS_TURN,
    POINTS_FINEST,
    POINTS_COARSER,
    POINTS_DONE
} points_step;

/* All that a later step must know and that no file says. */
typedef struct {
    uint32_t step;        /* the one to be done next */
    uint32_t has_dropped; /* POINTS_KEPT is what counts, not POINTS_SORTED */
    uint64_t num;         /* points that are left */
    uint64_t done;        /* of the step, in its own counts; 0: it begins */
    uint64_t num_sorted;
    double low[3], high[3]; /* where a place is not far out */
    double min[3], max[3];  /* of those that are not, if has_limits */
    uint32_t has_limits, pad;
    karst_points_head head;
} points_progress;

/* A point as it was read, in Karst's axes. */
typedef struct {
    double at[3];
    int16_t normal[3];
    uint8_t rgb[3], pad[7];
} points_raw;

/* How much is done in memory at once: tests have less. */
typedef struct {
    uint64_t most_in_memory;      /* points that are sorted at once; a multiple of 1024 */
    uint64_t most_between;        /* points between two checkpoints of a step; a multiple of 4096 */
    uint64_t most_resident_bytes; /* files that are mapped are let go of beyond that */
    bool has_no_vectors;          /* neighbours are found as on a processor without wide ones */
} points_limits;
extern const points_limits karst_points_usual_limits;

typedef struct {
    const karst_points_import_config *config;
    points_limits limits;
    points_progress now;
    karst_points_head *head; /* now.head */
    char *folder;            /* where the work lies; NULL: in files without names */
    int lock;                /* of the folder; -1: none */
    char *model_name;        /* of MODEL where there is no folder; NULL: it is not there */
    int fds[POINTS_NUM_FILES];
    struct {
        void *at;
        size_t num_bytes;
    } maps[4];
    bool stopped, is_resumed;
} points_import;

/* work.c: opens what an import keeps its work in, and finds out how far an earlier one came; removes all of it; closes
 * it (what has a name stays). Errors: KARST_FAILED (also: another process is at it). */
bool karst_points_begin_work(points_import *import, karst_error *error);
void karst_points_remove_work(points_import *import);
void karst_points_end_work(points_import *import);
/* Notes that all before import->now is done. */
bool karst_points_checkpoint(points_import *import, karst_error *error);
/* A file of the work, open for reading and writing, made if it is not there; -1 on errors. It is closed with the work,
 * or dropped: then it is gone. */
int karst_points_file(points_import *import, points_work_file file, karst_error *error);
void karst_points_drop_file(points_import *import, points_work_file file);
/* Renames MODEL to the output's name; false: errno says why not. */
bool karst_points_publish(points_import *import);
/* The same as memory; with `anew` zeroed, and room for it is taken now: a full disk would kill whoever writes to it
 * later. NULL on errors. karst_points_unmap frees it, NULL is fine. */
void *karst_points_map_file(points_import *import, points_work_file file, size_t num_bytes, bool anew,
                            karst_error *error);
void karst_points_unmap(points_import *import, void *map);
/* Lets go of pages of mapped files where too many are resident: they are read again when they are touched. */
void karst_points_stay_small(const points_import *import);
/* The points that count: sorted, or kept. */
points_work_file karst_points_in_order(const points_import *import);

/* scratch.c. Whether to go on: asks config.progress. Errors: KARST_FAILED once it says no. */
bool karst_points_go_on(points_import *import, const char *what, double share, karst_error *error);
/* A file beside the output that has no name, so that nothing is left of it whatever happens; -1 on errors. */
int karst_points_scratch(const points_import *import, karst_error *error);
/* The same with a name, which the caller frees. */
int karst_points_scratch_with_name(const points_import *import, char **name, karst_error *error);
bool karst_points_write(const points_import *import, int fd, const void *data, size_t num_bytes, uint64_t offset,
                        karst_error *error);
bool karst_points_read(const points_import *import, int fd, void *data, size_t num_bytes, uint64_t offset,
                       karst_error *error);
bool karst_points_fail_disk(const points_import *import, const char *what, karst_error *error);

/* crew.c. A parallel loop over [first, end) in blocks; `work` is called by several threads. */
typedef void (*karst_points_work)(void *user, uint64_t begin, uint64_t end);
typedef struct {
    const char *what; /* for progress, of which first and end are parts of `num` */
    uint64_t first, end, num, block;
    bool maps; /* files are mapped: see karst_points_stay_small */
} points_loop;
bool karst_points_in_parallel(points_import *import, const points_loop *loop, karst_points_work work, void *user,
                              karst_error *error);

/* A block that a thread has, and what that thread has to work with. */
typedef struct {
    void *slot;
    uint64_t begin, end; /* unless `take` makes blocks */
} points_block;

/* A parallel loop whose blocks are taken, then worked on, then put. Taking and putting go in the order of blocks, one
 * at a time, though one block may be put while another is taken; work goes beside all of it. So what is put in order,
 * sums and places in files, does not depend on how many threads there are. Any of the three may be NULL, and any that
 * fails ends the loop. */
typedef struct {
    points_loop loop;
    uint32_t most_threads; /* that each have a slot; 0: as many as there are */
    size_t slot_bytes;     /* zeroed at first, then left as they are from block to block */
    void (*clear)(void *slot);
    /* NULL: blocks are those of the loop. *share: for progress; *any is false where no block is left. */
    bool (*take)(void *user, points_block *block, double *share, bool *any, karst_error *error);
    bool (*work)(void *user, points_block *block, karst_error *error);
    bool (*put)(void *user, points_block *block, karst_error *error);
} points_turns;
bool karst_points_in_turns(points_import *import, const points_turns *turns, void *user, karst_error *error);

/* The steps, each with what it reads -> what it writes. All may fail with KARST_FAILED (disk, memory, stopped). */
/* read.c: the input -> RAW; now.num, limits. Errors: KARST_BAD_DATA, KARST_USAGE of the input. */
bool karst_points_read_input(points_import *import, karst_error *error);
/* whole.c: RAW -> now.num, unit and centre of the head. Errors: KARST_BAD_DATA, KARST_USAGE (too many). */
bool karst_points_measure(points_import *import, karst_error *error);
/* How many points RAW has, those that are far out included. */
uint64_t karst_points_num_raw(const points_import *import);
/* Once that is measured: reads `num` points of RAW from `first` on, and makes those that are not far out whole. Returns
 * how many; SIZE_MAX on errors. Thread-safe. */
size_t karst_points_read_whole(const points_import *import, int from, uint64_t first, size_t num, points_raw *raw,
                               karst_point *points, karst_error *error);
/* spread.c: RAW -> SPREAD, RANGES. */
bool karst_points_spread(points_import *import, karst_error *error);
/* A range of points of a file, all of which come before those of later ranges. */
typedef struct {
    uint64_t first, num;
} points_range;
#define POINTS_MOST_RANGES 4096u
#define POINTS_SORTERS 4u /* ranges that are sorted at a time */
/* As many points as a range may have, to be sorted in memory. */
uint64_t karst_points_most_in_range(const points_import *import);
/* Spreads a range that has more over ranges of another file, by more bits of the keys: `depth` is 0 for RAW, and one
 * more for what came of that. Returns *num ranges, which the caller frees; NULL on errors. */
points_range *karst_points_spread_range(points_import *import, int from, const points_range *all, uint32_t depth,
                                        int to, uint32_t *num, karst_error *error);
#define POINTS_MOST_DEPTH 5u /* of the 63 leading bits */
/* sort.c: SPREAD -> SORTED, in Morton order; of points at one place the first is kept, and
 * head.num_duplicates counts the rest. Errors: KARST_BAD_DATA (too few are left). */
bool karst_points_sort(points_import *import, karst_error *error);
/* near.c: finds in SORTED or KEPT of each point: radius, the normal (if it is 0), and POINTS_LINKS nearest neighbours
 * (UINT32_MAX: there are fewer), NEAR. */
bool karst_points_look_around(points_import *import, karst_error *error);
/* finish.c: SORTED -> KEPT, without points that are far from all others. Errors: KARST_BAD_DATA (too few are left). */
bool karst_points_leave_out(points_import *import, karst_error *error);
/* turn.c: SORTED or KEPT, NEAR -> TURNS; num_parts and share_unsure. */
bool karst_points_turn_normals(points_import *import, karst_error *error);
#define POINTS_TURNS_OVER 0x80000000u
/* finish.c: SORTED or KEPT, TURNS -> the finest level of MODEL. */
bool karst_points_add_finest(points_import *import, karst_error *error);
/* levels.c: appends the coarser levels to MODEL. */
bool karst_points_add_levels(points_import *import, karst_error *error);

/* How far what a point stands for reaches: see karst_point_node. */
typedef struct {
    int32_t cover, spread;
} points_extent;
/* level_files.c: reads points of a level from `first` on, and their extents. Those of the finest level are their
 * supports; those of others lie in a file, where karst_points_add_levels puts them. Thread-safe. */
typedef struct {
    const points_import *import;
    const karst_points_level *level;
    int model, extents; /* files; extents -1: it is the finest level */
} points_level_files;
points_work_file karst_points_extents_of(uint32_t level);
bool karst_points_open_level(points_import *import, uint32_t level, points_level_files *files, karst_error *error);
bool karst_points_read_level(const points_level_files *files, uint64_t first, size_t num, karst_point *points,
                             points_extent *extents, karst_error *error);
/* tree.c: writes the nodes of a level behind its points in MODEL, and their sum into the head. */
bool karst_points_add_tree(points_import *import, uint32_t level, karst_error *error);

/* spill.c: many stacks of numbers whose lower parts lie in QUEUES. */
typedef struct points_stacks points_stacks;
points_stacks *karst_points_stacks_create(points_import *import, uint32_t num, karst_error *error);
void karst_points_stacks_destroy(points_stacks *stacks); /* NULL is fine */
bool karst_points_push(points_stacks *stacks, uint32_t stack, uint32_t value, karst_error *error);
/* false in *has: the stack is empty. */
bool karst_points_pop(points_stacks *stacks, uint32_t stack, uint32_t *value, bool *has, karst_error *error);

/* import.c: karst_points_import with other limits. */
bool karst_points_import_within(const karst_points_import_config *config, const points_limits *limits,
                                karst_points_about *about, karst_error *error);
/* The median of radii, by counts of their upper halves (floats by 65,536 bins). */
#define POINTS_RADIUS_BINS 65536u
uint32_t karst_points_radius_bin(float radius);
float karst_points_median(const uint64_t counts[POINTS_RADIUS_BINS], uint64_t num);

#endif
