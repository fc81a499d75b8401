/* What texts mean: values of expressions and statements, by the oracle, against numbers worked out in C. */
#include "world_text.h"

#define M4 "mat4(2, 0, 1, 3, 1, 3, 2, -1, 1, 1, 4, 2, 0, 2, -3, 1)"

/* p = (1.25, -2.5, 3.75) */
static const struct {
    const char *expression;
    double value;
} expressions[] = {
    /* numbers and conversions */
    {"1 + 2 * 3 - 4 / 2", 5},
    {"7 / 2", 3},
    {"7.0 / 2", 3.5},
    {"-7 / 2", -3},
    {"-7 % 3", -1},
    {"0x10 + 010", 24},
    {"7u / 2u", 3},
    {"1e3 + .5 + 2.", 1002.5},
    {"float(int(p.y))", -2},
    {"int(2.9)", 2},
    {"uint(3.7)", 3},
    {"bool(0.5)", 1},
    {"float(true) + float(false)", 1},
    {"1 << 4 | 3 & 6 ^ 1", 19},
    {"~0 & 0xff", 255},
    {"-1 >> 1", -1},
    {"0x80000000u >> 31", 1},
    {"2147483647 + 1 < 0", 1},
    {"1 << 33", 2},
    {"5 / 0 + 5 % 0", 0},
    {"int(1e20)", 2147483647},
    {"int(p.x / 0.0)", 2147483647},
    {"int(0.0 / 0.0)", 0},
    {"uint(-1.0)", 0},
    {"0.1 + 0.2 == 0.3", 1}, /* literals are decimals */
    {"1.0f + 2.0F", 3},
    {"p.x > 1.0 && p.y < 0.0 || false", 1},
    {"true ^^ true", 0},
    {"!(p.x < 0.0)", 1},
    {"p.x > 2.0 ? 1.0 : p.z > 3.0 ? 2.0 : 3.0", 2},
    {"(1.0, 2.0)", 2},
    {"- -p.x", 1.25},
    {"+p.x", 1.25},
    /* vectors */
    {"p.x + p.y * p.z", -8.125},
    {"p.xy.y", -2.5},
    {"p.bgr.x", 3.75},
    {"p.stp.t", -2.5},
    {"p.zzx.y", 3.75},
    {"p.x.xxx.y", 1.25},
    {"vec3(1, 2, 3).z", 3},
    {"vec3(p.xy, 9).z", 9},
    {"vec4(1.0).w", 1},
    {"vec2(p).y", -2.5},
    {"(p * 2.0).y", -5},
    {"(2.0 / vec2(4.0, 8.0)).y", 0.25},
    {"(p + p.zyx).x", 5},
    {"p[2]", 3.75},
    {"p[int(p.x)]", -2.5},
    {"(-p).x", -1.25},
    {"ivec3(p).y + 1", -1},
    {"vec2(ivec2(3, 4)).y", 4},
    {"p == vec3(1.25, -2.5, 3.75)", 1},
    {"p.xy != p.xy", 0},
    {"float3(1, 2, 3).y", 2},
    {"((float2)(5, 6)).y", 6},
    {"(int)p.z", 3},
    {"((float3)(7.0f)).z", 7},
    {"any(lessThan(p, vec3(0.0)))", 1},
    {"all(greaterThanEqual(p, vec3(-2.5)))", 1},
    {"any(not(bvec2(true, true)))", 0},
    {"all(equal(ivec2(1, 2), ivec2(1, 2)))", 1},
    {"length(bvec2(true) == bvec2(true) ? vec2(3, 4) : vec2(0))", 5},
    /* matrices: columns */
    {"(mat2(1, 2, 3, 4) * vec2(5, 6)).x", 23},
    {"(vec2(5, 6) * mat2(1, 2, 3, 4)).x", 17},
    {"(mat2(1, 2, 3, 4) * mat2(5, 6, 7, 8))[0].y", 34},
    {"mat3(2.0)[1][1]", 2},
    {"mat3(2.0)[1].x", 0},
    {"mat2(mat3(1, 2, 3, 4, 5, 6, 7, 8, 9))[1].y", 5},
    {"mat3(mat2(1, 2, 3, 4))[2].z", 1},
    {"transpose(mat2(1, 2, 3, 4))[0].y", 3},
    {"determinant(mat3(2, 0, 1, 1, 3, 2, 1, 1, 4))", 18},
    {"(inverse(mat2(4, 2, 7, 6)) * mat2(4, 2, 7, 6))[1].y", 1},
    {"(inverse(mat3(2, 0, 1, 1, 3, 2, 1, 1, 4)) * mat3(2, 0, 1, 1, 3, 2, 1, 1, 4))[2].z", 1},
    {"(mat2(1, 2, 3, 4) + 1.0)[1].x", 4},
    {"(mat2(1, 2, 3, 4) - mat2(1.0))[0].x", 0},
    {"mat4(3.0)[3].w", 3},
    {"determinant(" M4 ")", 80},
    {"(inverse(" M4 ") * " M4 ")[2].z", 1},
    {"length(abs((inverse(" M4 ") * " M4 ")[0]) + abs((" M4 " * inverse(" M4 "))[3]))", 1.4142135623730951},
    {"mul(mat2(1, 2, 3, 4), vec2(5, 6)).x", 17}, /* of rows, as HLSL has them */
    {"frac(vec2(p.y)).y", 0.5},
    {"asinh(2.0)", 1.4436354751788103},
    {"asinh(p.y)", -1.6472311463710958},
    {"acosh(2.0)", 1.3169578969248166},
    {"atanh(0.5)", 0.5493061443340548},
    {"bitCount(0xf0f1) + bitCount(-1)", 41},
    {"bitfieldReverse(1u) >> 30", 2},
    {"findLSB(40) * 100 + findMSB(40) * 10 + findLSB(0) + findMSB(-1)", 348},
    {"findMSB(0x80000000u) + findMSB(-256)", 38},
    {"bitfieldExtract(0x1234u, 4, 8)", 35},
    {"bitfieldExtract(0xf0, 4, 4)", -1},
    {"bitfieldExtract(-1, 0, 32) + bitfieldExtract(7, 3, 0)", -1},
    {"bitfieldInsert(0xffffu, 0u, 4, 8)", 61455},
    {"bitfieldInsert(0, 5, 1, 0) + bitfieldInsert(1, 9, 0, 32)", 9},
    {"outerProduct(vec2(1, 2), vec2(4, 5))[1].y", 10},
    {"outerProduct(vec4(1, 2, 3, 4), vec4(4, 5, 6, 7))[3].w", 28},
    {"matrixCompMult(mat4(2.0), mat4(3.0))[3].w", 6},
    {"outerProduct(vec3(1, 2, 3), vec3(4, 5, 6))[2].y", 12},
    /* functions */
    {"floor(p.y) + ceil(p.y)", -5},
    {"fract(p.y)", 0.5},
    {"mod(p.y, 2.0)", 1.5},
    {"mod(p, 2.0).z", 1.75},
    {"mod(p.x, 0.0)", 0},
    {"round(p.z)", 4},
    {"trunc(p.y)", -2},
    {"sign(p.y) + sign(0.0)", -1},
    {"abs(p.y)", 2.5},
    {"abs(-3)", 3},
    {"min(p.x, p.y)", -2.5},
    {"max(2, 3)", 3},
    {"min(p, 0.0).y", -2.5},
    {"clamp(p.z, 0.0, 1.0)", 1},
    {"clamp(p, vec3(-1.0), vec3(1.0)).y", -1},
    {"clamp(7, 0, 3)", 3},
    {"mix(1.0, 3.0, 0.25)", 1.5},
    {"mix(p, p.zyx, 0.5).x", 2.5},
    {"mix(1.0, 2.0, true)", 2},
    {"mix(1e20 * p.x, 0.3, step(0.0, p.z))", 0.3},
    {"mix(0.3, 1e20 * p.x, step(0.0, p.y))", 0.3},
    {"step(1.0, p.x)", 1},
    {"step(vec2(2.0), p.xy).x", 0},
    {"step(0.0, p).y", 0},
    {"smoothstep(0.0, 2.5, p.x)", 0.5},
    {"smoothstep(vec2(0.0), vec2(2.5), p.xx).y", 0.5},
    {"sqrt(6.25)", 2.5},
    {"sqrt(p.y)", 0},
    {"inversesqrt(4.0)", 0.5},
    {"length(vec2(3.0, 4.0))", 5},
    {"length(p)", 4.677071733467427},
    {"distance(p, vec3(0.0))", 4.677071733467427},
    {"dot(p, p)", 21.875},
    {"dot(vec2(1, 2), vec2(3, 4))", 11},
    {"normalize(p).x", 0.26726124191},
    {"length(normalize(vec3(0.0)))", 0},
    {"cross(vec3(1, 0, 0), vec3(0, 1, 0)).z", 1},
    {"reflect(vec2(1, -1), vec2(0, 1)).y", 1},
    {"refract(vec2(0, -1), vec2(0, 1), 0.5).y", -1},
    {"faceforward(p, p, p).x", -1.25},
    {"sin(p.x)", 0.9489846193555862},
    {"cos(p.x)", 0.3153223623952687},
    {"tan(p.x)", 3.00956967386283},
    {"sin(1.5707963267948966)", 1},
    {"asin(0.5)", 0.5235987755982989},
    {"acos(2.0)", 0},
    {"acos(-1.0)", 3.141592653589793},
    {"atan(p.y)", -1.190289949682532},
    {"atan(p.y, p.x)", -1.1071487177940904},
    {"atan(0.0, 0.0)", 0},
    {"atan(1.0, -1.0)", 2.356194490192345},
    {"radians(180.0)", 3.141592653589793},
    {"degrees(3.141592653589793)", 180},
    {"exp(1.0)", 2.718281828459045},
    {"log(p.z)", 1.3217558399823195},
    {"exp2(p.z)", 13.454342644059432},
    {"log2(8.0)", 3},
    {"exp(-1e6) > 0.0", 1},
    {"log(0.0)", -87.33654475055311},
    {"pow(p.z, 3.0)", 52.734375},
    {"pow(p.y, 3.0)", -15.625},
    {"pow(p.y, -2.0)", 0.16},
    {"pow(p.x, 0.5)", 1.118033988749895},
    {"pow(p.x, 1.7)", 1.4613257},
    {"pow(2.0, 10.0)", 1024},
    {"pow(p.x, 0.0)", 1},
    {"pow(p.x, 7.0)", 4.76837158203125},
    {"sinh(1.0)", 1.1752011936438014},
    {"tanh(-1.0)", -0.7615941559557649},
    {"fma(2.0, 3.0, 4.0)", 10},
    {"isnan(0.0 / 0.0)", 1},
    {"isinf(1.0 / 0.0)", 1},
    {"floatBitsToInt(1.0)", 0x3f800000},
    {"uintBitsToFloat(0x40000000u)", 2},
    {"floatBitsToUint(p.x) >> 23", 127},
    /* the prelude's shapes */
    {"sphere(p, 1.0)", 3.677071733467427},
    {"box(vec3(3, 0, 0), vec3(1))", 2},
    {"box(vec3(0.5, 0, 0), vec3(1))", -0.5},
    {"torus(vec3(3, 0, 0), 2.0, 0.5)", 0.5},
    {"capsule(vec3(0, 5, 0), vec3(0), vec3(0, 2, 0), 1.0)", 2},
    {"plane(p, vec3(0, 1, 0), 1.0)", -3.5},
    {"cylinder(vec3(3, 0, 0), 1.0, 1.0)", 2},
    {"smin(1.0, 1.0, 1.0)", 0.75},
    {"smin(1.0, 3.0, 1.0)", 1},
    {"smax(1.0, 1.0, 1.0)", 1.25},
    {"repeat(p.z, 2.0)", -0.25},
    {"repeat(p, 2.0).y", -0.5},
    {"mirror(p.z, 2.0)", 1.75},
    {"rotate(vec2(1, 0), 1.5707963267948966).y", 1},
    {"rotatey(vec3(0, 0, 1), 1.5707963267948966).x", 1},
    {"(rotation(1.5707963267948966) * vec2(1, 0)).y", 1},
    {"rotatex(vec3(0, 1, 0), 1.5707963267948966).z", 1},
    {"roundbox(vec3(3, 0, 0), vec3(1), 0.25)", 2},
    {"lerp(1.0, 3.0, 0.5)", 2},
    {"saturate(p.z)", 1},
    {"fmod(-3.5, 2.0)", -1.5},
    {"fmin(fabs(p.y), 9.0f)", 2.5},
    {"mad(p.x, 2.0, 1.0)", 3.5},
};

static void test_expressions(void **s)
{
    (void)s;
    for (size_t i = 0; i < sizeof expressions / sizeof *expressions; i++) {
        karst_oracle_value v = value_of(expressions[i].expression, 1.25, -2.5, 3.75);
        double size = 1 + fabs(expressions[i].value);
        assert_near(v.precise, expressions[i].value, 1e-7 * size, expressions[i].expression);
        assert_near((double)v.device, expressions[i].value, 1e-5 * size, expressions[i].expression);
    }
}

/* Bodies of density at the same place; helpers go before. */
static const struct {
    const char *name, *helpers, *body;
    double value;
} texts[] = {
    {"scopes", "", "float a = 1.0; { float a = 2.0; a += 1.0; } float b = a; { b += a; } return b;", 2},
    {"a name of itself", "", "float x = p.x; { float x = x + 1.0; p.x = x; } return p.x;", 2.25},
    {"if", "", "float a = 0.0; if (p.x > 1.0) a = 1.0; else a = 2.0; if (p.x > 2.0) { a += 10.0; } return a;", 1},
    {"else if", "",
     "if (p.x > 2.0) return 1.0; else if (p.y > 0.0) return 2.0; else if (p.z > 0.0) return 3.0; return 4.0;", 3},
    {"early return", "", "if (p.y < 0.0) return 7.0; p.x = 100.0; return p.x;", 7},
    {"return in a loop", "", "for (int i = 0; i < 10; i++) { if (float(i) > p.z) return float(i); } return -1.0;", 4},
    {"break", "", "float a = 0.0; for (int i = 0; i < 10; i++) { if (float(i) > p.z) break; a += 1.0; } return a;", 4},
    {"continue", "",
     "float a = 0.0; for (int i = 0; i < 6; i++) { if (mod(float(i) + p.x, 2.0) < 1.0) continue; a += float(i); } "
     "return a;",
     6},
    {"a counter after its loop", "", "int i; for (i = 0; i < 10; i++) if (float(i) > p.z) break; return float(i);", 4},
    {"a counter after a whole loop", "", "int i; for (i = 0; i < 10; i++) p.x += 1.0; return float(i);", 10},
    {"a varying end", "", "float a = 0.0; for (int i = 0; i < 10 && float(i) < p.z; i++) a += 1.0; return a;", 4},
    {"a float counter", "", "float a = 0.0; for (float t = 0.0; t < 1.0; t += 0.1) a += 1.0; return a;", 10},
    {"loops in loops", "",
     "float a = 0.0; for (int i = 0; i < 4; i++) for (int j = i; j < 4; j++) { if (j == 2) continue; a += float(i * "
     "j); } return a;",
     19},
    {"break of the inner loop", "",
     "float a = 0.0; for (int i = 0; i < 3; i++) { for (int j = 0; j < 5; j++) { if (float(j) > p.x) break; a += 1.0; "
     "} a += 10.0; } return a;",
     36},
    {"a body that moves the counter", "", "float a = 0.0; for (int i = 0; i < 10; i++) { a += 1.0; i++; } return a;",
     5},
    {"counting down", "", "float a = 0.0; for (int i = 5; i > 0; --i) a = a * 2.0 + float(i); return a;", 129},
    {"two counters", "", "float a = 0.0; for (int i = 0, j = 10; i < j; i++, j--) a += float(j - i); return a;", 30},
    {"postfix and prefix", "", "int i = 3; int j = i++; int k = ++i; return float(i * 100 + j * 10 + k);", 535},
    {"inout", "void f(inout float a, out float b, in float c) { a += 1.0; b = a * c; c = 0.0; }\n",
     "float u = 1.0, v; f(u, v, p.z); return u + v;", 9.5},
    {"inout of a swizzle", "void f(inout vec2 a) { a = a.yx * 2.0; }\n", "f(p.xz); return p.x - p.z + p.y;", 2.5},
    {"inout under a condition", "void f(inout float a) { if (a > 0.0) { a = 9.0; return; } a = -9.0; }\n",
     "f(p.x); f(p.y); return p.x * 10.0 + p.y;", 81},
    {"globals", "float g = 1.0; float h;\nvoid f(float a) { g += a; h = g; }\n", "f(p.x); f(1.0); return g + 10.0 * h;",
     35.75},
    {"a global under a condition", "float g;\nfloat f(float a) { if (a > 0.0) g += 1.0; else g += 10.0; return g; }\n",
     "float r = f(p.x) + f(p.y); return r * 100.0 + g;", 1211},
    {"what && does not reach", "float g;\nbool f() { g += 1.0; return true; }\n",
     "bool a = p.x > 5.0 && f(); bool b = p.x > 1.0 && f(); bool c = p.x > 1.0 || f(); return g + (a ? 100.0 : 0.0) + "
     "(b && c ? 10.0 : 0.0);",
     11},
    {"what ?: does not reach", "float g;\nfloat f(float a) { g += a; return a; }\n",
     "float a = p.x > 0.0 ? f(1.0) : f(2.0); return g * 10.0 + a;", 11},
    {"overloads",
     "float f(float a) { return 1.0; } float f(vec2 a) { return 2.0; } float f(int a) { return 3.0; } float f(float a, "
     "float b) { return 4.0; }\n",
     "return f(p.x) * 1000.0 + f(p.xy) * 100.0 + f(2) * 10.0 + f(1, 2);", 1234},
    {"functions hide the built-in ones",
     "float length(vec3 a) { return 42.0; } float smin(float a, float b) { return 8.0; }\n",
     "return length(p) + smin(p.x, p.y) + sphere(vec3(3.0, 4.0, 0.0), 0.0);", 55},
    {"declared before",
     "float f(float a);\nfloat g(float a) { return f(a) + 1.0; }\nfloat f(float a) { return a * 2.0; }\n",
     "return g(p.x);", 3.5},
    {"structs",
     "struct A { float x; vec2 y; }; struct B { A a[2]; int n; };\nB f(float v) { B b; b.a[1].y = vec2(v, 2.0); b.n = "
     "3; return b; }\n",
     "B b = f(p.x); b.a[0] = A(5.0, vec2(6.0, 7.0)); A c = b.a[1]; return b.a[0].x + c.y.x + b.a[0].y.y + float(b.n);",
     16.25},
    {"equal structs", "struct A { float x; int n; };\n",
     "A a = A(p.x, 1); A b = a; b.n++; return float(a == b) + 2.0 * float(a != b);", 2},
    {"arrays", "",
     "float a[3] = float[3](1.0, 2.0, 3.0); float b[] = float[](4.0, 5.0); a[1] += b[1]; return a[0] + a[1] * 10.0;",
     71},
    {"lists", "const vec2 t[2] = {{1.0, 2.0}, {3.0, 4.0}};\n", "return t[1].x * 10.0 + t[0].y;", 32},
    {"a varying index", "",
     "float a[4]; for (int i = 0; i < 4; i++) a[i] = float(i * i); a[int(p.x)] = 50.0; return a[int(p.z)] + "
     "a[int(-p.y) - 1] + a[100 * int(p.x)];",
     68},
    {"a varying index of a matrix", "",
     "mat3 m = mat3(1, 2, 3, 4, 5, 6, 7, 8, 9); m[int(p.x)][int(p.x) + 1] = 60.0; return m[int(p.x)][2] + m[1].y;", 65},
    {"swizzles written", "",
     "vec4 v; v.zx = p.xy; v.w = 1.0; v.y += 4.0; v.rg *= 2.0; return v.x * 1000.0 + v.y * 100.0 + v.z * 10.0 + v.w;",
     -4186.5},
    {"matrices written", "",
     "mat2 m = mat2(0.0); m[1] = vec2(1.0, 2.0); m[0].y = 3.0; vec2 v = vec2(1.0, 10.0) * m; return v.x + v.y;", 51},
    {"operators with =", "",
     "int a = 5; a <<= 2; a |= 1; a ^= 3; a %= 7; a &= 6; float b = 3.0; b /= 2.0; b -= 1.0; return float(a) + b;",
     0.5},
    {"conditional swap", "", "float a = p.x, b = p.y; if (a > b) { float t = a; a = b; b = t; } return b - a;", 3.75},
    {"const", "const float k = 2.0, m = k * 3.0;\nconst int n = int(m) - 3;\n", "float a[n]; a[2] = m; return a[2];",
     6},
    {"implicit inputs", "", "return iTime + float(iFrame) + iMouse.x + iResolution.y + p.x;", 1.25},
    {"void parameters", "float f(void) { return 3.0; }\n", "return f();", 3},
    {"empty statements", "", ";;; { } for (int i = 0; i < 3; i++); if (p.x > 0.0) {} else ; return 1.0;", 1},
    {"unreachable nonsense", "float f(vec3 a) { return texture(b, c) +++ while; }\n", "return p.x;", 1.25},
    /* the preprocessor */
    {"macros", "#define TWO 2.0\n#define ADD(a, b) ((a) + (b))\n#define TWICE(f, x) f(x, x)\n",
     "return TWICE(ADD, TWO) + ADD(ADD(1, 2), (3, 4));", 11},
    {"macros over lines", "#define F(a) \\\n   ((a) * \\\n   2.0)\n", "return F(\n p.x\n);", 2.5},
    {"macros of macros", "#define A B\n#define B C + 1.0\n#define C 3.0\n#define f(x) x * g\n#define g(y) (y)\n",
     "return A + f(2.0)(3.0);", 10},
    {"conditions",
     "#define A 3\n#if defined(A) && A * 2 >= 6 && !defined B\n#define R 1.0\n#elif 1\n#define R 2.0\n#else\n#error "
     "no\n#endif\n#ifndef A\n#error no\n#else\n#define Q 4.0\n#endif\n"
     "#undef A\n#ifdef A\n#define S 1.0\n#else\n#define S 8.0\n#endif\n#if 0\n don't @ \"look\"\n"
     " 3D 08 1e 0x 0xfffffffff 9999999999 1.2.3\n#if "
     "1\n#endif\n#else\n#endif\n",
     "return R + Q + S;", 13},
    {"a directive of strangers", "#pragma 3D\n#define UNUSED 3D\n#shader 4K 1e\n", "return 2.0;", 2},
    {"a call without brackets", "#define h(x) 100.0\nfloat k(float h) { return h; }\n", "return k(5.0);", 5},
    {"a struct in a function",
     "float f() { struct S { float a; vec2 b; }; S s = S(1.0, vec2(2.0, 3.0)); return s.a + s.b.y; }\n",
     "struct S { float c; } s = S(5.0), t; t.c = f(); { struct S { int i; }; S u = S(2); s.c += float(u.i); } return "
     "s.c + t.c;",
     11},
    {"a variable behind its struct", "struct T { float a; } t = T(4.0);\n", "return t.a;", 4},
    {"a name once more in an inner block", "float f(float a) { float a = 2.0; return a; }\n",
     "float i = 1.0; for (int i = 0; i < 2; i++) { float i = 3.0; } { float i = 9.0; } return i + f(5.0);", 3},
    {"known macros", "#if KARST == 1 && __VERSION__ >= 300\n#define R 1.0\n#endif\n", "return R;", 1},
};

static void test_texts(void **s)
{
    (void)s;
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        char text[4096];
        snprintf(text, sizeof text, "%sfloat density(vec3 p) {\n%s\n}\n", texts[i].helpers, texts[i].body);
        text_world w = world_of(text, strlen(text), texts[i].name);
        karst_oracle_value v = density_at(&w, 1.25, -2.5, 3.75);
        assert_near(v.precise, texts[i].value, 1e-9 * (1 + fabs(texts[i].value)), texts[i].name);
        assert_near((double)v.device, texts[i].value, 1e-5 * (1 + fabs(texts[i].value)), texts[i].name);
        world_finish(&w);
    }
}

/* The same computation, inlined and called, in a loop and written out: one graph. */
static void test_same_graph(void **s)
{
    (void)s;
    static const char *const pairs[][2] = {
        {"float d = p.y; for (int i = 0; i < 3; i++) d += noise(p * float(i + 1)) / float(i + 1); return d;",
         "return p.y + noise(p) + noise(p * 2.0) / 2.0 + noise(p * 3.0) / 3.0;"},
        {"return p.x < p.y ? p.x : p.y;", "return min(p.y, p.x);"},
        {"float a = p.x; if (a < 0.0) a = -a; return a;", "return abs(p.x);"},
        {"return sqrt(dot(p, p));", "return length(p);"},
        {"return sqrt(p.x * p.x + p.y * p.y + p.z * p.z);", "return length(p);"},
        {"float a = 1.0; if (p.x > 0.0) { if (p.x > 0.0) a = 2.0; else a = 3.0; } return a;",
         "return p.x > 0.0 ? 2.0 : 1.0;"},
        {"return p.x * 0.0 + p.y * 1.0;", "return p.y;"},
        {"return p.y + p.x;", "return p.x + p.y;"},
        {"return p.x - 2.0;", "return -2.0 + p.x;"},
        {"return max(p.x, -p.x);", "return abs(p.x);"}};
    for (size_t i = 0; i < sizeof pairs / sizeof *pairs; i++) {
        text_world a = world_from_body(pairs[i][0]), b = world_from_body(pairs[i][1]);
        const karst_graph *g = &a.program->graph, *h = &b.program->graph;
        if (g->nodes[a.program->root[KARST_ROOT_DENSITY]].op != h->nodes[b.program->root[KARST_ROOT_DENSITY]].op ||
            g->num_nodes != h->num_nodes)
            fail_msg("%s: %u nodes, %s; but %u nodes, %s", pairs[i][0], g->num_nodes,
                     karst_op_name(g->nodes[a.program->root[KARST_ROOT_DENSITY]].op), h->num_nodes,
                     karst_op_name(h->nodes[b.program->root[KARST_ROOT_DENSITY]].op));
        for (int k = 0; k < 50; k++) {
            double x = k * 0.37 - 9, y = k * -0.71 + 17, z = k * 0.13 - 3;
            karst_oracle_value u = density_at(&a, x, y, z), v = density_at(&b, x, y, z);
            assert_near(u.precise, v.precise, 1e-12 * (1 + fabs(u.precise)), pairs[i][0]);
        }
        world_finish(&a);
        world_finish(&b);
    }
}

static void test_header(void **s)
{
    (void)s;
    static const char text[] =
        "// first\n/*{ \"name\": \"N\", \"author\": \"A\", \"description\": \"D\", \"seed\": 4294967295, \"voxel\": "
        "0.1, \"extent\": 1e6, \"lipschitz\": 2,\n"
        "\"params\": { \"a\": 0.1, \"n\": { \"value\": 3, \"min\": 1, \"max\": 9, \"step\": 1, \"unit\": \"m\", "
        "\"label\": \"L\" }, \"b\": 5 },\n"
        "\"camera\": { \"position\": [\"1e15\", -2, 0.5], \"yaw\": 30, \"pitch\": -12, \"fov\": 50 }, \"view\": 9000,\n"
        "\"sun\": { \"azimuth\": 120, \"elevation\": 35 }, \"sky\": { \"zenith\": [0.1, 0.2, 0.3], \"haze\": 4000, "
        "\"haze_height\": 900, \"haze_globe\": 6e6 } "
        "}*/\n"
        "float density(vec3 p) { float d = a; for (int i = 0; i < int(n); i++) d += p.x; return d; }\n";
    text_world w = world_from_text(text);
    const karst_world_header *h = &w.program->header;
    assert_string_equal(h->name, "N");
    assert_string_equal(h->author, "A");
    assert_string_equal(h->description, "D");
    assert_int_equal(h->seed, 4294967295u);
    assert_int_equal(h->voxel_log2_m, -3);
    assert_true(h->has_extent && h->extent_m == 1e6 && h->has_lipschitz && h->lipschitz == 2 &&
                h->view_distance_m == 9000);
    assert_string_equal(h->camera_position[0], "1000000000000000");
    assert_string_equal(h->camera_position[1], "-2");
    assert_string_equal(h->camera_position[2], "0.5");
    assert_true(h->camera_yaw_deg == 30 && h->camera_pitch_deg == -12 && h->camera_fov_deg == 50);
    assert_true(h->sun_azimuth_deg == 120 && h->sun_elevation_deg == 35 && h->sky_zenith[2] == 0.3 &&
                h->haze_distance_m == 4000 && h->haze_height_m == 900 && h->haze_globe_m == 6e6);
    assert_false(h->has_atmosphere);
    assert_int_equal(w.program->num_parameters, 3);
    const karst_world_parameter *p = w.program->parameters;
    assert_int_equal(p[0].value.numerator, 1); /* 0.1 is a tenth */
    assert_int_equal(p[0].value.denominator, 10);
    assert_true(p[1].min == 1 && p[1].max == 9 && p[1].step == 1);
    assert_string_equal(p[1].unit, "m");
    assert_string_equal(p[1].label, "L");
    assert_true(p[0].is_used && p[1].is_used && !p[2].is_used);
    assert_true(!p[0].is_structural && p[1].is_structural);
    assert_near(density_at(&w, 2, 0, 0).precise, 6.1, 1e-12, "three rounds");
    world_finish(&w);
}

static void test_atmosphere(void **s)
{
    (void)s;
    text_world w = world_from_text("/*{ \"sky\": { \"model\": \"atmosphere\", \"dust\": 2.5,\n"
                                   "\"haze_globe\": 6e6 } }*/\n"
                                   "float density(vec3 p) { return -p.y; }\n");
    const karst_world_header *h = &w.program->header;
    assert_true(h->has_atmosphere && h->dust == 2.5 && h->haze_globe_m == 6e6);
    world_finish(&w);
    w = world_from_text("/*{ \"sky\": { \"model\": \"plain\" } }*/\nfloat density(vec3 p) { return -p.y; }\n");
    assert_true(!w.program->header.has_atmosphere && w.program->header.has_sky);
    world_finish(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_expressions), cmocka_unit_test(test_texts),
                                       cmocka_unit_test(test_same_graph), cmocka_unit_test(test_header),
                                       cmocka_unit_test(test_atmosphere)};
    return cmocka_run_group_tests_name("the language", tests, NULL, NULL);
}
