/* The kernels of a density program, all three steps of them, and their compilation beside other work. */
#ifndef KARST_PRODUCERS_KERNELS_H
#define KARST_PRODUCERS_KERNELS_H

#include "producers/channels.h"
#include "producers/density/density_producer.h"
#include "producers/steps/evaluate.h"
#include "producers/steps/finalise.h"
#include "producers/steps/load.h"
#include "producers/steps/subdivide.h"

/* Loads are made by a loader, or in two steps by an evaluator and a finaliser: the other is NULL. */
typedef struct {
    karst_subdivider *subdivider;
    karst_loader *loader;
    karst_evaluator *evaluator;
    karst_finaliser *finaliser;
} karst_kernels;

/* Whether it is a loader's. */
bool karst_density_program_is_in_one(const karst_density_program *program, const karst_context *context);

/* Builds them; drivers may compile the rest when they first run. What was built before a failure is destroyed. Errors:
 * KARST_FAILED. */
bool karst_kernels_create(karst_kernels *kernels, karst_context *context, const karst_density_program *program,
                          const karst_channel_layout *layout, karst_error *error);
/* All but the subdivider. */
bool karst_kernels_create_for_loads(karst_kernels *kernels, karst_context *context,
                                    const karst_density_program *program, const karst_channel_layout *layout,
                                    karst_error *error);
void karst_kernels_destroy(karst_kernels *kernels); /* zeroed ones are fine */
void karst_kernels_set_data(karst_kernels *kernels, const karst_buffer *data);

/* Makes what a program borrows its own, with or without its data, which is NULL else. false: out of memory; to be freed
 * all the same. */
bool karst_density_program_copy(karst_density_program *program, bool with_data);
void karst_density_program_free(karst_density_program *program); /* a zeroed one is fine */

/* A thread that builds them, for a program whose loads are made in one, and runs each once, in a fork of the context
 * (karst_context_fork), so that nothing is left to be compiled afterwards. First what loads (with soon_options, if
 * there are any), then bounds, which takes longest, and what loads without them. */
typedef struct karst_compilation karst_compilation;

/* Starts it; keeps copies of program and layout. It stops after the first step, until it is told to go on. Errors:
 * KARST_FAILED. */
karst_compilation *karst_compilation_start(karst_context *context, const karst_density_program *program,
                                           const karst_channel_layout *layout, karst_error *error);
/* How many steps are done: 1, there is a loader; 2, and a subdivider; KARST_NUM_KERNELS, all is there, or it failed. */
#define KARST_NUM_KERNELS 3u
uint32_t karst_compilation_num_ready(const karst_compilation *compilation);
void karst_compilation_go_on(karst_compilation *compilation);
/* Waits until so many are done. */
void karst_compilation_wait(karst_compilation *compilation, uint32_t num);
/* The same, for so long at most. */
void karst_compilation_wait_for(karst_compilation *compilation, uint32_t num, uint64_t most_ns);
/* Puts what is ready since the last time into `kernels`: it is the context's from now on, and the caller's. What it
 * replaces must be done. Errors: what went wrong there. */
bool karst_compilation_take(karst_compilation *compilation, karst_kernels *kernels, karst_error *error);
/* Waits for the end of the step that it is at. NULL is fine. */
void karst_compilation_destroy(karst_compilation *compilation);

#endif
