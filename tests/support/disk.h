/* A disk in memory for SQLite that loses power or runs full when it is told to: a file system of SQLite's (a VFS), for
 * one connection at a time. What was not synced may come through a loss of power, or not, or in part, in any order: of
 * writes each sector, of names and lengths each change. */
#ifndef KARST_TESTS_SUPPORT_DISK_H
#define KARST_TESTS_SUPPORT_DISK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Makes it SQLite's default, empty; or no longer. */
void disk_begin(void);
void disk_end(void);
/* A file that is there, with all its bytes safe. */
void disk_put(const char *name, const void *data, size_t size_bytes);
/* The bytes of a file now; NULL: there is none. Valid until it changes. */
const uint8_t *disk_get(const char *name, size_t *size_bytes);

/* From now on the disk does so many more writes, syncs and the like, and then fails at everything. */
void disk_cut_after(uint64_t num_operations);
/* What is there when power comes back. */
void disk_restart(uint64_t seed);
/* How many operations it has done. */
uint64_t disk_num_operations(void);

/* From now on all files together may grow by so many bytes; UINT64_MAX: by any. */
void disk_set_room(uint64_t size_bytes);
/* From now on the n-th of these operations fails, once; 0: none. */
void disk_fail_once(uint64_t n);

#endif
