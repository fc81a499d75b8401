#include "core/base/beside.h"

#include <stdio.h>
#include <string.h>

bool karst_path_beside(const char *file, const char *name, char path[KARST_BESIDE_BYTES], karst_error *error)
{
    const char *slash = strrchr(file, '/');
    size_t folder = *name == '/' || !slash ? 0 : (size_t)(slash + 1 - file), length = strlen(name);
    if (!length)
        return karst_fail(error, KARST_BAD_DATA, "a file has a name");
    if (folder + length >= KARST_BESIDE_BYTES)
        return karst_fail(error, KARST_BAD_DATA, "the path of %.100s is longer than %d bytes", name,
                          KARST_BESIDE_BYTES - 1);
    memcpy(path, file, folder);
    memcpy(path + folder, name, length + 1);
    return true;
}
