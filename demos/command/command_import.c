/* karst import: files of points become models. */
#include "command.h"

#include <jansson.h>
#include <stdlib.h>
#include <string.h>

#include <karst/points.h>

typedef struct {
    command_talk *talk;
    const char *input, *output, *axes, *turn;
    uint64_t num_threads;
    bool keep_outliers, json, help;
} import_options;

static void print_help(const command_option *options, size_t num_options)
{
    puts(
        "karst import FILE -o MODEL.karstpoints [OPTIONS]\n"
        "Turns a file of points into a model that worlds can show: reads PLY, OBJ (its vertices), LAS 1.0 to 1.4, and\n"
        "text (.xyz, .txt, .csv, .pts, .asc: X Y Z, perhaps colours and normals). Normals that are missing are found\n"
        "from neighbours. A world names models in its header; docs/POINTS.md says how.\n"
        "\nOptions:");
    command_print_options(stdout, options, num_options);
    puts("\nExamples:\n"
         "  karst import rabbit.ply -o rabbit.karstpoints\n"
         "  karst import town.las -o town.karstpoints --turn up\n"
         "  karst info rabbit.karstpoints\n"
         "\nAn import that was cut off, or whose disk was full, goes on when the same command is given again: until "
         "then\n"
         "its work lies in MODEL.karstpoints.import.\n"
         "\nLAZ is unpacked first, with laszip -i in.laz -o out.las, or with pdal translate in.laz out.las.\n"
         "\nExit code: 0 done, 1 failed (a disk that is full), 2 wrong usage, 5 a file that cannot be read as points.");
}

static bool show_progress(void *user, const char *what, double share)
{
    const import_options *o = user;
    command_progress(o->talk, "%s %3.0f %%", what, 100 * share);
    return !command_interrupted();
}

/* A word of a list as its number; -1: it is none of them. */
static int number_of(const char *word, const char *const *words)
{
    for (int i = 0; words[i]; i++)
        if (strcmp(word, words[i]) == 0)
            return i;
    return -1;
}

static bool read_options(const import_options *o, karst_points_import_config *config, karst_error *error)
{
    static const char *const axes[] = {"auto", "y-up", "z-up", "karst", NULL}, *const turns[] = {"together", "up",
                                                                                                 NULL};
    int number = o->axes ? number_of(o->axes, axes) : 0, turn = o->turn ? number_of(o->turn, turns) : 0;
    if (!o->output)
        return karst_fail(error, KARST_USAGE, "which file? For example: -o model.karstpoints");
    if (number < 0)
        return karst_fail(error, KARST_USAGE, "--axes %s: there are auto, y-up, z-up and karst", o->axes);
    if (turn < 0)
        return karst_fail(error, KARST_USAGE, "--turn %s: there are together and up", o->turn);
    *config = (karst_points_import_config){.input = o->input,
                                           .output = o->output,
                                           .axes = (karst_points_axes)number,
                                           .turn = (karst_points_turn)turn,
                                           .keep_outliers = o->keep_outliers,
                                           .num_threads = (uint32_t)o->num_threads,
                                           .progress = show_progress,
                                           .resumable = true,
                                           .user = (void *)o};
    return true;
}

static void say_left_out(command_talk *talk, uint64_t num, const char *why)
{
    if (num)
        command_say(talk, "left out: %llu %s", (unsigned long long)num, why);
}

static void say(const import_options *o, const karst_points_about *about, double seconds)
{
    command_say(o->talk, "%s: %llu points, some %.3g apart, in %u levels; %.1f s, %.3g million points a second",
                o->output, (unsigned long long)about->num_points, about->spacing, about->num_levels, seconds,
                (double)about->num_read / seconds / 1e6);
    say_left_out(o->talk, about->num_withheld, "points that the file itself says are not to be used");
    say_left_out(o->talk, about->num_invalid, "points whose places are no finite numbers");
    say_left_out(o->talk, about->num_far, "points a thousand times as far out as nearly all others");
    say_left_out(o->talk, about->num_duplicates, "points at a place that another has");
    say_left_out(o->talk, about->num_outliers, "points far from all others (--keep-outliers keeps them)");
    if (about->num_parts > 1)
        command_say(o->talk, "the points are in %llu parts that do not touch: each was turned outwards by itself",
                    (unsigned long long)about->num_parts);
    if (about->share_unsure > 0.05)
        command_say(o->talk,
                    "unoriented: of %.0f %% of neighbours the normals face apart. The points may be no surface with "
                    "an inside, and will look torn",
                    100 * about->share_unsure);
}

bool command_print_points(const char *name, bool json, karst_error *error)
{
    karst_points_about about;
    if (!karst_points_describe(name, &about, error))
        return false;
    if (!json) {
        printf("points        %llu, some %.4g apart\n", (unsigned long long)about.num_points, about.spacing);
        printf("levels       ");
        for (uint32_t i = 0; i < about.num_levels; i++)
            printf(" %llu", (unsigned long long)about.num_of_level[i]);
        printf("\nfrom          %.9g %.9g %.9g\nto            %.9g %.9g %.9g\ncentre        %.9g %.9g %.9g\n",
               about.min[0], about.min[1], about.min[2], about.max[0], about.max[1], about.max[2], about.centre[0],
               about.centre[1], about.centre[2]);
        printf("normals       %s\n", about.has_given_normals ? "as the file has them" : "from neighbours");
        if (about.num_parts)
            printf("parts         %llu; %.2g %% of neighbours face apart\n", (unsigned long long)about.num_parts,
                   100 * about.share_unsure);
        printf("colours       %s\n", about.has_colours ? "yes" : "no");
        printf("imported      of %llu points; left out: %llu withheld, %llu invalid, %llu far out, %llu duplicates, "
               "%llu outliers\n",
               (unsigned long long)about.num_read, (unsigned long long)about.num_withheld,
               (unsigned long long)about.num_invalid, (unsigned long long)about.num_far,
               (unsigned long long)about.num_duplicates, (unsigned long long)about.num_outliers);
        return true;
    }
    json_t *levels = json_array();
    for (uint32_t i = 0; i < about.num_levels; i++)
        json_array_append_new(levels, json_integer((json_int_t)about.num_of_level[i]));
    json_t *object = json_pack(
        "{s:s, s:I, s:f, s:o, s:[f,f,f], s:[f,f,f], s:[f,f,f], s:b, s:b, s:I, s:f, s:I, s:I, s:I, s:I, s:I, s:I}",
        "file", name, "points", (json_int_t)about.num_points, "spacing", about.spacing, "levels", levels, "min",
        about.min[0], about.min[1], about.min[2], "max", about.max[0], about.max[1], about.max[2], "centre",
        about.centre[0], about.centre[1], about.centre[2], "colours", about.has_colours, "given_normals",
        about.has_given_normals, "parts", (json_int_t)about.num_parts, "share_unsure", about.share_unsure, "read",
        (json_int_t)about.num_read, "withheld", (json_int_t)about.num_withheld, "invalid",
        (json_int_t)about.num_invalid, "far", (json_int_t)about.num_far, "duplicates", (json_int_t)about.num_duplicates,
        "outliers", (json_int_t)about.num_outliers);
    char *text = object ? json_dumps(object, JSON_PRESERVE_ORDER | JSON_REAL_PRECISION(12)) : NULL;
    json_decref(object);
    if (!text)
        return karst_fail(error, KARST_FAILED, "out of memory");
    puts(text);
    free(text);
    return true;
}

static bool import_points(const import_options *o, karst_error *error)
{
    karst_points_import_config config;
    karst_points_about about;
    if (!read_options(o, &config, error) || !command_check_output(o->output, "-o", false, error))
        return false;
    const uint64_t start_ns = command_clock_ns();
    command_catch_interrupts();
    bool done = karst_points_import(&config, &about, error);
    command_end_progress(o->talk);
    if (!done && command_interrupted())
        return command_fail_interrupted(error,
                                        "interrupted: %s was not written. The same command goes on from there; "
                                        "removing %s.import gives it up",
                                        o->output, o->output);
    if (done)
        say(o, &about, (double)(command_clock_ns() - start_ns) / 1e9);
    return done && (!o->json || command_print_points(o->output, true, error));
}

bool command_import(int argc, char **argv, command_talk *talk, karst_error *error)
{
    import_options o = {.talk = talk};
    const command_option options[] = {
        {"output", 'o', COMMAND_TEXT, "FILE", "the model: its name ends in .karstpoints", &o.output, 0, 0, NULL},
        {"axes", 0, COMMAND_TEXT, "AXES",
         "of the file: y-up and z-up are right-handed, karst is x right, y up, z forward (default: auto, which is y-up "
         "for PLY and OBJ, z-up for LAS and text)",
         &o.axes, 0, 0, NULL},
        {"turn", 0, COMMAND_TEXT, "HOW",
         "normals that were found: together, with their neighbours, or up (default: together)", &o.turn, 0, 0, NULL},
        {"keep-outliers", 0, COMMAND_FLAG, NULL, "keep points that are far from all others", &o.keep_outliers, 0, 0,
         NULL},
        {"threads", 0, COMMAND_INTEGER, "N", "how many work (default: one for each core)", &o.num_threads, 1, 64, NULL},
        {"json", 0, COMMAND_FLAG, NULL, "what was written, as one JSON object", &o.json, 0, 0, NULL},
        {"quiet", 'q', COMMAND_FLAG, NULL, "say errors and warnings only", &talk->quiet, 0, 0, NULL},
    };
    const size_t num_options = sizeof options / sizeof *options;
    size_t num_words;
    if (!command_parse(argc, argv, options, num_options, &o.input, 1, &num_words, &o.help, error))
        return false;
    if (o.help) {
        print_help(options, num_options);
        return true;
    }
    if (!num_words)
        return karst_fail(error, KARST_USAGE, "which file? For example: karst import rabbit.ply -o rabbit.karstpoints");
    return import_points(&o, error);
}
