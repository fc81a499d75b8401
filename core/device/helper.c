/* A second process that compiles: see core/device/helper.h. One thread watches: it starts the process when a build
 * takes long, and waits for its end. */
#include "core/device/helper.h"

#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <spawn.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#define VARIABLE "KARST_HELPER" /* "fd:pid": the shared memory, and whose helper it is */
#define TABLE_FD 3
#define LONG_BUILD_NS 150000000u     /* a program that is in PoCL's store takes 25 to 60 ms */
#define PATIENCE_NS 5000000000u      /* for one thing that the helper has begun */
#define POLL_NS 1000000
#define MAX_CLAIMS 256u
#define MAX_PARAMETERS 64u
#define MAX_PROGRAMS 64u
#define MAX_KERNELS 256u
/* PoCL compiles a kernel once for each size of its groups, and once more where all work-items are more than these. */
#define SMALL_GRID 65535u

enum { FREE, OURS, HELPERS, DONE_BY_US, DONE_BY_HELPER };

typedef struct {
    _Atomic uint64_t key; /* 0: none yet */
    _Atomic uint32_t state;
} table_entry;

/* Programs are built and launched by more than one thread. */
static pthread_mutex_t notes_lock = PTHREAD_MUTEX_INITIALIZER; /* of programs and seen */

/* What both processes see. */
typedef struct {
    table_entry claims[MAX_CLAIMS];
    karst_engine_config config; /* pointers in it are replaced by what follows */
    char world[4096], device[256];
    bool has_device;
    karst_parameter parameters[MAX_PARAMETERS];
    char parameter_names[MAX_PARAMETERS][64];
} shared_table;

struct karst_helper {
    shared_table *table;
    int fd;
    bool is_child, has_task;
    /* Of this process: its programs, and the launches that need no look any more. */
    struct noted_program {
        cl_program program;
        uint64_t key;
    } programs[MAX_PROGRAMS];
    uint64_t seen[MAX_KERNELS];
    uint32_t num_seen;
    pthread_t watcher;
    bool is_watched;
    pthread_mutex_t lock;
    pthread_cond_t changed;
    /* under the lock */
    uint64_t deadline_ns; /* of the build that goes on; 0: none */
    bool closing;
    pid_t pid; /* 0: not started, or ended */
    atomic_bool started, ended, failed;
};

/* ---- the process ---- */

static bool start_process(karst_helper *helper)
{
    extern char **environ;
    size_t num = 0;
    char variable[64];
    while (environ[num])
        num++;
    const char **all = malloc((num + 2) * sizeof *all);
    FILE *file = fopen("/proc/self/cmdline", "rb");
    char *line = NULL;
    size_t size_bytes = 0;
    ssize_t length = file ? getdelim(&line, &size_bytes, '\0', file) : -1;
    char *arguments[] = {line, NULL}; /* its own name will do: what to compile stands in the table */
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    bool good = all && length > 0;
    if (good) {
        num = 0;
        for (char **entry = environ; *entry; entry++)
            if (strncmp(*entry, VARIABLE "=", sizeof VARIABLE) != 0) /* what a user set would be found first */
                all[num++] = *entry;
        snprintf(variable, sizeof variable, VARIABLE "=%d:%ld", TABLE_FD, (long)getpid());
        all[num] = variable;
        all[num + 1] = NULL;
        good = posix_spawn_file_actions_adddup2(&files, helper->fd, TABLE_FD) == 0 &&
               posix_spawn_file_actions_addopen(&files, 0, "/dev/null", O_RDONLY, 0) == 0 &&
               posix_spawn_file_actions_addopen(&files, 1, "/dev/null", O_WRONLY, 0) == 0 &&
               posix_spawn_file_actions_addopen(&files, 2, "/dev/null", O_WRONLY, 0) == 0 &&
               posix_spawn_file_actions_addclosefrom_np(&files, TABLE_FD + 1) == 0 &&
               posix_spawn(&helper->pid, "/proc/self/exe", &files, NULL, arguments, (char *const *)all) == 0;
    }
    posix_spawn_file_actions_destroy(&files);
    if (file)
        fclose(file);
    free(line);
    free(all);
    return good;
}

static void set_deadline(struct timespec *t, uint64_t ns)
{
    t->tv_sec = (time_t)(ns / 1000000000u);
    t->tv_nsec = (long)(ns % 1000000000u);
}

/* Waits until a build takes long or all is over; then, if there is a process, for its end. It is the kernel's parent of
 * that process: when this thread ends, the process does. */
static void *watch(void *user)
{
    karst_helper *helper = user;
    pthread_mutex_lock(&helper->lock);
    bool is_late = false;
    while (!helper->closing && !is_late) {
        struct timespec deadline;
        set_deadline(&deadline, helper->deadline_ns);
        if (!helper->deadline_ns)
            pthread_cond_wait(&helper->changed, &helper->lock);
        else
            is_late = pthread_cond_timedwait(&helper->changed, &helper->lock, &deadline) == ETIMEDOUT &&
                      helper->deadline_ns && karst_clock_ns() >= helper->deadline_ns;
    }
    if (is_late && !helper->closing && start_process(helper))
        helper->started = true;
    pid_t pid = helper->pid;
    pthread_mutex_unlock(&helper->lock);
    if (!helper->started)
        return NULL;
    siginfo_t info = {0};
    while (waitid(P_PID, (id_t)pid, &info, WEXITED | WNOWAIT) != 0 && errno == EINTR)
        continue;
    pthread_mutex_lock(&helper->lock);
    while (waitpid(pid, NULL, 0) < 0 && errno == EINTR)
        continue;
    helper->pid = 0;
    helper->failed = info.si_code != CLD_EXITED || info.si_status != 0;
    helper->ended = true;
    pthread_mutex_unlock(&helper->lock);
    return NULL;
}

static void end_process(karst_helper *helper)
{
    pthread_mutex_lock(&helper->lock);
    if (helper->pid)
        kill(helper->pid, SIGKILL);
    helper->closing = true;
    pthread_cond_broadcast(&helper->changed);
    pthread_mutex_unlock(&helper->lock);
}

/* ---- making one ---- */

static bool start_watching(karst_helper *helper)
{
    pthread_condattr_t attributes;
    if (pthread_mutex_init(&helper->lock, NULL) != 0)
        return false;
    pthread_condattr_init(&attributes);
    pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC);
    bool good = pthread_cond_init(&helper->changed, &attributes) == 0;
    pthread_condattr_destroy(&attributes);
    helper->is_watched = good && pthread_create(&helper->watcher, NULL, watch, helper) == 0;
    if (!helper->is_watched) {
        if (good)
            pthread_cond_destroy(&helper->changed);
        pthread_mutex_destroy(&helper->lock);
    }
    return helper->is_watched;
}

static shared_table *map_table(int fd)
{
    void *mapped = mmap(NULL, sizeof(shared_table), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    return mapped == MAP_FAILED ? NULL : mapped;
}

karst_helper *karst_helper_create(karst_error *error)
{
    karst_helper *helper = calloc(1, sizeof *helper);
    if (!helper) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    helper->fd = memfd_create("karst helper", MFD_CLOEXEC);
    helper->table =
        helper->fd >= 0 && ftruncate(helper->fd, sizeof(shared_table)) == 0 ? map_table(helper->fd) : NULL;
    if (helper->table && start_watching(helper))
        return helper;
    karst_fail(error, KARST_FAILED, "no memory or thread for a helper process: %s", strerror(errno));
    karst_helper_destroy(helper);
    return NULL;
}

void karst_helper_destroy(karst_helper *helper)
{
    if (!helper)
        return;
    if (helper->is_watched) {
        end_process(helper);
        pthread_join(helper->watcher, NULL);
        pthread_cond_destroy(&helper->changed);
        pthread_mutex_destroy(&helper->lock);
    }
    if (helper->table)
        munmap(helper->table, sizeof *helper->table);
    if (helper->fd >= 0)
        close(helper->fd);
    free(helper);
}

void karst_helper_set_task(karst_helper *helper, const karst_engine_config *config)
{
    if (!helper || helper->is_child || helper->started)
        return;
    shared_table *t = helper->table;
    helper->has_task = false;
    if (!config->world || strlen(config->world) >= sizeof t->world || config->num_parameters > MAX_PARAMETERS ||
        (config->device && strlen(config->device) >= sizeof t->device))
        return;
    for (size_t i = 0; i < config->num_parameters; i++) {
        if (strlen(config->parameters[i].name) >= sizeof t->parameter_names[i])
            return;
        strcpy(t->parameter_names[i], config->parameters[i].name);
        t->parameters[i] = config->parameters[i];
    }
    t->config = *config;
    strcpy(t->world, config->world);
    t->has_device = config->device != NULL;
    if (config->device)
        strcpy(t->device, config->device);
    helper->has_task = true;
}

/* ---- in the helper ---- */

/* What the variable says; false: it is not there, or was not set by start_process. */
static bool read_variable(int *fd, long *parent)
{
    struct stat info;
    const char *text = getenv(VARIABLE);
    return text && sscanf(text, "%d:%ld", fd, parent) == 2 && fstat(*fd, &info) == 0 &&
           info.st_size == (off_t)sizeof(shared_table);
}

bool karst_helper_is_this_process(void)
{
    int fd;
    long parent;
    return read_variable(&fd, &parent);
}

karst_helper *karst_helper_attach(karst_engine_config *config)
{
    int fd;
    long parent;
    bool known = read_variable(&fd, &parent);
    unsetenv(VARIABLE);
    /* PoCL compiles in its workers: bound to CPUs, both processes' might sit on one. */
    unsetenv("POCL_AFFINITY");
    /* Its end comes with the other's, also where that happened just before. */
    if (!known || prctl(PR_SET_PDEATHSIG, SIGKILL) != 0 || (long)getppid() != parent)
        return NULL;
    karst_helper *helper = calloc(1, sizeof *helper);
    if (!helper || !(helper->table = map_table(fd))) {
        free(helper);
        return NULL;
    }
    shared_table *t = helper->table;
    helper->fd = fd;
    helper->is_child = true;
    *config = t->config;
    config->world = t->world;
    config->device = t->has_device ? t->device : NULL;
    for (size_t i = 0; i < config->num_parameters; i++)
        t->parameters[i].name = t->parameter_names[i];
    config->parameters = t->parameters;
    config->in_display = NULL;
    config->log = NULL;
    config->helper = helper;
    return helper;
}

/* ---- claims ---- */

/* The claim of a key, made if need be; NULL: there is no room. */
static table_entry *find_claim(karst_helper *helper, uint64_t key)
{
    key += key == 0;
    for (uint32_t i = 0; i < MAX_CLAIMS; i++) {
        table_entry *c = &helper->table->claims[(key + i) % MAX_CLAIMS];
        uint64_t found = 0;
        if (atomic_compare_exchange_strong(&c->key, &found, key) || found == key)
            return c;
    }
    return NULL;
}

static bool is_waited_for(const karst_helper *helper) { return helper->started && !helper->ended; }

/* Until the other process is done with it; false: it will not be. */
static bool wait_for_other(karst_helper *helper, table_entry *c, uint32_t while_state)
{
    const struct timespec pause = {0, POLL_NS};
    uint64_t start_ns = karst_clock_ns();
    while (c->state == while_state) {
        if (!helper->is_child && helper->ended)
            return c->state != while_state;
        if (karst_clock_ns() - start_ns > PATIENCE_NS) {
            if (!helper->is_child)
                end_process(helper);
            return false;
        }
        nanosleep(&pause, NULL);
    }
    return true;
}

static karst_claim take(karst_helper *helper, uint64_t key, bool may_leave)
{
    table_entry *c = find_claim(helper, key);
    uint32_t found = FREE, mine = helper->is_child ? HELPERS : OURS, others = helper->is_child ? OURS : HELPERS;
    if (!c)
        return KARST_CLAIM_NOBODY;
    if (atomic_compare_exchange_strong(&c->state, &found, mine) || found == mine)
        return KARST_CLAIM_MINE;
    if (found == others && may_leave)
        return KARST_CLAIM_OTHERS;
    if (found == others && !wait_for_other(helper, c, others))
        return KARST_CLAIM_NOBODY;
    return KARST_CLAIM_DONE;
}

void karst_helper_done(karst_helper *helper, uint64_t key)
{
    table_entry *c = find_claim(helper, key);
    if (c)
        c->state = helper->is_child ? DONE_BY_HELPER : DONE_BY_US;
}

static void set_watch(karst_helper *helper, uint64_t deadline_ns)
{
    pthread_mutex_lock(&helper->lock);
    helper->deadline_ns = deadline_ns;
    pthread_cond_broadcast(&helper->changed);
    pthread_mutex_unlock(&helper->lock);
}

karst_claim karst_helper_begin_build(karst_helper *helper, uint64_t key)
{
    if (!helper || (!helper->is_child && !helper->has_task))
        return KARST_CLAIM_NOBODY;
    karst_claim claim = take(helper, key, false);
    if (!helper->is_child && !helper->started)
        set_watch(helper, karst_clock_ns() + LONG_BUILD_NS);
    return claim;
}

void karst_helper_end_build(karst_helper *helper, uint64_t key, karst_claim claim)
{
    if (!helper)
        return;
    if (claim == KARST_CLAIM_MINE)
        karst_helper_done(helper, key);
    if (!helper->is_child && helper->has_task && !helper->started)
        set_watch(helper, 0);
}

/* The place of a program among the notes, or with NULL a free one; NULL: none. Under the lock. */
static struct noted_program *find_program(karst_helper *helper, cl_program program)
{
    for (uint32_t i = 0; i < MAX_PROGRAMS; i++)
        if (helper->programs[i].program == program)
            return &helper->programs[i];
    return NULL;
}

static void set_program(karst_helper *helper, cl_program where, struct noted_program to)
{
    if (!helper)
        return;
    pthread_mutex_lock(&notes_lock);
    struct noted_program *at = find_program(helper, where);
    if (at)
        *at = to;
    pthread_mutex_unlock(&notes_lock);
}

void karst_helper_note_program(karst_helper *helper, cl_program program, uint64_t key)
{
    set_program(helper, NULL, (struct noted_program){program, key});
}

void karst_helper_forget_program(karst_helper *helper, cl_program program)
{
    set_program(helper, program, (struct noted_program){NULL, 0});
}

/* Of a kernel's code as the driver compiles it; 0: its program is not known. */
static uint64_t launch_key(karst_helper *helper, cl_kernel kernel, size_t global_size, size_t local_size)
{
    cl_program program;
    char name[128];
    if (clGetKernelInfo(kernel, CL_KERNEL_PROGRAM, sizeof program, &program, NULL) != CL_SUCCESS ||
        clGetKernelInfo(kernel, CL_KERNEL_FUNCTION_NAME, sizeof name, name, NULL) != CL_SUCCESS)
        return 0;
    pthread_mutex_lock(&notes_lock);
    const struct noted_program *noted = find_program(helper, program);
    uint64_t key = noted ? noted->key : 0;
    pthread_mutex_unlock(&notes_lock);
    if (!key)
        return 0;
    for (const char *at = name; *at; at++)
        key = (key ^ (unsigned char)*at) * 0x100000001b3u;
    return (key ^ (2 * local_size + (global_size > SMALL_GRID))) * 0x9e3779b97f4a7c15u;
}

/* Whether this process has launched that before; it counts as launched from now on. */
static bool was_launched(karst_helper *helper, uint64_t key)
{
    bool found = false;
    pthread_mutex_lock(&notes_lock);
    for (uint32_t i = 0; i < helper->num_seen && !found; i++)
        found = helper->seen[i] == key;
    if (!found && helper->num_seen < MAX_KERNELS)
        helper->seen[helper->num_seen++] = key;
    pthread_mutex_unlock(&notes_lock);
    return found;
}

karst_claim karst_helper_begin_launch(karst_helper *helper, cl_kernel kernel, size_t global_size, size_t local_size,
                                      uint64_t *key)
{
    *key = karst_helper_is_active(helper) ? launch_key(helper, kernel, global_size, local_size) : 0;
    if (!*key)
        return KARST_CLAIM_NOBODY;
    if (was_launched(helper, *key))
        return helper->is_child ? KARST_CLAIM_DONE : KARST_CLAIM_NOBODY;
    return take(helper, *key, helper->is_child);
}

bool karst_helper_is_active(const karst_helper *helper)
{
    return helper && (helper->is_child || is_waited_for(helper));
}

bool karst_helper_is_child(const karst_helper *helper) { return helper && helper->is_child; }

uint32_t karst_helper_count_done(const karst_helper *helper)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < MAX_CLAIMS; i++)
        count += helper->table->claims[i].state == DONE_BY_HELPER;
    return count;
}

bool karst_helper_was_started(const karst_helper *helper) { return helper->started; }
bool karst_helper_has_ended(const karst_helper *helper) { return helper->ended; }
bool karst_helper_has_failed(const karst_helper *helper) { return helper->failed; }
