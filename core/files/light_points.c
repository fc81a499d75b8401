/* Reading points of light maps. */
#include "core/files/light_points.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "core/files/point_source.h"

#define READ_POINTS 1024
#define MOST_LIGHT 65504.0f /* as of what glows */
#define FARTHEST_M 1e21

typedef struct {
    const char *path;
    double reach_m;
    bool has_radius;
    karst_light_point *points;
    size_t num, room, most;
} loading;

static bool is_finite(const float v[3]) { return isfinite(v[0]) && isfinite(v[1]) && isfinite(v[2]); }

/* What is wrong with a point; NULL: nothing. */
static const char *flaw_of(const karst_light_point *p)
{
    for (int axis = 0; axis < 3; axis++)
        if (!(fabs(p->at_m[axis]) <= FARTHEST_M))
            return "its place is no finite number";
    const float *n = p->normal;
    if (!is_finite(n) || !(n[0] * n[0] + n[1] * n[1] + n[2] * n[2] > 0))
        return "its normal is none";
    for (int c = 0; c < 3; c++)
        if (!(p->light[c] >= 0 && p->light[c] <= MOST_LIGHT))
            return "its light is not from 0 to 65504";
    return p->radius_m > 0 && p->radius_m <= FARTHEST_M ? NULL : "its radius is not above 0";
}

static bool add(loading *l, const karst_file_point *from, karst_error *error)
{
    karst_light_point point = {.radius_m = l->has_radius ? from->more[0] : l->reach_m};
    memcpy(point.at_m, from->at, sizeof point.at_m);
    memcpy(point.normal, from->normal, sizeof point.normal);
    memcpy(point.light, from->light, sizeof point.light);
    const char *flaw = flaw_of(&point);
    if (flaw)
        return karst_fail(error, KARST_BAD_DATA, "%s: point %zu of the light map: %s", l->path, l->num + 1, flaw);
    if (l->num == l->most)
        return karst_fail(error, KARST_BAD_DATA, "%s: a light map may have %zu points, and has more", l->path, l->most);
    if (l->num == l->room) {
        const size_t room = l->room ? 2 * l->room : READ_POINTS;
        karst_light_point *points = realloc(l->points, room * sizeof *points);
        if (!points)
            return karst_fail(error, KARST_FAILED, "out of memory for the light map %s", l->path);
        l->points = points;
        l->room = room;
    }
    l->points[l->num++] = point;
    return true;
}

static bool load(loading *l, karst_point_source *source, karst_error *error)
{
    karst_file_point *read = malloc(READ_POINTS * sizeof *read);
    bool done = read != NULL || karst_fail(error, KARST_FAILED, "out of memory");
    l->has_radius = karst_point_source_has_radius(source);
    if (done && (!karst_point_source_has_normals(source) || !karst_point_source_has_colours(source)))
        done = karst_fail(error, KARST_BAD_DATA,
                          "%s: a light map's points have normals and light: nx ny nz and red green blue", l->path);
    if (done && !l->has_radius && !(l->reach_m > 0))
        done = karst_fail(error, KARST_BAD_DATA,
                          "%s: its points have no radius: say how far each counts, in metres: { \"file\": ..., "
                          "\"reach\": 0.5 }",
                          l->path);
    for (size_t num = 1; done && num > 0;) {
        done = karst_point_source_read(source, read, READ_POINTS, &num, error);
        for (size_t i = 0; done && i < num; i++)
            done = add(l, &read[i], error);
    }
    free(read);
    return done && (l->num > 0 || karst_fail(error, KARST_BAD_DATA, "%s: a light map without points", l->path));
}

karst_light_point *karst_light_points_load(const char *path, double reach_m, size_t most, size_t *num,
                                           karst_error *error)
{
    loading l = {.path = path, .reach_m = reach_m, .most = most};
    struct stat info;
    *num = 0;
    /* A pipe would wait for whoever writes it. */
    const bool is_there = stat(path, &info) == 0, is_file = is_there && S_ISREG(info.st_mode);
    FILE *file = is_file ? fopen(path, "rb") : NULL;
    if (!file) {
        karst_fail(error, KARST_BAD_DATA, "cannot read the light map %s: %s", path,
                   is_there && !is_file ? "it is no regular file" : strerror(errno));
        return NULL;
    }
    karst_point_source *source = karst_point_source_open(file, path, KARST_POINTS_PLY, error);
    const bool done = source && load(&l, source, error);
    karst_point_source_close(source);
    if (done) {
        *num = l.num;
        return l.points;
    }
    free(l.points);
    return NULL;
}
