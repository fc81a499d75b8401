#!/bin/sh
# karst check and karst sample from outside: neither needs a device, though check asks its compiler where there is one.
set -u
. tests/tap.sh
. tests/cli/calls.sh
unset NO_COLOR
: > stdin
input=stdin

# prints NAME PATTERN...: the last run succeeded, and each pattern is on stdout.
prints()
{
    name=$1 missing=
    shift
    [ $status -eq 0 ] || missing="exit $status"
    for pattern in "$@"; do grep -qE -e "$pattern" stdout || missing="$missing '$pattern'"; done
    detail="$detail; missing: $missing"
    [ -z "$missing" ]
    result "$name"
}

cat > plain.karst << 'END'
/*{ "name": "Plain", "author": "N. N.", "voxel": 0.5, "colour_of_the_sky": 3,
    "params": { "height": { "value": 8, "min": 0, "max": 20, "unit": "m" }, "rounds": 2 } }*/
float density(vec3 p) {
    float d = height - p.y;
    for (int i = 0; i < int(rounds); i++) d += 0.25;
    return d + fract(p.x / 3.0) + noise(p.xz * 4.0);
}
END
cat > coloured.karst << 'END'
float density(vec3 p) { return 4.0 - length(p); }
vec3 colour(vec3 p, vec3 n) { return 0.5 + 0.5 * n; }
END
printf 'float density(vec3 p) {\n    return hieght(p);\n}\nfloat height(vec3 p) { return -p.y; }\n' > wrong.karst

# ---- check ----
run check --help
prints "check --help: options, worlds, examples" "--param" "alps" "karst check mine.karst" "Exit code"
run check plain.karst
prints "check: what there is to say" "^plain.karst:1:.*warning: .*colour_of_the_sky" "Plain, by N. N." "voxel 0.5 m" \
    "parameter height = 8 m" "rounds = 2, decides the program" "noise, 1 octave, separable" "Lipschitz" "bounded: " \
    "estimated cost: .* a voxel" "estimated cost of bounds: .* a node"
[ ! -s stderr ]
result "check: it says so on stdout"
run check plain.karst --param height=3 --param rounds=40
prints "check --param" "parameter height = 3 m" "longest loop 40 rounds"
run check -q plain.karst
[ $status -eq 0 ] && [ ! -s stdout ] && grep -q 'colour_of_the_sky' stderr
result "check -q: warnings, and nothing else"
printf 'float density(vec3 p) { return p.x / p.y; }\n' > divides.karst
run check divides.karst
prints "check: what cannot be bounded, and why" "not bounded: line 1 divides by what may be 0"
run check coloured.karst
prints "check: the device's compiler is asked" "the device's compiler takes it"
OCL_ICD_VENDORS=/nonexistent run check coloured.karst
prints "check: without a device the rest holds" "voxel" "not tried: no OpenCL device"
run check plain.karst --device nosuch
[ $status -eq 3 ] && grep -q '^karst: .*nosuch' stderr
result "check: a device that is named must be there"
complains 4 "wrong.karst:2:12: .*hieght" "check: a world that does not compile" check wrong.karst
grep -q '    return hieght(p);' stderr && grep -q '^  *^' stderr && grep -q "did you mean 'height'" stderr
result "check: the line, a caret and a suggestion"
[ "$(head -n 1 stderr | cut -d : -f 1-4)" = "wrong.karst:2:12: error" ] && [ "$(grep -c '2:12' stderr)" -eq 1 ]
result "check: a mistake is said once, in a form that editors follow"
complains 4 "^wrong.karst:2:12: error: " "render: a mistake likewise" render wrong.karst --display none
[ "$(grep -c '2:12' stderr)" -eq 1 ]
result "render: a mistake is said once"
complains 4 "did you mean 'alps'" "check: a misspelt world" check alp
complains 4 "no-such.karst" "check: a file that is not there" check no-such.karst
complains 4 "regular file" "check: a folder" check ./
complains 4 "hight" "check: an unknown parameter" check plain.karst --param hight=3
complains 4 "there are: height, rounds" "check: a parameter like none" check plain.karst --param snow=3
complains 2 "which world" "check: no world" check
complains 2 "did you mean --param" "check: a misspelt option" check plain.karst --parm a=1
for world in "$KARST_DATA_DIR"/worlds/*.karst; do
    run check "$(basename "$world" .karst)"
    [ $status -eq 0 ] || break
done
result "check: every shipped world, by name"

# ---- hostile files: more of them are in tests/language/hostile_texts.h ----
printf 'float density(vec3 p) {\n    for (;;) p.x += 1.0;\n    return p.x;\n}\n' > endless.karst
printf '#define A p.x+p.x\n#define B A+A+A+A+A+A+A+A\n' > bomb.karst
for i in 1 2 3 4 5 6 7 8 9; do printf '#define B%d B%s+B%s+B%s+B%s\n' $i $((i - 1)) $((i - 1)) $((i - 1)) $((i - 1)); done |
    sed 's/B0/B/g' >> bomb.karst
printf 'float density(vec3 p) { return B9; }\n' >> bomb.karst
printf 'float density(vec3 p) { return \0p.y; }\n' > nul.karst
: > empty.karst
for file in endless:2:5 bomb:12:32 nul:1:32 empty:1:1; do
    complains 4 "${file%%:*}.karst:${file#*:}: " "hostile: ${file%%:*}" check "${file%%:*}.karst"
    complains 4 "${file%%:*}.karst:${file#*:}: " "hostile: ${file%%:*}, rendered" render "${file%%:*}.karst" --display none
    [ ! -e out.png ]
    result "hostile: ${file%%:*}: no picture"
done

# ---- sample ----
run sample --help
prints "sample --help: options, worlds, examples" "--at" "--box" "--footprint" "--json" "alps" "karst sample hills --at" \
    "Exit code"
run sample plain.karst --at 0,2,0
prints "sample: a point" "^at +0, 2, 0 m" "^density +6.5 .*solid" "^oracle +6.5$" "^gradient .*per m"
# 10^18 + 1 is 2 more than a multiple of 3; on lattice points the noise is 0.
run sample plain.karst --at 1000000000000000001,8.5,0.25 --json
prints "sample: coordinates are exact, however far" '"at":\["1000000000000000001","8.5","0.25"\]' '"density":0.6666[0-9]*,' \
    '"oracle":0.66666666[0-9]*,' '"density_hex":"0x1.5555[0-9a-f]*p-1"'
run sample plain.karst --at 0.1,1e-3,-.5 --json
prints "sample: what lies between voxels is rounded to 2^-32 of one, and said" \
    '"at":\["0.0999999999767169356346130371093?7?5?"|"at":\["0.1000' '"footprint_m":0.0' '"level":-1'
run sample plain.karst --at 0,2,0 --json --box 2 --footprint 4
prints "sample --box, --footprint" '"footprint_m":4.0,"level":3' '"box_m":2.0,"bounds":\[[0-9.e-]+,[0-9.e-]+\]'
lower=$(sed 's/.*"bounds":\[\([^,]*\),.*/\1/' stdout) upper=$(sed 's/.*"bounds":\[[^,]*,\([^]]*\)].*/\1/' stdout)
detail="bounds $lower to $upper"
awk "BEGIN { exit !($lower <= 5.5 && $lower > 2 && $upper >= 8.1 && $upper < 11) }"
result "sample: bounds hold what is in the box, and little more"
run sample coloured.karst --at 0,4,0 --json
prints "sample: colour and gradient" '"gradient":\[-?0.0,-1.0,-?0.0\]' '"colour":\[0.5,1.0,0.5\]'
run sample plain.karst --at 0,2,0 --param height=12 --json
prints "sample --param" '"density":10.5'
run sample hills --at 7,300,9 --json
cp stdout first
run sample hills --at 7,300,9 --json --seed 99
! cmp -s first stdout
result "sample --seed: another world"
run sample divides.karst --at 1,0,1 --json --box 1
prints "sample: what is not finite is null" '"density":null' '"density_hex":"inf"' '"bounds":\[null,null\]'
run sample plain.karst --at 0,1,0 --at 0,2,0 --at 0,3,0 --json
[ $status -eq 0 ] && [ "$(sed 's/.*"density":\([^,]*\),.*/\1/' stdout | tr '\n' ' ')" = "7.5 6.5 5.5 " ]
result "sample: several points, in order"
printf '0,1,0\n\n  0 , 2 , 0  \n0 3 0\n0\t4\t0' > stdin
run sample plain.karst --json
[ $status -eq 0 ] && [ "$(sed 's/.*"density":\([^,]*\),.*/\1/' stdout | tr '\n' ' ')" = "7.5 6.5 5.5 4.5 " ]
result "sample: points from stdin"
run sample plain.karst --at 0,0,0 --at - --json
[ $status -eq 0 ] && [ "$(wc -l < stdout)" -eq 5 ]
result "sample --at -: stdin among others"
printf '0,1,0\n0,1\n' > stdin
run sample plain.karst --json
[ $status -eq 5 ] && [ "$(wc -l < stdout)" -eq 1 ] && grep -q 'stdin:2: a point is X,Y,Z' stderr
result "sample: a line that is no point is named; what came before is there"
: > stdin
input=stdin
complains 2 "no point was given" "sample: no point" sample plain.karst
complains 2 "a point is X,Y,Z" "sample: a point of four" sample plain.karst --at 1,2,3,4
complains 2 "y: .*not a decimal" "sample: a point with a gap" sample plain.karst --at 1,,3
complains 2 "not a decimal" "sample: a point that is no number" sample plain.karst --at 1,2,x
complains 2 "." "sample: a point beyond the world" sample plain.karst --at 1e30,0,0
complains 2 "number from 0" "sample: a negative footprint" sample plain.karst --at 0,0,0 --footprint -1
complains 2 "six numbers" "sample: a ray of a point alone" sample plain.karst --ray 1,2,3
complains 2 "six numbers" "sample: a ray in a direction that is no number" sample plain.karst --ray 1,2,3,0,nan,0
complains 2 "not all of them 0" "sample: a ray that goes nowhere" sample fog --ray 1,2,3,0,0,0
complains 2 "has no medium" "sample: a ray where there is none" sample plain.karst --ray 1,2,3,0,1,0
complains 2 "goes with" "sample: a ray and a point" sample plain.karst --ray 1,2,3,0,1,0 --at 0,0,0
cat > slab.karst << 'END'
/*{ "voxel": 1, "view": 500 }*/
float density(vec3 p) { return -p.y; }
medium air(vec3 p) { medium m; m.extinction = 0.01 * clamp(20.5 - p.y, 0.0, 1.0); return m; }
END
run sample slab.karst --ray 0,100,0,0,-1,0 --footprint 1 --json
prints "sample: through a slab of fog to the ground" '"hit_m":(100\.0|99\.99)' '"optical_depth":0\.(2000|1999)' \
    '"oracle_optical_depth":0\.(2000|1999)' '"transmittance":0\.8186'
run sample slab.karst --ray 0,100,0,0,1,0
prints "sample: a ray into the open sky" 'hit +none within 500 m' 'optical depth +0$' 'transmittance +1$'
printf 'x,y,z,radius,extinction\n0,5,0,2,0.5\n3,5,0,2,0.5\n' > balls.csv
cat > balls.karst << 'END'
/*{ "voxel": 0.125, "view": 60, "particles": [{ "file": "balls.csv" }] }*/
float density(vec3 p) { return -p.y; }
medium air(vec3 p) { medium m; m.extinction = 0.0; return m; }
END
run sample balls.karst --ray=-9,5,0,1,0,0 --json
prints "sample: two balls that overlap" '"oracle_optical_depth":3\.5(0000)?[,}]'
complains 2 "time" "sample: a time that is no number" sample balls.karst --ray=-9,5,0,1,0,0 --time nan
printf 'x,y,z,radius,extinction,vx,vy,vz\n0,5,0,2,0.5,0,0,0\n3,5,0,2,0.5,4,0,0\n' > balls.csv
run render balls.karst -q --time-step 1 --frames 2 --time -1 -o 'balls%d.png' --size 48x32 --samples 1 --display none \
    --camera=0,5,-14,0,0
first=$(cksum < balls0.png) second=$(cksum < balls1.png)
run render balls.karst -q --time 0 -o balls.png --size 48x32 --samples 1 --display none --camera=0,5,-14,0,0
[ $status -eq 0 ] && [ "$first" != "$second" ] && [ "$second" = "$(cksum < balls.png)" ]
result "render --time-step: pictures of a time each"
echo '/*{"voxel":0.0625}*/ float density(vec3 p) { return 4.0 * sin(iTime) - length(p); }' > waxing.karst
run sample waxing.karst --at 0,0,0 --param iTime=3
prints "iTime is a parameter" '^density    0.5644'
run check waxing.karst --param iTime=3
prints "check says what it is" 'input iTime is 3 here'
complains 2 'times go from' "no time is as late as that" render waxing.karst --param iTime=1e12 -o waxing.png
told=
for time in '--time 1.2' '--param iTime=1.2' '--time 0.1 --param iTime=1.2' '--time 0.1'; do
    run render waxing.karst -q --size 24x18 --samples 1 --display none --no-shadows --camera=0,2,-12,0,-8 $time -o waxing.png
    told="$told $(tail -c 60 waxing.png | cksum | cut -d ' ' -f 1)" # the last pixels, and a sum of all
done
set -- $told
detail=$told
[ "$1" = "$2" ] && [ "$3" = "$4" ] && [ "$1" != "$3" ]
result "a picture at the time that a parameter says, or --time, if both do"
run render balls.karst -q --six-way 'maps_%s.exr' --time-step 1 --frames 3 --size 16x12 --samples 1 --display none \
    --camera=0,5,-14,0,0
[ $status -eq 0 ] && [ -s maps_positive.exr ] && [ -s maps_negative.exr ] && ! cmp -s maps_positive.exr maps_negative.exr
result "render --six-way: two sheets of light maps"
complains 2 "smoke_%s.exr" "render: light maps without two names" render balls.karst --six-way maps.exr
complains 2 "how far apart" "render: light maps of moments at no time" render balls.karst --six-way 'm_%s.exr' --frames 3
complains 2 "\-\-output is not for them" "render: light maps and a picture" render balls.karst --six-way 'm_%s.exr' -o a.png
complains 2 "nothing in its air" "render: light maps of a world without media" render plain.karst --six-way 'm_%s.exr' \
    --size 16x12 --display none
printf 'x,y,z,radius,extinction\n0,5,0,2,0.5\n3,5,zero,2,0.5\n' > balls.csv
complains 5 "balls.csv:3" "sample: a line that is no particle" sample balls.karst --ray=-9,5,0,1,0,0
complains 2 "how many pictures" "render: a time that goes for nobody" render balls.karst --time-step 0.1
complains 4 "wrong.karst:2:12" "sample: a world that does not compile" sample wrong.karst --at 0,0,0
complains 4 "did you mean 'alps'" "sample: a misspelt world" sample alp --at 0,0,0
complains 2 "which world" "sample: no world" sample --at 0,0,0
finish
