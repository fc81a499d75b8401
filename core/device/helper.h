/* The helper process as the library's other parts see it: see karst/helper.h. Private to core.
 *
 * Two processes share a table of claims in memory. Whoever is about to compile something claims it first, so that
 * nothing is compiled twice; the one that shows pictures waits for what the other has begun. A claim's key stands for
 * text and options of a program, or for a kernel of it in one kind of launch. */
#ifndef KARST_CORE_HELPER_H
#define KARST_CORE_HELPER_H

#include <stdint.h>

#include "core/device/context.h"
#include "karst/engine.h"
#include "karst/helper.h"

typedef enum {
    KARST_CLAIM_NOBODY, /* there is no helper, or it is no longer waited for: go ahead */
    KARST_CLAIM_MINE,   /* go ahead, and say karst_helper_done */
    KARST_CLAIM_DONE,   /* it is in the driver's store */
    KARST_CLAIM_OTHERS  /* only in a helper, of launches: the other process has begun, leave it alone */
} karst_claim;

/* What the helper is to get ready for; kept until it starts. What cannot be told to another process (a text too long,
 * more parameters than it has room for) leaves it unused. NULL helper: nothing. */
void karst_helper_set_task(karst_helper *helper, const karst_engine_config *config);
/* In the helper: what it was told. Its strings live as long as the helper. */
karst_helper *karst_helper_attach(karst_engine_config *config);

/* Around the building of a program. A helper starts when one takes long. */
karst_claim karst_helper_begin_build(karst_helper *helper, uint64_t key);
void karst_helper_end_build(karst_helper *helper, uint64_t key, karst_claim claim);
/* What programs of this process are known by there, from building to release. */
void karst_helper_note_program(karst_helper *helper, cl_program program, uint64_t key);
void karst_helper_forget_program(karst_helper *helper, cl_program program);
/* Before a kernel is launched, which may not be compiled yet. KARST_CLAIM_MINE: wait until it ran, then
 * karst_helper_done with *key. In a helper launches are for nothing else: KARST_CLAIM_DONE and _OTHERS leave them out.
 */
karst_claim karst_helper_begin_launch(karst_helper *helper, cl_kernel kernel, size_t global_size, size_t local_size,
                                      uint64_t *key);
void karst_helper_done(karst_helper *helper, uint64_t key);
/* Whether a helper is at work, or this process is one: else launches need no claims. */
bool karst_helper_is_active(const karst_helper *helper);
bool karst_helper_is_child(const karst_helper *helper); /* whether this process is the helper */

/* For tests and statistics: how many claims the helper fulfilled so far; whether it was ever started, has ended, and
 * ended before its task was done. */
uint32_t karst_helper_count_done(const karst_helper *helper);
bool karst_helper_was_started(const karst_helper *helper);
bool karst_helper_has_ended(const karst_helper *helper);
bool karst_helper_has_failed(const karst_helper *helper);

#endif
