#include "raycast/light.h"

#include <math.h>

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
