#include "core/export/out_text.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { LEAST_BYTES = 4096, MOST_SAID = 2048 };

void karst_out_say(karst_out_text *text, const char *format, ...)
{
    char said[MOST_SAID];
    va_list arguments;
    va_start(arguments, format);
    const int length = vsnprintf(said, sizeof said, format, arguments);
    va_end(arguments);
    if (length < 0 || (size_t)length >= sizeof said) {
        text->is_out_of_memory = true;
        return;
    }
    size_t wanted = text->size_bytes ? text->size_bytes : LEAST_BYTES;
    while (wanted < text->length + (size_t)length + 1)
        wanted *= 2;
    if (wanted > text->size_bytes) {
        char *larger = realloc(text->bytes, wanted);
        if (!larger) {
            text->is_out_of_memory = true;
            return;
        }
        text->bytes = larger;
        text->size_bytes = wanted;
    }
    memcpy(text->bytes + text->length, said, (size_t)length + 1);
    text->length += (size_t)length;
}

const char *karst_out_plain(const char *text, char *copy, size_t size_bytes)
{
    size_t i = 0;
    for (; text[i] && i + 1 < size_bytes; i++)
        copy[i] = text[i] >= ' ' && text[i] < 127 && text[i] != '"' && text[i] != '\\' ? text[i] : '?';
    copy[i] = '\0';
    return copy;
}

void karst_out_say_facts(karst_out_text *text, const karst_world *world, const karst_mesh_config *config,
                         const karst_out_style *style)
{
    const karst_world_metadata *about = karst_world_get_metadata(world);
    const char *line = style->line, *quote = style->quote, *colon = style->colon, *between = style->between;
    char name[128], at[160];
    karst_out_say(text, "%s%sworld%s%s%s%s%s%s", line, quote, quote, colon, quote,
                  karst_out_plain(about->name, name, sizeof name), quote, between);
    karst_out_say(text, "%s%sseed%s%s%lu%s", line, quote, quote, colon, (unsigned long)about->seed, between);
    for (int axis = 0; axis < 3; axis++) {
        karst_coordinate_format(config->corner.voxel[axis], config->corner.fraction[axis], about->voxel_log2_m, at,
                                sizeof at);
        karst_out_say(text, "%s%sorigin_%c_m%s%s%s%s%s%s", line, quote, "xyz"[axis], quote, colon, quote, at, quote,
                      between);
    }
    karst_out_say(text, "%s%scell_m%s%s%.17g%s", line, quote, quote, colon, config->cell_m, between);
    karst_out_say(text, "%s%sfootprint_m%s%s%.17g", line, quote, quote, colon, config->footprint_m);
}
