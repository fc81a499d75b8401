/* Which world is meant: a path, a world that the library has, or a world file that comes with Karst. */
#include "command.h"

#include <stdlib.h>
#include <string.h>

#define MAX_WORLDS 64
#define SUFFIX ".karst"

/* All names, the library's first. */
static size_t list_worlds(char names[MAX_WORLDS][KARST_DATA_NAME_BYTES])
{
    size_t num_worlds = 0;
    const char *name;
    while (num_worlds < MAX_WORLDS && (name = karst_world_name(num_worlds)) != NULL)
        snprintf(names[num_worlds++], KARST_DATA_NAME_BYTES, "%s", name);
    size_t num_own = num_worlds;
    char files[MAX_WORLDS][KARST_DATA_NAME_BYTES];
    size_t num_files = karst_data_list("worlds", SUFFIX, files, MAX_WORLDS);
    for (size_t i = 0; i < num_files && num_worlds < MAX_WORLDS; i++) {
        bool known = false;
        for (size_t k = 0; k < num_own; k++)
            known = known || strcmp(names[k], files[i]) == 0;
        if (!known)
            memcpy(names[num_worlds++], files[i], KARST_DATA_NAME_BYTES);
    }
    return num_worlds;
}

bool command_find_world(const char *name, char *world, size_t size_bytes, karst_error *error)
{
    char names[MAX_WORLDS][KARST_DATA_NAME_BYTES];
    const char *pointers[MAX_WORLDS + 1] = {NULL};
    char list[1024] = "";
    size_t num_worlds = list_worlds(names);
    for (size_t i = 0; i < num_worlds; i++) {
        size_t length = strlen(list);
        snprintf(list + length, sizeof list - length, "%s%s", i ? ", " : "", names[i]);
        pointers[i] = names[i];
    }
    const char *own;
    for (size_t i = 0; (own = karst_world_name(i)) != NULL; i++)
        if (strcmp(own, name) == 0)
            return snprintf(world, size_bytes, "%s", name) > 0;
    if (karst_data_find("worlds", name, SUFFIX, world, size_bytes, NULL))
        return true;
    const char *nearest = command_nearest(name, pointers);
    if (nearest)
        return karst_fail(error, KARST_BAD_WORLD, "no world is called '%s'; did you mean '%s'? There are: %s", name,
                          nearest, list);
    return karst_fail(error, KARST_BAD_WORLD, "no world is called '%s'; there are: %s", name, list);
}

void command_print_worlds(FILE *file)
{
    char names[MAX_WORLDS][KARST_DATA_NAME_BYTES];
    size_t num_worlds = list_worlds(names);
    for (size_t i = 0; i < num_worlds; i++) {
        const char *description = karst_world_description(names[i]);
        fprintf(file, "  %-14s %s\n", names[i], description ? description : "a world file");
    }
}
