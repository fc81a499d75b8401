/* What is said about bad worlds, word by word. */
#include "diagnostic_texts.h"
#include "world_text.h"

static void test_words(void **s)
{
    (void)s;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        bool ok;
        karst_error error = {0};
        karst_program_graph *program =
            karst_language_compile("world.karst", cases[i].text, strlen(cases[i].text), NULL, 0, &ok, &error);
        assert_non_null(program);
        char *said = diagnostics_text(program);
        if (strcmp(said, cases[i].said))
            fail_msg("%s:\n%s\n--- instead of\n%s", cases[i].name, said, cases[i].said);
        /* The error's line is the diagnostic's first, without the word "error". */
        bool is_error = strstr(cases[i].said, " error: ") != NULL;
        assert_int_equal(ok, !is_error);
        assert_int_equal(error.status, is_error ? KARST_BAD_WORLD : KARST_OK);
        if (is_error) {
            const char *message = strstr(said, "error: ") + 7;
            size_t length = strcspn(message, "\n");
            assert_true(strlen(error.message) >= length);
            assert_int_equal(strncmp(error.message + strlen(error.message) - length, message, length), 0);
        }
        free(said);
        karst_program_graph_destroy(program);
    }
}

/* A value from outside for a parameter that is not there. */
static void test_given_parameter(void **s)
{
    (void)s;
    const char *text =
        "/*{ \"params\": { \"relief\": { \"value\": 4, \"max\": 9 } } }*/\nfloat density(vec3 p) { return relief; }\n";
    bool ok;
    karst_error error = {0};
    karst_program_graph *program =
        karst_language_compile("w", text, strlen(text), &(karst_parameter_value){"relif", 1}, 1, &ok, &error);
    assert_false(ok);
    assert_string_equal(program->diagnostics->message, "this world has no parameter 'relif'");
    assert_string_equal(program->diagnostics->hint, "did you mean 'relief'?");
    karst_program_graph_destroy(program);
    program = karst_language_compile("w", text, strlen(text), &(karst_parameter_value){"snow", 1}, 1, &ok, NULL);
    assert_false(ok);
    assert_string_equal(program->diagnostics->hint, "there are: relief");
    karst_program_graph_destroy(program);
    program = karst_language_compile("w", text, strlen(text), &(karst_parameter_value){"relief", 20}, 1, &ok, NULL);
    assert_true(ok);
    assert_true(program->parameters[0].value.value == 9); /* clamped */
    assert_string_equal(program->diagnostics->message, "parameter 'relief' is at most 9, which is used instead of 20");
    karst_program_graph_destroy(program);
    program = karst_language_compile("w", text, strlen(text), &(karst_parameter_value){"relief", 9}, 1, &ok, NULL);
    assert_true(ok);
    assert_null(program->diagnostics);
    karst_program_graph_destroy(program);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_words), cmocka_unit_test(test_given_parameter)};
    return cmocka_run_group_tests_name("diagnostics", tests, NULL, NULL);
}
