/* Voxels: what a file of them holds is the densities bit for bit, on the way back through Karst's own reader, also
 * compressed; parts of a world; what is refused; and files that are damaged anywhere, which are told or read, never
 * more. tests/cli/voxels.sh has NanoVDB's own headers read them. */
#include "tests/export/found_mesh.h"

#include <zlib.h>

#include "core/files/nano_layout.h"
#include "core/files/volume.h"
#include "karst/query.h"
#include "karst/voxels.h"
#include "tests/support/files.h"

static char path[] = "/tmp/karst_voxels_XXXXXX.nvdb";

static const char text[] =
    "/*{ \"voxel\": 0.25 }*/\n"
    "float density(vec3 p) { return 9.0 - length(p) + noise(p / 3.0); }\n"
    "float clear(vec3 p) { return 2.0 - length(p - vec3(0.0, 6.0, 0.0)); }\n"
    "medium air(vec3 p) { medium m; m.extinction = 0.01 * p.x; m.albedo = vec3(0.9); return m; }\n";

static karst_world *part_of(karst_world_part part)
{
    char world_path[] = "/tmp/karst_voxels_XXXXXX.karst";
    karst_error error = {0};
    const int fd = mkstemps(world_path, 6);
    assert_true(fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text) && close(fd) == 0);
    const karst_world_config config = {.world = world_path, .part = part};
    karst_world *world = karst_world_open(&config, &error);
    unlink(world_path);
    if (!world)
        fail_msg("%s", error.message);
    return world;
}

static const karst_voxels_config box = {
    .corner = {{1000000000000007, -20, -41}, {0, 0, 5}}, .num_voxels = {21, 40, 18}, .voxel_m = 0.5};

/* The box, moved to where the land is. */
static karst_voxels_config near_box(void)
{
    karst_voxels_config config = box;
    config.corner.voxel[0] = 7;
    return config;
}

static void write_voxels(const karst_world *world, karst_voxels_kind kind, const karst_voxels_config *config)
{
    karst_error error = {0};
    const karst_voxels_grid grid = {.world = world, .name = "one", .kind = kind};
    if (!karst_voxels_write(path, config, &grid, 1, NULL, NULL, NULL, &error))
        fail_msg("%s", error.message);
}

static void assert_holds_densities(const karst_world *world, const karst_voxels_config *config)
{
    const uint32_t num = 21 * 40 * 18;
    karst_position *at = malloc(num * sizeof *at);
    float *density = malloc(num * sizeof *density);
    karst_volume volume;
    karst_error error = {0};
    for (uint32_t i = 0; i < num; i++) {
        const double offset_m[3] = {(i % 21 + 0.5) * 0.5, (i / 21 % 40 + 0.5) * 0.5, (i / 840 + 0.5) * 0.5};
        at[i] = karst_position_add_m(config->corner, offset_m, -2);
    }
    const karst_query_config query = {.footprint_m = config->footprint_m};
    assert_true(karst_query_densities(world, &query, at, num, density, NULL));
    if (!karst_volume_read(path, "one", &volume, &error))
        fail_msg("%s", error.message);
    assert_true(volume.size[0] == 21 && volume.size[1] == 40 && volume.size[2] == 18 && volume.voxel_m == 0.5);
    assert_true(volume.first_m[0] == 0.25 && volume.first_m[1] == 0.25 && volume.first_m[2] == 0.25);
    assert_memory_equal(volume.values, density, num * sizeof *density);
    karst_volume_finish(&volume);
    free(density);
    free(at);
}

static void test_values_come_back_bit_for_bit(void **state)
{
    karst_world *world = part_of(KARST_WORLD_LAND);
    (void)state;
    for (int i = 0; i < 2; i++) {
        karst_voxels_config config = i ? box : near_box();
        config.footprint_m = i;
        write_voxels(world, KARST_VOXELS_DENSITY, &config);
        assert_holds_densities(world, &config);
    }
    karst_world_close(world);
}

/* Each part is a world of its own. */
static void test_parts_of_a_world(void **state)
{
    static const karst_position inside = {{0, 24, 0}, {0, 0, 0}};
    karst_world *clear = part_of(KARST_WORLD_CLEAR), *air = part_of(KARST_WORLD_AIR);
    karst_voxels_config config = near_box();
    karst_volume volume;
    float value[2];
    (void)state;
    assert_true(karst_query_densities(clear, &(karst_query_config){0}, &inside, 1, &value[0], NULL) && value[0] == 2);
    config.corner.voxel[0] = -20;
    write_voxels(air, KARST_VOXELS_FOG, &config);
    assert_true(karst_volume_read(path, NULL, &volume, NULL));
    /* what is 0 takes no place: the box begins where there is fog */
    assert_int_equal(volume.size[0], 11);
    for (uint32_t i = 0; i < volume.size[0]; i++)
        assert_true(fabs((double)volume.values[i] - 0.01 * (-5 + 0.5 * (i + 10.5))) < 1e-6);
    karst_volume_finish(&volume);
    karst_world_close(clear);
    karst_world_close(air);
    karst_error error = {0};
    const karst_world_config none = {.world = "hills", .part = KARST_WORLD_AIR};
    assert_null(karst_world_open(&none, &error));
    assert_true(error.status == KARST_USAGE && strstr(error.message, "medium air"));
}

static void test_distances_have_both_sides(void **state)
{
    karst_world *world = part_of(KARST_WORLD_LAND);
    karst_voxels_config config = {.corner = {{-60, -60, -60}, {0, 0, 0}}, .num_voxels = {60, 60, 60}, .voxel_m = 0.5};
    karst_volume volume;
    (void)state;
    write_voxels(world, KARST_VOXELS_DISTANCE, &config);
    assert_true(karst_volume_read(path, NULL, &volume, NULL));
    const size_t middle = ((size_t)volume.size[2] / 2 * volume.size[1] + volume.size[1] / 2) * volume.size[0];
    /* through the middle: far in air, nearer by half a metre from voxel to voxel, far in matter, and back */
    const float *row = volume.values + middle;
    const uint32_t last = volume.size[0] - 1;
    assert_true(row[volume.size[0] / 2] == -1.5f && row[0] > 0 && row[last] > 0);
    int num_crossings = 0;
    for (uint32_t i = 0; i < last; i++) {
        num_crossings += (row[i] > 0) != (row[i + 1] > 0);
        assert_true(fabsf(row[i + 1] - row[i]) < 0.56f);
    }
    assert_int_equal(num_crossings, 2);
    karst_volume_finish(&volume);
    karst_world_close(world);
}

/* ---- files of strangers ---- */

static void test_compressed_files(void **state)
{
    karst_world *world = part_of(KARST_WORLD_LAND);
    const karst_voxels_config config = near_box();
    const size_t head_bytes = sizeof(karst_nano_segment) + sizeof(karst_nano_record) + sizeof "one";
    size_t num_bytes;
    (void)state;
    write_voxels(world, KARST_VOXELS_DENSITY, &config);
    unsigned char *bytes = read_file(path, &num_bytes);
    uLongf packed_bytes = compressBound(num_bytes);
    unsigned char *packed = malloc(head_bytes + 8 + packed_bytes);
    assert_int_equal(compress(packed + head_bytes + 8, &packed_bytes, bytes + head_bytes, num_bytes - head_bytes),
                     Z_OK);
    memcpy(packed, bytes, head_bytes);
    const uint64_t length = packed_bytes, file_bytes = packed_bytes + 8;
    const uint16_t codec = KARST_NANO_CODEC_ZIP;
    memcpy(packed + head_bytes, &length, 8);
    memcpy(packed + offsetof(karst_nano_segment, codec), &codec, 2);
    memcpy(packed + sizeof(karst_nano_segment) + offsetof(karst_nano_record, file_bytes), &file_bytes, 8);
    write_file(path, packed, head_bytes + 8 + packed_bytes);
    assert_holds_densities(world, &config);
    packed[head_bytes + 8 + packed_bytes / 2] ^= 0xff;
    write_file(path, packed, head_bytes + 8 + packed_bytes);
    karst_volume volume;
    karst_error error = {0};
    assert_true(!karst_volume_read(path, NULL, &volume, &error) && strstr(error.message, "damaged"));
    free(packed);
    free(bytes);
    karst_world_close(world);
}

/* Whatever stands in a file: its bytes one by one are others where nodes lead to one another, anywhere else some are,
 * and it ends early. It is told, or read; it never takes more than its box. */
static void test_damaged_files_are_told_or_read(void **state)
{
    karst_world *world = part_of(KARST_WORLD_LAND);
    const karst_voxels_config config = {.corner = {{30, 0, 0}, {0, 0, 0}}, .num_voxels = {9, 9, 9}, .voxel_m = 0.5};
    size_t num_bytes;
    int num_told = 0, num_read = 0;
    (void)state;
    write_voxels(world, KARST_VOXELS_DENSITY, &config);
    unsigned char *bytes = read_file(path, &num_bytes);
    uint32_t random_state = 5;
    for (int n = 0; n < 1200; n++) {
        random_state = random_state * 1664525u + 1013904223u;
        /* the first 1,100 bytes are all that is not a table */
        const size_t at = n < 800 ? (size_t)n + n / 2 : random_state % num_bytes;
        const unsigned char kept = bytes[at];
        karst_volume volume = {0};
        karst_error error = {0};
        bytes[at] ^= (unsigned char)(n % 3 == 0 ? 0xff : 1 << random_state % 8);
        write_file(path, bytes, n % 10 == 9 ? at : num_bytes);
        bytes[at] = kept;
        if (karst_volume_read(path, NULL, &volume, &error)) {
            num_read++;
            karst_volume_finish(&volume);
            continue;
        }
        num_told++;
        assert_true(error.status == KARST_BAD_DATA && strstr(error.message, path));
        assert_null(volume.values);
    }
    print_message("%d files are told, %d are read\n", num_told, num_read);
    assert_true(num_told > 100 && num_read > 100);
    free(bytes);
    karst_world_close(world);
}

static void refuse(const karst_voxels_config *config, const karst_voxels_grid *grid, size_t num_grids, const char *to,
                   const char *said)
{
    karst_error error = {0};
    assert_false(karst_voxels_write(to, config, grid, num_grids, NULL, NULL, NULL, &error));
    assert_int_equal(error.status, KARST_USAGE);
    if (!strstr(error.message, said))
        fail_msg("%s", error.message);
}

static void test_refusals(void **state)
{
    karst_world *world = part_of(KARST_WORLD_LAND);
    const karst_voxels_grid grid = {.world = world, .name = "one"};
    (void)state;
    refuse(&box, &grid, 1, "a.vdb", ".nvdb");
    refuse(&box, &grid, 0, path, "0 grids");
    refuse(&box, &(karst_voxels_grid){.world = world, .name = ""}, 1, path, "0 bytes");
    refuse(&box, &(karst_voxels_grid){.world = world, .name = "a", .kind = (karst_voxels_kind)7}, 1, path, "no kind");
    karst_voxels_config config = box;
    config.num_voxels[1] = KARST_VOXELS_MAX_SIDE + 1;
    refuse(&config, &grid, 1, path, "along y");
    config = box;
    config.voxel_m = 0;
    refuse(&config, &grid, 1, path, "voxels of 0 m");
    config = box;
    config.footprint_m = -1;
    refuse(&config, &grid, 1, path, "footprint");
    config = box;
    config.num_threads = -1;
    refuse(&config, &grid, 1, path, "threads");
    config = box;
    config.corner.voxel[2] = INT64_C(1) << 61;
    refuse(&config, &grid, 1, path, "leaves the world along z");
    karst_world_close(world);
}

static int make_path(void **state)
{
    (void)state;
    const int fd = mkstemps(path, 5);
    return fd >= 0 ? close(fd) : -1;
}

static int remove_path(void **state)
{
    (void)state;
    return unlink(path);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_values_come_back_bit_for_bit),   cmocka_unit_test(test_parts_of_a_world),
        cmocka_unit_test(test_distances_have_both_sides),      cmocka_unit_test(test_compressed_files),
        cmocka_unit_test(test_damaged_files_are_told_or_read), cmocka_unit_test(test_refusals),
    };
    return cmocka_run_group_tests(tests, make_path, remove_path);
}
