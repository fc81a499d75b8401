#include "core/base/text.h"

#include <locale.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { QUOTE_KEPT_BYTES = 48 };
static const long EXPONENT_MAX = 1000000000000000000;

const char *karst_text_quote(const char *text, char quoted[KARST_TEXT_QUOTE_BYTES])
{
    size_t length = strnlen(text, QUOTE_KEPT_BYTES + 1);
    bool cut = length > QUOTE_KEPT_BYTES;
    if (cut) {
        length = QUOTE_KEPT_BYTES;
        while (length > 0 && ((unsigned char)text[length] & 0xC0) == 0x80)
            length--; /* do not cut a UTF-8 character in two */
    }
    for (size_t i = 0; i < length; i++) {
        unsigned char c = (unsigned char)text[i];
        quoted[i] = (char)(c < 0x20 || c == 0x7F ? '?' : c);
    }
    strcpy(quoted + length, cut ? "..." : "");
    return quoted;
}

static bool is_digit(char c) { return c >= '0' && c <= '9'; }

static bool is_blank(char c) { return c == ' ' || c == '\t'; }

bool karst_decimal_split(const char *text, karst_decimal *decimal)
{
    const char *at = text;
    while (is_blank(*at))
        at++;
    decimal->negative = *at == '-';
    if (*at == '-' || *at == '+')
        at++;
    decimal->whole = at;
    while (is_digit(*at))
        at++;
    decimal->num_whole = (size_t)(at - decimal->whole);
    decimal->fraction = at;
    decimal->num_fraction = 0;
    if (*at == '.') {
        decimal->fraction = ++at;
        while (is_digit(*at))
            at++;
        decimal->num_fraction = (size_t)(at - decimal->fraction);
    }
    if (decimal->num_whole + decimal->num_fraction == 0)
        return false;
    decimal->exponent = 0;
    if (*at == 'e' || *at == 'E') {
        at++;
        bool negative = *at == '-';
        if (*at == '-' || *at == '+')
            at++;
        if (!is_digit(*at))
            return false;
        for (; is_digit(*at); at++) {
            if (decimal->exponent < EXPONENT_MAX / 10)
                decimal->exponent = decimal->exponent * 10 + (*at - '0');
            else
                decimal->exponent = EXPONENT_MAX;
        }
        if (negative)
            decimal->exponent = -decimal->exponent;
    }
    while (is_blank(*at))
        at++;
    return *at == '\0';
}

/* The "C" locale is static in the C library: asking for it allocates nothing and cannot fail there. */
static locale_t c_locale(void) { return newlocale(LC_ALL_MASK, "C", (locale_t)0); }

bool karst_text_to_double(const char *text, double *value)
{
    karst_decimal parts;
    if (!karst_decimal_split(text, &parts))
        return false; /* also keeps out what strtod would take: hexadecimal, inf, nan */
    double number = strtod_l(text, NULL, c_locale());
    if (!isfinite(number))
        return false;
    *value = number;
    return true;
}

int karst_text_from_double(double value, char *text, size_t size_bytes)
{
    locale_t before = uselocale(c_locale());
    char number[32];
    int length = 0;
    for (int digits = 15; digits <= 17; digits++) {
        length = snprintf(number, sizeof number, "%.*g", digits, value);
        if (strtod(number, NULL) == value)
            break;
    }
    uselocale(before);
    snprintf(text, size_bytes, "%s", number);
    return length;
}
