"""Cylinders in two planes: V by its angle (Fig. 29), boxer against inline by order (Fig. 30)."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr

from laufruhe.machine import Cycle, Engine
from laufruhe.machine.layouts import Layout, boxer, build, inline, vee
from laufruhe.numerics.spectrum import order_amplitude
from laufruhe.physics.metrics import turning_parts
from laufruhe.physics.shaking_loads import reciprocating_loads
from laufruhe.studies.tractor import engines as study
from laufruhe.studies.verdict import Verdict

ANGLES = np.arange(0.0, 181.0, 3.0)
ORDERS = (1, 2, 4)
STAGGER = 0.5 * study.SPACING
ENGINES = ("inline", "boxer")
_SPEED = study.speed_of(study.PISTON_SPEED)
_UNIT = study.RECIPROCATING_MASS * study.RADIUS * _SPEED**2


def vee_by_angle() -> xr.Dataset:
    """What two cylinders on one throw leave, by bank angle: parts with and against the crank (Fig. 29)."""
    values = np.array([_turning(math.radians(angle)) for angle in ANGLES]) / _UNIT
    note = {"units": "1", "long_name": "rotating force over m r w^2"}
    return xr.Dataset(
        {"force": (("angle", "order", "direction"), values, note)},
        coords={
            "angle": ("angle", ANGLES, {"units": "deg", "long_name": "bank angle"}),
            "order": [1, 2],
            "direction": ["with the crank", "against the crank"],
        },
        attrs={"title": "Free forces of a V-twin by its angle", "rod_ratio": study.ROD_RATIO},
    )


def _turning(bank_angle: float) -> list[list[float]]:
    load = reciprocating_loads(_engine(vee(2, study.SPACING, bank_angle) if bank_angle else _twin()), _SPEED)
    return [list(turning_parts(*load.at(order)[1:3])) for order in (1, 2)]


def _twin() -> Layout:
    """A vee of angle 0 has both cylinders in one place; a hair apart along the crank it may be built."""
    return vee(2, study.SPACING, 0.0, bank_stagger=1e-6)


def _engine(layout: Layout) -> Engine:
    throws = (0.0, math.pi, math.pi, 0.0) if len(layout.throw_positions) == 4 else (0.0,)
    parts, _ = build(Cycle.FOUR_STROKE, layout, study.mechanism(), throws)
    return Engine(layout.name, Cycle.FOUR_STROKE, parts)


def vee_verdicts(data: xr.Dataset) -> tuple[Verdict, ...]:
    """Of Fig. 29."""
    against = data["force"].sel(order=1, direction="against the crank")
    second = data["force"].sel(order=2).max("direction")
    best = float(against.idxmin("angle"))
    right = float(against.sel(angle=90.0))
    flat, other = float(second.sel(angle=180.0)), float(second.sel(angle=90.0))
    forward = data["force"].sel(order=1, direction="with the crank")
    return (
        Verdict(
            "Bank angle at which crank weights alone balance the first order (Fig. 29)",
            "90 deg",
            best,
            "deg",
            best == 90.0 and right < 1e-12,
            "what turns against the crank vanishes there; what turns with it, "
            f"{float(forward.sel(angle=90.0)):.3g} m r w², a web takes",
        ),
        Verdict(
            "The second order vanishes at 180 deg (Fig. 29)",
            "0",
            flat,
            "m r w²",
            flat < 1e-12,
            f"at 90 deg {other:.3g} m r w² is left",
        ),
    )


def boxer_and_inline() -> xr.Dataset:
    """Free force and couple of four cylinders by order, in line and opposed (Fig. 30)."""
    loads = [
        reciprocating_loads(_engine(layout), _SPEED)
        for layout in (inline(4, study.SPACING), boxer(4, study.SPACING, STAGGER))
    ]
    force = [[float(order_amplitude(load.at(order)[:3])) for order in ORDERS] for load in loads]
    couple = [[float(order_amplitude(load.at(order)[4:])) for order in ORDERS] for load in loads]
    return xr.Dataset(
        {
            "force": (("engine", "order"), np.array(force), {"units": "N", "long_name": "free force"}),
            "couple": (("engine", "order"), np.array(couple), {"units": "N m", "long_name": "free couple"}),
        },
        coords={"engine": list(ENGINES), "order": list(ORDERS)},
        attrs={"title": "Boxer and inline four-cylinder by order", "bank_stagger": STAGGER},
    )


def boxer_verdicts(data: xr.Dataset) -> tuple[Verdict, ...]:
    """Of Fig. 30."""
    force, couple = data["force"], data["couple"]
    first = float(force.sel(order=1).max() + couple.sel(order=1).max())
    second = float(force.sel(engine="inline", order=2))
    moment = float(couple.sel(engine="boxer", order=2))
    clean = float(force.sel(engine="boxer", order=2)) + float(couple.sel(engine="inline", order=2))
    return (
        Verdict(
            "Both are balanced in the first order (Fig. 30)",
            "0",
            first,
            "N, N m",
            first < 1e-9 * second,
            "exact but for rounding",
        ),
        Verdict(
            "In line, the second order adds up to a force (Fig. 30)",
            "force",
            second / study.KILOPOND,
            "kp",
            second > 0.0 and clean < 1e-9 * second,
            "four times one cylinder's; no couple",
        ),
        Verdict(
            "Opposed, it adds up to a couple (Fig. 30)",
            "couple",
            moment,
            "N m",
            moment > 0.0 and clean < 1e-9 * second,
            f"no force; opposite cylinders {1e3 * STAGGER:g} mm apart along the crank, an assumption",
        ),
        Verdict(
            "The couple is less of a burden on mounts with long arms (Fig. 30)",
            "smaller reactions",
            moment / (11.0 * study.SPACING) / (0.5 * second),
            "mount reaction over that of the force",
            moment / (11.0 * study.SPACING) < 0.5 * second,
            "couple over 11 a of the long mounting, against half of the force",
        ),
    )
