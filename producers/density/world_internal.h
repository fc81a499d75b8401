/* What an opened world is made of. Private to world.c and sampler.c. */
#ifndef KARST_PRODUCERS_WORLD_INTERNAL_H
#define KARST_PRODUCERS_WORLD_INTERNAL_H

#include "karst/world.h"
#include "producers/language/graph/derive.h"
#include "producers/language/oracle/oracle.h"
#include "producers/density/world_file.h"
#include "producers/points/model_list.h"

struct karst_world {
    karst_world_file *whole;
    karst_world_file *file;        /* it, or the content of it that was asked for */
    karst_gradient_world *derived; /* NULL: it would be too large */
    uint64_t *data;                /* of the density's tape */
    /* Samplers clone them. */
    karst_oracle *oracle, *gradient_oracle;
    char *path;
    karst_world_metadata metadata;
    karst_parameter_info *parameters;
    karst_model_list models; /* without data: none */
};

#endif
