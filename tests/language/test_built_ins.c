/* No function of the language is left out: each is in built_ins.h, whose expressions the tests of slopes
 * (test_derive), bounds (test_bounds) and generated code (test_emit) go through, and in the manual's table. The names
 * are the language's own: the compiler's tables, and what the prelude defines. Here the tape gives the oracle's bits.
 */
#include "tests/language/world_text.h"

#include <ctype.h>

#include "producers/language/front/lower_internal.h"
#include "producers/language/tape/tape.clh"
#include "producers/language/tape/tape.h"
#include "tests/language/built_ins.h"

enum { MAX_NAMES = 256, NAME_BYTES = 32 };

typedef struct {
    char name[MAX_NAMES][NAME_BYTES];
    int count;
} name_list;

static void add_name(name_list *list, const char *name, size_t length)
{
    assert_true(length < NAME_BYTES && list->count < MAX_NAMES);
    for (int i = 0; i < list->count; i++)
        if (strlen(list->name[i]) == length && !memcmp(list->name[i], name, length))
            return;
    memcpy(list->name[list->count], name, length);
    list->name[list->count++][length] = 0;
}

static bool is_word(char c) { return isalnum((unsigned char)c) || c == '_'; }

static bool is_type(const char *word, size_t length)
{
    static const char *const types[] = {"float", "int",  "uint", "bool", "vec2", "vec3",
                                        "vec4",  "mat2", "mat3", "mat4", "T"};
    for (size_t i = 0; i < sizeof types / sizeof *types; i++)
        if (strlen(types[i]) == length && !memcmp(types[i], word, length))
            return true;
    return false;
}

/* What follows a type and precedes a parenthesis is defined there. Macros define "f", or what EACH1(name) says, which
 * has been defined for floats before. */
static void add_prelude(name_list *list)
{
    size_t length;
    char *text = read_text("producers/language/front/prelude.karst", &length);
    const char *before = "";
    size_t before_length = 0;
    for (const char *at = text; *at;) {
        if (at[0] == '/' && at[1] == '/') {
            at += strcspn(at, "\n");
            continue;
        }
        if (!is_word(*at)) {
            before_length = *at == ' ' ? before_length : 0;
            at++;
            continue;
        }
        const char *word = at;
        while (is_word(*at))
            at++;
        if (*at == '(' && is_type(before, before_length) && at - word > 1)
            add_name(list, word, (size_t)(at - word));
        before = word;
        before_length = (size_t)(at - word);
    }
    free(text);
}

static void list_names(name_list *list)
{
    const char *name;
    for (size_t i = 0; (name = karst_builtin_name(i)) != NULL; i++) {
        assert_true(karst_is_builtin(name));
        add_name(list, name, strlen(name));
    }
    int of_the_compiler = list->count;
    add_prelude(list);
    assert_true(of_the_compiler > 40 && list->count > of_the_compiler + 50);
}

/* The name as a word of its own; with `call`, right before a parenthesis. */
static bool mentions(const char *text, const char *name, bool call)
{
    size_t length = strlen(name);
    for (const char *at = text; (at = strstr(at, name)) != NULL; at++)
        if ((at == text || !is_word(at[-1])) && !is_word(at[length]) && (!call || at[length] == '('))
            return true;
    return false;
}

static void test_no_function_is_left_out(void **state)
{
    (void)state;
    static name_list list;
    size_t length;
    int num_missing = 0;
    list_names(&list);
    char *manual = read_text("docs/WORLDS.md", &length);
    char *table = strstr(manual, "\n## Functions\n");
    assert_non_null(table);
    char *end = strstr(table + 4, "\n## ");
    if (end)
        *end = 0;
    for (int n = 0; n < list.count; n++) {
        bool found = false;
        for (size_t i = 0; i < NUM_BUILT_INS && !found; i++)
            found = mentions(built_ins[i], list.name[n], true);
        if (!found) {
            print_message("%s is in no expression of built_ins.h\n", list.name[n]);
            num_missing++;
        }
        if (!mentions(table, list.name[n], false)) {
            print_message("%s is not in the table of docs/WORLDS.md\n", list.name[n]);
            num_missing++;
        }
    }
    free(manual);
    print_message("%d functions\n", list.count);
    assert_int_equal(num_missing, 0);
}

/* ---- bits ---- */

static bool same_float(float a, float b) { return k_as_uint(a) == k_as_uint(b) || (isnan(a) && isnan(b)); }

/* Returns at how many places it is neither 0 nor NaN. */
static int check_tape(const char *expression)
{
    static const int64_t far[] = {0, 0, 1000000000, 1000000000000000};
    char body[512];
    karst_error error = {0};
    snprintf(body, sizeof body, "return %s;", expression);
    text_world w = world_from_body(body);
    karst_world_layout layout;
    karst_tape tape;
    int num_lively = 0;
    assert_true(karst_world_layout_init(&layout, &w.program->world));
    assert_true(karst_tape_build(&layout, &w.program->world.root[KARST_ROOT_DENSITY], 1, &tape, &error));
    karst_number values[KARST_HEADER_MAX_PARAMETERS + 16];
    for (uint32_t i = 0; i < w.program->num_parameters; i++)
        values[i] = w.program->parameters[i].value;
    uint64_t *data = calloc(layout.num_words, sizeof *data);
    int *slots = calloc((size_t)tape.num_slots * TAPE_VALUE_ELEMENTS, sizeof *slots);
    assert_true(karst_world_data_fill(&layout, values, w.program->header.seed, w.program->header.voxel_log2_m, data));
    tape_program program = {.code = tape.code,
                            .num_instructions = tape.num_instructions,
                            .constants = tape.constants,
                            .data = data,
                            .values = (const uint *)(data + layout.values_word),
                            .num_values = layout.num_values,
                            .slots = slots};
    uint32_t random = 1;
    for (int n = 0; n < 64; n++) {
        karst_position at;
        affine_position place;
        int level = n % 7 - 1;
        for (int axis = 0; axis < 3; axis++) {
            random = random * 1664525u + 1013904223u;
            at.voxel[axis] = far[n % 4] + (int64_t)(random >> 24) - 128;
            at.fraction[axis] = n % 3 ? random << 8 : 0;
            place.voxel[axis] = at.voxel[axis];
            place.fraction[axis] = at.fraction[axis];
        }
        tape_values(&program, &place, NULL, level);
        float got = k_as_float((uint)tape_load(&program, tape.output[0]));
        float expected = karst_oracle_density(w.oracle, &at, level).device;
        if (!same_float(got, expected))
            fail_msg("%s: the tape gives %a, the oracle %a", expression, (double)got, (double)expected);
        num_lively += got < 0 || got > 0;
    }
    free(slots);
    free(data);
    karst_tape_finish(&tape);
    world_finish(&w);
    return num_lively;
}

static void test_tapes_have_the_oracles_bits(void **state)
{
    (void)state;
    for (size_t i = 0; i < NUM_BUILT_INS; i++)
        if (check_tape(built_ins[i]) < 24)
            fail_msg("%s is 0 or nothing nearly everywhere", built_ins[i]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_no_function_is_left_out),
        cmocka_unit_test(test_tapes_have_the_oracles_bits),
    };
    return cmocka_run_group_tests_name("built-ins", tests, NULL, NULL);
}
