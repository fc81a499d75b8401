"""Saved worlds: one file with a world, its edits, a camera and bookmarks."""
from __future__ import annotations

import os
import threading
from typing import Any, Mapping, Optional, Union

from . import _karst
from .camera import Camera, camera_text
from .edits import AnyEdits, Edits, edits_of
from .errors import WorldError, tell
from .world import World


class Saved:
    """A saved world (.karstdb), opened for reading and, where possible, for writing.

    Edits are kept once `commit` has returned; the end of a `with` commits unless there was an exception.

    >>> import tempfile, karst
    >>> folder = tempfile.TemporaryDirectory()
    >>> with karst.Saved.create(folder.name + "/mine.karstdb", "hills") as saved:
    ...     saved.append(karst.Edit.sphere((300, 60, 400), 12, "remove"))
    >>> len(karst.Saved(folder.name + "/mine.karstdb").edits)
    1
    """

    def __init__(self, path: Union[str, os.PathLike[str]], *, for_writing: bool = True):
        self.path = os.fspath(path)
        self._lock = threading.RLock()
        self._handle = _karst.saved_open(self.path, for_writing)
        self._tell()

    @classmethod
    def create(cls, path: Union[str, os.PathLike[str]], world: Union[World, str, os.PathLike[str]], *,
               embed: bool = False, camera: Union[Camera, str, None] = None) -> "Saved":
        """Makes a file that is not there yet, of a world with its parameters and seed. `embed` keeps its text in it;
        a world that was made of a text is always kept so."""
        world = world if isinstance(world, World) else World(world)
        options = {**world._options, "embed": embed or world._folder is not None,
                   "camera": None if camera is None else camera_text(camera)}
        _karst.saved_create(os.fspath(path), options)
        return cls(path)

    @staticmethod
    def recover(path: Union[str, os.PathLike[str]], new_path: Union[str, os.PathLike[str]],
                world: Optional[str] = None) -> list[str]:
        """Makes a new file of all that can be read of a damaged one; returns a line for each thing that is lost."""
        return [line for _, line in _karst.saved_recover(os.fspath(path), os.fspath(new_path), world)]

    def _tell(self) -> None:
        tell(_karst.saved_lines(self._handle))

    def _about(self) -> dict[str, Any]:
        with self._lock:
            return _karst.saved_about(self._handle)

    # ---- what it holds ----

    def world(self) -> World:
        """Its world, with its parameters and seed."""
        about = self._about()
        source = about["text"] or about["world"]
        if source is None:
            raise WorldError(f"which world {self.path} is of is lost: Saved.recover makes a file that knows")
        if about["text"] is None and "/" in source and not os.path.isabs(source):
            source = os.path.join(os.path.dirname(os.path.abspath(self.path)), source)
        return World(source, parameters=dict(about["parameters"]), seed=about["seed"])

    @property
    def parameters(self) -> Mapping[str, float]:
        return dict(self._about()["parameters"])

    @property
    def is_writable(self) -> bool:
        return self._about()["is_writable"]

    @property
    def voxel_log2_m(self) -> int:
        return self._about()["voxel_log2_m"]

    @property
    def camera(self) -> Optional[Camera]:
        """None: the world's own. Setting it takes effect with the next commit."""
        text = self._about()["camera"]
        return None if text is None else Camera.parse(text)

    @camera.setter
    def camera(self, camera: Union[Camera, str, None]) -> None:
        with self._lock:
            _karst.saved_set_camera(self._handle, None if camera is None else camera_text(camera), -1)

    @property
    def bookmarks(self) -> list[Optional[Camera]]:
        """Nine; None where there is none."""
        return [None if text is None else Camera.parse(text) for text in self._about()["bookmarks"]]

    def set_bookmark(self, number: int, camera: Union[Camera, str, None]) -> None:
        """Bookmark 0 to 8."""
        if not 0 <= number <= 8:
            raise ValueError("bookmarks are 0 to 8")
        with self._lock:
            _karst.saved_set_camera(self._handle, None if camera is None else camera_text(camera), number)

    # ---- edits ----

    @property
    def edits(self) -> Edits:
        """Those in force."""
        voxel_log2_m = self.voxel_log2_m
        with self._lock:
            data, _ = _karst.saved_edits(self._handle, voxel_log2_m)
            self._tell()
        return Edits(data, voxel_log2_m)

    @property
    def num_edits(self) -> tuple[int, int]:
        """How many are in force, and how many could be redone; what is not committed counts."""
        with self._lock:
            return _karst.saved_num_edits(self._handle)

    def append(self, edits: AnyEdits) -> None:
        """Appends edits; those that were undone are gone. All are taken or none."""
        voxel_log2_m = self.voxel_log2_m
        with self._lock:
            _karst.saved_append(self._handle, edits_of(edits, voxel_log2_m), voxel_log2_m)

    def undo(self, num: int = 1) -> int:
        """Takes the last edits out of force; returns how many."""
        with self._lock:
            return _karst.saved_undo(self._handle, num)

    def redo(self, num: int = 1) -> int:
        """Takes them back into force; returns how many."""
        with self._lock:
            return _karst.saved_redo(self._handle, num)

    def commit(self) -> None:
        """When it returns, all that was changed is on the disk."""
        with self._lock:
            _karst.saved_commit(self._handle)

    # ---- care ----

    def check(self) -> list[str]:
        """A line for each thing in the file that is wrong."""
        with self._lock:
            return _karst.saved_check(self._handle)

    def compact(self) -> None:
        """Drops edits that were undone, and gives back room. Commits first."""
        with self._lock:
            _karst.saved_compact(self._handle)

    def backup(self, path: Union[str, os.PathLike[str]]) -> None:
        """Copies what is committed to a new file."""
        with self._lock:
            _karst.saved_backup(self._handle, os.fspath(path))

    def close(self) -> None:
        """What was not committed is gone."""
        with self._lock:
            _karst.saved_close(self._handle)

    def __enter__(self) -> "Saved":
        return self

    def __exit__(self, kind: object, *exception: object) -> None:
        try:
            if kind is None:
                self.commit()
        finally:
            self.close()

    def __repr__(self) -> str:
        return f"<karst.Saved '{self.path}'>"
