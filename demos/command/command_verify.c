/* karst verify: whether all that a job was to draw is there, and as it was written. */
#include "command_farm.h"

#include <dirent.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* What all parts of a job say together. */
typedef struct {
    const char *file; /* as it was named */
    command_manifest_file job;
    command_manifest_entry **entries; /* of each picture; NULL: no part has it */
    command_manifest_file *parts;
    size_t num_parts;
    size_t num_right, num_missing, num_wrong;
} verification;

static void print_help(const command_option *options, size_t num_options)
{
    puts("karst verify MANIFEST [OPTIONS]\n"
         "Whether the pictures of a job are all there, and as they were written: prints a line for each that is\n"
         "missing or wrong. MANIFEST is what --manifest named; what each part noted lies beside it (docs/FARM.md).\n"
         "\nOptions:");
    command_print_options(stdout, options, num_options);
    puts("\nExamples:\n"
         "  karst verify frames/manifest.json\n"
         "  karst verify frames/manifest.json || parallel < jobs.txt\n"
         "  karst verify big.manifest.json --join big.png\n"
         "\nExit code: 0 all is there, 1 something is missing or wrong, 2 wrong usage, 5 no manifest, or parts of\n"
         "different jobs.");
}

/* ---- parts ---- */

/* Whether `name` is the part of a manifest called `stem` + `suffix`. */
static bool is_part(const char *name, const char *stem, size_t stem_length, const char *suffix)
{
    unsigned number, num;
    int end = 0;
    char *made = NULL;
    if (strncmp(name, stem, stem_length) != 0 ||
        sscanf(name + stem_length, ".part-%6u-of-%6u%n", &number, &num, &end) != 2 || !end)
        return false;
    const bool is = asprintf(&made, "%.*s.part-%u-of-%u%s", (int)stem_length, stem, number, num, suffix) >= 0 &&
                    strcmp(made, name) == 0;
    free(made);
    return is;
}

static bool add_part(verification *v, const char *file, karst_error *error)
{
    command_manifest_file *grown = realloc(v->parts, (v->num_parts + 1) * sizeof *grown);
    if (!grown)
        return karst_fail(error, KARST_FAILED, "out of memory");
    v->parts = grown;
    if (!command_manifest_read(file, &v->parts[v->num_parts], error))
        return false;
    v->num_parts++;
    return v->num_parts == 1 || command_manifest_is_same_job(&v->parts[0], &v->parts[v->num_parts - 1], file, error);
}

/* The manifest itself, if it is there, and those of its parts. */
static bool find_parts(verification *v, karst_error *error)
{
    const char *slash = strrchr(v->file, '/'), *name = slash ? slash + 1 : v->file, *dot = strrchr(name, '.');
    const size_t stem_length = dot && dot != name ? (size_t)(dot - name) : strlen(name);
    const int folder_length = (int)(name - v->file);
    char *folder = strndup(folder_length ? v->file : ".", folder_length ? (size_t)folder_length : 1);
    struct dirent **found = NULL;
    bool done = folder != NULL && (access(v->file, F_OK) != 0 || add_part(v, v->file, error));
    const int num = done ? scandir(folder, &found, NULL, alphasort) : 0;
    for (int i = 0; i < num; i++) {
        char *file = NULL;
        if (done && is_part(found[i]->d_name, name, stem_length, name + stem_length))
            done = asprintf(&file, "%.*s%s", folder_length, v->file, found[i]->d_name) >= 0 && add_part(v, file, error);
        free(file);
        free(found[i]);
    }
    free(found);
    free(folder);
    if (done && !v->num_parts)
        return karst_fail(error, KARST_BAD_DATA,
                          "%s: is not there, nor a part of it: has a command of karst render --jobs run?", v->file);
    return done || karst_fail(error, KARST_FAILED, "out of memory");
}

/* ---- pictures ---- */

static void say_wrong(verification *v, const char *name, const command_checksum *noted, const command_checksum *is)
{
    v->num_wrong++;
    if (is->size_bytes != noted->size_bytes)
        printf("wrong %s: %llu bytes instead of %llu\n", name, (unsigned long long)is->size_bytes,
               (unsigned long long)noted->size_bytes);
    else
        printf("wrong %s: its bytes have changed (CRC-32 %08x instead of %08x)\n", name, is->crc32, noted->crc32);
}

static bool check_pictures(verification *v, command_talk *talk, karst_error *error)
{
    const command_manifest_file *job = &v->parts[0];
    v->entries = calloc(job->num, sizeof *v->entries);
    if (!v->entries)
        return karst_fail(error, KARST_FAILED, "out of memory for %zu pictures", job->num);
    for (size_t p = 0; p < v->num_parts; p++)
        for (size_t i = 0; i < v->parts[p].num_entries; i++)
            v->entries[v->parts[p].entries[i].index] = &v->parts[p].entries[i];
    for (size_t index = 0; index < job->num && !command_interrupted(); index++) {
        const command_manifest_entry *entry = v->entries[index];
        command_checksum sum;
        karst_error why = {0};
        char *name = command_manifest_name(v->file, job->output, job->tiles, job->num, index);
        if (!name)
            return karst_fail(error, KARST_FAILED, "out of memory");
        command_progress(talk, "picture %zu of %zu", index + 1, job->num);
        if (entry && command_checksum_file(name, &sum, &why)) {
            if (sum.size_bytes == entry->sum.size_bytes && sum.crc32 == entry->sum.crc32)
                v->num_right++;
            else
                say_wrong(v, name, &entry->sum, &sum);
        } else {
            v->num_missing++;
            printf("missing %s%s\n", name,
                   !entry && access(name, F_OK) == 0 ? ": it is there, but no part noted it" : "");
        }
        free(name);
    }
    command_end_progress(talk);
    if (command_interrupted())
        return command_fail_interrupted(error, "interrupted");
    return true;
}

bool command_verify(int argc, char **argv, command_talk *talk, karst_error *error)
{
    verification v = {0};
    const char *output = NULL;
    const command_option options[] = {
        {"join", 0, COMMAND_TEXT, "FILE", "if all is right, put the tiles of a .png together in this one", &output, 0,
         0, NULL},
        {"quiet", 'q', COMMAND_FLAG, NULL, "no summary, only what is missing or wrong", &talk->quiet, 0, 0, NULL},
    };
    size_t num_words;
    bool help, done = false;
    const size_t num_options = sizeof options / sizeof *options;
    if (!command_parse(argc, argv, options, num_options, &v.file, 1, &num_words, &help, error))
        return false;
    if (help) {
        print_help(options, num_options);
        return true;
    }
    if (!num_words)
        return karst_fail(error, KARST_USAGE, "which manifest? For example: karst verify frames/manifest.json");
    command_catch_interrupts();
    if (output && (strcmp(output, "-") == 0 || command_is_exr(output) || !command_check_picture(output, error) ||
                   !command_check_output(output, "--join", false, error)))
        return karst_fail(error, KARST_USAGE, "--join %s: puts tiles together as a .png", output);
    bool found = find_parts(&v, error);
    if (found && output && (!v.parts[0].tiles || command_is_exr(v.parts[0].output)))
        found = karst_fail(error, KARST_USAGE, "--join: is for the tiles of a .png, and %s is no such job", v.file);
    if (found && check_pictures(&v, talk, error)) {
        command_say(talk, "%s: %zu of %zu %s right, %zu missing, %zu wrong", v.file, v.num_right, v.parts[0].num,
                    v.parts[0].tiles ? "tiles" : "pictures", v.num_missing, v.num_wrong);
        done = !v.num_missing && !v.num_wrong;
        if (!done)
            karst_fail(error, KARST_FAILED, "of %zu %s %zu are missing or wrong: run the job's commands again",
                       v.parts[0].num, v.parts[0].tiles ? "tiles" : "pictures", v.num_missing + v.num_wrong);
        else if (output)
            done = command_join(v.file, &v.parts[0], output, talk, error);
    }
    for (size_t i = 0; i < v.num_parts; i++)
        command_manifest_free(&v.parts[i]);
    free(v.parts);
    free(v.entries);
    return done;
}
