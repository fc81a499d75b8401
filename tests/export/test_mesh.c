/* Meshes are surfaces (watertight, manifold, turned the right way), lie on the true one with its normals, keep sharp
 * edges, and depend neither on threads nor on where in the world they are. */
#include "tests/export/found_mesh.h"

#include "core/export/cell.h"

/* ---- cells ---- */

/* For each sign of the corners and each choice of the crossed faces: pieces go round, and each edge that crosses the
 * surface is of one. */
static void test_cells(void **state)
{
    (void)state;
    int num_seen[KARST_CELL_MAX_PIECES + 1] = {0};
    for (unsigned solid = 0; solid < 256; solid++)
        for (unsigned centres = 0; centres < 64; centres++) {
            signed char piece_of[KARST_CELL_EDGES];
            const int num = karst_cell_pieces(solid, centres, piece_of);
            assert_in_range(num, solid == 0 || solid == 255 ? 0 : 1, KARST_CELL_MAX_PIECES);
            num_seen[num]++;
            int edges_of[KARST_CELL_MAX_PIECES] = {0};
            for (int edge = 0; edge < KARST_CELL_EDGES; edge++) {
                int corners[2];
                karst_edge_corners(edge, corners);
                const bool crosses = (solid >> corners[0] & 1) != (solid >> corners[1] & 1);
                assert_int_equal(piece_of[edge] >= 0, crosses);
                if (crosses)
                    edges_of[piece_of[edge]]++;
            }
            for (int i = 0; i < num; i++)
                assert_in_range(edges_of[i], 3, KARST_CELL_EDGES);
            /* In a face a piece comes and goes as often. */
            for (int face = 0; face < KARST_CELL_FACES; face++) {
                int ends[KARST_CELL_MAX_PIECES] = {0};
                for (int i = 0; i < 4; i++)
                    if (piece_of[karst_face_edge(face, i)] >= 0)
                        ends[piece_of[karst_face_edge(face, i)]]++;
                for (int i = 0; i < num; i++)
                    assert_int_equal(ends[i] % 2, 0);
            }
        }
    for (int i = 0; i <= KARST_CELL_MAX_PIECES; i++)
        assert_true(num_seen[i] > 0);
}

/* ---- what a mesh is compared with ---- */

#define WITHIN_CELLS 0.02
#define NORMAL_DEG 0.1

typedef struct {
    size_t num_far, num_turned, num_smooth;
} misses;

/* Vertices without both solid and air so near to them, and normals against the gradient. */
static misses compare_with_world(const karst_world *world, const karst_mesh_config *config, const found_mesh *m)
{
    misses found = {0};
    const int voxel_log2_m = karst_world_get_metadata(world)->voxel_log2_m;
    karst_sampler *sampler = karst_sampler_create(world, NULL);
    assert_non_null(sampler);
    for (size_t i = 0; i < m->num_vertices; i++) {
        const karst_mesh_vertex *v = &m->vertices[i];
        karst_sample gradient[3];
        double at_m[3], length = 0, cosine = 0;
        bool is_solid = false, is_air = false;
        for (int axis = 0; axis < 3; axis++)
            at_m[axis] = (double)v->position[axis];
        const karst_position at = karst_position_add_m(config->corner, at_m, voxel_log2_m);
        for (int way = 0; way < 27 && !(is_solid && is_air); way++) {
            const double offset[3] = {way % 3 - 1, way / 3 % 3 - 1, way / 9 - 1};
            const double size = sqrt(offset[0] * offset[0] + offset[1] * offset[1] + offset[2] * offset[2]);
            double offset_m[3];
            for (int axis = 0; axis < 3; axis++)
                offset_m[axis] = size > 0 ? WITHIN_CELLS * config->cell_m * offset[axis] / size : 0;
            const karst_position beside = karst_position_add_m(at, offset_m, voxel_log2_m);
            if (karst_sampler_density(sampler, &beside, config->footprint_m).device > 0)
                is_solid = true;
            else
                is_air = true;
        }
        found.num_far += !is_solid || !is_air;
        assert_true(karst_sampler_gradient(sampler, &at, config->footprint_m, gradient, NULL));
        for (int axis = 0; axis < 3; axis++) {
            length += gradient[axis].precise * gradient[axis].precise;
            cosine -= gradient[axis].precise * (double)v->normal[axis];
        }
        found.num_turned += !(cosine > cos(NORMAL_DEG * acos(-1) / 180) * sqrt(length));
    }
    karst_sampler_destroy(sampler);
    return found;
}

static void check_surface(const found_mesh *m, const karst_mesh_config *config, bool is_closed, const char *what)
{
    size_t num_open;
    const char *wrong = what_is_wrong(m, config, &num_open);
    if (*wrong)
        fail_msg("%s: %s", what, wrong);
    if (is_closed != (num_open == 0))
        fail_msg("%s: %zu edges at the box's faces", what, num_open);
    assert_true(m->num_triangles > 0);
}

/* ---- shapes ---- */

static void test_sphere(void **state)
{
    (void)state;
    karst_world *world = world_of("/*{ \"voxel\": 0.25 }*/\nfloat density(vec3 p) { return 40.3 - length(p - "
                                  "vec3(0.21, -0.37, 0.11)); }\n");
    const karst_mesh_config config = box_of(world, "-45", "-45", "-45", 90, 90, 90, 1);
    found_mesh m = find_mesh(world, &config);
    check_surface(&m, &config, true, "sphere");
    assert_int_equal(m.num_vertices, m.num_triangles / 2 + 2); /* Euler */
    const misses found = compare_with_world(world, &config, &m);
    assert_int_equal(found.num_far, 0);
    assert_int_equal(found.num_turned, 0);
    for (size_t i = 0; i < m.num_vertices; i++) {
        const double at[3] = {(double)m.vertices[i].position[0] - 45.21, (double)m.vertices[i].position[1] - 44.63,
                              (double)m.vertices[i].position[2] - 45.11};
        const double radius = sqrt(at[0] * at[0] + at[1] * at[1] + at[2] * at[2]);
        assert_true(fabs(radius - 40.3) < 0.002);
    }
    const double volume = 4.0 / 3 * acos(-1) * 40.3 * 40.3 * 40.3;
    assert_true(fabs(volume_of(&m) / volume - 1) < 0.002);
    /* Most of the box is never looked at. */
    assert_true((double)m.stats.num_open_cells < 0.45 * m.stats.num_cells);
    drop_mesh(&m);
    karst_world_close(world);
}

/* Triangles whose middle is not on the surface of a body with flat sides. */
static size_t count_off(const karst_world *world, const karst_mesh_config *config, const found_mesh *m)
{
    karst_sampler *sampler = karst_sampler_create(world, NULL);
    size_t num_off = 0;
    assert_non_null(sampler);
    for (size_t i = 0; i < m->num_triangles; i++) {
        double middle_m[3] = {0};
        for (int k = 0; k < 9; k++)
            middle_m[k % 3] += (double)m->vertices[m->triangles[i][k / 3]].position[k % 3] / 3;
        const karst_position at =
            karst_position_add_m(config->corner, middle_m, karst_world_get_metadata(world)->voxel_log2_m);
        num_off += fabs(karst_sampler_density(sampler, &at, 0).precise) > 0.01;
    }
    karst_sampler_destroy(sampler);
    return num_off;
}

/* Turned so that no side lies along an axis: without sharp edges the middles of triangles would be off by parts of a
 * cell. */
static void test_turned_box(void **state)
{
    (void)state;
    karst_world *world = world_of(
        "/*{ \"voxel\": 0.25 }*/\n"
        "float density(vec3 p) { vec3 q = vec3(0.8 * p.x + 0.6 * p.z, p.y, 0.8 * p.z - 0.6 * p.x);\n"
        "  q = vec3(q.x, 0.28 * q.z + 0.96 * q.y, 0.96 * q.z - 0.28 * q.y); q = abs(q) - vec3(9.3, 6.2, 12.7);\n"
        "  return -max(q.x, max(q.y, q.z)); }\n");
    const karst_mesh_config config = box_of(world, "-20.2", "-20.1", "-20.3", 40, 40, 40, 1);
    found_mesh m = find_mesh(world, &config);
    check_surface(&m, &config, true, "turned box");
    const size_t num_off = count_off(world, &config, &m);
    print_message("turned box: %zu of %zu triangles are off the sides by 0.01 cells\n", num_off, m.num_triangles);
    assert_true(num_off < m.num_triangles / 1000);
    const double volume = 8 * 9.3 * 6.2 * 12.7;
    assert_true(fabs(volume_of(&m) / volume - 1) < 5e-4);
    assert_true(m.stats.num_sharp > 100 && m.stats.num_sharp < m.num_vertices / 4);
    drop_mesh(&m);
    karst_world_close(world);
}

/* Edges outwards and inwards, and corners of all kinds: what is left of the cube is known exactly. */
static void test_menger(void **state)
{
    (void)state;
    karst_world *world = world_of(
        "/*{ \"voxel\": 0.25 }*/\n"
        "float density(vec3 p) { vec3 q = p / 27.0; float d = max(abs(q.x), max(abs(q.y), abs(q.z))) - 1.0, s = 1.0;\n"
        "  for (int m = 0; m < 2; m++) { vec3 a = mod(q * s, 2.0) - 1.0; s *= 3.0; vec3 r = abs(1.0 - 3.0 * abs(a));\n"
        "    d = max(d, (min(max(r.x, r.y), min(max(r.y, r.z), max(r.z, r.x))) - 1.0) / s); }\n"
        "  return -d * 27.0; }\n");
    const karst_mesh_config config = box_of(world, "-28.4", "-28.3", "-28.7", 57, 57, 57, 1);
    found_mesh m = find_mesh(world, &config);
    check_surface(&m, &config, true, "menger");
    const double volume = 54.0 * 54 * 54 * (20.0 / 27) * (20.0 / 27);
    print_message("menger: volume %.6f of what it should be, %zu triangles\n", volume_of(&m) / volume,
                  m.num_triangles);
    assert_true(fabs(volume_of(&m) / volume - 1) < 1e-5);
    assert_int_equal(count_off(world, &config, &m), 0);
    drop_mesh(&m);
    karst_world_close(world);
}

static void test_hills(void **state)
{
    (void)state;
    karst_world *world = shipped_world("hills");
    karst_mesh_config config = box_of(world, "-30", "-100", "40", 60, 70, 60, 1);
    for (int i = 0; i < 2; i++) {
        config.footprint_m = i ? 1 : 0;
        found_mesh m = find_mesh(world, &config);
        check_surface(&m, &config, false, "hills");
        const misses found = compare_with_world(world, &config, &m);
        print_message("hills: %zu vertices, %zu too far off, %zu turned, %llu sharp\n", m.num_vertices, found.num_far,
                      found.num_turned, (unsigned long long)m.stats.num_sharp);
        assert_int_equal(found.num_far, 0);
        assert_true(found.num_turned <= m.stats.num_sharp);
        drop_mesh(&m);
    }
    karst_world_close(world);
}

/* Features as small as cells: pieces meet in every way, twice in a face too. */
static void test_tangled(void **state)
{
    (void)state;
    static const char *const texts[] = {
        "/*{ \"voxel\": 0.25 }*/\nfloat density(vec3 p) { return noise(p * 0.7); }\n",
        "/*{ \"voxel\": 0.25 }*/\nfloat density(vec3 p) { return noise(p * 0.35) + 0.5 * noise(p * 0.9 + 7.0); }\n",
        "/*{ \"voxel\": 0.25 }*/\nfloat density(vec3 p) { return sin(p.x * 2.1) * sin(p.y * 2.3) * sin(p.z * 1.9); }\n",
        "/*{ \"voxel\": 0.25 }*/\nfloat density(vec3 p) { return noise(p * 0.6) > 0.0 ? 1.0 : 0.0; }\n"};
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        karst_world *world = world_of(texts[i]);
        const int64_t width = getenv("KARST_TEST_QUICK") ? 12 : 48;
        const karst_mesh_config config = box_of(world, "-24", "3", "-11", width, 40, width, 1);
        found_mesh m = find_mesh(world, &config);
        check_surface(&m, &config, false, texts[i]);
        const misses found = compare_with_world(world, &config, &m);
        print_message("tangled %zu: %zu vertices, %zu too far off\n", i, m.num_vertices, found.num_far);
        assert_int_equal(found.num_far, 0);
        drop_mesh(&m);
        karst_world_close(world);
    }
}

/* ---- what it does not depend on ---- */

static void test_anywhere(void **state)
{
    (void)state;
    karst_world *world = world_of("/*{ \"voxel\": 0.25 }*/\nfloat density(vec3 p) { return 20.0 - length(mod(p, "
                                  "64.0) - 32.0); }\n");
    karst_mesh_config config = box_of(world, "0.5", "0", "0", 64, 64, 64, 1);
    config.num_threads = 1;
    found_mesh first = find_mesh(world, &config);
    check_surface(&first, &config, true, "near");
    config = box_of(world, "1125899906842624.5", "-1125899906842624", "70368744177664", 64, 64, 64, 1);
    config.num_threads = 4;
    found_mesh second = find_mesh(world, &config);
    assert_int_equal(first.num_vertices, second.num_vertices);
    assert_int_equal(first.num_triangles, second.num_triangles);
    assert_memory_equal(first.vertices, second.vertices, first.num_vertices * sizeof *first.vertices);
    assert_memory_equal(first.triangles, second.triangles, first.num_triangles * sizeof *first.triangles);
    drop_mesh(&first);
    drop_mesh(&second);
    karst_world_close(world);
}

static double area_of(const found_mesh *m)
{
    double area = 0;
    for (size_t i = 0; i < m->num_triangles; i++) {
        double a[3], b[3];
        for (int k = 0; k < 3; k++) {
            a[k] = (double)m->vertices[m->triangles[i][1]].position[k] -
                   (double)m->vertices[m->triangles[i][0]].position[k];
            b[k] = (double)m->vertices[m->triangles[i][2]].position[k] -
                   (double)m->vertices[m->triangles[i][0]].position[k];
        }
        area += sqrt(pow(a[1] * b[2] - a[2] * b[1], 2) + pow(a[2] * b[0] - a[0] * b[2], 2) +
                     pow(a[0] * b[1] - a[1] * b[0], 2)) /
                2;
    }
    return area;
}

/* The triangles of two boxes that touch are those of the box that both make. */
static void test_boxes_meet(void **state)
{
    (void)state;
    karst_world *world = shipped_world("hills");
    for (int axis = 0; axis < 3; axis++) {
        karst_mesh_config whole = box_of(world, "-30", "-80", "40", 48, 48, 48, 1), half = whole;
        found_mesh m = find_mesh(world, &whole), parts[2];
        double offset_m[3] = {0};
        half.num_cells[axis] = 19;
        parts[0] = find_mesh(world, &half);
        offset_m[axis] = 19;
        half.corner =
            karst_position_add_m(whole.corner, offset_m, karst_world_get_metadata(world)->voxel_log2_m);
        half.num_cells[axis] = 48 - 19;
        parts[1] = find_mesh(world, &half);
        assert_int_equal(m.num_triangles, parts[0].num_triangles + parts[1].num_triangles);
        assert_true(fabs(area_of(&m) / (area_of(&parts[0]) + area_of(&parts[1])) - 1) < 1e-6);
        drop_mesh(&m);
        drop_mesh(&parts[0]);
        drop_mesh(&parts[1]);
    }
    karst_world_close(world);
}

static void test_edits(void **state)
{
    (void)state;
    karst_world *world = world_of("/*{ \"voxel\": 0.25 }*/\nfloat density(vec3 p) { return -p.y - 100.0; }\n");
    karst_mesh_config config = box_of(world, "-20", "-20", "-20", 40, 40, 40, 1);
    found_mesh m = find_mesh(world, &config);
    assert_int_equal(m.num_triangles, 0);
    drop_mesh(&m);
    const karst_edit edit = {.shape = KARST_EDIT_SPHERE, .mode = KARST_EDIT_ADD, .radius_m = 9};
    config.edits = &edit;
    config.num_edits = 1;
    m = find_mesh(world, &config);
    check_surface(&m, &config, true, "edited");
    assert_true(fabs(volume_of(&m) / (4.0 / 3 * acos(-1) * 729) - 1) < 0.02);
    drop_mesh(&m);
    karst_world_close(world);
}

static bool stop(void *user, double share)
{
    (void)share;
    return ++*(int *)user < 2;
}

static void test_refusals(void **state)
{
    (void)state;
    karst_world *world = world_of("/*{ \"voxel\": 0.25 }*/\nfloat density(vec3 p) { return -p.y; }\n");
    const karst_mesh_config good = box_of(world, "-64", "-8", "-64", 128, 16, 128, 1);
    const karst_mesh_sink sink = {.vertices = take_vertices, .triangles = take_triangles};
    karst_mesh_config bad[8];
    for (size_t i = 0; i < 8; i++)
        bad[i] = good;
    bad[0].cell_m = 0;
    bad[1].cell_m = (double)NAN;
    bad[2].num_cells[1] = 0;
    bad[3].num_cells[2] = KARST_MESH_MAX_CELLS + 1;
    bad[4].footprint_m = -1;
    bad[5].corner.voxel[0] = (int64_t)1 << 61;
    bad[6].num_threads = 257;
    bad[7].cell_m = 1e30;
    for (size_t i = 0; i < 8; i++) {
        karst_error error = {0};
        assert_false(karst_mesh_find(world, &bad[i], &sink, NULL, &error));
        assert_int_equal(error.status, KARST_USAGE);
    }
    /* Stopped: no file. */
    int num_asked = 0;
    karst_error error = {0};
    assert_false(karst_mesh_write(world, &good, "/tmp/karst_mesh_stopped.ply", KARST_MESH_OF_SUFFIX, stop, &num_asked,
                                  NULL, &error));
    assert_int_equal(error.status, KARST_FAILED);
    assert_int_not_equal(access("/tmp/karst_mesh_stopped.ply", F_OK), 0);
    karst_world_close(world);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_cells),       cmocka_unit_test(test_sphere),   cmocka_unit_test(test_turned_box),
        cmocka_unit_test(test_menger),      cmocka_unit_test(test_hills),    cmocka_unit_test(test_tangled),
        cmocka_unit_test(test_anywhere),    cmocka_unit_test(test_edits),    cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_boxes_meet),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
