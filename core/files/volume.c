#include "core/files/volume.h"

#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include <zlib.h>

#include "core/files/nano_layout.h"

/* What splines and slopes of samples can still hold. */
#define MOST_MAGNITUDE 1e30f
#define NEWER_MAGIC_1 0x314244566f6e614eu /* "NanoVDB1" */
#define NEWER_MAGIC_2 0x324244566f6e614eu

/* A file being read. */
typedef struct {
    const char *path, *grid;
    FILE *file;
    uint64_t length_bytes;
    karst_volume *volume;
    karst_error *error;
    char *bytes; /* of the grid */
    uint64_t num_bytes;
    int64_t low[3], high[3]; /* of the box, both in it */
    double num_met;          /* places that nodes of the root hold in the box */
} reader;

static bool fail(const reader *r, const char *format, ...) __attribute__((format(printf, 2, 3)));
static bool fail(const reader *r, const char *format, ...)
{
    char message[512];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    return karst_fail(r->error, KARST_BAD_DATA, "%.400s: %s", r->path, message);
}

static bool fail_short(const reader *r) { return fail(r, "it ends in the middle of a grid"); }

static bool get(const reader *r, uint64_t at, void *to, size_t num_bytes)
{
    if (at > r->length_bytes || r->length_bytes - at < num_bytes)
        return fail_short(r);
    return (fseeko(r->file, (off_t)at, SEEK_SET) == 0 && fread(to, 1, num_bytes, r->file) == num_bytes) ||
           fail(r, "it cannot be read");
}

/* ---- finding the grid ---- */

static bool check_segment(const reader *r, const karst_nano_segment *segment)
{
    if (segment->magic == NEWER_MAGIC_1 || segment->magic == NEWER_MAGIC_2)
        return fail(r, "a newer NanoVDB wrote it than this program reads: write it with version 32");
    if (segment->magic != KARST_NANO_MAGIC)
        return fail(r, "it is no NanoVDB file");
    if (segment->version >> 21 != KARST_NANO_MAJOR)
        return fail(r, "NanoVDB %u wrote it, and version %u is read", segment->version >> 21, KARST_NANO_MAJOR);
    return segment->num_grids > 0 || fail(r, "a part of it has no grids");
}

static bool read_name(const reader *r, uint64_t at, uint32_t name_bytes, char name[KARST_NANO_NAME_BYTES])
{
    if (name_bytes < 1)
        return fail(r, "a grid has no name");
    const size_t taken = name_bytes < KARST_NANO_NAME_BYTES ? name_bytes : KARST_NANO_NAME_BYTES;
    if (!get(r, at, name, taken))
        return false;
    name[taken - 1] = '\0';
    return true;
}

/* The record of the wanted grid, and where its bytes begin; else *from is where the next segment does, and the record's
 * version is 0. */
static bool search_segment(const reader *r, const karst_nano_segment *segment, uint64_t *from,
                           karst_nano_record *record)
{
    uint64_t at = *from + sizeof *segment, found_at = 0, total = 0;
    karst_nano_record found = {0};
    for (uint32_t i = 0; i < segment->num_grids; i++) {
        karst_nano_record one;
        char name[KARST_NANO_NAME_BYTES];
        if (!get(r, at, &one, sizeof one) || !read_name(r, at + sizeof one, one.name_bytes, name))
            return false;
        at += sizeof one + one.name_bytes;
        if (!found.version && (!r->grid || strcmp(name, r->grid) == 0)) {
            found = one;
            found.version = segment->version;
            found_at = total;
        }
        if (one.file_bytes > r->length_bytes - total)
            return fail_short(r);
        total += one.file_bytes;
    }
    if (at > r->length_bytes || total > r->length_bytes - at)
        return fail_short(r);
    *from = at + (found.version ? found_at : total);
    *record = found;
    return true;
}

static bool find_grid(const reader *r, uint64_t *at, karst_nano_record *record, uint16_t *codec)
{
    *at = 0;
    while (*at < r->length_bytes) {
        karst_nano_segment segment;
        if (!get(r, *at, &segment, sizeof segment) || !check_segment(r, &segment) ||
            !search_segment(r, &segment, at, record))
            return false;
        *codec = segment.codec;
        if (record->version)
            return true;
    }
    return r->grid ? fail(r, "it has no grid that is called '%.60s'", r->grid) : fail(r, "it has no grid");
}

static bool inflate_grid(reader *r, uint64_t at, uint64_t file_bytes)
{
    uint64_t packed_bytes;
    if (!get(r, at, &packed_bytes, sizeof packed_bytes))
        return false;
    if (file_bytes < sizeof packed_bytes || packed_bytes > file_bytes - sizeof packed_bytes)
        return fail_short(r);
    Bytef *packed = malloc(packed_bytes ? packed_bytes : 1);
    if (!packed)
        return karst_fail(r->error, KARST_FAILED, "%.400s: out of memory", r->path);
    uLongf num = r->num_bytes;
    bool done = get(r, at + sizeof packed_bytes, packed, packed_bytes) &&
                ((uncompress((Bytef *)r->bytes, &num, packed, packed_bytes) == Z_OK && num == r->num_bytes) ||
                 fail(r, "what is compressed in it is damaged"));
    free(packed);
    return done;
}

static bool load_grid(reader *r)
{
    karst_nano_record record = {0};
    uint64_t at;
    uint16_t codec = KARST_NANO_CODEC_NONE;
    if (!find_grid(r, &at, &record, &codec))
        return false;
    if (record.type != KARST_NANO_TYPE_FLOAT)
        return fail(r, "the grid's values are no floats (type %u): convert it", record.type);
    if (codec != KARST_NANO_CODEC_NONE && codec != KARST_NANO_CODEC_ZIP)
        return fail(r, "it is compressed in a way that is not read: nanovdb_convert writes it without, or with --zip");
    if (record.grid_bytes < sizeof(karst_nano_grid) + sizeof(karst_nano_tree) + sizeof(karst_nano_root))
        return fail(r, "a grid of %llu bytes is too small to be one", (unsigned long long)record.grid_bytes);
    if (record.grid_bytes > KARST_VOLUME_MOST_BYTES)
        return fail(r, "its grid takes %llu bytes, and %llu is the limit: take a smaller box or wider voxels",
                    (unsigned long long)record.grid_bytes, (unsigned long long)KARST_VOLUME_MOST_BYTES);
    if (codec == KARST_NANO_CODEC_NONE && (at > r->length_bytes || record.grid_bytes > r->length_bytes - at))
        return fail_short(r);
    r->num_bytes = record.grid_bytes;
    r->bytes = malloc(r->num_bytes);
    if (!r->bytes)
        return karst_fail(r->error, KARST_FAILED, "%.400s: out of memory for %llu bytes", r->path,
                          (unsigned long long)r->num_bytes);
    return codec == KARST_NANO_CODEC_ZIP ? inflate_grid(r, at, record.file_bytes) : get(r, at, r->bytes, r->num_bytes);
}

/* ---- laying it out ---- */

/* What lies so many bytes from a place in the grid. NULL: it is not wholly in it. */
static const void *node_at(const reader *r, const void *base, int64_t offset, size_t num_bytes)
{
    const int64_t from = (const char *)base - r->bytes, last = (int64_t)(r->num_bytes - num_bytes);
    if (num_bytes > r->num_bytes || offset < -from || offset > last - from || (from + offset) % 8 != 0)
        return NULL;
    return r->bytes + from + offset;
}

/* The part of a cube that lies in the box, counted from the box's lower corner; false: none. */
static bool clip(const reader *r, const int64_t at[3], int64_t size, int64_t low[3], int64_t high[3])
{
    for (int axis = 0; axis < 3; axis++) {
        low[axis] = (at[axis] > r->low[axis] ? at[axis] : r->low[axis]) - r->low[axis];
        high[axis] = (at[axis] + size - 1 < r->high[axis] ? at[axis] + size - 1 : r->high[axis]) - r->low[axis];
        if (low[axis] > high[axis])
            return false;
    }
    return true;
}

static float *place_of(const reader *r, int64_t x, int64_t y, int64_t z)
{
    const uint32_t *size = r->volume->size;
    return r->volume->values + ((size_t)z * size[1] + (size_t)y) * size[0] + (size_t)x;
}

static void fill(const reader *r, const int64_t at[3], int64_t size, float value)
{
    int64_t low[3], high[3];
    if (!clip(r, at, size, low, high))
        return;
    for (int64_t z = low[2]; z <= high[2]; z++)
        for (int64_t y = low[1]; y <= high[1]; y++)
            for (int64_t x = low[0]; x <= high[0]; x++)
                *place_of(r, x, y, z) = value;
}

static void copy_leaf(const reader *r, const int64_t at[3], const karst_nano_leaf *leaf)
{
    int64_t low[3], high[3];
    if (!clip(r, at, 8, low, high))
        return;
    for (int64_t z = low[2]; z <= high[2]; z++)
        for (int64_t y = low[1]; y <= high[1]; y++)
            for (int64_t x = low[0]; x <= high[0]; x++)
                *place_of(r, x, y, z) =
                    leaf->values[((x + r->low[0] - at[0]) * 8 + y + r->low[1] - at[1]) * 8 + z + r->low[2] - at[2]];
}

static bool is_child(const uint64_t *mask, uint32_t n) { return mask[n >> 6] >> (n & 63) & 1; }

/* Where the n-th of num_a_side^3 children begins, which are `width` values wide. */
static void child_at(const int64_t at[3], uint32_t n, uint32_t side_log2, int64_t width, int64_t child[3])
{
    const uint32_t mask = (1u << side_log2) - 1;
    child[0] = at[0] + (int64_t)(n >> (2 * side_log2)) * width;
    child[1] = at[1] + (int64_t)(n >> side_log2 & mask) * width;
    child[2] = at[2] + (int64_t)(n & mask) * width;
}

static bool read_lower(const reader *r, const int64_t at[3], const karst_nano_lower *lower)
{
    int64_t low[3], high[3], child[3];
    for (uint32_t n = 0; n < 4096; n++) {
        child_at(at, n, 4, 8, child);
        if (!clip(r, child, 8, low, high))
            continue;
        if (!is_child(lower->child, n)) {
            fill(r, child, 8, lower->table[n].value);
            continue;
        }
        const karst_nano_leaf *leaf = node_at(r, lower, lower->table[n].child, sizeof *leaf);
        if (!leaf)
            return fail(r, "a leaf lies outside its grid");
        copy_leaf(r, child, leaf);
    }
    return true;
}

static bool read_upper(const reader *r, const int64_t at[3], const karst_nano_upper *upper)
{
    int64_t low[3], high[3], child[3];
    for (uint32_t n = 0; n < 32768; n++) {
        child_at(at, n, 5, 128, child);
        if (!clip(r, child, 128, low, high))
            continue;
        if (!is_child(upper->child, n)) {
            fill(r, child, 128, upper->table[n].value);
            continue;
        }
        const karst_nano_lower *lower = node_at(r, upper, upper->table[n].child, sizeof *lower);
        if (!lower)
            return fail(r, "a node lies outside its grid");
        if (!read_lower(r, child, lower))
            return false;
    }
    return true;
}

static int64_t key_part(uint64_t key, int shift)
{
    return (int32_t)(uint32_t)((key >> shift & 0x1fffff) << KARST_NANO_UPPER_LOG2);
}

/* What lies in the box, each place once: so no file takes longer than its box is large. */
static bool read_tile(reader *r, const karst_nano_root *root, const karst_nano_root_tile *tile)
{
    const int64_t at[3] = {key_part(tile->key, 42), key_part(tile->key, 21), key_part(tile->key, 0)};
    int64_t low[3], high[3];
    if (!clip(r, at, 1 << KARST_NANO_UPPER_LOG2, low, high))
        return true;
    r->num_met += (double)(high[0] - low[0] + 1) * (double)(high[1] - low[1] + 1) * (double)(high[2] - low[2] + 1);
    if (r->num_met > (double)r->volume->size[0] * r->volume->size[1] * r->volume->size[2])
        return fail(r, "its root holds a place twice");
    if (!tile->child) {
        fill(r, at, 1 << KARST_NANO_UPPER_LOG2, tile->value);
        return true;
    }
    const karst_nano_upper *upper = node_at(r, root, tile->child, sizeof *upper);
    return upper ? read_upper(r, at, upper) : fail(r, "a node lies outside its grid");
}

static bool take_box(reader *r, const karst_nano_root *root)
{
    uint64_t num = 1;
    for (int axis = 0; axis < 3; axis++) {
        r->low[axis] = root->box[axis];
        r->high[axis] = root->box[3 + axis];
        const int64_t size = r->high[axis] - r->low[axis] + 1;
        if (size < 1)
            return fail(r, "the grid has no active values");
        if (size > KARST_VOLUME_MOST_SIDE)
            return fail(r, "its box is %lld samples long along %c, and %u is the limit", (long long)size, "xyz"[axis],
                        KARST_VOLUME_MOST_SIDE);
        r->volume->size[axis] = (uint32_t)size;
        num *= (uint64_t)size;
    }
    if (num > KARST_VOLUME_MOST)
        return fail(r, "%u x %u x %u samples are too many: at most %zu in all", r->volume->size[0], r->volume->size[1],
                    r->volume->size[2], KARST_VOLUME_MOST);
    r->volume->values = malloc(num * sizeof(float));
    if (!r->volume->values)
        return karst_fail(r->error, KARST_FAILED, "%.400s: out of memory for %llu samples", r->path,
                          (unsigned long long)num);
    for (uint64_t i = 0; i < num; i++)
        r->volume->values[i] = root->background;
    return true;
}

/* How samples lie in the file's coordinates. */
static bool take_map(const reader *r, const karst_nano_map *map)
{
    const double width = map->matrix[0];
    bool is_plain = width >= 1e-30 && width <= 1e30;
    for (int i = 0; i < 9; i++)
        is_plain = is_plain && (i % 4 == 0 ? fabs(map->matrix[i] - width) <= 1e-9 * width : map->matrix[i] == 0);
    for (int axis = 0; axis < 3; axis++) {
        r->volume->first_m[axis] = map->offset[axis] + width * (double)r->low[axis];
        is_plain = is_plain && fabs(r->volume->first_m[axis]) <= 1e30;
    }
    r->volume->voxel_m = width;
    return is_plain || fail(r, "its axes are turned or stretched, or its voxels have no width");
}

static bool are_finite(const reader *r)
{
    const uint32_t *size = r->volume->size;
    const size_t num = (size_t)size[0] * size[1] * size[2];
    for (size_t i = 0; i < num; i++)
        if (!(fabsf(r->volume->values[i]) <= MOST_MAGNITUDE))
            return fail(r, "the value at %lld, %lld, %lld is %s: fill what is missing, and keep to 1e30",
                        (long long)(r->low[0] + (int64_t)(i % size[0])),
                        (long long)(r->low[1] + (int64_t)(i / size[0] % size[1])),
                        (long long)(r->low[2] + (int64_t)(i / size[0] / size[1])),
                        isnan(r->volume->values[i]) ? "not a number" : "too large");
    return true;
}

static bool lay_out(reader *r)
{
    const karst_nano_grid *grid = (const karst_nano_grid *)r->bytes;
    const karst_nano_tree *tree = node_at(r, grid, sizeof *grid, sizeof *tree);
    if (grid->magic != KARST_NANO_MAGIC || !tree || tree->offset[3] > INT64_MAX)
        return fail(r, "its grid is damaged");
    const karst_nano_root *root = node_at(r, tree, (int64_t)tree->offset[3], sizeof *root);
    const uint64_t tile_bytes = root ? (uint64_t)root->num_tiles * sizeof(karst_nano_root_tile) : 0;
    const karst_nano_root_tile *tiles = root ? node_at(r, root, sizeof *root, tile_bytes) : NULL;
    if (!tiles)
        return fail(r, "its root lies outside its grid");
    if (!take_box(r, root) || !take_map(r, &grid->map))
        return false;
    for (uint32_t i = 0; i < root->num_tiles; i++)
        if (!read_tile(r, root, &tiles[i]))
            return false;
    const char *kind = grid->grid_class == KARST_NANO_CLASS_LEVEL_SET ? "level set"
                       : grid->grid_class == KARST_NANO_CLASS_FOG     ? "fog volume"
                                                                      : "floats";
    snprintf(r->volume->kind_text, sizeof r->volume->kind_text, "NanoVDB, %s", kind);
    return are_finite(r);
}

bool karst_volume_read(const char *path, const char *grid, karst_volume *volume, karst_error *error)
{
    struct stat status;
    reader r = {.path = path, .grid = grid, .volume = volume, .error = error};
    *volume = (karst_volume){0};
    /* a pipe would wait for whoever writes it */
    if (stat(path, &status) != 0)
        return fail(&r, "%s", strerror(errno));
    if (!S_ISREG(status.st_mode))
        return fail(&r, "this is no regular file");
    r.file = fopen(path, "rb");
    if (!r.file)
        return fail(&r, "%s", strerror(errno));
    r.length_bytes = (uint64_t)status.st_size;
    const bool done = load_grid(&r) && lay_out(&r);
    fclose(r.file);
    free(r.bytes);
    if (!done)
        karst_volume_finish(volume);
    return done;
}

void karst_volume_finish(karst_volume *volume)
{
    free(volume->values);
    *volume = (karst_volume){0};
}
