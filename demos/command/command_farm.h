/* Jobs: a flight or a picture in parts that many processes draw, each by itself, and the manifest of what is done. See
 * docs/FARM.md.
 *
 *   command_parts.c     which pictures or which tile a part is, and the commands of a job
 *   command_manifest.c  what a part has done: pictures, their sizes and checksums, and what they were made from
 *   command_join.c      tiles put together, row by row
 *   command_verify.c    karst verify
 */
#ifndef KARST_DEMOS_COMMAND_FARM_H
#define KARST_DEMOS_COMMAND_FARM_H

#include "command.h"

/* ---- command_parts.c ---- */

#define COMMAND_MAX_PARTS 100000
#define COMMAND_MAX_PICTURES 10000000

/* Part `number` (from 1) of `num`; num 0: all of it. */
typedef struct {
    uint32_t number, num;
} command_part;

/* "K/N", 1 <= K <= N <= COMMAND_MAX_PARTS. Errors: KARST_USAGE. */
bool command_parse_part(const char *text, command_part *part, karst_error *error);
/* The pictures of a part: those from *first to before *end, of `num`. Parts differ by one picture at most. */
void command_part_pictures(command_part part, size_t num, size_t *first, size_t *end);
/* The tile that a part of one picture is: x, y, width, height. All parts together are the picture, each pixel once.
 * Errors: KARST_USAGE (more parts than tiles of 16 x 16 pixels). */
bool command_part_tile(command_part part, const int size_px[2], int window_px[4], karst_error *error);
/* "X,Y,W,H" within the picture. Errors: KARST_USAGE. */
bool command_parse_window(const char *text, const int size_px[2], int window_px[4], karst_error *error);
/* PATH as the file of a part: out.png becomes out.part-2-of-4.png; malloc'ed; NULL: out of memory. */
char *command_part_name(const char *path, command_part part);

/* Prints the commands of a job to stdout, one a line: `karst render` with the words of argv, without those that are a
 * part's alone, each with its part of num_parts, the manifest, and --resume. Errors: KARST_USAGE (a word with a line
 * break). */
bool command_print_jobs(int argc, char **argv, uint32_t num_parts, const char *manifest, karst_error *error);
/* Whether argument `at` says nothing of what is drawn (--part, --device, --quiet and such); *num_words: how many
 * arguments it is. */
bool command_is_parts_alone(int argc, char **argv, int at, int *num_words);

/* ---- command_manifest.c ---- */

/* What a part of a job is. Borrowed by the manifest. */
typedef struct {
    const char *manifest; /* the job's file; a part writes beside it, under command_part_name */
    command_part part;
    const char *output; /* a pattern of pictures, a picture, or one that is drawn in tiles */
    size_t num;         /* of pictures or tiles, of all parts together */
    bool tiles;
    int size_px[2]; /* of the whole picture */
    const char *inputs[3]; /* files that the pictures depend on; NULL: fewer */
    int argc;
    char **argv; /* of karst render */
} command_job;

typedef struct command_manifest command_manifest;

/* Begins the manifest of a part. `resume`: goes on with the one that is there, and looks at each picture that it has.
 * Errors: KARST_BAD_DATA (it cannot be read, or is of other settings, inputs or another version), KARST_FAILED. */
command_manifest *command_manifest_open(const command_job *job, bool resume, command_talk *talk, karst_error *error);
/* Whether the picture or tile is done, by size and checksum; always false without `resume`. */
bool command_manifest_has(const command_manifest *manifest, size_t index);
size_t command_manifest_count(const command_manifest *manifest);
/* Notes a file that has just been written. On disk within a second, or with command_manifest_write. Errors:
 * KARST_FAILED. */
bool command_manifest_add(command_manifest *manifest, size_t index, const char *file, karst_error *error);
bool command_manifest_write(command_manifest *manifest, karst_error *error);
void command_manifest_close(command_manifest *manifest); /* writes nothing; NULL is fine */

/* A file's size and CRC-32 (zlib's). Errors: KARST_FAILED, with errno's words; also of what is no regular file. */
typedef struct {
    uint64_t size_bytes;
    uint32_t crc32;
} command_checksum;
bool command_checksum_file(const char *file, command_checksum *sum, karst_error *error);

/* What a manifest's file says. */
typedef struct {
    size_t index;
    command_checksum sum;
} command_manifest_entry;
typedef struct {
    void *json; /* json_t *: owns what follows */
    const char *version, *output;
    bool tiles;
    int size_px[2]; /* of the whole picture */
    size_t num;
    command_manifest_entry *entries;
    size_t num_entries;
} command_manifest_file;
/* Reads one; every number in it is within its range. Errors: KARST_BAD_DATA. */
bool command_manifest_read(const char *file, command_manifest_file *manifest, karst_error *error);
void command_manifest_free(command_manifest_file *manifest);
/* Says what differs between two that should be parts of one job. Errors: KARST_BAD_DATA, naming `file`. */
bool command_manifest_is_same_job(const command_manifest_file *a, const command_manifest_file *b, const char *file,
                                  karst_error *error);
/* The file of a picture or a tile, seen from where `manifest` lies; malloc'ed; NULL: out of memory. */
char *command_manifest_name(const char *manifest, const char *output, bool tiles, size_t num, size_t index);

/* ---- command_join.c ---- */

/* Puts the tiles of a job (of a .png) together in `output`, which appears whole or not at all. Memory is that of some
 * rows of the picture, whatever its size. Errors: KARST_BAD_DATA (a tile that cannot be read, or is of another size),
 * KARST_FAILED. */
bool command_join(const char *manifest, const command_manifest_file *job, const char *output, command_talk *talk,
                  karst_error *error);

#endif
