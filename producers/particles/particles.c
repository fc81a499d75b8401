/* The layer of particles. */
#include "producers/particles/particles.h"

#include <stdlib.h>

#include "producers/steps/layer_kernels.h"

typedef struct {
    karst_buffer_layer on;
    karst_context *context;
    karst_particle_list list;
    karst_drop_box *dirty, *told; /* since the last call of take_dirty; what that gave */
    size_t num_dirty;
} particles_layer;

const karst_particle_list *karst_particles_layer_list(const karst_layer *layer)
{
    return &((const particles_layer *)layer)->list;
}

static size_t take_dirty(karst_layer *self, const karst_drop_box **boxes)
{
    particles_layer *particles = (particles_layer *)self;
    const size_t num = particles->num_dirty;
    free(particles->told);
    *boxes = particles->told = particles->dirty;
    particles->dirty = NULL;
    particles->num_dirty = 0;
    return num;
}

static bool check(karst_layer *self, karst_error *error)
{
    return karst_particle_list_check(&((particles_layer *)self)->list, error);
}

static void destroy(karst_layer *self)
{
    particles_layer *particles = (particles_layer *)self;
    karst_buffer_layer_finish(&particles->on);
    karst_particle_list_finish(&particles->list);
    free(particles->dirty);
    free(particles->told);
    free(particles);
}

static const karst_layer_ops particles_ops = {.kind = "particles",
                                              .bound_tiles = karst_buffer_layer_bound_tiles,
                                              .bound_loads = karst_buffer_layer_bound_loads,
                                              .evaluate = karst_buffer_layer_evaluate,
                                              .take_dirty = take_dirty,
                                              .check = check,
                                              .destroy = destroy};

karst_layer *karst_particles_layer_create(karst_context *context, karst_shape shape, const karst_particle_group *groups,
                                          size_t num, int voxel_log2_m, double time_s, karst_error *error)
{
    particles_layer *particles = calloc(1, sizeof *particles);
    if (!particles) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    particles->on.base.ops = &particles_ops;
    particles->context = context;
    if (karst_particle_list_init(&particles->list, groups, num, voxel_log2_m, time_s, error) &&
        (particles->on.data =
             karst_buffer_create(context, "particles", particles->list.size_bytes, particles->list.data, error)) &&
        karst_layer_kernels_build(&particles->on.kernels, context, shape, "producers/particles/particles_layer.clh",
                                  error))
        return &particles->on.base;
    destroy(&particles->on.base);
    return NULL;
}

/* Boxes that nobody has asked for yet, and these, which it takes. */
static bool remember_dirty(particles_layer *particles, karst_drop_box *boxes, size_t num, karst_error *error)
{
    if (particles->num_dirty == 0 || num == 0) {
        if (num > 0)
            particles->dirty = boxes;
        particles->num_dirty += num;
        return true;
    }
    karst_drop_box *both = realloc(particles->dirty, (particles->num_dirty + num) * sizeof *both);
    for (size_t i = 0; both && i < num; i++)
        both[particles->num_dirty + i] = boxes[i];
    particles->dirty = both ? both : particles->dirty;
    particles->num_dirty += both ? num : 0;
    free(boxes);
    return both || karst_fail(error, KARST_FAILED, "out of memory");
}

/* The device reads what the list has now. Takes the boxes. */
static bool send(particles_layer *particles, karst_drop_box *boxes, size_t num, karst_error *error)
{
    if (num == 0)
        return true;
    karst_buffer *data =
        karst_buffer_create(particles->context, "particles", particles->list.size_bytes, particles->list.data, error);
    if (!data) {
        free(boxes);
        return false;
    }
    karst_buffer_destroy(particles->on.data);
    particles->on.data = data;
    particles->on.base.version++;
    return remember_dirty(particles, boxes, num, error);
}

bool karst_particles_layer_set_time(karst_layer *layer, double time_s, karst_error *error)
{
    particles_layer *particles = (particles_layer *)layer;
    karst_drop_box *boxes;
    size_t num;
    return karst_particle_list_set_time(&particles->list, time_s, &boxes, &num, error) &&
           send(particles, boxes, num, error);
}

bool karst_particles_layer_set_groups(karst_layer *layer, const karst_particle_group *groups, size_t num_groups,
                                      double time_s, karst_error *error)
{
    particles_layer *particles = (particles_layer *)layer;
    karst_particle_list made;
    karst_drop_box *boxes;
    size_t num;
    if (!karst_particle_list_init(&made, groups, num_groups, particles->list.voxel_log2_m, time_s, error))
        return false;
    if (!karst_particle_list_differ(&particles->list, &made, &boxes, &num, error)) {
        karst_particle_list_finish(&made);
        return false;
    }
    karst_particle_list_finish(&particles->list);
    particles->list = made;
    return send(particles, boxes, num, error);
}
