/* Folders of what is kept: see core/store.h. */
#include "core/device/store.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static bool make_folder(const char *path) { return mkdir(path, 0700) == 0 || errno == EEXIST; }

bool karst_store_is_own(const char *folder)
{
    struct stat info;
    return lstat(folder, &info) == 0 && S_ISDIR(info.st_mode) && info.st_uid == geteuid() &&
           !(info.st_mode & (S_IWGRP | S_IWOTH));
}

bool karst_store_folder(const char *part, bool even_if_off, char folder[1024])
{
    const char *named = getenv("KARST_CACHE_DIR"), *xdg = getenv("XDG_CACHE_HOME"), *home = getenv("HOME");
    char base[1000];
    int length = -1;
    folder[0] = 0;
    if (named && (!*named || strcmp(named, "off") == 0)) {
        if (!even_if_off)
            return false;
        named = NULL;
    }
    if (named) {
        length = snprintf(base, sizeof base, "%s", named);
    } else if (xdg && xdg[0] == '/') {
        if (!make_folder(xdg))
            return false;
        length = snprintf(base, sizeof base, "%s/karst", xdg);
    } else if (home && home[0] == '/') {
        length = snprintf(base, sizeof base, "%s/.cache", home);
        if (length < 0 || (size_t)length >= sizeof base || !make_folder(base))
            return false;
        length = snprintf(base, sizeof base, "%s/.cache/karst", home);
    }
    if (length < 0 || (size_t)length >= sizeof base || !make_folder(base))
        return false;
    length = snprintf(folder, 1024, "%s/%s", base, part);
    /* A folder of that name may be a link that the user made. */
    char *real = length > 0 && length < 1024 && make_folder(folder) ? realpath(folder, NULL) : NULL;
    bool good = real && karst_store_is_own(real);
    free(real);
    if (!good)
        folder[0] = 0;
    return good;
}
