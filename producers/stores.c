/* Answering a round of one of several stores. */
#include "producers/stores.h"

static const karst_store_source *source_of(const karst_store_source *sources, size_t num_sources,
                                           const karst_store *store)
{
    for (size_t i = 0; i < num_sources; i++)
        if (sources[i].store == store)
            return &sources[i];
    return NULL;
}

static bool answer(const karst_store_source *source, const karst_work *work, karst_error *error)
{
    return karst_producer_answer(source->producer, karst_store_get_buffers(source->store), work, error);
}

bool karst_stores_answer(const karst_store_source *sources, size_t num_sources, const karst_store *asking,
                         const karst_work *work, karst_error *error)
{
    const karst_store_source *own = source_of(sources, num_sources, asking);
    karst_work tiles = *work;
    tiles.num_loads = 0;
    if (!own)
        return karst_fail(error, KARST_USAGE, "store %s has no producer", karst_store_name(asking));
    for (size_t i = 0; i < num_sources; i++)
        if (&sources[i] != own && !answer(&sources[i], &tiles, error))
            return false;
    return answer(own, work, error);
}
