/* The bytes of a NanoVDB file, as NanoVDB 32.4 has them (the headers of Debian's libnanovdb-dev say what each means).
 *
 * A file is segments, one behind another: a segment's header, then a record and a name for each of its grids, then the
 * grids. A grid is its data, a tree's, a root with tiles, upper nodes of 32^3 children, lower nodes of 16^3, leaves of
 * 8^3 values. Offsets count bytes from the node that holds them. Along a table z changes fastest. All numbers are
 * little-endian, as the host's must be. */
#ifndef KARST_FILES_NANO_LAYOUT_H
#define KARST_FILES_NANO_LAYOUT_H

#include <stdint.h>

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "NanoVDB's files hold the numbers of little-endian hosts");

#define KARST_NANO_MAGIC 0x304244566f6e614eu /* "NanoVDB0" */
#define KARST_NANO_MAJOR 32u
#define KARST_NANO_VERSION (KARST_NANO_MAJOR << 21 | 4u << 10 | 2u)
#define KARST_NANO_NAME_BYTES 256u

enum { KARST_NANO_CODEC_NONE, KARST_NANO_CODEC_ZIP, KARST_NANO_CODEC_BLOSC };
enum { KARST_NANO_TYPE_FLOAT = 1 };
enum { KARST_NANO_CLASS_UNKNOWN, KARST_NANO_CLASS_LEVEL_SET, KARST_NANO_CLASS_FOG };
enum { KARST_NANO_HAS_BOX = 2, KARST_NANO_HAS_RANGE = 4, KARST_NANO_IS_BREADTH_FIRST = 32 }; /* a grid's flags */
enum { KARST_NANO_HAS_ACTIVE = 2 };                                                          /* a node's */
/* Values along an axis of each kind of node, as powers of two. */
enum { KARST_NANO_LEAF_LOG2 = 3, KARST_NANO_LOWER_LOG2 = 7, KARST_NANO_UPPER_LOG2 = 12 };

typedef struct {
    uint64_t magic;
    uint32_t version;
    uint16_t num_grids, codec;
} karst_nano_segment;
_Static_assert(sizeof(karst_nano_segment) == 16, "a segment's header");

typedef struct {
    uint64_t grid_bytes, file_bytes, name_key, num_active;
    uint32_t type, grid_class;
    double world_box[6];  /* of active values: lower corner, then the upper one, a voxel beyond */
    int32_t index_box[6]; /* lower and upper, which belongs to it */
    double voxel[3];
    uint32_t name_bytes; /* with the byte of 0 at its end */
    uint32_t num_nodes[4], num_active_tiles[3];
    uint16_t codec, unused;
    uint32_t version;
} karst_nano_record;
_Static_assert(sizeof(karst_nano_record) == 176, "a grid's record");

/* From indices to the world: matrix times index, plus offset. */
typedef struct {
    float matrix_f[9], inverse_f[9], offset_f[3], taper_f;
    double matrix[9], inverse[9], offset[3], taper;
} karst_nano_map;

typedef struct {
    uint64_t magic, checksum;
    uint32_t version, flags, grid_index, num_grids;
    uint64_t grid_bytes;
    char name[KARST_NANO_NAME_BYTES];
    karst_nano_map map;
    double world_box[6], voxel[3];
    uint32_t grid_class, type;
    int64_t blind_offset;
    uint32_t num_blind, unused[5];
} karst_nano_grid;
_Static_assert(sizeof(karst_nano_grid) == 672, "a grid");

typedef struct {
    uint64_t offset[4]; /* of the first leaf, lower and upper node and of the root, from here; 0: there is none */
    uint32_t num_nodes[3], num_active_tiles[3];
    uint64_t num_active;
} karst_nano_tree;
_Static_assert(sizeof(karst_nano_tree) == 64, "a tree");

typedef struct {
    int32_t box[6];
    uint32_t num_tiles;
    float background, least, most, mean, deviation, unused[4];
} karst_nano_root;
_Static_assert(sizeof(karst_nano_root) == 64, "a root");

typedef struct {
    uint64_t key;
    int64_t child; /* 0: a value */
    uint32_t state;
    float value;
    uint64_t unused;
} karst_nano_root_tile;
_Static_assert(sizeof(karst_nano_root_tile) == 32, "a root's tile");

typedef union {
    float value;
    int64_t child;
} karst_nano_entry;

typedef struct {
    int32_t box[6];
    uint64_t flags, active[512], child[512];
    float least, most, mean, deviation;
    uint64_t unused[2];
    karst_nano_entry table[32768];
} karst_nano_upper;
_Static_assert(sizeof(karst_nano_upper) == 270400, "an upper node");

typedef struct {
    int32_t box[6];
    uint64_t flags, active[64], child[64];
    float least, most, mean, deviation;
    uint64_t unused[2];
    karst_nano_entry table[4096];
} karst_nano_lower;
_Static_assert(sizeof(karst_nano_lower) == 33856, "a lower node");

typedef struct {
    int32_t low[3];
    uint8_t extent[3], flags;
    uint64_t active[8];
    float least, most, mean, deviation;
    float values[512];
} karst_nano_leaf;
_Static_assert(sizeof(karst_nano_leaf) == 2144, "a leaf");

static inline uint64_t karst_nano_root_key(const int32_t at[3])
{
    return (uint64_t)((uint32_t)at[2] >> KARST_NANO_UPPER_LOG2) |
           (uint64_t)((uint32_t)at[1] >> KARST_NANO_UPPER_LOG2) << 21 |
           (uint64_t)((uint32_t)at[0] >> KARST_NANO_UPPER_LOG2) << 42;
}

/* Where an index stands in the table of the node that holds it, 2^log2 values wide, its entries 2^child_log2. */
static inline uint32_t karst_nano_place(const int32_t at[3], int log2, int child_log2)
{
    const uint32_t mask = (1u << log2) - 1;
    const int bits = log2 - child_log2;
    return ((uint32_t)at[0] & mask) >> child_log2 << (2 * bits) | ((uint32_t)at[1] & mask) >> child_log2 << bits |
           ((uint32_t)at[2] & mask) >> child_log2;
}

#endif
