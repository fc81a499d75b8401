/* Statistics: one plain struct, copied out. Times in ns, sizes in bytes, counts as num_. */
#ifndef KARST_STATS_H
#define KARST_STATS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* What a frame spends its time on. Names: karst_stage_name(). */
typedef enum {
    KARST_STAGE_CAST,
    KARST_STAGE_REFINE, /* hits moved to the true density; only with karst_engine_config.refine */
    KARST_STAGE_SHADE,
    KARST_STAGE_COLLECT,
    KARST_STAGE_SUBDIVIDE,
    KARST_STAGE_EVALUATE,
    KARST_STAGE_FINALISE,
    KARST_STAGE_DISPLAY,
    KARST_STAGE_MEDIA,     /* rays through what fills the air */
    KARST_STAGE_SUN_DEPTH, /* its depth towards the sun */
    KARST_NUM_STAGES
} karst_stage;
const char *karst_stage_name(karst_stage stage);

/* The streams of rays that make a picture. Names: karst_stream_name(). */
typedef enum {
    KARST_STREAM_PRIMARY, /* from the camera */
    KARST_STREAM_SHADOW,  /* to the sun, from what the others hit */
    KARST_STREAM_MIRROR,  /* mirrored by land; only with karst_engine_config.mirror */
    KARST_STREAM_CLEAR,   /* reflected and refracted by clear matter, and of a world with such mirrored by land */
    KARST_STREAM_OCCLUSION, /* how much light from all around comes in; only with karst_engine_config.occlusion */
    KARST_NUM_STREAMS
} karst_stream;
/* "primary", "shadow", "mirror", "clear", "occlusion"; "unknown" of other numbers. Static. Thread-safe. */
const char *karst_stream_name(karst_stream stream);

typedef struct {
    char name[32];
    uint64_t size_bytes;
} karst_stats_memory;

typedef struct {
    uint64_t num_used, num_total, size_bytes;
} karst_stats_pool;

/* What a store beside the land's has (clear matter, say): bricks as the land's; requests and bricks produced of this
 * frame, which count in the frame's own, too. */
#define KARST_STATS_MAX_STORES 3
typedef struct {
    char name[16];
    karst_stats_pool bricks;
    uint64_t num_resident_bricks, num_requests, num_produced;
} karst_stats_store;

/* What became of the photons that make caustics (karst_engine_config.caustics), of this view so far; with a budget in
 * ms, of the stage that is traced (docs/LIGHT.md). Energies are of all colours together, in units of a light's colour
 * times square metres of what it shines on; what is emitted is the sum of the others, to the last quantum. */
typedef struct {
    uint64_t num_photons; /* traced; all of them once the picture is settled */
    uint64_t num_landed;  /* on land, by way of mirrors or clear matter */
    double emitted;
    double deposited; /* of those */
    double direct;    /* on land that a light shines on without, which is shaded in other ways */
    double absorbed;  /* by clear matter */
    double escaped;   /* to where the view ends */
    double cut_off;   /* met more surfaces than photons may */
} karst_stats_caustics;

/* Models that the world shows as discs (docs/POINTS.md), all levels of them; zeros: none. */
typedef struct {
    uint64_t num_points; /* of the finest levels */
    uint64_t num_discs;  /* in leaves, copies included */
    uint64_t num_copies; /* in leaves that they touch beside the one that their centre lies in */
    uint64_t num_culled; /* copies that were left out, as no probe ray needed them */
    uint64_t num_leaves; /* that have discs */
    uint64_t size_bytes; /* of all that devices read of them */
} karst_stats_splats;

/* One frame, or the state after it. */
typedef struct {
    char device[128];
    uint32_t frame;                     /* counts frames of this engine */
    bool settled; /* this frame asked for nothing, produced nothing, evicted nothing, and its picture has all samples */
    uint32_t num_samples; /* of each pixel that this view has so far, all complete */
    uint64_t time_ns_frame;             /* wall clock of the frame */
    uint64_t time_ns_cpu; /* CPU time of this process over the cores meanwhile: on CPU devices what the frame takes on a
                           * machine that nobody else uses */
    uint64_t time_ns[KARST_NUM_STAGES]; /* device time, plus host time where the stage runs there */
    uint64_t time_ns_production; /* what production took, as a budget in ms counts it: on CPUs CPU time over the cores,
                                  * where that is less than time_ns */
    uint64_t time_ns_scouts; /* of the time for casting what rays took that only ask what to produce next, out of the
                              * same budget; CPU time over cores. CPUs with a budget in ms only */
    karst_stats_pool tiles, bricks;     /* used: stamped by the last cast; total: slots; bytes: what the pool takes */
    uint64_t num_resident_tiles, num_resident_bricks; /* slots that hold something, used or not */
    /* churn of this frame */
    uint64_t num_requests, num_produced, num_evicted, num_reproduced, num_deferred;
    uint64_t num_tiles_produced, num_bricks_produced, num_bricks_constant; /* constant: evaluated, then proven */
    uint64_t num_non_finite;                                               /* samples scrubbed to air so far */
    /* Samples of density so far: raised to show matter thinner than their voxel; and given up, where such matter may
     * be but was not found, so that it may be missing from the picture. */
    uint64_t num_thin_raised, num_thin_given_up;
    /* picture of this frame */
    uint64_t num_pixels, num_hits;
    uint64_t num_provisional; /* hits on stand-ins for what is missing; of mirrored rays, too, but num_hits at most */
    uint64_t num_incomplete;                 /* rays that met a region without data */
    uint64_t num_changed_pixels;             /* against the frame before; counted only if the engine was asked to */
    uint64_t num_rays[KARST_NUM_STREAMS];    /* of the picture; of paths, those that were drawn in this frame */
    uint64_t stream_ns[KARST_NUM_STREAMS];   /* device time for casting them, part of time_ns[KARST_STAGE_CAST] */
    uint64_t num_rays_cut; /* of those in clear matter, that met more surfaces than karst_engine_config.bounces */
    uint64_t num_coarser; /* hits on coarser levels than detail_asked_px stands for, for whatever reason */
    /* Pixels per voxel: as set, and as this frame's rays asked for. More than set where the pools do not hold the view,
     * or production is behind a budget in ms. */
    double detail_asked_px, detail_given_px;
    karst_stats_caustics caustics;
    size_t num_stores; /* beside the land's, of which `bricks` tells; 0 of most worlds */
    karst_stats_store stores[KARST_STATS_MAX_STORES];
    karst_stats_splats splats;
    size_t num_memory;
    karst_stats_memory memory[64]; /* by buffer name */
} karst_stats;

#ifdef __cplusplus
}
#endif
#endif
