/* The expression graph: what a world is.
 *
 * Scalar, typed, hash-consed: a node is an operation on earlier nodes, and no two nodes are equal. The constructors
 * canonicalise (canonical.c): they fold what is uniform, sort the operands of + and *, and turn what people write for
 * min, max, abs and length into those. After them nobody reassociates, contracts or folds: every back end executes this
 * graph, node by node, in order of index.
 *
 * Two stages, one data structure:
 *   1. lower.c builds it from text; positions are the leaves KARST_OP_POSITION, in metres.
 *   2. kinds.c rewrites it into what is executed ("resolved"): what is affine in the position becomes a KARST_OP_AFFINE
 * leaf (exact fixed point), affine plus a float offset a KARST_OP_SHIFTED, sin and cos of those SIN_TURNS and
 * COS_TURNS, and every node gets its kind. A resolved graph holds no POSITION. A back end asks the *op of an argument*
 * what it is given: noise, floor, fract, mod, sin_turns of an AFFINE or SHIFTED argument work on its exact lattice
 * coordinate, everything else takes its float.
 */
#ifndef KARST_LANGUAGE_GRAPH_H
#define KARST_LANGUAGE_GRAPH_H

#include "producers/language/base/arena.h"
#include "producers/language/base/number.h"
#include "producers/language/graph/op_table.h"

#define KARST_FOOTPRINT_BIAS 64

/* Index of a node; KARST_NO_EXPR where there is none. Arguments have smaller indices than their users. */
typedef uint32_t karst_expr;
#define KARST_NO_EXPR 0u

typedef enum { KARST_TYPE_FLOAT, KARST_TYPE_INT, KARST_TYPE_UINT, KARST_TYPE_BOOL } karst_scalar_type;

/* What a node depends on. Hoisting goes by the axes; a node with neither axes nor normal is uniform. */
#define KARST_DEPENDS_X 1u
#define KARST_DEPENDS_Y 2u
#define KARST_DEPENDS_Z 4u
#define KARST_DEPENDS_NORMAL 8u
#define KARST_DEPENDS_PARAMETER 16u /* of its own accord no obstacle to being uniform */
#define KARST_DEPENDS_PLACE (KARST_DEPENDS_X | KARST_DEPENDS_Y | KARST_DEPENDS_Z | KARST_DEPENDS_NORMAL)

/* How a node is computed (LANGUAGE section 2). Set by kinds.c. */
typedef enum {
    KARST_KIND_UNIFORM, /* on the host, in double, rounded once per use */
    KARST_KIND_AFFINE,  /* exact fixed point; its float has a relative error of 2^-22 however far */
    KARST_KIND_SHIFTED, /* affine plus float offset */
    KARST_KIND_STEPS,   /* piecewise constant, float or int: the device's float in every oracle */
    KARST_KIND_FLOAT,
    KARST_KIND_WIDE /* a pair of floats */
} karst_kind;

typedef struct {
    uint8_t op;        /* karst_op */
    uint8_t type;      /* karst_scalar_type of the value */
    uint8_t depends;   /* KARST_DEPENDS_* */
    uint8_t kind;      /* karst_kind, after kinds.c */
    uint32_t extra;    /* index of a constant, parameter, axis, affine or noise */
    karst_expr arg[4]; /* KARST_NO_EXPR beyond the last */
    uint32_t where;    /* byte of the expanded source that first made it; for messages only, no part of its identity */
} karst_expr_node;

/* The noise family: one op with attributes. */
typedef enum {
    KARST_NOISE_GRADIENT, /* about [-1, 1], mean 0 */
    KARST_NOISE_VALUE,
    KARST_NOISE_SIMPLEX,
    KARST_NOISE_WORLEY_F1,
    KARST_NOISE_WORLEY_F2, /* distance to the nearest, second nearest point */
    KARST_NUM_NOISE_BASES,
    /* samples of a file: one octave, of shape SUM, of the first two arguments (image_shared.h) */
    KARST_NOISE_IMAGE = KARST_NUM_NOISE_BASES + 1
} karst_noise_base;
typedef enum {
    KARST_NOISE_SUM,       /* sum of amplitude_i * n_i: noise, fbm */
    KARST_NOISE_RIDGED,    /* of 1 - 2 |n_i| */
    KARST_NOISE_BILLOW,    /* of 2 |n_i| - 1 */
    KARST_NOISE_TURBULENCE /* of |n_i| */
} karst_noise_shape;
/* Octave i: frequency lacunarity^i, amplitude gain^i (the first is 1), seed: world seed + seed_offset + i golden
 * constants. */
typedef struct {
    uint8_t base, shape;
    uint8_t derivative;   /* 0: the value; 1, 2, 3: its derivative along the first, second, third argument */
    uint16_t num_octaves; /* 1 to 512 */
    uint32_t seed_offset;
    karst_expr gain, lacunarity; /* uniform floats */
    const struct karst_samples_image *image; /* of KARST_NOISE_IMAGE; outlives the graph */
    /* Of an image: NULL, or the texture that colours have in its place (soften.h); of that one, which is such an image
     * itself, and of its NOISE the third argument says where it counts: its value is not asked for where that is 0. */
    const struct karst_samples_image *texture;
    uint8_t channel; /* of it */
} karst_noise;

/* offset + sum of coefficient[i] * p[i], metres; each a uniform float node (KARST_NO_EXPR: 0). */
typedef struct {
    karst_expr coefficient[3], offset;
} karst_affine;

typedef struct karst_graph {
    karst_arena *arena;
    karst_expr_node *nodes; /* nodes[0] is KARST_OP_NONE */
    uint32_t num_nodes, max_nodes;
    karst_number *constants;
    uint32_t num_constants;
    karst_noise *noises;
    uint32_t num_noises;
    karst_affine *affines;
    uint32_t num_affines;
    uint32_t where;                           /* goes into the nodes made next */
    void (*full)(void *user, uint32_t where); /* called at max_nodes; must not return */
    void *user;
    /* private to graph.c */
    uint32_t *table, table_size, *constant_table, constant_table_size, *affine_table, affine_table_size;
    size_t node_room, constant_room, noise_room, affine_room;
} karst_graph;

/* An empty graph. Everything it holds lives in `arena`. */
void karst_graph_init(karst_graph *graph, karst_arena *arena, uint32_t max_nodes,
                      void (*full)(void *user, uint32_t where), void *user);

/* ---- raw construction (graph.c): hash-consing and nothing else ---- */
karst_expr karst_graph_raw(karst_graph *graph, karst_op op, karst_scalar_type type, uint32_t extra, karst_expr a,
                           karst_expr b, karst_expr c, karst_expr d);
karst_expr karst_graph_number(karst_graph *graph, karst_scalar_type type, karst_number number);
karst_expr karst_graph_float(karst_graph *graph, double value);
karst_expr karst_graph_int(karst_graph *graph, int32_t value);
karst_expr karst_graph_bool(karst_graph *graph, bool value);
karst_expr karst_graph_leaf(karst_graph *graph, karst_op op, uint32_t extra); /* PARAMETER, POSITION, NORMAL; float */
karst_expr karst_graph_affine(karst_graph *graph, karst_affine affine);
karst_expr karst_graph_footprint(karst_graph *graph, int voxel_log2_m);
/* How many axes the image of a NOISE has, 2 or of a field 3; 0: none, or another op. */
uint32_t karst_graph_image_axes(const karst_graph *graph, karst_expr e);
/* Whether it is a NOISE of a texture. */
bool karst_graph_is_texture(const karst_graph *graph, karst_expr e);
karst_expr karst_graph_noise(karst_graph *graph, karst_noise noise, karst_expr a, karst_expr b, karst_expr c);

/* ---- canonical construction (canonical.c): what everybody else calls ---- */
karst_expr karst_expr_1(karst_graph *graph, karst_op op, karst_expr a);
karst_expr karst_expr_2(karst_graph *graph, karst_op op, karst_expr a, karst_expr b);
karst_expr karst_expr_3(karst_graph *graph, karst_op op, karst_expr a, karst_expr b, karst_expr c);
karst_expr karst_expr_length(karst_graph *graph, const karst_expr *v, int n);
karst_expr karst_expr_convert(karst_graph *graph, karst_scalar_type type, karst_expr a);
karst_expr karst_expr_bits(karst_graph *graph, karst_scalar_type type, karst_expr a);

/* ---- reading ---- */
static inline const karst_expr_node *karst_node_of(const karst_graph *graph, karst_expr e) { return &graph->nodes[e]; }
/* NULL if it is not a constant. */
const karst_number *karst_graph_constant(const karst_graph *graph, karst_expr e);
static inline bool karst_graph_is_uniform(const karst_graph *graph, karst_expr e)
{
    return !(graph->nodes[e].depends & KARST_DEPENDS_PLACE);
}
const char *karst_op_name(karst_op op); /* "add" */

/* Copies what `roots` reach into an empty graph, in the same order, and updates the roots. */
void karst_graph_extract(const karst_graph *graph, karst_graph *live, karst_expr *roots, size_t num_roots);
/* Whether a graph is well formed: arguments before users, types and argument counts as the ops say. Else *fault says
 * what is not. Thread-safe. */
bool karst_graph_check(const karst_graph *graph, const char **fault);

#endif
