/* Where paths start that tell what light falls on surfaces: at the surfaces themselves. A picture of such light is what
 * light maps are made of (docs/LIGHT.md). */
#ifndef KARST_RAYCAST_PATH_STARTS_H
#define KARST_RAYCAST_PATH_STARTS_H

#include "raycast/cast/cast.h"
#include "raycast/cast/pinhole.h"

typedef struct karst_path_starts karst_path_starts;

/* Errors: KARST_FAILED. */
karst_path_starts *karst_path_starts_create(karst_context *context, karst_error *error);
void karst_path_starts_destroy(karst_path_starts *starts); /* NULL is fine */

/* A ray for each pixel, in packet order, from where its hit is on land into the hemisphere above, as likely as the
 * cosine is large: so the mean of what they see is what a white surface there looks like. `hits` are of the pixels'
 * centres; the sample of the rays is max(1, pinhole->sample). Idle rays and -1 in all three planes of parts where there
 * is no land to look at, or clear matter is before it; else 0 there. parts NULL: left as they are. Asynchronous.
 * Errors: KARST_FAILED. */
bool karst_path_starts_leave(karst_path_starts *starts, const karst_pinhole *pinhole, float detail,
                             const karst_buffer *hits, karst_buffer *rays, karst_buffer *parts, karst_error *error);

#endif
