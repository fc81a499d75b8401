/* Errors: a code and one line of text that says what to do. */
#ifndef KARST_ERROR_H
#define KARST_ERROR_H

#ifdef __cplusplus
extern "C" {
#endif

/* The values are the exit codes of the karst command. */
typedef enum {
    KARST_OK = 0,
    KARST_FAILED = 1,    /* something went wrong that is not the caller's fault: memory, a driver, a disk */
    KARST_USAGE = 2,     /* an argument is out of its range */
    KARST_NO_DEVICE = 3, /* no usable OpenCL device or display */
    KARST_BAD_WORLD = 4, /* a world file that does not compile */
    KARST_BAD_DATA = 5   /* another data file that cannot be read */
} karst_status;

/* Filled by a function that fails; untouched by one that succeeds. The caller owns it. Every `karst_error *error`
 * parameter of the library may be NULL. The first error wins: a function never overwrites one that is already set.
 * Where memory runs out the status is KARST_FAILED, also of a function whose errors do not name it. */
typedef struct {
    karst_status status;
    char message[1024]; /* one line, no full stop or newline at its end */
} karst_error;

/* Sets *error, printf-like, if error is not NULL and holds none yet. Returns 0, so that `return karst_fail(...)` reads
 * well in functions that return bool or a pointer. Thread-safe for distinct errors. */
int karst_fail(karst_error *error, karst_status status, const char *format, ...)
#if defined(__GNUC__)
    __attribute__((format(printf, 3, 4)))
#endif
    ;

#ifdef __cplusplus
}
#endif
#endif
