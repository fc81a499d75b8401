/* Pixels on their way from the device into an OpenGL framebuffer.
 *
 * Row 0 of the pixel buffer, of the texture and of the headless framebuffer is the picture's top. The headless
 * framebuffer *is* the texture: the upload draws it, and drawing it once more would cost llvmpipe 4 ms at 1280x720.
 * Nobody looks at it but who reads it, so the upload waits for that, and the pixel buffer stays mapped.
 * Only a window is blitted to, upside down, since OpenGL's windows count rows from the bottom. Nothing converts to or
 * from sRGB: bytes in are bytes out. */
#include "core/display/surface.h"

#include "core/display/display_platform.h"

#include <CL/cl_gl.h>
#include <stdlib.h>
#include <string.h>

struct karst_surface {
    karst_context *context;
    karst_display *display;
    const karst_gl *gl;
    int width_px, height_px;
    size_t size_bytes;
    karst_surface_path path;
    bool begun;
    bool handed_over;      /* of what was begun: enqueued */
    bool waits_for_upload; /* headless: what was ended last */
    karst_buffer *pixels;  /* COPIED, PLAIN: what kernels write */
    karst_buffer *account; /* of OpenGL's part: pixel buffer and texture */
    cl_mem mem;            /* what kernels write: SHARED for good; MAPPED while the pixel buffer is */
    void *mapped;          /* MAPPED: the pixel buffer, from begin to end; headless until the picture is read */
    GLuint pixel_buffer, texture, framebuffer;
    GLsync uploaded; /* the last upload has read the pixel buffer */
};

/* ---- the pixel buffer, mapped ---- */

/* The old contents are not wanted, and whoever read them is waited for here: so the driver need neither copy nor wait.
 */
static void *map(karst_surface *surface, karst_error *error)
{
    const karst_gl *gl = surface->gl;
    if (surface->uploaded) {
        const GLuint64 second_ns = 1000000000;
        GLenum state;
        do
            state = gl->ClientWaitSync(surface->uploaded, GL_SYNC_FLUSH_COMMANDS_BIT, second_ns);
        while (state == GL_TIMEOUT_EXPIRED);
        gl->DeleteSync(surface->uploaded);
        surface->uploaded = NULL;
    }
    gl->BindBuffer(GL_PIXEL_UNPACK_BUFFER, surface->pixel_buffer);
    void *mapped = gl->MapBufferRange(GL_PIXEL_UNPACK_BUFFER, 0, (GLsizeiptr)surface->size_bytes,
                                      GL_MAP_WRITE_BIT | GL_MAP_INVALIDATE_BUFFER_BIT | GL_MAP_UNSYNCHRONIZED_BIT);
    gl->BindBuffer(GL_PIXEL_UNPACK_BUFFER, 0);
    if (!mapped) {
        karst_gl_check(gl, "mapping the pixel buffer", error);
        karst_fail(error, KARST_FAILED, "OpenGL cannot map the pixel buffer; --display none does without OpenGL");
    }
    return mapped;
}

static bool unmap(karst_surface *surface, karst_error *error)
{
    const karst_gl *gl = surface->gl;
    gl->BindBuffer(GL_PIXEL_UNPACK_BUFFER, surface->pixel_buffer);
    GLboolean kept = gl->UnmapBuffer(GL_PIXEL_UNPACK_BUFFER);
    gl->BindBuffer(GL_PIXEL_UNPACK_BUFFER, 0);
    if (!kept)
        return karst_fail(
            error, KARST_FAILED,
            "OpenGL lost the pixel buffer's contents (the screen changed its mode); draw the frame again");
    return true;
}

/* MAPPED: the pixel buffer as device memory. */
static bool wrap_mapping(karst_surface *surface, karst_error *error)
{
    surface->mapped = map(surface, error);
    if (!surface->mapped)
        return false;
    cl_int code = CL_SUCCESS;
    surface->mem = clCreateBuffer(surface->context->cl, CL_MEM_READ_WRITE | CL_MEM_USE_HOST_PTR, surface->size_bytes,
                                  surface->mapped, &code);
    if (code == CL_SUCCESS)
        return true;
    surface->mem = NULL;
    unmap(surface, NULL);
    surface->mapped = NULL;
    return karst_fail(error, KARST_FAILED, "OpenCL cannot use OpenGL's pixel buffer: %s", karst_cl_error_name(code));
}

/* OpenCL's own map and unmap make its writes visible at the host pointer. */
static bool enqueue_visible(karst_surface *surface, karst_error *error)
{
    cl_int code = CL_SUCCESS;
    cl_command_queue queue = surface->context->queue;
    void *seen =
        clEnqueueMapBuffer(queue, surface->mem, CL_FALSE, CL_MAP_READ, 0, surface->size_bytes, 0, NULL, NULL, &code);
    if (code == CL_SUCCESS)
        code = clEnqueueUnmapMemObject(queue, surface->mem, seen, 0, NULL, NULL);
    if (code != CL_SUCCESS)
        return karst_fail(error, KARST_FAILED, "OpenCL cannot hand the pixel buffer back: %s",
                          karst_cl_error_name(code));
    return seen == surface->mapped || karst_fail(error, KARST_FAILED, "OpenCL moved the mapped pixel buffer");
}

/* Hands the mapping back to OpenGL, once the queue is done with it. */
static bool unwrap_mapping(karst_surface *surface, karst_error *error)
{
    clReleaseMemObject(surface->mem);
    surface->mem = NULL;
    surface->mapped = NULL;
    return unmap(surface, error);
}

/* ---- choosing and making ---- */

static bool make_texture(karst_surface *surface, karst_error *error)
{
    const karst_gl *gl = surface->gl;
    karst_gl_clear_errors(gl);
    gl->GenTextures(1, &surface->texture);
    gl->BindTexture(GL_TEXTURE_2D, surface->texture);
    gl->TexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, surface->width_px, surface->height_px, 0, GL_RGBA, GL_UNSIGNED_BYTE,
                   NULL);
    gl->TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAX_LEVEL, 0); /* complete without mipmaps */
    gl->BindTexture(GL_TEXTURE_2D, 0);
    gl->GenBuffers(1, &surface->pixel_buffer);
    gl->BindBuffer(GL_PIXEL_UNPACK_BUFFER, surface->pixel_buffer);
    gl->BufferData(GL_PIXEL_UNPACK_BUFFER, (GLsizeiptr)surface->size_bytes, NULL, GL_STREAM_DRAW);
    gl->BindBuffer(GL_PIXEL_UNPACK_BUFFER, 0);
    gl->GenFramebuffers(1, &surface->framebuffer);
    gl->BindFramebuffer(GL_FRAMEBUFFER, surface->framebuffer);
    gl->FramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, surface->texture, 0);
    GLenum state = gl->CheckFramebufferStatus(GL_FRAMEBUFFER);
    gl->BindFramebuffer(GL_FRAMEBUFFER, 0);
    if (!karst_gl_check(gl, "making room for the picture", error))
        return false;
    if (state != GL_FRAMEBUFFER_COMPLETE)
        return karst_fail(
            error, KARST_FAILED,
            "OpenGL cannot draw pictures of %d x %d (framebuffer 0x%x); --display none does without OpenGL",
            surface->width_px, surface->height_px, state);
    return true;
}

/* Makes the chosen way ready; false if the device does not take part, and the next one is to be tried. */
static bool prepare(karst_surface *surface, karst_surface_path path, karst_error *error)
{
    karst_context *context = surface->context;
    surface->path = path;
    if (path == KARST_SURFACE_SHARED) {
        cl_int code = CL_SUCCESS;
        surface->gl->Finish();
        surface->mem = clCreateFromGLBuffer(context->cl, CL_MEM_READ_WRITE, surface->pixel_buffer, &code);
        if (code != CL_SUCCESS) {
            surface->mem = NULL;
            return karst_fail(error, KARST_FAILED, "OpenCL cannot share OpenGL's pixel buffer: %s",
                              karst_cl_error_name(code));
        }
    }
    if (path == KARST_SURFACE_MAPPED) { /* once for trial */
        if (!wrap_mapping(surface, error))
            return false;
        bool visible = enqueue_visible(surface, error), finished = karst_finish(context, visible ? error : NULL);
        return unwrap_mapping(surface, visible && finished ? error : NULL) && visible && finished;
    }
    if (path == KARST_SURFACE_COPIED || path == KARST_SURFACE_PLAIN)
        surface->pixels = karst_buffer_create(context, "pixels", surface->size_bytes, NULL, error);
    return path == KARST_SURFACE_SHARED || surface->pixels;
}

static bool choose_path(karst_surface *surface, karst_error *error)
{
    if (!surface->gl)
        return prepare(surface, KARST_SURFACE_PLAIN, error);
    const karst_context *context = surface->context;
    karst_error reason = {0};
    if (context->is_cpu && prepare(surface, KARST_SURFACE_MAPPED, &reason))
        return true;
    if (context->shares_gl && prepare(surface, KARST_SURFACE_SHARED, &reason))
        return true;
    if (reason.status)
        karst_log_print(context->log, KARST_LOG_WARNING, "display: %s; copying each picture instead", reason.message);
    return prepare(surface, KARST_SURFACE_COPIED, error);
}

karst_surface *karst_surface_create(karst_context *context, karst_display *display, int width_px, int height_px,
                                    karst_error *error)
{
    bool has_gl = display->kind != KARST_DISPLAY_NONE;
    if (width_px < 1 || height_px < 1) {
        karst_fail(error, KARST_USAGE, "a picture of %d x %d pixels; each side must be 1 or more", width_px, height_px);
        return NULL;
    }
    if (has_gl && (width_px > display->max_texture_px || height_px > display->max_texture_px)) {
        karst_fail(
            error, KARST_USAGE,
            "a picture of %d x %d pixels is too large for OpenGL here (%d each side); --display none has no such limit",
            width_px, height_px, display->max_texture_px);
        return NULL;
    }
    if (!karst_display_bind(display, error))
        return NULL;
    karst_surface *surface = calloc(1, sizeof *surface);
    if (!surface) {
        karst_fail(error, KARST_FAILED, "out of memory for a surface");
        return NULL;
    }
    surface->context = context;
    surface->display = display;
    surface->width_px = width_px;
    surface->height_px = height_px;
    surface->size_bytes = (size_t)width_px * (size_t)height_px * 4;
    if (has_gl) {
        surface->gl = &display->gl;
        surface->account = karst_buffer_account(context, "display", 2 * surface->size_bytes, error);
        if (!surface->account || !make_texture(surface, error)) {
            karst_surface_destroy(surface);
            return NULL;
        }
    }
    if (!choose_path(surface, error)) {
        karst_surface_destroy(surface);
        return NULL;
    }
    return surface;
}

void karst_surface_destroy(karst_surface *surface)
{
    if (!surface)
        return;
    karst_finish(surface->context, NULL);
    if (surface->gl && karst_display_bind(surface->display, NULL)) {
        const karst_gl *gl = surface->gl;
        if (surface->mapped)
            unwrap_mapping(surface, NULL);
        if (surface->mem) /* SHARED: before its OpenGL buffer goes */
            clReleaseMemObject(surface->mem);
        if (surface->uploaded)
            gl->DeleteSync(surface->uploaded);
        gl->DeleteFramebuffers(1, &surface->framebuffer);
        gl->DeleteTextures(1, &surface->texture);
        gl->DeleteBuffers(1, &surface->pixel_buffer);
    }
    karst_buffer_destroy(surface->pixels);
    karst_buffer_destroy(surface->account);
    free(surface);
}

/* ---- one frame ---- */

static bool acquire(karst_surface *surface, karst_error *error)
{
    surface->gl->Finish(); /* without cl_khr_gl_event OpenGL must be done first */
    cl_int code = clEnqueueAcquireGLObjects(surface->context->queue, 1, &surface->mem, 0, NULL, NULL);
    return code == CL_SUCCESS ||
           karst_fail(error, KARST_FAILED, "OpenCL cannot acquire the pixel buffer: %s", karst_cl_error_name(code));
}

static bool release(karst_surface *surface, karst_error *error)
{
    cl_int code = clEnqueueReleaseGLObjects(surface->context->queue, 1, &surface->mem, 0, NULL, NULL);
    return code == CL_SUCCESS ||
           karst_fail(error, KARST_FAILED, "OpenCL cannot release the pixel buffer: %s", karst_cl_error_name(code));
}

static bool copy(karst_surface *surface, karst_error *error)
{
    void *mapped = map(surface, error);
    if (!mapped)
        return false;
    bool copied = karst_buffer_read(surface->pixels, 0, mapped, surface->size_bytes, error);
    return unmap(surface, error) && copied;
}

cl_mem karst_surface_begin(karst_surface *surface, karst_error *error)
{
    if (surface->begun) {
        karst_fail(error, KARST_FAILED, "a surface was begun twice");
        return NULL;
    }
    uint64_t start_ns = karst_clock_ns();
    bool ready = karst_display_bind(surface->display, error);
    if (ready && surface->path == KARST_SURFACE_MAPPED && !surface->mapped)
        ready = wrap_mapping(surface, error);
    if (ready && surface->path == KARST_SURFACE_SHARED)
        ready = acquire(surface, error);
    karst_profile_add_host(surface->context, KARST_STAGE_DISPLAY, karst_clock_ns() - start_ns);
    if (!ready)
        return NULL;
    surface->begun = true;
    surface->handed_over = surface->waits_for_upload = false;
    return surface->mem ? surface->mem : surface->pixels->mem;
}

/* From the pixel buffer into the texture. The state that matters is set each time: a window's context is also its
 * owner's. */
static void upload(karst_surface *surface)
{
    const karst_gl *gl = surface->gl;
    gl->PixelStorei(GL_UNPACK_ALIGNMENT, 4);
    gl->PixelStorei(GL_UNPACK_ROW_LENGTH, 0);
    gl->PixelStorei(GL_UNPACK_SKIP_ROWS, 0);
    gl->PixelStorei(GL_UNPACK_SKIP_PIXELS, 0);
    gl->PixelStorei(GL_UNPACK_SWAP_BYTES, 0);
    gl->BindBuffer(GL_PIXEL_UNPACK_BUFFER, surface->pixel_buffer);
    gl->BindTexture(GL_TEXTURE_2D, surface->texture);
    gl->TexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, surface->width_px, surface->height_px, GL_RGBA, GL_UNSIGNED_BYTE, NULL);
    gl->BindTexture(GL_TEXTURE_2D, 0);
    gl->BindBuffer(GL_PIXEL_UNPACK_BUFFER, 0);
    surface->uploaded = gl->FenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0);
    surface->waits_for_upload = false;
}

/* Into the window's framebuffer, over the viewport that its owner has set. */
static void draw_window(karst_surface *surface)
{
    const karst_gl *gl = surface->gl;
    GLint view[4] = {0};
    gl->GetIntegerv(GL_VIEWPORT, view);
    bool same_size = view[2] == surface->width_px && view[3] == surface->height_px;
    gl->Disable(GL_SCISSOR_TEST);
    gl->Disable(GL_FRAMEBUFFER_SRGB);
    gl->BindFramebuffer(GL_READ_FRAMEBUFFER, surface->framebuffer);
    gl->ReadBuffer(GL_COLOR_ATTACHMENT0);
    gl->BindFramebuffer(GL_DRAW_FRAMEBUFFER, 0);
    gl->BlitFramebuffer(0, 0, surface->width_px, surface->height_px, view[0], view[1] + view[3], view[0] + view[2],
                        view[1], GL_COLOR_BUFFER_BIT, same_size ? GL_NEAREST : GL_LINEAR);
    gl->BindFramebuffer(GL_READ_FRAMEBUFFER, 0);
}

bool karst_surface_hand_over(karst_surface *surface, karst_error *error)
{
    if (!surface->begun || surface->handed_over)
        return karst_fail(error, KARST_FAILED, "a surface was handed over that was not begun, or twice");
    surface->handed_over = true;
    if (surface->path == KARST_SURFACE_MAPPED) /* headless it stays mapped until the picture is read */
        return surface->display->kind != KARST_DISPLAY_WINDOW || enqueue_visible(surface, error);
    return surface->path != KARST_SURFACE_SHARED || release(surface, error);
}

bool karst_surface_end(karst_surface *surface, karst_error *error)
{
    if (!surface->begun)
        return karst_fail(error, KARST_FAILED, "a surface was ended that was not begun");
    bool done = surface->handed_over || karst_surface_hand_over(surface, error);
    surface->begun = false;
    /* OpenCL before OpenGL; and the kernels' own time, not the display's. */
    done = karst_finish(surface->context, done ? error : NULL) && done;
    uint64_t start_ns = karst_clock_ns();
    done = karst_display_bind(surface->display, done ? error : NULL) && done;
    /* What begin took is given back even after a failure. */
    if (surface->gl)
        karst_gl_clear_errors(surface->gl);
    if (done && surface->path == KARST_SURFACE_COPIED)
        done = copy(surface, error);
    const bool in_window = surface->display->kind == KARST_DISPLAY_WINDOW;
    if (in_window && surface->path == KARST_SURFACE_MAPPED)
        done = unwrap_mapping(surface, done ? error : NULL) && done;
    surface->waits_for_upload = done && surface->gl;
    if (surface->waits_for_upload && in_window) {
        upload(surface);
        draw_window(surface);
    }
    if (done && surface->gl)
        done = karst_gl_check(surface->gl, "drawing the picture", error);
    karst_profile_add_host(surface->context, KARST_STAGE_DISPLAY, karst_clock_ns() - start_ns);
    return done;
}

bool karst_surface_show(karst_surface *surface, karst_error *error)
{
    if (surface->begun)
        return karst_fail(error, KARST_FAILED, "a surface was shown before it was ended");
    if (surface->display->kind != KARST_DISPLAY_WINDOW)
        return true;
    if (!karst_display_bind(surface->display, error))
        return false;
    karst_gl_clear_errors(surface->gl);
    draw_window(surface);
    return karst_gl_check(surface->gl, "showing the picture", error);
}

bool karst_surface_read(karst_surface *surface, uint8_t *rgba, size_t size_bytes, karst_error *error)
{
    if (size_bytes != surface->size_bytes)
        return karst_fail(error, KARST_USAGE, "a picture of %d x %d pixels has %zu bytes, not %zu", surface->width_px,
                          surface->height_px, surface->size_bytes, size_bytes);
    if (surface->begun)
        return karst_fail(error, KARST_FAILED, "a surface was read before it was ended");
    if (!surface->gl)
        return karst_buffer_read(surface->pixels, 0, rgba, size_bytes, error);
    const karst_gl *gl = surface->gl;
    if (!karst_display_bind(surface->display, error))
        return false;
    karst_gl_clear_errors(gl);
    if (surface->waits_for_upload && surface->mapped &&
        (!enqueue_visible(surface, error) || !karst_finish(surface->context, error) || !unwrap_mapping(surface, error)))
        return false;
    if (surface->waits_for_upload)
        upload(surface);
    gl->BindBuffer(GL_PIXEL_PACK_BUFFER, 0);
    gl->PixelStorei(GL_PACK_ALIGNMENT, 4);
    gl->PixelStorei(GL_PACK_ROW_LENGTH, 0);
    gl->PixelStorei(GL_PACK_SKIP_ROWS, 0);
    gl->PixelStorei(GL_PACK_SKIP_PIXELS, 0);
    gl->PixelStorei(GL_PACK_SWAP_BYTES, 0);
    gl->BindFramebuffer(GL_READ_FRAMEBUFFER, surface->framebuffer);
    gl->ReadBuffer(GL_COLOR_ATTACHMENT0);
    gl->ReadPixels(0, 0, surface->width_px, surface->height_px, GL_RGBA, GL_UNSIGNED_BYTE, rgba);
    gl->BindFramebuffer(GL_READ_FRAMEBUFFER, 0);
    return karst_gl_check(gl, "reading the picture", error);
}

karst_surface_path karst_surface_get_path(const karst_surface *surface) { return surface->path; }
