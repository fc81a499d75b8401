/* From a time of day to the light that shading takes. */
#ifndef KARST_RAYCAST_LIGHT_H
#define KARST_RAYCAST_LIGHT_H

#include "raycast/shade_shared.h"

/* The sun where azimuth (a compass bearing) and elevation say, with the colour that it has at this height; no colours
 * of sky and ground, haze or distances yet. Thread-safe. */
karst_light karst_light_of_sun(double azimuth_deg, double elevation_deg);

#endif
