/* Random programs, lowered and evaluated by the oracle, against an interpreter of the syntax tree that shares nothing
 * with it but the parser. 1,000 programs are compared, each
 * feature of the language is in 100 of them at least; KARST_TEST_FULL=1 compares 10,000, KARST_TEST_QUICK 100.
 *
 *   test_truth SEED    writes that program, and what both say of it
 *   test_truth FILE    what both say of a text, which must not need the prelude's own names */
#include "random_program.h"
#include "truth.h"
#include "world_text.h"

#include "producers/language/oracle/oracle.h"

enum { NUM_PLACES = 6, LEAST_PROGRAMS = 100 };

/* Odd 64ths, so that few decisions are ties. */
static const double places[NUM_PLACES][3] = {
    {81.0 / 64, -161.0 / 64, 239.0 / 64}, {-17.0 / 64, 31.0 / 64, -47.0 / 64},   {205.0 / 64, 113.0 / 64, -87.0 / 64},
    {-391.0 / 64, -23.0 / 64, 57.0 / 64}, {11.0 / 64, -305.0 / 64, -173.0 / 64}, {55.0 / 64, 67.0 / 64, 71.0 / 64},
};

static random_text made;
static truth interpreter;

typedef struct {
    long compared, in_doubt, given_up, programs;
    long of_feature[NUM_TRUTH_FEATURES];
} tally;

/* The program in `made`. false: they differ. */
static bool compare_program(uint64_t seed, tally *sum, bool aloud)
{
    bool good = true, any = false, ok;
    karst_error error = {0};
    if (aloud)
        printf("%s", made.text);
    karst_program_graph *p = karst_language_compile("program", made.text, made.length, NULL, 0, &ok, &error);
    if (!ok) {
        printf("# program %llu is refused: %s\n", (unsigned long long)seed, error.message);
        karst_program_graph_destroy(p);
        return false;
    }
    karst_oracle *oracle = karst_oracle_create(&p->world, NULL, 0, p->header.voxel_log2_m, &error);
    assert_non_null(oracle);
    assert_true(truth_read(&interpreter, made.text));
    text_world w = {p, oracle};
    for (int i = 0; i < NUM_PLACES; i++) {
        cell truth_value = {0};
        bool sure = truth_density(&interpreter, places[i], &truth_value);
        sum->given_up += !sure && !truth_doubt;
        if (!sure && !truth_doubt)
            printf("# program %llu: %s\n", (unsigned long long)seed, truth_reason);
        if (aloud)
            printf("# %g +- %g, %s\n", truth_value.v, truth_value.e, sure ? "sure" : truth_reason);
        if (!sure || !(truth_value.e < 1e-2 * larger(fabs(truth_value.v), 1))) {
            sum->in_doubt++;
            continue;
        }
        karst_oracle_value v = density_at(&w, places[i][0], places[i][1], places[i][2]);
        double within = truth_value.e * 2 + 1e-9;
        if (aloud)
            printf("# the oracle: %.12g, float %.9g\n", v.precise, (double)v.device);
        if (!(fabs(v.precise - truth_value.v) <= within && fabs((double)v.device - truth_value.v) <= within)) {
            printf("# program %llu at place %d: %.12g (float %.9g), not %.12g (+- %g)\n", (unsigned long long)seed, i,
                   v.precise, (double)v.device, truth_value.v, truth_value.e);
            good = false;
        }
        sum->compared++;
        any = true;
    }
    for (int k = 0; k < NUM_TRUTH_FEATURES; k++)
        sum->of_feature[k] += any && interpreter.seen[k];
    sum->programs += any;
    truth_finish(&interpreter);
    world_finish(&w);
    return good;
}

static void test_random_programs(void **state)
{
    (void)state;
    long wanted = getenv("KARST_TEST_FULL") ? 10000 : getenv("KARST_TEST_QUICK") ? 100 : 1000, num_wrong = 0, tried = 0;
    tally sum = {0};
    for (; sum.programs < wanted && tried < 2 * wanted; tried++) {
        random_program(&made, (uint64_t)tried);
        num_wrong += !compare_program((uint64_t)tried, &sum, false);
    }
    printf("# %ld of %ld programs compared, at %ld places; %ld places in doubt\n", sum.programs, tried, sum.compared,
           sum.in_doubt);
    for (int k = 0; k < NUM_TRUTH_FEATURES; k++)
        printf("# %5ld %s\n", sum.of_feature[k], truth_feature_names[k]);
    assert_int_equal(num_wrong, 0);
    assert_int_equal(sum.given_up, 0);
    assert_int_equal(sum.programs, wanted);
    for (int k = 0; k < NUM_TRUTH_FEATURES; k++)
        if (wanted >= 1000 && sum.of_feature[k] < LEAST_PROGRAMS)
            fail_msg("%s is in %ld programs only", truth_feature_names[k], sum.of_feature[k]);
}

int main(int argc, char **argv)
{
    if (argc > 1) {
        tally sum = {0};
        char *end;
        uint64_t seed = strtoull(argv[1], &end, 10);
        if (*end) {
            char *text = read_text(argv[1], &made.length);
            assert_true(made.length < sizeof made.text);
            memcpy(made.text, text, made.length);
            free(text);
        } else {
            random_program(&made, seed);
        }
        return !compare_program(seed, &sum, true);
    }
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_random_programs)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
