/* Where vertices lie: first where the planes of a piece meet, then on the true surface near that, in the same cell. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/export/feature.h"
#include "core/export/piece_internal.h"

/* Vertices keep so far from their cell's faces, in cells: so no two of them are the same. */
#define MARGIN 0.001
#define APART 0.001
/* A sharp edge that a cell's crossings tell of may pass just outside: then the vertex goes there, so far at most. */
#define OUTSIDE 0.5
#define FACE_MARGIN 0.01 /* of the way from a face's corner to its centre */
/* How far along the normal the surface is looked for, in cells: first a little beyond where the slope says it is; then
 * between the ends of the piece's edges, moved towards the cell's middle by a quarter and ever less. */
static const double reach[] = {0, 0.03, 0.15, 0.5, 1.0};
enum { NUM_REACHES = sizeof reach / sizeof *reach, NUM_MOVES = 9 };
#define BEYOND_SHARE 1.1
#define BEYOND (0.4 * KARST_CROSSING_WITHIN)

typedef struct karst_mesh_seeker {
    const karst_mesh_cell *cell;
    signed char edges[KARST_CELL_EDGES];
    int num_edges, attempt; /* attempt 0: at `place`; then the reaches; then edges and moves */
    double place[3], direction[3], mean_normal[3];
    double slack; /* how far outside the cell it may lie */
    double slope, first_reach; /* the density's in a cell's width, 0: not known; in place of reach[0] */
    float density; /* at the last place looked at along the normal */
    double last[3];
    double at[2][3]; /* that are looked at now */
    int num_at;
    bool is_sharp, is_done;
    karst_segment segment;
} seeker;

static int corner_of_edge(const karst_mesh_cell *cell, int edge, bool solid)
{
    int corners[2];
    karst_edge_corners(edge, corners);
    return ((cell->solid >> corners[0] & 1) != 0) == solid ? corners[0] : corners[1];
}

/* A cell's lowest corner in the tile. */
static int lowest_corner(const karst_mesh_worker *worker, const karst_mesh_cell *cell)
{
    const int64_t *first = worker->tile->first;
    return karst_tile_corner((int)(cell->at[0] - first[0]), (int)(cell->at[1] - first[1]),
                             (int)(cell->at[2] - first[2]));
}

static const karst_mesh_crossing *crossing_at(const karst_mesh_worker *worker, int lowest, int edge)
{
    const int lower = karst_edge_lower(edge);
    const int corner = lowest + karst_tile_corner(lower & 1, lower >> 1 & 1, lower >> 2);
    return &worker->crossings[worker->crossing_of[edge >> 2][corner]];
}

/* Of a piece without gradients: from the solid corners to those of air. */
static void normal_of_signs(const karst_mesh_cell *cell, double normal[3])
{
    double square = 0;
    for (int axis = 0; axis < 3; axis++) {
        int sum = 0;
        for (int i = 0; i < KARST_CELL_CORNERS; i++)
            sum += ((i >> axis & 1) != 0) == ((cell->solid >> i & 1) != 0) ? -1 : 1;
        normal[axis] = sum;
        square += normal[axis] * normal[axis];
    }
    if (square == 0)
        normal[1] = square = 1;
    for (int axis = 0; axis < 3; axis++)
        normal[axis] /= sqrt(square);
}

static double clamp(double x, double least, double most)
{
    const double above = x > least ? x : least;
    return above < most ? above : most;
}
static double clamp_to_cell(double x) { return clamp(x, MARGIN, 1 - MARGIN); }

static bool is_within(const double place[3], double least, double most)
{
    return place[0] >= least && place[0] <= most && place[1] >= least && place[1] <= most && place[2] >= least &&
           place[2] <= most;
}

/* A corner that lies in another cell is that cell's, so that no two vertices are the same: there the nearest edge is
 * taken. */
static void choose_place(const karst_feature *feature, double place[3], double *slack)
{
    int num = feature->num_moves;
    karst_feature_place(feature, num, place);
    *slack = 0;
    if (num == 3 && !is_within(place, MARGIN, 1 - MARGIN))
        karst_feature_place(feature, num = 2, place);
    if (feature->is_bent && num == 2 && is_within(place, -OUTSIDE, 1 + OUTSIDE)) {
        *slack = OUTSIDE;
        return;
    }
    for (int axis = 0; axis < 3; axis++)
        place[axis] = clamp_to_cell(place[axis]);
}

static void begin(const karst_mesh_worker *worker, const karst_mesh_cell *cell, int piece, seeker *s)
{
    double points[KARST_CELL_EDGES][3], normals[KARST_CELL_EDGES][3], place[3];
    karst_feature feature;
    const int lowest = lowest_corner(worker, cell);
    *s = (seeker){.cell = cell};
    for (int edge = 0; edge < KARST_CELL_EDGES; edge++) {
        if (cell->piece_of[edge] != piece)
            continue;
        const karst_mesh_crossing *crossing = crossing_at(worker, lowest, edge);
        for (int axis = 0; axis < 3; axis++) {
            points[s->num_edges][axis] = crossing->at[axis] - (double)cell->at[axis];
            normals[s->num_edges][axis] = crossing->normal[axis];
        }
        s->slope += crossing->slope;
        s->edges[s->num_edges++] = (signed char)edge;
    }
    s->slope /= s->num_edges;
    karst_find_feature((const double(*)[3])points, (const double(*)[3])normals, s->num_edges, &feature);
    choose_place(&feature, place, &s->slack);
    s->is_sharp = feature.is_bent;
    memcpy(s->mean_normal, feature.mean_normal, sizeof s->mean_normal);
    if (s->mean_normal[0] == 0 && s->mean_normal[1] == 0 && s->mean_normal[2] == 0)
        normal_of_signs(cell, s->mean_normal);
    for (int axis = 0; axis < 3; axis++)
        s->place[axis] = (double)cell->at[axis] + place[axis];
}

/* How far a ray from a place stays where the piece's vertex may lie. */
static double way_out(const seeker *s)
{
    double way = 2;
    for (int axis = 0; axis < 3; axis++) {
        const double at = s->place[axis] - (double)s->cell->at[axis], d = s->direction[axis];
        const double out = ((d > 0 ? 1 - MARGIN + s->slack : MARGIN - s->slack) - at) / d;
        if (fabs(d) > 1e-12 && out < way)
            way = out;
    }
    return way > 0 ? way : 0;
}

/* The places that an attempt looks at: one along the normal, or two on a moved edge, solid first. */
static int choose_places(seeker *s)
{
    double(*at)[3] = s->at;
    if (s->attempt <= NUM_REACHES) {
        const double farthest = s->attempt == 1 ? s->first_reach : s->attempt ? reach[s->attempt - 1] : 0;
        const double most = s->attempt ? way_out(s) : 0, way = farthest < most ? farthest : most;
        for (int axis = 0; axis < 3; axis++)
            at[0][axis] = s->place[axis] + way * s->direction[axis];
        return 1;
    }
    const int attempt = s->attempt - NUM_REACHES - 1, edge = s->edges[attempt % s->num_edges];
    const double move = ldexp(0.25, -(attempt / s->num_edges));
    for (int end = 0; end < 2; end++) {
        const int corner = corner_of_edge(s->cell, edge, end == 0);
        for (int axis = 0; axis < 3; axis++) {
            const double from = corner >> axis & 1;
            at[end][axis] = (double)s->cell->at[axis] + from + move * (0.5 - from);
        }
    }
    return 2;
}

static void set_segment(seeker *s, const double solid[3], const double air[3], float density, float air_density)
{
    s->segment.from_density = density;
    s->segment.to_density = air_density;
    memcpy(s->segment.from, solid, sizeof s->segment.from);
    memcpy(s->segment.to, air, sizeof s->segment.to);
    s->is_done = true;
}

/* When no attempt helped: at a crossing, as far inside as the margin asks. */
static void give_in(const karst_mesh_worker *worker, seeker *s)
{
    const karst_mesh_crossing *crossing = crossing_at(worker, lowest_corner(worker, s->cell), s->edges[0]);
    double at[3];
    for (int axis = 0; axis < 3; axis++)
        at[axis] = (double)s->cell->at[axis] + clamp_to_cell(crossing->at[axis] - (double)s->cell->at[axis]);
    set_segment(s, at, at, 1, 0);
}

static void learn(const karst_mesh_worker *worker, seeker *s, const float *density)
{
    const double(*at)[3] = (const double(*)[3])s->at;
    if (s->attempt == 0) {
        for (int axis = 0; axis < 3; axis++)
            s->direction[axis] = density[0] > 0 ? s->mean_normal[axis] : -s->mean_normal[axis];
        s->first_reach = BEYOND_SHARE * fabs((double)density[0]) / s->slope + BEYOND;
        s->attempt = s->first_reach < reach[1] ? 0 : 1; /* and one more below */
    } else if (s->attempt <= NUM_REACHES) {
        if ((density[0] > 0) != (s->density > 0)) {
            const bool out = s->density > 0;
            set_segment(s, out ? s->last : at[0], out ? at[0] : s->last, out ? s->density : density[0],
                        out ? density[0] : s->density);
            return;
        }
    } else if (density[0] > 0 && !(density[1] > 0)) {
        set_segment(s, at[0], at[1], density[0], density[1]);
        return;
    }
    if (s->attempt <= NUM_REACHES) {
        s->density = density[0];
        memcpy(s->last, at[0], sizeof s->last);
    }
    s->attempt++;
    if (s->attempt > NUM_REACHES + NUM_MOVES * s->num_edges)
        give_in(worker, s);
}

/* Until each has a segment from solid to air, or has given in. */
static void seek(karst_mesh_worker *worker, size_t num)
{
    seeker *seekers = worker->seekers;
    uint32_t *open = worker->open_seekers;
    size_t num_open = 0;
    for (size_t i = 0; i < num; i++)
        if (!seekers[i].is_done)
            open[num_open++] = (uint32_t)i;
    while (num_open) {
        size_t num_places = 0, left = 0;
        for (size_t k = 0; k < num_open; k++) {
            seeker *s = &seekers[open[k]];
            s->num_at = choose_places(s);
            for (int i = 0; i < s->num_at; i++)
                karst_grid_place(&worker->grid, s->at[i], &worker->positions[num_places++]);
        }
        karst_sampler_densities(worker->sampler, worker->positions, num_places, worker->grid.footprint_m,
                                worker->densities);
        worker->tile->num_samples += num_places;
        num_places = 0;
        for (size_t k = 0; k < num_open; k++) {
            seeker *s = &seekers[open[k]];
            learn(worker, s, worker->densities + num_places);
            num_places += (size_t)s->num_at;
            if (!s->is_done)
                open[left++] = open[k];
        }
        num_open = left;
    }
}

static bool is_near(const double a[3], const double b[3])
{
    double square = 0;
    for (int axis = 0; axis < 3; axis++)
        square += (a[axis] - b[axis]) * (a[axis] - b[axis]);
    return square < APART * APART;
}

/* Pieces of one cell that came to the same place look for others, beside their own edges. */
static bool part(karst_mesh_worker *worker, size_t num)
{
    seeker *seekers = worker->seekers;
    bool any = false;
    for (size_t i = 1; i < num; i++)
        for (size_t j = i; j-- > 0 && seekers[j].cell == seekers[i].cell;)
            if (is_near(worker->segments[i].found, worker->segments[j].found)) {
                seekers[i].attempt = NUM_REACHES + 1;
                seekers[i].is_done = false;
                any = true;
                break;
            }
    return any;
}

/* ---- vertices ---- */

static void to_metres(const karst_mesh_worker *worker, const double found[3], float position[3])
{
    for (int axis = 0; axis < 3; axis++)
        position[axis] = (float)karst_grid_metres(&worker->grid, found[axis]);
}

static void colour(karst_mesh_worker *worker, const double at[3], karst_mesh_vertex *vertex)
{
    karst_sample rgb[3];
    bool has_colour = worker->about->has_colour;
    if (has_colour) {
        const karst_position position = karst_grid_at(&worker->grid, at);
        has_colour = karst_sampler_colour(worker->sampler, &position, vertex->normal, worker->grid.footprint_m, rgb);
    }
    for (int i = 0; i < 3; i++) {
        const float value = has_colour ? rgb[i].device : 0.5f;
        vertex->rgb[i] = value >= 0 ? fminf(value, 1) : 0; /* also of a NaN */
    }
}

/* From segments that were found. */
static void make_vertices(karst_mesh_worker *worker, size_t num)
{
    const seeker *seekers = worker->seekers;
    karst_mesh_vertex *const *vertices = worker->vertices;
    for (size_t i = 0; i < num; i++) {
        const double *normal = worker->normals[i];
        const bool is_known = normal[0] != 0 || normal[1] != 0 || normal[2] != 0;
        if (seekers[i].is_sharp || !is_known)
            normal = seekers[i].mean_normal;
        for (int axis = 0; axis < 3; axis++)
            vertices[i]->normal[axis] = (float)normal[axis];
        to_metres(worker, worker->segments[i].found, vertices[i]->position);
        colour(worker, worker->segments[i].found, vertices[i]);
    }
}

/* Vertices of the pieces of all cells. */
static void place_pieces(karst_mesh_worker *worker)
{
    karst_mesh_tile *tile = worker->tile;
    seeker *seekers = worker->seekers;
    size_t num = 0;
    for (size_t i = 0; i < tile->num_found; i++)
        for (int piece = 0; piece < tile->cells[i].num_pieces; piece++)
            if (tile->cells[i].vertex_of[piece] >= 0)
                begin(worker, &tile->cells[i], piece, &seekers[num++]);
    for (int pass = 0; pass < 2; pass++) {
        seek(worker, num);
        for (size_t i = 0; i < num; i++)
            worker->segments[i] = seekers[i].segment;
        karst_mesh_find_segments(worker, num);
        if (!part(worker, num))
            break;
    }
    for (size_t i = 0; i < num; i++) {
        worker->vertices[i] = &tile->vertices[i];
        tile->num_sharp += seekers[i].is_sharp;
    }
    make_vertices(worker, num);
    for (size_t i = 0; i < tile->num_found; i++) {
        karst_mesh_cell *cell = &tile->cells[i];
        for (int piece = 0; piece < cell->num_pieces; piece++) {
            const size_t vertex = (size_t)cell->first_vertex + (size_t)cell->vertex_of[piece];
            if (cell->vertex_of[piece] >= 0)
                memcpy(cell->position[piece], tile->vertices[vertex].position, sizeof cell->position[piece]);
        }
    }
}

/* ---- crossed faces ---- */

/* Each once: as a lower face, or at the tile's upper end as an upper one. */
static bool is_of_cell(const karst_mesh_tile *tile, const karst_mesh_cell *cell, int face)
{
    const int axis = face >> 1;
    return karst_face_is_crossed(cell->solid, face) &&
           (!(face & 1) || cell->at[axis] - tile->first[axis] == tile->num_cells[axis] - 1);
}

/* The surface on a face lies between its centre and each of the corners that are not as the centre is. */
static void add_face(karst_mesh_worker *worker, const karst_mesh_cell *cell, int face, seeker *seekers)
{
    karst_mesh_tile *tile = worker->tile;
    karst_mesh_face *to = &tile->faces[tile->num_faces++];
    const int axis = face >> 1;
    double middle[3], corners[2][3];
    float densities[3];
    for (int i = 0; i < 3; i++) {
        to->at[i] = cell->at[i];
        middle[i] = (double)cell->at[i] + 0.5;
    }
    to->axis = axis;
    to->at[axis] += face & 1;
    middle[axis] = (double)to->at[axis];
    karst_position positions[3] = {karst_grid_at(&worker->grid, middle)};
    karst_sampler_densities(worker->sampler, positions, 1, worker->grid.footprint_m, densities);
    const bool centre = densities[0] > 0;
    to->round = ((cell->solid >> karst_face_corner(face, 0) & 1) != 0) == centre;
    for (int i = 0; i < 2; i++) {
        const int corner = karst_face_corner(face, to->round + 2 * i);
        for (int k = 0; k < 3; k++)
            corners[i][k] = (double)(cell->at[k] + (corner >> k & 1));
        positions[1 + i] = karst_grid_at(&worker->grid, corners[i]);
    }
    karst_sampler_densities(worker->sampler, positions + 1, 2, worker->grid.footprint_m, densities + 1);
    worker->tile->num_samples += 3;
    for (int i = 0; i < 2; i++) {
        seekers[i] = (seeker){.cell = cell};
        normal_of_signs(cell, seekers[i].mean_normal);
        set_segment(&seekers[i], centre ? middle : corners[i], centre ? corners[i] : middle,
                    densities[centre ? 0 : 1 + i], densities[centre ? 1 + i : 0]);
    }
}

/* Vertices of faces that share a corner, or a centre, are not the same. */
static void keep_apart(karst_segment *s)
{
    for (int axis = 0; axis < 3; axis++) {
        const double way = s->to[axis] - s->from[axis];
        const double share = way != 0 ? (s->found[axis] - s->from[axis]) / way : 0;
        s->found[axis] = s->from[axis] + way * fmin(fmax(share, FACE_MARGIN), 1 - FACE_MARGIN);
    }
}

static void place_faces(karst_mesh_worker *worker)
{
    karst_mesh_tile *tile = worker->tile;
    seeker *seekers = worker->seekers;
    for (size_t i = 0; i < tile->num_found; i++)
        for (int face = 0; face < KARST_CELL_FACES && tile->cells[i].is_crossed; face++)
            if (is_of_cell(tile, &tile->cells[i], face))
                add_face(worker, &tile->cells[i], face, &seekers[2 * tile->num_faces]);
    for (size_t i = 0; i < 2 * tile->num_faces; i++) {
        worker->segments[i] = seekers[i].segment;
        worker->vertices[i] = &tile->faces[i / 2].vertex[i % 2];
    }
    karst_mesh_find_segments(worker, 2 * tile->num_faces);
    for (size_t i = 0; i < 2 * tile->num_faces; i++)
        keep_apart(&worker->segments[i]);
    make_vertices(worker, 2 * tile->num_faces);
}

static bool make_room(karst_mesh_worker *worker, size_t num, karst_error *error)
{
    if (num > worker->max_seekers) {
        worker->max_seekers = 0;
        if (!karst_mesh_renew((void **)&worker->seekers, num, sizeof *worker->seekers) ||
            !karst_mesh_renew((void **)&worker->open_seekers, num, sizeof *worker->open_seekers) ||
            !karst_mesh_renew((void **)&worker->vertices, num, sizeof *worker->vertices))
            return karst_fail(error, KARST_FAILED, "out of memory");
        worker->max_seekers = num;
    }
    /* Attempts on edges look at two places. */
    return karst_mesh_make_room(worker, 2 * num, error);
}

bool karst_mesh_place_vertices(karst_mesh_worker *worker, karst_error *error)
{
    karst_mesh_tile *tile = worker->tile;
    size_t num_faces = 0;
    for (size_t i = 0; i < tile->num_found; i++)
        for (int face = 0; face < KARST_CELL_FACES && tile->cells[i].is_crossed; face++)
            num_faces += is_of_cell(tile, &tile->cells[i], face);
    tile->vertices = malloc((tile->num_vertices + 1) * sizeof *tile->vertices);
    tile->faces = malloc((num_faces + 1) * sizeof *tile->faces);
    if (!tile->vertices || !tile->faces)
        return karst_fail(error, KARST_FAILED, "out of memory");
    if (!make_room(worker, tile->num_vertices > 2 * num_faces ? tile->num_vertices : 2 * num_faces, error))
        return false;
    place_pieces(worker);
    place_faces(worker);
    return true;
}
