#include "producers/language/check.h"

#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cache/layout_shared.h"
#include "producers/language/emit/emit.h"
#include "producers/language/graph/lipschitz.h"
#include "producers/language/reach.h"

typedef struct {
    const karst_program_graph *program;
    const karst_graph *graph;
    karst_kinds_settings settings;
    double low[KARST_HEADER_MAX_PARAMETERS + 16], high[KARST_HEADER_MAX_PARAMETERS + 16];
    karst_range *ranges;
    karst_lipschitz *steepness;
    uint8_t *is_density; /* whether the density needs the node */
    karst_expr *user_of; /* of each node the nearest that the user's text made */
    uint32_t *line_ends; /* offsets into the source's text */
    uint32_t num_line_ends;
    void (*print)(void *user, const char *line);
    void *user;
} report;

static void say(const report *r, const char *format, ...) __attribute__((format(printf, 2, 3)));
static void say(const report *r, const char *format, ...)
{
    char line[512];
    va_list list;
    va_start(list, format);
    vsnprintf(line, sizeof line, format, list);
    va_end(list);
    r->print(r->user, line);
}

/* A text may have a million lines, and as many places are asked for as there are operations. */
static bool find_lines(report *r)
{
    const karst_source *source = &r->program->source;
    r->line_ends = malloc((source->length + 1) * sizeof *r->line_ends);
    for (uint32_t i = 0; r->line_ends && i < source->length; i++)
        if (source->text[i] == '\n')
            r->line_ends[r->num_line_ends++] = i;
    return r->line_ends != NULL;
}

static uint32_t lines_before(const report *r, uint32_t where)
{
    uint32_t low = 0, high = r->num_line_ends;
    while (low < high) {
        uint32_t middle = low + (high - low) / 2;
        if (r->line_ends[middle] < where)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

/* What stands in the prelude is named by what of the user's text it is for. */
static void find_users(const report *r)
{
    for (karst_expr e = r->graph->num_nodes - 1; e > 0; e--) {
        const karst_expr_node *n = &r->graph->nodes[e];
        karst_expr named = n->where < r->program->source.user_begin && r->user_of[e] ? r->user_of[e] : e;
        r->user_of[e] = named;
        for (int k = 0; k < 4 && n->arg[k]; k++)
            r->user_of[n->arg[k]] = named;
    }
}

/* As karst_source_place counts: the user's text and the prelude each from 1. */
static uint32_t line_of(const report *r, karst_expr e)
{
    uint32_t where = r->graph->nodes[r->user_of[e]].where, user_begin = r->program->source.user_begin;
    return 1 + lines_before(r, where) - lines_before(r, where >= user_begin ? user_begin : 0);
}

static void say_head(const report *r)
{
    const karst_program_graph *p = r->program;
    say(r, "%s: %s%s%s", p->name, p->header.name[0] ? p->header.name : "a world", p->header.author[0] ? ", by " : "",
        p->header.author);
    say(r, "  voxel %.12g m, seed %u, %u operations (%u as written), longest loop %u rounds",
        ldexp(1, p->header.voxel_log2_m), p->header.seed, r->graph->num_nodes - 1, p->num_written - 1,
        p->max_iterations);
}

static void say_parameters(const report *r)
{
    const karst_program_graph *p = r->program;
    for (uint32_t i = 0; i < p->num_parameters; i++) {
        const karst_world_parameter *q = &p->parameters[i];
        if (q->is_implicit)
            say(r, "  input %s is %.9g here", q->name, q->value.value);
        else
            say(r, "  parameter %s = %.9g%s%s%s", q->name, q->value.value, q->unit[0] ? " " : "", q->unit,
                !q->is_used        ? ", not used"
                : q->is_structural ? ", decides the program: a change compiles again"
                                   : "");
    }
}

/* What entries that give several values give, and what of it is not used. */
/* What files a world uses, and what of them stands in memory, for values and for bounds. */
static void say_data(const report *r)
{
    for (const karst_world_image *i = r->program->images; i; i = i->next) {
        double bytes = 0, bound_bytes = 0;
        for (uint32_t c = 0; c < i->num_channels; c++) {
            bytes += 8.0 * i->channel[c].num_words;
            bound_bytes += i->channel[c].bound_bytes;
        }
        bytes += 8.0 * i->texture.num_words;
        char apart[64] = "", deep[16] = "";
        if (i->depth) {
            snprintf(deep, sizeof deep, " x %u", i->depth);
            snprintf(apart, sizeof apart, ", %.3g m apart", i->voxel_m);
        } else if (i->data->size_m[0] > 0)
            snprintf(apart, sizeof apart, ", %.3g x %.3g m apart", i->data->size_m[0] / i->width,
                     i->data->size_m[1] / i->height);
        say(r, "  data %s: %.200s (%s), %u x %u%s samples%s; %.3g MB, %.3g MB of it for bounds", i->data->name,
            i->data->file, i->kind, i->width, i->height, deep, apart, bytes / 1e6, bound_bytes / 1e6);
    }
}

static void say_entries(const report *r)
{
    const karst_program_graph *p = r->program;
    for (int e = 0; e < KARST_NUM_ENTRIES; e++) {
        const karst_entry_info *entry = &karst_entries[e];
        char given[256] = "", idle[256] = "";
        uint32_t num_idle = 0;
        for (int o = entry->first; p->has_entry[e] && entry->last > entry->first && o <= (int)entry->last; o++) {
            if (!karst_has_output(p->root, (karst_output)o))
                continue;
            const karst_output_info *output = &karst_outputs[o];
            char *list = output->is_shown ? given : idle;
            num_idle += !output->is_shown;
            snprintf(list + strlen(list), sizeof given - strlen(list), "%s%s", *list ? ", " : "", output->name);
        }
        if (*given)
            say(r, "  %s gives %s", entry->name, given);
        if (*idle)
            say(r, "  of what %s gives, %s %s no effect on pictures yet", entry->name, idle,
                num_idle == 1 ? "has" : "have");
    }
}

/* A tensor product: each argument affine in its own axis alone, or constant. */
static bool is_separable(const report *r, const karst_expr_node *n)
{
    for (int i = 0; i < 3; i++) {
        const karst_expr_node *a = &r->graph->nodes[n->arg[i]];
        uint8_t axes = a->depends & (KARST_DEPENDS_X | KARST_DEPENDS_Y | KARST_DEPENDS_Z);
        if (axes && (a->op != KARST_OP_AFFINE || axes != KARST_DEPENDS_X << i))
            return false;
    }
    return r->graph->noises[n->extra].base == KARST_NOISE_GRADIENT;
}

static const char *why_not_separable(const report *r, const karst_expr_node *n)
{
    for (int i = 0; i < 3; i++) {
        const karst_expr_node *a = &r->graph->nodes[n->arg[i]];
        if (a->op == KARST_OP_SHIFTED)
            return "warped";
        if (a->op != KARST_OP_AFFINE && (a->depends & KARST_DEPENDS_PLACE))
            return "not affine in the position";
    }
    return r->graph->noises[n->extra].base == KARST_NOISE_GRADIENT ? "its arguments mix the axes"
           : r->graph->noises[n->extra].image                        ? "samples of a file"
                                                                   : "of another kind than gradient noise";
}

static const char *noise_name(const karst_noise *n)
{
    static const char *const bases[] = {"gradient noise", "value noise", "simplex noise", "worley F1", "worley F2"};
    static const char *const shapes[] = {"fbm", "ridged", "billow", "turbulence"};
    if (n->image)
        return n->image->num_axes > 2 ? "a field" : "an image";
    if (n->base == KARST_NOISE_GRADIENT && (n->num_octaves > 1 || n->shape != KARST_NOISE_SUM))
        return shapes[n->shape];
    return bases[n->base];
}

/* Always a corner of a lattice whose cells are 1 wide. */
static bool is_whole(const report *r, karst_expr e)
{
    const karst_expr_node *n = &r->graph->nodes[e];
    if (n->op == KARST_OP_CONSTANT)
        return rint(r->graph->constants[n->extra].value) == r->graph->constants[n->extra].value;
    if (n->op == KARST_OP_CONVERT)
        return r->graph->nodes[n->arg[0]].type != KARST_TYPE_FLOAT;
    bool sums = n->op == KARST_OP_ADD || n->op == KARST_OP_SUBTRACT || n->op == KARST_OP_MULTIPLY;
    for (int k = 0; sums && k < 2; k++) { /* of leaves, which is what people write */
        const karst_expr_node *a = &r->graph->nodes[n->arg[k]];
        bool is_constant = a->op == KARST_OP_CONSTANT;
        double value = is_constant ? r->graph->constants[a->extra].value : 0;
        sums = a->op == KARST_OP_FLOOR || a->op == KARST_OP_CEIL || a->op == KARST_OP_RINT ||
               (is_constant && rint(value) == value);
    }
    return sums || n->op == KARST_OP_FLOOR || n->op == KARST_OP_CEIL || n->op == KARST_OP_RINT;
}

/* Gradient noise is 0 in the corners of its lattice, and so are octaves that are whole times as fine. */
static bool is_always_0(const report *r, const karst_expr_node *n)
{
    const karst_noise *noise = &r->graph->noises[n->extra];
    for (int i = 0; i < 3; i++)
        if (n->arg[i] && !is_whole(r, n->arg[i]))
            return false;
    return noise->base == KARST_NOISE_GRADIENT && noise->shape == KARST_NOISE_SUM && !noise->derivative &&
           (n->depends & KARST_DEPENDS_PLACE) && (noise->num_octaves == 1 || is_whole(r, noise->lacunarity));
}

static void say_noises(const report *r)
{
    uint32_t separable = 0, all = 0, listed = 0;
    for (karst_expr e = 1; e < r->graph->num_nodes; e++) {
        const karst_expr_node *n = &r->graph->nodes[e];
        if (n->op != KARST_OP_NOISE)
            continue;
        const karst_noise *noise = &r->graph->noises[n->extra];
        bool tensor = is_separable(r, n);
        all += noise->num_octaves;
        separable += tensor ? noise->num_octaves : 0;
        if (listed++ < 32)
            say(r, "  line %u: %s, %u octave%s, %s%s", line_of(r, e), noise_name(noise), noise->num_octaves,
                noise->num_octaves == 1 ? "" : "s",
                tensor ? "separable" : "pointwise: ", tensor ? "" : why_not_separable(r, n));
        if (is_always_0(r, n))
            say(r,
                "  line %u: this noise is always 0, as gradient noise is at whole coordinates; write valuenoise, or "
                "add "
                "0.5",
                line_of(r, e));
    }
    if (all)
        say(r, "  %u octaves of noise, %u of them separable", all, separable);
}

/* Why no box with this node's argument near 0, or none at all, has bounds; NULL: they have. */
static const char *why_unbounded(const report *r, karst_expr e)
{
    const karst_expr_node *n = &r->graph->nodes[e];
    karst_range b = r->ranges[n->arg[1]];
    bool divides = n->op == KARST_OP_DIVIDE || n->op == KARST_OP_MOD;
    if (divides && n->kind != KARST_KIND_UNIFORM && b.lo <= 0 && b.hi >= 0 &&
        !karst_graph_constant(r->graph, n->arg[1]))
        return "divides by what may be 0";
    if (n->op == KARST_OP_BITS && n->type == KARST_TYPE_FLOAT && n->kind != KARST_KIND_UNIFORM)
        return "makes a float of any bits";
    if (n->op == KARST_OP_CONSTANT && n->type == KARST_TYPE_FLOAT && !isfinite(r->graph->constants[n->extra].value))
        return "is not finite";
    return NULL;
}

static void say_bounds(const report *r)
{
    uint32_t num_unbounded = 0, last_line = 0;
    for (karst_expr e = 1; e < r->graph->num_nodes; e++) {
        const char *why = why_unbounded(r, e);
        uint32_t line = why && r->is_density[e] ? line_of(r, e) : last_line;
        if (line == last_line)
            continue;
        last_line = line;
        if (num_unbounded++ < 8)
            say(r, "  not bounded: line %u %s; what is near is never left out unseen", line, why);
    }
    if (!num_unbounded)
        say(r, "  bounded: there is a proof for every box");
}

static void say_steepness(const report *r)
{
    karst_expr root = r->program->world.root[KARST_ROOT_DENSITY];
    karst_lipschitz s = r->steepness[root];
    karst_range range = r->ranges[root];
    if (isfinite(s.constant))
        say(r, "  proven: at most %.4g steep (Lipschitz constant)", s.constant);
    else
        say(r, "  no Lipschitz constant: line %u, %s%s", line_of(r, s.cause),
            karst_op_name(r->graph->nodes[s.cause].op), s.jumps ? ", jumps" : ", is steep without bound somewhere");
    if (r->program->header.has_lipschitz)
        say(r, "  declared, not proven: at most %.4g steep", r->program->header.lipschitz);
    say(r, "  density from %.4g to %.4g%s", range.lo + 0.0, range.hi + 0.0,
        range.hi == 0 && range.lo < 0   ? ": never above 0, so all is air; of an unsigned distance, subtract it from a "
                                          "thickness"
        : range.lo == 0 && range.hi > 0 ? ": never below 0, so nearly all is solid; subtract from it what is to be air"
        : range.hi <= 0                 ? ": never above 0, so all is air and there is nothing to see"
        : range.lo > 0                  ? ": always above 0, so all is solid and there is nothing to see"
                                        : "");
}

/* A range without an end, or with none that a world comes to, as powers have. */
static bool is_open(karst_range range) { return !(range.hi - range.lo < 0x1p60); }

/* Sums and differences of numbers without bound, as floats; KARST_NO_EXPR: there are none. */
static karst_expr find_loose(const report *r)
{
    for (karst_expr e = 1; e < r->graph->num_nodes; e++) {
        const karst_expr_node *n = &r->graph->nodes[e];
        bool sums = n->op == KARST_OP_ADD || n->op == KARST_OP_SUBTRACT || n->op == KARST_OP_FMA;
        karst_expr last = n->op == KARST_OP_FMA ? n->arg[2] : n->arg[1];
        bool is_first_open = is_open(r->ranges[n->arg[0]]) || (n->op == KARST_OP_FMA && is_open(r->ranges[n->arg[1]]));
        if (sums && n->kind == KARST_KIND_FLOAT && is_first_open && is_open(r->ranges[last]))
            return e;
        /* powers have no pairs, and come to any size */
        for (int k = 0; k < 3 && n->kind == KARST_KIND_WIDE; k++)
            if (r->graph->nodes[n->arg[k]].op == KARST_OP_EXP2 && is_open(r->ranges[n->arg[k]]))
                return n->arg[k];
    }
    return KARST_NO_EXPR;
}

static bool say_reach(const report *r, karst_error *error)
{
    const karst_world_header *h = &r->program->header;
    uint32_t num_wide = 0;
    karst_expr first_wide = KARST_NO_EXPR, loose = find_loose(r);
    karst_reach reach = {(double)INFINITY, KARST_NO_EXPR};
    karst_error why = {0};
    for (karst_expr e = 1; e < r->graph->num_nodes; e++)
        if (r->graph->nodes[e].kind == KARST_KIND_WIDE && !num_wide++)
            first_wide = e;
    if (num_wide)
        say(r, "  %u operations need pairs of floats, the first in line %u", num_wide, line_of(r, first_wide));
    if (!karst_reach_measure(r->program, &reach, &why)) {
        if (why.status != KARST_OK)
            return karst_fail(error, why.status, "%s", why.message);
        if (loose) /* forms become floats with 2^-22 */
            reach = (karst_reach){ldexp(1.0, 22 + h->voxel_log2_m + h->exact_above_log2) / 100, loose};
    }
    if (isfinite(reach.reach_m))
        say(r, "  line %u: right to 1/100 voxel%s up to %.2g m from the origin%s", line_of(r, reach.cause),
            h->exact_above_log2 ? " of 1/16 m" : "", reach.reach_m,
            loose && !(h->extent_m > 0) ? "; say \"extent\" in the header for more" : "");
    return true;
}

/* How fast what is piecewise constant grows, (rate * metres from the origin)^degree, and by how much it differs from
 * cell to cell at least. */
typedef struct {
    double rate, step, degree;
} growth;

static double coefficient_of(const report *r, karst_expr e)
{
    karst_range a = r->ranges[e];
    return e ? fmax(fabs(a.lo), fabs(a.hi)) : 0;
}

/* Of what is made of both, and no larger than their sum. */
static growth larger_growth(growth a, growth b, bool is_sum)
{
    double rate = is_sum ? a.rate + b.rate : fmax(a.rate, b.rate);
    return (growth){rate, fmin(a.step, b.step), fmax(a.degree, b.degree)};
}

static growth scaled_growth(growth a, double by)
{
    return (growth){a.rate * pow(by, 1 / a.degree), a.step * by, a.degree};
}

static growth product_growth(growth a, growth b)
{
    double degree = a.degree + b.degree, rate = pow(pow(a.rate, a.degree) * pow(b.rate, b.degree), 1 / degree);
    return (growth){rate, fmin(a.step, b.step), degree};
}

static growth growth_of(const report *r, karst_expr e, const growth *all)
{
    const karst_expr_node *n = &r->graph->nodes[e];
    growth a = all[n->arg[0]], b = all[n->arg[1]], c = all[n->arg[2]], g = {0, (double)INFINITY, 1};
    bool by_first = r->graph->nodes[n->arg[0]].kind == KARST_KIND_UNIFORM,
         by_second = r->graph->nodes[n->arg[1]].kind == KARST_KIND_UNIFORM;
    switch (n->op) {
    case KARST_OP_AFFINE:
        for (int i = 0; i < 3; i++)
            g.rate += coefficient_of(r, r->graph->affines[n->extra].coefficient[i]);
        return g;
    case KARST_OP_FLOOR:
        a.step = 1;
        return a;
    case KARST_OP_SHIFTED:
    case KARST_OP_NEGATE:
    case KARST_OP_ABS:
        return a;
    case KARST_OP_MOD: /* what it leaves has the digits of what it is of */
    case KARST_OP_FRACT:
        return n->arg[0] && r->graph->nodes[n->arg[0]].op != KARST_OP_AFFINE ? a : g;
    case KARST_OP_ADD:
    case KARST_OP_SUBTRACT:
        return larger_growth(a, b, true);
    case KARST_OP_MIN:
    case KARST_OP_MAX:
        return larger_growth(a, b, false);
    case KARST_OP_SELECT:
        return n->type == KARST_TYPE_FLOAT ? larger_growth(b, c, false) : g;
    case KARST_OP_LENGTH:
        for (int k = 0; k < 4 && n->arg[k]; k++)
            g = larger_growth(g, all[n->arg[k]], true);
        return g;
    case KARST_OP_MULTIPLY:
    case KARST_OP_FMA:
        g = by_first    ? scaled_growth(b, coefficient_of(r, n->arg[0]))
            : by_second ? scaled_growth(a, coefficient_of(r, n->arg[1]))
                        : product_growth(a, b);
        return n->op == KARST_OP_FMA ? larger_growth(g, c, true) : g;
    case KARST_OP_DIVIDE:
        return by_second ? scaled_growth(a, 1 / coefficient_of(r, n->arg[1])) : g;
    default:
        return g;
    }
}

/* Sines of cells, as hashes take them: how far out floats tell cells apart. */
static void say_sines(const report *r, growth *all)
{
    karst_expr worst = KARST_NO_EXPR;
    double reach = (double)INFINITY;
    for (karst_expr e = 1; e < r->graph->num_nodes; e++) {
        const karst_expr_node *n = &r->graph->nodes[e];
        const growth *a = &all[n->arg[0]];
        all[e] = growth_of(r, e, all);
        if ((n->op != KARST_OP_SIN && n->op != KARST_OP_COS) || n->kind != KARST_KIND_STEPS || !(a->rate > 0))
            continue;
        /* larger arguments are not reduced, or are the same for neighbours */
        double here = pow(fmin(0x1p22, a->step * 0x1p23), 1 / a->degree) / a->rate;
        if (!(here < reach))
            continue;
        reach = here;
        worst = e;
    }
    if (worst)
        say(r, "  line %u: a sine of cells tells them apart up to %.3g m from the origin; hash their ints for more",
            line_of(r, worst), reach);
}

/* LANGUAGE section 5: weights in ns, by the share of samples for which a node is computed. A tape (tape_world.clh)
 * computes each for every sample, and each step is looked up (measured: 1.8 ns). */
#define TAPE_STEP_NS 1.8
static bool say_cost(const report *r, karst_error *error)
{
    karst_world_layout layout;
    bool is_tape;
    if (!karst_world_layout_init(&layout, &r->program->world))
        return karst_fail(error, KARST_FAILED, "out of memory");
    if (!karst_emit_is_tape(&layout, &is_tape, error))
        return false;
    double sum = 0;
    for (karst_expr e = 1; e < r->graph->num_nodes; e++) {
        const karst_expr_node *n = &r->graph->nodes[e];
        if (n->kind == KARST_KIND_UNIFORM || n->depends & KARST_DEPENDS_NORMAL || (is_tape && !r->is_density[e]))
            continue;
        double weight = 0.04;
        if (n->op == KARST_OP_NOISE)
            weight = r->graph->noises[n->extra].num_octaves * (is_separable(r, n) && !is_tape ? 0.2 : 2.7);
        if (is_tape) {
            sum += fmax(weight, TAPE_STEP_NS);
            continue;
        }
        if (n->kind == KARST_KIND_WIDE)
            weight *= 8;
        for (int i = 0; i < 3; i++)
            weight /= n->depends & KARST_DEPENDS_X << i ? 1 : 16;
        sum += weight;
    }
    say(r, "  estimated cost: %.3g ns a voxel and core", sum);
    if (is_tape)
        say(r,
            "  too large to be compiled: each operation is looked up for each voxel, and a brick takes some %.3g ms; a "
            "picture takes thousands of them. Write loops of fewer rounds",
            sum * KARST_BRICK_SIDE * KARST_BRICK_SIDE * KARST_BRICK_SIDE * 1e-6);
    return true;
}

static void mark_density(report *r)
{
    r->is_density[r->program->world.root[KARST_ROOT_DENSITY]] = 1;
    for (karst_expr e = r->graph->num_nodes - 1; e > 0; e--)
        for (int k = 0; r->is_density[e] && k < 4; k++)
            r->is_density[r->graph->nodes[e].arg[k]] = 1;
}

static double open_range(double bound)
{
    return bound == DBL_MAX ? (double)INFINITY : bound == -DBL_MAX ? -(double)INFINITY : bound;
}

bool karst_language_check(const karst_program_graph *program, void (*print)(void *user, const char *line), void *user,
                          karst_error *error)
{
    report r = {.program = program, .graph = &program->resolved, .print = print, .user = user};
    for (uint32_t i = 0; i < program->num_parameters; i++) {
        const karst_world_parameter *p = &program->parameters[i];
        r.low[i] = p->is_implicit ? -(double)INFINITY : open_range(p->min);
        r.high[i] = p->is_implicit ? (double)INFINITY : open_range(p->max);
    }
    r.settings = (karst_kinds_settings){.voxel_log2_m = program->header.voxel_log2_m,
                                        .exact_above_log2 = program->header.exact_above_log2,
                                        .extent_m = program->header.extent_m,
                                        .parameter_min = r.low,
                                        .parameter_max = r.high};
    r.ranges = calloc(r.graph->num_nodes, sizeof *r.ranges);
    r.steepness = calloc(r.graph->num_nodes, sizeof *r.steepness);
    r.is_density = calloc(r.graph->num_nodes, 1);
    r.user_of = calloc(r.graph->num_nodes, sizeof *r.user_of);
    growth *growths = malloc(r.graph->num_nodes * sizeof *growths);
    bool done = growths && r.user_of && r.ranges && r.steepness && r.is_density && find_lines(&r);
    if (done) {
        for (karst_expr e = 0; e < r.graph->num_nodes; e++)
            growths[e] = (growth){0, (double)INFINITY, 1};
        mark_density(&r);
        find_users(&r);
        karst_graph_ranges(r.graph, &r.settings, r.ranges);
        karst_graph_lipschitz(r.graph, r.ranges, r.steepness);
        for (const karst_diagnostic *d = program->diagnostics; d; d = d->next)
            print(user, d->text);
        say_head(&r);
        say_parameters(&r);
        say_data(&r);
        say_entries(&r);
        say_noises(&r);
        say_bounds(&r);
        say_steepness(&r);
        done = say_reach(&r, error);
        say_sines(&r, growths);
        done = done && say_cost(&r, error);
    } else {
        karst_fail(error, KARST_FAILED, "out of memory");
    }
    free(r.ranges);
    free(r.steepness);
    free(r.is_density);
    free(growths);
    free(r.user_of);
    free(r.line_ends);
    return done;
}
