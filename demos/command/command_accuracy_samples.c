/* The family of samples: how near a picture of so many is to one of very many, of far finer detail. */
#include "command_accuracy.h"

#include <math.h>
#include <stdlib.h>

/* What stands for the full density: a quarter of a pixel a voxel, hits on the density itself. */
#define TRUTH_DETAIL_PX 0.25
#define TRUTH_SAMPLES 1024
#define POOL_BYTES ((uint64_t)2048 << 20)

static const uint32_t numbers[] = {1, 4, 16, 64};
static const double details_px[] = {1, 0.5};
#define NUM_NUMBERS (sizeof numbers / sizeof *numbers)
_Static_assert(NUM_NUMBERS *(sizeof details_px / sizeof *details_px) == ACCURACY_NUM_SAMPLES,
               "a picture for each number and detail");

typedef struct {
    command_talk *talk;
    uint32_t num_samples;
    uint64_t complete_ns; /* of frames that added a sample */
    uint32_t num_complete;
} progress;

static bool note_frame(void *user, const karst_stats *stats)
{
    progress *p = user;
    /* Frames of samples alone: those before them make what the view shows. */
    if (stats->num_samples > p->num_complete) {
        p->num_complete = stats->num_samples;
        p->complete_ns += stats->time_ns_frame;
    }
    command_progress(p->talk, "sample %u of %u", stats->num_samples, p->num_samples);
    return !command_interrupted();
}

/* As `karst render` draws it. `what`: samples and detail that are asked for; then what they took and were given. */
static bool draw(accuracy *a, bool is_truth, accuracy_samples *what, command_talk *talk, uint8_t *rgba,
                 karst_error *error)
{
    const uint32_t num_samples = what->num_samples;
    const karst_log log = command_log(talk);
    const karst_engine_config config = {.world = a->world_file,
                                        .parameters = a->parameters.values,
                                        .num_parameters = a->parameters.num_values,
                                        .device = a->device,
                                        .display = KARST_DISPLAY_NONE,
                                        .width_px = a->size_px[0],
                                        .height_px = a->size_px[1],
                                        .detail_px = what->detail_px,
                                        .pool_bytes = POOL_BYTES,
                                        .refine = is_truth,
                                        .view_distance_m = a->view_distance_m,
                                        .has_seed = a->has_seed,
                                        .seed = (uint32_t)a->seed,
                                        .samples = num_samples,
                                        .tone = KARST_TONE_OF_FILM,
                                        .lanes = (int)a->lanes,
                                        .log = &log};
    karst_engine *engine = karst_engine_create(&config, error);
    karst_stats stats;
    bool settled = false;
    progress p = {talk, num_samples, 0, 0};
    bool done = engine && (!a->has_camera || karst_engine_set_camera(engine, &a->camera_used, error)) &&
                karst_engine_settle(engine, 2000 + num_samples, note_frame, &p, &settled, error);
    if (done && command_interrupted())
        done = karst_fail(error, KARST_FAILED, "interrupted");
    if (done && !settled)
        done = karst_fail(error, KARST_FAILED, "the picture did not settle in %u frames", 2000 + num_samples);
    if (done) {
        karst_engine_stats(engine, &stats);
        what->detail_px = stats.detail_given_px;
        snprintf(a->device_name, sizeof a->device_name, "%s", stats.device);
        const karst_camera camera = karst_engine_camera(engine);
        karst_camera_format(&camera, karst_engine_voxel_log2_m(engine), a->camera_text, sizeof a->camera_text);
        what->ms = (double)p.complete_ns * 1e-6;
        done = karst_engine_read_pixels(engine, rgba, (size_t)a->size_px[0] * (size_t)a->size_px[1] * 4, error);
    }
    karst_engine_destroy(engine);
    return done;
}

bool accuracy_measure_samples(accuracy *a, command_talk *talk, karst_error *error)
{
    const size_t size_bytes = (size_t)a->size_px[0] * (size_t)a->size_px[1] * 4;
    uint8_t *truth = malloc(size_bytes), *rgba = malloc(size_bytes);
    a->truth = (accuracy_samples){.num_samples = TRUTH_SAMPLES, .detail_px = TRUTH_DETAIL_PX};
    bool done = (truth && rgba) || karst_fail(error, KARST_FAILED, "out of memory");
    done = done && draw(a, true, &a->truth, talk, truth, error);
    for (size_t i = 0; done && i < ACCURACY_NUM_SAMPLES; i++) {
        accuracy_samples *s = &a->samples[i];
        s->num_samples = numbers[i % NUM_NUMBERS];
        s->detail_px = details_px[i / NUM_NUMBERS];
        done = draw(a, false, s, talk, rgba, error);
        if (done)
            accuracy_compare(rgba, truth, a->size_px, &s->rmse, &s->psnr_db, &s->ssim);
    }
    a->has_samples = done;
    command_end_progress(talk);
    free(truth);
    free(rgba);
    return done;
}

void accuracy_print_samples(const accuracy *a)
{
    if (!a->has_samples)
        return;
    printf("\n%s at %s, %dx%d: samples, with shadows, against %u samples of %.2f px a voxel, refined\n\n", a->world,
           a->camera_text, a->size_px[0], a->size_px[1], a->truth.num_samples, a->truth.detail_px);
    puts("samples px/voxel        ms     rms   PSNR   SSIM");
    for (int i = 0; i < ACCURACY_NUM_SAMPLES; i++) {
        const accuracy_samples *s = &a->samples[i];
        printf("%7u %8.2f %9.2f %7.2f %6.1f %6.4f\n", s->num_samples, s->detail_px, s->ms, s->rmse, s->psnr_db,
               s->ssim);
    }
}
