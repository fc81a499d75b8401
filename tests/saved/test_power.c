/* Loss of power, a full disk and a disk that fails, on one in memory (tests/support/disk.h): all that was acknowledged
 * is there, and of what was not, all of a commit or nothing. 2,000 losses with KARST_TEST_FULL=1. */
#include "tests/saved/rig.h"
#include "tests/support/disk.h"

#define NAME "disk.karstdb"
#define MAX_EDITS 2048

/* What the file must hold: by the last commit that was acknowledged, or by the one that was under way. */
typedef struct {
    size_t num;
    uint8_t variants[MAX_EDITS];
} log_state;
static log_state kept, next;

static void put_new_file(void)
{
    static uint8_t bytes[1 << 16];
    const char *path = rig_path(NAME);
    unlink(path);
    rig_create(path);
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    size_t size_bytes = fread(bytes, 1, sizeof bytes, file);
    fclose(file);
    disk_begin();
    disk_put(NAME, bytes, size_bytes);
    kept.num = next.num = 0;
}

static bool holds(karst_saved *saved, const log_state *state)
{
    size_t count, num_lost;
    karst_edit *edits;
    assert_ok(edits = karst_saved_read_edits(saved, RIG_VOXEL_LOG2_M, &count, &num_lost, NULL, &error));
    bool same = num_lost == 0 && count == state->num;
    for (size_t i = 0; same && i < count; i++) {
        karst_edit expected = rig_edit(i + 1, state->variants[i]);
        same = rig_is_same(&edits[i], &expected);
    }
    free(edits);
    return same;
}

/* One change and its commit; false if the disk fails. `next` is what it would come to, `kept` what was acknowledged. */
static bool change(karst_saved **saved, uint64_t seed)
{
    size_t some = 1 + seed % 7;
    bool done = true;
    next = kept;
    if (seed % 16 == 0) {
        next.num -= some < kept.num ? some : kept.num;
        done = karst_saved_undo(*saved, &some, NULL);
    } else if (seed % 64 == 1) {
        done = karst_saved_compact(*saved, NULL);
    } else if (seed % 16 == 2) {
        karst_saved_close(*saved);
        *saved = karst_saved_open(NAME, true, NULL, NULL);
        done = *saved && karst_saved_is_writable(*saved, NULL);
    } else if (seed % 32 == 3) {
        done = karst_saved_set_camera(*saved, "0,1,2,3,4", NULL);
    } else if (kept.num + some > MAX_EDITS) {
        some = MAX_EDITS / 2;
        next.num -= some;
        done = karst_saved_undo(*saved, &some, NULL);
    } else {
        for (size_t i = 0; done && i < some; i++) {
            next.variants[next.num] = (uint8_t)(seed >> 40);
            karst_edit edit = rig_edit(next.num + 1, next.variants[next.num]);
            next.num++;
            done = karst_saved_append(*saved, &edit, 1, RIG_VOXEL_LOG2_M, NULL);
        }
    }
    done = done && karst_saved_commit(*saved, NULL);
    if (done)
        kept = next;
    return done;
}

/* The file is whole, and holds one of the two. */
static void check(const char *when, size_t number)
{
    karst_saved *saved;
    assert_ok(saved = karst_saved_open(NAME, false, NULL, &error));
    size_t num_wrong = rig_count_wrong(saved);
    bool good = holds(saved, &kept) || holds(saved, &next);
    if (num_wrong || !good)
        fail_msg("%s %zu: %zu things are wrong; %zu edits, %zu were acknowledged, %zu would have been", when, number,
                 num_wrong, karst_saved_num_edits(saved, NULL), kept.num, next.num);
    if (!holds(saved, &kept))
        kept = next;
    karst_saved_close(saved);
}

static void power_may_go_at_any_moment(void **state)
{
    (void)state;
    size_t num_cuts = rig_number(2000, 200, 40), num_changes = 0;
    uint64_t seed = 1;
    put_new_file();
    for (size_t i = 0; i < num_cuts; i++) {
        karst_saved *saved;
        seed = rig_mix(seed + i);
        disk_cut_after(1 + (seed >> 8) % (seed % 4 ? 60 : 3000));
        saved = karst_saved_open(NAME, true, NULL, NULL);
        next = kept;
        while (saved && change(&saved, seed = rig_mix(seed + 1)))
            num_changes++;
        karst_saved_close(saved);
        disk_restart(seed);
        check("loss of power", i);
    }
    printf("# %zu losses of power, %zu commits before them\n", num_cuts, num_changes);
    assert_true(num_changes > num_cuts);
    disk_end();
}

static void a_full_disk_loses_nothing(void **state)
{
    (void)state;
    size_t num_full = 0;
    uint64_t seed = 7;
    put_new_file();
    for (size_t i = 0; i < rig_number(400, 100, 20); i++) {
        karst_error full_error = {0};
        karst_saved *saved;
        assert_ok(saved = karst_saved_open(NAME, true, NULL, &error));
        disk_set_room((seed = rig_mix(seed + i)) % 60000);
        bool full = false;
        for (int k = 0; k < 200 && !full; k++) {
            karst_edit edit = rig_edit(kept.num + 1, 5);
            full = !karst_saved_append(saved, &edit, 1, RIG_VOXEL_LOG2_M, &full_error) ||
                   !karst_saved_commit(saved, &full_error);
            if (!full)
                kept.variants[kept.num++] = 5;
        }
        if (full) {
            num_full++;
            assert_int_equal(full_error.status, KARST_FAILED);
            assert_non_null(strstr(full_error.message, "the disk is full"));
        }
        next = kept;
        assert_true(holds(saved, &kept)); /* what is open goes on being so */
        disk_set_room(UINT64_MAX);
        if (full) { /* and can be written again when there is room */
            karst_edit edit = rig_edit(kept.num + 1, 6);
            assert_ok(karst_saved_append(saved, &edit, 1, RIG_VOXEL_LOG2_M, &error));
            assert_ok(karst_saved_commit(saved, &error));
            kept.variants[kept.num++] = 6;
        }
        if (kept.num > MAX_EDITS - 300) {
            size_t some = kept.num;
            assert_ok(karst_saved_undo(saved, &some, &error));
            assert_ok(karst_saved_commit(saved, &error));
            kept.num = 0;
        }
        next = kept;
        karst_saved_close(saved);
        check("full disk", i);
    }
    printf("# full %zu times\n", num_full);
    assert_true(num_full > 0);
    disk_end();
}

static void each_operation_may_fail_once(void **state)
{
    (void)state;
    size_t num_failed = 0;
    put_new_file();
    for (size_t n = 1; n <= rig_number(600, 150, 40); n++) {
        karst_saved *saved = NULL;
        uint64_t before = disk_num_operations();
        disk_fail_once(n);
        saved = karst_saved_open(NAME, true, NULL, NULL);
        bool failed = !saved || !karst_saved_is_writable(saved, NULL);
        next = kept;
        for (uint64_t k = 0; k < 20 && !failed; k++)
            failed = !change(&saved, rig_mix(n * 64 + k));
        num_failed += failed;
        if (saved && karst_saved_is_writable(saved, NULL)) { /* as it was, and it goes on */
            bool good = holds(saved, &kept) || holds(saved, &next);
            assert_true(good);
        }
        karst_saved_close(saved);
        disk_fail_once(0);
        assert_true(disk_num_operations() > before);
        check("failing operation", n);
        if (kept.num > MAX_EDITS - 200) {
            size_t some = MAX_EDITS;
            saved = rig_open(NAME, true);
            assert_ok(karst_saved_undo(saved, &some, &error));
            assert_ok(karst_saved_commit(saved, &error));
            kept.num = 0;
            karst_saved_close(saved);
        }
    }
    printf("# %zu operations failed\n", num_failed);
    assert_true(num_failed > 20);
    disk_end();
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(power_may_go_at_any_moment),
                                       cmocka_unit_test(a_full_disk_loses_nothing),
                                       cmocka_unit_test(each_operation_may_fail_once)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
