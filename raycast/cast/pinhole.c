#include "raycast/cast/pinhole.h"

#include <math.h>

static void set3(float out[4], const double in[3])
{
    for (int axis = 0; axis < 3; axis++)
        out[axis] = (float)in[axis];
    out[3] = 0;
}

void karst_pinhole_init(karst_pinhole *pinhole, const karst_camera *camera, int width_px, int height_px,
                        double view_distance_voxels)
{
    double right[3], up[3], forward[3];
    *pinhole = (karst_pinhole){.width_px = width_px, .height_px = height_px};
    karst_camera_axes(camera, right, up, forward);
    set3(pinhole->right, right);
    set3(pinhole->up, up);
    set3(pinhole->forward, forward);
    double half_height = tan(camera->fov_deg * (M_PI / 360));
    pinhole->half_height = (float)half_height;
    pinhole->half_width = (float)(half_height * width_px / height_px);
    pinhole->t_max = (float)view_distance_voxels;
    pinhole->cone = (float)(2 * half_height / height_px);
}

void karst_pinhole_cut(karst_pinhole *pinhole, int x0_px, int y0_px, int width_px, int height_px)
{
    pinhole->x0_px = x0_px;
    pinhole->y0_px = y0_px;
    pinhole->more_width_px = pinhole->width_px - width_px;
    pinhole->more_height_px = pinhole->height_px - height_px;
    pinhole->width_px = width_px;
    pinhole->height_px = height_px;
}
