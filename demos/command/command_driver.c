/* What is asked of the OpenCL driver before it is opened: where its threads run, where it keeps what it compiles. */
#include "demos/command/command.h"

#include <sched.h>
#include <stdlib.h>
#include <unistd.h>

/* Whether this process may use the CPUs 0, 1 ... of all that there are: PoCL binds its i-th thread to the i-th CPU,
 * allowed or not, and ends the program if there is none. */
static bool has_all_cpus(void)
{
    cpu_set_t cpus;
    long num_cpus = sysconf(_SC_NPROCESSORS_ONLN);
    if (sched_getaffinity(0, sizeof cpus, &cpus) != 0 || num_cpus < 1 || num_cpus != CPU_COUNT(&cpus))
        return false;
    for (int i = 0; i < (int)num_cpus; i++)
        if (!CPU_ISSET(i, &cpus))
            return false;
    return true;
}

static void bind_threads(void)
{
    /* More threads than CPUs are somebody's wish. */
    if (!getenv("POCL_MAX_PTHREAD_COUNT") && !getenv("POCL_CPU_MAX_CU_COUNT") && has_all_cpus())
        setenv("POCL_AFFINITY", "1", 0);
}

void command_open_driver(command_talk *talk)
{
    const karst_log log = command_log(talk);
    bind_threads();
    karst_driver_begin(&log);
}
