/* Camera paths: keyframes in a small JSON file, and the camera at any time between them. */
#ifndef KARST_PATH_H
#define KARST_PATH_H

#include <stdbool.h>

#include "karst/camera.h"
#include "karst/error.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A file such as
 *
 *   { "description": "over the ridge", "world": "hills", "interpolation": "smooth",
 *     "keyframes": [ {"time": 0, "position": ["0", "320", "0"], "yaw": 30, "pitch": -12, "fov": 60},
 *                    {"time": 8, "position": ["1e15", "0.5", "-40"], "yaw": 350, "pitch": 0} ] }
 *
 * time           seconds, never falling. Two keyframes of the same time are a jump: the camera is at the second from
 * then on. position       decimal text in metres, exact (karst_position_parse). yaw, pitch     degrees. Yaw turns the
 * shorter way to the next keyframe (to the right if both are as long), and "turns": n at that keyframe adds n full
 * turns to the right. fov            degrees; left out: as the keyframe before, 60 at first. interpolation  "linear";
 * "smooth" (the default): position, angles and fov are C1 between jumps and never overshoot a keyframe on any axis, so
 * that a path over a ridge whose keyframes clear it clears it; "zoom": for paths over many orders of magnitude: as
 * smooth, but in the logarithm of the distance from "target" (decimal text like a position), in the direction from it
 *                and in the logarithm of fov. Neighbouring keyframes must lie less than 90 degrees apart as seen from
 * the target. Leaving yaw and pitch out of all keyframes of a zoom makes the camera look at the target. description,
 * world (the one that it was made for): for people; may be left out.
 *
 * Offsets are taken from the nearer keyframe, whose position is exact: a path at 10^15 m is as good as one at the
 * origin. The same file and time give the same camera; "linear" and "smooth" use no function of the C library whose
 * last bit differs between machines. */
typedef struct karst_path karst_path;

/* Reads a path for a world with voxels of 2^voxel_log2_m metres; destroy with karst_path_destroy. Errors:
 * KARST_BAD_DATA naming file, keyframe (from 1) and field, or the line of a syntax error; KARST_USAGE (voxel_log2_m out
 * of range). Distinct paths may be used from distinct threads, one path from many at a time. */
karst_path *karst_path_load(const char *file, int voxel_log2_m, karst_error *error);
/* Checks as much of that as can be known without the world's voxel. Errors: KARST_BAD_DATA. */
bool karst_path_check(const char *file, karst_error *error);
void karst_path_destroy(karst_path *path); /* NULL is fine */

/* Times of the first and the last keyframe. */
double karst_path_start_s(const karst_path *path);
double karst_path_end_s(const karst_path *path);
const char *karst_path_world(const karst_path *path);       /* NULL: any; owned by the path */
const char *karst_path_description(const karst_path *path); /* NULL: none; owned by the path */

/* The camera at a time; before the start (or at a NaN) the first keyframe, after the end the last. At a keyframe's time
 * its position exactly. Yaw runs on over many turns. */
karst_camera karst_path_sample(const karst_path *path, double time_s);

#ifdef __cplusplus
}
#endif
#endif
