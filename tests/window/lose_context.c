/* Stands before the window library: from the moment that the file $KARST_TEST_LOSE exists, OpenGL says that its context
 * was lost. For LD_PRELOAD. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static unsigned reset_status(void)
{
    const char *file = getenv("KARST_TEST_LOSE");
    return file && access(file, F_OK) == 0 ? 0x8255 /* GL_UNKNOWN_CONTEXT_RESET */ : 0;
}

void (*glfwGetProcAddress(const char *name))(void);
void (*glfwGetProcAddress(const char *name))(void)
{
    void (*(*next)(const char *))(void);
    *(void **)&next = dlsym(RTLD_NEXT, "glfwGetProcAddress");
    if (strcmp(name, "glGetGraphicsResetStatus") == 0)
        return (void (*)(void))reset_status;
    return next(name);
}
