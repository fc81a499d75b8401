/* Forms that people write, from the origin out to 10^7 m, without a header: at surfaces each is right to a hundredth of
 * a voxel of 1/16 m, or check has said how far it is: never too far, and not less than a quarter of how far it really
 * is, or of how far it is right to three tenths of that: errors that hardly grow pass a hundredth anywhere.
 * KARST_TEST_FULL=1 tells all figures. */
#include "world_text.h"

#include "producers/language/check.h"

#define EXTENT_M 1e7
#define VOXEL_M 0.0625
#define ENOUGH 0.01 /* voxels */
enum { NUM_PLACES = 60, NUM_STEPS = 60 };

static const char *const forms[] = {
    /* affine less its own whole numbers */
    "return p.y - 8.0 * floor(p.y / 8.0 + 0.5) - 1.0;",
    "vec3 q = p + 1e6; q -= 8.0 * floor(q / 8.0); return 2.0 - length(q - 4.0);",
    "vec3 q = fract(p / 8.0) * 8.0 - 4.0; return 2.0 - length(q);",
    "vec3 q = mod(p, 8.0) - 4.0; return 2.0 - length(q);",
    "vec3 q = mod(p + 4.0, 8.0) - 4.0; return 2.0 - length(q);",
    "vec3 q = abs(mod(p, 16.0) - 8.0) - 4.0; return 1.0 - max(q.x, max(q.y, q.z));",
    "vec3 q = repeat(p, 8.0); return 2.0 - length(q);",
    "vec3 q = mirror(p, 8.0); return 2.0 - length(q - 4.0);",
    "vec3 c = round(p / 8.0); vec3 q = p - 8.0 * c; return 2.0 - length(q);",
    "vec3 c = floor(p / 8.0 + 0.5); vec3 q = p - c * 8.0; return 2.0 - length(q);",
    "vec3 c = ceil(p / 8.0); vec3 q = c * 8.0 - p; return 2.0 - length(q - 4.0);",
    "float x = p.x * 0.125; return 0.3 - abs(x - floor(x) - 0.5);",
    "float x = p.x / 3.0 + p.z / 7.0; return 0.2 - abs(fract(x) - 0.5);",
    "vec2 q = vec2(0.8 * p.x - 0.6 * p.z, 0.6 * p.x + 0.8 * p.z); q = mod(q, 5.0) - 2.5; return 1.0 - length(q);",
    "mat2 m = mat2(0.8, 0.6, -0.6, 0.8); vec2 q = m * p.xz; q -= 5.0 * round(q / 5.0); return 1.0 - length(q);",
    "vec3 q = p; q.xz *= mat2(0.6, 0.8, -0.8, 0.6); q = fract(q) - 0.5; return 0.3 - length(q);",
    "vec3 q = p * 2.0 + vec3(3.0, 1.0, 4.0); q = mod(q, vec3(6.0, 8.0, 10.0)) - vec3(3.0, 4.0, 5.0); return 2.0 - "
    "length(q);",
    "float a = mod(p.x, 10.0), b = mod(p.z, 14.0); return min(a, min(b, min(10.0 - a, 14.0 - b))) - 2.0;",
    "vec2 h = vec2(mod(p.x + p.z, 6.0), mod(p.x - p.z, 6.0)); return 1.0 - length(h - 3.0);",
    "float c = floor(p.x / 16.0); float y = p.y - 4.0 * mod(c, 2.0); return 1.0 - abs(y - 8.0 * round(y / 8.0));",
    "vec3 q = p - 8.0 * clamp(round(p / 8.0), -1e9, 1e9); return 2.0 - length(q);",
    "int i = int(floor(p.x / 8.0)); float x = p.x - 8.0 * float(i); return 1.0 - abs(x - 4.0);",
    "float x = p.x - 8.0 * trunc(p.x / 8.0); return 1.0 - abs(abs(x) - 4.0);",
    "float x = fmod(p.x, 8.0); return 1.0 - abs(abs(x) - 4.0);",
    "vec3 q = p; q.y += 3.0 * mod(floor(q.x / 8.0), 2.0); q = mod(q, 8.0) - 4.0; return 2.0 - length(q);",
    "vec3 q = p; q.x += 0.5 * q.y; q = mod(q, 8.0) - 4.0; return 2.0 - length(q);",
    "vec3 q = p / vec3(4.0, 5.0, 6.0); q -= floor(q); return 0.3 - length(q - 0.5);",
    "return sin(p.x) + 0.5 * sin(p.z) - mod(p.y, 8.0) + 4.0;",
    "return 0.4 * cos(p.x * 0.7 + p.y * 0.2) + abs(mod(p.y, 8.0) - 4.0) - 2.0;",
    "vec3 q = sin(p * 0.5); return q.x + q.y + q.z - 0.5;",
    "vec3 q = p * 0.5; return dot(sin(q), cos(q.zxy));",
    /* mixes, products, planes */
    "return -mix(p.y, p.x, 0.3);",
    "return mix(p.x, p.y, 0.25) + mix(p.z, 1.0, 0.5);",
    "return 0.3 * p.x - 0.7 * p.y + 0.2 * p.z + 1.0;",
    "return dot(p, normalize(vec3(1.0, 2.0, 3.0))) - 3.0;",
    "return plane(p, vec3(0.6, 0.8, 0.0), 2.0);",
    "return 2.0 * (p.y - 0.5 * p.x) + 1.0;",
    "return (p.x + p.y) * 0.5 - (p.x - p.z) * 0.25;",
    "return p.x - p.y;",
    "return max(p.x - p.y, p.z - p.x);",
    "return min(p.y - 0.5 * p.x, 3.0 - abs(p.z - p.x));",
    "return p.x > p.z ? p.x - p.y : p.z - p.y;",
    "return abs(p.x - p.z) - abs(p.y);",
    "return abs(p.x) - abs(p.y) + 0.5 * abs(p.z);",
    "return 6.4e6 - length(p);",
    "return length(p.xz) - p.y;",
    "return 3e6 - max(abs(p.x), max(abs(p.y), abs(p.z)));",
    "return 4e5 - length(vec2(length(p.xz) - 4e6, p.y));",
    "return (1.0 - length(p / vec3(3.0e6, 2.0e6, 1.0e6))) * 1.0e6;",
    "return 1000.0 * exp(p.x * 1e-6) - p.y;",
    "return sqrt(p.x * p.x + 1.0) - p.y;",
    "return p.x * p.x * 1e-7 - p.y;",
    "return p.x * p.z * 1e-7 - p.y;",
    "return 100.0 * log(1.0 + abs(p.x)) - p.y;",
    "return 10.0 * noise(p.xz / 40.0) - mod(p.y, 64.0) + 32.0;",
    "return 60.0 * fbm(p.xz / 200.0, 6) - p.y;",
    "return 60.0 * fbm(p.xz / 200.0 + 1e5, 6) - p.y;",
    "return 3e6 + 900.0 * fbm(p / 3000.0, 6) - length(p);",
    "return 8.0 * valuenoise(p.xz / 16.0) + 4.0 * simplex(p.xz / 9.0) - p.y;",
    "vec2 w = worley(p.xz / 20.0); return 10.0 * (w.y - w.x) - p.y;",
    "vec3 q = p + 2.0 * noise(p / 9.0); return noise(q / 5.0) - 0.1;",
    "vec3 q = p; q.xz += 20.0 * noise(p.xz / 90.0); q.xz = mod(q.xz, 12.0) - 6.0; return 2.0 - length(q.xz);",
    "float h = 20.0 * noise(p.xz / 60.0); h = floor(h / 4.0) * 4.0 + 0.5; return h - p.y;",
    "return box(repeat(p, 12.0), vec3(2.0)) * -1.0;",
    "vec3 q = repeat(p, 20.0); return -smin(sphere(q, 4.0), torus(q, 6.0, 1.0), 1.0);",
    "float a = 0.0; vec3 q = p; for (int i = 0; i < 4; i++) { a += sin(q.x) * sin(q.z); q *= 2.0; } return a - "
    "mod(p.y, 8.0) + 4.0;",
    "vec3 q = p; for (int i = 0; i < 3; i++) q = abs(q - 1e5) - 5e4; return 4e4 - length(q);",
    "vec3 q = abs(p); if (q.x < q.z) q.xz = q.zx; return 1000.0 - q.x + 0.5 * q.z;",
    "return 4.0 * fract(p.x / 8.0) * (1.0 - fract(p.x / 8.0)) - fract(p.y / 8.0);",
};
enum { NUM_FORMS = sizeof forms / sizeof *forms };

static uint64_t state = 1;
static double random_unit(void)
{
    state = state * 6364136223846793005u + 1442695040888963407u;
    return (double)(state >> 11) * 0x1p-53;
}

static double least_m; /* that check says a world is right to; infinite: it says nothing */
static void listen(void *user, const char *line)
{
    static const char before[] = " up to ";
    (void)user;
    const char *at = strstr(line, " from the origin") ? strstr(line, before) : NULL;
    if (at)
        least_m = fmin(least_m, strtod(at + strlen(before), NULL));
}

static karst_position away(const text_world *w, karst_position from, const double way[3], double t_m)
{
    const double by_m[3] = {way[0] * t_m, way[1] * t_m, way[2] * t_m};
    return karst_position_add_m(from, by_m, w->program->header.voxel_log2_m);
}

static bool is_solid(const text_world *w, karst_position from, const double way[3], double t_m)
{
    const karst_position at = away(w, from, way, t_m);
    return karst_oracle_precise_density(w->oracle, &at, -1) > 0;
}

/* How many voxels the surface that a way meets first is off in floats, and how far out it lies, along the farthest
 * axis; below 0: it meets none, or one that jumps. */
static double error_voxels(const text_world *w, karst_position from, const double way[3], double farthest_m,
                           double *out_m)
{
    const bool was = is_solid(w, from, way, 0);
    double near_m = 0, far_m = 0.5;
    while (is_solid(w, from, way, far_m) == was) {
        near_m = far_m;
        far_m *= 1.3;
        if (far_m > farthest_m)
            return -1;
    }
    for (int i = 0; i < NUM_STEPS && far_m - near_m > 1e-5; i++) {
        const double middle_m = (near_m + far_m) / 2;
        if (is_solid(w, from, way, middle_m) == was)
            near_m = middle_m;
        else
            far_m = middle_m;
    }
    const karst_position edges[2] = {away(w, from, way, near_m - VOXEL_M / 16),
                                     away(w, from, way, near_m + VOXEL_M / 16)};
    double ends[2];
    for (int i = 0; i < 2; i++)
        ends[i] = karst_oracle_precise_density(w->oracle, &edges[i], -1);
    double slope = fabs(ends[1] - ends[0]) / (VOXEL_M / 8);
    const karst_position at = away(w, from, way, near_m);
    const double here = karst_oracle_precise_density(w->oracle, &at, -1);
    for (int axis = 0; axis < 3; axis++) { /* across the surface, if the way runs along it */
        const double along[3] = {axis == 0, axis == 1, axis == 2};
        const karst_position beside = away(w, at, along, VOXEL_M / 16);
        slope = fmax(slope, fabs(karst_oracle_precise_density(w->oracle, &beside, -1) - here) / (VOXEL_M / 16));
    }
    const karst_oracle_value v = karst_oracle_density(w->oracle, &at, -1);
    if (!(fabs(v.precise) < slope * VOXEL_M)) /* a jump */
        return -1;
    *out_m = 0;
    for (int axis = 0; axis < 3; axis++)
        *out_m = fmax(*out_m, fabs(ldexp((double)at.voxel[axis], w->program->header.voxel_log2_m)));
    double error = fabs((double)v.device - v.precise);
    for (int i = 0; i < 2; i++) { /* on the surface, what cancels may round alike */
        const karst_oracle_value beside = karst_oracle_density(w->oracle, &edges[i], -1);
        error = fmax(error, fabs((double)beside.device - beside.precise));
    }
    return error / (slope * VOXEL_M);
}

/* The least distance at which the form is off, and at which by three tenths of that; and how many surfaces were looked
 * at. */
static double measure(const text_world *w, int *num_found, double *worst, double *part_off_m)
{
    double off_m = *part_off_m = INFINITY;
    for (int decade = 1; decade <= 14; decade++) {
        const double far_m = pow(10, decade / 2.0);
        for (int i = 0; i < NUM_PLACES; i++) {
            double at[3], way[3], length = 0;
            for (int axis = 0; axis < 3; axis++) {
                at[axis] = (2 * random_unit() - 1) * (i % 3 == 0 && axis == 1 ? fmin(100, far_m) : far_m);
                way[axis] = 2 * random_unit() - 1;
                length += way[axis] * way[axis];
            }
            for (int axis = 0; axis < 3; axis++)
                way[axis] = i % 2 ? way[axis] / sqrt(length) : axis == 1 ? (at[1] > 0 ? -1 : 1) : 0;
            double out_m = 0;
            const double error = error_voxels(w, position_at(w, at[0], at[1], at[2]), way, 2 * far_m, &out_m);
            if (error < 0)
                continue;
            ++*num_found;
            *worst = fmax(*worst, error);
            if (error > ENOUGH)
                off_m = fmin(off_m, out_m);
            if (error > 0.3 * ENOUGH)
                *part_off_m = fmin(*part_off_m, out_m);
        }
    }
    return off_m;
}

static void test_forms(void **s)
{
    (void)s;
    int num_bad = 0;
    for (int i = 0; i < NUM_FORMS; i++) {
        text_world w = world_from_body(forms[i]);
        int num_found = 0;
        double worst = 0, part_off_m, off_m = measure(&w, &num_found, &worst, &part_off_m);
        least_m = INFINITY;
        assert_true(karst_language_check(w.program, listen, NULL, NULL));
        bool is_fine =
            num_found >= 10 && (least_m <= off_m || off_m > EXTENT_M) && fmin(part_off_m, EXTENT_M) <= 4 * least_m;
        if (!is_fine || getenv("KARST_TEST_FULL"))
            print_message("%s %s: off by %.3g voxels, right to %g m; check says %g m; %d surfaces\n",
                          is_fine ? "fine" : "BAD", forms[i], worst, off_m, least_m, num_found);
        num_bad += !is_fine;
        world_finish(&w);
    }
    assert_int_equal(num_bad, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_forms)};
    return cmocka_run_group_tests_name("exact", tests, NULL, NULL);
}
