/* Headless OpenGL through OSMesa: software rendering into memory, without any window system or device.
 * libOSMesa stays loaded until the process ends: drivers do not survive being unloaded. */
#include "core/display/display_platform.h"

#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* From GL/osmesa.h, which is not asked for at build time: it would bring an older OpenGL header along. */
enum {
    OSMESA_FORMAT = 0x22,
    OSMESA_DEPTH_BITS = 0x30,
    OSMESA_STENCIL_BITS = 0x31,
    OSMESA_ACCUM_BITS = 0x32,
    OSMESA_PROFILE = 0x33,
    OSMESA_CORE_PROFILE = 0x34,
    OSMESA_CONTEXT_MAJOR_VERSION = 0x36,
    OSMESA_CONTEXT_MINOR_VERSION = 0x37
};
typedef struct osmesa_context *OSMesaContext;
typedef void (*procedure)(void);

typedef struct {
    OSMesaContext (*CreateContextAttribs)(const int *attributes, OSMesaContext share);
    GLboolean (*MakeCurrent)(OSMesaContext context, void *buffer, GLenum type, GLsizei width, GLsizei height);
    OSMesaContext (*GetCurrentContext)(void);
    void (*DestroyContext)(OSMesaContext context);
    OSMesaContext context;
    uint32_t pixel; /* the default framebuffer, which nothing draws to */
} osmesa_native;

static const char *const LIBRARIES[] = {"libOSMesa.so.8", "libOSMesa.so.6"};
static const char MEND[] = "install libosmesa6, or use --display egl or none";

/* OSMesaGetProcAddress behind the signature that karst_gl_load takes, which has no room for the library it comes from.
 */
static _Thread_local procedure (*get_proc_address)(const char *name);
static void *get_proc(const char *name) { return (void *)get_proc_address(name); }

static bool load_library(osmesa_native *n, karst_error *error)
{
    void *library = NULL;
    for (size_t i = 0; i < sizeof LIBRARIES / sizeof LIBRARIES[0] && !library; i++)
        library = dlopen(LIBRARIES[i], RTLD_NOW | RTLD_LOCAL);
    if (!library)
        return karst_fail(error, KARST_NO_DEVICE, "no OSMesa (%s): %s", dlerror(), MEND);
    n->CreateContextAttribs =
        (OSMesaContext(*)(const int *, OSMesaContext))dlsym(library, "OSMesaCreateContextAttribs");
    n->MakeCurrent = (GLboolean(*)(OSMesaContext, void *, GLenum, GLsizei, GLsizei))dlsym(library, "OSMesaMakeCurrent");
    n->GetCurrentContext = (OSMesaContext(*)(void))dlsym(library, "OSMesaGetCurrentContext");
    n->DestroyContext = (void (*)(OSMesaContext))dlsym(library, "OSMesaDestroyContext");
    get_proc_address = (procedure(*)(const char *))dlsym(library, "OSMesaGetProcAddress");
    if (!n->CreateContextAttribs || !n->MakeCurrent || !n->GetCurrentContext || !n->DestroyContext || !get_proc_address)
        return karst_fail(error, KARST_NO_DEVICE, "OSMesa is too old to have an OpenGL 3.3 core context: %s", MEND);
    return true;
}

static bool bind(void *native, karst_error *error)
{
    osmesa_native *n = native;
    if (!n->MakeCurrent(n->context, &n->pixel, GL_UNSIGNED_BYTE, 1, 1))
        return karst_fail(error, KARST_FAILED, "OSMesa cannot make its context current");
    return true;
}

static bool is_bound(void *native)
{
    osmesa_native *n = native;
    return n->GetCurrentContext() == n->context;
}

static void unbind(void *native)
{
    osmesa_native *n = native;
    n->MakeCurrent(NULL, NULL, GL_UNSIGNED_BYTE, 0, 0);
}

static void close_osmesa(void *native)
{
    osmesa_native *n = native;
    if (n->context)
        n->DestroyContext(n->context);
    free(n);
}

static const karst_display_platform platform_osmesa = {
    .bind = bind, .is_bound = is_bound, .unbind = unbind, .close = close_osmesa};

bool karst_display_open_osmesa(karst_display *display, karst_error *error)
{
    static const int wish[] = {OSMESA_FORMAT,
                               GL_RGBA,
                               OSMESA_DEPTH_BITS,
                               0,
                               OSMESA_STENCIL_BITS,
                               0,
                               OSMESA_ACCUM_BITS,
                               0,
                               OSMESA_PROFILE,
                               OSMESA_CORE_PROFILE,
                               OSMESA_CONTEXT_MAJOR_VERSION,
                               3,
                               OSMESA_CONTEXT_MINOR_VERSION,
                               3,
                               0};
    osmesa_native *n = calloc(1, sizeof *n);
    if (!n)
        return karst_fail(error, KARST_FAILED, "out of memory for a display");
    if (!load_library(n, error)) {
        free(n);
        return false;
    }
    n->context = n->CreateContextAttribs(wish, NULL);
    karst_error reason = {0};
    if (!n->context)
        karst_fail(&reason, KARST_NO_DEVICE, "it has no OpenGL 3.3 core context");
    if (n->context && bind(n, &reason)) {
        if (karst_gl_load(&display->gl, get_proc, &reason)) {
            strcpy(display->description, "OSMesa");
            display->native = n;
            display->platform = &platform_osmesa;
            return true;
        }
        unbind(n);
    }
    close_osmesa(n);
    return karst_fail(error, KARST_NO_DEVICE, "no OSMesa display (%s): %s", reason.message, MEND);
}
