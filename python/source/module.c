/* The module, and what its parts share. */
#include "common.h"

#include <limits.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

PyObject *raise_error(const karst_error *error)
{
    PyObject *module = PyImport_ImportModule("karst.errors");
    PyObject *raise = module ? PyObject_GetAttrString(module, "of_status") : NULL;
    PyObject *text = PyUnicode_DecodeUTF8(error->message, (Py_ssize_t)strlen(error->message), "replace");
    PyObject *exception = raise && text ? PyObject_CallFunction(raise, "iO", (int)error->status, text) : NULL;
    if (exception)
        PyErr_SetObject((PyObject *)Py_TYPE(exception), exception);
    Py_XDECREF(exception);
    Py_XDECREF(text);
    Py_XDECREF(raise);
    Py_XDECREF(module);
    return NULL;
}

void *take_handle(PyObject *capsule, const char *kind)
{
    if (!PyCapsule_IsValid(capsule, kind)) {
        PyErr_Format(PyExc_TypeError, "not a %s", kind);
        return NULL;
    }
    return PyCapsule_GetPointer(capsule, kind);
}

/* ---- messages ---- */

/* Beyond these a library that talks without end is not kept. */
enum { MAX_LINES = 10000 };

typedef struct {
    karst_log_level level;
    char *text;
} line;

struct collector {
    karst_log log;
    pthread_mutex_t lock;
    line *lines;
    size_t num_lines, num_places;
};

static void collect(void *user, karst_log_level level, const char *text)
{
    collector *c = user;
    pthread_mutex_lock(&c->lock);
    if (c->num_lines == c->num_places && c->num_places < MAX_LINES) {
        const size_t num = c->num_places ? 2 * c->num_places : 16;
        line *more = realloc(c->lines, num * sizeof *more);
        if (more) {
            c->lines = more;
            c->num_places = num;
        }
    }
    if (c->num_lines < c->num_places) {
        char *copy = strdup(text);
        if (copy)
            c->lines[c->num_lines++] = (line){level, copy};
    }
    pthread_mutex_unlock(&c->lock);
}

collector *collector_create(void)
{
    collector *c = calloc(1, sizeof *c);
    if (!c) {
        PyErr_NoMemory();
        return NULL;
    }
    pthread_mutex_init(&c->lock, NULL);
    c->log = (karst_log){collect, c, KARST_LOG_INFO};
    return c;
}

void collector_destroy(collector *c)
{
    if (!c)
        return;
    for (size_t i = 0; i < c->num_lines; i++)
        free(c->lines[i].text);
    free(c->lines);
    pthread_mutex_destroy(&c->lock);
    free(c);
}

const karst_log *collector_log(collector *c) { return &c->log; }

PyObject *collector_take(collector *c)
{
    pthread_mutex_lock(&c->lock);
    line *lines = c->lines;
    const size_t num_lines = c->num_lines;
    c->lines = NULL;
    c->num_lines = c->num_places = 0;
    pthread_mutex_unlock(&c->lock);
    PyObject *list = PyList_New(0);
    for (size_t i = 0; i < num_lines; i++) {
        PyObject *text = PyUnicode_DecodeUTF8(lines[i].text, (Py_ssize_t)strlen(lines[i].text), "replace");
        PyObject *pair = text ? Py_BuildValue("iN", (int)lines[i].level, text) : NULL;
        if (list && (!pair || PyList_Append(list, pair) != 0))
            Py_CLEAR(list);
        Py_XDECREF(pair);
        free(lines[i].text);
    }
    free(lines);
    return list;
}

/* ---- long calls ---- */

static bool goes_on(PyObject *callback, double share)
{
    if (PyErr_CheckSignals() != 0)
        return false;
    if (callback == Py_None)
        return true;
    PyObject *answer = PyObject_CallFunction(callback, "d", share);
    const bool yes = answer && answer != Py_False;
    Py_XDECREF(answer);
    return yes;
}

bool watch_share(void *user, double share)
{
    watcher *w = user;
    PyEval_RestoreThread(w->thread);
    const bool yes = goes_on(w->callback, share);
    w->thread = PyEval_SaveThread();
    return yes;
}

void watch_begin(watcher *w, PyObject *callback)
{
    w->callback = callback;
    w->thread = PyEval_SaveThread();
}

bool watch_end(watcher *w, bool done, const karst_error *error)
{
    PyEval_RestoreThread(w->thread);
    if (PyErr_Occurred())
        return false;
    if (!done)
        raise_error(error);
    return done;
}

/* ---- arguments ---- */

static bool take_unsigned(PyObject *value, unsigned long long most, const char *name, unsigned long long *number)
{
    *number = PyLong_AsUnsignedLongLong(value);
    if (!PyErr_Occurred() && *number <= most)
        return true;
    PyErr_Clear();
    PyErr_Format(PyExc_ValueError, "%s: a whole number from 0 to %llu", name, most);
    return false;
}

static bool take_field(PyObject *value, const field *f, void *at)
{
    unsigned long long number = 0;
    switch (f->kind) {
    case FIELD_TEXT:
        *(const char **)at = PyUnicode_AsUTF8AndSize(value, NULL);
        break;
    case FIELD_INT:
        if (take_unsigned(value, INT_MAX, f->name, &number))
            *(int *)at = (int)number;
        break;
    case FIELD_UINT32:
        if (take_unsigned(value, UINT32_MAX, f->name, &number))
            *(uint32_t *)at = (uint32_t)number;
        break;
    case FIELD_UINT64:
        if (take_unsigned(value, UINT64_MAX, f->name, &number))
            *(uint64_t *)at = number;
        break;
    case FIELD_DOUBLE:
        *(double *)at = PyFloat_AsDouble(value);
        break;
    case FIELD_BOOL:
        *(bool *)at = PyObject_IsTrue(value) == 1;
        break;
    }
    return !PyErr_Occurred();
}

bool take_fields(PyObject *options, const field *fields, size_t num_fields, void *target)
{
    for (size_t i = 0; i < num_fields; i++) {
        PyObject *value = PyDict_GetItemString(options, fields[i].name);
        if (value && value != Py_None && !take_field(value, &fields[i], (char *)target + fields[i].offset))
            return false;
    }
    return true;
}

bool take_parameters(PyObject *pairs, karst_parameter **parameters, size_t *num_parameters)
{
    const Py_ssize_t num = PySequence_Size(pairs);
    *num_parameters = 0;
    *parameters = num < 0 ? NULL : PyMem_Calloc((size_t)num + 1, sizeof **parameters);
    if (!*parameters) {
        if (!PyErr_Occurred())
            PyErr_NoMemory();
        return false;
    }
    for (Py_ssize_t i = 0; i < num; i++) {
        karst_parameter *one = &(*parameters)[i];
        PyObject *pair = PySequence_GetItem(pairs, i);
        /* The list keeps the pair, and so the name. */
        const bool is_pair = pair && PyArg_ParseTuple(pair, "sd", &one->name, &one->value);
        Py_XDECREF(pair);
        if (!is_pair) {
            PyMem_Free(*parameters);
            *parameters = NULL;
            return false;
        }
    }
    *num_parameters = (size_t)num;
    return true;
}

bool take_world_options(PyObject *options, karst_parameter **parameters, size_t *num_parameters, bool *has_seed,
                        uint32_t *seed)
{
    PyObject *pairs = PyDict_GetItemString(options, "parameters"), *number = PyDict_GetItemString(options, "seed");
    *parameters = NULL;
    *num_parameters = 0;
    if (number && number != Py_None) {
        unsigned long long value;
        if (!take_unsigned(number, UINT32_MAX, "seed", &value))
            return false;
        *has_seed = true;
        *seed = (uint32_t)value;
    }
    return !pairs || take_parameters(pairs, parameters, num_parameters);
}

bool check_size(const Py_buffer *buffer, size_t num, size_t element_bytes, const char *name)
{
    if (num <= (size_t)PY_SSIZE_T_MAX / element_bytes && (size_t)buffer->len == num * element_bytes)
        return true;
    PyErr_Format(PyExc_ValueError, "%s: %zd bytes instead of %zu times %zu", name, buffer->len, num, element_bytes);
    return false;
}

/* ---- the module ---- */

static struct PyModuleDef definition = {
    .m_base = PyModuleDef_HEAD_INIT, .m_name = "_karst", .m_doc = "The functions of libkarst.", .m_size = -1};

PyMODINIT_FUNC PyInit__karst(void)
{
    PyObject *module = PyModule_Create(&definition);
    PyMethodDef *const parts[] = {world_methods,  query_methods,   edit_methods,
                                  engine_methods, picture_methods, saved_methods};
    for (size_t i = 0; module && i < sizeof parts / sizeof *parts; i++)
        if (PyModule_AddFunctions(module, parts[i]) != 0)
            Py_CLEAR(module);
    if (module && (PyModule_AddIntConstant(module, "POSITION_BYTES", sizeof(karst_position)) != 0 ||
                   PyModule_AddIntConstant(module, "EDIT_BYTES", sizeof(karst_edit)) != 0 ||
                   PyModule_AddStringConstant(module, "VERSION", karst_version()) != 0))
        Py_CLEAR(module);
    return module;
}
