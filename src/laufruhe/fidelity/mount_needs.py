"""What of the physics a question about a block on its mounts needs, found by taking parts away (F15).

Sag, natural frequencies and the torque-roll axis are no loads: whole parts of the physics
do not enter them. Each part is taken away, or changed where it cannot be, and everything
that is asked is computed again; what then stays the same to the last digits does not enter.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from laufruhe.fidelity.automatic import Choice
from laufruhe.fidelity.knob import LeftOut
from laufruhe.fidelity.knobs import KNOBS, mode_names
from laufruhe.machine import Engine
from laufruhe.machine.mount import Matrix3
from laufruhe.physics.modes import weight_wrench
from laufruhe.problem import channels
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem

Array = NDArray[np.float64]

SAME = 1e-12
"""Relative change under which a value is the same."""
MORE = 1.1
"""Factor on what cannot be taken away altogether."""


def needs(problem: Problem) -> Choice:
    """What of the physics enters the mount quantities of an objective and its limits.

    Returns
    -------
    Choice without error: what is left out changes nothing.
    """
    wanted = _asked(problem)
    whole = _values(problem, wanted)
    kept, left = [], []
    parts = [*_loads(problem)] if _moved(whole, _values(replace(problem, points=()), wanted)) else []
    if not parts:
        left.append(
            LeftOut("loads at every speed: gas, pistons, rods, rotors", "nothing that is asked depends on them")
        )
    for name, changed in (*parts, *_of_the_block(problem)):
        change = _moved(whole, _values(changed, wanted))
        if change > SAME:
            kept.append(f"{name}: without, or changed by a tenth, what is asked moves by up to {100.0 * change:.3g} %")
        else:
            left.append(LeftOut(name, "nothing that is asked depends on it"))
    left += _modes_of_the_sag(problem, wanted)
    return Choice(problem.fidelity, 0.0, tuple(kept), tuple(left), _numbers(problem, bool(parts)))


def _asked(problem: Problem) -> list[Measure]:
    """Quantities of the objective and of the limits."""
    return [measure for measure in problem.measures if measure.is_mounting]


def _values(problem: Problem, wanted: list[Measure]) -> Array:
    """All that is asked; of natural frequencies all six."""
    evaluation = evaluate(problem)
    found: list[float] = []
    for quantity in wanted:
        found += evaluation.values(quantity)
    return np.array(found)


def _moved(before: Array, after: Array) -> float:
    """Largest relative change."""
    size = np.maximum(np.abs(before), np.abs(after))
    return float(np.max(np.abs(after - before) / np.where(size > 0.0, size, 1.0), initial=0.0))


def _loads(problem: Problem) -> Iterator[tuple[str, Problem]]:
    """Parts of the loads, each with the problem that lacks it."""
    quick = tuple(replace(point, speed=MORE * point.speed) for point in problem.points)
    yield "crank speed", replace(problem, points=quick)
    for knob in KNOBS:
        yield from ((name, replace(problem, fidelity=fidelity)) for name, fidelity in knob.away(problem))


def _of_the_block(problem: Problem) -> Iterator[tuple[str, Problem]]:
    """Parts of block and mounts, each with the problem that lacks it or has more of it."""
    engine = problem.engine
    if engine.block is None:
        return
    block, mounts = engine.block, engine.mounts
    yield (
        "stiffness and places of the mounts",
        _with(problem, replace(engine, mounts=tuple(replace(m, stiffness=_more(m.stiffness)) for m in mounts))),
    )
    yield "mass of the block", _with(problem, replace(engine, block=replace(block, mass=MORE * block.mass)))
    yield (
        "moments of inertia of the block",
        _with(problem, replace(engine, block=replace(block, inertia=_scaled(block.inertia)))),
    )
    if any(mount.loss_factor for mount in mounts) or any(any(mount.damping) for mount in mounts):
        firm = tuple(replace(mount, loss_factor=0.0, damping=(0.0, 0.0, 0.0)) for mount in mounts)
        yield "loss and damping of the mounts", _with(problem, replace(engine, mounts=firm))


def _modes_of_the_sag(problem: Problem, wanted: list[Measure]) -> list[LeftOut]:
    """Modes that weight does not move, where sag alone is asked of them."""
    if {quantity.channel for quantity in wanted} != {channels.SAG}:
        return []
    mounting = mounting_in(problem.engine)
    drive = np.abs(mounting.modes.shapes.T @ weight_wrench(mounting.block))
    still = [k + 1 for k in range(len(drive)) if drive[k] <= SAME * drive.max()]
    return (
        [LeftOut(f"mode(s) {mode_names(mounting, still)} of the block", "weight does not move them")] if still else []
    )


def _numbers(problem: Problem, with_loads: bool) -> tuple[int, int]:
    """Mount force components sampled for what is asked, and by an evaluation with all loads."""
    whole = problem.fidelity.samples * 3 * len(problem.engine.mounts) * len(problem.points)
    return (whole if with_loads else 0), whole


def _with(problem: Problem, engine: Engine) -> Problem:
    return replace(problem, engine=engine)


def _more(values: tuple[float, float, float]) -> tuple[float, float, float]:
    x, y, z = values
    return MORE * x, y, z / MORE


def _scaled(rows: Matrix3) -> Matrix3:
    first, second, third = (tuple(MORE * value for value in row) for row in rows)
    return first, second, third  # type: ignore[return-value]
