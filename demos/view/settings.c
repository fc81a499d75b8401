/* Flags over environment over configuration over defaults; and what is remembered from one run to the next. */
#include "demos/view/view.h"

#include <ctype.h>
#include <errno.h>
#include <jansson.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#define MAX_OPTIONS 40
#define ENVIRONMENT "KARST_VIEW_"

typedef struct {
    command_option options[MAX_OPTIONS];
    size_t num;
} option_table;

/* The one table; `o` and `talk` receive the values. */
static option_table make_table(view_settings *o, command_talk *talk)
{
    const command_option options[] = {
        {"size", 0, COMMAND_SIZE, "WxH", "of the window, pixels (default: as last time; 1280x720)", o->size_px, 1,
         16384, &o->has_size},
        {"fullscreen", 0, COMMAND_FLAG, NULL, "fill the screen", &o->fullscreen, 0, 0, NULL},
        {"camera", 0, COMMAND_TEXT, "X,Y,Z,YAW,PITCH[,FOV]",
         "metres, exact at any distance, and degrees (default: the world's)", &o->camera, 0, 0, NULL},
        {"mode", 0, COMMAND_TEXT, "MODE", "fly, walk or orbit (default: fly)", &o->mode, 0, 0, NULL},
        {"speed", 0, COMMAND_NUMBER, "M/S", "to begin with (default: a hundredth of the view distance)", &o->speed_m_s,
         VIEW_MIN_SPEED_M_S, VIEW_MAX_SPEED_M_S, NULL},
        {"eye", 0, COMMAND_NUMBER, "M", "height of the eye above the ground when walking (default: 1.7)", &o->eye_m,
         1e-6, 1e6, NULL},
        {"fps", 0, COMMAND_NUMBER, "F", "frames a second to hold while moving, by fewer pixels (default: 30)", &o->fps,
         1, 1000, NULL},
        {"fixed-resolution", 0, COMMAND_FLAG, NULL, "draw all pixels, however long it takes", &o->fixed_resolution, 0,
         0, NULL},
        {"view", 0, COMMAND_TEXT, "VIEW", "picture, level, bricks, steps, age, produced, provisional, depth or normal",
         &o->view, 0, 0, NULL},
        {"replay", 0, COMMAND_TEXT, "PATH", "fly along a path, and leave at its end: a file, or walk, low-flight, ...",
         &o->replay, 0, 0, NULL},
        {"stats", 0, COMMAND_TEXT, "FILE", "write figures of the run as JSON when leaving, and on F3; - is stdout",
         &o->stats, 0, 0, NULL},
        {"folder", 0, COMMAND_TEXT, "FOLDER", "where pictures, paths and videos go (default: here)", &o->folder, 0, 0,
         NULL},
        {"hidden-hud", 0, COMMAND_FLAG, NULL, "begin without panels", &o->hidden_hud, 0, 0, NULL},
        {"scale", 0, COMMAND_NUMBER, "X", "size of type and panels (default: what the display says)", &o->scale, 0.25,
         8, NULL},
        {"view-samples", 0, COMMAND_INTEGER, "N", "rays for each pixel of a view that stands (default: 64)",
         &o->look.samples, 1, KARST_ENGINE_MAX_SAMPLES, NULL},
        COMMAND_TONE_OPTIONS(&o->look),
        {"detail", 0, COMMAND_NUMBER, "PX", "pixels that a voxel may be wide (default: 1)", &o->detail_px, 0.25, 64,
         NULL},
        {"view-distance", 0, COMMAND_NUMBER, "M", "metres at which rays end (default: the world's)",
         &o->view_distance_m, 1e-9, 1e18, NULL},
        {"time", 0, COMMAND_NUMBER, "S", "the world's time to begin with, of its particles and iTime (default: 0)",
         &o->time_s, -1e6, 1e6, NULL},
        {"edits", 0, COMMAND_TEXT, "FILE", "show the world with the edits of a file: docs/EDITS.md", &o->edits, 0, 0,
         NULL},
        {"seed", 0, COMMAND_INTEGER, "N", "instead of the world's own", &o->seed, 0, 4294967295.0, &o->has_seed},
        {"param", 0, COMMAND_PARAMETERS, "NAME=VALUE", "a parameter of the world file; may be given again",
         &o->parameters, 0, 0, NULL},
        {"no-shadows", 0, COMMAND_FLAG, NULL, "cast no shadow rays", &o->no_shadows, 0, 0, NULL},
        {"brick-bits", 0, COMMAND_INTEGER, "N", "bits of a density sample in memory: 8, 16 or 32 (default: 16)",
         &o->brick_bits, 8, 32, NULL},
        {"pool", 0, COMMAND_NUMBER, "MIB", "memory for tiles and bricks together (default: 512)", &o->pool_mib, 0,
         16777216, NULL},
        {"device", 0, COMMAND_TEXT, "DEVICE", "number or part of the name from karst info; cpu; gpu", &o->device, 0, 0,
         NULL},
        {"lanes", 0, COMMAND_INTEGER, "N",
         "rays and samples a work-item handles, 1 or 16 (default: what suits the device)", &o->lanes, 1, 16, NULL},
        {"keys", 0, COMMAND_TEXT, "HOW", "print the keys as text or for a manual, and leave", &o->keys, 0, 0, NULL},
        {"quiet", 'q', COMMAND_FLAG, NULL, "say nothing but warnings and errors", &talk->quiet, 0, 0, NULL},
        {"verbose", 'v', COMMAND_FLAG, NULL, "say what the library does", &talk->verbose, 0, 0, NULL},
    };
    option_table table = {.num = sizeof options / sizeof *options};
    _Static_assert(sizeof options / sizeof *options <= MAX_OPTIONS, "the table holds all options");
    memcpy(table.options, options, sizeof options);
    return table;
}

void view_settings_print_help(void)
{
    view_settings ignored = {0};
    command_talk talk = {0};
    option_table table = make_table(&ignored, &talk);
    puts("karst view WORLD [OPTIONS]\n"
         "Opens a window on a world: fly, walk, change the world file in an editor and see it change.\n"
         "\nKeys (H shows them in the window):");
    view_keys_print(stdout);
    puts("\nOptions:");
    command_print_options(stdout, table.options, table.num);
    puts("\nWorlds (or the path of a world file, which ends in .karst):");
    command_print_worlds(stdout);
    puts("\nExamples:\n"
         "  karst view hills\n"
         "  karst view mine.karst --param relief=250      and edit mine.karst meanwhile\n"
         "  karst view hills --replay low-flight --stats run.json\n"
         "\nEvery option may also stand in $XDG_CONFIG_HOME/karst/config (~/.config/karst/config), a line each, such "
         "as\n"
         "\"fps = 60\" or \"no-shadows = yes\", and in the environment, such as KARST_VIEW_FPS=60. Flags count most, "
         "then the\n"
         "environment, then that file.\n"
         "\nExit code: 0 done, 1 failed, 2 wrong usage, 3 no usable device or no window, 4 no such world, 5 a path "
         "that\n"
         "cannot be read.");
}

/* ---- the three sources ---- */

/* Sets one option from outside the command line; `where` names the place for messages. */
static bool set_from_text(option_table *table, const char *name, const char *value, const char *where,
                          karst_error *error)
{
    const command_option *option = NULL;
    for (size_t i = 0; i < table->num; i++)
        if (strcmp(table->options[i].name, name) == 0)
            option = &table->options[i];
    if (!option || strcmp(name, "keys") == 0)
        return karst_fail(error, KARST_USAGE, "%s: there is no option '%s'; karst help view lists them", where, name);
    if (option->kind == COMMAND_FLAG) {
        static const char *const yes[] = {"yes", "true", "1", "on"}, *const no[] = {"no", "false", "0", "off"};
        for (int i = 0; i < 4; i++)
            if (strcmp(value, yes[i]) == 0 || strcmp(value, no[i]) == 0) {
                *(bool *)option->value = strcmp(value, yes[i]) == 0;
                return true;
            }
        return karst_fail(error, KARST_USAGE, "%s: %s is yes or no, not '%s'", where, name, value);
    }
    char *kept = strdup(value); /* texts are borrowed by the settings: as long as the program */
    char flag[64];
    snprintf(flag, sizeof flag, "--%s", name);
    size_t num_words;
    bool help;
    karst_error reason = {0};
    const char *words[1];
    if (kept && command_parse(2, (char *[]){flag, kept, NULL}, option, 1, words, 1, &num_words, &help, &reason))
        return true;
    free(kept);
    return karst_fail(error, KARST_USAGE, "%s: %s", where, *reason.message ? reason.message : "out of memory");
}

#define VARIABLE_SIZE 64
static void name_variable(const char *option, char name[VARIABLE_SIZE])
{
    size_t length = (size_t)snprintf(name, VARIABLE_SIZE, ENVIRONMENT);
    for (; *option && length + 1 < VARIABLE_SIZE; option++)
        name[length++] = *option == '-' ? '_' : (char)toupper((unsigned char)*option);
    name[length] = 0;
}

bool command_view_has_variable(const char *name)
{
    static view_settings nobody;
    command_talk talk = {0};
    const option_table table = make_table(&nobody, &talk);
    bool found = false;
    for (size_t i = 0; i < table.num && !found; i++) {
        char variable[VARIABLE_SIZE];
        name_variable(table.options[i].name, variable);
        found = strcmp(variable, name) == 0;
    }
    return found;
}

static bool read_environment(option_table *table, karst_error *error)
{
    for (size_t i = 0; i < table->num; i++) {
        char name[VARIABLE_SIZE];
        name_variable(table->options[i].name, name);
        const char *value = getenv(name);
        if (value && *value && !set_from_text(table, table->options[i].name, value, name, error))
            return false;
    }
    return true;
}

/* A folder of the user's: $VARIABLE, or ~/FALLBACK. */
static bool user_folder(const char *variable, const char *fallback, char *path, size_t size_bytes)
{
    const char *folder = getenv(variable), *home = getenv("HOME");
    int length = folder && folder[0] == '/' ? snprintf(path, size_bytes, "%s/karst", folder)
                 : home && *home            ? snprintf(path, size_bytes, "%s/%s/karst", home, fallback)
                                            : -1;
    return length > 0 && (size_t)length < size_bytes;
}

static char *trim(char *text)
{
    while (isspace((unsigned char)*text))
        text++;
    size_t length = strlen(text);
    while (length && isspace((unsigned char)text[length - 1]))
        text[--length] = 0;
    return text;
}

static bool read_configuration(option_table *table, karst_error *error)
{
    char folder[PATH_MAX - 16], path[PATH_MAX], line[1024];
    if (!user_folder("XDG_CONFIG_HOME", ".config", folder, sizeof folder))
        return true;
    snprintf(path, sizeof path, "%s/config", folder);
    FILE *file = fopen(path, "r");
    if (!file)
        return errno == ENOENT || errno == ENOTDIR ||
               karst_fail(error, KARST_USAGE, "cannot read %s: %s", path, strerror(errno));
    bool good = true;
    for (int number = 1; good && fgets(line, sizeof line, file); number++) {
        char *name = trim(line), *equals = strchr(name, '='), where[PATH_MAX + 16];
        if (!*name || *name == '#')
            continue;
        snprintf(where, sizeof where, "%s:%d", path, number);
        if (!equals) {
            good = karst_fail(error, KARST_USAGE, "%s: a line is NAME = VALUE, such as fps = 60", where);
            break;
        }
        *equals = 0;
        good = set_from_text(table, trim(name), trim(equals + 1), where, error);
    }
    fclose(file);
    return good;
}

bool view_settings_read(view_settings *o, int argc, char **argv, command_talk *talk, const char **world,
                        karst_error *error)
{
    *o = (view_settings){.size_px = {1280, 720}, .pool_mib = 512, .detail_px = 1, .fps = 30, .eye_m = 1.7};
    o->look.samples = 64;
    o->folder = ".";
    option_table table = make_table(o, talk);
    size_t num_words;
    /* The command line first, on a copy: --help and --keys must work whatever stands elsewhere. */
    view_settings flags = *o;
    command_talk flags_talk = *talk;
    option_table flags_table = make_table(&flags, &flags_talk);
    if (!command_parse(argc, argv, flags_table.options, flags_table.num, world, 1, &num_words, &flags.help, error))
        return false;
    if (flags.help || flags.keys) {
        *o = flags;
        return true;
    }
    bool help;
    command_parameters none = {0};
    if (!read_configuration(&table, error) || !read_environment(&table, error))
        return false;
    none = o->parameters; /* those of the file come first, flags after them */
    if (!command_parse(argc, argv, table.options, table.num, world, 1, &num_words, &help, error))
        return false;
    for (size_t i = 0; i < o->parameters.num_values; i++)
        o->parameters.values[i].name = o->parameters.names[i];
    (void)none;
    if (!num_words)
        return karst_fail(error, KARST_USAGE,
                          "which world? For example: karst view hills (karst help view lists them)");
    if (o->lanes != 0 && o->lanes != 1 && o->lanes != 16)
        return karst_fail(error, KARST_USAGE, "--lanes %d: must be 1 or 16", (int)o->lanes);
    return command_check_look(&o->look, error);
}

/* ---- memory ---- */

static bool memory_path(char *path, size_t size_bytes, bool make)
{
    char folder[PATH_MAX - 16];
    if (!user_folder("XDG_STATE_HOME", ".local/state", folder, sizeof folder))
        return false;
    for (char *p = folder + 1; make && *p; p++)
        if (*p == '/') {
            *p = 0;
            mkdir(folder, 0755);
            *p = '/';
        }
    if (make)
        mkdir(folder, 0755);
    return snprintf(path, size_bytes, "%s/view.json", folder) < (int)size_bytes;
}

static json_t *load_memory(viewer *v)
{
    char path[PATH_MAX];
    json_error_t reason;
    if (!memory_path(path, sizeof path, false))
        return NULL;
    json_t *root = json_load_file(path, 0, &reason);
    if (!root && reason.line > 0)
        command_say(v->talk, "note: %s:%d: %s; starting afresh", path, reason.line, reason.text);
    if (root && !json_is_object(root)) {
        json_decref(root);
        root = NULL;
    }
    return root;
}

void view_memory_read(viewer *v)
{
    view_memory *m = &v->memory;
    *m = (view_memory){.page = VIEW_PAGE_STATUS};
    json_t *root = load_memory(v);
    int fullscreen = 0;
    m->has_window = root && json_unpack(root, "{s:[i,i], s:[i,i]}", "size", &m->size_px[0], &m->size_px[1], "position",
                                        &m->position_px[0], &m->position_px[1]) == 0;
    for (int i = 0; i < 2 && m->has_window; i++)
        m->has_window = m->size_px[i] >= 64 && m->size_px[i] <= KARST_IMAGE_MAX_PX;
    if (root && json_unpack(root, "{s:b}", "fullscreen", &fullscreen) == 0)
        m->fullscreen = fullscreen;
    const char *page = json_string_value(json_object_get(root, "page"));
    for (int i = 0; page && i < VIEW_NUM_PAGES; i++)
        if (strcmp(page, view_page_names[i]) == 0)
            m->page = i;
    json_decref(root);
}

/* What a world's bookmarks are kept under: a sum of its text, so that it keeps them under another name, and the file,
 * so that it keeps them when it is edited by something else. "": not known. */
typedef struct {
    char sum[32], file[PATH_MAX];
} memory_keys;

static void find_keys(const viewer *v, memory_keys *keys)
{
    *keys = (memory_keys){0};
    const char *path = v->metadata ? v->metadata->path : v->world_file;
    FILE *file = fopen(path, "rb");
    uint64_t sum = 0xcbf29ce484222325u;
    for (int c; file && (c = getc(file)) != EOF;) /* FNV-1a */
        sum = (sum ^ (uint64_t)c) * 0x100000001b3u;
    if (file && !ferror(file))
        snprintf(keys->sum, sizeof keys->sum, "text-%016llx", (unsigned long long)sum);
    if (file)
        fclose(file);
    if (!realpath(path, keys->file))
        snprintf(keys->file, sizeof keys->file, "%s", v->world);
}

void view_memory_read_bookmarks(viewer *v)
{
    view_memory *m = &v->memory;
    memory_keys keys;
    find_keys(v, &keys);
    json_t *root = load_memory(v), *all = json_object_get(root, "bookmarks");
    const char *const names[] = {keys.sum, keys.file, v->world};
    json_t *marks = NULL;
    for (size_t i = 0; !marks && i < sizeof names / sizeof *names; i++)
        marks = json_object_get(all, names[i]);
    memset(m->bookmarks, 0, sizeof m->bookmarks);
    for (int i = 0; i < VIEW_NUM_BOOKMARKS; i++) {
        char key[2] = {(char)('1' + i), 0};
        const char *text = json_string_value(json_object_get(marks, key));
        if (text)
            snprintf(m->bookmarks[i], sizeof m->bookmarks[i], "%s", text);
    }
    json_decref(root);
}

void view_memory_write(viewer *v)
{
    char path[PATH_MAX];
    if (!memory_path(path, sizeof path, true))
        return;
    json_t *root = load_memory(v);
    if (!root)
        root = json_object();
    int window[4];
    memcpy(window, v->windowed, sizeof window);
    if (!v->fullscreen && v->window) {
        glfwGetWindowPos(v->window, &window[0], &window[1]);
        glfwGetWindowSize(v->window, &window[2], &window[3]);
    }
    json_object_set_new(root, "size", json_pack("[i,i]", window[2], window[3]));
    json_object_set_new(root, "position", json_pack("[i,i]", window[0], window[1]));
    json_object_set_new(root, "fullscreen", json_boolean(v->fullscreen));
    json_object_set_new(root, "page", json_string(view_page_names[v->page]));
    json_t *all = json_object_get(root, "bookmarks"), *marks = json_object();
    if (!json_is_object(all)) {
        all = json_object();
        json_object_set_new(root, "bookmarks", all);
    }
    for (int i = 0; i < VIEW_NUM_BOOKMARKS; i++) {
        char key[2] = {(char)('1' + i), 0};
        if (*v->memory.bookmarks[i])
            json_object_set_new(marks, key, json_string(v->memory.bookmarks[i]));
    }
    memory_keys keys;
    find_keys(v, &keys);
    /* A saved world keeps its own. */
    if (!karst_saved_is_name(v->world) &&
        (json_object_size(marks) || json_object_get(all, keys.sum) || json_object_get(all, keys.file))) {
        if (*keys.sum)
            json_object_set(all, keys.sum, marks);
        json_object_set(all, keys.file, marks);
    }
    json_decref(marks);
    char *text = json_dumps(root, JSON_INDENT(2));
    karst_error error = {0};
    if (text && !command_write_text(path, text, &error))
        command_say(v->talk, "note: %s", error.message);
    free(text);
    json_decref(root);
}
