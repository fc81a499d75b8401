/* The particles of a scene on the host: read from files or given off by emitters, where they are at a time, as devices
 * read them; and how deep rays are in them, exactly. Not thread-safe. */
#ifndef KARST_PRODUCERS_PARTICLE_LIST_H
#define KARST_PRODUCERS_PARTICLE_LIST_H

#include "cache/cache.h"
#include "karst/position.h"

/* As many at most, of all groups together. */
#define KARST_MAX_PARTICLES 1000000u
#define KARST_MAX_PARTICLE_GROUPS 64u
/* Times go from minus to plus that. */
#define KARST_MOST_TIME_S 1e9

typedef enum { KARST_EMITTER_BALL, KARST_EMITTER_BOX, KARST_EMITTER_DISC } karst_emitter_shape;

/* Gives off `count` particles in each life, evenly, and each of these is born again at another place of the shape. All
 * is a function of the seed and the time. */
typedef struct {
    karst_emitter_shape shape;
    double size_m[3];       /* across, of each axis; a disc stands across its velocity, as wide as the first */
    double velocity_m_s[3];
    double spread_m_s;      /* speed in a direction of its own, of each particle */
    double stray_m;         /* how far each is carried to and fro, at the end of its life */
    double count;           /* rounded down */
    double life_s;
    double radius_m[2];     /* at birth, at the end */
    double extinction;      /* per metre */
    double fade;            /* share of a life, 0 to 0.5, in which extinction comes, and again goes */
    uint32_t seed;
} karst_emitter;

typedef struct {
    const char *path; /* of a file of particles (.csv, .ply); NULL: an emitter */
    karst_emitter emitter;
    karst_position at; /* where the group's origin is */
    bool is_sum;       /* particles_shared.h */
} karst_particle_group;

/* A particle at a time. */
typedef struct {
    double at_m[3]; /* from the list's origin */
    double radius_m, extinction;
    bool is_sum;
} karst_ball;

typedef struct karst_particle_row karst_particle_row; /* of a file */

/* What a device reads is one block of memory, head first (particles_shared.h). */
typedef struct {
    uint64_t *data;
    size_t size_bytes;
    uint32_t num; /* particles */
    karst_ball *balls; /* group by group */
    int64_t origin[3];
    int voxel_log2_m;
    double time_s;
    karst_particle_group *groups;
    size_t num_groups;
    karst_particle_row **rows; /* of each group from a file */
    uint64_t *num_rows;
} karst_particle_list;

/* Loads the files of all groups, and finds where particles are. Errors: KARST_BAD_DATA (files that are missing or
 * damaged, with the line; numbers that make no sense), KARST_USAGE (too many, too far apart for the world's voxels, a
 * time that is no number), KARST_FAILED; then there is nothing to finish. */
bool karst_particle_list_init(karst_particle_list *list, const karst_particle_group *groups, size_t num,
                              int voxel_log2_m, double time_s, karst_error *error);
void karst_particle_list_finish(karst_particle_list *list); /* a zeroed one is fine */
/* Moves the particles, and tells what changed, as karst_particle_list_differ. Errors: KARST_USAGE, KARST_FAILED; then
 * all is as it was. */
bool karst_particle_list_set_time(karst_particle_list *list, double time_s, karst_drop_box **boxes, size_t *num_boxes,
                                  karst_error *error);

/* Where two lists of one voxel differ: boxes for karst_store_drop, malloc'ed; NULL and 0: nowhere. Errors:
 * KARST_FAILED. */
#define KARST_PARTICLES_MOST_BOXES 64u
bool karst_particle_list_differ(const karst_particle_list *a, const karst_particle_list *b, karst_drop_box **boxes,
                                size_t *num_boxes, karst_error *error);

/* Extinction at a voxel's corner, as samples of a level have it: the bits of devices. */
float karst_particle_list_extinction(const karst_particle_list *list, const int64_t voxel[3], int level);
/* Optical depth of a ray, with no bricks: balls are met where they are, in double. `direction` has length 1. Errors:
 * KARST_FAILED (memory). */
bool karst_particle_list_depth(const karst_particle_list *list, const karst_position *from, const double direction[3],
                               double length_m, double *depth, karst_error *error);
/* The tree holds its particles. Errors: KARST_FAILED, with what is wrong. */
bool karst_particle_list_check(const karst_particle_list *list, karst_error *error);

#endif
