/* What models are made of, from a world's header into its program: see producers/points/points_kind.h. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/base/beside.h"
#include "core/points/points_file.h"
#include "producers/points/points_kind.h"

/* Outside the box of its points a surface lies by that much at most. */
#define MARGIN_SPACINGS 2.0

static bool is_given(const karst_header_material *m)
{
    return m->has_colour || m->has_mirror || m->has_gloss || m->has_emission || m->has_ior || m->has_absorption;
}

static void give(karst_model_material *to, bool has, karst_output output, const double *values)
{
    to->has[output] = has;
    for (uint32_t i = 0; has && i < karst_outputs[output].num_floats; i++)
        to->value[karst_outputs[output].root + i] = values[i];
}

static karst_number number_of(const char *text)
{
    return *text == '-' ? karst_number_negate(karst_number_decimal(text + 1, strlen(text + 1)))
                        : karst_number_decimal(text, strlen(text));
}

static bool place_box(const karst_program_graph *program, const karst_header_model *from, karst_model_material *to,
                      karst_error *error)
{
    karst_points_head head;
    double r[3][3];
    char *path = malloc(KARST_BESIDE_BYTES);
    if (!path)
        return karst_fail(error, KARST_FAILED, "out of memory");
    const int fd =
        karst_path_beside(program->name, from->points, path, error) ? karst_points_open(path, &head, error) : -1;
    free(path);
    if (fd < 0)
        return false;
    close(fd);
    karst_model_rotation(from->turn_deg, r);
    to->margin_m = MARGIN_SPACINGS * head.spacing * from->scale;
    for (int side = 0; side < 3; side++) {
        to->at[side] = number_of(from->at[side]);
        to->half_m[side] = (head.max[side] - head.min[side]) / 2 * from->scale;
        for (int axis = 0; axis < 3; axis++)
            to->axes[side][axis] = r[axis][side];
    }
    return true;
}

/* Whether clear matter is of this kind wherever there is any. */
static bool is_all_clear_matter(const karst_program_graph *program, const karst_header_material *m)
{
    const karst_world_header *header = &program->header;
    bool is_all = !program->has_entry[KARST_ENTRY_CLEAR];
    for (uint32_t i = 0; is_all && i < header->num_models; i++)
        is_all = !header->models[i].is_clear || memcmp(&header->models[i].material, m, sizeof *m) == 0;
    return is_all;
}

bool karst_take_model_materials(karst_program_graph *program, const float plain[2][3], karst_error *error)
{
    const karst_world_header *header = &program->header;
    karst_model_material *all = calloc(header->num_models + 1, sizeof *all);
    size_t num = 0;
    bool done = all || karst_fail(error, KARST_FAILED, "out of memory");
    for (uint32_t i = 0; done && i < header->num_models; i++) {
        const karst_header_material *m = &header->models[i].material;
        karst_model_material *to = &all[num];
        if (!is_given(m))
            continue;
        num++;
        to->is_clear = header->models[i].is_clear;
        to->is_everywhere = to->is_clear && is_all_clear_matter(program, m);
        give(to, m->has_colour, KARST_OUTPUT_COLOUR, m->colour);
        give(to, m->has_mirror, KARST_OUTPUT_MIRROR, &m->mirror);
        give(to, m->has_gloss, KARST_OUTPUT_GLOSS, &m->gloss);
        give(to, m->has_emission, KARST_OUTPUT_EMISSION, m->emission);
        give(to, m->has_ior, KARST_OUTPUT_IOR, &m->ior);
        give(to, m->has_absorption, KARST_OUTPUT_ABSORPTION, m->absorption);
        done = to->is_everywhere || place_box(program, &header->models[i], to, error);
    }
    if (done && num && !karst_program_add_materials(program, all, num, plain))
        done = karst_fail(error, KARST_BAD_WORLD, "%.300s: it is too large with the materials of its models",
                          program->name);
    free(all);
    return done;
}
