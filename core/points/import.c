/* Importing points: one reading of the input, then all that is done with them on disk (docs/POINTS.md). */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/points/import_internal.h"

const points_limits karst_points_usual_limits = {.most_in_memory = (uint64_t)1 << 21, /* some 180 MB */
                                                 .most_between = (uint64_t)1 << 20,
                                                 .most_resident_bytes = (uint64_t)640 << 20};

/* Steps in their order, and the files that none after them reads. */
static const struct {
    bool (*run)(points_import *import, karst_error *error);
    points_work_file drops[3];
    int num_drops;
} steps[POINTS_DONE] = {
    [POINTS_READ] = {karst_points_read_input, {0}, 0},
    [POINTS_MEASURE] = {karst_points_measure, {0}, 0},
    [POINTS_SPREAD_OUT] = {karst_points_spread, {POINTS_RAW}, 1},
    [POINTS_SORT] = {karst_points_sort, {POINTS_SPREAD, POINTS_RANGES}, 2},
    [POINTS_LOOK] = {karst_points_look_around, {0}, 0},
    [POINTS_LEAVE_OUT] = {karst_points_leave_out, {0}, 0},
    [POINTS_LOOK_AGAIN] = {karst_points_look_around, {0}, 0},
    [POINTS_TURN] = {karst_points_turn_normals, {POINTS_NEAR, POINTS_BENDS, POINTS_QUEUES}, 3},
    [POINTS_FINEST] = {karst_points_add_finest, {POINTS_TURNS, POINTS_SORTED, POINTS_KEPT}, 3},
    [POINTS_COARSER] = {karst_points_add_levels, {POINTS_COVERS, POINTS_COVERS_ODD}, 2},
};

static void drop_files(points_import *import, uint32_t step)
{
    for (int i = 0; i < steps[step].num_drops; i++)
        karst_points_drop_file(import, steps[step].drops[i]);
}

static bool run_steps(points_import *import, karst_error *error)
{
    points_progress *now = &import->now;
    for (uint32_t step = 0; step < now->step; step++) /* it may have been cut off before these went */
        drop_files(import, step);
    while (now->step < POINTS_DONE) {
        const uint32_t step = now->step;
        if (!steps[step].run(import, error))
            return false;
        now->done = 0;
        now->step++;
        if (now->step == POINTS_LOOK_AGAIN && !now->has_dropped)
            now->step++;
        if (now->step < POINTS_DONE && !karst_points_checkpoint(import, error))
            return false;
        drop_files(import, step);
    }
    return true;
}

/* The finished file takes the output's name. */
static bool finish_file(points_import *import, karst_error *error)
{
    karst_points_head *head = import->head;
    int fd = karst_points_file(import, POINTS_MODEL, error);
    if (fd < 0)
        return false;
    memcpy(head->magic, KARST_POINTS_MAGIC, sizeof head->magic);
    head->version = KARST_POINTS_VERSION;
    head->record_bytes = sizeof(karst_point);
    head->sum = karst_points_sum(0, head, offsetof(karst_points_head, sum));
    const uint64_t num_bytes = karst_points_level_end(&head->levels[head->num_levels - 1]);
    if (!karst_points_write(import, fd, head, sizeof *head, 0, error))
        return false;
    return (ftruncate(fd, (off_t)num_bytes) == 0 && fchmod(fd, 0644) == 0 && fsync(fd) == 0 &&
            karst_points_publish(import)) ||
           karst_fail(error, KARST_FAILED, "cannot write %s: %s", import->config->output, strerror(errno));
}

static bool run(points_import *import, karst_error *error)
{
    return run_steps(import, error) && finish_file(import, error);
}

bool karst_points_import_within(const karst_points_import_config *config, const points_limits *limits,
                                karst_points_about *about, karst_error *error)
{
    karst_error why = {0};
    if (!config->input || !config->output)
        return karst_fail(error, KARST_USAGE, "which file of points, and where to?");
    if (!karst_points_is_name(config->output))
        return karst_fail(error, KARST_USAGE, "%s: the name of imported points ends in .karstpoints", config->output);
    points_import *import = calloc(1, sizeof *import);
    if (!import)
        return karst_fail(error, KARST_FAILED, "out of memory");
    import->config = config;
    import->limits = *limits;
    const bool began = karst_points_begin_work(import, &why), done = began && run(import, &why);
    /* What failed for reasons that may pass is kept, if anybody may go on later. */
    if (began && (done || why.status != KARST_FAILED || !config->resumable || import->now.step == 0))
        karst_points_remove_work(import);
    if (done && about)
        karst_points_tell(import->head, about);
    karst_points_end_work(import);
    free(import);
    return done || karst_fail(error, why.status, "%s", why.message);
}

bool karst_points_import(const karst_points_import_config *config, karst_points_about *about, karst_error *error)
{
    return karst_points_import_within(config, &karst_points_usual_limits, about, error);
}
