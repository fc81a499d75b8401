/* Words of edits, for whoever reads or writes them. */
#ifndef KARST_PRODUCERS_EDITS_TEXT_H
#define KARST_PRODUCERS_EDITS_TEXT_H

#define EDITS_NUM_SHAPES 5
#define EDITS_NUM_MODES 5
extern const char *const karst_edit_shape_words[EDITS_NUM_SHAPES]; /* by karst_edit_shape */
extern const char *const karst_edit_mode_words[EDITS_NUM_MODES];   /* by karst_edit_mode */

#endif
