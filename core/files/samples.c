#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>

#include "core/files/samples_internal.h"

/* What splines and slopes of samples can still hold. */
#define MOST_MAGNITUDE 1e30f

static bool are_finite(const karst_samples_reader *r)
{
    const karst_samples *s = r->samples;
    const size_t in_row = (size_t)s->width * s->num_channels;
    for (size_t i = 0; i < in_row * s->height; i++) {
        if (i % KARST_SAMPLES_BETWEEN == 0)
            karst_samples_let_go(s);
        if (!(fabsf(s->values[i]) <= MOST_MAGNITUDE))
            return karst_samples_fail(
                r, "the sample in row %zu, column %zu is %s: fill what is missing, and keep to 1e30", i / in_row + 1,
                i % in_row / s->num_channels + 1, isnan(s->values[i]) ? "not a number" : "too large");
    }
    return true;
}

static bool read_any(const karst_samples_reader *r)
{
    unsigned char head[8] = {0};
    if (r->form->format)
        return karst_samples_read_raw(r);
    if (fread(head, 1, sizeof head, r->file) < 4 || fseek(r->file, 0, SEEK_SET))
        return karst_samples_fail(r, "it is empty, or cannot be read");
    if (!memcmp(head, "\x89PNG\r\n\x1a\n", 8))
        return karst_samples_read_png(r);
    if (!memcmp(head, "II*", 4) || !memcmp(head, "MM\0*", 4) || !memcmp(head, "II+", 4) || !memcmp(head, "MM\0+", 4))
        return karst_samples_read_tiff(r);
    if (!memcmp(head, "\x76\x2f\x31\x01", 4))
        return karst_samples_read_exr(r);
    return karst_samples_fail(r, "it is no PNG, TIFF or OpenEXR file; of raw numbers say \"format\" and \"shape\"");
}

bool karst_samples_read(const char *path, const karst_samples_form *form, karst_samples *samples, karst_error *error)
{
    struct stat status;
    karst_samples_reader r = {.path = path, .form = form, .samples = samples, .error = error};
    *samples = (karst_samples){0};
    /* a pipe would wait for whoever writes it */
    if (stat(path, &status) != 0)
        return karst_samples_fail(&r, "%s", strerror(errno));
    if (!S_ISREG(status.st_mode))
        return karst_samples_fail(&r, "this is no regular file");
    r.file = fopen(path, "rb");
    if (!r.file)
        return karst_samples_fail(&r, "%s", strerror(errno));
    r.length_bytes = (uint64_t)status.st_size;
    bool done = read_any(&r) && are_finite(&r);
    fclose(r.file);
    samples->kind = samples->kind_text;
    if (!done)
        karst_samples_finish(samples);
    return done;
}

void karst_samples_finish(karst_samples *samples)
{
    if (samples->mapped_bytes)
        munmap(samples->values, samples->mapped_bytes);
    else
        free(samples->values);
    *samples = (karst_samples){0};
}
