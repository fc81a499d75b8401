/* Maps of heights as files: 16-bit PNG, baseline TIFF, EXR. */
#include <errno.h>
#include <math.h>
#include <png.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "core/export/out_file.h"
#include "karst/image.h"
#include "karst/query.h"

typedef struct {
    const double *height_m;
    int width_px, height_px;
    double offset_m, step_m; /* metres = offset + step * value */
} map;

/* ---- values ---- */

static uint16_t value_of(const map *m, double height_m)
{
    if (isnan(height_m))
        return 0;
    return (uint16_t)fmin(fmax(rint((height_m - m->offset_m) / m->step_m), 1), 65535);
}

/* A row, most significant byte first. */
static void fill_row(const map *m, int row, uint8_t *bytes)
{
    for (int x = 0; x < m->width_px; x++) {
        const uint16_t value = value_of(m, m->height_m[(size_t)row * (size_t)m->width_px + (size_t)x]);
        bytes[2 * x] = (uint8_t)(value >> 8);
        bytes[2 * x + 1] = (uint8_t)value;
    }
}

static bool cannot_write(const char *path, const char *why, karst_error *error)
{
    return karst_fail(error, KARST_FAILED, "cannot write %s: %s", path, why);
}

/* ---- PNG ---- */

static _Noreturn void on_png_error(png_structp png, png_const_charp message)
{
    (void)message;
    png_longjmp(png, 1);
}

static void on_png_warning(png_structp png, png_const_charp message)
{
    (void)png;
    (void)message;
}

/* Only this function is jumped back into, and it changes no local variable after setjmp. */
static bool encode_png(FILE *file, const map *m, uint8_t *row, png_text *texts, int num_texts)
{
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, NULL, on_png_error, on_png_warning);
    png_infop info = png ? png_create_info_struct(png) : NULL;
    if (!info || setjmp(png_jmpbuf(png))) {
        png_destroy_write_struct(&png, &info);
        return false;
    }
    png_init_io(png, file);
    png_set_IHDR(png, info, (png_uint_32)m->width_px, (png_uint_32)m->height_px, 16, PNG_COLOR_TYPE_GRAY,
                 PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_set_text(png, info, texts, num_texts);
    png_write_info(png, info);
    for (int y = 0; y < m->height_px; y++) {
        fill_row(m, y, row);
        png_write_row(png, row);
    }
    png_write_end(png, NULL);
    png_destroy_write_struct(&png, &info);
    return true;
}

static bool write_png(const char *path, const map *m, uint8_t *row, karst_error *error)
{
    char offset[40], step[40];
    snprintf(offset, sizeof offset, "%.17g", m->offset_m);
    snprintf(step, sizeof step, "%.17g", m->step_m);
    char offset_key[] = "height_offset_m", step_key[] = "height_step_m";
    png_text texts[2] = {{.compression = PNG_TEXT_COMPRESSION_NONE, .key = offset_key, .text = offset},
                         {.compression = PNG_TEXT_COMPRESSION_NONE, .key = step_key, .text = step}};
    errno = 0;
    FILE *part = karst_out_part(path);
    if (!part)
        return cannot_write(path, strerror(errno), error);
    bool done = encode_png(part, m, row, texts, 2) && fflush(part) == 0;
    if (!done)
        cannot_write(path, errno ? strerror(errno) : "libpng failed", error);
    done = done && karst_out_assemble(path, "", 0, &part, 1, NULL, NULL, error);
    fclose(part);
    return done;
}

/* ---- TIFF ---- */

/* A header, one directory and one strip, most significant byte first: what every reader of TIFF 6.0 must know. */
enum { TIFF_ENTRIES = 11, TIFF_TEXT_BYTES = 128, TIFF_DIRECTORY = 8 };
enum { TIFF_TEXT = TIFF_DIRECTORY + 2 + 12 * TIFF_ENTRIES + 4, TIFF_PIXELS = TIFF_TEXT + TIFF_TEXT_BYTES };
enum { TIFF_SHORT = 3, TIFF_LONG = 4, TIFF_ASCII = 2 };

static uint8_t *put(uint8_t *to, uint32_t value, int num_bytes)
{
    for (int i = num_bytes - 1; i >= 0; i--)
        *to++ = (uint8_t)(value >> 8 * i);
    return to;
}

/* Short values stand in the upper half of their field. */
static uint8_t *put_entry(uint8_t *to, uint32_t tag, uint32_t type, uint32_t count, uint32_t value)
{
    to = put(put(put(to, tag, 2), type, 2), count, 4);
    return put(to, type == TIFF_SHORT ? value << 16 : value, 4);
}

static bool write_tiff(const char *path, const map *m, uint8_t *row, karst_error *error)
{
    uint8_t header[TIFF_PIXELS] = {'M', 'M', 0, 42, 0, 0, 0, TIFF_DIRECTORY}, *to = header + TIFF_DIRECTORY;
    const uint32_t width = (uint32_t)m->width_px, height = (uint32_t)m->height_px;
    char text[TIFF_TEXT_BYTES] = "";
    snprintf(text, sizeof text, "height_offset_m=%.17g height_step_m=%.17g no_land=0", m->offset_m, m->step_m);
    to = put(to, TIFF_ENTRIES, 2);
    to = put_entry(to, 256, TIFF_LONG, 1, width);
    to = put_entry(to, 257, TIFF_LONG, 1, height);
    to = put_entry(to, 258, TIFF_SHORT, 1, 16); /* bits */
    to = put_entry(to, 259, TIFF_SHORT, 1, 1);  /* as they are */
    to = put_entry(to, 262, TIFF_SHORT, 1, 1);  /* 0 is black */
    to = put_entry(to, 270, TIFF_ASCII, TIFF_TEXT_BYTES, TIFF_TEXT);
    to = put_entry(to, 273, TIFF_LONG, 1, TIFF_PIXELS);
    to = put_entry(to, 277, TIFF_SHORT, 1, 1); /* values of a pixel */
    to = put_entry(to, 278, TIFF_LONG, 1, height);
    to = put_entry(to, 279, TIFF_LONG, 1, 2 * width * height);
    to = put_entry(to, 339, TIFF_SHORT, 1, 1); /* not below 0 */
    memcpy(header + TIFF_TEXT, text, sizeof text);
    errno = 0;
    FILE *part = karst_out_part(path);
    bool done = part;
    for (int y = 0; y < m->height_px && done; y++) {
        fill_row(m, y, row);
        done = fwrite(row, 2, width, part) == width;
    }
    if (!done)
        cannot_write(path, strerror(errno ? errno : EIO), error);
    done = done && karst_out_assemble(path, header, sizeof header, &part, 1, NULL, NULL, error);
    if (part)
        fclose(part);
    return done;
}

/* ---- EXR ---- */

static bool write_exr(const char *path, const map *m, karst_error *error)
{
    const size_t num = (size_t)m->width_px * (size_t)m->height_px;
    float *values = malloc(num * sizeof *values);
    if (!values)
        return karst_fail(error, KARST_FAILED, "out of memory for %zu pixels", num);
    for (size_t i = 0; i < num; i++)
        values[i] = (float)m->height_m[i];
    const karst_image_channel channel = {"Y", values, 1};
    const bool done = karst_image_write_channels(path, &channel, 1, m->width_px, m->height_px, error);
    free(values);
    return done;
}

static bool ends_in(const char *path, const char *suffix)
{
    const size_t length = strlen(path), end = strlen(suffix);
    return length > end && strcasecmp(path + length - end, suffix) == 0;
}

bool karst_heights_write(const char *path, const double *height_m, int width_px, int height_px, double low_m,
                         double high_m, karst_error *error)
{
    if (width_px < 1 || height_px < 1 || width_px > KARST_IMAGE_MAX_PX || height_px > KARST_IMAGE_MAX_PX)
        return karst_fail(error, KARST_USAGE, "cannot write %s: a map of %d x %d pixels; each side must be 1 to %d",
                          path, width_px, height_px, KARST_IMAGE_MAX_PX);
    const bool is_tiff = ends_in(path, ".tif") || ends_in(path, ".tiff"), is_png = ends_in(path, ".png");
    const map m = {height_m, width_px, height_px, low_m - (high_m - low_m) / 65534, (high_m - low_m) / 65534};
    if (ends_in(path, ".exr"))
        return write_exr(path, &m, error);
    if (!is_tiff && !is_png)
        return karst_fail(error, KARST_USAGE, "%s: a map of heights is a .png or .tif of 16 bits, or an .exr", path);
    if (!(low_m < high_m) || !isfinite(high_m - low_m))
        return karst_fail(error, KARST_USAGE,
                          "cannot write %s: heights from %g to %g m: the first must be the lower one", path, low_m,
                          high_m);
    uint8_t *row = malloc(2 * (size_t)width_px);
    if (!row)
        return karst_fail(error, KARST_FAILED, "out of memory");
    const bool done = is_tiff ? write_tiff(path, &m, row, error) : write_png(path, &m, row, error);
    free(row);
    return done;
}
