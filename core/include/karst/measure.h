/* Measuring an engine: what its device can do at most, the floor of casting a picture, and who did what when. For
 * benchmarks; on shared and noisy machines only ratios of what was measured in turns mean much. */
#ifndef KARST_MEASURE_H
#define KARST_MEASURE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "karst/engine.h"
#include "karst/error.h"
#include "karst/stats.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ---- what the device can do ---- */

/* One measurement of each. */
typedef struct {
    double floor_ns;    /* the floor kernel for the engine's picture: for each ray, coherent as in 4x4 packets, 8
                         * dependent reads of a node table and 8 trilinear samples of a 16-bit brick; no skipping and
                         * no shading: what the memory traffic of a cast picture costs at least */
    double fma_per_s;   /* float multiply-adds, of all cores together */
    double bytes_per_s; /* copying between buffers that no cache holds: bytes read and written */
    double noise_per_s; /* samples of eight octaves of gradient noise, pointwise with nothing else, of all cores */
} karst_ceilings;

typedef struct karst_measure karst_measure;

/* Builds the kernels and their data (some 260 MiB, in the engine's account as "floor" and "measure") on the engine's
 * device, for its current picture size. With a driver that needs seconds to give built programs out (PoCL), this is
 * also when they are kept on disk for later processes, so that no measurement is disturbed. The engine outlives it.
 * Errors: KARST_FAILED. */
karst_measure *karst_measure_create(karst_engine *engine, karst_error *error);
void karst_measure_destroy(karst_measure *measure); /* NULL is fine */
/* Each runs what it measures once: call them a few times for nothing first, then in turns with what is to be compared.
 * The first does all but the floor, and leaves caches empty of whatever was there before; the second does floor_ns.
 * Errors: KARST_FAILED. */
bool karst_measure_ceilings(karst_measure *measure, karst_ceilings *ceilings, karst_error *error);
bool karst_measure_floor(karst_measure *measure, karst_ceilings *ceilings, karst_error *error);
/* Compute units of the device: cores, on a CPU. */
int karst_measure_num_cores(const karst_measure *measure);

/* Density samples of a brick as stored: what production is counted in. */
int karst_brick_num_samples(void);
/* How many different bricks the rays of the last frame's camera ended in, to compare with karst_stats.bricks.num_used.
 * Errors: KARST_FAILED. */
bool karst_engine_count_hit_bricks(karst_engine *engine, uint64_t *num_bricks, karst_error *error);

/* ---- who did what when ---- */

typedef enum { KARST_TRACK_HOST, KARST_TRACK_QUEUE, KARST_NUM_TRACKS } karst_track;

/* Something that took from start_ns to end_ns, on the clock of karst_clock. */
typedef struct {
    char name[48]; /* a kernel's, or a stage's */
    karst_track track;
    karst_stage stage;
    uint64_t start_ns, end_ns;
} karst_span;

/* Whether frames keep their spans from now on; costs little. Errors: KARST_FAILED (memory). */
bool karst_engine_set_tracing(karst_engine *engine, bool tracing, karst_error *error);
/* Those of the last frame: how many there are; up to max_spans of them are copied out. The queue's times are moved to
 * the host's clock where the device has one of its own. */
size_t karst_engine_spans(const karst_engine *engine, karst_span *spans, size_t max_spans);
/* Monotonic, ns. */
uint64_t karst_clock(void);

#ifdef __cplusplus
}
#endif
#endif
