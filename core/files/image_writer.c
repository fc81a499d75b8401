/* Files of pictures that appear whole or not at all, row by row. */
#include "core/files/image_writer.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

struct karst_image_writer {
    char *path;                    /* as it was given, for messages */
    char real[PATH_MAX];           /* what is replaced: through a symbolic link the file, not the link */
    char temporary[PATH_MAX + 64]; /* "": a device or pipe is written to directly */
    bool is_exr;
    int width_px, height_px, num_rows; /* that are written */
    karst_png_encoder png;
    karst_exr_encoder exr;
};

/* A name in the folder of `path` that no other file of this process has. */
static bool name_beside(const char *path, const char *suffix, char *name, size_t name_bytes)
{
    static atomic_uint counter;
    const char *slash = strrchr(path, '/');
    const int length = snprintf(name, name_bytes, "%.*s.karst-%ld-%u%s", slash ? (int)(slash - path + 1) : 0, path,
                                (long)getpid(), atomic_fetch_add(&counter, 1), suffix);
    if (length >= 0 && (size_t)length < name_bytes)
        return true;
    errno = ENAMETOOLONG;
    return false;
}

/* A new file there. NULL and errno if there can be none. */
static FILE *create_beside(const char *path, char *name, size_t name_bytes)
{
    for (int attempt = 0; attempt < 100 && name_beside(path, ".tmp", name, name_bytes); attempt++) {
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
            break;
    }
    *name = '\0';
    return NULL;
}

static bool fail_writing(const karst_image_writer *writer, const char *reason, karst_error *error)
{
    return karst_fail(error, KARST_FAILED, "cannot write %s: %s", writer->path, reason);
}

static bool fail_exr(const karst_image_writer *writer, exr_result_t code, karst_error *error)
{
    return fail_writing(writer, errno ? strerror(errno) : exr_get_default_error_message(code), error);
}

static karst_image_writer *make_writer(const char *path, int width_px, int height_px, karst_error *error)
{
    if (width_px < 1 || height_px < 1 || width_px > KARST_IMAGE_MAX_PX || height_px > KARST_IMAGE_MAX_PX) {
        karst_fail(error, KARST_USAGE, "cannot write %s: a picture of %d x %d pixels; each side must be 1 to %d", path,
                   width_px, height_px, KARST_IMAGE_MAX_PX);
        return NULL;
    }
    karst_image_writer *writer = calloc(1, sizeof *writer);
    char *copy = strdup(path);
    if (!writer || !copy) {
        free(writer);
        free(copy);
        karst_fail(error, KARST_FAILED, "cannot write %s: out of memory", path);
        return NULL;
    }
    writer->path = copy;
    writer->width_px = width_px;
    writer->height_px = height_px;
    return writer;
}

/* Where it is to be written, and whether it can be there. *is_file false: a device or pipe. */
static bool find_target(karst_image_writer *writer, bool *is_file, karst_error *error)
{
    struct stat status;
    const bool exists = stat(writer->path, &status) == 0;
    *is_file = !exists || S_ISREG(status.st_mode);
    if (exists && S_ISDIR(status.st_mode))
        return fail_writing(writer, strerror(EISDIR), error);
    if (exists && *is_file && access(writer->path, W_OK) != 0)
        return fail_writing(writer, strerror(errno), error);
    if (exists && *is_file && realpath(writer->path, writer->real))
        return true;
    if (strlen(writer->path) >= sizeof writer->real)
        return fail_writing(writer, strerror(ENAMETOOLONG), error);
    strcpy(writer->real, writer->path);
    return true;
}

karst_image_writer *karst_image_begin_png(const char *path, int width_px, int height_px, karst_error *error)
{
    karst_image_writer *writer = make_writer(path, width_px, height_px, error);
    bool is_file;
    if (!writer)
        return NULL;
    if (find_target(writer, &is_file, error)) {
        writer->png.file =
            is_file ? create_beside(writer->real, writer->temporary, sizeof writer->temporary) : fopen(path, "wb");
        if (!writer->png.file)
            fail_writing(writer, strerror(errno), error);
        else if (karst_png_begin(&writer->png, width_px, height_px))
            return writer;
        else
            fail_writing(writer, karst_png_reason(&writer->png), error);
    }
    karst_image_discard(writer);
    return NULL;
}

karst_image_writer *karst_image_begin_exr(const char *path, const char *const *names, int num_channels,
                                          const char *note, int width_px, int height_px, karst_error *error)
{
    if (num_channels < 1 || num_channels > KARST_IMAGE_MAX_CHANNELS) {
        karst_fail(error, KARST_USAGE, "%s: %d channels; there may be 1 to %d", path, num_channels,
                   KARST_IMAGE_MAX_CHANNELS);
        return NULL;
    }
    for (int i = 0; i < num_channels; i++)
        for (int j = 0; j < i; j++)
            if (strcmp(names[i], names[j]) == 0) {
                karst_fail(error, KARST_USAGE, "%s: two channels called %s", path, names[i]);
                return NULL;
            }
    karst_image_writer *writer = make_writer(path, width_px, height_px, error);
    bool is_file;
    if (!writer)
        return NULL;
    writer->is_exr = true;
    if (find_target(writer, &is_file, error)) {
        errno = 0;
        if (!is_file)
            fail_writing(writer, "it is not a regular file, which an .exr must be", error);
        else if (!name_beside(writer->real, ".exr.tmp", writer->temporary, sizeof writer->temporary))
            fail_writing(writer, strerror(errno), error);
        else {
            const exr_result_t code =
                karst_exr_begin(&writer->exr, writer->temporary, names, num_channels, note, width_px, height_px);
            if (code == EXR_ERR_SUCCESS)
                return writer;
            fail_exr(writer, code, error);
        }
    }
    karst_image_discard(writer);
    return NULL;
}

const char *karst_image_temporary(const karst_image_writer *writer) { return writer->temporary; }

static bool check_rows(const karst_image_writer *writer, bool is_exr, int num_rows, karst_error *error)
{
    if (writer->is_exr != is_exr)
        return karst_fail(error, KARST_USAGE, "%s: an OpenEXR file has channels, and a PNG bytes", writer->path);
    if (num_rows < 1 || num_rows > writer->height_px - writer->num_rows)
        return karst_fail(error, KARST_USAGE, "%s: %d rows after %d of %d", writer->path, num_rows, writer->num_rows,
                          writer->height_px);
    return true;
}

bool karst_image_add_bytes(karst_image_writer *writer, const uint8_t *rgba, int num_rows, karst_error *error)
{
    if (!check_rows(writer, false, num_rows, error))
        return false;
    if (!karst_png_rows(&writer->png, rgba, writer->width_px, num_rows))
        return fail_writing(writer, karst_png_reason(&writer->png), error);
    writer->num_rows += num_rows;
    return true;
}

bool karst_image_add_channels(karst_image_writer *writer, const karst_image_channel *channels, int num_channels,
                              int num_rows, karst_error *error)
{
    if (!check_rows(writer, true, num_rows, error))
        return false;
    if (num_rows % KARST_IMAGE_EXR_ROWS && writer->num_rows + num_rows < writer->height_px)
        return karst_fail(error, KARST_USAGE, "%s: %d rows, but the last of an OpenEXR file come by %d", writer->path,
                          num_rows, KARST_IMAGE_EXR_ROWS);
    errno = 0;
    const exr_result_t code =
        karst_exr_rows(&writer->exr, channels, num_channels, writer->width_px, writer->num_rows, num_rows);
    if (code == EXR_ERR_MISSING_REQ_ATTR)
        return karst_fail(error, KARST_USAGE, "%s: a channel of the file was not given", writer->path);
    if (code != EXR_ERR_SUCCESS)
        return fail_exr(writer, code, error);
    writer->num_rows += num_rows;
    return true;
}

static bool close_png(karst_image_writer *writer, karst_error *error)
{
    const bool done = karst_png_end(&writer->png);
    errno = 0;
    const int closed = fclose(writer->png.file);
    writer->png.file = NULL;
    if (!done)
        return fail_writing(writer, karst_png_reason(&writer->png), error);
    return closed == 0 || fail_writing(writer, strerror(errno ? errno : EIO), error);
}

bool karst_image_end(karst_image_writer *writer, karst_error *error)
{
    bool done =
        writer->num_rows == writer->height_px || karst_fail(error, KARST_USAGE, "%s: %d of %d rows were written",
                                                            writer->path, writer->num_rows, writer->height_px);
    if (done && writer->is_exr) {
        errno = 0;
        const exr_result_t code = karst_exr_end(&writer->exr);
        done = code == EXR_ERR_SUCCESS || fail_exr(writer, code, error);
    } else if (done) {
        done = close_png(writer, error);
    }
    if (done && *writer->temporary) {
        done = rename(writer->temporary, writer->real) == 0 || fail_writing(writer, strerror(errno), error);
        if (done)
            *writer->temporary = '\0';
    }
    karst_image_discard(writer);
    return done;
}

void karst_image_discard(karst_image_writer *writer)
{
    if (!writer)
        return;
    karst_png_drop(&writer->png);
    karst_exr_end(&writer->exr);
    if (writer->png.file)
        fclose(writer->png.file);
    if (*writer->temporary)
        unlink(writer->temporary);
    free(writer->path);
    free(writer);
}

bool karst_image_write_png(const char *path, const uint8_t *rgba, int width_px, int height_px, karst_error *error)
{
    karst_image_writer *writer = karst_image_begin_png(path, width_px, height_px, error);
    if (writer && karst_image_add_bytes(writer, rgba, height_px, error))
        return karst_image_end(writer, error);
    karst_image_discard(writer);
    return false;
}

bool karst_image_write_channels(const char *path, const karst_image_channel *channels, int num_channels, int width_px,
                                int height_px, karst_error *error)
{
    const char *names[KARST_IMAGE_MAX_CHANNELS];
    for (int i = 0; i < num_channels && i < KARST_IMAGE_MAX_CHANNELS; i++)
        names[i] = channels[i].name;
    karst_image_writer *writer = karst_image_begin_exr(path, names, num_channels, NULL, width_px, height_px, error);
    if (writer && karst_image_add_channels(writer, channels, num_channels, height_px, error))
        return karst_image_end(writer, error);
    karst_image_discard(writer);
    return false;
}

/* The transfer function of sRGB, backwards, for all bytes. */
void karst_image_make_linear(const uint8_t *rgba, size_t num_pixels, float *rgb)
{
    float table[256];
    for (int i = 0; i < 256; i++) {
        double s = i / 255.0;
        table[i] = (float)(s <= 0.04045 ? s / 12.92 : pow((s + 0.055) / 1.055, 2.4));
    }
    for (size_t i = 0; i < num_pixels; i++)
        for (int c = 0; c < 3; c++)
            rgb[3 * i + (size_t)c] = table[rgba[4 * i + (size_t)c]];
}

bool karst_image_write_exr(const char *path, const uint8_t *rgba, const float *depth_m, const float *normals,
                           int width_px, int height_px, karst_error *error)
{
    if (width_px < 1 || height_px < 1 || width_px > KARST_IMAGE_MAX_PX || height_px > KARST_IMAGE_MAX_PX)
        return karst_fail(error, KARST_USAGE, "%s: a picture of %d x %d pixels; each side must be 1 to %d", path,
                          width_px, height_px, KARST_IMAGE_MAX_PX);
    size_t num_pixels = (size_t)width_px * (size_t)height_px;
    float *rgb = malloc(3 * num_pixels * sizeof *rgb);
    if (!rgb)
        return karst_fail(error, KARST_FAILED, "cannot write %s: out of memory", path);
    karst_image_make_linear(rgba, num_pixels, rgb);
    karst_image_channel channels[7] = {{"R", rgb, 3}, {"G", rgb + 1, 3}, {"B", rgb + 2, 3}};
    int num_channels = 3;
    if (depth_m)
        channels[num_channels++] = (karst_image_channel){"Z", depth_m, 1};
    for (int axis = 0; normals && axis < 3; axis++) {
        static const char *const names[] = {"N.X", "N.Y", "N.Z"};
        channels[num_channels++] = (karst_image_channel){names[axis], normals + axis, 3};
    }
    bool done = karst_image_write_channels(path, channels, num_channels, width_px, height_px, error);
    free(rgb);
    return done;
}
