/* What meshes are made with: places of a grid, cells whose pieces are known beforehand, files that begin in memory. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>
#include <math.h>

#include "core/export/cell.h"
#include "core/export/grid.h"
#include "core/export/out_file.h"

static uint64_t random_state = 11;

static uint64_t next_random(void)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 7;
    random_state ^= random_state << 17;
    return random_state;
}

/* From -1 to 1. */
static double random_share(void) { return (double)(int64_t)next_random() * 0x1p-63; }

/* A grid's places are karst_position_add_m's, bit for bit: near, far, at the world's edge, and of what is no number. */
static void test_places(void **state)
{
    (void)state;
    for (int i = 0; i < 200000; i++) {
        karst_position corner;
        const int voxel_log2_m = (int)(next_random() % 41) - 20, far = (int)(next_random() % 62);
        for (int axis = 0; axis < 3; axis++) {
            corner.voxel[axis] = (int64_t)next_random() >> far;
            corner.voxel[axis] -= corner.voxel[axis] >> 2; /* no farther than the world reaches, nearly */
            corner.fraction[axis] = (uint32_t)next_random();
        }
        const double cell_m = ldexp(1 + fabs(random_share()), voxel_log2_m + (int)(next_random() % 24) - 12);
        const karst_grid grid = karst_grid_of(&corner, cell_m, 0, voxel_log2_m);
        double at[3], offset_m[3];
        for (int axis = 0; axis < 3; axis++) {
            at[axis] = ldexp(random_share(), (int)(next_random() % 21));
            if (i % 7 == 0)
                at[axis] = ldexp(rint(4 * at[axis]), -2 - (int)(next_random() % 30)); /* ties */
            if (i % 1000 == axis)
                at[axis] = i % 2 ? (double)NAN : ldexp(at[axis], 80);
            offset_m[axis] = karst_grid_metres(&grid, at[axis]);
        }
        const karst_position found = karst_grid_at(&grid, at);
        const karst_position expected = karst_position_add_m(corner, offset_m, voxel_log2_m);
        for (int axis = 0; axis < 3; axis++)
            if (found.voxel[axis] != expected.voxel[axis] || found.fraction[axis] != expected.fraction[axis])
                fail_msg("place %d, axis %d: voxel %lld, %u, not %lld, %u", i, axis, (long long)found.voxel[axis],
                         found.fraction[axis], (long long)expected.voxel[axis], expected.fraction[axis]);
    }
}

/* The table says what a cell would be told, where the centres of faces do not matter, and where they do. */
static void test_table(void **state)
{
    (void)state;
    static karst_cell_table table;
    int num_crossed = 0;
    karst_cell_table_fill(&table);
    for (unsigned solid = 0; solid < 256; solid++) {
        signed char first[KARST_CELL_EDGES], other[KARST_CELL_EDGES];
        bool differs = false;
        const int num = karst_cell_pieces(solid, 0, first);
        for (unsigned centres = 1; centres < 64; centres++)
            differs = karst_cell_pieces(solid, centres, other) != num || memcmp(first, other, sizeof first) || differs;
        assert_int_equal(table.of[solid].is_crossed, differs);
        assert_int_equal(table.of[solid].num_pieces, num);
        assert_memory_equal(table.of[solid].piece_of, first, sizeof first);
        num_crossed += differs;
    }
    assert_true(num_crossed > 0 && num_crossed < 128);
}

/* What a part holds is what was written, whether it was short or became a file; it can be read again. */
static void check_part(size_t num_bytes)
{
    char block[4093];
    FILE *part = karst_out_short_part("/tmp/karst_test_part");
    assert_non_null(part);
    for (size_t done = 0; done < num_bytes;) {
        size_t some = num_bytes - done < sizeof block ? num_bytes - done : sizeof block;
        for (size_t i = 0; i < some; i++)
            block[i] = (char)((done + i) * 2654435761u >> 13);
        assert_int_equal(fwrite(block, 1, some, part), some);
        done += some;
    }
    assert_int_equal(fflush(part), 0);
    for (int time = 0; time < 2; time++) {
        size_t done = 0;
        assert_int_equal(fseeko(part, 0, SEEK_SET), 0);
        for (size_t some; (some = fread(block, 1, sizeof block, part)) > 0; done += some)
            for (size_t i = 0; i < some; i++)
                if (block[i] != (char)((done + i) * 2654435761u >> 13))
                    fail_msg("of %zu bytes number %zu is another", num_bytes, done + i);
        assert_int_equal(done, num_bytes);
        assert_false(ferror(part));
    }
    assert_int_equal(fclose(part), 0);
}

static void test_parts(void **state)
{
    (void)state;
    const size_t lengths[] = {0, 1, 4096, 1 << 20, (1 << 20) + 1, (32 << 20) - 1, 32 << 20, (32 << 20) + 1, 40 << 20};
    for (size_t i = 0; i < sizeof lengths / sizeof *lengths; i++)
        check_part(lengths[i]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_places), cmocka_unit_test(test_table),
                                       cmocka_unit_test(test_parts)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
