/* Launching the kernels of photons, and what is decided between them. */
#include "raycast/light/photons.h"
#include "raycast/light/photon_grid.h"
#include "raycast/light/photons_aim.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "raycast/light/scan.h"

#define LOCAL_SIZE 64
#define NUM_PROBES KARST_PHOTON_CELLS
/* Photons of a part of a cell at least, on average: else parts are twice as wide. So many have neighbours. */
#define PART_PHOTONS 16
/* Photons without neighbours spread over so many where light is as dense as lamps send it: of a million, and more the
 * more there are, as its root: noise and blur fall together. */
#define KERNEL_PHOTONS 40.0
/* The largest that light of a photon is spread, in pixels; and at distance 1. */
#define MOST_SPREAD_PX 48.0
#define MOST_SPREAD 0.25
/* The largest energy of a photon's colour in quanta, of which three fit an int; and what a usual photon adds to what is
 * gathered where it is brightest. */
#define MOST_QUANTA_LOG2 29
#define GATHERED_LOG2 26

enum { SEND, TURN, LOOK, MEET, COUNT, SCAN, PACK, NUM_KERNELS };
static const char *const kernel_names[NUM_KERNELS] = {"photons_send",  "photons_turn", "photons_look", "photons_meet",
                                                      "photons_count", "photons_scan", "photons_pack"};

/* Of a batch. */
typedef struct {
    uint32_t num;         /* photons */
    uint32_t num_waiting; /* that are not done: all, if is_listed does not say which */
    bool is_listed;
    uint64_t sums[KARST_PHOTON_SUMS]; /* of those that are done */
} photon_batch;

struct karst_photons {
    karst_context *context;
    karst_program *program;
    cl_kernel kernels[NUM_KERNELS];
    uint32_t num_photons, batch_rays; /* at most; batches may have fewer */
    uint32_t num_shared, num_batches; /* of the photons, and of theirs, as they were shared out last */
    uint32_t num_sent;                /* of these: all, but for what grids leave over */
    uint32_t room;                                 /* rays of the streams */
    uint32_t num_lamps, num_cells;
    uint32_t num_shown; /* photons that are gathered; and how, whatever is aimed since */
    karst_photon_grid_task shown;
    karst_photon_lamp lamps[KARST_MOST_LAMPS];
    double quantum; /* quanta in a unit of flux; a power of two, as `scale` is */
    float reach, scale, least, most;
    photon_batch *batches;
    uint32_t *waiting;         /* of each batch, from batch_rays times its number on: places that wait */
    karst_photon_fate *fates_read; /* where the host cannot see the device's */
    karst_photon_aim *aims[KARST_MOST_LAMPS]; /* made when they are needed */
    karst_photon_seen *seen_read;
    karst_photon_grid *grid;
    karst_buffer *lamp_buffer, *cells, *table, *seen, *list;
    karst_buffer *rays, *next, *born, *to_lamps, *ways, *born_ways, *hits, *over_hits, *matter, *fates, *counts;
    karst_buffer *total[2], *photons, *no_lamps;
};

/* ---- making them ---- */

static uint32_t whole_blocks(uint32_t num)
{
    const uint32_t block = KARST_PACKET_RAYS * KARST_BEAM_PACKETS;
    return (num + block - 1) / block * block;
}

#define RAY_BYTES \
    (4 * sizeof(karst_ray) + 2 * sizeof(karst_clear_way) + 2 * sizeof(karst_hit) + sizeof(karst_photon_fate) + \
     (KARST_CLEAR_MATTER_PLANES + 2) * sizeof(float))

double karst_photons_bytes(uint32_t num_photons, double *largest_bytes)
{
    const double photons = (double)num_photons * KARST_PHOTON_SLOTS * sizeof(karst_photon);
    *largest_bytes = fmax(photons, (double)NUM_PROBES * sizeof(karst_ray));
    return photons + (double)NUM_PROBES * RAY_BYTES + karst_photon_grid_bytes(num_photons);
}

static uint32_t runs_of(uint32_t num_photons) { return (num_photons - 1) / KARST_PHOTON_RUN + 1; }

static bool make(karst_photons *photons, karst_buffer **buffer, size_t num, size_t each_bytes, karst_error *error)
{
    *buffer = karst_buffer_create_blank(photons->context, "photons", num * each_bytes, error);
    return *buffer != NULL;
}

static bool make_streams(karst_photons *p, karst_error *error)
{
    const size_t room = p->room, cells = (size_t)KARST_MOST_LAMPS * KARST_PHOTON_CELLS,
                 slots = (size_t)KARST_PHOTON_SLOTS * p->batch_rays;
    return make(p, &p->rays, room, sizeof(karst_ray), error) && make(p, &p->next, room, sizeof(karst_ray), error) &&
           make(p, &p->born, room, sizeof(karst_ray), error) &&
           make(p, &p->to_lamps, room, sizeof(karst_ray), error) &&
           make(p, &p->ways, room, sizeof(karst_clear_way), error) &&
           make(p, &p->born_ways, room, sizeof(karst_clear_way), error) &&
           make(p, &p->hits, room, sizeof(karst_hit), error) &&
           make(p, &p->over_hits, room, sizeof(karst_hit), error) &&
           make(p, &p->matter, room, KARST_CLEAR_MATTER_PLANES * sizeof(float), error) &&
           make(p, &p->fates, slots, sizeof(karst_photon_fate), error) &&
           make(p, &p->list, p->batch_rays > NUM_PROBES ? p->batch_rays : NUM_PROBES, sizeof(uint32_t), error) &&
           make(p, &p->seen, NUM_PROBES, 2 * sizeof(float), error) &&
           make(p, &p->counts, room / karst_scan_block(p->context, KARST_PHOTON_BLOCK), sizeof(uint32_t), error) &&
           make(p, &p->total[0], 1, sizeof(uint32_t), error) && make(p, &p->total[1], 1, sizeof(uint32_t), error) &&
           make(p, &p->lamp_buffer, KARST_MOST_LAMPS, sizeof(karst_photon_lamp), error) &&
           make(p, &p->no_lamps, KARST_MOST_LAMPS, sizeof(karst_lamp), error) &&
           make(p, &p->cells, cells, sizeof(karst_photon_cell), error) &&
           make(p, &p->table, 3 * KARST_PHOTON_ROWS + 4, sizeof(float), error) &&
           make(p, &p->photons, p->num_batches * slots, sizeof(karst_photon), error);
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
    const uint32_t runs = runs_of(num_photons);
    p->num_batches = (runs - 1) / (max_rays > KARST_PHOTON_RUN ? max_rays / KARST_PHOTON_RUN : 1) + 1;
    p->batch_rays = ((runs - 1) / p->num_batches + 1) * KARST_PHOTON_RUN;
    const uint32_t most = p->batch_rays * KARST_PHOTON_SLOTS;
    p->room = whole_blocks(most > NUM_PROBES ? most : NUM_PROBES);
    p->batches = calloc(p->num_batches, sizeof *p->batches);
    p->waiting = malloc((size_t)p->num_batches * p->batch_rays * sizeof *p->waiting);
    p->fates_read = malloc((size_t)most * sizeof *p->fates_read);
    p->seen_read = malloc(NUM_PROBES * sizeof *p->seen_read);
    bool done = (p->batches && p->waiting && p->fates_read && p->seen_read) ||
                karst_fail(error, KARST_FAILED, "out of memory");
    done = done && make_streams(p, error) && (p->grid = karst_photon_grid_create(context, num_photons, error)) &&
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
    karst_buffer *const buffers[] = {p->lamp_buffer, p->cells,     p->table, p->seen,     p->list,  p->rays,
                                     p->next,        p->born,      p->ways,  p->to_lamps, p->hits,  p->born_ways,
                                     p->over_hits,   p->matter,    p->fates, p->counts,   p->photons,
                                     p->total[0],    p->total[1],  p->no_lamps};
    for (int i = 0; i < NUM_KERNELS; i++)
        if (p->kernels[i])
            clReleaseKernel(p->kernels[i]);
    karst_program_destroy(p->program);
    for (size_t i = 0; i < sizeof buffers / sizeof *buffers; i++)
        karst_buffer_destroy(buffers[i]);
    karst_photon_grid_destroy(p->grid);
    free(p->batches);
    free(p->waiting);
    free(p->fates_read);
    free(p->seen_read);
    for (int i = 0; i < KARST_MOST_LAMPS; i++)
        free(p->aims[i]);
    free(p);
}

uint32_t karst_photons_num_batches(const karst_photons *p) { return p->num_batches; }

uint32_t karst_photons_num_waiting(const karst_photons *p, uint32_t num_batches)
{
    uint32_t num = 0;
    for (uint32_t batch = 0; batch < num_batches; batch++)
        num += p->batches[batch].num_waiting;
    return num;
}

uint32_t karst_photons_num_done(const karst_photons *p, uint32_t num_batches)
{
    uint32_t num = 0;
    for (uint32_t batch = 0; batch < num_batches; batch++)
        num += p->batches[batch].num - p->batches[batch].num_waiting;
    return num;
}


static bool launch(const karst_photons *p, int kernel, size_t items, karst_error *error)
{
    return karst_launch(p->context, p->kernels[kernel], KARST_STAGE_SHADE,
                        (items + LOCAL_SIZE - 1) / LOCAL_SIZE * LOCAL_SIZE, LOCAL_SIZE, error);
}

/* ---- streams ---- */

static karst_photon_task task_of(const karst_photons *p, const karst_photon_scene *scene)
{
    return (karst_photon_task){.num_batches = 1,
                               .batch_rays = p->batch_rays,
                               .num_photons = p->num_sent,
                               .parts = 1,
                               .num_cells = p->num_cells,
                               .has_land = 1,
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
                           KARST_BUFFER_ARG(p->cells), KARST_BUFFER_ARG(p->table), KARST_BUFFER_ARG(p->list),
                           KARST_BUFFER_ARG(p->rays), KARST_BUFFER_ARG(p->ways), KARST_BUFFER_ARG(p->fates),
                           KARST_BUFFER_ARG(p->photons), KARST_BUFFER_ARG(p->total[0])) &&
           launch(p, SEND, num, error);
}

static bool turn(karst_photons *p, const karst_buffer *count, uint32_t num, karst_error *error)
{
    return KARST_ARGUMENTS(p->kernels[TURN], error, KARST_BUFFER_ARG(p->rays), KARST_BUFFER_ARG(p->ways),
                           KARST_BUFFER_ARG(count)) &&
           launch(p, TURN, num, error);
}

/* Casts the stream into both kinds of matter, and finds what is there; `next` gets the rays that land has leave it.
 * Probes are told what they met, and no more. */
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
                                     .mirrors_all = task->is_probe ? 1 : KARST_PATH_SHARES};
    const karst_path_streams streams = {.rays = p->rays,
                                        .count = count,
                                        .hits = p->hits,
                                        .lamps = p->no_lamps,
                                        .max_rays = num,
                                        .next = p->next,
                                        .to_lamps = p->to_lamps};
    /* A few voxels off, land may be of another material; what is clear is so everywhere. */
    karst_refiner *const of_clear_hits = task->is_probe ? NULL : scene->clear_refiner;
    karst_profile_set_stream(p->context, KARST_STREAM_CLEAR);
    bool done = !task->has_land ||
                (karst_cast_stream(scene->land, scene->view, p->rays, num, count, p->hits, error) &&
                 (!scene->land_refiner || karst_refine_rays(scene->land_refiner, p->rays, count, num, &scene->anchor,
                                                            p->hits, error)) &&
                 karst_shade_paths(scene->shader, scene->view, &pinhole, scene->light, &of_land, &streams,
                                   scene->parts, scene->counters, error));
    if (done && scene->clear)
        done = turn(p, count, num, error) &&
               karst_cast_stream(scene->clear, scene->view, p->rays, num, count, p->over_hits, error) &&
               (!of_clear_hits ||
                karst_refine_rays(of_clear_hits, p->rays, count, num, &scene->anchor, p->over_hits, error)) &&
               turn(p, count, num, error) &&
               (task->is_probe || karst_clear_find_matter(scene->clear_shader, scene->view, p->rays, count, p->ways,
                                                          num, p->over_hits, p->matter, p->room, error));
    karst_profile_set_stream(p->context, KARST_NUM_STREAMS);
    return done;
}

static bool meet(karst_photons *p, const karst_photon_task *task, const karst_pinhole *pinhole,
                 const karst_buffer *count, uint32_t num, karst_error *error)
{
    return KARST_ARGUMENTS(p->kernels[MEET], error, KARST_VALUE_ARG(*task), KARST_VALUE_ARG(*pinhole),
                           KARST_BUFFER_ARG(p->rays), KARST_BUFFER_ARG(p->ways), KARST_BUFFER_ARG(count),
                           KARST_BUFFER_ARG(p->hits), KARST_BUFFER_ARG(p->over_hits), KARST_BUFFER_ARG(p->matter),
                           KARST_VALUE_ARG(p->room), KARST_BUFFER_ARG(p->next), KARST_BUFFER_ARG(p->born),
                           KARST_BUFFER_ARG(p->born_ways), KARST_BUFFER_ARG(p->fates), KARST_BUFFER_ARG(p->photons)) &&
           launch(p, MEET, num, error);
}

/* parts: rays that each of the num had room for. */
static bool pack(karst_photons *p, const karst_buffer *count, const karst_buffer *next_count, uint32_t num,
                 uint32_t parts, karst_error *error)
{
    const uint32_t block = karst_scan_block(p->context, KARST_PHOTON_BLOCK), blocks = (num * parts + block - 1) / block;
    return KARST_ARGUMENTS(p->kernels[COUNT], error, KARST_BUFFER_ARG(p->born), KARST_BUFFER_ARG(count),
                           KARST_VALUE_ARG(parts), KARST_BUFFER_ARG(p->counts), KARST_VALUE_ARG(blocks)) &&
           launch(p, COUNT, blocks, error) &&
           KARST_ARGUMENTS(p->kernels[SCAN], error, KARST_BUFFER_ARG(p->counts), KARST_VALUE_ARG(blocks),
                           KARST_BUFFER_ARG(next_count)) &&
           karst_launch_scan(p->context, p->kernels[SCAN], error) &&
           KARST_ARGUMENTS(p->kernels[PACK], error, KARST_BUFFER_ARG(p->born), KARST_BUFFER_ARG(p->born_ways),
                           KARST_BUFFER_ARG(count), KARST_VALUE_ARG(parts), KARST_BUFFER_ARG(p->counts),
                           KARST_VALUE_ARG(blocks), KARST_BUFFER_ARG(p->rays), KARST_BUFFER_ARG(p->ways)) &&
           launch(p, PACK, blocks, error);
}

/* ---- aiming ---- */

/* Radii of a sun's rings, directions around, and the angle between two. */
static bool write_table(karst_photons *p, float t_max, karst_error *error)
{
    float table[3 * KARST_PHOTON_ROWS + 4];
    for (uint32_t i = 0; i <= KARST_PHOTON_ROWS; i++) {
        const double angle = 2 * M_PI * i / KARST_PHOTON_ROWS;
        table[i] = (float)karst_photon_ring(t_max, i);
        table[KARST_PHOTON_ROWS + 1 + 2 * i] = (float)cos(angle);
        table[KARST_PHOTON_ROWS + 2 + 2 * i] = (float)sin(angle);
    }
    table[3 * KARST_PHOTON_ROWS + 3] = (float)(2 * M_PI / KARST_PHOTON_ROWS);
    return karst_buffer_write(p->table, 0, table, sizeof table, error);
}

/* Those that wait: of the cells of a lamp, or of the parts of the grids in `cells`. */
static bool probe(karst_photons *p, const karst_photon_scene *scene, karst_photon_aim *aim, uint32_t num_grids,
                  karst_photon_seen *seen, karst_error *error)
{
    karst_photon_task task = task_of(p, scene);
    const karst_buffer *count = p->total[0];
    const uint32_t num = aim->num_waiting;
    task.num_photons = task.num_listed = num;
    task.num_cells = num_grids;
    task.lamp = aim->number;
    task.is_probe = num_grids ? 2 : 1;
    /* What land hides of clear matter only costs photons; to ask for land as far as the view goes would cost more. */
    task.has_land = scene->mirrors;
    if (!num)
        return true;
    if (!karst_buffer_write(p->list, 0, aim->waiting, num * sizeof *aim->waiting, error) ||
        !send(p, &task, num, error) || !cast(p, scene, &task, count, num, error) ||
        !KARST_ARGUMENTS(p->kernels[LOOK], error, KARST_VALUE_ARG(task), KARST_BUFFER_ARG(p->rays),
                         KARST_BUFFER_ARG(count), KARST_BUFFER_ARG(p->hits), KARST_BUFFER_ARG(p->over_hits),
                         KARST_BUFFER_ARG(p->next), KARST_BUFFER_ARG(p->seen)) ||
        !launch(p, LOOK, num, error) ||
        !karst_buffer_read(p->seen, 0, p->seen_read, (aim->waiting[num - 1] + 1) * sizeof *seen, error))
        return false;
    aim->num_waiting = 0;
    for (uint32_t i = 0; i < num; i++) {
        const uint32_t at = aim->waiting[i];
        seen[at] = p->seen_read[at];
        if (seen[at].distance < 0)
            aim->waiting[aim->num_waiting++] = at;
    }
    return true;
}

static void let_all_wait(karst_photon_aim *aim, uint32_t num)
{
    aim->num_waiting = num;
    for (uint32_t i = 0; i < num; i++)
        aim->waiting[i] = i;
}

/* Which of a lamp's cells hold anything, and which parts of those: as fine as num_photons allow. */
static bool look(karst_photons *p, const karst_photon_scene *scene, karst_photon_aim *aim, uint32_t num_photons,
                 karst_photon_cell *grids, karst_error *error)
{
    const uint32_t most = num_photons / PART_PHOTONS < NUM_PROBES ? num_photons / PART_PHOTONS : NUM_PROBES;
    if (!aim->knows_cells) {
        if (!probe(p, scene, aim, 0, aim->first, error))
            return false;
        if (aim->num_waiting)
            return true;
        aim->knows_cells = true;
        aim->parts_log2 = karst_photons_find_cells(aim, most > 1024 ? most : 1024);
        let_all_wait(aim, aim->parts_log2 ? aim->num_cells << 2 * aim->parts_log2 : 0);
    }
    if (!aim->num_waiting)
        return true;
    karst_photons_probe_parts(aim, aim->parts_log2, grids);
    return karst_buffer_write(p->cells, 0, grids, aim->num_cells * sizeof *grids, error) &&
           probe(p, scene, aim, aim->num_cells, aim->parts, error);
}

/* Of all parts what they are worth, and so what a photon is: the rest of what aiming settles. */
static bool set_photons(karst_photons *p, const karst_photon_scene *scene, karst_photon_cell *parts,
                        const double *worth, uint32_t num, double angle, karst_error *error)
{
    double energy = 0, most = 0;
    for (uint32_t i = 0; i < num; i++)
        energy += worth[i];
    p->num_sent = karst_photons_share_out(p->lamps, scene->pinhole->t_max, parts, worth, &num, p->num_shared);
    p->num_cells = p->num_sent ? num : 0;
    if (!p->num_cells)
        return true;
    for (uint32_t i = 0; i < num; i++) {
        const karst_photon_lamp *lamp = &p->lamps[parts[i].cell >> 16];
        most = fmax(most, (double)parts[i].share * fmax(lamp->colour[0], fmax(lamp->colour[1], lamp->colour[2])));
    }
    p->quantum = ldexp(1, MOST_QUANTA_LOG2 - 1 - ilogb(1.01 * most));
    /* As wide as a pixel, of which a disc spreads as much as a square when it is narrower by a root of two. */
    p->least = (float)fmin(M_SQRT1_2 * scene->pinhole->cone, MOST_SPREAD);
    p->most = (float)fmax(fmin(MOST_SPREAD_PX * scene->pinhole->cone, MOST_SPREAD), 1.5 * (double)p->least);
    /* So wide that a disc of that radius, where light is as dense as lamps send it, holds as many as are wished. */
    const double wished = KERNEL_PHOTONS * sqrt(p->num_sent / 1e6);
    p->reach = (float)fmin(fmax(sqrt(wished * angle / (M_PI * p->num_sent)), (double)p->least), (double)p->most);
    /* What a usual photon adds: its power over the square of its distance is the same everywhere. */
    const double usual = energy / p->num_sent * 2 / (M_PI * (double)p->least * (double)p->least);
    p->scale = (float)ldexp(1, GATHERED_LOG2 - ilogb(usual));
    for (uint32_t batch = 0; batch < p->num_batches; batch++) {
        const uint32_t of_batch = karst_photons_of_batch(p->num_sent, batch, p->num_batches);
        p->batches[batch] = (photon_batch){.num = of_batch, .num_waiting = of_batch};
    }
    return karst_buffer_write(p->cells, 0, parts, num * sizeof *parts, error);
}

/* Nothing is known of a lamp. */
static karst_photon_aim *begin_aim(karst_photons *p, const karst_photon_scene *scene, uint32_t lamp)
{
    karst_photon_aim *aim = p->aims[lamp] ? p->aims[lamp] : malloc(sizeof *aim);
    p->aims[lamp] = aim;
    if (!aim)
        return NULL;
    const float *colour = p->lamps[lamp].colour;
    aim->lamp = &p->lamps[lamp];
    aim->number = lamp;
    aim->t_max = scene->pinhole->t_max;
    aim->num_cells = aim->parts_log2 = 0;
    aim->knows_cells = !(fmax(colour[0], fmax(colour[1], colour[2])) > 0);
    let_all_wait(aim, aim->knows_cells ? 0 : KARST_PHOTON_CELLS);
    return aim;
}

bool karst_photons_begin(karst_photons *p, const karst_photon_scene *scene, const karst_photon_lamp *lamps,
                         uint32_t num_lamps, karst_error *error)
{
    if (num_lamps > KARST_MOST_LAMPS)
        return karst_fail(error, KARST_FAILED, "%u lamps: %d is the limit", num_lamps, KARST_MOST_LAMPS);
    p->num_cells = p->num_shared = p->num_batches = p->num_sent = 0;
    p->num_lamps = num_lamps;
    if (num_lamps)
        memcpy(p->lamps, lamps, num_lamps * sizeof *lamps);
    for (uint32_t l = 0; l < num_lamps; l++)
        if (!begin_aim(p, scene, l))
            return karst_fail(error, KARST_FAILED, "out of memory");
    return (!num_lamps || karst_buffer_write(p->lamp_buffer, 0, lamps, num_lamps * sizeof *lamps, error)) &&
           write_table(p, scene->pinhole->t_max, error);
}

bool karst_photons_aim(karst_photons *p, const karst_photon_scene *scene, uint32_t *num_waiting, karst_error *error)
{
    karst_photon_cell *grids = malloc(KARST_PHOTON_CELLS * sizeof *grids);
    bool done = grids || karst_fail(error, KARST_FAILED, "out of memory");
    *num_waiting = 0;
    for (uint32_t l = 0; done && l < p->num_lamps; l++) {
        done = look(p, scene, p->aims[l], p->num_photons / p->num_lamps, grids, error);
        *num_waiting += done ? p->aims[l]->num_waiting : 0;
    }
    free(grids);
    return done;
}

/* The parts of a lamp that get most_photons at most, wider the fewer these are; how many. */
static uint32_t parts_for(karst_photon_aim *aim, uint32_t most_photons, karst_photon_cell *parts, double *worth,
                          double *angle)
{
    for (;;) {
        double across = 0;
        const uint32_t num = karst_photons_find_parts(aim, parts, worth, &across);
        if (aim->parts_log2 == 0 || (uint64_t)num * PART_PHOTONS <= most_photons) {
            *angle += across;
            return num;
        }
        karst_photons_coarsen(aim);
    }
}

bool karst_photons_share(karst_photons *p, const karst_photon_scene *scene, uint32_t num_photons, karst_error *error)
{
    const size_t most = (size_t)(p->num_lamps ? p->num_lamps : 1) * KARST_PHOTON_CELLS;
    karst_photon_cell *parts = malloc(most * sizeof *parts);
    double *worth = malloc(most * sizeof *worth), angle = 0;
    karst_photon_aim *aim = malloc(sizeof *aim);
    uint32_t num = 0;
    p->num_cells = p->num_sent = 0;
    p->num_shared = num_photons;
    p->num_batches = (runs_of(num_photons) * KARST_PHOTON_RUN - 1) / p->batch_rays + 1;
    memset(p->batches, 0, p->num_batches * sizeof *p->batches);
    bool done = (parts && worth && aim) || karst_fail(error, KARST_FAILED, "out of memory");
    for (uint32_t l = 0; done && l < p->num_lamps; l++) {
        *aim = *p->aims[l];
        num += parts_for(aim, num_photons / p->num_lamps, parts + num, worth + num, &angle);
    }
    done = done && (!num || set_photons(p, scene, parts, worth, num, angle, error));
    free(parts);
    free(worth);
    free(aim);
    return done;
}

/* ---- tracing ---- */

/* Where the energy of a photon went, if that is known. */
static bool add_fates(const karst_photons *p, const karst_photon_fate *fates, uint32_t place,
                      uint64_t sums[KARST_PHOTON_SUMS])
{
    static const int sum_of[] = {[KARST_PHOTON_LANDED] = KARST_PHOTON_SUM_LANDED,
                                 [KARST_PHOTON_DIRECT] = KARST_PHOTON_SUM_DIRECT,
                                 [KARST_PHOTON_ESCAPED] = KARST_PHOTON_SUM_ESCAPED,
                                 [KARST_PHOTON_CUT] = KARST_PHOTON_SUM_CUT};
    bool has_landed = false;
    for (uint32_t slot = 0; slot < KARST_PHOTON_SLOTS; slot++)
        if (fates[slot * p->batch_rays + place].fate == KARST_PHOTON_UNSURE)
            return false;
    for (uint32_t slot = 0; slot < KARST_PHOTON_SLOTS; slot++) {
        const karst_photon_fate *fate = &fates[slot * p->batch_rays + place];
        sums[KARST_PHOTON_SUM_GIVEN] += fate->given;
        sums[KARST_PHOTON_SUM_LOST] += (uint64_t)(int64_t)fate->lost;
        has_landed = has_landed || fate->fate == KARST_PHOTON_LANDED;
        if (fate->fate >= KARST_PHOTON_LANDED && fate->fate <= KARST_PHOTON_CUT)
            sums[sum_of[fate->fate]] += fate->left;
    }
    sums[KARST_PHOTON_SUM_NUM_LANDED] += has_landed;
    return true;
}

/* Who of those that were traced is done, and who waits. */
static bool settle(karst_photons *p, uint32_t batch, karst_error *error)
{
    photon_batch *of = &p->batches[batch];
    uint32_t *waiting = p->waiting + (size_t)batch * p->batch_rays;
    const karst_photon_fate *fates = karst_buffer_memory(p->fates);
    if (!(fates ? karst_finish(p->context, error)
                : karst_buffer_read(p->fates, 0, p->fates_read,
                                    (size_t)KARST_PHOTON_SLOTS * p->batch_rays * sizeof *p->fates_read, error)))
        return false;
    if (!fates)
        fates = p->fates_read;
    uint32_t num_waiting = 0;
    for (uint32_t i = 0; i < of->num_waiting; i++) {
        const uint32_t place = of->is_listed ? waiting[i] : i;
        if (!add_fates(p, fates, place, of->sums))
            waiting[num_waiting++] = place;
    }
    of->num_waiting = num_waiting;
    of->is_listed = true;
    return true;
}

bool karst_photons_trace(karst_photons *p, const karst_photon_scene *scene, uint32_t batch, karst_error *error)
{
    photon_batch *of = &p->batches[batch];
    const size_t first = karst_photon_record(batch, p->batch_rays, 0, 0);
    karst_photon_task task = task_of(p, scene);
    task.batch = batch;
    task.num_batches = p->num_batches;
    task.num_listed = of->is_listed ? of->num_waiting : 0;
    uint32_t left = of->num_waiting;
    if (!left)
        return true;
    if (of->is_listed ? !karst_buffer_write(p->list, 0, p->waiting + (size_t)batch * p->batch_rays,
                                            left * sizeof *p->waiting, error)
                      : !karst_buffer_fill(p->photons, 0, first * sizeof(karst_photon),
                                           KARST_PHOTON_SLOTS * (size_t)p->batch_rays * sizeof(karst_photon), error))
        return false;
    if (!send(p, &task, left, error))
        return false;
    for (task.generation = 0; left; task.generation++) {
        const karst_buffer *count = p->total[task.generation % 2], *next_count = p->total[(task.generation + 1) % 2];
        task.is_last = task.generation >= scene->bounces;
        task.parts = task.generation < KARST_PHOTON_SPLITS ? 2 : 1;
        if (!cast(p, scene, &task, count, left, error) || !meet(p, &task, scene->pinhole, count, left, error))
            return false;
        if (task.is_last)
            break;
        if (!pack(p, count, next_count, left, task.parts, error) ||
            !karst_buffer_read((karst_buffer *)next_count, 0, &left, sizeof left, error))
            return false;
    }
    return settle(p, batch, error);
}

/* ---- what comes of them ---- */

bool karst_photons_sort(karst_photons *p, uint32_t num_batches, karst_error *error)
{
    p->num_shown = karst_photons_num_done(p, num_batches);
    p->shown = (karst_photon_grid_task){.num_batches = p->num_batches,
                                        .batch_rays = p->batch_rays,
                                        .num_photons = p->num_sent,
                                        .num_cells = p->num_cells,
                                        .num_records = karst_photon_record(num_batches, p->batch_rays, 0, 0),
                                        .least = p->least,
                                        .most = p->most,
                                        .reach = p->reach,
                                        .scale = p->scale,
                                        .whole = p->num_shown ? (float)((double)p->num_sent / p->num_shown) : 0};
    return karst_photon_grid_fill(p->grid, &p->shown, p->photons, p->cells, p->lamp_buffer, error);
}

bool karst_photons_gather(karst_photons *p, const karst_buffer *rays, const karst_buffer *count, uint32_t max_rays,
                          const float offset[3], const karst_pinhole *pinhole, karst_buffer *parts,
                          karst_error *error)
{
    karst_photon_grid_task task = p->shown;
    if (!p->num_shown)
        return true;
    memcpy(task.offset, offset, sizeof task.offset);
    return karst_photon_grid_gather(p->grid, &task, rays, count, max_rays, pinhole, parts, error);
}

void karst_photons_sums(const karst_photons *p, uint32_t num_batches, uint64_t sums[KARST_PHOTON_SUMS],
                        double *quantum)
{
    memset(sums, 0, KARST_PHOTON_SUMS * sizeof *sums);
    for (uint32_t batch = 0; batch < num_batches; batch++)
        for (int s = 0; s < KARST_PHOTON_SUMS; s++)
            sums[s] += p->batches[batch].sums[s];
    *quantum = p->quantum > 0 ? 1 / p->quantum : 0;
}
