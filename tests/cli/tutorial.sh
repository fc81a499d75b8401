#!/bin/sh
# docs/TUTORIAL.md, followed as it is written: its texts make the file that it speaks of, and its commands work. Pictures
# are small here, and nothing is built or shown in a window. $KARST is the program.
set -u
. tests/tap.sh
karst=${KARST:-build/karst}
case $karst in /*) ;; *) karst="$PWD/$karst" ;; esac
page="$PWD/docs/TUTORIAL.md"
export KARST_DATA_DIR="$PWD/demos"
scratch=$(mktemp -d) || exit 1
trap 'rm -rf "$scratch"' EXIT
cd "$scratch" || exit 1
detail=
export POCL_CACHE_DIR="${POCL_CACHE_DIR:-$PWD/store}"

# The page's blocks, a file each, in their order.
awk '/^    / { if (!inside) num++; inside = 1; print substr($0, 5) > sprintf("block-%02d", num); next }
    /^$/ && inside { held = 1; next }
    { inside = 0 }' "$page"
# holding TEXT [N]: the block that holds it.
holding() { grep -lF -e "$1" block-* | sed -n "${2:-1}p"; }
# draws COMMAND: as the page has it, but small. The picture must show more than one colour.
draws()
{
    grep -qxF "    $1" "$page" || detail="the page has no line: $1"
    set -- $1
    shift
    for picture; do :; done
    detail="$detail$("$karst" "$@" -q --size 48x32 --pool 64 --samples 1 2>&1)"
    [ -s "$picture" ] && [ -z "$detail" ] && [ "$(wc -c < "$picture")" -gt 1000 ]
    result "$*"
}

draws "karst render hills -o hills.png"
cp "$(holding 'float height = 200.0')" first.karst
draws "karst render first.karst -o first.png"
detail=$("$karst" check first.karst 2>&1)
echo "$detail" | grep -q 'a proof for every box' && grep -qxF "    karst check first.karst" "$page"
result "karst check first.karst"
sed 's/fbm/fbmm/' first.karst > wrong.karst
detail=$("$karst" check wrong.karst 2>&1)
[ $? -ne 0 ] && echo "$detail" | grep -q "fbmm" && echo "$detail" | grep -q '^ *^$'
result "a mistake is shown with a caret"
cp "$(holding ridged)" first.karst && grep -q 'vec3 colour' first.karst
result "the second text has colours"
mv first.png before.png
draws "karst render first.karst -o first.png"
! cmp -s before.png first.png
result "the picture is another one"
{ cat "$(holding '"params"')"; sed 's/200\.0/relief/' first.karst; } > next.karst && mv next.karst first.karst
draws "karst render first.karst --param relief=400 -o high.png"
caves=$(holding 'float caves')
awk -v caves="$caves" '/return height - p.y;/ { while ((getline line < caves) > 0) print line; next } { print }' first.karst > next.karst
! cmp -s first.karst next.karst && mv next.karst first.karst
result "caves are put in"
draws "karst render first.karst -o caves.png"
draws "karst render first.karst --camera 1e12,300,-1e12,90,-10 -o far.png"
finish
