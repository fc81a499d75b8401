#include "producers/language/front/types.h"

#include <string.h>

#define SCALAR(s, n)                                                                     \
    {                                                                                    \
        .shape = KARST_SHAPE_SCALAR, .scalar = s, .size = 1, .num_scalars = 1, .name = n \
    }
#define VECTOR(s, k, n)                                                                                               \
    {                                                                                                                 \
        .shape = KARST_SHAPE_VECTOR, .scalar = s, .size = k, .num_scalars = k, .element = &vectors[s][0], .count = k, \
        .name = n                                                                                                     \
    }
#define VECTORS(s, n, v)                                                            \
    {                                                                               \
        SCALAR(s, n), VECTOR(s, 2, v "2"), VECTOR(s, 3, v "3"), VECTOR(s, 4, v "4") \
    }
#define MATRIX(k, n)                                                                                  \
    {                                                                                                 \
        .shape = KARST_SHAPE_MATRIX, .scalar = KARST_TYPE_FLOAT, .size = k, .num_scalars = (k) * (k), \
        .element = &vectors[KARST_TYPE_FLOAT][(k)-1], .count = k, .name = n                           \
    }

const karst_type karst_type_void = {.shape = KARST_SHAPE_VOID, .name = "void"};

static const karst_type vectors[4][4] = {
    [KARST_TYPE_FLOAT] = VECTORS(KARST_TYPE_FLOAT, "float", "vec"),
    [KARST_TYPE_INT] = VECTORS(KARST_TYPE_INT, "int", "ivec"),
    [KARST_TYPE_UINT] = VECTORS(KARST_TYPE_UINT, "uint", "uvec"),
    [KARST_TYPE_BOOL] = VECTORS(KARST_TYPE_BOOL, "bool", "bvec"),
};
static const karst_type matrices[3] = {MATRIX(2, "mat2"), MATRIX(3, "mat3"), MATRIX(4, "mat4")};

static const struct {
    const char *name;
    uint8_t scalar, size;
} aliases[] = {
    {"float2", KARST_TYPE_FLOAT, 2}, {"float3", KARST_TYPE_FLOAT, 3}, {"float4", KARST_TYPE_FLOAT, 4},
    {"int2", KARST_TYPE_INT, 2},     {"int3", KARST_TYPE_INT, 3},     {"int4", KARST_TYPE_INT, 4},
    {"uint2", KARST_TYPE_UINT, 2},   {"uint3", KARST_TYPE_UINT, 3},   {"uint4", KARST_TYPE_UINT, 4},
    {"double", KARST_TYPE_FLOAT, 1}, {"half", KARST_TYPE_FLOAT, 1},
};

const karst_type *karst_type_vector(karst_scalar_type scalar, unsigned size) { return &vectors[scalar][size - 1]; }
const karst_type *karst_type_matrix(unsigned size) { return &matrices[size - 2]; }

const karst_type *karst_type_named(const char *name)
{
    if (!strcmp(name, "void"))
        return &karst_type_void;
    for (int s = 0; s < 4; s++)
        for (int k = 0; k < 4; k++)
            if (!strcmp(name, vectors[s][k].name))
                return &vectors[s][k];
    for (int k = 0; k < 3; k++) {
        size_t n = strlen(matrices[k].name);
        if (!strncmp(name, matrices[k].name, n) &&
            (!name[n] || (name[n] == 'x' && name[n + 1] == name[n - 1] && !name[n + 2])))
            return &matrices[k]; /* mat3 and mat3x3 */
        if (!strncmp(name, "float", 5) && name[5] == '2' + k && name[6] == 'x' && name[7] == '2' + k && !name[8])
            return &matrices[k]; /* HLSL's float3x3: its rows are columns here, and mul() knows that */
    }
    for (size_t i = 0; i < sizeof aliases / sizeof *aliases; i++)
        if (!strcmp(name, aliases[i].name))
            return karst_type_vector(aliases[i].scalar, aliases[i].size);
    return NULL;
}

const char *karst_type_article(const karst_type *type) { return strchr("aeioAEIO", type->name[0]) ? "an " : "a "; }

const karst_type *karst_type_array(karst_array_types *made, const karst_type *element, uint32_t count)
{
    for (size_t i = 0; i < made->count; i++)
        if (made->items[i]->element == element && made->items[i]->count == count)
            return made->items[i];
    size_t length = strlen(element->name) + 16;
    char *name = karst_arena_alloc(made->arena, length);
    memcpy(name, element->name, length - 16);
    char digits[12];
    size_t n = 0;
    for (uint32_t rest = count; rest || !n; rest /= 10)
        digits[n++] = (char)('0' + rest % 10);
    char *end = name + length - 16;
    *end++ = '[';
    while (n)
        *end++ = digits[--n];
    *end = ']';
    karst_type *type = karst_arena_alloc(made->arena, sizeof *type);
    *type = (karst_type){.shape = KARST_SHAPE_ARRAY,
                         .num_scalars = element->num_scalars * count,
                         .element = element,
                         .count = count,
                         .name = name};
    made->items =
        karst_arena_grow(made->arena, made->items, made->count, &made->capacity, made->count + 1, sizeof *made->items);
    made->items[made->count++] = type;
    return type;
}

int karst_type_conversion(const karst_type *from, const karst_type *to)
{
    if (from == to)
        return 0;
    bool widens = karst_type_is_plain(from) && karst_type_is_plain(to) && from->size == to->size &&
                  to->scalar == KARST_TYPE_FLOAT && (from->scalar == KARST_TYPE_INT || from->scalar == KARST_TYPE_UINT);
    return widens ? 1 : -1;
}
