/* Points of a PLY: the element "vertex", in ASCII or binary of either order; what else there is, is passed over. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/files/point_source_internal.h"

enum { NO_TYPE, INT8, UINT8, INT16, UINT16, INT32, UINT32, FLOAT32, FLOAT64, NUM_TYPES };
static const uint8_t type_bytes[NUM_TYPES] = {0, 1, 1, 2, 2, 4, 4, 4, 8};
enum { ASCII, LITTLE, BIG };

static uint8_t type_of(const char *word)
{
    static const char *const names[NUM_TYPES][2] = {{"", ""},           {"char", "int8"},     {"uchar", "uint8"},
                                                    {"short", "int16"}, {"ushort", "uint16"}, {"int", "int32"},
                                                    {"uint", "uint32"}, {"float", "float32"}, {"double", "float64"}};
    for (uint8_t type = INT8; type < NUM_TYPES; type++)
        if (!strcmp(word, names[type][0]) || !strcmp(word, names[type][1]))
            return type;
    return NO_TYPE;
}

static uint8_t meaning_of(const char *word)
{
    static const char *const names[][2] = {{"x", ""},
                                           {"y", ""},
                                           {"z", ""},
                                           {"nx", "normal_x"},
                                           {"ny", "normal_y"},
                                           {"nz", "normal_z"},
                                           {"red", "diffuse_red"},
                                           {"green", "diffuse_green"},
                                           {"blue", "diffuse_blue"},
                                           {"radius", ""},
                                           {"extinction", ""},
                                           {"vx", ""},
                                           {"vy", ""},
                                           {"vz", ""}};
    for (uint8_t i = 0; i < sizeof names / sizeof *names; i++)
        if (!strcmp(word, names[i][0]) || !strcmp(word, names[i][1]))
            return (uint8_t)(i + 1);
    return 0;
}

/* ---- the head ---- */

static bool read_property(karst_point_source *source, char *words[], int num_words, karst_error *error)
{
    const bool is_list = num_words == 5 && strcmp(words[1], "list") == 0;
    if (source->as.ply.num_elements == 0)
        return karst_point_source_complain(source, error, "a property before any element");
    karst_ply_element *element = &source->as.ply.elements[source->as.ply.num_elements - 1];
    if (element->num_properties == KARST_PLY_MAX_PROPERTIES)
        return karst_point_source_complain(source, error, "more than %d properties", KARST_PLY_MAX_PROPERTIES);
    karst_ply_property *property = &element->properties[element->num_properties++];
    *property = (karst_ply_property){0};
    if (!is_list && num_words != 3)
        return karst_point_source_complain(source, error, "a property is \"property TYPE NAME\"");
    property->type = type_of(words[is_list ? 3 : 1]);
    property->count_type = is_list ? type_of(words[2]) : NO_TYPE;
    property->meaning = element->is_vertex && !is_list ? meaning_of(words[2]) : 0;
    if (!property->type || (is_list && (!property->count_type || property->count_type >= FLOAT32)))
        return karst_point_source_complain(source, error, "\"%.40s\" is no type of a PLY",
                                           words[is_list && property->type ? 2
                                                 : is_list                 ? 3
                                                                           : 1]);
    return true;
}

static bool read_element(karst_point_source *source, char *words[], int num_words, karst_error *error)
{
    char *end = NULL;
    if (source->as.ply.num_elements == KARST_PLY_MAX_ELEMENTS)
        return karst_point_source_complain(source, error, "more than %d elements", KARST_PLY_MAX_ELEMENTS);
    unsigned long long count = num_words == 3 ? strtoull(words[2], &end, 10) : 0;
    if (!end || *end || words[2][0] == '-')
        return karst_point_source_complain(source, error, "an element is \"element NAME COUNT\"");
    karst_ply_element *element = &source->as.ply.elements[source->as.ply.num_elements++];
    *element = (karst_ply_element){.count = count, .is_vertex = strcmp(words[1], "vertex") == 0};
    return true;
}

static bool read_head_line(karst_point_source *source, char *words[], int num_words, karst_error *error)
{
    static const char *const encodings[] = {"ascii", "binary_little_endian", "binary_big_endian"};
    if (num_words == 0 || !strcmp(words[0], "comment") || !strcmp(words[0], "obj_info"))
        return true;
    if (!strcmp(words[0], "element"))
        return read_element(source, words, num_words, error);
    if (!strcmp(words[0], "property"))
        return read_property(source, words, num_words, error);
    if (strcmp(words[0], "format") != 0 || num_words < 2)
        return karst_point_source_complain(source, error, "\"%.40s\" is no line of a PLY's head", words[0]);
    for (uint8_t i = 0; i < 3; i++)
        if (!strcmp(words[1], encodings[i])) {
            source->as.ply.encoding = i;
            return true;
        }
    return karst_point_source_complain(source, error, "\"%.40s\" is no format of a PLY", words[1]);
}

/* At most 64 properties of 8 bytes. */
static void measure_row(karst_ply_element *element)
{
    bool has_list = false;
    element->row_bytes = 0;
    for (uint32_t i = 0; i < element->num_properties; i++) {
        has_list = has_list || element->properties[i].count_type;
        element->row_bytes += type_bytes[element->properties[i].type];
    }
    if (has_list)
        element->row_bytes = 0;
}

/* What the vertices have, once the head is read. */
static bool look_at_vertices(karst_point_source *source, karst_error *error)
{
    unsigned found = 0, num_vertices = 0;
    for (uint32_t e = 0; e < source->as.ply.num_elements; e++) {
        const karst_ply_element *element = &source->as.ply.elements[e];
        num_vertices += element->is_vertex;
        for (uint32_t i = 0; i < element->num_properties; i++)
            found |= 1u << element->properties[i].meaning;
    }
    if (num_vertices != 1 || (found & 0xeu) != 0xeu)
        return karst_point_source_complain(source, error,
                                           "no points: a PLY has one element vertex, with properties x, y and z");
    for (uint32_t e = 0; e < source->as.ply.num_elements && source->as.ply.encoding != ASCII; e++)
        measure_row(&source->as.ply.elements[e]);
    source->has_normals = (found & 0x70u) == 0x70u;
    source->has_colours = (found & 0x380u) == 0x380u;
    source->has_more = (found & 0xc00u) == 0xc00u;
    source->has_radius = (found & 0x400u) != 0;
    return true;
}

static int split(char *text, char *words[], int most)
{
    int num = 0;
    for (char *save = NULL, *word = strtok_r(text, " \t", &save); word && num < most;
         word = strtok_r(NULL, " \t", &save))
        words[num++] = word;
    return num;
}

/* ---- values ---- */

static double value_of(const uint8_t *bytes, uint8_t type, bool is_big)
{
    union {
        uint8_t bytes[8];
        int8_t i8;
        uint8_t u8;
        int16_t i16;
        uint16_t u16;
        int32_t i32;
        uint32_t u32;
        float f32;
        double f64;
    } value;
    const size_t size = type_bytes[type];
    if (is_big)
        for (size_t i = 0; i < size; i++)
            value.bytes[i] = bytes[size - 1 - i];
    else if (size == 4) /* as most are; a copy of a known size is an instruction */
        memcpy(value.bytes, bytes, 4);
    else
        memcpy(value.bytes, bytes, size);
    switch (type) {
    case INT8:
        return value.i8;
    case UINT8:
        return value.u8;
    case INT16:
        return value.i16;
    case UINT16:
        return value.u16;
    case INT32:
        return value.i32;
    case UINT32:
        return value.u32;
    case FLOAT32:
        return (double)value.f32;
    default:
        return value.f64;
    }
}

static bool ends_early(karst_point_source *source, karst_error *error)
{
    const karst_ply_element *element = &source->as.ply.elements[source->as.ply.element];
    return karst_point_source_complain(source, error, "the file ends after %llu of %llu %s: is it whole?",
                                       (unsigned long long)source->as.ply.row, (unsigned long long)element->count,
                                       element->is_vertex ? "points" : "rows of an element before the points");
}

static bool next_binary(karst_point_source *source, uint8_t type, double *value, karst_error *error)
{
    const uint8_t *bytes = karst_point_source_bytes(source, type_bytes[type]);
    if (!bytes)
        return ends_early(source, error);
    *value = value_of(bytes, type, source->as.ply.encoding == BIG);
    return true;
}

/* The values of a row in a text go over as many lines as the writer liked; all do with one. */
static bool next_text(const char **text, double *value)
{
    char *end;
    *text += strspn(*text, " \t");
    *value = strtod(*text, &end);
    bool good = end != *text && (!*end || *end == ' ' || *end == '\t');
    *text = end;
    return good;
}

static void take(karst_file_point *point, uint8_t meaning, uint8_t type, double value)
{
    if (meaning >= 1 && meaning <= 3)
        point->at[meaning - 1] = value;
    else if (meaning >= 4 && meaning <= 6)
        point->normal[meaning - 4] = (float)value;
    else if (meaning >= 10)
        point->more[meaning - 10] = value;
    else if (meaning >= 7) {
        double scaled = type >= FLOAT32 ? value * 255 : type == UINT16 ? value / 257 : value;
        point->light[meaning - 7] = (float)value;
        point->rgb[meaning - 7] = scaled >= 255 ? 255 : scaled > 0 ? (uint8_t)(scaled + 0.5) : 0;
    }
}

/* Passes over a list's members, few at a time: how many there are is only what the file says. */
static bool pass_list(karst_point_source *source, uint8_t type, double count, karst_error *error)
{
    if (!(count >= 0))
        return karst_point_source_complain(source, error, "a list of %g members", count);
    for (uint64_t left = (uint64_t)count; left;) {
        uint64_t num = left < 4096 ? left : 4096;
        if (!karst_point_source_bytes(source, num * type_bytes[type]))
            return ends_early(source, error);
        left -= num;
    }
    return true;
}

/* A binary row without lists is of a known length; false: the file ends within it, or it is another one. */
static bool read_plain_row(karst_point_source *source, const karst_ply_element *element, karst_file_point *point)
{
    const uint8_t *bytes = element->row_bytes ? karst_point_source_bytes(source, element->row_bytes) : NULL;
    for (uint32_t i = 0; bytes && i < element->num_properties; i++) {
        const karst_ply_property *property = &element->properties[i];
        if (property->meaning)
            take(point, property->meaning, property->type,
                 value_of(bytes, property->type, source->as.ply.encoding == BIG));
        bytes += type_bytes[property->type];
    }
    return bytes != NULL;
}

static bool read_row(karst_point_source *source, const karst_ply_element *element, karst_file_point *point,
                     karst_error *error)
{
    if (read_plain_row(source, element, point))
        return true;
    const bool is_text = source->as.ply.encoding == ASCII;
    const char *text = source->text;
    bool has_line = true;
    if (is_text && !karst_point_source_line(source, &has_line, error))
        return false;
    if (!has_line)
        return ends_early(source, error);
    for (uint32_t i = 0; i < element->num_properties; i++) {
        const karst_ply_property *property = &element->properties[i];
        double value = 0;
        uint8_t first = property->count_type ? property->count_type : property->type;
        if (is_text ? !next_text(&text, &value) : !next_binary(source, first, &value, error))
            return is_text ? karst_point_source_complain(source, error, "value %u of %u is missing or no number", i + 1,
                                                         element->num_properties)
                           : false;
        if (property->count_type && is_text && !element->is_vertex)
            return true; /* nothing that follows in this line is of use */
        if (property->count_type && is_text) {
            for (double left = value; left >= 1; left--)
                if (!next_text(&text, &value))
                    return karst_point_source_complain(source, error, "a list is shorter than it says");
        } else if (property->count_type) {
            if (!pass_list(source, property->type, value, error))
                return false;
        } else {
            take(point, property->meaning, property->type, value);
        }
    }
    return true;
}

static bool read_ply(karst_point_source *source, karst_file_point *points, size_t most, size_t *num, karst_error *error)
{
    *num = 0;
    for (; source->as.ply.element < source->as.ply.num_elements; source->as.ply.element++, source->as.ply.row = 0) {
        const karst_ply_element *element = &source->as.ply.elements[source->as.ply.element];
        if (element->num_properties == 0)
            continue;
        for (; source->as.ply.row < element->count; source->as.ply.row++) {
            karst_file_point passed = {0}, *point = element->is_vertex ? &points[*num] : &passed;
            if (element->is_vertex && *num == most)
                return true;
            *point = (karst_file_point){0};
            if (!read_row(source, element, point, error))
                return false;
            *num += element->is_vertex;
        }
        if (element->is_vertex) { /* what follows is not looked at */
            source->as.ply.element = source->as.ply.num_elements;
            return true;
        }
    }
    return true;
}

bool karst_points_open_ply(karst_point_source *source, karst_error *error)
{
    static const karst_point_reader reader = {"PLY", read_ply};
    bool has_line;
    source->reader = &reader;
    if (!karst_point_source_line(source, &has_line, error))
        return false;
    if (!has_line || strcmp(source->text, "ply") != 0)
        return karst_point_source_complain(source, error, "no PLY: its first line is \"ply\"");
    for (int i = 0; i < 1000; i++) {
        char *words[8];
        if (!karst_point_source_line(source, &has_line, error))
            return false;
        if (!has_line)
            return karst_point_source_complain(source, error, "the file ends before \"end_header\"");
        if (!strcmp(source->text, "end_header")) {
            bool good = look_at_vertices(source, error);
            if (source->as.ply.encoding != ASCII)
                source->line = 0; /* places are bytes from now on */
            return good;
        }
        int num_words = split(source->text, words, 8);
        if (!read_head_line(source, words, num_words, error))
            return false;
    }
    return karst_point_source_complain(source, error, "a head of more than 1000 lines");
}
