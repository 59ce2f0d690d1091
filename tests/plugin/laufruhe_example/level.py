"""The horizontal part of mount forces."""

from __future__ import annotations

from laufruhe.numerics.spectrum import Spectrum
from laufruhe.problem.channels import AT_MOUNTS, LoadChannel, Needs
from laufruhe.problem.loads import PointLoads


def _horizontal(loads: PointLoads) -> Spectrum:
    if loads.mount_forces is None:
        raise ValueError("this mounting has no horizontal mount force")
    return loads.mount_forces.mapped(lambda values: values[..., :2])


HORIZONTAL = LoadChannel("horizontal mount force", "N", AT_MOUNTS, Needs.MOUNTS, signal=_horizontal)
