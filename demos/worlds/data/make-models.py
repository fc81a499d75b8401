#!/usr/bin/env python3
"""Makes hare.karstpoints and tower.karstpoints from the worlds hare.karst and tower.karst beside it.

The hare's points have normals and no colours: worlds paint it. The tower's are what a scanner would have: colours, a
little noise, no normals. Run it with the path of karst (karst, if none is given); it needs nothing but Python's own
library, and gives the same bytes every time.
"""
import os
import random
import struct
import subprocess
import sys
import tempfile

KARST = sys.argv[1] if len(sys.argv) > 1 else "karst"
HERE = os.path.dirname(os.path.abspath(__file__))


def points(world, box, spacing, folder):
    """What karst points finds: for each point its place, its normal and its colour."""
    path = os.path.join(folder, world + "-all.ply")
    subprocess.run([KARST, "points", os.path.join(HERE, world + ".karst"), "--box", box, "--spacing", spacing, "-q",
                    "-o", path], check=True)
    with open(path, "rb") as file:
        head, data = file.read().split(b"end_header\n", 1)
    properties = [line.split() for line in head.decode().splitlines() if line.startswith("property")]
    letters = {"float": "f", "double": "d", "uchar": "B"}
    layout = struct.Struct("<" + "".join(letters[p[1]] for p in properties))
    assert [p[2] for p in properties][:9] == "x y z nx ny nz red green blue".split(), properties
    return [record[:9] for record in layout.iter_unpack(data)]


def model(world, names, layout, records, folder):
    """Writes those as a PLY, and has karst import it."""
    path = os.path.join(folder, world + ".ply")
    with open(path, "wb") as file:
        types = {"f": "float", "B": "uchar"}
        file.write(b"ply\nformat binary_little_endian 1.0\nelement vertex %d\n" % len(records))
        for name, letter in zip(names.split(), layout):
            file.write(("property %s %s\n" % (types[letter], name)).encode())
        file.write(b"end_header\n")
        for record in records:
            file.write(struct.pack("<" + layout, *record))
    subprocess.run([KARST, "import", path, "--axes", "karst", "-q", "-o", os.path.join(HERE, world + ".karstpoints")],
                   check=True)


with tempfile.TemporaryDirectory() as scratch:
    hare = points("hare", "-0.5,-0.1,-0.8,0.5,1.6,0.8", "0.025", scratch)
    model("hare", "x y z nx ny nz", "ffffff", [p[:6] for p in hare], scratch)
    noise = random.Random(1)
    tower = [[x + noise.gauss(0, 0.012) for x in p[:3]] + list(p[6:]) for p in points(
        "tower", "-11,-6,-11,11,18,11", "0.2", scratch)]
    model("tower", "x y z red green blue", "fffBBB", tower, scratch)
