#include "core/export/glb.h"

#include <math.h>

enum { HEADER_BYTES = 12, CHUNK_BYTES = 8 };

void karst_glb_put_vertex(const karst_mesh_vertex *vertex, uint8_t bytes[KARST_GLB_VERTEX_BYTES])
{
    uint8_t *to = bytes;
    for (int axis = 0; axis < 3; axis++)
        to = karst_out_put_float(to, vertex->position[axis]);
    for (int axis = 0; axis < 3; axis++)
        to = karst_out_put_float(to, vertex->normal[axis]);
    for (int i = 0; i < 4; i++) {
        const unsigned value = i < 3 ? (unsigned)lrintf(65535 * vertex->rgb[i]) : 65535;
        *to++ = (uint8_t)value;
        *to++ = (uint8_t)(value >> 8);
    }
}

void karst_glb_begin(karst_out_text *text) { karst_out_say(text, "%*s", HEADER_BYTES + CHUNK_BYTES, ""); }

static void say_vector(karst_out_text *text, const char *name, const float v[3])
{
    karst_out_say(text, ",\"%s\":[%.9g,%.9g,%.9g]", name, (double)v[0], (double)v[1], (double)v[2]);
}

void karst_glb_say_vertices(karst_out_text *text, uint64_t first, uint64_t num, const float least[3],
                            const float most[3])
{
    const unsigned long long start = first * KARST_GLB_VERTEX_BYTES, count = num;
    karst_out_say(text, "{\"bufferView\":0,\"byteOffset\":%llu,\"componentType\":5126,\"count\":%llu,\"type\":\"VEC3\"",
                  start, count);
    say_vector(text, "min", least);
    say_vector(text, "max", most);
    karst_out_say(text,
                  "},{\"bufferView\":0,\"byteOffset\":%llu,\"componentType\":5126,\"count\":%llu,\"type\":\"VEC3\"},"
                  "{\"bufferView\":0,\"byteOffset\":%llu,\"componentType\":5123,\"normalized\":true,\"count\":%llu,"
                  "\"type\":\"VEC4\"}",
                  start + KARST_GLB_NORMAL_AT, count, start + KARST_GLB_COLOUR_AT, count);
}

void karst_glb_say_triangles(karst_out_text *text, uint64_t first, uint64_t num)
{
    karst_out_say(text,
                  "{\"bufferView\":1,\"byteOffset\":%llu,\"componentType\":5125,\"count\":%llu,\"type\":\"SCALAR\"}",
                  (unsigned long long)first * KARST_GLB_TRIANGLE_BYTES, (unsigned long long)num * 3);
}

void karst_glb_say_buffer(karst_out_text *text, uint64_t num_vertices, uint64_t num_triangles)
{
    const unsigned long long vertices = num_vertices * KARST_GLB_VERTEX_BYTES,
                             triangles = num_triangles * KARST_GLB_TRIANGLE_BYTES;
    karst_out_say(text,
                  "\"bufferViews\":[{\"buffer\":0,\"byteLength\":%llu,\"byteStride\":%d,\"target\":34962},"
                  "{\"buffer\":0,\"byteOffset\":%llu,\"byteLength\":%llu,\"target\":34963}],"
                  "\"buffers\":[{\"byteLength\":%llu}]",
                  vertices, KARST_GLB_VERTEX_BYTES, vertices, triangles, vertices + triangles);
}

bool karst_glb_end(karst_out_text *text, uint64_t binary_bytes, const char *path, karst_error *error)
{
    while (text->length % 4)
        karst_out_say(text, " ");
    const size_t json_end = text->length;
    const uint64_t whole_bytes = json_end + (binary_bytes ? CHUNK_BYTES + binary_bytes : 0);
    if (whole_bytes > UINT32_MAX)
        return karst_fail(error, KARST_FAILED,
                          "%s would have %.1f GiB, and a .glb has at most 4: write a .ply, or several boxes", path,
                          (double)whole_bytes / 0x1p30);
    if (binary_bytes)
        karst_out_say(text, "%*s", CHUNK_BYTES, "");
    if (text->is_out_of_memory)
        return karst_fail(error, KARST_FAILED, "out of memory");
    uint8_t *start = (uint8_t *)text->bytes;
    karst_out_put_u32(karst_out_put_u32(karst_out_put_u32(start, 0x46546c67), 2), (uint32_t)whole_bytes);
    karst_out_put_u32(karst_out_put_u32(start + HEADER_BYTES, (uint32_t)(json_end - HEADER_BYTES - CHUNK_BYTES)),
                      0x4e4f534a);
    if (binary_bytes)
        karst_out_put_u32(karst_out_put_u32(start + json_end, (uint32_t)binary_bytes), 0x004e4942);
    return true;
}
