"""What a fidelity leaves out of one problem, what that costs at most, and what was never there (F6, F10)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from laufruhe.fidelity.error_bounds import (
    REFERENCE_SAMPLES,
    ROUNDING,
    gas_doubt,
    half_gas,
    left_out,
    relative,
    sampling_bound,
)
from laufruhe.numerics.spectrum import Spectrum, as_order
from laufruhe.physics.elastic_mounts import ElasticMounting
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.shaking_loads import WRENCH, rotor_wrench
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.evaluation import Evaluation, evaluate
from laufruhe.problem.problem import Problem


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


class Scale:
    """Objective of the reference, and bounds beside it."""

    def __init__(self, problem: Problem, best: Evaluation) -> None:
        self.problem, self.best = problem, best
        self.terms = [term for term in problem.objective if not term.measure.is_mass]
        self.value = sum(term.weight * best.value(term.measure) for term in problem.objective)
        half = half_gas(problem, best)
        doubt = sum(term.weight * gas_doubt(term.measure, best, half) for term in self.terms)
        self.doubt = relative(doubt, self.value) + ROUNDING

    def evaluation(self, fidelity: Fidelity) -> Evaluation:
        """The same design at another fidelity."""
        return evaluate(replace(self.problem, fidelity=fidelity), self.best.engine)

    def loses(self, fidelity: Fidelity, than: Evaluation | None = None) -> float:
        """What a fidelity leaves out at most, relative, of the reference or of another evaluation (F6)."""
        ours, theirs = self.evaluation(fidelity), than or self.best
        lost = sum(term.weight * left_out(term.measure, ours, theirs) for term in self.terms)
        return relative(lost, self.value)

    @cached_property
    def mounting(self) -> ElasticMounting | None:
        """Block and mounts; None where the mounts are rigid."""
        return None if self.best.engine.block is None else mounting_in(self.best.engine)

    @cached_property
    def excited_modes(self) -> tuple[int, ...]:
        """Modes that the loads or an open rotor drive, 1 the lowest (E12)."""
        if self.mounting is None:
            return ()
        found = {mode for loads in self.best.loads for mode in self.mounting.excited(loads.wrench)}
        return tuple(sorted(mode + 1 for mode in found | set(self.decided_modes)))

    @cached_property
    def decided_modes(self) -> tuple[int, ...]:
        """Modes that an open rotor drives, counted from 0: what is small now may not stay so."""
        names = {drive.rotor for decision in self.problem.decisions for drive in decision.rotor_drives}
        rotors = [replace(rotor, unbalance=1.0) for rotor in self.problem.engine.rotors if rotor.name in names]
        if self.mounting is None or not rotors:
            return ()
        wrenches = np.array([rotor_wrench(rotor, 1.0) for rotor in rotors])
        return self.mounting.excited(Spectrum(self.problem.engine.cycle.base_order, wrenches))

    @cached_property
    def strengths(self) -> dict[int, float]:
        """What every excited mode adds at most to the objective, relative (F6)."""
        excited, whole = self.excited_modes, self.best.fidelity
        others = {mode: tuple(m for m in excited if m != mode) for mode in excited}
        return {mode: self.loses(replace(whole, modes=rest)) for mode, rest in others.items()}

    def misses(self, fidelity: Fidelity) -> float:
        """What its samples miss at most, relative (F7, F8)."""
        ours = self.evaluation(fidelity)
        missed = sum(term.weight * sampling_bound(term.measure, ours) for term in self.terms)
        return relative(missed, self.value)


def has_gas(problem: Problem) -> bool:
    """Whether any operating point has a working gas."""
    return any(point.gas is not None for point in problem.points)


def has_deficit(problem: Problem) -> bool:
    """Whether any rod's inertia is not that of two masses."""
    return any(part.rod_inertia_deficit != 0.0 for part in problem.engine.slider_cranks)


def mode_names(mounting: ElasticMounting, modes: Iterable[int]) -> str:
    """Modes in words, 1 the lowest: number, motion and natural frequency."""
    own = mounting.modes
    return ", ".join(f"{k} ({own.names[k - 1]}, {own.frequencies[k - 1]:.3g} Hz)" for k in modes)


def parts_left_out(scale: Scale, chosen: Fidelity) -> tuple[LeftOut, ...]:
    """Everything that a choice does without, what is exactly zero first."""
    problem, found = scale.problem, [*_never_there(scale, chosen)]
    if not chosen.gas and has_gas(problem):
        found.append(_part(scale, chosen, replace(chosen, gas=True, gas_samples=REFERENCE_SAMPLES), "gas",
                           "the objective hardly sees its roll moment"))  # fmt: skip
    if chosen.rod == "mass-only" and has_deficit(problem):
        found.append(_part(scale, chosen, replace(chosen, rod="rigid"), "inertia of the rods beyond two masses",
                           "the objective hardly sees its roll moment"))  # fmt: skip
    if chosen.orders is not None:
        found.append(_part(scale, chosen, replace(chosen, orders=None), f"orders above {chosen.orders}",
                           "their forces are small"))  # fmt: skip
    found += _of_the_mounts(scale, chosen)
    finer = replace(chosen, samples=REFERENCE_SAMPLES, gas_samples=chosen.gas_steps)
    share = scale.misses(chosen) + scale.misses(finer)
    found.append(
        LeftOut(f"angles between {chosen.samples} steps", "the force runs smoothly through them", share, finer)
    )
    return tuple(found)


def _of_the_mounts(scale: Scale, chosen: Fidelity) -> list[LeftOut]:
    """What of the block's own motion is not computed."""
    restored = replace(chosen, mounts="frequency", modes=None)
    if scale.mounting is None or chosen == restored:
        return []
    if chosen.mounts == "rigid":
        return [_part(scale, chosen, restored, "motion of the block", "its mounts hardly give way at these orders")]
    silent = [mode for mode in scale.excited_modes if mode not in (chosen.modes or ())]
    names = mode_names(scale.mounting, silent)
    return [_part(scale, chosen, restored, f"mode(s) {names} of the block", "what they answer is small")]


def _part(scale: Scale, chosen: Fidelity, restored: Fidelity, what: str, why: str) -> LeftOut:
    # of the objective itself; its samples see the part to within their own error
    both = scale.loses(chosen, scale.evaluation(restored))
    return LeftOut(what, why if both > 0.0 else "the objective does not count them", both, restored)


def _never_there(scale: Scale, chosen: Fidelity) -> list[LeftOut]:
    """What costs nothing to leave out, for it is exactly zero."""
    problem, best, found = scale.problem, scale.best, []
    if not has_gas(problem):
        found.append(LeftOut("gas", "the problem describes none"))
    if not has_deficit(problem):
        found.append(LeftOut("inertia of the rods beyond two masses", "the problem describes none"))
    wrench = [loads.wrench.coefficients for loads in best.loads]
    idle = [name for k, name in enumerate(WRENCH) if not any(w[:, k].any() for w in wrench)]
    if idle:
        found.append(LeftOut("loads " + ", ".join(idle), "nothing drives them"))
    last = min(float(chosen.orders or 8), 12.0)
    orders = best.loads[0].wrench.orders
    silent = [
        f"{order:g}"
        for k, order in enumerate(orders)
        if 0 < order <= last and not any(k < len(w) and w[k].any() for w in wrench)
    ]
    if silent:
        found.append(LeftOut("orders " + ", ".join(silent), "the crank star cancels them, or nothing has them"))
    if scale.mounting is not None:
        still = [mode for mode in range(1, 7) if mode not in scale.excited_modes]
        if still:
            names = mode_names(scale.mounting, still)
            found.append(LeftOut(f"mode(s) {names} of the block", "nothing excites them"))
    times = repeats(scale)
    if times > 1:
        found.append(LeftOut(f"{times - 1} of {times} parts of the cycle", "the loads repeat after each"))
    return found


def repeats(scale: Scale) -> int:
    """Times that all measured signals repeat within the cycle, whatever is decided."""
    ratios = tuple(
        as_order(abs(rotor.shaft.ratio))
        for rotor in scale.problem.engine.rotors
        if rotor.unbalance != 0 or any(d.rotor == rotor.name for c in scale.problem.decisions for d in c.rotor_drives)
    )
    cycle = scale.problem.engine.cycle.base_order
    bases = [loads.wrench.reduced(ratios).base for loads in scale.best.loads]
    return int(min(bases) / cycle) if bases else 1
