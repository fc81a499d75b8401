#include "raycast/light/light.h"

#include <math.h>
#include <stdbool.h>

karst_light karst_light_of_sun(double azimuth_deg, double elevation_deg)
{
    double azimuth = azimuth_deg * (M_PI / 180), elevation = elevation_deg * (M_PI / 180);
    karst_light light = {.haze_distance = 0};
    light.sun_direction[0] = (float)(sin(azimuth) * cos(elevation));
    light.sun_direction[1] = (float)sin(elevation);
    light.sun_direction[2] = (float)(cos(azimuth) * cos(elevation));
    /* Air scatters blue out of low sunlight: from orange at the horizon to a warm white overhead. */
    double height = fmin(1, fmax(0, sin(elevation)) / 0.6);
    light.sun_colour[0] = 2.4f;
    light.sun_colour[1] = (float)(1.5 + 0.7 * height);
    light.sun_colour[2] = (float)(0.85 + 1.1 * height);
    return light;
}

void karst_light_set_haze(karst_light *light, const karst_haze *haze, const double eye_m[3], double voxel_m)
{
    double from_centre_m = sqrt(eye_m[0] * eye_m[0] + eye_m[1] * eye_m[1] + eye_m[2] * eye_m[2]);
    bool globe = haze->globe_m > 0 && from_centre_m > 0;
    double height_m = globe ? from_centre_m - haze->globe_m : eye_m[1];
    light->haze_distance = (float)(haze->distance_m / voxel_m);
    light->haze_thinning = haze->height_m > 0 ? (float)(voxel_m / haze->height_m) : 0;
    light->eye_height = haze->height_m > 0 ? (float)fmax(0, height_m / haze->height_m) : 0;
    for (int axis = 0; axis < 3; axis++)
        light->up[axis] = (float)(globe ? eye_m[axis] / from_centre_m : axis == 1);
    light->up[3] = globe ? (float)(voxel_m / from_centre_m) : 0;
}
