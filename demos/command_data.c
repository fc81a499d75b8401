/* Files that come with Karst: found beside the program, installed or in its source tree. */
#include "command.h"

#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* FOLDER/kind/name+suffix, if it can be read. */
static bool try_folder(const char *folder, const char *kind, const char *name, const char *suffix, char *path,
                       size_t size_bytes)
{
    int length = snprintf(path, size_bytes, "%s/%s/%s%s", folder, kind, name, suffix);
    return length > 0 && (size_t)length < size_bytes && access(path, R_OK) == 0;
}

bool command_find_data(const char *kind, const char *name, const char *suffix, char *path, size_t size_bytes,
                       karst_error *error)
{
    size_t name_length = strlen(name), suffix_length = strlen(suffix);
    bool has_suffix = name_length > suffix_length && strcmp(name + name_length - suffix_length, suffix) == 0;
    if (strchr(name, '/') || has_suffix) {
        int length = snprintf(path, size_bytes, "%s", name);
        return (size_t)length < size_bytes || karst_fail(error, KARST_USAGE, "'%.60s...': the name is too long", name);
    }
    const char *folder = getenv("KARST_DATA_DIR");
    if (folder && *folder && try_folder(folder, kind, name, suffix, path, size_bytes))
        return true;
    char beside[PATH_MAX];
    ssize_t length = readlink("/proc/self/exe", beside, sizeof beside - 1);
    if (length > 0) {
        static const char *const folders[] = {"/../share/karst", "/../demos"};
        beside[length] = '\0';
        char *slash = strrchr(beside, '/');
        for (size_t i = 0; slash && i < sizeof folders / sizeof *folders; i++) {
            if (slash + strlen(folders[i]) >= beside + sizeof beside)
                continue;
            strcpy(slash, folders[i]);
            if (try_folder(beside, kind, name, suffix, path, size_bytes))
                return true;
        }
    }
    return karst_fail(error, KARST_BAD_DATA,
                      "no %.*s called '%s' comes with Karst; a file's name ends in %s, and KARST_DATA_DIR says where "
                      "else to look",
                      (int)strlen(kind) - 1, kind, name, suffix);
}
