#include "producers/language/oracle/oracle_internal.h"

#include <math.h>
#include <stdlib.h>

#include "producers/language/graph/uniform.h"
#include "producers/language/graph/words.h"

/* ---- plans ---- */

/* Each argument is computed if its user is; and as a float, where that decides what is piecewise constant. */
static void mark_halves(const karst_oracle *o, uint8_t *halves)
{
    for (karst_expr e = o->graph->num_nodes - 1; e > 0; e--) {
        const karst_expr_node *n = &o->graph->nodes[e];
        if (!halves[e] || o->known[e])
            continue;
        if (n->kind == KARST_KIND_STEPS || o->rounds[e])
            halves[e] |= KARST_ORACLE_DEVICE;
        for (int k = 0; k < 4; k++)
            halves[n->arg[k]] |= halves[e];
    }
}

/* AFFINE nodes without a record are an argument's form only, never a value. */
static bool has_value(const karst_oracle *o, karst_expr e)
{
    return !o->known[e] && !(o->graph->nodes[e].op == KARST_OP_AFFINE && o->layout.word[e] == KARST_NO_WORD);
}

static bool make_plan(const karst_oracle *o, const karst_expr *roots, size_t num_roots, uint8_t halves,
                      karst_oracle_plan *plan)
{
    uint32_t count = o->graph->num_nodes;
    plan->nodes = calloc(count, sizeof *plan->nodes);
    plan->halves = calloc(count, 1);
    uint8_t *wanted = calloc(count, 1);
    if (plan->nodes && plan->halves && wanted) {
        for (size_t i = 0; i < num_roots; i++)
            wanted[roots[i]] = halves;
        mark_halves(o, wanted);
        for (karst_expr e = 1; e < count; e++)
            if (wanted[e] && has_value(o, e)) {
                plan->halves[plan->num_nodes] = wanted[e];
                plan->nodes[plan->num_nodes++] = e;
            }
    }
    free(wanted);
    return plan->nodes && plan->halves && wanted;
}

static bool make_plans(karst_oracle *o)
{
    const karst_resolved_world *world = &o->layout.world;
    const uint8_t both = KARST_ORACLE_DEVICE | KARST_ORACLE_PRECISE;
    const karst_expr *g = world->gradient, all[4] = {g[0], g[1], g[2], world->root[KARST_ROOT_DENSITY]};
    karst_expr shading[KARST_NUM_ROOTS];
    const size_t num_shading = karst_program_roots(world->root, KARST_PROGRAM_SHADING, shading);
    const karst_expr densities[2] = {world->root[KARST_ROOT_DENSITY], world->text};
    return make_plan(o, densities, world->text ? 2 : 1, both, &o->density) &&
           make_plan(o, &world->root[KARST_ROOT_DENSITY], 1, KARST_ORACLE_PRECISE, &o->precise_density) &&
           (!num_shading || make_plan(o, shading, num_shading, both, &o->shading)) &&
           (!world->has_gradient || make_plan(o, all, 4, both, &o->gradient));
}

static void drop_plan(karst_oracle_plan *plan)
{
    free(plan->nodes);
    free(plan->halves);
}

/* ---- making ---- */

static void fill_known_slots(karst_oracle *o)
{
    for (karst_expr e = 1; e < o->graph->num_nodes; e++) {
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
}

karst_oracle *karst_oracle_create(const karst_resolved_world *world, const karst_number *parameters, uint32_t seed,
                                  int voxel_log2_m, karst_error *error)
{
    karst_oracle *o = calloc(1, sizeof *o);
    if (!o || !karst_world_layout_init(&o->layout, world))
        goto failed;
    o->graph = world->graph;
    uint32_t count = o->graph->num_nodes;
    o->values = calloc(count, sizeof *o->values);
    o->known = calloc(count, 1);
    o->rounds = calloc(count, 1);
    o->words = karst_world_words_create(&o->layout, o->layout.num_words * sizeof *o->words);
    o->slots = calloc(count, sizeof *o->slots);
    if (!o->values || !o->known || !o->rounds || !o->words || !o->slots ||
        !karst_world_data_fill(&o->layout, parameters, seed, voxel_log2_m, o->words))
        goto failed;
    karst_uniform_evaluate(o->graph, parameters, o->values, o->known);
    if (!karst_oracle_find_ties(o) || !make_plans(o))
        goto failed;
    fill_known_slots(o);
    return o;
failed:
    karst_oracle_destroy(o);
    karst_fail(error, KARST_FAILED, "out of memory");
    return NULL;
}

karst_oracle *karst_oracle_clone(const karst_oracle *oracle, karst_error *error)
{
    karst_oracle *o = malloc(sizeof *o);
    if (o) {
        *o = *oracle;
        o->original = oracle->original ? oracle->original : oracle;
        o->slots = calloc(o->graph->num_nodes, sizeof *o->slots);
    }
    if (!o || !o->slots) {
        free(o);
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    fill_known_slots(o);
    return o;
}

void karst_oracle_destroy(karst_oracle *oracle)
{
    if (!oracle)
        return;
    if (!oracle->original) {
        free(oracle->values);
        free(oracle->known);
        free(oracle->rounds);
        karst_world_words_destroy(&oracle->layout, oracle->words, oracle->layout.num_words * sizeof *oracle->words);
        drop_plan(&oracle->density);
        drop_plan(&oracle->precise_density);
        drop_plan(&oracle->shading);
        drop_plan(&oracle->gradient);
    }
    free(oracle->slots);
    free(oracle);
}

const karst_world_layout *karst_oracle_layout(const karst_oracle *oracle) { return &oracle->layout; }
const uint64_t *karst_oracle_words(const karst_oracle *oracle) { return oracle->words; }

/* ---- evaluating ---- */

static void evaluate(karst_oracle *o, const karst_oracle_plan *plan, const karst_position *at, int level)
{
    for (int i = 0; i < 3; i++) {
        o->at.voxel[i] = at->voxel[i];
        o->at.fraction[i] = at->fraction[i];
    }
    o->level = level;
    for (uint32_t i = 0; i < plan->num_nodes; i++) {
        if (plan->halves[i] & KARST_ORACLE_DEVICE)
            karst_oracle_step_float(o, plan->nodes[i]);
        if (plan->halves[i] & KARST_ORACLE_PRECISE)
            karst_oracle_step_double(o, plan->nodes[i]);
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
    evaluate(oracle, &oracle->density, at, level);
    return karst_oracle_node(oracle, oracle->layout.world.root[KARST_ROOT_DENSITY]);
}

double karst_oracle_precise_density(karst_oracle *oracle, const karst_position *at, int level)
{
    evaluate(oracle, &oracle->precise_density, at, level);
    return oracle->slots[oracle->layout.world.root[KARST_ROOT_DENSITY]].d;
}

karst_oracle_value karst_oracle_text_density(karst_oracle *oracle, const karst_position *at, int level)
{
    const karst_resolved_world *world = &oracle->layout.world;
    evaluate(oracle, &oracle->density, at, level);
    return karst_oracle_node(oracle, world->text ? world->text : world->root[KARST_ROOT_DENSITY]);
}

void karst_oracle_shading(karst_oracle *oracle, const karst_position *at, const float facing[KARST_FACING_FLOATS],
                          int level, karst_oracle_value values[KARST_NUM_ROOTS])
{
    for (int i = 0; i < KARST_FACING_FLOATS; i++)
        oracle->facing[i] = facing[i];
    evaluate(oracle, &oracle->shading, at, level);
    for (int o = 0; o < KARST_NUM_OUTPUTS; o++) {
        const karst_output_info *output = &karst_outputs[o];
        const bool is_there = karst_entries[karst_entry_of((karst_output)o)].program == KARST_PROGRAM_SHADING &&
                              karst_has_output(oracle->layout.world.root, (karst_output)o);
        for (uint32_t i = output->root; i < output->root + output->num_floats; i++)
            values[i] = is_there ? karst_oracle_node(oracle, oracle->layout.world.root[i])
                                 : (karst_oracle_value){(float)output->usual, output->usual};
    }
}

void karst_oracle_colour(karst_oracle *oracle, const karst_position *at, const float facing[KARST_FACING_FLOATS],
                         int level, karst_oracle_value rgb[3])
{
    karst_oracle_value values[KARST_NUM_ROOTS];
    karst_oracle_shading(oracle, at, facing, level, values);
    for (int i = 0; i < 3; i++)
        rgb[i] = values[KARST_ROOT_COLOUR + i];
}

karst_oracle_value karst_oracle_gradient(karst_oracle *oracle, const karst_position *at, int level,
                                         karst_oracle_value gradient[3])
{
    evaluate(oracle, &oracle->gradient, at, level);
    for (int i = 0; i < 3; i++)
        gradient[i] = karst_oracle_node(oracle, oracle->layout.world.gradient[i]);
    return karst_oracle_node(oracle, oracle->layout.world.root[KARST_ROOT_DENSITY]);
}
