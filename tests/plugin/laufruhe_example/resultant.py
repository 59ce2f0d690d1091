"""The resultant of all mount forces."""

from __future__ import annotations

from laufruhe.numerics.spectrum import Spectrum
from laufruhe.problem.channels.kinds import ON_BLOCK, LoadChannel, Needs
from laufruhe.problem.loads import PointLoads


def _resultant(loads: PointLoads) -> Spectrum:
    if loads.mount_forces is None:
        raise ValueError("this mounting has no resultant mount force")
    return loads.mount_forces.each(lambda values: values.sum(axis=1, keepdims=True))


RESULTANT = LoadChannel("resultant mount force", "N", ON_BLOCK, Needs.MOUNTS, signal=_resultant)
