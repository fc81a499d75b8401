#include "core/export/simplify.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A level may lie so far from the finest mesh, in its own cells. */
#define MOST_MOVED 0.5
/* What lengths of edges count beside distances, so that flat land does not end in slivers. */
#define LENGTH_WEIGHT 1e-4
/* Triangles turn by less than the angle of this cosine, and become no thinner than this (1: all sides are equal). */
#define LEAST_COSINE 0.3
#define LEAST_SHAPE 0.05

/* Squared distances from planes, each times the area of its triangle. */
typedef struct {
    double m[6], v[3], c, area; /* the symmetric 3 x 3 part as xx, xy, xz, yy, yz, zz */
} quadric;

/* A vertex that may go to another. Out of date once either was changed since. */
typedef struct {
    double cost, moved; /* in cells, squared */
    uint32_t from, to, from_age, to_age;
} candidate;

typedef struct {
    const karst_mesh_part *part;
    double (*at)[3]; /* in cells, from the part's first vertex */
    quadric *quadrics;
    uint32_t (*triangles)[3];
    bool *is_gone; /* triangles */
    uint32_t num_left;
    /* Corners (3 * triangle + i) of each vertex, as a list; those of triangles that are gone are still in it. */
    uint32_t *first, *last, *next;
    bool *is_fixed;
    uint8_t *gone_at;                   /* the level that a vertex is missing from; num_levels: none */
    uint32_t *age, *mark, *seen, marks; /* of vertices */
    candidate *heap;
    size_t num_heap, max_heap;
    bool is_out_of_memory;
} mesh;

#define NONE UINT32_MAX

/* ---- vectors ---- */

static void subtract(const double a[3], const double b[3], double to[3])
{
    for (int axis = 0; axis < 3; axis++)
        to[axis] = a[axis] - b[axis];
}

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/* Of twice the triangle's area. */
static void normal_of(const double a[3], const double b[3], const double c[3], double normal[3])
{
    double u[3], v[3];
    subtract(b, a, u);
    subtract(c, a, v);
    normal[0] = u[1] * v[2] - u[2] * v[1];
    normal[1] = u[2] * v[0] - u[0] * v[2];
    normal[2] = u[0] * v[1] - u[1] * v[0];
}

/* 1 where all sides are equal, 0 where there is no area. */
static double shape_of(const double a[3], const double b[3], const double c[3])
{
    double normal[3], u[3], v[3], w[3];
    normal_of(a, b, c, normal);
    subtract(b, a, u);
    subtract(c, b, v);
    subtract(a, c, w);
    const double sides = dot(u, u) + dot(v, v) + dot(w, w);
    return sides > 0 ? 2 * sqrt(3) * sqrt(dot(normal, normal)) / sides : 0;
}

/* ---- quadrics ---- */

static void add_plane(quadric *q, const double normal[3], double offset, double area)
{
    int k = 0;
    for (int i = 0; i < 3; i++) {
        for (int j = i; j < 3; j++)
            q->m[k++] += area * normal[i] * normal[j];
        q->v[i] += area * offset * normal[i];
    }
    q->c += area * offset * offset;
    q->area += area;
}

static void add_quadric(quadric *q, const quadric *more)
{
    for (int i = 0; i < 6; i++)
        q->m[i] += more->m[i];
    for (int i = 0; i < 3; i++)
        q->v[i] += more->v[i];
    q->c += more->c;
    q->area += more->area;
}

/* The mean square of the distances. */
static double distance_of(const quadric *a, const quadric *b, const double at[3])
{
    quadric q = *a;
    add_quadric(&q, b);
    const double x = at[0], y = at[1], z = at[2];
    const double sum = q.m[0] * x * x + q.m[3] * y * y + q.m[5] * z * z +
                       2 * (q.m[1] * x * y + q.m[2] * x * z + q.m[4] * y * z) + 2 * dot(q.v, at) + q.c;
    return q.area > 0 ? fmax(sum, 0) / q.area : 0;
}

/* ---- candidates, the cheapest first ---- */

static bool is_before(const candidate *a, const candidate *b)
{
    if (a->cost != b->cost)
        return a->cost < b->cost;
    return a->from != b->from ? a->from < b->from : a->to < b->to;
}

static void push(mesh *m, candidate c)
{
    if (m->num_heap == m->max_heap) {
        const size_t more = m->max_heap ? 2 * m->max_heap : 1024;
        candidate *larger = realloc(m->heap, more * sizeof *larger);
        if (!larger) {
            m->is_out_of_memory = true;
            return;
        }
        m->heap = larger;
        m->max_heap = more;
    }
    size_t i = m->num_heap++;
    for (; i > 0 && is_before(&c, &m->heap[(i - 1) / 2]); i = (i - 1) / 2)
        m->heap[i] = m->heap[(i - 1) / 2];
    m->heap[i] = c;
}

static candidate pop(mesh *m)
{
    const candidate top = m->heap[0], last = m->heap[--m->num_heap];
    size_t i = 0;
    for (size_t child; (child = 2 * i + 1) < m->num_heap; i = child) {
        child += child + 1 < m->num_heap && is_before(&m->heap[child + 1], &m->heap[child]);
        if (!is_before(&m->heap[child], &last))
            break;
        m->heap[i] = m->heap[child];
    }
    m->heap[i] = last;
    return top;
}

static void propose(mesh *m, uint32_t from, uint32_t to)
{
    double way[3];
    if (m->is_fixed[from])
        return;
    subtract(m->at[from], m->at[to], way);
    const double moved = distance_of(&m->quadrics[from], &m->quadrics[to], m->at[to]);
    push(m, (candidate){.cost = moved + LENGTH_WEIGHT * dot(way, way),
                        .moved = moved,
                        .from = from,
                        .to = to,
                        .from_age = m->age[from],
                        .to_age = m->age[to]});
}

/* ---- the mesh ---- */

/* Corners of a vertex whose triangles are left: `for (c = first_corner(m, v); c != NONE; c = next_corner(m, c))`. */
static uint32_t skip_gone(const mesh *m, uint32_t corner)
{
    while (corner != NONE && m->is_gone[corner / 3])
        corner = m->next[corner];
    return corner;
}

static uint32_t first_corner(const mesh *m, uint32_t vertex) { return skip_gone(m, m->first[vertex]); }
static uint32_t next_corner(const mesh *m, uint32_t corner) { return skip_gone(m, m->next[corner]); }

/* The other vertices of a corner's triangle, in their order. */
static void others_of(const mesh *m, uint32_t corner, uint32_t others[2])
{
    const uint32_t *t = m->triangles[corner / 3], i = corner % 3;
    others[0] = t[(i + 1) % 3];
    others[1] = t[(i + 2) % 3];
}

static uint32_t new_mark(mesh *m)
{
    if (++m->marks == 0) {
        memset(m->mark, 0, m->part->num_vertices * sizeof *m->mark);
        memset(m->seen, 0, m->part->num_vertices * sizeof *m->seen);
        m->marks = 1;
    }
    return m->marks;
}

/* At an edge with one triangle a vertex has a neighbour that comes first in a triangle and last in none. */
static void find_fixed(mesh *m)
{
    for (uint32_t v = 0; v < m->part->num_vertices; v++) {
        const uint32_t mark = new_mark(m);
        uint32_t others[2], num = 0, num_paired = 0;
        for (uint32_t c = first_corner(m, v); c != NONE; c = next_corner(m, c), num++) {
            others_of(m, c, others);
            m->mark[others[0]] = mark;
        }
        for (uint32_t c = first_corner(m, v); c != NONE; c = next_corner(m, c)) {
            others_of(m, c, others);
            num_paired += m->mark[others[1]] == mark;
        }
        m->is_fixed[v] = num_paired != num;
    }
}

static void fill(mesh *m)
{
    const karst_mesh_part *part = m->part;
    const float *origin = part->vertices[0].position;
    for (size_t v = 0; v < part->num_vertices; v++) {
        m->first[v] = m->last[v] = NONE;
        m->gone_at[v] = (uint8_t)part->num_levels;
        for (int axis = 0; axis < 3; axis++)
            m->at[v][axis] = ((double)part->vertices[v].position[axis] - (double)origin[axis]) / part->cell_m;
    }
    m->num_left = (uint32_t)part->num_triangles;
    memcpy(m->triangles, part->triangles, part->num_triangles * sizeof *m->triangles);
    for (uint32_t t = 0; t < m->num_left; t++) {
        const uint32_t *v = m->triangles[t];
        double normal[3];
        normal_of(m->at[v[0]], m->at[v[1]], m->at[v[2]], normal);
        const double length = sqrt(dot(normal, normal));
        for (int axis = 0; axis < 3 && length > 0; axis++)
            normal[axis] /= length;
        for (uint32_t i = 0; i < 3; i++) {
            const uint32_t corner = 3 * t + i;
            if (length > 0)
                add_plane(&m->quadrics[v[i]], normal, -dot(normal, m->at[v[0]]), length / 2);
            m->next[corner] = m->first[v[i]];
            m->first[v[i]] = corner;
            m->last[v[i]] = m->last[v[i]] == NONE ? corner : m->last[v[i]];
        }
    }
    find_fixed(m);
}

/* ---- taking vertices away ---- */

/* Whether the surface stays what it is, as a set of neighbours: the ends have two in common, with a triangle each, and
 * no edge comes up between vertices that are fixed, since the part beyond might have it, too. */
static bool keeps_neighbours(mesh *m, uint32_t from, uint32_t to)
{
    const uint32_t mark = new_mark(m);
    uint32_t others[2], num_common = 0, num_shared = 0, num_around = 0, common[2] = {NONE, NONE};
    for (uint32_t c = first_corner(m, to); c != NONE; c = next_corner(m, c)) {
        others_of(m, c, others);
        m->mark[others[0]] = m->mark[others[1]] = mark;
    }
    for (uint32_t c = first_corner(m, from); c != NONE; c = next_corner(m, c), num_around++) {
        others_of(m, c, others);
        num_shared += others[0] == to || others[1] == to;
        for (int i = 0; i < 2; i++) {
            const uint32_t v = others[i];
            if (v == to || m->seen[v] == mark)
                continue;
            m->seen[v] = mark;
            if (m->mark[v] != mark && m->is_fixed[v] && m->is_fixed[to])
                return false;
            if (m->mark[v] == mark && num_common < 2)
                common[num_common] = v;
            num_common += m->mark[v] == mark;
        }
    }
    if (num_common != 2 || num_shared != 2)
        return false;
    if (num_around > 3)
        return true;
    /* What is left of three triangles is one, which must not be there already. */
    for (uint32_t c = first_corner(m, to); c != NONE; c = next_corner(m, c)) {
        others_of(m, c, others);
        if ((others[0] == common[0] && others[1] == common[1]) || (others[0] == common[1] && others[1] == common[0]))
            return false;
    }
    return true;
}

static bool keeps_shape(const mesh *m, uint32_t from, uint32_t to)
{
    for (uint32_t c = first_corner(m, from); c != NONE; c = next_corner(m, c)) {
        uint32_t others[2];
        double before[3], after[3];
        others_of(m, c, others);
        if (others[0] == to || others[1] == to)
            continue;
        const double *a = m->at[others[0]], *b = m->at[others[1]];
        normal_of(m->at[from], a, b, before);
        normal_of(m->at[to], a, b, after);
        const double lengths = sqrt(dot(before, before) * dot(after, after));
        if (!(dot(before, after) >= LEAST_COSINE * lengths) || lengths == 0)
            return false;
        const double shape = shape_of(m->at[to], a, b);
        if (shape < LEAST_SHAPE && shape < shape_of(m->at[from], a, b))
            return false;
    }
    return true;
}

/* One list of both, without what is gone. */
static void join_corners(mesh *m, uint32_t from, uint32_t to)
{
    uint32_t *link = &m->first[to], last = NONE;
    m->next[m->last[to]] = m->first[from];
    for (uint32_t c = *link; c != NONE; c = m->next[c]) {
        if (m->is_gone[c / 3])
            continue;
        *link = last = c;
        link = &m->next[c];
    }
    *link = NONE;
    m->last[to] = last;
    m->first[from] = m->last[from] = NONE;
}

static void move(mesh *m, uint32_t from, uint32_t to, int level)
{
    for (uint32_t c = first_corner(m, from); c != NONE; c = next_corner(m, c)) {
        uint32_t *t = m->triangles[c / 3];
        if (t[0] == to || t[1] == to || t[2] == to) {
            m->is_gone[c / 3] = true;
            m->num_left--;
        } else {
            t[c % 3] = to;
        }
    }
    join_corners(m, from, to);
    m->gone_at[from] = (uint8_t)level;
    m->age[from]++;
    m->age[to]++;
    add_quadric(&m->quadrics[to], &m->quadrics[from]);
    const uint32_t mark = new_mark(m);
    for (uint32_t c = first_corner(m, to); c != NONE; c = next_corner(m, c)) {
        uint32_t others[2];
        others_of(m, c, others);
        for (int i = 0; i < 2; i++) {
            if (m->seen[others[i]] == mark)
                continue;
            m->seen[others[i]] = mark;
            propose(m, others[i], to);
            propose(m, to, others[i]);
        }
    }
}

/* Down to so many triangles. Returns how far the surface moved, in cells. */
static double make_level(mesh *m, int level, uint32_t num_wanted)
{
    const double most = MOST_MOVED * ldexp(1, level);
    double moved = 0;
    m->num_heap = 0;
    for (uint32_t t = 0; t < m->part->num_triangles; t++)
        for (int i = 0; i < 3 && !m->is_gone[t]; i++) {
            const uint32_t a = m->triangles[t][i], b = m->triangles[t][(i + 1) % 3];
            propose(m, a, b);
            if (m->is_fixed[a] || m->is_fixed[b]) /* else the other triangle at the edge has it */
                propose(m, b, a);
        }
    while (m->num_heap && m->num_left > num_wanted && !m->is_out_of_memory) {
        const candidate c = pop(m);
        if (c.from_age != m->age[c.from] || c.to_age != m->age[c.to] || c.moved > most * most ||
            !keeps_neighbours(m, c.from, c.to) || !keeps_shape(m, c.from, c.to))
            continue;
        move(m, c.from, c.to, level);
        moved = fmax(moved, sqrt(c.moved));
    }
    return moved;
}

/* ---- chunks ---- */

void karst_mesh_chunk_finish(karst_mesh_chunk *chunk)
{
    free((void *)(uintptr_t)chunk->vertices);
    for (int level = 0; level < KARST_MESH_MAX_LEVELS; level++)
        free((void *)(uintptr_t)chunk->triangles[level]);
    *chunk = (karst_mesh_chunk){.num_levels = 0};
}

static bool copy_triangles(const mesh *m, int level, karst_mesh_chunk *chunk)
{
    uint32_t(*copy)[3] = malloc(((size_t)m->num_left + 1) * sizeof *copy);
    size_t num = 0;
    if (!copy)
        return false;
    for (size_t t = 0; t < m->part->num_triangles; t++)
        if (!m->is_gone[t])
            memcpy(copy[num++], m->triangles[t], sizeof *copy);
    chunk->triangles[level] = (const uint32_t(*)[3])copy;
    chunk->num_triangles[level] = num;
    return true;
}

/* Those that the coarsest level has come first, then those of the next. */
static bool order_vertices(const mesh *m, karst_mesh_chunk *chunk)
{
    const karst_mesh_part *part = m->part;
    karst_mesh_vertex *vertices = malloc(part->num_vertices * sizeof *vertices);
    uint32_t *place = malloc(part->num_vertices * sizeof *place), num = 0;
    for (int level = part->num_levels - 1; vertices && place && level >= 0; level--) {
        for (size_t v = 0; v < part->num_vertices; v++)
            if (m->gone_at[v] == level + 1) {
                vertices[num] = part->vertices[v];
                place[v] = num++;
            }
        chunk->num_vertices[level] = num;
    }
    for (int level = 0; place && level < part->num_levels; level++) {
        uint32_t *index = (uint32_t *)(uintptr_t)chunk->triangles[level];
        for (size_t i = 0; i < 3 * chunk->num_triangles[level]; i++)
            index[i] = place[index[i]];
    }
    free(place);
    chunk->vertices = vertices;
    return vertices && place;
}

/* Edges with one triangle: each has a triangle at every level. */
static uint32_t count_fixed(const mesh *m)
{
    uint32_t num = 0;
    for (size_t v = 0; v < m->part->num_vertices; v++)
        num += m->is_fixed[v];
    return num;
}

static bool make_levels(mesh *m, karst_mesh_chunk *chunk)
{
    const int num_levels = m->part->num_levels;
    fill(m);
    const uint32_t num_all = m->num_left, num_fixed = count_fixed(m), least = num_fixed < num_all ? num_fixed : num_all;
    bool done = copy_triangles(m, 0, chunk);
    chunk->num_levels = num_levels;
    for (int level = 1; done && level < num_levels; level++) {
        const double moved = make_level(m, level, least + ((num_all - least) >> 2 * level));
        chunk->moved_m[level] = fmax(moved * m->part->cell_m, chunk->moved_m[level - 1]);
        done = !m->is_out_of_memory && copy_triangles(m, level, chunk);
    }
    return done && order_vertices(m, chunk);
}

bool karst_mesh_simplify(const karst_mesh_part *part, karst_mesh_chunk *chunk, karst_error *error)
{
    const size_t num = part->num_vertices, num_triangles = part->num_triangles;
    mesh m = {.part = part,
              .at = calloc(num, sizeof *m.at),
              .quadrics = calloc(num, sizeof *m.quadrics),
              .triangles = calloc(num_triangles, sizeof *m.triangles),
              .is_gone = calloc(num_triangles, sizeof *m.is_gone),
              .first = calloc(num, sizeof *m.first),
              .last = calloc(num, sizeof *m.last),
              .next = calloc(num_triangles, 3 * sizeof *m.next),
              .is_fixed = calloc(num, sizeof *m.is_fixed),
              .gone_at = calloc(num, sizeof *m.gone_at),
              .age = calloc(num, sizeof *m.age),
              .mark = calloc(num, sizeof *m.mark),
              .seen = calloc(num, sizeof *m.seen)};
    const int64_t at[3] = {chunk->at[0], chunk->at[1], chunk->at[2]};
    *chunk = (karst_mesh_chunk){.at = {at[0], at[1], at[2]}};
    const bool done = m.at && m.quadrics && m.triangles && m.is_gone && m.first && m.last && m.next && m.is_fixed &&
                      m.gone_at && m.age && m.mark && m.seen && make_levels(&m, chunk);
    void *const arrays[] = {m.at,       m.quadrics, m.triangles, m.is_gone, m.first, m.last, m.next,
                            m.is_fixed, m.gone_at,  m.age,       m.mark,    m.seen,  m.heap};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++)
        free(arrays[i]);
    if (done)
        return true;
    karst_mesh_chunk_finish(chunk);
    return karst_fail(error, KARST_FAILED, "out of memory");
}
