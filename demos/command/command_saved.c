/* Saved worlds (.karstdb) where a world is taken: what the file says counts where the command line says nothing. */
#include "command.h"

#include <errno.h>
#include <fcntl.h>
#include <jansson.h>
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* ---- a text from inside ---- */

static char text_folder[PATH_MAX], text_file[PATH_MAX + 64];

static void remove_text_file(void)
{
    unlink(text_file);
    rmdir(text_folder);
}

/* Engine, helper process and viewer read files: so it goes to one, named as the saved world is. */
static bool write_text(const char *saved_name, const karst_saved_about *about, karst_error *error)
{
    const char *folder = getenv("TMPDIR"), *slash = strrchr(saved_name, '/'), *name = slash ? slash + 1 : saved_name;
    if (*text_file)
        remove_text_file();
    if (snprintf(text_folder, sizeof text_folder, "%s/karst-XXXXXX", folder && *folder ? folder : "/tmp") >=
            (int)sizeof text_folder ||
        !mkdtemp(text_folder))
        return karst_fail(error, KARST_FAILED, "cannot make %s: %s; set TMPDIR", text_folder, strerror(errno));
    snprintf(text_file, sizeof text_file, "%s/%.*s.karst", text_folder,
             (int)(strlen(name) - strlen(".karstdb") < 48 ? strlen(name) - strlen(".karstdb") : 48), name);
    int fd = open(text_file, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    static bool registered;
    if (!registered)
        atexit(remove_text_file);
    registered = true;
    command_add_temporary(text_file);
    command_add_temporary(text_folder);
    bool written = fd >= 0 && command_write_all(fd, about->text, about->text_bytes);
    int reason = errno;
    if (fd >= 0)
        close(fd);
    return written || karst_fail(error, KARST_FAILED, "cannot write %s: %s; set TMPDIR", text_file, strerror(reason));
}

bool command_is_from_inside(const char *world_file) { return strcmp(world_file, text_file) == 0; }

/* Edits stay where they are, also if the land under them becomes another. */
static void say_if_changed(command_talk *talk, const char *name, const char *world_file, uint64_t sum)
{
    FILE *file = fopen(world_file, "rb");
    const size_t most = (size_t)2 << 20;
    char *text = file && sum ? malloc(most) : NULL;
    size_t size_bytes = text ? fread(text, 1, most, file) : 0;
    if (text && !ferror(file) && karst_saved_sum(text, size_bytes) != sum)
        command_say(talk, "note: %s has changed since %s was made", world_file, name);
    free(text);
    if (file)
        fclose(file);
}

/* ---- what the file says ---- */

/* Texts that options point to live as long as the program. */
static struct {
    char camera[512], edits[PATH_MAX];
} kept;

static bool take_parameters(const karst_saved_about *about, command_parameters *parameters, karst_error *error)
{
    for (size_t i = 0; i < about->num_parameters; i++) {
        const karst_parameter *one = &about->parameters[i];
        bool is_given = false;
        for (size_t j = 0; j < parameters->num_values; j++)
            is_given = is_given || strcmp(parameters->names[j], one->name) == 0;
        if (is_given)
            continue;
        if (parameters->num_values == COMMAND_MAX_PARAMETERS || strlen(one->name) >= sizeof parameters->names[0])
            return karst_fail(error, KARST_USAGE, "--param: %d parameters are the most", COMMAND_MAX_PARAMETERS);
        size_t at = parameters->num_values++;
        strcpy(parameters->names[at], one->name);
        parameters->values[at] = (karst_parameter){parameters->names[at], one->value};
    }
    return true;
}

static bool take(const char *name, const karst_saved *saved, const command_scene *scene, command_talk *talk,
                 karst_error *error)
{
    const karst_saved_about *about = karst_saved_get_about(saved);
    if (about->text && !write_text(name, about, error))
        return false;
    if (!about->text && !about->world)
        return karst_fail(
            error, KARST_BAD_DATA,
            "which world %s is of is lost: karst edit %s --recover NEW.karstdb --world WORLD makes a file "
            "that knows",
            name, name);
    if (!command_find_world(about->text ? text_file : about->world, scene->world_file, scene->size_bytes, error))
        return false;
    if (!about->text && access(scene->world_file, R_OK) != 0)
        return karst_fail(error, KARST_BAD_WORLD,
                          "%s is of the world %s, which cannot be read: %s; with karst new "
                          "--embed a saved world holds its text",
                          name, scene->world_file, strerror(errno));
    if (!about->text)
        say_if_changed(talk, name, scene->world_file, about->text_sum);
    if (scene->camera && !*scene->camera && about->camera) {
        snprintf(kept.camera, sizeof kept.camera, "%s", about->camera);
        *scene->camera = kept.camera;
    }
    if (scene->edits && *scene->edits)
        return karst_fail(error, KARST_USAGE, "--edits %s: %s has edits of its own; karst edit %s --from %s adds these",
                          *scene->edits, name, name, *scene->edits);
    if (scene->edits && karst_saved_num_edits(saved, NULL)) {
        if (snprintf(kept.edits, sizeof kept.edits, "%s", name) >= (int)sizeof kept.edits)
            return karst_fail(error, KARST_USAGE, "%.60s...: the name is too long", name);
        *scene->edits = kept.edits;
    }
    if (scene->has_seed && !*scene->has_seed && about->has_seed) {
        *scene->has_seed = true;
        *scene->seed = about->seed;
    }
    return take_parameters(about, scene->parameters, error);
}

bool command_find_scene(const char *name, const command_scene *scene, command_talk *talk, karst_error *error)
{
    if (!karst_saved_is_name(name))
        return command_find_world(name, scene->world_file, scene->size_bytes, error);
    const karst_log log = command_log(talk);
    karst_saved *saved = karst_saved_open(name, false, &log, error);
    bool done = saved && take(name, saved, scene, talk, error);
    karst_saved_close(saved);
    return done;
}

karst_edit *command_load_edits(const char *path, int voxel_log2_m, size_t *num, const karst_log *log,
                               karst_error *error)
{
    return karst_saved_is_name(path) ? karst_saved_load_edits(path, voxel_log2_m, num, log, error)
                                     : karst_edits_load(path, voxel_log2_m, num, error);
}

/* ---- what there is to say of one ---- */

static json_t *describe(const char *name, const karst_saved *saved)
{
    const karst_saved_about *about = karst_saved_get_about(saved);
    size_t num_redoable, num = karst_saved_num_edits(saved, &num_redoable);
    json_t *all =
        json_pack("{s:s, s:i, s:s?, s:s?, s:b, s:f}", "file", name, "format", about->version, "made_by", about->made_by,
                  "world", about->world, "embedded", about->text != NULL, "voxel_m", ldexp(1, about->voxel_log2_m));
    json_t *parameters = json_object(), *bookmarks = json_object();
    for (size_t i = 0; i < about->num_parameters; i++)
        json_object_set_new(parameters, about->parameters[i].name, json_real(about->parameters[i].value));
    for (int i = 0; i < KARST_SAVED_NUM_BOOKMARKS; i++) {
        char number[2] = {(char)('1' + i), 0};
        if (about->bookmarks[i])
            json_object_set_new(bookmarks, number, json_string(about->bookmarks[i]));
    }
    json_object_set_new(all, "parameters", parameters);
    json_object_set_new(all, "seed", about->has_seed ? json_integer(about->seed) : json_null());
    json_object_set_new(all, "camera", about->camera ? json_string(about->camera) : json_null());
    json_object_set_new(all, "bookmarks", bookmarks);
    json_object_set_new(all, "edits", json_integer((json_int_t)num));
    json_object_set_new(all, "redoable", json_integer((json_int_t)num_redoable));
    return all;
}

static void print(const char *name, const karst_saved *saved)
{
    const karst_saved_about *about = karst_saved_get_about(saved);
    size_t num_redoable, num = karst_saved_num_edits(saved, &num_redoable);
    printf("%s: a saved world, format %d\n  world %s\n", name, about->version,
           about->text    ? "inside"
           : about->world ? about->world
                          : "lost");
    for (size_t i = 0; i < about->num_parameters; i++)
        printf("  parameter %s = %.12g\n", about->parameters[i].name, about->parameters[i].value);
    if (about->has_seed)
        printf("  seed %u\n", about->seed);
    if (about->camera)
        printf("  camera %s\n", about->camera);
    for (int i = 0; i < KARST_SAVED_NUM_BOOKMARKS; i++)
        if (about->bookmarks[i])
            printf("  bookmark %d %s\n", i + 1, about->bookmarks[i]);
    printf("  %zu edits%s\n", num, num_redoable ? ", and more that can be redone" : "");
}

bool command_print_saved(const char *name, bool json, command_talk *talk, karst_error *error)
{
    const karst_log log = command_log(talk);
    if (!karst_saved_is_name(name))
        return karst_fail(error, KARST_USAGE,
                          "%s: karst info takes a saved world, FILE.karstdb; karst check %s says "
                          "what there is to say of a world",
                          name, name);
    karst_saved *saved = karst_saved_open(name, false, &log, error);
    if (!saved)
        return false;
    json_t *all = json ? describe(name, saved) : NULL;
    char *text = json ? json_dumps(all, JSON_INDENT(2) | JSON_PRESERVE_ORDER) : NULL;
    if (text)
        puts(text);
    else if (!json)
        print(name, saved);
    free(text);
    json_decref(all);
    karst_saved_close(saved);
    return !json || text || karst_fail(error, KARST_FAILED, "out of memory");
}
