/* The viewer's journal: "saved" is said only of what is on the disk, failures lose nothing, and so does an end. */
#include <fcntl.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>

#define RIG_IN_MEMORY true
#include "tests/saved/rig.h"

#include "demos/view/journal.c"

static view_journal *open_journal(const char *path, size_t num_in_force)
{
    view_journal *j;
    assert_ok(j = view_journal_open(path, num_in_force, RIG_VOXEL_LOG2_M, &error));
    return j;
}

/* What others see. */
static size_t count_in_file(const char *path, size_t *num_redoable)
{
    karst_saved *saved = rig_open(path, false);
    size_t num = karst_saved_num_edits(saved, num_redoable);
    karst_saved_close(saved);
    return num;
}

static void it_says_saved_of_what_is_saved(void **state)
{
    (void)state;
    const char *path = rig_path("steps.karstdb");
    enum { MOST = 600 };
    uint64_t model[MOST]; /* variants of the edits that were made, undone ones included */
    size_t num = 0, num_made = 0, num_asked = 0, num_saved = 0, redoable;
    rig_create(path);
    view_journal *j = open_journal(path, 0);
    assert_true(view_journal_look(j).is_saved);
    for (uint64_t step = 0; step < 1000; step++) {
        const uint64_t bits = rig_mix(step);
        if (bits % 8 < 4 && num < MOST) {
            const karst_edit edit = rig_edit(num + 1, step);
            model[num++] = step;
            num_made = num;
            view_journal_append(j, &edit, 1);
            num_asked++;
        } else if (bits % 8 == 4 && num) {
            const size_t some = 1 + bits / 8 % num % 5;
            num -= some < num ? some : num;
            view_journal_undo(j, some);
            num_asked++;
        } else if (bits % 8 == 5 && num < num_made) {
            num++;
            view_journal_redo(j, 1);
            num_asked++;
        } else if (bits % 8 == 6) {
            const size_t before = count_in_file(path, NULL);
            view_journal_state now = view_journal_look(j);
            assert_true(now.is_saved == (num_asked == 0) && now.num_waiting == num_asked);
            if (num_asked) /* nobody sees it before it is said to be saved */
                assert_int_equal(before, num_saved);
            assert_true(view_journal_turn(j));
            num_asked = 0;
            num_saved = num;
            now = view_journal_look(j);
            assert_true(now.is_saved && now.num_waiting == 0 && !*now.why);
            assert_int_equal(count_in_file(path, &redoable), num);
            assert_int_equal(redoable, num_made - num);
        }
    }
    view_journal_close(j); /* a last turn */
    karst_saved *saved = rig_open(path, false);
    size_t count, num_lost;
    karst_edit *all;
    assert_ok(all = karst_saved_read_edits(saved, RIG_VOXEL_LOG2_M, &count, &num_lost, NULL, &error));
    assert_true(count == num && num > 50 && num_lost == 0);
    for (size_t i = 0; i < num; i++) {
        const karst_edit expected = rig_edit(i + 1, model[i]);
        assert_true(rig_is_same(&all[i], &expected));
    }
    free(all);
    karst_saved_close(saved);
}

static void a_full_disk_loses_nothing(void **state)
{
    (void)state;
    const char *path = rig_path("full.karstdb");
    struct rlimit before, tight = {16384, 16384};
    rig_create(path);
    view_journal *j = open_journal(path, 0);
    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    tight.rlim_max = before.rlim_max;
    for (uint64_t n = 1; n <= 500; n++) {
        const karst_edit edit = rig_edit(n, 1);
        view_journal_append(j, &edit, 1);
    }
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &tight), 0);
    const bool worked = view_journal_turn(j);
    view_journal_state now = view_journal_look(j);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &before), 0);
    assert_false(worked);
    assert_true(!now.is_saved && now.num_waiting == 500 && *now.why);
    print_message("# it says: %s\n", now.why);
    assert_int_equal(count_in_file(path, NULL), 0);
    /* What comes meanwhile follows. */
    view_journal_undo(j, 100);
    assert_true(view_journal_turn(j));
    now = view_journal_look(j);
    assert_true(now.is_saved && !*now.why);
    assert_int_equal(count_in_file(path, NULL), 400);
    view_journal_close(j);
}

static void it_opens_what_it_may_write_and_knows(void **state)
{
    (void)state;
    const char *path = rig_path("open.karstdb");
    size_t num, some = 3;
    rig_create(path);
    karst_saved *saved = rig_open(path, true);
    rig_append(saved, 1, 10, 1);
    assert_ok(karst_saved_undo(saved, &some, &error) && karst_saved_commit(saved, &error));
    assert_fails(KARST_FAILED, "another process writes it", view_journal_open(path, 7, RIG_VOXEL_LOG2_M, &error));
    karst_saved_close(saved);
    assert_fails(KARST_FAILED, "added meanwhile", view_journal_open(path, 6, RIG_VOXEL_LOG2_M, &error));
    assert_fails(KARST_FAILED, "undone meanwhile", view_journal_open(path, 8, RIG_VOXEL_LOG2_M, &error));
    assert_fails(KARST_BAD_DATA, "", view_journal_open(rig_path("none.karstdb"), 0, RIG_VOXEL_LOG2_M, &error));
    view_journal *j = open_journal(path, 7);
    const karst_edit *redoable = view_journal_redoable(j, &num), first = rig_edit(8, 1);
    assert_int_equal(num, 3);
    assert_true(rig_is_same(&redoable[0], &first));
    view_journal_redo(j, 1);
    view_journal_close(j);
    assert_int_equal(count_in_file(path, NULL), 8);
}

/* Lays edits one after another, and tells how many are said to be saved, until it is killed. */
static void lay_until_killed(const char *path, int to)
{
    view_journal *j = view_journal_open(path, 0, RIG_VOXEL_LOG2_M, NULL);
    if (!j || !view_journal_start(j, NULL))
        _exit(1);
    for (uint32_t n = 0;;) {
        for (int k = 0; k < 3; k++) {
            const karst_edit edit = rig_edit(++n, 1);
            view_journal_append(j, &edit, 1);
        }
        for (int look = 0; look < 1000 && !view_journal_look(j).is_saved; look++)
            usleep(2000);
        if (view_journal_look(j).is_saved && write(to, &n, sizeof n) != sizeof n)
            _exit(1);
    }
}

static void an_end_loses_nothing_that_was_saved(void **state)
{
    (void)state;
    const size_t num_kills = rig_number(200, 8, 3);
    for (size_t kill_number = 0; kill_number < num_kills; kill_number++) {
        const char *path = rig_path("kill.karstdb");
        int ends[2];
        uint32_t told = 0, last = 0;
        unlink(path);
        rig_create(path);
        assert_int_equal(pipe(ends), 0);
        const pid_t child = fork();
        assert_true(child >= 0);
        if (child == 0)
            lay_until_killed(path, ends[1]);
        close(ends[1]);
        assert_int_equal(read(ends[0], &last, sizeof last), sizeof last); /* it is at work */
        usleep((useconds_t)(rig_mix(kill_number) % 200000));
        kill(child, SIGKILL);
        waitpid(child, NULL, 0);
        while (read(ends[0], &told, sizeof told) == (ssize_t)sizeof told)
            last = told;
        close(ends[0]);
        karst_saved *saved = rig_open(path, true);
        assert_true(karst_saved_num_edits(saved, NULL) >= last);
        assert_int_equal(rig_count_wrong(saved), 0);
        karst_saved_close(saved);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(it_says_saved_of_what_is_saved),
        cmocka_unit_test(a_full_disk_loses_nothing),
        cmocka_unit_test(it_opens_what_it_may_write_and_knows),
        cmocka_unit_test(an_end_loses_nothing_that_was_saved),
    };
    return cmocka_run_group_tests_name("journal", tests, NULL, NULL);
}
