#include "core/export/join.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/export/index_map.h"

typedef struct {
    karst_mesh_face face;
    uint32_t vertex[2]; /* its number, if it is in use */
    bool is_used[2];
} kept_face;

/* What a slab's tiles share with those that follow: cells at their upper sides, and crossed faces. */
typedef struct {
    karst_index_map cell_of, face_of;
    karst_mesh_cell *cells;
    kept_face *faces;
    size_t num_cells, max_cells, num_faces, max_faces;
} kept;

struct karst_mesh_join {
    karst_grid grid;
    const karst_mesh_sink *sink;
    karst_mesh_stats *stats;
    kept slabs[2]; /* this one, and that before */
    int32_t cell_at[KARST_TILE_NUM_CELLS]; /* of the tile, one more; 0: there is none, as between tiles */
    uint32_t (*triangles)[3];
    size_t num_triangles, max_triangles;
    double least[3], most[3];
};

/* ---- what is kept ---- */

static uint64_t key_of(const int64_t at[3], int axis)
{
    return (uint64_t)at[0] | (uint64_t)at[1] << 20 | (uint64_t)at[2] << 40 | (uint64_t)axis << 60;
}

static void drop(kept *k)
{
    karst_index_map_finish(&k->cell_of);
    karst_index_map_finish(&k->face_of);
    free(k->cells);
    free(k->faces);
}

static void empty(kept *k)
{
    karst_index_map_clear(&k->cell_of);
    karst_index_map_clear(&k->face_of);
    k->num_cells = k->num_faces = 0;
}

/* Room for one more element. */
static bool make_room(void **array, size_t num, size_t *max, size_t size_bytes)
{
    if (num < *max)
        return true;
    const size_t more = *max ? 2 * *max : 256;
    void *larger = more > *max && more <= SIZE_MAX / size_bytes ? realloc(*array, more * size_bytes) : NULL;
    if (!larger)
        return false;
    *array = larger;
    *max = more;
    return true;
}

static bool keep_cell(kept *k, const karst_mesh_cell *cell)
{
    if (!make_room((void **)&k->cells, k->num_cells, &k->max_cells, sizeof *k->cells) ||
        !karst_index_map_add(&k->cell_of, key_of(cell->at, 0), (uint32_t)k->num_cells))
        return false;
    k->cells[k->num_cells++] = *cell;
    return true;
}

static kept_face *find_face(karst_mesh_join *join, const int64_t at[3], int axis)
{
    for (int i = 0; i < 2; i++) {
        const uint32_t *index = karst_index_map_find(&join->slabs[i].face_of, key_of(at, axis));
        if (index)
            return &join->slabs[i].faces[*index];
    }
    return NULL;
}

static bool keep_face(karst_mesh_join *join, const karst_mesh_face *face)
{
    kept *k = &join->slabs[0];
    if (find_face(join, face->at, face->axis))
        return true;
    if (!make_room((void **)&k->faces, k->num_faces, &k->max_faces, sizeof *k->faces) ||
        !karst_index_map_add(&k->face_of, key_of(face->at, face->axis), (uint32_t)k->num_faces))
        return false;
    k->faces[k->num_faces++] = (kept_face){.face = *face};
    return true;
}

/* ---- making ---- */

karst_mesh_join *karst_mesh_join_create(const karst_grid *grid, const karst_mesh_sink *sink, karst_mesh_stats *stats,
                                        karst_error *error)
{
    karst_mesh_join *join = calloc(1, sizeof *join);
    if (!join) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    join->grid = *grid;
    join->sink = sink;
    join->stats = stats;
    for (int axis = 0; axis < 3; axis++) {
        join->least[axis] = (double)INFINITY;
        join->most[axis] = -(double)INFINITY;
    }
    return join;
}

void karst_mesh_join_destroy(karst_mesh_join *join)
{
    if (!join)
        return;
    drop(&join->slabs[0]);
    drop(&join->slabs[1]);
    free(join->triangles);
    free(join);
}

void karst_mesh_join_begin_slab(karst_mesh_join *join)
{
    const kept before = join->slabs[1];
    join->slabs[1] = join->slabs[0];
    join->slabs[0] = before;
    empty(&join->slabs[0]);
}

/* ---- vertices ---- */

static bool give_vertices(karst_mesh_join *join, const karst_mesh_vertex *vertices, size_t num, karst_error *error)
{
    if (join->stats->num_vertices + num > UINT32_MAX)
        return karst_fail(error, KARST_USAGE, "the mesh has more than 2^32 vertices: make it of several boxes, or of "
                                              "wider cells");
    for (size_t i = 0; i < num; i++)
        for (int axis = 0; axis < 3; axis++) {
            const double at = (double)vertices[i].position[axis];
            join->least[axis] = at < join->least[axis] ? at : join->least[axis];
            join->most[axis] = at > join->most[axis] ? at : join->most[axis];
        }
    join->stats->num_vertices += num;
    for (int axis = 0; axis < 3 && join->stats->num_vertices; axis++) {
        join->stats->least_m[axis] = join->least[axis];
        join->stats->box_m[axis] = join->most[axis] - join->least[axis];
    }
    return num == 0 || join->sink->vertices(join->sink->user, vertices, num, error);
}

static const karst_mesh_cell *find_cell(const karst_mesh_join *join, const karst_mesh_tile *tile, const int64_t at[3])
{
    int local[3];
    bool is_inside = true;
    for (int axis = 0; axis < 3; axis++) {
        is_inside = is_inside && at[axis] >= tile->first[axis];
        local[axis] = (int)(at[axis] - tile->first[axis]);
    }
    if (is_inside) {
        const int32_t index =
            join->cell_at[local[0] + KARST_TILE_CELLS * (local[1] + KARST_TILE_CELLS * local[2])];
        return index ? &tile->cells[index - 1] : NULL;
    }
    for (int i = 0; i < 2; i++) {
        const uint32_t *index = karst_index_map_find(&join->slabs[i].cell_of, key_of(at, 0));
        if (index)
            return &join->slabs[i].cells[*index];
    }
    return NULL;
}

/* ---- polygons ---- */

typedef struct {
    uint32_t vertex[2 * 4];
    int num, first_of_face; /* -1: no vertex of a face is among them */
    const float *position[4];
} polygon;

static bool is_one_piece(const karst_mesh_cell *cell, int face)
{
    for (int i = 1; i < 4; i++)
        if (cell->piece_of[karst_face_edge(face, i)] != cell->piece_of[karst_face_edge(face, 0)])
            return false;
    return true;
}

/* Where two pieces meet twice in a face, the edge between them would have four polygons: each pair gets its own, by
 * way of a vertex on the face. */
static bool add_face_vertex(karst_mesh_join *join, const karst_mesh_edge *edge, const karst_mesh_cell *from,
                            const karst_mesh_cell *to, polygon *p, karst_error *error)
{
    int axis = 0;
    if (!from->is_crossed)
        return true;
    while (from->at[axis] == to->at[axis])
        axis++;
    const bool is_up = to->at[axis] > from->at[axis];
    const int face_of_from = 2 * axis + is_up, face_of_to = 2 * axis + !is_up;
    if (!karst_face_is_crossed(from->solid, face_of_from) || !is_one_piece(from, face_of_from) ||
        !is_one_piece(to, face_of_to))
        return true;
    const int64_t *at = is_up ? to->at : from->at;
    kept_face *face = find_face(join, at, axis);
    if (!face)
        return karst_fail(error, KARST_FAILED, "a face between two tiles is of one alone: please report it");
    const int b = (edge->axis + 1) % 3, c = (edge->axis + 2) % 3;
    const int in_cell = 4 * edge->axis + (int)((edge->at[b] - at[b]) | (edge->at[c] - at[c]) << 1);
    int i = 0;
    while (karst_face_edge(2 * axis, i) != in_cell)
        i++;
    const int round = face->face.round, which = !(i == round || i == (round + 3) % 4);
    if (!face->is_used[which]) {
        face->vertex[which] = (uint32_t)join->stats->num_vertices;
        face->is_used[which] = true;
        if (!give_vertices(join, &face->face.vertex[which], 1, error))
            return false;
    }
    p->first_of_face = p->first_of_face < 0 ? p->num : p->first_of_face;
    p->vertex[p->num++] = face->vertex[which];
    return true;
}

/* How far from the crossing the triangles of a quad run that is cut from its corner `from` to the one across; infinite
 * if one is turned over. Corners go round the edge, in cells. */
static double error_of_cut(double corners[4][3], int from, double found)
{
    double error = (double)INFINITY;
    for (int half = 0; half < 2; half++) {
        const double *x = corners[from], *y = corners[(from + 1 + half) % 4], *z = corners[(from + 2 + half) % 4];
        const double to_x = y[1] * z[2] - y[2] * z[1], to_y = z[1] * x[2] - z[2] * x[1];
        const double to_z = x[1] * y[2] - x[2] * y[1], area = to_x + to_y + to_z;
        if (!(area > 0))
            return (double)INFINITY;
        if (to_x >= 0 && to_y >= 0 && to_z >= 0)
            error = fabs((to_x * x[0] + to_y * y[0] + to_z * z[0]) / area - found);
    }
    return error;
}

/* Whichever way brings the surface nearest to where it crosses the edge, which is known: so sharp edges are cut along,
 * not across. */
static int choose_cut(const karst_mesh_join *join, const karst_mesh_edge *edge, const polygon *p)
{
    double corners[4][3];
    for (int k = 0; k < 3; k++) {
        const int axis = edge->axis + k < 3 ? edge->axis + k : edge->axis + k - 3;
        const double from = karst_grid_metres(&join->grid, (double)edge->at[axis]) / join->grid.cell_m;
        for (int i = 0; i < 4; i++)
            corners[i][k] = (double)p->position[i][axis] / join->grid.cell_m - from;
    }
    return error_of_cut(corners, 0, edge->found) <= error_of_cut(corners, 1, edge->found) ? 0 : 1;
}

static bool add_triangles(karst_mesh_join *join, const polygon *p, int first, bool is_turned, karst_error *error)
{
    for (int i = 1; i < p->num - 1; i++) {
        if (!make_room((void **)&join->triangles, join->num_triangles, &join->max_triangles, sizeof *join->triangles))
            return karst_fail(error, KARST_FAILED, "out of memory");
        uint32_t *triangle = join->triangles[join->num_triangles++];
        triangle[0] = p->vertex[first];
        triangle[is_turned ? 2 : 1] = p->vertex[(first + i) % p->num];
        triangle[is_turned ? 1 : 2] = p->vertex[(first + i + 1) % p->num];
    }
    return true;
}

static bool add_polygon(karst_mesh_join *join, const karst_mesh_tile *tile, const karst_mesh_edge *edge,
                        karst_error *error)
{
    static const int around[4][2] = {{-1, -1}, {0, -1}, {0, 0}, {-1, 0}};
    const int b = (edge->axis + 1) % 3, c = (edge->axis + 2) % 3;
    const karst_mesh_cell *cells[4];
    for (int i = 0; i < 4; i++) {
        int64_t at[3] = {edge->at[0], edge->at[1], edge->at[2]};
        at[b] += around[i][0];
        at[c] += around[i][1];
        cells[i] = find_cell(join, tile, at);
        if (!cells[i])
            return karst_fail(error, KARST_FAILED, "a cell at an edge that crosses the surface is not known: please "
                                                   "report it");
    }
    polygon p = {.first_of_face = -1};
    for (int i = 0; i < 4; i++) {
        const int piece = cells[i]->piece_of[4 * edge->axis + (-around[i][0] | -around[i][1] << 1)];
        p.position[i] = cells[i]->position[piece];
        p.vertex[p.num++] = (uint32_t)(cells[i]->first_vertex + (uint64_t)cells[i]->vertex_of[piece]);
        if (!add_face_vertex(join, edge, cells[i], cells[(i + 1) % 4], &p, error))
            return false;
    }
    const int first = p.first_of_face >= 0 ? p.first_of_face : choose_cut(join, edge, &p);
    return add_triangles(join, &p, first, !edge->is_solid_below, error);
}

/* ---- tiles ---- */

static int32_t *place_of(karst_mesh_join *join, const karst_mesh_tile *tile, const int64_t at[3])
{
    return &join->cell_at[(at[0] - tile->first[0]) +
                          KARST_TILE_CELLS * ((at[1] - tile->first[1]) + KARST_TILE_CELLS * (at[2] - tile->first[2]))];
}

static bool take_cells(karst_mesh_join *join, karst_mesh_tile *tile, uint64_t base)
{
    for (size_t i = 0; i < tile->num_found; i++) {
        karst_mesh_cell *cell = &tile->cells[i];
        bool is_last = false;
        for (int axis = 0; axis < 3; axis++)
            is_last = is_last || cell->at[axis] - tile->first[axis] == tile->num_cells[axis] - 1;
        cell->first_vertex += base;
        *place_of(join, tile, cell->at) = (int32_t)i + 1;
        if (is_last && !keep_cell(&join->slabs[0], cell))
            return false;
    }
    for (size_t i = 0; i < tile->num_faces; i++)
        if (!keep_face(join, &tile->faces[i]))
            return false;
    return true;
}

bool karst_mesh_join_add(karst_mesh_join *join, karst_mesh_tile *tile, karst_error *error)
{
    const uint64_t base = join->stats->num_vertices;
    join->num_triangles = 0;
    if (!give_vertices(join, tile->vertices, tile->num_vertices, error))
        return false;
    if (!take_cells(join, tile, base))
        return karst_fail(error, KARST_FAILED, "out of memory");
    for (size_t i = 0; i < tile->num_edges; i++)
        if (!add_polygon(join, tile, &tile->edges[i], error))
            return false;
    for (size_t i = 0; i < tile->num_found; i++)
        *place_of(join, tile, tile->cells[i].at) = 0;
    join->stats->num_triangles += join->num_triangles;
    return join->num_triangles == 0 ||
           join->sink->triangles(join->sink->user, (const uint32_t(*)[3])join->triangles, join->num_triangles, error);
}
