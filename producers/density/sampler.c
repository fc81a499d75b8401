#include "producers/density/world_internal.h"

#include <math.h>
#include <stdlib.h>

#include "producers/language/tape/tape.clh"

#define MAX_LEVEL 40

struct karst_sampler {
    const karst_world *world;
    karst_oracle *oracle, *gradient_oracle;
    int *slots; /* of the bounds' tape */
};

int karst_world_level(const karst_world *world, double footprint_m)
{
    double voxels = ldexp(footprint_m, -world->metadata.voxel_log2_m);
    if (!(voxels >= 1))
        return -1;
    int level = ilogb(voxels);
    return level < MAX_LEVEL ? level : MAX_LEVEL;
}

karst_sampler *karst_sampler_create(const karst_world *world, karst_error *error)
{
    karst_sampler *sampler = calloc(1, sizeof *sampler);
    if (sampler) {
        sampler->world = world;
        sampler->oracle = karst_oracle_clone(world->oracle, error);
        sampler->gradient_oracle = world->gradient_oracle ? karst_oracle_clone(world->gradient_oracle, error) : NULL;
        sampler->slots = calloc((size_t)world->file->tape.num_slots * TAPE_BOUND_ELEMENTS, sizeof *sampler->slots);
    }
    if (sampler && sampler->oracle && sampler->slots && (sampler->gradient_oracle || !world->gradient_oracle))
        return sampler;
    karst_fail(error, KARST_FAILED, "out of memory");
    karst_sampler_destroy(sampler);
    return NULL;
}

void karst_sampler_destroy(karst_sampler *sampler)
{
    if (!sampler)
        return;
    karst_oracle_destroy(sampler->oracle);
    karst_oracle_destroy(sampler->gradient_oracle);
    free(sampler->slots);
    free(sampler);
}

static karst_sample sample_of(karst_oracle_value value) { return (karst_sample){value.device, value.precise}; }

karst_sample karst_sampler_density(karst_sampler *sampler, const karst_position *at, double footprint_m)
{
    return sample_of(karst_oracle_text_density(sampler->oracle, at, karst_world_level(sampler->world, footprint_m)));
}

double karst_sampler_precise_density(karst_sampler *sampler, const karst_position *at, double footprint_m)
{
    int level = karst_world_level(sampler->world, footprint_m);
    return sampler->world->file->program->world.text ? karst_oracle_text_density(sampler->oracle, at, level).precise
                                                     : karst_oracle_precise_density(sampler->oracle, at, level);
}

bool karst_sampler_gradient(karst_sampler *sampler, const karst_position *at, double footprint_m,
                            karst_sample gradient[3], karst_sample *density)
{
    karst_oracle_value values[3];
    if (!sampler->gradient_oracle)
        return false;
    karst_oracle_value value =
        karst_oracle_gradient(sampler->gradient_oracle, at, karst_world_level(sampler->world, footprint_m), values);
    /* Where the text's density is another one it is flat. */
    karst_sample text = sample_of(value);
    const karst_resolved_world *resolved = &sampler->world->file->program->world;
    if (resolved->text)
        text = karst_sampler_density(sampler, at, footprint_m);
    bool is_flat = resolved->text && (resolved->graph->nodes[resolved->text].kind == KARST_KIND_STEPS ||
                                      (text.device == 0 && value.device != 0));
    for (int axis = 0; axis < 3; axis++)
        gradient[axis] = is_flat ? (karst_sample){0, 0} : sample_of(values[axis]);
    if (density)
        *density = text;
    return true;
}

bool karst_sampler_colour(karst_sampler *sampler, const karst_position *at, const float normal[3], double footprint_m,
                          karst_sample rgb[3])
{
    karst_oracle_value values[3];
    if (!sampler->world->metadata.has_colour)
        return false;
    karst_oracle_colour(sampler->oracle, at, normal, karst_world_level(sampler->world, footprint_m), values);
    for (int i = 0; i < 3; i++)
        rgb[i] = sample_of(values[i]);
    return true;
}

/* Voxels as a float that is not less. */
static float rounded_up(double voxels)
{
    float nearest = (float)voxels;
    return (double)nearest >= voxels ? nearest : nextafterf(nearest, INFINITY);
}

/* From the range of the density that is executed to that of the text's (deepen.h). */
static void bound_text(const karst_program_graph *program, double range[2])
{
    const karst_resolved_world *world = &program->world;
    if (world->graph->nodes[world->text].kind != KARST_KIND_STEPS) {
        range[1] = fmax(range[1], 0);
        return;
    }
    double lo = program->text_range[0], hi = program->text_range[1];
    bool is_solid = range[0] > 0, is_air = range[1] <= 0;
    range[0] = is_solid ? fmax(lo, 0) : lo;
    range[1] = is_air ? fmin(hi, 0) : hi;
}

bool karst_sampler_bounds(karst_sampler *sampler, const karst_position *centre, const double half_m[3],
                          double footprint_m, double range[2])
{
    const karst_world *world = sampler->world;
    const karst_tape *tape = &world->file->tape;
    const karst_world_layout *layout = &world->file->layout;
    tape_program program = {.code = tape->code,
                            .num_instructions = tape->num_instructions,
                            .constants = tape->constants,
                            .data = world->data,
                            .values = (const uint *)(world->data + layout->values_word),
                            .num_values = layout->num_values,
                            .slots = sampler->slots};
    op_box box = {.level = karst_world_level(world, footprint_m)};
    bool known = true;
    for (int axis = 0; axis < 3; axis++) {
        box.centre.voxel[axis] = centre->voxel[axis];
        box.centre.fraction[axis] = centre->fraction[axis];
        box.radius[axis] = rounded_up(ldexp(fabs(half_m[axis]), -world->metadata.voxel_log2_m));
        known = known && isfinite(box.radius[axis]);
    }
    range[0] = -(double)INFINITY;
    range[1] = (double)INFINITY;
    if (!known || tape_bounds(&program, &box, NULL))
        return false;
    op_bound density = tape_load_bound(&program, tape->output[0]);
    if (!isfinite(density.v.lo) || !isfinite(density.v.hi))
        return false;
    range[0] = (double)density.v.lo;
    range[1] = (double)density.v.hi;
    const karst_program_graph *program_graph = world->file->program;
    if (program_graph->world.text)
        bound_text(program_graph, range);
    return true;
}
