#!/bin/sh
# karst new, karst edit, and saved worlds wherever a world is taken.
set -u
. tests/tap.sh
. tests/cli/calls.sh

cat > flat.karst << 'END'
/*{ "voxel": 0.125, "seed": 1, "camera": { "position": ["0", "6", "-10"], "yaw": 0, "pitch": -20 },
    "params": { "height": { "value": 0, "min": -10, "max": 10 } } }*/
float density(vec3 p) { return height - p.y; }
END
cat > edits.json << 'END'
{ "description": "one of each", "edits": [
  { "shape": "sphere", "mode": "remove", "at": ["1000000000000010", "0", "0"], "radius": 5 },
  { "shape": "box", "mode": "add", "at": [0, 1.5, 8], "half": [1, 1, 1], "blend": 0.5 },
  { "shape": "capsule", "mode": "add", "at": [3, 1, 8], "to": ["3", "4", "8"], "radius": 0.5 },
  { "shape": "noise", "mode": "add", "at": [-3, 0, 8], "radius": 1.5, "amplitude": 0.5, "scale": 1, "seed": 4 },
  { "shape": "plane", "mode": "add", "at": ["0", "-30", "0"], "normal": [0.1, 1, 0] },
  { "shape": "sphere", "mode": "flatten", "at": [0, -1, 4], "radius": 3, "normal": [0, 1, 0.2] } ] }
END

# exits CODE NAME: the last command did so, and its message is shown if not.
exits()
{
    code=$?
    detail="exit code $code, not $1: $(head -c 600 stderr)"
    [ $code -eq "$1" ]
    result "$2"
}

# ---- made, edited ----
"$karst" new world.karstdb --from flat.karst --param height=0.5 --seed 7 --camera 0,6,-11,0,-20,60 2> stderr
exits 0 "new: a file"
"$karst" edit world.karstdb --add sphere,1000000000000010,0,0,5,remove --add box,0,1.5,8,1,1,1,blend=0.5 \
    --add capsule,3,1,8,3,4,8,0.5 --add noise,-3,0,8,1.5,0.5,1,seed=4 --add plane,0,-30,0,normal=0.1:1:0 \
    --add sphere,0,-1,4,3,flatten,normal=0:1:0.2 2> stderr
exits 0 "edit: all shapes and modes"
cp world.karstdb painted.karstdb
"$karst" edit painted.karstdb --paint sphere,0,0,8,3,colour=0.7:0.1:0.05,blend=0.5 --add box,2,0,8,1,1,1,colour=0:0:1 2> stderr
exits 0 "edit: colours"
"$karst" edit painted.karstdb --export text 2> stderr | grep -q '"mode": "paint".*"colour": \[0.7, 0.1, 0.05\], "strength": 1'
detail=$(cat stderr) result "and they are in the export"
for edit in sphere,0,0,0,1 sphere,0,0,0,1,remove sphere,0,0,0,1,colour=1:2:3 sphere,0,0,0,1,colour=1:0; do
    "$karst" edit painted.karstdb --paint "$edit" 2> stderr
    exits 2 "edit --paint '$edit': refused"
done
# ---- smoothed ----
cp world.karstdb smoothed.karstdb
"$karst" edit smoothed.karstdb --add sphere,0,0,8,3,smooth,strength=0.4,normal=0:1:0.25 2> stderr
exits 0 "edit: smooth"
"$karst" edit smoothed.karstdb --export text -o smoothed.json 2> stderr &&
    grep -q '"mode": "smooth".*"radius": 3, "normal": \[0, 1, 0.25\], "strength": 0.4' smoothed.json &&
    "$karst" new again.karstdb --from flat.karst --edits smoothed.json 2>> stderr &&
    "$karst" edit smoothed.karstdb --log > log 2>> stderr && "$karst" edit again.karstdb --log > other.log 2>> stderr &&
    cmp log other.log > /dev/null
detail=$(cat stderr smoothed.json) result "which an export has, and the way back"
for edit in box,0,0,0,1,1,1,smooth sphere,0,0,0,1,smooth,blend=1 sphere,0,0,0,1,smooth,strength=0 sphere,0,0,0,1,add,normal=0:1:0; do
    "$karst" edit smoothed.karstdb --add "$edit" 2> stderr
    exits 2 "edit --add '$edit': refused"
done
rm painted.karstdb smoothed.karstdb again.karstdb smoothed.json
[ "$(find . -name 'world*' -o -name '.karst*')" = ./world.karstdb ]
result "nothing lies beside the file afterwards"
"$karst" new other.karstdb --from flat.karst --param height=0.5 --seed 7 --camera 0,6,-11,0,-20,60 --edits edits.json 2> stderr &&
    "$karst" edit world.karstdb --log > log 2> stderr && "$karst" edit other.karstdb --log > other.log 2>> stderr &&
    [ "$(wc -l < log)" = 6 ] && cmp log other.log > /dev/null
detail=$(cat stderr log) result "edits as text and edits of a file are the same"
"$karst" edit world.karstdb --export text -o text.json 2> stderr &&
    "$karst" new third.karstdb --from flat.karst --edits text.json 2> stderr &&
    "$karst" edit third.karstdb --log > other.log 2>> stderr && cmp log other.log > /dev/null
detail=$(cat stderr text.json) result "exported edits are the same once more"

# ---- taken ----
options="-q --size 64x48 --display none --samples 1"
# shellcheck disable=SC2086
{
    "$karst" render world.karstdb $options -o saved.png 2> stderr &&
        "$karst" render flat.karst --param height=0.5 --seed 7 --camera 0,6,-11,0,-20,60 --edits edits.json $options \
            -o given.png 2>> stderr && cmp saved.png given.png >> stderr
}
detail=$(cat stderr) result "render: byte for byte that of the same world, seed, parameters, camera and edits"
# shellcheck disable=SC2086
"$karst" render flat.karst $options -o plain.png 2> stderr && ! cmp -s saved.png plain.png
detail=$(cat stderr) result "render: which is another picture than the world's alone"
box="--box -4,-4,-4,12,8,16 --voxel 0.5 -q"
# shellcheck disable=SC2086
{
    "$karst" mesh world.karstdb $box -o saved.ply 2> stderr &&
        "$karst" mesh flat.karst --param height=0.5 --seed 7 --edits edits.json $box -o given.ply 2>> stderr &&
        "$karst" mesh flat.karst --param height=0.5 $box -o plain.ply 2>> stderr && grep -av '^comment' saved.ply > saved.txt && grep -av '^comment' given.ply | cmp - saved.txt >> stderr &&
        ! cmp -s saved.ply plain.ply
}
detail=$(cat stderr) result "mesh: byte for byte that of the same world, parameters and edits"
density() { "$karst" sample "$@" 2> stderr | sed -n 's/^density *\([^ ]*\).*/\1/p'; }
[ "$(density world.karstdb --at 40,-1,40)" = 1.5 ] && [ "$(density world.karstdb --param height=2 --at 40,-1,40)" = 3 ] &&
    [ "$(density world.karstdb --at 0,2,8)" = 0.5 ] && [ "$(density world.karstdb --at 1000000000000010,-1,0)" = -4 ]
detail=$(cat stderr) result "sample: its parameters, unless others are given, and its edits"
"$karst" check world.karstdb 2> stderr > stdout && grep -q 'height = 0.5' stdout
detail=$(cat stderr stdout) result "check: its parameters"
"$karst" info world.karstdb 2> stderr > stdout && grep -q '6 edits' stdout && grep -q 'height = 0.5' stdout &&
    "$karst" info world.karstdb --json | grep -q '"edits": 6'
detail=$(cat stderr stdout) result "info: what is in it"
"$karst" render world.karstdb --edits edits.json -q --display none -o out.png 2> stderr
exits 2 "--edits beside a saved world: refused"
mkdir moved && mv world.karstdb flat.karst moved/ && [ "$(density moved/world.karstdb --at 40,-1,40)" = 1.5 ]
detail=$(cat stderr) result "a world file beside is found where both were moved"
mv moved/* . && rm moved/* 2> /dev/null
"$karst" new inside.karstdb --from flat.karst --embed 2> stderr && mv flat.karst away.karst &&
    [ "$(density inside.karstdb --at 40,-1,40)" = 1 ]
detail=$(cat stderr) result "--embed: the world file may go"
"$karst" sample world.karstdb --at 0,0,0 2> stderr > /dev/null
exits 4 "without it that is told"
mv away.karst flat.karst
"$karst" new - --from - < flat.karst 2> stderr
exits 2 "new: a name that is none of a saved world"
"$karst" new stdin.karstdb --from - < flat.karst 2> stderr && [ "$(density stdin.karstdb --at 40,-1,40)" = 1 ]
detail=$(cat stderr) result "new --from -: the text is inside"

# ---- back and forth ----
count() { "$karst" edit world.karstdb --json "$@" 2> stderr | tr -d ' \n' | grep -o '"edits":[0-9]*,"redoable":[0-9]*'; }
[ "$(count --undo)" = '"edits":5,"redoable":1' ] && [ "$(count --undo 2)" = '"edits":3,"redoable":3' ] &&
    [ "$(count --redo)" = '"edits":4,"redoable":2' ] && [ "$(count --redo=9)" = '"edits":6,"redoable":0' ] &&
    [ "$(count --undo --add sphere,0,0,0,1)" = '"edits":6,"redoable":0' ]
detail=$(cat stderr) result "undo and redo, with a number and without"
"$karst" edit world.karstdb --undo 3 --compact --check > stdout 2> stderr && [ "$(count)" = '"edits":3,"redoable":0' ] &&
    grep -q 'no damage' stdout
detail=$(cat stderr stdout) result "compact: what was undone is gone"
"$karst" edit world.karstdb --backup copy.karstdb 2> stderr && "$karst" edit world.karstdb --log > log 2> /dev/null &&
    "$karst" edit copy.karstdb --log 2> /dev/null | cmp - log
detail=$(cat stderr) result "backup"

# ---- full, and in use ----
"$karst" new full.karstdb --from flat.karst --edits edits.json 2> stderr && cp full.karstdb same.karstdb &&
    awk 'BEGIN { printf "{ \"edits\": ["; for (i = 0; i < 5000; i++) printf "%s{ \"shape\": \"sphere\", \"mode\": \"add\", \"at\": [%d, 0, 0], \"radius\": 1 }\n", i ? "," : "", i; print "] }" }' \
        > many.json
(ulimit -f 200 && "$karst" edit full.karstdb --from many.json) 2> stderr
exits 1 "a file that may grow no further: told"
grep -qi 'too large\|full' stderr && "$karst" edit full.karstdb --check --json 2> stderr | tr -d ' \n' | grep -q '"damage":\[\].*"edits":6,'
detail=$(cat stderr) result "and nothing of before is lost"
"$karst" edit full.karstdb --from many.json 2> stderr && "$karst" edit full.karstdb --json 2>> stderr | grep -q '"edits": 5006'
detail=$(cat stderr) result "with room it can be written again"
"$karst" edit world.karstdb --log > log 2> /dev/null
mkfifo pipe
# It holds the file while it waits for its file of edits.
"$karst" edit world.karstdb --from pipe 2> /dev/null &
holder=$!
i=0
while [ $i -lt 100 ] && [ ! -e world.karstdb-wal ]; do sleep 0.05; i=$((i + 1)); done
"$karst" edit world.karstdb --add sphere,0,0,0,1 2> stderr
exits 1 "a second writer is refused"
grep -q 'another process' stderr && "$karst" edit world.karstdb --log 2> stderr | cmp - log && [ "$(density world.karstdb --at 0,2,8)" = 0.5 ] &&
    "$karst" edit world.karstdb --backup held.karstdb 2> stderr && "$karst" edit held.karstdb --log 2> /dev/null | cmp - log
detail=$(cat stderr) result "meanwhile others read and copy"
printf '{ "edits": [ ] }' > pipe
wait $holder

# ---- damaged ----
# The last row of the log stands first in its page: a byte of it is another one.
cp world.karstdb damaged.karstdb && size=$(wc -c < damaged.karstdb) && at=$((size - 20)) &&
    printf '\377' | dd of=damaged.karstdb bs=1 seek=$at conv=notrunc 2> /dev/null
"$karst" edit damaged.karstdb --check > stdout 2> stderr
exits 5 "check: a damaged edit"
grep -q 'edit 1 is lost' stdout
detail=$(cat stdout) result "and which it is"
# shellcheck disable=SC2086
"$karst" render damaged.karstdb $options -o damaged.png 2> stderr && grep -q 'warning: damaged.karstdb: edit 1 is lost' stderr
detail=$(cat stderr) result "render: the rest is drawn, with a warning"
printf 'xxxx' | dd of=damaged.karstdb bs=1 seek=0 conv=notrunc 2> /dev/null
"$karst" edit damaged.karstdb --log 2> stderr
exits 5 "a damaged first page"
"$karst" edit damaged.karstdb --recover rest.karstdb 2> stderr && "$karst" edit rest.karstdb --log > log 2>> stderr &&
    [ "$(wc -l < log)" = 2 ] && grep -q 'edit 1 is lost' stderr && [ "$(density rest.karstdb --at 40,-1,40)" = 1.5 ]
detail=$(cat stderr log) result "recover: the rest, and what is lost"

# ---- refused ----
"$karst" new world.karstdb --from flat.karst 2> stderr
exits 1 "new: never over a file that is there"
"$karst" new x.karstdb --from nowhere 2> stderr
exits 4 "new: no such world"
"$karst" new x.karstdb --from flat.karst --camera 1,2 2> stderr
exits 2 "new: a camera that is none"
printf '{ "edits": [ 1 ] }' > bad.json
"$karst" new x.karstdb --from flat.karst --edits bad.json 2> stderr
exits 5 "new: edits that are none"
[ ! -e x.karstdb ]
result "new: then there is no file"
"$karst" edit nowhere.karstdb --log 2> stderr
exits 5 "edit: no such file"
cp world.karstdb same.karstdb
for edit in sphere,0,0,0,0 sphere,0,0,0 sphere,0,0,x,1 box,0,0,0,1,1 cube,0,0,0,1 sphere,0,0,0,1,carve plane,0,0,0,flatten \
    sphere,0,0,0,1,normal=0:1:0 plane,0,0,0,normal=0:1 noise,0,0,0,1,2,1 noise,0,0,0,1,0,1,seed=-1 ''; do
    "$karst" edit world.karstdb --add sphere,0,0,0,1 --add "$edit" 2> stderr
    exits 2 "edit --add '$edit': refused"
    grep -q -e "--add $edit: " stderr
    detail=$(cat stderr) result "and which it was is said"
done
cmp world.karstdb same.karstdb
result "and not a byte has changed"
"$karst" edit flat.karst --log 2> stderr
exits 5 "edit: a file of something else"
"$karst" edit world.karstdb --undo --redo 2> stderr
exits 2 "edit: undo and redo at once"
"$karst" accuracy world.karstdb 2> stderr
exits 2 "accuracy takes no saved world"
rm -f "$scratch"/*.png
finish
