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

static karst_ast_function *find_entry(karst_lower_state *s, const char *name)
{
    karst_ast_function *found = NULL;
    for (karst_ast_function *f = s->parser->functions; f; f = f->next) {
        if (f->is_prelude || strcmp(karst_lower_name(s, f->name), name))
            continue;
        if (f->body && found && found->body)
            karst_source_error(s->source, f->where, "rename one of them", "there are two functions '%s' with a body",
                               name);
        if (f->body || !found)
            found = f;
    }
    return found;
}

/* The function whose name is most like `wanted`, or NULL; with colour's parameters and result, if `like_colour`. */
static const karst_ast_function *find_misspelt(karst_lower_state *s, const char *wanted, bool like_colour)
{
    const karst_type *vec3 = karst_type_vector(KARST_TYPE_FLOAT, 3);
    karst_nearest nearest = karst_nearest_begin(wanted, strlen(wanted));
    const karst_ast_function *found = NULL;
    for (const karst_ast_function *f = s->parser->functions; f; f = f->next) {
        const char *best = nearest.best;
        bool fits = !like_colour || (f->num_parameters == 2 && f->result.base == vec3 &&
                                     f->parameters->type.base == vec3 && f->parameters->next->type.base == vec3);
        if (f->is_prelude || !fits)
            continue;
        karst_nearest_offer(&nearest, karst_lower_name(s, f->name));
        if (nearest.best != best)
            found = f;
    }
    return found;
}

static void check_signature(karst_lower_state *s, const karst_ast_function *f, const karst_type *result,
                            uint32_t num_parameters, const char *wanted)
{
    bool fits =
        f->num_parameters == num_parameters && !f->result.size && !f->result.unsized && f->result.base == result;
    for (const karst_ast_variable *p = f->parameters; p; p = p->next)
        fits = fits && p->type.base == karst_type_vector(KARST_TYPE_FLOAT, 3) && !p->type.size && !p->type.unsized &&
               !p->is_out;
    if (!fits)
        karst_source_error(s->source, f->where, karst_format(s->arena, "write %s", wanted),
                           "'%s' has other parameters or another result here", karst_lower_name(s, f->name));
}

static _Noreturn void no_density(karst_lower_state *s)
{
    static const char *const likely[] = {"map",     "sdf",     "scene",   "de",       "DE", "dist",
                                         "GetDist", "getDist", "sdScene", "sceneSDF", "f"};
    const karst_type *vec3 = karst_type_vector(KARST_TYPE_FLOAT, 3);
    for (size_t i = 0; i < sizeof likely / sizeof *likely; i++) {
        const karst_ast_function *f = find_entry(s, likely[i]);
        if (!f || f->num_parameters != 1 || f->parameters->type.base != vec3)
            continue;
        const char *part = f->result.base == karst_type_vector(KARST_TYPE_FLOAT, 1) ? "" : f->result.base ? ".x" : NULL;
        if (part)
            karst_source_error(
                s->source, f->where,
                karst_format(s->arena, "add the line: float density(vec3 p) { return -%s(p)%s; }", likely[i], part),
                "there is no function 'density', but '%s' looks like a distance", likely[i]);
    }
    const karst_ast_function *misspelt = find_misspelt(s, "density", false);
    if (misspelt)
        karst_source_error(s->source, misspelt->where, "is this it? Then call it density",
                           "there is no function 'density', but a '%s'", karst_lower_name(s, misspelt->name));
    karst_source_error(s->source, s->source->length, "write float density(vec3 p) { return -p.y; }",
                       "there is no function 'density'");
}

static karst_value position(karst_lower_state *s, karst_op op, uint32_t where)
{
    karst_value v = karst_value_new(s, karst_type_vector(KARST_TYPE_FLOAT, 3), where);
    for (uint32_t i = 0; i < 3; i++)
        v.e[i] = karst_graph_leaf(s->graph, op, i);
    return v;
}

void karst_lower(karst_lowering *io)
{
    karst_lower_state *s = karst_arena_alloc(io->source->arena, sizeof *s);
    *s = (karst_lower_state){.io = io,
                             .source = io->source,
                             .names = io->names,
                             .parser = io->parser,
                             .arena = io->source->arena,
                             .graph = io->graph};
    s->array_types.arena = s->arena;
    s->slots = karst_arena_alloc(s->arena, KARST_MAX_SLOTS * sizeof *s->slots);
    s->stamps = karst_arena_alloc(s->arena, KARST_MAX_SLOTS * sizeof *s->stamps);
    s->marks = karst_arena_alloc(s->arena, KARST_MAX_SLOTS * sizeof *s->marks);
    io->graph->full = note_full;
    io->graph->user = s;
    s->no = karst_graph_bool(s->graph, false);
    s->yes = karst_graph_bool(s->graph, true);
    s->zero = karst_graph_float(s->graph, 0);
    karst_ast_function *density = find_entry(s, "density");
    if (!density)
        no_density(s);
    check_signature(s, density, karst_type_vector(KARST_TYPE_FLOAT, 1), 1, "float density(vec3 p)");
    reset(s);
    karst_value arguments[2] = {position(s, KARST_OP_POSITION, density->where)};
    io->density = karst_lower_function(s, density, arguments, NULL, density->where).e[0];
    karst_ast_function *colour = find_entry(s, "colour");
    if (!colour)
        colour = find_entry(s, "color");
    if (!colour) {
        const karst_ast_function *misspelt = find_misspelt(s, "colour", true);
        if (misspelt)
            karst_source_warn(s->source, misspelt->where, "is this it? Then call it colour",
                              "there is no function 'colour', but a '%s'", karst_lower_name(s, misspelt->name));
        return;
    }
    check_signature(s, colour, karst_type_vector(KARST_TYPE_FLOAT, 3), 2, "vec3 colour(vec3 p, vec3 n)");
    reset(s);
    arguments[0] = position(s, KARST_OP_POSITION, colour->where);
    arguments[1] = position(s, KARST_OP_NORMAL, colour->where);
    karst_value value = karst_lower_function(s, colour, arguments, NULL, colour->where);
    memcpy(io->colour, value.e, sizeof io->colour);
    io->has_colour = true;
}
