/* Worlds from text, for tests: compile, evaluate, read files. Whatever fails ends the test. */
#ifndef KARST_TESTS_LANGUAGE_WORLD_TEXT_H
#define KARST_TESTS_LANGUAGE_WORLD_TEXT_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "producers/language/language.h"
#include "producers/language/oracle/oracle.h"

typedef struct {
    karst_program_graph *program;
    karst_oracle *oracle;
} text_world;

/* All diagnostics, one below the other; the caller frees. */
static inline char *diagnostics_text(const karst_program_graph *program)
{
    size_t size = 1;
    for (const karst_diagnostic *d = program->diagnostics; d; d = d->next)
        size += strlen(d->text) + 1;
    char *text = calloc(1, size);
    assert_non_null(text);
    for (const karst_diagnostic *d = program->diagnostics; d; d = d->next)
        strcat(strcat(text, d->text), d->next ? "\n" : "");
    return text;
}

static inline text_world world_of(const char *text, size_t length, const char *name)
{
    bool ok;
    karst_error error = {0};
    const char *fault = NULL;
    text_world w = {.program = karst_language_compile(name, text, length, NULL, 0, &ok, &error)};
    assert_non_null(w.program);
    if (!ok) {
        char *all = diagnostics_text(w.program);
        fail_msg("%s", all);
    }
    if (!karst_graph_check(&w.program->graph, &fault) || !karst_graph_check(&w.program->resolved, &fault))
        fail_msg("%s: %s", name, fault);
    karst_number parameters[KARST_HEADER_MAX_PARAMETERS + 16];
    for (uint32_t i = 0; i < w.program->num_parameters; i++)
        parameters[i] = w.program->parameters[i].value;
    w.oracle = karst_oracle_create(&w.program->world, parameters, w.program->header.seed,
                                   w.program->header.voxel_log2_m, &error);
    assert_non_null(w.oracle);
    return w;
}

static inline text_world world_from_text(const char *text) { return world_of(text, strlen(text), "world.karst"); }

/* float density(vec3 p) with this body. */
static inline text_world world_from_body(const char *body)
{
    char text[8192];
    assert_true(snprintf(text, sizeof text, "float density(vec3 p) {\n%s\n}\n", body) < (int)sizeof text);
    return world_from_text(text);
}

static inline void world_finish(text_world *w)
{
    karst_oracle_destroy(w->oracle);
    karst_program_graph_destroy(w->program);
}

/* The position nearest to x, y, z metres. */
static inline karst_position position_at(const text_world *w, double x, double y, double z)
{
    const double m[3] = {x, y, z};
    karst_position at;
    for (int i = 0; i < 3; i++) {
        double voxels = ldexp(m[i], -w->program->header.voxel_log2_m);
        at.voxel[i] = (int64_t)floor(voxels);
        at.fraction[i] = (uint32_t)((voxels - floor(voxels)) * 0x1p32);
    }
    return at;
}

static inline karst_oracle_value density_at(text_world *w, double x, double y, double z)
{
    karst_position at = position_at(w, x, y, z);
    return karst_oracle_density(w->oracle, &at, -1);
}

/* What an expression is worth where p = (x, y, z). */
static inline karst_oracle_value value_of(const char *expression, double x, double y, double z)
{
    char body[4096];
    assert_true(snprintf(body, sizeof body, "return float(%s);", expression) < (int)sizeof body);
    text_world w = world_from_body(body);
    karst_oracle_value v = density_at(&w, x, y, z);
    world_finish(&w);
    return v;
}

static inline void assert_near(double a, double b, double within, const char *what)
{
    if (!(fabs(a - b) <= within))
        fail_msg("%s: %.17g, not %.17g (within %g)", what, a, b, within);
}

static inline char *read_text(const char *path, size_t *length)
{
    FILE *file = fopen(path, "rb");
    if (!file)
        fail_msg("%s cannot be read (run tests from the repository's root)", path);
    char *text = calloc(1, (1 << 20) + 2);
    assert_non_null(text);
    *length = fread(text, 1, (1 << 20) + 1, file);
    fclose(file);
    return text;
}

#endif
