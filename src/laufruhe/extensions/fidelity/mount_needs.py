"""Physics on which measures of a block on its mounts depend, tested by the removal of parts (F15).

Sag, natural frequencies and the torque-roll axis are no loads, and do not depend on some parts of the physics. Each
part is removed, or changed by a tenth if it cannot be removed. All measures are then computed again. If they stay the
same to the last digits, they do not depend on the part.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from laufruhe.extensions.fidelity.choice import GAS, ROD, Choice, OmittedPart, mode_names
from laufruhe.machine import Mount
from laufruhe.machine.mount import every_spring
from laufruhe.numerics.arrays import Array
from laufruhe.physics.modes import weight_wrench
from laufruhe.problem import channels
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.problem import Problem

SAME = 1e-12
"""Relative change below which a value counts as unchanged."""
MORE = 1.1
"""Factor on numbers of parts that cannot be removed."""


def needs(problem: Problem) -> Choice:
    """Return the physics on which the measures of a problem depend; the omitted parts have no effect on them."""
    initial, dependences, left = _values(problem), [], []
    parts = [*_loads(problem)] if _moved(initial, _values(replace(problem, points=()))) else []
    if not parts:
        part = "loads at every speed: gas, pistons, rods, rotors"
        left.append(OmittedPart(part, "no objective or limit depends on them"))
    for name, changed in (*parts, *_of_the_block(problem)):
        change = _moved(initial, _values(changed))
        if change > SAME:
            dependences.append(
                f"{name}: without it, or with it changed by a tenth, a measure changes by up to {100.0 * change:.3g} %"
            )
        else:
            left.append(OmittedPart(name, "no objective or limit depends on it"))
    if {measure.channel for measure in problem.measures if measure.is_mounting} == {channels.SAG}:
        mounting = mounting_in(problem.engine)
        drive = np.abs(mounting.modes.shapes.T @ weight_wrench(mounting.block))
        still = [k + 1 for k in range(len(drive)) if drive[k] <= SAME * drive.max()]
        if still:
            left.append(OmittedPart(f"{mode_names(mounting, still)} of the block", "weight does not move them"))
    # mount force components that are sampled for these measures, and by an evaluation with all loads
    count = problem.fidelity.samples * 3 * len(problem.engine.mounts) * len(problem.points)
    return Choice(problem.fidelity, 0.0, tuple(dependences), tuple(left), (count if parts else 0, count))


def _values(problem: Problem) -> Array:
    evaluation, measures = evaluate(problem), [measure for measure in problem.measures if measure.channel.is_number]
    return np.array([value for measure in measures for value in evaluation.values(measure)])


def _moved(before: Array, after: Array) -> float:
    size = np.maximum(np.abs(before), np.abs(after))
    return float(np.max(np.abs(after - before) / np.where(size > 0.0, size, 1.0), initial=0.0))


def _loads(problem: Problem) -> Iterator[tuple[str, Problem]]:
    quick = tuple(replace(point, speed=MORE * point.speed) for point in problem.points)
    yield "crank speed", replace(problem, points=quick)
    for part in (ROD, GAS):
        if part.is_there(problem):
            yield part.what, replace(problem, fidelity=replace(problem.fidelity, **part.less))
    yield "orders above 2", replace(problem, fidelity=replace(problem.fidelity, orders=2))


def _of_the_block(problem: Problem) -> Iterator[tuple[str, Problem]]:
    """Yield properties of block and mounts, each with a problem in which it is changed, to test its effect.

    Stiffness, mass and inertia are scaled by `MORE`; loss and damping are set to zero.
    """
    if problem.engine.block is None:
        return

    def stiffen(spring: Mount) -> Mount:
        x, y, z = spring.stiffness
        return replace(spring, stiffness=(MORE * x, y, z / MORE))

    block, mounts = mounting_in(problem.engine).block, problem.engine.mounts
    stiff = tuple(mount.mapped(stiffen) for mount in mounts)
    inertia: Any = tuple(tuple(MORE * value for value in row) for row in block.inertia)
    parts: list[tuple[str, dict[str, Any]]] = [
        ("stiffness and places of the mounts", {"mounts": stiff}),
        ("mass of the block", {"block": replace(block, mass=MORE * block.mass)}),
        ("moments of inertia of the block", {"block": replace(block, inertia=inertia)}),
    ]
    if any(spring.loss_factor or any(spring.damping) or spring.lag for _, spring in every_spring(mounts)):
        undamped = partial(replace, loss_factor=0.0, damping=(0.0, 0.0, 0.0), lag=0.0)
        firm = tuple(mount.mapped(undamped) for mount in mounts)
        parts.append(("loss and damping of the mounts", {"mounts": firm}))
    for name, changed in parts:
        yield name, replace(problem, engine=replace(problem.engine, **changed))
