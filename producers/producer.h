/* The table of producers: what answers requests, whatever the content is made of.
 *
 * A producer turns work (cache/cache.h) into content in three steps: subdivide (a tile for each requested node:
 * localisation of its eight children, and their bounds), evaluate (samples into a brick), finalise (constant or not, by
 * proof; scale; slope of the interpolant; block mask). It writes only into the slots that the work names, which no ray
 * can reach yet. Not thread-safe. */
#ifndef KARST_PRODUCERS_PRODUCER_H
#define KARST_PRODUCERS_PRODUCER_H

#include "cache/cache.h"
#include "karst/position.h"

typedef struct karst_producer karst_producer;

/* What each kind of producer fills in. `self` is the producer. All enqueue on the context's queue and return at once.
 * load handles the loads [first, first + count) of the work, count at most karst_producer.max_chunk.
 * karst_producer_answer calls them in the right order. */
typedef struct {
    const char *kind; /* "density" */
    /* Writes tile_info (level, corner) and the eight nodes of each new tile: state air or solid (proven) or lost (wants
     * a brick), never unknown; without children or brick. */
    bool (*subdivide)(karst_producer *self, const karst_cache_buffers *cache, const karst_work *work,
                      karst_error *error);
    /* Evaluates the samples of each load and finalises them: encodes them into the slots, writes brick_info and
     * load_results. */
    bool (*load)(karst_producer *self, const karst_cache_buffers *cache, const karst_work *work, uint32_t first,
                 uint32_t count, karst_error *error);
    void (*destroy)(karst_producer *self);
} karst_producer_ops;

struct karst_producer {
    const karst_producer_ops *ops;
    const char *name;    /* of the world, for people */
    uint32_t max_chunk;  /* loads that it takes at a time */
    karst_buffer **data; /* device buffers that its kernels read (parameters); NULL-terminated, may be NULL */
};

/* Answers a round's work: subdivides, then evaluates and finalises chunk by chunk. Enqueues and returns at once. */
bool karst_producer_answer(karst_producer *producer, const karst_cache_buffers *cache, const karst_work *work,
                           karst_error *error);

/* A light beside the sun: as karst_header_light. */
typedef enum { KARST_WORLD_SUN, KARST_WORLD_POINT, KARST_WORLD_SPOT } karst_world_light_kind;
typedef struct {
    karst_world_light_kind kind;
    karst_position position;
    float colour[3];
    double azimuth_deg, elevation_deg, size_deg, radius_m, angle_deg, soft;
    bool shadow;
} karst_world_light;
#define KARST_WORLD_MAX_LIGHTS 16

/* How to look at a world. */
typedef struct {
    const char *name;
    const char *description;
    int voxel_log2_m; /* level-0 voxel = 2^this metres */
    uint32_t seed;    /* becomes -DWORLD_SEED */
    double view_distance_m;
    const char *camera; /* "X,Y,Z,YAW,PITCH,FOV" */
    double sun_azimuth_deg, sun_elevation_deg;
    float sky_zenith[3], sky_horizon[3], ground_flat[3], ground_steep[3]; /* linear RGB */
    double haze_distance_m; /* at which haze hides 1 - 1/e of the surface, where it is thickest */
    double haze_height_m;   /* in which it thins to 1/e, going up from y = 0; 0: it does not */
    bool has_exposure;
    double exposure_stops; /* of pictures, where it is said */
    double mirror;         /* the share of light that land mirrors */
    bool has_occlusion;    /* what stands around surfaces hides light from all around */
    bool has_light_map;    /* what comes from around is known beforehand */
    bool has_own_mirror;   /* its surfaces say so each for itself */
    bool has_transparency; /* and how much light passes them */
    bool has_sun_colour;
    float sun_colour[3];
    uint32_t num_lights;
    karst_world_light lights[KARST_WORLD_MAX_LIGHTS];
    bool has_air;          /* a medium fills the space outside matter */
    bool has_clear;        /* there is clear matter */
    double haze_globe_m;    /* radius of a globe round the origin from whose surface heights count; 0: none */
    bool has_atmosphere;    /* sky, haze and the sun's colour are those of raycast/light/atmosphere.h */
    double dust;            /* as there */
} karst_world_info;

void karst_producer_destroy(karst_producer *producer); /* NULL is fine */
/* Samples that were not finite and became air, since creation. Waits for the queue if anything was produced since the
 * last call. */
uint64_t karst_density_producer_non_finite(karst_producer *producer);
/* Samples so far that thin matter raised, and beside which it may be and was not found (steps/raise.clh). */
void karst_density_producer_thin(karst_producer *producer, uint64_t *num_raised, uint64_t *num_given_up);
/* Where the first of them lies: its level-0 voxel and the level of its brick. false if there was none. */
bool karst_density_producer_first_non_finite(karst_producer *producer, int64_t voxel[3], int *level);

#endif
