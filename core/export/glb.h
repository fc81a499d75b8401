/* Binary glTF 2.0: how its vertices look, and its chunks. */
#ifndef KARST_EXPORT_GLB_H
#define KARST_EXPORT_GLB_H

#include "core/export/out_text.h"

/* Of a vertex: position, normal, colour as four 16-bit numbers, linear. */
enum { KARST_GLB_VERTEX_BYTES = 32, KARST_GLB_NORMAL_AT = 12, KARST_GLB_COLOUR_AT = 24, KARST_GLB_TRIANGLE_BYTES = 12 };

void karst_glb_put_vertex(const karst_mesh_vertex *vertex, uint8_t bytes[KARST_GLB_VERTEX_BYTES]);

/* Room for the header, before its JSON is said. */
void karst_glb_begin(karst_out_text *text);
/* The three accessors of vertices from number `first` on, of which `num` count, within the buffer's first view. */
void karst_glb_say_vertices(karst_out_text *text, uint64_t first, uint64_t num, const float least[3],
                            const float most[3]);
/* The accessor of triangles from number `first` on, within the second. */
void karst_glb_say_triangles(karst_out_text *text, uint64_t first, uint64_t num);
/* Views and buffer: all vertices, then all triangles. */
void karst_glb_say_buffer(karst_out_text *text, uint64_t num_vertices, uint64_t num_triangles);
/* Fills the header in, for so many bytes that follow (0: no second chunk). Errors: KARST_FAILED naming the path (more
 * than a file can hold; memory). */
bool karst_glb_end(karst_out_text *text, uint64_t binary_bytes, const char *path, karst_error *error);

#endif
