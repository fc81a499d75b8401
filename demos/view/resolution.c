/* Fewer pixels while things move, so that frames come in time; all of them as soon as nothing moves. */
#include "demos/view/view.h"

#include <math.h>

#define USE_OF_FRAME 0.80  /* of the frame's time is planned for, the rest is for what is not foreseen */
#define STILL_AFTER_S 0.12 /* without the mouse's motion it is over; what keys moved stands when it stands */
#define CALM_FRAMES 10     /* with time to spare before there are more pixels */
#define SMOOTHING 0.3
/* Time for making content, of a frame, if drawing leaves so much; and at least, or the world would turn coarse. */
#define MOVING_BUDGET 0.25
#define LEAST_BUDGET 0.06
/* Drawing and making together: a little more after each frame that came in time, much less after one that was late, so
 * that one in eighty is. */
#define FIRST_USE 0.85
#define LEAST_USE 0.75
#define MOST_USE 0.94
#define USE_MORE 0.0005
#define USE_LESS 0.04
/* Standing, one waits for content alone, with a picture now and then, sooner where little is there yet. Keys and mouse
 * end it. */
#define STILL_BUDGET_MS 700.0
#define NEW_VIEW_BUDGET_MS 120.0
#define NEW_VIEW 0.8 /* of what is seen stands in for something finer */

static int side_px(int full_px, int share)
{
    /* In fours: rays go in packets of 4 x 4. */
    int px = (full_px * share / VIEW_FULL_SHARE + 3) & ~3;
    return px < full_px && px > 0 ? px : full_px;
}

static int clamp_share(int share)
{
    return share < VIEW_LEAST_SHARE ? VIEW_LEAST_SHARE : share > VIEW_FULL_SHARE ? VIEW_FULL_SHARE : share;
}

/* The largest share that is expected to be done in time. */
static int affordable_share(const viewer *v)
{
    const view_resolution *r = &v->resolution;
    double time_ns = 1e9 / v->settings.fps * (USE_OF_FRAME - MOVING_BUDGET) - r->other_ns;
    double full_px = (double)v->width_px * v->height_px;
    if (r->cost_ns_px <= 0)
        return VIEW_FULL_SHARE;
    double share = sqrt(fmax(0, time_ns) / (r->cost_ns_px * full_px));
    return clamp_share((int)(VIEW_FULL_SHARE * fmin(share, 1) + 0.01));
}

/* What the frame leaves for making content when this share of the sides is drawn. */
static double budget_ms(const viewer *v, int share, bool at_rest)
{
    const view_resolution *r = &v->resolution;
    double target_ms = 1000 / v->settings.fps;
    if (at_rest && !v->capture.video)
        return (double)v->stats.num_provisional > NEW_VIEW * (double)v->stats.num_hits || v->num_frames == 0
                   ? NEW_VIEW_BUDGET_MS
                   : STILL_BUDGET_MS;
    double side = (double)share / VIEW_FULL_SHARE;
    double drawn_ms = r->cost_ns_px * side * side * v->width_px * v->height_px / 1e6;
    double left_ms = target_ms * (FIRST_USE + r->more_use) - drawn_ms - r->other_ns / 1e6;
    return fmax(target_ms * LEAST_BUDGET, fmin(target_ms * MOVING_BUDGET, left_ms));
}

bool view_resolution_choose(viewer *v, bool moving, karst_error *error)
{
    view_resolution *r = &v->resolution;
    if (moving)
        r->still_since_s = v->now_s;
    double wait_s = v->motion.looked ? STILL_AFTER_S : 0;
    bool at_rest = v->now_s - r->still_since_s > wait_s || v->settings.fixed_resolution || v->capture.video ||
                   v->capture.want_png || v->capture.want_exr;
    r->at_rest = at_rest;
    int share = at_rest ? VIEW_FULL_SHARE : r->moving_share ? r->moving_share : affordable_share(v);
    if (!at_rest)
        r->moving_share = share;
    if (share != r->share)
        r->calm_frames = 0;
    r->share = share;
    return karst_engine_set_budget_ms(v->engine, budget_ms(v, share, at_rest), error) &&
           karst_engine_set_drawn_size(v->engine, side_px(v->width_px, share), side_px(v->height_px, share), error);
}

void view_resolution_learn(viewer *v, bool moving, uint64_t frame_ns)
{
    view_resolution *r = &v->resolution;
    const karst_stats *s = &v->stats;
    if (!s->num_pixels)
        return;
    double target_ns = 1e9 / v->settings.fps;
    double cast_ns = (double)s->time_ns[KARST_STAGE_CAST], looked_ns = fmin(cast_ns, (double)s->time_ns_scouts);
    double drawn_ns = cast_ns - looked_ns + (double)s->time_ns[KARST_STAGE_SHADE];
    double made_ns = looked_ns + (double)(s->time_ns[KARST_STAGE_SUBDIVIDE] + s->time_ns[KARST_STAGE_EVALUATE] +
                                          s->time_ns[KARST_STAGE_FINALISE]);
    double cost_ns_px = drawn_ns / (double)s->num_pixels;
    double other_ns = fmax(0, (double)frame_ns - drawn_ns - made_ns);
    double smoothing = r->cost_ns_px > 0 ? SMOOTHING : 1;
    r->cost_ns_px += smoothing * (cost_ns_px - r->cost_ns_px);
    r->other_ns += smoothing * (fmin(other_ns, target_ns / 2) - r->other_ns);
    if (!moving || r->share == 0)
        return;
    r->more_use += (double)frame_ns > target_ns ? -USE_LESS : USE_MORE;
    r->more_use = fmax(LEAST_USE - FIRST_USE, fmin(MOST_USE - FIRST_USE, r->more_use));
    int affordable = affordable_share(v);
    if (affordable < r->share) { /* at once */
        r->moving_share = affordable;
        r->calm_frames = 0;
    } else if (affordable > r->share && ++r->calm_frames >= CALM_FRAMES) { /* carefully */
        r->moving_share = clamp_share(r->share + 1);
        r->calm_frames = 0;
    }
}
