/* What the readers of points share: a buffer over the file, and numbers in its text. */
#ifndef KARST_CORE_FILES_POINT_SOURCE_INTERNAL_H
#define KARST_CORE_FILES_POINT_SOURCE_INTERNAL_H

#include "core/files/point_source.h"

#define KARST_POINTS_BUFFER_BYTES 65536u
#define KARST_POINTS_MAX_LINE_BYTES 4096u
#define KARST_PLY_MAX_ELEMENTS 16
#define KARST_PLY_MAX_PROPERTIES 64

typedef struct {
    const char *name; /* for people */
    bool (*read)(karst_point_source *source, karst_file_point *points, size_t most, size_t *num, karst_error *error);
} karst_point_reader;

/* A property of a PLY's element: what it is of a point, and how it is written. */
typedef struct {
    uint8_t type, count_type; /* count_type: of a list; 0: it is no list */
    uint8_t meaning;          /* 0: nothing; 1 to 3 place, 4 to 6 normal, 7 to 9 colour,
                                * 10 to 14 what particles have */
} karst_ply_property;

typedef struct {
    uint64_t count;
    bool is_vertex;
    uint32_t num_properties;
    uint32_t row_bytes; /* if it is binary, and has no lists; else 0 */
    karst_ply_property properties[KARST_PLY_MAX_PROPERTIES];
} karst_ply_element;

struct karst_point_source {
    const karst_point_reader *reader;
    FILE *file;
    const char *name;
    uint8_t buffer[KARST_POINTS_BUFFER_BYTES];
    size_t begin, end;       /* what of the buffer is not read yet */
    uint64_t offset, length; /* of the byte at `begin`; of the file, 0: not known */
    uint64_t line;           /* of texts: the number of the last one read */
    char text[KARST_POINTS_MAX_LINE_BYTES];
    bool has_normals, has_colours, has_more, has_radius;
    uint64_t num_withheld;
    float (*normals)[3]; /* of an OBJ's vertices, from its faces; NULL: there are none */
    uint64_t num_normals, next_vertex;
    union {
        struct {
            uint8_t encoding; /* 0: ASCII, 1: little-endian, 2: big-endian */
            uint32_t num_elements, element;
            uint64_t row; /* of the element */
            karst_ply_element elements[KARST_PLY_MAX_ELEMENTS];
        } ply;
        struct {
            int num_columns, normal_column, colour_column; /* -1: there is none */
            bool has_first;                                /* the first line of points waits in `text` */
        } xyz;
        struct {
            int num_columns, of[8]; /* which column has x, y, z, radius, extinction, and velocity; -1: none */
        } particles;
        struct {
            uint64_t num_left, num_all;
            uint32_t record_bytes, format, colour_offset;
            double scale[3], offset[3];
            int colour_shift; /* -1: not known yet */
        } las;
    } as;
};

/* KARST_BAD_DATA with the file's name and the line or the byte where it stands; returns false. */
bool karst_point_source_complain(const karst_point_source *source, karst_error *error, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
/* Exactly so many bytes; NULL: the file ends before. At most KARST_POINTS_BUFFER_BYTES, valid until the next call. */
const uint8_t *karst_point_source_bytes(karst_point_source *source, size_t num);
/* The next line, without its end, in source->text. *has_line false: the file has ended. Errors: lines that are too long
 * or hold a NUL, as no text does. */
bool karst_point_source_line(karst_point_source *source, bool *has_line, karst_error *error);
/* Up to `most` numbers of a text, apart by blanks, commas or semicolons; how many there are before its end or what is
 * no number. */
int karst_point_source_numbers(const char *text, double *numbers, int most);

/* Each reads a file's head, and says which reader goes on. */
bool karst_points_open_ply(karst_point_source *source, karst_error *error);
bool karst_points_open_obj(karst_point_source *source, karst_error *error);
bool karst_points_open_xyz(karst_point_source *source, karst_error *error);
bool karst_points_open_las(karst_point_source *source, karst_error *error);
bool karst_points_open_particles(karst_point_source *source, karst_error *error);

#endif
