/* Launching the kernels of radiance. */
#include "raycast/light/radiance.h"

#include <stdlib.h>

#define METER_ITEMS 64u

struct karst_radiance {
    karst_context *context;
    karst_program *program;
    cl_kernel add, meter, expose, tone;
    bool sun;
    unsigned num_shares;
    karst_buffer *sums, *parts, *marks, *bins, *exposure;
};

karst_radiance *karst_radiance_create(karst_context *context, bool sun, unsigned num_shares, karst_error *error)
{
    karst_radiance *radiance = calloc(1, sizeof(*radiance));
    if (!radiance) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    radiance->context = context;
    radiance->sun = sun;
    radiance->num_shares = num_shares;
    radiance->bins = karst_buffer_create(context, "radiance", KARST_METER_BINS * sizeof(uint32_t), NULL, error);
    radiance->exposure = karst_buffer_create(context, "radiance", sizeof(float), NULL, error);
    if (radiance->bins && radiance->exposure)
        radiance->program = karst_program_build(context, "raycast/light/radiance.cl", "", NULL, 0, error);
    if (radiance->program) {
        radiance->add = karst_program_kernel(radiance->program, "radiance_add", error);
        radiance->meter = karst_program_kernel(radiance->program, "radiance_meter", error);
        radiance->expose = karst_program_kernel(radiance->program, "radiance_expose", error);
        radiance->tone = karst_program_kernel(radiance->program, "radiance_tone", error);
    }
    if (!radiance->add || !radiance->meter || !radiance->expose || !radiance->tone) {
        karst_radiance_destroy(radiance);
        return NULL;
    }
    return radiance;
}

static void free_room(karst_radiance *radiance)
{
    karst_buffer_destroy(radiance->sums);
    karst_buffer_destroy(radiance->parts);
    karst_buffer_destroy(radiance->marks);
    radiance->sums = radiance->parts = radiance->marks = NULL;
}

void karst_radiance_destroy(karst_radiance *radiance)
{
    if (!radiance)
        return;
    cl_kernel kernels[] = {radiance->add, radiance->meter, radiance->expose, radiance->tone};
    for (size_t i = 0; i < sizeof(kernels) / sizeof(*kernels); i++)
        if (kernels[i])
            clReleaseKernel(kernels[i]);
    karst_program_destroy(radiance->program);
    free_room(radiance);
    karst_buffer_destroy(radiance->bins);
    karst_buffer_destroy(radiance->exposure);
    free(radiance);
}

static size_t num_part_planes(const karst_radiance *radiance)
{
    return radiance->num_shares ? KARST_RADIANCE_MIRROR_PLANE + radiance->num_shares
                                : (radiance->sun ? 2u : 1u) * KARST_RADIANCE_PLANES;
}

double karst_radiance_bytes(const karst_radiance *radiance, double num_pixels)
{
    const size_t num_planes = KARST_RADIANCE_PLANES + num_part_planes(radiance) + (radiance->sun ? 1 : 0);
    return (double)(num_planes * sizeof(float)) * num_pixels;
}

bool karst_radiance_set_room(karst_radiance *radiance, size_t num_pixels, karst_error *error)
{
    const size_t plane_bytes = num_pixels * sizeof(float), part_planes = num_part_planes(radiance);
    free_room(radiance);
    radiance->sums =
        karst_buffer_create_blank(radiance->context, "radiance", KARST_RADIANCE_PLANES * plane_bytes, error);
    radiance->parts = karst_buffer_create_blank(radiance->context, "radiance", part_planes * plane_bytes, error);
    radiance->marks =
        karst_buffer_create_blank(radiance->context, "radiance", radiance->sun ? plane_bytes : sizeof(float), error);
    return radiance->sums && radiance->parts && radiance->marks;
}

karst_buffer *karst_radiance_parts(karst_radiance *radiance) { return radiance->parts; }
karst_buffer *karst_radiance_marks(karst_radiance *radiance) { return radiance->marks; }

static bool check_room(const karst_radiance *radiance, int width_px, int height_px, karst_error *error)
{
    return (radiance->sums && radiance->sums->size_bytes / (KARST_RADIANCE_PLANES * sizeof(float)) >=
                                  (size_t)width_px * (size_t)height_px) ||
           karst_fail(error, KARST_FAILED, "there is no room for the radiance of a picture of %dx%d", width_px,
                      height_px);
}

static karst_radiance_task make_task(const karst_radiance *radiance, int width_px, int height_px, uint32_t num_summed,
                                     bool has_current)
{
    return (karst_radiance_task){.width_px = width_px,
                                 .height_px = height_px,
                                 .has_sun = radiance->sun,
                                 .num_summed = num_summed,
                                 .has_current = has_current,
                                 .num_items = METER_ITEMS};
}

#define TASK_ARGUMENTS(task, r) \
    KARST_VALUE_ARG(task), KARST_BUFFER_ARG((r)->sums), KARST_BUFFER_ARG((r)->parts), KARST_BUFFER_ARG((r)->marks)

static bool launch_picture(karst_radiance *radiance, cl_kernel kernel, int width_px, int height_px, karst_error *error)
{
    size_t across = ((size_t)width_px + KARST_GROUP_SIDE - 1) / KARST_GROUP_SIDE;
    size_t down = ((size_t)height_px + KARST_GROUP_SIDE - 1) / KARST_GROUP_SIDE;
    size_t local_size = KARST_PACKET_RAYS * KARST_GROUP_PACKETS / (size_t)radiance->context->lanes;
    return karst_launch(radiance->context, kernel, KARST_STAGE_SHADE, across * down * local_size, local_size, error);
}

/* Enters a picture's luminances in the counts. */
static bool count_luminances(karst_radiance *radiance, const karst_radiance_task *task, karst_error *error)
{
    return KARST_ARGUMENTS(radiance->meter, error, TASK_ARGUMENTS(*task, radiance), KARST_BUFFER_ARG(radiance->bins)) &&
           karst_launch(radiance->context, radiance->meter, KARST_STAGE_SHADE, METER_ITEMS, 1, error);
}

bool karst_radiance_expose(karst_radiance *radiance, uint32_t num_pixels, karst_error *error)
{
    const cl_uint num = num_pixels;
    return KARST_ARGUMENTS(radiance->expose, error, KARST_BUFFER_ARG(radiance->bins), KARST_VALUE_ARG(num),
                           KARST_BUFFER_ARG(radiance->exposure)) &&
           karst_launch(radiance->context, radiance->expose, KARST_STAGE_SHADE, 1, 1, error);
}

static bool meter(karst_radiance *radiance, const karst_radiance_task *task, karst_error *error)
{
    return count_luminances(radiance, task, error) &&
           karst_radiance_expose(radiance, (uint32_t)task->width_px * (uint32_t)task->height_px, error);
}

bool karst_radiance_count(karst_radiance *radiance, int width_px, int height_px, karst_error *error)
{
    const karst_radiance_task task = make_task(radiance, width_px, height_px, 1, false);
    return check_room(radiance, width_px, height_px, error) && count_luminances(radiance, &task, error);
}

bool karst_radiance_show(karst_radiance *radiance, int width_px, int height_px, uint32_t num_summed, bool has_current,
                         const karst_radiance_look *look, cl_mem pixels, karst_error *error)
{
    karst_radiance_task task = make_task(radiance, width_px, height_px, num_summed, has_current);
    task.tone = look->tone;
    task.exposure = look->exposure;
    task.x0_px = look->x0_px;
    task.y0_px = look->y0_px;
    if (!num_summed && !has_current)
        return karst_fail(error, KARST_FAILED, "a picture of no samples cannot be shown");
    return check_room(radiance, width_px, height_px, error) &&
           (look->exposure > 0 || meter(radiance, &task, error)) &&
           KARST_ARGUMENTS(radiance->tone, error, TASK_ARGUMENTS(task, radiance), KARST_BUFFER_ARG(radiance->exposure),
                           KARST_VALUE_ARG(pixels)) &&
           launch_picture(radiance, radiance->tone, width_px, height_px, error);
}

bool karst_radiance_add(karst_radiance *radiance, int width_px, int height_px, uint32_t num_summed, karst_error *error)
{
    const karst_radiance_task task = make_task(radiance, width_px, height_px, num_summed, true);
    return check_room(radiance, width_px, height_px, error) &&
           KARST_ARGUMENTS(radiance->add, error, TASK_ARGUMENTS(task, radiance)) &&
           launch_picture(radiance, radiance->add, width_px, height_px, error);
}

bool karst_radiance_read(karst_radiance *radiance, int width_px, int height_px, uint32_t num_summed, float *rgb,
                         karst_error *error)
{
    const uint32_t width = (uint32_t)width_px, height = (uint32_t)height_px;
    const size_t num = (size_t)width * height;
    const float share = 1.0f / (float)num_summed;
    if (!check_room(radiance, width_px, height_px, error))
        return false;
    float *planes = malloc(KARST_RADIANCE_PLANES * num * sizeof(*planes));
    bool done = planes ? karst_buffer_read(radiance->sums, 0, planes, KARST_RADIANCE_PLANES * num * sizeof(*planes),
                                           error)
                       : karst_fail(error, KARST_FAILED, "out of memory for the radiance of %dx%d", width_px,
                                    height_px);
    for (uint32_t y = 0; done && y < height; y++)
        for (uint32_t x = 0; x < width; x++) {
            const uint32_t place = karst_packet_order(x, y, width, height);
            for (size_t c = 0; c < KARST_RADIANCE_PLANES; c++)
                *rgb++ = num_summed > 1 ? planes[c * num + place] * share : planes[c * num + place];
        }
    free(planes);
    return done;
}

bool karst_radiance_load(karst_radiance *radiance, int width_px, int height_px, const float *rgb, karst_error *error)
{
    const uint32_t width = (uint32_t)width_px, height = (uint32_t)height_px;
    const size_t num = (size_t)width * height;
    if (!check_room(radiance, width_px, height_px, error))
        return false;
    float *planes = malloc(KARST_RADIANCE_PLANES * num * sizeof(*planes));
    if (!planes)
        return karst_fail(error, KARST_FAILED, "out of memory for the radiance of %dx%d", width_px, height_px);
    for (uint32_t y = 0; y < height; y++)
        for (uint32_t x = 0; x < width; x++) {
            const uint32_t place = karst_packet_order(x, y, width, height);
            for (size_t c = 0; c < KARST_RADIANCE_PLANES; c++)
                planes[c * num + place] = *rgb++;
        }
    const bool done =
        karst_buffer_write(radiance->sums, 0, planes, KARST_RADIANCE_PLANES * num * sizeof(*planes), error);
    free(planes);
    return done;
}

bool karst_radiance_read_exposure(karst_radiance *radiance, float *exposure, karst_error *error)
{
    return karst_buffer_read(radiance->exposure, 0, exposure, sizeof(*exposure), error);
}
