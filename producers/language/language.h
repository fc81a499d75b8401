/* The world language: from text to a program graph. The only header of the front end that others need, with graph.h. */
#ifndef KARST_LANGUAGE_LANGUAGE_H
#define KARST_LANGUAGE_LANGUAGE_H

#include "karst/error.h"
#include "producers/language/graph/data.h"
#include "producers/language/graph/materials.h"
#include "producers/language/front/images.h"
#include "producers/language/base/source.h"

#define KARST_LANGUAGE_ARENA_BYTES ((size_t)256 << 20)

/* A parameter: of the header, or an implicit one such as iTime, which is 0. Parameter leaves of the graph count in this
 * order. */
typedef struct {
    const char *name;
    karst_number value;    /* as the header says, or as the caller asked */
    double min, max, step; /* step 0: any value */
    const char *unit, *label;
    bool is_implicit;
    bool is_structural; /* it decided a loop, an array's size or a number of octaves: a change of it means compiling
                           again */
    bool is_used;
} karst_world_parameter;

/* All of it is owned by the program and lives until karst_program_graph_destroy. Immutable: any number of threads may
 * read it. */
typedef struct {
    karst_arena arena;
    karst_source source; /* its text: places in it are the `where` of nodes */
    const char *name;    /* of the file */
    karst_world_header header;
    karst_world_image *images; /* the data that the text uses */
    karst_graph graph; /* canonical, only what the roots reach; positions are KARST_OP_POSITION, in metres */
    karst_expr root[KARST_NUM_ROOTS];  /* floats: what its entries give (entries.h) */
    bool has_entry[KARST_NUM_ENTRIES]; /* those that the text has and that run */
    karst_graph resolved;              /* what is executed: see kinds.h */
    karst_resolved_world world;        /* the same roots in it */
    bool is_deepened;     /* its density is `deep`, and world.text the text's density if that is another one */
    karst_expr deep;      /* in `graph`; KARST_NO_EXPR: not asked for yet */
    uint32_t num_written; /* nodes of `graph` before that */
    double text_range[2]; /* of world.text, over all space */
    const karst_model_material *materials; /* only while karst_program_add_materials runs */
    size_t num_materials;
    float plain[2][3];
    uint32_t num_parameters;
    karst_world_parameter *parameters;
    uint32_t num_octaves;                /* of all noises together */
    uint32_t max_iterations;             /* of the longest loop */
    const karst_diagnostic *diagnostics; /* warnings in order; the error last, if there is one */
} karst_program_graph;

/* A value given from outside (--param, --seed is not one). */
typedef struct {
    const char *name;
    double value;
} karst_parameter_value;

/* Compiles `length` bytes of text. `name` stands in messages. `given` overrides the header's values (clamped to their
 * ranges; unknown names are an error). Always returns a program, unless memory is out (NULL, KARST_FAILED): on a bad
 * world its graph is empty, its diagnostics say why, *ok is false and *error is KARST_BAD_WORLD with the first line of
 * the error, or KARST_BAD_DATA where a file that the text names as data is missing or damaged (such files are looked
 * for from the folder of `name` on). Never crashes and never runs long, whatever the text: the caps stand in source.h,
 * lexer.h, macro.h, lower.h and types.h. Thread-safe. */
karst_program_graph *karst_language_compile(const char *name, const char *text, size_t length,
                                            const karst_parameter_value *given, size_t num_given, bool *ok,
                                            karst_error *error);
/* The same for a file. Errors also: KARST_BAD_WORLD naming the path if it cannot be read or is no regular file. */
karst_program_graph *karst_language_compile_file(const char *path, const karst_parameter_value *given, size_t num_given,
                                                 bool *ok, karst_error *error);
/* Resolves a good program once more, for another finest voxel than its header's, which it sets. false: it stays as it
 * was, as the world would then be too large. Nothing may hold its resolved graph. One thread at a time per program. */
bool karst_program_set_voxel(karst_program_graph *program, int voxel_log2_m);
/* Resolves a good program once more, with air that is exactly 0 made deep (deepen.h), as pictures need it, or flat
 * again. false: it stays as it was. As above. */
bool karst_program_deepen(karst_program_graph *program, bool deepens);
/* Resolves a good program once more, with materials of models laid over what its text says of surfaces (materials.h);
 * `plain` is the colour of steep and of flat land without any. Once, and before it is deepened. false: it stays as it
 * was, as the world would then be too large. As above. */
bool karst_program_add_materials(karst_program_graph *program, const karst_model_material *materials, size_t num,
                                 const float plain[2][3]);
void karst_program_graph_destroy(karst_program_graph *program); /* NULL is fine */

#endif
