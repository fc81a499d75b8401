#include "producers/language/language.h"

#include <errno.h>
#include <float.h>
#include <math.h>
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "core/device/embedded.h"
#include "producers/language/graph/deepen.h"
#include "producers/language/graph/loosen.h"
#include "producers/language/graph/kinds.h"
#include "producers/language/front/lower.h"

#define PRELUDE "producers/language/front/prelude.karst"
#define MAX_LIST 300 /* characters, about, of names in a hint */

static const char *prelude_text(void)
{
    for (const karst_embedded_file *f = karst_embedded_files; f->path; f++)
        if (!strcmp(f->path, PRELUDE))
            return f->text;
    return "";
}

/* What one compilation holds besides its result. */
typedef struct {
    karst_program_graph *program;
    karst_source source;
    karst_names names;
    karst_parser parser;
    karst_lowering lowering;
    karst_graph raw;
    jmp_buf escape;
    bool arena_full;
} compilation;

static void arena_full(void *user)
{
    compilation *c = user;
    c->arena_full = true;
    longjmp(c->escape, 1);
}

/* All that a world has, where none of them is like the name that was given. */
static const char *all_parameters(const karst_world_header *h, karst_arena *arena)
{
    if (h->num_parameters == 0)
        return "it has none: \"params\" in the file's first comment gives it some";
    const char *list = h->parameters[0].name;
    for (uint32_t i = 1; i < h->num_parameters && strlen(list) < MAX_LIST; i++)
        list = karst_format(arena, "%s, %s", list, h->parameters[i].name);
    return karst_format(arena, "there are: %s", list);
}

static void set_parameters(compilation *c, const karst_parameter_value *given, size_t num_given)
{
    const karst_world_header *h = &c->program->header;
    for (uint32_t i = 0; i < h->num_parameters; i++)
        c->lowering.parameters[i] =
            (karst_lower_parameter){.name = h->parameters[i].name, .value = h->parameters[i].value};
    c->lowering.num_parameters = h->num_parameters;
    for (size_t k = 0; k < num_given; k++) {
        uint32_t i = 0;
        const bool is_time = !strcmp(given[k].name, KARST_TIME_PARAMETER);
        karst_nearest nearest = karst_nearest_begin(given[k].name, strlen(given[k].name));
        while (i < h->num_parameters && strcmp(h->parameters[i].name, given[k].name))
            karst_nearest_offer(&nearest, h->parameters[i++].name);
        if (i == h->num_parameters && is_time) {
            c->lowering.time_s = given[k].value;
            continue;
        }
        if (i == h->num_parameters) {
            const char *hint = karst_nearest_hint(&nearest, c->source.arena);
            karst_source_error(&c->source, c->source.user_begin, hint ? hint : all_parameters(h, c->source.arena),
                               "this world has no parameter '%s'", given[k].name);
        }
        const double low = h->parameters[i].min, high = h->parameters[i].max;
        double v = given[k].value;
        v = v < low ? low : v > high ? high : v;
        if (v < given[k].value || v > given[k].value)
            karst_source_warn(&c->source, c->source.user_begin, NULL,
                              "parameter '%s' is %s %.9g, which is used instead of %.9g", given[k].name,
                              v < given[k].value ? "at most" : "at least", v, given[k].value);
        c->lowering.parameters[i].value = karst_number_shortest(v);
    }
}

static void parse(compilation *c)
{
    karst_tokens prelude = {0}, user = {0}, expanded = {0};
    karst_names_init(&c->names, c->source.arena);
    karst_parser_init(&c->parser, &c->source, &c->names);
    karst_lex(&c->source, &c->names, 0, c->source.user_begin, &prelude);
    karst_preprocess(&c->source, &c->names, &prelude, &expanded);
    karst_parse_file(&c->parser, &expanded, true);
    expanded = (karst_tokens){0};
    karst_lex(&c->source, &c->names, c->source.user_begin, c->source.length, &user);
    karst_preprocess(&c->source, &c->names, &user, &expanded);
    karst_entry_structs(&c->parser, &expanded);
    karst_parse_file(&c->parser, &expanded, false);
}

static void live_full(void *user, uint32_t where)
{
    compilation *c = user;
    karst_source_error(&c->source, where, "make the loops shorter, or call fewer functions in them",
                       "the world has more than %u different operations", KARST_MAX_LIVE_NODES);
}

/* Keeps what the roots reach. */
static void extract(compilation *c)
{
    karst_program_graph *p = c->program;
    karst_graph_init(&p->graph, &p->arena, KARST_MAX_LIVE_NODES, live_full, c);
    memcpy(p->root, c->lowering.root, sizeof p->root);
    memcpy(p->has_entry, c->lowering.has_entry, sizeof p->has_entry);
    karst_graph_extract(&c->raw, &p->graph, p->root, KARST_NUM_ROOTS);
    for (uint32_t i = 1; i < p->graph.num_nodes; i++) {
        const karst_expr_node *n = &p->graph.nodes[i];
        if (n->op != KARST_OP_NOISE)
            continue;
        p->num_octaves += p->graph.noises[n->extra].num_octaves;
        if (p->num_octaves > KARST_MAX_OCTAVES)
            karst_source_error(&c->source, n->where, "use fewer octaves, or call the noise once and keep its value",
                               "the world has more than %u octaves of noise", KARST_MAX_OCTAVES);
    }
}

/* Ranges that a header leaves open are unbounded. */
static double open_range(double bound)
{
    return bound == DBL_MAX ? (double)INFINITY : bound == -DBL_MAX ? -(double)INFINITY : bound;
}

/* Numbers of the roots that are there: those that are not softened, then the others. Returns how many come first. */
static size_t order_roots(const karst_program_graph *p, uint32_t order[KARST_NUM_ROOTS], size_t *num_roots)
{
    size_t count = 0, num_sharp = 0;
    for (int softened = 0; softened < 2; softened++) {
        for (int o = 0; o < KARST_NUM_OUTPUTS; o++)
            if (karst_entries[karst_entry_of((karst_output)o)].is_softened == softened &&
                karst_has_output(p->root, (karst_output)o))
                for (uint32_t i = 0; i < karst_outputs[o].num_floats; i++)
                    order[count++] = karst_outputs[o].root + i;
        num_sharp = softened ? num_sharp : count;
    }
    *num_roots = count;
    return num_sharp;
}

static void resolve(compilation *c)
{
    karst_program_graph *p = c->program;
    double low[KARST_MAX_PARAMETERS + 16], high[KARST_MAX_PARAMETERS + 16];
    for (uint32_t i = 0; i < p->num_parameters; i++) {
        low[i] = i < p->header.num_parameters ? open_range(p->header.parameters[i].min) : -(double)INFINITY;
        high[i] = i < p->header.num_parameters ? open_range(p->header.parameters[i].max) : (double)INFINITY;
    }
    karst_kinds_settings settings = {.voxel_log2_m = p->header.voxel_log2_m,
                                     .exact_above_log2 = p->header.exact_above_log2,
                                     .extent_m = p->header.extent_m};
    settings.parameter_min = low;
    settings.parameter_max = high;
    if (p->num_materials)
        karst_add_materials(&p->graph, p->header.voxel_log2_m, p->root, p->plain, p->materials, p->num_materials);
    const karst_expr density = p->root[KARST_ROOT_DENSITY];
    if (!p->num_written)
        p->num_written = p->graph.num_nodes;
    if (p->is_deepened && !p->deep)
        p->deep = karst_loosen(&p->graph, &settings, karst_deepen(&p->graph, &settings, density));
    bool differs = p->is_deepened && p->deep != density;
    uint32_t order[KARST_NUM_ROOTS];
    karst_expr roots[KARST_NUM_ROOTS + 1] = {differs ? p->deep : density, density};
    size_t num_roots, num_sharp = order_roots(p, order, &num_roots), others = differs;
    for (size_t i = 1; i < num_roots; i++)
        roots[i + others] = p->root[order[i]];
    settings.num_sharp_roots = num_sharp + others;
    karst_graph_init(&p->resolved, &p->arena, 2 * KARST_MAX_LIVE_NODES, live_full, c);
    karst_kinds_resolve(&p->graph, &settings, &p->resolved, roots, num_roots + others);
    p->world = (karst_resolved_world){.graph = &p->resolved, .root[KARST_ROOT_DENSITY] = roots[0]};
    for (size_t i = 1; i < num_roots; i++)
        p->world.root[order[i]] = roots[i + others];
    p->world.text = differs ? roots[1] : KARST_NO_EXPR;
    if (differs) {
        karst_range *ranges = karst_arena_alloc(&p->arena, p->resolved.num_nodes * sizeof *ranges);
        karst_graph_ranges(&p->resolved, &settings, ranges);
        p->text_range[0] = ranges[p->world.text].lo;
        p->text_range[1] = ranges[p->world.text].hi;
    }
}

/* Text that compiles to what no back end can compute is not let through: a compiler of kernels would be the first to
 * notice, or, with one lane, nobody. */
static void check_form(compilation *c)
{
    const karst_program_graph *p = c->program;
    const char *fault;
    if (!karst_resolved_world_check(&p->world, &fault))
        karst_source_error(&c->source, p->resolved.nodes[p->world.root[KARST_ROOT_DENSITY]].where,
                           "this is a mistake of Karst, not of the text: please report it",
                           "this world was translated into what cannot be computed: %s", fault);
}

static void list_parameters(compilation *c)
{
    karst_program_graph *p = c->program;
    p->num_parameters = c->lowering.num_parameters;
    p->parameters = karst_arena_alloc(&p->arena, (p->num_parameters + 1) * sizeof *p->parameters);
    for (uint32_t i = 0; i < p->num_parameters; i++) {
        const karst_lower_parameter *from = &c->lowering.parameters[i];
        const karst_header_parameter *h = i < p->header.num_parameters ? &p->header.parameters[i] : NULL;
        p->parameters[i] = (karst_world_parameter){.name = from->name,
                                                   .value = from->value,
                                                   .min = h ? h->min : 0,
                                                   .max = h ? h->max : 0,
                                                   .step = h ? h->step : 0,
                                                   .unit = h ? h->unit : "",
                                                   .label = h ? h->label : from->name,
                                                   .is_implicit = from->is_implicit,
                                                   .is_structural = from->is_structural,
                                                   .is_used = from->is_used || (h && h->is_named)};
        if (h && !p->parameters[i].is_used)
            karst_source_warn(&c->source, h->where, NULL, "parameter '%s' is not used", from->name);
    }
}

static void warn_of_unused_data(compilation *c)
{
    const karst_world_header *h = &c->program->header;
    for (uint32_t i = 0; i < h->num_data; i++) {
        const karst_world_image *image = c->lowering.images;
        while (image && image->data != &h->data[i])
            image = image->next;
        if (!image)
            karst_source_warn(&c->source, h->data[i].where, NULL, "data '%s' is not used", h->data[i].name);
    }
}

static void compile(compilation *c, const char *name, const char *text, size_t length,
                    const karst_parameter_value *given, size_t num_given)
{
    karst_source_init(&c->source, &c->program->arena, &c->escape, name, prelude_text(), text, length);
    c->program->name = c->source.name;
    karst_header_read(&c->source, &c->program->header);
    set_parameters(c, given, num_given);
    parse(c);
    c->lowering.source = &c->source;
    c->lowering.names = &c->names;
    c->lowering.parser = &c->parser;
    c->lowering.graph = &c->raw;
    c->lowering.header = &c->program->header;
    karst_graph_init(&c->raw, &c->program->arena, KARST_MAX_RAW_NODES, NULL, NULL);
    karst_lower(&c->lowering);
    warn_of_unused_data(c);
    extract(c);
    list_parameters(c);
    resolve(c);
    check_form(c);
    c->program->max_iterations = c->lowering.max_iterations_seen;
}

/* false: an error was reported, or the arena is full. */
static bool compile_guarded(compilation *c, const char *name, const char *text, size_t length,
                            const karst_parameter_value *given, size_t num_given)
{
    if (setjmp(c->escape))
        return false;
    compile(c, name, text, length, given, num_given);
    return true;
}

karst_program_graph *karst_language_compile(const char *name, const char *text, size_t length,
                                            const karst_parameter_value *given, size_t num_given, bool *ok,
                                            karst_error *error)
{
    *ok = false;
    karst_program_graph *program = calloc(1, sizeof *program);
    compilation *c = calloc(1, sizeof *c);
    if (!program || !c) {
        free(program);
        free(c);
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    c->program = program;
    program->name = "";
    karst_arena_init(&program->arena, KARST_LANGUAGE_ARENA_BYTES, arena_full, c);
    *ok = compile_guarded(c, name, text, length, given, num_given);
    program->images = c->lowering.images;
    program->source = c->source;
    program->source.escape = NULL;
    program->diagnostics = c->source.first;
    if (!*ok) {
        const karst_diagnostic *last = c->source.last;
        program->graph = program->resolved = (karst_graph){0};
        program->world = (karst_resolved_world){0};
        memset(program->root, 0, sizeof program->root);
        memset(program->has_entry, 0, sizeof program->has_entry);
        if (program->arena.is_out_of_memory)
            karst_fail(error, KARST_FAILED, "%s: out of memory for compiling the world", name);
        else if (c->arena_full || !last || !last->is_error)
            karst_fail(error, KARST_BAD_WORLD, "%s: the world needs more than %zu MiB to compile", name,
                       KARST_LANGUAGE_ARENA_BYTES >> 20);
        else
            karst_fail(error, c->source.is_data_error ? KARST_BAD_DATA : KARST_BAD_WORLD,
                       "%.300s:%u:%u: %.600s", name, last->line, last->column, last->message);
    }
    program->arena.full = NULL; /* the way back is gone */
    program->graph.full = program->resolved.full = NULL;
    free(c);
    return program;
}

static bool resolve_guarded(compilation *c)
{
    if (setjmp(c->escape))
        return false;
    resolve(c);
    return true;
}

/* Resolves a finished program once more; what fails leaves it as `before`. */
static bool resolve_again(karst_program_graph *program, const karst_program_graph *before)
{
    compilation *c = calloc(1, sizeof *c);
    if (!c) {
        *program = *before;
        return false;
    }
    c->program = program;
    c->source = program->source;
    c->source.first = c->source.last = NULL;
    c->source.escape = &c->escape;
    program->arena.full = arena_full;
    program->arena.user = program->graph.user = c;
    program->graph.full = live_full;
    bool done = resolve_guarded(c);
    if (!done) {
        program->header = before->header;
        memcpy(program->root, before->root, sizeof program->root);
        program->resolved = before->resolved;
        program->world = before->world;
        program->is_deepened = before->is_deepened;
        program->deep = before->deep;
    }
    program->arena.full = NULL;
    program->graph.full = program->resolved.full = NULL;
    free(c);
    return done;
}

bool karst_program_set_voxel(karst_program_graph *program, int voxel_log2_m)
{
    const karst_program_graph before = *program;
    program->header.voxel_log2_m = voxel_log2_m;
    return resolve_again(program, &before);
}

bool karst_program_deepen(karst_program_graph *program, bool deepens)
{
    const karst_program_graph before = *program;
    program->is_deepened = deepens;
    return resolve_again(program, &before);
}

bool karst_program_add_materials(karst_program_graph *program, const karst_model_material *materials, size_t num,
                                 const float plain[2][3])
{
    const karst_program_graph before = *program;
    program->materials = materials;
    program->num_materials = num;
    memcpy(program->plain, plain, sizeof program->plain);
    const bool done = resolve_again(program, &before);
    program->materials = NULL;
    program->num_materials = 0;
    return done;
}

karst_program_graph *karst_language_compile_file(const char *path, const karst_parameter_value *given, size_t num_given,
                                                 bool *ok, karst_error *error)
{
    *ok = false;
    struct stat status;
    FILE *file = fopen(path, "rb");
    if (!file || fstat(fileno(file), &status) || !S_ISREG(status.st_mode)) {
        karst_fail(error, KARST_BAD_WORLD, "%.600s: %s", path, file ? "this is no regular file" : strerror(errno));
        if (file)
            fclose(file);
        return NULL;
    }
    char *text = malloc(KARST_SOURCE_MAX_BYTES + 1); /* one more, so that too much shows */
    size_t length = text ? fread(text, 1, KARST_SOURCE_MAX_BYTES + 1, file) : 0;
    bool bad = text && ferror(file);
    fclose(file);
    karst_program_graph *program = NULL;
    if (!text)
        karst_fail(error, KARST_FAILED, "%.600s: out of memory for its text", path);
    else if (bad)
        karst_fail(error, KARST_BAD_WORLD, "%.600s: cannot be read", path);
    else
        program = karst_language_compile(path, text, length, given, num_given, ok, error);
    free(text);
    return program;
}

void karst_program_graph_destroy(karst_program_graph *program)
{
    if (!program)
        return;
    karst_world_images_free(program->images);
    karst_arena arena = program->arena; /* what it holds is all there is */
    karst_arena_finish(&arena);
    free(program);
}
