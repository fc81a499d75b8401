/* The skies of a world with an atmosphere: made anew as its eye or its sun moves, for the shading kernels. */
#ifndef KARST_RAYCAST_SKIES_H
#define KARST_RAYCAST_SKIES_H

#include "core/device/context.h"
#include "raycast/light/atmosphere.h"
#include "raycast/shade_shared.h"

typedef struct karst_skies karst_skies;

/* What a sky is seen from. */
typedef struct {
    double eye_m[3]; /* in the world */
    double globe_m;  /* 0: heights are y, over ground that bends as the Earth does; else they are distances from the
                      * origin less this */
    float sun_direction[3];
    double voxel_m;
} karst_sky_view;

/* dust: as in karst_air; context NULL: for the host alone. Takes some 0.1 s. Errors: KARST_FAILED. */
karst_skies *karst_skies_create(karst_context *context, double globe_m, double dust, karst_error *error);
void karst_skies_destroy(karst_skies *skies); /* NULL is fine */

/* Makes the sky of a view, unless it is the one at hand. Not while kernels read it are enqueued without an order
 * between them and this. Errors: KARST_FAILED. */
bool karst_skies_aim(karst_skies *skies, const karst_sky_view *view, karst_error *error);
/* The sky at hand: its own light, and the colours of sun and sky that surfaces at the eye have in `light`. */
const karst_sky *karst_skies_sky(const karst_skies *skies);
const float *karst_skies_table(const karst_skies *skies);
karst_buffer *karst_skies_buffer(karst_skies *skies); /* the table, on the device */
void karst_skies_light(const karst_skies *skies, karst_light *light);

#endif
