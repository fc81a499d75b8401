/* A log that keeps its lines, for threads of which the caller's log knows nothing. */
#ifndef KARST_CORE_LOG_LATER_H
#define KARST_CORE_LOG_LATER_H

#include "karst/log.h"

typedef struct {
    karst_log log;
    struct karst_log_line *first, **end;
} karst_log_later;

/* Keeps what `log` (may be NULL) would take. The struct must not move from now on. */
void karst_log_later_init(karst_log_later *later, const karst_log *log);
/* Hands all lines to `log` (NULL: drops them), in order, and keeps none of them. */
void karst_log_later_say(karst_log_later *later, const karst_log *log);

#endif
