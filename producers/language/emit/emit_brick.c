/* The brick form: each node in the block of the axes that it depends on.
 *
 * world_prepare runs the blocks of no axis, x, y, z and xy; world_plane, once for each z, those of xz and yz; world_row
 * the rest. A value that a block of more axes reads is kept in world_axes:
 *     none   bv12                 x   xv12[c]      y, z   yv12[c] (read one by one in blocks along x)
 *     xy     xyv12[iy][c]         xz  xzv12[c]     yz     yzv12[c] (likewise)
 * and so h and l, the halves of a pair; and the places of arguments on one axis, which take divisions: yc34[c], of data
 * word 34.
 * Kept along x are the EMIT_ROW_VECTORS vectors of a row, along y and z the EMIT_SIDE_VECTORS of a side. */
#include <stdio.h>

#include "producers/language/emit/emit_internal.h"

enum { X = KARST_DEPENDS_X, Y = KARST_DEPENDS_Y, Z = KARST_DEPENDS_Z };

static bool in_block(const karst_emit *emit, karst_expr e, uint8_t axes)
{
    return emit->nodes[e].needs && emit->nodes[e].axes == axes;
}

/* True if the place of a node in another block is this block's. */
static bool has_place_in(const karst_emit *emit, karst_expr e, uint8_t axes)
{
    return emit->nodes[e].needs && emit->nodes[e].axes != axes && axes && karst_emit_place_axis(emit, e) == axes;
}

static bool any_in_block(const karst_emit *emit, uint8_t axes)
{
    for (karst_expr e = 1; e < emit->graph->num_nodes; e++)
        if (in_block(emit, e, axes) || has_place_in(emit, e, axes))
            return true;
    return false;
}

/* The letters of what is kept of a node. */
static const char *parts_kept(const karst_emit *emit, karst_expr e)
{
    static const char *const letters[4] = {"", "v", "hl", "vhl"};
    return letters[emit->nodes[e].keeps];
}

/* The nodes of a block, and what it keeps. */
static void lines(karst_emit *emit, uint8_t axes)
{
    const char *index = axes == 0 ? "" : axes == (X | Y) ? "[iy][c]" : "[c]";
    karst_emit_begin_block(emit, (karst_block){.axes = axes});
    for (karst_expr e = 1; e < emit->graph->num_nodes; e++) {
        uint32_t word = emit->layout->word[e];
        if (!has_place_in(emit, e, axes) || emit->placed[word] == emit->serial)
            continue;
        karst_emit_declare_place(emit, e);
        karst_text_add(&emit->text, "    axes->%sc%u%s = c%u;\n", karst_emit_axes_name(axes), word, index, word);
    }
    for (karst_expr e = 1; e < emit->graph->num_nodes; e++) {
        if (!in_block(emit, e, axes))
            continue;
        karst_emit_lines(emit, e);
        const char *parts = parts_kept(emit, e);
        for (size_t i = 0; parts[i]; i++)
            karst_text_add(&emit->text, "    axes->%s%c%u%s = %c%u;\n", karst_emit_axes_name(axes), parts[i], e, index,
                           parts[i], e);
    }
}

/* A block within prepare or plane: a loop over the vectors along its first axis. */
static void block(karst_emit *emit, uint8_t axes)
{
    karst_text *text = &emit->text;
    if (!any_in_block(emit, axes))
        return;
    if (axes == (X | Y))
        karst_text_add(text, "    for (int iy = 0; iy < KARST_BRICK_SIDE; iy++)\n");
    if (axes)
        karst_text_add(text, "    for (int c = 0; c < %s; c++) {\n    const vint lane = (vint)(c * LANES) + V_LANE;\n",
                       axes & X ? "EMIT_ROW_VECTORS" : "EMIT_SIDE_VECTORS");
    else
        karst_text_add(text, "    {\n    const vint lane = (vint)(0);\n");
    karst_text_add(text, "    const affine_position at = emit_samples(axes->origin, axes->level, %s, %s, %s);\n",
                   axes & X ? "lane" : "(vint)(0)",
                   !(axes & Y) ? "(vint)(0)"
                   : axes & X  ? "(vint)(iy)"
                               : "lane",
                   !(axes & Z)      ? "(vint)(0)"
                   : axes & (X | Y) ? "(vint)(iz)"
                                    : "lane");
    lines(emit, axes);
    karst_text_add(text, "    }\n");
}

static uint32_t num_octaves(const karst_emit *emit, karst_expr e)
{
    return emit->graph->noises[emit->graph->nodes[e].extra].num_octaves;
}

static uint8_t shape_of(const karst_emit *emit, karst_expr e)
{
    return emit->graph->noises[emit->graph->nodes[e].extra].shape;
}

/* Noises, but not images, whose places are computed one by one. */
static bool steps_along_bricks(const karst_emit *emit, karst_expr e)
{
    return emit->graph->nodes[e].op == KARST_OP_NOISE && !emit->graph->noises[emit->graph->nodes[e].extra].image;
}

static void declare_axes(karst_emit *emit)
{
    karst_text *text = &emit->text;
    karst_text_add(text, "typedef struct {\n    world_data data;\n    long origin[3];\n    int level, plane;\n");
    for (karst_expr e = 1; e < emit->graph->num_nodes; e++) {
        const karst_emit_node *node = &emit->nodes[e];
        const char *name = karst_emit_axes_name(node->axes);
        if (node->needs && steps_along_bricks(emit, e))
            karst_text_add(text, "    emit_octave n%u[%u];\n", e, num_octaves(emit, e));
        if (node->is_tensor)
            karst_text_add(text, "#ifdef EMIT_HOISTED\n    vfloat s%u[EMIT_TENSOR_SUMS];\n#endif\n", e);
        if (node->is_table)
            karst_text_add(text, "#ifdef EMIT_HOISTED\n    noise_worley_brick w%u[%u];\n#endif\n", e,
                           num_octaves(emit, e));
        if (node->has_gradients)
            karst_text_add(text, "#ifdef EMIT_HAS_TABLES\n    noise_table g%u[%u];\n#endif\n", e, num_octaves(emit, e));
        if (node->has_rows)
            karst_text_add(text,
                           "#ifdef EMIT_HAS_TABLES\n    noise_table_rows l%u[%u];\n"
                           "    vfloat r%u[KARST_BRICK_SIDE];\n#endif\n",
                           e, num_octaves(emit, e), e);
        const char *size = !node->axes             ? ""
                           : node->axes == (X | Y) ? "[KARST_BRICK_SIDE][EMIT_ROW_VECTORS]"
                           : node->axes & X        ? "[EMIT_ROW_VECTORS]"
                                                   : "[EMIT_SIDE_VECTORS]";
        const char *parts = parts_kept(emit, e);
        for (size_t i = 0; parts[i]; i++)
            karst_text_add(text, "    %s %s%c%u%s;\n", karst_emit_type(emit, e), name, parts[i], e, size);
    }
    karst_emit_begin_block(emit, (karst_block){.axes = 0});
    for (karst_expr e = 1; e < emit->graph->num_nodes; e++) {
        uint8_t axis = karst_emit_place_axis(emit, e);
        if (has_place_in(emit, e, axis) && karst_emit_is_new_place(emit, e))
            karst_text_add(text, "    %s %sc%u[%s];\n", karst_emit_place_type(emit, e), karst_emit_axes_name(axis),
                           emit->layout->word[e], axis == X ? "EMIT_ROW_VECTORS" : "EMIT_SIDE_VECTORS");
    }
    karst_text_add(text, "} world_axes;\n\n");
}

/* The sums of a tensor's octaves, for all rows of a brick and its face. An octave goes through all planes before the
 * next begins: so one tensor and the sums stay in the nearest cache, and branches repeat. Octaves that are folded are
 * made apart first. */
static void tensor_sums(karst_emit *emit, karst_expr e)
{
    karst_text *text = &emit->text;
    const char *shape = karst_emit_shape_name(shape_of(emit, e));
    char mean[32];
    snprintf(mean, sizeof mean, "octave_mean(%u, %u)", KARST_NOISE_GRADIENT, shape_of(emit, e));
    karst_text_add(text,
                   "#ifdef EMIT_HOISTED\n    for (int k = 0; k < %u; k++) {\n"
                   "        const octave_weight weight = axes->n%u[k].weight;\n"
                   "        if (weight.weight == 0.0f) {\n"
                   "            emit_tensor_zero(k == 0, EMIT_TENSOR_SUMS, axes->s%u);\n"
                   "            for (int i = 0; i < EMIT_TENSOR_SUMS; i++)\n"
                   "                axes->s%u[i] = octave_faded_%s(%s, &weight, axes->s%u[i]);\n"
                   "            continue;\n        }\n",
                   num_octaves(emit, e), e, e, e, shape, mean, e);
    if (shape_of(emit, e) == KARST_NOISE_SUM)
        karst_text_add(text,
                       "        emit_tensor_add(&axes->n%u[k], weight.amplitude * weight.weight, k == 0, axes->s%u);\n"
                       "    }\n#endif\n",
                       e, e);
    else
        karst_text_add(text,
                       "        vfloat one[EMIT_TENSOR_SUMS];\n"
                       "        emit_tensor_add(&axes->n%u[k], 1.0f, 1, one);\n"
                       "        for (int i = 0; i < EMIT_TENSOR_SUMS; i++)\n"
                       "            axes->s%u[i] = octave_%s(one[i], %s, &weight, k ? axes->s%u[i] : (vfloat)(0.0f));\n"
                       "    }\n#endif\n",
                       e, e, shape, mean, e);
}

static void prepare(karst_emit *emit)
{
    karst_text *text = &emit->text;
    karst_text_add(
        text,
        "K_INLINE K_WIDE void world_prepare(world_data data, world_axes *axes, long x, long y, long z, int level)\n"
        "{\n    axes->data = data;\n    axes->origin[0] = x;\n    axes->origin[1] = y;\n"
        "    axes->origin[2] = z;\n    axes->level = level;\n    axes->plane = -1;\n");
    for (karst_expr e = 1; e < emit->graph->num_nodes; e++)
        if (emit->nodes[e].needs && steps_along_bricks(emit, e))
            karst_text_add(text,
                           "    for (int k = 0; k < %u; k++)\n"
                           "        axes->n%u[k] = emit_octave_at(EMIT_OCTAVE(data, %u) + k, axes->origin, level);\n",
                           num_octaves(emit, e), e, emit->layout->word[e]);
    for (karst_expr e = 1; e < emit->graph->num_nodes; e++)
        if (emit->nodes[e].is_tensor)
            tensor_sums(emit, e);
    for (karst_expr e = 1; e < emit->graph->num_nodes; e++)
        if (emit->nodes[e].is_table)
            karst_text_add(text,
                           "#ifdef EMIT_HOISTED\n    for (int k = 0; k < %u; k++)\n"
                           "        emit_worley_prepare(&axes->w%u[k], &axes->n%u[k]);\n#endif\n",
                           num_octaves(emit, e), e, e);
    for (karst_expr e = 1; e < emit->graph->num_nodes; e++)
        if (emit->nodes[e].has_gradients)
            karst_text_add(text,
                           "#ifdef EMIT_HAS_TABLES\n    for (int k = 0; k < %u; k++)\n"
                           "        axes->g%u[k].is_made = 0;\n#endif\n",
                           num_octaves(emit, e), e);
    for (karst_expr e = 1; e < emit->graph->num_nodes; e++)
        if (emit->nodes[e].has_rows)
            karst_text_add(text,
                           "#ifdef EMIT_HAS_TABLES\n    for (int k = 0; k < %u; k++)\n"
                           "        emit_table_rows_at(&axes->l%u[k], &axes->n%u[k], %d);\n#endif\n",
                           num_octaves(emit, e), e, e, shape_of(emit, e) == KARST_NOISE_SUM);
    block(emit, 0);
    block(emit, X);
    block(emit, Y);
    block(emit, Z);
    block(emit, X | Y);
    karst_text_add(text, "}\n\n");
}

/* Marks what the value of a node is made of in a block of all axes; false if that is more than is worth making twice.
 */
static bool gather(karst_emit *emit, karst_expr e, uint32_t *room)
{
    karst_emit_node *node = &emit->nodes[e];
    karst_emit_input inputs[KARST_MAX_INPUTS];
    if (node->axes != KARST_AXES || node->is_gathered)
        return true;
    if (*room == 0 || (emit->graph->nodes[e].op == KARST_OP_NOISE && !node->is_tensor))
        return false;
    --*room;
    node->is_gathered = 1;
    size_t count = karst_emit_inputs(emit, e, inputs);
    for (size_t i = 0; i < count; i++)
        if (!gather(emit, inputs[i].e, room))
            return false;
    return true;
}

/* The same of what moves a noise along x and z. */
#define MAX_GATHERED 24u
static bool gather_movements(karst_emit *emit, karst_expr noise)
{
    uint32_t room = MAX_GATHERED;
    for (karst_expr e = 1; e < emit->graph->num_nodes; e++)
        emit->nodes[e].is_gathered = 0;
    for (int i = 0; i < 3; i++) {
        karst_expr by = karst_noise_moved_by(emit->graph, emit->graph->nodes[noise].arg[i]);
        if (by && !gather(emit, by, &room))
            return false;
    }
    return true;
}

static karst_operand movement(const karst_emit *emit, karst_expr noise, int i)
{
    karst_expr by = karst_noise_moved_by(emit->graph, emit->graph->nodes[noise].arg[i]);
    return by ? karst_emit_operand(emit, by) : (karst_operand){"(vfloat)(0.0f)"};
}

/* A bent noise in all rows of a plane: first by how much it is bent there, then octave by octave. */
static void rows_sums(karst_emit *emit, karst_expr e)
{
    karst_text *text = &emit->text;
    const char *shape = karst_emit_shape_name(shape_of(emit, e));
    char mean[32];
    snprintf(mean, sizeof mean, "octave_mean(%u, %u)", KARST_NOISE_GRADIENT, shape_of(emit, e));
    gather_movements(emit, e);
    karst_text_add(text, "#ifdef EMIT_HAS_TABLES\n    {\n    noise_table_bend bend;\n    bend.far = (vint)(0);\n"
                         "    for (int iy = 0; iy < KARST_BRICK_SIDE; iy++) {\n    const vint lane = V_LANE;\n"
                         "    const int c = 0;\n    (void)c;\n"
                         "    const affine_position at = emit_samples(axes->origin, axes->level, lane, (vint)(iy), "
                         "(vint)(iz));\n");
    karst_emit_begin_block(emit, (karst_block){.axes = KARST_AXES});
    for (karst_expr i = 1; i < emit->graph->num_nodes; i++)
        if (emit->nodes[i].is_gathered)
            karst_emit_lines(emit, i);
    karst_text_add(text, "    noise_table_bend_row(&bend, iy, %s, %s);\n    axes->r%u[iy] = (vfloat)(0.0f);\n    }\n",
                   movement(emit, e, 0).text, movement(emit, e, 2).text, e);
    karst_text_add(text,
                   "    for (int k = 0; k < %u; k++) {\n        const octave_weight weight = axes->n%u[k].weight;\n"
                   "        if (weight.weight == 0.0f) {\n            for (int i = 0; i < KARST_BRICK_SIDE; i++)\n"
                   "                axes->r%u[i] = octave_faded_%s(%s, &weight, axes->r%u[i]);\n"
                   "            continue;\n        }\n",
                   num_octaves(emit, e), e, e, shape, mean, e);
    if (shape_of(emit, e) == KARST_NOISE_SUM)
        karst_text_add(text, "        noise_table_plane(&axes->g%u[k], &axes->l%u[k], iz, &bend, axes->r%u);\n", e, e,
                       e);
    else
        karst_text_add(text,
                       "        vfloat one[KARST_BRICK_SIDE];\n        for (int i = 0; i < KARST_BRICK_SIDE; i++)\n"
                       "            one[i] = (vfloat)(0.0f);\n"
                       "        noise_table_plane(&axes->g%u[k], &axes->l%u[k], iz, &bend, one);\n"
                       "        for (int i = 0; i < KARST_BRICK_SIDE; i++)\n"
                       "            axes->r%u[i] = octave_%s(one[i], %s, &weight, axes->r%u[i]);\n",
                       e, e, e, shape, mean, e);
    karst_text_add(text, "    }\n    }\n#endif\n");
}

static void plane(karst_emit *emit)
{
    karst_text_add(&emit->text, "K_INLINE K_WIDE void world_plane(world_axes *axes, int iz)\n{\n"
                                "    world_data data = axes->data;\n    axes->plane = iz;\n    (void)data;\n");
    block(emit, X | Z);
    block(emit, Y | Z);
    for (karst_expr e = 1; e < emit->graph->num_nodes; e++)
        if (emit->nodes[e].has_rows)
            rows_sums(emit, e);
    karst_text_add(&emit->text, "}\n\n");
}

static void row(karst_emit *emit)
{
    karst_text *text = &emit->text;
    karst_text_add(
        text,
        "K_INLINE K_WIDE vfloat world_row(world_axes *axes, int ix, int iy, int iz)\n{\n"
        "    world_data data = axes->data;\n    const vint lane = (vint)(ix) + V_LANE;\n"
        "    const int c = ix / LANES;\n    (void)data;\n    (void)c;\n"
        "    if (axes->plane != iz)\n        world_plane(axes, iz);\n"
        "    const affine_position at = emit_samples(axes->origin, axes->level, lane, (vint)(iy), (vint)(iz));\n");
    lines(emit, KARST_AXES);
    karst_text_add(text, "    return %s;\n}\n\n",
                   karst_emit_operand(emit, emit->layout->world.root[KARST_ROOT_DENSITY]).text);
}

/* Samples of the face (ix is KARST_BRICK_CELLS): all nodes, but noise steps along the brick, and what lies along y or z
 * is there, as tensors are. */
static void sample(karst_emit *emit)
{
    const char *floats = karst_emit_face_in_rows(emit) ? "ROW_FLOATS" : "FLOATS";
    if (karst_emit_face_in_rows(emit))
        karst_text_add(&emit->text, "#ifdef EMIT_HOISTED\n#define WORLD_FACE_IN_ROWS\n#endif\n");
    karst_text_add(&emit->text,
                   "K_INLINE K_WIDE vfloat world_sample(world_axes *axes, vint ix, vint iy, vint iz)\n{\n"
                   "    world_data data = axes->data;\n    (void)data;\n"
                   "    const affine_position at = emit_samples(axes->origin, axes->level, ix, iy, iz);\n");
    karst_emit_begin_block(emit, (karst_block){.is_sample = true});
    for (karst_expr e = 1; e < emit->graph->num_nodes; e++) {
        uint8_t axes = emit->nodes[e].axes;
        const char *parts = parts_kept(emit, e);
        if (emit->nodes[e].needs && axes != Y && axes != Z)
            karst_emit_lines(emit, e);
        else if (emit->nodes[e].needs)
            for (size_t i = 0; parts[i]; i++)
                karst_text_add(&emit->text, "    const %s %c%u = EMIT_%s(axes->%s%c%u, i%s);\n",
                               karst_emit_type(emit, e), parts[i], e,
                               emit->graph->nodes[e].type == KARST_TYPE_FLOAT ? floats : "INTS",
                               karst_emit_axes_name(axes), parts[i], e, karst_emit_axes_name(axes));
    }
    karst_text_add(&emit->text, "    return %s;\n}\n\n",
                   karst_emit_operand(emit, emit->layout->world.root[KARST_ROOT_DENSITY]).text);
}

/* The first noises that may be tensors, for as long as there is room. */
static void mark_tensors(karst_emit *emit)
{
    uint32_t room = KARST_EMIT_MAX_TENSORS, num_noises = 0;
    for (karst_expr e = 1; e < emit->graph->num_nodes && num_noises < KARST_EMIT_MAX_TENSOR_NOISES; e++) {
        if (!emit->nodes[e].needs || emit->graph->nodes[e].op != KARST_OP_NOISE || !karst_emit_may_be_tensor(emit, e) ||
            num_octaves(emit, e) > room)
            continue;
        emit->nodes[e].is_tensor = 1;
        num_noises++;
        room -= num_octaves(emit, e);
    }
}

/* The same for tables of Worley's noise: 32 KiB an octave. */
static void mark_tables(karst_emit *emit)
{
    uint32_t room = KARST_EMIT_MAX_TABLES;
    for (karst_expr e = 1; e < emit->graph->num_nodes; e++) {
        bool is_first = !emit->nodes[e].partner || emit->nodes[e].partner > e;
        if (!emit->nodes[e].needs || !is_first || !karst_emit_is_worley(emit, e) ||
            !karst_emit_has_bricks_axes(emit, e) || num_octaves(emit, e) > room)
            continue;
        emit->nodes[e].is_table = 1;
        room -= num_octaves(emit, e);
    }
}

/* The same for gradients in tables, of what is bent. */
static void mark_gradients(karst_emit *emit)
{
    uint32_t room = KARST_EMIT_MAX_GRADIENTS, rows_room = KARST_EMIT_MAX_ROWS;
    for (karst_expr e = 1; e < emit->graph->num_nodes; e++) {
        if (!emit->nodes[e].needs || emit->graph->nodes[e].op != KARST_OP_NOISE || emit->nodes[e].axes != KARST_AXES ||
            emit->nodes[e].is_tensor || !karst_emit_is_gradient(emit, e) || num_octaves(emit, e) > room)
            continue;
        emit->nodes[e].has_gradients = 1;
        emit->nodes[e].has_rows =
            num_octaves(emit, e) <= rows_room && karst_emit_has_level_rows(emit, e) && gather_movements(emit, e);
        room -= num_octaves(emit, e);
        rows_room -= emit->nodes[e].has_rows ? num_octaves(emit, e) : 0;
    }
}

/* Marks what blocks hand on; returns how many values of xy that is. */
static uint32_t mark_kept(karst_emit *emit, karst_expr root)
{
    uint32_t num_xy = 0;
    for (karst_expr e = 1; e < emit->graph->num_nodes; e++)
        emit->nodes[e].keeps = 0;
    for (karst_expr e = 1; e < emit->graph->num_nodes; e++) {
        karst_emit_input inputs[KARST_MAX_INPUTS];
        size_t count = emit->nodes[e].needs ? karst_emit_inputs(emit, e, inputs) : 0;
        for (size_t i = 0; i < count; i++) {
            karst_emit_node *input = &emit->nodes[inputs[i].e];
            if (input->axes == emit->nodes[e].axes)
                continue;
            num_xy += !input->keeps && input->axes == (X | Y);
            input->keeps |= inputs[i].part;
        }
    }
    if (emit->nodes[root].axes != KARST_AXES)
        emit->nodes[root].keeps |= emit->nodes[root].needs;
    return num_xy;
}

/* Values of xy take a table of a whole face of the brick each: with more than this many they go to the rows instead. */
#define MAX_XY_KEPT 128u

void karst_emit_bricks(karst_emit *emit, karst_emitted *emitted)
{
    karst_expr root = emit->layout->world.root[KARST_ROOT_DENSITY];
    karst_emit_mark(emit, &root, 1);
    if (mark_kept(emit, root) > MAX_XY_KEPT) {
        for (karst_expr e = 1; e < emit->graph->num_nodes; e++)
            if (emit->nodes[e].axes == (X | Y))
                emit->nodes[e].axes = KARST_AXES;
        mark_kept(emit, root);
    }
    for (karst_expr e = 1; e < emit->graph->num_nodes; e++)
        if (emit->nodes[e].needs)
            emitted->num_ops[emit->nodes[e].axes]++;
    mark_tensors(emit);
    mark_tables(emit);
    mark_gradients(emit);
    declare_axes(emit);
    prepare(emit);
    plane(emit);
    row(emit);
    sample(emit);
}
