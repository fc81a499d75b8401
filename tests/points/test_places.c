/* Models at exact places, as hits are refined with: whether a packet's places lie near one another, in groups or apart,
 * and however many points are around, each has the bits that the host has for it alone. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "core/device/context.h"
#include "producers/points/model_list.h"
#include "producers/points/points_walls.clh"
#include "tests/points/clouds.h"
#include "tests/support/ok.h"

#define VOXEL_LOG2_M (-5)
enum { NUM_PLACES = 16 * 200, NUM_KINDS = 4 };

static const char kernel_text[] =
    "#include \"producers/points/points_places.clh\"\n"
    "#if LANES == 16\n#define LOAD_LONG(p) vload16(0, p)\n#define LOAD_UINT(p) vload16(0, p)\n#else\n"
    "#define LOAD_LONG(p) (*(p))\n#define LOAD_UINT(p) (*(p))\n#endif\n"
    "__kernel K_WIDE void look(K_GLOBAL const ulong *data, K_GLOBAL const long *voxels,\n"
    "                          K_GLOBAL const uint *fractions, int level, uint num, K_GLOBAL float *out)\n"
    "{\n"
    "    const uint first = (uint)get_global_id(0) * LANES;\n"
    "    world_point_at place;\n"
    "    vfloat slope[3];\n"
    "    if (first >= num)\n        return;\n"
    "    for (uint a = 0; a < 3; a++) {\n"
    "        place.voxel[a] = LOAD_LONG(voxels + a * num + first);\n"
    "        place.fraction[a] = LOAD_UINT(fractions + a * num + first);\n"
    "        slope[a] = (vfloat)(7.0f);\n"
    "    }\n"
    "    v_store_float(points_at_places(data, &place, level, (vfloat)(-5.0f), slope, 1), out + first);\n"
    "    for (uint a = 0; a < 3; a++)\n        v_store_float(slope[a], out + (a + 1) * num + first);\n"
    "    v_store_float(points_at_places(data, &place, level, (vfloat)(-5.0f), slope, 0), out + 4 * num + first);\n"
    "}\n";

static char folder[] = "/tmp/karst-places-XXXXXX";
static char torus[64];
static int64_t voxels[3][NUM_PLACES];
static uint32_t fractions[3][NUM_PLACES];
static float made[5][NUM_PLACES];

static int set_up(void **state)
{
    (void)state;
    if (!mkdtemp(folder))
        return -1;
    random_state = 3;
    char input[64];
    snprintf(input, sizeof input, "%s/input.ply", folder);
    snprintf(torus, sizeof torus, "%s/torus.karstpoints", folder);
    write_cloud(input, &known_surfaces[1], 8000, 0.2);
    bool done = karst_points_import(&(karst_points_import_config){.input = input, .output = torus}, NULL, NULL);
    unlink(input);
    return done ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    unlink(torus);
    return rmdir(folder);
}

/* Supports that are so many times as wide; all models are of one file. */
static void widen(karst_model_list *list, float times)
{
    const karst_model_record *model = POINTS_MODELS(list->data);
    for (uint32_t l = 0; l < model->num_levels; l++) {
        karst_model_level *of = (karst_model_level *)POINTS_LEVELS(list->data) + model->first_level + l;
        karst_point *points = (karst_point *)(list->data + of->points);
        of->reach = (int)((float)of->reach * times) + 2;
        for (uint32_t i = 0; i < of->num_points; i++)
            points[i].radius *= times;
        for (uint32_t n = 0; n < of->num_levels; n++) {
            karst_point_node *nodes = (karst_point_node *)(list->data + of->nodes[n]);
            for (uint32_t i = 0; i < of->counts[n]; i++)
                nodes[i].reach = (int)((float)nodes[i].reach * times) + 2;
        }
    }
}

/* On the torus, which is 2.8 m wide, or beside it. */
static void place_on_torus(int at)
{
    const double around = 2 * PI * random_unit(), along = 2 * PI * random_unit(),
                 r = 0.4 + 0.05 * (random_unit() - 0.5);
    const double ring = 1 + r * cos(along);
    const double p[3] = {ring * cos(around), r * sin(along), ring * sin(around)};
    for (int a = 0; a < 3; a++) {
        const double in_voxels = ldexp(p[a], -VOXEL_LOG2_M);
        voxels[a][at] = (int64_t)floor(in_voxels);
        fractions[a][at] = (uint32_t)random_bits();
    }
}

/* Packets of all kinds: near one another, in two groups, apart, and some far from everything. */
static void choose_places(void)
{
    for (int first = 0; first < NUM_PLACES; first += 16) {
        const int kind = first / 16 % NUM_KINDS;
        for (int lane = 0; lane < 16; lane++) {
            const int at = first + lane, from = kind == 1 ? first + lane / 8 * 8 : first;
            place_on_torus(at);
            for (int a = 0; a < 3 && kind < 2 && at != from; a++)
                voxels[a][at] = voxels[a][from] + (int64_t)random_below(3) - 1;
            if (kind == 3 && lane % 3 == 0)
                voxels[0][at] += lane % 2 ? (int64_t)1 << 40 : 1000;
        }
    }
}

typedef struct {
    int lanes;
    karst_context *context;
    karst_program *program;
    cl_kernel kernel;
} device;

static device device_of(int lanes)
{
    const karst_virtual_file file = {"look.cl", kernel_text};
    device d = {.lanes = lanes};
    assert_ok(d.context = karst_context_create(getenv("KARST_DEVICE"), lanes, NULL, &error));
    assert_ok(d.program = karst_program_build(d.context, "look.cl", "", &file, 1, &error));
    assert_ok(d.kernel = karst_program_kernel(d.program, "look", &error));
    return d;
}

static void look(const device *d, const karst_model_list *list, int level)
{
    karst_buffer *data, *at, *parts, *out;
    assert_ok(data = karst_buffer_create(d->context, "test", list->size_bytes, list->data, &error));
    assert_ok(at = karst_buffer_create(d->context, "test", sizeof voxels, voxels, &error));
    assert_ok(parts = karst_buffer_create(d->context, "test", sizeof fractions, fractions, &error));
    assert_ok(out = karst_buffer_create(d->context, "test", sizeof made, made, &error));
    const uint32_t num = NUM_PLACES;
    assert_ok(KARST_ARGUMENTS(d->kernel, &error, KARST_BUFFER_ARG(data), KARST_BUFFER_ARG(at), KARST_BUFFER_ARG(parts),
                              KARST_VALUE_ARG(level), KARST_VALUE_ARG(num), KARST_BUFFER_ARG(out)));
    assert_ok(karst_launch(d->context, d->kernel, KARST_STAGE_EVALUATE, (size_t)(NUM_PLACES / d->lanes), 1, &error));
    assert_ok(karst_buffer_read(out, 0, made, sizeof made, &error));
    karst_buffer_destroy(out);
    karst_buffer_destroy(parts);
    karst_buffer_destroy(at);
    karst_buffer_destroy(data);
}

static void compare(const device *on, const karst_model_list *list, int level)
{
    int num_known = 0;
    look(on, list, level);
    for (int i = 0; i < NUM_PLACES; i++) {
        karst_position at;
        float slope[3] = {7, 7, 7}, d;
        for (int a = 0; a < 3; a++) {
            at.voxel[a] = voxels[a][i];
            at.fraction[a] = fractions[a][i];
        }
        d = karst_model_list_at(list, &at, level, -5, slope);
        num_known += d != -5;
        const float expected[5] = {d, slope[0], slope[1], slope[2], karst_model_list_at(list, &at, level, -5, NULL)};
        for (int k = 0; k < 5; k++)
            if (memcmp(&expected[k], &made[k][i], sizeof expected[k]) != 0)
                fail_msg("%d lanes, level %d, place %d of a packet of kind %d: value %d is %a, the host has %a",
                         on->lanes, level, i % 16, i / 16 % NUM_KINDS, k, (double)made[k][i], (double)expected[k]);
    }
    print_message("# %d lanes, level %d: %d of %d places have values\n", on->lanes, level, num_known, NUM_PLACES);
    assert_true(num_known > NUM_PLACES / 2);
}

/* With supports as they are, and so wide that hundreds of points are around each place: more than are kept. */
static void places_have_the_hosts_bits(void **state)
{
    (void)state;
    const karst_model models[2] = {{.path = torus, .scale = 1}, {.path = torus, .scale = 0.7, .turn_deg = {0, 40, 90}}};
    choose_places();
    for (int lanes = 1; lanes <= 16; lanes += 15) {
        const device on = device_of(lanes);
        for (int wide = 0; wide < 2; wide++) {
            karst_model_list list;
            assert_ok(karst_model_list_init(&list, models, 2, VOXEL_LOG2_M, UINT64_MAX, NULL, &error));
            widen(&list, wide ? 4 : 1);
            compare(&on, &list, 0);
            if (!wide)
                compare(&on, &list, 2);
            karst_model_list_finish(&list);
        }
        clReleaseKernel(on.kernel);
        karst_program_destroy(on.program);
        karst_context_destroy(on.context);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(places_have_the_hosts_bits)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
