/* Files that appear whole or not at all. */
#include "command.h"

#include <errno.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

static bool is_stdout(const char *path) { return strcmp(path, "-") == 0; }

int command_open_beside(const char *path, const char *suffix, char **temporary)
{
    /* Its own name may be as long as the system allows: this one is not made of it. */
    const char *slash = strrchr(path, '/'), *name = slash ? slash + 1 : path;
    errno = strlen(name) > NAME_MAX ? ENAMETOOLONG : ENOMEM;
    if (strlen(name) > NAME_MAX || asprintf(temporary, "%.*s.karst-XXXXXX%s", (int)(name - path), path, suffix) < 0) {
        *temporary = NULL;
        return -1;
    }
    int fd = mkstemps(*temporary, (int)strlen(suffix));
    if (fd < 0) {
        free(*temporary);
        *temporary = NULL;
    }
    return fd;
}

bool command_check_output(const char *path, const char *option, bool binary, karst_error *error)
{
    if (!*path)
        return karst_fail(error, KARST_USAGE, "%s: which file? Its name is empty", option);
    if (is_stdout(path)) {
        if (!command_can_write_stdout())
            return karst_fail(error, KARST_FAILED, "%s -: stdout is closed; name a file", option);
        if (binary && isatty(STDOUT_FILENO))
            return karst_fail(error, KARST_USAGE, "%s -: stdout is a terminal; send it to a file or a pipe", option);
        return true;
    }
    struct stat info;
    if (stat(path, &info) == 0) {
        if (S_ISDIR(info.st_mode))
            return karst_fail(error, KARST_FAILED, "cannot write %s: it is a folder; name a file in it with %s", path,
                              option);
        if (!S_ISREG(info.st_mode))
            return karst_fail(error, KARST_FAILED, "cannot write %s: it is not a regular file; name another with %s",
                              path, option);
        if (access(path, W_OK) != 0)
            return karst_fail(error, KARST_FAILED, "cannot write %s: %s; name another with %s", path, strerror(errno),
                              option);
    }
    char *temporary;
    int fd = command_open_beside(path, "", &temporary);
    if (fd < 0 && errno == ENOENT)
        return karst_fail(error, KARST_FAILED,
                          "cannot write %s: its folder is not there; make it, or name another with %s", path, option);
    if (fd < 0)
        return karst_fail(error, KARST_FAILED, "cannot write %s: %s; name another with %s", path, strerror(errno),
                          option);
    close(fd);
    unlink(temporary);
    free(temporary);
    return true;
}

bool command_write_text(const char *path, const char *text, karst_error *error)
{
    if (is_stdout(path)) {
        if (fflush(stdout) != 0 || !command_write_all(STDOUT_FILENO, text, strlen(text)))
            return karst_fail(error, KARST_FAILED, "cannot write to stdout: %s", strerror(errno));
        return true;
    }
    char *temporary;
    int fd = command_open_beside(path, "", &temporary);
    if (fd < 0)
        return karst_fail(error, KARST_FAILED, "cannot write %s: %s", path, strerror(errno));
    mode_t mask = umask(0);
    umask(mask);
    bool written = command_write_all(fd, text, strlen(text)) && fchmod(fd, 0666 & ~mask) == 0;
    written = close(fd) == 0 && written && rename(temporary, path) == 0;
    if (!written) {
        karst_fail(error, KARST_FAILED, "cannot write %s: %s", path, strerror(errno));
        unlink(temporary);
    }
    free(temporary);
    return written;
}

/* Copies a file to stdout. */
static bool copy_to_stdout(const char *path, karst_error *error)
{
    FILE *file = fopen(path, "rb");
    if (!file)
        return karst_fail(error, KARST_FAILED, "cannot read %s: %s", path, strerror(errno));
    char buffer[65536];
    size_t size;
    bool copied = true;
    while (copied && (size = fread(buffer, 1, sizeof buffer, file)) > 0)
        copied = command_write_all(STDOUT_FILENO, buffer, size);
    if (!copied || ferror(file))
        karst_fail(error, KARST_FAILED, "cannot write to stdout: %s", strerror(errno));
    copied = copied && !ferror(file);
    fclose(file);
    return copied;
}

static bool ends_in(const char *path, const char *suffix)
{
    size_t length = strlen(path), end = strlen(suffix);
    return length > end && strcasecmp(path + length - end, suffix) == 0;
}

bool command_is_exr(const char *path) { return ends_in(path, ".exr"); }

/* ---- what an .exr has of a picture ---- */

/* Leaves of rows of width_px pixels those of a part (x, y, width, height) alone, in place. */
void command_crop(void *values, size_t pixel_bytes, int width_px, const int part_px[4])
{
    char *to = values;
    for (int y = 0; y < part_px[3]; y++, to += (size_t)part_px[2] * pixel_bytes)
        memmove(to, (char *)values + ((size_t)(part_px[1] + y) * (size_t)width_px + (size_t)part_px[0]) * pixel_bytes,
                (size_t)part_px[2] * pixel_bytes);
}

void command_layers_init(command_layers *layers, unsigned aovs, bool keeps_radiance)
{
    static const char *const colours[] = {"R", "G", "B"};
    *layers = (command_layers){.aovs = aovs};
    if (!aovs)
        layers->aovs = (keeps_radiance ? 1u << KARST_AOV_RADIANCE : 0) | 1u << KARST_AOV_DEPTH | 1u << KARST_AOV_NORMAL;
    layers->has_bytes = !aovs && !keeps_radiance;
    for (int i = 0; i < 3 && layers->has_bytes; i++)
        layers->names[layers->num_channels++] = colours[i];
    for (int aov = 0; aov < KARST_NUM_AOVS; aov++)
        for (int i = 0; (layers->aovs >> aov & 1) && i < karst_aov_width((karst_aov)aov); i++)
            layers->names[layers->num_channels++] = karst_aov_channel((karst_aov)aov, i);
}

/* Values of one kind of the part, and the channels that they are; they are read by `aov`, or made of `rgba`. */
static bool add_layer(command_layers *layers, karst_engine *engine, int aov, const uint8_t *rgba, const int drawn_px[2],
                      const int part_px[4], karst_error *error)
{
    const size_t num_pixels = (size_t)drawn_px[0] * (size_t)drawn_px[1];
    const int width = rgba ? 3 : karst_aov_width((karst_aov)aov);
    float *values = malloc(num_pixels * (size_t)width * sizeof *values);
    if (!values)
        return karst_fail(error, KARST_FAILED, "out of memory for %zu pixels", num_pixels);
    layers->values[layers->num_values++] = values;
    if (rgba)
        karst_image_make_linear(rgba, num_pixels, values);
    else if (!karst_engine_read_aov(engine, (karst_aov)aov, values, num_pixels * (size_t)width, error))
        return false;
    command_crop(values, (size_t)width * sizeof *values, drawn_px[0], part_px);
    for (int i = 0; i < width; i++, layers->num_filled++)
        layers->channels[layers->num_filled] =
            (karst_image_channel){layers->names[layers->num_filled], values + i, width};
    return true;
}

bool command_layers_read(command_layers *layers, karst_engine *engine, const uint8_t *rgba, const int drawn_px[2],
                         const int part_px[4], karst_error *error)
{
    command_layers_free(layers);
    bool done = !layers->has_bytes || add_layer(layers, engine, 0, rgba, drawn_px, part_px, error);
    for (int aov = 0; aov < KARST_NUM_AOVS && done; aov++)
        done = !(layers->aovs >> aov & 1) || add_layer(layers, engine, aov, NULL, drawn_px, part_px, error);
    return done;
}

void command_layers_free(command_layers *layers)
{
    for (int i = 0; i < layers->num_values; i++)
        free(layers->values[i]);
    layers->num_values = layers->num_filled = 0;
}

/* Without light (one sample, plain tone) the colours are those of the bytes. */
static bool write_exr(const char *path, karst_engine *engine, const uint8_t *rgba, const int size_px[2],
                      const command_exr *exr, karst_error *error)
{
    const int whole_px[4] = {0, 0, size_px[0], size_px[1]};
    command_layers layers;
    command_layers_init(&layers, exr->aovs, karst_engine_keeps_radiance(engine));
    karst_image_writer *writer = NULL;
    bool done = command_layers_read(&layers, engine, rgba, size_px, whole_px, error) &&
                (writer = karst_image_begin_exr(path, layers.names, layers.num_channels, exr->note, size_px[0],
                                                size_px[1], error)) != NULL &&
                karst_image_add_channels(writer, layers.channels, layers.num_channels, size_px[1], error);
    if (done)
        done = karst_image_end(writer, error);
    else
        karst_image_discard(writer);
    command_layers_free(&layers);
    return done;
}

bool command_parse_aovs(const char *text, unsigned *aovs, karst_error *error)
{
    *aovs = 0;
    while (*text) {
        char name[48];
        karst_aov aov;
        size_t length = strcspn(text, ",");
        snprintf(name, sizeof name, "%.*s", (int)(length < 47 ? length : 47), text);
        if (!karst_aov_parse(name, &aov, error))
            return false;
        *aovs |= 1u << aov;
        text += length + (text[length] == ',');
    }
    return *aovs || karst_fail(error, KARST_USAGE, "--aov: which? For example --aov radiance,depth,normal");
}

bool command_begin_stdout(char *picture, size_t size_bytes, karst_error *error)
{
    const char *folder = getenv("TMPDIR");
    char scratch[4096];
    snprintf(scratch, sizeof scratch, "%s/karst-XXXXXX", folder && *folder ? folder : "/tmp");
    if (!mkdtemp(scratch))
        return karst_fail(error, KARST_FAILED, "cannot make %s: %s; set TMPDIR", scratch, strerror(errno));
    snprintf(picture, size_bytes, "%s/picture.png", scratch);
    return true;
}

bool command_end_stdout(char *picture, bool written, karst_error *error)
{
    written = written && copy_to_stdout(picture, error);
    unlink(picture);
    *strrchr(picture, '/') = '\0';
    rmdir(picture);
    return written;
}

static bool write_picture(const char *path, karst_engine *engine, const uint8_t *rgba, int width_px, int height_px,
                          const command_exr *exr, karst_error *error)
{
    const int size_px[2] = {width_px, height_px};
    char picture[4200];
    if (!is_stdout(path))
        return command_is_exr(path) ? write_exr(path, engine, rgba, size_px, exr, error)
                                    : karst_image_write_png(path, rgba, width_px, height_px, error);
    return command_begin_stdout(picture, sizeof picture, error) &&
           command_end_stdout(picture, karst_image_write_png(picture, rgba, width_px, height_px, error), error);
}

bool command_write_picture(const char *path, karst_engine *engine, const uint8_t *rgba, int width_px, int height_px,
                           const command_exr *exr, karst_error *error)
{
    command_hold_interrupts(true);
    bool written = write_picture(path, engine, rgba, width_px, height_px, exr, error);
    command_hold_interrupts(false);
    return written;
}
