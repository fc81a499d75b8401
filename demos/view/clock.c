/* The world's time, which stands or runs: where particles are, and what a text knows as iTime. */
#include <math.h>

#include "demos/view/view.h"

/* Until time is too large for steps of a frame to count. */
#define MOST_S 1e6

static bool set_time(viewer *v, double time_s)
{
    karst_error error = {0};
    const double before_s = karst_engine_time(v->engine);
    time_s = fmax(-MOST_S, fmin(MOST_S, time_s));
    if (karst_engine_set_time(v->engine, time_s, &error))
        return time_s != before_s;
    v->time_runs = false;
    view_complain(v, "time: %s", error.message);
    return false;
}

void view_time_toggle(viewer *v)
{
    v->time_runs = !v->time_runs;
    if (v->time_runs)
        view_toast(v, "time runs");
    else
        view_toast(v, "time stands at %g s", karst_engine_time(v->engine));
}

void view_time_step(viewer *v, double step_s)
{
    v->time_runs = false;
    if (set_time(v, step_s == 0 ? v->settings.time_s : karst_engine_time(v->engine) + step_s)) {
        v->settled = false;
        view_toast(v, "time: %g s", karst_engine_time(v->engine));
    }
}

bool view_time_turn(viewer *v, double dt_s)
{
    return v->time_runs && set_time(v, karst_engine_time(v->engine) + dt_s);
}
