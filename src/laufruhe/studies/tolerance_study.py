"""Engines within their tolerances side by side: free forces, mount forces, and what finer balancing promises."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr

from laufruhe.errors import ModelError
from laufruhe.problem.problem import Problem
from laufruhe.studies.built_engines import mean_mount_forces
from laufruhe.studies.tolerance import CAUSES, Tolerances, nominal_force, random_forces, worst_parts
from laufruhe.studies.verdict import NEGLIGIBLE, Verdict

SHARES = np.arange(201) / 200.0
MOUNTED = 200
"""Most engines whose mount forces are evaluated: one costs as much as a thousand free forces."""


@dataclass(frozen=True)
class Spread:
    """What tolerances do to the free force of one engine [N].

    Attributes
    ----------
    nominal
        Largest over the cycle, of the engine as drawn.
    worst
        Largest that each cause adds, by its name.
    mean
        Of what is added at random.
    random
        What this share (SHARES) of random engines stay below.
    mount, mount_random
        Mean mount force of the engine as drawn, and what this share of engines as built stay
        below; NaN without mounts.
    speed
        Of the crank [rad/s].
    """

    nominal: float
    worst: dict[str, float]
    mean: float
    random: tuple[float, ...]
    mount: float
    mount_random: tuple[float, ...]
    speed: float


def spread(problem: Problem, tolerances: Tolerances, builds: int = 10_000, seed: int = 1964) -> Spread:
    """Nominal free force, the worst that tolerances add, and how it is distributed over random engines.

    Raises
    ------
    ModelError
        If the problem has several operating points.
    """
    if len(problem.points) != 1:
        raise ModelError(f"'{problem.name}' needs one operating point where tolerances are studied; give it one")
    engine, speed = problem.engine, problem.points[0].speed
    drawn = random_forces(engine, speed, tolerances, builds, seed)
    quantiles = tuple(float(q) for q in np.quantile(drawn, SHARES))
    worst = worst_parts(engine, speed, tolerances)
    mount, mount_random = math.nan, (math.nan,) * len(SHARES)
    if engine.mounts:
        mount, forces = mean_mount_forces(problem, tolerances, min(builds, MOUNTED), seed)
        mount_random = tuple(float(q) for q in np.quantile(forces, SHARES))
    return Spread(nominal_force(problem), worst, float(drawn.mean()), quantiles, mount, mount_random, speed)


def compared(spreads: Mapping[str, Spread]) -> xr.Dataset:
    """Several engines side by side as one labelled dataset."""
    found = list(spreads.values())

    def newton(words: str) -> dict[str, str]:
        return {"units": "N", "long_name": words}

    causes = {
        f"worst_{cause.replace(' ', '_')}": ("case", [own.worst[cause] for own in found], newton(f"from {cause} alone"))
        for cause in CAUSES
    }
    worst = [sum(own.worst.values()) for own in found]
    along = ("case", "share")
    shares, mounts = (np.array([getattr(own, name) for own in found]) for name in ("random", "mount_random"))
    return xr.Dataset(
        {
            "nominal": ("case", [own.nominal for own in found], newton("largest free force of the drawing")),
            "worst": ("case", worst, newton("largest free force that tolerances add")),
            **causes,
            "mean": ("case", [own.mean for own in found], newton("mean of what tolerances add at random")),
            "random": (along, shares, newton("added free force that this share of random engines keeps")),
            "mount": ("case", [own.mount for own in found], newton("mean mount force of the drawing")),
            "mount_random": (along, mounts, newton("mean mount force that this share of built engines keeps")),
        },
        coords={
            "case": list(spreads),
            "share": ("share", SHARES, {"units": "1", "long_name": "share of random engines that stay below"}),
            "speed": ("case", [own.speed for own in found], {"units": "rad/s"}),
        },
        attrs={"title": "Tolerances against free forces", "kind": "tolerance", "source": ""},
    )


def verdicts(data: xr.Dataset) -> tuple[Verdict, ...]:
    """What the source says of finer balancing, engine by engine, confirmed or not.

    It promises nothing where tolerances hardly move the mean mount force: engines built
    without any could not be told from nineteen of twenty built with them (W1 of
    `laufruhe.studies.worth`).
    """
    found = []
    for name in data["case"].values:
        row = data.sel(case=name)
        claim = str(row["claim"].item())
        if claim:
            rise = rise_of(row)
            agrees = (rise < NEGLIGIBLE) == (claim == "promises nothing")
            why = f"W1: under {100.0 * NEGLIGIBLE:.0f} % at 95 of 100 engines built"
            unit = "% of the mean mount force"
            found.append(Verdict(f"finer balancing, {name}", claim, 100.0 * rise, unit, agrees, why))
    return tuple(found)


def rise_of(row: xr.Dataset) -> float:
    """Share by which the mean mount force of 95 of 100 built engines is at most over that of the drawing."""
    often = float(row["mount_random"].sel(share=0.95, method="nearest"))
    return often / float(row["mount"]) - 1.0
