/* Worlds from text, for tests of the reference tracer, and random rays. */
#ifndef KARST_TESTS_REFERENCE_WORLDS_H
#define KARST_TESTS_REFERENCE_WORLDS_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "karst/reference.h"
#include "producers/language/oracle/oracle.h"
#include "producers/density/world_file.h"
#include "reference/trace.h"

typedef struct {
    karst_world_file *file;
    karst_ranger *ranger;
    karst_oracle *oracle;
    karst_number values[64];
} world;

static inline void open_text(world *w, const char *text)
{
    karst_error error = {0};
    char *diagnostics = NULL;
    w->file = karst_world_file_compile("test.karst", text, strlen(text), NULL, 0, &diagnostics, &error);
    if (!w->file)
        fail_msg("%s\n%s", error.message, diagnostics ? diagnostics : "");
    free(diagnostics);
    const karst_program_graph *program = w->file->program;
    for (uint32_t i = 0; i < program->num_parameters; i++)
        w->values[i] = program->parameters[i].value;
    w->ranger = karst_ranger_create(program, w->values, program->header.seed, &error);
    w->oracle =
        karst_oracle_create(&program->world, w->values, program->header.seed, program->header.voxel_log2_m, &error);
    assert_non_null(w->ranger);
    assert_non_null(w->oracle);
}

static inline void close_world(world *w)
{
    karst_oracle_destroy(w->oracle);
    karst_ranger_destroy(w->ranger);
    karst_world_file_destroy(w->file);
}

/* float density(vec3 p) with voxels of a metre. */
static inline void open_body(world *w, const char *body)
{
    char text[4096];
    snprintf(text, sizeof text, "/*{ \"voxel\": 1 }*/\nfloat density(vec3 p) { %s }\n", body);
    open_text(w, text);
}

static uint32_t random_state = 1;
static inline double random_unit(void)
{
    random_state = random_state * 1664525u + 1013904223u;
    return (random_state >> 8) * 0x1p-24;
}

static inline void random_direction(double d[3])
{
    double square;
    do {
        square = 0;
        for (int i = 0; i < 3; i++) {
            d[i] = 2 * random_unit() - 1;
            square += d[i] * d[i];
        }
    } while (square > 1 || square < 0.01);
    for (int i = 0; i < 3; i++)
        d[i] /= sqrt(square);
}

static inline karst_reference_root shoot(world *w, const karst_position *from, const double d[3], double t_max)
{
    karst_reference_ray ray = {.direction = {d[0], d[1], d[2]}, .t_max = t_max, .max_intervals = 1u << 20};
    return karst_reference_first(w->ranger, from, &ray);
}

#endif
