#!/bin/sh
# karst voxels from outside: files that NanoVDB's own headers accept, their values, what is refused, and that what is
# stopped leaves nothing behind. $KARST is the program.
set -u
source=$PWD/tests/export/nanovdb_check.cc
subcommand=voxels
. tests/cli/export.sh
# Its density is no distance. Its ball is centred on a box of 40 m whose lower corner is at 0, and lies in cubes of 128 voxels on both sides of one.
cat > ball.karst << 'END'
/*{ "voxel": 0.125, "params": { "r": { "value": 15, "min": 1, "max": 19 } } }*/
float density(vec3 p) { float x = r - length(p - 20.0); return x * (1.0 + 60.0 * x * x); }
medium air(vec3 p) { medium m; m.extinction = 0.1 * (p.x - 36.0); m.albedo = vec3(0.9); return m; }
float clear(vec3 p) { return 2.0 - length(p - vec3(20.0, 37.0, 20.0)); }
END
ball="ball.karst --box 0,0,0,40,40,40 --voxel 0.25"

# The headers are C++, and take seconds to compile.
if [ "${KARST_TEST_QUICK:-}" != 1 ]; then
    ${CXX:-c++} -std=c++17 -O0 -w "$source" -lz -o check 2> stderr
    detail=$(head -c 600 stderr) result "a program on NanoVDB's headers compiles"
    run $ball --grids distance,extinction,clear -o out.nvdb --json
    [ $status -eq 0 ] && grep -q '"voxels": \[160, 160, 160\]' stdout && [ ! -s stderr ]
    result "three grids, and what was written as JSON"
    ./check out.nvdb > told
    [ $? -eq 0 ] && [ "$(wc -l < told)" -eq 3 ] && [ "$(grep -c ' valid$' told)" -eq 3 ] &&
        grep -q '^0 distance SDF .* 0.25 valid$' told && grep -q '^1 extinction FOG' told && grep -q '^2 clear SDF' told
    detail=$(cat told) result "NanoVDB's validator accepts them, sums and all"
    sum=$(awk '{ n += $4 } END { print n }' told)
    grep -q "\"active\": $sum," stdout
    detail="$sum; $(cat stdout)" result "it counts as many active voxels"
    ./check out.nvdb distance ball 20,20,20,15 > told
    [ $? -eq 0 ] && awk '$5 + 0 > 0 && $7 > 0 { exit 1 } { for (i = 1; i < NF; i++) if ($i == "most") exit !($(i + 1) < 0.006) }' told
    detail=$(cat told) result "distances to a ball are right to 0.006 voxels, on all sides and in both bands"
    ./check out.nvdb clear ball 20,37,20,2 > told
    [ $? -eq 0 ] && awk '{ for (i = 1; i < NF; i++) if ($i == "most") exit !($(i + 1) < 0.035) }' told
    detail=$(cat told) result "and to clear matter"
    head -c 100000 out.nvdb > cut.nvdb && head -c 300000 out.nvdb > changed.nvdb && printf x >> changed.nvdb &&
        tail -c +300002 out.nvdb >> changed.nvdb
    ./check out.nvdb > told && ! ./check cut.nvdb > told && ! { ./check changed.nvdb > told && [ "$(grep -c ' valid$' told)" -eq 3 ]; }
    detail=$(cat told) result "the same program refuses a file that was cut, or of which one byte is another"

    # Values are the density's own, in every bit.
    run hills --box 0,60,0,21,81,19 --voxel 0.5 --grids density -o out.nvdb -q
    ./check out.nvdb > told && grep -q '^0 density ? 67032 \[0 0 0 41 41 37\]' told
    detail="$detail; $(cat told)" result "all voxels of a box have a density"
    ./check out.nvdb density points 300 > points && awk '{ split($1, p, ","); printf "%s,%s,%s\n", p[1], p[2] + 60, p[3] }' points |
        "$karst" sample hills --json > samples 2> stderr
    [ "$(wc -l < points)" -ge 250 ] && cut -d' ' -f2 points > bits &&
        sed 's/.*"density_hex": *"\([^"]*\)".*/\1/' samples | cmp - bits > differ 2>&1
    detail="$(head -3 points) $(head -2 samples) $(cat differ stderr)" result "they are the bits of karst sample"
fi

run $ball -o one.nvdb -q && cp one.nvdb first.nvdb && run $ball -o one.nvdb -q --threads 1 && cmp -s one.nvdb first.nvdb
result "the same bytes on one thread"
run ball.karst --box 0,0,0,40,40,40 --voxel 0.25 --param r=5 -o small.nvdb -q
[ $status -eq 0 ] && [ "$(wc -c < small.nvdb)" -lt "$(($(wc -c < one.nvdb) / 4))" ]
result "a small ball takes a small file"
echo '{ "edits": [ { "shape": "box", "mode": "remove", "at": [20,20,20], "half": [30,30,30] } ] }' > dig.json
run ball.karst --box 8,8,8,12,12,12 --voxel 0.25 --edits dig.json -o none.nvdb --json
[ $status -eq 0 ] && grep -q '"active": 0,' stdout && [ "$(wc -c < none.nvdb)" -lt 2000 ]
result "edits; a box without a surface is a file of nothing"

refused 2 'which box' "no box" ball.karst --voxel 1 -o out.nvdb
refused 2 'how wide' "no voxel" ball.karst --box 0,0,0,1,1,1 -o out.nvdb
refused 2 'which file' "no file" ball.karst --box 0,0,0,1,1,1 --voxel 1
refused 2 'which world' "no world" --box 0,0,0,1,1,1 --voxel 1 -o out.nvdb
refused 2 '\.nvdb' "a kind of file that is none" $ball -o out.vdb
refused 2 "'fog' is none" "a grid that is none" $ball --grids distance,fog -o out.nvdb
refused 2 'twice' "a grid twice" $ball --grids clear,clear -o out.nvdb
refused 2 'has no air.*medium air' "a world without air" hills --box 0,0,0,9,9,9 --voxel 1 --grids extinction -o out.nvdb
refused 2 'X0,Y0,Z0' "five numbers" ball.karst --box 0,0,0,1,1 --voxel 1 -o out.nvdb
refused 2 'limit' "too many voxels: what would do" ball.karst --box 0,0,0,1e9,1,1 --voxel 1 -o out.nvdb
refused 4 'nowhere' "a world that is none" nowhere --box 0,0,0,1,1,1 --voxel 1 -o out.nvdb
refused 5 'dig2' "edits that are none" $ball --edits dig2.json -o out.nvdb
refused 1 'folder is not there' "a folder that is none" $ball -o nowhere/out.nvdb

# Minutes of work, stopped after it has begun.
stopped "stopped, it leaves nothing behind" hills --box 0,-200,0,3000,300,3000 --voxel 1 -o out.nvdb

run --help
[ $status -eq 0 ] && grep -q 'karst voxels hills --box' stdout && grep -q 'Exit code' stdout
result "help has examples and exit codes"
finish
