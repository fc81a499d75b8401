/* The data of a world that has a tape for its bounds: where what lies. Compiled twice: see core/device/dialect.h. */
#ifndef KARST_LANGUAGE_BOUNDS_SHARED_H
#define KARST_LANGUAGE_BOUNDS_SHARED_H

#include "core/device/dialect.h"

/* Thin matter is to be shown (producers/steps/raise.clh); bodies that share a face are to be one (seam.clh). */
#define KARST_RAISES_THIN 1u
#define KARST_RAISES_SEAMS 2u

/* The first words of the data; positions are words from its beginning. */
typedef struct {
    uint num_instructions;
    uint code;      /* karst_instruction */
    uint constants; /* of the tape */
    uint values;    /* of the layout */
    uint num_values;
    uint output; /* the operand that is the density */
    /* The same of a tape of the colours, if the world has one; 0 otherwise. */
    uint num_colour_instructions;
    uint colour_code;
    uint colour_constants;
    uint colour_output[3];
    uint raises_thin;  /* KARST_RAISES_*: how samples show matter */
    uint more_outputs; /* operands of what the shading's tape gives besides; 0: nothing */
    uint smooths_jumps; /* 1: samples tell how far jumps are (producers/steps/jump.clh) */
    int voxel_log2_m;   /* a voxel of level 0 is 2^that metres wide */
} karst_data_header;
K_ASSERT_SIZE(karst_data_header, 64);

/* The same of a tape with several outputs, all of which are bounded (tape_ranges.clh). */
#define KARST_MOST_RANGES 8
typedef struct {
    uint num_instructions;
    uint code, constants, values;
    uint num_values;
    uint output[KARST_MOST_RANGES]; /* operands */
    uint pad[3];
} karst_ranges_header;
K_ASSERT_SIZE(karst_ranges_header, 64);

#endif
