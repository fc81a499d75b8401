#include "producers/language/emit/emit.h"

#include <stdlib.h>
#include <string.h>

#include "producers/language/emit/emit_internal.h"

/* What stands in the way of generated code. */
static bool check(karst_emit *emit, const karst_expr *roots, size_t num_roots, const char *what, karst_error *error)
{
    uint32_t count = karst_emit_mark(emit, roots, num_roots), num_octaves = 0;
    for (karst_expr e = 1; e < emit->graph->num_nodes; e++) {
        const karst_expr_node *n = &emit->graph->nodes[e];
        if (!emit->nodes[e].needs)
            continue;
        if (n->op == KARST_OP_POSITION)
            return karst_fail(error, KARST_FAILED, "%s was not resolved", what);
        if (n->op == KARST_OP_NOISE) {
            num_octaves += emit->graph->noises[n->extra].num_octaves;
            count += KARST_EMIT_NOISE_OPS - 1;
        }
        if (n->op == KARST_OP_SIN_TURNS || n->op == KARST_OP_COS_TURNS)
            count += KARST_EMIT_TURNS_OPS - 1;
    }
    if (count > KARST_EMIT_MAX_OPS)
        return karst_fail(error, KARST_BAD_WORLD, "%s is too large: %u operations; at most %u can be compiled", what,
                          count, KARST_EMIT_MAX_OPS);
    if (num_octaves > KARST_EMIT_MAX_OCTAVES)
        return karst_fail(error, KARST_BAD_WORLD, "%s is too large: %u octaves of noise; at most %u can be compiled",
                          what, num_octaves, KARST_EMIT_MAX_OCTAVES);
    return true;
}

/* Of the nodes that are marked: what another part of the world needs is no part of this one's text. */
static bool is_gradient_noise_alone(const karst_emit *emit)
{
    for (karst_expr e = 1; e < emit->graph->num_nodes; e++)
        if (emit->nodes[e].needs && emit->graph->nodes[e].op == KARST_OP_NOISE &&
            emit->graph->noises[emit->graph->nodes[e].extra].base != KARST_NOISE_GRADIENT &&
            !emit->graph->noises[emit->graph->nodes[e].extra].image)
            return false;
    return true;
}

/* How many axes images have at most: 0 without any, 3 with fields. */
static uint32_t image_axes(const karst_emit *emit)
{
    uint32_t most = 0;
    for (karst_expr e = 1; e < emit->graph->num_nodes; e++) {
        const uint32_t num_axes = emit->nodes[e].needs ? karst_graph_image_axes(emit->graph, e) : 0;
        most = num_axes > most ? num_axes : most;
    }
    return most;
}

/* What octave.clh is told. */
static const char *definitions_of(bool is_gradient_noise_alone, uint32_t num_axes)
{
    static const char *const texts[2][3] = {{"", KARST_EMIT_HAS_IMAGES, KARST_EMIT_HAS_FIELDS},
                                            {KARST_EMIT_ONLY_GRADIENT, KARST_EMIT_ONLY_GRADIENT KARST_EMIT_HAS_IMAGES,
                                             KARST_EMIT_ONLY_GRADIENT KARST_EMIT_HAS_FIELDS}};
    return texts[is_gradient_noise_alone][num_axes ? num_axes - 1 : 0];
}

static const char *definitions(const karst_emit *emit)
{
    return definitions_of(is_gradient_noise_alone(emit), image_axes(emit));
}

/* And of colours with textures. */
static const char *has_textures(const karst_emit *emit)
{
    for (karst_expr e = 1; e < emit->graph->num_nodes; e++)
        if (emit->nodes[e].texture)
            return KARST_EMIT_HAS_TEXTURES;
    return "";
}

static void preamble(karst_emit *emit)
{
    karst_text_add(&emit->text, "%s%s#include \"producers/language/emit/emit.clh\"\n\n", definitions(emit),
                   has_textures(emit));
}

static bool take_text(karst_emit *emit, char **to, karst_error *error)
{
    bool good = !emit->text.failed || karst_fail(error, KARST_FAILED, "out of memory");
    if (good)
        *to = emit->text.bytes;
    else
        karst_text_finish(&emit->text);
    emit->text = (karst_text){0};
    return good;
}

/* The density's text: its own, or, if that were too large, the interpreter of its tape. */
static bool write_density(karst_emit *emit, karst_emitted *emitted, karst_error *error)
{
    karst_error why = {0};
    if (check(emit, &emit->layout->world.root[KARST_ROOT_DENSITY], 1, "density", &why)) {
        preamble(emit);
        karst_emit_points(emit, emitted);
        karst_emit_bricks(emit, emitted);
    } else if (why.status == KARST_BAD_WORLD) {
        emitted->is_tape = true;
        karst_text_add(&emit->text, "%s#include \"producers/language/tape/tape_world.clh\"\n", definitions(emit));
    } else {
        return karst_fail(error, why.status, "%s", why.message);
    }
    emitted->is_gradient_noise_alone = is_gradient_noise_alone(emit);
    return take_text(emit, &emitted->source, error);
}

/* The same for what shading runs, if there is anything. */
static bool write_shading(karst_emit *emit, karst_emitted *emitted, karst_error *error)
{
    karst_error why = {0};
    karst_expr roots[KARST_NUM_ROOTS];
    size_t num_roots = karst_program_roots(emit->layout->world.root, KARST_PROGRAM_SHADING, roots);
    if (num_roots == 0)
        return true;
    if (check(emit, roots, num_roots, "colour", &why)) {
        preamble(emit);
        karst_emit_output_names(emit);
        karst_emit_shading(emit, emitted);
    } else if (why.status == KARST_BAD_WORLD) {
        emitted->is_colour_tape = true;
        karst_emit_output_names(emit);
        karst_text_add(&emit->text, "%s%s#include \"producers/language/tape/tape_colour.clh\"\n", definitions(emit),
                       has_textures(emit));
    } else {
        return karst_fail(error, why.status, "%s", why.message);
    }
    return take_text(emit, &emitted->colour_source, error);
}

static bool begin(karst_emit *emit, const karst_world_layout *layout, karst_error *error)
{
    *emit = (karst_emit){.layout = layout, .graph = layout->world.graph};
    emit->nodes = calloc(emit->graph->num_nodes, sizeof *emit->nodes);
    emit->placed = calloc(layout->num_record_words + 1u, sizeof *emit->placed);
    return (emit->nodes && emit->placed) || karst_fail(error, KARST_FAILED, "out of memory");
}

static void finish(karst_emit *emit)
{
    free(emit->nodes);
    free(emit->placed);
}

bool karst_emit_is_tape(const karst_world_layout *layout, bool *is_tape, karst_error *error)
{
    karst_emit emit;
    karst_error why = {0};
    bool done = begin(&emit, layout, error);
    *is_tape = done && !check(&emit, &layout->world.root[KARST_ROOT_DENSITY], 1, "density", &why) &&
               why.status == KARST_BAD_WORLD;
    if (done && why.status != KARST_OK && !*is_tape)
        done = karst_fail(error, why.status, "%s", why.message);
    finish(&emit);
    return done;
}

bool karst_emit_world(const karst_world_layout *layout, karst_emitted *emitted, karst_error *error)
{
    karst_emit emit;
    *emitted = (karst_emitted){0};
    bool done = begin(&emit, layout, error);
    done = done && write_density(&emit, emitted, error) && write_shading(&emit, emitted, error);
    if (!done)
        karst_emitted_finish(emitted);
    finish(&emit);
    return done;
}

/* What the functions of a gradient need before them. */
typedef struct {
    bool is_gradient_noise_alone;
    uint32_t image_axes;
} surface_needs;

/* world_point and world_surface, as text of their own. */
static bool write_surface(const karst_world_layout *layout, surface_needs *needs, char **text, karst_error *error)
{
    const karst_resolved_world *world = &layout->world;
    const karst_expr roots[4] = {world->root[KARST_ROOT_DENSITY], world->gradient[0], world->gradient[1],
                                 world->gradient[2]};
    karst_emit emit;
    karst_emitted points = {0};
    bool done = begin(&emit, layout, error);
    if (done && check(&emit, roots, 4, "the gradient of the density", error)) {
        *needs = (surface_needs){is_gradient_noise_alone(&emit), image_axes(&emit)};
        karst_emit_points(&emit, &points);
        karst_emit_surfaces(&emit);
        done = take_text(&emit, text, error);
    } else {
        done = false;
    }
    finish(&emit);
    return done;
}

static bool join_surfaces(const surface_needs *needs, const char *first, const char *second, char **source,
                          karst_error *error)
{
    static const char other[] = "#define world_point other_point\n#define world_surface other_surface\n";
    karst_text text = {0};
    karst_text_add(&text, "%s#include \"producers/language/emit/emit.clh\"\n\n%s%s%s",
                   definitions_of(needs->is_gradient_noise_alone, needs->image_axes), first, second ? other : "",
                   second ? second : "");
    if (second)
        karst_text_add(&text, "#undef world_point\n#undef world_surface\n");
    *source = text.bytes;
    if (!text.failed)
        return true;
    karst_text_finish(&text);
    *source = NULL;
    return karst_fail(error, KARST_FAILED, "out of memory");
}

bool karst_emit_surface(const karst_world_layout *layout, char **source, karst_error *error)
{
    surface_needs needs;
    char *text = NULL;
    const bool done = write_surface(layout, &needs, &text, error) && join_surfaces(&needs, text, NULL, source, error);
    free(text);
    return done;
}

bool karst_emit_two_surfaces(const karst_world_layout *layout, const karst_world_layout *other, char **source,
                             karst_error *error)
{
    surface_needs needs, others;
    char *first = NULL, *second = NULL;
    bool done = write_surface(layout, &needs, &first, error) && write_surface(other, &others, &second, error);
    if (done) {
        needs.is_gradient_noise_alone = needs.is_gradient_noise_alone && others.is_gradient_noise_alone;
        needs.image_axes = needs.image_axes > others.image_axes ? needs.image_axes : others.image_axes;
        done = join_surfaces(&needs, first, second, source, error);
    }
    free(first);
    free(second);
    return done;
}

void karst_emitted_finish(karst_emitted *emitted)
{
    free(emitted->source);
    free(emitted->colour_source);
    *emitted = (karst_emitted){0};
}
