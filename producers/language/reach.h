/* How far from the origin a world's floats tell where its surface is, measured. */
#ifndef KARST_LANGUAGE_REACH_H
#define KARST_LANGUAGE_REACH_H

#include "producers/language/language.h"

/* As far as nobody says otherwise. */
#define KARST_REACH_EXTENT_M 1e7

typedef struct {
    double reach_m;   /* six tenths of how far out, on its farthest axis, a surface was found off; infinite: none was */
    karst_expr cause; /* the node of the resolved graph whose rounding weighs most there */
} karst_reach;

/* Looks for surfaces in ever wider cubes about the origin, to the header's extent or KARST_REACH_EXTENT_M, and compares
 * the density as floats with the same in double (oracle.h): off is a surface whose floats move it, along a way through
 * it, by more than 0.006 of the voxel that a hundredth is promised of. The same places are looked at each time; how
 * many depends on the world's size, so that it takes a fraction of a second. false: a world so large that nothing was
 * looked at, or, with an error, no memory. Not while another thread uses the program's arena. */
bool karst_reach_measure(const karst_program_graph *program, karst_reach *reach, karst_error *error);

#endif
