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
#define MATRIX(columns, rows, n)                                                                                  \
    {                                                                                                             \
        .shape = KARST_SHAPE_MATRIX, .scalar = KARST_TYPE_FLOAT, .size = rows, .num_scalars = (columns) * (rows), \
        .element = &vectors[KARST_TYPE_FLOAT][(rows)-1], .count = columns, .name = n                              \
    }

const karst_type karst_type_void = {.shape = KARST_SHAPE_VOID, .name = "void"};

static const karst_type vectors[4][4] = {
    [KARST_TYPE_FLOAT] = VECTORS(KARST_TYPE_FLOAT, "float", "vec"),
    [KARST_TYPE_INT] = VECTORS(KARST_TYPE_INT, "int", "ivec"),
    [KARST_TYPE_UINT] = VECTORS(KARST_TYPE_UINT, "uint", "uvec"),
    [KARST_TYPE_BOOL] = VECTORS(KARST_TYPE_BOOL, "bool", "bvec"),
};
static const karst_type matrices[3][3] = {
    {MATRIX(2, 2, "mat2"), MATRIX(2, 3, "mat2x3"), MATRIX(2, 4, "mat2x4")},
    {MATRIX(3, 2, "mat3x2"), MATRIX(3, 3, "mat3"), MATRIX(3, 4, "mat3x4")},
    {MATRIX(4, 2, "mat4x2"), MATRIX(4, 3, "mat4x3"), MATRIX(4, 4, "mat4")},
};

static const struct {
    const char *name;
    uint8_t scalar, size;
} aliases[] = {
    {"float2", KARST_TYPE_FLOAT, 2}, {"float3", KARST_TYPE_FLOAT, 3}, {"float4", KARST_TYPE_FLOAT, 4},
    {"int2", KARST_TYPE_INT, 2},     {"int3", KARST_TYPE_INT, 3},     {"int4", KARST_TYPE_INT, 4},
    {"uint2", KARST_TYPE_UINT, 2},   {"uint3", KARST_TYPE_UINT, 3},   {"uint4", KARST_TYPE_UINT, 4},
    {"double", KARST_TYPE_FLOAT, 1}, {"half", KARST_TYPE_FLOAT, 1},  {"half2", KARST_TYPE_FLOAT, 2},
    {"fixed", KARST_TYPE_FLOAT, 1},  {"fixed2", KARST_TYPE_FLOAT, 2}, {"fixed3", KARST_TYPE_FLOAT, 3},
    {"fixed4", KARST_TYPE_FLOAT, 4}, {"min16float", KARST_TYPE_FLOAT, 1}, {"min16float2", KARST_TYPE_FLOAT, 2},
    {"min16float3", KARST_TYPE_FLOAT, 3}, {"min16float4", KARST_TYPE_FLOAT, 4},
    {"unsigned", KARST_TYPE_UINT, 1}, {"uint32_t", KARST_TYPE_UINT, 1},
    {"int32_t", KARST_TYPE_INT, 1},
    {"dword", KARST_TYPE_UINT, 1},   {"half3", KARST_TYPE_FLOAT, 3},  {"half4", KARST_TYPE_FLOAT, 4},
    {"dvec2", KARST_TYPE_FLOAT, 2},
    {"dvec3", KARST_TYPE_FLOAT, 3},  {"dvec4", KARST_TYPE_FLOAT, 4}, {"bool2", KARST_TYPE_BOOL, 2},
    {"bool3", KARST_TYPE_BOOL, 3},   {"bool4", KARST_TYPE_BOOL, 4},
};

const karst_type *karst_type_vector(karst_scalar_type scalar, unsigned size) { return &vectors[scalar][size - 1]; }
const karst_type *karst_type_matrix(unsigned columns, unsigned rows) { return &matrices[columns - 2][rows - 2]; }

/* mat3, mat3x3, mat2x3 (two columns of three), and HLSL's float2x3 (two rows of three): its rows are columns here, and
 * mul() knows that. */
static const karst_type *matrix_named(const char *name)
{
    const bool is_hlsl = !strncmp(name, "float", 5);
    if (!is_hlsl && strncmp(name, "mat", 3) != 0)
        return NULL;
    const char *size = name + (is_hlsl ? 5 : 3);
    const bool is_square = !is_hlsl && *size && !size[1];
    if (size[0] < '2' || size[0] > '4' ||
        (!is_square && (size[1] != 'x' || size[2] < '2' || size[2] > '4' || size[3])))
        return NULL;
    return karst_type_matrix((unsigned)(size[0] - '0'), (unsigned)(size[is_square ? 0 : 2] - '0'));
}

const karst_type *karst_type_named(const char *name)
{
    if (!strcmp(name, "void"))
        return &karst_type_void;
    for (int s = 0; s < 4; s++)
        for (int k = 0; k < 4; k++)
            if (!strcmp(name, vectors[s][k].name))
                return &vectors[s][k];
    for (size_t i = 0; i < sizeof aliases / sizeof *aliases; i++)
        if (!strcmp(name, aliases[i].name))
            return karst_type_vector(aliases[i].scalar, aliases[i].size);
    return matrix_named(name);
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
    bool is_same = karst_type_is_plain(from) && karst_type_is_plain(to) && from->size == to->size &&
                   to->scalar == KARST_TYPE_UINT && from->scalar == KARST_TYPE_INT;
    return widens ? 1 : is_same ? 2 : -1;
}
