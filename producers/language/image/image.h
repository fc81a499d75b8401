/* Images and fields: samples of a file made ready for kernels (ops/image_shared.h). */
#ifndef KARST_LANGUAGE_IMAGE_H
#define KARST_LANGUAGE_IMAGE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "karst/error.h"
#include "producers/language/image/image_file.h"
#include "producers/language/ops/image_shared.h"

/* How an image goes on beyond its edges: with what they have, again, or again and mirrored. */
typedef enum { KARST_WRAP_CLAMP, KARST_WRAP_REPEAT, KARST_WRAP_MIRROR } karst_wrap;

#define KARST_IMAGE_MOST_SIDE 32768u
/* Coefficients of one image, once it is mirrored or made a power of two wide: its data are then 2 GiB. */
#define KARST_IMAGE_MOST_SAMPLES ((size_t)1 << 28)
/* Most coefficients of images that become textures: 85 MiB. */
#define KARST_TEXTURE_MOST_SAMPLES ((size_t)1 << 22)
/* Data of more than that lie in a file (image_file.h). */
#define KARST_IMAGE_MOST_IN_MEMORY_BYTES ((size_t)512 << 20)
#define KARST_FIELD_MOST_SIDE 4096u
#define KARST_FIELD_MOST_SAMPLES ((size_t)1 << 25) /* data of 200 MiB */

/* Immutable: any number of threads may read it. */
typedef struct karst_samples_image {
    uint64_t *words;       /* a karst_image_header and what it points to; malloc'ed, or the file's */
    uint32_t num_words;    /* of a file whole pages */
    karst_image_file file; /* of a large image, else not open */
    uint32_t num_axes;     /* 2, or of a field 3 */
    uint32_t size[3];      /* coefficients of level 0 along each axis */
    uint32_t period[3];    /* samples after which it comes again; 0: it does not */
    float low, high;       /* of all values of all levels */
    uint64_t digest;       /* of all words */
    uint32_t bound_bytes;  /* of that for bounds */
} karst_samples_image;

/* The interpolating spline of width x height samples, finite and row by row, `stride` floats from one to the next, with
 * its pyramids. Sample i lies at the whole coordinate i along each axis; where the image repeats and its sides are no
 * powers of two, it is resampled, so that the number of samples along a side is image->size. Sides are 1 to
 * KARST_IMAGE_MOST_SIDE. Errors: KARST_FAILED (memory), KARST_BAD_DATA (too many samples). Thread-safe. Free with
 * karst_samples_image_finish. */
bool karst_samples_image_build(karst_samples_image *image, const float *samples, uint32_t width, uint32_t height,
                               uint32_t stride, karst_wrap wrap, karst_error *error);
/* Where an image's words may lie: in a file, and kept by that key (image_file.h), if they are more than so much. */
typedef struct {
    const char *key;
    size_t most_in_memory_bytes;
    karst_image_facts facts;          /* of the samples, to be kept */
    void (*let_go)(const void *user); /* NULL, or: pages of the samples that are in memory may go */
    const void *user;
} karst_image_room;
bool karst_samples_image_build_in(karst_samples_image *image, const karst_image_room *room, const float *samples,
                                  uint32_t width, uint32_t height, uint32_t stride, karst_wrap wrap,
                                  karst_error *error);
/* One that was kept; false: there is none. */
bool karst_samples_image_find(karst_samples_image *image, const char *key, karst_wrap wrap, karst_image_facts *facts);
/* The same of a field: size[0] samples in a row, size[1] rows in a plane, size[2] planes. */
bool karst_samples_field_build(karst_samples_image *image, const float *samples, const uint32_t size[3],
                               karst_wrap wrap, karst_error *error);
/* A texture of images that repeat and are alike but for their samples (image_shared.h), 1 to 3. Errors: KARST_FAILED
 * (memory). Thread-safe. Free with karst_samples_image_finish. */
bool karst_samples_image_pack(karst_samples_image *texture, const karst_samples_image *channels, uint32_t num_channels,
                              karst_error *error);
void karst_samples_image_finish(karst_samples_image *image); /* a zeroed one is fine */

/* At most how fast its value changes, per cell and in any direction. */
double karst_samples_image_steepness(const karst_samples_image *image);

#endif
