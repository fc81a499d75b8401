#!/bin/sh
# A scan of many points: imported in bounded memory, killed at random moments and gone on with to the same bytes, and drawn as it streams.
# Figures are told as comments. Takes minutes to hours, and some 30 GB for 10^8 points; it is no part of make check:
#   sh tests/points/scale.sh [FOLDER]
# Variables: POINTS (1e8), KILLS (20), SEED, LEAST (points a second of CPU and of two cores, 700000), KARST (build/karst), BENCH
# (build/release/tests/points/bench_import). FOLDER keeps scan and model for another run of the same settings.
set -u
. tests/tap.sh
points=${POINTS:-1e8} kills=${KILLS:-20} seed=${SEED:-$(date +%N)} least=${LEAST:-700000}
karst=${KARST:-build/karst} bench=${BENCH:-build/release/tests/points/bench_import}
case $karst in /*) ;; *) karst="$PWD/$karst" ;; esac
case $bench in /*) ;; *) bench="$PWD/$bench" ;; esac
export KARST_DATA_DIR="$PWD/demos"
scratch=${1:-}
[ -n "$scratch" ] || { scratch=$(mktemp -d) && trap 'rm -rf "$scratch"' EXIT; } || exit 1
mkdir -p "$scratch" && cd "$scratch" || exit 1

# COMMAND...: runs it; its wall clock, its CPU seconds and its memory in MiB go to the file figures.
cat > metered.py << 'END'
import resource, subprocess, sys, time
start = time.time()
status = subprocess.call(sys.argv[1:])
used = resource.getrusage(resource.RUSAGE_CHILDREN)
with open("figures", "w") as file:
    file.write("%.2f %.2f %.0f\n" % (time.time() - start, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024))
sys.exit(status if status >= 0 else 128 - status)
END

# SECONDS COMMAND...: kills it then, and waits until it is gone, with its locks: 137; or it was done before.
cat > killed.py << 'END'
import subprocess, sys
process = subprocess.Popen(sys.argv[2:])
try:
    sys.exit(process.wait(float(sys.argv[1])))
except subprocess.TimeoutExpired:
    process.kill()
    process.wait()
    sys.exit(137)
END

if ! [ -e scan.ply ]; then
    KARST_SCAN_POINTS=$points KARST_SCAN_WRITE=begun.ply "$bench" && mv begun.ply scan.ply
fi
[ -s scan.ply ]
result "a scan of $points points"

if ! [ -e one.karstpoints ]; then
    detail=$(python3 metered.py "$karst" import scan.ply --axes karst -q -o one.karstpoints 2>&1)
    result "it is imported"
    mv figures one.figures
fi
read -r wall_s cpu_s mib < one.figures
echo "# $(stat -c %s one.karstpoints) bytes; $wall_s s, CPU $cpu_s s, at most $mib MiB resident"
awk -v points="$points" -v wall="$wall_s" 'BEGIN { printf "# %.0f points a second by the clock\n", points / wall }'
[ "$mib" -le 1024 ]
result "in at most 1 GiB ($mib MiB)"
# By CPU time, since the clock of a machine that is shared says little: where two cores are kept busy, this is the rate.
rate=$(awk -v points="$points" -v cpu="$cpu_s" 'BEGIN { printf "%.0f", points / (cpu / 2) }')
[ "$rate" -ge "$least" ]
result "at $rate points a second, by the CPU time of two cores"

if [ "$kills" -gt 0 ]; then
    rm -rf killed.karstpoints killed.karstpoints.import
    killed=0
    # Some waits are long, so that steps which begin anew when they are cut off come to their end, and later ones are cut off, too.
    for wait_s in $(awk -v seed="$seed" -v kills="$kills" -v wall="$wall_s" 'BEGIN { srand(seed)
        for (i = 0; i < kills; i++) printf "%.3f ", 0.1 + rand() ^ 2 * wall / 4 }'); do
        python3 killed.py "$wait_s" "$karst" import scan.ply --axes karst -q -o killed.karstpoints 2> talk
        [ $? -eq 137 ] && killed=$((killed + 1))
        if [ -e killed.karstpoints ]; then # it was done: begin once more
            cmp one.karstpoints killed.karstpoints || break
            rm killed.karstpoints
        fi
    done
    detail=$("$karst" import scan.ply --axes karst -q -o killed.karstpoints 2>&1) && cmp one.karstpoints killed.karstpoints &&
        ! [ -e killed.karstpoints.import ]
    result "killed at $killed of $kills moments, it has the same bytes (seed $seed)"
    rm -rf killed.karstpoints
fi

cat > scan.karst << 'END'
/*{ "voxel": 0.0625, "view": 3000, "camera": { "position": ["-420", "60", "-420"], "yaw": 45, "pitch": -10, "fov": 60 },
    "models": [{ "points": "one.karstpoints", "at": [0, 0, 0] }] }*/
float density(vec3 p) { return -p.y - 60.0; }
END
# The picture is complete, has the bytes of a second one (so it is calm), and no pixel of the plane far below within the scan.
for i in 1 2; do
    detail=$(python3 metered.py "$karst" render scan.karst --size 640x360 --pool 256 --samples 1 --display none -q -o $i.png 2>&1)
    result "drawn with a pool of 256 MiB"
done
read -r wall_s cpu_s mib < figures
echo "# render: $wall_s s, CPU $cpu_s s, $mib MiB resident"
cmp 1.png 2.png
result "twice the same picture"
for i in 1 2; do # the first one compiles kernels, which are kept
    "$karst" bench scan.karst --size 640x360 --pool 256 --runs 1 --rounds 2 --display none --json - > bench.json 2> talk
done
detail=$(cat talk)
first_ms=$(python3 -c 'import json; print("%.0f" % json.load(open("bench.json"))["start"]["process"]["hole_free_ms"])')
[ "$first_ms" -lt 1000 ]
result "the first picture without a hole after $first_ms ms, kernels kept"
finish
