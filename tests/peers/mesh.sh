#!/bin/sh
# Meshes against other programs' view of them: trimesh (is it watertight, turned the right way, of the right volume?) and
# PyMCubes (how many densities do the same grid and marching cubes take, and how long?). PYTHON names an interpreter that has numpy,
# trimesh and PyMCubes; what is missing is skipped. $KARST is the program. Not part of `make check`.
set -u
. tests/tap.sh
karst=${KARST:-build/karst}
python=${PYTHON:-python3}
scratch=$(mktemp -d) || exit 1
trap 'rm -rf "$scratch"' EXIT

cat > "$scratch/bumps.karst" << 'END'
/*{ "voxel": 0.125 }*/
float density(vec3 p) { return 80.0 - length(p) + 3.0 * sin(0.3 * p.x) * sin(0.3 * p.y) * sin(0.3 * p.z); }
END
if ! "$python" -c 'import numpy, trimesh' 2> /dev/null; then
    skip "trimesh" "$python has no numpy and trimesh: python3 -m venv ENV; ENV/bin/pip install trimesh PyMCubes; PYTHON=ENV/bin/python"
    finish
fi
for suffix in ply obj glb; do
    detail=$("$karst" mesh "$scratch/bumps.karst" --box -100,-100,-100,100,100,100 --voxel 1 -o "$scratch/bumps.$suffix" --json 2>&1 |
        tee "$scratch/json" && "$python" - "$scratch/bumps.$suffix" 2>&1 << 'END'
import sys, numpy, trimesh
mesh = trimesh.load(sys.argv[1], force="mesh", process=False)
print(len(mesh.vertices), "vertices, volume", mesh.volume)
p = numpy.array(mesh.vertices, float)
if sys.argv[1].endswith(".glb"):
    p[:, 2] *= -1
p -= 100
d = 80 - numpy.linalg.norm(p, axis=1) + 3 * numpy.prod(numpy.sin(0.3 * p), axis=1)
print("farthest from the surface", abs(d).max())
ok = mesh.is_watertight and mesh.is_winding_consistent and mesh.body_count == 1 and mesh.euler_number == 2
sys.exit(not (ok and abs(d).max() < 0.02 and abs(mesh.volume / (4 / 3 * numpy.pi * 80**3) - 1) < 0.01))
END
    )
    result "trimesh: a .$suffix is one closed surface, where it should be"
done

if ! "$python" -c 'import mcubes' 2> /dev/null; then
    skip "PyMCubes" "$python has none"
    finish
fi
figures=$("$python" - "$scratch/json" 2>&1 << 'END'
import json, sys, time, numpy, mcubes
facts = json.load(open(sys.argv[1]))
ours = facts["seconds"]
start = time.perf_counter()
x, y, z = numpy.meshgrid(*[numpy.arange(-100, 101, dtype=numpy.float32)] * 3, indexing="ij")
d = 80 - numpy.sqrt(x * x + y * y + z * z) + 3 * numpy.sin(0.3 * x) * numpy.sin(0.3 * y) * numpy.sin(0.3 * z)
mcubes.marching_cubes(d, 0)
theirs = time.perf_counter() - start
print("karst %.2f s, %d samples; PyMCubes %.2f s with numpy's evaluation, %d samples" % (ours, facts["samples"], theirs, d.size))
sys.exit(facts["samples"] > d.size / 2)
END
)
result "PyMCubes needs more than twice the samples"
echo "# $figures"
finish
