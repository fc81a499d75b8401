/* Launching the cast kernels, and localising a stream's anchor in the tree. */
#include "raycast/cast/cast.h"

#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "raycast/cast/hints_shared.h"
#include "raycast/cast/splats.h"

#define NUM_VIEWS 8 /* casts that may be queued before one has to wait for the oldest */
#define RAYS_PER_GROUP (KARST_PACKET_RAYS * KARST_GROUP_PACKETS)
/* Casting takes so many registers that of larger groups fewer rays find room on a processor of an NVIDIA H200. */
#define GPU_LOCAL_SIZE 64

struct karst_caster {
    karst_context *context;
    karst_cache_buffers cache;
    karst_program *program;
    cl_kernel pinhole, survey;
    cl_kernel rays, shadows;          /* NULL: left out */
    cl_kernel anchored;               /* NULL: not asked for */
    const karst_sunward *sunward;     /* borrowed; NULL: none */
    karst_splats *splats;             /* borrowed; NULL: none */
    cl_mem lacking;                   /* borrowed; NULL: nowhere */
    cl_uint lacking_width_px, lacking_height_px;
    bool sun_disc;                    /* KARST_CAST_SUN_DISC */
    bool beams;                       /* a work-item casts a beam, not `lanes` rays */
    karst_buffer *asked;              /* a word that nobody reads: most casts note nothing */
    karst_buffer *view;               /* on the device; written in queue order */
    karst_cast_view views[NUM_VIEWS]; /* what the queued writes read */
    cl_event written[NUM_VIEWS];
    unsigned next_view;
};

karst_caster *karst_caster_create(karst_context *context, const karst_cache_buffers *cache, karst_error *error)
{
    return karst_caster_create_with(context, cache, "", error);
}

karst_caster *karst_caster_create_with(karst_context *context, const karst_cache_buffers *cache, const char *options,
                                       karst_error *error)
{
    karst_caster *caster = calloc(1, sizeof(*caster));
    if (!caster) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    char all_options[512];
    snprintf(all_options, sizeof(all_options), "-DSEGMENTS=%u %s%s", cache->num_segments, options,
             karst_cache_brick_option(cache));
    caster->context = context;
    caster->cache = *cache;
    bool has_rays = !strstr(options, KARST_CAST_NO_STREAMS), has_shadows = !strstr(options, KARST_CAST_NO_SHADOWS);
    bool has_anchored = strstr(options, KARST_CAST_FROM_ANCHOR) != NULL;
    bool beams = context->lanes > 1 && !strstr(options, KARST_CAST_NO_BEAM);
    caster->beams = beams;
    caster->sun_disc = strstr(options, KARST_CAST_SUN_DISC) != NULL;
    caster->view = karst_buffer_create(context, "view", sizeof(karst_cast_view), NULL, error);
    caster->asked = karst_buffer_create(context, "view", sizeof(uint32_t), NULL, error);
    caster->program = karst_program_build(context, "raycast/cast/cast.cl", all_options, NULL, 0, error);
    if (caster->program) {
        caster->pinhole = karst_program_kernel(caster->program, "cast_pinhole", error);
        caster->survey = karst_program_kernel(caster->program, "survey_slopes", error);
        if (has_rays)
            caster->rays = karst_program_kernel(caster->program, "cast_rays", error);
        if (has_shadows)
            caster->shadows = karst_program_kernel(caster->program, "cast_shadows", error);
        if (has_anchored)
            caster->anchored = karst_program_kernel(caster->program, "cast_rays_from_anchor", error);
    }
    if (!caster->view || !caster->asked || !caster->pinhole || !caster->survey || (has_rays && !caster->rays) ||
        (has_shadows && !caster->shadows) || (has_anchored && !caster->anchored)) {
        karst_caster_destroy(caster);
        return NULL;
    }
    return caster;
}

void karst_caster_destroy(karst_caster *caster)
{
    if (!caster)
        return;
    for (int i = 0; i < NUM_VIEWS; i++)
        if (caster->written[i]) {
            clWaitForEvents(1, &caster->written[i]);
            clReleaseEvent(caster->written[i]);
        }
    if (caster->pinhole)
        clReleaseKernel(caster->pinhole);
    if (caster->survey)
        clReleaseKernel(caster->survey);
    if (caster->rays)
        clReleaseKernel(caster->rays);
    if (caster->shadows)
        clReleaseKernel(caster->shadows);
    if (caster->anchored)
        clReleaseKernel(caster->anchored);
    karst_program_destroy(caster->program);
    karst_buffer_destroy(caster->view);
    karst_buffer_destroy(caster->asked);
    free(caster);
}

/* (v * 2^32 + fraction) * 2^-32 as a float, rounded down, so that it stays below the next integer. */
static float float_down(uint64_t v, uint32_t fraction)
{
    unsigned __int128 wide = (unsigned __int128)v << 32 | fraction;
    int shift = 0;
    while (wide >> shift >= 1u << 24)
        shift++;
    return ldexpf((float)(uint32_t)(wide >> shift), shift - 32);
}

void karst_cast_view_init(karst_cast_view *view, const karst_position *anchor, const int64_t root_corner[3],
                          int top_level)
{
    memset(view, 0, sizeof(*view));
    view->top_level = top_level;
    view->detail = 1;
    view->stands_for = 1;
    for (int a = 0; a < 3; a++) {
        view->anchor_voxel[a] = anchor->voxel[a];
        view->anchor_fraction[a] = anchor->fraction[a];
        for (int level = 0; level <= top_level; level++) {
            int shift = KARST_BRICK_CELLS_LOG2 + level;
            int64_t node = anchor->voxel[a] >> shift;
            uint64_t in_node = (uint64_t)anchor->voxel[a] & (((uint64_t)1 << shift) - 1);
            view->levels[level].in_node[a] = ldexpf(float_down(in_node, anchor->fraction[a]), -level);
            uint64_t to_end = ((uint64_t)1 << shift) - in_node - (anchor->fraction[a] != 0);
            view->levels[level].to_end[a] = ldexpf(float_down(to_end, -anchor->fraction[a]), -level);
            view->levels[level].parity |= (uint)(node & 1) << a;
        }
        int64_t root = root_corner[a] - (anchor->voxel[a] >> (KARST_BRICK_CELLS_LOG2 + top_level));
        /* Out there nothing is seen; only overflow must be kept away. */
        view->root[a] = root > 1 << 20 ? 1 << 20 : root < -(1 << 20) ? -(1 << 20) : (int)root;
    }
}

static bool upload_view(karst_caster *caster, const karst_cast_view *view, karst_error *error)
{
    unsigned i = caster->next_view++ % NUM_VIEWS;
    cl_int code = CL_SUCCESS;
    if (caster->written[i]) {
        code = clWaitForEvents(1, &caster->written[i]);
        clReleaseEvent(caster->written[i]);
        caster->written[i] = NULL;
    }
    caster->views[i] = *view;
    if (code == CL_SUCCESS)
        code = clEnqueueWriteBuffer(caster->context->queue, caster->view->mem, CL_FALSE, 0, sizeof(*view),
                                    &caster->views[i], 0, NULL, &caster->written[i]);
    if (code != CL_SUCCESS)
        return karst_fail(error, KARST_FAILED, "cannot upload the view of a cast: %s", karst_cl_error_name(code));
    return true;
}

static bool check_hits(const karst_buffer *hits, uint64_t num_rays, size_t each_bytes, karst_error *error)
{
    if (hits->size_bytes / each_bytes >= num_rays)
        return true;
    return karst_fail(error, KARST_FAILED, "a buffer of %zu bytes cannot hold the hits of %llu rays", hits->size_bytes,
                      (unsigned long long)num_rays);
}

/* Groups of packets in a picture if each takes this many of them, side by side and one below the other. */
static size_t num_groups(int width_px, int height_px, int across, int down)
{
    size_t wide_px = (size_t)(KARST_GROUP_SIDE * across), high_px = (size_t)(KARST_GROUP_SIDE * down);
    return ((size_t)width_px + wide_px - 1) / wide_px * (((size_t)height_px + high_px - 1) / high_px);
}

static size_t local_size(const karst_caster *caster)
{
    const size_t lanes = (size_t)caster->context->lanes;
    return caster->beams ? 1 : lanes == 1 ? GPU_LOCAL_SIZE : RAYS_PER_GROUP / lanes;
}

/* Launches a kernel for all pixels of a picture. */
static bool launch_picture(karst_caster *caster, cl_kernel kernel, int width_px, int height_px, karst_error *error)
{
    const size_t group_size = RAYS_PER_GROUP / (size_t)caster->context->lanes;
    size_t size = caster->beams ? num_groups(width_px, height_px, KARST_BEAM_ACROSS, KARST_BEAM_DOWN)
                                : num_groups(width_px, height_px, 1, 1) * group_size;
    return karst_launch(caster->context, kernel, KARST_STAGE_CAST, size, local_size(caster), error);
}

/* The pools, in the order of POOL_PARAMETERS (raycast/cast/pools.clh), of which `asked` is the last. */
#define POOL_ARGUMENTS(c)                                                                                           \
    KARST_BUFFER_ARG((c).nodes), KARST_BUFFER_ARG((c).brick_info), KARST_BUFFER_ARG((c).bricks[0]),                 \
        KARST_BUFFER_ARG((c).bricks[1]), KARST_BUFFER_ARG((c).bricks[2]), KARST_BUFFER_ARG((c).bricks[3]),          \
        KARST_BUFFER_ARG((c).bricks[4]), KARST_BUFFER_ARG((c).bricks[5]), KARST_BUFFER_ARG((c).bricks[6]),          \
        KARST_BUFFER_ARG((c).bricks[7]), KARST_VALUE_ARG((c).bricks_per_segment), KARST_BUFFER_ARG((c).tile_stamp), \
        KARST_BUFFER_ARG((c).brick_stamp), KARST_BUFFER_ARG((c).brick_fallback), KARST_BUFFER_ARG((c).want_brick),  \
        KARST_BUFFER_ARG((c).want_children), KARST_BUFFER_ARG((c).want_chunk), KARST_BUFFER_ARG((c).want_rays),     \
        KARST_BUFFER_ARG((c).tile_info)

static bool check_asked(const karst_caster *caster, const karst_buffer *asked, const karst_pinhole *pinhole,
                        cl_uint notes, karst_error *error)
{
    return notes == KARST_CAST_NOTES_NOTHING ||
           asked->size_bytes >= karst_cast_asked_bytes(caster->context, pinhole->width_px, pinhole->height_px) ||
           karst_fail(error, KARST_FAILED, "a buffer of %zu bytes cannot hold what a picture of %dx%d asks for",
                      asked->size_bytes, pinhole->width_px, pinhole->height_px);
}

static bool check_hints(const karst_caster *caster, const karst_buffer *hints, const karst_pinhole *pinhole,
                        karst_error *error)
{
    return !hints ||
           hints->size_bytes >=
               karst_cast_hint_bytes(caster->context, &caster->cache, pinhole->width_px, pinhole->height_px) ||
           karst_fail(error, KARST_FAILED, "a buffer of %zu bytes cannot hold the hints of a picture of %dx%d",
                      hints->size_bytes, pinhole->width_px, pinhole->height_px);
}

static bool cast_pinhole(karst_caster *caster, const karst_cast_view *view, const karst_pinhole *pinhole,
                         karst_buffer *hits, const karst_buffer *asked, const karst_buffer *hints, cl_uint notes,
                         karst_error *error)
{
    const cl_mem written = hits ? hits->mem : NULL, hinted = hints ? hints->mem : NULL;
    const cl_uint num_slots = caster->cache.num_segments * caster->cache.bricks_per_segment;
    if (!check_hints(caster, hints, pinhole, error) || !check_asked(caster, asked, pinhole, notes, error) ||
        !(!hits ||
          check_hits(hits, (uint64_t)pinhole->width_px * (uint64_t)pinhole->height_px, sizeof(karst_hit), error)) ||
        !KARST_ARGUMENTS(caster->pinhole, error, POOL_ARGUMENTS(caster->cache), KARST_BUFFER_ARG(asked),
                         KARST_BUFFER_ARG(caster->view), KARST_VALUE_ARG(*pinhole), KARST_VALUE_ARG(written),
                         KARST_VALUE_ARG(notes), KARST_VALUE_ARG(hinted), KARST_VALUE_ARG(num_slots)) ||
        !upload_view(caster, view, error)) /* last: cores begin with it */
        return false;
    return launch_picture(caster, caster->pinhole, pinhole->width_px, pinhole->height_px, error) &&
           (!hits || !caster->splats || karst_splats_pinhole(caster->splats, view, pinhole, hits, error));
}

bool karst_cast_pinhole(karst_caster *caster, const karst_cast_view *view, const karst_pinhole *pinhole,
                        karst_buffer *hits, karst_error *error)
{
    return cast_pinhole(caster, view, pinhole, hits, caster->asked, NULL, KARST_CAST_NOTES_NOTHING, error);
}

bool karst_cast_picture(karst_caster *caster, const karst_cast_view *view, const karst_pinhole *pinhole,
                        karst_buffer *hits, karst_buffer *asked, karst_buffer *hints, karst_error *error)
{
    return cast_pinhole(caster, view, pinhole, hits, asked, hints, KARST_CAST_NOTES_ASKED, error);
}

bool karst_cast_again(karst_caster *caster, const karst_cast_view *view, const karst_pinhole *pinhole,
                      karst_buffer *asked, karst_error *error)
{
    return cast_pinhole(caster, view, pinhole, NULL, asked, NULL, KARST_CAST_WHO_ASKED, error);
}

size_t karst_cast_hint_bytes(const karst_context *context, const karst_cache_buffers *cache, int width_px,
                             int height_px)
{
    /* As CAST_HINTS in raycast/cast/hints.clh. */
    if (context->lanes == 1 || cache->brick_bits == 32)
        return 0;
    return num_groups(width_px, height_px, KARST_BEAM_ACROSS, KARST_BEAM_DOWN) * sizeof(karst_beam_hints);
}

size_t karst_cast_asked_bytes(const karst_context *context, int width_px, int height_px)
{
    /* A word for each work-item, and the first, which is nobody's. Beams, of which there are fewest, have two more each
     * for their packets. */
    return (1 + num_groups(width_px, height_px, 1, 1) * (RAYS_PER_GROUP / (size_t)context->lanes)) * sizeof(uint32_t);
}

static bool check_rays(const karst_caster *caster, const karst_buffer *rays, uint32_t num_rays, karst_error *error)
{
    if (!caster->rays)
        return karst_fail(error, KARST_FAILED, "the caster was made without streams");
    return rays->size_bytes / sizeof(karst_ray) >= num_rays ||
           karst_fail(error, KARST_FAILED, "a buffer of %zu bytes does not hold %u rays", rays->size_bytes, num_rays);
}

static bool launch_rays(karst_caster *caster, cl_kernel kernel, uint32_t num_rays, karst_error *error)
{
    const size_t rays_per_item =
        caster->beams ? KARST_PACKET_RAYS * KARST_BEAM_PACKETS : (size_t)caster->context->lanes;
    return karst_launch(caster->context, kernel, KARST_STAGE_CAST, (num_rays + rays_per_item - 1) / rays_per_item,
                        local_size(caster), error);
}

static bool cast_rays(karst_caster *caster, const karst_cast_view *view, const karst_buffer *rays, uint32_t num_rays,
                      cl_mem count, cl_uint wanted, const karst_buffer *hits, karst_error *error)
{
    const size_t each_bytes = wanted == KARST_CAST_WHETHER ? sizeof(uint32_t) : sizeof(karst_hit);
    if (!check_rays(caster, rays, num_rays, error) || (hits && !check_hits(hits, num_rays, each_bytes, error)) ||
        !upload_view(caster, view, error))
        return false;
    const cl_mem written = hits ? hits->mem : NULL;
    return KARST_ARGUMENTS(caster->rays, error, POOL_ARGUMENTS(caster->cache), KARST_BUFFER_ARG(caster->asked),
                           KARST_BUFFER_ARG(caster->view), KARST_BUFFER_ARG(rays), KARST_VALUE_ARG(num_rays),
                           KARST_VALUE_ARG(wanted), KARST_VALUE_ARG(written), KARST_VALUE_ARG(count),
                           KARST_VALUE_ARG(caster->lacking), KARST_VALUE_ARG(caster->lacking_width_px),
                           KARST_VALUE_ARG(caster->lacking_height_px)) &&
           launch_rays(caster, caster->rays, num_rays, error) &&
           (!hits || !caster->splats || !num_rays ||
            karst_splats_rays(caster->splats, view, rays, num_rays, count, wanted, hits, error));
}

bool karst_cast_rays_from_anchor(karst_caster *caster, const karst_cast_view *view, const karst_buffer *rays,
                                 uint32_t num_rays, karst_buffer *hits, karst_error *error)
{
    if (!caster->anchored)
        return karst_fail(error, KARST_FAILED, "the caster was made without rays from the anchor");
    return check_rays(caster, rays, num_rays, error) && check_hits(hits, num_rays, sizeof(karst_hit), error) &&
           upload_view(caster, view, error) &&
           KARST_ARGUMENTS(caster->anchored, error, POOL_ARGUMENTS(caster->cache), KARST_BUFFER_ARG(caster->asked),
                           KARST_BUFFER_ARG(caster->view), KARST_BUFFER_ARG(rays), KARST_VALUE_ARG(num_rays),
                           KARST_BUFFER_ARG(hits)) &&
           launch_rays(caster, caster->anchored, num_rays, error);
}

bool karst_cast_rays(karst_caster *caster, const karst_cast_view *view, karst_buffer *rays, uint32_t num_rays,
                     bool any_hit, karst_buffer *hits, karst_error *error)
{
    return cast_rays(caster, view, rays, num_rays, NULL, any_hit ? KARST_CAST_ANY_HIT : KARST_CAST_HITS, hits, error);
}

bool karst_cast_stream(karst_caster *caster, const karst_cast_view *view, const karst_buffer *rays, uint32_t num_rays,
                       const karst_buffer *count, karst_buffer *hits, karst_error *error)
{
    return cast_rays(caster, view, rays, num_rays, count->mem, KARST_CAST_HITS, hits, error);
}

bool karst_cast_stream_marks(karst_caster *caster, const karst_cast_view *view, const karst_buffer *rays,
                             uint32_t num_rays, const karst_buffer *count, karst_buffer *marks, karst_error *error)
{
    return cast_rays(caster, view, rays, num_rays, count->mem, KARST_CAST_WHETHER, marks, error);
}

size_t karst_cast_shadow_bytes(int width_px, int height_px)
{
    return (size_t)width_px * (size_t)height_px * KARST_SHADOW_FIELDS * sizeof(float);
}

bool karst_cast_check_shadow_rays(const karst_buffer *rays, const karst_pinhole *pinhole, karst_error *error)
{
    if (rays->size_bytes >= karst_cast_shadow_bytes(pinhole->width_px, pinhole->height_px))
        return true;
    return karst_fail(error, KARST_FAILED, "a buffer of %zu bytes does not hold the shadow rays of a picture of %dx%d",
                      rays->size_bytes, pinhole->width_px, pinhole->height_px);
}

void karst_caster_set_splats(karst_caster *caster, karst_splats *splats) { caster->splats = splats; }

void karst_caster_note_lacking(karst_caster *caster, const karst_buffer *lacking, int width_px, int height_px)
{
    caster->lacking = lacking ? lacking->mem : NULL;
    caster->lacking_width_px = (cl_uint)width_px;
    caster->lacking_height_px = (cl_uint)height_px;
}

void karst_caster_set_sunward(karst_caster *caster, const karst_sunward *sunward) { caster->sunward = sunward; }

/* The disc that sample `sample` of the pixels sees a place on. */
static void spread_sun(karst_shadow_sun *sun, uint32_t sample)
{
    const float *d = sun->direction;
    /* Across the axis that the direction is farthest from. */
    int axis = 0;
    for (int a = 1; a < 3; a++)
        if (fabsf(d[a]) < fabsf(d[axis]))
            axis = a;
    const int next = (axis + 1) % 3, last = (axis + 2) % 3;
    const float length = sqrtf(d[next] * d[next] + d[last] * d[last]), radius = 0.5f * KARST_SUN_CONE;
    sun->sample = sample;
    sun->across[next] = -d[last] / length * radius;
    sun->across[last] = d[next] / length * radius;
    for (int a = 0; a < 3; a++) {
        const int b = (a + 1) % 3, c = (a + 2) % 3;
        sun->along[a] = d[b] * sun->across[c] - d[c] * sun->across[b];
    }
}

karst_shadow_sun karst_cast_shadow_sun(const karst_caster *caster, const karst_pinhole *pinhole,
                                       const karst_light *light, bool of_stream)
{
    karst_shadow_sun sun = {.t_max = light->shadow_distance,
                            .cone = pinhole->cone > KARST_SUN_CONE ? pinhole->cone : KARST_SUN_CONE,
                            .width_px = pinhole->width_px,
                            .height_px = pinhole->height_px,
                            .of_stream = of_stream,
                            .x0_px = pinhole->x0_px,
                            .y0_px = pinhole->y0_px};
    memcpy(sun.direction, light->sun_direction, 3 * sizeof(float));
    if (caster->sun_disc)
        spread_sun(&sun, pinhole->sample);
    return sun;
}

/* What a cast of shadow rays takes, and where it notes what. */
typedef struct {
    const karst_buffer *rays;
    cl_mem pixels;                     /* NULL: they are left alone */
    const karst_buffer *asked, *hints; /* hints NULL: none */
    cl_uint notes;
    bool of_stream;
} shadow_cast;

static bool cast_shadows(karst_caster *caster, const karst_cast_view *view, const karst_pinhole *pinhole,
                         const karst_light *light, const shadow_cast *cast, karst_error *error)
{
    if (!caster->shadows)
        return karst_fail(error, KARST_FAILED, "the caster was made without shadows");
    const karst_shadow_sun sun = karst_cast_shadow_sun(caster, pinhole, light, cast->of_stream);
    const bool known = !caster->sun_disc && caster->sunward && karst_sunward_is_aimed(caster->sunward, sun.direction);
    const cl_mem hinted = cast->hints ? cast->hints->mem : NULL;
    const cl_uint num_slots = caster->cache.num_segments * caster->cache.bricks_per_segment;
    cl_mem bricks = known ? karst_sunward_bricks(caster->sunward)->mem : NULL;
    if (!karst_cast_check_shadow_rays(cast->rays, pinhole, error) || !upload_view(caster, view, error) ||
        !check_asked(caster, cast->asked, pinhole, cast->notes, error) ||
        !check_hints(caster, cast->hints, pinhole, error) ||
        !KARST_ARGUMENTS(caster->shadows, error, POOL_ARGUMENTS(caster->cache), KARST_BUFFER_ARG(cast->asked),
                         KARST_BUFFER_ARG(caster->view), KARST_VALUE_ARG(sun), KARST_BUFFER_ARG(cast->rays),
                         KARST_VALUE_ARG(cast->pixels), KARST_VALUE_ARG(cast->notes), KARST_VALUE_ARG(bricks),
                         KARST_VALUE_ARG(hinted), KARST_VALUE_ARG(num_slots)))
        return false;
    return launch_picture(caster, caster->shadows, pinhole->width_px, pinhole->height_px, error) &&
           (!cast->pixels || !caster->splats ||
            karst_splats_shadows(caster->splats, view, &sun, cast->rays, cast->pixels, error));
}

bool karst_cast_shadows(karst_caster *caster, const karst_cast_view *view, const karst_pinhole *pinhole,
                        const karst_light *light, const karst_buffer *rays, cl_mem pixels, karst_error *error)
{
    const shadow_cast cast = {rays, pixels, caster->asked, NULL, KARST_CAST_NOTES_NOTHING, false};
    return cast_shadows(caster, view, pinhole, light, &cast, error);
}

bool karst_cast_stream_shadows(karst_caster *caster, const karst_cast_view *view, const karst_pinhole *pinhole,
                               const karst_light *light, const karst_buffer *rays, cl_mem marks, karst_error *error)
{
    const shadow_cast cast = {rays, marks, caster->asked, NULL, KARST_CAST_NOTES_NOTHING, true};
    return cast_shadows(caster, view, pinhole, light, &cast, error);
}

bool karst_cast_picture_shadows(karst_caster *caster, const karst_cast_view *view, const karst_pinhole *pinhole,
                                const karst_light *light, const karst_buffer *rays, cl_mem pixels, karst_buffer *asked,
                                karst_buffer *hints, karst_error *error)
{
    const shadow_cast cast = {rays, pixels, asked, hints, KARST_CAST_NOTES_ASKED, false};
    return cast_shadows(caster, view, pinhole, light, &cast, error);
}

bool karst_cast_shadows_again(karst_caster *caster, const karst_cast_view *view, const karst_pinhole *pinhole,
                              const karst_light *light, const karst_buffer *rays, karst_buffer *asked,
                              karst_error *error)
{
    const shadow_cast cast = {rays, NULL, asked, NULL, KARST_CAST_WHO_ASKED, false};
    return cast_shadows(caster, view, pinhole, light, &cast, error);
}

bool karst_caster_survey_slopes(karst_caster *caster, uint32_t first, uint32_t end, karst_error *error)
{
    const karst_cache_buffers *c = &caster->cache;
    const uint32_t num_slots = (uint32_t)(c->brick_owner->size_bytes / sizeof(karst_brick_owner));
    const size_t lanes = (size_t)caster->context->lanes;
    end = end < num_slots ? end : num_slots;
    return first >= end ||
           (KARST_ARGUMENTS(caster->survey, error, KARST_BUFFER_ARG(c->brick_owner), KARST_BUFFER_ARG(c->brick_info),
                            KARST_BUFFER_ARG(c->bricks[0]), KARST_BUFFER_ARG(c->bricks[1]),
                            KARST_BUFFER_ARG(c->bricks[2]), KARST_BUFFER_ARG(c->bricks[3]),
                            KARST_BUFFER_ARG(c->bricks[4]), KARST_BUFFER_ARG(c->bricks[5]),
                            KARST_BUFFER_ARG(c->bricks[6]), KARST_BUFFER_ARG(c->bricks[7]),
                            KARST_VALUE_ARG(c->bricks_per_segment), KARST_VALUE_ARG(first), KARST_VALUE_ARG(end)) &&
            karst_launch(caster->context, caster->survey, KARST_STAGE_FINALISE, (end - first + lanes - 1) / lanes, 1,
                         error));
}
