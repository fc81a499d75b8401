#!/bin/sh
# The karst command from outside: what it prints, writes and returns. $KARST is the program.
set -u
. tests/tap.sh
flatten="$PWD/tests/cli/flatten.awk"
. tests/cli/calls.sh
unset NO_COLOR

# A picture that is quick to make.
quick="--size 160x120 --pool 64 --detail 2 --view-distance 2000"

# complains CODE PATTERN NAME ARGUMENT...: fails with this exit code and one line on stderr that matches; writes nothing.
complains()
{
    code=$1 pattern=$2 name=$3
    shift 3
    mkdir empty && cd empty || exit 1
    "$karst" "$@" > ../stdout 2> ../stderr < /dev/null
    status=$?
    left=$(ls -A)
    cd .. && rm -rf empty
    detail="karst $*: exit $status instead of $code, left '$left'; stderr: $(head -c 600 stderr)"
    [ $status -eq "$code" ] && [ "$(wc -l < stderr)" -eq 1 ] && grep -q '^karst: ' stderr && grep -qE -e "$pattern" stderr &&
        [ ! -s stdout ] && [ -z "$left" ]
    result "$name"
}

# ---- help and usage ----
run --help
[ $status -eq 0 ] && grep -q 'karst render hills' stdout && [ ! -s stderr ]
result "--help gives an example, on stdout"
run help help
[ $status -eq 0 ] && grep -q "^Commands:" stdout
result "help help is help"
run help render
[ $status -eq 0 ] && cp stdout help && for option in output size camera device display pool detail seed budget-bricks \
    budget path frames fps start end jobs part rows window manifest resume live view-distance no-shadows brick-bits frames-max quiet stats help; do
    grep -q -e "--$option" help || status="no --$option"
done
[ "$status" = 0 ] && grep -q hills help && grep -q asteroid help
result "help render names every option and the worlds"
run render --help
[ $status -eq 0 ] && cmp -s stdout help
result "render --help is help render"
run --version
[ $status -eq 0 ] && head -n 1 stdout | grep -qE '^karst [0-9]+\.[0-9]+\.[0-9]+$' && grep -q 'built by' stdout
result "--version names version and compiler"
run
[ $status -eq 2 ] && [ ! -s stdout ] && grep -q 'karst render hills' stderr
result "without arguments: usage, exit 2"
complains 2 "did you mean 'render'" "a misspelt command" rendr hills
complains 2 "did you mean --camera" "a misspelt option" render hills --camrea 0,0,0,0,0
complains 2 "karst --help" "a command that is nothing like one" xyzzy
complains 2 "which world" "no world" render
complains 2 "^karst: -o: which file" "an output without a name" render hills -o ''
complains 2 "one argument too many" "two worlds" render hills asteroid
complains 2 "needs a value" "an option without its value" render hills --size
complains 2 "takes no value" "a flag with a value" render hills --no-shadows=1

# ---- bad input: each is told before any work is done ----
complains 4 "did you mean 'hills'" "a misspelt world" render hils
complains 4 "there are: .*hills" "an unknown world" render no-such-world
complains 2 "1 to 16384" "size 0x0" render hills --size 0x0
complains 2 "1 to 16384" "size 100000x100000" render hills --size 100000x100000
complains 2 "1280x720" "a size that is none" render hills --size big
complains 2 "1280x720" "a size with a tail" render hills --size 64x64x
complains 2 "." "a camera that is not a number" render hills --camera 1,2,north,0,0
complains 2 "." "a camera with too few numbers" render hills --camera 1,2,3
complains 2 "." "a camera at infinity" render hills --camera inf,0,0,0,0
complains 2 "." "a camera beyond the world" render hills --camera 1e30,0,0,0,0 $quick
complains 2 "MiB.*--pool [0-9]" "pools too small for any picture" render hills --pool 0.1
complains 2 "MiB.*--pool [0-9]" "no pool at all" render hills --pool 0
complains 2 "whole number" "a seed that is not whole" render hills --seed 1.5
complains 2 "whole number" "a seed that is too large" render hills --seed 4294967296
complains 2 "0.25 to 64" "a detail out of range" render hills --detail 1000
complains 2 "number" "a view distance that is none" render hills --view-distance nan
complains 2 "none" "an unknown way to display" render hills --display x11
complains 2 "1 to 4096|from 1 to 4096" "no samples" render hills --samples 0
complains 2 "plain, filmic" "an unknown tone" render hills --tone vivid
complains 2 "0 to 1" "more than a mirror" render hills --mirror 1.01
complains 2 "direct, full" "a light that there is not" render hills --light fill
complains 2 "leave one of them out" "full light without shadows" render hills --light full --no-shadows
complains 2 "auto, or stops" "an exposure that is none" render hills --exposure nan
complains 2 "two numbers of degrees" "a sun in one number" render hills --sun 120
complains 2 "two numbers of degrees" "a sun above the zenith" render hills --sun 120,91
complains 2 "1 or 16" "an odd number of lanes" render hills --lanes 4
complains 3 "karst info" "an unknown device" render hills --device no-such-device

# ---- bad flights ----
echo '{"keyframes": [{"time": 0, "position": ["0", "320", "0"], "yaw": 0, "pitch": -10},
    {"time": 1, "position": ["30", "320", "0"], "yaw": 20, "pitch": -10}]}' > turn.json
sed 's/320/high/' turn.json > bad.json
turn="$PWD/turn.json"
complains 2 "drawn once" "samples of a picture that is drawn once" render hills --path "$turn" -o %d.png --live --samples 2
complains 5 "bad.json.*keyframe 1, position.*high" "a path with a bad keyframe" \
    render hills --path "$PWD/bad.json" -o %d.png
complains 5 "no path is called 'low-fligth' .* did you mean 'low-flight'. There are: .*orbit" "an unknown path" render hills --path low-fligth -o %d.png
complains 5 "nowhere.json" "a path's file that is not there" render hills --path nowhere.json -o %d.png
complains 2 "where to" "a path without -o" render hills --path "$turn"
complains 2 "%05d" "many pictures to one file" render hills --path "$turn" -o a.png
complains 2 "%05d" "a pattern that would crash printf" render hills --path "$turn" -o %s%n.png
complains 2 "%05d" "a pattern with two numbers" render hills --path "$turn" -o %d-%d.png
complains 2 "stdout" "many pictures to stdout" render hills --path "$turn" -o -
complains 1 "no-such-folder" "pictures in a folder that is not there" \
    render hills --path "$turn" -o no-such-folder/%d.png
complains 2 "says where the camera is" "a path and a camera" render hills --path "$turn" -o %d.png --camera 0,0,0,0,0
for option in --live "--frames 3" "--fps 3" "--start 3" "--end 3"; do
    complains 2 "is about a path" "$option without a path" render hills $option
done
complains 2 "runs from 0 to 1 s" "an end behind the path's" render hills --path "$turn" -o %d.png --end 2 $quick
complains 2 "even" "a video with odd sides" render hills --path "$turn" -o a.mp4 --size 161x120
mkdir tools && for tool in mkdir ls rm wc grep head; do ln -s "$(command -v $tool)" tools; done
all_tools=$PATH
PATH="$PWD/tools"
complains 1 "install the package ffmpeg" "a video without ffmpeg" render hills --path "$turn" -o a.mp4 --size 160x120
PATH=$all_tools

# ---- output ----
complains 1 "no-such-folder/a.png.*-o" "a picture in a folder that is not there" render hills -o no-such-folder/a.png
complains 2 "an .exr" "a picture of another kind" render hills -o a.JPG
complains 2 "needs a --path" "a video without a path" render hills -o a.mp4
complains 2 "an .exr" "pictures of another kind" render hills --path "$turn" -o %d.jpg
complains 1 "folder" "a picture in the place of a folder" render hills -o /
complains 1 "regular" "a picture over a device" render hills -o /dev/null
complains 1 "/proc" "a picture where nothing can be written" render hills -o /proc/a.png
complains 1 "stats" "statistics in a folder that is not there" render hills --stats no-such-folder/a.json
complains 2 "both" "picture and statistics both to stdout" render hills -o - --stats -
echo precious > kept.png
run render no-such-world -o kept.png
[ $status -eq 4 ] && [ "$(cat kept.png)" = precious ]
result "a failure leaves the old picture alone"

# ---- densities that are not finite ----
echo 'float density(vec3 p) { return p.y < 0.0 ? 1.0 : p.x > 1.0 ? 0.0 / (p.x - p.x) : -1.0; }' > holes.karst
run render holes.karst --size 32x24 --detail 8 --view-distance 200 --display none -o holes.png --stats holes.json
at=$(sed -n 's/.*not finite.* is at \([-0-9.e+]*,[-0-9.e+]*,[-0-9.e+]*\) .*/\1/p' stderr)
[ $status -eq 0 ] && [ "$(grep -c 'not finite' stderr)" -eq 1 ] && [ -n "$at" ] && [ -s holes.png ] &&
    grep -qE '"non_finite": [1-9]' holes.json
result "what is not finite is counted, and reported once"
run sample holes.karst --at "$at" --json
[ $status -eq 0 ] && grep -q '"density":null' stdout
result "where it is reported to be, it is"
rm -f holes.*

# ---- what is missing ----
export OCL_ICD_VENDORS=/nonexistent
complains 3 "pocl-opencl-icd" "no OpenCL device" render hills $quick
run info
[ $status -eq 0 ] && grep -q 'pocl-opencl-icd' stdout
result "info without a device says how to mend it"
unset OCL_ICD_VENDORS
export __EGL_VENDOR_LIBRARY_FILENAMES=/dev/null
complains 3 "osmesa|none" "no EGL" render hills --display egl $quick
unset __EGL_VENDOR_LIBRARY_FILENAMES
run info
[ $status -eq 0 ] && [ -s stdout ] && [ ! -s stderr ]
result "info lists something, on stdout"
if [ -e /dev/full ]; then
    "$karst" --help > /dev/full 2> stderr
    [ $? -eq 1 ]
    result "a full disk under stdout is noticed"
fi

# ---- pictures ----
run render hills -o first.png --stats first.json $quick
[ $status -eq 0 ] && [ -s first.png ] && [ ! -s stdout ] && [ "$(wc -l < stderr)" -eq 1 ] &&
    grep -qE '160x120, settled after [0-9]+ frames in [0-9.]+ s, [0-9]+ bricks, on ' stderr
result "render says size, frames, time, bricks and device in one line"
run render hills -o first.exr -q $quick
[ $status -eq 0 ] && [ "$(head -c 4 first.exr | od -An -tx1 | tr -d ' ')" = 762f3101 ] &&
    head -c 400 first.exr | grep -aq N.X && head -c 400 first.exr | grep -aq Z
result "an EXR with depth and normals"
run render hills -o second.png --quiet $quick
[ $status -eq 0 ] && cmp first.png second.png && [ ! -s stderr ]
result "the same command gives the same bytes; --quiet says nothing"
awk -f "$flatten" first.json | grep -q "^samples = 8$"
result "a picture has eight samples"
run render hills -o evening.png -q --sun 250,4 $quick
cp evening.png day.png && run render hills -o day.png -q $quick
[ $status -eq 0 ] && ! cmp -s day.png evening.png
result "another sun is another picture"
run render hills -o bright.png -q --exposure 2 $quick
[ $status -eq 0 ] && ! cmp -s first.png bright.png
result "another exposure is another picture"
for way in none osmesa egl; do
    run render hills -o $way.png --display $way $quick
    [ $status -eq 0 ] && cmp first.png $way.png
    result "--display $way gives the same bytes"
done
export __EGL_VENDOR_LIBRARY_FILENAMES=/dev/null
run render hills -o fallback.png $quick
unset __EGL_VENDOR_LIBRARY_FILENAMES
[ $status -eq 0 ] && cmp first.png fallback.png
result "without EGL the display falls back, to the same bytes"
run render hills -o - -q $quick
[ $status -eq 0 ] && cmp stdout first.png && [ ! -s stderr ]
result "-o - writes the picture to stdout"
mkdir temporary
(sleep 0.2; TMPDIR=$PWD/temporary "$karst" render hills -o - -q $quick 2> stderr; echo $? > code) | true
detail="exit $(cat code): $(cat stderr), left $(ls temporary)"
[ "$(cat code)" = 1 ] && grep -q 'cannot write to stdout' stderr && [ -z "$(ls temporary)" ]
result "a reader that goes away: told, and nothing left behind"
run render hills -o seed.png --seed 12345 -q $quick
[ $status -eq 0 ] && ! cmp -s first.png seed.png
result "another seed is another world"
run render hills -o plain.png --no-shadows -q $quick
[ $status -eq 0 ] && ! cmp -s first.png plain.png
result "without shadows the picture differs"
camera=$(awk -f "$flatten" first.json | sed -n 's/^camera = "\(.*\)"$/\1/p')
run render hills -o again.png --camera "$camera" -q $quick
[ $status -eq 0 ] && [ -n "$camera" ] && cmp first.png again.png
result "the camera in the statistics gives the picture again"
run render hills -o far.png --camera 1000000000000.5,400,-1e12,30,-20 --stats far.json -q $quick
[ $status -eq 0 ] && awk -f "$flatten" far.json | grep -q '^camera = "1000000000000.5,400,-1000000000000,'
result "a camera at 10^12 m is exact"
run render asteroid -o asteroid.png -q $quick
[ $status -eq 0 ] && [ -s asteroid.png ]
result "the other world"
run render hills -o inside.png --camera 0,-3000,0,0,0 $quick
[ $status -eq 0 ] && grep -qE "inside solid ground; there is air [0-9]+ m above it: --camera 0,[0-9-]+,0,0,0" stderr &&
    grep -q "^inside.png: " stderr
result "a camera in rock: a picture, and where there is air"
echo 'float density(vec3 p) { return -1.0; }' > air.karst
run render air.karst -o air.png $quick
[ $status -eq 0 ] && grep -q "no surface is in view" stderr
result "a picture of air says that there is no surface"
printf '/*{ "view": 100, "camera": { "position": ["0", "500", "0"], "yaw": 0, "pitch": -60, "fov": 60 } }*/\n%s\n' \
    'float density(vec3 p) { return -p.y; }' > near.karst
run render near.karst -o near.png -q --size 160x120 --pool 64 --detail 2
[ $status -eq 0 ] && grep -q "warning: all rays end at the view distance of 100 m.*--view-distance [0-9]" stderr
result "a view that ends before the world does is warned about, also with -q"
run render near.karst -o near.png --view-distance 1000 -q --size 160x120 --pool 64 --detail 2
[ $status -eq 0 ] && [ ! -s stderr ]
result "as far as it says there is a picture"
run render hills -o short.png --frames-max 1 $quick
[ $status -eq 1 ] && [ -s short.png ] && grep -q 'not settled within 1 ' stderr
result "not settled: written, said, exit 1"
run render hills -o small.png --stats small.json --size 320x240 --pool 4
[ $status -eq 0 ] && grep -q 'detail:.*--pool' stderr && awk -f "$flatten" small.json |
    awk '/^detail.asked_px/ { asked = $3 } /^detail.given_px/ { given = $3 } END { exit !(asked == 1 && given > 1) }'
result "small pools: less detail, and it says so"

# PoCL's threads are bound to CPUs, where that is allowed: else it would end the program.
POCL_MAX_PTHREAD_COUNT=$(($(nproc) + 2)) run render hills -o threads.png $quick
[ $status -eq 0 ] && cmp -s threads.png first.png
result "more threads than CPUs draw the same"

"$karst" render hills -o stopped.png --size 1280x720 > stdout 2> stderr &
until_caught $!
sleep 0.5
kill -TERM $!
wait $!
[ $? -eq 143 ] && [ ! -e stopped.png ] && grep -q interrupted stderr && [ -z "$(ls stopped* 2> /dev/null)" ]
detail=$(cat stderr)
result "interrupted: nothing is written"

# Steps of this world take minutes: whoever is asked to end does not wait for them.
echo 'float density(vec3 p) { float s = 0.0; for (int i = 0; i < 16000; i++) s += sin(p.x * float(i)); return s - p.y; }' \
    > slow.karst
"$karst" render slow.karst -o stopped.png --size 160x120 > stdout 2> stderr &
until_caught $!
sleep 2.5
kill -TERM $!
wait $!
status=$?
detail="exit $status: $(cat stderr)"
[ $status -eq 143 ] && grep -q '^karst: interrupted' stderr && [ -z "$(ls stopped* 2> /dev/null)" ]
result "interrupted in the middle of a step that takes minutes"
# timeout(1) asks twice in a moment, and does not mean the second time; one that comes later is meant. On a busy machine
# moments are long: one of three tries must do.
for try in 1 2 3; do
    "$karst" render slow.karst -o stopped.png --size 160x120 > stdout 2> stderr &
    until_caught $!
    sleep 2.5
    kill -TERM $! && sleep 0.02 && kill -TERM $! && sleep 0.35 && kill -INT $!
    wait $!
    status=$?
    detail="exit $status: $(cat stderr)"
    [ $status -eq 130 ] && break
done
[ $status -eq 130 ]
result "interrupted again while it waits: it ends at once"

# ---- flights ----
fly="render hills --path $turn --frames 3 -q $quick"
run $fly -o fly-%02d.png --stats fly.json
[ $status -eq 0 ] && [ "$(echo fly-*.png)" = "fly-00.png fly-01.png fly-02.png" ] && ! cmp -s fly-00.png fly-01.png
result "a flight: numbered pictures"
run render hills -o end.png --camera 30,320,0,20,-10,60 -q $quick
[ $status -eq 0 ] && cmp end.png fly-02.png
result "its end is the picture from there"
run render hills --path "$turn" --frames 1 --start 0.5 -o middle.png -q $quick
[ $status -eq 0 ] && cmp middle.png fly-01.png
result "a flight from its middle: one picture, the same"
run render hills --path "$turn" --fps 2 -o fps%d.png -q $quick
[ $status -eq 0 ] && [ "$(echo fps*.png)" = "fps0.png fps1.png" ] && cmp fps1.png fly-01.png
result "--fps: as many pictures as it takes"
detail=$(cat fly.json)
awk -f "$flatten" fly.json | awk '{ v[$1] = $3 } END { exit !(v["pictures"] == 3 &&
    v["live"] == "false" && v["settled"] == "true" &&
    v["frames"] > 5 && v["frames_to_settle"] > 1 && v["frames_to_settle"] <= v["frames"] && v["churn.produced"] > 0 &&
    v["detail.at_level.median"] == 1 && v["detail.at_level.p1"] == 1 && v["detail.at_level.min"] == 1 &&
    v["camera"] ~ /^"30,320,0,20/) }'
result "its statistics"
run $fly -o live-%d.png --live --budget 4 --stats live.json
detail=$(cat stderr live.json)
[ $status -eq 0 ] && awk -f "$flatten" live.json | awk '{ v[$1] = $3 } END { exit !(v["pictures"] == 3 &&
    v["frames"] == 3 &&
    v["live"] == "true" && v["frames_to_settle"] == "null" && v["detail.at_level.p1"] <= v["detail.at_level.median"] &&
    v["detail.at_level.median"] <= 1 && v["detail.at_level.min"] >= 0) }'
result "--live: a frame for each picture"
run render asteroid --path orbit --frames 2 --fps 0.1 -o orbit%d.png -q $quick
[ $status -eq 0 ] && [ -s orbit1.png ]
result "a path that comes with Karst, by its name"
# A stand-in for ffmpeg keeps what it is given.
mkdir fake && cat > fake/ffmpeg << 'EOS'
#!/bin/sh
for last; do :; done
echo "$@" > arguments
cat > "$last"
exit ${FAKE_STATUS:-0}
EOS
chmod +x fake/ffmpeg
PATH="$PWD/fake:$PATH" run $fly -o video.mp4
detail="$(cat stderr arguments)"
[ $status -eq 0 ] && [ "$(wc -c < video.mp4)" -eq $((3 * 160 * 120 * 3)) ] &&
    grep -q 'rgb24 -video_size 160x120 -framerate 30 ' arguments
result "a video: ffmpeg gets every picture, raw"
rm -f video.mp4
FAKE_STATUS=3 PATH="$PWD/fake:$PATH" run $fly -o video.mp4
[ $status -eq 1 ] && grep -q 'ffmpeg failed' stderr && [ -z "$(ls video* 2> /dev/null)" ]
result "ffmpeg fails: told, and no video"
printf '#!/bin/sh\necho broken beyond repair >&2\nexit 1\n' > fake/ffmpeg
PATH="$PWD/fake:$PATH" run $fly -o video.mp4
[ $status -eq 1 ] && grep -q 'broken beyond repair' stderr && [ -z "$(ls video* 2> /dev/null)" ]
result "ffmpeg gives up at once: its own words, and no video"
if command -v ffmpeg > /dev/null; then
    run $fly -o real.mp4
    seen=$(ffprobe -v error -count_frames -show_entries stream=nb_read_frames,width -of csv=p=0 real.mp4)
    [ $status -eq 0 ] && [ "$seen" = 160,3 ]
    result "a real video"
else
    skip "a real video" "no ffmpeg here (package ffmpeg)"
fi
"$karst" render hills --path "$turn" --frames 500 -o stop%03d.png $quick > stdout 2> stderr &
tries=0
until [ -e stop000.png ] || [ $tries -eq 600 ]; do sleep 0.1 && tries=$((tries + 1)); done
kill -TERM $!
wait $!
status=$?
detail="exit $status: $(cat stderr)"
[ $status -eq 143 ] && grep -q 'interrupted after [0-9]* of 500' stderr && [ -z "$(ls | grep -E 'karst-.*tmp|\.png\.')" ]
result "an interrupted flight says how far it came"
detail= told=0
for delay_s in 0.1 0.2 0.5; do
    rm -rf nothing_built && mkdir nothing_built
    KARST_CACHE_DIR=off POCL_CACHE_DIR="$PWD/nothing_built" "$karst" render hills -o stop.png $quick > stdout 2> stderr &
    until_caught $!
    sleep $delay_s
    kill -TERM $!
    wait $!
    status=$?
    detail="$detail after $delay_s s: exit $status: $(cat stderr);"
    [ $status -eq 143 ] && [ "$(grep -c '^karst: ' stderr)" -eq 1 ] && grep -q '^karst: interrupted' stderr &&
        [ ! -e stop.png ] && told=$((told + 1))
done
[ $told -eq 3 ]
result "interrupted while kernels are built: that is what is said, not what became of the build"

# ---- statistics: the names are a contract ----
awk -f "$flatten" first.json > flat
wanted="version world camera width_px height_px device display settled frames_to_settle path live pictures frames \
detail.asked_px detail.given_px detail.at_level.median detail.at_level.p1 detail.at_level.min detail.at_own_level.median \
pixels.hits pixels.provisional pixels.incomplete"
for stage in frame cast shade collect subdivide evaluate finalise display; do
    for figure in median p95 p99 max; do wanted="$wanted time_ms.$stage.$figure"; done
done
for pool in tiles bricks; do
    for figure in used resident total bytes; do wanted="$wanted cache.$pool.$figure"; done
done
for figure in requests produced evicted reproduced deferred; do wanted="$wanted churn.$figure"; done
missing=
for key in $wanted; do grep -q "^$key = " flat || missing="$missing $key"; done
detail="missing:$missing"
[ -s flat ] && [ -z "$missing" ]
result "the statistics have every name of the contract"
detail=$(cat flat)
awk '{ v[$1] = $3 } END {
    for (k in v) if (k ~ /^time_ms.*\.median$/) {
        b = substr(k, 1, length(k) - 7)
        if (v[k] > v[b ".p95"] || v[b ".p95"] > v[b ".p99"] || v[b ".p99"] > v[b ".max"]) bad = 1
    }
    for (p = 0; p < 2; p++) {
        b = "cache." (p ? "tiles" : "bricks")
        if (v[b ".used"] <= 0 || v[b ".used"] > v[b ".resident"] || v[b ".resident"] > v[b ".total"]) bad = 1
        sum += v[b ".bytes"]
    }
    if (sum > 64 * 1048576 || v["settled"] != "true" || v["width_px"] != 160 || v["height_px"] != 120) bad = 1
    if (v["frames_to_settle"] < 2 || v["churn.produced"] <= 0 || v["churn.requests"] < v["churn.produced"]) bad = 1
    if (v["time_ms.cast.max"] <= 0 || v["time_ms.evaluate.max"] <= 0 || v["pixels.hits"] <= 0) bad = 1
    if (v["pixels.incomplete"] != 0 || v["detail.given_px"] < 2) bad = 1
    exit bad }' flat
result "the statistics agree with one another"
detail=$(grep start_ms flat)
awk '{ v[$1] = $3 } END { exit !(v["start_ms.hole_free"] > 0 && v["start_ms.complete"] > v["start_ms.hole_free"]) }' flat
result "the start's two moments come one after the other"
detail=$(grep memory_bytes flat)
[ "$(grep -c '^memory_bytes\.' flat)" -ge 5 ]
result "memory is told by buffer"
run render hills -o a.png --stats - $quick
[ $status -eq 0 ] && awk -f "$flatten" stdout | grep -q '^settled = true'
result "--stats - writes to stdout"
finish
