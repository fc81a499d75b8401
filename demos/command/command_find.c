/* Which file is meant: what comes with Karst goes by its name, and everything else by a path. */
#include "command.h"

#include <string.h>

#define MAX_NAMES 64

/* `kind` as karst_data_find takes it, `one` of it as people say it. */
static bool find(const char *kind, const char *one, const char *suffix, karst_status otherwise, const char *name,
                 char *path, size_t size_bytes, karst_error *error)
{
    if (karst_data_find(kind, name, suffix, path, size_bytes, NULL))
        return true;
    char names[MAX_NAMES][KARST_DATA_NAME_BYTES], list[MAX_NAMES * (KARST_DATA_NAME_BYTES + 2)] = "none";
    const char *pointers[MAX_NAMES + 1] = {NULL};
    size_t num_names = karst_data_list(kind, suffix, names, MAX_NAMES);
    for (size_t i = 0, length = 0; i < num_names; length = strlen(list), i++) {
        snprintf(list + length, sizeof list - length, "%s%s", i ? ", " : "", names[i]);
        pointers[i] = names[i];
    }
    const char *nearest = command_nearest(name, pointers);
    char suggestion[KARST_DATA_NAME_BYTES + 32] = "there";
    if (nearest)
        snprintf(suggestion, sizeof suggestion, "did you mean '%s'? There", nearest);
    return karst_fail(error, otherwise, "no %s is called '%.60s' (a file's name has a / or ends in %s); %s are: %s",
                      one, name, suffix, suggestion, list);
}

bool command_find_world(const char *name, char *world, size_t size_bytes, karst_error *error)
{
    if (strcmp(name, "-") == 0)
        return command_read_stdin(world, size_bytes, error);
    if (karst_saved_is_name(name))
        return karst_fail(error, KARST_USAGE, "%s: a saved world cannot be used for this; its world can", name);
    return find("worlds", "world", ".karst", KARST_BAD_WORLD, name, world, size_bytes, error);
}

bool command_find_path(const char *name, char *path, size_t size_bytes, karst_error *error)
{
    return find("paths", "path", ".json", KARST_BAD_DATA, name, path, size_bytes, error);
}
