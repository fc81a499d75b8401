/* The engine: a world, a device, a display and the two pools, tied together frame by frame. */
#ifndef KARST_ENGINE_H
#define KARST_ENGINE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "karst/camera.h"
#include "karst/display.h"
#include "karst/error.h"
#include "karst/helper.h"
#include "karst/log.h"
#include "karst/stats.h"
#include "karst/world.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct karst_engine karst_engine;

#define KARST_ENGINE_MAX_SAMPLES 4096
#define KARST_ENGINE_MAX_EXPOSURE 20 /* stops, either way */

/* How linear light becomes bytes. */
typedef enum {
    KARST_TONE_OF_PLAIN, /* each channel by a film's curve; bright colours go pale */
    KARST_TONE_OF_FILM,  /* the strongest channel by that curve, the others in proportion: colours keep their hue */
    KARST_NUM_TONES
} karst_tone;
/* What light does in what fills the space outside matter, in worlds that say so (`medium air(vec3 p)`). */
typedef enum {
    KARST_MEDIA_MODE_FULL,   /* it is lost on its way from the sun; land shadows media, and media shadow land */
    KARST_MEDIA_MODE_SHADOW, /* it is lost on its way through the medium, and land knows nothing of that */
    KARST_MEDIA_MODE_BASIC,  /* the sun shines everywhere in it as if nothing were there */
    KARST_NUM_MEDIA_MODES
} karst_media_mode;
/* "full", "shadow", "basic". Errors: KARST_USAGE listing the names. Thread-safe. */
bool karst_media_mode_parse(const char *name, karst_media_mode *mode, karst_error *error);
/* How often such media scatter light on its way to the eye. */
typedef enum {
    KARST_SCATTERING_OCTAVES, /* once as it is, and more often by three octaves of that, which cost next to nothing */
    KARST_SCATTERING_ONCE,    /* once: what is scattered more often is lost */
    KARST_SCATTERING_PATHS,   /* as often as it is: by a path through the medium for each sample, whose mean tends to
                               * the truth. Land hides the sun from paths, and stands in the way of none */
    KARST_SCATTERING_FLUENCE, /* the same, from a coarse grid: a million packets of light are followed through the
                               * medium once, and again when light or medium change; pictures add what they left to
                               * what is scattered once. Without noise, and blurred where a medium is thick within a
                               * cell of the grid; with KARST_MEDIA_MODE_BASIC as KARST_SCATTERING_ONCE */
    KARST_NUM_SCATTERINGS
} karst_scattering;
/* "octaves", "once", "paths", "fluence". Errors: KARST_USAGE listing the names. Thread-safe. */
bool karst_scattering_parse(const char *name, karst_scattering *scattering, karst_error *error);
/* How bright pictures are. */
typedef enum {
    KARST_EXPOSURE_OF_WORLD,   /* what its header says, else that of the picture; of KARST_TONE_OF_PLAIN 0 stops */
    KARST_EXPOSURE_OF_PICTURE, /* goes half the way to where the picture's median luminance is a usual one */
    KARST_EXPOSURE_GIVEN,
    KARST_NUM_EXPOSURES
} karst_exposure;
/* "plain", "filmic". Errors: KARST_USAGE listing the names. Thread-safe. */
bool karst_tone_parse(const char *name, karst_tone *tone, karst_error *error);

/* What light does in pictures. */
typedef enum {
    KARST_INTEGRATOR_DIRECT, /* sun, sky and mirrors, each by a rule of its own: what one sample shows well */
    KARST_INTEGRATOR_FULL,   /* from surface to surface, as it is: paths by chance, whose mean over samples tends to the
                              * truth. See docs/LIGHT.md */
    KARST_NUM_INTEGRATORS
} karst_integrator;
/* "direct", "full". Errors: KARST_USAGE listing the names. Thread-safe. */
bool karst_integrator_parse(const char *name, karst_integrator *integrator, karst_error *error);

#define KARST_ENGINE_MAX_BOUNCES 1024
#define KARST_ENGINE_DEFAULT_BOUNCES 64 /* of KARST_INTEGRATOR_FULL */
#define KARST_ENGINE_MAX_PHOTONS 16777216

/* Whether what stands around a surface hides the light from all around, in KARST_INTEGRATOR_DIRECT. */
typedef enum {
    KARST_OCCLUSION_OF_WORLD, /* as the world says: "occlusion" in its header; without it, not */
    KARST_OCCLUSION_ON,
    KARST_OCCLUSION_OFF,
    KARST_NUM_OCCLUSIONS
} karst_occlusion_mode;

/* How models made of points are shown (docs/POINTS.md). */
typedef enum {
    KARST_MODELS_OF_WORLD,       /* each as the world says */
    KARST_MODELS_SURFACE,        /* all as surfaces of the land */
    KARST_MODELS_SPLATS,          /* all as discs, blended across leaves */
    KARST_MODELS_SPLATS_CULLED,   /* the same without copies in leaves that no probe ray needs */
    KARST_MODELS_SPLATS_LEAF,     /* as discs, each leaf blended for itself */
    KARST_MODELS_SPLATS_LEAF_CULLED,
    KARST_MODELS_NONE,            /* none is shown: the world without them */
    KARST_NUM_MODELS_AS
} karst_models_as;

/* Where the sun stands: a compass bearing, and how high, in degrees. */
typedef struct {
    double azimuth_deg, elevation_deg;
} karst_sun;

/* Which part of a picture is drawn: pixels of a whole picture of whole_width_px x whole_height_px (each 1 to 16384),
 * from its pixel (x0_px, y0_px), counted from its upper left corner. The camera is the whole's. A settled window has
 * the bits of that part of the settled whole (colours, radiance, every karst_aov) where both have all the detail that
 * is asked for (karst_stats: detail_given_px is detail_asked_px), and the exposure does not follow the picture, whose
 * median the window has not (karst_engine_meter). Of what mirrors or is clear that holds but for the window's outermost
 * pixels, whose neighbours outside say how much it is curved: draw a window that is KARST_ENGINE_WINDOW_MARGIN_PX wider
 * on each side that is not the whole's. All zeros: what is drawn is the whole. */
#define KARST_ENGINE_WINDOW_MARGIN_PX 1
typedef struct {
    int whole_width_px, whole_height_px;
    int x0_px, y0_px;
} karst_engine_window;

/* How to make an engine. Zero-initialised fields mean the default that stands beside them. */
typedef struct {
    const char *world; /* name of a shipped world, such as "hills", or the path of a world file: what holds a '/' or
                        * ends in ".karst"; required */
    const karst_parameter *parameters; /* borrowed during creation; only for world files; clamped to their ranges */
    size_t num_parameters;
    const char *device; /* see `karst info`: number, part of a name, "cpu", "gpu"; NULL: first GPU, else first CPU */
    karst_display_kind display; /* KARST_DISPLAY_AUTO */
    karst_display
        *in_display; /* an existing display to draw in (borrowed; outlives the engine); NULL: make one of `display` */
    int width_px, height_px;        /* 1280 x 720; each 1 to 16384 */
    karst_engine_window window;     /* of a larger picture; zeros: width_px x height_px are the whole */
    uint64_t pool_bytes;            /* both pools together; 512 MiB */
    uint32_t num_tiles, num_bricks; /* instead of pool_bytes, slots counted by hand (tests); 0: from pool_bytes */
    size_t
        max_segment_bytes; /* cut the brick pool in allocations of at most this many bytes; 0: what the device allows */
    int brick_bits; /* of a density sample in memory: 8, 16 or 32 (floats); 0: 16. See docs/ACCURACY.md */
    double safe_steps; /* how far rays leap through air, as a factor on what a brick's slopes prove to be empty; 0: 1.0;
                        * below 0: not at all, cell by cell; above 1 (to 16): farther than proven, past thin things */
    double detail_px;      /* pixels a voxel may be wide; 1.0; 0.25 to 64 */
    /* Where rays end; 0: what the world says. Where that is farther, haze that does not thin with height goes along:
     * twice as far, half as thick. */
    double view_distance_m;
    uint32_t budget_bricks; /* bricks (and tiles) produced in a frame at most; 4096 */
    double budget_ms; /* and at most what is expected to take so long on the device, from what the last ones took; 0: no
                       * clock, which alone makes unsettled pictures reproducible; to 60000 */
    bool has_seed;
    uint32_t seed;             /* instead of the world's own */
    karst_thin thin; /* KARST_THIN_AUTO; what is told of it in karst_stats is 0 where it is not shown */
    bool no_shadows;           /* leave out the second stream of rays, and its kernels */
    bool no_blend;             /* levels of detail change at once, not gradually: a little faster, but detail pops */
    bool no_beam;              /* each packet of rays looks for its way alone: slower, and the same in every bit */
    bool count_changed_pixels; /* fill karst_stats.num_changed_pixels: costs a read-back a frame */
    bool refine; /* move each hit from the bricks' surface to the true density's, with its exact gradient as normal;
                  * only for world files. Costs a few evaluations of the density for each pixel */
    /* Rays for each pixel of a settled picture, spread over the pixel and the sun's disc; 1; to
     * KARST_ENGINE_MAX_SAMPLES. Each frame draws one of them until all are complete. With more than one, and without a
     * budget in ms, the sun is 0.53 degrees wide, and shadows are soft; with such a budget the first frame of a view
     * goes through the pixels' centres. */
    uint32_t samples;
    karst_tone tone; /* KARST_TONE_OF_PLAIN */
    karst_exposure exposure; /* KARST_EXPOSURE_OF_WORLD */
    double exposure_stops; /* KARST_EXPOSURE_GIVEN: each is twice as bright; up and down to KARST_ENGINE_MAX_EXPOSURE */
    karst_media_mode media; /* KARST_MEDIA_MODE_FULL */
    karst_scattering scattering; /* KARST_SCATTERING_OCTAVES */
    /* The share of light that land mirrors, 0 to 1: it goes to one mirrored ray for each pixel, and the rest is land as
     * it is without. 0: what the world says when the engine is made; below 0: none. Without any nothing is spent on it.
     */
    double mirror;
    /* KARST_OCCLUSION_OF_WORLD. One more ray for 32 pixels; what is seen in mirrors and through clear matter is
     * as without. KARST_INTEGRATOR_FULL has no use for it. */
    karst_occlusion_mode occlusion;
    karst_integrator integrator; /* KARST_INTEGRATOR_DIRECT; the other one takes no no_shadows */
    /* Of KARST_INTEGRATOR_FULL: how often a path leaves a surface, or a place where a medium scattered it, at most; 0:
     * KARST_ENGINE_DEFAULT_BOUNCES, beyond which hardly any light is left, and KARST_ENGINE_MAX_BOUNCES where the world
     * has a medium. Without: surfaces of clear matter (`float clear(vec3 p)` of a world) that light may
     * meet after the first; 0: 6. What would meet more sees what lies straight behind, and is counted
     * (karst_stats.num_rays_cut). At most KARST_ENGINE_MAX_BOUNCES. */
    uint32_t bounces;
    /* Photons from all lights with shadows, whose light lands by way of mirrors and clear matter and makes caustics; up
     * to KARST_ENGINE_MAX_PHOTONS, some 100 MiB for each half a million. 0: none, and light passes clear matter
     * straight. A world where nothing makes caustics is shown as without, with a warning. A frame traces some of them;
     * a settled picture has all. `bounces`, if not 0, is also how many surfaces each may turn at; else 12. Only with
     * KARST_INTEGRATOR_DIRECT, and with shadows. */
    uint32_t caustics;
    /* Pictures are of the light that falls on land, not of what it looks like: radiance is how bright a white surface
     * would be there, by light from all around, the sky's and what surfaces throw back and glow; without that of lamps
     * and suns on the surface itself. Only with KARST_INTEGRATOR_FULL. All samples go through the pixels' centres.
     * Where no land is seen, or clear matter before it, radiance is -1. `karst bake` makes light maps of this. */
    bool irradiance;
    bool has_sun;
    karst_sun sun;     /* instead of the world's own */
    const char *edits; /* path of a file of edits (karst/edit.h), or of a saved world (karst/saved.h) whose edits the
                        * world is shown with; NULL: none */
    karst_helper *helper; /* a second process that shares the compiling (karst/helper.h); borrowed, outlives the engine;
                           * NULL: none */
    int lanes;                 /* 0: what suits the device; 1 or 16 */
    karst_models_as models;    /* KARST_MODELS_OF_WORLD; also of worlds that are shown later */
    const karst_log *log;      /* borrowed, outlives the engine; NULL: silent */
} karst_engine_config;

/* Opens device and display, allocates the pools (their memory is fixed from here on), builds the kernels.
 * Errors: KARST_USAGE (a field out of range; an unknown world is KARST_BAD_WORLD and lists the known ones, a world file
 * that does not compile is KARST_BAD_WORLD with file, line and column, and the log has the line itself with a caret;
 * pools too small for any picture: the message says what would do), KARST_BAD_DATA (the file of edits: which, and what
 * is wrong with it), KARST_NO_DEVICE, KARST_FAILED. Use an engine from
 * one thread at a time. */
karst_engine *karst_engine_create(const karst_engine_config *config, karst_error *error);
void karst_engine_destroy(karst_engine *engine); /* NULL is fine */

/* What the engine draws in: its own, or in_display. Borrowed, for its kind and description; lives as long as the engine
 * (in_display: as its owner says). */
const karst_display *karst_engine_display(const karst_engine *engine);
/* log2 of the width of a level-0 voxel in metres: what positions of this engine count in. */
int karst_engine_voxel_log2_m(const karst_engine *engine);
/* The world's own camera, and the one in use. */
karst_camera karst_engine_default_camera(const karst_engine *engine);
karst_camera karst_engine_camera(const karst_engine *engine);
/* Takes effect with the next frame. Errors: KARST_USAGE (not finite, or beyond 2^61 voxels). */
bool karst_engine_set_camera(karst_engine *engine, const karst_camera *camera, karst_error *error);
/* Where the sun stands: as it was put last, or as the world says. */
karst_sun karst_engine_get_sun(const karst_engine *engine);
/* Whether it was put there, by karst_engine_set_sun or the configuration. */
bool karst_engine_has_own_sun(const karst_engine *engine);
/* Takes effect with the next frame, and stays when another world is shown; NULL: as the world says. Errors: KARST_USAGE
 * (azimuth not within 36000 degrees of 0, or elevation not within 90). */
bool karst_engine_set_sun(karst_engine *engine, const karst_sun *sun, karst_error *error);
/* How bright pictures are made of their light: as configured, or as it was set last. *stops: what counts of
 * KARST_EXPOSURE_GIVEN; NULL is fine. */
karst_exposure karst_engine_get_exposure(const karst_engine *engine, double *stops);
/* Takes effect with the next frame, stays when another world is shown, and begins no picture anew: samples are light.
 * stops: of KARST_EXPOSURE_GIVEN, up and down to KARST_ENGINE_MAX_EXPOSURE. Errors: KARST_USAGE (no such exposure,
 * stops out of range, or an engine of one sample and plain tone, which keeps bytes, not light). */
bool karst_engine_set_exposure(karst_engine *engine, karst_exposure exposure, double stops, karst_error *error);
/* Takes effect with the next frame. Errors: KARST_USAGE (a side out of range, or the engine draws a window),
 * KARST_FAILED (no memory for it). */
bool karst_engine_set_size(karst_engine *engine, int width_px, int height_px, karst_error *error);

/* Draws another window, of this or another whole, from the next frame on; zeros: a whole of that size. One of the same
 * size costs no more than another camera: so a picture of any size is drawn by parts in the memory of one of them.
 * Errors: KARST_USAGE (a side out of range, not within the whole), KARST_FAILED (no memory for it). */
bool karst_engine_set_window(karst_engine *engine, const karst_engine_window *window, int width_px, int height_px,
                             karst_error *error);

/* One frame: cast, shade, display; collect, produce within the budget, publish. Errors: KARST_FAILED. */
bool karst_engine_frame(karst_engine *engine, karst_error *error);
/* Frames until settled, at most max_frames (0: 1000), as for somebody who waits for the last: without a budget in ms
 * each may produce four times budget_bricks. `progress` (may be NULL) is called after each frame; returning false ends
 * the loop. *settled says how it ended. Errors: KARST_FAILED. */
bool karst_engine_settle(karst_engine *engine, uint32_t max_frames,
                         bool (*progress)(void *user, const karst_stats *stats), void *user, bool *settled,
                         karst_error *error);

/* The last frame's picture: 8-bit RGBA, top row first, width * height * 4 bytes into the caller's memory. Errors:
 * KARST_USAGE (no frame has been drawn yet; another size), KARST_FAILED. */
bool karst_engine_read_pixels(karst_engine *engine, uint8_t *rgba, size_t size_bytes, karst_error *error);
/* The last frame's light, before exposure and tone: linear red, green and blue, the mean of its samples so far; three
 * floats a pixel, top row first. Errors: KARST_USAGE (another number of values; no frame has been drawn yet; an engine
 * of one sample and plain tone with the world's exposure, which keeps bytes only), KARST_FAILED. */
bool karst_engine_read_radiance(karst_engine *engine, float *rgb, size_t num_values, karst_error *error);
/* Whether karst_engine_read_radiance works. */
bool karst_engine_keeps_radiance(const karst_engine *engine);
/* Exposure and tone of light that was read before, such as rows of a picture that is drawn in windows: first all of it
 * is metered, part by part, in any order, with no frame between; then karst_engine_tone gives the bytes that the engine
 * would give as one picture, for any part: width_px x height_px pixels whose first is (x0_px, y0_px) of that picture,
 * three floats each in `rgb`, RGBA in `rgba`. What has not been metered needs not be where the exposure does not follow
 * the picture (karst_engine_config.exposure). The first karst_engine_meter after a karst_engine_tone begins another
 * picture. Parts may have as many pixels as the engine's picture. Samples of the view that it drew are lost. Errors:
 * KARST_USAGE (more pixels than there is room for; more than 2^32 - 1 in all; an engine that keeps bytes only; nothing
 * was metered, and something should), KARST_FAILED. */
bool karst_engine_meter(karst_engine *engine, const float *rgb, int width_px, int height_px, karst_error *error);
bool karst_engine_tone(karst_engine *engine, const float *rgb, int x0_px, int y0_px, int width_px, int height_px,
                       uint8_t *rgba, karst_error *error);
/* The picture goes on after samples that were taken before, of the same view by the same settings: `rgb` is
 * KARST_AOV_SUMS of that picture, of num_samples samples, copied. Call it when camera, sun and all else are set: with
 * the next change of the view they are forgotten. Settled, it has the bits of one whose samples were taken in one go.
 * Errors: KARST_USAGE (another number of values than 3 * width * height; num_samples not 1 to the engine's samples - 1;
 * an engine that keeps bytes only), KARST_FAILED (memory). */
bool karst_engine_set_sums(karst_engine *engine, const float *rgb, size_t num_values, uint32_t num_samples,
                           karst_error *error);
/* The last frame's depth, of the rays of its last sample: metres along each ray's direction to the hit, INFINITY where
 * there is none; width * height floats. Errors: KARST_USAGE (no frame has been drawn yet, too few values),
 * KARST_FAILED. */
bool karst_engine_read_depth(karst_engine *engine, float *depth_m, size_t num_values, karst_error *error);

/* Statistics of the last frame, copied out. */
void karst_engine_stats(const karst_engine *engine, karst_stats *stats);

/* Debug pass over the pools: every reference is valid and mutual, nothing leaks, there is no cycle. Errors:
 * KARST_FAILED, naming the first fault. */
bool karst_engine_check(karst_engine *engine, karst_error *error);

/* Text for people: devices, displays and limits, line by line through `print`; says how to mend what is missing. Opens
 * and closes each display on this thread: call it where no OpenGL context of yours is current. */
void karst_info(void (*print)(void *user, const char *line), void *user);
/* The same for programs: one JSON object, malloc'ed; NULL: out of memory. */
char *karst_info_json(void);
const char *karst_version(void);

#ifdef __cplusplus
}
#endif
#endif
