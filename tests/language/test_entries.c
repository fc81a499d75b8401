/* Entry points: known by name and signature, one line of the table each; what they give has a root of its own. */
#include "world_text.h"

#include "producers/language/emit/emit.h"

static const char plain[] = "float density(vec3 p) { return -p.y; }\n";

static text_world world_with(const char *text)
{
    char all[2048];
    snprintf(all, sizeof all, "%s%s", plain, text);
    return world_from_text(all);
}

/* Each line of the table: a function of its signature is the entry, one with a parameter more is the text's own. */
static void test_signatures(void **state)
{
    (void)state;
    for (int e = 0; e < KARST_NUM_ENTRIES; e++) {
        char signature[KARST_SIGNATURE_BYTES], text[512];
        const char *result = karst_entries[e].result, *before = e == KARST_ENTRY_DENSITY ? "" : plain;
        karst_entry_signature((karst_entry)e, signature);
        for (int more = 0; more < 2; more++) {
            signature[strlen(signature) - 1] = 0;
            snprintf(text, sizeof text, "%s%s%s) { %s r; return r; }\n%s", before, signature, more ? ", vec3 t" : "",
                     result, more && !*before ? plain : "");
            text_world w = world_from_text(text);
            assert_int_equal(w.program->has_entry[e], e == KARST_ENTRY_DENSITY || !more);
            assert_int_equal(karst_has_output(w.program->root, karst_entries[e].first), w.program->has_entry[e]);
            assert_int_equal(w.program->diagnostics != NULL, more && *before);
            world_finish(&w);
            signature[strlen(signature)] = ')';
        }
    }
}

/* Another spelling, a function of another kind besides, a struct and variables of the text's own. */
static void test_names(void **state)
{
    static const struct {
        const char *text;
        int entry; /* that there is besides the density; 0: none */
    } cases[] = {
        {"vec3 color(vec3 p, vec3 n) { return n; }", KARST_ENTRY_COLOUR},
        {"vec3 colour(float a) { return vec3(a); } vec3 colour(vec3 p, vec3 n) { return colour(n.x); }",
         KARST_ENTRY_COLOUR},
        {"vec3 colour(vec3 p, vec3 n); vec3 colour(vec3 p, vec3 n) { return n; }", KARST_ENTRY_COLOUR},
        {"vec3 colour(const in vec3 p, vec3 n) { return n; }", KARST_ENTRY_COLOUR},
        {"vec3 colour(inout vec3 p, vec3 n) { return n; }", 0},
        {"ivec3 colour(vec3 p, vec3 n) { return ivec3(n); }", 0},
        {"vec3 colour(vec3 p, vec4 n) { return n.xyz; }", 0},
        {"vec3 colour(vec3 p[2], vec3 n) { return n; }", 0},
        {"float surface(vec3 p) { return p.x; }", 0},
        {"struct material { float a; }; material surface(vec3 p, vec3 n) { material m; m.a = 1.0; return m; }", 0},
        {"float material; float f(vec3 p) { material = p.x; return material; }", 0},
        {"#define M material\nM surface(vec3 p, vec3 n) { M m; return m; }", KARST_ENTRY_SURFACE},
        {"material rock(vec3 p) { material m; m.mirror = p.x; return m; }\n"
         "material surface(vec3 p, vec3 n) { return rock(p); }",
         KARST_ENTRY_SURFACE},
    };
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        text_world w = world_with(cases[i].text);
        for (int e = 1; e < KARST_NUM_ENTRIES; e++)
            if (w.program->has_entry[e] != (e == cases[i].entry))
                fail_msg("%s: %s is%s an entry", cases[i].text, karst_entries[e].name,
                         w.program->has_entry[e] ? "" : " not");
        world_finish(&w);
    }
}

static void expect_values(text_world *w, const double expected[KARST_NUM_ROOTS], const char *what)
{
    karst_oracle_value values[KARST_NUM_ROOTS];
    karst_position at = position_at(w, 1, 2, 3);
    karst_oracle_shading(w->oracle, &at, (const float[KARST_FACING_FLOATS]){0, 1, 0}, -1, values);
    for (int i = KARST_ROOT_COLOUR; i < KARST_NUM_ROOTS; i++)
        if (values[i].precise != expected[i] || values[i].device != (float)expected[i])
            fail_msg("%s: root %d is %.17g and %a, not %.17g", what, i, values[i].precise, (double)values[i].device,
                     expected[i]);
}

/* What a text leaves out is as usual, and costs no root; each field has its own. */
static void test_fields(void **state)
{
    double usual[KARST_NUM_ROOTS], set[KARST_NUM_ROOTS];
    uint32_t list[KARST_NUM_ROOTS];
    char text[2048] = "material surface(vec3 p, vec3 n) {\n    material m;\n";
    (void)state;
    for (int o = 0; o < KARST_NUM_OUTPUTS; o++)
        for (uint32_t i = karst_outputs[o].root; i < karst_outputs[o].root + karst_outputs[o].num_floats; i++) {
            const bool is_surface = i >= KARST_ROOT_COLOUR && i <= KARST_ROOT_LAST_TRANSPARENCY;
            usual[i] = karst_outputs[o].usual;
            set[i] = is_surface ? i + 0.25 : usual[i];
            if (is_surface)
                snprintf(text + strlen(text), sizeof text - strlen(text), "    m.%s%s%.1s = p.x * %u.25;\n",
                         karst_outputs[o].name, karst_outputs[o].num_floats > 1 ? "." : "",
                         karst_outputs[o].num_floats > 1 ? "xyz" + (i - karst_outputs[o].root) : "", i);
        }
    strcat(text, "    return m;\n}\n");
    text_world w = world_with("material surface(vec3 p, vec3 n) { material m; return m; }");
    assert_int_equal(karst_list_roots(w.program->root, KARST_PROGRAM_SHADING, list), 3);
    expect_values(&w, usual, "nothing set");
    world_finish(&w);
    w = world_with("material surface(vec3 p, vec3 n) { material m; m.ior = 1.33; m.mirror = n.y - n.y; return m; }");
    assert_int_equal(karst_list_roots(w.program->root, KARST_PROGRAM_SHADING, list), 3);
    world_finish(&w);
    w = world_with("material m; material surface(vec3 p, vec3 n) { m.mirror = 0.0; return m; }");
    assert_int_equal(karst_list_roots(w.program->root, KARST_PROGRAM_SHADING, list), 3);
    expect_values(&w, usual, "a global");
    world_finish(&w);
    w = world_with(text);
    assert_int_equal(karst_list_roots(w.program->root, KARST_PROGRAM_SHADING, list), KARST_ROOT_LAST_TRANSPARENCY);
    expect_values(&w, set, "all set");
    world_finish(&w);
}

static char *shading_code(const char *text, bool *has_outputs)
{
    text_world w = world_with(text);
    karst_world_layout layout;
    karst_emitted emitted;
    karst_error error = {0};
    assert_true(karst_world_layout_init(&layout, &w.program->world) && karst_emit_world(&layout, &emitted, &error));
    char *code = strdup(emitted.colour_source);
    *has_outputs = strstr(code, "world_outputs(") != NULL;
    assert_int_equal(*has_outputs, strstr(code, "#define WORLD_NUM_OUTPUTS ") != NULL);
    karst_emitted_finish(&emitted);
    world_finish(&w);
    return code;
}

#define ROCK "vec3 colour(vec3 p, vec3 n) { return vec3(0.3, noise(p / 9.0), n.y); }\n"

/* A surface that is nothing but a colour is the code of that colour; the surface's replaces colour()'s. */
static void test_colours(void **state)
{
    bool has_outputs;
    (void)state;
    char *colour = shading_code(ROCK, &has_outputs);
    assert_false(has_outputs);
    char *surface = shading_code(
        ROCK "material surface(vec3 p, vec3 n) { material m; m.colour = colour(p, n); return m; }", &has_outputs);
    assert_false(has_outputs);
    assert_string_equal(colour, surface);
    free(surface);
    surface =
        shading_code(ROCK "material surface(vec3 p, vec3 n) { material m; m.colour = n; return m; }", &has_outputs);
    assert_false(has_outputs);
    assert_string_not_equal(colour, surface);
    free(surface);
    surface = shading_code(
        ROCK "material surface(vec3 p, vec3 n) { material m; m.colour = colour(p, n); m.mirror = 0.5; return m; }",
        &has_outputs);
    assert_true(has_outputs && strstr(surface, "#define WORLD_OUTPUT_MIRROR 3\n"));
    assert_null(strstr(surface, "WORLD_OUTPUT_EMISSION"));
    free(surface);
    free(colour);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_signatures), cmocka_unit_test(test_names),
                                       cmocka_unit_test(test_fields), cmocka_unit_test(test_colours)};
    return cmocka_run_group_tests_name("entry points", tests, NULL, NULL);
}
