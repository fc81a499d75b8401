/* What the parts of karst accuracy share.
 *
 *   command_accuracy.c          options; the order of things; the table on stdout
 *   command_accuracy_measure.c  settings drawn, and what they are off the reference
 *   command_accuracy_samples.c  pictures of more and more samples
 *   command_accuracy_media.c    what media scatter, in each way there is
 *   command_accuracy_report.c   the Pareto fronts; JSON, CSV and the SVG
 */
#ifndef KARST_DEMOS_COMMAND_ACCURACY_H
#define KARST_DEMOS_COMMAND_ACCURACY_H

#include "command.h"

/* A quality setting: one point of a family's curve. */
typedef struct {
    const char *family;
    double detail_px;
    int brick_bits;
    double safe_steps; /* as in karst_engine_config */
    bool refine, no_blend, no_beam;
    bool is_default; /* of karst render and karst view */
} accuracy_setting;

/* What it costs, and how wrong it is. */
typedef struct {
    double cast_ms, refine_ms, shade_ms,
        frame_ms;        /* of the fastest of settled frames without shadows: device, and wall clock */
    uint64_t num_bricks; /* that the picture needs */
    double brick_mib;
    double given_px; /* pixels per voxel: more than asked for if the pools are too small */
    /* depth, where both hit, in footprints of the ray */
    uint64_t num_compared;
    double depth_median, depth_p99, depth_max;
    /* pixels that miss what the reference hits, and the other way round; and those of both that lie at no silhouette */
    uint64_t num_missed, num_false, num_elsewhere;
    double normal_median_deg, normal_p99_deg;
    /* the small picture against the supersampled reference, 8-bit */
    double rmse, psnr_db, ssim;
    bool on_depth_front, on_picture_front;
} accuracy_result;

#define ACCURACY_MAX_SETTINGS 40

/* A picture of so many samples, with shadows, against one that stands for the truth. */
typedef struct {
    uint32_t num_samples;
    double detail_px; /* as it was given */
    double ms;        /* of all its samples, once the detail is there */
    double rmse, psnr_db, ssim;
} accuracy_samples;
#define ACCURACY_NUM_SAMPLES 8

/* Light that media scatter, in one way, against delta tracking. */
typedef struct {
    karst_scattering scattering;
    uint32_t num_samples;
    double ms; /* of the settled picture, once what it shows is there */
    /* As shares of the truth's mean: what the means differ by, and rms, less what the truth's own noise makes of it. */
    double bias, rms;
} accuracy_media;
#define ACCURACY_NUM_MEDIA 8

typedef struct {
    /* as asked for */
    const char *world, *device, *camera;
    char world_file[4096];
    int size_px[2];
    double view_distance_m;
    bool has_seed;
    uint64_t seed, num_frames, lanes;
    command_parameters parameters;
    /* as found */
    char camera_text[512], device_name[128];
    karst_camera camera_used;
    bool has_camera;
    int picture_px[2]; /* of the pictures that are compared */
    karst_reference_hit *expected;
    uint8_t *picture; /* supersampled */
    double reference_s, picture_s, sweep_s;
    uint64_t num_unresolved;
    accuracy_setting settings[ACCURACY_MAX_SETTINGS];
    accuracy_result results[ACCURACY_MAX_SETTINGS];
    size_t num_settings;
    accuracy_samples truth, samples[ACCURACY_NUM_SAMPLES];
    bool has_samples;
    uint64_t paths_px; /* of the truth of media */
    double media_detail_px; /* of their pictures; 0: as others */
    karst_reference_light_stats light_stats[2]; /* scattered once, and as often as it is */
    double light_mean[2], light_noise[2], light_s[2];
    accuracy_media media[ACCURACY_NUM_MEDIA];
    bool has_media;
} accuracy;

#define ACCURACY_RAYS_PX 4 /* on the side of a pixel of the supersampled picture */

/* ---- command_accuracy_measure.c ---- */

/* Traces the reference and the supersampled picture. */
bool accuracy_trace(accuracy *a, command_talk *talk, karst_error *error);
/* Draws setting number i and compares. */
bool accuracy_measure(accuracy *a, size_t i, command_talk *talk, karst_error *error);
/* Of bytes: root of the mean square, and what follows from it; structural similarity. */
void accuracy_compare(const uint8_t *rgba, const uint8_t *truth, const int size_px[2], double *rmse, double *psnr_db,
                      double *ssim);
void accuracy_free(accuracy *a);

/* ---- command_accuracy_samples.c ---- */

/* Draws them, and the truth that they are compared with. */
bool accuracy_measure_samples(accuracy *a, command_talk *talk, karst_error *error);
/* Their table, if they were drawn. */
void accuracy_print_samples(const accuracy *a);

/* ---- command_accuracy_media.c ---- */

/* Draws the world's medium in each way of scattering, and follows the paths that it is compared with. */
bool accuracy_measure_media(accuracy *a, command_talk *talk, karst_error *error);
/* Their table, if they were drawn. */
void accuracy_print_media(const accuracy *a);

/* ---- command_accuracy_report.c ---- */

/* Marks what no other setting beats both in time and in error: by 5 % in one, and no worse in the other. What leaps
 * farther than is proven is no rival, nor is what changes levels at once: medians do not show what the one loses, nor
 * stills that the other pops. */
void accuracy_mark_fronts(accuracy *a);
/* Malloc'ed texts; NULL: out of memory. */
char *accuracy_json(const accuracy *a);
char *accuracy_csv(const accuracy *a);
char *accuracy_plot(const accuracy *a, karst_error *error);

#endif
