/* Stacks whose lower parts lie on disk: see core/points/import_internal.h. The upper one or two blocks of each are in
 * memory; one that is full goes to a free place of the file, and comes back when what lies above is gone. */
#include <stdlib.h>
#include <string.h>

#include "core/points/import_internal.h"

#define BLOCK_VALUES 1022u

typedef struct {
    uint64_t below; /* the place of the block below + 1; 0: there is none */
    uint32_t values[BLOCK_VALUES];
} block;
_Static_assert(sizeof(block) == 4096, "a page");

/* Where block 0 is full, block 1 follows. */
typedef struct {
    block *blocks;
    uint32_t num;
} stack;

struct points_stacks {
    points_import *import;
    int fd;
    stack *stacks;
    uint32_t num;
    uint64_t *unused, num_unused, max_unused, num_places;
};

points_stacks *karst_points_stacks_create(points_import *import, uint32_t num, karst_error *error)
{
    points_stacks *s = calloc(1, sizeof *s);
    int fd = karst_points_file(import, POINTS_QUEUES, error);
    if (s && fd >= 0) {
        *s = (points_stacks){.import = import, .fd = fd, .num = num, .stacks = calloc(num, sizeof *s->stacks)};
        if (s->stacks)
            return s;
    }
    if (fd >= 0)
        karst_fail(error, KARST_FAILED, "out of memory");
    karst_points_stacks_destroy(s);
    return NULL;
}

void karst_points_stacks_destroy(points_stacks *s)
{
    if (!s)
        return;
    for (uint32_t i = 0; s->stacks && i < s->num; i++)
        free(s->stacks[i].blocks);
    free(s->stacks);
    free(s->unused);
    free(s);
}

/* The lower block goes to the file. */
static bool spill(points_stacks *s, stack *of, karst_error *error)
{
    uint64_t place = s->num_unused ? s->unused[--s->num_unused] : s->num_places++;
    if (!karst_points_write(s->import, s->fd, &of->blocks[0], sizeof *of->blocks, place * sizeof *of->blocks, error))
        return false;
    of->blocks[0] = of->blocks[1];
    of->blocks[0].below = place + 1;
    of->num -= BLOCK_VALUES;
    return true;
}

/* The block below what is in memory, which is empty, comes back. */
static bool fetch(points_stacks *s, stack *of, karst_error *error)
{
    uint64_t place = of->blocks[0].below - 1;
    if (s->num_unused == s->max_unused) {
        uint64_t most = s->max_unused ? 2 * s->max_unused : 1024, *grown = realloc(s->unused, most * sizeof *grown);
        if (!grown)
            return karst_fail(error, KARST_FAILED, "out of memory");
        s->unused = grown;
        s->max_unused = most;
    }
    s->unused[s->num_unused++] = place;
    of->num = BLOCK_VALUES;
    return karst_points_read(s->import, s->fd, &of->blocks[0], sizeof *of->blocks, place * sizeof *of->blocks, error);
}

bool karst_points_push(points_stacks *s, uint32_t number, uint32_t value, karst_error *error)
{
    stack *of = &s->stacks[number];
    if (!of->blocks && !(of->blocks = calloc(2, sizeof *of->blocks)))
        return karst_fail(error, KARST_FAILED, "out of memory");
    if (of->num == 2 * BLOCK_VALUES && !spill(s, of, error))
        return false;
    of->blocks[of->num / BLOCK_VALUES].values[of->num % BLOCK_VALUES] = value;
    of->num++;
    return true;
}

bool karst_points_pop(points_stacks *s, uint32_t number, uint32_t *value, bool *has, karst_error *error)
{
    stack *of = &s->stacks[number];
    *has = of->num > 0 || (of->blocks && of->blocks[0].below);
    if (!*has)
        return true;
    if (of->num == 0 && !fetch(s, of, error))
        return false;
    of->num--;
    *value = of->blocks[of->num / BLOCK_VALUES].values[of->num % BLOCK_VALUES];
    return true;
}
