/* Types of the language. Two equal types are one object: compare pointers. */
#ifndef KARST_LANGUAGE_TYPES_H
#define KARST_LANGUAGE_TYPES_H

#include "producers/language/graph/graph.h"

#define KARST_MAX_ARRAY 1024u

typedef enum {
    KARST_SHAPE_VOID,
    KARST_SHAPE_SCALAR,
    KARST_SHAPE_VECTOR,
    KARST_SHAPE_MATRIX,
    KARST_SHAPE_ARRAY,
    KARST_SHAPE_STRUCT
} karst_shape;

typedef struct karst_type karst_type;
typedef struct {
    uint32_t name; /* in karst_names */
    const karst_type *type;
    uint32_t offset; /* of its first scalar */
} karst_field;

struct karst_type {
    karst_shape shape;
    karst_scalar_type scalar;  /* of scalars, vectors and matrices */
    uint8_t size;              /* vectors: 2 to 4 components; matrices: rows; `count`: columns (column major) */
    uint32_t num_scalars;      /* that a value is made of */
    const karst_type *element; /* of arrays, matrices (a column) and vectors */
    uint32_t count;            /* of elements */
    karst_field *fields;       /* of structs */
    uint32_t num_fields;
    const double *usual; /* of structs of floats: what each is at first; NULL: 0 */
    const char *name;    /* as in messages: "vec3", "float[4]" */
};

extern const karst_type karst_type_void;
/* size 1: the scalar itself; 2 to 4: a vector. */
const karst_type *karst_type_vector(karst_scalar_type scalar, unsigned size);
const karst_type *karst_type_matrix(unsigned columns, unsigned rows);
/* GLSL's and OpenCL C's names: "vec3", "float3", "ivec2", "uint", "mat4", "mat2x3"; NULL if it is none. */
const karst_type *karst_type_named(const char *name);

/* "a " or "an ", as its name wants. */
const char *karst_type_article(const karst_type *type);

/* Array types made so far. */
typedef struct {
    karst_arena *arena;
    const karst_type **items;
    size_t count, capacity;
} karst_array_types;
const karst_type *karst_type_array(karst_array_types *made, const karst_type *element, uint32_t count);

static inline bool karst_type_is_number(const karst_type *type)
{
    return (type->shape == KARST_SHAPE_SCALAR || type->shape == KARST_SHAPE_VECTOR) && type->scalar != KARST_TYPE_BOOL;
}
static inline bool karst_type_is_plain(const karst_type *type) /* scalar or vector */
{
    return type->shape == KARST_SHAPE_SCALAR || type->shape == KARST_SHAPE_VECTOR;
}

/* What it costs to hand a value of type `from` to a place of type `to`: 0 nothing, 1 int to float (each component),
 * 2 int to uint, -1 impossible. */
int karst_type_conversion(const karst_type *from, const karst_type *to);

#endif
