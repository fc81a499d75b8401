/* Files that come with Karst: found beside the program, installed or in its source tree. */
#include "command.h"

#include <dirent.h>
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

/* The folders that may hold such files, in the order in which they are looked at. */
static size_t data_folders(char folders[3][PATH_MAX])
{
    size_t num_folders = 0;
    const char *named = getenv("KARST_DATA_DIR");
    if (named && *named && snprintf(folders[0], PATH_MAX, "%s", named) < PATH_MAX)
        num_folders++;
    char beside[PATH_MAX];
    ssize_t length = readlink("/proc/self/exe", beside, sizeof beside - 1);
    if (length <= 0)
        return num_folders;
    beside[length] = '\0';
    char *slash = strrchr(beside, '/');
    static const char *const relative[] = {"/../share/karst", "/../demos"};
    for (size_t i = 0; slash && i < sizeof relative / sizeof *relative; i++) {
        *slash = '\0';
        if (snprintf(folders[num_folders], PATH_MAX, "%s%s", beside, relative[i]) < PATH_MAX)
            num_folders++;
    }
    return num_folders;
}

bool command_has_suffix(const char *name, const char *suffix)
{
    size_t name_length = strlen(name), suffix_length = strlen(suffix);
    return name_length > suffix_length && strcmp(name + name_length - suffix_length, suffix) == 0;
}

bool command_find_data(const char *kind, const char *name, const char *suffix, char *path, size_t size_bytes,
                       karst_error *error)
{
    if (strchr(name, '/') || command_has_suffix(name, suffix)) {
        int length = snprintf(path, size_bytes, "%s", name);
        return (size_t)length < size_bytes || karst_fail(error, KARST_USAGE, "'%.60s...': the name is too long", name);
    }
    char folders[3][PATH_MAX];
    size_t num_folders = data_folders(folders);
    for (size_t i = 0; i < num_folders; i++)
        if (try_folder(folders[i], kind, name, suffix, path, size_bytes))
            return true;
    return karst_fail(error, KARST_BAD_DATA,
                      "no %.*s called '%s' comes with Karst; a file's name ends in %s, and KARST_DATA_DIR says where "
                      "else to look",
                      (int)strlen(kind) - 1, kind, name, suffix);
}

static int compare_names(const void *a, const void *b) { return strcmp(a, b); }

size_t command_list_data(const char *kind, const char *suffix, char names[][COMMAND_MAX_NAME], size_t max_names)
{
    char folders[3][PATH_MAX];
    size_t num_folders = data_folders(folders), num_names = 0;
    for (size_t i = 0; i < num_folders && num_names == 0; i++) {
        char folder[PATH_MAX + 32];
        snprintf(folder, sizeof folder, "%s/%s", folders[i], kind);
        DIR *dir = opendir(folder);
        const struct dirent *entry;
        while (dir && num_names < max_names && (entry = readdir(dir)) != NULL) {
            size_t length = strlen(entry->d_name) - strlen(suffix);
            if (!command_has_suffix(entry->d_name, suffix) || length >= COMMAND_MAX_NAME)
                continue;
            memcpy(names[num_names], entry->d_name, length);
            names[num_names++][length] = '\0';
        }
        if (dir)
            closedir(dir);
    }
    qsort(names, num_names, COMMAND_MAX_NAME, compare_names);
    return num_names;
}
