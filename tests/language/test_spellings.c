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
    /* arrays of arrays, and lists as C and HLSL have them */
    {"const float w[2][3] = float[2][3](float[3](1.0, 2.0, 3.0), float[3](4.0, 5.0, 6.0)); int i = int(p.x + 1.0); "
     "return w[i][2] * 10.0 + w[0][i];",
     62},
    {"float w[][2] = { { 1.0, 2.0 }, { 3.0, 4.0 }, { 5.0, 6.0 } }; w[2] = w[0]; w[1][1] += 0.5; return w[2][1] + "
     "w[1][1] * 10.0 + float(w.length() * 100 + w[0].length() * 1000);",
     2347},
    {"vec3[2][2] t = vec3[2][2](vec3[2](vec3(0.0), p), vec3[2](p * 2.0, vec3(3.0))); float s = 0.0; for (int i = 0; i "
     "< 2; i++) for (int k = 0; k < 2; k++) s += t[i][k].z; return s;",
     5.1},
    {"float[2] a[3]; for (int i = 0; i < 3; i++) a[i] = float[2](float(i), p.x); return a[2][0] + a[1][1];", 2.3},
    {"static const float k[2][2] = { 1, 2, 3, 4 }; float a[4] = {0}, b[3] = {}; return k[1][0] + a[3] + b[0];", 3},
    {"float2x2 m = { 1, 0.5, 0, 2 }; return mul(m, p.xy).x + m[0][1];", 0.9},
    {"float4 q = 0, r = {p, 1}; float3 s = 2; s *= p; q.xyz = s; return q.z + r.w;", 2.4},
    /* matrices and vectors by element */
    {"float3x3 m = float3x3(1,2,3, 4,5,6, 7,8,9); m._m01 = 20; m._m20_m22 = float2(70, 90); return m._12 + m._m21 * "
     "100 + m[2][0] * 1000 + m._m00_m11.y + m._33;",
     20 + 800 + 70000 + 5 + 90},
    {"float4 q = (float4)(p, 1.0f); q.s01 = q.s10; return q.s0 + 10 * q.hi.y + 100 * q.odd.x + 1000 * q.s2;",
     0.2 + 10 + 30 + 700},
    /* bits of floats */
    {"int n; float m = frexp(10.0 * p.x, n); return m + float(n) + ldexp(p, ivec3(0, 1, 2)).y;", 0.75 + 2 + 0.4},
    {"vec2 v = unpackHalf2x16(packHalf2x16(vec2(1.0 + p.x, -65504.0))); return v.x * 1e4 - v.y;",
     floor(1.3 * 1024 + 0.5) / 1024 * 1e4 + 65504},
    {"return unpackHalf2x16(packHalf2x16(vec2(1e-6, 3e5))).x * 1e6 + f16tof32(0xc500u);", 17 * 0x1p-24 * 1e6 - 5},
    {"return float(packUnorm4x8(vec4(0.0, 0.5, 1.0, p.x)) >> 8 & 0xffffu);", 128 + 255 * 256},
    {"return unpackSnorm2x16(packSnorm2x16(vec2(-0.5, 2.0))).x + unpackSnorm4x8(packSnorm4x8(vec4(-p, 1.0))).z + "
     "unpackUnorm2x16(packUnorm2x16(p.yz)).y;",
     -round(0.5 * 32767) / 32767 - round(0.7 * 127) / 127 + round(0.7 * 65535) / 65535},
    /* truth, as C and HLSL have it */
    {"int n = 3; float s = 0.0; while (n--) s += p.x; if (n & 1) s += 10.0; return !n ? 0.0 : s + (p.y > 0.1) * 0.5;",
     11.4},
    {"int is_near = p.x < 1.0; uint k = 4u; return is_near && k ? float(is_near) : 5.0;", 1},
    {"return float3(convert_int3(p * 10.0f + 0.5f)).z + (float3){1.0f, p.y, 3.0f}.y + convert_float(7);", 14.2},
    {"unsigned int a = 7u, b = (unsigned int)(3); unsigned c = a * b; auto d = float(c); const auto e = p * d; return "
     "e.z;",
     14.7},
    {"float smooth = 2.0, sample = 3.0, shared = 4.0, constant = 0.5; smooth += shared; return smooth * constant "
     "+ sample;",
     6},
    /* what says nothing of a density */
    {"float d = 0; [unroll] for (int i = 0; i < 3; i++) d += 1; [loop] while (d < 5) d += 1; [branch] if (p.x > 0) "
     "d += "
     "p.x; return d;",
     5.3},
};

/* Whole texts. */
static const struct {
    const char *text;
    double value;
} wholes[] = {
    {"struct { float r; vec3 c; } ball; struct Hit { float d; struct { int id; vec2 w; } info; };\n"
     "Hit map(vec3 p) { Hit h; h.d = length(p - ball.c); h.info.id = 3; h.info.w = p.xy; return h; }\n"
     "float density(vec3 p) { ball.c = p + vec3(2.0, 0.0, 0.0); Hit h = map(p); struct { float a, b; } s; s.b = h.d;\n"
     "    return s.b + float(h.info.id) * 10.0 + h.info.w.y; }",
     32.2},
    {"typedef struct Ball_s { float r; float3 c; } Ball; typedef struct { float a[2]; } Two; typedef float Row[3], F;\n"
     "typedef struct Late Late; struct Late { F x; }; typedef vec3 float3; const struct { float k; } fixed_one = { "
     "4.0 };\n"
     "F radius(const Ball b) { return b.r; }\n"
     "float density(float3 p) { struct Ball_s c = { 1.5f, p }; Ball b = { .c = p, .r = 2.0f }; Row m[2]; m[1][2] = 7;\n"
     "    Two t = {{ 1, 2 }}; Late l; l.x = fixed_one.k; typedef float3 V; V v = b.c; Ball z = (Ball)0;\n"
     "    return radius(b) + radius(c) * 10 + m[1][2] * 100 + t.a[1] + l.x + v.y + z.r + ((Ball){ 9, p }).r * 1000; }",
     2 + 15 + 700 + 2 + 4 + 0.2 + 9000},
    {"enum { AIR, ROCK = 4, SAND }; enum Kind : int { A = ROCK * 2, B, C }; enum class Other { X };\n"
     "float density(vec3 p) { Kind k = C; enum Kind other = A; return float(SAND + k) + 100.0 * float(other + AIR); }",
     15 + 800},
    {"static const float R = 2.0;\n"
     "float f(float3 p, float r = R * 0.5, float3 c = float3(0, 0, 0)) { return r - p.x + c.y; }\n"
     "float density(float3 p) { float R = 9.0; return f(p) + 10 * f(p, R) + 100 * f(p, 1.0, p); }",
     0.7 + 87 + 90},
    {"namespace sdf { float ball(vec3 p, float r) { return p.x - r; } namespace more { const float two = 2.0; } }\n"
     "using namespace sdf; template <typename T> T twice(T x) { return x + x; } StructuredBuffer<float4> points;\n"
     "void turn(float2 &q, const float &a) { q = float2(q.y, -q.x) * a; }\n"
     "void unused(const float *in, float *out) { *out = \"a string // of C\"; }\n"
     "__kernel void march(__global float *out, const int n) { out[get_global_id(0)] = 0; }\n"
     "struct VOut { float4 pos [[position]]; float2 uv; };\n"
     "float density(glm::vec3 p) { float2 q{1.0f, 2.0f}; turn(q, 3.0f); float r{0.5f};\n"
     "    return sdf::ball(p, more::two) + q.x * 10.0 + std::abs(-r) + std::max(p.y, 0.0f); }",
     0.3 - 2 + 60 + 0.5 + 0.2},
};

/* Comments at the top that are no headers, and one that is, loosely written. */
static const char *const comments[] = {
    "/* { old idea: return p.y; } */\n",
    "/*{\n  later: more\n}*/\n",
    "/***{{{ folded }}}***/\n",
    "/*\n{\n  float old(vec3 p) { return 1.0; }\n}\n*/\n",
    "/*{ \"title\": \"a ball\", \"shader\": [1, 2] }*/\n",
    "/*{ \"voxel\": 0.125, // the finest\n  \"view\": 2000, // metres, \"as far as\" one sees\n}*/\n",
};

static void test_comments(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof comments / sizeof *comments; i++) {
        char text[512];
        snprintf(text, sizeof text, "%sfloat density(vec3 p) { return p.x; }\n", comments[i]);
        text_world w = world_from_text(text);
        assert_near(density_at(&w, 0.3, 0.2, 0.7).precise, 0.3, 1e-6, comments[i]);
        const bool is_header = strstr(comments[i], "voxel") != NULL;
        assert_int_equal(w.program->header.is_given, is_header);
        assert_true(!is_header || (w.program->header.voxel_log2_m == -3 && w.program->header.view_distance_m == 2000));
        world_finish(&w);
    }
    /* ISF's inputs are parameters. */
    text_world w = world_from_text(
        "/*{ \"DESCRIPTION\": \"a ball\", \"CREDIT\": \"someone\", \"INPUTS\": [ { \"NAME\": \"r\", \"TYPE\": "
        "\"float\", \"DEFAULT\": 1.5, \"MIN\": 0.0, \"MAX\": 2.0 }, { \"NAME\": \"shade\", \"TYPE\": \"color\" } ] "
        "}*/\nfloat density(vec3 p) { return r - p.x; }\nvoid main() { gl_FragColor = shade; }\n");
    assert_near(density_at(&w, 0.3, 0.2, 0.7).precise, 1.2, 1e-6, "ISF");
    assert_int_equal(w.program->num_parameters, 1);
    assert_false(w.program->header.is_given);
    world_finish(&w);
}

static void test_wholes(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof wholes / sizeof *wholes; i++) {
        text_world w = world_from_text(wholes[i].text);
        assert_near(density_at(&w, 0.3, 0.2, 0.7).precise, wholes[i].value, 2e-3, wholes[i].text);
        world_finish(&w);
    }
}

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
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_bodies), cmocka_unit_test(test_surroundings),
                                       cmocka_unit_test(test_wholes), cmocka_unit_test(test_comments)};
    return cmocka_run_group_tests_name("spellings", tests, NULL, NULL);
}
