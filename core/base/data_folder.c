#include "karst/data.h"

#include <dirent.h>
#include <dlfcn.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* Enough for a program deep in a build folder, and for lib/<architecture>/. */
#define MAX_FOLDERS_UP 8

/* Called for each folder in order, until it returns true. */
typedef bool (*visit_folder)(void *user, const char *folder);

/* share/karst and demos in the folder of a file and in those above it. */
static bool go_up(const char *file, visit_folder visit, void *user)
{
    static const char *const below[] = {"share/karst", "demos"};
    char folder[PATH_MAX], candidate[PATH_MAX + 16];
    if (snprintf(folder, sizeof folder, "%s", file) >= PATH_MAX)
        return false;
    for (int up = 0; up < MAX_FOLDERS_UP; up++) {
        char *slash = strrchr(folder, '/');
        if (!slash)
            return false;
        *slash = '\0';
        for (size_t i = 0; i < sizeof below / sizeof *below; i++) {
            snprintf(candidate, sizeof candidate, "%s/%s", folder, below[i]);
            if (visit(user, candidate))
                return true;
        }
    }
    return false;
}

static bool visit_all(visit_folder visit, void *user)
{
    const char *named = getenv("KARST_DATA_DIR");
    if (named && *named && visit(user, named))
        return true;
    char file[PATH_MAX];
    /* Any object of the library's does to say which file holds it: the program itself, where it is linked statically.
     */
    static const char anchor;
    Dl_info info;
    if (dladdr(&anchor, &info) && info.dli_fname && realpath(info.dli_fname, file) && go_up(file, visit, user))
        return true;
    if (realpath("/proc/self/exe", file) && go_up(file, visit, user))
        return true;
    return visit(user, KARST_PREFIX "/share/karst");
}

static bool has_suffix(const char *name, const char *suffix)
{
    size_t name_length = strlen(name), suffix_length = strlen(suffix);
    return name_length > suffix_length && strcmp(name + name_length - suffix_length, suffix) == 0;
}

/* ---- one file ---- */

typedef struct {
    const char *kind, *name, *suffix;
    char *path;
    size_t size_bytes;
} wanted;

static bool try_folder(void *user, const char *folder)
{
    const wanted *w = user;
    struct stat status;
    int length = snprintf(w->path, w->size_bytes, "%s/%s/%s%s", folder, w->kind, w->name, w->suffix);
    return length > 0 && (size_t)length < w->size_bytes && stat(w->path, &status) == 0 && S_ISREG(status.st_mode) &&
           access(w->path, R_OK) == 0;
}

bool karst_data_find(const char *kind, const char *name, const char *suffix, char *path, size_t size_bytes,
                     karst_error *error)
{
    if (strchr(name, '/') || has_suffix(name, suffix)) {
        int length = snprintf(path, size_bytes, "%s", name);
        return (length >= 0 && (size_t)length < size_bytes) ||
               karst_fail(error, KARST_USAGE, "'%.60s...': the name is too long", name);
    }
    char found[PATH_MAX + 512];
    wanted w = {kind, name, suffix, found, sizeof found};
    if (*name && visit_all(try_folder, &w)) {
        if (strlen(found) >= size_bytes)
            return karst_fail(error, KARST_USAGE, "'%.60s' is found by a path of %zu characters; there is room for %zu",
                              name, strlen(found), size_bytes ? size_bytes - 1 : 0);
        strcpy(path, found);
        return true;
    }
    return karst_fail(error, KARST_BAD_DATA,
                      "no %.*s called '%.60s' comes with Karst; a file's name ends in %s, and KARST_DATA_DIR says "
                      "where else to look",
                      (int)strlen(kind) - 1, kind, name, suffix);
}

/* ---- all of a kind ---- */

typedef struct {
    const char *kind, *suffix;
    char (*names)[KARST_DATA_NAME_BYTES];
    size_t num_names, max_names;
} listing;

/* Keeps the names sorted, so that of more than there is room for the first stay, whatever order folders come in. */
static void add_name(listing *l, const char *name)
{
    size_t place = 0;
    while (place < l->num_names && strcmp(l->names[place], name) < 0)
        place++;
    if (place == l->max_names || (place < l->num_names && strcmp(l->names[place], name) == 0))
        return;
    if (l->num_names < l->max_names)
        l->num_names++;
    memmove(l->names + place + 1, l->names + place, (l->num_names - 1 - place) * sizeof *l->names);
    snprintf(l->names[place], sizeof l->names[place], "%s", name);
}

static bool list_folder(void *user, const char *folder)
{
    listing *l = user;
    char kind[PATH_MAX + 64], name[KARST_DATA_NAME_BYTES], path[PATH_MAX + 512];
    snprintf(kind, sizeof kind, "%s/%s", folder, l->kind);
    DIR *dir = opendir(kind);
    const struct dirent *entry;
    while (dir && (entry = readdir(dir)) != NULL) {
        size_t length = strlen(entry->d_name) - strlen(l->suffix);
        if (entry->d_name[0] == '.' || !has_suffix(entry->d_name, l->suffix) || length >= sizeof name)
            continue;
        memcpy(name, entry->d_name, length);
        name[length] = '\0';
        wanted w = {l->kind, name, l->suffix, path, sizeof path};
        if (try_folder(&w, folder))
            add_name(l, name);
    }
    if (dir)
        closedir(dir);
    return false;
}

size_t karst_data_list(const char *kind, const char *suffix, char names[][KARST_DATA_NAME_BYTES], size_t max_names)
{
    listing l = {kind, suffix, names, 0, max_names};
    visit_all(list_folder, &l);
    return l.num_names;
}
