/* Many pictures: numbered PNGs or EXRs, or a video through ffmpeg. */
#include "command.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

extern char **environ;

#define MAX_DIGITS 20
#define FFMPEG "ffmpeg"

struct command_pictures {
    const char *output;
    int width_px, height_px;
    uint8_t *rgb; /* only for a video */
    char *temporary;
    pid_t ffmpeg;
    int input;  /* ffmpeg's */
    FILE *said; /* what ffmpeg says */
};

/* ---- names ---- */

/* What ffmpeg is to make of pictures, by the name's suffix. */
typedef struct {
    const char *suffix;
    bool is_even; /* both sides must be */
    const char *words[8];
} video_kind;
#define H264 {"-c:v", "libx264", "-crf", "16", "-pix_fmt", "yuv420p"}
static const video_kind video_kinds[] = {
    {".mp4", true, H264},
    {".mkv", true, H264},
    {".mov", true, H264},
    {".webm", true, {"-c:v", "libvpx-vp9", "-crf", "24", "-b:v", "0", "-pix_fmt", "yuv420p"}},
    /* A palette of the whole flight's colours. */
    {".gif", false, {"-vf", "split[a][b];[a]palettegen[p];[b][p]paletteuse"}},
};

static bool ends_in(const char *path, const char *suffix)
{
    size_t length = strlen(path), end = strlen(suffix);
    return length > end && strcasecmp(path + length - end, suffix) == 0;
}

static const video_kind *find_video_kind(const char *output)
{
    for (size_t i = 0; i < sizeof video_kinds / sizeof *video_kinds; i++)
        if (ends_in(output, video_kinds[i].suffix))
            return &video_kinds[i];
    return NULL;
}

bool command_pictures_is_video(const char *output) { return find_video_kind(output) != NULL; }

/* Finds the one %d, %5d or %05d of a pattern; its length, or 0. "%%" is not looked for: nobody wants it in a file's
 * name. */
static size_t find_number(const char *pattern, const char **at, int *digits)
{
    *at = strchr(pattern, '%');
    if (!*at || strchr(*at + 1, '%'))
        return 0;
    char *end;
    long wanted = strtol(*at + 1, &end, 10);
    if (*end != 'd' || wanted < 0 || wanted > MAX_DIGITS || (*at)[1] == '+' || (*at)[1] == ' ')
        return 0;
    *digits = (int)wanted;
    return (size_t)(end + 1 - *at);
}

char *command_picture_name(const char *pattern, size_t index)
{
    const char *at;
    int digits;
    char *name = NULL;
    size_t length = find_number(pattern, &at, &digits);
    int made = length ? asprintf(&name, "%.*s%0*zu%s", (int)(at - pattern), pattern, digits, index, at + length)
                      : asprintf(&name, "%s", pattern);
    return made < 0 ? NULL : name;
}

/* ---- checks ---- */

static bool has_program(const char *program)
{
    const char *folders = getenv("PATH");
    for (const char *folder = folders ? folders : "/usr/bin:/bin"; *folder;) {
        size_t length = strcspn(folder, ":");
        char *file = NULL;
        bool found = asprintf(&file, "%.*s/%s", (int)length, folder, program) >= 0 && access(file, X_OK) == 0;
        free(file);
        if (found)
            return true;
        folder += length + (folder[length] == ':');
    }
    return false;
}

static bool check_video(const char *output, int width_px, int height_px, karst_error *error)
{
    if (find_video_kind(output)->is_even && (width_px % 2 || height_px % 2))
        return karst_fail(error, KARST_USAGE, "%s: %dx%d, but both sides of a video must be even", output, width_px,
                          height_px);
    if (!has_program(FFMPEG))
        return karst_fail(error, KARST_FAILED,
                          "%s needs the program " FFMPEG ": install the package ffmpeg (apt-get install ffmpeg), or "
                          "write pictures with -o frames/%%05d.png",
                          output);
    return command_check_output(output, "-o", true, error);
}

bool command_check_picture(const char *path, karst_error *error)
{
    static const char *const others[] = {".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp", ".ppm", ".hdr", ".avi"};
    bool is_other = command_pictures_is_video(path);
    for (size_t i = 0; i < sizeof others / sizeof *others; i++)
        is_other = is_other || ends_in(path, others[i]);
    if (is_other)
        return karst_fail(error, KARST_USAGE, "-o %s: a picture is a .png, or an .exr with depth and normals%s", path,
                          command_pictures_is_video(path) ? "; a video (.mp4, .mkv, .mov, .webm, .gif) needs a --path"
                                                          : "");
    return true;
}

bool command_pictures_check(const char *output, bool only_one, int width_px, int height_px, karst_error *error)
{
    if (find_video_kind(output))
        return check_video(output, width_px, height_px, error);
    if (!command_check_picture(output, error))
        return false;
    const char *at;
    int digits;
    if (strcmp(output, "-") == 0 && !only_one)
        return karst_fail(error, KARST_USAGE,
                          "-o -: many pictures do not go through stdout; write to -o frames/%%05d.png or -o out.mp4");
    if (!find_number(output, &at, &digits) && (!only_one || strchr(output, '%')))
        return karst_fail(error, KARST_USAGE,
                          "-o %s: needs one number such as %%05d for many pictures, as in frames/%%05d.png; or name a "
                          "video, as in out.mp4, out.webm or out.gif",
                          output);
    char *first = command_picture_name(output, 0);
    bool writable =
        first ? command_check_output(first, "-o", true, error) : karst_fail(error, KARST_FAILED, "out of memory");
    free(first);
    return writable;
}

/* ---- ffmpeg ---- */

/* Starts it in a process group of its own: Ctrl-C is for us, who then clean up. */
static bool spawn(command_pictures *pictures, double fps, karst_error *error)
{
    char size[32], rate[32];
    snprintf(size, sizeof size, "%dx%d", pictures->width_px, pictures->height_px);
    snprintf(rate, sizeof rate, "%.9g", fps);
    const char *arguments[32] = {FFMPEG,       "-nostdin",    "-hide_banner",
                                 "-loglevel",  "error",       "-y",
                                 "-f",         "rawvideo",    "-pixel_format",
                                 "rgb24",      "-video_size", size,
                                 "-framerate", rate,          "-i",
                                 "pipe:0",     "-an"};
    const video_kind *kind = find_video_kind(pictures->output);
    size_t num = 0;
    while (arguments[num])
        num++;
    for (size_t i = 0; i < sizeof kind->words / sizeof *kind->words && kind->words[i]; i++)
        arguments[num++] = kind->words[i];
    arguments[num] = pictures->temporary;
    int ends[2];
    if (pipe2(ends, O_CLOEXEC) != 0)
        return karst_fail(error, KARST_FAILED, "cannot make a pipe: %s", strerror(errno));
    posix_spawn_file_actions_t actions;
    posix_spawnattr_t attributes;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[0], STDIN_FILENO);
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
    posix_spawn_file_actions_adddup2(&actions, fileno(pictures->said), STDERR_FILENO);
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
    int failure =
        posix_spawnp(&pictures->ffmpeg, FFMPEG, &actions, &attributes, (char *const *)(uintptr_t)arguments, environ);
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&actions);
    close(ends[0]);
    if (failure) {
        close(ends[1]);
        pictures->ffmpeg = 0;
        return karst_fail(error, KARST_FAILED, "cannot start " FFMPEG ": %s", strerror(failure));
    }
    pictures->input = ends[1];
    return true;
}

static bool start_video(command_pictures *pictures, double fps, karst_error *error)
{
    size_t num_pixels = (size_t)pictures->width_px * (size_t)pictures->height_px;
    pictures->rgb = malloc(num_pixels * 3);
    pictures->said = tmpfile();
    if (!pictures->rgb || !pictures->said)
        return karst_fail(error, KARST_FAILED, "cannot make a video: out of memory, or no temporary file");
    int fd = command_open_beside(pictures->output, find_video_kind(pictures->output)->suffix, &pictures->temporary);
    if (fd < 0)
        return karst_fail(error, KARST_FAILED, "cannot write %s: %s", pictures->output, strerror(errno));
    command_add_temporary(pictures->temporary);
    mode_t mask = umask(0);
    umask(mask);
    fchmod(fd, 0666 & ~mask);
    close(fd);
    return spawn(pictures, fps, error);
}

/* Waits for ffmpeg; *line is the last that it said. */
static bool wait_for_ffmpeg(command_pictures *pictures, char *line, size_t size_bytes)
{
    int status = -1;
    while (waitpid(pictures->ffmpeg, &status, 0) < 0 && errno == EINTR)
        continue;
    pictures->ffmpeg = 0;
    snprintf(line, size_bytes, "it said nothing");
    char said[300];
    rewind(pictures->said);
    while (fgets(said, sizeof said, pictures->said)) {
        said[strcspn(said, "\r\n")] = '\0';
        if (*said)
            snprintf(line, size_bytes, "%s", said);
    }
    return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

static bool add_to_video(command_pictures *pictures, const uint8_t *rgba, karst_error *error)
{
    size_t num_pixels = (size_t)pictures->width_px * (size_t)pictures->height_px;
    for (size_t i = 0; i < num_pixels; i++)
        memcpy(pictures->rgb + 3 * i, rgba + 4 * i, 3);
    if (command_write_all(pictures->input, pictures->rgb, num_pixels * 3))
        return true;
    char line[300];
    close(pictures->input);
    pictures->input = -1;
    wait_for_ffmpeg(pictures, line, sizeof line);
    return karst_fail(error, KARST_FAILED, FFMPEG " gave up: %s", line);
}

static bool finish_video(command_pictures *pictures, karst_error *error)
{
    char line[300];
    close(pictures->input);
    pictures->input = -1;
    if (!wait_for_ffmpeg(pictures, line, sizeof line))
        return karst_fail(error, KARST_FAILED, FFMPEG " failed: %s", line);
    if (rename(pictures->temporary, pictures->output) != 0)
        return karst_fail(error, KARST_FAILED, "cannot write %s: %s", pictures->output, strerror(errno));
    command_drop_temporary(pictures->temporary);
    free(pictures->temporary);
    pictures->temporary = NULL;
    return true;
}

/* ---- both ---- */

command_pictures *command_pictures_open(const char *output, int width_px, int height_px, double fps, karst_error *error)
{
    command_pictures *pictures = calloc(1, sizeof *pictures);
    if (!pictures) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    *pictures = (command_pictures){.output = output, .width_px = width_px, .height_px = height_px, .input = -1};
    if (find_video_kind(output) && !start_video(pictures, fps, error)) {
        command_pictures_discard(pictures);
        return NULL;
    }
    return pictures;
}

bool command_pictures_add(command_pictures *pictures, size_t index, karst_engine *engine, const uint8_t *rgba,
                          karst_error *error)
{
    if (pictures->rgb)
        return add_to_video(pictures, rgba, error);
    const command_exr plain = {0};
    char *name = command_picture_name(pictures->output, index);
    bool written =
        name ? command_write_picture(name, engine, rgba, pictures->width_px, pictures->height_px, &plain, error)
             : karst_fail(error, KARST_FAILED, "out of memory");
    free(name);
    return written;
}

void command_pictures_discard(command_pictures *pictures)
{
    if (!pictures)
        return;
    if (pictures->input >= 0)
        close(pictures->input);
    if (pictures->ffmpeg) {
        /* What it made is thrown away. */
        char line[300];
        kill(pictures->ffmpeg, SIGKILL);
        wait_for_ffmpeg(pictures, line, sizeof line);
    }
    if (pictures->temporary) {
        unlink(pictures->temporary);
        command_drop_temporary(pictures->temporary);
    }
    if (pictures->said)
        fclose(pictures->said);
    free(pictures->temporary);
    free(pictures->rgb);
    free(pictures);
}

bool command_pictures_finish(command_pictures *pictures, karst_error *error)
{
    bool finished = !pictures->rgb || finish_video(pictures, error);
    command_pictures_discard(pictures);
    return finished;
}
