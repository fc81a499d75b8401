#include "reference/trace.h"

#include <math.h>

#include "raycast/rays_shared.h"

/* Roots are known within this share of the distance, or this many voxels. */
#define RELATIVE_TOLERANCE 1e-9
#define LEAST_TOLERANCE 0x1p-30
#define REFINE_MAX_STEPS 200

typedef struct {
    karst_ranger *ranger;
    const karst_position *anchor;
    const karst_reference_ray *ray;
    karst_reference_root *root;
    int level;
} search;

static double density_at(const search *s, double t)
{
    return karst_ranger_density(s->ranger, s->anchor, s->ray->direction, t, s->level);
}

static double tolerance_at(double t) { return fmax(0.25 * RELATIVE_TOLERANCE * fabs(t), LEAST_TOLERANCE); }

/* Narrows a bracket, air at `air` and solid at `solid`, to the tolerance; false position that halves the weight of an
 * end which stays (Illinois), and halves the bracket where that is slow. */
static double narrow(const search *s, double air, double solid)
{
    double at_air = density_at(s, air), at_solid = density_at(s, solid);
    for (int step = 0; step < REFINE_MAX_STEPS && solid - air > tolerance_at(solid); step++) {
        double t = air + (solid - air) * (at_air / (at_air - at_solid));
        if (step % 3 == 2 || !(t > air && t < solid))
            t = air + 0.5 * (solid - air);
        /* Step a little past the root, so that the bracket closes from both sides. */
        double past = 0.4 * tolerance_at(t);
        t = fmin(fmax(t, air + past), solid - past);
        double d = density_at(s, t);
        if (d > 0) {
            solid = t;
            at_solid = d;
            at_air *= 0.5;
        } else {
            air = t;
            at_air = d;
            at_solid *= 0.5;
        }
    }
    return solid;
}

/* Along [from, to] at one level. True where the search ends. */
static bool search_level(search *s, double from, double to)
{
    karst_reference_root *root = s->root;
    double at_from = density_at(s, from);
    root->level = s->level;
    if (at_from > 0) {
        root->kind = KARST_REFERENCE_INSIDE;
        root->t = from;
        return true;
    }
    /* Invariant: no solid before t, and d(t) <= 0. */
    double t = from, step = (to - from) / 4;
    while (t < to) {
        if (++root->num_intervals > s->ray->max_intervals) {
            root->kind = KARST_REFERENCE_UNRESOLVED;
            root->t = t;
            return true;
        }
        double end = t + step < to ? t + step : to;
        karst_piece piece = karst_ranger_piece(s->ranger, s->anchor, s->ray->direction, t, end, s->level);
        /* Falling, or air throughout: nothing in it. */
        if (piece.value.hi <= 0 || piece.slope.hi <= 0) {
            t = end;
            step *= 2;
            continue;
        }
        bool is_narrow = end - t <= 4 * tolerance_at(t);
        if (piece.slope.lo >= 0 || is_narrow) {
            if (density_at(s, end) > 0) {
                root->kind = KARST_REFERENCE_SURFACE;
                root->t = narrow(s, t, end);
                return true;
            }
            root->num_grazes += piece.slope.lo < 0;
            step = piece.slope.lo < 0 ? step : 2 * step;
            t = end;
            continue;
        }
        /* A part of it may be proven all the same: as far as the slopes allow on both sides of the middle. */
        double middle = t + 0.5 * (end - t), depth = -piece.middle.hi, ahead = 0;
        if (depth > 0 && isfinite(piece.slope.lo) && -piece.slope.lo * (middle - t) <= depth * (1 - 1e-9))
            ahead = fmin(depth / piece.slope.hi * (1 - 1e-9), end - middle);
        if (ahead > 0) {
            step = 1.25 * (middle + ahead - t);
            t = middle + ahead;
        } else {
            step = 0.5 * (end - t);
        }
    }
    return false;
}

/* Where level `level` begins: as the caster has it. */
static double level_start(const karst_reference_ray *ray, int level)
{
    return level <= 0 ? 0 : (double)(ldexpf(1.0f, level) * ray->lod_scale);
}

karst_reference_root karst_reference_first(karst_ranger *ranger, const karst_position *anchor,
                                           const karst_reference_ray *ray)
{
    karst_reference_root root = {.kind = KARST_REFERENCE_MISS, .t = ray->t_max};
    search s = {.ranger = ranger, .anchor = anchor, .ray = ray, .root = &root, .level = -1};
    if (!(ray->t_max > ray->t_min))
        return root;
    if (ray->lod_scale <= 0) {
        search_level(&s, ray->t_min, ray->t_max);
        return root;
    }
    for (s.level = 0; s.level < KARST_MAX_LEVELS; s.level++) {
        double from = fmax(ray->t_min, level_start(ray, s.level));
        double to = fmin(ray->t_max, level_start(ray, s.level + 1));
        if (from < to && search_level(&s, from, to))
            break;
        if (to >= ray->t_max)
            break;
    }
    return root;
}
