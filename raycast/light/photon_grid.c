/* Launching the kernels that gather photons. */
#include "raycast/light/photon_grid.h"

#include <math.h>
#include <stdlib.h>

#include "raycast/light/scan.h"

#define LOCAL_SIZE 64
#define MIN_BUCKETS_LOG2 12u
#define MAX_BUCKETS_LOG2 22u

enum { COUNT, SUMS, SCAN, BEGINS, SORT, GATHER, NUM_KERNELS };
static const char *const kernel_names[NUM_KERNELS] = {"photon_grid_count",  "photon_grid_sums", "photon_grid_scan",
                                                      "photon_grid_begins", "photon_grid_sort", "photon_grid_gather"};

struct karst_photon_grid {
    karst_context *context;
    karst_program *program;
    cl_kernel kernels[NUM_KERNELS];
    uint32_t buckets_log2, num_spots, room; /* spots there are, and room for */
    karst_buffer *spots, *buckets, *begins, *block_sums, *num_in_buckets, *widths;
};

static uint32_t buckets_log2(uint32_t num_photons)
{
    uint32_t log2 = MIN_BUCKETS_LOG2;
    while (log2 < MAX_BUCKETS_LOG2 && (1u << log2) < num_photons / 2)
        log2++;
    return log2;
}

double karst_photon_grid_bytes(uint32_t num_photons)
{
    return 2.0 * sizeof(uint32_t) * (double)(1u << buckets_log2(num_photons)) +
           (double)num_photons * (KARST_PHOTON_SLOTS / 2) * sizeof(karst_photon_spot);
}

static bool make(karst_photon_grid *grid, karst_buffer **buffer, size_t num, size_t each_bytes, karst_error *error)
{
    *buffer = karst_buffer_create_blank(grid->context, "photons", num * each_bytes, error);
    return *buffer != NULL;
}

karst_photon_grid *karst_photon_grid_create(karst_context *context, uint32_t num_photons, karst_error *error)
{
    karst_photon_grid *grid = calloc(1, sizeof *grid);
    if (!grid) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    grid->context = context;
    grid->buckets_log2 = buckets_log2(num_photons);
    const size_t buckets = (size_t)1 << grid->buckets_log2;
    bool done = make(grid, &grid->buckets, buckets, sizeof(uint32_t), error) &&
                make(grid, &grid->begins, buckets, sizeof(uint32_t), error) &&
                make(grid, &grid->block_sums, buckets / KARST_PHOTON_BUCKETS, sizeof(uint32_t), error) &&
                make(grid, &grid->num_in_buckets, 1, sizeof(uint32_t), error) &&
                make(grid, &grid->widths, 1, sizeof(uint32_t), error) &&
                (grid->program = karst_program_build(context, "raycast/light/photon_grid.cl", "", NULL, 0, error));
    for (int i = 0; done && i < NUM_KERNELS; i++)
        done = (grid->kernels[i] = karst_program_kernel(grid->program, kernel_names[i], error)) != NULL;
    if (done)
        return grid;
    karst_photon_grid_destroy(grid);
    return NULL;
}

void karst_photon_grid_destroy(karst_photon_grid *grid)
{
    if (!grid)
        return;
    for (int i = 0; i < NUM_KERNELS; i++)
        if (grid->kernels[i])
            clReleaseKernel(grid->kernels[i]);
    karst_program_destroy(grid->program);
    karst_buffer_destroy(grid->spots);
    karst_buffer_destroy(grid->buckets);
    karst_buffer_destroy(grid->begins);
    karst_buffer_destroy(grid->block_sums);
    karst_buffer_destroy(grid->num_in_buckets);
    karst_buffer_destroy(grid->widths);
    free(grid);
}

static bool launch(const karst_photon_grid *grid, int kernel, size_t items, karst_error *error)
{
    return karst_launch(grid->context, grid->kernels[kernel], KARST_STAGE_SHADE,
                        (items + LOCAL_SIZE - 1) / LOCAL_SIZE * LOCAL_SIZE, LOCAL_SIZE, error);
}

/* An eighth more than there are, so that the next batches fit, too. */
static bool make_room(karst_photon_grid *grid, uint32_t num, karst_error *error)
{
    if (num <= grid->room)
        return true;
    karst_buffer_destroy(grid->spots);
    grid->spots = NULL;
    grid->room = 0;
    const uint32_t room = num + num / 8;
    if (!make(grid, &grid->spots, room, sizeof(karst_photon_spot), error))
        return false;
    grid->room = room;
    return true;
}

bool karst_photon_grid_fill(karst_photon_grid *grid, const karst_photon_grid_task *given, const karst_buffer *photons,
                            const karst_buffer *cells, const karst_buffer *lamps, karst_error *error)
{
    const uint32_t blocks = (1u << grid->buckets_log2) / KARST_PHOTON_BUCKETS;
    karst_photon_grid_task task = *given;
    task.mask = (1u << grid->buckets_log2) - 1;
    grid->num_spots = 0;
    uint32_t num = 0;
    if (!task.num_records || !task.num_cells)
        return true;
    const bool counted =
        karst_buffer_fill(grid->buckets, 0, 0, grid->buckets->size_bytes, error) &&
        karst_buffer_fill(grid->widths, 0, 0, sizeof(uint32_t), error) &&
        KARST_ARGUMENTS(grid->kernels[COUNT], error, KARST_VALUE_ARG(task), KARST_BUFFER_ARG(photons),
                        KARST_BUFFER_ARG(cells), KARST_BUFFER_ARG(lamps), KARST_BUFFER_ARG(grid->buckets),
                        KARST_BUFFER_ARG(grid->widths)) &&
        launch(grid, COUNT, task.num_records, error) &&
        KARST_ARGUMENTS(grid->kernels[SUMS], error, KARST_BUFFER_ARG(grid->buckets),
                        KARST_BUFFER_ARG(grid->block_sums), KARST_VALUE_ARG(blocks)) &&
        launch(grid, SUMS, blocks, error) &&
        KARST_ARGUMENTS(grid->kernels[SCAN], error, KARST_BUFFER_ARG(grid->block_sums), KARST_VALUE_ARG(blocks),
                        KARST_BUFFER_ARG(grid->num_in_buckets)) &&
        karst_launch_scan(grid->context, grid->kernels[SCAN], error) &&
        KARST_ARGUMENTS(grid->kernels[BEGINS], error, KARST_BUFFER_ARG(grid->buckets),
                        KARST_BUFFER_ARG(grid->block_sums), KARST_BUFFER_ARG(grid->begins), KARST_VALUE_ARG(blocks)) &&
        launch(grid, BEGINS, blocks, error) &&
        karst_buffer_read(grid->num_in_buckets, 0, &num, sizeof num, error);
    if (!counted || !num)
        return counted;
    if (!make_room(grid, num, error) ||
        !KARST_ARGUMENTS(grid->kernels[SORT], error, KARST_VALUE_ARG(task), KARST_BUFFER_ARG(photons),
                         KARST_BUFFER_ARG(cells), KARST_BUFFER_ARG(lamps), KARST_BUFFER_ARG(grid->buckets),
                         KARST_BUFFER_ARG(grid->begins), KARST_BUFFER_ARG(grid->spots)) ||
        !launch(grid, SORT, task.num_records, error))
        return false;
    grid->num_spots = num;
    return true;
}

bool karst_photon_grid_gather(karst_photon_grid *grid, const karst_photon_grid_task *given, const karst_buffer *rays,
                              const karst_buffer *count, uint32_t max_rays, const karst_pinhole *pinhole,
                              karst_buffer *parts, karst_error *error)
{
    const int width_px = pinhole->width_px, height_px = pinhole->height_px;
    karst_photon_grid_task task = *given;
    task.mask = (1u << grid->buckets_log2) - 1;
    if (!grid->num_spots)
        return true;
    return KARST_ARGUMENTS(grid->kernels[GATHER], error, KARST_VALUE_ARG(task), KARST_BUFFER_ARG(rays),
                           KARST_BUFFER_ARG(count), KARST_BUFFER_ARG(grid->spots), KARST_BUFFER_ARG(grid->buckets),
                           KARST_BUFFER_ARG(grid->begins), KARST_BUFFER_ARG(grid->widths), KARST_VALUE_ARG(width_px),
                           KARST_VALUE_ARG(height_px), KARST_BUFFER_ARG(parts)) &&
           launch(grid, GATHER, max_rays, error);
}
