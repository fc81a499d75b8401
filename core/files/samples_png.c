/* Samples of PNG files. */
#include <math.h>
#include <png.h>
#include <stdlib.h>
#include <string.h>

#include "core/files/samples_internal.h"

/* What libpng calls back with, and what its way out must not lose. */
typedef struct {
    const karst_samples_reader *r;
    char message[128];
    unsigned char *row;
    uint32_t y;
} png_state;

static _Noreturn void on_error(png_structp png, png_const_charp message)
{
    png_state *state = png_get_error_ptr(png);
    snprintf(state->message, sizeof state->message, "%s", message);
    png_longjmp(png, 1);
}
static void on_warning(png_structp png, png_const_charp message)
{
    (void)png;
    (void)message;
}

static double from_srgb(double s) { return s <= 0.04045 ? s / 12.92 : pow((s + 0.055) / 1.055, 2.4); }

static void take_row(const png_state *state, int bits, const float table[256])
{
    const karst_samples_reader *r = state->r;
    const size_t count = (size_t)r->samples->width * r->samples->num_channels;
    float *to = r->samples->values + state->y * count;
    for (size_t i = 0; i < count; i++)
        to[i] = bits == 8
                    ? table[state->row[i]]
                    : (float)karst_samples_scale(r->form, state->row[2 * i] << 8 | state->row[2 * i + 1], 65535, 1);
}

static bool refuse(const karst_samples_reader *r, png_structp png, png_infop info)
{
    if (png_get_interlace_type(png, info) != PNG_INTERLACE_NONE)
        return !karst_samples_fail(r, "it is interlaced: save it without that");
    return false;
}

/* Everything between setjmp and its end; false: a message was given. */
static bool decode(png_structp png, png_infop info, png_state *state)
{
    const karst_samples_reader *r = state->r;
    float table[256];
    png_init_io(png, r->file);
    png_set_user_limits(png, KARST_SAMPLES_MOST_SIDE, KARST_SAMPLES_MOST_SIDE);
    png_read_info(png, info);
    if (refuse(r, png, info))
        return false;
    png_set_expand(png);
    png_set_strip_alpha(png);
    png_read_update_info(png, info);
    const int bits = png_get_bit_depth(png, info), channels = png_get_channels(png, info);
    if (channels != 1 && channels != 3)
        return karst_samples_fail(r, "it has %d channels", channels);
    for (int i = 0; i < 256; i++)
        table[i] = (float)(channels == 3 && !r->form->has_range ? from_srgb(i / 255.0)
                                                                : karst_samples_scale(r->form, i, 255, 1));
    if (!karst_samples_begin(r, png_get_image_width(png, info), png_get_image_height(png, info), (uint32_t)channels))
        return false;
    state->row = malloc(png_get_rowbytes(png, info));
    if (!state->row)
        return karst_fail(r->error, KARST_FAILED, "out of memory");
    for (; state->y < r->samples->height; state->y++) {
        png_read_row(png, state->row, NULL);
        take_row(state, bits, table);
        karst_samples_row_done(r, state->y);
    }
    r->samples->num_bits = (uint32_t)bits;
    snprintf(r->samples->kind_text, sizeof r->samples->kind_text, "PNG, %d bits", bits);
    return true;
}

bool karst_samples_read_png(const karst_samples_reader *r)
{
    png_state state = {.r = r};
    png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &state, on_error, on_warning);
    png_infop info = png ? png_create_info_struct(png) : NULL;
    bool done = false;
    if (!info)
        karst_fail(r->error, KARST_FAILED, "libpng cannot start");
    else if (setjmp(png_jmpbuf(png)))
        karst_samples_fail(r, "this PNG is damaged%s%u: %s", state.row ? " at row " : ", row ", state.y + 1,
                           state.message);
    else
        done = decode(png, info, &state);
    png_destroy_read_struct(&png, &info, NULL);
    free(state.row);
    return done;
}
