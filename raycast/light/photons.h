/* Photons: light that lamps send by way of mirrors and clear matter to land, where it makes caustics.
 *
 * What each lamp shines into is cut into cells. Probes look which of them hold anything that mirrors or is clear, then
 * which parts of these do (raycast/light/photons_aim.h), and photons are sent into those alone: each into its own place
 * of a grid, with the light that falls there. There are as many as a part's power over the squared distance of what it
 * shines on from the eye says, so that they lie as densely on the picture as pixels do. They are streams of rays as
 * any: cast into land and into clear matter, and dimmed on their way by Beer's and Lambert's law. The first two
 * surfaces that a photon meets part its light, by Fresnel's share or the share that land mirrors, and both parts are
 * followed; at further ones chance decides. So photons of a grid that light takes the same way lie side by side as they
 * were sent. Outside the picture they ask for less and less detail. Where one meets land that scatters it, after at
 * least one such surface (paths LS+D; H. W. Jensen, "Global illumination using photon maps", 1996), it leaves its flux;
 * what a lamp shines on directly is left to who looks for lamps from there. How shading gathers it:
 * raycast/light/photon_grid.h.
 *
 * They are kept as they are, not as densities of bricks' corners: how much area a corner stands for follows from the
 * surface that runs past it, which no brick knows, while a kernel on a disc needs nothing but the normal.
 *
 * A photon that met nothing but what is there is done, and is never traced again; those that lack something wait, and
 * are traced once it was made. Random numbers follow from lamp, cell and number alone. Energy is counted in whole
 * quanta, and what is gathered is summed in whole numbers: so no order of photons, lanes or batches leaves a trace. */
#ifndef KARST_RAYCAST_PHOTONS_H
#define KARST_RAYCAST_PHOTONS_H

#include "raycast/cast/refine.h"
#include "raycast/light/clear.h"
#include "raycast/light/paths.h"
#include "raycast/light/photons_shared.h"

typedef struct karst_photons karst_photons;

/* For so many photons (1 or more) at most, in batches of at most max_rays (at least 1). Errors: KARST_FAILED. */
karst_photons *karst_photons_create(karst_context *context, uint32_t num_photons, uint32_t max_rays,
                                    karst_error *error);
void karst_photons_destroy(karst_photons *photons); /* NULL is fine */
/* What that takes, in all and in the largest buffer. Thread-safe. */
double karst_photons_bytes(uint32_t num_photons, double *largest_bytes);
/* Of the photons that were shared out last; 0: none are. */
uint32_t karst_photons_num_batches(const karst_photons *photons);
/* Photons of the first ones that wait, and that are done. */
uint32_t karst_photons_num_waiting(const karst_photons *photons, uint32_t num_batches);
uint32_t karst_photons_num_done(const karst_photons *photons, uint32_t num_batches);

/* What they fly through; all of it borrowed for a call. */
typedef struct {
    karst_caster *land, *clear; /* the latter NULL: there is no clear matter */
    karst_shader *shader;       /* the land's, for paths; its anchor is set */
    karst_clear_shader *clear_shader; /* likewise; NULL without clear matter */
    karst_refiner *land_refiner, *clear_refiner; /* for rays; NULL: surfaces are as bricks have them */
    const karst_cast_view *view; /* whose anchor is the eye; it ends at what is missing */
    const karst_pinhole *pinhole;
    const karst_light *light;
    karst_shade_anchor anchor; /* the same place as the view's */
    double voxel_m;
    uint32_t bounces; /* surfaces that a photon may turn at */
    bool mirrors;     /* land does, if it says so */
    karst_buffer *parts, *counters; /* of the picture, for shaders that must have them: left as they are */
} karst_photon_scene;

/* From now on photons are those of these lamps (KARST_MOST_LAMPS at most; absorption where they are in clear matter).
 * What was traced before is forgotten, and nothing is aimed. Errors: KARST_FAILED. */
bool karst_photons_begin(karst_photons *photons, const karst_photon_scene *scene, const karst_photon_lamp *lamps,
                         uint32_t num_lamps, karst_error *error);
/* Looks where the lamps' photons are to be sent, in the same view: first everywhere, then where probes met what was
 * missing. *num_waiting: probes that still do; once it is 0, photons may be shared out. Waits for the device. Errors:
 * KARST_FAILED. */
bool karst_photons_aim(karst_photons *photons, const karst_photon_scene *scene, uint32_t *num_waiting,
                       karst_error *error);
/* Shares so many photons (1 to as many as there may be) out among what was found. Those before are forgotten; what is
 * gathered stays. Errors: KARST_FAILED. */
bool karst_photons_share(karst_photons *photons, const karst_photon_scene *scene, uint32_t num_photons,
                         karst_error *error);
/* Traces those of a batch (0 to karst_photons_num_batches - 1) that wait, which at first are all, from the place that
 * was aimed from. Waits for the device. Errors: KARST_FAILED. */
bool karst_photons_trace(karst_photons *photons, const karst_photon_scene *scene, uint32_t batch, karst_error *error);
/* From now on the photons of the first num_batches that are done are gathered. Waits. Errors: KARST_FAILED. */
bool karst_photons_sort(karst_photons *photons, uint32_t num_batches, karst_error *error);

/* Adds to the picture's parts what those photons make of surfaces: rays as karst_paths_look_along_normals leaves them.
 * offset: from the anchor of the picture to that of the photons, level-0 voxels. Asynchronous. Errors: KARST_FAILED. */
bool karst_photons_gather(karst_photons *photons, const karst_buffer *rays, const karst_buffer *count,
                          uint32_t max_rays, const float offset[3], const karst_pinhole *pinhole, karst_buffer *parts,
                          karst_error *error);
/* Where the energy of those of the first num_batches that are done went, by KARST_PHOTON_SUM_*, and the flux that a
 * quantum is. */
void karst_photons_sums(const karst_photons *photons, uint32_t num_batches, uint64_t sums[KARST_PHOTON_SUMS],
                        double *quantum);

#endif
