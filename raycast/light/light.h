/* From a time of day to the light that shading takes. */
#ifndef KARST_RAYCAST_LIGHT_H
#define KARST_RAYCAST_LIGHT_H

#include "raycast/shade_shared.h"

/* The sun where azimuth (a compass bearing) and elevation say, with the colour that it has at this height; no colours
 * of sky and ground, haze or distances yet. Thread-safe. */
karst_light karst_light_of_sun(double azimuth_deg, double elevation_deg);

/* How thick the air is. */
typedef struct {
    double distance_m; /* at which it hides 1 - 1/e of a surface, where it is thickest */
    double height_m;   /* in which it thins to 1/e, going up; 0: it is as thick everywhere */
    double globe_m;    /* 0: heights are y; else they are distances from the origin less this */
} karst_haze;
/* Fills in the light's haze for an eye (metres in the world). */
void karst_light_set_haze(karst_light *light, const karst_haze *haze, const double eye_m[3], double voxel_m);

#endif
