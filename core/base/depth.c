/* A rasteriser's depth and metres along rays. Both are linear in 1 / z, so nothing is lost but by the last rounding. */
#include "karst/depth.h"

#include <math.h>

enum { MAX_SIDE_PX = 16384 };

typedef struct {
    double half_width, half_height; /* of the picture at a distance of 1 along the forward axis */
    double per_column, per_row;
    double scale, near_m, far_m; /* depth = scale * (1 - near_m / z); scale = f / (f - n) */
    bool reversed;
} frustum;

static bool make_frustum(const karst_camera *camera, int width_px, int height_px, const karst_depth_range *range,
                         frustum *f, karst_error *error)
{
    if (width_px < 1 || width_px > MAX_SIDE_PX || height_px < 1 || height_px > MAX_SIDE_PX)
        return karst_fail(error, KARST_USAGE, "a picture of %dx%d: each side is 1 to %d", width_px, height_px,
                          MAX_SIDE_PX);
    if (!(range->near_m > 0) || !isfinite(range->near_m) || !(range->far_m > range->near_m))
        return karst_fail(error, KARST_USAGE, "depth from %g to %g m: near is above 0, and far beyond it",
                          range->near_m, range->far_m);
    f->half_height = tan(camera->fov_deg * (M_PI / 360));
    f->half_width = f->half_height * width_px / height_px;
    f->per_column = 2 * f->half_width / width_px;
    f->per_row = 2 * f->half_height / height_px;
    f->near_m = range->near_m;
    f->far_m = range->far_m;
    f->scale = isinf(range->far_m) ? 1 : range->far_m / (range->far_m - range->near_m);
    f->reversed = range->reversed;
    return true;
}

/* How much longer a pixel's ray is than its way along the forward axis. */
static double stretch(const frustum *f, int x, int y)
{
    const double across = (x + 0.5) * f->per_column - f->half_width, up = f->half_height - (y + 0.5) * f->per_row;
    return sqrt(1 + across * across + up * up);
}

/* Kept in the form that does not cancel: near 0 of a reversed depth are the far places. */
static double depth_at(const frustum *f, double z_m)
{
    if (!(z_m < f->far_m)) /* NaN, too */
        return f->reversed ? 0 : 1;
    if (!(z_m > f->near_m))
        return f->reversed ? 1 : 0;
    if (!f->reversed)
        return f->scale * (z_m - f->near_m) / z_m;
    return isinf(f->far_m) ? f->near_m / z_m : f->near_m * (f->far_m - z_m) / (z_m * (f->far_m - f->near_m));
}

static double z_at(const frustum *f, double depth)
{
    if (!(f->reversed ? depth > 0 : depth < 1))
        return INFINITY;
    if (f->reversed ? depth > 1 : depth < 0)
        return f->near_m;
    if (!f->reversed)
        return f->near_m / (1 - depth / f->scale);
    return isinf(f->far_m) ? f->near_m / depth : f->near_m * f->far_m / (f->near_m + depth * (f->far_m - f->near_m));
}

bool karst_depth_to_window(const karst_camera *camera, int width_px, int height_px, const karst_depth_range *range,
                           const float *depth_m, float *window, karst_error *error)
{
    frustum f;
    if (!make_frustum(camera, width_px, height_px, range, &f, error))
        return false;
    for (int y = 0; y < height_px; y++)
        for (int x = 0; x < width_px; x++)
            *window++ = (float)depth_at(&f, *depth_m++ / stretch(&f, x, y));
    return true;
}

bool karst_depth_from_window(const karst_camera *camera, int width_px, int height_px, const karst_depth_range *range,
                             const float *window, float *depth_m, karst_error *error)
{
    frustum f;
    if (!make_frustum(camera, width_px, height_px, range, &f, error))
        return false;
    for (int y = 0; y < height_px; y++)
        for (int x = 0; x < width_px; x++)
            *depth_m++ = (float)(z_at(&f, *window++) * stretch(&f, x, y));
    return true;
}

bool karst_depth_matrix(const karst_camera *camera, int width_px, int height_px, const karst_depth_range *range,
                        float matrix[16], karst_error *error)
{
    frustum f;
    if (!make_frustum(camera, width_px, height_px, range, &f, error))
        return false;
    double right[3], up[3], forward[3];
    karst_camera_axes(camera, right, up, forward);
    /* depth * w = a z + b, with w = z. */
    double a = f.scale, b = -f.scale * f.near_m;
    if (f.reversed)
        a = 1 - a, b = -b;
    if (!range->zero_to_one)
        a = 2 * a - 1, b = 2 * b;
    for (int axis = 0; axis < 3; axis++) {
        float *column = matrix + 4 * axis;
        column[0] = (float)(right[axis] / f.half_width);
        column[1] = (float)(up[axis] / f.half_height);
        column[2] = (float)(a * forward[axis]);
        column[3] = (float)forward[axis];
    }
    matrix[12] = matrix[13] = matrix[15] = 0;
    matrix[14] = (float)b;
    return true;
}
