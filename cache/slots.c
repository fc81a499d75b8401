/* The ring of free slots. */
#include "cache/slots.h"

#include <stdlib.h>

bool karst_slots_init(karst_slots *slots, uint32_t first_slot, uint32_t end_slot, karst_error *error)
{
    slots->first_slot = first_slot;
    slots->capacity = end_slot - first_slot;
    slots->ring = malloc((slots->capacity ? slots->capacity : 1) * sizeof(*slots->ring));
    if (!slots->ring)
        return karst_fail(error, KARST_FAILED, "out of memory for a list of %u free slots", slots->capacity);
    karst_slots_reset(slots);
    return true;
}

void karst_slots_finish(karst_slots *slots)
{
    free(slots->ring);
    slots->ring = NULL;
}

void karst_slots_reset(karst_slots *slots)
{
    slots->first = 0;
    slots->num = slots->capacity;
    for (uint32_t i = 0; i < slots->capacity; i++)
        slots->ring[i] = slots->first_slot + i;
}

uint32_t karst_slots_take(karst_slots *slots, uint32_t *taken, uint32_t num)
{
    if (num > slots->num)
        num = slots->num;
    for (uint32_t i = 0; i < num; i++)
        taken[i] = karst_slots_at(slots, i);
    if (num) {
        slots->first = (uint32_t)(((uint64_t)slots->first + num) % slots->capacity);
        slots->num -= num;
    }
    return num;
}

void karst_slots_give(karst_slots *slots, const uint32_t *given, uint32_t num)
{
    while (num--) {
        slots->first = slots->first ? slots->first - 1 : slots->capacity - 1;
        slots->ring[slots->first] = given[num];
        slots->num++;
    }
}

uint32_t karst_slots_at(const karst_slots *slots, uint32_t i)
{
    return slots->ring[((uint64_t)slots->first + i) % slots->capacity];
}
