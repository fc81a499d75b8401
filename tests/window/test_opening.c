/* Another world in the same window: typed after O, or dropped on it from another program. */
#include "tests/window/session.h"

#include <X11/Xatom.h>
#include <X11/Xlib.h>
#include <math.h>

#define SIZED " --size 640x480 --view-distance 600"
#define FIRST                                                                                     \
    "/*{ \"voxel\": 0.25, \"params\": { \"height\": { \"value\": 4, \"min\": 0, \"max\": 20 } },\n" \
    "    \"camera\": { \"position\": [\"0\", \"20\", \"0\"], \"yaw\": 0, \"pitch\": -30 } }*/\n"    \
    "float density(vec3 p) { return height * sin(p.x * 0.05) - p.y; }\n"
/* Other voxels, another parameter, another camera; and a world in whose file something is wrong. */
#define SECOND                                                                                      \
    "/*{ \"voxel\": 0.5, \"params\": { \"radius\": { \"value\": 9, \"min\": 1, \"max\": 20 } },\n"    \
    "    \"camera\": { \"position\": [\"7\", \"5\", \"-40\"], \"yaw\": 0, \"pitch\": 0 } }*/\n"       \
    "float density(vec3 p) { return radius - length(p); }\n"
#define WRONG "float density(vec3 p) { return nothing - p.y; }\n"

static int open_worlds(void **state)
{
    int opened = open_session(state);
    write_file("first.karst", FIRST);
    write_file("second.karst", SECOND);
    write_file("wrong.karst", WRONG);
    return opened;
}

static bool is_at(double x, double y, double z)
{
    place p = where();
    return fabs(p.x - x) < 1e-6 && fabs(p.y - y) < 1e-6 && fabs(p.z - z) < 1e-6;
}

static bool is_second(void) { return is_at(7, 5, -40) && json_object_get(viewer_value("parameters"), "radius"); }

/* While it is typed, F3 is a character's key like any other: nothing is asked before Return. */
static void type_name(const char *name)
{
    key("o");
    assert_true(act("type --delay 30 '%s'", name));
    key("Return");
    UNTIL(!yes("prompt"));
}

static void test_a_name_that_is_typed(void **state)
{
    (void)state;
    open_viewer("first.karst" SIZED " --seed 7 --param height=6");
    key("ctrl+4"); /* a bookmark of the first */
    UNTIL(strstr(text("message"), "bookmark 4"));
    type_name("wrong.karst");
    UNTIL(number("reload_errors") == 1);
    assert_true(parameter("height") == 6 && is_at(0, 20, 0)); /* the old one stays */
    assert_string_equal(text("error"), "");
    type_name("second.karst");
    UNTIL(is_second() && yes("settled"));
    assert_null(json_object_get(viewer_value("parameters"), "height"));
    key("4"); /* which this one does not have */
    UNTIL(strstr(text("message"), "there is no bookmark 4"));
    key("c");
    UNTIL(strstr(text("copied"), "karst render second.karst --camera 7,5,-40,0,0,60") != NULL);
    assert_null(strstr(text("copied"), "seed"));
    /* Now this file is the one that is watched. */
    double reloads = number("reloads");
    write_file("second.karst", SECOND "// edited\n");
    UNTIL(number("reloads") == reloads + 1);
    assert_true(is_second());
    type_name("nowhere.karst");
    UNTIL(strstr(text("message"), "nowhere.karst"));
    assert_true(is_second());
    close_viewer();
    write_file("second.karst", SECOND);
}

/* ---- a drop, as file managers do it: XDND, version 5 ---- */

static Display *display;

static Atom atom(const char *name) { return XInternAtom(display, name, False); }

static void tell(Window to, Window from, const char *message, const long data[4])
{
    XEvent e = {0};
    e.xclient.type = ClientMessage;
    e.xclient.window = to;
    e.xclient.message_type = atom(message);
    e.xclient.format = 32;
    e.xclient.data.l[0] = (long)from;
    for (int i = 0; i < 4; i++)
        e.xclient.data.l[i + 1] = data[i];
    XSendEvent(display, to, False, NoEventMask, &e);
    XFlush(display);
}

/* The window that takes drops. */
static Window find_target(Window below)
{
    Window root, parent, *children = NULL, found = None;
    unsigned num_children = 0;
    Atom type;
    int format;
    unsigned long num_items, rest;
    unsigned char *value = NULL;
    if (XGetWindowProperty(display, below, atom("XdndAware"), 0, 1, False, XA_ATOM, &type, &format, &num_items, &rest,
                           &value) == Success &&
        type == XA_ATOM)
        found = below;
    if (value)
        XFree(value);
    if (found != None || !XQueryTree(display, below, &root, &parent, &children, &num_children))
        return found;
    for (unsigned i = 0; i < num_children && found == None; i++)
        found = find_target(children[i]);
    if (children)
        XFree(children);
    return found;
}

static bool wait_for(int type, XEvent *e)
{
    for (double end_s = now_s() + WAIT_S; now_s() < end_s; nap(0.01))
        while (XPending(display)) {
            XNextEvent(display, e);
            if (e->type == type)
                return true;
        }
    return false;
}

static void drop(const char *name)
{
    char list[PATH_MAX + 16];
    XEvent e;
    snprintf(list, sizeof list, "file://%s\r\n", in_folder(name));
    display = XOpenDisplay(NULL);
    assert_non_null(display);
    Window target = find_target(DefaultRootWindow(display));
    assert_true(target != None);
    Window source = XCreateSimpleWindow(display, DefaultRootWindow(display), 0, 0, 1, 1, 0, 0, 0);
    XSetSelectionOwner(display, atom("XdndSelection"), source, CurrentTime);
    tell(target, source, "XdndEnter", (const long[]){5L << 24, (long)atom("text/uri-list"), 0, 0});
    tell(target, source, "XdndPosition",
         (const long[]){0, 100L << 16 | 100, CurrentTime, (long)atom("XdndActionCopy")});
    assert_true(wait_for(ClientMessage, &e)); /* its status */
    tell(target, source, "XdndDrop", (const long[]){0, CurrentTime, 0, 0});
    assert_true(wait_for(SelectionRequest, &e));
    const XSelectionRequestEvent asked = e.xselectionrequest;
    XChangeProperty(display, asked.requestor, asked.property, asked.target, 8, PropModeReplace,
                    (const unsigned char *)list, (int)strlen(list));
    XEvent answer = {0};
    answer.xselection.type = SelectionNotify;
    answer.xselection.requestor = asked.requestor;
    answer.xselection.selection = asked.selection;
    answer.xselection.target = asked.target;
    answer.xselection.property = asked.property;
    answer.xselection.time = asked.time;
    XSendEvent(display, asked.requestor, False, NoEventMask, &answer);
    XFlush(display);
    assert_true(wait_for(ClientMessage, &e)); /* that it is done */
    XCloseDisplay(display);
}

static void test_a_file_that_is_dropped(void **state)
{
    (void)state;
    open_viewer("first.karst" SIZED);
    drop("second.karst");
    UNTIL(is_second());
    close_viewer();
}

static void test_edits_keep_their_window(void **state)
{
    (void)state;
    char command[2 * PATH_MAX + 100];
    snprintf(command, sizeof command, "cd '%s' && '%s' new -q kept.karstdb --from first.karst", s.folder, s.karst);
    assert_int_equal(system(command), 0);
    open_viewer("kept.karstdb" SIZED);
    type_name("second.karst");
    UNTIL(strstr(text("message"), "karst view second.karst"));
    assert_false(is_second());
    close_viewer();
}

int main(void)
{
    if (is_left_out())
        return 0;
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_a_name_that_is_typed),
                                       cmocka_unit_test(test_a_file_that_is_dropped),
                                       cmocka_unit_test(test_edits_keep_their_window)};
    return cmocka_run_group_tests_name("opening", tests, open_worlds, close_session);
}
