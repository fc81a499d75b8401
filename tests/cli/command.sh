#!/bin/sh
# What the karst command takes and gives beside pictures: a world from stdin, JSON, long names, kinds of videos, variables
# that mean nothing. $KARST is the program.
set -u
. tests/tap.sh
# Variables that tests and the program ask for, by their sources.
sources=$(grep -rhoE '(getenv|is_set|piece)\("KARST_[A-Z_]+"' core demos producers raycast cache tests |
    sed 's/.*"\(.*\)"/\1/' | sort -u | grep -v HELPER)
. tests/cli/calls.sh
mkdir temporary && export TMPDIR="$scratch/temporary"
echo 'float density(vec3 p) { return -p.y; }' > plain.karst
quick="--size 32x24 --pool 64 --no-shadows --display none --camera 0,5,0,0,-20"

# ---- names of the command's own ----
run --version
cp stdout version
for word in -V version; do
    run $word
    [ $status -eq 0 ] && cmp -s stdout version
    result "$word is --version"
done

# ---- a world from stdin ----
run render plain.karst $quick -o right.png
input=plain.karst
run render - $quick -o second.png
[ $status -eq 0 ] && cmp -s second.png right.png && [ -z "$(ls temporary)" ]
result "render - reads a world from stdin, and leaves no file"
run sample - --at 0,-3,0 --json
[ $status -eq 0 ] && grep -q '"density":3' stdout
result "so does sample"
run check -
[ $status -eq 0 ] && ! grep -q "$TMPDIR" stdout && [ -z "$(ls temporary)" ]
result "so does check, without naming a file that nobody knows"
echo 'float density(vec3 p) { return p.y + ; }' > broken.karst
input=broken.karst
run render - $quick -o second.png
[ $status -eq 4 ] && grep -q '^stdin:1:' stderr && ! grep -q "$TMPDIR" stderr && [ -z "$(ls temporary)" ]
result "mistakes in it are stdin's"
: > empty.karst
input=empty.karst
run render - $quick -o second.png
[ $status -eq 4 ]
result "an empty stdin is no world"
head -c 30000000 /dev/zero > huge.karst
input=huge.karst
run check -
[ $status -eq 4 ] && grep -q 'cannot read a world from stdin' stderr && [ -z "$(ls temporary)" ]
result "nor is one without an end"
input=
(exec "$karst" render - $quick -o second.png <&- > stdout 2> stderr)
status=$? detail="exit $status: $(cat stderr)"
[ $status -eq 2 ] && grep -q 'stdin is closed' stderr
result "a closed stdin is wrong usage"

# ---- JSON ----
run info --json
[ $status -eq 0 ] && grep -q '^  "devices": \[' stdout && grep -q '"largest_buffer_bytes": [1-9]' stdout &&
    grep -q '"works": true' stdout && grep -q '^  "version": "' stdout
result "info --json: devices, displays, version"
OCL_ICD_VENDORS=/nonexistent run info --json
[ $status -eq 0 ] && grep -q '"devices_error": ".*pocl-opencl-icd' stdout
result "info --json without a device says what to do"
run check hills --json
[ $status -eq 0 ] && grep -q '^  "compiles": true' stdout && grep -q '^  "parameters": \[' stdout &&
    grep -q '^  "report": \[' stdout && grep -q '^  "device_takes_it": true' stdout
result "check --json: what it says of a world"
run check broken.karst --json
[ $status -eq 4 ] && grep -q '^  "compiles": false' stdout && grep -q '"line": 1,' stdout &&
    grep -q '"kind": "error"' stdout && grep -q '"file": "broken.karst"' stdout
result "check --json: where a mistake is"

# ---- parameters that are not there ----
run render karst --param foo=1 $quick -o second.png
[ $status -eq 4 ] && grep -q 'towers, caves' stderr
result "an unknown parameter: those that there are"

# ---- variables without a meaning ----
for pair in "KARST_VECTORS=avx3|avx2 or plain" "KARST_CACHEDIR=/tmp|did you mean KARST_CACHE_DIR" \
    "KARST_FOO=1|KARST_FOO means nothing" "KARST_LANES=x|KARST_LANES means nothing" "KARST_VIEW_FOO=1|KARST_VIEW_FOO means" \
    "KARST_HELPER=1|KARST_HELPER means nothing" \
    "KARST_TEST_FULL=yes|may be 1" "KARST_TEST_STEP=x|a whole number" "KARST_KERNEL_DIR=/nonexistent|no folder" "KARST_DATA_DIR=/nonexistent|no folder"; do
    (export "${pair%%|*}"; exec "$karst" check -q plain.karst) > stdout 2> stderr
    status=$? detail="exit $status: $(cat stderr)"
    [ $status -eq 0 ] && grep -q "warning: .*${pair#*|}" stderr
    result "${pair%%|*} is told to mean nothing"
done
(export KARST_TEST_QUICK=1 KARST=x KARST_VECTORS=plain KARST_VIEW_FPS=60 KARST_TEST_STEP=24; exec "$karst" sample plain.karst --at 0,0,0) > stdout 2> stderr
detail=$(cat stderr)
[ ! -s stderr ]
result "other variables are left alone"
(for name in $sources; do export "$name=1"; done; exec "$karst" sample plain.karst --at 0,0,0) > stdout 2> stderr
detail=$(grep 'the variable' stderr)
[ "$(echo "$sources" | wc -l)" -gt 10 ] && [ -z "$detail" ]
result "all variables that sources read are known"

# ---- names as long as the system allows ----
longest=$(printf 'n%.0s' $(seq 251))
for suffix in png exr; do
    run render plain.karst $quick -q -o "$longest.$suffix" --stats "$longest.json2"
    [ "$status" -eq 1 ] && grep -q 'File name too long' stderr
    result "a name that is a letter too long for the system: told (.$suffix)"
    run render plain.karst $quick -q -o "$longest.$suffix" --stats "${longest%?}.json"
    [ $status -eq 0 ] && [ -s "$longest.$suffix" ] && [ -s "${longest%?}.json" ]
    result "a picture and statistics with names as long as the system allows (.$suffix)"
done

# ---- kinds of videos ----
cat > turn.json << 'EOS'
{ "keyframes": [ { "time": 0, "position": ["0", "5", "0"], "yaw": 0, "pitch": -20, "fov": 60 },
    { "time": 1, "position": ["1", "5", "0"], "yaw": 5, "pitch": -20, "fov": 60 } ] }
EOS
mkdir fake && cat > fake/ffmpeg << 'EOS'
#!/bin/sh
for last; do :; done
echo "$@" > "$FAKE/arguments"
cat > "$last"
EOS
chmod +x fake/ffmpeg && export FAKE="$scratch"
fly="render plain.karst --path turn.json --frames 3 -q --size 32x24 --pool 64 --no-shadows --display none"
for pair in "mp4 libx264" "webm libvpx-vp9" "gif paletteuse" "MKV libx264"; do
    PATH="$PWD/fake:$PATH" run $fly -o "film.${pair% *}"
    detail="$detail $(cat arguments)"
    [ $status -eq 0 ] && [ "$(wc -c < "film.${pair% *}")" -eq $((3 * 32 * 24 * 3)) ] &&
        grep -q "${pair#* }" arguments && grep -qi "\.${pair% *}\$" arguments
    result "a video that ends in .${pair% *}"
done
name=$(printf 'v%.0s' $(seq 251))
PATH="$PWD/fake:$PATH" run $fly -o "$name.mp4"
[ $status -eq 0 ] && [ -s "$name.mp4" ]
result "a video with a name as long as the system allows"
PATH="$PWD/fake:$PATH" run $fly -o film.webm --size 33x24
[ $status -eq 2 ] && PATH="$PWD/fake:$PATH" run $fly -o odd.gif --size 33x25 && [ $status -eq 0 ]
result "sides must be even where the format says so, and only there"
run render plain.karst $quick -o a.webm
[ $status -eq 2 ] && grep -q 'needs a --path' stderr
result "a video without a path"

# ---- pictures that are too large ----
run render plain.karst --path turn.json --frames 1 --pool 64 --display none --size 16384x16384 -o large.png
size=$(sed -n 's/.* --size \([0-9]*x[0-9]*\).*/\1/p' stderr)
[ $status -eq 1 ] && grep -q '16384x16384 takes [0-9.]* GiB' stderr && [ -n "$size" ] && ! grep -q 'smaller --pool' stderr
result "a picture that finds no room: what it takes, and a size that fits"
finish
