/* Edits as arrays of the library's structs, in bytes. */
#include "common.h"

#include <stdlib.h>
#include <string.h>

/* parse_edits(sequence of lines, voxel_log2_m) -> bytes */
static PyObject *parse_edits(PyObject *module, PyObject *args)
{
    (void)module;
    PyObject *lines;
    int voxel_log2_m;
    if (!PyArg_ParseTuple(args, "Oi", &lines, &voxel_log2_m))
        return NULL;
    const Py_ssize_t num = PySequence_Size(lines);
    if (num < 0)
        return NULL;
    karst_edit *edits = PyMem_Calloc((size_t)num + 1, sizeof *edits);
    if (!edits)
        return PyErr_NoMemory();
    bool done = true;
    for (Py_ssize_t i = 0; done && i < num; i++) {
        karst_error error = {0};
        PyObject *line = PySequence_GetItem(lines, i);
        const char *text = line ? PyUnicode_AsUTF8AndSize(line, NULL) : NULL;
        done = text;
        if (text && !karst_edit_parse(text, voxel_log2_m, &edits[i], &error)) {
            done = false;
            raise_error(&error);
        }
        Py_XDECREF(line);
    }
    PyObject *bytes = done ? PyBytes_FromStringAndSize((const char *)edits, num * (Py_ssize_t)sizeof *edits) : NULL;
    PyMem_Free(edits);
    return bytes;
}

/* load_edits(path, voxel_log2_m) -> bytes */
static PyObject *load_edits(PyObject *module, PyObject *args)
{
    (void)module;
    const char *path;
    int voxel_log2_m;
    size_t num = 0;
    karst_error error = {0};
    if (!PyArg_ParseTuple(args, "si", &path, &voxel_log2_m))
        return NULL;
    karst_edit *edits = karst_edits_load(path, voxel_log2_m, &num, &error);
    if (!edits)
        return raise_error(&error);
    PyObject *bytes = PyBytes_FromStringAndSize((const char *)edits, (Py_ssize_t)(num * sizeof *edits));
    free(edits);
    return bytes;
}

/* format_edits(bytes, voxel_log2_m) -> list of JSON objects, as texts */
static PyObject *format_edits(PyObject *module, PyObject *args)
{
    (void)module;
    Py_buffer buffer;
    int voxel_log2_m;
    if (!PyArg_ParseTuple(args, "y*i", &buffer, &voxel_log2_m))
        return NULL;
    const size_t num = (size_t)buffer.len / sizeof(karst_edit);
    const karst_edit *edits = buffer.buf;
    PyObject *list = check_size(&buffer, num, sizeof(karst_edit), "edits") ? PyList_New(0) : NULL;
    for (size_t i = 0; list && i < num; i++) {
        char text[2048];
        karst_edit_format(&edits[i], voxel_log2_m, text, sizeof text);
        PyObject *line = PyUnicode_FromString(text);
        if (!line || PyList_Append(list, line) != 0)
            Py_CLEAR(list);
        Py_XDECREF(line);
    }
    PyBuffer_Release(&buffer);
    return list;
}

PyMethodDef edit_methods[] = {{"parse_edits", parse_edits, METH_VARARGS, NULL},
                              {"load_edits", load_edits, METH_VARARGS, NULL},
                              {"format_edits", format_edits, METH_VARARGS, NULL},
                              {NULL, NULL, 0, NULL}};
