/* Samples at many points at once: instruction by instruction on the host's vectors (host_tape.h). */
#include "producers/density/sampler_internal.h"

#include <string.h>

#include "producers/density/host_tape.h"

#define POINTS_AT_ONCE 1024u

/* Of a world that is too large there is none: its points are sampled one by one. */
static const karst_tape *find_tape(karst_tape *tape, bool *has_tried, const karst_oracle *oracle,
                                   const karst_expr *roots, uint32_t num_roots)
{
    if (!*has_tried && !karst_tape_build_plain(karst_oracle_layout(oracle), roots, num_roots, tape, NULL))
        *tape = (karst_tape){0};
    *has_tried = true;
    return tape->code && tape->num_slots <= KARST_TAPE_MOST_SLOTS ? tape : NULL;
}

static void run(const karst_tape *tape, const karst_oracle *oracle, const karst_position *at, size_t num, int level,
                float *const *values)
{
    const uint64_t *words = karst_oracle_words(oracle);
    const karst_world_layout *layout = karst_oracle_layout(oracle);
    const tape_program program = {.code = tape->code,
                                  .num_instructions = tape->num_instructions,
                                  .constants = tape->constants,
                                  .data = words,
                                  .values = (const uint *)(words + layout->values_word),
                                  .num_values = layout->num_values};
    karst_host_tape_points(karst_host_width_best(), &program, tape->output, tape->num_outputs, at, num, level, values);
}

void karst_sampler_densities(karst_sampler *sampler, const karst_position *at, size_t num, double footprint_m,
                             float *density)
{
    const karst_resolved_world *world = &sampler->world->file->program->world;
    const karst_expr root = world->text ? world->text : world->root[KARST_ROOT_DENSITY];
    const bool is_float = world->graph->nodes[root].type == KARST_TYPE_FLOAT;
    const int level = karst_world_level(sampler->world, footprint_m);
    const karst_tape *tape =
        is_float ? find_tape(&sampler->density_tape, &sampler->has_tried_density, sampler->oracle, &root, 1) : NULL;
    if (!tape) {
        for (size_t i = 0; i < num; i++)
            density[i] = karst_sampler_density(sampler, &at[i], footprint_m).device;
        return;
    }
    run(tape, sampler->oracle, at, num, level, &density);
    for (size_t i = 0; sampler->world->models.data && i < num; i++)
        density[i] = karst_sampler_with_models(sampler, &at[i], level, density[i], NULL);
    for (size_t i = 0; sampler->edits.data && i < num; i++)
        density[i] = karst_edit_list_density(&sampler->edits, &at[i], level, density[i]);
}

static void copy_gradient(karst_sampler *sampler, const karst_position *at, double footprint_m, float gradient[3],
                          float *density)
{
    karst_sample slopes[3], value;
    if (!karst_sampler_gradient(sampler, at, footprint_m, slopes, &value))
        return;
    for (int axis = 0; axis < 3; axis++)
        gradient[axis] = slopes[axis].device;
    *density = value.device;
}

/* At most POINTS_AT_ONCE. */
static void find_gradients(karst_sampler *sampler, const karst_tape *tape, const karst_position *at, size_t num,
                           double footprint_m, float (*gradient)[3], float *density)
{
    const int level = karst_world_level(sampler->world, footprint_m);
    float executed[POINTS_AT_ONCE], slopes[3][POINTS_AT_ONCE];
    float *const values[4] = {slopes[0], slopes[1], slopes[2], executed};
    run(tape, sampler->gradient_oracle, at, num, level, values);
    if (sampler->world->file->program->world.text)
        karst_sampler_densities(sampler, at, num, footprint_m, density);
    else
        memcpy(density, executed, num * sizeof *density);
    for (size_t i = 0; i < num; i++) {
        const bool is_flat = karst_sampler_is_flat(sampler, density[i], executed[i]);
        for (int axis = 0; axis < 3; axis++)
            gradient[i][axis] = is_flat ? 0 : slopes[axis][i];
        float of_model[3];
        if (karst_sampler_is_edited(sampler, &at[i], 0) ||
            karst_sampler_is_model(sampler, &at[i], level, executed[i], of_model))
            copy_gradient(sampler, &at[i], footprint_m, gradient[i], &density[i]);
    }
}

bool karst_sampler_gradients(karst_sampler *sampler, const karst_position *at, size_t num, double footprint_m,
                             float (*gradient)[3], float *density)
{
    if (!sampler->gradient_oracle)
        return false;
    const karst_resolved_world *world = &sampler->world->derived->world;
    const karst_expr roots[4] = {world->gradient[0], world->gradient[1], world->gradient[2],
                                 world->root[KARST_ROOT_DENSITY]};
    const karst_tape *tape =
        find_tape(&sampler->gradient_tape, &sampler->has_tried_gradient, sampler->gradient_oracle, roots, 4);
    for (size_t i = 0; !tape && i < num; i++)
        copy_gradient(sampler, &at[i], footprint_m, gradient[i], &density[i]);
    for (size_t i = 0; tape && i < num; i += POINTS_AT_ONCE)
        find_gradients(sampler, tape, at + i, num - i < POINTS_AT_ONCE ? num - i : POINTS_AT_ONCE, footprint_m,
                       gradient + i, density + i);
    return true;
}
