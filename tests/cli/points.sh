#!/bin/sh
# karst import, karst info and worlds with models from outside: what is shown, and what is said of what is wrong.
set -u
. tests/tap.sh
karst=${KARST:-build/karst}
case $karst in /*) ;; *) karst="$PWD/$karst" ;; esac
data="$PWD/../shared/data"
flatten="$PWD/tests/cli/flatten.awk"
export KARST_DATA_DIR="$PWD/demos"
scratch=$(mktemp -d) || exit 1
trap 'rm -rf "$scratch"' EXIT
cd "$scratch" || exit 1

# A ball of a metre, by the golden angle; the first line is doubled, and one place is no number.
awk 'BEGIN { print "nan 0 0"; for (i = 0; i < 5000; i++) { z = 1 - (2 * i + 1) / 5000; r = sqrt(1 - z * z); a = i * 2.399963
    printf "%.9f %.9f %.9f\n", r * cos(a), r * sin(a), z; if (i == 0) printf "%.9f %.9f %.9f\n", r * cos(a), r * sin(a), z } }' > ball.xyz

"$karst" import ball.xyz -o ball.karstpoints 2> stderr && grep -q '^ball.karstpoints: 5000 points' stderr &&
    grep -q 'left out: 1 points whose places' stderr && grep -q 'left out: 1 points at a place' stderr
detail=$(cat stderr) result "import: points, and what is left out"
"$karst" info ball.karstpoints > info && grep -q '^points *5000, some 0.05' info && grep -q '^parts *1;' info
detail=$(cat info) result "info: what a model holds"
"$karst" import ball.xyz -o again.karstpoints -q --json > json 2> stderr && [ ! -s stderr ] && grep -q '"points":5000\|"points": 5000' json &&
    cmp ball.karstpoints again.karstpoints
detail=$(cat stderr json) result "import: the same bytes, and JSON"

# ---- worlds ----
mkdir -p sub
mv ball.karstpoints sub/
cat > sub/air.karst << 'END'
/*{ "voxel": 0.03125, "camera": { "position": ["0", "0", "-4"] },
    "models": [{ "points": "ball.karstpoints", "at": [0, 0, 0] }] }*/
float density(vec3 p) { return -1.0; }
END
sed 's/"at": .0, 0, 0./"at": ["1000000000000", "0", "0"]/; s/"0", "0", "-4"/"1000000000000", "0", "-4"/' sub/air.karst > sub/far.karst
sed 's/, *$/,/; s/"models".*\]/"exposure": 0/' sub/air.karst > sub/none.karst
render() { "$karst" render "$1" -q --size 64x48 --pool 64 --display none --exposure 0 -o "$2" 2> stderr; }
render sub/air.karst ball.png && [ ! -s stderr ]
detail=$(cat stderr) result "render: a world with a model, without a word"
render sub/none.karst none.png
! cmp -s ball.png none.png
detail=$(cat stderr) result "render: the model is in the picture"
render sub/far.karst far.png && cmp ball.png far.png
detail=$(cat stderr) result "render: the same at 10^12 m, byte for byte"

# A hare's back and a tower's wall, as the worlds that their points were taken from have them, to a quarter of a spacing.
is() { "$karst" sample "$1" --at "$2" 2>&1 | grep "^density .* $3\$"; }
detail=$(for model in hare tower; do "$karst" info "$KARST_DATA_DIR/worlds/data/$model.karstpoints" > /dev/null || exit; done
    is menagerie 0.9,2.43,1.6 solid && is menagerie 0.9,2.46,1.6 air && is scan 2.53,5,0 solid && is scan 2.66,5,0 air)
result "the worlds menagerie and scan show their models where they are"

# refused CODE PATTERN NAME COMMAND...: fails with this code and says this, soon.
refused()
{
    code=$1 pattern=$2 name=$3
    shift 3
    timeout 200 "$karst" "$@" > stdout 2> stderr
    [ $? -eq "$code" ] && grep -q -e "$pattern" stderr
    detail=$(cat stderr) result "$name"
}
rm -f bad.karstpoints
refused 2 "which file" "import: no file" import
refused 2 "ends in .karstpoints" "import: another suffix" import ball.xyz -o ball.ply
refused 2 "laszip" "import: LAZ names a converter" import town.laz -o bad.karstpoints
refused 2 "read from .ply" "import: an unknown format" import a.doc -o bad.karstpoints
refused 5 "cannot open" "import: no such file" import missing.ply -o bad.karstpoints
head -c 100000 /dev/zero > zero.ply
refused 5 "zero.ply:1: a line of more than 4096 bytes" "import: zeros" import zero.ply -o bad.karstpoints
head -n 3 ball.xyz > few.xyz
refused 5 "16 are the fewest" "import: too few points" import few.xyz -o bad.karstpoints
printf 'ply\nformat ascii 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n' > lie.ply
refused 5 "after 1 of 4000000000 points" "import: a head that lies" import lie.ply -o bad.karstpoints
refused 2 "axes" "import: axes that are none" import ball.xyz -o bad.karstpoints --axes up
[ ! -e bad.karstpoints ] && [ -z "$(find . -name '*karstpoints.*')" ]
result "import: nothing is left of those"
refused 5 "cannot open" "info: no such file" info gone.karstpoints
cp ball.xyz text.karstpoints
refused 5 "this is no file of imported points" "info: text" info text.karstpoints
sed 's/ball.karstpoints/gone.karstpoints/' sub/air.karst > sub/gone.karst
refused 5 "sub/gone.karstpoints: cannot open" "render: a model that is not there" render sub/gone.karst -q --size 64x48 --pool 64 --display none -o x.png
head -c 3000 sub/ball.karstpoints > sub/gone.karstpoints
refused 5 "gone.karstpoints: its head and its length" "render: a model that was cut" render sub/gone.karst -q --size 64x48 --pool 64 --display none -o x.png
sed 's/\[{ "points": "ball.karstpoints"/[{ "at_": 3/' sub/air.karst > bad.karst
refused 4 'a model has "points"' "render: a model without a file" render bad.karst -q --size 64x48 --display none -o x.png
refused 2 "models of points" "accuracy: what the reference does not know" accuracy sub/air.karst --size 32x24
sed 's/"at": .0, 0, 0./"as": "discs"/' sub/air.karst > bad.karst
refused 4 '"as" cannot be "discs"' "render: models as what there is not" render bad.karst -q --size 64x48 --display none -o x.png
sed 's/"at": .0, 0, 0./"as": "splats", "blend": 3/' sub/air.karst > bad.karst
refused 4 '"blend" is a text' "render: splats blended by a number" render bad.karst -q --size 64x48 --display none -o x.png
sed 's/"at": .0, 0, 0./"as": "splats", "copies": "none"/' sub/air.karst > bad.karst
refused 4 '"copies" cannot be "none"' "render: splats without a way to copy" render bad.karst -q --size 64x48 --display none -o x.png
# says WHAT CODE PATTERN: of a model with these fields, and where.
says()
{
    sed "s/\"at\": .0, 0, 0./$1/" sub/air.karst > sub/bad.karst
    timeout 200 "$karst" sample sub/bad.karst --at 0,0,0 > stdout 2> stderr
    code=$?
    [ $code -eq "$2" ] && grep -q "^sub/bad.karst:2:[0-9]*: .*$3" stderr
    detail="$code; $(cat stderr)" result "a model with $1: $3"
}
says '"mode": "glass"' 4 'error: "mode" cannot be "glass"'
says '"mode": 3' 4 'error: "mode" is a text in quotes'
says '"mode": "clear", "as": "splats"' 4 'error: clear matter has an inside'
says '"material": "glass"' 4 'error: "material" is an object'
says '"material": { "mirror": 2 }' 4 'error: "mirror" is a number from 0 to 1$'
says '"material": { "colour": [1, 2] }' 4 'error: "colour" is three numbers'
says '"mode": "clear", "material": { "ior": 0.5 }' 4 'error: "ior" is a number from 1 to 10'
says '"mode": "clear", "material": { "absorption": [0, -1, 0] }' 4 'error: "absorption" is a number from 0 to'
says '"material": { "ior": 1.5 }' 0 'warning: the material of a solid model has no key "ior"'
says '"mode": "clear", "material": { "mirror": 1 }' 0 'warning: the material of clear matter has no key "mirror"'
sed 's/"points": "ball/"as": "splats", "points": "gone/' sub/air.karst > sub/lost.karst
refused 5 "gone.karstpoints: its head and its length" "render: splats of a model that was cut" render sub/lost.karst -q --size 64x48 --pool 64 --display none -o x.png
sed 's/"at": .0, 0, 0./"as": "splats"/' sub/air.karst > sub/splats.karst
render sub/splats.karst splats.png && ! cmp -s splats.png ball.png && ! cmp -s splats.png none.png
detail=$(cat stderr) result "render: splats are another picture of the model"
refused 2 "shows no model of points" "bench: a table of points without any" bench sub/none.karst -q --points --size 48x36 --pool 64 --rounds 1
refused 2 "makes a table of its own" "bench: a table of points along a path" bench sub/air.karst --points --path orbit
"$karst" bench sub/air.karst -q --points --size 48x36 --pool 64 --rounds 1 --json - > report 2> stderr &&
    awk -f "$flatten" report > flat && [ "$(grep -c '^rows..models_as = ' flat)" -eq 5 ] && grep -q '^points = 5000$' flat &&
    awk '/^rows..rms_px/ { n += $3 < 1 } /^rows..holes/ { n += $3 < 0.01 } END { exit n != 10 }' flat
detail=$(cat stderr flat) result "bench: surfaces and splats, time, memory and error"

# ---- real data ----
if [ -r "$data/stanford-bunny.obj" ]; then
    "$karst" import "$data/stanford-bunny.obj" -o rabbit.karstpoints 2> stderr && "$karst" info rabbit.karstpoints > info &&
        grep -q '^points *35947,' info && grep -q '^normals *as the file' info &&
        "$karst" import "$data/simple.las" -o las.karstpoints 2>> stderr && "$karst" info las.karstpoints | grep -q '^colours *yes'
    detail=$(cat stderr info) result "import: a rabbit, a laser scan"
else
    skip "import: a rabbit, a laser scan" "no ../shared/data"
fi
finish
