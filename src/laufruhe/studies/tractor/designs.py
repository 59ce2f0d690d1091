"""Designs of one engine measured side by side: what the study draws as bars (Figs. 12-28)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from laufruhe.machine import Engine, OperatingPoint, Rotor
from laufruhe.physics.metrics import cycle_measures
from laufruhe.problem.decision import Decision, RotorDrive, Sector
from laufruhe.problem.evaluation import Evaluation, evaluate, mount_samples
from laufruhe.problem.measure import MEAN_MOUNT_FORCE, Term
from laufruhe.problem.problem import Problem
from laufruhe.solvers import solve
from laufruhe.studies.tractor import engines as study
from laufruhe.studies.tractor.shafts import SHAFT_PLACE

MOST_UNBALANCE = 0.15
ASSUMED = " ".join(study.ASSUMPTIONS)


@dataclass(frozen=True, eq=False)
class Design:
    """One way to build an engine.

    Attributes
    ----------
    name
        As a picture prints it.
    evaluation
        Loads of the design.
    lower_bound
        Proven bound of the mean force [N] where shafts or webs were sized for it; NaN
        where their sizes are given.
    """

    name: str
    evaluation: Evaluation
    lower_bound: float = math.nan

    @property
    def forces(self) -> NDArray[np.float64]:
        """Mount forces over the cycle, shape (samples, mounts, 3) [N]."""
        return mount_samples(self.evaluation, 0)

    @property
    def mean(self) -> float:
        """Mean over the cycle and over all mounts [N]."""
        return self.evaluation.value(MEAN_MOUNT_FORCE)


def given(name: str, engine: Engine, point: OperatingPoint) -> Design:
    """A design whose unbalances are known."""
    return Design(name, evaluate(_problem(engine, point, ())))


def optimum(name: str, engine: Engine, point: OperatingPoint, decisions: Sequence[Decision]) -> Design:
    """The design of least mean mount force, with its proven bound."""
    result = solve(_problem(engine, point, tuple(decisions)))
    if result.certificate is None:
        return Design(name, result.final)
    return Design(name, result.final, result.certificate.lower_bound)


def open_rotor(name: str, *follows: tuple[str, complex, bool]) -> Decision:
    """Size and angle of a rotor open; others follow with a gain, mirrored where they turn the other way."""
    drives = (RotorDrive(name, 1.0), *(RotorDrive(*follow) for follow in follows))
    return Decision(f"{name}.unbalance", "kg m", Sector(MOST_UNBALANCE), 0j, drives)


def free_webs(cylinders: int) -> tuple[Rotor, ...]:
    """Counterweights at the end throws, not sized yet."""
    x = 0.5 * (cylinders - 1) * study.SPACING
    return tuple(Rotor(f"web {end}", side * x, 0j, radius=0.080) for end, side in (("front", 1.0), ("rear", -1.0)))


def free_shaft(cylinders: int) -> tuple[Rotor, ...]:
    """Two unbalances on a shaft against the crank, not sized yet."""
    x = 0.5 * cylinders * study.SPACING
    return tuple(
        study.balancer(f"shaft {end}", -1.0, (side * x, *SHAFT_PLACE), 0j) for end, side in (("front", 1), ("rear", -1))
    )


def opened(rotors: Sequence[Rotor]) -> tuple[Decision, ...]:
    """Every rotor on its own."""
    return tuple(open_rotor(rotor.name) for rotor in rotors)


def bars(designs: Sequence[Design], title: str) -> xr.Dataset:
    """Mean and maximum of every mount's force for every design."""
    forces = [design.forces for design in designs]
    measures = [[cycle_measures(f[:, m]) for m in range(f.shape[1])] for f in forces]
    means = np.array([design.mean for design in designs])
    bounds = np.array([design.lower_bound for design in designs])
    return xr.Dataset(
        {
            "mean": (("design", "mount"), np.array([[m.mean for m in row] for row in measures]), _newton("mean")),
            "maximum": (("design", "mount"), np.array([[m.max for m in row] for row in measures]), _newton("largest")),
            "mean_of_mounts": (("design",), means, _newton("mean over cycle and mounts")),
            "lower_bound": (("design",), bounds, _newton("proven bound of the mean over cycle and mounts")),
        },
        coords={
            "design": [design.name for design in designs],
            "mount": designs[0].evaluation.mount_names,
        },
        attrs={"title": title, "assumptions": ASSUMED},
    )


def mean_of(data: xr.Dataset, design: str) -> float:
    """Mean force of a design [N]."""
    return float(data["mean_of_mounts"].sel(design=design))


def fall(data: xr.Dataset, before: str, after: str) -> float:
    """Share by which the mean force falls from one design to another."""
    return 1.0 - mean_of(data, after) / mean_of(data, before)


def _newton(name: str) -> dict[str, str]:
    return {"units": "N", "long_name": name}


def _problem(engine: Engine, point: OperatingPoint, decisions: tuple[Decision, ...]) -> Problem:
    return Problem(
        name=engine.name,
        title=engine.name,
        engine=engine,
        points=(point,),
        decisions=decisions,
        objective=(Term(MEAN_MOUNT_FORCE),),
    )
