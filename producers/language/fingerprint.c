#include "producers/language/fingerprint.h"

#include <setjmp.h>
#include <stdlib.h>
#include <string.h>

#include "producers/language/image/image.h"

typedef struct {
    unsigned char *bytes; /* NULL while only counting */
    size_t length;
} writer;

static void put(writer *to, const void *value, size_t size)
{
    if (to->bytes)
        memcpy(to->bytes + to->length, value, size);
    to->length += size;
}

static void put_word(writer *to, uint64_t value) { put(to, &value, sizeof value); }

static void put_number(writer *to, const karst_number *number)
{
    put(to, &number->value, sizeof number->value);
    put(to, &number->numerator, sizeof number->numerator);
    put(to, &number->denominator, sizeof number->denominator);
}

/* Field by field: structures have gaps, and a node's place in the text is no part of what it is. */
static void put_node(writer *to, const karst_graph *graph, const karst_expr_node *n, const karst_number *values)
{
    const uint8_t what[] = {n->op, n->type, n->kind};
    put(to, what, sizeof what);
    put(to, n->arg, sizeof n->arg);
    switch (n->op) {
    case KARST_OP_CONSTANT:
        put_number(to, &graph->constants[n->extra]);
        break;
    case KARST_OP_PARAMETER: /* its value, not its number: another parameter may have come before it */
        put_number(to, &values[n->extra]);
        break;
    case KARST_OP_AFFINE:
        put(to, graph->affines[n->extra].coefficient, sizeof graph->affines[n->extra].coefficient);
        put(to, &graph->affines[n->extra].offset, sizeof graph->affines[n->extra].offset);
        break;
    case KARST_OP_NOISE: {
        const karst_noise *noise = &graph->noises[n->extra];
        const uint32_t fields[] = {noise->base,        noise->shape, noise->derivative, noise->num_octaves,
                                   noise->seed_offset, noise->gain,  noise->lacunarity};
        put(to, fields, sizeof fields);
        if (noise->image)
            put_word(to, noise->image->digest);
        if (noise->channel && !noise->texture) /* of a texture; a density has none */
            put_word(to, noise->channel);
        break;
    }
    default:
        put(to, &n->extra, sizeof n->extra);
    }
}

static void put_all(writer *to, const karst_program_graph *program, const karst_graph *graph, karst_expr density,
                    const karst_number *values, uint32_t seed)
{
    put_word(to, seed);
    put_word(to, (uint64_t)(int64_t)program->header.voxel_log2_m);
    put(to, &program->header.lipschitz, sizeof program->header.lipschitz);
    put_word(to, density);
    for (uint32_t e = 1; e < graph->num_nodes; e++)
        put_node(to, graph, &graph->nodes[e], values);
}

static void out_of_memory(void *user) { longjmp(*(jmp_buf *)user, 1); }

bool karst_fingerprint_init(karst_fingerprint *fingerprint, const karst_program_graph *program,
                            const karst_number *values, uint32_t seed)
{
    jmp_buf full;
    karst_arena arena;
    karst_graph live;
    karst_expr density = program->world.root[KARST_ROOT_DENSITY];
    *fingerprint = (karst_fingerprint){0};
    karst_arena_init(&arena, KARST_LANGUAGE_ARENA_BYTES, out_of_memory, &full);
    if (setjmp(full)) {
        karst_arena_finish(&arena);
        return false;
    }
    /* As many nodes at most as there were: only the arena can be full. */
    karst_graph_init(&live, &arena, program->resolved.num_nodes + 1, NULL, NULL);
    karst_graph_extract(&program->resolved, &live, &density, 1);

    writer to = {0};
    put_all(&to, program, &live, density, values, seed);
    fingerprint->bytes = malloc(to.length);
    if (fingerprint->bytes) {
        to = (writer){.bytes = fingerprint->bytes};
        put_all(&to, program, &live, density, values, seed);
        fingerprint->length_bytes = to.length;
    }
    karst_arena_finish(&arena);
    return fingerprint->bytes != NULL;
}

void karst_fingerprint_finish(karst_fingerprint *fingerprint)
{
    free(fingerprint->bytes);
    *fingerprint = (karst_fingerprint){0};
}

bool karst_fingerprint_same(const karst_fingerprint *a, const karst_fingerprint *b)
{
    return a->length_bytes == b->length_bytes && memcmp(a->bytes, b->bytes, a->length_bytes) == 0;
}
