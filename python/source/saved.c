/* Saved worlds: karst/saved.h. */
#include "common.h"

#include <stdlib.h>
#include <string.h>

typedef struct {
    karst_saved *saved; /* NULL: closed */
    collector *said;
} handle;

static void destroy_saved(PyObject *capsule)
{
    handle *h = PyCapsule_GetPointer(capsule, SAVED_HANDLE);
    karst_saved_close(h->saved);
    collector_destroy(h->said);
    free(h);
}

static handle *take(PyObject *capsule)
{
    handle *h = take_handle(capsule, SAVED_HANDLE);
    if (h && h->saved)
        return h;
    if (h)
        PyErr_SetString(PyExc_ValueError, "the saved world is closed");
    return NULL;
}

static PyObject *none_or_error(bool done, const karst_error *error)
{
    if (!done)
        return raise_error(error);
    Py_RETURN_NONE;
}

/* saved_create(path, options) */
static PyObject *saved_create(PyObject *module, PyObject *args)
{
    (void)module;
    const char *path;
    PyObject *options;
    karst_saved_config config = {0};
    karst_parameter *parameters;
    karst_error error = {0};
    bool done;
    static const field fields[] = {{"world", FIELD_TEXT, offsetof(karst_saved_config, world)},
                                   {"embed", FIELD_BOOL, offsetof(karst_saved_config, embed)},
                                   {"camera", FIELD_TEXT, offsetof(karst_saved_config, camera)}};
    if (!PyArg_ParseTuple(args, "sO", &path, &options) || !take_fields(options, fields, 3, &config) ||
        !take_world_options(options, &parameters, &config.num_parameters, &config.has_seed, &config.seed))
        return NULL;
    config.parameters = parameters;
    Py_BEGIN_ALLOW_THREADS done = karst_saved_create(path, &config, &error);
    Py_END_ALLOW_THREADS PyMem_Free(parameters);
    return none_or_error(done, &error);
}

/* saved_open(path, for_writing) -> handle */
static PyObject *saved_open(PyObject *module, PyObject *args)
{
    (void)module;
    const char *path;
    int for_writing;
    karst_error error = {0};
    if (!PyArg_ParseTuple(args, "sp", &path, &for_writing))
        return NULL;
    handle *h = calloc(1, sizeof *h);
    if (!h)
        return PyErr_NoMemory();
    h->said = collector_create();
    if (h->said) {
        Py_BEGIN_ALLOW_THREADS h->saved = karst_saved_open(path, for_writing, collector_log(h->said), &error);
        Py_END_ALLOW_THREADS if (!h->saved) raise_error(&error);
    }
    PyObject *capsule = h->saved ? PyCapsule_New(h, SAVED_HANDLE, destroy_saved) : NULL;
    if (!capsule) {
        karst_saved_close(h->saved);
        collector_destroy(h->said);
        free(h);
    }
    return capsule;
}

static PyObject *saved_close(PyObject *module, PyObject *capsule)
{
    (void)module;
    handle *h = take_handle(capsule, SAVED_HANDLE);
    if (!h)
        return NULL;
    karst_saved_close(h->saved);
    h->saved = NULL;
    Py_RETURN_NONE;
}

static PyObject *saved_lines(PyObject *module, PyObject *capsule)
{
    (void)module;
    const handle *h = take_handle(capsule, SAVED_HANDLE);
    return h ? collector_take(h->said) : NULL;
}

static PyObject *list_facts(const karst_saved_about *about, PyObject **bookmarks)
{
    PyObject *parameters = PyList_New(0);
    *bookmarks = PyList_New(0);
    for (size_t i = 0; parameters && i < about->num_parameters; i++) {
        PyObject *pair = Py_BuildValue("(sd)", about->parameters[i].name, about->parameters[i].value);
        if (!pair || PyList_Append(parameters, pair) != 0)
            Py_CLEAR(parameters);
        Py_XDECREF(pair);
    }
    for (int i = 0; *bookmarks && i < KARST_SAVED_NUM_BOOKMARKS; i++) {
        PyObject *one = Py_BuildValue("z", about->bookmarks[i]);
        if (!one || PyList_Append(*bookmarks, one) != 0)
            Py_CLEAR(*bookmarks);
        Py_XDECREF(one);
    }
    if (parameters && *bookmarks)
        return parameters;
    Py_XDECREF(parameters);
    Py_CLEAR(*bookmarks);
    return NULL;
}

/* saved_about(saved) -> dict */
static PyObject *saved_about(PyObject *module, PyObject *capsule)
{
    (void)module;
    const handle *h = take(capsule);
    PyObject *bookmarks;
    const char *why_not = NULL;
    if (!h)
        return NULL;
    const karst_saved_about *about = karst_saved_get_about(h->saved);
    PyObject *parameters = list_facts(about, &bookmarks);
    const bool is_writable = karst_saved_is_writable(h->saved, &why_not);
    if (!parameters)
        return NULL;
    return Py_BuildValue("{s:i,s:z,s:z,s:z#,s:i,s:N,s:z,s:N,s:N,s:n,s:N}", "version", about->version, "made_by",
                         about->made_by, "world", about->world, "text", about->text, (Py_ssize_t)about->text_bytes,
                         "voxel_log2_m", about->voxel_log2_m, "seed",
                         about->has_seed ? PyLong_FromUnsignedLong(about->seed) : Py_NewRef(Py_None), "camera",
                         about->camera, "bookmarks", bookmarks, "parameters", parameters, "damaged",
                         (Py_ssize_t)about->num_damaged, "is_writable", PyBool_FromLong(is_writable));
}

/* saved_set_camera(saved, camera or None, number of a bookmark or -1) */
static PyObject *saved_set_camera(PyObject *module, PyObject *args)
{
    (void)module;
    PyObject *capsule;
    const char *camera;
    int bookmark;
    karst_error error = {0};
    if (!PyArg_ParseTuple(args, "Ozi", &capsule, &camera, &bookmark))
        return NULL;
    const handle *h = take(capsule);
    if (!h)
        return NULL;
    return none_or_error(bookmark < 0 ? karst_saved_set_camera(h->saved, camera, &error)
                                      : karst_saved_set_bookmark(h->saved, bookmark, camera, &error),
                         &error);
}

/* ---- edits ---- */

static PyObject *saved_num_edits(PyObject *module, PyObject *capsule)
{
    (void)module;
    const handle *h = take(capsule);
    size_t num_redoable = 0;
    if (!h)
        return NULL;
    const size_t num = karst_saved_num_edits(h->saved, &num_redoable);
    return Py_BuildValue("nn", (Py_ssize_t)num, (Py_ssize_t)num_redoable);
}

/* saved_append(saved, edits, voxel_log2_m) */
static PyObject *saved_append(PyObject *module, PyObject *args)
{
    (void)module;
    PyObject *capsule;
    Py_buffer edits;
    int voxel_log2_m;
    karst_error error = {0};
    bool done = false;
    if (!PyArg_ParseTuple(args, "Oy*i", &capsule, &edits, &voxel_log2_m))
        return NULL;
    const handle *h = take(capsule);
    const size_t num = (size_t)edits.len / sizeof(karst_edit);
    if (h && check_size(&edits, num, sizeof(karst_edit), "edits")) {
        done = karst_saved_append(h->saved, edits.buf, num, voxel_log2_m, &error);
        if (!done)
            raise_error(&error);
    }
    PyBuffer_Release(&edits);
    if (!done)
        return NULL;
    Py_RETURN_NONE;
}

static PyObject *step_edits(PyObject *args, bool (*step)(karst_saved *, size_t *, karst_error *))
{
    PyObject *capsule;
    Py_ssize_t most;
    karst_error error = {0};
    if (!PyArg_ParseTuple(args, "On", &capsule, &most))
        return NULL;
    const handle *h = take(capsule);
    size_t num = most > 0 ? (size_t)most : 0;
    if (!h)
        return NULL;
    if (!step(h->saved, &num, &error))
        return raise_error(&error);
    return PyLong_FromSize_t(num);
}

static PyObject *saved_undo(PyObject *module, PyObject *args)
{
    (void)module;
    return step_edits(args, karst_saved_undo);
}

static PyObject *saved_redo(PyObject *module, PyObject *args)
{
    (void)module;
    return step_edits(args, karst_saved_redo);
}

/* saved_edits(saved, voxel_log2_m) -> (edits, how many are lost) */
static PyObject *saved_edits(PyObject *module, PyObject *args)
{
    (void)module;
    PyObject *capsule;
    int voxel_log2_m;
    size_t num = 0, num_lost = 0;
    karst_error error = {0};
    if (!PyArg_ParseTuple(args, "Oi", &capsule, &voxel_log2_m))
        return NULL;
    const handle *h = take(capsule);
    if (!h)
        return NULL;
    karst_edit *edits = karst_saved_read_edits(h->saved, voxel_log2_m, &num, &num_lost, collector_log(h->said), &error);
    if (!edits)
        return raise_error(&error);
    PyObject *pair = Py_BuildValue("y#n", (const char *)edits, (Py_ssize_t)(num * sizeof *edits), (Py_ssize_t)num_lost);
    free(edits);
    return pair;
}

static PyObject *saved_commit(PyObject *module, PyObject *capsule)
{
    (void)module;
    const handle *h = take(capsule);
    karst_error error = {0};
    bool done;
    if (!h)
        return NULL;
    Py_BEGIN_ALLOW_THREADS done = karst_saved_commit(h->saved, &error);
    Py_END_ALLOW_THREADS return none_or_error(done, &error);
}

/* ---- care ---- */

static void append_line(void *user, const char *text)
{
    PyObject *line = PyUnicode_DecodeUTF8(text, (Py_ssize_t)strlen(text), "replace");
    if (line && !PyErr_Occurred())
        PyList_Append(user, line);
    Py_XDECREF(line);
}

/* saved_check(saved) -> a line for each thing that is wrong */
static PyObject *saved_check(PyObject *module, PyObject *capsule)
{
    (void)module;
    const handle *h = take(capsule);
    PyObject *lines = h ? PyList_New(0) : NULL;
    size_t num_wrong = 0;
    karst_error error = {0};
    if (lines && !karst_saved_check(h->saved, append_line, lines, &num_wrong, &error)) {
        Py_DECREF(lines);
        return raise_error(&error);
    }
    if (lines && PyErr_Occurred())
        Py_CLEAR(lines);
    return lines;
}

static PyObject *saved_compact(PyObject *module, PyObject *capsule)
{
    (void)module;
    const handle *h = take(capsule);
    karst_error error = {0};
    bool done;
    if (!h)
        return NULL;
    Py_BEGIN_ALLOW_THREADS done = karst_saved_compact(h->saved, &error);
    Py_END_ALLOW_THREADS return none_or_error(done, &error);
}

/* saved_backup(saved, path) */
static PyObject *saved_backup(PyObject *module, PyObject *args)
{
    (void)module;
    PyObject *capsule;
    const char *path;
    karst_error error = {0};
    bool done;
    if (!PyArg_ParseTuple(args, "Os", &capsule, &path))
        return NULL;
    const handle *h = take(capsule);
    if (!h)
        return NULL;
    Py_BEGIN_ALLOW_THREADS done = karst_saved_backup(h->saved, path, &error);
    Py_END_ALLOW_THREADS return none_or_error(done, &error);
}

/* saved_recover(path, new_path, world or None) -> lines that name what is lost */
static PyObject *saved_recover(PyObject *module, PyObject *args)
{
    (void)module;
    const char *path, *new_path, *world;
    karst_error error = {0};
    bool done;
    if (!PyArg_ParseTuple(args, "ssz", &path, &new_path, &world))
        return NULL;
    collector *said = collector_create();
    if (!said)
        return NULL;
    Py_BEGIN_ALLOW_THREADS done = karst_saved_recover(path, new_path, world, collector_log(said), &error);
    Py_END_ALLOW_THREADS PyObject *lines = done ? collector_take(said) : raise_error(&error);
    collector_destroy(said);
    return lines;
}

PyMethodDef saved_methods[] = {{"saved_create", saved_create, METH_VARARGS, NULL},
                               {"saved_open", saved_open, METH_VARARGS, NULL},
                               {"saved_close", saved_close, METH_O, NULL},
                               {"saved_lines", saved_lines, METH_O, NULL},
                               {"saved_about", saved_about, METH_O, NULL},
                               {"saved_set_camera", saved_set_camera, METH_VARARGS, NULL},
                               {"saved_num_edits", saved_num_edits, METH_O, NULL},
                               {"saved_append", saved_append, METH_VARARGS, NULL},
                               {"saved_undo", saved_undo, METH_VARARGS, NULL},
                               {"saved_redo", saved_redo, METH_VARARGS, NULL},
                               {"saved_edits", saved_edits, METH_VARARGS, NULL},
                               {"saved_commit", saved_commit, METH_O, NULL},
                               {"saved_check", saved_check, METH_O, NULL},
                               {"saved_compact", saved_compact, METH_O, NULL},
                               {"saved_backup", saved_backup, METH_VARARGS, NULL},
                               {"saved_recover", saved_recover, METH_VARARGS, NULL},
                               {NULL, NULL, 0, NULL}};
