#!/bin/sh
# Pictures in bands from outside, and pictures whose samples are taken in two goes: bytes, files, messages. $KARST is the
# program.
set -u
. tests/tap.sh
. tests/cli/calls.sh

small="--size 75x53 --pool 64 --detail 2 --view-distance 2000 --samples 3 --display none -q"

# ---- bands ----
# The exposure follows the picture, surfaces mirror, sides are odd.
run render hills $small --mirror 0.4 -o whole.png
run render hills $small --mirror 0.4 -o bands.png --rows 16
[ $status -eq 0 ] && [ -s whole.png ] && cmp whole.png bands.png && [ "$(ls -A | grep -c karst-)" -eq 0 ]
result "a .png in bands has the bytes of the whole"
run render hills $small --mirror 0.4 -o - --rows 32
[ $status -eq 0 ] && cmp whole.png stdout
result "and so has one to stdout"
all="--aov radiance,albedo,depth,normal,position,level,samples,sums"
run render hills $small --mirror 0.4 $all -o whole.exr
run render hills $small --mirror 0.4 $all -o bands.exr --rows 16
[ $status -eq 0 ] && [ -s whole.exr ] && cmp whole.exr bands.exr
result "an .exr in bands, with all that is known of its pixels"
run render hills $small --samples 1 --tone plain -o whole1.exr
run render hills $small --samples 1 --tone plain -o bands1.exr --rows 16
[ $status -eq 0 ] && [ -s whole1.exr ] && cmp whole1.exr bands1.exr
result "one without light, whose colours are those of its bytes"
run render hills $small --mirror 0.4 --exposure 0 -o fixed.png
run render hills $small --mirror 0.4 --exposure 0 -o window.png --window 37,21,30,20
convert fixed.png -crop 30x20+37+21 +repage -depth 8 rgb:crop.rgb
convert window.png -depth 8 rgb:window.rgb
[ $status -eq 0 ] && [ "$(wc -c < crop.rgb)" -eq 1800 ] && cmp crop.rgb window.rgb
result "a window of what mirrors has the bytes of that part"
# Pools that hold no band of so many rows: fewer are drawn at once, in the same detail.
run render hills $small --detail 0.5 --pool 512 -o fine.png
run render hills $small --detail 0.5 --pool 3 -o few.png --rows 48 --stats few.json
[ $status -eq 0 ] && cmp fine.png few.png && grep -q '"given_px": 0.5,' few.json
result "bands that do not fit into the pools are drawn by fewer rows"
complains 2 "one picture" "bands of a flight" render hills --path dive -o %d.png --rows 16
complains 2 "16 to 16384" "bands of one row" render hills --rows 1

# Asked to end in the middle, it leaves nothing.
mkdir large
"$karst" render hills --size 2000x1600 --samples 64 --rows 16 --pool 64 --display none -q -o large/a.png 2> stderr &
worker=$!
tries=0
until [ -n "$(ls -A large)" ] || [ $tries -eq 600 ]; do sleep 0.1 && tries=$((tries + 1)); done
began=$(ls -A large)
kill -INT $worker
wait $worker
status=$?
detail="exit $status, $began: $(cat stderr); $(ls -A large)"
[ $status -eq 130 ] && [ -n "$began" ] && [ -z "$(ls -A large)" ]
result "Ctrl-C: no half file"

# ---- samples in two goes ----
run render hills $small -o one.exr --samples 7 --resume
[ $status -eq 0 ] && [ -s one.exr ]
result "--resume of an .exr that is not there begins it"
run render hills $small -o two.exr --samples 3 --resume
run render hills $small -o two.exr --samples 7 --resume
[ $status -eq 0 ] && cmp one.exr two.exr
result "samples in two goes are those of one, byte for byte"
cp one.exr bands.exr
run render hills $small -o three.exr --samples 3 --resume
run render hills $small -o three.exr --samples 7 --resume --rows 16
[ $status -eq 0 ] && cmp one.exr three.exr
result "in bands as well"
before=$(ls -l --time-style=full-iso two.exr)
run render hills ${small% -q} -o two.exr --samples 7 --resume
[ $status -eq 0 ] && grep -q 'nothing is left' stderr && [ "$before" = "$(ls -l --time-style=full-iso two.exr)" ]
result "with all samples there nothing is drawn"
complains 5 "has 7 samples already" "fewer than there are" render hills $small -o two.exr --samples 5 --resume
complains 5 "another picture \(seed: null there, 5 here\)" "samples of another seed" render hills $small -o two.exr --samples 9 --seed 5 --resume
complains 5 "another picture \(size" "samples of another size" render hills $small --size 60x40 -o two.exr --samples 9 --resume
complains 5 "another picture \(camera" "samples from elsewhere" render hills $small --camera 0,400,0,0,0 -o two.exr --samples 9 --resume
complains 5 "holds no sums" "an .exr without sums" render hills $small -o whole1.exr --resume
cp whole.png png.exr
complains 5 "no OpenEXR file" "what is no .exr" render hills $small -o png.exr --resume
head -c 9000 one.exr > cut.exr
complains 5 "cannot read cut.exr" "an .exr that breaks off" render hills $small -o cut.exr --samples 9 --resume
complains 2 "which job" "a .png is not gone on with" render hills $small -o whole.png --resume
detail=$(ls -A)
[ "$(ls -A | grep -c karst-)" -eq 0 ]
result "nothing is left behind"
# Full light keeps sums by itself.
full="--size 32x24 --pool 64 --detail 4 --view-distance 1000 --light full --display none -q"
run render hills $full -o full1.exr --samples 5
run render hills $full -o full2.exr --samples 2
run render hills $full -o full2.exr --samples 5 --resume
[ $status -eq 0 ] && [ -s full1.exr ] && cmp full1.exr full2.exr
result "full light goes on with what it wrote"
# Many samples ask for finer voxels by themselves, unless a picture that is gone on with has others.
coarse="--size 32x24 --pool 64 --view-distance 1000 --display none -q"
asked() { sed -n 's/.*"asked_px": *\([0-9.]*\).*/\1/p' "$1"; }
run render hills $coarse --samples 15 -o 15.png --stats 15.json
run render hills $coarse --samples 16 -o 16.png --stats 16.json
run render hills $coarse --samples 16 --detail 2 -o 16.png --stats said.json
run render hills $coarse --samples 2 -o more.exr --resume
run render hills $coarse --samples 16 -o more.exr --resume --stats more.json
detail="exit $status: $(asked 15.json) $(asked 16.json) $(asked said.json) $(asked more.json); $(cat stderr)"
[ $status -eq 0 ] && [ "$(asked 15.json)" = 1.0 ] && [ "$(asked 16.json)" = 0.5 ] && [ "$(asked said.json)" = 2.0 ] && [ "$(asked more.json)" = 1.0 ]
result "voxels are half a pixel wide where there are many samples"
finish
