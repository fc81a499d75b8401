/* The preprocessor: #define of names and of calls, #undef, #if, #ifdef, #ifndef, #elif, #else, #endif on integers. No
 * #include, no pasting. #version, #extension, #pragma and #line are passed over. */
#ifndef KARST_LANGUAGE_MACRO_H
#define KARST_LANGUAGE_MACRO_H

#include "producers/language/front/lexer.h"

#define KARST_MAX_EXPANDED_TOKENS 1000000u
#define KARST_MAX_NESTING 256u

/* Appends the expansion of `in` (which ends with END) to `out`, with an END. Tokens that come from a macro point to the
 * place where the user called the outermost one. Knows KARST (1) and __VERSION__ (300). */
void karst_preprocess(karst_source *source, karst_names *names, const karst_tokens *in, karst_tokens *out);

#endif
