#include "core/display/gl.h"

#include <stddef.h>

enum { MAJOR_MIN = 3, MINOR_MIN = 3, ERRORS_MAX = 100 };

bool karst_gl_load(karst_gl *gl, void *(*get_proc)(const char *name), karst_error *error)
{
#define LOAD(type, name)                                                                                          \
    gl->name = (type)get_proc("gl" #name);                                                                        \
    if (!gl->name)                                                                                                \
        return karst_fail(error, KARST_NO_DEVICE, "the OpenGL driver lacks gl" #name " (OpenGL %d.%d is needed)", \
                          MAJOR_MIN, MINOR_MIN);
    KARST_GL_FUNCTIONS(LOAD)
#undef LOAD
    GLint major = 0, minor = 0;
    gl->GetIntegerv(GL_MAJOR_VERSION, &major);
    gl->GetIntegerv(GL_MINOR_VERSION, &minor);
    if (major < MAJOR_MIN || (major == MAJOR_MIN && minor < MINOR_MIN)) {
        const char *version = (const char *)gl->GetString(GL_VERSION);
        return karst_fail(error, KARST_NO_DEVICE, "OpenGL %d.%d is needed, but there is %s", MAJOR_MIN, MINOR_MIN,
                          version ? version : "no current context");
    }
    return true;
}

void karst_gl_clear_errors(const karst_gl *gl)
{
    /* A lost context may report errors for ever. */
    for (int i = 0; i < ERRORS_MAX && gl->GetError() != GL_NO_ERROR; i++) {
    }
}

static const char *error_name(GLenum code)
{
    switch (code) {
    case GL_INVALID_ENUM:
        return "GL_INVALID_ENUM";
    case GL_INVALID_VALUE:
        return "GL_INVALID_VALUE";
    case GL_INVALID_OPERATION:
        return "GL_INVALID_OPERATION";
    case GL_INVALID_FRAMEBUFFER_OPERATION:
        return "GL_INVALID_FRAMEBUFFER_OPERATION";
    case GL_OUT_OF_MEMORY:
        return "out of memory";
    default:
        return "an unknown OpenGL error";
    }
}

bool karst_gl_check(const karst_gl *gl, const char *doing, karst_error *error)
{
    GLenum code = gl->GetError();
    if (code == GL_NO_ERROR)
        return true;
    karst_gl_clear_errors(gl);
    return karst_fail(error, KARST_FAILED, "OpenGL failed while %s: %s (0x%x); --display none does without OpenGL",
                      doing, error_name(code), code);
}
