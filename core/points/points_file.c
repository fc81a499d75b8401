/* Files of imported points: reading. */
#include "core/points/points_file.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

uint64_t karst_points_sum(uint64_t sum, const void *data, size_t num_bytes)
{
    const uint8_t *bytes = data;
    for (size_t i = 0; i < num_bytes; i += 8) {
        uint64_t word = 0;
        memcpy(&word, bytes + i, num_bytes - i < 8 ? num_bytes - i : 8);
        sum = (sum ^ word) * 0x9e3779b97f4a7c15u;
        sum ^= sum >> 32;
    }
    return sum;
}

bool karst_points_is_name(const char *name)
{
    const char *suffix = strrchr(name, '.');
    return suffix && strcmp(suffix, ".karstpoints") == 0;
}

static bool damaged(const char *path, karst_error *error, const char *what)
{
    return karst_fail(error, KARST_BAD_DATA, "%s: %s: import the points again", path, what);
}

static uint64_t to_words(uint64_t num_bytes) { return (num_bytes + 7) / 8 * 8; }

uint64_t karst_points_tree_offset(const karst_points_level *level)
{
    return to_words(level->offset + level->num * sizeof(karst_point));
}

static uint64_t num_nodes(uint64_t num_points)
{
    uint32_t counts[KARST_POINTS_MAX_TREE];
    uint64_t num = 0;
    int levels = karst_points_tree((uint32_t)num_points, counts);
    for (int i = 0; i < levels; i++)
        num += counts[i];
    return num;
}

uint64_t karst_points_level_end(const karst_points_level *level)
{
    return karst_points_tree_offset(level) + num_nodes(level->num) * sizeof(karst_point_node);
}

static bool are_levels_good(const karst_points_head *head, uint64_t file_bytes)
{
    if (head->num_levels < 1 || head->num_levels > KARST_POINTS_MAX_LEVELS)
        return false;
    for (uint32_t i = 0; i < head->num_levels; i++) {
        const karst_points_level *level = &head->levels[i];
        if (level->num < 1 || level->num > UINT32_MAX / 2 || level->offset < sizeof *head || level->offset % 8 ||
            level->offset > file_bytes || level->num > (file_bytes - level->offset) / sizeof(karst_point) ||
            karst_points_level_end(level) > file_bytes ||
            (i > 0 && level->offset < karst_points_level_end(level - 1)) || level->spacing < 1 ||
            level->spacing > KARST_POINTS_MAX_AT || (i > 0 && level->spacing <= level[-1].spacing))
            return false;
    }
    return true;
}

static bool check_head(const char *path, const karst_points_head *head, uint64_t file_bytes, karst_error *error)
{
    if (memcmp(head->magic, KARST_POINTS_MAGIC, sizeof head->magic) != 0)
        return karst_fail(error, KARST_BAD_DATA, "%s: this is no file of imported points: karst import makes them",
                          path);
    if (head->version != KARST_POINTS_VERSION)
        return karst_fail(error, KARST_BAD_DATA,
                          "%s: version %u of the format, where this Karst reads %u: import the "
                          "points again",
                          path, head->version, KARST_POINTS_VERSION);
    if (head->sum != karst_points_sum(0, head, offsetof(karst_points_head, sum)))
        return damaged(path, error, "its head is damaged");
    bool good = head->record_bytes == sizeof(karst_point) && head->unit >= 0x1p-200 && head->unit <= 0x1p200 &&
                are_levels_good(head, file_bytes);
    for (int a = 0; a < 3; a++)
        good = good && isfinite(head->centre[a]) && isfinite(head->min[a]) && isfinite(head->max[a]);
    return good || damaged(path, error, "its head and its length do not fit one another");
}

int karst_points_open(const char *path, karst_points_head *head, karst_error *error)
{
    struct stat about;
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0) {
        karst_fail(error, KARST_BAD_DATA, "%s: cannot open: %s", path, strerror(errno));
        return -1;
    }
    if (fstat(fd, &about) != 0 || !S_ISREG(about.st_mode)) {
        karst_fail(error, KARST_BAD_DATA, "%s: this is no file of imported points", path);
    } else if (pread(fd, head, sizeof *head, 0) != (ssize_t)sizeof *head) {
        karst_fail(error, KARST_BAD_DATA, "%s: too short for a file of imported points", path);
    } else if (check_head(path, head, (uint64_t)about.st_size, error)) {
        return fd;
    }
    close(fd);
    return -1;
}

static bool is_point_good(const karst_point *point)
{
    return abs(point->at[0]) <= KARST_POINTS_MAX_AT && abs(point->at[1]) <= KARST_POINTS_MAX_AT &&
           abs(point->at[2]) <= KARST_POINTS_MAX_AT && point->radius >= 0 &&
           point->radius <= (float)KARST_POINTS_MAX_AT;
}

static bool are_points_good(const karst_points_level *level, const karst_point *points)
{
    bool good = karst_points_sum(0, points, (size_t)level->num * sizeof *points) == level->sum;
    for (uint64_t i = 0; good && i < level->num; i++)
        good = is_point_good(&points[i]);
    return good;
}

static bool read_all(int fd, void *data, size_t num_bytes, uint64_t offset)
{
    for (size_t done = 0; done < num_bytes;) {
        ssize_t got = pread(fd, (char *)data + done, num_bytes - done, (off_t)(offset + done));
        if (got < 0 && errno == EINTR)
            continue;
        if (got <= 0)
            return false;
        done += (size_t)got;
    }
    return true;
}

karst_point *karst_points_load_level(int fd, const char *path, const karst_points_head *head, uint32_t level,
                                     karst_error *error)
{
    const karst_points_level *of = &head->levels[level];
    size_t num_bytes = (size_t)of->num * sizeof(karst_point);
    karst_point *points = malloc(num_bytes);
    if (!points) {
        karst_fail(error, KARST_FAILED, "out of memory for %llu points", (unsigned long long)of->num);
        return NULL;
    }
    if (read_all(fd, points, num_bytes, of->offset) && are_points_good(of, points))
        return points;
    damaged(path, error, "its points are damaged");
    free(points);
    return NULL;
}

/* Whether a node holds those below it, of whose boxes and reaches these are the least and the largest. */
static bool holds(const karst_point_node *node, const int min[3], const int max[3], int reach)
{
    bool good = reach <= node->reach && node->reach <= node->cover && node->cover <= 1 << 30 && node->spread >= 0 &&
                node->spread <= 1 << 30;
    for (int a = 0; a < 3; a++)
        good = good && node->min[a] <= min[a] && node->max[a] >= max[a];
    return good;
}

static bool is_tree_good(const karst_points_level *level, const karst_point *points, const karst_point_node *nodes)
{
    uint32_t counts[KARST_POINTS_MAX_TREE];
    int num_levels = karst_points_tree((uint32_t)level->num, counts);
    bool good = true;
    for (uint64_t i = 0; good && i < level->num; i++)
        good = holds(&nodes[i / KARST_POINTS_FAN], points[i].at, points[i].at, karst_point_reach(points[i].radius));
    for (int tree = 1; good && tree < num_levels; tree++) {
        const karst_point_node *above = nodes + counts[tree - 1];
        for (uint32_t i = 0; good && i < counts[tree - 1]; i++) {
            const karst_point_node *node = &above[i / KARST_POINTS_FAN];
            good = holds(node, nodes[i].min, nodes[i].max, nodes[i].reach) && nodes[i].cover <= node->cover &&
                   nodes[i].spread <= node->spread;
        }
        nodes = above;
    }
    return good;
}

bool karst_points_check_level(const char *path, const karst_points_head *head, uint32_t level, const void *data,
                              karst_error *error)
{
    const karst_points_level *of = &head->levels[level];
    const uint64_t at = karst_points_tree_offset(of) - of->offset, end = karst_points_level_end(of) - of->offset;
    const karst_point_node *nodes = (const karst_point_node *)((const char *)data + at);
    return (are_points_good(of, data) && karst_points_sum(0, nodes, (size_t)(end - at)) == head->tree_sums[level] &&
            is_tree_good(of, data, nodes)) ||
           damaged(path, error, "its points are damaged");
}

void karst_points_tell(const karst_points_head *head, karst_points_about *about)
{
    *about = (karst_points_about){.num_points = head->levels[0].num,
                                  .num_read = head->num_read,
                                  .num_withheld = head->num_withheld,
                                  .num_invalid = head->num_invalid,
                                  .num_far = head->num_far,
                                  .num_duplicates = head->num_duplicates,
                                  .num_outliers = head->num_outliers,
                                  .num_levels = head->num_levels,
                                  .spacing = head->spacing,
                                  .has_colours = head->flags & KARST_POINTS_HAS_COLOURS,
                                  .has_given_normals = head->flags & KARST_POINTS_HAS_GIVEN_NORMALS,
                                  .num_parts = head->num_parts,
                                  .share_unsure = head->share_unsure};
    for (uint32_t i = 0; i < head->num_levels; i++)
        about->num_of_level[i] = head->levels[i].num;
    memcpy(about->min, head->min, sizeof about->min);
    memcpy(about->max, head->max, sizeof about->max);
    memcpy(about->centre, head->centre, sizeof about->centre);
}

/* The sum of a part of a file; false: it cannot be read. */
static bool sum_file(int fd, uint64_t at, uint64_t end, uint64_t *sum)
{
    char block[1 << 16];
    *sum = 0;
    while (at < end) {
        size_t num = end - at < sizeof block ? (size_t)(end - at) : sizeof block;
        if (!read_all(fd, block, num, at))
            return false;
        *sum = karst_points_sum(*sum, block, num);
        at += num;
    }
    return true;
}

bool karst_points_describe(const char *path, karst_points_about *about, karst_error *error)
{
    karst_points_head head;
    int fd = karst_points_open(path, &head, error);
    bool good = fd >= 0;
    for (uint32_t i = 0; good && i < head.num_levels; i++) {
        const karst_points_level *of = &head.levels[i];
        uint64_t sum = 0, tree_sum = 0;
        good = sum_file(fd, of->offset, of->offset + of->num * sizeof(karst_point), &sum) &&
               sum_file(fd, karst_points_tree_offset(of), karst_points_level_end(of), &tree_sum);
        good =
            (good && sum == of->sum && tree_sum == head.tree_sums[i]) || damaged(path, error, "its points are damaged");
    }
    if (good)
        karst_points_tell(&head, about);
    if (fd >= 0)
        close(fd);
    return good;
}
