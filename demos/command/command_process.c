/* What a process needs before it can be relied on: descriptors, a stack, a last word. */
#include "command.h"

#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

/* LLVM's passes call one another deeply. */
#define STACK_BYTES ((size_t)8 << 20)

/* ---- stacks ---- */

typedef struct {
    int (*function)(int, char **);
    int argc;
    char **argv;
    int result;
} call;

static void *run_call(void *user)
{
    call *c = user;
    c->result = c->function(c->argc, c->argv);
    return NULL;
}

/* The first thread's stack can only grow as far as the system lets it. */
static bool is_first_stack_small(void)
{
    struct rlimit limit;
    return getrlimit(RLIMIT_STACK, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY && limit.rlim_cur < STACK_BYTES;
}

int command_run_with_stack(int (*function)(int, char **), int argc, char **argv)
{
    call c = {function, argc, argv, KARST_FAILED};
    pthread_attr_t attributes;
    pthread_t thread;
    size_t usual_bytes = 0;
    if (pthread_attr_init(&attributes) != 0)
        return function(argc, argv);
    /* Threads of drivers, too, have what the system gives by default: a share of the first one's limit. */
    if (pthread_getattr_default_np(&attributes) == 0 && pthread_attr_getstacksize(&attributes, &usual_bytes) == 0 &&
        usual_bytes < STACK_BYTES && pthread_attr_setstacksize(&attributes, STACK_BYTES) == 0)
        pthread_setattr_default_np(&attributes);
    if (!is_first_stack_small()) {
        pthread_attr_destroy(&attributes);
        return function(argc, argv);
    }
    int failure = pthread_create(&thread, &attributes, run_call, &c);
    pthread_attr_destroy(&attributes);
    if (failure) {
        fprintf(stderr, "karst: the stack is smaller than %zu MiB (ulimit -s), and there is none of that size: %s\n",
                STACK_BYTES >> 20, strerror(failure));
        return KARST_FAILED;
    }
    pthread_join(thread, NULL);
    return c.result;
}

/* ---- memory ---- */

/* What PoCL with its compiler takes of addresses, and what OpenGL in software does: measured, and a little more. */
#define DRIVER_MIB 640
#define DISPLAY_MIB 256
#define NEAR_MIB 512

bool command_check_memory(command_talk *talk, double pool_mib, bool with_display, karst_error *error)
{
    struct rlimit limit;
    double need_mib = pool_mib + DRIVER_MIB + (with_display ? DISPLAY_MIB : 0);
    if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY)
        return true;
    double given_mib = (double)limit.rlim_cur / 1048576;
    if (given_mib < need_mib)
        return karst_fail(error, given_mib < DRIVER_MIB ? KARST_NO_DEVICE : KARST_FAILED,
                          "this process may use %.0f MiB of addresses only (ulimit -v), but the pool and the driver "
                          "with its compiler take about %.0f MiB: raise the limit (ulimit -v unlimited)%s",
                          given_mib, need_mib, pool_mib > 64 ? ", or choose a smaller --pool" : "");
    if (given_mib < need_mib + NEAR_MIB)
        command_say(talk,
                    "note: this process may use %.0f MiB of addresses only (ulimit -v); if the driver fails, that may "
                    "be why",
                    given_mib);
    return true;
}

/* ---- a last word ---- */

/* Under a sanitizer the last word is its own. */
#if defined(__SANITIZE_ADDRESS__)
void command_catch_crashes(void) {}
#else
static char last_word[640];
static size_t last_word_bytes;

static void die(int signal_number)
{
    /* The marker of the run stays where it is. */
    ssize_t written = write(STDERR_FILENO, last_word, last_word_bytes);
    (void)written;
    raise(signal_number); /* whose handler is the system's again */
}

void command_catch_crashes(void)
{
    static const int signals[] = {SIGSEGV, SIGBUS, SIGABRT, SIGILL, SIGFPE};
    struct rlimit limit;
    char memory[160] = "";
    if (getrlimit(RLIMIT_AS, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY)
        snprintf(memory, sizeof memory,
                 "; it may use %llu MiB of addresses only, which may be the reason: ulimit -v unlimited, or a smaller "
                 "--pool",
                 (unsigned long long)limit.rlim_cur >> 20);
    int length = snprintf(last_word, sizeof last_word,
                          "karst: the program died, most likely in the OpenCL driver%s. Run it again: the driver's "
                          "store of compiled kernels is then set aside, in case it is damaged\n",
                          memory);
    last_word_bytes = length > 0 && (size_t)length < sizeof last_word ? (size_t)length : 0;
    struct sigaction action = {.sa_handler = die, .sa_flags = (int)SA_RESETHAND | SA_NODEFER};
    sigemptyset(&action.sa_mask);
    for (size_t i = 0; i < sizeof signals / sizeof *signals; i++)
        sigaction(signals[i], &action, NULL);
}
#endif
