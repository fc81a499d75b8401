/* What bends rays inside clear matter: the index of refraction as generated code, and the data that this reads. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/engine/engine_parts.h"
#include "producers/language/emit/emit.h"
#include "producers/language/graph/derive.h"
#include "producers/language/tape/bounds_shared.h"
#include "producers/language/tape/tape.h"
#include "producers/points/points_kind.h"

/* What steps are bounded by: the index, its gradient, clear matter. */
#define NUM_RANGES 5
/* A longer tape takes more time than the steps that it saves: those go by their own measure then. */
#define MOST_BOUND_INSTRUCTIONS 96u
_Static_assert(NUM_RANGES <= KARST_MOST_RANGES, "the header has room for all");
#define TEXT_OF_(number) #number
#define TEXT_OF(number) TEXT_OF_(number)
#define OPTIONS_BYTES (KARST_TAPE_OPTIONS_BYTES + 64)

bool karst_engine_world_bends(const karst_engine_world *world)
{
    const karst_world_file *file = world->file->content[KARST_CONTENT_CLEAR];
    return file && karst_has_output(file->layout.world.root, KARST_OUTPUT_INDEX) &&
           !file->layout.is_known[file->layout.world.root[KARST_ROOT_INDEX]];
}

/* The data of `sides`: its layout's words, then the tape's constants and code. */
static bool make_bound_data(karst_engine_world *world, const karst_tape *tape, karst_context *context,
                            karst_error *error)
{
    karst_engine_refining *sides = &world->bending.sides;
    const size_t constants = sides->layout.num_words, code = constants + (tape->num_constants + 1) / 2,
                 size_bytes = 8 * code + tape->num_instructions * sizeof *tape->code;
    karst_ranges_header header = {.num_instructions = tape->num_instructions,
                                  .code = (uint32_t)code,
                                  .constants = (uint32_t)constants,
                                  .values = sides->layout.values_word,
                                  .num_values = sides->layout.num_values};
    memcpy(header.output, tape->output, NUM_RANGES * sizeof *header.output);
    char *words = calloc(1, size_bytes);
    if (!words)
        return karst_fail(error, KARST_FAILED, "out of memory");
    memcpy(words, &header, sizeof header);
    memcpy(words + 8 * constants, tape->constants, tape->num_constants * sizeof *tape->constants);
    memcpy(words + 8 * code, tape->code, tape->num_instructions * sizeof *tape->code);
    sides->data = karst_buffer_create(context, "refine", size_bytes, NULL, error);
    const bool done = sides->data && karst_buffer_write(sides->data, 0, words, size_bytes, error) &&
                      karst_engine_update_refining(sides, world, error);
    free(words);
    return done;
}

/* `options` become those of a build with the tape's interpreter. */
static bool make_bounds(karst_engine_world *world, karst_context *context, const karst_resolved_world *index,
                        karst_expr clear, char options[OPTIONS_BYTES], karst_error *error)
{
    karst_engine_refining *sides = &world->bending.sides;
    if (!(sides->gradient = karst_derive_sides(index, clear, error)))
        return false;
    const karst_resolved_world *of = &sides->gradient->world;
    if (!karst_world_layout_init(&sides->layout, of))
        return karst_fail(error, KARST_BAD_WORLD, "its gradient needs too much memory");
    const karst_expr roots[NUM_RANGES] = {of->root[KARST_ROOT_DENSITY], of->gradient[0], of->gradient[1],
                                          of->gradient[2], of->text};
    karst_tape tape;
    if (!karst_tape_build(&sides->layout, roots, NUM_RANGES, &tape, error))
        return false;
    bool done = tape.num_slots <= KARST_TAPE_MOST_SLOTS ||
                karst_fail(error, KARST_BAD_WORLD, "its bounds need too much memory");
    done = done && make_bound_data(world, &tape, context, error);
    if (done) {
        char tape_options[KARST_TAPE_OPTIONS_BYTES];
        karst_tape_options(&tape, tape_options, sizeof tape_options);
        snprintf(options, OPTIONS_BYTES, "-DWORLD_HAS_DATA -DWORLD_RANGES=" TEXT_OF(NUM_RANGES) "%s %s",
                 tape.num_instructions > MOST_BOUND_INSTRUCTIONS ? " -DBEND_UNBOUNDED" : "", tape_options);
    }
    karst_tape_finish(&tape);
    return done;
}

static bool make_bender(karst_engine_world *world, karst_context *context, const char *options, bool fine,
                        karst_error *error)
{
    static const char ranges[] = "\n#include \"producers/language/tape/tape_ranges.clh\"\n";
    const karst_engine_refining *clear = &world->content[KARST_CONTENT_CLEAR].refining;
    karst_engine_bending *bending = &world->bending;
    char *source = NULL;
    if (!karst_emit_two_surfaces(&clear->layout, &bending->index.layout, &source, error))
        return false;
    const size_t length = strlen(source);
    char *all = realloc(source, length + sizeof ranges);
    if (!all) {
        free(source);
        return karst_fail(error, KARST_FAILED, "out of memory");
    }
    source = all;
    memcpy(source + length, ranges, sizeof ranges);
    const karst_bend_world bent = {.source = source,
                                   .options = options,
                                   .data = clear->data,
                                   .index_data = bending->index.data,
                                   .bound_data = bending->sides.data,
                                   .voxel_m = ldexp(1, world->file->info.voxel_log2_m)};
    bending->bender = karst_bender_create(context, &bent, fine ? KARST_BEND_FINE_TOLERANCE : KARST_BEND_TOLERANCE,
                                          error);
    free(source);
    return bending->bender != NULL;
}

bool karst_engine_world_build_bending(karst_engine_world *world, karst_context *context, bool fine, karst_error *error)
{
    if (!karst_engine_world_bends(world))
        return true;
    const karst_resolved_world *clear = &world->file->content[KARST_CONTENT_CLEAR]->program->world;
    const karst_resolved_world index = {.graph = clear->graph,
                                        .root[KARST_ROOT_DENSITY] = clear->root[KARST_ROOT_INDEX]};
    karst_error why = {0};
    char options[OPTIONS_BYTES];
    if (karst_clear_points_kind.is_named(world->file->program))
        karst_fail(&why, KARST_BAD_WORLD, "models of clear matter are not in its way");
    else if (!world->content[KARST_CONTENT_CLEAR].refining.gradient)
        karst_fail(&why, KARST_BAD_WORLD, "the gradient of clear matter is too large");
    else if (karst_engine_derive(&world->bending.index, world, &index, context, &why) &&
             make_bounds(world, context, &index, clear->root[KARST_ROOT_DENSITY], options, &why) &&
             make_bender(world, context, options, fine, &why))
        return true;
    if (why.status != KARST_BAD_WORLD)
        return karst_fail(error, why.status, "%s", why.message);
    return karst_fail(error, KARST_BAD_WORLD,
                      "%.300s: rays cannot be followed through an index that varies (%s): make clear() or index() "
                      "simpler, or give clear_surface() an ior",
                      world->file->info.name, why.message);
}

void karst_engine_world_close_bending(karst_engine_world *world)
{
    karst_bender_destroy(world->bending.bender);
    karst_engine_finish_refining(&world->bending.index);
    karst_engine_finish_refining(&world->bending.sides);
    world->bending = (karst_engine_bending){.bender = NULL};
}

bool karst_engine_report_index(karst_engine *engine, karst_error *error)
{
    karst_engine_bending *bending = &engine->shown.bending;
    uint32_t num = 0;
    float place[3];
    if (!bending->bender || bending->reported)
        return true;
    if (!karst_bender_faults(bending->bender, &num, place, error))
        return false;
    if (num == 0)
        return true;
    const double voxel_m = exp2(engine->world->voxel_log2_m);
    double at_m[3];
    for (int i = 0; i < 3; i++)
        at_m[i] = ((double)engine->drawn.position.voxel[i] + (double)place[i]) * voxel_m;
    bending->reported = true;
    karst_log_print(engine->log, KARST_LOG_WARNING,
                    "%s: the index of refraction is below 1, or no number, where light goes, and is taken as 1: "
                    "met %u times in this picture, first at %.9g,%.9g,%.9g",
                    engine->world->name, num, at_m[0], at_m[1], at_m[2]);
    return true;
}
