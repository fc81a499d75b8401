/* Files that are damaged, and files by who means harm: what is lost is named, the rest is there, and nothing else
 * happens. Every byte of every page with KARST_TEST_FULL=1. */
#include <sqlite3.h>

#define RIG_IN_MEMORY true
#include "tests/saved/rig.h"
#include "tests/support/files.h"

#define PAGE_BYTES 4096
#define NUM_EDITS 300

/* ---- damage ---- */

typedef struct {
    size_t num_good, num_lost, next;
    bool in_order;
} tally;

static bool count(void *user, size_t number, size_t last, const karst_edit *edit)
{
    tally *t = user;
    karst_edit expected = rig_edit(number, 0);
    t->in_order = t->in_order && number == t->next && last >= number && (!edit || rig_is_same(edit, &expected));
    t->next = last + 1;
    t->num_good += edit != NULL;
    t->num_lost += edit ? 0 : last - number + 1;
    return true;
}

static size_t num_warnings;
static void note_warning(void *user, karst_log_level level, const char *line)
{
    (void)user;
    (void)level;
    num_warnings += *line != '\0';
}
static const karst_log warnings = {.write = note_warning, .max_level = KARST_LOG_WARNING};

/* What is left of a file one byte of which is wrong. Returns how many edits are lost. */
static size_t look_at(const char *path, size_t byte)
{
    tally t = {.next = 1, .in_order = true};
    karst_error reason = {0};
    num_warnings = 0;
    karst_saved *saved = karst_saved_open(path, false, &warnings, &reason);
    if (!saved && byte >= PAGE_BYTES)
        fail_msg("byte %zu: %s", byte, reason.message);
    if (!saved) { /* the first page: the rest is there all the same */
        const char *new_path = rig_path("recovered.karstdb");
        unlink(new_path);
        assert_int_equal(reason.status, KARST_BAD_DATA);
        assert_ok(karst_saved_recover(path, new_path, NULL, &warnings, &error));
        saved = rig_open(new_path, false);
    }
    size_t num = karst_saved_num_edits(saved, NULL), num_facts_lost = karst_saved_get_about(saved)->num_damaged;
    if (num > NUM_EDITS || (num < NUM_EDITS && !num_facts_lost && !num_warnings))
        fail_msg("byte %zu: %zu edits without a word", byte, num);
    assert_ok(karst_saved_visit(saved, 1, NUM_EDITS, RIG_VOXEL_LOG2_M, count, &t, &error));
    if (!t.in_order || t.num_good + t.num_lost != num)
        fail_msg("byte %zu: %zu edits and %zu lost of %zu, in order: %d", byte, t.num_good, t.num_lost, num,
                 t.in_order);
    const karst_saved_about *about = karst_saved_get_about(saved);
    if (!num_facts_lost && (!about->world || strcmp(about->world, "hills") != 0 || !about->bookmarks[0] ||
                            strcmp(about->bookmarks[0], "1,2,3,4,5") != 0 || about->voxel_log2_m != RIG_VOXEL_LOG2_M))
        fail_msg("byte %zu: a fact is another one without a word", byte);
    if (t.num_lost && rig_count_wrong(saved) == 0)
        fail_msg("byte %zu: %zu edits are lost, and --check says nothing", byte, t.num_lost);
    karst_saved_close(saved);
    return t.num_lost;
}

static void a_wrong_byte_costs_what_it_hits(void **state)
{
    (void)state;
    const char *path = rig_path("whole.karstdb"), *broken = rig_path("broken.karstdb");
    size_t size_bytes, most_lost = 0, num_looks = 0, num_harmless = 0, num_one = 0;
    rig_create(path);
    karst_saved *saved = rig_open(path, true);
    rig_append(saved, 1, NUM_EDITS, 0);
    assert_ok(karst_saved_set_bookmark(saved, 0, "1,2,3,4,5", &error));
    assert_ok(karst_saved_commit(saved, &error));
    karst_saved_close(saved);
    uint8_t *bytes = read_file(path, &size_bytes);
    assert_true(size_bytes >= 5 * PAGE_BYTES);
    /* The heads of pages, where numbers of places stand, in full; then a spread. */
    size_t step = rig_number(1, 97, 907);
    for (size_t at = 0; at < size_bytes; at += at % PAGE_BYTES < (step == 1 ? 1u : 16u) || step == 1 ? 1 : step) {
        uint8_t was = bytes[at];
        bytes[at] ^= (uint8_t)(1u << rig_mix(at) % 8);
        write_file(broken, bytes, size_bytes);
        bytes[at] = was;
        size_t num_lost = look_at(broken, at);
        most_lost = num_lost > most_lost ? num_lost : most_lost;
        num_harmless += num_lost == 0;
        num_one += num_lost == 1;
        num_looks++;
    }
    free(bytes);
    printf("# %zu bytes of %zu pages: nothing lost of %zu, one edit of %zu, at most %zu\n", num_looks,
           size_bytes / PAGE_BYTES, num_harmless, num_one, most_lost);
    assert_true(num_one > num_looks / 8);
}

/* All of a page is wrong, or the file ends before it. */
static void a_lost_page_costs_its_edits(void **state)
{
    (void)state;
    const char *path = rig_path("whole.karstdb"), *broken = rig_path("broken.karstdb");
    size_t size_bytes;
    uint8_t *bytes = read_file(path, &size_bytes);
    for (size_t page = 1; page < size_bytes / PAGE_BYTES; page++) {
        uint8_t *copy = malloc(size_bytes);
        assert_non_null(copy);
        memcpy(copy, bytes, size_bytes);
        for (int i = 0; i < PAGE_BYTES; i++)
            copy[page * PAGE_BYTES + (size_t)i] = (uint8_t)rig_mix(page * PAGE_BYTES + (size_t)i);
        write_file(broken, copy, size_bytes);
        size_t num_lost = look_at(broken, page * PAGE_BYTES);
        if (page == 2) { /* which leads to all edits: they are found without it */
            const char *new_path = rig_path("recovered.karstdb");
            unlink(new_path);
            assert_int_equal(num_lost, NUM_EDITS);
            assert_ok(karst_saved_recover(broken, new_path, NULL, NULL, &error));
            karst_saved *saved = rig_open(new_path, false);
            tally t = {.next = 1, .in_order = true};
            assert_ok(karst_saved_visit(saved, 1, NUM_EDITS, RIG_VOXEL_LOG2_M, count, &t, &error));
            assert_true(t.in_order && t.num_good == NUM_EDITS);
            karst_saved_close(saved);
        }
        if (page > 2) /* neither the facts' nor the one that knows all others */
            assert_in_range(num_lost, 1, 80);
        free(copy);
    }
    free(bytes);
}

/* ---- strangers ---- */

static void run(const char *path, const char *sql)
{
    sqlite3 *db;
    char *message = NULL;
    assert_int_equal(sqlite3_open(path, &db), SQLITE_OK);
    sqlite3_db_config(db, SQLITE_DBCONFIG_DEFENSIVE, 0, (int *)NULL);
    if (sqlite3_exec(db, sql, NULL, NULL, &message) != SQLITE_OK)
        fail_msg("%s: %s", sql, message);
    sqlite3_close(db);
}

/* A sound file with this done to it. */
static const char *tampered(const char *sql)
{
    const char *path = rig_path("tampered.karstdb");
    unlink(path);
    rig_create(path);
    karst_saved *saved = rig_open(path, true);
    rig_append(saved, 1, 3, 0);
    assert_ok(karst_saved_commit(saved, &error));
    karst_saved_close(saved);
    run(path, sql);
    return path;
}

static void other_files_are_refused(void **state)
{
    (void)state;
    static const struct {
        const char *sql, *words;
    } cases[] = {
        {"PRAGMA application_id=1", "no saved world"},
        {"PRAGMA application_id=0", "no saved world"},
        {"PRAGMA user_version=3", "newer Karst"},
        {"PRAGMA user_version=2000000000", "newer Karst"},
        {"PRAGMA user_version=0", "no saved world"},
        {"PRAGMA user_version=-1", "no saved world"},
        {"CREATE TRIGGER t AFTER INSERT ON edits BEGIN DELETE FROM edits; END", "trigger"},
        {"CREATE TRIGGER t AFTER UPDATE ON facts BEGIN DELETE FROM edits; END", "trigger"},
        {"CREATE VIEW v AS SELECT load_extension('x') FROM edits", "view"},
        {"CREATE TABLE more (a)", "table 'more'"},
        {"CREATE INDEX i ON edits (edit)", "index"},
        {"CREATE VIRTUAL TABLE v USING fts5(a)", "none of a saved world's"},
        {"DROP TABLE edits", "table is missing"},
        {"DROP TABLE facts", "table is missing"},
        {"DROP TABLE edits; CREATE VIEW edits AS SELECT 1 AS id, x'00' AS edit", "view"},
        {"DROP TABLE edits; CREATE TABLE edits (id INTEGER PRIMARY KEY, edit BLOB NOT NULL)", "not as Karst makes it"},
        {"DROP TABLE edits; CREATE TABLE edits (id INTEGER PRIMARY KEY, edit BLOB NOT NULL, more AS (hex(edit)))",
         "not as Karst makes it"},
        {"ALTER TABLE edits ADD COLUMN x TEXT DEFAULT 'y'", "not as Karst makes it"},
        {"PRAGMA writable_schema=ON; UPDATE sqlite_schema SET sql='CREATE TABLE edits (id, edit' WHERE name='edits'",
         "damaged"},
        {"PRAGMA writable_schema=ON; UPDATE sqlite_schema SET rootpage=1000000 WHERE name='edits'", "damaged"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const char *path = tampered(cases[i].sql);
        karst_error error = {0};
        for (int for_writing = 0; for_writing < 2; for_writing++) {
            size_t size_bytes, size_after;
            uint8_t *before = read_file(path, &size_bytes);
            karst_saved *saved = karst_saved_open(path, for_writing, NULL, &error);
            if (saved || error.status != KARST_BAD_DATA || !strstr(error.message, cases[i].words))
                fail_msg("%s: %d, %s", cases[i].sql, (int)error.status, saved ? "opened" : error.message);
            uint8_t *after = read_file(path, &size_after);
            assert_int_equal(size_bytes, size_after);
            assert_memory_equal(before, after, size_bytes);
            free(before);
            free(after);
        }
    }
    static const char *const names[] = {"empty", "text", "short", "noise"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        uint8_t noise[3 * PAGE_BYTES];
        const char *path = rig_path(names[i]);
        for (size_t k = 0; k < sizeof noise; k++)
            noise[k] = (uint8_t)rig_mix(k);
        memcpy(noise, "SQLite format 3", i == 3 ? 16 : 0);
        write_file(path, i == 1 ? (const void *)"float density(vec3 p) { return -p.y; }\n" : noise,
                    (size_t[]){0, 38, 50, sizeof noise}[i]);
        karst_error error = {0};
        assert_null(karst_saved_open(path, true, NULL, &error));
        assert_int_equal(error.status, KARST_BAD_DATA);
        karst_error recovery = {0};
        assert_false(karst_saved_recover(path, rig_path("never.karstdb"), NULL, NULL, &recovery));
        assert_int_equal(access(rig_path("never.karstdb"), F_OK), -1);
    }
    assert_fails(KARST_BAD_DATA, "no file", karst_saved_open(rig_folder, true, NULL, &error));
    assert_fails(KARST_BAD_DATA, "No such file", karst_saved_open(rig_path("nowhere"), true, NULL, &error));
}

/* Rows that the tables take but Karst would not write. `num_good` of the three edits stay. */
static void rows_that_are_none_are_named(void **state)
{
    (void)state;
    static const struct {
        const char *sql;
        size_t num, num_good, num_damaged;
    } cases[] = {
        {"UPDATE edits SET edit = x'' WHERE id = 2", 3, 2, 0},
        {"UPDATE edits SET edit = x'00' WHERE id = 2", 3, 2, 0},
        {"UPDATE edits SET edit = zeroblob(1000000) WHERE id = 2", 3, 2, 0},
        {"UPDATE edits SET edit = zeroblob(30000000) WHERE id = 2", 3, 2, 0},
        {"UPDATE edits SET edit = randomblob(76) WHERE id = 2", 3, 2, 0},
        {"UPDATE edits SET edit = (SELECT edit FROM edits WHERE id = 1) WHERE id = 2", 3, 2, 0},
        {"DELETE FROM edits WHERE id = 2", 3, 2, 0},
        {"DELETE FROM edits", 3, 0, 0},
        {"INSERT INTO edits SELECT id + 100, edit FROM edits", 3, 3, 0},
        {"INSERT INTO edits VALUES (-5, x'00'), (0, x'00'), (9223372036854775807, x'00')", 3, 3, 0},
        {"UPDATE facts SET value = CAST('10000000' AS BLOB) WHERE key = 'num_in_force'", 3, 3, 2},
        {"DELETE FROM facts WHERE key = 'num_in_force'", 3, 3, 1},
        {"UPDATE facts SET sum = 0", 3, 3, 7},
        {"UPDATE facts SET value = zeroblob(3000000) WHERE key = 'world'", 3, 3, 2},
        {"DELETE FROM facts", 3, 3, 2},
        {"INSERT INTO facts VALUES (char(27) || '[2J', x'00', 0)", 3, 3, 1},
        {"WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < 5000) "
         "INSERT INTO facts SELECT 'a' || i, x'00', 0 FROM n",
         3, 3, SIZE_MAX},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const char *path = tampered(cases[i].sql);
        karst_saved *saved;
        assert_ok(saved = karst_saved_open(path, false, NULL, &error));
        size_t num, num_lost, num_damaged = karst_saved_get_about(saved)->num_damaged;
        karst_edit *edits;
        num_warnings = 0;
        assert_ok(edits = karst_saved_read_edits(saved, RIG_VOXEL_LOG2_M, &num, &num_lost, &warnings, &error));
        if (num != cases[i].num_good || num + num_lost != cases[i].num || (num_lost > 0) != (num_warnings > 0) ||
            (cases[i].num_damaged != SIZE_MAX ? num_damaged != cases[i].num_damaged : num_damaged == 0))
            fail_msg("%s: %zu edits, %zu lost, %zu facts", cases[i].sql, num, num_lost, num_damaged);
        size_t num_wrong = rig_count_wrong(saved);
        assert_true(num_wrong > 0 || (num_lost == 0 && num_damaged == 0));
        free(edits);
        karst_saved_close(saved);
        saved = karst_saved_open(path, true, NULL, NULL); /* and it may be written */
        if (saved) {
            karst_edit edit = rig_edit(9, 9);
            size_t before = karst_saved_num_edits(saved, NULL);
            if (karst_saved_append(saved, &edit, 1, RIG_VOXEL_LOG2_M, NULL) && karst_saved_commit(saved, NULL))
                assert_int_equal(karst_saved_num_edits(saved, NULL), before + 1);
        }
        karst_saved_close(saved);
    }
}

/* The texts of the schema are right, and the tables are others: the types of values are looked at, too. */
static void wrong_types_are_no_edits(void **state)
{
    (void)state;
    const char *path = tampered("DROP TABLE edits; CREATE TABLE edits (id INTEGER PRIMARY KEY, edit);"
                                "INSERT INTO edits VALUES (1, 'text'), (2, 5), (3, NULL);"
                                "PRAGMA writable_schema=ON; UPDATE sqlite_schema SET sql="
                                "'CREATE TABLE edits (id INTEGER PRIMARY KEY, edit BLOB NOT NULL) STRICT' "
                                "WHERE name='edits'");
    karst_saved *saved = rig_open(path, false);
    size_t num, num_lost;
    karst_edit *edits;
    assert_ok(edits = karst_saved_read_edits(saved, RIG_VOXEL_LOG2_M, &num, &num_lost, NULL, &error));
    assert_int_equal(num, 0);
    assert_int_equal(num_lost, 3);
    free(edits);
    karst_saved_close(saved);
}

/* What opening refuses, recovery reads: edits and facts, and nothing of the rest. */
static void what_is_refused_can_be_recovered(void **state)
{
    (void)state;
    const char *path = tampered("CREATE TRIGGER t AFTER INSERT ON edits BEGIN DELETE FROM edits; END; "
                                "CREATE TABLE more (a); INSERT INTO more VALUES (zeroblob(100000))");
    const char *new_path = rig_path("new.karstdb");
    assert_ok(karst_saved_recover(path, new_path, NULL, NULL, &error));
    karst_saved *saved = rig_open(new_path, true);
    tally t = {.next = 1, .in_order = true};
    assert_ok(karst_saved_visit(saved, 1, 10, RIG_VOXEL_LOG2_M, count, &t, &error));
    assert_true(t.in_order && t.num_good == 3 && t.num_lost == 0);
    assert_int_equal(rig_count_wrong(saved), 0);
    assert_string_equal(karst_saved_get_about(saved)->world, "hills");
    karst_saved_close(saved);
    unlink(new_path);
    path = tampered("DELETE FROM facts");
    assert_fails(KARST_USAGE, "--world", karst_saved_recover(path, new_path, NULL, NULL, &error));
    assert_ok(karst_saved_recover(path, new_path, "alps", NULL, &error));
    saved = rig_open(new_path, false);
    assert_string_equal(karst_saved_get_about(saved)->world, "alps");
    assert_int_equal(karst_saved_num_edits(saved, NULL), 3);
    karst_saved_close(saved);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_wrong_byte_costs_what_it_hits), cmocka_unit_test(a_lost_page_costs_its_edits),
        cmocka_unit_test(other_files_are_refused),         cmocka_unit_test(rows_that_are_none_are_named),
        cmocka_unit_test(wrong_types_are_no_edits),        cmocka_unit_test(what_is_refused_can_be_recovered),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
