/* Where planes meet: the vertex of a piece of surface. */
#ifndef KARST_EXPORT_FEATURE_H
#define KARST_EXPORT_FEATURE_H

#include <stdbool.h>

/* The planes through `points` with `normals` of length 1 (0: there is none, the point counts all the same), 1 to 12 of
 * them. */
typedef struct {
    double middle[3];      /* of the points */
    double mean_normal[3]; /* of length 1; 0: there is none */
    double moves[3][3];    /* from the middle to where the planes meet, first what they say most of */
    int num_moves;         /* 1 for a plane, 2 for an edge, 3 for a corner; 0: no normals */
    bool is_bent;          /* as along a sharp edge */
} karst_feature;

void karst_find_feature(const double (*points)[3], const double (*normals)[3], int num, karst_feature *feature);
/* The place that lies nearest to all planes, and else to the middle, by the first num_moves moves. */
void karst_feature_place(const karst_feature *feature, int num_moves, double place[3]);

#endif
