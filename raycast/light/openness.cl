/* Entry point of bounds of openness: see raycast/light/openness.h. */
#include "raycast/light/openness_near.clh"

/* Steps that get on by less than this share of a voxel end: what is there is told apart by finer cells. */
#define LEAST_STEP 0.125f
#define MOST_STEPS 96
/* Voxels that are gained where samples are looked at one by one. */
#define SCANNED_STEP 0.5f
/* Behind the first place that may be matter, so many are looked at for matter that covers the whole cell. */
#define COVER_STEPS 12
#define COVER_GROWTH 1.25f /* of steps */
/* Nearer to the start than this rays may still be in the cell that they start in, voxels. */
#define START_CELLS 2.0f
/* Voxels that are looked at around a place; a node is 16 wide. */
#define MOST_REACH 12.0f
/* Of what a voxel may change: falling less is not told from the differences between bricks. */
#define LEAST_FALL 0.05f

#define STACK_CELLS (KARST_OPENNESS_AROUND * KARST_OPENNESS_UP + 3 * KARST_OPENNESS_DEPTH)

/* Directions: those whose angles to a middle one are below `wide`, in radians as chords have it. */
typedef struct {
    float4 middle, least, most; /* unit, world axes; the latter: of each component */
    float wide, wide_flat;      /* chords; the latter of what lies along the surface */
    float rise, least_rise, most_rise; /* along the normal */
} direction_cell;

/* The hemisphere about a surface's normal. */
typedef struct {
    float4 normal, a, b;
    K_GLOBAL const float *turns;
} hemisphere;

RAY_INLINE hemisphere hemisphere_of(float4 normal, K_GLOBAL const float *turns)
{
    hemisphere h;
    h.normal = normal;
    h.turns = turns;
    const float4 axis = k_fabs(normal.x) < 0.7f ? (float4)(1.0f, 0.0f, 0.0f, 0.0f) : (float4)(0.0f, 1.0f, 0.0f, 0.0f);
    const float4 side = axis - normal * dot_product(axis, normal);
    h.a = side * (1.0f / length_of(side));
    h.b = (float4)(normal.y * h.a.z - normal.z * h.a.y, normal.z * h.a.x - normal.x * h.a.z,
                   normal.x * h.a.y - normal.y * h.a.x, 0.0f);
    return h;
}

/* Cell (around, up) of a depth. */
RAY_INLINE direction_cell cell_of(const hemisphere *h, int depth, int around, int up)
{
    direction_cell c;
    const int half_part = KARST_OPENNESS_TURNS / (2 * KARST_OPENNESS_AROUND) >> depth;
    const float per_up = 1.0f / (float)(KARST_OPENNESS_UP << depth);
    const int turn = (2 * around + 1) * half_part;
    const float turn_x = h->turns[2 * turn], turn_y = h->turns[2 * turn + 1];
    const float half_x = h->turns[2 * half_part], half_y = h->turns[2 * half_part + 1];
    c.least_rise = k_sqrt((float)up * per_up);
    c.most_rise = k_sqrt((float)(up + 1) * per_up);
    c.rise = 0.5f * (c.least_rise + c.most_rise);
    const float flat = k_sqrt(k_fma(-c.rise, c.rise, 1.0f));
    c.middle = h->normal * c.rise + (h->a * turn_x + h->b * turn_y) * flat;
    c.wide = c.wide_flat = 0.0f;
    for (int end = 0; end < 2; end++) {
        const float rise = end ? c.most_rise : c.least_rise;
        const float edge = k_sqrt(k_max(k_fma(-rise, rise, 1.0f), 0.0f));
        const float u = k_fma(edge, half_x, -flat), v = edge * half_y, w = rise - c.rise;
        const float square = k_fma(u, u, v * v);
        c.wide_flat = k_max(c.wide_flat, k_sqrt(square));
        c.wide = k_max(c.wide, k_sqrt(k_fma(w, w, square)));
    }
    c.wide *= 1.00001f, c.wide_flat *= 1.00001f;
    c.least = c.middle - c.wide, c.most = c.middle + c.wide;
    return c;
}

/* How the field changes along the cell's directions, per voxel: the most there is within a box of slopes. */
RAY_INLINE float most_rise_of(const hemisphere *h, const direction_cell *c, const slope_box *box)
{
    const float4 middle = (box->least + box->most) * 0.5f, half_width = (box->most - box->least) * 0.5f;
    const float along = dot_product(middle, h->normal);
    const float4 flat = middle - h->normal * along;
    const float up = along > 0.0f ? along * (c->most_rise - c->rise) : along * (c->least_rise - c->rise);
    const float4 size = (float4)(k_min(k_max(k_fabs(c->least.x), k_fabs(c->most.x)), 1.0f),
                                 k_min(k_max(k_fabs(c->least.y), k_fabs(c->most.y)), 1.0f),
                                 k_min(k_max(k_fabs(c->least.z), k_fabs(c->most.z)), 1.0f), 0.0f);
    return dot_product(middle, c->middle) + up + length_of(flat) * c->wide_flat + dot_product(size, half_width);
}

/* Whether it falls along none of the cell's directions for sure, nor would along a part of them. */
RAY_INLINE int never_falls(const hemisphere *h, const direction_cell *c, const slope_box *box, float steep)
{
    const float4 middle = (box->least + box->most) * 0.5f, half_width = (box->most - box->least) * 0.5f;
    const float along = dot_product(middle, h->normal);
    const float down = k_min(along * (c->least_rise - c->rise), along * (c->most_rise - c->rise));
    const float flat = length_of(middle - h->normal * along) * c->wide_flat;
    const float4 none = (float4)(0.0f);
    const float4 inner = most4(most4(c->least, none - c->most), none); /* of each component's size, the least */
    return dot_product(middle, c->middle) + down - flat + dot_product(inner, half_width) > -LEAST_FALL * steep;
}

/* Which octants the cell's directions lie in: bit o. */
RAY_INLINE int octants_of(const direction_cell *c)
{
    int octants = 0;
    for (int o = 0; o < 8; o++)
        if ((o & 1 ? c->least.x <= 0.0f : c->most.x >= 0.0f) && (o & 2 ? c->least.y <= 0.0f : c->most.y >= 0.0f) &&
            (o & 4 ? c->least.z <= 0.0f : c->most.z >= 0.0f))
            octants |= 1 << o;
    return octants;
}

/* How far, in voxels of the level, rays of the cell that are at t are in air for sure, since the field falls from the
 * origin on; t: no farther. Rays that begin are taken to be in matter until it has fallen to air. */
LOOK_CALL float falls_to(const near_field *f, const hemisphere *h, const direction_cell *c, float t, int begins)
{
    const int octants = octants_of(c);
    if (!f->is_known)
        return t;
    for (int number = NEAR_BOXES - 1; number >= 0; number--) {
        slope_box box = {(float4)(ALL_FALLS), (float4)(-ALL_FALLS), ALL_FALLS, 1};
        const float end = (float)(1 << number) - CELL_MARGIN;
        if (end <= t)
            break;
        for (int octant = 0; octant < 8; octant++)
            if (octants >> octant & 1)
                join_box(&box, &f->boxes[octant][number]);
        if (!box.is_known)
            continue;
        if (box.least.x > box.most.x) /* nodes of air alone */
            return end;
        const float rise = most_rise_of(h, c, &box), margin = CELL_MARGIN * f->steep;
        if (!(rise < -LEAST_FALL * f->steep))
            continue;
        const int starts = begins && box.least_matter > k_max(f->value, 0.0f) + margin;
        if (starts || k_fma(rise, t, f->value) < -margin)
            return end;
    }
    return t;
}

/* Whether parts of a cell that does not get away from the surface will not, either. */
RAY_INLINE int is_stuck(const near_field *f, const hemisphere *h, const direction_cell *c)
{
    slope_box box = {(float4)(ALL_FALLS), (float4)(-ALL_FALLS), ALL_FALLS, 1};
    const int octants = octants_of(c);
    if (octants & (octants - 1)) /* parts lie in fewer */
        return 0;
    for (int octant = 0; octant < 8; octant++)
        if (octants >> octant & 1)
            join_box(&box, &f->boxes[octant][0]);
    return !box.is_known || (box.least.x <= box.most.x && never_falls(h, c, &box, f->steep));
}

RAY_INLINE int level_at(const lookout *w, float t, int level)
{
    while (level < w->view->top_level && t >= level_start(w, level + 1))
        level++;
    return level;
}

RAY_INLINE float level_end(const lookout *w, int level)
{
    return level < w->view->top_level ? k_min(level_start(w, level + 1), w->t_max) : w->t_max;
}

/* Through a large node of air, which is air at every level up to its own: as far as its faces allow. */
RAY_INLINE float leave_node(const lookout *w, const direction_cell *c, int level, float t, float4 at)
{
    const met_node m = find_node(w, level, node_of(at));
    const float voxel = level_voxel(level);
    if (m.state != KARST_STATE_AIR)
        return t;
    const float wide = level_voxel(m.level - level) * (float)KARST_BRICK_CELLS;
    const float4 place = place_in_cells(w, m.level, c->middle, t) * level_voxel(m.level - level);
    const float4 in = place - (float4)((float)m.at.x, (float)m.at.y, (float)m.at.z, 0.0f) * wide;
    const float4 out = (float4)(wide)-in;
    const float room = k_min(k_min(k_min(in.x, in.y), in.z), k_min(k_min(out.x, out.y), out.z));
    const float step = (room - CELL_MARGIN - c->wide * t / voxel) / (1.0f + c->wide);
    return step > 2.0f ? k_min(k_fma(step, voxel, t), level_end(w, m.level)) : t;
}

/* Whether somewhere from t on matter covers all of the cell. */
RAY_INLINE int is_covered(const lookout *w, const direction_cell *c, float t)
{
    int level = w->first_level;
    float step = 0.75f;
    for (int i = 0; i < COVER_STEPS && t < w->t_max; i++) {
        level = level_at(w, t, level);
        const float voxel = level_voxel(level), cells = t / voxel, across = k_fma(c->wide, cells, CELL_MARGIN);
        if (across > MOST_REACH)
            return 0;
        const clearance around = look_around(w, level, place_in_cells(w, level, c->middle, t), across + LEAST_STEP,
                                             across + CELL_MARGIN);
        if (around.matter > across && cells - across > START_CELLS)
            return 1;
        if (i && around.air > across) /* well in air again it is not told what follows */
            return 0;
        t = k_fma(k_max(across, step), voxel, t);
        step *= COVER_GROWTH;
    }
    return 0;
}

/* Goes along the cell's directions from *start on, until something may be in the way, which becomes *start. */
RAY_INLINE int look_along(const lookout *w, const near_field near[NEAR_LEVELS], const hemisphere *h,
                          const direction_cell *c, float *start)
{
    float t = *start;
    int level = w->first_level;
    for (int step = 0; step < MOST_STEPS; step++) {
        if (t >= w->t_max)
            return KARST_OPENNESS_OPEN;
        level = level_at(w, t, level);
        const float voxel = level_voxel(level), cells = t / voxel, end = level_end(w, level);
        const int from_first = level - w->first_level;
        if (from_first < NEAR_LEVELS && cells < (float)NEAR_CELLS) {
            const float next = falls_to(&near[from_first], h, c, cells, t <= 0.0f && from_first == 0);
            if (next > cells) {
                t = k_min(next * voxel, end);
                continue;
            }
        }
        const float4 at = place_in_cells(w, level, c->middle, t);
        const float left = leave_node(w, c, level, t, at);
        if (left > t) {
            t = left;
            continue;
        }
        const float across = k_fma(c->wide, cells, CELL_MARGIN);
        if (across > MOST_REACH)
            break;
        const clearance around = look_around(w, level, at, k_min(k_fma(3.0f, across, 2.0f), MOST_REACH),
                                             across + SCANNED_STEP);
        const float room = (around.air - across) / (1.0f + c->wide);
        if (!(room > LEAST_STEP))
            break;
        t = k_min(k_fma(room, voxel, t), end);
    }
    *start = t;
    return t >= w->t_max          ? KARST_OPENNESS_OPEN
           : is_covered(w, c, t) ? KARST_OPENNESS_HIDDEN
                                 : KARST_OPENNESS_UNDECIDED;
}

/* Says what was found of a cell to all of the finest ones that it holds. */
RAY_INLINE void tell_cell(K_GLOBAL uchar *cells, int depth, int around, int up, int found)
{
    const int finer = KARST_OPENNESS_DEPTH - depth, parts = 1 << finer;
    for (int a = around << finer; a < (around << finer) + parts; a++)
        for (int u = up << finer; u < (up << finer) + parts; u++)
            cells[a * KARST_OPENNESS_FINEST_UP + u] = (uchar)found;
}

/* Shares of what the surface looks up to that are open, and that are hidden, for sure. cells: of a pixel, or 0. */
RAY_INLINE float2 look_up(const lookout *w, const near_field near[NEAR_LEVELS], const hemisphere *h, int finest,
                          K_GLOBAL uchar *cells)
{
    int codes[STACK_CELLS]; /* depth | around << 4 | up << 16 */
    float starts[STACK_CELLS];
    float open = 0.0f, hidden = 0.0f;
    int num = 0;
    for (int around = 0; around < KARST_OPENNESS_AROUND; around++)
        for (int up = 0; up < KARST_OPENNESS_UP; up++) {
            codes[num] = around << 4 | up << 16;
            starts[num++] = 0.0f;
        }
    while (num) {
        const int code = codes[--num], depth = code & 15, around = code >> 4 & 0xfff, up = code >> 16;
        float start = starts[num];
        const float weight = 1.0f / (float)(KARST_OPENNESS_AROUND * KARST_OPENNESS_UP << 2 * depth);
        const direction_cell c = cell_of(h, depth, around, up);
        const int found = look_along(w, near, h, &c, &start);
        if (cells)
            tell_cell(cells, depth, around, up, found);
        if (found == KARST_OPENNESS_OPEN) {
            open += weight;
        } else if (found == KARST_OPENNESS_HIDDEN) {
            hidden += weight;
        } else if (depth < finest && (start > 0.0f || !is_stuck(&near[0], h, &c))) {
            for (int part = 0; part < 4; part++) {
                codes[num] = (depth + 1) | (2 * around + (part & 1)) << 4 | (2 * up + (part >> 1)) << 16;
                starts[num++] = start;
            }
        }
    }
    return (float2)(open, hidden);
}

/* Unit, of a pixel's ray: which pixel stands at a place of the packet order. */
RAY_INLINE float4 ray_in_order(const karst_pinhole *pinhole, uint order)
{
    const uint width = (uint)pinhole->width_px, height = (uint)pinhole->height_px;
    const uint strip = order / (KARST_PACKET_SIDE * width) * KARST_PACKET_SIDE;
    const uint rows = k_min(height - strip, (uint)KARST_PACKET_SIDE), in_strip = order - strip * width;
    const uint column = in_strip / (KARST_PACKET_SIDE * rows) * KARST_PACKET_SIDE;
    const uint columns = k_min(width - column, (uint)KARST_PACKET_SIDE), in_packet = in_strip - column * rows;
    const int x = (int)(column + in_packet % columns) + pinhole->x0_px,
              y = (int)(strip + in_packet / columns) + pinhole->y0_px;
    const float whole_width = (float)(pinhole->width_px + pinhole->more_width_px),
                whole_height = (float)(pinhole->height_px + pinhole->more_height_px);
    const float sx = k_fma((float)x + 0.5f, 2.0f / whole_width, -1.0f) * pinhole->half_width;
    const float sy = k_fma((float)y + 0.5f, -2.0f / whole_height, 1.0f) * pinhole->half_height;
    const float4 right = (float4)(pinhole->right[0], pinhole->right[1], pinhole->right[2], 0.0f),
                 up = (float4)(pinhole->up[0], pinhole->up[1], pinhole->up[2], 0.0f),
                 forward = (float4)(pinhole->forward[0], pinhole->forward[1], pinhole->forward[2], 0.0f);
    const float4 d = right * sx + up * sy + forward;
    return d * (1.0f / length_of(d));
}

/* Where a pixel's rays all around begin, and its own nodes. 0: nothing is known of it. */
RAY_INLINE int begin_lookout(lookout *w, const pools *pool, K_GLOBAL const karst_cast_view *view,
                             const karst_pinhole *pinhole, float cone, const karst_hit *hit, float4 ray)
{
    const float voxel = level_voxel((int)KARST_HIT_LEVEL(hit->kind));
    w->pool = pool;
    w->view = view;
    w->origin = ray * hit->t;
    w->shift = k_max(hit->t * pinhole->cone, voxel * (1.0001f / view->detail)) * view->detail;
    w->scale = 1.0f / (cone * view->detail);
    w->t_max = pinhole->t_max - hit->t;
    w->first_level = view->finest_level;
    w->first_level = level_at(w, 0.0f, w->first_level);
    return find_own_nodes(w);
}

/* The least and the most of what each pixel looks up to that is open. */
__kernel K_WIDE void openness_bounds(POOL_PARAMETERS, K_GLOBAL const karst_cast_view *view, karst_pinhole pinhole,
                                     karst_openness_task task, K_GLOBAL const float *turns,
                                     K_GLOBAL const karst_hit *hits, K_GLOBAL float *bounds, K_GLOBAL uchar *cells)
{
    const pools pool = POOL_FIELDS;
    const uint pixel = task.first_pixel + (uint)get_global_id(0);
    if (pixel >= task.end_pixel)
        return;
    const karst_hit hit = hits[pixel];
    const uint kind = KARST_HIT_KIND(hit.kind);
    const float4 normal = (float4)(hit.normal[0], hit.normal[1], hit.normal[2], 0.0f);
    float2 found = (float2)(kind == KARST_HIT_MISS ? 1.0f : 0.0f, 0.0f);
    lookout w;
    node_memo memo;
    for (int i = 0; i < MEMO_NODES; i++)
        memo.asked[i] = (int4)(0, 0, 0, KARST_MAX_LEVELS);
    w.memo = &memo;
    if (kind == KARST_HIT_SURFACE && dot_product(normal, normal) > 0.5f &&
        begin_lookout(&w, &pool, view, &pinhole, task.cone, &hit, ray_in_order(&pinhole, pixel))) {
        const hemisphere h = hemisphere_of(normal, turns);
        near_field near[NEAR_LEVELS];
        for (int i = 0; i < NEAR_LEVELS; i++) {
            const int level = w.first_level + i;
            near[i].is_known = 0;
            if (level <= view->top_level &&
                (i == 0 || level_start(&w, level) < (float)NEAR_CELLS * level_voxel(level)))
                look_near(&w, level, &near[i]);
        }
        if (near[0].is_known)
            found = look_up(&w, near, &h, task.depth,
                            task.tells_cells ? cells + (size_t)pixel * KARST_OPENNESS_CELLS : 0);
    }
    bounds[2 * pixel] = found.x;
    bounds[2 * pixel + 1] = 1.0f - found.y;
}
