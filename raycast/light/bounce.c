/* Launching the kernels of bounces. */
#include "raycast/light/bounce.h"

#include <stdlib.h>

#include "raycast/light/radiance_shared.h"
#include "raycast/light/scan.h"

#define GPU_LOCAL_SIZE 64

struct karst_bounce {
    karst_context *context;
    karst_program *program;
    cl_kernel count, scan, mirror, add_sun, pack; /* pack: NULL with one lane */
    bool sun;
    uint32_t num_beams, room; /* of the largest pictures that there is room for; rays */
    uint32_t limit;           /* rays of the stream at hand, in whole beams; 0: a picture's */
    karst_buffer *rays, *hits, *counts, *total;
    karst_buffer *shadow_rays, *suns, *marks; /* NULL without a sun */
};

#define BEAM_RAYS (KARST_PACKET_RAYS * KARST_BEAM_PACKETS)

static bool has_packing(const karst_bounce *bounce) { return bounce->context->lanes > 1; }

karst_bounce *karst_bounce_create(karst_context *context, bool sun, karst_error *error)
{
    karst_bounce *bounce = calloc(1, sizeof *bounce);
    if (!bounce) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    bounce->context = context;
    bounce->sun = sun;
    bounce->total = karst_buffer_create(context, "stream", sizeof(uint32_t), NULL, error);
    if (bounce->total)
        bounce->program = karst_program_build(context, "raycast/light/bounce.cl", "", NULL, 0, error);
    if (bounce->program) {
        bounce->count = karst_program_kernel(bounce->program, "bounce_count", error);
        bounce->scan = karst_program_kernel(bounce->program, "bounce_scan", error);
        bounce->mirror = karst_program_kernel(bounce->program, "bounce_mirror", error);
        if (has_packing(bounce))
            bounce->pack = karst_program_kernel(bounce->program, "bounce_pack_shadows", error);
        bounce->add_sun = karst_program_kernel(bounce->program, "bounce_add_sun", error);
    }
    if (!bounce->count || !bounce->scan || !bounce->mirror || (has_packing(bounce) && !bounce->pack) ||
        !bounce->add_sun) {
        karst_bounce_destroy(bounce);
        return NULL;
    }
    return bounce;
}

static void free_room(karst_bounce *bounce)
{
    karst_buffer **buffers[] = {&bounce->rays,        &bounce->hits, &bounce->counts,
                                &bounce->shadow_rays, &bounce->suns, &bounce->marks};
    for (size_t i = 0; i < sizeof buffers / sizeof *buffers; i++) {
        karst_buffer_destroy(*buffers[i]);
        *buffers[i] = NULL;
    }
}

void karst_bounce_destroy(karst_bounce *bounce)
{
    if (!bounce)
        return;
    cl_kernel kernels[] = {bounce->count, bounce->scan, bounce->mirror, bounce->add_sun, bounce->pack};
    for (size_t i = 0; i < sizeof kernels / sizeof *kernels; i++)
        if (kernels[i])
            clReleaseKernel(kernels[i]);
    karst_program_destroy(bounce->program);
    free_room(bounce);
    karst_buffer_destroy(bounce->total);
    free(bounce);
}

/* Beams that a picture has. */
static size_t num_beams(int width_px, int height_px)
{
    const size_t side_x = KARST_GROUP_SIDE * KARST_BEAM_ACROSS, side_y = KARST_GROUP_SIDE * KARST_BEAM_DOWN;
    return ((size_t)width_px + side_x - 1) / side_x * (((size_t)height_px + side_y - 1) / side_y);
}

double karst_bounce_bytes(int width_px, int height_px, bool sun)
{
    const size_t of_sun = (KARST_SHADOW_FIELDS + KARST_RADIANCE_PLANES + 1) * sizeof(float);
    return (double)num_beams(width_px, height_px) * BEAM_RAYS *
           (double)(sizeof(karst_ray) + sizeof(karst_hit) + (sun ? of_sun : 0));
}

/* Rays that a work-item makes: raycast/light/blocks.clh. */
static uint32_t block_rays(const karst_bounce *bounce) { return karst_scan_block(bounce->context, BEAM_RAYS); }

static karst_buffer *make(karst_bounce *bounce, size_t bytes_per_ray, karst_error *error)
{
    return karst_buffer_create_blank(bounce->context, "stream", bounce->room * bytes_per_ray, error);
}

bool karst_bounce_set_room(karst_bounce *bounce, int width_px, int height_px, karst_error *error)
{
    if (bounce->rays && num_beams(width_px, height_px) <= bounce->num_beams)
        return true;
    free_room(bounce);
    bounce->num_beams = (uint32_t)num_beams(width_px, height_px);
    bounce->room = bounce->num_beams * BEAM_RAYS;
    bounce->rays = make(bounce, sizeof(karst_ray), error);
    bounce->hits = make(bounce, sizeof(karst_hit), error);
    bounce->counts = karst_buffer_create_blank(
        bounce->context, "stream", bounce->room / block_rays(bounce) * sizeof(uint32_t), error);
    if (bounce->sun) {
        bounce->shadow_rays = make(bounce, KARST_SHADOW_FIELDS * sizeof(float), error);
        bounce->suns = make(bounce, KARST_RADIANCE_PLANES * sizeof(float), error);
        bounce->marks = make(bounce, sizeof(uint32_t), error);
    }
    return bounce->rays && bounce->hits && bounce->counts &&
           (!bounce->sun || (bounce->shadow_rays && bounce->suns && bounce->marks));
}

/* Rays that the stream may have: its planes have as many places. */
static uint32_t most_rays(const karst_bounce *bounce, const karst_pinhole *pinhole)
{
    return bounce->limit ? bounce->limit : karst_bounce_room(pinhole->width_px, pinhole->height_px);
}

void karst_bounce_limit(karst_bounce *bounce, uint32_t max_rays)
{
    bounce->limit = (max_rays + BEAM_RAYS - 1) / BEAM_RAYS * BEAM_RAYS;
}

karst_pinhole karst_bounce_pinhole(const karst_bounce *bounce, const karst_pinhole *pinhole)
{
    karst_pinhole of_stream = *pinhole;
    of_stream.width_px = KARST_STREAM_WIDTH_PX;
    of_stream.height_px = (int)(most_rays(bounce, pinhole) / KARST_STREAM_WIDTH_PX);
    return of_stream;
}

bool karst_bounce_mirror(karst_bounce *bounce, const karst_cast_view *view, const karst_pinhole *pinhole,
                         const karst_buffer *hits, const karst_buffer *parts, karst_buffer *counters,
                         karst_error *error)
{
    const int width_px = pinhole->width_px, height_px = pinhole->height_px;
    const size_t num_pixels = (size_t)width_px * (size_t)height_px;
    const cl_uint room = most_rays(bounce, pinhole),
                  blocks = karst_bounce_room(width_px, height_px) / block_rays(bounce);
    karst_context *context = bounce->context;
    const size_t local_size = context->lanes == 1 ? GPU_LOCAL_SIZE : 1;
    if (!bounce->rays || bounce->num_beams < num_beams(width_px, height_px) ||
        hits->size_bytes / sizeof(karst_hit) < num_pixels ||
        parts->size_bytes / sizeof(float) < (KARST_RADIANCE_MIRROR_PLANE + 1) * num_pixels)
        return karst_fail(error, KARST_FAILED, "there is no room for the mirrored rays of a picture of %dx%d", width_px,
                          height_px);
    const cl_mem shadows = bounce->shadow_rays ? bounce->shadow_rays->mem : NULL;
    return KARST_ARGUMENTS(bounce->count, error, KARST_VALUE_ARG(width_px), KARST_VALUE_ARG(height_px),
                           KARST_BUFFER_ARG(parts), KARST_BUFFER_ARG(bounce->counts), KARST_VALUE_ARG(blocks)) &&
           karst_launch(context, bounce->count, KARST_STAGE_SHADE, blocks, local_size, error) &&
           KARST_ARGUMENTS(bounce->scan, error, KARST_BUFFER_ARG(bounce->counts), KARST_VALUE_ARG(blocks),
                           KARST_BUFFER_ARG(bounce->total), KARST_BUFFER_ARG(counters)) &&
           karst_launch_scan(context, bounce->scan, error) &&
           KARST_ARGUMENTS(bounce->mirror, error, KARST_VALUE_ARG(*pinhole), KARST_VALUE_ARG(view->detail),
                           KARST_BUFFER_ARG(hits), KARST_BUFFER_ARG(parts), KARST_BUFFER_ARG(bounce->counts),
                           KARST_VALUE_ARG(blocks), KARST_BUFFER_ARG(bounce->rays), KARST_VALUE_ARG(shadows),
                           KARST_VALUE_ARG(room)) &&
           karst_launch(context, bounce->mirror, KARST_STAGE_SHADE, blocks, local_size, error);
}

bool karst_bounce_cast(karst_bounce *bounce, karst_caster *caster, const karst_cast_view *view, bool again,
                       karst_error *error)
{
    const uint32_t room = bounce->limit ? bounce->limit : bounce->room;
    return karst_cast_stream(caster, view, bounce->rays, room, bounce->total, again ? NULL : bounce->hits, error);
}

/* room: places in each of their planes. */
static bool pack_shadows(karst_bounce *bounce, cl_uint room, karst_error *error)
{
    const size_t at_once = (size_t)KARST_PACKED_BEAMS * BEAM_RAYS;
    return !bounce->pack ||
           (KARST_ARGUMENTS(bounce->pack, error, KARST_BUFFER_ARG(bounce->total), KARST_VALUE_ARG(room),
                           KARST_BUFFER_ARG(bounce->shadow_rays), KARST_BUFFER_ARG(bounce->suns)) &&
            karst_launch(bounce->context, bounce->pack, KARST_STAGE_SHADE, (room + at_once - 1) / at_once, 1, error));
}

bool karst_bounce_shade(karst_bounce *bounce, karst_shader *shader, const karst_cast_view *view,
                        const karst_pinhole *pinhole, const karst_light *light, karst_buffer *parts,
                        karst_buffer *counters, karst_error *error)
{
    const karst_shade_stream stream = {.rays = bounce->rays,
                                       .count = bounce->total,
                                       .hits = bounce->hits,
                                       .max_rays = most_rays(bounce, pinhole),
                                       .room = most_rays(bounce, pinhole),
                                       .shadow_rays = bounce->shadow_rays,
                                       .suns = bounce->suns};
    return karst_shade_rays(shader, view, pinhole, light, &stream, parts, counters, error) &&
           (!bounce->sun || pack_shadows(bounce, stream.max_rays, error));
}

bool karst_bounce_cast_shadows(karst_bounce *bounce, karst_caster *caster, const karst_cast_view *view,
                               const karst_pinhole *pinhole, const karst_light *light, bool again, karst_error *error)
{
    const karst_pinhole of_stream = karst_bounce_pinhole(bounce, pinhole);
    return (again || karst_buffer_fill(bounce->marks, 0, 0, most_rays(bounce, pinhole) * sizeof(uint32_t), error)) &&
           karst_cast_stream_shadows(caster, view, &of_stream, light, bounce->shadow_rays,
                                     again ? NULL : bounce->marks->mem, error);
}

bool karst_bounce_cast_more_shadows(karst_bounce *bounce, karst_caster *caster, const karst_cast_view *view,
                                    const karst_pinhole *pinhole, const karst_light *light, bool again,
                                    karst_error *error)
{
    const karst_pinhole of_stream = karst_bounce_pinhole(bounce, pinhole);
    return karst_cast_stream_shadows(caster, view, &of_stream, light, bounce->shadow_rays,
                                     again ? NULL : bounce->marks->mem, error);
}

bool karst_bounce_add_sun(karst_bounce *bounce, const karst_pinhole *pinhole, karst_buffer *parts, karst_error *error)
{
    const int width_px = pinhole->width_px, height_px = pinhole->height_px;
    const cl_uint room = most_rays(bounce, pinhole);
    const size_t lanes = (size_t)bounce->context->lanes, local_size = lanes == 1 ? GPU_LOCAL_SIZE : 16;
    return KARST_ARGUMENTS(bounce->add_sun, error, KARST_VALUE_ARG(width_px), KARST_VALUE_ARG(height_px),
                           KARST_BUFFER_ARG(bounce->shadow_rays), KARST_BUFFER_ARG(bounce->total),
                           KARST_VALUE_ARG(room), KARST_BUFFER_ARG(bounce->suns), KARST_BUFFER_ARG(bounce->marks),
                           KARST_BUFFER_ARG(parts)) &&
           karst_launch(bounce->context, bounce->add_sun, KARST_STAGE_SHADE, room / lanes, local_size, error);
}

karst_bounce_stream karst_bounce_get_stream(const karst_bounce *bounce)
{
    return (karst_bounce_stream){bounce->rays, bounce->hits, bounce->total, bounce->shadow_rays,
                                 bounce->room, bounce->suns, bounce->marks};
}

uint32_t karst_bounce_room(int width_px, int height_px)
{
    return (uint32_t)num_beams(width_px, height_px) * BEAM_RAYS;
}

void karst_bounce_exchange(karst_bounce *bounce, karst_buffer **rays, karst_buffer **total)
{
    karst_buffer *own_rays = bounce->rays, *own_total = bounce->total;
    bounce->rays = *rays;
    bounce->total = *total;
    *rays = own_rays;
    *total = own_total;
}
