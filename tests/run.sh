#!/bin/sh
# Runs tests and counts them: tests/run.sh LOG_FOLDER PROGRAM...
# A program prints TAP lines ("ok 1 - name", "not ok 2 - name", "ok 3 # SKIP why") and exits non-zero if one failed;
# cmocka does so when asked to. The last line is the sum. Variables: ONLY (run programs whose path holds it),
# CONFIG (asan sets the sanitizers' options), TEST_TIMEOUT_S (of one program).
set -u
logs=$1
shift
mkdir -p "$logs" || exit 1

export CMOCKA_MESSAGE_OUTPUT=TAP
# Tests build from source: what one of them kept must not hide what is wrong with another. The cache's own test says else.
export KARST_CACHE_DIR=off
if [ "${CONFIG:-release}" = asan ]; then
    # What the drivers leak is theirs. Tests that take minutes here do less when told to.
    export LSAN_OPTIONS="suppressions=$PWD/tests/lsan.supp:print_suppressions=0"
    export ASAN_OPTIONS="abort_on_error=0:detect_stack_use_after_return=0"
    export UBSAN_OPTIONS="print_stacktrace=1:halt_on_error=1"
    export KARST_TEST_QUICK=1
fi

# count PATTERN FILE: 0 as well if there is no file, which then counts as a program that ran no test.
count()
{
    lines=$(grep -cE "$1" "$2" 2> /dev/null)
    echo "${lines:-0}"
}

passed=0 failed=0 skipped=0
for program; do
    case $program in *"${ONLY:-}"*) ;; *) continue ;; esac
    name=$(echo "$program" | sed 's|.*tests/||; s|\.sh$||')
    log="$logs/$(echo "$name" | tr / _).log"
    case $program in *.sh) shell=sh ;; *) shell= ;; esac
    start=$(date +%s)
    again=
    options=${ASAN_OPTIONS:-}
    for try in 1 2 3; do
        ASAN_OPTIONS=$options timeout -k 10 "${TEST_TIMEOUT_S:-900}" $shell "$program" > "$log" 2>&1
        status=$?
        [ $status -ne 0 ] && grep -q 'LeakSanitizer has encountered a fatal error' "$log" || break
        # The leak checker itself crashed, and has found nothing then: now and then as it looks at a driver's threads,
        # and each time where the memory of a library's thread-local variables starts 16 bytes into a page (LSan takes
        # what stands before it for a header of glibc 2.19). It does without looking at these, then.
        options=${ASAN_OPTIONS:-}:intercept_tls_get_addr=0
        again=", again: the leak checker had crashed"
    done
    seconds=$(($(date +%s) - start))

    skips=$(count '^(not )?ok [0-9]+ *# SKIP' "$log")
    oks=$(count '^ok [0-9]+ *($|[^# 0-9])' "$log")
    bads=$(count '^not ok [0-9]+ *($|[^# 0-9])' "$log")
    # A crash, a time-out or a program without any test is a failure of its own.
    why=
    [ $status -ne 0 ] && [ "$bads" -eq 0 ] && bads=1 && why="exit status $status"
    [ $status -eq 124 ] && why="time-out"
    [ $status -eq 0 ] && [ $((oks + bads + skips)) -eq 0 ] && bads=1 && why="ran no test"
    passed=$((passed + oks)) failed=$((failed + bads)) skipped=$((skipped + skips))
    if [ "$bads" -ne 0 ]; then
        printf 'FAILED %-40s %d of %d, %d s %s\n' "$name" "$bads" $((oks + bads)) "$seconds" "$why"
        grep -vE '^ok ' "$log" | tail -n 60 | sed 's/^/    /'
    else
        printf 'ok     %-40s %d, %d s%s%s\n' "$name" "$oks" "$seconds" \
            "$([ "$skips" -gt 0 ] && echo ", $skips skipped")" "$again"
        # Why something was left out is worth a line.
        grep -E '^(not )?ok [0-9]+ *# SKIP' "$log" | sed 's/^[^#]*# SKIP/           skipped:/'
    fi
done
if [ $skipped -gt 0 ]; then
    echo "$passed passed, $failed failed, $skipped skipped"
else
    echo "$passed passed, $failed failed"
fi
[ $failed -eq 0 ] && [ $passed -gt 0 ]
