/* The list of a scene's edits on the host: checked, as devices read it, with its index. Not thread-safe. */
#ifndef KARST_PRODUCERS_EDIT_LIST_H
#define KARST_PRODUCERS_EDIT_LIST_H

#include "cache/cache.h"
#include "karst/edit.h"
#include "producers/edits/edits_shared.h"

/* What a device reads is one block of memory, `data`, head first (edits_shared.h), with room for `capacity` edits.
 * The index is a tree over the edits in the order of a space-filling curve, built anew when too many are not in it. */
typedef struct {
    uint64_t *data;
    size_t size_bytes;
    uint32_t capacity, num_made; /* num_made: those in force and those that may be redone */
    int voxel_log2_m;
    bool is_rearranged; /* since the last time that somebody cleared it: more changed than edits at the end */
} karst_edit_list;

/* Empty, for a world of these voxels. Errors: KARST_FAILED. */
bool karst_edit_list_init(karst_edit_list *list, int voxel_log2_m, karst_error *error);
void karst_edit_list_finish(karst_edit_list *list); /* a zeroed one is fine */

/* Checks an edit, number `number` for messages, and makes the record of it. Errors: KARST_USAGE. */
bool karst_edit_record_make(const karst_edit *edit, size_t number, int voxel_log2_m, karst_edit_record *record,
                            karst_error *error);
/* Appends edits, all or none. Errors: KARST_USAGE, KARST_FAILED. */
bool karst_edit_list_append(karst_edit_list *list, const karst_edit *edits, size_t num, karst_error *error);
/* From now on the first `num` are in force, at most num_made. */
void karst_edit_list_set_num(karst_edit_list *list, uint32_t num);

uint32_t karst_edit_list_num(const karst_edit_list *list);
const karst_edit_record *karst_edit_list_records(const karst_edit_list *list);
/* What an edit changes: for karst_cache_drop. */
karst_drop_box karst_edit_record_box(const karst_edit_record *record);
/* The density at a position with the edits in force, from the world's own, at a level (-1: all detail): the bits of
 * devices. */
float karst_edit_list_density(const karst_edit_list *list, const karst_position *at, int level, float density);
/* What colours the edits in force have there: red, green and blue, each times coverage, and coverage, 0 to 1. `density`
 * is the world's own. The bits of devices, before they are packed (cache/colour.clh). */
void karst_edit_list_colour(const karst_edit_list *list, const karst_position *at, int level, float density,
                            float colour[4]);
/* The density in double, edit by edit and without the index, and the colours, unless that is NULL: what the former two
 * are measured against. Noise is the devices'. */
double karst_edit_list_precise(const karst_edit_list *list, const karst_position *at, int level, double density,
                               double colour[4]);
/* That density again, bit for bit, of the edits that the index finds. */
double karst_edit_list_precise_density(const karst_edit_list *list, const karst_position *at, int level,
                                       double density);
/* Whether any edit in force changes the density at a position, or might. */
bool karst_edit_list_touches(const karst_edit_list *list, const karst_position *at, double half_voxels);
/* What edits make of a range that holds the world's density in the closed box so many voxels around a position, at
 * every level from -1 to this one: the range of the edited density there, as devices have it. false: too many edits
 * meet the box, or it is too large, and nothing is known. */
bool karst_edit_list_range(const karst_edit_list *list, const karst_position *centre, const double half_voxels[3],
                           int level, double range[2]);
/* The index finds every edit, and its nodes hold theirs. Errors: KARST_FAILED, with what is wrong. */
bool karst_edit_list_check(const karst_edit_list *list, karst_error *error);

#endif
