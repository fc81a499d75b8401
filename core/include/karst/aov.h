/* What is known of each pixel of a picture beside its colour, for those who work on it further. */
#ifndef KARST_AOV_H
#define KARST_AOV_H

#include "karst/engine.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Names of files' channels follow the custom of the field: R, G, B; albedo.R; Z; N.X; P.X. */
typedef enum {
    KARST_AOV_RADIANCE, /* linear light before exposure and tone, the mean of all samples; R, G, B */
    KARST_AOV_ALBEDO,   /* linear; zeros where nothing is; albedo.R, albedo.G, albedo.B */
    KARST_AOV_DEPTH,    /* metres along the ray, infinite where nothing is; Z */
    KARST_AOV_NORMAL,   /* unit, world axes, zeros where nothing is; N.X, N.Y, N.Z */
    KARST_AOV_POSITION, /* metres in the world, as far as floats tell; zeros where nothing is; P.X, P.Y, P.Z */
    KARST_AOV_LEVEL,    /* of the brick that was hit: its voxels are 2^level finest ones wide; -1: nothing is; level */
    KARST_AOV_SAMPLES,  /* of the pixel; samples */
    KARST_AOV_SUMS,     /* radiance of all samples together, for karst_engine_set_sums; sum.R, sum.G, sum.B */
    KARST_AOV_OCCLUSION, /* how much of what a surface looks up to is open, 0 to 1; 1 where nothing is; only of an
                          * engine with karst_engine_config.occlusion; occlusion */
    KARST_AOV_OPENNESS, /* the same, bounded: how much is open at least, and at most, as the bricks prove it, and what
                         * KARST_AOV_OCCLUSION says of it, within these bounds. What they need that is not there is
                         * made first. Takes some 1 ms of a core a pixel; open.least, open.most, open.likely */
    KARST_NUM_AOVS
} karst_aov;

/* What a name says, such as "depth". Errors: KARST_USAGE listing the names. Thread-safe, as the next two are. */
bool karst_aov_parse(const char *name, karst_aov *aov, karst_error *error);
/* Floats a pixel: 1 or 3. */
int karst_aov_width(karst_aov aov);
/* Name of its channel 0 to width - 1. */
const char *karst_aov_channel(karst_aov aov, int channel);

/* Of the last frame, pixel by pixel, top row first. All but radiance, samples and sums are of rays through the pixels'
 * centres, which are cast again for that. Errors: KARST_USAGE (another number of values than width * height *
 * karst_aov_width; no frame yet; occlusion or openness of an engine without; radiance, sums or albedo of an engine that
 * keeps bytes only, see karst_engine_read_radiance), KARST_FAILED. */
bool karst_engine_read_aov(karst_engine *engine, karst_aov aov, float *values, size_t num_values, karst_error *error);

#ifdef __cplusplus
}
#endif
#endif
