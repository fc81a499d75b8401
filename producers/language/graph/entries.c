#include "producers/language/graph/entries.h"

#include <stdio.h>

#define OUTPUT_INFO(id, name, floats, usual, shown) {name, KARST_ROOT_##id, floats, usual, shown},
const karst_output_info karst_outputs[KARST_NUM_OUTPUTS] = {KARST_OUTPUTS(OUTPUT_INFO)};

#define ENTRY_INFO(id, name, other, result, first, last, inputs, program, softened) \
    {name, other, result, KARST_OUTPUT_##first, KARST_OUTPUT_##last, inputs, KARST_PROGRAM_##program, softened},
const karst_entry_info karst_entries[KARST_NUM_ENTRIES] = {KARST_ENTRIES(ENTRY_INFO)};

karst_entry karst_entry_of(karst_output output)
{
    int entry = 0;
    while (output < karst_entries[entry].first || output > karst_entries[entry].last)
        entry++;
    return (karst_entry)entry;
}

void karst_entry_signature(karst_entry entry, char *text)
{
    const karst_entry_info *e = &karst_entries[entry];
    snprintf(text, KARST_SIGNATURE_BYTES, "%s %s(vec3 p%s)", e->result, e->name,
             e->num_inputs == KARST_INPUT_PLACE_AND_NORMAL ? ", vec3 n" : "");
}

size_t karst_list_roots(const karst_expr *root, karst_entry_program program, uint32_t list[KARST_NUM_ROOTS])
{
    size_t count = 0;
    for (int o = 0; o < KARST_NUM_OUTPUTS; o++) {
        const karst_output_info *output = &karst_outputs[o];
        if (karst_entries[karst_entry_of((karst_output)o)].program != program || root[output->root] == KARST_NO_EXPR)
            continue;
        for (uint32_t i = 0; i < output->num_floats; i++)
            list[count++] = output->root + i;
    }
    return count;
}

size_t karst_program_roots(const karst_expr *root, karst_entry_program program, karst_expr list[KARST_NUM_ROOTS])
{
    uint32_t numbers[KARST_NUM_ROOTS];
    size_t count = karst_list_roots(root, program, numbers);
    for (size_t i = 0; i < count; i++)
        list[i] = root[numbers[i]];
    return count;
}
