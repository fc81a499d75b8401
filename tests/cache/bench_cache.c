/* What collect and publish cost in a large cache: settled, and with a thousand wants, as free slots or what was not
 * used lately give room for them. Wall clock in ms: medians, and of collect what 95 and 99 % of rounds stay within
 * (of few rounds: all); machines are noisy, so what counts is how it follows the wants. */
#include <stdio.h>
#include <stdlib.h>

#include "core/device/profile.h"
#include "tests/support/cache_rig.h"

#define NUM_BRICKS 65536
#define NUM_TILES 300000
#define NUM_ROUNDS 101 /* at most; free slots are used up after some */
#define FEW_ROUNDS 15
#define NUM_WANTS 1000
/* Of a collect's median. All lines count; frames of flights are like those of 10 and 100 wants. */
#define MARK_NS 500000

static cache_rig rig;
static uint64_t random_state = 1;

static uint32_t random_below(uint32_t end)
{
    random_state = random_state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)((random_state >> 33) % end);
}

static int compare(const void *a, const void *b)
{
    uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

/* Asks at every `stride`-th node from `first` on, as long as it wants something, until `num` wants are made. */
static void ask(uint32_t first, uint32_t stride, uint32_t num, bool bricks)
{
    for (uint32_t node = first % rig.num_nodes; num > 0; node = (node + stride) % rig.num_nodes) {
        const karst_tile_info *info = &rig.tiles[node / 8];
        if (node < 8 || !info->in_use ||
            (bricks ? rig.nodes[node].brick != 0 : KARST_NODE_CHILDREN(rig.nodes[node].link) != 0 || !info->level))
            continue;
        (bricks ? rig.want_brick : rig.want_children)[node] = rig.want_chunk[node / KARST_REQUEST_CHUNK] = rig.serial;
        num--;
    }
}

/* Uses this share of all tiles and bricks, in percent. */
static void use(uint32_t share)
{
    for (uint32_t tile = 1; tile < NUM_TILES; tile++)
        if (random_below(100) < share)
            rig.tile_stamp[tile] = rig.serial;
    for (uint32_t brick = 1; brick < NUM_BRICKS; brick++)
        if (random_below(100) < share)
            rig.brick_stamp[brick] = rig.serial;
}

/* With KARST_BENCH_SPANS: what a collect did when, in us. */
static void print_spans(uint64_t collect_ns)
{
    static karst_span spans[256];
    uint64_t ns[KARST_NUM_STAGES];
    if (!getenv("KARST_BENCH_SPANS") || !karst_profile_collect(rig.context, ns, NULL))
        return;
    size_t num = karst_profile_spans(rig.context, spans, 256);
    for (size_t i = 0; i < num && i < 256; i++)
        printf("    %8.1f to %8.1f  %5.1f  %s\n", (double)(spans[i].start_ns - spans[0].start_ns) * 1e-3,
               (double)(spans[i].end_ns - spans[0].start_ns) * 1e-3,
               (double)(spans[i].end_ns - spans[i].start_ns) * 1e-3, spans[i].name);
    printf("    %8.1f in all\n", (double)collect_ns * 1e-3);
}

/* Times rounds with wants of either kind; `stride` scatters them, `casts` go by between rounds. */
static void measure(const char *name, int num_rounds, uint32_t num_wants, uint32_t stride, uint32_t share, int casts)
{
    uint64_t collect_ns[NUM_ROUNDS], publish_ns[NUM_ROUNDS];
    uint32_t num_produced = 0, num_evicted = 0;
    for (int round = 0; round < num_rounds; round++) {
        for (int i = 0; i < casts; i++) {
            rig_cast(&rig);
            use(share);
        }
        uint32_t first = 8 + random_below(rig.num_nodes / 2);
        ask(first, stride, num_wants / 2, false);
        ask(first, stride, num_wants - num_wants / 2, true);
        if (round == num_rounds - 1)
            karst_profile_collect(rig.context, (uint64_t[KARST_NUM_STAGES]){0}, NULL);
        rig_collect(&rig, KARST_CACHE_MAX_WORK, KARST_CACHE_MAX_WORK, false);
        if (round == num_rounds - 1)
            print_spans(rig.collect_ns);
        rig_produce(&rig);
        rig_publish(&rig);
        collect_ns[round] = rig.collect_ns;
        publish_ns[round] = rig.publish_ns;
        num_produced += rig.work.num_loads + rig.work.num_subdivides;
        num_evicted += rig.work.num_evicted_bricks + rig.work.num_evicted_tiles;
    }
    qsort(collect_ns, num_rounds, sizeof(collect_ns[0]), compare);
    qsort(publish_ns, num_rounds, sizeof(publish_ns[0]), compare);
    printf("%-52s collect %7.3f %-7s  p95 %7.3f  p99 %7.3f  publish %7.3f   (%u produced, %u evicted a round)\n", name,
           (double)collect_ns[num_rounds / 2] * 1e-6, collect_ns[num_rounds / 2] < MARK_NS ? "met" : "not met",
           (double)collect_ns[num_rounds * 95 / 100] * 1e-6, (double)collect_ns[num_rounds * 99 / 100] * 1e-6,
           (double)publish_ns[num_rounds / 2] * 1e-6, num_produced / (uint32_t)num_rounds,
           num_evicted / (uint32_t)num_rounds);
    fflush(stdout);
}

/* Work of a pool that fills for the first time goes to slots in a row: two writes. */
static void produce_in_a_row(void)
{
    uint32_t num = rig.work.num_subdivides, *states = malloc(KARST_CACHE_MAX_WORK * sizeof(*states));
    karst_tile_info *infos = calloc(num + 1, sizeof(*infos));
    karst_node *nodes = calloc((num + 1) * 8, sizeof(*nodes));
    rig_expect(states && infos && nodes, "out of memory", NULL);
    for (uint32_t i = 0; i < num; i++) {
        uint32_t node = rig.subdivide_nodes[i];
        infos[i] = (karst_tile_info){.level = rig.tiles[node / 8].level - 1, .parent = KARST_NO_NODE};
        for (int axis = 0; axis < 3; axis++)
            infos[i].corner[axis] = 2 * (rig.tiles[node / 8].corner[axis] + (node >> axis & 1));
        for (uint32_t j = 0; j < 8; j++)
            nodes[i * 8 + j].link = KARST_NODE_LINK(KARST_STATE_LOST, KARST_NONE);
    }
    for (uint32_t i = 0; i < rig.work.num_loads; i++)
        states[i] = KARST_STATE_BRICK;
    karst_error error = {0};
    rig_expect(karst_buffer_write(rig.pools->tile_info, rig.subdivide_tiles[0] * sizeof(*infos), infos,
                                  num * sizeof(*infos), &error) &&
                   karst_buffer_write(rig.pools->nodes, rig.subdivide_tiles[0] * 8 * sizeof(*nodes), nodes,
                                      num * 8 * sizeof(*nodes), &error) &&
                   karst_buffer_write(rig.work.load_results, 0, states, rig.work.num_loads * sizeof(*states), &error),
               "write", &error);
    free(states);
    free(infos);
    free(nodes);
}

static void fill_until(uint32_t num_tiles, uint32_t num_bricks)
{
    uint32_t tiles = 0, bricks = 0;
    for (;;) {
        karst_cache_count_resident(rig.cache, &tiles, &bricks, NULL);
        if (tiles >= num_tiles && bricks >= num_bricks)
            return;
        rig_cast(&rig);
        uint32_t more = num_tiles - tiles < KARST_CACHE_MAX_WORK ? num_tiles - tiles : KARST_CACHE_MAX_WORK;
        ask(8, 1, more < 7 * tiles ? more : 7 * tiles, false);
        more = num_bricks - bricks < KARST_CACHE_MAX_WORK ? num_bricks - bricks : KARST_CACHE_MAX_WORK;
        ask(8, 1, more < tiles ? more : tiles, true);
        rig_collect(&rig, KARST_CACHE_MAX_WORK, KARST_CACHE_MAX_WORK, false);
        produce_in_a_row();
        rig_publish(&rig);
    }
}

int main(void)
{
    karst_error error = {0};
    karst_context *context = karst_context_create("", 0, NULL, &error);
    rig_expect(context, "karst_context_create", &error);
    rig_open(&rig, context, NUM_TILES, NUM_BRICKS, 0, 20);
    rig.skip_check = true;
    karst_profile_trace(context, getenv("KARST_BENCH_SPANS") != NULL, NULL);
    printf("cache of %d tiles and %d bricks on %s, ms; mark: collect under 0.5\n", NUM_TILES, NUM_BRICKS,
           context->name);
    fill_until(250000, 50000);
    measure("no wants", NUM_ROUNDS, 0, 1, 50, 1);
    measure("10 wants side by side, slots free", FEW_ROUNDS, 10, 1, 50, 1);
    measure("1000 wants side by side, slots free", FEW_ROUNDS, NUM_WANTS, 1, 50, 1);
    measure("1000 wants all over the pool, slots free", FEW_ROUNDS, NUM_WANTS, 997, 50, 1);
    fill_until(NUM_TILES - 1, NUM_BRICKS - 1);
    rig_cast(&rig);
    use(100);
    rig_collect(&rig, 0, 0, false);
    measure("100 wants side by side, pools full, half in use", NUM_ROUNDS, 100, 1, 50, 1);
    measure("100 wants all over the pool, full, half in use", NUM_ROUNDS, 100, 997, 50, 1);
    measure("1000 wants side by side, pools full, half in use", NUM_ROUNDS, NUM_WANTS, 1, 50, 1);
    measure("1000 wants all over the pool, full, half in use", NUM_ROUNDS, NUM_WANTS, 997, 50, 1);
    measure("1000 wants side by side, full, 97 % in use", NUM_ROUNDS, NUM_WANTS, 1, 97, 1);
    measure("no wants, pools full", NUM_ROUNDS, 0, 1, 97, 1);
    rig.skip_check = false;
    rig_check(&rig);
    rig_close(&rig);
    karst_context_destroy(context);
    return 0;
}
