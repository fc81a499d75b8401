#!/bin/sh
# Caustics against POV-Ray 3.7 (Debian: apt-get install povray): the light of a sun that a ball of glass throws on a floor,
# against rays in double. Both draw it with more and more photons; at the errors that Karst has, POV-Ray must take five times
# as long or more. POVRAY names the program, PYTHON an interpreter that has numpy; what is missing is skipped.
# $KARST is the program. Times are of the CPU, of whole runs, so that a busy machine tells the same. Not part of `make check`.
set -u
. tests/tap.sh
karst=${KARST:-build/karst}
python=${PYTHON:-python3}
povray=${POVRAY:-povray}
scratch=$(mktemp -d) || exit 1
trap 'rm -rf "$scratch"' EXIT

if ! command -v "$povray" > /dev/null; then
    skip "POV-Ray" "there is no $povray: apt-get install povray"
    finish
fi
if ! "$python" -c 'import numpy' 2> /dev/null; then
    skip "POV-Ray" "$python has no numpy: python3 -m venv ENV; ENV/bin/pip install numpy; PYTHON=ENV/bin/python"
    finish
fi

cat > "$scratch/ball.karst" << 'END'
/*{ "voxel": 0.00390625, "view": 60, "sun": { "colour": [0, 0, 0] },
"lights": [{ "kind": "sun", "azimuth": 270, "elevation": 40, "size": 0, "colour": [1, 1, 1] }],
"sky": { "zenith": [0, 0, 0], "horizon": [0, 0, 0], "haze": 1e12 },
"camera": { "position": ["0", "20", "0"], "pitch": -90, "fov": 7.5 } }*/
float density(vec3 p) { return -p.y; }
float clear(vec3 p) { return 0.5 - length(p - vec3(0.0, 0.75, 0.0)); }
material surface(vec3 p, vec3 n) { material m; m.colour = vec3(0.5); return m; }
material clear_surface(vec3 p, vec3 n) { material m; m.ior = 1.5; return m; }
END
cat > "$scratch/ball.pov" << 'END'
#version 3.7;
#declare Elevation = radians(40);
global_settings { assumed_gamma 1 max_trace_level 12 adc_bailout 0.001 #if (Photons > 0) photons { count Photons gather 20, Most } #end }
camera { location <0, 20, 0> direction -y up z right x angle 7.5 }
light_source { 100 * <-cos(Elevation), sin(Elevation), 0> rgb 1 parallel point_at <0, 0, 0> }
plane { y, 0 pigment { rgb 1 } finish { ambient 0 diffuse 0.5 } }
sphere { <0, 0.75, 0>, 0.5 pigment { rgbf 1 } finish { ambient 0 diffuse 0 reflection { 0, 1 fresnel on } conserve_energy }
    interior { ior 1.5 } photons { target reflection on refraction on collect off } }
END
cat > "$scratch/compare.py" << 'END'
import os, resource, struct, subprocess, sys, zlib
import numpy as np
karst, povray, scratch = sys.argv[1:4]
side = 96
pixel = 2 * 20 * np.tan(np.radians(3.75)) / side

def truth():
    e, n = np.radians(40), 3000
    way, up = np.array([np.cos(e), -np.sin(e), 0]), np.array([np.sin(e), np.cos(e), 0])
    a, b = np.meshgrid((2 * (np.arange(n) + 0.5) / n - 1), (2 * (np.arange(n) + 0.5) / n - 1))
    keep = a * a + b * b < 1
    a, b = a[keep][:, None], b[keep][:, None]
    normal = a * up + b * np.array([0, 0, 1]) - np.sqrt(1 - a * a - b * b) * way
    light = np.zeros((side, side))
    def land(o, d, flux):
        down = d[:, 1] < 0
        o, d, flux = o[down], d[down], flux[down]
        at = o + d * (-(o[:, 1:2] + 0.75) / d[:, 1:2])
        column, row = np.floor(at[:, 0] / pixel + side / 2).astype(int), np.floor(side / 2 - at[:, 2] / pixel).astype(int)
        seen = (column >= 0) & (row >= 0) & (column < side) & (row < side)
        np.add.at(light, (row[seen], column[seen]), flux[seen] / pixel**2)
    def refract(d, normal, ratio):
        c = -(d * normal).sum(1, keepdims=True)
        f = np.sqrt(np.maximum(1 - ratio**2 * (1 - c * c), 0))
        rs, rp = (ratio * c - f) / (ratio * c + f), (ratio * f - c) / (ratio * f + c)
        return ratio * d + (ratio * c - f) * normal, ((rs**2 + rp**2) / 2)[:, 0]
    o, flux = 0.5 * normal, np.full(len(a), 4 * 0.25 / n**2)
    back = way - 2 * (normal @ way)[:, None] * normal
    d, reflected = refract(np.broadcast_to(way, normal.shape), normal, 1 / 1.5)
    land(o, back, flux * reflected)
    flux = flux * (1 - reflected)
    for _ in range(4): # what stays inside each time is a tenth at most but for a few rays
        o = o - 2 * (o * d).sum(1, keepdims=True) * d
        out, again = refract(d, -o / 0.5, 1.5)
        land(o, out, flux * (1 - again))
        d, flux = d - 2 * (d * (o / 0.5)).sum(1, keepdims=True) * (o / 0.5), flux * again
    return light

x = (np.arange(side) + 0.5 - side / 2)[None, :] * pixel + np.zeros((side, 1))
z = (side / 2 - np.arange(side) - 0.5)[:, None] * pixel + np.zeros((1, side))
edge, e = 3 * pixel, np.radians(40)
behind = (((x - 0.75 / np.tan(e)) * np.sin(e))**2 + z**2 < (0.5 - edge)**2) & (x**2 + z**2 > (0.5 + 2 * edge)**2)
true = truth()
peak = max(true[r - 1:r + 2, c - 1:c + 2].mean() for r in range(1, side - 1) for c in range(1, side - 1) if behind[r, c])

def read_exr(path):
    data, at = open(path, "rb").read(), 8
    facts = {}
    while data[at]:
        name, at = data[at:data.index(0, at)].decode(), data.index(0, at) + 1
        at = data.index(0, at) + 1
        size = struct.unpack_from("<i", data, at)[0]
        facts[name], at = data[at + 4:at + 4 + size], at + 4 + size
    names, types, p = [], [], 0
    while facts["channels"][p]:
        q = facts["channels"].index(0, p)
        names.append(facts["channels"][p:q].decode())
        types.append(struct.unpack_from("<i", facts["channels"], q + 1)[0])
        p = q + 17
    widths = [2 if t == 1 else 4 for t in types]
    lines = {0: 1, 2: 1, 3: 16}[facts["compression"][0]]
    picture = np.zeros((side, side))
    for offset in struct.unpack_from("<%dQ" % ((side + lines - 1) // lines), data, at + 1):
        y, size = struct.unpack_from("<ii", data, offset)
        block = data[offset + 8:offset + 8 + size]
        num = min(lines, side - y)
        if size < num * side * sum(widths):
            b = np.frombuffer(zlib.decompress(block), np.uint8).astype(np.int64)
            b[1:] -= 128
            b = np.cumsum(b).astype(np.uint8)
            half = (len(b) + 1) // 2
            block = np.empty_like(b)
            block[0::2], block[1::2] = b[:half], b[half:]
            block = block.tobytes()
        for line in range(num):
            begin = line * side * sum(widths)
            for name, width in zip(names, widths):
                if name == "R":
                    picture[y + line] = np.frombuffer(block, "<f4" if width == 4 else "<f2", side, begin)
                begin += side * width
    return picture

def read_hdr(path):
    data = open(path, "rb").read()
    at = data.index(b"\n\n") + 2
    at, rows = data.index(b"\n", at) + 1, []
    for _ in range(side):
        row, at = np.zeros((4, side)), at + 4
        for plane in row:
            c = 0
            while c < side:
                num, at = data[at], at + 1
                if num > 128:
                    plane[c:c + num - 128], at, c = data[at], at + 1, c + num - 128
                else:
                    plane[c:c + num], at, c = list(data[at:at + num]), at + num, c + num
        rows.append(np.where(row[3] > 0, row[0] * 2.0**(row[3] - 136), 0))
    return np.array(rows)

def run(command):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        sys.exit(done.stdout.decode(errors="replace")[-2000:])
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

def off(picture):
    light = picture / 0.5
    return np.sqrt(np.mean((light - true)[behind]**2)) / peak, light[behind].sum() / true[behind].sum()

def ours(photons):
    name = scratch + "/ours.exr"
    seconds = run([karst, "render", scratch + "/ball.karst", "-q", "--size", "%dx%d" % (side, side), "--samples", "1",
                   "--caustics", str(photons), "--aov", "radiance", "--display", "none", "--pool", "128", "-o", name])
    return seconds, *off(read_exr(name))

def theirs(photons, most):
    name = scratch + "/theirs.hdr"
    seconds = run([povray, "+I" + scratch + "/ball.pov", "+O" + name, "+FH", "File_Gamma=1.0", "+W%d" % side, "+H%d" % side, "-D",
                   "-GA", "+WT2", "Declare=Photons=%d" % photons, "Declare=Most=%d" % most])
    return seconds, *off(read_hdr(name))

ours(1000) # kernels are compiled once
figures = []
for photons in (300, 1000, 3000, 10000, 30000, 100000):
    figures.append(min(ours(photons) for _ in range(3)))
    print("karst %8d photons: %6.2f s of CPU, rms %.4f of the peak, light %.3f of the true" % (photons, *figures[-1]))
# POV-Ray's error does not fall below what the photons that it gathers at most allow: each number is tried.
peers = []
for most in (20, 100, 300, 1000):
    for photons in (3000, 10000, 30000, 100000, 300000, 1000000):
        peers.append(min(theirs(photons, most) for _ in range(2)))
        print("POV-Ray %8d photons, %4d gathered: %6.2f s of CPU, rms %.4f of the peak, light %.3f of the true" %
              (photons, most, *peers[-1]))
# At each error that both have, the fastest of either.
holds = True
for mark in sorted(f[1] for f in figures + peers):
    ours_s = min((f[0] for f in figures if f[1] <= mark), default=None)
    theirs_s = min((f[0] for f in peers if f[1] <= mark), default=None)
    if ours_s and theirs_s:
        holds = holds and 5 * ours_s <= theirs_s
        print("at rms %.4f: karst %.2f s, POV-Ray %.2f s, %.2f times" % (mark, ours_s, theirs_s, ours_s / theirs_s))
sys.exit(not holds)
END
figures=$("$python" "$scratch/compare.py" "$karst" "$povray" "$scratch" 2>&1)
result "at equal error, Karst takes at most a fifth of POV-Ray's time"
echo "$figures" | sed "s/^/# /"
finish
