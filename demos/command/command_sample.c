/* karst sample: a world's density at points. */
#include "command.h"

#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <jansson.h>

typedef struct {
    const char *world;
    command_list at;
    command_list rays;
    const char *device;
    command_parameters parameters;
    uint64_t seed;
    double box_m, footprint_m, time_s;
    bool has_seed, has_box, json;
    const char *edits;
} sample_options;

typedef struct {
    const sample_options *options;
    karst_world *world;
    karst_sampler *sampler;
    const karst_world_metadata *about;
    size_t num_points;
    const karst_log *log;
} sampling;

/* What there is to say of a point. */
typedef struct {
    char at[3][160]; /* exact decimals, metres */
    karst_sample density, gradient[3], rgb[3];
    bool has_gradient, has_colour, is_bounded;
    double bounds[2];
} point_facts;

static void print_help(const command_option *options, size_t num_options)
{
    puts("karst sample WORLD --at X,Y,Z [--at X,Y,Z ...] [OPTIONS]\n"
         "karst sample WORLD [OPTIONS] < POINTS\n"
         "karst sample WORLD --ray X,Y,Z,DX,DY,DZ [OPTIONS]\n"
         "Gives a world's density at points: as devices compute it, and by the oracle in double. Positive is solid.\n"
         "Coordinates are decimal metres of any length, and exact. Without --at, or with --at -, points are read from\n"
         "stdin, one a line.\n"
         "--ray gives what a ray passes of the medium that fills the space outside matter: where it meets land, how\n"
         "deep the medium is on the way there, by a device and by the oracle, and the share of light that comes "
         "through.\n"
         "\nOptions:");
    command_print_options(stdout, options, num_options);
    puts("\nWorlds (or the path of a world file, which ends in .karst):");
    command_print_worlds(stdout);
    puts("\nExamples:\n"
         "  karst sample hills --at 0,120,0\n"
         "  karst sample hills --at 100000000000000000.25,12.5,-3 --footprint 0.5\n"
         "  karst sample alps --at 0,900,0 --box 16 --json | jq .bounds\n"
         "  seq 0 10 2000 | sed 's/.*/0,&,0/' | karst sample alps --json | jq -c '[.at[1], .density]'\n"
         "  karst sample fog --ray 0,1500,0,0.5,-0.2,1 --json | jq .transmittance\n"
         "\nJSON of a ray: from, direction, hit_m (null: it meets no land), length_m, optical_depth, "
         "oracle_optical_depth,\n"
         "transmittance. JSON of a point is one object a line: at, footprint_m, level, density, density_hex, "
         "oracle, gradient, "
         "oracle_gradient,\n"
         "with --box bounds, and colour where the world has one. Numbers that are not finite are null.\n"
         "\nExit code: 0 done, 1 failed, 2 wrong usage, 4 no such world, or one that does not compile, 5 a line of "
         "stdin\n"
         "that is no point, or a file of edits that cannot be read.");
}

/* ---- output ---- */

static json_t *number(double value) { return isfinite(value) ? json_real(value) : json_null(); }

/* Three of device and double. */
static json_t *triple(const karst_sample v[3], bool precise)
{
    json_t *array = json_array();
    for (int i = 0; i < 3; i++)
        json_array_append_new(array, number(precise ? v[i].precise : (double)v[i].device));
    return array;
}

static bool print_json(const sampling *s, const point_facts *p, karst_error *error)
{
    json_t *object = json_object(), *at = json_array();
    char hex[64];
    for (int axis = 0; axis < 3; axis++)
        json_array_append_new(at, json_string(p->at[axis]));
    snprintf(hex, sizeof hex, "%a", (double)p->density.device);
    json_object_set_new(object, "at", at);
    json_object_set_new(object, "footprint_m", number(s->options->footprint_m));
    json_object_set_new(object, "level", json_integer(karst_world_level(s->world, s->options->footprint_m)));
    json_object_set_new(object, "density", number((double)p->density.device));
    json_object_set_new(object, "density_hex", json_string(hex));
    json_object_set_new(object, "oracle", number(p->density.precise));
    if (p->has_gradient) {
        json_object_set_new(object, "gradient", triple(p->gradient, false));
        json_object_set_new(object, "oracle_gradient", triple(p->gradient, true));
    }
    if (s->options->has_box) {
        json_object_set_new(object, "box_m", number(s->options->box_m));
        json_object_set_new(object, "bounds", json_pack("[o, o]", number(p->bounds[0]), number(p->bounds[1])));
    }
    if (p->has_colour)
        json_object_set_new(object, "colour", triple(p->rgb, false));
    char *text = json_dumps(object, JSON_COMPACT | JSON_PRESERVE_ORDER);
    json_decref(object);
    if (!text)
        return karst_fail(error, KARST_FAILED, "out of memory");
    puts(text);
    free(text);
    return true;
}

static void print_text(const sampling *s, const point_facts *p)
{
    printf("%sat         %s, %s, %s m\n", s->num_points ? "\n" : "", p->at[0], p->at[1], p->at[2]);
    printf("density    %.9g (%a), %s\n", (double)p->density.device, (double)p->density.device,
           !isfinite(p->density.device) ? "not finite"
           : p->density.device > 0      ? "solid"
                                        : "air");
    printf("oracle     %.17g\n", p->density.precise);
    if (p->has_gradient)
        printf("gradient   %.9g, %.9g, %.9g per m\n", (double)p->gradient[0].device, (double)p->gradient[1].device,
               (double)p->gradient[2].device);
    if (s->options->has_box && p->is_bounded)
        printf("bounds     %.9g to %.9g in a box of %.12g m%s\n", p->bounds[0], p->bounds[1], s->options->box_m,
               p->bounds[0] > 0   ? ": all solid"
               : p->bounds[1] < 0 ? ": all air"
                                  : "");
    else if (s->options->has_box)
        printf("bounds     none are known in a box of %.12g m\n", s->options->box_m);
    if (p->has_colour)
        printf("colour     %.4f, %.4f, %.4f (linear RGB, of a surface there)\n", (double)p->rgb[0].device,
               (double)p->rgb[1].device, (double)p->rgb[2].device);
}

/* ---- points ---- */

/* The colour that a surface with the gradient's normal has. */
static void find_colour(const sampling *s, const karst_position *at, point_facts *p)
{
    double g[3], size = 0;
    float normal[3];
    for (int i = 0; i < 3; i++) {
        g[i] = p->gradient[i].precise;
        size += g[i] * g[i];
    }
    size = sqrt(size);
    if (!(size > 0) || !isfinite(size))
        return;
    for (int i = 0; i < 3; i++)
        normal[i] = (float)(-g[i] / size);
    p->has_colour = karst_sampler_colour(s->sampler, at, normal, s->options->footprint_m, p->rgb);
}

static bool sample_position(sampling *s, const karst_position *at, karst_error *error)
{
    point_facts p = {0};
    double footprint_m = s->options->footprint_m, half = s->options->box_m / 2, half_m[3] = {half, half, half};
    for (int axis = 0; axis < 3; axis++)
        karst_coordinate_format(at->voxel[axis], at->fraction[axis], s->about->voxel_log2_m, p.at[axis],
                                sizeof p.at[axis]);
    p.has_gradient = karst_sampler_gradient(s->sampler, at, footprint_m, p.gradient, &p.density);
    if (!p.has_gradient)
        p.density = karst_sampler_density(s->sampler, at, footprint_m);
    if (s->options->has_box)
        p.is_bounded = karst_sampler_bounds(s->sampler, at, half_m, footprint_m, p.bounds);
    if (p.has_gradient && s->about->has_colour)
        find_colour(s, at, &p);
    if (!s->options->json)
        print_text(s, &p);
    else if (!print_json(s, &p, error))
        return false;
    s->num_points++;
    return true;
}

/* "X,Y,Z", with blanks or commas between. `text` is written to. */
static bool sample_text(sampling *s, char *text, karst_status status, const char *where, karst_error *error)
{
    char *part[4], *rest = text;
    int num_parts = 0;
    for (bool comma = true; num_parts < 4; num_parts++) {
        rest += strspn(rest, " \t\r\n");
        if (*rest == ',' && !comma) {
            comma = true;
            rest++;
            rest += strspn(rest, " \t\r\n");
        }
        if (!*rest)
            break;
        part[num_parts] = rest;
        rest += strcspn(rest, ", \t\r\n");
        comma = false;
        if (!*rest)
            continue;
        comma = *rest == ',';
        *rest++ = '\0';
    }
    if (num_parts != 3)
        return karst_fail(error, status, "%s: a point is X,Y,Z in metres, such as 0,120.5,-3", where);
    karst_position at;
    karst_error why = {0};
    if (!karst_position_parse(part[0], part[1], part[2], s->about->voxel_log2_m, &at, &why))
        return karst_fail(error, status, "%s: %s", where, why.message);
    return sample_position(s, &at, error);
}

static bool sample_lines(sampling *s, karst_error *error)
{
    char *line = NULL, where[32];
    size_t room = 0, number_of_line = 0;
    bool done = true;
    while (done && getline(&line, &room, stdin) >= 0) {
        snprintf(where, sizeof where, "stdin:%zu", ++number_of_line);
        if (line[strspn(line, " \t\r\n")] != '\0')
            done = sample_text(s, line, KARST_BAD_DATA, where, error);
        /* Whoever writes points one by one reads answers one by one. */
        if (!isatty(STDOUT_FILENO) && done)
            fflush(stdout);
    }
    free(line);
    return done && (!ferror(stdin) || karst_fail(error, KARST_FAILED, "cannot read stdin"));
}

static bool sample_points(sampling *s, karst_error *error)
{
    const command_list *at = &s->options->at;
    if (at->num_items == 0 && isatty(STDIN_FILENO))
        return karst_fail(error, KARST_USAGE, "which points? For example: karst sample %s --at 0,100,0",
                          s->options->world);
    if (at->num_items == 0 && !sample_lines(s, error))
        return false;
    for (size_t i = 0; i < at->num_items; i++) {
        if (strcmp(at->items[i], "-") == 0) {
            if (!sample_lines(s, error))
                return false;
            continue;
        }
        char *text = strdup(at->items[i]), where[64];
        snprintf(where, sizeof where, "--at %.48s", at->items[i]);
        bool done =
            text ? sample_text(s, text, KARST_USAGE, where, error) : karst_fail(error, KARST_FAILED, "out of memory");
        free(text);
        if (!done)
            return false;
    }
    return s->num_points ||
           karst_fail(error, KARST_USAGE, "no point was given: say --at X,Y,Z, or write lines to stdin");
}

static bool take_edits(sampling *s, karst_error *error)
{
    size_t num;
    if (!s->options->edits)
        return true;
    karst_edit *edits = command_load_edits(s->options->edits, s->about->voxel_log2_m, &num, s->log, error);
    bool done = edits && karst_sampler_set_edits(s->sampler, edits, num, error);
    free(edits);
    return done;
}

static bool run(sample_options *o, command_talk *talk, const karst_log *log, karst_error *error)
{
    char path[PATH_MAX];
    const command_scene scene = {path, sizeof path, NULL, &o->edits, &o->parameters, &o->has_seed, &o->seed};
    if (!command_find_scene(o->world, &scene, talk, error))
        return false;
    const karst_world_config config = {.world = path,
                                       .parameters = o->parameters.values,
                                       .num_parameters = o->parameters.num_values,
                                       .has_seed = o->has_seed,
                                       .seed = (uint32_t)o->seed,
                                       .log = log};
    sampling s = {.options = o, .log = log, .world = karst_world_open(&config, error)};
    s.sampler = s.world ? karst_sampler_create(s.world, error) : NULL;
    s.about = s.world ? karst_world_get_metadata(s.world) : NULL;
    bool done = s.sampler && take_edits(&s, error);
    for (size_t i = 0; done && i < o->rays.num_items; i++) {
        const command_ray_look look = {o->footprint_m, o->device, o->json, i > 0, log, o->time_s};
        done = command_sample_ray(s.world, o->rays.items[i], &look, error);
    }
    done = done && (o->rays.num_items > 0 || sample_points(&s, error));
    karst_sampler_destroy(s.sampler);
    karst_world_close(s.world);
    return done;
}

bool command_sample(int argc, char **argv, command_talk *talk, karst_error *error)
{
    sample_options o = {0};
    const command_option options[] = {
        {"at", 0, COMMAND_LIST, "X,Y,Z", "a point, in metres; may be given again; -: points from stdin", &o.at, 0, 0,
         NULL},
        {"ray", 0, COMMAND_LIST, "X,Y,Z,DX,DY,DZ", "from a point in a direction; may be given again, not with --at",
         &o.rays, 0, 0, NULL},
        {"device", 0, COMMAND_TEXT, "DEVICE", "for --ray: number, part of a name, cpu or gpu (default: first GPU)",
         &o.device, 0, 0, NULL},
        {"footprint", 0, COMMAND_NUMBER, "W", "metres: without finer detail, as a voxel of that width (default: 0)",
         &o.footprint_m, 0, 1e30, NULL},
        {"time", 0, COMMAND_NUMBER, "S", "for --ray: the world's time, of its particles and iTime (default: 0)",
         &o.time_s, -1e9, 1e9, NULL},
        {"box", 0, COMMAND_NUMBER, "SIZE", "also bounds of the density in a cube of that side around each point",
         &o.box_m, 0, 1e30, &o.has_box},
        {"edits", 0, COMMAND_TEXT, "FILE", "with the edits of a file: docs/EDITS.md; bounds are not known near them",
         &o.edits, 0, 0, NULL},
        {"json", 0, COMMAND_FLAG, NULL, "one JSON object a point", &o.json, 0, 0, NULL},
        {"seed", 0, COMMAND_INTEGER, "N", "instead of the world's own", &o.seed, 0, 4294967295.0, &o.has_seed},
        {"param", 0, COMMAND_PARAMETERS, "NAME=VALUE", "another value for a parameter; may be given again",
         &o.parameters, 0, 0, NULL},
    };
    const size_t num_options = sizeof options / sizeof *options;
    const karst_log log = command_log(talk);
    size_t num_words;
    bool help, done;
    o.at.items = calloc((size_t)argc + 1, sizeof *o.at.items);
    o.rays.items = calloc((size_t)argc + 1, sizeof *o.rays.items);
    if (!o.at.items || !o.rays.items) {
        free(o.at.items);
        free(o.rays.items);
        return karst_fail(error, KARST_FAILED, "out of memory");
    }
    done = command_parse(argc, argv, options, num_options, &o.world, 1, &num_words, &help, error);
    if (done && help)
        print_help(options, num_options);
    else if (done && num_words == 0)
        done = karst_fail(error, KARST_USAGE, "which world? For example: karst sample hills --at 0,100,0");
    else if (done && o.rays.num_items && (o.at.num_items || o.has_box || o.edits))
        done = karst_fail(error, KARST_USAGE,
                          "--ray goes with --footprint, --device, --json, --seed and --param alone");
    else if (done)
        done = run(&o, talk, &log, error);
    free(o.rays.items);
    free(o.at.items);
    return done;
}
