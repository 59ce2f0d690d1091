"""Identity of the program that answers a point: libraries and source."""

from __future__ import annotations

import hashlib
import json
from functools import cache
from pathlib import Path

from laufruhe.numerics.libraries import library_versions

DISPLAY = {"report", "plots", "live", "cli"}
"""Rooms that only show answers."""


@cache
def program() -> str:
    """Return a hash of the code and the libraries that an answer depends on.

    The version alone would retain the points of a changed working copy.
    """
    package = Path(__file__).parents[1]
    digest = hashlib.sha256(json.dumps(library_versions()).encode())
    for path in sorted(package.rglob("*.py")):
        place = path.relative_to(package)
        if place.parts[0] not in DISPLAY:
            digest.update(place.as_posix().encode() + b"\n" + path.read_bytes())
    return digest.hexdigest()
