/* Errors on purpose: calls that must fail, with the status that the headers name. tests/api/run.sh looks for these
 * macros: each pair of a function and a status that a public header documents stands in one of them. */
#ifndef KARST_TESTS_SUPPORT_PROVOKE_H
#define KARST_TESTS_SUPPORT_PROVOKE_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "karst/error.h"
#include "tests/support/faults.h"

/* More allocations than that are not counted out. */
#define PROVOKE_MOST_ALLOCATIONS 400

static inline void provoke_check(bool done, const karst_error *error, karst_status status, const char *call)
{
    faults_fail_memory(-1);
    faults_fail_device(false);
    faults_fail_database(0);
    if (done)
        fail_msg("%s: worked", call);
    if (error->status != status)
        fail_msg("%s: status %d, not %d: %s", call, (int)error->status, (int)status, error->message);
    if (!error->message[0] || strchr(error->message, '\n'))
        fail_msg("%s: '%s' is no line that says what is wrong", call, error->message);
}

/* FUNCTION ARGUMENTS fails with `status`; ARGUMENTS stand in brackets and name &error. */
#define PROVOKE(status, function, arguments)                          \
    do {                                                              \
        karst_error error = {0};                                      \
        const bool done_ = !!(function arguments);                    \
        provoke_check(done_, &error, (status), #function #arguments); \
    } while (0)

/* It fails with KARST_FAILED when the device does. */
#define PROVOKE_DEVICE(function, arguments)         \
    do {                                            \
        faults_fail_device(true);                   \
        PROVOKE(KARST_FAILED, function, arguments); \
    } while (0)

/* It fails with `status` when SQLite answers with `code`. */
#define PROVOKE_DATABASE(status, code, function, arguments) \
    do {                                                    \
        faults_fail_database(code);                         \
        PROVOKE(status, function, arguments);               \
    } while (0)

/* It fails with KARST_FAILED where memory runs out: each of its allocations fails once, until there is none left. What
 * does not need one may go on without; CLOSE(result) takes what came of it. */
#define PROVOKE_MEMORY(function, arguments, close)                                                                \
    do {                                                                                                          \
        int num_failed_ = 0;                                                                                      \
        bool reached_ = true;                                                                                     \
        for (long n_ = 0; reached_ && n_ < PROVOKE_MOST_ALLOCATIONS; n_++) {                                      \
            karst_error error = {0};                                                                              \
            faults_fail_memory(n_);                                                                               \
            __typeof__(function arguments) got_ = function arguments;                                             \
            reached_ = faults_memory_failed();                                                                    \
            faults_fail_memory(-1);                                                                               \
            if (got_) {                                                                                           \
                close(got_);                                                                                      \
                continue;                                                                                         \
            }                                                                                                     \
            num_failed_++;                                                                                        \
            if (!reached_ || error.status != KARST_FAILED || !strstr(error.message, "memory"))                    \
                fail_msg("%s, allocation %ld: status %d, '%s'", #function, n_, (int)error.status, error.message); \
        }                                                                                                         \
        if (!num_failed_)                                                                                         \
            fail_msg("%s: never without memory", #function);                                                      \
    } while (0)
#define provoke_keep(result) ((void)(result))

#endif
