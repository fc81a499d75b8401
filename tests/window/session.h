/* A viewer in a real X server of its own, with real events: Xvfb and xdotool. What it did is seen in its statistics
 * (F3) and in pictures of its window. Nothing waits by the clock but up to generous limits, so a busy machine is only
 * slow. */
#ifndef KARST_TESTS_WINDOW_SESSION_H
#define KARST_TESTS_WINDOW_SESSION_H

#include <errno.h>
#include <fcntl.h>
#include <jansson.h>
#include <limits.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

#include <karst/image.h>

/* Not every test needs all of it. */
#define HELPER static __attribute__((unused))

#define WAIT_S 200.0 /* for what takes a moment on an idle machine, kernels to be compiled included */

typedef struct {
    pid_t server, viewer;
    char karst[PATH_MAX], folder[PATH_MAX - 64]; /* scratch: the viewer runs in it */
    int width, height;
    json_t *stats; /* the last ones asked for */
} session;
static session s;

HELPER double now_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + (double)now.tv_nsec * 1e-9;
}

HELPER void nap(double seconds) { usleep((useconds_t)(seconds * 1e6)); }

/* Under sanitizers a window takes minutes for each key, and its drivers leak: says so, and true. */
HELPER bool is_left_out(void)
{
    bool left_out = getenv("KARST_TEST_QUICK") != NULL;
    if (left_out)
        puts("ok 1 # SKIP windows are tested without sanitizers");
    return left_out;
}

/* ---- server and viewer ---- */

HELPER void start_server(void)
{
    int ends[2];
    assert_int_equal(pipe(ends), 0);
    s.server = fork();
    assert_true(s.server >= 0);
    if (s.server == 0) {
        char number[16];
        snprintf(number, sizeof number, "%d", ends[1]);
        int null = open("/dev/null", O_WRONLY);
        dup2(null, 2);
        close(ends[0]);
        execlp("Xvfb", "Xvfb", "-displayfd", number, "-screen", "0", "1280x1024x24", "-nolisten", "tcp", "-noreset",
               (char *)NULL);
        _exit(127);
    }
    close(ends[1]);
    char text[32] = ":";
    /* All of the line: a server that cannot write the rest of it ends. */
    for (size_t length = 1; !strchr(text, '\n') && length + 1 < sizeof text; length++)
        if (read(ends[0], text + length, 1) != 1)
            fail_msg("Xvfb does not start: is it installed?");
    close(ends[0]);
    text[strcspn(text, "\n")] = 0;
    setenv("DISPLAY", text, 1);
    for (double end_s = now_s() + WAIT_S; system("xdotool getmouselocation > /dev/null 2>&1") != 0; nap(0.1))
        if (now_s() > end_s)
            fail_msg("Xvfb or xdotool does not answer: are they installed?");
}

HELPER void stop(pid_t *process, int with)
{
    if (*process > 0) {
        kill(*process, with);
        waitpid(*process, NULL, 0);
    }
    *process = 0;
}

HELPER int open_session(void **state)
{
    (void)state;
    const char *karst = getenv("KARST");
    if (!realpath(karst && *karst ? karst : "build/karst", s.karst))
        fail_msg("%s: no such program", karst ? karst : "build/karst");
    if (!getenv("KARST_DATA_DIR")) {
        char demos[PATH_MAX];
        assert_non_null(realpath("demos", demos));
        setenv("KARST_DATA_DIR", demos, 1);
    }
    snprintf(s.folder, sizeof s.folder, "%s/karst-window-XXXXXX", getenv("TMPDIR") ? getenv("TMPDIR") : "/tmp");
    assert_non_null(mkdtemp(s.folder));
    /* These tests wait often until a view is settled. */
    setenv("KARST_VIEW_VIEW_SAMPLES", "2", 0);
    setenv("XDG_STATE_HOME", s.folder, 1);
    setenv("XDG_CONFIG_HOME", s.folder, 1);
    start_server();
    return 0;
}

HELPER int close_session(void **state)
{
    (void)state;
    char command[PATH_MAX + 16];
    stop(&s.viewer, SIGKILL);
    stop(&s.server, SIGTERM);
    json_decref(s.stats);
    snprintf(command, sizeof command, "rm -rf '%s'", s.folder);
    return system(command);
}

/* In the scratch folder. */
HELPER const char *in_folder(const char *name)
{
    static char paths[4][PATH_MAX];
    static unsigned next;
    char *path = paths[next++ % 4];
    snprintf(path, PATH_MAX, "%s/%s", s.folder, name);
    return path;
}

/* Emptied and written, as by many programs: who looks meanwhile sees an empty file. */
HELPER void write_in_place(const char *name, const char *text)
{
    FILE *file = fopen(in_folder(name), "w");
    assert_non_null(file);
    assert_true(fputs(text, file) >= 0);
    assert_int_equal(fclose(file), 0);
}

/* Whole at once, as by others: under another name first. */
HELPER void write_file(const char *name, const char *text)
{
    write_in_place("being-written", text);
    assert_int_equal(rename(in_folder("being-written"), in_folder(name)), 0);
}

HELPER char *read_file(const char *name)
{
    static char text[65536];
    FILE *file = fopen(in_folder(name), "r");
    size_t length = file ? fread(text, 1, sizeof text - 1, file) : 0;
    text[length] = 0;
    if (file)
        fclose(file);
    return text;
}

/* karst view ARGUMENTS, split at blanks; stderr goes to the file "said". */
HELPER void launch(const char *arguments)
{
    char *words[40] = {s.karst, (char[]){"view"}, NULL}, text[1024];
    int num_words = 2;
    snprintf(text, sizeof text, "%s", arguments);
    for (char *word = strtok(text, " "); word && num_words < 39; word = strtok(NULL, " "))
        words[num_words++] = word;
    words[num_words] = NULL;
    unlink(in_folder("stats.json"));
    s.viewer = fork();
    assert_true(s.viewer >= 0);
    if (s.viewer == 0) {
        int said = open(in_folder("said"), O_WRONLY | O_CREAT | O_TRUNC, 0666);
        dup2(said, 2);
        if (chdir(s.folder) == 0)
            execv(s.karst, words);
        _exit(127);
    }
}

HELPER bool has_ended(int *status)
{
    if (s.viewer <= 0 || waitpid(s.viewer, status, WNOHANG) != s.viewer)
        return false;
    s.viewer = 0;
    return true;
}

HELPER int wait_for_end(void)
{
    int status = -1;
    for (double end_s = now_s() + WAIT_S; now_s() < end_s; nap(0.05))
        if (has_ended(&status))
            return WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + WTERMSIG(status);
    stop(&s.viewer, SIGKILL);
    fail_msg("the viewer does not end; it said: %s", read_file("said"));
    return -1;
}

/* ---- events ---- */

/* xdotool WORDS. */
HELPER bool act(const char *format, ...)
{
    char words[512], command[600];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(words, sizeof words, format, arguments);
    va_end(arguments);
    snprintf(command, sizeof command, "xdotool %s > /dev/null 2>&1", words);
    return system(command) == 0;
}

HELPER void key(const char *name) { assert_true(act("key --clearmodifiers %s", name)); }

/* ---- what the viewer says ---- */

/* Asks for statistics by a key and reads them; false if none come. */
HELPER bool ask_by(const char *with)
{
    const char *file = in_folder("stats.json");
    int status;
    unlink(file);
    for (double end_s = now_s() + WAIT_S, again_s = 0; now_s() < end_s; nap(0.02)) {
        if (s.viewer > 0 && has_ended(&status))
            fail_msg("the viewer ended (status %d) instead of answering; it said: %s", status, read_file("said"));
        if (now_s() > again_s) { /* a key may come before there is a window to hear it */
            act("key %s", with);
            again_s = now_s() + 3;
        }
        json_t *stats = access(file, R_OK) == 0 ? json_load_file(file, 0, NULL) : NULL;
        if (stats) {
            json_decref(s.stats);
            s.stats = stats;
            return true;
        }
    }
    return false;
}

HELPER bool ask(void) { return ask_by("--clearmodifiers F3"); }
/* The same, while the test holds a modifier, which --clearmodifiers would let go of for a moment. */
HELPER bool ask_holding(void) { return ask_by("F3"); }

HELPER json_t *viewer_value(const char *name) { return json_object_get(json_object_get(s.stats, "viewer"), name); }
HELPER double number(const char *name) { return json_number_value(viewer_value(name)); }
HELPER const char *text(const char *name)
{
    const char *value = json_string_value(viewer_value(name));
    return value ? value : "";
}
HELPER bool yes(const char *name) { return json_is_true(viewer_value(name)); }
HELPER double parameter(const char *name)
{
    return json_number_value(json_object_get(viewer_value("parameters"), name));
}
HELPER json_int_t produced(void)
{
    return json_integer_value(json_object_get(json_object_get(s.stats, "churn"), "produced"));
}

/* Asks until the condition, about `number`, `text` and so on, holds. */
#define UNTIL(condition)                                                                 \
    do {                                                                                 \
        double until_s = now_s() + WAIT_S;                                               \
        do                                                                               \
            assert_true(ask());                                                          \
        while (!(condition) && now_s() < until_s);                                       \
        if (!(condition)) {                                                              \
            char *dump = json_dumps(json_object_get(s.stats, "viewer"), JSON_INDENT(1)); \
            fail_msg("never: %s\n%s\nsaid: %s", #condition, dump, read_file("said"));    \
        }                                                                                \
    } while (0)

typedef struct {
    double x, y, z, yaw, pitch, fov;
} place;

HELPER place where(void)
{
    place p = {0};
    assert_int_equal(sscanf(text("camera"), "%lf,%lf,%lf,%lf,%lf,%lf", &p.x, &p.y, &p.z, &p.yaw, &p.pitch, &p.fov), 6);
    return p;
}

/* Settled twice at the same place: a busy machine may say "settled" of a frame before the last key. */
HELPER void until_at_rest(void)
{
    char last[400] = "";
    for (int tries = 0; tries < 100; tries++) {
        UNTIL(yes("settled"));
        if (strcmp(last, text("camera")) == 0)
            return;
        snprintf(last, sizeof last, "%s", text("camera"));
        nap(0.4);
    }
    fail_msg("never at rest: %s", last);
}

/* Opens a viewer, and waits until its picture has settled. */
HELPER void open_viewer(const char *arguments)
{
    char all[800];
    s.width = 320;
    s.height = 240;
    snprintf(all, sizeof all, "%s --stats stats.json --detail 2 --pool 64 --no-shadows", arguments);
    launch(all);
    act("mousemove 160 120");
    UNTIL(yes("settled"));
}

HELPER void close_viewer(void)
{
    for (int i = 0; i < 8 && s.viewer > 0; i++) { /* closes panels first; the last two leave */
        act("key Escape");
        nap(0.2);
        int status;
        if (has_ended(&status)) {
            assert_true(WIFEXITED(status));
            assert_int_equal(WEXITSTATUS(status), 0);
        }
    }
    if (s.viewer > 0) { /* keys that did not arrive: the polite way */
        kill(s.viewer, SIGTERM);
        assert_int_equal(wait_for_end(), 0);
    }
}

/* ---- pictures of the window ---- */

typedef struct {
    uint8_t *rgba;
    int width, height;
} shot;

HELPER shot take_shot(void)
{
    shot taken = {0};
    char command[PATH_MAX + 80];
    snprintf(command, sizeof command, "import -window root -crop %dx%d+0+0 +repage png32:'%s' 2> /dev/null", s.width,
             s.height, in_folder("shot.png"));
    assert_int_equal(system(command), 0);
    taken.rgba = karst_image_read_png(in_folder("shot.png"), &taken.width, &taken.height, NULL);
    assert_non_null(taken.rgba);
    return taken;
}

/* Pixels that differ by more than a little. */
HELPER int count_changes(const shot *a, const shot *b)
{
    int num = 0;
    assert_int_equal(a->width, b->width);
    assert_int_equal(a->height, b->height);
    for (int i = 0; i < a->width * a->height; i++) {
        int most = 0;
        for (int c = 0; c < 3; c++)
            most = abs(a->rgba[4 * i + c] - b->rgba[4 * i + c]) > most ? abs(a->rgba[4 * i + c] - b->rgba[4 * i + c])
                                                                       : most;
        num += most > 12;
    }
    return num;
}

/* The mean of a channel over the lower half, where the ground is. */
HELPER double mean_below(const shot *a, int channel)
{
    double sum = 0;
    for (int i = a->width * a->height / 2; i < a->width * a->height; i++)
        sum += a->rgba[4 * i + channel];
    return sum / (a->width * a->height / 2);
}

#endif
