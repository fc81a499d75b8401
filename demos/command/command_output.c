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

/* The values of one kind, and the channels that they are. */
static bool add_aov(karst_engine *engine, karst_aov aov, size_t num_pixels, float **values,
                    karst_image_channel *channels, int *num_channels, karst_error *error)
{
    const int width = karst_aov_width(aov);
    const size_t num_values = num_pixels * (size_t)width;
    *values = malloc(num_values * sizeof **values);
    if (!*values)
        return karst_fail(error, KARST_FAILED, "out of memory for %zu pixels", num_pixels);
    for (int i = 0; i < width; i++)
        channels[(*num_channels)++] = (karst_image_channel){karst_aov_channel(aov, i), *values + i, width};
    return karst_engine_read_aov(engine, aov, *values, num_values, error);
}

/* Without light (one sample, plain tone) the colours are those of the bytes. */
static bool write_exr(const char *path, karst_engine *engine, const uint8_t *rgba, int width_px, int height_px,
                      unsigned aovs, karst_error *error)
{
    const size_t num_pixels = (size_t)width_px * (size_t)height_px;
    karst_image_channel channels[KARST_IMAGE_MAX_CHANNELS];
    float *values[KARST_NUM_AOVS] = {NULL};
    int num_channels = 0;
    bool done = true;
    if (!aovs && !karst_engine_keeps_radiance(engine)) {
        done = add_aov(engine, KARST_AOV_DEPTH, num_pixels, &values[0], channels, &num_channels, error) &&
               add_aov(engine, KARST_AOV_NORMAL, num_pixels, &values[1], channels, &num_channels, error) &&
               karst_image_write_exr(path, rgba, values[0], values[1], width_px, height_px, error);
    } else {
        aovs = aovs ? aovs : 1u << KARST_AOV_RADIANCE | 1u << KARST_AOV_DEPTH | 1u << KARST_AOV_NORMAL;
        for (int i = 0; i < KARST_NUM_AOVS && done; i++)
            done = !(aovs >> i & 1) ||
                   add_aov(engine, (karst_aov)i, num_pixels, &values[i], channels, &num_channels, error);
        done = done && karst_image_write_channels(path, channels, num_channels, width_px, height_px, error);
    }
    for (int i = 0; i < KARST_NUM_AOVS; i++)
        free(values[i]);
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

static bool write_picture(const char *path, karst_engine *engine, const uint8_t *rgba, int width_px, int height_px,
                          unsigned aovs, karst_error *error)
{
    if (!is_stdout(path))
        return ends_in(path, ".exr") ? write_exr(path, engine, rgba, width_px, height_px, aovs, error)
                                     : karst_image_write_png(path, rgba, width_px, height_px, error);
    /* The library writes files; a pipe gets the bytes of one. */
    const char *folder = getenv("TMPDIR");
    char scratch[4096], picture[4200];
    snprintf(scratch, sizeof scratch, "%s/karst-XXXXXX", folder && *folder ? folder : "/tmp");
    if (!mkdtemp(scratch))
        return karst_fail(error, KARST_FAILED, "cannot make %s: %s; set TMPDIR", scratch, strerror(errno));
    snprintf(picture, sizeof picture, "%s/picture.png", scratch);
    bool written = karst_image_write_png(picture, rgba, width_px, height_px, error) && copy_to_stdout(picture, error);
    unlink(picture);
    rmdir(scratch);
    return written;
}

bool command_write_picture(const char *path, karst_engine *engine, const uint8_t *rgba, int width_px, int height_px,
                           unsigned aovs, karst_error *error)
{
    command_hold_interrupts(true);
    bool written = write_picture(path, engine, rgba, width_px, height_px, aovs, error);
    command_hold_interrupts(false);
    return written;
}
