/* The three steps of production on the host, by a world's tape.
 *
 * It is the kernels' own source, compiled as C with one lane around the interpreter of tapes (samples: host_tape.h), so
 * what it writes is what a device writes, bit for bit, and nothing has to be compiled for a world first. It takes some
 * ten times as long: 0.2 to 1.4 ms a brick where a device takes 0.06. For CPU devices with bricks of 16 bits; all wait
 * for the queue, and their time counts as their stage's.
 *
 * `data` is the world's (language/bounds_shared.h), whose tape needs at most KARST_TAPE_MOST_SLOTS slots; the rest are
 * as in subdivide.h, evaluate.h and finalise.h. Not thread-safe. Errors: KARST_FAILED. */
#ifndef KARST_PRODUCERS_HOST_STEPS_H
#define KARST_PRODUCERS_HOST_STEPS_H

#include "cache/cache.h"

bool karst_host_subdivide_tiles(const karst_cache_buffers *cache, const karst_work *work, karst_buffer *data,
                                karst_error *error);
bool karst_host_bound_loads(const karst_cache_buffers *cache, const karst_work *work, uint32_t first, uint32_t count,
                            karst_buffer *loads, karst_buffer *data, karst_error *error);
bool karst_host_bound_clear_loads(const karst_cache_buffers *cache, const karst_work *work, uint32_t first,
                                  uint32_t count, karst_buffer *least, karst_buffer *data, karst_error *error);
/* Before each brick `goes_on` is asked; once it says no, the rest is left out, and *finished is false. */
bool karst_host_evaluate_bricks(karst_buffer *loads, uint32_t count, karst_buffer *staging, karst_buffer *scrubs,
                                karst_buffer *data, bool (*goes_on)(void *user), void *user, bool *finished,
                                karst_error *error);
bool karst_host_finalise_bricks(const karst_cache_buffers *cache, const karst_work *work, uint32_t first,
                                uint32_t count, karst_buffer *loads, karst_buffer *staging, karst_buffer *scrubs,
                                karst_buffer *total, karst_error *error);

#endif
