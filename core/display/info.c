/* What there is to work with, for people: everything is tried, nothing is assumed. */
#include "karst/engine.h"

#include "core/device/context.h"
#include "core/display/display_platform.h"
#include "karst/image.h"

#include <jansson.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

#ifndef KARST_VERSION
#error "KARST_VERSION comes from the Makefile"
#endif

#ifdef __clang__
#define COMPILER "clang " __clang_version__
#else
#define COMPILER "gcc " __VERSION__
#endif

typedef struct {
    void (*print)(void *user, const char *line);
    void *user;
} printer;

__attribute__((format(printf, 2, 3))) static void say(const printer *to, const char *format, ...)
{
    char line[1280];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    to->print(to->user, line);
}

static double gib(size_t size_bytes) { return (double)size_bytes / (1024.0 * 1024.0 * 1024.0); }

static void say_device(const printer *to, const karst_device_info *device, bool is_default)
{
    say(to, "  %d  %s (%s, %s, driver %s, %s)%s", device->index, device->name, device->type, device->version,
        device->driver, device->platform_name, is_default ? ", the default" : "");
    if (device->unusable) {
        say(to, "     cannot be used: %s", device->unusable);
        return;
    }
    say(to, "     %d compute units, %.1f GiB of memory, largest buffer %.1f GiB, work-groups to %zu",
        device->compute_units, gib(device->global_memory_bytes), gib(device->max_allocation_bytes),
        device->max_work_group);
    say(to, "     %s; pictures reach OpenGL %s",
        device->exact_floats
            ? "float arithmetic is exact: worlds have the bits that other devices give them"
            : "float arithmetic is not exact: worlds may differ from other devices' in their last bits",
        device->is_cpu           ? "without a copy"
        : device->has_gl_sharing ? "without a copy where it drives the display, else by one copy"
                                 : "by one copy");
}

static void say_devices(const printer *to)
{
    karst_error error = {0};
    size_t num_devices = 0;
    say(to, "devices (--device takes the number, a part of the name, cpu or gpu):");
    karst_device_info *devices = karst_context_list(&num_devices, &error);
    if (!devices) {
        say(to, "  none: %s", error.message);
        return;
    }
    karst_context *chosen = karst_context_create(NULL, 0, NULL, &error);
    for (size_t i = 0; i < num_devices; i++)
        say_device(to, &devices[i], chosen && devices[i].device == chosen->device);
    if (!chosen)
        say(to, "  none of them opens: %s", error.message);
    karst_context_destroy(chosen);
    free(devices);
}

/* Opens each display; the first that opens is what "auto" takes. */
static void say_displays(const printer *to)
{
    int first = -1;
    say(to, "displays (--display):");
    for (int kind = KARST_DISPLAY_EGL; kind <= KARST_DISPLAY_NONE; kind++) {
        const char *name = karst_display_kind_name((karst_display_kind)kind);
        karst_error error = {0};
        karst_display *display = karst_display_create((karst_display_kind)kind, NULL, &error);
        if (!display) {
            say(to, "  %-7s missing: %s", name, error.message);
            continue;
        }
        const char *by_default = first < 0 ? ", the default" : "";
        if (kind == KARST_DISPLAY_NONE)
            say(to, "  %-7s pictures are read from the device%s", name, by_default);
        else
            say(to, "  %-7s %s, pictures to %d x %d%s", name, karst_display_description(display),
                display->max_texture_px, display->max_texture_px, by_default);
        first = first < 0 ? kind : first;
        karst_display_destroy(display);
    }
}

void karst_info(void (*print)(void *user, const char *line), void *user)
{
    const printer to = {print, user};
#ifdef KARST_BUILD_FLAGS
    say(&to, "libkarst %s, compiled by %s, %s", KARST_VERSION, COMPILER, KARST_BUILD_FLAGS);
#else
    say(&to, "libkarst %s, compiled by %s", KARST_VERSION, COMPILER);
#endif
    const char *kernels = getenv("KARST_KERNEL_DIR");
    if (kernels && *kernels)
        say(&to, "kernels: from %s (KARST_KERNEL_DIR), else those inside the library", kernels);
    say_devices(&to);
    say_displays(&to);
    say(&to,
        "limits: pictures of %d x %d pixels; pools may be larger than a device's largest buffer; positions to 2^62 "
        "voxels",
        KARST_IMAGE_MAX_PX, KARST_IMAGE_MAX_PX);
}

/* ---- for programs ---- */

static json_t *describe_devices(json_t *root)
{
    karst_error error = {0};
    size_t num_devices = 0;
    json_t *all = json_array();
    karst_device_info *devices = karst_context_list(&num_devices, &error);
    karst_context *chosen = devices ? karst_context_create(NULL, 0, NULL, &error) : NULL;
    for (size_t i = 0; i < num_devices; i++) {
        const karst_device_info *d = &devices[i];
        json_array_append_new(
            all, json_pack("{s:i, s:s, s:s, s:s, s:s, s:s, s:i, s:I, s:I, s:I, s:b, s:b, s:b, s:s?}", "index", d->index,
                           "name", d->name, "type", d->type, "version", d->version, "driver", d->driver, "platform",
                           d->platform_name, "compute_units", d->compute_units, "memory_bytes",
                           (json_int_t)d->global_memory_bytes, "largest_buffer_bytes",
                           (json_int_t)d->max_allocation_bytes, "largest_work_group", (json_int_t)d->max_work_group,
                           "exact_floats", d->exact_floats, "shares_opengl", d->has_gl_sharing, "default",
                           chosen && d->device == chosen->device, "unusable", d->unusable));
    }
    if (error.status != KARST_OK)
        json_object_set_new(root, "devices_error", json_string(error.message));
    karst_context_destroy(chosen);
    free(devices);
    return all;
}

static json_t *describe_displays(void)
{
    json_t *all = json_array();
    bool is_first = true;
    for (int kind = KARST_DISPLAY_EGL; kind <= KARST_DISPLAY_NONE; kind++) {
        karst_error error = {0};
        karst_display *display = karst_display_create((karst_display_kind)kind, NULL, &error);
        json_t *one = json_pack("{s:s, s:b, s:b}", "name", karst_display_kind_name((karst_display_kind)kind), "works",
                                display != NULL, "default", display && is_first);
        if (!display)
            json_object_set_new(one, "why_not", json_string(error.message));
        else if (kind != KARST_DISPLAY_NONE)
            json_object_set_new(one, "description", json_string(karst_display_description(display)));
        is_first = is_first && !display;
        json_array_append_new(all, one);
        karst_display_destroy(display);
    }
    return all;
}

char *karst_info_json(void)
{
    json_t *root = json_pack("{s:s, s:s}", "version", KARST_VERSION, "compiler", COMPILER);
    if (!root)
        return NULL;
#ifdef KARST_BUILD_FLAGS
    json_object_set_new(root, "flags", json_string(KARST_BUILD_FLAGS));
#endif
    json_object_set_new(root, "devices", describe_devices(root));
    json_object_set_new(root, "displays", describe_displays());
    json_object_set_new(root, "largest_picture_px", json_integer(KARST_IMAGE_MAX_PX));
    char *text = json_dumps(root, JSON_INDENT(2));
    json_decref(root);
    return text;
}

const char *karst_version(void) { return KARST_VERSION; }
