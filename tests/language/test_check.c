/* What is said about worlds that compile, and that the Lipschitz constant said is one. */
#include "world_text.h"

#include "producers/language/check.h"
#include "producers/language/emit/emit.h"
#include "producers/language/graph/lipschitz.h"

static char said[16384];
static void collect(void *user, const char *line)
{
    (void)user;
    strncat(strncat(said, line, sizeof said - strlen(said) - 2), "\n", 2);
}

static void check(const char *text, const char *expected)
{
    text_world w = world_from_text(text);
    said[0] = 0;
    assert_true(karst_language_check(w.program, collect, NULL, NULL));
    if (strcmp(said, expected))
        fail_msg("%s\n--- instead of\n%s", said, expected);
    world_finish(&w);
}

static void test_lines(void **s)
{
    (void)s;
    check("/*{ \"name\": \"Hills\", \"author\": \"N. N.\", \"voxel\": 0.0625, \"seed\": 3,\n"
          "\"params\": { \"relief\": { \"value\": 400, \"min\": 0, \"max\": 1000, \"unit\": \"m\" }, \"n\": 9, "
          "\"other\": 1 } }*/\n"
          "float density(vec3 p) {\n"
          "    float h = fbm(p.xz / 1024.0, int(n));\n"
          "    float w = noise(p + h) + noise(p.yxz);\n"
          "    return relief * h + w - p.y;\n"
          "}\n",
          "world.karst:2:85: warning: parameter 'other' is not used\n"
          "  00, \"min\": 0, \"max\": 1000, \"unit\": \"m\" }, \"n\": 9, \"other\": 1 } }*/\n"
          "                                                    ^\n"
          "world.karst: Hills, by N. N.\n"
          "  voxel 0.0625 m, seed 3, 20 operations (19 as written), longest loop 0 rounds\n"
          "  parameter relief = 400 m\n"
          "  parameter n = 9, decides the program: a change compiles again\n"
          "  parameter other = 1, not used\n"
          "  line 4: fbm, 9 octaves, separable\n"
          "  line 5: gradient noise, 1 octave, pointwise: warped\n"
          "  line 5: gradient noise, 1 octave, pointwise: its arguments mix the axes\n"
          "  11 octaves of noise, 9 of them separable\n"
          "  bounded: there is a proof for every box\n"
          "  proven: at most 58.31 steep (Lipschitz constant)\n"
          "  density from -inf to inf\n"
          "  2 operations need pairs of floats, the first in line 6\n"
          "  estimated cost: 6.24 ns a voxel and core\n");
    check("float density(vec3 p) {\n"
          "    float d = length(p.xz) - p.y;\n"
          "    return d + iTime + floor(p.x) + sqrt(sin(p.z));\n"
          "}\n",
          "world.karst: a world\n"
          "  voxel 0.0625 m, seed 0, 15 operations (12 as written), longest loop 0 rounds\n"
          "  input iTime is 0 here\n"
          "  bounded: there is a proof for every box\n"
          "  no Lipschitz constant: line 3, floor, jumps\n"
          "  density from -inf to inf\n"
          "  line 2: right to 1/100 voxel up to 2.1e+03 m from the origin; say \"extent\" in the header for more\n"
          "  estimated cost: 0.164 ns a voxel and core\n");
    check("float density(vec3 p) { return sin(p.x) - 2.0; }\n",
          "world.karst: a world\n"
          "  voxel 0.0625 m, seed 0, 5 operations (4 as written), longest loop 0 rounds\n"
          "  bounded: there is a proof for every box\n"
          "  proven: at most 1 steep (Lipschitz constant)\n"
          "  density from -3 to -1: never above 0, so all is air and there is nothing to see\n"
          "  estimated cost: 0.000469 ns a voxel and core\n");
    check("float density(vec3 p) { return sin(p.x) + 2.0; }\n",
          "world.karst: a world\n"
          "  voxel 0.0625 m, seed 0, 5 operations (4 as written), longest loop 0 rounds\n"
          "  bounded: there is a proof for every box\n"
          "  proven: at most 1 steep (Lipschitz constant)\n"
          "  density from 1 to 3: always above 0, so all is solid and there is nothing to see\n"
          "  estimated cost: 0.000469 ns a voxel and core\n");
    check("float density(vec3 p) { return -length(p); }\n",
          "world.karst: a world\n"
          "  voxel 0.0625 m, seed 0, 6 operations (5 as written), longest loop 0 rounds\n"
          "  bounded: there is a proof for every box\n"
          "  proven: at most 1 steep (Lipschitz constant)\n"
          "  density from -inf to 0: never above 0, so all is air; of an unsigned distance, subtract it from a "
          "thickness\n"
          "  estimated cost: 0.0805 ns a voxel and core\n");
    check("float density(vec3 p) { return worley(p / 50.0).x; }\n",
          "world.karst: a world\n"
          "  voxel 0.0625 m, seed 0, 7 operations (10 as written), longest loop 0 rounds\n"
          "  line 1: worley F1, 1 octave, pointwise: of another kind than gradient noise\n"
          "  1 octaves of noise, 0 of them separable\n"
          "  bounded: there is a proof for every box\n"
          "  proven: at most 0.02 steep (Lipschitz constant)\n"
          "  density from 0 to 1.732: never below 0, so nearly all is solid; subtract from it what is to be air\n"
          "  estimated cost: 2.7 ns a voxel and core\n");
    check("float density(vec3 p) { return 9.0 * fbm(floor(p), 3) + noise(floor(p.xz) + 2.0) - p.y; }\n",
          "world.karst: a world\n"
          "  voxel 0.0625 m, seed 0, 17 operations (16 as written), longest loop 0 rounds\n"
          "  line 1: fbm, 3 octaves, pointwise: not affine in the position\n"
          "  line 1: this noise is always 0, as gradient noise is at whole coordinates; write valuenoise, or add 0.5\n"
          "  line 1: gradient noise, 1 octave, pointwise: not affine in the position\n"
          "  line 1: this noise is always 0, as gradient noise is at whole coordinates; write valuenoise, or add 0.5\n"
          "  4 octaves of noise, 0 of them separable\n"
          "  bounded: there is a proof for every box\n"
          "  no Lipschitz constant: line 1, floor, jumps\n"
          "  density from -inf to inf\n"
          "  estimated cost: 8.35 ns a voxel and core\n");
    check("float density(vec3 p) { return -p.y; }\n"
          "material surface(vec3 p, vec3 n) {\n"
          "    material m;\n"
          "    m.emission = n;\n"
          "    m.mirror = n.y;\n"
          "    m.gloss = 0.0;\n"
          "    m.ior = 1.5;\n"
          "    return m;\n"
          "}\n",
          "world.karst: a world\n"
          "  voxel 0.0625 m, seed 0, 7 operations (7 as written), longest loop 0 rounds\n"
          "  surface gives colour, mirror, emission\n"
          "  of what surface gives, ior has no effect on pictures yet\n"
          "  bounded: there is a proof for every box\n"
          "  proven: at most 1 steep (Lipschitz constant)\n"
          "  density from -inf to inf\n"
          "  estimated cost: 0.000156 ns a voxel and core\n");
    /* Its sines are too much text. */
    check("float density(vec3 p) {\n"
          "    float s = 0.0;\n"
          "    for (int i = 1; i <= 500; i++) s += sin(p.x * float(i));\n"
          "    return s - p.y;\n"
          "}\n",
          "world.karst: a world\n"
          "  voxel 0.0625 m, seed 0, 2002 operations (2000 as written), longest loop 500 rounds\n"
          "  bounded: there is a proof for every box\n"
          "  proven: at most 1.253e+05 steep (Lipschitz constant)\n"
          "  density from -inf to inf\n"
          "  estimated cost: 2.7e+03 ns a voxel and core\n"
          "  too large to be compiled: each operation is looked up for each voxel, and a brick takes some 13.3 ms; a "
          "picture takes thousands of them. Write loops of fewer rounds\n");
}

/* What the report says of the tape is what the generator does: either side of the limit. */
static void test_tape(void **s)
{
    (void)s;
    bool was[2] = {false, false};
    for (int rounds = 300; rounds <= 420; rounds += 5) {
        char text[256];
        snprintf(text, sizeof text,
                 "float density(vec3 p) { float s = 0.0; for (int i = 1; i <= %d; i++) s += sin(p.x * float(i)); "
                 "return s - p.y; }",
                 rounds);
        text_world w = world_from_text(text);
        karst_world_layout layout;
        karst_emitted emitted = {0};
        karst_error error = {0};
        assert_true(karst_world_layout_init(&layout, &w.program->world));
        said[0] = 0;
        assert_true(karst_language_check(w.program, collect, NULL, NULL));
        if (!karst_emit_world(&layout, &emitted, &error))
            fail_msg("%s", error.message);
        const bool is_said = strstr(said, "too large to be compiled") != NULL;
        if (is_said != emitted.is_tape)
            fail_msg("%d rounds: %s, but the report says: %s", rounds, emitted.is_tape ? "a tape" : "text", said);
        was[is_said] = true;
        karst_emitted_finish(&emitted);
        world_finish(&w);
    }
    assert_true(was[0] && was[1]);
}

static const char *const bodies[] = {
    "return noise(p / 7.0) * 3.0 - p.y;",
    "return length(p - vec3(1.0, 2.0, 3.0)) - 4.0;",
    "return max(length(p.xz) - 2.0, abs(p.y) - 1.0);",
    "return sin(p.x * 2.0 + p.z) * cos(p.y) + fbm(p / 5.0, 4, 0.45, 2.1);",
    "return smin(sphere(p, 2.0), box(p - 1.0, vec3(1.0)), 0.5);",
    "return ridged(p * 0.3 + 0.2 * sin(p.yzx), 3) + billow(p * 0.1, 2) - turbulence(p * 0.2, 2);",
    "return mix(p.x, p.y * 2.0, 0.5 + 0.5 * sin(p.z)) * 0.0 + mix(sin(p.x), 2.0, smoothstep(0.0, 1.0, sin(p.z)));",
    "return exp2(sin(p.x)) / (2.0 + cos(p.y)) + sqrt(2.0 + sin(p.z)) + log(2.0 + sin(p.x));"};

/* No two samples are further apart in value than the constant says, and it is not absurd. */
static void test_steepness(void **s)
{
    (void)s;
    uint32_t state = 7;
    for (size_t i = 0; i < sizeof bodies / sizeof *bodies; i++) {
        text_world w = world_from_body(bodies[i]);
        const karst_graph *g = &w.program->resolved;
        karst_range *ranges = calloc(g->num_nodes, sizeof *ranges);
        karst_lipschitz *steepness = calloc(g->num_nodes, sizeof *steepness);
        karst_kinds_settings settings = {.voxel_log2_m = -4};
        karst_graph_ranges(g, &settings, ranges);
        karst_graph_lipschitz(g, ranges, steepness);
        double most = steepness[w.program->world.root[KARST_ROOT_DENSITY]].constant, seen = 0;
        assert_true(isfinite(most));
        for (int k = 0; k < 4000; k++) {
            double at[3], to[3], distance = 0;
            for (int j = 0; j < 3; j++) {
                state = state * 1664525u + 1013904223u;
                at[j] = (state >> 8) * 0x1p-24 * 20 - 10;
                state = state * 1664525u + 1013904223u;
                to[j] = at[j] + ((state >> 8) * 0x1p-24 - 0.5) * 1e-3;
                distance += (at[j] - to[j]) * (at[j] - to[j]);
            }
            double a = density_at(&w, at[0], at[1], at[2]).precise, b = density_at(&w, to[0], to[1], to[2]).precise;
            seen = fmax(seen, fabs(a - b) / sqrt(distance));
            assert_true(a >= ranges[w.program->world.root[KARST_ROOT_DENSITY]].lo &&
                        a <= ranges[w.program->world.root[KARST_ROOT_DENSITY]].hi);
        }
        if (seen > most * (1 + 1e-5) || seen < most / 30)
            fail_msg("%s: steepness %g was seen, %g is claimed", bodies[i], seen, most);
        free(ranges);
        free(steepness);
        world_finish(&w);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_lines), cmocka_unit_test(test_tape),
                                       cmocka_unit_test(test_steepness)};
    return cmocka_run_group_tests_name("check", tests, NULL, NULL);
}
