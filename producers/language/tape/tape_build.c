/* From a resolved graph to a tape: which nodes run, where their arguments are read, which slot each result goes to. */
#include "producers/language/tape/tape_internal.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "producers/language/ops/octave.clh"

_Static_assert((int)TAPE_FLOAT_TYPE == KARST_TYPE_FLOAT && (int)TAPE_INT_TYPE == KARST_TYPE_INT &&
                   (int)TAPE_UINT_TYPE == KARST_TYPE_UINT && (int)TAPE_BOOL_TYPE == KARST_TYPE_BOOL,
               "tape_shared.h has graph.h's types");
_Static_assert((int)OCTAVE_SUM == KARST_NOISE_SUM && (int)OCTAVE_RIDGED == KARST_NOISE_RIDGED &&
                   (int)OCTAVE_BILLOW == KARST_NOISE_BILLOW && (int)OCTAVE_TURBULENCE == KARST_NOISE_TURBULENCE,
               "octave.clh has graph.h's shapes");

/* Whether this part of a node reads its arguments as pairs, where they are or may be some. */
static bool reads_pairs(const karst_tape_builder *b, karst_expr e, int part)
{
    return b->graph->nodes[e].op == KARST_OP_SHIFTED ? part == PART_PAIR : karst_tape_is_wide(b, e);
}

/* Node `e` is the last that reads it, so far. */
static void keep_for(karst_tape_builder *b, karst_expr argument, int read, karst_expr e)
{
    b->needed[argument][read] = 1;
    if (b->last_use[argument][read] < e)
        b->last_use[argument][read] = e;
}

static void mark(karst_tape_builder *b, const karst_expr *roots, uint32_t num_roots)
{
    for (uint32_t i = 0; i < num_roots; i++) {
        int part = karst_tape_part(b, roots[i], false);
        b->needed[roots[i]][part] = 1;
        b->last_use[roots[i]][part] = UINT32_MAX;
    }
    for (karst_expr e = b->graph->num_nodes - 1; e > 0; e--) {
        for (int part = 0; part < NUM_PARTS; part++) {
            if (!b->needed[e][part] || b->layout->is_known[e])
                continue;
            for (int k = 0; k < 4; k++) {
                karst_expr argument = karst_tape_reads(b, e, k);
                keep_for(b, argument, karst_tape_part(b, argument, reads_pairs(b, e, part)), e);
            }
            keep_for(b, karst_tape_fades(b, e), PART_VALUE, e);
            if (b->with_curves && karst_tape_find_smooth(b, e, &b->smooth[e])) {
                keep_for(b, b->smooth[e].a, karst_tape_part(b, b->smooth[e].a, false), e);
                keep_for(b, b->smooth[e].b, karst_tape_part(b, b->smooth[e].b, false), e);
            }
        }
    }
}

static uint8_t op_of(const karst_tape_builder *b, karst_expr e)
{
    uint8_t op = b->graph->nodes[e].op;
    if (!karst_takes_place(b->layout, e, 0))
        return karst_tape_plain_op(b, e);
    return op == KARST_OP_FLOOR   ? TAPE_PLACE_FLOOR
           : op == KARST_OP_FRACT ? TAPE_PLACE_FRACT
           : op == KARST_OP_MOD   ? TAPE_PLACE_MOD
           : op == KARST_OP_CELL  ? TAPE_PLACE_CELL
                                  : karst_tape_plain_op(b, e);
}

static bool can_run(const karst_tape_builder *b, karst_expr e, karst_error *error)
{
    const karst_expr_node *n = &b->graph->nodes[e];
    bool is_turns = n->op == KARST_OP_SIN_TURNS || n->op == KARST_OP_COS_TURNS;
    if (n->op == KARST_OP_POSITION || n->op == KARST_OP_PARAMETER || n->op == KARST_OP_NONE ||
        ((is_turns || n->op == KARST_OP_CELL) && !karst_takes_place(b->layout, e, 0)))
        return karst_fail(error, KARST_BAD_WORLD, "%s is not an op of a resolved graph", karst_op_name(n->op));
    return true;
}

static void release_arguments(karst_tape_builder *b, karst_expr e, int part)
{
    for (int k = 0; k < 4; k++) {
        karst_expr argument = karst_tape_reads(b, e, k);
        int read = karst_tape_part(b, argument, reads_pairs(b, e, part));
        /* the value of a node comes before its pair and may be read by it again */
        bool again = part == PART_VALUE && b->needed[e][PART_PAIR];
        if (argument && b->last_use[argument][read] == e && !again && !b->layout->is_known[argument]) {
            b->free_slots[b->num_free++] = b->slot[argument][read];
            b->last_use[argument][read] = 0; /* once, if it is read twice */
        }
    }
    const karst_expr others[4] = {karst_tape_fades(b, e), karst_tape_curve_reads(b, e), b->smooth[e].a,
                                  b->smooth[e].b};
    for (int k = 0; k < 4; k++) {
        int read = karst_tape_part(b, others[k], false);
        if (others[k] && b->last_use[others[k]][read] == e && !b->layout->is_known[others[k]]) {
            b->free_slots[b->num_free++] = b->slot[others[k]][read];
            b->last_use[others[k]][read] = 0;
        }
    }
}

/* For bounds, which take the two numbers alone. */
static void add_smooth(karst_tape_builder *b, const karst_tape_smooth *s, karst_instruction *i)
{
    karst_tape *tape = b->tape;
    i->flags |= TAPE_IS_SMOOTH;
    i->arg[3] = karst_tape_operand(b, s->a, false);
    i->word = karst_tape_operand(b, s->b, false);
    i->count = tape->num_constants;
    tape->constants[tape->num_constants++] = k_as_uint((float)s->k);
    tape->constants[tape->num_constants++] = (uint32_t)s->order | (s->negates_arguments ? TAPE_SMOOTH_OF_NEGATED : 0) |
                                             (s->negates_result ? TAPE_SMOOTH_IS_NEGATED : 0);
    tape->has_smooth = true;
}

static void add_instruction(karst_tape_builder *b, karst_expr e, int part)
{
    const karst_expr_node *n = &b->graph->nodes[e];
    karst_instruction i = {.op = op_of(b, e), .type = n->type, .word = b->layout->word[e]};
    bool as_pair = reads_pairs(b, e, part);
    i.flags = (n->kind == KARST_KIND_STEPS ? TAPE_IS_STEPS : 0) | (as_pair || part == PART_PAIR ? TAPE_IS_WIDE : 0);
    for (int k = 0; k < 4; k++) {
        i.arg[k] = karst_tape_operand(b, karst_tape_reads(b, e, k), as_pair);
        i.count += n->arg[k] != 0;
    }
    karst_expr t = karst_tape_fades(b, e);
    if (t) {
        i.arg[2] = karst_tape_operand(b, t, false);
        i.flags |= TAPE_IS_FADE;
    }
    /* a choice's type is its values' */
    i.argument_type = b->graph->nodes[n->arg[0]].type;
    if (n->op == KARST_OP_NORMAL || n->op == KARST_OP_CELL)
        i.count = n->extra;
    if (n->op == KARST_OP_FOOTPRINT)
        i.count = n->extra - KARST_FOOTPRINT_BIAS;
    if (n->op == KARST_OP_NOISE) {
        const karst_noise *noise = &b->graph->noises[n->extra];
        i.count = noise->num_octaves;
        i.argument_type = (uint8_t)karst_noise_way(b->graph, e);
        i.type = noise->shape;
        i.flags |= (uint8_t)(noise->derivative << TAPE_DERIVATIVE);
        b->tape->has_images |= noise->image != NULL;
        b->tape->has_textures |= karst_graph_is_texture(b->graph, e);
        b->tape->has_fields |= karst_graph_image_axes(b->graph, e) > 2;
    }
    if (b->smooth[e].a)
        add_smooth(b, &b->smooth[e], &i);
    if (b->with_curves)
        i.flags |= (uint8_t)(b->is_curve[e] == 1 ? TAPE_IS_CURVE : b->is_seen[e] ? 0 : TAPE_IS_PASSED);
    release_arguments(b, e, part);
    b->slot[e][part] = b->num_free ? b->free_slots[--b->num_free] : b->tape->num_slots++;
    i.slot = b->slot[e][part];
    karst_tape_append(b, i);
}

static bool build(const karst_world_layout *layout, const karst_expr *roots, uint32_t num_roots, bool with_curves,
                  karst_tape *tape, karst_error *error)
{
    uint32_t count = layout->world.graph->num_nodes;
    karst_tape_builder b = {.layout = layout, .graph = layout->world.graph, .tape = tape, .with_curves = with_curves};
    bool done = false;
    *tape = (karst_tape){.num_outputs = num_roots};
    b.needed = calloc(count, sizeof *b.needed);
    b.last_use = calloc(count, sizeof *b.last_use);
    b.slot = calloc(count, sizeof *b.slot);
    b.constant = calloc(count, sizeof *b.constant);
    b.free_slots = calloc(NUM_PARTS * (size_t)count, sizeof *b.free_slots);
    b.source = calloc(count, sizeof *b.source);
    b.is_curve = calloc(count, 1);
    b.is_seen = calloc(count, 1);
    b.smooth = calloc(count, sizeof *b.smooth);
    tape->constants = calloc(3 * (size_t)count, sizeof *tape->constants); /* each as a number and as a pair */
    bool fits = b.needed && b.last_use && b.slot && b.constant && b.free_slots && b.source && b.is_curve && b.is_seen &&
                b.smooth;
    if (fits) {
        mark(&b, roots, num_roots);
        if (with_curves)
            karst_tape_find_curves(&b, roots, num_roots);
        tape->code = calloc(NUM_PARTS * (size_t)count + b.num_curve_code, sizeof *tape->code);
    }
    if (!tape->code || !tape->constants) {
        karst_fail(error, KARST_FAILED, "out of memory");
        goto end;
    }
    for (karst_expr e = 1; e < count; e++) {
        for (int part = 0; part < NUM_PARTS; part++) {
            if (!b.needed[e][part] || layout->is_known[e])
                continue;
            if (!can_run(&b, e, error))
                goto end;
            if (b.is_curve[e] == 1)
                karst_tape_add_curve(&b, e);
            add_instruction(&b, e, part);
        }
    }
    for (uint32_t i = 0; i < num_roots; i++)
        tape->output[i] = karst_tape_operand(&b, roots[i], false);
    tape->num_slots += tape->num_slots == 0;
    done = true;
end:
    free(b.needed);
    free(b.last_use);
    free(b.slot);
    free(b.constant);
    free(b.free_slots);
    free(b.source);
    free(b.is_curve);
    free(b.is_seen);
    free(b.smooth);
    if (!done)
        karst_tape_finish(tape);
    return done;
}

bool karst_tape_build(const karst_world_layout *layout, const karst_expr *roots, uint32_t num_roots, karst_tape *tape,
                      karst_error *error)
{
    return build(layout, roots, num_roots, true, tape, error);
}

bool karst_tape_build_plain(const karst_world_layout *layout, const karst_expr *roots, uint32_t num_roots,
                            karst_tape *tape, karst_error *error)
{
    return build(layout, roots, num_roots, false, tape, error);
}

void karst_tape_options(const karst_tape *tape, char *options, size_t size_bytes)
{
    uint32_t slots = 16;
    while (slots < tape->num_slots)
        slots *= 2;
    snprintf(options, size_bytes,
             "-DTAPE_SLOTS=%u -DTAPE_OPS_LOW=%#xu -DTAPE_OPS_HIGH=%#xu -DTAPE_WIDE_LOW=%#xu -DTAPE_WIDE_HIGH=%#xu "
             "-DTAPE_HAS_STEPS=%d -DTAPE_HAS_CURVES=%d%s%s%s",
             slots, tape->ops[0], tape->ops[1], tape->wide_ops[0], tape->wide_ops[1], tape->has_steps,
             tape->has_curves,
             tape->has_fields   ? " -DOCTAVE_HAS_IMAGES=1 -DIMAGE_MOST_AXES=3"
             : tape->has_images ? " -DOCTAVE_HAS_IMAGES=1"
                                : "",
             tape->has_textures ? " -DOCTAVE_HAS_TEXTURES=1" : "",
             tape->has_smooth ? " -DTAPE_HAS_SMOOTH=1" : "");
}

void karst_tape_finish(karst_tape *tape)
{
    free(tape->code);
    free(tape->constants);
    *tape = (karst_tape){0};
}
