/* The same bits for every shipped world: bricks of every shape of device, points of 16 lanes and of one, the tape, and
 * the host's oracle. Near the surface at the camera, and around 10^9 and 10^15 voxels from there. KARST_TEST_FULL=1
 * compares 10^7 voxels a world instead of some 10^5, on all shapes, and points of one lane. */
#include "producers/steps/evaluate.h"
#include "tests/worlds/shipped.h"

/* GPUs take the third; the fourth is for completeness, and the last two run the tape instead of generated code. */
#define NUM_SHAPES 6
static const struct {
    const char *name;
    int lanes;
    karst_shape shape;
    bool tape, only_full;
} shapes[NUM_SHAPES] = {
    {"16 lanes, rows", 16, KARST_SHAPE_ROWS, false, false},  {"1 lane, rows", 1, KARST_SHAPE_ROWS, false, true},
    {"1 lane, groups", 1, KARST_SHAPE_GROUPS, false, false}, {"16 lanes, groups", 16, KARST_SHAPE_GROUPS, false, true},
    {"16 lanes, tape", 16, KARST_SHAPE_ROWS, true, false},   {"1 lane, tape", 1, KARST_SHAPE_GROUPS, true, true}};
static const int levels[] = {0, 1, 3, 5, 8, 11};
#define NUM_LEVELS (sizeof levels / sizeof *levels)
static const int64_t far_away[][3] = {{0, 0, 0},
                                      {1000000000, 0, -700000001},
                                      {-1000000000000000, 0, 999999999999989},
                                      {999999999999999, 1000000000, -1000000000000000}};
#define NUM_FAR (sizeof far_away / sizeof *far_away)
#define NUM_POINTS 4096u

static bool is_full(void) { return getenv("KARST_TEST_FULL") != NULL; }

static karst_load *make_loads(shipped_world *world, uint32_t count)
{
    karst_load *loads = calloc(count, sizeof *loads);
    assert_non_null(loads);
    for (uint32_t n = 0; n < count; n++) {
        int level = levels[n % NUM_LEVELS];
        int64_t voxel[3];
        for (int axis = 0; axis < 3; axis++)
            voxel[axis] = world->surface[axis] + far_away[n / NUM_LEVELS % NUM_FAR][axis] +
                          (int64_t)(shipped_random(world) % 16384) - 8192;
        shipped_to_surface(world, voxel, (int64_t)1 << 15);
        loads[n] = (karst_load){.level = level, .state = KARST_STATE_UNKNOWN};
        for (int axis = 0; axis < 3; axis++)
            loads[n].origin[axis] = karst_node_origin(voxel[axis] >> (level + KARST_BRICK_CELLS_LOG2), level);
    }
    return loads;
}

/* Every load by one shape, into samples of layout->staging_stride floats each. */
static void evaluate(const shipped_world *world, int s, const karst_channel_layout *layout, const karst_load *loads,
                     uint32_t count, float *samples)
{
    karst_error error = {0};
    char options[KARST_WORLD_FILE_OPTIONS_BYTES];
    karst_density_program program;
    karst_context *context = shipped_context(shapes[s].lanes);
    void *words = karst_world_file_data(world->file, world->file->info.seed, &error);
    pool_expect(words, world->name, &error);
    karst_world_file_program(world->file, words, options, &program);
    const char *tape = "#include \"producers/language/tape/tape_world.clh\"\n";
    const karst_virtual_file file = {"world.clh", shapes[s].tape ? tape : program.source};
    karst_evaluator *evaluator =
        karst_evaluator_create(context, shapes[s].shape, layout, &file, program.options, &error);
    size_t size_bytes = count * (size_t)layout->staging_stride * sizeof(float);
    karst_buffer *data = karst_buffer_create(context, "test", program.data_bytes, words, &error);
    karst_buffer *load_buffer = karst_buffer_create(context, "test", count * sizeof *loads, loads, &error);
    karst_buffer *staging = karst_buffer_create(context, "test", size_bytes, NULL, &error);
    karst_buffer *scrubs = karst_buffer_create(context, "test", count * sizeof(karst_scrub), NULL, &error);
    pool_expect(evaluator && data && load_buffer && staging && scrubs, world->name, &error);
    karst_evaluator_set_data(evaluator, data);
    pool_expect(karst_evaluate_bricks(evaluator, load_buffer, count, staging, scrubs, &error) &&
                    karst_buffer_read(staging, 0, samples, size_bytes, &error),
                world->name, &error);
    free(words);
    karst_buffer_destroy(scrubs);
    karst_buffer_destroy(staging);
    karst_buffer_destroy(load_buffer);
    karst_buffer_destroy(data);
    karst_evaluator_destroy(evaluator);
    karst_context_destroy(context);
}

static const char points_source[] =
    "#include \"core/device/lanes.clh\"\n"
    "#include \"producers/steps/density.clh\"\n"
    "#include \"world.clh\"\n"
    "#if LANES == 16\n"
    "#define LOAD_LONG(p) vload16(0, p)\n"
    "#define LOAD_UINT(p) vload16(0, p)\n"
    "#else\n"
    "#define LOAD_LONG(p) (*(p))\n"
    "#define LOAD_UINT(p) (*(p))\n"
    "#endif\n"
    "K_WIDE __kernel __attribute__((reqd_work_group_size(1, 1, 1)))\n"
    "void points(K_GLOBAL const long *voxel, K_GLOBAL const uint *fraction, uint count, K_GLOBAL float *out,\n"
    "            K_GLOBAL const ulong *data)\n"
    "{\n"
    "    uint first = (uint)get_global_id(0) * LANES;\n"
    "    world_point_at at;\n"
    "    if (first >= count)\n"
    "        return;\n"
    "    for (uint a = 0; a < 3; a++) {\n"
    "        at.voxel[a] = LOAD_LONG(voxel + a * count + first);\n"
    "        at.fraction[a] = LOAD_UINT(fraction + a * count + first);\n"
    "    }\n"
    "    v_store_float(world_point(data, &at, (int)(first >> 4) % 13 - 1), out + first);\n"
    "}\n";

static void evaluate_points(const shipped_world *world, int lanes, const int64_t *voxel, const uint32_t *fraction,
                            float *results)
{
    karst_error error = {0};
    karst_context *context = shipped_context(lanes);
    const karst_virtual_file files[] = {{"points.cl", points_source}, {"world.clh", world->file->code.source}};
    karst_program *program = karst_program_build(context, "points.cl", "-DWORLD_HAS_DATA", files, 2, &error);
    pool_expect(program, world->name, &error);
    cl_kernel kernel = karst_program_kernel(program, "points", &error);
    void *words = karst_world_file_data(world->file, world->file->info.seed, &error);
    karst_buffer *data = karst_buffer_create(context, "test", world->file->data_bytes, words, &error);
    karst_buffer *voxels = karst_buffer_create(context, "test", 3 * NUM_POINTS * sizeof *voxel, voxel, &error);
    karst_buffer *fractions = karst_buffer_create(context, "test", 3 * NUM_POINTS * sizeof *fraction, fraction, &error);
    karst_buffer *out = karst_buffer_create(context, "test", NUM_POINTS * sizeof *results, NULL, &error);
    pool_expect(kernel && words && data && voxels && fractions && out, world->name, &error);
    uint32_t count = NUM_POINTS;
    pool_expect(KARST_ARGUMENTS(kernel, &error, KARST_BUFFER_ARG(voxels), KARST_BUFFER_ARG(fractions),
                                KARST_VALUE_ARG(count), KARST_BUFFER_ARG(out), KARST_BUFFER_ARG(data)) &&
                    karst_launch(context, kernel, KARST_STAGE_EVALUATE, NUM_POINTS / (unsigned)lanes, 1, &error) &&
                    karst_buffer_read(out, 0, results, NUM_POINTS * sizeof *results, &error),
                world->name, &error);
    free(words);
    clReleaseKernel(kernel);
    karst_buffer_destroy(out);
    karst_buffer_destroy(fractions);
    karst_buffer_destroy(voxels);
    karst_buffer_destroy(data);
    karst_program_destroy(program);
    karst_context_destroy(context);
}

/* ---- bricks ---- */

static void compare_brick(shipped_world *world, const karst_load *load, const float *host, const float *device, int s)
{
    for (int i = 0; i < KARST_BRICK_SAMPLES; i++)
        if (memcmp(&host[i], &device[i], sizeof host[i]) != 0)
            fail_msg("%s, %s: level %d, origin (%ld, %ld, %ld), sample %d: %a on the device, %a on the host",
                     world->name, shapes[s].name, load->level, load->origin[0], load->origin[1], load->origin[2], i,
                     device[i], host[i]);
}

static void compare_bricks(shipped_world *world)
{
    const uint32_t count = is_full() ? 2064 : 2 * NUM_LEVELS * NUM_FAR;
    karst_channel channels[] = {{.name = "density", .components = 1}};
    karst_channel_layout layout;
    karst_error error = {0};
    uint32_t num_distinct = 0, num_near = 0;
    assert_true(karst_channels_lay_out(channels, 1, &layout, &error));
    karst_load *loads = make_loads(world, count);
    float *host = malloc(count * sizeof(float) * KARST_BRICK_SAMPLES);
    float *device = malloc(count * sizeof(float) * layout.staging_stride);
    assert_true(host && device);
    for (uint32_t n = 0; n < count; n++) {
        float *samples = host + (size_t)n * KARST_BRICK_SAMPLES;
        uint32_t num_solid = 0;
        shipped_samples(world, loads[n].origin, loads[n].level, samples);
        for (int i = 0; i < KARST_BRICK_SAMPLES; i++)
            num_solid += samples[i] > 0;
        num_distinct += samples[0] != samples[KARST_BRICK_SAMPLES - 1];
        num_near += num_solid > 0 && num_solid < KARST_BRICK_SAMPLES;
    }
    for (int s = 0; s < NUM_SHAPES; s++) {
        if (shapes[s].only_full && !is_full())
            continue;
        evaluate(world, s, &layout, loads, count, device);
        for (uint32_t n = 0; n < count; n++)
            compare_brick(world, &loads[n], host + (size_t)n * KARST_BRICK_SAMPLES,
                          device + (size_t)n * layout.staging_stride, s);
    }
    print_message("%s: %u bricks, %.2f million voxels, %u bricks hold surface\n", world->name, count,
                  count * 1e-6 * KARST_BRICK_SAMPLES, num_near);
    assert_true(num_distinct > count / 3); /* or it would have compared constants */
    assert_true(num_near > 0);
    free(device);
    free(host);
    free(loads);
}

/* ---- points ---- */

static void compare_points(shipped_world *world)
{
    static int64_t voxel[3 * NUM_POINTS];
    static uint32_t fraction[3 * NUM_POINTS];
    static float results[NUM_POINTS];
    for (uint32_t n = 0; n < NUM_POINTS; n++) {
        int64_t at[3];
        for (int axis = 0; axis < 3; axis++)
            at[axis] =
                world->surface[axis] + far_away[n % NUM_FAR][axis] + (int64_t)(shipped_random(world) % 65536) - 32768;
        if (n % 2)
            shipped_to_surface(world, at, (int64_t)1 << 15);
        for (uint32_t axis = 0; axis < 3; axis++) {
            voxel[axis * NUM_POINTS + n] = at[axis];
            fraction[axis * NUM_POINTS + n] = n % 3 ? shipped_random(world) : 0;
        }
    }
    for (int lanes = is_full() ? 1 : 16; lanes <= 16; lanes += 15) { /* bricks of one lane run the same function */
        evaluate_points(world, lanes, voxel, fraction, results);
        for (uint32_t n = 0; n < NUM_POINTS; n++) {
            const int64_t at[3] = {voxel[n], voxel[NUM_POINTS + n], voxel[2 * NUM_POINTS + n]};
            const uint32_t part[3] = {fraction[n], fraction[NUM_POINTS + n], fraction[2 * NUM_POINTS + n]};
            int level = (int)(n >> 4) % 13 - 1;
            float host = shipped_density(world, at, part, level);
            if (memcmp(&host, &results[n], sizeof host) != 0)
                fail_msg("%s, points of %d lanes: level %d, voxel (%ld, %ld, %ld): %a on the device, %a on the host",
                         world->name, lanes, level, at[0], at[1], at[2], results[n], host);
        }
    }
}

/* ---- bounds: the same verdicts ---- */

enum { NUM_TILES = 256, FEW_TILES = 3 };

static void subdivide(const shipped_world *world, int lanes, const pool_node *parents, karst_node *nodes,
                      karst_tile_info *infos)
{
    karst_error error = {0};
    pool p;
    karst_context *context = shipped_context(lanes);
    karst_producer *producer =
        karst_world_file_producer(context, world->file, world->file->info.seed, NUM_TILES, &error);
    pool_expect(producer, world->name, &error);
    pool_open(&p, context, NUM_TILES, 1);
    pool_ask(&p, parents, NUM_TILES);
    p.work.num_loads = 0;
    pool_expect(karst_producer_answer(producer, &p.cache, &p.work, &error), world->name, &error);
    pool_read_tiles(&p, nodes, infos);
    /* a few at a time: lanes that have no node of their own help others */
    for (uint32_t first = 0; first + FEW_TILES <= NUM_TILES / 4; first += FEW_TILES) {
        karst_node few[FEW_TILES * KARST_TILE_NODES];
        karst_tile_info few_infos[FEW_TILES];
        pool_ask(&p, parents + first, FEW_TILES);
        p.work.num_loads = 0;
        pool_expect(karst_producer_answer(producer, &p.cache, &p.work, &error), world->name, &error);
        pool_read_tiles(&p, few, few_infos);
        assert_memory_equal(few, nodes + first * KARST_TILE_NODES, sizeof few);
    }
    pool_close(&p);
    karst_producer_destroy(producer);
    karst_context_destroy(context);
}

static void compare_bounds(shipped_world *world)
{
    static karst_node nodes[2][NUM_TILES * KARST_TILE_NODES];
    static karst_tile_info infos[2][NUM_TILES];
    pool_node parents[NUM_TILES];
    uint32_t num_constant = 0;
    for (uint32_t n = 0; n < NUM_TILES; n++) {
        int level = 1 + (int)(n % 11);
        int64_t voxel[3];
        for (int axis = 0; axis < 3; axis++)
            voxel[axis] =
                world->surface[axis] + far_away[n % NUM_FAR][axis] + (int64_t)(shipped_random(world) % 16384) - 8192;
        shipped_to_surface(world, voxel, (int64_t)1 << 15);
        parents[n].level = level;
        for (int axis = 0; axis < 3; axis++)
            parents[n].at[axis] = voxel[axis] >> (level + KARST_BRICK_CELLS_LOG2);
    }
    subdivide(world, 16, parents, nodes[0], infos[0]);
    subdivide(world, 1, parents, nodes[1], infos[1]);
    for (uint32_t i = 0; i < NUM_TILES * KARST_TILE_NODES; i++) {
        uint32_t state = KARST_NODE_STATE(nodes[0][i].link);
        num_constant += state == KARST_STATE_AIR || state == KARST_STATE_SOLID;
    }
    assert_memory_equal(nodes[0], nodes[1], sizeof nodes[0]);
    assert_memory_equal(infos[0], infos[1], sizeof infos[0]);
    assert_true(num_constant > NUM_TILES / 4 && num_constant < NUM_TILES * KARST_TILE_NODES);
}

static void test_same_bits(void **state)
{
    shipped_world world;
    shipped_open(&world, *state);
    compare_bricks(&world);
    compare_points(&world);
    compare_bounds(&world);
    shipped_close(&world);
}

/* A world takes 17 s of CPU time in all shapes; tests/worlds/test_golden has the bits of all worlds in one. */
int main(void) { return shipped_run("the same bits", test_same_bits, 5); }
