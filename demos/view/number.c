/* Names of files that are not there yet, numbered. */
#include "demos/view/view.h"

#include <string.h>
#include <unistd.h>

#define MAX_NUMBERED 100000

/* The world's name as part of a file's: without folders and suffix. */
static void short_name(const viewer *v, char *name, size_t size_bytes)
{
    const char *slash = strrchr(v->world, '/');
    snprintf(name, size_bytes, "%s", slash ? slash + 1 : v->world);
    char *point = strrchr(name, '.');
    if (point && point != name)
        *point = 0;
}

/* The first of FOLDER/karst-WORLD-001.SUFFIX, -002, ... that is not there yet; instead of the world's another name. */
static bool number_named(const viewer *v, const char *name, const char *suffix, char path[PATH_MAX],
                         karst_error *error)
{
    for (int i = 1; i < MAX_NUMBERED; i++) {
        int length = snprintf(path, PATH_MAX, "%s/karst-%s-%03d.%s", v->settings.folder, name, i, suffix);
        if (length < 0 || length >= PATH_MAX)
            return karst_fail(error, KARST_FAILED, "the name of the folder %.60s... is too long", v->settings.folder);
        if (access(path, F_OK) != 0)
            return true;
    }
    return karst_fail(error, KARST_FAILED, "%s is full of pictures", v->settings.folder);
}

bool view_number_file(const viewer *v, const char *suffix, char path[PATH_MAX], karst_error *error)
{
    char name[128];
    short_name(v, name, sizeof name);
    return number_named(v, name, suffix, path, error);
}

bool view_statistics_number(viewer *v, char path[PATH_MAX], karst_error *error)
{
    return number_named(v, "statistics", "json", path, error);
}
