/* The models of a scene: see producers/points/model_list.h. */
#include "producers/points/model_list.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "core/points/points_file.h"
#include "producers/points/model_solid.h"
#define POINTS_COLOURED
#include "producers/points/points.clh"

#define WORDS(bytes) (((bytes) + 7) / 8)
#define MOST_HALF_VOXELS 0x1p26 /* of a model: products of the matrix fit 64 bits */
#define MATRIX_BITS 28
#define MOST_CHECKED_BYTES ((uint64_t)4 << 20) /* of a level of a file that is mapped */

/* ---- one file ---- */

typedef struct {
    const char *path;
    karst_points_head head;
    int fd;
    uint32_t first, num;                             /* levels that are shown: from number `first` of the file on */
    uint64_t begin, end;                             /* the part of the file that has them; begin is a page's */
    size_t at;                                       /* where in the block that lies, bytes */
    double half[3];                                  /* the box of its points around the centre, units */
    karst_point_node roots[KARST_POINTS_MAX_LEVELS]; /* of the levels that are shown */
    karst_model_solid solid;                         /* what is inside; no levels: nothing is */
} model_file;

static uint64_t page_bytes(void) { return (uint64_t)sysconf(_SC_PAGESIZE); }

static uint64_t bytes_of_level(const karst_points_level *level)
{
    return karst_points_level_end(level) - level->offset;
}

/* The last node of a level holds all others. */
static bool read_root(model_file *file, uint32_t level, karst_error *error)
{
    karst_point_node *root = &file->roots[level - file->first];
    const off_t at = (off_t)(karst_points_level_end(&file->head.levels[level]) - sizeof *root);
    bool good = pread(file->fd, root, sizeof *root, at) == (ssize_t)sizeof *root && root->reach >= 0 &&
                root->reach <= root->cover && root->cover <= 1 << 30 && root->spread >= 0 && root->spread <= 1 << 30;
    for (int a = 0; a < 3; a++) {
        good = good && root->min[a] >= -KARST_POINTS_MAX_AT && root->max[a] <= KARST_POINTS_MAX_AT &&
               root->min[a] <= root->max[a];
        file->half[a] = fmax(file->half[a], fmax(fabs((double)root->min[a]), fabs((double)root->max[a])));
    }
    return good || karst_fail(error, KARST_BAD_DATA, "%s: its points are damaged: import the points again", file->path);
}

/* Which levels fit. */
static bool open_file(model_file *file, uint64_t *room_bytes, const karst_log *log, karst_error *error)
{
    file->fd = karst_points_open(file->path, &file->head, error);
    if (file->fd < 0)
        return false;
    const karst_points_head *head = &file->head;
    file->first = head->num_levels - 1;
    while (file->first > 0 &&
           bytes_of_level(&head->levels[file->first - 1]) + bytes_of_level(&head->levels[file->first]) <= *room_bytes) {
        *room_bytes -= bytes_of_level(&head->levels[file->first]);
        file->first--;
    }
    if (file->first > 0)
        karst_log_print(log, KARST_LOG_WARNING,
                        "%s: its finest %u levels do not fit the device: points are shown %.3g "
                        "of its lengths apart",
                        file->path, file->first, (double)head->levels[file->first].spacing * head->unit);
    file->num = head->num_levels - file->first;
    file->begin = head->levels[file->first].offset / page_bytes() * page_bytes();
    file->end = karst_points_level_end(&head->levels[head->num_levels - 1]);
    for (uint32_t level = file->first; level < head->num_levels; level++)
        if (!read_root(file, level, error))
            return false;
    return true;
}

/* What is inside is found at the finest level that is shown: the first one that it does not take too many cells for. */
static bool plan_inside(model_file *file, const karst_log *log, karst_error *error)
{
    const uint32_t before = file->first;
    for (; file->num; file->first++, file->num--) {
        const karst_points_level *level = &file->head.levels[file->first];
        const karst_point_node *root = &file->roots[file->first - before];
        if (karst_solid_plan(&file->solid, file->half, root->reach, (double)level->spacing))
            break;
    }
    if (file->num == 0)
        return karst_fail(error, KARST_BAD_DATA, "%s: its points are too uneven to say what is inside: a model with "
                                                 "\"mode\": \"clear\" is a closed surface",
                          file->path);
    memmove(file->roots, file->roots + (file->first - before), file->num * sizeof *file->roots);
    file->begin = file->head.levels[file->first].offset / page_bytes() * page_bytes();
    if (file->first > before)
        karst_log_print(log, KARST_LOG_WARNING,
                        "%s: as clear matter its points are shown %.3g of its lengths apart, since what they enclose "
                        "is kept cell by cell",
                        file->path, (double)file->head.levels[file->first].spacing * file->head.unit);
    return true;
}

/* ---- where models stand ---- */

void karst_model_rotation(const double turn_deg[3], double r[3][3])
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

bool karst_model_place(const karst_model *model, const karst_points_head *head, const double half_units[3],
                       int voxel_log2_m, karst_model_record *record, karst_error *error)
{
    double r[3][3], m_per_unit = head->unit * model->scale, voxel_m = ldexp(1, voxel_log2_m);
    double units = voxel_m / m_per_unit, widest = 0;
    *record = (karst_model_record){.units_per_voxel = (float)units, .m_per_unit = (float)m_per_unit};
    karst_model_rotation(model->turn_deg, r);
    for (int a = 0; a < 3; a++) {
        double half = 0;
        for (int k = 0; k < 3; k++)
            half += fabs(r[a][k]) * half_units[k] / units;
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
    record->has_colours = (head->flags & KARST_POINTS_HAS_COLOURS) != 0;
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

static bool read_part(const model_file *file, char *to, karst_error *error)
{
    const uint64_t num_bytes = file->end - file->begin;
    for (uint64_t done = 0; done < num_bytes;) {
        ssize_t got = pread(file->fd, to + done, (size_t)(num_bytes - done), (off_t)(file->begin + done));
        if (got < 0 && errno == EINTR)
            continue;
        if (got <= 0)
            return karst_fail(error, KARST_BAD_DATA, "%s: cannot be read: %s", file->path,
                              got < 0 ? strerror(errno) : "it became shorter");
        done += (uint64_t)got;
    }
    return true;
}

/* The file's part comes into the block; is_whole: read, not mapped. */
static bool bring(karst_model_list *list, const model_file *file, bool is_whole, karst_error *error)
{
    char *to = (char *)list->data + file->at;
    if (is_whole && !read_part(file, to, error))
        return false;
    if (!is_whole) {
        const size_t num_bytes = (size_t)(file->end - file->begin);
        if (mmap(to, num_bytes, PROT_READ, MAP_SHARED | MAP_FIXED, file->fd, (off_t)file->begin) == MAP_FAILED)
            return karst_fail(error, KARST_FAILED, "%s: cannot be mapped: %s", file->path, strerror(errno));
        list->maps[list->num_maps++] = (struct karst_model_map){to, num_bytes};
    }
    for (uint32_t level = file->first; level < file->head.num_levels; level++) {
        const karst_points_level *of = &file->head.levels[level];
        if ((is_whole || bytes_of_level(of) <= MOST_CHECKED_BYTES) &&
            !karst_points_check_level(file->path, &file->head, level, to + (of->offset - file->begin), error))
            return false;
    }
    return true;
}

static void fill_level(const model_file *file, uint32_t number, karst_model_level *level)
{
    const karst_points_level *of = &file->head.levels[number];
    const karst_point_node *root = &file->roots[number - file->first];
    *level = (karst_model_level){.num_points = (uint32_t)of->num,
                                 .spacing = (float)of->spacing,
                                 .reach = root->reach,
                                 .cover = root->cover,
                                 .spread = root->spread,
                                 .points = (file->at + (of->offset - file->begin)) / 8};
    uint64_t at = (file->at + (karst_points_tree_offset(of) - file->begin)) / 8;
    level->num_levels = (uint32_t)karst_points_tree(level->num_points, level->counts);
    for (uint32_t tree = 0; tree < level->num_levels; tree++) {
        level->nodes[tree] = at;
        at += WORDS(level->counts[tree] * sizeof(karst_point_node));
    }
}

void karst_fill_linear(float linear[256])
{
    for (int i = 0; i < 256; i++) {
        double c = i / 255.0;
        linear[i] = (float)(c <= 0.04045 ? c / 12.92 : pow((c + 0.055) / 1.055, 2.4));
    }
}

static bool fill_inside(karst_model_list *list, const model_file *file, const karst_model_level *level,
                        const karst_log *log, karst_error *error)
{
    uint64_t num_inside;
    if (file->solid.levels == 0)
        return true;
    if (!karst_solid_fill(list->data, level, &file->solid, &num_inside, error))
        return false;
    if (num_inside == 0)
        karst_log_print(log, KARST_LOG_WARNING,
                        "%s: its points enclose nothing that is wider than their crust: as clear matter it may be "
                        "hollow",
                        file->path);
    return true;
}

static bool make_block(karst_model_list *list, model_file *files, uint32_t num_files, const karst_model_record *records,
                       int voxel_log2_m, uint64_t most_read_bytes, const karst_log *log, karst_error *error)
{
    uint32_t num_levels = 0;
    for (uint32_t f = 0; f < num_files; f++)
        num_levels += files[f].num;
    karst_models_head head = {.num_models = list->num_models, .voxel_m = (float)ldexp(1, voxel_log2_m)};
    head.models = WORDS(sizeof head);
    head.levels = head.models + list->num_models * WORDS(sizeof *records);
    karst_fill_linear(head.linear);
    size_t size = (head.levels + num_levels * WORDS(sizeof(karst_model_level))) * sizeof(uint64_t);
    for (uint32_t f = 0; f < num_files; f++) {
        size = (size + page_bytes() - 1) / page_bytes() * page_bytes();
        files[f].at = size;
        size += (size_t)(files[f].end - files[f].begin);
        if (files[f].solid.levels == 0)
            continue;
        size = (size + page_bytes() - 1) / page_bytes() * page_bytes();
        files[f].solid.words = size / 8;
        size += 8 * karst_solid_words(&files[f].solid);
    }
    list->maps = calloc(num_files + 1, sizeof *list->maps);
    void *memory = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (memory == MAP_FAILED || !list->maps)
        return karst_fail(error, KARST_FAILED, "out of memory for models of %zu bytes", size);
    list->data = memory;
    list->size_bytes = size;
    memcpy(list->data, &head, sizeof head);
    memcpy(list->data + head.models, records, list->num_models * sizeof *records);
    karst_model_level *level = (karst_model_level *)(list->data + head.levels);
    uint64_t all_bytes = 0;
    for (uint32_t f = 0; f < num_files; f++) {
        all_bytes += files[f].end - files[f].begin;
        if (!bring(list, &files[f], all_bytes <= most_read_bytes, error))
            return false;
        const karst_model_level *finest = level;
        for (uint32_t i = 0; i < files[f].num; i++)
            fill_level(&files[f], files[f].first + i, level++);
        if (!fill_inside(list, &files[f], finest, log, error))
            return false;
        const uint32_t first = (uint32_t)(finest - (karst_model_level *)(list->data + head.levels));
        for (uint32_t i = 0; i < list->num_models; i++)
            if (records[i].first_level == first)
                ((karst_model_record *)(list->data + head.models))[i].solid = files[f].solid;
    }
    return true;
}

/* The file of a model, opened if no model before has the same. */
static model_file *file_of(model_file *files, uint32_t *num_files, const karst_model *model, uint64_t *room_bytes,
                           const karst_log *log, karst_error *error)
{
    for (uint32_t f = 0; f < *num_files; f++)
        if (strcmp(files[f].path, model->path) == 0)
            return &files[f];
    model_file *file = &files[(*num_files)++];
    *file = (model_file){.path = model->path, .fd = -1};
    return open_file(file, room_bytes, log, error) && (!model->is_whole || plan_inside(file, log, error)) ? file : NULL;
}

bool karst_model_list_init(karst_model_list *list, const karst_model *models, size_t num, int voxel_log2_m,
                           uint64_t max_bytes, const karst_log *log, karst_error *error)
{
    return karst_model_list_init_reading(list, models, num, voxel_log2_m, max_bytes, KARST_MODEL_MOST_READ_BYTES, log,
                                         error);
}

bool karst_model_list_init_reading(karst_model_list *list, const karst_model *models, size_t num, int voxel_log2_m,
                                   uint64_t max_bytes, uint64_t most_read_bytes, const karst_log *log,
                                   karst_error *error)
{
    *list = (karst_model_list){.num_models = (uint32_t)num};
    if (num > KARST_MAX_MODELS)
        return karst_fail(error, KARST_USAGE, "%zu models: %u are the most", num, KARST_MAX_MODELS);
    model_file *files = calloc(num + 1, sizeof *files);
    karst_model_record *records = calloc(num + 1, sizeof *records);
    uint32_t num_files = 0;
    bool done = (files && records) || karst_fail(error, KARST_FAILED, "out of memory");
    for (size_t i = 0; done && i < num; i++) {
        const model_file *file = file_of(files, &num_files, &models[i], &max_bytes, log, error);
        done = file && karst_model_place(&models[i], &file->head, file->half, voxel_log2_m, &records[i], error);
        if (!done)
            break;
        for (const model_file *f = files; f < file; f++)
            records[i].first_level += f->num;
        records[i].num_levels = file->num;
    }
    done = done && make_block(list, files, num_files, records, voxel_log2_m, most_read_bytes, log, error);
    for (uint32_t f = 0; files && f < num_files; f++)
        if (files[f].fd >= 0)
            close(files[f].fd);
    free(files);
    free(records);
    if (!done)
        karst_model_list_finish(list);
    return done;
}

void karst_model_list_finish(karst_model_list *list)
{
    if (list->data)
        munmap(list->data, list->size_bytes);
    free(list->maps);
    *list = (karst_model_list){0};
}

void karst_model_list_let_go(const karst_model_list *list)
{
    for (uint32_t i = 0; i < list->num_maps; i++)
        madvise(list->maps[i].at, list->maps[i].num_bytes, MADV_DONTNEED);
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
            const karst_point *points = (const karst_point *)(data + of->points);
            for (uint32_t k = 0; k < of->num_points; k++)
                for (uint32_t tree = 0, at = k / KARST_POINTS_FAN; tree < of->num_levels;
                     tree++, at /= KARST_POINTS_FAN) {
                    const karst_point_node *node = (const karst_point_node *)(data + of->nodes[tree]) + at;
                    bool holds = at < of->counts[tree] && karst_point_reach(points[k].radius) <= node->reach &&
                                 node->reach <= node->cover;
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
