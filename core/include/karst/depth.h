/* Depth shared with a rasteriser: Karst's pictures and drawn meshes that hide one another, pixel by pixel.
 *
 * A rasteriser has a depth in [0, 1] for each pixel, which says how far a surface is along the camera's forward axis.
 * Karst has metres along each pixel's ray. These functions turn one into the other, and give the matrix with which a
 * rasteriser sees what Karst's camera sees. Karst's pixels are those of a picture whose top row is first; OpenGL's
 * glReadPixels begins with the lowest row. All functions but karst_engine_set_depth are thread-safe. */
#ifndef KARST_DEPTH_H
#define KARST_DEPTH_H

#include <stdbool.h>
#include <stddef.h>

#include "karst/camera.h"
#include "karst/engine.h"
#include "karst/error.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A rasteriser's depth. With z metres along the forward axis, near n and far f, it is f (z - n) / (z (f - n)): 0 at
 * n and 1 at f, and (z - n) / z where f is INFINITY. Reversed it is one less that. */
typedef struct {
    double near_m; /* above 0, finite */
    double far_m;  /* above near_m; may be INFINITY */
    bool reversed; /* 1 at near_m, 0 at far_m: far places keep the precision of floats */
    /* The matrix is for a clip space whose z goes from 0 to w (Vulkan, Direct3D, glClipControl with GL_ZERO_TO_ONE),
     * not from -w to w (OpenGL as it comes). Depths are the same in both. */
    bool zero_to_one;
} karst_depth_range;

/* Metres along the rays through the pixels' centres to depths; what lies before near_m is clamped to it, what lies
 * beyond far_m, INFINITY and NaN to far_m. width_px * height_px values each, top row first; both may be the same array.
 * Errors: KARST_USAGE (a side outside 1 to 16384, a range that is none). */
bool karst_depth_to_window(const karst_camera *camera, int width_px, int height_px, const karst_depth_range *range,
                           const float *depth_m, float *window, karst_error *error);
/* The inverse: depths to metres along the rays; the far end, and what lies beyond it, becomes INFINITY. What a
 * rasteriser cleared is there, so pixels without a mesh are INFINITY. NaN becomes INFINITY. Errors: as above. */
bool karst_depth_from_window(const karst_camera *camera, int width_px, int height_px, const karst_depth_range *range,
                             const float *window, float *depth_m, karst_error *error);

/* From metres relative to the camera's position, along Karst's axes (x, y up, z), to clip space: 4x4, column by column,
 * as glUniformMatrix4fv and glLoadMatrixf take it. y goes up in clip space. Karst's axes are left-handed as seen by a
 * viewer, so triangles that were counter-clockwise in right-handed data turn when an axis of theirs is negated. Errors:
 * as above. */
bool karst_depth_matrix(const karst_camera *camera, int width_px, int height_px, const karst_depth_range *range,
                        float matrix[16], karst_error *error);

/* Land of the next frames ends where depth_m says, metres along each pixel's ray, top row first, INFINITY where nothing
 * is: what lies behind is not drawn, its pixels show the sky, have a depth of INFINITY, and cast no rays of shadow. So
 * the caller's mesh stands there. Values are copied; NULL and 0 take them away, as another size of the picture and
 * another world do.
 * The samples of a pixel all end at its depth. Land behind is still asked for, so that it is there when the mesh moves.
 * Errors: KARST_USAGE (not width * height values; the world has clear matter or air, which would lie before the mesh;
 * light is KARST_INTEGRATOR_FULL), KARST_FAILED. From the engine's thread. */
bool karst_engine_set_depth(karst_engine *engine, const float *depth_m, size_t num_values, karst_error *error);

#ifdef __cplusplus
}
#endif
#endif
