/* An editing process is killed at random moments: what it was told is kept is there, whole and in order, each time; and
 * at most what it was not yet told. 1,000 times with KARST_TEST_FULL=1. */
#include <signal.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <time.h>

#include "tests/saved/rig.h"

/* What the child says of itself, in memory that outlives it. A state is a length and a variant: all edits up to that
 * number are of that variant, or of those that their own commits had. */
#define MAX_EDITS 4096
typedef struct {
    volatile uint32_t num_acknowledged, num_next; /* edits in force: by the last commit, and by the one under way */
    volatile uint8_t variants[MAX_EDITS];         /* of each edit, by the last commit */
    volatile uint8_t next_variants[MAX_EDITS];
    volatile uint32_t num_commits;
} promises;

static void commit(karst_saved *saved, promises *p, uint32_t num, const uint8_t *variants)
{
    karst_error error = {0};
    for (uint32_t i = 0; i < num; i++)
        p->next_variants[i] = variants[i];
    p->num_next = num;
    if (!karst_saved_commit(saved, &error)) {
        fprintf(stderr, "# commit: %s\n", error.message);
        _exit(3);
    }
    for (uint32_t i = 0; i < num; i++)
        p->variants[i] = variants[i];
    p->num_acknowledged = num;
    p->num_commits++;
}

/* Appends, undoes, redoes, closes and opens until it is killed. */
static void edit_for_ever(const char *path, promises *p, uint64_t seed)
{
    uint8_t variants[MAX_EDITS];
    karst_error error = {0};
    karst_saved *saved = karst_saved_open(path, true, NULL, &error);
    if (!saved || !karst_saved_is_writable(saved, NULL)) {
        fprintf(stderr, "# open: %s\n", error.message);
        _exit(2);
    }
    uint32_t num = (uint32_t)karst_saved_num_edits(saved, NULL);
    for (uint32_t i = 0; i < num; i++)
        variants[i] = p->variants[i];
    for (;;) {
        seed = rig_mix(seed + 0x9e3779b97f4a7c15u);
        size_t some = 1 + seed % 5;
        if (seed % 16 == 0) {
            if (!karst_saved_undo(saved, &some, &error))
                _exit(4);
            num -= (uint32_t)some;
        } else if (seed % 64 == 1) {
            if (!karst_saved_compact(saved, &error))
                _exit(5);
        } else if (seed % 32 == 2) {
            karst_saved_close(saved);
            saved = karst_saved_open(path, true, NULL, &error);
            if (!saved)
                _exit(6);
        } else if (num + some <= MAX_EDITS) {
            for (size_t i = 0; i < some; i++, num++) {
                variants[num] = (uint8_t)(seed >> 32);
                karst_edit edit = rig_edit(num + 1, variants[num]);
                if (!karst_saved_append(saved, &edit, 1, RIG_VOXEL_LOG2_M, &error))
                    _exit(7);
            }
        } else {
            some = MAX_EDITS / 2;
            if (!karst_saved_undo(saved, &some, &error))
                _exit(8);
            num -= (uint32_t)some;
        }
        commit(saved, p, num, variants);
    }
}

static bool holds(karst_saved *saved, uint32_t num, const volatile uint8_t *variants)
{
    size_t count, num_lost;
    karst_edit *edits;
    assert_ok(edits = karst_saved_read_edits(saved, RIG_VOXEL_LOG2_M, &count, &num_lost, NULL, &error));
    bool same = num_lost == 0 && count == num;
    for (uint32_t i = 0; same && i < num; i++) {
        karst_edit expected = rig_edit(i + 1, variants[i]);
        same = rig_is_same(&edits[i], &expected);
    }
    free(edits);
    return same;
}

static void nothing_acknowledged_is_lost(void **state)
{
    (void)state;
    const char *path = rig_path("killed.karstdb");
    promises *p = mmap(NULL, sizeof *p, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    size_t num_kills = rig_number(1000, 40, 10), num_next = 0;
    uint64_t seed = 1;
    assert_ptr_not_equal(p, MAP_FAILED);
    rig_create(path);
    for (size_t i = 0; i < num_kills; i++) {
        seed = rig_mix(seed + i);
        uint32_t commits_before = p->num_commits;
        fflush(NULL);
        pid_t child = fork();
        assert_true(child >= 0);
        if (child == 0)
            edit_for_ever(path, p, seed);
        /* At any moment, but mostly once it works. */
        const struct timespec wait = {.tv_nsec = (long)(seed % 25000000)};
        int status = 0;
        pid_t ended = 0;
        if (i % 8)
            while (p->num_commits == commits_before && (ended = waitpid(child, &status, WNOHANG)) == 0)
                nanosleep(&(const struct timespec){.tv_nsec = 100000}, NULL);
        nanosleep(&wait, NULL);
        if (!ended) {
            kill(child, SIGKILL);
            assert_int_equal(waitpid(child, &status, 0), child);
        }
        if (!WIFSIGNALED(status))
            fail_msg("the process ended by itself: %d", WEXITSTATUS(status));

        karst_saved *saved = rig_open(path, false);
        assert_int_equal(rig_count_wrong(saved), 0);
        bool by_last = holds(saved, p->num_acknowledged, p->variants);
        if (!by_last && !holds(saved, p->num_next, p->next_variants))
            fail_msg("kill %zu: %zu edits, neither the %u that were acknowledged nor the %u under way", i,
                     karst_saved_num_edits(saved, NULL), p->num_acknowledged, p->num_next);
        if (!by_last) { /* it was kept, and nobody was left to be told */
            num_next++;
            p->num_acknowledged = p->num_next;
            for (uint32_t k = 0; k < p->num_next; k++)
                p->variants[k] = p->next_variants[k];
        }
        karst_saved_close(saved);
    }
    printf("# %zu kills, %u commits, %zu times one was kept that was not told\n", num_kills, p->num_commits, num_next);
    assert_true(p->num_commits > num_kills);
    munmap(p, sizeof *p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(nothing_acknowledged_is_lost)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
