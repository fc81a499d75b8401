/* Light that media scatter often: the cells that it goes through. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "raycast/media/fluence_internal.h"

#define GPU_LOCAL_SIZE 64

bool karst_fluence_build_fill(karst_fluence *f, karst_error *error)
{
    const karst_media *media = f->media;
    const karst_shade_colour *look = &media->config.look;
    const karst_virtual_file world = {"world.clh", look->source};
    const uint32_t segments =
        media->land.num_segments > media->air.num_segments ? media->land.num_segments : media->air.num_segments;
    char options[1024];
    snprintf(options, sizeof options, "-DSEGMENTS=%u -DCAST_NO_BEAM %s -DMEDIA_MODE=%u %s", segments,
             karst_cache_brick_option(&media->air), media->config.mode, look->options);
    f->filling = karst_program_build(media->context, "raycast/media/fluence_fill.cl", options, &world, 1, error);
    return f->filling && (f->fill = karst_program_kernel(f->filling, "fluence_fill", error)) &&
           (f->open = karst_program_kernel(f->filling, "fluence_open", error));
}

bool karst_fluence_launch(const karst_fluence *f, cl_kernel kernel, size_t num_items, karst_error *error)
{
    const size_t local_size = f->media->context->lanes == 1 ? GPU_LOCAL_SIZE : 1;
    return karst_launch(f->media->context, kernel, KARST_STAGE_SUN_DEPTH,
                        (num_items + local_size - 1) / local_size * local_size, local_size, error);
}

size_t karst_fluence_num_cells(const karst_fluence_place *p)
{
    return (size_t)p->size[0] * (size_t)p->size[1] * (size_t)p->size[2];
}

bool karst_fluence_is_same(const karst_fluence_place *a, const karst_fluence_place *b)
{
    bool same = a->cell_log2 == b->cell_log2;
    for (int axis = 0; axis < 3; axis++)
        same = same && a->corner[axis] == b->corner[axis] && a->size[axis] == b->size[axis];
    return same;
}

static float from_voxel(int64_t at, int64_t voxel, uint32_t fraction)
{
    return (float)((double)(at - voxel) - ldexp(fraction, -32));
}

/* From a place in the world, level-0 voxels and a fraction of one in 2^-32. */
karst_fluence_box karst_fluence_box_from(const karst_fluence_place *p, const karst_fluence_place *region,
                                         const int64_t voxel[3], const uint32_t fraction[3])
{
    karst_fluence_box box = {.cell = (float)ldexp(1, p->cell_log2)};
    for (int axis = 0; axis < 3; axis++) {
        const int64_t end = region->corner[axis] + ((int64_t)region->size[axis] << region->cell_log2);
        box.size[axis] = p->size[axis];
        box.corner[axis] = from_voxel(p->corner[axis], voxel[axis], fraction[axis]);
        box.from[axis] = from_voxel(region->corner[axis], voxel[axis], fraction[axis]);
        box.to[axis] = from_voxel(end, voxel[axis], fraction[axis]);
    }
    return box;
}

/* From their own corner. */
karst_fluence_box karst_fluence_own_box(const karst_fluence_grid *g)
{
    return karst_fluence_box_from(&g->box, &g->region, g->box.corner, (const uint32_t[]){0, 0, 0});
}

cl_uint karst_fluence_base(const karst_fluence *f, const karst_fluence_grid *g)
{
    return (cl_uint)(g - f->grids) * KARST_FLUENCE_MOST_CELLS;
}

/* ---- where the medium is ---- */

/* What an eye anywhere in a cube of an eighth of the view, or of what is near, can see for sure, in cells half as wide
 * as that cube. */
karst_fluence_place karst_fluence_region(const karst_media_picture *picture, bool is_near)
{
    const float reach = fminf(fmaxf(picture->pinhole->t_max / (is_near ? KARST_FLUENCE_FARTHER : 1), 64), 0x1p40f);
    const int step_log2 = ilogbf(reach) - 3;
    const int64_t step = (int64_t)1 << step_log2, half = ((int64_t)reach / step - 1) * step;
    karst_fluence_place p = {.cell_log2 = step_log2 - 1};
    for (int axis = 0; axis < 3; axis++) {
        p.corner[axis] = ((picture->anchor->voxel[axis] + step / 2) >> step_log2) * step - half;
        p.size[axis] = (int)(4 * half / step);
    }
    return p;
}

/* A cell more on each side, in whole blocks. */
static void frame_at(karst_fluence_place *p, const karst_fluence_place *from, const int32_t *found, int cell_log2)
{
    p->cell_log2 = cell_log2;
    for (int axis = 0; axis < 3; axis++) {
        const int least = found[KARST_FLUENCE_LEAST + axis], most = found[KARST_FLUENCE_MOST + axis],
                  low = least > 0 ? least - 1 : 0, high = most + 2 < from->size[axis] ? most + 2 : from->size[axis];
        const int64_t side = (int64_t)(high - low) << from->cell_log2,
                      block = (int64_t)KARST_FLUENCE_BLOCK << cell_log2;
        p->corner[axis] = from->corner[axis] + ((int64_t)low << from->cell_log2);
        p->size[axis] = (int)((side + block - 1) / block) * KARST_FLUENCE_BLOCK;
    }
}

/* The box of what was found, in cells as small as may be. */
static karst_fluence_place frame(const karst_fluence_place *from, const int32_t *found)
{
    karst_fluence_place p, next;
    frame_at(&p, from, found, from->cell_log2);
    for (int cell_log2 = from->cell_log2 - 1; cell_log2 >= 1; cell_log2--) {
        frame_at(&next, from, found, cell_log2);
        if ((double)next.size[0] * next.size[1] * next.size[2] > KARST_FLUENCE_MOST_CELLS)
            break;
        p = next;
    }
    return p;
}

static const int32_t nothing_found[KARST_FLUENCE_FOUND] = {INT32_MAX, INT32_MAX, INT32_MAX, -1, -1, -1, 0};

/* *done: nothing is missing, and the box stays as it is. */
bool karst_fluence_fill(karst_fluence *f, karst_fluence_grid *g, const karst_media_picture *picture, bool *done,
                        karst_error *error)
{
    karst_media *media = f->media;
    const cl_uint base = karst_fluence_base(f, g),
                  with_land = media->config.land && media->config.mode == KARST_MEDIA_FULL;
    const size_t lanes = (size_t)media->context->lanes;
    *done = false;
    for (;;) {
        const karst_media_task task = karst_media_task_of(media, picture->metres, 1, INFINITY);
        const karst_shade_anchor eye = karst_media_anchor(picture->anchor);
        const karst_fluence_box box = karst_fluence_own_box(g);
        karst_shade_anchor corner = {.pad = 0};
        int32_t found[KARST_FLUENCE_FOUND];
        memcpy(corner.voxel, g->box.corner, sizeof corner.voxel);
        if (!karst_buffer_write(f->found, 0, nothing_found, sizeof nothing_found, error) ||
            !karst_media_send_view(media, picture->view, error) ||
            !KARST_ARGUMENTS(f->fill, error, POOL_ARGUMENTS(media->air, media->asked),
                             POOL_ARGUMENTS(media->land, media->asked), KARST_VALUE_ARG(with_land),
                             KARST_BUFFER_ARG(media->view),
                             KARST_VALUE_ARG(task), KARST_VALUE_ARG(eye), KARST_VALUE_ARG(corner),
                             KARST_VALUE_ARG(box), KARST_VALUE_ARG(g->coarser), KARST_VALUE_ARG(base),
                             KARST_BUFFER_ARG(f->extinction),
                             KARST_BUFFER_ARG(f->look), KARST_BUFFER_ARG(f->open_shares), KARST_BUFFER_ARG(f->found),
                             KARST_VALUE_ARG(media->data)) ||
            !karst_fluence_launch(f, f->fill, (karst_fluence_num_cells(&g->box) + lanes - 1) / lanes, error) ||
            !karst_buffer_read(f->found, 0, found, sizeof found, error))
            return false;
        if (found[KARST_FLUENCE_MISSING])
            return true;
        if (found[KARST_FLUENCE_MOST] < 0) {
            g->box = (karst_fluence_place){.cell_log2 = 0};
            *done = true;
            return true;
        }
        const karst_fluence_place next = frame(&g->box, found);
        if (karst_fluence_is_same(&next, &g->box)) {
            *done = true;
            return true;
        }
        g->box = next;
    }
}

/* ---- land ---- */

/* Where land hides the sun. */
bool karst_fluence_look_for_sun(karst_fluence *f, const karst_fluence_grid *g, const karst_media_picture *picture,
                                bool *done, karst_error *error)
{
    karst_media *media = f->media;
    const size_t lanes = (size_t)media->context->lanes;
    const karst_light *light = &g->lit;
    const karst_shade_anchor eye = karst_media_anchor(picture->anchor);
    const karst_fluence_box box = karst_fluence_own_box(g);
    const cl_uint base = karst_fluence_base(f, g);
    const cl_float4 to_sun = {{light->sun_direction[0], light->sun_direction[1], light->sun_direction[2], 0}};
    karst_shade_anchor corner = {.pad = 0};
    int32_t found[KARST_FLUENCE_FOUND];
    *done = true;
    if (!g->task.has_land || karst_fluence_num_cells(&g->box) == 0 || g->task.num_sun == 0)
        return true;
    memcpy(corner.voxel, g->box.corner, sizeof corner.voxel);
    if (!karst_buffer_write(f->found, 0, nothing_found, sizeof nothing_found, error) ||
        !karst_media_send_view(media, picture->view, error) ||
        !KARST_ARGUMENTS(f->open, error, POOL_ARGUMENTS(media->land, media->asked), KARST_BUFFER_ARG(media->view),
                         KARST_VALUE_ARG(eye), KARST_VALUE_ARG(corner), KARST_VALUE_ARG(box),
                         KARST_VALUE_ARG(g->coarser), KARST_VALUE_ARG(base),
                         KARST_VALUE_ARG(to_sun), KARST_VALUE_ARG(light->shadow_distance),
                         KARST_BUFFER_ARG(f->extinction),
                         KARST_BUFFER_ARG(f->open_shares), KARST_BUFFER_ARG(f->found)) ||
        !karst_fluence_launch(f, f->open, (karst_fluence_num_cells(&g->box) + lanes - 1) / lanes, error) ||
        !karst_buffer_read(f->found, 0, found, sizeof found, error))
        return false;
    *done = found[KARST_FLUENCE_MISSING] == 0;
    return true;
}
