/* What nearly every test of the library says: this call has to succeed. */
#ifndef KARST_TESTS_SUPPORT_OK_H
#define KARST_TESTS_SUPPORT_OK_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "karst/karst.h"

/* Fails with the message of `call`, which may name &error. */
#define assert_ok(call)                               \
    do {                                              \
        karst_error error = {0};                      \
        if (!(call))                                  \
            fail_msg("%s: %s", #call, error.message); \
    } while (0)

#endif
