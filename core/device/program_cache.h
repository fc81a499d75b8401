/* Built programs kept on disk, so that a later process need not build them. Private to core: program.c uses it.
 *
 * Where: $KARST_CACHE_DIR, else $XDG_CACHE_HOME/karst, else $HOME/.cache/karst; in its folder "programs".
 * KARST_CACHE_DIR set to nothing or to "off" switches it off. The folder may be deleted at any time. It is used only if
 * it belongs to the user, and an entry only if it says of itself, word for word, what is asked for (expanded source,
 * options, device, driver, version of Karst) and its sums are right: one that is cut off, damaged or from elsewhere is
 * deleted and built anew. Entries appear whole or not at all; those not used for longest go when all together exceed
 * KARST_PROGRAM_CACHE_BYTES. Nothing that goes wrong here is an error: without the cache a program is built from
 * source. */
#ifndef KARST_CORE_PROGRAM_CACHE_H
#define KARST_CORE_PROGRAM_CACHE_H

#include "core/device/context.h"

#define KARST_PROGRAM_CACHE_BYTES ((uint64_t)256 << 20)

/* What a built program is known by. */
typedef struct {
    char *text;          /* all that its binary depends on; malloc'ed */
    size_t length_bytes; /* of text */
    char folder[1024];   /* "": the cache is off */
    char path[1100];     /* of the entry */
} karst_program_key;

/* Fills the key; with the cache off, or without memory for it, only says so in `folder`. Free with
 * karst_program_key_free. */
void karst_program_key_init(karst_program_key *key, const karst_context *context, const char *entry,
                            const char *options, const char *source);
void karst_program_key_free(karst_program_key *key);

/* Processes that start at once with a cold cache build a program one after the other: PoCL fails, or crashes,
 * where many build the same one for its store at the same time, and all but the first find it there. Waits until no
 * other process builds it, two minutes at most. Returns what to give back to karst_program_cache_end_turn; -1, which
 * is fine, too, where the cache is off or cannot be locked. */
int karst_program_cache_take_turn(const karst_program_key *key);
void karst_program_cache_end_turn(int turn);

/* The built program, ready for its kernels, or NULL if there is no good entry. */
cl_program karst_program_cache_load(karst_context *context, const karst_program_key *key, const char *options);
/* Keeps a program that was just built. Where the driver must do much work to give a binary out (PoCL compiles each
 * kernel once more for that, about as long as for using it), it is only noted down for karst_program_cache_finish. */
void karst_program_cache_store(karst_context *context, const karst_program_key *key, cl_program program);
/* Keeps what was noted down, once the queue is idle: may take seconds. */
void karst_program_cache_finish(karst_context *context);
/* What was noted down for one context is now for the other. */
void karst_program_cache_move(karst_context *from, karst_context *to);
/* Forgets it. */
void karst_program_cache_drop(karst_context *context);

#endif
