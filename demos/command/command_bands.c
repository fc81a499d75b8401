/* Pictures in bands of rows: the engine draws one after the other, and what is drawn goes to the file. So memory
 * follows the band, not the picture. Bands have the bytes of the whole: rows are drawn with a margin, whose pixels are
 * not kept.
 *
 * An exposure that follows the picture is known once all of its light is: until then that waits in a file without a
 * name. */
#include "command_bands.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "command_begun.h"

#define BAND_PX (1 << 20)  /* in a band, about */
#define WHOLE_PX (1 << 22) /* at most, of what is drawn at once */
#define ROWS KARST_IMAGE_EXR_ROWS
#define MARGIN KARST_ENGINE_WINDOW_MARGIN_PX

typedef struct {
    karst_engine *engine;
    const command_bands *b;
    command_talk *talk;
    command_record *record;
    karst_error *error;
    karst_error frame_error;
    const char *output; /* as written to: of stdout, another file */
    karst_image_writer *writer;
    command_layers layers; /* of an .exr */
    FILE *light;           /* of all rows, until it is metered; NULL: bytes are written at once */
    float *rgb;            /* of a band */
    uint8_t *rgba;         /* of a band with its margin */
    size_t room_px;        /* of both */
    int done_rows, rows;   /* before, and of, the band at hand */
    uint64_t start_ns, num_hits, num_pixels;
    double detail_given_px;
    bool settled;   /* all bands */
    bool too_large; /* the rows at hand are, for all the detail that is asked for */
    int drawn_rows; /* of the last window */
    karst_stats stats;
} run_state;

/* ---- which rows ---- */

/* By multiples of ROWS. */
static int band_rows(int width_px, int height_px, int wanted)
{
    const int rows = (wanted ? wanted : BAND_PX / width_px) / ROWS * ROWS;
    return rows < ROWS ? (height_px < ROWS ? height_px : ROWS) : rows < height_px ? rows : height_px;
}

/* One axis of what is drawn for `num` pixels from `first` on: with a margin on each side, which beside an edge of the
 * whole picture lies on the other. So bands are of one size. */
static void add_margin(int first, int num, int whole, int *from, int *size)
{
    *size = num + 2 * MARGIN < whole ? num + 2 * MARGIN : whole;
    *from = first - MARGIN < 0 ? 0 : first - MARGIN;
    if (*from > whole - *size)
        *from = whole - *size;
}

/* `rows` of them from row `done` of what is wanted on; near the end the window is as high all the same. */
static void find_window(const command_bands *b, int done, int rows, int drawn_px[4])
{
    add_margin(b->window_px[0], b->window_px[2], b->size_px[0], &drawn_px[0], &drawn_px[2]);
    add_margin(b->window_px[1] + done, rows, b->size_px[1], &drawn_px[1], &drawn_px[3]);
}

bool command_bands_suit(const int size_px[2], const int window_px[4], int rows)
{
    return rows > 0 || window_px[2] != size_px[0] || window_px[3] != size_px[1] ||
           (uint64_t)size_px[0] * (uint64_t)size_px[1] > WHOLE_PX;
}

void command_bands_first(const int size_px[2], const int window_px[4], int rows, int drawn_px[4])
{
    const command_bands b = {.size_px = size_px, .window_px = window_px};
    find_window(&b, 0, band_rows(window_px[2], window_px[3], rows), drawn_px);
}

/* ---- drawing ---- */

static bool note_frame(void *user, const karst_stats *stats)
{
    run_state *s = user;
    const double done = (double)s->done_rows + (double)s->rows * stats->num_samples / (double)s->b->num_samples;
    command_progress(s->talk, "rows %d to %d of %d   sample %u of %llu   %.1f %%   %llu bricks   %.1f s",
                     s->done_rows + 1, s->done_rows + s->rows, s->b->window_px[3], stats->num_samples,
                     (unsigned long long)s->b->num_samples, 100 * done / s->b->window_px[3],
                     (unsigned long long)stats->num_resident_bricks, (double)(command_clock_ns() - s->start_ns) / 1e9);
    /* Once a sample is there, detail is as it will be. */
    const uint32_t begun = s->b->begun ? command_begun_samples(s->b->begun) : 0;
    s->too_large =
        s->rows > ROWS && stats->num_samples > begun && stats->detail_given_px > stats->detail_asked_px * 1.001;
    return command_record_add(s->record, stats, &s->frame_error) && !s->too_large && !command_interrupted();
}

/* Room for a band of so many pixels. */
static bool make_room(run_state *s, size_t num_px, karst_error *error)
{
    if (num_px <= s->room_px)
        return true;
    free(s->rgba);
    free(s->rgb);
    s->rgba = malloc(num_px * 4);
    s->rgb = malloc(num_px * 3 * sizeof *s->rgb);
    s->room_px = s->rgba && s->rgb ? num_px : 0;
    return s->room_px || karst_fail(error, KARST_FAILED, "out of memory for a band of %zu pixels", num_px);
}

/* Samples that are there already, of the rows at hand; none of the margin, which is not kept. */
static bool give_sums(run_state *s, const int drawn_px[4], const int part_px[4], karst_error *error)
{
    const command_bands *b = s->b;
    const size_t num_values = 3 * (size_t)drawn_px[2] * (size_t)drawn_px[3];
    if (!b->begun)
        return true;
    float *sums = calloc(num_values, sizeof *sums);
    bool done = sums || karst_fail(error, KARST_FAILED, "out of memory for a band of %zu pixels", num_values / 3);
    done = done && command_begun_read(b->begun, s->done_rows, s->rows, s->rgb, error);
    for (int y = 0; done && y < s->rows; y++)
        memcpy(sums + 3 * ((size_t)(part_px[1] + y) * (size_t)drawn_px[2] + (size_t)part_px[0]),
               s->rgb + 3 * (size_t)y * (size_t)part_px[2], 3 * (size_t)part_px[2] * sizeof *sums);
    done = done && karst_engine_set_sums(s->engine, sums, num_values, command_begun_samples(b->begun), error);
    free(sums);
    return done;
}

/* The rows at hand, settled. *fits false: they do not, with all the detail that is asked for, but fewer may. */
static bool draw_rows(run_state *s, const int drawn_px[4], const int part_px[4], bool *fits, karst_error *error)
{
    const karst_engine_window window = {s->b->size_px[0], s->b->size_px[1], drawn_px[0], drawn_px[1]};
    bool settled = false;
    if (!make_room(s, (size_t)drawn_px[2] * (size_t)drawn_px[3], error) ||
        !karst_engine_set_window(s->engine, &window, drawn_px[2], drawn_px[3], error) ||
        !give_sums(s, drawn_px, part_px, error))
        return false;
    const bool ran = karst_engine_settle(s->engine, s->b->max_frames, note_frame, s, &settled, error);
    if (command_interrupted())
        return command_fail_interrupted(error, "interrupted after %d of %d rows; nothing was written", s->done_rows,
                                        s->b->window_px[3]);
    if (ran && s->frame_error.status != KARST_OK)
        return karst_fail(error, s->frame_error.status, "%s", s->frame_error.message);
    if (!ran)
        return false;
    karst_engine_stats(s->engine, &s->stats);
    s->drawn_rows = drawn_px[3];
    *fits = !s->too_large;
    if (!*fits)
        return true;
    s->settled = s->settled && settled;
    s->num_hits += s->stats.num_hits;
    s->num_pixels += s->stats.num_pixels;
    if (s->stats.detail_given_px > s->detail_given_px)
        s->detail_given_px = s->stats.detail_given_px;
    return true;
}

/* ---- writing ---- */

static bool keep_light(run_state *s, const int drawn_px[4], const int part_px[4], karst_error *error)
{
    const size_t num = 3 * (size_t)drawn_px[2] * (size_t)drawn_px[3];
    const size_t num_kept = 3 * (size_t)part_px[2] * (size_t)part_px[3];
    if (!karst_engine_read_radiance(s->engine, s->rgb, num, error))
        return false;
    command_crop(s->rgb, 3 * sizeof *s->rgb, drawn_px[2], part_px);
    errno = 0;
    return fwrite(s->rgb, sizeof *s->rgb, num_kept, s->light) == num_kept ||
           karst_fail(error, KARST_FAILED,
                      "cannot keep the light of the picture beside %s until its exposure is known: %s; with --exposure "
                      "STOPS that is not needed",
                      s->output, strerror(errno));
}

static bool keep_rows(run_state *s, const int drawn_px[4], const int part_px[4], karst_error *error)
{
    const size_t num = (size_t)drawn_px[2] * (size_t)drawn_px[3];
    if (s->light)
        return keep_light(s, drawn_px, part_px, error);
    if (!karst_engine_read_pixels(s->engine, s->rgba, num * 4, error))
        return false;
    if (command_is_exr(s->output))
        return command_layers_read(&s->layers, s->engine, s->rgba, drawn_px + 2, part_px, error) &&
               karst_image_add_channels(s->writer, s->layers.channels, s->layers.num_channels, part_px[3], error);
    command_crop(s->rgba, 4, drawn_px[2], part_px);
    return karst_image_add_bytes(s->writer, s->rgba, part_px[3], error);
}

static bool run_rows(run_state *s, karst_error *error)
{
    const int *wanted_px = s->b->window_px;
    s->rows = band_rows(wanted_px[2], wanted_px[3], s->b->rows);
    while (s->done_rows < wanted_px[3]) {
        int drawn_px[4];
        bool fits = false;
        const int high = s->rows; /* the window stays as high to the end */
        find_window(s->b, s->done_rows, high, drawn_px);
        if (s->rows > wanted_px[3] - s->done_rows)
            s->rows = wanted_px[3] - s->done_rows;
        const int part_px[4] = {wanted_px[0] - drawn_px[0], wanted_px[1] + s->done_rows - drawn_px[1], wanted_px[2],
                                s->rows};
        if (!draw_rows(s, drawn_px, part_px, &fits, error) || (fits && !keep_rows(s, drawn_px, part_px, error)))
            return false;
        if (fits)
            s->done_rows += s->rows;
        s->rows = fits ? high : high / 2 / ROWS * ROWS < ROWS ? ROWS : high / 2 / ROWS * ROWS;
    }
    return true;
}

/* Once all light is there: what the picture's exposure is, and its bytes. */
static bool tone(run_state *s, bool meters, karst_error *error)
{
    const int width_px = s->b->window_px[2], height_px = s->b->window_px[3];
    const int most = band_rows(width_px, height_px, s->b->rows), rows = most < s->drawn_rows ? most : s->drawn_rows;
    rewind(s->light);
    if (!make_room(s, (size_t)width_px * (size_t)rows, error))
        return false;
    for (int y = 0; y < height_px; y += rows) {
        const int high = rows < height_px - y ? rows : height_px - y;
        const size_t num = 3 * (size_t)width_px * (size_t)high;
        command_progress(s->talk, "%s: row %d of %d", meters ? "exposure" : "writing", y + 1, height_px);
        if (command_interrupted())
            return command_fail_interrupted(error, "interrupted; nothing was written");
        if (fread(s->rgb, sizeof *s->rgb, num, s->light) != num)
            return karst_fail(error, KARST_FAILED, "cannot read the light of the picture back: %s", strerror(errno));
        if (meters ? !karst_engine_meter(s->engine, s->rgb, width_px, high, error)
                   : !karst_engine_tone(s->engine, s->rgb, s->b->window_px[0], s->b->window_px[1] + y, width_px, high,
                                        s->rgba, error) ||
                         !karst_image_add_bytes(s->writer, s->rgba, high, error))
            return false;
    }
    return true;
}

static bool open_light(run_state *s, karst_error *error)
{
    char *name;
    const int fd = command_open_beside(s->output, "", &name);
    s->light = fd < 0 ? NULL : fdopen(fd, "w+b");
    if (s->light) {
        unlink(name);
        free(name);
        return true;
    }
    return karst_fail(error, KARST_FAILED, "cannot keep the light of the picture beside %s: %s", s->output,
                      strerror(errno));
}

static bool open_files(run_state *s, karst_error *error)
{
    const command_bands *b = s->b;
    const bool keeps_radiance = karst_engine_keeps_radiance(s->engine);
    if (command_is_exr(s->output)) {
        command_layers_init(&s->layers, b->exr.aovs, keeps_radiance);
        s->writer = karst_image_begin_exr(s->output, s->layers.names, s->layers.num_channels, b->exr.note,
                                          b->window_px[2], b->window_px[3], error);
    } else {
        s->writer = karst_image_begin_png(s->output, b->window_px[2], b->window_px[3], error);
    }
    if (s->writer)
        command_add_temporary(karst_image_temporary(s->writer));
    return s->writer && (command_is_exr(s->output) || b->has_exposure || !keeps_radiance || open_light(s, error));
}

static bool close_files(run_state *s, bool done, karst_error *error)
{
    char temporary[4200] = "";
    if (s->light)
        fclose(s->light);
    if (s->writer)
        snprintf(temporary, sizeof temporary, "%s", karst_image_temporary(s->writer));
    command_hold_interrupts(true);
    if (done)
        done = karst_image_end(s->writer, error);
    else
        karst_image_discard(s->writer);
    command_drop_temporary(temporary);
    command_hold_interrupts(false);
    command_layers_free(&s->layers);
    free(s->rgb);
    free(s->rgba);
    return done;
}

bool command_bands_run(karst_engine *engine, const command_bands *bands, command_talk *talk, command_record *record,
                       karst_error *error)
{
    char picture[4200];
    const bool to_stdout = strcmp(bands->output, "-") == 0;
    if (to_stdout && !command_begin_stdout(picture, sizeof picture, error))
        return false;
    run_state s = {.engine = engine,
                   .b = bands,
                   .talk = talk,
                   .record = record,
                   .output = to_stdout ? picture : bands->output,
                   .start_ns = command_clock_ns(),
                   .settled = true};
    bool done = open_files(&s, error) && run_rows(&s, error);
    if (done && bands->exr.note && !s.settled)
        done = karst_fail(error, KARST_FAILED,
                          "not settled within %u frames: nothing was written, as samples that lack something are not "
                          "gone on from; raise --frames-max",
                          bands->max_frames);
    if (done && s.light)
        done = tone(&s, true, error) && tone(&s, false, error);
    done = close_files(&s, done, error);
    command_end_progress(talk);
    if (to_stdout)
        done = command_end_stdout(picture, done, error);
    record->elapsed_ns = command_clock_ns() - s.start_ns;
    s.stats.num_hits = s.num_hits;
    s.stats.num_pixels = s.num_pixels;
    s.stats.detail_given_px = s.detail_given_px;
    if (!done || !command_record_picture(record, &s.stats, record->num_frames, s.settled, error))
        return false;
    record->last = s.stats;
    return true;
}
