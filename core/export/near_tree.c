#include "core/export/near_tree.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/export/index_map.h"
#include "producers/density/sampler_slopes.h"

/* How many are kept between searches: 80 MiB. */
enum { MANY_NODES = 3 << 20, FIRST_NODES = 4096 };
/* Roots are told apart by so many bits of each coordinate, from the first one's. */
enum { KEY_BITS = 21, KEY_HALF = 1 << (KEY_BITS - 1), NEIGHBOURS = 4 };

/* What somebody asked for and learnt. */
enum { NOT_ASKED, SOLID, AIR, NEITHER };
/* Bounds, which cost as much as a hundred samples, are asked for at each so many levels: between, slopes and a sample
 * have to do. */
enum { LEVELS_OF_BOUND = 2, NO_SLOPES = 127 };

typedef struct {
    uint32_t children;   /* the first of eight; 0: there are none */
    uint32_t solid;      /* samples */
    float least;         /* of the samples, without their signs */
    float density;       /* in the middle */
    float slope, slack;  /* of densities: for each metre along all axes, and besides */
    int8_t slopes_level; /* of the cube, this or one above, whose slopes these are; NO_SLOPES: nobody's */
    uint8_t by_slopes, by_both, by_bounds;
    bool is_sampled;
} node;

struct karst_near_tree {
    karst_sampler *sampler;
    double footprint_m;
    int voxel_log2_m, root_level;
    node *nodes; /* from 1 */
    size_t num, max;
    karst_index_map root_of;
    int64_t first_root[3];
};

karst_near_tree *karst_near_tree_create(karst_sampler *sampler, double footprint_m, int voxel_log2_m, int root_level)
{
    karst_near_tree *tree = calloc(1, sizeof *tree);
    if (!tree)
        return NULL;
    tree->sampler = sampler;
    tree->footprint_m = footprint_m;
    tree->voxel_log2_m = voxel_log2_m;
    tree->root_level = root_level;
    tree->num = 1;
    return tree;
}

void karst_near_tree_destroy(karst_near_tree *tree)
{
    if (!tree)
        return;
    karst_index_map_finish(&tree->root_of);
    free(tree->nodes);
    free(tree);
}

static void forget(karst_near_tree *tree)
{
    karst_index_map_clear(&tree->root_of);
    tree->num = 1;
}

/* How far a root is from the first, from 0; more than KEY_BITS have: it is too far. */
static uint64_t way_to(const karst_near_tree *tree, const int64_t root[3], int axis)
{
    return (uint64_t)root[axis] - (uint64_t)tree->first_root[axis] + KEY_HALF;
}

void karst_near_tree_begin(karst_near_tree *tree, const int64_t root[3])
{
    bool is_near = tree->num > 1 && tree->num < MANY_NODES;
    for (int axis = 0; axis < 3; axis++)
        is_near = is_near && way_to(tree, root, axis) - NEIGHBOURS < 2 * (KEY_HALF - NEIGHBOURS);
    if (is_near)
        return;
    forget(tree);
    memcpy(tree->first_root, root, sizeof tree->first_root);
}

/* The first of `num` new nodes; 0: out of memory. */
static uint32_t add_nodes(karst_near_tree *tree, size_t num)
{
    if (tree->num + num > tree->max) {
        const size_t more = tree->max ? 2 * tree->max : FIRST_NODES;
        node *larger = more < UINT32_MAX ? realloc(tree->nodes, more * sizeof *larger) : NULL;
        if (!larger)
            return 0;
        tree->nodes = larger;
        tree->max = more;
    }
    const uint32_t first = (uint32_t)tree->num;
    memset(tree->nodes + first, 0, num * sizeof *tree->nodes);
    tree->num += num;
    return first;
}

/* Adds half a cube, a quarter, ...: an aligned place never carries over. */
static void move(karst_position *place, int axis, int level)
{
    if (level >= 0)
        place->voxel[axis] += (int64_t)1 << level;
    else
        place->fraction[axis] += 1u << (32 + level);
}

/* Their middles, and slopes of the cube above. */
static void begin_nodes(karst_near_tree *tree, const karst_near_cube *cubes, int num, const node *above)
{
    karst_position at[8];
    float density[8];
    memset(at, 0, sizeof at); /* some compilers do not see that `num` of them are set */
    for (int i = 0; i < num; i++) {
        at[i] = cubes[i].low;
        for (int axis = 0; axis < 3; axis++)
            move(&at[i], axis, cubes[i].level - 1);
    }
    karst_sampler_densities(tree->sampler, at, (size_t)num, tree->footprint_m, density);
    for (int i = 0; i < num; i++)
        tree->nodes[cubes[i].node] = (node){.density = density[i],
                                            .slope = above ? above->slope : 0,
                                            .slack = above ? above->slack : 0,
                                            .slopes_level = above ? above->slopes_level : NO_SLOPES};
}

bool karst_near_tree_root(karst_near_tree *tree, const int64_t root[3], karst_near_cube *cube)
{
    uint64_t key = 0;
    *cube = (karst_near_cube){.level = tree->root_level};
    for (int axis = 0; axis < 3; axis++) {
        cube->low.voxel[axis] = root[axis] * ((int64_t)1 << tree->root_level);
        key |= way_to(tree, root, axis) << KEY_BITS * axis;
    }
    const uint32_t *known = karst_index_map_find(&tree->root_of, key);
    cube->node = known ? *known : add_nodes(tree, 1);
    if (cube->node && !known)
        begin_nodes(tree, cube, 1, NULL);
    return cube->node && (known || karst_index_map_add(&tree->root_of, key, cube->node));
}

static void child_of(const karst_near_cube *cube, uint32_t children, int child, karst_near_cube *part)
{
    *part = (karst_near_cube){.low = cube->low, .node = children + (uint32_t)child, .level = cube->level - 1};
    for (int axis = 0; axis < 3; axis++)
        if (child >> axis & 1)
            move(&part->low, axis, part->level);
}

bool karst_near_tree_child(karst_near_tree *tree, const karst_near_cube *cube, int child, karst_near_cube *part)
{
    uint32_t children = tree->nodes[cube->node].children;
    if (!children) {
        karst_near_cube parts[8];
        children = add_nodes(tree, 8);
        if (!children)
            return false;
        for (int i = 0; i < 8; i++)
            child_of(cube, children, i, &parts[i]);
        node *above = &tree->nodes[cube->node];
        above->children = children;
        begin_nodes(tree, parts, 8, above);
    }
    child_of(cube, children, child, part);
    return true;
}

static double half_of(const karst_near_tree *tree, const karst_near_cube *cube)
{
    return ldexp(1, cube->level - 1 + tree->voxel_log2_m) * (1 + 0x1p-40) + ldexp(1, tree->voxel_log2_m - 30);
}

static int sign_of(uint8_t side) { return side == SOLID ? 1 : side == AIR ? -1 : 0; }

static uint8_t prove(karst_near_tree *tree, const karst_near_cube *cube, karst_sampler_slopes *slopes)
{
    const double half = half_of(tree, cube), half_m[3] = {half, half, half};
    karst_position centre = cube->low;
    double range[2];
    for (int axis = 0; axis < 3; axis++)
        move(&centre, axis, cube->level - 1);
    if (!karst_sampler_prove(tree->sampler, &centre, half_m, tree->footprint_m, range, slopes))
        return NEITHER;
    return range[0] > 0 ? SOLID : range[1] <= 0 ? AIR : NEITHER;
}

/* All is as the middle is, if that is farther from 0 than densities differ. */
static uint8_t judge(const karst_near_tree *tree, const karst_near_cube *cube)
{
    const node *n = &tree->nodes[cube->node];
    const double most = ((double)n->slope * half_of(tree, cube) + (double)n->slack) * (1 + 0x1p-20);
    if (n->slopes_level == NO_SLOPES || !(fabs((double)n->density) > most))
        return NEITHER;
    return n->density > 0 ? SOLID : AIR;
}

int karst_near_tree_glance(karst_near_tree *tree, const karst_near_cube *cube)
{
    node *n = &tree->nodes[cube->node];
    if (n->by_slopes == NOT_ASKED)
        n->by_slopes = judge(tree, cube);
    return sign_of(n->by_slopes);
}

int karst_near_tree_side(karst_near_tree *tree, const karst_near_cube *cube)
{
    node *n = &tree->nodes[cube->node];
    if (n->by_both != NOT_ASKED)
        return sign_of(n->by_both);
    karst_near_tree_glance(tree, cube);
    n->by_both = n->by_slopes;
    if (n->by_both == NEITHER && n->slopes_level - cube->level >= LEVELS_OF_BOUND) {
        karst_sampler_slopes slopes;
        n->by_both = prove(tree, cube, &slopes);
        if (slopes.is_known) {
            n->slope = (float)((slopes.in_m[0] + slopes.in_m[1] + slopes.in_m[2]) * (1 + 0x1p-20));
            n->slack = (float)(slopes.slack * (1 + 0x1p-20));
            n->slopes_level = (int8_t)cube->level;
        } else {
            n->slopes_level = NO_SLOPES;
        }
    }
    return sign_of(n->by_both);
}

int karst_near_tree_prove(karst_near_tree *tree, const karst_near_cube *cube)
{
    node *n = &tree->nodes[cube->node];
    if (n->by_bounds == NOT_ASKED) {
        const uint32_t solid = karst_near_tree_solid(tree, cube), all = (1u << KARST_NEAR_SAMPLES) - 1;
        const double most = ((double)n->slope * half_of(tree, cube) / 2 + (double)n->slack) * (1 + 0x1p-20);
        if (n->slopes_level != NO_SLOPES && (solid == 0 || solid == all) && (double)n->least > most)
            n->by_bounds = solid ? SOLID : AIR;
        else
            n->by_bounds = prove(tree, cube, NULL);
    }
    return sign_of(n->by_bounds);
}

uint32_t karst_near_tree_solid(karst_near_tree *tree, const karst_near_cube *cube)
{
    node *n = &tree->nodes[cube->node];
    karst_position at[KARST_NEAR_SAMPLES];
    float density[KARST_NEAR_SAMPLES];
    if (n->is_sampled)
        return n->solid;
    for (int i = 0; i < KARST_NEAR_SAMPLES; i++) {
        const int step[3] = {i % 3, i / 3 % 3, i / 9};
        double offset_m[3];
        for (int axis = 0; axis < 3; axis++)
            offset_m[axis] = ldexp(step[axis], cube->level - 1 + tree->voxel_log2_m);
        at[i] = karst_position_add_m(cube->low, offset_m, tree->voxel_log2_m);
    }
    karst_sampler_densities(tree->sampler, at, KARST_NEAR_SAMPLES, tree->footprint_m, density);
    n->solid = 0;
    n->least = INFINITY;
    for (int i = 0; i < KARST_NEAR_SAMPLES; i++) {
        n->solid |= (uint32_t)(density[i] > 0) << i;
        n->least = fabsf(density[i]) >= n->least ? n->least : fabsf(density[i]); /* a NaN stays */
    }
    n->is_sampled = true;
    return n->solid;
}
