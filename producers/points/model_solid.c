/* Which cells of a model's places lie inside it: see producers/points/model_solid.h. */
#include "producers/points/model_solid.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "producers/points/points.clh"

/* A cell is as wide as that, at most, and half as wide at least: the crust's inner half, which must stop what goes from
 * cell to cell, is twice as thick. */
#define MOST_SPACINGS 1.5
#define BLOCK 8u /* cells that are looked at together, along an axis */

bool karst_solid_plan(karst_model_solid *solid, const double half[3], double reach, double spacing)
{
    double num_cells = 1;
    *solid = (karst_model_solid){.shift = spacing > 1 ? ilogb(MOST_SPACINGS * spacing) : 0};
    const double width = ldexp(1, solid->shift);
    for (int a = 0; a < 3; a++) {
        const double side = half[a] + reach + 2 * width; /* a cell at least is beyond all supports */
        const double size = ceil(2 * side / width);
        num_cells *= size;
        if (!(num_cells <= (double)KARST_SOLID_MOST_CELLS) || !(side < 0x1p30))
            return false;
        solid->at[a] = -(int)ceil(side);
        solid->size[a] = (uint)size;
    }
    for (uint most = solid->size[0] > solid->size[1] ? solid->size[0] : solid->size[1];
         ((most > solid->size[2] ? most : solid->size[2]) - 1u) >> solid->levels;)
        solid->levels++;
    solid->levels++;
    return true;
}

size_t karst_solid_words(const karst_model_solid *solid)
{
    size_t num = 0;
    for (uint level = 0; level < solid->levels; level++)
        num += 2 * points_solid_plane_words(solid, level);
    return num;
}

/* ---- what cells are ---- */

enum { VOID, WALL, OUTER, IS = 3, AIR = 4, DEEP = 8, QUEUED = 16 };

typedef struct {
    const karst_model_solid *solid;
    points_data data;
    const karst_model_level *of;
    uint8_t *cells;
    uint32_t *queue;
    size_t queue_room;
} filling;

static size_t number_of(const filling *f, uint x, uint y, uint z)
{
    return ((size_t)z * f->solid->size[1] + y) * f->solid->size[0] + x;
}

static long middle(const filling *f, int axis, uint cell)
{
    return f->solid->at[axis] + ((long)cell << f->solid->shift) + (1L << f->solid->shift) / 2;
}

static uint8_t look(const filling *f, const uint cell[3])
{
    static const karst_model_record unit = {.m_per_unit = 1};
    points_places places = {.near = -1, .box = {.least = 1}};
    vint known;
    for (int a = 0; a < 3; a++) {
        places.box.min[a] = places.box.max[a] = middle(f, a, cell[a]);
        places.at[a] = (int)places.box.min[a];
    }
    points_near near;
    points_begin_near(&near);
    const float value = points_value(f->data, &unit, f->of, &places, &near, &known, 0);
    return known ? (value > 0 ? WALL : OUTER) : VOID;
}

/* The cells of a block, of which most have no points near. */
static void look_at_block(const filling *f, const uint from[3])
{
    points_box box = {.least = 1};
    uint to[3], leaf = 0, cell[3];
    for (int a = 0; a < 3; a++) {
        to[a] = from[a] + BLOCK < f->solid->size[a] ? from[a] + BLOCK : f->solid->size[a];
        box.min[a] = middle(f, a, from[a]);
        box.max[a] = middle(f, a, to[a] - 1);
    }
    if (!points_next_leaf(f->data, f->of, &box, &leaf))
        return;
    for (cell[2] = from[2]; cell[2] < to[2]; cell[2]++)
        for (cell[1] = from[1]; cell[1] < to[1]; cell[1]++)
            for (cell[0] = from[0]; cell[0] < to[0]; cell[0]++)
                f->cells[number_of(f, cell[0], cell[1], cell[2])] = look(f, cell);
}

static void look_at_all(const filling *f)
{
    uint from[3];
    for (from[2] = 0; from[2] < f->solid->size[2]; from[2] += BLOCK)
        for (from[1] = 0; from[1] < f->solid->size[1]; from[1] += BLOCK)
            for (from[0] = 0; from[0] < f->solid->size[0]; from[0] += BLOCK)
                look_at_block(f, from);
}

/* ---- what they enclose ---- */

typedef struct {
    size_t num;                         /* of them, in the queue */
    uint64_t beside_outer, beside_void; /* faces to the wall */
} space;

static bool push(filling *f, space *of, size_t cell)
{
    if (of->num == f->queue_room) {
        const size_t room = f->queue_room ? 2 * f->queue_room : 4096;
        uint32_t *more = realloc(f->queue, room * sizeof *more);
        if (!more)
            return false;
        f->queue = more;
        f->queue_room = room;
    }
    f->queue[of->num++] = (uint32_t)cell;
    f->cells[cell] |= QUEUED;
    return true;
}

/* All that can be reached from a cell without passing a wall. false: out of memory. */
static bool spread(filling *f, size_t from, space *of)
{
    const size_t steps[3] = {1, f->solid->size[0], (size_t)f->solid->size[0] * f->solid->size[1]};
    *of = (space){.num = 0};
    if (!push(f, of, from))
        return false;
    for (size_t i = 0; i < of->num; i++) {
        const size_t cell = f->queue[i];
        for (int a = 0; a < 3; a++)
            for (int end = 0; end < 2; end++) {
                const size_t along = cell / steps[a] % f->solid->size[a];
                if (end ? along + 1 == f->solid->size[a] : along == 0)
                    continue;
                const size_t next = end ? cell + steps[a] : cell - steps[a];
                if ((f->cells[next] & IS) == WALL)
                    *((f->cells[cell] & IS) == OUTER ? &of->beside_outer : &of->beside_void) += 1;
                else if (!(f->cells[next] & QUEUED) && !push(f, of, next))
                    return false;
            }
    }
    return true;
}

static bool find_spaces(filling *f, size_t num_cells, uint64_t *num_inside)
{
    *num_inside = 0;
    for (size_t cell = 0; cell < num_cells; cell++) {
        space found;
        if ((f->cells[cell] & IS) == WALL || f->cells[cell] & QUEUED)
            continue;
        if (!spread(f, cell, &found))
            return false;
        const bool is_air = cell == 0 || found.beside_outer >= found.beside_void; /* cell 0 is outside */
        for (size_t i = 0; i < found.num; i++)
            f->cells[f->queue[i]] |= is_air ? AIR : DEEP;
        *num_inside += is_air ? 0 : found.num;
    }
    return true;
}

/* ---- planes of bits ---- */

static void set_bit(uint64_t *plane, size_t cell) { plane[cell / 64] |= (uint64_t)1 << cell % 64; }

/* Cells of a level from those of the level below; of cells beyond the border nothing is said. */
static void gather(const karst_model_solid *solid, uint level, const uint64_t *some, const uint64_t *whole,
                   uint64_t *to_some, uint64_t *to_whole)
{
    uint side[3], below[3], cell[3];
    for (int a = 0; a < 3; a++) {
        side[a] = points_solid_side(solid, a, level);
        below[a] = points_solid_side(solid, a, level - 1);
    }
    for (cell[2] = 0; cell[2] < side[2]; cell[2]++)
        for (cell[1] = 0; cell[1] < side[1]; cell[1]++)
            for (cell[0] = 0; cell[0] < side[0]; cell[0]++) {
                bool any = false, all = true;
                for (uint i = 0; i < 8; i++) {
                    const uint at[3] = {2 * cell[0] + (i & 1), 2 * cell[1] + (i >> 1 & 1), 2 * cell[2] + (i >> 2)};
                    if (at[0] >= below[0] || at[1] >= below[1] || at[2] >= below[2])
                        continue;
                    const size_t number = points_solid_cell(solid, at, level - 1);
                    any = any || points_solid_bit(some, number);
                    all = all && points_solid_bit(whole, number);
                }
                const size_t number = points_solid_cell(solid, cell, level);
                if (any)
                    set_bit(to_some, number);
                if (all)
                    set_bit(to_whole, number);
            }
}

static void write_planes(const filling *f, size_t num_cells, uint64_t *to)
{
    const karst_model_solid *solid = f->solid;
    uint64_t *deep = to + points_solid_plane_words(solid, 0);
    memset(to, 0, karst_solid_words(solid) * sizeof *to);
    for (size_t cell = 0; cell < num_cells; cell++) {
        if (f->cells[cell] & DEEP)
            set_bit(deep, cell);
        if (f->cells[cell] & DEEP || (f->cells[cell] & IS) == WALL)
            set_bit(to, cell);
    }
    const uint64_t *some = to, *whole = deep;
    for (uint level = 1; level < solid->levels; level++) {
        to += 2 * points_solid_plane_words(solid, level - 1);
        gather(solid, level, some, whole, to, to + points_solid_plane_words(solid, level));
        some = to;
        whole = to + points_solid_plane_words(solid, level);
    }
}

bool karst_solid_fill(uint64_t *data, const karst_model_level *level, const karst_model_solid *solid,
                      uint64_t *num_inside, karst_error *error)
{
    const size_t num_cells = (size_t)solid->size[0] * solid->size[1] * solid->size[2];
    filling f = {.solid = solid, .data = (points_data)data, .of = level, .cells = calloc(num_cells, 1)};
    bool done = f.cells != NULL;
    if (done) {
        look_at_all(&f);
        done = find_spaces(&f, num_cells, num_inside);
    }
    if (done)
        write_planes(&f, num_cells, data + solid->words);
    free(f.cells);
    free(f.queue);
    return done || karst_fail(error, KARST_FAILED, "out of memory for the inside of a model");
}
