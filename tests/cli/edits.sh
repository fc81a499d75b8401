#!/bin/sh
# karst ... --edits FILE from outside: what a file may hold, and what is said of one that is wrong.
set -u
. tests/tap.sh
. tests/cli/calls.sh

cat > flat.karst << 'END'
/*{ "voxel": 0.125, "camera": { "position": ["0", "6", "-10"], "yaw": 0, "pitch": -20 } }*/
float density(vec3 p) { return -p.y; }
END
cat > good.json << 'END'
{ "description": "one of each", "edits": [
  { "shape": "sphere", "mode": "remove", "at": ["1000000000000010", "0", "0"], "radius": 5 },
  { "shape": "box", "mode": "add", "at": [0, 1.5, 8], "half": [1, 1, 1], "blend": 0.5 },
  { "shape": "capsule", "mode": "add", "at": [3, 1, 8], "to": ["3", "4", "8"], "radius": 0.5 },
  { "shape": "noise", "mode": "add", "at": [-3, 0, 8], "radius": 1.5, "amplitude": 0.5, "scale": 1, "seed": 4 },
  { "shape": "sphere", "mode": "flatten", "at": [0, -1, 4], "radius": 3, "normal": [0, 1, 0.2] } ] }
END

# density X,Y,Z: what sample says of a point with good.json.
density() { "$karst" sample flat.karst --edits good.json --at "$1" 2> stderr | sed -n 's/^density *\([^ ]*\).*/\1/p'; }
[ "$(density 0,2,8)" = 0.5 ]
result "sample: a box that was added"
[ "$(density 1000000000000010,-1,0)" = -4 ] && [ "$(density 10,-1,0)" = 1 ]
result "sample: a sphere that was dug at 10^15 m, and not at the origin"
case $(density 0,-0.5,4) in -0.49*) true ;; *) false ;; esac
result "sample: flattened, so air above the plane"

"$karst" render flat.karst --edits good.json -q --size 64x48 --display none -o edited.png 2> stderr &&
    "$karst" render flat.karst -q --size 64x48 --display none -o plain.png 2>> stderr && ! cmp -s edited.png plain.png
detail=$(cat stderr) result "render: edits are in the picture"
[ ! -s stderr ]
detail=$(cat stderr) result "render: edits compile without a word"

# refused PATTERN NAME: bad.json makes render and sample say so, with exit code 5, and nothing is written.
refused()
{
    rm -f out.png
    "$karst" render flat.karst --edits bad.json -q --size 64x48 --display none -o out.png 2> stderr
    of_render=$?
    "$karst" sample flat.karst --edits bad.json --at 0,0,0 > stdout 2>> stderr
    of_sample=$?
    detail="render: $of_render, sample: $of_sample; $(head -c 500 stderr)"
    [ $of_render -eq 5 ] && [ $of_sample -eq 5 ] && [ ! -e out.png ] && [ ! -s stdout ] &&
        [ "$(grep -cE -e "bad.json.*($1)" stderr)" = 2 ]
    result "$2"
}
# edit FIELDS: bad.json has a good edit and this one.
edit() { echo "{ \"edits\": [ { \"shape\": \"box\", \"mode\": \"add\", \"at\": [0,0,0], \"half\": [1,1,1] }, { $1 } ] }" > bad.json; }
sphere='"shape": "sphere", "mode": "add"'

rm -f bad.json; refused 'No such file|cannot' "no file"
echo '{ "edits": [ { "shape": ' > bad.json; refused ':[0-9]+:[0-9]+: ' "a file that ends too soon: line and column"
echo '[]' > bad.json; refused 'list "edits"' "no list of edits"
echo '{ "edits": [], "more": 1 }' > bad.json; refused 'more' "an unknown field at the top"
edit "\"shape\": \"cube\", \"mode\": \"add\""; refused 'edit 2, shape: .*cube.*sphere, box' "an unknown shape: there are these"
edit "\"shape\": \"sphere\", \"mode\": \"dig\""; refused 'edit 2, mode: .*dig.*remove' "an unknown mode"
edit "$sphere, \"radius\": 1"; refused 'edit 2, at: is missing' "no place"
edit "$sphere, \"at\": [0, 0], \"radius\": 1"; refused 'edit 2, at: ' "two coordinates"
edit "$sphere, \"at\": [0, \"1x\", 0], \"radius\": 1"; refused 'edit 2, at: y: ' "no decimal"
edit "$sphere, \"at\": [\"1e30\", 0, 0], \"radius\": 1"; refused 'edit 2.*(edge|beyond|outside)' "beyond the world's edge"
edit "$sphere, \"at\": [\"4e17\", 0, 0], \"radius\": 1"; refused 'edit 2: .*2\^61' "beyond 2^61 voxels"
edit "$sphere, \"at\": [0, 0, 0]"; refused 'edit 2, radius: is missing' "no radius"
edit "$sphere, \"at\": [0, 0, 0], \"radius\": -1"; refused 'edit 2: the radius' "a radius below 0"
edit "$sphere, \"at\": [0, 0, 0], \"radius\": 1e400"; refused "overflow" "a number that is none"
edit "$sphere, \"at\": [0, 0, 0], \"radius\": NaN"; refused ':1:[0-9]+: ' "NaN"
edit "$sphere, \"at\": [0, 0, 0], \"radius\": 1, \"half\": [1, 1, 1]"; refused 'edit 2, .*half.*no such field' "a box's field"
edit "\"shape\": \"plane\", \"mode\": \"flatten\", \"at\": [0, 0, 0]"; refused 'edit 2: flatten takes' "a plane cannot flatten"
edit "\"shape\": \"sphere\", \"mode\": \"paint\", \"at\": [0, 0, 0], \"radius\": 1"; refused 'edit 2, colour: is missing' "paint without a colour"
edit "$sphere, \"at\": [0, 0, 0], \"radius\": 1, \"colour\": [0, 1]"; refused 'edit 2, colour: .*three numbers' "a colour of two numbers"
edit "$sphere, \"at\": [0, 0, 0], \"radius\": 1, \"colour\": [0, 2, 0]"; refused 'edit 2: the colour' "a colour above 1"
edit "\"shape\": \"sphere\", \"mode\": \"remove\", \"at\": [0, 0, 0], \"radius\": 1, \"colour\": [0, 1, 0]"; refused 'edit 2, .*colour.*no such field' "a hole has no colour"
truncate -s 300M bad.json; refused '268435456 at most' "a file of 300 MB"

"$karst" render flat.karst --edits good.json --refine -q --size 64x48 --display none -o refined.png 2> stderr &&
    [ ! -s stderr ] && ! cmp -s refined.png plain.png
detail=$(cat stderr) result "render: hits are refined on edited land"
finish
