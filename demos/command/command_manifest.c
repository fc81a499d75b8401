/* The manifest of a job's part: which pictures are done, with their sizes and checksums.
 *
 * A checksum is zlib's CRC-32, which libpng brings along: what it has to find is damage (a disk that was full, a copy
 * that broke off, another picture in this one's place), not forgery, and with the size it misses one in four thousand
 * million of those. */
#include "command_farm.h"

#include <errno.h>
#include <fcntl.h>
#include <jansson.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#define MAX_BYTES ((off_t)1 << 30)
#define WRITE_EACH_NS 1000000000u
#define FORMAT 1

struct command_manifest {
    char *file;      /* this part's */
    json_t *root;    /* what is written */
    json_t *entries; /* in it; borrowed */
    bool *is_done;   /* of each picture or tile of the job */
    size_t num, num_done;
    uint64_t written_ns;
    bool is_written;
};

/* ---- checksums ---- */

bool command_checksum_file(const char *file, command_checksum *sum, karst_error *error)
{
    static unsigned char buffer[1 << 18];
    struct stat info;
    const int fd = open(file, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (fd < 0)
        return karst_fail(error, KARST_FAILED, "%s: %s", file, strerror(errno));
    *sum = (command_checksum){0, (uint32_t)crc32(0, NULL, 0)};
    ssize_t got = fstat(fd, &info) == 0 && !S_ISREG(info.st_mode) ? (errno = EINVAL, -1) : 1;
    while (got > 0) {
        got = read(fd, buffer, sizeof buffer);
        if (got < 0 && errno == EINTR) {
            got = 1;
        } else if (got > 0) {
            sum->size_bytes += (uint64_t)got;
            sum->crc32 = (uint32_t)crc32(sum->crc32, buffer, (uInt)got);
        }
    }
    const int reason = errno;
    close(fd);
    return got == 0 || karst_fail(error, KARST_FAILED, "%s: %s", file,
                                  reason == EINVAL ? "it is not a regular file" : strerror(reason));
}

static json_t *pack_sum(const command_checksum *sum)
{
    char text[16];
    snprintf(text, sizeof text, "%08x", sum->crc32);
    return json_pack("{s:I, s:s}", "bytes", (json_int_t)sum->size_bytes, "crc32", text);
}

static bool unpack_sum(const json_t *json, command_checksum *sum)
{
    const json_int_t bytes = json_integer_value(json_object_get(json, "bytes"));
    const char *text = json_string_value(json_object_get(json, "crc32"));
    if (!json_is_integer(json_object_get(json, "bytes")) || bytes < 0 || !text || strlen(text) != 8 ||
        strspn(text, "0123456789abcdef") != 8)
        return false;
    *sum = (command_checksum){(uint64_t)bytes, (uint32_t)strtoul(text, NULL, 16)};
    return true;
}

/* ---- names ---- */

/* How many characters of a path are its folder, the slash included. */
static size_t folder_length(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash ? (size_t)(slash + 1 - path) : 0;
}

/* The output as somebody finds it who has the manifest: by its name alone where both lie in one folder, else by its
 * whole path. */
static char *output_from_manifest(const char *manifest, const char *output)
{
    const size_t length = folder_length(output);
    char *folder = strndup(length ? output : "./", length ? length : 2), *whole = NULL, *made = NULL;
    if (folder && length == folder_length(manifest) && strncmp(output, manifest, length) == 0)
        made = strdup(output + length);
    else if (folder && (whole = realpath(folder, NULL)) != NULL && asprintf(&made, "%s/%s", whole, output + length) < 0)
        made = NULL;
    free(folder);
    free(whole);
    return made;
}

char *command_manifest_name(const char *manifest, const char *output, bool tiles, size_t num, size_t index)
{
    const size_t length = *output == '/' ? 0 : folder_length(manifest);
    char *path, *name;
    if (asprintf(&path, "%.*s%s", (int)length, manifest, output) < 0)
        return NULL;
    name = tiles ? command_part_name(path, (command_part){(uint32_t)index + 1, (uint32_t)num})
                 : command_picture_name(path, index);
    free(path);
    return name;
}

/* ---- reading ---- */

static bool read_entries(const json_t *list, command_manifest_file *m)
{
    m->num_entries = json_array_size(list);
    if (!json_is_array(list) || m->num_entries > m->num)
        return false;
    m->entries = calloc(m->num_entries + 1, sizeof *m->entries);
    for (size_t i = 0; m->entries && i < m->num_entries; i++) {
        const json_t *entry = json_array_get(list, i), *index = json_object_get(entry, "index");
        if (!json_is_integer(index) || json_integer_value(index) < 0 ||
            (uint64_t)json_integer_value(index) >= m->num || !unpack_sum(entry, &m->entries[i].sum))
            return false;
        m->entries[i].index = (size_t)json_integer_value(index);
    }
    return m->entries != NULL;
}

bool command_manifest_read(const char *file, command_manifest_file *m, karst_error *error)
{
    struct stat info;
    json_error_t why;
    *m = (command_manifest_file){0};
    if (stat(file, &info) != 0)
        return karst_fail(error, KARST_BAD_DATA, "%s: %s", file, strerror(errno));
    if (!S_ISREG(info.st_mode) || info.st_size > MAX_BYTES)
        return karst_fail(error, KARST_BAD_DATA, "%s: is no manifest: it is not a file, or larger than 1 GiB", file);
    json_t *root = json_load_file(file, JSON_REJECT_DUPLICATES, &why);
    if (!root)
        return karst_fail(error, KARST_BAD_DATA, "%s:%d:%d: %s", file, why.line, why.column, why.text);
    m->json = root;
    m->version = json_string_value(json_object_get(root, "version"));
    m->output = json_string_value(json_object_get(root, "output"));
    m->tiles = json_is_true(json_object_get(root, "tiles"));
    const json_int_t num = json_integer_value(json_object_get(root, "total"));
    bool has_size = json_unpack(root, "{s:[i,i]}", "size", &m->size_px[0], &m->size_px[1]) == 0;
    for (int axis = 0; axis < 2; axis++)
        has_size = has_size && m->size_px[axis] >= 1 && m->size_px[axis] <= KARST_IMAGE_MAX_PX;
    m->num = num > 0 && num <= (m->tiles ? COMMAND_MAX_PARTS : COMMAND_MAX_PICTURES) ? (size_t)num : 0;
    if (json_integer_value(json_object_get(root, "karst_manifest")) == FORMAT && m->version && m->output && m->num &&
        has_size && json_is_array(json_object_get(root, "settings")) &&
        json_is_array(json_object_get(root, "inputs")) && read_entries(json_object_get(root, "pictures"), m))
        return true;
    command_manifest_free(m);
    return karst_fail(error, KARST_BAD_DATA, "%s: is no manifest of karst render, or a damaged one", file);
}

void command_manifest_free(command_manifest_file *m)
{
    json_decref(m->json);
    free(m->entries);
    *m = (command_manifest_file){0};
}

/* The first word in which two lists differ, as text; "nothing" where one ends. */
static const char *word_at(const json_t *list, size_t i)
{
    const char *word = json_string_value(json_array_get(list, i));
    return word ? word : "nothing";
}

bool command_manifest_is_same_job(const command_manifest_file *a, const command_manifest_file *b, const char *file,
                                  karst_error *error)
{
    const json_t *ours = json_object_get(a->json, "settings"), *theirs = json_object_get(b->json, "settings");
    if (strcmp(a->version, b->version) != 0)
        return karst_fail(error, KARST_BAD_DATA, "%s: is by Karst %s, not %s: begin anew, without it", file, b->version,
                          a->version);
    size_t i = 0;
    while (i < json_array_size(ours) && json_equal(json_array_get(ours, i), json_array_get(theirs, i)))
        i++;
    if (i < json_array_size(ours) || i < json_array_size(theirs))
        return karst_fail(error, KARST_BAD_DATA,
                          "%s: is of another job ('%s' there, '%s' here): name another manifest, or remove this one",
                          file, word_at(theirs, i), word_at(ours, i));
    if (!json_equal(json_object_get(a->json, "inputs"), json_object_get(b->json, "inputs")))
        return karst_fail(error, KARST_BAD_DATA,
                          "%s: the world, the path or the edits have changed since: begin anew, without it", file);
    if (strcmp(a->output, b->output) != 0 || a->tiles != b->tiles || a->num != b->num)
        return karst_fail(error, KARST_BAD_DATA,
                          "%s: is of another job (%zu of %s there, %zu of %s here): name another manifest, or remove "
                          "this one",
                          file, b->num, b->output, a->num, a->output);
    return true;
}

/* ---- writing ---- */

static json_t *describe_inputs(const command_job *job, karst_error *error)
{
    json_t *inputs = json_array();
    for (size_t i = 0; i < sizeof job->inputs / sizeof *job->inputs && job->inputs[i]; i++) {
        command_checksum sum;
        if (!command_checksum_file(job->inputs[i], &sum, error)) {
            json_decref(inputs);
            return NULL;
        }
        json_t *input = pack_sum(&sum);
        const char *name = job->inputs[i] + folder_length(job->inputs[i]);
        json_object_set_new(input, "name", json_string(name));
        json_array_append_new(inputs, input);
    }
    return inputs;
}

/* JSON takes UTF-8 alone. Other words are said to be there; what they name is an input, which is compared itself. */
static json_t *word_of(const char *word)
{
    json_t *text = json_string(word);
    return text ? text : json_string_nocheck("?");
}

static json_t *describe_job(const command_job *job, karst_error *error)
{
    json_t *settings = json_array(), *inputs = describe_inputs(job, error);
    char *output = output_from_manifest(job->manifest, job->output);
    for (int i = 0, num_words; i < job->argc; i += num_words) {
        const bool left_out = command_is_parts_alone(job->argc, job->argv, i, &num_words);
        for (int k = 0; k < num_words && !left_out; k++)
            json_array_append_new(settings, word_of(job->argv[i + k]));
    }
    json_t *root = NULL;
    json_t *output_text = output ? json_string(output) : NULL;
    if (output && !output_text)
        karst_fail(error, KARST_USAGE, "%s: a manifest holds no name that is not UTF-8; choose another with -o",
                   output);
    if (inputs && output_text)
        root = json_pack("{s:i, s:s, s:O, s:O, s:O, s:b, s:I, s:[i,i], s:[]}", "karst_manifest", FORMAT, "version",
                         karst_version(), "output", output_text, "settings", settings, "inputs", inputs, "tiles",
                         job->tiles, "total", (json_int_t)job->num, "size", job->size_px[0], job->size_px[1],
                         "pictures");
    if (!root)
        karst_fail(error, KARST_FAILED, "cannot begin a manifest: %s", strerror(errno));
    json_decref(settings);
    json_decref(inputs);
    json_decref(output_text);
    free(output);
    return root;
}

/* Takes over what the part's file says is done, as far as it is. */
static bool take_up(command_manifest *m, const command_job *job, command_talk *talk, karst_error *error)
{
    command_manifest_file now = {.json = m->root, .version = karst_version(), .tiles = job->tiles, .num = job->num};
    command_manifest_file before;
    now.output = json_string_value(json_object_get(m->root, "output"));
    if (!command_manifest_read(m->file, &before, error))
        return false;
    bool same = command_manifest_is_same_job(&now, &before, m->file, error);
    for (size_t i = 0; same && i < before.num_entries && !command_interrupted(); i++) {
        const command_manifest_entry *entry = &before.entries[i];
        command_checksum sum;
        karst_error missing = {0};
        char *name = command_manifest_name(job->manifest, now.output, job->tiles, job->num, entry->index);
        command_progress(talk, "checking picture %zu of %zu", i + 1, before.num_entries);
        if (name && !m->is_done[entry->index] && command_checksum_file(name, &sum, &missing) &&
            sum.size_bytes == entry->sum.size_bytes && sum.crc32 == entry->sum.crc32) {
            m->is_done[entry->index] = true;
            m->num_done++;
            json_array_append(m->entries, json_array_get(json_object_get(before.json, "pictures"), i));
        }
        free(name);
    }
    command_end_progress(talk);
    command_manifest_free(&before);
    return same;
}

command_manifest *command_manifest_open(const command_job *job, bool resume, command_talk *talk, karst_error *error)
{
    command_manifest *m = calloc(1, sizeof *m);
    if (!m) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    m->num = job->num;
    m->file = command_part_name(job->manifest, job->part);
    m->is_done = calloc(job->num, sizeof *m->is_done);
    m->root = describe_job(job, error);
    m->entries = json_object_get(m->root, "pictures");
    const bool is_there = resume && m->file && access(m->file, F_OK) == 0;
    if (m->file && m->is_done && m->root && command_check_output(m->file, "--manifest", false, error) &&
        (!is_there || take_up(m, job, talk, error)))
        return m;
    karst_fail(error, KARST_FAILED, "out of memory for a manifest");
    command_manifest_close(m);
    return NULL;
}

bool command_manifest_has(const command_manifest *m, size_t index) { return m && index < m->num && m->is_done[index]; }
size_t command_manifest_count(const command_manifest *m) { return m->num_done; }

bool command_manifest_write(command_manifest *m, karst_error *error)
{
    if (!m || m->is_written)
        return true;
    char *json = json_dumps(m->root, JSON_INDENT(1)), *text = NULL;
    m->is_written = json && asprintf(&text, "%s\n", json) >= 0
                        ? command_write_text(m->file, text, error)
                        : karst_fail(error, KARST_FAILED, "out of memory for %s", m->file);
    m->written_ns = command_clock_ns();
    free(json);
    free(text);
    return m->is_written;
}

bool command_manifest_add(command_manifest *m, size_t index, const char *file, karst_error *error)
{
    command_checksum sum;
    if (!command_checksum_file(file, &sum, error))
        return false;
    json_t *entry = pack_sum(&sum);
    json_object_set_new(entry, "index", json_integer((json_int_t)index));
    if (json_array_append_new(m->entries, entry) != 0)
        return karst_fail(error, KARST_FAILED, "out of memory for %s", m->file);
    m->num_done += !m->is_done[index];
    m->is_done[index] = true;
    m->is_written = false;
    return command_clock_ns() - m->written_ns < WRITE_EACH_NS || command_manifest_write(m, error);
}

void command_manifest_close(command_manifest *m)
{
    if (!m)
        return;
    json_decref(m->root);
    free(m->is_done);
    free(m->file);
    free(m);
}
