/* karst heights: the topmost surface under each pixel of a map. */
#include "command_export.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

static const char about[] =
    "karst heights WORLD --box X0,Z0,X1,Z1 --size WxH -o FILE.tif|.png|.exr [OPTIONS]\n"
    "Writes a map of heights: the topmost surface under the middle of each pixel, found by proof, so that\n"
    "nothing is missed, to a 128th of the world's voxel. The row with the greatest z comes first, x rises\n"
    "along a row.\n"
    "16-bit values are told with their offset and step in metres, 0 is a column without land; EXRs hold\n"
    "metres, and NaN there. Coordinates are decimal metres of any length, and exact. docs/EXPORT.md says more.";
static const char examples[] =
    "\n"
    "Examples:\n"
    "  karst heights hills --box 0,0,1000,1000 --size 256x256 -o hills.tif\n"
    "  karst heights alps --box -5000,-5000,5000,5000 --size 200x200 --footprint 50 -o alps.exr\n"
    "  karst heights hills --box 0,0,512,512 --size 128x128 --range -200,300 -o tile.png --json | jq .high_m\n"
    "\n"
    "JSON is one object: file, width, height, low_m, high_m (of the land; null without any), empty_columns,\n"
    "offset_m, step_m (metres = offset + step * value; not of an EXR), seconds.\n"
    "\n"
    "Exit code: 0 done (also without land), 1 failed, 2 wrong usage, 4 no such world, or one that does not\n"
    "compile, 5 a file of edits that cannot be read.";

typedef struct {
    command_export common;
    const char *from, *range;
    double depth_m;
    int size_px[2];
    bool has_size;
} heights_options;

/* What was found. */
typedef struct {
    double low_m, high_m; /* of the land */
    double from_m, range_m[2];
    size_t num_empty; /* columns without land */
} found_heights;

/* `num` texts with commas between them, in a copy that the caller frees; NULL: there are not so many. */
static char *split(const char *text, char **parts, int num)
{
    char *copy = strdup(text), *rest = copy;
    int found = 0;
    for (char *next; found < num && rest; rest = next) {
        next = strchr(rest, ',');
        if (next)
            *next++ = '\0';
        parts[found++] = rest;
    }
    if (found == num && !rest)
        return copy;
    free(copy);
    return NULL;
}

static bool parse_box(const heights_options *o, int voxel_log2_m, karst_height_map *map, karst_error *error)
{
    char *part[4], *copy = split(o->common.box, part, 4);
    karst_position high;
    karst_error why = {0};
    double extent_m[3];
    if (!copy)
        return karst_fail(error, KARST_USAGE, "--box %.64s: a box is X0,Z0,X1,Z1 in metres, such as 0,0,1000,1000",
                          o->common.box);
    const bool done = karst_position_parse(part[0], o->from, part[1], voxel_log2_m, &map->corner, &why) &&
                      karst_position_parse(part[2], o->from, part[3], voxel_log2_m, &high, &why);
    free(copy);
    if (!done)
        return karst_fail(error, KARST_USAGE, "--box or --from: %s", why.message);
    karst_position_difference_m(map->corner, high, voxel_log2_m, extent_m);
    for (int i = 0; i < 2; i++) {
        map->size_m[i] = extent_m[2 * i];
        if (!(map->size_m[i] > 0))
            return karst_fail(error, KARST_USAGE, "--box %.64s: its second corner is not above its first along %c",
                              o->common.box, "xz"[i]);
    }
    return true;
}

static bool parse_range(const heights_options *o, double range_m[2], karst_error *error)
{
    char *part[2], *copy = split(o->range, part, 2), *end[2];
    bool done = copy;
    for (int i = 0; i < 2 && copy; i++) {
        range_m[i] = strtod(part[i], &end[i]);
        done = done && end[i] != part[i] && !*end[i] && isfinite(range_m[i]);
    }
    free(copy);
    return (done && range_m[0] < range_m[1]) ||
           karst_fail(error, KARST_USAGE, "--range %.64s: two heights in metres, the lower one first, such as -100,900",
                      o->range);
}

/* From metres below the start to heights; NaN: no land. */
static void make_heights(double *values, size_t num, found_heights *found)
{
    found->low_m = (double)INFINITY;
    found->high_m = -(double)INFINITY;
    for (size_t i = 0; i < num; i++) {
        if (isinf(values[i])) {
            values[i] = (double)NAN;
            found->num_empty++;
            continue;
        }
        values[i] = found->from_m - values[i];
        found->low_m = fmin(found->low_m, values[i]);
        found->high_m = fmax(found->high_m, values[i]);
    }
}

static json_t *number(double value) { return isfinite(value) ? json_real(value) : json_null(); }

static bool report(const heights_options *o, const found_heights *found, karst_error *error)
{
    const command_export *e = &o->common;
    const size_t num = (size_t)o->size_px[0] * (size_t)o->size_px[1];
    if (!e->json) {
        if (found->num_empty == num)
            command_say(e->talk, "%s: no column has land; --from and --depth say where it is looked for", e->output);
        else
            command_say(e->talk, "%s: land from %.2f to %.2f m, %zu columns without, in %.1f s", e->output,
                        found->low_m, found->high_m, found->num_empty, command_export_seconds(e));
        if (!command_is_exr(e->output))
            command_say(e->talk, "value 0 is no land, 1 is %.9g m, 65535 is %.9g m", found->range_m[0],
                        found->range_m[1]);
        return true;
    }
    const double step_m = (found->range_m[1] - found->range_m[0]) / 65534;
    json_t *object = json_object();
    json_object_set_new(object, "file", json_string(e->output));
    json_object_set_new(object, "width", json_integer(o->size_px[0]));
    json_object_set_new(object, "height", json_integer(o->size_px[1]));
    json_object_set_new(object, "low_m", number(found->low_m));
    json_object_set_new(object, "high_m", number(found->high_m));
    json_object_set_new(object, "empty_columns", json_integer((json_int_t)found->num_empty));
    if (!command_is_exr(e->output)) {
        json_object_set_new(object, "offset_m", json_real(found->range_m[0] - step_m));
        json_object_set_new(object, "step_m", json_real(step_m));
    }
    json_object_set_new(object, "seconds", json_real(command_export_seconds(e)));
    return command_export_print(object, 17, error);
}

static bool find_and_write(heights_options *o, const karst_world *world, const karst_query_config *config,
                           const karst_height_map *map, found_heights *found, karst_error *error)
{
    const size_t num = (size_t)o->size_px[0] * (size_t)o->size_px[1];
    double *values = malloc(num * sizeof *values);
    if (!values)
        return karst_fail(error, KARST_FAILED, "out of memory for %zu pixels", num);
    bool done = karst_query_height_map(world, config, map, values, error);
    if (done) {
        make_heights(values, num, found);
        if (!o->range && found->num_empty < num && found->low_m < found->high_m) {
            found->range_m[0] = found->low_m;
            found->range_m[1] = found->high_m;
        } else if (!o->range) { /* flat land, or none */
            found->range_m[0] = found->num_empty < num ? found->low_m : 0;
            found->range_m[1] = found->range_m[0] + 1;
        }
        command_hold_interrupts(true);
        done = !command_interrupted() && karst_heights_write(o->common.output, values, o->size_px[0], o->size_px[1],
                                                             found->range_m[0], found->range_m[1], error);
        command_hold_interrupts(false);
    }
    free(values);
    return command_export_end(&o->common, done, error);
}

static bool write_heights(heights_options *o, const karst_world *world, karst_error *error)
{
    command_export *e = &o->common;
    const int voxel_log2_m = karst_world_get_metadata(world)->voxel_log2_m;
    karst_height_map map = {.size_px = {o->size_px[0], o->size_px[1]}, .depth_m = o->depth_m};
    karst_query_config config = {.footprint_m = e->footprint_m,
                                 .num_threads = (int)e->num_threads,
                                 .progress = command_export_progress,
                                 .user = e};
    found_heights found = {.from_m = strtod(o->from, NULL)};
    karst_edit *edits;
    if (!parse_box(o, voxel_log2_m, &map, error) || (o->range && !parse_range(o, found.range_m, error)) ||
        !command_export_edits(e, voxel_log2_m, &edits, &config.num_edits, error))
        return false;
    config.edits = edits;
    command_export_begin(e);
    const bool done = find_and_write(o, world, &config, &map, &found, error) && report(o, &found, error);
    free(edits);
    return done;
}

static bool check(void *own, command_export *e, karst_error *error)
{
    const heights_options *o = own;
    static const char *const suffixes[] = {".png", ".tif", ".tiff", ".exr", NULL};
    if (!o->has_size)
        return karst_fail(error, KARST_USAGE, "how many pixels? For example: --size 256x256");
    const char *dot = e->output ? strrchr(e->output, '.') : NULL;
    for (int i = 0; dot && suffixes[i]; i++)
        if (strcasecmp(dot, suffixes[i]) == 0)
            return true;
    return !e->output || karst_fail(error, KARST_USAGE,
                                    "-o %s: a map of heights is a .tif or .png of 16 bits, or an .exr", e->output);
}

static bool run(void *own, command_export *e, karst_error *error)
{
    karst_world *world = command_export_open(e, KARST_WORLD_LAND, e->log, error);
    const bool done = world && write_heights(own, world, error);
    karst_world_close(world);
    return done;
}

bool command_heights(int argc, char **argv, command_talk *talk, karst_error *error)
{
    heights_options o = {.from = "10000", .depth_m = 20000};
    const command_option options[] = {
        {"box", 0, COMMAND_TEXT, "X0,Z0,X1,Z1", "the map's lower and upper corner, in metres", &o.common.box, 0, 0,
         NULL},
        {"size", 0, COMMAND_SIZE, "WxH", "pixels along x and z", o.size_px, 1, 16384, &o.has_size},
        {"output", 'o', COMMAND_TEXT, "FILE", "a .tif or .png of 16 bits, or an .exr", &o.common.output, 0, 0, NULL},
        {"from", 0, COMMAND_TEXT, "Y", "the height where the search begins (default: 10000)", &o.from, 0, 0, NULL},
        {"depth", 0, COMMAND_NUMBER, "D", "how far down land is looked for, in metres (default: 20000)", &o.depth_m,
         1e-30, 1e30, NULL},
        {"range", 0, COMMAND_TEXT, "LOW,HIGH", "heights of the values 1 and 65535 (default: the land's)", &o.range, 0,
         0, NULL},
    };
    const command_export_kind kind = {.name = "heights",
                                      .example = "--box 0,0,1000,1000 --size 256x256 -o out.tif",
                                      .output_example = "out.tif, or .png, or .exr",
                                      .about = about,
                                      .examples = examples,
                                      .options = options,
                                      .num_options = sizeof options / sizeof *options,
                                      .check = check,
                                      .run = run};
    return command_export_main(argc, argv, &kind, &o, talk, error);
}
