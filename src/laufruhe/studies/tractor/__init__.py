"""Hasselgruber's study of tractor engines (1964), figure by figure.

Every figure is a function without arguments that returns a labelled dataset, and one
that reads the study's statements off it.
"""

from __future__ import annotations

from collections.abc import Callable

import xarray as xr

from laufruhe.studies.tractor import (
    arrangements,
    balancing,
    four_cylinder,
    identification,
    isolation,
    layouts,
    single,
)
from laufruhe.studies.verdict import Verdict

__all__ = ["COMPUTE", "VERDICTS", "Verdict"]

COMPUTE: dict[str, Callable[[], xr.Dataset]] = {
    "fig-02-05-07": single.parts,
    "fig-08-09": single.polar,
    "fig-10": single.fraction,
    "fig-12": layouts.equal_cylinders,
    "fig-13": layouts.equal_power,
    "fig-15": balancing.two_cylinder,
    "fig-17": balancing.three_cylinder,
    "fig-22": four_cylinder.pairs,
    "fig-25": four_cylinder.front,
    "fig-28": balancing.two_stroke_four,
    "fig-29": arrangements.vee_by_angle,
    "fig-30": arrangements.boxer_and_inline,
    "fig-31": isolation.isolation,
    "fig-32": isolation.sag_by_speed,
    "free-force": isolation.free_force,
    "gas-trace": identification.traces,
}
"""Dataset of every figure, by its name."""

VERDICTS: dict[str, Callable[[xr.Dataset], tuple[Verdict, ...]]] = {
    "fig-02-05-07": single.parts_verdicts,
    "fig-08-09": single.polar_verdicts,
    "fig-10": single.fraction_verdicts,
    "fig-12": layouts.equal_cylinder_verdicts,
    "fig-13": layouts.equal_power_verdicts,
    "fig-15": balancing.two_cylinder_verdicts,
    "fig-17": balancing.three_cylinder_verdicts,
    "fig-22": four_cylinder.pairs_verdicts,
    "fig-25": four_cylinder.front_verdicts,
    "fig-28": balancing.two_stroke_verdicts,
    "fig-29": arrangements.vee_verdicts,
    "fig-30": arrangements.boxer_verdicts,
    "fig-31": isolation.isolation_verdicts,
    "fig-32": isolation.sag_verdicts,
    "free-force": isolation.free_force_verdicts,
    "gas-trace": identification.verdicts,
}
"""What the study states, read off the dataset of the same name."""
