/* Meshes as files: PLY, OBJ and binary glTF. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "core/export/glb.h"
#include "core/export/out_file.h"
#include "karst/engine.h"
#include "karst/mesh.h"

/* AT_ONCE: vertices, or triangles, between two writes. */
enum { BUFFER_BYTES = 1 << 16, PLY_TRIANGLE_BYTES = 13, AT_ONCE = 512 };

typedef struct {
    karst_mesh_format format;
    const char *path;
    FILE *parts[2]; /* vertices, triangles; of an OBJ both are in the first */
    bool (*progress)(void *user, double share);
    void *user;
    float least[3], most[3];
    bool points_only; /* no triangles */
} writer;

bool karst_mesh_format_of(const char *path, karst_mesh_format *format, karst_error *error)
{
    static const struct {
        const char *suffix;
        karst_mesh_format format;
    } formats[] = {{".glb", KARST_MESH_GLB}, {".ply", KARST_MESH_PLY}, {".obj", KARST_MESH_OBJ}};
    const size_t length = strlen(path);
    for (size_t i = 0; i < sizeof formats / sizeof *formats; i++)
        if (length > 4 && strcasecmp(path + length - 4, formats[i].suffix) == 0) {
            *format = formats[i].format;
            return true;
        }
    return karst_fail(error, KARST_USAGE, "%s: a mesh is a .glb (glTF 2.0), a .ply or an .obj", path);
}

/* ---- parts ---- */

static double to_srgb(float linear)
{
    const double x = (double)linear;
    return x <= 0.0031308 ? 12.92 * x : 1.055 * pow(x, 1 / 2.4) - 0.055;
}

static bool cannot_write(const writer *w, karst_error *error)
{
    return karst_fail(error, KARST_FAILED, "cannot write %s: %s", w->path, strerror(errno ? errno : EIO));
}

static bool say_vertex(writer *w, const karst_mesh_vertex *v)
{
    return fprintf(w->parts[0], "v %.9g %.9g %.9g %.4f %.4f %.4f\nvn %.7g %.7g %.7g\n", (double)v->position[0],
                   (double)v->position[1], (double)v->position[2], to_srgb(v->rgb[0]), to_srgb(v->rgb[1]),
                   to_srgb(v->rgb[2]), (double)v->normal[0], (double)v->normal[1], (double)v->normal[2]) > 0;
}

static uint8_t *put_vertex(const writer *w, const karst_mesh_vertex *v, uint8_t *to)
{
    if (w->format == KARST_MESH_GLB) {
        karst_glb_put_vertex(v, to);
        return to + KARST_GLB_VERTEX_BYTES;
    }
    for (int axis = 0; axis < 3; axis++)
        to = karst_out_put_float(to, v->position[axis]);
    for (int axis = 0; axis < 3; axis++)
        to = karst_out_put_float(to, v->normal[axis]);
    for (int i = 0; i < 3; i++)
        *to++ = (uint8_t)lrint(255 * to_srgb(v->rgb[i]));
    return to;
}

static bool write_bytes(writer *w, int part, const uint8_t *bytes, const uint8_t *end)
{
    return fwrite(bytes, 1, (size_t)(end - bytes), w->parts[part]) == (size_t)(end - bytes);
}

static bool write_vertices(void *user, const karst_mesh_vertex *vertices, size_t num, karst_error *error)
{
    writer *w = user;
    uint8_t bytes[AT_ONCE * KARST_GLB_VERTEX_BYTES], *to = bytes;
    errno = 0;
    for (size_t i = 0; i < num; i++) {
        for (int axis = 0; axis < 3; axis++) {
            const float at = vertices[i].position[axis];
            w->least[axis] = at < w->least[axis] ? at : w->least[axis];
            w->most[axis] = at > w->most[axis] ? at : w->most[axis];
        }
        if (w->format == KARST_MESH_OBJ) {
            if (!say_vertex(w, &vertices[i]))
                return cannot_write(w, error);
            continue;
        }
        to = put_vertex(w, &vertices[i], to);
        if (i + 1 == num || (i + 1) % AT_ONCE == 0) {
            if (!write_bytes(w, 0, bytes, to))
                return cannot_write(w, error);
            to = bytes;
        }
    }
    return true;
}

static bool say_triangle(writer *w, const uint32_t t[3])
{
    const unsigned long long a = t[0] + 1ull, b = t[1] + 1ull, c = t[2] + 1ull;
    return fprintf(w->parts[0], "f %llu//%llu %llu//%llu %llu//%llu\n", a, a, b, b, c, c) > 0;
}

static bool write_triangles(void *user, const uint32_t (*indices)[3], size_t num, karst_error *error)
{
    writer *w = user;
    uint8_t bytes[AT_ONCE * PLY_TRIANGLE_BYTES], *to = bytes;
    errno = 0;
    for (size_t i = 0; i < num && !w->points_only; i++) {
        if (w->format == KARST_MESH_OBJ) {
            if (!say_triangle(w, indices[i]))
                return cannot_write(w, error);
            continue;
        }
        if (w->format == KARST_MESH_PLY)
            *to++ = 3;
        for (int k = 0; k < 3; k++)
            to = karst_out_put_u32(to, indices[i][k]);
        if (i + 1 == num || (i + 1) % AT_ONCE == 0) {
            if (!write_bytes(w, 1, bytes, to))
                return cannot_write(w, error);
            to = bytes;
        }
    }
    return true;
}

static bool pass_progress(void *user, double share)
{
    writer *w = user;
    return !w->progress || w->progress(w->user, share);
}

static bool pass_end(void *user) { return pass_progress(user, 1); }

/* ---- headers ---- */

static const karst_out_style ply_style = {"comment ", "", " ", "\n"}, obj_style = {"# ", "", " ", "\n"},
                             json_style = {"", "\"", ":", ","};

static void say_ply_header(karst_out_text *text, const writer *w, const karst_world *world,
                           const karst_mesh_config *config, const karst_mesh_stats *stats)
{
    karst_out_say(text, "ply\nformat binary_little_endian 1.0\ncomment made by Karst %s\n", karst_version());
    karst_out_say_facts(text, world, config, &ply_style);
    karst_out_say(text,
                  "\ncomment axes: x right, y up, z forward (left-handed), metres from the origin\n"
                  "element vertex %llu\nproperty float x\nproperty float y\nproperty float z\nproperty float nx\n"
                  "property float ny\nproperty float nz\nproperty uchar red\nproperty uchar green\n"
                  "property uchar blue\n",
                  (unsigned long long)stats->num_vertices);
    if (!w->points_only)
        karst_out_say(text, "element face %llu\nproperty list uchar uint vertex_indices\n",
                      (unsigned long long)stats->num_triangles);
    karst_out_say(text, "end_header\n");
}

static void say_obj_header(karst_out_text *text, const karst_world *world, const karst_mesh_config *config)
{
    karst_out_say(text, "# made by Karst %s\n", karst_version());
    karst_out_say_facts(text, world, config, &obj_style);
    karst_out_say(text, "\n# axes: x right, y up, z forward (left-handed), metres from the origin\n");
}

/* Karst's axes are left-handed, glTF's are not. */
#define GLTF_MIRRORED ",\"scale\":[1,1,-1]"

/* Up to what a scene's first node has beside its name. */
static void say_gltf_start(karst_out_text *text, const karst_world *world, const karst_mesh_config *config,
                           const char *extensions)
{
    char name[128];
    karst_out_say(text, "{\"asset\":{\"version\":\"2.0\",\"generator\":\"Karst %s\",\"extras\":{", karst_version());
    karst_out_say_facts(text, world, config, &json_style);
    karst_out_say(text, "}}%s,\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"name\":\"%s\"", extensions,
                  karst_out_plain(karst_world_get_metadata(world)->name, name, sizeof name));
}

/* Of the accessors from number `first` on: those of vertices, then of triangles. */
static void say_gltf_mesh(karst_out_text *text, unsigned long long first)
{
    karst_out_say(text,
                  "{\"primitives\":[{\"attributes\":{\"POSITION\":%llu,\"NORMAL\":%llu,\"COLOR_0\":%llu},"
                  "\"indices\":%llu,\"material\":0}]}",
                  first, first + 1, first + 2, first + 3);
}

/* Behind the meshes, up to the accessors. */
static void say_gltf_material(karst_out_text *text)
{
    karst_out_say(text, "],\"materials\":[{\"pbrMetallicRoughness\":{\"metallicFactor\":0,\"roughnessFactor\":1}}],"
                        "\"accessors\":[");
}

static void say_gltf(karst_out_text *text, const writer *w, const karst_world *world, const karst_mesh_config *config,
                     const karst_mesh_stats *stats)
{
    say_gltf_start(text, world, config, "");
    if (stats->num_triangles == 0) { /* a mesh of nothing may not be said */
        karst_out_say(text, "}]}");
        return;
    }
    karst_out_say(text, GLTF_MIRRORED ",\"mesh\":0}],\"meshes\":[");
    say_gltf_mesh(text, 0);
    say_gltf_material(text);
    karst_glb_say_vertices(text, 0, stats->num_vertices, w->least, w->most);
    karst_out_say(text, ",");
    karst_glb_say_triangles(text, 0, stats->num_triangles);
    karst_out_say(text, "],");
    karst_glb_say_buffer(text, stats->num_vertices, stats->num_triangles);
    karst_out_say(text, "}");
}

static bool finish(writer *w, const karst_world *world, const karst_mesh_config *config, const karst_mesh_stats *stats,
                   karst_error *error)
{
    karst_out_text text = {.length = 0};
    int num_parts = w->points_only ? 1 : 2;
    bool done = true;
    if (w->format == KARST_MESH_PLY) {
        say_ply_header(&text, w, world, config, stats);
    } else if (w->format == KARST_MESH_OBJ) {
        say_obj_header(&text, world, config);
        num_parts = 1;
    } else {
        const bool has_binary = stats->num_triangles > 0;
        karst_glb_begin(&text);
        say_gltf(&text, w, world, config, stats);
        done = karst_glb_end(&text,
                             has_binary ? KARST_GLB_VERTEX_BYTES * stats->num_vertices +
                                              KARST_GLB_TRIANGLE_BYTES * stats->num_triangles
                                        : 0,
                             w->path, error);
        num_parts = has_binary ? 2 : 0;
    }
    done = done && (!text.is_out_of_memory || karst_fail(error, KARST_FAILED, "out of memory")) &&
           karst_out_assemble(w->path, text.bytes, text.length, w->parts, num_parts, pass_end, w, error);
    free(text.bytes);
    return done;
}

static void begin(writer *w)
{
    for (int axis = 0; axis < 3; axis++) {
        w->least[axis] = INFINITY;
        w->most[axis] = -INFINITY;
    }
}

static bool open_parts(writer *w, karst_error *error)
{
    errno = 0;
    for (int i = 0; i < 2; i++) {
        w->parts[i] = karst_out_short_part(w->path);
        if (!w->parts[i] || setvbuf(w->parts[i], NULL, _IOFBF, BUFFER_BYTES) != 0)
            return cannot_write(w, error);
    }
    return true;
}

static void close_parts(writer *w)
{
    for (int i = 0; i < 2; i++)
        if (w->parts[i])
            fclose(w->parts[i]);
}

static bool write_all(writer *w, const karst_world *world, const karst_mesh_config *config, karst_mesh_stats *stats,
                      karst_error *error)
{
    karst_mesh_stats found;
    const karst_mesh_sink sink = {
        .vertices = write_vertices, .triangles = write_triangles, .progress = pass_progress, .user = w};
    begin(w);
    const bool done = open_parts(w, error) && karst_mesh_find(world, config, &sink, &found, error) &&
                      finish(w, world, config, &found, error);
    close_parts(w);
    if (done && stats)
        *stats = found;
    return done;
}

bool karst_mesh_write(const karst_world *world, const karst_mesh_config *config, const char *path,
                      karst_mesh_format format, bool (*progress)(void *user, double share), void *user,
                      karst_mesh_stats *stats, karst_error *error)
{
    writer w = {.format = format, .path = path, .progress = progress, .user = user};
    return (format != KARST_MESH_OF_SUFFIX || karst_mesh_format_of(path, &w.format, error)) &&
           write_all(&w, world, config, stats, error);
}

bool karst_mesh_write_points(const karst_world *world, const karst_mesh_config *config, const char *path,
                             bool (*progress)(void *user, double share), void *user, karst_mesh_stats *stats,
                             karst_error *error)
{
    writer w = {.path = path, .progress = progress, .user = user, .points_only = true};
    if (!karst_mesh_format_of(path, &w.format, NULL) || w.format != KARST_MESH_PLY)
        return karst_fail(error, KARST_USAGE, "%s: points are a .ply", path);
    return write_all(&w, world, config, stats, error);
}

/* ---- levels ---- */

/* What the JSON says of a chunk, once all are known. */
typedef struct {
    int64_t at[3];
    uint64_t first_vertex, first_triangle[KARST_MESH_MAX_LEVELS];
    uint32_t num_vertices[KARST_MESH_MAX_LEVELS], num_triangles[KARST_MESH_MAX_LEVELS];
    float least[KARST_MESH_MAX_LEVELS][3], most[KARST_MESH_MAX_LEVELS][3];
    double moved_m[KARST_MESH_MAX_LEVELS];
} written_chunk;

typedef struct {
    writer w; /* first: so it has the level writer's address, for pass_progress */
    int num_levels;
    written_chunk *chunks;
    size_t num_chunks, max_chunks;
    uint64_t num_vertices, num_triangles;
} level_writer;

static bool keep_chunk(level_writer *l, const karst_mesh_chunk *chunk)
{
    if (l->num_chunks == l->max_chunks) {
        const size_t more = l->max_chunks ? 2 * l->max_chunks : 16;
        written_chunk *larger = realloc(l->chunks, more * sizeof *larger);
        if (!larger)
            return false;
        l->chunks = larger;
        l->max_chunks = more;
    }
    written_chunk *kept = &l->chunks[l->num_chunks++];
    *kept = (written_chunk){.first_vertex = l->num_vertices};
    memcpy(kept->at, chunk->at, sizeof kept->at);
    for (int level = 0; level < l->num_levels; level++) {
        kept->num_vertices[level] = (uint32_t)chunk->num_vertices[level];
        kept->num_triangles[level] = (uint32_t)chunk->num_triangles[level];
        kept->first_triangle[level] = l->num_triangles;
        kept->moved_m[level] = chunk->moved_m[level];
        l->num_triangles += chunk->num_triangles[level];
        for (int axis = 0; axis < 3; axis++) {
            float least = INFINITY, most = -INFINITY;
            for (size_t i = 0; i < chunk->num_vertices[level]; i++) {
                least = fminf(least, chunk->vertices[i].position[axis]);
                most = fmaxf(most, chunk->vertices[i].position[axis]);
            }
            kept->least[level][axis] = least;
            kept->most[level][axis] = most;
        }
    }
    l->num_vertices += chunk->num_vertices[0];
    return true;
}

static bool write_chunk(void *user, const karst_mesh_chunk *chunk, karst_error *error)
{
    level_writer *l = user;
    if (!keep_chunk(l, chunk))
        return karst_fail(error, KARST_FAILED, "out of memory");
    bool done = write_vertices(&l->w, chunk->vertices, chunk->num_vertices[0], error);
    for (int level = 0; done && level < l->num_levels; level++)
        done = write_triangles(&l->w, chunk->triangles[level], chunk->num_triangles[level], error);
    return done;
}

static void say_nodes(karst_out_text *text, const level_writer *l, const char *name)
{
    const int levels = l->num_levels;
    for (size_t i = 0; i < l->num_chunks; i++)
        for (int level = 0; level < levels; level++) {
            const written_chunk *c = &l->chunks[i];
            const size_t number = i * (size_t)levels + (size_t)level;
            karst_out_say(text, ",{\"name\":\"%s_x%lld_y%lld_z%lld_lod%d\",\"mesh\":%zu,", name, (long long)c->at[0],
                          (long long)c->at[1], (long long)c->at[2], level, number);
            karst_out_say(text, "\"extras\":{\"moved_m\":%.6g}" GLTF_MIRRORED, c->moved_m[level]);
            for (int other = 1; level == 0 && other < levels; other++)
                karst_out_say(text, "%s%zu%s", other == 1 ? ",\"extensions\":{\"MSFT_lod\":{\"ids\":[" : ",",
                              1 + number + (size_t)other, other == levels - 1 ? "]}}" : "");
            karst_out_say(text, "}");
        }
}

static void say_levels(karst_out_text *text, const level_writer *l, const karst_world *world,
                       const karst_mesh_config *config)
{
    const size_t levels = (size_t)l->num_levels, num = l->num_chunks * levels;
    char name[128];
    say_gltf_start(text, world, config, levels > 1 && num ? ",\"extensionsUsed\":[\"MSFT_lod\"]" : "");
    if (num == 0) {
        karst_out_say(text, "}]}");
        return;
    }
    for (size_t i = 0; i < l->num_chunks; i++)
        karst_out_say(text, "%s%zu", i ? "," : ",\"children\":[", 1 + i * levels);
    karst_out_say(text, "]}");
    say_nodes(text, l, karst_out_plain(karst_world_get_metadata(world)->name, name, sizeof name));
    karst_out_say(text, "],\"meshes\":[");
    for (unsigned long long i = 0; i < num; i++) {
        karst_out_say(text, "%s", i ? "," : "");
        say_gltf_mesh(text, 4 * i);
    }
    say_gltf_material(text);
    for (size_t i = 0; i < num; i++) {
        const written_chunk *c = &l->chunks[i / levels];
        const size_t level = i % levels;
        karst_out_say(text, "%s", i ? "," : "");
        karst_glb_say_vertices(text, c->first_vertex, c->num_vertices[level], c->least[level], c->most[level]);
        karst_out_say(text, ",");
        karst_glb_say_triangles(text, c->first_triangle[level], c->num_triangles[level]);
    }
    karst_out_say(text, "],");
    karst_glb_say_buffer(text, l->num_vertices, l->num_triangles);
    karst_out_say(text, "}");
}

static bool finish_levels(level_writer *l, const karst_world *world, const karst_mesh_config *config,
                          karst_error *error)
{
    karst_out_text text = {.length = 0};
    karst_glb_begin(&text);
    say_levels(&text, l, world, config);
    const bool done =
        karst_glb_end(&text, KARST_GLB_VERTEX_BYTES * l->num_vertices + KARST_GLB_TRIANGLE_BYTES * l->num_triangles,
                      l->w.path, error) &&
        karst_out_assemble(l->w.path, text.bytes, text.length, l->w.parts, l->num_chunks ? 2 : 0, pass_end, &l->w,
                           error);
    free(text.bytes);
    return done;
}

bool karst_mesh_write_levels(const karst_world *world, const karst_mesh_config *config, int num_levels,
                             const char *path, bool (*progress)(void *user, double share), void *user,
                             karst_mesh_stats *stats, karst_mesh_level_stats *levels, karst_error *error)
{
    level_writer l = {.w = {.path = path, .progress = progress, .user = user}, .num_levels = num_levels};
    const karst_mesh_chunk_sink sink = {.chunk = write_chunk, .progress = pass_progress, .user = &l};
    if (!karst_mesh_format_of(path, &l.w.format, NULL) || l.w.format != KARST_MESH_GLB)
        return karst_fail(error, KARST_USAGE, "%s: several levels stand in a .glb", path);
    begin(&l.w);
    const bool done = open_parts(&l.w, error) &&
                      karst_mesh_find_levels(world, config, num_levels, &sink, stats, levels, error) &&
                      finish_levels(&l, world, config, error);
    close_parts(&l.w);
    free(l.chunks);
    return done;
}
