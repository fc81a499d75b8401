/* What people paste in the words of GLSL, HLSL, OpenCL C and C means what it means there. */
#include "world_text.h"

/* Bodies of density(vec3 p), or whole texts, and their values at (0.3, 0.2, 0.7). */
static const struct {
    const char *text;
    double value;
} cases[] = {
    /* matrices that are no squares: columns of GLSL, rows of HLSL */
    {"mat2x3 m = mat2x3(1.0, 2.0, 3.0, 4.0, 5.0, 6.0); vec2 q = p * m; return q.x * 10.0 + q.y;",
     10 * (0.3 + 0.4 + 2.1) + (1.2 + 1.0 + 4.2)},
    {"mat3x2 m = mat3x2(1.0, 2.0, 3.0, 4.0, 5.0, 6.0); vec2 q = m * p; return q.x * 10.0 + q.y;",
     10 * (0.3 + 0.6 + 3.5) + (0.6 + 0.8 + 4.2)},
    {"mat2x3 a = mat2x3(1.0, 2.0, 3.0, 4.0, 5.0, 6.0); mat3x2 b = transpose(a); mat2 c = b * a; return c[1][0];", 32},
    {"mat4x3 m = mat4x3(2.0); return (m * vec4(p, 1.0)).y + float(m.length());", 4.4},
    {"mat2x4 m = outerProduct(vec4(p, 1.0), p.xz); return m[1][1];", 0.14},
    {"mat3x4 m = mat3x4(mat2(5.0)); return m[1][1] + m[2][2] + m[2][3];", 6},
    {"mat3x2 m = matrixCompMult(mat3x2(2.0), mat3x2(3.0)); return m[1][1] - m[2][0];", 6},
    {"float3x4 m = float3x4(1,0,0,5, 0,1,0,6, 0,0,1,7); float3 q = mul(m, float4(p, 1)); return q.x + 10 * q.z;",
     5.3 + 77},
    {"float4x3 m = float4x3(1,0,0, 0,1,0, 0,0,1, 5,6,7); float3 q = mul(float4(p, 1), m); return q.x + 10 * q.z;",
     5.3 + 77},
    {"mat2x2 a = mat2x2(1, 2, 3, 4); return (a * p.xy).y;", 1.4},
    /* counters behind a break that depends on the place */
    {"float s = 0.0; int i = 0; while (i < 9) { if (s > p.x + 0.05) break; s += 0.1; i++; } return s + float(i);",
     4.4},
    {"float s = 0.0; int i = 0; while (i < 9) { s += 0.1; if (s > p.x + 0.05) break; i += 2; if (s > p.y + 0.05) "
     "break; "
     "i--; } return s + 10.0 * float(i);",
     40.3},
    {"float s = 0.0; int i = 0; do { if (s > p.z) break; s += 0.3; ++i; } while (i < 5); return s + float(i);", 3.9},
    {"float s = 0.0; int i = 0, k = 0; while (i < 9) { i++; if (p.x + 0.05 > 0.1 * float(i)) continue; k++; if (p.z + "
     "0.05 < 0.1 * float(i)) break; s += 1.0; } return s + 10.0 * float(k) + 100.0 * float(i);",
     854},
    {"int n = 0; for (int i = 0; i < 4; i++) { int k = 0; while (k < 5) { if (float(k) * p.x > p.z) break; k++; "
     "n++; } } "
     "return float(n);",
     12},
    {"int n = 0; int i = 0; while (i < 9) { switch (i) { case 2: break; default: n++; } if (float(i) > 10.0 * p.x + "
     "0.5) break; i++; } return float(n) + 10.0 * float(i);",
     44},
    /* loops whose bound lies between two numbers */
    {"int n = int(clamp(10.0 * p.x + 0.5, 1.0, 6.0)); float s = 0.0; for (int i = 0; i < n; i++) s += 1.0; return "
     "s;", 3},
    {"int n = 2 + int(mod(floor(10.0 * p.z + 0.5), 3.0)); float s = 0.0; for (int i = 0; i < n; i++) s += 1.0; "
     "return s;", 3},
    {"int n = int(floor(10.0 * p.y + 0.5)) & 3; float s = 0.0; for (int i = 0; i < n; i++) s += 1.0; return s;", 2},
    /* words that are types in one language and names in another */
    {"float int2 = 2.0, half = 0.5; int2 += half; return int2 * half - (half);", 0.75},
    {"vec3 float3 = p; return float3.y + float3[2];", 0.9},
    {"half3 q = half3(p); fixed4 c = fixed4(q, 1.0); min16float m = c.w; return q.y + m;", 1.2},
    {"float3 q = (float3)(1.0f, 2.0f, 3.0f); return (float)(int)q.z + ((float2)(p.x, p.y)).y;", 3.2},
    /* whole numbers without a sign */
    {"uint u = 3; u = u * 7 + 2 & 15; return float(u % 4);", 3},
    {"ivec2 c = ivec2(5, 6); uvec2 u = uvec2(1u) + c; return float(u.y);", 7},
    /* functions by other names */
    {"float s, c; sincos(0.0, s, c); return s + 2.0 * c + sqrtf(4.0f) + native_sqrt(9.0f) + fast_length(p.xy * 0.0f);",
     7},
    {"return asfloat(asuint(p.x)) + float(countbits(7u) + firstbithigh(8u) + firstbitlow(8u)) + floorf(p.z);", 9.3},
    {"return lerp(p, p * 2.0, float3(0.0, 1.0, 0.5)).y + fmod(p * 4.0, 0.5).x;", 0.6},
    {"return hypot(3.0, 4.0) + cbrt(-8.0) + copysign(2.0, -p.x) + fdim(1.0, 3.0) + ldexp(p.y, 3);", 2.6},
    {"return expm1(0.0) + log1p(0.0) + iDate.w + iFrameRate + p.x;", 0.3},
    /* what says nothing of a density */
    {"float d = 0; [unroll] for (int i = 0; i < 3; i++) d += 1; [loop] while (d < 5) d += 1; [branch] if (p.x > 0) "
     "d += "
     "p.x; return d;",
     5.3},
};

static void test_bodies(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        text_world w = world_from_body(cases[i].text);
        assert_near(density_at(&w, 0.3, 0.2, 0.7).precise, cases[i].value, 2e-5, cases[i].text);
        world_finish(&w);
    }
}

/* Around a density, what programs of other kinds have. */
static void test_surroundings(void **state)
{
    static const char *const around[] = {
        "#iChannel0 \"file://rock.png\"\n#iUniform float x = 1.0\n# 12 \"a // b\"\n",
        "layout(std140, binding = 0) uniform Block { float a; vec4 b; };\nuniform Other { mat4 m; } other;\n",
        "layout(std430) buffer Data { float values[]; };\n",
        "cbuffer Params : register(b0) { float a; float4 b; };\n",
        "struct VSOut { float4 pos : SV_POSITION; float2 uv : TEXCOORD0; };\nTexture2D tex : register(t0);\n",
        "float4 main(float2 uv : TEXCOORD0, uint id : SV_VertexID) : SV_Target { return tex.Sample(s, uv); }\n",
        "[numthreads(8, 8, 1)]\nvoid CSMain(uint3 id : SV_DispatchThreadID) { }\n",
    };
    (void)state;
    for (size_t i = 0; i < sizeof around / sizeof *around; i++) {
        char text[1024];
        snprintf(text, sizeof text, "%sfloat density(vec3 p) { return p.x; }\n", around[i]);
        text_world w = world_from_text(text);
        assert_near(density_at(&w, 0.3, 0.2, 0.7).precise, 0.3, 1e-6, around[i]);
        world_finish(&w);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_bodies), cmocka_unit_test(test_surroundings)};
    return cmocka_run_group_tests_name("spellings", tests, NULL, NULL);
}
