#!/bin/sh
# The viewer's picture and clip for the README: demos/desktop/pictures.sh KARST FOLDER
# In an X server of its own, with real keys. Needs Xvfb, xdotool, ImageMagick and ffmpeg.
set -eu
karst=$1 folder=$2
scratch=$(mktemp -d)
viewer= server=
end()
{
    kill $viewer 2> /dev/null && wait $viewer || true
    kill $server 2> /dev/null || true
    rm -rf "$scratch"
}
trap end EXIT
export XDG_STATE_HOME="$scratch" XDG_CONFIG_HOME="$scratch"

Xvfb -displayfd 3 -screen 0 1280x1024x24 -nolisten tcp -noreset 3> "$scratch/display" 2> /dev/null &
server=$!
for i in $(seq 100); do
    [ -s "$scratch/display" ] && break
    sleep 0.1
done
DISPLAY=:$(cat "$scratch/display")
export DISPLAY

# wait_for NAME VALUE: until the statistics say so.
wait_for()
{
    for i in $(seq 300); do
        rm -f "$scratch/stats.json"
        xdotool key F3
        sleep 0.4
        grep -q "\"$1\": $2" "$scratch/stats.json" 2> /dev/null && return
    done
    echo "the viewer never says $1 $2" >&2
    exit 1
}

"$karst" view hills -q --size 960x600 --camera 1500,420,-800,20,-14 --stats "$scratch/stats.json" &
viewer=$!
xdotool mousemove 480 300
wait_for settled true
xdotool key p key Tab key Tab
wait_for page '"cache"'
wait_for settled true
sleep 1
import -window root -crop 960x600+0+0 +repage "$scratch/view.png"
convert "$scratch/view.png" -strip "$folder/view.png"

# The clip: a turn and some steps, smaller.
xdotool key Tab key Tab key p
xdotool search --onlyvisible --class karst windowsize 480 300
xdotool mousemove 240 150
wait_for settled true
ffmpeg -v error -y -f x11grab -draw_mouse 0 -framerate 12 -video_size 480x300 -i "$DISPLAY" -t 5 "$scratch/clip.mkv" &
clip=$!
sleep 0.5
xdotool keydown w
sleep 1.5
xdotool keydown Right
sleep 1.2
xdotool keyup Right
sleep 0.6
xdotool keyup w
wait $clip
ffmpeg -v error -y -i "$scratch/clip.mkv" -filter_complex \
    '[0:v]scale=400:-1:flags=lanczos,split[a][b];[a]palettegen=max_colors=96[p];[b][p]paletteuse=dither=bayer:bayer_scale=4' \
    "$folder/view.gif"
