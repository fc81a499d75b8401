/* Blocks of samples of the host's tape, and where their places lie: private to host_tape.c, which compiles it for each
 * width. */
#ifndef KARST_PRODUCERS_HOST_TAPE_PLACES_H
#define KARST_PRODUCERS_HOST_TAPE_PLACES_H

#include "producers/density/host_tape.h"

/* Iterations do not depend on one another: what is read and written at the same place is the same element. */
#ifdef __clang__
/* Sanitisers stand in the way of vectors: the loops are the same without. */
#pragma clang diagnostic ignored "-Wpass-failed"
#define INDEPENDENT _Pragma("clang loop vectorize(assume_safety)")
#else
#define INDEPENDENT _Pragma("GCC ivdep")
#endif
#define FOR_EACH INDEPENDENT for (uint i = 0; i < n; i++)

/* Samples of a block: a multiple of LANE_GROUP, at most MOST_SAMPLES; so few that their slots stay in the second cache
 * (CACHED_INTS, half of them in use where there are no pairs), but no fewer than LEAST_SAMPLES. */
#define LANE_GROUP 16u
#define MOST_SAMPLES 1664u
#define LEAST_SAMPLES 32u
#define CACHED_INTS 65536u
#define MOST_INTS (KARST_TAPE_MOST_SLOTS * TAPE_VALUE_ELEMENTS * LEAST_SAMPLES)

typedef struct {
    const tape_program *tape;
    int level;
    uint num; /* samples of a block */
    long origin[3];
    uint index[3][MOST_SAMPLES]; /* of samples, from the brick's origin */
    bool is_of_points;           /* then samples lie anywhere, within 2^31 voxels of 0 where is_near: */
    bool is_near;
    long voxel[3][MOST_SAMPLES];
    uint point_fraction[3][MOST_SAMPLES];
    uint cell[3][MOST_SAMPLES], fraction[3][MOST_SAMPLES]; /* of a noise's coordinates */
    int known[4][2][MOST_SAMPLES]; /* operands that are the same in all samples */
    int zeros[MOST_SAMPLES];
    int slots[MOST_INTS] __attribute__((aligned(64))); /* slot by slot: floats of all samples, what they leave */
} block;

/* An operand, or what its float leaves, of all samples. */
typedef struct {
    const int *hi, *lo;
} operand;

K_INLINE int *slot_of(block *b, uint slot, uint element)
{
    return b->slots + (slot * TAPE_VALUE_ELEMENTS + element) * b->num;
}

K_INLINE const int *fill(int *to, uint n, int value)
{
    FOR_EACH to[i] = value;
    return to;
}

K_INLINE const int *find(block *b, uint n, uint name, int k)
{
    if (name == TAPE_NOTHING)
        return b->zeros;
    if (tape_is_known(name))
        return fill(b->known[k][0], n, tape_known(b->tape, name));
    return slot_of(b, name & TAPE_INDEX, 0);
}

K_INLINE operand find_pair(block *b, uint n, uint name, int k)
{
    operand found = {find(b, n, name, k), b->zeros};
    if (name != TAPE_NOTHING && name & TAPE_PAIR)
        found.lo = tape_is_known(name) ? fill(b->known[k][1], n, (int)k_as_uint(tape_known_rest(b->tape, name)))
                                       : slot_of(b, name & TAPE_INDEX, 1);
    return found;
}

K_INLINE wide pair_at(operand x, uint i) { return wide_of(v_as_float(x.hi[i]), v_as_float(x.lo[i])); }

/* ---- places ---- */

K_INLINE affine_position position_at(const block *b, uint x, uint y, uint z)
{
    affine_position at = {{b->origin[0] + ((long)x << b->level), b->origin[1] + ((long)y << b->level),
                           b->origin[2] + ((long)z << b->level)},
                          {0, 0, 0}};
    return at;
}
K_INLINE affine_position point_at(const block *b, uint i)
{
    affine_position at = {{b->voxel[0][i], b->voxel[1][i], b->voxel[2][i]},
                          {b->point_fraction[0][i], b->point_fraction[1][i], b->point_fraction[2][i]}};
    return at;
}
#define POSITION \
    (b->is_of_points ? point_at(b, i) : position_at(b, b->index[0][i], b->index[1][i], b->index[2][i]))

/* A form's fixed point is the sum of one part for each axis, exactly: parts by index. */
typedef struct {
    ulong low[3][KARST_BRICK_SIDE], high[3][KARST_BRICK_SIDE];
} form_parts;

/* `offset` goes to the first axis. */
K_INLINE void part_form(const block *b, const long factor[3], affine_sum offset, form_parts *parts)
{
    for (int axis = 0; axis < 3; axis++)
        for (uint k = 0; k < KARST_BRICK_SIDE; k++) {
            affine_sum sum = axis == 0 ? offset : (affine_sum){0, 0};
            if (factor[axis] != 0)
                affine_sum_product(&sum, factor[axis], b->origin[axis] + ((long)k << b->level), 0);
            parts->low[axis][k] = sum.low;
            parts->high[axis][k] = sum.high;
        }
}

K_INLINE affine_sum sum_at(const block *b, const form_parts *parts, uint i)
{
    uint x = b->index[0][i], y = b->index[1][i], z = b->index[2][i];
    affine_sum sum = {parts->low[0][x], parts->high[0][x]};
    affine_sum_add(&sum, parts->low[1][y], parts->high[1][y]);
    affine_sum_add(&sum, parts->low[2][z], parts->high[2][z]);
    return sum;
}

/* The only axis along which a form rises; 3: there are more. */
K_INLINE int only_axis(const long factor[3])
{
    if (factor[1] == 0 && factor[2] == 0)
        return 0;
    if (factor[0] == 0 && factor[2] == 0)
        return 1;
    return factor[0] == 0 && factor[1] == 0 ? 2 : 3;
}

/* affine_sum_product of points that are near: the same sum, of products that fit 64 bits, so that these become vectors
 * (factor = 2^32 high + low). */
K_INLINE void add_near(affine_sum *sum, long factor, long voxel, uint fraction)
{
    const ulong low = (ulong)factor & 0xffffffffu, high = (ulong)(factor >> 32), v = (ulong)voxel, f = fraction;
    const ulong of_low = v * low, of_high = v * high, part = f * high + (f * low >> 32);
    affine_sum_add(sum, of_low, (ulong)((long)of_low >> 63));
    affine_sum_add(sum, of_high << 32, (ulong)((long)of_high >> 32));
    affine_sum_add(sum, part, (ulong)((long)part >> 63));
}
K_INLINE affine_sum near_sum_at(const block *b, const long factor[3], affine_sum offset, uint i)
{
    add_near(&offset, factor[0], b->voxel[0][i], b->point_fraction[0][i]);
    add_near(&offset, factor[1], b->voxel[1][i], b->point_fraction[1][i]);
    add_near(&offset, factor[2], b->voxel[2][i], b->point_fraction[2][i]);
    return offset;
}

/* A form at near points; most have one axis. */
#define FOR_EACH_NEAR_SUM(factor, offset, use)                                          \
    do {                                                                                \
        const int axis_ = only_axis(factor);                                            \
        const affine_sum offset_ = offset;                                              \
        if (axis_ == 3) {                                                               \
            FOR_EACH                                                                    \
            {                                                                           \
                const affine_sum sum = near_sum_at(b, factor, offset_, i);              \
                use;                                                                    \
            }                                                                           \
        } else {                                                                        \
            const long *const voxel_ = b->voxel[axis_], factor_ = (factor)[axis_];      \
            const uint *const fraction_ = b->point_fraction[axis_];                     \
            FOR_EACH                                                                    \
            {                                                                           \
                affine_sum sum = offset_;                                               \
                add_near(&sum, factor_, voxel_[i], fraction_[i]);                       \
                use;                                                                    \
            }                                                                           \
        }                                                                               \
        return;                                                                         \
    } while (0)

K_INLINE void place_near_coordinates(const block *b, uint n, const karst_lattice *form, uint *cell, uint *fraction)
{
    FOR_EACH_NEAR_SUM(form->frequency, affine_lattice_offset(form), {
        cell[i] = (uint)(sum.high << 8 | sum.low >> 56);
        fraction[i] = (uint)(sum.low >> 24);
    });
}

K_INLINE void place_near_floats(const block *b, uint n, const karst_linear *form, int *to)
{
    FOR_EACH_NEAR_SUM(form->factor, affine_form_offset(form), to[i] = v_as_int(affine_sum_float(sum, form)));
}

/* What a form with one axis comes to at each index along it, else at each sample. */
K_INLINE void place_coordinates(block *b, uint n, const karst_lattice *form, int to)
{
    uint *cell = b->cell[to], *fraction = b->fraction[to];
    if (b->is_of_points && b->is_near) {
        place_near_coordinates(b, n, form, cell, fraction);
        return;
    }
    if (b->is_of_points) {
        FOR_EACH
        {
            affine_position at = point_at(b, i);
            noise_coordinate c = affine_coordinate(&at, form);
            cell[i] = c.cell;
            fraction[i] = c.fraction;
        }
        return;
    }
    int axis = only_axis(form->frequency);
    if (axis == 3) {
        form_parts parts;
        part_form(b, form->frequency, affine_lattice_offset(form), &parts);
        FOR_EACH
        {
            affine_place place = affine_sum_place(sum_at(b, &parts, i));
            cell[i] = (uint)place.cell;
            fraction[i] = place.fraction;
        }
        return;
    }
    uint cells[KARST_BRICK_SIDE], fractions[KARST_BRICK_SIDE];
    const uint *index = b->index[axis];
    for (uint k = 0; k < KARST_BRICK_SIDE; k++) {
        affine_position at = position_at(b, k, k, k);
        noise_coordinate c = affine_coordinate(&at, form);
        cells[k] = c.cell;
        fractions[k] = c.fraction;
    }
    FOR_EACH
    {
        cell[i] = cells[index[i]];
        fraction[i] = fractions[index[i]];
    }
}

K_INLINE void place_floats(block *b, uint n, const karst_linear *form, int *to)
{
    if (b->is_of_points && b->is_near) {
        place_near_floats(b, n, form, to);
        return;
    }
    if (b->is_of_points) {
        FOR_EACH
        {
            affine_position at = point_at(b, i);
            to[i] = v_as_int(affine_float(&at, form));
        }
        return;
    }
    int axis = only_axis(form->factor);
    if (axis == 3) {
        form_parts parts;
        part_form(b, form->factor, affine_form_offset(form), &parts);
        FOR_EACH to[i] = v_as_int(affine_sum_float(sum_at(b, &parts, i), form));
        return;
    }
    int values[KARST_BRICK_SIDE];
    const uint *index = b->index[axis];
    for (uint k = 0; k < KARST_BRICK_SIDE; k++) {
        affine_position at = position_at(b, k, k, k);
        values[k] = v_as_int(affine_float(&at, form));
    }
    FOR_EACH to[i] = values[index[i]];
}

K_INLINE void place_pairs(block *b, uint n, const karst_linear *form, int *to, int *rest)
{
    if (b->is_of_points) {
        FOR_EACH
        {
            affine_position at = point_at(b, i);
            wide r = wide_affine_sum(affine_form_sum(&at, form), form);
            to[i] = v_as_int(r.hi);
            rest[i] = v_as_int(r.lo);
        }
        return;
    }
    form_parts parts;
    part_form(b, form->factor, affine_form_offset(form), &parts);
    FOR_EACH
    {
        wide r = wide_affine_sum(sum_at(b, &parts, i), form);
        to[i] = v_as_int(r.hi);
        rest[i] = v_as_int(r.lo);
    }
}

K_INLINE noise_coordinate coordinate_at(const block *b, int axis, uint i)
{
    noise_coordinate c = {b->cell[axis][i], b->fraction[axis][i]};
    return c;
}
K_INLINE void set_coordinate(block *b, int axis, uint i, noise_coordinate c)
{
    b->cell[axis][i] = c.cell;
    b->fraction[axis][i] = c.fraction;
}

#endif
