/* Depth shared with a rasteriser: against closed forms, against OpenGL, and pictures that end at it. */
#include <dlfcn.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include <GL/gl.h>

#include "karst/karst.h"
#include "tests/support/ok.h"

enum { WIDTH = 400, HEIGHT = 300, NUM = WIDTH * HEIGHT, SMALL_WIDTH = 64, SMALL_HEIGHT = 48, OSMESA_RGBA = GL_RGBA };

/* y = 0.25 x - 0.125 z - 3: what a plane is in all levels, to the last bit of a float's density. */
static const char plane_text[] =
    "/*{ \"voxel\": 0.0625, \"view\": 2000,\n"
    "\"camera\": { \"position\": [\"1\", \"2\", \"-3\"], \"yaw\": 25, \"pitch\": -12, \"fov\": 60 } }*/\n"
    "float density(vec3 p) { return 0.25 * p.x - 0.125 * p.z - 3.0 - p.y; }\n";
static const char land_text[] =
    "/*{ \"voxel\": 0.25, \"view\": 600,\n"
    "\"camera\": { \"position\": [\"0\", \"26\", \"0\"], \"yaw\": 0, \"pitch\": -25, \"fov\": 60 } }*/\n"
    "float density(vec3 p) { return 18.0 * fbm(p / 60.0, 3) - p.y; }\n";
static const double plane[3] = {0.25, -1, -0.125}, plane_at = -3;

static char plane_path[64], land_path[64];

static bool write_world(char path[64], const char *text)
{
    snprintf(path, 64, "/tmp/karst-depth-XXXXXX.karst");
    int fd = mkstemps(path, 6);
    bool done = fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text);
    close(fd);
    return done;
}

static int set_up(void **state)
{
    (void)state;
    return write_world(plane_path, plane_text) && write_world(land_path, land_text) ? 0 : 1;
}

static int tear_down(void **state)
{
    (void)state;
    return unlink(plane_path) | unlink(land_path);
}

static karst_engine *open_engine(const char *path, int width_px, int height_px, bool refine)
{
    karst_error error = {0};
    karst_engine *engine = karst_engine_create(&(karst_engine_config){.world = path,
                                                                      .display = KARST_DISPLAY_NONE,
                                                                      .width_px = width_px,
                                                                      .height_px = height_px,
                                                                      .refine = refine,
                                                                      .pool_bytes = (uint64_t)64 << 20},
                                               &error);
    if (!engine)
        fail_msg("%s", error.message);
    return engine;
}

static void settle(karst_engine *engine)
{
    bool settled;
    assert_ok(karst_engine_settle(engine, 300, NULL, NULL, &settled, &error));
    assert_true(settled);
}

/* The direction of a pixel's ray, its forward part 1, and the camera's place; in metres, in double. */
static void pixel_ray(const karst_camera *camera, int width, int height, double x, double y, double direction[3])
{
    double right[3], up[3], forward[3];
    karst_camera_axes(camera, right, up, forward);
    const double half = tan(camera->fov_deg * (M_PI / 360));
    const double across = (2 * x / width - 1) * half * width / height, above = (1 - 2 * y / height) * half;
    for (int i = 0; i < 3; i++)
        direction[i] = forward[i] + across * right[i] + above * up[i];
}

static void camera_place(const karst_engine *engine, double at[3])
{
    const karst_camera camera = karst_engine_camera(engine);
    const karst_position origin = {{0, 0, 0}, {0, 0, 0}};
    karst_position_difference_m(origin, camera.position, karst_engine_voxel_log2_m(engine), at);
}

/* Metres along the forward axis to the plane; INFINITY: the ray does not come to it. */
static double plane_z(const double at[3], const double direction[3])
{
    double slope = 0, height = -plane_at;
    for (int i = 0; i < 3; i++) {
        slope += plane[i] * direction[i];
        height -= plane[i] * at[i];
    }
    const double z = height / slope;
    return z > 0 ? z : INFINITY;
}

static double ulps(float a, float b)
{
    const float far = fmaxf(fabsf(a), fabsf(b));
    return far > 0 ? fabs((double)a - b) / (nextafterf(far, INFINITY) - far) : 0;
}

static const karst_depth_range ranges[] = {
    {0.1, 1000, false, false}, {0.1, INFINITY, false, true}, {0.1, 1000, true, true}, {0.1, INFINITY, true, false}};

static float depth_m[NUM], window[NUM], back_m[NUM], drawn[NUM];

static void test_a_planes_depth_is_its_own(void **state)
{
    (void)state;
    karst_engine *engine = open_engine(plane_path, WIDTH, HEIGHT, true);
    settle(engine);
    assert_ok(karst_engine_read_depth(engine, depth_m, NUM, &error));
    const karst_camera camera = karst_engine_camera(engine);
    double at[3];
    camera_place(engine, at);
    for (size_t r = 0; r < sizeof ranges / sizeof *ranges; r++) {
        assert_ok(karst_depth_to_window(&camera, WIDTH, HEIGHT, &ranges[r], depth_m, window, &error));
        int num = 0;
        double worst = 0, relative = 0;
        for (int i = 0; i < NUM; i++) {
            double direction[3];
            pixel_ray(&camera, WIDTH, HEIGHT, i % WIDTH + 0.5, i / WIDTH + 0.5, direction);
            const double z = plane_z(at, direction), n = 0.1, f = ranges[r].far_m;
            if (isinf(depth_m[i]) || z > 900)
                continue;
            double expected = isinf(f) ? (z - n) / z : f * (z - n) / (z * (f - n));
            if (ranges[r].reversed)
                expected = isinf(f) ? n / z : n * (f - z) / (z * (f - n));
            const double off = ulps((float)expected, window[i]);
            /* Reversed depths have a float's own precision all the way, so that of the ray shows. */
            if (ranges[r].reversed && off > 1)
                relative = fmax(relative, fabs(window[i] - expected) / (n / z));
            else
                worst = fmax(worst, off);
            num++;
        }
        print_message("range %zu: %d pixels, off by %.2f ulp at most, or by %.3g of near / z\n", r, num, worst,
                      relative);
        assert_true(worst <= 1 && relative < 0x1p-16);
        assert_true(num > NUM / 2);
    }
    karst_engine_destroy(engine);
}

static void test_depths_come_back(void **state)
{
    (void)state;
    karst_camera camera = {.yaw_deg = 10, .pitch_deg = 5, .fov_deg = 75};
    for (int i = 0; i < NUM; i++)
        depth_m[i] = i % 7 == 0 ? INFINITY : 0.5f * powf(1.0001f, (float)(i % 40000));
    for (size_t r = 0; r < sizeof ranges / sizeof *ranges; r++) {
        assert_ok(karst_depth_to_window(&camera, WIDTH, HEIGHT, &ranges[r], depth_m, window, &error));
        assert_ok(karst_depth_from_window(&camera, WIDTH, HEIGHT, &ranges[r], window, back_m, &error));
        for (int i = 0; i < NUM; i++) {
            assert_true(window[i] >= 0 && window[i] <= 1);
            if (isinf(depth_m[i]))
                assert_true(isinf(back_m[i]));
            else if (ranges[r].reversed)
                assert_true(fabsf(back_m[i] / depth_m[i] - 1) < 4e-7f * (1 + 1e-3f * depth_m[i]));
            else /* as well as a float near 1 can tell */
                assert_true(fabsf(back_m[i] / depth_m[i] - 1) < 1e-6f * (1 + depth_m[i]));
        }
    }
    const float odd[4] = {NAN, -3, 0, 1e30f};
    float out[4];
    assert_ok(karst_depth_to_window(&camera, 2, 2, &ranges[0], odd, out, &error));
    assert_true(out[0] == 1 && out[1] == 0 && out[2] == 0 && out[3] == 1);
    assert_ok(karst_depth_to_window(&camera, 2, 2, &ranges[3], odd, out, &error));
    assert_true(out[0] == 0 && out[1] == 1 && out[2] == 1);
    assert_ok(karst_depth_from_window(&camera, 2, 2, &ranges[0], (const float[4]){NAN, 1, 2, -1}, out, &error));
    assert_true(isinf(out[0]) && isinf(out[1]) && isinf(out[2]) && out[3] > 0.09f && out[3] < 0.2f);
}

/* The matrix says the same as the functions, in either clip space. */
static void test_matrix(void **state)
{
    (void)state;
    const karst_camera camera = {.yaw_deg = 130, .pitch_deg = -35, .fov_deg = 50};
    for (size_t r = 0; r < sizeof ranges / sizeof *ranges; r++) {
        float m[16];
        assert_ok(karst_depth_matrix(&camera, SMALL_WIDTH, SMALL_HEIGHT, &ranges[r], m, &error));
        for (int i = 0; i < SMALL_WIDTH * SMALL_HEIGHT; i++) {
            double d[3], clip[4] = {0, 0, 0, 0};
            const double x = i % SMALL_WIDTH + 0.5, y = i / SMALL_WIDTH + 0.5, z = 0.2 + i * 0.1;
            pixel_ray(&camera, SMALL_WIDTH, SMALL_HEIGHT, x, y, d);
            for (int row = 0; row < 4; row++)
                clip[row] = z * (m[row] * d[0] + m[4 + row] * d[1] + m[8 + row] * d[2]) + m[12 + row];
            depth_m[i] = (float)(z * sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]));
            drawn[i] = (float)(ranges[r].zero_to_one ? clip[2] / clip[3] : 0.5 + 0.5 * clip[2] / clip[3]);
            assert_true(fabs((clip[0] / clip[3] + 1) * 0.5 * SMALL_WIDTH - x) < 1e-4);
            assert_true(fabs((1 - clip[1] / clip[3]) * 0.5 * SMALL_HEIGHT - y) < 1e-4);
        }
        assert_ok(karst_depth_to_window(&camera, SMALL_WIDTH, SMALL_HEIGHT, &ranges[r], depth_m, window, &error));
        for (int i = 0; i < SMALL_WIDTH * SMALL_HEIGHT; i++)
            assert_true(fabsf(window[i] - drawn[i]) < 2e-6f);
    }
}

/* ---- OpenGL's own depth, by OSMesa ---- */

enum { PATCHES = 64, PATCH_M = 2 };
static void *(*get_proc)(const char *name);
#define GL_CALL(type, name) ((type)(uintptr_t)get_proc(name))

/* The plane as a fan around the place below the camera, into `drawn`, top row first; false: there is no OSMesa. */
static bool draw_plane(const karst_camera *camera, const double at[3], const karst_depth_range *range)
{
    void *library = dlopen("libOSMesa.so.8", RTLD_NOW);
    if (!library)
        return false;
    void *(*create)(GLenum, GLint, GLint, GLint, void *);
    GLboolean (*make_current)(void *, void *, GLenum, GLsizei, GLsizei);
    void (*destroy)(void *);
    *(void **)&create = dlsym(library, "OSMesaCreateContextExt");
    *(void **)&make_current = dlsym(library, "OSMesaMakeCurrent");
    *(void **)&destroy = dlsym(library, "OSMesaDestroyContext");
    *(void **)&get_proc = dlsym(library, "OSMesaGetProcAddress");
    void *context = create(OSMESA_RGBA, 32, 0, 0, NULL), *colours = malloc(NUM * 4);
    assert_true(context && colours && make_current(context, colours, GL_UNSIGNED_BYTE, WIDTH, HEIGHT));
    float matrix[16];
    assert_ok(karst_depth_matrix(camera, WIDTH, HEIGHT, range, matrix, &error));
    GL_CALL(void (*)(GLdouble), "glClearDepth")(1);
    GL_CALL(void (*)(GLbitfield), "glClear")(GL_DEPTH_BUFFER_BIT);
    GL_CALL(void (*)(GLenum), "glEnable")(GL_DEPTH_TEST);
    GL_CALL(void (*)(const GLfloat *), "glLoadMatrixf")(matrix);
    GL_CALL(void (*)(GLenum), "glBegin")(GL_QUADS);
    for (int patch = 0; patch < PATCHES * PATCHES; patch++)
        for (int corner = 0; corner < 4; corner++) {
            const double x = PATCH_M * (patch % PATCHES - PATCHES / 2 + (corner == 1 || corner == 2));
            const double z = PATCH_M * (patch / PATCHES - PATCHES / 2 + (corner >= 2));
            const double y = plane[0] * (at[0] + x) + plane[2] * (at[2] + z) + plane_at;
            GL_CALL(void (*)(GLfloat, GLfloat, GLfloat), "glVertex3f")((GLfloat)x, (GLfloat)(y - at[1]), (GLfloat)z);
        }
    GL_CALL(void (*)(void), "glEnd")();
    float *upside_down = malloc(NUM * sizeof *upside_down);
    assert_non_null(upside_down);
    GL_CALL(void (*)(GLint, GLint, GLsizei, GLsizei, GLenum, GLenum, void *), "glReadPixels")
    (0, 0, WIDTH, HEIGHT, GL_DEPTH_COMPONENT, GL_FLOAT, upside_down);
    for (int y = 0; y < HEIGHT; y++)
        memcpy(drawn + y * WIDTH, upside_down + (HEIGHT - 1 - y) * WIDTH, WIDTH * sizeof *drawn);
    free(upside_down);
    destroy(context);
    free(colours);
    return true;
}

static void test_a_rasteriser_has_the_same_depth(void **state)
{
    (void)state;
    karst_engine *engine = open_engine(plane_path, WIDTH, HEIGHT, true);
    settle(engine);
    assert_ok(karst_engine_read_depth(engine, depth_m, NUM, &error));
    const karst_camera camera = karst_engine_camera(engine);
    double at[3];
    camera_place(engine, at);
    karst_engine_destroy(engine);
    if (!draw_plane(&camera, at, &ranges[0]))
        skip();
    assert_ok(karst_depth_to_window(&camera, WIDTH, HEIGHT, &ranges[0], depth_m, window, &error));
    int num = 0, within[3] = {0};
    double own = 0;
    for (int i = 0; i < NUM; i++) {
        if (drawn[i] >= 0.9995f || isinf(depth_m[i]))
            continue;
        const double off = ulps(drawn[i], window[i]);
        double direction[3];
        pixel_ray(&camera, WIDTH, HEIGHT, i % WIDTH + 0.5, i / WIDTH + 0.5, direction);
        const double z = plane_z(at, direction), n = ranges[0].near_m, f = ranges[0].far_m;
        own = fmax(own, ulps(drawn[i], (float)(f * (z - n) / (z * (f - n)))));
        num++;
        for (int k = 0; k < 3; k++)
            within[k] += off <= 1 << k;
    }
    print_message("%d pixels; within 1, 2, 4 ulp of OpenGL's depth, itself off by up to %.0f: %.4f, %.4f, %.4f\n", num,
                  own, (double)within[0] / num, (double)within[1] / num, (double)within[2] / num);
    assert_true(num > NUM / 2);
    /* What is between them is the rasteriser's own rounding: its depths are interpolated in floats. */
    assert_true(within[0] >= 0.8 * num && within[2] >= 0.999 * num);
}

/* ---- pictures that end at a depth ---- */

static void test_land_ends_at_a_depth(void **state)
{
    (void)state;
    static uint8_t whole[NUM * 4], cut[NUM * 4], sky[NUM * 4];
    static float ends_m[NUM];
    karst_engine *engine = open_engine(land_path, WIDTH, HEIGHT, false);
    settle(engine);
    assert_ok(karst_engine_read_pixels(engine, whole, sizeof whole, &error));
    assert_ok(karst_engine_read_depth(engine, depth_m, NUM, &error));
    for (int i = 0; i < NUM; i++)
        ends_m[i] = INFINITY;
    assert_ok(karst_engine_set_depth(engine, ends_m, NUM, &error));
    settle(engine);
    assert_ok(karst_engine_read_pixels(engine, cut, sizeof cut, &error));
    assert_memory_equal(cut, whole, sizeof cut);

    /* All of it hidden: that is the sky. */
    for (int i = 0; i < NUM; i++)
        ends_m[i] = 0;
    assert_ok(karst_engine_set_depth(engine, ends_m, NUM, &error));
    settle(engine);
    assert_ok(karst_engine_read_pixels(engine, sky, sizeof sky, &error));
    karst_stats stats;
    karst_engine_stats(engine, &stats);
    assert_int_equal(stats.num_hits, 0);
    assert_int_equal(stats.num_rays[KARST_STREAM_SHADOW], 0);

    /* A disc at 40 m, in the middle of the picture: land before it is as it was, behind it is none. */
    int num_hidden = 0, num_before = 0;
    for (int i = 0; i < NUM; i++) {
        const double x = i % WIDTH - WIDTH / 2.0, y = i / WIDTH - HEIGHT / 2.0;
        ends_m[i] = x * x + y * y < 120 * 120 ? 40 : INFINITY;
    }
    assert_ok(karst_engine_set_depth(engine, ends_m, NUM, &error));
    settle(engine);
    assert_ok(karst_engine_read_pixels(engine, cut, sizeof cut, &error));
    assert_ok(karst_engine_read_depth(engine, back_m, NUM, &error));
    for (int i = 0; i < NUM; i++) {
        const bool hidden = depth_m[i] > ends_m[i];
        num_hidden += hidden && !isinf(depth_m[i]);
        num_before += !hidden && !isinf(ends_m[i]);
        assert_memory_equal(cut + 4 * i, (hidden ? sky : whole) + 4 * i, 4);
        assert_true(hidden ? isinf(back_m[i]) : back_m[i] == depth_m[i]);
    }
    assert_true(num_hidden > 1000 && num_before > 1000);

    assert_ok(karst_engine_set_depth(engine, NULL, 0, &error));
    settle(engine);
    assert_ok(karst_engine_read_pixels(engine, cut, sizeof cut, &error));
    assert_memory_equal(cut, whole, sizeof cut);
    karst_engine_destroy(engine);
}

/* A mesh around the origin, as a rasteriser has it: rays are tried against all of it. */
typedef struct {
    double (*corners)[3][3];
    size_t num;
    double reach; /* of its farthest corner */
} triangles;

static void add_triangle(triangles *m, double corner[3][3])
{
    if ((m->num & (m->num - 1)) == 0)
        m->corners = realloc(m->corners, (m->num ? 2 * m->num : 1) * sizeof *m->corners);
    assert_non_null(m->corners);
    memcpy(m->corners[m->num++], corner, sizeof *m->corners);
    for (int i = 0; i < 3; i++)
        m->reach = fmax(m->reach,
                        sqrt(corner[i][0] * corner[i][0] + corner[i][1] * corner[i][1] + corner[i][2] * corner[i][2]));
}

enum { STACKS = 8, SLICES = 12 };
static triangles make_ball(double radius)
{
    static const int corners[2][3][2] = {{{0, 0}, {1, 0}, {1, 1}}, {{0, 0}, {1, 1}, {0, 1}}};
    triangles m = {0};
    for (int i = 0; i < STACKS * SLICES * 2; i++) {
        double corner[3][3];
        for (int c = 0; c < 3; c++) {
            const double high = M_PI * (i / 2 / SLICES + corners[i % 2][c][0]) / STACKS;
            const double round = 2 * M_PI * (i / 2 % SLICES + corners[i % 2][c][1]) / SLICES;
            corner[c][0] = radius * sin(high) * cos(round);
            corner[c][1] = radius * cos(high);
            corner[c][2] = radius * sin(high) * sin(round);
        }
        add_triangle(&m, corner);
    }
    return m;
}

/* v and f lines of an OBJ, so high, its middle at the origin; empty if there is no such file. */
static triangles read_obj(const char *path, double high_m)
{
    triangles m = {0};
    double(*points)[3] = NULL, low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    size_t num = 0;
    char line[1024];
    FILE *file = fopen(path, "r");
    while (file && fgets(line, sizeof line, file)) {
        double p[3], corner[3][3];
        long face[3];
        if (sscanf(line, "v %lf %lf %lf", &p[0], &p[1], &p[2]) == 3) {
            points = realloc(points, (num + 1) * sizeof *points);
            assert_non_null(points);
            memcpy(points[num++], p, sizeof p);
            for (int i = 0; i < 3; i++) {
                low[i] = fmin(low[i], p[i]);
                high[i] = fmax(high[i], p[i]);
            }
        } else if (sscanf(line, "f %ld%*[^ ] %ld%*[^ ] %ld", &face[0], &face[1], &face[2]) == 3 ||
                   sscanf(line, "f %ld %ld %ld", &face[0], &face[1], &face[2]) == 3) {
            const double scale = high_m / (high[1] - low[1]);
            for (int i = 0; i < 9; i++) {
                assert_true(face[i / 3] > 0 && (size_t)face[i / 3] <= num);
                corner[i / 3][i % 3] = scale * (points[face[i / 3] - 1][i % 3] - 0.5 * (low[i % 3] + high[i % 3]));
            }
            add_triangle(&m, corner);
        }
    }
    if (file)
        fclose(file);
    free(points);
    return m;
}

static double hit_triangle(const double from[3], const double d[3], const double corner[3][3])
{
    double e[2][3], p[3], q[3], to[3], det = 0, u = 0, v = 0, t = 0;
    for (int i = 0; i < 3; i++) {
        e[0][i] = corner[1][i] - corner[0][i], e[1][i] = corner[2][i] - corner[0][i];
        to[i] = from[i] - corner[0][i];
    }
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        p[i] = d[j] * e[1][k] - d[k] * e[1][j];
        q[i] = to[j] * e[0][k] - to[k] * e[0][j];
    }
    for (int i = 0; i < 3; i++) {
        det += e[0][i] * p[i];
        u += to[i] * p[i];
        v += d[i] * q[i];
        t += e[1][i] * q[i];
    }
    if (fabs(det) < 1e-12)
        return INFINITY;
    u /= det, v /= det, t /= det;
    return u >= 0 && v >= 0 && u + v <= 1 && t > 0 ? t : INFINITY;
}

/* Of a ray from the camera to a mesh that is moved to `centre`. */
static double hit_mesh(const triangles *m, const double d[3], const double centre[3])
{
    const double from[3] = {-centre[0], -centre[1], -centre[2]};
    const double along = d[0] * centre[0] + d[1] * centre[1] + d[2] * centre[2];
    double nearest = INFINITY, square = -along * along;
    for (int i = 0; i < 3; i++)
        square += centre[i] * centre[i];
    for (size_t i = 0; square <= m->reach * m->reach && i < m->num; i++)
        nearest = fmin(nearest, hit_triangle(from, d, (const double(*)[3])m->corners[i]));
    return nearest;
}

typedef struct {
    int num_seen, num_hidden, num_wrong,
        num_off_edges; /* pixels: of the mesh; wrong ones; of these, not beside an edge */
} hiding;

/* From one camera, which of land and mesh is seen: by depths, and by true rays. Where they differ there is an edge. */
static void look(karst_engine *engine, const karst_world *world, const karst_camera *camera, const triangles *mesh,
                 const double centre[3], hiding *found)
{
    enum { SMALL = SMALL_WIDTH * SMALL_HEIGHT };
    static float land_m[SMALL], mesh_m[SMALL], mesh_window[SMALL], land_window[SMALL];
    static karst_query_ray rays[SMALL];
    static karst_query_hit hits[SMALL];
    static bool truth[SMALL];
    assert_ok(karst_engine_set_camera(engine, camera, &error));
    settle(engine);
    assert_ok(karst_engine_read_depth(engine, land_m, SMALL, &error));
    for (int i = 0; i < SMALL; i++) {
        double d[3];
        pixel_ray(camera, SMALL_WIDTH, SMALL_HEIGHT, i % SMALL_WIDTH + 0.5, i / SMALL_WIDTH + 0.5, d);
        const double length = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        for (int k = 0; k < 3; k++)
            d[k] /= length;
        mesh_m[i] = (float)hit_mesh(mesh, d, centre);
        rays[i] = (karst_query_ray){camera->position, {d[0], d[1], d[2]}, 600};
    }
    assert_ok(karst_query_rays(world, &(karst_query_config){.within_m = 1e-3}, rays, SMALL, hits, &error));
    assert_ok(karst_depth_to_window(camera, SMALL_WIDTH, SMALL_HEIGHT, &ranges[3], land_m, land_window, &error));
    assert_ok(karst_depth_to_window(camera, SMALL_WIDTH, SMALL_HEIGHT, &ranges[3], mesh_m, mesh_window, &error));
    for (int i = 0; i < SMALL; i++) {
        truth[i] = (double)mesh_m[i] < hits[i].t_m;
        found->num_seen += !isinf(mesh_m[i]) && truth[i];
        found->num_hidden += !isinf(mesh_m[i]) && !truth[i];
    }
    for (int i = 0; i < SMALL; i++) {
        if ((mesh_window[i] > land_window[i]) == truth[i])
            continue;
        found->num_wrong++;
        const int x = i % SMALL_WIDTH, y = i / SMALL_WIDTH;
        bool edge = false;
        for (int j = -1; j <= 1; j++)
            for (int k = -1; k <= 1; k++)
                if (x + k >= 0 && x + k < SMALL_WIDTH && y + j >= 0 && y + j < SMALL_HEIGHT)
                    edge |= truth[i + j * SMALL_WIDTH + k] != truth[i];
        found->num_off_edges += !edge;
    }
}

/* So far above the land below it. */
static void lower_camera(const karst_world *world, karst_camera *camera, double above_m)
{
    double down_m;
    uint32_t count;
    bool inside;
    assert_ok(karst_query_heights(world, &(karst_query_config){0}, &camera->position, 1, 2000, 1, &down_m, &count,
                                  &inside, &error));
    assert_true(count == 1 && !inside);
    camera->position = karst_position_add_m(camera->position, (const double[3]){0, above_m - down_m, 0},
                                            karst_world_get_metadata(world)->voxel_log2_m);
}

/* From ten cameras that turn, with the mesh before each, so far below the middle of its picture. */
static void check_hiding(const char *path, const triangles *mesh, double above_m, double ahead_m, double below_m)
{
    karst_error refused = {0};
    karst_world *world = karst_world_open(&(karst_world_config){.world = path}, &refused);
    if (!world)
        fail_msg("%s", refused.message);
    karst_engine *engine = open_engine(path, SMALL_WIDTH, SMALL_HEIGHT, true);
    hiding found = {0};
    for (int turn = 0; turn < 10; turn++) {
        karst_camera camera = karst_engine_default_camera(engine);
        lower_camera(world, &camera, above_m);
        camera.yaw_deg = 36 * turn;
        camera.pitch_deg = -15 - turn;
        double axes[3][3], centre[3];
        karst_camera_axes(&camera, axes[0], axes[1], axes[2]);
        for (int i = 0; i < 3; i++)
            centre[i] = ahead_m * axes[2][i] - (i == 1 ? below_m : 0);
        look(engine, world, &camera, mesh, centre, &found);
    }
    print_message("%d pixels of the mesh seen, %d hidden by land; %d of %d wrong\n", found.num_seen, found.num_hidden,
                  found.num_wrong, 10 * SMALL_WIDTH * SMALL_HEIGHT);
    assert_true(found.num_seen > 1000 && found.num_hidden > 500);
    assert_true(found.num_wrong <= 10 * SMALL_WIDTH * SMALL_HEIGHT / 1000);
    assert_int_equal(found.num_off_edges, 0);
    karst_engine_destroy(engine);
    karst_world_close(world);
}

static void test_a_mesh_and_land_hide_one_another(void **state)
{
    (void)state;
    triangles ball = make_ball(12);
    check_hiding(land_path, &ball, 26, 34, 14); /* deep in land by half */
    free(ball.corners);
}

/* The teapot of ../shared/data, or of TEAPOT, in `hills`. */
static void test_a_teapot_in_hills(void **state)
{
    (void)state;
    const char *path = getenv("TEAPOT") ? getenv("TEAPOT") : "../shared/data/teapot.obj";
    char hills[4096];
    if (!getenv("KARST_TEST_FULL"))
        skip();
    triangles teapot = read_obj(path, 24);
    if (!teapot.num) {
        print_message("there is no %s\n", path);
        skip();
    }
    assert_ok(karst_data_find("worlds", "hills", ".karst", hills, sizeof hills, &error));
    check_hiding(hills, &teapot, 20, 45, 8);
    free(teapot.corners);
}

static void test_bad_input(void **state)
{
    (void)state;
    karst_error why = {0};
    const karst_camera camera = {.fov_deg = 60};
    float one[1] = {1}, matrix[16];
    const karst_depth_range bad[] = {{0, 10, false, false},
                                     {-1, 10, false, false},
                                     {1, 1, false, false},
                                     {1, 0.5, false, false},
                                     {NAN, 10, false, false},
                                     {1, NAN, false, false},
                                     {INFINITY, INFINITY, false, false}};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        why = (karst_error){0};
        assert_false(karst_depth_to_window(&camera, 1, 1, &bad[i], one, one, &why));
        assert_int_equal(why.status, KARST_USAGE);
        assert_non_null(strstr(why.message, "near is above 0"));
        assert_false(karst_depth_from_window(&camera, 1, 1, &bad[i], one, one, &why));
        assert_false(karst_depth_matrix(&camera, 1, 1, &bad[i], matrix, &why));
    }
    why = (karst_error){0};
    assert_false(karst_depth_to_window(&camera, 0, 1, &ranges[0], one, one, &why));
    assert_non_null(strstr(why.message, "1 to 16384"));
    assert_false(karst_depth_matrix(&camera, 1, 16385, &ranges[0], matrix, &why));

    karst_engine *engine = open_engine(land_path, SMALL_WIDTH, SMALL_HEIGHT, false);
    why = (karst_error){0};
    assert_false(karst_engine_set_depth(engine, one, 1, &why));
    assert_int_equal(why.status, KARST_USAGE);
    assert_non_null(strstr(why.message, "3072 values, not 1"));
    assert_false(karst_engine_set_depth(engine, NULL, 3072, &why));
    static float all[SMALL_WIDTH * SMALL_HEIGHT];
    assert_ok(karst_engine_set_depth(engine, all, SMALL_WIDTH * SMALL_HEIGHT, &error));
    settle(engine);
    karst_stats stats;
    karst_engine_stats(engine, &stats);
    assert_int_equal(stats.num_hits, 0);
    /* Another size takes it away. */
    assert_ok(karst_engine_set_size(engine, SMALL_WIDTH / 2, SMALL_HEIGHT, &error));
    settle(engine);
    karst_engine_stats(engine, &stats);
    assert_true(stats.num_hits > 0);
    karst_engine_destroy(engine);

    char path[4096];
    assert_ok(karst_data_find("worlds", "glass", ".karst", path, sizeof path, &error));
    engine = open_engine(path, SMALL_WIDTH, SMALL_HEIGHT, false);
    why = (karst_error){0};
    assert_false(karst_engine_set_depth(engine, all, SMALL_WIDTH * SMALL_HEIGHT, &why));
    assert_int_equal(why.status, KARST_USAGE);
    assert_non_null(strstr(why.message, "clear matter or air"));
    karst_engine_destroy(engine);
    karst_engine_config config = {.world = land_path,
                                  .display = KARST_DISPLAY_NONE,
                                  .width_px = SMALL_WIDTH,
                                  .height_px = SMALL_HEIGHT,
                                  .integrator = KARST_INTEGRATOR_FULL,
                                  .pool_bytes = (uint64_t)64 << 20};
    why = (karst_error){0};
    engine = karst_engine_create(&config, &why);
    assert_non_null(engine);
    assert_false(karst_engine_set_depth(engine, all, SMALL_WIDTH * SMALL_HEIGHT, &why));
    assert_non_null(strstr(why.message, "direct light"));
    karst_engine_destroy(engine);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_planes_depth_is_its_own),
        cmocka_unit_test(test_depths_come_back),
        cmocka_unit_test(test_matrix),
        cmocka_unit_test(test_a_rasteriser_has_the_same_depth),
        cmocka_unit_test(test_land_ends_at_a_depth),
        cmocka_unit_test(test_a_mesh_and_land_hide_one_another),
        cmocka_unit_test(test_a_teapot_in_hills),
        cmocka_unit_test(test_bad_input),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
