/* Reading PNGs. */
#include "karst/image.h"

#include <errno.h>
#include <png.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* What libpng calls back with. */
typedef struct {
    FILE *file;
    char message[128]; /* libpng's own complaint */
} png_state;

static _Noreturn void on_png_error(png_structp png, png_const_charp message)
{
    png_state *state = png_get_error_ptr(png);
    snprintf(state->message, sizeof state->message, "%s", message);
    png_longjmp(png, 1);
}

static void on_png_warning(png_structp png, png_const_charp message)
{
    (void)png;
    (void)message;
}

/* A picture on its way in. */
typedef struct {
    uint8_t *rgba;
    png_bytep *rows;
    png_uint_32 width_px, height_px;
} png_picture;

/* Everything that must outlive a jump is behind pointers. */
static bool decode(png_state *state, png_picture *picture)
{
    png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, state, on_png_error, on_png_warning);
    png_infop info = png ? png_create_info_struct(png) : NULL;
    if (!info) {
        png_destroy_read_struct(&png, NULL, NULL);
        snprintf(state->message, sizeof state->message,
                 "libpng cannot start (out of memory, or built for another version)");
        return false;
    }
    if (setjmp(png_jmpbuf(png))) {
        png_destroy_read_struct(&png, &info, NULL);
        return false;
    }
    png_init_io(png, state->file);
    png_set_user_limits(png, KARST_IMAGE_MAX_PX, KARST_IMAGE_MAX_PX);
    png_read_info(png, info);
    picture->width_px = png_get_image_width(png, info);
    picture->height_px = png_get_image_height(png, info);
    int colour = png_get_color_type(png, info);
    if (png_get_bit_depth(png, info) != 8 || (colour != PNG_COLOR_TYPE_RGB && colour != PNG_COLOR_TYPE_RGB_ALPHA))
        png_error(png, "not 8-bit RGB or RGBA");
    if (colour == PNG_COLOR_TYPE_RGB)
        png_set_filler(png, 0xFF, PNG_FILLER_AFTER);
    png_set_interlace_handling(png);
    png_read_update_info(png, info);
    size_t row_bytes = (size_t)picture->width_px * 4;
    picture->rgba = malloc(row_bytes * picture->height_px);
    picture->rows = malloc(sizeof *picture->rows * picture->height_px);
    if (!picture->rgba || !picture->rows)
        png_error(png, "out of memory");
    for (png_uint_32 y = 0; y < picture->height_px; y++)
        picture->rows[y] = picture->rgba + row_bytes * y;
    png_read_image(png, picture->rows);
    png_read_end(png, NULL);
    png_destroy_read_struct(&png, &info, NULL);
    return true;
}

uint8_t *karst_image_read_png(const char *path, int *width_px, int *height_px, karst_error *error)
{
    FILE *file = fopen(path, "rb");
    if (!file) {
        karst_fail(error, KARST_BAD_DATA, "cannot read %s: %s", path, strerror(errno));
        return NULL;
    }
    png_state state = {.file = file};
    png_picture picture = {0};
    bool done = decode(&state, &picture);
    fclose(file);
    free(picture.rows);
    if (!done) {
        free(picture.rgba);
        karst_fail(error, KARST_BAD_DATA, "cannot read %s: %s", path, state.message);
        return NULL;
    }
    *width_px = (int)picture.width_px;
    *height_px = (int)picture.height_px;
    return picture.rgba;
}
