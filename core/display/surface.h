/* The pixel buffer of a display: where the shade kernel writes. Private to the library.
 *
 * begin -> launch kernels that write the cl_mem -> hand over (enqueues) -> end (waits, draws) -> read if wanted. */
#ifndef KARST_CORE_SURFACE_H
#define KARST_CORE_SURFACE_H

#include "core/device/context.h"
#include "karst/display.h"

typedef struct karst_surface karst_surface;

/* How pixels get from the device to OpenGL. The bytes are the same on every path: none converts them. */
typedef enum {
    KARST_SURFACE_MAPPED, /* CPU devices: the kernel writes the mapped pixel buffer itself */
    KARST_SURFACE_SHARED, /* cl_khr_gl_sharing, where the context shares_gl. Written to the specification and tested
                             against a stand-in; no device with the extension has been at hand */
    KARST_SURFACE_COPIED, /* other devices: one copy, from the device into the mapped pixel buffer */
    KARST_SURFACE_PLAIN   /* no OpenGL */
} karst_surface_path;

/* Properties that let an OpenCL context share objects with a display's OpenGL (cl_khr_gl_sharing), ended by 0: for
 * karst_context_create_sharing. false if the display has no OpenGL that can share: NONE, OSMesa. */
#define KARST_SHARING_PROPERTIES 5
bool karst_display_sharing(karst_display *display, cl_context_properties properties[KARST_SHARING_PROPERTIES]);

/* Context and display are borrowed and must outlive the surface. Use from the display's thread. What it takes is in the
 * account: "pixels" on the device, "display" in OpenGL (pixel buffer and texture). Errors: KARST_USAGE (larger than
 * OpenGL's textures), KARST_FAILED. */
karst_surface *karst_surface_create(karst_context *context, karst_display *display, int width_px, int height_px,
                                    karst_error *error);
void karst_surface_destroy(karst_surface *surface); /* NULL is fine; also between begin and end */
/* Memory for width * height RGBA8 pixels, top row first, valid until karst_surface_end; its old contents are undefined:
 * write every pixel. NULL on failure: then there is nothing to end. */
cl_mem karst_surface_begin(karst_surface *surface, karst_error *error);
/* Once all kernels that write the pixels have been launched: enqueues what makes them visible to OpenGL, and waits for
 * nothing. May be left to karst_surface_end. After a failure the surface must still be ended. */
bool karst_surface_hand_over(karst_surface *surface, karst_error *error);
/* Waits for the queue; pixels lie in OpenGL's pixel buffer. In a window they reach the texture and are blitted over the
 * current GL viewport (pixel by pixel if it has the picture's size, else stretched); headless, where that texture is
 * the framebuffer (an FBO), they reach it when they are read. Ends the surface also on failure. Time, but for the wait,
 * goes to KARST_STAGE_DISPLAY. In a window's context it leaves the 2D texture, pixel buffers and framebuffers unbound,
 * the scissor test and sRGB framebuffers disabled, and sets pixel storage modes. */
bool karst_surface_end(karst_surface *surface, karst_error *error);
/* Blits what the last karst_surface_end brought over a window's viewport once more; elsewhere nothing. */
bool karst_surface_show(karst_surface *surface, karst_error *error);
/* The pixels of the last karst_surface_end, top row first, exactly as the kernel wrote them, also if a window is hidden
 * or stretched. */
bool karst_surface_read(karst_surface *surface, uint8_t *rgba, size_t size_bytes, karst_error *error);
karst_surface_path karst_surface_get_path(const karst_surface *surface);

#endif
