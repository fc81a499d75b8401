/* Rows of the log: an edit as bytes. Little-endian; docs/SAVED.md has the table. */
#include <math.h>
#include <string.h>

#include "core/saved/saved_parts.h"
#include "producers/edits/edit_list.h"

#define ROW_VERSION 1  /* of all rows but those of */
#define ROW_VERSION_2 2 /* what only files of version 2 have: edits that smooth */
#define HEAD_BYTES 40 /* version, shape and mode, voxel, fields; voxels and fractions of three axes */
#define SUM_BYTES 8

/* What may follow the head, in this order. */
enum {
    HAS_RADIUS = 1,
    HAS_HALF = 2,
    HAS_TO = 4,
    HAS_NORMAL = 8,
    HAS_BLEND = 16,
    HAS_NOISE = 32,
    HAS_COLOUR = 64,
    HAS_STRENGTH = 128 /* without a colour */
};

/* FNV-1a: each step can be undone, so no single wrong byte ever goes unnoticed. */
uint64_t saved_sum(uint64_t sum, const void *data, size_t size_bytes)
{
    const uint8_t *bytes = data;
    for (size_t i = 0; i < size_bytes; i++)
        sum = (sum ^ bytes[i]) * 0x100000001b3u;
    return sum;
}

uint64_t karst_saved_sum(const char *text, size_t text_bytes) { return saved_sum(SAVED_SUM_BEGIN, text, text_bytes); }

static void put(uint8_t **at, uint64_t value, int num_bytes)
{
    for (int i = 0; i < num_bytes; i++)
        *(*at)++ = (uint8_t)(value >> 8 * i);
}

static uint64_t get(const uint8_t **at, int num_bytes)
{
    uint64_t value = 0;
    for (int i = 0; i < num_bytes; i++)
        value |= (uint64_t) * (*at)++ << 8 * i;
    return value;
}

static void put_doubles(uint8_t **at, const double *values, int num)
{
    for (int i = 0; i < num; i++) {
        uint64_t bits;
        memcpy(&bits, &values[i], sizeof bits);
        put(at, bits, 8);
    }
}

static void get_doubles(const uint8_t **at, double *values, int num)
{
    for (int i = 0; i < num; i++) {
        uint64_t bits = get(at, 8);
        memcpy(&values[i], &bits, sizeof bits);
    }
}

static uint64_t sum_of(const uint8_t *row, size_t size_bytes, uint64_t id)
{
    uint8_t number[8], *at = number;
    put(&at, id, 8);
    return saved_sum(saved_sum(SAVED_SUM_BEGIN, number, sizeof number), row, size_bytes);
}

static bool any(const double v[3]) { return v[0] != 0 || v[1] != 0 || v[2] != 0; }

int saved_row_version(const karst_edit *edit)
{
    return edit->mode == KARST_EDIT_SMOOTH ? ROW_VERSION_2 : ROW_VERSION;
}

size_t saved_row_pack(const karst_edit *edit, uint64_t id, int voxel_log2_m, uint8_t row[SAVED_MAX_ROW_BYTES])
{
    uint8_t *at = row;
    unsigned fields = (edit->radius_m != 0 ? HAS_RADIUS : 0) | (any(edit->half_m) ? HAS_HALF : 0) |
                      (any(edit->to_m) ? HAS_TO : 0) | (any(edit->normal) ? HAS_NORMAL : 0) |
                      (edit->blend_m != 0 ? HAS_BLEND : 0) | (edit->shape == KARST_EDIT_NOISE ? HAS_NOISE : 0) |
                      (edit->has_colour ? HAS_COLOUR : 0) | (edit->mode == KARST_EDIT_SMOOTH ? HAS_STRENGTH : 0);
    put(&at, (uint64_t)saved_row_version(edit), 1);
    put(&at, (unsigned)edit->shape | (unsigned)edit->mode << 4, 1);
    put(&at, (uint8_t)(int8_t)voxel_log2_m, 1);
    put(&at, fields, 1);
    for (int axis = 0; axis < 3; axis++)
        put(&at, (uint64_t)edit->at.voxel[axis], 8);
    for (int axis = 0; axis < 3; axis++)
        put(&at, edit->at.fraction[axis], 4);
    if (fields & HAS_RADIUS)
        put_doubles(&at, &edit->radius_m, 1);
    if (fields & HAS_HALF)
        put_doubles(&at, edit->half_m, 3);
    if (fields & HAS_TO)
        put_doubles(&at, edit->to_m, 3);
    if (fields & HAS_NORMAL)
        put_doubles(&at, edit->normal, 3);
    if (fields & HAS_BLEND)
        put_doubles(&at, &edit->blend_m, 1);
    if (fields & HAS_NOISE) {
        put_doubles(&at, &edit->amplitude_m, 1);
        put_doubles(&at, &edit->scale_m, 1);
        put(&at, edit->seed, 4);
    }
    if (fields & HAS_COLOUR) {
        put_doubles(&at, edit->colour, 3);
        put_doubles(&at, &edit->strength, 1);
    }
    if (fields & HAS_STRENGTH)
        put_doubles(&at, &edit->strength, 1);
    put(&at, sum_of(row, (size_t)(at - row), id), SUM_BYTES);
    return (size_t)(at - row);
}

static size_t size_of(unsigned fields)
{
    return HEAD_BYTES + (fields & HAS_RADIUS ? 8 : 0) + (fields & HAS_HALF ? 24 : 0) + (fields & HAS_TO ? 24 : 0) +
           (fields & HAS_NORMAL ? 24 : 0) + (fields & HAS_BLEND ? 8 : 0) + (fields & HAS_NOISE ? 20 : 0) +
           (fields & HAS_COLOUR ? 32 : 0) + (fields & HAS_STRENGTH ? 8 : 0) + SUM_BYTES;
}

/* The same place in voxels of another width; false if it lies beyond them. */
static bool convert(karst_position *place, int from_log2_m, int to_log2_m)
{
    char text[3][160];
    for (int axis = 0; axis < 3; axis++)
        if (karst_coordinate_format(place->voxel[axis], place->fraction[axis], from_log2_m, text[axis],
                                    sizeof text[axis]) < 0)
            return false;
    return karst_position_parse(text[0], text[1], text[2], to_log2_m, place, NULL);
}

int saved_row_voxel_log2_m(const uint8_t *row) { return (int8_t)row[2]; }

bool saved_row_unpack(const uint8_t *row, size_t size_bytes, uint64_t id, int voxel_log2_m, karst_edit *edit)
{
    const uint8_t *at = row, *sum = row + size_bytes - SUM_BYTES;
    karst_edit_record record;
    if (size_bytes < HEAD_BYTES + SUM_BYTES || size_bytes > SAVED_MAX_ROW_BYTES ||
        get(&sum, SUM_BYTES) != sum_of(row, size_bytes - SUM_BYTES, id))
        return false;
    const unsigned version = (unsigned)get(&at, 1);
    unsigned what = (unsigned)get(&at, 1);
    int from_log2_m = (int8_t)get(&at, 1);
    if (voxel_log2_m == SAVED_OWN_VOXEL)
        voxel_log2_m = from_log2_m;
    unsigned fields = (unsigned)get(&at, 1);
    if (version < ROW_VERSION || version > ROW_VERSION_2 || size_bytes != size_of(fields) ||
        (version == ROW_VERSION && (fields & HAS_STRENGTH)))
        return false;
    *edit = (karst_edit){.shape = (karst_edit_shape)(what & 15), .mode = (karst_edit_mode)(what >> 4)};
    edit->scale_m = 1;
    for (int axis = 0; axis < 3; axis++)
        edit->at.voxel[axis] = (int64_t)get(&at, 8);
    for (int axis = 0; axis < 3; axis++)
        edit->at.fraction[axis] = (uint32_t)get(&at, 4);
    if (fields & HAS_RADIUS)
        get_doubles(&at, &edit->radius_m, 1);
    if (fields & HAS_HALF)
        get_doubles(&at, edit->half_m, 3);
    if (fields & HAS_TO)
        get_doubles(&at, edit->to_m, 3);
    if (fields & HAS_NORMAL)
        get_doubles(&at, edit->normal, 3);
    if (fields & HAS_BLEND)
        get_doubles(&at, &edit->blend_m, 1);
    if (fields & HAS_NOISE) {
        get_doubles(&at, &edit->amplitude_m, 1);
        get_doubles(&at, &edit->scale_m, 1);
        edit->seed = (uint32_t)get(&at, 4);
    }
    edit->strength = 1;
    edit->has_colour = fields & HAS_COLOUR;
    if (edit->has_colour) {
        get_doubles(&at, edit->colour, 3);
        get_doubles(&at, &edit->strength, 1);
    }
    if (fields & HAS_STRENGTH)
        get_doubles(&at, &edit->strength, 1);
    return saved_row_version(edit) == (int)version &&
           (from_log2_m == voxel_log2_m || convert(&edit->at, from_log2_m, voxel_log2_m)) &&
           karst_edit_record_make(edit, 1, voxel_log2_m, &record, NULL);
}
