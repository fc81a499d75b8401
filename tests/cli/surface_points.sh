#!/bin/sh
# karst points from outside: files, what they say, their way back through karst import, what is refused, and that what is
# stopped leaves nothing behind. $KARST is the program.
set -u
subcommand=points
. tests/cli/export.sh
cat > ball.karst << 'END'
/*{ "voxel": 0.125, "params": { "r": { "value": 4, "min": 1, "max": 9 } } }*/
float density(vec3 p) { return r - length(mod(p + 16.0, 32.0) - 16.0); }
vec3 colour(vec3 p, vec3 n) { return vec3(1.0, 0.0, 0.2140411); }
float clear(vec3 p) { return 1.0 - length(p - vec3(0.0, 8.0, 0.0)); }
END
ball="ball.karst --box -10,-10,-10,10,10,10 --spacing 0.5"

run $ball -o out.ply --json
[ $status -eq 0 ] && [ "$(head -c 3 out.ply)" = ply ] && grep -aq '^comment origin_x_m -10$' out.ply && [ ! -s stderr ] &&
    ! grep -aq 'element face' out.ply
result "a PLY without faces, and what was written as JSON"
points=$(sed 's/.*"points": \([0-9]*\),.*/\1/' stdout)
header=$(grep -an '^end_header$' out.ply | head -1 | cut -d: -f1)
header_bytes=$(head -n "$header" out.ply | wc -c)
grep -aq "^element vertex $points\$" out.ply && [ "$(wc -c < out.ply)" -eq $((header_bytes + 27 * points)) ]
detail="$points points, $(wc -c < out.ply) bytes" result "it is as long as it says"
# 201 m2 of ball: cells of 0.25 m2 each meet it in one and a half on average.
[ "$points" -gt 804 ] && [ "$points" -lt 1608 ]
detail="$points points" result "and has a point for each cell with surface"
[ "$(tail -c +$((header_bytes + 1)) out.ply | tail -c 3 | od -An -tu1 | tr -s ' ')" = " 255 0 127" ]
result "colours are bytes of sRGB"
cp out.ply right.ply
"$karst" mesh ball.karst --box -10,-10,-10,10,10,10 --voxel 0.5 -o mesh.ply -q
[ "$(tail -c $((27 * points)) right.ply | cksum)" = "$(tail -c +$((1 + $(head -n "$(grep -an '^end_header$' mesh.ply | head -1 | cut -d: -f1)" mesh.ply | wc -c))) mesh.ply | head -c $((27 * points)) | cksum)" ]
result "points are the vertices of the mesh"
run $ball -o out.ply --threads 1 -q
[ $status -eq 0 ] && cmp -s out.ply right.ply && [ ! -s stderr ]
result "one thread writes the same bytes"
run $ball --clear -o out.ply
[ $status -eq 0 ] && ! cmp -s out.ply right.ply
result "clear matter has points of its own"

# ---- and back ----
"$karst" import right.ply --axes karst -o model.karstpoints > stdout 2> stderr
[ $? -eq 0 ] && [ -s model.karstpoints ]
detail=$(cat stderr) result "karst import takes it"
run $ball -o out.karstpoints --json
[ $status -eq 0 ] && grep -q "\"points\": $points" stdout && "$karst" info out.karstpoints --json > facts 2>&1
detail="$detail; $(cat facts)" result "a model in one go"
grep -q "\"points\": $points\b" facts && grep -q '"given_normals": *true' facts
detail=$(cat facts) result "which has all points, and their normals"
cat > shown.karst << 'END'
/*{ "voxel": 0.0625, "models": [ { "points": "out.karstpoints", "at": ["0", "0", "0"] } ] }*/
float density(vec3 p) { return -1.0; }
END
# Where the ball ends: solid 20 cm inside, air 20 cm outside.
inside=$("$karst" sample shown.karst --at 0,3.8,0 --at 2.687,2.687,0 --json 2> stderr | grep -c '"density":[0-9]')
outside=$("$karst" sample shown.karst --at 0,4.2,0 --at 2.97,2.97,0 --json 2>> stderr | grep -c '"density":-')
[ "$inside $outside" = "2 2" ]
detail="$inside of 2 inside, $outside of 2 outside; $(cat stderr)" result "and the surface that it came from"

echo '{ "edits": [ { "shape": "box", "mode": "remove", "at": [0,0,0], "half": [9,9,9] } ] }' > dig.json
run $ball --edits dig.json -o none.ply
[ $status -eq 0 ] && grep -q 'no surface' stderr && grep -aq '^element vertex 0$' none.ply
result "edits; a box without a surface is a file of no points"
run $ball --edits dig.json -o none.karstpoints
[ $status -eq 1 ] && grep -q 'no surface' stderr && [ -z "$(ls -A | grep -E '^(none\.karstpoints|\.karst)')" ]
result "but no model"
refused 2 'which box' "no box" ball.karst --spacing 1 -o out.ply
refused 2 'how far apart' "no spacing" ball.karst --box 0,0,0,1,1,1 -o out.ply
refused 2 'which file' "no file" ball.karst --box 0,0,0,1,1,1 --spacing 1
refused 2 'which world' "no world" --box 0,0,0,1,1,1 --spacing 1 -o out.ply
refused 2 '\.ply or a \.karstpoints' "a kind of file that is none" $ball -o out.las
refused 2 'limit' "too many cells: what would do" ball.karst --box 0,0,0,1e9,1,1 --spacing 1 -o out.ply
refused 4 'nowhere' "a world that is none" nowhere --box 0,0,0,1,1,1 --spacing 1 -o out.ply
refused 5 'dig2' "edits that are none" $ball --edits dig2.json -o out.ply
refused 1 'folder is not there' "a folder that is none" $ball -o nowhere/out.ply
stopped "stopped, it leaves nothing behind" hills --box 0,-200,0,3000,300,3000 --spacing 0.5 -o out.ply
stopped "nor does a model" hills --box 0,-200,0,3000,300,3000 --spacing 0.5 -o out.karstpoints

run --help
[ $status -eq 0 ] && grep -q 'karst points hills --box' stdout && grep -q 'Exit code' stdout
result "help has examples and exit codes"
finish
