#include "producers/language/graph/data.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "noise/gradient.clh"
#include "producers/language/graph/affine.h"
#include "producers/language/image/image.h"
#include "producers/language/ops/octave.clh"
#include "producers/language/graph/uniform.h"

enum { LINEAR_WORDS = 6, LATTICE_WORDS = 5, CELLS_WORDS = 9, OCTAVE_WORDS = 18 };
_Static_assert(sizeof(karst_linear) == 8 * LINEAR_WORDS && sizeof(karst_lattice) == 8 * LATTICE_WORDS &&
                   sizeof(karst_cells) == 8 * CELLS_WORDS && sizeof(karst_octave) == 8 * OCTAVE_WORDS,
               "records are whole words");

_Static_assert((int)OCTAVE_GRADIENT == KARST_NOISE_GRADIENT && (int)OCTAVE_VALUE == KARST_NOISE_VALUE &&
                   (int)OCTAVE_SIMPLEX == KARST_NOISE_SIMPLEX && (int)OCTAVE_WORLEY_F1 == KARST_NOISE_WORLEY_F1 &&
                   (int)OCTAVE_WORLEY_F2 == KARST_NOISE_WORLEY_F2 && (int)OCTAVE_LEVEL == KARST_NUM_NOISE_BASES &&
                   (int)OCTAVE_IMAGE == KARST_NOISE_IMAGE,
               "octave.clh has graph.h's bases");
_Static_assert(OCTAVE_SUM == KARST_NOISE_SUM && OCTAVE_RIDGED == KARST_NOISE_RIDGED &&
                   OCTAVE_BILLOW == KARST_NOISE_BILLOW && OCTAVE_TURBULENCE == KARST_NOISE_TURBULENCE,
               "octave.clh has graph.h's shapes");

static const karst_expr_node *node_of(const karst_world_layout *layout, karst_expr e)
{
    return &layout->world.graph->nodes[e];
}

static bool has_place(const karst_graph *graph, karst_expr e)
{
    return graph->nodes[e].op == KARST_OP_AFFINE || graph->nodes[e].op == KARST_OP_SHIFTED;
}

karst_expr karst_affine_behind(const karst_graph *graph, karst_expr e)
{
    return graph->nodes[e].op == KARST_OP_SHIFTED ? graph->nodes[e].arg[0] : e;
}

karst_expr karst_noise_moved_by(const karst_graph *graph, karst_expr argument)
{
    const karst_expr_node *n = &graph->nodes[argument];
    if (n->op == KARST_OP_AFFINE)
        return KARST_NO_EXPR;
    karst_expr by = n->op == KARST_OP_SHIFTED ? n->arg[1] : argument;
    const karst_number *known = karst_graph_constant(graph, by);
    return known && karst_number_is(*known, 0) ? KARST_NO_EXPR : by;
}

int karst_noise_way(const karst_graph *graph, karst_expr e)
{
    const karst_expr *arg = graph->nodes[e].arg;
    const uint8_t base = graph->noises[graph->nodes[e].extra].base;
    bool is_level = !karst_noise_moved_by(graph, arg[1]) &&
                    (karst_noise_moved_by(graph, arg[0]) || karst_noise_moved_by(graph, arg[2]));
    return base == KARST_NOISE_GRADIENT && is_level ? OCTAVE_LEVEL : base;
}

bool karst_takes_place(const karst_world_layout *layout, karst_expr e, int k)
{
    const karst_expr_node *n = node_of(layout, e);
    if (!n->arg[k] || !has_place(layout->world.graph, n->arg[k]))
        return false;
    switch (n->op) {
    case KARST_OP_NOISE:
        return true;
    case KARST_OP_FLOOR:
    case KARST_OP_FRACT:
    case KARST_OP_CELL:
    case KARST_OP_SIN_TURNS:
    case KARST_OP_COS_TURNS:
        return k == 0;
    case KARST_OP_MOD:
        return k == 0 && layout->is_known[n->arg[1]];
    default:
        return false;
    }
}

/* ---- layout ---- */

/* What roots need, added to what is needed already. */
static void mark_needed(const karst_resolved_world *world, const karst_expr *roots, size_t num_roots,
                        const uint8_t *is_known, uint8_t *needed)
{
    const karst_graph *graph = world->graph;
    for (size_t i = 0; i < num_roots; i++)
        needed[roots[i]] = 1;
    for (uint32_t e = graph->num_nodes - 1; e > 0; e--)
        for (int k = 0; needed[e] && !is_known[e] && k < 4; k++)
            needed[graph->nodes[e].arg[k]] = 1;
    needed[0] = 0;
}

/* Records of FLOOR, FRACT and MOD that divide the same form by the same number are one, and so are those of sines.
 * Those of one form are chained; a look at the latest few finds what texts repeat. */
typedef struct {
    karst_expr *latest;   /* of an AFFINE node: the user that got a record last */
    karst_expr *previous; /* of such a user: the one before */
} record_chains;

static bool is_turn(const karst_expr_node *n) { return n->op == KARST_OP_SIN_TURNS || n->op == KARST_OP_COS_TURNS; }

static uint32_t same_record(const karst_world_layout *layout, const record_chains *chains, karst_expr e)
{
    const karst_expr_node *n = node_of(layout, e);
    karst_expr before = chains->latest[karst_affine_behind(layout->world.graph, n->arg[0])];
    for (int looks = 0; before && looks < 64; looks++, before = chains->previous[before]) {
        const karst_expr_node *b = node_of(layout, before);
        bool same_divisor = (n->op == KARST_OP_MOD ? n->arg[1] : 0) == (b->op == KARST_OP_MOD ? b->arg[1] : 0);
        if (is_turn(b) == is_turn(n) && same_divisor)
            return layout->word[before];
    }
    return KARST_NO_WORD;
}

static uint32_t take_words(karst_world_layout *layout, uint32_t count)
{
    layout->num_words += count;
    return layout->num_words - count;
}

static void lay_out_node(karst_world_layout *layout, record_chains *chains, karst_expr e)
{
    const karst_graph *graph = layout->world.graph;
    const karst_expr_node *n = node_of(layout, e);
    if (layout->is_known[e]) {
        if (n->op != KARST_OP_CONSTANT)
            layout->word[e] = layout->num_values++;
        return;
    }
    if (n->op == KARST_OP_AFFINE)
        layout->word[e] = take_words(layout, LINEAR_WORDS);
    else if (n->op == KARST_OP_NOISE)
        layout->word[e] = take_words(layout, (uint32_t)OCTAVE_WORDS * graph->noises[n->extra].num_octaves);
    else if (karst_takes_place(layout, e, 0)) {
        karst_expr affine = karst_affine_behind(graph, n->arg[0]);
        uint32_t same = same_record(layout, chains, e);
        layout->word[e] = same != KARST_NO_WORD ? same : take_words(layout, is_turn(n) ? LATTICE_WORDS : CELLS_WORDS);
        chains->previous[e] = chains->latest[affine];
        chains->latest[affine] = e;
    }
}

/* Values, or records, of what is needed and has none yet. */
static void lay_out(karst_world_layout *layout, record_chains *chains, const uint8_t *needed, bool values)
{
    for (karst_expr e = 0; e < layout->world.graph->num_nodes; e++)
        if (needed[e] && layout->word[e] == KARST_NO_WORD && (layout->is_known[e] != 0) == values)
            lay_out_node(layout, chains, e);
}

/* Values are counted in steps of these. */
#define VALUES_STEP 32u

/* Of the largest pages that systems map files by. */
#define WORDS_OF_A_PAGE (65536u / 8)

/* Each image once, behind everything else. False: words cannot be counted any more. */
static bool lay_out_images(karst_world_layout *layout)
{
    const karst_graph *graph = layout->world.graph;
    layout->image_word = karst_arena_alloc(graph->arena, (graph->num_noises + 1u) * sizeof *layout->image_word);
    if (!layout->image_word)
        return false;
    for (karst_expr e = 1; e < graph->num_nodes; e++) {
        const karst_expr_node *n = &graph->nodes[e];
        if (n->op != KARST_OP_NOISE || layout->word[e] == KARST_NO_WORD || !graph->noises[n->extra].image ||
            layout->image_word[n->extra])
            continue;
        const karst_samples_image *image = graph->noises[n->extra].image;
        for (uint32_t i = 0; i < graph->num_noises && !layout->image_word[n->extra]; i++)
            if (graph->noises[i].image == image)
                layout->image_word[n->extra] = layout->image_word[i];
        if (layout->image_word[n->extra])
            continue;
        if (image->file.is_open) {
            layout->has_mapped = true;
            layout->num_words = (layout->num_words + WORDS_OF_A_PAGE - 1) / WORDS_OF_A_PAGE * WORDS_OF_A_PAGE;
        }
        if (image->num_words > INT32_MAX - layout->num_words)
            return false;
        layout->image_word[n->extra] = take_words(layout, image->num_words);
    }
    return true;
}

bool karst_world_layout_init(karst_world_layout *layout, const karst_resolved_world *world)
{
    const karst_graph *graph = world->graph;
    uint32_t count = graph->num_nodes;
    *layout = (karst_world_layout){.world = *world, .num_words = KARST_DATA_HEADER_WORDS};
    layout->is_known = karst_arena_alloc(graph->arena, count);
    layout->word = karst_arena_alloc(graph->arena, count * sizeof *layout->word);
    uint8_t *needed = karst_arena_alloc(graph->arena, count);
    record_chains chains = {.latest = karst_arena_alloc(graph->arena, count * sizeof *chains.latest),
                            .previous = karst_arena_alloc(graph->arena, count * sizeof *chains.previous)};
    if (!layout->is_known || !layout->word || !needed || !chains.latest || !chains.previous)
        return false;
    layout->is_known[0] = 1; /* arguments that are not there are no obstacle */
    for (karst_expr e = 1; e < count; e++) {
        const karst_expr_node *n = &graph->nodes[e];
        bool known = karst_graph_is_uniform(graph, e) && n->op != KARST_OP_NOISE && n->op != KARST_OP_AFFINE;
        for (int k = 0; known && k < 4; k++)
            known = layout->is_known[n->arg[k]];
        layout->is_known[e] = known;
    }
    for (karst_expr e = 0; e < count; e++)
        layout->word[e] = KARST_NO_WORD;
    /* The density's first, and room to spare among the values: its code is then the same whatever shading needs. */
    mark_needed(world, &world->root[KARST_ROOT_DENSITY], 1, layout->is_known, needed);
    lay_out(layout, &chains, needed, true);
    lay_out(layout, &chains, needed, false);
    if (world->text)
        mark_needed(world, &world->text, 1, layout->is_known, needed);
    karst_expr shading[KARST_NUM_ROOTS];
    mark_needed(world, shading, karst_program_roots(world->root, KARST_PROGRAM_SHADING, shading), layout->is_known,
                needed);
    if (world->has_gradient)
        mark_needed(world, world->gradient, 3, layout->is_known, needed);
    lay_out(layout, &chains, needed, true);
    layout->num_values = (layout->num_values / VALUES_STEP + 1) * VALUES_STEP;
    layout->values_word = layout->num_words;
    layout->num_words += layout->num_values;
    lay_out(layout, &chains, needed, false);
    layout->num_record_words = layout->num_words;
    return lay_out_images(layout);
}

/* ---- filling ---- */

/* The octave of an image, whose header lies so many words from it. What has no lattice, being too fine for one, is the
 * middle of its coarsest level. */
static void fill_image(const karst_noise *noise, uint32_t distance_words, karst_octave *octave)
{
    const karst_samples_image *image = noise->image;
    octave->image = distance_words;
    if (((const karst_image_header *)image->words)->num_packed)
        octave->amplitude = (float)noise->channel;
    octave->seed = IMAGE_FADED;
    if (octave->frequency == KARST_OCTAVE_FADED) {
        for (uint32_t i = 0; i < image->num_axes; i++)
            octave->lattice[i] = (karst_lattice){.cell = image->size[i] / 2};
        return;
    }
    uint64_t below = octave->frequency > 1 ? (uint64_t)octave->frequency - 1 : 0;
    octave->seed = below >> 32 ? 64u - (uint32_t)k_clz((uint)(below >> 32)) : 32u - (uint32_t)k_clz((uint)below);
}

static karst_number value_or_zero(const karst_number *values, const uint8_t *known, karst_expr e)
{
    return e && known[e] ? values[e] : karst_number_int(0);
}

static karst_affine_value affine_value(const karst_graph *graph, const karst_number *values, const uint8_t *known,
                                       karst_expr e)
{
    const karst_affine *affine = &graph->affines[graph->nodes[karst_affine_behind(graph, e)].extra];
    karst_affine_value form;
    for (int i = 0; i < 3; i++)
        form.coefficient[i] = value_or_zero(values, known, affine->coefficient[i]);
    form.offset = value_or_zero(values, known, affine->offset);
    return form;
}

static void fill_octaves(const karst_graph *graph, const karst_expr_node *n, const karst_number *values,
                         const uint8_t *known, uint32_t seed, int voxel_log2_m, uint32_t distance_words, void *record)
{
    const karst_noise *noise = &graph->noises[n->extra];
    karst_affine_value argument[3];
    for (int i = 0; i < 3; i++) {
        argument[i] = (karst_affine_value){.offset = karst_number_int(0)};
        for (int axis = 0; axis < 3; axis++)
            argument[i].coefficient[axis] = karst_number_int(0);
        if (has_place(graph, n->arg[i]))
            argument[i] = affine_value(graph, values, known, n->arg[i]);
    }
    karst_octave *octaves = record;
    for (int k = 0; k < noise->num_octaves; k++)
        octaves[k] = karst_octave_of(argument, value_or_zero(values, known, noise->lacunarity),
                                     value_or_zero(values, known, noise->gain),
                                     noise_call_seed(seed, noise->seed_offset), k, voxel_log2_m);
    if (noise->image)
        fill_image(noise, distance_words, octaves);
}

static void fill_record(const karst_world_layout *layout, karst_expr e, const karst_number *values, uint32_t seed,
                        int voxel_log2_m, void *record)
{
    const karst_graph *graph = layout->world.graph;
    const karst_expr_node *n = &graph->nodes[e];
    if (n->op == KARST_OP_NOISE) {
        uint32_t distance_words = graph->noises[n->extra].image ? layout->image_word[n->extra] - layout->word[e] : 0;
        fill_octaves(graph, n, values, layout->is_known, seed, voxel_log2_m, distance_words, record);
        return;
    }
    karst_affine_value form = affine_value(graph, values, layout->is_known, n->op == KARST_OP_AFFINE ? e : n->arg[0]);
    if (n->op == KARST_OP_AFFINE)
        *(karst_linear *)record = karst_linear_of(form, voxel_log2_m);
    else if (is_turn(n))
        *(karst_lattice *)record = karst_lattice_of(form, voxel_log2_m);
    else
        *(karst_cells *)record =
            karst_cells_of(n->op == KARST_OP_MOD ? karst_affine_divide(form, values[n->arg[1]]) : form, voxel_log2_m);
}

float karst_number_rest(karst_number number)
{
    float nearest = karst_number_to_float(number);
    if (!isfinite(nearest))
        return 0;
    return karst_number_to_float(karst_number_subtract(number, karst_number_double((double)nearest)));
}

/* As the lanes see it: a float's bits, an int's, a mask. */
static uint32_t bits_of(karst_number number, uint8_t type)
{
    if (type == KARST_TYPE_FLOAT)
        return k_as_uint(karst_number_to_float(number));
    if (type == KARST_TYPE_BOOL)
        return number.numerator ? 0xffffffffu : 0;
    return (uint32_t)number.numerator;
}

static void *word_at(void *words, uint32_t word) { return (char *)words + 8 * (size_t)word; }

/* A large one may be mapped there already, and is written by nobody: its header tells. */
static void bring_image(const karst_samples_image *image, void *to)
{
    if (!image->file.is_open || memcmp(to, image->words, sizeof(karst_image_header)) != 0)
        memcpy(to, image->words, image->num_words * sizeof *image->words);
}

bool karst_world_data_fill(const karst_world_layout *layout, const karst_number *parameters, uint32_t seed,
                           int voxel_log2_m, void *words)
{
    const karst_graph *graph = layout->world.graph;
    karst_number *values = calloc(graph->num_nodes, sizeof *values);
    uint8_t *known = calloc(graph->num_nodes, 1);
    bool done = values && known;
    if (done) {
        karst_uniform_evaluate(graph, parameters, values, known);
        memset(words, 0, layout->num_record_words * sizeof(uint64_t));
        uint32_t *value_bits = (uint32_t *)word_at(words, layout->values_word);
        for (karst_expr e = 1; e < graph->num_nodes; e++) {
            if (layout->word[e] == KARST_NO_WORD)
                continue;
            if (layout->is_known[e]) {
                value_bits[layout->word[e]] = bits_of(values[e], graph->nodes[e].type);
                value_bits[layout->num_values + layout->word[e]] = k_as_uint(karst_number_rest(values[e]));
            } else
                fill_record(layout, e, values, seed, voxel_log2_m, word_at(words, layout->word[e]));
        }
        for (uint32_t i = 0; i < graph->num_noises; i++)
            if (layout->image_word[i])
                bring_image(graph->noises[i].image, word_at(words, layout->image_word[i]));
    }
    free(values);
    free(known);
    return done;
}

static bool is_pair(const karst_graph *graph, karst_expr e) { return graph->nodes[e].kind == KARST_KIND_WIDE; }

bool karst_is_computed_wide(const karst_graph *graph, karst_expr e)
{
    const karst_expr_node *n = &graph->nodes[e];
    switch (n->op) {
    case KARST_OP_LESS:
    case KARST_OP_LESS_EQUAL:
    case KARST_OP_EQUAL:
    case KARST_OP_NOT_EQUAL:
    case KARST_OP_FLOOR:
    case KARST_OP_FRACT:
    case KARST_OP_MOD:
    case KARST_OP_SIN:
    case KARST_OP_COS:
        return is_pair(graph, n->arg[0]) || is_pair(graph, n->arg[1]);
    default:
        return is_pair(graph, e);
    }
}

bool karst_resolved_world_check(const karst_resolved_world *world, const char **fault)
{
    const karst_expr_node *nodes = world->graph->nodes;
    if (!karst_graph_check(world->graph, fault))
        return false;
    for (int i = 0; i < KARST_NUM_ROOTS; i++)
        if (world->root[i] != KARST_NO_EXPR && nodes[world->root[i]].type != KARST_TYPE_FLOAT)
            *fault = i == KARST_ROOT_DENSITY ? "a density that is no float" : "a value of a surface that is no float";
    if (world->root[KARST_ROOT_DENSITY] == KARST_NO_EXPR)
        *fault = "there is no density";
    for (int i = 0; i < 3; i++)
        if (world->has_gradient && nodes[world->gradient[i]].type != KARST_TYPE_FLOAT)
            *fault = "a gradient that is no float";
    return !*fault;
}
