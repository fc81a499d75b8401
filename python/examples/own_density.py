#!/usr/bin/env python3
"""A density of one's own: a numpy function of heights becomes a world.

    python3 own_density.py [--terms N] [-o own.png] [--keep own.karst]

A world is a text, so the function is fitted first: here by a sum of cosines, as many along each side as --terms says.
The fit is compared with the function through World.heights, and drawn.
"""
import argparse

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import karst

SIDE_M = 2000.0


def heights(x, z):
    """What is to become a world: metres, of arrays. A crater with a central peak, on a slope of dunes."""
    away = np.hypot(x - 1050, z - 980)
    crater = 260 * np.exp(-((away - 520) / 130) ** 2) - 180 * np.exp(-(away / 420) ** 4) + 170 * np.exp(-(away / 120) ** 2)
    dunes = 22 * np.sin(x / 90 + 1.5 * np.sin(z / 300)) * np.exp(-((z - 1800) / 500) ** 2)
    return 120 + 0.06 * x + crater + dunes


def fit(function, num_terms, num_samples=256):
    """Coefficients of cos(j pi x / side) cos(k pi z / side), by a discrete cosine transform."""
    places = (np.arange(num_samples) + 0.5) / num_samples
    samples = function(places[:, None] * SIDE_M, places[None, :] * SIDE_M)
    waves = np.cos(np.pi * np.arange(num_terms)[:, None] * places[None, :])
    scale = np.where(np.arange(num_terms) == 0, 1, 2) / num_samples
    return (scale[:, None] * waves) @ samples @ (scale[:, None] * waves).T


def write_world(coefficients):
    """The text: cosines of multiples by their recurrence, then a dot product for each row."""
    num = len(coefficients)
    lines = ['/*{ "name": "own", "description": "Fitted to a numpy function", "voxel": 0.25,',
             '    "camera": { "position": [1050, 1050, -350], "yaw": 0, "pitch": -33 }, "view": 6000 }*/',
             "float density(vec3 p) {",
             f"  float u = p.x * {np.pi / SIDE_M!r}, v = p.z * {np.pi / SIDE_M!r}, h = 0.0;"]
    for axis in "uv":
        lines.append("  float " + ", ".join(f"{axis}{j} = cos({float(j)} * {axis})" for j in range(1, num)) + ";")
    for j, row in enumerate(coefficients):
        terms = [f"{row[0]:.5f}"] + [f"{c:+.5f} * v{k}" for k, c in enumerate(row) if k and abs(c) > 1e-3]
        lines.append(f"  h += {'1.0' if j == 0 else f'u{j}'} * ({' '.join(terms)});")
    # Divided by how steep heights may be, so that values are about metres.
    return "\n".join([*lines, "  return (h - p.y) * 0.5;", "}",
                      "vec3 colour(vec3 p, vec3 n) {",
                      "  return mix(vec3(0.30, 0.22, 0.15), vec3(0.62, 0.55, 0.42), smoothstep(0.6, 0.95, n.y));", "}"])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--terms", type=int, default=24)
    parser.add_argument("--size", type=int, nargs=2, default=(480, 300), metavar=("W", "H"))
    parser.add_argument("-o", "--output", default="own_density.png")
    parser.add_argument("--keep", metavar="FILE", help="keep the world's text, for karst view")
    o = parser.parse_args()
    text = write_world(fit(heights, o.terms))
    if o.keep:
        with open(o.keep, "w", encoding="utf-8") as file:
            file.write(text + "\n")
    world = karst.World(text)

    x, z = np.meshgrid(np.linspace(0, SIDE_M, 65), np.linspace(0, SIDE_M, 65), indexing="ij")
    points = np.stack([x, np.full_like(x, 1000.0), z], axis=-1)
    drop = 1000 - world.heights(points, 2000, 1).down[..., 0] - heights(x, z)
    print(f"{o.terms} x {o.terms} terms: off by {np.sqrt(np.mean(drop ** 2)):.2f} m (root mean square), "
          f"{np.abs(drop).max():.1f} m at most")

    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.4), width_ratios=(1, 2), layout="constrained")
    shown = left.pcolormesh(x, z, drop, cmap="RdBu", shading="auto", vmin=-np.abs(drop).max(), vmax=np.abs(drop).max())
    left.set(title="fit less function, m", xlabel="x, m", ylabel="z, m", aspect="equal")
    figure.colorbar(shown, ax=left)
    right.imshow(world.render(size=tuple(o.size), samples=4).colour)
    right.set_axis_off()
    figure.savefig(o.output, dpi=120)


if __name__ == "__main__":
    main()
