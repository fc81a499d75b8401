#include "producers/language/image/image_file.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "core/device/store.h"

/* Behind the words, at the next multiple of a page. */
typedef struct {
    char magic[8];
    uint32_t version, facts_bytes;
    karst_image_facts facts;
    char key[KARST_IMAGE_KEY_BYTES];
    uint64_t sum; /* of all before */
} file_end;

#define MAGIC "KarstImg"
#define VERSION 1u
#define FOLDER "images"
/* Files that nobody used for so long go when another is made. */
#define MOST_IDLE_S (14 * 24 * 3600)
#define MOST_BEGUN_S (24 * 3600)

static size_t whole_pages(size_t num_bytes)
{
    const size_t page = (size_t)sysconf(_SC_PAGESIZE);
    return (num_bytes + page - 1) / page * page;
}

static uint64_t sum_of(const void *bytes, size_t num)
{
    const unsigned char *at = bytes;
    uint64_t sum = 0xcbf29ce484222325u;
    for (size_t i = 0; i < num; i++)
        sum = (sum ^ at[i]) * 0x100000001b3u;
    return sum;
}

/* False: there is no store, or the key is too long to be kept. */
static bool path_of(karst_image_file *file, const char *key)
{
    char folder[1024];
    file->path[0] = file->begun[0] = 0;
    if (strlen(key) >= KARST_IMAGE_KEY_BYTES || !karst_store_folder(FOLDER, false, folder))
        return false;
    snprintf(file->path, sizeof file->path, "%s/%016llx.image", folder, (unsigned long long)sum_of(key, strlen(key)));
    snprintf(file->begun, sizeof file->begun, "%s.%ld.begun", file->path, (long)getpid());
    return true;
}

static bool map(karst_image_file *file, size_t words_bytes, int protection)
{
    file->memory_bytes = whole_pages(words_bytes);
    void *memory = mmap(NULL, file->memory_bytes, protection, MAP_SHARED, file->fd, 0);
    file->memory = memory == MAP_FAILED ? NULL : memory;
    return file->memory;
}

/* ---- finding ---- */

static bool read_end(const karst_image_file *file, const char *key, file_end *end)
{
    struct stat about;
    if (fstat(file->fd, &about) != 0 || about.st_size < (off_t)sizeof *end ||
        pread(file->fd, end, sizeof *end, about.st_size - (off_t)sizeof *end) != (ssize_t)sizeof *end)
        return false;
    return memcmp(end->magic, MAGIC, sizeof end->magic) == 0 && end->version == VERSION &&
           end->facts_bytes == sizeof end->facts && end->sum == sum_of(end, offsetof(file_end, sum)) &&
           strncmp(end->key, key, sizeof end->key) == 0 && end->facts.words_bytes <= (uint64_t)about.st_size &&
           whole_pages((size_t)end->facts.words_bytes) + sizeof *end == (uint64_t)about.st_size;
}

bool karst_image_file_find(karst_image_file *file, const char *key, karst_image_facts *facts)
{
    file_end *end = malloc(sizeof *end);
    *file = (karst_image_file){.is_open = true, .fd = -1, .lock = -1};
    bool found = end && path_of(file, key) && (file->fd = open(file->path, O_RDONLY | O_CLOEXEC)) >= 0 &&
                 read_end(file, key, end) && map(file, (size_t)end->facts.words_bytes, PROT_READ);
    if (found) {
        *facts = end->facts;
        facts->kind[sizeof facts->kind - 1] = 0;
        utimensat(AT_FDCWD, file->path, NULL, 0); /* it was used */
    }
    free(end);
    if (!found)
        karst_image_file_close(file);
    return found;
}

/* ---- making ---- */

/* What nobody used for long, and what was begun by processes that died. */
static void sweep(const char *folder)
{
    DIR *list = opendir(folder);
    for (struct dirent *entry; list && (entry = readdir(list));) {
        struct stat about;
        char path[1400];
        const bool begun = strstr(entry->d_name, ".begun"), kept = !begun && strstr(entry->d_name, ".image");
        if ((!begun && !kept) || (size_t)snprintf(path, sizeof path, "%s/%s", folder, entry->d_name) >= sizeof path)
            continue;
        if (stat(path, &about) == 0 && time(NULL) - about.st_mtime > (begun ? MOST_BEGUN_S : MOST_IDLE_S))
            unlink(path);
    }
    if (list)
        closedir(list);
}

/* One process at a time makes a file of the store's: another may wait for the same one. */
static void take_lock(karst_image_file *file)
{
    char folder[1024], path[1100];
    if (!karst_store_folder(FOLDER, false, folder))
        return;
    snprintf(path, sizeof path, "%s/lock", folder);
    file->lock = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0600);
    while (file->lock >= 0 && flock(file->lock, LOCK_EX) != 0 && errno == EINTR)
        ;
    sweep(folder);
}

static int open_nameless(void)
{
    const char *named = getenv("TMPDIR");
    char path[1100];
    snprintf(path, sizeof path, "%.1000s/karst-image-XXXXXX", named && *named ? named : "/tmp");
    int fd = mkstemp(path);
    if (fd >= 0)
        unlink(path);
    return fd;
}

bool karst_image_file_begin(karst_image_file *file, const char *key, size_t words_bytes, karst_error *error)
{
    *file = (karst_image_file){.is_open = true, .fd = -1, .lock = -1};
    if (key && path_of(file, key)) {
        take_lock(file);
        file->fd = open(file->begun, O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    }
    if (file->fd < 0) {
        file->path[0] = file->begun[0] = 0;
        file->fd = open_nameless();
    }
    int code =
        file->fd < 0 ? errno : posix_fallocate(file->fd, 0, (off_t)(whole_pages(words_bytes) + sizeof(file_end)));
    if (code == 0 && map(file, words_bytes, PROT_READ | PROT_WRITE))
        return true;
    karst_fail(error, KARST_FAILED, "no room for an image's %zu MB in %s: %s; KARST_CACHE_DIR names another folder",
               words_bytes / 1000000, file->path[0] ? file->path : "the folder of temporary files",
               strerror(code ? code : errno));
    karst_image_file_close(file);
    return false;
}

bool karst_image_file_keep(karst_image_file *file, const char *key, const karst_image_facts *facts, karst_error *error)
{
    file_end *end = file->path[0] ? calloc(1, sizeof *end) : NULL;
    bool done = mprotect(file->memory, file->memory_bytes, PROT_READ) == 0;
    if (end) {
        *end = (file_end){.version = VERSION, .facts_bytes = sizeof end->facts, .facts = *facts};
        memcpy(end->magic, MAGIC, sizeof end->magic);
        snprintf(end->key, sizeof end->key, "%s", key);
        end->sum = sum_of(end, offsetof(file_end, sum));
        done = done && pwrite(file->fd, end, sizeof *end, (off_t)file->memory_bytes) == (ssize_t)sizeof *end &&
               fsync(file->fd) == 0 && rename(file->begun, file->path) == 0;
    }
    free(end);
    if (file->lock >= 0)
        close(file->lock);
    file->lock = -1;
    if (done)
        file->begun[0] = 0;
    return done || karst_fail(error, KARST_FAILED, "cannot keep an image in %s: %s", file->path, strerror(errno));
}

void karst_image_file_close(karst_image_file *file)
{
    if (file->memory)
        munmap(file->memory, file->memory_bytes);
    if (file->begun[0])
        unlink(file->begun);
    if (file->is_open && file->fd >= 0)
        close(file->fd);
    if (file->is_open && file->lock >= 0)
        close(file->lock);
    *file = (karst_image_file){.is_open = false};
}

void karst_image_file_let_go(const karst_image_file *file)
{
    if (file->memory)
        madvise(file->memory, file->memory_bytes, MADV_DONTNEED);
}
