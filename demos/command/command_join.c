/* karst verify --join: tiles become a picture. All tiles that lie beside one another are read at once, some rows of
 * each, so no tile is ever in memory, nor the picture. */
#include "command_farm.h"

#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

#define ROWS_AT_ONCE 16
/* Files that are open beside tiles. */
#define OTHER_FILES 64

typedef struct {
    karst_image_reader *reader;
    char *name;
    int x_px, width_px;
} tile;

typedef struct {
    const char *manifest;
    const command_manifest_file *job;
    tile *tiles; /* those of a row of tiles, from the left */
    size_t num_tiles;
    int y_px, height_px; /* of that row */
    uint8_t *rows;       /* ROWS_AT_ONCE of the picture, RGBA */
    uint8_t *part;       /* and of a tile */
    karst_image_writer *writer;
} joining;

/* Tiles of a very wide picture may be more than a process may open unless it asks. */
static void allow_files(size_t num)
{
    struct rlimit limit;
    if (getrlimit(RLIMIT_NOFILE, &limit) != 0 || limit.rlim_cur >= num + OTHER_FILES)
        return;
    limit.rlim_cur = limit.rlim_max < num + OTHER_FILES ? limit.rlim_max : (rlim_t)(num + OTHER_FILES);
    setrlimit(RLIMIT_NOFILE, &limit);
}

static void close_tiles(joining *j)
{
    for (size_t i = 0; i < j->num_tiles; i++) {
        karst_image_close(j->tiles[i].reader);
        free(j->tiles[i].name);
    }
    j->num_tiles = 0;
}

static bool open_tile(joining *j, size_t index, const int window_px[4], karst_error *error)
{
    tile *t = &j->tiles[j->num_tiles++];
    int width_px, height_px;
    *t = (tile){.x_px = window_px[0], .width_px = window_px[2]};
    t->name = command_manifest_name(j->manifest, j->job->output, true, j->job->num, index);
    if (!t->name)
        return karst_fail(error, KARST_FAILED, "out of memory");
    t->reader = karst_image_open_png(t->name, &width_px, &height_px, error);
    if (t->reader && (width_px != window_px[2] || height_px != window_px[3]))
        return karst_fail(error, KARST_BAD_DATA, "%s: has %dx%d pixels instead of %dx%d", t->name, width_px, height_px,
                          window_px[2], window_px[3]);
    return t->reader != NULL;
}

/* Opens the tiles that begin at the height of tile *index, which moves on to the next row of tiles. */
static bool open_tiles(joining *j, size_t *index, karst_error *error)
{
    int window_px[4];
    close_tiles(j);
    for (bool first = true; *index < j->job->num; first = false, (*index)++) {
        if (!command_part_tile((command_part){(uint32_t)*index + 1, (uint32_t)j->job->num}, j->job->size_px, window_px,
                               error))
            return false;
        if (!first && window_px[1] != j->y_px)
            break;
        j->y_px = window_px[1];
        j->height_px = window_px[3];
        tile *grown = realloc(j->tiles, (j->num_tiles + 1) * sizeof *grown);
        if (!grown)
            return karst_fail(error, KARST_FAILED, "out of memory");
        j->tiles = grown;
        allow_files(j->num_tiles + 1);
        if (!open_tile(j, *index, window_px, error))
            return false;
    }
    return true;
}

static bool copy_rows(joining *j, int num_rows, karst_error *error)
{
    const size_t row_bytes = (size_t)j->job->size_px[0] * 4;
    for (size_t i = 0; i < j->num_tiles; i++) {
        const tile *t = &j->tiles[i];
        const size_t part_bytes = (size_t)t->width_px * 4;
        if (!karst_image_read_bytes(t->reader, j->part, num_rows, error))
            return false;
        for (int y = 0; y < num_rows; y++)
            memcpy(j->rows + (size_t)y * row_bytes + (size_t)t->x_px * 4, j->part + (size_t)y * part_bytes, part_bytes);
    }
    return karst_image_add_bytes(j->writer, j->rows, num_rows, error);
}

static bool join(joining *j, command_talk *talk, karst_error *error)
{
    for (size_t index = 0; index < j->job->num;) {
        if (!open_tiles(j, &index, error))
            return false;
        for (int y = 0; y < j->height_px; y += ROWS_AT_ONCE) {
            command_progress(talk, "joining row %d of %d", j->y_px + y + 1, j->job->size_px[1]);
            if (command_interrupted())
                return command_fail_interrupted(error, "interrupted");
            if (!copy_rows(j, j->height_px - y < ROWS_AT_ONCE ? j->height_px - y : ROWS_AT_ONCE, error))
                return false;
        }
    }
    return true;
}

/* The file appears, or what was written of it goes. */
static bool end_file(karst_image_writer *writer, bool done, karst_error *error)
{
    char temporary[4200];
    snprintf(temporary, sizeof temporary, "%s", karst_image_temporary(writer));
    command_hold_interrupts(true);
    if (done)
        done = karst_image_end(writer, error);
    else
        karst_image_discard(writer);
    command_drop_temporary(temporary);
    command_hold_interrupts(false);
    return done;
}

bool command_join(const char *manifest, const command_manifest_file *job, const char *output, command_talk *talk,
                  karst_error *error)
{
    const size_t bytes = (size_t)job->size_px[0] * ROWS_AT_ONCE * 4;
    joining j = {.manifest = manifest, .job = job, .rows = malloc(bytes), .part = malloc(bytes)};
    bool done =
        (j.rows && j.part) || karst_fail(error, KARST_FAILED, "out of memory for rows of %d pixels", job->size_px[0]);
    if (done)
        j.writer = karst_image_begin_png(output, job->size_px[0], job->size_px[1], error);
    if (j.writer) {
        command_add_temporary(karst_image_temporary(j.writer));
        done = end_file(j.writer, join(&j, talk, error), error);
    }
    command_end_progress(talk);
    close_tiles(&j);
    free(j.tiles);
    free(j.rows);
    free(j.part);
    return done && j.writer;
}
