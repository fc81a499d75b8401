/* Clear matter: what a picture's rays that meet it become, surface by surface.
 *
 * Clear matter lies in a store of its own, so each ray is cast twice: into the land and into clear matter. The nearer
 * hit counts; land where both are met at once. What a surface of clear matter does follows from Fresnel's equations and
 * Snell's law, exactly, and what is lost on a way inside from Beer's and Lambert's (raycast/light/dielectric.clh).
 *
 * From the first surface both rays go on, as two branches, each a stream with one ray a pixel at most: first all that
 * was reflected (and what land mirrors), then all that was refracted. From each later surface one ray goes on, with all
 * of the light: of a picture of samples the one that a hash of pixel, sample, branch and bounce chooses, reflected as
 * often as light is; of pixels' centres by the bounce alone, the first time the one of which more is. So streams never
 * grow, nothing is lost or added, and what a picture shows depends on its samples alone. Total reflection is no choice.
 *
 * Surfaces and normals are those of the true density where its gradient is at hand (raycast/cast/refine.h): what 16
 * bits leave of a brick's would turn rays by 3e-4 rad, and more at coarse levels.
 *
 * Land that lets light pass (raycast/light/pass.h) makes a third branch of what lies straight behind the first surface;
 * at later ones the share that passes goes on, and the rest of the ray ends there.
 *
 * What is approximate: without photons (raycast/light/photons.h) the sun reaches what lies in or behind clear matter
 * straight, as if that were not there; haze is taken to lie in clear matter, too, between the surfaces that rays meet
 * there; rays that are cut off see what lies straight behind, land or the sky, as if clear matter ended there: the sky
 * alone would be specks in reflections that meet one wave after another.
 *
 * Streams are made as those of bounces are (raycast/light/bounce.h): in order, without gaps, by prefix sums. */
#ifndef KARST_RAYCAST_CLEAR_H
#define KARST_RAYCAST_CLEAR_H

#include "raycast/cast/refine.h"
#include "raycast/light/bend.h"
#include "raycast/light/bounce.h"
#include "raycast/light/clear_shared.h"
#include "raycast/light/pass.h"

typedef struct karst_clear karst_clear;
typedef struct karst_clear_shader karst_clear_shader;

/* What clear shaders are built for: an atmosphere, as KARST_SHADE_ATMOSPHERE; an index that varies inside, whose
 * pictures come with a bender; land that lets light pass, whose pictures come with a pass. */
#define KARST_CLEAR_ATMOSPHERE 1u
#define KARST_CLEAR_BENDS 2u
#define KARST_CLEAR_PASSES 4u

/* What runs at the surfaces of a world's clear matter: `surface` is as for shaders, with WORLD_OUTPUT_IOR and
 * WORLD_OUTPUT_ABSORPTION (per metre) where its text says them; NULL: ior 1.33, no absorption. ways: KARST_CLEAR_*.
 * Errors: KARST_FAILED. */
karst_clear_shader *karst_clear_shader_create(karst_context *context, unsigned ways, const karst_shade_colour *surface,
                                              karst_error *error);
void karst_clear_shader_destroy(karst_clear_shader *shader); /* NULL is fine */
/* As of karst_shader. */
void karst_clear_shader_set_anchor(karst_clear_shader *shader, const karst_position *anchor);
void karst_clear_shader_set_skies(karst_clear_shader *shader, karst_skies *skies);

/* Index and absorption (KARST_CLEAR_MATTER_PLANES planes of `room` rays) of the clear matter that a stream's rays hit,
 * of as many as the word `count` holds, max_rays at most. Asynchronous. Errors: KARST_FAILED. */
bool karst_clear_find_matter(karst_clear_shader *shader, const karst_cast_view *view, const karst_buffer *rays,
                             const karst_buffer *count, const karst_buffer *ways, uint32_t max_rays,
                             const karst_buffer *hits, karst_buffer *matter, uint32_t room, karst_error *error);

/* The streams. `sun`: shadow rays come with them. Errors: KARST_FAILED. */
karst_clear *karst_clear_create(karst_context *context, bool sun, karst_error *error);
void karst_clear_destroy(karst_clear *clear); /* NULL is fine */
/* Room for pictures of that size; nothing is done where there is. Errors: KARST_FAILED. */
bool karst_clear_set_room(karst_clear *clear, int width_px, int height_px, karst_error *error);
/* What that takes. Thread-safe. */
double karst_clear_bytes(int width_px, int height_px, bool sun, bool bends);

/* A stream that was cast, with where its rays end on clear matter (NULL: there is none), and karst_clear_way. */
typedef struct {
    const karst_bounce_stream *stream; /* its room: rays that there may be now */
    const karst_buffer *over_hits, *ways;
} karst_clear_stream;

/* What a picture is made with; all of it borrowed for a call. */
typedef struct {
    const karst_cast_view *view;
    const karst_pinhole *pinhole;
    const karst_light *light;
    karst_caster *land;
    karst_caster *clear; /* made with the buffers of clear matter's store; NULL: there is none, and what land mirrors is
                            followed alone */
    karst_shader *shader; /* the land's, with mirrors */
    karst_clear_shader *clear_shader;
    karst_refiner *refiner; /* of clear matter, for rays; NULL: its surfaces are as bricks have them */
    karst_bender *bender;    /* with a shader that bends; else NULL */
    bool is_inside;          /* the eye is in clear matter */
    float absorption_per_m[3]; /* there */
    double voxel_m;
    uint32_t bounces; /* surfaces of clear matter that a ray may meet after its first; 1 at least */
    karst_buffer *hits, *parts, *shadow_rays; /* as of karst_shade_pixels; the last NULL without a sun */
    karst_buffer *counters;                   /* up to KARST_CLEAR_COUNT_CUT */
    const karst_pass_picture *pass; /* with a shader for land that lets light pass; else NULL */
    /* Of karst_clear_trace: only pixels whose rays met a stand-in, or what is missing, when it followed some last. */
    bool only_lacking;
    bool has_caustics; /* the sun does not shine through clear matter: photons bring its light */
    /* What lies before what the rays of a stream see that was cast: called before it is shaded, to change throughput
     * and parts; not where the index varies, since rays are bent there. NULL: nothing. */
    bool (*veil)(void *user, const karst_clear_stream *stream, bool again, karst_error *error);
    /* What else the rays of a stream see that ended, once it is shaded; `again` as below. NULL: nothing. */
    bool (*more)(void *user, const karst_bounce *stream, bool again, karst_error *error);
    void *user;
} karst_clear_picture;

/* Casts the camera's rays into clear matter. `keeps`: its hits are those of the picture from now on; else it is for
 * what they ask for. Asynchronous, as all that follow. Errors: KARST_FAILED. */
bool karst_clear_cast_camera(karst_clear *clear, const karst_clear_picture *picture, bool keeps, karst_error *error);
/* Where they ended in clear matter, in the picture's order; of the last that it keeps. */
const karst_buffer *karst_clear_first_hits(const karst_clear *clear);
/* After karst_shade_pixels, before shadows are cast: takes back what was shaded behind clear matter. */
bool karst_clear_cover(karst_clear *clear, const karst_clear_picture *picture, karst_error *error);
/* Follows the rays from the picture's surfaces, and adds what they see to its parts. `again`: casts them once more for
 * what they ask for, and adds nothing; by view->ends_at_missing for what they are sure to need. */
bool karst_clear_trace(karst_clear *clear, const karst_clear_picture *picture, bool again, karst_error *error);

#endif
