/* A clear atmosphere over a globe: what the sky looks like from a place, and what sunlight is left there.
 *
 * The model: air that scatters as Rayleigh has it and thins to 1/e in 8 km; dust that scatters forwards
 * (Cornette and Shanks 1992, g = 0.8) and thins in 1.2 km; ozone that absorbs, in a layer at 25 km; a ground that
 * reflects 3/10 of what falls on it. Coefficients are those of E. Bruneton, "Precomputed atmospheric scattering: a new
 * implementation" (2017), for 680, 550 and 440 nm. Light that is scattered once is integrated along the ray; light that
 * is scattered again is taken to be the same in all directions; it comes from a table over height and sun, summed order
 * by order.
 *
 * Tables are made on the host, so each device gets the same bits. */
#ifndef KARST_RAYCAST_ATMOSPHERE_H
#define KARST_RAYCAST_ATMOSPHERE_H

#include <stddef.h>

#include "karst/error.h"
#include "raycast/light/atmosphere_shared.h"

typedef struct karst_atmosphere karst_atmosphere;

typedef struct {
    double globe_m; /* radius of the ground, 10^5 to 10^9 */
    double dust;    /* how dusty the air is; 1: a clear day on Earth; 0 to 100 */
} karst_air;

/* The tables that no view changes; some 100 ms. Errors: KARST_FAILED. */
karst_atmosphere *karst_atmosphere_create(const karst_air *air, karst_error *error);
void karst_atmosphere_destroy(karst_atmosphere *atmosphere); /* NULL is fine */

/* What is left of sunlight (RGB, 1: all) in the direction to the sun, whose cosine to the zenith is given, at a height
 * above the ground; lower ones count as the ground. The sun is a disc: it sets within half a degree. Thread-safe. */
void karst_atmosphere_sunlight(const karst_atmosphere *atmosphere, double height_m, double sun_cosine, double rgb[3]);

/* The sky of an eye: what kernels look up, for `sun` times the sun's irradiance above the air. `up` and `to_sun` are
 * unit vectors. Some 7 ms. Thread-safe. */
void karst_atmosphere_sky(const karst_atmosphere *atmosphere, double height_m, const double up[3],
                          const double to_sun[3], double voxel_m, double sun, karst_sky *sky,
                          float table[KARST_SKY_FLOATS]);

/* The irradiance (RGB) of that sky, without the sun, on level ground at the eye; to_sun as for the sky. Thread-safe. */
void karst_atmosphere_skylight(const karst_sky *sky, const float table[KARST_SKY_FLOATS], const double to_sun[3],
                               double rgb[3]);

#endif
