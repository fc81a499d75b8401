/* What the parts of emit share: a piece of code being written, and where it finds what it does not compute itself. */
#ifndef KARST_LANGUAGE_EMIT_INTERNAL_H
#define KARST_LANGUAGE_EMIT_INTERNAL_H

#include "producers/language/emit/emit.h"
#include "producers/language/emit/emit_text.h"

/* Axes, as in karst_expr_node.depends. */
#define KARST_AXES (KARST_DEPENDS_X | KARST_DEPENDS_Y | KARST_DEPENDS_Z)

/* A straight piece of code. In all but the point form it computes the nodes that depend on just its axes, for samples
 * `lane` along the first of them, `iy` and `iz` along the others. */
typedef struct {
    bool is_point;  /* everything, at any position `at` in each lane */
    bool is_near;   /* such positions are also steps `near` from an anchor, and `octaves` are known there */
    bool is_sample; /* everything, at any samples `ix`, `iy`, `iz` of a brick */
    uint8_t axes;   /* what its nodes depend on; lanes run along the first of them */
} karst_block;

/* What a node is to the code. */
typedef struct {
    uint8_t axes;          /* that it depends on */
    uint8_t needs;         /* KARST_PART_*: what some block computes */
    uint8_t keeps;         /* what the brick form hands from one block to others */
    uint8_t is_tensor;     /* a noise that 16 lanes evaluate as a tensor product over the brick */
    uint8_t is_table;      /* Worley's noise whose cells 16 lanes hash once for the brick */
    uint8_t has_gradients; /* gradient noise for which 16 lanes look gradients up, where they take no tensor */
    uint8_t has_rows;      /* such a noise whose octaves are added to all rows of a plane at once */
    uint8_t is_gathered;   /* see emit_brick.c */
    uint32_t near;         /* of a noise: 1 + the number of its first octave among `octaves`; 0: it has none there */
    karst_expr texture; /* of a NOISE of one: the first that is wanted of those that are the same but for the channel */
    karst_expr partner; /* of F1 the F2 of the same call, and back; KARST_NO_EXPR if only one is wanted */
} karst_emit_node;

/* A node's value is v12, or, for nodes of kind WIDE, the pair h12 and l12. AFFINE and SHIFTED have both, where wanted.
 */
#define KARST_PART_VALUE 1u
#define KARST_PART_PAIR 2u
typedef struct {
    karst_expr e;
    uint8_t part;
} karst_emit_input;
#define KARST_MAX_INPUTS 4

typedef struct {
    const karst_world_layout *layout;
    const karst_graph *graph;
    karst_emit_node *nodes;
    karst_text text;
    karst_block block;
    uint32_t *placed; /* per data word: serial of the block that declared its place last */
    uint32_t serial;  /* of the block */
} karst_emit;

/* ---- emit_marks.c ---- */
/* Sets `nodes` afresh: what the roots need. Returns how many nodes that is. */
uint32_t karst_emit_mark(karst_emit *emit, const karst_expr *roots, size_t num_roots);
/* The nodes whose values the line of a node reads. */
size_t karst_emit_inputs(const karst_emit *emit, karst_expr e, karst_emit_input inputs[KARST_MAX_INPUTS]);
/* True for nodes that compute with pairs, whatever they give. */
bool karst_emit_is_wide(const karst_emit *emit, karst_expr e);
void karst_emit_begin_block(karst_emit *emit, karst_block block);
/* The name of what a block of these axes keeps: "xz"; "b" for none. */
const char *karst_emit_axes_name(uint8_t axes);
/* F1 or F2, not a derivative. */
bool karst_emit_is_worley(const karst_emit *emit, karst_expr e);
/* Whether the face of a brick is best made in rows along y: where no noise is, but tensors. */
bool karst_emit_face_in_rows(const karst_emit *emit);

/* ---- emit_operands.c ---- */
#define KARST_OPERAND_BYTES 160
typedef struct {
    char text[KARST_OPERAND_BYTES];
} karst_operand;
/* "v12", or how this block reads a value that another computed, or a number. */
karst_operand karst_emit_operand(const karst_emit *emit, karst_expr e);
/* The same as a pair. */
karst_operand karst_emit_wide_operand(const karst_emit *emit, karst_expr e);
/* "vfloat" or "vint". */
const char *karst_emit_type(const karst_emit *emit, karst_expr e);
/* The axis on which the exact place of a node's argument depends (data.h); 0: it takes none, or depends on several. */
uint8_t karst_emit_place_axis(const karst_emit *emit, karst_expr e);
/* Declares that place, once a block: "c" and the word of its record. */
void karst_emit_declare_place(karst_emit *emit, karst_expr e);
const char *karst_emit_place_type(const karst_emit *emit, karst_expr e);
/* True the first time in a block that a place's record is asked for. */
bool karst_emit_is_new_place(karst_emit *emit, karst_expr e);

/* ---- emit_octaves.c ---- */
const char *karst_emit_shape_name(uint8_t shape); /* as octave.clh has it */
/* The axis that an argument changes along by itself, or any, `otherwise`, if it does along none; -1: along several. */
int karst_emit_axis_of(const karst_emit *emit, karst_expr argument, int otherwise);
/* True if the lattice's axes are the brick's: argument i is affine in axis i alone, or 0. */
bool karst_emit_has_bricks_axes(const karst_emit *emit, karst_expr e);
/* True if it is bent along x and z at most, on a lattice that has the brick's axes: all lanes of a row have one y. */
bool karst_emit_has_level_rows(const karst_emit *emit, karst_expr e);
/* karst_noise_way as octave.clh has it in names. */
const char *karst_emit_way_name(const karst_emit *emit, karst_expr e);
/* Gradient noise, not a derivative. */
bool karst_emit_is_gradient(const karst_emit *emit, karst_expr e);
bool karst_emit_may_be_tensor(const karst_emit *emit, karst_expr e);
/* The beginning of a loop over octaves, up to its `weight`. */
void karst_emit_begin_octaves(karst_emit *emit, karst_expr e);
/* What of an image or a texture is known at the anchor, where it is: `near_octave`. */
void karst_emit_near_image(karst_emit *emit, karst_expr e);
/* `q`: where the octave's arguments lie, in each lane. */
void karst_emit_place(karst_emit *emit, karst_expr e);

/* ---- emit_slopes.c ---- */
/* A noise and its derivatives from one evaluation, where the point form wants derivatives of gradient noise: all lines
 * of the group with its first node, none with the others. False: the node is none of these. */
bool karst_emit_slope_lines(karst_emit *emit, karst_expr e);

/* ---- emit_worley.c ---- */
void karst_emit_worley_lines(karst_emit *emit, karst_expr e);

/* ---- emit_texture.c ---- */
/* All channels of a texture that are wanted, with the first of them; no lines with the others. */
void karst_emit_texture_lines(karst_emit *emit, karst_expr e);

/* ---- emit_noise.c ---- */
void karst_emit_noise_lines(karst_emit *emit, karst_expr e);
/* Numbers the octaves of what is marked whose arguments depend on one axis each, and writes world_colour_prepare. */
void karst_emit_near_octaves(karst_emit *emit);

/* ---- emit_ops.c ---- */
/* The lines that compute a node: "const vfloat v12 = ...;". */
void karst_emit_lines(karst_emit *emit, karst_expr e);

/* ---- emit_point.c ---- */
void karst_emit_points(karst_emit *emit, karst_emitted *emitted);
/* What stands before the code of a world whose shading has more outputs than the colour: how many there are, and where
 * each begins. */
void karst_emit_output_names(karst_emit *emit);
void karst_emit_shading(karst_emit *emit, karst_emitted *emitted);
void karst_emit_surfaces(karst_emit *emit);

/* ---- emit_choice.c ---- */
/* The lines of all marked nodes, in a point block, with what only one side of a mix needs under a test. False: nothing
 * is written, since nothing can be left out (or memory is out): the nodes' lines in order will do. */
bool karst_emit_choice_lines(karst_emit *emit, const karst_expr *roots, size_t num_roots);

/* ---- emit_brick.c ---- */
void karst_emit_bricks(karst_emit *emit, karst_emitted *emitted);

#endif
