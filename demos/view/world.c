/* The world on show, for what pictures do not tell: its parameters, and the ground. */
#include "demos/view/view.h"

void view_world_take(viewer *v, karst_world *compiled)
{
    bool sampled = v->sampler != NULL;
    karst_sampler_destroy(v->sampler);
    karst_world_close(v->compiled);
    v->compiled = compiled;
    v->metadata = compiled ? karst_world_get_metadata(compiled) : NULL;
    v->sampler = compiled && sampled ? view_sampler_create(v, compiled, NULL) : NULL;
    if (v->motion.mode == VIEW_WALK && !v->sampler)
        view_set_mode(v, VIEW_FLY);
}

/* For the parameters' names and the ground: nothing that a picture needs, so its absence is no failure. */
void view_world_open(viewer *v)
{
    karst_parameter parameters[VIEW_MAX_SLIDERS];
    size_t num_parameters = 0;
    for (int i = 0; i < v->sliders.num_sliders; i++)
        parameters[num_parameters++] = (karst_parameter){v->sliders.sliders[i].name, v->sliders.sliders[i].value};
    bool first = num_parameters == 0;
    const karst_world_config config = {.world = v->world_file,
                                       .parameters = first ? v->settings.parameters.values : parameters,
                                       .num_parameters = first ? v->settings.parameters.num_values : num_parameters,
                                       .has_seed = v->settings.has_seed,
                                       .seed = (uint32_t)v->settings.seed};
    view_world_take(v, karst_world_open(&config, NULL));
}

void view_world_stale(viewer *v)
{
    if (v->sampler)
        view_world_open(v);
}
