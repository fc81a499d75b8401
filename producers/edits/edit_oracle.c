/* What edits make of a density, in double: written apart from edits.clh, to measure it by. */
#include <math.h>

#include "producers/edits/edits.clh"
#include "producers/edits/edit_list.h"

static double length(const double v[3]) { return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

static double dot(const double a[3], const float b[3])
{
    return a[0] * (double)b[0] + a[1] * (double)b[1] + a[2] * (double)b[2];
}

static double box_depth(const double p[3], const float half[3])
{
    double outside[3], inside = -INFINITY;
    for (int a = 0; a < 3; a++) {
        double over = fabs(p[a]) - (double)half[a];
        outside[a] = over > 0 ? over : 0;
        inside = fmax(inside, over);
    }
    return inside > 0 ? -length(outside) : -inside;
}

static double capsule_depth(const double p[3], const karst_edit_record *edit)
{
    double axis[3] = {(double)edit->axis[0], (double)edit->axis[1], (double)edit->axis[2]}, rest[3];
    double square = length(axis) * length(axis);
    double along = square > 0 ? fmin(fmax(dot(p, edit->axis) / square, 0), 1) : 0;
    for (int a = 0; a < 3; a++)
        rest[a] = p[a] - along * axis[a];
    return (double)edit->radius - length(rest);
}

/* How deep a place lies in the shape, voxels. */
static double depth(const double p[3], const karst_edit_record *edit)
{
    switch (EDIT_SHAPE(edit->what)) {
    case EDIT_BOX:
        return box_depth(p, edit->size);
    case EDIT_CAPSULE:
        return capsule_depth(p, edit);
    case EDIT_PLANE:
        return -dot(p, edit->axis);
    default:
        return (double)edit->radius - length(p);
    }
}

static double smooth_max(double a, double b, double blend)
{
    double near = blend - fabs(a - b);
    return fmax(a, b) + (near > 0 ? near * near / (4 * blend) : 0);
}

static double rough(const karst_edit_record *edit, const karst_position *at, int level)
{
    vlong voxel[3] = {at->voxel[0], at->voxel[1], at->voxel[2]};
    vuint fraction[3] = {at->fraction[0], at->fraction[1], at->fraction[2]};
    return (double)edits_roughness(voxel, fraction, edit, level);
}

static bool applies(const karst_edit_record *edit, const karst_position *at, int level)
{
    float most = fmaxf(edit->reach[0], fmaxf(edit->reach[1], edit->reach[2]));
    if (level >= 0 && !karst_edit_shows(most, level))
        return false;
    for (int a = 0; a < 3; a++) {
        __int128 reach = edits_reach(edit->reach[a], level > 0 ? level : 0, EDITS_MARGIN);
        __int128 from = (__int128)at->voxel[a] - edit->at[a], to = from + (at->fraction[a] != 0);
        if (to < -reach || from > reach)
            return false;
    }
    return true;
}

/* How thin the shape is at most, voxels. */
static double thickness(const karst_edit_record *edit)
{
    switch (EDIT_SHAPE(edit->what)) {
    case EDIT_BOX:
        return 2 * (double)fminf(edit->size[0], fminf(edit->size[1], edit->size[2]));
    case EDIT_PLANE:
        return INFINITY;
    default:
        return 2 * (double)edit->radius;
    }
}

/* Lays the edit's colour over: s is how deep the place lies in its shape, voxels, and d in what was there before. */
static void lay_over(const karst_edit_record *edit, double s, double d, int level, double colour[4])
{
    const double voxel = ldexp(1, level > 0 ? level : 0), over = fmax((double)edit->blend, voxel);
    double share = EDIT_MODE(edit->what) == EDIT_PAINT ? s / over + 0.5 : ((s - d) / over + 1) / 2;
    share = fmin(fmax(share, 0), 1) * (double)(edit->colour[1] >> 16) / 65535;
    if (EDIT_MODE(edit->what) == EDIT_PAINT)
        share *= fmin(1, thickness(edit) / voxel);
    const uint own[4] = {edit->colour[0] & 0xffff, edit->colour[0] >> 16, edit->colour[1] & 0xffff, 0xffff};
    for (int i = 0; i < 4; i++)
        colour[i] += (own[i] / 65535.0 - colour[i]) * share;
}

/* Towards the edit's plane, the more the nearer the middle. */
static double smoothed(const karst_edit_record *edit, const double p[3], double voxel_m, double density)
{
    const double reach = length(p) / (double)edit->radius, plane = -dot(p, edit->axis) * voxel_m;
    if (reach >= 1)
        return density;
    const double share = (double)edit->size[0] * pow(1 - reach * reach, 2);
    return share < 1 ? density * (1 - share) + plane * share : plane;
}

/* The density after an edit that reaches the place; its colour is laid over `colour`, unless that is NULL. */
static double after_edit(const karst_edit_record *edit, const karst_position *at, int level, double voxel_m,
                         double density, double colour[4])
{
    double p[3];
    for (int a = 0; a < 3; a++)
        p[a] = (double)(at->voxel[a] - edit->at[a]) + ((double)at->fraction[a] - (double)edit->fraction[a]) * 0x1p-32;
    double s = depth(p, edit), blend = (double)edit->blend * voxel_m;
    if (EDIT_SHAPE(edit->what) == EDIT_NOISE)
        s += rough(edit, at, level);
    if (colour && (edit->what & EDIT_COLOURED))
        lay_over(edit, s, density / voxel_m, level, colour);
    if (EDIT_MODE(edit->what) == EDIT_PAINT)
        return density;
    if (EDIT_MODE(edit->what) == EDIT_SMOOTH)
        return smoothed(edit, p, voxel_m, density);
    s *= voxel_m;
    if (EDIT_MODE(edit->what) == EDIT_ADD)
        return smooth_max(density, s, blend);
    density = -smooth_max(-density, s, blend);
    if (EDIT_MODE(edit->what) == EDIT_FLATTEN)
        density = smooth_max(density, fmin(-dot(p, edit->axis) * voxel_m, s), blend);
    return density;
}

double karst_edit_list_precise(const karst_edit_list *list, const karst_position *at, int level, double density,
                               double colour[4])
{
    for (int i = 0; i < 4 && colour; i++)
        colour[i] = 0;
    for (uint32_t i = 0; i < karst_edit_list_num(list); i++) {
        const karst_edit_record *edit = &karst_edit_list_records(list)[i];
        if (applies(edit, at, level))
            density = after_edit(edit, at, level, ldexp(1, list->voxel_log2_m), density, colour);
    }
    return density;
}

double karst_edit_list_precise_density(const karst_edit_list *list, const karst_position *at, int level, double density)
{
    edits_box box = {.level = level > 0 ? level : 0, .margin = EDITS_MARGIN, .which = EDITS_OF_LAND};
    uint found[EDITS_LIST], count, first = 0;
    for (int a = 0; a < 3; a++) {
        box.min[a] = box.max[a] = at->voxel[a];
        box.max[a] += at->fraction[a] != 0;
    }
    do {
        count = edits_collect(list->data, &box, first, found);
        for (uint i = 0; i < count; i++) {
            const karst_edit_record *edit = &karst_edit_list_records(list)[found[i]];
            if (applies(edit, at, level))
                density = after_edit(edit, at, level, ldexp(1, list->voxel_log2_m), density, NULL);
        }
        first = count ? found[count - 1] + 1 : 0;
    } while (count == EDITS_LIST);
    return density;
}
