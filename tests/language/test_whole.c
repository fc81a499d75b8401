/* Whole numbers of places: cells' ids, checkers and hashes, against 128-bit arithmetic, to 10^15 m. */
#include "producers/language/check.h"
#include "world_text.h"

__extension__ typedef __int128 int128;

static int128 floor_divide(int128 a, int128 b) { return a / b - (a % b < 0); }
static int128 floor_rest(int128 a, int128 b) { return a - b * floor_divide(a, b); }
/* Of v in 2^-36 m: voxels of 1/16 m and their fractions. */
#define METRE ((int128)1 << 36)
static int128 cell(int128 v, int metres) { return floor_divide(v, metres * METRE); }
static int128 towards_zero(int128 v) { return v / METRE; }

static double checker(const int128 v[3]) { return (double)floor_rest(cell(v[0], 64) + cell(v[2], 64), 2); }
static double checker3(const int128 v[3])
{
    return (double)floor_rest(cell(v[0], 3) - 5 * cell(v[1], 10) + cell(v[2], 7) + 1, 3);
}
static double half(const int128 v[3]) { return (double)floor_rest(cell(v[0], 8) + cell(v[2], 8), 2) / 2; }
static double third(const int128 v[3]) { return (double)floor_rest(2 * cell(v[0], 8) + 1, 6) / 2; }
static double masked(const int128 v[3]) { return (double)((cell(v[0], 64) * 3 + cell(v[2], 64) * 5) & 7); }
static double rest_of_int(const int128 v[3]) { return (double)(towards_zero(v[0]) % 7); }
static double rest_of_sum(const int128 v[3]) { return (double)((cell(v[0], 2) * 3 - towards_zero(v[2]) + 11) % 10); }
static double masked_int(const int128 v[3]) { return (double)(towards_zero(v[0]) & 7); }
static double quarters(const int128 v[3]) { return (double)floor_rest(4 * (cell(v[0], 1) - 3), 7) / 4; }
static double quotient(const int128 v[3]) { return (double)((int32_t)((cell(v[0], 16) + 5) / 6) & 1023); }
static double quotient_of_int(const int128 v[3]) { return (double)((int32_t)(towards_zero(v[0]) / 10) & 1023); }
static double shifted(const int128 v[3]) { return (double)(floor_divide(cell(v[0], 1), 16) % 1000); }
static double nested(const int128 v[3]) { return (double)floor_rest(floor_divide(cell(v[0], 4) + 1, 3), 5); }
static double rounded(const int128 v[3])
{
    return (double)floor_rest(floor_divide(v[0] + 2 * METRE, 4 * METRE) - floor_divide(-v[2], METRE), 9);
}
static double hash(const int128 v[3])
{
    uint32_t h = (uint32_t)cell(v[0], 4) * 374761393u + (uint32_t)cell(v[2], 4) * 668265263u;
    h = (h ^ h >> 13) * 1274126177u;
    return (double)((h ^ h >> 16) & 1023);
}
static double int_hash(const int128 v[3])
{
    uint32_t n = (uint32_t)cell(v[0], 4) + (uint32_t)cell(v[2], 4) * 57u;
    n = n << 13 ^ n;
    n = (n * (n * n * 15731u + 789221u) + 1376312589u) & 0x7fffffffu;
    return (double)(n >> 21);
}
static double order(const int128 v[3]) { return (double)(cell(v[0], 100) + 3 < cell(v[0], 50)); }
static double few(const int128 v[3]) { return (double)(cell(v[0], 10) < 3 && cell(v[2], 10) >= -2); }
static double steep(const int128 v[3]) { return (double)floor_rest(cell(v[0], 1) * 1000 + 1, 1024); }

static const struct {
    const char *body;
    double (*truth)(const int128 v[3]);
} worlds[] = {
    {"return mod(floor(p.x / 64.0) + floor(p.z / 64.0), 2.0);", checker},
    {"vec3 c = floor(p / vec3(3.0, 10.0, 7.0)); return mod(c.x - 5.0 * c.y + c.z + 1.0, 3.0);", checker3},
    {"vec2 c = floor(p.xz / 8.0); return fract((c.x + c.y) * 0.5);", half},
    {"return mod(floor(p.x / 8.0) + 0.5, 3.0);", third},
    {"int i = int(floor(p.x / 64.0)), j = int(floor(p.z / 64.0)); return float((i * 3 + j * 5) & 7);", masked},
    {"return float(int(p.x) % 7);", rest_of_int},
    {"return float(int(p.x) & 7);", masked_int},
    {"return mod(floor(p.x) - 3.0, 1.75);", quarters},
    {"return float((int(floor(p.x / 2.0)) * 3 - int(p.z) + 11) % 10);", rest_of_sum},
    {"return float(((int(floor(p.x / 16.0)) + 5) / 6) & 1023);", quotient},
    {"return float((int(p.x) / 10) & 1023);", quotient_of_int},
    {"return float((int(floor(p.x)) >> 4) % 1000);", shifted},
    {"return mod(floor((floor(p.x / 4.0) + 1.0) / 3.0), 5.0);", nested},
    {"return mod(round(p.x / 4.0) + ceil(p.z), 9.0);", rounded},
    {"uvec2 c = uvec2(ivec2(floor(p.xz / 4.0))); uint h = c.x * 374761393u + c.y * 668265263u; h = (h ^ (h >> 13u)) * "
     "1274126177u; return float((h ^ (h >> 16u)) & 1023u);",
     hash},
    {"int n = int(floor(p.x / 4.0)) + int(floor(p.z / 4.0)) * 57; n = (n << 13) ^ n; n = (n * (n * n * 15731 + 789221) "
     "+ 1376312589) & 0x7fffffff; return float(n >> 21);",
     int_hash},
    {"return int(floor(p.x / 100.0)) + 3 < int(floor(p.x / 50.0)) ? 1.0 : 0.0;", order},
    {"ivec2 c = ivec2(floor(p.xz / 10.0)); return c.x < 3 && c.y >= -2 ? 1.0 : 0.0;", few},
    {"return mod(floor(p.x) * 1000.0 + 1.0, 1024.0);", steep},
};

static void test_truth(void **s)
{
    (void)s;
    static const int64_t places[] = {0, 1000000, 1000000000, 1000000000000, 1000000000000000};
    uint32_t random = 1;
    for (size_t i = 0; i < sizeof worlds / sizeof *worlds; i++) {
        text_world w = world_from_body(worlds[i].body);
        for (int k = 0; k < 20000; k++) {
            karst_position at;
            int128 v[3];
            for (int axis = 0; axis < 3; axis++) {
                int64_t sign = k / 5 & 1 << axis ? -1 : 1;
                random = random * 1664525u + 1013904223u;
                at.voxel[axis] = sign * places[k % 5] * 16 + (int64_t)(random >> 8) % 40000 - 20000;
                random = random * 1664525u + 1013904223u;
                at.fraction[axis] = k % 3 ? random & 0xfffffff0u : 0;
                v[axis] = (int128)at.voxel[axis] * ((int128)1 << 32) + at.fraction[axis];
            }
            karst_oracle_value d = karst_oracle_density(w.oracle, &at, -1);
            double truth = worlds[i].truth(v);
            if ((double)d.device != truth)
                fail_msg("%s at %lld.%08x %lld.%08x: %g, not %g", worlds[i].body, (long long)at.voxel[0],
                         at.fraction[0], (long long)at.voxel[2], at.fraction[2], (double)d.device, truth);
        }
        world_finish(&w);
    }
}

/* ---- places less their own whole numbers ---- */

typedef long double real;
static real down(real a, real b) { return a - b * floorl(a / b); }
static real near_period(real a, real b) { return a - b * floorl(a / b + 0.5L); }
static real remainder_of(real a, real b) { return a - b * truncl(a / b); }

/* x, y, z in metres, to 2^-63 of them. */
static real round8(const real p[3]) { return near_period(p[1], 8); }
static real moved8(const real p[3]) { return down(p[0] + 1e6L, 8); }
static real tenth(const real p[3]) { return down(p[0] * 3, 10) - 5; }
static real tilted(const real p[3]) { return near_period(p[0] + 2 * p[2], 16); }
static real fmod_of(const real p[3]) { return remainder_of(p[0], 12); }
static real middle(const real p[3]) { return down(p[0], 4) - 2; }
static real upper(const real p[3]) { return -down(-p[2], 5); }
static real mirror_of(const real p[3]) { return fabsl(down(p[0], 2 * 6) - 6); }
static real repeat_of(const real p[3]) { return down(p[0] + 5, 10) - 5; }
static real mixed(const real p[3]) { return near_period(0.75L * p[1] + 0.25L * p[0], 32); }

static const struct {
    const char *body;
    real (*truth)(const real p[3]);
} aways[] = {
    {"return p.y - 8.0 * floor(p.y / 8.0 + 0.5);", round8},
    {"return p.y - floor(p.y * 0.125 + 0.5) * 8.0;", round8},
    {"return -(8.0 * floor(p.y / 8.0 + 0.5) - p.y);", round8},
    {"float k = 8.0; float i = floor((p.y + 0.5 * k) / k); return p.y - k * i;", round8},
    {"float q = p.x + 1e6; return q - 8.0 * floor(q / 8.0);", moved8},
    {"float q = 3.0 * p.x; return q - 10.0 * (floor(q / 10.0) + 0.5);", tenth},
    {"float q = p.x + 2.0 * p.z; return q - 16.0 * floor(q / 16.0 + 0.5);", tilted},
    {"return fmod(p.x, 12.0);", fmod_of},
    {"return p.x - 12.0 * trunc(p.x / 12.0);", fmod_of},
    {"return p.x - (floor(p.x / 4.0) + 0.5) * 4.0;", middle},
    {"return p.z - 5.0 * ceil(p.z / 5.0);", upper},
    {"return mirror(p.x, 6.0);", mirror_of},
    {"return abs(p.x - 12.0 * floor(p.x / 12.0) - 6.0);", mirror_of},
    {"return repeat(p.x, 10.0);", repeat_of},
    {"return mod(p.x + 5.0, 10.0) - 5.0;", repeat_of},
    {"float q = mix(p.y, p.x, 0.25); return q - 32.0 * floor(q / 32.0 + 0.5);", mixed},
};

static void test_places_less_whole_numbers(void **s)
{
    (void)s;
    static const int64_t places[] = {0, 100000, 10000000, 1000000000000};
    uint32_t random = 7;
    for (size_t i = 0; i < sizeof aways / sizeof *aways; i++) {
        text_world w = world_from_body(aways[i].body);
        for (int k = 0; k < 4000; k++) {
            karst_position at;
            real p[3];
            for (int axis = 0; axis < 3; axis++) {
                int64_t sign = k / 4 & 1 << axis ? -1 : 1;
                random = random * 1664525u + 1013904223u;
                at.voxel[axis] = sign * places[k % 4] * 16 + (int64_t)(random >> 8) % 40000 - 20000;
                random = random * 1664525u + 1013904223u;
                at.fraction[axis] = random & 0xf0000000u;
                p[axis] = ((real)at.voxel[axis] + (real)at.fraction[axis] * 0x1p-32L) / 16;
            }
            karst_oracle_value d = karst_oracle_density(w.oracle, &at, -1);
            assert_near((double)d.device, (double)aways[i].truth(p), 0.01 / 16, aways[i].body);
            assert_near(d.precise, (double)aways[i].truth(p), 0.01 / 16, aways[i].body);
        }
        world_finish(&w);
    }
}

/* Shapes in units of their own, against extended precision. */
static void test_large_units(void **s)
{
    (void)s;
    text_world w = world_from_body("return (1.0 - length(p / vec3(3.0e6, 2.0e6, 1.0e6))) * 1.0e6;");
    for (int k = 0; k < 2000; k++) {
        double angle = k * 0.7, lift = sin(k * 1.3), side = sqrt(1 - lift * lift);
        karst_position at = position_at(&w, 3e6 * side * cos(angle), 2e6 * lift, 1e6 * side * sin(angle));
        real sum = 0;
        for (int i = 0; i < 3; i++) {
            real q = ((real)at.voxel[i] + (real)at.fraction[i] * 0x1p-32L) / 16 / (3 - i) * 1e-6L;
            sum += q * q;
        }
        real exact = (1 - sqrtl(sum)) * 1e6L;
        karst_oracle_value d = karst_oracle_density(w.oracle, &at, -1);
        assert_near((double)d.device, (double)exact, 0.01 / 16 / 3, "an ellipsoid"); /* a third as steep at its ends */
    }
    world_finish(&w);
}

/* ---- hashes of sines ---- */

static void find_reach(void *user, const char *line)
{
    const char *at = strstr(line, "tells them apart up to ");
    if (at)
        *(double *)user = strtod(at + strlen("tells them apart up to "), NULL);
}

/* How many of 32 x 32 cells at x = z = `metres` have a number of their own. */
static int count_apart(text_world *w, double metres)
{
    static float seen[1024];
    int count = 0;
    for (int k = 0; k < 1024; k++) {
        float h = density_at(w, floor(metres) + k % 32 + 0.5, 0, floor(metres) + k / 32 + 0.5).device;
        bool is_new = true;
        for (int i = 0; i < count && is_new; i++)
            is_new = seen[i] != h;
        seen[count] = h;
        count += is_new;
    }
    return count;
}

/* Of c = floor(p.xz); the first is as bad as is said soon after. */
static const char *const sines[] = {
    "fract(sin(dot(c, vec2(12.9898, 78.233))) * 43758.5453)",
    "fract(sin(c.x * 127.1 + c.y * 311.7) * 43758.5453)",
    "fract(cos(dot(c, vec2(12.9898, 78.233)) * 1.7) * 43758.5453)",
    "fract(sin(dot(trunc(p.xz), vec2(12.9898, 78.233))) * 43758.5453)",
    "fract(sin(dot(abs(c), vec2(12.9898, 78.233))) * 43758.5453)",
    "fract(sin(dot(max(c, -1000.0), vec2(12.9898, 78.233))) * 43758.5453)",
    "fract(sin(length(c * vec2(12.9898, 78.233))) * 43758.5453)",
    "fract(sin(mod(dot(c, vec2(12.9898, 78.233)), 3.14)) * 43758.5453)",
    "fract(sin((c.x + 7.0) * (c.y + 3.0) * 0.13 + c.x) * 43758.5453)",
    "fract(sin(c.x * c.x + c.y * 7.7) * 43758.5453)",
    "fract(sin(float(ivec2(c).x) * 12.9898 + float(ivec2(c).y) * 78.233) * 43758.5453)",
    "fract(43758.5453 * sin(dot(-c, vec2(12.9898, 78.233))))",
};

static void test_sines_of_cells(void **s)
{
    (void)s;
    for (size_t i = 0; i < sizeof sines / sizeof *sines; i++) {
        char body[256];
        snprintf(body, sizeof body, "vec2 c = floor(p.xz); return %s + 0.0 * p.y;", sines[i]);
        text_world w = world_from_body(body);
        double reach = 0;
        karst_error error = {0};
        assert_true(karst_language_check(w.program, find_reach, &reach, &error));
        int here = count_apart(&w, 0), near = count_apart(&w, reach * 0.9), far = count_apart(&w, reach * 4);
        if (!(reach > 100 && near >= here / 4 * 3) || (i == 0 && !(reach > 1e4 && far < here / 2)))
            fail_msg("%s: said to be told apart up to %g m: %d of 1024 at the origin, %d there, %d beyond", sines[i],
                     reach, here, near, far);
        world_finish(&w);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_truth), cmocka_unit_test(test_places_less_whole_numbers),
                                       cmocka_unit_test(test_large_units), cmocka_unit_test(test_sines_of_cells)};
    return cmocka_run_group_tests_name("whole", tests, NULL, NULL);
}
