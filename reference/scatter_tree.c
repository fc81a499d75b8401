#include "reference/scatter_tree.h"

#include <math.h>
#include <stdlib.h>

#include "reference/range.h"

#define MOST_REACH 0x1p40

/* A leaf that may be split, and how much is looked up in vain in it. */
typedef struct {
    double waste;
    double corner[3], side;
    uint32_t node;
} candidate;

typedef struct {
    karst_scatter_tree *tree;
    karst_sampler *sampler;
    int voxel_log2_m;
    candidate *heap; /* the most wasteful first */
    uint32_t num;
} builder;

/* ---- the heap ---- */

static void heap_add(builder *b, const candidate *c)
{
    uint32_t at = b->num++;
    for (; at > 0 && b->heap[(at - 1) / 2].waste < c->waste; at = (at - 1) / 2)
        b->heap[at] = b->heap[(at - 1) / 2];
    b->heap[at] = *c;
}

static candidate heap_take(builder *b)
{
    const candidate first = b->heap[0], last = b->heap[--b->num];
    uint32_t at = 0;
    for (;;) {
        uint32_t below = 2 * at + 1;
        if (below + 1 < b->num && b->heap[below + 1].waste > b->heap[below].waste)
            below++;
        if (below >= b->num || b->heap[below].waste <= last.waste)
            break;
        b->heap[at] = b->heap[below];
        at = below;
    }
    b->heap[at] = last;
    return first;
}

/* ---- bounds ---- */

/* Bounds are of what devices compute, in floats; what is looked up is double. */
#define ROUNDING 1e-5

static void bound(builder *b, candidate *c)
{
    const double half = c->side / 2, half_m = ldexp(half, b->voxel_log2_m), halves_m[3] = {half_m, half_m, half_m};
    const double middle[3] = {c->corner[0] + half, c->corner[1] + half, c->corner[2] + half};
    const karst_position centre = karst_reference_place(&b->tree->corner, middle, 1);
    karst_scatter_node *node = &b->tree->nodes[c->node];
    double range[2];
    karst_sampler_bounds(b->sampler, &centre, halves_m, 0, range);
    node->lo = range[0] > 0 ? range[0] * (1 - ROUNDING) : 0;
    node->hi = range[1] > 0 ? range[1] * (1 + ROUNDING) : 0;
    c->waste = (node->hi - node->lo) * c->side * c->side * c->side;
}

static void split(builder *b, const candidate *c)
{
    karst_scatter_tree *tree = b->tree;
    tree->nodes[c->node].child = tree->num_nodes;
    for (uint32_t i = 0; i < 8; i++) {
        candidate part = {.side = c->side / 2, .node = tree->num_nodes++};
        for (int axis = 0; axis < 3; axis++)
            part.corner[axis] = c->corner[axis] + (i >> axis & 1u ? part.side : 0);
        bound(b, &part);
        /* Below a voxel nothing is gained but for what has none. */
        if (part.waste > 0 && part.side > 0x1p-10)
            heap_add(b, &part);
    }
}

/* What all leaves come to. */
static void sum_up(karst_scatter_tree *tree, uint32_t node, const double corner[3], double side)
{
    const karst_scatter_node *n = &tree->nodes[node];
    for (uint32_t i = 0; i < 8 && n->child; i++) {
        double part[3];
        for (int axis = 0; axis < 3; axis++)
            part[axis] = corner[axis] + (i >> axis & 1u ? side / 2 : 0);
        sum_up(tree, n->child + i, part, side / 2);
    }
    if (n->child || n->hi == 0)
        return;
    tree->majorant = fmax(tree->majorant, n->hi);
    for (int axis = 0; axis < 3; axis++) {
        tree->least[axis] = fmin(tree->least[axis], corner[axis]);
        tree->most[axis] = fmax(tree->most[axis], corner[axis] + side);
    }
}

bool karst_scatter_tree_init(karst_scatter_tree *tree, karst_sampler *sampler, int voxel_log2_m,
                             const karst_position *around, double reach, uint32_t max_nodes, karst_error *error)
{
    *tree = (karst_scatter_tree){.least = {INFINITY, INFINITY, INFINITY}, .most = {-INFINITY, -INFINITY, -INFINITY}};
    if (!(reach <= MOST_REACH))
        return karst_fail(error, KARST_USAGE, "a view of %g voxels: media are told as far as 2^40", reach);
    const int unit_log2 = reach > 1 ? ilogb(reach) + 1 : 0;
    /* Corners of nodes lie where those of bricks do, whatever the place. */
    for (int axis = 0; axis < 3; axis++)
        tree->corner.voxel[axis] = ((around->voxel[axis] >> unit_log2) - 1) * ((int64_t)1 << unit_log2);
    tree->side = ldexp(4, unit_log2);
    tree->nodes = calloc(max_nodes, sizeof *tree->nodes);
    builder b = {.tree = tree, .sampler = sampler, .voxel_log2_m = voxel_log2_m};
    b.heap = calloc(max_nodes, sizeof *b.heap);
    if (!tree->nodes || !b.heap) {
        free(b.heap);
        return karst_fail(error, KARST_FAILED, "out of memory");
    }
    candidate root = {.side = tree->side};
    tree->num_nodes = 1;
    bound(&b, &root);
    heap_add(&b, &root);
    while (b.num > 0 && max_nodes - tree->num_nodes >= 8) {
        const candidate next = heap_take(&b);
        split(&b, &next);
    }
    free(b.heap);
    sum_up(tree, 0, (double[3]){0, 0, 0}, tree->side);
    return tree->majorant < INFINITY ||
           karst_fail(error, KARST_USAGE,
                      "bounds prove no finite extinction in %u nodes: paths of light need one; `clamp` gives it",
                      tree->num_nodes);
}

void karst_scatter_tree_finish(karst_scatter_tree *tree) { free(tree->nodes); }

const karst_scatter_node *karst_scatter_tree_leaf(const karst_scatter_tree *tree, const double from[3],
                                                  const double direction[3], double t, double *exit)
{
    double corner[3] = {0, 0, 0}, side = tree->side;
    const karst_scatter_node *node = tree->nodes;
    while (node->child) {
        uint32_t i = 0;
        side /= 2;
        for (int axis = 0; axis < 3; axis++)
            if (from[axis] + t * direction[axis] >= corner[axis] + side) {
                corner[axis] += side;
                i |= 1u << axis;
            }
        node = tree->nodes + node->child + i;
    }
    *exit = INFINITY;
    for (int axis = 0; axis < 3; axis++)
        if (direction[axis] != 0)
            *exit = fmin(*exit, (corner[axis] + (direction[axis] > 0 ? side : 0) - from[axis]) / direction[axis]);
    return node;
}
