/* A world file as something to be looked at: compiled, with the text of its kernels, their data, and what a
 * karst_world_info says of a shipped world. */
#ifndef KARST_LANGUAGE_WORLD_FILE_H
#define KARST_LANGUAGE_WORLD_FILE_H

#include "karst/world.h"
#include "producers/density/density_producer.h"
#include "producers/language/emit/emit.h"
#include "producers/language/language.h"
#include "producers/language/tape/tape.h"
#include "producers/producer.h"
#include "producers/steps/shape.h"

/* What a world may have beside its land, each in a store of its own (producers/stores.h). */
typedef enum {
    KARST_CONTENT_CLEAR, /* clear matter */
    KARST_CONTENT_AIR,   /* a medium that fills the space outside matter: the density is its extinction, per metre;
                          * colour, mirror and emission are its albedo, g and emission. Its producers are built with
                          * KARST_MEDIUM_OPTION */
    KARST_NUM_CONTENTS
} karst_content;
extern const char *const karst_content_names[KARST_NUM_CONTENTS]; /* of their stores, too */

typedef struct karst_world_file karst_world_file;
struct karst_world_file {
    karst_program_graph *program; /* its diagnostics hold warnings */
    karst_world_layout layout;
    karst_emitted code;
    karst_tape tape;        /* of the density, for its bounds */
    karst_tape colour_tape; /* of the colours: if code.is_colour_tape, or has_tape_colours */
    bool has_tape_colours;  /* they can run on the interpreter of all colours: there is nothing but colours */
    size_t data_bytes;
    karst_world_info info; /* its strings live in the file */
    char camera[640];
    bool raises_thin;   /* see karst_world_file_raise_thin */
    bool fills_seams;   /* of clear matter that does so: bodies that share a face are one (steps/seam.clh) */
    bool smooths_jumps; /* see karst_world_file_smooth_jumps */
    bool is_indoors;    /* where the view was looked for: no sun reaches what is seen */
    /* NULL: it has none of that. A file of its own of the same text, parameters and seed, whose density is the
     * content's, and whose colours and what else shading gives are those of its surface; owned. What is said below of a
     * file holds for it, but that it is compiled, told to raise what is thin, and destroyed with its world. */
    karst_world_file *content[KARST_NUM_CONTENTS];
};

/* Compiles a file or a text. `given` are parameters to set. Errors: KARST_BAD_WORLD; if `diagnostics` is not NULL, all
 * that there is to say goes there as text for people, malloc'ed (NULL: nothing), also where the file is good. Destroy
 * with karst_world_file_destroy. */
karst_world_file *karst_world_file_open(const char *path, const karst_parameter_value *given, size_t num_given,
                                        char **diagnostics, karst_error *error);
karst_world_file *karst_world_file_compile(const char *name, const char *text, size_t length,
                                           const karst_parameter_value *given, size_t num_given, char **diagnostics,
                                           karst_error *error);
/* Whether its producers show matter thinner than a voxel (steps/raise.clh): at first they do not, and never where the
 * world has none. Before any is made. */
void karst_world_file_raise_thin(karst_world_file *file, karst_thin thin);
/* Has its producers say where the density jumps over 0 (steps/jump.clh), where the text may do so: at first they do
 * not, and never where the density runs on its tape. */
void karst_world_file_smooth_jumps(karst_world_file *file);
void karst_world_file_destroy(karst_world_file *file); /* NULL is fine; producers of it must be gone */

/* What its kernels read, with its own parameters and a seed: data_bytes, malloc'ed unless it has images that are
 * mapped. Errors: KARST_FAILED. */
void *karst_world_file_data(const karst_world_file *file, uint32_t seed, karst_error *error);
void karst_world_file_free_data(const karst_world_file *file, void *data); /* NULL is fine */
/* Its density program, for producers of other shapes; max_loads is the caller's to fill. Borrows all three. */
#define KARST_WORLD_FILE_OPTIONS_BYTES (KARST_TAPE_OPTIONS_BYTES + 128)
void karst_world_file_program(const karst_world_file *file, const void *data,
                              char options[KARST_WORLD_FILE_OPTIONS_BYTES], karst_density_program *program);
/* Options to build its colours with. */
void karst_world_file_colour_options(const karst_world_file *file, char options[KARST_WORLD_FILE_OPTIONS_BYTES]);
/* The interpreter of all colours, with any op and room for many values: the same program for all worlds, for showing
 * colours before code of their own is compiled. For worlds that have has_tape_colours; the bits are the same. */
extern const char karst_tape_colours_source[], karst_tape_colours_options[];
/* Its producer. `max_loads`: of a round. Errors: KARST_FAILED. */
karst_producer *karst_world_file_producer(karst_context *context, const karst_world_file *file, uint32_t seed,
                                          uint32_t max_loads, karst_error *error);
/* The same in another shape than the device's own, or with more options of the build (NULL: neither). */
typedef struct {
    karst_shape shape;
    bool in_two_steps;            /* karst_density_program.in_two_steps */
    const char *options;          /* NULL: none */
    const char *finalise_options; /* NULL: none; karst_cache_brick_option */
    bool start_on_host;           /* karst_density_program.start_on_host */
} karst_world_build;
karst_producer *karst_world_file_producer_built(karst_context *context, const karst_world_file *file, uint32_t seed,
                                                uint32_t max_loads, const karst_world_build *build, karst_error *error);
/* karst_density_producer_set_layers for a producer that was built so. */
bool karst_world_file_set_layers(karst_producer *producer, const karst_world_file *file, const karst_world_build *build,
                                 karst_layer *const *layers, size_t num_layers, const karst_colours *colours,
                                 karst_error *error);
/* karst_density_program_rehearse for such a producer. */
bool karst_world_file_rehearse(karst_context *context, const karst_world_file *file, uint32_t seed,
                               const karst_world_build *build, const karst_cache_buffers *cache, const karst_work *work,
                               karst_error *error);
/* Makes a producer of `from` one of `to`, with `to`'s own parameters, if nothing but their data tells their densities'
 * programs apart: *is_same says so, else nothing happens. Work that is enqueued must be done. Errors: KARST_FAILED;
 * then it is still `from`'s. */
bool karst_world_file_convert(karst_producer *producer, const karst_world_file *from, const karst_world_file *to,
                              uint32_t seed, bool *is_same, karst_error *error);
/* Gives a producer of the file the data of other parameters and seed: nothing is compiled; the caller drops what was
 * made before. A parameter that is structural cannot be changed so. Errors: KARST_FAILED. */
bool karst_world_file_set_parameters(karst_producer *producer, const karst_world_file *file, const karst_number *values,
                                     uint32_t seed, karst_error *error);

#endif
