/* Memory of one compilation: many small pieces, freed together, never more than a stated sum. */
#ifndef KARST_LANGUAGE_ARENA_H
#define KARST_LANGUAGE_ARENA_H

#include <stdbool.h>
#include <stddef.h>

typedef struct karst_arena_block karst_arena_block;

/* Not thread-safe: one thread at a time. */
typedef struct {
    karst_arena_block *blocks; /* newest first */
    size_t used_bytes;         /* what was handed out, plus what growing arrays left behind */
    size_t limit_bytes;
    bool is_out_of_memory;     /* it gave up because the host had none, not at its limit */
    void (*full)(void *user); /* called instead of returning NULL; must not return (it leaves by longjmp) */
    void *user;
} karst_arena;

/* `full` may be NULL: karst_arena_alloc then returns NULL when the limit or the host's memory is exhausted. */
void karst_arena_init(karst_arena *arena, size_t limit_bytes, void (*full)(void *user), void *user);
void karst_arena_finish(karst_arena *arena);
/* Zeroed, aligned to 16 bytes. */
void *karst_arena_alloc(karst_arena *arena, size_t size_bytes);
/* Room for at least `needed` items of an array that holds `count`: returns `items`, or a copy at twice the room. */
void *karst_arena_grow(karst_arena *arena, void *items, size_t count, size_t *capacity, size_t needed,
                       size_t item_bytes);

#endif
