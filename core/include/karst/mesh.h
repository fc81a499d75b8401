/* Surfaces as triangles: what a box of a world holds, for programs that draw or print meshes.
 *
 * The box is cut into cells. Cells that bounds prove to be all solid or all air are never looked at. In the others the
 * surface is found by dual contouring (Ju, Losasso, Schaefer and Warren 2002): where it crosses the edges of cells the
 * exact gradient is taken, and each piece of surface in a cell becomes one vertex, where these planes meet best; so
 * sharp edges stay sharp. A piece is what a cycle of marching cubes would be (Nielson 2004), faces with two solid
 * corners that lie across are decided by the density at their centre, and where two pieces would share an edge twice it
 * is parted by a vertex more: so the mesh is watertight and manifold everywhere but at the box's faces, where it ends.
 * Each vertex is then moved to the true surface. No device is used. */
#ifndef KARST_MESH_H
#define KARST_MESH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "karst/edit.h"
#include "karst/error.h"
#include "karst/position.h"
#include "karst/world.h"

#ifdef __cplusplus
extern "C" {
#endif

#define KARST_MESH_MAX_CELLS 1000000 /* along an axis */

/* Zero-initialised fields mean the default that stands beside them. */
typedef struct {
    /* The box: its lower corner, in the world's level-0 voxels, and how many cells there are along each axis (x, y up,
     * z), 1 to KARST_MESH_MAX_CELLS. */
    karst_position corner;
    int64_t num_cells[3];
    double cell_m;      /* how wide a cell is; above 0, finite */
    double footprint_m; /* metres: without finer detail, as in karst/world.h; 0: all detail there is; not below 0 */
    const karst_edit *edits; /* borrowed during the call, in the world's voxels; NULL: none */
    size_t num_edits;
    int num_threads; /* 0: one for each core; to 256. The mesh does not depend on it */
} karst_mesh_config;

typedef struct {
    float position[3]; /* metres from the box's corner */
    /* Of length 1, towards the air: the density's exact gradient there; on a sharp edge the mean of the sides. */
    float normal[3];
    float rgb[3]; /* albedo, linear; of a world without colours 0.5 */
} karst_mesh_vertex;

typedef struct {
    uint64_t num_vertices, num_triangles;
    double num_cells;        /* of the box */
    uint64_t num_open_cells; /* of these, cells that no bounds excluded */
    uint64_t num_samples;    /* densities that were evaluated, gradients included */
    uint64_t num_sharp;      /* vertices on sharp edges and corners */
    double box_m[3];         /* how far the vertices lie apart, along each axis */
    double least_m[3];       /* and where they begin, from the box's corner */
} karst_mesh_stats;

/* What a mesh is given to, part by part, from the calling thread. Both return false to stop, with an error set. Indices
 * count vertices from 0; triangles come after their vertices, and are anticlockwise from the air where a x b = c for
 * the axes x, y, z. `progress` (may be NULL) gets the share done; false stops with KARST_FAILED. */
typedef struct {
    bool (*vertices)(void *user, const karst_mesh_vertex *vertices, size_t num, karst_error *error);
    bool (*triangles)(void *user, const uint32_t (*indices)[3], size_t num, karst_error *error);
    bool (*progress)(void *user, double share);
    void *user;
} karst_mesh_sink;

/* Finds the mesh of a box, in slabs across z: memory grows with the surface in a slab, not with the box. An edge of
 * cells belongs to the box in which its lower end lies, so the meshes of boxes that touch meet in the same vertices
 * (to rounding), and each reaches up to a cell below its lower faces. Thread-safe; the world is only read. `stats` may
 * be NULL. Errors: KARST_USAGE (a field out of range; a box that leaves the world; more than 2^32 vertices),
 * KARST_FAILED (memory; it was stopped). */
bool karst_mesh_find(const karst_world *world, const karst_mesh_config *config, const karst_mesh_sink *sink,
                     karst_mesh_stats *stats, karst_error *error);

typedef enum {
    KARST_MESH_OF_SUFFIX, /* by the file's name */
    KARST_MESH_GLB,       /* glTF 2.0, binary: positions, normals, linear colours; at most 4 GiB */
    KARST_MESH_PLY,       /* binary, little-endian: the same, colours as bytes of sRGB */
    KARST_MESH_OBJ        /* text: the same, colours behind the positions */
} karst_mesh_format;
/* "glb", "ply", "obj" of a name's end, whatever its case. Errors: KARST_USAGE listing them. Thread-safe. */
bool karst_mesh_format_of(const char *path, karst_mesh_format *format, karst_error *error);

/* The same into a file, whole or not at all (written beside as .karst-*.tmp, with its parts in memory, or in files that
 * have no name once one is more than 32 MiB; then renamed). Coordinates are metres from the box's corner, whose exact
 * decimals stand in the file, as do the width of a cell, the world's name and its seed: in comments, or in the glTF's
 * asset.extras. Karst's axes are left-handed (x right, y up, z forward): glTF's node mirrors z, so that viewers show
 * what Karst does; PLY and OBJ hold the coordinates as they are. Errors: also KARST_FAILED naming the path (disk full;
 * a GLB beyond 4 GiB). */
bool karst_mesh_write(const karst_world *world, const karst_mesh_config *config, const char *path,
                      karst_mesh_format format, bool (*progress)(void *user, double share), void *user,
                      karst_mesh_stats *stats, karst_error *error);

/* ---- levels ---- */

#define KARST_MESH_MAX_LEVELS 8
#define KARST_MESH_CHUNK_CELLS 128

/* A part of a mesh, of the surface in some KARST_MESH_CHUNK_CELLS along each axis, at several levels. Level 0 is the
 * mesh as karst_mesh_find has it. Level l has about a quarter of the triangles of the level before, as cells twice as
 * wide would have: vertices go where that moves the surface least (Garland and Heckbert 1997), at most by half a cell
 * of that level by their measure; those that stay keep place, normal and colour. Vertices at edges with one triangle
 * stay in all levels, so chunks meet without a crack whatever level each is shown at, and every level is watertight
 * and manifold where level 0 is. Vertices that a level uses are the first ones: so one array serves all levels. */
typedef struct {
    int64_t at[3]; /* counted in chunks from the box's lower corner */
    int num_levels;
    const karst_mesh_vertex *vertices;
    size_t num_vertices[KARST_MESH_MAX_LEVELS];            /* how many of them a level uses */
    const uint32_t (*triangles[KARST_MESH_MAX_LEVELS])[3]; /* indices into vertices */
    size_t num_triangles[KARST_MESH_MAX_LEVELS];
    double moved_m[KARST_MESH_MAX_LEVELS]; /* the farthest that a vertex had to the planes that it stands for, as a root
                                            * of a mean of squares; 0 of level 0 */
} karst_mesh_chunk;

typedef struct {
    uint64_t num_chunks;
    uint64_t num_vertices; /* of all chunks: those where two meet are of both */
    uint64_t num_triangles[KARST_MESH_MAX_LEVELS];
} karst_mesh_level_stats;

/* What chunks are given to, one by one, from the calling thread, each valid during the call. Both return false to stop,
 * the first with an error set; `progress` as of karst_mesh_sink. */
typedef struct {
    bool (*chunk)(void *user, const karst_mesh_chunk *chunk, karst_error *error);
    bool (*progress)(void *user, double share);
    void *user;
} karst_mesh_chunk_sink;

/* As karst_mesh_find, with num_levels levels (1 to KARST_MESH_MAX_LEVELS), level 0 among them. Memory grows with the
 * surface in a slab of KARST_MESH_CHUNK_CELLS cells across z. `stats` (of level 0) and `levels` may be NULL. What is
 * found does not depend on the number of threads. Thread-safe. Errors: as karst_mesh_find; KARST_USAGE also for
 * num_levels out of range. */
bool karst_mesh_find_levels(const karst_world *world, const karst_mesh_config *config, int num_levels,
                            const karst_mesh_chunk_sink *sink, karst_mesh_stats *stats, karst_mesh_level_stats *levels,
                            karst_error *error);

/* The same into a .glb, whole or not at all: a node for each chunk with its level 0, whose extension MSFT_lod names the
 * nodes of the coarser levels; these are in no scene, so that programs that know no levels show level 0 alone. Nodes
 * are called NAME_x0_y0_z0_lod0, and have how far the surface moved as extras.moved_m. All levels of a chunk share
 * their vertices. Otherwise as karst_mesh_write. Errors: as karst_mesh_write; KARST_USAGE also for num_levels out of
 * range and a name that does not end in .glb. */
bool karst_mesh_write_levels(const karst_world *world, const karst_mesh_config *config, int num_levels,
                             const char *path, bool (*progress)(void *user, double share), void *user,
                             karst_mesh_stats *stats, karst_mesh_level_stats *levels, karst_error *error);

/* ---- points ---- */

/* Writes points on the surface in place of triangles, as a binary .ply, whole or not at all: the vertices of the mesh
 * of the same box, so one for each piece of surface in a cell (config->cell_m is how far apart points are, more or
 * less), within 0.001 cells of the true surface, with the density's exact gradient as normal, and colours as bytes of
 * sRGB. Nothing is kept in memory but what the mesh of a slab takes. Otherwise as karst_mesh_write, whose comments the
 * file has, too. Errors: as karst_mesh_write; KARST_USAGE also for a name that does not end in .ply. */
bool karst_mesh_write_points(const karst_world *world, const karst_mesh_config *config, const char *path,
                             bool (*progress)(void *user, double share), void *user, karst_mesh_stats *stats,
                             karst_error *error);

#ifdef __cplusplus
}
#endif
#endif
