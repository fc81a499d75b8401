/* Looking again at a picture that stands, where it lacked something: rays as dense as its own, that ask for what is
 * still missing there once something was made. So what a picture lacks is asked for without drawing it anew. */
#include "core/engine/engine_parts.h"

/* whole: of the picture that is drawn next, from all parts. */
static bool look(karst_engine *engine, bool whole, karst_error *error)
{
    karst_cast_view view;
    karst_pinhole pinhole;
    karst_engine_picture_view(engine, &view, &pinhole);
    return (whole ? karst_cast_picture(engine->caster, &view, &pinhole, NULL, engine->asked, NULL, error)
                  : karst_cast_again(engine->caster, &view, &pinhole, engine->asked, error)) &&
           karst_engine_cast_into_clear(engine, &view, &pinhole, false, error) &&
           karst_engine_look_at_media(engine, &view, &pinhole, error) &&
           karst_engine_look_at_photons(engine, &view, &pinhole, error);
}

bool karst_engine_look_at_all(karst_engine *engine, karst_error *error) { return look(engine, true, error); }

bool karst_engine_look_again(karst_engine *engine, karst_error *error) { return look(engine, false, error); }

bool karst_engine_look_at_shadows_again(karst_engine *engine, karst_error *error)
{
    karst_cast_view view;
    karst_pinhole pinhole;
    karst_engine_picture_view(engine, &view, &pinhole);
    const karst_light light = karst_engine_light(engine);
    /* Mirrored rays start where those to the sun do. */
    return (!engine->shadows || karst_cast_shadows_again(engine->caster, &view, &pinhole, &light, engine->shadow_rays,
                                                         engine->shadows_asked, error)) &&
           (!engine->bounce || (karst_engine_look_at_mirrored(engine, &view, &pinhole, error) &&
                                karst_engine_look_at_mirrored_shadows(engine, &view, &pinhole, error))) &&
           karst_engine_look_at_occlusion(engine, &view, error) &&
           karst_engine_look_at_paths(engine, &view, &pinhole, true, error) &&
           karst_engine_trace_clear(engine, &view, &pinhole, KARST_FOLLOW_LACKING, error) &&
           karst_engine_look_at_photons(engine, &view, &pinhole, error);
}
