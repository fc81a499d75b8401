/* Pasting works: worlds in the manner of live-coding sites compile, evaluate to finite values, and mean what C says
 * they mean. */
#include "world_text.h"

#include <dirent.h>

#include "karst/camera.h"
#include "producers/density/world_file.h"

#define FOLDER "tests/language/pasted"
enum { NUM_SAMPLES = 400 };

static uint32_t state = 1;
static double random_coordinate(void)
{
    state = state * 1664525u + 1013904223u;
    return (state >> 8) * 0x1p-24 * 24 - 12;
}

static text_world pasted(const char *name)
{
    char path[256];
    size_t length;
    snprintf(path, sizeof path, FOLDER "/%s", name);
    char *text = read_text(path, &length);
    text_world w = world_of(text, length, path);
    free(text);
    return w;
}

/* All of them: finite near the origin, the float near the double, twenty in number. */
static void test_all(void **s)
{
    (void)s;
    DIR *folder = opendir(FOLDER);
    assert_non_null(folder);
    int count = 0;
    for (struct dirent *entry; (entry = readdir(folder));) {
        if (!strstr(entry->d_name, ".karst"))
            continue;
        text_world w = pasted(entry->d_name);
        int solid = 0;
        for (int i = 0; i < NUM_SAMPLES; i++) {
            double x = random_coordinate(), y = random_coordinate(), z = random_coordinate();
            karst_oracle_value v = density_at(&w, x, y, z);
            if (!isfinite(v.device) || !isfinite(v.precise))
                fail_msg("%s: %g (double %g) at %g, %g, %g", entry->d_name, (double)v.device, v.precise, x, y, z);
            assert_near((double)v.device, v.precise, 2e-3 * (1 + fabs(v.precise)), entry->d_name);
            solid += v.precise > 0;
        }
        if (karst_has_output(w.program->root, KARST_OUTPUT_COLOUR)) {
            karst_oracle_value rgb[3];
            karst_position at = position_at(&w, 1, 2, 3);
            karst_oracle_colour(w.oracle, &at, (const float[KARST_FACING_FLOATS]){0, 1, 0}, -1, rgb);
            for (int i = 0; i < 3; i++)
                assert_true(isfinite(rgb[i].device));
        }
        if (solid == NUM_SAMPLES)
            fail_msg("%s: nothing but rock", entry->d_name);
        world_finish(&w);
        count++;
    }
    closedir(folder);
    assert_int_equal(count, 20);
}

/* ---- the same worlds, written in C ---- */

static double clamp(double x, double lo, double hi) { return fmin(fmax(x, lo), hi); }
static double modulo(double x, double y) { return x - y * floor(x / y); }

static double spheres(double x, double y, double z)
{
    const double centre[2][4] = {{0, 0, 0, 1}, {1.4, 0, 0.3, 0.7}};
    double d = y + 1;
    for (int i = 0; i < 2; i++) {
        double b = sqrt(pow(x - centre[i][0], 2) + pow(y - centre[i][1], 2) + pow(z - centre[i][2], 2)) - centre[i][3];
        double h = clamp(0.5 + 0.5 * (b - d) / 0.4, 0, 1);
        d = b + (d - b) * h - 0.4 * h * (1 - h);
    }
    return -d;
}

static double repetition(double x, double y, double z)
{
    double qx = modulo(x + 3, 6) - 3, qy = modulo(y + 6, 12) - 6, qz = modulo(z + 3, 6) - 3;
    double r = 0.6 + 0.05 * cos(atan2(qz, qx) * 12);
    double pillar = fmax(sqrt(qx * qx + qz * qz) - r, fabs(qy) - 3);
    return -fmin(pillar, y + 3);
}

static double mandelbox(double x, double y, double z)
{
    double p[3] = {x / 4, y / 4, z / 4}, o[3] = {x / 4, y / 4, z / 4}, dr = 1;
    for (int n = 0; n < 10; n++) {
        double r2 = 0, k = 1;
        for (int i = 0; i < 3; i++) {
            p[i] = clamp(p[i], -1, 1) * 2 - p[i];
            r2 += p[i] * p[i];
        }
        if (r2 < 0.25)
            k = 4;
        else if (r2 < 1)
            k = 1 / r2;
        for (int i = 0; i < 3; i++)
            p[i] = 2.4 * p[i] * k + o[i];
        dr = dr * k * 2.4 + 1;
    }
    return 0.01 - sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) / dr;
}

static double menger(double x, double y, double z)
{
    double p[3] = {x / 8, y / 8, z / 8}, q[3], s = 1, outside = 0, inside = -1e9;
    for (int i = 0; i < 3; i++) {
        q[i] = fabs(p[i]) - 1;
        outside += q[i] > 0 ? q[i] * q[i] : 0;
        inside = fmax(inside, q[i]);
    }
    double d = sqrt(outside) + fmin(inside, 0);
    for (int m = 0; m < 4; m++) {
        double r[3];
        for (int i = 0; i < 3; i++)
            r[i] = fabs(1 - 3 * fabs(modulo(p[i] * s, 2) - 1));
        s *= 3;
        double c = fmin(fmax(r[0], r[1]), fmin(fmax(r[1], r[2]), fmax(r[2], r[0])));
        d = fmax(d, (c - 1) / s);
    }
    return -d * 8;
}

static double kifs(double x, double y, double z)
{
    double p[3] = {x * 0.1, y * 0.1, z * 0.1};
    for (int n = 0; n < 9; n++) {
        static const int pair[3][2] = {{0, 1}, {0, 2}, {1, 2}};
        for (int i = 0; i < 3; i++) {
            double *a = &p[pair[i][0]], *b = &p[pair[i][1]];
            if (*a + *b < 0) {
                double t = *a;
                *a = -*b;
                *b = -t;
            }
        }
        if (p[0] < p[1]) {
            double t = p[0];
            p[0] = p[1];
            p[1] = t;
        }
        for (int i = 0; i < 3; i++)
            p[i] = p[i] * 2 - 1;
    }
    return 0.02 - sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) / 512;
}

static double gyroid(double x, double y, double z, double scale, double bias)
{
    x *= scale;
    y *= scale;
    z *= scale;
    return fabs(sin(x) * cos(z) + sin(y) * cos(x) + sin(z) * cos(y) - bias) / scale - 0.03;
}
static double gyroids(double x, double y, double z)
{
    double g =
        gyroid(x, y, z, 1.31, 1.4) - 0.4 * gyroid(x, y, z, 2.73, 0.3) - 0.2 * gyroid(x + .5, y + .5, z + .5, 5.17, 0.3);
    return -fmax(sqrt(x * x + y * y + z * z) - 8, g * 0.8);
}

static uint32_t mixed(uint32_t x)
{
    x ^= x >> 16;
    x *= 0x7feb352du;
    x ^= x >> 15;
    x *= 0x846ca68bu;
    return x ^ x >> 16;
}
static double value_noise(double x, double y, double z)
{
    double p[3] = {x, y, z}, f[3], sum = 0;
    int32_t cell[3];
    for (int i = 0; i < 3; i++) {
        cell[i] = (int32_t)floor(p[i]);
        double t = p[i] - floor(p[i]);
        f[i] = t * t * (3 - 2 * t);
    }
    for (int k = 0; k < 8; k++) {
        uint32_t c[3];
        double w = 1;
        for (int i = 0; i < 3; i++) {
            int up = k >> i & 1;
            c[i] = (uint32_t)(cell[i] + up);
            w *= up ? f[i] : 1 - f[i];
        }
        sum += w * (mixed(c[0] + mixed(c[1] + mixed(c[2]))) & 0xffffffu) / 16777215.0;
    }
    return sum;
}
static double integer_hash(double x, double y, double z)
{
    return -(y - 4 * value_noise(x * 0.3, y * 0.3, z * 0.3) -
             8 * value_noise(x * 0.11 + 5, y * 0.11 + 5, z * 0.11 + 5));
}

static double terraces(double x, double y, double z)
{
    double px = x, py = y, pz = z;
    if (y >= 0) {
        double c = cos(0.1 * y), s = sin(0.1 * y);
        px = c * x + s * y; /* mat2(c, -s, s, c): columns */
        py = -s * x + c * y;
        if (px > 4)
            px = 8 - px;
    }
    double h = (0.5 + 0.5 * sin(px * 0.4) * cos(pz * 0.3)) * 5, d = py - 5 * (floor(h) + pow(h - floor(h), 4)) / 5;
    if (d > 20)
        return -(d - 1);
    if ((py > 3 && px < 2) || d < -10)
        d += 0.1;
    d += px < -5 || py < -5 || pz < -5 ? 0.3 : 0;
    return -d * 0.6;
}

static void test_against_c(void **s)
{
    (void)s;
    static const struct {
        const char *name;
        double (*in_c)(double x, double y, double z);
        double within;
    } worlds[] = {{"01_spheres_smooth.karst", spheres, 1e-12},
                  {"03_domain_repetition.karst", repetition, 1e-8},
                  {"04_mandelbox.karst", mandelbox, 1e-6},
                  {"05_menger.karst", menger, 1e-7},
                  {"12_kifs.karst", kifs, 1e-9},
                  {"15_gyroid.karst", gyroids, 1e-7},
                  {"19_integer_hash.karst", integer_hash, 1e-5},
                  {"20_early_returns.karst", terraces, 1e-5}};
    for (size_t i = 0; i < sizeof worlds / sizeof *worlds; i++) {
        text_world w = pasted(worlds[i].name);
        for (int k = 0; k < NUM_SAMPLES; k++) {
            /* multiples of 2^-16, so that the position is the same in voxels */
            double x = rint(random_coordinate() * 65536) / 65536, y = rint(random_coordinate() * 65536) / 65536,
                   z = rint(random_coordinate() * 65536) / 65536;
            assert_near(density_at(&w, x, y, z).precise, worlds[i].in_c(x, y, z), worlds[i].within, worlds[i].name);
        }
        world_finish(&w);
    }
}

/* Where the usual sun reaches it stays; where another one does, that is taken; and what lies under a roof gets more
 * light from the sky. */
static void test_sun(void **s)
{
    (void)s;
    const struct {
        const char *name;
        bool usual, indoors;
    } worlds[] = {{"01_spheres_smooth.karst", true, false},
                  {"05_menger.karst", false, false},
                  {"08_ridged_mountains.karst", true, false},
                  {"14_tunnel.karst", true, true},
                  {"20_early_returns.karst", true, true}};
    for (size_t i = 0; i < sizeof worlds / sizeof *worlds; i++) {
        char path[256];
        karst_error error = {0};
        snprintf(path, sizeof path, FOLDER "/%s", worlds[i].name);
        karst_world_file *file = karst_world_file_open(path, NULL, 0, NULL, &error);
        if (!file)
            fail_msg("%s: %s", path, error.message);
        const karst_world_info *info = &file->info;
        if ((info->sun_azimuth_deg == 135 && info->sun_elevation_deg == 40) != worlds[i].usual ||
            file->is_indoors != worlds[i].indoors || (info->sky_zenith[2] > 1) != worlds[i].indoors)
            fail_msg("%s: sun at %g, %g, %s", path, info->sun_azimuth_deg, info->sun_elevation_deg,
                     file->is_indoors ? "indoors" : "outdoors");
        karst_world_file_destroy(file);
    }
}

/* What is guessed depends on where the density is positive alone, not on its values: cameras, voxels and views of the
 * same surfaces are the same, and a body is seen whole. */
static void test_scale(void **s)
{
    (void)s;
    static const struct {
        const char *value;
        bool is_body;
    } shapes[] = {{"fbm(p.xz / 600.0, 8) * 120.0 - p.y", false},
                  {"4.0 - length(p)", true},
                  {"0.05 - length(p - vec3(0.1, 0.0, 0.0))", true},
                  {"60.0 - length(p * vec3(1.0, 3.0, 1.0))", true},
                  {"700.0 + 40.0 * noise(p / 90.0) - length(p)", true},
                  {"max(1.0 - length(p - 1.5), 1.0 - length(p + 1.5))", true},
                  {"2.0 - max(abs(p.x), max(abs(p.y), abs(p.z)))", true},
                  {"valuenoise(p / 7.0) - 0.2", false},
                  {"3.0 * noise(p.xz / 9.0) - p.y", false}};
    static const char *const as[] = {"d",          "d * 0.001", "d * 1000.0",         "d / 120.0",
                                     "d * abs(d)", "atan(d)",   "d > 0.0 ? 1.0 : 0.0"};
    for (size_t i = 0; i < sizeof shapes / sizeof *shapes; i++) {
        karst_world_file *first = NULL;
        for (size_t k = 0; k < sizeof as / sizeof *as; k++) {
            char text[512];
            karst_error error = {0};
            snprintf(text, sizeof text, "float density(vec3 p) { float d = %s; return %s; }", shapes[i].value, as[k]);
            karst_world_file *file =
                karst_world_file_compile("scaled.karst", text, strlen(text), NULL, 0, NULL, &error);
            if (!file)
                fail_msg("%s: %s", text, error.message);
            if (!first)
                first = file;
            else if (strcmp(first->info.camera, file->info.camera) ||
                     first->info.voxel_log2_m != file->info.voxel_log2_m ||
                     first->info.view_distance_m != file->info.view_distance_m)
                fail_msg("%s: %s, voxels of 2^%d m; %s, 2^%d m", text, first->info.camera, first->info.voxel_log2_m,
                         file->info.camera, file->info.voxel_log2_m);
            if (file != first)
                karst_world_file_destroy(file);
        }
        karst_camera camera;
        karst_error error = {0};
        assert_true(karst_camera_parse(first->info.camera, first->info.voxel_log2_m, &camera, &error));
        karst_oracle *oracle = karst_oracle_create(&first->program->world, NULL, 0, first->info.voxel_log2_m, &error);
        assert_non_null(oracle);
        /* The border of a picture of 4:3 shows nothing of a body, its middle some. */
        double axes[3][3], half = tan(camera.fov_deg * M_PI / 360);
        karst_camera_axes(&camera, axes[0], axes[1], axes[2]);
        int on_border = 0, inside = 0;
        for (int ray = 0; ray < 17 * 17 && shapes[i].is_body; ray++) {
            double x = (ray % 17 - 8) / 8.0, y = (ray / 17 - 8) / 8.0, d_m[3];
            bool solid = false;
            for (double t = 0; t < 3000 && !solid; t += fmax(t * 0.01, 0.001)) {
                for (int k = 0; k < 3; k++)
                    d_m[k] = t * (axes[2][k] + half * (x * 4 / 3 * axes[0][k] + y * axes[1][k]));
                karst_position at = karst_position_add_m(camera.position, d_m, first->info.voxel_log2_m);
                solid = karst_oracle_precise_density(oracle, &at, -1) > 0;
            }
            on_border += solid && (fabs(x) == 1 || fabs(y) == 1);
            inside += solid;
        }
        if (shapes[i].is_body && (on_border || inside < 12))
            fail_msg("%s from %s: %d rays of 289 meet it, %d of the border", shapes[i].value, first->info.camera,
                     inside, on_border);
        karst_oracle_destroy(oracle);
        karst_world_file_destroy(first);
    }
}

/* A header of names, parameters and light leaves the camera to be looked for; one that says anything of places does
 * not, nor does one that says nothing at all. */
static void test_header(void **s)
{
    static const struct {
        const char *header;
        bool is_looked_for, has_sun;
    } headers[] = {{"", true, false},
                   {"/*{ \"params\": { \"r\": 1.5 }, \"name\": \"egg\" }*/", true, false},
                   {"/*{ \"sun\": { \"azimuth\": 200, \"elevation\": 11 }, \"exposure\": 1 }*/", true, true},
                   {"/*{}*/", false, false},
                   {"/*{ \"view\": 900 }*/", false, false},
                   {"/*{ \"params\": { \"r\": 1.5 }, \"voxel\": 0.25 }*/", false, false},
                   {"/*{ \"camera\": { \"position\": [\"0\", \"0\", \"-5\"] }, \"mirror\": 0.2 }*/", false, false}};
    char text[512], looked_for[sizeof((karst_world_file *)NULL)->camera];
    karst_error error = {0};
    (void)s;
    for (size_t i = 0; i < sizeof headers / sizeof *headers; i++) {
        snprintf(text, sizeof text, "%s float density(vec3 p) { return 2.0 - length(p - vec3(9.0, 5.0, 3.0)); }",
                 headers[i].header);
        karst_world_file *file = karst_world_file_compile("egg.karst", text, strlen(text), NULL, 0, NULL, &error);
        if (!file)
            fail_msg("%s: %s", headers[i].header, error.message);
        if (i == 0)
            snprintf(looked_for, sizeof looked_for, "%s", file->camera);
        if (!strcmp(file->camera, looked_for) != headers[i].is_looked_for)
            fail_msg("%s: from %s", headers[i].header, file->camera);
        if (headers[i].has_sun)
            assert_true(file->info.sun_azimuth_deg == 200 && file->info.sun_elevation_deg == 11);
        karst_world_file_destroy(file);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_all), cmocka_unit_test(test_against_c),
                                       cmocka_unit_test(test_sun), cmocka_unit_test(test_scale),
                                       cmocka_unit_test(test_header)};
    return cmocka_run_group_tests_name("pasted worlds", tests, NULL, NULL);
}
