/* What edits make of a range of densities: interval arithmetic, edit by edit, in double. */
#include <math.h>

#include "producers/edits/edits.clh"
#include "producers/edits/edit_list.h"

typedef struct {
    double lo, hi;
} interval;

/* edits_max, which rises with both. */
static double rounded_max(double a, double b, double blend)
{
    const double near = blend - fabs(a - b);
    return fmax(a, b) + (near > 0 ? near * near / (4 * blend) : 0);
}

static interval max_of(interval a, interval b, double blend)
{
    return (interval){rounded_max(a.lo, b.lo, blend), rounded_max(a.hi, b.hi, blend)};
}

static interval turned(interval a) { return (interval){-a.hi, -a.lo}; }

static interval around(double at, double radius) { return (interval){at - radius, at + radius}; }

/* Of the places at most `radius` voxels from p: the plane's share, and what that leaves of a density. */
static interval smoothed(interval d, interval plane, const karst_edit_record *edit, const float p[3], double radius)
{
    double square = 0;
    for (int a = 0; a < 3; a++)
        square += (double)p[a] * (double)p[a];
    const double distance = sqrt(square);
    const double near = fmax(distance - radius, 0) / (double)edit->radius;
    const double far = EDITS_MUTANT(SMOOTH) ? near : (distance + radius) / (double)edit->radius;
    const double most = (double)edit->size[0], at_near = fmax(1 - near * near, 0), at_far = fmax(1 - far * far, 0);
    const double shares[2] = {fmax(most * at_far * at_far - 0x1p-18, 0),
                              fmin(most * at_near * at_near + 0x1p-18, most)};
    interval mean = {INFINITY, -INFINITY};
    for (int i = 0; i < 2; i++) { /* it changes evenly with the share */
        mean.lo = fmin(mean.lo, d.lo * (1 - shares[i]) + plane.lo * shares[i]);
        mean.hi = fmax(mean.hi, d.hi * (1 - shares[i]) + plane.hi * shares[i]);
    }
    const double size = fmax(fmax(fabs(d.lo), fabs(d.hi)), fmax(fabs(plane.lo), fabs(plane.hi)));
    return (interval){mean.lo - 0x1p-20 * size, mean.hi + 0x1p-20 * size};
}

/* The density of the places at most `radius` voxels from p, after an edit: no shape is steeper than 1, and roundings
 * are below 2^-20 of what is added up. */
static interval edited(interval d, const karst_edit_record *edit, const float p[3], double radius, double voxel_m)
{
    const uint mode = EDIT_MODE(edit->what);
    const double blend = (double)edit->blend * voxel_m;
    double far = radius + (double)edit->radius;
    for (int a = 0; a < 3; a++)
        far += fabs((double)p[a]) + (double)edit->size[a] + fabs((double)edit->axis[a]);
    radius += far * 0x1p-18;
    const double rough =
        EDIT_SHAPE(edit->what) == EDIT_NOISE
            ? (double)edit->size[0] * (EDITS_MUTANT(ROUGH) ? 0.0 : (double)(EDITS_NOISE_SUM * NOISE_SUP))
            : 0.0;
    interval s = around((double)edits_distance(p, edit), radius + rough),
             plane = around((double)edits_plane_distance(p, edit), radius);
    s.lo *= voxel_m, s.hi *= voxel_m, plane.lo *= voxel_m, plane.hi *= voxel_m;
    if (mode == EDIT_SMOOTH) {
        d = smoothed(d, plane, edit, p, radius);
    } else if (mode == EDIT_ADD) {
        d = max_of(d, s, blend);
    } else {
        d = turned(max_of(turned(d), s, blend));
        if (mode == EDIT_FLATTEN)
            d = max_of(d, (interval){fmin(plane.lo, s.lo), fmin(plane.hi, s.hi)}, blend);
    }
    /* Of floats. */
    d.lo -= 0x1p-20 * (fabs(d.lo) + blend);
    d.hi += 0x1p-20 * (fabs(d.hi) + blend);
    return d;
}

/* Whether the edit reaches all places of a box, its margin aside, and samples of the level show it: then those of finer
 * levels do. */
static bool holds(const karst_edit_record *edit, const float p[3], const double half_voxels[3], int level)
{
    const float most = fmaxf(edit->reach[0], fmaxf(edit->reach[1], edit->reach[2]));
    bool all = level < 0 || karst_edit_shows(most, level);
    for (int a = 0; a < 3; a++)
        all = all && fabs((double)p[a]) * (1 + 0x1p-20) + half_voxels[a] <= (double)edit->reach[a];
    return all;
}

bool karst_edit_list_range(const karst_edit_list *list, const karst_position *centre, const double half_voxels[3],
                           int level, double range[2])
{
    const karst_edits_head *head = (const karst_edits_head *)list->data;
    edits_box box = {.level = level > 0 ? level : 0, .margin = EDITS_MARGIN, .which = EDITS_OF_LAND};
    uint found[EDITS_LIST];
    double square = 0;
    for (int a = 0; a < 3; a++) {
        if (!(half_voxels[a] < 0x1p60))
            return false;
        const int64_t half = (int64_t)half_voxels[a] + 2;
        box.min[a] = centre->voxel[a] - half;
        box.max[a] = centre->voxel[a] + half;
        square += half_voxels[a] * half_voxels[a];
    }
    const uint num = edits_collect(list->data, &box, 0, found);
    if (num == EDITS_LIST)
        return false;
    interval d = {range[0], range[1]};
    for (uint i = 0; i < num; i++) {
        const karst_edit_record *edit = &karst_edit_list_records(list)[found[i]];
        float p[3];
        for (int a = 0; a < 3; a++)
            p[a] = EDITS_TO_FLOAT(centre->voxel[a] - edit->at[a]) +
                   ((float)centre->fraction[a] * 0x1p-32f - (float)edit->fraction[a] * 0x1p-32f);
        const double radius = sqrt(square) * (EDITS_MUTANT(REACH) ? 0.5 : 1.0);
        const interval after = edited(d, edit, p, radius, (double)head->voxel_m);
        /* What it does not reach, or does not show, stays as it was. */
        const bool all = holds(edit, p, half_voxels, level);
        d.lo = all || EDITS_MUTANT(OUTSIDE) ? after.lo : fmin(d.lo, after.lo);
        d.hi = all || EDITS_MUTANT(OUTSIDE) ? after.hi : fmax(d.hi, after.hi);
    }
    range[0] = d.lo;
    range[1] = d.hi;
    return true;
}
