/* Light that media scatter often: what is launched when. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "raycast/media/fluence_internal.h"

#define LAUNCH_PACKETS (1u << 16)
/* Of what packets carry, in units of colour: less is dark. */
#define LEAST_POWER 1e-12
#define LEDGER_BYTES (KARST_FLUENCE_SUMS * 2 * sizeof(uint32_t))

/* ---- what it is made of ---- */

static bool build(karst_fluence *f, karst_error *error)
{
    const char *options = f->media->config.has_phase ? "-DMEDIA_FLUENCE_PHASE" : "";
    if (!karst_fluence_build_fill(f, error))
        return false;
    f->tracing = karst_program_build(f->media->context, "raycast/media/fluence.cl", options, NULL, 0, error);
    return f->tracing && (f->bound = karst_program_kernel(f->tracing, "fluence_bound", error)) &&
           (f->trace = karst_program_kernel(f->tracing, "fluence_trace", error)) &&
           (f->pack = karst_program_kernel(f->tracing, "fluence_pack", error));
}

static size_t num_words(const karst_fluence *f)
{
    return f->media->config.has_phase ? KARST_FLUENCE_PHASE_WORDS : KARST_FLUENCE_WORDS;
}

karst_fluence *karst_fluence_create(karst_media *media, karst_error *error)
{
    karst_fluence *f = calloc(1, sizeof *f);
    karst_context *context = media->context;
    const size_t num = (size_t)KARST_FLUENCE_GRIDS * KARST_FLUENCE_MOST_CELLS;
    if (!f) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    f->media = media;
    f->num_packets = media->config.fluence_packets ? media->config.fluence_packets : KARST_FLUENCE_PACKETS;
    if ((f->extinction = karst_buffer_create_blank(context, "fluence", num * sizeof(float), error)) &&
        (f->look = karst_buffer_create_blank(context, "fluence", num * 4 * sizeof(float), error)) &&
        (f->open_shares = karst_buffer_create_blank(context, "fluence", num * sizeof(uint32_t), error)) &&
        (f->bounds = karst_buffer_create_blank(context, "fluence", num / 64 * sizeof(float), error)) &&
        (f->sums = karst_buffer_create_blank(context, "fluence", num * num_words(f) * sizeof(uint32_t), error)) &&
        (f->words = karst_buffer_create_blank(context, "fluence", num * 2 * sizeof(uint32_t), error)) &&
        (f->ledger = karst_buffer_create(context, "fluence", KARST_FLUENCE_GRIDS * LEDGER_BYTES, NULL, error)) &&
        (f->found = karst_buffer_create(context, "fluence", KARST_FLUENCE_FOUND * sizeof(int32_t), NULL, error)) &&
        build(f, error))
        return f;
    karst_fluence_destroy(f);
    return NULL;
}

void karst_fluence_destroy(karst_fluence *f)
{
    if (!f)
        return;
    cl_kernel kernels[] = {f->fill, f->open, f->bound, f->trace, f->pack};
    for (size_t i = 0; i < sizeof kernels / sizeof *kernels; i++)
        if (kernels[i])
            clReleaseKernel(kernels[i]);
    karst_program_destroy(f->filling);
    karst_program_destroy(f->tracing);
    karst_buffer *buffers[] = {f->extinction, f->look,  f->open_shares, f->bounds,
                               f->sums,       f->words, f->ledger,      f->found};
    for (size_t i = 0; i < sizeof buffers / sizeof *buffers; i++)
        karst_buffer_destroy(buffers[i]);
    free(f);
}

void karst_fluence_change(karst_fluence *f, bool at_once)
{
    for (karst_fluence_grid *g = f->grids; g < f->grids + KARST_FLUENCE_GRIDS; g++) {
        if (at_once) {
            g->is_known = false;
            g->region = (karst_fluence_place){.cell_log2 = 0}; /* none is like it */
        }
        g->is_stale = true;
    }
}

/* ---- its light ---- */

static karst_fluence_source source_of(const karst_light *light)
{
    karst_fluence_source s = {.direction = {0}};
    const float height = light->sun_direction[1] > 0 ? light->sun_direction[1] : 0;
    for (int i = 0; i < 3; i++) {
        s.direction[i] = light->sun_direction[i];
        s.sun[i] = light->sun_colour[i];
        /* As light_from_around (raycast/light/light.clh). */
        s.above[i] = 0.5f * (light->sky_zenith[i] + light->sky_horizon[i]);
        s.below[i] = light->ground_flat[i] * (s.above[i] + 0.5f * height * light->sun_colour[i]);
    }
    return s;
}

static double most_of(const float c[3]) { return fmax(fmax(c[0], c[1]), c[2]); }

/* Packets of the sun and of what is around carry as much, and are as many as those bring. */
static void plan(const karst_fluence *f, karst_fluence_grid *g, const karst_media_picture *picture)
{
    const karst_fluence_source *s = &g->light;
    const int *size = g->box.size;
    const double areas[3] = {(double)size[1] * size[2], (double)size[0] * size[2], (double)size[0] * size[1]};
    double across = 0, all = 0;
    karst_fluence_task *task = &g->task;
    *task = (karst_fluence_task){.grid = (uint32_t)(g - f->grids),
                                 .has_land = f->media->config.land && f->media->config.mode == KARST_MEDIA_FULL &&
                                             picture->has_sun};
    for (int axis = 0; axis < 3; axis++) {
        const double part = areas[axis] * fabs((double)s->direction[axis]);
        across += part;
        all += 2 * areas[axis];
        task->last_face = part > 0 ? axis : task->last_face;
    }
    const double of_sun = most_of(s->sun) * across, of_around = fmax(most_of(s->above), most_of(s->below)) * all;
    g->num_traced = 0;
    if (!(of_sun + of_around > LEAST_POWER)) {
        task->end = 0;
        g->unit = 0;
        return;
    }
    uint32_t num_sun = (uint32_t)(f->num_packets * (of_sun / (of_sun + of_around)) + 0.5);
    if (of_sun > 0 && num_sun == 0)
        num_sun = 1;
    if (of_around > 0 && num_sun == f->num_packets)
        num_sun--;
    const uint32_t num_around = f->num_packets - num_sun;
    const double each_sun = num_sun ? of_sun / num_sun : 0, each_around = num_around ? of_around / num_around : 0;
    g->unit = fmax(each_sun, each_around) / KARST_FLUENCE_WHOLE;
    task->end = f->num_packets;
    task->num_sun = num_sun;
    for (int i = 0; i < 3; i++) {
        task->sun[i] = num_sun ? (int)((double)s->sun[i] * across / num_sun / g->unit + 0.5) : 0;
        task->faces[i] = (float)(areas[i] * fabs((double)s->direction[i]) / across);
    }
    task->around = num_around ? (float)(all / num_around / g->unit) : 0;
}

static bool begin_trace(karst_fluence *f, const karst_fluence_grid *g, karst_error *error)
{
    const karst_fluence_box box = karst_fluence_own_box(g);
    const cl_uint base = karst_fluence_base(f, g);
    const size_t num = karst_fluence_num_cells(&g->box), block = KARST_FLUENCE_BLOCK,
                 blocks = num / (block * block * block), cell_bytes = num_words(f) * sizeof(uint32_t);
    return karst_buffer_fill(f->ledger, 0, (size_t)(g - f->grids) * LEDGER_BYTES, LEDGER_BYTES, error) &&
           (num == 0 || (karst_buffer_fill(f->sums, 0, base * cell_bytes, num * cell_bytes, error) &&
                         KARST_ARGUMENTS(f->bound, error, KARST_VALUE_ARG(box), KARST_VALUE_ARG(base),
                                         KARST_BUFFER_ARG(f->extinction), KARST_BUFFER_ARG(f->bounds)) &&
                         karst_fluence_launch(f, f->bound, blocks, error)));
}

/* What has been traced is what is seen from now on. */
static bool show(karst_fluence *f, karst_fluence_grid *g, karst_error *error)
{
    const karst_fluence_box box = karst_fluence_own_box(g);
    const float scale = g->num_traced ? (float)(g->unit * f->num_packets / g->num_traced) : 0;
    const cl_uint base = karst_fluence_base(f, g);
    g->shown = g->box;
    g->shown_region = g->region;
    return karst_fluence_num_cells(&g->box) == 0 ||
           (KARST_ARGUMENTS(f->pack, error, KARST_VALUE_ARG(box), KARST_VALUE_ARG(base), KARST_VALUE_ARG(scale),
                            KARST_BUFFER_ARG(f->sums), KARST_BUFFER_ARG(f->words)) &&
            karst_fluence_launch(f, f->pack, karst_fluence_num_cells(&g->box), error));
}

/* Some packets more. The last of them, and all if nothing better is known, are shown. */
static bool trace(karst_fluence *f, karst_fluence_grid *g, const karst_media_picture *picture, karst_error *error)
{
    /* From the corner of the first grid. */
    karst_fluence_boxes boxes = {.grids = {karst_fluence_own_box(f->grids)}};
    boxes.grids[1] = karst_fluence_box_from(&f->grids[1].box, &f->grids[1].region, f->grids[0].box.corner,
                              (const uint32_t[]){0, 0, 0});
    const uint32_t all = karst_fluence_num_cells(&g->box) ? g->task.end : 0, rest = all - g->num_traced,
                   num = picture->makes_all || rest < KARST_FLUENCE_FRAME_PACKETS ? rest : KARST_FLUENCE_FRAME_PACKETS;
    for (uint32_t done = 0, some; done < num; done += some) {
        karst_fluence_task task = g->task;
        some = num - done < LAUNCH_PACKETS ? num - done : LAUNCH_PACKETS;
        task.first = g->num_traced;
        task.end = g->num_traced += some;
        if (!KARST_ARGUMENTS(f->trace, error, KARST_VALUE_ARG(boxes), KARST_VALUE_ARG(task),
                             KARST_VALUE_ARG(g->lit), KARST_BUFFER_ARG(f->extinction),
                             KARST_BUFFER_ARG(f->look), KARST_BUFFER_ARG(f->open_shares), KARST_BUFFER_ARG(f->bounds),
                             KARST_BUFFER_ARG(f->sums), KARST_BUFFER_ARG(f->ledger)) ||
            !karst_fluence_launch(f, f->trace, (some + KARST_FLUENCE_RUN - 1) / KARST_FLUENCE_RUN, error))
            return false;
    }
    const bool ends = g->num_traced == all;
    if ((ends || !g->is_known) && !show(f, g, error))
        return false;
    if (ends) {
        g->step = KARST_FLUENCE_REST;
        g->is_known = true;
    }
    return true;
}

/* Goes on with a grid. `outer`: what it lies in, which is known; NULL: it is the first. */
static bool advance(karst_fluence *f, karst_fluence_grid *g, const karst_fluence_grid *outer,
                    const karst_media_picture *picture, karst_error *error)
{
    const karst_fluence_place region = karst_fluence_region(picture, outer != NULL);
    const karst_light *lit = outer ? &outer->lit : picture->light;
    const karst_fluence_source light = source_of(lit);
    const uint32_t num_fills = outer ? outer->num_fills : 0;
    const bool moved = g->is_stale || g->num_outer_fills != num_fills || g->coarser != picture->coarser ||
                       !karst_fluence_is_same(&region, &g->region);
    /* What is being traced is ended first, unless nobody watches: of a sun that turns all would else be begun, and
     * nothing ended. */
    const bool may_begin = g->step != KARST_FLUENCE_TRACE || picture->makes_all || !g->is_known;
    if (moved && may_begin) {
        g->region = g->box = region;
        g->is_stale = false;
        g->coarser = picture->coarser;
        g->num_outer_fills = num_fills;
        g->step = KARST_FLUENCE_FILL;
    } else if (g->step != KARST_FLUENCE_FILL && may_begin && memcmp(&light, &g->light, sizeof light)) {
        g->step = KARST_FLUENCE_OPEN;
    }
    g->is_behind = !may_begin && (moved || memcmp(&light, &g->light, sizeof light));
    bool done = true;
    if (g->step == KARST_FLUENCE_FILL) {
        if (!karst_fluence_fill(f, g, picture, &done, error))
            return false;
        /* Cells that are not finer tell nothing new. */
        if (done && outer && g->box.cell_log2 >= outer->box.cell_log2)
            g->box = (karst_fluence_place){.cell_log2 = 0};
        if (done) {
            g->num_fills++;
            g->step = KARST_FLUENCE_OPEN;
        }
    }
    if (g->step == KARST_FLUENCE_OPEN) {
        g->light = light;
        g->lit = *lit;
        plan(f, g, picture);
        if (!karst_fluence_look_for_sun(f, g, picture, &done, error) || (done && !begin_trace(f, g, error)))
            return false;
        if (done)
            g->step = KARST_FLUENCE_TRACE;
    }
    return g->step != KARST_FLUENCE_TRACE || trace(f, g, picture, error);
}

bool karst_fluence_advance(karst_fluence *f, const karst_media_picture *picture, karst_error *error)
{
    karst_fluence_grid *all = f->grids, *near = f->grids + 1;
    if (!advance(f, all, NULL, picture, error))
        return false;
    /* Light comes to what is near through the cells of all. */
    return all->step < KARST_FLUENCE_TRACE || advance(f, near, all, picture, error);
}

/* ---- what is seen of it ---- */

karst_fluence_boxes karst_fluence_boxes_from(const karst_fluence *f, const karst_position *anchor)
{
    karst_fluence_boxes boxes;
    for (int i = 0; i < KARST_FLUENCE_GRIDS; i++) {
        const karst_fluence_grid *g = &f->grids[i];
        boxes.grids[i] = karst_fluence_box_from(&g->shown, &g->shown_region, anchor->voxel, anchor->fraction);
    }
    return boxes;
}

const karst_buffer *karst_fluence_words(const karst_fluence *f) { return f->words; }

bool karst_fluence_lacks(const karst_fluence *f)
{
    bool lacks = false;
    for (const karst_fluence_grid *g = f->grids; g < f->grids + KARST_FLUENCE_GRIDS; g++)
        lacks = lacks || g->step != KARST_FLUENCE_REST || g->is_behind;
    return lacks;
}

bool karst_fluence_sums(const karst_fluence *f, int number, int size[3], uint64_t sums[KARST_FLUENCE_SUMS],
                        karst_error *error)
{
    uint32_t words[2 * KARST_FLUENCE_SUMS];
    memcpy(size, f->grids[number].box.size, 3 * sizeof *size);
    if (!karst_buffer_read(f->ledger, (size_t)number * LEDGER_BYTES, words, sizeof words, error))
        return false;
    for (int i = 0; i < KARST_FLUENCE_SUMS; i++)
        sums[i] = words[2 * i] | (uint64_t)words[2 * i + 1] << 32;
    return true;
}
