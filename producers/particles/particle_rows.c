/* Particles of files. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "core/files/point_source.h"
#include "producers/particles/particle_internal.h"

#define CHUNK 1024u

static bool take(const char *path, uint64_t number, const karst_file_point *from, karst_particle_row *to,
                 karst_error *error)
{
    bool is_finite = true;
    for (int a = 0; a < 3; a++) {
        to->at_m[a] = from->at[a];
        to->velocity_m_s[a] = from->more[2 + a];
        is_finite = is_finite && isfinite(to->at_m[a]) && isfinite(to->velocity_m_s[a]);
    }
    to->radius_m = from->more[0];
    to->extinction = from->more[1];
    if (!is_finite)
        return karst_fail(error, KARST_BAD_DATA, "%s: particle %llu: its place and velocity are finite numbers", path,
                          (unsigned long long)number);
    if (!(to->radius_m > 0 && to->radius_m <= 1e15))
        return karst_fail(error, KARST_BAD_DATA, "%s: particle %llu: a radius of %g m: it is above 0, and at most 1e15",
                          path, (unsigned long long)number, to->radius_m);
    return (to->extinction >= 0 && to->extinction <= 1e15) ||
           karst_fail(error, KARST_BAD_DATA,
                      "%s: particle %llu: an extinction of %g per metre: it is 0 or more, and finite", path,
                      (unsigned long long)number, to->extinction);
}

static karst_particle_row *read_all(karst_point_source *source, const char *path, uint64_t *num, karst_error *error)
{
    karst_file_point *points = malloc(CHUNK * sizeof *points);
    karst_particle_row *rows = NULL;
    uint64_t room = 0;
    size_t got = 1;
    bool done = points || karst_fail(error, KARST_FAILED, "out of memory");
    for (*num = 0; done && got > 0;) {
        done = karst_point_source_read(source, points, CHUNK, &got, error);
        if (done && *num + got > KARST_MAX_PARTICLES)
            done = karst_fail(error, KARST_USAGE,
                              "%s: it has more than %u particles, which are the most: keep every n-th, with a larger "
                              "radius, or import them as points",
                              path, KARST_MAX_PARTICLES);
        if (done && *num + got > room) {
            room = 2 * (*num + got);
            karst_particle_row *more = realloc(rows, room * sizeof *rows);
            done = more ||
                   karst_fail(error, KARST_FAILED, "out of memory for %llu particles", (unsigned long long)room);
            rows = more ? more : rows;
        }
        for (size_t i = 0; done && i < got; i++)
            done = take(path, *num + i + 1, &points[i], &rows[*num + i], error);
        *num += done ? got : 0;
    }
    free(points);
    if (done && *num == 0)
        done = karst_fail(error, KARST_BAD_DATA, "%s: it has no particles", path);
    if (done)
        return rows;
    free(rows);
    return NULL;
}

karst_particle_row *karst_particle_rows_load(const char *path, uint64_t *num, karst_error *error)
{
    const char *suffix = strrchr(path, '.');
    const bool is_ply = suffix && strcasecmp(suffix, ".ply") == 0;
    if (!is_ply && !(suffix && strcasecmp(suffix, ".csv") == 0)) {
        karst_fail(error, KARST_BAD_DATA, "%s: particles are read from .csv and .ply", path);
        return NULL;
    }
    FILE *file = fopen(path, "rb");
    if (!file) {
        karst_fail(error, KARST_BAD_DATA, "%s: %s", path, strerror(errno));
        return NULL;
    }
    karst_point_source *source =
        karst_point_source_open(file, path, is_ply ? KARST_POINTS_PLY : KARST_POINTS_PARTICLES, error);
    karst_particle_row *rows = NULL;
    if (source && !karst_point_source_has_more(source))
        karst_fail(error, KARST_BAD_DATA, "%s: its vertices have no properties radius and extinction: particles do",
                   path);
    else if (source)
        rows = read_all(source, path, num, error);
    karst_point_source_close(source);
    return rows;
}
