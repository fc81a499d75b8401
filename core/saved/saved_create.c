/* New files: made under another name, and given theirs when they are whole. */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/base/text.h"
#include "core/saved/saved_parts.h"

/* ---- files ---- */

static const char *name_of(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

sqlite3 *saved_open_new(const char *path, char **temporary, karst_error *error)
{
    sqlite3 *db = NULL;
    int fd = -1;
    *temporary = NULL;
    if (!*name_of(path)) {
        karst_fail(error, KARST_USAGE, "a saved world needs a name, such as world.karstdb");
        return NULL;
    }
    if (access(path, F_OK) == 0) {
        karst_fail(error, KARST_FAILED, "%s is there already; remove it, or choose another name", path);
        return NULL;
    }
    for (unsigned i = 0; fd < 0 && i < 100; i++) {
        free(*temporary);
        if (asprintf(temporary, "%.*s.karst-%ld-%u.karstdb", (int)(name_of(path) - path), path, (long)getpid(), i) < 0)
            *temporary = NULL;
        errno = ENOMEM;
        fd = *temporary ? open(*temporary, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666) : -1;
        if (fd < 0 && errno != EEXIST)
            break;
    }
    if (fd < 0) {
        karst_fail(error, KARST_FAILED, "cannot write %s: %s", path, strerror(errno));
        free(*temporary);
        *temporary = NULL;
        return NULL;
    }
    close(fd);
    if (sqlite3_open_v2(*temporary, &db, SQLITE_OPEN_READWRITE | SQLITE_OPEN_NOMUTEX, NULL) == SQLITE_OK &&
        saved_defend(db))
        return db;
    karst_fail(error, KARST_FAILED, "cannot write %s: %s", path, db ? sqlite3_errmsg(db) : "out of memory");
    sqlite3_close(db);
    unlink(*temporary);
    free(*temporary);
    *temporary = NULL;
    return NULL;
}

/* A new name is on the disk when its folder is. */
static void sync_folder(const char *path)
{
    char *folder = NULL;
    size_t length = (size_t)(name_of(path) - path);
    if (asprintf(&folder, "%.*s", length ? (int)length : 1, length ? path : ".") < 0)
        return;
    int fd = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd >= 0) {
        fsync(fd);
        close(fd);
    }
    free(folder);
}

bool saved_finish_new(sqlite3 *db, char *temporary, const char *path, bool good, karst_error *error)
{
    bool closed = sqlite3_close(db) == SQLITE_OK;
    good = good && (closed || karst_fail(error, KARST_FAILED, "cannot write %s", path));
    /* A link takes no name that is there; where there are none, a file that has come meanwhile is replaced. */
    if (good && link(temporary, path) != 0) {
        good = errno != EEXIST && rename(temporary, path) == 0;
        if (!good)
            karst_fail(error, KARST_FAILED,
                       errno == EEXIST ? "%s is there already; choose another name (%s)" : "cannot write %s: %s", path,
                       strerror(errno));
    }
    unlink(temporary);
    free(temporary);
    if (good)
        sync_folder(path);
    return good;
}

bool saved_make_tables(karst_saved *saved, karst_error *error)
{
    char sql[200];
    snprintf(sql, sizeof sql, "PRAGMA page_size=%d; BEGIN; PRAGMA application_id=%d; PRAGMA user_version=%d",
             SAVED_PAGE_BYTES, SAVED_APPLICATION_ID, SAVED_FIRST_VERSION);
    return saved_run(saved, sql, "written", error) && saved_run(saved, SAVED_SQL_FACTS, "written", error) &&
           saved_run(saved, SAVED_SQL_EDITS, "written", error);
}

/* ---- the world ---- */

static char *read_text(const char *path, size_t *size_bytes, karst_error *error)
{
    FILE *file = fopen(path, "rb");
    char *text = malloc(SAVED_MAX_TEXT_BYTES + 1);
    *size_bytes = file && text ? fread(text, 1, SAVED_MAX_TEXT_BYTES + 1, file) : 0;
    bool good = file && text && !ferror(file) && *size_bytes <= SAVED_MAX_TEXT_BYTES;
    if (!good)
        karst_fail(error, KARST_FAILED, "cannot read %s: %s", path, text ? strerror(errno) : "out of memory");
    if (file)
        fclose(file);
    if (!good) {
        free(text);
        return NULL;
    }
    return text;
}

char *saved_name_world(const char *world, const char *path)
{
    char *name = NULL, *folder = NULL, *from = NULL, *to = NULL;
    size_t length = (size_t)(name_of(path) - path), num_letters = strlen(world), suffix = strlen(".karst");
    if (!strchr(world, '/') && (num_letters <= suffix || strcmp(world + num_letters - suffix, ".karst") != 0))
        return strdup(world);
    if (asprintf(&folder, "%.*s", length ? (int)length : 1, length ? path : ".") < 0)
        folder = NULL;
    if (folder && (from = realpath(folder, NULL)) && (to = realpath(world, NULL))) {
        size_t common = strcmp(from, "/") == 0 ? 0 : strlen(from);
        bool is_below = common && strncmp(from, to, common) == 0 && to[common] == '/';
        if (asprintf(&name, "%s%s", is_below ? "./" : "", is_below ? to + common + 1 : to) < 0)
            name = NULL;
    }
    free(folder);
    free(from);
    free(to);
    return name;
}

static bool write_text(karst_saved *saved, const char *key, const char *text, karst_error *error)
{
    return saved_write_fact(saved, key, text, strlen(text), error);
}

static bool write_number(karst_saved *saved, const char *key, double number, karst_error *error)
{
    char text[40];
    karst_text_from_double(number, text, sizeof text);
    return write_text(saved, key, text, error);
}

static bool write_facts(karst_saved *saved, const karst_saved_config *config, const karst_world_metadata *about,
                        const char *path, karst_error *error)
{
    size_t size_bytes;
    char *text = read_text(about->path, &size_bytes, error), key[SAVED_MAX_KEY_BYTES], sum[24];
    char *name = text ? saved_name_world(config->world, path) : NULL;
    if (text && !name)
        karst_fail(error, KARST_FAILED, "cannot say where %s is: %s", config->world, strerror(errno));
    bool done = name && write_text(saved, "made_by", KARST_VERSION, error) &&
                (config->embed ? saved_write_fact(saved, "text", text, size_bytes, error)
                               : write_text(saved, "world", name, error));
    if (done) {
        snprintf(sum, sizeof sum, "%016llx", (unsigned long long)karst_saved_sum(text, size_bytes));
        done = write_text(saved, "text_sum", sum, error) &&
               write_number(saved, "voxel_log2_m", about->voxel_log2_m, error) &&
               write_number(saved, "num_in_force", 0, error) &&
               (!config->has_seed || write_number(saved, "seed", config->seed, error)) &&
               (!config->camera || write_text(saved, "camera", config->camera, error));
    }
    for (size_t i = 0; done && i < config->num_parameters; i++) {
        const karst_parameter *parameter = &config->parameters[i];
        done = snprintf(key, sizeof key, "param:%s", parameter->name) < (int)sizeof key
                   ? write_number(saved, key, parameter->value, error)
                   : karst_fail(error, KARST_USAGE, "the parameter %.60s has too long a name", parameter->name);
    }
    free(text);
    free(name);
    return done;
}

static bool check_config(const karst_saved_config *config, const karst_world_metadata *about, karst_error *error)
{
    karst_camera camera = about->camera;
    if (config->num_parameters > KARST_SAVED_MAX_PARAMETERS)
        return karst_fail(error, KARST_USAGE, "%zu parameters; a saved world keeps %d", config->num_parameters,
                          KARST_SAVED_MAX_PARAMETERS);
    if (config->camera && strlen(config->camera) >= SAVED_MAX_CAMERA_BYTES)
        return karst_fail(error, KARST_USAGE, "a camera has %d characters at most", SAVED_MAX_CAMERA_BYTES - 1);
    return !config->camera || karst_camera_parse(config->camera, about->voxel_log2_m, &camera, error);
}

bool karst_saved_create(const char *path, const karst_saved_config *config, karst_error *error)
{
    const karst_world_config of_world = {.world = config->world,
                                         .parameters = config->parameters,
                                         .num_parameters = config->num_parameters,
                                         .has_seed = config->has_seed,
                                         .seed = config->seed,
                                         .log = config->log};
    karst_world *world = karst_world_open(&of_world, error);
    const karst_world_metadata *about = world ? karst_world_get_metadata(world) : NULL;
    char *temporary = NULL;
    bool done = about && check_config(config, about, error);
    sqlite3 *db = done ? saved_open_new(path, &temporary, error) : NULL;
    if (db) {
        karst_saved saved = {.db = db, .path = (char[]){0}};
        saved.path = temporary;
        done = saved_make_tables(&saved, error) && write_facts(&saved, config, about, path, error) &&
               saved_run(&saved, "COMMIT; PRAGMA journal_mode=WAL", "written", error);
        done = saved_finish_new(db, temporary, path, done, error);
    }
    karst_world_close(world);
    return done && db;
}
