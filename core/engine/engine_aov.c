/* What is known of a picture's pixels: see karst/aov.h. */
#include "karst/aov.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/engine/engine_parts.h"
#include "karst/view.h"

static const struct {
    const char *name, *channels[3];
} aovs[KARST_NUM_AOVS] = {
    [KARST_AOV_RADIANCE] = {"radiance", {"R", "G", "B"}},
    [KARST_AOV_ALBEDO] = {"albedo", {"albedo.R", "albedo.G", "albedo.B"}},
    [KARST_AOV_DEPTH] = {"depth", {"Z", NULL, NULL}},
    [KARST_AOV_NORMAL] = {"normal", {"N.X", "N.Y", "N.Z"}},
    [KARST_AOV_POSITION] = {"position", {"P.X", "P.Y", "P.Z"}},
    [KARST_AOV_LEVEL] = {"level", {"level", NULL, NULL}},
    [KARST_AOV_SAMPLES] = {"samples", {"samples", NULL, NULL}},
    [KARST_AOV_SUMS] = {"sums", {"sum.R", "sum.G", "sum.B"}},
    [KARST_AOV_OCCLUSION] = {"occlusion", {"occlusion", NULL, NULL}},
    [KARST_AOV_OPENNESS] = {"openness", {"open.least", "open.most", "open.likely"}},
};

bool karst_aov_parse(const char *name, karst_aov *aov, karst_error *error)
{
    char names[160] = "";
    for (int i = 0; i < KARST_NUM_AOVS; i++) {
        if (strcmp(name, aovs[i].name) == 0) {
            *aov = (karst_aov)i;
            return true;
        }
        size_t length = strlen(names);
        snprintf(names + length, sizeof names - length, "%s%s", i ? ", " : "", aovs[i].name);
    }
    return karst_fail(error, KARST_USAGE, "nothing of a pixel is called '%.40s'; there are: %s", name, names);
}

int karst_aov_width(karst_aov aov) { return aovs[aov].channels[1] ? 3 : 1; }
const char *karst_aov_channel(karst_aov aov, int channel) { return aovs[aov].channels[channel]; }

bool karst_engine_centre_hits(karst_engine *engine, karst_error *error)
{
    karst_cast_view view;
    karst_pinhole pinhole;
    const karst_camera camera = engine->camera;
    if (!engine->sample)
        return true;
    engine->sample = 0;
    engine->camera = engine->drawn;
    karst_engine_picture_view(engine, &view, &pinhole);
    engine->camera = camera;
    return karst_cast_pinhole(engine->caster, &view, &pinhole, engine->hits, error) &&
           karst_engine_refine(engine, &view, &pinhole, error);
}

/* Shaded in light that shows the albedo alone: as bright from everywhere, without sun and haze. */
bool karst_engine_read_albedo(karst_engine *engine, float *rgb, karst_error *error)
{
    karst_light light = {.sun_direction = {0, 1, 0, 1},
                         .sky_zenith = {1, 1, 1},
                         .sky_horizon = {1, 1, 1},
                         .ground_flat = {1, 1, 1},
                         .ground_steep = {1, 1, 1},
                         .haze_distance = 1e30f};
    karst_cast_view view;
    karst_pinhole pinhole;
    const size_t num = (size_t)engine->width_px * (size_t)engine->height_px;
    const uint32_t width = (uint32_t)engine->width_px, height = (uint32_t)engine->height_px;
    if (!engine->radiance)
        return karst_fail(error, KARST_USAGE, "an engine of one sample and plain tone keeps bytes, not colours");
    const bool coloured = engine->shown.file->code.colour_source != NULL;
    karst_engine_picture_view(engine, &view, &pinhole);
    karst_shader_set_anchor(engine->shader, &engine->drawn.position);
    karst_shader_set_skies(engine->shader, NULL); /* no air before the albedo either */
    /* Of a world without colours, the kernel says how much is painted and what; the rest is the host's. */
    const bool lays_paint = (engine->colours || engine->shown.splats) && !coloured;
    engine->held_sample = 0; /* shading takes the place of its light */
    float *painted = calloc(lays_paint ? 3 * num : 1, sizeof *painted);
    float *planes = malloc(3 * num * sizeof *planes), *normals = malloc(3 * num * sizeof *normals);
    karst_hit *hits = malloc(num * sizeof *hits);
    bool done = (planes && normals && hits && painted) || karst_fail(error, KARST_FAILED, "out of memory for albedos");
    done = done && karst_engine_keep_sample(engine, error) &&
           karst_buffer_fill(engine->counters, 0, 0, sizeof engine->counted, error) &&
           karst_shade_pixels(engine->shader, &view, &pinhole, &light, engine->hits, engine->shadow_rays,
                              karst_radiance_marks(engine->radiance)->mem, karst_radiance_parts(engine->radiance),
                              engine->counters, error) &&
           karst_buffer_read(karst_radiance_parts(engine->radiance), 0, planes, 3 * num * sizeof *planes, error) &&
           karst_buffer_read(engine->hits, 0, hits, num * sizeof *hits, error) &&
           karst_engine_read_normals(engine, normals, 3 * num, error);
    light.paint_alone = 1;
    if (done && lays_paint)
        done = karst_buffer_fill(engine->counters, 0, 0, sizeof engine->counted, error) &&
               karst_shade_pixels(engine->shader, &view, &pinhole, &light, engine->hits, engine->shadow_rays,
                                  karst_radiance_marks(engine->radiance)->mem, karst_radiance_parts(engine->radiance),
                                  engine->counters, error) &&
               karst_buffer_read(karst_radiance_parts(engine->radiance), 0, painted, 3 * num * sizeof *painted, error);
    karst_shader_set_skies(engine->shader, engine->shown.skies);
    for (uint32_t y = 0; done && y < height; y++)
        for (uint32_t x = 0; x < width; x++) {
            const uint32_t place = karst_packet_order(x, y, width, height);
            const bool is_hit = KARST_HIT_KIND(hits[place].kind) != KARST_HIT_MISS;
            /* as plain_albedo in raycast/light/light.clh */
            const float s = fminf(fmaxf((normals[3 * (y * width + x) + 1] - 0.55f) / 0.3f, 0), 1);
            const float flat = s * s * (3 - 2 * s);
            for (size_t c = 0; c < 3; c++) {
                const float plain = engine->world->ground_steep[c] +
                                    flat * (engine->world->ground_flat[c] - engine->world->ground_steep[c]);
                const float shows = lays_paint ? planes[c * num + place] - painted[c * num + place] : 1;
                const float over = lays_paint ? painted[c * num + place] : 0;
                *rgb++ = !is_hit ? 0 : coloured ? planes[c * num + place] : over + shows * plain;
            }
        }
    free(painted);
    free(planes);
    free(normals);
    free(hits);
    return done;
}

static bool read_position(karst_engine *engine, float *xyz, karst_error *error)
{
    const int width = engine->width_px, height = engine->height_px;
    const karst_engine_window *window = &engine->window;
    const int whole_width = window->whole_width_px ? window->whole_width_px : width;
    const int whole_height = window->whole_height_px ? window->whole_height_px : height;
    const size_t num = (size_t)width * (size_t)height;
    double right[3], up[3], forward[3], eye_m[3];
    const double voxel_m = exp2(engine->world->voxel_log2_m), tangent = tan(engine->drawn.fov_deg * (M_PI / 360));
    float *depth_m = malloc(num * sizeof *depth_m);
    bool done = depth_m ? karst_engine_read_depth(engine, depth_m, num, error)
                        : karst_fail(error, KARST_FAILED, "out of memory for positions");
    karst_camera_axes(&engine->drawn, right, up, forward);
    for (int axis = 0; axis < 3; axis++)
        eye_m[axis] = ((double)engine->drawn.position.voxel[axis] +
                       ldexp((double)engine->drawn.position.fraction[axis], -32)) * voxel_m;
    for (size_t i = 0; done && i < num; i++) {
        const double across = (window->x0_px + (double)(i % (size_t)width) + 0.5) * 2 / whole_width - 1;
        const double along = 1 - (window->y0_px + (double)(i / (size_t)width) + 0.5) * 2 / whole_height;
        double d[3], square = 0;
        for (int axis = 0; axis < 3; axis++) {
            d[axis] = forward[axis] + across * tangent * whole_width / whole_height * right[axis] +
                      along * tangent * up[axis];
            square += d[axis] * d[axis];
        }
        for (int axis = 0; axis < 3; axis++)
            *xyz++ = isinf(depth_m[i]) ? 0 : (float)(eye_m[axis] + (double)depth_m[i] * d[axis] / sqrt(square));
    }
    free(depth_m);
    return done;
}

static bool read_level(karst_engine *engine, float *levels, karst_error *error)
{
    const uint32_t width = (uint32_t)engine->width_px, height = (uint32_t)engine->height_px;
    const size_t num = (size_t)width * height;
    karst_hit *hits = malloc(num * sizeof *hits);
    bool done = hits ? karst_buffer_read(engine->hits, 0, hits, num * sizeof *hits, error)
                     : karst_fail(error, KARST_FAILED, "out of memory for levels");
    for (uint32_t y = 0; done && y < height; y++)
        for (uint32_t x = 0; x < width; x++) {
            const karst_hit *hit = &hits[karst_packet_order(x, y, width, height)];
            *levels++ = KARST_HIT_KIND(hit->kind) == KARST_HIT_MISS ? -1 : (float)KARST_HIT_LEVEL(hit->kind);
        }
    free(hits);
    return done;
}

bool karst_engine_read_aov(karst_engine *engine, karst_aov aov, float *values, size_t num_values, karst_error *error)
{
    const size_t num_pixels = (size_t)engine->width_px * (size_t)engine->height_px;
    if ((unsigned)aov >= KARST_NUM_AOVS)
        return karst_fail(error, KARST_USAGE, "there is no value of pixels of number %d", (int)aov);
    if (num_values != num_pixels * (size_t)karst_aov_width(aov))
        return karst_fail(error, KARST_USAGE, "%s of %dx%d is %zu values, not %zu", aovs[aov].name, engine->width_px,
                          engine->height_px, num_pixels * (size_t)karst_aov_width(aov), num_values);
    if (!engine->hits || engine->frame == 0)
        return karst_fail(error, KARST_USAGE, "no frame has been drawn yet");
    switch (aov) {
    case KARST_AOV_RADIANCE:
        return karst_engine_read_radiance(engine, values, num_values, error);
    case KARST_AOV_SUMS:
        return karst_engine_read_sums(engine, values, error);
    case KARST_AOV_SAMPLES:
        for (size_t i = 0; i < num_pixels; i++)
            values[i] = (float)(engine->num_summed ? engine->num_summed : 1);
        return true;
    default:
        break;
    }
    if (!karst_engine_centre_hits(engine, error))
        return false;
    return aov == KARST_AOV_ALBEDO   ? karst_engine_read_albedo(engine, values, error)
           : aov == KARST_AOV_DEPTH  ? karst_engine_read_depth(engine, values, num_values, error)
           : aov == KARST_AOV_NORMAL ? karst_engine_read_normals(engine, values, num_values, error)
           : aov == KARST_AOV_LEVEL  ? read_level(engine, values, error)
           : aov == KARST_AOV_OCCLUSION ? karst_engine_read_occlusion(engine, values, num_values, error)
           : aov == KARST_AOV_OPENNESS  ? karst_engine_read_openness(engine, values, error)
                                     : read_position(engine, values, error);
}
