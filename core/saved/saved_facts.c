/* What a saved world says beside its edits: a row for each fact, with a checksum. */
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/text.h"
#include "core/saved/saved_parts.h"

#define PARAMETER_PREFIX "param:"

static uint64_t sum_fact(const char *key, const void *value, size_t size_bytes)
{
    return saved_sum(saved_sum(SAVED_SUM_BEGIN, key, strlen(key) + 1), value, size_bytes);
}

void saved_free_facts(karst_saved *saved)
{
    for (size_t i = 0; i < saved->num_facts; i++)
        free(saved->facts[i].text);
    free(saved->facts);
    free(saved->world_path);
    saved->facts = NULL;
    saved->num_facts = 0;
    saved->world_path = NULL;
}

static saved_fact *find_fact(const karst_saved *saved, const char *key)
{
    for (size_t i = 0; i < saved->num_facts; i++)
        if (strcmp(saved->facts[i].key, key) == 0)
            return &saved->facts[i];
    return NULL;
}

static const char *text_of(const karst_saved *saved, const char *key)
{
    const saved_fact *fact = find_fact(saved, key);
    return fact ? fact->text : NULL;
}

/* Keeps a fact in memory; a value of before goes. */
static bool keep_fact(karst_saved *saved, const char *key, const void *value, size_t size_bytes, karst_error *error)
{
    saved_fact *fact = find_fact(saved, key);
    if (!fact) {
        saved_fact *facts = realloc(saved->facts, (saved->num_facts + 1) * sizeof *facts);
        if (!facts)
            return karst_fail(error, KARST_FAILED, "out of memory for a saved world");
        saved->facts = facts;
        fact = &facts[saved->num_facts];
        *fact = (saved_fact){0};
        snprintf(fact->key, sizeof fact->key, "%s", key);
    }
    char *text = malloc(size_bytes + 1);
    if (!text)
        return karst_fail(error, KARST_FAILED, "out of memory for a saved world");
    if (size_bytes)
        memcpy(text, value, size_bytes);
    text[size_bytes] = '\0';
    free(fact->text);
    fact->text = text;
    fact->size_bytes = size_bytes;
    saved->num_facts += fact == &saved->facts[saved->num_facts];
    return true;
}

static void forget_fact(karst_saved *saved, const char *key)
{
    saved_fact *fact = find_fact(saved, key);
    if (!fact)
        return;
    free(fact->text);
    *fact = saved->facts[--saved->num_facts];
}

/* ---- what they mean ---- */

/* A whole number within a range. */
static bool to_integer(const char *text, long long least, long long most, long long *number)
{
    double value;
    if (!text || strlen(text) > 20 || !karst_text_to_double(text, &value) || value < (double)least ||
        value > (double)most)
        return false;
    *number = (long long)value;
    return (double)*number == value;
}

/* A fact that is of another form than its key asks for counts as damaged, and is not there then. */
static bool read_integer(karst_saved *saved, const char *key, long long least, long long most, long long *number)
{
    const char *text = text_of(saved, key);
    if (!text)
        return false;
    if (to_integer(text, least, most, number))
        return true;
    saved_note_damage(saved, "its '%s' is no number that would do", key);
    forget_fact(saved, key);
    return false;
}

static const char *read_camera(karst_saved *saved, const char *key)
{
    const char *text = text_of(saved, key);
    karst_camera camera = {.fov_deg = 60};
    if (!text ||
        (strlen(text) < SAVED_MAX_CAMERA_BYTES && karst_camera_parse(text, saved->about.voxel_log2_m, &camera, NULL)))
        return text;
    saved_note_damage(saved, "its '%s' is no camera", key);
    forget_fact(saved, key);
    return NULL;
}

static void read_parameters(karst_saved *saved)
{
    karst_saved_about *about = &saved->about;
    about->parameters = saved->parameters;
    about->num_parameters = 0;
    for (size_t i = 0; i < saved->num_facts; i++) {
        const saved_fact *fact = &saved->facts[i];
        double value;
        if (strncmp(fact->key, PARAMETER_PREFIX, strlen(PARAMETER_PREFIX)) != 0)
            continue;
        if (about->num_parameters == KARST_SAVED_MAX_PARAMETERS || !karst_text_to_double(fact->text, &value))
            saved_note_damage(saved, "its '%s' is no number, or one too many", fact->key);
        else
            saved->parameters[about->num_parameters++] = (karst_parameter){fact->key + strlen(PARAMETER_PREFIX), value};
    }
}

/* Names go into messages, and to terminals with these. */
static bool is_plain(const char *text)
{
    for (; *text; text++)
        if ((unsigned char)*text < ' ' || *text == 0x7f)
            return false;
    return true;
}

/* The world's file, as it is found from here: names without a slash are shipped worlds', and relative paths begin at
 * the saved world's folder. */
static bool find_world(karst_saved *saved, karst_error *error)
{
    const char *world = text_of(saved, "world"), *slash = strrchr(saved->path, '/');
    free(saved->world_path);
    saved->world_path = NULL;
    saved->about.world = NULL;
    if (!world)
        return true;
    /* Names that mean something else to a command, such as -, are none of a world. */
    if (!*world || *world == '-' || strlen(world) >= PATH_MAX || !is_plain(world)) {
        saved_note_damage(saved, "its 'world' is no name of one");
        return true;
    }
    saved->about.world = world;
    if (world[0] == '/' || !strchr(world, '/'))
        return true;
    int length = slash ? (int)(slash - saved->path) : 1;
    if (asprintf(&saved->world_path, "%.*s/%s", length, slash ? saved->path : ".", world) < 0) {
        saved->world_path = NULL;
        return karst_fail(error, KARST_FAILED, "out of memory for a saved world");
    }
    saved->about.world = saved->world_path;
    return true;
}

static bool understand(karst_saved *saved, karst_error *error)
{
    karst_saved_about *about = &saved->about;
    long long number;
    char key[SAVED_MAX_KEY_BYTES];
    about->voxel_log2_m = 0;
    saved->has_voxel = read_integer(saved, "voxel_log2_m", KARST_VOXEL_LOG2_MIN, KARST_VOXEL_LOG2_MAX, &number);
    if (saved->has_voxel)
        about->voxel_log2_m = (int)number;
    about->has_seed = read_integer(saved, "seed", 0, UINT32_MAX, &number);
    about->seed = about->has_seed ? (uint32_t)number : 0;
    const saved_fact *text = find_fact(saved, "text"), *sum = find_fact(saved, "text_sum");
    about->text = text ? text->text : NULL;
    about->text_bytes = text ? text->size_bytes : 0;
    about->text_sum = sum ? strtoull(sum->text, NULL, 16) : 0;
    about->made_by = text_of(saved, "made_by");
    read_parameters(saved);
    about->camera = read_camera(saved, "camera");
    for (int i = 0; i < KARST_SAVED_NUM_BOOKMARKS; i++) {
        snprintf(key, sizeof key, SAVED_BOOKMARK_PREFIX "%d", i + 1);
        about->bookmarks[i] = read_camera(saved, key);
    }
    if (!find_world(saved, error))
        return false;
    if (!about->world && !about->text)
        saved_note_damage(saved, "which world it is of is lost; --recover NEW.karstdb --world WORLD names it");
    return true;
}

/* ---- reading ---- */

static bool read_row(karst_saved *saved, sqlite3_stmt *row, karst_error *error)
{
    const char *key = (const char *)sqlite3_column_text(row, 0);
    const void *value = sqlite3_column_blob(row, 1);
    size_t size_bytes = (size_t)sqlite3_column_bytes(row, 1), length = key ? strlen(key) : 0;
    char quoted[KARST_TEXT_QUOTE_BYTES];
    if (!length || length >= SAVED_MAX_KEY_BYTES || !is_plain(key) || sqlite3_column_type(row, 1) != SQLITE_BLOB ||
        (uint64_t)sqlite3_column_int64(row, 2) != sum_fact(key, value, size_bytes)) {
        saved_note_damage(saved, "its '%s' is damaged, and left out", karst_text_quote(key ? key : "", quoted));
        return true;
    }
    return keep_fact(saved, key, value, size_bytes, error);
}

bool saved_read_facts(karst_saved *saved, uint64_t *num_in_force, bool *has_num, karst_error *error)
{
    sqlite3_stmt *statement = NULL;
    int code = sqlite3_prepare_v2(saved->db, "SELECT key, value, sum FROM facts ORDER BY key", -1, &statement, NULL);
    bool good = true;
    saved_free_facts(saved);
    for (size_t i = 0; code == SQLITE_OK && good && i < SAVED_MAX_FACTS; i++) {
        if ((code = sqlite3_step(statement)) != SQLITE_ROW)
            break;
        good = read_row(saved, statement, error);
        code = SQLITE_OK;
    }
    if (good && code != SQLITE_DONE && code != SQLITE_OK && !saved_is_damage(code))
        good = saved_fail(saved, "read", error);
    else if (good && code != SQLITE_DONE)
        saved_note_damage(saved, "facts that it keeps are damaged from '%s' on: world, camera, bookmarks, parameters",
                          saved->num_facts ? saved->facts[saved->num_facts - 1].key : "the first");
    sqlite3_finalize(statement);
    long long number = 0;
    *has_num = good && read_integer(saved, "num_in_force", 0, KARST_MAX_EDITS, &number);
    *num_in_force = (uint64_t)number;
    return good && understand(saved, error);
}

/* ---- writing ---- */

bool saved_write_fact(karst_saved *saved, const char *key, const void *value, size_t size_bytes, karst_error *error)
{
    sqlite3_stmt *statement = NULL;
    const char *sql = value ? "INSERT OR REPLACE INTO facts VALUES (?1, ?2, ?3)" : "DELETE FROM facts WHERE key = ?1";
    bool done = sqlite3_prepare_v2(saved->db, sql, -1, &statement, NULL) == SQLITE_OK &&
                sqlite3_bind_text(statement, 1, key, -1, SQLITE_STATIC) == SQLITE_OK;
    if (done && value)
        done = sqlite3_bind_blob64(statement, 2, value, size_bytes, SQLITE_STATIC) == SQLITE_OK &&
               sqlite3_bind_int64(statement, 3, (int64_t)sum_fact(key, value, size_bytes)) == SQLITE_OK;
    done = done && sqlite3_step(statement) == SQLITE_DONE;
    if (!done)
        saved_fail(saved, "written", error);
    sqlite3_finalize(statement);
    return done;
}

bool saved_set_camera(karst_saved *saved, const char *key, const char *camera, karst_error *error)
{
    if (!saved_write_fact(saved, key, camera, camera ? strlen(camera) : 0, error))
        return false;
    if (!camera)
        forget_fact(saved, key);
    else if (!keep_fact(saved, key, camera, strlen(camera), error))
        return false;
    return understand(saved, error);
}
