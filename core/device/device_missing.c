/* Why there is no device: what is said is to help, so what is installed is looked at. */
#include "core/device/device_missing.h"

#include <dirent.h>
#include <dlfcn.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include "core/device/driver_internal.h"

#define VENDORS "/etc/OpenCL/vendors"
#define INSTALL "install pocl-opencl-icd (CPU) or your GPU's OpenCL driver"

static bool ends_in(const char *name, const char *suffix)
{
    size_t length = strlen(name), end = strlen(suffix);
    return length > end && strcmp(name + length - end, suffix) == 0;
}

/* The first driver that is registered and cannot be loaded, and why; or one that can. */
typedef struct {
    unsigned num_drivers, num_loaded;
    char name[256], why[512]; /* "": all could be loaded */
} driver_look;

static void look_at_library(const char *name, driver_look *look)
{
    look->num_drivers++;
    void *library = dlopen(name, RTLD_NOW | RTLD_LOCAL);
    if (library) {
        look->num_loaded++;
        dlclose(library);
    } else if (!*look->why) {
        const char *why = dlerror();
        snprintf(look->name, sizeof look->name, "%s", name);
        snprintf(look->why, sizeof look->why, "%s", why ? why : "its loader does not say why");
    }
}

/* A file of the loader's holds the name of a library. */
static void look_at_file(const char *path, driver_look *look)
{
    char line[PATH_MAX];
    FILE *file = fopen(path, "r");
    if (file && fgets(line, sizeof line, file)) {
        line[strcspn(line, "\r\n")] = 0;
        if (*line)
            look_at_library(line, look);
    }
    if (file)
        fclose(file);
}

/* As the loaders look: a folder of files that end in .icd, such a file, or a library. */
static void look_at_drivers(driver_look *look)
{
    const char *named = getenv("OCL_ICD_VENDORS"), *khronos = getenv("OCL_ICD_FILENAMES");
    const char *place = named && *named ? named : khronos && *khronos ? khronos : VENDORS;
    struct stat info;
    char path[PATH_MAX];
    *look = (driver_look){0};
    if (stat(place, &info) != 0) {
        if (ends_in(place, ".so") || strstr(place, ".so."))
            look_at_library(place, look);
        return;
    }
    if (S_ISREG(info.st_mode)) {
        if (ends_in(place, ".icd"))
            look_at_file(place, look);
        else
            look_at_library(place, look);
        return;
    }
    DIR *dir = opendir(place);
    const struct dirent *entry;
    while (dir && (entry = readdir(dir)) != NULL)
        if (ends_in(entry->d_name, ".icd") &&
            snprintf(path, sizeof path, "%s/%s", place, entry->d_name) < (int)sizeof path)
            look_at_file(path, look);
    if (dir)
        closedir(dir);
}

bool karst_device_memory_limit(char text[128])
{
    struct rlimit limit;
    text[0] = 0;
    if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY)
        return false;
    snprintf(text, 128, "this process may use %llu MiB of addresses: raise that limit (ulimit -v unlimited)",
             (unsigned long long)limit.rlim_cur >> 20);
    return true;
}

int karst_device_missing(cl_int platforms_code, cl_int devices_code, karst_error *error)
{
    driver_look look;
    char limit[128], code[64] = "";
    bool is_limited = karst_device_memory_limit(limit);
    look_at_drivers(&look);
    if (!look.num_drivers)
        return karst_fail(error, KARST_NO_DEVICE, "no OpenCL device found, and no driver is installed: " INSTALL);
    if (*look.why)
        return karst_fail(error, KARST_NO_DEVICE, "no OpenCL device found: the driver %s cannot be loaded (%s); %s",
                          look.name, look.why,
                          is_limited ? limit : "mend or reinstall it, or " INSTALL);
    karst_driver_suspect();
    if (platforms_code != CL_SUCCESS || devices_code != CL_SUCCESS)
        snprintf(code, sizeof code, " (%s)", karst_cl_error_name(platforms_code ? platforms_code : devices_code));
    if (is_limited)
        return karst_fail(error, KARST_NO_DEVICE,
                          "no OpenCL device found: a driver is installed and loads, but gives no device%s; %s", code,
                          limit);
    return karst_fail(error, KARST_NO_DEVICE,
                      "no OpenCL device found: a driver is installed and loads, but gives no device%s; what it says on "
                      "stderr may help (POCL_DEBUG=error), or " INSTALL,
                      code);
}
