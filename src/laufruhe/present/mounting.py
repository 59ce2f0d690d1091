"""Facts about a block on its mounts: modes, their excitation, critical speeds."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from laufruhe.numerics.arrays import Array
from laufruhe.physics import mount_numbers
from laufruhe.physics.elastic_mounts import ElasticMounting
from laufruhe.physics.modes import Modes, static_motion, torque_roll_axis, weight_wrench
from laufruhe.physics.time_model import frequencies_with_fluid
from laufruhe.present.measures import has_mounts
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.evaluation import Evaluation
from laufruhe.solvers.result import Result

MAIN_SHARE = 0.1
MAX_ORDERS = 3


@dataclass(frozen=True, eq=False)
class MountingFacts:
    """Modes of one design and their excitation [SI].

    Attributes
    ----------
    excited
        Indices of the modes that any operating point drives (E12).
    orders
        Orders that make most of the load, the strongest first.
    sag, mount_sag
        Static sag of the centre of gravity, and at every mount, downwards.
    torque_travel
        Largest displacement of any mount under the mean torque.
    torque_roll_coupling, torque_roll_frequency
        Coupling, zero if turning about the torque-roll axis is a mode (E8); frequency at which it is nearest to a mode
        [Hz] (E46).
    with_fluid
        Undamped natural frequencies of the block and the fluid of its mounts together; none without fluid tracks (E50).
    depends_on_frequency
        True if stiffness depends on frequency: modes then use the stiffness at rest (E50).
    """

    modes: Modes
    excited: tuple[int, ...]
    orders: tuple[float, ...]
    sag: float
    mount_sag: Array
    torque_travel: float
    torque_roll_axis: Array
    torque_roll_coupling: float
    torque_roll_frequency: float
    with_fluid: tuple[float, ...]
    depends_on_frequency: bool


def is_elastic(result: Result) -> bool:
    """Return True for a block on elastic mounts."""
    return result.final.engine.block is not None and has_mounts(result)


def facts_of(evaluation: Evaluation) -> MountingFacts:
    """Return sag, travel and natural modes of a design on elastic mounts, for tables."""
    mounting = mounting_in(evaluation.engine)
    weight = static_motion(mounting.modes, weight_wrench(mounting.block))
    travels = [np.abs(np.linalg.norm(loads.mount_travel.coefficients[0], axis=-1)).max()
               for loads in evaluation.loads if loads.mount_travel is not None]  # fmt: skip
    return MountingFacts(
        modes=mounting.modes,
        excited=tuple(sorted({j for loads in evaluation.loads for j in mounting.excited(loads.wrench)})),
        orders=main_orders(evaluation, mounting),
        sag=mount_numbers.sag(mounting),
        mount_sag=np.asarray(-(mounting.motions @ weight)[:, 2]),
        torque_travel=float(max(travels, default=0.0)),
        torque_roll_axis=torque_roll_axis(mounting.block),
        torque_roll_coupling=mount_numbers.torque_roll_coupling(mounting),
        torque_roll_frequency=mount_numbers.torque_roll_frequency(mounting),
        with_fluid=frequencies_with_fluid(mounting),
        depends_on_frequency=bool(mounting.dynamic),
    )


def stiffness_sentence(facts: MountingFacts) -> str:
    """Return a sentence about the stiffness of the modes; empty if it is constant."""
    return " Modes are of the stiffness at rest, which changes with frequency." if facts.depends_on_frequency else ""


def main_orders(evaluation: Evaluation, mounting: ElasticMounting) -> tuple[float, ...]:
    """Return orders above zero whose excitation is at least a tenth of the strongest."""
    sizes: dict[float, float] = {}
    for loads in evaluation.loads:
        drive = np.linalg.norm(mounting.drives(loads.wrench.coefficients), axis=1)
        for order, size in zip(loads.wrench.orders[1:].tolist(), drive[1:].tolist(), strict=True):
            sizes[order] = max(sizes.get(order, 0.0), size)
    top = max(sizes.values(), default=0.0)
    strong = sorted((order for order, size in sizes.items() if size > MAIN_SHARE * top > 0.0), key=lambda o: -sizes[o])
    return tuple(strong[:MAX_ORDERS])


def critical_speed(frequency: float, order: float) -> float:
    """Return the crank speed at which an order meets a natural frequency [rad/s]."""
    return math.tau * frequency / order


def excited_frequencies(facts: MountingFacts) -> list[float]:
    """Return the excited natural frequencies; the highest one if there is none [Hz]."""
    return [float(facts.modes.frequencies[j]) for j in facts.excited] or [float(facts.modes.frequencies[-1])]


def main_order(facts: MountingFacts) -> float:
    """Return the order that excites the mounts most."""
    return facts.orders[0] if facts.orders else 1.0
