/* How a surface faces whoever looks at it: what a world's colours know of it besides its place. C and OpenCL C.
 *
 * Numbers 0 to 2 are the unit normal n. Numbers 3 to 5 are the stretch: along it a footprint lies longer on the
 * surface, by the tangent of the angle between the normal and the ray. For a ray along d it is (d - (n.d) n) / |n.d|,
 * at most KARST_MOST_STRETCH long; 0 where nobody looks. What changes by c per metre changes along the surface, over
 * a footprint of 1 m, by the length of (|n x c|, c.stretch). */
#ifndef KARST_BASE_FACING_SHARED_H
#define KARST_BASE_FACING_SHARED_H

#define KARST_FACING_FLOATS 6
#define KARST_MOST_STRETCH 64

#endif
