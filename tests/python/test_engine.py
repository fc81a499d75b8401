"""Pictures are those of the command, byte for byte; arrays fit them; engines are used by one at a time."""
import os
import signal
import subprocess
import threading

import numpy as np
import pytest

import karst
from conftest import SMALL

COMMAND = os.environ["KARST"]


def test_a_picture_is_the_commands(hills, tmp_path):
    camera = "10,330,-5,45,-15,60"
    with karst.Engine("hills", size=(96, 64)) as engine:
        picture = engine.render(camera)
        assert picture.settled
        picture.save(tmp_path / "ours.png")
        picture.save(tmp_path / "ours.exr")
    for name in ("theirs.png", "theirs.exr"):
        subprocess.run([COMMAND, "render", "hills", "-q", "--size", "96x64", "--camera", camera, "-o", tmp_path / name],
                       check=True)
    assert (tmp_path / "ours.png").read_bytes() == (tmp_path / "theirs.png").read_bytes()
    assert (tmp_path / "ours.exr").read_bytes() == (tmp_path / "theirs.exr").read_bytes()
    assert picture._repr_png_() == (tmp_path / "ours.png").read_bytes()


def test_arrays_agree(engine, hills):
    picture = engine.render("0,330,0,30,-20", aovs=("depth", "normal", "position"))
    assert picture.colour.shape == (64, 96, 4) and picture.depth.shape == (64, 96)
    assert picture.normal.shape == picture.radiance.shape == picture.albedo.shape == (64, 96, 3)
    land = np.isfinite(picture.depth)
    assert 0.2 < land.mean() < 1
    np.testing.assert_allclose(np.linalg.norm(picture.normal[land], axis=1), 1, atol=1e-3)
    assert (picture.normal[~land] == 0).all() and (picture.aov("level")[~land] == -1).all()
    # A pixel's place is the camera's, its direction and its depth; and near there the density is 0.
    ways = karst.Camera(0, 330, 0, 30, -20, hills.camera.fov).directions((96, 64))
    places = [0, 330, 0] + ways * np.where(land, picture.depth, 1)[..., None]
    assert (np.abs(places - picture.position)[land].max(axis=-1) < 1e-3 * picture.depth[land]).all()
    some = np.zeros_like(land)
    some[2::7, 2::7] = land[2::7, 2::7]
    true = hills.rays([0, 330, 0], ways[some], 2.0 * picture.depth[some].astype(np.float64), within=0.05)
    assert (true.kind == 1).mean() > 0.95
    assert np.median(np.abs(true.t / picture.depth[some] - 1)) < 2e-3
    assert picture.aov("samples").min() == 2


def test_arrays_belong_to_their_picture(engine):
    first = engine.render("0,330,0,30,-20", aovs=["depth"])
    engine.render("0,330,0,90,-20")
    assert first.depth.shape == (64, 96)
    with pytest.raises(karst.Error, match=r"aovs=\['normal'\]"):
        first.normal
    with pytest.raises(karst.UsageError, match="radiance"):
        engine.render().aov("colours")


def test_the_same_picture_again_at_other_sizes_and_samples(engine):
    first = engine.render()
    engine.time = 2.5
    small = engine.render(size=(40, 30), samples=1)
    assert engine.time == 2.5  # of another engine
    engine.time = 0
    assert small.colour.shape == (30, 40, 4) and small.stats["samples"] == 1
    assert (engine.render(size=(96, 64), samples=2).colour == first.colour).all()
    with pytest.raises(karst.UsageError):
        engine.render(samples=5000)
    assert (engine.render().colour == first.colour).all()
    with pytest.raises(karst.UsageError):
        engine.render(size=(0, 5))


def test_edits_parameters_sun(engine):
    plain = engine.render()
    engine.edit([karst.Edit.sphere((40, 290, 80), 20), "sphere,60,290,80,9"])
    assert engine.num_edits == (2, 0)
    edited = engine.render()
    assert (edited.colour != plain.colour).any()
    assert engine.undo() == 1 and engine.num_edits == (1, 1)
    one = engine.render()
    again = engine.render(samples=1)
    assert engine.num_edits == (1, 1) and again.stats["samples"] == 1
    assert (engine.render(samples=2).colour == one.colour).all()
    assert engine.redo(9) == 1
    assert (engine.render().colour == edited.colour).all()
    assert engine.undo(9) == 2
    engine.set_parameters(relief=100)
    assert engine.parameters["relief"] == 100 and (engine.render().colour != plain.colour).any()
    engine.set_parameters({"relief": 440})
    engine.sun = (300, 10)
    assert engine.sun == (300, 10) and (engine.render().colour != plain.colour).any()
    engine.sun = None
    assert (engine.render().colour == plain.colour).all()
    assert engine.time == 0
    with pytest.raises(karst.UsageError, match="time"):
        engine.time = float("nan")
    engine.check()
    with pytest.raises(karst.UsageError, match="nothing"):
        engine.set_parameters(nothing=1)


def test_frames_and_paths(engine, hills):
    path = karst.Path("low-flight", hills)
    assert path.world == "hills" and path.end > path.start
    frames = [engine.frame(path.camera(seconds)) for seconds in (0, 0.5, 1)]
    assert [f.stats["frame"] for f in frames] == list(range(frames[0].stats["frame"], frames[0].stats["frame"] + 3))
    assert frames[0].stats["bricks_produced"] > 0 and frames[0].stats["stages_ns"]["cast"] > 0
    with pytest.raises(karst.DataError, match="nowhere"):
        karst.Path("nowhere", hills)


def test_progress(engine):
    told = []
    picture = engine.render("5,330,0,30,-20", progress=told.append)
    assert told[-1]["frame"] == picture.stats["frame"] and told[-1]["settled"]
    stopped = engine.render("500,330,0,30,-20", progress=lambda stats: False)
    assert not stopped.settled

    def use(stats):
        engine.camera
    with pytest.raises(karst.Error, match="at work"):
        engine.render(progress=use)

    def interrupt(stats):
        os.kill(os.getpid(), signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        engine.render("900,330,0,30,-20", progress=interrupt)
    assert engine.render("900,330,0,30,-20").settled


def test_threads_take_turns(engine):
    pictures = {}

    def draw(yaw):
        pictures[yaw] = engine.render(f"0,330,0,{yaw},-20").colour
    threads = [threading.Thread(target=draw, args=(yaw,)) for yaw in (0, 120, 240)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for yaw, colour in pictures.items():
        assert (engine.render(f"0,330,0,{yaw},-20").colour == colour).all()


def test_what_is_refused(hills):
    with pytest.raises(TypeError, match="colour_of_the_sky"):
        karst.Engine(hills, colour_of_the_sky=1)
    for options in ({"tone": "loud"}, {"display": "paper"}, {"thin": "perhaps"}, {"exposure": "bright"},
                    {"detail_px": 1000.0}, {"samples": 0, "budget_ms": -5.0}, {"pool_bytes": 1000}):
        with pytest.raises(karst.UsageError):
            karst.Engine(hills, **{**SMALL, **options})
    with pytest.raises(karst.DeviceError):
        karst.Engine(hills, device="no such device", **SMALL)
    with pytest.raises(ValueError):
        karst.Engine(hills, **{**SMALL, "size": (-1, 5)})
    with pytest.raises(ValueError, match="camera"):
        karst.Camera.parse("1,2,3")


def test_closed(hills, tmp_path):
    engine = karst.Engine(hills, **SMALL)
    picture = engine.render()
    engine.close()
    engine.close()
    with pytest.raises(ValueError, match="closed"):
        engine.render()
    assert picture.colour.any()
    with pytest.raises(karst.Error):
        picture.depth
    with pytest.raises(karst.Error, match="folder"):
        picture.save(tmp_path / "no such folder" / "a.png")
    with pytest.raises(ValueError, match="a.jpg"):
        picture.save("a.jpg")


def test_worlds_render_by_themselves():
    ball = karst.World("float density(vec3 p) { return 5.0 - length(p); }")
    options = {"size": (40, 30), "samples": 1, "pool_bytes": 64 << 20}
    first = ball.render("0,0,-20,0,0", **options)
    engine = ball._engine
    assert (ball.render("0,0,-20,0,0", **options).colour == first.colour).all() and ball._engine is engine
    assert abs(np.nanmin(first.depth if ball._engine._serial == first._serial else [15]) - 15) < 0.5
    ball.close()
