/* Parts of a job, and its commands. */
#include "command_farm.h"

#include <ctype.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

/* Tiles begin where groups of packets do: nothing is drawn twice. */
#define TILE_STEP_PX 16

/* A whole number of digits alone, at most `most`. */
static bool parse_count(const char **text, uint64_t most, uint64_t *value)
{
    char *end;
    errno = 0;
    if (!isdigit((unsigned char)**text))
        return false;
    *value = strtoull(*text, &end, 10);
    *text = end;
    return errno == 0 && *value <= most;
}

bool command_parse_part(const char *text, command_part *part, karst_error *error)
{
    const char *at = text;
    uint64_t number, num;
    if (!parse_count(&at, COMMAND_MAX_PARTS, &number) || *at++ != '/' || !parse_count(&at, COMMAND_MAX_PARTS, &num) ||
        *at || number < 1 || number > num)
        return karst_fail(error, KARST_USAGE, "--part %s: must be K/N, part K of N, such as 3/8; at most %d parts",
                          text, COMMAND_MAX_PARTS);
    *part = (command_part){(uint32_t)number, (uint32_t)num};
    return true;
}

void command_part_pictures(command_part part, size_t num, size_t *first, size_t *end)
{
    *first = part.num ? num * (part.number - 1) / part.num : 0;
    *end = part.num ? num * part.number / part.num : num;
}

/* Where a side is cut: piece i of num begins there. */
static int cut(int side_px, uint32_t num, uint32_t i)
{
    const uint64_t steps = ((uint64_t)side_px + TILE_STEP_PX - 1) / TILE_STEP_PX;
    const uint64_t at_px = steps * i / num * TILE_STEP_PX;
    return at_px < (uint64_t)side_px ? (int)at_px : side_px;
}

bool command_part_tile(command_part part, const int size_px[2], int window_px[4], karst_error *error)
{
    uint32_t columns = 0;
    double best = 0;
    /* As square as can be, of those that fill the picture. */
    for (uint32_t across = 1; across <= part.num; across++) {
        const uint32_t down = part.num / across;
        const double wide = (double)size_px[0] / across, high = (double)size_px[1] / down;
        const double squareness = wide < high ? wide / high : high / wide;
        if (part.num % across == 0 && wide >= TILE_STEP_PX && high >= TILE_STEP_PX && squareness > best) {
            best = squareness;
            columns = across;
        }
    }
    if (!columns)
        return karst_fail(error, KARST_USAGE,
                          "%u parts of %dx%d: no tiles of %d pixels and more fit; ask for fewer parts, or for a number "
                          "with more divisors",
                          part.num, size_px[0], size_px[1], TILE_STEP_PX);
    const uint32_t rows = part.num / columns, column = (part.number - 1) % columns, row = (part.number - 1) / columns;
    window_px[0] = cut(size_px[0], columns, column);
    window_px[1] = cut(size_px[1], rows, row);
    window_px[2] = cut(size_px[0], columns, column + 1) - window_px[0];
    window_px[3] = cut(size_px[1], rows, row + 1) - window_px[1];
    return true;
}

bool command_parse_window(const char *text, const int size_px[2], int window_px[4], karst_error *error)
{
    const char *at = text;
    uint64_t value[4];
    for (int i = 0; i < 4; i++)
        if (!parse_count(&at, 16384, &value[i]) || *at++ != (i < 3 ? ',' : '\0'))
            return karst_fail(error, KARST_USAGE, "--window %s: must be X,Y,W,H in pixels, such as 0,0,640,360", text);
    for (int axis = 0; axis < 2; axis++)
        if (value[axis + 2] < 1 || value[axis] + value[axis + 2] > (uint64_t)size_px[axis])
            return karst_fail(error, KARST_USAGE, "--window %s: is not within the picture of %dx%d", text, size_px[0],
                              size_px[1]);
    for (int i = 0; i < 4; i++)
        window_px[i] = (int)value[i];
    return true;
}

char *command_part_name(const char *path, command_part part)
{
    const char *slash = strrchr(path, '/'), *name = slash ? slash + 1 : path, *dot = strrchr(name, '.');
    if (!dot || dot == name)
        dot = path + strlen(path);
    char *made;
    const int length = part.num ? asprintf(&made, "%.*s.part-%u-of-%u%s", (int)(dot - path), path, part.number,
                                           part.num, dot)
                                : asprintf(&made, "%s", path);
    return length < 0 ? NULL : made;
}

/* ---- commands ---- */

bool command_is_parts_alone(int argc, char **argv, int at, int *num_words)
{
    static const char *const with_value[] = {"--part", "--jobs", "--manifest", "--device", "--display", "--stats"};
    static const char *const flags[] = {"--resume", "--quiet", "--verbose", "-q", "-v"};
    *num_words = 1;
    for (size_t i = 0; i < sizeof flags / sizeof *flags; i++)
        if (strcmp(argv[at], flags[i]) == 0)
            return true;
    for (size_t i = 0; i < sizeof with_value / sizeof *with_value; i++) {
        const size_t length = strlen(with_value[i]);
        if (strncmp(argv[at], with_value[i], length) != 0 || (argv[at][length] && argv[at][length] != '='))
            continue;
        *num_words = argv[at][length] || at + 1 == argc ? 1 : 2;
        return true;
    }
    return false;
}

/* A word as a shell reads it. */
static void print_word(const char *word)
{
    static const char plain[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_@%+=:,./-";
    if (*word && word[strspn(word, plain)] == '\0') {
        fputs(word, stdout);
        return;
    }
    putchar('\'');
    for (; *word; word++)
        if (*word == '\'')
            fputs("'\\''", stdout);
        else
            putchar(*word);
    putchar('\'');
}

bool command_print_jobs(int argc, char **argv, uint32_t num_parts, const char *manifest, karst_error *error)
{
    const char *program = program_invocation_name;
    for (int i = -2; i < argc; i++) {
        const char *word = i == -2 ? program : i == -1 ? manifest : argv[i];
        if (strpbrk(word, "\n\r"))
            return karst_fail(error, KARST_USAGE, "--jobs prints a command a line: no name may hold a line break");
    }
    for (uint32_t number = 1; number <= num_parts; number++) {
        print_word(program);
        printf(" render --part %u/%u --manifest ", number, num_parts);
        print_word(manifest);
        fputs(" --resume", stdout);
        for (int i = 0, num_words; i < argc; i += num_words) {
            /* Device and display are the same wherever the job runs; what is this printing's own goes. */
            const bool is_own = command_is_parts_alone(argc, argv, i, &num_words) &&
                                (strncmp(argv[i], "--jobs", 6) == 0 || strncmp(argv[i], "--manifest", 10) == 0 ||
                                 strcmp(argv[i], "--resume") == 0);
            for (int k = 0; k < num_words && !is_own; k++) {
                putchar(' ');
                print_word(argv[i + k]);
            }
        }
        putchar('\n');
    }
    return true;
}
