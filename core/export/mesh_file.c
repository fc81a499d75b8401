/* Meshes as files: PLY, OBJ and binary glTF. */
#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "core/export/out_file.h"
#include "karst/engine.h"
#include "karst/mesh.h"

enum { HEADER_BYTES = 8192, BUFFER_BYTES = 1 << 20 };
/* Of a glTF vertex: position, normal, colour as four 16-bit numbers. */
enum { GLB_VERTEX_BYTES = 32, PLY_VERTEX_BYTES = 27, GLB_CHUNK_BYTES = 8, GLB_HEADER_BYTES = 12 };

typedef struct {
    karst_mesh_format format;
    const char *path;
    FILE *parts[2]; /* vertices, triangles; of an OBJ both are in the first */
    bool (*progress)(void *user, double share);
    void *user;
    float least[3], most[3];
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

/* Little-endian, whatever the machine. */
static uint8_t *put_u32(uint8_t *to, uint32_t value)
{
    for (int i = 0; i < 4; i++)
        *to++ = (uint8_t)(value >> 8 * i);
    return to;
}

static uint8_t *put_float(uint8_t *to, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return put_u32(to, bits);
}

static double to_srgb(float linear)
{
    const double x = (double)linear;
    return x <= 0.0031308 ? 12.92 * x : 1.055 * pow(x, 1 / 2.4) - 0.055;
}

static bool cannot_write(const writer *w, karst_error *error)
{
    return karst_fail(error, KARST_FAILED, "cannot write %s: %s", w->path, strerror(errno ? errno : EIO));
}

static bool write_vertex(writer *w, const karst_mesh_vertex *v)
{
    uint8_t bytes[GLB_VERTEX_BYTES], *to = bytes;
    if (w->format == KARST_MESH_OBJ)
        return fprintf(w->parts[0], "v %.9g %.9g %.9g %.4f %.4f %.4f\nvn %.7g %.7g %.7g\n", (double)v->position[0],
                       (double)v->position[1], (double)v->position[2], to_srgb(v->rgb[0]), to_srgb(v->rgb[1]),
                       to_srgb(v->rgb[2]), (double)v->normal[0], (double)v->normal[1], (double)v->normal[2]) > 0;
    for (int axis = 0; axis < 3; axis++)
        to = put_float(to, v->position[axis]);
    for (int axis = 0; axis < 3; axis++)
        to = put_float(to, v->normal[axis]);
    for (int i = 0; i < 3 && w->format == KARST_MESH_PLY; i++)
        *to++ = (uint8_t)lrint(255 * to_srgb(v->rgb[i]));
    for (int i = 0; i < 4 && w->format == KARST_MESH_GLB; i++) {
        const unsigned value = i < 3 ? (unsigned)lrintf(65535 * v->rgb[i]) : 65535;
        *to++ = (uint8_t)value;
        *to++ = (uint8_t)(value >> 8);
    }
    const size_t num = (size_t)(to - bytes);
    return fwrite(bytes, 1, num, w->parts[0]) == num;
}

static bool write_vertices(void *user, const karst_mesh_vertex *vertices, size_t num, karst_error *error)
{
    writer *w = user;
    errno = 0;
    for (size_t i = 0; i < num; i++) {
        for (int axis = 0; axis < 3; axis++) {
            w->least[axis] = fminf(w->least[axis], vertices[i].position[axis]);
            w->most[axis] = fmaxf(w->most[axis], vertices[i].position[axis]);
        }
        if (!write_vertex(w, &vertices[i]))
            return cannot_write(w, error);
    }
    return true;
}

static bool write_triangle(writer *w, const uint32_t t[3])
{
    uint8_t bytes[13], *to = bytes;
    if (w->format == KARST_MESH_OBJ) {
        const unsigned long long a = t[0] + 1ull, b = t[1] + 1ull, c = t[2] + 1ull;
        return fprintf(w->parts[0], "f %llu//%llu %llu//%llu %llu//%llu\n", a, a, b, b, c, c) > 0;
    }
    if (w->format == KARST_MESH_PLY)
        *to++ = 3;
    for (int i = 0; i < 3; i++)
        to = put_u32(to, t[i]);
    const size_t num = (size_t)(to - bytes);
    return fwrite(bytes, 1, num, w->parts[1]) == num;
}

static bool write_triangles(void *user, const uint32_t (*indices)[3], size_t num, karst_error *error)
{
    writer *w = user;
    errno = 0;
    for (size_t i = 0; i < num; i++)
        if (!write_triangle(w, indices[i]))
            return cannot_write(w, error);
    return true;
}

static bool pass_progress(void *user, double share)
{
    writer *w = user;
    return !w->progress || w->progress(w->user, share);
}

static bool pass_end(void *user) { return pass_progress(user, 1); }

/* ---- headers ---- */

typedef struct {
    char *text;
    size_t length, size_bytes;
} text_buffer;

static void say(text_buffer *b, const char *format, ...) __attribute__((format(printf, 2, 3)));
static void say(text_buffer *b, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    const int length = vsnprintf(b->text + b->length, b->size_bytes - b->length, format, arguments);
    va_end(arguments);
    b->length += length > 0 ? (size_t)length : 0;
    b->length = b->length < b->size_bytes ? b->length : b->size_bytes - 1;
}

/* What can stand in a comment and between quotes: control characters, quotes and what is no ASCII become '?'. */
static const char *plain(const char *text, char *copy, size_t size_bytes)
{
    size_t i = 0;
    for (; text[i] && i + 1 < size_bytes; i++)
        copy[i] = text[i] >= ' ' && text[i] < 127 && text[i] != '"' && text[i] != '\\' ? text[i] : '?';
    copy[i] = '\0';
    return copy;
}

/* "name": value pairs; `between` parts them, `quote` stands around names and texts. */
static void say_facts(text_buffer *b, const karst_world *world, const karst_mesh_config *config, const char *line,
                      const char *quote, const char *colon, const char *between)
{
    const karst_world_metadata *about = karst_world_get_metadata(world);
    char name[128], at[160];
    say(b, "%s%sworld%s%s%s%s%s%s", line, quote, quote, colon, quote, plain(about->name, name, sizeof name), quote,
        between);
    say(b, "%s%sseed%s%s%lu%s", line, quote, quote, colon, (unsigned long)about->seed, between);
    for (int axis = 0; axis < 3; axis++) {
        karst_coordinate_format(config->corner.voxel[axis], config->corner.fraction[axis], about->voxel_log2_m, at,
                                sizeof at);
        say(b, "%s%sorigin_%c_m%s%s%s%s%s%s", line, quote, "xyz"[axis], quote, colon, quote, at, quote, between);
    }
    say(b, "%s%scell_m%s%s%.17g%s", line, quote, quote, colon, config->cell_m, between);
    say(b, "%s%sfootprint_m%s%s%.17g", line, quote, quote, colon, config->footprint_m);
}

static void say_ply_header(text_buffer *b, const karst_world *world, const karst_mesh_config *config,
                           const karst_mesh_stats *stats)
{
    say(b, "ply\nformat binary_little_endian 1.0\ncomment made by Karst %s\n", karst_version());
    say_facts(b, world, config, "comment ", "", " ", "\n");
    say(b, "\ncomment axes: x right, y up, z forward (left-handed), metres from the origin\n"
           "element vertex %llu\nproperty float x\nproperty float y\nproperty float z\nproperty float nx\n"
           "property float ny\nproperty float nz\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
           "element face %llu\nproperty list uchar uint vertex_indices\nend_header\n",
        (unsigned long long)stats->num_vertices, (unsigned long long)stats->num_triangles);
}

static void say_obj_header(text_buffer *b, const karst_world *world, const karst_mesh_config *config)
{
    say(b, "# made by Karst %s\n", karst_version());
    say_facts(b, world, config, "# ", "", " ", "\n");
    say(b, "\n# axes: x right, y up, z forward (left-handed), metres from the origin\n");
}

static void say_vector(text_buffer *b, const char *name, const float v[3])
{
    say(b, "\"%s\":[%.9g,%.9g,%.9g]", name, (double)v[0], (double)v[1], (double)v[2]);
}

static void say_gltf(text_buffer *b, const writer *w, const karst_world *world, const karst_mesh_config *config,
                     const karst_mesh_stats *stats)
{
    char name[128];
    const unsigned long long vertices = stats->num_vertices, triangles = stats->num_triangles;
    say(b, "{\"asset\":{\"version\":\"2.0\",\"generator\":\"Karst %s\",\"extras\":{", karst_version());
    say_facts(b, world, config, "", "\"", ":", ",");
    say(b, "}},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"name\":\"%s\",\"scale\":[1,1,-1]",
        plain(karst_world_get_metadata(world)->name, name, sizeof name));
    if (triangles == 0) { /* a mesh of nothing may not be said */
        say(b, "}]}");
        return;
    }
    say(b, ",\"mesh\":0}],\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0,\"NORMAL\":1,\"COLOR_0\":2},"
           "\"indices\":3,\"material\":0}]}],"
           "\"materials\":[{\"pbrMetallicRoughness\":{\"metallicFactor\":0,\"roughnessFactor\":1}}],"
           "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":%llu,\"type\":\"VEC3\",",
        vertices);
    say_vector(b, "min", w->least);
    say(b, ",");
    say_vector(b, "max", w->most);
    say(b, "},{\"bufferView\":0,\"byteOffset\":12,\"componentType\":5126,\"count\":%llu,\"type\":\"VEC3\"},"
           "{\"bufferView\":0,\"byteOffset\":24,\"componentType\":5123,\"normalized\":true,\"count\":%llu,"
           "\"type\":\"VEC4\"},{\"bufferView\":1,\"componentType\":5125,\"count\":%llu,\"type\":\"SCALAR\"}],",
        vertices, vertices, 3 * triangles);
    say(b, "\"bufferViews\":[{\"buffer\":0,\"byteLength\":%llu,\"byteStride\":%d,\"target\":34962},"
           "{\"buffer\":0,\"byteOffset\":%llu,\"byteLength\":%llu,\"target\":34963}],"
           "\"buffers\":[{\"byteLength\":%llu}]}",
        GLB_VERTEX_BYTES * vertices, GLB_VERTEX_BYTES, GLB_VERTEX_BYTES * vertices, 12 * triangles,
        GLB_VERTEX_BYTES * vertices + 12 * triangles);
}

/* The header with its chunk of JSON, up to where the bytes of the second chunk begin. */
static bool say_glb_header(text_buffer *b, const writer *w, const karst_world *world, const karst_mesh_config *config,
                           const karst_mesh_stats *stats, karst_error *error)
{
    const uint64_t binary_bytes = GLB_VERTEX_BYTES * stats->num_vertices + 12 * stats->num_triangles;
    uint8_t *start = (uint8_t *)b->text;
    b->length = GLB_HEADER_BYTES + GLB_CHUNK_BYTES;
    say_gltf(b, w, world, config, stats);
    while (b->length % 4)
        say(b, " ");
    const size_t json_end = b->length;
    const bool has_binary = stats->num_triangles > 0;
    const uint64_t whole_bytes = json_end + (has_binary ? GLB_CHUNK_BYTES + binary_bytes : 0);
    if (whole_bytes > UINT32_MAX)
        return karst_fail(error, KARST_FAILED,
                          "%s would have %.1f GiB, and a .glb has at most 4: write a .ply, or several boxes", w->path,
                          (double)whole_bytes / 0x1p30);
    put_u32(put_u32(put_u32(start, 0x46546c67), 2), (uint32_t)whole_bytes);
    put_u32(put_u32(start + GLB_HEADER_BYTES, (uint32_t)(json_end - GLB_HEADER_BYTES - GLB_CHUNK_BYTES)), 0x4e4f534a);
    if (has_binary) {
        put_u32(put_u32(start + json_end, (uint32_t)binary_bytes), 0x004e4942);
        b->length += GLB_CHUNK_BYTES;
    }
    return true;
}

static bool finish(writer *w, const karst_world *world, const karst_mesh_config *config, const karst_mesh_stats *stats,
                   karst_error *error)
{
    char text[HEADER_BYTES];
    text_buffer b = {.text = text, .size_bytes = sizeof text - 64};
    int num_parts = 2;
    if (w->format == KARST_MESH_PLY) {
        say_ply_header(&b, world, config, stats);
    } else if (w->format == KARST_MESH_OBJ) {
        say_obj_header(&b, world, config);
        num_parts = 1;
    } else if (!say_glb_header(&b, w, world, config, stats, error)) {
        return false;
    } else if (stats->num_triangles == 0) {
        num_parts = 0;
    }
    return karst_out_assemble(w->path, b.text, b.length, w->parts, num_parts, pass_end, w, error);
}

bool karst_mesh_write(const karst_world *world, const karst_mesh_config *config, const char *path,
                      karst_mesh_format format, bool (*progress)(void *user, double share), void *user,
                      karst_mesh_stats *stats, karst_error *error)
{
    writer w = {.format = format, .path = path, .progress = progress, .user = user};
    karst_mesh_stats found;
    if (format == KARST_MESH_OF_SUFFIX && !karst_mesh_format_of(path, &w.format, error))
        return false;
    for (int axis = 0; axis < 3; axis++) {
        w.least[axis] = INFINITY;
        w.most[axis] = -INFINITY;
    }
    const karst_mesh_sink sink = {
        .vertices = write_vertices, .triangles = write_triangles, .progress = pass_progress, .user = &w};
    bool done = true;
    errno = 0;
    for (int i = 0; i < 2 && done; i++) {
        w.parts[i] = karst_out_part(path);
        done = w.parts[i] && setvbuf(w.parts[i], NULL, _IOFBF, BUFFER_BYTES) == 0;
    }
    if (!done)
        cannot_write(&w, error);
    done = done && karst_mesh_find(world, config, &sink, &found, error) && finish(&w, world, config, &found, error);
    for (int i = 0; i < 2; i++)
        if (w.parts[i])
            fclose(w.parts[i]);
    if (done && stats)
        *stats = found;
    return done;
}
