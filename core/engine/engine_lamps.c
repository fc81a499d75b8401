/* What shines in a view, as lamps; and what clear matter a place is in. */
#include <math.h>
#include <string.h>

#include "core/engine/engine_layers.h"
#include "producers/points/points_kind.h"
#include "raycast/light/light.h"
#include "raycast/shadow_shared.h"

/* The sun as a lamp. */
static karst_lamp sun_of(const karst_light *light)
{
    karst_lamp sun = {.kind = KARST_LAMP_SUN, .shadow = 1};
    memcpy(sun.direction, light->sun_direction, 3 * sizeof(float));
    sun.direction[3] = 0.5f * KARST_SUN_CONE;
    memcpy(sun.colour, light->sun_colour, 3 * sizeof(float));
    return sun;
}

static karst_lamp lamp_of(const karst_engine *engine, const karst_world_light *from)
{
    static const uint32_t kinds[] = {[KARST_WORLD_SUN] = KARST_LAMP_SUN,
                                     [KARST_WORLD_POINT] = KARST_LAMP_POINT,
                                     [KARST_WORLD_SPOT] = KARST_LAMP_SPOT};
    const double degree = M_PI / 180, half_rad = from->angle_deg * degree / 2;
    const karst_light towards = karst_light_of_sun(from->azimuth_deg, from->elevation_deg);
    karst_lamp lamp = {.kind = kinds[from->kind], .shadow = from->shadow};
    double away_m[3], strength = 1;
    memcpy(lamp.direction, towards.sun_direction, 3 * sizeof(float));
    lamp.direction[3] = (float)tan(from->size_deg * degree / 2);
    if (from->kind != KARST_WORLD_SUN) {
        const int voxel_log2_m = engine->world->voxel_log2_m;
        karst_position_difference_m(engine->camera.position, from->position, voxel_log2_m, away_m);
        for (int axis = 0; axis < 3; axis++)
            lamp.place[axis] = (float)ldexp(away_m[axis], -voxel_log2_m);
        lamp.place[3] = (float)ldexp(from->radius_m, -voxel_log2_m);
        strength = ldexp(1, -2 * voxel_log2_m); /* of a metre's distance, at a voxel's */
    }
    /* A soft cone begins to fade within its angle, which stays some: kernels divide by it. */
    lamp.dark = (float)cos(half_rad);
    lamp.bright = (float)fmax(cos(half_rad * (1 - from->soft)), lamp.dark + 1e-5);
    for (int c = 0; c < 3; c++)
        lamp.colour[c] = (float)(strength * from->colour[c]);
    return lamp;
}

uint32_t karst_engine_own_lamps(const karst_engine *engine, karst_lamp lamps[KARST_MOST_LAMPS], uint32_t num)
{
    for (uint32_t i = 0; i < engine->world->num_lights; i++)
        lamps[num++] = lamp_of(engine, &engine->world->lights[i]);
    return num;
}

uint32_t karst_engine_lamps(const karst_engine *engine, const karst_light *light, karst_lamp lamps[KARST_MOST_LAMPS])
{
    lamps[0] = sun_of(light);
    const float *sun = lamps[0].colour;
    return karst_engine_own_lamps(engine, lamps, sun[0] > 0 || sun[1] > 0 || sun[2] > 0);
}

bool karst_engine_is_in_clear(const karst_engine *engine, const karst_position *at, float absorption_per_m[3])
{
    const karst_world_file *file = engine->shown.file->content[KARST_CONTENT_CLEAR];
    karst_oracle *oracle = engine->shown.content[KARST_CONTENT_CLEAR].oracle;
    static const float up[KARST_FACING_FLOATS] = {0, 1, 0};
    karst_oracle_value values[KARST_NUM_ROOTS];
    double density = karst_oracle_density(oracle, at, -1).precise;
    const karst_layer *models = karst_engine_world_layer(&engine->shown, &karst_clear_points_kind);
    if (models)
        density = (double)karst_model_list_at(karst_points_layer_list(models), at, -1, (float)density, NULL);
    if (!(density > 0))
        return false;
    if (karst_has_output(file->program->world.root, KARST_OUTPUT_ABSORPTION)) {
        karst_oracle_shading(oracle, at, up, -1, values);
        for (int c = 0; c < 3; c++)
            absorption_per_m[c] = fmaxf(values[KARST_ROOT_ABSORPTION + c].device, 0);
    }
    return true;
}
