/* The free slots of a pool, on the host: never handed out, given back unused, or freed together with their owner. */
#ifndef KARST_CACHE_SLOTS_H
#define KARST_CACHE_SLOTS_H

#include <stdbool.h>
#include <stdint.h>

#include "karst/error.h"

/* A ring, first free slot at `first`. */
typedef struct {
    uint32_t *ring;
    uint32_t capacity, first, num;
    uint32_t first_slot; /* lowest slot that may ever be free */
} karst_slots;

/* All slots from first_slot to end_slot - 1 are free, lowest first. Release with karst_slots_finish. Errors:
 * KARST_FAILED. */
bool karst_slots_init(karst_slots *slots, uint32_t first_slot, uint32_t end_slot, karst_error *error);
void karst_slots_finish(karst_slots *slots); /* zeroed is fine */
void karst_slots_reset(karst_slots *slots);  /* as after init */
/* Takes at most `num` slots; returns how many there were. */
uint32_t karst_slots_take(karst_slots *slots, uint32_t *taken, uint32_t num);
/* Gives slots back to the front: given[0] is the next to be taken. They must have been taken before. */
void karst_slots_give(karst_slots *slots, const uint32_t *given, uint32_t num);
/* The i-th free slot, i < num. */
uint32_t karst_slots_at(const karst_slots *slots, uint32_t i);

#endif
