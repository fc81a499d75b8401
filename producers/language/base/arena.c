#include "producers/language/base/arena.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define BLOCK_BYTES ((size_t)64 << 10)

struct karst_arena_block {
    karst_arena_block *next;
    size_t size_bytes, used_bytes;
};

/* The first piece starts here, so that pieces are aligned. */
#define BLOCK_HEADER_BYTES ((sizeof(karst_arena_block) + 15) & ~(size_t)15)

void karst_arena_init(karst_arena *arena, size_t limit_bytes, void (*full)(void *user), void *user)
{
    *arena = (karst_arena){.limit_bytes = limit_bytes, .full = full, .user = user};
}

void karst_arena_finish(karst_arena *arena)
{
    while (arena->blocks) {
        karst_arena_block *block = arena->blocks;
        arena->blocks = block->next;
        free(block);
    }
    arena->used_bytes = 0;
}

static void *give_up(karst_arena *arena)
{
    if (arena->full)
        arena->full(arena->user);
    return NULL;
}

void *karst_arena_alloc(karst_arena *arena, size_t size_bytes)
{
    if (size_bytes > arena->limit_bytes)
        return give_up(arena);
    size_bytes = (size_bytes + 15) & ~(size_t)15;
    if (arena->used_bytes + size_bytes > arena->limit_bytes)
        return give_up(arena);
    karst_arena_block *block = arena->blocks;
    if (!block || block->size_bytes - block->used_bytes < size_bytes) {
        /* A large piece gets a block of its own, behind the current one, whose rest stays in use. */
        bool large = size_bytes > BLOCK_BYTES / 4;
        size_t room = large ? size_bytes : BLOCK_BYTES;
        block = malloc(BLOCK_HEADER_BYTES + room);
        arena->is_out_of_memory = arena->is_out_of_memory || !block;
        if (!block)
            return give_up(arena);
        *block = (karst_arena_block){.size_bytes = room};
        if (large && arena->blocks) {
            block->next = arena->blocks->next;
            arena->blocks->next = block;
        } else {
            block->next = arena->blocks;
            arena->blocks = block;
        }
    }
    void *piece = (char *)block + BLOCK_HEADER_BYTES + block->used_bytes;
    block->used_bytes += size_bytes;
    arena->used_bytes += size_bytes;
    return memset(piece, 0, size_bytes);
}

void *karst_arena_grow(karst_arena *arena, void *items, size_t count, size_t *capacity, size_t needed,
                       size_t item_bytes)
{
    if (needed <= *capacity)
        return items;
    size_t room = *capacity ? *capacity * 2 : 16;
    while (room < needed)
        room *= 2;
    void *grown = karst_arena_alloc(arena, room * item_bytes);
    if (!grown)
        return NULL;
    if (count)
        memcpy(grown, items, count * item_bytes);
    *capacity = room;
    return grown;
}
