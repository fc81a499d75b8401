/* The engine's own state, and what its files do for one another. Only core/engine*.c includes this. */
#ifndef KARST_CORE_ENGINE_PARTS_H
#define KARST_CORE_ENGINE_PARTS_H

#include "cache/cache.h"
#include "core/context.h"
#include "core/cost.h"
#include "core/engine_internal.h"
#include "core/ladder.h"
#include "core/surface.h"
#include "karst/engine.h"
#include "producers/language/world_file.h"
#include "producers/producer.h"
#include "raycast/cast.h"
#include "raycast/shade.h"
#include "raycast/views.h"

#define KARST_ENGINE_NUM_COUNTERS 4

struct karst_engine {
    const karst_log *log;
    const karst_world_info *world;
    karst_world_file *world_file; /* NULL: a shipped world */
    karst_context *context;
    karst_display *display;
    bool owns_display;
    karst_surface *surface;
    karst_cache *cache;
    karst_producer *producer;
    karst_caster *caster;
    karst_shader *shader;
    karst_buffer *hits, *shadow_rays, *shadow_hits, *depth, *counters;

    int width_px, height_px;
    size_t room_px; /* pixels that the picture's buffers hold: drawn pictures may be smaller */
    bool shadows, count_changed_pixels, reported_non_finite;
    double detail_px, view_distance_voxels;
    uint32_t budget_bricks;
    double budget_ns; /* 0: bricks only */
    karst_cost cost;

    karst_camera camera;
    bool view_changed;
    int64_t root_corner[3];
    int top_level;
    bool root_placed;

    int view;                         /* karst_view, or KARST_PAINT_*: what is painted instead of the picture */
    karst_camera drawn;               /* the last frame's */
    karst_views *views;               /* NULL until one is asked for */
    karst_caster *counting;           /* the caster that counts steps; NULL until they are asked for */
    karst_ladder ladder;
    uint32_t serial, frame;
    uint8_t *previous_pixels, *pixels; /* only with count_changed_pixels */
    bool have_previous;
    karst_stats stats;
};

/* engine_world.c. Opens the world that the configuration names; a file is compiled. Errors: KARST_BAD_WORLD,
 * KARST_USAGE. */
bool karst_engine_open_world(karst_engine *engine, const karst_engine_config *config, karst_error *error);
/* Makes the producer, then the shader, which may read the producer's data. */
bool karst_engine_create_producer(karst_engine *engine, uint32_t seed, karst_error *error);
bool karst_engine_create_shader(karst_engine *engine, karst_error *error);

/* engine_create.c. Errors: KARST_USAGE. */
bool karst_engine_check_budget_ms(double budget_ms, karst_error *error);

/* engine_picture.c. What follows the picture's size. */
bool karst_engine_check_size(int width_px, int height_px, karst_error *error);
bool karst_engine_allocate_picture(karst_engine *engine, karst_error *error);
void karst_engine_free_picture(karst_engine *engine);
/* Fills stats.num_changed_pixels; only with count_changed_pixels. */
bool karst_engine_count_changed_pixels(karst_engine *engine, karst_error *error);

/* engine_draw.c. Casts and shades into the display. */
bool karst_engine_draw(karst_engine *engine, karst_error *error);

#endif
