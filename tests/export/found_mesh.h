/* Meshes in memory, and whether they are what a surface is. */
#ifndef KARST_TESTS_FOUND_MESH_H
#define KARST_TESTS_FOUND_MESH_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>
#include <math.h>

#include "karst/data.h"
#include "karst/mesh.h"

typedef struct {
    karst_mesh_vertex *vertices;
    uint32_t (*triangles)[3];
    size_t num_vertices, num_triangles;
    karst_mesh_stats stats;
} found_mesh;

static inline karst_world *world_of(const char *text)
{
    char path[] = "/tmp/karst_mesh_XXXXXX.karst";
    int fd = mkstemps(path, 6);
    assert_true(fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text) && close(fd) == 0);
    karst_error error = {0};
    const karst_world_config config = {.world = path};
    karst_world *world = karst_world_open(&config, &error);
    unlink(path);
    if (!world)
        fail_msg("%s", error.message);
    return world;
}

static inline karst_world *shipped_world(const char *name)
{
    karst_error error = {0};
    char path[4096];
    if (!karst_data_find("worlds", name, ".karst", path, sizeof path, &error))
        fail_msg("%s", error.message);
    const karst_world_config config = {.world = path};
    karst_world *world = karst_world_open(&config, &error);
    if (!world)
        fail_msg("%s", error.message);
    return world;
}

static inline bool take_vertices(void *user, const karst_mesh_vertex *vertices, size_t num, karst_error *error)
{
    found_mesh *m = user;
    (void)error;
    m->vertices = realloc(m->vertices, (m->num_vertices + num) * sizeof *vertices);
    assert_non_null(m->vertices);
    memcpy(m->vertices + m->num_vertices, vertices, num * sizeof *vertices);
    m->num_vertices += num;
    return true;
}

static inline bool take_triangles(void *user, const uint32_t (*indices)[3], size_t num, karst_error *error)
{
    found_mesh *m = user;
    (void)error;
    m->triangles = realloc(m->triangles, (m->num_triangles + num) * sizeof *indices);
    assert_non_null(m->triangles);
    memcpy(m->triangles + m->num_triangles, indices, num * sizeof *indices);
    m->num_triangles += num;
    return true;
}

static inline karst_mesh_config box_of(const karst_world *world, const char *x, const char *y, const char *z,
                                       int64_t num_x, int64_t num_y, int64_t num_z, double cell_m)
{
    karst_mesh_config config = {.num_cells = {num_x, num_y, num_z}, .cell_m = cell_m};
    karst_error error = {0};
    if (!karst_position_parse(x, y, z, karst_world_get_metadata(world)->voxel_log2_m, &config.corner, &error))
        fail_msg("%s", error.message);
    return config;
}

static inline found_mesh find_mesh(const karst_world *world, const karst_mesh_config *config)
{
    found_mesh m = {0};
    karst_error error = {0};
    const karst_mesh_sink sink = {.vertices = take_vertices, .triangles = take_triangles, .user = &m};
    if (!karst_mesh_find(world, config, &sink, &m.stats, &error))
        fail_msg("%s", error.message);
    assert_int_equal(m.stats.num_vertices, m.num_vertices);
    assert_int_equal(m.stats.num_triangles, m.num_triangles);
    return m;
}

static inline void drop_mesh(found_mesh *m)
{
    free(m->vertices);
    free(m->triangles);
}

/* ---- topology ---- */

typedef struct {
    uint32_t from, to, triangle; /* a directed edge of a triangle */
} half_edge;

static inline int compare_half_edges(const void *a, const void *b)
{
    const half_edge *x = a, *y = b;
    if (x->from != y->from)
        return x->from < y->from ? -1 : 1;
    return x->to < y->to ? -1 : x->to > y->to;
}

static inline const half_edge *find_half_edge(const half_edge *edges, size_t num, uint32_t from, uint32_t to)
{
    const half_edge wanted = {.from = from, .to = to};
    return bsearch(&wanted, edges, num, sizeof *edges, compare_half_edges);
}

/* Whether a vertex lies so near to a face of the box that the mesh may end there. */
static inline bool is_at_face(const found_mesh *m, const karst_mesh_config *config, uint32_t vertex)
{
    for (int axis = 0; axis < 3; axis++) {
        const double at = (double)m->vertices[vertex].position[axis] / config->cell_m;
        if (at < 0.51 || at > (double)config->num_cells[axis] - 1.51)
            return true;
    }
    return false;
}

/* What is wrong with a mesh; "": nothing. Every edge has a triangle on each side, going the other way, but for edges at
 * the box's faces, which may have one; the triangles at a vertex inside are one fan; every vertex has some. */
static inline const char *what_is_wrong(const found_mesh *m, const karst_mesh_config *config, size_t *num_open)
{
    static char text[200];
    const size_t num = 3 * m->num_triangles;
    half_edge *edges = malloc((num + 1) * sizeof *edges);
    uint32_t *num_at = calloc(m->num_vertices + 1, sizeof *num_at);
    *text = '\0';
    *num_open = 0;
    assert_true(edges && num_at);
    for (size_t i = 0; i < num; i++) {
        const uint32_t *t = m->triangles[i / 3];
        edges[i] = (half_edge){t[i % 3], t[(i + 1) % 3], (uint32_t)(i / 3)};
        if (edges[i].from >= m->num_vertices || edges[i].from == edges[i].to)
            snprintf(text, sizeof text, "triangle %zu is none", i / 3);
        else
            num_at[edges[i].from]++;
    }
    qsort(edges, num, sizeof *edges, compare_half_edges);
    for (size_t i = 0; i < num && !*text; i++) {
        if (i && compare_half_edges(&edges[i - 1], &edges[i]) == 0)
            snprintf(text, sizeof text, "two triangles go from %u to %u", edges[i].from, edges[i].to);
        if (find_half_edge(edges, num, edges[i].to, edges[i].from))
            continue;
        ++*num_open;
        if (!is_at_face(m, config, edges[i].from) || !is_at_face(m, config, edges[i].to))
            snprintf(text, sizeof text, "the edge from %u (%g, %g, %g) to %u (%g, %g, %g) has one triangle",
                     edges[i].from, (double)m->vertices[edges[i].from].position[0],
                     (double)m->vertices[edges[i].from].position[1], (double)m->vertices[edges[i].from].position[2],
                     edges[i].to, (double)m->vertices[edges[i].to].position[0],
                     (double)m->vertices[edges[i].to].position[1], (double)m->vertices[edges[i].to].position[2]);
    }
    /* Round each vertex, from a triangle to the next by their common edge: so all are met. */
    for (size_t i = 0; i < num && !*text; i++) {
        const uint32_t vertex = edges[i].from;
        if (i && edges[i - 1].from == vertex)
            continue;
        const half_edge *start = &edges[i];
        for (size_t k = i; k < num && edges[k].from == vertex; k++) /* an open fan begins where nothing comes before */
            if (!find_half_edge(edges, num, edges[k].to, vertex))
                start = &edges[k];
        uint32_t met = 0;
        const half_edge *at = start;
        do {
            const uint32_t *t = m->triangles[at->triangle];
            const int k = t[0] == vertex ? 0 : t[1] == vertex ? 1 : 2;
            at = find_half_edge(edges, num, vertex, t[(k + 2) % 3]);
            met++;
        } while (at && at != start && met <= num_at[vertex]);
        if (met != num_at[vertex] && !is_at_face(m, config, vertex))
            snprintf(text, sizeof text, "vertex %u has %u triangles, but %u in one fan", vertex, num_at[vertex], met);
    }
    for (size_t i = 0; i < m->num_vertices && !*text; i++)
        if (!num_at[i])
            snprintf(text, sizeof text, "vertex %zu has no triangle", i);
    free(edges);
    free(num_at);
    return text;
}

static inline double volume_of(const found_mesh *m)
{
    double volume = 0;
    for (size_t i = 0; i < m->num_triangles; i++) {
        const float *a = m->vertices[m->triangles[i][0]].position, *b = m->vertices[m->triangles[i][1]].position,
                    *c = m->vertices[m->triangles[i][2]].position;
        volume += (double)a[0] * ((double)b[1] * (double)c[2] - (double)b[2] * (double)c[1]) +
                  (double)a[1] * ((double)b[2] * (double)c[0] - (double)b[0] * (double)c[2]) +
                  (double)a[2] * ((double)b[0] * (double)c[1] - (double)b[1] * (double)c[0]);
    }
    return volume / 6;
}

#endif
