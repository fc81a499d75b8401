/* Fuzzes the world language: any bytes must give a world or a diagnostic, soon. A world must evaluate, the same by tape
 * and oracle, within its bounds; it must have a report, a gradient and a program, or say why not. `make fuzz` builds
 * and runs it. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include "producers/language/check.h"
#include "producers/language/graph/derive.h"
#include "producers/language/emit/emit.h"
#include "producers/language/language.h"
#include "producers/language/oracle/oracle.h"
#include "producers/language/tape/tape.clh"
#include "producers/language/tape/tape.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void require(bool holds, const char *what)
{
    if (holds)
        return;
    fprintf(stderr, "fuzz_language: %s\n", what);
    abort();
}

static const karst_position places[] = {{{0, 0, 0}, {0, 0, 0}},
                                        {{1000, -7, 3}, {1, 0x80000000u, 77}},
                                        {{INT64_C(1) << 60, -(INT64_C(1) << 61), 5}, {9, 8, 7}}};
#define NUM_PLACES (sizeof places / sizeof *places)

static bool same_float(float a, float b) { return k_as_uint(a) == k_as_uint(b) || (isnan(a) && isnan(b)); }

static affine_position affine_at(const karst_position *p)
{
    affine_position at;
    for (int axis = 0; axis < 3; axis++) {
        at.voxel[axis] = p->voxel[axis];
        at.fraction[axis] = p->fraction[axis];
    }
    return at;
}

/* The tape gives the oracle's bits, and its bounds hold them. */
static void compare_tape(const karst_world_layout *layout, const karst_tape *tape, const uint64_t *data,
                         karst_oracle *oracle)
{
    int *slots = calloc((size_t)tape->num_slots * TAPE_BOUND_ELEMENTS, sizeof *slots);
    if (!slots)
        return; /* memory */
    const tape_program program = {.code = tape->code,
                                  .num_instructions = tape->num_instructions,
                                  .constants = tape->constants,
                                  .data = data,
                                  .values = (const uint *)(data + layout->values_word),
                                  .num_values = layout->num_values,
                                  .slots = slots};
    for (size_t i = 0; i < NUM_PLACES; i++) {
        affine_position at = affine_at(&places[i]);
        float value = karst_oracle_density(oracle, &places[i], (int)i - 1).device;
        tape_values(&program, &at, NULL, (int)i - 1);
        require(same_float(value, k_as_float((uint)tape_load(&program, tape->output[0]))), "the tape differs");
        op_box box = {.centre = at, .radius = {0.75f, 100.0f, 0.0f}, .level = (int)i - 1};
        vint unknown = tape_bounds(&program, &box, NULL);
        op_bound bound = tape_load_bound(&program, tape->output[0]);
        /* No instruction calls a density unknown that is one number, finite or not: its bounds are that number. */
        if (tape_is_known(tape->output[0]))
            require(same_float(value, bound.v.lo) && same_float(value, bound.v.hi), "a number that is not its bounds");
        else if (!unknown)
            require(value >= bound.v.lo && value <= bound.v.hi, "a density outside its bounds");
    }
    free(slots);
}

static void run_tape(const karst_program_graph *program, const karst_world_layout *layout,
                     const karst_number *parameters, karst_oracle *oracle)
{
    karst_tape tape = {0};
    karst_error error = {0};
    uint64_t *data = calloc(layout->num_words, sizeof *data);
    if (data && karst_world_data_fill(layout, parameters, program->header.seed, program->header.voxel_log2_m, data) &&
        karst_tape_build(layout, &program->world.root[KARST_ROOT_DENSITY], 1, &tape, &error))
        compare_tape(layout, &tape, data, oracle);
    karst_tape_finish(&tape);
    free(data);
}

static void run_gradient(const karst_program_graph *program, const karst_number *parameters, karst_oracle *plain)
{
    karst_error error = {0};
    const char *fault = NULL;
    karst_gradient_world *derived = karst_derive(&program->world, &error);
    require(derived || error.message[0], "no gradient, and no word of why");
    if (!derived)
        return;
    require(karst_graph_check(&derived->graph, &fault), fault);
    karst_oracle *oracle =
        karst_oracle_create(&derived->world, parameters, program->header.seed, program->header.voxel_log2_m, NULL);
    for (size_t i = 0; oracle && i < NUM_PLACES; i++) {
        karst_oracle_value gradient[3];
        float value = karst_oracle_gradient(oracle, &places[i], (int)i - 1, gradient).device;
        require(same_float(value, karst_oracle_density(plain, &places[i], (int)i - 1).device),
                "with a gradient the density differs");
    }
    karst_oracle_destroy(oracle);
    karst_gradient_world_destroy(derived);
}

static void drop(void *user, const char *line)
{
    (void)user;
    (void)line;
}

static void use(karst_program_graph *program)
{
    karst_number parameters[KARST_HEADER_MAX_PARAMETERS + 16];
    for (uint32_t i = 0; i < program->num_parameters; i++)
        parameters[i] = program->parameters[i].value;
    karst_oracle *oracle =
        karst_oracle_create(&program->world, parameters, program->header.seed, program->header.voxel_log2_m, NULL);
    karst_world_layout layout;
    if (!oracle || !karst_world_layout_init(&layout, &program->world)) {
        karst_oracle_destroy(oracle);
        return; /* memory */
    }
    const float up[KARST_FACING_FLOATS] = {0, 1, 0, 9, 0, -2};
    karst_oracle_value values[KARST_NUM_ROOTS];
    for (size_t i = 0; karst_has_output(program->root, KARST_OUTPUT_COLOUR) && i < NUM_PLACES; i++)
        karst_oracle_shading(oracle, &places[i], up, -1, values);
    run_tape(program, &layout, parameters, oracle);
    run_gradient(program, parameters, oracle);
    karst_oracle_destroy(oracle);

    karst_error error = {0};
    karst_emitted emitted = {0};
    bool is_written = karst_emit_world(&layout, &emitted, &error);
    require(is_written || error.message[0], "no program, and no word of why");
    karst_emitted_finish(&emitted);
    require(karst_language_check(program, drop, NULL, &error) || error.status == KARST_FAILED, "no report");
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    bool ok;
    karst_error error = {0};
    karst_program_graph *program = karst_language_compile("fuzz", (const char *)data, size, NULL, 0, &ok, &error);
    require(program != NULL, "no program");
    if (ok) {
        const char *fault = NULL;
        require(karst_graph_check(&program->graph, &fault), fault);
        require(karst_graph_check(&program->resolved, &fault), fault);
        for (uint32_t e = 1; e < program->resolved.num_nodes; e++)
            require(program->resolved.nodes[e].op != KARST_OP_POSITION, "a position was left");
        use(program);
    } else {
        /* the data that a text names may not be there */
        require((error.status == KARST_BAD_WORLD || error.status == KARST_BAD_DATA) && error.message[0], "no error");
    }
    karst_program_graph_destroy(program);
    return 0;
}
