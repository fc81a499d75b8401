/* Large images lie in files: their words are those of the same image in memory; what was kept is found by its key
 * alone, and taken only if it is whole; a world's data have its pages, and give the bits of a copy. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>
#include <dirent.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "producers/language/graph/words.h"
#include "producers/language/image/image.h"
#include "producers/language/language.h"
#include "tests/noise/random.h"

static char folder[] = "/tmp/karst-images-XXXXXX";

enum { WIDTH = 75, HEIGHT = 40 };
static float samples[WIDTH * HEIGHT];

static const karst_wrap wraps[] = {KARST_WRAP_CLAMP, KARST_WRAP_REPEAT, KARST_WRAP_MIRROR};

static void build_in_file(karst_samples_image *image, const char *key, karst_wrap wrap)
{
    karst_error error = {0};
    const karst_image_room room = {.key = key,
                                   .facts = {.width = WIDTH, .height = HEIGHT, .num_channels = 1, .kind = "test"}};
    if (!karst_samples_image_build_in(image, &room, samples, WIDTH, HEIGHT, 1, wrap, &error))
        fail_msg("%s", error.message);
    assert_true(image->file.is_open);
}

/* Whole pages of a file, the image's words first and then zeros. */
static void assert_same(const karst_samples_image *file, const karst_samples_image *memory)
{
    assert_true(file->num_words >= memory->num_words && file->num_words % 512 == 0);
    assert_memory_equal(file->words, memory->words, memory->num_words * sizeof *memory->words);
    for (uint32_t i = memory->num_words; i < file->num_words; i++)
        assert_true(file->words[i] == 0);
    assert_memory_equal(file->size, memory->size, sizeof file->size);
    assert_memory_equal(file->period, memory->period, sizeof file->period);
    assert_true(file->low == memory->low && file->high == memory->high && file->bound_bytes == memory->bound_bytes);
}

static void test_words_are_those_of_memory(void **state)
{
    (void)state;
    for (int i = 0; i < 3; i++) {
        karst_samples_image memory, made, found;
        karst_image_facts facts;
        karst_error error = {0};
        char key[40];
        snprintf(key, sizeof key, "wrap %d", i);
        assert_true(karst_samples_image_build(&memory, samples, WIDTH, HEIGHT, 1, wraps[i], &error));
        assert_false(karst_samples_image_find(&found, key, wraps[i], &facts));
        build_in_file(&made, key, wraps[i]);
        assert_same(&made, &memory);
        assert_true(karst_samples_image_find(&found, key, wraps[i], &facts));
        assert_same(&found, &memory);
        assert_true(found.digest == made.digest && facts.width == WIDTH && facts.height == HEIGHT);
        assert_string_equal(facts.kind, "test");
        karst_image_file_let_go(&found.file);
        assert_same(&found, &memory);
        karst_samples_image_finish(&found);
        karst_samples_image_finish(&made);
        assert_false(karst_samples_image_find(&found, "wrap", wraps[i], &facts));
        /* One that has no name is as good, and leaves nothing. */
        build_in_file(&made, NULL, wraps[i]);
        assert_same(&made, &memory);
        karst_samples_image_finish(&made);
        karst_samples_image_finish(&memory);
    }
}

/* The only file of the store's. */
static void find_path(char path[1400])
{
    char images[1100];
    snprintf(images, sizeof images, "%s/images", folder);
    DIR *list = opendir(images);
    assert_non_null(list);
    path[0] = 0;
    for (struct dirent *entry; (entry = readdir(list));)
        if (strstr(entry->d_name, ".image")) {
            assert_true(!path[0]);
            snprintf(path, 1400, "%s/%s", images, entry->d_name);
        }
    closedir(list);
    assert_true(path[0]);
}

static void remove_kept(void)
{
    char command[200];
    snprintf(command, sizeof command, "rm -rf %s/images", folder);
    assert_int_equal(system(command), 0);
}

static void change_byte(const char *path, off_t at)
{
    unsigned char byte;
    int fd = open(path, O_RDWR);
    assert_int_equal(pread(fd, &byte, 1, at), 1);
    byte ^= 4;
    assert_int_equal(pwrite(fd, &byte, 1, at), 1);
    close(fd);
}

static void test_what_is_damaged_is_not_taken(void **state)
{
    (void)state;
    char path[1400];
    struct stat about;
    karst_samples_image image;
    karst_image_facts facts;
    remove_kept();
    build_in_file(&image, "damage", KARST_WRAP_CLAMP);
    karst_samples_image_finish(&image);
    find_path(path);
    assert_int_equal(stat(path, &about), 0);
    /* Every byte of the header that places anything, and some of the end. */
    for (off_t at = 0; at < (off_t)sizeof(karst_image_header); at++) {
        const off_t low = (off_t)offsetof(karst_image_header, low),
                    level = (off_t)offsetof(karst_image_header, num_axes);
        change_byte(path, at);
        const bool is_value = at >= low && at < level;
        assert_int_equal(karst_samples_image_find(&image, "damage", KARST_WRAP_CLAMP, &facts), is_value);
        karst_samples_image_finish(&image);
        change_byte(path, at);
    }
    for (off_t at = about.st_size - 8; at > about.st_size - 5200; at -= 97) {
        change_byte(path, at);
        assert_false(karst_samples_image_find(&image, "damage", KARST_WRAP_CLAMP, &facts));
        change_byte(path, at);
    }
    assert_false(karst_samples_image_find(&image, "damage", KARST_WRAP_REPEAT, &facts));
    assert_true(karst_samples_image_find(&image, "damage", KARST_WRAP_CLAMP, &facts));
    karst_samples_image_finish(&image);
    for (off_t size = about.st_size - 1; size > 0; size = size * 3 / 4) {
        assert_int_equal(truncate(path, size), 0);
        assert_false(karst_samples_image_find(&image, "damage", KARST_WRAP_CLAMP, &facts));
    }
}

/* A world whose image is exchanged for the same one in a file. */
static void test_a_world_has_its_pages(void **state)
{
    (void)state;
    static const char text[] =
        "/*{ \"voxel\": 0.25, \"data\": { \"d\": { \"file\": \"d.raw\", \"format\": \"float32\", "
        "\"shape\": [75, 40], \"size\": [750, 400] } } }*/\n"
        "float density(vec3 p) { return image(d, p.xz) + noise(p) - p.y; }\n";
    char name[200];
    bool ok;
    karst_error error = {0};
    snprintf(name, sizeof name, "%s/d.raw", folder);
    FILE *file = fopen(name, "wb");
    assert_int_equal(fwrite(samples, sizeof *samples, WIDTH * HEIGHT, file), WIDTH * HEIGHT);
    fclose(file);
    snprintf(name, sizeof name, "%s/world.karst", folder);
    karst_program_graph *program = karst_language_compile(name, text, strlen(text), NULL, 0, &ok, &error);
    assert_true(ok);
    karst_world_layout layout;
    assert_true(karst_world_layout_init(&layout, &program->world));
    assert_false(layout.has_mapped);
    karst_samples_image *image = &program->images->channel[0];
    karst_samples_image_finish(image);
    build_in_file(image, NULL, KARST_WRAP_CLAMP);
    assert_true(karst_world_layout_init(&layout, &program->world) && layout.has_mapped);
    const size_t num_bytes = layout.num_words * sizeof(uint64_t) + 800; /* something may stand behind */
    const int voxel_log2_m = program->header.voxel_log2_m;
    char *mapped = karst_world_words_create(&layout, num_bytes), *copied = calloc(1, num_bytes);
    assert_true(mapped && copied);
    assert_true(karst_world_data_fill(&layout, NULL, 1, voxel_log2_m, copied));
    /* Pages of the file are for reading: whoever writes there dies. */
    assert_true(karst_world_data_fill(&layout, NULL, 1, voxel_log2_m, mapped));
    memset(mapped + num_bytes - 800, 7, 800);
    memset(copied + num_bytes - 800, 7, 800);
    assert_memory_equal(mapped, copied, num_bytes);
    karst_words_copy copy;
    assert_true(karst_words_copy_create(&copy, &layout, mapped, num_bytes, &error));
    assert_int_equal(copy.num_maps, 1);
    karst_world_words_destroy(&layout, mapped, num_bytes);
    karst_words_copy_let_go(&copy);
    karst_program_graph_destroy(program);
    assert_memory_equal(copy.memory, copied, num_bytes);
    copied[0] ^= 1;
    copied[num_bytes - 1] ^= 1;
    karst_words_copy_update(&copy, copied);
    assert_memory_equal(copy.memory, copied, num_bytes);
    karst_words_copy_destroy(&copy);
    free(copied);
}

static int set_up(void **state)
{
    (void)state;
    random_state = 4;
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        samples[i] = (float)(40 * random_unit());
    return mkdtemp(folder) && setenv("KARST_CACHE_DIR", folder, 1) == 0 ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    char command[200];
    snprintf(command, sizeof command, "rm -rf %s", folder);
    return system(command);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_words_are_those_of_memory),
        cmocka_unit_test(test_what_is_damaged_is_not_taken),
        cmocka_unit_test(test_a_world_has_its_pages),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
