/* karst edit: the log of a saved world's edits, and care for its file. */
#include "command.h"

#include <ctype.h>
#include <jansson.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    const char *path, *from, *backup, *recover, *export_as, *output, *world;
    command_list add, paint;
    uint64_t undo, redo;
    bool has_undo, has_redo, log, compact, check, json, help;
} edit_options;

typedef struct {
    const edit_options *o;
    command_talk *talk;
    karst_saved *saved;
    json_t *json; /* NULL: text */
    FILE *out;
    size_t num_added, num_undone, num_redone, num_wrong, num_written;
    bool is_full; /* what was written could not be */
} editing;

static void print_help(const command_option *options, size_t num_options)
{
    puts("karst edit FILE.karstdb [OPTIONS]\n"
         "Edits a saved world (karst new makes one). When it ends with 0, what it was told is on the disk. What is\n"
         "asked for is done in this order: undo, redo, from, add, paint, compact, check, log, export, backup. Without\n"
         "an option it says how many edits there are.\n"
         "\nOptions:");
    command_print_options(stdout, options, num_options);
    puts("\nEdits: SHAPE,VALUES[,MODE][,NAME=VALUE...]; lengths are metres, coordinates exact decimals of any length\n"
         "  sphere,X,Y,Z,RADIUS                       modes: add (the default), remove, paint,\n"
         "  box,X,Y,Z,HALF_X,HALF_Y,HALF_Z                   flatten (sphere and box), smooth (sphere)\n"
         "  capsule,X,Y,Z,TO_X,TO_Y,TO_Z,RADIUS       blend=M rounds edges off\n"
         "  plane,X,Y,Z                               normal=X:Y:Z (plane, flatten, smooth): which way is up\n"
         "  noise,X,Y,Z,RADIUS,AMPLITUDE,SCALE        seed=N (noise)\n"
         "  colour=R:G:B (paint, add): linear, 0 to 1 strength=S (with it, smooth): how much it covers, 1 if left out\n"
         "\nExamples:\n"
         "  karst edit mine.karstdb --add sphere,300,60,400,12,remove\n"
         "  karst edit mine.karstdb --add box,1000000000010,20,0,4,30,4,blend=2 --add capsule,0,9,0,0,9,90,3\n"
         "  karst edit mine.karstdb --paint sphere,300,60,400,20,colour=0.6:0.1:0.05,blend=4\n"
         "  karst edit mine.karstdb --undo 2\n"
         "  karst edit mine.karstdb --log --json | jq -c '.log[]'\n"
         "  karst edit mine.karstdb --export text > edits.json && karst view hills --edits edits.json\n"
         "  karst edit mine.karstdb --backup copy.karstdb\n"
         "\nExit code: 0 done, 1 failed (also: another process has it open for writing), 2 wrong usage, 5 the file, or "
         "one\n"
         "of edits, cannot be read, or --check found damage.");
}

/* ---- changes ---- */

/* --paint's, which leave the mode out. */
static bool read_paint(const char *text, int voxel_log2_m, karst_edit *edit, karst_error *error)
{
    if (!karst_edit_parse(text, voxel_log2_m, edit, error))
        return false;
    if (!edit->has_colour || (edit->mode != KARST_EDIT_ADD && edit->mode != KARST_EDIT_PAINT))
        return karst_fail(error, KARST_USAGE, "what is painted has a colour, colour=R:G:B, and no other mode");
    edit->mode = KARST_EDIT_PAINT;
    return true;
}

/* The edits of --add, or of --paint. */
static bool add_texts(editing *e, const command_list *add, bool paint, int voxel_log2_m, karst_error *error)
{
    karst_edit *edits = calloc(add->num_items + 1, sizeof *edits);
    bool done = edits || karst_fail(error, KARST_FAILED, "out of memory for %zu edits", add->num_items);
    for (size_t i = 0; done && i < add->num_items; i++) {
        karst_error reason = {0};
        if (!(paint ? read_paint : karst_edit_parse)(add->items[i], voxel_log2_m, &edits[i], &reason))
            done = karst_fail(error, reason.status, "--%s %.200s: %s", paint ? "paint" : "add", add->items[i],
                              reason.message);
    }
    done = done && karst_saved_append(e->saved, edits, add->num_items, voxel_log2_m, error);
    free(edits);
    e->num_added += done ? add->num_items : 0;
    return done;
}

static bool add_file(editing *e, int voxel_log2_m, karst_error *error)
{
    size_t num;
    const karst_log log = command_log(e->talk);
    karst_edit *edits = command_load_edits(e->o->from, voxel_log2_m, &num, &log, error);
    bool done = edits && karst_saved_append(e->saved, edits, num, voxel_log2_m, error);
    free(edits);
    e->num_added += done ? num : 0;
    return done;
}

static bool change(editing *e, karst_error *error)
{
    const edit_options *o = e->o;
    int voxel_log2_m = karst_saved_get_about(e->saved)->voxel_log2_m;
    e->num_undone = o->has_undo ? (size_t)o->undo : 0;
    e->num_redone = o->has_redo ? (size_t)o->redo : 0;
    return (!o->has_undo || karst_saved_undo(e->saved, &e->num_undone, error)) &&
           (!o->has_redo || karst_saved_redo(e->saved, &e->num_redone, error)) &&
           (!o->from || add_file(e, voxel_log2_m, error)) &&
           add_texts(e, &o->add, false, voxel_log2_m, error) && add_texts(e, &o->paint, true, voxel_log2_m, error) &&
           karst_saved_commit(e->saved, error) && (!o->compact || karst_saved_compact(e->saved, error));
}

/* ---- what there is ---- */

static void print_wrong(void *user, const char *line)
{
    editing *e = user;
    if (e->json)
        json_array_append_new(json_object_get(e->json, "damage"), json_string(line));
    else
        fprintf(e->out, "%s: %s\n", e->o->path, line);
}

static bool check(editing *e, karst_error *error)
{
    if (e->json)
        json_object_set_new(e->json, "damage", json_array());
    if (!karst_saved_check(e->saved, print_wrong, e, &e->num_wrong, error))
        return false;
    if (!e->json && !e->num_wrong)
        fprintf(e->out, "%s: no damage\n", e->o->path);
    return true;
}

static bool print_log(void *user, size_t number, size_t last, const karst_edit *edit)
{
    editing *e = user;
    char text[2048] = "";
    bool in_force = number <= karst_saved_num_edits(e->saved, NULL);
    if (edit)
        karst_edit_format(edit, karst_saved_get_about(e->saved)->voxel_log2_m, text, sizeof text);
    if (e->json) {
        json_t *one = edit ? json_loads(text, 0, NULL) : json_pack("{s:b}", "lost", 1);
        json_object_set_new(one, "number", json_integer((json_int_t)number));
        if (last != number)
            json_object_set_new(one, "last_number", json_integer((json_int_t)last));
        json_object_set_new(one, "in_force", json_boolean(in_force));
        json_array_append_new(json_object_get(e->json, "log"), one);
    } else if (edit) {
        fprintf(e->out, "%zu%s %s\n", number, in_force ? "" : " (undone)", text);
    } else if (last == number) {
        fprintf(e->out, "%zu lost: it is damaged\n", number);
    } else {
        fprintf(e->out, "%zu to %zu lost: they are damaged\n", number, last);
    }
    return !ferror(e->out) && !command_interrupted();
}

/* ---- export ---- */

typedef struct {
    char *text;
    size_t length, room;
    int voxel_log2_m;
    bool any, is_out_of_memory;
} text_export;

static void put_text(text_export *x, const char *text)
{
    size_t length = strlen(text);
    if (x->length + length + 1 > x->room) {
        size_t room = 2 * x->room + length + 65536;
        char *larger = realloc(x->text, room);
        x->is_out_of_memory = x->is_out_of_memory || !larger;
        if (!larger)
            return;
        x->text = larger;
        x->room = room;
    }
    memcpy(x->text + x->length, text, length + 1);
    x->length += length;
}

static bool export_edit(void *user, size_t number, size_t last, const karst_edit *edit)
{
    text_export *x = user;
    char text[2048];
    (void)number, (void)last;
    if (!edit)
        return true;
    karst_edit_format(edit, x->voxel_log2_m, text, sizeof text);
    put_text(x, x->any ? ",\n  " : "\n  ");
    put_text(x, text);
    x->any = true;
    return !x->is_out_of_memory;
}

static bool export_text(editing *e, karst_error *error)
{
    text_export x = {.voxel_log2_m = karst_saved_get_about(e->saved)->voxel_log2_m};
    put_text(&x, "{ \"edits\": [");
    bool done =
        karst_saved_visit(e->saved, 1, karst_saved_num_edits(e->saved, NULL), x.voxel_log2_m, export_edit, &x, error);
    put_text(&x, " ] }\n");
    if (x.is_out_of_memory)
        done = karst_fail(error, KARST_FAILED, "out of memory for the edits as text");
    done = done && command_write_text(e->o->output, x.text, error);
    free(x.text);
    return done;
}

/* ---- the whole ---- */

static void say_counts(editing *e)
{
    size_t num_redoable, num = karst_saved_num_edits(e->saved, &num_redoable);
    const edit_options *o = e->o;
    if (e->json) {
        json_object_set_new(e->json, "file", json_string(o->path));
        json_object_set_new(e->json, "added", json_integer((json_int_t)e->num_added));
        json_object_set_new(e->json, "undone", json_integer((json_int_t)e->num_undone));
        json_object_set_new(e->json, "redone", json_integer((json_int_t)e->num_redone));
        json_object_set_new(e->json, "edits", json_integer((json_int_t)num));
        json_object_set_new(e->json, "redoable", json_integer((json_int_t)num_redoable));
    } else {
        command_say(e->talk, "%s: %zu added, %zu undone, %zu redone; %zu edits, %zu can be redone", o->path,
                    e->num_added, e->num_undone, e->num_redone, num, num_redoable);
    }
}

static bool report(editing *e, karst_error *error)
{
    const edit_options *o = e->o;
    size_t num_redoable, num = karst_saved_num_edits(e->saved, &num_redoable);
    if (o->check && !check(e, error))
        return false;
    if (o->log && e->json)
        json_object_set_new(e->json, "log", json_array());
    if (o->log && !karst_saved_visit(e->saved, 1, num + num_redoable, karst_saved_get_about(e->saved)->voxel_log2_m,
                                     print_log, e, error))
        return false;
    if ((o->export_as && !export_text(e, error)) || (o->backup && !karst_saved_backup(e->saved, o->backup, error)))
        return false;
    say_counts(e);
    char *text = e->json ? json_dumps(e->json, JSON_INDENT(2) | JSON_PRESERVE_ORDER) : NULL;
    if (text)
        puts(text);
    else if (e->json)
        return karst_fail(error, KARST_FAILED, "out of memory");
    free(text);
    return !e->num_wrong || karst_fail(error, KARST_BAD_DATA,
                                       "%s is damaged in %zu places; --recover NEW.karstdb makes "
                                       "a new file of what can be read",
                                       o->path, e->num_wrong);
}

static bool run(const edit_options *o, command_talk *talk, karst_error *error)
{
    const karst_log log = command_log(talk);
    bool writes = o->has_undo || o->has_redo || o->from || o->add.num_items || o->paint.num_items ||
                  o->compact;
    if (o->recover) {
        if (!karst_saved_recover(o->path, o->recover, o->world, &log, error))
            return false;
        command_say(talk, "%s: what could be read of %s", o->recover, o->path);
        return true;
    }
    /* --check says itself what is damaged. */
    editing e = {
        .o = o, .talk = talk, .out = stdout, .saved = karst_saved_open(o->path, writes, o->check ? NULL : &log, error)};
    const char *why_not;
    bool done = e.saved != NULL;
    if (done && writes && !karst_saved_is_writable(e.saved, &why_not))
        done = karst_fail(error, KARST_FAILED, "%s cannot be edited now: %s", o->path, why_not);
    e.json = o->json ? json_object() : NULL;
    done = done && (!writes || change(&e, error)) && report(&e, error);
    karst_saved_close(e.saved);
    json_decref(e.json);
    return done;
}

static bool check_options(edit_options *o, karst_error *error)
{
    if (o->has_undo && o->has_redo)
        return karst_fail(error, KARST_USAGE, "--undo and --redo: one takes back what the other does; give one");
    if (o->export_as && strcmp(o->export_as, "text") != 0)
        return karst_fail(error, KARST_USAGE, "--export %.60s: must be text", o->export_as);
    if (o->output && !o->export_as)
        return karst_fail(error, KARST_USAGE, "-o is where --export goes: give that too");
    if (o->world && !o->recover)
        return karst_fail(error, KARST_USAGE, "--world goes with --recover");
    if (o->recover && (o->has_undo || o->has_redo || o->from || o->add.num_items || o->paint.num_items || o->compact ||
                       o->check || o->log || o->export_as || o->backup))
        return karst_fail(error, KARST_USAGE, "--recover goes alone: edit the new file afterwards");
    if (!o->output)
        o->output = "-";
    if (o->export_as && strcmp(o->output, "-") == 0 && (o->log || o->json || o->check))
        return karst_fail(error, KARST_USAGE, "--export and --log, --check or --json all want stdout: give -o FILE");
    return !o->export_as || command_check_output(o->output, "-o", false, error);
}

/* --undo and --redo may stand without a number, which is 1 then: writes it behind them. NULL: out of memory. */
static char **spell_out(int argc, char **argv)
{
    static char undo[] = "--undo=1", redo[] = "--redo=1";
    char **words = calloc((size_t)argc + 1, sizeof *words);
    for (int i = 0; words && i < argc; i++) {
        const char *next = i + 1 < argc ? argv[i + 1] : "";
        bool is_alone = !isdigit((unsigned char)next[0]);
        words[i] = is_alone && strcmp(argv[i], "--undo") == 0   ? undo
                   : is_alone && strcmp(argv[i], "--redo") == 0 ? redo
                                                                : argv[i];
    }
    return words;
}

bool command_edit(int argc, char **argv, command_talk *talk, karst_error *error)
{
    edit_options o = {0};
    const command_option options[] = {
        {"add", 0, COMMAND_LIST, "EDIT", "append an edit, see below; may be given again", &o.add, 0, 0, NULL},
        {"paint", 0, COMMAND_LIST, "EDIT", "append an edit of mode paint: SHAPE,VALUES,colour=R:G:B[,NAME=VALUE...]",
         &o.paint, 0, 0, NULL},
        {"from", 0, COMMAND_TEXT, "FILE", "append all edits of a file: docs/EDITS.md; or of another saved world",
         &o.from, 0, 0, NULL},
        {"undo", 0, COMMAND_INTEGER, "[N]", "take the last edit back, or the last N", &o.undo, 0, KARST_MAX_EDITS,
         &o.has_undo},
        {"redo", 0, COMMAND_INTEGER, "[N]", "make it again; possible until an edit is added", &o.redo, 0,
         KARST_MAX_EDITS, &o.has_redo},
        {"log", 0, COMMAND_FLAG, NULL, "print all edits in their order", &o.log, 0, 0, NULL},
        {"compact", 0, COMMAND_FLAG, NULL, "drop what was undone, and give back unused room", &o.compact, 0, 0, NULL},
        {"check", 0, COMMAND_FLAG, NULL, "look at every page and row for damage", &o.check, 0, 0, NULL},
        {"export", 0, COMMAND_TEXT, "KIND", "print the edits; KIND is text: JSON that --edits takes", &o.export_as, 0,
         0, NULL},
        {"output", 'o', COMMAND_TEXT, "FILE", "where --export goes (default: -, stdout)", &o.output, 0, 0, NULL},
        {"backup", 0, COMMAND_TEXT, "NEW", "copy it, also while another process edits it", &o.backup, 0, 0, NULL},
        {"recover", 0, COMMAND_TEXT, "NEW", "make a new file of what can be read of a damaged one", &o.recover, 0, 0,
         NULL},
        {"world", 0, COMMAND_TEXT, "WORLD", "with --recover: of which world, where that is lost", &o.world, 0, 0, NULL},
        {"json", 0, COMMAND_FLAG, NULL, "what there is to say as one JSON object", &o.json, 0, 0, NULL},
        {"quiet", 'q', COMMAND_FLAG, NULL, "say nothing but warnings and errors", &talk->quiet, 0, 0, NULL},
    };
    const size_t num_options = sizeof options / sizeof *options;
    size_t num_words;
    char **words = spell_out(argc, argv);
    o.add.items = calloc((size_t)argc + 1, sizeof *o.add.items);
    o.paint.items = calloc((size_t)argc + 1, sizeof *o.paint.items);
    bool done = words && o.add.items && o.paint.items;
    if (!done)
        karst_fail(error, KARST_FAILED, "out of memory");
    done = done && command_parse(argc, words, options, num_options, &o.path, 1, &num_words, &o.help, error);
    if (done && o.help)
        print_help(options, num_options);
    else if (done && !num_words)
        done = karst_fail(error, KARST_USAGE, "which file? For example: karst edit mine.karstdb --log");
    else if (done)
        done = check_options(&o, error) && run(&o, talk, error);
    free(o.add.items);
    free(o.paint.items);
    free(words);
    return done;
}
