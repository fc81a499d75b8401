/* What a sampler is made of. Private to sampler.c and sampler_batch.c. */
#ifndef KARST_PRODUCERS_SAMPLER_INTERNAL_H
#define KARST_PRODUCERS_SAMPLER_INTERNAL_H

#include "producers/density/world_internal.h"
#include "producers/edits/edit_list.h"

struct karst_sampler {
    const karst_world *world;
    karst_oracle *oracle, *gradient_oracle;
    int *slots;            /* of the bounds' tape */
    karst_edit_list edits; /* without data: none */
    /* For many points at once; made when first asked for. Without code: not made, or too large. */
    karst_tape density_tape, gradient_tape;
    bool has_tried_density, has_tried_gradient;
};

/* Whether an edit may be within half_m of a point, along each axis. */
bool karst_sampler_is_edited(const karst_sampler *sampler, const karst_position *at, double half_m);
/* A density with the world's models, and, where it is not NULL, the gradient with it. */
float karst_sampler_with_models(const karst_sampler *sampler, const karst_position *at, int level, float density,
                                float gradient[3]);
/* Whether a model's value is the one that counts there; the gradient is then its own. */
bool karst_sampler_is_model(const karst_sampler *sampler, const karst_position *at, int level, float density,
                            float gradient[3]);
/* Whether the text's density is flat where it and the executed one (deepen.h) are these. */
bool karst_sampler_is_flat(const karst_sampler *sampler, float text, float executed);

#endif
