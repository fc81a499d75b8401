"""Cameras, and paths along which they fly."""
from __future__ import annotations

import os
from dataclasses import dataclass
from decimal import Decimal
from typing import Optional, Union

import numpy as np
from numpy.typing import NDArray

from . import _karst

Coordinate = Union[float, int, str, Decimal]


def _decimal(value: Coordinate) -> str:
    # Doubles have exact decimals; what numpy calls a float is one, too.
    if isinstance(value, str):
        return value
    if isinstance(value, (int, Decimal)):
        return f"{value:f}" if isinstance(value, Decimal) else str(value)
    return f"{Decimal(float(value)):f}"


@dataclass(frozen=True)
class Camera:
    """Where one stands, in metres (y is up), and looks, in degrees.

    `yaw` is a compass bearing: 0 looks along +z, 90 along +x. `pitch` 90 looks straight up. `fov` is vertical; None:
    the world's. Coordinates may be decimal texts, which are exact at any distance.

    >>> Camera("1e12", 300, 0, yaw=30).text
    '1e12,300,0,30.0,0.0'
    >>> Camera.parse("0,320,0,30,-12,60")
    Camera(x='0', y='320', z='0', yaw=30.0, pitch=-12.0, fov=60.0)
    """

    x: Coordinate = 0.0
    y: Coordinate = 0.0
    z: Coordinate = 0.0
    yaw: float = 0.0
    pitch: float = 0.0
    fov: Optional[float] = None

    @property
    def text(self) -> str:
        """As the option --camera of the command takes it."""
        parts = [_decimal(self.x), _decimal(self.y), _decimal(self.z), repr(float(self.yaw)), repr(float(self.pitch))]
        return ",".join(parts if self.fov is None else [*parts, repr(float(self.fov))])

    @classmethod
    def parse(cls, text: str) -> "Camera":
        """Of "X,Y,Z,YAW,PITCH[,FOV]"; its coordinates stay exact."""
        parts = [part.strip() for part in text.split(",")]
        if len(parts) not in (5, 6):
            raise ValueError(f"a camera is X,Y,Z,YAW,PITCH[,FOV], not '{text}'")
        return cls(parts[0], parts[1], parts[2], *map(float, parts[3:]))

    def axes(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """The viewer's right, up and forward, of length 1, in the world's axes."""
        yaw, pitch = np.radians(self.yaw), np.radians(self.pitch)
        right = np.array([np.cos(yaw), 0.0, -np.sin(yaw)])
        forward = np.array([np.sin(yaw) * np.cos(pitch), np.sin(pitch), np.cos(yaw) * np.cos(pitch)])
        return right, np.cross(forward, right), forward

    def directions(self, size: tuple[int, int]) -> NDArray[np.float64]:
        """Of the rays through the pixels' centres of a picture of this width and height: (height, width, 3), of
        length 1.

        >>> Camera(fov=60.0).directions((3, 3))[1, 1].tolist()
        [0.0, 0.0, 1.0]
        """
        if self.fov is None:
            raise ValueError("a camera without fov has no directions of its own: dataclasses.replace(camera, fov=...)")
        width, height = size
        right, up, forward = self.axes()
        pixel = 2 * np.tan(np.radians(self.fov) / 2) / height
        x = (np.arange(width) + 0.5 - width / 2) * pixel
        y = (height / 2 - np.arange(height) - 0.5) * pixel
        ways = forward + x[None, :, None] * right + y[:, None, None] * up
        return ways / np.linalg.norm(ways, axis=-1, keepdims=True)


def camera_text(camera: Union[Camera, str]) -> str:
    """Of a camera, or of a text that is one already."""
    return camera.text if isinstance(camera, Camera) else camera


class Path:
    """A path of a camera: the name of one that comes with Karst (see `karst.paths`), or a file.

    >>> import karst
    >>> path = karst.Path("low-flight", karst.World("hills"))
    >>> path.start, path.end
    (0.0, 30.0)
    >>> path.camera(1.5).fov
    65.0
    """

    def __init__(self, path: Union[str, os.PathLike[str]], world: object):
        self._voxel_log2_m: int = world.voxel_log2_m  # type: ignore[attr-defined]
        (self._handle, self.start, self.end, self.world,
         self.description) = _karst.path_load(os.fspath(path), self._voxel_log2_m)

    def camera(self, seconds: float) -> Camera:
        """The camera at a time."""
        return Camera.parse(_karst.path_sample(self._handle, float(seconds), self._voxel_log2_m))
