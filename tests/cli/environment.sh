#!/bin/sh
# The karst command on machines that are not as they should be: nowhere to write, damaged or full stores, closed
# descriptors, signals, small stacks, little memory. $KARST is the program. KARST_TEST_FULL=1 tries every kind of damage.
set -u
. tests/tap.sh
. tests/cli/calls.sh
mounted=
trap '[ -n "$mounted" ] && umount "$mounted"; rm -rf "$scratch"' EXIT

# A world whose kernels are compiled quickly, and a small picture of it.
echo 'float density(vec3 p) { return -p.y; }' > plain.karst
quick="render plain.karst --size 32x24 --pool 64 --no-shadows --display none --camera 0,5,0,0,-20"

# ---- a driver's store of Karst's own, beside its store of programs ----
unset POCL_CACHE_DIR
mkdir own && export KARST_CACHE_DIR="$PWD/own" TMPDIR="$PWD"
run $quick -o right.png
[ $status -eq 0 ] && [ -s right.png ] && [ -d own/driver/karst-1 ] && [ ! -e own/driver/karst-2 ] &&
    [ -n "$(find own/driver -name '*.so')" ] && [ -z "$(find own/driver -name '*karst-run*')" ]
result "kernels are kept beside the store; the marker is gone when the run is over"
cp -R own sound

# ---- damage: whatever the first run makes of it, the next one draws ----
# has_drawn NAME: two runs; the second draws, or the first did and so did the second.
has_drawn()
{
    rm -f first.png second.png
    run $quick -o first.png
    first="$status $(cat stderr)"
    run $quick -o second.png
    detail="$detail; first: $first"
    [ $status -eq 0 ] && cmp -s second.png right.png
    result "a damaged store, $1: the next run draws"
}
kernels() { find own/driver -name '*.so'; }
programs() { find own/driver -name 'program.bc'; }
damage()
{
    case $1 in
    "kernels cut short") for file in $(kernels); do head -c 2000 "$file" > cut && cp cut "$file"; done ;;
    "kernels empty") for file in $(kernels); do : > "$file"; done ;;
    "kernels of zeros") for file in $(kernels); do head -c "$(wc -c < "$file")" /dev/zero > cut && cp cut "$file"; done ;;
    "kernels without code") for file in $(kernels); do dd if=/dev/zero of="$file" bs=256 seek=8 count=8 conv=notrunc 2> /dev/null; done ;;
    "kernels that are text") for file in $(kernels); do echo "no kernel" > "$file"; done ;;
    "kernels that are folders") for file in $(kernels); do rm "$file" && mkdir "$file"; done ;;
    "kernels that lead nowhere") for file in $(kernels); do ln -sf /nonexistent/kernel "$file"; done ;;
    "one kernel for all") one=$(kernels | head -n 1) && cp "$one" cut && for file in $(kernels); do cp cut "$file"; done ;;
    "kernels missing") rm $(kernels) ;;
    "programs cut short") for file in $(programs); do head -c 1000 "$file" > cut && cp cut "$file"; done ;;
    "programs empty") for file in $(programs); do : > "$file"; done ;;
    "programs of noise") for file in $(programs); do head -c 3000 /dev/urandom > "$file"; done ;;
    "programs that are folders") for file in $(programs); do rm "$file" && mkdir "$file"; done ;;
    "one program for all") one=$(programs | head -n 1) && cp "$one" cut && for file in $(programs); do cp cut "$file"; done ;;
    "programs missing") rm $(programs) ;;
    "a file in the place of folders") for at in own/driver/karst-1/??; do rm -rf "$at" && : > "$at"; done ;;
    "a file in the place of the store") rm -rf own/driver && : > own/driver ;;
    "links in a circle") for at in own/driver/karst-1/??; do rm -rf "$at" && ln -s "${at##*/}" "$at"; done ;;
    "the last bytes missing") for file in $(kernels) $(programs); do truncate -s -40 "$file"; done ;;
    esac
}
kinds="kernels cut short:programs that are folders:a file in the place of folders:links in a circle"
[ -n "${KARST_TEST_FULL:-}" ] && kinds="$kinds:\
kernels empty:kernels of zeros:kernels without code:kernels that are text:kernels that lead nowhere:one kernel for all:kernels missing\
:programs cut short:programs empty:kernels that are folders:programs of noise:one program for all:programs missing:a file in the place of the store:the last bytes missing"
IFS_before=$IFS
IFS=:
for kind in $kinds; do
    IFS=$IFS_before
    rm -rf own && cp -R sound own
    damage "$kind"
    has_drawn "$kind"
    IFS=:
done
IFS=$IFS_before
rm -rf own && cp -R sound own

# ---- the marker ----
: > own/driver/karst-1/karst-run-1
run $quick -o second.png
[ $status -eq 0 ] && cmp -s second.png right.png && grep -q 'warning: .*/own/driver/karst-1, is set aside' stderr &&
    [ -n "$(find own/driver/karst-2 -name '*.so')" ] && [ ! -e own/driver/karst-1/karst-run-1 ]
result "a marker that a dead run left: the store is set aside, and that is said"
rm -rf own && cp -R sound own
"$karst" render hills --size 1280x720 --display none -o long.png > /dev/null 2> other &
other=$!
for i in 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20; do
    ls own/driver/karst-1/karst-run-* > /dev/null 2>&1 && break
    sleep 0.1
done
run $quick -o second.png
[ $status -eq 0 ] && [ ! -e own/driver/karst-2 ] && [ ! -s other ]
result "the marker of a run that lives is left alone"
kill -KILL $other
wait $other 2> /dev/null
run sample plain.karst --at 0,0,0
[ $status -eq 0 ] && [ ! -e own/driver/karst-2 ]
result "what needs no driver leaves its store alone"
# A store that others use as well is set aside without being moved; the one before the last is removed.
rm -rf own && cp -R sound own && mkdir own/driver/karst-3 own/driver/karst-4
: > own/driver/karst-4/karst-run-1
: > own/driver/karst-run-1
mkdir own/driver/karst-2
(exec 9> own/driver/karst-2/karst-run-2 && flock -x 9 && exec sleep 600) & # a run that lives
other=$!
until [ -e own/driver/karst-2/karst-run-2 ]; do sleep 0.1; done
POCL_CACHE_DIR="$PWD/own/driver" run $quick -o second.png
[ $status -eq 0 ] && cmp -s second.png right.png && [ -d own/driver/karst-5 ] && [ -d own/driver/karst-4 ] &&
    [ ! -e own/driver/karst-3 ] && [ ! -e own/driver/karst-1 ] && [ -d own/driver/karst-2 ]
result "of the folders that were set aside the last one stays, and the one that a living run uses"
kill $other
wait $other 2> /dev/null
rm -rf own && cp -R sound own

# ---- nowhere to write ----
# A user who owns nothing, as in a container; root may write everywhere.
chmod 755 "$scratch"
as_nobody=
[ "$(id -u)" = 0 ] && command -v setpriv > /dev/null && as_nobody="setpriv --reuid=65534 --regid=65534 --clear-groups"
if [ -n "$as_nobody" ] && $as_nobody test -x "$karst" && $as_nobody test -r "$scratch/plain.karst"; then
    mkdir anybody && chmod 1777 anybody
    env -u KARST_CACHE_DIR HOME=/nonexistent TMPDIR="$PWD/anybody" $as_nobody \
        "$karst" $quick -o anybody/a.png > stdout 2> stderr
    status=$? detail=$(cat stderr)
    [ $status -eq 0 ] && cmp -s anybody/a.png right.png && grep -q 'warning: .*KARST_CACHE_DIR' stderr &&
        [ -d anybody/karst-65534 ]
    result "HOME=/nonexistent: a private temporary store, and a word of it"
else
    skip "HOME=/nonexistent: a private temporary store" "needs root, setpriv and a program that all may run"
fi
# That one is made there the case above shows; here it has the kernels already.
mkdir elsewhere
[ -n "${KARST_TEST_FULL:-}" ] || { mkdir -m 700 "elsewhere/karst-$(id -u)" && cp -R own/driver "elsewhere/karst-$(id -u)/driver"; }
for place in /proc/nowhere /dev/null/x; do
    KARST_CACHE_DIR=$place TMPDIR="$PWD/elsewhere" run $quick -o second.png
    [ $status -eq 0 ] && cmp -s second.png right.png && grep -q "$place.*elsewhere/karst-" stderr
    result "KARST_CACHE_DIR=$place cannot be made: a temporary store, and a word of it"
    POCL_CACHE_DIR=$place TMPDIR="$PWD/elsewhere" run $quick -o second.png
    [ $status -eq 0 ] && cmp -s second.png right.png && grep -q "$place.*elsewhere/karst-" stderr
    result "nor can POCL_CACHE_DIR=$place"
done
# A full disk.
mkdir full
if mount -t tmpfs -o size=256k tmpfs full 2> /dev/null; then
    mounted="$scratch/full"
    head -c 1000000 /dev/zero > full/rest 2> /dev/null
    KARST_CACHE_DIR="$PWD/full" TMPDIR="$PWD/elsewhere" run $quick -o second.png
    [ $status -eq 0 ] && cmp -s second.png right.png && grep -q "full.*elsewhere/karst-" stderr
    result "a full disk: the store is elsewhere, and a word of it"
    KARST_CACHE_DIR="$PWD/own" run $quick -o full/out.png
    [ $status -eq 1 ] && grep -q 'cannot write full/out.png' stderr && [ ! -e full/out.png ]
    result "a picture for a full disk: told"
    umount full && mounted=
else
    skip "a full disk" "mounting one needs root"
fi

# ---- no device: why ----
export POCL_CACHE_DIR="$PWD/own/driver/karst-1"
mkdir vendors && echo libnosuchdriver.so.7 > vendors/broken.icd
OCL_ICD_VENDORS="$PWD/vendors" run $quick -o second.png
[ $status -eq 3 ] && grep -q 'libnosuchdriver.so.7 cannot be loaded' stderr
result "a driver that cannot be loaded: which, and why"
mkdir none && OCL_ICD_VENDORS="$PWD/none" run $quick -o second.png
[ $status -eq 3 ] && grep -q 'no driver is installed: install' stderr
result "no driver: what to install"
if [ "${CONFIG:-release}" = asan ]; then
    skip "few addresses" "the sanitizer itself takes more"
else
    (ulimit -v 90000 && "$karst" info > stdout 2> stderr)
    detail=$(cat stdout stderr)
    cat stdout stderr | grep -q 'cannot be loaded.*ulimit -v' && ! grep -q 'install pocl' stdout
    result "so few addresses that the driver does not load: that is said, nothing is to be installed"
    told=
    for limit in 100000 300000 500000 650000; do
        (ulimit -v $limit && "$karst" $quick -o second.png > stdout 2> stderr)
        status=$?
        { [ $status -eq 3 ] || [ $status -eq 1 ]; } && grep -q 'ulimit -v' stderr && ! grep -q 'install' stderr ||
            told="$told $limit: exit $status: $(cat stderr)"
    done
    detail=$told
    [ -z "$told" ]
    result "few addresses: render says what it takes, and how to raise the limit"
fi

# ---- descriptors that are closed ----
"$karst" $quick -q -o - > stdout 2> stderr <&-
status=$? detail=$(cat stderr)
[ $status -eq 0 ] && cmp -s stdout right.png
result "stdin is closed: the picture is right"
"$karst" $quick -q -o - >&- 2> stderr
status=$? detail="exit $status: $(cat stderr)"
[ $status -eq 1 ] && grep -q 'stdout is closed' stderr
result "a picture for a closed stdout is an error"
"$karst" $quick -q -o second.png >&- 2> stderr
status=$? detail="exit $status: $(cat stderr)"
[ $status -eq 0 ] && cmp -s second.png right.png
result "stdout is closed, and not asked for"
"$karst" $quick -o - 2>&- > stdout
status=$?
[ $status -eq 0 ] && cmp -s stdout right.png
result "stderr is closed: the picture is right"
"$karst" $quick -o second.png <&- >&- 2>&-
[ $? -eq 0 ] && cmp -s second.png right.png
result "all are closed"
told=
for words in "help" "help render" "check plain.karst" "sample plain.karst --at 0,0,0" "info" "--version" "$quick -o second.png --stats -"; do
    "$karst" $words >&- 2> stderr
    status=$?
    [ $status -eq 1 ] && grep -q 'stdout' stderr || told="$told $words: exit $status: $(cat stderr);"
done
detail=$told
[ -z "$told" ]
result "whatever is to be printed to a closed stdout: an error"

# ---- files that may not grow ----
said=$( (ulimit -f 0 && exec "$karst" $quick -o small.png 2>&1 > /dev/null))
status=$? detail="exit $status: $said"
[ $status -eq 1 ] && [ ! -e small.png ] && echo "$said" | grep -q '^karst: '
result "files may not grow (ulimit -f): told"

# ---- small stacks ----
for kib in 128 256 1024; do
    rm -f second.png
    (ulimit -s $kib && "$karst" $quick -o second.png > /dev/null 2> stderr)
    status=$? detail="exit $status: $(cat stderr)"
    [ $status -eq 0 ] && cmp -s second.png right.png
    result "a stack of $kib KiB"
done
mkdir cold
(ulimit -s 256 && POCL_CACHE_DIR="$PWD/cold" KARST_CACHE_DIR=off "$karst" $quick -o second.png > /dev/null 2> stderr)
status=$? detail="exit $status: $(cat stderr)"
[ $status -eq 0 ] && cmp -s second.png right.png
result "a small stack, and kernels to be compiled"

# ---- signals ----
# ends SIGNAL NUMBER COMMAND...: whether it ends by that signal, says one line, and leaves nothing.
ends()
{
    signal=$1 number=$2
    shift 2
    rm -rf left && mkdir left
    (cd left && exec "$karst" "$@" > ../stdout 2> ../stderr) &
    until_caught $!
    sleep 0.5
    kill -$signal $!
    begun=$(date +%s%N)
    wait $! 2> /dev/null
    status=$?
    took_ms=$((($(date +%s%N) - begun) / 1000000))
    detail="exit $status after $took_ms ms: $(cat stderr), left '$(ls left)'"
    [ $status -eq $((128 + number)) ] && grep -q '^karst: interrupted' stderr && [ -z "$(ls left)" ]
}
for pair in "INT 2" "TERM 15" "HUP 1"; do
    ends $pair render hills -o a.png --size 1280x720 --display none
    result "SIG${pair% *} ends the program by itself, after cleaning up"
done
cat > fake_ffmpeg << 'EOS'
#!/bin/sh
for last; do :; done
cat > "$last"
EOS
chmod +x fake_ffmpeg && mkdir fake && mv fake_ffmpeg fake/ffmpeg
for pair in "INT 2" "HUP 1"; do
    PATH="$PWD/fake:$PATH" ends $pair render hills --path low-flight --display none -o a.mp4 --size 160x120 --pool 64 --no-shadows
    result "no part of a video is left by SIG${pair% *}"
done
# In a store of its own: a helper of the runs that were ended may still be at theirs.
cp -R sound/driver/karst-1 ignores
(trap "" HUP; export POCL_CACHE_DIR="$PWD/ignores"; exec "$karst" $quick --size 1280x960 -o second.png 2> stderr > /dev/null) &
until_caught $!
kill -HUP $!
wait $!
status=$? detail="exit $status: $(cat stderr)"
[ $status -eq 0 ]
result "who ignores SIGHUP (nohup) goes on"
# On a busy machine a second may be longer: one of some tries must do. What a sanitizer makes of it says nothing.
most_ms=1500
[ -n "${KARST_TEST_QUICK:-}" ] && most_ms=60000
for try in 1 2 3 4 5 6; do
    rm -rf cold2 && mkdir cold2
    POCL_CACHE_DIR="$PWD/cold2" ends INT 2 render hills -o a.png --size 320x240 --display none
    [ $status -eq 130 ] && [ $took_ms -lt $most_ms ] && break
done
[ $status -eq 130 ] && [ $took_ms -lt $most_ms ]
result "Ctrl-C while kernels are compiled: at most a second"
finish
