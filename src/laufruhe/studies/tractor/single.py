"""The single: parts of the mount force (Figs. 2, 5, 7), polar diagrams (8, 9), balance fraction (10)."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from laufruhe.machine import Engine
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.gas_loads import gas_loads
from laufruhe.physics.mount_forces import rigid_mounting
from laufruhe.physics.shaking_loads import reciprocating_loads, rod_inertia_loads
from laufruhe.problem.decision import Decision, Interval, RotorDrive
from laufruhe.studies.tractor import engines as study
from laufruhe.studies.tractor.designs import ASSUMED, given, optimum
from laufruhe.studies.verdict import Verdict

SAMPLES = 1440
FRACTIONS = (0.0, 0.5, 1.0)
SWEPT = np.linspace(0.0, 1.0, 21)
SPEEDS = (4.0, 6.0, 8.0, 10.0, 12.0)
TIMES_CLAIMED = 2.0


def parts() -> xr.Dataset:
    """Mount force of the single from gas, reciprocating mass and rod inertia over two turns (Figs. 2, 5, 7)."""
    engine, speed = study.single(), study.speed_of(study.PISTON_SPEED)
    loads = {
        "gas": gas_loads(engine, study.gas(study.FULL_LOAD)),
        "reciprocating mass": reciprocating_loads(engine, speed),
        "rod inertia": rod_inertia_loads(engine, speed),
    }
    forces = np.array([_forces(engine, load) for load in loads.values()])
    return xr.Dataset(
        {
            "vertical_force": (("part", "angle", "mount"), forces, {"units": "N", "long_name": "force on the mount"}),
            "piston_force": (
                (),
                _piston_force(),
                {"units": "N", "long_name": "largest force of the reciprocating mass on both mounts together"},
            ),
        },
        coords={
            "part": list(loads),
            "angle": ("angle", 720.0 * np.arange(SAMPLES) / SAMPLES, {"units": "deg", "long_name": "crank angle"}),
            "mount": [mount.name for mount in engine.mounts],
        },
        attrs={"title": "Mount force of the single, part by part", "assumptions": ASSUMED},
    )


def _forces(engine: Engine, load: Spectrum) -> NDArray[np.float64]:
    forces = rigid_mounting(engine.mounts).forces(load).rebased(Fraction(1, 2))
    return np.asarray(forces.sample(SAMPLES)[:, :, 2])


def _piston_force() -> float:
    first = study.RECIPROCATING_MASS * study.RADIUS * study.speed_of(study.PISTON_SPEED) ** 2
    return first * (1.0 + study.ROD_RATIO)


def parts_verdicts(data: xr.Dataset) -> tuple[Verdict, ...]:
    """Of Figs. 2, 5 and 7."""
    largest = abs(data["vertical_force"]).max(("angle", "mount"))
    gas, mass, rod = (float(largest.sel(part=name)) / study.KILOPOND for name in data["part"].values)
    piston = float(data["piston_force"]) / study.KILOPOND
    series = data["vertical_force"].sel(part="rod inertia", mount="left").values
    orders = np.abs(np.fft.rfft(series))
    first = float(orders[2] ** 2 / (orders[1:] ** 2).sum())
    return (
        Verdict(
            "Largest mount force from the gas (Fig. 2)",
            "300 kp",
            gas,
            "kp",
            abs(gas / 300.0 - 1.0) <= 0.15,
            "15 % allowed: between compression ratios 15 and 21, which are not printed, it runs from 242 to 305 kp",
        ),
        Verdict(
            "Mount forces of the reciprocating mass over those of the gas (Fig. 5)",
            "twice",
            mass / gas,
            "",
            abs(mass / gas - TIMES_CLAIMED) <= 0.5,
            f"on one mount the largest are {mass:.0f} and {gas:.0f} kp. Eq. 7 halves the force of the piston; the "
            f"whole of it, {piston:.0f} kp on both mounts together, is twice the 300 kp",
        ),
        Verdict(
            "Mount force from the rod's inertia deficit is small (Fig. 7)",
            "small",
            rod,
            "kp",
            rod < 0.02 * gas,
            "under 2 % of the gas force counts as small",
        ),
        Verdict(
            "It is chiefly of first order (Fig. 7)",
            "chiefly",
            100.0 * first,
            "% of its mean square",
            first > 0.9,
            "nine tenths of the mean square count as chiefly",
        ),
    )


def polar() -> xr.Dataset:
    """Force vector on both mounts for several balance fractions (Figs. 8, 9)."""
    point = study.running(study.gas(study.FULL_LOAD))
    designs = [given(f"{k:g}", study.single((study.counterweight(k),)), point) for k in FRACTIONS]
    forces = np.array([design.forces[:, :, 1:] for design in designs])
    angles = 720.0 * np.arange(forces.shape[1]) / forces.shape[1]
    return xr.Dataset(
        {"force": (("fraction", "angle", "mount", "direction"), forces, {"units": "N", "long_name": "mount force"})},
        coords={
            "fraction": ("fraction", list(FRACTIONS), {"units": "1", "long_name": "balance fraction"}),
            "angle": ("angle", angles, {"units": "deg", "long_name": "crank angle"}),
            "mount": ["left", "right"],
            "direction": ["lateral", "vertical"],
        },
        attrs={"title": "Polar diagrams of the single", "assumptions": ASSUMED},
    )


def polar_verdicts(data: xr.Dataset) -> tuple[Verdict, ...]:
    """Of Figs. 8 and 9."""
    rms = (data["force"] ** 2).mean(("angle", "mount")) ** 0.5
    lateral = (rms.sel(direction="lateral") / rms.sel(direction="vertical")).values
    return (
        Verdict(
            "A small fraction leaves vertical forces, none balanced (Figs. 8, 9)",
            "vertical prevails",
            float(lateral[0]),
            "lateral over vertical, rms",
            bool(lateral[0] < 1.0),
            "without counterweight there is no lateral force at all with mounts level with the crank",
        ),
        Verdict(
            "A large fraction leaves lateral forces, all balanced (Figs. 8, 9)",
            "lateral prevails",
            float(lateral[-1]),
            "lateral over vertical, rms",
            bool(lateral[-1] > 1.0),
            "over one is lateral",
        ),
    )


def fraction() -> xr.Dataset:
    """Mean mount force over the balance fraction at several piston speeds (Fig. 10), each optimum proven."""
    means = np.empty((len(SPEEDS), len(SWEPT)))
    best = np.empty((3, len(SPEEDS)))
    for i, speed in enumerate(SPEEDS):
        point = study.running(study.gas(study.FULL_LOAD), speed)
        for k, share in enumerate(SWEPT):
            means[i, k] = given("", study.single((study.counterweight(float(share)),)), point).mean
        best[:, i] = _best_fraction(speed)
    return xr.Dataset(
        {
            "mean": (("speed", "fraction"), means, {"units": "N", "long_name": "mean mount force"}),
            "best_fraction": (("speed",), best[0], {"units": "1", "long_name": "proven best balance fraction"}),
            "best_mean": (("speed",), best[1], {"units": "N", "long_name": "its mean mount force"}),
            "lower_bound": (("speed",), best[2], {"units": "N", "long_name": "proven bound"}),
        },
        coords={
            "speed": ("speed", list(SPEEDS), {"units": "m/s", "long_name": "mean piston speed"}),
            "fraction": ("fraction", SWEPT, {"units": "1", "long_name": "balance fraction"}),
        },
        attrs={"title": "Mean mount force over the balance fraction", "assumptions": ASSUMED},
    )


def _best_fraction(speed: float) -> tuple[float, float, float]:
    whole = study.counterweight(1.0).unbalance
    decision = Decision("web.balance_fraction", "", Interval(0.0, 1.0), 0j, (RotorDrive("web", whole),))
    point = study.running(study.gas(study.FULL_LOAD), speed)
    design = optimum("", study.single((study.counterweight(0.0),)), point, (decision,))
    share = (design.evaluation.engine.rotors[0].unbalance / whole).real
    return share, design.mean, design.lower_bound


def fraction_verdicts(data: xr.Dataset) -> tuple[Verdict, ...]:
    """Of Fig. 10."""
    best = float(data["best_fraction"].sel(speed=study.PISTON_SPEED))
    at_half = float(data["mean"].sel(speed=study.PISTON_SPEED).sel(fraction=0.5, method="nearest"))
    regret = at_half / float(data["best_mean"].sel(speed=study.PISTON_SPEED)) - 1.0
    values = data["best_mean"].values
    exponent = math.log(values[-1] / values[0]) / math.log(SPEEDS[-1] / SPEEDS[0])
    return (
        Verdict(
            "Best balance fraction (Fig. 10)",
            "about 50 %",
            100.0 * best,
            "%",
            abs(best - 0.5) <= 0.05,
            f"five points allowed for 'about'; at 50 % the mean force is {100.0 * regret:.1f} % over the optimum",
        ),
        Verdict(
            "Mount forces grow with piston speed (Fig. 10)",
            "grow",
            exponent,
            "power of the speed",
            bool(np.all(np.diff(values) > 0.0)),
            "between 4 and 12 m/s at the optimum; inertia alone would give 2, gas 0",
        ),
    )
