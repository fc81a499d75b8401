/* karst check: what there is to say of a world file. */
#include "command.h"

#include <jansson.h>
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    command_parameters parameters;
    uint64_t seed;
    const char *device;
    bool has_seed, quiet, json;
} check_options;

static void print_help(const command_option *options, size_t num_options)
{
    puts("karst check WORLD [OPTIONS]\n"
         "Compiles a world and reports: mistakes and warnings with their lines; parameters, and which of them decide "
         "the\n"
         "program; noises, and which are separable (fast); what is proven of its steepness, and what cannot be "
         "bounded;\n"
         "how far from the origin it is precise; the estimated cost of a voxel; whether the device's compiler takes "
         "what\n"
         "is made of it. Only this needs a device.\n"
         "\nOptions:");
    command_print_options(stdout, options, num_options);
    puts("\nWorlds (or the path of a world file, which ends in .karst):");
    command_print_worlds(stdout);
    puts("\nExamples:\n"
         "  karst check mine.karst\n"
         "  karst check alps --param relief=900\n"
         "  karst check -q mine.karst && karst render mine.karst\n"
         "\nExit code: 0 it compiles, 1 failed, 2 wrong usage, 4 no such world, or one that does not compile.");
}

static void print_line(void *user, const char *line)
{
    char renamed[4096];
    fputs(command_name_stdin(line, renamed, sizeof renamed), user);
    fputc('\n', user);
}

/* What is said before it is known whether the world compiles: the report repeats it if so. */
typedef struct {
    char *text;
    size_t length;
} kept_lines;

static void keep_line(void *user, karst_log_level level, const char *line)
{
    (void)level;
    kept_lines *kept = user;
    size_t more = strlen(line) + 1;
    char *text = realloc(kept->text, kept->length + more + 1);
    if (!text)
        return;
    kept->text = text;
    memcpy(text + kept->length, line, more - 1);
    kept->length += more;
    memcpy(text + kept->length - 1, "\n", 2);
}

static void say_lines(command_talk *talk, char *lines)
{
    for (char *line = lines, *end; line && *line; line = end + 1) {
        end = strchr(line, '\n');
        *end = '\0';
        command_say_diagnostic(talk, line);
    }
}

/* ---- as JSON ---- */

static void add_line(void *user, const char *line)
{
    char renamed[4096];
    json_array_append_new(user, json_string(command_name_stdin(line, renamed, sizeof renamed)));
}

/* FILE:LINE:COLUMN: error: TEXT, taken apart; what stands under it (the line itself, the caret) is left out. */
static json_t *describe_diagnostics(const char *lines)
{
    json_t *all = json_array();
    for (const char *line = lines, *end; line && *line && (end = strchr(line, '\n')); line = end + 1) {
        char text[4096], renamed[4096];
        snprintf(text, sizeof text, "%.*s", (int)(end - line), line);
        char *error = strstr(text, ": error: "), *kind = error ? error : strstr(text, ": warning: ");
        int row = 0, column = 0;
        if (!kind)
            continue;
        const char *message = strchr(kind + 2, ':') + 2;
        *kind = 0;
        char *place = kind;
        for (int colons = 0; place > text && colons < 2; colons += *place == ':')
            place--;
        if (sscanf(place, ":%d:%d", &row, &column) == 2)
            *place = 0;
        json_array_append_new(all, json_pack("{s:s, s:i, s:i, s:s, s:s}", "file",
                                             command_name_stdin(text, renamed, sizeof renamed), "line", row, "column",
                                             column, "kind", error ? "error" : "warning", "message", message));
    }
    return all;
}

static json_t *describe_parameters(const karst_world_metadata *data)
{
    json_t *all = json_array();
    for (size_t i = 0; i < data->num_parameters; i++) {
        const karst_parameter_info *p = &data->parameters[i];
        json_t *one = json_pack("{s:s, s:s, s:s, s:f, s:b, s:b}", "name", p->name, "label", p->label, "unit", p->unit,
                                "value", p->value, "structural", p->is_structural, "used", p->is_used);
        json_object_set_new(one, "min", isfinite(p->min) ? json_real(p->min) : json_null());
        json_object_set_new(one, "max", isfinite(p->max) ? json_real(p->max) : json_null());
        json_array_append_new(all, one);
    }
    return all;
}

/* One object on stdout, whether the world compiles or not; the exit code is the same as without. */
static bool print_json(const char *name, const karst_world *world, const char *lines, const check_options *o,
                       karst_error *error)
{
    json_t *root = json_pack("{s:s, s:b, s:o}", "world", name, "compiles", world != NULL, "diagnostics",
                             describe_diagnostics(lines));
    bool good = world != NULL;
    if (world) {
        const karst_world_metadata *data = karst_world_get_metadata(world);
        json_t *report = json_array();
        karst_error why = {0};
        bool is_taken = karst_world_try_code(world, o->device, &why);
        good = karst_world_check(world, add_line, report, error);
        json_object_set_new(root, "description", json_string(data->description));
        json_object_set_new(root, "voxel_m", json_real(ldexp(1, data->voxel_log2_m)));
        json_object_set_new(root, "view_distance_m", json_real(data->view_distance_m));
        json_object_set_new(root, "seed", json_integer(data->seed));
        json_object_set_new(root, "has_colour", json_boolean(data->has_colour));
        json_object_set_new(root, "parameters", describe_parameters(data));
        json_object_set_new(root, "report", report);
        json_object_set_new(root, "device_takes_it",
                            is_taken                        ? json_true()
                            : why.status == KARST_NO_DEVICE ? json_null()
                                                            : json_false());
        if (good && !is_taken && (o->device || why.status != KARST_NO_DEVICE))
            good = karst_fail(error, why.status, "%s", why.message);
    }
    char *text = json_dumps(root, JSON_INDENT(2) | JSON_REAL_PRECISION(12));
    json_decref(root);
    if (!text)
        return karst_fail(error, KARST_FAILED, "out of memory");
    puts(text);
    free(text);
    return good;
}

/* Where there is no device, all else that was said holds. */
static bool try_code(const karst_world *world, const check_options *o, karst_error *error)
{
    karst_error why = {0};
    bool good = karst_world_try_code(world, o->device, &why);
    bool is_tried = good || o->device || why.status != KARST_NO_DEVICE;
    if (!o->quiet && (good || !is_tried))
        printf("  %s\n", good ? "the device's compiler takes it" : "not tried: no OpenCL device is there");
    return good || !is_tried || karst_fail(error, why.status, "%s", why.message);
}

static bool check(const char *name, check_options *o, command_talk *talk, karst_error *error)
{
    char path[PATH_MAX];
    const command_scene scene = {path, sizeof path, NULL, NULL, &o->parameters, &o->has_seed, &o->seed};
    if (!command_find_scene(name, &scene, talk, error))
        return false;
    kept_lines kept = {0};
    const karst_log log = {.write = keep_line, .user = &kept, .max_level = KARST_LOG_WARNING};
    const karst_world_config config = {.world = path,
                                       .parameters = o->parameters.values,
                                       .num_parameters = o->parameters.num_values,
                                       .has_seed = o->has_seed,
                                       .seed = (uint32_t)o->seed,
                                       .log = &log};
    karst_world *world = karst_world_open(&config, error);
    command_open_driver(talk);
    bool done;
    if (o->json) {
        done = print_json(name, world, kept.text, o, error);
    } else {
        if (!world || o->quiet)
            say_lines(talk, kept.text);
        done = world && (o->quiet || karst_world_check(world, print_line, stdout, error)) && try_code(world, o, error);
    }
    free(kept.text);
    karst_world_close(world);
    return done;
}

bool command_check(int argc, char **argv, command_talk *talk, karst_error *error)
{
    check_options o = {0};
    const command_option options[] = {
        {"param", 0, COMMAND_PARAMETERS, "NAME=VALUE", "another value for a parameter; may be given again",
         &o.parameters, 0, 0, NULL},
        {"seed", 0, COMMAND_INTEGER, "N", "instead of the world's own", &o.seed, 0, 4294967295.0, &o.has_seed},
        {"device", 0, COMMAND_TEXT, "DEVICE", "number or part of the name from karst info; cpu; gpu", &o.device, 0, 0,
         NULL},
        {"json", 0, COMMAND_FLAG, NULL, "the report as one JSON object, mistakes too", &o.json, 0, 0, NULL},
        {"quiet", 'q', COMMAND_FLAG, NULL, "only mistakes and warnings, to stderr", &o.quiet, 0, 0, NULL},
    };
    const size_t num_options = sizeof options / sizeof *options;
    const char *name;
    size_t num_words;
    bool help;
    if (!command_parse(argc, argv, options, num_options, &name, 1, &num_words, &help, error))
        return false;
    if (help) {
        print_help(options, num_options);
        return true;
    }
    if (num_words == 0)
        return karst_fail(error, KARST_USAGE, "which world? For example: karst check hills");
    return check(name, &o, talk, error);
}
