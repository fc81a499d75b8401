"""Edits: land that is added, dug out, flattened."""
from __future__ import annotations

import json
import os
from dataclasses import dataclass
from typing import Any, Iterable, Iterator, Optional, Sequence, Union

from . import _karst
from .camera import Coordinate, _decimal


@dataclass(frozen=True)
class Edit:
    """One edit, as a line of `karst edit --add`. Lengths are metres; places may be decimal texts, which are exact.

    >>> Edit.sphere((300, 60, 400), 12, "remove")
    Edit(text='sphere,300,60,400,12.0,remove')
    """

    text: str

    @classmethod
    def sphere(cls, at: Sequence[Coordinate], radius: float, mode: str = "add", *, blend: float = 0.0,
               normal: Optional[Sequence[float]] = None, strength: Optional[float] = None) -> "Edit":
        """A ball. `mode` is "add", "remove" or "flatten", here as below; or, of a ball alone, "smooth", of which
        `strength` says how much. `normal` is for "flatten" and "smooth"."""
        line = _line("sphere", at, [radius], mode, blend, normal)
        return cls(line if strength is None else f"{line},strength={float(strength)!r}")

    @classmethod
    def box(cls, at: Sequence[Coordinate], half: Sequence[float], mode: str = "add", *, blend: float = 0.0,
            normal: Optional[Sequence[float]] = None) -> "Edit":
        """A box along the axes; `half` its sides."""
        return cls(_line("box", at, half, mode, blend, normal))

    @classmethod
    def capsule(cls, at: Sequence[Coordinate], to: Sequence[Coordinate], radius: float, mode: str = "add", *,
                blend: float = 0.0) -> "Edit":
        """A rounded rod between two points."""
        return cls(_line("capsule", [*at, *to], [radius], mode, blend))

    @classmethod
    def plane(cls, at: Sequence[Coordinate], mode: str = "add", *, normal: Optional[Sequence[float]] = None,
              blend: float = 0.0) -> "Edit":
        """All that lies below the plane through `at`; `normal` points up if it is left out."""
        return cls(_line("plane", at, [], mode, blend, normal))

    @classmethod
    def noise(cls, at: Sequence[Coordinate], radius: float, amplitude: float, scale: float, mode: str = "add", *,
              seed: int = 0, blend: float = 0.0) -> "Edit":
        """A ball whose surface noise makes rough: by so much, in bumps so wide."""
        return cls(_line("noise", at, [radius, amplitude, scale], mode, blend, None, seed))


def _line(shape: str, at: Sequence[Coordinate], numbers: Sequence[float], mode: str, blend: float,
          normal: Optional[Sequence[float]] = None, seed: int = 0) -> str:
    parts = [shape, *map(_decimal, at), *(repr(float(n)) for n in numbers), mode]
    if blend:
        parts.append(f"blend={float(blend)!r}")
    if seed:
        parts.append(f"seed={int(seed)}")
    if normal is not None:
        parts.append("normal=" + ":".join(repr(float(n)) for n in normal))
    return ",".join(parts)


class Edits:
    """Edits for worlds of one voxel, ready for the library: of a file, of a saved world, or made by `World.edits`.

    >>> import karst
    >>> edits = karst.World("hills").edits([karst.Edit.sphere((0, 0, 0), 5)])
    >>> len(edits), edits[0]["shape"]
    (1, 'sphere')
    """

    def __init__(self, data: bytes, voxel_log2_m: int):
        self._data, self._voxel_log2_m = data, voxel_log2_m

    def __len__(self) -> int:
        return len(self._data) // _karst.EDIT_BYTES

    def __getitem__(self, number: int) -> dict[str, Any]:
        if not -len(self) <= number < len(self):
            raise IndexError(f"edit {number} of {len(self)}")
        first = (number % len(self)) * _karst.EDIT_BYTES
        one = self._data[first:first + _karst.EDIT_BYTES]
        return json.loads(_karst.format_edits(one, self._voxel_log2_m)[0])

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return (self[i] for i in range(len(self)))

    def __repr__(self) -> str:
        return f"<karst.Edits: {len(self)}>"


AnyEdits = Union[None, "os.PathLike[str]", str, Edits, Edit, Iterable[Union[Edit, str]]]


def edits_of(edits: AnyEdits, voxel_log2_m: int) -> bytes:
    """The library's array: of Edits, of single ones, of lines, or of a file (a path that ends in .json)."""
    if edits is None:
        return b""
    if isinstance(edits, Edits):
        if edits._voxel_log2_m != voxel_log2_m:
            raise ValueError("these edits are for a world whose voxels are of another size")
        return edits._data
    if isinstance(edits, os.PathLike) or (isinstance(edits, str) and edits.endswith(".json")):
        return _karst.load_edits(os.fspath(edits), voxel_log2_m)
    if isinstance(edits, (Edit, str)):
        edits = [edits]
    return _karst.parse_edits([e.text if isinstance(e, Edit) else e for e in edits], voxel_log2_m)
