/* image(NAME, p), texture(NAME, p, n, size) and field(NAME, p): samples of a file of the header's, as functions. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "core/base/beside.h"
#include "core/files/volume.h"
#include "producers/language/front/lower_internal.h"

void karst_world_images_free(karst_world_image *list)
{
    while (list) {
        karst_world_image *next = list->next;
        for (int c = 0; c < 3; c++)
            karst_samples_image_finish(&list->channel[c]);
        karst_samples_image_finish(&list->texture);
        free(list);
        list = next;
    }
}

static const char *all_data(const karst_lower_state *s)
{
    const karst_world_header *h = s->io->header;
    if (h->num_data == 0)
        return "\"data\": { \"NAME\": { \"file\": \"heights.png\", \"size\": [1000, 1000] } } in the file's first "
               "comment gives it some";
    const char *list = h->data[0].name;
    for (uint32_t i = 1; i < h->num_data; i++)
        list = karst_format(s->arena, "%s, %s", list, h->data[i].name);
    return karst_format(s->arena, "there are: %s", list);
}

static const karst_header_data *find_data(karst_lower_state *s, const char *text, uint32_t where)
{
    const karst_world_header *h = s->io->header;
    if (!text)
        karst_source_error(s->source, where, all_data(s), "an image is called by the name of its data");
    karst_nearest nearest = karst_nearest_begin(text, strlen(text));
    for (uint32_t i = 0; i < h->num_data; i++) {
        if (!strcmp(h->data[i].name, text))
            return &h->data[i];
        karst_nearest_offer(&nearest, h->data[i].name);
    }
    const char *hint = karst_nearest_hint(&nearest, s->arena);
    karst_source_error(s->source, where, hint ? hint : all_data(s), "this world has no data called '%s'", text);
}

static _Noreturn void bad_file(karst_lower_state *s, const karst_header_data *data, const karst_error *why)
{
    char *message = karst_format(s->arena, "%s", why->message);
    karst_source_plain(message);
    s->source->is_data_error = why->status == KARST_BAD_DATA;
    karst_source_error(s->source, data->where, NULL, "data '%s': %s", data->name, message);
}

/* A file's first row is the farthest along the second axis, as on a map whose north is up. */
static void turn_rows(karst_samples *samples)
{
    const size_t in_row = (size_t)samples->width * samples->num_channels;
    for (size_t top = 0, bottom = samples->height; bottom-- > top; top++) {
        for (size_t i = 0; i < in_row; i++) {
            float kept = samples->values[top * in_row + i];
            samples->values[top * in_row + i] = samples->values[bottom * in_row + i];
            samples->values[bottom * in_row + i] = kept;
        }
        if (top % 512 == 0)
            karst_samples_let_go(samples);
    }
}

/* All that a channel of a file follows from, as text; false: the file is not there, or its name too long. */
static bool key_of(const karst_header_data *data, const char *path, uint32_t channel, char key[KARST_IMAGE_KEY_BYTES])
{
    const karst_samples_form *form = &data->form;
    struct stat about;
    char *real = realpath(path, NULL);
    int length = KARST_IMAGE_KEY_BYTES;
    if (real && stat(real, &about) == 0)
        length = snprintf(key, KARST_IMAGE_KEY_BYTES,
                          "%s\n%llu bytes, %lld.%09ld s, %llu on %llu\n%s %u %u, range %d %.17g %.17g, wrap %d, "
                          "channel %u",
                          real, (unsigned long long)about.st_size, (long long)about.st_mtim.tv_sec,
                          about.st_mtim.tv_nsec, (unsigned long long)about.st_ino, (unsigned long long)about.st_dev,
                          form->format ? form->format : "", form->shape[0], form->shape[1], form->has_range, form->low,
                          form->high, (int)data->wrap, channel);
    free(real);
    return length < (int)KARST_IMAGE_KEY_BYTES;
}

/* A large image that was made ready earlier. */
static bool find_samples(karst_world_image *image, const char *path)
{
    char key[KARST_IMAGE_KEY_BYTES];
    karst_image_facts facts = {.num_channels = 1};
    for (uint32_t c = 0; c < facts.num_channels && c < 3; c++) {
        if (!key_of(image->data, path, c, key) ||
            !karst_samples_image_find(&image->channel[c], key, image->data->wrap, &facts)) {
            for (uint32_t i = 0; i < c; i++)
                karst_samples_image_finish(&image->channel[i]);
            return false;
        }
    }
    image->width = facts.width;
    image->height = facts.height;
    image->num_channels = facts.num_channels;
    memcpy(image->kind, facts.kind, sizeof image->kind);
    return true;
}

static void let_go_samples(const void *user) { karst_samples_let_go(user); }

static bool read_samples(karst_world_image *image, const char *path, karst_error *why)
{
    char key[KARST_IMAGE_KEY_BYTES];
    karst_samples samples = {0};
    if (find_samples(image, path))
        return true;
    bool done = karst_samples_read(path, &image->data->form, &samples, why);
    image->width = samples.width;
    image->height = samples.height;
    image->num_bits = samples.num_bits;
    memcpy(image->kind, samples.kind_text, sizeof image->kind);
    if (done)
        turn_rows(&samples);
    for (uint32_t c = 0; done && c < samples.num_channels; c++) {
        karst_image_room room = {
            .most_in_memory_bytes = KARST_IMAGE_MOST_IN_MEMORY_BYTES,
            .let_go = let_go_samples,
            .user = &samples,
            .facts = {.width = samples.width, .height = samples.height, .num_channels = samples.num_channels}};
        memcpy(room.facts.kind, image->kind, sizeof room.facts.kind);
        if (key_of(image->data, path, c, key))
            room.key = key;
        done = karst_samples_image_build_in(&image->channel[c], &room, samples.values + c, samples.width,
                                            samples.height, samples.num_channels, image->data->wrap, why);
        image->num_channels = c + 1;
    }
    karst_samples_finish(&samples);
    return done;
}

static bool read_volume(karst_world_image *image, const char *path, karst_error *why)
{
    karst_volume volume = {0};
    bool done = karst_volume_read(path, image->data->grid, &volume, why);
    image->width = volume.size[0];
    image->height = volume.size[1];
    image->depth = volume.size[2];
    image->voxel_m = volume.voxel_m;
    memcpy(image->first_m, volume.first_m, sizeof image->first_m);
    memcpy(image->kind, volume.kind_text, sizeof image->kind);
    done = done && karst_samples_field_build(&image->channel[0], volume.values, volume.size, image->data->wrap, why);
    image->num_channels = 1;
    karst_volume_finish(&volume);
    return done;
}

/* The file behind the data, read once. What it holds is in the list before anything can go wrong. */
static karst_world_image *find_image(karst_lower_state *s, const karst_header_data *data, bool is_field)
{
    for (karst_world_image *i = s->io->images; i; i = i->next)
        if (i->data == data && (i->depth > 0) == is_field)
            return i;
    char path[KARST_BESIDE_BYTES];
    karst_error why = {0};
    karst_world_image *image = calloc(1, sizeof *image);
    if (!image || !karst_path_beside(s->source->name, data->file, path, &why)) {
        free(image);
        karst_fail(&why, KARST_FAILED, "out of memory");
        bad_file(s, data, &why);
    }
    image->data = data;
    image->next = s->io->images;
    s->io->images = image;
    if (!(is_field ? read_volume(image, path, &why) : read_samples(image, path, &why)))
        bad_file(s, data, &why);
    return image;
}

/* Cells of the image in a metre along an axis, where so many metres hold all of its samples. */
static karst_expr cells_per_metre(karst_lower_state *s, const karst_world_image *image, int axis, karst_expr size)
{
    const int fold = image->data->wrap == KARST_WRAP_MIRROR ? 2 : 1;
    const karst_number cells =
        karst_number_divide(karst_number_int(image->channel[0].size[axis]), karst_number_int(fold));
    return karst_expr_2(s->graph, KARST_OP_DIVIDE, karst_graph_number(s->graph, KARST_TYPE_FLOAT, cells), size);
}

/* The channels at a place in metres. Samples lie in the middles of their cells. */
static void look_up(karst_lower_state *s, const karst_world_image *image, const karst_samples_image *texture,
                    const karst_expr size[2], const karst_expr place[2], karst_expr value[3])
{
    karst_graph *g = s->graph;
    karst_noise noise = {.base = KARST_NOISE_IMAGE, .shape = KARST_NOISE_SUM, .num_octaves = 1};
    karst_expr at[2];
    noise.gain = karst_graph_float(g, 0.5);
    noise.lacunarity = karst_graph_float(g, 2);
    for (int i = 0; i < 2; i++)
        at[i] = karst_expr_2(g, KARST_OP_SUBTRACT,
                             karst_expr_2(g, KARST_OP_MULTIPLY, place[i], cells_per_metre(s, image, i, size[i])),
                             karst_graph_float(g, 0.5));
    for (uint32_t c = 0; c < image->num_channels; c++) {
        noise.image = &image->channel[c];
        noise.texture = texture;
        noise.channel = texture ? (uint8_t)c : 0;
        value[c] = karst_graph_noise(g, noise, at[0], at[1], s->zero);
    }
}

static karst_world_image *image_called(karst_lower_state *s, const char *name, uint32_t where, bool is_field)
{
    const karst_header_data *data = find_data(s, name, where);
    if (s->graph->num_noises >= 4 * KARST_MAX_OCTAVES)
        karst_source_error(s->source, where, NULL, "there are more than %u different noises and images",
                           4 * KARST_MAX_OCTAVES);
    return find_image(s, data, is_field);
}

uint32_t karst_lower_image(karst_lower_state *s, const char *name, uint32_t where, const karst_expr place[2],
                           karst_expr value[3])
{
    const karst_header_data *data = find_data(s, name, where);
    if (!(data->size_m[0] > 0))
        karst_source_error(s->source, data->where, "write \"size\": [1000, 1000]: width and depth in metres",
                           "data '%s' has no size", data->name);
    const karst_world_image *image = image_called(s, name, where, false);
    karst_expr size[2];
    for (int i = 0; i < 2; i++)
        size[i] = karst_graph_number(s->graph, KARST_TYPE_FLOAT, karst_number_shortest(data->size_m[i]));
    look_up(s, image, NULL, size, place, value);
    return image->num_channels;
}

karst_expr karst_lower_field(karst_lower_state *s, const char *name, uint32_t where, const karst_expr place[3])
{
    karst_graph *g = s->graph;
    const karst_world_image *image = image_called(s, name, where, true);
    karst_noise noise = {.base = KARST_NOISE_IMAGE,
                         .shape = KARST_NOISE_SUM,
                         .num_octaves = 1,
                         .gain = karst_graph_float(g, 0.5),
                         .lacunarity = karst_graph_float(g, 2),
                         .image = &image->channel[0]};
    karst_expr at[3];
    const karst_number voxel_m = karst_number_shortest(image->voxel_m);
    for (int i = 0; i < 3; i++) {
        /* where sides were made powers of two, samples lie closer */
        const uint32_t samples = i == 0 ? image->width : i == 1 ? image->height : image->depth;
        const int fold = image->data->wrap == KARST_WRAP_MIRROR ? 2 : 1;
        const double ratio = (double)image->channel[0].size[i] / ((double)fold * samples);
        const karst_number per_metre = karst_number_divide(karst_number_double(ratio), voxel_m);
        const double first = (0.5 - image->first_m[i] / image->voxel_m) * ratio - 0.5;
        at[i] = karst_expr_2(
            g, KARST_OP_ADD,
            karst_expr_2(g, KARST_OP_MULTIPLY, place[i], karst_graph_number(g, KARST_TYPE_FLOAT, per_metre)),
            karst_graph_number(g, KARST_TYPE_FLOAT, karst_number_double(first)));
    }
    return karst_graph_noise(g, noise, at[0], at[1], at[2]);
}

/* What colours take of a file of 8 bits: all of its channels at once (ops/texture.clh). NULL: they take the image. */
static const karst_samples_image *texture_of(karst_lower_state *s, karst_world_image *image)
{
    karst_error why = {0};
    const uint32_t *size = image->channel[0].size;
    if (image->num_bits != 8 || (size_t)size[0] * size[1] > KARST_TEXTURE_MOST_SAMPLES)
        return NULL;
    if (!image->texture.words && !karst_samples_image_pack(&image->texture, image->channel, image->num_channels, &why))
        bad_file(s, image->data, &why);
    return &image->texture;
}

/* 0 where a is less than b by an eighth or more, 1 where it is greater by as much: exactly, so that whole packets leave
 * one side of a mix out. */
static karst_expr prevails(karst_lower_state *s, karst_expr a, karst_expr b)
{
    karst_graph *g = s->graph;
    karst_expr t = karst_expr_3(g, KARST_OP_FMA, karst_expr_2(g, KARST_OP_SUBTRACT, a, b), karst_graph_float(g, 4),
                                karst_graph_float(g, 0.5));
    t = karst_expr_2(g, KARST_OP_MIN, karst_expr_2(g, KARST_OP_MAX, t, karst_graph_float(g, 0)),
                     karst_graph_float(g, 1));
    return karst_expr_2(g, KARST_OP_MULTIPLY, karst_expr_2(g, KARST_OP_MULTIPLY, t, t),
                        karst_expr_3(g, KARST_OP_FMA, t, karst_graph_float(g, -2), karst_graph_float(g, 3)));
}

uint32_t karst_lower_texture(karst_lower_state *s, const char *name, uint32_t where, const karst_expr place[3],
                             const karst_expr normal[3], karst_expr size, karst_expr value[3])
{
    static const int axes[3][2] = {{2, 1}, {0, 2}, {0, 1}}; /* of the plane across each axis */
    karst_graph *g = s->graph;
    karst_world_image *image = image_called(s, name, where, false);
    if (image->data->wrap == KARST_WRAP_CLAMP)
        karst_source_error(s->source, image->data->where, "write \"wrap\": \"repeat\", or \"mirror\" if it shows seams",
                           "a texture goes on beyond its edges, and data '%s' does not", image->data->name);
    const karst_samples_image *texture = texture_of(s, image);
    karst_expr across[3][3], most[3];
    /* samples are as far apart one way as the other */
    const karst_expr ratio = karst_graph_number(
        g, KARST_TYPE_FLOAT, karst_number_divide(karst_number_int(image->height), karst_number_int(image->width)));
    const karst_expr sizes[2] = {size, karst_expr_2(g, KARST_OP_MULTIPLY, size, ratio)};
    for (int i = 0; i < 3; i++) {
        const karst_expr at[2] = {place[axes[i][0]], place[axes[i][1]]};
        look_up(s, image, texture, sizes, at, across[i]);
        most[i] = karst_expr_1(g, KARST_OP_ABS, normal[i]);
    }
    const karst_expr side = prevails(s, most[2], most[0]),
                     top = prevails(s, most[1], karst_expr_2(g, KARST_OP_MAX, most[0], most[2]));
    for (uint32_t c = 0; c < image->num_channels; c++)
        value[c] = karst_expr_3(g, KARST_OP_MIX, karst_expr_3(g, KARST_OP_MIX, across[0][c], across[2][c], side),
                                across[1][c], top);
    return image->num_channels;
}
