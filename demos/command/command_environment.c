/* Variables of the environment: which there are, and which would be without effect. */
#include "command.h"

#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

extern char **environ;

#define PREFIX "KARST_"
#define OF_VIEWER "KARST_VIEW_"

typedef enum { ANY, FOLDER, WORD, NUMBER } value_kind;

/* All there are: the command's and the library's first, then those of tests and of scripts. docs: the manual page. */
static const struct {
    const char *name;
    value_kind kind;
    const char *right; /* FOLDER: what is done without it; WORD: what it may be, with "or" between */
} known[] = {
    {"KARST_CACHE_DIR", ANY, NULL},
    {"KARST_DATA_DIR", FOLDER, "worlds and paths are looked for where they come with Karst"},
    {"KARST_KERNEL_DIR", FOLDER, "the kernels inside the program are used"},
    {"KARST_VECTORS", WORD, "avx2 or plain"},
    {"KARST_TEST_FULL", WORD, "1"},
    {"KARST_TEST_QUICK", WORD, "1"},
    {"KARST_TEST_FIRST", NUMBER, NULL},
    {"KARST_TEST_LAST", NUMBER, NULL},
    {"KARST_TEST_STEP", NUMBER, NULL},
    {"KARST_TEST_RUNS", NUMBER, NULL},
    {"KARST_TEST_PROCESSES", NUMBER, NULL},
    {"KARST_TEST_LANES", WORD, "1 or 16"},
    {"KARST_TEST_HELPER", ANY, NULL},
    {"KARST_TEST_HELPER_DIES", ANY, NULL},
    {"KARST_TEST_LOOK", ANY, NULL},
    {"KARST_TEST_LOSE", ANY, NULL},
    {"KARST_TEST_ONLY", ANY, NULL},
    {"KARST_TEST_THING", ANY, NULL},
    {"KARST_TEST_VERBOSE", ANY, NULL},
    {"KARST_TEST_WORLD", ANY, NULL},
    {"KARST_APT_CONF", ANY, NULL},
    {"KARST_BENCH_OUT", ANY, NULL},
    {"KARST_BENCH_PROGRAMS", ANY, NULL},
    {"KARST_BENCH_SPANS", ANY, NULL},
    {"KARST_CHROOT", ANY, NULL},
    {"KARST_DEBS", ANY, NULL},
    {"KARST_DEVICE", ANY, NULL},
    {"KARST_FULL", ANY, NULL},
    {"KARST_GPU_BENCH", ANY, NULL},
    {"KARST_GPU_BUILD", ANY, NULL},
    {"KARST_GPU_LIMIT_S", NUMBER, NULL},
    {"KARST_GPU_PREBUILT", ANY, NULL},
    {"KARST_GPU_SIZES", ANY, NULL},
    {"KARST_GPU_TESTS", ANY, NULL},
    {"KARST_LIBRARY", ANY, NULL},
    {"KARST_MIRROR", ANY, NULL},
    {"KARST_PREFIX", ANY, NULL},
    {"KARST_SCAN_FILE", ANY, NULL},
    {"KARST_SCAN_FOLDER", ANY, NULL},
    {"KARST_SCAN_POINTS", NUMBER, NULL},
    {"KARST_SCAN_WRITE", ANY, NULL},
    {"KARST_SHARED", ANY, NULL},
    {"KARST_UNSHARED", ANY, NULL},
    {"KARST_VERBOSE", ANY, NULL},
    {"KARST_WRITE_PATHS", ANY, NULL},
};
#define NUM_KNOWN (sizeof known / sizeof *known)

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

/* Whether the text begins with this word. */
static bool is_word(const char *text, const char *word)
{
    const size_t length = strcspn(text, " ");
    return strlen(word) == length && strncmp(text, word, length) == 0;
}

static void check_value(command_talk *talk, size_t i, const char *value)
{
    const char *name = known[i].name, *right = known[i].right;
    struct stat info;
    if (!*value)
        return;
    switch (known[i].kind) {
    case FOLDER:
        if (stat(value, &info) != 0 || !S_ISDIR(info.st_mode))
            warn(talk, "%s=%.300s is no folder: %s", name, value, right);
        break;
    case WORD: {
        const char *next = right;
        while (next && !is_word(next, value)) {
            next = strstr(next, " or ");
            next = next ? next + strlen(" or ") : NULL;
        }
        if (!next)
            warn(talk, "%s=%.60s means nothing; it may be %s", name, value, right);
        break;
    }
    case NUMBER:
        if (value[strspn(value, "0123456789")])
            warn(talk, "%s=%.60s means nothing; it may be a whole number", name, value);
        break;
    default:
        break;
    }
}

static void check_name(command_talk *talk, const char *name)
{
    const char *names[NUM_KNOWN + 1] = {NULL};
    if (strncmp(name, OF_VIEWER, strlen(OF_VIEWER)) == 0 && command_view_has_variable(name))
        return; /* whose values the viewer checks */
    for (size_t i = 0; i < NUM_KNOWN; i++)
        names[i] = known[i].name;
    const char *nearest = command_nearest(name, names);
    warn(talk, nearest ? "the variable %s means nothing; did you mean %s?" : "the variable %s means nothing", name,
         nearest);
}

void command_check_environment(command_talk *talk)
{
    for (char **entry = environ; *entry; entry++) {
        char name[200];
        size_t length = strcspn(*entry, "="), i = 0;
        if (strncmp(*entry, PREFIX, strlen(PREFIX)) != 0 || (*entry)[length] != '=')
            continue;
        snprintf(name, sizeof name, "%.*s", (int)length, *entry);
        while (i < NUM_KNOWN && strcmp(known[i].name, name) != 0)
            i++;
        if (i < NUM_KNOWN)
            check_value(talk, i, *entry + length + 1);
        else
            check_name(talk, name);
    }
}
