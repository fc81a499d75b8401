/* Engines. The classes above see to it that one thread at a time is here with one of them. */
#include "common.h"

#include <stdlib.h>
#include <string.h>

typedef struct {
    karst_engine *engine; /* NULL: closed */
    collector *said;
} handle;

static void destroy_engine(PyObject *capsule)
{
    handle *h = PyCapsule_GetPointer(capsule, ENGINE_HANDLE);
    karst_engine_destroy(h->engine);
    collector_destroy(h->said);
    free(h);
}

static handle *take(PyObject *capsule)
{
    handle *h = take_handle(capsule, ENGINE_HANDLE);
    if (h && h->engine)
        return h;
    if (h)
        PyErr_SetString(PyExc_ValueError, "the engine is closed");
    return NULL;
}

#define FIELD(name, kind)                                \
    {                                                    \
#name, kind, offsetof(karst_engine_config, name) \
    }
static const field fields[] = {FIELD(world, FIELD_TEXT),
                               FIELD(device, FIELD_TEXT),
                               FIELD(width_px, FIELD_INT),
                               FIELD(height_px, FIELD_INT),
                               FIELD(pool_bytes, FIELD_UINT64),
                               FIELD(brick_bits, FIELD_INT),
                               FIELD(safe_steps, FIELD_DOUBLE),
                               FIELD(detail_px, FIELD_DOUBLE),
                               FIELD(view_distance_m, FIELD_DOUBLE),
                               FIELD(budget_bricks, FIELD_UINT32),
                               FIELD(budget_ms, FIELD_DOUBLE),
                               FIELD(no_shadows, FIELD_BOOL),
                               FIELD(no_blend, FIELD_BOOL),
                               FIELD(refine, FIELD_BOOL),
                               FIELD(samples, FIELD_UINT32),
                               FIELD(exposure_stops, FIELD_DOUBLE),
                               FIELD(mirror, FIELD_DOUBLE),
                               FIELD(edits, FIELD_TEXT),
                               FIELD(lanes, FIELD_INT)};

/* What is an enumeration here is a word there. */
typedef struct {
    const char *display, *tone, *thin, *exposure;
} words;
static const field word_fields[] = {{"display", FIELD_TEXT, offsetof(words, display)},
                                    {"tone", FIELD_TEXT, offsetof(words, tone)},
                                    {"thin", FIELD_TEXT, offsetof(words, thin)},
                                    {"exposure", FIELD_TEXT, offsetof(words, exposure)}};

static bool take_words(const words *w, karst_engine_config *config, karst_error *error)
{
    static const char *const thins[] = {"auto", "always", "never"};
    if ((w->display && !karst_display_kind_parse(w->display, &config->display, error)) ||
        (w->tone && !karst_tone_parse(w->tone, &config->tone, error)))
        return false;
    for (int i = 0; w->thin && i < 3; i++) {
        if (strcmp(w->thin, thins[i]) == 0) {
            config->thin = (karst_thin)i;
            break;
        }
        if (i == 2)
            return karst_fail(error, KARST_USAGE, "thin: auto, always or never");
    }
    if (w->exposure && strcmp(w->exposure, "world") == 0)
        config->exposure = KARST_EXPOSURE_OF_WORLD;
    else if (w->exposure && strcmp(w->exposure, "auto") == 0)
        config->exposure = KARST_EXPOSURE_OF_PICTURE;
    else if (w->exposure && strcmp(w->exposure, "given") == 0)
        config->exposure = KARST_EXPOSURE_GIVEN;
    else if (w->exposure)
        return karst_fail(error, KARST_USAGE, "exposure: world, auto or a number of stops");
    return true;
}

static bool take_config(PyObject *options, karst_engine_config *config, karst_parameter **parameters)
{
    words w = {0};
    karst_error error = {0};
    *parameters = NULL;
    if (!PyDict_Check(options)) {
        PyErr_SetString(PyExc_TypeError, "options are a dict");
        return false;
    }
    PyObject *sun = PyDict_GetItemString(options, "sun");
    if (!take_fields(options, fields, sizeof fields / sizeof *fields, config) ||
        !take_fields(options, word_fields, sizeof word_fields / sizeof *word_fields, &w))
        return false;
    config->has_sun = sun && sun != Py_None;
    if (config->has_sun && !PyArg_ParseTuple(sun, "dd", &config->sun.azimuth_deg, &config->sun.elevation_deg))
        return false;
    if (!take_words(&w, config, &error)) {
        raise_error(&error);
        return false;
    }
    return take_world_options(options, parameters, &config->num_parameters, &config->has_seed, &config->seed);
}

/* engine_create(options) -> (handle or None, (status, message) or None, lines) */
static PyObject *engine_create(PyObject *module, PyObject *options)
{
    (void)module;
    karst_engine_config config = {0};
    karst_parameter *parameters;
    if (!take_config(options, &config, &parameters))
        return NULL;
    karst_error error = {0};
    handle *h = calloc(1, sizeof *h);
    config.parameters = parameters;
    if (h && (h->said = collector_create())) {
        config.log = collector_log(h->said);
        Py_BEGIN_ALLOW_THREADS karst_driver_begin(config.log);
        h->engine = karst_engine_create(&config, &error);
        Py_END_ALLOW_THREADS
    } else if (!PyErr_Occurred()) {
        PyErr_NoMemory();
    }
    PyMem_Free(parameters);
    PyObject *lines = h && h->said ? collector_take(h->said) : NULL;
    PyObject *capsule = lines && h->engine ? PyCapsule_New(h, ENGINE_HANDLE, destroy_engine) : NULL;
    if (!capsule && h) {
        karst_engine_destroy(h->engine);
        collector_destroy(h->said);
        free(h);
    }
    if (!capsule && (PyErr_Occurred() || !lines)) {
        Py_XDECREF(lines);
        return NULL;
    }
    if (!capsule)
        return Py_BuildValue("O(is)N", Py_None, (int)error.status, error.message, lines);
    return Py_BuildValue("NON", capsule, Py_None, lines);
}

/* engine_close(engine): gives device memory back; again is fine */
static PyObject *engine_close(PyObject *module, PyObject *capsule)
{
    (void)module;
    handle *h = take_handle(capsule, ENGINE_HANDLE);
    if (!h)
        return NULL;
    karst_engine *engine = h->engine;
    h->engine = NULL;
    Py_BEGIN_ALLOW_THREADS karst_engine_destroy(engine);
    Py_END_ALLOW_THREADS Py_RETURN_NONE;
}

/* engine_lines(engine) -> lines that it has said since */
static PyObject *engine_lines(PyObject *module, PyObject *capsule)
{
    (void)module;
    const handle *h = take_handle(capsule, ENGINE_HANDLE);
    return h ? collector_take(h->said) : NULL;
}

/* driver_end(): the run is over, as far as the driver's store goes */
static PyObject *driver_end(PyObject *module, PyObject *none)
{
    (void)module;
    (void)none;
    karst_driver_end();
    Py_RETURN_NONE;
}

/* ---- the view ---- */

static PyObject *camera_text(const handle *h, karst_camera camera)
{
    char text[512];
    karst_camera_format(&camera, karst_engine_voxel_log2_m(h->engine), text, sizeof text);
    return PyUnicode_FromString(text);
}

static PyObject *engine_camera(PyObject *module, PyObject *capsule)
{
    (void)module;
    const handle *h = take(capsule);
    return h ? camera_text(h, karst_engine_camera(h->engine)) : NULL;
}

static PyObject *engine_default_camera(PyObject *module, PyObject *capsule)
{
    (void)module;
    const handle *h = take(capsule);
    return h ? camera_text(h, karst_engine_default_camera(h->engine)) : NULL;
}

/* engine_set_camera(engine, text): what is left out stays as the world has it */
static PyObject *engine_set_camera(PyObject *module, PyObject *args)
{
    (void)module;
    PyObject *capsule;
    const char *text;
    if (!PyArg_ParseTuple(args, "Os", &capsule, &text))
        return NULL;
    const handle *h = take(capsule);
    if (!h)
        return NULL;
    karst_camera camera = karst_engine_default_camera(h->engine);
    karst_error error = {0};
    if (!karst_camera_parse(text, karst_engine_voxel_log2_m(h->engine), &camera, &error) ||
        !karst_engine_set_camera(h->engine, &camera, &error))
        return raise_error(&error);
    Py_RETURN_NONE;
}

/* engine_set_size(engine, width_px, height_px) */
static PyObject *engine_set_size(PyObject *module, PyObject *args)
{
    (void)module;
    PyObject *capsule;
    int width_px, height_px;
    if (!PyArg_ParseTuple(args, "Oii", &capsule, &width_px, &height_px))
        return NULL;
    const handle *h = take(capsule);
    karst_error error = {0};
    if (!h)
        return NULL;
    if (!karst_engine_set_size(h->engine, width_px, height_px, &error))
        return raise_error(&error);
    Py_RETURN_NONE;
}

static PyObject *engine_sun(PyObject *module, PyObject *capsule)
{
    (void)module;
    const handle *h = take(capsule);
    if (!h)
        return NULL;
    const karst_sun sun = karst_engine_get_sun(h->engine);
    return Py_BuildValue("dd", sun.azimuth_deg, sun.elevation_deg);
}

/* engine_set_sun(engine, (azimuth_deg, elevation_deg) or None) */
static PyObject *engine_set_sun(PyObject *module, PyObject *args)
{
    (void)module;
    PyObject *capsule, *angles;
    karst_sun sun = {0};
    if (!PyArg_ParseTuple(args, "OO", &capsule, &angles))
        return NULL;
    const handle *h = take(capsule);
    const bool is_own = angles != Py_None;
    karst_error error = {0};
    if (!h || (is_own && !PyArg_ParseTuple(angles, "dd", &sun.azimuth_deg, &sun.elevation_deg)))
        return NULL;
    if (!karst_engine_set_sun(h->engine, is_own ? &sun : NULL, &error))
        return raise_error(&error);
    Py_RETURN_NONE;
}

/* engine_time(engine) */
static PyObject *engine_time(PyObject *module, PyObject *capsule)
{
    (void)module;
    const handle *h = take(capsule);
    return h ? PyFloat_FromDouble(karst_engine_time(h->engine)) : NULL;
}

/* engine_set_time(engine, seconds) */
static PyObject *engine_set_time(PyObject *module, PyObject *args)
{
    (void)module;
    PyObject *capsule;
    double time_s;
    karst_error error = {0};
    if (!PyArg_ParseTuple(args, "Od", &capsule, &time_s))
        return NULL;
    const handle *h = take(capsule);
    if (!h)
        return NULL;
    if (!karst_engine_set_time(h->engine, time_s, &error))
        return raise_error(&error);
    Py_RETURN_NONE;
}

/* engine_set_budget_ms(engine, budget_ms) */
static PyObject *engine_set_budget_ms(PyObject *module, PyObject *args)
{
    (void)module;
    PyObject *capsule;
    double budget_ms;
    karst_error error = {0};
    if (!PyArg_ParseTuple(args, "Od", &capsule, &budget_ms))
        return NULL;
    const handle *h = take(capsule);
    if (!h)
        return NULL;
    if (!karst_engine_set_budget_ms(h->engine, budget_ms, &error))
        return raise_error(&error);
    Py_RETURN_NONE;
}

/* engine_set_view(engine, name) */
static PyObject *engine_set_view(PyObject *module, PyObject *args)
{
    (void)module;
    PyObject *capsule;
    const char *name;
    karst_view view;
    karst_error error = {0};
    if (!PyArg_ParseTuple(args, "Os", &capsule, &name))
        return NULL;
    const handle *h = take(capsule);
    if (!h)
        return NULL;
    if (!karst_view_parse(name, &view, &error) || !karst_engine_set_view(h->engine, view, &error))
        return raise_error(&error);
    Py_RETURN_NONE;
}

/* ---- parameters and edits ---- */

/* engine_set_parameters(engine, sequence of (name, value)) */
static PyObject *engine_set_parameters(PyObject *module, PyObject *args)
{
    (void)module;
    PyObject *capsule, *pairs;
    karst_parameter *parameters;
    size_t num;
    karst_error error = {0};
    bool done;
    if (!PyArg_ParseTuple(args, "OO", &capsule, &pairs))
        return NULL;
    const handle *h = take(capsule);
    if (!h || !take_parameters(pairs, &parameters, &num))
        return NULL;
    Py_BEGIN_ALLOW_THREADS done = karst_engine_set_parameters(h->engine, parameters, num, &error);
    Py_END_ALLOW_THREADS PyMem_Free(parameters);
    if (!done)
        return raise_error(&error);
    Py_RETURN_NONE;
}

/* engine_parameter(engine, name) -> value */
static PyObject *engine_parameter(PyObject *module, PyObject *args)
{
    (void)module;
    PyObject *capsule;
    const char *name;
    double value;
    karst_error error = {0};
    if (!PyArg_ParseTuple(args, "Os", &capsule, &name))
        return NULL;
    const handle *h = take(capsule);
    if (!h)
        return NULL;
    if (!karst_engine_parameter(h->engine, name, &value, &error))
        return raise_error(&error);
    return PyFloat_FromDouble(value);
}

/* engine_edit(engine, edits) */
static PyObject *engine_edit(PyObject *module, PyObject *args)
{
    (void)module;
    PyObject *capsule;
    Py_buffer edits;
    karst_error error = {0};
    bool done = false;
    if (!PyArg_ParseTuple(args, "Oy*", &capsule, &edits))
        return NULL;
    const handle *h = take(capsule);
    const size_t num = (size_t)edits.len / sizeof(karst_edit);
    if (h && check_size(&edits, num, sizeof(karst_edit), "edits")) {
        Py_BEGIN_ALLOW_THREADS done = karst_engine_edit(h->engine, edits.buf, num, &error);
        Py_END_ALLOW_THREADS if (!done) raise_error(&error);
    }
    PyBuffer_Release(&edits);
    if (!done)
        return NULL;
    Py_RETURN_NONE;
}

static PyObject *step_edits(PyObject *args, bool (*step)(karst_engine *, size_t *, karst_error *))
{
    PyObject *capsule;
    Py_ssize_t most;
    karst_error error = {0};
    bool done;
    if (!PyArg_ParseTuple(args, "On", &capsule, &most))
        return NULL;
    const handle *h = take(capsule);
    size_t num = most > 0 ? (size_t)most : 0;
    if (!h)
        return NULL;
    Py_BEGIN_ALLOW_THREADS done = step(h->engine, &num, &error);
    Py_END_ALLOW_THREADS if (!done) return raise_error(&error);
    return PyLong_FromSize_t(num);
}

static PyObject *engine_undo(PyObject *module, PyObject *args)
{
    (void)module;
    return step_edits(args, karst_engine_undo);
}

static PyObject *engine_redo(PyObject *module, PyObject *args)
{
    (void)module;
    return step_edits(args, karst_engine_redo);
}

/* engine_num_edits(engine) -> (in force, redoable) */
static PyObject *engine_num_edits(PyObject *module, PyObject *capsule)
{
    (void)module;
    const handle *h = take(capsule);
    size_t num_redoable = 0;
    if (!h)
        return NULL;
    const size_t num = karst_engine_num_edits(h->engine, &num_redoable);
    return Py_BuildValue("nn", (Py_ssize_t)num, (Py_ssize_t)num_redoable);
}

/* ---- frames ---- */

static void put(PyObject *dict, const char *name, PyObject *value)
{
    if (value && !PyErr_Occurred())
        PyDict_SetItemString(dict, name, value);
    Py_XDECREF(value);
}

static PyObject *describe_stats(const karst_stats *s)
{
    static const struct {
        const char *name;
        size_t offset;
    } numbers[] = {{"time_ns", offsetof(karst_stats, time_ns_frame)},
                   {"cpu_ns", offsetof(karst_stats, time_ns_cpu)},
                   {"production_ns", offsetof(karst_stats, time_ns_production)},
                   {"requests", offsetof(karst_stats, num_requests)},
                   {"produced", offsetof(karst_stats, num_produced)},
                   {"evicted", offsetof(karst_stats, num_evicted)},
                   {"reproduced", offsetof(karst_stats, num_reproduced)},
                   {"deferred", offsetof(karst_stats, num_deferred)},
                   {"tiles_produced", offsetof(karst_stats, num_tiles_produced)},
                   {"bricks_produced", offsetof(karst_stats, num_bricks_produced)},
                   {"bricks_constant", offsetof(karst_stats, num_bricks_constant)},
                   {"pixels", offsetof(karst_stats, num_pixels)},
                   {"hits", offsetof(karst_stats, num_hits)},
                   {"provisional", offsetof(karst_stats, num_provisional)},
                   {"incomplete", offsetof(karst_stats, num_incomplete)},
                   {"coarser", offsetof(karst_stats, num_coarser)},
                   {"bricks_used", offsetof(karst_stats, bricks.num_used)},
                   {"bricks_total", offsetof(karst_stats, bricks.num_total)},
                   {"bricks_resident", offsetof(karst_stats, num_resident_bricks)},
                   {"tiles_used", offsetof(karst_stats, tiles.num_used)},
                   {"tiles_total", offsetof(karst_stats, tiles.num_total)}};
    PyObject *dict = PyDict_New(), *stages = PyDict_New(), *memory = PyDict_New();
    if (dict && stages && memory) {
        for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
            uint64_t number;
            memcpy(&number, (const char *)s + numbers[i].offset, sizeof number);
            put(dict, numbers[i].name, PyLong_FromUnsignedLongLong(number));
        }
        for (int i = 0; i < KARST_NUM_STAGES; i++)
            put(stages, karst_stage_name((karst_stage)i), PyLong_FromUnsignedLongLong(s->time_ns[i]));
        for (size_t i = 0; i < s->num_memory; i++)
            put(memory, s->memory[i].name, PyLong_FromUnsignedLongLong(s->memory[i].size_bytes));
        put(dict, "device", PyUnicode_FromString(s->device));
        put(dict, "frame", PyLong_FromUnsignedLong(s->frame));
        put(dict, "settled", PyBool_FromLong(s->settled));
        put(dict, "samples", PyLong_FromUnsignedLong(s->num_samples));
        put(dict, "detail_asked_px", PyFloat_FromDouble(s->detail_asked_px));
        put(dict, "detail_given_px", PyFloat_FromDouble(s->detail_given_px));
        put(dict, "stages_ns", Py_NewRef(stages));
        put(dict, "memory_bytes", Py_NewRef(memory));
    }
    Py_XDECREF(stages);
    Py_XDECREF(memory);
    if (PyErr_Occurred())
        Py_CLEAR(dict);
    return dict;
}

static PyObject *engine_stats(PyObject *module, PyObject *capsule)
{
    (void)module;
    const handle *h = take(capsule);
    karst_stats stats;
    if (!h)
        return NULL;
    karst_engine_stats(h->engine, &stats);
    return describe_stats(&stats);
}

static bool watch_frame(void *user, const karst_stats *stats)
{
    watcher *w = user;
    PyEval_RestoreThread(w->thread);
    bool yes = PyErr_CheckSignals() == 0;
    if (yes && w->callback != Py_None) {
        PyObject *dict = describe_stats(stats), *answer = dict ? PyObject_CallFunction(w->callback, "O", dict) : NULL;
        yes = answer && answer != Py_False;
        Py_XDECREF(answer);
        Py_XDECREF(dict);
    }
    w->thread = PyEval_SaveThread();
    return yes;
}

static PyObject *engine_frame(PyObject *module, PyObject *capsule)
{
    (void)module;
    const handle *h = take(capsule);
    karst_error error = {0};
    bool done;
    if (!h)
        return NULL;
    Py_BEGIN_ALLOW_THREADS done = karst_engine_frame(h->engine, &error);
    Py_END_ALLOW_THREADS if (!done) return raise_error(&error);
    Py_RETURN_NONE;
}

/* engine_settle(engine, max_frames, progress) -> whether it is settled */
static PyObject *engine_settle(PyObject *module, PyObject *args)
{
    (void)module;
    PyObject *capsule, *progress;
    unsigned int max_frames;
    watcher w;
    karst_error error = {0};
    bool settled = false;
    if (!PyArg_ParseTuple(args, "OIO", &capsule, &max_frames, &progress))
        return NULL;
    const handle *h = take(capsule);
    if (!h)
        return NULL;
    watch_begin(&w, progress);
    const bool done = karst_engine_settle(h->engine, max_frames, watch_frame, &w, &settled, &error);
    return watch_end(&w, done, &error) ? PyBool_FromLong(settled) : NULL;
}

/* engine_read(engine, "colour" or the name of an AOV, buffer) */
static PyObject *engine_read(PyObject *module, PyObject *args)
{
    (void)module;
    PyObject *capsule;
    const char *name;
    Py_buffer buffer;
    karst_aov aov = KARST_AOV_DEPTH;
    karst_error error = {0};
    bool done = false;
    if (!PyArg_ParseTuple(args, "Osw*", &capsule, &name, &buffer))
        return NULL;
    const handle *h = take(capsule);
    const bool is_colour = strcmp(name, "colour") == 0;
    if (h && !is_colour && !karst_aov_parse(name, &aov, &error)) {
        raise_error(&error);
    } else if (h) {
        Py_BEGIN_ALLOW_THREADS done =
            is_colour ? karst_engine_read_pixels(h->engine, buffer.buf, (size_t)buffer.len, &error)
                      : karst_engine_read_aov(h->engine, aov, buffer.buf, (size_t)buffer.len / sizeof(float), &error);
        Py_END_ALLOW_THREADS if (!done) raise_error(&error);
    }
    PyBuffer_Release(&buffer);
    if (!done)
        return NULL;
    Py_RETURN_NONE;
}

/* engine_check(engine): looks over the pools */
static PyObject *engine_check(PyObject *module, PyObject *capsule)
{
    (void)module;
    const handle *h = take(capsule);
    karst_error error = {0};
    if (!h)
        return NULL;
    if (!karst_engine_check(h->engine, &error))
        return raise_error(&error);
    Py_RETURN_NONE;
}

PyMethodDef engine_methods[] = {{"engine_create", engine_create, METH_O, NULL},
                                {"engine_close", engine_close, METH_O, NULL},
                                {"engine_lines", engine_lines, METH_O, NULL},
                                {"driver_end", driver_end, METH_NOARGS, NULL},
                                {"engine_camera", engine_camera, METH_O, NULL},
                                {"engine_default_camera", engine_default_camera, METH_O, NULL},
                                {"engine_set_camera", engine_set_camera, METH_VARARGS, NULL},
                                {"engine_set_size", engine_set_size, METH_VARARGS, NULL},
                                {"engine_sun", engine_sun, METH_O, NULL},
                                {"engine_set_sun", engine_set_sun, METH_VARARGS, NULL},
                                {"engine_time", engine_time, METH_O, NULL},
                                {"engine_set_time", engine_set_time, METH_VARARGS, NULL},
                                {"engine_set_budget_ms", engine_set_budget_ms, METH_VARARGS, NULL},
                                {"engine_set_view", engine_set_view, METH_VARARGS, NULL},
                                {"engine_set_parameters", engine_set_parameters, METH_VARARGS, NULL},
                                {"engine_parameter", engine_parameter, METH_VARARGS, NULL},
                                {"engine_edit", engine_edit, METH_VARARGS, NULL},
                                {"engine_undo", engine_undo, METH_VARARGS, NULL},
                                {"engine_redo", engine_redo, METH_VARARGS, NULL},
                                {"engine_num_edits", engine_num_edits, METH_O, NULL},
                                {"engine_stats", engine_stats, METH_O, NULL},
                                {"engine_frame", engine_frame, METH_O, NULL},
                                {"engine_settle", engine_settle, METH_VARARGS, NULL},
                                {"engine_read", engine_read, METH_VARARGS, NULL},
                                {"engine_check", engine_check, METH_O, NULL},
                                {NULL, NULL, 0, NULL}};
