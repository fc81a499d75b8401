#include "karst/camera.h"

#include "core/base/text.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double PITCH_MAX_DEG = 90.0, FOV_MIN_DEG = 0.0001, FOV_MAX_DEG = 179.0;

/* Sine and cosine of degrees, exact at multiples of 90: level cameras get axes without stray 1e-17s. */
static void sine_cosine_deg(double angle_deg, double *sine, double *cosine)
{
    double turn = fmod(angle_deg, 360.0);
    double quarters = nearbyint(turn / 90.0);
    double rest = (turn - 90.0 * quarters) * (3.14159265358979323846 / 180.0);
    double s = sin(rest), c = cos(rest);
    switch ((int)quarters & 3) {
    case 0:
        *sine = s, *cosine = c;
        break;
    case 1:
        *sine = c, *cosine = -s;
        break;
    case 2:
        *sine = -s, *cosine = -c;
        break;
    default:
        *sine = -c, *cosine = s;
        break;
    }
}

void karst_camera_axes(const karst_camera *camera, double right[3], double up[3], double forward[3])
{
    double sin_yaw, cos_yaw, sin_pitch, cos_pitch;
    double yaw_deg = isfinite(camera->yaw_deg) ? camera->yaw_deg : 0.0;
    double pitch_deg = isfinite(camera->pitch_deg) ? fmin(fmax(camera->pitch_deg, -PITCH_MAX_DEG), PITCH_MAX_DEG) : 0.0;
    sine_cosine_deg(yaw_deg, &sin_yaw, &cos_yaw);
    sine_cosine_deg(pitch_deg, &sin_pitch, &cos_pitch);
    const double axes[3][3] = {
        {cos_yaw, 0.0, -sin_yaw},
        {-sin_yaw * sin_pitch, cos_pitch, -cos_yaw * sin_pitch},
        {sin_yaw * cos_pitch, sin_pitch, cos_yaw * cos_pitch},
    };
    for (int i = 0; i < 3; i++) {
        /* + 0.0 turns -0 into 0 */
        right[i] = axes[0][i] + 0.0;
        up[i] = axes[1][i] + 0.0;
        forward[i] = axes[2][i] + 0.0;
    }
}

static bool parse_angle(const char *name, const char *text, double min, double max, double *angle, karst_error *error)
{
    char quoted[KARST_TEXT_QUOTE_BYTES];
    double value;
    if (!karst_text_to_double(text, &value))
        return karst_fail(error, KARST_USAGE, "camera %s: \"%s\" is not a number of degrees", name,
                          karst_text_quote(text, quoted));
    if (value < min || value > max)
        return karst_fail(error, KARST_USAGE, "camera %s: \"%s\" is not within %g to %g degrees", name,
                          karst_text_quote(text, quoted), min, max);
    *angle = value;
    return true;
}

enum { NUM_FIELDS_MIN = 5, NUM_FIELDS_MAX = 6 };

static bool parse_fields(char *const fields[NUM_FIELDS_MAX], int num_fields, int voxel_log2_m, karst_camera *camera,
                         karst_error *error)
{
    karst_error reason = {0};
    karst_camera parsed = *camera;
    if (!karst_position_parse(fields[0], fields[1], fields[2], voxel_log2_m, &parsed.position, &reason))
        return karst_fail(error, reason.status, "camera %s", reason.message);
    if (!parse_angle("yaw", fields[3], -HUGE_VAL, HUGE_VAL, &parsed.yaw_deg, error) ||
        !parse_angle("pitch", fields[4], -PITCH_MAX_DEG, PITCH_MAX_DEG, &parsed.pitch_deg, error))
        return false;
    if (num_fields > NUM_FIELDS_MIN && !parse_angle("fov", fields[5], FOV_MIN_DEG, FOV_MAX_DEG, &parsed.fov_deg, error))
        return false;
    *camera = parsed;
    return true;
}

bool karst_camera_parse(const char *text, int voxel_log2_m, karst_camera *camera, karst_error *error)
{
    char *copy = strdup(text);
    if (!copy)
        return karst_fail(error, KARST_FAILED, "out of memory for a camera of %zu bytes", strlen(text));
    char *fields[NUM_FIELDS_MAX] = {copy};
    int num_fields = 1;
    for (char *comma = strchr(copy, ','); comma; comma = strchr(comma + 1, ',')) {
        *comma = '\0';
        if (num_fields < NUM_FIELDS_MAX)
            fields[num_fields] = comma + 1;
        num_fields++;
    }
    bool done = false;
    if (num_fields < NUM_FIELDS_MIN || num_fields > NUM_FIELDS_MAX) {
        char quoted[KARST_TEXT_QUOTE_BYTES];
        karst_fail(error, KARST_USAGE,
                   "camera \"%s\" has %d field%s; it takes X,Y,Z,YAW,PITCH[,FOV], such as 0,320,0,30,-12",
                   karst_text_quote(text, quoted), num_fields, num_fields == 1 ? "" : "s");
    } else {
        done = parse_fields(fields, num_fields, voxel_log2_m, camera, error);
    }
    free(copy);
    return done;
}

int karst_camera_format(const karst_camera *camera, int voxel_log2_m, char *text, size_t size_bytes)
{
    char axis[3][160], yaw[32], pitch[32], fov[32];
    for (int i = 0; i < 3; i++)
        if (karst_coordinate_format(camera->position.voxel[i], camera->position.fraction[i], voxel_log2_m, axis[i],
                                    sizeof axis[i]) < 0) {
            if (size_bytes)
                text[0] = '\0';
            return -1;
        }
    karst_text_from_double(camera->yaw_deg, yaw, sizeof yaw);
    karst_text_from_double(camera->pitch_deg, pitch, sizeof pitch);
    karst_text_from_double(camera->fov_deg, fov, sizeof fov);
    return snprintf(text, size_bytes, "%s,%s,%s,%s,%s,%s", axis[0], axis[1], axis[2], yaw, pitch, fov);
}
