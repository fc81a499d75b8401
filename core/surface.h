/* The pixel buffer of a display: where the shade kernel writes. Private to the library.
 *
 * begin -> launch kernels that write the cl_mem -> end (uploads to the texture, draws) -> read_pixels if wanted. */
#ifndef KARST_CORE_SURFACE_H
#define KARST_CORE_SURFACE_H

#include "core/context.h"
#include "karst/display.h"

typedef struct karst_surface karst_surface;

/* How pixels get from the device to OpenGL. */
typedef enum {
    KARST_SURFACE_MAPPED, /* CPU devices: the kernel writes the mapped pixel buffer itself */
    KARST_SURFACE_SHARED, /* cl_khr_gl_sharing */
    KARST_SURFACE_COPIED, /* one copy through host memory */
    KARST_SURFACE_PLAIN   /* no OpenGL */
} karst_surface_path;

karst_surface *karst_surface_create(karst_context *context, karst_display *display, int width_px, int height_px, karst_error *error);
void karst_surface_destroy(karst_surface *surface);
/* Memory for width * height RGBA8 pixels, valid until karst_surface_end. */
cl_mem karst_surface_begin(karst_surface *surface, karst_error *error);
/* Waits for the queue; pixels reach the texture and are drawn into the framebuffer (headless: an FBO). Time goes to KARST_STAGE_DISPLAY. */
bool karst_surface_end(karst_surface *surface, karst_error *error);
/* The framebuffer's pixels (PLAIN: the device's), top row first. */
bool karst_surface_read(karst_surface *surface, uint8_t *rgba, size_t size_bytes, karst_error *error);
karst_surface_path karst_surface_get_path(const karst_surface *surface);

#endif
