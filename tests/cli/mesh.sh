#!/bin/sh
# karst mesh from outside: files, what they say of themselves, what is refused, and that a mesh that is stopped leaves
# nothing behind. $KARST is the program.
set -u
source_folder=$PWD/tests/export
subcommand=mesh
. tests/cli/export.sh
cat > ball.karst << 'END'
/*{ "voxel": 0.125, "params": { "r": { "value": 4, "min": 1, "max": 9 } } }*/
float density(vec3 p) { return r - length(mod(p + 16.0, 32.0) - 16.0); }
END
ball="ball.karst --box -10,-10,-10,10,10,10 --voxel 0.5"

run $ball -o out.ply --json
[ $status -eq 0 ] && [ "$(head -c 3 out.ply)" = ply ] && grep -aq '^comment origin_x_m -10$' out.ply &&
    grep -q '"triangles": [1-9]' stdout && [ ! -s stderr ]
result "a PLY, and what was written as JSON"
triangles=$(sed 's/.*"triangles": \([0-9]*\),.*/\1/' stdout) vertices=$(sed 's/.*"vertices": \([0-9]*\),.*/\1/' stdout)
header=$(grep -an '^end_header$' out.ply | head -1 | cut -d: -f1)
[ "$(wc -c < out.ply)" -eq $(($(head -n "$header" out.ply | wc -c) + 27 * vertices + 13 * triangles)) ]
detail="$vertices vertices, $triangles triangles, $(wc -c < out.ply) bytes" result "it is as long as it says"
[ $((2 * vertices - 4)) -eq "$triangles" ]
detail="$vertices vertices, $triangles triangles" result "and a closed surface"

run $ball -o out.obj
[ $status -eq 0 ] && [ "$(grep -c '^v ' out.obj)" = "$vertices" ] && [ "$(grep -c '^vn ' out.obj)" = "$vertices" ] &&
    [ "$(grep -c '^f ' out.obj)" = "$triangles" ] && grep -q "$triangles triangles" stderr
result "an OBJ of the same"
run $ball -o out.GLB -q
[ $status -eq 0 ] && [ "$(head -c 4 out.GLB)" = glTF ] && [ ! -s stderr ] &&
    [ "$(od -An -tu4 -j8 -N4 out.GLB | tr -d ' ')" -eq "$(wc -c < out.GLB)" ]
result "a glTF, whose length is in its header"
length=$(od -An -tu4 -j12 -N4 out.GLB | tr -d ' ')
tail -c +21 out.GLB | head -c "$length" > out.json
grep -q '"origin_x_m":"-10","origin_y_m":"-10"' out.json && grep -q "\"count\":$((3 * triangles)),\"type\":\"SCALAR\"" out.json
detail=$(cat out.json) result "with its facts as JSON"


# ---- levels ----
check="python3 $source_folder/gltf_check.py"
command -v python3 > /dev/null || check=true
run $ball -o out.glb -q
[ $status -eq 0 ] && $check out.glb > facts
detail=$(cat facts) result "the glTF keeps the specification's rules"
run ball.karst --box -10,-10,-100,10,10,100 --voxel 0.5 --param r=9 --lods 3 -o out.glb --json
[ $status -eq 0 ] && grep -q '"level_triangles": \[[0-9]*, [0-9]*, [0-9]*\]' stdout && [ ! -s stderr ] && $check out.glb > facts
detail="$detail; $(cat facts)" result "so does one with levels, whose triangles are told"
all=$(sed 's/.*"level_triangles": \[\([0-9]*\), \([0-9]*\), \([0-9]*\)\].*/\1 + \2 + \3/' stdout)
chunks=$(sed 's/.*"chunks": \([0-9]*\),.*/\1/' stdout)
[ "$check" = true ] || grep -q "\"meshes\": $((3 * chunks)), \"triangles\": $(($all))}" facts
detail="$all, $chunks chunks; $(cat facts)" result "and are in it, a node for each chunk and level"
cp out.glb levels.glb
run ball.karst --box -10,-10,-100,10,10,100 --voxel 0.5 --param r=9 --lods 3 -o out.glb --threads 3
[ $status -eq 0 ] && cmp -s out.glb levels.glb && grep -q 'level 2: [0-9]* triangles' stderr
result "however many threads work"
cp levels.glb broken.glb && printf '\377' | dd of=broken.glb bs=1 seek=$(($(wc -c < levels.glb) - 2)) conv=notrunc 2> dd.log
[ "$check" = true ] || ! $check broken.glb > facts
detail=$(cat facts) result "a byte of its triangles is missed if it is another"
refused 2 'a \.glb' "levels in a kind of file that has none" $ball --lods 2 -o out.ply
refused 2 'lods' "no level at all" $ball --lods 0 -o out.glb
refused 2 'lods' "more levels than there are" $ball --lods 9 -o out.glb

# ---- clear matter ----
cat > clear.karst << 'END'
/*{ "voxel": 0.125 }*/
float density(vec3 p) { return 3.0 - length(p); }
float clear(vec3 p) { return 2.0 - length(p - vec3(0.0, 6.0, 0.0)); }
END
run clear.karst --clear --box -5,-5,-5,5,9,5 --voxel 0.25 -o clear.obj -q
[ $status -eq 0 ] && sed -n 's/^v //p' clear.obj | awk '{ x = $1 - 5; y = $2 - 11; z = $3 - 5; r = sqrt(x * x + y * y + z * z)
    if (r < 1.999 || r > 2.001) off++; n++ } END { exit !(n > 500 && off == 0) }'
result "--clear: clear matter's surface, and no other"
run clear.karst --box -5,-5,-5,5,9,5 --voxel 0.25 -o land.obj -q
[ $status -eq 0 ] && sed -n 's/^v //p' land.obj | awk '{ x = $1 - 5; y = $2 - 5; z = $3 - 5; r = sqrt(x * x + y * y + z * z)
    if (r < 2.999 || r > 3.001) off++; n++ } END { exit !(n > 500 && off == 0) }'
result "without it the land's alone"
refused 2 'clear' "of a world without clear matter" $ball --clear -o out.ply

run $ball -o near.ply -q
run ball.karst --box 1125899906842614,-10,-10,1125899906842634,10,10 --voxel 0.5 -o far.ply -q
[ $status -eq 0 ] && grep -aq '^comment origin_x_m 1125899906842614$' far.ply &&
    tail -c $((27 * vertices + 13 * triangles)) near.ply > near && tail -c $((27 * vertices + 13 * triangles)) far.ply > far &&
    cmp -s near far
result "10^15 m out it is the same in every byte"
run $ball --param r=2 -o small.obj -q
[ $status -eq 0 ] && [ "$(grep -c '^f ' small.obj)" -lt $((triangles / 2)) ]
result "a parameter"
echo '{ "edits": [ { "shape": "box", "mode": "remove", "at": [0,0,0], "half": [9,9,9] } ] }' > dig.json
run $ball --edits dig.json -o none.glb
[ $status -eq 0 ] && grep -q 'no surface' stderr && [ -s none.glb ]
result "edits; a box without a surface is a mesh of nothing"

refused 2 'which box' "no box" ball.karst --voxel 1 -o out.ply
refused 2 'how wide' "no voxel" ball.karst --box 0,0,0,1,1,1 -o out.ply
refused 2 'which file' "no file" ball.karst --box 0,0,0,1,1,1 --voxel 1
refused 2 'which world' "no world" --box 0,0,0,1,1,1 --voxel 1 -o out.ply
refused 2 '\.glb.*\.ply.*\.obj' "a kind of file that is none" $ball -o out.stl
refused 2 'X0,Y0,Z0' "five numbers" ball.karst --box 0,0,0,1,1 --voxel 1 -o out.ply
refused 2 'X0,Y0,Z0' "seven numbers" ball.karst --box 0,0,0,1,1,1,1 --voxel 1 -o out.ply
refused 2 'zebra' "a word among them" ball.karst --box 0,0,zebra,1,1,1 --voxel 1 -o out.ply
refused 2 'not above' "a box that is turned over" ball.karst --box 0,5,0,1,1,1 --voxel 1 -o out.ply
refused 2 'limit' "too many cells: what would do" ball.karst --box 0,0,0,1e9,1,1 --voxel 1 -o out.ply
refused 2 'leaves the world|beyond' "a box that leaves the world" ball.karst --box 0,0,0,1e30,1,1 --voxel 1e26 -o out.ply
refused 4 'nowhere' "a world that is none" nowhere --box 0,0,0,1,1,1 --voxel 1 -o out.ply
refused 5 'dig2' "edits that are none" $ball --edits dig2.json -o out.ply
refused 1 'folder is not there' "a folder that is none" $ball -o nowhere/out.ply

# A mesh of minutes, stopped after it has begun.
stopped "stopped, it leaves nothing behind" hills --box 0,-200,0,3000,300,3000 --voxel 0.5 -o out.ply

run --help
[ $status -eq 0 ] && grep -q 'karst mesh hills --box' stdout && grep -q 'Exit code' stdout
result "help has examples and exit codes"
finish
