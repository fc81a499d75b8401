/* karst render --six-way: light maps of a world's media, for game engines. */
#include "command.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define PICTURES 8 /* that the library settles for the maps of one moment */

static const char *const map_names[2] = {"positive", "negative"};

/* The sheet that the maps of all moments are laid out on, row by row. */
static void find_sheet(const command_six_way *maps, int *columns, int *rows)
{
    *columns = (int)ceil(sqrt((double)maps->num));
    *rows = (int)((maps->num + (uint64_t)*columns - 1) / (uint64_t)*columns);
}

/* The file of a map; malloc'ed; NULL: out of memory. */
static char *name_of(const char *pattern, int map)
{
    const char *at = strstr(pattern, "%s");
    char *name = NULL;
    return asprintf(&name, "%.*s%s%s", (int)(at - pattern), pattern, map_names[map], at + 2) < 0 ? NULL : name;
}

static bool check_names(const command_six_way *maps, karst_error *error)
{
    const char *at = strchr(maps->pattern, '%');
    if (!at || at[1] != 's' || strchr(at + 1, '%') || !command_is_exr(maps->pattern))
        return karst_fail(error, KARST_USAGE,
                          "--six-way %s: two files are written, so name them with one %%s and .exr, such as "
                          "smoke_%%s.exr",
                          maps->pattern);
    for (int map = 0; map < 2; map++) {
        char *name = name_of(maps->pattern, map);
        const bool fine = name ? command_check_output(name, "--six-way", true, error)
                               : karst_fail(error, KARST_FAILED, "out of memory");
        free(name);
        if (!fine)
            return false;
    }
    return true;
}

bool command_six_way_check(const command_six_way *maps, karst_error *error)
{
    int columns, rows;
    if (maps->num > KARST_IMAGE_MAX_PX)
        return karst_fail(error, KARST_USAGE, "--frames %llu: %d are the most on one sheet",
                          (unsigned long long)maps->num, KARST_IMAGE_MAX_PX);
    find_sheet(maps, &columns, &rows);
    if (columns * (long)maps->size_px[0] > KARST_IMAGE_MAX_PX || rows * (long)maps->size_px[1] > KARST_IMAGE_MAX_PX)
        return karst_fail(error, KARST_USAGE,
                          "a sheet of %dx%d frames of %dx%d pixels: %d pixels a side are the most; give a smaller "
                          "--size or fewer --frames",
                          columns, rows, maps->size_px[0], maps->size_px[1], KARST_IMAGE_MAX_PX);
    return check_names(maps, error);
}

typedef struct {
    command_talk *talk;
    uint64_t index, num, num_frames, start_ns;
} run_state;

static bool note_frame(void *user, const karst_stats *stats)
{
    run_state *state = user;
    state->num_frames++;
    command_progress(state->talk, "moment %llu of %llu, %d pictures each   sample %u   %llu bricks   %.1f s",
                     (unsigned long long)state->index + 1, (unsigned long long)state->num, PICTURES, stats->num_samples,
                     (unsigned long long)stats->num_resident_bricks,
                     (double)(command_clock_ns() - state->start_ns) / 1e9);
    return !command_interrupted();
}

static bool write_sheet(const command_six_way *maps, int map, const float *sheet, int columns, int rows,
                        karst_error *error)
{
    const karst_image_channel channels[] = {{"R", sheet, 4}, {"G", sheet + 1, 4}, {"B", sheet + 2, 4},
                                            {"A", sheet + 3, 4}};
    char *name = name_of(maps->pattern, map);
    if (!name)
        return karst_fail(error, KARST_FAILED, "out of memory");
    command_hold_interrupts(true);
    const bool written = karst_image_write_channels(name, channels, 4, columns * maps->size_px[0],
                                                    rows * maps->size_px[1], error);
    command_hold_interrupts(false);
    free(name);
    return written;
}

/* One moment's maps into their places on the sheets. */
static void lay(const command_six_way *maps, const float *map, int columns, uint64_t index, float *sheet)
{
    const size_t width = (size_t)maps->size_px[0], height = (size_t)maps->size_px[1],
                 column = (size_t)(index % (uint64_t)columns), row = (size_t)(index / (uint64_t)columns);
    for (size_t y = 0; y < height; y++)
        memcpy(sheet + 4 * (((row * height + y) * (size_t)columns + column) * width), map + 4 * y * width,
               4 * width * sizeof *map);
}

bool command_six_way_run(karst_engine *engine, const command_six_way *maps, command_talk *talk, karst_error *error)
{
    int columns, rows;
    find_sheet(maps, &columns, &rows);
    const size_t num_values = 4 * (size_t)maps->size_px[0] * (size_t)maps->size_px[1],
                 num_all = num_values * (size_t)columns * (size_t)rows;
    run_state state = {.talk = talk, .num = maps->num, .start_ns = command_clock_ns()};
    float *map[2], *sheet[2];
    uint64_t num_settled = 0;
    for (int i = 0; i < 2; i++) {
        map[i] = malloc(num_values * sizeof **map);
        sheet[i] = calloc(num_all, sizeof **sheet);
    }
    bool done = (map[0] && map[1] && sheet[0] && sheet[1]) ||
                karst_fail(error, KARST_FAILED, "out of memory for a sheet of %dx%d frames", columns, rows);
    for (; done && state.index < state.num; state.index++) {
        bool settled = false;
        done = karst_engine_set_time(engine, maps->start_s + (double)state.index * maps->step_s, error) &&
               karst_engine_six_way(engine, maps->max_frames, note_frame, &state, map[0], map[1], num_values, &settled,
                                    error);
        if (done && command_interrupted())
            done = command_fail_interrupted(error, "interrupted after %llu of %llu moments; nothing was written",
                                            (unsigned long long)state.index, (unsigned long long)state.num);
        num_settled += settled;
        for (int i = 0; done && i < 2; i++)
            lay(maps, map[i], columns, state.index, sheet[i]);
    }
    command_end_progress(talk);
    for (int i = 0; done && i < 2; i++)
        done = write_sheet(maps, i, sheet[i], columns, rows, error);
    for (int i = 0; i < 2; i++) {
        free(map[i]);
        free(sheet[i]);
    }
    if (!done)
        return false;
    command_say(talk, "%s (positive, negative): %dx%d frames of %dx%d, %llu of %llu settled, in %.2f s", maps->pattern,
                columns, rows, maps->size_px[0], maps->size_px[1], (unsigned long long)num_settled,
                (unsigned long long)maps->num, (double)(command_clock_ns() - state.start_ns) / 1e9);
    return num_settled == maps->num ||
           karst_fail(error, KARST_FAILED, "not settled within %u frames: %s is written as it stands; raise "
                      "--frames-max", maps->max_frames, maps->pattern);
}
