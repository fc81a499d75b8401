#!/usr/bin/env python3
"""What detail costs, and what it gives: time of a frame against how far hits lie from the true surface.

    python3 speed_against_error.py [WORLD] [--details 0.5 1 2 4 8] [-o speed.png]

The true surface is where World.rays finds it, by proof, with all detail there is. Errors are in pixels: a thousandth
of a pixel at 1 km is as far off, to the eye, as one at 1 m.
"""
import argparse
import time

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import karst


def measure(world, detail_px, size, repeats, rays):
    """Median time of a frame of the view at rest, and the errors of the pixels that `rays` names."""
    with karst.Engine(world, size=size, samples=1, tone="plain", detail_px=detail_px, pool_bytes=512 << 20) as engine:
        depth = engine.render(aovs=["depth"]).depth
        times = []
        for _ in range(repeats):
            start = time.perf_counter()
            engine.frame()
            times.append(time.perf_counter() - start)
    rows, columns, true_m, slant = rays
    camera = world.camera
    pixel = 2 * np.tan(np.radians(camera.fov) / 2) / size[1]
    # What an eye sees of an error along the ray: its part across, where the surface is slanted.
    error_px = np.abs(depth[rows, columns] - true_m) * slant / (true_m * pixel)
    return np.median(times), error_px[np.isfinite(error_px)]


def find_truth(world, size, num):
    """So many pixels: rows, columns, the true distance, and the cosine between normal and ray."""
    random = np.random.default_rng(1)
    rows, columns = random.integers(0, size[1], num), random.integers(0, size[0], num)
    camera = world.camera
    ways = camera.directions(size)[rows, columns]
    at = world.positions([[camera.x, camera.y, camera.z]])
    hits = world.rays(at, ways, world.view_distance)
    found = hits.kind == 1
    slant = np.abs((hits.normal * ways).sum(axis=-1))
    return rows[found], columns[found], hits.t[found], slant[found]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("world", nargs="?", default="hills")
    parser.add_argument("--details", type=float, nargs="+", default=[0.5, 0.7, 1, 1.4, 2, 4, 8])
    parser.add_argument("--size", type=int, nargs=2, default=(400, 225), metavar=("W", "H"))
    parser.add_argument("--rays", type=int, default=2000)
    parser.add_argument("--repeats", type=int, default=9)
    parser.add_argument("-o", "--output", default="speed_against_error.png")
    o = parser.parse_args()
    world = karst.World(o.world)
    rays = find_truth(world, o.size, o.rays)
    figure, axes = plt.subplots(figsize=(7, 4.5), layout="constrained")
    found = []
    for detail_px in o.details:
        seconds, error_px = measure(world, detail_px, o.size, o.repeats, rays)
        found.append((seconds * 1e3, *np.percentile(error_px, [50, 95])))
        print(f"detail {detail_px:g} px: {found[-1][0]:.1f} ms a frame, error {found[-1][1]:.3g} px (median), "
              f"{found[-1][2]:.3g} px (95 %)")
    times, medians, highs = np.array(found).T
    axes.plot(times, medians, "o-", label="median")
    axes.plot(times, highs, "o-", label="95 %")
    for detail_px, ms, error_px in zip(o.details, times, medians):
        axes.annotate(f"{detail_px:g} px", (ms, error_px), textcoords="offset points", xytext=(5, 5))
    axes.set(title=f"{world.name}, {o.size[0]} x {o.size[1]}", xlabel="ms a frame, at rest", ylabel="error, pixels",
             yscale="log")
    axes.margins(x=0.12)
    axes.legend()
    figure.savefig(o.output, dpi=120)


if __name__ == "__main__":
    main()
