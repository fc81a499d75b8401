#!/usr/bin/env python3
"""Whether a .glb keeps the rules of glTF 2.0 (and of MSFT_lod) as far as Karst uses it. Prints what is wrong, one a line, and exits with 1;
else prints facts as JSON. Needs Python alone. Sections are those of the specification 2.0.1."""
import array
import json
import math
import struct
import sys

SIZES = {5121: 1, 5123: 2, 5125: 4, 5126: 4}
COUNTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
KNOWN = {
    "": {"asset", "scene", "scenes", "nodes", "meshes", "materials", "accessors", "bufferViews", "buffers", "extensionsUsed"},
    "asset": {"version", "generator", "extras"},
    "nodes": {"name", "mesh", "children", "scale", "extras", "extensions"},
    "meshes": {"primitives", "name"},
    "accessors": {"bufferView", "byteOffset", "componentType", "normalized", "count", "type", "min", "max"},
    "bufferViews": {"buffer", "byteOffset", "byteLength", "byteStride", "target"},
    "buffers": {"byteLength"},
    "materials": {"pbrMetallicRoughness"},
}
wrong = []


def expect(good, text):
    if not good:
        wrong.append(text)
    return good


def as_float(number):
    """A number of JSON as the 32-bit float that it stands for."""
    return struct.unpack("<f", struct.pack("<f", number))[0]


def read_chunks(data):
    """Section 4.4: header, JSON, then at most one chunk of bytes; lengths are multiples of 4."""
    magic, version, length = struct.unpack_from("<III", data)
    expect(magic == 0x46546C67 and version == 2, "no glTF 2 header")
    expect(length == len(data), "the header says %d bytes, the file has %d" % (length, len(data)))
    at, chunks = 12, []
    while at < len(data):
        size, kind = struct.unpack_from("<II", data, at)
        expect(size % 4 == 0, "a chunk of %d bytes" % size)
        chunks.append((kind, data[at + 8 : at + 8 + size]))
        at += 8 + size
    expect(at == len(data), "the last chunk ends beyond the file")
    expect([c[0] for c in chunks] in ([0x4E4F534A], [0x4E4F534A, 0x4E4942]), "chunks are JSON, then bytes")
    return json.loads(chunks[0][1]), chunks[1][1] if len(chunks) > 1 else b""


def read_accessor(gltf, binary, index):
    """Its elements, component by component; sections 3.6.2.2 to 3.6.2.5."""
    a = gltf["accessors"][index]
    view = gltf["bufferViews"][a["bufferView"]]
    size, num = SIZES[a["componentType"]], COUNTS[a["type"]]
    start = view.get("byteOffset", 0) + a.get("byteOffset", 0)
    stride = view.get("byteStride", size * num)
    name = "accessor %d" % index
    expect(a["count"] >= 1, name + " is empty")
    expect(start % size == 0 and a.get("byteOffset", 0) % size == 0 and stride % size == 0, name + " is not aligned")
    expect(view["target"] == 34963 or (stride % 4 == 0 and start % 4 == 0), name + ": attributes are aligned to 4 bytes")
    expect(a.get("byteOffset", 0) + stride * (a["count"] - 1) + size * num <= view["byteLength"], name + " ends beyond its view")
    kind = {5123: "H", 5125: "I", 5126: "f"}[a["componentType"]]
    if stride == size * num:
        values = array.array(kind, binary[start : start + size * num * a["count"]])
        return [values[i::num] for i in range(num)]
    words = array.array(kind, binary[start : start + stride * (a["count"] - 1) + size * num])
    return [words[i :: stride // size] for i in range(num)]


def check_tree(gltf):
    """Section 3.5.2: nodes are a forest, scenes name roots; and each level's node is in no scene, but named by one node."""
    parents = [0] * len(gltf["nodes"])
    for i, node in enumerate(gltf["nodes"]):
        for child in node.get("children", []):
            expect(0 <= child < len(parents) and child != i, "node %d has no child %d" % (i, child))
            parents[child] += 1
    expect(max(parents) <= 1, "a node has two parents")
    for root in gltf["scenes"][gltf["scene"]]["nodes"]:
        expect(parents[root] == 0, "the scene's node %d has a parent" % root)
    shown, todo = set(), list(gltf["scenes"][gltf["scene"]]["nodes"])
    while todo:
        node = todo.pop()
        expect(node not in shown, "node %d is its own descendant" % node)
        shown.add(node)
        todo += gltf["nodes"][node].get("children", [])
    levels = []
    for i, node in enumerate(gltf["nodes"]):
        ids = node.get("extensions", {}).get("MSFT_lod", {}).get("ids", [])
        expect(not ids or i in shown, "node %d has levels, and is in no scene" % i)
        levels += ids
    expect(len(set(levels)) == len(levels) and not shown & set(levels), "levels are of one node each, and in no scene")
    expect(len(levels) + len(shown) == len(gltf["nodes"]), "nodes that nothing shows")
    expect(("MSFT_lod" in gltf.get("extensionsUsed", [])) == bool(levels), "extensionsUsed and what is used")


def check_mesh(gltf, binary, index):
    (primitive,) = gltf["meshes"][index]["primitives"]
    attributes = primitive["attributes"]
    positions = gltf["accessors"][attributes["POSITION"]]
    expect(positions["type"] == "VEC3" and positions["componentType"] == 5126, "positions are three floats")
    columns = read_accessor(gltf, binary, attributes["POSITION"])
    for axis in range(3):
        least, most = as_float(positions["min"][axis]), as_float(positions["max"][axis])
        expect(min(columns[axis]) == least and max(columns[axis]) == most, "mesh %d: min and max along axis %d are others" % (index, axis))
        expect(all(map(math.isfinite, columns[axis])), "mesh %d: positions that are not finite" % index)
    normals = read_accessor(gltf, binary, attributes["NORMAL"])
    off = max(abs(x * x + y * y + z * z - 1) for x, y, z in zip(*normals))
    expect(off < 1e-4, "mesh %d: normals are off length 1 by %g" % (index, off))
    colours = gltf["accessors"][attributes["COLOR_0"]]
    expect(colours["componentType"] == 5123 and colours.get("normalized") is True, "colours are normalised")
    read_accessor(gltf, binary, attributes["COLOR_0"])
    for name in attributes:
        expect(gltf["accessors"][attributes[name]]["count"] == positions["count"], "mesh %d: attributes of other lengths" % index)
    (indices,) = read_accessor(gltf, binary, primitive["indices"])
    expect(len(indices) % 3 == 0, "mesh %d: no whole triangles" % index)
    expect(max(indices) < positions["count"], "mesh %d: an index of no vertex" % index)
    expect(len(set(indices)) == positions["count"], "mesh %d: vertices without a triangle" % index)
    degenerate = sum(a == b or b == c or a == c for a, b, c in zip(indices[::3], indices[1::3], indices[2::3]))
    expect(degenerate == 0, "mesh %d: %d triangles are none" % (index, degenerate))
    expect(0 <= primitive["material"] < len(gltf["materials"]), "no such material")
    return len(indices) // 3


def main():
    gltf, binary = read_chunks(open(sys.argv[1], "rb").read())
    for place, known in KNOWN.items():
        for item in [gltf] if not place else [gltf[place]] if place == "asset" else gltf.get(place, []):
            expect(set(item) <= known, "%s has %s" % (place or "the file", set(item) - known))
    expect(gltf["asset"]["version"] == "2.0", "version")
    check_tree(gltf)
    for buffer in gltf.get("buffers", []):
        expect(len(binary) - 3 <= buffer["byteLength"] <= len(binary), "the buffer's length")
    for i, view in enumerate(gltf.get("bufferViews", [])):
        expect(view.get("byteOffset", 0) + view["byteLength"] <= gltf["buffers"][0]["byteLength"], "view %d ends beyond" % i)
        expect(4 <= view.get("byteStride", 4) <= 252 and view.get("byteStride", 4) % 4 == 0, "the stride of view %d" % i)
    triangles = [check_mesh(gltf, binary, i) for i in range(len(gltf.get("meshes", [])))]
    used = sorted(node["mesh"] for node in gltf["nodes"] if "mesh" in node)
    expect(used == list(range(len(triangles))), "each mesh is of one node")
    if wrong:
        print("\n".join(wrong))
        return 1
    print(json.dumps({"nodes": len(gltf["nodes"]), "meshes": len(triangles), "triangles": sum(triangles)}))
    return 0


sys.exit(main())
