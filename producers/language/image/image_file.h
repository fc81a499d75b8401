/* Large images: their words lie in a file, mapped, so that memory holds what is looked at alone. What was made once is
 * kept in the store's folder "images" (core/device/store.h), and found there by all that it follows from. */
#ifndef KARST_LANGUAGE_IMAGE_FILE_H
#define KARST_LANGUAGE_IMAGE_FILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "karst/error.h"

/* What else is kept of an image. */
typedef struct {
    uint64_t words_bytes; /* of its words; the file's first */
    uint64_t digest;
    uint32_t width, height, num_channels; /* of the samples that it was made of */
    uint32_t bound_bytes;
    char kind[40];
} karst_image_facts;

#define KARST_IMAGE_KEY_BYTES 5120

typedef struct {
    bool is_open;
    int fd, lock; /* -1: none; of one that is open */
    void *memory; /* its words, mapped: for reading, or while they are made for writing */
    size_t memory_bytes;
    char path[1100], begun[1160]; /* what it is called once it is kept, and until then; "": it is not kept */
} karst_image_file;

/* A kept one of this key, mapped for reading. False: there is none. */
bool karst_image_file_find(karst_image_file *file, const char *key, karst_image_facts *facts);
/* A new one, mapped for writing, zeroed, and with its room on the disk taken. If another process makes one of the
 * store's meanwhile, it waits for that. Where there is no store it has no name, in $TMPDIR or /tmp. Errors:
 * KARST_FAILED (no room on the disk, or in memory). */
bool karst_image_file_begin(karst_image_file *file, const char *key, size_t words_bytes, karst_error *error);
/* The words are made: from now on it is mapped for reading, and found. Errors: KARST_FAILED. */
bool karst_image_file_keep(karst_image_file *file, const char *key, const karst_image_facts *facts, karst_error *error);
void karst_image_file_close(karst_image_file *file); /* what was begun and is not kept goes; a zeroed one is fine */

/* Pages of it that are in memory are let go: they come again when they are touched. */
void karst_image_file_let_go(const karst_image_file *file);

#endif
