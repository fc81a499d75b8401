/* Light that media scatter, in each way that pictures have, against paths of light in double. */
#include "command_accuracy.h"

#include <math.h>
#include <stdlib.h>

#define POOL_BYTES ((uint64_t)512 << 20)

static const struct {
    karst_scattering scattering;
    const char *name;
    uint32_t num_samples;
} ways[ACCURACY_NUM_MEDIA] = {{KARST_SCATTERING_ONCE, "once", 1},
                              {KARST_SCATTERING_ONCE, "once", 16},
                              {KARST_SCATTERING_OCTAVES, "octaves", 1},
                              {KARST_SCATTERING_FLUENCE, "fluence", 1},
                              {KARST_SCATTERING_FLUENCE, "fluence", 16},
                              {KARST_SCATTERING_PATHS, "paths", 16},
                              {KARST_SCATTERING_PATHS, "paths", 64},
                              {KARST_SCATTERING_PATHS, "paths", 256}};

typedef struct {
    command_talk *talk;
    const char *name;
    uint32_t num_samples, num_complete;
    uint64_t ns; /* of frames that added a sample */
} progress;

static bool note_frame(void *user, const karst_stats *stats)
{
    progress *p = user;
    if (stats->num_samples > p->num_complete) {
        p->num_complete = stats->num_samples;
        p->ns += stats->time_ns_frame;
    }
    command_progress(p->talk, "%s: sample %u of %u", p->name, stats->num_samples, p->num_samples);
    return !command_interrupted();
}

static bool note_share(void *user, double share)
{
    command_progress(user, "paths of the truth: %.0f %%", 100 * share);
    return !command_interrupted();
}

static bool draw(accuracy *a, int way, command_talk *talk, float *light, karst_error *error)
{
    const karst_log log = command_log(talk);
    accuracy_media *m = &a->media[way];
    *m = (accuracy_media){.scattering = ways[way].scattering, .num_samples = ways[way].num_samples};
    const karst_engine_config config = {.world = a->world_file,
                                        .parameters = a->parameters.values,
                                        .num_parameters = a->parameters.num_values,
                                        .device = a->device,
                                        .display = KARST_DISPLAY_NONE,
                                        .width_px = a->size_px[0],
                                        .height_px = a->size_px[1],
                                        .detail_px = a->media_detail_px,
                                        .pool_bytes = POOL_BYTES,
                                        .view_distance_m = a->view_distance_m,
                                        .has_seed = a->has_seed,
                                        .seed = (uint32_t)a->seed,
                                        .samples = m->num_samples,
                                        .scattering = m->scattering,
                                        .tone = KARST_TONE_OF_FILM,
                                        .lanes = (int)a->lanes,
                                        .log = &log};
    karst_engine *engine = karst_engine_create(&config, error);
    karst_stats stats;
    bool settled = false;
    progress p = {talk, ways[way].name, m->num_samples, 0, 0};
    bool done = engine && (!a->has_camera || karst_engine_set_camera(engine, &a->camera_used, error)) &&
                karst_engine_settle(engine, 2000 + m->num_samples, note_frame, &p, &settled, error);
    if (done && command_interrupted())
        done = karst_fail(error, KARST_FAILED, "interrupted");
    if (done && !settled)
        done = karst_fail(error, KARST_FAILED, "the picture did not settle in %u frames", 2000 + m->num_samples);
    if (done) {
        karst_engine_stats(engine, &stats);
        snprintf(a->device_name, sizeof a->device_name, "%s", stats.device);
        const karst_camera camera = karst_engine_camera(engine);
        karst_camera_format(&camera, karst_engine_voxel_log2_m(engine), a->camera_text, sizeof a->camera_text);
        m->ms = (double)p.ns * 1e-6;
        done = karst_engine_read_radiance(engine, light, 3 * (size_t)a->size_px[0] * (size_t)a->size_px[1], error);
    }
    karst_engine_destroy(engine);
    return done;
}

/* What is scattered once, or as often as it is. */
static bool trace(accuracy *a, int often, command_talk *talk, double *rgb, double *deviation, karst_error *error)
{
    const karst_reference_config config = {.world = a->world_file,
                                           .parameters = a->parameters.values,
                                           .num_parameters = a->parameters.num_values,
                                           .has_seed = a->has_seed,
                                           .seed = (uint32_t)a->seed,
                                           .camera = a->has_camera ? &a->camera_used : NULL,
                                           .width_px = a->size_px[0],
                                           .height_px = a->size_px[1],
                                           .view_distance_m = a->view_distance_m};
    const karst_reference_light light = {
        .paths_px = (uint32_t)a->paths_px, .max_bounces = often ? 0 : 1, .spread_px = true, .around_of_world = true};
    const size_t num = 3 * (size_t)a->size_px[0] * (size_t)a->size_px[1];
    const uint64_t start_ns = command_clock_ns();
    double noise = 0;
    if (!karst_reference_scatter(&config, &light, rgb, deviation, note_share, talk, &a->light_stats[often], error))
        return false;
    a->light_s[often] = (double)(command_clock_ns() - start_ns) * 1e-9;
    a->light_mean[often] = 0;
    for (size_t i = 0; i < num; i++) {
        a->light_mean[often] += rgb[i] / (double)num;
        noise += deviation[i] * deviation[i] / (double)num;
    }
    a->light_noise[often] = sqrt(noise) / a->light_mean[often];
    return a->light_mean[often] > 0 ||
           karst_fail(error, KARST_USAGE, "the medium shows no light of the sun here: there is nothing to compare");
}

bool accuracy_measure_media(accuracy *a, command_talk *talk, karst_error *error)
{
    const size_t num = 3 * (size_t)a->size_px[0] * (size_t)a->size_px[1];
    double *truth[2] = {malloc(num * sizeof(double)), malloc(num * sizeof(double))},
           *deviation = malloc(num * sizeof *deviation);
    float *light = malloc(num * sizeof *light);
    bool done = (truth[0] && truth[1] && deviation && light) || karst_fail(error, KARST_FAILED, "out of memory");
    for (int often = 0; done && often < 2; often++)
        done = trace(a, often, talk, truth[often], deviation, error);
    for (int i = 0; done && i < ACCURACY_NUM_MEDIA; i++) {
        const int often = ways[i].scattering != KARST_SCATTERING_ONCE;
        double off = 0, squares = 0;
        done = draw(a, i, talk, light, error);
        for (size_t p = 0; done && p < num; p++) {
            const double d = (double)light[p] - truth[often][p];
            off += d / (double)num;
            squares += d * d / (double)num;
        }
        const double mean = a->light_mean[often], noise = a->light_noise[often] * mean;
        a->media[i].bias = off / mean;
        a->media[i].rms = sqrt(fmax(squares - noise * noise, 0)) / mean;
    }
    a->has_media = done;
    command_end_progress(talk);
    free(truth[0]);
    free(truth[1]);
    free(deviation);
    free(light);
    return done;
}

void accuracy_print_media(const accuracy *a)
{
    if (!a->has_media)
        return;
    printf("%s at %s, %dx%d, on %s: scattered light against %llu paths a pixel\n", a->world, a->camera_text,
           a->size_px[0], a->size_px[1], a->device_name, (unsigned long long)a->paths_px);
    for (int t = 0; t < 2; t++) {
        const karst_reference_light_stats *s = &a->light_stats[t];
        printf("%s: mean %.5f, noise of a pixel %.2f %% of it, %.1f s, %.1f look-ups and %.2f collisions a path, %llu "
               "nodes\n",
               t ? "as often as it is" : "once", a->light_mean[t], 100 * a->light_noise[t], a->light_s[t],
               (double)s->num_lookups / (double)s->num_paths, (double)s->num_collisions / (double)s->num_paths,
               (unsigned long long)s->num_nodes);
    }
    puts("\nscattering samples        ms  against     bias      rms");
    for (int i = 0; i < ACCURACY_NUM_MEDIA; i++) {
        const accuracy_media *m = &a->media[i];
        printf("%-10s %7u %9.2f  %-7s %+6.2f %% %6.2f %%\n", ways[i].name, m->num_samples, m->ms,
               m->scattering == KARST_SCATTERING_ONCE ? "once" : "often", 100 * m->bias, 100 * m->rms);
    }
}
