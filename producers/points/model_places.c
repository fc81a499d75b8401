/* Models at exact places, on the host: see producers/points/model_list.h. */
#include <math.h>

#define POINTS_COLOURED
#include "producers/points/model_list.h"
#include "producers/points/points_places.clh"

/* A place as one lane, at a level that samples may have: footprints below a voxel are a voxel's. */
static world_point_at place_of(const karst_position *at)
{
    world_point_at place;
    for (int a = 0; a < 3; a++) {
        place.voxel[a] = at->voxel[a];
        place.fraction[a] = at->fraction[a];
    }
    return place;
}

static int level_of(int level) { return level > 0 ? level : 0; }

float karst_model_list_at(const karst_model_list *list, const karst_position *at, int level, float density,
                          float gradient[3])
{
    const world_point_at place = place_of(at);
    float none[3];
    return points_at_places((points_data)list->data, &place, level_of(level), density, gradient ? gradient : none,
                            gradient != NULL);
}

void karst_model_list_colour(const karst_model_list *list, const karst_position *at, int level, float density,
                             float over[4])
{
    points_data data = (points_data)list->data;
    const world_point_at place = place_of(at);
    const float width_m = points_voxel(level_of(level)) * POINTS_HEAD(data)->voxel_m;
    for (uint32_t i = 0; i < list->num_models; i++) {
        const karst_model_record *model = &POINTS_MODELS(data)[i];
        const int number = points_level(data, model, points_voxel(level_of(level)) * model->units_per_voxel, 0);
        points_places places;
        vint known;
        float colour[3], cover;
        long sides[3];
        if (number < 0)
            continue;
        const karst_model_level *of = POINTS_LEVELS(data) + model->first_level + number;
        points_margin(model, of, level_of(level), sides);
        points_place_exact(model, sides, &place, level_of(level), &places);
        points_bound_places(model, level_of(level), &places);
        if (!places.near)
            continue;
        points_near near;
        points_begin_near(&near);
        const float value = points_value(data, model, of, &places, &near, &known, model->has_colours ? colour : NULL);
        if (known && model->has_colours) {
            cover = fminf(fmaxf((value - density) / width_m + 1, 0), 1);
            for (int part = 0; part < 4; part++)
                over[part] += ((part < 3 ? colour[part] : 1) - over[part]) * cover;
        }
        density = known && value > density ? value : density;
    }
}

/* The box in units of a model, a little too large; false: it is so far off, or so large, that it does not fit. */
static bool box_in_units(const karst_model_record *model, const karst_position *centre, const double half_voxels[3],
                         points_box *box)
{
    double from[3];
    for (int a = 0; a < 3; a++) {
        from[a] = (double)(centre->voxel[a] - model->at[a]) + ldexp((double)centre->fraction[a], -32);
        if (!(fabs(from[a]) + half_voxels[a] < 0x1p40))
            return false;
    }
    for (int row = 0; row < 3; row++) {
        double middle = (double)model->offset[row], extent = 0;
        for (int a = 0; a < 3; a++) {
            middle += (double)model->matrix[3 * row + a] * from[a];
            extent += fabs((double)model->matrix[3 * row + a]) * (half_voxels[a] + fabs(from[a]) * 0x1p-40);
        }
        box->min[row] = (long)floor(ldexp(middle - extent, -model->shift)) - 2;
        box->max[row] = (long)ceil(ldexp(middle + extent, -model->shift)) + 2;
    }
    return true;
}

void karst_model_list_range(const karst_model_list *list, const karst_position *centre, const double half_voxels[3],
                            int level, double range[2])
{
    points_data data = (points_data)list->data;
    for (uint32_t i = 0; i < list->num_models; i++) {
        const karst_model_record *model = &POINTS_MODELS(data)[i];
        const float apart = points_voxel(level_of(level)) * model->units_per_voxel;
        const karst_model_level *of = POINTS_LEVELS(data) + model->first_level + points_level(data, model, apart, 1);
        const double least = ceil((double)(POINTS_LEAST_REACH * apart)) + 1;
        points_box box = {.least = least < 0x1p42 ? (long)least : 1L << 42, .of_cover = 1};
        uint leaf = 0;
        bool meets = true;
        for (int a = 0; a < 3 && meets; a++) { /* without a number of units */
            const double side =
                (double)model->extent[a] + (fmax(of->cover, least + of->spread) + 4) / (double)model->units_per_voxel;
            meets = fabs((double)(centre->voxel[a] - model->at[a])) <= (side + half_voxels[a] + 2) * (1 + 0x1p-40);
        }
        if (!meets)
            continue;
        const bool fits = box_in_units(model, centre, half_voxels, &box);
        if (model->solid.levels && (!fits || points_solid_box(data, &model->solid, box.min, box.max)))
            range[1] = fmax(range[1], (double)(POINTS_MOST_VOXELS_OF_AIR * points_voxel(level_of(level))) *
                                          (double)POINTS_HEAD(data)->voxel_m);
        if (fits && !points_next_leaf(data, of, &box, &leaf))
            continue;
        /* No height is larger than the support that it is of. */
        range[1] = fmax(range[1], fmax(of->cover, least + of->spread) * (double)model->m_per_unit * (1 + 0x1p-20));
    }
}
