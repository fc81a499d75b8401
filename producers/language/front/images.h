/* The data of a header that a text uses, read. */
#ifndef KARST_LANGUAGE_IMAGES_H
#define KARST_LANGUAGE_IMAGES_H

#include "producers/language/front/header.h"

typedef struct karst_world_image karst_world_image;
struct karst_world_image {
    karst_world_image *next;
    const karst_header_data *data;
    uint32_t width, height, depth, num_channels; /* of the file; depth: 0 but for fields */
    double voxel_m, first_m[3];                  /* of fields: how far samples lie apart, where the first one lies */
    char kind[40];                               /* "PNG, 16 bits" */
    uint32_t num_bits;                           /* of whole numbers in the file; 0: others */
    karst_samples_image channel[3];
    karst_samples_image texture; /* of all channels, once a text asks for one */
};

void karst_world_images_free(karst_world_image *list);

#endif
