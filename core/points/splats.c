/* Building octrees of discs: see core/points/splats.h. */
#include "core/points/splats.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A level's leaves are four of its spacings wide: some sixteen points. */
#define SPACINGS_LOG2 2
/* Keys of leaves fit 64 bits. */
#define MOST_KEYED_DEPTH 20
/* Of the finest level, leaves with more points than this are parted; where that ends, more than this are too many. */
#define MOST_OWN 32u
#define MOST_AT_ONE_PLACE 1024u
/* A disc's radius is no more than so many leaves: what a file says of radii is a stranger's word. */
#define MOST_CELLS 4.0
/* Probe rays: so many on a side of a leaf, in each direction. */
#define PROBES 6
#define NUM_DIRECTIONS 7
/* An own disc is enough for a probe ray that meets it no farther from its centre, in radii: so between probes, too. */
#define ENOUGH 0.75

/* A disc in a leaf of its level: sorted by leaf, a leaf's own first, then as points are. */
typedef struct {
    uint64_t key; /* of the leaf: its place in Morton order, times 2; 1 is added to that of copies */
    uint32_t index;
} entry;

typedef struct {
    const karst_splat_level *level;
    entry *entries;
    uint64_t num;
    int depth; /* of its leaves */
} sorted_level;

typedef struct {
    karst_splat_tree *tree;
    sorted_level levels[KARST_SPLAT_MAX_DEPTH + 1]; /* the finest first */
    uint32_t num_levels;
    bool culls;
    uint32_t room_nodes, room_discs;
    karst_error *error;
} building;

/* A cube: its lower corner, and how wide it is. */
typedef struct {
    double corner[3], width;
} cube;

static bool no_memory(karst_error *error) { return karst_fail(error, KARST_FAILED, "out of memory for discs"); }

/* ---- which leaves discs touch ---- */

/* How far a disc reaches along each axis. */
static void reach_of(const karst_point *p, double radius, double reach[3])
{
    const double square = (double)p->normal[0] * p->normal[0] + (double)p->normal[1] * p->normal[1] +
                          (double)p->normal[2] * p->normal[2];
    for (int a = 0; a < 3; a++) {
        const double part = square > 0 ? (double)p->normal[a] * p->normal[a] / square : 0;
        reach[a] = radius * sqrt(fmax(1 - part, 0)) + 1;
    }
}

/* Whether a disc touches a cube, or nearly does. */
static bool touches(const karst_point *p, double radius, const cube *c)
{
    double reach[3], apart = 0, height = 0, extent = 0;
    reach_of(p, radius, reach);
    for (int a = 0; a < 3; a++) {
        const double low = c->corner[a] - p->at[a], high = low + c->width;
        if (low > reach[a] || high < -reach[a])
            return false;
        const double outside = low > 0 ? low : high < 0 ? high : 0;
        apart += outside * outside;
        height += (double)p->normal[a] * (low + high) / 2;
        extent += fabs((double)p->normal[a]) * c->width / 2;
    }
    return apart <= (radius + 1) * (radius + 1) && fabs(height) <= extent + 32767;
}

static bool holds(const karst_point *p, const cube *c)
{
    bool inside = true;
    for (int a = 0; a < 3; a++)
        inside = inside && p->at[a] >= c->corner[a] && p->at[a] < c->corner[a] + c->width;
    return inside;
}

static uint64_t spread_bits(uint64_t v) /* bit i to bit 3 i */
{
    uint64_t out = 0;
    for (int i = 0; i <= MOST_KEYED_DEPTH; i++)
        out |= (v >> i & 1) << (3 * i);
    return out;
}

/* The discs of a level in all leaves that they touch; with `to` NULL only how many that are, or some more than
 * most_entries. */
static uint64_t spread_level(const karst_splat_level *level, int root_log2, int depth, uint64_t most_entries,
                             entry *to)
{
    const double width = ldexp(1, root_log2 + 1 - depth), low = -ldexp(1, root_log2);
    uint64_t num = 0;
    for (uint32_t i = 0; i < level->num && num <= most_entries; i++) {
        const karst_point *p = &level->points[i];
        const double radius = fmin((double)karst_splat_radius(p->radius), MOST_CELLS * width);
        double reach[3];
        long first[3], last[3], at[3], most = (1L << depth) - 1;
        reach_of(p, radius, reach);
        for (int a = 0; a < 3; a++) {
            first[a] = (long)fmax(floor((p->at[a] - reach[a] - low) / width), 0);
            last[a] = (long)fmin(floor((p->at[a] + reach[a] - low) / width), (double)most);
        }
        for (at[2] = first[2]; at[2] <= last[2]; at[2]++)
            for (at[1] = first[1]; at[1] <= last[1]; at[1]++)
                for (at[0] = first[0]; at[0] <= last[0]; at[0]++) {
                    cube c = {.width = width};
                    for (int a = 0; a < 3; a++)
                        c.corner[a] = low + (double)at[a] * width;
                    const bool is_own = holds(p, &c);
                    if (!is_own && !touches(p, radius, &c))
                        continue;
                    if (to)
                        to[num] = (entry){(spread_bits((uint64_t)at[0]) | spread_bits((uint64_t)at[1]) << 1 |
                                           spread_bits((uint64_t)at[2]) << 2) << 1 | !is_own, i};
                    num++;
                }
    }
    return num;
}

static int compare_entries(const void *a, const void *b)
{
    const entry *one = a, *other = b;
    if (one->key != other->key)
        return one->key < other->key ? -1 : 1;
    return one->index < other->index ? -1 : one->index > other->index;
}

/* ---- culling ---- */

/* Whether a ray meets a disc inside a cube; *share: how far from its centre, in radii. */
static bool meets(const karst_point *p, const cube *c, const double from[3], const double to[3], double *share)
{
    const double radius = (double)karst_splat_radius(p->radius);
    double up = 0, height = 0, square = 0;
    for (int a = 0; a < 3; a++) {
        up += p->normal[a] * to[a];
        height += p->normal[a] * (p->at[a] - from[a]);
    }
    if (p->normal[0] == 0 && p->normal[1] == 0 && p->normal[2] == 0)
        for (int a = 0; a < 3; a++) { /* it faces each ray */
            up += to[a] * to[a];
            height += to[a] * (p->at[a] - from[a]);
        }
    if (fabs(up) < 1e-9)
        return false;
    for (int a = 0; a < 3; a++) {
        const double at = from[a] + height / up * to[a];
        if (at < c->corner[a] || at > c->corner[a] + c->width)
            return false;
        square += (at - p->at[a]) * (at - p->at[a]);
    }
    *share = sqrt(square) / radius;
    return *share < 1;
}

/* Marks the copies that a probe ray needs: discs[num_own] to discs[num - 1]. */
static void probe(const karst_point *discs, uint32_t num_own, uint32_t num, const cube *c, const double from[3],
                  const double to[3], bool *needed)
{
    double share, best = 2;
    uint32_t chosen = num;
    for (uint32_t i = 0; i < num_own; i++)
        if (meets(&discs[i], c, from, to, &share) && share < ENOUGH)
            return;
    for (uint32_t i = num_own; i < num; i++)
        if (meets(&discs[i], c, from, to, &share) && share < best) {
            best = share;
            chosen = i;
        }
    if (chosen < num)
        needed[chosen] = true;
}

/* Leaves out the copies of a leaf that no probe ray needs; returns how many discs are left. */
static uint32_t cull(karst_point *discs, uint32_t num_own, uint32_t num, const cube *c, bool *needed)
{
    static const signed char directions[NUM_DIRECTIONS][3] = {{1, 0, 0}, {0, 1, 0},  {0, 0, 1}, {1, 1, 1},
                                                              {-1, 1, 1}, {1, -1, 1}, {1, 1, -1}};
    memset(needed, 0, num * sizeof *needed);
    for (int d = 0; d < NUM_DIRECTIONS; d++) {
        const bool along = d < 3;
        const double to[3] = {directions[d][0], directions[d][1], directions[d][2]};
        const int u = along ? (d + 1) % 3 : 0, v = along ? (d + 2) % 3 : 1;
        for (int i = 0; i < PROBES * PROBES; i++) {
            double from[3];
            for (int a = 0; a < 3; a++)
                from[a] = c->corner[a] + 0.5 * c->width;
            from[u] = c->corner[u] + (i % PROBES + 0.5) / PROBES * c->width;
            from[v] = c->corner[v] + ((double)(i / PROBES) + 0.5) / PROBES * c->width;
            probe(discs, num_own, num, c, from, to, needed);
        }
    }
    uint32_t kept = num_own;
    for (uint32_t i = num_own; i < num; i++)
        if (needed[i])
            discs[kept++] = discs[i];
    return kept;
}

/* ---- nodes ---- */

static bool grow(void **memory, uint32_t *room, uint64_t wanted, size_t each_bytes)
{
    if (wanted <= *room)
        return true;
    uint64_t more = wanted + wanted / 2 + 64;
    more = more < UINT32_MAX ? more : UINT32_MAX;
    void *grown = wanted <= more ? realloc(*memory, (size_t)more * each_bytes) : NULL;
    if (!grown)
        return false;
    *memory = grown;
    *room = (uint32_t)more;
    return true;
}

/* The discs of a node: those of a list, the first num_own of them its own. */
static bool fill(building *b, uint32_t node, const karst_point *list, uint32_t num_own, uint32_t num, const cube *c)
{
    karst_splat_tree *tree = b->tree;
    if (!grow((void **)&tree->discs, &b->room_discs, (uint64_t)tree->num_discs + num, sizeof *tree->discs))
        return no_memory(b->error);
    karst_point *discs = tree->discs + tree->num_discs;
    uint32_t kept = num;
    memcpy(discs, list, num * sizeof *discs);
    if (b->culls && num > num_own) {
        bool *needed = malloc(num * sizeof *needed);
        if (!needed)
            return no_memory(b->error);
        kept = cull(discs, num_own, num, c, needed);
        free(needed);
    }
    tree->nodes[node].first = tree->num_discs;
    tree->nodes[node].num = kept;
    tree->nodes[node].octants |= KARST_SPLAT_FILLED;
    tree->num_discs += kept;
    tree->num_leaves += kept > 0;
    tree->num_copies += kept - num_own;
    tree->num_culled += num - kept;
    return true;
}

/* Room for the children of a node: *first is the first one's number. */
static bool add_children(building *b, uint32_t node, unsigned octants, uint32_t *first)
{
    karst_splat_tree *tree = b->tree;
    uint32_t num = 0;
    for (int o = 0; o < 8; o++)
        num += octants >> o & 1u;
    if (!grow((void **)&tree->nodes, &b->room_nodes, (uint64_t)tree->num_nodes + num, sizeof *tree->nodes))
        return no_memory(b->error);
    memset(tree->nodes + tree->num_nodes, 0, num * sizeof *tree->nodes);
    *first = tree->nodes[node].children = tree->num_nodes;
    tree->nodes[node].octants |= octants;
    tree->num_nodes += num;
    return true;
}

static cube child_of(const cube *c, int octant)
{
    cube child = {.width = c->width / 2};
    for (int a = 0; a < 3; a++)
        child.corner[a] = c->corner[a] + (octant >> a & 1 ? child.width : 0);
    return child;
}

/* A leaf of the finest level, parted while it has too many points of its own. */
static bool part(building *b, uint32_t node, const karst_point *list, uint32_t num_own, uint32_t num, const cube *c,
                 int partings)
{
    if (num_own <= MOST_OWN || partings <= 0 || c->width <= 2)
        return (num_own <= MOST_AT_ONE_PLACE ||
                karst_fail(b->error, KARST_BAD_DATA, "%u points lie at one place: import the points again", num_own)) &&
               fill(b, node, list, num_own, num, c);
    karst_point *part_of = malloc((size_t)num * sizeof *part_of);
    uint32_t first;
    /* A disc touches some of the eight; which, is found twice. */
    unsigned octants = 0;
    for (int o = 0; part_of && o < 8; o++) {
        const cube child = child_of(c, o);
        for (uint32_t i = 0; i < num && !(octants >> o & 1u); i++)
            octants |= touches(&list[i], (double)karst_splat_radius(list[i].radius), &child) ? 1u << o : 0u;
    }
    bool done = part_of ? add_children(b, node, octants, &first) : no_memory(b->error);
    for (int o = 0; done && o < 8; o++) {
        if (!(octants >> o & 1u))
            continue;
        const cube child = child_of(c, o);
        uint32_t count = 0, own = 0;
        for (int copies = 0; copies < 2; copies++)
            for (uint32_t i = 0; i < num; i++) {
                const bool is_own = holds(&list[i], &child);
                const bool is_in =
                    is_own || touches(&list[i], (double)karst_splat_radius(list[i].radius), &child);
                if (is_own == !copies && is_in) {
                    part_of[count++] = list[i];
                    own += is_own;
                }
            }
        done = part(b, first++, part_of, own, count, &child, partings - 1);
    }
    free(part_of);
    return done;
}

static bool fill_leaf(building *b, uint32_t node, const sorted_level *level, uint64_t first, uint64_t num, int partings,
                      const cube *c)
{
    karst_point *list = malloc((size_t)(num + 1) * sizeof *list);
    uint32_t own = 0;
    if (!list)
        return no_memory(b->error);
    for (uint64_t i = 0; i < num; i++) {
        list[i] = level->level->points[level->entries[first + i].index];
        list[i].radius = fminf(list[i].radius, (float)(MOST_CELLS * c->width));
        own += !(level->entries[first + i].key & 1);
    }
    const bool done = part(b, node, list, own, (uint32_t)num, c, partings);
    free(list);
    return done;
}

/* The first of a level's entries from `from` on whose leaf lies in the cube of this prefix, or beyond it. */
static uint64_t find_prefix(const sorted_level *level, uint64_t from, uint64_t end, int depth, uint64_t prefix)
{
    while (from < end) {
        const uint64_t middle = from + (end - from) / 2;
        if (level->entries[middle].key >> (1 + 3 * (level->depth - depth)) < prefix)
            from = middle + 1;
        else
            end = middle;
    }
    return from;
}

/* The entries of each level that lie in a node. */
typedef struct {
    uint64_t first[KARST_SPLAT_MAX_DEPTH + 1], end[KARST_SPLAT_MAX_DEPTH + 1];
} node_entries;

static bool build_node(building *b, uint32_t node, int depth, uint64_t prefix, const cube *c, const node_entries *in)
{
    node_entries *of = calloc(8, sizeof *of);
    unsigned octants = 0;
    bool done = of || no_memory(b->error);
    for (uint32_t l = 0; done && l < b->num_levels; l++) {
        const sorted_level *level = &b->levels[l];
        if (level->depth == depth)
            done = fill_leaf(b, node, level, in->first[l], in->end[l] - in->first[l],
                             l == 0 ? KARST_SPLAT_MAX_DEPTH - depth : 0, c);
        uint64_t at = in->first[l];
        for (uint64_t o = 0; level->depth > depth && o < 8; o++) {
            of[o].first[l] = at;
            of[o].end[l] = at = find_prefix(level, at, in->end[l], depth + 1, (prefix << 3 | o) + 1);
            octants |= of[o].end[l] > of[o].first[l] ? 1u << o : 0u;
        }
    }
    uint32_t first = 0;
    done = done && (!octants || add_children(b, node, octants, &first));
    for (int o = 0; done && o < 8; o++)
        if (octants >> o & 1u) {
            const cube child = child_of(c, o);
            done = build_node(b, first++, depth + 1, prefix << 3 | (uint64_t)o, &child, &of[o]);
        }
    free(of);
    return done;
}

/* ---- the tree ---- */

/* The root holds all discs; its half width is a power of two. */
static int root_of(const karst_splat_level *levels, uint32_t num_levels)
{
    double most = 4;
    int log2 = 2;
    for (uint32_t l = 0; l < num_levels; l++)
        for (uint32_t i = 0; i < levels[l].num; i++) {
            const karst_point *p = &levels[l].points[i];
            double reach[3];
            reach_of(p, (double)karst_splat_radius(p->radius), reach);
            for (int a = 0; a < 3; a++)
                most = fmax(most, fabs((double)p->at[a]) + reach[a]);
        }
    while (ldexp(1, log2) < most && log2 < 28)
        log2++;
    return log2;
}

static int depth_of(double spacing, int root_log2)
{
    const int depth = root_log2 + 1 - ((int)ceil(log2(fmax(spacing, 1))) + SPACINGS_LOG2);
    return depth < 0 ? 0 : depth > MOST_KEYED_DEPTH ? MOST_KEYED_DEPTH : depth;
}

/* Spreads and sorts the levels, the coarsest first, as long as they fit. */
static bool take_levels(building *b, const karst_splat_level *levels, uint32_t num_levels, uint64_t max_bytes)
{
    karst_splat_tree *tree = b->tree;
    sorted_level *kept = calloc(num_levels + 1, sizeof *kept);
    uint32_t num = 0;
    bool done = kept || no_memory(b->error);
    for (uint32_t l = num_levels; done && l-- > 0;) {
        int depth = depth_of(levels[l].spacing, tree->root_log2);
        if (num && kept[num - 1].depth >= depth && kept[num - 1].depth < MOST_KEYED_DEPTH)
            depth = kept[num - 1].depth + 1;
        if (num && kept[num - 1].depth >= depth) { /* the finer one says all */
            free(kept[--num].entries);
            kept[num] = (sorted_level){.num = 0};
        }
        const uint64_t each_bytes = sizeof(entry) + 2 * sizeof(karst_point), room = max_bytes / each_bytes;
        const uint64_t most = room < UINT32_MAX / 4 ? room : UINT32_MAX / 4;
        const uint64_t count = spread_level(&levels[l], tree->root_log2, depth, most, NULL);
        if (count > most) {
            tree->num_left_out = l + 1;
            break;
        }
        max_bytes -= count * each_bytes;
        kept[num] = (sorted_level){&levels[l], malloc((size_t)(count + 1) * sizeof(entry)), count, depth};
        if (!kept[num].entries) {
            done = no_memory(b->error);
            break;
        }
        spread_level(&levels[l], tree->root_log2, depth, most, kept[num].entries);
        qsort(kept[num].entries, (size_t)count, sizeof(entry), compare_entries);
        num++;
    }
    for (uint32_t i = 0; i < num; i++)
        b->levels[num - 1 - i] = kept[i];
    b->num_levels = num;
    free(kept);
    return done && (num || karst_fail(b->error, KARST_USAGE,
                                      "a model's discs take too much memory: show it as \"surface\""));
}

bool karst_splat_tree_build(const karst_splat_level *levels, uint32_t num_levels, bool culls, uint64_t max_bytes,
                            karst_splat_tree *tree, karst_error *error)
{
    building *b = calloc(1, sizeof *b);
    *tree = (karst_splat_tree){.root_log2 = root_of(levels, num_levels)};
    if (!b)
        return no_memory(error);
    *b = (building){.tree = tree, .culls = culls, .error = error};
    bool done = take_levels(b, levels, num_levels, max_bytes);
    node_entries all = {{0}, {0}};
    cube root = {.width = ldexp(1, tree->root_log2 + 1)};
    for (int a = 0; a < 3; a++)
        root.corner[a] = -root.width / 2;
    for (uint32_t l = 0; l < b->num_levels; l++) {
        all.end[l] = b->levels[l].num;
        for (int depth = b->levels[l].depth; depth <= (l == 0 ? KARST_SPLAT_MAX_DEPTH : b->levels[l].depth); depth++)
            tree->spacings[depth] = (float)b->levels[l].level->spacing; /* parted leaves are as fine */
    }
    done = done && (grow((void **)&tree->nodes, &b->room_nodes, 1, sizeof *tree->nodes) || no_memory(error));
    if (done) {
        tree->nodes[0] = (karst_splat_node){0};
        tree->num_nodes = 1;
        done = build_node(b, 0, 0, 0, &root, &all);
    }
    for (uint32_t l = 0; l < b->num_levels; l++)
        free(b->levels[l].entries);
    free(b);
    if (!done)
        karst_splat_tree_finish(tree);
    return done;
}

void karst_splat_tree_finish(karst_splat_tree *tree)
{
    free(tree->nodes);
    free(tree->discs);
    *tree = (karst_splat_tree){.nodes = NULL};
}
