"""Scripts that compute the engine of a result with other libraries, and compare the loads."""

from __future__ import annotations

import math
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from pprint import pformat
from typing import Any

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.extensions.exchange.components import MADE_BY
from laufruhe.machine import Engine, OperatingPoint, SliderCrank
from laufruhe.machine.slider_crank import OffsetCrank
from laufruhe.numerics.spectrum import JUMP_OFFSET
from laufruhe.problem.evaluation import with_common_base
from laufruhe.problem.problem import Problem
from laufruhe.solvers.result import Result

_STEPS, _ORDERS = 720, 40
"""Steps of a turn, and largest number of orders, that are compared."""


def script(target: str, result: Result) -> str:
    """Return a script that computes the final design of a result with the library `target`."""
    template = Path(__file__).with_name(f"{target}_check.py").read_text(encoding="utf-8")
    data = {"title": result.problem.title, **SCRIPTS[target](result)}
    numbers = pformat(data, width=116, compact=True, sort_dicts=False)
    return f"# {MADE_BY} \n{template}".replace("DATA: dict[str, Any] = {}", f"DATA: dict[str, Any] = {numbers}", 1)


def check(target: str, problem: Problem) -> None:
    """Raise `ModelError` if a script cannot model the engine of a problem."""
    if target == "opentorsion" and not any(extra.name == "torsion" for extra in problem.engine.extras):
        raise ModelError("the script needs discs and shafts of the crankshaft; add [torsion]", "torsion")
    if target != "exudyn":
        return
    if problem.engine.geared or problem.fidelity.has_uneven_speed:
        raise ModelError(
            "has geared inertia or an uneven speed, which the script leaves out; export the loads", "engine"
        )
    for part in problem.engine.slider_cranks:
        if type(part) not in (SliderCrank, OffsetCrank) or math.isinf(part.rod_length):
            raise ModelError(
                f"{part.name} is not made of a throw, a rod and a piston alone; export its loads", "engine"
            )
        if not (part.reciprocating_mass > 0.0 and _rod_inertia(part) > 0.0):
            raise ModelError(f"{part.name} has no reciprocating mass for a rigid rod; give one", "engine")


def _rod_inertia(part: SliderCrank) -> float:
    # of a rod with half of the reciprocating mass at each pin
    return part.rod_inertia_deficit + 0.25 * part.rod_length**2 * part.reciprocating_mass


def _engine_data(result: Result) -> dict[str, Any]:
    """Return bodies with the loads of the engine, gas forces, and the loads to compare with.

    Half of the reciprocating mass is at each pin of the rod, the rest in the piston. The throw carries the difference
    to the true mass at the crank pin.
    """
    engine = result.final.engine
    cylinders, points = [], []
    rotors = [(rotor.name, rotor.x, rotor.shaft, complex(rotor.unbalance)) for rotor in engine.rotors]
    for part in engine.slider_cranks:
        half, pin = 0.5 * part.reciprocating_mass, complex(part.crank_radius * np.exp(1j * part.throw))
        cylinders.append(
            {"throw": len(rotors), "pin": pin, "rod_length": part.rod_length, "rod_mass": 2.0 * half,
             "rod_inertia": _rod_inertia(part), "piston_mass": half, "bank": part.bank, "offset": part.offset}
        )  # fmt: skip
        rotors.append((part.name, part.x, part.shaft, (part.rotating_mass - half) * pin))
    for loads in result.final.loads:
        (wrench,), gas = with_common_base(engine.cycle.base_order, [loads.wrench]), list[Any]()
        if result.final.fidelity.gas_of(loads.point) is not None:
            gas = [_pressing(engine, part, loads.point) for part in engine.slider_cranks]
        samples = wrench.sample(engine.cycle.turns * _STEPS, JUMP_OFFSET).tolist()
        points.append({"name": loads.point.name, "speed": loads.point.speed, "wrench": samples, "gas": gas})
    force = sum(part.reciprocating_mass * part.crank_radius for part in engine.slider_cranks)
    return {
        "steps": _STEPS,
        "turns": engine.cycle.turns,
        "unit_loads": [force] * 3 + [force * max(part.crank_radius for part in engine.slider_cranks)] * 3,
        "rotors": [
            {"name": name, "x": x, "ratio": shaft.ratio, "axis": complex(shaft.z, shaft.y), "unbalance": unbalance}
            for name, x, shaft, unbalance in rotors
        ],
        "cylinders": cylinders,
        "points": points,
    }


def _pressing(engine: Engine, part: SliderCrank, point: OperatingPoint) -> list[float]:
    # gas force towards the crank at the finer steps over the cycle [N]
    count = 2 * _STEPS * engine.cycle.turns
    angles = engine.cycle.angle * np.arange(count) / count + JUMP_OFFSET - part.firing_angle
    assert point.gas is not None
    return [-float(force) for force in point.gas.thrust(part, engine.cycle, angles)]


def _torsion_data(result: Result) -> dict[str, Any]:
    """Return discs, links and torques of the crankshaft at crank speed (V16), and the twists to compare with."""
    # a problem with [torsion] has this extension
    torsion = import_module("laufruhe.extensions.torsion.physics")
    engine, fidelity, points = result.final.engine, result.final.fidelity, []
    chain, compared = torsion.chain_of(engine), slice(1, _ORDERS + 1)
    squares = np.array([ratio**2 for *_, ratio in chain.links])
    for point in result.problem.points:
        torques, twists = (load(engine, point, fidelity) for load in (torsion.throw_torques, torsion.twist))
        values = [(s.stiffness, s.stiffness * s.loss_factor, s.damping) for s in chain.sections] + [
            (a.stiffness_at(point.speed), a.stiffness * a.loss_factor, a.damping_at(point.speed))
            for a in chain.absorbers
        ]
        keys = ("stiffness", "loss", "damping")
        shaft = {key: (squares * column).tolist() for key, column in zip(keys, zip(*values, strict=True), strict=True)}
        frequencies = torsion.natural_modes(chain, point.speed).frequencies.tolist()
        points.append(
            {"name": point.name, "speed": point.speed, "shaft": shaft, "frequencies": frequencies,
             "torques": torques.coefficients[compared].tolist(), "twists": twists.coefficients[compared].tolist()}
        )  # fmt: skip
    names = [*(disc.name for disc in chain.discs), *(absorber.name for absorber in chain.absorbers)]
    damping = [*(disc.damping * disc.ratio**2 for disc in chain.discs), *[0.0] * len(chain.absorbers)]
    return {
        "discs": [*zip(names, torsion.inertias(chain).tolist(), damping, strict=True)], "links": [*chain.links],
        "sections": [section.name for section in chain.sections], "orders": torques.orders[compared].tolist(),
        "points": points,
    }  # fmt: skip


SCRIPTS: dict[str, Callable[[Result], dict[str, Any]]] = {"exudyn": _engine_data, "opentorsion": _torsion_data}
"""Function for the data of each script, by its library."""
