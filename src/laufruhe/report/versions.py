"""Versions that a result was made with."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version

import laufruhe

PACKAGES = ("numpy", "scipy", "cvxpy", "clarabel", "casadi")


def version_of(package: str) -> str:
    """Version as installed."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def versions() -> dict[str, str]:
    """Of everything that numbers hang on."""
    own = {"python": platform.python_version(), "laufruhe": laufruhe.__version__}
    return own | {name: version_of(name) for name in PACKAGES}
