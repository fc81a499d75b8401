/* karst info and karst --version: what there is to work with. */
#include "command.h"

#include <stdlib.h>

#ifdef __clang__
#define COMPILER "clang " __clang_version__
#else
#define COMPILER "gcc " __VERSION__
#endif

static void print_line(void *user, const char *line) { fprintf(user, "%s\n", line); }

void command_print_version(FILE *file)
{
    fprintf(file, "karst %s\nbuilt by %s, %s\n", karst_version(), COMPILER, KARST_BUILD_FLAGS);
    /* A driver may take its time, or worse: what is known stands there already. */
    fflush(file);
    karst_info(print_line, file);
}

bool command_info(int argc, char **argv, command_talk *talk, karst_error *error)
{
    bool json = false, help;
    const char *name;
    const command_option options[] = {
        {"json", 0, COMMAND_FLAG, NULL, "the same as one JSON object", &json, 0, 0, NULL},
    };
    size_t num_words;
    if (!command_parse(argc, argv, options, 1, &name, 1, &num_words, &help, error))
        return false;
    if (help) {
        puts("karst info: lists devices, ways to display and limits, and says how to mend what is missing.\n"
             "karst info FILE.karstdb: what a saved world holds.\n"
             "karst info FILE.karstpoints: what imported points hold.\n"
             "\nOptions:");
        command_print_options(stdout, options, 1);
        return true;
    }
    if (num_words && karst_points_is_name(name))
        return command_print_points(name, json, error);
    if (num_words)
        return command_print_saved(name, json, talk, error);
    command_open_driver(talk);
    if (!json) {
        karst_info(print_line, stdout);
        return true;
    }
    char *text = karst_info_json();
    if (!text)
        return karst_fail(error, KARST_FAILED, "out of memory");
    puts(text);
    free(text);
    return true;
}
