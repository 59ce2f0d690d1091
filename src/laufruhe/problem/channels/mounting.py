"""Channels of a block on its mounts (E7, E9, E11, E14, E46, E47)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from laufruhe.machine import Block, Engine
from laufruhe.machine.load_case import LoadCase
from laufruhe.physics import mount_numbers
from laufruhe.physics.elastic_mounts import ElasticMounting, elastic_mounting
from laufruhe.physics.modes import MOTIONS
from laufruhe.physics.mount_forces import rigid_mounting
from laufruhe.physics.static_cases import settled
from laufruhe.problem.channels.kinds import MountChannel, Needs
from laufruhe.problem.loads import EvaluatedDesign, MeasureQuery


def mounting_in(engine: Engine) -> ElasticMounting:
    """Return the elastic mounting of an engine with a block."""
    if engine.block is None:
        raise ValueError("this engine has no block, so its mounts are rigid")
    return elastic_mounting(engine.block, engine.mounts)


def _of_mounting(number: Callable[[ElasticMounting, MeasureQuery], float | Sequence[float]]) -> Callable[
    [MeasureQuery, EvaluatedDesign], Sequence[float]
]:  # fmt: skip
    def values(measure: MeasureQuery, evaluation: EvaluatedDesign) -> Sequence[float]:
        numbers = number(mounting_in(evaluation.engine), measure)
        return (numbers,) if isinstance(numbers, float) else numbers

    return values


def _transmissibility(measure: MeasureQuery, evaluation: EvaluatedDesign) -> Sequence[float]:
    firm = rigid_mounting(evaluation.engine.mounts)
    ratios = [
        mount_numbers.transmitted(loads.mount_forces, firm.forces(loads.wrench), measure.orders)
        for loads in evaluation.loads
        if measure.counts_point(loads.point) and loads.mount_forces is not None
    ]
    return (max(ratios, default=0.0),)


def motion_indices(measure: MeasureQuery) -> tuple[int, ...]:
    """Return the indices of the motions that should each have a mode of their own."""
    return tuple(MOTIONS.index(name) for name in measure.motions or MOTIONS)


def _of_axis(
    name: str, unit: str, residual: Callable[[Block, mount_numbers.Band], mount_numbers.AxisResidual]
) -> MountChannel:
    # zero if turning about the torque-roll axis is a mode
    def value(mounting: ElasticMounting, measure: MeasureQuery) -> float:
        return mount_numbers.residual_of(mounting, residual(mounting.block, measure.frequency))

    return MountChannel(name, unit, ("frequency",), values=_of_mounting(value), of_axis=residual, of_loads=False)


def counted_cases(measure: MeasureQuery, engine: Engine) -> list[LoadCase]:
    """Return the load cases that count."""
    return [case for case in engine.load_cases if measure.cases is None or case.name in measure.cases]


def _of_cases(name: str, unit: str, part: Callable[[Any], Any]) -> MountChannel:
    """Return the channel of the largest length over the mounts and load cases that count."""

    def values(measure: MeasureQuery, evaluation: EvaluatedDesign) -> Sequence[float]:
        mounting = mounting_in(evaluation.engine)
        chosen = measure.places([mount.name for mount in mounting.mounts])
        weights = np.array(measure.direction_weights or (1.0, 1.0, 1.0))
        cases = counted_cases(measure, evaluation.engine)
        vectors = [part(settled(mounting, case))[chosen] * weights for case in cases]
        return (max((float(np.linalg.norm(rows, axis=1).max()) for rows in vectors), default=0.0),)

    keys = ("load_cases", "mounts", "direction_weights")
    return MountChannel(
        name, unit, keys, Needs.CASES, values=values, of_cases=part, of_loads=False,
        places=lambda engine: [mount.name for mount in engine.mounts],
    )  # fmt: skip


STATIC_TRAVEL = _of_cases("static travel", "m", lambda balance: balance.travel)
STATIC_FORCE = _of_cases("static mount force", "N", lambda balance: balance.force)
TRANSMISSIBILITY = MountChannel("transmissibility", "", ("operating_points", "orders"), values=_transmissibility)
SAG = MountChannel(
    "static sag",
    "m",
    sides=("min", "max"),
    of_loads=False,
    values=_of_mounting(lambda mounting, _: mount_numbers.sag(mounting)),
)
FREQUENCIES = MountChannel(
    "natural frequencies", "Hz", sides=("min", "max", "outside"), minimised=False, of_loads=False,
    values=_of_mounting(lambda mounting, _: [float(f) for f in mounting.modes.frequencies]),
)  # fmt: skip
DECOUPLING = MountChannel(
    "kinetic-energy decoupling", "", ("motions",), sides=("min",), minimised=False, of_loads=False,
    values=_of_mounting(lambda mounting, m: mount_numbers.decoupling(mounting.modes.energy, motion_indices(m))),
)  # fmt: skip
DECOUPLING_SHORTFALL = MountChannel(
    "decoupling shortfall", "", ("motions", "wanted"), of_loads=False,
    values=_of_mounting(
        lambda mounting, m: mount_numbers.decoupling_shortfall(mounting.modes.energy, motion_indices(m), m.wanted)
    ),
)  # fmt: skip
TORQUE_ROLL = _of_axis("torque-roll residual", "", mount_numbers.relative_residual)
RAW_TORQUE_ROLL = _of_axis("raw torque-roll residual", "N m/rad", mount_numbers.raw_residual)
TOTAL_STIFFNESS = MountChannel(
    "total stiffness", "N/m", sides=("min", "max"), of_loads=False,
    values=_of_mounting(lambda mounting, _: mount_numbers.total_stiffness(mounting.mounts)),
)  # fmt: skip
OF_MOUNTING = (
    TRANSMISSIBILITY, SAG, FREQUENCIES, DECOUPLING, DECOUPLING_SHORTFALL, TORQUE_ROLL, RAW_TORQUE_ROLL, TOTAL_STIFFNESS,
    STATIC_TRAVEL, STATIC_FORCE,
)  # fmt: skip
