/* Samples of files of raw numbers. */
#include <stdlib.h>
#include <string.h>

#include "core/files/samples_internal.h"

static const struct {
    const char *name;
    uint32_t size_bytes;
} raw_formats[] = {{"uint8", 1}, {"uint16", 2}, {"int16", 2}, {"float32", 4}};

static double raw_number(const karst_samples_form *form, const char *name, const unsigned char *at)
{
    uint32_t bits = at[0];
    if (!strcmp(name, "uint8"))
        return karst_samples_scale(form, bits, 255, 255);
    bits |= (uint32_t)at[1] << 8;
    if (!strcmp(name, "uint16"))
        return karst_samples_scale(form, bits, 65535, 65535);
    if (!strcmp(name, "int16"))
        return (int16_t)bits;
    bits |= (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
    float value;
    memcpy(&value, &bits, sizeof value);
    return (double)value;
}

bool karst_samples_read_raw(const karst_samples_reader *r)
{
    const karst_samples_form *form = r->form;
    uint32_t size_bytes = 0;
    for (size_t i = 0; i < sizeof raw_formats / sizeof *raw_formats; i++)
        if (!strcmp(raw_formats[i].name, form->format))
            size_bytes = raw_formats[i].size_bytes;
    if (!size_bytes)
        return karst_samples_fail(r, "no raw numbers are called \"%.40s\": write uint8, uint16, int16 or float32",
                                  form->format);
    if (!karst_samples_begin(r, form->shape[0], form->shape[1], 1))
        return false;
    const uint64_t wanted = (uint64_t)form->shape[0] * form->shape[1] * size_bytes;
    if (r->length_bytes != wanted)
        return karst_samples_fail(r, "it has %llu bytes, and %u x %u numbers of %s are %llu",
                                  (unsigned long long)r->length_bytes, form->shape[0], form->shape[1], form->format,
                                  (unsigned long long)wanted);
    unsigned char *row = malloc((size_t)form->shape[0] * size_bytes);
    bool done = row || karst_fail(r->error, KARST_FAILED, "out of memory");
    for (size_t y = 0; done && y < form->shape[1]; y++) {
        done = fread(row, size_bytes, form->shape[0], r->file) == form->shape[0] ||
               karst_samples_fail(r, "row %zu cannot be read", y + 1);
        for (size_t x = 0; done && x < form->shape[0]; x++)
            r->samples->values[y * form->shape[0] + x] = (float)raw_number(form, form->format, row + x * size_bytes);
        karst_samples_row_done(r, (uint32_t)y);
    }
    free(row);
    snprintf(r->samples->kind_text, sizeof r->samples->kind_text, "raw %s", form->format);
    return done;
}
