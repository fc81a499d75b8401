/* Memory of evictions: what is produced again soon after it was evicted is churn. */
#ifndef KARST_CACHE_CHURN_H
#define KARST_CACHE_CHURN_H

#include <stdbool.h>
#include <stdint.h>

#include "karst/error.h"

#define KARST_CHURN_FRAMES 100 /* produced again within this many frames of its eviction */
#define KARST_CHURN_ENTRIES (1u << 16)

/* A direct-mapped table: of two evictions that fall on one entry the later is remembered, so that a count may be too
 * low by the share of the table that is in use, never too high. */
typedef struct {
    struct karst_churn_entry {
        uint64_t identity; /* 0: none */
        uint32_t frame;
    } * entries;
    bool any;            /* since it was last empty... */
    uint32_t last_frame; /* ...the last one */
} karst_churn;

bool karst_churn_init(karst_churn *churn, karst_error *error);
void karst_churn_finish(karst_churn *churn); /* zeroed is fine */
void karst_churn_forget(karst_churn *churn);
/* `identity`: see identity_shared.h. Frames may wrap. */
void karst_churn_evicted(karst_churn *churn, uint64_t identity, uint32_t frame);
/* Has memory fetch what is known of it: where many are asked one after another, each would wait. */
void karst_churn_expect(const karst_churn *churn, uint64_t identity);
bool karst_churn_is_recent(const karst_churn *churn, uint64_t identity, uint32_t frame);
/* Was anything evicted lately? */
bool karst_churn_any_is_recent(const karst_churn *churn, uint32_t frame);

#endif
