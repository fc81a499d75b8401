/* Memory for the data that a layout describes (data.h), in which large images are pages of their files. */
#ifndef KARST_LANGUAGE_WORDS_H
#define KARST_LANGUAGE_WORDS_H

#include "karst/error.h"
#include "producers/language/graph/data.h"

/* num_bytes of it, zeroed, at least the layout's words: malloc'ed where no image is mapped. NULL: out of memory.
 * Destroy with karst_world_words_destroy, told the same. Thread-safe. */
void *karst_world_words_create(const karst_world_layout *layout, size_t num_bytes);
void karst_world_words_destroy(const karst_world_layout *layout, void *words, size_t num_bytes); /* NULL is fine */

/* Such memory that outlives its layout: a copy of `words`, whose images are mapped anew. */
#define KARST_MOST_MAPPED_IMAGES 64u
typedef struct {
    void *memory; /* NULL: there is none */
    size_t num_bytes;
    uint32_t num_maps;
    struct {
        size_t at_bytes, num_bytes;
    } maps[KARST_MOST_MAPPED_IMAGES];
} karst_words_copy;
bool karst_words_copy_create(karst_words_copy *copy, const karst_world_layout *layout, const void *words,
                             size_t num_bytes, karst_error *error);
void karst_words_copy_destroy(karst_words_copy *copy); /* a zeroed one is fine */
/* Takes over what stands outside the images. */
void karst_words_copy_update(const karst_words_copy *copy, const void *words);
/* Lets go of the images' pages that are in memory: they come again when they are touched. */
void karst_words_copy_let_go(const karst_words_copy *copy);

#endif
