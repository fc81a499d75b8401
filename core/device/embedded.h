/* Kernel sources inside the library, by path from the repository's root. Made by core/device/embed.sh. */
#ifndef KARST_CORE_EMBEDDED_H
#define KARST_CORE_EMBEDDED_H
typedef struct {
    const char *path, *text;
} karst_embedded_file;
extern const karst_embedded_file karst_embedded_files[]; /* ended by a NULL path */
#endif
