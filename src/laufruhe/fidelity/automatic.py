"""The cheapest fidelity that keeps the objective within a tolerance, and what it leaves out (F10)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from laufruhe.errors import UncarriedLoadError
from laufruhe.fidelity.error_bounds import REFERENCE_SAMPLES, reference, signals
from laufruhe.fidelity.left_out import LeftOut, Scale, has_deficit, has_gas, mode_names, parts_left_out, repeats
from laufruhe.machine import Engine
from laufruhe.physics.fidelity import Fidelity
from laufruhe.problem.problem import Problem

DEFAULT_TOLERANCE = 1e-3
ORDERS = (1, 2, 3, 4, 6, 8, 10, 12, 16, 20, 24, 32, 40, 48, 64, 96, 128, 192, 256, 384)
SAMPLES = tuple(48 * k for k in (1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 18, 20, 24, 30, 40, 60, 80, 120))
GAS_SAMPLES = (720, 1440, 2880, REFERENCE_SAMPLES)
PHYSICS_SHARE, GAS_SHARE, PART_SHARE = 0.5, 0.25, 0.1
"""Shares of the tolerance that all physics, the steps of the gas, and one whole part may use."""


@dataclass(frozen=True, eq=False)
class Choice:
    """A fidelity, how wrong it can be, and why it is enough.

    Attributes
    ----------
    error_estimate
        Relative error of the objective that is not exceeded for the design chosen for.
    kept
        What is computed, in words.
    left_out
        What is not.
    numbers
        Mount force components that one evaluation samples, and those of the exact model
        at as many steps as the problem file asks.
    """

    fidelity: Fidelity
    error_estimate: float
    kept: tuple[str, ...]
    left_out: tuple[LeftOut, ...]
    numbers: tuple[int, int]


def choose(problem: Problem, tolerance: float = DEFAULT_TOLERANCE, engine: Engine | None = None) -> Choice:
    """The cheapest fidelity for an objective (F10).

    Parameters
    ----------
    problem
        Objective and operating points. An uneven crank speed that it has is kept.
    tolerance
        Relative error of the objective allowed.
    engine
        The design chosen for; that of the problem as given when left out.

    Returns
    -------
    Choice whose estimate is under the tolerance wherever the reference itself is; of
    an objective that is zero, everything that is not zero is kept.
    """
    best = reference(problem, engine)
    scale = Scale(problem, best)
    room = max(tolerance - scale.doubt, 0.0)
    chosen = replace(best.fidelity, tolerance=tolerance, gas_samples=REFERENCE_SAMPLES)
    if has_deficit(problem):
        chosen = _without(scale, chosen, room, {"rod": "mass-only"})
    if has_gas(problem):
        chosen = _without(scale, chosen, room, {"gas": False})
    if chosen.gas and has_gas(problem):
        chosen = _first(chosen, "gas_samples", GAS_SAMPLES, lambda f: scale.loses(f) <= GAS_SHARE * room)
    else:
        chosen = replace(chosen, gas_samples=None)
    if not chosen.is_uneven:
        chosen = _first(chosen, "orders", (*ORDERS, None), lambda f: scale.loses(f) <= PHYSICS_SHARE * room)
    if not problem.mount_decisions:
        chosen = _fewest_modes(scale, chosen, room)
    lost = scale.loses(chosen)
    if not chosen.is_uneven:
        chosen = _first(chosen, "samples", (*SAMPLES, REFERENCE_SAMPLES), lambda f: lost + scale.misses(f) <= room)
    estimate = lost + scale.misses(chosen) + scale.doubt
    return Choice(
        chosen,
        # the bounds are relative to the reference, a reader's error to what was computed
        estimate / max(1.0 - estimate, 0.5),
        _kept(scale, chosen),
        parts_left_out(scale, chosen),
        _numbers(problem, scale, chosen),
    )


def automatic(problem: Problem, tolerance: float, engine: Engine | None = None) -> Problem:
    """The problem at the fidelity chosen for it."""
    if not problem.objective:
        return problem.at(replace(problem.fidelity, tolerance=tolerance))
    return problem.at(choose(problem, tolerance, engine).fidelity)


def _first(fidelity: Fidelity, name: str, ladder: Sequence[int | None], enough: Callable[[Fidelity], bool]) -> Fidelity:
    """The first rung of a ladder that is enough; the last one where none is."""
    found = fidelity
    for rung in ladder:
        change: dict[str, Any] = {name: rung}
        found = replace(fidelity, **change)
        if enough(found):
            break
    return found


def _without(scale: Scale, fidelity: Fidelity, room: float, part: dict[str, Any]) -> Fidelity:
    """Without one whole part, where the objective cannot see it."""
    if fidelity.is_uneven:
        # gas and inertia drive the speed there: they are a part of everything
        return fidelity
    less: Fidelity = replace(fidelity, **part)
    return less if scale.loses(less) - scale.loses(fidelity) <= PART_SHARE * room else fidelity


def _fewest_modes(scale: Scale, fidelity: Fidelity, room: float) -> Fidelity:
    """Mounts that give no way where the objective cannot tell, or without the modes that hardly answer.

    Modes that an open rotor drives stay: what they answer is not known before it is decided.
    """
    if scale.mounting is None:
        return fidelity
    allowed = scale.loses(fidelity) + PART_SHARE * room
    rigid = replace(fidelity, mounts="rigid")
    if _is_carried(scale, rigid) and scale.loses(rigid) <= allowed:
        return rigid
    excited = scale.excited_modes
    open_modes = {mode + 1 for mode in scale.decided_modes}
    chosen, kept = fidelity, excited
    for mode in sorted(set(excited) - open_modes, key=lambda mode: scale.strengths[mode]):
        fewer = tuple(m for m in kept if m != mode)
        candidate = replace(fidelity, modes=fewer)
        if scale.loses(candidate) > allowed:
            break
        chosen, kept = candidate, fewer
    return chosen


def _is_carried(scale: Scale, rigid: Fidelity) -> bool:
    """Whether the mounts would carry the loads if they gave no way."""
    try:
        scale.evaluation(rigid)
    except UncarriedLoadError:
        return False
    return True


def _kept(scale: Scale, fidelity: Fidelity) -> tuple[str, ...]:
    problem = scale.problem
    orders = "every order" if fidelity.orders is None else f"orders to {fidelity.orders}"
    kept = [f"exact kinematics, {orders} of pistons and rods"]
    if fidelity.gas and has_gas(problem):
        kept.append(f"gas, its torque taken at {fidelity.gas_steps} steps over the cycle, {orders} of it")
    if fidelity.rod == "rigid" and has_deficit(problem):
        kept.append("inertia of the rods beyond that of two masses")
    if fidelity.is_uneven:
        kept.append("crank speed that varies within the cycle")
    if scale.mounting is not None:
        modes = scale.excited_modes if fidelity.modes is None else fidelity.modes
        kept.append(
            "mounts as if they gave no way"
            if fidelity.mounts == "rigid"
            else f"mode(s) {mode_names(scale.mounting, modes)} of the block on its mounts"
        )
    return (*kept, f"{fidelity.samples} steps over the cycle")


def _numbers(problem: Problem, scale: Scale, chosen: Fidelity) -> tuple[int, int]:
    """Force components sampled in one evaluation, pruned and not."""
    pruned = whole = 0
    for term in scale.terms:
        found = signals(term.measure, scale.best)
        directions = sum(int(np.any(np.abs(s.coefficients) > 0.0, axis=(0, 1)).sum()) for s in found)
        mounts, width = found[0].coefficients.shape[1:]
        pruned += max(chosen.samples // repeats(scale), 24) * mounts * directions
        whole += problem.fidelity.samples * mounts * width * len(found)
    return pruned, whole
