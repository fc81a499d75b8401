#!/usr/bin/env python3
"""Makes rock.png and turf.png: 128 x 128 samples in colour that repeat without a seam.

Rock is sharp-edged patches at three sizes with cracks between them; turf is tufts that lie over one another. Run it
beside the files; it needs nothing but Python's own library, and gives the same bytes every time.
"""
import math
import struct
import zlib

SIDE = 128


def number(x, y, seed):
    """A number in [0, 1) that looks random."""
    h = (x * 0x8DA6B343 ^ y * 0xD8163841 ^ seed * 0xCB1AB31F) & 0xFFFFFFFF
    h = (h ^ h >> 16) * 0x7FEB352D & 0xFFFFFFFF
    h = (h ^ h >> 15) * 0x846CA68B & 0xFFFFFFFF
    return (h ^ h >> 16) / 0x100000000


def nearest(x, y, cells, seed, stretch):
    """Distances to the nearest two of points strewn one in each cell, and a number of the nearest's own."""
    u, v = x * cells / SIDE, y * cells / SIDE
    found = []
    for j in range(math.floor(v) - 2, math.floor(v) + 3):
        for i in range(math.floor(u) - 2, math.floor(u) + 3):
            p, q = i % cells, j % cells
            dx, dy = i + number(p, q, seed) - u, (j + number(p, q, seed + 1) - v) * stretch
            found.append((math.hypot(dx, dy), number(p, q, seed + 2)))
    found.sort()
    return found[0][0], found[1][0], found[0][1]


def rock(x, y):
    tone, crack = 0.0, 1.0
    for cells, part, seed in ((5, 0.5, 1), (12, 0.3, 5), (31, 0.2, 9)):
        first, second, own = nearest(x, y, cells, seed, 1.0)
        tone += part * own
        crack = min(crack, 0.55 + (second - first) * (4 if cells < 20 else 6))
    light = (0.30 + 0.36 * tone) * crack
    return light * 1.04, light * 0.98, light * (0.88 + 0.06 * tone)


def turf(x, y):
    light, dry = 0.0, 0.0
    for cells, part, seed in ((9, 0.4, 21), (19, 0.35, 25), (40, 0.25, 29)):
        first, _, own = nearest(x, y, cells, seed, 0.7)
        light += part * max(0.0, 1.0 - first) * (0.6 + 0.4 * own)
        dry += part * own
    light = 0.16 + 0.42 * light
    return light * (0.62 + 0.42 * dry), light * (0.86 + 0.08 * dry), light * 0.40


def chunk(name, data):
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def write(path, colour_at):
    rows = b"".join(b"\0" + bytes(min(255, max(0, round(255 * c))) for x in range(SIDE) for c in colour_at(x, y))
                    for y in range(SIDE))
    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", SIDE, SIDE, 8, 2, 0, 0, 0)) +
                   chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b""))


write("rock.png", rock)
write("turf.png", turf)
