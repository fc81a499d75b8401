/* The table of evictions. */
#include "cache/churn.h"

#include <stdlib.h>
#include <string.h>

bool karst_churn_init(karst_churn *churn, karst_error *error)
{
    churn->entries = calloc(KARST_CHURN_ENTRIES, sizeof(*churn->entries));
    if (!churn->entries)
        return karst_fail(error, KARST_FAILED, "out of memory for the memory of evictions");
    return true;
}

void karst_churn_finish(karst_churn *churn)
{
    free(churn->entries);
    churn->entries = NULL;
}

void karst_churn_forget(karst_churn *churn)
{
    memset(churn->entries, 0, KARST_CHURN_ENTRIES * sizeof(*churn->entries));
    churn->any = false;
}

void karst_churn_evicted(karst_churn *churn, uint64_t identity, uint32_t frame)
{
    churn->entries[identity % KARST_CHURN_ENTRIES] = (struct karst_churn_entry){identity, frame};
    churn->any = true;
    churn->last_frame = frame;
}

void karst_churn_expect(const karst_churn *churn, uint64_t identity)
{
    __builtin_prefetch(&churn->entries[identity % KARST_CHURN_ENTRIES], 1);
}

bool karst_churn_is_recent(const karst_churn *churn, uint64_t identity, uint32_t frame)
{
    const struct karst_churn_entry *entry = &churn->entries[identity % KARST_CHURN_ENTRIES];
    return entry->identity == identity && frame - entry->frame <= KARST_CHURN_FRAMES;
}

bool karst_churn_any_is_recent(const karst_churn *churn, uint32_t frame)
{
    return churn->any && frame - churn->last_frame <= KARST_CHURN_FRAMES;
}
