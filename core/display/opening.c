/* Opening drivers beside an engine: see core/display/opening.h. */
#include "core/display/opening.h"

#include <pthread.h>
#include <signal.h>
#include <stdlib.h>

#include "core/display/display_platform.h"
#include "core/base/log_later.h"

struct karst_opening {
    const karst_log *log;
    bool with_display, is_thread;
    karst_display_kind kind;
    pthread_t thread;
    pthread_mutex_t lock;
    pthread_cond_t changed;
    bool has_devices, has_display; /* they, or the reason why there are none */
    bool goes_on, is_over;         /* with the display; nobody wants it */
    karst_device_info *devices;
    size_t num_devices;
    karst_display *display;
    karst_error devices_error, display_error;
    karst_log_later later;
};

static void tell(karst_opening *opening, bool *what)
{
    pthread_mutex_lock(&opening->lock);
    *what = true;
    pthread_cond_broadcast(&opening->changed);
    pthread_mutex_unlock(&opening->lock);
}

static void wait_for(karst_opening *opening, const bool *what)
{
    pthread_mutex_lock(&opening->lock);
    while (!*what)
        pthread_cond_wait(&opening->changed, &opening->lock);
    pthread_mutex_unlock(&opening->lock);
}

/* One after the other, as both load some of the same libraries, and the loader lets one at a time. LLVM has signals
 * handled on a stack of its own in the thread that loads it; the thread's own, which who gave it that takes back (as
 * AddressSanitizer does), is put in place again. */
static void *run(void *user)
{
    karst_opening *opening = user;
    stack_t signal_stack;
    const bool has_stack = sigaltstack(NULL, &signal_stack) == 0;
    opening->devices = karst_context_list(&opening->num_devices, &opening->devices_error);
    tell(opening, &opening->has_devices);
    wait_for(opening, &opening->goes_on);
    pthread_mutex_lock(&opening->lock);
    const bool is_wanted = opening->with_display && !opening->is_over;
    pthread_mutex_unlock(&opening->lock);
    if (is_wanted) {
        opening->display = karst_display_create(opening->kind, &opening->later.log, &opening->display_error);
        if (opening->display)
            karst_display_leave(opening->display);
    }
    if (has_stack)
        sigaltstack(&signal_stack, NULL);
    tell(opening, &opening->has_display);
    return NULL;
}

karst_opening *karst_opening_begin(bool with_display, karst_display_kind kind, const karst_log *log,
                                   karst_error *error)
{
    karst_opening *opening = calloc(1, sizeof *opening);
    if (!opening) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    opening->log = log;
    opening->with_display = with_display;
    opening->kind = kind;
    karst_log_later_init(&opening->later, log);
    pthread_mutex_init(&opening->lock, NULL);
    pthread_cond_init(&opening->changed, NULL);
    opening->is_thread = pthread_create(&opening->thread, NULL, run, opening) == 0;
    if (!opening->is_thread) {
        opening->goes_on = true;
        run(opening);
    }
    return opening;
}

const karst_device_info *karst_opening_devices(karst_opening *opening, size_t *num_devices, karst_error *error)
{
    wait_for(opening, &opening->has_devices);
    *num_devices = opening->num_devices;
    if (!opening->devices && error)
        *error = opening->devices_error;
    return opening->devices;
}

void karst_opening_go_on(karst_opening *opening) { tell(opening, &opening->goes_on); }

karst_display *karst_opening_display(karst_opening *opening, karst_error *error)
{
    karst_opening_go_on(opening);
    wait_for(opening, &opening->has_display);
    karst_display *display = opening->display;
    karst_log_later_say(&opening->later, opening->log);
    if (display)
        display->log = opening->log;
    else if (error)
        *error = opening->display_error;
    opening->display = NULL;
    return display;
}

void karst_opening_end(karst_opening *opening)
{
    if (!opening)
        return;
    tell(opening, &opening->is_over);
    karst_opening_go_on(opening);
    if (opening->is_thread)
        pthread_join(opening->thread, NULL);
    karst_display_destroy(opening->display);
    karst_log_later_say(&opening->later, NULL);
    pthread_cond_destroy(&opening->changed);
    pthread_mutex_destroy(&opening->lock);
    free(opening->devices);
    free(opening);
}
