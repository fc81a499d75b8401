/* From syntax to graph: the text is executed once, with symbols for the position, and what it computes becomes the
 * graph. Calls are inlined, loops unrolled, vectors taken apart; branches on what varies execute both sides and select.
 */
#ifndef KARST_LANGUAGE_LOWER_H
#define KARST_LANGUAGE_LOWER_H

#include "producers/language/front/images.h"
#include "producers/language/front/parser.h"
#include "producers/language/graph/entries.h"

#define KARST_MAX_INLINING 64u
#define KARST_MAX_ITERATIONS 16384u
#define KARST_MAX_SELECT_ENTRIES 64u
#define KARST_MAX_RAW_NODES (1u << 20)
#define KARST_MAX_LIVE_NODES (1u << 16)
#define KARST_MAX_OCTAVES 512u
#define KARST_MAX_PARAMETERS 64u
/* The one implicit parameter that callers may set. */
#define KARST_TIME_PARAMETER "iTime"

/* A parameter as the front end sees it: a uniform float with a name. */
typedef struct {
    const char *name;
    karst_number value;
    bool is_implicit;   /* iTime and its like: appended when used */
    bool is_structural; /* out: it decided a loop, an array's size or a number of octaves: a change means compiling
                           again */
    bool is_used;       /* out */
} karst_lower_parameter;

typedef struct {
    karst_source *source;
    karst_names *names;
    karst_parser *parser;
    karst_graph *graph; /* empty */
    karst_lower_parameter parameters[KARST_MAX_PARAMETERS + 16];
    uint32_t num_parameters;
    double time_s; /* what iTime is */
    const karst_world_header *header; /* whose data the text may name */
    karst_world_image *images; /* the files that it does name, latest first; the caller's to free, whatever comes */
    /* out */
    karst_expr root[KARST_NUM_ROOTS];  /* KARST_NO_EXPR: no entry gives it, or the usual number is all that it is */
    bool has_entry[KARST_NUM_ENTRIES]; /* which of them run */
    uint32_t max_iterations_seen;
} karst_lowering;

/* Gives the user's text the structs that entries return (entries.h), if it names them as types; before it is parsed.
 * A struct of the user's hides one of these. */
void karst_entry_structs(karst_parser *parser, const karst_tokens *user);
/* Lowers all entry points. Errors go through the source. */
void karst_lower(karst_lowering *lowering);

#endif
