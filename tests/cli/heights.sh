#!/bin/sh
# karst heights from outside: files, what they say, columns without land, what is refused, and that a map that is stopped
# leaves nothing behind. $KARST is the program.
set -u
subcommand=heights
. tests/cli/export.sh
# A plane of slope 1 along x over x above 0; nothing elsewhere.
cat > ramp.karst << 'END'
/*{ "voxel": 0.125, "params": { "up": { "value": 0, "min": -9, "max": 9 } } }*/
float density(vec3 p) { return min(min(p.x + up - p.y, p.x), p.y + 40.0); }
END
ramp="ramp.karst --box -4,0,12,4 --size 4x2 --range 0,32767"

run $ramp -o out.tif --json
[ $status -eq 0 ] && grep -q '"empty_columns": 2' stdout && grep -q '"offset_m": -0.5, "step_m": 0.5' stdout &&
    [ ! -s stderr ]
result "a TIFF, and what was written as JSON"
# Columns at x = -2, 2, 6 and 10; z makes no difference.
[ "$(tail -c 16 out.tif | od -An -tu1 -w16 | tr -s ' ')" = " 0 0 0 5 0 13 0 21 0 0 0 5 0 13 0 21" ]
detail=$(tail -c 16 out.tif | od -An -tu1) result "its values are the heights, and 0 without land"
grep -aq 'height_offset_m=-0.5 height_step_m=0.5' out.tif
result "with offset and step in the file"
run $ramp -o out.png -q
[ $status -eq 0 ] && [ ! -s stderr ] && grep -aq 'height_step_m.0\.5' out.png
result "a PNG"
run $ramp -o out.exr --param up=1
[ $status -eq 0 ] && grep -q 'land from 3.00 to 11.00 m, 2 columns without' stderr
result "an EXR; a parameter"
run ramp.karst --box 1125899906842600,0,1125899906842616,4 --from 1125899906842700 --depth 200 --size 4x1 -o far.exr --json
[ $status -eq 0 ] && grep -q '"empty_columns": 0' stdout
result "10^15 m out"
run ramp.karst --box -40,0,-20,4 --size 4x2 -o none.png
[ $status -eq 0 ] && grep -q 'no column has land' stderr && [ -s none.png ]
result "a map without land"

refused 2 'which box' "no box" ramp.karst --size 4x4 -o out.png
refused 2 'how many pixels' "no size" ramp.karst --box 0,0,1,1 -o out.png
refused 2 'which file' "no file" ramp.karst --box 0,0,1,1 --size 4x4
refused 2 '\.tif.*\.png.*\.exr' "a kind of file that is none" $ramp -o out.jpg
refused 2 'X0,Z0' "three numbers" ramp.karst --box 0,0,1 --size 4x4 -o out.png
refused 2 'not above' "a box that is turned over" ramp.karst --box 0,5,1,1 --size 4x4 -o out.png
refused 2 'lower one first' "a range that is turned over" ramp.karst --box 0,0,1,1 --size 4x4 --range 5,1 -o out.png
refused 4 'nowhere' "a world that is none" nowhere --box 0,0,1,1 --size 4x4 -o out.png
refused 5 'none.json' "edits that are none" $ramp --edits none.json -o out.png

# A map of minutes, stopped after it has begun.
stopped "stopped, it leaves nothing behind" hills --box 0,0,4000,4000 --size 2000x2000 -o out.tif

run --help
[ $status -eq 0 ] && grep -q 'karst heights hills --box' stdout && grep -q 'Exit code' stdout
result "help has examples and exit codes"
finish
