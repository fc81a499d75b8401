#!/bin/sh
# Runs tests and counts them: tests/run.sh LOG_FOLDER PROGRAM...
# A program prints TAP lines ("ok 1 - name", "not ok 2 - name", "ok 3 # SKIP why") and exits non-zero if one failed;
# cmocka does so when asked to. The last line is the sum. Several programs run at once, and are told of in their order;
# those named in tests/alone run by themselves, last; those named in tests/unsanitized are left out under the sanitizers.
# tests/run_selftest.sh shows that whatever goes wrong is told.
# Variables: JOBS (programs at once, default: as many as there are cores), ONLY (run programs whose path holds it),
# CONFIG (asan sets the sanitizers' options), TEST_TIMEOUT_S (of one program), ALONE and UNSANITIZED
# (other lists than tests/alone and tests/unsanitized),
# STORE (a folder: what drivers have built for scripts; most of a script's time goes into that).
set -u
logs=$1
shift
mkdir -p "$logs" && logs=$(cd "$logs" && pwd) || exit 1
jobs=${JOBS:-$(nproc)}
alone=${ALONE:-tests/alone}
unsanitized=

export CMOCKA_MESSAGE_OUTPUT=TAP
# Tests build from source: what one of them kept must not hide what is wrong with another. The cache's own test says else.
export KARST_CACHE_DIR=off
if [ "${CONFIG:-release}" = asan ]; then
    # What the drivers leak is theirs. Tests that take minutes here do less when told to.
    export LSAN_OPTIONS="suppressions=$PWD/tests/lsan.supp:print_suppressions=0"
    export ASAN_OPTIONS="abort_on_error=0:detect_stack_use_after_return=0"
    export UBSAN_OPTIONS="print_stacktrace=1:halt_on_error=1"
    export KARST_TEST_QUICK=1
    [ -n "${KARST_TEST_FULL:-}" ] || unsanitized=${UNSANITIZED:-tests/unsanitized}
fi

# In it: lists NUMBER PROGRAM of those that run together and of those that run alone; NUMBER.taken, whose maker runs the
# program; NUMBER.done, what is to be said of it after a line with its counts; KIND.over, when nobody runs that list any
# more.
work=$(mktemp -d) || exit 1
runners=
trap 'rm -rf "$work"' EXIT
trap 'trap - TERM; [ -n "$runners" ] && kill $runners && wait $runners; exit 143' INT TERM HUP

# name_of PROGRAM
name_of() { echo "$1" | sed 's|.*tests/||; s|\.sh$||'; }
# count PATTERN FILE: 0 as well if there is no file, which then counts as a program that ran no test.
count()
{
    lines=$(grep -cE "$1" "$2" 2> /dev/null)
    echo "${lines:-0}"
}
# cpu_between FILE FILE: seconds of CPU time between two outputs of times, of what this shell has waited for.
cpu_between()
{
    awk -F '[ms ]' 'FNR == 2 { sum = $1 * 60 + $2 + $4 * 60 + $5; if (NR == FNR) before = sum }
        END { printf "%.0f", sum - before }' "$1" "$2"
}

# take_store FOLDER, keep_store FOLDER: from and to what scripts share. Drivers rename what is whole into place, so that a
# command that was ended leaves nothing half there but its temporary files; Karst's markers are its own.
take_store()
{
    [ -d "${STORE:-}" ] && flock "$STORE.lock" cp -R "$STORE" "$1"
}
keep_store()
{
    [ -n "${STORE:-}" ] && [ -d "$1" ] && mkdir -p "$STORE" && for entry in "$1"/??; do
        [ -d "$entry" ] && flock "$STORE.lock" cp -Rn "$entry" "$STORE"
    done
}

# run_one NUMBER PROGRAM
run_one()
{
    name=$(name_of "$2")
    log="$logs/$(echo "$name" | tr / _).log"
    shell=
    # Scripts end commands by force, which others would be told of: each has a driver's store of its own, which begins with
    # what scripts before it have had built. Programs share one.
    store=
    case $2 in *.sh) shell=sh store="$logs/$(echo "$name" | tr / _).store" ;; esac
    rm -f "$log"
    start=$(date +%s)
    times > "$work/$1.before"
    again=
    options=${ASAN_OPTIONS:-}
    for try in 1 2 3; do
        [ -n "$store" ] && rm -rf "$store" && take_store "$store"
        # A shell's background ignores these signals, and so would the program.
        env --default-signal=INT,QUIT ${store:+"POCL_CACHE_DIR=$store"} ${options:+"ASAN_OPTIONS=$options"} \
            timeout -k 10 "${TEST_TIMEOUT_S:-1800}" $shell "$2" > "$log" 2>&1 < /dev/null &
        program=$!
        wait $program
        status=$?
        program=
        [ $status -ne 0 ] && grep -q 'LeakSanitizer has encountered a fatal error' "$log" || break
        # The leak checker itself crashed, and has found nothing then: now and then as it looks at a driver's threads,
        # and each time where the memory of a library's thread-local variables starts 16 bytes into a page (LSan takes
        # what stands before it for a header of glibc 2.19). It does without looking at these, then.
        options=${ASAN_OPTIONS:-}:intercept_tls_get_addr=0
        again=", again: the leak checker had crashed"
    done
    times > "$work/$1.after"
    [ -n "$store" ] && [ $status -eq 0 ] && keep_store "$store"
    [ -n "$store" ] && rm -rf "$store"
    took="$(($(date +%s) - start)) s, CPU $(cpu_between "$work/$1.before" "$work/$1.after") s"

    skips=$(count '^(not )?ok [0-9]+ *# SKIP' "$log")
    oks=$(count '^ok [0-9]+ *($|[^# 0-9])' "$log")
    bads=$(count '^not ok [0-9]+ *($|[^# 0-9])' "$log")
    # A crash, a time-out or a program without any test is a failure of its own.
    why=
    [ $status -ne 0 ] && [ "$bads" -eq 0 ] && bads=1 && why="exit status $status"
    [ $status -eq 124 ] && why="time-out"
    [ $status -eq 0 ] && [ $((oks + bads + skips)) -eq 0 ] && bads=1 && why="ran no test"
    {
        echo "$oks $bads $skips"
        if [ "$bads" -ne 0 ]; then
            printf 'FAILED %-40s %d of %d, %s %s\n' "$name" "$bads" $((oks + bads)) "$took" "$why"
            grep -vE '^ok ' "$log" | tail -n 60 | sed 's/^/    /'
        else
            printf 'ok     %-40s %d, %s%s%s\n' "$name" "$oks" "$took" \
                "$([ "$skips" -gt 0 ] && echo ", $skips skipped")" "$again"
            # Why something was left out is worth a line.
            grep -E '^(not )?ok [0-9]+ *# SKIP' "$log" | sed 's/^[^#]*# SKIP/           skipped:/'
        fi
    } > "$work/$1.said"
    mv "$work/$1.said" "$work/$1.done"
}

# run_some KIND: takes programs of the list that nobody has taken.
run_some()
{
    program=
    trap '[ -n "$program" ] && kill $program && wait $program; exit 143' TERM
    while read -r number path; do
        mkdir "$work/$number.taken" 2> /dev/null && run_one "$number" "$path"
    done < "$work/$1"
}

# run_all KIND NUM: by so many at once.
run_all()
{
    mine=
    trap 'kill $mine; wait; exit 143' TERM
    i=0
    while [ $i -lt "$2" ]; do
        run_some "$1" &
        mine="$mine $!"
        i=$((i + 1))
    done
    wait
    : > "$work/$1.over"
}

# is_in LIST PROGRAM
is_in() { [ -n "$1" ] && grep -qxE "$(name_of "$2")( .*)?" "$1" 2> /dev/null; }

num=0 left_out=0
: > "$work/together"
: > "$work/by_itself"
for program; do
    case $program in *"${ONLY:-}"*) ;; *) continue ;; esac
    is_in "$unsanitized" "$program" && left_out=$((left_out + 1)) && continue
    num=$((num + 1))
    kind=together
    is_in "$alone" "$program" && kind=by_itself
    echo "$num $program" >> "$work/$kind"
done

passed=0 failed=0 skipped=0
for kind in together by_itself; do
    at_once=$jobs
    [ $kind = by_itself ] && at_once=1
    run_all $kind "$at_once" &
    runners=$!
    while read -r number program; do
        until [ -e "$work/$number.done" ] || [ -e "$work/$kind.over" ]; do sleep 0.2; done
        if [ -e "$work/$number.done" ]; then
            read -r oks bads skips < "$work/$number.done"
            tail -n +2 "$work/$number.done"
        else
            oks=0 bads=1 skips=0
            printf 'FAILED %-40s nobody knows: who ran it is gone\n' "$(name_of "$program")"
        fi
        passed=$((passed + oks)) failed=$((failed + bads)) skipped=$((skipped + skips))
    done < "$work/$kind"
    wait $runners
    runners=
done
[ $left_out -gt 0 ] && echo "$left_out programs left out: $unsanitized says why"
if [ $skipped -gt 0 ]; then
    echo "$passed passed, $failed failed, $skipped skipped"
else
    echo "$passed passed, $failed failed"
fi
[ $failed -eq 0 ] && [ $passed -gt 0 ]
