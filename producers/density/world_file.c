#include "producers/density/world_file.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/base/text.h"
#include "producers/density/density_producer.h"
#include "producers/language/graph/thin.h"
#include "producers/language/tape/bounds_shared.h"
#include "producers/language/oracle/look.h"
#include "producers/language/oracle/oracle.h"
#include "producers/points/points_kind.h"

_Static_assert(sizeof(karst_data_header) == KARST_DATA_HEADER_WORDS * sizeof(uint64_t), "the header fits its words");

static const char bounds_source[] = "#include \"producers/language/tape/bounds.clh\"\n";
static const char bounds_source_of_gradient_noise[] =
    KARST_EMIT_ONLY_GRADIENT "#include \"producers/language/tape/bounds.clh\"\n";

/* More slots take a larger stack of each thread, whatever the world uses of them. */
#define TAPE_COLOURS_SLOTS 64
#define TEXT_OF(value) #value
#define SLOTS_OPTION(slots) "-DTAPE_SLOTS=" TEXT_OF(slots)
const char karst_tape_colours_source[] = "#include \"producers/language/tape/tape_colour.clh\"\n";
const char karst_tape_colours_options[] = "-DWORLD_HAS_DATA " SLOTS_OPTION(TAPE_COLOURS_SLOTS);

/* ---- what a world has beside its land ---- */

const char *const karst_content_names[KARST_NUM_CONTENTS] = {"clear", "air"};

/* The entries that give a content's density, and its surface as the land's is given: colour, mirror and so on. */
static const struct {
    karst_entry density, surface;
} content_entries[KARST_NUM_CONTENTS] = {{KARST_ENTRY_CLEAR, KARST_ENTRY_CLEAR_SURFACE},
                                         {KARST_ENTRY_AIR, KARST_ENTRY_AIR}};

/* The first root of an entry, and how many it has. */
static uint32_t roots_of(karst_entry entry, uint32_t *num)
{
    const karst_output_info *first = &karst_outputs[karst_entries[entry].first],
                            *last = &karst_outputs[karst_entries[entry].last];
    *num = last->root + last->num_floats - first->root;
    return first->root;
}

/* A medium's values, by what stands for them. */
static karst_resolved_world world_of_air(const karst_resolved_world *world)
{
    karst_resolved_world of = {.graph = world->graph,
                               .root[KARST_ROOT_DENSITY] = world->root[KARST_ROOT_EXTINCTION],
                               .root[KARST_ROOT_MIRROR] = world->root[KARST_ROOT_AIR_G]};
    for (int i = 0; i < 3; i++) {
        of.root[KARST_ROOT_COLOUR + i] = world->root[KARST_ROOT_AIR_ALBEDO + i];
        of.root[KARST_ROOT_EMISSION + i] = world->root[KARST_ROOT_AIR_EMISSION + i];
    }
    return of;
}

/* What `index` says is also the index at the surface. Where the text has no surface, shading still wants a colour,
 * which nobody looks at. */
static void take_index(karst_resolved_world *of, karst_expr index)
{
    of->root[KARST_ROOT_INDEX] = of->root[KARST_ROOT_IOR] = index;
    for (int c = 0; c < 3 && !karst_has_output(of->root, KARST_OUTPUT_COLOUR); c++)
        of->root[KARST_ROOT_COLOUR + 2 - c] = index;
}

/* The same resolved graph with a content's values in the land's place. */
static karst_resolved_world world_of_content(const karst_resolved_world *world, karst_content content)
{
    if (content == KARST_CONTENT_AIR)
        return world_of_air(world);
    uint32_t num;
    const uint32_t density = roots_of(content_entries[content].density, &num),
                   surface = roots_of(content_entries[content].surface, &num);
    karst_resolved_world of = {.graph = world->graph, .root[KARST_ROOT_DENSITY] = world->root[density]};
    memcpy(of.root + KARST_ROOT_COLOUR, world->root + surface, num * sizeof *of.root);
    if (content == KARST_CONTENT_CLEAR && karst_has_output(world->root, KARST_OUTPUT_INDEX))
        take_index(&of, world->root[KARST_ROOT_INDEX]);
    return of;
}

/* ---- what is said ---- */

/* All diagnostics, an empty line apart. */
static char *join_diagnostics(const karst_diagnostic *first)
{
    size_t length = 0;
    for (const karst_diagnostic *d = first; d; d = d->next)
        length += strlen(d->text) + 2;
    char *text = length ? malloc(length) : NULL;
    char *end = text;
    for (const karst_diagnostic *d = first; text && d; d = d->next)
        end += sprintf(end, "%s%s", d->text, d->next ? "\n\n" : "");
    return text;
}

/* ---- data: the layout's words, the tape's constants, its code ---- */

/* A tape lies there in words: its constants, then its code. */
static size_t code_word(const karst_tape *tape, size_t word) { return word + (tape->num_constants + 1) / 2; }
static size_t end_word(const karst_tape *tape, size_t word)
{
    return code_word(tape, word) + tape->num_instructions * sizeof(karst_instruction) / 8;
}

static void place_tape(const karst_tape *tape, size_t word, char *data)
{
    if (!tape->code)
        return;
    memcpy(data + 8 * word, tape->constants, tape->num_constants * sizeof *tape->constants);
    memcpy(data + 8 * code_word(tape, word), tape->code, tape->num_instructions * sizeof *tape->code);
}

/* Outputs of shading's tape that the header has no room for. */
static size_t num_more(const karst_tape *tape)
{
    const size_t num_colours = karst_outputs[KARST_OUTPUT_COLOUR].num_floats;
    return tape->num_outputs > num_colours ? tape->num_outputs - num_colours : 0;
}

static void *make_data(const karst_world_file *file, const karst_number *values, uint32_t seed, karst_error *error)
{
    char *data = karst_world_words_create(&file->layout, file->data_bytes);
    if (!data || !karst_world_data_fill(&file->layout, values, seed, file->info.voxel_log2_m, data)) {
        karst_fail(error, KARST_FAILED, "out of memory");
        karst_world_file_free_data(file, data);
        return NULL;
    }
    const karst_tape *tape = &file->tape, *colour = &file->colour_tape;
    size_t word = file->layout.num_words, colour_word = end_word(tape, word);
    karst_data_header header = {.num_instructions = tape->num_instructions,
                                .code = (uint32_t)code_word(tape, word),
                                .constants = (uint32_t)word,
                                .values = file->layout.values_word,
                                .num_values = file->layout.num_values,
                                .output = tape->output[0],
                                .num_colour_instructions = colour->num_instructions,
                                .colour_code = (uint32_t)code_word(colour, colour_word),
                                .colour_constants = (uint32_t)colour_word,
                                .colour_output = {colour->output[0], colour->output[1], colour->output[2]},
                                .raises_thin = (file->raises_thin ? KARST_RAISES_THIN : 0u) |
                                               (file->fills_seams ? KARST_RAISES_SEAMS : 0u),
                                .smooths_jumps = file->smooths_jumps,
                                .voxel_log2_m = file->info.voxel_log2_m};
    if (num_more(colour)) {
        header.more_outputs = (uint32_t)end_word(colour, colour_word);
        memcpy(data + 8 * (size_t)header.more_outputs, colour->output + colour->num_outputs - num_more(colour),
               num_more(colour) * sizeof *colour->output);
    }
    memcpy(data, &header, sizeof header);
    place_tape(tape, word, data);
    place_tape(colour, colour_word, data);
    return data;
}

void karst_world_file_raise_thin(karst_world_file *file, karst_thin thin)
{
    const karst_resolved_world *world = &file->layout.world;
    karst_thin_facts facts = karst_graph_thin_facts(world->graph, world->root[KARST_ROOT_DENSITY]);
    /* Worlds that run on their tape would take seconds for it. */
    bool is_cheap = (!facts.has_noise || facts.has_thin_apart) && !file->code.is_tape;
    file->raises_thin = facts.may_be_thin && (thin == KARST_THIN_ALWAYS || (thin == KARST_THIN_AUTO && is_cheap));
    for (int i = 0; i < KARST_NUM_CONTENTS; i++)
        if (file->content[i] && i != KARST_CONTENT_AIR) /* which has no surface */
            karst_world_file_raise_thin(file->content[i], thin);
    karst_world_file *clear = file->content[KARST_CONTENT_CLEAR];
    if (clear)
        clear->fills_seams = clear->raises_thin;
}

void karst_world_file_smooth_jumps(karst_world_file *file)
{
    const karst_resolved_world *world = &file->layout.world;
    file->smooths_jumps =
        !file->code.is_tape && karst_graph_thin_facts(world->graph, world->root[KARST_ROOT_DENSITY]).may_jump;
}

/* ---- how to look at it ---- */

static void set_colours(float to[3], const double from[3])
{
    for (int i = 0; i < 3; i++)
        to[i] = (float)from[i];
}

static karst_number *parameter_values(const karst_world_file *file)
{
    karst_number *values = calloc(file->program->num_parameters + 1, sizeof *values);
    for (uint32_t i = 0; values && i < file->program->num_parameters; i++)
        values[i] = file->program->parameters[i].value;
    return values;
}

/* Of a text without a header: where one may stand, from the origin; how many voxels, at most and as powers of two, go
 * into the way to what is near, and how many times that is seen. */
#define LOOK_NEAREST_M 2.0
#define LOOK_FARTHEST_M 8192.0
#define LOOK_VOXELS_LOG2 11
#define LOOK_FINEST_LOG2_M (-12)
#define LOOK_VIEW_LOG2 8

static double density_at_height(const karst_world_file *file, karst_oracle *oracle, double height_m)
{
    int voxel_log2_m = file->program->header.voxel_log2_m;
    double offset_m[3] = {0, height_m, -4};
    karst_position at = karst_position_add_m((karst_position){{0}, {0}}, offset_m, voxel_log2_m);
    return karst_oracle_density(oracle, &at, -1).precise;
}

/* Where to stand if the header does not say: a few steps in front of the origin, as is the custom for distance
 * functions; over land (solid far below, air far above), at the lowest of heights that double from which the way up is
 * free, but not so low that the next rise hides everything. */
static void choose_camera(karst_world_file *file, double view_distance_m)
{
    const karst_world_header *header = &file->program->header;
    snprintf(file->camera, sizeof file->camera, "0,1,-4,0,-10,60");
    karst_number *values = parameter_values(file);
    karst_oracle *oracle =
        values ? karst_oracle_create(&file->program->world, values, header->seed, header->voxel_log2_m, NULL) : NULL;
    bool is_land = oracle && density_at_height(file, oracle, -view_distance_m) > 0 &&
                   density_at_height(file, oracle, view_distance_m) < 0;
    for (double height_m = view_distance_m / 64; is_land && height_m < view_distance_m; height_m *= 2) {
        bool is_free = true;
        for (int step = 0; step < 8 && is_free; step++)
            is_free = density_at_height(file, oracle, height_m * (1 + 0.25 * step)) < 0;
        if (!is_free)
            continue;
        snprintf(file->camera, sizeof file->camera, "0,%.0f,-4,30,-14,60", 1.25 * height_m);
        break;
    }
    karst_oracle_destroy(oracle);
    free(values);
}

/* What a point takes, in operations: many octaves take as many as several each. */
static uint32_t num_operations(const karst_graph *graph)
{
    enum { FEW_OCTAVES = 64, OPERATIONS_AN_OCTAVE = 4 };
    uint32_t num_octaves = 0;
    for (uint32_t i = 0; i < graph->num_noises; i++)
        num_octaves += graph->noises[i].num_octaves;
    return graph->num_nodes + (num_octaves > FEW_OCTAVES ? (num_octaves - FEW_OCTAVES) * OPERATIONS_AN_OCTAVE : 0);
}

/* A text without a header, or with one that says nothing of places, is a shape of unknown size. Looks at it from around
 * the origin, and takes the camera that shows most, a voxel that suits what is near to it, and a view distance that
 * suits both. */
static void look_around(karst_world_file *file)
{
    karst_program_graph *program = file->program;
    karst_world_header *header = &program->header;
    karst_number *values = header->is_given && !header->leaves_view ? NULL : parameter_values(file);
    karst_oracle *oracle =
        values ? karst_oracle_create(&program->world, values, header->seed, header->voxel_log2_m, NULL) : NULL;
    karst_look look;
    const uint32_t num = num_operations(&program->resolved);
    bool found = oracle && karst_look_around(oracle, num, header->voxel_log2_m, LOOK_NEAREST_M, LOOK_FARTHEST_M, &look);
    karst_oracle_destroy(oracle);
    free(values);
    if (!found)
        return;
    snprintf(file->camera, sizeof file->camera, "%.9g,%.9g,%.9g,%.9g,%.9g,%d", look.eye_m[0], look.eye_m[1],
             look.eye_m[2], look.yaw_deg, look.pitch_deg, KARST_LOOK_FOV_DEG);
    if (!header->has_sun) {
        header->has_sun = true;
        header->sun_azimuth_deg = look.sun_azimuth_deg;
        header->sun_elevation_deg = look.sun_elevation_deg;
    }
    file->is_indoors = look.is_indoors && !header->has_sky;
    int voxel_log2_m = ilogb(look.near_m) - LOOK_VOXELS_LOG2;
    voxel_log2_m = voxel_log2_m < LOOK_FINEST_LOG2_M ? LOOK_FINEST_LOG2_M : voxel_log2_m;
    if (voxel_log2_m < header->voxel_log2_m && karst_program_set_voxel(program, voxel_log2_m))
        header->view_distance_m = fmin(ldexp(1, ilogb(look.near_m) + LOOK_VIEW_LOG2), 8192);
}

/* Where no sun reaches, so much more light from the sky shows what there is. */
#define INDOORS_SKY 4.0f

static void set_lights(karst_world_file *file)
{
    const karst_world_header *header = &file->program->header;
    karst_world_info *info = &file->info;
    info->has_sun_colour = header->has_sun_colour;
    set_colours(info->sun_colour, header->sun_colour);
    info->num_lights = header->num_lights;
    for (uint32_t i = 0; i < header->num_lights; i++) {
        const karst_header_light *from = &header->lights[i];
        karst_world_light *to = &info->lights[i];
        *to = (karst_world_light){.kind = (karst_world_light_kind)from->kind,
                                  .azimuth_deg = from->azimuth_deg,
                                  .elevation_deg = from->elevation_deg,
                                  .size_deg = from->size_deg,
                                  .radius_m = from->radius_m,
                                  .angle_deg = from->angle_deg,
                                  .soft = from->soft,
                                  .shadow = from->shadow};
        set_colours(to->colour, from->colour);
        for (int axis = 0; axis < 3; axis++) /* which the header has looked at */
            karst_coordinate_parse(from->position[axis], header->voxel_log2_m, &to->position.voxel[axis],
                                   &to->position.fraction[axis], NULL);
    }
}

/* Colours of land whose text gives none. */
/* clang-format off */
#define PLAIN_FLAT {0.13f, 0.12f, 0.10f}
#define PLAIN_STEEP {0.17f, 0.15f, 0.13f}
/* clang-format on */

/* What the header leaves out is taken from a summer's day. */
static void set_info(karst_world_file *file)
{
    const karst_world_header *header = &file->program->header;
    char yaw[32], pitch[32], fov[32];
    double voxel_m = header->voxel_log2_m < 0 ? 1.0 / (double)(1ULL << -header->voxel_log2_m)
                                              : (double)(1ULL << header->voxel_log2_m);
    const double usual_view_m = ldexp(131072 * voxel_m, header->exact_above_log2);
    double view_distance_m = header->view_distance_m > 0 ? header->view_distance_m : usual_view_m;
    karst_text_from_double(header->camera_yaw_deg, yaw, sizeof yaw);
    karst_text_from_double(header->camera_pitch_deg, pitch, sizeof pitch);
    karst_text_from_double(header->camera_fov_deg, fov, sizeof fov);
    if (header->has_camera)
        snprintf(file->camera, sizeof file->camera, "%s,%s,%s,%s,%s,%s", header->camera_position[0],
                 header->camera_position[1], header->camera_position[2], yaw, pitch, fov);
    else if (!*file->camera)
        choose_camera(file, view_distance_m);
    file->info = (karst_world_info){
        .name = *header->name ? header->name : file->program->name,
        .description = header->description,
        .voxel_log2_m = header->voxel_log2_m,
        .seed = header->seed,
        .view_distance_m = view_distance_m,
        .camera = file->camera,
        .sun_azimuth_deg = header->has_sun ? header->sun_azimuth_deg : 135,
        .sun_elevation_deg = header->has_sun ? header->sun_elevation_deg : 40,
        .sky_zenith = {0.05f, 0.13f, 0.36f},
        .sky_horizon = {0.36f, 0.46f, 0.58f},
        .ground_flat = PLAIN_FLAT,
        .ground_steep = PLAIN_STEEP,
        .haze_distance_m = 0.6 * view_distance_m,
        .has_exposure = header->has_exposure,
        .exposure_stops = header->exposure_stops,
        .mirror = header->mirror,
        .has_occlusion = header->has_occlusion,
        .has_light_map = header->light_map != NULL,
        .has_own_mirror = karst_has_output(file->program->world.root, KARST_OUTPUT_MIRROR),
        .has_transparency = karst_has_output(file->program->world.root, KARST_OUTPUT_TRANSPARENCY),
        .has_air = karst_has_output(file->program->world.root, KARST_OUTPUT_EXTINCTION),
        .has_clear = karst_has_output(file->program->world.root, KARST_OUTPUT_CLEAR),
    };
    if (header->has_sky) {
        set_colours(file->info.sky_zenith, header->sky_zenith);
        set_colours(file->info.sky_horizon, header->sky_horizon);
        file->info.haze_distance_m = header->haze_distance_m > 0 ? header->haze_distance_m : 1e6 * view_distance_m;
        file->info.haze_height_m = header->haze_height_m;
        file->info.haze_globe_m = header->haze_globe_m;
        file->info.has_atmosphere = header->has_atmosphere;
        file->info.dust = header->dust;
    }
    set_lights(file);
    for (int i = 0; i < 3 && file->is_indoors; i++) {
        file->info.sky_zenith[i] *= INDOORS_SKY;
        file->info.sky_horizon[i] *= INDOORS_SKY;
    }
}

/* ---- opening ---- */

/* What is too large for the devices' compilers, told where its value is made. */
static bool fail_at(const karst_world_file *file, karst_expr root, const karst_error *why, karst_error *error)
{
    uint32_t line, column;
    karst_source_place(&file->program->source, file->program->resolved.nodes[root].where, &line, &column);
    if (why->status != KARST_BAD_WORLD)
        return karst_fail(error, why->status, "%s", why->message);
    return karst_fail(error, KARST_BAD_WORLD, "%.300s:%u:%u: %s", file->program->name, line, column, why->message);
}

static bool make_tape(karst_world_file *file, const karst_expr *roots, uint32_t num_roots, const char *what,
                      karst_tape *tape, karst_error *error)
{
    karst_error why = {0};
    bool is_built = tape == &file->tape ? karst_tape_build(&file->layout, roots, num_roots, tape, &why)
                                        : karst_tape_build_plain(&file->layout, roots, num_roots, tape, &why);
    if (is_built && tape->num_slots <= KARST_TAPE_MOST_SLOTS)
        return true;
    if (tape->num_slots > KARST_TAPE_MOST_SLOTS)
        karst_fail(&why, KARST_BAD_WORLD, "%s is too large: %u values are needed at a time; at most %d are possible",
                   what, tape->num_slots, KARST_TAPE_MOST_SLOTS);
    return fail_at(file, roots[0], &why, error);
}

static bool make_code(karst_world_file *file, karst_error *error)
{
    const karst_resolved_world *world = &file->program->world;
    karst_error why = {0};
    if (!karst_emit_world(&file->layout, &file->code, &why))
        return fail_at(file, world->root[KARST_ROOT_DENSITY], &why, error);
    if (!make_tape(file, &world->root[KARST_ROOT_DENSITY], 1, "density", &file->tape, error))
        return false;
    karst_expr shading[KARST_NUM_ROOTS];
    const uint32_t num_shading = (uint32_t)karst_program_roots(world->root, KARST_PROGRAM_SHADING, shading);
    const bool is_colour_alone = num_shading == karst_outputs[KARST_OUTPUT_COLOUR].num_floats;
    if (file->code.is_colour_tape && !make_tape(file, shading, num_shading, "colour", &file->colour_tape, error))
        return false;
    if (is_colour_alone && !file->code.is_colour_tape &&
        !karst_tape_build_plain(&file->layout, shading, num_shading, &file->colour_tape, &why))
        karst_tape_finish(&file->colour_tape);
    file->has_tape_colours =
        is_colour_alone && file->colour_tape.code && file->colour_tape.num_slots <= TAPE_COLOURS_SLOTS;
    return true;
}

static bool lay_out(karst_world_file *file, karst_error *error)
{
    const karst_resolved_world *world = &file->program->world;
    if (!karst_world_layout_init(&file->layout, world))
        return karst_fail(error, KARST_BAD_WORLD, "%.300s: the world needs too much memory to compile",
                          file->program->name);
    if (!make_code(file, error))
        return false;
    file->data_bytes = 8 * (end_word(&file->colour_tape, end_word(&file->tape, file->layout.num_words)) +
                            (num_more(&file->colour_tape) + 1) / 2);
    return true;
}

/* A content's program is the world's, but for its roots. */
static bool make_content(karst_world_file *file, karst_content content, karst_error *error)
{
    uint32_t num;
    if (file->program->world.root[roots_of(content_entries[content].density, &num)] == KARST_NO_EXPR)
        return true;
    karst_world_file *made = file->content[content] = calloc(1, sizeof *made);
    karst_program_graph *program = made ? malloc(sizeof *program) : NULL;
    if (!program)
        return karst_fail(error, KARST_FAILED, "out of memory");
    *program = *file->program;
    program->world = world_of_content(&file->program->world, content);
    program->is_deepened = false;
    made->program = program;
    made->info = file->info;
    return lay_out(made, error);
}

static bool complete(karst_world_file *file, karst_error *error)
{
    if (!lay_out(file, error))
        return false;
    set_info(file);
    for (int i = 0; i < KARST_NUM_CONTENTS; i++)
        if (!make_content(file, (karst_content)i, error))
            return false;
    return file->program->header.num_particles == 0 || file->content[KARST_CONTENT_AIR] ||
           karst_fail(error, KARST_BAD_WORLD,
                      "%.300s: its header has particles, which are in the air, and it says nothing of that: write "
                      "medium air(vec3 p) { medium m; m.extinction = 0.0; m.albedo = vec3(0.9); return m; }",
                      file->program->name);
}

/* What was compiled, and not the program. */
static void finish_code(karst_world_file *file)
{
    karst_emitted_finish(&file->code);
    karst_tape_finish(&file->tape);
    karst_tape_finish(&file->colour_tape);
    for (int i = 0; i < KARST_NUM_CONTENTS; i++) {
        if (file->content[i]) {
            finish_code(file->content[i]);
            free(file->content[i]->program);
        }
        free(file->content[i]);
        file->content[i] = NULL;
    }
}

/* A world whose deepened density is too large to run shows flat air as it is. Nothing is left of the first try. */
static bool become_flat(karst_world_file *file)
{
    finish_code(file);
    return !file->program->is_deepened || karst_program_deepen(file->program, false);
}

/* Takes the program. */
static karst_world_file *wrap(karst_program_graph *program, bool ok, char **diagnostics, karst_error *error)
{
    if (diagnostics)
        *diagnostics = program ? join_diagnostics(program->diagnostics) : NULL;
    karst_world_file *file = ok ? calloc(1, sizeof *file) : NULL;
    if (!file) {
        if (ok)
            karst_fail(error, KARST_FAILED, "out of memory");
        karst_program_graph_destroy(program);
        return NULL;
    }
    file->program = program;
    if (!karst_take_model_materials(program, (const float[2][3]){PLAIN_STEEP, PLAIN_FLAT}, error)) {
        karst_world_file_destroy(file);
        return NULL;
    }
    karst_program_deepen(program, true); /* too large for it: flat air stays flat */
    look_around(file);
    if (complete(file, NULL) || (become_flat(file) && complete(file, error)))
        return file;
    karst_world_file_destroy(file);
    return NULL;
}

karst_world_file *karst_world_file_open(const char *path, const karst_parameter_value *given, size_t num_given,
                                        char **diagnostics, karst_error *error)
{
    bool ok;
    karst_program_graph *program = karst_language_compile_file(path, given, num_given, &ok, error);
    return wrap(program, ok, diagnostics, error);
}

karst_world_file *karst_world_file_compile(const char *name, const char *text, size_t length,
                                           const karst_parameter_value *given, size_t num_given, char **diagnostics,
                                           karst_error *error)
{
    bool ok;
    karst_program_graph *program = karst_language_compile(name, text, length, given, num_given, &ok, error);
    return wrap(program, ok, diagnostics, error);
}

void karst_world_file_destroy(karst_world_file *file)
{
    if (!file)
        return;
    finish_code(file);
    karst_program_graph_destroy(file->program);
    free(file);
}

/* ---- producing ---- */

void *karst_world_file_data(const karst_world_file *file, uint32_t seed, karst_error *error)
{
    karst_number *values = parameter_values(file);
    void *data = NULL;
    if (values)
        data = make_data(file, values, seed, error);
    else
        karst_fail(error, KARST_FAILED, "out of memory");
    free(values);
    return data;
}

void karst_world_file_free_data(const karst_world_file *file, void *data)
{
    karst_world_words_destroy(&file->layout, data, file->data_bytes);
}

void karst_world_file_program(const karst_world_file *file, const void *data,
                              char options[KARST_WORLD_FILE_OPTIONS_BYTES], karst_density_program *program)
{
    char tape_options[KARST_TAPE_OPTIONS_BYTES];
    karst_tape_options(&file->tape, tape_options, sizeof tape_options);
    char jumps[64] = "";
    if (file->smooths_jumps)
        snprintf(jumps, sizeof jumps, " -DWORLD_MAY_JUMP -DWORLD_VOXEL_LOG2_M=%d", file->info.voxel_log2_m);
    snprintf(options, KARST_WORLD_FILE_OPTIONS_BYTES, "-DWORLD_HAS_DATA%s%s%s %s",
             file->raises_thin ? " -DWORLD_MAY_BE_THIN" : "",
             file->raises_thin && file->fills_seams ? " -DWORLD_HAS_SEAMS" : "", jumps, tape_options);
    *program = (karst_density_program){
        .name = file->info.name,
        .source = file->code.source,
        .bounds_source = file->code.is_gradient_noise_alone ? bounds_source_of_gradient_noise : bounds_source,
        .options = options,
        .data = data,
        .data_bytes = file->data_bytes,
        .layout = &file->layout};
}

void karst_world_file_colour_options(const karst_world_file *file, char options[KARST_WORLD_FILE_OPTIONS_BYTES])
{
    char tape_options[KARST_TAPE_OPTIONS_BYTES] = "";
    if (file->code.is_colour_tape)
        karst_tape_options(&file->colour_tape, tape_options, sizeof tape_options);
    snprintf(options, KARST_WORLD_FILE_OPTIONS_BYTES, "-DWORLD_HAS_DATA %s", tape_options);
}

/* The density program of a build, borrowing data and options. */
static karst_density_program program_of(const karst_world_file *file, const karst_world_build *build, const void *data,
                                        char options[512])
{
    static const karst_world_build plain = {.shape = KARST_SHAPE_AUTO};
    char own[KARST_WORLD_FILE_OPTIONS_BYTES];
    karst_density_program program;
    build = build ? build : &plain;
    karst_world_file_program(file, data, own, &program);
    snprintf(options, 512, "%s%s%s", own, build->options ? " " : "", build->options ? build->options : "");
    program.options = options;
    program.finalise_options = build->finalise_options;
    program.shape = build->shape;
    program.in_two_steps = build->in_two_steps;
    program.start_on_host = build->start_on_host;
    program.tape_instructions = file->tape.num_instructions;
    program.soon_options = file->code.is_tape ? "-DTAPE_WORLD_WHOLE" : NULL;
    return program;
}

karst_producer *karst_world_file_producer_built(karst_context *context, const karst_world_file *file, uint32_t seed,
                                                uint32_t max_loads, const karst_world_build *build, karst_error *error)
{
    char options[512];
    void *data = karst_world_file_data(file, seed, error);
    karst_density_program program = program_of(file, build, data, options);
    program.max_loads = max_loads;
    karst_producer *producer = data ? karst_density_producer_create_program(context, &program, error) : NULL;
    karst_world_file_free_data(file, data);
    return producer;
}

karst_producer *karst_world_file_producer(karst_context *context, const karst_world_file *file, uint32_t seed,
                                          uint32_t max_loads, karst_error *error)
{
    return karst_world_file_producer_built(context, file, seed, max_loads, NULL, error);
}

bool karst_world_file_set_layers(karst_producer *producer, const karst_world_file *file, const karst_world_build *build,
                                 karst_layer *const *layers, size_t num_layers, const karst_colours *colours,
                                 karst_error *error)
{
    char options[512];
    karst_density_program program = program_of(file, build, NULL, options);
    return karst_density_producer_set_layers(producer, &program, layers, num_layers, colours, error);
}

bool karst_world_file_rehearse(karst_context *context, const karst_world_file *file, uint32_t seed,
                               const karst_world_build *build, const karst_cache_buffers *cache, const karst_work *work,
                               karst_error *error)
{
    char options[512];
    if (file->layout.has_mapped) /* it would take copies of files */
        return true;
    void *data = karst_world_file_data(file, seed, error);
    karst_density_program program = program_of(file, build, data, options);
    bool done = data && karst_density_program_rehearse(context, &program, cache, work, error);
    karst_world_file_free_data(file, data);
    return done;
}

static bool same_program(const karst_world_file *a, const karst_world_file *b)
{
    char a_options[KARST_WORLD_FILE_OPTIONS_BYTES], b_options[KARST_WORLD_FILE_OPTIONS_BYTES];
    karst_density_program a_program, b_program;
    karst_world_file_program(a, NULL, a_options, &a_program);
    karst_world_file_program(b, NULL, b_options, &b_program);
    return !strcmp(a_program.source, b_program.source) && !strcmp(a_program.bounds_source, b_program.bounds_source) &&
           !strcmp(a_options, b_options);
}

bool karst_world_file_convert(karst_producer *producer, const karst_world_file *from, const karst_world_file *to,
                              uint32_t seed, bool *is_same, karst_error *error)
{
    *is_same = same_program(from, to);
    if (!*is_same)
        return true;
    void *data = karst_world_file_data(to, seed, error);
    bool done =
        data && karst_density_producer_replace(producer, to->info.name, data, to->data_bytes, &to->layout, error);
    karst_world_file_free_data(to, data);
    return done;
}

bool karst_world_file_set_parameters(karst_producer *producer, const karst_world_file *file, const karst_number *values,
                                     uint32_t seed, karst_error *error)
{
    void *data = make_data(file, values, seed, error);
    bool done = data && karst_density_producer_set_data(producer, data, error);
    karst_world_file_free_data(file, data);
    return done;
}
