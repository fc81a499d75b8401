/* Worlds, positions in them, and camera paths. */
#include "common.h"

#include <limits.h>
#include <math.h>
#include <string.h>

/* ---- opening ---- */

static void close_world(PyObject *capsule) { karst_world_close(PyCapsule_GetPointer(capsule, WORLD_HANDLE)); }

/* world_open(options) -> (handle or None, (status, message) or None, lines) */
static PyObject *world_open(PyObject *module, PyObject *options)
{
    (void)module;
    karst_world_config config = {0};
    karst_parameter *parameters;
    static const field fields[] = {{"world", FIELD_TEXT, offsetof(karst_world_config, world)}};
    if (!take_fields(options, fields, 1, &config) ||
        !take_world_options(options, &parameters, &config.num_parameters, &config.has_seed, &config.seed))
        return NULL;
    collector *said = collector_create();
    karst_error error = {0};
    karst_world *world = NULL;
    PyObject *lines = NULL;
    config.parameters = parameters;
    if (said) {
        config.log = collector_log(said);
        Py_BEGIN_ALLOW_THREADS world = karst_world_open(&config, &error);
        Py_END_ALLOW_THREADS lines = collector_take(said);
    }
    PyMem_Free(parameters);
    collector_destroy(said);
    if (!lines) {
        karst_world_close(world);
        return NULL;
    }
    if (!world)
        return Py_BuildValue("O(is)N", Py_None, (int)error.status, error.message, lines);
    PyObject *capsule = PyCapsule_New(world, WORLD_HANDLE, close_world);
    if (!capsule)
        karst_world_close(world);
    return capsule ? Py_BuildValue("NON", capsule, Py_None, lines) : NULL;
}

static PyObject *describe_parameter(const karst_parameter_info *p)
{
    return Py_BuildValue("(sssddddNN)", p->name, p->label, p->unit, p->value, p->min, p->max, p->step,
                         PyBool_FromLong(p->is_structural), PyBool_FromLong(p->is_used));
}

/* world_metadata(world) -> dict */
static PyObject *world_metadata(PyObject *module, PyObject *capsule)
{
    (void)module;
    const karst_world *world = take_handle(capsule, WORLD_HANDLE);
    if (!world)
        return NULL;
    const karst_world_metadata *m = karst_world_get_metadata(world);
    char camera[512];
    karst_camera_format(&m->camera, m->voxel_log2_m, camera, sizeof camera);
    PyObject *parameters = PyList_New(0);
    for (size_t i = 0; parameters && i < m->num_parameters; i++) {
        PyObject *one = describe_parameter(&m->parameters[i]);
        if (!one || PyList_Append(parameters, one) != 0)
            Py_CLEAR(parameters);
        Py_XDECREF(one);
    }
    if (!parameters)
        return NULL;
    return Py_BuildValue("{s:s,s:s,s:s,s:s,s:i,s:k,s:s,s:(dd),s:d,s:d,s:d,s:N,s:N}", "path", m->path, "name", m->name,
                         "author", m->author, "description", m->description, "voxel_log2_m", m->voxel_log2_m, "seed",
                         (unsigned long)m->seed, "camera", camera, "sun", m->sun_azimuth_deg, m->sun_elevation_deg,
                         "view_distance_m", m->view_distance_m, "extent_m", m->extent_m, "lipschitz",
                         m->declared_lipschitz, "has_colour", PyBool_FromLong(m->has_colour), "parameters", parameters);
}

static void append_line(void *user, const char *text)
{
    PyObject *list = user, *line = PyUnicode_DecodeUTF8(text, (Py_ssize_t)strlen(text), "replace");
    if (line && !PyErr_Occurred())
        PyList_Append(list, line);
    Py_XDECREF(line);
}

/* world_check(world) -> list of lines */
static PyObject *world_check(PyObject *module, PyObject *capsule)
{
    (void)module;
    const karst_world *world = take_handle(capsule, WORLD_HANDLE);
    PyObject *lines = world ? PyList_New(0) : NULL;
    karst_error error = {0};
    if (lines && !karst_world_check(world, append_line, lines, &error)) {
        Py_DECREF(lines);
        return raise_error(&error);
    }
    if (lines && PyErr_Occurred())
        Py_CLEAR(lines);
    return lines;
}

/* world_try_code(world, device or None) */
static PyObject *world_try_code(PyObject *module, PyObject *args)
{
    (void)module;
    PyObject *capsule;
    const char *device;
    if (!PyArg_ParseTuple(args, "Oz", &capsule, &device))
        return NULL;
    const karst_world *world = take_handle(capsule, WORLD_HANDLE);
    karst_error error = {0};
    bool done;
    if (!world)
        return NULL;
    Py_BEGIN_ALLOW_THREADS done = karst_world_try_code(world, device, &error);
    Py_END_ALLOW_THREADS if (!done) return raise_error(&error);
    Py_RETURN_NONE;
}

/* data_list(kind, suffix) -> names */
static PyObject *data_list(PyObject *module, PyObject *args)
{
    (void)module;
    enum { MOST = 1000 };
    static char names[MOST][KARST_DATA_NAME_BYTES];
    const char *kind, *suffix;
    if (!PyArg_ParseTuple(args, "ss", &kind, &suffix))
        return NULL;
    const size_t num = karst_data_list(kind, suffix, names, MOST);
    PyObject *list = PyList_New(0);
    for (size_t i = 0; list && i < num; i++)
        append_line(list, names[i]);
    return list;
}

/* ---- positions ---- */

static bool fail_position(Py_ssize_t point, const char *what)
{
    PyErr_Format(PyExc_ValueError, "point %zd %s", point, what);
    return false;
}

/* As karst_position_add_m from the origin; near it, where 64 bits hold the sum, in a few instructions. */
static void convert_one(const double from[3], karst_position *to, double voxels_per_m, int voxel_log2_m)
{
    const double near = 0x1p29;
    if (!(fabs(from[0] * voxels_per_m) < near && fabs(from[1] * voxels_per_m) < near &&
          fabs(from[2] * voxels_per_m) < near)) {
        *to = karst_position_add_m((karst_position){{0, 0, 0}, {0, 0, 0}}, from, voxel_log2_m);
        return;
    }
    for (int axis = 0; axis < 3; axis++) {
        const int64_t units = llrint(from[axis] * voxels_per_m * 0x1p32);
        const int64_t voxel = units >> 32;
        to->voxel[axis] = voxel;
        to->fraction[axis] = (uint32_t)(units - voxel * ((int64_t)1 << 32));
    }
}

static bool convert_metres(const double (*from)[3], karst_position *to, Py_ssize_t num, int voxel_log2_m)
{
    const double edge_m = ldexp(1, 62 + voxel_log2_m), voxels_per_m = ldexp(1, -voxel_log2_m);
    Py_ssize_t bad = -1;
    bool is_finite = true;
    Py_BEGIN_ALLOW_THREADS for (Py_ssize_t i = 0; i < num && bad < 0; i++)
    {
        if (fabs(from[i][0]) <= edge_m && fabs(from[i][1]) <= edge_m && fabs(from[i][2]) <= edge_m) {
            convert_one(from[i], &to[i], voxels_per_m, voxel_log2_m);
        } else {
            bad = i;
            is_finite = isfinite(from[i][0]) && isfinite(from[i][1]) && isfinite(from[i][2]);
        }
    }
    Py_END_ALLOW_THREADS return bad < 0 ||
        fail_position(bad, is_finite ? "lies beyond the world's edge" : "is not finite");
}

static bool convert_voxels(const int64_t (*from)[3], karst_position *to, Py_ssize_t num)
{
    const int64_t most = (int64_t)1 << 62;
    for (Py_ssize_t i = 0; i < num; i++) {
        for (int axis = 0; axis < 3; axis++)
            if (from[i][axis] > most || from[i][axis] < -most)
                return fail_position(i, "lies beyond the world's edge");
        to[i] = (karst_position){{from[i][0], from[i][1], from[i][2]}, {0, 0, 0}};
    }
    return true;
}

/* convert_positions(metres or voxels, is_metres, voxel_log2_m, positions) */
static PyObject *convert_positions(PyObject *module, PyObject *args)
{
    (void)module;
    Py_buffer from, to;
    int is_metres, voxel_log2_m;
    if (!PyArg_ParseTuple(args, "y*piw*", &from, &is_metres, &voxel_log2_m, &to))
        return NULL;
    const Py_ssize_t num = to.len / (Py_ssize_t)sizeof(karst_position);
    const bool done =
        check_size(&to, (size_t)num, sizeof(karst_position), "positions") &&
        check_size(&from, (size_t)num, 24, "points") &&
        (is_metres ? convert_metres(from.buf, to.buf, num, voxel_log2_m) : convert_voxels(from.buf, to.buf, num));
    PyBuffer_Release(&from);
    PyBuffer_Release(&to);
    if (!done)
        return NULL;
    Py_RETURN_NONE;
}

/* parse_position(x, y, z, voxel_log2_m) -> bytes */
static PyObject *parse_position(PyObject *module, PyObject *args)
{
    (void)module;
    const char *x, *y, *z;
    int voxel_log2_m;
    karst_position position;
    karst_error error = {0};
    if (!PyArg_ParseTuple(args, "sssi", &x, &y, &z, &voxel_log2_m))
        return NULL;
    memset(&position, 0, sizeof position);
    if (!karst_position_parse(x, y, z, voxel_log2_m, &position, &error))
        return raise_error(&error);
    return PyBytes_FromStringAndSize((const char *)&position, sizeof position);
}

/* format_coordinate(voxel, fraction, voxel_log2_m) -> decimal text */
static PyObject *format_coordinate(PyObject *module, PyObject *args)
{
    (void)module;
    long long voxel;
    unsigned int fraction;
    int voxel_log2_m;
    char text[160];
    if (!PyArg_ParseTuple(args, "LIi", &voxel, &fraction, &voxel_log2_m))
        return NULL;
    karst_coordinate_format(voxel, fraction, voxel_log2_m, text, sizeof text);
    return PyUnicode_FromString(text);
}

/* ---- paths ---- */

static void destroy_path(PyObject *capsule) { karst_path_destroy(PyCapsule_GetPointer(capsule, PATH_HANDLE)); }

/* path_load(name, voxel_log2_m) -> (handle, start_s, end_s, world, description) */
static PyObject *path_load(PyObject *module, PyObject *args)
{
    (void)module;
    const char *name;
    int voxel_log2_m;
    char file[PATH_MAX];
    karst_error error = {0};
    if (!PyArg_ParseTuple(args, "si", &name, &voxel_log2_m))
        return NULL;
    if (!karst_data_find("paths", name, ".json", file, sizeof file, &error))
        return raise_error(&error);
    karst_path *path = karst_path_load(file, voxel_log2_m, &error);
    if (!path)
        return raise_error(&error);
    PyObject *capsule = PyCapsule_New(path, PATH_HANDLE, destroy_path);
    if (!capsule) {
        karst_path_destroy(path);
        return NULL;
    }
    return Py_BuildValue("Nddzz", capsule, karst_path_start_s(path), karst_path_end_s(path), karst_path_world(path),
                         karst_path_description(path));
}

/* path_sample(path, time_s, voxel_log2_m) -> camera */
static PyObject *path_sample(PyObject *module, PyObject *args)
{
    (void)module;
    PyObject *capsule;
    double time_s;
    int voxel_log2_m;
    char text[512];
    if (!PyArg_ParseTuple(args, "Odi", &capsule, &time_s, &voxel_log2_m))
        return NULL;
    const karst_path *path = take_handle(capsule, PATH_HANDLE);
    if (!path)
        return NULL;
    const karst_camera camera = karst_path_sample(path, time_s);
    karst_camera_format(&camera, voxel_log2_m, text, sizeof text);
    return PyUnicode_FromString(text);
}

PyMethodDef world_methods[] = {{"world_open", world_open, METH_O, NULL},
                               {"world_metadata", world_metadata, METH_O, NULL},
                               {"world_check", world_check, METH_O, NULL},
                               {"world_try_code", world_try_code, METH_VARARGS, NULL},
                               {"data_list", data_list, METH_VARARGS, NULL},
                               {"convert_positions", convert_positions, METH_VARARGS, NULL},
                               {"parse_position", parse_position, METH_VARARGS, NULL},
                               {"format_coordinate", format_coordinate, METH_VARARGS, NULL},
                               {"path_load", path_load, METH_VARARGS, NULL},
                               {"path_sample", path_sample, METH_VARARGS, NULL},
                               {NULL, NULL, 0, NULL}};
