/* Variables of the environment that would be without effect, without a word. */
#include "command.h"

#include <dirent.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

extern char **environ;

#define PREFIX "KARST_"

static const char *const known[] = {"KARST_CACHE_DIR", "KARST_DATA_DIR", "KARST_KERNEL_DIR", "KARST_VECTORS", NULL};

static void warn(command_talk *talk, const char *format, ...) __attribute__((format(printf, 2, 3)));
static void warn(command_talk *talk, const char *format, ...)
{
    char line[600];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    const karst_log log = command_log(talk);
    log.write(log.user, KARST_LOG_WARNING, line);
}

static bool is_known(const char *name)
{
    for (size_t i = 0; known[i]; i++)
        if (strcmp(known[i], name) == 0)
            return true;
    return false;
}

/* Tests and programs have variables of their own that begin so; those that look like one of these are meant for it. */
static void check_names(command_talk *talk)
{
    for (char **entry = environ; *entry; entry++) {
        char name[64];
        size_t length = strcspn(*entry, "=");
        if (strncmp(*entry, PREFIX, strlen(PREFIX)) != 0 || length <= strlen(PREFIX) + 2 || length >= sizeof name)
            continue;
        snprintf(name, sizeof name, "%.*s", (int)length, *entry);
        const char *nearest = is_known(name) ? NULL : command_nearest(name, known);
        if (nearest)
            warn(talk, "the variable %s means nothing; did you mean %s?", name, nearest);
    }
}

static void check_folder(command_talk *talk, const char *name, const char *holds)
{
    const char *value = getenv(name);
    struct stat info;
    if (value && *value && (stat(value, &info) != 0 || !S_ISDIR(info.st_mode)))
        warn(talk, "%s=%.300s is no folder: %s", name, value, holds);
}

void command_check_environment(command_talk *talk)
{
    const char *vectors = getenv("KARST_VECTORS");
    check_names(talk);
    if (vectors && *vectors && strcmp(vectors, "avx2") != 0 && strcmp(vectors, "plain") != 0)
        warn(talk, "KARST_VECTORS=%.60s means nothing; it may be avx2 or plain", vectors);
    check_folder(talk, "KARST_KERNEL_DIR", "the kernels inside the program are used");
    check_folder(talk, "KARST_DATA_DIR", "worlds and paths are looked for where they come with Karst");
}
