/* Along a line, by proof: where the density changes its sign. */
#ifndef KARST_EXPORT_MARCH_H
#define KARST_EXPORT_MARCH_H

#include <stdbool.h>
#include <stdint.h>

#include "karst/position.h"
#include "karst/world.h"

typedef struct {
    karst_position from;
    double direction[3]; /* of length 1 */
    double length_m, within_m, footprint_m;
    double spread_m[3]; /* more than a line: a beam that is so much wider to either side along each axis */
    int voxel_log2_m;
    /* Where it stands, and the step to try next. */
    double t_m, step_m, share;
    int num_unproved; /* shortest steps in a row of which nothing could be proved */
    float density; /* there */
    bool is_solid;
    uint64_t num_steps;
} karst_march;

/* At the start of the line; the other fields are filled in. */
void karst_march_begin(karst_march *march, karst_sampler *sampler);
/* Goes on to the next change of sign, which is then at t_m, within within_m; false: there is none (t_m is the end), or
 * after max_steps steps of all it was given up (t_m is where). */
bool karst_march_next(karst_march *march, karst_sampler *sampler, uint64_t max_steps);
/* Goes on through air as far as steps of at least least_m are proved: of a beam, air in all of it. */
void karst_march_through_air(karst_march *march, karst_sampler *sampler, double least_m);
karst_position karst_march_at(const karst_march *march, double t_m);

#endif
