"""Points in a world, as arrays."""
from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _karst

#: An exact position, as the library has it: per axis a voxel, and a fraction of it in units of 2^-32. Arrays of it are
#: read where they lie.
POSITION = np.dtype([("voxel", np.int64, 3), ("fraction", np.uint32, 3)], align=True)
assert POSITION.itemsize == _karst.POSITION_BYTES


def positions(points: ArrayLike, voxel_log2_m: int) -> NDArray[Any]:
    """Exact positions of points: an array of POSITION, whose shape is that of the points without their last axis."""
    if isinstance(points, np.ndarray) and points.dtype == POSITION:
        return np.ascontiguousarray(points)
    array = np.asarray(points)
    if array.ndim == 0 or array.shape[-1] != 3:
        raise ValueError(f"points have three coordinates each, x, y and z: an array of shape (..., 3), not {array.shape}")
    if array.dtype.kind in "US":
        return _parse(array.astype(str), voxel_log2_m)
    if isinstance(points, np.ndarray) and array.dtype.kind in "iu" and array.dtype != np.int64:
        raise TypeError(f"points are float64 metres or int64 voxels, not {array.dtype}: convert them to say which")
    is_voxels = isinstance(points, np.ndarray) and array.dtype == np.int64
    array = np.ascontiguousarray(array, dtype=np.int64 if is_voxels else np.float64)
    out = np.empty(array.shape[:-1], POSITION)
    _karst.convert_positions(array, not is_voxels, voxel_log2_m, out)
    return out


def _parse(texts: NDArray[Any], voxel_log2_m: int) -> NDArray[Any]:
    """Of decimal texts."""
    rows = texts.reshape(-1, 3)
    joined = b"".join(_karst.parse_position(*map(str, row), voxel_log2_m) for row in rows)
    return np.frombuffer(joined, POSITION).reshape(texts.shape[:-1]).copy()
