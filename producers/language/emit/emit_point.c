/* The point form: world_point, world_colour and world_outputs. */
#include "producers/language/emit/emit_internal.h"

#include <stdlib.h>
#include <string.h>

/* All that is marked. */
static void marked_lines(karst_emit *emit)
{
    for (karst_expr e = 1; e < emit->graph->num_nodes; e++)
        if (emit->nodes[e].needs)
            karst_emit_lines(emit, e);
}

static uint32_t lines_of(karst_emit *emit, const karst_expr *roots, size_t num_roots)
{
    uint32_t count = karst_emit_mark(emit, roots, num_roots);
    karst_emit_begin_block(emit, (karst_block){.is_point = true});
    marked_lines(emit);
    return count;
}

static const char begin[] = "    affine_position at;\n"
                            "    K_UNROLL\n"
                            "    for (int i = 0; i < 3; i++) {\n"
                            "        at.voxel[i] = place->voxel[i];\n"
                            "        at.fraction[i] = place->fraction[i];\n"
                            "    }\n";

void karst_emit_points(karst_emit *emit, karst_emitted *emitted)
{
    const karst_resolved_world *world = &emit->layout->world;
    karst_text *text = &emit->text;
    karst_text_add(text,
                   "K_INLINE K_WIDE vfloat world_point(world_data data, const world_point_at *place, int level)\n{\n%s",
                   begin);
    emitted->num_point_ops = lines_of(emit, &world->root[KARST_ROOT_DENSITY], 1);
    karst_text_add(text, "    return %s;\n}\n\n", karst_emit_operand(emit, world->root[KARST_ROOT_DENSITY]).text);
}

/* ---- gradients ---- */

/* A gradient's components are choices by one bool, whether anything ties (derive.h): which is rare, so what only the
 * first side needs is put under a test. Returns the bool; KARST_NO_EXPR: there is none. */
static karst_expr tie_of(const karst_emit *emit, const karst_expr gradient[3])
{
    for (int i = 0; i < 3; i++)
        if (emit->graph->nodes[gradient[i]].op == KARST_OP_SELECT)
            return emit->graph->nodes[gradient[i]].arg[0];
    return KARST_NO_EXPR;
}

static bool chooses_by(const karst_emit *emit, karst_expr e, karst_expr tie)
{
    return emit->graph->nodes[e].op == KARST_OP_SELECT && emit->graph->nodes[e].arg[0] == tie;
}

/* What is computed in any case. Noises and exact places, which share declarations, always are. */
static void mark_always(const karst_emit *emit, karst_expr density, const karst_expr gradient[3], karst_expr tie,
                        uint8_t *always)
{
    always[density] = always[tie] = 1;
    for (int i = 0; i < 3; i++)
        always[chooses_by(emit, gradient[i], tie) ? emit->graph->nodes[gradient[i]].arg[2] : gradient[i]] = 1;
    for (karst_expr e = emit->graph->num_nodes - 1; e > 0; e--) {
        bool is_shared = emit->graph->nodes[e].op == KARST_OP_NOISE || karst_takes_place(emit->layout, e, 0);
        if (!emit->nodes[e].needs || !(always[e] || is_shared))
            continue;
        karst_emit_input inputs[KARST_MAX_INPUTS];
        size_t num_inputs = karst_emit_inputs(emit, e, inputs);
        always[e] = 1;
        for (size_t i = 0; i < num_inputs; i++)
            always[inputs[i].e] = 1;
    }
}

/* Sets `gradient`, all nodes being marked. False: nothing is written, since nothing can be left out. */
static bool gradient_lines(karst_emit *emit, karst_expr density, const karst_expr gradient[3])
{
    const karst_expr tie = tie_of(emit, gradient);
    uint8_t *always = tie ? calloc(emit->graph->num_nodes, 1) : NULL;
    karst_text *text = &emit->text;
    if (!always)
        return false;
    mark_always(emit, density, gradient, tie, always);
    for (karst_expr e = 1; e < emit->graph->num_nodes; e++)
        if (emit->nodes[e].needs && always[e])
            karst_emit_lines(emit, e);
    for (int i = 0; i < 3; i++) {
        karst_expr taken = chooses_by(emit, gradient[i], tie) ? emit->graph->nodes[gradient[i]].arg[2] : gradient[i];
        karst_text_add(text, "    gradient[%d] = %s;\n", i, karst_emit_operand(emit, taken).text);
    }
    karst_text_add(text, "    if (v_any(%s)) {\n", karst_emit_operand(emit, tie).text);
    for (karst_expr e = 1; e < emit->graph->num_nodes; e++)
        if (emit->nodes[e].needs && !always[e])
            karst_emit_lines(emit, e);
    for (int i = 0; i < 3; i++)
        if (!always[gradient[i]])
            karst_text_add(text, "    gradient[%d] = %s;\n", i, karst_emit_operand(emit, gradient[i]).text);
    karst_text_add(text, "    }\n");
    free(always);
    return true;
}

void karst_emit_surfaces(karst_emit *emit)
{
    const karst_resolved_world *world = &emit->layout->world;
    const karst_expr roots[4] = {world->root[KARST_ROOT_DENSITY], world->gradient[0], world->gradient[1],
                                 world->gradient[2]};
    karst_text *text = &emit->text;
    karst_text_add(text,
                   "K_INLINE K_WIDE vfloat world_surface(world_data data, const world_point_at *place, int level, "
                   "vfloat gradient[3])\n{\n%s",
                   begin);
    karst_emit_mark(emit, roots, 4);
    karst_emit_begin_block(emit, (karst_block){.is_point = true});
    if (!gradient_lines(emit, world->root[KARST_ROOT_DENSITY], world->gradient)) {
        marked_lines(emit);
        for (int i = 0; i < 3; i++)
            karst_text_add(text, "    gradient[%d] = %s;\n", i, karst_emit_operand(emit, world->gradient[i]).text);
    }
    karst_text_add(text, "    return %s;\n}\n\n", karst_emit_operand(emit, world->root[KARST_ROOT_DENSITY]).text);
}

/* ---- shading ---- */

static const char shading_inputs[] =
    "world_data data, const world_near_at *near, __local const near_octave *octaves,\n"
    "                                  const world_point_at *place, int level,\n"
    "                                  const vfloat facing[KARST_FACING_FLOATS]";
#define SHADING_NAME(id, ...) "WORLD_OUTPUT_" #id,
static const char *const shading_names[KARST_NUM_OUTPUTS] = {KARST_OUTPUTS(SHADING_NAME)};

void karst_emit_output_names(karst_emit *emit)
{
    uint32_t numbers[KARST_NUM_ROOTS];
    size_t count = karst_list_roots(emit->layout->world.root, KARST_PROGRAM_SHADING, numbers);
    if (count == karst_outputs[KARST_OUTPUT_COLOUR].num_floats)
        return;
    karst_text_add(&emit->text, "#define WORLD_NUM_OUTPUTS %u\n", (unsigned)count);
    for (uint32_t i = 0; i < count; i++)
        for (int o = 0; o < KARST_NUM_OUTPUTS; o++)
            if (karst_outputs[o].root == numbers[i])
                karst_text_add(&emit->text, "#define %s %u\n", shading_names[o], i);
}

void karst_emit_shading(karst_emit *emit, karst_emitted *emitted)
{
    karst_expr roots[KARST_NUM_ROOTS];
    const size_t num_roots = karst_program_roots(emit->layout->world.root, KARST_PROGRAM_SHADING, roots);
    const bool is_colour_alone = num_roots == karst_outputs[KARST_OUTPUT_COLOUR].num_floats;
    karst_text *text = &emit->text;
    emitted->num_colour_ops = karst_emit_mark(emit, roots, num_roots);
    karst_emit_near_octaves(emit);
    karst_text_add(text, "K_INLINE K_WIDE void %s(%s,\n                                  %s)\n{\n%s",
                   is_colour_alone ? "world_colour" : "world_outputs", shading_inputs,
                   is_colour_alone ? "vfloat values[3]" : "vfloat values[WORLD_NUM_OUTPUTS]", begin);
    const size_t body = text->length;
    karst_emit_begin_block(emit, (karst_block){.is_point = true, .is_near = true});
    /* What a packet does not need is left out, though then infinite numbers in it do not come through. */
    if (!karst_emit_choice_lines(emit, roots, num_roots))
        marked_lines(emit);
    for (uint32_t i = 0; i < num_roots; i++)
        karst_text_add(text, "    values[%u] = %s;\n", i, karst_emit_operand(emit, roots[i]).text);
    /* What is not near takes the exact place as first argument. */
    const bool takes_places = !text->failed && strstr(text->bytes + body, "(&at,");
    karst_text_add(text, "}\n#define WORLD_COLOUR_TAKES_PLACES %d\n\n", takes_places);
}
