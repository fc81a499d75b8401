/* Launching the kernels of light that passes land, and the casts between them. */
#include "raycast/light/pass.h"

#include <stdlib.h>

#include "raycast/light/scan.h"

#define LOCAL_SIZE 64
#define SIDE_PX 32u /* as in pass.cl */

enum { INSIDE, LEAVE, ON, COUNT_DARK, SCAN, DARK_RAYS, ADD, NUM_KERNELS };
static const char *const kernel_names[NUM_KERNELS] = {"pass_inside", "pass_leave",     "pass_on", "pass_count_dark",
                                                      "pass_scan",   "pass_dark_rays", "pass_add"};

struct karst_pass {
    karst_context *context;
    karst_program *program;
    cl_kernel kernels[NUM_KERNELS];
    uint32_t room;
    karst_buffer *inside, *hits, *shares;
    karst_buffer *dark, *counts; /* rays to the sun */
    karst_buffer *total, *going;
};

karst_pass *karst_pass_create(karst_context *context, karst_error *error)
{
    karst_pass *pass = calloc(1, sizeof *pass);
    if (!pass) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    pass->context = context;
    bool done = (pass->total = karst_buffer_create(context, "stream", sizeof(uint32_t), NULL, error)) &&
                (pass->going = karst_buffer_create(context, "stream", sizeof(uint32_t), NULL, error)) &&
                (pass->program = karst_program_build(context, "raycast/light/pass.cl", "", NULL, 0, error));
    for (int i = 0; done && i < NUM_KERNELS; i++)
        done = (pass->kernels[i] = karst_program_kernel(pass->program, kernel_names[i], error)) != NULL;
    if (done)
        return pass;
    karst_pass_destroy(pass);
    return NULL;
}

static void free_room(karst_pass *pass)
{
    karst_buffer **const buffers[] = {&pass->inside, &pass->hits, &pass->shares, &pass->dark, &pass->counts};
    for (size_t i = 0; i < sizeof buffers / sizeof *buffers; i++) {
        karst_buffer_destroy(*buffers[i]);
        *buffers[i] = NULL;
    }
    pass->room = 0;
}

void karst_pass_destroy(karst_pass *pass)
{
    if (!pass)
        return;
    for (int i = 0; i < NUM_KERNELS; i++)
        if (pass->kernels[i])
            clReleaseKernel(pass->kernels[i]);
    karst_program_destroy(pass->program);
    free_room(pass);
    karst_buffer_destroy(pass->total);
    karst_buffer_destroy(pass->going);
    free(pass);
}

double karst_pass_bytes(double num_rays)
{
    return num_rays * (double)(2 * sizeof(karst_ray) + sizeof(karst_hit) + sizeof(float));
}

static bool make(karst_pass *pass, karst_buffer **buffer, size_t num, size_t each_bytes, karst_error *error)
{
    *buffer = karst_buffer_create_blank(pass->context, "stream", num * each_bytes, error);
    return *buffer != NULL;
}

bool karst_pass_set_room(karst_pass *pass, uint32_t num_rays, karst_error *error)
{
    if (pass->dark && pass->room >= num_rays)
        return true;
    free_room(pass);
    if (!make(pass, &pass->inside, num_rays, sizeof(karst_ray), error) ||
        !make(pass, &pass->hits, num_rays, sizeof(karst_hit), error) ||
        !make(pass, &pass->shares, num_rays, sizeof(float), error) ||
        !make(pass, &pass->dark, num_rays, sizeof(karst_ray), error))
        return false;
    pass->room = num_rays;
    return true;
}

static bool check_room(const karst_pass *pass, uint32_t num_rays, karst_error *error)
{
    return num_rays <= pass->room ||
           karst_fail(error, KARST_FAILED, "there is no room for %u rays through land", num_rays);
}

static bool launch(const karst_pass *pass, int kernel, size_t items, karst_error *error)
{
    return karst_launch(pass->context, pass->kernels[kernel], KARST_STAGE_SHADE,
                        (items + LOCAL_SIZE - 1) / LOCAL_SIZE * LOCAL_SIZE, LOCAL_SIZE, error);
}

bool karst_pass_leave(const karst_pass_picture *picture, karst_buffer *rays, const karst_buffer *count,
                      uint32_t max_rays, karst_error *error)
{
    karst_pass *pass = picture->pass;
    const cl_uint is_sure = picture->view->ends_at_missing;
    return check_room(pass, max_rays, error) &&
           KARST_ARGUMENTS(pass->kernels[INSIDE], error, KARST_BUFFER_ARG(rays), KARST_BUFFER_ARG(count),
                           KARST_BUFFER_ARG(pass->inside)) &&
           launch(pass, INSIDE, max_rays, error) &&
           karst_cast_stream(picture->land, picture->view, pass->inside, max_rays, count, pass->hits, error) &&
           KARST_ARGUMENTS(pass->kernels[LEAVE], error, KARST_BUFFER_ARG(rays), KARST_BUFFER_ARG(count),
                           KARST_BUFFER_ARG(pass->hits), KARST_VALUE_ARG(picture->view->detail),
                           KARST_VALUE_ARG(is_sure), KARST_BUFFER_ARG(picture->counters)) &&
           launch(pass, LEAVE, max_rays, error);
}

const karst_buffer *karst_pass_find_shares(const karst_pass_picture *picture, const karst_buffer *rays,
                                           const karst_buffer *count, const karst_buffer *hits, uint32_t max_rays,
                                           bool by_haze, karst_error *error)
{
    karst_pass *pass = picture->pass;
    const karst_share_stream stream = {rays, count, hits, max_rays, by_haze};
    return check_room(pass, max_rays, error) &&
                   karst_shade_shares(picture->shader, picture->view, picture->light, &stream, pass->shares, error)
               ? pass->shares
               : NULL;
}

bool karst_pass_to_lamps(const karst_pass_picture *picture, karst_buffer *rays, const karst_buffer *count,
                         uint32_t max_rays, karst_error *error)
{
    karst_pass *pass = picture->pass;
    const cl_uint is_sure = picture->view->ends_at_missing;
    uint32_t going = 1;
    for (uint32_t met = 0; met <= KARST_PASS_MOST && going; met++) {
        const cl_uint is_last = met == KARST_PASS_MOST;
        if ((met && !karst_pass_leave(picture, rays, count, max_rays, error)) ||
            !karst_cast_stream(picture->land, picture->view, rays, max_rays, count, pass->hits, error) ||
            !karst_pass_find_shares(picture, rays, count, pass->hits, max_rays, false, error) ||
            !karst_buffer_fill(pass->going, 0, 0, sizeof going, error) ||
            !KARST_ARGUMENTS(pass->kernels[ON], error, KARST_BUFFER_ARG(rays), KARST_BUFFER_ARG(count),
                             KARST_BUFFER_ARG(pass->hits), KARST_BUFFER_ARG(pass->shares),
                             KARST_VALUE_ARG(picture->view->detail), KARST_VALUE_ARG(is_sure),
                             KARST_VALUE_ARG(is_last), KARST_BUFFER_ARG(pass->going)) ||
            !launch(pass, ON, max_rays, error) || !karst_buffer_read(pass->going, 0, &going, sizeof going, error))
            return false;
    }
    return true;
}

/* Room for the counts of so many blocks. */
static bool make_counts(karst_pass *pass, size_t num, karst_error *error)
{
    if (pass->counts && pass->counts->size_bytes >= num * sizeof(uint32_t))
        return true;
    karst_buffer_destroy(pass->counts);
    return make(pass, &pass->counts, num, sizeof(uint32_t), error);
}

/* The rays to the sun that end, as a stream without gaps; how many. */
static bool gather_dark(const karst_pass_picture *picture, const karst_pass_dark *dark, uint32_t *num_rays,
                        karst_error *error)
{
    karst_pass *pass = picture->pass;
    const karst_shadow_sun sun =
        karst_cast_shadow_sun(picture->land, dark->pinhole, picture->light, dark->of_stream);
    const cl_uint width = (cl_uint)sun.width_px, height = (cl_uint)sun.height_px,
                  tiles = ((width + SIDE_PX - 1) / SIDE_PX) * ((height + SIDE_PX - 1) / SIDE_PX),
                  blocks = tiles * (SIDE_PX * SIDE_PX / karst_scan_block(pass->context, SIDE_PX * SIDE_PX));
    const cl_ulong first = dark->first, stride = dark->stride;
    return make_counts(pass, blocks, error) &&
           KARST_ARGUMENTS(pass->kernels[COUNT_DARK], error, KARST_BUFFER_ARG(dark->shadow_rays),
                           KARST_BUFFER_ARG(dark->marks), KARST_VALUE_ARG(width), KARST_VALUE_ARG(height),
                           KARST_BUFFER_ARG(pass->counts), KARST_VALUE_ARG(blocks)) &&
           launch(pass, COUNT_DARK, blocks, error) &&
           KARST_ARGUMENTS(pass->kernels[SCAN], error, KARST_BUFFER_ARG(pass->counts), KARST_VALUE_ARG(blocks),
                           KARST_BUFFER_ARG(pass->total)) &&
           karst_launch_scan(pass->context, pass->kernels[SCAN], error) &&
           KARST_ARGUMENTS(pass->kernels[DARK_RAYS], error, KARST_VALUE_ARG(sun), KARST_BUFFER_ARG(dark->shadow_rays),
                           KARST_BUFFER_ARG(dark->marks), KARST_BUFFER_ARG(dark->suns), KARST_VALUE_ARG(first),
                           KARST_VALUE_ARG(stride), KARST_BUFFER_ARG(pass->counts), KARST_VALUE_ARG(blocks),
                           KARST_BUFFER_ARG(pass->dark)) &&
           launch(pass, DARK_RAYS, blocks, error) &&
           karst_buffer_read(pass->total, 0, num_rays, sizeof *num_rays, error);
}

bool karst_pass_sun(const karst_pass_picture *picture, const karst_pass_dark *dark, karst_buffer *parts,
                    karst_error *error)
{
    karst_pass *pass = picture->pass;
    const cl_uint width = (cl_uint)picture->pinhole->width_px, height = (cl_uint)picture->pinhole->height_px;
    uint32_t num_rays = 0;
    if (!check_room(pass, (uint32_t)dark->pinhole->width_px * (uint32_t)dark->pinhole->height_px, error) ||
        !gather_dark(picture, dark, &num_rays, error))
        return false;
    return !num_rays ||
           (karst_pass_to_lamps(picture, pass->dark, pass->total, num_rays, error) &&
            KARST_ARGUMENTS(pass->kernels[ADD], error, KARST_VALUE_ARG(width), KARST_VALUE_ARG(height),
                            KARST_BUFFER_ARG(pass->dark), KARST_BUFFER_ARG(pass->total), KARST_BUFFER_ARG(parts)) &&
            launch(pass, ADD, num_rays, error));
}
