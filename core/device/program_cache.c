/* Built programs on disk: see core/device/program_cache.h. */
#include "core/device/program_cache.h"

#include "core/device/store.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#define SUFFIX ".program"
#define TEMPORARY_SUFFIX ".new"
#define TEMPORARY_AGE_S 3600 /* older ones were left by a process that died */
#define MAX_ENTRY_BYTES ((size_t)64 << 20)
#define MAX_ENTRIES 4096

/* What stands at the front of an entry; then the key's text and the binary. */
typedef struct {
    char magic[8];
    uint64_t key_bytes, binary_bytes;
    uint64_t sums[2]; /* over all that follows */
} entry_header;
static const char magic[8] = {'k', 'a', 'r', 's', 't', 'P', '1', '\n'};

/* ---- sums ---- */

static uint64_t mix(uint64_t x)
{
    x ^= x >> 32;
    x *= 0xd6e8feb86659fd93u;
    x ^= x >> 32;
    x *= 0xd6e8feb86659fd93u;
    return x ^ (x >> 32);
}

/* Goes on from what sums[] holds: a change of any bit changes both, all but surely. It guards against damage, not
 * against malice: who may write into the folder may do so as the user. */
static void add_to_sums(uint64_t sums[2], const void *data, size_t size_bytes)
{
    const unsigned char *at = data;
    uint64_t a = sums[0] ^ size_bytes, b = sums[1] + size_bytes;
    for (; size_bytes; at += 8) {
        uint64_t word = 0;
        size_t n = size_bytes < 8 ? size_bytes : 8;
        memcpy(&word, at, n);
        size_bytes -= n;
        a = mix(a ^ word);
        b = (b ^ (b >> 29) ^ word) * 0x9e3779b97f4a7c15u + 0x7f4a7c15u;
    }
    sums[0] = a;
    sums[1] = mix(b);
}

/* ---- where, and what ---- */

static void driver_text(const karst_context *context, char text[1024])
{
    char values[5][200] = {"", "", "", "", ""};
    clGetPlatformInfo(context->platform, CL_PLATFORM_NAME, sizeof values[0] - 1, values[0], NULL);
    clGetPlatformInfo(context->platform, CL_PLATFORM_VERSION, sizeof values[1] - 1, values[1], NULL);
    clGetDeviceInfo(context->device, CL_DEVICE_NAME, sizeof values[2] - 1, values[2], NULL);
    clGetDeviceInfo(context->device, CL_DEVICE_VERSION, sizeof values[3] - 1, values[3], NULL);
    clGetDeviceInfo(context->device, CL_DRIVER_VERSION, sizeof values[4] - 1, values[4], NULL);
    snprintf(text, 1024, "%s\n%s\n%s\n%s\n%s", values[0], values[1], values[2], values[3], values[4]);
}

void karst_program_key_init(karst_program_key *key, const karst_context *context, const char *entry,
                            const char *options, const char *source)
{
    char driver[1024];
    key->text = NULL;
    key->length_bytes = 0;
    if (!karst_store_folder("programs", false, key->folder))
        return;
    driver_text(context, driver);
    size_t size_bytes = strlen(driver) + strlen(entry) + strlen(options) + strlen(source) + 64;
    key->text = malloc(size_bytes);
    if (!key->text) {
        key->folder[0] = 0;
        return;
    }
    int length = snprintf(key->text, size_bytes, "%s\n%s\n%s\n%s\n%s", KARST_VERSION, driver, entry, options, source);
    key->length_bytes = (size_t)length;
    uint64_t sums[2] = {1, 2};
    add_to_sums(sums, key->text, key->length_bytes);
    snprintf(key->path, sizeof key->path, "%s/%016llx%016llx" SUFFIX, key->folder, (unsigned long long)sums[0],
             (unsigned long long)sums[1]);
}

void karst_program_key_free(karst_program_key *key)
{
    free(key->text);
    key->text = NULL;
}

/* ---- taking turns ---- */

#define TURN_TRIES 6000
#define TURN_STEP_NS 20000000

int karst_program_cache_take_turn(const karst_program_key *key)
{
    char path[sizeof key->path + 8];
    const char *name = key->folder[0] ? strrchr(key->path, '/') : NULL;
    if (!name)
        return -1;
    /* One of 256 files, which stay: programs that share one by chance wait for one another without need. */
    snprintf(path, sizeof path, "%s/.turn-%.2s", key->folder, name + 1);
    const int turn = open(path, O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0600);
    for (int i = 0; turn >= 0 && i < TURN_TRIES; i++) {
        if (flock(turn, LOCK_EX | LOCK_NB) == 0)
            return turn;
        if (errno != EWOULDBLOCK && errno != EINTR)
            break;
        nanosleep(&(struct timespec){.tv_nsec = TURN_STEP_NS}, NULL);
    }
    if (turn >= 0)
        close(turn);
    return -1;
}

void karst_program_cache_end_turn(int turn)
{
    if (turn >= 0)
        close(turn);
}

/* ---- reading ---- */

/* The whole entry, malloc'ed; NULL if it is not there or is not the user's own file. */
static unsigned char *read_entry(const char *path, size_t *size_bytes)
{
    int fd = open(path, O_RDONLY | O_NOFOLLOW | O_CLOEXEC);
    struct stat info;
    unsigned char *data = NULL;
    if (fd < 0)
        return NULL;
    if (fstat(fd, &info) == 0 && S_ISREG(info.st_mode) && info.st_uid == geteuid() && info.st_size > 0 &&
        (uint64_t)info.st_size <= MAX_ENTRY_BYTES)
        data = malloc((size_t)info.st_size);
    size_t length = 0;
    while (data && length < (size_t)info.st_size) {
        ssize_t n = read(fd, data + length, (size_t)info.st_size - length);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            break;
        length += (size_t)n;
    }
    if (data)
        futimens(fd, (const struct timespec[2]){{.tv_nsec = UTIME_NOW}, {.tv_nsec = UTIME_NOW}}); /* used now */
    close(fd);
    *size_bytes = length;
    return data;
}

/* The binary in an entry for this very key; NULL if anything is wrong with it. */
static const unsigned char *find_binary(const unsigned char *data, size_t size_bytes, const karst_program_key *key,
                                        size_t *binary_bytes)
{
    entry_header header;
    uint64_t sums[2] = {3, 4};
    if (size_bytes < sizeof header)
        return NULL;
    memcpy(&header, data, sizeof header);
    size_t rest = size_bytes - sizeof header;
    if (memcmp(header.magic, magic, sizeof magic) != 0 || header.key_bytes != key->length_bytes ||
        rest < key->length_bytes || header.binary_bytes != rest - key->length_bytes || header.binary_bytes == 0)
        return NULL;
    add_to_sums(sums, data + sizeof header, rest);
    if (sums[0] != header.sums[0] || sums[1] != header.sums[1] ||
        memcmp(data + sizeof header, key->text, key->length_bytes) != 0)
        return NULL;
    *binary_bytes = (size_t)header.binary_bytes;
    return data + sizeof header + key->length_bytes;
}

cl_program karst_program_cache_load(karst_context *context, const karst_program_key *key, const char *options)
{
    size_t size_bytes = 0, binary_bytes = 0;
    unsigned char *data = key->folder[0] ? read_entry(key->path, &size_bytes) : NULL;
    if (!data)
        return NULL;
    const unsigned char *binary = find_binary(data, size_bytes, key, &binary_bytes);
    cl_program program = NULL;
    if (binary) {
        cl_int status = CL_SUCCESS, code = CL_SUCCESS;
        program = clCreateProgramWithBinary(context->cl, 1, &context->device, &binary_bytes, &binary, &status, &code);
        if (code == CL_SUCCESS && status == CL_SUCCESS)
            code = clBuildProgram(program, 1, &context->device, options, NULL, NULL);
        if (program && (code != CL_SUCCESS || status != CL_SUCCESS)) {
            clReleaseProgram(program);
            program = NULL;
        }
    }
    if (!program) {
        karst_log_print(context->log, KARST_LOG_DEBUG, "%s is damaged or no longer fits: building anew", key->path);
        unlink(key->path);
    }
    free(data);
    return program;
}

/* ---- writing ---- */

typedef struct {
    char path[1100];
    uint64_t size_bytes;
    struct timespec used;
} kept_entry;

static int compare_used(const void *a, const void *b)
{
    const struct timespec *x = &((const kept_entry *)a)->used, *y = &((const kept_entry *)b)->used;
    if (x->tv_sec != y->tv_sec)
        return x->tv_sec < y->tv_sec ? -1 : 1;
    return (x->tv_nsec > y->tv_nsec) - (x->tv_nsec < y->tv_nsec);
}

static bool has_suffix(const char *name, const char *suffix)
{
    size_t length = strlen(name), n = strlen(suffix);
    return length > n && strcmp(name + length - n, suffix) == 0;
}

/* Deletes what was not used for longest, until all fit; and what dead processes left. */
static void trim(const char *folder)
{
    kept_entry *entries = malloc(MAX_ENTRIES * sizeof *entries);
    DIR *dir = entries ? opendir(folder) : NULL;
    size_t num = 0;
    uint64_t sum = 0;
    const struct dirent *found;
    while (dir && num < MAX_ENTRIES && (found = readdir(dir)) != NULL) {
        kept_entry *entry = &entries[num];
        struct stat info;
        int length = snprintf(entry->path, sizeof entry->path, "%s/%s", folder, found->d_name);
        if (length < 0 || (size_t)length >= sizeof entry->path || lstat(entry->path, &info) != 0 ||
            !S_ISREG(info.st_mode))
            continue;
        if (has_suffix(found->d_name, TEMPORARY_SUFFIX) && time(NULL) - info.st_mtime > TEMPORARY_AGE_S)
            unlink(entry->path);
        if (!has_suffix(found->d_name, SUFFIX))
            continue;
        entry->size_bytes = (uint64_t)info.st_size;
        entry->used = info.st_mtim;
        sum += entry->size_bytes;
        num++;
    }
    if (dir)
        closedir(dir);
    if (sum > KARST_PROGRAM_CACHE_BYTES || num == MAX_ENTRIES) {
        /* Down to three quarters, so that it is not done again at once. */
        qsort(entries, num, sizeof *entries, compare_used);
        for (size_t i = 0; i < num && (sum > KARST_PROGRAM_CACHE_BYTES * 3 / 4 || num - i > MAX_ENTRIES * 3 / 4); i++) {
            unlink(entries[i].path);
            sum -= entries[i].size_bytes;
        }
    }
    free(entries);
}

static bool write_all(int fd, const void *data, size_t size_bytes)
{
    const char *at = data;
    while (size_bytes) {
        ssize_t n = write(fd, at, size_bytes);
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0)
            return false;
        at += n;
        size_bytes -= (size_t)n;
    }
    return true;
}

static bool write_entry(const karst_program_key *key, const unsigned char *binary, size_t binary_bytes)
{
    entry_header header = {.key_bytes = key->length_bytes, .binary_bytes = binary_bytes};
    unsigned char *data = malloc(sizeof header + key->length_bytes + binary_bytes);
    char temporary[1100];
    snprintf(temporary, sizeof temporary, "%s/XXXXXX" TEMPORARY_SUFFIX, key->folder);
    int fd = data ? mkostemps(temporary, sizeof TEMPORARY_SUFFIX - 1, O_CLOEXEC) : -1;
    if (fd < 0) {
        free(data);
        return false;
    }
    memcpy(header.magic, magic, sizeof magic);
    memcpy(data + sizeof header, key->text, key->length_bytes);
    memcpy(data + sizeof header + key->length_bytes, binary, binary_bytes);
    header.sums[0] = 3;
    header.sums[1] = 4;
    add_to_sums(header.sums, data + sizeof header, key->length_bytes + binary_bytes);
    memcpy(data, &header, sizeof header);
    bool ok = write_all(fd, data, sizeof header + key->length_bytes + binary_bytes);
    ok = close(fd) == 0 && ok && rename(temporary, key->path) == 0;
    if (!ok)
        unlink(temporary);
    free(data);
    return ok;
}

/* Fetches the binary of a program built for this one device, and writes it. */
static bool keep(const karst_program_key *key, cl_program program)
{
    size_t binary_bytes = 0;
    if (clGetProgramInfo(program, CL_PROGRAM_BINARY_SIZES, sizeof binary_bytes, &binary_bytes, NULL) != CL_SUCCESS ||
        binary_bytes == 0 || binary_bytes > MAX_ENTRY_BYTES - sizeof(entry_header) - key->length_bytes)
        return false;
    unsigned char *binary = malloc(binary_bytes);
    bool ok = binary && clGetProgramInfo(program, CL_PROGRAM_BINARIES, sizeof binary, &binary, NULL) == CL_SUCCESS &&
              write_entry(key, binary, binary_bytes);
    free(binary);
    if (ok)
        trim(key->folder);
    return ok;
}

/* ---- what is to be kept later ---- */

struct karst_program_backlog {
    karst_program_key key;
    cl_program program;
    struct karst_program_backlog *next;
};

static void free_first(karst_context *context)
{
    struct karst_program_backlog *first = context->program_backlog;
    context->program_backlog = first->next;
    karst_program_key_free(&first->key);
    clReleaseProgram(first->program);
    free(first);
}

void karst_program_cache_finish(karst_context *context)
{
    /* Nothing else may go on in the driver meanwhile: PoCL 3.1 dies when it builds and runs at the same time. */
    if (context->program_backlog)
        clFinish(context->queue);
    while (context->program_backlog) {
        if (access(context->program_backlog->key.path, R_OK) != 0) /* another engine or process was faster */
            keep(&context->program_backlog->key, context->program_backlog->program);
        free_first(context);
    }
}

void karst_program_cache_drop(karst_context *context)
{
    while (context->program_backlog)
        free_first(context);
}

void karst_program_cache_move(karst_context *from, karst_context *to)
{
    struct karst_program_backlog **end = &to->program_backlog;
    while (*end)
        end = &(*end)->next;
    *end = from->program_backlog;
    from->program_backlog = NULL;
}

static void keep_later(karst_context *context, const karst_program_key *key, cl_program program)
{
    struct karst_program_backlog *entry = calloc(1, sizeof *entry);
    if (!entry)
        return;
    entry->key = *key;
    entry->key.text = malloc(key->length_bytes);
    if (!entry->key.text || clRetainProgram(program) != CL_SUCCESS) {
        free(entry->key.text);
        free(entry);
        return;
    }
    memcpy(entry->key.text, key->text, key->length_bytes);
    entry->program = program;
    entry->next = context->program_backlog;
    context->program_backlog = entry;
}

void karst_program_cache_store(karst_context *context, const karst_program_key *key, cl_program program)
{
    if (!key->folder[0])
        return;
    if (karst_context_is_pocl(context)) /* it compiles every kernel once more before it gives a binary out */
        keep_later(context, key, program);
    else if (!keep(key, program))
        karst_log_print(context->log, KARST_LOG_DEBUG, "%s could not be kept", key->path);
}
