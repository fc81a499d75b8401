/* Bricks and samples a second of each step, on nodes of a shipped world near its surface. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "karst/data.h"
#include "producers/density/world_file.h"
#include "tests/support/pool.h"

#define CAPACITY 4096
#define TOP_LEVEL 10
#define NUM_STATES 8

typedef struct {
    pool_node *nodes;
    uint32_t count;
} node_list;

static void add(node_list *list, pool_node node)
{
    if ((list->count & (list->count - 1)) == 0) {
        list->nodes = realloc(list->nodes, (list->count ? 2 * list->count : 1) * sizeof *list->nodes);
        pool_expect(list->nodes, "out of memory", NULL);
    }
    list->nodes[list->count++] = node;
}

/* Answers the nodes in rounds, as loads or as subdivides. Nodes that came out open, or children that the bounds leave
 * open, go to `left` (may be NULL), the numbers of results by state to num_states. */
static void answer(karst_producer *producer, pool *p, const node_list *list, bool loads, node_list *left,
                   uint32_t num_states[NUM_STATES])
{
    static karst_node nodes[CAPACITY * KARST_TILE_NODES];
    static karst_tile_info infos[CAPACITY];
    static uint32_t states[CAPACITY];
    karst_error error = {0};
    for (uint32_t first = 0; first < list->count; first += CAPACITY) {
        uint32_t count = list->count - first < CAPACITY ? list->count - first : CAPACITY;
        pool_ask(p, list->nodes + first, count);
        if (loads)
            p->work.num_subdivides = 0;
        else
            p->work.num_loads = 0;
        pool_expect(karst_producer_answer(producer, &p->cache, &p->work, &error), "answer", &error);
        if (loads) {
            pool_read_results(p, states);
            for (uint32_t i = 0; i < count; i++) {
                num_states[states[i]]++;
                if (left && states[i] != KARST_STATE_AIR && states[i] != KARST_STATE_SOLID)
                    add(left, list->nodes[first + i]);
            }
            continue;
        }
        pool_read_tiles(p, nodes, infos);
        for (uint32_t i = 0; i < count * KARST_TILE_NODES; i++) {
            uint32_t state = KARST_NODE_STATE(nodes[i].link);
            num_states[state]++;
            if (left && state == KARST_STATE_LOST)
                add(left, pool_child(list->nodes[first + i / KARST_TILE_NODES], (int)(i % KARST_TILE_NODES)));
        }
    }
}

static void bench_world(const char *name, const char *device, int lanes, karst_shape shape, uint32_t most)
{
    karst_error error = {0};
    char path[4096], options[KARST_WORLD_FILE_OPTIONS_BYTES];
    karst_density_program program;
    karst_context *context = karst_context_create(device, lanes, NULL, &error);
    pool_expect(context, "context", &error);
    pool_expect(karst_data_find("worlds", name, ".karst", path, sizeof path, &error), name, &error);
    karst_world_file *file = karst_world_file_open(path, NULL, 0, NULL, &error);
    pool_expect(file, name, &error);
    void *data = karst_world_file_data(file, file->info.seed, &error);
    pool_expect(data, name, &error);
    karst_world_file_program(file, data, options, &program);
    program.shape = shape;
    program.max_loads = CAPACITY;
    karst_producer *producer = karst_density_producer_create_program(context, &program, &error);
    pool_expect(producer, name, &error);
    pool p;
    pool_open(&p, context, CAPACITY, 1);

    printf("%s, %d lanes, %s\n", name, lanes, shape == KARST_SHAPE_GROUPS ? "groups" : "rows");
    printf("  level   tiles  open %%  us/tile    loads  constant %%  clear %%  us/load: evaluate  finalise   "
           "Msamples/s\n");
    node_list list = {0};
    for (int i = 0; i < 8; i++)
        add(&list, (pool_node){{(i & 1) - 1, (i >> 1 & 1) - 1, (i >> 2) - 1}, TOP_LEVEL});
    answer(producer, &p, &list, false, NULL, (uint32_t[NUM_STATES]){0}); /* the first launches compile */
    answer(producer, &p, &list, true, NULL, (uint32_t[NUM_STATES]){0});
    for (int level = TOP_LEVEL - 1; level >= 0 && list.count; level--) {
        node_list open = {0}, bricks = {0};
        uint32_t children[NUM_STATES] = {0}, results[NUM_STATES] = {0};
        uint64_t ns[KARST_NUM_STAGES] = {0};
        pool_expect(karst_profile_collect(context, ns, &error), "profile", &error);
        memset(ns, 0, sizeof ns);
        answer(producer, &p, &list, false, &open, children);
        answer(producer, &p, &open, true, &bricks, results);
        pool_expect(karst_profile_collect(context, ns, &error), "profile", &error);
        double num_loads = open.count ? open.count : 1,
               evaluate_us = (double)ns[KARST_STAGE_EVALUATE] * 1e-3 / num_loads;
        printf("  %5d %7u %7.1f %8.2f %8u %11.1f %8.1f %19.1f %9.1f %12.1f\n", level, list.count,
               100.0 * open.count / (8.0 * list.count), (double)ns[KARST_STAGE_SUBDIVIDE] * 1e-3 / list.count,
               open.count, 100.0 * (open.count - bricks.count) / num_loads,
               100.0 * (results[KARST_STATE_CLEAR_AIR] + results[KARST_STATE_CLEAR_SOLID]) / num_loads, evaluate_us,
               (double)ns[KARST_STAGE_FINALISE] * 1e-3 / num_loads, KARST_BRICK_SAMPLES / evaluate_us);
        if (bricks.count > most) { /* go on with a spread of them */
            for (uint32_t i = 0; i < most; i++)
                bricks.nodes[i] = bricks.nodes[(uint64_t)i * bricks.count / most];
            bricks.count = most;
        }
        free(open.nodes);
        free(list.nodes);
        list = bricks;
    }
    free(list.nodes);
    pool_close(&p);
    karst_producer_destroy(producer);
    karst_context_destroy(context);
    free(data);
    karst_world_file_destroy(file);
}

int main(int argc, char **argv)
{
    const char *device = getenv("KARST_DEVICE");
    bool all = argc > 1 && !strcmp(argv[1], "--shapes");
    static const char *const names[] = {"hills", "asteroid"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        bench_world(names[i], device, 16, KARST_SHAPE_ROWS, 256);
        if (all) {
            bench_world(names[i], device, 1, KARST_SHAPE_ROWS, 32);
            bench_world(names[i], device, 1, KARST_SHAPE_GROUPS, 32);
        }
    }
    return 0;
}
