/* Pictures on disk, and what is told of the machine. */
#include "common.h"

#include <stdlib.h>

/* write_png(path, rgba, width_px, height_px) */
static PyObject *write_png(PyObject *module, PyObject *args)
{
    (void)module;
    const char *path;
    Py_buffer rgba;
    int width_px, height_px;
    karst_error error = {0};
    bool done = false;
    if (!PyArg_ParseTuple(args, "sy*ii", &path, &rgba, &width_px, &height_px))
        return NULL;
    const bool is_whole = width_px < 1 || height_px < 1 || width_px > KARST_IMAGE_MAX_PX ||
                          height_px > KARST_IMAGE_MAX_PX ||
                          check_size(&rgba, (size_t)width_px * (size_t)height_px, 4, "pixels");
    if (is_whole) {
        Py_BEGIN_ALLOW_THREADS done = karst_image_write_png(path, rgba.buf, width_px, height_px, &error);
        Py_END_ALLOW_THREADS if (!done) raise_error(&error);
    }
    PyBuffer_Release(&rgba);
    if (!done)
        return NULL;
    Py_RETURN_NONE;
}

static bool take_channel(PyObject *item, karst_image_channel *channel, Py_buffer *buffer, size_t num_pixels)
{
    int at, width;
    if (!PyArg_ParseTuple(item, "sy*ii", &channel->name, buffer, &at, &width))
        return false;
    channel->values = (const float *)buffer->buf + at;
    channel->stride = width;
    if (at >= 0 && at < width && check_size(buffer, num_pixels * (size_t)width, sizeof(float), channel->name))
        return true;
    if (!PyErr_Occurred())
        PyErr_SetString(PyExc_ValueError, "no such channel");
    PyBuffer_Release(buffer);
    return false;
}

/* write_exr(path, sequence of (name, floats, place in a pixel, floats of a pixel), width_px, height_px) */
static PyObject *write_exr(PyObject *module, PyObject *args)
{
    (void)module;
    const char *path;
    PyObject *list;
    int width_px, height_px, num_taken = 0;
    karst_error error = {0};
    karst_image_channel channels[KARST_IMAGE_MAX_CHANNELS];
    Py_buffer buffers[KARST_IMAGE_MAX_CHANNELS];
    if (!PyArg_ParseTuple(args, "sOii", &path, &list, &width_px, &height_px))
        return NULL;
    const Py_ssize_t num = PySequence_Size(list);
    bool done = num >= 0;
    if (num > KARST_IMAGE_MAX_CHANNELS || width_px < 1 || height_px < 1) {
        PyErr_Format(PyExc_ValueError, "1 to %d channels of at least one pixel", KARST_IMAGE_MAX_CHANNELS);
        done = false;
    }
    for (; done && num_taken < num; num_taken++) {
        PyObject *item = PySequence_GetItem(list, num_taken);
        done =
            item && take_channel(item, &channels[num_taken], &buffers[num_taken], (size_t)width_px * (size_t)height_px);
        Py_XDECREF(item);
        if (!done)
            break;
    }
    if (done) {
        Py_BEGIN_ALLOW_THREADS done =
            karst_image_write_channels(path, channels, num_taken, width_px, height_px, &error);
        Py_END_ALLOW_THREADS if (!done) raise_error(&error);
    }
    while (num_taken--)
        PyBuffer_Release(&buffers[num_taken]);
    if (!done)
        return NULL;
    Py_RETURN_NONE;
}

/* aov_channels(name) -> names of its channels */
static PyObject *aov_channels(PyObject *module, PyObject *text)
{
    (void)module;
    karst_aov aov;
    karst_error error = {0};
    const char *name = PyUnicode_AsUTF8AndSize(text, NULL);
    if (!name)
        return NULL;
    if (!karst_aov_parse(name, &aov, &error))
        return raise_error(&error);
    if (karst_aov_width(aov) == 1)
        return Py_BuildValue("(s)", karst_aov_channel(aov, 0));
    return Py_BuildValue("(sss)", karst_aov_channel(aov, 0), karst_aov_channel(aov, 1), karst_aov_channel(aov, 2));
}

/* info() -> JSON */
static PyObject *info(PyObject *module, PyObject *none)
{
    (void)module;
    (void)none;
    char *json;
    Py_BEGIN_ALLOW_THREADS json = karst_info_json();
    Py_END_ALLOW_THREADS PyObject *text = json ? PyUnicode_FromString(json) : PyErr_NoMemory();
    free(json);
    return text;
}

PyMethodDef picture_methods[] = {{"write_png", write_png, METH_VARARGS, NULL},
                                 {"write_exr", write_exr, METH_VARARGS, NULL},
                                 {"aov_channels", aov_channels, METH_O, NULL},
                                 {"info", info, METH_NOARGS, NULL},
                                 {NULL, NULL, 0, NULL}};
