/* The header of a world file: the JSON in its first comment. */
#ifndef KARST_LANGUAGE_HEADER_H
#define KARST_LANGUAGE_HEADER_H

#include "core/files/samples.h"
#include "producers/language/base/number.h"
#include "producers/language/base/source.h"
#include "producers/language/image/image.h"

#define KARST_HEADER_MAX_PARAMETERS 64u
#define KARST_HEADER_MAX_DATA 16u

/* A file of samples that functions of the text look up by its name. */
typedef struct {
    const char *name, *file; /* file: as the header has it */
    const char *grid;        /* of a field; NULL: the first */
    double size_m[2];        /* that all samples together take along each axis; 0: not said */
    karst_samples_form form;
    karst_wrap wrap; /* clamp */
    uint32_t where;
} karst_header_data;

typedef struct {
    const char *name;
    karst_number value;
    double min, max, step;    /* -DBL_MAX, DBL_MAX, 0 where the header is silent */
    const char *unit, *label; /* never NULL */
    uint32_t where;
    bool is_named; /* by particles */
} karst_header_parameter;

#define KARST_HEADER_MAX_MODELS 256u

/* What a model is made of; where nothing is given, it is what the text says. */
typedef struct {
    bool has_colour, has_mirror, has_gloss, has_emission; /* of land */
    bool has_ior, has_absorption;                         /* of clear matter */
    double colour[3], mirror, gloss, emission[3], ior, absorption[3];
} karst_header_material;

/* A model made of points (docs/POINTS.md). */
typedef struct {
    const char *points; /* an imported file, as the header has it */
    const char *at[3];  /* of its centre: decimal text, metres; "0" */
    double turn_deg[3]; /* about x, then y, then z; 0 */
    double scale;       /* 1 */
    bool is_clear;      /* clear matter, and not land */
    karst_header_material material;
    bool is_splats;     /* shown as discs, not as a surface */
    bool is_shallow;    /* of discs: those of one leaf are blended, not of all that a ray meets there */
    bool has_backs;     /* of discs: backs are seen, too */
    bool culls;         /* of discs: copies that no probe ray needs are left out */
} karst_header_model;

/* A number, or the name of a parameter that has it. */
typedef struct {
    double value;
    const char *parameter; /* NULL: the value */
} karst_header_number;

#define KARST_HEADER_MAX_PARTICLES 64u
typedef enum { KARST_HEADER_BALL, KARST_HEADER_BOX, KARST_HEADER_DISC, KARST_NUM_HEADER_EMITTERS } karst_header_emitter;

/* A group of particles (docs/WORLDS.md): a file of them, or an emitter. Lengths in metres, times in seconds. */
typedef struct {
    const char *file; /* as the header has it; NULL: an emitter */
    bool is_sum;
    const char *at[3]; /* decimal text; "0" */
    karst_header_emitter emitter;
    double size[3], velocity[3], spread, stray, life, fade; /* 1, 1, 1; 0; 1; 0 */
    karst_header_number count, radius[2], extinction;       /* 100; 0.5; 1 */
    uint32_t seed;                                           /* 0 */
} karst_header_particles;

/* All optional; has_ fields say what was given, everything else holds its default. Strings are never NULL and live in
 * the source's arena. */
#define KARST_HEADER_MAX_LIGHTS 16u
#define KARST_HEADER_MAX_SHADOWS 8u /* lights that cast shadows */
typedef enum {
    KARST_HEADER_SUN,
    KARST_HEADER_POINT,
    KARST_HEADER_SPOT,
    KARST_NUM_HEADER_LIGHTS
} karst_header_light_kind;
/* A light beside the sun: another sun, a ball that shines all around, or in a cone. */
typedef struct {
    karst_header_light_kind kind;
    double colour[3];                         /* linear RGB, of a white surface that faces it, 1 m away but of suns */
    const char *position[3];                  /* decimal text, metres; "0" */
    double azimuth_deg, elevation_deg;        /* where a sun stands, or a spot shines; 0, 40; -90 */
    double size_deg, radius_m, angle_deg, soft; /* 0.53; 0.05; 40; 0.25 */
    bool shadow;                              /* it casts one */
} karst_header_light;

typedef struct {
    bool is_given; /* there is a header */
    bool leaves_view; /* it says something, and nothing of where things are or how large: the view may be guessed */
    const char *name, *author, *description;
    uint32_t seed;    /* 0 */
    int voxel_log2_m;    /* a voxel of level 0 is 2^this metres wide */
    int exact_above_log2; /* floats do for what is right to a voxel 2^this times as wide: 0 where the header has one */
    bool has_extent;
    double extent_m; /* how far from the origin the world means something */
    bool has_lipschitz;
    double lipschitz; /* declared: |density(a) - density(b)| <= lipschitz * |a - b| */
    bool has_camera;
    const char *camera_position[3];                          /* decimal text, metres; "0" */
    double camera_yaw_deg, camera_pitch_deg, camera_fov_deg; /* 0, 0, 60 */
    bool has_sun;
    double sun_azimuth_deg, sun_elevation_deg; /* 135, 40 */
    bool has_sun_colour;
    double sun_colour[3]; /* linear RGB */
    uint32_t num_lights;
    karst_header_light lights[KARST_HEADER_MAX_LIGHTS];
    bool has_sky;
    double sky_zenith[3], sky_horizon[3], haze_distance_m; /* linear RGB; 0: no haze */
    double haze_height_m, haze_globe_m;                    /* 0: not said */
    bool has_atmosphere;
    double dust; /* how dusty its air is; 1 */
    bool has_exposure;
    double exposure_stops; /* of pictures */
    bool has_occlusion;    /* what stands around surfaces hides light from all around */
    const char *light_map; /* a PLY of what light falls on surfaces (raycast/light/light_map.h); NULL: none */
    double light_reach_m;  /* how far its points count, if it does not say; 0: not said */
    double mirror;         /* the share of light that land mirrors, 0 to 1 */
    double view_distance_m;                                /* 0: not said */
    uint32_t num_models;
    karst_header_model *models; /* in the source's arena */
    uint32_t num_particles;
    const karst_header_particles *particles; /* in the source's arena */
    uint32_t num_parameters;
    karst_header_parameter parameters[KARST_HEADER_MAX_PARAMETERS];
    uint32_t num_data;
    karst_header_data data[KARST_HEADER_MAX_DATA];
} karst_world_header;

/* Reads the header if the user's text begins with a comment that holds an object ("/" "*{ ... }*" "/"). Unknown keys
 * are warned about; wrong types and values out of range are errors at their line. */
void karst_header_read(karst_source *source, karst_world_header *header);

#endif
