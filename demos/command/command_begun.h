/* Pictures that are begun: an .exr of fewer samples, which more are added to. See command_begun.c. */
#ifndef KARST_DEMOS_COMMAND_BEGUN_H
#define KARST_DEMOS_COMMAND_BEGUN_H

#include "command.h"

/* What a picture's light depends on, with its number of samples, as JSON: the note of an .exr that holds sums.
 * Malloc'ed. `camera` as karst_camera_format gives it,
 * `time_s` the world's. Errors: KARST_FAILED (memory, a file that cannot be read). */
char *command_describe_picture(const karst_engine_config *config, const char *camera, double time_s,
                               const int size_px[2], const int window_px[4], karst_error *error);

typedef struct command_begun command_begun;
/* Opens `file` if it is there, and compares its note with `note`. *begun: its samples; NULL: there are none yet, or
 * (*is_done) as many as wanted. Errors: KARST_BAD_DATA (no .exr, not one with sums, of another picture, which its
 * message says in what, or with more samples). */
bool command_begun_open(const char *file, const char *note, command_begun **begun, bool *is_done, karst_error *error);
uint32_t command_begun_samples(const command_begun *begun);
/* How fine the picture of `file` is, if it is there and says so; else *detail_px stays. Errors: KARST_BAD_DATA. */
bool command_begun_detail(const char *file, double *detail_px, karst_error *error);
/* The sums of rows, three floats a pixel. Errors: KARST_BAD_DATA. */
bool command_begun_read(command_begun *begun, int y_px, int num_rows, float *sums, karst_error *error);
/* All of them to an engine that draws the whole picture. Errors: also KARST_FAILED. */
bool command_begun_give(command_begun *begun, karst_engine *engine, const int size_px[2], karst_error *error);
void command_begun_close(command_begun *begun); /* NULL is fine */

#endif
