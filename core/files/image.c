/* Reading PNGs. */
#include "karst/image.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "core/files/image_decoder.h"

static _Noreturn void on_png_error(png_structp png, png_const_charp message)
{
    karst_png_decoder *decoder = png_get_error_ptr(png);
    snprintf(decoder->message, sizeof decoder->message, "%s", message);
    png_longjmp(png, 1);
}

static void on_png_warning(png_structp png, png_const_charp message)
{
    (void)png;
    (void)message;
}

/* These functions alone are jumped back into, and everything that must outlive a jump is behind pointers. */

static bool read_header(karst_png_decoder *decoder)
{
    if (setjmp(png_jmpbuf(decoder->png)))
        return false;
    png_init_io(decoder->png, decoder->file);
    png_set_user_limits(decoder->png, KARST_IMAGE_MAX_PX, KARST_IMAGE_MAX_PX);
    png_read_info(decoder->png, decoder->info);
    decoder->width_px = (int)png_get_image_width(decoder->png, decoder->info);
    decoder->height_px = (int)png_get_image_height(decoder->png, decoder->info);
    const int colour = png_get_color_type(decoder->png, decoder->info);
    if (png_get_bit_depth(decoder->png, decoder->info) != 8 ||
        (colour != PNG_COLOR_TYPE_RGB && colour != PNG_COLOR_TYPE_RGB_ALPHA))
        png_error(decoder->png, "not 8-bit RGB or RGBA");
    if (colour == PNG_COLOR_TYPE_RGB)
        png_set_filler(decoder->png, 0xFF, PNG_FILLER_AFTER);
    decoder->num_passes = png_set_interlace_handling(decoder->png);
    png_read_update_info(decoder->png, decoder->info);
    return true;
}

bool karst_png_open(karst_png_decoder *decoder, const char *path)
{
    decoder->file = fopen(path, "rb");
    if (!decoder->file) {
        snprintf(decoder->message, sizeof decoder->message, "%s", strerror(errno));
        return false;
    }
    decoder->png = png_create_read_struct(PNG_LIBPNG_VER_STRING, decoder, on_png_error, on_png_warning);
    decoder->info = decoder->png ? png_create_info_struct(decoder->png) : NULL;
    if (decoder->info)
        return read_header(decoder);
    snprintf(decoder->message, sizeof decoder->message,
             "libpng cannot start (out of memory, or built for another version)");
    return false;
}

bool karst_png_read(karst_png_decoder *decoder, uint8_t *rgba, int num_rows)
{
    if (setjmp(png_jmpbuf(decoder->png)))
        return false;
    for (int pass = 0; pass < decoder->num_passes; pass++)
        for (int y = 0; y < num_rows; y++)
            png_read_row(decoder->png, rgba + (size_t)y * (size_t)decoder->width_px * 4, NULL);
    decoder->num_rows += num_rows;
    if (decoder->num_rows == decoder->height_px)
        png_read_end(decoder->png, NULL);
    return true;
}

void karst_png_close(karst_png_decoder *decoder)
{
    if (decoder->png)
        png_destroy_read_struct(&decoder->png, &decoder->info, NULL);
    if (decoder->file)
        fclose(decoder->file);
    decoder->png = NULL;
    decoder->info = NULL;
    decoder->file = NULL;
}

uint8_t *karst_image_read_png(const char *path, int *width_px, int *height_px, karst_error *error)
{
    karst_png_decoder decoder = {0};
    uint8_t *rgba = NULL;
    bool done = karst_png_open(&decoder, path);
    if (done) {
        rgba = malloc((size_t)decoder.width_px * (size_t)decoder.height_px * 4);
        if (!rgba)
            karst_fail(error, KARST_FAILED, "cannot read %s: out of memory for %d x %d pixels", path, decoder.width_px,
                       decoder.height_px);
        done = rgba && karst_png_read(&decoder, rgba, decoder.height_px);
    }
    karst_png_close(&decoder);
    if (!done) {
        free(rgba);
        karst_fail(error, KARST_BAD_DATA, "cannot read %s: %s", path, decoder.message);
        return NULL;
    }
    *width_px = decoder.width_px;
    *height_px = decoder.height_px;
    return rgba;
}
