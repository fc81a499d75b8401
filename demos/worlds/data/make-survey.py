#!/usr/bin/env python3
"""Makes survey.png: a map of heights, 256 x 256 samples of 16 bits, that repeats without a seam.

Ridges of a few octaves, worn by water: rain falls in random places, runs downhill, and takes earth along as fast as
it falls. Run it beside the file; it needs nothing but Python's own library, and gives the same bytes every time.
"""
import math
import struct
import sys
import zlib

SIDE = 256


def number(x, y, seed):
    """A number in [-1, 1] that looks random."""
    h = (x * 0x8DA6B343 ^ y * 0xD8163841 ^ seed * 0xCB1AB31F) & 0xFFFFFFFF
    h = (h ^ h >> 16) * 0x7FEB352D & 0xFFFFFFFF
    h = (h ^ h >> 15) * 0x846CA68B & 0xFFFFFFFF
    return (h ^ h >> 16) / 0x7FFFFFFF - 1


def noise(x, y, cells, seed):
    """Gradient noise with so many cells a side, that repeats."""
    i, j = math.floor(x), math.floor(y)
    u, v = x - i, y - j
    total = 0.0
    for b in (0, 1):
        for a in (0, 1):
            p, q = (i + a) % cells, (j + b) % cells
            slope = number(p, q, seed) * (u - a) + number(p, q, seed + 77) * (v - b)
            s, t = abs(u - a), abs(v - b)
            total += slope * (1 - s * s * s * (s * (s * 6 - 15) + 10)) * (1 - t * t * t * (t * (t * 6 - 15) + 10))
    return total


def land(x, y):
    height, amplitude, weight = 0.0, 1.0, 1.0
    for octave in range(6):
        cells = 4 << octave
        ridge = 1 - 2 * abs(noise(x * cells / SIDE, y * cells / SIDE, cells, octave))
        height += amplitude * weight * ridge * ridge
        weight = min(max(ridge * 1.2, 0.0), 1.0)
        amplitude *= 0.48
    return height + 1.5 * noise(x * 2 / SIDE, y * 2 / SIDE, 2, 9)


def slope_at(field, x, y):
    """Height and slope between the samples."""
    i, j = math.floor(x), math.floor(y)
    u, v = x - i, y - j
    a, b = field[j % SIDE][i % SIDE], field[j % SIDE][(i + 1) % SIDE]
    c, d = field[(j + 1) % SIDE][i % SIDE], field[(j + 1) % SIDE][(i + 1) % SIDE]
    return (a * (1 - u) + b * u) * (1 - v) + (c * (1 - u) + d * u) * v, (b - a) * (1 - v) + (d - c) * v, \
        (c - a) * (1 - u) + (d - b) * u


def add(field, x, y, amount):
    i, j = math.floor(x), math.floor(y)
    u, v = x - i, y - j
    for b, part in ((0, 1 - v), (1, v)):
        row = field[(j + b) % SIDE]
        row[i % SIDE] += amount * (1 - u) * part
        row[(i + 1) % SIDE] += amount * u * part


def wear(field, drops):
    for drop in range(drops):
        x = (number(drop, 1, 5) + 1) * SIDE / 2
        y = (number(drop, 2, 5) + 1) * SIDE / 2
        dx = dy = earth = 0.0
        water, speed = 1.0, 0.02
        for _ in range(60):
            height, gx, gy = slope_at(field, x, y)
            dx, dy = dx * 0.1 - gx * 0.9, dy * 0.1 - gy * 0.9
            length = math.hypot(dx, dy)
            if length < 1e-9:
                break
            dx, dy = dx / length, dy / length
            fall = height - slope_at(field, x + dx, y + dy)[0]
            carries = max(fall, 0.002) * speed * water * 8
            if fall < 0 or earth > carries:
                put = min(-fall, earth) if fall < 0 else (earth - carries) * 0.3
                earth -= put
                add(field, x, y, put)
            else:
                take = min((carries - earth) * 0.3, fall)
                earth += take
                add(field, x, y, -take)
            speed = math.sqrt(max(speed * speed + fall * 4, 0.0001))
            water *= 0.98
            x, y = x + dx, y + dy


def smooth(field):
    """What drops left in single places goes over into what is around."""
    weights = ((-1, 0.25), (0, 0.5), (1, 0.25))
    return [[sum(u * v * field[(y + j) % SIDE][(x + i) % SIDE] for j, v in weights for i, u in weights)
             for x in range(SIDE)] for y in range(SIDE)]


def chunk(name, data):
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def main():
    field = [[land(x, y) for x in range(SIDE)] for y in range(SIDE)]
    wear(field, 30000)
    field = smooth(field)
    low, high = min(map(min, field)), max(map(max, field))
    rows = b"".join(b"\0" + b"".join(struct.pack(">H", round(65535 * (h - low) / (high - low))) for h in row)
                    for row in field)
    with open(sys.argv[1] if len(sys.argv) > 1 else "survey.png", "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", SIDE, SIDE, 16, 0, 0, 0, 0)) +
                   chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b""))


main()
