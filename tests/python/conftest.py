"""What the tests of the Python module share. tests/python/run.sh says where things are."""
import ctypes
import os

import numpy as np
import pytest

import karst

#: Small enough for a test.
SMALL = {"size": (96, 64), "samples": 2, "pool_bytes": 64 << 20}


class Position(ctypes.Structure):
    _fields_ = [("voxel", ctypes.c_int64 * 3), ("fraction", ctypes.c_uint32 * 3)]


class Sample(ctypes.Structure):
    _fields_ = [("device", ctypes.c_float), ("precise", ctypes.c_double)]


class Config(ctypes.Structure):
    _fields_ = [("world", ctypes.c_char_p), ("parameters", ctypes.c_void_p), ("num_parameters", ctypes.c_size_t),
                ("has_seed", ctypes.c_bool), ("seed", ctypes.c_uint32), ("log", ctypes.c_void_p)]


class Sampler:
    """The shared library itself, point by point, past the module."""

    def __init__(self, library, path):
        self.c = ctypes.CDLL(library)
        for name, result, arguments in (
                ("karst_world_open", ctypes.c_void_p, [ctypes.POINTER(Config), ctypes.c_void_p]),
                ("karst_sampler_create", ctypes.c_void_p, [ctypes.c_void_p, ctypes.c_void_p]),
                ("karst_sampler_density", Sample, [ctypes.c_void_p, ctypes.POINTER(Position), ctypes.c_double]),
                ("karst_sampler_gradient", ctypes.c_bool,
                 [ctypes.c_void_p, ctypes.POINTER(Position), ctypes.c_double, ctypes.c_void_p, ctypes.c_void_p]),
                ("karst_sampler_colour", ctypes.c_bool,
                 [ctypes.c_void_p, ctypes.POINTER(Position), ctypes.c_void_p, ctypes.c_double, ctypes.c_void_p]),
                ("karst_sampler_bounds", ctypes.c_bool,
                 [ctypes.c_void_p, ctypes.POINTER(Position), ctypes.c_void_p, ctypes.c_double, ctypes.c_void_p])):
            function = getattr(self.c, name)
            function.restype, function.argtypes = result, arguments
        self.world = self.c.karst_world_open(ctypes.byref(Config(world=path.encode())), None)
        self.sampler = self.c.karst_sampler_create(self.world, None)
        assert self.sampler

    @staticmethod
    def position(one):
        return Position((ctypes.c_int64 * 3)(*map(int, one["voxel"])), (ctypes.c_uint32 * 3)(*map(int, one["fraction"])))

    def density(self, one, footprint=0.0):
        return np.float32(self.c.karst_sampler_density(self.sampler, self.position(one), footprint).device)

    def gradient(self, one, footprint=0.0):
        values = (Sample * 3)()
        assert self.c.karst_sampler_gradient(self.sampler, self.position(one), footprint, values, None)
        return np.array([v.device for v in values], np.float32)

    def colour(self, one, normal, footprint=0.0):
        values = (Sample * 3)()
        assert self.c.karst_sampler_colour(self.sampler, self.position(one), (ctypes.c_float * 3)(*normal), footprint,
                                           values)
        return np.array([v.device for v in values], np.float32)

    def bounds(self, one, half, footprint=0.0):
        ends = (ctypes.c_double * 2)()
        self.c.karst_sampler_bounds(self.sampler, self.position(one), (ctypes.c_double * 3)(*half), footprint, ends)
        return np.array(ends[:])


@pytest.fixture(scope="session")
def hills():
    return karst.World("hills")


@pytest.fixture(scope="session")
def sampler(hills):
    return Sampler(os.environ["KARST_SHARED"], hills.path)


@pytest.fixture(scope="session")
def engine(hills):
    with karst.Engine(hills, **SMALL) as engine:
        yield engine


def pytest_runtest_logreport(report):
    """A line for each test, for tests/python/run.sh."""
    if "TAP" not in os.environ or (report.when != "call" and report.outcome == "passed"):
        return
    kind = {"passed": "ok", "failed": "not ok", "skipped": "skip"}[report.outcome]
    with open(os.environ["TAP"], "a", encoding="utf-8") as file:
        file.write(f"{kind} - {report.nodeid.split('/')[-1]}\n")
