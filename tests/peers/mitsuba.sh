#!/bin/sh
# Full light against Mitsuba 3: a diffuse and a glass scene of spheres and a plane, which both can state exactly. The mean
# radiance must agree within 1 %, and the variance of a path must not be larger. PYTHON names an interpreter that has mitsuba
# and numpy; what is missing is skipped. $KARST is the program. Not part of `make check`.
set -u
. tests/tap.sh
karst=${KARST:-build/karst}
python=${PYTHON:-python3}
scratch=$(mktemp -d) || exit 1
trap 'rm -rf "$scratch"' EXIT

if ! "$python" -c 'import numpy, mitsuba' 2> /dev/null; then
    skip "mitsuba" "$python has no mitsuba: python3 -m venv ENV; ENV/bin/pip install mitsuba numpy; PYTHON=ENV/bin/python"
    finish
fi

# The eye looks down, so that no ray sees where the plane ends.
head='/*{ "voxel": 0.00390625, "view": 400, "sun": { "colour": [0, 0, 0] },
"sky": { "zenith": [1, 1, 1], "horizon": [1, 1, 1], "haze": 1e12 },
"camera": { "position": ["0", "4", "-5"], "pitch": -38, "fov": 40 } }*/'
cat > "$scratch/diffuse.karst" << END
$head
float density(vec3 p) { return max(-p.y, max(1.0 - length(p - vec3(0.0, 1.0, 0.0)), 0.5 - length(p - vec3(0.0, 0.5, -1.6)))); }
vec3 colour(vec3 p, vec3 n) { return vec3(0.5); }
END
cat > "$scratch/glass.karst" << END
$head
float density(vec3 p) { return max(-p.y, 0.5 - length(p - vec3(0.0, 0.5, 1.8))); }
vec3 colour(vec3 p, vec3 n) { return vec3(0.5); }
float clear(vec3 p) { return 1.0 - length(p - vec3(0.0, 1.1, -0.4)); }
material clear_surface(vec3 p, vec3 n) { material m; m.ior = 1.5; return m; }
END
cat > "$scratch/compare.py" << 'END'
import math, sys
import numpy as np, mitsuba as mi
mi.set_variant("scalar_rgb")
scratch, name, few = sys.argv[1], sys.argv[2], int(sys.argv[3])
def ball(centre, radius, bsdf):
    return {"type": "sphere", "center": centre, "radius": radius, "bsdf": bsdf}
def diffuse(albedo):
    return {"type": "diffuse", "reflectance": {"type": "rgb", "value": albedo}}
T = mi.ScalarTransform4f
pitch = math.radians(38)
scene = {
    "type": "scene", "integrator": {"type": "path", "max_depth": 65, "rr_depth": 3},
    "sky": {"type": "constant", "radiance": {"type": "rgb", "value": 1.0}},
    "sensor": {"type": "perspective", "fov": 40, "fov_axis": "y",
               "to_world": T().look_at(origin=[0, 4, -5], target=[0, 4 - math.sin(pitch), -5 + math.cos(pitch)], up=[0, 1, 0]),
               "film": {"type": "hdrfilm", "width": 64, "height": 48, "rfilter": {"type": "box"}, "component_format": "float32"}},
    "plane": {"type": "rectangle", "bsdf": diffuse(0.5),
              "to_world": T().rotate(axis=[1, 0, 0], angle=-90) @ T().scale(400)},
}
if name == "diffuse":
    scene["a"], scene["b"] = ball([0, 1, 0], 1, diffuse(0.5)), ball([0, 0.5, -1.6], 0.5, diffuse(0.5))
else:
    scene["a"] = ball([0, 1.1, -0.4], 1, {"type": "dielectric", "int_ior": 1.5, "ext_ior": 1.0})
    scene["b"] = ball([0, 0.5, 1.8], 0.5, diffuse(0.5))
scene = mi.load_dict(scene)
def theirs(spp, seed):
    return np.array(mi.render(scene, spp=spp, seed=seed))[..., 0]
def ours(samples):
    bitmap = mi.Bitmap(f"{scratch}/{name}-{samples}.exr")
    names = [bitmap.struct_()[i].name for i in range(bitmap.channel_count())]
    return np.array(bitmap)[..., names.index("R")].astype(float)
truth, full = theirs(512, 1), ours(512)
ratio = full.mean() / truth.mean()
# Samples of a pixel's sequence are better spread than independent ones, which is theirs to use, too: so both draw as many
# as they would for a picture. Each against its own mean of many.
spread_ours = np.mean((ours(few) - full) ** 2) * few
spread_theirs = np.mean([np.mean((theirs(few, 7 + i) - truth) ** 2) * few for i in range(4)])
apart = np.abs(full - truth).reshape(12, 4, 16, 4).mean(axis=(1, 3)).max() / truth.mean()
print("mean %.5f, theirs %.5f (%.2f %%); of 4x4 pixels at most %.1f %% apart; variance of a path %.5f, theirs %.5f" %
      (full.mean(), truth.mean(), 100 * (ratio - 1), 100 * apart, spread_ours, spread_theirs))
sys.exit(not (abs(ratio - 1) < 0.01 and spread_ours <= spread_theirs))
END
few=16 # samples of a pixel
for scene in diffuse glass; do
    for samples in $few 512; do
        "$karst" render "$scratch/$scene.karst" -q --light full --samples $samples --size 64x48 --aov radiance \
            --pool 128 -o "$scratch/$scene-$samples.exr" > "$scratch/log" 2>&1 || { sed 's/^/# /' "$scratch/log"; break; }
    done
    figures=$("$python" "$scratch/compare.py" "$scratch" $scene $few 2>&1)
    result "$scene: the mean radiance is Mitsuba's within 1 %, the variance of a path not larger"
    echo "$figures" | sed "s/^/# /"
done
finish
