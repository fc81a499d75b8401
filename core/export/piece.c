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
    worker->grid =
        karst_grid_of(&config->corner, config->cell_m, config->footprint_m, worker->about->voxel_log2_m);
    karst_cell_table_fill(&worker->pieces);
    worker->segments = NULL;
    worker->positions = NULL;
    worker->densities = NULL;
    worker->gradients = NULL;
    worker->normals = NULL;
    worker->crossings = NULL;
    worker->seekers = NULL;
    worker->open_seekers = NULL;
    worker->vertices = NULL;
    worker->num_crossings = worker->max_segments = worker->max_crossings = worker->max_seekers = 0;
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
    free(worker->normals);
    free(worker->crossings);
    free(worker->seekers);
    free(worker->open_seekers);
    free(worker->vertices);
    free(worker);
}

/* ---- edges ---- */

static bool is_solid(const karst_mesh_worker *worker, int corner) { return worker->density[corner] > 0; }

static const int up[3] = {1, KARST_TILE_CORNERS, KARST_TILE_CORNERS *KARST_TILE_CORNERS};

/* Lists the edges of the tile's cells that cross the surface. */
static void list_crossings(karst_mesh_worker *worker)
{
    const int *num_cells = worker->tile->num_cells;
    size_t num = 0;
    for (int z = 0; z <= num_cells[2]; z++)
        for (int y = 0; y <= num_cells[1]; y++) {
            const int row = y + KARST_TILE_CORNERS * z;
            const uint64_t solid = worker->solid[row], wanted = worker->wanted[row];
            const uint64_t next[3] = {solid >> 1, y < num_cells[1] ? worker->solid[row + 1] : solid,
                                      z < num_cells[2] ? worker->solid[row + KARST_TILE_CORNERS] : solid};
            uint64_t crossed[3];
            for (int axis = 0; axis < 3; axis++)
                crossed[axis] = (solid ^ next[axis]) & wanted;
            crossed[0] &= karst_tile_bits(0, num_cells[0] - 1);
            for (uint64_t left = crossed[0] | crossed[1] | crossed[2]; left;) {
                const int x = karst_tile_next(&left);
                for (int axis = 0; axis < 3; axis++)
                    if (crossed[axis] >> x & 1)
                        worker->crossed[num++] = 3 * (uint32_t)(x + KARST_TILE_CORNERS * row) + (uint32_t)axis;
            }
        }
    worker->num_crossings = num;
}

static void take_segment(karst_mesh_worker *worker, size_t index)
{
    const int c = (int)(worker->crossed[index] / 3), axis = (int)(worker->crossed[index] % 3);
    const bool below = is_solid(worker, c);
    karst_segment *s = &worker->segments[index];
    int at[3];
    karst_tile_corner_at(c, at);
    for (int i = 0; i < 3; i++)
        s->from[i] = s->to[i] = (double)(worker->tile->first[i] + at[i]);
    (below ? s->to : s->from)[axis] += 1;
    s->from_density = worker->density[below ? c : c + up[axis]];
    s->to_density = worker->density[below ? c + up[axis] : c];
    worker->crossing_of[axis][c] = (int32_t)index;
}

static void take_edge(karst_mesh_worker *worker, size_t index)
{
    const int c = (int)(worker->crossed[index] / 3), axis = (int)(worker->crossed[index] % 3);
    karst_mesh_tile *tile = worker->tile;
    int at[3];
    karst_tile_corner_at(c, at);
    for (int i = 0; i < 3; i++)
        if (at[i] >= tile->num_cells[i] || tile->first[i] + at[i] == 0)
            return;
    karst_mesh_edge *edge = &tile->edges[tile->num_edges++];
    for (int i = 0; i < 3; i++)
        edge->at[i] = tile->first[i] + at[i];
    edge->axis = axis;
    edge->is_solid_below = is_solid(worker, c);
    edge->found = worker->crossings[index].at[axis] - (double)edge->at[axis];
}

static double slope_of(const float gradient[3])
{
    const double x = (double)gradient[0], y = (double)gradient[1], z = (double)gradient[2];
    const double slope = sqrt(x * x + y * y + z * z);
    return isfinite(slope) ? slope : 0;
}

static bool find_edges(karst_mesh_worker *worker, karst_error *error)
{
    karst_mesh_tile *tile = worker->tile;
    list_crossings(worker);
    const size_t num = worker->num_crossings;
    if (!karst_mesh_make_room(worker, num, error))
        return false;
    if (num > worker->max_crossings) {
        worker->max_crossings = 0;
        if (!karst_mesh_renew((void **)&worker->crossings, num, sizeof *worker->crossings))
            return karst_fail(error, KARST_FAILED, "out of memory");
        worker->max_crossings = num;
    }
    tile->edges = malloc((num + 1) * sizeof *tile->edges);
    if (!tile->edges)
        return karst_fail(error, KARST_FAILED, "out of memory");
    for (size_t i = 0; i < num; i++)
        take_segment(worker, i);
    karst_mesh_find_segments(worker, num);
    for (size_t i = 0; i < num; i++) {
        memcpy(worker->crossings[i].at, worker->segments[i].found, sizeof worker->crossings[i].at);
        memcpy(worker->crossings[i].normal, worker->normals[i], sizeof worker->crossings[i].normal);
        worker->crossings[i].slope = slope_of(worker->gradients[i]) * worker->grid.cell_m;
    }
    for (size_t i = 0; i < num; i++)
        take_edge(worker, i);
    return true;
}

/* ---- cells ---- */

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

/* Whether one of a piece's edges is of this box, of each piece. */
static void find_used(const karst_mesh_tile *tile, const karst_mesh_cell *cell, bool is_used[KARST_CELL_MAX_PIECES])
{
    for (int edge = 0; edge < KARST_CELL_EDGES; edge++) {
        const int lower = karst_edge_lower(edge);
        bool is_of_box = cell->piece_of[edge] >= 0;
        for (int axis = 0; axis < 3; axis++) {
            const int64_t at = cell->at[axis] + (lower >> axis & 1);
            is_of_box = is_of_box && at > 0 && at < tile->grid_cells[axis];
        }
        if (is_of_box)
            is_used[cell->piece_of[edge]] = true;
    }
}

/* Pieces get vertices if they are used. */
static void number_pieces(karst_mesh_tile *tile, karst_mesh_cell *cell)
{
    bool is_used[KARST_CELL_MAX_PIECES] = {false}, is_inside = true;
    for (int axis = 0; axis < 3; axis++)
        is_inside = is_inside && cell->at[axis] > 0 && cell->at[axis] + 1 < tile->grid_cells[axis];
    if (!is_inside)
        find_used(tile, cell, is_used);
    cell->first_vertex = tile->num_vertices;
    for (int piece = 0; piece < cell->num_pieces; piece++)
        cell->vertex_of[piece] = is_inside || is_used[piece] ? (signed char)(tile->num_vertices++ - cell->first_vertex)
                                                             : (signed char)-1;
}

static void add_cell(karst_mesh_worker *worker, int x, int y, int z, unsigned solid)
{
    karst_mesh_tile *tile = worker->tile;
    karst_mesh_cell *cell = &tile->cells[tile->num_found++];
    *cell = (karst_mesh_cell){.at = {tile->first[0] + x, tile->first[1] + y, tile->first[2] + z},
                              .solid = (uint8_t)solid,
                              .is_crossed = worker->pieces.of[solid].is_crossed,
                              .num_pieces = worker->pieces.of[solid].num_pieces};
    if (cell->is_crossed)
        cell->num_pieces = (signed char)karst_cell_pieces(solid, sample_centres(worker, cell), cell->piece_of);
    else
        memcpy(cell->piece_of, worker->pieces.of[solid].piece_of, sizeof cell->piece_of);
    number_pieces(tile, cell);
}

static bool find_cells(karst_mesh_worker *worker, karst_error *error)
{
    karst_mesh_tile *tile = worker->tile;
    /* A cell has three crossings at least, and each is of four cells at most. */
    const size_t most = worker->num_crossings * 4 / 3 + 1;
    const uint64_t cells = karst_tile_bits(0, tile->num_cells[0] - 1);
    tile->cells = malloc(most * sizeof *tile->cells);
    if (!tile->cells)
        return karst_fail(error, KARST_FAILED, "out of memory");
    for (int z = 0; z < tile->num_cells[2]; z++)
        for (int y = 0; y < tile->num_cells[1]; y++) {
            const int row = y + KARST_TILE_CORNERS * z;
            const uint64_t *low = &worker->solid[row], *high = low + KARST_TILE_CORNERS;
            const uint64_t any = low[0] | low[1] | high[0] | high[1], all = low[0] & low[1] & high[0] & high[1];
            for (uint64_t left = (any | any >> 1) & ~(all & all >> 1) & cells & worker->wanted[row]; left;) {
                const int x = karst_tile_next(&left);
                add_cell(worker, x, y, z,
                         (unsigned)((low[0] >> x & 3) | (low[1] >> x & 3) << 2 | (high[0] >> x & 3) << 4 |
                                    (high[1] >> x & 3) << 6));
            }
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
