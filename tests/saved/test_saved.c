/* Saved worlds as a library: what goes in comes out, in order, with every bit; histories against a model; who may
 * write; a file of the first version; a million edits. */
#include <pwd.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>

#include "tests/saved/rig.h"

static double now_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + (double)now.tv_nsec * 1e-9;
}

static void assert_edits(karst_saved *saved, const uint64_t *variants, size_t num)
{
    size_t count, num_lost;
    karst_edit *edits;
    assert_ok(edits = karst_saved_read_edits(saved, RIG_VOXEL_LOG2_M, &count, &num_lost, NULL, &error));
    assert_int_equal(num_lost, 0);
    assert_int_equal(count, num);
    for (size_t i = 0; i < num; i++) {
        karst_edit expected = rig_edit(i + 1, variants[i]);
        assert_true(rig_is_same(&edits[i], &expected));
    }
    free(edits);
}

/* Random changes, with commits, ends without, and openings in between; beside an array. */
static void histories_are_those_of_a_model(void **state)
{
    (void)state;
    enum { MOST = 512 };
    const char *path = rig_path("history.karstdb");
    uint64_t variants[MOST], kept[MOST], seed = 3;
    size_t num = 0, made = 0, kept_num = 0, kept_made = 0;
    rig_create(path);
    karst_saved *saved = rig_open(path, true);
    for (size_t i = 0, steps = rig_number(10000, 1200, 300); i < steps; i++) {
        seed = rig_mix(seed + 1);
        size_t some = 1 + seed / 16 % 9, expected;
        switch (seed % 8) {
        case 0:
            expected = some < num ? some : num;
            assert_ok(karst_saved_undo(saved, &some, &error));
            assert_int_equal(some, expected);
            num -= expected;
            break;
        case 1:
            expected = some < made - num ? some : made - num;
            assert_ok(karst_saved_redo(saved, &some, &error));
            assert_int_equal(some, expected);
            num += expected;
            break;
        case 2:
            assert_ok(karst_saved_commit(saved, &error));
            memcpy(kept, variants, sizeof kept);
            kept_num = num;
            kept_made = made;
            break;
        case 3: /* it ends: what was not committed is gone */
            if (seed / 8 % 8)
                break;
            karst_saved_close(saved);
            saved = rig_open(path, true);
            memcpy(variants, kept, sizeof kept);
            num = kept_num;
            made = kept_made;
            break;
        case 4:
            if (seed / 8 % 16)
                break;
            assert_ok(karst_saved_compact(saved, &error));
            made = kept_made = kept_num = num;
            memcpy(kept, variants, sizeof kept);
            break;
        default:
            for (size_t k = 0; k < some && num < MOST; k++) {
                variants[num] = seed;
                karst_edit edit = rig_edit(num + 1, seed);
                assert_ok(karst_saved_append(saved, &edit, 1, RIG_VOXEL_LOG2_M, &error));
                made = ++num;
            }
        }
        size_t num_redoable;
        assert_int_equal(karst_saved_num_edits(saved, &num_redoable), num);
        assert_int_equal(num_redoable, made - num);
        if (i % 16 == 0)
            assert_edits(saved, variants, num);
    }
    assert_int_equal(rig_count_wrong(saved), 0);
    karst_saved_close(saved);
}

static void what_is_out_of_range_is_refused_whole(void **state)
{
    (void)state;
    const char *path = rig_path("range.karstdb");
    rig_create(path);
    karst_saved *saved = rig_open(path, true);
    karst_edit edits[3] = {rig_edit(1, 0), rig_edit(2, 0), {.shape = KARST_EDIT_SPHERE, .radius_m = -1}};
    assert_fails(KARST_USAGE, "edit 3: the radius", karst_saved_append(saved, edits, 3, RIG_VOXEL_LOG2_M, &error));
    assert_int_equal(karst_saved_num_edits(saved, NULL), 0);
    assert_fails(KARST_USAGE, "are the most",
                 karst_saved_append(saved, edits, KARST_MAX_EDITS + 1, RIG_VOXEL_LOG2_M, &error));
    assert_fails(KARST_USAGE, "camera", karst_saved_set_camera(saved, "here", &error));
    assert_fails(KARST_USAGE, "bookmarks", karst_saved_set_bookmark(saved, 9, "0,0,0,0,0", &error));
    karst_saved_close(saved);
    saved = rig_open(path, false);
    assert_fails(KARST_FAILED, "reading only", karst_saved_append(saved, edits, 1, RIG_VOXEL_LOG2_M, &error));
    size_t some = 1;
    assert_ok(karst_saved_undo(saved, &some, &error)); /* nothing to undo is no change */
    assert_int_equal(some, 0);
    karst_saved_close(saved);
}

static void facts_are_kept(void **state)
{
    (void)state;
    const char *path = rig_path("facts.karstdb");
    const karst_parameter parameters[] = {{"relief", 0.1}, {"bench", 1e-3}};
    const karst_saved_config config = {.world = "hills",
                                       .embed = true,
                                       .parameters = parameters,
                                       .num_parameters = 2,
                                       .has_seed = true,
                                       .seed = UINT32_MAX,
                                       .camera = "1e15,2.5,-3,45,-10,60"};
    assert_ok(karst_saved_create(path, &config, &error));
    assert_fails(KARST_FAILED, "there already", karst_saved_create(path, &config, &error));
    karst_saved *saved = rig_open(path, true);
    assert_ok(karst_saved_set_bookmark(saved, 0, "1,2,3,4,5", &error));
    assert_ok(karst_saved_set_bookmark(saved, 8, "9,2,3,4,5", &error));
    assert_ok(karst_saved_commit(saved, &error));
    assert_ok(karst_saved_set_bookmark(saved, 8, NULL, &error));
    assert_ok(karst_saved_commit(saved, &error));
    assert_ok(karst_saved_set_camera(saved, NULL, &error)); /* not committed */
    assert_null(karst_saved_get_about(saved)->camera);
    karst_saved_close(saved);
    saved = rig_open(path, false);
    const karst_saved_about *about = karst_saved_get_about(saved);
    assert_int_equal(about->version, 1); /* until it holds what that does not know */
    assert_null(about->world);
    assert_non_null(strstr(about->text, "float density"));
    assert_int_equal(about->text_bytes, strlen(about->text));
    assert_true(about->text_sum == karst_saved_sum(about->text, about->text_bytes));
    assert_int_equal(about->voxel_log2_m, RIG_VOXEL_LOG2_M);
    assert_true(about->has_seed && about->seed == UINT32_MAX);
    assert_string_equal(about->camera, "1e15,2.5,-3,45,-10,60");
    assert_string_equal(about->bookmarks[0], "1,2,3,4,5");
    for (int i = 1; i < KARST_SAVED_NUM_BOOKMARKS; i++)
        assert_null(about->bookmarks[i]);
    assert_int_equal(about->num_parameters, 2);
    for (int i = 0; i < 2; i++)
        assert_true(strcmp(about->parameters[i].name, "bench") == 0 ? about->parameters[i].value == 1e-3
                                                                    : about->parameters[i].value == 0.1);
    assert_int_equal(about->num_damaged, 0);
    karst_saved_close(saved);
}

/* Positions mean the same metres in voxels of any width; those that are asked for in the file's own are exact. */
static void other_voxels_are_the_same_metres(void **state)
{
    (void)state;
    const char *path = rig_path("voxels.karstdb");
    rig_create(path);
    karst_saved *saved = rig_open(path, true);
    karst_edit edit = {.shape = KARST_EDIT_SPHERE, .radius_m = 3, .scale_m = 1};
    assert_ok(karst_position_parse("1000000000010.5", "-0.0625", "12", RIG_VOXEL_LOG2_M, &edit.at, &error));
    assert_ok(karst_saved_append(saved, &edit, 1, RIG_VOXEL_LOG2_M, &error));
    for (int voxel_log2_m = -10; voxel_log2_m <= 3; voxel_log2_m++) {
        size_t num;
        karst_edit *edits;
        karst_position expected;
        assert_ok(edits = karst_saved_read_edits(saved, voxel_log2_m, &num, NULL, NULL, &error));
        assert_ok(karst_position_parse("1000000000010.5", "-0.0625", "12", voxel_log2_m, &expected, &error));
        assert_int_equal(num, 1);
        assert_memory_equal(&edits->at, &expected, sizeof expected.voxel + sizeof expected.fraction);
        free(edits);
    }
    karst_saved_close(saved);
}

/* Lines of the command's and objects of JSON say the same edits. */
static void edits_are_the_same_as_text(void **state)
{
    (void)state;
    const char *path = rig_path("text.json");
    enum { NUM = 500 };
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs("{ \"edits\": [", file);
    for (uint64_t n = 0; n < NUM; n++) {
        char text[2048];
        karst_edit edit = rig_edit(n, 1);
        int length = karst_edit_format(&edit, RIG_VOXEL_LOG2_M, text, sizeof text);
        assert_true(length > 0 && length < (int)sizeof text);
        fprintf(file, "%s%s", n ? ",\n" : "", text);
        assert_int_equal(karst_edit_format(&edit, RIG_VOXEL_LOG2_M, text, 10), length); /* as snprintf */
        assert_int_equal(strlen(text), 9);
    }
    fputs("] }", file);
    fclose(file);
    size_t num;
    karst_edit *edits, line;
    assert_ok(edits = karst_edits_load(path, RIG_VOXEL_LOG2_M, &num, &error));
    assert_int_equal(num, NUM);
    for (uint64_t n = 0; n < NUM; n++) {
        karst_edit edit = rig_edit(n, 1);
        assert_true(rig_is_same(&edits[n], &edit));
    }
    free(edits);
    assert_ok(karst_edit_parse("capsule,1e12,0,0,1000000000003,-4,0.5,2.5,remove,blend=0.5", RIG_VOXEL_LOG2_M, &line,
                               &error));
    assert_true(line.to_m[0] == 3 && line.to_m[1] == -4 && line.to_m[2] == 0.5 && line.radius_m == 2.5 &&
                line.mode == KARST_EDIT_REMOVE && line.blend_m == 0.5 && line.at.voxel[0] == 16000000000000);
    assert_ok(karst_edit_parse("sphere,0,0,0,2,paint,colour=0.5:0:1,strength=0.25", RIG_VOXEL_LOG2_M, &line, &error));
    assert_true(line.mode == KARST_EDIT_PAINT && line.has_colour && line.colour[0] == 0.5 && line.colour[1] == 0 &&
                line.colour[2] == 1 && line.strength == 0.25);
    assert_int_equal(karst_edit_format(&line, 41, (char[8]){0}, 8), -1);
}

/* A caller may fill in more than the shape has: all of it fits into a row. */
static void an_edit_with_every_field_fits(void **state)
{
    (void)state;
    const char *path = rig_path("every.karstdb");
    karst_edit edit = {.shape = KARST_EDIT_NOISE,
                       .radius_m = 3,
                       .half_m = {1, 2, 3},
                       .to_m = {4, 5, 6},
                       .normal = {0, 1, 0},
                       .blend_m = 0.5,
                       .amplitude_m = 1,
                       .scale_m = 2,
                       .seed = 7,
                       .has_colour = true,
                       .colour = {0.25, 0.5, 0.75},
                       .strength = 0.5};
    rig_create(path);
    karst_saved *saved = rig_open(path, true);
    assert_ok(karst_saved_append(saved, &edit, 1, RIG_VOXEL_LOG2_M, &error));
    assert_ok(karst_saved_commit(saved, &error));
    karst_saved_close(saved);
    saved = rig_open(path, false);
    assert_int_equal(rig_count_wrong(saved), 0);
    karst_saved_close(saved);
    size_t num;
    karst_edit *edits;
    assert_ok(edits = karst_saved_load_edits(path, RIG_VOXEL_LOG2_M, &num, NULL, &error));
    assert_int_equal(num, 1);
    assert_true(rig_is_same(&edits[0], &edit));
    free(edits);
}

/* ---- who may write ---- */

static int in_child(int (*function)(const char *), const char *path, bool as_nobody)
{
    int status;
    fflush(NULL);
    pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        const struct passwd *nobody = as_nobody ? getpwnam("nobody") : NULL;
        if (as_nobody && geteuid() == 0 && (!nobody || setgid(nobody->pw_gid) != 0 || setuid(nobody->pw_uid) != 0))
            _exit(77);
        _exit(function(path));
    }
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status));
    return WEXITSTATUS(status);
}

/* 0: it is open for reading, says why not for more, and what was committed is there. */
static int reads_only(const char *path)
{
    karst_error error = {0};
    const char *why = "";
    karst_saved *saved = karst_saved_open(path, true, NULL, &error);
    if (!saved) {
        fprintf(stderr, "# %s\n", error.message);
        return 1;
    }
    bool is_writable = karst_saved_is_writable(saved, &why);
    karst_edit edit = rig_edit(2, 0);
    bool appended = karst_saved_append(saved, &edit, 1, RIG_VOXEL_LOG2_M, &error);
    size_t num, num_lost;
    karst_edit *edits = karst_saved_read_edits(saved, RIG_VOXEL_LOG2_M, &num, &num_lost, NULL, NULL);
    karst_edit expected = rig_edit(1, 0);
    bool good = !is_writable && *why && !appended && strstr(error.message, why) && edits && num == 1 &&
                rig_is_same(edits, &expected);
    if (!good)
        fprintf(stderr, "# writable %d, why '%s', %zu edits, %s\n", is_writable, why, num, error.message);
    free(edits);
    karst_saved_close(saved);
    return good ? 0 : 2;
}

static int writes(const char *path)
{
    karst_saved *saved = karst_saved_open(path, true, NULL, NULL);
    karst_edit edit = rig_edit(2, 0);
    bool good = saved && karst_saved_is_writable(saved, NULL) &&
                karst_saved_append(saved, &edit, 1, RIG_VOXEL_LOG2_M, NULL) && karst_saved_commit(saved, NULL);
    karst_saved_close(saved);
    return good ? 0 : 1;
}

static void one_writes_and_others_read(void **state)
{
    (void)state;
    const char *path = rig_path("shared.karstdb"), *copy = rig_path("copy.karstdb");
    rig_create(path);
    karst_saved *saved = rig_open(path, true);
    rig_append(saved, 1, 1, 0);
    assert_ok(karst_saved_commit(saved, &error));
    assert_int_equal(in_child(reads_only, path, false), 0); /* also between two changes */
    rig_append(saved, 2, 1, 0);
    assert_int_equal(in_child(reads_only, path, false), 0);
    /* A copy of what is committed, while it is written. */
    assert_ok(karst_saved_backup(saved, copy, &error));
    karst_saved *other = rig_open(copy, false);
    assert_edits(other, (const uint64_t[]){0}, 1);
    assert_int_equal(rig_count_wrong(other), 0);
    karst_saved_close(other);
    assert_fails(KARST_FAILED, "there already", karst_saved_backup(saved, copy, &error));
    other = rig_open(path, false); /* and by one who only reads */
    unlink(copy);
    assert_ok(karst_saved_backup(other, copy, &error));
    karst_saved_close(other);
    assert_ok(karst_saved_commit(saved, &error));
    karst_saved_close(saved);
    size_t some = 1;
    saved = rig_open(path, true);
    assert_ok(karst_saved_undo(saved, &some, &error));
    assert_ok(karst_saved_commit(saved, &error));
    karst_saved_close(saved);
    assert_int_equal(in_child(writes, path, false), 0);
}

static void what_may_not_be_written_is_read(void **state)
{
    (void)state;
    const char *folder = rig_path("folder"), *path = rig_path("folder/world.karstdb");
    assert_int_equal(mkdir(folder, 0755), 0);
    assert_int_equal(chmod(rig_folder, 0755), 0);
    rig_create(path);
    karst_saved *saved = rig_open(path, true);
    rig_append(saved, 1, 1, 0);
    assert_ok(karst_saved_commit(saved, &error));
    karst_saved_close(saved);
    const int modes[][2] = {{0444, 0777}, {0666, 0555}, {0444, 0555}}; /* file, folder */
    for (size_t i = 0; i < sizeof modes / sizeof *modes; i++) {
        assert_int_equal(chmod(path, (mode_t)modes[i][0]), 0);
        assert_int_equal(chmod(folder, (mode_t)modes[i][1]), 0);
        int code = in_child(reads_only, path, true);
        if (code == 77) {
            print_message("# not tried: there is no user nobody to become\n");
            break;
        }
        if (code)
            fail_msg("file %o, folder %o: %d", (unsigned)modes[i][0], (unsigned)modes[i][1], code);
    }
    assert_int_equal(chmod(folder, 0755), 0);
}

/* ---- versions ---- */

static void the_first_version_is_read(void **state)
{
    (void)state;
    char line[2 * PATH_MAX];
    const char *copy = rig_path("golden.karstdb");
    snprintf(line, sizeof line, "cp tests/saved/golden/version1.karstdb %s && chmod u+w %s", copy, copy);
    assert_int_equal(system(line), 0);
    karst_saved *saved = rig_open(copy, true);
    const karst_saved_about *about = karst_saved_get_about(saved);
    assert_int_equal(about->version, 1);
    assert_string_equal(about->world, "hills");
    assert_true(about->has_seed && about->seed == 42);
    assert_string_equal(about->camera, "100,320,-100,30,-12,60");
    assert_string_equal(about->bookmarks[2], "1000000000000000.5,2,3,4,5,60");
    assert_int_equal(about->num_parameters, 1);
    assert_string_equal(about->parameters[0].name, "relief");
    assert_true(about->parameters[0].value == 250.125);
    size_t num_redoable;
    assert_int_equal(karst_saved_num_edits(saved, &num_redoable), 40);
    assert_int_equal(num_redoable, 2);
    assert_int_equal(rig_count_wrong(saved), 0);
    size_t some = 2;
    assert_ok(karst_saved_redo(saved, &some, &error));
    uint64_t variants[42] = {0};
    assert_edits(saved, variants, 42);
    rig_append(saved, 43, 1, 0); /* and written */
    assert_ok(karst_saved_commit(saved, &error));
    karst_saved_close(saved);
}

/* A file of version 2, which has edits that smooth; and how a file comes to be one. */
static void the_second_version_is_read(void **state)
{
    (void)state;
    char line[2 * PATH_MAX];
    const char *copy = rig_path("golden2.karstdb");
    snprintf(line, sizeof line, "cp tests/saved/golden/version2.karstdb %s && chmod u+w %s", copy, copy);
    assert_int_equal(system(line), 0);
    karst_saved *saved = rig_open(copy, true);
    assert_int_equal(karst_saved_get_about(saved)->version, 2);
    assert_int_equal(karst_saved_num_edits(saved, NULL), 40);
    assert_int_equal(rig_count_wrong(saved), 0);
    size_t some = 2, num_smooth = 0;
    assert_ok(karst_saved_redo(saved, &some, &error));
    uint64_t variants[42];
    for (uint64_t n = 0; n < 42; n++) {
        variants[n] = 2;
        num_smooth += rig_edit(n + 1, 2).mode == KARST_EDIT_SMOOTH;
    }
    assert_true(num_smooth > 2);
    assert_edits(saved, variants, 42);
    karst_saved_close(saved);
}

static void a_file_is_as_old_as_what_it_holds(void **state)
{
    (void)state;
    const char *path = rig_path("older.karstdb");
    const karst_edit smooth = {.mode = KARST_EDIT_SMOOTH, .radius_m = 3, .scale_m = 1, .strength = 0.5};
    rig_create(path);
    karst_saved *saved = rig_open(path, true);
    rig_append(saved, 1, 3, 1);
    assert_ok(karst_saved_commit(saved, &error));
    assert_int_equal(karst_saved_get_about(saved)->version, 1);
    assert_ok(karst_saved_append(saved, &smooth, 1, RIG_VOXEL_LOG2_M, &error));
    karst_saved_close(saved); /* without a commit */
    saved = rig_open(path, true);
    assert_int_equal(karst_saved_get_about(saved)->version, 1);
    assert_ok(karst_saved_append(saved, &smooth, 1, RIG_VOXEL_LOG2_M, &error) && karst_saved_commit(saved, &error));
    karst_saved_close(saved);
    saved = rig_open(path, false);
    assert_int_equal(karst_saved_get_about(saved)->version, 2);
    assert_int_equal(rig_count_wrong(saved), 0);
    karst_saved_close(saved);
}

/* `test_saved golden FILE VARIANT` made these files: of variant 0 when version 1 was the newest, of 2 for version 2. */
static int write_golden(const char *path, uint64_t variant)
{
    const karst_parameter relief = {"relief", 250.125};
    const karst_saved_config config = {.world = "hills",
                                       .has_seed = true,
                                       .seed = 42,
                                       .camera = "100,320,-100,30,-12,60",
                                       .parameters = &relief,
                                       .num_parameters = 1};
    karst_error error = {0};
    karst_saved *saved = karst_saved_create(path, &config, &error) ? karst_saved_open(path, true, NULL, &error) : NULL;
    bool good = saved && karst_saved_set_bookmark(saved, 2, "1000000000000000.5,2,3,4,5,60", &error);
    for (uint64_t n = 1; good && n <= 42; n++) {
        karst_edit edit = rig_edit(n, variant);
        good = karst_saved_append(saved, &edit, 1, RIG_VOXEL_LOG2_M, &error);
    }
    size_t some = 2;
    good = good && karst_saved_undo(saved, &some, &error) && karst_saved_commit(saved, &error);
    karst_saved_close(saved);
    if (!good)
        fprintf(stderr, "%s\n", error.message);
    return good ? 0 : 1;
}

/* ---- many ---- */

static void a_million_edits(void **state)
{
    (void)state;
    const char *path = rig_path("many.karstdb");
    const size_t num = rig_number(1000000, 1000000, 20000), batch = 1000;
    karst_edit edits[1000];
    struct stat info;
    rig_create(path);
    karst_saved *saved = rig_open(path, true);
    double start_s = now_s();
    for (size_t i = 0; i < num; i += batch) {
        for (size_t k = 0; k < batch; k++)
            edits[k] = rig_edit(i + k + 1, 0);
        assert_ok(karst_saved_append(saved, edits, batch, RIG_VOXEL_LOG2_M, &error));
    }
    assert_ok(karst_saved_commit(saved, &error));
    karst_saved_close(saved);
    double written_s = now_s();
    saved = rig_open(path, true);
    double opened_s = now_s();
    size_t count, num_lost;
    karst_edit *all;
    assert_ok(all = karst_saved_read_edits(saved, RIG_VOXEL_LOG2_M, &count, &num_lost, NULL, &error));
    double read_s = now_s();
    assert_int_equal(count, num);
    karst_edit last = rig_edit(num, 0);
    assert_true(rig_is_same(&all[num - 1], &last));
    free(all);
    size_t some = 1000;
    double before_s = now_s();
    assert_ok(karst_saved_undo(saved, &some, &error));
    assert_ok(karst_saved_commit(saved, &error));
    double undone_s = now_s();
    assert_int_equal(some, 1000);
    karst_saved_close(saved);
    assert_int_equal(stat(path, &info), 0);
    double each = (double)info.st_size / (double)num;
    printf(
        "# %zu edits: written in %.2f s, opened in %.3f s and read in %.2f s, 1000 undone in %.4f s, %.1f bytes each\n",
        num, written_s - start_s, opened_s - written_s, read_s - opened_s, undone_s - before_s, each);
    assert_true(each >= 64 && each <= 128);
    /* How long a disk takes to keep what it is given depends on what else it does: in full alone. */
    if (getenv("KARST_TEST_FULL"))
        assert_true(read_s - written_s < 5 && undone_s - before_s < 1);
}

int main(int argc, char **argv)
{
    if (argc == 4 && strcmp(argv[1], "golden") == 0)
        return write_golden(argv[2], (uint64_t)atoi(argv[3]));
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_edit_with_every_field_fits),
        cmocka_unit_test(histories_are_those_of_a_model),
        cmocka_unit_test(what_is_out_of_range_is_refused_whole),
        cmocka_unit_test(facts_are_kept),
        cmocka_unit_test(other_voxels_are_the_same_metres),
        cmocka_unit_test(edits_are_the_same_as_text),
        cmocka_unit_test(one_writes_and_others_read),
        cmocka_unit_test(what_may_not_be_written_is_read),
        cmocka_unit_test(the_first_version_is_read),
        cmocka_unit_test(the_second_version_is_read),
        cmocka_unit_test(a_file_is_as_old_as_what_it_holds),
        cmocka_unit_test(a_million_edits),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
