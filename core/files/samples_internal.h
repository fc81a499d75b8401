/* What the readers of samples share. */
#ifndef KARST_CORE_SAMPLES_INTERNAL_H
#define KARST_CORE_SAMPLES_INTERNAL_H

#include <stdio.h>

#include "core/files/samples.h"

/* A file being read. */
typedef struct {
    const char *path;
    FILE *file; /* at its beginning */
    uint64_t length_bytes;
    const karst_samples_form *form;
    karst_samples *samples;
    karst_error *error;
} karst_samples_reader;

/* Says what is wrong with the file, printf-like after its path. Returns false. */
bool karst_samples_fail(const karst_samples_reader *r, const char *format, ...) __attribute__((format(printf, 2, 3)));
/* Checks sizes and makes room. Pages are not touched before they are filled. */
bool karst_samples_begin(const karst_samples_reader *r, uint64_t width, uint64_t height, uint32_t num_channels);
/* A reader says that row y is done, so that memory stays bounded however many there are. */
#define KARST_SAMPLES_BETWEEN ((size_t)1 << 24) /* numbers */
void karst_samples_row_done(const karst_samples_reader *r, uint32_t y);
/* What a whole number from 0 to `most` becomes, where the file's own meaning is 0 to `own_high`. */
double karst_samples_scale(const karst_samples_form *form, double value, double most, double own_high);

bool karst_samples_read_png(const karst_samples_reader *r);
bool karst_samples_read_tiff(const karst_samples_reader *r);
bool karst_samples_read_exr(const karst_samples_reader *r);
bool karst_samples_read_raw(const karst_samples_reader *r);

#endif
