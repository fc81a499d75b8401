/* The models of a scene that are shown as discs: see producers/points/splat_list.h. */
#include "producers/points/splat_list.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/points/points_file.h"
#include "core/points/splats.h"

#define WORDS(bytes) (((bytes) + 7) / 8)

/* A file's tree, which models that cull alike share. */
typedef struct {
    const char *path;
    bool culls;
    karst_points_head head;
    karst_splat_tree tree;
    double half[3];
    uint64_t nodes, discs; /* where they lie in the block, words */
} splat_file;

static void say_what_is_left_out(const splat_file *file, double spacing, const karst_log *log)
{
    karst_log_print(log, KARST_LOG_WARNING,
                    "%s: as discs its finest levels take too much memory: points are shown %.3g of its lengths apart",
                    file->path, spacing * file->head.unit);
}

/* Its levels, with each number checked, as long as their points take at most a part of max_bytes; the finest first. */
static bool load_levels(splat_file *file, uint64_t max_bytes, karst_point *points[KARST_POINTS_MAX_LEVELS],
                        karst_splat_level levels[KARST_POINTS_MAX_LEVELS], uint32_t *num, const karst_log *log,
                        karst_error *error)
{
    const karst_points_head *head = &file->head;
    const int fd = karst_points_open(file->path, &file->head, error);
    uint32_t first = 0;
    bool done = fd >= 0;
    while (done && first + 1 < head->num_levels && head->levels[first].num * sizeof(karst_point) > max_bytes / 4)
        first++;
    for (uint32_t l = first; done && l < head->num_levels; l++) {
        points[*num] = karst_points_load_level(fd, file->path, head, l, error);
        done = points[*num] != NULL;
        if (done) {
            levels[*num] = (karst_splat_level){points[*num], (uint32_t)head->levels[l].num,
                                               (double)head->levels[l].spacing};
            ++*num;
        }
    }
    if (fd >= 0)
        close(fd);
    if (done && first)
        say_what_is_left_out(file, (double)head->levels[first].spacing, log);
    return done;
}

static bool make_tree(splat_file *file, uint64_t *room_bytes, karst_splat_counts *counts, const karst_log *log,
                      karst_error *error)
{
    karst_point *points[KARST_POINTS_MAX_LEVELS] = {NULL};
    karst_splat_level levels[KARST_POINTS_MAX_LEVELS];
    karst_error why = {0};
    uint32_t num = 0;
    bool done = load_levels(file, *room_bytes, points, levels, &num, log, error) &&
                (karst_splat_tree_build(levels, num, file->culls, *room_bytes, &file->tree, &why) ||
                 karst_fail(error, why.status, "%s: %s", file->path, why.message));
    if (done) {
        const karst_splat_tree *tree = &file->tree;
        const uint32_t shown = tree->num_left_out;
        if (shown)
            say_what_is_left_out(file, levels[shown].spacing, log);
        counts->num_points += levels[shown].num;
        counts->num_discs += tree->num_discs;
        counts->num_copies += tree->num_copies;
        counts->num_culled += tree->num_culled;
        counts->num_leaves += tree->num_leaves;
        const uint64_t bytes =
            tree->num_discs * sizeof(karst_point) + tree->num_nodes * sizeof(karst_splat_node);
        *room_bytes -= bytes < *room_bytes ? bytes : *room_bytes;
        for (uint32_t i = 0; i < levels[num - 1].num; i++) /* as models are measured: by points alone */
            for (int a = 0; a < 3; a++)
                file->half[a] = fmax(file->half[a], fabs((double)levels[num - 1].points[i].at[a]));
    }
    for (uint32_t l = 0; l < num; l++)
        free(points[l]);
    return done;
}

static void fill_model(karst_splat_model *model, const karst_model_record *place, const splat_file *file,
                       const karst_splat_source *source)
{
    *model = (karst_splat_model){.nodes = file->nodes,
                                 .discs = file->discs,
                                 .units_per_voxel = place->units_per_voxel,
                                 .has_colours = place->has_colours,
                                 .is_deep = source->is_deep,
                                 .has_backs = source->has_backs,
                                 .root_log2 = file->tree.root_log2};
    for (int i = 0; i < 9; i++)
        model->to_units[i] = (float)ldexp((double)place->matrix[i], -place->shift);
    memcpy(model->spacings, file->tree.spacings, sizeof model->spacings);
    model->finest = model->spacings[KARST_SPLAT_MAX_DEPTH];
    for (int depth = 0; depth <= KARST_SPLAT_MAX_DEPTH; depth++)
        model->coarsest = fmaxf(model->coarsest, model->spacings[depth]);
}

static bool make_block(karst_splat_list *list, const karst_splat_source *sources, splat_file *files,
                       uint32_t num_files, const uint32_t *file_of, karst_error *error)
{
    karst_splats_head head = {.num_models = list->num_models, .models = WORDS(sizeof head)};
    uint64_t words = head.models + list->num_models * WORDS(sizeof(karst_splat_model));
    for (uint32_t f = 0; f < num_files; f++) {
        files[f].nodes = words;
        files[f].discs = words += WORDS(files[f].tree.num_nodes * sizeof(karst_splat_node));
        words += WORDS(files[f].tree.num_discs * sizeof(karst_point));
    }
    karst_fill_linear(head.linear);
    list->size_bytes = (size_t)words * sizeof(uint64_t);
    list->data = calloc(1, list->size_bytes);
    if (!list->data)
        return karst_fail(error, KARST_FAILED, "out of memory for discs of %zu bytes", list->size_bytes);
    memcpy(list->data, &head, sizeof head);
    for (uint32_t i = 0; i < list->num_models; i++)
        fill_model((karst_splat_model *)(list->data + head.models) + i, &list->places[i], &files[file_of[i]],
                   &sources[i]);
    for (uint32_t f = 0; f < num_files; f++) {
        const karst_splat_tree *tree = &files[f].tree;
        memcpy(list->data + files[f].nodes, tree->nodes, tree->num_nodes * sizeof(karst_splat_node));
        memcpy(list->data + files[f].discs, tree->discs, tree->num_discs * sizeof(karst_point));
    }
    return true;
}

bool karst_splat_list_init(karst_splat_list *list, const karst_splat_source *sources, size_t num, int voxel_log2_m,
                           uint64_t max_bytes, const karst_log *log, karst_error *error)
{
    *list = (karst_splat_list){.num_models = (uint32_t)num};
    if (num > KARST_MAX_MODELS)
        return karst_fail(error, KARST_USAGE, "%zu models: %u are the most", num, KARST_MAX_MODELS);
    splat_file *files = calloc(num + 1, sizeof *files);
    uint32_t *file_of = calloc(num + 1, sizeof *file_of), num_files = 0;
    list->places = calloc(num + 1, sizeof *list->places);
    bool done = (files && file_of && list->places) || karst_fail(error, KARST_FAILED, "out of memory");
    for (size_t i = 0; done && i < num; i++) {
        uint32_t f = 0;
        while (f < num_files &&
               (strcmp(files[f].path, sources[i].model.path) != 0 || files[f].culls != sources[i].culls))
            f++;
        file_of[i] = f;
        if (f == num_files) {
            files[num_files++] = (splat_file){.path = sources[i].model.path, .culls = sources[i].culls};
            done = make_tree(&files[f], &max_bytes, &list->counts, log, error);
        }
        done = done && karst_model_place(&sources[i].model, &files[f].head, files[f].half, voxel_log2_m,
                                         &list->places[i], error);
    }
    done = done && make_block(list, sources, files, num_files, file_of, error);
    for (uint32_t f = 0; files && f < num_files; f++)
        karst_splat_tree_finish(&files[f].tree);
    free(files);
    free(file_of);
    if (!done)
        karst_splat_list_finish(list);
    return done;
}

void karst_splat_list_finish(karst_splat_list *list)
{
    free(list->data);
    free(list->places);
    *list = (karst_splat_list){.data = NULL};
}
