/* Launching the kernels of occlusion. */
#include "raycast/light/occlusion.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define GPU_LOCAL_SIZE 64
#define GOLDEN_RAD 2.39996322972865332 /* the golden section of a turn */

struct karst_occlusion {
    karst_context *context;
    karst_program *program;
    cl_kernel rays_kernel, depths_kernel, see, fit, gather;
    int width_px, height_px; /* that there is room for */
    bool has_window;
    karst_buffer *rays, *ray_hits, *planes, *depths, *open, *hits; /* the last: of windows */
    karst_pinhole seen; /* that was aimed for last */
    karst_occlusion_task task;
};

karst_occlusion *karst_occlusion_create(karst_context *context, karst_error *error)
{
    karst_occlusion *occlusion = calloc(1, sizeof *occlusion);
    if (!occlusion) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    occlusion->context = context;
    occlusion->program = karst_program_build(context, "raycast/light/occlusion.cl", "", NULL, 0, error);
    if (occlusion->program) {
        occlusion->rays_kernel = karst_program_kernel(occlusion->program, "occlusion_rays", error);
        occlusion->depths_kernel = karst_program_kernel(occlusion->program, "occlusion_depths", error);
        occlusion->see = karst_program_kernel(occlusion->program, "occlusion_see", error);
        occlusion->fit = karst_program_kernel(occlusion->program, "occlusion_fit", error);
        occlusion->gather = karst_program_kernel(occlusion->program, "occlusion_gather", error);
    }
    if (occlusion->rays_kernel && occlusion->depths_kernel && occlusion->see && occlusion->fit && occlusion->gather)
        return occlusion;
    karst_occlusion_destroy(occlusion);
    return NULL;
}

static void free_room(karst_occlusion *occlusion)
{
    karst_buffer **const buffers[] = {&occlusion->rays, &occlusion->ray_hits, &occlusion->planes, &occlusion->depths,
                                      &occlusion->open, &occlusion->hits};
    for (size_t i = 0; i < sizeof buffers / sizeof *buffers; i++) {
        karst_buffer_destroy(*buffers[i]);
        *buffers[i] = NULL;
    }
    occlusion->width_px = occlusion->height_px = 0;
}

void karst_occlusion_destroy(karst_occlusion *occlusion)
{
    if (!occlusion)
        return;
    const cl_kernel kernels[] = {occlusion->rays_kernel, occlusion->depths_kernel, occlusion->see, occlusion->fit,
                                 occlusion->gather};
    for (size_t i = 0; i < sizeof kernels / sizeof *kernels; i++)
        if (kernels[i])
            clReleaseKernel(kernels[i]);
    karst_program_destroy(occlusion->program);
    free_room(occlusion);
    free(occlusion);
}

/* ---- room ---- */

/* Of what is looked at, for a picture of a size: at most. */
static size_t seen_px(int side_px, int step_px, bool has_window)
{
    const int more = (KARST_OCCLUSION_REACH + 2 * KARST_OCCLUSION_FIT_STEP) * step_px;
    return (size_t)side_px + (has_window ? (size_t)(2 * more) : 0);
}

/* On a side: the last pixel's, too. */
static size_t probes(size_t side_px, size_t step_px) { return (side_px + step_px - 2) / step_px + 1; }

static size_t probes_across(size_t width_px) { return probes(width_px, KARST_OCCLUSION_STEP_X); }
static size_t probes_down(size_t height_px) { return probes(height_px, KARST_OCCLUSION_STEP_Y); }

static size_t squares(size_t width_px, size_t height_px)
{
    return (probes_across(width_px) + KARST_OCCLUSION_SQUARE - 1) / KARST_OCCLUSION_SQUARE *
           ((probes_down(height_px) + KARST_OCCLUSION_SQUARE - 1) / KARST_OCCLUSION_SQUARE);
}

/* Of what is known of probes, and of pixels. */
#define PROBE_BYTES (KARST_OCCLUSION_PLANES * sizeof(float))
#define DEPTH_BYTES sizeof(float)

/* Even columns, and as much room for odd ones. */
static size_t all_probes(size_t width_px, size_t height_px)
{
    return (probes_across(width_px) + 1) / 2 * 2 * probes_down(height_px);
}

static size_t larger(size_t a, size_t b) { return a > b ? a : b; }

double karst_occlusion_bytes(int width_px, int height_px, bool has_window)
{
    const size_t width = seen_px(width_px, KARST_OCCLUSION_STEP_X, has_window),
                 height = seen_px(height_px, KARST_OCCLUSION_STEP_Y, has_window);
    return (double)squares(width, height) * KARST_OCCLUSION_SQUARE_RAYS * (sizeof(karst_ray) + sizeof(karst_hit)) +
           (double)all_probes(width, height) * PROBE_BYTES + (double)width * (double)height * DEPTH_BYTES +
           (double)width_px * height_px * sizeof(float) +
           (has_window ? (double)width * (double)height : 0) * sizeof(karst_hit);
}

static karst_buffer *make(karst_occlusion *occlusion, size_t num, size_t each_bytes, karst_error *error)
{
    return karst_buffer_create_blank(occlusion->context, "occlusion", num * each_bytes, error);
}

bool karst_occlusion_set_room(karst_occlusion *occlusion, int width_px, int height_px, bool has_window,
                              karst_error *error)
{
    if (occlusion->open && occlusion->width_px == width_px && occlusion->height_px == height_px &&
        occlusion->has_window == has_window)
        return true;
    free_room(occlusion);
    const size_t width = seen_px(width_px, KARST_OCCLUSION_STEP_X, has_window),
                 height = seen_px(height_px, KARST_OCCLUSION_STEP_Y, has_window);
    /* A smaller picture may be as wide as this is high. */
    const size_t most = larger(squares(width, height), squares(height, width)),
                 most_probes = larger(all_probes(width, height), all_probes(height, width));
    if (!(occlusion->rays = make(occlusion, most * KARST_OCCLUSION_SQUARE_RAYS, sizeof(karst_ray), error)) ||
        !(occlusion->ray_hits = make(occlusion, most * KARST_OCCLUSION_SQUARE_RAYS, sizeof(karst_hit), error)) ||
        !(occlusion->planes = make(occlusion, most_probes, PROBE_BYTES, error)) ||
        !(occlusion->depths = make(occlusion, width * height, DEPTH_BYTES, error)) ||
        !(occlusion->open = make(occlusion, (size_t)width_px * (size_t)height_px, sizeof(float), error)) ||
        (has_window && !(occlusion->hits = make(occlusion, width * height, sizeof(karst_hit), error))))
        return false;
    occlusion->width_px = width_px;
    occlusion->height_px = height_px;
    occlusion->has_window = has_window;
    return true;
}

karst_buffer *karst_occlusion_hits(karst_occlusion *occlusion) { return occlusion->hits; }
karst_buffer *karst_occlusion_open(karst_occlusion *occlusion) { return occlusion->open; }

/* ---- a picture ---- */

static double part_of(double x) { return x - floor(x); }

static int octant_of(const float d[4]) { return (d[0] < 0) | (d[1] < 0) << 1 | (d[2] < 0) << 2; }

/* By octants: what goes the same way on all axes goes together. */
static void order_cones(karst_occlusion_task *task)
{
    float ordered[KARST_OCCLUSION_CONES][4];
    int num = 0;
    for (int octant = 0; octant < 8; octant++)
        for (int i = 0; i < KARST_OCCLUSION_CONES; i++)
            if (octant_of(task->cones[i]) == octant)
                memcpy(ordered[num++], task->cones[i], sizeof ordered[0]);
    memcpy(task->cones, ordered, sizeof ordered);
}

/* Points of a spiral from pole to pole, of even density on the sphere; each sample turns it, about both axes, and moves
 * its points along. */
static void spread_cones(karst_occlusion_task *task, uint32_t sample)
{
    const double shift = part_of(0.5 + sample * 0.61803398874989485);
    const double about = 2 * M_PI * part_of(sample * 0.75487766624669276),
                 over = 2 * M_PI * part_of(sample * 0.56984029099805327);
    for (int i = 0; i < KARST_OCCLUSION_CONES; i++) {
        const double y = 1 - 2 * (i + shift) / KARST_OCCLUSION_CONES, around = sqrt(1 - y * y);
        const double x = around * cos(i * GOLDEN_RAD + about), z = around * sin(i * GOLDEN_RAD + about);
        task->cones[i][0] = (float)x;
        task->cones[i][1] = (float)(y * cos(over) - z * sin(over));
        task->cones[i][2] = (float)(y * sin(over) + z * cos(over));
    }
    order_cones(task);
    task->turn = 27 * sample % KARST_OCCLUSION_CONES;
}

static uint32_t num_items(const karst_occlusion *occlusion)
{
    return karst_occlusion_num_cones(occlusion) / (uint32_t)occlusion->context->lanes;
}

uint32_t karst_occlusion_num_cones(const karst_occlusion *occlusion)
{
    return (uint32_t)(squares((size_t)occlusion->seen.width_px, (size_t)occlusion->seen.height_px) *
                      KARST_OCCLUSION_SQUARE_RAYS);
}

static size_t local_size(const karst_occlusion *occlusion)
{
    return occlusion->context->lanes == 1 ? GPU_LOCAL_SIZE : 16;
}

bool karst_occlusion_aim(karst_occlusion *occlusion, const karst_cast_view *view, const karst_pinhole *seen,
                         const karst_buffer *hits, karst_error *error)
{
    const size_t width = (size_t)seen->width_px, height = (size_t)seen->height_px;
    const float cone = KARST_OCCLUSION_CONE;
    occlusion->seen = *seen;
    occlusion->task = (karst_occlusion_task){.plane = (uint32_t)all_probes(width, height),
                                             .detail = view->detail,
                                             .across = (int)probes_across(width),
                                             .down = (int)probes_down(height)};
    spread_cones(&occlusion->task, seen->sample);
    const uint32_t items = num_items(occlusion);
    if (!occlusion->open || hits->size_bytes / sizeof(karst_hit) < width * height ||
        occlusion->rays->size_bytes / sizeof(karst_ray) < karst_occlusion_num_cones(occlusion) ||
        occlusion->planes->size_bytes / PROBE_BYTES < all_probes(width, height) ||
        occlusion->depths->size_bytes / DEPTH_BYTES < width * height)
        return karst_fail(error, KARST_FAILED, "there is no room for the cones of a picture of %dx%d", seen->width_px,
                          seen->height_px);
    return KARST_ARGUMENTS(occlusion->rays_kernel, error, KARST_VALUE_ARG(*seen), KARST_VALUE_ARG(occlusion->task),
                           KARST_VALUE_ARG(cone), KARST_BUFFER_ARG(hits), KARST_BUFFER_ARG(occlusion->rays),
                           KARST_BUFFER_ARG(occlusion->planes), KARST_VALUE_ARG(items)) &&
           karst_launch(occlusion->context, occlusion->rays_kernel, KARST_STAGE_SHADE, items, local_size(occlusion),
                        error);
}

bool karst_occlusion_cast(karst_occlusion *occlusion, karst_caster *caster, const karst_cast_view *view, bool again,
                          karst_error *error)
{
    karst_cast_view wide = *view;
    wide.blend_below = KARST_OCCLUSION_BLENDS_BELOW(view->detail);
    return karst_cast_rays(caster, &wide, occlusion->rays, karst_occlusion_num_cones(occlusion), true,
                           again ? NULL : occlusion->ray_hits, error);
}

static bool launch(karst_occlusion *occlusion, cl_kernel kernel, size_t items, karst_error *error)
{
    return karst_launch(occlusion->context, kernel, KARST_STAGE_SHADE, items, local_size(occlusion), error);
}

/* Blocks of pixels, as many as hold what lies from first_px on, on an axis. */
static uint32_t blocks(int first_px, int num_px, int step_px)
{
    return (uint32_t)((first_px + num_px - 1) / step_px - first_px / step_px + 1);
}

/* Of so many probes on an axis. */
static uint32_t fits_on(uint32_t probes)
{
    return (probes + KARST_OCCLUSION_FIT_STEP - 1) / KARST_OCCLUSION_FIT_STEP;
}

/* What the seen pixels' surfaces are, what cones found, and what follows at each probe from those around it. */
static bool look_at_probes(karst_occlusion *occlusion, const karst_buffer *hits, karst_error *error)
{
    const karst_occlusion_task *task = &occlusion->task;
    const uint32_t lanes = (uint32_t)occlusion->context->lanes, items = num_items(occlusion);
    const uint32_t pixels = blocks(0, occlusion->seen.width_px, KARST_OCCLUSION_STEP_X) *
                            blocks(0, occlusion->seen.height_px, KARST_OCCLUSION_STEP_Y) * KARST_OCCLUSION_BLOCK /
                            lanes;
    const uint32_t fits_across = fits_on((uint32_t)task->across),
                   fits = (fits_across + lanes - 1) / lanes * fits_on((uint32_t)task->down);
    return KARST_ARGUMENTS(occlusion->depths_kernel, error, KARST_VALUE_ARG(occlusion->seen), KARST_BUFFER_ARG(hits),
                           KARST_BUFFER_ARG(occlusion->depths), KARST_VALUE_ARG(pixels)) &&
           launch(occlusion, occlusion->depths_kernel, pixels, error) &&
           KARST_ARGUMENTS(occlusion->see, error, KARST_VALUE_ARG(occlusion->seen), KARST_VALUE_ARG(*task),
                           KARST_BUFFER_ARG(occlusion->ray_hits), KARST_BUFFER_ARG(occlusion->planes),
                           KARST_VALUE_ARG(items)) &&
           launch(occlusion, occlusion->see, items, error) &&
           KARST_ARGUMENTS(occlusion->fit, error, KARST_VALUE_ARG(*task), KARST_BUFFER_ARG(occlusion->planes),
                           KARST_VALUE_ARG(fits)) &&
           launch(occlusion, occlusion->fit, fits, error);
}

bool karst_occlusion_gather(karst_occlusion *occlusion, const karst_pinhole *picture, const karst_buffer *hits,
                            int left_px, int top_px, karst_error *error)
{
    karst_occlusion_task *task = &occlusion->task;
    const uint32_t items = blocks(left_px, picture->width_px, KARST_OCCLUSION_STEP_X) *
                           blocks(top_px, picture->height_px, KARST_OCCLUSION_STEP_Y) * KARST_OCCLUSION_BLOCK /
                           (uint32_t)occlusion->context->lanes;
    task->left_px = left_px;
    task->top_px = top_px;
    task->width_px = picture->width_px;
    task->height_px = picture->height_px;
    if (occlusion->open->size_bytes / sizeof(float) < (size_t)picture->width_px * (size_t)picture->height_px)
        return karst_fail(error, KARST_FAILED, "there is no room for the occlusion of a picture of %dx%d",
                          picture->width_px, picture->height_px);
    return look_at_probes(occlusion, hits, error) &&
           KARST_ARGUMENTS(occlusion->gather, error, KARST_VALUE_ARG(occlusion->seen), KARST_VALUE_ARG(*task),
                           KARST_BUFFER_ARG(hits), KARST_BUFFER_ARG(occlusion->planes),
                           KARST_BUFFER_ARG(occlusion->depths), KARST_BUFFER_ARG(occlusion->open),
                           KARST_VALUE_ARG(items)) &&
           launch(occlusion, occlusion->gather, items, error);
}
