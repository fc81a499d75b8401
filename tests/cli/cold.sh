#!/bin/sh
# Many processes at once with one cold cache: each draws the right picture, the cache is valid afterwards, and nothing
# half written is left in it. Each compiles all kernels of a world, so it takes minutes, and runs with KARST_TEST_FULL=1
# only; KARST_TEST_PROCESSES says how many (64), KARST_TEST_WORLD with which world (hills). tests/core/test_cold_processes.c
# does the same with one small program. $KARST is the program.
set -u
. tests/tap.sh
karst=${KARST:-build/karst}
case $karst in /*) ;; *) karst="$PWD/$karst" ;; esac
num=${KARST_TEST_PROCESSES:-64}
if [ -z "${KARST_TEST_FULL:-}" ]; then
    skip "many processes with a cold cache" "KARST_TEST_FULL=1 runs them"
    finish
fi
export KARST_DATA_DIR="$PWD/demos"
scratch=$(mktemp -d) || exit 1
trap 'rm -rf "$scratch"' EXIT
cd "$scratch" || exit 1
unset POCL_CACHE_DIR
world="${KARST_TEST_WORLD:-hills} --detail 4 --view-distance 2000"
draw() { "$karst" render $world -q --size 32x24 --pool 16 --samples 1 --display none -o "$1"; }
(export KARST_CACHE_DIR="$PWD/alone" && draw alone.png) 2> alone.txt
result "one process alone"
export KARST_CACHE_DIR="$PWD/cold"
start=$(date +%s)
i=0
while [ $i -lt "$num" ]; do
    (draw "$i.png" 2> "$i.txt"; echo $? > "$i.status") &
    i=$((i + 1))
done
wait
detail=$(grep -LFx 0 ./*.status; cat ./[0-9]*.txt | sort | uniq -c | head -n 5)
[ "$(cat ./*.status | grep -cx 0)" -eq "$num" ]
result "$num processes at once end well (in $(($(date +%s) - start)) s)"
detail=$(for picture in ./[0-9]*.png; do cmp "$picture" alone.png; done 2>&1)
[ -z "$detail" ] && [ "$(ls ./[0-9]*.png | wc -l)" -eq "$num" ]
result "each has the picture of one alone"
# What PoCL leaves in its own folder is its own: names that nothing reads.
detail=$(find "$KARST_CACHE_DIR/programs" -name '*.new')
[ -d "$KARST_CACHE_DIR/programs" ] && [ -z "$detail" ]
result "nothing half written is left in Karst's store"
find "$KARST_CACHE_DIR" -type f | sort > before
detail=$(draw again.png 2>&1) && [ -z "$detail" ] && cmp -s again.png alone.png
result "the cache is taken by the next, without a word"
detail=$(find "$KARST_CACHE_DIR" -type f | sort | diff before - | grep -c '^> .*\.so$')
[ "$detail" = 0 ]
result "which compiles nothing anew"
finish
