/* The entry points. */
#include "producers/language/front/lower_internal.h"

#include <string.h>

static void graph_full(void *user, uint32_t where)
{
    karst_lower_state *s = user;
    karst_source_error(s->source, where, "make the loops shorter, or call fewer functions in them",
                       "the world unrolls to more than %u operations", KARST_MAX_RAW_NODES);
}

static void note_full(void *user, uint32_t where)
{
    (void)where;
    graph_full(user, ((karst_lower_state *)user)->graph->where);
}

/* All globals start anew for each entry: nothing goes from one to the other. */
static void reset(karst_lower_state *s)
{
    uint32_t count = 0;
    for (karst_ast_variable *v = s->parser->globals; v; v = v->next)
        count++;
    s->globals = karst_arena_alloc(s->arena, (count + 1) * sizeof *s->globals);
    s->num_globals = count;
    count = 0;
    for (karst_ast_variable *v = s->parser->globals; v; v = v->next)
        s->globals[count++].ast = v;
    s->top = 0;
    s->global_top = KARST_MAX_SLOTS;
    s->num_variables = 0;
    s->frame = (karst_frame){0};
}

/* ---- which functions they are ---- */

static bool is_plain(const karst_ast_type *type) { return !type->size && !type->unsupported; }

/* The struct that an entry gives: the language's own, which the text may have hidden. */
static bool is_own_struct(const karst_lower_state *s, const karst_ast_struct *structure, const char *name)
{
    return structure->usual && !strcmp(karst_lower_name(s, structure->name), name);
}

static bool has_signature(const karst_lower_state *s, const karst_ast_function *f, karst_entry entry)
{
    const karst_entry_info *e = &karst_entries[entry];
    const karst_type *result = karst_type_named(e->result);
    bool fits =
        f->num_parameters == e->num_inputs && !f->num_defaults && is_plain(&f->result) &&
        (result ? f->result.base == result : f->result.structure && is_own_struct(s, f->result.structure, e->result));
    for (const karst_ast_variable *p = f->parameters; p && fits; p = p->next)
        fits = p->type.base == karst_type_vector(KARST_TYPE_FLOAT, 3) && is_plain(&p->type) && !p->is_out;
    return fits;
}

static bool has_name(const karst_lower_state *s, const karst_ast_function *f, karst_entry entry)
{
    const char *name = karst_lower_name(s, f->name), *other = karst_entries[entry].other_name;
    return !strcmp(name, karst_entries[entry].name) || (other && !strcmp(name, other));
}

static bool is_entry(const karst_lower_state *s, const karst_ast_function *f, karst_entry entry)
{
    return !f->is_prelude && has_name(s, f, entry) && has_signature(s, f, entry);
}

/* The one with a body, if it is only declared elsewhere; its first spelling, if it is there in both. */
static karst_ast_function *find_entry(karst_lower_state *s, karst_entry entry)
{
    karst_ast_function *found = NULL;
    for (karst_ast_function *f = s->parser->functions; f; f = f->next) {
        if (!is_entry(s, f, entry))
            continue;
        if (f->body && found && found->body && f->name == found->name)
            karst_source_error(s->source, f->where, "rename one of them", "there are two functions '%s' with a body",
                               karst_lower_name(s, f->name));
        bool is_first_spelling = !strcmp(karst_lower_name(s, f->name), karst_entries[entry].name);
        if (!found || (f->name == found->name ? f->body != 0 : is_first_spelling))
            found = f;
    }
    return found;
}

/* ---- what there is to say of those that are missing ---- */

/* The function whose name is most like an entry's, or NULL; with its parameters and result, if `like_it`. */
static const karst_ast_function *find_misspelt(karst_lower_state *s, karst_entry entry, bool like_it)
{
    const char *wanted = karst_entries[entry].name;
    karst_nearest nearest = karst_nearest_begin(wanted, strlen(wanted));
    const karst_ast_function *found = NULL;
    for (const karst_ast_function *f = s->parser->functions; f; f = f->next) {
        const char *best = nearest.best;
        if (f->is_prelude || (like_it && !has_signature(s, f, entry)))
            continue;
        karst_nearest_offer(&nearest, karst_lower_name(s, f->name));
        if (nearest.best != best)
            found = f;
    }
    return found;
}

/* A function of an entry's name that is none; NULL: there is none that nothing calls. */
static const karst_ast_function *find_stranger(const karst_lower_state *s, karst_entry entry, bool may_be_called)
{
    for (const karst_ast_function *f = s->parser->functions; f; f = f->next)
        if (!f->is_prelude && has_name(s, f, entry) && !has_signature(s, f, entry) && (may_be_called || !f->statement))
            return f;
    return NULL;
}

static const char *write_it(const karst_lower_state *s, karst_entry entry)
{
    char signature[KARST_SIGNATURE_BYTES];
    karst_entry_signature(entry, signature);
    return karst_format(s->arena, "write %s", signature);
}

static _Noreturn void no_density(karst_lower_state *s)
{
    static const char *const likely[] = {"map",     "sdf",     "scene",   "de",       "DE", "dist",
                                         "GetDist", "getDist", "sdScene", "sceneSDF", "f"};
    const karst_type *vec3 = karst_type_vector(KARST_TYPE_FLOAT, 3);
    const karst_ast_function *stranger = find_stranger(s, KARST_ENTRY_DENSITY, true);
    for (const karst_ast_variable *p = stranger ? stranger->parameters : NULL; p; p = p->next)
        if (p->type.unsupported)
            karst_lower_type(s, &p->type, NULL, p->where); /* says what it is that is not there */
    if (stranger)
        karst_source_error(s->source, stranger->where, write_it(s, KARST_ENTRY_DENSITY),
                           "'%s' has other parameters or another result here", karst_lower_name(s, stranger->name));
    for (size_t i = 0; i < sizeof likely / sizeof *likely; i++) {
        const karst_ast_function *found = NULL;
        for (const karst_ast_function *f = s->parser->functions; f; f = f->next)
            if (!f->is_prelude && !strcmp(karst_lower_name(s, f->name), likely[i]) && (f->body || !found))
                found = f;
        if (!found || found->num_parameters != 1 || found->parameters->type.base != vec3)
            continue;
        const karst_type *result = found->result.base;
        const char *part = result == karst_type_vector(KARST_TYPE_FLOAT, 1) ? "" : result ? ".x" : NULL;
        if (part)
            karst_source_error(
                s->source, found->where,
                karst_format(s->arena, "add the line: float density(vec3 p) { return -%s(p)%s; }", likely[i], part),
                "there is no function 'density', but '%s' looks like a distance", likely[i]);
    }
    const karst_ast_function *misspelt = find_misspelt(s, KARST_ENTRY_DENSITY, false);
    if (misspelt)
        karst_source_error(s->source, misspelt->where, "is this it? Then call it density",
                           "there is no function 'density', but a '%s'", karst_lower_name(s, misspelt->name));
    karst_source_error(s->source, s->source->length, "write float density(vec3 p) { return -p.y; }",
                       "there is no function 'density'");
}

/* Of an entry that need not be there. */
static void hint_missing(karst_lower_state *s, karst_entry entry)
{
    const karst_ast_function *stranger = find_stranger(s, entry, true), *unused = find_stranger(s, entry, false);
    const karst_ast_function *misspelt = stranger ? NULL : find_misspelt(s, entry, true);
    const char *name = karst_entries[entry].name;
    /* Many a function that a density calls looks like one that fills bricks. */
    if (misspelt && !(karst_entries[entry].num_inputs == KARST_INPUT_PLACE && misspelt->statement))
        karst_source_warn(s->source, misspelt->where, karst_format(s->arena, "is this it? Then call it %s", name),
                          "there is no function '%s', but a '%s'", name, karst_lower_name(s, misspelt->name));
    if (unused)
        karst_source_warn(s->source, unused->where, write_it(s, entry),
                          "'%s' is not used: it has other parameters or another result than Karst's own",
                          karst_lower_name(s, unused->name));
}

/* ---- the structs that they give ---- */

static bool has_struct(karst_entry entry) { return !karst_type_named(karst_entries[entry].result); }

/* A struct's name that another name follows: no variable or function of the text's own can look so. */
static bool is_used_as_type(const karst_tokens *tokens, uint32_t name)
{
    for (size_t i = 0; i + 1 < tokens->count; i++)
        if (tokens->items[i].kind == KARST_TOKEN_NAME && tokens->items[i].what == name &&
            tokens->items[i + 1].kind == KARST_TOKEN_NAME)
            return true;
    return false;
}

static karst_ast_struct *make_struct(karst_parser *parser, karst_entry entry, uint32_t name)
{
    const karst_entry_info *e = &karst_entries[entry];
    karst_ast_struct *made = karst_arena_alloc(parser->arena, sizeof *made);
    double *usual = karst_arena_alloc(parser->arena, KARST_NUM_ROOTS * sizeof *usual);
    karst_ast_variable **link = &made->fields;
    *made = (karst_ast_struct){.name = name, .usual = usual};
    for (int o = e->first; o <= (int)e->last; o++) {
        const karst_output_info *output = &karst_outputs[o];
        karst_ast_variable *field = karst_arena_alloc(parser->arena, sizeof *field);
        *field = (karst_ast_variable){.name = karst_names_id(parser->names, output->name, strlen(output->name)),
                                      .type.base = karst_type_vector(KARST_TYPE_FLOAT, output->num_floats)};
        for (uint32_t i = 0; i < output->num_floats; i++)
            *usual++ = output->usual;
        *link = field;
        link = &field->next;
    }
    return made;
}

void karst_entry_structs(karst_parser *parser, const karst_tokens *user)
{
    for (int entry = 0; entry < KARST_NUM_ENTRIES; entry++) {
        const char *result = karst_entries[entry].result;
        if (!has_struct((karst_entry)entry))
            continue;
        const uint32_t name = karst_names_id(parser->names, result, strlen(result));
        if (!is_used_as_type(user, name))
            continue;
        karst_ast_struct *made = make_struct(parser, (karst_entry)entry, name);
        made->next = parser->structs;
        parser->structs = made;
    }
    parser->outer_structs = parser->structs;
}

/* ---- running them ---- */

static karst_value input(karst_lower_state *s, karst_op op, uint32_t where)
{
    karst_value v = karst_value_new(s, karst_type_vector(KARST_TYPE_FLOAT, 3), where);
    for (uint32_t i = 0; i < 3; i++)
        v.e[i] = karst_graph_leaf(s->graph, op, i);
    return v;
}

/* What is always the usual number costs nobody anything. */
static bool is_usual(karst_lower_state *s, const karst_output_info *output)
{
    const karst_expr usual = karst_graph_number(s->graph, KARST_TYPE_FLOAT, karst_number_shortest(output->usual));
    bool is_all = true;
    for (uint32_t i = 0; i < output->num_floats; i++)
        is_all = is_all && s->io->root[output->root + i] == usual;
    return is_all;
}

static void run_entry(karst_lower_state *s, karst_entry entry, karst_ast_function *f)
{
    const karst_entry_info *e = &karst_entries[entry];
    reset(s);
    karst_value arguments[2] = {input(s, KARST_OP_POSITION, f->where)};
    if (e->num_inputs == KARST_INPUT_PLACE_AND_NORMAL)
        arguments[1] = input(s, KARST_OP_NORMAL, f->where);
    karst_value value = karst_lower_function(s, f, arguments, f->num_parameters, NULL, f->where);
    memcpy(s->io->root + karst_outputs[e->first].root, value.e, value.type->num_scalars * sizeof *value.e);
    for (int o = (int)e->first + 1; o <= (int)e->last; o++)
        if (o != KARST_OUTPUT_AIR_ALBEDO && is_usual(s, &karst_outputs[o])) /* of shading there is always a colour */
            memset(s->io->root + karst_outputs[o].root, 0, karst_outputs[o].num_floats * sizeof(karst_expr));
    s->io->has_entry[entry] = true;
}

/* A later one of those found gives all that this one does; KARST_NUM_ENTRIES: none does. */
static int find_replacement(karst_ast_function *const found[KARST_NUM_ENTRIES], int entry)
{
    int later = entry + 1;
    while (later < KARST_NUM_ENTRIES && !(found[later] && karst_entries[later].first <= karst_entries[entry].first &&
                                          karst_entries[later].last >= karst_entries[entry].last))
        later++;
    return later;
}

/* Models of clear matter stand in none where the text has none. */
static void make_room_for_models(karst_lower_state *s)
{
    const karst_world_header *header = s->io->header;
    karst_expr *clear = &s->io->root[KARST_ROOT_CLEAR];
    for (uint32_t i = 0; i < header->num_models && !*clear; i++)
        if (header->models[i].is_clear)
            *clear = karst_graph_float(s->graph, -1);
}

static void run_entries(karst_lower_state *s)
{
    karst_ast_function *found[KARST_NUM_ENTRIES];
    for (int e = 0; e < KARST_NUM_ENTRIES; e++)
        found[e] = find_entry(s, (karst_entry)e);
    if (!found[KARST_ENTRY_DENSITY])
        no_density(s);
    for (int e = 0; e < KARST_NUM_ENTRIES; e++)
        if (found[e] && find_replacement(found, e) == KARST_NUM_ENTRIES)
            run_entry(s, (karst_entry)e, found[e]);
    for (int e = 0; e < KARST_NUM_ENTRIES; e++) {
        int later = find_replacement(found, e);
        if (!found[e] && later == KARST_NUM_ENTRIES)
            hint_missing(s, (karst_entry)e);
        if (found[e] && later < KARST_NUM_ENTRIES && !found[e]->statement)
            karst_source_warn(s->source, found[e]->where,
                              karst_format(s->arena, "call it in %s, or remove it", karst_entries[later].name),
                              "'%s' is not used: '%s' gives what it would", karst_lower_name(s, found[e]->name),
                              karst_entries[later].name);
    }
}

void karst_lower(karst_lowering *io)
{
    karst_lower_state *s = karst_arena_alloc(io->source->arena, sizeof *s);
    *s = (karst_lower_state){.io = io,
                             .source = io->source,
                             .names = io->names,
                             .parser = io->parser,
                             .arena = io->source->arena,
                             .graph = io->graph,
                             .rules = {.expression = karst_rule_expression,
                                       .whole = karst_rule_whole,
                                       .initialiser = karst_rule_initialiser,
                                       .body = karst_rule_body}};
    s->array_types.arena = s->arena;
    s->slots = karst_arena_alloc(s->arena, KARST_MAX_SLOTS * sizeof *s->slots);
    s->stamps = karst_arena_alloc(s->arena, KARST_MAX_SLOTS * sizeof *s->stamps);
    s->marks = karst_arena_alloc(s->arena, KARST_MAX_SLOTS * sizeof *s->marks);
    io->graph->full = note_full;
    io->graph->user = s;
    s->no = karst_graph_bool(s->graph, false);
    s->yes = karst_graph_bool(s->graph, true);
    s->zero = karst_graph_float(s->graph, 0);
    run_entries(s);
    make_room_for_models(s);
}
