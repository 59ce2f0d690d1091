"""Loads inside the crankcase: their places, and how a load times a factor of sizes makes a channel (Z1)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

from laufruhe.machine import Engine, OperatingPoint
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.fidelity import Fidelity
from laufruhe.problem.channels.kinds import (
    AT_BEARINGS,
    AT_CYLINDERS,
    IN_CYLINDERS,
    OF_BEARINGS,
    Factor,
    LoadChannel,
    Need,
    Needs,
    of_what_moves,
)
from laufruhe.problem.loads import PointLoads


def _names_of_bearings(engine: Engine) -> Sequence[str]:
    return [bearing.name for bearing in engine.bearings]


def names_of_cylinders(engine: Engine) -> Sequence[str]:
    """Return the names of the places of loads of cylinders."""
    return [part.name for part in engine.slider_cranks]


Where: TypeAlias = tuple[tuple[str, ...], Need, Callable[[Engine], Sequence[str]]]
"""Keys that narrow a load, what it needs, and the names of its places."""
IN_EACH_CYLINDER: Where = (IN_CYLINDERS, Needs.NOTHING, names_of_cylinders)
AT_EACH_CRANK_PIN: Where = (AT_CYLINDERS, Needs.NOTHING, names_of_cylinders)
AT_EACH_BEARING: Where = (AT_BEARINGS, Needs.BEARINGS, _names_of_bearings)
OF_EACH_BEARING: Where = (OF_BEARINGS, Needs.BEARINGS, _names_of_bearings)
Load: TypeAlias = Callable[[Engine, OperatingPoint, Fidelity], Spectrum]


def inside(name: str, unit: str, where: Where, load: Load, factor: Factor | None = None) -> LoadChannel:
    """A load inside the crankcase, of every place, times a factor of its sizes where one is given."""

    def signal(moving: Engine, at: PointLoads) -> Spectrum:
        found = load(moving, at.point, at.fidelity)
        if factor is None:
            return found
        factors = factor(moving, at.point)
        by = factors if factors.ndim > 1 else factors[:, None]
        return found.each(lambda values: values * by)

    keys, needs, places = where
    told = of_what_moves(name, signal)
    return LoadChannel(name, unit, keys, needs, signal=told, places=places, of_sizes=factor)
