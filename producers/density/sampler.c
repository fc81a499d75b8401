#include "producers/density/sampler_internal.h"
#include "producers/density/sampler_slopes.h"

#include <math.h>
#include <stdlib.h>

#include "producers/language/tape/tape.clh"

#define MAX_LEVEL 40

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
    karst_edit_list_finish(&sampler->edits);
    karst_tape_finish(&sampler->density_tape);
    karst_tape_finish(&sampler->gradient_tape);
    free(sampler->slots);
    free(sampler);
}

bool karst_sampler_set_edits(karst_sampler *sampler, const karst_edit *edits, size_t num_edits, karst_error *error)
{
    karst_edit_list list;
    if (!karst_edit_list_init(&list, sampler->world->metadata.voxel_log2_m, error))
        return false;
    if (!karst_edit_list_append(&list, edits, num_edits, error)) {
        karst_edit_list_finish(&list);
        return false;
    }
    karst_edit_list_finish(&sampler->edits);
    sampler->edits = list;
    return true;
}

bool karst_sampler_append_edits(karst_sampler *sampler, const karst_edit *edits, size_t num_edits, karst_error *error)
{
    if (!sampler->edits.data)
        return karst_sampler_set_edits(sampler, edits, num_edits, error);
    return karst_edit_list_append(&sampler->edits, edits, num_edits, error);
}

size_t karst_sampler_keep_edits(karst_sampler *sampler, size_t num)
{
    if (!sampler->edits.data)
        return 0;
    karst_edit_list_set_num(&sampler->edits, num < KARST_MAX_EDITS ? (uint32_t)num : KARST_MAX_EDITS);
    return karst_edit_list_num(&sampler->edits);
}

bool karst_sampler_is_edited(const karst_sampler *sampler, const karst_position *at, double half_m)
{
    return sampler->edits.data &&
           karst_edit_list_touches(&sampler->edits, at, ldexp(half_m, -sampler->world->metadata.voxel_log2_m));
}

/* The albedo of what has no colour, where edits cover a part of it: as meshes have it. */
#define KARST_NO_COLOUR 0.5f

static karst_sample sample_of(karst_oracle_value value) { return (karst_sample){value.device, value.precise}; }

float karst_sampler_with_models(const karst_sampler *sampler, const karst_position *at, int level, float density,
                                float gradient[3])
{
    const karst_model_list *models = &sampler->world->models;
    return models->data ? karst_model_list_at(models, at, level, density, gradient) : density;
}

/* Models are told in floats: what they leave alone stays as precise as it is. */
static double precise_with_models(const karst_sampler *sampler, const karst_position *at, int level, double precise)
{
    const float rounded = (float)precise, with = karst_sampler_with_models(sampler, at, level, rounded, NULL);
    return with != rounded ? (double)with : precise;
}

karst_sample karst_sampler_density(karst_sampler *sampler, const karst_position *at, double footprint_m)
{
    int level = karst_world_level(sampler->world, footprint_m);
    karst_sample sample = sample_of(karst_oracle_text_density(sampler->oracle, at, level));
    sample.device = karst_sampler_with_models(sampler, at, level, sample.device, NULL);
    sample.precise = precise_with_models(sampler, at, level, sample.precise);
    if (sampler->edits.data) {
        sample.device = karst_edit_list_density(&sampler->edits, at, level, sample.device);
        sample.precise = karst_edit_list_precise_density(&sampler->edits, at, level, sample.precise);
    }
    return sample;
}

double karst_sampler_precise_density(karst_sampler *sampler, const karst_position *at, double footprint_m)
{
    int level = karst_world_level(sampler->world, footprint_m);
    double precise = sampler->world->file->program->world.text
                         ? karst_oracle_text_density(sampler->oracle, at, level).precise
                         : karst_oracle_precise_density(sampler->oracle, at, level);
    precise = precise_with_models(sampler, at, level, precise);
    return sampler->edits.data ? karst_edit_list_precise_density(&sampler->edits, at, level, precise) : precise;
}

bool karst_sampler_is_model(const karst_sampler *sampler, const karst_position *at, int level, float density,
                            float gradient[3])
{
    return sampler->world->models.data && karst_sampler_with_models(sampler, at, level, density, gradient) != density;
}

/* Near edits: central differences. */
static void edited_gradient(karst_sampler *sampler, const karst_position *at, double footprint_m,
                            karst_sample gradient[3], karst_sample *density)
{
    const int voxel_log2_m = sampler->world->metadata.voxel_log2_m;
    double step_m = fmax(footprint_m / 4, ldexp(1, voxel_log2_m - 6));
    for (int axis = 0; axis < 3; axis++) {
        double offset_m[3] = {0}, ends[2];
        for (int end = 0; end < 2; end++) {
            offset_m[axis] = end ? step_m : -step_m;
            karst_position place = karst_position_add_m(*at, offset_m, voxel_log2_m);
            ends[end] = karst_sampler_precise_density(sampler, &place, footprint_m);
        }
        gradient[axis].precise = (ends[1] - ends[0]) / (2 * step_m);
        gradient[axis].device = (float)gradient[axis].precise;
    }
    if (density)
        *density = karst_sampler_density(sampler, at, footprint_m);
}

bool karst_sampler_is_flat(const karst_sampler *sampler, float text, float executed)
{
    const karst_resolved_world *world = &sampler->world->file->program->world;
    return world->text && (world->graph->nodes[world->text].kind == KARST_KIND_STEPS || (text == 0 && executed != 0));
}

bool karst_sampler_gradient(karst_sampler *sampler, const karst_position *at, double footprint_m,
                            karst_sample gradient[3], karst_sample *density)
{
    karst_oracle_value values[3];
    if (karst_sampler_is_edited(sampler, at, 0)) {
        edited_gradient(sampler, at, footprint_m, gradient, density);
        return true;
    }
    if (!sampler->gradient_oracle)
        return false;
    karst_oracle_value value =
        karst_oracle_gradient(sampler->gradient_oracle, at, karst_world_level(sampler->world, footprint_m), values);
    karst_sample text = sample_of(value);
    if (sampler->world->file->program->world.text)
        text = karst_sampler_density(sampler, at, footprint_m);
    bool is_flat = karst_sampler_is_flat(sampler, text.device, value.device);
    for (int axis = 0; axis < 3; axis++)
        gradient[axis] = is_flat ? (karst_sample){0, 0} : sample_of(values[axis]);
    float of_model[3];
    const int level = karst_world_level(sampler->world, footprint_m);
    if (karst_sampler_is_model(sampler, at, level, karst_oracle_text_density(sampler->oracle, at, level).device,
                               of_model)) {
        for (int axis = 0; axis < 3; axis++)
            gradient[axis] = (karst_sample){of_model[axis], (double)of_model[axis]};
        text = karst_sampler_density(sampler, at, footprint_m);
    }
    if (density)
        *density = text;
    return true;
}

bool karst_sampler_colour(karst_sampler *sampler, const karst_position *at, const float normal[3], double footprint_m,
                          karst_sample rgb[3])
{
    karst_oracle_value values[3];
    const bool has_colour = sampler->world->metadata.has_colour;
    const int level = karst_world_level(sampler->world, footprint_m);
    float over[4] = {0};
    double precisely_over[4] = {0};
    karst_oracle_value own = {0};
    if (sampler->edits.data || sampler->world->models.data)
        own = karst_oracle_text_density(sampler->oracle, at, level);
    if (sampler->world->models.data) {
        karst_model_list_colour(&sampler->world->models, at, level, own.device, over);
        for (int i = 0; i < 4; i++)
            precisely_over[i] = (double)over[i];
        own.device = karst_sampler_with_models(sampler, at, level, own.device, NULL);
        own.precise = precise_with_models(sampler, at, level, own.precise);
    }
    if (sampler->edits.data) {
        karst_edit_list_colour(&sampler->edits, at, level, own.device, over);
        karst_edit_list_precise(&sampler->edits, at, level, own.precise, precisely_over);
    }
    if (!has_colour && over[3] == 0)
        return false;
    const float facing[KARST_FACING_FLOATS] = {normal[0], normal[1], normal[2]}; /* nobody looks */
    if (has_colour)
        karst_oracle_colour(sampler->oracle, at, facing, level, values);
    for (int i = 0; i < 3; i++) {
        rgb[i] = has_colour ? sample_of(values[i]) : (karst_sample){KARST_NO_COLOUR, (double)KARST_NO_COLOUR};
        rgb[i].device = over[3] > 0 ? over[i] + (1 - over[3]) * rgb[i].device : rgb[i].device;
        rgb[i].precise = precisely_over[i] + (1 - precisely_over[3]) * rgb[i].precise;
    }
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

static karst_sampler_slopes slopes_of(const karst_sampler *sampler, const op_bound *density)
{
    const karst_world *world = sampler->world;
    const double voxels_in_m = ldexp(1, -world->metadata.voxel_log2_m);
    karst_sampler_slopes slopes = {.slack = (double)bounds_spread(density->r) + (double)density->d};
    slopes.is_known = !world->models.data && !sampler->edits.data && !world->file->program->world.text &&
                      isfinite(slopes.slack);
    for (int axis = 0; axis < 3; axis++) {
        slopes.in_m[axis] = (double)iv_magnitude(density->g[axis]) * voxels_in_m;
        slopes.is_known = slopes.is_known && isfinite(slopes.in_m[axis]);
    }
    return slopes;
}

bool karst_sampler_prove(karst_sampler *sampler, const karst_position *centre, const double half_m[3],
                         double footprint_m, double range[2], karst_sampler_slopes *slopes)
{
    if (slopes)
        slopes->is_known = false;
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
    if (slopes)
        *slopes = slopes_of(sampler, &density);
    const karst_program_graph *program_graph = world->file->program;
    if (program_graph->world.text)
        bound_text(program_graph, range);
    const double half_voxels[3] = {(double)box.radius[0], (double)box.radius[1], (double)box.radius[2]};
    if (world->models.data)
        karst_model_list_range(&world->models, centre, half_voxels, box.level, range);
    if (sampler->edits.data && !karst_edit_list_range(&sampler->edits, centre, half_voxels, box.level, range)) {
        range[0] = -(double)INFINITY;
        range[1] = (double)INFINITY;
        return false;
    }
    return true;
}

bool karst_sampler_bounds(karst_sampler *sampler, const karst_position *centre, const double half_m[3],
                          double footprint_m, double range[2])
{
    return karst_sampler_prove(sampler, centre, half_m, footprint_m, range, NULL);
}
