/* Importing: each format gives the points that were written; garbage, ends, lies and NaN are refused at their place,
 * soon and with little memory; what is left out is counted; and the file does not depend on threads. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "core/files/point_source.h"
#include "core/points/points_file.h"
#include "tests/points/clouds.h"
#include "tests/support/ok.h"

static char folder[] = "/tmp/karst-import-XXXXXX";

static const char *in_folder(const char *name)
{
    static char paths[8][160];
    static int next;
    char *path = paths[next++ % 8];
    snprintf(path, sizeof paths[0], "%s/%s", folder, name);
    return path;
}

/* ---- bytes of each format ---- */

typedef struct {
    char bytes[1 << 20];
    size_t num;
} text;

static void say(text *t, const char *format, ...) __attribute__((format(printf, 2, 3)));
static void say(text *t, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    t->num += (size_t)vsnprintf(t->bytes + t->num, sizeof t->bytes - t->num, format, arguments);
    va_end(arguments);
}

static void put(text *t, const void *value, size_t size, bool is_big)
{
    const char *bytes = value;
    for (size_t i = 0; i < size; i++)
        t->bytes[t->num++] = bytes[is_big ? size - 1 - i : i];
}

#define NUM_POINTS 200
static karst_file_point given[NUM_POINTS];

static void make_points(void)
{
    random_state = 1;
    for (int i = 0; i < NUM_POINTS; i++) {
        double p[3], normal[3];
        random_on_surface(&known_surfaces[0], p, normal);
        for (int a = 0; a < 3; a++) {
            given[i].at[a] = rint(p[a] * 1000) / 1000 + 100 * a;
            given[i].normal[a] = (float)normal[a];
            given[i].rgb[a] = (uint8_t)random_below(256);
        }
    }
}

static void write_ply(text *t, const char *encoding)
{
    bool is_text = encoding[0] == 'a', is_big = strstr(encoding, "big") != NULL;
    say(t,
        "ply\nformat %s 1.0\ncomment a test\nelement face 2\nproperty list uchar int vertex_indices\n"
        "element vertex %d\nproperty uchar red\nproperty double x\nproperty double y\nproperty double z\n"
        "property list uint8 float32 extra\nproperty uchar green\nproperty uchar blue\nproperty float nx\n"
        "property float ny\nproperty float nz\nend_header\n",
        encoding, NUM_POINTS);
    for (int i = 0; i < 2; i++) {
        const uint8_t three = 3;
        const int32_t zero[3] = {0};
        if (is_text)
            say(t, "3 0 1 2\n");
        else {
            put(t, &three, 1, is_big);
            put(t, zero, sizeof zero, false);
        }
    }
    for (int i = 0; i < NUM_POINTS; i++) {
        const karst_file_point *p = &given[i];
        const uint8_t num_extra = 2;
        const float extra = 7;
        if (is_text) {
            say(t, "%d %.17g %.17g %.17g 2 7 7 %d %d %.9g %.9g %.9g\n", p->rgb[0], p->at[0], p->at[1], p->at[2],
                p->rgb[1], p->rgb[2], (double)p->normal[0], (double)p->normal[1], (double)p->normal[2]);
            continue;
        }
        put(t, &p->rgb[0], 1, is_big);
        for (int a = 0; a < 3; a++)
            put(t, &p->at[a], 8, is_big);
        put(t, &num_extra, 1, is_big);
        for (int k = 0; k < 2; k++)
            put(t, &extra, 4, is_big);
        put(t, &p->rgb[1], 2, false);
        for (int a = 0; a < 3; a++)
            put(t, &p->normal[a], 4, is_big);
    }
}

static void write_obj(text *t)
{
    say(t, "# a test\no ball\n");
    for (int i = 0; i < NUM_POINTS; i++)
        say(t, "v  %.17g %.17g\t%.17g %.9f %.9f %.9f\nvt 0 0\n", given[i].at[0], given[i].at[1], given[i].at[2],
            given[i].rgb[0] / 255.0, given[i].rgb[1] / 255.0, given[i].rgb[2] / 255.0);
    say(t, "vn 0 0 1\r\n");
}

static void write_xyz(text *t)
{
    say(t, "x,y,z,r,g,b,nx,ny,nz\n# a test\n");
    for (int i = 0; i < NUM_POINTS; i++)
        say(t, "%.17g, %.17g; %.17g %d %d %d %.9g %.9g %.9g\r\n", given[i].at[0], given[i].at[1], given[i].at[2],
            given[i].rgb[0], given[i].rgb[1], given[i].rgb[2], (double)given[i].normal[0], (double)given[i].normal[1],
            (double)given[i].normal[2]);
}

/* One point in ten more is withheld. */
static void write_las(text *t, uint8_t minor, uint8_t format, uint16_t extra)
{
    static const uint16_t lengths[] = {20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67},
                          colours[] = {0, 0, 20, 28, 0, 28, 0, 30, 30, 0, 30};
    const uint16_t head_bytes = minor >= 4 ? 375 : 227, record = (uint16_t)(lengths[format] + extra);
    const uint32_t num = NUM_POINTS + NUM_POINTS / 10, start = head_bytes + 54u;
    const uint64_t num64 = num;
    const double scale = 0.001, offset = -5;
    memset(t->bytes, 0, start);
    memcpy(t->bytes, "LASF", 4);
    t->bytes[24] = 1;
    t->bytes[25] = (char)minor;
    memcpy(t->bytes + 94, &head_bytes, 2);
    memcpy(t->bytes + 96, &start, 4);
    t->bytes[104] = (char)format;
    memcpy(t->bytes + 105, &record, 2);
    if (minor < 4)
        memcpy(t->bytes + 107, &num, 4);
    else
        memcpy(t->bytes + 247, &num64, 8);
    for (int a = 0; a < 3; a++) {
        memcpy(t->bytes + 131 + 8 * a, &scale, 8);
        memcpy(t->bytes + 155 + 8 * a, &offset, 8);
    }
    t->num = start;
    for (uint32_t i = 0; i < num; i++, t->num += record) {
        char *at = t->bytes + t->num;
        const karst_file_point *p = &given[i % NUM_POINTS];
        memset(at, 0, record);
        for (int a = 0; a < 3; a++) {
            int32_t whole = (int32_t)rint((p->at[a] - offset) / scale);
            uint16_t colour = (uint16_t)(p->rgb[a] << 8);
            memcpy(at + 4 * a, &whole, 4);
            if (colours[format])
                memcpy(at + colours[format] + 2 * a, &colour, 2);
        }
        if (i >= NUM_POINTS)
            at[15] = (char)(format < 6 ? 128 : 4);
    }
}

/* ---- reading ---- */

/* All that is read of bytes: how many points, and whether they are those given. */
static bool read_bytes(const text *t, karst_point_format format, bool *same, size_t *num, karst_error *error)
{
    FILE *file = t->num ? fmemopen((void *)(uintptr_t)t->bytes, t->num, "rb") : fopen("/dev/null", "rb");
    karst_point_source *source = karst_point_source_open(file, "bytes", format, error);
    karst_file_point points[7];
    bool done = source != NULL;
    *num = 0;
    *same = true;
    for (size_t got = 1; done && got;) {
        done = karst_point_source_read(source, points, 7, &got, error);
        for (size_t i = 0; done && i < got; i++, ++*num)
            for (int a = 0; a < 3; a++) {
                const karst_file_point *p = &given[*num % NUM_POINTS];
                *same = *same && fabs(points[i].at[a] - p->at[a]) < 1e-9;
                if (karst_point_source_has_colours(source))
                    *same = *same && points[i].rgb[a] == p->rgb[a];
                if (karst_point_source_has_normals(source))
                    *same = *same && fabs((double)points[i].normal[a] - (double)p->normal[a]) < 1e-6;
            }
    }
    karst_point_source_close(source);
    return done;
}

static void each_format_gives_the_points(void **state)
{
    (void)state;
    text *t = calloc(1, sizeof *t);
    bool same;
    size_t num;
    const char *const encodings[] = {"ascii", "binary_little_endian", "binary_big_endian"};
    for (int i = 0; i < 5; i++) {
        const karst_point_format formats[] = {KARST_POINTS_PLY, KARST_POINTS_PLY, KARST_POINTS_PLY, KARST_POINTS_OBJ,
                                              KARST_POINTS_XYZ};
        t->num = 0;
        if (i < 3)
            write_ply(t, encodings[i]);
        else if (i == 3)
            write_obj(t);
        else
            write_xyz(t);
        assert_ok(read_bytes(t, formats[i], &same, &num, &error));
        assert_int_equal(num, NUM_POINTS);
        assert_true(same);
    }
    for (uint8_t minor = 2; minor <= 4; minor++)
        for (uint8_t format = 0; format <= 10; format++) {
            t->num = 0;
            write_las(t, minor, format, format % 3);
            assert_ok(read_bytes(t, KARST_POINTS_LAS, &same, &num, &error));
            assert_int_equal(num, NUM_POINTS); /* without those withheld */
            assert_true(same);
        }
    free(t);
}

static void expect(const text *t, karst_point_format format, const char *what)
{
    karst_error why = {0};
    bool same;
    size_t num;
    assert_false(read_bytes(t, format, &same, &num, &why));
    assert_int_equal(why.status, KARST_BAD_DATA);
    if (strncmp(why.message, "bytes:", 6) != 0 || !strstr(why.message, what))
        fail_msg("%s, and not: %s", why.message, what);
}

static void lies_are_told_at_their_place(void **state)
{
    (void)state;
    static const struct {
        karst_point_format format;
        const char *bytes, *what;
    } bad[] = {
        {KARST_POINTS_PLY, "", "1: no PLY"},
        {KARST_POINTS_PLY, "solid\n", "1: no PLY"},
        {KARST_POINTS_PLY, "ply\nformat ascii 1.0\n", "3: the file ends"},
        {KARST_POINTS_PLY, "ply\nformat middle_endian 1.0\n", "2: \"middle_endian\""},
        {KARST_POINTS_PLY, "ply\nproperty float x\n", "2: a property before"},
        {KARST_POINTS_PLY, "ply\nelement vertex -3\n", "2: an element is"},
        {KARST_POINTS_PLY, "ply\nelement vertex 3\nproperty quad x\n", "3: \"quad\""},
        {KARST_POINTS_PLY, "ply\nelement vertex 3\nproperty list float int x\n", "3: \"float\""},
        {KARST_POINTS_PLY, "ply\nelement vertex 3\nproperty float x\nend_header\n", "4: no points"},
        {KARST_POINTS_PLY,
         "ply\nformat ascii 1.0\nelement vertex 99999999999\nproperty float x\nproperty float y\nproperty float z\n"
         "end_header\n1 2 3\n",
         "9: the file ends after 1 of 99999999999 points"},
        {KARST_POINTS_PLY,
         "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n"
         "end_header\n1 2 3\n1 two 3\n",
         "9: value 2 of 3"},
        {KARST_POINTS_PLY,
         "ply\nformat binary_little_endian 1.0\nelement vertex 7\nproperty float x\nproperty float y\n"
         "property float z\nend_header\n123456789012xyz",
         "byte 127: the file ends after 1 of 7 points"},
        {KARST_POINTS_OBJ, "v 1 2\n", "1: a vertex"},
        {KARST_POINTS_XYZ, "", "1: the file ends without"},
        {KARST_POINTS_XYZ, "x y z\nhello\n", "2: a point is"},
        {KARST_POINTS_XYZ, "1 2 3\n4 5\n", "2: 2 numbers"},
        {KARST_POINTS_LAS, "LASF", "byte 0: no LAS"},
    };
    text *t = calloc(1, sizeof *t);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        t->num = 0;
        say(t, "%s", bad[i].bytes);
        expect(t, bad[i].format, bad[i].what);
    }
    t->num = 100000; /* no end of a line, and a text that is none */
    memset(t->bytes, '7', t->num);
    expect(t, KARST_POINTS_XYZ, "1: a line of more than");
    memset(t->bytes, 0, 100);
    t->bytes[100] = '\n';
    expect(t, KARST_POINTS_OBJ, "1: a byte of zero");
    static const struct {
        size_t at;
        uint8_t value;
        const char *what;
    } changed[] = {{25, 9, "LAS 1.9"},          {104, 11, "format 11"},
                   {104, 128 + 2, "laszip"},    {105, 3, "records of"},
                   {94, 1, "a head of"},        {99, 1, "the file ends before its points"},
                   {96, 20, "within the head"}, {110, 9, "the file ends after 220 of"}};
    for (size_t i = 0; i < sizeof changed / sizeof *changed; i++) {
        t->num = 0;
        write_las(t, 2, 2, 0);
        t->bytes[changed[i].at] = (char)changed[i].value;
        if (changed[i].at == 96)
            t->bytes[97] = 0;
        expect(t, KARST_POINTS_LAS, changed[i].what);
    }
    free(t);
}

static void no_bytes_are_too_strange(void **state)
{
    (void)state;
    text *t = calloc(1, sizeof *t), *made = calloc(4, sizeof *made);
    const karst_point_format formats[] = {KARST_POINTS_PLY, KARST_POINTS_PLY, KARST_POINTS_XYZ, KARST_POINTS_LAS};
    write_ply(&made[0], "ascii");
    write_ply(&made[1], "binary_big_endian");
    write_xyz(&made[2]);
    write_las(&made[3], 4, 7, 0);
    random_state = 9;
    for (int i = 0; i < 4000; i++) {
        bool same;
        size_t num;
        karst_error why = {0};
        memcpy(t, &made[i % 4],
               sizeof made[0].num + (size_t)(made[i % 4].bytes - (char *)&made[i % 4]) + made[i % 4].num);
        t->num = made[i % 4].num;
        for (int k = 0; k < 3; k++)
            t->bytes[random_below(i % 8 < 4 ? 400 : (int64_t)t->num)] = (char)random_bits();
        if (i % 3 == 0)
            t->num = (size_t)random_below((int64_t)t->num);
        if (!read_bytes(t, formats[i % 4], &same, &num, &why))
            assert_int_equal(why.status, KARST_BAD_DATA);
    }
    free(t);
    free(made);
}

/* ---- importing ---- */

static bool import_xyz(const char *output, karst_points_about *about, uint32_t num_threads, karst_error *error)
{
    const karst_points_import_config config = {
        .input = in_folder("in.xyz"), .output = output, .num_threads = num_threads, .axes = KARST_POINTS_AS_THEY_ARE};
    return karst_points_import(&config, about, error);
}

/* Of a ball's points. */
static void normals_face_outwards(const char *path)
{
    karst_points_head head;
    int fd = karst_points_open(path, &head, NULL);
    karst_point *points = karst_points_load_level(fd, path, &head, 0, NULL);
    assert_non_null(points);
    for (uint64_t i = 0; i < head.levels[0].num; i++) {
        double out = 0, length = 0;
        for (int a = 0; a < 3; a++) {
            double at = points[i].at[a] * head.unit + head.centre[a];
            out += at * points[i].normal[a] / 32767;
            length += at * at;
        }
        assert_true(out > 0.9 && fabs(length - 1) < 1e-6 && !points[i].is_found);
    }
    close(fd);
    free(points);
}

static void what_is_left_out_is_counted(void **state)
{
    (void)state;
    FILE *file = fopen(in_folder("in.xyz"), "w");
    random_state = 2;
    for (int i = 0; i < 5000; i++) {
        double p[3], normal[3];
        random_on_surface(&known_surfaces[0], p, normal);
        for (int k = 0; k < (i < 10 ? 2 : 1); k++)
            fprintf(file, "%.17g %.17g %.17g\n", p[0], p[1], p[2]);
    }
    fprintf(file, "nan 0 0\n0 inf 0\n1e9 0 0\n0 -1e300 0\n3 3 3\n-4 0 1\n");
    fclose(file);
    karst_points_about about, read;
    assert_ok(import_xyz(in_folder("out.karstpoints"), &about, 1, &error));
    assert_int_equal(about.num_read, 5016);
    assert_int_equal(about.num_invalid, 3);
    assert_int_equal(about.num_far, 1);
    assert_int_equal(about.num_duplicates, 10);
    assert_int_equal(about.num_outliers, 2);
    assert_int_equal(about.num_points, 5000);
    assert_int_equal(about.num_parts, 1);
    assert_true(about.share_unsure < 0.001);
    assert_true(fabs(about.spacing / spacing_of(&known_surfaces[0], 5000) - 1) < 0.1);
    assert_ok(karst_points_describe(in_folder("out.karstpoints"), &read, &error));
    assert_memory_equal(&about, &read, sizeof about);
    normals_face_outwards(in_folder("out.karstpoints"));
}

/* Of every tenth point the file has no normal: it is found, and turned as those around. */
static void missing_normals_are_found(void **state)
{
    (void)state;
    FILE *file = fopen(in_folder("in.xyz"), "w");
    random_state = 3;
    for (int i = 0; i < 5000; i++) {
        double p[3], n[3];
        random_on_surface(&known_surfaces[0], p, n);
        for (int a = 0; a < 3; a++)
            n[a] *= i % 10 != 5;
        fprintf(file, "%.17g %.17g %.17g %.9g %.9g %.9g\n", p[0], p[1], p[2], n[0], n[1], n[2]);
    }
    fclose(file);
    karst_points_about about;
    assert_ok(import_xyz(in_folder("out.karstpoints"), &about, 1, &error));
    assert_true(about.has_given_normals);
    normals_face_outwards(in_folder("out.karstpoints"));
}

static char *bytes_of(const char *path, size_t *num)
{
    FILE *file = fopen(path, "rb");
    char *bytes = malloc(4 << 20);
    *num = file ? fread(bytes, 1, 4 << 20, file) : 0;
    if (file)
        fclose(file);
    return bytes;
}

static void threads_leave_no_trace(void **state)
{
    (void)state;
    size_t num_one, num_many;
    assert_ok(import_xyz(in_folder("out.karstpoints"), NULL, 1, &error));
    assert_ok(import_xyz(in_folder("many.karstpoints"), NULL, 4, &error));
    char *one = bytes_of(in_folder("out.karstpoints"), &num_one),
         *many = bytes_of(in_folder("many.karstpoints"), &num_many);
    assert_int_equal(num_one, num_many);
    assert_memory_equal(one, many, num_one);
    free(one);
    free(many);
}

static bool stop_soon(void *user, const char *what, double share)
{
    (void)what;
    (void)share;
    return --*(int *)user > 0;
}

/* Whenever an import ends early, the file that was there stays as it is, and nothing lies beside it. */
static void an_end_leaves_nothing(void **state)
{
    (void)state;
    size_t num_before, num_after;
    char *before = bytes_of(in_folder("out.karstpoints"), &num_before);
    for (int calls = 1; calls < 30; calls += 2) {
        int left = calls;
        karst_error why = {0};
        const karst_points_import_config config = {.input = in_folder("in.xyz"),
                                                   .output = in_folder("out.karstpoints"),
                                                   .progress = stop_soon,
                                                   .user = &left,
                                                   .num_threads = 1};
        if (karst_points_import(&config, NULL, &why))
            break;
        assert_int_equal(why.status, KARST_FAILED);
        assert_non_null(strstr(why.message, "stopped"));
        char *after = bytes_of(in_folder("out.karstpoints"), &num_after);
        assert_int_equal(num_before, num_after);
        assert_memory_equal(before, after, num_before);
        free(after);
    }
    free(before);
}

/* A cube whose faces go round outwards: what is found of its corners' normals are the means of three faces. */
static void faces_tell_normals(void **state)
{
    (void)state;
    text *t = calloc(1, sizeof *t);
    karst_file_point points[8];
    size_t num;
    for (int i = 0; i < 8; i++)
        say(t, "v %d %d %d\n", i & 1, i >> 1 & 1, i >> 2 & 1);
    say(t,
        "f 1 3 4 2\nf 5/1/1 6//2 8 7\nf -8 -7 -3 -4\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\nf 1 2 99\nf 1 2\nf\nf a b c\n");
    FILE *file = fmemopen(t->bytes, t->num, "rb");
    karst_point_source *source = karst_point_source_open(file, "bytes", KARST_POINTS_OBJ, NULL);
    assert_non_null(source);
    assert_true(karst_point_source_has_normals(source));
    assert_true(karst_point_source_read(source, points, 8, &num, NULL));
    assert_int_equal(num, 8);
    for (int i = 0; i < 8; i++)
        for (int a = 0; a < 3; a++) /* all outwards */
            assert_true(points[i].normal[a] * (2 * points[i].at[a] - 1) > 0);
    karst_point_source_close(source);
    free(t);
}

static void too_few_points_are_refused(void **state)
{
    (void)state;
    const char *const texts[] = {"1 2 3\n", "nan nan nan\nnan 1 1\n", "#\n"};
    for (int i = 0; i < 4; i++) {
        FILE *file = fopen(in_folder("in.xyz"), "w");
        for (int k = 0; k < (i == 3 ? 100 : 1); k++) /* at one place */
            fprintf(file, "%s", texts[i % 3]);
        fclose(file);
        karst_error why = {0};
        assert_false(import_xyz(in_folder("few.karstpoints"), NULL, 1, &why));
        assert_int_equal(why.status, KARST_BAD_DATA);
        assert_int_not_equal(access(in_folder("few.karstpoints"), F_OK), 0);
    }
}

static int set_up(void **state)
{
    (void)state;
    make_points();
    return mkdtemp(folder) ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    unlink(in_folder("in.xyz"));
    unlink(in_folder("out.karstpoints"));
    unlink(in_folder("many.karstpoints"));
    return rmdir(folder); /* nothing else is there */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_format_gives_the_points), cmocka_unit_test(lies_are_told_at_their_place),
        cmocka_unit_test(no_bytes_are_too_strange),     cmocka_unit_test(what_is_left_out_is_counted),
        cmocka_unit_test(missing_normals_are_found),    cmocka_unit_test(threads_leave_no_trace),
        cmocka_unit_test(an_end_leaves_nothing),        cmocka_unit_test(too_few_points_are_refused),
        cmocka_unit_test(faces_tell_normals),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
