/* Views of what a picture's light is made of: albedos, openness, bounces. */
#include <stdlib.h>

#include "core/engine/engine_parts.h"

/* Planes in packet order; NULL: they could not be made. */
static karst_buffer *albedo_planes(karst_engine *engine, karst_error *error)
{
    const uint32_t width = (uint32_t)engine->width_px, height = (uint32_t)engine->height_px;
    const size_t num = (size_t)width * height;
    float *rows = malloc(3 * num * sizeof *rows), *planes = malloc(3 * num * sizeof *planes);
    karst_buffer *buffer = NULL;
    if (!rows || !planes)
        karst_fail(error, KARST_FAILED, "out of memory for albedos");
    else if (karst_engine_read_albedo(engine, rows, error)) {
        for (uint32_t y = 0; y < height; y++)
            for (uint32_t x = 0; x < width; x++)
                for (size_t c = 0; c < 3; c++)
                    planes[c * num + karst_packet_order(x, y, width, height)] = rows[3 * (y * (size_t)width + x) + c];
        buffer = karst_buffer_create(engine->context, "albedo", 3 * num * sizeof *planes, planes, error);
    }
    free(planes);
    free(rows);
    return buffer;
}

bool karst_engine_paint_values(karst_engine *engine, const karst_pinhole *pinhole, cl_mem pixels, karst_error *error)
{
    if (engine->view != KARST_PAINT_ALBEDO)
        return karst_views_paint_values(engine->views, engine->view, pinhole, engine->hits,
                                        engine->occlusion ? karst_occlusion_open(engine->occlusion) : NULL, pixels,
                                        error);
    /* Shading counts what it meets: what was counted of the picture stays. */
    uint32_t counted[sizeof engine->counted / sizeof *engine->counted];
    if (!karst_buffer_read(engine->counters, 0, counted, sizeof counted, error))
        return false;
    karst_buffer *albedos = albedo_planes(engine, error);
    const bool done = albedos && karst_views_paint_values(engine->views, engine->view, pinhole, engine->hits, albedos,
                                                          pixels, error) &&
                      karst_buffer_write(engine->counters, 0, counted, sizeof counted, error);
    karst_buffer_destroy(albedos);
    return done;
}
