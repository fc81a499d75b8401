/* What files of meshes begin with: text that grows, numbers in it, and where a box lies. */
#ifndef KARST_EXPORT_OUT_TEXT_H
#define KARST_EXPORT_OUT_TEXT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "karst/mesh.h"

/* Zero-initialise; free(text.bytes) at the end. */
typedef struct {
    char *bytes;
    size_t length, size_bytes;
    bool is_out_of_memory; /* then what is said is lost */
} karst_out_text;

void karst_out_say(karst_out_text *text, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* Little-endian, whatever the machine; behind what was put. */
static inline uint8_t *karst_out_put_u32(uint8_t *to, uint32_t value)
{
    const uint8_t bytes[4] = {(uint8_t)value, (uint8_t)(value >> 8), (uint8_t)(value >> 16), (uint8_t)(value >> 24)};
    memcpy(to, bytes, sizeof bytes);
    return to + sizeof bytes;
}
static inline uint8_t *karst_out_put_float(uint8_t *to, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return karst_out_put_u32(to, bits);
}

/* What can stand in a comment and between quotes: control characters, quotes and what is no ASCII become '?'. */
const char *karst_out_plain(const char *text, char *copy, size_t size_bytes);

/* World, seed, the box's lower corner, cells and footprint: each after `line`, `between` parts them, `quote` stands
 * around names and texts, `colon` behind names. */
typedef struct {
    const char *line, *quote, *colon, *between;
} karst_out_style;
void karst_out_say_facts(karst_out_text *text, const karst_world *world, const karst_mesh_config *config,
                         const karst_out_style *style);

#endif
