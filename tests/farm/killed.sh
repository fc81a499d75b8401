#!/bin/sh
# A flight by several workers under GNU parallel, of whose jobs some are killed at random and started again: the pictures
# have the bytes of one process's, and CPU time and memory are told. Takes minutes to hours, and is no part of make check:
#   sh tests/farm/killed.sh [FOLDER]
# Variables: FRAMES (400), SIZE (320x180), WORKERS (4), PARTS (20), SHARE of the jobs that are killed (0.2), OPTIONS for
# karst render, SEED, KARST (build/karst). TILES=1: one picture of that size instead, in tiles, which are joined. FOLDER
# keeps what one process drew, for another run of the same settings.
set -u
. tests/tap.sh
karst=${KARST:-build/karst}
case $karst in /*) ;; *) karst="$PWD/$karst" ;; esac
frames=${FRAMES:-400} size=${SIZE:-320x180} workers=${WORKERS:-4} parts=${PARTS:-20} share=${SHARE:-0.2}
seed=${SEED:-$(date +%N)}
export KARST_DATA_DIR="$PWD/demos"
parallel --version 2> /dev/null | grep -q '^GNU' || { skip "a farm" "no GNU parallel"; finish; }
scratch=${1:-}
[ -n "$scratch" ] || { scratch=$(mktemp -d) && trap 'rm -rf "$scratch"' EXIT; } || exit 1
mkdir -p "$scratch" && cd "$scratch" || exit 1
if [ -n "${TILES:-}" ]; then
    frames=1 output=all.png manifest=many/all.manifest.json
    view="--exposure 0"
else
    output=%05d.png manifest=many/manifest.json
    view="--path low-flight --frames $frames"
fi
options="$view --size $size -q --display none ${OPTIONS:-}"

# LOG COMMAND...: runs it, and adds to the file LOG its CPU seconds and those of its children, its exit status, and what
# its largest process had of memory, in KiB, if it ended by itself.
cat > cpu.sh <<'END'
log=$1
shift
python3 -c 'import resource, subprocess, sys
status = subprocess.call(sys.argv[2:])
open(sys.argv[1], "w").write("%d" % resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
sys.exit(status if status >= 0 else 128 - status)' "$log.memory.$$" "$@"
status=$?
# Not in a pipe, whose shell has no children.
times > "$log.$$"
awk -v status=$status -v kib="$(cat "$log.memory.$$" 2> /dev/null)" -F '[ms ]' \
    'NR == 2 { print $1 * 60 + $2 + $4 * 60 + $5, status, kib + 0 }' "$log.$$" >> "$log"
rm -f "$log.$$" "$log.memory.$$"
exit $status
END
sum() { awk -v want="$2" '{ if (want == "all" || (want == "killed") == ($2 != 0)) sum += $1 } END { printf "%.1f", sum }' "$1"; }

# A store that is warm: kernels are compiled once for all.
export POCL_CACHE_DIR="$PWD/store"
mkdir -p store
"$karst" render hills --path low-flight --frames 1 --size 320x180 -q --display none ${OPTIONS:-} -o warm-%d.png
result "kernels are there"

if ! [ -e one/done ]; then
    rm -rf one && mkdir one
    rm -f one.log
    printf '"%s" render hills %s -o one/%s\n' "$karst" "$options" "$output" > one.sh
    sh cpu.sh one.log sh one.sh && : > one/done
fi
[ "$(ls one/*.png | wc -l)" -eq "$frames" ]
result "one process draws $frames pictures at $size (CPU $(sum one.log all) s)"

rm -rf many many.log store?* && mkdir many
"$karst" render hills $options -o "many/$output" --jobs "$parts" | sed "s|^karst |\"$karst\" |" > jobs
# Killed after some part of what a job takes by itself. Each of those has a store of its own: one in which a run died is
# set aside, and all others would compile anew.
each=$(awk -v cpu="$(sum one.log all)" -v parts="$parts" -v workers="$workers" -v cores="$(nproc)" 'BEGIN { print cpu / parts * workers / cores }')
awk -v seed="$seed" -v share="$share" -v each="$each" 'BEGIN { srand(seed) }
    { killed = rand() < share
      if (killed) printf "cp -R store store%d; POCL_CACHE_DIR=$PWD/store%d sh cpu.sh many.log timeout -s %s %.2f ", NR, NR, rand() < 0.7 ? "KILL" : "TERM", 0.3 + each * rand()
      else printf "sh cpu.sh many.log "
      print }' jobs > some_killed
sed 's/^/sh cpu.sh many.log /' jobs > all_again
export POCL_MAX_PTHREAD_COUNT=1
start=$(date +%s)
parallel --will-cite -j "$workers" :::: some_killed > talk 2>&1 < /dev/null
num_killed=$(awk '$2 != 0' many.log | wc -l)
after_kill=$("$karst" verify -q "$manifest" | wc -l)
parallel --will-cite -j "$workers" :::: all_again >> talk 2>&1 < /dev/null
detail=$("$karst" verify "$manifest" 2>&1; tail -n 5 talk)
"$karst" verify -q "$manifest" > missing && ! [ -s missing ]
result "$num_killed of $parts jobs were killed, $after_kill pictures were missing; started again, all are there (seed $seed, $(($(date +%s) - start)) s)"
[ -z "${TILES:-}" ] || { "$karst" verify -q "$manifest" --join many/joined.png && rm -f many/all.part-*.png && mv many/joined.png many/all.png; }
differs=
for file in one/*.png; do cmp -s "$file" "many/${file#one/}" || differs="$differs ${file#one/}"; done
detail=$differs
[ -z "$differs" ] && [ "$(ls many/*.png | wc -l)" -eq "$frames" ]
result "each picture has the bytes of one process's"
one=$(sum one.log all) all=$(sum many.log all) killed=$(sum many.log killed)
detail="CPU: one process $one s, all jobs $all s, of which those that were killed $killed s"
awk -v one="$one" -v all="$all" -v killed="$killed" 'BEGIN { exit !(all <= 1.1 * one + killed) }'
result "CPU is at most 1.1 times that of one process, and what killed jobs took: $one s, $all s, $killed s"
most=$(awk '$3 > most { most = $3 } END { print most + 0 }' one.log many.log)
detail="resident memory of the largest process: $most KiB"
[ "$most" -gt 0 ] && [ "$most" -le 1572864 ]
result "no process takes more than 1.5 GiB: $most KiB"
finish
