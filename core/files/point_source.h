/* Files of points as streams: PLY, OBJ, XYZ text, LAS. One reader each (points_*.c) behind one table.
 *
 * All of a file is data from strangers: no count in it is believed before the points are there, nothing is allocated by
 * it, and each message names the place. A source belongs to one thread at a time. */
#ifndef KARST_CORE_FILES_POINT_SOURCE_H
#define KARST_CORE_FILES_POINT_SOURCE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "karst/error.h"

/* One point as a file has it, in the file's own axes and unit. */
typedef struct {
    double at[3];
    float normal[3]; /* if the source has normals; any length */
    uint8_t rgb[3];  /* if the source has colours */
    float light[3];  /* of a PLY with colours: as they are written, so that light may be brighter than white */
    double more[5];  /* if the source has what particles have: radius, extinction; velocity, or 0 */
} karst_file_point;

typedef struct karst_point_source karst_point_source;

typedef enum { KARST_POINTS_PLY, KARST_POINTS_OBJ, KARST_POINTS_XYZ, KARST_POINTS_LAS,
               /* text whose first line names its columns: no name's suffix means it */
               KARST_POINTS_PARTICLES } karst_point_format;

/* Which format a name's suffix means. Errors: KARST_USAGE (none of these; of LAZ and E57 the message names a
 * converter). */
bool karst_point_format_of(const char *name, karst_point_format *format, karst_error *error);

/* Reads the head of a file that is open for reading at its start, which the source then owns; `name` is for messages
 * and borrowed. Errors: KARST_BAD_DATA, KARST_FAILED. */
karst_point_source *karst_point_source_open(FILE *file, const char *name, karst_point_format format,
                                            karst_error *error);
/* The next points, at most `most`: how many in *num, 0 at the end. Errors: KARST_BAD_DATA with the place, also where a
 * file ends before it has what it says. */
bool karst_point_source_read(karst_point_source *source, karst_file_point *points, size_t most, size_t *num,
                             karst_error *error);
bool karst_point_source_has_normals(const karst_point_source *source);
bool karst_point_source_has_colours(const karst_point_source *source);
bool karst_point_source_has_radius(const karst_point_source *source); /* more[0], of a PLY */
bool karst_point_source_has_more(const karst_point_source *source); /* radius and extinction */
/* Points that the file itself says are not to be used (LAS: withheld, noise), so far. */
uint64_t karst_point_source_num_withheld(const karst_point_source *source);
/* How much of the file is read, 0 to 1; 0 where its length is not known. */
double karst_point_source_share(const karst_point_source *source);
void karst_point_source_close(karst_point_source *source); /* NULL is fine */

#endif
