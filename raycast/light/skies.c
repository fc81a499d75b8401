/* Skies of an atmosphere: see raycast/light/skies.h. */
#include "raycast/light/skies.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* The light of the sun above the air, as white ground under it at the zenith shows it: what the sun has at noon without
 * an atmosphere (raycast/light/light.c), plus what the air takes. */
#define SUN_LIGHT 2.7
#define EARTH_M 6360000.0

struct karst_skies {
    karst_atmosphere *atmosphere;
    karst_buffer *buffer;
    karst_sky sky;
    karst_sky_view view;
    bool is_aimed;
    float sun_colour[3], sky_colour[3];
    float table[KARST_SKY_FLOATS];
};

karst_skies *karst_skies_create(karst_context *context, double globe_m, double dust, karst_error *error)
{
    const karst_air air = {globe_m > 0 ? globe_m : EARTH_M, dust};
    karst_skies *skies = calloc(1, sizeof *skies);
    if (!skies) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    skies->atmosphere = karst_atmosphere_create(&air, error);
    if (skies->atmosphere && context)
        skies->buffer = karst_buffer_create_blank(context, "sky", sizeof skies->table, error);
    if (!skies->atmosphere || (context && !skies->buffer)) {
        karst_skies_destroy(skies);
        return NULL;
    }
    return skies;
}

void karst_skies_destroy(karst_skies *skies)
{
    if (!skies)
        return;
    karst_buffer_destroy(skies->buffer);
    karst_atmosphere_destroy(skies->atmosphere);
    free(skies);
}

static bool is_same(const karst_sky_view *a, const karst_sky_view *b)
{
    bool same = a->globe_m == b->globe_m && a->voxel_m == b->voxel_m;
    for (int axis = 0; axis < 3; axis++)
        same = same && a->sun_direction[axis] == b->sun_direction[axis] &&
               (a->eye_m[axis] == b->eye_m[axis] || (a->globe_m == 0 && axis != 1));
    return same;
}

bool karst_skies_aim(karst_skies *skies, const karst_sky_view *view, karst_error *error)
{
    if (skies->is_aimed && is_same(&skies->view, view))
        return true;
    double up[3] = {0, 1, 0}, to_sun[3], height_m = view->eye_m[1], light[3];
    const double *eye_m = view->eye_m;
    const double from_centre_m = sqrt(eye_m[0] * eye_m[0] + eye_m[1] * eye_m[1] + eye_m[2] * eye_m[2]);
    if (view->globe_m > 0 && from_centre_m > 0) {
        height_m = from_centre_m - view->globe_m;
        for (int axis = 0; axis < 3; axis++)
            up[axis] = eye_m[axis] / from_centre_m;
    }
    double cosine = 0;
    for (int axis = 0; axis < 3; axis++) {
        to_sun[axis] = (double)view->sun_direction[axis];
        cosine += up[axis] * to_sun[axis];
    }
    karst_atmosphere_sky(skies->atmosphere, height_m, up, to_sun, view->voxel_m, SUN_LIGHT * M_PI, &skies->sky,
                         skies->table);
    karst_atmosphere_sunlight(skies->atmosphere, height_m, cosine, light);
    for (int c = 0; c < 3; c++)
        skies->sun_colour[c] = (float)(SUN_LIGHT * light[c]);
    karst_atmosphere_skylight(&skies->sky, skies->table, to_sun, light);
    for (int c = 0; c < 3; c++)
        skies->sky_colour[c] = (float)(light[c] / M_PI);
    skies->view = *view;
    skies->is_aimed = !skies->buffer || karst_buffer_write(skies->buffer, 0, skies->table, sizeof skies->table, error);
    return skies->is_aimed;
}

const karst_sky *karst_skies_sky(const karst_skies *skies) { return &skies->sky; }
const float *karst_skies_table(const karst_skies *skies) { return skies->table; }
karst_buffer *karst_skies_buffer(karst_skies *skies) { return skies->buffer; }

void karst_skies_light(const karst_skies *skies, karst_light *light)
{
    memcpy(light->sun_colour, skies->sun_colour, sizeof skies->sun_colour);
    memcpy(light->sky_zenith, skies->sky_colour, sizeof skies->sky_colour);
    memcpy(light->sky_horizon, skies->sky_colour, sizeof skies->sky_colour);
}
