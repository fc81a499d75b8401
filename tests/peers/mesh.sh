#!/bin/sh
# Meshes against other programs' view of them: trimesh (is it watertight, turned the right way, of the right volume?) and
# PyMCubes (how many densities do the same grid and marching cubes take, and how long? on a quiet machine); of glTF files assimp, tinygltf,
# Khronos' validator and Blender. PYTHON names an interpreter that has numpy, trimesh, PyMCubes and bpy, NODE_PATH a folder with node's
# gltf-validator; assimp-utils and libtinygltf-dev are packages of Debian; what is missing is skipped. $KARST is the program. Not part of
# `make check`.
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

# ---- glTF: with levels and without ----
"$karst" mesh "$scratch/bumps.karst" --box -100,-100,-100,100,100,100 --voxel 1 --lods 4 -o "$scratch/levels.glb" -q
"$karst" mesh "$scratch/bumps.karst" --box 90,90,90,100,100,100 --voxel 1 --lods 2 -o "$scratch/nothing.glb" -q
# Readers that are nobody's of Karst must take them, with as many triangles, and refuse what is broken: an accessor longer than its bytes, and
# a type that there is not.
"$python" - "$scratch" << 'END'
import sys
whole = open(sys.argv[1] + "/bumps.glb", "rb").read()
for name, old, new in (("longer", b'"count":', b'"count":9'), ("type", b'"componentType":5126', b'"componentType":5199')):
    at = whole.index(old)
    broken = whole[:at] + new + whole[at + len(new):]
    open("%s/%s.glb" % (sys.argv[1], name), "wb").write(broken)
END
triangles=$(sed -n 's/.*"triangles": \([0-9]*\).*/\1/p' "$scratch/json" | head -n 1)
if command -v assimp > /dev/null; then
    good=true
    for file in bumps levels; do
        assimp info "$scratch/$file.glb" -vds > "$scratch/assimp" 2>&1 && grep -q "^Faces: *$triangles\$" "$scratch/assimp" || good=false
        detail=$(grep -v ' %' "$scratch/assimp")
    done
    for file in longer type; do
        assimp info "$scratch/$file.glb" -vds > "$scratch/assimp" 2>&1 && good=false detail="$file.glb was taken"
    done
    $good
    result "assimp reads and checks them, and refuses broken ones"
else
    skip "assimp" "there is none: apt-get install assimp-utils"
fi
cat > "$scratch/read.cc" << 'END'
#include <tiny_gltf.h>
#include <cstdio>
int main(int argc, char **argv) // Triangles of the scene's meshes, as it has them.
{
    tinygltf::TinyGLTF loader;
    tinygltf::Model model;
    std::string error, warning;
    if (argc < 2 || !loader.LoadBinaryFromFile(&model, &error, &warning, argv[1], tinygltf::REQUIRE_ALL) || !warning.empty()) {
        std::printf("%s%s\n", error.c_str(), warning.c_str());
        return 1;
    }
    size_t triangles = 0;
    std::vector<int> nodes = model.scenes.empty() ? std::vector<int>() : model.scenes[0].nodes;
    for (size_t i = 0; i < nodes.size(); i++) {
        const tinygltf::Node &node = model.nodes[size_t(nodes[i])];
        const int mesh = node.mesh;
        nodes.insert(nodes.end(), node.children.begin(), node.children.end());
        if (mesh >= 0)
            for (const tinygltf::Primitive &p : model.meshes[size_t(mesh)].primitives)
                triangles += model.accessors[size_t(p.indices)].count / 3;
    }
    std::printf("%zu triangles\n", triangles);
}
END
if pkg-config --exists tinygltf 2> /dev/null && c++ -O1 -o "$scratch/read" "$scratch/read.cc" $(pkg-config --cflags --libs tinygltf); then
    detail=$("$scratch/read" "$scratch/bumps.glb"; "$scratch/read" "$scratch/levels.glb"; "$scratch/read" "$scratch/type.glb")
    [ "$(echo "$detail" | grep -c "^$triangles triangles\$")" -eq 2 ] && ! "$scratch/read" "$scratch/type.glb" > /dev/null
    result "tinygltf reads them by its strictest rules, and refuses a broken one"
else
    skip "tinygltf" "there is none: apt-get install libtinygltf-dev"
fi
cat > "$scratch/validate.js" << 'END'
const fs = require("fs"), validator = require("gltf-validator");
Promise.all(process.argv.slice(2).map(file => validator.validateBytes(new Uint8Array(fs.readFileSync(file))).then(report => {
    const i = report.issues;
    console.log(`${file}: ${i.numErrors} errors, ${i.numWarnings} warnings, ${i.numInfos} infos; ${report.info.totalVertexCount} vertices`);
    i.messages.slice(0, 5).forEach(m => console.log(`  ${m.code} ${m.pointer}: ${m.message}`));
    return i.numErrors + i.numWarnings;
}))).then(all => process.exit(all.some(n => n > 0) ? 1 : 0));
END
if node -e 'require("gltf-validator")' 2> /dev/null; then
    detail=$(node "$scratch/validate.js" "$scratch"/bumps.glb "$scratch"/levels.glb "$scratch"/nothing.glb 2>&1)
    told=$?
    echo "$detail" | sed 's/^/# /'
    [ $told -eq 0 ]
    result "Khronos' validator has neither errors nor warnings"
else
    skip "Khronos' validator" "node has none: npm install --prefix DIR gltf-validator; NODE_PATH=DIR/node_modules"
fi
if "$python" -c 'import bpy' 2> /dev/null; then
    detail=$("$python" - "$scratch/levels.glb" "$scratch/json" 2>&1 << 'END'
import json, sys, bpy
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.gltf(filepath=sys.argv[1])
meshes = [o for o in bpy.context.view_layer.objects if o.type == "MESH"]  # what is in no scene is in a collection of its own
triangles = sum(len(o.data.polygons) for o in meshes)
high = max((o.matrix_world @ v.co).z for o in meshes for v in o.data.vertices)
print(len(meshes), "meshes,", triangles, "triangles, highest at", high, "colours:", [a.name for a in meshes[0].data.color_attributes])
ok = triangles == json.load(open(sys.argv[2]))["triangles"] and all(o.name.endswith("_lod0") for o in meshes)
sys.exit(not (ok and 175 < high < 185))
END
    )
    told=$?
    echo "# $(echo "$detail" | tail -n 1)"
    [ $told -eq 0 ]
    result "Blender opens the finest level of each chunk"
else
    skip "Blender" "$python has no bpy"
fi

if ! "$python" -c 'import mcubes' 2> /dev/null; then
    skip "PyMCubes" "$python has none"
    finish
fi
# Whole commands: Karst's, which writes a .glb, and a program for PyMCubes, which writes positions and triangles as numpy has them, the least
# that can be written. And what is done between the start and the end: ours with its file, theirs without. In turns; the best of five counts.
cat > "$scratch/whole.py" << 'END'
import sys, numpy, mcubes
side, cells, sparse = float(sys.argv[1]), int(sys.argv[2]), False
def density(): # of each sample, as PyMCubes' own examples have it; or, where terms are products, with sines of lines
    line = numpy.linspace(-side, side, cells + 1, dtype=numpy.float32)
    x, y, z = numpy.meshgrid(line, line, line, indexing="ij", sparse=sparse)
    return 80 - numpy.sqrt(x * x + y * y + z * z) + 3 * numpy.sin(0.3 * x) * numpy.sin(0.3 * y) * numpy.sin(0.3 * z)
def march():
    return mcubes.marching_cubes(density(), 0)
if __name__ == "__main__":
    vertices, triangles = march()
    with open(sys.argv[3], "wb") as out:
        vertices.astype(numpy.float32).tofile(out)
        triangles.astype(numpy.uint32).tofile(out)
END
cat > "$scratch/cubes.py" << 'END'
import json, os, resource, subprocess, sys, time
karst, world, folder, side, cells = sys.argv[1], sys.argv[2], sys.argv[3], float(sys.argv[4]), int(sys.argv[5])
sys.path.insert(0, folder)
sys.argv[1:] = [str(side), str(cells)]
import whole
box = ",".join(["%g" % -side] * 3 + ["%g" % side] * 3)
out = folder + "/cubes.out.glb"
def run(command): # wall time, CPU time, and what it says
    if os.path.exists(out):
        os.unlink(out) # a file that takes another's place waits for the disk
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    said = subprocess.check_output(command)
    wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, said
def march(sparse):
    whole.sparse = sparse
    start, cpu = time.perf_counter(), time.process_time()
    whole.march()
    return time.perf_counter() - start, time.process_time() - cpu
def best(runs, which):
    return min(run[which] for run in runs)
ours, theirs, inside, full, lines = [], [], [], [], []
for turn in range(5):
    ours.append(run([karst, "mesh", world, "--box", box, "--voxel", "%g" % (2 * side / cells), "-o", out, "--json"]))
    facts = json.loads(ours[-1][2])
    inside.append(facts["seconds"])
    theirs.append(run([sys.executable, folder + "/whole.py", str(side), str(cells), out]))
    full.append(march(False))
    lines.append(march(True))
print("%d^3 cells, whole commands: karst %.2f s (%.2f of CPU), PyMCubes %.2f (%.2f): %.1f times as fast" %
      (cells, best(ours, 0), best(ours, 1), best(theirs, 0), best(theirs, 1), best(theirs, 0) / best(ours, 0)))
print("%d^3 cells, between start and end: karst %.3f s, file included, %d samples; PyMCubes %.3f (%.3f of CPU), no file, %d: %.1f times as fast" %
      (cells, min(inside), facts["samples"], best(full, 0), best(full, 1), (cells + 1)**3, best(full, 0) / min(inside)))
print("the same with densities from sines of lines: %.3f s (%.3f of CPU), %.1f times as fast" %
      (best(lines, 0), best(lines, 1), best(lines, 0) / min(inside)))
sys.exit(not (best(theirs, 0) >= 3 * best(ours, 0) and best(full, 0) >= 3 * min(inside) and facts["samples"] < (cells + 1)**3 / 2))
END
# A formula that numpy evaluates as fast as memory allows.
for cells in 200 400; do
    figures=$("$python" "$scratch/cubes.py" "$karst" "$scratch/bumps.karst" "$scratch" 100 $cells 2>&1)
    result "PyMCubes takes three times as long, and more than twice the samples"
    echo "$figures" | sed 's/^/# /'
done
# A land, with the same evaluator on both sides: PyMCubes gets the densities of Karst's own module.
if "$python" -c 'import karst' 2> /dev/null; then
    figures=$("$python" - "$karst" "$scratch/cubes.glb" 2>&1 << 'END'
import json, subprocess, sys, time, numpy, mcubes, karst
command, out, cells, low = sys.argv[1], sys.argv[2], 200, (-100, 0, -100)
world, ours, theirs = karst.World("hills"), [], []
box = ",".join("%g" % v for v in low + tuple(v + cells for v in low))
places = numpy.stack(numpy.meshgrid(*[v + numpy.arange(cells + 1.0) for v in low], indexing="ij"), -1).reshape(-1, 3)
for turn in range(3):
    facts = json.loads(subprocess.check_output([command, "mesh", "hills", "--box", box, "--voxel", "1", "-o", out, "--json"]))
    ours.append(facts["seconds"])
    start = time.perf_counter()
    triangles = mcubes.marching_cubes(world.density(places).reshape([cells + 1] * 3), 0)[1]
    theirs.append(time.perf_counter() - start)
print("hills, 200^3 cells: karst %.2f s, %d triangles; PyMCubes with karst's densities %.2f s, %d; %.1f times as fast" %
      (min(ours), facts["triangles"], min(theirs), len(triangles), min(theirs) / min(ours)))
sys.exit(min(theirs) < 3 * min(ours))
END
    )
    result "PyMCubes takes three times as long with the same evaluator"
    echo "# $figures"
else
    skip "PyMCubes with the same evaluator" "$python has no karst: ENV/bin/pip install ."
fi
finish
