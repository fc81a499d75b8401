/* The table of keys: what there is, for the help in the window, for the manual, and for what happens. */
#include "demos/view/view.h"

#define ANY (-1)
#define SHIFT GLFW_MOD_SHIFT
#define CTRL GLFW_MOD_CONTROL

/* clang-format off */
const view_key view_keys[] = {
    {"Moving", "W A S D", "forward, left, back, right; in orbit: nearer, around, farther, around",
     {{GLFW_KEY_W, ANY, VIEW_DO_NOTHING}, {GLFW_KEY_A, ANY, VIEW_DO_NOTHING}, {GLFW_KEY_S, ANY, VIEW_DO_NOTHING},
      {GLFW_KEY_D, ANY, VIEW_DO_NOTHING}}},
    {NULL, "E Q", "up, down; walking, E jumps",
     {{GLFW_KEY_E, ANY, VIEW_DO_NOTHING}, {GLFW_KEY_Q, ANY, VIEW_DO_NOTHING}}},
    {NULL, "Shift, Ctrl", "held: ten times as fast, ten times as slow", {{0}}},
    {NULL, "Wheel, + -", "speed, from 1 mm/s to 10^9 m/s",
     {{GLFW_KEY_EQUAL, ANY, VIEW_DO_FASTER}, {GLFW_KEY_KP_ADD, ANY, VIEW_DO_FASTER},
      {GLFW_KEY_MINUS, ANY, VIEW_DO_SLOWER}, {GLFW_KEY_KP_SUBTRACT, ANY, VIEW_DO_SLOWER}}},
    {NULL, "Drag, arrows", "look around",
     {{GLFW_KEY_LEFT, ANY, VIEW_DO_SLIDER_LESS}, {GLFW_KEY_RIGHT, ANY, VIEW_DO_SLIDER_MORE},
      {GLFW_KEY_UP, ANY, VIEW_DO_SLIDER_UP}, {GLFW_KEY_DOWN, ANY, VIEW_DO_SLIDER_DOWN}}},
    {NULL, "L, right button", "the mouse looks without dragging, or no longer", {{GLFW_KEY_L, ANY, VIEW_DO_MOUSE}}},
    {NULL, "M", "fly, walk, orbit around what is under the cross-hair", {{GLFW_KEY_M, ANY, VIEW_DO_MODE}}},
    {NULL, "[ ]", "narrower, wider field of view",
     {{GLFW_KEY_LEFT_BRACKET, ANY, VIEW_DO_NARROWER}, {GLFW_KEY_RIGHT_BRACKET, ANY, VIEW_DO_WIDER}}},
    {"Places", "Home", "where the world begins", {{GLFW_KEY_HOME, ANY, VIEW_DO_HOME}}},
    {NULL, "1 to 9", "to a bookmark; with Ctrl: keep this place as one", {{0}}},
    {NULL, "G", "go to coordinates, typed", {{GLFW_KEY_G, ANY, VIEW_DO_GO_TO}}},
    {NULL, "C", "copy this place as a command line", {{GLFW_KEY_C, ANY, VIEW_DO_COPY}}},
    {"World", "O, a file dropped", "open another world here: a name, or a file", {{GLFW_KEY_O, ANY, VIEW_DO_OPEN}}},
    {NULL, "P", "parameters; arrows choose and change them (Shift: more, Ctrl: less)",
     {{GLFW_KEY_P, ANY, VIEW_DO_SLIDERS}}},
    {NULL, "Backspace", "the chosen parameter as it was; with Shift: all of them",
     {{GLFW_KEY_BACKSPACE, 0, VIEW_DO_SLIDER_RESET}, {GLFW_KEY_BACKSPACE, SHIFT, VIEW_DO_SLIDER_RESET_ALL}}},
    {NULL, "F2", "save the parameters into the world file", {{GLFW_KEY_F2, ANY, VIEW_DO_SAVE_WORLD}}},
    {NULL, "F5", "read the world file again (saving it does so too)", {{GLFW_KEY_F5, ANY, VIEW_DO_RELOAD}}},
    {"Changing", "B, Shift+B", "the next tool: add, dig, smooth, flatten, paint, stamp, none; the one before",
     {{GLFW_KEY_B, 0, VIEW_DO_NEXT_TOOL}, {GLFW_KEY_B, SHIFT, VIEW_DO_PREVIOUS_TOOL}}},
    {NULL, "Left button", "with a tool: it works under the cross-hair; dragging looks around, as ever", {{0}}},
    {NULL, "Wheel", "with a tool: its size; with Shift: its strength; with Ctrl: the speed", {{0}}},
    {NULL, "K, Shift+K", "another colour of paint, another stamp",
     {{GLFW_KEY_K, 0, VIEW_DO_NEXT_KIND}, {GLFW_KEY_K, SHIFT, VIEW_DO_PREVIOUS_KIND}}},
    {NULL, "Ctrl+Z, Ctrl+Y", "undo the last stroke; do it again",
     {{GLFW_KEY_Z, CTRL, VIEW_DO_UNDO}, {GLFW_KEY_Z, CTRL | SHIFT, VIEW_DO_REDO}, {GLFW_KEY_Y, CTRL, VIEW_DO_REDO}}},
    {NULL, "F4", "keep the edits in a new saved world; a saved world is saved as one goes",
     {{GLFW_KEY_F4, 0, VIEW_DO_KEEP_EDITS}}},
    {"Seeing", "Tab", "panels: none, status, frame times, cache", {{GLFW_KEY_TAB, ANY, VIEW_DO_PAGE}}},
    {NULL, "V, Shift+V", "the picture; level, bricks, steps, age, produced, provisional, depth, normal, albedo, "
     "occlusion, bounces",
     {{GLFW_KEY_V, 0, VIEW_DO_NEXT_VIEW}, {GLFW_KEY_V, SHIFT, VIEW_DO_PREVIOUS_VIEW}}},
    {NULL, "Page Up, Down", "the sun higher, lower; with Shift: round the sky; with Ctrl: as the world says",
     {{GLFW_KEY_PAGE_UP, 0, VIEW_DO_SUN_HIGHER}, {GLFW_KEY_PAGE_DOWN, 0, VIEW_DO_SUN_LOWER},
      {GLFW_KEY_PAGE_UP, SHIFT, VIEW_DO_SUN_EAST}, {GLFW_KEY_PAGE_DOWN, SHIFT, VIEW_DO_SUN_WEST},
      {GLFW_KEY_PAGE_UP, CTRL, VIEW_DO_SUN_RESET}, {GLFW_KEY_PAGE_DOWN, CTRL, VIEW_DO_SUN_RESET}}},
    {NULL, "Middle button", "held: dragging moves the sun", {{0}}},
    {NULL, "X, Shift+X", "brighter, darker, by a third of a stop; Ctrl+X: as the world says",
     {{GLFW_KEY_X, 0, VIEW_DO_BRIGHTER}, {GLFW_KEY_X, SHIFT, VIEW_DO_DARKER},
      {GLFW_KEY_X, CTRL, VIEW_DO_EXPOSURE_RESET}}},
    {NULL, "T, comma, period", "time runs or stands; a tenth of a second earlier, later; Ctrl+T: as at the start",
     {{GLFW_KEY_T, 0, VIEW_DO_TIME}, {GLFW_KEY_T, CTRL, VIEW_DO_TIME_RESET},
      {GLFW_KEY_COMMA, ANY, VIEW_DO_TIME_EARLIER}, {GLFW_KEY_PERIOD, ANY, VIEW_DO_TIME_LATER}}},
    {NULL, "F9", "fewer pixels while moving, or always all", {{GLFW_KEY_F9, ANY, VIEW_DO_RESOLUTION}}},
    {NULL, "F11", "full screen", {{GLFW_KEY_F11, ANY, VIEW_DO_FULLSCREEN}}},
    {"Leaving with", "F12, Shift+F12", "a picture as PNG; as EXR, with depth and normals",
     {{GLFW_KEY_F12, 0, VIEW_DO_PICTURE}, {GLFW_KEY_F12, SHIFT, VIEW_DO_PICTURE_EXR}}},
    {NULL, "F6, F7", "record a path, and end; fly along the last one, and stop",
     {{GLFW_KEY_F6, ANY, VIEW_DO_RECORD}, {GLFW_KEY_F7, ANY, VIEW_DO_REPLAY}}},
    {NULL, "F8", "record a video, and end", {{GLFW_KEY_F8, ANY, VIEW_DO_VIDEO}}},
    {NULL, "F3", "write statistics", {{GLFW_KEY_F3, ANY, VIEW_DO_STATISTICS}}},
    {"This", "H, ?, F1", "these keys",
     {{GLFW_KEY_H, ANY, VIEW_DO_HELP}, {GLFW_KEY_SLASH, SHIFT, VIEW_DO_HELP}, {GLFW_KEY_F1, ANY, VIEW_DO_HELP}}},
    {NULL, "Esc", "close what is open; twice in a row: leave", {{GLFW_KEY_ESCAPE, ANY, VIEW_DO_ESCAPE}}},
};
/* clang-format on */
const size_t view_num_keys = sizeof view_keys / sizeof *view_keys;

void view_keys_print(FILE *file)
{
    for (size_t i = 0; i < view_num_keys; i++) {
        if (view_keys[i].section)
            fprintf(file, "  %s\n", view_keys[i].section);
        fprintf(file, "    %-16s %s\n", view_keys[i].label, view_keys[i].help);
    }
}

/* Minus signs that may be typed again. */
static void print_escaped(FILE *file, const char *text)
{
    for (; *text; text++)
        fprintf(file, *text == '-' ? "\\-" : *text == '\\' ? "\\e" : "%c", *text);
}

void view_keys_print_manual(FILE *file)
{
    for (size_t i = 0; i < view_num_keys; i++) {
        if (view_keys[i].section)
            fprintf(file, ".SS %s\n", view_keys[i].section);
        fputs(".TP\n.B \"", file);
        print_escaped(file, view_keys[i].label);
        fputs("\"\n", file);
        print_escaped(file, view_keys[i].help);
        fputs("\n", file);
    }
}
