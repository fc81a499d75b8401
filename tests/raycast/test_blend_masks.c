/* Where rays look while levels blend: nowhere less, and nowhere else, than two bricks' samples call for. */
#include "core/device/context.h"
#include "tests/raycast/casting.h"

#define NUM_PAIRS 2000
#define NUM_FINE 512
#define SIDE KARST_BRICK_SIDE

static const char probe[] =
    "#include \"raycast/cast/blend_masks.clh\"\n"
    "K_WIDE __kernel __attribute__((reqd_work_group_size(1, 1, 1)))\n"
    "void probe_masks(K_GLOBAL const karst_brick_info *infos, K_GLOBAL const uint *fines, uint count,\n"
    "                 K_GLOBAL uint *out)\n"
    "{\n"
    "    const uint i = (uint)get_global_id(0);\n"
    "    if (i >= count)\n"
    "        return;\n"
    "    const karst_brick_info own = infos[2 * i], parent = infos[2 * i + 1];\n"
    "    K_GLOBAL const uint *fine = fines + 2 * i * KARST_FINE_WORDS;\n"
    "    const parent_blocks there = blocks_in_child(fine + KARST_FINE_WORDS, &parent, i % 8);\n"
    "    const blend_masks open = open_when_blended(fine, &own, &there);\n"
    "    out += i * (KARST_FINE_WORDS + 2);\n"
    "    out[0] = open.lo;\n"
    "    out[1] = open.hi;\n"
    "#if LANES == 16\n"
    "    for (int word = 0; word < KARST_FINE_WORDS; word++)\n"
    "        out[2 + word] = ((const uint *)&open.fine)[word];\n"
    "#endif\n"
    "}\n";

typedef struct {
    uint32_t blocks[2], fine[KARST_FINE_WORDS];
} masks;

/* A node's brick and its parent's, of which it is child `pair % 8`. */
typedef struct {
    int16_t samples[2][KARST_BRICK_STRIDE];
    karst_brick_info info[2];
} pair;

static uint32_t fine_bit(const pair *p, int of_parent, int x, int y, int z)
{
    const uint32_t *fine = (const uint32_t *)(const void *)(p->samples[of_parent] + KARST_BRICK_PADDED);
    const int bit = x + 8 * y + 64 * z;
    return fine[bit / 32] >> bit % 32 & 1;
}

/* Waves from 6 samples long about a level, which both bricks share: that may leave both sides, one, or one but for a
 * corner. */
static void fill(pair *p, uint64_t *random)
{
    const double level = 5 * (2 * next_random(random) - 1);
    for (int i = 0; i < 2; i++) {
        double wave[3][4];
        for (int k = 0; k < 3; k++) {
            random_direction(random, wave[k]);
            const double rate = 6.283 / (6 + 60 * next_random(random));
            for (int a = 0; a < 3; a++)
                wave[k][a] *= rate;
            wave[k][3] = 6.283 * next_random(random);
        }
        for (int z = 0; z < SIDE; z++)
            for (int y = 0; y < SIDE; y++)
                for (int x = 0; x < SIDE; x++) {
                    double sum = level;
                    for (int k = 0; k < 3; k++)
                        sum += sin(wave[k][0] * x + wave[k][1] * y + wave[k][2] * z + wave[k][3]);
                    p->samples[i][x + SIDE * (y + SIDE * z)] = (int16_t)(1000 * sum);
                }
        p->info[i] = scene_brick_info(p->samples[i], 1);
    }
}

/* By the samples themselves, which fine blocks have a surface, or may have when blended; and by the rules with one part
 * left out. */
enum { WHOLE, NO_OWN, NO_PARENT, NO_SIDES, NO_DOUBT, NUM_RULES };

typedef struct {
    bool open, doubted; /* doubted: a clear block whose side is not known */
} judged;

static judged judge(const pair *p, int child, int rule, int x, int y, int z)
{
    bool open = false, doubted = false;
    int side[2];
    for (int i = 0; i < 2; i++) {
        const int at[3] = {i ? 4 * (child & 1) + x / 2 : x, i ? 4 * (child >> 1 & 1) + y / 2 : y,
                           i ? 4 * (child >> 2) + z / 2 : z};
        int before[3], first = 0;
        for (int a = 0; a < 3; a++)
            before[a] = at[a] < 7 ? at[a] : 6;
        const bool mixed = fine_bit(p, i, at[0], at[1], at[2]);
        open |= mixed && rule != (i ? NO_PARENT : NO_OWN);
        doubted |= !mixed && fine_bit(p, i, before[0], before[1], before[2]);
        for (int a = 2; a >= 0; a--)
            first = first * SIDE + (rule == NO_DOUBT ? (before[a] + 1) / 2 * 4 : 2 * at[a]);
        side[i] = p->samples[i][first] > 0;
    }
    return (judged){open || (side[0] != side[1] && rule != NO_SIDES), doubted};
}

static void probe_masks(int lanes, const pair *pairs, masks *got)
{
    karst_error error = {0};
    karst_context *context = contexts[lanes == 1];
    const karst_virtual_file file = {"probe.cl", probe};
    karst_program *program = karst_program_build(context, "probe.cl", "", &file, 1, &error);
    scene_check(program, &error);
    cl_kernel kernel = karst_program_kernel(program, "probe_masks", &error);
    scene_check(kernel, &error);
    karst_brick_info *infos = malloc(2 * NUM_PAIRS * sizeof(*infos));
    uint32_t *fines = malloc(2 * NUM_PAIRS * KARST_FINE_BYTES);
    for (int i = 0; i < 2 * NUM_PAIRS; i++) {
        infos[i] = pairs[i / 2].info[i % 2];
        memcpy(fines + (size_t)i * KARST_FINE_WORDS, pairs[i / 2].samples[i % 2] + KARST_BRICK_PADDED,
               KARST_FINE_BYTES);
    }
    karst_buffer *in = scene_buffer(context, "infos", 2 * NUM_PAIRS * sizeof(*infos)),
                 *masks_in = scene_buffer(context, "fines", 2 * NUM_PAIRS * KARST_FINE_BYTES),
                 *out = scene_buffer(context, "masks", NUM_PAIRS * sizeof(masks));
    scene_check(karst_buffer_write(in, 0, infos, in->size_bytes, &error) &&
                    karst_buffer_write(masks_in, 0, fines, masks_in->size_bytes, &error),
                &error);
    const uint32_t count = NUM_PAIRS;
    const size_t items = NUM_PAIRS, one = 1;
    clSetKernelArg(kernel, 0, sizeof(cl_mem), &in->mem);
    clSetKernelArg(kernel, 1, sizeof(cl_mem), &masks_in->mem);
    clSetKernelArg(kernel, 2, sizeof(count), &count);
    clSetKernelArg(kernel, 3, sizeof(cl_mem), &out->mem);
    assert_int_equal(clEnqueueNDRangeKernel(context->queue, kernel, 1, NULL, &items, &one, 0, NULL, NULL), CL_SUCCESS);
    scene_check(karst_buffer_read(out, 0, got, NUM_PAIRS * sizeof(masks), &error), &error);
    karst_buffer_destroy(in);
    karst_buffer_destroy(masks_in);
    karst_buffer_destroy(out);
    clReleaseKernel(kernel);
    karst_program_destroy(program);
    free(infos);
    free(fines);
}

static pair *make_pairs(void)
{
    uint64_t random = 11;
    pair *pairs = malloc(NUM_PAIRS * sizeof(*pairs));
    for (int i = 0; i < NUM_PAIRS; i++)
        fill(&pairs[i], &random);
    return pairs;
}

/* Every rule is needed here: with any left out, blocks would be passed that are to be looked at. */
static void test_fine_blocks_are_those_of_the_samples(void **state)
{
    (void)state;
    pair *pairs = make_pairs();
    masks *got = malloc(NUM_PAIRS * sizeof(*got));
    probe_masks(16, pairs, got);
    int num_open = 0, num_doubted = 0, num_passed[NUM_RULES] = {0};
    for (int i = 0; i < NUM_PAIRS; i++) {
        uint32_t blocks[2] = {0, 0};
        for (int bit = 0; bit < NUM_FINE; bit++) {
            const int x = bit % 8, y = bit / 8 % 8, z = bit / 64, block = x / 2 + 4 * (y / 2) + 16 * (z / 2);
            const judged whole = judge(&pairs[i], i % 8, WHOLE, x, y, z);
            const bool is_open = got[i].fine[bit / 32] >> bit % 32 & 1;
            if (is_open != (whole.open || whole.doubted))
                fail_msg("pair %d, fine block %d %d %d: %d", i, x, y, z, is_open);
            blocks[block / 32] |= (uint32_t)is_open << block % 32;
            num_open += whole.open;
            num_doubted += whole.doubted && !whole.open;
            for (int rule = NO_OWN; rule < NUM_RULES; rule++) {
                const judged without = judge(&pairs[i], i % 8, rule, x, y, z);
                num_passed[rule] += whole.open && !without.open && (rule == NO_DOUBT || !without.doubted);
            }
        }
        assert_memory_equal(blocks, got[i].blocks, sizeof(blocks));
    }
    print_message("%d open of %d, %d more in doubt; passed without own, parent's, sides, doubts: %d %d %d %d\n",
                  num_open, NUM_PAIRS * NUM_FINE, num_doubted, num_passed[NO_OWN], num_passed[NO_PARENT],
                  num_passed[NO_SIDES], num_passed[NO_DOUBT]);
    for (int rule = NO_OWN; rule < NUM_RULES; rule++)
        assert_true(num_passed[rule] > 0);
    assert_true(num_open < NUM_PAIRS * NUM_FINE / 2 && num_doubted < num_open / 10);
    free(got);
    free(pairs);
}

/* One ray alone looks at whole blocks: those that have a fine block of either brick's with both signs, and those with
 * one that is on different sides; of clear blocks all are alike. */
static void test_blocks_of_one_lane_are_those_of_the_samples(void **state)
{
    (void)state;
    pair *pairs = make_pairs();
    masks *got = malloc(NUM_PAIRS * sizeof(*got));
    probe_masks(1, pairs, got);
    for (int i = 0; i < NUM_PAIRS; i++)
        for (int block = 0; block < 64; block++) {
            bool open = pairs[i].info[0].blocks[block / 32] >> block % 32 & 1;
            for (int k = 0; k < 8; k++) {
                const judged whole = judge(&pairs[i], i % 8, WHOLE, block % 4 * 2 + (k & 1),
                                           block / 4 % 4 * 2 + (k >> 1 & 1), block / 16 * 2 + (k >> 2));
                open |= whole.open || whole.doubted;
            }
            /* whether it is doubted depends on blocks beside, of which one that is open says enough */
            if ((got[i].blocks[block / 32] >> block % 32 & 1) != open)
                fail_msg("pair %d, block %d: %d", i, block, !open);
        }
    free(got);
    free(pairs);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_fine_blocks_are_those_of_the_samples),
        cmocka_unit_test(test_blocks_of_one_lane_are_those_of_the_samples),
    };
    return cmocka_run_group_tests(tests, open_contexts, close_contexts);
}
