/* Measures importing: makes a scan of so many points (KARST_SCAN_POINTS, default 10^6) of a rolling ground with boxes
 * on it, 1 km wide, as a laser sees it from above, and imports it. KARST_SCAN_FILE=path keeps the model there.
 * KARST_SCAN_WRITE=path writes the scan there, as a PLY, and does nothing else. KARST_SCAN_FOLDER: where the files lie
 * meanwhile (default: /tmp). */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "karst/points.h"
#include "tests/noise/random.h"

static double now_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static double cpu_s(void)
{
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    return (double)(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
           1e-6 * (double)(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
}

/* Ground, and on every second square of 40 m a house with a flat roof and walls that are a little aslant. */
static double height_at(double x, double z)
{
    double ground = 20 * sin(x / 90) * cos(z / 70) + 4 * sin(x / 17 + z / 23);
    double u = fabs(fmod(x + 2000, 40) - 20), v = fabs(fmod(z + 2000, 40) - 20), inside = 12 - fmax(u, v);
    bool has_house = ((int)floor((x + 2000) / 40) + (int)floor((z + 2000) / 40)) % 2 == 0;
    return ground + (has_house ? fmin(fmax(4 * inside, 0), 8) : 0);
}

static bool write_scan(const char *path, uint64_t num)
{
    FILE *file = fopen(path, "wb");
    if (!file)
        return false;
    fprintf(file,
            "ply\nformat binary_little_endian 1.0\nelement vertex %llu\nproperty float x\nproperty float y\n"
            "property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n",
            (unsigned long long)num);
    for (uint64_t i = 0; i < num; i++) {
        double x = 1000 * random_unit(), z = 1000 * random_unit(), y = height_at(x, z) + 0.01 * random_unit();
        float at[3] = {(float)x, (float)y, (float)z};
        uint8_t rgb[3] = {(uint8_t)(100 + 2 * y), 120, 90};
        if (fwrite(at, sizeof *at, 3, file) != 3 || fwrite(rgb, 1, 3, file) != 3)
            break;
    }
    return fclose(file) == 0;
}

static bool say_step(void *user, const char *what, double share)
{
    static const char *last = "";
    double *start = user;
    (void)share;
    if (strcmp(last, what) != 0) {
        struct rusage usage;
        getrusage(RUSAGE_SELF, &usage);
        printf("  %6.1f s, CPU %6.1f s, at most %ld MiB so far  %s\n", now_s() - *start, cpu_s(),
               usage.ru_maxrss / 1024, what);
        fflush(stdout);
    }
    last = what;
    return true;
}

int main(void)
{
    const char *wanted = getenv("KARST_SCAN_POINTS"), *kept = getenv("KARST_SCAN_FILE");
    const char *only = getenv("KARST_SCAN_WRITE"), *at = getenv("KARST_SCAN_FOLDER");
    uint64_t num = wanted ? (uint64_t)strtod(wanted, NULL) : 1000000;
    char folder[400], input[512], output[512];
    struct rusage usage;
    struct stat about_file;
    karst_points_about about;
    karst_error error = {0};
    if (only)
        return !write_scan(only, num);
    snprintf(folder, sizeof folder, "%s/karst-scan-XXXXXX", at ? at : "/tmp");
    if (!mkdtemp(folder))
        return 1;
    snprintf(input, sizeof input, "%s/scan.ply", folder);
    snprintf(output, sizeof output, "%s/scan.karstpoints", folder);
    bool done = write_scan(input, num);
    double start = now_s(), start_cpu = cpu_s();
    const karst_points_import_config config = {.input = input,
                                               .output = kept ? kept : output,
                                               .turn = KARST_POINTS_TURN_TOGETHER,
                                               .axes = KARST_POINTS_AS_THEY_ARE,
                                               .progress = say_step,
                                               .resumable = true,
                                               .user = &start};
    done = done && karst_points_import(&config, &about, &error) && stat(config.output, &about_file) == 0;
    double seconds = now_s() - start;
    getrusage(RUSAGE_SELF, &usage);
    if (done)
        printf("%llu points in %.1f s: %.3f million a second; CPU %.1f s; at most %.0f MiB resident, files that are "
               "mapped included; the model has %.0f MB, %u levels, %llu parts, %.3f unsure\n",
               (unsigned long long)num, seconds, (double)num / seconds / 1e6, cpu_s() - start_cpu,
               (double)usage.ru_maxrss / 1024, (double)about_file.st_size / 1e6, about.num_levels,
               (unsigned long long)about.num_parts, about.share_unsure);
    else
        fprintf(stderr, "%s\n", error.message);
    unlink(input);
    unlink(output);
    rmdir(folder);
    return !done;
}
