/* Kinds of layers that a world's header names, such as models and particles: how one is made of a header, and what it
 * does when values of parameters or the time change. Each kind fills in one karst_layer_kind in its own room;
 * core/engine/engine_layers.c has the list, and does the rest. */
#ifndef KARST_PRODUCERS_LAYER_KIND_H
#define KARST_PRODUCERS_LAYER_KIND_H

#include "producers/language/language.h"
#include "producers/layer.h"

/* What a layer is made of. It borrows everything. */
typedef struct {
    karst_context *context;
    const karst_program_graph *program; /* with its header, and the name that paths begin beside */
    const karst_number *values;         /* of its parameters */
    int voxel_log2_m;
    double time_s;
    const karst_log *log; /* NULL: nothing is said */
} karst_layer_scene;

/* Whose bricks it changes. */
typedef enum { KARST_LAYER_LAND, KARST_LAYER_CLEAR, KARST_LAYER_AIR } karst_layer_place;

typedef struct {
    karst_layer_place place;
    bool (*is_named)(const karst_program_graph *program);
    /* Of a program that names it. Errors: KARST_BAD_DATA (files it names), KARST_USAGE, KARST_FAILED. */
    karst_layer *(*create)(const karst_layer_scene *scene, karst_error *error);
    /* Whether two programs that name it, of one voxel, have the same content of this kind. NULL: never. */
    bool (*is_same)(const karst_program_graph *a, const karst_program_graph *b);
    /* The scene has other values, or, with values NULL, another time alone. What changed is dirty. Work that is
     * enqueued must be done. NULL: it stands still. Errors: as create, before anything has changed. */
    bool (*move)(karst_layer *layer, const karst_layer_scene *scene, karst_error *error);
    bool (*has_colours)(const karst_layer *layer); /* NULL: no */
} karst_layer_kind;

#endif
