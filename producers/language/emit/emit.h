/* From a resolved graph to a density program: text in the lane dialect that fills the seam of
 * producers/steps/density.clh.
 *
 * The text is straight-line code, one line a node, in order of index, and calls the same lane functions (ops.clh) as
 * every other back end. Nothing of the user's text is in it: values are v1, v2, ..., numbers are hexadecimal, and what
 * a parameter decides is read from the world's data (data.h), so that changing one compiles nothing.
 *
 * Two forms of the same nodes:
 *   - point: all of them, at any exact positions;
 *   - brick: each node once for what it depends on. What depends on no axis is done once a brick, on one axis once for
 *     each sample along it, on two once for each of their pairs, and only the rest for each row of samples.
 */
#ifndef KARST_LANGUAGE_EMIT_H
#define KARST_LANGUAGE_EMIT_H

#include "core/device/context.h"
#include "producers/language/graph/data.h"

/* Octaves are 140 bytes each of a brick's working memory. */
#define KARST_EMIT_MAX_OCTAVES 2048u
/* Octaves of a brick that are tensor products; others cost ten times as much. */
#define KARST_EMIT_MAX_TENSORS 48u
/* Noises that they may belong to: each keeps the sums of a whole brick, 20 KiB of working memory. */
#define KARST_EMIT_MAX_TENSOR_NOISES 16u
/* Octaves of Worley's noise whose cells a brick hashes once; others cost several times as much. */
#define KARST_EMIT_MAX_TABLES 8u
/* Octaves of a brick whose gradients stand in tables (noise/table.clh), 2.3 KiB each; others hash every corner. */
#define KARST_EMIT_MAX_GRADIENTS 96u
/* Of these, octaves that sum whole planes of rows (noise/table_rows.clh), 7.5 KiB each. */
#define KARST_EMIT_MAX_ROWS 32u

/* Octaves of colours that are made ready at an anchor (near.clh), 180 bytes each of a work-group's memory. */
#define KARST_EMIT_MAX_NEAR_OCTAVES 64u

typedef struct {
    char *source;            /* malloc'ed text of "world.clh" */
    char *colour_source;     /* malloc'ed text of what shading runs (raycast/light/shade.h); NULL: there is nothing */
    uint32_t num_point_ops;  /* nodes of world_point */
    uint32_t num_colour_ops; /* of that; 0 if there is none */
    uint32_t num_ops[8];     /* of the brick form by what they depend on: bits KARST_DEPENDS_X, _Y, _Z */
    bool is_tape;            /* `source` is the tape's interpreter: no ops are counted but those of colours */
    bool is_colour_tape;     /* the same of `colour_source` */
    bool is_gradient_noise_alone; /* of the density */
} karst_emitted;

/* What stands at the head of programs of worlds with no noise but gradient noise: others take time to compile
 * (octave.clh). */
#define KARST_EMIT_ONLY_GRADIENT "#define OCTAVE_ONLY_GRADIENT\n"
/* And of worlds with images; as options of a build have it, too. */
#define KARST_EMIT_HAS_IMAGES "#define OCTAVE_HAS_IMAGES 1\n"
#define KARST_EMIT_HAS_TEXTURES "#define OCTAVE_HAS_TEXTURES 1\n"
#define KARST_EMIT_HAS_FIELDS KARST_EMIT_HAS_IMAGES "#define IMAGE_MOST_AXES 3\n"

/* Whether the density is too large for text, so that karst_emit_world writes the tape's interpreter. Errors:
 * KARST_FAILED (memory). Thread-safe. */
bool karst_emit_is_tape(const karst_world_layout *layout, bool *is_tape, karst_error *error);
/* Writes the program of a world. Errors: KARST_FAILED. Free with karst_emitted_finish. */
bool karst_emit_world(const karst_world_layout *layout, karst_emitted *emitted, karst_error *error);
/* Writes world_point and world_surface (raycast/cast/refine.h) of a world that has a gradient (derive.h): malloc'ed
 * text. Errors: as above, of density and gradient. */
bool karst_emit_surface(const karst_world_layout *layout, char **source, karst_error *error);
/* The same of two worlds in one text, whose functions are world_point and world_surface of the first, other_point and
 * other_surface of the second. */
bool karst_emit_two_surfaces(const karst_world_layout *layout, const karst_world_layout *other, char **source,
                             karst_error *error);
void karst_emitted_finish(karst_emitted *emitted);

#endif
