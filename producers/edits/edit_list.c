/* The list of edits: see producers/edits/edit_list.h. */
#include "producers/edits/edit_list.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "producers/edits/edits.clh"

#define MIN_CAPACITY 256u
#define WORDS(bytes) (((bytes) + 7) / 8)

static karst_edits_head *head_of(const karst_edit_list *list) { return (karst_edits_head *)list->data; }
static karst_edit_record *records_of(const karst_edit_list *list)
{
    return (karst_edit_record *)(list->data + head_of(list)->records);
}
static uint32_t *order_of(const karst_edit_list *list) { return (uint32_t *)(list->data + head_of(list)->order); }
static karst_edit_node *nodes_of(const karst_edit_list *list, int level)
{
    return (karst_edit_node *)(list->data + head_of(list)->nodes[level]);
}

uint32_t karst_edit_list_num(const karst_edit_list *list) { return list->data ? head_of(list)->num_edits : 0; }
const karst_edit_record *karst_edit_list_records(const karst_edit_list *list) { return records_of(list); }

/* Where everything lies with room for so many edits; returns the size. */
static size_t lay_out(karst_edits_head *head, uint32_t capacity)
{
    size_t at = WORDS(sizeof *head);
    head->records = at;
    at += (size_t)capacity * WORDS(sizeof(karst_edit_record));
    head->order = at;
    at += WORDS((size_t)capacity * sizeof(uint32_t));
    uint32_t count = capacity;
    for (int level = 0; level < EDITS_MAX_LEVELS; level++) {
        count = (count + EDITS_FAN - 1) / EDITS_FAN;
        head->nodes[level] = at;
        at += (size_t)count * WORDS(sizeof(karst_edit_node));
    }
    return at * sizeof(uint64_t);
}

/* The same edits in a block with more room. */
static bool make_room(karst_edit_list *list, uint32_t capacity, karst_error *error)
{
    karst_edits_head head = list->data ? *head_of(list) : (karst_edits_head){0};
    uint32_t num = list->num_made;
    size_t size_bytes = lay_out(&head, capacity);
    uint64_t *data = calloc(1, size_bytes);
    if (!data)
        return karst_fail(error, KARST_FAILED, "out of memory for %u edits", capacity);
    head.voxel_m = (float)ldexp(1, list->voxel_log2_m);
    if (num)
        memcpy(data + head.records, records_of(list), num * sizeof(karst_edit_record));
    head.num_sorted = head.num_levels = 0;
    memcpy(data, &head, sizeof head);
    free(list->data);
    list->data = data;
    list->size_bytes = size_bytes;
    list->capacity = capacity;
    list->is_rearranged = true;
    return true;
}

bool karst_edit_list_init(karst_edit_list *list, int voxel_log2_m, karst_error *error)
{
    *list = (karst_edit_list){.voxel_log2_m = voxel_log2_m};
    return make_room(list, MIN_CAPACITY, error);
}

void karst_edit_list_finish(karst_edit_list *list)
{
    free(list->data);
    *list = (karst_edit_list){0};
}

/* ---- checking ---- */

static bool complain(size_t number, karst_error *error, const char *what)
{
    return karst_fail(error, KARST_USAGE, "edit %zu: %s", number, what);
}

/* Metres to voxels. false: out of range. */
static bool to_voxels(double metres, int voxel_log2_m, bool may_be_zero, float *voxels)
{
    double value = ldexp(metres, -voxel_log2_m);
    *voxels = (float)value;
    return (metres == 0 && may_be_zero) || (value >= 0x1p-20 && value <= 0x1p60);
}

static bool make_normal(const double normal[3], float axis[3])
{
    double length = sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
    if (length == 0 && normal[0] == 0 && normal[1] == 0 && normal[2] == 0) {
        axis[1] = 1;
        return true;
    }
    for (int a = 0; a < 3; a++)
        axis[a] = (float)(normal[a] / length);
    return isfinite(length) && length > 0;
}

/* The same plus an error that no rounding of a float exceeds. */
static float rounded_up(double voxels) { return nextafterf((float)(voxels * (1 + 0x1p-22)), INFINITY); }

static bool make_shape(const karst_edit *edit, size_t number, int voxel_log2_m, karst_edit_record *record,
                       karst_error *error)
{
    double reach[3] = {0};
    bool is_flat = edit->mode == KARST_EDIT_FLATTEN;
    bool is_smooth = edit->mode == KARST_EDIT_SMOOTH;
    if (is_flat && edit->shape != KARST_EDIT_SPHERE && edit->shape != KARST_EDIT_BOX)
        return complain(number, error, "flatten takes a sphere or a box");
    if (is_smooth && edit->shape != KARST_EDIT_SPHERE)
        return complain(number, error, "smooth takes a sphere");
    if (is_smooth && edit->blend_m != 0)
        return complain(number, error, "smooth has no blend: it fades towards the edge of its sphere by itself");
    if (is_smooth && !(edit->strength > 0 && edit->strength <= 1))
        return complain(number, error, "the strength must be above 0, and 1 at most");
    if ((is_flat || is_smooth || edit->shape == KARST_EDIT_PLANE) && !make_normal(edit->normal, record->axis))
        return complain(number, error, "the normal must be finite");
    if (edit->shape == KARST_EDIT_SPHERE || edit->shape == KARST_EDIT_CAPSULE || edit->shape == KARST_EDIT_NOISE) {
        if (!to_voxels(edit->radius_m, voxel_log2_m, false, &record->radius))
            return complain(number, error, "the radius must be 2^-20 to 2^60 voxels");
        reach[0] = reach[1] = reach[2] = record->radius;
        if (is_smooth)
            record->size[0] = (float)edit->strength;
    }
    if (edit->shape == KARST_EDIT_BOX)
        for (int a = 0; a < 3; a++) {
            if (!to_voxels(edit->half_m[a], voxel_log2_m, false, &record->size[a]))
                return complain(number, error, "half the sides must be 2^-20 to 2^60 voxels each");
            reach[a] = record->size[a];
        }
    if (edit->shape == KARST_EDIT_CAPSULE)
        for (int a = 0; a < 3; a++) {
            double along = ldexp(edit->to_m[a], -voxel_log2_m);
            if (!(fabs(along) <= 0x1p60))
                return complain(number, error, "the other end must be finite, and 2^60 voxels away at most");
            record->axis[a] = (float)along;
            reach[a] += fabs(along);
        }
    if (edit->shape == KARST_EDIT_NOISE) {
        float scale;
        if (!(edit->amplitude_m <= edit->radius_m) ||
            !to_voxels(edit->amplitude_m, voxel_log2_m, true, &record->size[0]))
            return complain(number, error, "the amplitude must be 0 to the radius");
        if (!to_voxels(edit->scale_m, voxel_log2_m, false, &scale) || scale < 1 || scale > 0x1p50f)
            return complain(number, error, "the scale must be 1 to 2^50 voxels");
        record->frequency = (int64_t)ldexp(1 / (double)scale, 56);
        record->seed = edit->seed;
        for (int a = 0; a < 3; a++)
            reach[a] += (double)record->size[0] * EDITS_NOISE_SUM * NOISE_SUP;
    }
    for (int a = 0; a < 3; a++)
        record->reach[a] =
            edit->shape == KARST_EDIT_PLANE ? 0x1p61f : rounded_up(reach[a] + (double)record->blend);
    return true;
}

static uint sixteen_bits(double share) { return (uint)(share * 65535 + 0.5); }

static bool make_colour(const karst_edit *edit, size_t number, karst_edit_record *record, karst_error *error)
{
    if (!edit->has_colour)
        return edit->mode != KARST_EDIT_PAINT || complain(number, error, "paint takes a colour");
    if (edit->mode != KARST_EDIT_PAINT && edit->mode != KARST_EDIT_ADD)
        return complain(number, error, "only what is painted or added has a colour");
    for (int i = 0; i < 3; i++)
        if (!(edit->colour[i] >= 0 && edit->colour[i] <= 1))
            return complain(number, error, "the colour must be three numbers from 0 to 1");
    if (!(edit->strength > 0 && edit->strength <= 1))
        return complain(number, error, "the strength must be above 0, and 1 at most");
    record->what |= EDIT_COLOURED;
    record->colour[0] = sixteen_bits(edit->colour[0]) | sixteen_bits(edit->colour[1]) << 16;
    record->colour[1] = sixteen_bits(edit->colour[2]) | sixteen_bits(edit->strength) << 16;
    return true;
}

bool karst_edit_record_make(const karst_edit *edit, size_t number, int voxel_log2_m, karst_edit_record *record,
                            karst_error *error)
{
    *record = (karst_edit_record){.what = (uint)edit->shape | (uint)edit->mode << 8};
    if ((unsigned)edit->shape > KARST_EDIT_NOISE || (unsigned)edit->mode > KARST_EDIT_SMOOTH)
        return complain(number, error, "there is no such shape or mode");
    for (int a = 0; a < 3; a++) {
        if (edit->at.voxel[a] > (int64_t)1 << 61 || edit->at.voxel[a] < -((int64_t)1 << 61))
            return complain(number, error, "it lies beyond 2^61 voxels");
        record->at[a] = edit->at.voxel[a];
        record->fraction[a] = edit->at.fraction[a];
    }
    if (!to_voxels(edit->blend_m, voxel_log2_m, true, &record->blend))
        return complain(number, error, "the blend must be 0, or 2^-20 to 2^60 voxels");
    return make_colour(edit, number, record, error) && make_shape(edit, number, voxel_log2_m, record, error);
}

karst_drop_box karst_edit_record_box(const karst_edit_record *record)
{
    karst_drop_box box = {.margin_voxels = EDITS_MARGIN};
    for (int a = 0; a < 3; a++) {
        int64_t reach = edits_reach(record->reach[a], 0, 0);
        box.min[a] = record->at[a] - reach;
        box.max[a] = record->at[a] + reach;
    }
    return box;
}

/* ---- the index ---- */

typedef struct {
    uint64_t key;
    uint32_t edit;
} place;

static int compare_places(const void *a, const void *b)
{
    const place *p = a, *q = b;
    return p->key != q->key ? (p->key < q->key ? -1 : 1) : p->edit < q->edit ? -1 : p->edit > q->edit;
}

/* Every third bit, from 21. */
static uint64_t spread(uint64_t bits)
{
    bits &= 0x1fffff;
    bits = (bits | bits << 32) & 0x1f00000000ffffull;
    bits = (bits | bits << 16) & 0x1f0000ff0000ffull;
    bits = (bits | bits << 8) & 0x100f00f00f00f00full;
    bits = (bits | bits << 4) & 0x10c30c30c30c30c3ull;
    return (bits | bits << 2) & 0x1249249249249249ull;
}

static void hull_of_edit(const karst_edit_record *record, karst_edit_node *node)
{
    for (int a = 0; a < 3; a++) {
        int64_t reach = edits_reach(record->reach[a], 0, 0);
        node->min[a] = record->at[a] - reach < node->min[a] ? record->at[a] - reach : node->min[a];
        node->max[a] = record->at[a] + reach > node->max[a] ? record->at[a] + reach : node->max[a];
        node->reach = fmaxf(node->reach, record->reach[a]);
    }
}

static const karst_edit_node nothing = {.min = {INT64_MAX, INT64_MAX, INT64_MAX},
                                        .max = {INT64_MIN, INT64_MIN, INT64_MIN}};

static void build_nodes(karst_edit_list *list)
{
    karst_edits_head *head = head_of(list);
    uint32_t count = head->num_sorted;
    head->num_levels = 0;
    for (int level = 0; level < EDITS_MAX_LEVELS && count > (level == 0 ? 0u : 1u); level++) {
        uint32_t num_children = count;
        count = (count + EDITS_FAN - 1) / EDITS_FAN;
        for (uint32_t i = 0; i < count; i++) {
            karst_edit_node *node = &nodes_of(list, level)[i];
            *node = nothing;
            for (uint32_t k = i * EDITS_FAN; k < (i + 1) * EDITS_FAN && k < num_children; k++) {
                if (level == 0) {
                    hull_of_edit(&records_of(list)[order_of(list)[k]], node);
                    continue;
                }
                const karst_edit_node *child = &nodes_of(list, level - 1)[k];
                for (int a = 0; a < 3; a++) {
                    node->min[a] = child->min[a] < node->min[a] ? child->min[a] : node->min[a];
                    node->max[a] = child->max[a] > node->max[a] ? child->max[a] : node->max[a];
                }
                node->reach = fmaxf(node->reach, child->reach);
            }
        }
        head->counts[level] = count;
        head->num_levels = (uint32_t)level + 1;
    }
}

static bool build_index(karst_edit_list *list, karst_error *error)
{
    karst_edits_head *head = head_of(list);
    uint32_t num = head->num_edits;
    place *places = malloc((num ? num : 1) * sizeof *places);
    if (!places)
        return karst_fail(error, KARST_FAILED, "out of memory for %u edits", num);
    karst_edit_node all = nothing;
    for (uint32_t i = 0; i < num; i++)
        for (int a = 0; a < 3; a++) {
            int64_t at = records_of(list)[i].at[a];
            all.min[a] = at < all.min[a] ? at : all.min[a];
            all.max[a] = at > all.max[a] ? at : all.max[a];
        }
    int shift = 0; /* of the widest axis, so that 21 bits are left */
    for (int a = 0; a < 3; a++)
        while (num && ((uint64_t)all.max[a] - (uint64_t)all.min[a]) >> shift >> 21)
            shift++;
    for (uint32_t i = 0; i < num; i++) {
        uint64_t key = 0;
        for (int a = 0; a < 3; a++)
            key |= spread(((uint64_t)records_of(list)[i].at[a] - (uint64_t)all.min[a]) >> shift) << a;
        places[i] = (place){key, i};
    }
    qsort(places, num, sizeof *places, compare_places);
    for (uint32_t i = 0; i < num; i++)
        order_of(list)[i] = places[i].edit;
    free(places);
    head->num_sorted = num;
    build_nodes(list);
    list->is_rearranged = true;
    return true;
}

/* So many may be looked at one by one. */
static uint32_t most_unsorted(uint32_t num) { return num / 128 > 64 ? num / 128 : 64; }

bool karst_edit_list_append(karst_edit_list *list, const karst_edit *edits, size_t num, karst_error *error)
{
    uint32_t before = head_of(list)->num_edits;
    if (num > KARST_MAX_EDITS - before)
        return karst_fail(error, KARST_USAGE, "%zu edits and %u that there are: %u are the most", num, before,
                          KARST_MAX_EDITS);
    uint32_t after = before + (uint32_t)num, capacity = list->capacity;
    if (capacity < after) { /* a tenth is to spare at most: edits are many */
        capacity += capacity / 10;
        capacity = capacity < after ? after : capacity;
    }
    /* Checked before anything changes. */
    for (size_t i = 0; i < num; i++) {
        karst_edit_record record;
        if (!karst_edit_record_make(&edits[i], i + 1, list->voxel_log2_m, &record, error))
            return false;
    }
    if (capacity > list->capacity) {
        list->num_made = before;
        if (!make_room(list, capacity, error))
            return false;
    }
    for (size_t i = 0; i < num; i++)
        karst_edit_record_make(&edits[i], i + 1, list->voxel_log2_m, &records_of(list)[before + i], NULL);
    karst_edits_head *head = head_of(list);
    if (head->num_sorted > before) /* it names undone ones, which are gone now */
        head->num_sorted = head->num_levels = 0;
    head->num_edits = list->num_made = after;
    return after - head->num_sorted <= most_unsorted(after) || build_index(list, error);
}

void karst_edit_list_set_num(karst_edit_list *list, uint32_t num)
{
    head_of(list)->num_edits = num < list->num_made ? num : list->num_made;
}

/* ---- at a point ---- */

/* The density after all edits; their colours are laid over `colour`, unless that is NULL. */
static float apply_all(const karst_edit_list *list, const karst_position *at, int level, float density,
                       vfloat colour[4])
{
    const karst_edits_head *head = head_of(list);
    int of_box = level > 0 ? level : 0;
    edits_box box = {.level = of_box,
                     .margin = EDITS_MARGIN,
                     .shown = level >= 0,
                     .which = colour ? EDITS_ALL : EDITS_OF_LAND};
    vlong voxel[3];
    vuint fraction[3];
    uint found[EDITS_LIST], count, first = 0;
    for (int a = 0; a < 3; a++) {
        box.min[a] = box.max[a] = voxel[a] = at->voxel[a];
        fraction[a] = at->fraction[a];
        box.max[a] += at->fraction[a] != 0;
    }
    do {
        count = edits_collect(list->data, &box, first, found);
        for (uint i = 0; i < count; i++) {
            const karst_edit_record *edit = &records_of(list)[found[i]];
            vfloat p[3];
            for (int a = 0; a < 3; a++)
                p[a] = EDITS_TO_FLOAT(voxel[a] - edit->at[a]) +
                       ((float)fraction[a] * 0x1p-32f - (float)edit->fraction[a] * 0x1p-32f);
            if (colour && (edit->what & EDIT_COLOURED))
                edits_lay_over(colour, edits_cover(density, p, voxel, fraction, edit, level, head->voxel_m), edit);
            density = edits_apply(density, p, voxel, fraction, edit, level, head->voxel_m);
        }
        first = count ? found[count - 1] + 1 : 0;
    } while (count == EDITS_LIST);
    return density;
}

float karst_edit_list_density(const karst_edit_list *list, const karst_position *at, int level, float density)
{
    return apply_all(list, at, level, density, NULL);
}

void karst_edit_list_colour(const karst_edit_list *list, const karst_position *at, int level, float density,
                            float colour[4])
{
    memset(colour, 0, 4 * sizeof *colour);
    apply_all(list, at, level, density, colour);
}

bool karst_edit_list_touches(const karst_edit_list *list, const karst_position *at, double half_voxels)
{
    int64_t half = half_voxels < 0x1p60 ? (int64_t)half_voxels + 2 : (int64_t)1 << 60;
    edits_box box = {.margin = EDITS_MARGIN, .which = EDITS_OF_LAND};
    uint found[EDITS_LIST];
    for (int a = 0; a < 3; a++) {
        box.min[a] = at->voxel[a] - half;
        box.max[a] = at->voxel[a] + half;
    }
    return edits_collect(list->data, &box, 0, found) > 0;
}

/* ---- the check ---- */

bool karst_edit_list_check(const karst_edit_list *list, karst_error *error)
{
    const karst_edits_head *head = head_of(list);
    if (head->num_edits > list->num_made || list->num_made > list->capacity || head->num_sorted > list->num_made)
        return karst_fail(error, KARST_FAILED, "edits: %u of %u in force, %u in the index, room for %u",
                          head->num_edits, list->num_made, head->num_sorted, list->capacity);
    uint64_t sum = 0;
    for (uint32_t i = 0; i < head->num_sorted; i++) {
        uint32_t edit = order_of(list)[i];
        if (edit >= head->num_sorted)
            return karst_fail(error, KARST_FAILED, "edits: leaf %u is edit %u of %u", i, edit, head->num_sorted);
        sum += edit;
        const karst_edit_record *record = &records_of(list)[edit];
        uint32_t node = i;
        for (uint32_t level = 0; level < head->num_levels; level++) {
            node /= EDITS_FAN;
            const karst_edit_node *hull = &nodes_of(list, (int)level)[node];
            for (int a = 0; a < 3; a++) {
                int64_t reach = edits_reach(record->reach[a], 0, 0);
                if (record->at[a] - reach < hull->min[a] || record->at[a] + reach > hull->max[a] ||
                    record->reach[a] > hull->reach)
                    return karst_fail(error, KARST_FAILED, "edits: node %u of level %u does not hold edit %u", node,
                                      level, edit);
            }
        }
    }
    if (sum != (uint64_t)head->num_sorted * (head->num_sorted - 1) / 2 && head->num_sorted)
        return karst_fail(error, KARST_FAILED, "edits: an edit is missing in the index");
    return true;
}
