"""Engines with and without balancer shafts: the study's sizes beside the proven optimum (Figs. 15, 17, 28)."""

from __future__ import annotations

import numpy as np
import xarray as xr

from laufruhe.machine import Cycle, Engine
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.shaking_loads import reciprocating_loads, rotating_loads
from laufruhe.studies.tractor import engines as study
from laufruhe.studies.tractor import shafts
from laufruhe.studies.tractor.designs import Design, bars, fall, free_shaft, free_webs, given, opened, optimum
from laufruhe.studies.verdict import NEGLIGIBLE, NOTICEABLE, UNSTATED, Verdict

WEBS, SHAFT = "webs for half the couple", "with the shaft of the study"
BEST_WEBS, BEST = "webs at the optimum", "shaft and webs at the optimum"
STARS = {"Fig. 26": study.STAR_OF_FIG_26, "Fig. 27": study.STAR_OF_FIG_27}


def two_cylinder() -> xr.Dataset:
    """The two-cylinder with and without the shaft of eq. 24 (Fig. 15)."""
    return _with_shaft(2, "Two cylinders and a first-order shaft")


def three_cylinder() -> xr.Dataset:
    """The three-cylinder with and without the shaft of eq. 25 (Fig. 17)."""
    return _with_shaft(3, "Three cylinders and a first-order shaft")


def _with_shaft(cylinders: int, title: str) -> xr.Dataset:
    point = study.running(study.gas(study.FULL_LOAD))
    throws = study.THROWS[cylinders]
    webs, shaft = shafts.crank_weights(throws), shafts.first_order_shaft(throws)
    free, free_both = free_webs(cylinders), free_webs(cylinders) + free_shaft(cylinders)
    data = bars(
        [
            given(WEBS, study.inline_engine(cylinders, webs), point),
            given(SHAFT, study.inline_engine(cylinders, webs + shaft), point),
            optimum(BEST_WEBS, study.inline_engine(cylinders, free), point, opened(free)),
            optimum(BEST, study.inline_engine(cylinders, free_both), point, opened(free_both)),
        ],
        title,
    )
    return data.assign_attrs(root=float(abs(shafts.couple_star(throws))))


def two_cylinder_verdicts(data: xr.Dataset) -> tuple[Verdict, ...]:
    """Of Fig. 15."""
    gain, best = fall(data, WEBS, SHAFT), fall(data, BEST_WEBS, BEST)
    return (
        Verdict(
            "What the first-order shaft does for two cylinders (Fig. 15)",
            "negligible",
            -100.0 * gain,
            "% of the mean force",
            abs(gain) < NEGLIGIBLE,
            "under 7 %, too little to tell the bars of a printed figure apart",
        ),
        Verdict(
            "The same at the proven optimum of shaft and webs",
            UNSTATED,
            -100.0 * best,
            "% of the mean force",
            abs(best) < NEGLIGIBLE,
            "so the judgement does not hang on the size of eq. 24: no shaft of this kind does more",
        ),
    )


def three_cylinder_verdicts(data: xr.Dataset) -> tuple[Verdict, ...]:
    """Of Fig. 17."""
    gain, best = fall(data, WEBS, SHAFT), fall(data, BEST_WEBS, BEST)
    return (
        Verdict(
            "What the first-order shaft does for three cylinders (Fig. 17)",
            "noticeable, not very large",
            -100.0 * gain,
            "% of the mean force",
            NOTICEABLE < gain < 0.5,
            "between 15 % and a half",
        ),
        Verdict(
            "The same at the proven optimum of shaft and webs",
            UNSTATED,
            -100.0 * best,
            "% of the mean force",
            NOTICEABLE < best < 0.5,
            "the size of eq. 25 is all but the optimum",
        ),
    )


def two_stroke_four() -> xr.Dataset:
    """Both cross-shaped cranks of the two-stroke four, with and without a shaft (Fig. 28)."""
    point = study.running(study.gas(study.TWO_STROKE_LOAD))
    rows, left = [], []
    for star in STARS.values():
        webs, shaft = shafts.crank_weights(star), shafts.first_order_shaft(star)
        free = free_webs(4) + free_shaft(4)
        designs: list[Design] = [
            given(WEBS, study.two_stroke_four(star, webs), point),
            given(SHAFT, study.two_stroke_four(star, webs + shaft), point),
            optimum(BEST, study.two_stroke_four(star, free), point, opened(free)),
        ]
        rows.append(bars(designs, ""))
        left.append([_inertia_left(design.evaluation.engine) for design in designs])
    stars = xr.DataArray(list(STARS), dims="star", name="star")
    note = {"units": "1", "long_name": "inertia left, over m r w^2 (force) and m r w^2 a (couple), of an order"}
    return (
        xr.concat(rows, dim=stars)
        .assign(inertia_left=(("star", "design", "order"), np.array(left), note))
        .assign_coords(order=[1, 2])
        .assign_attrs(title="Two-stroke four-cylinder on its two cranks")
    )


def _inertia_left(engine: Engine) -> list[float]:
    """Largest of force and couples by order, in units of one cylinder."""
    speed = study.speed_of(study.PISTON_SPEED)
    load: Spectrum = reciprocating_loads(engine, speed) + rotating_loads(engine, speed)
    unit = study.RECIPROCATING_MASS * study.RADIUS * speed**2
    scales = unit * np.array([1.0, 1.0, 1.0, study.RADIUS, study.SPACING, study.SPACING])
    assert engine.cycle is Cycle.TWO_STROKE
    return [float(np.abs(load.at(order) / scales).max()) for order in (1, 2)]


def two_stroke_verdicts(data: xr.Dataset) -> tuple[Verdict, ...]:
    """Of Fig. 28."""
    mean = data["mean_of_mounts"] / study.KILOPOND
    first, second = "Fig. 26", "Fig. 27"
    bare = [float(mean.sel(star=star, design=WEBS)) for star in STARS]
    shafted = [float(mean.sel(star=star, design=SHAFT)) for star in STARS]
    left = float(data["inertia_left"].sel(star=second, design=SHAFT).max())
    other = float(data["inertia_left"].sel(star=first, design=SHAFT, order=2))
    return (
        Verdict(
            "Without a shaft the crank of Fig. 26 is better (Fig. 28)",
            "better",
            bare[0] / bare[1],
            "Fig. 26 over Fig. 27, mean",
            bare[0] < bare[1],
            f"{bare[0]:.0f} against {bare[1]:.0f} kp",
        ),
        Verdict(
            "With a shaft the crank of Fig. 27 is better (Fig. 28)",
            "better",
            shafted[1] / shafted[0],
            "Fig. 27 over Fig. 26, mean",
            shafted[1] < shafted[0],
            f"{shafted[1]:.0f} against {shafted[0]:.0f} kp",
        ),
        Verdict(
            "With the shaft of eq. 31 nothing of first and second order is left (Fig. 28)",
            "complete",
            left,
            "of one cylinder's force and couple",
            left < 1e-12,
            "exact but for rounding; exact kinematics have orders 4, 6 too, and gas torque stays",
        ),
        Verdict(
            "On the crank of Fig. 26 a couple of second order is left (Fig. 28)",
            "is left",
            other,
            "m r w^2 a",
            other > 0.1,
            "the sum of the star's places at twice the angles does not vanish",
        ),
    )
