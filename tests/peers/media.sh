#!/bin/sh
# Light in media against others' programs: slabs in full light against adding and doubling (iadpython, after S. Prahl); a
# cloud under an even sky in full light, and in the sun with light that is scattered once, against Mitsuba 3's volpath.
# PYTHON names an interpreter that has mitsuba and numpy, and iadpython for the slabs; what is missing is skipped. $KARST
# is the program; DEPTHS and FORWARD name the slabs. Not part of `make check`.
set -u
. tests/tap.sh
karst=${KARST:-build/karst}
python=${PYTHON:-python3}
scratch=$(mktemp -d) || exit 1
trap 'rm -rf "$scratch"' EXIT

if ! "$python" -c 'import numpy, mitsuba' 2> /dev/null; then
    skip "media" "$python has no mitsuba: python3 -m venv ENV; ENV/bin/pip install mitsuba numpy scipy iadpython; PYTHON=ENV/bin/python"
    finish
fi
render() { "$karst" render "$@" -q --aov radiance --pool 256 > "$scratch/log" 2>&1 || sed 's/^/# /' "$scratch/log"; }

# ---- slabs ----

# In a shell that shines in its upper half: what comes from a slab straight up is what it reflects of light that falls
# on it straight, and what comes straight down, what it lets through.
cat > "$scratch/slab.karst" << 'END'
/*{ "voxel": 0.03125, "view": 200, "sun": { "colour": [0, 0, 0] },
"params": { "depth": { "value": 1, "min": 0, "max": 100 }, "forward": { "value": 0, "min": -1, "max": 1 } },
"sky": { "zenith": [0, 0, 0], "horizon": [0, 0, 0], "haze": 1e12 },
"camera": { "position": ["0", "3", "0"], "pitch": -90, "fov": 1 } }*/
float density(vec3 p) { return length(p) - 60.0; }
material surface(vec3 p, vec3 n) { material m; m.colour = vec3(0.0); m.emission = vec3(p.y > 0.0 ? 1.0 : 0.0); return m; }
medium air(vec3 p) { medium m; m.extinction = depth * clamp(32.0 * (0.5 - abs(p.y)) + 0.5, 0.0, 1.0) * (length(p.xz) < 59.0 ? 1.0 : 0.0); m.albedo = vec3(0.9); m.g = forward; return m; }
END
cat > "$scratch/slab.py" << 'END'
import sys
import numpy as np, mitsuba as mi, iadpython
mi.set_variant("scalar_rgb")
scratch, depth, g = sys.argv[1], float(sys.argv[2]), float(sys.argv[3])
def mean(side):
    bitmap = mi.Bitmap(f"{scratch}/{side}.exr")
    names = [bitmap.struct_()[i].name for i in range(bitmap.channel_count())]
    return np.array(bitmap)[..., names.index("R")].astype(float)
up, down = mean("up"), mean("down")
UR1, UT1, URU, UTU = iadpython.Sample(a=0.9, b=depth, g=g, n=1, quad_pts=16).rt()
def noise(x):
    return x.std() / np.sqrt(x.size)
print("depth %g, g %g: reflected %.5f of %.5f +- %.5f, let through %.5f of %.5f +- %.5f" %
      (depth, g, up.mean(), UR1, noise(up), down.mean(), UT1, noise(down)))
# Where next to nothing comes through, what some ten of all paths carry cannot be told from nothing.
def close(x, truth):
    return abs(x.mean() - truth) < max(0.01 * truth, 4 * noise(x), 10 / (64 * x.size))
sys.exit(not (close(up, UR1) and close(down, UT1)))
END
if "$python" -c 'import iadpython' 2> /dev/null; then
    for g in ${FORWARD:-0 0.85}; do
        for depth in ${DEPTHS:-0.1 1 3 10 30}; do
            set -- "$scratch/slab.karst" --light full --samples 64 --size 64x48 --param depth=$depth --param forward=$g
            render "$@" --camera 0,3,0,0,-90 -o "$scratch/up.exr"
            render "$@" --camera 0,-3,0,0,90 -o "$scratch/down.exr"
            "$python" "$scratch/slab.py" "$scratch" $depth $g > "$scratch/out" 2>&1
            result "a slab of depth $depth, g $g: within 1 % of adding and doubling"
            sed 's/^/# /' "$scratch/out"
        done
    done
else
    skip "slabs" "$python has no iadpython: ENV/bin/pip install scipy iadpython"
fi

# ---- a cloud ----

# $1: of the sun; $2: of the sky. The sun stands at the horizon: so the ground throws nothing back.
cloud()
{
    cat << END
/*{ "voxel": 0.015625, "view": 200, "sun": { "azimuth": 90, "elevation": 0, "colour": [$1, $1, $1] },
"sky": { "zenith": [$2, $2, $2], "horizon": [$2, $2, $2], "haze": 1e12 },
"camera": { "position": ["0", "0", "-6"], "fov": 40 } }*/
float density(vec3 p) { return -1.0; }
medium air(vec3 p) { medium m;
    m.extinction = 8.0 * clamp(1.4 - length(p) + 0.2 * sin(4.0 * p.x) * sin(4.0 * p.y) * sin(4.0 * p.z), 0.0, 1.0);
    m.albedo = vec3(0.9); m.g = 0.3; return m; }
END
}
cloud 0 1 > "$scratch/sky.karst"
cloud 1 0 > "$scratch/sun.karst"
cat > "$scratch/cloud.py" << 'END'
import math, os, sys, time
import numpy as np, mitsuba as mi
mi.set_variant("scalar_rgb")
scratch, name, ours_ms = sys.argv[1], sys.argv[2], float(sys.argv[3])
# The same grid as a place every 1/32 m has it; both interpolate it trilinearly.
side = 129
x = np.linspace(-2, 2, side)
X, Y, Z = np.meshgrid(x, x, x, indexing="ij")
grid = 8 * np.clip(1.4 - np.sqrt(X * X + Y * Y + Z * Z) + 0.2 * np.sin(4 * X) * np.sin(4 * Y) * np.sin(4 * Z), 0, 1)
grid = np.ascontiguousarray(grid.transpose(2, 1, 0)[..., None].astype(np.float32))
T = mi.ScalarTransform4f
# Their grid's samples lie in the middles of cells.
half = 2 * side / (side - 1)
box = T().translate([-half, -half, -half]) @ T().scale(2 * half)
light = ({"type": "constant", "radiance": {"type": "rgb", "value": 1.0}} if name == "sky" else
         {"type": "directional", "direction": [-1, 0, 0], "irradiance": {"type": "rgb", "value": math.pi}})
scene = mi.load_dict({
    "type": "scene", "light": light,
    "integrator": {"type": "volpath", "max_depth": 2 if name == "sun" else -1, "rr_depth": 1000},
    "sensor": {"type": "perspective", "fov": 40, "fov_axis": "y",
               "to_world": T().look_at(origin=[0, 0, -6], target=[0, 0, 0], up=[0, 1, 0]),
               "film": {"type": "hdrfilm", "width": 64, "height": 48, "rfilter": {"type": "box"}, "component_format": "float32"}},
    "cloud": {"type": "cube", "to_world": T().scale(half), "bsdf": {"type": "null"},
              "interior": {"type": "heterogeneous", "albedo": 0.9, "phase": {"type": "hg", "g": 0.3},
                           "sigma_t": {"type": "gridvolume", "grid": mi.VolumeGrid(grid), "to_world": box}}}})
def theirs(spp, seed): # x points to the left in their pictures
    return np.array(mi.render(scene, spp=spp, seed=seed))[:, ::-1, 0].astype(float)
bitmap = mi.Bitmap(f"{scratch}/{name}.exr")
names = [bitmap.struct_()[i].name for i in range(bitmap.channel_count())]
ours = np.array(bitmap)[..., names.index("R")].astype(float)
few, many = 64, int(os.environ.get("PATHS", 4096 if name == "sun" else 512))
theirs(1, 99) # what is compiled once
truth = np.mean([theirs(256, 1 + i) for i in range(many // 256)], axis=0)
start = time.perf_counter()
noisy = theirs(few, 1000)
took_ms = 1000 * (time.perf_counter() - start)
def rms(x): return np.sqrt(np.mean((x - truth) ** 2)) / truth.mean()
error = rms(noisy) / math.sqrt(1 + few / many)
noise = error * math.sqrt(few / many) # of the truth itself
own = math.sqrt(max(rms(ours) ** 2 - noise ** 2, 0))
print("%s: mean %.5f, theirs %.5f (%+.2f %%); rms %.2f %% beside %.2f %% of the truth's own noise; of theirs with %d paths a pixel %.2f %%" %
      (name, ours.mean(), truth.mean(), 100 * (ours.mean() / truth.mean() - 1), 100 * own, 100 * noise, few, 100 * error))
good = abs(ours.mean() / truth.mean() - 1) < 0.01
if name == "sun":
    own = max(own, noise) # what can be told
    needed_ms = took_ms * (error / own) ** 2
    print("an rms of %.2f %%: theirs needs %.0f ms, ours %.2f ms: %.0f times as long" % (100 * own, needed_ms, ours_ms, needed_ms / ours_ms))
    good = good and needed_ms >= 50 * ours_ms
sys.exit(not good)
END
render "$scratch/sky.karst" --light full --samples 256 --size 64x48 --detail 0.5 -o "$scratch/sky.exr"
"$python" "$scratch/cloud.py" "$scratch" sky 0 > "$scratch/out" 2>&1
result "full light in a cloud is within 1 % of volpath's"
sed 's/^/# /' "$scratch/out"
# A settled frame: rays are cast, shaded and marched anew.
set -- "$scratch/sun.karst" --scattering once --samples 1 --size 64x48 --detail 0.5
render "$@" -o "$scratch/sun.exr"
"$karst" bench "$scratch/sun.karst" --scattering once --size 64x48 --detail 0.5 --rounds 15 --runs 1 -q --json "$scratch/sun.json" \
    > "$scratch/log" 2>&1 || sed 's/^/# /' "$scratch/log"
frame_ms=$(awk -f tests/cli/flatten.awk "$scratch/sun.json" | sed 's/ = / /' |
    awk '$1 == "settled.time_ms.frame.median" { print $2; exit }')
"$python" "$scratch/cloud.py" "$scratch" sun "${frame_ms:-1e9}" > "$scratch/out" 2>&1
result "light scattered once is within 1 % of volpath's, at least 50 times as fast at the same rms"
sed 's/^/# /' "$scratch/out"
finish
