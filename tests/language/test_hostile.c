/* Hostile texts: each gives a diagnostic with a place, or a valid world with its program, soon and in bounded memory.
 *
 *   test_hostile write FOLDER   writes those that are quick as files instead, for the fuzzer */
#include "world_text.h"
#include "tests/language/hostile_build.h"

#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "producers/language/check.h"
#include "producers/density/world_file.h"

/* CPU time of one text: 2 s is what is promised, and machines differ by two. */
enum { MOST_MS = 4000, MOST_MIB = 500 };

static double milliseconds(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t); /* others may have the machine */
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

/* Compiles; checks what holds for every text. */
static karst_program_graph *survive(const char *name, const char *text, size_t length, bool *ok)
{
    karst_error error = {0};
    const char *fault = NULL;
    double start = milliseconds();
    karst_program_graph *program = karst_language_compile("hostile", text, length, NULL, 0, ok, &error);
    double took = milliseconds() - start;
    assert_non_null(program);
    if (took > MOST_MS && !getenv("KARST_TEST_QUICK"))
        fail_msg("%s took %.0f ms", name, took);
    if (*ok) {
        if (!karst_graph_check(&program->graph, &fault) || !karst_graph_check(&program->resolved, &fault))
            fail_msg("%s: %s", name, fault);
        return program;
    }
    assert_int_equal(error.status, KARST_BAD_WORLD);
    const karst_diagnostic *last = program->diagnostics;
    assert_non_null(last);
    while (last->next)
        last = last->next;
    assert_true(last->is_error && last->line >= 1 && last->column >= 1);
    assert_true(strlen(last->text) < 2000);
    return program;
}

static const karst_diagnostic *last_of(const karst_program_graph *program)
{
    const karst_diagnostic *d = program->diagnostics;
    while (d && d->next)
        d = d->next;
    return d;
}

typedef struct {
    bool compiled, sound;
    karst_error error;
} outcome;

static void hear(void *user, const char *line) { *(size_t *)user += strlen(line); }

/* Compiles all there is to compile of a world, and reports on it as karst check does, in a process of its own: what it
 * cost is in `usage`. false: it died. */
static bool compile_apart(const built *b, outcome *shared, struct rusage *usage)
{
    memset(shared, 0, sizeof *shared);
    fflush(NULL);
    pid_t child = fork();
    if (child == 0) {
        const char *fault;
        karst_world_file *file = karst_world_file_compile("hostile", b->text, b->length, NULL, 0, NULL, &shared->error);
        shared->compiled = file != NULL;
        shared->sound = !file || (karst_graph_check(&file->program->graph, &fault) &&
                                  karst_graph_check(&file->program->resolved, &fault));
        size_t heard = 0;
        if (file && (!karst_language_check(file->program, hear, &heard, &shared->error) || !heard))
            shared->sound = false;
        karst_world_file_destroy(file);
        _exit(0);
    }
    int status = -1;
    return child > 0 && wait4(child, &status, 0, usage) == child && WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

static bool has_place(const char *message)
{
    unsigned line = 0, column = 0;
    return sscanf(message, "hostile:%u:%u: ", &line, &column) == 2 && line >= 1 && column >= 1;
}

static void test_texts(void **s)
{
    (void)s;
    built b = {.text = malloc(HOSTILE_MAX_BYTES)};
    outcome *shared = mmap(NULL, sizeof *shared, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    assert_true(b.text && shared != MAP_FAILED);
    double most_ms = 0;
    long most_kib = 0;
    for (size_t i = 0; i < NUM_HOSTILE_TEXTS; i++) {
        const hostile_text *t = &hostile_texts[i];
        struct rusage usage;
        build(&b, t);
        double ms = INFINITY;
        /* What others do with the other half of a core counts as well: a text is too slow if it always is. */
        for (int attempt = 0; attempt < 3 && ms > MOST_MS; attempt++) {
            if (!compile_apart(&b, shared, &usage))
                fail_msg("%s: the compiler died", t->name);
            ms = fmin(ms, (double)(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) * 1e3 +
                              (double)(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec) * 1e-3);
            if (getenv("KARST_TEST_QUICK"))
                break;
        }
        if (!shared->sound)
            fail_msg("%s: an unsound graph", t->name);
        if (shared->compiled == (t->said != NULL))
            fail_msg("%s: %s", t->name, shared->compiled ? "compiled" : shared->error.message);
        if (t->said && (shared->error.status != KARST_BAD_WORLD || !has_place(shared->error.message) ||
                        !strstr(shared->error.message, t->said)))
            fail_msg("%s: %s", t->name, shared->error.message);
        if (getenv("KARST_VERBOSE") && ms > MOST_MS / 8)
            print_message("%s: %.0f ms, %ld MiB\n", t->name, ms, usage.ru_maxrss / 1024);
        most_ms = fmax(ms, most_ms);
        most_kib = usage.ru_maxrss > most_kib ? usage.ru_maxrss : most_kib;
        if (!getenv("KARST_TEST_QUICK") && (ms > MOST_MS || usage.ru_maxrss / 1024 > MOST_MIB))
            fail_msg("%s took %.0f ms and %ld MiB", t->name, ms, usage.ru_maxrss / 1024);
    }
    print_message("%zu texts: at most %.0f ms and %ld MiB\n", NUM_HOSTILE_TEXTS, most_ms, most_kib / 1024);
    munmap(shared, sizeof *shared);
    free(b.text);
}

static void test_bytes(void **s)
{
    (void)s;
    static const struct {
        const char *text, *said;
        size_t length;
    } bad[] = {
#define BYTES(t, m) {t, m, sizeof(t) - 1}
        BYTES("float density(vec3 p) { return \0-p.y; }", "NUL byte"),
        BYTES("// h\xf6he\n" DENSITY, "not UTF-8 here (byte 0xf6)"),
        BYTES("// \xc0\xaf\n" DENSITY, "not UTF-8"),
        BYTES("// \xed\xa0\x80\n" DENSITY, "not UTF-8"),
        BYTES(DENSITY "// \xe2\x82", "not UTF-8"),
        BYTES("// \xf4\x90\x80\x80\n" DENSITY, "not UTF-8"),
        BYTES("", "the file is empty"),
        BYTES("\xef\xbb\xbf" DENSITY, NULL),
        BYTES("// \xe2\x82\xac h\xc3\xb6he\r\n" DENSITY, NULL)};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        bool ok;
        karst_program_graph *program = survive("bytes", bad[i].text, bad[i].length, &ok);
        assert_int_equal(ok, !bad[i].said);
        if (!ok)
            assert_non_null(strstr(last_of(program)->message, bad[i].said));
        karst_program_graph_destroy(program);
    }
}

/* What terminals obey, and what turns writing around, comes out of nothing that is shown. */
static void test_nothing_that_terminals_obey(void **s)
{
    (void)s;
    static const char header[] =
        "/*{ \"name\": \"a\\u001b[2J\\u009b\\u202e\\u2066z\", \"author\": \"\xe2\x80\xae\","
        " \"description\": \"one\\ntwo\\t\xe2\x82\xac\", \"\\u009b1m\": 1,"
        " \"params\": { \"k\": { \"value\": 1, \"label\": \"\\u0007\", \"unit\": \"\\u0085\" } } }*/\n"
        "float density(vec3 p) { return k; }\n";
    static const char line[] = "float density(vec3 p) { return q; } // \x1b[2J \xc2\x9b \xe2\x80\xae "
                               "\xe2\x81\xa9 \x7f \xe2\x82\xac\n";
    bool ok;
    karst_program_graph *program = survive("a header for terminals", header, sizeof header - 1, &ok);
    assert_true(ok);
    assert_string_equal(program->header.name, "a?[2J???z");
    assert_string_equal(program->header.author, "?");
    assert_string_equal(program->header.description, "one two \xe2\x82\xac");
    assert_string_equal(program->parameters[0].label, "?");
    assert_string_equal(program->parameters[0].unit, "?");
    assert_non_null(strstr(program->diagnostics->message, "?1m")); /* an unknown key */
    karst_program_graph_destroy(program);
    program = survive("a line for terminals", line, sizeof line - 1, &ok);
    assert_false(ok);
    assert_non_null(strstr(last_of(program)->text, "; } // ?[2J ? ? ? ? \xe2\x82\xac\n"));
    karst_program_graph_destroy(program);
}

/* Every beginning of a world, and every world with a byte changed: no crash, whatever it gives. */
static void test_mangled(void **s)
{
    (void)s;
    size_t length;
    char *text = read_text("tests/language/pasted/09_structs.karst", &length);
    int step = getenv("KARST_TEST_QUICK") ? 13 : 1;
    for (size_t i = 0; i < length; i += (size_t)step) {
        bool ok;
        karst_program_graph_destroy(survive("beginning", text, i, &ok));
        char kept = text[i];
        text[i] = "(){};,=.+x0\"#"[i % 13];
        karst_program_graph_destroy(survive("changed", text, length, &ok));
        text[i] = kept;
    }
    free(text);
}

static void test_files(void **s)
{
    (void)s;
    static const char *const paths[] = {"tests/language", "tests/language/no_such_file.karst", "/dev/zero"};
    for (size_t i = 0; i < sizeof paths / sizeof *paths; i++) {
        bool ok = true;
        karst_error error = {0};
        assert_null(karst_language_compile_file(paths[i], NULL, 0, &ok, &error));
        assert_false(ok);
        assert_int_equal(error.status, KARST_BAD_WORLD);
        assert_non_null(strstr(error.message, paths[i]));
    }
}

/* Texts that only show that a cap bites take a fuzzer's time. */
static bool is_quick(const hostile_text *t, size_t length)
{
    static const char *const caps[] = {"steps to compile", "different operations", "unrolls",
                                       "more than",        "1000000 words",        "too large",
                                       "nested deeper"};
    if (!t->said && !strncmp(t->name, "many ", 5))
        return false;
    for (size_t i = 0; t->said && i < sizeof caps / sizeof *caps; i++)
        if (strstr(t->said, caps[i]))
            return false;
    return length <= 20000;
}

static int write_all(const char *folder)
{
    built b = {.text = malloc(HOSTILE_MAX_BYTES)};
    int failed = !b.text;
    for (size_t i = 0; i < NUM_HOSTILE_TEXTS && !failed; i++) {
        char path[4096];
        snprintf(path, sizeof path, "%s/hostile_%03zu.karst", folder, i);
        build(&b, &hostile_texts[i]);
        if (!is_quick(&hostile_texts[i], b.length))
            continue;
        FILE *file = fopen(path, "wb");
        failed = !file || fwrite(b.text, 1, b.length, file) != b.length;
        failed = (file && fclose(file)) || failed;
    }
    free(b.text);
    return failed;
}

int main(int argc, char **argv)
{
    if (argc == 3 && strcmp(argv[1], "write") == 0)
        return write_all(argv[2]);
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_texts), cmocka_unit_test(test_bytes),
                                       cmocka_unit_test(test_nothing_that_terminals_obey),
                                       cmocka_unit_test(test_mangled), cmocka_unit_test(test_files)};
    return cmocka_run_group_tests_name("hostile worlds", tests, NULL, NULL);
}
