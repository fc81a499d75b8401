/* The engine's own state, and what its files do for one another. Only core/engine/ includes this. */
#ifndef KARST_CORE_ENGINE_PARTS_H
#define KARST_CORE_ENGINE_PARTS_H

#include <stdatomic.h>

#include "cache/cache.h"
#include "cache/colours.h"
#include "core/device/context.h"
#include "core/engine/cost.h"
#include "core/engine/engine_internal.h"
#include "core/engine/ladder.h"
#include "core/engine/pace.h"
#include "core/display/surface.h"
#include "karst/engine.h"
#include "karst/path.h"
#include "karst/world.h"
#include "producers/language/fingerprint.h"
#include "producers/language/graph/derive.h"
#include "producers/density/world_file.h"
#include "producers/language/oracle/oracle.h"
#include "producers/layer.h"
#include "producers/producer.h"
#include "raycast/cast/cast.h"
#include "raycast/cast/cover.h"
#include "raycast/cast/pinhole.h"
#include "raycast/cast/refine.h"
#include "raycast/light/bounce.h"
#include "raycast/light/clear.h"
#include "raycast/light/light_map.h"
#include "raycast/light/occlusion.h"
#include "raycast/light/pass.h"
#include "raycast/light/paths.h"
#include "raycast/light/photons.h"
#include "raycast/light/radiance.h"
#include "raycast/light/shade.h"
#include "raycast/light/views.h"
#include "raycast/media/media.h"

#define KARST_MOST_LAYER_KINDS 8
#define KARST_ENGINE_NUM_COUNTERS (KARST_CLEAR_COUNT_CUT + 1)
#define KARST_ENGINE_MAX_VOXEL ((int64_t)1 << 61) /* how far out a camera may be */

typedef struct karst_engine_streams karst_engine_streams; /* engine_rays.c */

/* A density's own surface, with its gradient: what moves hits there. Zeros: hits stay as bricks have them. */
typedef struct {
    karst_refiner *refiner;
    karst_gradient_world *gradient; /* of the world file */
    karst_world_layout layout;      /* of data */
    karst_buffer *data;
} karst_engine_refining;

/* What bends rays inside clear matter. Zeros: its index does not vary. */
typedef struct {
    karst_bender *bender;
    karst_engine_refining index; /* the index in the density's place; without a refiner */
    /* The same with the slopes of all its sides, and clear matter beside it as `text`: what bounds are made of. Its
     * data have a tape behind them. */
    karst_engine_refining sides;
    bool reported;               /* that it is no index in places */
} karst_engine_bending;

/* What a world has beside its land, as an engine has it. */
typedef struct {
    karst_engine_refining refining; /* of clear matter, where its gradient is not too large: normals are exact */
    karst_producer *producer;      /* NULL: none */
    karst_fingerprint fingerprint; /* as the world's own */
    karst_oracle *oracle;          /* of the values in force; NULL: none */
} karst_engine_content;

/* The store of such a content, which lives as long as the engine; zeros: it has none of that. */
typedef struct {
    karst_store *store;  /* the cache's */
    karst_caster *caster;
    uint32_t num_used_bricks; /* of its last round */
    bool lacks;               /* rays wanted something in its last round */
    bool reported_non_finite; /* of this world */
    karst_stats_store stats;
} karst_engine_store;

/* A world as an engine shows it. */
typedef struct {
    karst_world_file *file;
    karst_thin thin; /* as wanted */
    karst_number *values; /* of its parameters, as now in force */
    uint32_t seed;
    karst_fingerprint fingerprint; /* of the density with these values and this seed */
    karst_producer *producer;      /* NULL until it is built */
    karst_shader *shader;
    karst_skies *skies;                 /* NULL: it has no atmosphere */
    karst_engine_refining refining;
    karst_engine_refining photon_refining; /* as that of clear matter, for photons that land mirrors */
    karst_engine_content content[KARST_NUM_CONTENTS];
    karst_layer *layers[KARST_MOST_LAYER_KINDS]; /* by kind (engine_layers.c); NULL: none, or not made yet */
    karst_clear_shader *clear_shader; /* NULL: the engine has no store for clear matter */
    karst_engine_bending bending;
    karst_light_map *light_map;     /* NULL: none, or not made use of */
    karst_position light_map_anchor;
    karst_models_as models_as; /* as wanted */
    karst_splats *splats;      /* NULL: no model is shown as discs */
    karst_stats_splats splat_stats;
} karst_engine_world;

/* What is built of a world. */
typedef struct {
    unsigned shade; /* KARST_SHADE_* */
    bool refine;
    uint32_t max_loads; /* of a round */
    bool start_on_host; /* the producer: see karst_world_build */
    bool has_layers;    /* they are to take part in what it makes */
    unsigned contents;  /* those to be made beside the land: bit i stands for karst_content i */
    bool has_photons;   /* land that mirrors is to mirror as exactly as clear matter does */
    bool has_light_map; /* pictures make use of the one that the world may name */
} karst_engine_wishes;

/* What a frame has made so far, and the CPU time over the cores that it took (CPU devices only). */
typedef struct {
    uint32_t num_bricks, num_tiles, num_scout_rays;
    uint64_t brick_cpu_ns, tile_cpu_ns, scout_cpu_ns, again_cpu_ns;
} karst_engine_made;

/* What is left of a frame's budget. */
typedef struct {
    uint32_t bricks, tiles;
    double ns; /* only with a budget in ms */
    bool over; /* somebody wanted an end */
} karst_allowance;

/* How the camera moves, by frame. */
typedef struct {
    bool has_camera, moved, steady;
    karst_camera camera; /* of the last frame */
    double step_m[3], yaw_deg, pitch_deg;
    double turn_rad; /* of the step, about the vertical */
} karst_engine_motion;

/* Photons of a view; zeros: there are none. */
typedef struct {
    karst_photons *photons;
    karst_position anchor; /* where those that are shown were aimed from */
    bool is_sorted;        /* there are such */
    bool is_aiming;        /* in this view */
    bool is_aimed;         /* nothing was missing */
    bool shows_all;        /* this frame's picture does */
    bool is_whole;         /* and lacked nothing: no more are traced in this view */
    uint32_t bounces;
    uint32_t num;          /* of all */
    /* With a budget they are traced in stages, each of four times as many, and each from the beginning: so the first
     * picture of them comes soon. */
    uint32_t stages_left;  /* after the present one */
    bool is_first_stage;   /* of this view */
    bool is_stale;         /* it is of another detail than the picture by now */
    float detail;
    uint32_t num_begun;    /* batches of which all photons were traced, or wait */
} karst_engine_photons;

/* Media as engine_six_way.c draws them, without the world around them. */
typedef struct {
    bool is_on;
    float sun_direction[3], sun, behind; /* how bright both are */
} karst_engine_alone;

struct karst_engine {
    const karst_log *log;
    karst_engine_world shown;
    bool has_sun;
    karst_sun sun;
    const karst_world_info *world; /* shown's, as producer and shader are */
    karst_context *context;
    karst_display *display;
    bool owns_display;
    karst_surface *surface;
    karst_cache *cache;
    karst_engine_store stores[KARST_NUM_CONTENTS];
    karst_media *media; /* what is seen of the air's; NULL until it is seen */
    const karst_producer *media_of; /* whom it was made for */
    karst_media_mode media_mode;
    karst_scattering scattering;
    bool media_is_stale, media_lacks; /* content changed; the last picture's were not all there */
    uint32_t media_groups;            /* karst_engine_set_media_groups; 0: 1 */
    uint32_t fluence_packets;         /* 0: as many as there usually are; for tests */
    bool media_moves;                 /* particles moved since the last picture */
    karst_engine_alone alone;
    double time_s;                    /* karst_engine_set_time */
    karst_producer *producer;
    karst_layer *edits; /* NULL: there were none yet */
    karst_colours *colours; /* NULL: no layer had any yet */
    karst_dropped dropped; /* by the last change of them */
    karst_caster *caster;
    karst_cover *cover; /* NULL: nothing is drawn before land */
    karst_sunward *sunward; /* NULL without shadows, and where samples see different places on the sun */
    karst_shader *shader;
    karst_radiance *radiance; /* NULL: pictures are bytes from the start */
    karst_bounce *bounce;     /* NULL: no land mirrors, or `clear` follows what it does */
    karst_clear *clear;       /* NULL: there is no clear matter, and land lets no light pass, or paths are followed */
    karst_pass *pass;         /* NULL: land lets no light pass */
    karst_occlusion *occlusion; /* NULL: light from all around comes everywhere */
    karst_paths *paths;       /* NULL: no paths are followed, and the world has no lights but the sun */
    karst_path_starts *starts; /* of pictures of what light falls; NULL: those of any other kind */
    karst_engine_photons photons;
    karst_integrator integrator;
    uint32_t bounces; /* of paths, or of rays through clear matter */
    bool has_own_bounces; /* as configured */
    karst_buffer *hits, *shadow_rays, *counters, *asked, *shadows_asked, *hints, *shadow_hints;
    uint32_t counted[KARST_ENGINE_NUM_COUNTERS]; /* the counters' contents, once a picture is ended */
    bool drawing;                                /* a picture was begun that is not ended */

    int width_px, height_px;
    karst_engine_window window;
    int whole_width_px, whole_height_px; /* what the picture's buffers are for: drawn pictures may be smaller */
    size_t room_px;                      /* of both */
    unsigned shade; /* KARST_SHADE_* */
    bool shadows, blend, refine, count_changed_pixels, reported_non_finite;
    double detail_px, view_distance_voxels;
    double view_distance_m; /* as configured; 0: what the world says */
    uint32_t budget_bricks;
    double budget_ns; /* 0: bricks only */
    bool (*goes_on)(void *user); /* karst_engine_set_patience */
    void *patience;
    bool settles; /* a frame of karst_engine_settle */
    uint32_t samples;    /* of a pixel that a settled picture has; 1: rays go through the pixels' centres */
    uint32_t sample;     /* that the hits are of; 0: of the pixels' centres */
    bool kept;           /* the sample at hand was added to the sums to be read, though it is not complete */
    uint32_t num_summed; /* of this view, complete */
    float *given_sums;   /* of its first num_given samples, by karst_engine_set_sums; NULL: none */
    uint32_t num_given;
    bool sums_are_new;       /* no frame has been drawn since they were given */
    uint64_t num_metered_px; /* by karst_engine_meter, since the exposure that follows from them */
    float metered_exposure;  /* 0: none */
    bool complete;       /* the last frame lacked nothing: with more samples, it is one of them */
    /* Of paths (hold_paths in engine_produce.c). */
    bool camera_lacks;    /* as far as is known, the camera's rays lack something */
    uint32_t held_sample; /* whose light is right but in pixels whose paths lacked something; 0: none */
    bool draws_lacking;   /* and so only those are followed in this frame */
    karst_tone tone;
    karst_exposure exposure;
    double exposure_stops;
    double mirror; /* as configured */
    karst_cost cost;
    karst_engine_made made;

    karst_camera camera;
    karst_engine_motion motion;
    const karst_path *path; /* that the next frame belongs to; NULL: none is known */
    double path_s, path_step_s;
    bool view_changed, size_changed; /* since the last frame; the former is said for both */
    int64_t root_corner[3];
    int top_level;
    bool root_placed;
    bool has_content; /* a frame of this world has been drawn */
    bool on_host;     /* the host answers until kernels are compiled: karst_density_producer_is_on_host */
    atomic_bool has_tape_colours; /* the shader of tapes is compiled */

    int view;               /* karst_view, or KARST_PAINT_*: what is painted instead of the picture */
    karst_camera drawn;     /* the last frame's */
    karst_views *views;     /* NULL until one is asked for */
    karst_caster *counting; /* the caster that counts steps; NULL until they are asked for */
    karst_engine_streams *streams; /* for karst_engine_cast_rays; NULL until it is called */
    karst_ladder ladder;
    karst_ladder_verdict verdict; /* of this frame, while the ladder is deciding */
    karst_pace pace;
    uint32_t serial, frame;
    uint32_t turn; /* of answering what was asked for */
    uint32_t num_whole_scouts;
    uint32_t num_surveyed; /* slots below this hold no brick whose slopes are not known */
    bool ahead_is_made; /* the last look ahead found next to nothing */
    uint8_t *previous_pixels, *pixels; /* only with count_changed_pixels */
    bool have_previous;
    karst_stats stats;
};

/* engine_create.c: what follows from a configuration. Slots of the pools, where there are so many stores beside the
 * land; options of the cast (into size_bytes), the picture's size. */
bool karst_engine_size_pools(const karst_engine_config *config, uint32_t num_stores, uint32_t *num_tiles,
                             uint32_t *num_bricks, karst_error *error);
void karst_engine_cast_options(const karst_engine_config *config, const karst_world_info *world, char *text,
                               size_t size_bytes);
void karst_engine_picture_size(const karst_engine_config *config, int *width_px, int *height_px);
/* KARST_SHADE_* for a world. */
unsigned karst_engine_shade_ways(const karst_engine_config *config, const karst_world_info *world);
/* The share of light that land mirrors: as configured, or as the world says. */
double karst_engine_mirror_share(double configured, const karst_world_info *world);
/* Whether shadow rays go to different places on the sun. */
bool karst_engine_has_wide_sun(const karst_engine_config *config);

/* engine_world.c. Finds and compiles the world that the configuration names; its values, seed and fingerprint are those
 * asked for. Closed when it fails. Thread-safe. Errors: KARST_BAD_WORLD, KARST_FAILED. */
bool karst_engine_world_open(karst_engine_world *world, const karst_world_config *config, karst_thin thin,
                             karst_models_as as, karst_error *error);
/* The same text with other values, compiled anew. */
bool karst_engine_world_recompile(karst_engine_world *world, const karst_engine_world *old, const karst_number *values,
                                  karst_error *error);
/* The shader of an open world; `data` is its producer's, or the same once more. */
karst_shader *karst_engine_world_shader(const karst_engine_world *world, karst_context *context, unsigned ways,
                                        const karst_buffer *data, karst_error *error);
/* The shader that runs any world's colours on their tape. */
karst_shader *karst_engine_tape_shader(karst_context *context, unsigned ways, const karst_buffer *data,
                                       karst_error *error);
/* engine_ahead.c. What a helper process does for an engine of this configuration. */
bool karst_engine_compile_ahead(const karst_engine_config *config, karst_error *error);
/* Makes producer, shader and, if wanted, refiner of an open world. */
bool karst_engine_world_build(karst_engine_world *world, karst_context *context, const karst_cache_buffers *buffers,
                              const karst_engine_wishes *wishes, karst_error *error);
/* What its shader shows the sky by, if it has an atmosphere; a part of the above. */
bool karst_engine_world_build_skies(karst_engine_world *world, karst_context *context, karst_error *error);
void karst_engine_world_close(karst_engine_world *world);
/* Where rays end in a world, from the configuration or its header. Errors: KARST_USAGE. */
bool karst_engine_set_view_distance(karst_engine *engine, const karst_world_info *info, karst_error *error);
/* engine_change.c. From now on the engine shows this world, which is built; it is the engine's. */
void karst_engine_adopt_world(karst_engine *engine, const karst_engine_world *world);

/* engine_splats.c. Whether an open world's header shows models as discs; shows its models in another way from then on,
 * before anything is built; and what casters meet of them, a part of karst_engine_world_build. Errors: KARST_BAD_DATA,
 * KARST_USAGE, KARST_FAILED. */
bool karst_engine_world_has_splats(const karst_engine_world *world);
void karst_engine_world_show_models(karst_engine_world *world, karst_models_as as);
bool karst_engine_world_build_splats(karst_engine_world *world, karst_context *context, karst_error *error);
/* engine_edit.c. Applies a file of edits. Errors: KARST_BAD_DATA, and as karst_engine_edit. */
bool karst_engine_load_edits(karst_engine *engine, const char *path, karst_error *error);
/* engine_layers.c. Makes the layers that an open world's header names, and the engine's edits, part of what the world's
 * producers make. Errors: KARST_BAD_DATA (files that the header names), KARST_USAGE (voxels of another size than the
 * edits'), KARST_FAILED. */
bool karst_engine_world_set_layers(karst_engine *engine, karst_engine_world *world, karst_error *error);
/* engine_edit.c. If the shown world's layers have colours: room for them, and a shader that shows them. Errors:
 * KARST_FAILED. */
bool karst_engine_colour_layers(karst_engine *engine, karst_error *error);
/* engine_change.c. Where a text asks for iTime: that. Returns whether it does. */
bool karst_program_put_time(const karst_program_graph *program, double time_s, karst_number *values);
/* A new engine's time is what a parameter says that iTime is, if any does. Errors: KARST_USAGE. */
bool karst_engine_begin_time(karst_engine *engine, karst_error *error);

/* engine_stores.c. How what fills the air is built; it borrows `finalise`. */
karst_world_build karst_engine_air_build(const karst_cache_buffers *buffers, char finalise[64]);

/* engine_trial.c. Has the device's driver compile what an open world needs, beside the engine's own queue and buffers,
 * from another thread if need be. What is built for that is thrown away; the driver keeps it, and building it again is
 * quick. Errors: KARST_FAILED. */
bool karst_engine_try_world(karst_engine *engine, const karst_engine_world *world, karst_error *error);
/* Runs the shader of tapes once beside the engine, so that it is compiled. */
bool karst_engine_try_tape_colours(karst_engine *engine, karst_error *error);

/* engine_state.c. What is cast from now on has stamps of its own. */
void karst_engine_next_serial(karst_engine *engine);
/* Pixels a voxel may be wide in this frame: what is set, by ladder and pace. */
double karst_engine_detail_px(const karst_engine *engine);
/* Of a store's bricks, those that a settled picture may use. */
uint32_t karst_engine_usable_bricks(const karst_cache_buffers *buffers);

/* engine_stores.c. Says once where the first density of a producer lies that is not finite; `what` it is. */
void karst_engine_report_non_finite(const karst_engine *engine, karst_producer *producer, const char *what,
                                    bool *reported);

/* engine_change.c. Parameters take these values, malloc'ed, which it takes. Nothing is compiled. */
bool karst_engine_take_values(karst_engine *engine, karst_number *values, karst_error *error);

/* engine_create.c. Errors: KARST_USAGE. */
bool karst_engine_check_budget_ms(double budget_ms, karst_error *error);

/* engine_refine.c. Makes what refines hits of an open world; with edits, whose data are set before each use
 * (karst_edits_data). The caller's to finish, zeros on failure. Errors: KARST_BAD_WORLD, KARST_FAILED. */
bool karst_engine_world_make_refining(const karst_engine_world *world, karst_context *context, bool has_edits,
                                      karst_engine_refining *refining, karst_error *error);
void karst_engine_finish_refining(karst_engine_refining *refining);
/* That of its clear matter, for rays; none where its gradient is too large. Errors: KARST_FAILED. */
bool karst_engine_world_build_clear_refiner(karst_engine_world *world, karst_context *context, karst_error *error);
/* After its values or seed changed; does nothing without refiners. Errors: KARST_FAILED. */
bool karst_engine_world_update_refiner(karst_engine_world *world, karst_error *error);
void karst_engine_world_close_refiner(karst_engine_world *world);
/* That of land that mirrors photons; none where its gradient is too large. Errors: KARST_FAILED. */
bool karst_engine_world_build_photon_refiner(karst_engine_world *world, karst_context *context, karst_error *error);
/* A part of such: gradient, layout and data, of any root in a density's place. Errors: KARST_BAD_WORLD,
 * KARST_FAILED. */
bool karst_engine_derive(karst_engine_refining *refining, const karst_engine_world *world,
                         const karst_resolved_world *density, karst_context *context, karst_error *error);
/* Its layout's words anew, for the values in force. Errors: KARST_FAILED. */
bool karst_engine_update_refining(karst_engine_refining *refining, const karst_engine_world *world,
                                  karst_error *error);

/* engine_bend.c. Whether the index of a world's clear matter varies from place to place. */
bool karst_engine_world_bends(const karst_engine_world *world);
/* What follows rays there, after the refiner of clear matter; does nothing where the index does not vary. `fine`: by
 * shorter steps. Errors: KARST_BAD_WORLD, KARST_FAILED. */
bool karst_engine_world_build_bending(karst_engine_world *world, karst_context *context, bool fine,
                                      karst_error *error);
void karst_engine_world_close_bending(karst_engine_world *world);
/* Says once where rays met an index that is none. Errors: KARST_FAILED. */
bool karst_engine_report_index(karst_engine *engine, karst_error *error);

/* engine_picture.c. What follows the picture's size. */
bool karst_engine_check_size(int width_px, int height_px, karst_error *error);
bool karst_engine_check_window(const karst_engine_window *window, int width_px, int height_px, karst_error *error);
/* What changes a picture's size is not for windows. */
bool karst_engine_check_whole(const karst_engine *engine, karst_error *error);
bool karst_engine_allocate_picture(karst_engine *engine, karst_error *error);
void karst_engine_free_picture(karst_engine *engine);
/* engine_depth.c: nothing is drawn before land any more. */
void karst_engine_uncover(karst_engine *engine);
/* Fills stats.num_changed_pixels; only with count_changed_pixels. */
bool karst_engine_count_changed_pixels(karst_engine *engine, karst_error *error);

/* engine_produce.c. Loads the root nodes' bricks if they are missing; answers what the picture's rays asked for (`work`
 * is that first round), then what scouts ask, within the frame's budget; learns from what the frame took, which must
 * have been collected. */
bool karst_engine_load_root(karst_engine *engine, karst_error *error);
bool karst_engine_answer(karst_engine *engine, karst_work *work, karst_error *error);
void karst_engine_learn_cost(karst_engine *engine);
/* Before a picture of paths is drawn that nobody waits for: what its camera's rays lack is made, so that no path starts
 * where one of them ends for want of it. */
bool karst_engine_look_first(karst_engine *engine, karst_error *error);
/* Slopes of bricks made since the last call (karst_caster_survey_slopes); with a budget in ms: a part of them a call.
 * No hit depends on it. */
bool karst_engine_survey_slopes(karst_engine *engine, karst_error *error);
/* engine_round.c. CPU time of all threads over the cores: what things cost a CPU device however busy it is with others.
 */
uint64_t karst_engine_cpu_ns(const karst_engine *engine);
/* Answers and publishes a round's work, of a store (NULL: the land); and enters it in the statistics. */
bool karst_engine_produce(karst_engine *engine, const karst_engine_store *asking, const karst_work *work,
                          uint32_t *num_constant, karst_error *error);
void karst_engine_count_made(karst_engine *engine, const karst_work *work, uint32_t num_constant);
/* One round of collect, produce and publish for what rays wanted with the engine's serial. */
bool karst_engine_answer_round(karst_engine *engine, const karst_position *from, karst_allowance *left,
                               karst_work *work, karst_error *error);

/* The same of a store beside the land, counted, too. */
bool karst_engine_produce_store(karst_engine *engine, karst_engine_store *of, const karst_work *work,
                                karst_error *error);
/* Of a round of any store: how much it may make of what is left, or of a share of that; the CPU time of what was made
 * so far; and what a round's work takes of what is left. */
void karst_engine_limit_round(const karst_engine *engine, const karst_allowance *left, double share,
                              karst_collect_params *params);
uint64_t karst_engine_made_cpu_ns(const karst_engine *engine);
void karst_engine_spend(const karst_engine *engine, const karst_work *work, uint64_t before_ns, karst_allowance *left);

/* engine_stores.c. Which contents a world has, or an engine has stores for: bit i stands for karst_content i. */
unsigned karst_engine_contents_of(const karst_world_file *file);
unsigned karst_engine_contents(const karst_engine *engine);
bool karst_engine_has_content(const karst_engine *engine, int content); /* of the world that is shown */
uint32_t karst_engine_num_contents(unsigned contents);
/* Adds stores of so many bricks for the shown world's contents to the cache. */
bool karst_engine_create_stores(karst_engine *engine, const karst_engine_config *config, uint32_t num_bricks,
                                const char *cast_options, karst_error *error);
void karst_engine_destroy_stores(karst_engine *engine);
/* Producers of the contents that are wished for; their fingerprints with other values (false: out of memory). */
bool karst_engine_world_build_contents(karst_engine_world *world, karst_context *context,
                                       const karst_cache_buffers *buffers, const karst_engine_wishes *wishes,
                                       karst_error *error);
bool karst_engine_world_mark_contents(karst_engine_world *world, const karst_number *values, uint32_t seed);
void karst_engine_world_close_contents(karst_engine_world *world);
/* As karst_density_producer_compile, of all. */
bool karst_engine_compile_contents(karst_engine *engine, uint64_t most_ns, karst_error *error);
/* As karst_producer_answer, of one store's round (NULL: the land's). */
bool karst_engine_answer_stores(karst_engine *engine, const karst_engine_store *asking, const karst_work *work,
                                karst_error *error);
/* What of a round's budget is the land's. */
double karst_engine_land_share(const karst_engine *engine);
/* Whether the last rays used more of a store than a settled picture may; and the fuller one's slots, if it is fuller
 * than these. */
bool karst_engine_stores_overflow(const karst_engine *engine);
void karst_engine_fullest_store(const karst_engine *engine, uint64_t *num_used, uint64_t *num_total);
/* Casts a camera's rays into each store, for what they ask for. */
bool karst_engine_cast_into_stores(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                                   karst_error *error);
/* Which contents of two worlds are not the same; and the stores of such forget all. */
void karst_engine_changed_contents(const karst_engine_world *from, const karst_engine_world *to,
                                   bool changed[KARST_NUM_CONTENTS]);
/* Their producers take other values, and what changes is forgotten. Errors: KARST_FAILED. */
bool karst_engine_set_content_parameters(karst_engine *engine, const karst_number *values, karst_error *error);
bool karst_engine_forget_contents(karst_engine *engine, const bool changed[KARST_NUM_CONTENTS], karst_error *error);
/* Their statistics: before a frame, and after it. */
void karst_engine_begin_store_stats(karst_engine *engine);
void karst_engine_end_store_stats(karst_engine *engine);

/* engine_media.c; all do nothing where the world has no air. How they are shown, once, and how far paths go in them. */
void karst_engine_configure_media(karst_engine *engine, const karst_engine_config *config);
/* Lays media before the sample that was shaded; before what a stream sees that was cast and is not shaded yet; and,
 * once all of these are, makes what light needs to come through what they looked at. */
bool karst_engine_draw_media(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                             const karst_light *light, karst_error *error);
bool karst_engine_veil_stream(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                              const karst_light *light, const karst_media_stream *stream, karst_error *error);
bool karst_engine_survey_media(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                               const karst_light *light, karst_error *error);
/* The picture's rays ask for what they lack of media. */
bool karst_engine_look_at_media(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                                karst_error *error);
/* What paths meet on their way, for a call of karst_paths_follow. `air` must stay where it is. */
typedef struct {
    karst_engine *engine;
    karst_media_picture picture;
    karst_path_media media;
    bool is_there; /* else nothing else is set */
} karst_engine_path_air;
bool karst_engine_media_of_paths(karst_engine *engine, const karst_path_picture *picture, karst_engine_path_air *air,
                                 karst_error *error);
/* The same for rays to lamps from a picture's surfaces, and from what its rays mirror: only what dims them. */
bool karst_engine_media_of_lamps(karst_engine *engine, const karst_path_picture *picture, karst_engine_path_air *air,
                                 karst_error *error);
/* Whether paths may meet media: there is a store of air, and light is full. */
bool karst_engine_has_path_media(const karst_engine *engine);
/* Once a picture is ended: whether its media lacked anything. */
bool karst_engine_end_media(karst_engine *engine, karst_error *error);

/* engine_decide.c. Rounds by rays that are sure, in place of the picture's own, until engine->verdict says whether the
 * ladder's rung fits the pools, or the frame's budget ends; `work` is the last round. */
bool karst_engine_decide(karst_engine *engine, karst_allowance *left, karst_work *work, karst_error *error);
/* Slots that a settled picture may use: of bricks some are kept for loads that come to nothing, as most do. */
void karst_engine_usable_slots(const karst_engine *engine, uint32_t *num_tiles, uint32_t *num_bricks);

/* engine_scout.c. Casts a coarse grid of rays, so many pixels apart, that ask for what a camera's picture needs.
 * `whole`: the one of all pixels, while fewer are drawn; as many rays, between the last ones. */
/* A brick's voxels are half a pixel wide at least, so it is 8 pixels wide where it is seen from the front: scouts are
 * less than that apart, or more. */
#define KARST_SCOUT_PIXELS 7
bool karst_engine_scout(karst_engine *engine, const karst_camera *camera, bool whole, int apart_px, karst_error *error);
uint32_t karst_engine_scout_rays(const karst_engine *engine, int apart_px); /* of a scout */
/* Once a frame, before it is drawn. */
void karst_engine_note_motion(karst_engine *engine);
/* The camera so many frames ahead, by its path or if it goes on as it does; false: it stands, jumps, or goes this way
 * and that. */
bool karst_engine_look_ahead(const karst_engine *engine, int num_frames, karst_camera *ahead);

/* engine_again.c. Casts the camera's rays for what they ask for, before the picture is drawn. */
bool karst_engine_look_at_all(karst_engine *engine, karst_error *error);
/* Casts the parts of the frame's picture that asked for anything once more, to ask for what they lack
 * now; and likewise its shadow rays, as the picture had them. Standing views on CPU devices only. */
bool karst_engine_look_again(karst_engine *engine, karst_error *error);
bool karst_engine_look_at_shadows_again(karst_engine *engine, karst_error *error);

/* engine_bounce.c. What land mirrors, once its picture is shaded and its shadows are cast. */
bool karst_engine_draw_mirrored(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                                const karst_light *light, karst_error *error);
/* Casts the mirrored rays that the picture had once more, for what they ask for; or those from their hits to the sun.
 */
bool karst_engine_look_at_mirrored(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                                   karst_error *error);
bool karst_engine_look_at_mirrored_shadows(karst_engine *engine, const karst_cast_view *view,
                                           const karst_pinhole *pinhole, karst_error *error);

/* engine_looks.c. Paints albedos, openness or bounces over the picture. */
bool karst_engine_paint_values(karst_engine *engine, const karst_pinhole *pinhole, cl_mem pixels, karst_error *error);
/* engine_bounces.c. While bounces are shown, counts the rays of a stream. */
bool karst_engine_count_bounces(karst_engine *engine, const karst_pinhole *pinhole, const karst_bounce_stream *stream,
                                karst_error *error);
/* engine_aov.c. Of what the hits are; three floats a pixel in rows. */
bool karst_engine_read_albedo(karst_engine *engine, float *rgb, karst_error *error);
/* engine_samples.c. Errors: KARST_USAGE. */
bool karst_engine_check_exposure(karst_exposure exposure, double stops, karst_error *error);
/* engine_occlusion.c. Whether a picture of that world has occlusion. */
bool karst_engine_wants_occlusion(const karst_engine_config *config, const karst_world_info *world);
/* The rest does nothing where it has none. What follows the picture's size, and what that takes. */
bool karst_engine_allocate_occlusion(karst_engine *engine, karst_error *error);
double karst_engine_occlusion_bytes(const karst_engine *engine);
/* Of the picture's hits, before they are shaded; what its cones lack now; and as karst_engine_read_aov. */
bool karst_engine_draw_occlusion(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                                 karst_error *error);
bool karst_engine_look_at_occlusion(karst_engine *engine, const karst_cast_view *view, karst_error *error);
bool karst_engine_read_occlusion(karst_engine *engine, float *open, size_t num_values, karst_error *error);
/* engine_openness.c. Likewise: the least, the most, and what it is taken to be, of each pixel. */
bool karst_engine_read_openness(karst_engine *engine, float *values, karst_error *error);

/* engine_paths.c. What of a configuration concerns paths. Errors: KARST_USAGE. */
bool karst_engine_check_paths(const karst_engine_config *config, karst_error *error);
/* In place of shading, shadows and mirrors; or after these, what a world's own lights add to what the picture's rays
 * hit, or those that it mirrors: nothing if it has none. */
bool karst_engine_draw_paths(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                             const karst_light *light, karst_error *error);
bool karst_engine_draw_lights(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                              const karst_light *light, bool mirrored, karst_error *error);
/* Casts those rays once more from where the picture's end, for what they ask for; does nothing without any.
 * only_lacking: of full light only the paths whose pixel lacked something when the picture was drawn. */
bool karst_engine_look_at_paths(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                                bool only_lacking, karst_error *error);
/* Likewise from where mirrored rays end. */
bool karst_engine_look_at_mirrored_lights(karst_engine *engine, const karst_cast_view *view,
                                          const karst_pinhole *pinhole, karst_error *error);

/* What there is to be followed of the picture at hand; `again`: for what it asks for. */
karst_path_picture karst_engine_path_picture(const karst_engine *engine, const karst_cast_view *view,
                                             const karst_pinhole *pinhole, const karst_light *light, bool again);
/* engine_lamps.c. The world's own lights, after `num` that are there; and with the sun, if it shines, before them. */
uint32_t karst_engine_own_lamps(const karst_engine *engine, karst_lamp lamps[KARST_MOST_LAMPS], uint32_t num);
uint32_t karst_engine_lamps(const karst_engine *engine, const karst_light *light, karst_lamp lamps[KARST_MOST_LAMPS]);
/* Whether a place is in clear matter, by the text's own density, and what that absorbs per metre. */
bool karst_engine_is_in_clear(const karst_engine *engine, const karst_position *at, float absorption_per_m[3]);
/* engine_paths.c. What a world's own lights, and photons, add to what a stream's rays hit. */
bool karst_engine_draw_lights_of(karst_engine *engine, const karst_path_picture *picture, const karst_buffer *rays,
                                 const karst_buffer *count, const karst_buffer *hits, karst_error *error);

/* engine_light_map.c. Whether pictures of the world are to have one; what its header names; and what that adds to what
 * a stream's rays hit, as karst_engine_gather_photons. Errors: KARST_BAD_DATA, KARST_FAILED. */
bool karst_engine_wants_light_map(const karst_engine_config *config, const karst_world_info *world);
bool karst_engine_world_open_light_map(karst_engine_world *world, karst_context *context, karst_error *error);
bool karst_engine_gather_light_map(karst_engine *engine, const karst_path_picture *picture, const karst_buffer *rays,
                                   const karst_buffer *count, const karst_buffer *hits, karst_error *error);

/* engine_photons.c. What of a configuration concerns caustics. Errors: KARST_USAGE. */
bool karst_engine_check_caustics(const karst_engine_config *config, karst_error *error);
/* Whether the world has what makes them, and the engine has photons. Where it has, light that is not looked for by
 * photons does not pass clear matter. */
bool karst_engine_wants_caustics(const karst_engine_config *config, const karst_world_info *world);
bool karst_engine_has_caustics(const karst_engine *engine);
/* Makes them if they are asked for; says why not. Errors: KARST_FAILED. */
bool karst_engine_create_photons(karst_engine *engine, const karst_engine_config *config, karst_error *error);
/* They are to be traced anew. */
void karst_engine_forget_photons(karst_engine *engine);
/* Likewise, in the same view with other detail; but the first stage is seen before. */
void karst_engine_change_detail_of_photons(karst_engine *engine);
/* Before a picture is shaded: traces some more of the view, or what they ask for. */
bool karst_engine_trace_photons(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                                karst_error *error);
/* Once more, for what they ask for. */
bool karst_engine_look_at_photons(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                                  karst_error *error);
/* After a frame: those that were traced in it are kept if it lacked nothing. Returns whether it is complete. */
bool karst_engine_end_photons(karst_engine *engine, bool lacks_nothing);
/* Adds them to what rays hit (rays NULL: the picture's own). */
bool karst_engine_gather_photons(karst_engine *engine, const karst_path_picture *picture, const karst_buffer *rays,
                                 const karst_buffer *count, const karst_buffer *hits, karst_error *error);

/* engine_pass.c. Whether land of the world lets light pass in such pictures: --mirror 0 leaves that out, too. */
bool karst_engine_wants_pass(const karst_engine_config *config, const karst_world_info *world);
/* What follows the picture's size, and what that takes; nothing where nothing passes. Errors: KARST_FAILED. */
bool karst_engine_allocate_pass(karst_engine *engine, karst_error *error);
double karst_engine_pass_bytes(const karst_engine *engine);
/* *picture is what passes of a picture, all of it borrowed; NULL: nothing does. */
const karst_pass_picture *karst_engine_pass_picture(const karst_engine *engine, const karst_cast_view *view,
                                                    const karst_pinhole *pinhole, const karst_light *light,
                                                    karst_pass_picture *picture);
/* After shadows were cast: adds what of the sun comes through land that hides it. Waits. Errors: KARST_FAILED. */
bool karst_engine_pass_sun(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                           const karst_light *light, karst_error *error);

/* engine_clear.c. What runs at surfaces of clear matter; a part of karst_engine_world_build. */
bool karst_engine_world_build_clear(karst_engine_world *world, karst_context *context,
                                    const karst_engine_wishes *wishes, karst_error *error);
/* As karst_clear_cast_camera, karst_clear_cover and karst_clear_trace; nothing is done where there is no clear matter.
 */
bool karst_engine_cast_into_clear(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                                  bool keeps, karst_error *error);
bool karst_engine_cover_by_clear(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                                 const karst_light *light, karst_error *error);
/* Rays are followed for a picture; once more for what they ask for; or only those of pixels whose rays lacked something
 * when they were followed last. */
typedef enum { KARST_FOLLOW_TO_DRAW, KARST_FOLLOW_AGAIN, KARST_FOLLOW_LACKING } karst_follow;
bool karst_engine_trace_clear(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                              karst_follow follow, karst_error *error);

/* engine_samples.c. Which sample of its pixels the next frame draws; 0: their centres, once, while something moves. */
uint32_t karst_engine_choose_sample(const karst_engine *engine, bool moves);
/* Shows what shading left of a sample, and those before it. */
bool karst_engine_show_radiance(karst_engine *engine, cl_mem pixels, karst_error *error);
/* After a frame that lacked nothing, if `complete`: adds its sample, until there are enough. Else, where the picture's
 * detail changed, its samples begin anew. */
bool karst_engine_end_sample(karst_engine *engine, bool complete, bool detail_changed, karst_error *error);

/* None is summed but those that were given of this view; `view_changed`: it is another one. */
bool karst_engine_restart_samples(karst_engine *engine, bool view_changed, karst_error *error);
/* The sum of its samples, not the mean: as karst_engine_read_radiance, of a frame that was drawn. */
bool karst_engine_read_sums(karst_engine *engine, float *rgb, karst_error *error);
/* Before what shading left of a sample is overwritten, or its light read. */
bool karst_engine_keep_sample(karst_engine *engine, karst_error *error);

/* engine_draw.c. Sun, haze and sky; what the picture's rays see; casting and shading it into the display, which is only
 * enqueued; and waiting for that, showing it and filling the statistics of its hits: does nothing if that is done. Also
 * after a failure the picture must be ended. */
karst_light karst_engine_light(const karst_engine *engine);
bool karst_engine_check_sun(const karst_sun *sun, karst_error *error);
/* Before a picture: its sky, if the world has an atmosphere. */
bool karst_engine_aim_skies(karst_engine *engine, karst_error *error);
/* Moves the hits to the true density, where that is wished for. */
bool karst_engine_refine(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                         karst_error *error);
bool karst_engine_refine_hits(karst_engine *engine, const karst_cast_view *view, const karst_pinhole *pinhole,
                              karst_buffer *hits, karst_error *error);
/* engine_rays.c */
void karst_engine_destroy_streams(karst_engine *engine);
/* engine_aov.c. Casts the last frame's rays through the pixels' centres, if they went elsewhere. */
bool karst_engine_centre_hits(karst_engine *engine, karst_error *error);
/* The camera's rays through the picture's pixels, which may be a window of a whole picture's. */
void karst_engine_pinhole(const karst_engine *engine, const karst_camera *camera, karst_pinhole *pinhole);
void karst_engine_picture_view(const karst_engine *engine, karst_cast_view *view, karst_pinhole *pinhole);
bool karst_engine_draw(karst_engine *engine, karst_error *error);
bool karst_engine_end_picture(karst_engine *engine, karst_error *error);

#endif
