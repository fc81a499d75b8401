/* karst sample --ray: a world's medium along a ray. */
#include "command.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <jansson.h>

/* Six parts; the first three are decimals of any length. `copy` is written to. */
static bool parse(const karst_world *world, const char *text, char *copy, karst_medium_ray *ray, karst_error *error)
{
    char *part[6], *rest = copy;
    bool good = true;
    for (int i = 0; i < 6; i++) {
        part[i] = rest;
        rest += strcspn(rest, ",");
        good = good && (*rest == ',') == (i < 5);
        if (*rest)
            *rest++ = '\0';
    }
    for (int i = 0; good && i < 3; i++) {
        char *end;
        ray->direction[i] = strtod(part[3 + i], &end);
        good = end != part[3 + i] && !*end && isfinite(ray->direction[i]);
    }
    karst_error why = {0};
    if (!good)
        return karst_fail(error, KARST_USAGE,
                          "--ray %.80s: must be six numbers, a point in metres and a direction, such as 0,1500,0,1,0,0",
                          text);
    return karst_position_parse(part[0], part[1], part[2], karst_world_get_metadata(world)->voxel_log2_m, &ray->from,
                                &why) ||
           karst_fail(error, KARST_USAGE, "--ray %.80s: %s", text, why.message);
}

static json_t *number(double value) { return isfinite(value) ? json_real(value) : json_null(); }

static bool print_json(const karst_world *world, const karst_medium_ray *ray, const karst_medium_depth *depth,
                       karst_error *error)
{
    json_t *object = json_object(), *from = json_array(), *direction = json_array();
    for (int axis = 0; axis < 3; axis++) {
        char text[160];
        karst_coordinate_format(ray->from.voxel[axis], ray->from.fraction[axis],
                                karst_world_get_metadata(world)->voxel_log2_m, text, sizeof text);
        json_array_append_new(from, json_string(text));
        json_array_append_new(direction, number(ray->direction[axis]));
    }
    json_object_set_new(object, "from", from);
    json_object_set_new(object, "direction", direction);
    json_object_set_new(object, "hit_m", number(depth->hit_m));
    json_object_set_new(object, "length_m", number(depth->length_m));
    json_object_set_new(object, "optical_depth", number(depth->optical_depth));
    json_object_set_new(object, "oracle_optical_depth", number(depth->oracle_optical_depth));
    json_object_set_new(object, "transmittance", number(depth->transmittance));
    char *text = json_dumps(object, JSON_COMPACT | JSON_PRESERVE_ORDER);
    json_decref(object);
    if (!text)
        return karst_fail(error, KARST_FAILED, "out of memory");
    puts(text);
    free(text);
    return true;
}

bool command_sample_ray(const karst_world *world, const char *text, const command_ray_look *look, karst_error *error)
{
    karst_medium_ray ray = {
        .footprint_m = look->footprint_m, .device = look->device, .log = look->log, .time_s = look->time_s};
    karst_medium_depth depth;
    char *copy = strdup(text);
    bool done = copy ? parse(world, text, copy, &ray, error) : karst_fail(error, KARST_FAILED, "out of memory");
    free(copy);
    if (!done || !karst_world_medium_depth(world, &ray, &depth, error))
        return false;
    if (look->json)
        return print_json(world, &ray, &depth, error);
    printf("%sray            %s\n", look->is_later ? "\n" : "", text);
    if (isfinite(depth.hit_m))
        printf("hit            %.9g m\n", depth.hit_m);
    else
        printf("hit            none within %.9g m\n", depth.length_m);
    printf("optical depth  %.9g\noracle         %.9g\ntransmittance  %.9g\n", depth.optical_depth,
           depth.oracle_optical_depth, depth.transmittance);
    return true;
}
