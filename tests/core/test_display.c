/* Displays and surfaces: a tiny kernel writes a pattern, and every way to OpenGL and back gives the same bytes. */
#include <dlfcn.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "core/device/context.h"
#include <CL/cl_gl.h>
#include "core/display/display_platform.h"
#include "core/display/surface.h"
#include "karst/display.h"

/* ---- libraries that can be hidden: the library's own calls of dlopen end up here ---- */
static const char *hidden[2];

void *dlopen(const char *name, int flags)
{
    static void *(*real)(const char *, int);
    if (!real)
        *(void **)&real = dlsym(RTLD_NEXT, "dlopen");
    for (int i = 0; i < 2; i++)
        if (name && hidden[i] && strstr(name, hidden[i]))
            return real("libnot-installed.so", flags);
    return real(name, flags);
}

/* ---- a stand-in for cl_khr_gl_sharing: an ordinary buffer, carried over by hand when it is released ---- */
static struct {
    const karst_gl *gl;
    size_t size_bytes;
    GLuint buffer;
    bool is_acquired;
    int num_acquired, num_released;
    cl_int fail_with;
} stand_in;

cl_mem clCreateFromGLBuffer(cl_context context, cl_mem_flags flags, cl_GLuint buffer, cl_int *code)
{
    if (stand_in.fail_with) {
        *code = stand_in.fail_with;
        return NULL;
    }
    stand_in.buffer = buffer;
    return clCreateBuffer(context, flags, stand_in.size_bytes, NULL, code);
}

cl_int clEnqueueAcquireGLObjects(cl_command_queue queue, cl_uint num_objects, const cl_mem *objects, cl_uint num_events,
                                 const cl_event *events, cl_event *event)
{
    (void)queue, (void)objects, (void)num_events, (void)events, (void)event;
    assert_int_equal(num_objects, 1);
    assert_false(stand_in.is_acquired);
    stand_in.is_acquired = true;
    stand_in.num_acquired++;
    return CL_SUCCESS;
}

cl_int clEnqueueReleaseGLObjects(cl_command_queue queue, cl_uint num_objects, const cl_mem *objects, cl_uint num_events,
                                 const cl_event *events, cl_event *event)
{
    (void)num_events, (void)events, (void)event;
    const karst_gl *gl = stand_in.gl;
    assert_int_equal(num_objects, 1);
    assert_true(stand_in.is_acquired);
    stand_in.is_acquired = false;
    stand_in.num_released++;
    gl->BindBuffer(GL_PIXEL_UNPACK_BUFFER, stand_in.buffer);
    void *mapped = gl->MapBufferRange(GL_PIXEL_UNPACK_BUFFER, 0, (GLsizeiptr)stand_in.size_bytes, GL_MAP_WRITE_BIT);
    assert_non_null(mapped);
    assert_int_equal(clEnqueueReadBuffer(queue, objects[0], CL_TRUE, 0, stand_in.size_bytes, mapped, 0, NULL, NULL),
                     CL_SUCCESS);
    gl->UnmapBuffer(GL_PIXEL_UNPACK_BUFFER);
    gl->BindBuffer(GL_PIXEL_UNPACK_BUFFER, 0);
    return CL_SUCCESS;
}

/* ---- the pattern: all values of all channels, alpha too ---- */
static const char pattern_source[] =
    "__kernel void pattern(__global uchar4 *pixels, int width, int height, int frame)\n"
    "{\n"
    "    int i = (int)get_global_id(0);\n"
    "    if (i >= width * height)\n"
    "        return;\n"
    "    int x = i % width, y = i / width;\n"
    "    pixels[i] = (uchar4)((uchar)(x + frame), (uchar)(y * 3 + 1), (uchar)(x ^ y), (uchar)(x * 5 + y));\n"
    "}\n";

static void pattern_pixel(int x, int y, int frame, uint8_t pixel[4])
{
    pixel[0] = (uint8_t)(x + frame);
    pixel[1] = (uint8_t)(y * 3 + 1);
    pixel[2] = (uint8_t)(x ^ y);
    pixel[3] = (uint8_t)(x * 5 + y);
}

static karst_context *context;
static karst_program *program;
static cl_kernel kernel;

static int open_device(void **state)
{
    (void)state;
    karst_error error = {0};
    const karst_virtual_file file = {"tests/pattern.cl", pattern_source};
    context = karst_context_create("cpu", 0, NULL, &error);
    program = context ? karst_program_build(context, "tests/pattern.cl", "", &file, 1, &error) : NULL;
    kernel = program ? karst_program_kernel(program, "pattern", &error) : NULL;
    if (!kernel)
        fprintf(stderr, "%s\n", error.message);
    return kernel ? 0 : -1;
}

static int close_device(void **state)
{
    (void)state;
    clReleaseKernel(kernel);
    karst_program_destroy(program);
    karst_context_destroy(context);
    return 0;
}

static int reset(void **state)
{
    (void)state;
    context->is_cpu = true;
    context->shares_gl = false;
    hidden[0] = hidden[1] = NULL;
    memset(&stand_in, 0, sizeof stand_in);
    assert_null(context->buffers); /* nothing of the test before is left in the account */
    return 0;
}

static karst_display *open_display(karst_display_kind kind)
{
    karst_error error = {0};
    karst_display *display = karst_display_create(kind, NULL, &error);
    if (!display)
        fail_msg("%s", error.message);
    return display;
}

static karst_surface *open_surface(karst_display *display, int width, int height)
{
    karst_error error = {0};
    karst_surface *surface = karst_surface_create(context, display, width, height, &error);
    if (!surface)
        fail_msg("%s", error.message);
    return surface;
}

static void draw(karst_surface *surface, int width, int height, int frame)
{
    karst_error error = {0};
    cl_mem pixels = karst_surface_begin(surface, &error);
    bool done = pixels &&
                KARST_ARGUMENTS(kernel, &error, KARST_VALUE_ARG(pixels), KARST_VALUE_ARG(width),
                                KARST_VALUE_ARG(height), KARST_VALUE_ARG(frame)) &&
                karst_launch(context, kernel, KARST_STAGE_SHADE, (size_t)width * (size_t)height, 64, &error);
    /* Every other one as the engine does it, with work behind the picture before anybody waits. */
    if (done && frame % 2)
        done = karst_surface_hand_over(surface, &error);
    if (!done || !karst_surface_end(surface, &error))
        fail_msg("%s", error.message);
}

static void check_read(karst_surface *surface, int width, int height, int frame)
{
    karst_error error = {0};
    size_t size = (size_t)width * (size_t)height * 4;
    uint8_t *rgba = malloc(size);
    assert_non_null(rgba);
    memset(rgba, 0xCD, size);
    if (!karst_surface_read(surface, rgba, size, &error))
        fail_msg("%s", error.message);
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            const uint8_t *got = rgba + ((size_t)y * (size_t)width + (size_t)x) * 4;
            uint8_t want[4];
            pattern_pixel(x, y, frame, want);
            if (memcmp(got, want, 4) != 0)
                fail_msg("%d x %d, frame %d, pixel %d, %d: %d %d %d %d, want %d %d %d %d", width, height, frame, x, y,
                         got[0], got[1], got[2], got[3], want[0], want[1], want[2], want[3]);
        }
    free(rgba);
}

static const int sizes[][2] = {{1, 1}, {7, 5}, {1280, 720}, {3, 1000}, {1001, 2}};
enum { NUM_SIZES = sizeof sizes / sizeof sizes[0] };

/* Sizes one after the other on one display (a resize), some frames each. */
static void check_display(karst_display *display, karst_surface_path path)
{
    for (int s = 0; s < NUM_SIZES; s++) {
        int width = sizes[s][0], height = sizes[s][1];
        stand_in.gl = &display->gl;
        stand_in.size_bytes = (size_t)width * (size_t)height * 4;
        karst_surface *surface = open_surface(display, width, height);
        assert_int_equal(karst_surface_get_path(surface), path);
        for (int frame = 0; frame < 4; frame++) {
            draw(surface, width, height, frame * 50);
            if (frame != 1) /* frames that nobody reads, too */
                check_read(surface, width, height, frame * 50);
        }
        check_read(surface, width, height, 150);
        karst_surface_destroy(surface);
    }
}

static void test_same_bytes_everywhere(void **state)
{
    (void)state;
    static const struct {
        karst_display_kind kind;
        karst_surface_path path;
    } cases[] = {{KARST_DISPLAY_EGL, KARST_SURFACE_MAPPED},
                 {KARST_DISPLAY_OSMESA, KARST_SURFACE_MAPPED},
                 {KARST_DISPLAY_NONE, KARST_SURFACE_PLAIN}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        karst_display *display = open_display(cases[i].kind);
        assert_int_equal(karst_display_get_kind(display), cases[i].kind);
        check_display(display, cases[i].path);
        karst_display_destroy(display);
    }
}

static void test_copied(void **state)
{
    (void)state;
    context->is_cpu = false;
    for (int kind = KARST_DISPLAY_EGL; kind <= KARST_DISPLAY_OSMESA; kind++) {
        karst_display *display = open_display((karst_display_kind)kind);
        check_display(display, KARST_SURFACE_COPIED);
        karst_display_destroy(display);
    }
}

static void test_shared_by_a_stand_in(void **state)
{
    (void)state;
    context->is_cpu = false;
    context->shares_gl = true;
    karst_display *display = open_display(KARST_DISPLAY_EGL);
    check_display(display, KARST_SURFACE_SHARED);
    assert_int_equal(stand_in.num_acquired, 4 * NUM_SIZES);
    assert_int_equal(stand_in.num_released, 4 * NUM_SIZES);
    /* A device that refuses after all. */
    stand_in.fail_with = CL_INVALID_GL_OBJECT;
    check_display(display, KARST_SURFACE_COPIED);
    karst_display_destroy(display);
}

/* PoCL has no sharing: whatever is asked for, the context is an ordinary one and works. */
static void test_context_without_sharing(void **state)
{
    (void)state;
    cl_context_properties properties[KARST_SHARING_PROPERTIES] = {0};
    karst_display *egl = open_display(KARST_DISPLAY_EGL), *none = open_display(KARST_DISPLAY_NONE),
                  *osmesa = open_display(KARST_DISPLAY_OSMESA);
    assert_false(karst_display_sharing(none, properties));
    assert_false(karst_display_sharing(osmesa, properties));
    assert_true(karst_display_sharing(egl, properties));
    assert_int_equal(properties[0], CL_GL_CONTEXT_KHR);
    assert_true(properties[1] != 0);
    assert_int_equal(properties[2], CL_EGL_DISPLAY_KHR);
    assert_true(properties[3] != 0);
    assert_int_equal(properties[4], 0);
    karst_error error = {0};
    karst_context *other = karst_context_create_sharing("cpu", 0, properties, NULL, &error);
    if (!other)
        fail_msg("%s", error.message);
    if (!other->has_gl_sharing)
        assert_false(other->shares_gl);
    karst_context_destroy(other);
    karst_display_destroy(osmesa);
    karst_display_destroy(none);
    karst_display_destroy(egl);
}

/* Four displays in one thread, drawn in turns: no call may reach another one's context. */
static void test_displays_in_turns(void **state)
{
    (void)state;
    static const karst_display_kind kinds[] = {KARST_DISPLAY_EGL, KARST_DISPLAY_OSMESA, KARST_DISPLAY_EGL,
                                               KARST_DISPLAY_NONE};
    karst_display *displays[4];
    karst_surface *surfaces[4];
    for (int i = 0; i < 4; i++) {
        displays[i] = open_display(kinds[i]);
        surfaces[i] = open_surface(displays[i], 31 + i, 17);
    }
    for (int frame = 0; frame < 3; frame++) {
        for (int i = 0; i < 4; i++)
            draw(surfaces[i], 31 + i, 17, 10 * frame + i);
        for (int i = 3; i >= 0; i--)
            check_read(surfaces[i], 31 + i, 17, 10 * frame + i);
    }
    /* One goes; the others stay whole. */
    karst_surface_destroy(surfaces[0]);
    karst_display_destroy(displays[0]);
    for (int i = 1; i < 4; i++) {
        check_read(surfaces[i], 31 + i, 17, 20 + i);
        karst_surface_destroy(surfaces[i]);
        karst_display_destroy(displays[i]);
    }
}

static void test_names(void **state)
{
    (void)state;
    for (int kind = KARST_DISPLAY_AUTO; kind <= KARST_DISPLAY_NONE; kind++) {
        karst_display_kind back = KARST_DISPLAY_WINDOW;
        assert_true(karst_display_kind_parse(karst_display_kind_name((karst_display_kind)kind), &back, NULL));
        assert_int_equal(back, kind);
    }
    assert_string_equal(karst_display_kind_name(KARST_DISPLAY_WINDOW), "window");
    karst_display_kind kind = KARST_DISPLAY_OSMESA;
    const char *const wrong[] = {"window", "", "EGL", "x11"};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        karst_error error = {0};
        assert_false(karst_display_kind_parse(wrong[i], &kind, &error));
        assert_int_equal(error.status, KARST_USAGE);
        assert_non_null(strstr(error.message, "auto, egl, osmesa or none"));
    }
    assert_int_equal(kind, KARST_DISPLAY_OSMESA);
    karst_display *display = open_display(KARST_DISPLAY_EGL);
    assert_non_null(strstr(karst_display_description(display), "EGL 1."));
    assert_non_null(strstr(karst_display_description(display), ", OpenGL "));
    karst_display_destroy(display);
    display = open_display(KARST_DISPLAY_NONE);
    assert_string_equal(karst_display_description(display), "none");
    karst_display_destroy(display);
    karst_display_destroy(NULL);
    karst_surface_destroy(NULL);
}

/* ---- what is missing is named, with its package ---- */

static void assert_no_display(karst_display_kind kind, const char *package, const char *instead)
{
    karst_error error = {0};
    assert_null(karst_display_create(kind, NULL, &error));
    assert_int_equal(error.status, KARST_NO_DEVICE);
    if (!strstr(error.message, package) || !strstr(error.message, instead) || strchr(error.message, '\n'))
        fail_msg("%s", error.message);
}

static char heard[4096];
static void hear(void *user, karst_log_level level, const char *line)
{
    (void)user, (void)level;
    strncat(heard, line, sizeof heard - strlen(heard) - 2);
    strcat(heard, "\n");
}

static void test_missing_libraries(void **state)
{
    (void)state;
    const karst_log log = {.write = hear, .max_level = KARST_LOG_INFO};
    hidden[0] = "libEGL";
    assert_no_display(KARST_DISPLAY_EGL, "libegl-mesa0", "--display osmesa");
    heard[0] = '\0';
    karst_display *display = karst_display_create(KARST_DISPLAY_AUTO, &log, NULL);
    assert_int_equal(karst_display_get_kind(display), KARST_DISPLAY_OSMESA);
    assert_non_null(strstr(heard, "going on with osmesa"));
    karst_display_destroy(display);

    hidden[1] = "libOSMesa";
    assert_no_display(KARST_DISPLAY_OSMESA, "libosmesa6", "--display egl");
    heard[0] = '\0';
    display = karst_display_create(KARST_DISPLAY_AUTO, &log, NULL);
    assert_int_equal(karst_display_get_kind(display), KARST_DISPLAY_NONE);
    assert_non_null(strstr(heard, "going on with osmesa"));
    assert_non_null(strstr(heard, "going on with none"));
    check_display(display, KARST_SURFACE_PLAIN);
    karst_display_destroy(display);

    hidden[0] = hidden[1] = NULL;
    display = karst_display_create(KARST_DISPLAY_AUTO, NULL, NULL);
    assert_int_equal(karst_display_get_kind(display), KARST_DISPLAY_EGL);
    karst_display_destroy(display);
}

/* ---- misuse ---- */

static void test_misuse(void **state)
{
    (void)state;
    karst_error error = {0};
    assert_null(karst_display_create(KARST_DISPLAY_WINDOW, NULL, &error));
    assert_int_equal(error.status, KARST_USAGE);
    for (int kind = KARST_DISPLAY_EGL; kind <= KARST_DISPLAY_NONE; kind++) {
        karst_display *display = open_display((karst_display_kind)kind);
        const int wrong[][2] = {{0, 0}, {-1, 5}, {5, 0}, {1 << 20, 1}};
        for (int i = 0; i < (kind == KARST_DISPLAY_NONE ? 3 : 4); i++) {
            memset(&error, 0, sizeof error);
            assert_null(karst_surface_create(context, display, wrong[i][0], wrong[i][1], &error));
            assert_int_equal(error.status, KARST_USAGE);
        }
        karst_surface *surface = open_surface(display, 8, 8);
        uint8_t rgba[8 * 8 * 4 + 1];
        memset(&error, 0, sizeof error);
        assert_false(karst_surface_end(surface, &error));
        assert_int_equal(error.status, KARST_FAILED);
        assert_non_null(karst_surface_begin(surface, NULL));
        assert_null(karst_surface_begin(surface, NULL));
        assert_false(karst_surface_read(surface, rgba, sizeof rgba - 1, NULL));
        assert_true(karst_surface_end(surface, NULL));
        assert_false(karst_surface_read(surface, rgba, sizeof rgba, NULL));
        assert_true(karst_surface_read(surface, rgba, sizeof rgba - 1, NULL));
        draw(surface, 8, 8, 3);
        check_read(surface, 8, 8, 3);
        draw(surface, 8, 8, 4); /* nobody reads this one */
        draw(surface, 8, 8, 5);
        check_read(surface, 8, 8, 5);
        check_read(surface, 8, 8, 5);
        assert_false(karst_surface_hand_over(surface, NULL));
        assert_non_null(karst_surface_begin(surface, NULL));
        assert_true(karst_surface_hand_over(surface, NULL));
        assert_false(karst_surface_hand_over(surface, NULL));
        karst_surface_destroy(surface); /* between begin and end */
        karst_display_destroy(display);
    }
}

static size_t memory_bytes(const char *name)
{
    karst_stats stats;
    karst_context_memory(context, &stats);
    for (size_t i = 0; i < stats.num_memory; i++)
        if (strcmp(stats.memory[i].name, name) == 0)
            return stats.memory[i].size_bytes;
    return 0;
}

static void test_account_and_time(void **state)
{
    (void)state;
    const size_t picture = 640 * 480 * 4;
    karst_display *display = open_display(KARST_DISPLAY_EGL);
    karst_surface *surface = open_surface(display, 640, 480);
    assert_int_equal(memory_bytes("display"), 2 * picture);
    assert_int_equal(memory_bytes("pixels"), 0);
    uint64_t ns[KARST_NUM_STAGES] = {0};
    assert_true(karst_profile_collect(context, ns, NULL));
    memset(ns, 0, sizeof ns);
    draw(surface, 640, 480, 0);
    assert_true(karst_profile_collect(context, ns, NULL));
    assert_true(ns[KARST_STAGE_DISPLAY] > 0 && ns[KARST_STAGE_SHADE] > 0);
    karst_surface_destroy(surface);
    assert_int_equal(memory_bytes("display"), 0);
    context->is_cpu = false;
    surface = open_surface(display, 640, 480);
    assert_int_equal(memory_bytes("display"), 2 * picture);
    assert_int_equal(memory_bytes("pixels"), picture);
    karst_surface_destroy(surface);
    karst_display_destroy(display);
    assert_null(context->buffers);
}

/* ---- a window: an OSMesa context of the test's own, whose framebuffer 0 is memory ---- */

typedef void *(*osmesa_create)(const int *attributes, void *share);
typedef GLboolean (*osmesa_make_current)(void *osmesa, void *buffer, GLenum type, GLsizei width, GLsizei height);
typedef void (*osmesa_destroy)(void *osmesa);
static void (*(*osmesa_get_proc)(const char *name))(void);
static void *window_get_proc(const char *name) { return (void *)osmesa_get_proc(name); }
static void *no_get_proc(const char *name)
{
    (void)name;
    return NULL;
}

/* Top row first, as a window shows it: OSMesa's memory begins at the bottom. */
static const uint8_t *window_pixel(const uint8_t *memory, int width, int height, int x, int y)
{
    return memory + ((size_t)(height - 1 - y) * (size_t)width + (size_t)x) * 4;
}

static void test_window(void **state)
{
    (void)state;
    enum { WIDTH = 37, HEIGHT = 23 };
    static const int wish[] = {
        0x22 /* format */, GL_RGBA, 0x33 /* profile */, 0x34 /* core */, 0x36 /* major */, 3, 0x37 /* minor */, 3, 0};
    void *library = dlopen("libOSMesa.so.8", RTLD_NOW);
    assert_non_null(library);
    osmesa_create create = (osmesa_create)dlsym(library, "OSMesaCreateContextAttribs");
    osmesa_make_current make_current = (osmesa_make_current)dlsym(library, "OSMesaMakeCurrent");
    osmesa_destroy destroy = (osmesa_destroy)dlsym(library, "OSMesaDestroyContext");
    *(void **)&osmesa_get_proc = dlsym(library, "OSMesaGetProcAddress");
    void *window = create(wish, NULL);
    assert_non_null(window);
    static uint8_t memory[WIDTH * HEIGHT * 4];
    assert_true(make_current(window, memory, GL_UNSIGNED_BYTE, WIDTH, HEIGHT));

    karst_error error = {0};
    assert_null(karst_display_create_in_context(no_get_proc, NULL, &error));
    assert_int_equal(error.status, KARST_NO_DEVICE);
    karst_display *display = karst_display_create_in_context(window_get_proc, NULL, NULL);
    assert_non_null(display);
    assert_int_equal(karst_display_get_kind(display), KARST_DISPLAY_WINDOW);
    assert_non_null(strstr(karst_display_description(display), "window, OpenGL "));
    const karst_gl *gl = &display->gl;

    /* Pixel by pixel, right way up, also with the owner's state in the way. */
    karst_surface *surface = open_surface(display, WIDTH, HEIGHT);
    assert_int_equal(karst_surface_get_path(surface), KARST_SURFACE_MAPPED);
    gl->PixelStorei(GL_UNPACK_ROW_LENGTH, 99);
    gl->PixelStorei(GL_UNPACK_ALIGNMENT, 8);
    gl->PixelStorei(GL_UNPACK_SKIP_ROWS, 2);
    gl->PixelStorei(GL_PACK_ROW_LENGTH, 99);
    void (*enable)(GLenum) = (void (*)(GLenum))window_get_proc("glEnable");
    enable(GL_SCISSOR_TEST);
    enable(GL_FRAMEBUFFER_SRGB);
    draw(surface, WIDTH, HEIGHT, 9);
    gl->Finish();
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            uint8_t want[4];
            pattern_pixel(x, y, 9, want);
            const uint8_t *got = window_pixel(memory, WIDTH, HEIGHT, x, y);
            if (memcmp(got, want, 4) != 0)
                fail_msg("window pixel %d, %d: %d %d %d %d", x, y, got[0], got[1], got[2], got[3]);
        }
    check_read(surface, WIDTH, HEIGHT, 9);
    karst_surface_destroy(surface);

    /* Stretched over the viewport: a picture of one pixel fills it, and nothing else: around it the last frame stays.
     */
    surface = open_surface(display, 1, 1);
    void (*viewport)(GLint, GLint, GLsizei, GLsizei) =
        (void (*)(GLint, GLint, GLsizei, GLsizei))window_get_proc("glViewport");
    viewport(4, 3, 10, 5); /* from the bottom */
    draw(surface, 1, 1, 77);
    gl->Finish();
    uint8_t want[4];
    pattern_pixel(0, 0, 77, want);
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            bool inside = x >= 4 && x < 14 && y >= HEIGHT - 8 && y < HEIGHT - 3;
            uint8_t outside[4];
            pattern_pixel(x, y, 9, outside);
            assert_memory_equal(window_pixel(memory, WIDTH, HEIGHT, x, y), inside ? want : outside, 4);
        }
    check_read(surface, 1, 1, 77);
    karst_surface_destroy(surface);
    cl_context_properties properties[KARST_SHARING_PROPERTIES];
    assert_false(karst_display_sharing(display, properties));
    karst_display_destroy(display);
    make_current(NULL, NULL, GL_UNSIGNED_BYTE, 0, 0);
    destroy(window);
    dlclose(library);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(test_names, reset),
        cmocka_unit_test_setup(test_same_bytes_everywhere, reset),
        cmocka_unit_test_setup(test_copied, reset),
        cmocka_unit_test_setup(test_shared_by_a_stand_in, reset),
        cmocka_unit_test_setup(test_context_without_sharing, reset),
        cmocka_unit_test_setup(test_displays_in_turns, reset),
        cmocka_unit_test_setup(test_missing_libraries, reset),
        cmocka_unit_test_setup(test_misuse, reset),
        cmocka_unit_test_setup(test_account_and_time, reset),
        cmocka_unit_test_setup(test_window, reset),
    };
    size_t num_devices = 0;
    karst_device_info *devices = karst_context_list(&num_devices, NULL);
    bool has_cpu = false;
    for (size_t i = 0; i < num_devices; i++)
        has_cpu |= devices[i].is_cpu;
    free(devices);
    if (num_devices > 0 && !has_cpu) {
        puts("1..0 # SKIP it is made for a device whose memory is the host's, and there is no CPU device");
        return 0;
    }
    return cmocka_run_group_tests_name("display", tests, open_device, close_device);
}
