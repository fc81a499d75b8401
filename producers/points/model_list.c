/* The models of a scene: see producers/points/model_list.h. */
#include "producers/points/model_list.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/points/points_file.h"
#define POINTS_COLOURED
#include "producers/points/points.clh"

#define WORDS(bytes) (((bytes) + 7) / 8)
#define MOST_HALF_VOXELS 0x1p26 /* of a model: products of the matrix fit 64 bits */
#define MATRIX_BITS 28

/* ---- one file ---- */

/* Levels of one file as devices read them, before they have a place in the block. */
typedef struct {
    karst_model_point *points;
    karst_model_node *nodes[POINTS_MAX_TREE];
    int *cover, *spread; /* of each point: see karst_model_node */
    karst_model_level level;
} loaded_level;

typedef struct {
    const char *path;
    karst_points_head head;
    uint32_t first, num; /* levels that are loaded: from number `first` of the file on */
    loaded_level levels[KARST_POINTS_MAX_LEVELS];
    double half[3]; /* the box of its points around the centre, units */
} loaded_file;

static void free_file(loaded_file *file)
{
    for (uint32_t i = 0; i < file->num; i++) {
        free(file->levels[i].points);
        free(file->levels[i].cover);
        free(file->levels[i].spread);
        for (int k = 0; k < POINTS_MAX_TREE; k++)
            free(file->levels[i].nodes[k]);
    }
}

static size_t bytes_of_level(uint64_t num)
{
    return (size_t)num * (sizeof(karst_model_point) + sizeof(karst_model_node) / 7 + 1) + 4096;
}

static int reach_of(float radius) { return (int)fmin(fmax(ceil(2 * (double)radius), 1), 2.0 * KARST_POINTS_MAX_AT); }

/* From bytes of sRGB (IEC 61966-2-1) to roots of linear parts. */
static uint32_t colour_of(const uint8_t rgb[3])
{
    uint32_t colour = 0;
    for (int part = 0; part < 3; part++) {
        double c = rgb[part] / 255.0, linear = c <= 0.04045 ? c / 12.92 : pow((c + 0.055) / 1.055, 2.4);
        colour |= (uint32_t)rint(sqrt(linear) * 1023) << (10 * part);
    }
    return colour;
}

static bool take_points(loaded_level *to, const karst_point *from, uint32_t num, karst_error *error)
{
    to->level.num_points = num;
    to->points = malloc(num * sizeof *to->points);
    to->cover = malloc(num * sizeof *to->cover);
    to->spread = calloc(num, sizeof *to->spread);
    if (!to->points || !to->cover || !to->spread)
        return karst_fail(error, KARST_FAILED, "out of memory for %u points", num);
    for (uint32_t i = 0; i < num; i++) {
        karst_model_point *p = &to->points[i];
        p->reach = to->cover[i] = reach_of(from[i].radius);
        p->colour = colour_of(from[i].rgb);
        for (int a = 0; a < 3; a++) {
            p->at[a] = from[i].at[a];
            p->normal[a] = (float)from[i].normal[a] / 32767.0f;
        }
    }
    return true;
}

static double distance(const karst_model_point *a, const karst_model_point *b)
{
    double square = 0;
    for (int i = 0; i < 3; i++)
        square += ((double)a->at[i] - b->at[i]) * ((double)a->at[i] - b->at[i]);
    return sqrt(square);
}

static bool same_cell(const karst_model_point *a, const karst_model_point *b, int shift)
{
    return a->at[0] >> shift == b->at[0] >> shift && a->at[1] >> shift == b->at[1] >> shift &&
           a->at[2] >> shift == b->at[2] >> shift;
}

/* Widens the covers of averages by what they average; both levels are in the order of cells. false: the levels are not
 * of one another. */
static bool cover_finer(loaded_level *coarse, const loaded_level *fine)
{
    int shift = ilogb((double)coarse->level.spacing);
    uint32_t i = 0, k = 0, num_coarse = coarse->level.num_points, num_fine = fine->level.num_points;
    while (i < num_coarse && k < num_fine) {
        uint32_t end = i, last = k;
        while (end < num_coarse && same_cell(&coarse->points[end], &coarse->points[i], shift))
            end++;
        if (!same_cell(&coarse->points[i], &fine->points[k], shift))
            return false;
        for (; last < num_fine && same_cell(&fine->points[last], &coarse->points[i], shift); last++)
            for (uint32_t c = i; c < end; c++) {
                double apart = ceil(distance(&fine->points[last], &coarse->points[c]));
                coarse->cover[c] = (int)fmin(fmax(coarse->cover[c], apart + fine->cover[last]), 0x1p30);
                coarse->spread[c] = (int)fmin(fmax(coarse->spread[c], apart + fine->spread[last]), 0x1p30);
            }
        i = end;
        k = last;
    }
    return i == num_coarse && k == num_fine;
}

static void grow(karst_model_node *node, const karst_model_node *by)
{
    for (int a = 0; a < 3; a++) {
        node->min[a] = by->min[a] < node->min[a] ? by->min[a] : node->min[a];
        node->max[a] = by->max[a] > node->max[a] ? by->max[a] : node->max[a];
    }
    node->reach = by->reach > node->reach ? by->reach : node->reach;
    node->cover = by->cover > node->cover ? by->cover : node->cover;
    node->spread = by->spread > node->spread ? by->spread : node->spread;
}

/* A node that holds one point. */
static karst_model_node node_of(const loaded_level *of, uint32_t k)
{
    karst_model_node node = {.reach = of->points[k].reach, .cover = of->cover[k], .spread = of->spread[k]};
    memcpy(node.min, of->points[k].at, sizeof node.min);
    memcpy(node.max, of->points[k].at, sizeof node.max);
    return node;
}

static bool build_tree(loaded_level *of, karst_error *error)
{
    karst_model_level *level = &of->level;
    uint32_t below = level->num_points;
    do {
        uint32_t count = (below + POINTS_FAN - 1) / POINTS_FAN, tree = level->num_levels;
        karst_model_node *nodes = malloc(count * sizeof *nodes);
        of->nodes[tree] = nodes;
        if (!nodes)
            return karst_fail(error, KARST_FAILED, "out of memory for %u points", level->num_points);
        for (uint32_t i = 0; i < count; i++)
            nodes[i] =
                (karst_model_node){.min = {INT32_MAX, INT32_MAX, INT32_MAX}, .max = {INT32_MIN, INT32_MIN, INT32_MIN}};
        for (uint32_t k = 0; k < below; k++) {
            karst_model_node by = tree == 0 ? node_of(of, k) : of->nodes[tree - 1][k];
            grow(&nodes[k / POINTS_FAN], &by);
        }
        level->counts[tree] = below = count;
        level->num_levels++;
    } while (below > 1 && level->num_levels < POINTS_MAX_TREE);
    level->reach = of->nodes[level->num_levels - 1][0].reach;
    level->cover = of->nodes[level->num_levels - 1][0].cover;
    level->spread = of->nodes[level->num_levels - 1][0].spread;
    return true;
}

static bool load_level(loaded_file *file, int fd, uint32_t number, karst_error *error)
{
    loaded_level *level = &file->levels[number - file->first];
    const karst_points_level *from = &file->head.levels[number];
    karst_point *points = karst_points_load_level(fd, file->path, &file->head, number, error);
    bool done = points && take_points(level, points, (uint32_t)from->num, error);
    free(points);
    level->level.spacing = (float)from->spacing;
    file->num++;
    if (done && number > file->first && !cover_finer(level, level - 1))
        done = karst_fail(error, KARST_BAD_DATA, "%s: its levels are not of one another: import the points again",
                          file->path);
    return done && build_tree(level, error);
}

/* Which levels fit, and their points. */
static bool load_file(loaded_file *file, uint64_t *room_bytes, const karst_log *log, karst_error *error)
{
    int fd = karst_points_open(file->path, &file->head, error);
    if (fd < 0)
        return false;
    const karst_points_head *head = &file->head;
    file->first = head->num_levels - 1;
    while (file->first > 0 &&
           bytes_of_level(head->levels[file->first - 1].num) + bytes_of_level(head->levels[file->first].num) <=
               *room_bytes) {
        *room_bytes -= bytes_of_level(head->levels[file->first].num);
        file->first--;
    }
    if (file->first > 0)
        karst_log_print(log, KARST_LOG_WARNING,
                        "%s: its finest %u levels do not fit the device: points are shown %.3g "
                        "of its lengths apart",
                        file->path, file->first, (double)head->levels[file->first].spacing * head->unit);
    bool done = true;
    for (uint32_t i = file->first; done && i < head->num_levels; i++)
        done = load_level(file, fd, i, error);
    close(fd);
    if (!done)
        return false;
    for (uint32_t i = 0; i < file->num; i++) {
        const karst_model_level *level = &file->levels[i].level;
        const karst_model_node *root = file->levels[i].nodes[level->num_levels - 1];
        for (int a = 0; a < 3; a++)
            file->half[a] = fmax(file->half[a], fmax(fabs((double)root->min[a]), fabs((double)root->max[a])));
    }
    return true;
}

/* ---- where models stand ---- */

/* From a model's axes to the world's: about x, then y, then z. */
static void rotation(const double turn_deg[3], double r[3][3])
{
    double c[3], s[3];
    for (int a = 0; a < 3; a++) {
        double quarter = turn_deg[a] / 90;
        /* Quarter turns are exact. */
        bool is_whole = quarter == rint(quarter);
        int quarters = is_whole ? (int)fmod(fmod(quarter, 4) + 4, 4) : 0;
        c[a] = is_whole ? (double[]){1, 0, -1, 0}[quarters] : cos(turn_deg[a] * (3.14159265358979323846 / 180));
        s[a] = is_whole ? (double[]){0, 1, 0, -1}[quarters] : sin(turn_deg[a] * (3.14159265358979323846 / 180));
    }
    const double x[3][3] = {{1, 0, 0}, {0, c[0], -s[0]}, {0, s[0], c[0]}},
                 y[3][3] = {{c[1], 0, s[1]}, {0, 1, 0}, {-s[1], 0, c[1]}},
                 z[3][3] = {{c[2], -s[2], 0}, {s[2], c[2], 0}, {0, 0, 1}};
    double yx[3][3] = {{0}};
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            for (int j = 0; j < 3; j++)
                yx[i][k] += y[i][j] * x[j][k];
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            r[i][k] = 0;
            for (int j = 0; j < 3; j++)
                r[i][k] += z[i][j] * yx[j][k];
        }
}

static bool place(const karst_model *model, const loaded_file *file, int voxel_log2_m, karst_model_record *record,
                  karst_error *error)
{
    double r[3][3], m_per_unit = file->head.unit * model->scale, voxel_m = ldexp(1, voxel_log2_m);
    double units = voxel_m / m_per_unit, widest = 0;
    *record = (karst_model_record){.units_per_voxel = (float)units, .m_per_unit = (float)m_per_unit};
    rotation(model->turn_deg, r);
    for (int a = 0; a < 3; a++) {
        double half = 0;
        for (int k = 0; k < 3; k++)
            half += fabs(r[a][k]) * file->half[k] / units;
        widest = fmax(widest, half);
        record->extent[a] = half < 0x1p40 ? (long)ceil(half) + 2 : 0;
        record->at[a] = model->at.voxel[a];
        if (record->at[a] > (1L << 61) || record->at[a] < -(1L << 61))
            return karst_fail(error, KARST_USAGE, "%s stands beyond 2^61 voxels from the origin", model->path);
    }
    if (!(widest <= MOST_HALF_VOXELS))
        return karst_fail(error, KARST_USAGE,
                          "%s: it is %.3g voxels wide, and 2^27 is the most: give the world a "
                          "larger voxel, or the model a smaller scale",
                          model->path, 2 * widest);
    if (!(widest >= 1))
        return karst_fail(error, KARST_USAGE,
                          "%s: it is %.3g voxels wide, so nothing of it would be seen: give the "
                          "world a smaller voxel, or the model a larger scale",
                          model->path, 2 * widest);
    record->has_colours = (file->head.flags & KARST_POINTS_HAS_COLOURS) != 0;
    record->shift = MATRIX_BITS - (int)ceil(log2(units));
    for (int row = 0; row < 3; row++) {
        double offset = 0;
        for (int a = 0; a < 3; a++) {
            double entry = ldexp(r[a][row] * units, record->shift);
            record->matrix[3 * row + a] = (long)rint(entry);
            offset += entry * ldexp((double)model->at.fraction[a], -32);
        }
        record->offset[row] = -(long)rint(offset);
    }
    return record->shift >= 0 || karst_fail(error, KARST_USAGE, "%s is far smaller than a voxel", model->path);
}

/* ---- the block ---- */

static void put_level(karst_model_list *list, size_t *at, const loaded_level *from, karst_model_level *to)
{
    *to = from->level;
    to->points = *at;
    size_t num_bytes = from->level.num_points * sizeof *from->points;
    if (list->data)
        memcpy(list->data + *at, from->points, num_bytes);
    *at += WORDS(num_bytes);
    for (uint32_t k = 0; k < from->level.num_levels; k++) {
        to->nodes[k] = *at;
        num_bytes = from->level.counts[k] * sizeof *from->nodes[k];
        if (list->data)
            memcpy(list->data + *at, from->nodes[k], num_bytes);
        *at += WORDS(num_bytes);
    }
}

/* Places all levels one after another; once without a block, to know its size. */
static size_t put_all(karst_model_list *list, const loaded_file *files, uint32_t num_files, size_t at,
                      karst_model_level *levels)
{
    for (uint32_t f = 0; f < num_files; f++)
        for (uint32_t i = 0; i < files[f].num; i++) {
            karst_model_level passed;
            put_level(list, &at, &files[f].levels[i], levels ? levels++ : &passed);
        }
    return at;
}

static bool make_block(karst_model_list *list, const loaded_file *files, uint32_t num_files,
                       const karst_model_record *records, int voxel_log2_m, karst_error *error)
{
    uint32_t num_levels = 0;
    for (uint32_t f = 0; f < num_files; f++)
        num_levels += files[f].num;
    karst_models_head head = {.num_models = list->num_models, .voxel_m = (float)ldexp(1, voxel_log2_m)};
    head.models = WORDS(sizeof head);
    head.levels = head.models + list->num_models * WORDS(sizeof *records);
    size_t first = head.levels + num_levels * WORDS(sizeof(karst_model_level));
    list->size_bytes = put_all(list, files, num_files, first, NULL) * sizeof(uint64_t);
    list->data = calloc(1, list->size_bytes);
    if (!list->data)
        return karst_fail(error, KARST_FAILED, "out of memory for models of %zu bytes", list->size_bytes);
    memcpy(list->data, &head, sizeof head);
    memcpy(list->data + head.models, records, list->num_models * sizeof *records);
    put_all(list, files, num_files, first, (karst_model_level *)(list->data + head.levels));
    return true;
}

/* The file of a model, loaded if no model before has the same. */
static loaded_file *file_of(loaded_file *files, uint32_t *num_files, const char *path, uint64_t *room_bytes,
                            const karst_log *log, karst_error *error)
{
    for (uint32_t f = 0; f < *num_files; f++)
        if (strcmp(files[f].path, path) == 0)
            return &files[f];
    loaded_file *file = &files[(*num_files)++];
    file->path = path;
    return load_file(file, room_bytes, log, error) ? file : NULL;
}

bool karst_model_list_init(karst_model_list *list, const karst_model *models, size_t num, int voxel_log2_m,
                           uint64_t max_bytes, const karst_log *log, karst_error *error)
{
    *list = (karst_model_list){.num_models = (uint32_t)num};
    if (num > KARST_MAX_MODELS)
        return karst_fail(error, KARST_USAGE, "%zu models: %u are the most", num, KARST_MAX_MODELS);
    loaded_file *files = calloc(num + 1, sizeof *files);
    karst_model_record *records = calloc(num + 1, sizeof *records);
    uint32_t num_files = 0;
    bool done = (files && records) || karst_fail(error, KARST_FAILED, "out of memory");
    for (size_t i = 0; done && i < num; i++) {
        const loaded_file *file = file_of(files, &num_files, models[i].path, &max_bytes, log, error);
        done = file && place(&models[i], file, voxel_log2_m, &records[i], error);
        if (!done)
            break;
        for (const loaded_file *f = files; f < file; f++)
            records[i].first_level += f->num;
        records[i].num_levels = file->num;
    }
    done = done && make_block(list, files, num_files, records, voxel_log2_m, error);
    for (uint32_t f = 0; files && f < num_files; f++)
        free_file(&files[f]);
    free(files);
    free(records);
    if (!done)
        karst_model_list_finish(list);
    return done;
}

void karst_model_list_finish(karst_model_list *list)
{
    free(list->data);
    *list = (karst_model_list){0};
}

/* ---- looking ---- */

karst_drop_box karst_model_list_box(const karst_model_list *list, uint32_t index)
{
    const karst_model_record *model = &POINTS_MODELS(list->data)[index];
    const karst_model_level *last = &POINTS_LEVELS(list->data)[model->first_level + model->num_levels - 1];
    karst_drop_box box = {.margin_voxels = POINTS_MARGIN + 4};
    for (int a = 0; a < 3; a++) {
        int64_t half = model->extent[a] + (int64_t)((float)last->cover / model->units_per_voxel) + 4;
        box.min[a] = model->at[a] - half;
        box.max[a] = model->at[a] + half;
    }
    return box;
}

bool karst_model_list_has_colours(const karst_model_list *list)
{
    bool any = false;
    for (uint32_t i = 0; i < list->num_models; i++)
        any = any || POINTS_MODELS((points_data)list->data)[i].has_colours;
    return any;
}

float karst_model_list_density(const karst_model_list *list, const int64_t voxel[3], int level, float density)
{
    return karst_model_list_coloured_density(list, voxel, level, density, NULL);
}

float karst_model_list_coloured_density(const karst_model_list *list, const int64_t voxel[3], int level, float density,
                                        float colour[4])
{
    points_data data = (points_data)list->data;
    float planes[3 * KARST_BRICK_PADDED + 1];
    for (int part = 0; colour && part < 4; part++)
        planes[part * KARST_BRICK_PADDED] = colour[part];
    for (uint32_t i = 0; i < list->num_models; i++) {
        const karst_model_record *model = &POINTS_MODELS(data)[i];
        const vlong at[3] = {voxel[0], voxel[1], voxel[2]};
        int number = points_level(data, model, points_voxel(level) * model->units_per_voxel, 0);
        long sides[3];
        bool in_margin = number >= 0;
        if (!in_margin)
            continue;
        const karst_model_level *of = POINTS_LEVELS(data) + model->first_level + number;
        points_margin(model, of, level, sides);
        for (int a = 0; a < 3; a++)
            in_margin = in_margin && at[a] >= model->at[a] - sides[a] && at[a] <= model->at[a] + sides[a];
        if (in_margin)
            density = points_union(data, model, of, at, level, POINTS_HEAD(data)->voxel_m, -1, density,
                                   colour ? planes : NULL);
    }
    for (int part = 0; colour && part < 4; part++)
        colour[part] = planes[part * KARST_BRICK_PADDED];
    return density;
}

bool karst_model_list_check(const karst_model_list *list, karst_error *error)
{
    points_data data = (points_data)list->data;
    for (uint32_t m = 0; m < list->num_models; m++) {
        const karst_model_record *model = &POINTS_MODELS(data)[m];
        for (uint32_t i = 0; i < model->num_levels; i++) {
            const karst_model_level *of = POINTS_LEVELS(data) + model->first_level + i;
            const karst_model_point *points = (const karst_model_point *)(data + of->points);
            for (uint32_t k = 0; k < of->num_points; k++)
                for (uint32_t tree = 0, at = k / POINTS_FAN; tree < of->num_levels; tree++, at /= POINTS_FAN) {
                    const karst_model_node *node = (const karst_model_node *)(data + of->nodes[tree]) + at;
                    bool holds = at < of->counts[tree] && points[k].reach <= node->reach && node->reach <= node->cover;
                    for (int a = 0; a < 3; a++)
                        holds = holds && node->min[a] <= points[k].at[a] && points[k].at[a] <= node->max[a];
                    if (!holds)
                        return karst_fail(error, KARST_FAILED,
                                          "model %u: node %u of tree level %u does not hold point "
                                          "%u of level %u",
                                          m, at, tree, k, i);
                }
        }
    }
    return true;
}
