#include "producers/language/graph/graph.h"

#include <string.h>

#include "producers/language/image/image.h"

static uint32_t mix(uint32_t h, uint32_t v)
{
    h = (h ^ v) * 0x9e3779b1u;
    return h ^ h >> 15;
}

static uint32_t hash_node(const karst_expr_node *n)
{
    uint32_t h = mix(n->op | (uint32_t)n->type << 8, n->extra);
    for (int i = 0; i < 4; i++)
        h = mix(h, n->arg[i]);
    return h;
}

static bool same_node(const karst_expr_node *a, const karst_expr_node *b)
{
    return a->op == b->op && a->type == b->type && a->extra == b->extra && !memcmp(a->arg, b->arg, sizeof a->arg);
}

void karst_graph_init(karst_graph *graph, karst_arena *arena, uint32_t max_nodes,
                      void (*full)(void *user, uint32_t where), void *user)
{
    *graph = (karst_graph){.arena = arena, .max_nodes = max_nodes, .full = full, .user = user, .table_size = 1024};
    graph->table = karst_arena_alloc(arena, graph->table_size * sizeof *graph->table);
    graph->nodes = karst_arena_grow(arena, NULL, 0, &graph->node_room, 1024, sizeof *graph->nodes);
    graph->num_nodes = 1;
}

static void grow_table(karst_graph *graph)
{
    graph->table_size *= 2;
    graph->table = karst_arena_alloc(graph->arena, graph->table_size * sizeof *graph->table);
    for (uint32_t i = 1; i < graph->num_nodes; i++) {
        uint32_t at = hash_node(&graph->nodes[i]) & (graph->table_size - 1);
        while (graph->table[at])
            at = (at + 1) & (graph->table_size - 1);
        graph->table[at] = i;
    }
}

/* What a node depends on of itself, without its arguments. */
static uint8_t own_dependence(const karst_graph *graph, karst_op op, uint32_t extra)
{
    switch (op) {
    case KARST_OP_PARAMETER:
        return KARST_DEPENDS_PARAMETER;
    case KARST_OP_POSITION:
        return (uint8_t)(KARST_DEPENDS_X << extra);
    case KARST_OP_NORMAL:
    case KARST_OP_FOOTPRINT:
        return KARST_DEPENDS_NORMAL;
    case KARST_OP_AFFINE: {
        uint8_t depends = graph->nodes[graph->affines[extra].offset].depends;
        for (int i = 0; i < 3; i++)
            if (graph->affines[extra].coefficient[i])
                depends |=
                    (uint8_t)((KARST_DEPENDS_X << i) | graph->nodes[graph->affines[extra].coefficient[i]].depends);
        return depends;
    }
    case KARST_OP_NOISE:
        return (graph->nodes[graph->noises[extra].gain].depends |
                graph->nodes[graph->noises[extra].lacunarity].depends);
    default:
        return 0;
    }
}

karst_expr karst_graph_raw(karst_graph *graph, karst_op op, karst_scalar_type type, uint32_t extra, karst_expr a,
                           karst_expr b, karst_expr c, karst_expr d)
{
    karst_expr_node node = {
        .op = (uint8_t)op, .type = (uint8_t)type, .extra = extra, .arg = {a, b, c, d}, .where = graph->where};
    uint32_t at = hash_node(&node) & (graph->table_size - 1);
    for (; graph->table[at]; at = (at + 1) & (graph->table_size - 1))
        if (same_node(&graph->nodes[graph->table[at]], &node))
            return graph->table[at];
    if (graph->num_nodes >= graph->max_nodes)
        graph->full(graph->user, graph->where);
    node.depends = own_dependence(graph, op, extra);
    for (int i = 0; i < 4; i++)
        node.depends |= graph->nodes[node.arg[i]].depends;
    graph->nodes = karst_arena_grow(graph->arena, graph->nodes, graph->num_nodes, &graph->node_room,
                                    graph->num_nodes + 1u, sizeof node);
    graph->nodes[graph->num_nodes] = node;
    graph->table[at] = graph->num_nodes++;
    if (graph->num_nodes * 2 > graph->table_size)
        grow_table(graph);
    return graph->num_nodes - 1;
}

static uint32_t hash_number(karst_number number)
{
    uint64_t bits;
    memcpy(&bits, &number.value, 8);
    return mix(mix(0x517cc1b7u, (uint32_t)bits), (uint32_t)(bits >> 32));
}

/* Each number is stored once. */
static uint32_t constant_index(karst_graph *graph, karst_number number)
{
    if ((graph->num_constants + 1) * 2 > graph->constant_table_size) {
        graph->constant_table_size = graph->constant_table_size ? graph->constant_table_size * 2 : 256;
        graph->constant_table =
            karst_arena_alloc(graph->arena, graph->constant_table_size * sizeof *graph->constant_table);
        for (uint32_t i = 0; i < graph->num_constants; i++) {
            uint32_t at = hash_number(graph->constants[i]) & (graph->constant_table_size - 1);
            while (graph->constant_table[at])
                at = (at + 1) & (graph->constant_table_size - 1);
            graph->constant_table[at] = i + 1;
        }
    }
    uint32_t at = hash_number(number) & (graph->constant_table_size - 1);
    for (; graph->constant_table[at]; at = (at + 1) & (graph->constant_table_size - 1))
        if (karst_number_same(graph->constants[graph->constant_table[at] - 1], number))
            return graph->constant_table[at] - 1;
    graph->constants = karst_arena_grow(graph->arena, graph->constants, graph->num_constants, &graph->constant_room,
                                        graph->num_constants + 1u, sizeof number);
    graph->constants[graph->num_constants] = number;
    graph->constant_table[at] = ++graph->num_constants;
    return graph->num_constants - 1;
}

karst_expr karst_graph_number(karst_graph *graph, karst_scalar_type type, karst_number number)
{
    return karst_graph_raw(graph, KARST_OP_CONSTANT, type, constant_index(graph, number), 0, 0, 0, 0);
}

karst_expr karst_graph_float(karst_graph *graph, double value)
{
    return karst_graph_number(graph, KARST_TYPE_FLOAT, karst_number_double(value));
}
karst_expr karst_graph_int(karst_graph *graph, int32_t value)
{
    return karst_graph_number(graph, KARST_TYPE_INT, karst_number_int(value));
}
karst_expr karst_graph_bool(karst_graph *graph, bool value)
{
    return karst_graph_number(graph, KARST_TYPE_BOOL, karst_number_int(value));
}

karst_expr karst_graph_leaf(karst_graph *graph, karst_op op, uint32_t extra)
{
    return karst_graph_raw(graph, op, KARST_TYPE_FLOAT, extra, 0, 0, 0, 0);
}

static uint32_t hash_affine(const karst_affine *a)
{
    return mix(mix(mix(mix(0x2545f491u, a->coefficient[0]), a->coefficient[1]), a->coefficient[2]), a->offset);
}

static void grow_affine_table(karst_graph *graph)
{
    graph->affine_table_size = graph->affine_table_size ? graph->affine_table_size * 2 : 64;
    graph->affine_table = karst_arena_alloc(graph->arena, graph->affine_table_size * sizeof *graph->affine_table);
    for (uint32_t i = 0; i < graph->num_affines; i++) {
        uint32_t at = hash_affine(&graph->affines[i]) & (graph->affine_table_size - 1);
        while (graph->affine_table[at])
            at = (at + 1) & (graph->affine_table_size - 1);
        graph->affine_table[at] = i + 1;
    }
}

karst_expr karst_graph_affine(karst_graph *graph, karst_affine affine)
{
    if ((graph->num_affines + 1) * 2 > graph->affine_table_size)
        grow_affine_table(graph);
    uint32_t at = hash_affine(&affine) & (graph->affine_table_size - 1), i;
    for (; (i = graph->affine_table[at]); at = (at + 1) & (graph->affine_table_size - 1))
        if (!memcmp(&graph->affines[i - 1], &affine, sizeof affine))
            return karst_graph_raw(graph, KARST_OP_AFFINE, KARST_TYPE_FLOAT, i - 1, 0, 0, 0, 0);
    i = graph->num_affines++;
    graph->affines = karst_arena_grow(graph->arena, graph->affines, i, &graph->affine_room, i + 1u, sizeof affine);
    graph->affines[i] = affine;
    graph->affine_table[at] = i + 1;
    return karst_graph_raw(graph, KARST_OP_AFFINE, KARST_TYPE_FLOAT, i, 0, 0, 0, 0);
}

uint32_t karst_graph_image_axes(const karst_graph *graph, karst_expr e)
{
    const karst_expr_node *n = &graph->nodes[e];
    const karst_samples_image *image = n->op == KARST_OP_NOISE ? graph->noises[n->extra].image : NULL;
    return image ? image->num_axes : 0;
}

bool karst_graph_is_texture(const karst_graph *graph, karst_expr e)
{
    const karst_expr_node *n = &graph->nodes[e];
    const karst_samples_image *image = n->op == KARST_OP_NOISE ? graph->noises[n->extra].image : NULL;
    return image && ((const karst_image_header *)image->words)->num_packed > 0;
}

karst_expr karst_graph_noise(karst_graph *graph, karst_noise noise, karst_expr a, karst_expr b, karst_expr c)
{
    uint32_t i = 0;
    for (; i < graph->num_noises; i++) {
        const karst_noise *n = &graph->noises[i];
        if (n->base == noise.base && n->shape == noise.shape && n->derivative == noise.derivative &&
            n->num_octaves == noise.num_octaves && n->seed_offset == noise.seed_offset && n->gain == noise.gain &&
            n->lacunarity == noise.lacunarity && n->image == noise.image && n->texture == noise.texture &&
            n->channel == noise.channel)
            break;
    }
    if (i == graph->num_noises) {
        graph->noises = karst_arena_grow(graph->arena, graph->noises, i, &graph->noise_room, i + 1u, sizeof noise);
        graph->noises[graph->num_noises++] = noise;
    }
    return karst_graph_raw(graph, KARST_OP_NOISE, KARST_TYPE_FLOAT, i, a, b, c, 0);
}

karst_expr karst_graph_footprint(karst_graph *graph, int voxel_log2_m)
{
    return karst_graph_raw(graph, KARST_OP_FOOTPRINT, KARST_TYPE_FLOAT, (uint32_t)(voxel_log2_m + KARST_FOOTPRINT_BIAS),
                           0, 0, 0, 0);
}

const karst_number *karst_graph_constant(const karst_graph *graph, karst_expr e)
{
    return graph->nodes[e].op == KARST_OP_CONSTANT ? &graph->constants[graph->nodes[e].extra] : NULL;
}

#define OP_INFO(id, name, least, most, class, tape) {name, least, most, KARST_OP_CLASS_##class},
static const struct {
    const char *name;
    uint8_t least, most, class;
} ops[KARST_NUM_OPS] = {KARST_OPS(OP_INFO)};

const char *karst_op_name(karst_op op) { return op < KARST_NUM_OPS ? ops[op].name : "?"; }

/* ---- extraction ---- */

static karst_number constant_of(const karst_graph *graph, const karst_expr_node *n)
{
    return graph->constants[n->extra];
}

void karst_graph_extract(const karst_graph *graph, karst_graph *live, karst_expr *roots, size_t num_roots)
{
    uint32_t *map =
        karst_arena_alloc(live->arena, graph->num_nodes * sizeof *map); /* first 1: reached; then the new index */
    for (size_t i = 0; i < num_roots; i++)
        map[roots[i]] = 1;
    for (uint32_t i = graph->num_nodes - 1; i > 0; i--) {
        const karst_expr_node *n = &graph->nodes[i];
        if (!map[i])
            continue;
        for (int k = 0; k < 4; k++)
            map[n->arg[k]] = 1;
        if (n->op == KARST_OP_NOISE)
            map[graph->noises[n->extra].gain] = map[graph->noises[n->extra].lacunarity] = 1;
        if (n->op == KARST_OP_AFFINE) {
            const karst_affine *a = &graph->affines[n->extra];
            map[a->coefficient[0]] = map[a->coefficient[1]] = map[a->coefficient[2]] = map[a->offset] = 1;
        }
    }
    map[0] = 0;
    for (uint32_t i = 1; i < graph->num_nodes; i++) {
        const karst_expr_node *n = &graph->nodes[i];
        if (!map[i])
            continue;
        live->where = n->where;
        if (n->op == KARST_OP_CONSTANT) {
            map[i] = karst_graph_number(live, n->type, constant_of(graph, n));
        } else if (n->op == KARST_OP_AFFINE) {
            karst_affine a = graph->affines[n->extra];
            for (int k = 0; k < 3; k++)
                a.coefficient[k] = map[a.coefficient[k]];
            a.offset = map[a.offset];
            map[i] = karst_graph_affine(live, a);
        } else if (n->op == KARST_OP_NOISE) {
            karst_noise noise = graph->noises[n->extra];
            noise.gain = map[noise.gain];
            noise.lacunarity = map[noise.lacunarity];
            map[i] = karst_graph_noise(live, noise, map[n->arg[0]], map[n->arg[1]], map[n->arg[2]]);
        } else {
            map[i] = karst_graph_raw(live, n->op, n->type, n->extra, map[n->arg[0]], map[n->arg[1]], map[n->arg[2]],
                                     map[n->arg[3]]);
        }
        live->nodes[map[i]].kind = n->kind;
    }
    for (size_t i = 0; i < num_roots; i++)
        roots[i] = map[roots[i]];
}

/* ---- checking ---- */

static const char *fault_of(const karst_graph *graph, uint32_t i)
{
    const karst_expr_node *n = &graph->nodes[i];
    if (n->op == KARST_OP_NONE || n->op >= KARST_NUM_OPS || n->type > KARST_TYPE_BOOL)
        return "an unknown op or type";
    int count = 0;
    for (int k = 0; k < 4; k++) {
        if (n->arg[k] >= i)
            return "an argument behind its user";
        if (n->arg[k] && k != count)
            return "a gap in the arguments";
        count += n->arg[k] != 0;
    }
    if (count < ops[n->op].least || count > ops[n->op].most)
        return "a wrong number of arguments";
    const karst_expr_node *a = &graph->nodes[n->arg[0]], *b = &graph->nodes[n->arg[1]], *c = &graph->nodes[n->arg[2]];
    if (n->op == KARST_OP_SELECT)
        return a->type != KARST_TYPE_BOOL || b->type != n->type || c->type != n->type ? "a select of wrong types"
                                                                                      : NULL;
    if (ops[n->op].class == KARST_OP_CLASS_COMPARISON)
        return a->type != b->type || n->type != KARST_TYPE_BOOL ? "a comparison of wrong types" : NULL;
    if (ops[n->op].class == KARST_OP_CLASS_BOOL)
        return n->type != KARST_TYPE_BOOL || a->type != KARST_TYPE_BOOL || (count > 1 && b->type != KARST_TYPE_BOOL)
                   ? "a bool op of wrong types"
                   : NULL;
    if (ops[n->op].class == KARST_OP_CLASS_INT)
        return (n->type != KARST_TYPE_INT && n->type != KARST_TYPE_UINT) || a->type != n->type ||
                       (count > 1 && b->type != n->type)
                   ? "an int op of wrong types"
                   : NULL;
    if (n->op == KARST_OP_CONVERT || n->op == KARST_OP_BITS)
        return a->type == n->type ? "a conversion to its own type" : NULL;
    if (n->op == KARST_OP_CELL)
        return n->type != KARST_TYPE_INT || (a->op != KARST_OP_AFFINE && a->op != KARST_OP_SHIFTED) ||
                       (count > 1 && (b->op != KARST_OP_CONSTANT || b->type != KARST_TYPE_INT))
                   ? "a cell of no place, or by no number"
                   : NULL;
    if (n->op == KARST_OP_CONSTANT)
        return n->extra >= graph->num_constants ? "a constant that is not there" : NULL;
    if (n->type != KARST_TYPE_FLOAT)
        return "a float op of another type";
    for (int k = 0; k < count; k++)
        if (graph->nodes[n->arg[k]].type != KARST_TYPE_FLOAT)
            return "a float op of other arguments";
    if (n->op == KARST_OP_NOISE && n->extra >= graph->num_noises)
        return "a noise that is not there";
    if (n->op == KARST_OP_AFFINE && n->extra >= graph->num_affines)
        return "an affine form that is not there";
    return NULL;
}

bool karst_graph_check(const karst_graph *graph, const char **fault)
{
    for (uint32_t i = 1; i < graph->num_nodes; i++)
        if ((*fault = fault_of(graph, i)))
            return false;
    return true;
}
