/* The producer of a density program. */
#ifndef KARST_PRODUCERS_DENSITY_PRODUCER_H
#define KARST_PRODUCERS_DENSITY_PRODUCER_H

#include "cache/colours.h"
#include "producers/language/graph/words.h"
#include "producers/layer.h"
#include "producers/producer.h"
#include "producers/steps/shape.h"

/* A density program as text, and how to run it. */
typedef struct {
    const char *name;             /* for people; borrowed for the producer's life */
    const char *source;           /* what "world.clh" is (producers/steps/density.clh); borrowed during creation */
    const char *bounds_source;    /* NULL, or what it is instead where only bounds are wanted */
    const char *options;          /* build options for it, such as "-DWORLD_SEED=7u"; "" for none */
    const char *finalise_options; /* NULL, or more options for finalise */
    const void *data;  /* what a program built with -DWORLD_HAS_DATA reads; NULL for none; borrowed during creation */
    size_t data_bytes; /* a multiple of 8 */
    const karst_world_layout *layout; /* NULL, or the data's, in which large images are mapped; likewise borrowed */
    karst_shape shape;
    bool in_two_steps;  /* evaluate and finalise in two kernels also where one work-item has all of a brick, as ever
                           where it has not: for tests, which look into staging memory */
    uint32_t max_loads; /* the most loads in one round's work */
    /* Its data hold a tape (language/bounds_shared.h) of the same density, and the producer may start on that: where
     * compiling takes seconds the host answers at first, with the same bits (host_steps.h), until
     * karst_density_producer_compile has brought kernels. */
    bool start_on_host;
    uint32_t tape_instructions; /* only for that */
    const char *soon_options;   /* NULL, or options with which what evaluates is compiled sooner and runs slower */
} karst_density_program;

/* Its kernels are built with the program's options; staging memory holds max_loads bricks, or a chunk of them. Errors:
 * KARST_FAILED. */
karst_producer *karst_density_producer_create_program(karst_context *context, const karst_density_program *program,
                                                      karst_error *error);

/* Whether the host answers in place of kernels that are not compiled yet. */
bool karst_density_producer_is_on_host(karst_producer *producer);
/* If it does: starts to compile them beside, if that was not done, and waits until they are there, but for so long at
 * most; KARST_UNTIL_COMPILED: as long as it takes. They take over as soon as they are there. What goes wrong is said
 * here, or by the step that would have run them. Errors: KARST_FAILED. */
#define KARST_UNTIL_COMPILED UINT64_MAX
bool karst_density_producer_compile(karst_producer *producer, uint64_t most_ns, karst_error *error);

/* Runs the kernels that make loads once, on none or one that takes no samples, into the first load of `work`: for
 * drivers that compile a kernel when it first runs. Waits until it is done. Errors: KARST_FAILED. */
bool karst_density_program_rehearse(karst_context *context, const karst_density_program *program,
                                    const karst_cache_buffers *cache, const karst_work *work, karst_error *error);

/* Replaces a program's data by other of the same size, for work that is answered from now on; the caller drops what was
 * made of the old. */
bool karst_density_producer_set_data(karst_producer *producer, const void *data, karst_error *error);

/* The same with data of any size, and another name. What was enqueued must be done. The old buffer is gone: who reads
 * it, too, must be given producer->data[0] anew. */
bool karst_density_producer_replace(karst_producer *producer, const char *name, const void *data, size_t data_bytes,
                                    const karst_world_layout *layout, karst_error *error);

/* From now on these layers take part in what is produced, in this order; they are borrowed, until others are set. From
 * the first ones on, loads are made in two steps, by kernels that are built here from `program`, which is the one that
 * the producer was made of. What layers have of colours goes to `colours`, of the store that loads are of; NULL: they
 * have none. Work that is enqueued must be done. Errors: KARST_FAILED; then all is as before, but for the two steps. */
bool karst_density_producer_set_layers(karst_producer *producer, const karst_density_program *program,
                                       karst_layer *const *layers, size_t num_layers, const karst_colours *colours,
                                       karst_error *error);
#define KARST_MAX_LAYERS 8u

/* The staging memory of the chunk that was evaluated last: floats, *stride_floats a brick. Owned by the producer. NULL
 * where loads are made in one. */
karst_buffer *karst_density_producer_staging(karst_producer *producer, uint32_t *stride_floats);

#endif
