#include "producers/language/graph/words.h"

#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#include "producers/language/image/image.h"

/* Calls for each image that is mapped, once; false: a call said so. */
static bool for_mapped(const karst_world_layout *layout,
                       bool (*use)(void *user, const karst_samples_image *image, size_t at_bytes), void *user)
{
    const karst_graph *graph = layout->world.graph;
    for (uint32_t i = 0; layout->has_mapped && i < graph->num_noises; i++) {
        bool is_first = layout->image_word[i] && graph->noises[i].image->file.is_open;
        for (uint32_t k = 0; k < i && is_first; k++)
            is_first = layout->image_word[k] != layout->image_word[i];
        if (is_first && !use(user, graph->noises[i].image, 8 * (size_t)layout->image_word[i]))
            return false;
    }
    return true;
}

static bool map_image(void *user, const karst_samples_image *image, size_t at_bytes)
{
    return mmap((char *)user + at_bytes, image->file.memory_bytes, PROT_READ, MAP_SHARED | MAP_FIXED, image->file.fd,
                0) != MAP_FAILED;
}

void *karst_world_words_create(const karst_world_layout *layout, size_t num_bytes)
{
    if (!layout->has_mapped)
        return calloc(1, num_bytes);
    void *memory = mmap(NULL, num_bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (memory == MAP_FAILED)
        return NULL;
    if (for_mapped(layout, map_image, memory))
        return memory;
    munmap(memory, num_bytes);
    return NULL;
}

void karst_world_words_destroy(const karst_world_layout *layout, void *words, size_t num_bytes)
{
    if (layout->has_mapped && words)
        munmap(words, num_bytes);
    else
        free(words);
}

/* ---- copies ---- */

static bool note_image(void *user, const karst_samples_image *image, size_t at_bytes)
{
    karst_words_copy *copy = user;
    if (copy->num_maps == KARST_MOST_MAPPED_IMAGES)
        return false;
    uint32_t place = copy->num_maps++;
    for (; place > 0 && copy->maps[place - 1].at_bytes > at_bytes; place--)
        copy->maps[place] = copy->maps[place - 1];
    copy->maps[place].at_bytes = at_bytes;
    copy->maps[place].num_bytes = image->file.memory_bytes;
    return true;
}

bool karst_words_copy_create(karst_words_copy *copy, const karst_world_layout *layout, const void *words,
                             size_t num_bytes, karst_error *error)
{
    *copy = (karst_words_copy){.num_bytes = num_bytes};
    if (!for_mapped(layout, note_image, copy) || !(copy->memory = karst_world_words_create(layout, num_bytes)))
        return karst_fail(error, KARST_FAILED, "out of memory for a world's data");
    karst_words_copy_update(copy, words);
    return true;
}

void karst_words_copy_update(const karst_words_copy *copy, const void *words)
{
    size_t at = 0;
    for (uint32_t i = 0; i <= copy->num_maps; i++) {
        const size_t end = i < copy->num_maps ? copy->maps[i].at_bytes : copy->num_bytes;
        memcpy((char *)copy->memory + at, (const char *)words + at, end - at);
        at = i < copy->num_maps ? end + copy->maps[i].num_bytes : end;
    }
}

void karst_words_copy_destroy(karst_words_copy *copy)
{
    if (copy->memory)
        munmap(copy->memory, copy->num_bytes);
    *copy = (karst_words_copy){.memory = NULL};
}

void karst_words_copy_let_go(const karst_words_copy *copy)
{
    for (uint32_t i = 0; i < copy->num_maps; i++)
        madvise((char *)copy->memory + copy->maps[i].at_bytes, copy->maps[i].num_bytes, MADV_DONTNEED);
}
