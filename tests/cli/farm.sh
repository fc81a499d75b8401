#!/bin/sh
# Jobs from outside: commands that --jobs prints, workers that are killed and started again, manifests, karst verify, and
# tiles; and the scripts of docs/FARM.md. $KARST is the program.
set -u
. tests/tap.sh
page="$PWD/docs/FARM.md"
. tests/cli/calls.sh
export POCL_CACHE_DIR="${POCL_CACHE_DIR:-$PWD/store}"

echo '{"keyframes": [{"time": 0, "position": ["0", "320", "0"], "yaw": 0, "pitch": -10},
    {"time": 1, "position": ["30", "320", "0"], "yaw": 20, "pitch": -10}]}' > 'turn it.json'
frames=24 parts=6
[ -n "${KARST_TEST_QUICK:-}" ] && frames=8 parts=3
quick="--size 64x48 --pool 64 --detail 2 --view-distance 2000 --samples 2 --display none -q"
fly() { run render hills --path 'turn it.json' --frames $frames $quick "$@"; }

# ---- commands ----
mkdir whole frames
fly -o whole/%05d.exr
[ $status -eq 0 ] && [ "$(ls whole | wc -l)" -eq $frames ]
result "one process draws all pictures"
fly -o frames/%05d.exr --jobs $parts
cp stdout jobs
[ $status -eq 0 ] && [ "$(wc -l < jobs)" -eq $parts ] && [ -z "$(ls -A frames)" ] && [ ! -s stderr ] &&
    [ "$(grep -c -- "--manifest frames/manifest.json --resume .*'turn it.json'" jobs)" -eq $parts ]
result "--jobs prints as many commands, and draws nothing"
[ "$(sed -n 's/.* --part \([0-9]*\)\/.*/\1/p' jobs | tr '\n' ' ')" = "$(seq -s ' ' $parts) " ]
result "they are the parts, in their order"
run render hills --path dive -o frames/%05d.png --jobs 2
[ $status -eq 0 ] && [ "$(wc -l < stdout)" -eq 2 ]
result "a path that ends nearer to its target than coarse voxels tell"
fly -o frames/%05d.exr --jobs 1000
[ $status -eq 0 ] && [ "$(wc -l < stdout)" -eq $frames ]
result "no more commands than pictures"
fly -o "a'b %d.exr" --jobs 2 --manifest '$(x) m.json'
(set -f; eval "set -- $(head -n 1 stdout)"; for word; do echo "$word"; done) > words
grep -qx "a'b %d.exr" words && grep -qx '$(x) m.json' words
result "a shell reads the words as they were"

# ---- four workers; some are killed ----
# Which, and when, follows from a number that is told. Those have stores of their own: a store in which a run died is set
# aside, and all others would compile anew (tests/cli/environment.sh).
seed=${FARM_SEED:-$(date +%N)}
awk -v seed="$seed" -v parts=$parts 'BEGIN { srand(seed); sure = 1 + int(parts * rand()) }
    { killed = NR == sure || rand() < 0.2
      if (killed) printf "cp -R \"$POCL_CACHE_DIR\" store%d; POCL_CACHE_DIR=$PWD/store%d timeout -s %s %.2f ", NR, NR, rand() < 0.7 ? "KILL" : "TERM", 0.1 + 0.8 * rand()
      print }' jobs > some_killed
by="GNU parallel"
parallel --version 2> /dev/null | grep -q '^GNU' || by=xargs
work()
{
    if [ "$by" = xargs ]; then
        xargs -P 4 -d '\n' -n 1 sh -c < "$1" > talk 2>&1
    else
        parallel --will-cite -j 4 :::: "$1" > talk 2>&1 < /dev/null
    fi
}
work some_killed
run verify frames/manifest.json
after_kill=$status
num_killed=$(grep -c ' timeout ' some_killed)
work jobs
left=$?
run verify frames/manifest.json
detail="$detail; seed $seed, $num_killed killed, then: $(cat talk)"
[ $left -eq 0 ] && [ $status -eq 0 ] && [ ! -s stdout ] && grep -q "$frames of $frames pictures right" stderr
result "workers of $by that were killed are started again: all is there (seed $seed, $num_killed killed, exit $after_kill)"
rm -rf store?*
differs=
for file in whole/*.exr; do cmp -s "$file" "frames/${file#whole/}" || differs="$differs ${file#whole/}"; done
detail="seed $seed:$differs"
[ -z "$differs" ] && [ "$(ls frames/*.exr | wc -l)" -eq $frames ]
result "each picture has the bytes of those that one process drew"
before=$(ls -l --time-style=full-iso frames/*.exr)
work jobs
[ "$before" = "$(ls -l --time-style=full-iso frames/*.exr)" ]
result "what is there is not drawn again"
[ "$by" = xargs ] && skip "under GNU parallel" "it is not installed (package parallel)"

# ---- asked to end ----
rm -rf slow && mkdir slow
"$karst" render hills --path 'turn it.json' --frames 400 $quick -o slow/%d.png --manifest slow/m.json > stdout 2> stderr &
worker=$!
tries=0
until [ -e slow/0.png ] || [ $tries -eq 600 ]; do sleep 0.1 && tries=$((tries + 1)); done
kill -TERM $worker
wait $worker
status=$?
detail="exit $status: $(cat stderr)"
num_noted=$(grep -c '"index"' slow/m.json)
[ $status -eq 75 ] && grep -q 'interrupted after [0-9]* of 400' stderr && [ "$num_noted" -ge 1 ] &&
    [ "$num_noted" -eq "$(ls slow/*.png | wc -l)" ] && [ -z "$(ls -A slow | grep karst-)" ]
result "SIGTERM: exit 75, and all that is drawn is noted"
run verify slow/m.json
[ $status -eq 1 ] && [ "$(grep -c '^missing slow/' stdout)" -eq $((400 - num_noted)) ]
result "verify lists what is missing"

# ---- what is wrong ----
rm frames/00002.exr
printf x >> frames/00001.exr
printf x | dd of=frames/00003.exr bs=1 seek=400 conv=notrunc 2> /dev/null
run verify frames/manifest.json
[ $status -eq 1 ] && [ "$(cut -d ' ' -f 1,2 stdout | tr '\n' ' ')" = \
    "wrong frames/00001.exr: missing frames/00002.exr wrong frames/00003.exr: " ]
result "verify tells of a picture that is missing, one that is longer, and one whose bytes changed"
work jobs
differs=
for file in whole/*.exr; do cmp -s "$file" "frames/${file#whole/}" || differs="$differs ${file#whole/}"; done
detail="$(cat talk)$differs"
[ -z "$differs" ] && "$karst" verify -q frames/manifest.json
result "the same commands mend that"
one="render hills --path turn.json --frames $frames --part 1/$parts"
cp 'turn it.json' turn.json
run $one $quick -o frames/%05d.exr --manifest frames/other.json
run $one $quick -o frames/%05d.exr --manifest frames/other.json --resume --seed 5
[ $status -eq 5 ] && grep -q "another job ('nothing' there, '--seed' here)" stderr
result "a manifest of other settings is not gone on with"
sed 's/320/321/' turn.json > changed.json && mv changed.json turn.json
complains 5 "the path or the edits have changed" "nor one of another path" $one $quick -o frames/%05d.exr \
    --manifest frames/other.json --resume
run $one $quick -o frames/%05d.exr --manifest frames/other.json
[ $status -eq 0 ] && ! cmp -s whole/00000.exr frames/00000.exr
result "without --resume all is drawn anew"
echo '{ "karst_manifest": 1, ' > frames/other.part-1-of-$parts.json
complains 5 "other.part-1-of-$parts.json:[0-9]" "a manifest that breaks off" $one $quick -o frames/%05d.exr \
    --manifest frames/other.json --resume
complains 5 "other.part-1-of-$parts.json:[0-9]" "verify of one that breaks off" verify frames/other.json
rm frames/other*
complains 5 "is not there, nor a part" "verify of none" verify frames/other.json
complains 2 "which manifest" "verify of what" verify
manifest() { printf '{"karst_manifest": 1, "version": "0", "output": "%s", "settings": [], "inputs": [], "size": [64, 48], "total": %s, "pictures": [%s]}' "$@" > m.json; }
manifest %d.png 99999999999 ''
complains 5 "is no manifest" "a manifest of more pictures than there can be" verify m.json
manifest %d.png 2 '{"index": 2, "bytes": 1, "crc32": "00000000"}'
complains 5 "is no manifest" "one with a picture beyond the last" verify m.json
manifest %d.png 2 '{"index": 0, "bytes": -1, "crc32": "00000000"}'
complains 5 "is no manifest" "one with a size below 0" verify m.json
mkfifo pipe
manifest pipe 1 '{"index": 0, "bytes": 1, "crc32": "00000000"}'
run verify m.json
[ $status -eq 1 ] && [ "$(cat stdout)" = "missing pipe" ]
result "one that names a pipe: nothing waits for it"

# ---- tiles ----
tile="--size 512x384 --pool 64 --detail 2 --view-distance 2000 --samples 2 --display none -q --exposure 0"
[ -n "${KARST_TEST_QUICK:-}" ] && tile="$tile --size 128x96"
run render hills $tile -o whole.png
run render hills $tile -o tiles.png --jobs 4
cp stdout jobs
work jobs
num_tiles=$(ls tiles.part-*-of-4.png | wc -l)
run verify tiles.manifest.json --join tiles.png
detail="$detail; $(cat talk; ls)"
[ $status -eq 0 ] && [ "$num_tiles" -eq 4 ] && [ -s whole.png ] && cmp whole.png tiles.png
result "tiles of a picture, joined, have the bytes of one process's"
mv tiles.part-3-of-4.png third.png && rm tiles.png
run verify tiles.manifest.json --join tiles.png
[ $status -eq 1 ] && [ "$(cat stdout)" = "missing tiles.part-3-of-4.png" ] && [ ! -e tiles.png ]
result "verify tells of a tile that is missing, and joins nothing"
# Tiles of several sizes, in rows of tiles; and one whose size is not that of its place, noted as if it were right.
sum_of() { echo "{\"index\": $1, \"bytes\": $(wc -c < "$2"), \"crc32\": \"$(gzip -c "$2" | tail -c 8 | od -An -tx4 -N4 | tr -d ' ')\"}"; }
convert -size 100x56 plasma:red-blue -depth 8 PNG24:plasma.png
for piece in 1:48x32+0+0 2:52x32+48+0 3:48x24+0+32 4:52x24+48+32; do
    convert plasma.png -crop "${piece#*:}" +repage -depth 8 "PNG24:p.part-${piece%%:*}-of-4.png"
done
noted() { for i in 1 2 3 4; do sum_of $((i - 1)) p.part-$i-of-4.png; done | paste -s -d ,; }
job() { printf '{"karst_manifest": 1, "version": "0", "output": "p.png", "tiles": true, "settings": [], "inputs": [], "size": [100, 56], "total": 4, "pictures": [%s]}' "$(noted)" > p.json; }
job
run verify p.json --join p.png
convert plasma.png -depth 8 rgb:plasma.rgb
convert p.png -depth 8 rgb:p.rgb
[ $status -eq 0 ] && [ "$(wc -c < p.rgb)" -eq 16800 ] && cmp plasma.rgb p.rgb
result "tiles of several sizes, of another program"
cp p.png before.png
convert p.part-1-of-4.png -crop 48x31+0+0 +repage PNG24:p.part-4-of-4.png
job
complains 5 "p.part-4-of-4.png: has 48x31 pixels instead of 52x24" "a tile of another size than its place" verify p.json --join p.png
convert -size 52x24 xc:red -interlace PNG PNG24:p.part-4-of-4.png
job
complains 5 "p.part-4-of-4.png: it is interlaced" "nor one whose rows come in passes" verify p.json --join p.png
cmp before.png p.png && [ -z "$(ls -A | grep '^\.karst-')" ]
result "what is there stays, and nothing half written is left"
# By a process that may not have as much memory as the picture's pixels take: 128 MiB, or 1 GiB. Sanitizers take more.
tile_px=2048x1024 size_px='8192, 4096' size_bytes=0000200000001000 most_kib=100000
[ -n "${KARST_TEST_FULL:-}" ] && tile_px=4096x4096 size_px='16384, 16384' size_bytes=0000400000004000
if [ -n "${KARST_TEST_QUICK:-}" ]; then
    skip "memory of joining" "sanitizers take more"
else
    for i in 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16; do
        convert -size $tile_px "xc:rgb($((i * 9)),$((255 - i * 9)),$i)" -depth 8 "PNG24:l.part-$i-of-16.png"
    done
    pictures=$(for i in 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16; do sum_of $((i - 1)) l.part-$i-of-16.png; done | paste -s -d ,)
    printf '{"karst_manifest": 1, "version": "0", "output": "l.png", "tiles": true, "settings": [], "inputs": [], "size": [%s], "total": 16, "pictures": [%s]}' "$size_px" "$pictures" > l.json
    detail=$( (ulimit -v $most_kib && exec "$karst" verify l.json --join l.png) 2>&1)
    [ "$(od -An -tx1 -j 16 -N 8 l.png | tr -d ' ')" = "$size_bytes" ]
    result "joining $size_px pixels takes less than $most_kib KiB"
    rm -f l.*
fi
complains 2 "no such job" "pictures of a flight are not joined" verify frames/manifest.json --join tiles.png
complains 2 "as a .png" "nor are tiles to an EXR" verify tiles.manifest.json --join tiles.exr
run render hills $tile -o window.png --window 37,21,50,40
convert whole.png -crop 50x40+37+21 +repage -depth 8 rgb:crop.rgb
convert window.png -depth 8 rgb:window.rgb
[ $status -eq 0 ] && [ "$(wc -c < crop.rgb)" -eq 6000 ] && cmp crop.rgb window.rgb
result "--window has the bytes of that part of the picture"
complains 2 "exposure of its own" "parts of a picture whose exposure follows it" render hills -o t.png --jobs 4
complains 2 "no tiles of 16 pixels" "more parts than tiles" render hills -o t.exr --jobs 97 --size 64x48
complains 2 "X,Y,W,H" "a window of three numbers" render hills --window 1,2,3
complains 2 "not within" "a window beyond the picture" render hills --size 64x48 --window 60,0,5,5
complains 2 "a part is a window" "a window of a part" render hills -o t.exr --part 1/4 --window 0,0,16,16

# ---- wrong usage ----
complains 2 "K/N" "a part beyond the last" render hills -o t.exr --part 5/4
complains 2 "which job" "--resume of nothing" render hills --resume
complains 2 "not stdin" "a world from stdin for many" render - -o t.exr --jobs 4
complains 2 "settled pictures to files" "a video in parts" render hills --path turn.json -o t.mp4 --jobs 4
complains 2 "settled pictures to files" "live pictures in parts" render hills --path turn.json -o %d.png --live --part 1/2
complains 2 "for one of them" "statistics of many" render hills -o t.exr --jobs 4 --stats s.json
complains 2 "line break" "a name with a line break" render hills -o "t
.exr" --jobs 4
complains 1 "no-such-folder" "a manifest in a folder that is not there" render hills $quick -o t.png --manifest no-such-folder/m.json

# ---- the page's script for Slurm ----
# Under a Slurm that only says what it is asked: each task of the array, one of which is asked to end and comes again.
sed -n '/^```bash/,/^```$/p' "$page" | sed '/^```/d' > farm.sbatch
rm -rf frames && mkdir frames bin
run render hills --path 'turn it.json' --frames $frames $quick -o frames/%05d.exr --jobs 2
cp stdout jobs.txt
printf '#!/bin/sh\necho "$@" >> requeued\n' > bin/scontrol && chmod +x bin/scontrol
: > requeued
task() { SLURM_ARRAY_TASK_ID=$1 SLURM_JOB_ID=7$1 SLURM_CPUS_PER_TASK=1 PATH="$PWD/bin:$PATH" bash farm.sbatch > talk 2>&1; }
sed "1s/--frames $frames/--frames 4000/" jobs.txt > long && mv jobs.txt short && mv long jobs.txt
task 1 &
tries=0
until [ -e frames/00000.exr ] || [ $tries -eq 600 ]; do sleep 0.1 && tries=$((tries + 1)); done
kill -TERM $(sed 's/ .*//' /proc/$!/task/*/children)
wait $!
detail="exit $?: $(cat talk); asked: $(cat requeued)"
[ "$(cat requeued)" = "requeue 71" ]
result "the page's script: a task that is asked to end is put back into the queue"
mv short jobs.txt
rm frames/*
for number in 1 2; do task $number || detail="$detail; task $number: $(cat talk)"; done
run verify frames/manifest.json
differs=
for file in whole/*.exr; do cmp -s "$file" "frames/${file#whole/}" || differs="$differs ${file#whole/}"; done
[ $status -eq 0 ] && [ -z "$differs" ]
result "and all tasks together draw the flight"
finish
