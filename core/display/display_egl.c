/* Headless OpenGL through EGL: Mesa's surfaceless platform, else the first device that a vendor's driver offers.
 *
 * libEGL stays loaded, and an EGLDisplay stays initialised, until the process ends: eglTerminate is not counted and
 * would take the contexts of every other user of the same EGLDisplay along, and drivers do not survive being unloaded.
 */
#include "core/display/display_platform.h"

#include <CL/cl_gl.h>
#include <dlfcn.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define EGL_NO_X11
#include <EGL/egl.h>
#include <EGL/eglext.h>

#define EGL_FUNCTIONS(X)                                    \
    X(PFNEGLBINDAPIPROC, BindAPI)                           \
    X(PFNEGLCHOOSECONFIGPROC, ChooseConfig)                 \
    X(PFNEGLCREATECONTEXTPROC, CreateContext)               \
    X(PFNEGLCREATEPBUFFERSURFACEPROC, CreatePbufferSurface) \
    X(PFNEGLDESTROYCONTEXTPROC, DestroyContext)             \
    X(PFNEGLDESTROYSURFACEPROC, DestroySurface)             \
    X(PFNEGLGETCURRENTCONTEXTPROC, GetCurrentContext)       \
    X(PFNEGLGETCURRENTDISPLAYPROC, GetCurrentDisplay)       \
    X(PFNEGLGETERRORPROC, GetError)                         \
    X(PFNEGLGETPROCADDRESSPROC, GetProcAddress)             \
    X(PFNEGLINITIALIZEPROC, Initialize)                     \
    X(PFNEGLMAKECURRENTPROC, MakeCurrent)                   \
    X(PFNEGLQUERYSTRINGPROC, QueryString)

typedef struct {
#define MEMBER(type, name) type name;
    EGL_FUNCTIONS(MEMBER)
#undef MEMBER
} egl_functions;

typedef struct {
    egl_functions egl;
    EGLDisplay display;
    EGLContext context;
    EGLSurface surface; /* EGL_NO_SURFACE where the driver can do without */
} egl_native;

enum { MAX_DEVICES = 16 };
static const char MEND[] = "install libegl1, libegl-mesa0 and libgl1-mesa-dri, or use --display osmesa or none";

static const char *error_name(EGLint code)
{
    static const char *const names[] = {"EGL_SUCCESS",       "EGL_NOT_INITIALIZED",     "EGL_BAD_ACCESS",
                                        "EGL_BAD_ALLOC",     "EGL_BAD_ATTRIBUTE",       "EGL_BAD_CONFIG",
                                        "EGL_BAD_CONTEXT",   "EGL_BAD_CURRENT_SURFACE", "EGL_BAD_DISPLAY",
                                        "EGL_BAD_MATCH",     "EGL_BAD_NATIVE_PIXMAP",   "EGL_BAD_NATIVE_WINDOW",
                                        "EGL_BAD_PARAMETER", "EGL_BAD_SURFACE"};
    int index = code - EGL_SUCCESS;
    return index >= 0 && index < (int)(sizeof names / sizeof names[0]) ? names[index] : "an unknown EGL error";
}

static bool load_library(egl_functions *egl, karst_error *error)
{
    void *library = dlopen("libEGL.so.1", RTLD_NOW | RTLD_LOCAL);
    if (!library)
        return karst_fail(error, KARST_NO_DEVICE, "no EGL (%s): %s", dlerror(), MEND);
#define LOAD(type, name)                           \
    egl->name = (type)dlsym(library, "egl" #name); \
    if (!egl->name)                                \
        return karst_fail(error, KARST_NO_DEVICE, "libEGL.so.1 lacks egl" #name ": %s", MEND);
    EGL_FUNCTIONS(LOAD)
#undef LOAD
    return true;
}

/* Whether `name` is a word of a list of extensions, which may be NULL. */
static bool lists(const char *extensions, const char *name)
{
    size_t length = strlen(name);
    for (const char *at = extensions; at && (at = strstr(at, name)); at += length)
        if ((at == extensions || at[-1] == ' ') && (at[length] == ' ' || at[length] == '\0'))
            return true;
    return false;
}

/* eglGetPlatformDisplay is in EGL 1.5, its EXT form in the extension that every platform needs; libraries have one or
 * both. */
static EGLDisplay platform_display(const egl_functions *egl, EGLenum platform, void *device)
{
    PFNEGLGETPLATFORMDISPLAYEXTPROC get_ext =
        (PFNEGLGETPLATFORMDISPLAYEXTPROC)egl->GetProcAddress("eglGetPlatformDisplayEXT");
    if (get_ext)
        return get_ext(platform, device, NULL);
    PFNEGLGETPLATFORMDISPLAYPROC get = (PFNEGLGETPLATFORMDISPLAYPROC)egl->GetProcAddress("eglGetPlatformDisplay");
    return get ? get(platform, device, NULL) : EGL_NO_DISPLAY;
}

static void unbind(void *native)
{
    egl_native *n = native;
    n->egl.BindAPI(EGL_OPENGL_API);
    n->egl.MakeCurrent(n->display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
}

static bool bind(void *native, karst_error *error)
{
    egl_native *n = native;
    n->egl.BindAPI(EGL_OPENGL_API); /* the API is a thread's own setting */
    if (!n->egl.MakeCurrent(n->display, n->surface, n->surface, n->context))
        return karst_fail(error, KARST_FAILED, "EGL cannot make its context current: %s",
                          error_name(n->egl.GetError()));
    return true;
}

static bool is_bound(void *native)
{
    egl_native *n = native;
    n->egl.BindAPI(EGL_OPENGL_API);
    return n->egl.GetCurrentContext() == n->context;
}

static void release(egl_native *n)
{
    if (n->surface != EGL_NO_SURFACE)
        n->egl.DestroySurface(n->display, n->surface);
    if (n->context != EGL_NO_CONTEXT)
        n->egl.DestroyContext(n->display, n->context);
    n->surface = EGL_NO_SURFACE;
    n->context = EGL_NO_CONTEXT;
}

static void close_egl(void *native)
{
    release(native);
    free(native);
}

static const karst_display_platform platform_egl = {
    .bind = bind, .is_bound = is_bound, .unbind = unbind, .close = close_egl};

/* A context on an EGLDisplay, made current; drawing goes to framebuffer objects, so a surface is only for drivers that
 * insist. */
static bool open_context(egl_native *n, EGLint *major, EGLint *minor, karst_error *error)
{
    static const EGLint config_wish[] = {EGL_SURFACE_TYPE, EGL_PBUFFER_BIT, EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT,
                                         EGL_NONE};
    static const EGLint context_wish[] = {
        EGL_CONTEXT_MAJOR_VERSION,           3,       EGL_CONTEXT_MINOR_VERSION, 3, EGL_CONTEXT_OPENGL_PROFILE_MASK,
        EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT, EGL_NONE};
    static const EGLint surface_wish[] = {EGL_WIDTH, 1, EGL_HEIGHT, 1, EGL_NONE};
    if (!n->egl.Initialize(n->display, major, minor))
        return karst_fail(error, KARST_NO_DEVICE, "it does not initialise: %s", error_name(n->egl.GetError()));
    if (!n->egl.BindAPI(EGL_OPENGL_API))
        return karst_fail(error, KARST_NO_DEVICE, "it has no desktop OpenGL: %s", error_name(n->egl.GetError()));
    EGLConfig config = NULL;
    EGLint num_configs = 0;
    if (!n->egl.ChooseConfig(n->display, config_wish, &config, 1, &num_configs) || num_configs < 1) {
        if (!lists(n->egl.QueryString(n->display, EGL_EXTENSIONS), "EGL_KHR_no_config_context"))
            return karst_fail(error, KARST_NO_DEVICE, "it has no configuration for OpenGL");
        config = EGL_NO_CONFIG_KHR;
    }
    n->context = n->egl.CreateContext(n->display, config, EGL_NO_CONTEXT, context_wish);
    if (n->context == EGL_NO_CONTEXT)
        return karst_fail(error, KARST_NO_DEVICE, "it has no OpenGL 3.3 core context: %s",
                          error_name(n->egl.GetError()));
    if (n->egl.MakeCurrent(n->display, EGL_NO_SURFACE, EGL_NO_SURFACE, n->context))
        return true;
    EGLint reason = n->egl.GetError();
    if (config != EGL_NO_CONFIG_KHR)
        n->surface = n->egl.CreatePbufferSurface(n->display, config, surface_wish);
    if (n->surface != EGL_NO_SURFACE && n->egl.MakeCurrent(n->display, n->surface, n->surface, n->context))
        return true;
    return karst_fail(error, KARST_NO_DEVICE, "its context cannot be made current: %s", error_name(reason));
}

/* eglGetProcAddress behind the signature that karst_gl_load takes, which has no room for the library it comes from. */
static _Thread_local PFNEGLGETPROCADDRESSPROC get_proc_address;
static void *get_proc(const char *name) { return (void *)get_proc_address(name); }

/* One way to get an EGLDisplay, by its name; joins the reason for a failure to `reasons`. */
static bool try_display(karst_display *display, egl_native *n, EGLDisplay candidate, const char *name, char *reasons,
                        size_t size_bytes)
{
    karst_error reason = {0};
    EGLint major = 0, minor = 0;
    n->display = candidate;
    if (candidate == EGL_NO_DISPLAY) {
        karst_fail(&reason, KARST_NO_DEVICE, "no driver offers it");
    } else if (open_context(n, &major, &minor, &reason) && karst_gl_load(&display->gl, get_proc, &reason)) {
        snprintf(display->description, sizeof display->description, "EGL %d.%d %s", major, minor, name);
        return true;
    } else {
        if (n->context != EGL_NO_CONTEXT)
            unbind(n);
        release(n);
    }
    size_t length = strlen(reasons);
    snprintf(reasons + length, size_bytes - length, "%s%s: %s", length ? "; " : "", name, reason.message);
    return false;
}

static bool try_devices(karst_display *display, egl_native *n, char *reasons, size_t size_bytes)
{
    PFNEGLQUERYDEVICESEXTPROC query = (PFNEGLQUERYDEVICESEXTPROC)n->egl.GetProcAddress("eglQueryDevicesEXT");
    EGLDeviceEXT devices[MAX_DEVICES];
    EGLint num_devices = 0;
    if (!query || !query(MAX_DEVICES, devices, &num_devices))
        return false;
    for (EGLint i = 0; i < num_devices; i++) {
        char name[32];
        snprintf(name, sizeof name, "device %d", i);
        if (try_display(display, n, platform_display(&n->egl, EGL_PLATFORM_DEVICE_EXT, devices[i]), name, reasons,
                        size_bytes))
            return true;
    }
    return false;
}

bool karst_display_open_egl(karst_display *display, karst_error *error)
{
    egl_native *n = calloc(1, sizeof *n);
    if (!n)
        return karst_fail(error, KARST_FAILED, "out of memory for a display");
    n->context = EGL_NO_CONTEXT;
    n->surface = EGL_NO_SURFACE;
    char reasons[512] = "";
    if (!load_library(&n->egl, error)) {
        free(n);
        return false;
    }
    get_proc_address = n->egl.GetProcAddress;
    const char *client = n->egl.QueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
    bool opened = false;
    if (lists(client, "EGL_MESA_platform_surfaceless"))
        opened = try_display(display, n, platform_display(&n->egl, EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY),
                             "surfaceless", reasons, sizeof reasons);
    if (!opened && lists(client, "EGL_EXT_platform_device"))
        opened = try_devices(display, n, reasons, sizeof reasons);
    if (!opened) {
        free(n);
        return karst_fail(error, KARST_NO_DEVICE, "no EGL display without a window system (%s): %s",
                          reasons[0] ? reasons : "no driver offers one", MEND);
    }
    display->native = n;
    display->platform = &platform_egl;
    return true;
}

/* The library is asked only if something has loaded it: then a context that is current may be its own. */
static void *loaded(const char *library_name, const char *symbol)
{
    void *library = dlopen(library_name, RTLD_NOW | RTLD_LOCAL | RTLD_NOLOAD);
    void *address = library ? dlsym(library, symbol) : NULL;
    if (library)
        dlclose(library);
    return address;
}

bool karst_display_sharing_current(cl_context_properties properties[KARST_SHARING_PROPERTIES])
{
    typedef void *(*getter)(void);
    static const struct {
        const char *library, *context, *display;
        cl_context_properties display_key;
    } ways[] = {
        {"libEGL.so.1", "eglGetCurrentContext", "eglGetCurrentDisplay", CL_EGL_DISPLAY_KHR},
        {"libGLX.so.0", "glXGetCurrentContext", "glXGetCurrentDisplay", CL_GLX_DISPLAY_KHR},
        {"libGL.so.1", "glXGetCurrentContext", "glXGetCurrentDisplay", CL_GLX_DISPLAY_KHR},
    };
    for (size_t i = 0; i < sizeof ways / sizeof ways[0]; i++) {
        getter get_context = (getter)loaded(ways[i].library, ways[i].context),
               get_display = (getter)loaded(ways[i].library, ways[i].display);
        void *context = get_context ? get_context() : NULL, *native = get_display ? get_display() : NULL;
        if (!context || !native)
            continue;
        const cl_context_properties found[KARST_SHARING_PROPERTIES] = {
            CL_GL_CONTEXT_KHR, (cl_context_properties)(intptr_t)context, ways[i].display_key,
            (cl_context_properties)(intptr_t)native, 0};
        memcpy(properties, found, sizeof found);
        return true;
    }
    return false;
}
