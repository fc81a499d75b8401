/* Survey: what host and kernels share. Compiled twice, must agree bit for bit: see core/device/dialect.h. */
#ifndef KARST_CACHE_SURVEY_SHARED_H
#define KARST_CACHE_SURVEY_SHARED_H

#include "cache/layout_shared.h"

/* What is looked through: slots of tiles, slots of bricks, request chunks. */
#define KARST_SURVEY_TILES 0u
#define KARST_SURVEY_BRICKS 1u
#define KARST_SURVEY_REQUESTS 2u
#define KARST_SURVEY_KINDS 3

typedef struct {
    uint num[KARST_SURVEY_KINDS]; /* entries; slot 0 counts */
    uint serial;                  /* what carries it is in use */
    uint ages[2];   /* of tiles and bricks: find the slots that were not used for so many casts or more; 0: none */
    uint most[2];   /* of exactly that age so many, the first ones: often a whole view was last used in one cast */
    uint stand_ins; /* 1: of bricks find those that are in use only as a stand-in, whatever ages[1] (but most[1]) */
    uint pad[3];
} karst_survey_ask;
K_ASSERT_SIZE(karst_survey_ask, 48);

typedef struct {
    uint num_used[2];
    uint num_found[2];
    uint num_left_out[2]; /* of exactly the age, behind those that were found */
    uint num_active;      /* request chunks with a want */
    uint num_wants;       /* nodes with a valid want; written by karst_wants_list */
} karst_survey_result;
K_ASSERT_SIZE(karst_survey_result, 32);

/* A slot that was found. */
typedef struct {
    uint slot, age;
} karst_survey_slot;
K_ASSERT_SIZE(karst_survey_slot, 8);

/* Casts since a stamp; never (0) is the longest. Serials wrap, and ages with them. */
K_INLINE uint karst_survey_age(uint stamp, uint serial) { return stamp == 0u ? 0xffffffffu : serial - stamp; }

#endif
