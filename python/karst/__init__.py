"""Procedural landscapes straight from a density function.

>>> import karst
>>> world = karst.World("hills")
>>> world.density([[0.0, 300.0, 0.0], [0.0, -100.0, 0.0]]) > 0
array([False,  True])

A world answers questions about points (`World.density`, `World.gradient`, `World.colour`, `World.bounds`) and surfaces
(`World.rays`, `World.heights`, `World.height_map`) without any device. Pictures are drawn by an `Engine` on an OpenCL
device; `World.render` is the short way:

    karst.World("hills").render().save("a.png")

Points are float64 arrays of metres, or int64 arrays of voxels, which are exact at any distance; y is up.
Errors are `karst.Error` and what derives from it, with the library's own messages. Warnings go to the logger "karst".
"""
from ._karst import VERSION as __version__
from .camera import Camera, Path
from .edits import Edit, Edits
from .engine import Engine, Picture
from .errors import DataError, DeviceError, Error, UsageError, WorldError
from .info import info, paths, worlds
from .points import POSITION
from .saved import Saved
from .world import Heights, Hits, Parameter, World

__all__ = ["Camera", "DataError", "DeviceError", "Edit", "Edits", "Engine", "Error", "Heights", "Hits", "POSITION",
           "Parameter", "Path", "Picture", "Saved", "UsageError", "World", "WorldError", "__version__", "info", "paths",
           "worlds"]
