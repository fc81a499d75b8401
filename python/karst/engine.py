"""Engines: pictures of a world, on an OpenCL device."""
from __future__ import annotations

import atexit
import os
import tempfile
import threading
from typing import Any, Callable, Mapping, Optional, Sequence, Union

import numpy as np
from numpy.typing import NDArray

from . import _karst
from .camera import Camera, camera_text
from .edits import AnyEdits, edits_of
from .errors import Error, of_lines, tell
from .saved import Saved
from .world import World

#: Told the statistics of each frame; where it returns False the picture is left as it is.
FrameProgress = Callable[[dict[str, Any]], Optional[bool]]

atexit.register(_karst.driver_end)


class Picture:
    """A picture: `colour` is a (height, width, 4) array of bytes, top row first.

    The other arrays are read from the engine when they are first asked for, and only as long as it has drawn nothing
    else; name them in `Engine.render(aovs=...)` to have them at once. In a notebook a picture shows itself.
    """

    def __init__(self, engine: "Engine", serial: int):
        self._engine, self._serial = engine, serial
        self.settled: bool = False  #: it has all the detail that was asked for, or all that the pools hold
        self.stats: dict[str, Any] = {}  #: of its last frame
        self.colour: NDArray[np.uint8] = np.empty((0, 0, 4), np.uint8)
        self._arrays: dict[str, NDArray[np.float32]] = {}

    def aov(self, name: str) -> NDArray[np.float32]:
        """What is known of each pixel: (height, width) of "depth", "level" or "samples"; (height, width, 3) of
        "radiance", "albedo", "normal" or "position"."""
        if name not in self._arrays:
            self._arrays[name] = self._engine._read_aov(name, self._serial)
        return self._arrays[name]

    @property
    def depth(self) -> NDArray[np.float32]:
        """Metres along each ray, inf where nothing is."""
        return self.aov("depth")

    @property
    def normal(self) -> NDArray[np.float32]:
        """Of length 1, world axes, zeros where nothing is."""
        return self.aov("normal")

    @property
    def radiance(self) -> NDArray[np.float32]:
        """Linear light, before exposure and tone."""
        return self.aov("radiance")

    @property
    def albedo(self) -> NDArray[np.float32]:
        return self.aov("albedo")

    @property
    def position(self) -> NDArray[np.float32]:
        """Metres in the world, as far as floats tell; zeros where nothing is."""
        return self.aov("position")

    def save(self, path: Union[str, os.PathLike[str]], aovs: Sequence[str] = ("radiance", "depth", "normal")) -> None:
        """Writes a .png, or an .exr that holds these arrays. The file appears whole or not at all."""
        name = os.fspath(path)
        height, width = self.colour.shape[:2]
        if name.lower().endswith(".png"):
            _karst.write_png(name, self.colour, width, height)
        elif name.lower().endswith(".exr"):
            channels = []
            for aov in aovs:
                names, values = _karst.aov_channels(aov), np.ascontiguousarray(self.aov(aov))
                channels += [(channel, values, i, len(names)) for i, channel in enumerate(names)]
            _karst.write_exr(name, channels, width, height)
        else:
            raise ValueError(f"{name}: a picture is a .png or an .exr")

    def _repr_png_(self) -> bytes:
        with tempfile.TemporaryDirectory(prefix="karst-") as folder:
            path = os.path.join(folder, "picture.png")
            self.save(path)
            with open(path, "rb") as file:
                return file.read()

    def __repr__(self) -> str:
        height, width = self.colour.shape[:2]
        return f"<karst.Picture {width}x{height}, {'settled' if self.settled else 'not settled'}>"


class Engine:
    """Draws a world: a `World`, what makes one, or a `Saved` world, with its edits.

    `size` is width and height in pixels, `samples` rays for each pixel. `exposure` is stops, "auto" or None (the
    world's), `sun` a bearing and a height in degrees, `pool_bytes` the memory of the cache (512 MiB). Other options
    are the fields of the library's karst_engine_config: `detail_px`, `view_distance_m`, `budget_bricks`, `budget_ms`,
    `mirror`, `thin`, `tone`, `refine`, `no_shadows`, `no_blend`, `brick_bits`, `safe_steps`, `display`, `lanes`.

    Threads may share an engine: one waits for another. `close` gives its memory back; so does the end of a `with`.
    """

    _OPTIONS = frozenset(["detail_px", "view_distance_m", "budget_bricks", "budget_ms", "mirror", "thin", "tone",
                          "refine", "no_shadows", "no_blend", "brick_bits", "safe_steps", "display", "lanes"])

    def __init__(self, world: Union[World, Saved, str, os.PathLike[str]], *, device: Optional[str] = None,
                 size: tuple[int, int] = (1280, 720), samples: int = 8, pool_bytes: int = 0,
                 exposure: Union[float, str, None] = None, sun: Optional[tuple[float, float]] = None,
                 edits: AnyEdits = None, **options: Any):
        unknown = set(options) - self._OPTIONS
        if unknown:
            raise TypeError(f"no option {sorted(unknown)[0]}; there are {', '.join(sorted(self._OPTIONS))}")
        own_camera = None
        if isinstance(world, Saved):
            if edits is not None:
                raise ValueError("a saved world has edits of its own: append these to it")
            world, edits, own_camera = world.world(), world.edits, world.camera
        self.world: World = world if isinstance(world, World) else World(world)
        # What `World.render` was given, to know whether it may go on with this engine.
        self.options: dict[str, Any] = dict(options)
        for name, value, usual in (("device", device, None), ("pool_bytes", pool_bytes, 0), ("exposure", exposure, None),
                                   ("sun", sun, None), ("edits", edits, None)):
            if value is not usual and value != usual:
                self.options[name] = value
        self._lock = threading.RLock()
        self._is_busy = False
        self._serial = 0
        self._size = (int(size[0]), int(size[1]))
        self._samples = int(samples)
        self._log: list[bytes] = []  # edits, as they were made, for an engine that is made anew
        self._config: dict[str, Any] = {"display": "none", "tone": "filmic", **options, **self.world._options,
                                        "device": device, "pool_bytes": pool_bytes or None, "sun": sun}
        if isinstance(exposure, str):
            self._config["exposure"] = exposure
        elif exposure is not None:
            self._config.update(exposure="given", exposure_stops=float(exposure))
        self._handle = self._create()
        self._default_camera = own_camera.text if own_camera else _karst.engine_default_camera(self._handle)
        if own_camera:
            _karst.engine_set_camera(self._handle, self._default_camera)
        if edits is not None:
            self.edit(edits)

    # ---- life ----

    def _create(self) -> Any:
        config = {**self._config, "width_px": self._size[0], "height_px": self._size[1], "samples": self._samples}
        handle, error, lines = _karst.engine_create(config)
        if error:
            raise of_lines(error[0], *self.world._plain(error[1], lines))
        tell(lines)
        return handle

    def _remake(self, size: tuple[int, int], samples: int) -> None:
        """Another number of samples is another engine: with the same edits, parameters, sun, time and camera."""
        camera, edits = _karst.engine_camera(self._handle), _karst.engine_num_edits(self._handle)
        values, before, time = self._values(), (self._size, self._samples), _karst.engine_time(self._handle)
        _karst.engine_close(self._handle)
        self._size, self._samples = size, samples
        try:
            self._handle = self._create()
        except Error:
            self._size, self._samples = before
            self._handle = self._create()
            raise
        finally:
            self._restore(camera, values, edits, time)

    def _restore(self, camera: str, values: dict[str, float], edits: tuple[int, int], time: float) -> None:
        _karst.engine_set_camera(self._handle, camera)
        if values:
            _karst.engine_set_parameters(self._handle, list(values.items()))
        _karst.engine_set_time(self._handle, time)
        if sum(edits):
            _karst.engine_edit(self._handle, b"".join(self._log))
            _karst.engine_undo(self._handle, edits[1])

    def close(self) -> None:
        with _turn(self):
            _karst.engine_close(self._handle)
            self._serial += 1
            self._is_closed = True

    _is_closed = False

    @property
    def is_closed(self) -> bool:
        return self._is_closed

    def __enter__(self) -> "Engine":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<karst.Engine of '{self.world.name}'>"

    # ---- the view ----

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, pixels."""
        return self._size

    @size.setter
    def size(self, size: tuple[int, int]) -> None:
        with _turn(self):
            _karst.engine_set_size(self._handle, int(size[0]), int(size[1]))
            self._size = (int(size[0]), int(size[1]))
            self._serial += 1

    @property
    def camera(self) -> Camera:
        with _turn(self):
            return Camera.parse(_karst.engine_camera(self._handle))

    @camera.setter
    def camera(self, camera: Union[Camera, str]) -> None:
        with _turn(self):
            _karst.engine_set_camera(self._handle, camera_text(camera))

    @property
    def sun(self) -> tuple[float, float]:
        """A compass bearing and a height, in degrees. None, when set: the world's."""
        with _turn(self):
            return _karst.engine_sun(self._handle)

    @sun.setter
    def sun(self, sun: Optional[tuple[float, float]]) -> None:
        with _turn(self):
            angles = None if sun is None else (float(sun[0]), float(sun[1]))
            _karst.engine_set_sun(self._handle, angles)
            self._config["sun"] = angles

    @property
    def time(self) -> float:
        """Seconds, -1e9 to 1e9: where particles are, and what `iTime` is. What did not move stays."""
        with _turn(self):
            return _karst.engine_time(self._handle)

    @time.setter
    def time(self, time_s: float) -> None:
        with _turn(self):
            _karst.engine_set_time(self._handle, float(time_s))

    def set_view(self, name: str) -> None:
        """Shows what the engine does from the next frame on: "level", "bricks", "steps", ...; "picture" is the usual."""
        with _turn(self):
            _karst.engine_set_view(self._handle, name)

    # ---- parameters and edits ----

    @property
    def parameters(self) -> dict[str, float]:
        """Values in force."""
        with _turn(self):
            return self._values()

    def _values(self) -> dict[str, float]:
        return {name: _karst.engine_parameter(self._handle, name) for name in self.world.parameters}

    def set_parameters(self, values: Optional[Mapping[str, float]] = None, **more: float) -> None:
        """Sets parameters of the world from the next frame on; the others keep their values."""
        pairs = [(name, float(value)) for name, value in {**(values or {}), **more}.items()]
        with _turn(self):
            _karst.engine_set_parameters(self._handle, pairs)

    def edit(self, edits: AnyEdits) -> None:
        """Appends edits, to be seen from the next frame on. All are taken or none."""
        data = edits_of(edits, self.world.voxel_log2_m)
        with _turn(self):
            num, num_redoable = _karst.engine_num_edits(self._handle)
            _karst.engine_edit(self._handle, data)
            if num_redoable:
                self._log = [b"".join(self._log)[:num * _karst.EDIT_BYTES]]
            self._log.append(data)

    def undo(self, num: int = 1) -> int:
        """Takes the last edits back; returns how many."""
        with _turn(self):
            return _karst.engine_undo(self._handle, num)

    def redo(self, num: int = 1) -> int:
        """Makes them again; returns how many."""
        with _turn(self):
            return _karst.engine_redo(self._handle, num)

    @property
    def num_edits(self) -> tuple[int, int]:
        """How many are in force, and how many could be redone."""
        with _turn(self):
            return _karst.engine_num_edits(self._handle)

    # ---- pictures ----

    def render(self, camera: Union[Camera, str, None] = None, size: Optional[tuple[int, int]] = None,
               samples: Optional[int] = None, aovs: Sequence[str] = (), *, max_frames: int = 0,
               progress: Optional[FrameProgress] = None) -> Picture:
        """A picture that is settled: it has all the detail that was asked for, or all that the pools hold.

        `camera`: None is the world's own, whatever was drawn before. Another number of samples than before makes the
        engine anew. `progress` is told of each frame; Ctrl-C ends a picture between frames.
        """
        with _turn(self):
            size = self._size if size is None else (int(size[0]), int(size[1]))
            if samples is not None and int(samples) != self._samples:
                self._remake(size, int(samples))
            elif size != self._size:
                _karst.engine_set_size(self._handle, *size)
                self._size = size
            _karst.engine_set_camera(self._handle, self._default_camera if camera is None else camera_text(camera))
            self._serial += 1
            settled = _karst.engine_settle(self._handle, max_frames, progress)
            return self._picture(settled, aovs)

    def frame(self, camera: Union[Camera, str, None] = None, aovs: Sequence[str] = ()) -> Picture:
        """One frame, as it then is: what a viewer shows. `camera`: None is the last one."""
        with _turn(self):
            if camera is not None:
                _karst.engine_set_camera(self._handle, camera_text(camera))
            self._serial += 1
            _karst.engine_frame(self._handle)
            return self._picture(None, aovs)

    def _picture(self, settled: Optional[bool], aovs: Sequence[str]) -> Picture:
        _karst.driver_end()
        tell(_karst.engine_lines(self._handle))
        picture = Picture(self, self._serial)
        picture.stats = _karst.engine_stats(self._handle)
        picture.settled = picture.stats["settled"] if settled is None else settled
        picture.colour = np.empty((self._size[1], self._size[0], 4), np.uint8)
        _karst.engine_read(self._handle, "colour", picture.colour)
        for name in aovs:
            picture._arrays[name] = self._array(name)
        return picture

    def _array(self, name: str) -> NDArray[np.float32]:
        width = len(_karst.aov_channels(name))
        array = np.empty((self._size[1], self._size[0]) + ((width,) if width > 1 else ()), np.float32)
        _karst.engine_read(self._handle, name, array)
        return array

    def _read_aov(self, name: str, serial: int) -> NDArray[np.float32]:
        with _turn(self):
            if serial != self._serial:
                raise Error(f"the engine has drawn something else since: render(aovs=['{name}']) keeps it")
            return self._array(name)

    @property
    def stats(self) -> dict[str, Any]:
        """Of the last frame."""
        with _turn(self):
            return _karst.engine_stats(self._handle)

    def check(self) -> None:
        """Looks over the pools; raises if anything is wrong there."""
        with _turn(self):
            _karst.engine_check(self._handle)


class _turn:
    """One thread at a time; and nobody from within an engine's own callback."""

    def __init__(self, engine: Engine):
        self._engine = engine

    def __enter__(self) -> None:
        engine = self._engine
        engine._lock.acquire()
        if engine._is_busy:
            engine._lock.release()
            raise Error("the engine is at work: a progress function cannot use it")
        engine._is_busy = True

    def __exit__(self, *exception: object) -> None:
        self._engine._is_busy = False
        self._engine._lock.release()
