"""What is there: devices, worlds, paths."""
from __future__ import annotations

import json
from typing import Any

from . import _karst


def info() -> dict[str, Any]:
    """Devices, displays and limits, and what is missing, as `karst info --json` has it."""
    return json.loads(_karst.info())


def worlds() -> list[str]:
    """Names of the worlds that come with Karst.

    >>> "hills" in worlds()
    True
    """
    return _karst.data_list("worlds", ".karst")


def paths() -> list[str]:
    """Names of the camera paths that come with Karst."""
    return _karst.data_list("paths", ".json")
