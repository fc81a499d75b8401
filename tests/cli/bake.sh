#!/bin/sh
# karst bake from outside: a map, what it says, a picture that has its light, what is refused, and that a map that is
# stopped leaves nothing behind. $KARST is the program.
set -u
subcommand=bake
. tests/cli/export.sh

# A cave whose walls are white and do not glow, with a small bright stone in it.
cat > cave.karst << 'END'
/*{ "voxel": 0.0625, "view": 60, "light_map": { "file": "light.ply" },
    "sun": { "colour": [0, 0, 0] }, "sky": { "zenith": [0, 0, 0], "horizon": [0, 0, 0], "haze": 1e12 },
    "camera": { "position": ["0", "0.5", "0"], "pitch": -30 } }*/
float density(vec3 p) { return max(length(p) - 3.0, 0.5 - length(p - vec3(0.0, -1.0, 2.0))); }
material surface(vec3 p, vec3 n) {
    material m;
    m.colour = vec3(0.8);
    if (length(p - vec3(0.0, -1.0, 2.0)) < 0.6) m.emission = vec3(2.0, 1.0, 0.5);
    return m;
}
END
cave="cave.karst --side 12 --samples 4 --bounces 4 --pool 64"

run $cave -o light.ply --json
[ $status -eq 0 ] && grep -q '"points": 864' stdout && grep -q '"views": 6' stdout && [ ! -s stderr ]
result "a map of all that is seen around a camera, though the world names one that is not there yet; as JSON"
[ "$(sed -n 1p light.ply)" = ply ] && grep -aq 'element vertex 864' light.ply &&
    [ "$(wc -c < light.ply)" -eq $((864 * 52 + $(grep -aobm1 end_header light.ply | cut -d: -f1) + 11)) ]
detail=$(head -c 700 light.ply) result "its file is a PLY, of the length that it says"
run $cave -o again.ply -q
cmp light.ply again.ply && [ ! -s stderr ]
result "the same map again, byte for byte, without a word"
render() { "$karst" render "$1" -q --size 32x24 --pool 64 --display none --exposure 0 --samples 2 -o "$2" > stdout 2> stderr; }
render cave.karst lit.png && [ ! -s stderr ] && sed 's/"light_map": .*},$//' cave.karst > plain.karst && render plain.karst dark.png &&
    ! cmp -s lit.png dark.png
detail=$(cat stderr) result "a picture has its light"
run cave.karst --side 8 --samples 2 --camera 0,0.5,0,0,0 --camera 0,1,0,9,9 -o two.ply
[ $status -eq 0 ] && grep -q '768 points of 12 views' stderr
result "from two cameras"

rm light.ply
render cave.karst none.png
status=$?
[ $status -eq 5 ] && grep -q 'light.ply' stderr && [ ! -e none.png ]
detail=$(cat stderr) result "render: without the map that is named, exit 5 and its name"
echo garbage > light.ply
render cave.karst none.png
status=$?
[ $status -eq 5 ] && grep -q 'light.ply.*ply' stderr && [ ! -e none.png ]
detail=$(cat stderr) result "render: a map that is none"
mkfifo pipe.ply && sed 's/light.ply/pipe.ply/' cave.karst > pipe.karst && render pipe.karst none.png
status=$?
[ $status -eq 5 ] && grep -q 'regular' stderr
detail=$(cat stderr) result "render: a pipe is not waited for"

refused 2 'which world' "no world"
refused 2 'which file' "no file" cave.karst
refused 2 'may have 4194304' "too many points: what would do" cave.karst --side 2048 -o out.ply
refused 2 'camera' "a camera that is none" cave.karst --camera 1,2 -o out.ply
refused 4 'nowhere' "a world that is none" nowhere -o out.ply
refused 5 'dig.json' "edits that are none" $cave --edits dig.json -o out.ply
refused 1 'folder is not there' "a folder that is none" $cave -o nowhere/out.ply
refused 1 'no land' "no land to be seen" $cave --camera 0,0,1e6,0,0 --view-distance 10 -o out.ply

# Minutes of work, stopped after it has begun.
"$karst" bake hills --side 512 --samples 1000 -o out.ply > stdout 2> stderr &
pid=$!
until_caught $pid
kill -TERM $pid
wait $pid
status=$?
[ $status -ne 0 ] && [ -z "$(ls -A | grep -E '^(out\.ply|\.karst)')" ] && grep -q interrupted stderr
detail="exit $status; $(cat stderr); $(ls -A | tr '\n' ' ')" result "stopped, it leaves nothing behind"

run --help
[ $status -eq 0 ] && grep -q 'karst bake ruins -o' stdout && grep -q 'Exit code' stdout
result "help has examples and exit codes"
finish
