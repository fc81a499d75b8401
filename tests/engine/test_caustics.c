/* Caustics: where photons land, against rays in double; that no energy is lost; that nothing but the scene, the view
 * and their number decides what is seen. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "karst/karst.h"
#include "tests/support/scene.h"

enum { SIDE = 96, NUM = SIDE * SIDE };

/* A ring of inner radius 1 that mirrors 0.8, around (-4, 0); a ball of glass around (4, 0). The sun stands over -x. */
#define ELEVATION_DEG 40.0
#define RING_X (-4.0)
#define RING_HEIGHT 0.9
#define RING_MIRROR 0.8
#define BALL_X 4.0
#define BALL_RADIUS 0.5
#define BALL_Y 0.75
#define ALBEDO 0.5
#define EYE_HEIGHT 20.0
#define FOV_DEG 7.5
static const char *const world =
    "/*{ \"voxel\": 0.00390625, \"view\": 60,\n"
    "\"sun\": { \"azimuth\": 270, \"elevation\": 40, \"colour\": [1, 1, 1] },\n"
    "\"sky\": { \"zenith\": [0, 0, 0], \"horizon\": [0, 0, 0], \"haze\": 1e12 },\n"
    "\"camera\": { \"position\": [\"-4\", \"20\", \"0\"], \"pitch\": -90, \"fov\": 7.5 } }*/\n"
    "float ring(vec3 p) { return max(abs(length(p.xz - vec2(-4.0, 0.0)) - 1.03) - 0.03, p.y - 0.9); }\n"
    "float density(vec3 p) { return max(-p.y, -ring(p)); }\n"
    "float clear(vec3 p) { return 0.5 - length(p - vec3(4.0, 0.75, 0.0)); }\n"
    "material surface(vec3 p, vec3 n) { material m; m.colour = vec3(0.5);\n"
    "    if (p.y > 0.003) { m.colour = vec3(0.0); m.mirror = 0.8; } return m; }\n"
    "material clear_surface(vec3 p, vec3 n) { material m; m.ior = 1.5;\n"
    "    m.absorption = vec3(0.2, 0.0, 0.5); return m; }\n";
/* The ring alone, and a lamp that stands 10 cm before its wall: so near to a circle light makes a cardioid. */
#define LAMP_X (-0.9)
#define LAMP_HEIGHT 0.6
static const char *const lamp_world =
    "/*{ \"voxel\": 0.00390625, \"view\": 60, \"sun\": { \"colour\": [0, 0, 0] },\n"
    "\"lights\": [{ \"position\": [\"-4.9\", \"0.6\", \"0\"], \"colour\": [1, 1, 1], \"radius\": 0 }],\n"
    "\"sky\": { \"zenith\": [0, 0, 0], \"horizon\": [0, 0, 0], \"haze\": 1e12 },\n"
    "\"camera\": { \"position\": [\"-4\", \"20\", \"0\"], \"pitch\": -90, \"fov\": 7.5 } }*/\n"
    "float ring(vec3 p) { return max(abs(length(p.xz - vec2(-4.0, 0.0)) - 1.03) - 0.03, p.y - 0.9); }\n"
    "float density(vec3 p) { return max(-p.y, -ring(p)); }\n"
    "material surface(vec3 p, vec3 n) { material m; m.colour = vec3(0.5);\n"
    "    if (p.y > 0.003) { m.colour = vec3(0.0); m.mirror = 0.8; } return m; }\n";
/* A flat mirror that stands at x = -4, and a sun of 6 degrees over -x. */
#define DISC_DEG 6.0
#define WALL_WIDTH 1.0
static const char *const flat_world =
    "/*{ \"voxel\": 0.00390625, \"view\": 60,\n"
    "\"sun\": { \"colour\": [0, 0, 0] }, \"lights\": [{ \"kind\": \"sun\", \"azimuth\": 270, \"elevation\": 40,\n"
    "\"size\": 6, \"colour\": [1, 1, 1] }],\n"
    "\"sky\": { \"zenith\": [0, 0, 0], \"horizon\": [0, 0, 0], \"haze\": 1e12 },\n"
    "\"camera\": { \"position\": [\"-4\", \"20\", \"0\"], \"pitch\": -90, \"fov\": 7.5 } }*/\n"
    "float wall(vec3 p) { return max(abs(p.x + 3.7) - 0.3, max(p.y - 0.9, abs(p.z) - 0.5)); }\n"
    "float density(vec3 p) { return max(-p.y, -wall(p)); }\n"
    "material surface(vec3 p, vec3 n) { material m; m.colour = vec3(0.5);\n"
    "    if (p.y > 0.003) { m.colour = vec3(0.0); m.mirror = 0.8; } return m; }\n";
static const char *const plain = "/*{ \"voxel\": 0.0625, \"view\": 60,\n"
                                 "\"camera\": { \"position\": [\"0\", \"2\", \"0\"] } }*/\n"
                                 "float density(vec3 p) { return -p.y; }\n";

typedef struct {
    float light[3 * NUM];
    karst_stats stats;
} picture;
static picture one, other;

static karst_engine *open_engine(const char *text, const karst_engine_config *like, karst_error *error)
{
    karst_engine_config config = *like;
    config.pool_bytes = (uint64_t)128 << 20;
    return scene_create(text, &config, config.width_px ? config.width_px : SIDE,
                        config.width_px ? config.height_px : SIDE, error);
}

static karst_engine *create(const char *text, const karst_engine_config *like)
{
    return open_engine(text, like, NULL);
}

static void settle(karst_engine *engine, picture *p, size_t num_pixels)
{
    bool settled = false;
    assert_ok(karst_engine_settle(engine, 600, NULL, NULL, &settled, &error));
    karst_engine_stats(engine, &p->stats);
    assert_true(settled);
    assert_ok(karst_engine_read_radiance(engine, p->light, 3 * num_pixels, &error));
}

static void look_at(karst_engine *engine, double x)
{
    karst_camera camera = karst_engine_default_camera(engine);
    const double to_m[3] = {x - RING_X, 0, 0};
    camera.position = karst_position_add_m(camera.position, to_m, -8);
    assert_ok(karst_engine_set_camera(engine, &camera, &error));
}

/* ---- rays in double ---- */

static double truth[3][NUM];

/* The side of a pixel on the floor, in metres; and the floor's pixels, from above. */
static double pixel_m(void) { return 2 * EYE_HEIGHT * tan(FOV_DEG / 2 * M_PI / 180) / SIDE; }

/* flux of red, green, blue that falls at (x, z) from the picture's middle. */
static void land(double x, double z, const double flux[3])
{
    const int column = (int)floor(x / pixel_m() + SIDE / 2.0), row = (int)floor(SIDE / 2.0 - z / pixel_m());
    if (column < 0 || row < 0 || column >= SIDE || row >= SIDE)
        return;
    for (int c = 0; c < 3; c++)
        truth[c][row * SIDE + column] += flux[c] / (pixel_m() * pixel_m());
}

/* Light of the sun that the ring's inside mirrors to the floor, whatever often: by angle and height of where it first
 * meets the wall. It flies along +x. */
static void shine_on_ring(void)
{
    enum { AROUND = 1200, UP = 1000 };
    const double slope = tan(ELEVATION_DEG * M_PI / 180), level = cos(ELEVATION_DEG * M_PI / 180);
    memset(truth, 0, sizeof truth);
    for (int i = 0; i < AROUND; i++)
        for (int j = 0; j < UP; j++) {
            const double angle = ((i + 0.5) / AROUND - 0.5) * M_PI, height = (j + 0.5) / UP * RING_HEIGHT;
            double x = cos(angle), z = sin(angle), dx = 1, dz = 0, y = height;
            /* over the near wall, a chord ago */
            if (y + 2 * x * slope < RING_HEIGHT)
                continue;
            double flux = level * x * (M_PI / AROUND) * (RING_HEIGHT / UP);
            for (;;) {
                flux *= RING_MIRROR;
                const double toward = dx * x + dz * z;
                dx -= 2 * toward * x, dz -= 2 * toward * z;
                const double chord = -2 * (dx * x + dz * z);
                if (y / slope <= chord)
                    break;
                x += dx * chord, z += dz * chord, y -= chord * slope;
            }
            const double all[3] = {flux, flux, flux};
            land(x + dx * (y / slope), z + dz * (y / slope), all);
        }
}

/* Light of the lamp that the ring's inside mirrors to the floor: by direction. */
static void shine_of_lamp(void)
{
    enum { AROUND = 3000, DOWN = 1000 };
    memset(truth, 0, sizeof truth);
    for (int i = 0; i < AROUND; i++)
        for (int j = 0; j < DOWN; j++) {
            const double angle = (i + 0.5) / AROUND * 2 * M_PI, down = (j + 0.5) / DOWN,
                         level = sqrt(1 - down * down), reach = LAMP_HEIGHT / down * level; /* along the floor */
            double x = LAMP_X, z = 0, dx = cos(angle), dz = sin(angle), gone = 0, flux = 2 * M_PI / AROUND / DOWN;
            bool is_mirrored = false;
            for (;; is_mirrored = true) {
                const double along = x * dx + z * dz, chord = -along + sqrt(along * along + 1 - x * x - z * z);
                if (gone + chord >= reach)
                    break;
                x += dx * chord, z += dz * chord, gone += chord;
                const double toward = dx * x + dz * z;
                dx -= 2 * toward * x, dz -= 2 * toward * z, flux *= RING_MIRROR;
            }
            const double all[3] = {flux, flux, flux};
            if (is_mirrored)
                land(x + dx * (reach - gone), z + dz * (reach - gone), all);
        }
}

/* Light from all over the sun's disc that the flat mirror throws at the floor: by places of both. */
static void shine_on_wall(void)
{
    enum { UP = 200, ALONG = 200, DISC = 16 };
    const double e = ELEVATION_DEG * M_PI / 180, disc = tan(DISC_DEG / 2 * M_PI / 180);
    int num_inside = 0;
    memset(truth, 0, sizeof truth);
    for (int k = 0; k < DISC * DISC; k++)
        num_inside += hypot(2 * (k % DISC + 0.5) / DISC - 1, 2 * (k / DISC + 0.5) / DISC - 1) < 1;
    for (int k = 0; k < DISC * DISC; k++) {
        const double u = 2 * (k % DISC + 0.5) / DISC - 1, v = 2 * (k / DISC + 0.5) / DISC - 1;
        if (hypot(u, v) >= 1)
            continue;
        const double way[3] = {cos(e) + disc * v * sin(e), -sin(e) + disc * v * cos(e), disc * u};
        const double flux = RING_MIRROR * way[0] / sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2]) *
                            RING_HEIGHT * WALL_WIDTH / (UP * ALONG) / num_inside;
        for (int i = 0; i < UP * ALONG; i++) {
            const double y = (i / ALONG + 0.5) / UP * RING_HEIGHT, z = ((i % ALONG + 0.5) / ALONG - 0.5) * WALL_WIDTH;
            land(y * way[0] / way[1], z - y * way[2] / way[1], (const double[3]){flux, flux, flux});
        }
    }
}

/* How far the floor there is from the near wall, along the light: it is in the wall's shadow up to height / slope. */
static double from_near_wall(double x, double z) { return x + sqrt(fmax(0, 1 - z * z)); }

static bool refract(double d[3], const double n[3], double ratio, double *share)
{
    const double c = -(d[0] * n[0] + d[1] * n[1] + d[2] * n[2]), square = 1 - ratio * ratio * (1 - c * c);
    if (square <= 0)
        return false;
    const double f = sqrt(square), rs = (ratio * c - f) / (ratio * c + f), rp = (ratio * f - c) / (ratio * f + c);
    *share *= 1 - (rs * rs + rp * rp) / 2;
    for (int i = 0; i < 3; i++)
        d[i] = ratio * d[i] + (ratio * c - f) * n[i];
    return true;
}

/* Light that the ball mirrors outside, and that goes straight through: nearly all; little is mirrored inside. */
static void shine_on_ball(void)
{
    enum { ACROSS = 1200 };
    const double e = ELEVATION_DEG * M_PI / 180, way[3] = {cos(e), -sin(e), 0}, up[3] = {sin(e), cos(e), 0};
    static const double absorption[3] = {0.2, 0, 0.5};
    memset(truth, 0, sizeof truth);
    for (int i = 0; i < ACROSS; i++)
        for (int j = 0; j < ACROSS; j++) {
            const double a = 2 * (i + 0.5) / ACROSS - 1, b = 2 * (j + 0.5) / ACROSS - 1, in = 1 - a * a - b * b;
            if (in <= 0)
                continue;
            double o[3], n[3], d[3] = {way[0], way[1], way[2]}, share = 4 * BALL_RADIUS * BALL_RADIUS / ACROSS / ACROSS;
            for (int k = 0; k < 3; k++) {
                n[k] = a * up[k] + b * (k == 2) - sqrt(in) * way[k];
                o[k] = BALL_RADIUS * n[k];
            }
            const double toward = way[0] * n[0] + way[1] * n[1], whole = share;
            const double back[3] = {way[0] - 2 * toward * n[0], way[1] - 2 * toward * n[1], -2 * toward * n[2]};
            refract(d, n, 1 / 1.5, &share);
            if (back[1] < 0) {
                const double far = -(o[1] + BALL_Y) / back[1], lost = whole - share;
                land(o[0] + far * back[0], o[2] + far * back[2], (const double[3]){lost, lost, lost});
            }
            const double inside = -2 * (o[0] * d[0] + o[1] * d[1] + o[2] * d[2]);
            for (int k = 0; k < 3; k++) {
                o[k] += inside * d[k];
                n[k] = -o[k] / BALL_RADIUS;
            }
            if (!refract(d, n, 1.5, &share) || d[1] >= 0)
                continue;
            const double t = -(o[1] + BALL_Y) / d[1];
            double flux[3];
            for (int c = 0; c < 3; c++)
                flux[c] = share * exp(-absorption[c] * inside);
            land(o[0] + t * d[0], o[2] + t * d[2], flux);
        }
}

/* Rms of what differs, over the largest true value, over pixels that count; the largest is smoothed as the picture is:
 * the mean of the pixels around. */
static double rms_of_peak(const picture *p, bool (*counts)(double x, double z, double *direct), int channel,
                          double *ratio)
{
    double sum = 0, peak = 0, is = 0, should = 0;
    int num = 0;
    for (int row = 1; row < SIDE - 1; row++)
        for (int column = 1; column < SIDE - 1; column++) {
            const double x = (column + 0.5 - SIDE / 2.0) * pixel_m(), z = (SIDE / 2.0 - row - 0.5) * pixel_m();
            double direct = 0, around = 0;
            if (!counts(x, z, &direct))
                continue;
            const int i = row * SIDE + column;
            for (int dy = -1; dy <= 1; dy++)
                for (int dx = -1; dx <= 1; dx++)
                    around += truth[channel][i + dy * SIDE + dx] / 9;
            const double light = p->light[3 * i + channel] / ALBEDO - direct;
            sum += (light - truth[channel][i]) * (light - truth[channel][i]);
            peak = fmax(peak, around);
            is += light, should += truth[channel][i];
            num++;
        }
    assert_true(num > 500);
    *ratio = is / should;
    return sqrt(sum / num) / peak;
}

/* Floor inside the ring, but for a few pixels along edges. */
static bool is_in_ring(double x, double z, double *direct)
{
    const double edge = 3 * pixel_m(), slope = tan(ELEVATION_DEG * M_PI / 180);
    const double past = from_near_wall(x, z) - RING_HEIGHT / slope;
    *direct = past > 0 ? sin(ELEVATION_DEG * M_PI / 180) : 0;
    return x * x + z * z < (1 - edge) * (1 - edge) && fabs(past) > edge;
}

/* Floor in the ball's shadow, but for where the ball itself is before it. */
static bool is_behind_ball(double x, double z, double *direct)
{
    const double e = ELEVATION_DEG * M_PI / 180, edge = 3 * pixel_m(), middle = BALL_Y / tan(e);
    const double across = (x - middle) * sin(e);
    *direct = 0;
    return across * across + z * z < (BALL_RADIUS - edge) * (BALL_RADIUS - edge) &&
           x * x + z * z > (BALL_RADIUS + 2 * edge) * (BALL_RADIUS + 2 * edge);
}

/* Floor inside the ring, but for a few pixels along its edge. */
static bool is_around_lamp(double x, double z, double *direct)
{
    const double edge = 3 * pixel_m(), away = x - LAMP_X, square = away * away + z * z + LAMP_HEIGHT * LAMP_HEIGHT;
    *direct = LAMP_HEIGHT / (square * sqrt(square));
    return x * x + z * z < (1 - edge) * (1 - edge);
}

/* Floor before the flat mirror. */
static bool is_before_wall(double x, double z, double *direct)
{
    *direct = sin(ELEVATION_DEG * M_PI / 180);
    return x > -1.2 && x < -0.1 && fabs(z) < 1.2;
}

static void check_energy(const karst_stats_caustics *c, uint64_t num)
{
    const double sum = c->deposited + c->direct + c->absorbed + c->escaped + c->cut_off;
    /* Grids leave a few over. */
    assert_true(c->num_photons <= num && c->num_photons > num - num / 50);
    assert_true(c->num_landed > num / 20 && c->num_landed < num);
    assert_true(c->emitted > 0 && c->deposited > 0);
    assert_true(fabs(sum - c->emitted) <= 1e-9 * c->emitted);
    /* Photons are aimed: what lamps shine on beside what turns light gets few. */
    print_message("of the light %.3f falls beside what turns it\n", c->direct / c->emitted);
    assert_true(c->direct < 0.65 * c->emitted);
}

/* ---- tests ---- */

static uint32_t most_photons(void)
{
    return getenv("KARST_TEST_FULL") ? 1000000 : getenv("KARST_TEST_QUICK") ? 20000 : 40000;
}

/* What of an error with 40,000 photons others may have: noise and blur fall together, down to what pixels along edges
 * and the truth's own rays leave. */
static double most_error(double of_40000, uint32_t num)
{
    return fmax(of_40000 * pow(40000.0 / num, 0.35), 0.005);
}

static void light_lands_where_rays_say(void **state)
{
    (void)state;
    const uint32_t num = most_photons();
    const karst_engine_config config = {.caustics = num};
    karst_engine *engine = create(world, &config);
    double ratio;
    settle(engine, &one, NUM);
    check_energy(&one.stats.caustics, num);
    assert_true(one.stats.caustics.absorbed > 0); /* the ball is not seen, but shone on */
    shine_on_ring();
    const double ring = rms_of_peak(&one, is_in_ring, 0, &ratio);
    print_message("ring: rms %.4f of the peak, light %.4f of the true\n", ring, ratio);
    assert_true(ring <= most_error(0.007, num));
    assert_true(fabs(ratio - 1) < 0.03);
    /* The nephroid's cusp lies half a radius behind the middle. */
    int brightest = 0;
    for (int column = SIDE / 2; column < SIDE; column++) {
        const double x = (column + 0.5 - SIDE / 2.0) * pixel_m();
        const float *light = &one.light[3 * (SIDE / 2 * SIDE + column)];
        if (x < 0.9 && (!brightest || light[0] > one.light[3 * (SIDE / 2 * SIDE + brightest)]))
            brightest = column;
    }
    assert_true(fabs((brightest + 0.5 - SIDE / 2.0) * pixel_m() - 0.5) < 3 * pixel_m());

    look_at(engine, BALL_X);
    settle(engine, &other, NUM);
    check_energy(&other.stats.caustics, num);
    shine_on_ball();
    for (int c = 0; c < 3; c += 2) {
        const double ball = rms_of_peak(&other, is_behind_ball, c, &ratio);
        print_message("ball, channel %d: rms %.4f of the peak, light %.4f of the true\n", c, ball, ratio);
        assert_true(ball <= most_error(0.008, num));
        assert_true(fabs(ratio - 1) < 0.05);
    }
    karst_engine_destroy(engine);
}

/* Behind a flat mirror spots are as wide as the sun's disc makes its light: the patch has soft edges. */
static void a_wide_sun_makes_soft_edges(void **state)
{
    (void)state;
    const karst_engine_config config = {.caustics = 4000};
    karst_engine *engine = create(flat_world, &config);
    double ratio;
    settle(engine, &one, NUM);
    karst_engine_destroy(engine);
    shine_on_wall();
    const double rms = rms_of_peak(&one, is_before_wall, 0, &ratio);
    print_message("flat mirror: rms %.4f of the peak, light %.4f of the true\n", rms, ratio);
    assert_true(rms <= 0.05); /* 0.072 from the disc's middle alone */
    assert_true(fabs(ratio - 1) < 0.03);
}

static void a_lamp_makes_a_cardioid(void **state)
{
    (void)state;
    const uint32_t num = most_photons();
    const karst_engine_config config = {.caustics = num};
    karst_engine *engine = create(lamp_world, &config);
    double ratio;
    settle(engine, &one, NUM);
    karst_engine_destroy(engine);
    check_energy(&one.stats.caustics, num);
    shine_of_lamp();
    const double rms = rms_of_peak(&one, is_around_lamp, 0, &ratio);
    print_message("lamp: rms %.4f of the peak, light %.4f of the true\n", rms, ratio);
    assert_true(rms <= most_error(0.08, num));
    assert_true(fabs(ratio - 1) < 0.03);
}

/* One lane and sixteen, frames with a budget in ms and without, and whatever was seen before. */
static void bits_are_the_same_everywhere(void **state)
{
    (void)state;
    enum { SMALL = 32, NUM_FEW = 20000 }; /* two batches */
    static const karst_engine_config configs[] = {
        {.caustics = NUM_FEW, .width_px = SMALL, .height_px = SMALL, .lanes = 16},
        {.caustics = NUM_FEW, .width_px = SMALL, .height_px = SMALL, .lanes = 1, .budget_ms = 200},
    };
    for (size_t i = 0; i < sizeof configs / sizeof *configs; i++) {
        karst_engine *engine = create(world, &configs[i]);
        picture *p = i ? &other : &one;
        if (i == 0) {
            look_at(engine, BALL_X);
            settle(engine, p, SMALL * SMALL);
            look_at(engine, RING_X);
        }
        settle(engine, p, SMALL * SMALL);
        check_energy(&p->stats.caustics, NUM_FEW);
        karst_engine_destroy(engine);
        assert_memory_equal(one.light, p->light, 3 * SMALL * SMALL * sizeof(float));
        assert_memory_equal(&one.stats.caustics, &p->stats.caustics, sizeof one.stats.caustics);
    }
}

/* With a budget fewer of them make a first picture, near to the settled one, which comes long before. */
static void a_few_are_seen_soon(void **state)
{
    (void)state;
    enum { SMALL = 32, NUM_VALUES = 3 * SMALL * SMALL, NUM_ALL = 60000, MOST_FRAMES = 600 };
    karst_engine_config config = {.caustics = NUM_ALL, .width_px = SMALL, .height_px = SMALL};
    karst_engine *engine = create(world, &config);
    settle(engine, &one, SMALL * SMALL);
    karst_engine_destroy(engine);
    config.budget_ms = 200;
    engine = create(world, &config);
    double off = 1;
    for (int frame = 0; frame < MOST_FRAMES && off > 0.05; frame++) {
        double sum = 0, peak = 0;
        assert_ok(karst_engine_frame(engine, &error));
        karst_engine_stats(engine, &other.stats);
        assert_ok(karst_engine_read_radiance(engine, other.light, NUM_VALUES, &error));
        for (int i = 0; i < NUM_VALUES; i++) {
            const double d = (double)other.light[i] - (double)one.light[i];
            sum += d * d;
            peak = fmax(peak, (double)one.light[i]);
        }
        off = sqrt(sum / NUM_VALUES) / peak;
    }
    print_message("%u of %u photons: %.3f off\n", (unsigned)other.stats.caustics.num_photons, (unsigned)NUM_ALL, off);
    assert_true(off <= 0.05);
    assert_false(other.stats.settled);
    assert_true(other.stats.caustics.num_photons < NUM_ALL / 2);
    karst_engine_destroy(engine);
}

static void expect_usage(const karst_engine_config *config, const char *what)
{
    karst_error error = {0};
    assert_null(open_engine(plain, config, &error));
    assert_int_equal(error.status, KARST_USAGE);
    assert_non_null(strstr(error.message, what));
}

static char warned[512];
static void listen(void *user, karst_log_level level, const char *line)
{
    (void)user;
    if (level == KARST_LOG_WARNING)
        snprintf(warned, sizeof warned, "%s", line);
}

static void what_cannot_be_is_told(void **state)
{
    (void)state;
    karst_engine_config config = {.caustics = KARST_ENGINE_MAX_PHOTONS + 1};
    expect_usage(&config, "photons");
    config = (karst_engine_config){.caustics = 100, .integrator = KARST_INTEGRATOR_FULL};
    expect_usage(&config, "full light");
    config = (karst_engine_config){.caustics = 100, .no_shadows = true};
    expect_usage(&config, "shadows");
    const karst_log log = {.write = listen, .max_level = KARST_LOG_WARNING};
    config = (karst_engine_config){.caustics = 100, .log = &log, .tone = KARST_TONE_OF_FILM};
    config.width_px = config.height_px = 32;
    karst_engine *engine = create(plain, &config);
    assert_non_null(strstr(warned, "nothing makes caustics"));
    settle(engine, &one, 32 * 32);
    assert_int_equal(one.stats.caustics.num_photons, 0);
    karst_engine_destroy(engine);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(light_lands_where_rays_say),
        cmocka_unit_test(a_wide_sun_makes_soft_edges),
        cmocka_unit_test(a_lamp_makes_a_cardioid),
        cmocka_unit_test(bits_are_the_same_everywhere),
        cmocka_unit_test(a_few_are_seen_soon),
        cmocka_unit_test(what_cannot_be_is_told),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
