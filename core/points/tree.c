/* The tree over a level's points: leaves of eight points that follow one another, nodes of eight leaves or nodes that
 * do. In Morton order those lie near one another, and all is one pass over files: the nodes of each level are made from
 * those of the level below, as they were written. */
#include <string.h>

#include "core/points/import_internal.h"

#define BLOCK 4096u
_Static_assert(BLOCK % KARST_POINTS_FAN == 0, "whole nodes");

typedef struct {
    points_import *import;
    points_level_files files;
    uint64_t from, to; /* bytes of MODEL: the nodes below, and those that are made */
    uint64_t sum;
} building;

typedef struct {
    karst_point points[BLOCK];
    points_extent extents[BLOCK];
    karst_point_node below[BLOCK], made[BLOCK / KARST_POINTS_FAN];
} tree_slot;

static void grow(karst_point_node *node, const karst_point_node *by)
{
    for (int a = 0; a < 3; a++) {
        node->min[a] = by->min[a] < node->min[a] ? by->min[a] : node->min[a];
        node->max[a] = by->max[a] > node->max[a] ? by->max[a] : node->max[a];
    }
    node->reach = by->reach > node->reach ? by->reach : node->reach;
    node->cover = by->cover > node->cover ? by->cover : node->cover;
    node->spread = by->spread > node->spread ? by->spread : node->spread;
}

static karst_point_node node_of(const karst_point *point, const points_extent *of)
{
    karst_point_node node = {.reach = karst_point_reach(point->radius), .cover = of->cover, .spread = of->spread};
    memcpy(node.min, point->at, sizeof node.min);
    memcpy(node.max, point->at, sizeof node.max);
    return node;
}

static uint64_t num_over(uint64_t num) { return (num + KARST_POINTS_FAN - 1) / KARST_POINTS_FAN; }

static void make_nodes(tree_slot *slot, size_t num)
{
    for (size_t i = 0; i < num; i++) {
        karst_point_node *node = &slot->made[i / KARST_POINTS_FAN];
        if (i % KARST_POINTS_FAN)
            grow(node, &slot->below[i]);
        else
            *node = slot->below[i];
    }
}

static bool make_leaves(void *user, points_block *block, karst_error *error)
{
    const building *b = user;
    tree_slot *slot = block->slot;
    const size_t num = (size_t)(block->end - block->begin);
    if (!karst_points_read_level(&b->files, block->begin, num, slot->points, slot->extents, error))
        return false;
    for (size_t i = 0; i < num; i++)
        slot->below[i] = node_of(&slot->points[i], &slot->extents[i]);
    make_nodes(slot, num);
    return true;
}

static bool make_level(void *user, points_block *block, karst_error *error)
{
    const building *b = user;
    tree_slot *slot = block->slot;
    const size_t num = (size_t)(block->end - block->begin);
    if (!karst_points_read(b->import, b->files.model, slot->below, num * sizeof *slot->below,
                           b->from + block->begin * sizeof *slot->below, error))
        return false;
    make_nodes(slot, num);
    return true;
}

static bool put_nodes(void *user, points_block *block, karst_error *error)
{
    building *b = user;
    const tree_slot *slot = block->slot;
    const size_t num_bytes = (size_t)num_over(block->end - block->begin) * sizeof *slot->made;
    b->sum = karst_points_sum(b->sum, slot->made, num_bytes);
    return karst_points_write(b->import, b->files.model, slot->made, num_bytes,
                              b->to + block->begin / KARST_POINTS_FAN * sizeof *slot->made, error);
}

static bool for_blocks(building *b, uint64_t num, bool (*work)(void *user, points_block *block, karst_error *error),
                       karst_error *error)
{
    const points_turns turns = {
        .loop = {"trees", 0, num, num, BLOCK, false}, .slot_bytes = sizeof(tree_slot), .work = work, .put = put_nodes};
    return karst_points_in_turns(b->import, &turns, b, error);
}

bool karst_points_add_tree(points_import *import, uint32_t level, karst_error *error)
{
    karst_points_head *head = import->head;
    const karst_points_level *of = &head->levels[level];
    uint32_t counts[KARST_POINTS_MAX_TREE];
    const int num_levels = karst_points_tree((uint32_t)of->num, counts);
    building b = {.import = import, .to = karst_points_tree_offset(of)};
    /* Points end at any 4 bytes: what is between is zero. */
    const uint64_t points_end = of->offset + of->num * sizeof(karst_point);
    bool done = karst_points_open_level(import, level, &b.files, error) &&
                karst_points_write(import, b.files.model, "\0\0\0\0\0\0\0", (size_t)(b.to - points_end), points_end,
                                   error) &&
                for_blocks(&b, of->num, make_leaves, error);
    for (int i = 1; done && i < num_levels; i++) {
        b.from = b.to;
        b.to += counts[i - 1] * sizeof(karst_point_node);
        done = for_blocks(&b, counts[i - 1], make_level, error);
    }
    head->tree_sums[level] = b.sum;
    return done;
}
