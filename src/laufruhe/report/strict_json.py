"""Strict JSON for scripts: no NaN, the maker first, one line feed at the end; and the versions of the maker."""

from __future__ import annotations

import json
import math
import re
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from laufruhe.numerics.libraries import library_versions
from laufruhe.version import __version__

MADE_BY = {"made_by": "laufruhe"}
_BEGIN = re.compile(
    rb'(\[\s*)?{\s*"made_by": "laufruhe"|([#$] | +-1\n +164\n +1|CDF[\1\2].*)made by laufruhe ', re.DOTALL
)
"""Start of a file of this package: JSON, a text with comments, a universal file, or netCDF-3."""
LONGEST_BEGIN = 1000
"""Number of bytes at the start of a file that must name its maker."""


def versions() -> dict[str, str]:
    """Return the versions of everything that numbers depend on, by name."""
    return {"laufruhe": __version__, **library_versions()}


def made_with() -> str:
    """Return the sentence of reports that names these versions."""
    return "Made with " + ", ".join(f"{name} {version}" for name, version in versions().items()) + "."


def is_ours(path: Path) -> bool:
    """Return True if a file may be overwritten: it is empty, or begins as files of this package do."""
    with suppress(OSError), path.open("rb") as stream:
        begin = stream.read(LONGEST_BEGIN)
        return not begin or _BEGIN.match(begin) is not None
    return False


def strict(content: Any, indent: int = 2) -> str:
    """Return JSON of plain Python and NumPy values: the maker first, null for numbers that are not finite."""
    if isinstance(content, dict):
        content = {**MADE_BY, **content}
    return json.dumps(finite(content), indent=indent, ensure_ascii=False, allow_nan=False) + "\n"


def finite(value: Any) -> Any:
    """Return the value with null for numbers that are not finite."""
    if isinstance(value, dict):
        return {key: finite(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [finite(entry) for entry in value]
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return value
