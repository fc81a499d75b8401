/* The stage timer behind karst_profile_collect. Private to core; use core/device/context.h elsewhere. */
#ifndef KARST_CORE_PROFILE_H
#define KARST_CORE_PROFILE_H

#include "core/device/context.h"
#include "karst/measure.h"

struct karst_profile *karst_profile_create(karst_error *error);
/* Releases events that were never collected. NULL is fine. */
void karst_profile_destroy(struct karst_profile *profile);
/* Counts a command under a stage; takes the event over, also when it fails. The kernel is for naming spans. */
bool karst_profile_add_event(karst_context *context, karst_stage stage, cl_kernel kernel, cl_event event,
                             karst_error *error);
/* Whether spans are kept; those of what was last collected, or is being: see karst/measure.h. */
bool karst_profile_trace(karst_context *context, bool tracing, karst_error *error);
size_t karst_profile_spans(const karst_context *context, karst_span *spans, size_t max_spans);

#endif
