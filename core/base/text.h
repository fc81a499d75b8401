/* Text that does not depend on the locale: numbers in and out, and quoting for one-line messages. Private to the
 * library. */
#ifndef KARST_CORE_TEXT_H
#define KARST_CORE_TEXT_H

#include <stdbool.h>
#include <stddef.h>

#define KARST_TEXT_QUOTE_BYTES 64

/* Copies text for use in a message: at most 48 bytes, then "..."; control characters become '?'. Returns `quoted`. */
const char *karst_text_quote(const char *text, char quoted[KARST_TEXT_QUOTE_BYTES]);

/* The parts of a decimal: [sign] digits [. digits] [e [sign] digits], with blanks allowed around it. Pointers into the
 * text. */
typedef struct {
    bool negative;
    const char *whole; /* digits before the point */
    size_t num_whole;
    const char *fraction; /* digits after it */
    size_t num_fraction;
    long exponent; /* saturates at +-10^18, which is far beyond any text's length */
} karst_decimal;

/* Splits all of `text`; false if it is not a decimal (there must be a digit before the exponent, and one in it). */
bool karst_decimal_split(const char *text, karst_decimal *decimal);

/* A decimal as the nearest double; false if it is not one, or not finite. */
bool karst_text_to_double(const char *text, double *value);
/* The shortest decimal that reads back as the same double, with a point whatever the locale; 32 bytes always suffice.
 */
int karst_text_from_double(double value, char *text, size_t size_bytes);

#endif
