/* Launching the kernels of photons, and what is decided between them. */
#include "raycast/light/photons.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define LOCAL_SIZE 64
#define NUM_PROBES (KARST_PHOTON_CELLS * KARST_PHOTON_PROBES)
/* Generations that are enqueued before it is looked whether any photons are left. */
#define BLIND_BOUNCES 3u
#define MIN_BUCKETS_LOG2 12u
#define MAX_BUCKETS_LOG2 22u
/* Rings of a sun's disc grow by exp(RING_GROWTH / rows) each. */
#define RING_GROWTH 7.0
/* Photons that a kernel holds where light is as dense as lamps send it: so many of a million, and more the more there
 * are, as its root: noise and blur fall together. */
#define KERNEL_PHOTONS 40.0
/* The largest energy of a photon in quanta, and what a usual one adds to what is gathered. */
#define MOST_QUANTA_LOG2 30
#define GATHERED_LOG2 24

enum {
    SEND,
    TURN,
    LOOK,
    MEET,
    COUNT,
    SCAN,
    PACK,
    SUM,
    TAG,
    BLOCK_SUMS,
    BEGINS,
    SORT,
    GATHER,
    NUM_KERNELS
};
static const char *const kernel_names[NUM_KERNELS] = {
    "photons_send", "photons_turn", "photons_look",       "photons_meet",   "photons_count", "photons_scan",
    "photons_pack", "photons_sum",  "photons_tag",        "photons_block_sums", "photons_begins", "photons_sort",
    "photons_gather"};

struct karst_photons {
    karst_context *context;
    karst_program *program;
    cl_kernel kernels[NUM_KERNELS];
    uint32_t num_photons, num_batches, batch_rays; /* the last batch may have fewer */
    uint32_t room, buckets_log2;                   /* rays of the streams */
    uint32_t num_lamps, num_cells, num_sorted;     /* the last: batches that are gathered */
    karst_photon_lamp lamps[KARST_MOST_LAMPS];
    double quantum; /* quanta in a unit of flux; a power of two, as `scale` is */
    float reach, scale;
    uint64_t (*sums)[KARST_PHOTON_SUMS]; /* of each batch */
    karst_buffer *lamp_buffer, *cells, *table, *seen, *sum_buffer;
    karst_buffer *rays, *next, *to_lamps, *ways, *next_ways, *hits, *over_hits, *matter, *fates, *counts, *total[2];
    karst_buffer *photons, *sorted, *buckets, *begins, *block_sums, *num_in_buckets, *no_lamps;
};

/* ---- making them ---- */

static uint32_t buckets_log2(uint32_t num_photons)
{
    uint32_t log2 = MIN_BUCKETS_LOG2;
    while (log2 < MAX_BUCKETS_LOG2 && (1u << log2) < num_photons / 2)
        log2++;
    return log2;
}

static uint32_t whole_blocks(uint32_t num)
{
    const uint32_t block = KARST_PACKET_RAYS * KARST_BEAM_PACKETS;
    return (num + block - 1) / block * block;
}

#define RAY_BYTES \
    (3 * sizeof(karst_ray) + 2 * sizeof(karst_clear_way) + 2 * sizeof(karst_hit) + sizeof(karst_photon_fate) + \
     (KARST_CLEAR_MATTER_PLANES + 2) * sizeof(float))

double karst_photons_bytes(uint32_t num_photons, double *largest_bytes)
{
    const double photons = (double)num_photons * sizeof(karst_photon), streams = (double)NUM_PROBES * RAY_BYTES;
    *largest_bytes = fmax(photons, (double)NUM_PROBES * sizeof(karst_ray));
    return 2 * photons + streams + 2.0 * sizeof(uint32_t) * (double)(1u << buckets_log2(num_photons));
}

static bool make(karst_photons *photons, karst_buffer **buffer, size_t num, size_t each_bytes, karst_error *error)
{
    *buffer = karst_buffer_create_blank(photons->context, "photons", num * each_bytes, error);
    return *buffer != NULL;
}

static bool make_streams(karst_photons *p, karst_error *error)
{
    const size_t room = p->room, cells = (size_t)KARST_MOST_LAMPS * KARST_PHOTON_CELLS;
    return make(p, &p->rays, room, sizeof(karst_ray), error) && make(p, &p->next, room, sizeof(karst_ray), error) &&
           make(p, &p->to_lamps, room, sizeof(karst_ray), error) &&
           make(p, &p->ways, room, sizeof(karst_clear_way), error) &&
           make(p, &p->next_ways, room, sizeof(karst_clear_way), error) &&
           make(p, &p->hits, room, sizeof(karst_hit), error) &&
           make(p, &p->over_hits, room, sizeof(karst_hit), error) &&
           make(p, &p->matter, room, KARST_CLEAR_MATTER_PLANES * sizeof(float), error) &&
           make(p, &p->fates, room, sizeof(karst_photon_fate), error) &&
           make(p, &p->seen, NUM_PROBES, 2 * sizeof(float), error) &&
           make(p, &p->counts, room / KARST_PHOTON_BLOCK, sizeof(uint32_t), error) &&
           make(p, &p->sum_buffer, room / KARST_PHOTON_SUM_RAYS, sizeof p->sums[0], error) &&
           make(p, &p->total[0], 1, sizeof(uint32_t), error) && make(p, &p->total[1], 1, sizeof(uint32_t), error) &&
           make(p, &p->lamp_buffer, KARST_MOST_LAMPS, sizeof(karst_photon_lamp), error) &&
           make(p, &p->no_lamps, KARST_MOST_LAMPS, sizeof(karst_lamp), error) &&
           make(p, &p->cells, cells, sizeof(karst_photon_cell), error) &&
           make(p, &p->table, 3 * KARST_PHOTON_ROWS + 4, sizeof(float), error);
}

static bool make_grid(karst_photons *p, karst_error *error)
{
    const size_t buckets = (size_t)1 << p->buckets_log2, all = (size_t)p->num_batches * p->batch_rays;
    return make(p, &p->photons, all, sizeof(karst_photon), error) &&
           make(p, &p->sorted, all, sizeof(karst_photon), error) &&
           make(p, &p->buckets, buckets, sizeof(uint32_t), error) &&
           make(p, &p->begins, buckets, sizeof(uint32_t), error) &&
           make(p, &p->block_sums, buckets / KARST_PHOTON_BLOCK, sizeof(uint32_t), error) &&
           make(p, &p->num_in_buckets, 1, sizeof(uint32_t), error);
}

karst_photons *karst_photons_create(karst_context *context, uint32_t num_photons, uint32_t max_rays,
                                    karst_error *error)
{
    karst_photons *p = calloc(1, sizeof *p);
    if (!p) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    p->context = context;
    p->num_photons = num_photons;
    p->num_batches = (num_photons - 1) / max_rays + 1;
    p->batch_rays = (num_photons - 1) / p->num_batches + 1;
    p->room = whole_blocks(p->batch_rays > NUM_PROBES ? p->batch_rays : NUM_PROBES);
    p->buckets_log2 = buckets_log2(num_photons);
    p->sums = calloc(p->num_batches, sizeof *p->sums);
    bool done = p->sums || karst_fail(error, KARST_FAILED, "out of memory");
    done = done && make_streams(p, error) && make_grid(p, error) &&
           (p->program = karst_program_build(context, "raycast/light/photons.cl", "", NULL, 0, error));
    for (int i = 0; done && i < NUM_KERNELS; i++)
        done = (p->kernels[i] = karst_program_kernel(p->program, kernel_names[i], error)) != NULL;
    if (done)
        return p;
    karst_photons_destroy(p);
    return NULL;
}

void karst_photons_destroy(karst_photons *p)
{
    if (!p)
        return;
    karst_buffer *const buffers[] = {p->lamp_buffer, p->cells,     p->table,  p->seen,   p->sum_buffer,
                                     p->rays,        p->next,      p->to_lamps, p->ways, p->next_ways,
                                     p->hits,        p->over_hits, p->matter, p->fates,  p->counts,
                                     p->total[0],    p->total[1],  p->photons, p->sorted, p->buckets,
                                     p->begins,      p->block_sums, p->num_in_buckets, p->no_lamps};
    for (int i = 0; i < NUM_KERNELS; i++)
        if (p->kernels[i])
            clReleaseKernel(p->kernels[i]);
    karst_program_destroy(p->program);
    for (size_t i = 0; i < sizeof buffers / sizeof *buffers; i++)
        karst_buffer_destroy(buffers[i]);
    free(p->sums);
    free(p);
}

uint32_t karst_photons_num_batches(const karst_photons *p) { return p->num_batches; }

uint32_t karst_photons_in_batches(const karst_photons *p, uint32_t num_batches)
{
    uint32_t num = 0;
    for (uint32_t batch = 0; batch < num_batches && batch < p->num_photons; batch++)
        num += (p->num_photons - batch - 1) / p->num_batches + 1;
    return num;
}

bool karst_photons_miss_all(const karst_photons *p) { return p->num_cells == 0; }

static bool launch(const karst_photons *p, int kernel, size_t items, karst_error *error)
{
    return karst_launch(p->context, p->kernels[kernel], KARST_STAGE_SHADE,
                        (items + LOCAL_SIZE - 1) / LOCAL_SIZE * LOCAL_SIZE, LOCAL_SIZE, error);
}

/* ---- streams ---- */

static karst_photon_task task_of(const karst_photons *p, const karst_photon_scene *scene)
{
    return (karst_photon_task){.num_batches = 1,
                               .num_photons = p->num_photons,
                               .num_cells = p->num_cells,
                               .is_sure = scene->view->ends_at_missing,
                               .has_clear = scene->clear != NULL,
                               .detail = scene->view->detail,
                               .voxel_m = (float)scene->voxel_m,
                               .t_max = scene->pinhole->t_max,
                               .pixel_cone = scene->pinhole->cone,
                               .quantum = (float)p->quantum,
                               .reach = p->reach};
}

static bool send(karst_photons *p, const karst_photon_task *task, size_t num, karst_error *error)
{
    return KARST_ARGUMENTS(p->kernels[SEND], error, KARST_VALUE_ARG(*task), KARST_BUFFER_ARG(p->lamp_buffer),
                           KARST_BUFFER_ARG(p->cells), KARST_BUFFER_ARG(p->table), KARST_BUFFER_ARG(p->rays),
                           KARST_BUFFER_ARG(p->ways), KARST_BUFFER_ARG(p->fates), KARST_BUFFER_ARG(p->total[0])) &&
           launch(p, SEND, num, error);
}

static bool turn(karst_photons *p, const karst_buffer *count, uint32_t num, karst_error *error)
{
    return KARST_ARGUMENTS(p->kernels[TURN], error, KARST_BUFFER_ARG(p->rays), KARST_BUFFER_ARG(p->ways),
                           KARST_BUFFER_ARG(count)) &&
           launch(p, TURN, num, error);
}

/* Casts the stream into both kinds of matter, and finds what is there; `next` gets the rays that land has leave it. */
static bool cast(karst_photons *p, const karst_photon_scene *scene, const karst_photon_task *task,
                 const karst_buffer *count, uint32_t num, karst_error *error)
{
    /* Chance is the photon's, whatever part of a picture is drawn. */
    karst_pinhole pinhole = *scene->pinhole;
    pinhole.x0_px = pinhole.y0_px = 0;
    const karst_path_task of_land = {.sample = 1,
                                     .turn = task->generation,
                                     .mirrors = scene->mirrors,
                                     .again = 1,
                                     .mirrors_all = task->is_probe};
    const karst_path_streams streams = {.rays = p->rays,
                                        .count = count,
                                        .hits = p->hits,
                                        .lamps = p->no_lamps,
                                        .max_rays = num,
                                        .next = p->next,
                                        .to_lamps = p->to_lamps};
    karst_profile_set_stream(p->context, KARST_STREAM_CLEAR);
    bool done = karst_cast_stream(scene->land, scene->view, p->rays, num, count, p->hits, error) &&
                (!scene->land_refiner || karst_refine_rays(scene->land_refiner, p->rays, count, num, &scene->anchor,
                                                           true, p->hits, error)) &&
                karst_shade_paths(scene->shader, scene->view, &pinhole, scene->light, &of_land, &streams,
                                  scene->parts, scene->counters, error);
    if (done && scene->clear)
        done = turn(p, count, num, error) &&
               karst_cast_stream(scene->clear, scene->view, p->rays, num, count, p->over_hits, error) &&
               (!scene->clear_refiner || karst_refine_rays(scene->clear_refiner, p->rays, count, num, &scene->anchor,
                                                           true, p->over_hits, error)) &&
               turn(p, count, num, error) &&
               karst_clear_find_matter(scene->clear_shader, scene->view, p->rays, count, p->ways, num, p->over_hits,
                                       p->matter, p->room, error);
    karst_profile_set_stream(p->context, KARST_NUM_STREAMS);
    return done;
}

static bool meet(karst_photons *p, const karst_photon_task *task, const karst_buffer *count, uint32_t num,
                 karst_buffer *into, size_t first, karst_error *error)
{
    const cl_mem mem = into ? into->mem : NULL;
    const uint32_t begin = (uint32_t)first;
    return KARST_ARGUMENTS(p->kernels[MEET], error, KARST_VALUE_ARG(*task), KARST_BUFFER_ARG(p->rays),
                           KARST_BUFFER_ARG(p->ways), KARST_BUFFER_ARG(count), KARST_BUFFER_ARG(p->hits),
                           KARST_BUFFER_ARG(p->over_hits), KARST_BUFFER_ARG(p->matter), KARST_VALUE_ARG(p->room),
                           KARST_BUFFER_ARG(p->next), KARST_BUFFER_ARG(p->next_ways), KARST_BUFFER_ARG(p->fates),
                           KARST_VALUE_ARG(mem), KARST_VALUE_ARG(begin)) &&
           launch(p, MEET, num, error);
}

static bool pack(karst_photons *p, const karst_buffer *count, const karst_buffer *next_count, uint32_t num,
                 karst_error *error)
{
    const uint32_t blocks = (num + KARST_PHOTON_BLOCK - 1) / KARST_PHOTON_BLOCK;
    return KARST_ARGUMENTS(p->kernels[COUNT], error, KARST_BUFFER_ARG(p->next), KARST_BUFFER_ARG(count),
                           KARST_BUFFER_ARG(p->counts), KARST_VALUE_ARG(blocks)) &&
           launch(p, COUNT, blocks, error) &&
           KARST_ARGUMENTS(p->kernels[SCAN], error, KARST_BUFFER_ARG(p->counts), KARST_VALUE_ARG(blocks),
                           KARST_BUFFER_ARG(next_count)) &&
           karst_launch(p->context, p->kernels[SCAN], KARST_STAGE_SHADE, 1, 1, error) &&
           KARST_ARGUMENTS(p->kernels[PACK], error, KARST_BUFFER_ARG(p->next), KARST_BUFFER_ARG(p->next_ways),
                           KARST_BUFFER_ARG(count), KARST_BUFFER_ARG(p->counts), KARST_VALUE_ARG(blocks),
                           KARST_BUFFER_ARG(p->rays), KARST_BUFFER_ARG(p->ways)) &&
           launch(p, PACK, blocks, error);
}

/* ---- aiming ---- */

/* Radii of a sun's rings, directions around, and the angle between two. */
static bool write_table(karst_photons *p, float t_max, karst_error *error)
{
    float table[3 * KARST_PHOTON_ROWS + 4];
    for (uint32_t i = 0; i <= KARST_PHOTON_ROWS; i++) {
        const double share = (double)i / KARST_PHOTON_ROWS, angle = 2 * M_PI * share;
        table[i] = (float)(t_max * expm1(RING_GROWTH * share) / expm1(RING_GROWTH));
        table[KARST_PHOTON_ROWS + 1 + 2 * i] = (float)cos(angle);
        table[KARST_PHOTON_ROWS + 2 + 2 * i] = (float)sin(angle);
    }
    table[3 * KARST_PHOTON_ROWS + 3] = (float)(2 * M_PI / KARST_PHOTON_ROWS);
    return karst_buffer_write(p->table, 0, table, sizeof table, error);
}

/* A cell's area across a sun's light, or its solid angle. */
static double measure_of(const karst_photon_lamp *lamp, float t_max, uint32_t cell)
{
    const double row = cell / KARST_PHOTON_ROWS, rows = KARST_PHOTON_ROWS, angle = 2 * M_PI / rows;
    if (lamp->kind != KARST_LAMP_SUN)
        return (1 - (double)lamp->least_cosine) / rows * angle;
    const double inner = t_max * expm1(RING_GROWTH * row / rows) / expm1(RING_GROWTH),
                 outer = t_max * expm1(RING_GROWTH * (row + 1) / rows) / expm1(RING_GROWTH);
    return 0.5 * (outer - inner) * (outer + inner) * sin(angle);
}

/* What is known of a cell once its probes and those around it have looked. */
typedef struct {
    double distance, area; /* from the eye; across the light, where it is met; 0: nothing there turns photons */
} looked;

static looked look_around(const float (*seen)[2], const karst_photon_lamp *lamp, uint32_t cell, double measure)
{
    const int rows = (int)KARST_PHOTON_ROWS, row = (int)cell / rows, column = (int)cell % rows;
    looked best = {0, 0};
    for (int r = row - 1; r <= row + 1; r++)
        for (int c = column - 1; c <= column + 1; c++) {
            if (r < 0 || r >= rows)
                continue;
            const int other = r * rows + (c + rows) % rows;
            for (uint32_t i = 0; i < KARST_PHOTON_PROBES; i++) {
                const float *probe = seen[(uint32_t)other * KARST_PHOTON_PROBES + i];
                if (!(probe[0] > 0) || (best.distance > 0 && probe[0] >= best.distance))
                    continue;
                const double t = probe[1];
                best.distance = probe[0];
                best.area = lamp->kind == KARST_LAMP_SUN ? measure : measure * t * t;
            }
        }
    return best;
}

/* Photons of each cell, from what each is worth. */
static bool share_out(karst_photons *p, karst_photon_cell *cells, const double *worth, uint32_t num,
                      karst_error *error)
{
    double sum = 0, before = 0, most = 0;
    uint32_t kept = 0;
    for (uint32_t i = 0; i < num; i++)
        sum += worth[i];
    for (uint32_t i = 0; i < num; i++) {
        const uint32_t first = (uint32_t)fmin(p->num_photons, floor(p->num_photons * (before / sum) + 0.5));
        before += worth[i];
        const uint32_t end = (uint32_t)fmin(p->num_photons, floor(p->num_photons * (before / sum) + 0.5));
        if (end == first)
            continue;
        /* On average it has so many, whatever rounding gives it. */
        cells[i].share = (float)((double)cells[i].share * sum / (worth[i] * p->num_photons));
        cells[i].first = first;
        const karst_photon_lamp *lamp = &p->lamps[cells[i].cell >> 16];
        most = fmax(most, (double)cells[i].share * fmax(lamp->colour[0], fmax(lamp->colour[1], lamp->colour[2])));
        cells[kept++] = cells[i];
    }
    p->num_cells = kept;
    if (!kept)
        return true;
    p->quantum = ldexp(1, MOST_QUANTA_LOG2 - 1 - ilogb(1.01 * most));
    return karst_buffer_write(p->cells, 0, cells, kept * sizeof *cells, error);
}

static bool probe(karst_photons *p, const karst_photon_scene *scene, uint32_t lamp, float (*seen)[2],
                  karst_error *error)
{
    karst_photon_task task = task_of(p, scene);
    const karst_buffer *count = p->total[0];
    task.num_photons = NUM_PROBES;
    task.lamp = lamp;
    task.is_probe = 1;
    return send(p, &task, NUM_PROBES, error) && cast(p, scene, &task, count, NUM_PROBES, error) &&
           KARST_ARGUMENTS(p->kernels[LOOK], error, KARST_VALUE_ARG(task), KARST_BUFFER_ARG(p->rays),
                           KARST_BUFFER_ARG(count), KARST_BUFFER_ARG(p->hits), KARST_BUFFER_ARG(p->over_hits),
                           KARST_BUFFER_ARG(p->next), KARST_BUFFER_ARG(p->seen)) &&
           launch(p, LOOK, NUM_PROBES, error) &&
           karst_buffer_read(p->seen, 0, seen, NUM_PROBES * sizeof *seen, error);
}

bool karst_photons_aim(karst_photons *p, const karst_photon_scene *scene, const karst_photon_lamp *lamps,
                       uint32_t num_lamps, karst_error *error)
{
    if (num_lamps > KARST_MOST_LAMPS)
        return karst_fail(error, KARST_FAILED, "%u lamps: %d is the limit", num_lamps, KARST_MOST_LAMPS);
    const uint32_t most = (num_lamps ? num_lamps : 1) * KARST_PHOTON_CELLS;
    const float t_max = scene->pinhole->t_max;
    karst_photon_cell *cells = malloc(most * sizeof *cells);
    double *worth = malloc(most * sizeof *worth);
    float(*seen)[2] = malloc(NUM_PROBES * sizeof *seen);
    uint32_t num = 0;
    double angle = 0, energy = 0;
    p->num_cells = p->num_sorted = 0;
    p->num_lamps = num_lamps;
    memset(p->sums, 0, p->num_batches * sizeof *p->sums);
    if (num_lamps)
        memcpy(p->lamps, lamps, num_lamps * sizeof *lamps);
    bool done = (cells && worth && seen) || karst_fail(error, KARST_FAILED, "out of memory");
    done = done && (!num_lamps || karst_buffer_write(p->lamp_buffer, 0, lamps, num_lamps * sizeof *lamps, error)) &&
           write_table(p, t_max, error);
    for (uint32_t l = 0; done && l < num_lamps; l++) {
        const double bright = fmax(lamps[l].colour[0], fmax(lamps[l].colour[1], lamps[l].colour[2]));
        if (!(bright > 0))
            continue;
        done = probe(p, scene, l, seen, error);
        for (uint32_t cell = 0; done && cell < KARST_PHOTON_CELLS; cell++) {
            const double measure = measure_of(&lamps[l], t_max, cell);
            const looked at = look_around((const float(*)[2])seen, &lamps[l], cell, measure);
            if (!(at.distance > 0))
                continue;
            const double far = fmax(at.distance, 1);
            worth[num] = bright * measure / (far * far);
            cells[num] = (karst_photon_cell){.cell = cell | l << 16, .share = (float)measure, .distance = (float)far};
            angle += at.area / (far * far);
            energy += worth[num];
            num++;
        }
    }
    if (done && num) {
        /* So wide that a disc of that radius, where light is as dense as lamps send it, holds as many as are wished. */
        const double wished = KERNEL_PHOTONS * sqrt(p->num_photons / 1e6);
        p->reach = (float)fmax(sqrt(wished * angle / (M_PI * p->num_photons)), scene->pinhole->cone);
        done = share_out(p, cells, worth, num, error);
        /* What a usual photon adds: its power over the square of its distance is the same everywhere. */
        const double usual = energy / p->num_photons * 2 / (M_PI * (double)p->reach * (double)p->reach);
        p->scale = (float)ldexp(1, GATHERED_LOG2 - ilogb(usual));
    }
    free(cells);
    free(worth);
    free(seen);
    return done;
}

/* ---- tracing ---- */

static bool add_sums(karst_photons *p, uint32_t batch, uint32_t num, karst_error *error)
{
    const uint32_t items = (num + KARST_PHOTON_SUM_RAYS - 1) / KARST_PHOTON_SUM_RAYS;
    uint64_t(*parts)[KARST_PHOTON_SUMS] = malloc(items * sizeof *parts);
    if (!parts)
        return karst_fail(error, KARST_FAILED, "out of memory");
    const bool done = KARST_ARGUMENTS(p->kernels[SUM], error, KARST_BUFFER_ARG(p->fates), KARST_VALUE_ARG(num),
                                      KARST_BUFFER_ARG(p->sum_buffer)) &&
                      launch(p, SUM, items, error) &&
                      karst_buffer_read(p->sum_buffer, 0, parts, items * sizeof *parts, error);
    memset(p->sums[batch], 0, sizeof p->sums[batch]);
    for (uint32_t i = 0; done && i < items; i++)
        for (int s = 0; s < KARST_PHOTON_SUMS; s++)
            p->sums[batch][s] += parts[i][s];
    free(parts);
    return done;
}

bool karst_photons_trace(karst_photons *p, const karst_photon_scene *scene, uint32_t batch, bool again,
                         karst_error *error)
{
    karst_photon_task task = task_of(p, scene);
    const size_t first = (size_t)batch * p->batch_rays;
    task.batch = batch;
    task.num_batches = p->num_batches;
    const uint32_t num = karst_photons_in_batches(p, batch + 1) - karst_photons_in_batches(p, batch);
    if (!p->num_cells || !num)
        return true;
    uint32_t left = num;
    if (!again && !karst_buffer_fill(p->photons, 0, first * sizeof(karst_photon),
                                     (size_t)p->batch_rays * sizeof(karst_photon), error))
        return false;
    if (!send(p, &task, num, error))
        return false;
    for (task.generation = 0; left; task.generation++) {
        const karst_buffer *count = p->total[task.generation % 2], *next_count = p->total[(task.generation + 1) % 2];
        task.is_last = task.generation >= scene->bounces;
        if (!cast(p, scene, &task, count, left, error) ||
            !meet(p, &task, count, left, again ? NULL : p->photons, first, error))
            return false;
        if (task.is_last)
            break;
        if (!pack(p, count, next_count, left, error) ||
            (task.generation % BLIND_BOUNCES == BLIND_BOUNCES - 1 &&
             !karst_buffer_read((karst_buffer *)next_count, 0, &left, sizeof left, error)))
            return false;
    }
    return again || add_sums(p, batch, num, error);
}

bool karst_photons_sort(karst_photons *p, uint32_t num_batches, karst_error *error)
{
    const uint32_t buckets = 1u << p->buckets_log2, blocks = buckets / KARST_PHOTON_BLOCK;
    const uint32_t num = num_batches * p->batch_rays;
    const karst_photon_task task = {.reach = p->reach, .mask = buckets - 1};
    p->num_sorted = num_batches;
    if (!num || !p->num_cells)
        return true;
    return karst_buffer_fill(p->buckets, 0, 0, p->buckets->size_bytes, error) &&
           KARST_ARGUMENTS(p->kernels[TAG], error, KARST_VALUE_ARG(task), KARST_BUFFER_ARG(p->photons),
                           KARST_VALUE_ARG(num), KARST_BUFFER_ARG(p->buckets)) &&
           launch(p, TAG, num, error) &&
           KARST_ARGUMENTS(p->kernels[BLOCK_SUMS], error, KARST_BUFFER_ARG(p->buckets),
                           KARST_BUFFER_ARG(p->block_sums), KARST_VALUE_ARG(blocks)) &&
           launch(p, BLOCK_SUMS, blocks, error) &&
           KARST_ARGUMENTS(p->kernels[SCAN], error, KARST_BUFFER_ARG(p->block_sums), KARST_VALUE_ARG(blocks),
                           KARST_BUFFER_ARG(p->num_in_buckets)) &&
           karst_launch(p->context, p->kernels[SCAN], KARST_STAGE_SHADE, 1, 1, error) &&
           KARST_ARGUMENTS(p->kernels[BEGINS], error, KARST_BUFFER_ARG(p->buckets), KARST_BUFFER_ARG(p->block_sums),
                           KARST_BUFFER_ARG(p->begins), KARST_VALUE_ARG(blocks)) &&
           launch(p, BEGINS, blocks, error) &&
           KARST_ARGUMENTS(p->kernels[SORT], error, KARST_VALUE_ARG(task), KARST_BUFFER_ARG(p->photons),
                           KARST_VALUE_ARG(num), KARST_BUFFER_ARG(p->buckets), KARST_BUFFER_ARG(p->begins),
                           KARST_BUFFER_ARG(p->sorted)) &&
           launch(p, SORT, num, error);
}

/* ---- what comes of them ---- */

bool karst_photons_gather(karst_photons *p, const karst_buffer *rays, const karst_buffer *count, uint32_t max_rays,
                          const float offset[3], const karst_pinhole *pinhole, karst_buffer *parts,
                          karst_error *error)
{
    if (!p->num_sorted || !p->num_cells)
        return true;
    const double traced = karst_photons_in_batches(p, p->num_sorted);
    const karst_photon_task task = {.reach = p->reach,
                                    .scale = p->scale,
                                    .whole = (float)(p->num_photons / traced),
                                    .offset = {offset[0], offset[1], offset[2]},
                                    .mask = (1u << p->buckets_log2) - 1};
    const int width_px = pinhole->width_px, height_px = pinhole->height_px;
    return KARST_ARGUMENTS(p->kernels[GATHER], error, KARST_VALUE_ARG(task), KARST_BUFFER_ARG(rays),
                           KARST_BUFFER_ARG(count), KARST_BUFFER_ARG(p->sorted), KARST_BUFFER_ARG(p->buckets),
                           KARST_BUFFER_ARG(p->begins), KARST_VALUE_ARG(width_px), KARST_VALUE_ARG(height_px),
                           KARST_BUFFER_ARG(parts)) &&
           launch(p, GATHER, max_rays, error);
}

void karst_photons_sums(const karst_photons *p, uint32_t num_batches, uint64_t sums[KARST_PHOTON_SUMS],
                        double *quantum)
{
    memset(sums, 0, KARST_PHOTON_SUMS * sizeof *sums);
    for (uint32_t batch = 0; batch < num_batches; batch++)
        for (int s = 0; s < KARST_PHOTON_SUMS; s++)
            sums[s] += p->sums[batch][s];
    *quantum = p->quantum > 0 ? 1 / p->quantum : 0;
}

bool karst_photons_read(karst_photons *p, karst_photon *into, size_t max_photons, size_t *num, karst_error *error)
{
    *num = 0;
    if (!p->num_sorted || !p->num_cells)
        return true;
    uint32_t all = 0;
    if (!karst_buffer_read(p->num_in_buckets, 0, &all, sizeof all, error))
        return false;
    *num = all;
    const size_t read = all < max_photons ? all : max_photons;
    return !read || karst_buffer_read(p->sorted, 0, into, read * sizeof *into, error);
}
