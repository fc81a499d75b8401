/* Whole files of tests. What fails ends the test. */
#ifndef KARST_TESTS_SUPPORT_FILES_H
#define KARST_TESTS_SUPPORT_FILES_H

#include <stddef.h>

/* The file's bytes, *size_bytes of them, and a zero behind them; the caller frees them. */
void *read_file(const char *path, size_t *size_bytes);
/* Makes the file, or takes the place of what it held. */
void write_file(const char *path, const void *bytes, size_t size_bytes);

#endif
