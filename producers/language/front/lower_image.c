/* image(NAME, p): samples of a file of the header's, as a function. */
#include <stdlib.h>
#include <string.h>

#include "core/base/beside.h"
#include "producers/language/front/lower_internal.h"

void karst_world_images_free(karst_world_image *list)
{
    while (list) {
        karst_world_image *next = list->next;
        for (int c = 0; c < 3; c++)
            karst_samples_image_finish(&list->channel[c]);
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
    for (size_t top = 0, bottom = samples->height; bottom-- > top; top++)
        for (size_t i = 0; i < in_row; i++) {
            float kept = samples->values[top * in_row + i];
            samples->values[top * in_row + i] = samples->values[bottom * in_row + i];
            samples->values[bottom * in_row + i] = kept;
        }
}

/* The file behind the data, read once. What it holds is in the list before anything can go wrong. */
static const karst_world_image *find_image(karst_lower_state *s, const karst_header_data *data)
{
    for (karst_world_image *i = s->io->images; i; i = i->next)
        if (i->data == data)
            return i;
    char path[KARST_BESIDE_BYTES];
    karst_error why = {0};
    karst_samples samples = {0};
    karst_world_image *image = calloc(1, sizeof *image);
    if (!image || !karst_path_beside(s->source->name, data->file, path, &why)) {
        free(image);
        karst_fail(&why, KARST_FAILED, "out of memory");
        bad_file(s, data, &why);
    }
    image->data = data;
    image->next = s->io->images;
    s->io->images = image;
    bool done = karst_samples_read(path, &data->form, &samples, &why);
    image->width = samples.width;
    image->height = samples.height;
    memcpy(image->kind, samples.kind_text, sizeof image->kind);
    if (done)
        turn_rows(&samples);
    for (uint32_t c = 0; done && c < samples.num_channels; c++) {
        done = karst_samples_image_build(&image->channel[c], samples.values + c, samples.width, samples.height,
                                         samples.num_channels, data->wrap, &why);
        image->num_channels = c + 1;
    }
    karst_samples_finish(&samples);
    if (!done)
        bad_file(s, data, &why);
    return image;
}

/* A coordinate in metres in cells of the image, whose samples lie in the middles of theirs. */
static karst_expr in_cells(karst_lower_state *s, const karst_world_image *image, int axis, karst_expr metres)
{
    karst_graph *g = s->graph;
    const int fold = image->data->wrap == KARST_WRAP_MIRROR ? 2 : 1;
    karst_number cells =
        karst_number_divide(karst_number_divide(karst_number_int(image->channel[0].size[axis]), karst_number_int(fold)),
                            karst_number_shortest(image->data->size_m[axis]));
    return karst_expr_2(g, KARST_OP_SUBTRACT,
                        karst_expr_2(g, KARST_OP_MULTIPLY, metres, karst_graph_number(g, KARST_TYPE_FLOAT, cells)),
                        karst_graph_float(g, 0.5));
}

uint32_t karst_lower_image(karst_lower_state *s, const char *name, uint32_t where, const karst_expr place[2],
                           karst_expr value[3])
{
    const karst_header_data *data = find_data(s, name, where);
    if (!(data->size_m[0] > 0))
        karst_source_error(s->source, data->where, "write \"size\": [1000, 1000]: width and depth in metres",
                           "data '%s' has no size", data->name);
    const karst_world_image *image = find_image(s, data);
    if (s->graph->num_noises >= 4 * KARST_MAX_OCTAVES)
        karst_source_error(s->source, where, NULL, "there are more than %u different noises and images",
                           4 * KARST_MAX_OCTAVES);
    karst_noise noise = {.base = KARST_NOISE_IMAGE, .shape = KARST_NOISE_SUM, .num_octaves = 1};
    noise.gain = karst_graph_float(s->graph, 0.5);
    noise.lacunarity = karst_graph_float(s->graph, 2);
    karst_expr at[2];
    for (int i = 0; i < 2; i++)
        at[i] = in_cells(s, image, i, place[i]);
    for (uint32_t c = 0; c < image->num_channels; c++) {
        noise.image = &image->channel[c];
        value[c] = karst_graph_noise(s->graph, noise, at[0], at[1], s->zero);
    }
    return image->num_channels;
}
