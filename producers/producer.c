/* What all producers have in common. */
#include "producers/producer.h"

bool karst_producer_answer(karst_producer *producer, const karst_cache_buffers *cache, const karst_work *work,
                           karst_error *error)
{
    const karst_producer_ops *ops = producer->ops;
    if (work->num_subdivides && !ops->subdivide(producer, cache, work, error))
        return false;
    for (uint32_t first = 0; first < work->num_loads; first += producer->max_chunk) {
        uint32_t left = work->num_loads - first, count = left < producer->max_chunk ? left : producer->max_chunk;
        if (!ops->load(producer, cache, work, first, count, error))
            return false;
    }
    return true;
}

void karst_producer_destroy(karst_producer *producer)
{
    if (producer)
        producer->ops->destroy(producer);
}
