/* Tapes: a world's graph as instructions for the interpreters of tape.clh, which are compiled once for all worlds. */
#ifndef KARST_LANGUAGE_TAPE_H
#define KARST_LANGUAGE_TAPE_H

#include "core/device/context.h"
#include "producers/language/graph/data.h"
#include "producers/language/tape/tape_shared.h"

#define KARST_TAPE_MAX_OUTPUTS 16
_Static_assert(KARST_ROOT_LAST_TRANSPARENCY - KARST_ROOT_COLOUR < KARST_TAPE_MAX_OUTPUTS,
               "a tape may have all that shading gives");
/* Of a world that can be shown. Slots lie in private memory, 768 bytes each with 16 lanes: a thread's stack has room
 * for this many. */
#define KARST_TAPE_MOST_SLOTS 2048

typedef struct {
    karst_instruction *code; /* never NULL; every instruction writes its slot */
    uint32_t num_instructions;
    uint32_t *constants; /* bits; never NULL */
    uint32_t num_constants;
    uint32_t num_slots;                      /* at least 1 */
    uint32_t ops[2], wide_ops[2];            /* TAPE_OPS_LOW and so on */
    bool has_steps, has_curves;              /* TAPE_HAS_STEPS, TAPE_HAS_CURVES */
    bool has_images, has_fields;             /* OCTAVE_HAS_IMAGES of octave.clh, and a third axis */
    bool has_textures;                       /* OCTAVE_HAS_TEXTURES */
    bool has_smooth;                         /* TAPE_HAS_SMOOTH */
    uint32_t output[KARST_TAPE_MAX_OUTPUTS]; /* operands */
    uint32_t num_outputs;
} karst_tape;

/* The tape of what `roots` (1 to KARST_TAPE_MAX_OUTPUTS of them, reached by the layout's world) need. Memory is
 * malloc'ed. Thread-safe. Errors: KARST_BAD_WORLD for what no back end can execute (an op of a graph that was not
 * resolved), KARST_FAILED for lack of memory. */
bool karst_tape_build(const karst_world_layout *layout, const karst_expr *roots, uint32_t num_roots, karst_tape *tape,
                      karst_error *error);
/* The same without curves (tape_curve.clh), which only bounds need. */
bool karst_tape_build_plain(const karst_world_layout *layout, const karst_expr *roots, uint32_t num_roots,
                            karst_tape *tape, karst_error *error);
void karst_tape_finish(karst_tape *tape); /* a zeroed tape is fine */

/* Options of a build, for interpreters (tape.clh) that run this tape: room for its slots (TAPE_SLOTS, rounded up, so
 * that tapes share programs) and no op that it has not. At most KARST_TAPE_OPTIONS_BYTES. */
#define KARST_TAPE_OPTIONS_BYTES 256
void karst_tape_options(const karst_tape *tape, char *options, size_t size_bytes);

#endif
