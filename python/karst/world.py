"""Worlds: what they say of themselves, and what is at points of them. No device is needed."""
from __future__ import annotations

import os
import shutil
import tempfile
import weakref
from typing import TYPE_CHECKING, Any, Callable, Mapping, NamedTuple, Optional, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _karst
from .camera import Camera
from .edits import AnyEdits, Edits, edits_of
from .errors import of_lines, tell
from .points import positions

if TYPE_CHECKING:
    from .engine import Engine, Picture

#: Told the share done, from 0 to 1; where it returns False the call ends with karst.Error.
Progress = Callable[[float], Optional[bool]]


class Parameter(NamedTuple):
    """A parameter of a world."""

    name: str
    label: str
    unit: str
    value: float
    min: float
    max: float
    step: float
    is_structural: bool
    is_used: bool


class Hits(NamedTuple):
    """Where rays first meet solid."""

    t: NDArray[np.float64]  #: metres along the ray; inf for a miss
    normal: NDArray[np.float64]  #: towards the air; zeros where there is no surface
    kind: NDArray[np.int8]  #: MISS, SURFACE, INSIDE or UNRESOLVED


MISS, SURFACE, INSIDE, UNRESOLVED = range(4)


class Heights(NamedTuple):
    """Surfaces below points."""

    down: NDArray[np.float64]  #: metres below the point, from the top; NaN beyond `count`
    count: NDArray[np.uint32]
    starts_inside: NDArray[np.bool_]


class World:
    """A world: the name of one that comes with Karst, the path of a file, or a text in the world language.

    `parameters` and `seed` are used instead of the world's own. A world never changes; any threads may share one.

    >>> ball = World("float density(vec3 p) { return 5.0 - length(p); }")
    >>> ball.density([[0, 0, 0], [3, 4, 0], [0, 9, 0]])
    array([ 5.,  0., -4.], dtype=float32)
    >>> ball.gradient([[0, 9, 0]]).tolist()
    [[-0.0, -1.0, -0.0]]
    """

    def __init__(self, world: Union[str, os.PathLike[str]], *, parameters: Optional[Mapping[str, float]] = None,
                 seed: Optional[int] = None):
        name = os.fspath(world)
        is_text = isinstance(world, str) and ("{" in name or "\n" in name)
        self._folder: Optional[str] = None
        if is_text:
            name = self._keep_text(name)
        self._options: dict[str, Any] = {"world": name, "seed": seed,
                                         "parameters": [(k, float(v)) for k, v in (parameters or {}).items()]}
        self._handle, error, lines = _karst.world_open(self._options)
        if error:
            raise of_lines(error[0], *self._plain(error[1], lines))
        tell(self._plain("", lines)[1])
        self._about = _karst.world_metadata(self._handle)
        self._engine: Optional["Engine"] = None

    def _keep_text(self, text: str) -> str:
        # Engines read files, too: so a text lies in one as long as its world lives.
        self._folder = tempfile.mkdtemp(prefix="karst-")
        weakref.finalize(self, shutil.rmtree, self._folder, ignore_errors=True)
        path = os.path.join(self._folder, "text.karst")
        with open(path, "w", encoding="utf-8") as file:
            file.write(text)
        return path

    def _plain(self, message: str, lines: list[tuple[int, str]]) -> tuple[str, list[tuple[int, str]]]:
        if not self._folder:
            return message, lines
        folder = self._folder + os.sep
        return message.replace(folder, ""), [(level, line.replace(folder, "")) for level, line in lines]

    # ---- what it says of itself ----

    @property
    def name(self) -> str:
        return self._about["name"]

    @property
    def description(self) -> str:
        return self._about["description"]

    @property
    def author(self) -> str:
        return self._about["author"]

    @property
    def path(self) -> str:
        """Of its file."""
        return self._about["path"]

    @property
    def seed(self) -> int:
        return self._about["seed"]

    @property
    def voxel_log2_m(self) -> int:
        return self._about["voxel_log2_m"]

    @property
    def voxel(self) -> float:
        """How wide a level-0 voxel is, in metres; int64 points count in these."""
        return 2.0 ** self.voxel_log2_m

    @property
    def camera(self) -> Camera:
        """The world's own."""
        return Camera.parse(self._about["camera"])

    @property
    def sun(self) -> tuple[float, float]:
        """A compass bearing and a height, in degrees."""
        return self._about["sun"]

    @property
    def view_distance(self) -> float:
        """Metres."""
        return self._about["view_distance_m"]

    @property
    def has_colour(self) -> bool:
        return self._about["has_colour"]

    @property
    def parameters(self) -> dict[str, Parameter]:
        """Those of its header, by name, in its order, with their values in this world."""
        return {one[0]: Parameter(*one) for one in self._about["parameters"]}

    def check(self) -> list[str]:
        """A report for people: warnings, parameters, bounds, precision, cost."""
        return _karst.world_check(self._handle)

    def try_code(self, device: Optional[str] = None) -> None:
        """Raises if a device's compiler refuses what is made of the world."""
        _karst.world_try_code(self._handle, device)

    def __repr__(self) -> str:
        return f"<karst.World '{self.name}'>"

    # ---- points ----

    def positions(self, points: ArrayLike) -> NDArray[Any]:
        """Exact positions of points: an array of POSITION, which all methods take where they take points.

        float64 is metres; an int64 array is level-0 voxels (`voxel` metres wide); texts are decimal metres, exact at
        any distance. Lists of Python's numbers are metres.

        >>> World("hills").positions([["1e15", "0.5", "0"]])["voxel"].tolist()
        [[16000000000000000, 8, 0]]
        """
        return positions(points, self.voxel_log2_m)

    def coordinates(self, at: NDArray[Any]) -> list[list[str]]:
        """Exact decimals, in metres, of an array of POSITION.

        >>> world = World("hills")
        >>> world.coordinates(world.positions([["1e15", "0.5", "-7"]]))
        [['1000000000000000', '0.5', '-7']]
        """
        return [[_karst.format_coordinate(int(v), int(f), self.voxel_log2_m) for v, f in zip(voxel, fraction)]
                for voxel, fraction in np.ravel(at)]

    def edits(self, edits: AnyEdits) -> Edits:
        """Edits for this world, made ready once."""
        return Edits(edits_of(edits, self.voxel_log2_m), self.voxel_log2_m)

    def _terms(self, footprint: float, edits: AnyEdits, threads: int, progress: Optional[Progress],
               within: float = 0.0) -> tuple[Any, ...]:
        return (self._handle, float(footprint), float(within), edits_of(edits, self.voxel_log2_m), threads, progress)

    def density(self, points: ArrayLike, footprint: float = 0.0, *, edits: AnyEdits = None, threads: int = 0,
                progress: Optional[Progress] = None) -> NDArray[np.float32]:
        """The density at points of shape (..., 3): above 0 in solid, below 0 in air, bit for bit as devices have it.

        `footprint`: without detail finer than so many metres; 0: all there is. `threads`: 0 is one for each core; the
        answers do not depend on it. These three are the same in all methods below.
        """
        at = self.positions(points)
        out = np.empty(at.shape, np.float32)
        _karst.query_densities(self._terms(footprint, edits, threads, progress), at, out)
        return out

    def gradient(self, points: ArrayLike, footprint: float = 0.0, *, edits: AnyEdits = None, threads: int = 0,
                 progress: Optional[Progress] = None) -> NDArray[np.float32]:
        """The density's exact gradient, per metre, of shape (..., 3): it points into the solid."""
        at = self.positions(points)
        out = np.empty((*at.shape, 3), np.float32)
        _karst.query_gradients(self._terms(footprint, edits, threads, progress), at, out)
        return out

    def colour(self, points: ArrayLike, normals: Optional[ArrayLike] = None, footprint: float = 0.0, *,
               edits: AnyEdits = None, threads: int = 0,
               progress: Optional[Progress] = None) -> NDArray[np.float32]:
        """The albedo, linear RGB, of shape (..., 3). `normals` have length 1; None: the density's."""
        at = self.positions(points)
        out = np.empty((*at.shape, 3), np.float32)
        given: Any = b""
        if normals is not None:
            given = np.ascontiguousarray(np.broadcast_to(np.asarray(normals, np.float32), out.shape))
        _karst.query_colours(self._terms(footprint, edits, threads, progress), at, given, out)
        return out

    def bounds(self, centre: ArrayLike, half: ArrayLike, footprint: float = 0.0, *, edits: AnyEdits = None,
               threads: int = 0, progress: Optional[Progress] = None) -> NDArray[np.float64]:
        """Intervals that hold the density everywhere in boxes, by proof: of shape (..., 2).

        `half`: how far each box reaches from its centre along x, y and z, in metres; or one number for all.

        >>> low, high = World("hills").bounds([[0, 5000, 0]], 100)[0]
        >>> bool(high < 0)
        True
        """
        at = self.positions(centre)
        sides = np.ascontiguousarray(np.broadcast_to(np.asarray(half, np.float64), (*at.shape, 3)))
        out = np.empty((*at.shape, 2), np.float64)
        _karst.query_bounds(self._terms(footprint, edits, threads, progress), at, sides, out)
        return out

    # ---- surfaces ----

    def rays(self, origin: ArrayLike, direction: ArrayLike, length: ArrayLike, footprint: float = 0.0, *,
             within: float = 0.0, edits: AnyEdits = None, threads: int = 0,
             progress: Optional[Progress] = None) -> Hits:
        """Where rays first meet solid, within so many metres of it (0: a 128th of the voxel); nothing is stepped over.

        `direction` has any length above 0; `length` is how far the rays go, in metres.
        """
        at = self.positions(origin)
        ways = np.asarray(direction, np.float64)
        shape = np.broadcast_shapes(at.shape, ways.shape[:-1], np.shape(length))
        at = np.ascontiguousarray(np.broadcast_to(at, shape))
        ways = np.ascontiguousarray(np.broadcast_to(ways, (*shape, 3)))
        lengths = np.ascontiguousarray(np.broadcast_to(np.asarray(length, np.float64), shape))
        hits = Hits(np.empty(shape, np.float64), np.empty((*shape, 3), np.float64), np.empty(shape, np.int8))
        _karst.query_rays(self._terms(footprint, edits, threads, progress, within), at, ways, lengths, *hits)
        return hits

    def heights(self, points: ArrayLike, depth: float, surfaces: int = 8, footprint: float = 0.0, *,
                within: float = 0.0, edits: AnyEdits = None, threads: int = 0,
                progress: Optional[Progress] = None) -> Heights:
        """All surfaces below points, at most so many of each, down to `depth` metres. They alternate between entering
        solid and leaving it."""
        at = self.positions(points)
        found = Heights(np.full((*at.shape, surfaces), np.nan), np.empty(at.shape, np.uint32),
                        np.empty(at.shape, np.bool_))
        _karst.query_heights(self._terms(footprint, edits, threads, progress, within), at, float(depth), surfaces,
                             *found)
        return found

    def height_map(self, corner: ArrayLike, size: tuple[float, float], shape: tuple[int, int], depth: float,
                   footprint: float = 0.0, *, within: float = 0.0, edits: AnyEdits = None, threads: int = 0,
                   progress: Optional[Progress] = None) -> NDArray[np.float64]:
        """The topmost surface along verticals: metres below the corner's y, inf where there is none.

        `corner` has the lowest x and z, and the y at which the search begins; `size` is metres along x and z, `shape`
        rows and columns. The first row has the greatest z.
        """
        at = np.ascontiguousarray(self.positions(corner)).reshape(1)
        rows, columns = shape
        if not (1 <= rows <= 16384 and 1 <= columns <= 16384):
            raise ValueError(f"a map of {columns} x {rows} pixels: 1 to 16384 each")
        out = np.empty((rows, columns), np.float64)
        _karst.query_height_map(self._terms(footprint, edits, threads, progress, within), at,
                                (float(size[0]), float(size[1])), (columns, rows), float(depth), out)
        return out

    # ---- pictures ----

    def render(self, camera: Union[Camera, str, None] = None, size: tuple[int, int] = (1280, 720), samples: int = 8,
               **options: Any) -> "Picture":
        """A settled picture, as `karst render` draws it. `options` are those of `Engine`.

        The engine is kept for the next picture; `close` gives its memory back.
        """
        from .engine import Engine

        if self._engine is None or self._engine.options != options or self._engine.is_closed:
            self.close()
            self._engine = Engine(self, size=size, samples=samples, **options)
        return self._engine.render(camera, size, samples)

    def close(self) -> None:
        """Gives back what `render` keeps."""
        if self._engine is not None:
            self._engine.close()
            self._engine = None
