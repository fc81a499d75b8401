#include <errno.h>
#include <dirent.h>
#include <fcntl.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <signal.h>
#include <unistd.h>

#include <cmocka.h>

#include "karst/image.h"
#include "tests/support/files.h"

static char folder[] = "/tmp/karst-image-XXXXXX";

static const char *in_folder(const char *name)
{
    static char path[4][512];
    static int next;
    char *p = path[next++ % 4];
    snprintf(p, sizeof path[0], "%s/%s", folder, name);
    return p;
}

static int num_files(void)
{
    DIR *directory = opendir(folder);
    assert_non_null(directory);
    int count = 0;
    for (struct dirent *entry; (entry = readdir(directory));)
        count += strcmp(entry->d_name, ".") != 0 && strcmp(entry->d_name, "..") != 0;
    closedir(directory);
    return count;
}

static int make_folder(void **state)
{
    (void)state;
    return mkdtemp(folder) ? 0 : -1;
}

static int clean_folder(void **state)
{
    (void)state;
    DIR *directory = opendir(folder);
    if (!directory)
        return -1;
    for (struct dirent *entry; (entry = readdir(directory));)
        unlinkat(dirfd(directory), entry->d_name, 0);
    closedir(directory);
    return 0;
}

static int remove_folder(void **state)
{
    clean_folder(state);
    return rmdir(folder);
}

static uint8_t *pattern(int width, int height, unsigned seed)
{
    size_t size = (size_t)width * (size_t)height * 4;
    uint8_t *rgba = malloc(size);
    assert_non_null(rgba);
    for (size_t i = 0; i < size; i++) {
        seed = seed * 1664525u + 1013904223u;
        rgba[i] = (uint8_t)(seed >> 24);
    }
    return rgba;
}

static void test_round_trip(void **state)
{
    (void)state;
    const int sizes[][2] = {{1, 1}, {7, 5}, {1, 300}, {16384, 1}, {640, 480}};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        int width = sizes[i][0], height = sizes[i][1], back_width = 0, back_height = 0;
        uint8_t *rgba = pattern(width, height, (unsigned)i);
        karst_error error = {0};
        if (!karst_image_write_png(in_folder("a.png"), rgba, width, height, &error))
            fail_msg("%s", error.message);
        uint8_t *back = karst_image_read_png(in_folder("a.png"), &back_width, &back_height, &error);
        if (!back)
            fail_msg("%s", error.message);
        assert_int_equal(back_width, width);
        assert_int_equal(back_height, height);
        for (size_t at = 0; at < (size_t)width * (size_t)height * 4; at++)
            if (back[at] != (at % 4 == 3 ? 255 : rgba[at]))
                fail_msg("byte %zu of %d x %d", at, width, height);
        free(back);
        free(rgba);
    }
    assert_int_equal(num_files(), 1);
}

static void test_same_bytes_and_no_time(void **state)
{
    (void)state;
    uint8_t *rgba = pattern(65, 33, 7);
    assert_true(karst_image_write_png(in_folder("a.png"), rgba, 65, 33, NULL));
    for (int i = 3; i < 65 * 33 * 4; i += 4)
        rgba[i] ^= 0x5A; /* alpha is not in the file */
    assert_true(karst_image_write_png(in_folder("b.png"), rgba, 65, 33, NULL));
    size_t size_a, size_b;
    char *a = read_file(in_folder("a.png"), &size_a), *b = read_file(in_folder("b.png"), &size_b);
    assert_int_equal(size_a, size_b);
    assert_memory_equal(a, b, size_a);
    /* Only what a picture needs: IHDR, IDATs, IEND. */
    int num_chunks = 0;
    for (size_t at = 8; at + 12 <= size_a; num_chunks++) {
        const unsigned char *length = (const unsigned char *)a + at;
        const char *type = a + at + 4;
        if (memcmp(type, "IHDR", 4) && memcmp(type, "IDAT", 4) && memcmp(type, "IEND", 4))
            fail_msg("chunk %.4s", type);
        at += 12 + (((size_t)length[0] << 24) | ((size_t)length[1] << 16) | ((size_t)length[2] << 8) | length[3]);
    }
    assert_true(num_chunks >= 3);
    free(a);
    free(b);
    free(rgba);
}

static void test_bad_sizes(void **state)
{
    (void)state;
    const uint8_t pixel[4] = {0};
    const int sizes[][2] = {{0, 1}, {1, 0}, {-1, 1}, {16385, 1}, {1, 100000}, {0, 0}};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        karst_error error = {0};
        assert_false(karst_image_write_png(in_folder("a.png"), pixel, sizes[i][0], sizes[i][1], &error));
        assert_int_equal(error.status, KARST_USAGE);
        assert_non_null(strstr(error.message, "16384"));
    }
    assert_int_equal(num_files(), 0);
}

static void assert_write_fails(const char *path, int reason)
{
    const uint8_t pixel[4] = {1, 2, 3, 4};
    karst_error error = {0};
    assert_false(karst_image_write_png(path, pixel, 1, 1, &error));
    assert_int_equal(error.status, KARST_FAILED);
    assert_non_null(strstr(error.message, path));
    if (!strstr(error.message, strerror(reason)))
        fail_msg("%s", error.message);
}

static void test_unwritable(void **state)
{
    (void)state;
    assert_write_fails(in_folder("none/a.png"), ENOENT);
    assert_write_fails(folder, EISDIR);
    assert_write_fails("", ENOENT);
    write_file(in_folder("file"), "x", 1);
    assert_write_fails(in_folder("file/a.png"), ENOTDIR);
    assert_write_fails("/dev/full", ENOSPC);
    char name[400];
    memset(name, 'n', sizeof name);
    strcpy(name + 300, ".png");
    assert_write_fails(in_folder(name), ENAMETOOLONG);
    if (geteuid() != 0) { /* root may do anything */
        chmod(in_folder("file"), 0444);
        assert_write_fails(in_folder("file"), EACCES);
    }
    assert_int_equal(num_files(), 1);
}

/* The disk fills up half way (a limit on file size in a child): the old file stays, nothing else does. */
static void test_failure_leaves_the_old_file(void **state)
{
    (void)state;
    write_file(in_folder("a.png"), "old", 3);
    pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        const struct rlimit limit = {1000, 1000};
        signal(SIGXFSZ, SIG_IGN);
        setrlimit(RLIMIT_FSIZE, &limit);
        uint8_t *rgba = pattern(100, 100, 3); /* noise: about 30 kB */
        karst_error error = {0};
        bool written = karst_image_write_png(in_folder("a.png"), rgba, 100, 100, &error);
        _exit(!written && error.status == KARST_FAILED && strstr(error.message, strerror(EFBIG)) ? 0 : 1);
    }
    int status = -1;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_int_equal(status, 0);
    size_t size;
    char *bytes = read_file(in_folder("a.png"), &size);
    assert_int_equal(size, 3);
    assert_memory_equal(bytes, "old", 3);
    free(bytes);
    assert_int_equal(num_files(), 1);
}

static void test_links_and_devices_stay(void **state)
{
    (void)state;
    const uint8_t pixel[4] = {1, 2, 3, 4};
    write_file(in_folder("real"), "old", 3);
    assert_int_equal(symlink("real", in_folder("link.png")), 0);
    assert_true(karst_image_write_png(in_folder("link.png"), pixel, 1, 1, NULL));
    struct stat status;
    assert_int_equal(lstat(in_folder("link.png"), &status), 0);
    assert_true(S_ISLNK(status.st_mode));
    assert_int_equal(stat(in_folder("real"), &status), 0);
    assert_true(status.st_size > 3);
    /* A pipe stays a pipe, and the picture comes out of it. */
    assert_int_equal(mkfifo(in_folder("fifo"), 0600), 0);
    int reader = open(in_folder("fifo"), O_RDONLY | O_NONBLOCK);
    assert_true(reader >= 0);
    assert_true(karst_image_write_png(in_folder("fifo"), pixel, 1, 1, NULL));
    char signature[8] = {0};
    assert_int_equal(read(reader, signature, 8), 8);
    assert_memory_equal(signature, "\x89PNG\r\n\x1a\n", 8);
    close(reader);
    assert_int_equal(lstat(in_folder("fifo"), &status), 0);
    assert_true(S_ISFIFO(status.st_mode));
    /* A new file has the mode that umask leaves. */
    mode_t mask = umask(027);
    assert_true(karst_image_write_png(in_folder("new.png"), pixel, 1, 1, NULL));
    umask(mask);
    assert_int_equal(stat(in_folder("new.png"), &status), 0);
    assert_int_equal(status.st_mode & 0777, 0640);
}

static void assert_unreadable(const char *path, const char *says)
{
    int width = -7, height = -7;
    karst_error error = {0};
    assert_null(karst_image_read_png(path, &width, &height, &error));
    assert_int_equal(error.status, KARST_BAD_DATA);
    assert_non_null(strstr(error.message, path));
    if (!strstr(error.message, says))
        fail_msg("%s", error.message);
    assert_int_equal(width, -7);
    assert_int_equal(height, -7);
}

static void test_bad_files(void **state)
{
    (void)state;
    assert_unreadable(in_folder("none.png"), strerror(ENOENT));
    write_file(in_folder("text.png"), "not a picture", 13);
    assert_unreadable(in_folder("text.png"), "Not a PNG");
    write_file(in_folder("empty.png"), "", 0);
    assert_unreadable(in_folder("empty.png"), "");

    uint8_t *rgba = pattern(50, 40, 1);
    assert_true(karst_image_write_png(in_folder("a.png"), rgba, 50, 40, NULL));
    free(rgba);
    size_t size;
    char *bytes = read_file(in_folder("a.png"), &size);
    for (size_t cut = 1; cut < size; cut += 97) { /* cut short anywhere */
        write_file(in_folder("cut.png"), bytes, cut);
        assert_unreadable(in_folder("cut.png"), "");
    }
    for (size_t at = 0; at < size - 12; at += 61) { /* a flipped bit anywhere: a checksum notices */
        bytes[at] ^= 4;
        write_file(in_folder("bad.png"), bytes, size);
        assert_unreadable(in_folder("bad.png"), "");
        bytes[at] ^= 4;
    }
    free(bytes);

    /* An 8-bit grey PNG of one pixel. */
    static const unsigned char grey[] = {
        0x89, 'P',  'N',  'G',  13,  10,  26,  10,   0,    0,    0,    13,  'I',  'H',  'D',  'R',  0,
        0,    0,    1,    0,    0,   0,   1,   8,    0,    0,    0,    0,   0x3A, 0x7E, 0x9B, 0x55, 0,
        0,    0,    10,   'I',  'D', 'A', 'T', 0x78, 0x9C, 0x63, 0x60, 0,   0,    0,    2,    0,    1,
        0x48, 0xAF, 0xA4, 0x71, 0,   0,   0,   0,    'I',  'E',  'N',  'D', 0xAE, 0x42, 0x60, 0x82};
    write_file(in_folder("grey.png"), grey, sizeof grey);
    assert_unreadable(in_folder("grey.png"), "not 8-bit RGB");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(test_round_trip, clean_folder),
        cmocka_unit_test_setup(test_same_bytes_and_no_time, clean_folder),
        cmocka_unit_test_setup(test_bad_sizes, clean_folder),
        cmocka_unit_test_setup(test_unwritable, clean_folder),
        cmocka_unit_test_setup(test_failure_leaves_the_old_file, clean_folder),
        cmocka_unit_test_setup(test_links_and_devices_stay, clean_folder),
        cmocka_unit_test_setup(test_bad_files, clean_folder),
    };
    return cmocka_run_group_tests_name("image", tests, make_folder, remove_folder);
}
