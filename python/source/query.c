/* Questions to worlds, many at once: karst/query.h. Arrays are read and filled where they lie. */
#include "common.h"

#include <math.h>
#include <string.h>

/* What all questions have: (world, footprint_m, within_m, edits, num_threads, progress). */
#define TERMS "(Oddy*iO)"
typedef struct {
    PyObject *world_handle, *progress;
    const karst_world *world;
    karst_query_config config;
    Py_buffer edits;
    watcher watcher;
} terms;
#define INTO_TERMS(t) \
    &(t).world_handle, &(t).config.footprint_m, &(t).config.within_m, &(t).edits, &(t).config.num_threads, &(t).progress

static bool check_terms(terms *t)
{
    t->world = take_handle(t->world_handle, WORLD_HANDLE);
    t->config.edits = t->edits.buf;
    t->config.num_edits = (size_t)t->edits.len / sizeof(karst_edit);
    t->config.progress = watch_share;
    t->config.user = &t->watcher;
    return t->world && check_size(&t->edits, t->config.num_edits, sizeof(karst_edit), "edits");
}

static PyObject *finish(terms *t, Py_buffer *buffers, size_t num_buffers, bool done)
{
    for (size_t i = 0; i < num_buffers; i++)
        PyBuffer_Release(&buffers[i]);
    PyBuffer_Release(&t->edits);
    if (!done)
        return NULL;
    Py_RETURN_NONE;
}

static size_t count(const Py_buffer *positions) { return (size_t)positions->len / sizeof(karst_position); }

/* query_densities(terms, positions, density) */
static PyObject *query_densities(PyObject *module, PyObject *args)
{
    (void)module;
    terms t = {0};
    Py_buffer b[2];
    if (!PyArg_ParseTuple(args, TERMS "y*w*", INTO_TERMS(t), &b[0], &b[1]))
        return NULL;
    const size_t num = count(&b[0]);
    karst_error error = {0};
    bool done = check_terms(&t) && check_size(&b[0], num, sizeof(karst_position), "points") &&
                check_size(&b[1], num, sizeof(float), "density");
    if (done) {
        watch_begin(&t.watcher, t.progress);
        done = karst_query_densities(t.world, &t.config, b[0].buf, num, b[1].buf, &error);
        done = watch_end(&t.watcher, done, &error);
    }
    return finish(&t, b, 2, done);
}

/* query_gradients(terms, positions, gradient) */
static PyObject *query_gradients(PyObject *module, PyObject *args)
{
    (void)module;
    terms t = {0};
    Py_buffer b[2];
    if (!PyArg_ParseTuple(args, TERMS "y*w*", INTO_TERMS(t), &b[0], &b[1]))
        return NULL;
    const size_t num = count(&b[0]);
    karst_error error = {0};
    bool done = check_terms(&t) && check_size(&b[0], num, sizeof(karst_position), "points") &&
                check_size(&b[1], num, 3 * sizeof(float), "gradient");
    if (done) {
        watch_begin(&t.watcher, t.progress);
        done = karst_query_gradients(t.world, &t.config, b[0].buf, num, b[1].buf, NULL, &error);
        done = watch_end(&t.watcher, done, &error);
    }
    return finish(&t, b, 2, done);
}

/* query_colours(terms, positions, normals, rgb); no bytes of normals: those of the density */
static PyObject *query_colours(PyObject *module, PyObject *args)
{
    (void)module;
    terms t = {0};
    Py_buffer b[3];
    if (!PyArg_ParseTuple(args, TERMS "y*y*w*", INTO_TERMS(t), &b[0], &b[1], &b[2]))
        return NULL;
    const size_t num = count(&b[0]);
    const bool has_normals = b[1].len > 0;
    karst_error error = {0};
    bool done = check_terms(&t) && check_size(&b[0], num, sizeof(karst_position), "points") &&
                (!has_normals || check_size(&b[1], num, 3 * sizeof(float), "normals")) &&
                check_size(&b[2], num, 3 * sizeof(float), "colour");
    if (done) {
        watch_begin(&t.watcher, t.progress);
        done = karst_query_colours(t.world, &t.config, b[0].buf, has_normals ? b[1].buf : NULL, num, b[2].buf, &error);
        done = watch_end(&t.watcher, done, &error);
    }
    return finish(&t, b, 3, done);
}

/* query_bounds(terms, centres, half_m, range) */
static PyObject *query_bounds(PyObject *module, PyObject *args)
{
    (void)module;
    terms t = {0};
    Py_buffer b[3];
    if (!PyArg_ParseTuple(args, TERMS "y*y*w*", INTO_TERMS(t), &b[0], &b[1], &b[2]))
        return NULL;
    const size_t num = count(&b[0]);
    karst_error error = {0};
    bool done = check_terms(&t) && check_size(&b[0], num, sizeof(karst_position), "points") &&
                check_size(&b[1], num, 3 * sizeof(double), "half") &&
                check_size(&b[2], num, 2 * sizeof(double), "bounds");
    if (done) {
        watch_begin(&t.watcher, t.progress);
        done = karst_query_bounds(t.world, &t.config, b[0].buf, b[1].buf, num, b[2].buf, &error);
        done = watch_end(&t.watcher, done, &error);
    }
    return finish(&t, b, 3, done);
}

/* ---- surfaces ---- */

static void spread_hits(const karst_query_hit *hits, size_t num, double *t_m, double (*normals)[3], int8_t *kinds)
{
    for (size_t i = 0; i < num; i++) {
        t_m[i] = hits[i].t_m;
        memcpy(normals[i], hits[i].normal, sizeof normals[i]);
        kinds[i] = (int8_t)hits[i].kind;
    }
}

static void gather_rays(karst_query_ray *rays, size_t num, const karst_position *from, const double (*direction)[3],
                        const double *length_m)
{
    for (size_t i = 0; i < num; i++) {
        rays[i].from = from[i];
        memcpy(rays[i].direction, direction[i], sizeof rays[i].direction);
        rays[i].length_m = length_m[i];
    }
}

/* query_rays(terms, positions, directions, lengths_m, t_m, normals, kinds) */
static PyObject *query_rays(PyObject *module, PyObject *args)
{
    (void)module;
    terms t = {0};
    Py_buffer b[6];
    if (!PyArg_ParseTuple(args, TERMS "y*y*y*w*w*w*", INTO_TERMS(t), &b[0], &b[1], &b[2], &b[3], &b[4], &b[5]))
        return NULL;
    const size_t num = count(&b[0]);
    karst_error error = {0};
    karst_query_ray *rays = NULL;
    karst_query_hit *hits = NULL;
    bool done = check_terms(&t) && check_size(&b[0], num, sizeof(karst_position), "origins") &&
                check_size(&b[1], num, 3 * sizeof(double), "directions") &&
                check_size(&b[2], num, sizeof(double), "lengths") && check_size(&b[3], num, sizeof(double), "t") &&
                check_size(&b[4], num, 3 * sizeof(double), "normals") && check_size(&b[5], num, 1, "kinds");
    if (done) {
        rays = PyMem_Calloc(num + 1, sizeof *rays);
        hits = PyMem_Calloc(num + 1, sizeof *hits);
        done = rays && hits;
        if (!done)
            PyErr_NoMemory();
    }
    if (done) {
        gather_rays(rays, num, b[0].buf, b[1].buf, b[2].buf);
        watch_begin(&t.watcher, t.progress);
        done = karst_query_rays(t.world, &t.config, rays, num, hits, &error);
        done = watch_end(&t.watcher, done, &error);
    }
    if (done)
        spread_hits(hits, num, b[3].buf, b[4].buf, b[5].buf);
    PyMem_Free(rays);
    PyMem_Free(hits);
    return finish(&t, b, 6, done);
}

/* query_heights(terms, positions, depth_m, max_surfaces, down_m, counts, starts_inside) */
static PyObject *query_heights(PyObject *module, PyObject *args)
{
    (void)module;
    terms t = {0};
    Py_buffer b[4];
    double depth_m;
    unsigned int most;
    if (!PyArg_ParseTuple(args, TERMS "y*dIw*w*w*", INTO_TERMS(t), &b[0], &depth_m, &most, &b[1], &b[2], &b[3]))
        return NULL;
    const size_t num = count(&b[0]);
    karst_error error = {0};
    bool done = check_terms(&t) && check_size(&b[0], num, sizeof(karst_position), "points") &&
                check_size(&b[1], num, most * sizeof(double), "down") &&
                check_size(&b[2], num, sizeof(uint32_t), "counts") && check_size(&b[3], num, sizeof(bool), "inside");
    if (done) {
        watch_begin(&t.watcher, t.progress);
        done =
            karst_query_heights(t.world, &t.config, b[0].buf, num, depth_m, most, b[1].buf, b[2].buf, b[3].buf, &error);
        done = watch_end(&t.watcher, done, &error);
    }
    return finish(&t, b, 4, done);
}

/* query_height_map(terms, corner, (size_x_m, size_z_m), (width_px, height_px), depth_m, down_m) */
static PyObject *query_height_map(PyObject *module, PyObject *args)
{
    (void)module;
    terms t = {0};
    Py_buffer b[2];
    karst_height_map map;
    if (!PyArg_ParseTuple(args, TERMS "y*(dd)(ii)dw*", INTO_TERMS(t), &b[0], &map.size_m[0], &map.size_m[1],
                          &map.size_px[0], &map.size_px[1], &map.depth_m, &b[1]))
        return NULL;
    karst_error error = {0};
    /* Sides out of range are the library's to refuse. */
    const bool is_sane = map.size_px[0] > 0 && map.size_px[1] > 0;
    const size_t num = is_sane ? (size_t)map.size_px[0] * (size_t)map.size_px[1] : 0;
    bool done = check_terms(&t) && check_size(&b[0], 1, sizeof(karst_position), "corner") &&
                check_size(&b[1], num, sizeof(double), "down");
    if (done) {
        memcpy(&map.corner, b[0].buf, sizeof map.corner);
        watch_begin(&t.watcher, t.progress);
        done = karst_query_height_map(t.world, &t.config, &map, b[1].buf, &error);
        done = watch_end(&t.watcher, done, &error);
    }
    return finish(&t, b, 2, done);
}

PyMethodDef query_methods[] = {{"query_densities", query_densities, METH_VARARGS, NULL},
                               {"query_gradients", query_gradients, METH_VARARGS, NULL},
                               {"query_colours", query_colours, METH_VARARGS, NULL},
                               {"query_bounds", query_bounds, METH_VARARGS, NULL},
                               {"query_rays", query_rays, METH_VARARGS, NULL},
                               {"query_heights", query_heights, METH_VARARGS, NULL},
                               {"query_height_map", query_height_map, METH_VARARGS, NULL},
                               {NULL, NULL, 0, NULL}};
