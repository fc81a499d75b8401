/* Logging through a callback of the caller's. The library never writes to stdout or stderr by itself. */
#ifndef KARST_LOG_H
#define KARST_LOG_H

#ifdef __cplusplus
extern "C" {
#endif

typedef enum { KARST_LOG_ERROR, KARST_LOG_WARNING, KARST_LOG_INFO, KARST_LOG_DEBUG } karst_log_level;

/* A sink for messages. `write` gets one line without newline; it may be called from any thread that calls the library.
 * A NULL karst_log, or a NULL write, is a valid log that drops everything. */
typedef struct {
    void (*write)(void *user, karst_log_level level, const char *line);
    void *user;
    karst_log_level max_level; /* messages above it are not formatted at all; zero-initialised: errors only */
} karst_log;

/* Formats one message into the log. */
void karst_log_print(const karst_log *log, karst_log_level level, const char *format, ...)
#if defined(__GNUC__)
    __attribute__((format(printf, 3, 4)))
#endif
    ;

#ifdef __cplusplus
}
#endif
#endif
