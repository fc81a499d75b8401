/* Where a text's header is, and whether what stands there is one. */
#ifndef KARST_LANGUAGE_HEADER_COMMENT_H
#define KARST_LANGUAGE_HEADER_COMMENT_H

#include <jansson.h>

#include "producers/language/base/source.h"

/* The keys that a header may have. */
#define KARST_HEADER_KEYS                                                                                   \
    "name author description seed voxel extent params camera sun sky lipschitz view exposure mirror data " \
    "lights models particles occlusion light_map"

typedef struct {
    uint32_t begin, end; /* the object's text in the source */
    json_t *root;        /* the caller's; NULL: there is no header */
    json_t *inputs;      /* the caller's, where there is none: what an ISF text takes, as a header's "params"; NULL */
} karst_header_object;

/* Reads the object in a text's first comment ("/" "*{ ... }*" "/"). It may hold line comments, and commas behind the
 * last of a list. Not a header are comments that do not begin as JSON and name none of its keys, and objects with
 * other keys alone, which is warned of. Errors: a header that is no JSON. */
karst_header_object karst_header_find(karst_source *source);

/* Whether a header says something, and nothing of places or sizes: it names a world, or says how it looks. */
bool karst_header_leaves_view(const json_t *root);

#endif
