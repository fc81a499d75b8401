#include "core/export/piece_internal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- workers ---- */

karst_mesh_worker *karst_mesh_worker_create(const karst_world *world, const karst_mesh_config *config,
                                            karst_error *error)
{
    karst_mesh_worker *worker = malloc(sizeof *worker);
    if (!worker) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    worker->about = karst_world_get_metadata(world);
    worker->grid = (karst_grid){.corner = config->corner,
                                .cell_m = config->cell_m,
                                .footprint_m = config->footprint_m,
                                .voxel_log2_m = worker->about->voxel_log2_m};
    worker->segments = NULL;
    worker->positions = NULL;
    worker->densities = NULL;
    worker->gradients = NULL;
    worker->crossings = NULL;
    worker->num_crossings = worker->max_segments = worker->max_crossings = 0;
    worker->sampler = karst_sampler_create(world, error);
    if (worker->sampler &&
        (!config->num_edits || karst_sampler_set_edits(worker->sampler, config->edits, config->num_edits, error)))
        return worker;
    karst_mesh_worker_destroy(worker);
    return NULL;
}

void karst_mesh_worker_destroy(karst_mesh_worker *worker)
{
    if (!worker)
        return;
    karst_sampler_destroy(worker->sampler);
    free(worker->segments);
    free(worker->positions);
    free(worker->densities);
    free(worker->gradients);
    free(worker->crossings);
    free(worker);
}

/* ---- edges ---- */

static bool is_solid(const karst_mesh_worker *worker, int corner) { return worker->density[corner] > 0; }

/* Calls for each edge of the tile's cells that crosses the surface; returns how many there are. */
static size_t each_crossing(karst_mesh_worker *worker,
                            void (*take)(karst_mesh_worker *worker, size_t index, const int at[3], int axis))
{
    static const int up[3] = {1, KARST_TILE_CORNERS, KARST_TILE_CORNERS * KARST_TILE_CORNERS};
    const int *num = worker->tile->num_cells;
    size_t found = 0;
    for (int z = 0; z <= num[2]; z++)
        for (int y = 0; y <= num[1]; y++)
            for (int x = 0; x <= num[0]; x++) {
                const int at[3] = {x, y, z}, c = karst_tile_corner(x, y, z);
                if (worker->state[c] != CORNER_WANTED)
                    continue;
                for (int axis = 0; axis < 3; axis++)
                    if (at[axis] < num[axis] && is_solid(worker, c) != is_solid(worker, c + up[axis])) {
                        if (take)
                            take(worker, found, at, axis);
                        found++;
                    }
            }
    return found;
}

static void take_segment(karst_mesh_worker *worker, size_t index, const int at[3], int axis)
{
    static const int up[3] = {1, KARST_TILE_CORNERS, KARST_TILE_CORNERS * KARST_TILE_CORNERS};
    const int c = karst_tile_corner(at[0], at[1], at[2]);
    const bool below = is_solid(worker, c);
    karst_segment *s = &worker->segments[index];
    for (int i = 0; i < 3; i++)
        s->from[i] = s->to[i] = (double)(worker->tile->first[i] + at[i]);
    (below ? s->to : s->from)[axis] += 1;
    s->from_density = worker->density[below ? c : c + up[axis]];
    s->to_density = worker->density[below ? c + up[axis] : c];
    worker->crossing_of[axis][c] = (int32_t)index;
}

static void take_edge(karst_mesh_worker *worker, size_t index, const int at[3], int axis)
{
    karst_mesh_tile *tile = worker->tile;
    for (int i = 0; i < 3; i++)
        if (at[i] >= tile->num_cells[i] || tile->first[i] + at[i] == 0)
            return;
    karst_mesh_edge *edge = &tile->edges[tile->num_edges++];
    for (int i = 0; i < 3; i++)
        edge->at[i] = tile->first[i] + at[i];
    edge->axis = axis;
    edge->is_solid_below = is_solid(worker, karst_tile_corner(at[0], at[1], at[2]));
    edge->found = worker->crossings[index].at[axis] - (double)edge->at[axis];
}

static bool find_edges(karst_mesh_worker *worker, karst_error *error)
{
    karst_mesh_tile *tile = worker->tile;
    const size_t num = each_crossing(worker, NULL);
    worker->num_crossings = num;
    if (!karst_mesh_make_room(worker, num, error))
        return false;
    if (num > worker->max_crossings) {
        worker->max_crossings = 0;
        if (!karst_mesh_renew((void **)&worker->crossings, num, sizeof *worker->crossings))
            return karst_fail(error, KARST_FAILED, "out of memory");
        worker->max_crossings = num;
    }
    double(*normals)[3] = malloc((num + 1) * sizeof *normals);
    tile->edges = malloc((num + 1) * sizeof *tile->edges);
    if (!normals || !tile->edges) {
        free(normals);
        return karst_fail(error, KARST_FAILED, "out of memory");
    }
    each_crossing(worker, take_segment);
    karst_mesh_find_segments(worker, num, normals);
    for (size_t i = 0; i < num; i++) {
        memcpy(worker->crossings[i].at, worker->segments[i].found, sizeof worker->crossings[i].at);
        memcpy(worker->crossings[i].normal, normals[i], sizeof worker->crossings[i].normal);
    }
    each_crossing(worker, take_edge);
    free(normals);
    return true;
}

/* ---- cells ---- */

static unsigned solid_corners(const karst_mesh_worker *worker, int x, int y, int z)
{
    unsigned solid = 0;
    for (int i = 0; i < KARST_CELL_CORNERS; i++)
        solid |= (unsigned)is_solid(worker, karst_tile_corner(x + (i & 1), y + (i >> 1 & 1), z + (i >> 2))) << i;
    return solid;
}

static void middle_of_face(const karst_mesh_cell *cell, int face, double middle[3])
{
    for (int axis = 0; axis < 3; axis++)
        middle[axis] = (double)cell->at[axis] + 0.5;
    middle[face >> 1] = (double)(cell->at[face >> 1] + (face & 1));
}

/* How the centres of crossed faces are, one by one: there are few of them. */
static unsigned sample_centres(karst_mesh_worker *worker, const karst_mesh_cell *cell)
{
    unsigned solid_centres = 0;
    for (int face = 0; face < KARST_CELL_FACES; face++) {
        if (!karst_face_is_crossed(cell->solid, face))
            continue;
        double middle[3];
        middle_of_face(cell, face, middle);
        const karst_position at = karst_grid_at(&worker->grid, middle);
        float density;
        karst_sampler_densities(worker->sampler, &at, 1, worker->grid.footprint_m, &density);
        worker->tile->num_samples++;
        solid_centres |= (unsigned)(density > 0) << face;
    }
    return solid_centres;
}

/* Pieces get vertices if one of their edges is of this box. */
static void number_pieces(karst_mesh_tile *tile, karst_mesh_cell *cell)
{
    bool is_used[KARST_CELL_MAX_PIECES] = {false};
    for (int edge = 0; edge < KARST_CELL_EDGES; edge++) {
        int corners[2];
        karst_edge_corners(edge, corners);
        bool is_of_box = cell->piece_of[edge] >= 0;
        for (int axis = 0; axis < 3; axis++) {
            const int64_t at = cell->at[axis] + (corners[0] >> axis & 1);
            is_of_box = is_of_box && at > 0 && at < tile->grid_cells[axis];
        }
        if (is_of_box)
            is_used[cell->piece_of[edge]] = true;
    }
    cell->first_vertex = tile->num_vertices;
    for (int piece = 0; piece < cell->num_pieces; piece++)
        cell->vertex_of[piece] =
            is_used[piece] ? (signed char)(tile->num_vertices++ - cell->first_vertex) : (signed char)-1;
}

static bool find_cells(karst_mesh_worker *worker, karst_error *error)
{
    karst_mesh_tile *tile = worker->tile;
    /* A cell has three crossings at least, and each is of four cells at most. */
    size_t most = worker->num_crossings * 4 / 3 + 1;
    tile->cells = malloc(most * sizeof *tile->cells);
    if (!tile->cells)
        return karst_fail(error, KARST_FAILED, "out of memory");
    for (int z = 0; worker->num_crossings && z < tile->num_cells[2]; z++)
        for (int y = 0; y < tile->num_cells[1]; y++)
            for (int x = 0; x < tile->num_cells[0]; x++) {
                if (worker->state[karst_tile_corner(x, y, z)] != CORNER_WANTED)
                    continue;
                const unsigned solid = solid_corners(worker, x, y, z);
                if (solid == 0 || solid == 255)
                    continue;
                karst_mesh_cell *cell = &tile->cells[tile->num_found++];
                *cell = (karst_mesh_cell){.at = {tile->first[0] + x, tile->first[1] + y, tile->first[2] + z},
                                          .solid = (uint8_t)solid};
                cell->num_pieces =
                    (signed char)karst_cell_pieces(solid, sample_centres(worker, cell), cell->piece_of);
                number_pieces(tile, cell);
            }
    return true;
}

bool karst_mesh_fill_tile(karst_mesh_worker *worker, karst_mesh_tile *tile, karst_error *error)
{
    worker->tile = tile;
    karst_mesh_sample(worker);
    if (find_edges(worker, error) && find_cells(worker, error) && karst_mesh_place_vertices(worker, error))
        return true;
    karst_mesh_tile_finish(tile);
    return false;
}

void karst_mesh_tile_finish(karst_mesh_tile *tile)
{
    free(tile->vertices);
    free(tile->cells);
    free(tile->edges);
    free(tile->faces);
    *tile = (karst_mesh_tile){.num_vertices = 0};
}
