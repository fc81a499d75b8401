/* From probes to grids of photons. */
#include "raycast/light/photons_aim.h"

#include <math.h>
#include <string.h>

/* Rings of a sun's disc grow by exp(RING_GROWTH / rows) each. */
#define RING_GROWTH 7.0

double karst_photon_ring(float t_max, double row)
{
    return t_max * expm1(RING_GROWTH * row / KARST_PHOTON_ROWS) / expm1(RING_GROWTH);
}

/* A cell's area across a sun's light, or its solid angle. */
static double measure_of(const karst_photon_lamp *lamp, float t_max, uint32_t cell)
{
    const double row = cell / KARST_PHOTON_ROWS, angle = 2 * M_PI / KARST_PHOTON_ROWS;
    if (lamp->kind != KARST_LAMP_SUN)
        return (1 - (double)lamp->least_cosine) / KARST_PHOTON_ROWS * angle;
    const double inner = karst_photon_ring(t_max, row), outer = karst_photon_ring(t_max, row + 1);
    return 0.5 * (outer - inner) * (outer + inner) * sin(angle);
}

/* How much wider a cell is from row to row than from column to column. */
static double aspect_of(const karst_photon_lamp *lamp, float t_max, uint32_t cell)
{
    const double row = cell / KARST_PHOTON_ROWS, angle = 2 * M_PI / KARST_PHOTON_ROWS;
    if (lamp->kind != KARST_LAMP_SUN) {
        const double step = (1 - (double)lamp->least_cosine) / KARST_PHOTON_ROWS;
        const double cosine = lamp->least_cosine + (row + 0.5) * step;
        return step / (angle * fmax(1 - cosine * cosine, 1e-4));
    }
    const double inner = karst_photon_ring(t_max, row), outer = karst_photon_ring(t_max, row + 1);
    return (outer - inner) / (0.5 * (outer + inner) * angle);
}

/* The nearest to the eye that counts; distance 0: there is none. */
static void take_nearer(karst_photon_seen *best, const karst_photon_seen *other)
{
    if (other->distance > 0 && !(best->distance > 0 && other->distance >= best->distance))
        *best = *other;
}

uint32_t karst_photons_find_cells(karst_photon_aim *aim, uint32_t most_parts)
{
    const int rows = (int)KARST_PHOTON_ROWS;
    aim->num_cells = 0;
    aim->parts_log2 = 0;
    for (int cell = 0; cell < rows * rows; cell++) {
        karst_photon_seen near = {0, 0};
        for (int r = cell / rows - 1; r <= cell / rows + 1; r++)
            for (int c = cell % rows - 1; r >= 0 && r < rows && c <= cell % rows + 1; c++)
                take_nearer(&near, &aim->first[r * rows + (c + rows) % rows]);
        aim->index[cell] = UINT32_MAX;
        if (!(near.distance > 0))
            continue;
        aim->parts[aim->num_cells] = aim->first[cell];
        aim->index[cell] = aim->num_cells;
        aim->cells[aim->num_cells++] = (uint32_t)cell;
    }
    uint32_t log2 = 0;
    while (aim->num_cells && log2 < KARST_PHOTON_MOST_PARTS_LOG2 &&
           (uint64_t)aim->num_cells << (2 * log2 + 2) <= most_parts)
        log2++;
    return log2;
}

void karst_photons_probe_parts(karst_photon_aim *aim, uint32_t parts_log2, karst_photon_cell *into)
{
    const int rows = (int)KARST_PHOTON_ROWS;
    aim->parts_log2 = parts_log2;
    for (uint32_t i = 0; i < aim->num_cells; i++) {
        const int cell = (int)aim->cells[i];
        karst_photon_seen near = {0, 0};
        for (int r = cell / rows - 1; r <= cell / rows + 1; r++)
            for (int c = cell % rows - 1; r >= 0 && r < rows && c <= cell % rows + 1; c++)
                take_nearer(&near, &aim->first[r * rows + (c + rows) % rows]);
        into[i] = (karst_photon_cell){.first = i << 2 * parts_log2,
                                      .cell = aim->cells[i] | aim->number << 16,
                                      .grid = 1u << parts_log2 | 1u << (16 + parts_log2),
                                      .share = 1,
                                      .distance = fmaxf(near.distance, 1)};
    }
}

void karst_photons_coarsen(karst_photon_aim *aim)
{
    const uint32_t side = 1u << --aim->parts_log2;
    for (uint32_t i = 0; i < aim->num_cells; i++)
        for (uint32_t row = 0; row < side; row++)
            for (uint32_t column = 0; column < side; column++) {
                karst_photon_seen near = {0, 0};
                for (uint32_t k = 0; k < 4; k++)
                    take_nearer(&near, &aim->parts[(i * 2 * side + 2 * row + k / 2) * 2 * side + 2 * column + k % 2]);
                aim->parts[(i * side + row) * side + column] = near;
            }
}

/* What the part in that row and column of all the lamp's met, if it is known of. */
static const karst_photon_seen *part_at(const karst_photon_aim *aim, int row, int column)
{
    static const karst_photon_seen nothing = {0, 0};
    const uint32_t log2 = aim->parts_log2, inner = (1u << log2) - 1, all = KARST_PHOTON_ROWS << log2;
    if (row < 0 || row >= (int)all)
        return &nothing;
    const uint32_t r = (uint32_t)row, c = (uint32_t)(column + (int)all) % all;
    const uint32_t index = aim->index[(r >> log2) * KARST_PHOTON_ROWS + (c >> log2)];
    return index == UINT32_MAX ? &nothing : &aim->parts[(((index << log2) + (r & inner)) << log2) + (c & inner)];
}

/* Whether parts of a cell that met something itself all met nothing: then it is too thin for them. */
static bool is_lost(const karst_photon_aim *aim, uint32_t i)
{
    const uint32_t num = 1u << 2 * aim->parts_log2;
    bool is = aim->first[aim->cells[i]].distance > 0;
    for (uint32_t part = 0; is && part < num; part++)
        is = !(aim->parts[i * num + part].distance > 0);
    return is;
}

uint32_t karst_photons_find_parts(const karst_photon_aim *aim, karst_photon_cell *into, double *worth, double *angle)
{
    const uint32_t log2 = aim->parts_log2, side = 1u << log2;
    const karst_photon_lamp *lamp = aim->lamp;
    const double bright = fmax(lamp->colour[0], fmax(lamp->colour[1], lamp->colour[2]));
    uint32_t num = 0;
    for (uint32_t i = 0; i < aim->num_cells; i++) {
        const uint32_t cell = aim->cells[i];
        const double measure = ldexp(measure_of(lamp, aim->t_max, cell), -2 * (int)log2);
        const int row0 = (int)(cell / KARST_PHOTON_ROWS << log2), column0 = (int)(cell % KARST_PHOTON_ROWS << log2);
        const bool all = is_lost(aim, i);
        for (uint32_t part = 0; part < side * side; part++) {
            const int row = row0 + (int)(part >> log2), column = column0 + (int)(part & (side - 1));
            karst_photon_seen near = {0, 0};
            for (int k = 0; k < 9; k++)
                take_nearer(&near, part_at(aim, row + k / 3 - 1, column + k % 3 - 1));
            if (all && !(near.distance > 0))
                near = aim->first[cell];
            if (!(near.distance > 0))
                continue;
            const double far = fmax(near.distance, 1), t = lamp->kind == KARST_LAMP_SUN ? 1 : near.t;
            worth[num] = bright * measure / (far * far);
            *angle += measure * t * t / (far * far);
            into[num++] = (karst_photon_cell){.cell = cell | aim->number << 16,
                                              .part = part >> log2 | (part & (side - 1)) << 8 | log2 << 16,
                                              .share = (float)measure,
                                              .distance = (float)far};
        }
    }
    return num;
}

static uint32_t whole(double v, uint32_t least) { return (uint32_t)fmin(fmax(floor(v + 0.5), least), 65535); }

/* Grids for so many photons for each that is worth 1. into: NULL: only count. */
static uint64_t set_grids(const karst_photon_lamp *lamps, float t_max, const karst_photon_cell *parts,
                          const double *worth, uint32_t num, double per_worth, karst_photon_cell *into, uint32_t *kept)
{
    double left = 0; /* that were wished for so far, and not given */
    uint64_t first = 0;
    *kept = 0;
    for (uint32_t i = 0; i < num; i++) {
        const double wished = worth[i] * per_worth;
        uint32_t rows = 1, columns = 1;
        left += wished;
        if (wished < 1) {
            if (left < 0.5)
                continue;
        } else {
            const double aspect = aspect_of(&lamps[parts[i].cell >> 16], t_max, parts[i].cell & 0xffffu);
            rows = whole(sqrt(wished * aspect), 1);
            columns = whole(left / rows, 1);
        }
        const double photons = (double)rows * columns;
        if (into) {
            into[*kept] = parts[i];
            into[*kept].first = (uint32_t)first;
            into[*kept].grid = rows | columns << 16;
            /* On average a part has so many, whether it has one or none. */
            into[*kept].share = (float)((double)parts[i].share / (wished < 1 ? wished : photons));
        }
        left -= photons;
        first += (uint64_t)rows * columns;
        ++*kept;
    }
    return first;
}

uint32_t karst_photons_share_out(const karst_photon_lamp *lamps, float t_max, karst_photon_cell *parts,
                                 const double *worth, uint32_t *num, uint32_t num_photons)
{
    double sum = 0;
    uint32_t kept = 0;
    for (uint32_t i = 0; i < *num; i++)
        sum += worth[i];
    double per_worth = sum > 0 ? num_photons / sum : 0;
    while (set_grids(lamps, t_max, parts, worth, *num, per_worth, NULL, &kept) > num_photons)
        per_worth *= 0.999;
    const uint32_t sent = (uint32_t)set_grids(lamps, t_max, parts, worth, *num, per_worth, parts, &kept);
    *num = kept;
    return sent;
}
