#include "core/export/nano_file.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <zlib.h>

#include "core/export/out_file.h"
#include "core/files/nano_layout.h"

enum { TOP, LOWERS, LEAVES, FOUND_LOWERS, NUM_FILES };

/* What active values of a node span. */
typedef struct {
    int32_t box[6];
    float least, most;
    uint64_t num;
} extent;

typedef struct {
    int32_t at[3];
    karst_nano_upper *node; /* NULL: all of it is `value`, inactive */
    float value;
    extent e;
} branch;

struct karst_nano_writer {
    const char *path;
    const karst_nano_about *about;
    FILE *files[NUM_FILES];
    branch *branches;
    size_t num_branches, room;
    karst_nano_lower lower;
    extent lower_extent;
    int32_t lower_at[3];
    uint32_t *leaf_sums; /* CRC-32 of each leaf */
    uint64_t num_leaves, room_for_leaves;
    uint32_t num_lowers, num_uppers;
    extent all;
};

static const extent nothing = {
    {INT32_MAX, INT32_MAX, INT32_MAX, INT32_MIN, INT32_MIN, INT32_MIN}, INFINITY, -INFINITY, 0};

static void add(extent *to, const extent *part)
{
    for (int i = 0; i < 3 && part->num; i++) {
        to->box[i] = part->box[i] < to->box[i] ? part->box[i] : to->box[i];
        to->box[3 + i] = part->box[3 + i] > to->box[3 + i] ? part->box[3 + i] : to->box[3 + i];
    }
    to->least = fminf(to->least, part->least);
    to->most = fmaxf(to->most, part->most);
    to->num += part->num;
}

static bool out_of_memory(karst_error *error) { return karst_fail(error, KARST_FAILED, "out of memory"); }

static bool cannot_write(const karst_nano_writer *w, karst_error *error)
{
    return karst_fail(error, KARST_FAILED, "cannot write %s: %s", w->path, strerror(errno ? errno : EIO));
}

static bool put(const karst_nano_writer *w, int file, const void *bytes, size_t num_bytes, karst_error *error)
{
    return fwrite(bytes, 1, num_bytes, w->files[file]) == num_bytes || cannot_write(w, error);
}

karst_nano_writer *karst_nano_begin(const char *path, const karst_nano_about *about, karst_error *error)
{
    karst_nano_writer *w = calloc(1, sizeof *w);
    if (!w) {
        out_of_memory(error);
        return NULL;
    }
    w->path = path;
    w->about = about;
    w->all = nothing;
    errno = 0;
    for (int i = 0; i < NUM_FILES; i++)
        if (!(w->files[i] = karst_out_part(path))) {
            cannot_write(w, error);
            karst_nano_end(w);
            return NULL;
        }
    return w;
}

void karst_nano_end(karst_nano_writer *w)
{
    if (!w)
        return;
    for (int i = 0; i < NUM_FILES; i++)
        if (w->files[i])
            fclose(w->files[i]);
    for (size_t i = 0; i < w->num_branches; i++)
        free(w->branches[i].node);
    free(w->branches);
    free(w->leaf_sums);
    free(w);
}

/* ---- nodes ---- */

static branch *find_branch(karst_nano_writer *w, const int32_t at[3], karst_error *error)
{
    for (size_t i = w->num_branches; i-- > 0;)
        if (karst_nano_root_key(w->branches[i].at) == karst_nano_root_key(at))
            return &w->branches[i];
    if (w->num_branches == w->room) {
        branch *more = realloc(w->branches, (w->room * 2 + 8) * sizeof *more);
        if (!more) {
            out_of_memory(error);
            return NULL;
        }
        w->branches = more;
        w->room = w->room * 2 + 8;
    }
    branch *b = &w->branches[w->num_branches++];
    *b = (branch){.value = w->about->background, .e = nothing};
    for (int axis = 0; axis < 3; axis++)
        b->at[axis] = at[axis] & -(1 << KARST_NANO_UPPER_LOG2);
    return b;
}

static karst_nano_upper *find_upper(karst_nano_writer *w, const int32_t at[3], branch **of, karst_error *error)
{
    branch *b = *of = find_branch(w, at, error);
    if (!b || b->node)
        return b ? b->node : NULL;
    b->node = calloc(1, sizeof *b->node);
    if (!b->node) {
        out_of_memory(error);
        return NULL;
    }
    for (int i = 0; i < 32768; i++)
        b->node->table[i].value = b->value;
    return b->node;
}

bool karst_nano_tile(karst_nano_writer *w, const int32_t at[3], int size_log2, float value, karst_error *error)
{
    branch *b;
    if (size_log2 < KARST_NANO_LOWER_LOG2) {
        const int32_t size = 1 << (size_log2 - KARST_NANO_LEAF_LOG2);
        for (int32_t i = 0; i < size * size * size; i++) {
            const int32_t child[3] = {at[0] + i / (size * size) * 8, at[1] + i / size % size * 8, at[2] + i % size * 8};
            w->lower.table[karst_nano_place(child, KARST_NANO_LOWER_LOG2, KARST_NANO_LEAF_LOG2)].value = value;
        }
        return true;
    }
    if (size_log2 == KARST_NANO_UPPER_LOG2) {
        if ((b = find_branch(w, at, error)))
            b->value = value;
        return b;
    }
    karst_nano_upper *upper = find_upper(w, at, &b, error);
    const int32_t size = 1 << (size_log2 - KARST_NANO_LOWER_LOG2);
    for (int32_t i = 0; upper && i < size * size * size; i++) {
        const int32_t child[3] = {at[0] + i / (size * size) * 128, at[1] + i / size % size * 128,
                                  at[2] + i % size * 128};
        upper->table[karst_nano_place(child, KARST_NANO_UPPER_LOG2, KARST_NANO_LOWER_LOG2)].value = value;
    }
    return upper;
}

void karst_nano_begin_lower(karst_nano_writer *w, const int32_t at[3])
{
    memset(&w->lower, 0, sizeof w->lower);
    for (int i = 0; i < 4096; i++)
        w->lower.table[i].value = w->about->background;
    w->lower_extent = nothing;
    memcpy(w->lower_at, at, sizeof w->lower_at);
}

static void find_extent(const int32_t at[3], const float values[512], const uint64_t active[8], extent *e)
{
    *e = nothing;
    for (int32_t i = 0; i < 512; i++) {
        if (!(active[i >> 6] >> (i & 63) & 1))
            continue;
        const int32_t place[3] = {at[0] + (i >> 6), at[1] + (i >> 3 & 7), at[2] + (i & 7)};
        const extent one = {{place[0], place[1], place[2], place[0], place[1], place[2]}, values[i], values[i], 1};
        add(e, &one);
    }
}

/* A node's fields that tell of its active values. Without any its box is a point in it, which says where it is. */
static void take_extent(const extent *e, const int32_t at[3], int32_t box[6], float *least, float *most)
{
    for (int i = 0; i < 6; i++)
        box[i] = e->num ? e->box[i] : at[i % 3];
    *least = e->num ? e->least : 0;
    *most = e->num ? e->most : 0;
}

bool karst_nano_add_leaf(karst_nano_writer *w, const int32_t at[3], const float values[512], const uint64_t active[8],
                         karst_error *error)
{
    karst_nano_leaf leaf = {.low = {at[0], at[1], at[2]}};
    extent e;
    find_extent(at, values, active, &e);
    memcpy(leaf.values, values, sizeof leaf.values);
    memcpy(leaf.active, active, sizeof leaf.active);
    leaf.least = e.num ? e.least : 0;
    leaf.most = e.num ? e.most : 0;
    for (int axis = 0; axis < 3 && e.num; axis++) {
        leaf.low[axis] = e.box[axis];
        leaf.extent[axis] = (uint8_t)(e.box[3 + axis] - e.box[axis]);
        leaf.flags = KARST_NANO_HAS_ACTIVE;
    }
    if (w->num_leaves == w->room_for_leaves) {
        uint32_t *more = realloc(w->leaf_sums, (w->room_for_leaves * 2 + 1024) * sizeof *more);
        if (!more)
            return out_of_memory(error);
        w->leaf_sums = more;
        w->room_for_leaves = w->room_for_leaves * 2 + 1024;
    }
    const uint32_t place = karst_nano_place(at, KARST_NANO_LOWER_LOG2, KARST_NANO_LEAF_LOG2);
    w->leaf_sums[w->num_leaves] = (uint32_t)crc32(0, (const Bytef *)&leaf, sizeof leaf);
    w->lower.child[place >> 6] |= (uint64_t)1 << (place & 63);
    w->lower.table[place].child = (int64_t)w->num_leaves++;
    add(&w->lower_extent, &e);
    return put(w, LEAVES, &leaf, sizeof leaf, error);
}

static bool has_child(const uint64_t *mask, uint32_t num_words)
{
    for (uint32_t i = 0; i < num_words; i++)
        if (mask[i])
            return true;
    return false;
}

static bool is_uniform(const karst_nano_entry *table, uint32_t num)
{
    for (uint32_t i = 1; i < num; i++)
        if (table[i].value != table[0].value)
            return false;
    return true;
}

bool karst_nano_end_lower(karst_nano_writer *w, karst_error *error)
{
    karst_nano_lower *lower = &w->lower;
    branch *b;
    if (!has_child(lower->child, 64) && is_uniform(lower->table, 4096))
        return lower->table[0].value == w->about->background ||
               karst_nano_tile(w, w->lower_at, KARST_NANO_LOWER_LOG2, lower->table[0].value, error);
    karst_nano_upper *upper = find_upper(w, w->lower_at, &b, error);
    if (!upper)
        return false;
    take_extent(&w->lower_extent, w->lower_at, lower->box, &lower->least, &lower->most);
    lower->flags = w->lower_extent.num ? KARST_NANO_HAS_ACTIVE : 0;
    const uint32_t place = karst_nano_place(w->lower_at, KARST_NANO_UPPER_LOG2, KARST_NANO_LOWER_LOG2);
    upper->child[place >> 6] |= (uint64_t)1 << (place & 63);
    upper->table[place].child = w->num_lowers++;
    add(&b->e, &w->lower_extent);
    return put(w, FOUND_LOWERS, lower, sizeof *lower, error);
}

/* ---- the whole ---- */

static int by_key(const void *a, const void *b)
{
    const uint64_t p = karst_nano_root_key(((const branch *)a)->at), q = karst_nano_root_key(((const branch *)b)->at);
    return p < q ? -1 : p > q;
}

/* Upper nodes without children become values of the root; those of the background are left out. */
static void settle_branches(karst_nano_writer *w)
{
    size_t kept = 0;
    for (size_t i = 0; i < w->num_branches; i++) {
        branch *b = &w->branches[i];
        if (b->node && !has_child(b->node->child, 512) && is_uniform(b->node->table, 32768)) {
            b->value = b->node->table[0].value;
            free(b->node);
            b->node = NULL;
        }
        if (b->node || b->value != w->about->background)
            w->branches[kept++] = *b;
    }
    w->num_branches = kept;
    if (kept > 1)
        qsort(w->branches, kept, sizeof *w->branches, by_key);
    for (size_t i = 0; i < kept; i++) {
        w->num_uppers += w->branches[i].node != NULL;
        add(&w->all, &w->branches[i].e);
    }
}

/* Where the nodes of each kind begin, from the grid's beginning. */
typedef struct {
    uint64_t root, uppers, lowers, leaves, end;
} places;

static places place_nodes(const karst_nano_writer *w)
{
    places p = {.root = sizeof(karst_nano_grid) + sizeof(karst_nano_tree)};
    p.uppers = p.root + sizeof(karst_nano_root) + w->num_branches * sizeof(karst_nano_root_tile);
    p.lowers = p.uppers + w->num_uppers * sizeof(karst_nano_upper);
    p.leaves = p.lowers + w->num_lowers * sizeof(karst_nano_lower);
    p.end = p.leaves + w->num_leaves * sizeof(karst_nano_leaf);
    return p;
}

/* The checksum of nodes is that of their checksums, each a number of eight bytes. */
static uint32_t take_sum(uint32_t all, uint32_t one)
{
    const uint64_t number = one;
    return (uint32_t)crc32(all, (const Bytef *)&number, sizeof number);
}

static bool finish_uppers(karst_nano_writer *w, const places *p, uint32_t *sum)
{
    uint64_t at = p->uppers;
    for (size_t i = 0; i < w->num_branches; i++) {
        karst_nano_upper *node = w->branches[i].node;
        if (!node)
            continue;
        for (uint32_t n = 0; n < 32768; n++)
            if (node->child[n >> 6] >> (n & 63) & 1)
                node->table[n].child =
                    (int64_t)(p->lowers - at + (uint64_t)node->table[n].child * sizeof(karst_nano_lower));
        take_extent(&w->branches[i].e, w->branches[i].at, node->box, &node->least, &node->most);
        node->flags = w->branches[i].e.num ? KARST_NANO_HAS_ACTIVE : 0;
        *sum = take_sum(*sum, (uint32_t)crc32(0, (const Bytef *)node, sizeof *node));
        at += sizeof *node;
    }
    return true;
}

static bool finish_lowers(karst_nano_writer *w, const places *p, uint32_t *sum, karst_error *error)
{
    karst_nano_lower *node = &w->lower;
    uint64_t at = p->lowers;
    if (fflush(w->files[FOUND_LOWERS]) != 0 || fseeko(w->files[FOUND_LOWERS], 0, SEEK_SET) != 0)
        return cannot_write(w, error);
    for (uint32_t i = 0; i < w->num_lowers; i++) {
        if (fread(node, sizeof *node, 1, w->files[FOUND_LOWERS]) != 1)
            return cannot_write(w, error);
        for (uint32_t n = 0; n < 4096; n++)
            if (node->child[n >> 6] >> (n & 63) & 1)
                node->table[n].child =
                    (int64_t)(p->leaves - at + (uint64_t)node->table[n].child * sizeof(karst_nano_leaf));
        *sum = take_sum(*sum, (uint32_t)crc32(0, (const Bytef *)node, sizeof *node));
        if (!put(w, LOWERS, node, sizeof *node, error))
            return false;
        at += sizeof *node;
    }
    return true;
}

static void fill_map(const karst_nano_about *about, karst_nano_map *map)
{
    for (int i = 0; i < 3; i++) {
        map->matrix[4 * i] = about->voxel_m;
        map->inverse[4 * i] = 1 / about->voxel_m;
        map->offset[i] = about->origin_m[i];
        map->matrix_f[4 * i] = (float)about->voxel_m;
        map->inverse_f[4 * i] = (float)(1 / about->voxel_m);
        map->offset_f[i] = (float)about->origin_m[i];
    }
    map->taper = 1;
    map->taper_f = 1;
}

/* As the library finds names. */
static uint64_t key_of(const char *name)
{
    uint64_t key = 0;
    for (const unsigned char *c = (const unsigned char *)name; *c; c++) {
        const uint64_t overflow = key >> 56;
        key = key * 67 + *c + overflow;
    }
    return key;
}

/* The grid, its tree, its root, the root's tiles: one block, of which all but the first 16 bytes are summed. */
static char *make_head(const karst_nano_writer *w, const places *p, size_t *num_bytes)
{
    char *head = calloc(1, *num_bytes = p->uppers);
    if (!head)
        return NULL;
    const karst_nano_about *about = w->about;
    karst_nano_grid *grid = (karst_nano_grid *)head;
    karst_nano_tree *tree = (karst_nano_tree *)(grid + 1);
    karst_nano_root *root = (karst_nano_root *)(tree + 1);
    karst_nano_root_tile *tiles = (karst_nano_root_tile *)(root + 1);
    *grid = (karst_nano_grid){.magic = KARST_NANO_MAGIC,
                              .version = KARST_NANO_VERSION,
                              .flags = KARST_NANO_HAS_BOX | KARST_NANO_HAS_RANGE | KARST_NANO_IS_BREADTH_FIRST,
                              .num_grids = 1,
                              .grid_bytes = p->end,
                              .grid_class = about->grid_class,
                              .type = KARST_NANO_TYPE_FLOAT};
    snprintf(grid->name, sizeof grid->name, "%s", about->name);
    fill_map(about, &grid->map);
    for (int i = 0; i < 3; i++) {
        grid->voxel[i] = about->voxel_m;
        grid->world_box[i] = w->all.num ? about->origin_m[i] + about->voxel_m * w->all.box[i] : 0;
        grid->world_box[3 + i] = w->all.num ? about->origin_m[i] + about->voxel_m * (w->all.box[3 + i] + 1.0) : 0;
    }
    const uint64_t from_tree = sizeof *grid;
    *tree = (karst_nano_tree){.offset = {w->num_leaves ? p->leaves - from_tree : 0,
                                         w->num_lowers ? p->lowers - from_tree : 0,
                                         w->num_uppers ? p->uppers - from_tree : 0, p->root - from_tree},
                              .num_nodes = {(uint32_t)w->num_leaves, w->num_lowers, w->num_uppers},
                              .num_active = w->all.num};
    *root = (karst_nano_root){.num_tiles = (uint32_t)w->num_branches,
                              .background = about->background,
                              .least = w->all.num ? w->all.least : about->background,
                              .most = w->all.num ? w->all.most : about->background};
    memcpy(root->box, w->all.box, sizeof root->box);
    uint64_t child = p->uppers - p->root;
    for (size_t i = 0; i < w->num_branches; i++) {
        tiles[i].key = karst_nano_root_key(w->branches[i].at);
        tiles[i].value = w->branches[i].value;
        if (w->branches[i].node) {
            tiles[i].value = 0;
            tiles[i].child = (int64_t)child;
            child += sizeof(karst_nano_upper);
        }
    }
    return head;
}

static bool put_top(karst_nano_writer *w, const places *p, uint32_t nodes_sum, karst_error *error)
{
    size_t head_bytes;
    char *head = make_head(w, p, &head_bytes);
    if (!head)
        return out_of_memory(error);
    karst_nano_grid *grid = (karst_nano_grid *)head;
    const uint32_t head_sum = (uint32_t)crc32(0, (const Bytef *)head + 16, (uInt)(head_bytes - 16));
    /* a tree of nothing has no sum of nodes */
    grid->checksum = head_sum | (uint64_t)(w->num_branches ? nodes_sum : UINT32_MAX) << 32;
    const karst_nano_segment segment = {KARST_NANO_MAGIC, KARST_NANO_VERSION, 1, KARST_NANO_CODEC_NONE};
    karst_nano_record record = {.grid_bytes = p->end,
                                .file_bytes = p->end,
                                .name_key = key_of(grid->name),
                                .num_active = w->all.num,
                                .type = grid->type,
                                .grid_class = grid->grid_class,
                                .name_bytes = (uint32_t)strlen(grid->name) + 1,
                                .num_nodes = {(uint32_t)w->num_leaves, w->num_lowers, w->num_uppers, 1},
                                .version = KARST_NANO_VERSION};
    memcpy(record.world_box, grid->world_box, sizeof record.world_box);
    memcpy(record.index_box, w->all.box, sizeof record.index_box);
    memcpy(record.voxel, grid->voxel, sizeof record.voxel);
    bool done = put(w, TOP, &segment, sizeof segment, error) && put(w, TOP, &record, sizeof record, error) &&
                put(w, TOP, grid->name, record.name_bytes, error) && put(w, TOP, head, head_bytes, error);
    for (size_t i = 0; done && i < w->num_branches; i++)
        if (w->branches[i].node)
            done = put(w, TOP, w->branches[i].node, sizeof(karst_nano_upper), error);
    free(head);
    return done;
}

bool karst_nano_finish(karst_nano_writer *w, FILE *parts[KARST_NANO_PARTS], karst_error *error)
{
    if (w->num_leaves > UINT32_MAX)
        return karst_fail(error, KARST_USAGE, "%s would hold more than 2^32 leaves: take wider voxels or a smaller box",
                          w->path);
    settle_branches(w);
    const places p = place_nodes(w);
    uint32_t sum = 0;
    if (!finish_uppers(w, &p, &sum) || !finish_lowers(w, &p, &sum, error))
        return false;
    for (uint64_t i = 0; i < w->num_leaves; i++)
        sum = take_sum(sum, w->leaf_sums[i]);
    if (!put_top(w, &p, sum, error))
        return false;
    for (int i = 0; i < KARST_NANO_PARTS; i++)
        parts[i] = w->files[i];
    return true;
}

uint64_t karst_nano_num_active(const karst_nano_writer *w) { return w->all.num; }
uint64_t karst_nano_num_leaves(const karst_nano_writer *w) { return w->num_leaves; }
