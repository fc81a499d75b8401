#include "producers/language/oracle_internal.h"

#include <math.h>
#include <stdlib.h>

#include "producers/language/uniform.h"

karst_oracle *karst_oracle_create(const karst_resolved_world *world, const karst_number *parameters, uint32_t seed,
                                  int voxel_log2_m, karst_error *error)
{
    karst_oracle *o = calloc(1, sizeof *o);
    if (!o)
        goto failed;
    karst_world_layout_init(&o->layout, world);
    o->graph = world->graph;
    uint32_t count = o->graph->num_nodes;
    o->values = calloc(count, sizeof *o->values);
    o->known = calloc(count, 1);
    o->words = calloc(o->layout.num_words, sizeof *o->words);
    o->slots = calloc(count, sizeof *o->slots);
    if (!o->values || !o->known || !o->words || !o->slots ||
        !karst_world_data_fill(&o->layout, parameters, seed, voxel_log2_m, o->words))
        goto failed;
    karst_uniform_evaluate(o->graph, parameters, o->values, o->known);
    for (karst_expr e = 1; e < count; e++) {
        karst_oracle_slot *s = &o->slots[e];
        if (!o->known[e])
            continue;
        uint8_t type = o->graph->nodes[e].type;
        s->d = o->values[e].value;
        s->f = karst_number_to_float(o->values[e]);
        s->low = type == KARST_TYPE_FLOAT ? karst_number_rest(o->values[e]) : 0;
        s->i = type == KARST_TYPE_BOOL    ? -(o->values[e].numerator != 0)
               : type == KARST_TYPE_FLOAT ? 0
                                          : (int)(uint)o->values[e].numerator;
    }
    return o;
failed:
    karst_oracle_destroy(o);
    karst_fail(error, KARST_FAILED, "out of memory");
    return NULL;
}

void karst_oracle_destroy(karst_oracle *oracle)
{
    if (!oracle)
        return;
    free(oracle->values);
    free(oracle->known);
    free(oracle->words);
    free(oracle->slots);
    free(oracle);
}

static void evaluate(karst_oracle *o, const karst_position *at, int level)
{
    for (int i = 0; i < 3; i++) {
        o->at.voxel[i] = at->voxel[i];
        o->at.fraction[i] = at->fraction[i];
    }
    o->level = level;
    for (karst_expr e = 1; e < o->graph->num_nodes; e++) {
        if (o->known[e] || (o->graph->nodes[e].op == KARST_OP_AFFINE && o->layout.word[e] == KARST_NO_WORD))
            continue; /* the second: only an argument's form, never a value */
        karst_oracle_step_float(o, e);
        karst_oracle_step_double(o, e);
    }
}

karst_oracle_value karst_oracle_node(const karst_oracle *o, karst_expr e)
{
    const karst_oracle_slot *s = &o->slots[e];
    switch (o->graph->nodes[e].type) {
    case KARST_TYPE_FLOAT:
        return (karst_oracle_value){s->f, s->d};
    case KARST_TYPE_BOOL:
        return (karst_oracle_value){s->i ? 1.0f : 0.0f, s->d};
    case KARST_TYPE_UINT:
        return (karst_oracle_value){(float)(uint)s->i, s->d};
    default:
        return (karst_oracle_value){(float)s->i, s->d};
    }
}

karst_oracle_value karst_oracle_density(karst_oracle *oracle, const karst_position *at, int level)
{
    evaluate(oracle, at, level);
    return karst_oracle_node(oracle, oracle->layout.world.density);
}

void karst_oracle_colour(karst_oracle *oracle, const karst_position *at, const float normal[3], int level,
                         karst_oracle_value rgb[3])
{
    for (int i = 0; i < 3; i++)
        oracle->normal[i] = normal[i];
    evaluate(oracle, at, level);
    for (int i = 0; i < 3; i++)
        rgb[i] = karst_oracle_node(oracle, oracle->layout.world.colour[i]);
}
