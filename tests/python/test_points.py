"""Arrays are the library's, bit for bit; points are exact; what is wrong is said."""
import decimal
import os
import signal
import threading
import time

import numpy as np
import pytest

import karst
from karst import _karst

BALL = "float density(vec3 p) { return 5.0 - length(p); }"


@pytest.fixture(scope="module")
def points():
    return np.random.default_rng(3).uniform(-400, 400, (200, 3)) + [1e9, 0, -1e9]


def test_densities_are_the_librarys(hills, sampler, points):
    at = hills.positions(points)
    for footprint in (0.0, 2.0):
        expected = np.array([sampler.density(one, footprint) for one in at])
        assert hills.density(points, footprint).tobytes() == expected.tobytes()
        assert hills.density(at, footprint, threads=3).tobytes() == expected.tobytes()
    assert len(np.unique(expected)) > 100


def test_gradients_are_the_librarys(hills, sampler, points):
    expected = np.array([sampler.gradient(one, 4.0) for one in hills.positions(points)])
    assert hills.gradient(points, 4.0).tobytes() == expected.tobytes()
    assert (hills.gradient(points) != expected).any()


def test_colours_are_the_librarys(hills, sampler, points):
    up = np.array([0, 1, 0], np.float32)
    expected = np.array([sampler.colour(one, up) for one in hills.positions(points)])
    assert hills.colour(points, up).tobytes() == expected.tobytes()
    slopes = hills.gradient(points).astype(np.float64)
    normals = (-slopes / np.sqrt((slopes * slopes).sum(1))[:, None]).astype(np.float32)
    np.testing.assert_allclose(hills.colour(points), hills.colour(points, normals), atol=1e-6)


def test_bounds_are_the_librarys_and_hold(hills, sampler, points):
    half = np.random.default_rng(4).uniform(0, 20, points.shape)
    expected = np.array([sampler.bounds(one, sides, 1.0) for one, sides in zip(hills.positions(points), half)])
    found = hills.bounds(points, half, 1.0)
    assert found.tobytes() == expected.tobytes()
    inside = hills.density(points + half * 0.99)
    assert (found[:, 0] <= inside).all() and (inside <= found[:, 1]).all()


def test_points_of_every_kind(hills):
    metres = np.array([[10.0, 300.0, -7.5]])
    at = hills.positions(metres)
    assert at["voxel"].tolist() == [[160, 4800, -120]] and at["fraction"].tolist() == [[0, 0, 0]]
    voxels = np.array([[160, 4800, -120]])
    texts = [["10", "300", "-7.5"]]
    for same in (voxels, texts, metres.tolist(), metres.astype(np.float32), np.asfortranarray(metres), at):
        assert (hills.positions(same) == at).all()
        assert hills.density(same) == hills.density(metres)
    # A list of whole numbers is metres, as any list.
    assert (hills.positions([[10, 300, -7]])["voxel"] == [160, 4800, -112]).all()
    assert hills.density(np.zeros((4, 5, 3))).shape == (4, 5)
    assert hills.gradient(np.zeros((4, 5, 3))).shape == (4, 5, 3)
    assert hills.density(np.zeros(3)).shape == () and hills.density(np.zeros((0, 3))).shape == (0,)
    assert hills.density(np.zeros((6, 6))[:, ::2]).shape == (6,)


def test_metres_are_rounded_as_the_library_rounds(hills):
    """Near the origin points are converted by a shorter way; decimals of doubles are exact, and go the long one."""
    random = np.random.default_rng(5)
    metres = random.uniform(-1, 1, (300, 3)) * 10.0 ** random.integers(-12, 17, (300, 3))
    texts = [[f"{decimal.Decimal(float(c)):f}" for c in point] for point in metres]
    assert (hills.positions(metres) == hills.positions(texts)).all()


def test_points_are_exact_far_away(hills):
    texts = [["1000000000000000.0625", "-0.5", "1e15"]]
    at = hills.positions(texts)
    assert hills.coordinates(at) == [["1000000000000000.0625", "-0.5", "1000000000000000"]]
    assert hills.density(at) == hills.density(np.array([[16 * 10**15 + 1, -8, 16 * 10**15]]))


@pytest.mark.parametrize("bad, what", [
    (np.array([[0, np.nan, 0]]), "point 0 is not finite"), (np.array([[0, 0, 0], [0, np.inf, 0]]), "point 1 is not"),
    (np.array([[1e30, 0, 0]]), "beyond the world's edge"), (np.array([[2**62 + 1, 0, 0]]), "beyond the world's edge"),
    (np.zeros((3, 2)), "three coordinates"), (5.0, "three coordinates"), ([["1", "two", "3"]], "two"),
])
def test_bad_points(hills, bad, what):
    with pytest.raises(ValueError, match=what):
        hills.density(bad)


def test_bad_arguments(hills):
    with pytest.raises(TypeError, match="int64"):
        hills.density(np.zeros((2, 3), np.int32))
    with pytest.raises(karst.UsageError, match="footprint"):
        hills.density([[0, 0, 0]], -1)
    with pytest.raises(karst.UsageError, match="threads"):
        hills.density([[0, 0, 0]], threads=1000)
    with pytest.raises(karst.UsageError, match="box 1"):
        hills.bounds([[0, 0, 0]], -1)
    with pytest.raises(karst.UsageError, match="no colours"):
        karst.World(BALL).colour([[0, 0, 0]])
    with pytest.raises(karst.UsageError, match="no direction"):
        hills.rays([[0, 0, 0]], [0, 0, 0], 1)
    with pytest.raises(ValueError):
        hills.height_map([0, 0, 0], (1, 1), (0, 1), 1)
    with pytest.raises(ValueError):
        hills.colour(np.zeros((4, 3)), np.zeros((3, 3)))


def test_surfaces():
    ball = karst.World(BALL)
    hits = ball.rays([[0, 20, 0], [9, 20, 0], [0, 0, 0]], [0, -2, 0], 100, within=1e-4)
    assert hits.kind.tolist() == [1, 0, 2] and np.isinf(hits.t[1])
    assert abs(hits.t[0] - 15) < 2e-4 and hits.normal[0].tolist() == [0, 1, 0]
    found = ball.heights([[0, 20, 0], [9, 20, 0]], 100, 3, within=1e-4)
    assert found.count.tolist() == [2, 0] and not found.starts_inside.any()
    np.testing.assert_allclose(found.down[0, :2], [15, 25], atol=2e-4)
    assert np.isnan(found.down[0, 2])
    down = ball.height_map([-6, 20, -2], (12, 4), (2, 6), 100, within=1e-4)
    assert down.shape == (2, 6) and np.isinf(down[0, 0]) and abs(down[0, 2] - (20 - np.sqrt(23))) < 2e-3


def test_edits_count(hills):
    point = [[0.0, 5000.0, 0.0]]
    assert hills.density(point) < 0
    for edits in (karst.Edit.sphere((0, 5000, 0), 9), "sphere,0,5000,0,9", [karst.Edit.box((0, 5000, 0), (9, 9, 9))],
                  hills.edits(karst.Edit.capsule((0, 4990, 0), (0, 5010, 0), 3))):
        assert hills.density(point, edits=edits) > 0
    with pytest.raises(karst.UsageError, match="cube"):
        hills.density(point, edits="cube,0,0,0,1")


def test_edits_of_a_file(hills, tmp_path):
    file = tmp_path / "mine.json"
    file.write_text('{"edits": [{"shape": "sphere", "mode": "add", "at": ["0", "5000", "0"], "radius": 9}]}')
    assert hills.density([[0, 5000, 0]], edits=file) > 0
    assert hills.edits(file)[0]["radius"] == 9 and len(list(hills.edits(str(file)))) == 1
    file.write_text("{")
    with pytest.raises(karst.DataError, match="mine.json"):
        hills.density([[0, 5000, 0]], edits=file)


def test_a_text_that_does_not_compile():
    with pytest.raises(karst.WorldError) as raised:
        karst.World("float density(vec3 p) {\n  return foo(p);\n}")
    assert str(raised.value).startswith("text.karst:2:10: there is no function 'foo'")
    assert "return foo(p);\n" in str(raised.value) and str(raised.value).rstrip().endswith("^")


def test_what_a_world_says(hills):
    assert hills.name == "hills" and hills.has_colour and "relief" in hills.parameters
    other = karst.World("hills", parameters={"relief": 100}, seed=5)
    assert other.parameters["relief"].value == 100 and other.seed == 5
    assert (other.density([[0, 0, 0]]) != hills.density([[0, 0, 0]])).all()
    assert any("parameter" in line for line in hills.check())
    with pytest.raises(karst.WorldError, match="nothing"):
        karst.World("hills", parameters={"nothing": 1})
    with pytest.raises(karst.WorldError, match="hills"):
        karst.World("nowhere")


def test_progress_and_stopping(hills):
    points = np.random.default_rng(1).uniform(-9, 9, (40000, 3))
    shares = []
    expected = hills.density(points, progress=shares.append)
    assert shares == sorted(shares) and len(shares) > 3 and all(0 <= share <= 1 for share in shares)
    with pytest.raises(karst.Error, match="stopped"):
        hills.density(points, threads=1, progress=lambda share: False)

    def fail(share):
        raise KeyError("mine")
    with pytest.raises(KeyError, match="mine"):
        hills.density(points, progress=fail)
    assert (hills.density(points) == expected).all()


def unfilled(world, num):
    """Arguments of a long call, past the class: an array that shows how far it came."""
    points = np.random.default_rng(1).uniform(-9, 9, (num, 3))
    out = np.full(num, np.nan, np.float32)
    return world._terms(0.0, None, 1, None), world.positions(points), out


def test_interrupts(hills):
    """Ctrl-C ends a call before it is done."""
    terms, at, out = unfilled(hills, 4_000_000)
    timer = threading.Timer(0.1, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        _karst.query_densities(terms, at, out)
    timer.join()
    assert np.isnan(out[-1])


def test_other_threads_run_meanwhile(hills):
    """The main thread sees an array half filled; with the interpreter's lock held it could not."""
    terms, at, out = unfilled(hills, 1_000_000)
    thread = threading.Thread(target=_karst.query_densities, args=(terms, at, out))
    thread.start()
    is_seen = False
    while thread.is_alive():
        is_seen = is_seen or not np.isnan(out[0]) and np.isnan(out[-1])
        time.sleep(0.001)
    assert is_seen and not np.isnan(out).any()
