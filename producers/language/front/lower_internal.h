/* What the parts of the lowering share. Every value is an array of scalars in one stack of slots; variables live there
 * too.
 *
 * Branches: while a branch is open, every change of a variable is written in a journal. Closing the branch takes the
 * changes out again; merging two sides makes each changed variable a select of its two values. So inside a branch, text
 * reads what it wrote, without masks. */
#ifndef KARST_LANGUAGE_LOWER_INTERNAL_H
#define KARST_LANGUAGE_LOWER_INTERNAL_H

#include "producers/language/front/lower.h"

#define KARST_MAX_SLOTS (1u << 19)
#define KARST_MAX_STEPS 2000000u /* expressions executed: about a second */
#define KARST_MAX_DEPTH 2000u    /* of C's recursion over calls and nested text together */

/* A value: type->num_scalars expressions, in the slot stack (valid until it is released) or elsewhere. */
typedef struct {
    const karst_type *type;
    karst_expr *e;
} karst_value;

typedef struct {
    uint32_t name;
    const karst_type *type;
    uint32_t slot; /* of its first scalar */
    bool is_const;
} karst_variable;

typedef struct {
    uint32_t slot;
    karst_expr value; /* before, in the journal; after, in the changes */
} karst_change;

/* What is open while a function is executed. Slots of bools that say which lanes have left: merged like any variable.
 */
typedef struct {
    const karst_ast_function *function;
    const karst_type *result_type;
    uint32_t result, returned, broken, continued;
    bool may_break, may_continue; /* in a loop or a switch; in a loop */
    size_t first_variable, first_in_block;
    struct karst_loop *loop; /* whose body is being lowered, outside of a switch; NULL: none (lower_stmt.c) */
} karst_frame;

typedef struct {
    karst_ast_variable *ast;
    const karst_type *type;
    uint32_t slot;
    karst_expr *initial; /* what its initialiser gave */
    bool ready, busy, written, warned;
} karst_global;

typedef struct karst_lower_state karst_lower_state;

/* What the lower parts call that lies above them: places, calls and types hold expressions, which hold them again, and
 * a call executes the statements of a body. */
typedef struct {
    karst_value (*expression)(karst_lower_state *s, const karst_ast_expr *e);
    karst_value (*whole)(karst_lower_state *s, const karst_ast_expr *e);
    karst_value (*initialiser)(karst_lower_state *s, const karst_ast_expr *e, const karst_type *type);
    void (*body)(karst_lower_state *s, const karst_ast_statement *body);
} karst_lower_rules;

struct karst_lower_state {
    karst_lowering *io;
    karst_source *source;
    karst_names *names;
    karst_parser *parser;
    karst_arena *arena;
    karst_graph *graph;
    karst_array_types array_types;
    karst_expr *slots;
    uint32_t top, global_top; /* locals grow up, globals down */
    uint32_t *stamps, serial; /* per slot: scratch marks of merging */
    karst_expr *marks;
    karst_variable *variables;
    size_t num_variables, variable_room;
    karst_change *journal, *changes;
    size_t num_journal, journal_room, num_changes, change_room;
    uint32_t open_branches;
    karst_global *globals;
    uint32_t num_globals;
    karst_frame frame;
    uint32_t steps, depth, inlined, iterations;
    karst_expr no, yes, zero; /* constants */
    karst_lower_rules rules;
};

static inline karst_value karst_lower_expression(karst_lower_state *s, const karst_ast_expr *e)
{
    return s->rules.expression(s, e);
}
/* The same, but a variable's value is not copied: valid until the variable changes. */
static inline karst_value karst_lower_whole(karst_lower_state *s, const karst_ast_expr *e)
{
    return s->rules.whole(s, e);
}
static inline karst_value karst_lower_initialiser(karst_lower_state *s, const karst_ast_expr *e, const karst_type *type)
{
    return s->rules.initialiser(s, e, type);
}
/* Executes the body of a function, with its parameters declared, as the only thing in `s->frame`. */
static inline void karst_lower_body(karst_lower_state *s, const karst_ast_statement *body) { s->rules.body(s, body); }

/* ---- lower_state.c ---- */
karst_expr *karst_slots_push(karst_lower_state *s, uint32_t count, uint32_t where);
static inline uint32_t karst_slot_index(const karst_lower_state *s, const karst_expr *e)
{
    return (uint32_t)(e - s->slots);
}
karst_value karst_value_new(karst_lower_state *s, const karst_type *type, uint32_t where);
karst_value karst_value_zero(karst_lower_state *s, const karst_type *type, uint32_t where);
void karst_slot_set(karst_lower_state *s, uint32_t slot, karst_expr value);
/* Counts work and C recursion. */
void karst_lower_enter(karst_lower_state *s, uint32_t where);
static inline void karst_lower_leave(karst_lower_state *s) { s->depth--; }
typedef struct {
    size_t journal, changes;
    uint32_t top;
} karst_branch;
karst_branch karst_branch_open(karst_lower_state *s);
/* Takes what changed since out again; the changes stay on the stack of changes. Values made in the branch stay. */
void karst_branch_close(karst_lower_state *s, karst_branch branch);
/* Merges changes [first, middle) made where `condition` holds with [middle, end) made where it does not; drops them. */
void karst_branch_merge(karst_lower_state *s, karst_expr condition, size_t first, size_t middle);
karst_variable *karst_variable_declare(karst_lower_state *s, uint32_t name, const karst_type *type, bool is_const,
                                       uint32_t where);
karst_variable *karst_variable_find(karst_lower_state *s, uint32_t name);
/* Whose text is being executed: names are looked up in the prelude alone while its own functions run. */
static inline bool karst_in_prelude(const karst_lower_state *s)
{
    return s->frame.function && s->frame.function->is_prelude;
}
const char *karst_lower_name(const karst_lower_state *s, uint32_t name);

/* ---- lower_convert.c ---- */
/* An int or float that is known now; `what` begins the error: "the size of an array". Parameters that decide it become
 * structural. */
karst_number karst_lower_constant(karst_lower_state *s, karst_expr e, const char *what, uint32_t where);
/* Uniform, with a value that the host can compute. */
bool karst_lower_is_known(karst_lower_state *s, karst_expr e);
bool karst_lower_try_constant(karst_lower_state *s, karst_expr e, karst_number *number);
/* `value` as `to`, or an error that names both: "cannot use a vec3 as float". */
karst_value karst_lower_convert(karst_lower_state *s, karst_value value, const karst_type *to, const char *context,
                                uint32_t where);
/* "an int", for messages. */
const char *karst_a_type(karst_lower_state *s, const karst_type *type);
/* "(vec3, float)", for messages. */
const char *karst_type_list(karst_lower_state *s, const karst_value *arguments, uint32_t count);

/* ---- lower_global.c ---- */
karst_global *karst_global_find(karst_lower_state *s, uint32_t name); /* evaluates its initialiser at the first call */
#define KARST_MAX_DIMENSIONS 8u /* arrays of arrays */
/* The type of a variable with or without a value. */
const karst_type *karst_lower_declared(karst_lower_state *s, const karst_ast_variable *v);
/* `elements`: the first of what an array is made of, for sizes that are left open; NULL: none. */
const karst_type *karst_lower_type(karst_lower_state *s, const karst_ast_type *type, const karst_ast_expr *elements,
                                   uint32_t where);

/* ---- lower_expr.c ---- */
karst_value karst_rule_expression(karst_lower_state *s, const karst_ast_expr *e);
karst_value karst_rule_whole(karst_lower_state *s, const karst_ast_expr *e);
karst_value karst_rule_initialiser(karst_lower_state *s, const karst_ast_expr *e, const karst_type *type);
karst_value karst_lower_arithmetic(karst_lower_state *s, uint32_t op, karst_value a, karst_value b, uint32_t where);
karst_expr karst_lower_condition(karst_lower_state *s, const karst_ast_expr *e, const char *context);

/* ---- lower_place.c: what can be assigned to, and parts of values ---- */
typedef struct {
    const karst_type *type;
    uint32_t num_choices; /* 1, or the entries of an array that a varying index picks from */
    karst_expr index;     /* of the choice, clamped */
    uint32_t *slots;      /* of choice k: slots[k * type->num_scalars] onwards */
} karst_place;
karst_place karst_lower_place(karst_lower_state *s, const karst_ast_expr *e, const char *why);
karst_value karst_place_read(karst_lower_state *s, const karst_place *place, uint32_t where);
void karst_place_write(karst_lower_state *s, const karst_place *place, karst_value value);
karst_value karst_lower_member(karst_lower_state *s, const karst_ast_expr *e);
karst_value karst_lower_index(karst_lower_state *s, const karst_ast_expr *e);

/* ---- lower_call.c ---- */
karst_value karst_lower_call(karst_lower_state *s, const karst_ast_expr *e);
karst_value karst_lower_construct(karst_lower_state *s, const karst_ast_expr *e);
/* Where the value of an out parameter goes. */
typedef struct {
    const karst_ast_expr *text;
    bool is_found; /* before the call: `place` is where */
    karst_place place;
} karst_argument_place;
/* `places`: of each of `count` arguments; NULL: what it puts out is lost. Other parameters have values of their own. */
karst_value karst_lower_function(karst_lower_state *s, karst_ast_function *f, const karst_value *arguments,
                                 uint32_t count, const karst_argument_place *places, uint32_t where);

/* ---- lower_builtin.c ---- */
/* false: there is no built-in of that name. Errors if there is, but not for these arguments. */
bool karst_lower_builtin(karst_lower_state *s, const char *name, karst_value *arguments, uint32_t count, uint32_t where,
                         karst_value *result);
bool karst_is_builtin(const char *name);
/* Each in turn, from 0; NULL past the last. What the prelude defines is not among them. */
const char *karst_builtin_name(size_t number);
void karst_offer_builtins(karst_nearest *nearest);

/* ---- lower_range.c ---- */
/* Whether the condition of a loop is false whatever the choices in it come to. */
bool karst_lower_never_holds(const karst_lower_state *s, karst_expr condition);
/* Whether it compares what is known with a choice of numbers. */
bool karst_lower_has_bound(const karst_lower_state *s, karst_expr condition);

/* ---- lower_image.c ---- */
/* The channels, 1 or 3, of the data of that name (NULL: it is none) at a place in metres; returns how many there are.
 * `where` is that of the name. Errors: no such data, or a file that cannot be read. */
uint32_t karst_lower_image(karst_lower_state *s, const char *name, uint32_t where, const karst_expr place[2],
                           karst_expr value[3]);
/* The same in space, from three sides as the normal has it, as if all samples of a row took `size` metres. Errors also:
 * it does not repeat. */
uint32_t karst_lower_texture(karst_lower_state *s, const char *name, uint32_t where, const karst_expr place[3],
                             const karst_expr normal[3], karst_expr size, karst_expr value[3]);

/* The value of the grid of that name's data at a place in the file's own coordinates, in metres. Errors: as above. */
karst_expr karst_lower_field(karst_lower_state *s, const char *name, uint32_t where, const karst_expr place[3]);

/* ---- lower_stmt.c ---- */
void karst_lower_statements(karst_lower_state *s, const karst_ast_statement *first);
void karst_rule_body(karst_lower_state *s, const karst_ast_statement *body);

#endif
