/* Which world is meant: a path, or a world file that comes with Karst. */
#include "command.h"

#include <stdlib.h>
#include <string.h>

#define MAX_WORLDS 64
#define SUFFIX ".karst"

bool command_find_world(const char *name, char *world, size_t size_bytes, karst_error *error)
{
    char names[MAX_WORLDS][KARST_DATA_NAME_BYTES];
    const char *pointers[MAX_WORLDS + 1] = {NULL};
    char list[1024] = "";
    size_t num_worlds = karst_data_list("worlds", SUFFIX, names, MAX_WORLDS);
    for (size_t i = 0; i < num_worlds; i++) {
        size_t length = strlen(list);
        snprintf(list + length, sizeof list - length, "%s%s", i ? ", " : "", names[i]);
        pointers[i] = names[i];
    }
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
    size_t num_worlds = karst_data_list("worlds", SUFFIX, names, MAX_WORLDS);
    for (size_t i = 0; i < num_worlds; i++) {
        const karst_world_config config = {.world = names[i]};
        karst_world *world = karst_world_open(&config, NULL);
        fprintf(file, "  %-14s %s\n", names[i], world ? karst_world_get_metadata(world)->description : "");
        karst_world_close(world);
    }
}
