#!/bin/sh
# karst bench from outside: its report, table, chart, trace and comparison. Nothing here depends on how fast anything is.
set -u
. tests/tap.sh
flatten="$PWD/tests/cli/flatten.awk"
. tests/cli/calls.sh
quick="--size 160x120 --pool 64 --detail 2 --view-distance 2000 --rounds 3"

complains 2 "which world" "no world" bench
complains 4 "did you mean 'hills'" "a misspelt world" bench hils
complains 2 "did you mean --rounds" "a misspelt option" bench hills --ronds 3
complains 2 "1 to 50" "no runs" bench hills --runs 0
complains 2 "says where the camera is" "a path and a camera" bench hills --path low-flight --camera 0,0,0,0,0
complains 2 "must be no-shadows, no-mirror or standing" "a second engine for nothing that there is" bench hills --beside floor
complains 2 "give a --path" "a view that stands beside no flight" bench hills --beside standing
complains 2 "would be the same" "no shadows beside no shadows" bench hills --beside no-shadows --no-shadows
complains 2 "would be the same" "no mirror beside no mirror" bench hills --beside no-mirror --mirror 0
complains 2 "0 to 1" "more than a mirror" bench hills --mirror 1.5
complains 2 "^karst: --frames is about a flight" "frames of no flight" bench hills --frames 3
complains 2 "whole numbers from 1" "particles that are no numbers" bench smoke --particles 250,many
complains 2 "from 1 to 1024" "no groups" bench smoke --groups 0
complains 2 "tables of their own" "particles along a path" bench smoke --particles 10 --path orbit
complains 2 "no parameter .particles." "particles where there are none" bench hills --particles 10 --size 16x16 --pool 64
run bench smoke --particles 30 --groups 1,2 --frames 1 --size 48x32 --pool 64 --json -
awk -f "$flatten" stdout > flat
[ $status -eq 0 ] && grep -q '^particles..particles = 30$' flat && [ "$(grep -c '^groups..groups = ' flat)" -eq 2 ] &&
    grep -q '^groups..thesis.frame_ms = 2.8007' flat &&
    awk '/^particles..(media|sun_depth|production)_ms/ && $3 > 0 { num++ } END { exit num != 3 }' flat
result "particles and groups: a table of each, beside the thesis"
complains 2 "^karst: --budget is about a flight" "a budget for no flight" bench hills --budget 3
complains 2 "^karst: --fps is about a flight" "frames a second of no flight" bench hills --fps 3
complains 2 "same file, a.out" "two outputs to one file" bench hills --json a.out --trace a.out
complains 5 "no path is called 'nowhere' .*; there are: .*low-flight" "an unknown path" bench hills --path nowhere
complains 2 "only one of" "two files to stdout" bench hills --json - --csv -
complains 1 "no-such-folder" "a report in a folder that is not there" bench hills --json no-such-folder/a.json
complains 5 "unable to open nothing.json: No such file or directory$" "a comparison with nothing" bench hills --compare nothing.json
echo '{"world": "hills"}' > other.json
complains 5 "no report of karst bench" "a comparison with something else" bench hills --compare other.json
[ -z "$(ls | grep -vE '^(stdout|stderr|other.json|flat)$')" ]
result "none of these left anything behind"
complains 2 "about the world glass" "effects of another world" bench hills --effects none
complains 2 "nothing is called 'foo'; there are: none, shadows" "an effect that there is not" bench glass --effects none,foo
complains 2 "'12x' is no size" "half a size" bench glass --sizes 64x48,12x
complains 2 "'' is no detail" "a list that ends with a comma" bench glass --details 2,
complains 2 "8 at most" "too many sizes" bench glass --sizes 1x1,1x2,1x3,1x4,1x5,1x6,1x7,1x8,1x9
complains 2 "leave --csv out" "a table and frames" bench glass --effects none --csv a.csv

if [ -n "${KARST_TEST_FULL:-}" ]; then # its kernels take long to compile
run bench glass --effects shadows --sizes 64x48 --details 8 --rounds 2 --pool 32 --json effects.json --plot effects.svg
[ $status -eq 0 ] && grep -qE '^8 +64x48 +none .* 1\.00 +1\.00 +3072 ' stdout &&
    grep -qE '^8 +64x48 +shadows .* 1\.31 ' stdout && grep -q '</svg>' effects.svg &&
    awk -f "$flatten" effects.json | grep -q '^cells\.\.thesis_ratio = 1.31'
result "what effects cost: table, JSON and SVG"
: > rows
"$karst" bench glass --effects none,shadows --sizes 64x48,96x64 --details 8,4,2 --rounds 101 --pool 32 --json part.json > rows 2> said < /dev/null &
worker=$!
tries=0
until grep -q '^8 .* shadows ' rows || [ $tries -eq 3000 ]; do sleep 0.1 && tries=$((tries + 1)); done
kill -INT $worker
wait $worker
status=$?
num=$(grep -cE '^[842] +[0-9]' rows)
detail="exit $status, $num rows: $(cat said)"
[ $status -eq 130 ] && [ "$num" -ge 2 ] && [ "$num" -lt 12 ] && [ -s said ] &&
    awk -f "$flatten" part.json > flat && grep -q '^complete = false$' flat && [ "$(grep -c '^cells\.\.ratio' flat)" -eq "$num" ]
result "Ctrl-C: what was measured until then is there"
fi

run help bench
[ $status -eq 0 ] && for option in size camera path budget fps frames runs rounds json csv plot trace compare detail \
    seed param no-shadows mirror beside pool device display lanes; do
    grep -q -e "--$option" stdout || status="no --$option"
done
[ "$status" = 0 ]
result "help bench names every option"

# ---- a view ----
run bench hills $quick --runs 2 --json still.json --csv still.csv
[ $status -eq 0 ] && [ ! -s stderr ] && grep -q 'settled frame / floor' stdout && grep -q '^memory .*bricks' stdout &&
    grep -q 'loads alone' stdout && grep -q 'start of the process' stdout && ! grep -q nan stdout
result "a view: the table"
awk -f "$flatten" still.json > flat
wanted="karst_bench version world camera device display cores width_px height_px shadows path runs rounds \
detail.asked_px detail.given_px memory_total_bytes memory_bytes.bricks memory_bytes.nodes cache.used_bytes \
cache.hit_bricks start.process.opened_ms start.process.hole_free_ms start.process.complete_ms settling.at_level.p1"
for stage in frame production cast shade collect subdivide evaluate finalise display; do
    for figure in median p95 p99 max jank runs.median runs.min runs.max; do
        wanted="$wanted settled.time_ms.$stage.$figure settling.time_ms.$stage.$figure"
    done
done
for figure in requests produced evicted reproduced deferred; do wanted="$wanted settling.churn_per_frame.$figure"; done
for place in ceilings.floor_ms ceilings.fma_per_s ceilings.memory_bytes_per_s ceilings.noise_samples_per_s \
    ratios.settled_frame_per_floor ratios.cold_frame_per_settled_frame ratios.used_bricks_per_hit_brick \
    production.bricks_per_core_s \
    production.voxels_per_core_s production.load_voxels_per_core_s production.bounds_core_us_per_node \
    production.load_per_noise start.opened_ms start.hole_free_ms start.complete_ms; do
    wanted="$wanted $place.median $place.min $place.max"
done
for pool in tiles bricks; do
    for figure in used resident total bytes; do wanted="$wanted cache.$pool.$figure"; done
done
missing=
for key in $wanted; do grep -q "^$key = " flat || missing="$missing $key"; done
detail="missing:$missing"
[ -s flat ] && [ -z "$missing" ]
result "the report has every figure"
detail=$(cat flat)
awk '{ v[$1] = $3 } END {
    for (k in v) if (k ~ /\.median$/) {
        b = substr(k, 1, length(k) - 7)
        if ((b ".min") in v && (b ".max") in v && (v[b ".min"] + 0 > v[k] + 0 || v[k] + 0 > v[b ".max"] + 0)) bad = k
        if ((b ".p99") in v && v[k] + 0 > v[b ".p99"] + 0) bad = k
        if ((b ".p95") in v && (v[k] + 0 > v[b ".p95"] + 0 || v[b ".p95"] + 0 > v[b ".p99"] + 0)) bad = k
    }
    for (k in v) if (k ~ /^memory_bytes\./) sum += v[k]
    if (sum != v["memory_total_bytes"]) bad = "memory"
    if (v["settled.frames"] != 6 || v["runs"] != 2 || v["settled.churn_per_frame.produced"] != 0) bad = "settled"
    if (v["cold.frames"] != 6 || v["ratios.cold_frame_per_settled_frame.min"] <= 0) bad = "cold"
    if (v["settled.at_level.min"] != 1 || v["cache.hit_bricks"] < 1 || v["flight"] != "null") bad = "hits"
    if (v["cache.bricks.used"] < v["cache.hit_bricks"] || v["ratios.used_bricks_per_hit_brick.min"] < 1) bad = "bricks"
    if (v["ceilings.fma_per_s.min"] < 1e8 || v["ceilings.memory_bytes_per_s.min"] < 1e8) bad = "ceilings"
    if (v["ceilings.noise_samples_per_s.min"] < 1e4 || v["ceilings.floor_ms.min"] <= 0) bad = "floor"
    if (v["start.opened_ms.min"] <= 0 || v["start.hole_free_ms.min"] < v["start.opened_ms.min"] ||
        v["start.complete_ms.min"] < v["start.hole_free_ms.min"]) bad = "start"
    if (v["production.bricks"] < 10 || v["production.bricks_per_core_s.min"] <= 0) bad = "production"
    if (bad) print "# " bad
    exit bad != "" }' flat
result "its figures agree with one another"
detail=$(head -n 3 still.csv)
[ "$(wc -l < still.csv)" -gt 12 ] && awk -F, 'NR == 1 { n = NF } NF != n || n < 20 { exit 1 }' still.csv &&
    [ "$(grep -c '^settled,' still.csv)" -eq 6 ] && grep -q '^settling,1,' still.csv
result "a line for each frame, each with all columns"

# ---- a second engine beside it ----
# Shadow rays come to bricks that the camera's do not: those of the engine without are fewer.
run bench hills $quick --runs 2 --beside no-shadows --json beside.json --csv beside.csv
awk -f "$flatten" beside.json > flat
detail="$detail $(cat stdout flat)"
[ $status -eq 0 ] && grep -q 'settled frame / the same without shadows' stdout &&
    awk -F, 'NR == 1 { for (i = 1; i <= NF; i++) at[$i] = i; next }
        $1 == "settled" { used[$2] = $at["bricks_used"] }
        $1 == "beside" { num++; if ($at["bricks_used"] >= used[$2] || $at["bricks_used"] < 1) bad = 1 }
        END { exit bad || num != 6 }' beside.csv &&
    awk '{ v[$1] = $3 } END { exit !(v["beside_view"] == "\"no-shadows\"" && v["beside.frames"] == 6 &&
        v["beside.churn_per_frame.produced"] == 0 && v["settled.frames"] == 6) }' flat
result "the view without shadows, in turns"
# Each settled frame to the median of the frames beside it, here all three of its run.
awk -F, -v file=flat '
    function middle(v, run,    a, b, c) {
        a = v[run, 0]; b = v[run, 1]; c = v[run, 2]
        return a > b ? (b > c ? b : a > c ? c : a) : (a > c ? a : b > c ? c : b)
    }
    $1 == "settled" { settled[$2, $3] = $5 }
    $1 == "beside" { beside[$2, $3] = $5 }
    END {
        for (run = 0; run < 2; run++) ratio[run] = middle(settled, run) / middle(beside, run)
        FS = " "
        while ((getline line < file) > 0) { split(line, part, " "); v[part[1]] = part[3] }
        name = "ratios.settled_frame_per_frame_without_shadows."
        less = ratio[0] < ratio[1] ? ratio[0] : ratio[1]
        more = ratio[0] < ratio[1] ? ratio[1] : ratio[0]
        printf "# %.6f %.6f in the frames; %s %s in the report\n", less, more, v[name "min"], v[name "max"]
        exit (v[name "min"] - less) ^ 2 > 1e-10 || (v[name "max"] - more) ^ 2 > 1e-10
    }' beside.csv > stdout
status=$?
detail=$(cat stdout)
[ $status -eq 0 ]
result "its ratio is that of the frames"

# ---- mirrors ----
run bench hills $quick --runs 1 --mirror 1 --beside no-mirror --json mirror.json
awk -f "$flatten" mirror.json > flat
[ $status -eq 0 ] && grep -q 'ns a ray: primary [0-9.]* of 19200, shadow .*, mirror [0-9.]* of' stdout &&
    grep -q 'the same without mirrors' stdout && awk '{ v[$1] = $3 } END {
    exit !(v["settled.streams.primary.rays"] == 19200 && v["settled.streams.mirror.rays"] > 1000 &&
        v["settled.streams.mirror.rays"] < 19200 && v["beside.streams.mirror.rays"] == 0 &&
        v["settled.streams.shadow.rays"] > v["beside.streams.shadow.rays"] &&
        v["settled.streams.mirror.ns_per_ray.median"] > 0 && v["settings.mirror"] == 1 &&
        v["ratios.settled_frame_per_frame_without_mirror.min"] > 0) }' flat
result "mirrors: rays and their time by stream, beside the same without"

# As reports were before there was a second engine.
grep -v '"beside_view"' still.json > old.json
grep -q beside_view old.json && rm old.json
run bench hills $quick --runs 1 --json - --compare old.json
[ $status -eq 0 ] && awk -f "$flatten" stdout | grep -q '^karst_bench = 1' && grep -q 'spread of the runs' stderr &&
    ! grep -q 'not the same' stderr
result "--json - has stdout for itself"

# ---- a flight ----
echo '{"keyframes": [{"time": 0, "position": ["0", "320", "0"], "yaw": 0, "pitch": -10},
    {"time": 1, "position": ["60", "320", "0"], "yaw": 40, "pitch": -10}]}' > turn.json
run bench hills $quick --runs 1 --path ./turn.json --fps 12 --json flight.json --plot flight.svg --trace trace.json \
    --csv flight.csv
detail="$detail $(cat stdout)"
[ $status -eq 0 ] && grep -q 'flight, p99 / settled frame' stdout && [ "$(grep -c '^flight,' flight.csv)" -eq 12 ]
result "a flight: the table"
awk -f "$flatten" flight.json > flat
detail=$(cat flat)
awk '{ v[$1] = $3 } END { exit !(v["flight.frames"] == 12 && v["budget_ms"] == 8 && v["fps"] == 12 &&
    v["flight.churn_per_frame.produced"] > 0 && v["flight.time_ms.evaluate.max"] > 0 &&
    v["ratios.flight_frame_per_settled_frame.median"] > 0 && v["flight.at_level.p1"] <= 1) }' flat
result "a flight: the report"
# The view where the flight begins stands beside it: drawn before the frames 0 and 15, the same each time.
run bench hills $quick --runs 1 --path ./turn.json --fps 20 --beside standing --json standing.json --csv standing.csv
awk -f "$flatten" standing.json > flat_standing
detail="$detail $(cat stdout flat_standing; grep -E '^(settled|beside)' standing.csv)"
[ $status -eq 0 ] && grep -q 'flight, p99 / standing frame' stdout &&
    awk -F, -v file=flat_standing 'NR == 1 { for (i = 1; i <= NF; i++) at[$i] = i; next }
        $1 == "settled" { hits = $at["hits"]; used = $at["bricks_used"] }
        $1 == "flight" { frame[num++] = $5 }
        $1 == "beside" {
            beside[$3] = $5; num_beside++
            if ($at["hits"] != hits || $at["bricks_used"] != used || $at["bricks_produced"] != 0) bad = 1
        }
        END {
            if (num != 20 || num_beside != 2 || !(0 in beside) || !(15 in beside)) exit 1
            least = beside[0] < beside[15] ? beside[0] : beside[15] # the median of two
            for (i = 0; i < num; i++) for (k = i; k > 0 && frame[k] < frame[k - 1]; k--) {
                t = frame[k]; frame[k] = frame[k - 1]; frame[k - 1] = t
            }
            while ((getline line < file) > 0) { split(line, part, " "); v[part[1]] = part[3] }
            median = v["ratios.flight_frame_per_standing_frame.median"]
            p99 = v["ratios.flight_p99_per_standing_frame.median"]
            exit bad || v["beside_view"] != "\"standing\"" || (median - frame[9] / least) ^ 2 > 1e-10 ||
                (p99 - frame[19] / least) ^ 2 > 1e-10
        }' standing.csv
result "a flight beside a view that stands: each frame as a ratio to it"
# A file against itself, as a report of the very same run would be.
sed 's/"shadows": true/"shadows": false/' flight.json > changed.json
if command -v python3 > /dev/null; then
    detail=$(python3 - 2>&1 << 'END'
import json, re, xml.dom.minidom
trace = json.load(open("trace.json"))["traceEvents"]
tracks = {e["args"]["name"]: e["tid"] for e in trace if e["name"] == "thread_name"}
assert set(tracks) == {"frames", "host thread", "device queue"}, tracks
frames = [e for e in trace if e.get("tid") == tracks["frames"] and e["ph"] == "X"]
assert sum(e["name"].startswith("flight") for e in frames) == 12
for track in ("host thread", "device queue"):
    spans = [e for e in trace if e.get("tid") == tracks[track] and e["ph"] == "X"]
    assert len(spans) > 50, (track, len(spans))
    # Every span lies in a frame or in a measurement between two.
    inside = sum(any(f["ts"] - 100 <= e["ts"] and e["ts"] + e["dur"] <= f["ts"] + f["dur"] + 100 for f in frames)
                 for e in spans)
    assert inside > 0.9 * len(spans), (track, inside, len(spans))
# The queue is in order: its spans do not overlap.
queue = sorted((e["ts"], e["ts"] + e["dur"]) for e in trace if e.get("tid") == tracks["device queue"] and e["ph"] == "X")
assert all(a[1] <= b[0] + 0.01 for a, b in zip(queue, queue[1:]))
assert {"cast_pinhole", "shade_pixels"} <= {e["name"] for e in trace}
svg = xml.dom.minidom.parse("flight.svg").documentElement
assert svg.tagName == "svg" and len(svg.getElementsByTagName("path")) > 50
END
    ) && [ -z "$detail" ]
    result "the trace and the chart are well formed"
else
    skip "the trace and the chart are well formed" "no python3 here"
fi
run bench hills $quick --runs 1 --rounds 3 --path ./turn.json --fps 12 --no-blend --seed 7 --compare changed.json
[ $status -eq 0 ] && grep -q 'not the same shadows: true now, false then' stdout &&
    grep 'not the same settings' stdout | grep -q '"blend": false.*"seed": 7.* now, .*"blend": true.*"seed": null.* then' &&
    grep -qE '^ratios.settled_frame_per_floor +[0-9.]+ +[0-9.]+ +[0-9.]+ ' stdout
result "a comparison says what was not the same"
cat > self.sh << 'END'
# The report is written before it is compared: this run's own.
"$1" bench hills $2 --runs 2 --json self.json --compare self.json
END
cp still.json self.json
sh self.sh "$karst" "$quick" > stdout 2> stderr
status=$?
detail="exit $status: $(cat stderr stdout)"
[ $status -eq 0 ] && [ "$(grep -cE '^(ratios|ceilings|settled|production|start)\.' stdout)" -ge 15 ] &&
    grep -E '^(ratios|ceilings|settled|production|start)\.' stdout | awk '$4 != "1.000" || NF > 7 { exit 1 }'
result "a report compared with itself: every ratio is 1, nothing better or worse"
"$karst" bench hills --runs 50 --json stopped.json > stdout 2> stderr &
until_caught $!
sleep 1
kill -TERM $!
wait $!
status=$?
detail="exit $status: $(cat stderr)"
[ $status -eq 143 ] && grep -q interrupted stderr && [ ! -e stopped.json ]
result "interrupted: nothing is written"
finish
