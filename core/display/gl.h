/* The OpenGL that Karst calls: a table of entry points, filled through whatever the context's maker offers
 * (eglGetProcAddress, OSMesaGetProcAddress, glfwGetProcAddress). Nothing links to an OpenGL library, so that Karst runs
 * where there is none. Private to the library. */
#ifndef KARST_CORE_GL_H
#define KARST_CORE_GL_H

#include <stdbool.h>

#include <GL/glcorearb.h>

#include "karst/error.h"

/* X(type, name without "gl"). All are in OpenGL 3.3 core. */
#define KARST_GL_FUNCTIONS(X)                                  \
    X(PFNGLBINDBUFFERPROC, BindBuffer)                         \
    X(PFNGLBINDFRAMEBUFFERPROC, BindFramebuffer)               \
    X(PFNGLBINDTEXTUREPROC, BindTexture)                       \
    X(PFNGLBLITFRAMEBUFFERPROC, BlitFramebuffer)               \
    X(PFNGLBUFFERDATAPROC, BufferData)                         \
    X(PFNGLCHECKFRAMEBUFFERSTATUSPROC, CheckFramebufferStatus) \
    X(PFNGLCLIENTWAITSYNCPROC, ClientWaitSync)                 \
    X(PFNGLDELETEBUFFERSPROC, DeleteBuffers)                   \
    X(PFNGLDELETEFRAMEBUFFERSPROC, DeleteFramebuffers)         \
    X(PFNGLDELETESYNCPROC, DeleteSync)                         \
    X(PFNGLDELETETEXTURESPROC, DeleteTextures)                 \
    X(PFNGLDISABLEPROC, Disable)                               \
    X(PFNGLFENCESYNCPROC, FenceSync)                           \
    X(PFNGLFINISHPROC, Finish)                                 \
    X(PFNGLFRAMEBUFFERTEXTURE2DPROC, FramebufferTexture2D)     \
    X(PFNGLGENBUFFERSPROC, GenBuffers)                         \
    X(PFNGLGENFRAMEBUFFERSPROC, GenFramebuffers)               \
    X(PFNGLGENTEXTURESPROC, GenTextures)                       \
    X(PFNGLGETERRORPROC, GetError)                             \
    X(PFNGLGETINTEGERVPROC, GetIntegerv)                       \
    X(PFNGLGETSTRINGPROC, GetString)                           \
    X(PFNGLMAPBUFFERRANGEPROC, MapBufferRange)                 \
    X(PFNGLPIXELSTOREIPROC, PixelStorei)                       \
    X(PFNGLREADBUFFERPROC, ReadBuffer)                         \
    X(PFNGLREADPIXELSPROC, ReadPixels)                         \
    X(PFNGLTEXIMAGE2DPROC, TexImage2D)                         \
    X(PFNGLTEXPARAMETERIPROC, TexParameteri)                   \
    X(PFNGLTEXSUBIMAGE2DPROC, TexSubImage2D)                   \
    X(PFNGLUNMAPBUFFERPROC, UnmapBuffer)

typedef struct {
#define KARST_GL_MEMBER(type, name) type name;
    KARST_GL_FUNCTIONS(KARST_GL_MEMBER)
#undef KARST_GL_MEMBER
} karst_gl;

/* Fills the table for the current context and checks that it is OpenGL 3.3 or later. Errors: KARST_NO_DEVICE naming
 * what is missing. */
bool karst_gl_load(karst_gl *gl, void *(*get_proc)(const char *name), karst_error *error);

/* Drops errors of earlier calls (a window's context is not ours alone), so that the next karst_gl_check speaks of what
 * comes between. */
void karst_gl_clear_errors(const karst_gl *gl);
/* Errors: KARST_FAILED naming what was being done, and OpenGL's error. */
bool karst_gl_check(const karst_gl *gl, const char *doing, karst_error *error);

#endif
