/* Samples of TIFF files. */
#include <stdlib.h>
#include <string.h>
#include <tiffio.h>
#include <unistd.h>

#include "core/files/samples_internal.h"

/* What libtiff may allocate at once: more than any strip or tile of a file that is read. */
#define MOST_BYTES_AT_ONCE ((tmsize_t)256 << 20)

typedef struct {
    const karst_samples_reader *r;
    TIFF *tiff;
    char message[128];                 /* libtiff's first complaint */
    uint16_t bits, format, num_planes; /* num_planes: samples of a pixel, alpha too */
} tiff_state;

static int on_error(TIFF *tiff, void *user, const char *module, const char *format, va_list arguments)
{
    tiff_state *state = user;
    (void)tiff;
    (void)module;
    if (!*state->message)
        vsnprintf(state->message, sizeof state->message, format, arguments);
    return 1;
}
static int on_warning(TIFF *tiff, void *user, const char *module, const char *format, va_list arguments)
{
    (void)tiff;
    (void)user;
    (void)module;
    (void)format;
    (void)arguments;
    return 1;
}

/* Number i of a row, in the machine's order of bytes, as libtiff leaves it. */
static double number_at(const tiff_state *s, const unsigned char *row, size_t i)
{
    const karst_samples_form *form = s->r->form;
    const unsigned char *at = row + i * (s->bits / 8);
    float f;
    double d;
    uint16_t u16;
    uint32_t u32;
    switch (s->format << 8 | s->bits) {
    case SAMPLEFORMAT_UINT << 8 | 8:
        return karst_samples_scale(form, at[0], 255, 255);
    case SAMPLEFORMAT_UINT << 8 | 16:
        memcpy(&u16, at, sizeof u16);
        return karst_samples_scale(form, u16, 65535, 65535);
    case SAMPLEFORMAT_UINT << 8 | 32:
        memcpy(&u32, at, sizeof u32);
        return karst_samples_scale(form, u32, 4294967295.0, 4294967295.0);
    case SAMPLEFORMAT_INT << 8 | 8:
        return (int8_t)at[0];
    case SAMPLEFORMAT_INT << 8 | 16:
        memcpy(&u16, at, sizeof u16);
        return (int16_t)u16;
    case SAMPLEFORMAT_INT << 8 | 32:
        memcpy(&u32, at, sizeof u32);
        return (int32_t)u32;
    case SAMPLEFORMAT_IEEEFP << 8 | 32:
        memcpy(&f, at, sizeof f);
        return (double)f;
    default: /* 64 bits of IEEEFP */
        memcpy(&d, at, sizeof d);
        return d;
    }
}

static bool is_read(const tiff_state *s)
{
    return (s->format == SAMPLEFORMAT_UINT || s->format == SAMPLEFORMAT_INT)
               ? s->bits == 8 || s->bits == 16 || s->bits == 32
               : s->format == SAMPLEFORMAT_IEEEFP && (s->bits == 32 || s->bits == 64);
}

/* `count` pixels of a row, from (x, y) on; what lies beyond the right edge is left out. */
static void take(const tiff_state *s, const unsigned char *row, uint32_t x, uint32_t y, uint32_t count)
{
    karst_samples *to = s->r->samples;
    for (uint32_t i = 0; i < count && x + i < to->width; i++)
        for (uint32_t c = 0; c < to->num_channels; c++)
            to->values[((size_t)y * to->width + x + i) * to->num_channels + c] =
                (float)number_at(s, row, (size_t)i * s->num_planes + c);
}

static bool damaged(const tiff_state *s, uint32_t y)
{
    return karst_samples_fail(s->r, "this TIFF is damaged at row %u%s%s", y + 1, *s->message ? ": " : "", s->message);
}

static bool read_rows(tiff_state *s, unsigned char *row)
{
    for (uint32_t y = 0; y < s->r->samples->height; y++) {
        if (TIFFReadScanline(s->tiff, row, y, 0) < 0)
            return damaged(s, y);
        take(s, row, 0, y, s->r->samples->width);
        karst_samples_row_done(s->r, y);
    }
    return true;
}

static bool read_tiles(tiff_state *s, unsigned char *tile, uint32_t width, uint32_t height)
{
    const karst_samples *to = s->r->samples;
    const size_t row_bytes = (size_t)width * s->num_planes * (s->bits / 8);
    for (uint32_t y = 0; y < to->height; y += height) {
        for (uint32_t x = 0; x < to->width; x += width) {
            if (TIFFReadTile(s->tiff, tile, x, y, 0, 0) < 0)
                return damaged(s, y);
            for (uint32_t j = 0; j < height && y + j < to->height; j++)
                take(s, tile + j * row_bytes, x, y + j, width);
        }
        for (uint32_t j = 0; j < height && y + j < to->height; j++)
            karst_samples_row_done(s->r, y + j);
    }
    return true;
}

static bool decode(tiff_state *s)
{
    const karst_samples_reader *r = s->r;
    uint32_t width = 0, height = 0, tile_width = 0, tile_height = 0;
    uint16_t planar = PLANARCONFIG_CONTIG;
    TIFFGetField(s->tiff, TIFFTAG_IMAGEWIDTH, &width);
    TIFFGetField(s->tiff, TIFFTAG_IMAGELENGTH, &height);
    TIFFGetFieldDefaulted(s->tiff, TIFFTAG_BITSPERSAMPLE, &s->bits);
    TIFFGetFieldDefaulted(s->tiff, TIFFTAG_SAMPLEFORMAT, &s->format);
    TIFFGetFieldDefaulted(s->tiff, TIFFTAG_SAMPLESPERPIXEL, &s->num_planes);
    TIFFGetFieldDefaulted(s->tiff, TIFFTAG_PLANARCONFIG, &planar);
    if (!is_read(s))
        return karst_samples_fail(r, "samples of %u bits of this kind are not read: write 8, 16 or 32 bits, or floats",
                                  s->bits);
    if (s->num_planes < 1 || s->num_planes > 4 || (planar != PLANARCONFIG_CONTIG && s->num_planes > 1))
        return karst_samples_fail(r, "%u channels in this order are not read: write 1, or 3 one beside the other",
                                  s->num_planes);
    const bool is_tiled = TIFFIsTiled(s->tiff);
    if (is_tiled) {
        TIFFGetField(s->tiff, TIFFTAG_TILEWIDTH, &tile_width);
        TIFFGetField(s->tiff, TIFFTAG_TILELENGTH, &tile_height);
    }
    if (!karst_samples_begin(r, width, height, s->num_planes >= 3 ? 3 : 1))
        return false;
    const uint64_t pixel_bytes = (uint64_t)s->num_planes * (s->bits / 8);
    const uint64_t wanted = is_tiled ? (uint64_t)tile_width * tile_height * pixel_bytes : width * pixel_bytes;
    const tmsize_t size_bytes = is_tiled ? TIFFTileSize(s->tiff) : TIFFScanlineSize(s->tiff);
    if (size_bytes <= 0 || size_bytes > MOST_BYTES_AT_ONCE || (uint64_t)size_bytes != wanted)
        return karst_samples_fail(r, "its strips or tiles are of no size that is read");
    unsigned char *buffer = calloc(1, (size_t)size_bytes);
    if (!buffer)
        return karst_fail(r->error, KARST_FAILED, "out of memory");
    bool done = is_tiled ? read_tiles(s, buffer, tile_width, tile_height) : read_rows(s, buffer);
    free(buffer);
    r->samples->num_bits = s->format == SAMPLEFORMAT_IEEEFP ? 0 : s->bits;
    snprintf(r->samples->kind_text, sizeof r->samples->kind_text, "TIFF, %u bits%s", s->bits,
             s->format == SAMPLEFORMAT_IEEEFP ? " float" : "");
    return done;
}

bool karst_samples_read_tiff(const karst_samples_reader *r)
{
    tiff_state s = {.r = r};
    TIFFOpenOptions *options = TIFFOpenOptionsAlloc();
    if (!options)
        return karst_fail(r->error, KARST_FAILED, "out of memory");
    TIFFOpenOptionsSetMaxSingleMemAlloc(options, MOST_BYTES_AT_ONCE);
    TIFFOpenOptionsSetErrorHandlerExtR(options, on_error, &s);
    TIFFOpenOptionsSetWarningHandlerExtR(options, on_warning, &s);
    const int file = dup(fileno(r->file)); /* libtiff closes its own */
    /* m: pages of a file that is cut off meanwhile would be a bus error */
    s.tiff = file >= 0 ? TIFFFdOpenExt(file, r->path, "rm", options) : NULL;
    TIFFOpenOptionsFree(options);
    if (!s.tiff) {
        if (file >= 0)
            close(file);
        return karst_samples_fail(r, "this TIFF is damaged%s%s", *s.message ? ": " : "", s.message);
    }
    bool done = decode(&s);
    TIFFClose(s.tiff);
    return done;
}
