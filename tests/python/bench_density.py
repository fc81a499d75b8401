"""A million densities from Python beside the same call in C, in turns: how many times as long the median takes.

    KARST_SHARED=build/libkarst.so python3 tests/python/bench_density.py [POINTS] [TURNS]
"""
import ctypes
import os
import sys
import time

import numpy as np

import karst
from conftest import Sampler


class Query(ctypes.Structure):
    _fields_ = [("footprint_m", ctypes.c_double), ("within_m", ctypes.c_double), ("edits", ctypes.c_void_p),
                ("num_edits", ctypes.c_size_t), ("num_threads", ctypes.c_int), ("progress", ctypes.c_void_p),
                ("user", ctypes.c_void_p)]


def main():
    num = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    turns = int(sys.argv[2]) if len(sys.argv) > 2 else 7
    world = karst.World("hills")
    c = Sampler(os.environ["KARST_SHARED"], world.path)
    points = np.random.default_rng(1).uniform(-500, 500, (num, 3))
    at, density = world.positions(points), np.empty(num, np.float32)
    call = c.c.karst_query_densities
    call.argtypes = [ctypes.c_void_p, ctypes.POINTER(Query), ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p,
                     ctypes.c_void_p]
    call.restype = ctypes.c_bool
    times = {"C": [], "Python, positions": [], "Python, float64": []}
    for _ in range(turns):
        start = time.process_time()
        assert call(c.world, ctypes.byref(Query(num_threads=1)), at.ctypes.data, num, density.ctypes.data, None)
        times["C"].append(time.process_time() - start)
        for name, given in (("Python, positions", at), ("Python, float64", points)):
            start = time.process_time()
            found = world.density(given, threads=1)
            times[name].append(time.process_time() - start)
            assert (found == density).all()
    usual = np.median(times["C"])
    for name, seconds in times.items():
        print(f"{name}: {np.median(seconds) * 1e9 / num:.0f} ns a point, {np.median(seconds) / usual:.3f} of C")


if __name__ == "__main__":
    main()
