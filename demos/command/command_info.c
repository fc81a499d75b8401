/* karst info and karst --version: what there is to work with. */
#include "command.h"

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
    size_t num_words;
    bool help;
    if (!command_parse(argc, argv, NULL, 0, NULL, 0, &num_words, &help, error))
        return false;
    if (help)
        puts("karst info: lists devices, ways to display and limits, and says how to mend what is missing.");
    else {
        command_open_driver(talk);
        karst_info(print_line, stdout);
    }
    return true;
}
