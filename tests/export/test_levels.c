/* Levels of a mesh: whatever level each chunk is shown at, they are one surface; edges stay sharp, vertices where they
 * are, and neither threads nor places make a difference. */
#include "tests/export/found_mesh.h"

enum { MOST_CHUNKS = 64, NUM_LEVELS = 4 };

typedef struct {
    karst_mesh_chunk chunks[MOST_CHUNKS]; /* copies */
    size_t num_chunks;
    karst_mesh_stats stats;
    karst_mesh_level_stats levels;
} found_levels;

static void *copy_of(const void *from, size_t size_bytes)
{
    void *copy = malloc(size_bytes + 1);
    assert_non_null(copy);
    memcpy(copy, from, size_bytes);
    return copy;
}

static bool take_chunk(void *user, const karst_mesh_chunk *chunk, karst_error *error)
{
    found_levels *f = user;
    (void)error;
    assert_true(f->num_chunks < MOST_CHUNKS);
    karst_mesh_chunk *copy = &f->chunks[f->num_chunks++];
    *copy = *chunk;
    copy->vertices = copy_of(chunk->vertices, chunk->num_vertices[0] * sizeof *chunk->vertices);
    for (int level = 0; level < chunk->num_levels; level++)
        copy->triangles[level] =
            copy_of(chunk->triangles[level], chunk->num_triangles[level] * sizeof *chunk->triangles[level]);
    return true;
}

static found_levels *find_levels(const karst_world *world, const karst_mesh_config *config)
{
    found_levels *f = calloc(1, sizeof *f);
    karst_error error = {0};
    const karst_mesh_chunk_sink sink = {.chunk = take_chunk, .user = f};
    assert_non_null(f);
    if (!karst_mesh_find_levels(world, config, NUM_LEVELS, &sink, &f->stats, &f->levels, &error))
        fail_msg("%s", error.message);
    assert_int_equal(f->levels.num_chunks, f->num_chunks);
    return f;
}

static void drop_levels(found_levels *f)
{
    for (size_t i = 0; i < f->num_chunks; i++) {
        free((void *)(uintptr_t)f->chunks[i].vertices);
        for (int level = 0; level < NUM_LEVELS; level++)
            free((void *)(uintptr_t)f->chunks[i].triangles[level]);
    }
    free(f);
}

/* ---- chunks side by side ---- */

typedef struct {
    karst_mesh_vertex vertex;
    uint32_t own; /* its place among all */
} numbered;

static int compare_vertices(const void *a, const void *b)
{
    return memcmp(&((const numbered *)a)->vertex, &((const numbered *)b)->vertex, sizeof(karst_mesh_vertex));
}

/* One mesh of all chunks, each at its own level; vertices that are the same become one. */
static found_mesh put_together(const found_levels *f, const int *level_of)
{
    found_mesh m = {0};
    size_t num = 0;
    for (size_t i = 0; i < f->num_chunks; i++) {
        num += f->chunks[i].num_vertices[level_of[i]];
        m.num_triangles += f->chunks[i].num_triangles[level_of[i]];
    }
    numbered *all = calloc(num + 1, sizeof *all);
    uint32_t *merged = calloc(num + 1, sizeof *merged);
    m.vertices = calloc(num + 1, sizeof *m.vertices);
    m.triangles = calloc(m.num_triangles + 1, sizeof *m.triangles);
    assert_true(all && merged && m.vertices && m.triangles);
    num = m.num_triangles = 0;
    for (size_t i = 0; i < f->num_chunks; i++) {
        const karst_mesh_chunk *c = &f->chunks[i];
        for (size_t t = 0; t < c->num_triangles[level_of[i]]; t++, m.num_triangles++)
            for (int k = 0; k < 3; k++) {
                const uint32_t index = c->triangles[level_of[i]][t][k];
                assert_true(index < c->num_vertices[level_of[i]]);
                m.triangles[m.num_triangles][k] = index + (uint32_t)num;
            }
        for (size_t v = 0; v < c->num_vertices[level_of[i]]; v++, num++)
            all[num] = (numbered){.vertex = c->vertices[v], .own = (uint32_t)num};
    }
    qsort(all, num, sizeof *all, compare_vertices);
    for (size_t i = 0; i < num; i++) {
        if (i == 0 || compare_vertices(&all[i - 1], &all[i]) != 0)
            m.vertices[m.num_vertices++] = all[i].vertex;
        merged[all[i].own] = (uint32_t)m.num_vertices - 1;
    }
    for (size_t i = 0; i < 3 * m.num_triangles; i++)
        m.triangles[i / 3][i % 3] = merged[m.triangles[i / 3][i % 3]];
    free(all);
    free(merged);
    return m;
}

static void check_together(const found_levels *f, const karst_mesh_config *config, const int *level_of, bool is_closed,
                           const char *what)
{
    found_mesh m = put_together(f, level_of);
    size_t num_open;
    const char *wrong = what_is_wrong(&m, config, &num_open);
    if (*wrong)
        fail_msg("%s: %s", what, wrong);
    if (is_closed)
        assert_int_equal(num_open, 0);
    drop_mesh(&m);
}

/* All at one level, and each at one of its own. */
static void check_any_levels(const found_levels *f, const karst_mesh_config *config, bool is_closed, const char *what)
{
    int level_of[MOST_CHUNKS];
    uint32_t random = 1;
    for (int trial = 0; trial < NUM_LEVELS + (f->num_chunks > 1 ? 5 : 0); trial++) {
        for (size_t i = 0; i < f->num_chunks; i++) {
            random = random * 1664525u + 1013904223u;
            level_of[i] = trial < NUM_LEVELS ? trial : (int)(random >> 16) % NUM_LEVELS;
        }
        check_together(f, config, level_of, is_closed, what);
    }
}

typedef struct {
    karst_mesh_vertex ends[2];
} placed_edge;

static int compare_edges(const void *a, const void *b) { return memcmp(a, b, sizeof(placed_edge)); }

/* Edges with one triangle, from place to place. */
static placed_edge *open_edges(const karst_mesh_chunk *c, int level, size_t *num_open)
{
    const size_t num = 3 * c->num_triangles[level];
    half_edge *edges = calloc(num + 1, sizeof *edges);
    placed_edge *open = calloc(num + 1, sizeof *open);
    assert_true(edges && open);
    for (size_t i = 0; i < num; i++) {
        const uint32_t *t = c->triangles[level][i / 3];
        edges[i] = (half_edge){t[i % 3], t[(i + 1) % 3], (uint32_t)(i / 3)};
    }
    qsort(edges, num, sizeof *edges, compare_half_edges);
    *num_open = 0;
    for (size_t i = 0; i < num; i++)
        if (!find_half_edge(edges, num, edges[i].to, edges[i].from))
            open[(*num_open)++] = (placed_edge){{c->vertices[edges[i].from], c->vertices[edges[i].to]}};
    qsort(open, *num_open, sizeof *open, compare_edges);
    free(edges);
    return open;
}

/* The edges in which a finer level ends are edges of the coarser one: no crack, and no vertex in the middle of one. */
static size_t check_borders(const found_levels *f)
{
    size_t num_all = 0;
    for (size_t i = 0; i < f->num_chunks; i++) {
        size_t num_finest;
        placed_edge *finest = open_edges(&f->chunks[i], 0, &num_finest);
        num_all += num_finest;
        for (int level = 1; level < NUM_LEVELS; level++) {
            size_t num;
            placed_edge *coarser = open_edges(&f->chunks[i], level, &num);
            assert_int_equal(num, num_finest);
            assert_memory_equal(coarser, finest, num * sizeof *finest);
            free(coarser);
        }
        free(finest);
    }
    return num_all;
}

/* Land of several chunks, with overhangs and holes as wide as cells. */
static void test_land(void **state)
{
    (void)state;
    karst_world *world =
        world_of("/*{ \"voxel\": 0.25 }*/\nfloat density(vec3 p) { return 6.0 * noise(p * 0.07) + 1.5 * "
                 "noise(p * 0.31) - 0.4 * p.y; }\n");
    const int64_t width = getenv("KARST_TEST_QUICK") ? 135 : 160;
    const karst_mesh_config config = box_of(world, "-70", "-24", "11", width, 48, 136, 1);
    found_levels *f = find_levels(world, &config);
    found_mesh whole = find_mesh(world, &config);
    assert_int_equal(f->levels.num_triangles[0], whole.num_triangles);
    assert_int_equal(f->stats.num_vertices, whole.num_vertices);
    const size_t num_open = check_borders(f);
    check_any_levels(f, &config, false, "land");
    print_message("land: %zu chunks, %zu edges between them and at the box; triangles %llu, %llu, %llu, %llu\n",
                  f->num_chunks, num_open, (unsigned long long)f->levels.num_triangles[0],
                  (unsigned long long)f->levels.num_triangles[1], (unsigned long long)f->levels.num_triangles[2],
                  (unsigned long long)f->levels.num_triangles[3]);
    assert_true(f->num_chunks >= 4 && num_open > 400);
    for (int level = 1; level < NUM_LEVELS; level++)
        assert_true(f->levels.num_triangles[level] < f->levels.num_triangles[level - 1] / 2);
    drop_mesh(&whole);
    drop_levels(f);
    karst_world_close(world);
}

/* ---- shapes ---- */

/* Across eight chunks. Each level is closed, and as near as its cells. */
static void test_sphere(void **state)
{
    (void)state;
    karst_world *world = world_of("/*{ \"voxel\": 0.25 }*/\nfloat density(vec3 p) { return 30.3 - length(p); }\n");
    const karst_mesh_config config = box_of(world, "-127", "-127", "-127", 200, 200, 200, 1);
    found_levels *f = find_levels(world, &config);
    assert_int_equal(f->num_chunks, 8);
    check_borders(f);
    check_any_levels(f, &config, true, "sphere");
    for (int level = 0; level < NUM_LEVELS; level++) {
        double farthest = 0;
        for (size_t i = 0; i < f->num_chunks; i++) {
            const karst_mesh_chunk *c = &f->chunks[i];
            for (size_t t = 0; t < c->num_triangles[level]; t++) {
                double middle[3] = {-127, -127, -127};
                for (int k = 0; k < 9; k++)
                    middle[k % 3] += (double)c->vertices[c->triangles[level][t][k / 3]].position[k % 3] / 3;
                farthest = fmax(
                    farthest, fabs(sqrt(middle[0] * middle[0] + middle[1] * middle[1] + middle[2] * middle[2]) - 30.3));
            }
            assert_true(c->moved_m[level] <= ldexp(0.5, level));
        }
        print_message("sphere, level %d: %llu triangles, middles within %.3f cells\n", level,
                      (unsigned long long)f->levels.num_triangles[level], farthest);
        assert_true(farthest < 0.1 * ldexp(1, level));
    }
    assert_true(f->levels.num_triangles[3] < f->levels.num_triangles[0] / 16);
    drop_levels(f);
    karst_world_close(world);
}

/* Flat sides and sharp edges lose triangles and nothing else. */
static void test_sharp(void **state)
{
    (void)state;
    karst_world *world = world_of(
        "/*{ \"voxel\": 0.25 }*/\n"
        "float density(vec3 p) { vec3 q = p / 27.0; float d = max(abs(q.x), max(abs(q.y), abs(q.z))) - 1.0, s = 1.0;\n"
        "  for (int m = 0; m < 2; m++) { vec3 a = mod(q * s, 2.0) - 1.0; s *= 3.0; vec3 r = abs(1.0 - 3.0 * abs(a));\n"
        "    d = max(d, (min(max(r.x, r.y), min(max(r.y, r.z), max(r.z, r.x))) - 1.0) / s); }\n"
        "  return -d * 27.0; }\n");
    const karst_mesh_config config = box_of(world, "-28.4", "-28.3", "-28.7", 57, 57, 57, 1);
    found_levels *f = find_levels(world, &config);
    check_any_levels(f, &config, true, "menger");
    const double volume = 54.0 * 54 * 54 * (20.0 / 27) * (20.0 / 27);
    assert_int_equal(f->num_chunks, 1);
    /* Cells of level 3 are wider than its holes. */
    for (int level = 0; level < 3; level++) {
        found_mesh m = put_together(f, &level);
        print_message("menger: level %d has %zu triangles, volume %.6f of what it should be\n", level, m.num_triangles,
                      volume_of(&m) / volume);
        assert_true(fabs(volume_of(&m) / volume - 1) < (level < 2 ? 1e-5 : 1e-3));
        assert_true(m.num_triangles < f->levels.num_triangles[0] / (level ? 3.5 : 0.9));
        drop_mesh(&m);
    }
    drop_levels(f);
    karst_world_close(world);
}

static void test_threads(void **state)
{
    (void)state;
    karst_world *world = world_of("/*{ \"voxel\": 0.25 }*/\nfloat density(vec3 p) { return 20.0 - length(mod(p, "
                                  "64.0) - 32.0); }\n");
    karst_mesh_config config = box_of(world, "3", "0", "0", 140, 64, 64, 1);
    config.num_threads = 1;
    found_levels *a = find_levels(world, &config);
    config.num_threads = 4;
    found_levels *b = find_levels(world, &config);
    assert_int_equal(a->num_chunks, b->num_chunks);
    for (size_t i = 0; i < a->num_chunks; i++) {
        const karst_mesh_chunk *x = &a->chunks[i], *y = &b->chunks[i];
        assert_memory_equal(x->at, y->at, sizeof x->at);
        assert_memory_equal(x->num_vertices, y->num_vertices, sizeof x->num_vertices);
        assert_memory_equal(x->num_triangles, y->num_triangles, sizeof x->num_triangles);
        assert_memory_equal(x->vertices, y->vertices, x->num_vertices[0] * sizeof *x->vertices);
        for (int level = 0; level < NUM_LEVELS; level++)
            assert_memory_equal(x->triangles[level], y->triangles[level],
                                x->num_triangles[level] * sizeof *x->triangles[level]);
    }
    drop_levels(a);
    drop_levels(b);
    karst_world_close(world);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_land),
        cmocka_unit_test(test_sphere),
        cmocka_unit_test(test_sharp),
        cmocka_unit_test(test_threads),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
