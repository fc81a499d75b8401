#include "reference/trace.h"

#include <math.h>

#include "raycast/rays_shared.h"

/* Roots are known within this share of the distance, or this many voxels. */
#define RELATIVE_TOLERANCE 1e-9
#define LEAST_TOLERANCE 0x1p-30
#define REFINE_MAX_STEPS 200
/* So many pieces in a row, as narrow as the tolerance and still undecided, are no touch of a surface but a density that
 * nothing is known of: the ray is given up. */
#define MAX_NARROW 8192

typedef struct {
    karst_ranger *ranger;
    const karst_position *anchor;
    const karst_reference_ray *ray;
    karst_reference_root *root;
    int level;
    double step;                    /* to begin a level with: what the last one came to; 0: none did */
    double blend_start, blend_rate; /* the weight of the next level at t is (t - start) * rate; a rate of 0: no blend */
} search;

static double weight_at(const search *s, double t)
{
    return s->blend_rate > 0 ? fmin(fmax((t - s->blend_start) * s->blend_rate, 0), 1) : 0;
}

/* (1 - weight) a + weight b */
static interval blend(interval a, interval b, double weight)
{
    return interval_add(interval_scale(a, 1 - weight), interval_scale(b, weight));
}

/* The field that is searched, over a piece of the ray. */
static karst_piece piece_of(const search *s, double from, double to)
{
    karst_piece f = karst_ranger_piece(s->ranger, s->anchor, s->ray->direction, from, to, s->level);
    if (!(s->blend_rate > 0))
        return f;
    karst_piece c = karst_ranger_piece(s->ranger, s->anchor, s->ray->direction, from, to, s->level + 1), r;
    double middle = from + 0.5 * (to - from), w0 = weight_at(s, from), w1 = weight_at(s, to);
    /* Linear in the weight, so its ends bound it. */
    r.middle = blend(f.middle, c.middle, weight_at(s, middle));
    r.value = interval_hull(blend(f.value, c.value, w0), blend(f.value, c.value, w1));
    r.slope = interval_add(interval_hull(blend(f.slope, c.slope, w0), blend(f.slope, c.slope, w1)),
                           interval_scale(interval_subtract(c.value, f.value), s->blend_rate));
    double half = fmax(to - middle, middle - from) * (1 + 0x1p-40);
    if (isfinite(r.slope.lo) && isfinite(r.slope.hi) && isfinite(r.middle.lo) && isfinite(r.middle.hi))
        r.value = interval_meet(r.value, interval_add(r.middle, interval_multiply(r.slope, interval_of(-half, half))));
    return r;
}

static double density_at(const search *s, double t)
{
    interval middle = piece_of(s, t, t).middle;
    return 0.5 * (middle.lo + middle.hi);
}

static double tolerance_at(double t) { return fmax(0.25 * RELATIVE_TOLERANCE * fabs(t), LEAST_TOLERANCE); }

/* Narrows a bracket, air at `air` and solid at `solid`, to the tolerance: Newton's steps while they stay inside it, and
 * halves otherwise. */
static double narrow(const search *s, double air, double solid)
{
    double t = air + 0.5 * (solid - air);
    for (int step = 0; step < REFINE_MAX_STEPS && solid - air > tolerance_at(solid); step++) {
        /* A little past the root, so that the bracket closes from both sides. */
        double past = 0.4 * tolerance_at(t);
        t = fmin(fmax(t, air + past), solid - past);
        karst_piece here = piece_of(s, t, t);
        double d = 0.5 * (here.middle.lo + here.middle.hi), slope = 0.5 * (here.slope.lo + here.slope.hi);
        if (d > 0)
            solid = t;
        else
            air = t;
        t -= d / slope;
        if (step % 6 == 5 || !(t > air - past && t < solid + past))
            t = air + 0.5 * (solid - air);
    }
    return solid;
}

/* Along [from, to] in one field. True where the search ends; otherwise the field is proven not to be positive there. */
static bool search_field(search *s, double from, double to)
{
    karst_reference_root *root = s->root;
    root->level = s->level;
    /* Invariant: no solid before t, and, once that is known, d(t) <= 0. */
    double t = from, step = s->step > 0 ? s->step : (to - from) / 4;
    bool known = false;
    int num_narrow = 0;
    while (t < to) {
        if (++root->num_intervals > s->ray->max_intervals || num_narrow > MAX_NARROW) {
            root->kind = KARST_REFERENCE_UNRESOLVED;
            root->t = t;
            return true;
        }
        double end = t + step < to ? t + step : to;
        karst_piece piece = piece_of(s, t, end);
        if (!known && piece.value.hi > 0 && density_at(s, t) > 0) {
            root->kind = KARST_REFERENCE_INSIDE;
            root->t = t;
            return true;
        }
        known = true;
        if (piece.value.lo > 0) { /* it jumped just here */
            root->kind = KARST_REFERENCE_SURFACE;
            root->t = t;
            return true;
        }
        /* Falling, or air throughout: nothing in it. */
        if (piece.value.hi <= 0 || piece.slope.hi <= 0) {
            t = end;
            step *= 2;
            continue;
        }
        bool is_narrow = end - t <= 4 * tolerance_at(t);
        num_narrow = is_narrow ? num_narrow + 1 : end - t > 64 * tolerance_at(t) ? 0 : num_narrow;
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
    s->step = step;
    return false;
}

/* Where level `level` begins: as the caster has it. */
static double level_start(const karst_reference_ray *ray, int level)
{
    return level <= 0 ? 0 : (double)(ldexpf(1.0f, level) * ray->lod_scale);
}

/* The same in the field of level `level`, or, in its end, in what it and the next one blend into. */
static bool search_level(search *s, int level, double from, double to)
{
    s->level = level;
    s->blend_rate = 0;
    return from < to && search_field(s, from, to);
}
static bool search_blend(search *s, int level, double from, double to)
{
    double end = level_start(s->ray, level + 1);
    s->level = level;
    s->blend_start = (1 - (double)s->ray->blend) * end;
    s->blend_rate = 1 / (end - s->blend_start);
    return from < to && search_field(s, from, to);
}

/* Where neither of two levels is solid nothing between them is. So each level is searched from where the one before
 * begins to turn into it to its own end, and their blend only where one of the two has something there. */
static bool search_levels(search *s)
{
    const karst_reference_ray *ray = s->ray;
    double waiting = INFINITY; /* from here to the level's beginning only the one before is known to be air */
    for (int level = 0; level < KARST_MAX_LEVELS; level++) {
        double end = level_start(ray, level + 1), zone = fmin((1 - (double)ray->blend) * end, ray->t_max);
        double from = fmax(ray->t_min, level_start(ray, level)), to = fmin(ray->t_max, end);
        if (to <= ray->t_min)
            continue;
        zone = fmax(zone, from);
        bool found = search_level(s, level, fmin(waiting, from), to);
        if (found && waiting < from && s->root->t < from) {
            if (search_blend(s, level - 1, waiting, from))
                return true;
            found = search_level(s, level, from, to);
        }
        if (found && s->root->t < zone)
            return true;
        waiting = zone;
        if (found) {
            if (s->root->kind == KARST_REFERENCE_UNRESOLVED || search_blend(s, level, zone, to))
                return true;
            waiting = INFINITY;
        }
        if (to >= ray->t_max) {
            s->level = level + 1;
            return waiting < to && search_level(s, level + 1, waiting, to) && search_blend(s, level, waiting, to);
        }
    }
    return false;
}

karst_reference_root karst_reference_first(karst_ranger *ranger, const karst_position *anchor,
                                           const karst_reference_ray *ray)
{
    karst_reference_root root = {.kind = KARST_REFERENCE_MISS, .t = ray->t_max};
    search s = {.ranger = ranger, .anchor = anchor, .ray = ray, .root = &root, .level = -1};
    if (!(ray->t_max > ray->t_min))
        return root;
    bool found = ray->lod_scale <= 0 ? search_field(&s, ray->t_min, ray->t_max) : search_levels(&s);
    if (!found)
        root = (karst_reference_root){.kind = KARST_REFERENCE_MISS,
                                      .t = ray->t_max,
                                      .level = s.level,
                                      .num_intervals = root.num_intervals,
                                      .num_grazes = root.num_grazes};
    else
        root.weight = weight_at(&s, root.t);
    return root;
}
