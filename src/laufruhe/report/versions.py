"""Versions that a result was made with."""

from __future__ import annotations

import laufruhe
from laufruhe.numerics.libraries import library_versions


def versions() -> dict[str, str]:
    """Return the versions of everything that numbers depend on, by name."""
    return {"laufruhe": laufruhe.__version__, **library_versions()}
