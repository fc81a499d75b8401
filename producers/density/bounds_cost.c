#include "producers/density/bounds_cost.h"

#include <stdio.h>

/* For each operation of a node, and each octave of noise: measured, sixteen boxes at once, with the parts of nodes that
 * are looked at. */
#define STEP_NS 35.0
#define OCTAVE_NS 600.0
/* A node then costs as much as a brick of a plain world. */
#define DEAR_NS 60e3

double karst_bounds_cost_ns(const karst_tape *tape)
{
    double ns = 0;
    for (uint32_t i = 0; i < tape->num_instructions; i++) {
        const karst_instruction *in = &tape->code[i];
        if (!(in->flags & TAPE_IS_PASSED))
            ns += in->op == TAPE_NOISE ? in->count * OCTAVE_NS : STEP_NS;
    }
    return ns;
}

void karst_bounds_cost_say(const karst_tape *tape, void (*print)(void *user, const char *line), void *user)
{
    double ns = karst_bounds_cost_ns(tape);
    char line[256];
    snprintf(line, sizeof line, "  estimated cost of bounds: %.3g us a node and core%s", ns * 1e-3,
             ns < DEAR_NS ? "" : "; a new view asks for thousands of them");
    print(user, line);
}
