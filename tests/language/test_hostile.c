/* Hostile texts: each gives a diagnostic with a place, or a valid world, soon and in bounded memory. */
#include "world_text.h"

#include <sys/resource.h>
#include <time.h>

#define DENSITY "float density(vec3 p) { return -p.y; }\n"
#define BODY(text) "float density(vec3 p) {\n" text "\n}\n"
enum { MOST_MS = 2000, MOST_MIB = 500 };

/* Text = head, then `unit` count times, then middle, then `unit2` count2 times, then tail. In a unit, # is its number
 * and ~ its number less one. `said`: part of the error's message; NULL: it must compile. */
static const struct {
    const char *name, *head, *unit;
    int count;
    const char *middle, *unit2;
    int count2;
    const char *tail, *said;
} texts[] = {
    {"a megabyte of brackets", "", "(", 1 << 20, "", "", 0, "", "more than 200000 words"},
    {"a megabyte of braces", "float density(vec3 p)", "{", 1000000, "", "", 0, "", "more than 200000 words"},
    {"more than a megabyte", "//", "x", 1 << 20, "", "", 0, "", "the file has 1048578 bytes"},
    {"a megabyte of comment", "//", "x", 1000000, "\n" DENSITY, "", 0, "", NULL},
    {"deep brackets", "float density(vec3 p) { return ", "(", 300, "p.x", ")", 300, ";}", "nested deeper than 256"},
    {"brackets within bounds", "float density(vec3 p) { return ", "(", 100, "p.x", ")", 100, ";}", NULL},
    {"very deep brackets", "float density(vec3 p) { return ", "(", 90000, "p.x", ")", 90000, ";}",
     "nested deeper than 256"},
    {"minus upon minus", "float density(vec3 p) { return ", "- ", 190000, "p.x", "", 0, ";}", "nested deeper than 256"},
    {"indices", "float density(vec3 p) { return p", "[0]", 50000, "", "", 0, ";}", "nested deeper than 256"},
    {"members", "float density(vec3 p) { return p", ".xyz", 50000, "", "", 0, ".x;}", "nested deeper than 256"},
    {"choices", "float density(vec3 p) { return ", "p.x<0.?1.:", 20000, "2.", "", 0, ";}", "nested deeper than 256"},
    {"assignments", "float density(vec3 p) { float a; ", "a=", 60000, "p.x", "", 0, "; return a;}",
     "nested deeper than 256"},
    {"else if", "float density(vec3 p) { ", "if(p.x>#.)return 1.;else ", 9000, "return 0.", "", 0, ";}",
     "nested deeper than 256"},
    {"nested ifs", "float density(vec3 p) { ", "if(p.x>0.)", 20000, "return 1.", "", 0, "; return 0.;}",
     "nested deeper than 256"},
    {"a long sum", "float density(vec3 p) { return 0.", "+p.x*#.5", 30000, "", "", 0, ";}", NULL},
    {"a list of commas", "float density(vec3 p) { float a; ", "a=p.x,", 30000, "a=1.", "", 0, "; return a;}", NULL},
    {"many conditions", "float density(vec3 p) { float a=0.; ", "if(p.x>#.)a+=#.;\n", 12000, "return a", "", 0, ";}",
     NULL},
    {"many returns", BODY("for(int i=0;i<3000;i++){ if(p.x*float(i)>p.y) return float(i); } return 0.;"), "", 0, "", "",
     0, "", NULL},
    {"an endless loop", BODY("for(;;) p.x += 1.0; return p.x;"), "", 0, "", "", 0, "", "nothing bounds this loop"},
    {"an endless loop that may break", BODY("for(;;) { p.x += sin(p.y); if (p.x > 4.0) break; } return p.x;"), "", 0,
     "", "", 0, "", "nothing bounds this loop"},
    {"a loop of a billion", BODY("for(int i=0;i<1000000000;i++) p.x += 1.0; return p.x;"), "", 0, "", "", 0, "",
     "more than 16384 times"},
    {"a loop that stands still", BODY("for(float i=0.0;i<1.0;i+=1e-300) p.x += 1.0; return p.x;"), "", 0, "", "", 0, "",
     "more than 16384 times"},
    {"a loop up to nothing", BODY("for(float i=0.0/0.0;i!=1.0;i+=1.0) p.x += 1.0; return p.x;"), "", 0, "", "", 0, "",
     "more than 16384 times"},
    {"loops in loops", "float density(vec3 p) { ", "for(int i#=0;i#<2;i#++)", 200, "p.x+=1.", "", 0, "; return p.x;}",
     "steps to compile"},
    {"empty loops in loops", "float density(vec3 p) { ", "for(int i#=0;i#<16000;i#++)", 3, "", "", 0, "; return p.x;}",
     "steps to compile"},
    {"a million nodes",
     BODY("float a=p.x; for(int i=0;i<1000;i++) for(int j=0;j<1000;j++) a=sin(a+float(i*1000+j)); return a;"), "", 0,
     "", "", 0, "", "more than"},
    {"a hundred thousand live nodes",
     BODY("float a=p.x; for(int i=0;i<300;i++) for(int j=0;j<300;j++) a=sin(a+float(i*1000+j)); return a;"), "", 0, "",
     "", 0, "", "65536 different operations"},
    {"matrices without end",
     BODY("vec4 v=p.xxxx; for(int i=0;i<5000;i++){ mat4 m=mat4(v,v.wzyx,v+1.,v-1.); v=m*m*v; } return v.x;"), "", 0, "",
     "", 0, "", "more than"},
    {"a varying index in a loop", BODY("float a[64]; for(int j=0;j<10000;j++) a[int(p.x)]+=1.0; return a[int(p.y)];"),
     "", 0, "", "", 0, "", "more than"},
    {"copies of arrays", BODY("float a[1024]; float c[1024]; for(int i=0;i<16000;i++){ c=a; a=c; } return a[3];"), "",
     0, "", "", 0, "", "steps to compile"},
    {"recursion", "float f(float x) { return f(x); }\n" BODY("return f(p.x);"), "", 0, "", "", 0, "", "calls itself"},
    {"recursion by two",
     "float g(float x); float f(float x) { return g(x); }\nfloat g(float x) { return f(x); }\n" BODY("return f(p.x);"),
     "", 0, "", "", 0, "", "calls itself"},
    {"calls that double", "float f0(float x){return sin(x);}\n", "float f#(float x){return f~(x)+f~(x+1.);}\n", 61,
     BODY("return f60(p.x);"), "", 0, "", "steps to compile"},
    {"deep calls", "float f0(float x){return x;}\n", "float f#(float x){return f~(x);}\n", 200,
     BODY("return f199(p.x);"), "", 0, "", "nested deeper than 64"},
    {"a macro bomb", "#define A0 p.x+\n", "#define A# A~ A~ A~ A~\n", 40, BODY("return A39 1.;"), "", 0, "",
     "1000000 words"},
    {"an empty macro bomb", "#define A0\n", "#define A# A~ A~ A~ A~\n", 40, BODY("return A39 1.;"), "", 0, "",
     "1000000 words"},
    {"a macro bomb with arguments", "#define F0(x) x+x\n", "#define F#(x) F~(F~(x))\n", 20, BODY("return F19(p.x);"),
     "", 0, "", "1000000 words"},
    {"deep macro calls", "#define F(x) x\nfloat density(vec3 p) { return ", "F(", 300, "p.x", ")", 300, ";}",
     "nested deeper than 256"},
    {"a chain of macros", "", "#define M# M~\n", 20000, BODY("return M19999;"), "", 0, "", "no variable 'M0'"},
    {"macros of themselves", "#define f f f f\n#define g(x) g(x) g(g(x))\n" BODY("return g(f);"), "", 0, "", "", 0, "",
     "expected ')'"},
    {"a macro call that never ends", "#define F(x) x\n" BODY("return F((((;"), "", 0, "", "", 0, "", "never end"},
    {"deep #if", "", "#if 1\n", 1000, "", "", 0, DENSITY, "nested deeper than 256"},
    {"a deep condition", "#if ", "(", 90000, "1", ")", 90000, "\n#endif\n" DENSITY, "nested deeper than 256"},
    {"a long condition", "#if 1", "+1", 90000, "\n#endif\n" DENSITY, "", 0, "", NULL},
    {"#if 1/0", "#if 1/0\n#endif\n" DENSITY, "", 0, "", "", 0, "", "divides by zero"},
    {"the least / -1", "#if (0-0x7fffffff*0x7fffffff*8)/(0-1)\n#endif\n" DENSITY, "", 0, "", "", 0, "", NULL},
    {"two else", "#if 1\n#else\n#else\n#endif\n" DENSITY, "", 0, "", "", 0, "", "behind the #else"},
    {"an include", "#include <math.h>\n" DENSITY, "", 0, "", "", 0, "", "no #include"},
    {"a file of the system", "#line 5 \"/etc/passwd\"\n#pragma OPENCL EXTENSION all : enable\n" DENSITY, "", 0, "", "",
     0, "", NULL},
    {"huge constants", "float density(vec3 p) { return p.x*1e308*1e308+1e999-1e-999+", "9", 5000, ".0", "", 0, ";}",
     NULL},
    {"a small constant", "float density(vec3 p) { return 0.", "0", 100000, "1", "", 0, ";}", NULL},
    {"a huge exponent", "float density(vec3 p) { return 1e", "9", 100000, "", "", 0, ";}", NULL},
    {"a huge int", BODY("return float(99999999999999999999);"), "", 0, "", "", 0, "", "does not fit 32 bits"},
    {"divisions by zero", BODY("return 1.0/0.0 + p.x/0.0 + 0.0/0.0 + float(1/0) + float(1%0) + mod(p.x,0.0);"), "", 0,
     "", "", 0, "", NULL},
    {"the least int",
     BODY("int a=-2147483647-1; return float(a/-1)+float(a%-1)+float(a<<35)+float(a>>-1)+float(abs(a));"), "", 0, "",
     "", 0, "", NULL},
    {"infinite ints", BODY("return float(int(1.0/0.0))+float(uint(-1.0))+float(int(0.0/0.0))+float(int(p.x/0.0));"), "",
     0, "", "", 0, "", NULL},
    {"many globals", "", "float a#;", 60000, DENSITY, "", 0, "", "more than 4096 globals"},
    {"many functions", "", "float f#(float x){return x;}\n", 14000, DENSITY, "", 0, "", "more than 4096 functions"},
    {"many structs", "", "struct S#{float a;};\n", 2000, DENSITY, "", 0, "", "more than 256 structs"},
    {"many fields", "struct S{", "float a#;", 60000, "};" DENSITY, "", 0, "", "more than 256 fields"},
    {"many parameters", "float f(float b", ",float a#", 60000, "){return b;}" DENSITY, "", 0, "",
     "more than 64 parameters"},
    {"many arguments", "float f(float x){return x;}\nfloat density(vec3 p) { return f(1.", ",1.", 90000, "", "", 0,
     ");}", "64 arguments"},
    {"structs that double", "struct S0{float a; float b;};\n", "struct S#{S~ a; S~ b;};\n", 40,
     BODY("S39 s; return 0.;"), "", 0, "", "too large"},
    {"a struct of itself", "struct S{S s;};\n" DENSITY, "", 0, "", "", 0, "", "no type 'S'"},
    {"globals of each other", "float a = b; float b = a;\n" BODY("return a;"), "", 0, "", "", 0, "",
     "depends on itself"},
    {"a chain of globals", "float g0=1.;", "float g#=g~+1.;", 4000, BODY("return g3999;"), "", 0, "",
     "nested deeper than"},
    {"the same function twice", "float f(float x){return x;} float f(float x){return -x;}\n" BODY("return f(p.x);"), "",
     0, "", "", 0, "", "fit (float) equally well"},
    {"an array of a million", BODY("float a[1000000]; return 0.;"), "", 0, "", "", 0, "", "1 to 1024 elements"},
    {"an array of less than nothing", BODY("float a[-1]; return 0.;"), "", 0, "", "", 0, "", "1 to 1024 elements"},
    {"an array of varying size", BODY("float a[int(p.x)]; return 0.;"), "", 0, "", "", 0, "",
     "must not depend on the position"},
    {"names of OpenCL C",
     "float get_global_id(float x){return x;} float __kernel(float x){return x;}\nfloat barrier=1.0;\n" BODY(
         "float kernel = get_global_id(p.x); return kernel+__kernel(barrier);"),
     "", 0, "", "", 0, "", NULL},
    {"text that closes the function", BODY("return 0.; } } __kernel void evil(__global float *a) { a[9] = 1.0;"), "", 0,
     "", "", 0, "", "expected a function or a variable"},
    {"quotes", BODY("return \"}; evil();\";"), "", 0, "", "", 0, "", "no meaning"},
    {"a deep header", "/*", "{\"a\":", 3000, "1", "}", 3000, "*/" DENSITY, "maximum parsing depth"},
    {"a header of keys", "/*{\"z\":1", ",\"k#\":1", 50000, "}*/" DENSITY, "", 0, "", NULL},
    {"a header of parameters", "/*{\"params\":{\"z\":1", ",\"k#\":1", 1000, "}}*/" DENSITY, "", 0, "",
     "may have 64 parameters"},
    {"a header with a NUL", "/*{\"name\":\"a\\u0000b\"}*/" DENSITY, "", 0, "", "", 0, "", "not JSON"},
    {"a header beyond numbers", "/*{\"voxel\":1e999}*/" DENSITY, "", 0, "", "", 0, "", "not JSON"},
    {"a position that is none", "/*{\"camera\":{\"position\":[\"nan\",\"0x10\",\"\"]}}*/" DENSITY, "", 0, "", "", 0, "",
     "three decimals"},
    {"parameters called like functions",
     "/*{\"params\":{\"float\":1,\"density\":2,\"if\":4}}*/" BODY("return density+p.x;"), "", 0, "", "", 0, "", NULL},
    {"octaves of a parameter", "/*{\"params\":{\"n\":600}}*/" BODY("return fbm(p,int(n));"), "", 0, "", "", 0, "",
     "1 to 512"},
    {"too many octaves", BODY("return fbm(p,512)+fbm(p*2.,512);"), "", 0, "", "", 0, "", "more than 512 octaves"},
    {"octaves beyond all numbers", BODY("return fbm(p,400,1e30,1e30)+fbm(p,100,0./0.,-1./0.);"), "", 0, "", "", 0, "",
     NULL},
    {"as many noises as there is room",
     BODY("float a=0.; for(int i=0;i<16000;i++) a+=noise(p*float(i+1),i); return a;"), "", 0, "", "", 0, "",
     "different noises"},
    {"an argument that cannot be changed", "void f(inout float a){a=1.;}\n" BODY("f(p.x+1.); return p.x;"), "", 0, "",
     "", 0, "", "cannot be changed"},
    {"one argument twice", "void f(out float a, out float b){a=1.;b=2.;}\n" BODY("f(p.x,p.x); return p.x;"), "", 0, "",
     "", 0, "", NULL},
    {"nothing as a value", "void f(){}\n" BODY("return f();"), "", 0, "", "", 0, "", "gives no value"},
    {"an entry of another type", "struct A{float x;}; A density(vec3 p){A a;return a;}", "", 0, "", "", 0, "",
     "another result"},
    {"nothing but semicolons", "", ";", 190000, DENSITY, "", 0, "", NULL},
    {"an open comment", DENSITY "/*", " x", 1000, "", "", 0, "", "never ends"},
    {"a last backslash", DENSITY "\\", "", 0, "", "", 0, "", "no meaning"},
    {"white space", "", " \n\t\r\n", 10000, "", "", 0, "", "the file is empty"},
};

typedef struct {
    char *text;
    size_t length;
} built;

static void add(built *b, const char *text, size_t length)
{
    memcpy(b->text + b->length, text, length);
    b->length += length;
}

static void add_units(built *b, const char *unit, int count)
{
    for (int i = 0; i < count; i++)
        for (const char *c = unit; *c; c++) {
            char number[16];
            if (*c == '#' && strncmp(c, "#define", 7) && strncmp(c, "#if", 3))
                add(b, number, (size_t)sprintf(number, "%d", i + 1));
            else if (*c == '~')
                add(b, number, (size_t)sprintf(number, "%d", i));
            else
                add(b, c, 1);
        }
}

static double milliseconds(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t); /* others may have the machine */
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

/* Compiles; checks what holds for every text. */
static karst_program_graph *survive(const char *name, const char *text, size_t length, bool *ok)
{
    karst_error error = {0};
    const char *fault = NULL;
    double start = milliseconds();
    karst_program_graph *program = karst_language_compile("hostile", text, length, NULL, 0, ok, &error);
    double took = milliseconds() - start;
    assert_non_null(program);
    if (took > MOST_MS && !getenv("KARST_TEST_QUICK"))
        fail_msg("%s took %.0f ms", name, took);
    if (*ok) {
        if (!karst_graph_check(&program->graph, &fault) || !karst_graph_check(&program->resolved, &fault))
            fail_msg("%s: %s", name, fault);
        return program;
    }
    assert_int_equal(error.status, KARST_BAD_WORLD);
    const karst_diagnostic *last = program->diagnostics;
    assert_non_null(last);
    while (last->next)
        last = last->next;
    assert_true(last->is_error && last->line >= 1 && last->column >= 1);
    assert_true(strlen(last->text) < 2000);
    return program;
}

static const karst_diagnostic *last_of(const karst_program_graph *program)
{
    const karst_diagnostic *d = program->diagnostics;
    while (d && d->next)
        d = d->next;
    return d;
}

static void test_texts(void **s)
{
    (void)s;
    built b = {.text = malloc(8u << 20)};
    assert_non_null(b.text);
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        b.length = 0;
        add(&b, texts[i].head, strlen(texts[i].head));
        add_units(&b, texts[i].unit, texts[i].count);
        add(&b, texts[i].middle, strlen(texts[i].middle));
        add_units(&b, texts[i].unit2, texts[i].count2);
        add(&b, texts[i].tail, strlen(texts[i].tail));
        bool ok;
        karst_program_graph *program = survive(texts[i].name, b.text, b.length, &ok);
        if (ok != !texts[i].said)
            fail_msg("%s: %s", texts[i].name, ok ? "compiled" : last_of(program)->text);
        if (!ok && !strstr(last_of(program)->message, texts[i].said))
            fail_msg("%s: %s", texts[i].name, last_of(program)->text);
        karst_program_graph_destroy(program);
    }
    free(b.text);
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    if (!getenv("KARST_TEST_QUICK"))
        assert_true(usage.ru_maxrss / 1024 < MOST_MIB);
}

static void test_bytes(void **s)
{
    (void)s;
    static const struct {
        const char *text, *said;
        size_t length;
    } bad[] = {
#define BYTES(t, m) {t, m, sizeof(t) - 1}
        BYTES("float density(vec3 p) { return \0-p.y; }", "NUL byte"),
        BYTES("// h\xf6he\n" DENSITY, "not UTF-8 here (byte 0xf6)"),
        BYTES("// \xc0\xaf\n" DENSITY, "not UTF-8"),
        BYTES("// \xed\xa0\x80\n" DENSITY, "not UTF-8"),
        BYTES(DENSITY "// \xe2\x82", "not UTF-8"),
        BYTES("// \xf4\x90\x80\x80\n" DENSITY, "not UTF-8"),
        BYTES("", "the file is empty"),
        BYTES("\xef\xbb\xbf" DENSITY, NULL),
        BYTES("// \xe2\x82\xac h\xc3\xb6he\r\n" DENSITY, NULL)};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        bool ok;
        karst_program_graph *program = survive("bytes", bad[i].text, bad[i].length, &ok);
        assert_int_equal(ok, !bad[i].said);
        if (!ok)
            assert_non_null(strstr(last_of(program)->message, bad[i].said));
        karst_program_graph_destroy(program);
    }
}

/* Every beginning of a world, and every world with a byte changed: no crash, whatever it gives. */
static void test_mangled(void **s)
{
    (void)s;
    size_t length;
    char *text = read_text("tests/language/pasted/09_structs.karst", &length);
    int step = getenv("KARST_TEST_QUICK") ? 13 : 1;
    for (size_t i = 0; i < length; i += (size_t)step) {
        bool ok;
        karst_program_graph_destroy(survive("beginning", text, i, &ok));
        char kept = text[i];
        text[i] = "(){};,=.+x0\"#"[i % 13];
        karst_program_graph_destroy(survive("changed", text, length, &ok));
        text[i] = kept;
    }
    free(text);
}

static void test_files(void **s)
{
    (void)s;
    static const char *const paths[] = {"tests/language", "tests/language/no_such_file.karst", "/dev/zero"};
    for (size_t i = 0; i < sizeof paths / sizeof *paths; i++) {
        bool ok = true;
        karst_error error = {0};
        assert_null(karst_language_compile_file(paths[i], NULL, 0, &ok, &error));
        assert_false(ok);
        assert_int_equal(error.status, KARST_BAD_WORLD);
        assert_non_null(strstr(error.message, paths[i]));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_texts), cmocka_unit_test(test_bytes),
                                       cmocka_unit_test(test_mangled), cmocka_unit_test(test_files)};
    return cmocka_run_group_tests_name("hostile worlds", tests, NULL, NULL);
}
