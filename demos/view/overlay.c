/* Panels over the picture: each is a cairo image that becomes a texture when it changes, and a rectangle that is
 * blended over the window. Only the pixels of panels cost anything. */
#include "demos/view/view.h"

#include <GL/glcorearb.h>
#include <stdlib.h>
#include <string.h>

#define MARGIN 12.0

/* The few entry points that this needs. */
#define FOR_EACH_ENTRY(X)                              \
    X(PFNGLACTIVETEXTUREPROC, ActiveTexture)           \
    X(PFNGLATTACHSHADERPROC, AttachShader)             \
    X(PFNGLBINDBUFFERPROC, BindBuffer)                 \
    X(PFNGLBINDFRAMEBUFFERPROC, BindFramebuffer)       \
    X(PFNGLBINDTEXTUREPROC, BindTexture)               \
    X(PFNGLBINDVERTEXARRAYPROC, BindVertexArray)       \
    X(PFNGLBLENDFUNCPROC, BlendFunc)                   \
    X(PFNGLCLEARPROC, Clear)                           \
    X(PFNGLCLEARCOLORPROC, ClearColor)                 \
    X(PFNGLCOMPILESHADERPROC, CompileShader)           \
    X(PFNGLCREATEPROGRAMPROC, CreateProgram)           \
    X(PFNGLCREATESHADERPROC, CreateShader)             \
    X(PFNGLDELETEPROGRAMPROC, DeleteProgram)           \
    X(PFNGLDELETESHADERPROC, DeleteShader)             \
    X(PFNGLDELETETEXTURESPROC, DeleteTextures)         \
    X(PFNGLDELETEVERTEXARRAYSPROC, DeleteVertexArrays) \
    X(PFNGLDISABLEPROC, Disable)                       \
    X(PFNGLDRAWARRAYSPROC, DrawArrays)                 \
    X(PFNGLENABLEPROC, Enable)                         \
    X(PFNGLGENTEXTURESPROC, GenTextures)               \
    X(PFNGLGENVERTEXARRAYSPROC, GenVertexArrays)       \
    X(PFNGLGETPROGRAMIVPROC, GetProgramiv)             \
    X(PFNGLGETUNIFORMLOCATIONPROC, GetUniformLocation) \
    X(PFNGLLINKPROGRAMPROC, LinkProgram)               \
    X(PFNGLPIXELSTOREIPROC, PixelStorei)               \
    X(PFNGLSHADERSOURCEPROC, ShaderSource)             \
    X(PFNGLTEXIMAGE2DPROC, TexImage2D)                 \
    X(PFNGLTEXPARAMETERIPROC, TexParameteri)           \
    X(PFNGLTEXSUBIMAGE2DPROC, TexSubImage2D)           \
    X(PFNGLUNIFORM4FPROC, Uniform4f)                   \
    X(PFNGLUSEPROGRAMPROC, UseProgram)                 \
    X(PFNGLVIEWPORTPROC, Viewport)

struct view_gl {
#define DECLARE(type, name) type name;
    FOR_EACH_ENTRY(DECLARE)
#undef DECLARE
    PFNGLGETGRAPHICSRESETSTATUSPROC GetGraphicsResetStatus; /* may be missing */
};

/* A rectangle (left, top, right, bottom in -1 to 1) as a strip of four corners, the image's first row at its top. */
static const char vertex_source[] = "#version 330 core\n"
                                    "uniform vec4 rectangle;\n"
                                    "out vec2 at;\n"
                                    "void main()\n"
                                    "{\n"
                                    "    at = vec2(gl_VertexID & 1, gl_VertexID >> 1);\n"
                                    "    gl_Position = vec4(mix(rectangle.xy, rectangle.zw, at), 0.0, 1.0);\n"
                                    "}\n";
static const char fragment_source[] = "#version 330 core\n"
                                      "uniform sampler2D image;\n"
                                      "in vec2 at;\n"
                                      "out vec4 colour;\n"
                                      "void main() { colour = texture(image, at); }\n";

static bool load_entries(struct view_gl *gl, karst_error *error)
{
#define LOAD(type, name)                             \
    gl->name = (type)glfwGetProcAddress("gl" #name); \
    if (!gl->name)                                   \
        return karst_fail(error, KARST_NO_DEVICE, "this OpenGL has no gl%s; karst info says more", #name);
    FOR_EACH_ENTRY(LOAD)
#undef LOAD
    gl->GetGraphicsResetStatus = (PFNGLGETGRAPHICSRESETSTATUSPROC)glfwGetProcAddress("glGetGraphicsResetStatus");
    if (!gl->GetGraphicsResetStatus)
        gl->GetGraphicsResetStatus = (PFNGLGETGRAPHICSRESETSTATUSPROC)glfwGetProcAddress("glGetGraphicsResetStatusARB");
    return true;
}

bool view_overlay_create(viewer *v, karst_error *error)
{
    view_overlay *o = &v->overlay;
    struct view_gl *gl = o->gl = calloc(1, sizeof *gl);
    if (!gl)
        return karst_fail(error, KARST_FAILED, "out of memory");
    if (!load_entries(gl, error))
        return false;
    o->program = gl->CreateProgram();
    const char *const sources[] = {vertex_source, fragment_source};
    for (int i = 0; i < 2; i++) {
        GLuint shader = gl->CreateShader(i ? GL_FRAGMENT_SHADER : GL_VERTEX_SHADER);
        gl->ShaderSource(shader, 1, &sources[i], NULL);
        gl->CompileShader(shader);
        gl->AttachShader(o->program, shader);
        gl->DeleteShader(shader);
    }
    gl->LinkProgram(o->program);
    GLint linked = GL_FALSE;
    gl->GetProgramiv(o->program, GL_LINK_STATUS, &linked);
    if (!linked)
        return karst_fail(error, KARST_NO_DEVICE, "this OpenGL does not compile shaders of version 3.3");
    o->rectangle_place = gl->GetUniformLocation(o->program, "rectangle");
    gl->GenVertexArrays(1, &o->vertices);
    return true;
}

void view_overlay_destroy(viewer *v)
{
    view_overlay *o = &v->overlay;
    for (int i = 0; i < VIEW_NUM_PANELS; i++) {
        if (o->panels[i].texture)
            o->gl->DeleteTextures(1, &o->panels[i].texture);
        cairo_surface_destroy(o->panels[i].image);
    }
    if (o->vertices)
        o->gl->DeleteVertexArrays(1, &o->vertices);
    if (o->program)
        o->gl->DeleteProgram(o->program);
    free(o->gl);
    *o = (view_overlay){0};
}

cairo_t *view_panel_begin(viewer *v, view_panel_kind kind, int width, int height)
{
    view_panel *panel = &v->overlay.panels[kind];
    width = width < 1 ? 1 : width > 8192 ? 8192 : width;
    height = height < 1 ? 1 : height > 8192 ? 8192 : height;
    if (!panel->image || panel->width != width || panel->height != height) {
        cairo_surface_destroy(panel->image);
        panel->image = cairo_image_surface_create(CAIRO_FORMAT_ARGB32, width, height);
        panel->width = width;
        panel->height = height;
    }
    cairo_t *cairo = cairo_create(panel->image);
    if (cairo_status(cairo) != CAIRO_STATUS_SUCCESS) {
        cairo_destroy(cairo);
        cairo_surface_destroy(panel->image);
        panel->image = NULL;
        panel->shown = false;
        return NULL;
    }
    cairo_set_operator(cairo, CAIRO_OPERATOR_CLEAR);
    cairo_paint(cairo);
    cairo_set_operator(cairo, CAIRO_OPERATOR_OVER);
    return cairo;
}

void view_panel_end(viewer *v, view_panel_kind kind, cairo_t *cairo, int x, int y)
{
    view_panel *panel = &v->overlay.panels[kind];
    const struct view_gl *gl = v->overlay.gl;
    cairo_destroy(cairo);
    cairo_surface_flush(panel->image);
    panel->x = x;
    panel->y = y;
    panel->shown = true;
    if (!panel->texture)
        gl->GenTextures(1, &panel->texture);
    gl->ActiveTexture(GL_TEXTURE0);
    gl->BindTexture(GL_TEXTURE_2D, panel->texture);
    gl->BindBuffer(GL_PIXEL_UNPACK_BUFFER, 0);
    gl->PixelStorei(GL_UNPACK_ALIGNMENT, 4);
    gl->PixelStorei(GL_UNPACK_ROW_LENGTH, cairo_image_surface_get_stride(panel->image) / 4);
    gl->TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    gl->TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    gl->TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAX_LEVEL, 0);
    const void *data = cairo_image_surface_get_data(panel->image);
    if (panel->texture_width == panel->width && panel->texture_height == panel->height)
        gl->TexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, panel->width, panel->height, GL_BGRA, GL_UNSIGNED_INT_8_8_8_8_REV,
                          data);
    else
        gl->TexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, panel->width, panel->height, 0, GL_BGRA, GL_UNSIGNED_INT_8_8_8_8_REV,
                       data);
    panel->texture_width = panel->width;
    panel->texture_height = panel->height;
    gl->PixelStorei(GL_UNPACK_ROW_LENGTH, 0);
    gl->BindTexture(GL_TEXTURE_2D, 0);
}

void view_panel_hide(viewer *v, view_panel_kind kind) { v->overlay.panels[kind].shown = false; }

int view_hud_top(const viewer *v)
{
    const view_panel *message = &v->overlay.panels[VIEW_PANEL_ERROR];
    int margin = (int)(MARGIN * v->scale);
    return *v->reload.error && message->shown ? message->y + message->height + margin : margin;
}

void view_overlay_clear(viewer *v)
{
    const struct view_gl *gl = v->overlay.gl;
    gl->Viewport(0, 0, v->width_px, v->height_px);
    gl->ClearColor(0.10f, 0.12f, 0.15f, 1);
    gl->Clear(GL_COLOR_BUFFER_BIT);
}

void view_overlay_draw(viewer *v)
{
    const view_overlay *o = &v->overlay;
    const struct view_gl *gl = o->gl;
    if (v->width_px < 1 || v->height_px < 1)
        return;
    gl->BindFramebuffer(GL_FRAMEBUFFER, 0);
    gl->Viewport(0, 0, v->width_px, v->height_px);
    gl->UseProgram(o->program);
    gl->BindVertexArray(o->vertices);
    gl->ActiveTexture(GL_TEXTURE0);
    gl->Enable(GL_BLEND);
    gl->BlendFunc(GL_ONE, GL_ONE_MINUS_SRC_ALPHA); /* cairo's colours hold their alpha already */
    for (int i = 0; i < VIEW_NUM_PANELS; i++) {
        const view_panel *panel = &o->panels[i];
        if (!panel->shown)
            continue;
        float x = 2.0f / (float)v->width_px, y = 2.0f / (float)v->height_px;
        gl->BindTexture(GL_TEXTURE_2D, panel->texture);
        gl->Uniform4f(o->rectangle_place, (float)panel->x * x - 1, 1 - (float)panel->y * y,
                      (float)(panel->x + panel->width) * x - 1, 1 - (float)(panel->y + panel->height) * y);
        gl->DrawArrays(GL_TRIANGLE_STRIP, 0, 4);
    }
    gl->Disable(GL_BLEND);
    gl->BindTexture(GL_TEXTURE_2D, 0);
    gl->BindVertexArray(0);
    gl->UseProgram(0);
}

bool view_context_lost(viewer *v)
{
    const struct view_gl *gl = v->overlay.gl;
    return gl && gl->GetGraphicsResetStatus && gl->GetGraphicsResetStatus() != GL_NO_ERROR;
}
