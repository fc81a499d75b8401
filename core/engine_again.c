/* Looking again at a picture that stands, where it is provisional: rays as dense as its own, that ask for what is still
 * missing there once something was made. So most of what a picture lacks is asked for without drawing it anew. */
#include <string.h>

#include "core/engine_parts.h"

/* Part of a picture's groups: with more it is cheaper to cast all of it. */
#define MOST_GROUPS (1.0 / 3)
/* Of groups: there is room for as many hits in any case. */
#define LONGEST_RUN (4096 / (KARST_GROUP_SIDE * KARST_GROUP_SIDE))

static int num_groups(int side_px) { return (side_px + KARST_GROUP_SIDE - 1) / KARST_GROUP_SIDE; }

/* Marks the groups of pixels in which some ray ended on something provisional, in the picture's hits as they are. */
static bool mark_groups(karst_engine *engine, uint32_t *num_marked, karst_error *error)
{
    const uint32_t width_px = (uint32_t)engine->width_px, height_px = (uint32_t)engine->height_px;
    const int across = num_groups(engine->width_px), down = num_groups(engine->height_px);
    cl_int code;
    const karst_hit *hits =
        clEnqueueMapBuffer(engine->context->queue, engine->hits->mem, CL_TRUE, CL_MAP_READ, 0,
                           (size_t)width_px * height_px * sizeof *hits, 0, NULL, NULL, &code);
    if (!hits)
        return karst_fail(error, KARST_FAILED, "cannot look at hits: %s", karst_cl_error_name(code));
    memset(engine->marks, 0, (size_t)across * (size_t)down);
    *num_marked = 0;
    /* Blocks of 4 x 4 pixels lie together. */
    for (uint32_t y = 0; y < height_px; y += 4)
        for (uint32_t x = 0; x < width_px; x += 4) {
            uint8_t *mark = engine->marks + (y / KARST_GROUP_SIDE) * (uint32_t)across + x / KARST_GROUP_SIDE;
            if (*mark)
                continue;
            const karst_hit *block = hits + karst_packet_order(x, y, width_px, height_px);
            uint32_t num = (width_px - x < 4 ? width_px - x : 4) * (height_px - y < 4 ? height_px - y : 4);
            for (uint32_t i = 0; i < num && !*mark; i++)
                *mark = KARST_HIT_KIND(block[i].kind) == KARST_HIT_PROVISIONAL;
            *num_marked += *mark;
        }
    code = clEnqueueUnmapMemObject(engine->context->queue, engine->hits->mem, (void *)hits, 0, NULL, NULL);
    return code == CL_SUCCESS ||
           karst_fail(error, KARST_FAILED, "cannot leave hits: %s", karst_cl_error_name(code));
}

/* The rays of a part of the picture; what they hit is of no interest. */
static bool cast_part(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *picture, int x_px,
                      int y_px, int width_px, int height_px, karst_error *error)
{
    karst_pinhole part = *picture;
    float across = 2.0f * ((float)x_px + 0.5f * (float)width_px) / (float)picture->width_px - 1;
    float up = 1 - 2.0f * ((float)y_px + 0.5f * (float)height_px) / (float)picture->height_px;
    for (int axis = 0; axis < 3; axis++)
        part.forward[axis] += across * picture->half_width * picture->right[axis] +
                              up * picture->half_height * picture->up[axis];
    part.width_px = width_px;
    part.height_px = height_px;
    part.half_width *= (float)width_px / (float)picture->width_px;
    part.half_height *= (float)height_px / (float)picture->height_px;
    return karst_cast_pinhole(engine->caster, view, &part, engine->scout_hits, error);
}

/* Runs of marked groups, row by row. */
static bool cast_marked(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                        karst_error *error)
{
    const int across = num_groups(engine->width_px), down = num_groups(engine->height_px);
    for (int row = 0; row < down; row++)
        for (int first = 0, last; first < across; first = last > first ? last : first + 1) {
            const uint8_t *marks = engine->marks + row * across;
            for (last = first; last < across && last < first + LONGEST_RUN && marks[last]; last++)
                ;
            int x_px = first * KARST_GROUP_SIDE, y_px = row * KARST_GROUP_SIDE;
            int end_px = last * KARST_GROUP_SIDE < engine->width_px ? last * KARST_GROUP_SIDE : engine->width_px;
            int height_px = engine->height_px - y_px < KARST_GROUP_SIDE ? engine->height_px - y_px : KARST_GROUP_SIDE;
            if (last > first &&
                !cast_part(engine, view, pinhole, x_px, y_px, end_px - x_px, height_px, error))
                return false;
        }
    return true;
}

bool karst_engine_look_again(karst_engine *engine, bool *is_whole, karst_error *error)
{
    const int num = num_groups(engine->width_px) * num_groups(engine->height_px);
    uint32_t num_marked = 0;
    karst_cast_view view;
    karst_pinhole pinhole;
    karst_engine_picture_view(engine, &view, &pinhole);
    if (!mark_groups(engine, &num_marked, error))
        return false;
    *is_whole = num_marked > MOST_GROUPS * num;
    return *is_whole ? karst_cast_pinhole(engine->caster, &view, &pinhole, engine->hits, error)
                     : cast_marked(engine, &view, &pinhole, error);
}

size_t karst_engine_num_marks(int width_px, int height_px)
{
    return (size_t)num_groups(width_px) * (size_t)num_groups(height_px);
}
