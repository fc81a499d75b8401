#!/bin/sh
# Shows that tests/run.sh tells of whatever goes wrong in a program, adds up right, keeps the order, and lets nothing run
# beside what is to run alone.
set -u
. tests/tap.sh
root=$PWD run="$PWD/tests/run.sh" tap="$PWD/tests/tap.sh"
scratch=$(mktemp -d) || exit 1
trap 'rm -rf "$scratch"' EXIT
mkdir -p "$scratch/tests" && cd "$scratch" || exit 1
unset ONLY TEST_TIMEOUT_S STORE CONFIG KARST_TEST_FULL

# program NAME TEXT
program() { printf '#!/bin/sh\n%s\n' "$2" > "tests/$1" && chmod +x "tests/$1"; }
program good 'sleep 0.4; echo "ok 1 - a"; echo "ok 2 - b"'
program bad 'echo "ok 1 - a"; echo "not ok 2 - this is wrong"; echo "# why"; exit 1'
program crash 'echo "ok 1 - a"; kill -SEGV $$'
program silent 'exit 0'
program late 'echo "ok 1 - a"; sleep 30'
program skips 'echo "ok 1 # SKIP no such thing here"; echo "ok 2 - b"'
program orphan 'kill -KILL $(sed -n "s/^PPid:[[:space:]]*//p" /proc/$PPID/status); sleep 0.3; echo "ok 1 - a"'
program reads 'cat; echo "ok 1 - a"'
program interrupts 'kill -INT $$; echo "ok 1 - was ignored"'
for letter in a b c d; do
    program "pair_$letter" "mkdir here 2> /dev/null || : > met; sleep 0.5; rmdir here 2> /dev/null; echo 'ok 1 - a'"
done
printf '#!/bin/sh\n[ -n "$POCL_CACHE_DIR" ] && [ ! -e "$POCL_CACHE_DIR" ] && mkdir "$POCL_CACHE_DIR" && echo "ok 1 - a"\n' \
    > tests/store.sh
cat > tests/leaks.sh << END
. "$tap"
cd "$scratch" && echo '==7==LeakSanitizer has encountered a fatal error.' > stderr
case \$ASAN_OPTIONS in *intercept_tls_get_addr=0*) true ;; *) false ;; esac
result "a script's program"
finish
END
: > nobody

# run_them PROGRAM...: leaves what it says in the file said, and $status.
run_them()
{
    ALONE=${alone:-nobody} sh "$run" logs "$@" > said 2>&1
    status=$?
    detail="exit $status: $(cat said)"
}
last() { tail -n 1 said; }

for JOBS in 1 3; do
    export JOBS
    run_them tests/good tests/skips tests/reads
    [ $status -eq 0 ] && [ "$(last)" = "4 passed, 0 failed, 1 skipped" ] && grep -q 'skipped: no such thing here' said
    result "$JOBS at once: what passes and what is skipped is counted"
    TEST_TIMEOUT_S=2 run_them tests/good tests/bad tests/crash tests/silent tests/late tests/skips
    [ $status -eq 1 ] && [ "$(last)" = "6 passed, 4 failed, 1 skipped" ] && grep -q 'this is wrong' said &&
        grep -q '^FAILED crash .*exit status 139' said && grep -q '^FAILED silent .*ran no test' said &&
        grep -q '^FAILED late .*time-out' said
    result "$JOBS at once: a failure, a crash, silence and a time-out are told"
    [ "$(awk '/^(ok|FAILED) / { printf "%s ", $2 }' said)" = "good bad crash silent late skips " ]
    result "$JOBS at once: in their order"
    run_them tests/orphan tests/good
    [ $status -eq 1 ] && grep -q '^FAILED orphan .*who ran it is gone' said
    result "$JOBS at once: if even who runs a program dies, that is told"
    run_them tests/interrupts
    [ $status -eq 1 ] && grep -q '^FAILED interrupts' said
    result "$JOBS at once: a program can be interrupted"
    CONFIG=asan run_them tests/leaks.sh
    [ $status -eq 0 ] && grep -q 'again: the leak checker had crashed' said
    result "$JOBS at once: where the leak checker crashes in a script's program, the script runs again"
    run_them tests/store.sh
    [ $status -eq 0 ] && [ -z "$(find logs -name '*.store')" ]
    result "$JOBS at once: a script has a driver's store of its own, which goes with it"
done
# What a script has had built is there for the next; what goes wrong, and what is no driver's, stays out.
program built.sh 'mkdir -p "$POCL_CACHE_DIR/AB/program" && echo kernel > "$POCL_CACHE_DIR/AB/program/a.so" && : > "$POCL_CACHE_DIR/marker-1"; echo "ok 1 - a"'
program spoiled.sh 'mkdir -p "$POCL_CACHE_DIR/CD" && echo "not ok 1 - a"; exit 1'
program finds.sh '[ "$(cat "$POCL_CACHE_DIR/AB/program/a.so")" = kernel ] && [ "$(ls "$POCL_CACHE_DIR")" = AB ] && echo "ok 1 - a"'
JOBS=1 STORE=$scratch/kept run_them tests/built.sh tests/spoiled.sh tests/finds.sh
[ "$(last)" = "2 passed, 1 failed" ] && grep -q '^ok *finds' said && [ "$(ls kept)" = AB ]
result "a script's store begins with what those before it built"
run_them tests/nothing
[ $status -eq 1 ] && [ "$(last)" = "0 passed, 1 failed" ]
result "a program that is not there is told"
run_them
[ $status -eq 1 ] && [ "$(last)" = "0 passed, 0 failed" ]
result "no test at all is no success"
ONLY=goo run_them tests/good tests/bad
[ $status -eq 0 ] && [ "$(last)" = "2 passed, 0 failed" ]
result "ONLY chooses"

export JOBS=4
rm -f met
run_them tests/pair_a tests/pair_b tests/pair_c tests/pair_d
[ $status -eq 0 ] && [ -e met ]
result "programs run at once"
rm -f met
printf 'pair_a  # why\npair_b  # why\npair_c\npair_d\n' > list
alone=list run_them tests/pair_a tests/pair_b tests/pair_c tests/pair_d
[ $status -eq 0 ] && [ "$(last)" = "4 passed, 0 failed" ] && [ ! -e met ]
result "those that are to be alone are"
printf 'pair_d\n' > list
alone=list run_them tests/pair_d tests/good tests/bad
[ "$(awk '/^(ok|FAILED) / { printf "%s ", $2 }' said)" = "good bad pair_d " ]
result "and they come last"
CONFIG=asan UNSANITIZED=list run_them tests/pair_d tests/good
[ $status -eq 0 ] && [ "$(last)" = "2 passed, 0 failed" ] && grep -q '^1 programs left out: list' said
result "what sanitizers need not look at is left out, with a word"
CONFIG=asan UNSANITIZED=list KARST_TEST_FULL=1 run_them tests/pair_d tests/good
[ "$(last)" = "3 passed, 0 failed" ] && UNSANITIZED=list run_them tests/pair_d tests/good && [ "$(last)" = "3 passed, 0 failed" ]
result "and is not in full, nor without them"
detail=$(cd "$root" && sed -nE 's/^([a-z]+\/[a-z_]+)( .*)?$/\1/p' tests/alone tests/unsanitized | while read -r name; do
    [ -e "tests/$name.c" ] || [ -e "tests/$name.sh" ] || echo "$name is no test"
done)
[ -z "$detail" ]
result "both lists name tests"

# Programs of this scratch folder that run now; the pattern is none itself.
running() { grep -la "$scratch/tests/[l]ate" /proc/[0-9]*/cmdline 2> /dev/null; }
(exec sh "$run" logs "$scratch/tests/late" "$scratch/tests/late" > said 2>&1) &
runner=$!
for i in 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20; do [ -n "$(running)" ] && break; sleep 0.1; done
detail="nothing ran"
[ -n "$(running)" ]
result "two that take long have begun"
kill -TERM $runner
wait $runner
status=$?
detail="exit $status; left: $(running)"
[ $status -eq 143 ] && [ -z "$(running)" ]
result "who is ended ends its programs"
finish
