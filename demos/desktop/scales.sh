#!/bin/sh
# One planet at four scales, for the README (ImageMagick): demos/desktop/scales.sh KARST OUT.PNG
set -eu
karst=$1 out=$2
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
draw() {
    "$karst" render planet -q --size 320x240 --pool 128 -o "$scratch/$1.png" --camera "$2" --view-distance "$3" --exposure "$4"
}
draw 1 60000,22000000,-120000,0,-90,50 4e7 -1
draw 2 60000,6770000,-120000,300,-45,60 4e6 -1
draw 3 60000,6375000,-120000,300,-20,60 2e5 auto
draw 4 57200,6369900,-114200,300,-12,60 6e4 auto
montage "$scratch"/[1234].png -tile 4x1 -geometry +2+2 -strip "$out"
