/* Tools that change the land under the cross-hair. What is laid goes to the engine, to the sampler that one walks by,
 * and to the world's file, in this order; what this session laid is kept here as well. */
#include "demos/view/view.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define SIZE_STEPS_PER_DECADE 16.0
#define STRENGTH_STEP 0.05
#define LEAST_STRENGTH 0.05
#define FIRST_SIZE 0.05 /* of the distance */

/* ---- choosing ---- */

/* Nothing is edited before it is known where that goes. */
static bool get_ready(viewer *v)
{
    view_edits *e = &v->edits;
    if (!view_walk_begin(v)) /* it says why */
        return false;
    view_edits_begin(v);
    if (e->brush.size_m > 0)
        return true;
    e->brush.strength = 0.5;
    e->brush.size_m = FIRST_SIZE * (v->probe.hit && v->probe.depth_m > 0 ? v->probe.depth_m : 10 * v->motion.speed_m_s);
    view_brush_resize(v, 0);
    return true;
}

void view_brush_choose(viewer *v, int by)
{
    view_edits *e = &v->edits;
    if (e->brush.tool == VIEW_NO_TOOL && !get_ready(v))
        return;
    view_brush_lift(v);
    e->brush.tool = (view_tool)(((int)e->brush.tool + by + VIEW_NUM_TOOLS) % VIEW_NUM_TOOLS);
    v->hud_dirty = true;
    if (e->brush.tool == VIEW_NO_TOOL)
        view_toast(v, "the brush is put away");
    else
        view_toast(v, "%s: the left button; the wheel for the size, with Shift for the strength",
                   view_tool_names[e->brush.tool]);
}

void view_brush_put_away(viewer *v)
{
    view_brush_lift(v);
    v->edits.brush.tool = VIEW_NO_TOOL;
    v->hud_dirty = true;
}

void view_brush_resize(viewer *v, double steps)
{
    view_brush *brush = &v->edits.brush;
    const double voxel_m = ldexp(1, karst_engine_voxel_log2_m(v->engine));
    const double most_m = v->metadata ? v->metadata->view_distance_m : 1e6;
    const double size_m = brush->size_m * pow(10, steps / SIZE_STEPS_PER_DECADE);
    brush->size_m = fmin(fmax(most_m, voxel_m), fmax(voxel_m, size_m));
    v->hud_dirty = true;
}

void view_brush_strengthen(viewer *v, double steps)
{
    view_brush *brush = &v->edits.brush;
    const double strength = round((brush->strength + steps * STRENGTH_STEP) / STRENGTH_STEP) * STRENGTH_STEP;
    brush->strength = fmin(1, fmax(LEAST_STRENGTH, strength));
    v->hud_dirty = true;
}

void view_brush_vary(viewer *v, int by)
{
    view_brush *brush = &v->edits.brush;
    if (brush->tool == VIEW_TOOL_PAINT) {
        brush->paint = (brush->paint + by + VIEW_NUM_PAINTS) % VIEW_NUM_PAINTS;
        view_toast(v, "paint: %s", view_paints[brush->paint].name);
    } else if (brush->tool == VIEW_TOOL_STAMP) {
        brush->stamp = (view_stamp)(((int)brush->stamp + by + VIEW_NUM_STAMPS) % VIEW_NUM_STAMPS);
        view_toast(v, "stamp: %s", view_stamp_names[brush->stamp]);
    } else {
        view_toast(v, "paint has colours, and stamp has shapes: B chooses a tool");
    }
}

/* ---- what this session did ---- */

static bool make_room(void **list, size_t *most, size_t num, size_t size_bytes)
{
    if (num < *most)
        return true;
    const size_t more = *most ? 2 * *most : 64;
    void *larger = realloc(*list, more * size_bytes);
    if (!larger)
        return false;
    *list = larger;
    *most = more;
    return true;
}

/* The engine has taken it; what was undone is gone. */
static bool note(view_edits *e, const karst_edit *edit, size_t num_in_force)
{
    if (!make_room((void **)&e->edits, &e->max_edits, e->num_edits, sizeof *e->edits) ||
        !make_room((void **)&e->strokes, &e->max_strokes, e->stroke, sizeof *e->strokes))
        return false;
    if (num_in_force < e->num_before)
        e->num_before = num_in_force;
    e->num_edits = num_in_force - e->num_before;
    e->edits[e->num_edits++] = *edit;
    if (e->is_open) {
        e->strokes[e->stroke - 1]++;
    } else {
        e->strokes[e->stroke++] = 1;
        e->is_open = true;
    }
    e->num_strokes = e->stroke;
    return true;
}

/* False: the edit is not made, and it was said why. */
static bool lay(viewer *v, const karst_edit *edit)
{
    view_edits *e = &v->edits;
    karst_error error = {0};
    size_t redoable, num_in_force = karst_engine_num_edits(v->engine, &redoable);
    if (num_in_force + redoable == 0)
        view_show_message(v, "the first edit: what edits need is being compiled\u2026");
    else if (edit->has_colour && !e->has_painted)
        view_show_message(v, "the first paint: what colours need is being compiled\u2026");
    e->has_painted = e->has_painted || edit->has_colour;
    if (!karst_engine_edit(v->engine, edit, 1, &error)) {
        view_complain(v, "%s", error.message);
        return false;
    }
    v->settled = false;
    v->hud_dirty = true;
    if (!note(e, edit, num_in_force)) { /* so that no edit is there that cannot be kept */
        size_t one = 1;
        karst_engine_undo(v->engine, &one, NULL);
        view_complain(v, "out of memory: the edit is taken back");
        return false;
    }
    if (!karst_sampler_append_edits(v->sampler, edit, 1, &error))
        view_complain(v, "walking knows nothing of this edit: %s", error.message);
    if (e->journal)
        view_journal_append(e->journal, edit, 1);
    return true;
}

/* ---- the button ---- */

void view_brush_press(viewer *v)
{
    view_edits *e = &v->edits;
    view_brush_lift(v);
    e->stroke_now = (view_stroke){0};
    e->num_frozen = karst_engine_num_edits(v->engine, NULL);
    e->is_down = true;
}

void view_brush_release(viewer *v)
{
    view_edits *e = &v->edits;
    if (e->is_down && e->stroke_now.num_laid == 0)
        e->is_ending = true; /* a click between two frames is a touch */
    else
        view_brush_lift(v);
}

void view_brush_lift(viewer *v) { v->edits.is_down = v->edits.is_ending = v->edits.is_open = false; }

/* What is due now, of the land that the stroke is on; false: nothing. */
static bool find_edit(viewer *v, karst_edit *edit)
{
    view_edits *e = &v->edits;
    view_spot spot;
    const view_ground ground = view_edits_ground(v);
    view_due due = VIEW_NOT_DUE;
    view_edits_freeze(v);
    bool found = view_edits_find_spot(v, &spot);
    if (found)
        due = view_stroke_due(&e->stroke_now, &e->brush, &spot, v->now_s, ground.voxel_log2_m);
    if (due == VIEW_DUE_BY_TIME) {
        e->num_frozen = karst_engine_num_edits(v->engine, NULL);
        view_edits_freeze(v);
        found = view_edits_find_spot(v, &spot);
    }
    found = found && due != VIEW_NOT_DUE &&
            view_stroke_lay(&e->stroke_now, &e->brush, &spot, v->now_s, &ground, edit);
    view_edits_thaw(v);
    return found;
}

void view_brush_step(viewer *v)
{
    view_edits *e = &v->edits;
    karst_edit edit;
    if (!e->is_down || e->brush.tool == VIEW_NO_TOOL || !v->sampler)
        return;
    if (find_edit(v, &edit) && !lay(v, &edit))
        view_brush_lift(v);
    if (e->is_ending)
        view_brush_lift(v);
}

/* ---- undo and redo ---- */

/* How many edits to go back or forth: a stroke of this session, or one from before it. */
static size_t next_step(const view_edits *e, size_t num_in_force, bool back)
{
    if (back)
        return num_in_force > e->num_before && e->stroke ? e->strokes[e->stroke - 1] : 1;
    return num_in_force >= e->num_before && e->stroke < e->num_strokes ? e->strokes[e->stroke] : 1;
}

void view_edits_undo(viewer *v, bool back)
{
    view_edits *e = &v->edits;
    karst_error error = {0};
    if (!get_ready(v))
        return;
    view_brush_lift(v);
    size_t num_in_force = karst_engine_num_edits(v->engine, NULL), num = next_step(e, num_in_force, back);
    const bool is_stroke = back ? num_in_force > e->num_before : num_in_force >= e->num_before;
    if (!(back ? karst_engine_undo : karst_engine_redo)(v->engine, &num, &error)) {
        view_complain(v, "%s", error.message);
        return;
    }
    if (num == 0) {
        view_toast(v, back ? "there is nothing to undo" : "there is nothing to do again");
        return;
    }
    if (is_stroke && back && e->stroke)
        e->stroke--;
    else if (is_stroke && !back && e->stroke < e->num_strokes)
        e->stroke++;
    num_in_force = karst_engine_num_edits(v->engine, NULL);
    if (v->sampler)
        karst_sampler_keep_edits(v->sampler, num_in_force);
    if (e->journal)
        (back ? view_journal_undo : view_journal_redo)(e->journal, num);
    v->settled = false;
    view_toast(v, "%s: %zu edit%s", back ? "undone" : "done again", num, num == 1 ? "" : "s");
}
