#!/bin/sh
# Breaks the lowering in one place after the other, in a copy of this tree, and shows that test_truth sees each:
#   tests/language/truth_mutants.sh
# Takes some minutes; run it by hand when test_truth, its generator or the lowering has changed.
set -u
root=$(cd "$(dirname "$0")/../.." && pwd)
scratch=$(mktemp -d) || exit 2
trap 'rm -rf "$scratch"' EXIT
cp -a "$root/." "$scratch" && cd "$scratch" || exit 2
front=producers/language/front
test=build/release/tests/language/test_truth
missed=0

# mutant WHAT FILE SED: an edit of one line of $front/FILE.
mutant() {
    cp "$front/$2" kept
    sed -E -i "$3" "$front/$2"
    if cmp -s kept "$front/$2"; then
        echo "nothing to change: $1"
        missed=1
    elif ! make "$test" > log 2>&1; then
        echo "does not build: $1"
        missed=1
    elif "$test" > log 2>&1; then
        echo "NOT SEEN: $1"
        missed=1
    else
        echo "seen ($(grep -c 'at place' log) places wrong): $1"
    fi
    cp kept "$front/$2"
}

mutant 'closing a branch restores the slots that hold its value' lower_state.c \
    's/if \(!is_born_in\(s, branch, before\.slot\)\).*/if (1)/'
mutant 'changes made in a branch stay' lower_state.c 's/(s->slots\[before\.slot\] = )before\.value/\1s->slots[before.slot]/'
mutant 'merging forgets what only the first side changed' lower_state.c 's/if \(s->stamps\[slot\] == open\)/if (0)/'
mutant 'merging takes the sides the wrong way round' lower_state.c \
    's/KARST_OP_SELECT, condition, yes, s->changes\[i\]\.value/KARST_OP_SELECT, condition, s->changes[i].value, yes/'
mutant 'globals begin with what others are by now' lower_global.c 's/s->slots\[slot\] = other->initial\[i\]/(void)slot/'
mutant 'places of out arguments are found after the call' lower_call.c \
    's/if \(!root \|\| !has_index .*/if (!root || may_change(s, function, argument) || root)/'
mutant 'out parameters are not copied out' lower_call.c 's/if \(p->is_out && places\)/if (0)/'
mutant 'the first function of a name is taken' lower_call.c 's/\(best && cost > best_cost\)/best/'
mutant 'the right side of && is always reached' lower_expr.c \
    's/karst_branch_merge\(s, is_or \? .*/karst_branch_merge(s, s->yes, branch.changes, s->num_changes);/'
mutant '++ in front gives what was before' lower_expr.c 's/return e->postfix \? before : after/return before/'
mutant 'compound assignment reads the place first' lower_expr.c \
    's/^( *)(karst_value value = karst_lower_expression\(s, e->b\);)/\1karst_value old = karst_place_read(s, \&place, 0);\2/
     s/karst_place_read\(s, &place, e->where\), value, e->where/old, value, e->where/'
mutant 'rows and columns are swapped in products' lower_expr.c 's/a\.e \+ i, rows, b\.e \+ j \* n, 1, n/a.e + i * n, 1, b.e + j * n, 1, n/'
mutant 'what follows a return is still executed' lower_stmt.c 's/karst_branch_merge\(s, not_of\(s, left\), /karst_branch_merge(s, s->yes, /'
mutant 'a loop goes on for lanes that have left' lower_stmt.c 's/karst_branch_merge\(s, live, /karst_branch_merge(s, s->yes, /'
mutant 'a condition counts on behind a term that fails' lower_stmt.c 's/live = karst_expr_2\(s->graph, KARST_OP_AND, live, value\);.*/;/'
mutant 'counters of lanes that have left go on' lower_stmt.c 's/karst_slot_set\(s, k\.items\[j\]\.slot, k\.items\[j\]\.value\)/(void)j/'
mutant 'what a body did to a counter is forgotten' lower_stmt.c 's/^        refresh\(s, &k, live\);/        (void)refresh;/'
mutant 'continue leaves the loop' lower_stmt.c 's/KARST_AST_BREAK \? s->frame\.broken : s->frame\.continued, s->yes/KARST_AST_BREAK ? s->frame.broken : s->frame.broken, s->yes/'
mutant 'cases run for those who have left' lower_stmt.c 's/KARST_OP_AND, entered, not_of\(s, left_block\(s\)\)/KARST_OP_AND, entered, s->yes/'
mutant 'no case falls through' lower_stmt.c 's/entered = or_of\(s, entered, /entered = or_of(s, s->no, /'
mutant 'default runs for all' lower_stmt.c 's/matches\[k\] : not_of\(s, any\)/matches[k] : s->yes/'
mutant 'a choice that is known keeps its own type' lower_expr.c 's/return other->scalar == KARST_TYPE_FLOAT && /return 0 \&\& /'
mutant 'a varying index is not held in the array' lower_place.c 's/KARST_OP_LESS, high, e\), high, e\)/KARST_OP_LESS, high, e), e, e)/'
mutant 'a varying index writes to all elements' lower_place.c 's/place->num_choices == 1 \? s->yes/1 ? s->yes/'
mutant 'a swizzle that is written starts at x' lower_place.c 's/offset\[i\] = part\[i\];/offset[i] = i;/'
mutant 'a field is the one before' lower_place.c 's/whole\.e \+ field->offset, e->where/whole.e, e->where/'
exit $missed
