/* Worlds whose surface is, for a part, where the density jumps: what people write with floor, mod, fract, step, round,
 * comparisons, choices, angles, signs and ints. Each stands here once, in words that are both the world's language and
 * C, so that the truth is computed from the text itself: a ray's first solid place, and which way the surface faces
 * there. */
#ifndef KARST_TESTS_HARD_JUMPING_H
#define KARST_TESTS_HARD_JUMPING_H

#include <math.h>
#include <stdbool.h>

typedef struct {
    double x, y, z;
} place;
typedef struct {
    double x, y;
} pair;

/* ---- the language's words ---- */

static inline pair vec2(double x, double y) { return (pair){x, y}; }
static inline double length(pair v) { return hypot(v.x, v.y); }
static inline double length3(double x, double y, double z) { return sqrt(x * x + y * y + z * z); }
static inline double mod(double a, double b) { return a - b * floor(a / b); }
static inline double fract(double a) { return a - floor(a); }
static inline double step(double edge, double a) { return a < edge ? 0 : 1; }
static inline double sign(double a) { return (a > 0) - (a < 0); }
static inline double mix(double a, double b, double t) { return a + (b - a) * t; }
static inline double min(double a, double b) { return b < a ? b : a; }
static inline double max(double a, double b) { return a < b ? b : a; }
static inline double clamp(double a, double low, double high) { return min(max(a, low), high); }
static inline double number(bool a) { return a; }
static inline double whole(double a) { return trunc(a); }
static inline double low_bits(double a) { return mod(floor(a), 4); }
static inline double height_of(double a) { return a < 1 ? 3 : a < 2 ? 7 : a < 3 ? 1 : 5; }
#define atan atan2
#define abs fabs

/* Before each world: those that the language has no word for. */
#define JUMPING_PRELUDE                                                            \
    "float length3(float x, float y, float z) { return length(vec3(x, y, z)); }\n" \
    "float number(bool a) { return float(a); }\n"                                  \
    "float whole(float a) { return float(int(a)); }\n"                             \
    "float low_bits(float a) { return float(int(floor(a)) & 3); }\n"               \
    "float height_of(float a) {\n"                                                 \
    "    float h[4] = float[4](3.0, 7.0, 1.0, 5.0);\n"                             \
    "    return h[clamp(int(a), 0, 3)];\n"                                         \
    "}\n"

/* Name; camera (x, y, z, yaw, pitch); density; and what passes whole numbers where it jumps (two such; 0: one). */
#define JUMPING_WORLDS(X)                                                                                             \
    X(sawtooth, "0.3, 13, -0.7, -55, -20", mod(p.x, 8.0) - p.y, p.x / 8.0, 0)                                         \
    X(sawtooth_from_behind, "0.3, 13, -0.7, -20, -25", mod(p.x, 8.0) - p.y, p.x / 8.0, 0)                             \
    X(oblique_teeth, "0, 12, 0, 215, -24", 6.0 * fract(p.x / 9.0 + p.z / 13.0) - p.y, p.x / 9.0 + p.z / 13.0, 0)      \
    X(falling_teeth, "0, 14, 0, 15, -20", 7.0 * (1.0 - fract(p.z / 10.0 + 0.3 * sin(p.x / 9.0))) - p.y,               \
      p.z / 10.0 + 0.3 * sin(p.x / 9.0), 0)                                                                           \
    X(flat_teeth, "0.3, 13, -0.7, -55, -20", 1e-4 * (mod(p.x, 8.0) - p.y), p.x / 8.0, 0)                              \
    X(teeth_of_signs, "0.3, 13, -0.7, -55, -20", p.y < mod(p.x, 8.0) ? 1.0 : -1.0, p.x / 8.0, 0)                      \
    X(teeth_in_flat_air, "0.3, 13, -0.7, -55, -20", p.y < mod(p.x, 8.0) ? 1.0 : 0.0, p.x / 8.0, 0)                    \
    X(terraces, "-20, 17, -20, 60, -22", 7.0 * floor(2.3 * sin(p.x / 29.0) * cos(p.z / 26.0)) - p.y,                  \
      2.3 * sin(p.x / 29.0) * cos(p.z / 26.0), 0)                                                                     \
    X(half_terraces, "-20, 17, -20, 60, -22",                                                                         \
      7.0 * mix(floor(2.3 * sin(p.x / 29.0) * cos(p.z / 26.0)), 2.3 * sin(p.x / 29.0) * cos(p.z / 26.0), 0.4) - p.y,  \
      2.3 * sin(p.x / 29.0) * cos(p.z / 26.0), 0)                                                                     \
    X(tower, "0, 9, -40, 0, -6", 14.0 * step(length(vec2(p.x, p.z)), 12.0) - p.y, length(vec2(p.x, p.z)) / 12.0, 0)   \
    X(well, "0, 16, -3, 10, -35", 9.0 * step(12.0, length(vec2(p.x, p.z))) - p.y, length(vec2(p.x, p.z)) / 12.0, 0)   \
    X(rounds, "0, 22, 0, -70, -28", 6.0 * round(1.6 * sin(p.x / 13.0 + p.z / 31.0)) - p.y,                            \
      1.6 * sin(p.x / 13.0 + p.z / 31.0) + 0.5, 0)                                                                    \
    X(choice, "-14, 9, -4, 70, -18", p.x > 3.0 * sin(p.z / 5.0) ? 6.0 - p.y : -p.y, p.x - 3.0 * sin(p.z / 5.0), 0)    \
    X(choice_of_slopes, "-16, 7, -4, 75, -10", p.x > 4.0 ? 9.0 - 0.5 * p.x - p.y : 0.2 * p.x - p.y, p.x / 4.0, 0)     \
    X(comparison, "0, 12, -36, 5, -14", 7.0 * number(p.x * p.x + 2.0 * p.z * p.z < 260.0) - p.y,                      \
      (p.x * p.x + 2.0 * p.z * p.z) / 260.0, 0)                                                                       \
    X(cut_of_atan, "-12, 9, -20, -10, -14", 2.0 * atan(p.z, p.x) - p.y, p.z, 0)                                       \
    X(spiral, "0, 26, -34, 0, -28", 3.0 * floor(1.9 * atan(p.z, p.x)) - p.y, 1.9 * atan(p.z, p.x), p.z)               \
    X(signs, "-16, 9, 6, 80, -14", 4.0 * sign(p.x - 2.0 * cos(p.z / 4.0)) - p.y, p.x - 2.0 * cos(p.z / 4.0), 0)       \
    X(cut_at_samples, "3, -9, -25, 0, 20",                                                                            \
      2.0 + 2.0 * atan(p.y, 0.0) - 0.5 * abs(p.z) - 0.01 * (p.x * p.x + p.y * p.y + p.z * p.z), p.y, 0)                \
    X(stairs_of_ints, "-10, 9, 0, 60, -25", 2.5 * whole(p.x / 4.0 + 100.0) - 250.0 - p.y, p.x / 4.0, 0)               \
    X(stairs_of_bits, "0, 14, 0, -60, -25", 3.0 * low_bits(p.x / 7.0 + p.z / 17.0) - p.y, p.x / 7.0 + p.z / 17.0, 0)  \
    X(checkers, "0.4, 15, 0.3, 35, -26", 5.0 * mod(floor(p.x / 6.0) + floor(p.z / 6.0), 2.0) - p.y, p.x / 6.0,        \
      p.z / 6.0)                                                                                                      \
    X(cells, "0.4, 18, 0.3, 35, -26", mod(7.0 * floor(p.x / 8.0) + 5.0 * floor(p.z / 8.0), 11.0) - p.y, p.x / 8.0,    \
      p.z / 8.0)                                                                                                      \
    X(listed, "0.4, 14, 0.3, 135, -24", height_of(mod(p.x / 7.0, 4.0)) - p.y, p.x / 7.0, 0)                           \
    X(shells, "0, 6, -40, 0, -8", 1.5 - floor(length3(p.x, p.y, p.z) / 6.0), length3(p.x, p.y, p.z) / 6.0, 0)         \
    X(rings, "0, 15, -4, 20, -24", 4.0 - mod(length(vec2(p.x, p.z)), 9.0) - p.y, length(vec2(p.x, p.z)) / 9.0, 0)     \
    X(ledges, "0, 34, -22, 0, -58", 22.0 - length(vec2(p.x, p.z)) - 3.0 * floor(p.y / 4.0), p.y / 4.0, 0)             \
    X(overhangs, "0, 21, -16, 0, -48", 9.0 - length(vec2(p.x, p.z)) + 4.0 * mod(floor(p.y / 5.0), 2.0), p.y / 5.0, 0) \
    X(leaning, "-12, 11, 0, 60, -22", 4.0 * floor(p.x / 8.0 + p.y / 24.0) - p.y, p.x / 8.0 + p.y / 24.0, 0)           \
    X(ceils, "0, 12, 0, 150, -25", 5.0 * ceil(1.6 * sin(p.z / 19.0 - p.x / 24.0)) - p.y,                              \
      1.6 * sin(p.z / 19.0 - p.x / 24.0), 0)                                                                          \
    X(truncated, "0, 14, 0, 70, -24", 4.0 * trunc(2.4 * sin(p.x / 11.0)) - p.y, 2.4 * sin(p.x / 11.0), 0)             \
    X(block, "-20, 14, -26, 38, -16", 11.0 * step(abs(p.x), 8.0) * step(abs(p.z), 6.0) - p.y, abs(p.x) / 8.0,         \
      abs(p.z) / 6.0)                                                                                                 \
    X(clamped, "-24, 13, 0, 60, -20", clamp(3.0 * floor(p.x / 6.0 + 2.0), 0.0, 9.0) - p.y, p.x / 6.0, 0)              \
    X(canyon, "0, 12, -2, 8, -28", max(0.2 * p.x, 6.0 * step(5.0, abs(p.x + 3.0 * sin(p.z / 9.0)))) - p.y,            \
      abs(p.x + 3.0 * sin(p.z / 9.0)) / 5.0, 0)                                                                       \
    X(far_teeth, "8000000.3, 13, -0.7, -55, -20", mod(p.x, 8.0) - p.y, p.x / 8.0, 0)

typedef double jumping_number(place p);
typedef struct {
    const char *name, *camera, *text;
    jumping_number *density, *jumps[2];
} jumping_world;

#define JUMPING_FUNCTIONS(id, camera, d, a, b)        \
    static double id##_density(place p) { return d; } \
    static double id##_first(place p) { return a; }   \
    static double id##_second(place p) { return (void)p, b; }
#define JUMPING_ROW(id, camera, d, a, b)                           \
    {#id,                                                          \
     camera,                                                       \
     JUMPING_PRELUDE "float density(vec3 p) { return " #d "; }\n", \
     id##_density,                                                 \
     {id##_first, id##_second}},

JUMPING_WORLDS(JUMPING_FUNCTIONS)
static const jumping_world jumping_worlds[] = {JUMPING_WORLDS(JUMPING_ROW)};
enum { JUMPING_NUM_WORLDS = sizeof jumping_worlds / sizeof *jumping_worlds };

/* ---- the truth ---- */

typedef struct {
    double t_m, normal[3];
    bool is_hit, jumps;
    int patch; /* of the surface: pixels of the same one next to one another see no edge */
} jumping_hit;

static inline place jumping_place(const double from[3], const double way[3], double t_m)
{
    return (place){from[0] + t_m * way[0], from[1] + t_m * way[1], from[2] + t_m * way[2]};
}

static inline void jumping_slope(jumping_number *of, place p, double slope[3])
{
    const double by = 1e-5;
    const place ends[6] = {{p.x + by, p.y, p.z}, {p.x - by, p.y, p.z}, {p.x, p.y + by, p.z},
                           {p.x, p.y - by, p.z}, {p.x, p.y, p.z + by}, {p.x, p.y, p.z - by}};
    for (int i = 0; i < 3; i++)
        slope[i] = (of(ends[2 * i]) - of(ends[2 * i + 1])) / (2 * by);
}

/* The first solid place of a ray that begins in air: steps of a sixth of its footprint, then halves. */
static inline jumping_hit jumping_truth(const jumping_world *w, const double from[3], const double way[3],
                                        double footprint, double farthest_m)
{
    jumping_hit hit = {.t_m = (double)INFINITY};
    double air_m = 0, solid_m = 0.01, slope[3], length = 0, toward = 0;
    while (!(w->density(jumping_place(from, way, solid_m)) > 0)) {
        air_m = solid_m;
        solid_m += fmax(0.002, solid_m * footprint / 6);
        if (solid_m > farthest_m)
            return hit;
    }
    for (int i = 0; i < 60; i++) {
        const double middle_m = 0.5 * (air_m + solid_m);
        *(w->density(jumping_place(from, way, middle_m)) > 0 ? &solid_m : &air_m) = middle_m;
    }
    hit.is_hit = true;
    hit.t_m = solid_m;
    /* what jumps does so within next to nothing, and what slopes comes to nothing there */
    const place before = jumping_place(from, way, solid_m - 1e-6), behind = jumping_place(from, way, solid_m + 1e-6);
    const place before2 = jumping_place(from, way, solid_m - 3e-6);
    const double rise = w->density(behind) - w->density(before), usual = w->density(before) - w->density(before2);
    jumping_number *what = w->density;
    place at = jumping_place(from, way, solid_m);
    for (int k = 0; k < 2; k++) {
        const double f = floor(w->jumps[k](before)), b = floor(w->jumps[k](behind));
        if (f != b && fabs(rise) > 8 * fabs(usual)) {
            hit.jumps = true;
            what = w->jumps[k];
            hit.patch = 1000 * (k + 1) + (int)fmax(f, b) % 500;
            break;
        }
    }
    if (!hit.jumps)
        hit.patch = 7 * (int)floor(w->jumps[0](at)) % 400 + 3 * (int)floor(w->jumps[1](at)) % 400;
    jumping_slope(what, at, slope);
    for (int i = 0; i < 3; i++) {
        length += slope[i] * slope[i];
        toward += slope[i] * way[i];
    }
    for (int i = 0; i < 3; i++)
        hit.normal[i] = (toward > 0 ? -slope[i] : slope[i]) / sqrt(length);
    return hit;
}

#endif
