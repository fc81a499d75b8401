/* Kernel sources: finding them and putting one program's together. Private to core. */
#ifndef KARST_CORE_SOURCE_H
#define KARST_CORE_SOURCE_H

#include "core/device/context.h"

/* The text of `entry` with every #include "path" in it replaced by that file, each file once (a file that only an #if
 * branch includes may come again after it: its include guard decides), and #line directives that keep file and line of
 * what the compiler says. Files are looked for in `files`, then in $KARST_KERNEL_DIR, then among the embedded ones.
 * #include <...> stays as it is. Returns malloc'ed text. Errors: KARST_FAILED naming the including file and line. */
char *karst_source_expand(const char *entry, const karst_virtual_file *files, size_t num_files, karst_error *error);

#endif
