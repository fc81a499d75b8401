"""What is raised where the library fails."""
from __future__ import annotations

import logging

_log = logging.getLogger("karst")


class Error(Exception):
    """Something went wrong; the message says what, and what to do. `status` is the exit code of the karst command.

    >>> import karst
    >>> karst.World("nowhere")
    Traceback (most recent call last):
    ...
    karst.errors.WorldError: no world is called 'nowhere'; ...
    """

    status = 1


class UsageError(Error, ValueError):
    """An argument is out of its range."""

    status = 2


class DeviceError(Error):
    """There is no usable OpenCL device or display."""

    status = 3


class WorldError(Error, ValueError):
    """A world that is not there or does not compile. The message shows the line and the place."""

    status = 4


class DataError(Error, ValueError):
    """Another file that cannot be read: edits, paths, saved worlds."""

    status = 5


_CLASSES = {2: UsageError, 3: DeviceError, 4: WorldError, 5: DataError}
_LEVELS = {0: logging.ERROR, 1: logging.WARNING, 2: logging.INFO, 3: logging.DEBUG}


def of_status(status: int, message: str) -> Error:
    """The exception that belongs to a status of the library's."""
    return _CLASSES.get(status, Error)(message)


def tell(lines: list[tuple[int, str]]) -> None:
    """Hands what the library said to the logger "karst"."""
    for level, line in lines:
        _log.log(_LEVELS[level], "%s", line)


def of_lines(status: int, message: str, lines: list[tuple[int, str]]) -> Error:
    """The same, with what was said of the error beside: the line of a text, with a caret."""
    details = [text for level, text in lines if level <= 1 and text.replace(" error:", "", 1) != message]
    return of_status(status, "\n".join([message, *details]))
