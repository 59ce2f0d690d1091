"""Elastic mounting by one mass on a spring: isolation (Fig. 31) and sag (Fig. 32); free force against tolerances."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from laufruhe.physics.elastic_mounts import single_transmissibility
from laufruhe.physics.modes import sag_for_critical_speed, sag_frequency
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.studies.tractor import engines as study
from laufruhe.studies.verdict import Verdict

Array = NDArray[np.float64]

RPM = math.pi / 30.0
DAMPINGS = (0.0, 0.5, 1.0, 2.0, 4.0)
SPEED_RATIOS = np.linspace(0.0, 3.0, 301)
CRITICAL_SPEEDS = np.arange(150.0, 1001.0, 10.0)
EXAMPLE_SPEED = 400.0


def transmissibility(speed_ratio: Array, damping: float) -> Array:
    """Force on the foundation over the exciting force, loss factor eta = psi / (2 pi) (eq. 40, Fig. 31)."""
    with np.errstate(divide="ignore"):
        return single_transmissibility(speed_ratio, damping / math.tau)


def isolation() -> xr.Dataset:
    """Transmissibility over the speed ratio for several dampings (Fig. 31)."""
    values = np.array([transmissibility(SPEED_RATIOS, psi) for psi in DAMPINGS])
    crossing = [_crossing(psi) for psi in DAMPINGS]
    return xr.Dataset(
        {
            "transmissibility": (("damping", "speed_ratio"), values, {"units": "1"}),
            "isolates_from": (("damping",), crossing, {"units": "1", "long_name": "speed ratio of isolation"}),
        },
        coords={
            "damping": ("damping", list(DAMPINGS), {"units": "1", "long_name": "psi = A_D / A_F"}),
            "speed_ratio": ("speed_ratio", SPEED_RATIOS, {"units": "1", "long_name": "n / n_crit"}),
        },
        attrs={"title": "Isolation of an elastic mounting"},
    )


def _crossing(damping: float) -> float:
    """Speed ratio over one at which as much comes through as goes in, by bisection."""
    low, high = 1.05, 3.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        through = float(transmissibility(np.array([middle]), damping)[0])
        low, high = (middle, high) if through > 1.0 else (low, middle)
    return 0.5 * (low + high)


def isolation_verdicts(data: xr.Dataset) -> tuple[Verdict, ...]:
    """Of Fig. 31."""
    crossing = data["isolates_from"].values
    return (
        Verdict(
            "Speed ratio from which a mounting isolates, whatever its damping (Fig. 31)",
            "sqrt 2",
            float(crossing.mean()),
            "n / n_crit",
            bool(np.abs(crossing - math.sqrt(2.0)).max() < 1e-9),
            "exact for a loss factor that does not depend on frequency",
        ),
    )


def sag_by_speed() -> xr.Dataset:
    """Static sag over the critical speed for orders one and two (Fig. 32)."""
    orders = (1, 2)
    example = [sag_for_critical_speed(EXAMPLE_SPEED * RPM, order) for order in orders]
    return xr.Dataset(
        {
            "sag": (
                ("order", "critical_speed"),
                np.array([[sag_for_critical_speed(n * RPM, order) for n in CRITICAL_SPEEDS] for order in orders]),
                {"units": "m", "long_name": "static sag"},
            ),
            "example": (("order",), example, {"units": "m"}),
        },
        coords={
            "order": list(orders),
            "critical_speed": ("critical_speed", CRITICAL_SPEEDS, {"units": "rpm", "long_name": "critical speed"}),
        },
        attrs={"title": "Static sag of an elastic mounting"},
    )


def sag_verdicts(data: xr.Dataset) -> tuple[Verdict, ...]:
    """Of Fig. 32."""
    one, two = (1e3 * float(data["example"].sel(order=order)) for order in (1, 2))
    softer = 60.0 * sag_frequency(1e-3 * two)
    return (
        Verdict(
            "Sag for a critical speed of 400 rpm and excitation of first order (Fig. 32)",
            "5.6 mm",
            one,
            "mm",
            abs(one - 5.6) <= 0.05,
            "to the digits printed",
        ),
        Verdict(
            "Sag for excitation of second order only (Fig. 32)",
            "1.4 mm",
            two,
            "mm",
            abs(two - 1.4) <= 0.05,
            "to the digits printed",
        ),
        Verdict(
            "Where unbalance, of first order, excites the mounting of 1.4 mm (text on Fig. 32)",
            "800 rpm",
            softer,
            "rpm",
            abs(softer - 800.0) <= 5.0,
            "twice the critical speed of second order",
        ),
    )


def free_force() -> xr.Dataset:
    """Free force of second order of the four-cylinder, against the 1000 and 100 kp of the tolerance argument."""
    speeds = np.linspace(4.0, 14.0, 41)
    engine = study.inline_engine(4)
    forces = [abs(shaking_loads(engine, study.running(None, float(speed))).at(2)[2]) for speed in speeds]
    return xr.Dataset(
        {"force": (("speed",), np.array(forces), {"units": "N", "long_name": "free force of second order"})},
        coords={"speed": ("speed", speeds, {"units": "m/s", "long_name": "mean piston speed"})},
        attrs={"title": "Free force of second order against tolerances", "claimed_force": 1000.0, "claimed_sum": 100.0},
    )


def free_force_verdicts(data: xr.Dataset) -> tuple[Verdict, ...]:
    """Of the section on errors of balancing."""
    force = float(data["force"].interp(speed=study.PISTON_SPEED)) / study.KILOPOND
    return (
        Verdict(
            "Free force of second order of a four-cylinder vehicle diesel",
            "about 1000 kp",
            force,
            "kp",
            0.5 <= force / 1000.0 <= 2.0,
            "another engine than the study's own: an order of size only. Four pistons of 1.25 kg at 10 m/s make this "
            f"much, and 1000 kp at {study.PISTON_SPEED * math.sqrt(1000.0 / force):.1f} m/s",
        ),
        Verdict(
            "It is several times the worst sum of tolerances, 100 kp",
            "10 times",
            force / 100.0,
            "times",
            force / 100.0 > 3.0,
            "the 100 kp are taken as printed here",
        ),
    )
