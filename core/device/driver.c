/* The driver's store and its marker: see karst/driver.h. */
#include "karst/driver.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <ftw.h>
#include <limits.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include "core/device/driver_internal.h"
#include "core/device/store.h"

#define FOLDER_VARIABLE "POCL_CACHE_DIR"
/* A start of a world writes one and a half MiB. */
#define LEAST_ROOM_BYTES ((uint64_t)8 << 20)
#define MARKER "karst-run-"
#define NEW_MARKER ".karst-run-"

static char marker_path[PATH_MAX]; /* "": none; written before there are other threads */
static int marker_fd = -1;         /* holds the lock on it, until the process ends however it does */
static atomic_bool has_marker, is_suspect;

/* ---- what a folder is good for ---- */

/* mkdir -p; what exists is left as it is. */
static bool make_folders(const char *folder)
{
    char path[PATH_MAX];
    if (snprintf(path, sizeof path, "%s", folder) >= (int)sizeof path)
        return false;
    for (char *at = path + 1; *at; at++)
        if (*at == '/') {
            *at = 0;
            mkdir(path, 0700);
            *at = '/';
        }
    return mkdir(path, 0700) == 0 || errno == EEXIST;
}

/* Whether files of a start's size can be written there; if not, *why says what is in the way. */
static bool has_room(const char *folder, const char **why)
{
    struct statvfs disk;
    char path[PATH_MAX];
    *why = NULL;
    if (snprintf(path, sizeof path, "%s/.karst-try-XXXXXX", folder) >= (int)sizeof path) {
        *why = "its name is too long";
        return false;
    }
    int fd = mkostemp(path, O_CLOEXEC);
    if (fd < 0) {
        *why = strerror(errno);
        return false;
    }
    /* A quota shows only when something is to be written. */
    static const char block[4096] = {1};
    if (write(fd, block, sizeof block) != (ssize_t)sizeof block)
        *why = "the disk is full";
    else if (statvfs(folder, &disk) == 0 && (uint64_t)disk.f_bavail * disk.f_frsize < LEAST_ROOM_BYTES)
        *why = "the disk is full";
    else if (statvfs(folder, &disk) == 0 && disk.f_files && disk.f_favail < 256)
        *why = "the disk has no room for more files";
    close(fd);
    unlink(path);
    return !*why;
}

/* ---- the marker ---- */

static bool is_marker(const char *name) { return strncmp(name, MARKER, strlen(MARKER)) == 0; }

/* Whether the run that wrote it is over: while it lives it holds a lock. */
static bool is_of_dead_run(const char *path)
{
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
    bool is_dead = fd >= 0 && flock(fd, LOCK_EX | LOCK_NB) == 0;
    if (fd >= 0)
        close(fd);
    return is_dead;
}

/* Whether a run that lives has this folder for its store. */
static bool is_in_use(const char *folder)
{
    DIR *dir = opendir(folder);
    const struct dirent *entry;
    bool found = false;
    char path[PATH_MAX];
    while (dir && !found && (entry = readdir(dir)) != NULL)
        found = is_marker(entry->d_name) &&
                snprintf(path, sizeof path, "%s/%s", folder, entry->d_name) < (int)sizeof path && !is_of_dead_run(path);
    if (dir)
        closedir(dir);
    return found;
}

/* Takes away the markers of dead runs; whether there was one. Of several processes one is told so. */
static bool take_dead_markers(const char *folder)
{
    DIR *dir = opendir(folder);
    const struct dirent *entry;
    bool found = false;
    char path[PATH_MAX];
    while (dir && (entry = readdir(dir)) != NULL)
        if (is_marker(entry->d_name) &&
            snprintf(path, sizeof path, "%s/%s", folder, entry->d_name) < (int)sizeof path && is_of_dead_run(path))
            found = unlink(path) == 0 || found;
    if (dir)
        closedir(dir);
    return found;
}

/* It appears under its name only when it is locked. */
static void set_marker(const char *folder)
{
    char path[PATH_MAX];
    if (snprintf(path, sizeof path, "%s/" NEW_MARKER "%ld", folder, (long)getpid()) >= (int)sizeof path ||
        snprintf(marker_path, sizeof marker_path, "%s/" MARKER "%ld", folder, (long)getpid()) >=
            (int)sizeof marker_path)
        return;
    marker_fd = open(path, O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOFOLLOW, 0600);
    if (marker_fd < 0)
        return;
    has_marker = flock(marker_fd, LOCK_EX | LOCK_NB) == 0 && rename(path, marker_path) == 0;
    if (!has_marker) {
        unlink(path);
        close(marker_fd);
        marker_fd = -1;
    }
}

void karst_driver_end(void)
{
    if (!is_suspect && atomic_exchange(&has_marker, false))
        unlink(marker_path);
}

void karst_driver_suspect(void) { is_suspect = true; }
bool karst_driver_is_suspect(void) { return is_suspect; }

/* ---- generations ---- */

/* What a run may have died of is left where it is, as others may be using it: the store goes on in a folder beside it.
 * Generation 0 is the folder itself, k > 0 "karst-k" in it. */
#define GENERATION "karst-"
#define MAX_GENERATION 1000000

static bool name_generation(const char *folder, int number, char path[PATH_MAX])
{
    int length = number ? snprintf(path, PATH_MAX, "%s/" GENERATION "%d", folder, number)
                        : snprintf(path, PATH_MAX, "%s", folder);
    return length < PATH_MAX;
}

static int number_of(const char *name)
{
    const char *digits = name + strlen(GENERATION);
    size_t length = strncmp(name, GENERATION, strlen(GENERATION)) == 0 ? strspn(digits, "0123456789") : 0;
    return length > 0 && length < 7 && !digits[length] ? atoi(digits) : 0;
}

/* The newest, or `first` if there is none. */
static int find_generation(const char *folder, int first)
{
    DIR *dir = opendir(folder);
    const struct dirent *entry;
    int newest = first;
    while (dir && (entry = readdir(dir)) != NULL)
        if (number_of(entry->d_name) > newest)
            newest = number_of(entry->d_name);
    if (dir)
        closedir(dir);
    return newest;
}

static int remove_one(const char *path, const struct stat *info, int kind, struct FTW *at)
{
    (void)info;
    (void)kind;
    (void)at;
    remove(path);
    return 0;
}

/* The one before stays, for who wants to know what was wrong with it; so does one that a run still writes to. */
static void remove_older(const char *folder, int number)
{
    DIR *dir = opendir(folder);
    const struct dirent *entry;
    char path[PATH_MAX];
    while (dir && (entry = readdir(dir)) != NULL) {
        int found = number_of(entry->d_name);
        if (found > 0 && found < number - 1 && name_generation(folder, found, path) && !is_in_use(path))
            nftw(path, remove_one, 16, FTW_DEPTH | FTW_PHYS | FTW_MOUNT);
    }
    if (dir)
        closedir(dir);
}

/* The generation to use, made if need be; a new one where a run died in the newest, or it is no folder at all. */
static bool choose_generation(const char *folder, int first, char path[PATH_MAX], const char **why,
                              const karst_log *log)
{
    char before[PATH_MAX];
    struct stat info;
    int number = find_generation(folder, first);
    for (; number < MAX_GENERATION; number++) {
        if (!name_generation(folder, number, path)) {
            *why = "its name is too long";
            return false;
        }
        if (mkdir(path, 0700) != 0 && errno != EEXIST) {
            *why = strerror(errno);
            return false;
        }
        if (stat(path, &info) != 0 || !S_ISDIR(info.st_mode))
            continue;
        if (!has_room(path, why))
            return false;
        if (!take_dead_markers(path))
            return true;
        memcpy(before, path, sizeof before);
        remove_older(folder, number + 1);
        karst_log_print(log, KARST_LOG_WARNING,
                        "an earlier run died or was killed in the driver's work: its store of compiled kernels, %s, is "
                        "set aside (it may be deleted), and kernels are compiled anew",
                        before);
    }
    *why = "it was set aside too often";
    return false;
}

/* ---- choosing a folder ---- */

/* A folder for this user alone in one that is everybody's. */
static bool find_temporary(char path[PATH_MAX], const karst_log *log)
{
    const char *named = getenv("TMPDIR"), *why;
    const char *const candidates[] = {named && *named == '/' ? named : "/tmp", "/tmp", "/var/tmp", "/dev/shm"};
    char folder[PATH_MAX];
    for (size_t i = 0; i < sizeof candidates / sizeof *candidates; i++) {
        int length = snprintf(folder, sizeof folder, "%s/karst-%ld", candidates[i], (long)geteuid());
        if (length < (int)sizeof folder && (mkdir(folder, 0700) == 0 || errno == EEXIST) &&
            karst_store_is_own(folder) && choose_generation(folder, 1, path, &why, log))
            return true;
    }
    return false;
}

/* The folder that is wished for, and in `place` how the user knows it; false if it cannot be used, with what is in its
 * way. */
static bool find_usual(char path[PATH_MAX], char place[PATH_MAX], const char **why, const karst_log *log)
{
    const char *named = getenv(FOLDER_VARIABLE), *cache = getenv("KARST_CACHE_DIR"), *home = getenv("HOME");
    char own[1024];
    if (named && *named) {
        snprintf(place, PATH_MAX, "%s", named);
        *why = "it cannot be made";
        return strlen(named) < PATH_MAX && make_folders(named) && choose_generation(named, 0, path, why, log);
    }
    if (karst_store_folder("driver", true, own)) {
        snprintf(place, PATH_MAX, "%s", own);
        return choose_generation(own, 1, path, why, log);
    }
    snprintf(place, PATH_MAX, "%s", cache && *cache && strcmp(cache, "off") != 0 ? cache : home ? home : "~");
    *why = "no folder of Karst's own can be made there";
    return false;
}

void karst_driver_begin(const karst_log *log)
{
    static bool has_begun;
    char path[PATH_MAX], place[PATH_MAX];
    const char *why = NULL;
    if (has_begun)
        return;
    has_begun = true;
    bool is_usual = find_usual(path, place, &why, log);
    if (!is_usual && !find_temporary(path, log)) {
        karst_log_print(log, KARST_LOG_WARNING,
                        "there is no place for the driver's compiled kernels: %s (%s), nor /tmp, /var/tmp or /dev/shm; "
                        "set TMPDIR or KARST_CACHE_DIR to a folder that can be written",
                        place, why);
        return;
    }
    if (!is_usual)
        karst_log_print(log, KARST_LOG_WARNING,
                        "compiled kernels cannot be kept in %s (%s): they go to %s; KARST_CACHE_DIR names another "
                        "place",
                        place, why, path);
    if (setenv(FOLDER_VARIABLE, path, 1) == 0)
        set_marker(path);
}
