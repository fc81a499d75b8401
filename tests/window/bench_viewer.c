/* What the viewer takes: start, rest, flight, the way back to full detail, a colour edit. Figures, no judgement. With
 * KARST naming the command; 800x600, the world hills. PARTS names some of them: stop flight edit. */
#include "tests/window/session.h"

#define SIZE " --size 800x600 --stats stats.json"
#define REST_S 5.0

static double cpu_s(pid_t process)
{
    char path[64], line[1024];
    unsigned long user = 0, system_time = 0;
    snprintf(path, sizeof path, "/proc/%d/stat", (int)process);
    FILE *file = fopen(path, "r");
    if (file && fgets(line, sizeof line, file))
        sscanf(strrchr(line, ')') + 2, "%*c %*d %*d %*d %*d %*d %*u %*u %*u %*u %*u %lu %lu", &user, &system_time);
    if (file)
        fclose(file);
    return (double)(user + system_time) / (double)sysconf(_SC_CLK_TCK);
}

static void open_hills(const char *arguments)
{
    char all[512];
    snprintf(all, sizeof all, "%s" SIZE, arguments);
    launch(all);
    act("mousemove 400 300");
    UNTIL(yes("settled"));
}

static void load_end(void)
{
    wait_for_end();
    json_decref(s.stats);
    s.stats = json_load_file(in_folder("stats.json"), 0, NULL);
    assert_non_null(s.stats);
}

/* The parts named in PARTS, or all. */
static bool wanted(const char *part)
{
    const char *parts = getenv("PARTS");
    return !parts || !*parts || strstr(parts, part);
}

/* Without asking, which costs time. */
static void wait_until_idle(void)
{
    double end_s = now_s() + WAIT_S;
    for (double before_s = cpu_s(s.viewer), used_s = 1; used_s > 0.02 && now_s() < end_s; before_s += used_s) {
        nap(0.5);
        used_s = cpu_s(s.viewer) - before_s;
    }
}

static void fly_and_stop(void)
{
    for (int i = 0; i < 3; i++) {
        act("keydown w");
        nap(3);
        act("keyup w");
        wait_until_idle();
        UNTIL(yes("settled"));
        printf("from a stop to all pixels             %8.2f s\n", number("full_after_s"));
        printf("from a stop to the level that is set  %8.2f s\n", number("sharp_after_s"));
        printf("from a stop to nothing wanted         %8.2f s\n", number("settled_after_s"));
    }
}

static void measure_start_and_stop(void)
{
    open_hills("hills");
    printf("start to the first picture            %8.2f s\n", number("first_frame_s"));
    wait_until_idle(); /* the pool's memory is found, the compiler loaded */
    double before_s = cpu_s(s.viewer);
    nap(REST_S);
    printf("settled, of one core                  %8.1f %%\n", 100 * (cpu_s(s.viewer) - before_s) / REST_S);
    printf("  at 82 m/s, 300 m above the ground:\n");
    fly_and_stop();
    close_viewer();
    printf("  at 30 m/s, 20 m above the ground, along a piece of low-flight:\n");
    open_hills("hills --camera 120,-89.5,207.8,30,-6 --speed 30");
    wait_until_idle();
    fly_and_stop();
    close_viewer();
}

static void measure_flight(void)
{
    launch("hills --replay low-flight" SIZE);
    load_end();
    const json_t *times = json_object_get(json_object_get(s.stats, "time_ms"), "frame");
    printf("low flight, 30 fps: frames in 33 ms   %8.1f %% of %.0f\n",
           100 * (1 - number("frames_late") / number("frames_moving")), number("frames_moving"));
    printf("   frame, median / p95 / p99          %8.1f %.1f %.1f ms\n",
           json_number_value(json_object_get(times, "median")), json_number_value(json_object_get(times, "p95")),
           json_number_value(json_object_get(times, "p99")));
    static const char *const stages[] = {"cast", "shade", "collect", "subdivide", "evaluate", "finalise", "display"};
    for (int i = 0; i < 7; i++) {
        const json_t *stage = json_object_get(json_object_get(s.stats, "time_ms"), stages[i]);
        printf("   %-9s median / p95              %8.1f %.1f ms\n", stages[i],
               json_number_value(json_object_get(stage, "median")), json_number_value(json_object_get(stage, "p95")));
    }
}

/* Colours that no compiler has seen: PoCL keeps what it compiled. */
static void measure_edit(void)
{
    char command[2 * PATH_MAX + 64];
    snprintf(command, sizeof command, "cp '%s/worlds/hills.karst' '%s'", getenv("KARST_DATA_DIR"),
             in_folder("mine.karst"));
    assert_int_equal(system(command), 0);
    open_hills("mine.karst");
    for (int i = 0; i < 3; i++) {
        snprintf(command, sizeof command, "sed -i 's/vec3 grass = .*/vec3 grass = vec3(0.6, 0.1, 0.0%d%d);/' '%s'", i,
                 (int)(getpid() % 10000), in_folder("mine.karst"));
        double saved_s = now_s();
        double at_once = number("colours_at_once");
        assert_int_equal(system(command), 0);
        UNTIL(number("colours_at_once") > at_once || number("reloads") == i + 1);
        printf("a colour edit, on the screen          %8.2f s\n", now_s() - saved_s);
        UNTIL(number("reloads") == i + 1);
        printf("a colour edit, new to the compiler    %8.2f s (seen after %.2f s; frames %.0f, longest %.0f ms)\n",
               number("reload_s"), now_s() - saved_s, number("frames_while_compiling"),
               number("longest_while_compiling_ms"));
    }
    UNTIL(yes("settled"));
    close_viewer();
}

static void measure(void **state)
{
    (void)state;
    open_hills("hills"); /* whatever has to be compiled is, by now */
    close_viewer();
    if (wanted("stop"))
        measure_start_and_stop();
    if (wanted("flight"))
        measure_flight();
    if (wanted("edit"))
        measure_edit();
}

int main(void)
{
    setvbuf(stdout, NULL, _IOLBF, 0);
    const struct CMUnitTest tests[] = {cmocka_unit_test(measure)};
    return cmocka_run_group_tests(tests, open_session, close_session);
}
