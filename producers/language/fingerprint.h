/* Whether two worlds, or one world with two sets of parameters, have the same density: then what was made of one is
 * good for the other, whatever happened to colours, names, camera or the text. */
#ifndef KARST_LANGUAGE_FINGERPRINT_H
#define KARST_LANGUAGE_FINGERPRINT_H

#include "producers/language/language.h"

/* All that decides a density's samples and bounds, as bytes: equal bytes, equal samples. The converse does not hold:
 * two texts may compute the same in two ways. */
typedef struct {
    unsigned char *bytes; /* malloc'ed */
    size_t length_bytes;
} karst_fingerprint;

/* Of a program with `values` for its parameters (num_parameters of them) and a seed. false: out of memory. Thread-safe.
 * Free with karst_fingerprint_finish. */
bool karst_fingerprint_init(karst_fingerprint *fingerprint, const karst_program_graph *program,
                            const karst_number *values, uint32_t seed);
void karst_fingerprint_finish(karst_fingerprint *fingerprint);
bool karst_fingerprint_same(const karst_fingerprint *a, const karst_fingerprint *b);

#endif
