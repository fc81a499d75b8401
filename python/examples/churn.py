#!/usr/bin/env python3
"""What a flight makes, and what it makes again: bricks produced, evicted and reproduced, frame by frame.

    python3 churn.py [WORLD] [PATH] [--frames N] [--fps F] [--pool MIB] [-o churn.png]

A pool that is large enough reproduces nothing: what was evicted was not needed soon after.
"""
import argparse

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import karst


def fly(world, path, num_frames, fps, options):
    """Statistics of each frame, as dicts."""
    with karst.Engine(world, **options) as engine:
        engine.render(path.camera(path.start))
        return [engine.frame(path.camera(path.start + i / fps)).stats for i in range(num_frames)]


def plot(frames, fps, title, file):
    seconds = np.arange(len(frames)) / fps
    figure, (top, bottom) = plt.subplots(2, 1, sharex=True, figsize=(8, 5), layout="constrained")
    for name, colour in (("produced", "tab:blue"), ("evicted", "tab:orange"), ("reproduced", "tab:red")):
        top.plot(seconds, [f[name] for f in frames], color=colour, label=name)
    top.set(title=title, ylabel="nodes a frame", ylim=(0, None))
    top.legend(loc="upper right")
    bottom.plot(seconds, [f["bricks_resident"] for f in frames], color="tab:gray", label="in the pool")
    bottom.plot(seconds, [f["bricks_used"] for f in frames], color="tab:green", label="used by the frame")
    bottom.axhline(frames[-1]["bricks_total"], color="black", linewidth=0.8, linestyle=":", label="slots")
    bottom.set(xlabel="seconds of flight", ylabel="bricks", ylim=(0, None))
    bottom.legend(loc="center right")
    figure.savefig(file, dpi=120)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("world", nargs="?", default="hills")
    parser.add_argument("path", nargs="?", default="low-flight")
    parser.add_argument("--frames", type=int, default=120)
    parser.add_argument("--fps", type=float, default=30)
    parser.add_argument("--size", type=int, nargs=2, default=(400, 225), metavar=("W", "H"))
    parser.add_argument("--pool", type=int, default=48, metavar="MIB")
    parser.add_argument("-o", "--output", default="churn.png")
    o = parser.parse_args()
    world = karst.World(o.world)
    options = {"size": o.size, "samples": 1, "tone": "plain", "pool_bytes": o.pool << 20}
    frames = fly(world, karst.Path(o.path, world), o.frames, o.fps, options)
    plot(frames, o.fps, f"{world.name}, {o.path}, {o.pool} MiB", o.output)
    total = {name: sum(f[name] for f in frames) for name in ("produced", "evicted", "reproduced")}
    print(f"{o.output}: " + ", ".join(f"{number} {name}" for name, number in total.items()))


if __name__ == "__main__":
    main()
