/* Pictures in bands: what is too large to be drawn at once, and parts of pictures. See command_bands.c. */
#ifndef KARST_DEMOS_COMMAND_BANDS_H
#define KARST_DEMOS_COMMAND_BANDS_H

#include "command.h"

typedef struct command_begun command_begun; /* command_begun.c */

/* What is drawn, and where it goes. */
typedef struct {
    const int *size_px;   /* of the whole picture */
    const int *window_px; /* x, y, width, height of what is drawn of it */
    const char *output;   /* a .png, an .exr, "-" */
    command_exr exr;
    bool has_exposure; /* it does not follow the picture */
    uint64_t num_samples;
    uint32_t max_frames; /* to settle a band */
    int rows;            /* of a band; 0: what suits */
    command_begun *begun; /* samples that are there already; NULL: none */
} command_bands;

/* Whether it is to be drawn so: a window, more pixels than at once, or by so many rows (0: what suits). */
bool command_bands_suit(const int size_px[2], const int window_px[4], int rows);
/* The window of the whole picture that the engine is to be made with: x, y, width, height. */
void command_bands_first(const int size_px[2], const int window_px[4], int rows, int drawn_px[4]);
/* Draws and writes all of it; fills `record` as command_record_picture and the frames do. Errors: KARST_FAILED, also of
 * an interruption, which leaves nothing. */
bool command_bands_run(karst_engine *engine, const command_bands *bands, command_talk *talk, command_record *record,
                       karst_error *error);

#endif
