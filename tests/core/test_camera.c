#include <locale.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "karst/camera.h"

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void assert_axis(const double axis[3], double x, double y, double z)
{
    if (axis[0] != x || axis[1] != y || axis[2] != z)
        fail_msg("(%g, %g, %g), want (%g, %g, %g)", axis[0], axis[1], axis[2], x, y, z);
}

/* Field by field: padding may hold anything. */
static void assert_same(const karst_camera *a, const karst_camera *b)
{
    for (int axis = 0; axis < 3; axis++) {
        assert_true(a->position.voxel[axis] == b->position.voxel[axis]);
        assert_int_equal(a->position.fraction[axis], b->position.fraction[axis]);
    }
    assert_true(a->yaw_deg == b->yaw_deg && a->pitch_deg == b->pitch_deg && a->fov_deg == b->fov_deg);
}

/* Level views are exact. */
static void test_compass(void **state)
{
    (void)state;
    const struct {
        double yaw, pitch, right[3], up[3], forward[3];
    } views[] = {
        {0, 0, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
        {90, 0, {0, 0, -1}, {0, 1, 0}, {1, 0, 0}},
        {180, 0, {-1, 0, 0}, {0, 1, 0}, {0, 0, -1}},
        {-90, 0, {0, 0, 1}, {0, 1, 0}, {-1, 0, 0}},
        {270 + 360e6, 0, {0, 0, 1}, {0, 1, 0}, {-1, 0, 0}},
        {0, 90, {1, 0, 0}, {0, 0, -1}, {0, 1, 0}},
        {0, -90, {1, 0, 0}, {0, 0, 1}, {0, -1, 0}},
        {90, 90, {0, 0, -1}, {-1, 0, 0}, {0, 1, 0}},
        {0, 1000, {1, 0, 0}, {0, 0, -1}, {0, 1, 0}},
        {NAN, NAN, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
        {INFINITY, -INFINITY, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
    };
    for (size_t i = 0; i < sizeof views / sizeof *views; i++) {
        const karst_camera camera = {.yaw_deg = views[i].yaw, .pitch_deg = views[i].pitch, .fov_deg = 60};
        double right[3], up[3], forward[3];
        karst_camera_axes(&camera, right, up, forward);
        assert_axis(right, views[i].right[0], views[i].right[1], views[i].right[2]);
        assert_axis(up, views[i].up[0], views[i].up[1], views[i].up[2]);
        assert_axis(forward, views[i].forward[0], views[i].forward[1], views[i].forward[2]);
    }
}

static void test_axes_are_orthonormal(void **state)
{
    (void)state;
    for (int yaw = -720; yaw <= 720; yaw += 7)
        for (int pitch = -90; pitch <= 90; pitch += 3) {
            const karst_camera camera = {.yaw_deg = yaw + 0.25, .pitch_deg = pitch, .fov_deg = 60};
            double r[3], u[3], f[3];
            karst_camera_axes(&camera, r, u, f);
            assert_true(fabs(dot(r, r) - 1) < 1e-15 * 4 && fabs(dot(u, u) - 1) < 1e-15 * 4 &&
                        fabs(dot(f, f) - 1) < 1e-15 * 4);
            assert_true(fabs(dot(r, u)) < 1e-15 && fabs(dot(u, f)) < 1e-15 && fabs(dot(f, r)) < 1e-15);
            const double cross[3] = {r[1] * u[2] - r[2] * u[1], r[2] * u[0] - r[0] * u[2], r[0] * u[1] - r[1] * u[0]};
            assert_true(dot(cross, f) > 0.999999);
            assert_true(u[1] >= 0); /* never upside down */
            assert_true(fabs(f[1] - sin(pitch * 3.14159265358979323846 / 180)) < 1e-15 * 4);
            /* the compass: bearing of forward's shadow on the ground */
            if (abs(pitch) < 89)
                assert_true(fabs(remainder(atan2(f[0], f[2]) * 180 / 3.14159265358979323846 - camera.yaw_deg, 360)) <
                            1e-11);
        }
}

static void test_parse(void **state)
{
    (void)state;
    karst_camera camera = {.fov_deg = 33};
    assert_true(karst_camera_parse("1,-2.5,1e15,30,-12.5", 0, &camera, NULL));
    assert_int_equal(camera.position.voxel[0], 1);
    assert_int_equal(camera.position.voxel[1], -3);
    assert_int_equal(camera.position.fraction[1], 0x80000000u);
    assert_int_equal(camera.position.voxel[2], 1000000000000000);
    assert_true(camera.yaw_deg == 30 && camera.pitch_deg == -12.5 && camera.fov_deg == 33);
    assert_true(karst_camera_parse(" 0 , 0, 0, -1e3, +90, 0.0001", 0, &camera, NULL));
    assert_true(camera.yaw_deg == -1000 && camera.pitch_deg == 90 && camera.fov_deg == 0.0001);
}

static void test_errors_name_the_field(void **state)
{
    (void)state;
    const struct {
        const char *text, *says;
    } cases[] = {
        {"", "1 field;"},
        {"1,2,3,4", "4 fields"},
        {"1,2,3,4,5,6,7", "7 fields"},
        {",,,,,,,,,,,,,,,,", "17 fields"},
        {"a,2,3,4,5", "camera x: \"a\""},
        {"1,,3,4,5", "camera y: \"\""},
        {"1,2,1e99,4,5", "camera z: \"1e99\" lies beyond"},
        {"1,2,3,north,5", "camera yaw: \"north\""},
        {"1,2,3,1e999,5", "camera yaw"},
        {"1,2,3,0x10,5", "camera yaw"},
        {"1,2,3,nan,5", "camera yaw"},
        {"1,2,3,4,inf", "camera pitch"},
        {"1,2,3,4,90.001", "camera pitch: \"90.001\" is not within -90 to 90"},
        {"1,2,3,4,-91", "camera pitch"},
        {"1,2,3,4,5,0", "camera fov: \"0\" is not within 0.0001 to 179"},
        {"1,2,3,4,5,180", "camera fov"},
        {"1,2,3,4,5,", "camera fov"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        karst_camera camera = {.yaw_deg = 1, .pitch_deg = 2, .fov_deg = 3}, before = camera;
        karst_error error = {0};
        assert_false(karst_camera_parse(cases[i].text, 0, &camera, &error));
        assert_int_equal(error.status, KARST_USAGE);
        if (!strstr(error.message, cases[i].says))
            fail_msg("\"%s\" does not say \"%s\"", error.message, cases[i].says);
        assert_same(&camera, &before);
    }
    char text[600];
    memset(text, 'q', sizeof text);
    text[sizeof text - 1] = '\0';
    karst_camera camera = {0};
    karst_error error = {0};
    assert_false(karst_camera_parse(text, 0, &camera, &error));
    assert_non_null(strstr(error.message, "qqq...\" has 1 field"));
}

static void check_round_trip(void)
{
    const double angles[] = {0, -0.1, 1.0 / 3, 89.99999999999999, 1e-300, -90, 12.5};
    for (size_t i = 0; i < sizeof angles / sizeof *angles; i++) {
        const karst_camera camera = {.position = {{(int64_t)1 << 61, -((int64_t)1 << 62), -1}, {0xFFFFFFFFu, 0, 1}},
                                     .yaw_deg = angles[i] * 1e10,
                                     .pitch_deg = angles[i],
                                     .fov_deg = 179 / (1.0 + (double)i)};
        for (int voxel_log2_m = KARST_VOXEL_LOG2_MIN; voxel_log2_m <= KARST_VOXEL_LOG2_MAX; voxel_log2_m += 20) {
            char text[512];
            int length = karst_camera_format(&camera, voxel_log2_m, text, sizeof text);
            assert_in_range(length, 11, 511);
            karst_camera back = {0};
            karst_error error = {0};
            if (!karst_camera_parse(text, voxel_log2_m, &back, &error))
                fail_msg("%s", error.message);
            assert_same(&back, &camera);
        }
    }
    const karst_camera simple = {
        .position = {{0, 320, -5}, {0, 0, 0x40000000u}}, .yaw_deg = 30, .pitch_deg = -12.5, .fov_deg = 60};
    char text[512];
    karst_camera_format(&simple, 0, text, sizeof text);
    assert_string_equal(text, "0,320,-4.75,30,-12.5,60");
    assert_int_equal(karst_camera_format(&simple, 99, text, sizeof text), -1);
}

static void test_round_trip(void **state)
{
    (void)state;
    check_round_trip();
}

/* Writes what the GNU C library reads as LC_NUMERIC of a locale, the decimal sign being a comma: a magic number,
 * offsets, then decimal sign, thousands sign, grouping, both signs as wide characters, codeset. */
static void write_comma_locale(const char *path)
{
    static const unsigned char text[] = {',', 0, 0, 0x7F, ',', 0, 0, 0, 0, 0, 0, 0, 'U', 'T', 'F', '-', '8', 0};
    enum { START = 8 * sizeof(uint32_t) };
    const uint32_t head[8] = {
        0x20031115u ^ LC_NUMERIC, 6, START, START + 2, START + 3, START + 4, START + 8, START + 12};
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(head, sizeof head, 1, file), 1);
    assert_int_equal(fwrite(text, sizeof text, 1, file), 1);
    assert_int_equal(fclose(file), 0);
}

/* Where a comma is the decimal sign, text stays the same. */
static void test_locale(void **state)
{
    (void)state;
    char folder[] = "/tmp/karst-locale-XXXXXX", inner[64], path[96], number[16];
    assert_non_null(mkdtemp(folder));
    snprintf(inner, sizeof inner, "%s/comma", folder);
    assert_int_equal(mkdir(inner, 0700), 0);
    snprintf(path, sizeof path, "%s/LC_NUMERIC", inner);
    write_comma_locale(path);
    setenv("LOCPATH", folder, 1);
    bool has_locale = setlocale(LC_NUMERIC, "comma");
    unlink(path);
    rmdir(inner);
    rmdir(folder);
    if (!has_locale)
        skip(); /* another C library */
    snprintf(number, sizeof number, "%g", 1.5);
    assert_string_equal(number, "1,5");
    check_round_trip();
    assert_true(setlocale(LC_NUMERIC, "C"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_compass),    cmocka_unit_test(test_axes_are_orthonormal),
        cmocka_unit_test(test_parse),      cmocka_unit_test(test_errors_name_the_field),
        cmocka_unit_test(test_round_trip), cmocka_unit_test(test_locale),
    };
    return cmocka_run_group_tests_name("camera", tests, NULL, NULL);
}
