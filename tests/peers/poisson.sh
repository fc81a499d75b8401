#!/bin/sh
# Models of points against Open3D's Poisson reconstruction at depth 9, on the same points of a sphere, a torus and a gyroid: rms distance of the
# surfaces to the truth, in spacings, and memory. Open3D gets the true normals, Karst finds its own. PYTHON names an interpreter that has numpy
# and open3d; without it all is skipped. POINTS: how many (100000). $KARST is the program. Not part of `make check`.
set -u
. tests/tap.sh
karst=${KARST:-build/karst} python=${PYTHON:-python3} points=${POINTS:-100000}
scratch=$(mktemp -d) || exit 1
trap 'rm -rf "$scratch"' EXIT
if ! "$python" -c 'import numpy, open3d' 2> "$scratch/why"; then
    skip "Open3D" "$(tail -n 1 "$scratch/why"): python3 -m venv ENV; ENV/bin/pip install open3d; PYTHON=ENV/bin/python"
    finish
fi
cat > "$scratch/compare.py" << 'END'
"""compare.py KARST FOLDER SURFACE POINTS NOISE: rms of both in spacings, and the MiB that both took, on one line."""
import json, os, resource, subprocess, sys

def run(*command):
    """What it prints, and its MiB. A process of little memory starts it: what one that starts another has counts as that one's, too."""
    small = "import resource, subprocess, sys; subprocess.run(sys.argv[1:], check=True); " \
            "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"
    told = subprocess.run([sys.executable, "-S", "-c", small, *command], check=True, capture_output=True, text=True).stdout
    return told[: told.rstrip().rfind("\n") + 1], float(told.split()[-1]) / 1024

import numpy

karst, folder, surface, num, noise = sys.argv[1], sys.argv[2], sys.argv[3], int(sys.argv[4]), float(sys.argv[5])

def truth(p):
    """Value, negative outside, and gradient."""
    if surface == "sphere":
        r = numpy.linalg.norm(p, axis=1)
        return 1 - r, -p / r[:, None]
    if surface == "torus":
        ring = numpy.hypot(p[:, 0], p[:, 2])
        x = ring - 1
        r = numpy.hypot(x, p[:, 1])
        return 0.4 - r, -numpy.stack([x / r * p[:, 0] / ring, p[:, 1] / r, x / r * p[:, 2] / ring], 1)
    s, c = numpy.sin(3 * p), numpy.cos(3 * p)
    value = s[:, 0] * c[:, 1] + s[:, 1] * c[:, 2] + s[:, 2] * c[:, 0]
    return value, 3 * numpy.stack([c[:, i] * c[:, (i + 1) % 3] - s[:, (i + 2) % 3] * s[:, i] for i in range(3)], 1)

half = {"sphere": 1.05, "torus": 1.45, "gyroid": numpy.pi / 3}[surface]
area = {"sphere": 4 * numpy.pi, "torus": 1.6 * numpy.pi**2, "gyroid": 3.0915 * (2 * numpy.pi / 3) ** 2}[surface]
spacing = (area / num) ** 0.5
random, places = numpy.random.default_rng(1), []
while sum(map(len, places)) < num: # from a layer of even thickness along the gradient, so that they are spread evenly
    p = random.uniform(-half, half, (5 * num, 3))
    for step in range(6):
        value, gradient = truth(p)
        square = (gradient**2).sum(1)
        keep = abs(value) < (0.02 if step == 0 else 1) * square**0.5
        p = (p - (value / square)[:, None] * gradient)[keep]
    places.append(p)
p = numpy.concatenate(places)[:num]
gradient = truth(p)[1]
normals = -gradient / numpy.linalg.norm(gradient, axis=1)[:, None]
p = p + noise * spacing * random.normal(size=p.shape)
path = os.path.join(folder, "cloud.ply")
with open(path, "wb") as file:
    file.write(b"ply\nformat binary_little_endian 1.0\nelement vertex %d\n" % num)
    file.write(b"property double x\nproperty double y\nproperty double z\nend_header\n")
    file.write(p.astype("<f8").tobytes())

def rms(at):
    """Of what is not at the edges of an open surface; away from it counts, up to where it is no part of it."""
    value, gradient = truth(at)
    length = numpy.linalg.norm(gradient, axis=1)
    near = abs(value / length) < 10 * spacing
    if surface == "gyroid":
        near &= (abs(at) < half - 0.06).all(1)
    assert near.sum() > 1000
    return float(numpy.sqrt(((value / length)[near] ** 2).mean()) / spacing)

def mib(who):
    return resource.getrusage(who).ru_maxrss / 1024

# Karst: imported, and points on what a world shows of it. A model is a crust, so the world's text has what is inside, but for a layer of a spacing
# and a half: where crusts end, there is no surface. Which side of an open surface is the outer one, points do not tell.
bodies = {"sphere": "1.0 - length(p)", "torus": "0.4 - length(vec2(length(p.xz) - 1.0, p.y))",
          "gyroid": "%d.0 * (sin(3.0 * p.x) * cos(3.0 * p.y) + sin(3.0 * p.y) * cos(3.0 * p.z) + sin(3.0 * p.z) * cos(3.0 * p.x))"}
slopes = {"gyroid": "3.0 * length(vec3(cos(3.0 * p.x) * cos(3.0 * p.y) - sin(3.0 * p.z) * sin(3.0 * p.x), "
                    "cos(3.0 * p.y) * cos(3.0 * p.z) - sin(3.0 * p.x) * sin(3.0 * p.y), "
                    "cos(3.0 * p.z) * cos(3.0 * p.x) - sin(3.0 * p.y) * sin(3.0 * p.z)))"}
model, world, found = (os.path.join(folder, name) for name in ("cloud.karstpoints", "world.karst", "found.ply"))
_, ours_mib = run(karst, "import", path, "--axes", "karst", "-q", "-o", model)
centre = json.loads(run(karst, "info", model, "--json")[0])["centre"]
box, errors = half + 0.05, []
for side in (1, -1) if surface == "gyroid" else (1,):
    with open(world, "w") as file:
        file.write('/*{ "voxel": 0.0009765625, "models": [{ "points": "cloud.karstpoints", "at": ["%.12f", "%.12f", "%.12f"] }] }*/\n'
                   % tuple(centre))
        file.write("float density(vec3 p) { return %s - %.9f * %s; }\n" % (
            bodies[surface] % side if surface == "gyroid" else bodies[surface], 1.5 * spacing, slopes.get(surface, "1.0")))
    run(karst, "points", world, "--box", ",".join(["%g" % -box] * 3 + ["%g" % box] * 3), "--spacing", "%g" % spacing, "-q", "-o", found)
    head, data = open(found, "rb").read().split(b"end_header\n", 1)
    properties = [line.split() for line in head.decode().splitlines() if line.startswith("property")]
    layout = numpy.dtype([(name, {"float": "<f4", "double": "<f8", "uchar": "u1"}[kind]) for word, kind, name in properties])
    record = numpy.frombuffer(data, layout)
    errors.append(rms(numpy.stack([record[a].astype(float) for a in "xyz"], 1) - box))
ours = min(errors)

# Open3D, whose own weight before it has any points is not counted.
import open3d
before_mib = mib(resource.RUSAGE_SELF)
cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(p))
cloud.normals = open3d.utility.Vector3dVector(normals)
mesh, weights = open3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=9)
theirs_mib = mib(resource.RUSAGE_SELF) - before_mib
theirs = rms(numpy.asarray(mesh.vertices))
print("%.4f %.4f %.1f %.1f" % (ours, theirs, ours_mib, theirs_mib))
END
for noise in 0 0.25; do
    for surface in sphere torus gyroid; do
        figures=$("$python" "$scratch/compare.py" "$karst" "$scratch" $surface "$points" $noise 2> "$scratch/talk")
        detail=$(cat "$scratch/talk")
        echo "$figures" | awk '{ exit !(NF == 4 && $1 <= $2) }'
        result "$surface, noise $noise: rms $(echo "$figures" | cut -d' ' -f1) spacings, Open3D $(echo "$figures" | cut -d' ' -f2)"
        echo "$figures" | awk '{ exit !(NF == 4 && $3 <= $4 / 4) }'
        result "$surface, noise $noise: $(echo "$figures" | cut -d' ' -f3) MiB, Open3D $(echo "$figures" | cut -d' ' -f4)"
    done
done
finish
