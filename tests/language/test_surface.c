/* Generated code for a density with its gradient: with 1 and with 16 lanes the bits are the host oracle's. */
#include "world_text.h"

#include "core/device/context.h"
#include "producers/language/graph/derive.h"
#include "producers/language/emit/emit.h"
#include "producers/language/ops/octave.clh"

enum { NUM_POINTS = 512, NUM_OUTPUTS = 5 };

static const char probe[] =
    "#include \"core/device/lanes.clh\"\n"
    "#include \"producers/steps/density.clh\"\n"
    "#include \"world.clh\"\n"
    "#if LANES == 16\n"
    "#define LOAD(p) vload16(0, p)\n"
    "#else\n"
    "#define LOAD(p) (*(p))\n"
    "#endif\n"
    "K_WIDE __kernel __attribute__((reqd_work_group_size(1, 1, 1)))\n"
    "void surface(K_GLOBAL const ulong *data, K_GLOBAL const long *voxels, K_GLOBAL const uint *fractions, int level,\n"
    "             K_GLOBAL float *out)\n"
    "{\n"
    "    uint first = (uint)get_global_id(0) * LANES;\n"
    "    world_point_at at;\n"
    "    vfloat gradient[3];\n"
    "    for (int axis = 0; axis < 3; axis++) {\n"
    "        at.voxel[axis] = LOAD(voxels + axis * NUM_POINTS + first);\n"
    "        at.fraction[axis] = LOAD(fractions + axis * NUM_POINTS + first);\n"
    "    }\n"
    "    v_store_float(world_surface(data, &at, level, gradient), out + first);\n"
    "    for (int axis = 0; axis < 3; axis++)\n"
    "        v_store_float(gradient[axis], out + (axis + 1) * NUM_POINTS + first);\n"
    "    v_store_float(world_point(data, &at, level), out + 4 * NUM_POINTS + first);\n"
    "}\n";

/* What the shipped worlds leave out. */
static const char everything[] =
    "/*{ \"params\": { \"a\": 0.7, \"b\": { \"value\": 3 } } }*/\n"
    "float density(vec3 p) {\n"
    "    vec3 q = p / 7.0 + 0.3 * vec3(sin(p.y), cos(p.z * 0.3), fract(p.x * 0.17));\n"
    "    float d = atan(q.y, q.x) + exp(sin(q.x)) + log(2.0 + abs(q.y)) + pow(1.5 + sin(q.z), a) + mod(q.x, 0.3 + a);\n"
    "    d += mix(q.x, q.y, smoothstep(-1.0, 1.0, q.z)) * sqrt(abs(q.z)) / (1.0 + dot(q, q));\n"
    "    d += clamp(q.x, -a, a) + max(q.y, min(q.z, q.x * q.y)) + (q.x < q.y ? q.z * b : -q.z);\n"
    "    d += floor(q.x) * q.y + float(int(q.z * 9.0) & 3) * q.x + length(q.xz) + normalize(q).y;\n"
    "    d += ridged(q, 2) + billow(q + 0.2 * noise(q), 2) * turbulence(q * 1.3, 2);\n"
    "    d += worley(q).x + 0.5 * worley(q * 0.7).y + valuenoise(q * 1.1) + simplex(q);\n"
    "    return d - p.y + max(length(p) - 6.4e6, -9e9) * 1e-7;\n"
    "}\n";

typedef struct {
    karst_program_graph *program;
    karst_gradient_world *gradient;
    karst_oracle *oracle;
    karst_world_layout layout;
    uint64_t *data;
    char *source;
    karst_position at[NUM_POINTS];
} subject;

/* Ties, folds and cell faces on the lattice of voxels, of terms that tie in reals and not in floats. */
static const char kinks[] =
    "/*{ \"voxel\": 1 }*/\n"
    "float cross(vec3 p) { return min(max(p.x, p.y), min(max(p.y, p.z), max(p.z, p.x))); }\n"
    "float density(vec3 p) {\n"
    "    vec3 q = p / 27.0;\n"
    "    float d = max(abs(q.x), max(abs(q.y), abs(q.z))) - 20.0;\n"
    "    for (int i = 0; i < 3; i++) {\n"
    "        float s = float(i + 1) * 3.0;\n"
    "        vec3 r = abs(1.0 - 3.0 * abs(mod(q * s, 2.0) - 1.0));\n"
    "        d = max(d, (cross(r) - 1.0) / s);\n"
    "    }\n"
    "    return clamp(-d, -3.0, 3.0) * 27.0 + (p.x < p.z ? p.x - p.z : 0.0) + 0.1 * noise(p / 8.0);\n"
    "}\n";

static void expect(bool good, const karst_error *error)
{
    if (!good)
        fail_msg("%s", error->message);
}

static uint32_t random_state;
static uint32_t random_bits(void)
{
    random_state = random_state * 1664525u + 1013904223u;
    return random_state ^ random_state >> 15;
}

static void place_points(subject *s)
{
    static const int64_t far[] = {0, 1000000000, 1000000000000000};
    const karst_world_header *h = &s->program->header;
    karst_position camera = {{0}, {0}};
    if (h->has_camera)
        assert_true(karst_position_parse(h->camera_position[0], h->camera_position[1], h->camera_position[2],
                                         h->voxel_log2_m, &camera, NULL));
    random_state = 17;
    for (int k = 0; k < NUM_POINTS; k++)
        for (int axis = 0; axis < 3; axis++) {
            s->at[k].voxel[axis] = camera.voxel[axis] + (int64_t)(random_bits() % 4000) - 2000 + far[k % 3];
            s->at[k].fraction[axis] = k % 2 ? random_bits() : 0;
        }
}

static void subject_make(subject *s, const char *text, size_t length, const char *name)
{
    bool ok;
    karst_error error = {0};
    karst_number values[KARST_HEADER_MAX_PARAMETERS + 16];
    s->program = karst_language_compile(name, text, length, NULL, 0, &ok, &error);
    expect(ok, &error);
    for (uint32_t i = 0; i < s->program->num_parameters; i++)
        values[i] = s->program->parameters[i].value;
    uint32_t seed = s->program->header.seed;
    int voxel_log2_m = s->program->header.voxel_log2_m;
    expect((s->gradient = karst_derive(&s->program->world, &error)), &error);
    expect((s->oracle = karst_oracle_create(&s->gradient->world, values, seed, voxel_log2_m, &error)), &error);
    assert_true(karst_world_layout_init(&s->layout, &s->gradient->world));
    s->data = calloc(s->layout.num_words, sizeof *s->data);
    assert_true(karst_world_data_fill(&s->layout, values, seed, voxel_log2_m, s->data));
    expect(karst_emit_surface(&s->layout, &s->source, &error), &error);
    place_points(s);
}

static void subject_finish(subject *s)
{
    karst_oracle_destroy(s->oracle);
    karst_gradient_world_destroy(s->gradient);
    karst_program_graph_destroy(s->program);
    free(s->data);
    free(s->source);
}

static void run(const subject *s, int lanes, int level, float out[NUM_OUTPUTS][NUM_POINTS])
{
    karst_error error = {0};
    char options[64];
    static int64_t voxels[3][NUM_POINTS];
    static uint32_t fractions[3][NUM_POINTS];
    for (int k = 0; k < NUM_POINTS; k++)
        for (int axis = 0; axis < 3; axis++) {
            voxels[axis][k] = s->at[k].voxel[axis];
            fractions[axis][k] = s->at[k].fraction[axis];
        }
    snprintf(options, sizeof options, "-DWORLD_HAS_DATA -DNUM_POINTS=%d", NUM_POINTS);
    karst_context *context = karst_context_create(getenv("KARST_DEVICE"), lanes, NULL, &error);
    expect(context, &error);
    const karst_virtual_file files[] = {{"probe.cl", probe}, {"world.clh", s->source}};
    karst_program *program = karst_program_build(context, "probe.cl", options, files, 2, &error);
    expect(program, &error);
    cl_kernel kernel = karst_program_kernel(program, "surface", &error);
    karst_buffer *data = karst_buffer_create(context, "data", s->layout.num_words * sizeof *s->data, s->data, &error);
    karst_buffer *v = karst_buffer_create(context, "voxels", sizeof voxels, voxels, &error);
    karst_buffer *f = karst_buffer_create(context, "fractions", sizeof fractions, fractions, &error);
    karst_buffer *o = karst_buffer_create(context, "out", sizeof(float[NUM_OUTPUTS][NUM_POINTS]), NULL, &error);
    expect(kernel && data && v && f && o, &error);
    cl_int wanted_level = level;
    expect(KARST_ARGUMENTS(kernel, &error, KARST_BUFFER_ARG(data), KARST_BUFFER_ARG(v), KARST_BUFFER_ARG(f),
                           KARST_VALUE_ARG(wanted_level), KARST_BUFFER_ARG(o)) &&
               karst_launch(context, kernel, KARST_STAGE_SHADE, NUM_POINTS / (size_t)lanes, 1, &error) &&
               karst_buffer_read(o, 0, out, sizeof(float[NUM_OUTPUTS][NUM_POINTS]), &error),
           &error);
    karst_buffer_destroy(data);
    karst_buffer_destroy(v);
    karst_buffer_destroy(f);
    karst_buffer_destroy(o);
    clReleaseKernel(kernel);
    karst_program_destroy(program);
    karst_context_destroy(context);
}

static bool same_float(float a, float b) { return k_as_uint(a) == k_as_uint(b) || (isnan(a) && isnan(b)); }

static void compare(subject *s, const char *name, int lanes, int level)
{
    static float out[NUM_OUTPUTS][NUM_POINTS];
    int num_finite = 0;
    run(s, lanes, level, out);
    for (int k = 0; k < NUM_POINTS; k++) {
        karst_oracle_value v[4];
        v[0] = karst_oracle_gradient(s->oracle, &s->at[k], level, v + 1);
        num_finite += isfinite(v[1].device) != 0;
        for (int i = 0; i < NUM_OUTPUTS; i++)
            if (!same_float(out[i][k], v[i % 4].device))
                fail_msg("%s, %d lanes, point %d, output %d: %a, on the host %a", name, lanes, k, i, (double)out[i][k],
                         (double)v[i % 4].device);
    }
    assert_true(num_finite > NUM_POINTS / 2);
}

static void compare_file(const char *path, int lanes, int level)
{
    size_t length;
    subject s;
    char *text = read_text(path, &length);
    subject_make(&s, text, length, path);
    compare(&s, path, lanes, level);
    subject_finish(&s);
    free(text);
}

static void test_shipped_worlds(void **state)
{
    (void)state;
    compare_file("demos/worlds/alps.karst", 16, 2);
    compare_file("demos/worlds/alps.karst", 1, 2);
    compare_file("demos/worlds/planet.karst", 16, -1);
    compare_file("demos/worlds/ruins.karst", 1, 0);
}

static void test_everything(void **state)
{
    (void)state;
    for (int lanes = 1; lanes <= 16; lanes += 15) {
        subject s;
        subject_make(&s, everything, strlen(everything), "everything");
        compare(&s, "everything", lanes, -1);
        subject_finish(&s);
    }
}

static void test_kinks(void **state)
{
    (void)state;
    for (int lanes = 1; lanes <= 16; lanes += 15) {
        subject s;
        subject_make(&s, kinks, strlen(kinks), "kinks");
        assert_non_null(strstr(s.source, "if (v_any(")); /* what only ties need is left out elsewhere */
        compare(&s, "kinks", lanes, -1);
        subject_finish(&s);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_shipped_worlds),
        cmocka_unit_test(test_everything),
        cmocka_unit_test(test_kinks),
    };
    return cmocka_run_group_tests_name("surfaces", tests, NULL, NULL);
}
