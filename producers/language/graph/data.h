/* The data that a world's generated code reads: everything that numbers known before any position decide.
 *
 * A layout follows from the graph alone and is part of the generated code; what stands in it follows from parameters,
 * seed and voxel. So a change of those fills the buffer anew and compiles nothing.
 */
#ifndef KARST_LANGUAGE_DATA_H
#define KARST_LANGUAGE_DATA_H

#include "producers/language/graph/entries.h"

/* What a world file compiles to. */
typedef struct {
    const karst_graph *graph;         /* resolved: no POSITION is left, kinds are set */
    karst_expr root[KARST_NUM_ROOTS]; /* what its entries give; KARST_NO_EXPR where they do not: see entries.h */
    karst_expr text; /* the density that the text states, where that is another one (deepen.h); else KARST_NO_EXPR */
    karst_expr gradient[3]; /* of the density, per metre, if has_gradient: see derive.h */
    bool has_gradient;
} karst_resolved_world;

/* karst_graph_check, and whether the roots are floats. */
bool karst_resolved_world_check(const karst_resolved_world *world, const char **fault);

/* Above this many nodes of generated code compilers take too long: a density runs its tape then (tape_world.clh), and a
 * gradient has none. */
#define KARST_EMIT_MAX_OPS 4000u
/* A call of noise is worth so many others: its text is short, what it calls is not. */
#define KARST_EMIT_NOISE_OPS 40u
/* And a sine of a place: exact turns of an affine form are reduced in 64 bits, which takes text. */
#define KARST_EMIT_TURNS_OPS 10u

#define KARST_NO_WORD 0xffffffffu

typedef struct {
    karst_resolved_world world;
    /* Per node: is_known, if it is uniform and its value is the host's; and the 64-bit word at which its record begins,
     * or KARST_NO_WORD:
     * - AFFINE: karst_linear;
     * - FLOOR, CELL, FRACT, MOD that take their argument's place (below): karst_cells;
     * - SIN_TURNS, COS_TURNS: karst_lattice;
     * - NOISE: its octaves, karst_octave each.
     * Of what is known but no constant, word is its number among the values, 32 bits each: a float, an int, a mask.
     * What the float leaves of the value follows num_values floats later.
     * What the density needs stands where it stands whatever shading needs, unless that have very many values. */
    uint8_t *is_known;
    uint32_t *word;
    uint32_t *image_word; /* of each noise of the graph that is an image which the roots reach: where that begins; 0 */
    uint32_t values_word; /* where the values begin */
    uint32_t num_values;
    uint32_t num_record_words; /* of all but images, which stand behind them */
    uint32_t num_words;        /* of all; not 0 */
    bool has_mapped;           /* some images lie in files: they begin at whole pages */
} karst_world_layout;

/* Words at the beginning that a layout leaves to others (bounds_shared.h). */
#define KARST_DATA_HEADER_WORDS 8u

/* Lays out the data of what the world's roots reach. Lives in the graph's arena; false: that is full. */
bool karst_world_layout_init(karst_world_layout *layout, const karst_resolved_world *world);

/* Fills num_words words; images that are mapped there already (words.h) stay. `parameters`: the value of each
 * PARAMETER. A voxel of level 0 is 2^voxel_log2_m metres wide. `words` is aligned to 8 bytes. false: out of memory.
 * Thread-safe. */
bool karst_world_data_fill(const karst_world_layout *layout, const karst_number *parameters, uint32_t seed,
                           int voxel_log2_m, void *words);

/* What the nearest float leaves of a number, as a float: the second half of a pair (wide.clh). */
float karst_number_rest(karst_number number);

/* True if the node works on the exact place of its argument number k, which is AFFINE or SHIFTED, not on its float. */
bool karst_takes_place(const karst_world_layout *layout, karst_expr e, int k);
/* True if the node is computed in pairs of floats: the same for every back end that is generated or interpreted. A
 * comparison, floor and the like are, if an argument is WIDE, whatever their own kind. */
bool karst_is_computed_wide(const karst_graph *graph, karst_expr e);
/* The AFFINE leaf behind an AFFINE or SHIFTED node. */
karst_expr karst_affine_behind(const karst_graph *graph, karst_expr e);
/* What moves an argument of a noise in its lattice: an offset, or all of an argument that has no exact place.
 * KARST_NO_EXPR: nothing does. */
karst_expr karst_noise_moved_by(const karst_graph *graph, karst_expr argument);
/* How every back end adds up the octaves of a NOISE node: its base, or OCTAVE_LEVEL of octave.clh for gradient noise
 * that is moved along its first or third argument, but not along its second. */
int karst_noise_way(const karst_graph *graph, karst_expr e);

#endif
