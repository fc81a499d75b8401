/* What whole programs mean where order and side effects matter: calls in the arms of a choice, counters in conditions,
 * places that a call changes, globals. Values worked out by hand. */
#include "world_text.h"

/* p = (1.25, -2.5, 3.75) */
static const struct {
    const char *text;
    double value;
} programs[] = {
    /* a call in an arm, whose function changes its own parameter */
    {"float f(vec3 q) { q.x += 1.0; return q.x * 10.0; } float density(vec3 p) { return p.y > 0.0 ? 5.0 : f(p); }",
     22.5},
    {"float f(vec3 q) { q.x += 1.0; return q.x * 10.0; } float density(vec3 p) { return p.y < 0.0 ? f(p) : 5.0; }",
     22.5},
    {"float f(vec3 q) { q.x += 1.0; return q.x; } float density(vec3 p) { return p.y < 0.0 ? f(p) : f(p.zyx); }", 2.25},
    {"float f(vec3 q) { q.x += 1.0; return q.x; } float density(vec3 p) { return p.y > 0.0 ? f(p) : f(p.zyx); }", 4.75},
    {"vec3 f(vec3 q, float a, float b) { q *= a; a += b; b = q.y; return q + a + b; }\n"
     "float density(vec3 p) { return dot(p.x > 0.0 ? f(p, 2.0, 3.0) : p, vec3(1.0, 10.0, 100.0)); }",
     2.5 + 10 * -5 + 100 * 7.5},
    {"float g(float a) { a *= 2.0; return a + 1.0; } float f(float a, float b) { a = g(a) + g(b); b += a; return b; }\n"
     "float density(vec3 p) { return p.x < 0.0 ? 0.0 : p.y > 0.0 ? f(p.x, p.y) : f(p.z, p.x) + f(p.x, p.z); }",
     (1.25 + 8.5 + 3.5) + (3.75 + 3.5 + 8.5)},
    {"float f(float a) { if (a > 3.0) { a -= 1.0; return a; } a += 10.0; return a; }\n"
     "float density(vec3 p) { float s = 0.5; return p.x > 0.0 ? s + f(p.z) + f(p.x) : s; }",
     0.5 + 2.75 + 11.25},
    {"float f(float a) { for (int i = 0; i < 4; i++) { a += 1.0; if (a > 4.0) break; } return a; }\n"
     "float density(vec3 p) { return p.x > 0.0 && f(p.x) > 4.0 ? f(p.x) : 0.0; }",
     4.25},
    {"struct S { float a; vec2 b; }; S f(vec3 q) { q += 1.0; S s; s.a = q.x; s.b = q.yz; q = vec3(0.0); return s; }\n"
     "float density(vec3 p) { S s = p.y < 0.0 ? f(p) : S(0.0, vec2(0.0)); return s.a + 10.0 * s.b.y; }",
     2.25 + 47.5},
    /* globals and out parameters under a choice */
    {"float g = 1.0; float f(float a) { a += 1.0; g += a; return a; }\n"
     "float density(vec3 p) { float r = p.y > 0.0 ? f(p.x) : f(p.z) + g; return r + 100.0 * g; }",
     4.75 + 5.75 + 575},
    {"float f(inout float a) { a += 1.0; return a * 2.0; }\n"
     "float density(vec3 p) { float a = p.x, r = p.y < 0.0 ? f(a) : 0.0; return r + 100.0 * a; }",
     4.5 + 225},
    {"float f(inout float a) { a += 1.0; return a; }\n"
     "float density(vec3 p) { float a = p.x; bool b = p.y > 0.0 && f(a) > 0.0; bool c = p.y < 0.0 || f(a) > 0.0;\n"
     "    bool d = p.z > 0.0 && f(a) > 0.0; return a + (b ? 100.0 : 0.0) + (c ? 10.0 : 0.0) + (d ? 20.0 : 0.0); }",
     2.25 + 30},
    /* a place is found once, before the call */
    {"void f(inout float a) { a += 10.0; }\n"
     "float density(vec3 p) { float a[3]; a[0] = 1.0; a[1] = 2.0; a[2] = 3.0; int i = 0; f(a[i++]);\n"
     "    return a[0] + 10.0 * a[1] + 100.0 * a[2] + 1000.0 * float(i); }",
     11 + 20 + 300 + 1000},
    {"void f(inout int i, out float a) { i = 2; a = 7.0; }\n"
     "float density(vec3 p) { float a[3]; a[0] = 1.0; a[1] = 2.0; a[2] = 3.0; int i = int(p.x); f(i, a[i]);\n"
     "    return a[0] + 10.0 * a[1] + 100.0 * a[2]; }",
     1 + 70 + 300},
    /* a global begins with what others began with */
    {"float a = 1.0; float b = a * 10.0; float density(vec3 p) { a = p.x; return b + a; }", 11.25},
    {"float a = 1.0; float b = a * 10.0; float density(vec3 p) { if (p.x > 0.0) { a = p.z; return b + a; } return 0.0; "
     "}",
     13.75},
    /* conditions stop where a term fails, and what stands behind it is not counted */
    {"float density(vec3 p) { int i = 0; float r = p.x; for (; r < 4.0 && i++ < 20;) r += 1.0;\n"
     "    return r + 100.0 * float(i); }",
     4.25 + 300},
    {"float density(vec3 p) { int i = 0; float r = p.x; for (; i++ < 20 && r < 4.0;) r += 1.0;\n"
     "    return r + 100.0 * float(i); }",
     4.25 + 400},
    {"float density(vec3 p) { int i = 0, k = 0; float r = p.x; for (; i < 3 && r < 2.0 && k++ < 9; i++) r += 0.5;\n"
     "    return r + 100.0 * float(i) + 1000.0 * float(k); }",
     2.25 + 200 + 2000},
    /* an offset whose denominator is as large as 60 bits */
    {"float density(vec3 p) { return p.x - (3.0 + 1.0 / 3.0 / 768614336404564651.0); }", -1.75},
    {"float density(vec3 p) { return 0.125 * p.x - (30.0 + 1.0 / 3.0 / 76861433640456467.0); }", 0.15625 - 30},
    /* while and do */
    {"float density(vec3 p) { int i = 0; float r = p.x; while (r < 4.0 && i++ < 20) r += 1.0;\n"
     "    return r + 100.0 * float(i); }",
     4.25 + 300},
    {"float density(vec3 p) { float r = p.x; int i = 0; while (r < 40.0) { r += 1.0; if (++i >= 20) break; }\n"
     "    return r + 100.0 * float(i); }",
     21.25 + 2000},
    {"float density(vec3 p) { float r = p.x; int i = 0; do { i++; if (i == 2) continue; r += 1.0; } while (i < 4);\n"
     "    return r + 100.0 * float(i); }",
     4.25 + 400},
    {"float density(vec3 p) { float r = p.x; int i = 0; do r += 1.0; while (r < 4.0 && ++i < 5);\n"
     "    return r + 100.0 * float(i); }",
     4.25 + 200},
    /* what means nothing here is passed over */
    {"#pragma 3D what's\n#include \"3D.frag\"\n#version 300 es\nuniform sampler1D a; uniform usampler2DArray b;\n"
     "float density(vec3 p) { return p.x; }",
     1.25},
    /* a product of a float and a place that moves another place */
    {"float density(vec3 p) { float w = p.x * p.x; return floor(fma(w, p.y * 0.5, p.y * 0.5)); }", -4},
    {"float density(vec3 p) { mat2 m = mat2(1.0, 0.0, p.x * p.x, 1.0); return fract((m * p.yy).x); }", 0.59375},
    /* iFrame stays an int */
    {"float density(vec3 p) { float s = 0.0; for (int m = min(iFrame, 0); m < 3; m++)\n"
     "    for (int n = min(iFrame, 0); n < 3; n++) s += 1.0; return s + float(iFrame / 2) + iTime + iTime; }",
     9},
};

static void test_programs(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof programs / sizeof *programs; i++) {
        text_world w = world_from_text(programs[i].text);
        karst_oracle_value v = density_at(&w, 1.25, -2.5, 3.75);
        assert_near(v.precise, programs[i].value, 1e-12, programs[i].text);
        assert_near((double)v.device, programs[i].value, 1e-4, programs[i].text);
        world_finish(&w);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_programs)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
