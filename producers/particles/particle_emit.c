/* Emitters: where their particles are. Arithmetic alone, so that machines agree to the last bit. */
#include <math.h>

#include "producers/particles/particle_internal.h"

/* What is drawn for a particle in a life. */
enum { DRAW_PHASE, DRAW_PLACE, DRAW_DIRECTION = 32, DRAW_STRAY = 64 };
#define MOST_TRIES 16

/* The mixing of SplitMix64 (Steele, Lea and Flood, "Fast splittable pseudorandom number generators", 2014). */
static uint64_t mix(uint64_t z)
{
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return z ^ z >> 31;
}

/* From 0 to 1. */
static double draw(uint32_t seed, uint32_t particle, int64_t life, uint32_t number)
{
    uint64_t z = mix(seed + 0x9e3779b97f4a7c15u);
    z = mix(z ^ (uint64_t)life * 0xd1342543de82ef95u);
    z = mix(z ^ ((uint64_t)particle << 32 | number));
    return (double)(z >> 11) * 0x1p-53;
}

/* In a ball of radius 1. Tries end: what is left after sixteen lies in a cube, one time in 10^5. */
static void draw_in_ball(uint32_t seed, uint32_t particle, int64_t life, uint32_t number, int num_axes, double p[3])
{
    for (uint32_t i = 0; i < MOST_TRIES; i++) {
        double square = 0;
        for (int a = 0; a < 3; a++) {
            p[a] = a < num_axes ? 2 * draw(seed, particle, life, number + 0x100 * i + (uint32_t)a) - 1 : 0;
            square += p[a] * p[a];
        }
        if (square <= 1)
            return;
    }
}

/* Two directions across another, each of length 1. */
static void across(const double v[3], double first[3], double second[3])
{
    const double length = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    double along[3] = {1, 0, 0}, helper[3] = {0, 0, 0};
    for (int a = 0; a < 3 && length > 0; a++)
        along[a] = v[a] / length;
    helper[fabs(along[1]) < 0.9 ? 1 : 0] = 1;
    const double cross[3] = {helper[1] * along[2] - helper[2] * along[1], helper[2] * along[0] - helper[0] * along[2],
                             helper[0] * along[1] - helper[1] * along[0]};
    const double width = sqrt(cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]);
    for (int a = 0; a < 3; a++)
        first[a] = cross[a] / width;
    for (int a = 0; a < 3; a++)
        second[a] = along[(a + 1) % 3] * first[(a + 2) % 3] - along[(a + 2) % 3] * first[(a + 1) % 3];
}

static void place_of_birth(const karst_emitter *e, uint32_t i, int64_t life, double p[3])
{
    double u[3], first[3], second[3];
    if (e->shape == KARST_EMITTER_BOX)
        for (int a = 0; a < 3; a++)
            p[a] = (draw(e->seed, i, life, DRAW_PLACE + (uint32_t)a) - 0.5) * e->size_m[a];
    if (e->shape == KARST_EMITTER_BOX)
        return;
    draw_in_ball(e->seed, i, life, DRAW_PLACE, e->shape == KARST_EMITTER_DISC ? 2 : 3, u);
    if (e->shape == KARST_EMITTER_BALL)
        for (int a = 0; a < 3; a++)
            p[a] = 0.5 * e->size_m[a] * u[a];
    if (e->shape == KARST_EMITTER_BALL)
        return;
    across(e->velocity_m_s, first, second);
    for (int a = 0; a < 3; a++)
        p[a] = 0.5 * e->size_m[0] * (u[0] * first[a] + u[1] * second[a]);
}

/* A wave of period 1 and height 1, of parabolas. */
static double wave(double x)
{
    const double f = x - floor(x);
    return f < 0.5 ? 16 * f * (0.5 - f) : -16 * (f - 0.5) * (1 - f);
}

void karst_emitter_particle(const karst_emitter *e, uint32_t i, double time_s, karst_ball *ball)
{
    /* Evenly, but for half the time between two. */
    const double phase = (i + 0.5 * draw(e->seed, i, 0, DRAW_PHASE)) / fmax(floor(e->count), 1);
    const double lives = time_s / e->life_s + phase, life = floor(lives), age = lives - life, age_s = age * e->life_s;
    const int64_t number = life > -0x1p53 && life < 0x1p53 ? (int64_t)life : 0;
    double direction[3];
    place_of_birth(e, i, number, ball->at_m);
    draw_in_ball(e->seed, i, number, DRAW_DIRECTION, 3, direction);
    for (int a = 0; a < 3; a++) {
        const double start = draw(e->seed, i, number, DRAW_STRAY + (uint32_t)a);
        const double stray = e->stray_m * age * (wave(start + 2 * age) + 0.5 * wave(3 * start + 5 * age));
        ball->at_m[a] += (e->velocity_m_s[a] + e->spread_m_s * direction[a]) * age_s + stray;
    }
    const double in = e->fade > 0 ? fmin(fmin(age, 1 - age) / e->fade, 1) : 1;
    ball->radius_m = e->radius_m[0] + (e->radius_m[1] - e->radius_m[0]) * age;
    ball->extinction = e->extinction * in;
}
