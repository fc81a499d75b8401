#include "karst/image.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <png.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* Fixed, so that a picture's bytes do not hang on defaults. Of all pairs tried on a landscape this is the knee: level 6
 * takes 2.7 times as long for 1 % less, a filter chosen row by row 2.7 times as long for nothing. */
enum { COMPRESSION_LEVEL = 3, ROW_FILTER = PNG_FILTER_SUB };

/* What libpng calls back with. */
typedef struct {
    FILE *file;
    int write_errno;   /* first failure of a write */
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

static void write_bytes(png_structp png, png_bytep data, png_size_t length)
{
    png_state *state = png_get_io_ptr(png);
    if (fwrite(data, 1, length, state->file) != length) {
        state->write_errno = errno ? errno : EIO;
        png_error(png, "write failed");
    }
}

static void flush_bytes(png_structp png) { (void)png; }

/* Only this function is jumped back into, and it changes no local variable after setjmp. */
static bool encode(png_state *state, const uint8_t *rgba, int width_px, int height_px)
{
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, state, on_png_error, on_png_warning);
    png_infop info = png ? png_create_info_struct(png) : NULL;
    if (!info) {
        png_destroy_write_struct(&png, NULL);
        snprintf(state->message, sizeof state->message,
                 "libpng cannot start (out of memory, or built for another version)");
        return false;
    }
    if (setjmp(png_jmpbuf(png))) {
        png_destroy_write_struct(&png, &info);
        return false;
    }
    png_set_write_fn(png, state, write_bytes, flush_bytes);
    png_set_IHDR(png, info, (png_uint_32)width_px, (png_uint_32)height_px, 8, PNG_COLOR_TYPE_RGB, PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_set_compression_level(png, COMPRESSION_LEVEL);
    png_set_filter(png, PNG_FILTER_TYPE_BASE, ROW_FILTER);
    png_write_info(png, info);
    png_set_filler(png, 0, PNG_FILLER_AFTER); /* drops alpha */
    for (int y = 0; y < height_px; y++)
        png_write_row(png, rgba + (size_t)y * (size_t)width_px * 4);
    png_write_end(png, NULL);
    png_destroy_write_struct(&png, &info);
    return true;
}

static const char *reason_of(const png_state *state)
{
    return state->write_errno ? strerror(state->write_errno) : state->message;
}

/* Encodes into an open file and closes it. */
static bool write_and_close(FILE *file, const char *path, const uint8_t *rgba, int width_px, int height_px,
                            karst_error *error)
{
    png_state state = {.file = file};
    bool done = encode(&state, rgba, width_px, height_px);
    errno = 0;
    if (fclose(file) != 0 && done) {
        state.write_errno = errno ? errno : EIO;
        done = false;
    }
    if (!done)
        karst_fail(error, KARST_FAILED, "cannot write %s: %s", path, reason_of(&state));
    return done;
}

/* A new file in the folder of `path`; its name goes to `name`. NULL and errno if there can be none. */
static FILE *create_beside(const char *path, char *name, size_t name_bytes)
{
    static atomic_uint counter;
    const char *slash = strrchr(path, '/');
    int folder_length = slash ? (int)(slash - path + 1) : 0;
    for (int attempt = 0; attempt < 100; attempt++) {
        int length = snprintf(name, name_bytes, "%.*s.karst-%ld-%u.tmp", folder_length, path, (long)getpid(),
                              atomic_fetch_add(&counter, 1));
        if (length < 0 || (size_t)length >= name_bytes) {
            errno = ENAMETOOLONG;
            return NULL;
        }
        int fd = open(name, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
        if (fd >= 0) {
            FILE *file = fdopen(fd, "wb");
            if (!file) {
                int reason = errno;
                close(fd);
                unlink(name);
                errno = reason;
            }
            return file;
        }
        if (errno != EEXIST)
            return NULL;
    }
    return NULL;
}

bool karst_image_write_png(const char *path, const uint8_t *rgba, int width_px, int height_px, karst_error *error)
{
    if (width_px < 1 || height_px < 1 || width_px > KARST_IMAGE_MAX_PX || height_px > KARST_IMAGE_MAX_PX)
        return karst_fail(error, KARST_USAGE, "cannot write %s: a picture of %d x %d pixels; each side must be 1 to %d",
                          path, width_px, height_px, KARST_IMAGE_MAX_PX);
    struct stat status;
    bool exists = stat(path, &status) == 0;
    if (exists && !S_ISREG(status.st_mode) && !S_ISDIR(status.st_mode)) {
        /* A device or pipe (/dev/stdout) is written to, never replaced. */
        FILE *file = fopen(path, "wb");
        if (!file)
            return karst_fail(error, KARST_FAILED, "cannot write %s: %s", path, strerror(errno));
        return write_and_close(file, path, rgba, width_px, height_px, error);
    }
    if (exists && S_ISDIR(status.st_mode))
        return karst_fail(error, KARST_FAILED, "cannot write %s: %s", path, strerror(EISDIR));
    if (exists && access(path, W_OK) != 0)
        return karst_fail(error, KARST_FAILED, "cannot write %s: %s", path, strerror(errno));

    /* Through a symbolic link the file is replaced, not the link. */
    char real[PATH_MAX], temporary[PATH_MAX + 64];
    const char *target = exists && realpath(path, real) ? real : path;
    FILE *file = create_beside(target, temporary, sizeof temporary);
    if (!file)
        return karst_fail(error, KARST_FAILED, "cannot write %s: %s", path, strerror(errno));
    bool done = write_and_close(file, path, rgba, width_px, height_px, error);
    if (done && rename(temporary, target) != 0) {
        karst_fail(error, KARST_FAILED, "cannot write %s: %s", path, strerror(errno));
        done = false;
    }
    if (!done)
        unlink(temporary);
    return done;
}

/* A picture on its way in. */
typedef struct {
    uint8_t *rgba;
    png_bytep *rows;
    png_uint_32 width_px, height_px;
} png_picture;

/* As encode: everything that must outlive a jump is behind pointers. */
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
