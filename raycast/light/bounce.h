/* Next rays: from a picture's surfaces to the stream of rays that they mirror, and what that stream sees.
 *
 * The stage is the same for whatever comes of a surface: shading leaves a share of light for each pixel (of its parts,
 * raycast/light/radiance_shared.h, the mirror plane); pixels with one get a ray, without gaps and in the order of the
 * picture's beams; the rays are cast; and shading adds what they see, times the share. */
#ifndef KARST_RAYCAST_BOUNCE_H
#define KARST_RAYCAST_BOUNCE_H

#include "raycast/cast/cast.h"
#include "raycast/light/shade.h"

typedef struct karst_bounce karst_bounce;

/* `sun`: samples come with what the sun adds. Errors: KARST_FAILED. */
karst_bounce *karst_bounce_create(karst_context *context, bool sun, karst_error *error);
void karst_bounce_destroy(karst_bounce *bounce); /* NULL is fine */
/* Room for pictures of that size; nothing is done where there is. Errors: KARST_FAILED. */
bool karst_bounce_set_room(karst_bounce *bounce, int width_px, int height_px, karst_error *error);
/* What that takes. Thread-safe. */
double karst_bounce_bytes(int width_px, int height_px, bool sun);

/* Makes the rays that the surfaces of `hits` mirror, of pixels whose parts say that they do. Each starts in the hit, on
 * the side of the air, with the footprint that it has there, which grows as the surface turns rays from pixel to pixel;
 * and it ends where the camera's view does. Adds their number to counters[5]. Asynchronous. Errors: KARST_FAILED. */
bool karst_bounce_mirror(karst_bounce *bounce, const karst_cast_view *view, const karst_pinhole *pinhole,
                         const karst_buffer *hits, const karst_buffer *parts, karst_buffer *counters,
                         karst_error *error);
/* Casts them; `again`: for stamps and wishes alone. Asynchronous. Errors: KARST_FAILED. */
bool karst_bounce_cast(karst_bounce *bounce, karst_caster *caster, const karst_cast_view *view, bool again,
                       karst_error *error);
/* Adds what they see without the sun to the parts; makes their shadow rays, which close ranks: those of four beams
 * stand one after the other, and what the sun adds with them. As karst_shade_rays. */
bool karst_bounce_shade(karst_bounce *bounce, karst_shader *shader, const karst_cast_view *view,
                        const karst_pinhole *pinhole, const karst_light *light, karst_buffer *parts,
                        karst_buffer *counters, karst_error *error);
/* Casts those, likewise; and adds what the sun does where nothing hides it. With a sun only. */
bool karst_bounce_cast_shadows(karst_bounce *bounce, karst_caster *caster, const karst_cast_view *view,
                               const karst_pinhole *pinhole, const karst_light *light, bool again, karst_error *error);
/* The same rays into what else hides the sun. */
bool karst_bounce_cast_more_shadows(karst_bounce *bounce, karst_caster *caster, const karst_cast_view *view,
                                    const karst_pinhole *pinhole, const karst_light *light, bool again,
                                    karst_error *error);
bool karst_bounce_add_sun(karst_bounce *bounce, const karst_pinhole *pinhole, karst_buffer *parts, karst_error *error);

/* The buffers of the stream, which are the bounce's until there is other room: as many rays as the word `total` holds,
 * and their hits; and rays that a picture of that size may have, in whole blocks of a beam's. */
typedef struct {
    karst_buffer *rays, *hits, *total;
    karst_buffer *shadow_rays; /* NULL without a sun */
    uint32_t room;
    karst_buffer *suns, *marks; /* of shadow rays, what the sun adds, and where it is hidden; NULL without a sun */
} karst_bounce_stream;
karst_bounce_stream karst_bounce_get_stream(const karst_bounce *bounce);
uint32_t karst_bounce_room(int width_px, int height_px);
/* The picture that shadow rays of the stream are laid out as. */
karst_pinhole karst_bounce_pinhole(const karst_bounce *bounce, const karst_pinhole *pinhole);
/* From now on the stream has that many rays at most, and no more is launched: the host knows. 0: as many as pixels. */
void karst_bounce_limit(karst_bounce *bounce, uint32_t max_rays);
/* Takes rays, and the word that counts them, of another stream with as much room, and gives its own. */
void karst_bounce_exchange(karst_bounce *bounce, karst_buffer **rays, karst_buffer **total);

#endif
