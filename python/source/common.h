/* What the parts of the extension module share. The classes that people use are Python's own, in python/karst; here is
 * one function for each of the library's, on handles (capsules) and buffers. */
#ifndef KARST_PYTHON_COMMON_H
#define KARST_PYTHON_COMMON_H

#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030B0000
#include <Python.h>

#include <karst/karst.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Raises the exception that belongs to a status (karst.errors), with the library's message. Returns NULL. */
PyObject *raise_error(const karst_error *error);

/* What a handle holds; NULL with an exception set if it is closed or another kind's. */
void *take_handle(PyObject *capsule, const char *kind);

/* ---- messages ---- */

/* Collects what the library says, from any thread, without the interpreter: it is told afterwards. */
typedef struct collector collector;
collector *collector_create(void); /* NULL with an exception set */
void collector_destroy(collector *c);
const karst_log *collector_log(collector *c);
/* All lines since the last time: a list of (level, line). */
PyObject *collector_take(collector *c);

/* ---- long calls ---- */

/* A call that runs without the interpreter's lock, and now and then asks whether to go on: whether Ctrl-C was pressed,
 * and the caller's function, which may stop it by returning False. */
typedef struct {
    PyThreadState *thread;
    PyObject *callback; /* borrowed; None: nobody */
} watcher;

/* For the library's progress functions; `user` is the watcher, between watch_begin and watch_end. */
bool watch_share(void *user, double share);
void watch_begin(watcher *w, PyObject *callback);
/* Returns done, or false with an exception set: that of the signal or the callback, else the library's. */
bool watch_end(watcher *w, bool done, const karst_error *error);

/* ---- arguments ---- */

typedef enum { FIELD_TEXT, FIELD_INT, FIELD_UINT32, FIELD_UINT64, FIELD_DOUBLE, FIELD_BOOL } field_kind;
typedef struct {
    const char *name;
    field_kind kind;
    size_t offset;
} field;

/* Sets the fields of a struct that a dict names; texts are borrowed from it. Names that are not there are left alone.
 * false with an exception set. */
bool take_fields(PyObject *options, const field *fields, size_t num_fields, void *target);
/* An attribute "seed" and "parameters" (a list of (name, value)) of the dict. *parameters is to be freed. */
bool take_world_options(PyObject *options, karst_parameter **parameters, size_t *num_parameters, bool *has_seed,
                        uint32_t *seed);
/* A sequence of (name, value), allocated with PyMem_Malloc; names are borrowed from it. */
bool take_parameters(PyObject *pairs, karst_parameter **parameters, size_t *num_parameters);

/* Whether a buffer holds exactly num elements; else an exception is set. */
bool check_size(const Py_buffer *buffer, size_t num, size_t element_bytes, const char *name);

extern PyMethodDef world_methods[], query_methods[], edit_methods[], engine_methods[], picture_methods[],
    saved_methods[];

#define WORLD_HANDLE "karst.world"
#define ENGINE_HANDLE "karst.engine"
#define SAVED_HANDLE "karst.saved"
#define PATH_HANDLE "karst.path"

#endif
