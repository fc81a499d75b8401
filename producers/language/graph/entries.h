/* Entry points: the functions of a text that mean something to Karst, and what they give. A new one is a line of
 * KARST_ENTRIES, a line of KARST_OUTPUTS for each value that is new, and whoever uses those values.
 *
 * An entry is known by its name and its signature: functions of the name with other parameters or another result are
 * the text's own. Values are *roots* of the world's graph, one for each float. */
#ifndef KARST_LANGUAGE_ENTRIES_H
#define KARST_LANGUAGE_ENTRIES_H

#include <stdbool.h>
#include <stddef.h>

#include "producers/language/graph/graph.h"

/* What entries give: enumerator, name (and that of a struct's field), floats (1 or 3), the value of each float where
 * the text says nothing, whether pictures show it. */
#define KARST_OUTPUTS(X)                             \
    X(DENSITY, "density", 1, 0.0, true)              \
    X(COLOUR, "colour", 3, 0.5, true)                \
    X(MIRROR, "mirror", 1, 0.0, true)                \
    X(GLOSS, "gloss", 1, 0.0, true)                  \
    X(EMISSION, "emission", 3, 0.0, true)            \
    X(IOR, "ior", 1, 1.33, false)                    \
    X(ABSORPTION, "absorption", 3, 0.0, false)       \
    X(TRANSPARENCY, "transparency", 1, 0.0, true)    \
    X(CLEAR, "clear", 1, 0.0, true)                  \
    X(CLEAR_COLOUR, "colour", 3, 0.5, false)         \
    X(CLEAR_MIRROR, "mirror", 1, 0.0, false)         \
    X(CLEAR_GLOSS, "gloss", 1, 0.0, false)           \
    X(CLEAR_EMISSION, "emission", 3, 0.0, false)     \
    X(CLEAR_IOR, "ior", 1, 1.33, true)               \
    X(CLEAR_ABSORPTION, "absorption", 3, 0.0, true)  \
    X(CLEAR_TRANSPARENCY, "transparency", 1, 0.0, false) \
    X(EXTINCTION, "extinction", 1, 0.0, true)        \
    X(AIR_ALBEDO, "albedo", 3, 1.0, true)            \
    X(AIR_G, "g", 1, 0.0, true)                      \
    X(AIR_EMISSION, "emission", 3, 0.0, true)        \
    X(INDEX, "index", 1, 1.33, true)

/* Entries: enumerator, name, another spelling of it (or NULL), type of the result, its first and last output, its
 * inputs, the program that runs it, whether it is softened (soften.h). The result is a built-in type, or a struct that
 * has the outputs as fields, in order. Where two give the same output, the later one does: one whose outputs all come
 * from later ones is not run. The first has to be there. */
#define KARST_ENTRIES(X)                                                                                       \
    X(DENSITY, "density", NULL, "float", DENSITY, DENSITY, KARST_INPUT_PLACE, BRICKS, false)                   \
    X(COLOUR, "colour", "color", "vec3", COLOUR, COLOUR, KARST_INPUT_PLACE_AND_NORMAL, SHADING, true)          \
    X(SURFACE, "surface", NULL, "material", COLOUR, TRANSPARENCY, KARST_INPUT_PLACE_AND_NORMAL, SHADING, true) \
    X(CLEAR, "clear", NULL, "float", CLEAR, CLEAR, KARST_INPUT_PLACE, CLEAR_BRICKS, false)                     \
    X(CLEAR_SURFACE, "clear_surface", NULL, "material", CLEAR_COLOUR, CLEAR_TRANSPARENCY,                      \
      KARST_INPUT_PLACE_AND_NORMAL, CLEAR_SHADING, true)                                                       \
    X(AIR, "air", NULL, "medium", EXTINCTION, AIR_EMISSION, KARST_INPUT_PLACE, AIR, false)                     \
    X(INDEX, "index", NULL, "float", INDEX, INDEX, KARST_INPUT_PLACE, CLEAR_INDEX, false)

/* How many parameters, each a vec3: the place, and the normal towards the air. */
enum { KARST_INPUT_PLACE = 1, KARST_INPUT_PLACE_AND_NORMAL = 2 };

typedef enum {
    KARST_PROGRAM_BRICKS,  /* what fills bricks, and bounds them */
    KARST_PROGRAM_SHADING, /* what runs at hits */
    /* The same of clear matter: programs of their own, which are made of these outputs as of the land's
     * (producers/density/world_content.c). */
    KARST_PROGRAM_CLEAR_BRICKS,
    KARST_PROGRAM_CLEAR_SHADING,
    KARST_PROGRAM_AIR, /* and of what fills the space outside matter: its extinction is that of bricks */
    KARST_PROGRAM_CLEAR_INDEX /* what bends rays inside clear matter */
} karst_entry_program;

#define KARST_OUTPUT_ENUMERATOR_(id, ...) KARST_OUTPUT_##id,
typedef enum { KARST_OUTPUTS(KARST_OUTPUT_ENUMERATOR_) KARST_NUM_OUTPUTS } karst_output;
#define KARST_ENTRY_ENUMERATOR_(id, ...) KARST_ENTRY_##id,
typedef enum { KARST_ENTRIES(KARST_ENTRY_ENUMERATOR_) KARST_NUM_ENTRIES } karst_entry;
/* The number of each output's first root; its others follow. */
#define KARST_ROOT_ENUMERATORS_(id, name, floats, usual, shown) \
    KARST_ROOT_##id, KARST_ROOT_LAST_##id = KARST_ROOT_##id + (floats)-1,
enum { KARST_OUTPUTS(KARST_ROOT_ENUMERATORS_) KARST_NUM_ROOTS };

typedef struct {
    const char *name;
    uint32_t root, num_floats;
    double usual;
    bool is_shown;
} karst_output_info;
extern const karst_output_info karst_outputs[KARST_NUM_OUTPUTS];

typedef struct {
    const char *name, *other_name, *result;
    karst_output first, last;
    uint32_t num_inputs;
    karst_entry_program program;
    bool is_softened;
} karst_entry_info;
extern const karst_entry_info karst_entries[KARST_NUM_ENTRIES];

/* The entry whose output it is: the first, if several give it. */
karst_entry karst_entry_of(karst_output output);
/* "vec3 colour(vec3 p, vec3 n)", into `text`, which has room for KARST_SIGNATURE_BYTES. */
#define KARST_SIGNATURE_BYTES 96
void karst_entry_signature(karst_entry entry, char *text);

/* ---- the roots of a world: KARST_NUM_ROOTS expressions, KARST_NO_EXPR where an output is missing ---- */

static inline bool karst_has_output(const karst_expr *root, karst_output output)
{
    return root[karst_outputs[output].root] != KARST_NO_EXPR;
}
/* The numbers of a program's roots that are there, in order; returns how many. Of shading none, or the colour's three
 * and what comes after them. */
size_t karst_list_roots(const karst_expr *root, karst_entry_program program, uint32_t list[KARST_NUM_ROOTS]);
/* The same roots themselves. */
size_t karst_program_roots(const karst_expr *root, karst_entry_program program, karst_expr list[KARST_NUM_ROOTS]);

#endif
