/* A saved world that is written while one looks at it: see demos/view/journal.h. */
#include "demos/view/journal.h"

#include <errno.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define EVERY_S 1
#define MOST_REDOABLE 10000

typedef struct {
    enum { APPEND, UNDO, REDO } kind;
    size_t num; /* of undo and redo */
    karst_edit edit;
} task;

typedef struct {
    task *tasks;
    size_t num, capacity;
} task_list;

struct view_journal {
    karst_saved *saved; /* the thread's while it runs */
    int voxel_log2_m;
    karst_edit *redoable;
    size_t num_redoable, max_redoable;
    task_list doing; /* likewise: taken, but not committed */

    pthread_mutex_t lock; /* of all below */
    pthread_cond_t wake;
    pthread_t thread;
    bool is_running, is_ending;
    task_list waiting;
    size_t num_doing;
    bool is_broken; /* something was not taken down: what follows it would be of another land */
    char why[256];
};

/* ---- opening ---- */

static bool gather(void *user, size_t number, size_t last, const karst_edit *edit)
{
    view_journal *j = user;
    (void)number, (void)last;
    if (!edit || j->num_redoable == j->max_redoable) {
        j->num_redoable = 0; /* what is lost cannot be done again, nor what comes after it */
        return false;
    }
    j->redoable[j->num_redoable++] = *edit;
    return true;
}

static bool read_redoable(view_journal *j, karst_error *error)
{
    size_t num_redoable, num = karst_saved_num_edits(j->saved, &num_redoable);
    if (num_redoable == 0 || num_redoable > MOST_REDOABLE)
        return true;
    j->redoable = malloc(num_redoable * sizeof *j->redoable);
    j->max_redoable = num_redoable;
    if (!j->redoable)
        return karst_fail(error, KARST_FAILED, "out of memory for %zu edits", num_redoable);
    return karst_saved_visit(j->saved, num + 1, num + num_redoable, j->voxel_log2_m, gather, j, error);
}

static bool check(view_journal *j, const char *path, size_t num_in_force, karst_error *error)
{
    const char *why;
    if (!karst_saved_is_writable(j->saved, &why))
        return karst_fail(error, KARST_FAILED, "%s cannot be written: %s", path, why);
    const size_t num = karst_saved_num_edits(j->saved, NULL);
    if (num != num_in_force)
        return karst_fail(error, KARST_FAILED, "%s has %zu edits in force, and %zu are on show here: %s", path, num,
                          num_in_force,
                          num > num_in_force ? "some are damaged, or were added meanwhile; open it again"
                                             : "some were undone meanwhile; open it again");
    return true;
}

view_journal *view_journal_open(const char *path, size_t num_in_force, int voxel_log2_m, karst_error *error)
{
    view_journal *j = calloc(1, sizeof *j);
    if (!j) {
        karst_fail(error, KARST_FAILED, "out of memory");
        return NULL;
    }
    pthread_mutex_init(&j->lock, NULL);
    pthread_cond_init(&j->wake, NULL);
    j->voxel_log2_m = voxel_log2_m;
    j->saved = karst_saved_open(path, true, NULL, error);
    if (j->saved && check(j, path, num_in_force, error) && read_redoable(j, error))
        return j;
    view_journal_close(j);
    return NULL;
}

const karst_edit *view_journal_redoable(const view_journal *journal, size_t *num)
{
    *num = journal->num_redoable;
    return journal->redoable;
}

/* ---- asking ---- */

static task *add_task(task_list *list)
{
    if (list->num == list->capacity) {
        size_t capacity = list->capacity ? 2 * list->capacity : 64;
        task *tasks = realloc(list->tasks, capacity * sizeof *tasks);
        if (!tasks)
            return NULL;
        list->tasks = tasks;
        list->capacity = capacity;
    }
    return &list->tasks[list->num++];
}

static void ask(view_journal *j, const task *wish)
{
    pthread_mutex_lock(&j->lock);
    task *added = j->is_broken ? NULL : add_task(&j->waiting);
    if (added) {
        *added = *wish;
    } else if (!j->is_broken) {
        j->is_broken = true;
        snprintf(j->why, sizeof j->why, "out of memory: what is done from here on is not kept");
    }
    pthread_cond_signal(&j->wake);
    pthread_mutex_unlock(&j->lock);
}

void view_journal_append(view_journal *journal, const karst_edit *edits, size_t num)
{
    for (size_t i = 0; i < num; i++)
        ask(journal, &(task){.kind = APPEND, .num = 1, .edit = edits[i]});
}

void view_journal_undo(view_journal *journal, size_t num)
{
    if (num)
        ask(journal, &(task){.kind = UNDO, .num = num});
}

void view_journal_redo(view_journal *journal, size_t num)
{
    if (num)
        ask(journal, &(task){.kind = REDO, .num = num});
}

view_journal_state view_journal_look(view_journal *journal)
{
    view_journal_state state;
    pthread_mutex_lock(&journal->lock);
    state.num_waiting = journal->waiting.num + journal->num_doing;
    state.is_saved = state.num_waiting == 0 && !journal->is_broken;
    memcpy(state.why, journal->why, sizeof state.why);
    pthread_mutex_unlock(&journal->lock);
    return state;
}

/* ---- doing ---- */

static bool take_over(view_journal *j)
{
    bool done = true;
    pthread_mutex_lock(&j->lock);
    for (size_t i = 0; i < j->waiting.num && done; i++) {
        task *added = add_task(&j->doing);
        done = added;
        if (added) {
            *added = j->waiting.tasks[i];
            continue;
        }
        j->doing.num -= i; /* another time */
    }
    if (done)
        j->waiting.num = 0;
    j->num_doing = j->doing.num;
    pthread_mutex_unlock(&j->lock);
    return done;
}

static bool go(karst_saved *saved, const task *t, karst_error *error)
{
    size_t num = t->num;
    return t->kind == UNDO ? karst_saved_undo(saved, &num, error) : karst_saved_redo(saved, &num, error);
}

/* A failure undoes all since the last commit. */
static bool write_tasks(view_journal *j, karst_error *error)
{
    bool done = true;
    for (size_t i = 0; done && i < j->doing.num; i++) {
        const task *t = &j->doing.tasks[i];
        done = t->kind == APPEND ? karst_saved_append(j->saved, &t->edit, 1, j->voxel_log2_m, error)
                                 : go(j->saved, t, error);
    }
    return done && karst_saved_commit(j->saved, error);
}

bool view_journal_turn(view_journal *journal)
{
    karst_error error = {0};
    const bool taken = take_over(journal);
    const bool done = write_tasks(journal, &error);
    pthread_mutex_lock(&journal->lock);
    if (done)
        journal->doing.num = journal->num_doing = 0;
    if (!journal->is_broken)
        snprintf(journal->why, sizeof journal->why, "%.250s", done ? "" : error.message);
    pthread_mutex_unlock(&journal->lock);
    return done && taken;
}

static void *write_along(void *user)
{
    view_journal *j = user;
    pthread_mutex_lock(&j->lock);
    while (!j->is_ending) {
        if (j->waiting.num + j->num_doing == 0) {
            pthread_cond_wait(&j->wake, &j->lock);
            continue;
        }
        pthread_mutex_unlock(&j->lock);
        view_journal_turn(j);
        struct timespec until;
        clock_gettime(CLOCK_REALTIME, &until);
        until.tv_sec += EVERY_S;
        pthread_mutex_lock(&j->lock);
        while (!j->is_ending && pthread_cond_timedwait(&j->wake, &j->lock, &until) != ETIMEDOUT)
            continue;
    }
    pthread_mutex_unlock(&j->lock);
    return NULL;
}

bool view_journal_start(view_journal *journal, karst_error *error)
{
    journal->is_running = pthread_create(&journal->thread, NULL, write_along, journal) == 0;
    return journal->is_running || karst_fail(error, KARST_FAILED, "cannot start a thread that saves");
}

/* ---- ending ---- */

karst_saved *view_journal_finish(view_journal *journal)
{
    if (journal->is_running) {
        pthread_mutex_lock(&journal->lock);
        journal->is_ending = true;
        pthread_cond_signal(&journal->wake);
        pthread_mutex_unlock(&journal->lock);
        pthread_join(journal->thread, NULL);
        journal->is_running = false;
    }
    view_journal_turn(journal);
    return journal->saved;
}

void view_journal_close(view_journal *journal)
{
    if (!journal)
        return;
    if (journal->saved)
        view_journal_finish(journal);
    karst_saved_close(journal->saved);
    pthread_mutex_destroy(&journal->lock);
    pthread_cond_destroy(&journal->wake);
    free(journal->redoable);
    free(journal->waiting.tasks);
    free(journal->doing.tasks);
    free(journal);
}
