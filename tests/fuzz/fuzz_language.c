/* clang-format off */
/* Fuzzes the front end of the world language: any bytes must give a world or a diagnostic, soon; a world must evaluate.
 *
 *   F=producers/language
 *   clang -g -O1 -fsanitize=fuzzer,address,undefined -fno-sanitize-recover=undefined -std=c11 -D_GNU_SOURCE \
 *     -ffp-contract=off -I. -Icore/include tests/fuzz/fuzz_language.c build/release/embedded_kernels.c core/error.c \
 *     $F/affine.c $F/arena.c $F/canonical.c $F/data.c $F/functions.c $F/graph.c $F/header.c $F/kinds.c $F/language.c \
 *     $F/lexer.c $F/lower*.c $F/macro.c $F/number.c $F/oracle*.c $F/parse*.c $F/ranges.c $F/source.c $F/types.c \
 *     $F/uniform.c $F/widen.c -ljansson -lm -o build/fuzz_language
 *   build/fuzz_language -timeout=5 -rss_limit_mb=1500 -max_len=20000 -max_total_time=60 CORPUS tests/language/pasted
 */
/* clang-format on */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include "producers/language/language.h"
#include "producers/language/oracle.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void require(bool holds, const char *what)
{
    if (holds)
        return;
    fprintf(stderr, "fuzz_language: %s\n", what);
    abort();
}

static void evaluate(const karst_program_graph *program)
{
    karst_number parameters[KARST_HEADER_MAX_PARAMETERS + 16];
    for (uint32_t i = 0; i < program->num_parameters; i++)
        parameters[i] = program->parameters[i].value;
    karst_oracle *oracle =
        karst_oracle_create(&program->world, parameters, program->header.seed, program->header.voxel_log2_m, NULL);
    if (!oracle)
        return; /* memory */
    const karst_position places[] = {{{0, 0, 0}, {0, 0, 0}},
                                     {{1000, -7, 3}, {1, 0x80000000u, 77}},
                                     {{INT64_C(1) << 60, -(INT64_C(1) << 61), 5}, {9, 8, 7}}};
    const float up[3] = {0, 1, 0};
    karst_oracle_value rgb[3];
    for (size_t i = 0; i < sizeof places / sizeof *places; i++) {
        karst_oracle_density(oracle, &places[i], (int)i - 1);
        if (program->has_colour)
            karst_oracle_colour(oracle, &places[i], up, -1, rgb);
    }
    karst_oracle_destroy(oracle);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    bool ok;
    karst_error error = {0};
    karst_program_graph *program = karst_language_compile("fuzz", (const char *)data, size, NULL, 0, &ok, &error);
    require(program != NULL, "no program");
    if (ok) {
        const char *fault = NULL;
        require(karst_graph_check(&program->graph, &fault), fault);
        require(karst_graph_check(&program->resolved, &fault), fault);
        for (uint32_t e = 1; e < program->resolved.num_nodes; e++)
            require(program->resolved.nodes[e].op != KARST_OP_POSITION, "a position was left");
        evaluate(program);
    } else {
        require(error.status == KARST_BAD_WORLD && error.message[0], "no error");
    }
    karst_program_graph_destroy(program);
    return 0;
}
