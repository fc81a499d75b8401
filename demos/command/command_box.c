/* Boxes of a world, cut into cells or voxels. */
#include "command.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Six decimals with commas between them. */
static bool parse_corners(const char *box, int voxel_log2_m, karst_position *low, karst_position *high,
                          karst_error *error)
{
    char *text = strdup(box), *part[6], *rest = text;
    int num_parts = 0;
    if (!text)
        return karst_fail(error, KARST_FAILED, "out of memory");
    for (char *next; num_parts < 6 && rest; rest = next) {
        next = strchr(rest, ',');
        if (next)
            *next++ = '\0';
        part[num_parts++] = rest;
    }
    karst_error why = {0};
    bool done = num_parts == 6 && !rest;
    if (!done)
        karst_fail(error, KARST_USAGE,
                   "--box %.64s: a box is X0,Y0,Z0,X1,Y1,Z1 in metres, such as 0,-100,0,500,200,500", box);
    else if (!karst_position_parse(part[0], part[1], part[2], voxel_log2_m, low, &why) ||
             !karst_position_parse(part[3], part[4], part[5], voxel_log2_m, high, &why))
        done = karst_fail(error, KARST_USAGE, "--box: %s", why.message);
    free(text);
    return done;
}

bool command_parse_box(const char *box, double cell_m, const char *cells_name, int64_t most, int voxel_log2_m,
                       karst_position *corner, int64_t num_cells[3], karst_error *error)
{
    karst_position high;
    double extent_m[3];
    if (!parse_corners(box, voxel_log2_m, corner, &high, error))
        return false;
    karst_position_difference_m(*corner, high, voxel_log2_m, extent_m);
    for (int axis = 0; axis < 3; axis++) {
        /* A box that is not a whole number of cells gets one more; one that is, but for rounding, does not. */
        const double cells = ceil(extent_m[axis] / cell_m - 1e-6);
        if (!(extent_m[axis] > 0))
            return karst_fail(error, KARST_USAGE, "--box %.64s: its upper corner is not above its lower one along %c",
                              box, "xyz"[axis]);
        if (!(cells <= (double)most))
            return karst_fail(error, KARST_USAGE,
                              "--voxel %g makes %.3g %s along %c, and %lld is the limit: try --voxel %.3g", cell_m,
                              cells, cells_name, "xyz"[axis], (long long)most, 1.01 * extent_m[axis] / (double)most);
        num_cells[axis] = cells < 1 ? 1 : (int64_t)cells;
    }
    return true;
}
