/* Paths through an index of refraction that varies, against closed forms: lenses, a rod, what every such path keeps;
 * and jumps of the index against Snell's law. The stepping is the devices' own, with one lane. */
#include "raycast/cast/vectors.clh"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>

/* Bodies around the origin, R voxels wide; `start` is where the chord starts. */
#define R 100.0f
typedef enum { LUNEBURG, FISH_EYE, ROD, WELL, CORE, SPECK } kind;
typedef struct {
    kind kind;
    vector3 start;
} bend_field;

#include "raycast/light/bend.clh"

static const long double pi = 3.14159265358979323846264338327950288L;

static const float tolerances[2] = {KARST_BEND_TOLERANCE, KARST_BEND_FINE_TOLERANCE};

#define ROD_INDEX 1.5f
#define ROD_BEND 0.4f /* n^2 = ROD_INDEX^2 (1 - (ROD_BEND r / R)^2) */
#define CORE_RADIUS 50.0f
#define SPECK_RADIUS 0.4f

static float bend_index(const bend_field *field, const vector3 *at, float gradient[3], vint *fault)
{
    const vector3 p = bend_add(&field->start, 1, at);
    const float along = field->kind == ROD ? 0 : p.z * p.z, square = (p.x * p.x + p.y * p.y + along) / (R * R);
    float n = 1, slope = 0; /* the gradient is slope times p */
    switch (field->kind) {
    case LUNEBURG:
        n = sqrtf(fmaxf(2 - square, 1));
        slope = square < 1 ? -1 / (n * R * R) : 0;
        break;
    case FISH_EYE:
        n = 2 / (1 + square);
        slope = -4 / ((1 + square) * (1 + square) * R * R);
        break;
    case ROD:
        n = ROD_INDEX * sqrtf(1 - ROD_BEND * ROD_BEND * square);
        slope = -ROD_INDEX * ROD_INDEX * ROD_BEND * ROD_BEND / (n * R * R);
        break;
    case WELL:
        n = 1.2f + 0.6f * expf(-4 * square);
        slope = -4.8f * expf(-4 * square) / (R * R);
        break;
    case CORE:
        n = square * R * R < CORE_RADIUS * CORE_RADIUS ? 1 : 1.5f;
        break;
    case SPECK:
        n = square * R * R < SPECK_RADIUS * SPECK_RADIUS ? 1 : 1.5f;
        break;
    }
    gradient[0] = slope * p.x, gradient[1] = slope * p.y, gradient[2] = field->kind == ROD ? 0 : slope * p.z;
    *fault = 0;
    return n;
}

static float bend_index_alone(const bend_field *field, const vector3 *at)
{
    float gradient[3];
    vint fault;
    return bend_index(field, at, gradient, &fault);
}

static float bend_matter(const bend_field *field, const vector3 *at)
{
    const vector3 p = bend_add(&field->start, 1, at);
    if (field->kind == ROD)
        return R - hypotf(p.x, p.y);
    return R - sqrtf(bend_dot(&p, &p));
}

/* By the distances from the centre that a cube reaches, and derivatives by hand. */
static bool is_blind; /* a mutant: no jump is excluded, or found */
static bend_bound bend_bounds(const bend_field *field, const vector3 *at, float radius)
{
    const vector3 p = bend_add(&field->start, 1, at);
    const float middle = sqrtf(bend_dot(&p, &p)), reach = radius * 1.7320509f, far = middle + reach,
                near = fmaxf(middle - reach, 0);
    const float per = 1 / (R * R), edge = field->kind == CORE ? CORE_RADIUS : field->kind == SPECK ? SPECK_RADIUS : R;
    bend_bound b = {.known = -1, .inside = -(far < R), .least = 1, .most = 1.5f};
    const bool meets_edge = near <= edge && far >= edge;
    switch (field->kind) {
    case LUNEBURG: /* the pull is -r / R^2 */
        b.most = 1.4142136f;
        b.steepness = near < R ? per : 0;
        b.jump = meets_edge ? 1 / R : 0;
        break;
    case FISH_EYE: /* |n'| <= 1.3 / R, |n''| and |n' / r| <= 4 / R^2 */
        b.most = 2;
        b.steepness = (1.69f + 2 * 6.93f) * per;
        break;
    case ROD:
        b.inside = -(hypotf(p.x, p.y) + reach < R);
        b.steepness = ROD_INDEX * ROD_INDEX * ROD_BEND * ROD_BEND * per;
        break;
    case WELL: /* |n'| <= 1.03 / R, |n''| and |n' / r| <= 4.8 / R^2 */
        b.least = 1.2f, b.most = 1.8f;
        b.steepness = (1.07f + 1.8f * 8.32f) * per;
        break;
    case CORE:
    case SPECK:
        b.parts = -(int)(meets_edge && !is_blind);
        break;
    }
    return b;
}

/* ---- whole paths ---- */

typedef struct {
    vector3 at, way;
    float speed;
    int num_chords, steps, met;
    bool leaves;
} way_out;

/* Follows a path from a place, until it leaves or has been followed by so many chords; told of each chord's end. */
static way_out follow(kind of, vector3 at, vector3 way, float tolerance, int most_chords,
                      void (*see)(const way_out *now, void *user), void *user)
{
    way_out now = {.at = at, .way = way};
    bend_path path = {.met = 1};
    for (; now.num_chords < most_chords && !now.leaves; now.num_chords++) {
        const bend_field field = {of, now.at};
        const bend_settings with = {.voxel = 1, .tolerance = tolerance, .reach = 1e9f, .most_met = 64};
        path.s.at = (vector3){0, 0, 0};
        path.s.matter = 0;
        bend_look(&field, &path.s);
        const float speed = now.speed > 0 ? now.speed : path.s.index;
        path.s.velocity = (vector3){now.way.x * speed, now.way.y * speed, now.way.z * speed};
        bend_chord(&field, &with, -1, &path);
        now.at = bend_add(&now.at, 1, &path.s.at);
        now.way = dielectric_unit(&path.s.velocity);
        now.speed = sqrtf(bend_dot(&path.s.velocity, &path.s.velocity));
        now.leaves = path.leaves != 0;
        now.steps = path.steps;
        now.met = path.met;
        assert_false(path.cut);
        if (see)
            see(&now, user);
    }
    return now;
}

/* What parallel rays are off by at the far pole, in radii: root mean square. */
static double luneburg_spread(float tolerance, int *most_steps)
{
    double sum = 0;
    int num = 0;
    *most_steps = 0;
    for (int i = 1; i < 20; i++, num++) {
        const float x = R * (float)i / 20, z = -sqrtf(R * R - x * x);
        const way_out out =
            follow(LUNEBURG, (vector3){x * 0.6f, x * 0.8f, z}, (vector3){0, 0, 1}, tolerance, 256, NULL, NULL);
        assert_true(out.leaves);
        *most_steps = out.steps > *most_steps ? out.steps : *most_steps;
        sum += pow(out.at.x / R, 2) + pow(out.at.y / R, 2) + pow(out.at.z / R - 1, 2);
    }
    return sqrt(sum / num);
}

static void luneburgs_lens_focuses(void **state)
{
    (void)state;
    int steps, fine_steps;
    const double spread = luneburg_spread(tolerances[0], &steps), fine = luneburg_spread(tolerances[1], &fine_steps);
    print_message("spread %.2g R in %d steps, %.2g R in %d\n", spread, steps, fine, fine_steps);
    assert_true(spread < 1e-3);
    assert_true(fine < 1e-5);
}

/* By steps of one length, as far as a quarter of the way around: r = r0 cos + v0 sin. */
static void steps_are_of_the_second_order(void **state)
{
    (void)state;
    const bend_field field = {LUNEBURG, {0, 0, 0}};
    double before = 0;
    for (int num = 8; num <= 64; num *= 2) {
        bend_state s = {.at = {0.3f * R, 0.4f * R, -0.5f * R}};
        bend_look(&field, &s);
        const vector3 way = {0.28f, 0, 0.96f};
        s.velocity = (vector3){way.x * s.index, 0, way.z * s.index};
        const vector3 at0 = s.at, v0 = s.velocity;
        const double all = 0.7; /* of R; stays inside */
        for (int i = 0; i < num; i++)
            s = bend_step(&field, &s, (float)(all * R / num));
        const double c = cos(all), sine = sin(all) * R;
        const double off = sqrt(pow(s.at.x - at0.x * c - v0.x * sine, 2) + pow(s.at.y - at0.y * c - v0.y * sine, 2) +
                                pow(s.at.z - at0.z * c - v0.z * sine, 2)) / R;
        print_message("%d steps: off by %.3g R\n", num, off);
        if (before > 0)
            assert_true(log2(before / off) > 1.9 && log2(before / off) < 2.1);
        before = off;
    }
}

/* Maxwell's: rays from a point of the rim meet opposite, on circles through both that go by -R^2/r. */
typedef struct {
    double plane[3], centre[3], radius, worst;
} circle;

static void see_circle(const way_out *now, void *user)
{
    circle *c = user;
    const double x = now->at.x - c->centre[0], y = now->at.y - c->centre[1], z = now->at.z - c->centre[2];
    const double off = fabs(sqrt(x * x + y * y + z * z) - c->radius) / R;
    c->worst = off > c->worst ? off : c->worst;
}

static void the_fish_eye_goes_in_circles(void **state)
{
    (void)state;
    for (int fine = 0; fine < 2; fine++) {
        double worst = 0, circles = 0;
        for (int i = -8; i <= 8; i++) {
            /* From (-R, 0, 0), at an angle to the diameter: the circle's centre lies on the plane across it. */
            const double angle = i * 0.16;
            const vector3 way = {(float)cos(angle), (float)sin(angle), 0};
            circle c = {.centre = {0, i ? -R / tan(angle) : 0, 0}, .radius = i ? R / fabs(sin(angle)) : R};
            const way_out out = follow(FISH_EYE, (vector3){-R, 0, 0}, way, tolerances[fine], 256,
                                       i ? see_circle : NULL, &c);
            assert_true(out.leaves);
            const double off = hypot(out.at.x / R - 1, out.at.y / R);
            worst = off > worst ? off : worst;
            circles = c.worst > circles ? c.worst : circles;
        }
        print_message("fish-eye%s: focus off by %.2g R, circles by %.2g R\n", fine ? ", fine" : "", worst, circles);
        assert_true(worst < (fine ? 5e-5 : 1e-3) && circles < (fine ? 5e-5 : 1e-3));
    }
}

/* In the rod x = A sin(k sigma), z = vz sigma. Zeros of x between chords' ends are found by the slope there. */
typedef struct {
    double x, z, slope, first, last;
    int num;
} zeros;

static void see_zero(const way_out *now, void *user)
{
    zeros *s = user;
    const double slope = (double)now->way.x / (double)now->way.z;
    if (s->x != 0 && (s->x > 0) != (now->at.x > 0)) {
        /* a cubic through both ends with their slopes */
        const double h = now->at.z - s->z;
        double lo = 0, hi = 1;
        for (int i = 0; i < 60; i++) {
            const double t = (lo + hi) / 2, a = 1 - t;
            const double x = s->x * (1 + 2 * t) * a * a + s->slope * h * t * a * a + now->at.x * t * t * (3 - 2 * t) -
                             slope * h * t * t * a;
            if ((x > 0) == (s->x > 0))
                lo = t;
            else
                hi = t;
        }
        s->last = s->z + h * lo;
        s->first = s->num++ ? s->first : s->last;
    }
    s->x = now->at.x, s->z = now->at.z, s->slope = slope;
}

static void a_graded_rod_has_its_period(void **state)
{
    (void)state;
    for (int fine = 0; fine < 2; fine++) {
        zeros seen = {0};
        const double n0 = (double)ROD_INDEX * sqrt(1 - pow(0.4 * 0.5, 2)); /* at x = R / 2 */
        const way_out out = follow(ROD, (vector3){0.5f * R, 0, 0}, (vector3){0, 0, 1}, tolerances[fine],
                                   fine ? 120 : 250, see_zero, &seen);
        assert_false(out.leaves);
        assert_true(seen.num > 6);
        const double period = 2 * (seen.last - seen.first) / (seen.num - 1);
        const double expected = (double)(2 * pi) * n0 / (1.5 * 0.4) * (double)R;
        print_message("rod: %d half periods of %.7g, not %.7g: off by %.2g\n", seen.num - 1, period, expected,
                      period / expected - 1);
        assert_true(fabs(period / expected - 1) < (fine ? 1e-5 : 1e-4));
    }
}

typedef struct {
    double constant, worst;
} bouguer;

static void see_bouguer(const way_out *now, void *user)
{
    bouguer *b = user;
    const double v[3] = {(double)now->way.x * now->speed, (double)now->way.y * now->speed,
                         (double)now->way.z * now->speed};
    const double x = now->at.y * v[2] - now->at.z * v[1], y = now->at.z * v[0] - now->at.x * v[2],
                 z = now->at.x * v[1] - now->at.y * v[0];
    const double is = sqrt(x * x + y * y + z * z);
    b->constant = b->constant > 0 ? b->constant : is;
    b->worst = fmax(b->worst, fabs(is / b->constant - 1));
}

/* n r sin(phi) of paths about a centre. */
static void bouguers_product_is_kept(void **state)
{
    (void)state;
    double worst = 0;
    for (int i = 1; i < 12; i++) {
        const float x = R * (float)i / 13, z = -sqrtf(R * R - x * x);
        bouguer b = {0};
        const way_out out =
            follow(WELL, (vector3){x, 0, z}, (vector3){0.36f, 0.48f, 0.8f}, tolerances[0], 256, see_bouguer, &b);
        assert_true(out.leaves);
        worst = fmax(worst, b.worst);
    }
    print_message("n r sin(phi) off by %.2g at most\n", worst);
    assert_true(worst < 1e-5);
}

/* ---- jumps ---- */

/* Through a body of 1.5 with a core of 1, against Snell's law in long double; total reflection from where it begins.
 * Choices fall as those of pixels' centres do: at these angles what is refracted goes on, or all is reflected. */
static void jumps_are_surfaces(void **state)
{
    (void)state;
    long double worst = 0;
    int num_through = 0, num_reflected = 0;
    for (int i = 0; i < 46; i++) {
        const long double x = (long double)CORE_RADIUS * i / 50, n = 1.5L;
        const float z = -80;
        const way_out out = follow(CORE, (vector3){(float)x, 0, z}, (vector3){0, 0, 1}, tolerances[0], 256, NULL, NULL);
        assert_true(out.leaves);
        /* The angles at the core, and the way out of it. */
        const long double a = asinl(x / (long double)CORE_RADIUS), sine = n * sinl(a);
        if (fabsl(sine - 1) < 0.05L || (sine < 1 && out.met != 3)) /* next to total reflection, or one that chose to */
            continue;
        const long double turn = sine < 1 ? 2 * (asinl(sine) - a) : -(pi - 2 * a);
        num_through += sine < 1, num_reflected += sine >= 1;
        assert_int_equal(out.met, sine < 1 ? 3 : 2);
        /* Away from the axis as it enters a core that is thinner; reflected back outwards. */
        const long double expected_x = sine < 1 ? sinl(turn) : sinl(-turn), expected_z = cosl(turn);
        const long double off = hypotl((long double)out.way.x - expected_x, (long double)out.way.z - expected_z);
        worst = off > worst ? off : worst;
    }
    print_message("a core of 1 in 1.5: %d rays through, %d reflected, off by %.2Lg rad at most\n", num_through,
                  num_reflected, worst);
    assert_true(num_through > 25 && num_reflected > 5);
    assert_true(worst < 1e-4L);
}

/* A ball of another index, less than a voxel wide, in long straight steps: rays that meet it are turned by it. */
static int count_turned(void)
{
    int num = 0;
    for (int i = 0; i < 12; i++) {
        const float x = SPECK_RADIUS * ((float)i / 12 - 0.45f), z = -80 - 1.7f * (float)i;
        const way_out out = follow(SPECK, (vector3){x, 0.05f, z}, (vector3){0, 0, 1}, tolerances[0], 256, NULL, NULL);
        assert_true(out.leaves);
        num += out.met > 1;
    }
    return num;
}

static void no_body_is_lost(void **state)
{
    (void)state;
    const int num = count_turned();
    is_blind = true;
    const int blind = count_turned();
    is_blind = false;
    print_message("%d of 12 rays are turned by a speck, %d where no bound says that it may be there\n", num, blind);
    assert_int_equal(num, 12);
    assert_true(blind < 12);
}

/* Where the index is the same throughout, steps are as long as what clear matter leaves. */
static void steps_of_what_does_not_bend_are_few(void **state)
{
    (void)state;
    const way_out out = follow(CORE, (vector3){60, 0, -79}, (vector3){0, 0, 1}, tolerances[0], 256, NULL, NULL);
    print_message("%d steps across 160 voxels of glass\n", out.steps);
    assert_true(out.leaves && out.met == 1);
    assert_true(out.steps < 40);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(luneburgs_lens_focuses),     cmocka_unit_test(steps_are_of_the_second_order),
        cmocka_unit_test(the_fish_eye_goes_in_circles), cmocka_unit_test(a_graded_rod_has_its_period),
        cmocka_unit_test(bouguers_product_is_kept),   cmocka_unit_test(jumps_are_surfaces),
        cmocka_unit_test(no_body_is_lost),
        cmocka_unit_test(steps_of_what_does_not_bend_are_few),
    };
    return cmocka_run_group_tests_name("bent paths", tests, NULL, NULL);
}
