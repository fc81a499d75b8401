/* Golden hashes of every shipped world: a change of any bit of its samples or of its encoded bricks is noticed. If it
 * is meant (the world was edited, or noise became another), the failing test says the new line for golden.h. */
#include "producers/steps/load_shared.h"
#include "tests/worlds/golden.h"
#include "tests/worlds/shipped.h"

enum { EACH = 6 };
static const int levels[] = {0, 1, 3, 5, 8};
#define NUM_LOADS (EACH * (uint32_t)(sizeof levels / sizeof *levels))

/* Beside one another at the surface that the camera sees, at several levels, and the same place 10^15 voxels away. */
static void choose_nodes(shipped_world *world, pool_node nodes[NUM_LOADS])
{
    for (uint32_t n = 0; n < NUM_LOADS; n++) {
        int level = levels[n / EACH], i = (int)(n % EACH);
        int64_t voxel[3];
        for (int axis = 0; axis < 3; axis++)
            voxel[axis] = world->surface[axis];
        voxel[0] += (i % 3 - 1) * ((int64_t)1 << (level + KARST_BRICK_CELLS_LOG2));
        voxel[2] += i >= 3 ? 1000000000000000 : 0;
        shipped_to_surface(world, voxel, (int64_t)1 << (level + 8));
        nodes[n].level = level;
        for (int axis = 0; axis < 3; axis++)
            nodes[n].at[axis] = voxel[axis] >> (level + KARST_BRICK_CELLS_LOG2);
    }
}

static uint64_t hash_samples(shipped_world *world, const pool_node *nodes)
{
    uint64_t hash = POOL_HASH_START;
    float samples[KARST_BRICK_SAMPLES];
    int64_t origin[3];
    for (uint32_t n = 0; n < NUM_LOADS; n++) {
        for (int axis = 0; axis < 3; axis++)
            origin[axis] = karst_node_origin(nodes[n].at[axis], nodes[n].level);
        shipped_samples(world, origin, nodes[n].level, samples);
        hash = pool_hash(hash, samples, sizeof samples);
    }
    return hash;
}

/* States, and what lies in the slots of those that are bricks. */
static uint64_t hash_bricks(shipped_world *world, const pool_node *nodes, uint32_t *num_bricks)
{
    karst_error error = {0};
    uint32_t states[NUM_LOADS];
    uint64_t hash = POOL_HASH_START;
    pool p;
    karst_context *context = shipped_context(0);
    karst_producer *producer =
        karst_world_file_producer(context, world->file, world->file->info.seed, NUM_LOADS, &error);
    pool_expect(producer, world->name, &error);
    pool_open(&p, context, NUM_LOADS, 1);
    pool_ask(&p, nodes, NUM_LOADS);
    p.work.num_subdivides = 0;
    pool_expect(karst_producer_answer(producer, &p.cache, &p.work, &error), world->name, &error);
    pool_read_results(&p, states);
    *num_bricks = 0;
    for (uint32_t n = 0; n < NUM_LOADS; n++) {
        struct {
            int16_t q[KARST_BRICK_SAMPLES + 1]; /* even, so that there is no gap */
            karst_brick_info info;
        } brick = {0};
        hash = pool_hash(hash, &states[n], sizeof states[n]);
        if (states[n] != KARST_STATE_BRICK)
            continue;
        ++*num_bricks;
        pool_read_brick(&p, n, brick.q, &brick.info);
        hash = pool_hash(hash, brick.q, KARST_BRICK_SAMPLES * sizeof *brick.q);
        hash = pool_hash(hash, &brick.info, offsetof(karst_brick_info, solid)); /* the rest follows from q */
    }
    pool_close(&p);
    karst_producer_destroy(producer);
    karst_context_destroy(context);
    return hash;
}

static void test_golden(void **state)
{
    shipped_world world;
    pool_node nodes[NUM_LOADS];
    uint32_t num_bricks;
    const golden_hashes *expected = NULL;
    shipped_open(&world, *state);
    choose_nodes(&world, nodes);
    uint64_t samples = hash_samples(&world, nodes), bricks = hash_bricks(&world, nodes, &num_bricks);
    assert_true(num_bricks >= EACH);
    for (size_t i = 0; i < sizeof golden / sizeof *golden; i++)
        if (!strcmp(golden[i].name, world.name))
            expected = &golden[i];
    if (!expected || samples != expected->samples || bricks != expected->bricks)
        fail_msg("%s of %s changed; if that is meant, its line is\n{\"%s\", 0x%016lx, 0x%016lx},",
                 expected && samples == expected->samples ? "the encoding" : "the samples", world.name, world.name,
                 samples, bricks);
    shipped_close(&world);
}

int main(void) { return shipped_run("golden", test_golden, 1); }
