/* Options from a table. getopt_long would do for parsing, but not for ranges, suggestions and help from one place. */
#include "command.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define MAX_NAME 40

/* Edits (insert, delete, replace, swap neighbours) between two words, the optimal string alignment distance. */
static int distance(const char *a, const char *b)
{
    int d[MAX_NAME + 1][MAX_NAME + 1];
    int n = (int)strnlen(a, MAX_NAME), m = (int)strnlen(b, MAX_NAME);
    for (int i = 0; i <= n; i++)
        d[i][0] = i;
    for (int j = 0; j <= m; j++)
        d[0][j] = j;
    for (int i = 1; i <= n; i++) {
        for (int j = 1; j <= m; j++) {
            int best = d[i - 1][j - 1] + (tolower((unsigned char)a[i - 1]) != tolower((unsigned char)b[j - 1]));
            if (d[i - 1][j] + 1 < best)
                best = d[i - 1][j] + 1;
            if (d[i][j - 1] + 1 < best)
                best = d[i][j - 1] + 1;
            if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] && d[i - 2][j - 2] + 1 < best)
                best = d[i - 2][j - 2] + 1;
            d[i][j] = best;
        }
    }
    return d[n][m];
}

const char *command_nearest(const char *word, const char *const *names)
{
    size_t length = strlen(word);
    const char *best = NULL;
    int best_distance = length < 4 ? 2 : 3; /* exclusive */
    for (; *names; names++) {
        if (length >= 3 && strncmp(*names, word, length) == 0)
            return *names;
        int d = distance(word, *names);
        if (d < best_distance) {
            best_distance = d;
            best = *names;
        }
    }
    return best;
}

static bool unknown_option(const char *name, const command_option *options, size_t num_options, karst_error *error)
{
    const char *names[64] = {"help"};
    size_t num_names = 1;
    for (size_t i = 0; i < num_options && num_names < 63; i++)
        names[num_names++] = options[i].name;
    const char *nearest = command_nearest(name, names);
    if (nearest)
        return karst_fail(error, KARST_USAGE, "unknown option --%s; did you mean --%s?", name, nearest);
    return karst_fail(error, KARST_USAGE, "unknown option --%s; --help lists the options", name);
}

static bool parse_integer(const command_option *option, const char *text, karst_error *error)
{
    char *end = NULL;
    errno = 0;
    int base = text[0] == '0' && (text[1] == 'x' || text[1] == 'X') ? 16 : 10;
    unsigned long long value = isdigit((unsigned char)text[0]) ? strtoull(text, &end, base) : 0;
    if (!end || *end || errno || (double)value < option->min || (double)value > option->max)
        return karst_fail(error, KARST_USAGE, "--%s %s: must be a whole number from %.0f to %.0f", option->name, text,
                          option->min, option->max);
    *(uint64_t *)option->value = value;
    return true;
}

static bool parse_number(const command_option *option, const char *text, karst_error *error)
{
    char *end = NULL;
    double value = strtod(text, &end);
    if (end == text || *end || isspace((unsigned char)text[0]) || !(value >= option->min && value <= option->max))
        return karst_fail(error, KARST_USAGE, "--%s %s: must be a number from %g to %g", option->name, text,
                          option->min, option->max);
    *(double *)option->value = value;
    return true;
}

static bool parse_size(const command_option *option, const char *text, karst_error *error)
{
    int *size = option->value;
    const char *rest = text;
    for (int i = 0; i < 2; i++) {
        char *end = NULL;
        errno = 0;
        unsigned long value = isdigit((unsigned char)rest[0]) ? strtoul(rest, &end, 10) : 0;
        if (!end || *end != (i ? '\0' : 'x') || errno || (double)value < option->min || (double)value > option->max)
            return karst_fail(error, KARST_USAGE, "--%s %s: must be WIDTHxHEIGHT, each %.0f to %.0f, such as 1280x720",
                              option->name, text, option->min, option->max);
        size[i] = (int)value;
        rest = end + 1;
    }
    return true;
}

static bool parse_parameter(const command_option *option, const char *text, karst_error *error)
{
    command_parameters *parameters = option->value;
    size_t length = strcspn(text, "=");
    const char *number = text + length + 1;
    if (!text[length] || length == 0 || length >= sizeof parameters->names[0])
        return karst_fail(error, KARST_USAGE, "--%s %s: must be NAME=VALUE, such as relief=400", option->name, text);
    if (parameters->num_values == COMMAND_MAX_PARAMETERS)
        return karst_fail(error, KARST_USAGE, "--%s: %d parameters are the most", option->name, COMMAND_MAX_PARAMETERS);
    char *end = NULL;
    double value = strtod(number, &end);
    if (end == number || *end || !isfinite(value))
        return karst_fail(error, KARST_USAGE, "--%s %s: '%s' is not a number", option->name, text, number);
    size_t i = parameters->num_values++;
    snprintf(parameters->names[i], sizeof parameters->names[i], "%.*s", (int)length, text);
    parameters->values[i] = (karst_parameter){parameters->names[i], value};
    return true;
}

static bool set_option(const command_option *option, const char *text, karst_error *error)
{
    if (option->given)
        *option->given = true;
    switch (option->kind) {
    case COMMAND_FLAG:
        *(bool *)option->value = true;
        return true;
    case COMMAND_TEXT:
        *(const char **)option->value = text;
        return true;
    case COMMAND_INTEGER:
        return parse_integer(option, text, error);
    case COMMAND_NUMBER:
        return parse_number(option, text, error);
    case COMMAND_SIZE:
        return parse_size(option, text, error);
    case COMMAND_LIST: {
        command_list *list = option->value;
        list->items[list->num_items++] = text;
        return true;
    }
    case COMMAND_PARAMETERS:
        return parse_parameter(option, text, error);
    }
    return false;
}

/* Finds --name, --name=value or -letter; *value is what follows in the same argument, or NULL. */
static const command_option *find_option(const char *argument, const command_option *options, size_t num_options,
                                         const char **value)
{
    *value = NULL;
    bool is_long = argument[1] == '-';
    const char *name = argument + (is_long ? 2 : 1);
    size_t length = is_long ? strcspn(name, "=") : 1;
    for (size_t i = 0; i < num_options; i++) {
        const command_option *option = &options[i];
        if (is_long ? strlen(option->name) == length && strncmp(option->name, name, length) == 0
                    : option->letter == name[0]) {
            if (name[length])
                *value = name + length + is_long;
            return option;
        }
    }
    return NULL;
}

bool command_parse(int argc, char **argv, const command_option *options, size_t num_options, const char **words,
                   size_t max_words, size_t *num_words, bool *help, karst_error *error)
{
    *num_words = 0;
    *help = false;
    bool only_words = false;
    for (int i = 0; i < argc; i++)
        if (strcmp(argv[i], "--") == 0)
            break;
        else if (strcmp(argv[i], "--help") == 0 || strcmp(argv[i], "-h") == 0)
            return *help = true;

    for (int i = 0; i < argc; i++) {
        const char *argument = argv[i];
        if (!only_words && strcmp(argument, "--") == 0) {
            only_words = true;
            continue;
        }
        if (only_words || argument[0] != '-' || !argument[1]) {
            if (*num_words == max_words)
                return karst_fail(error, KARST_USAGE, "'%s' is one argument too many; --help shows what is expected",
                                  argument);
            words[(*num_words)++] = argument;
            continue;
        }
        const char *value;
        const command_option *option = find_option(argument, options, num_options, &value);
        if (!option && argument[1] == '-') {
            char name[MAX_NAME];
            snprintf(name, sizeof name, "%.*s", (int)strcspn(argument + 2, "="), argument + 2);
            return unknown_option(name, options, num_options, error);
        }
        if (!option)
            return karst_fail(error, KARST_USAGE, "unknown option %s; --help lists the options", argument);
        if (option->kind == COMMAND_FLAG && value)
            return karst_fail(error, KARST_USAGE, "%s: --%s takes no value", argument, option->name);
        if (option->kind != COMMAND_FLAG && !value) {
            if (i + 1 == argc)
                return karst_fail(error, KARST_USAGE, "--%s needs a value: --%s %s", option->name, option->name,
                                  option->argument);
            value = argv[++i];
        }
        if (!set_option(option, value, error))
            return false;
    }
    return true;
}

void command_print_options(FILE *file, const command_option *options, size_t num_options)
{
    for (size_t i = 0; i < num_options; i++) {
        const command_option *option = &options[i];
        char left[64];
        snprintf(left, sizeof left, "%s%c%s--%s%s%s", option->letter ? "-" : "  ",
                 option->letter ? option->letter : ' ', option->letter ? ", " : " ", option->name,
                 option->argument ? " " : "", option->argument ? option->argument : "");
        fprintf(file, "  %-30s%s%s\n", left, strlen(left) > 30 ? "\n                                 " : " ",
                option->help);
    }
    fprintf(file, "  %-30s %s\n", "-h, --help", "this text");
}
