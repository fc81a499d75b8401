/* Air that is exactly 0 (deepen.h): the field that is executed is positive exactly where the text's density is, and
 * not flat where that is; where there is a signed text of the same shape it is executed alike, to the byte. What the
 * sampler says is the text's. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "producers/density/world_file.h"
#include "producers/language/oracle/oracle.h"
#include "producers/steps/subdivide_shared.h"

/* Bodies of density, and of a signed density that must come to the same field; NULL: there is none. */
static const char *const worlds[][2] = {
    {"return max(0.0, 4.0 - length(p));", "return 4.0 - length(p);"},
    {"return max(4.0 - length(p), 0.0);", "return 4.0 - length(p);"},
    {"return clamp(4.0 - length(p), 0.0, 1.0);", "return 4.0 - length(p);"},
    {"return saturate(4.0 - length(p));", "return 4.0 - length(p);"},
    {"return p.y < 5.0 * noise(p / 6.0) ? 1.0 : 0.0;", "return 5.0 * noise(p / 6.0) - p.y;"},
    {"return p.y < 5.0 * noise(p / 6.0) ? 1.0 : -1.0;", "return 5.0 * noise(p / 6.0) - p.y;"},
    {"return p.y >= 5.0 * noise(p.xz / 6.0) ? 0.0 : 255.0;", "return 5.0 * noise(p.xz / 6.0) - p.y;"},
    {"return step(p.y, 5.0 * noise(p.xz / 6.0));", "return 5.0 * noise(p.xz / 6.0) - p.y;"},
    {"return float(p.y < 5.0 * noise(p / 6.0));", "return 5.0 * noise(p / 6.0) - p.y;"},
    {"if (length(p) < 4.0) return 1.0; return 0.0;", "float l = length(p); return 4.0 - l;"},
    {"return length(p) < 4.0 && p.y < 1.0 ? 1.0 : 0.0;", "float l = length(p); return min(4.0 - l, 1.0 - p.y);"},
    {"return length(p) < 4.0 || p.y < -3.0 ? 1.0 : 0.0;", "float l = length(p); return max(4.0 - l, -3.0 - p.y);"},
    {"float h = 4.0 * noise(p.xz / 5.0); return h > p.y ? h - p.y : 0.0;", "return 4.0 * noise(p.xz / 5.0) - p.y;"},
    {"float d = 4.0 - length(p); return d > 0.0 ? d : 0.0;", "return 4.0 - length(p);"},
    {"float d = 4.0 - length(p); return d < 0.0 ? 0.0 : d;", "return 4.0 - length(p);"},
    {"float h = 4.0 * noise(p.xz / 5.0); return h - min(h, p.y);", "return 4.0 * noise(p.xz / 5.0) - p.y;"},
    {"return max(0.0, 4.0 - length(p)) * 0.25;", "return (4.0 - length(p)) * 0.25;"},
    {"return max(max(0.0, 4.0 - length(p)), max(0.0, 2.0 - length(p - 3.0)));",
     "return max(4.0 - length(p), 2.0 - length(p - 3.0));"},
    {"return smoothstep(0.0, 1.0, 4.0 - length(p));", NULL},
    {"return max(0.0, 4.0 - length(p)) + max(0.0, 3.0 - length(p - 4.0));", NULL},
    {"float d = max(0.0, 4.0 - length(p)); return d * d;", NULL},
    {"return sqrt(max(0.0, 4.0 - length(p)));", NULL},
    {"return (p.y < 1.0 ? 1.0 : 0.0) * (length(p) < 6.0 ? 1.0 : 0.0);", NULL},
    {"return (p.y < 1.0 ? 1.0 : 0.0) * (5.0 - length(p));", NULL},
    {"return min(length(p) < 6.0 ? 1.0 : 0.0, 3.0 - p.y);", NULL},
    {"return float(noise(p / 4.0) > 0.1) + float(p.y < -3.0);", NULL},
    {"return mod(floor(p.x) + floor(p.y) + floor(p.z), 2.0);", NULL},
    {"return float((int(floor(p.x)) ^ int(floor(p.z))) & 1);", NULL},
    {"return max(0.0, floor(4.0 * noise(p / 7.0)));", NULL},
    {"float a = 0.0; for (int i = 0; i < 9; i++) if (length(p - float(i) + 4.0) < 1.5) a = 1.0; return a;", NULL},
    {"return p.y < 0.0 ? 1.0 : (length(p) < 4.0 ? 2.0 : 0.0);", NULL},
    {"return mix(0.0, 2.0, p.y < noise(p / 3.0) ? 1.0 : 0.0);", NULL},
    {"return 1.0 - step(4.0 * noise(p.xz / 5.0), p.y);", NULL},
    {"return 1.0 - smoothstep(-1.0, 1.0, p.y - 4.0 * noise(p.xz / 5.0));", NULL},
    {"return 1.0 - clamp(p.y - 4.0 * noise(p.xz / 5.0), 0.0, 1.0);", NULL},
    {"return mix(1.0, 0.0, step(4.0 * noise(p.xz / 5.0), p.y));", NULL},
    {"return pow(clamp(4.0 - length(p), 0.0, 1.0), 3.0);", NULL},
    {"return pow(max(0.0, 4.0 - length(p)), 2.0);", NULL},
    {"return 0.5 * (4.0 - length(p) + abs(4.0 - length(p)));", NULL},
    {"float d = 4.0 * noise(p.xz / 5.0) - p.y; return 0.5 * (d + abs(d));", "return 4.0 * noise(p.xz / 5.0) - p.y;"},
    {"float d = p.y - 4.0 * noise(p.xz / 5.0); return 0.5 * (abs(d) - d);", "return 4.0 * noise(p.xz / 5.0) - p.y;"},
    {"float d = 4.0 - length(p); return 0.5 * abs(d) + 0.5 * d;", "return 4.0 - length(p);"},
    {"float d = noise(p / 6.0) - 0.1; return d * 2.0 + abs(d) * 2.0;", NULL},
    {"float d = length(p) - 4.0; return abs(d) * 0.25 - d * 0.25;", NULL},
    {"float d = 4.0 - length(p); return d * step(0.0, d);", NULL},
    {"float d = 4.0 - length(p); return d * float(d > 0.0);", NULL},
    {"return sign(max(4.0 - length(p), 0.0));", NULL},
    {"return ceil(clamp(4.0 - length(p), 0.0, 1.0));", NULL},
    {"return max(0.0, 5.0 - length(p)) - max(0.0, 3.0 - length(p - 3.0));", NULL},
    {"return mix(max(0.0, 4.0 - length(p)), max(0.0, -p.y), smoothstep(-3.0, 3.0, p.x));", NULL},
    {"return (1.0 - step(4.0, length(p))) * 255.0;", NULL},
    {"return 1.0 - min(length(p) / 4.0, 1.0);", NULL},
    {"return max(1.0 - length(p) / 4.0, 0.0);", NULL},
    {"return sqrt(max(0.0, 16.0 - dot(p, p)));", NULL},
    {"return log(1.0 + max(0.0, 4.0 - length(p)));", NULL},
    {"return exp(max(0.0, 4.0 - length(p))) - 1.0;", NULL},
    {"return max(0.0, 4.0 - length(p)) / (1.0 + max(0.0, 4.0 - length(p)));", NULL},
    {"float a = 0.0; a += max(0.0, 3.0 - length(p)); a += max(0.0, 2.0 - length(p - 2.0)); a = min(a, 1.0); return "
     "a;",
     NULL},
    {"float s = 0.0; for (int i = 0; i < 5; i++) { vec3 q = p - vec3(float(i) * 2.0 - 4.0, 0.0, 0.0); s = max(s, "
     "1.5 - length(q)); } return s;",
     NULL},
    {"bool solid = p.y < 0.0; if (length(p) < 3.0) solid = true; if (length(p - 1.0) < 1.5) solid = false; return "
     "solid ? 1.0 : 0.0;",
     NULL},
    {"if (p.y > 3.0) return 0.0; return 2.0 * noise(p.xz / 4.0) - p.y;", NULL},
    {"if (length(p) > 5.0) return 0.0; return 3.0 - length(p);", NULL},
    {"return length(p) < 4.0 ? 1.0 - length(p) / 4.0 : 0.0;", NULL},
    {"float d = length(p); if (d > 4.0) return 0.0; d = 1.0 - d * d / 16.0; return d * d * d;", NULL},
    {"float s = 0.0; for (int i = 0; i < 4; i++) { float d = length(p - vec3(float(i) * 1.5 - 2.0, 0.0, 0.0)) / "
     "3.0; if (d < 1.0) { float q = 1.0 - d * d; s += q * q * q; } } return s;",
     NULL},
    {"int n = 0; for (int i = 0; i < 4; i++) if (length(p - vec3(float(i) * 2.0 - 3.0, 0.0, 0.0)) < 1.5) n++; "
     "return float(n);",
     NULL},
    {"return length(max(abs(p) - 3.0, 0.0));", NULL},
    {"uint h = uint(int(floor(p.x)) * 73 + int(floor(p.y)) * 31 + int(floor(p.z)) * 17); return float(h & 1u);", NULL},
    {"return float(p.y < 0.0 || length(p) < 3.0);", NULL},
    {"return step(0.0, 4.0 - length(p)) * step(p.x, 2.0);", NULL},
    {"return min(step(0.0, 4.0 - length(p)), step(p.x, 2.0));", NULL},
    {"return max(step(length(p), 4.0) - step(length(p), 3.0), 0.0);", NULL},
    {"return step(length(p), 4.0) - step(length(p), 3.0);", NULL},
    {"return (noise(p / 3.0) > 0.2 ? 1.0 : 0.0) * 10.0;", NULL},
    {"return clamp((4.0 * noise(p.xz / 5.0) - p.y) * 100.0, 0.0, 255.0) / 255.0;", NULL},
    {"return max(0.0, min(4.0 - length(p), 2.0 - abs(p.x)));", NULL},
    {"return max(0.0, noise(p / 3.0)) * max(0.0, 5.0 - length(p));", NULL},
    {"vec3 q = step(abs(p), vec3(3.0)); return q.x * q.y * q.z;", NULL},
    {"return all(lessThan(abs(p), vec3(3.0))) ? 1.0 : 0.0;", NULL},
    {"return -min(0.0, length(p) - 4.0);", NULL},
    {"return -clamp(length(p) - 4.0, -1.0, 0.0);", NULL},
    {"return 0.0 - min(length(p) - 4.0, 0.0);", NULL},
    {"return fract(sin(dot(floor(p), vec3(12.9898, 78.233, 37.7))) * 43758.5453) > 0.6 ? 1.0 : 0.0;", NULL},
    {"return round(clamp(4.5 - length(p), 0.0, 1.0));", NULL},
    {"return trunc(max(4.0 - length(p), 0.0));", NULL},
    {"return dot(max(vec3(0.0), 3.0 - abs(p)), vec3(1.0, 1.0, 1.0));", NULL},
    {"float d = 4.0 - length(p); d = d > 0.0 ? 1.0 : d < 0.0 ? 0.0 : 0.5; return d;", NULL},
    {"return mix(0.0, 4.0 - length(p), step(length(p), 4.0));", NULL},
    {"return abs(max(4.0 - length(p), 0.0));", NULL},
    {"return atan(max(0.0, 4.0 - length(p)));", NULL},
    {"return tanh(max(0.0, 4.0 - length(p)));", NULL},
    {"float d = 4.0 * noise(p.xz / 9.0) - p.y; return d > 0.0 ? 1.0 - exp(-d) : 0.0;", NULL},
    {"return floor(length(p) / 4.0) == 0.0 ? 1.0 : 0.0;", NULL},
    {"return max(4.0, length(p)) == 4.0 ? 1.0 : 0.0;", NULL},
    {"float t = clamp((5.0 - length(p)) / 2.0, 0.0, 1.0); return t * t * t * (t * (t * 6.0 - 15.0) + 10.0);", NULL},
    {"vec3 q = max(3.0 - abs(p), 0.0); return dot(q, q) > 0.0 ? q.x * q.y * q.z : 0.0;", NULL},
    {"float h[3] = float[3](0.0, 1.0, 2.0); int i = clamp(int(4.0 - length(p)), 0, 2); return h[i];", NULL},
    {"return 1.0 / max(length(p), 0.1) > 0.25 ? 1.0 : 0.0;", NULL},
    {"return step(worley(p / 5.0).x, 0.4);", NULL},
    {"return max(0.0, log(5.0 / max(length(p), 0.01)));", NULL},
    {"return sin(clamp(4.0 - length(p), 0.0, 1.5)) * 3.0;", NULL},
    {"return saturate(40.0 * (4.0 - length(p)));", "return 40.0 * (4.0 - length(p));"},
    {"return clamp(4.0 - length(p), -1.0, 1.0);", "return 4.0 - length(p);"},
    {"return 2.0 * clamp(length(p) - 4.0, -0.1, 0.2) / -3.0;", NULL},
    {"return max(min(4.0 - length(p), 0.5), min(-3.0 - p.y, 0.25));", "return max(4.0 - length(p), -3.0 - p.y);"},
    {"return p.x < 0.0 ? min(4.0 - length(p), 0.5) : -3.0 - p.y;", "return p.x < 0.0 ? 4.0 - length(p) : -3.0 - p.y;"},
    {"return 1.0 - step(4.0 - length(p), 0.0);", "return 4.0 - length(p);"},
    {"return 3.0 * (1.0 - step(4.0 - length(p), 0.0));", "return 4.0 - length(p);"},
    {"return ceil(saturate(4.0 - length(p)));", "return 4.0 - length(p);"},
    {"return sign(max(4.0 - length(p), 0.0));", "return 4.0 - length(p);"},
    {"return sign(4.0 - length(p));", "return 4.0 - length(p);"},
};
enum { NUM_WORLDS = sizeof worlds / sizeof worlds[0], NUM_POINTS = 3000 };

static karst_world_file *open_body(const char *body)
{
    char text[1024];
    karst_error error = {0};
    snprintf(text, sizeof text, "/*{ \"voxel\": 0.125 }*/\nfloat density(vec3 p) { %s }\n", body);
    karst_world_file *file = karst_world_file_compile("test.karst", text, strlen(text), NULL, 0, NULL, &error);
    if (!file)
        fail_msg("%s: %s", body, error.message);
    return file;
}

static uint64_t state = 1;
static double random_unit(void)
{
    state = state * 6364136223846793005u + 1442695040888963407u;
    return (double)(state >> 11) * 0x1p-53;
}

/* How many points the text calls 0, none of which the executed field may call solid. `rounds`: densities that the
 * text's own rounding may turn. */
static void check_signs(const char *body, double rounds, int *num_zeros)
{
    karst_world_file *file = open_body(body);
    const karst_program_graph *program = file->program;
    karst_error error = {0};
    karst_oracle *oracle =
        karst_oracle_create(&program->world, NULL, program->header.seed, program->header.voxel_log2_m, &error);
    assert_non_null(oracle);
    if (!program->world.text)
        fail_msg("%s: flat air stays flat", body);
    int num_flat = 0;
    *num_zeros = 0;
    for (int i = 0; i < NUM_POINTS; i++) {
        double at_m[3];
        for (int k = 0; k < 3; k++)
            at_m[k] = 14 * random_unit() - 7;
        karst_position at = karst_position_add_m((karst_position){{0}, {0}}, at_m, program->header.voxel_log2_m);
        int level = i % 5 - 1;
        karst_oracle_value text = karst_oracle_text_density(oracle, &at, level);
        karst_oracle_value field = karst_oracle_density(oracle, &at, level);
        bool turns = (text.device > 0) != (field.device > 0) || (text.precise > 0) != (field.precise > 0);
        /* what is a little above 0, and 0 in floats */
        bool rounds_to_0 = text.device == 0 && text.precise > 0 && text.precise < rounds;
        if (turns && !rounds_to_0 && !(text.device != 0 && fabs(text.precise) < rounds))
            fail_msg("%s: at %g, %g, %g the text says %g, executed is %g", body, at_m[0], at_m[1], at_m[2],
                     (double)text.device, (double)field.device);
        /* one point may lie on the surface itself */
        if (text.device == 0 && !rounds_to_0 && !(field.device < 0) && num_flat++)
            fail_msg("%s: flat at %g, %g, %g", body, at_m[0], at_m[1], at_m[2]);
        *num_zeros += text.device == 0;
    }
    karst_oracle_destroy(oracle);
    karst_world_file_destroy(file);
}

static void test_signs(void **s)
{
    (void)s;
    for (int i = 0; i < NUM_WORLDS; i++) {
        int num_zeros;
        check_signs(worlds[i][0], 0, &num_zeros);
        if (num_zeros == 0 && !worlds[i][1] && !strstr(worlds[i][0], "-1.0;") && !strstr(worlds[i][0], "-0.1"))
            fail_msg("%s: no point is flat", worlds[i][0]);
    }
}

static void check_same_field(const char *const pair[2])
{
    karst_world_file *files[2];
    karst_oracle *oracles[2];
    karst_error error = {0};
    for (int i = 0; i < 2; i++) {
        files[i] = open_body(pair[i]);
        const karst_program_graph *program = files[i]->program;
        oracles[i] = karst_oracle_create(&program->world, NULL, program->header.seed, -3, &error);
        assert_non_null(oracles[i]);
    }
    assert_true(files[1]->program->world.text == KARST_NO_EXPR);
    if (files[0]->tape.num_instructions != files[1]->tape.num_instructions)
        fail_msg("%s takes %u instructions, %s %u", pair[0], files[0]->tape.num_instructions, pair[1],
                 files[1]->tape.num_instructions);
    for (int i = 0; i < NUM_POINTS / 10; i++) {
        double at_m[3];
        for (int k = 0; k < 3; k++)
            at_m[k] = 14 * random_unit() - 7;
        karst_position at = karst_position_add_m((karst_position){{0}, {0}}, at_m, -3);
        float a = karst_oracle_density(oracles[0], &at, i % 5 - 1).device,
              b = karst_oracle_density(oracles[1], &at, i % 5 - 1).device;
        if (memcmp(&a, &b, sizeof a))
            fail_msg("%s gives %a, %s %a", pair[0], (double)a, pair[1], (double)b);
    }
    for (int i = 0; i < 2; i++) {
        karst_oracle_destroy(oracles[i]);
        karst_world_file_destroy(files[i]);
    }
}

static void test_same_field(void **s)
{
    (void)s;
    int num_pairs = 0;
    for (int i = 0; i < NUM_WORLDS; i++)
        if (worlds[i][1]) {
            check_same_field(worlds[i]);
            num_pairs++;
        }
    assert_true(num_pairs >= 15);
}

static void test_untouched(void **s)
{
    (void)s;
    static const char *const bodies[] = {
        "return 4.0 - length(p);",
        "return 3.0 * noise(p / 4.0) - p.y;",
        "return -length(max(abs(p) - 2.0, 0.0)) + 0.3;",
        "return max(4.0 - length(p), -3.0 - p.y);",
        "return p.y < 0.0 ? 4.0 - length(p) : -1.0;",
        "return floor(4.0 * noise(p.xz / 9.0)) - p.y;",
        "return min(sqrt(4.0 - length(p)) - 0.5, 1.0);", /* no number outside */
        "return min(1.0 / length(p - 1.0) - 0.5, 1.0);",
        "return min(4.0 - length(p), 3.0 - p.y);",
        "return clamp(4.0 - length(p), -1.0, 1.0) + 0.5 * p.x;",
        "return 1.0 - smoothstep(0.0, 3.0, length(p)) - 0.5;",
        "return mix(4.0 - length(p), 3.0 * noise(p / 4.0) - p.y, smoothstep(-3.0, 3.0, p.x));",
        "return log(1.0 + max(0.0, 4.0 - length(p))) - 0.1;",
        "return length(p - 3.0) - length(p + 3.0);",
        "return -min(length(p) - 4.0, p.y);",
    };
    for (size_t i = 0; i < sizeof bodies / sizeof bodies[0]; i++) {
        karst_world_file *file = open_body(bodies[i]);
        if (file->program->world.text)
            fail_msg("%s: changed, though no air is flat", bodies[i]);
        karst_world_file_destroy(file);
    }
}

/* What touches 0 gently, or with an edge, is executed as steep on one side of the surface as on the other: samples tell
 * where it lies. All are balls of radius 4. */
static void test_steep(void **s)
{
    (void)s;
    static const char *const bodies[] = {
        "float d = max(0.0, 4.0 - length(p)); return d * d;",
        "return pow(clamp(4.0 - length(p), 0.0, 1.0), 3.0);",
        "return pow(max(0.0, 4.0 - length(p)), 1.5);",
        "return smoothstep(0.0, 1.0, 4.0 - length(p));",
        "return 1.0 - smoothstep(3.0, 4.0, length(p));",
        "return sqrt(max(0.0, 4.0 - length(p)));",
        "return sqrt(max(0.0, 16.0 - dot(p, p)));",
        "return log(1.0 + max(0.0, 4.0 - length(p)));",
        "return exp(max(0.0, 4.0 - length(p))) - 1.0;",
        "float d = length(p); if (d > 4.0) return 0.0; d = 1.0 - d * d / 16.0; return d * d * d;",
        "return max(0.0, 4.0 - length(p)) * smoothstep(0.0, 1.0, 4.0 - length(p));",
        "return mix(1.0, 0.0, smoothstep(3.0, 4.0, length(p)));",
    };
    for (size_t i = 0; i < sizeof bodies / sizeof bodies[0]; i++) {
        karst_world_file *file = open_body(bodies[i]);
        const karst_program_graph *program = file->program;
        karst_error error = {0};
        karst_oracle *oracle =
            karst_oracle_create(&program->world, NULL, program->header.seed, program->header.voxel_log2_m, &error);
        assert_non_null(oracle);
        double inside_m[3] = {2.4, 3.18, 0}, outside_m[3] = {2.4, 3.22, 0};
        const karst_position origin = {{0}, {0}};
        karst_position in = karst_position_add_m(origin, inside_m, program->header.voxel_log2_m),
                       out = karst_position_add_m(origin, outside_m, program->header.voxel_log2_m);
        double solid = karst_oracle_density(oracle, &in, -1).precise,
               air = karst_oracle_density(oracle, &out, -1).precise;
        if (!(solid > 0 && air < 0 && solid < -3 * air && -air < 3 * solid))
            fail_msg("%s: %g inside, %g outside", bodies[i], solid, air);
        karst_oracle_destroy(oracle);
        karst_world_file_destroy(file);
    }
}

/* Kernels that end at a distance, and sums of them: `r` is the distance to each of five places in a row. Where a ray
 * meets what they make, the executed field is as steep before as behind; `w` stands for the kernel's sum. */
static const char *const kernels[] = {
    "w += r < 2.0 ? pow(1.0 - r / 2.0, 3.0) : 0.0;",
    "w += r < 2.0 ? (1.0 - r / 2.0) * (1.0 - r / 2.0) : 0.0;",
    "if (r < 2.0) w += (1.0 - 0.5 * r) * (1.0 - 0.5 * r);",
    "float d = r / 1.9; if (d < 1.0) { float q = 1.0 - d * d; w += q * q * q; }",
    "float d = r * r / 4.0; w += d < 1.0 ? (1.0 - d) * (1.0 - d) : 0.0;",
    "float d = max(0.0, 1.0 - r / 2.0); w += d * d * d;",
    "float d = r * r / 4.0; if (d < 1.0) w += 1.0 - 22.0 / 9.0 * d + 17.0 / 9.0 * d * d - 4.0 / 9.0 * d * d * d;",
    "float d = r / 2.0; w += d < 1.0 / 3.0 ? 1.0 - 3.0 * d * d : d < 1.0 ? 1.5 * (1.0 - d) * (1.0 - d) : 0.0;",
    "w += r < 2.0 ? 0.5 + 0.5 * cos(3.14159265 * r / 2.0) : 0.0;",
    "w += smoothstep(2.0, 0.0, r);",
    "w += 1.0 - smoothstep(0.0, 2.0, r);",
    "float t = clamp(1.0 - r / 2.0, 0.0, 1.0); w += t * t * t * (t * (t * 6.0 - 15.0) + 10.0);",
    "float t = clamp(r / 2.0, 0.0, 1.0); w += 1.0 - t * t * t * (t * (t * 6.0 - 15.0) + 10.0);",
    "float t = clamp(1.0 - r / 2.0, 0.0, 1.0); w += t * t * t * t * (t * (t * (t * -20.0 + 70.0) - 84.0) + 35.0);",
    "w += r >= 2.0 ? 0.0 : pow(1.0 - r / 2.0, 4.0);",
    "if (r > 2.0) continue; float q = 1.0 - r / 2.0; w += q * q * (3.0 - 2.0 * q);",
    "if (!(r < 2.0)) continue; w += 0.7 * (2.0 - r) * (2.0 - r);",
    "w = max(w, r < 2.0 ? (2.0 - r) * (2.0 - r) : 0.0);",
    "w += r * r < 4.0 ? (1.0 - r / 2.0) * (1.0 - r / 2.0) * 3.0 : 0.0;",
    "w += r < 2.0 ? pow(1.0 - r * r / 4.0, 2.0) * (1.0 + 0.3 * sin(p.x)) : 0.0;",
    "w += r / 2.0 < 1.0 ? (1.0 - r / 2.0) * (1.0 - r / 2.0) * (r + 1.0) : 0.0;",
    "w += pow(clamp(1.0 - r / 2.0, 0.0, 1.0), 5.0);",
    "float k = 0.0; if (r < 2.0) { float a = 1.0 - r / 2.0; k = a * a * a; } w += k;",
    "w += (1.0 - min(r / 2.0, 1.0)) * (1.0 - min(r / 2.0, 1.0));",
};
enum { NUM_KERNELS = sizeof kernels / sizeof *kernels, RAYS = 60 };

static void test_kernels(void **s)
{
    (void)s;
    int num_bad = 0;
    for (int k = 0; k < NUM_KERNELS; k++) {
        char body[768];
        karst_error error = {0};
        snprintf(body, sizeof body,
                 "float w = 0.0; for (int i = 0; i < 5; i++) { float r = length(p - vec3(float(i) * 1.5 - 3.0, 0.0, "
                 "0.0)); %s } return w;",
                 kernels[k]);
        int num_zeros, num_steep = 0, num_met = 0;
        check_signs(body, 4e-7, &num_zeros);
        karst_world_file *file = open_body(body);
        const karst_program_graph *program = file->program;
        karst_oracle *oracle =
            karst_oracle_create(&program->world, NULL, program->header.seed, program->header.voxel_log2_m, &error);
        assert_non_null(oracle);
        for (int n = 0; n < RAYS; n++) {
            double from[3] = {0, 0, 0}, ends[2], air = 0, solid = 1;
            for (int i = 0; i < 3; i++)
                from[i] = (2 * random_unit() - 1) * 9;
            const double middle_m[3] = {1.5 * floor(5 * random_unit()) - 3, 0, 0};
            const karst_position origin = {{0}, {0}};
            for (int i = 0; i <= 46; i++) { /* the last rounds look 3 cm before and behind */
                const double along = i < 45 ? 0.5 * (air + solid) : i == 45 ? air - 0.03 / 9 : solid + 0.03 / 9;
                double at_m[3];
                for (int a = 0; a < 3; a++)
                    at_m[a] = from[a] + along * (middle_m[a] - from[a]);
                const karst_position at = karst_position_add_m(origin, at_m, program->header.voxel_log2_m);
                if (i < 45)
                    *(karst_oracle_text_density(oracle, &at, -1).precise > 0 ? &solid : &air) = along;
                else
                    ends[i - 45] = karst_oracle_density(oracle, &at, -1).precise;
            }
            num_met += air > 0.05;
            num_steep += air > 0.05 && ends[0] < 0 && ends[1] > 0 && ends[1] < -3 * ends[0] && -ends[0] < 3 * ends[1];
        }
        bool is_bad = num_met < RAYS / 2 || num_steep * 20 < num_met * 19;
        if (is_bad)
            print_message("%s: of %d surfaces %d are as steep outside as inside\n", kernels[k], num_met, num_steep);
        num_bad += is_bad;
        karst_oracle_destroy(oracle);
        karst_world_file_destroy(file);
    }
    assert_int_equal(num_bad, 0);
}

/* Zero is air, in proofs too. */
static void test_proofs(void **s)
{
    (void)s;
    assert_true(karst_state_from_bounds(-1.0f, 0.0f) == KARST_STATE_AIR);
    assert_true(karst_state_from_bounds(0.0f, 0.0f) == KARST_STATE_AIR);
    assert_true(karst_state_from_bounds(0.0f, 1.0f) == KARST_STATE_UNKNOWN);
    assert_true(karst_state_from_bounds(-1.0f, 0x1p-149f) == KARST_STATE_UNKNOWN);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_signs), cmocka_unit_test(test_same_field), cmocka_unit_test(test_untouched),
        cmocka_unit_test(test_steep), cmocka_unit_test(test_kernels),    cmocka_unit_test(test_proofs),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
