#!/bin/sh
# Karst on a machine with a GPU: builds, runs the kernel tests (bits against the host's included) and the standard
# benchmarks at three sizes, and prints a short table last, also if it is stopped or something does not build. Made for
# bare machines and for short leases: it installs nothing, needs no root, works around what is missing if it can, and
# says plainly what it could not do. What tells most comes first; no part may take the time of all that follow.
#
#   sh tests/gpu.sh [FOLDER]     logs and reports go to FOLDER (default: build/gpu)
#
# Without a GPU it rehearses on whatever OpenCL device there is. Variables, all optional:
#   KARST_PREFIX=DIR   packages unpacked there (dpkg -x x.deb DIR): headers and libraries are looked for in DIR/usr
#   KARST_DEBS=DIR     a folder of .deb files, unpacked first; then KARST_PREFIX defaults to FOLDER/prefix
#   KARST_DEVICE=NAME  as --device of the command (default: the first GPU, else the first CPU)
#   KARST_GPU_LIMIT_S  seconds for all of it (default: 450)
#   KARST_GPU_BUILD=DIR  a build folder, which may hold a build already (default: FOLDER/build)
#   KARST_GPU_PREBUILT=yes  takes what that folder holds: no headers and no make are needed
#   KARST_GPU_SIZES    (default: "1280x720 1920x1080 3840x2160")
#   KARST_GPU_TESTS=no or KARST_GPU_BENCH=no leave a half out
set -u
cd "$(dirname "$0")/.." || exit 1
began=$(date +%s)
limit=${KARST_GPU_LIMIT_S:-450}
out=${1:-build/gpu}
mkdir -p "$out" || exit 1
out=$(cd "$out" && pwd)
build=${KARST_GPU_BUILD:-$out/build}
prebuilt=${KARST_GPU_PREBUILT:-no}
lacks=$out/lacks
: > "$lacks"
lack() { echo "$*" | tee -a "$lacks"; }
left() { echo $((limit - ($(date +%s) - began))); }
say() { echo "== $* ($(($(date +%s) - began)) s)"; }
# share N [MOST]: seconds that a part may take: an N-th of what is left, within 5 and MOST.
share()
{
    part=$(($(left) / $1))
    [ -z "${2:-}" ] || [ "$part" -le "$2" ] || part=$2
    [ "$part" -ge 5 ] || part=5
    echo "$part"
}

# within SECONDS COMMAND...: a signal to this script is answered at once, not when the command ends.
child=
within()
{
    timeout -k 5 "$@" &
    child=$!
    wait $child
    ended=$?
    child=
    return $ended
}

# ---- the table, whatever happens ----
rows=$out/rows
: > "$rows"
rm -f "$out/ceilings" "$out/reference" "$out/light"
name= display= karst= done=no passed=0 failed=0 failures=
print_table()
{
    trap - EXIT HUP INT TERM
    [ -z "$child" ] || kill "$child" 2> /dev/null
    [ $done = yes ] || lack "stopped before its end"
    echo
    echo "Karst $(${karst:-:} --version 2> /dev/null | sed -n 1p | cut -d ' ' -f 2) on ${name:-no device}," \
        "display ${display:-none}, after $(($(date +%s) - began)) s"
    cat "$out/ceilings" 2> /dev/null
    if [ -s "$rows" ]; then
        printf '%-8s %-10s %8s %7s %8s %8s %8s %8s %8s %9s %8s %6s\n' world size frame xfloor cast shade collect flight \
            p99 bricks/s start px
        cat "$rows"
        echo "(ms; frame: settled; flight: median with 8 ms of production; start: from nothing to the settled picture)"
    fi
    cat "$out/light" 2> /dev/null
    cat "$out/reference" 2> /dev/null
    [ "${KARST_GPU_TESTS:-yes}" = no ] || echo "kernel tests: $passed passed, $failed failed${failures:+:$failures}"
    if [ -s "$lacks" ]; then
        echo "what was lacking:"
        sed 's/^/  /' "$lacks"
    else
        echo "nothing was lacking"
    fi
    echo "logs, reports, a trace and a picture: $out"
    [ $done = yes ] && [ "$failed" -eq 0 ] && { [ -s "$rows" ] || [ "${KARST_GPU_BENCH:-yes}" = no ]; }
    exit
}
trap print_table EXIT
trap 'exit 1' HUP INT TERM

# ---- what the machine has not ----
prefix=${KARST_PREFIX:-}
if [ -n "${KARST_DEBS:-}" ]; then
    prefix=${prefix:-$out/prefix}
    mkdir -p "$prefix"
    for deb in "$KARST_DEBS"/*.deb; do
        if command -v dpkg > /dev/null; then
            dpkg -x "$deb" "$prefix" || lack "could not unpack $deb"
        else
            (mkdir -p "$out/deb" && cd "$out/deb" && rm -f data.tar.* && ar x "$deb" && tar -xf data.tar.* -C "$prefix") ||
                lack "could not unpack $deb"
        fi
    done
fi
tools=$out/tools
mkdir -p "$tools"
if [ -n "$prefix" ]; then
    prefix=$(cd "$prefix" && pwd) || exit 1
    include=$prefix/usr/include
    libraries=
    for folder in "$prefix"/usr/lib/*-linux-gnu "$prefix"/lib/*-linux-gnu "$prefix"/usr/lib; do
        [ -d "$folder" ] && libraries=$libraries${libraries:+:}$folder
    done
    export CPATH="$include:$include/$(uname -m)-linux-gnu:$include/cairo:$include/libpng16${CPATH:+:$CPATH}"
    export LIBRARY_PATH="$libraries${LIBRARY_PATH:+:$LIBRARY_PATH}"
    export LD_LIBRARY_PATH="$libraries${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}"
    export PATH="$prefix/usr/bin:$PATH"
fi
# With unpacked packages, or without pkg-config, the flags are known anyway: CPATH and LIBRARY_PATH say where.
if [ -n "$prefix" ] || ! command -v pkg-config > /dev/null; then
    cat > "$tools/pkg-config" << 'END'
#!/bin/sh
for word; do
    case $word in
    --cflags) flags=yes ;;
    --libs) libs=yes ;;
    libpng) list="${list:-} -lpng16" ;;
    libtiff-4) list="${list:-} -ltiff" ;;
    jansson) list="${list:-} -ljansson" ;;
    cairo) list="${list:-} -lcairo" ;;
    OpenCL) list="${list:-} -lOpenCL" ;;
    glfw3) list="${list:-} -lglfw" ;;
    -*) ;;
    *) list="${list:-} -l$word" ;;
    esac
done
[ "${libs:-no}" = no ] || echo "${list:-}"
[ "${flags:-no}" = no ] || for folder in /usr/include/cairo /usr/include/libpng16; do [ ! -d $folder ] || echo -I$folder; done
END
    chmod +x "$tools/pkg-config"
    export PATH="$tools:$PATH"
fi
has_header() { echo "#include <$1>" | "${CC:-cc}" -E -x c - > /dev/null 2>&1; }
if [ "$prebuilt" = no ]; then
    for tool in make "${CC:-cc}" "${AR:-ar}" awk timeout; do
        command -v "$tool" > /dev/null || { lack "no $tool: cannot build"; exit 1; }
    done
    for header in CL/cl.h EGL/egl.h GL/glcorearb.h GL/osmesa.h png.h jansson.h cairo.h OpenEXR/openexr.h GLFW/glfw3.h; do
        has_header $header || has_header "cairo/$header" || lack "no header $header: a package is missing (README.md names them)"
    done
    has_header cmocka.h || { lack "no header cmocka.h: no tests"; KARST_GPU_TESTS=no; }
fi

# Finds a library by name where the loader and drivers in containers have it.
find_library()
{
    ldconfig -p 2> /dev/null | awk -v name="$1" '$1 == name { print $NF; exit }' | grep . && return
    for folder in $(echo "${LD_LIBRARY_PATH:-}" | tr : ' ') /usr/local/nvidia/lib64 /usr/local/nvidia/lib \
        /usr/lib/*-linux-gnu /usr/lib64 /usr/lib/wsl/lib; do
        [ -e "$folder/$1" ] && echo "$folder/$1" && return
    done
    return 1
}
gpu_icd=$(find_library libnvidia-opencl.so.1) || gpu_icd=
if [ -z "${OCL_ICD_VENDORS:-}" ] && [ -n "$gpu_icd" ] && ! grep -qs nvidia /etc/OpenCL/vendors/*.icd; then
    mkdir -p "$out/icd"
    cp /etc/OpenCL/vendors/*.icd "$prefix"/etc/OpenCL/vendors/*.icd "$out/icd" 2> /dev/null
    echo "$gpu_icd" > "$out/icd/nvidia.icd"
    export OCL_ICD_VENDORS="$out/icd/"
    lack "no ICD file named NVIDIA's OpenCL: wrote one for $gpu_icd"
elif [ -z "${OCL_ICD_VENDORS:-}" ] && [ -n "$prefix" ] && ! ls /etc/OpenCL/vendors/*.icd > /dev/null 2>&1; then
    export OCL_ICD_VENDORS="$prefix/etc/OpenCL/vendors/"
fi
find_library libOpenCL.so.1 > /dev/null || lack "no OpenCL loader (libOpenCL.so.1, package ocl-icd-libopencl1)"
[ -n "$gpu_icd" ] || command -v nvidia-smi > /dev/null 2>&1 && [ -z "$gpu_icd" ] &&
    lack "an NVIDIA GPU without its OpenCL: no libnvidia-opencl.so.1"
egl_driver=$(find_library libEGL_nvidia.so.0) || egl_driver=
if [ -n "$egl_driver" ] && ! grep -qs nvidia /usr/share/glvnd/egl_vendor.d/*.json /etc/glvnd/egl_vendor.d/*.json; then
    echo "{\"file_format_version\": \"1.0.0\", \"ICD\": {\"library_path\": \"$egl_driver\"}}" > "$out/egl.json"
    export __EGL_VENDOR_LIBRARY_FILENAMES="$out/egl.json"
    lack "no EGL vendor file for NVIDIA: wrote one for $egl_driver"
fi
find_library libEGL.so.1 > /dev/null || lack "no EGL (libEGL.so.1, package libegl1): pictures go to plain memory"

# ---- build ----
cores=$(nproc 2> /dev/null || echo 2)
mkdir -p "$build"
# The check for packages wants package names; what counts here is whether it compiles.
touch "$build/dependencies-tests.mk" "$build/dependencies-build.mk"
make="make BUILD=$build -j$cores"
[ "$prebuilt" = no ] || make=true
say "building with $cores jobs"
if ! within "$(share 1)" $make "$build/karst" > "$out/build.log" 2>&1; then
    tail -n 20 "$out/build.log"
    lack "Karst does not build here"
    exit 1
fi
karst=$build/karst
export KARST_DATA_DIR="$PWD/demos" KARST_CACHE_DIR="$out/cache"
device=${KARST_DEVICE:-}
within "$(share 4)" $karst info > "$out/info" 2>&1
cat "$out/info"
say "the first picture"
within "$(share 2)" $karst render hills ${device:+--device "$device"} --size 1280x720 -q -o "$out/hills.png" \
    --stats "$out/first.json" 2> "$out/first.log" ||
    { cat "$out/first.log"; lack "no picture: $(head -n 1 "$out/first.log")"; exit 1; }
flatten() { awk -f tests/cli/flatten.awk "$1"; }
value() { flatten "$1" | awk -v name="$2" '$1 == name { sub(/^[^=]*= /, ""); gsub(/"/, ""); print; exit }'; }
name=$(value "$out/first.json" device)
display=$(value "$out/first.json" display)
[ "$display" = egl ] || lack "no EGL display that works: it is $display"
is_gpu=no
if [ -n "$gpu_icd" ] || ! echo "$name" | grep -qiE 'pthread|cpu|xeon|epyc|core|basic'; then
    is_gpu=yes
else
    lack "no GPU: this is a rehearsal on $name"
    # The shape that a GPU would run.
    export KARST_TEST_LANES=1
fi

# ---- benchmarks ----
pool=512
[ $is_gpu = yes ] && pool=4096
bench_one()
{
    world=$1 size=$2 file=$out/$1-$2$3.json
    shift 3
    [ "$(left)" -ge 8 ] || { lack "no time for bench $world $size $*"; return; }
    room=$(share 2 90)
    say "bench $world $size $*"
    if ! within "$room" "$karst" bench "$world" ${device:+--device "$device"} --size "$size" -q --json "$file" "$@" \
        > "$file.log" 2>&1; then
        why=$(tail -n 1 "$file.log" | cut -c 1-200)
        lack "bench $world $size $*: ${why:-not done within $room s}"
        return
    fi
    what=$(echo "$*" | sed 's/--\(runs\|rounds\|pool\|trace\|frames\) [^ ]* *//g')
    flatten "$file" | awk -v world="$world" -v size="$size" -v what="$what" '
        { value = $0; sub(/^[^=]*= /, "", value); v[$1] = value }
        END {
            printf "%-8s %-10s %8.2f %7.2f %8.2f %8.2f %8.3f", world, size, v["settled.time_ms.frame.median"],
                v["ratios.settled_frame_per_floor.median"], v["settled.time_ms.cast.median"],
                v["settled.time_ms.shade.median"], v["settled.time_ms.collect.median"]
            if (v["flight.time_ms.frame.p99"] != "") printf " %8.2f %8.2f", v["flight.time_ms.frame.median"],
                v["flight.time_ms.frame.p99"]
            else printf " %8s %8s", "-", "-"
            printf " %9.0f %8.0f %6.2f  %s\n", v["production.bricks_per_core_s.median"] * v["cores"],
                v["start.complete_ms.median"], v["detail.given_px"], what }' >> "$rows"
    [ -s "$out/ceilings" ] || flatten "$file" | awk '
        { v[$1] = $3 }
        END { printf "ceilings: %.0f Gfma/s, %.0f GB/s copied, bare noise %.0f Mvoxel/s, floor %.3f ms\n",
            v["ceilings.fma_per_s.median"] * 1e-9, v["ceilings.memory_bytes_per_s.median"] * 1e-9,
            v["ceilings.noise_samples_per_s.median"] * 1e-6, v["ceilings.floor_ms.median"] }' > "$out/ceilings"
}
few="--runs 1 --rounds 9 --pool $pool"

# Streams of rays: land that mirrors, beside itself without; paths of light; and glass from nothing, whose kernels are
# the largest. A line each.
light_mirror()
{
    [ "$(left)" -ge 8 ] || { lack "no time for mirrors"; return; }
    say "bench hills 800x600 --mirror 1"
    within "$(share 2 60)" "$karst" bench hills ${device:+--device "$device"} --size 800x600 -q --json "$out/mirror.json" \
        $few --mirror 1 --beside no-mirror > "$out/mirror.log" 2>&1 || { lack "mirrors were not measured in time"; return; }
    flatten "$out/mirror.json" | awk '
        { value = $0; sub(/^[^=]*= /, "", value); v[$1] = value }
        END { printf "hills 800x600, all of it a mirror: %.2f of a frame without, %.1f ns a mirrored ray, %.1f a camera ray\n",
            v["ratios.settled_frame_per_frame_without_mirror.median"], v["settled.streams.mirror.ns_per_ray.median"],
            v["settled.streams.primary.ns_per_ray.median"] }' >> "$out/light"
}
render_timed()
{
    title=$1
    shift
    [ "$(left)" -ge 8 ] || { lack "no time for $title"; return; }
    say "$title"
    within "$(share 2 90)" "$karst" render "$@" ${device:+--device "$device"} --pool "$pool" -q -o "$out/light.png" \
        --stats "$out/light.json" > "$out/light.log" 2>&1 || { lack "$title: not in time"; return; }
    echo "$title: $(value "$out/light.json" start_ms.complete) ms, $(value "$out/light.json" frames) frames" >> "$out/light"
}
light_full()
{
    size=160x120 samples=8
    [ $is_gpu = no ] || size=640x480 samples=32
    render_timed "full light of hills, $size, $samples samples" hills --light full --samples $samples --size $size
}
light_glass()
{
    export KARST_CACHE_DIR="$out/empty"
    rm -rf "$out/empty"
    render_timed "glass from an empty cache, 320x240" glass --samples 1 --size 320x240
    export KARST_CACHE_DIR="$out/cache"
}
sizes=${KARST_GPU_SIZES:-1280x720 1920x1080 3840x2160}
first=${sizes%% *}
# The one line that everything is judged by does not wait for the tests.
[ "${KARST_GPU_BENCH:-yes}" = no ] || bench_one hills "$first" "" $few --no-shadows --trace "$out/hills-trace.json"

# ---- tests of the kernels ----
if [ "${KARST_GPU_TESTS:-yes}" != no ]; then
    # The most telling first, should time run out; those that compile a world or many take the longest.
    tests="worlds/test_golden worlds/test_same_bits producers/test_finalise producers/test_producer language/test_emit
        language/test_tape raycast/test_cast raycast/test_cast_exact raycast/test_shade cache/test_lists cache/test_changes
        engine/test_engine engine/test_clear engine/test_paths edits/test_edits points/test_points media/test_depth
        core/test_dialect noise/test_lanes core/test_program core/test_profile core/test_context core/test_display
        producers/test_thin producers/test_raise cache/test_model cache/test_scenarios cache/test_stores
        raycast/test_cast_requests raycast/test_sides raycast/test_sunward raycast/test_convex raycast/test_gloss
        raycast/test_dielectric raycast/test_bend edits/test_edited engine/test_mirror engine/test_caustics
        engine/test_samples engine/test_pass engine/test_depth engine/test_rays engine/test_light_map engine/test_occlusion
        engine/test_exact_fit points/test_surface points/test_splats media/test_scattering media/test_fluence
        media/test_full media/test_ray noise/test_noise noise/test_families worlds/test_planet hard/test_jumps"
    programs=
    for test in $tests; do
        [ -e "tests/$test.c" ] && programs="$programs $build/release/tests/$test"
    done
    say "building tests"
    within "$(share 3)" $make -k $programs > "$out/build-tests.log" 2>&1 ||
        lack "not all tests build, or not in time: see build-tests.log"
    # Half of what is left is for the benchmarks.
    end=$(($(date +%s) + $(left) / 2))
    [ "${KARST_GPU_BENCH:-yes}" != no ] || end=$(($(date +%s) + $(left) - 5))
    # A driver's compiler uses one core: as many at once as there are.
    abreast=$((cores > 2 ? cores - 1 : 1))
    say "kernel tests, $abreast at once"
    export CMOCKA_MESSAGE_OUTPUT=TAP KARST_TEST_QUICK=1
    cat > "$tools/one_test" << 'END'
#!/bin/sh
# one_test BUILD OUT END TEST: runs it until END at most, and 100 s.
log=$2/$(echo "$4" | tr / _).log
room=$(($3 - $(date +%s)))
[ $room -ge 5 ] || exit 0
[ $room -le 100 ] || room=100
began=$(date +%s)
KARST_CACHE_DIR=off timeout -k 5 $room "$1/release/tests/$4" > "$log" 2>&1
echo "$? $(($(date +%s) - began))" > "${log%.log}.ended"
END
    chmod +x "$tools/one_test"
    rm -f "$out"/*.ended
    echo $tests | tr ' ' '\n' > "$out/tests"
    within $((end - $(date +%s) + 10)) xargs -P $abreast -n 1 -a "$out/tests" "$tools/one_test" "$build" "$out" $end
    skipped=
    for test in $tests; do
        log=$out/$(echo "$test" | tr / _).log
        [ -x "$build/release/tests/$test" ] || { lack "test $test is not built"; continue; }
        [ -e "${log%.log}.ended" ] || { skipped="$skipped $test"; continue; }
        read -r status seconds < "${log%.log}.ended"
        oks=$(grep -cE '^ok ' "$log")
        bads=$(grep -E '^not ok ' "$log" | grep -cv '# SKIP')
        if [ "$status" -eq 124 ] || [ "$status" -eq 137 ]; then
            lack "test $test ran out of time after $oks good ones"
        elif [ "$status" -ne 0 ] && [ "$bads" -eq 0 ]; then
            bads=1
        fi
        passed=$((passed + oks)) failed=$((failed + bads))
        [ "$bads" -eq 0 ] || failures="$failures $test"
        echo "$test: $oks ok, $bads not, $seconds s"
        [ "$bads" -eq 0 ] || grep -vE '^ok ' "$log" | tail -n 8 | sed 's/^/    /'
    done
    [ -z "$skipped" ] || lack "no time for tests:$skipped"
    unset KARST_TEST_QUICK
fi

# ---- the other benchmarks ----
if [ "${KARST_GPU_BENCH:-yes}" != no ]; then
    bench_one karst "$first" "" $few --no-shadows
    bench_one hills "$first" -shadows $few
    bench_one hills "$first" -flight $few --no-shadows --path low-flight --frames 120
    light_mirror
    # Each pixel against the host's own arithmetic: it needs no test library.
    if [ "$(left)" -ge 8 ]; then
        say "a small picture against the host's reference"
        within "$(share 2 60)" "$karst" accuracy hills ${device:+--device "$device"} --size 80x60 --quick -q \
            > "$out/accuracy" 2> "$out/accuracy.log" && sed 's/^/reference: /' "$out/accuracy" > "$out/reference" ||
            lack "no comparison with the reference: $(tail -n 1 "$out/accuracy.log" | cut -c 1-200)"
    else
        lack "no time for a comparison with the reference"
    fi
    for size in $sizes; do
        [ "$size" = "$first" ] || bench_one hills "$size" "" $few --no-shadows
    done
    for size in $sizes; do
        [ "$size" = "$first" ] || bench_one karst "$size" "" $few --no-shadows
    done
    light_full
    light_glass
    # The other shape of the kernels, for scale.
    if [ $is_gpu = yes ]; then
        bench_one hills "$first" -lanes16 --runs 1 --rounds 5 --pool "$pool" --no-shadows --lanes 16
    else
        bench_one hills 320x180 -lanes1 --runs 1 --rounds 5 --pool "$pool" --no-shadows --lanes 1
    fi
fi
done=yes
