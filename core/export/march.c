#include "core/export/march.h"

#include <math.h>

/* What fails is tried again at a quarter; what holds is followed by a step to some share of where the density would
 * come to 0 if it went on as it does, or else by one twice as long. The share learns from both. */
#define MOST_SHARE 0.85
#define LEAST_SHARE 0.1
#define MOST_LONGER 16
/* Where floats are in doubt, next to the surface, there is no proof of any length: it is asked for now and then. */
#define PATIENCE 2
#define ASKED_EACH 8

karst_position karst_march_at(const karst_march *march, double t_m)
{
    const double offset_m[3] = {t_m * march->direction[0], t_m * march->direction[1], t_m * march->direction[2]};
    return karst_position_add_m(march->from, offset_m, march->voxel_log2_m);
}

static float density_at(const karst_march *march, karst_sampler *sampler, double t_m)
{
    const karst_position at = karst_march_at(march, t_m);
    float density;
    karst_sampler_densities(sampler, &at, 1, march->footprint_m, &density);
    return density;
}

void karst_march_begin(karst_march *march, karst_sampler *sampler)
{
    march->t_m = 0;
    march->step_m = march->length_m;
    march->num_steps = 0;
    march->num_unproved = 0;
    march->share = MOST_SHARE;
    march->density = density_at(march, sampler, 0);
    march->is_solid = march->density > 0;
}

/* Whether the density keeps its sign from t_m on for step_m. */
static bool is_proved(const karst_march *march, karst_sampler *sampler, double step_m)
{
    /* Places are rounded to 2^-32 voxel. */
    const double rounding_m = ldexp(1, march->voxel_log2_m - 30);
    const karst_position centre = karst_march_at(march, march->t_m + step_m / 2);
    double half_m[3], range[2];
    for (int axis = 0; axis < 3; axis++)
        half_m[axis] = (fabs(march->direction[axis]) * step_m / 2 + march->spread_m[axis]) * (1 + 0x1p-40) + rounding_m;
    if (!karst_sampler_bounds(sampler, &centre, half_m, march->footprint_m, range))
        return false;
    return march->is_solid ? range[0] > 0 : range[1] <= 0;
}

void karst_march_through_air(karst_march *march, karst_sampler *sampler, double least_m)
{
    march->is_solid = false;
    for (double step_m = march->length_m; step_m >= least_m && march->t_m < march->length_m;) {
        const double left_m = march->length_m - march->t_m;
        if (!is_proved(march, sampler, fmin(step_m, left_m))) {
            step_m /= 4;
            continue;
        }
        march->t_m = step_m < left_m ? march->t_m + step_m : march->length_m;
        step_m *= 2;
    }
}

/* After a step that held. */
static double guess_step(const karst_march *march, double step_m, float before)
{
    const double towards_m = step_m * (double)march->density / ((double)before - (double)march->density);
    if (!(towards_m > 0))
        return 2 * step_m;
    return fmin(march->share * towards_m, MOST_LONGER * step_m);
}

bool karst_march_next(karst_march *march, karst_sampler *sampler, uint64_t max_steps)
{
    while (march->t_m < march->length_m && march->num_steps < max_steps) {
        const double left_m = march->length_m - march->t_m;
        const double step_m = fmin(fmax(march->step_m, march->within_m), left_m);
        const double end_m = step_m == left_m ? march->length_m : march->t_m + step_m;
        const float before = march->density;
        march->num_steps++;
        const bool asked = march->num_unproved < PATIENCE || march->num_unproved % ASKED_EACH == 0;
        const bool proved = asked && is_proved(march, sampler, step_m);
        if (!proved && step_m > march->within_m) {
            march->step_m = step_m / 4;
            march->share = fmax(march->share / 2, LEAST_SHARE);
            continue;
        }
        march->t_m = end_m;
        march->density = density_at(march, sampler, end_m);
        march->step_m = proved ? guess_step(march, step_m, before) : march->within_m;
        march->share = proved ? fmin(march->share * 1.2, MOST_SHARE) : march->share;
        march->num_unproved = proved ? 0 : march->num_unproved + 1;
        /* Of a stretch so short that is not proved nothing is known but its end. */
        if (!proved && (march->density > 0) != march->is_solid) {
            march->is_solid = march->density > 0;
            march->step_m = 4 * march->within_m;
            march->num_unproved = 0;
            return true;
        }
    }
    return false;
}
