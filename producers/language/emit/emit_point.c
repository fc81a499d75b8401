/* The point form: world_point and world_colour. */
#include "producers/language/emit/emit_internal.h"

#include <string.h>

/* All that is marked. */
static void marked_lines(karst_emit *emit)
{
    for (karst_expr e = 1; e < emit->graph->num_nodes; e++)
        if (emit->nodes[e].needs)
            karst_emit_lines(emit, e);
}

static uint32_t lines_of(karst_emit *emit, const karst_expr *roots, size_t num_roots)
{
    uint32_t count = karst_emit_mark(emit, roots, num_roots);
    karst_emit_begin_block(emit, (karst_block){.is_point = true});
    marked_lines(emit);
    return count;
}

static const char begin[] = "    affine_position at;\n"
                            "    K_UNROLL\n"
                            "    for (int i = 0; i < 3; i++) {\n"
                            "        at.voxel[i] = place->voxel[i];\n"
                            "        at.fraction[i] = place->fraction[i];\n"
                            "    }\n";

void karst_emit_points(karst_emit *emit, karst_emitted *emitted)
{
    const karst_resolved_world *world = &emit->layout->world;
    karst_text *text = &emit->text;
    karst_text_add(text,
                   "K_INLINE K_WIDE vfloat world_point(world_data data, const world_point_at *place, int level)\n{\n%s",
                   begin);
    emitted->num_point_ops = lines_of(emit, &world->density, 1);
    karst_text_add(text, "    return %s;\n}\n\n", karst_emit_operand(emit, world->density).text);
}

void karst_emit_surfaces(karst_emit *emit)
{
    const karst_resolved_world *world = &emit->layout->world;
    const karst_expr roots[4] = {world->density, world->gradient[0], world->gradient[1], world->gradient[2]};
    karst_text *text = &emit->text;
    karst_text_add(text,
                   "K_INLINE K_WIDE vfloat world_surface(world_data data, const world_point_at *place, int level, "
                   "vfloat gradient[3])\n{\n%s",
                   begin);
    lines_of(emit, roots, 4);
    for (int i = 0; i < 3; i++)
        karst_text_add(text, "    gradient[%d] = %s;\n", i, karst_emit_operand(emit, world->gradient[i]).text);
    karst_text_add(text, "    return %s;\n}\n\n", karst_emit_operand(emit, world->density).text);
}

void karst_emit_colours(karst_emit *emit, karst_emitted *emitted)
{
    const karst_resolved_world *world = &emit->layout->world;
    karst_text *text = &emit->text;
    emitted->num_colour_ops = karst_emit_mark(emit, world->colour, 3);
    karst_emit_near_octaves(emit);
    karst_text_add(text,
                   "K_INLINE K_WIDE void world_colour(world_data data, const world_near_at *near, __local const "
                   "near_octave *octaves,\n                                  const world_point_at *place, int level, "
                   "vfloat nx, vfloat ny, vfloat nz,\n                                  vfloat *red, vfloat *green, "
                   "vfloat *blue)\n{\n%s",
                   begin);
    const size_t body = text->length;
    karst_emit_begin_block(emit, (karst_block){.is_point = true, .is_near = true});
    /* What a packet does not need is left out, though then infinite numbers in it do not come through. */
    if (!karst_emit_choice_lines(emit, world->colour, 3))
        marked_lines(emit);
    static const char *const names[] = {"red", "green", "blue"};
    for (int i = 0; i < 3; i++)
        karst_text_add(text, "    *%s = %s;\n", names[i], karst_emit_operand(emit, world->colour[i]).text);
    /* What is not near takes the exact place as first argument. */
    const bool takes_places = !text->failed && strstr(text->bytes + body, "(&at,");
    karst_text_add(text, "}\n#define WORLD_COLOUR_TAKES_PLACES %d\n\n", takes_places);
}
