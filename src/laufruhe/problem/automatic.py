"""The cheapest fidelity that keeps the objective within a tolerance, and what it leaves out (F10)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from laufruhe.machine import Engine
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.shaking_loads import WRENCH
from laufruhe.problem.error_bounds import (
    REFERENCE_SAMPLES,
    ROUNDING,
    gas_doubt,
    half_gas,
    left_out,
    reference,
    sampling_bound,
    signals,
)
from laufruhe.problem.evaluation import Evaluation, evaluate
from laufruhe.problem.model import Problem
from laufruhe.problem.quantity import MASSES

DEFAULT_TOLERANCE = 1e-3
ORDERS = (1, 2, 3, 4, 6, 8, 10, 12, 16, 20, 24, 32, 40, 48, 64, 96, 128, 192, 256, 384)
SAMPLES = tuple(48 * k for k in (1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 18, 20, 24, 30, 40, 60, 80, 120))
GAS_SAMPLES = (720, 1440, 2880, REFERENCE_SAMPLES)
PHYSICS_SHARE, GAS_SHARE, PART_SHARE = 0.5, 0.25, 0.1
"""Shares of the tolerance that all physics, the steps of the gas, and one whole part may use."""


@dataclass(frozen=True)
class LeftOut:
    """One thing that is not computed.

    Attributes
    ----------
    what, why
        In words.
    share
        Put back, it changes the objective by no more than this, relative.
    restored
        The choice with this part put back; None where nothing at all was lost.
    """

    what: str
    why: str
    share: float = 0.0
    restored: Fidelity | None = None


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


class _Scale:
    """Objective of the reference, and bounds beside it."""

    def __init__(self, problem: Problem, best: Evaluation) -> None:
        self.problem, self.best = problem, best
        self.terms = [term for term in problem.objective if term.quantity.subject not in MASSES]
        self.value = sum(term.weight * best.value(term.quantity) for term in problem.objective)
        half = half_gas(problem, best)
        doubt = sum(term.weight * gas_doubt(term.quantity, best, half) for term in self.terms)
        self.doubt = self.relative(doubt) + ROUNDING

    def relative(self, bound: float) -> float:
        return bound / self.value if self.value > 0.0 else (float("inf") if bound > 0.0 else 0.0)

    def evaluation(self, fidelity: Fidelity) -> Evaluation:
        return evaluate(replace(self.problem, fidelity=fidelity), self.best.engine)

    def loses(self, fidelity: Fidelity, than: Evaluation | None = None) -> float:
        ours, theirs = self.evaluation(fidelity), than or self.best
        return self.relative(sum(term.weight * left_out(term.quantity, ours, theirs) for term in self.terms))

    def misses(self, fidelity: Fidelity) -> float:
        ours = self.evaluation(fidelity)
        return self.relative(sum(term.weight * sampling_bound(term.quantity, ours) for term in self.terms))


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
    scale = _Scale(problem, best)
    room = max(tolerance - scale.doubt, 0.0)
    chosen = replace(best.fidelity, tolerance=tolerance, gas_samples=REFERENCE_SAMPLES)
    if _has_deficit(problem):
        chosen = _without(scale, chosen, room, {"rod": "mass-only"})
    if _has_gas(problem):
        chosen = _without(scale, chosen, room, {"gas": False})
    if chosen.gas and _has_gas(problem):
        chosen = _first(chosen, "gas_samples", GAS_SAMPLES, lambda f: scale.loses(f) <= GAS_SHARE * room)
    else:
        chosen = replace(chosen, gas_samples=None)
    if not chosen.is_uneven:
        chosen = _first(chosen, "orders", (*ORDERS, None), lambda f: scale.loses(f) <= PHYSICS_SHARE * room)
    lost = scale.loses(chosen)
    if not chosen.is_uneven:
        chosen = _first(chosen, "samples", (*SAMPLES, REFERENCE_SAMPLES), lambda f: lost + scale.misses(f) <= room)
    estimate = lost + scale.misses(chosen) + scale.doubt
    return Choice(
        chosen,
        # the bounds are relative to the reference, a reader's error to what was computed
        estimate / max(1.0 - estimate, 0.5),
        _kept(problem, chosen),
        _parts_left_out(scale, chosen),
        _numbers(problem, scale, chosen),
    )


def automatic(problem: Problem, tolerance: float, engine: Engine | None = None) -> Problem:
    """The problem at the fidelity chosen for it."""
    if not problem.objective:
        return replace(problem, fidelity=replace(problem.fidelity, tolerance=tolerance))
    return replace(problem, fidelity=choose(problem, tolerance, engine).fidelity)


def _first(fidelity: Fidelity, name: str, ladder: Sequence[int | None], enough: Callable[[Fidelity], bool]) -> Fidelity:
    """The first rung of a ladder that is enough; the last one where none is."""
    found = fidelity
    for rung in ladder:
        change: dict[str, Any] = {name: rung}
        found = replace(fidelity, **change)
        if enough(found):
            break
    return found


def _without(scale: _Scale, fidelity: Fidelity, room: float, part: dict[str, Any]) -> Fidelity:
    """Without one whole part, where the objective cannot see it."""
    if fidelity.is_uneven:
        # gas and inertia drive the speed there: they are a part of everything
        return fidelity
    less: Fidelity = replace(fidelity, **part)
    return less if scale.loses(less) - scale.loses(fidelity) <= PART_SHARE * room else fidelity


def _has_gas(problem: Problem) -> bool:
    return any(point.gas is not None for point in problem.points)


def _has_deficit(problem: Problem) -> bool:
    return any(part.rod_inertia_deficit != 0.0 for part in problem.engine.slider_cranks)


def _kept(problem: Problem, fidelity: Fidelity) -> tuple[str, ...]:
    orders = "every order" if fidelity.orders is None else f"orders to {fidelity.orders}"
    kept = [f"exact kinematics, {orders} of pistons and rods"]
    if fidelity.gas and _has_gas(problem):
        kept.append(f"gas, its torque taken at {fidelity.gas_steps} steps over the cycle, {orders} of it")
    if fidelity.rod == "rigid" and _has_deficit(problem):
        kept.append("inertia of the rods beyond that of two masses")
    if fidelity.is_uneven:
        kept.append("crank speed that varies within the cycle")
    return (*kept, f"{fidelity.samples} steps over the cycle")


def _parts_left_out(scale: _Scale, chosen: Fidelity) -> tuple[LeftOut, ...]:
    problem, found = scale.problem, [*_never_there(scale, chosen)]
    if not chosen.gas and _has_gas(problem):
        found.append(_part(scale, chosen, replace(chosen, gas=True, gas_samples=REFERENCE_SAMPLES), "gas",
                           "the objective hardly sees its roll moment"))  # fmt: skip
    if chosen.rod == "mass-only" and _has_deficit(problem):
        found.append(_part(scale, chosen, replace(chosen, rod="rigid"), "inertia of the rods beyond two masses",
                           "the objective hardly sees its roll moment"))  # fmt: skip
    if chosen.orders is not None:
        found.append(_part(scale, chosen, replace(chosen, orders=None), f"orders above {chosen.orders}",
                           "their forces are small"))  # fmt: skip
    finer = replace(chosen, samples=REFERENCE_SAMPLES, gas_samples=chosen.gas_steps)
    share = scale.misses(chosen) + scale.misses(finer)
    found.append(
        LeftOut(f"angles between {chosen.samples} steps", "the force runs smoothly through them", share, finer)
    )
    return tuple(found)


def _part(scale: _Scale, chosen: Fidelity, restored: Fidelity, what: str, why: str) -> LeftOut:
    # of the objective itself; its samples see the part to within their own error
    both = scale.loses(chosen, scale.evaluation(restored))
    return LeftOut(what, why if both > 0.0 else "the objective does not count them", both, restored)


def _never_there(scale: _Scale, chosen: Fidelity) -> list[LeftOut]:
    """What costs nothing to leave out, for it is exactly zero."""
    problem, best, found = scale.problem, scale.best, []
    if not _has_gas(problem):
        found.append(LeftOut("gas", "the problem describes none"))
    if not _has_deficit(problem):
        found.append(LeftOut("inertia of the rods beyond two masses", "the problem describes none"))
    wrench = [loads.wrench.coefficients for loads in best.loads]
    still = [name for k, name in enumerate(WRENCH) if not any(w[:, k].any() for w in wrench)]
    if still:
        found.append(LeftOut("loads " + ", ".join(still), "nothing drives them"))
    last = min(float(chosen.orders or 8), 12.0)
    orders = best.loads[0].wrench.orders
    silent = [
        f"{order:g}"
        for k, order in enumerate(orders)
        if 0 < order <= last and not any(k < len(w) and w[k].any() for w in wrench)
    ]
    if silent:
        found.append(LeftOut("orders " + ", ".join(silent), "the crank star cancels them, or nothing has them"))
    repeats = _repeats(scale)
    if repeats > 1:
        found.append(LeftOut(f"{repeats - 1} of {repeats} parts of the cycle", "the loads repeat after each"))
    return found


def _repeats(scale: _Scale) -> int:
    """Times that all measured signals repeat within the cycle, whatever is decided."""
    ratios = tuple(
        Fraction(abs(rotor.shaft.ratio)).limit_denominator(1000)
        for rotor in scale.problem.engine.rotors
        if rotor.unbalance != 0 or any(d.rotor == rotor.name for c in scale.problem.decisions for d in c.drives)
    )
    cycle = scale.problem.engine.cycle.base_order
    bases = [loads.wrench.reduced(ratios).base for loads in scale.best.loads]
    return int(min(bases) / cycle) if bases else 1


def _numbers(problem: Problem, scale: _Scale, chosen: Fidelity) -> tuple[int, int]:
    """Force components sampled in one evaluation, pruned and not."""
    pruned = whole = 0
    for term in scale.terms:
        found = signals(term.quantity, scale.best)
        directions = sum(int(np.any(np.abs(s.coefficients) > 0.0, axis=(0, 1)).sum()) for s in found)
        mounts, width = found[0].coefficients.shape[1:]
        pruned += max(chosen.samples // _repeats(scale), 24) * mounts * directions
        whole += problem.fidelity.samples * mounts * width * len(found)
    return pruned, whole
