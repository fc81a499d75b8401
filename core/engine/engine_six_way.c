/* Light maps of media: see karst/maps.h. Each is read off a few pictures that show media alone; what they give off by
 * themselves is in all of these, and taken away. */
#include "karst/maps.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/engine/engine_parts.h"

/* The pictures: from six sides, in the order of the maps' channels; before a wall; by their own light. */
enum { NUM_SIDES = 6, BEFORE_WALL = NUM_SIDES, OWN_LIGHT, NUM_PICTURES };

typedef struct {
    uint32_t max_frames;
    bool (*progress)(void *user, const karst_stats *stats);
    void *user;
    bool is_over; /* the caller wanted an end */
} six_way_run;

static bool note_frame(void *user, const karst_stats *stats)
{
    six_way_run *run = user;
    run->is_over = run->progress && !run->progress(run->user, stats);
    return !run->is_over;
}

/* Where the light of a side comes from, seen by the camera. */
static void find_side(const karst_camera *camera, int side, float direction[3])
{
    double axes[3][3];
    karst_camera_axes(camera, axes[0], axes[1], axes[2]);
    for (int axis = 0; axis < 3; axis++) {
        axes[2][axis] = -axes[2][axis]; /* the front is what the camera sees of a thing */
        direction[axis] = (float)((side < 3 ? 1 : -1) * axes[side % 3][axis]);
    }
}

/* The mean of the channels, pixel by pixel. */
static bool draw(karst_engine *engine, six_way_run *run, int picture, float *rgb, float *grey, bool *settled,
                 karst_error *error)
{
    const size_t num_pixels = (size_t)engine->width_px * (size_t)engine->height_px;
    karst_engine_alone alone = {.is_on = true, .sun = picture < NUM_SIDES, .behind = picture == BEFORE_WALL};
    bool here = false;
    find_side(&engine->camera, picture < NUM_SIDES ? picture : 1, alone.sun_direction);
    engine->alone = alone;
    engine->view_changed = true;
    if (!karst_engine_settle(engine, run->max_frames, note_frame, run, &here, error) ||
        !karst_engine_read_radiance(engine, rgb, 3 * num_pixels, error))
        return false;
    *settled = *settled && here;
    for (size_t i = 0; i < num_pixels; i++)
        grey[i] = (rgb[3 * i] + rgb[3 * i + 1] + rgb[3 * i + 2]) / 3;
    return true;
}

/* Made anew, for what the engine shows now. */
static void show_alone(karst_engine *engine, bool is_on)
{
    engine->alone = (karst_engine_alone){.is_on = is_on};
    engine->media_of = NULL;
    engine->view_changed = true;
}

static void fill_maps(const float *grey, size_t num_pixels, float *positive, float *negative)
{
    for (size_t i = 0; i < num_pixels; i++) {
        const float own = grey[OWN_LIGHT * num_pixels + i];
        for (size_t side = 0; side < 3; side++) {
            positive[4 * i + side] = fmaxf(grey[side * num_pixels + i] - own, 0);
            negative[4 * i + side] = fmaxf(grey[(side + 3) * num_pixels + i] - own, 0);
        }
        positive[4 * i + 3] = fminf(fmaxf(1 - (grey[BEFORE_WALL * num_pixels + i] - own), 0), 1);
        negative[4 * i + 3] = own;
    }
}

bool karst_engine_six_way(karst_engine *engine, uint32_t max_frames,
                          bool (*progress)(void *user, const karst_stats *stats), void *user, float *positive,
                          float *negative, size_t num_values, bool *settled, karst_error *error)
{
    const size_t num_pixels = (size_t)engine->width_px * (size_t)engine->height_px;
    six_way_run run = {.max_frames = max_frames, .progress = progress, .user = user};
    *settled = false;
    if (!karst_engine_has_content(engine, KARST_CONTENT_AIR))
        return karst_fail(error, KARST_USAGE,
                          "%s has nothing in its air, so there is nothing to map: docs/WORLDS.md (Fog, clouds, smoke) "
                          "says how",
                          engine->shown.file->info.name);
    if (engine->integrator == KARST_INTEGRATOR_FULL)
        return karst_fail(error, KARST_USAGE, "full light knows no media: light maps need direct light");
    if (num_values != 4 * num_pixels)
        return karst_fail(error, KARST_USAGE, "a light map of %dx%d is %zu values, not %zu", engine->width_px,
                          engine->height_px, 4 * num_pixels, num_values);
    float *rgb = malloc(3 * num_pixels * sizeof *rgb), *grey = malloc(NUM_PICTURES * num_pixels * sizeof *grey);
    bool done = (rgb && grey) || karst_fail(error, KARST_FAILED, "out of memory for light maps of %dx%d",
                                            engine->width_px, engine->height_px);
    *settled = true;
    show_alone(engine, true);
    for (int picture = 0; done && picture < NUM_PICTURES && !run.is_over; picture++)
        done = draw(engine, &run, picture, rgb, grey + (size_t)picture * num_pixels, settled, error);
    show_alone(engine, false);
    *settled = *settled && done && !run.is_over;
    if (done && !run.is_over)
        fill_maps(grey, num_pixels, positive, negative);
    free(rgb);
    free(grey);
    return done;
}
