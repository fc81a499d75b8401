/* A host-side stand-in for cache and producers: an octree of an analytic density, built node by node, in device
 * buffers.
 *
 * Densities are in level-0 voxels of the scene, positive inside; the scene may lie anywhere in the world (`base`). Used
 * by the casting tests and benchmarks only, so that they depend on nothing but core and the pools' layout. */
#ifndef KARST_TESTS_RAYCAST_SCENE_H
#define KARST_TESTS_RAYCAST_SCENE_H

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cache/cache.h"
#include "raycast/cast/cast.h"

#define SCENE_UNUSED __attribute__((unused))

/* Density at p (level-0 voxels from the scene's base), details finer than `width` left out or not as it likes. */
typedef double (*scene_density)(const double p[3], double width, const void *user);

typedef struct {
    karst_context *context;
    karst_cache_buffers buffers;
    karst_node *nodes;
    karst_tile_info *tiles; /* corners relative to the scene's base */
    karst_brick_info *brick_info;
    int16_t *bricks;
    uint32_t num_tiles, num_bricks; /* in use, slot 0 counted; capacities are in buffers */
    int64_t base[3];                /* level-0 voxel of the scene's origin: a multiple of the root nodes' size */
    int64_t root_corner[3];         /* relative to base, in nodes of top_level */
    int top_level;
    scene_density density;
    const void *user;
    double lipschitz; /* of the density, at every width */
} scene;

SCENE_UNUSED static void scene_check(bool ok, const karst_error *error)
{
    if (!ok) {
        fprintf(stderr, "scene: %s\n", error->message);
        exit(1);
    }
}

SCENE_UNUSED static karst_buffer *scene_buffer(karst_context *context, const char *name, size_t size_bytes)
{
    karst_error error = {0};
    karst_buffer *buffer = karst_buffer_create(context, name, size_bytes, NULL, &error);
    scene_check(buffer, &error);
    return buffer;
}

/* Nodes start unknown; nothing is on the device before scene_upload. */
SCENE_UNUSED static scene scene_create(karst_context *context, uint32_t max_tiles, uint32_t max_bricks,
                                       uint32_t num_segments, int top_level, scene_density density, const void *user)
{
    scene s = {.context = context, .top_level = top_level, .density = density, .user = user, .lipschitz = 1};
    karst_cache_buffers *b = &s.buffers;
    b->num_tiles = max_tiles;
    b->num_bricks = max_bricks;
    b->num_segments = num_segments;
    b->bricks_per_segment = (max_bricks + num_segments - 1) / num_segments;
    b->nodes = scene_buffer(context, "nodes", (size_t)max_tiles * 8 * sizeof(karst_node));
    for (uint32_t i = 0; i < KARST_MAX_BRICK_SEGMENTS; i++)
        b->bricks[i] = i < num_segments
                           ? scene_buffer(context, "bricks", (size_t)b->bricks_per_segment * KARST_BRICK_STRIDE * 2)
                           : b->bricks[0];
    b->tile_info = scene_buffer(context, "tile_info", max_tiles * sizeof(karst_tile_info));
    b->brick_info = scene_buffer(context, "brick_info", max_bricks * sizeof(karst_brick_info));
    b->tile_stamp = scene_buffer(context, "stamps", max_tiles * 4);
    b->brick_stamp = scene_buffer(context, "stamps", max_bricks * 4);
    b->brick_fallback = scene_buffer(context, "stamps", max_bricks * 4);
    b->want_brick = scene_buffer(context, "stamps", max_tiles * 32);
    b->want_children = scene_buffer(context, "stamps", max_tiles * 32);
    b->want_chunk = scene_buffer(context, "stamps", (max_tiles * 8 / KARST_REQUEST_CHUNK + 1) * 4);
    b->want_rays = scene_buffer(context, "stamps", max_tiles * 32);
    s.nodes = calloc((size_t)max_tiles * 8, sizeof(karst_node));
    s.tiles = calloc(max_tiles, sizeof(karst_tile_info));
    s.brick_info = calloc(max_bricks, sizeof(karst_brick_info));
    s.bricks = calloc((size_t)b->bricks_per_segment * num_segments * KARST_BRICK_STRIDE, 2);
    s.num_tiles = 2;
    s.num_bricks = 1;
    for (int a = 0; a < 3; a++)
        s.root_corner[a] = s.tiles[KARST_ROOT_TILE].corner[a] = -1;
    s.tiles[KARST_ROOT_TILE].level = top_level;
    s.tiles[KARST_ROOT_TILE].parent = KARST_NO_NODE;
    return s;
}

SCENE_UNUSED static void scene_destroy(scene *s)
{
    karst_cache_buffers *b = &s->buffers;
    karst_buffer_destroy(b->nodes);
    for (uint32_t i = 0; i < b->num_segments; i++)
        karst_buffer_destroy(b->bricks[i]);
    karst_buffer_destroy(b->brick_info);
    karst_buffer_destroy(b->tile_info);
    karst_buffer_destroy(b->tile_stamp);
    karst_buffer_destroy(b->brick_stamp);
    karst_buffer_destroy(b->brick_fallback);
    karst_buffer_destroy(b->want_brick);
    karst_buffer_destroy(b->want_children);
    karst_buffer_destroy(b->want_chunk);
    karst_buffer_destroy(b->want_rays);
    free(s->nodes);
    free(s->tiles);
    free(s->brick_info);
    free(s->bricks);
}

/* The pools as they stand; stamps and wants are cleared. */
SCENE_UNUSED static void scene_upload(scene *s)
{
    karst_error error = {0};
    karst_cache_buffers *b = &s->buffers;
    scene_check(karst_buffer_write(b->nodes, 0, s->nodes, (size_t)s->num_tiles * 8 * sizeof(karst_node), &error),
                &error);
    scene_check(karst_buffer_write(b->tile_info, 0, s->tiles, s->num_tiles * sizeof(karst_tile_info), &error), &error);
    scene_check(karst_buffer_write(b->brick_info, 0, s->brick_info, s->num_bricks * sizeof(karst_brick_info), &error),
                &error);
    for (uint32_t i = 0; i * b->bricks_per_segment < s->num_bricks; i++) {
        uint32_t first = i * b->bricks_per_segment, left = s->num_bricks - first;
        uint32_t count = left < b->bricks_per_segment ? left : b->bricks_per_segment;
        scene_check(karst_buffer_write(b->bricks[i], 0, s->bricks + (size_t)first * KARST_BRICK_STRIDE,
                                       (size_t)count * KARST_BRICK_STRIDE * 2, &error),
                    &error);
    }
    karst_buffer *stamps[] = {b->tile_stamp,    b->brick_stamp, b->brick_fallback, b->want_brick,
                              b->want_children, b->want_chunk,  b->want_rays};
    for (size_t i = 0; i < sizeof stamps / sizeof *stamps; i++)
        scene_check(karst_buffer_fill(stamps[i], 0, 0, stamps[i]->size_bytes, &error), &error);
}

/* The same content on another device, or in other segments. */
SCENE_UNUSED static scene scene_clone(karst_context *context, uint32_t num_segments, const scene *from)
{
    scene s = scene_create(context, from->buffers.num_tiles, from->buffers.num_bricks, num_segments, from->top_level,
                           from->density, from->user);
    s.num_tiles = from->num_tiles;
    s.num_bricks = from->num_bricks;
    s.lipschitz = from->lipschitz;
    memcpy(s.nodes, from->nodes, (size_t)s.num_tiles * 8 * sizeof(karst_node));
    memcpy(s.tiles, from->tiles, s.num_tiles * sizeof(karst_tile_info));
    memcpy(s.brick_info, from->brick_info, s.num_bricks * sizeof(karst_brick_info));
    memcpy(s.bricks, from->bricks, (size_t)s.num_bricks * KARST_BRICK_STRIDE * 2);
    scene_upload(&s);
    return s;
}

/* Node coordinate (relative to the base) of a node index. */
SCENE_UNUSED static void scene_node_place(const scene *s, uint32_t node, int64_t corner[3], int *level)
{
    const karst_tile_info *tile = &s->tiles[node / 8];
    for (int a = 0; a < 3; a++)
        corner[a] = tile->corner[a] + (node >> a & 1);
    *level = tile->level;
}

/* The state that a bound proves, for densities whose slope is at most s->lipschitz. */
static uint32_t scene_state(const scene *s, uint32_t node)
{
    int64_t n[3];
    int level;
    scene_node_place(s, node, n, &level);
    double size = ldexp(KARST_BRICK_CELLS, level), p[3];
    for (int a = 0; a < 3; a++)
        p[a] = ((double)n[a] + 0.5) * size;
    double d = s->density(p, ldexp(1, level), s->user), reach = s->lipschitz * size * 0.8661;
    return d > reach ? KARST_STATE_SOLID : d < -reach ? KARST_STATE_AIR : KARST_STATE_LOST;
}

SCENE_UNUSED static void scene_classify_tile(scene *s, uint32_t tile)
{
    for (uint32_t i = tile * 8; i < tile * 8 + 8; i++)
        s->nodes[i] = (karst_node){KARST_NODE_LINK(scene_state(s, i), 0), 0};
}

/* Gives the node children; false if no tile is free. */
SCENE_UNUSED static bool scene_subdivide(scene *s, uint32_t node)
{
    if (s->num_tiles == s->buffers.num_tiles)
        return false;
    uint32_t tile = s->num_tiles++;
    int64_t n[3];
    int level;
    scene_node_place(s, node, n, &level);
    for (int a = 0; a < 3; a++)
        s->tiles[tile].corner[a] = 2 * n[a];
    s->tiles[tile].level = level - 1;
    s->tiles[tile].parent = node;
    scene_classify_tile(s, tile);
    s->nodes[node].link = KARST_NODE_LINK(KARST_NODE_STATE(s->nodes[node].link), tile);
    return true;
}

/* Block mask and safe step of a slot's encoded samples, from their definitions; its fine mask is filled in. */
SCENE_UNUSED static karst_brick_info scene_brick_info(int16_t *q, float scale)
{
    karst_brick_info info = {.scale = scale};
    uint32_t fine[KARST_FINE_WORDS] = {0};
    double steepest = 0;
    const int side = KARST_BRICK_SIDE;
    for (int z = 0; z < KARST_BRICK_CELLS; z++)
        for (int y = 0; y < KARST_BRICK_CELLS; y++)
            for (int x = 0; x < KARST_BRICK_CELLS; x++) {
                double slope = 0;
                int solid = 0;
                for (int a = 0; a < 3; a++) {
                    int step = a == 0 ? 1 : a == 1 ? side : side * side, b = (a + 1) % 3, c = (a + 2) % 3, most = 0;
                    int step_b = b == 0   ? 1
                                 : b == 1 ? side
                                          : side * side,
                        step_c = c == 0   ? 1
                                 : c == 1 ? side
                                          : side * side;
                    for (int i = 0; i < 4; i++) {
                        const int16_t *v = q + x + side * (y + side * z) + (i & 1) * step_b + (i >> 1) * step_c;
                        int d = abs(v[step] - v[0]);
                        most = d > most ? d : most;
                        solid += (v[0] > 0) + (v[step] > 0);
                    }
                    slope += (double)most * most;
                }
                steepest = slope > steepest ? slope : steepest;
                if (solid != 0 && solid != 24) {
                    int block = x / 4 + 4 * (y / 4) + 16 * (z / 4);
                    info.blocks[block >> 5] |= 1u << (block & 31);
                    block = x / 2 + 8 * (y / 2) + 64 * (z / 2);
                    fine[block >> 5] |= 1u << (block & 31);
                }
            }
    for (int block = 0; block < 64; block++)
        if (q[4 * (block % 4 + side * (block / 4 % 4 + side * (block / 16)))] > 0)
            info.solid[block >> 5] |= 1u << (block & 31);
    info.safe_cells = steepest > 0 ? (float)(0.999999 / sqrt(steepest)) : 1e30f;
    memcpy(q + KARST_BRICK_PADDED, fine, sizeof(fine));
    return info;
}

/* Evaluates the node's brick. What comes out constant beyond doubt becomes air or solid. false if no slot is free. */
SCENE_UNUSED static bool scene_load(scene *s, uint32_t node)
{
    if (s->num_bricks == s->buffers.num_bricks)
        return false;
    int64_t n[3];
    int level;
    scene_node_place(s, node, n, &level);
    double voxel = ldexp(1, level), least = 1e300, most = -1e300, largest = 0;
    double *d = malloc(KARST_BRICK_SAMPLES * sizeof(double));
    for (int i = 0; i < KARST_BRICK_SAMPLES; i++) {
        int at[3] = {i % KARST_BRICK_SIDE, i / KARST_BRICK_SIDE % KARST_BRICK_SIDE,
                     i / (KARST_BRICK_SIDE * KARST_BRICK_SIDE)};
        double p[3];
        for (int a = 0; a < 3; a++)
            p[a] = (double)(n[a] * KARST_BRICK_CELLS + at[a]) * voxel;
        d[i] = s->density(p, voxel, s->user);
        least = d[i] < least ? d[i] : least;
        most = d[i] > most ? d[i] : most;
        largest = fabs(d[i]) > largest ? fabs(d[i]) : largest;
    }
    double reach = s->lipschitz * voxel * 0.8661;
    uint32_t children = KARST_NODE_CHILDREN(s->nodes[node].link);
    if (most < -reach || least > reach) {
        s->nodes[node] = (karst_node){KARST_NODE_LINK(most < 0 ? KARST_STATE_AIR : KARST_STATE_SOLID, 0), 0};
    } else {
        uint32_t slot = s->num_bricks++;
        int16_t *q = s->bricks + (size_t)slot * KARST_BRICK_STRIDE;
        double scale = largest > 0 ? largest / 32767 : 1;
        for (int i = 0; i < KARST_BRICK_SAMPLES; i++) {
            long v = lrint(d[i] / scale);
            q[i] = (int16_t)(d[i] > 0 && v < 1 ? 1 : d[i] < 0 && v > -1 ? -1 : v);
        }
        s->brick_info[slot] = scene_brick_info(q, (float)scale);
        s->nodes[node] = (karst_node){KARST_NODE_LINK(KARST_STATE_BRICK, children), slot};
    }
    free(d);
    return true;
}

/* Bricks for all that is not constant, down to `finest`. */
SCENE_UNUSED static void scene_build_node(scene *s, uint32_t node, int level, int finest)
{
    if (KARST_NODE_STATE(s->nodes[node].link) < KARST_STATE_BRICK &&
        KARST_NODE_STATE(s->nodes[node].link) != KARST_STATE_UNKNOWN)
        return;
    if (!scene_load(s, node)) {
        fprintf(stderr, "scene: too few bricks\n");
        exit(1);
    }
    if (level == finest || KARST_NODE_STATE(s->nodes[node].link) != KARST_STATE_BRICK)
        return;
    if (!scene_subdivide(s, node)) {
        fprintf(stderr, "scene: too few tiles\n");
        exit(1);
    }
    uint32_t tile = KARST_NODE_CHILDREN(s->nodes[node].link);
    for (uint32_t i = 0; i < 8; i++)
        scene_build_node(s, tile * 8 + i, level - 1, finest);
}

SCENE_UNUSED static void scene_build(scene *s, int finest)
{
    scene_classify_tile(s, KARST_ROOT_TILE);
    for (uint32_t i = 0; i < 8; i++)
        scene_build_node(s, KARST_ROOT_TILE * 8 + i, s->top_level, finest);
    scene_upload(s);
}

/* The node of `level` that holds p, or the deepest there is above it. */
SCENE_UNUSED static uint32_t scene_find(const scene *s, const double p[3], int level)
{
    uint32_t tile = KARST_ROOT_TILE;
    for (;;) {
        const karst_tile_info *info = &s->tiles[tile];
        uint32_t child = 0;
        for (int a = 0; a < 3; a++)
            child |= (uint32_t)((int64_t)floor(p[a] / ldexp(KARST_BRICK_CELLS, info->level)) - info->corner[a]) << a;
        uint32_t node = tile * 8 + child;
        if (info->level == level || !KARST_NODE_CHILDREN(s->nodes[node].link))
            return node;
        tile = KARST_NODE_CHILDREN(s->nodes[node].link);
    }
}

/* A view whose anchor is p (exact to 2^-32). */
SCENE_UNUSED static karst_cast_view scene_view(const scene *s, const double p[3], float detail)
{
    karst_position anchor;
    int64_t root[3];
    for (int a = 0; a < 3; a++) {
        double whole = floor(p[a]);
        anchor.voxel[a] = s->base[a] + (int64_t)whole;
        anchor.fraction[a] = (uint32_t)ldexp(p[a] - whole, 32);
        root[a] = s->root_corner[a] + (s->base[a] >> (KARST_BRICK_CELLS_LOG2 + s->top_level));
    }
    karst_cast_view view;
    karst_cast_view_init(&view, &anchor, root, s->top_level);
    view.detail = detail;
    view.serial = 1;
    return view;
}

/* Answers all wants that carry `serial` and uploads. Returns how many there were. */
SCENE_UNUSED static uint32_t scene_serve(scene *s, uint32_t serial)
{
    karst_error error = {0};
    uint32_t n = s->num_tiles * 8, count = 0;
    uint32_t *want_brick = malloc(n * 4), *want_children = malloc(n * 4);
    scene_check(karst_buffer_read(s->buffers.want_brick, 0, want_brick, n * 4, &error), &error);
    scene_check(karst_buffer_read(s->buffers.want_children, 0, want_children, n * 4, &error), &error);
    for (uint32_t i = 8; i < n; i++) {
        if (want_brick[i] == serial) {
            count++;
            if (!scene_load(s, i)) {
                fprintf(stderr, "scene: too few bricks\n");
                exit(1);
            }
        }
        uint32_t state = KARST_NODE_STATE(s->nodes[i].link);
        if (want_children[i] == serial && state != KARST_STATE_AIR && state != KARST_STATE_SOLID) {
            count++;
            if (!scene_subdivide(s, i)) {
                fprintf(stderr, "scene: too few tiles\n");
                exit(1);
            }
        }
    }
    free(want_brick);
    free(want_children);
    if (count)
        scene_upload(s);
    return count;
}

#endif
