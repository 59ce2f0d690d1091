"""Choice of the cheapest fidelity that keeps the objective within a tolerance, with its explanation (F10)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from laufruhe.errors import ModelError, plural
from laufruhe.extensions.fidelity.reference import Reference, reference
from laufruhe.machine import Engine
from laufruhe.physics.elastic_mounts import ElasticMounting
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.mechanism import effects_of
from laufruhe.physics.rigid_body import WRENCH
from laufruhe.problem.error_bounds import REFERENCE_SAMPLES, relative, signals
from laufruhe.problem.problem import Problem

ORDERS = (1, 2, 3, 4, 6, 8, 10, 12, 16, 20, 24, 32, 40, 48, 64, 96, 128, 192, 256, 384)
SAMPLES = tuple(48 * k for k in (1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 18, 20, 24, 30, 40, 60, 80, 120))
GAS_SAMPLES = (720, 1440, 2880, REFERENCE_SAMPLES)
PHYSICS_SHARE, GAS_SHARE, PART_SHARE = 0.5, 0.25, 0.1
"""Fractions of the tolerance: for all omitted physics, for the gas samples, and for the omission of one part."""


@dataclass(frozen=True)
class OmittedPart:
    """Part of the physics that a fidelity leaves out.

    Attributes
    ----------
    share
        Relative change of the objective of the design if the part is computed.
    restored
        Fidelity with this part; None if the part is exactly zero.
    """

    what: str
    why: str
    share: float = 0.0
    restored: Fidelity | None = None


@dataclass(frozen=True)
class SwitchedPart:
    """Part of the loads that is computed or not: `less` and `whole` are fields of the fidelity without and with it."""

    key: str
    what: str
    less: Mapping[str, Any]
    whole: Mapping[str, Any]
    is_there: Callable[[Problem], bool]

    def is_active(self, problem: Problem, fidelity: Fidelity) -> bool:
        """Return True if the problem has this part and the fidelity computes it."""
        return self.is_there(problem) and getattr(fidelity, self.key) == getattr(EXACT, self.key)


ROD = SwitchedPart(
    "rod", "inertia of the rods beyond two masses", {"rod": "mass-only"}, {"rod": "rigid"},
    lambda problem: any(effects_of(part, EXACT)[1] for part in problem.engine.slider_cranks),
)  # fmt: skip
GAS = SwitchedPart(
    "gas", "gas", {"gas": False, "gas_orders": None}, {"gas": True, "gas_samples": REFERENCE_SAMPLES},
    lambda problem: any(point.gas is not None for point in problem.points),
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Choice:
    """Chosen fidelity with its error bound and explanation.

    Attributes
    ----------
    error_estimate
        Relative error of the objective of the design, with the doubt about the reference.
    description
        Descriptions of the physics that is computed.
    left_out
        Parts of the physics that are omitted.
    numbers
        Number of force components that one evaluation samples at this fidelity, and by the exact model with the samples
        of the problem file.
    """

    fidelity: Fidelity
    error_estimate: float
    description: tuple[str, ...]
    left_out: tuple[OmittedPart, ...]
    numbers: tuple[int, int]


def choose(problem: Problem, tolerance: float, engine: Engine | None = None) -> Choice:
    """Return the cheapest fidelity whose relative error of a design's objective is within the tolerance (F10).

    By default the design is that of the problem. If the objective is zero, all parts of the physics that are not zero
    are computed. An uneven crank speed stays uneven.
    """
    scale = Reference(problem, reference(problem, engine))
    doubt = relative(scale.doubt, scale.value)
    fidelity = _cheapest(scale, max(tolerance - doubt, 0.0), replace(scale.best.fidelity, tolerance=tolerance))
    estimate = scale.relative_change(fidelity) + doubt
    pruned = full = 0
    for term in scale.terms:
        spectra = signals(term.measure, scale.best)
        directions = sum(int(np.any(np.abs(s.coefficients) > 0.0, axis=(0, 1)).sum()) for s in spectra)
        mounts, width = spectra[0].coefficients.shape[1:]
        pruned += max(fidelity.samples // scale.repeats, 24) * mounts * directions
        full += scale.problem.fidelity.samples * mounts * width * len(spectra)
    return Choice(
        fidelity,
        # convert from an error relative to the reference to one relative to the computed value
        estimate / max(1.0 - estimate, 0.5),
        tuple(_description(scale, fidelity)),
        # parts that are exactly zero come first
        tuple(sorted(_omitted_parts(scale, fidelity), key=lambda part: part.restored is not None)),
        (pruned, full),
    )


def _cheapest(reference: Reference, allowed_error: float, fidelity: Fidelity) -> Fidelity:
    """Return the cheapest fidelity whose relative error from all options together is at most `allowed_error` (F10)."""
    problem, loss = reference.problem, reference.relative_change
    # at an uneven speed, gas and inertia affect all loads
    is_even = not fidelity.has_uneven_speed
    fidelity = replace(fidelity, gas_samples=REFERENCE_SAMPLES)
    for part in (ROD, GAS):
        if is_even and part.is_there(problem):
            less = replace(fidelity, **part.less)
            fidelity = less if loss(less) - loss(fidelity) <= PART_SHARE * allowed_error else fidelity
    if GAS.is_active(problem, fidelity):
        fidelity = _first(fidelity, "gas_samples", GAS_SAMPLES, lambda f: loss(f) <= GAS_SHARE * allowed_error)
    else:
        fidelity = replace(fidelity, gas_samples=None)
    if is_even:
        fidelity = _first(fidelity, "orders", (*ORDERS, None), lambda f: loss(f) <= PHYSICS_SHARE * allowed_error)
    if reference.mounting is not None and not problem.mount_decisions:
        rigid = replace(fidelity, mounts="rigid")
        try:
            is_sufficient = loss(rigid) <= loss(fidelity) + PART_SHARE * allowed_error
        except ModelError:
            is_sufficient = False
        fidelity = rigid if is_sufficient else _with_few_modes(reference, fidelity, PART_SHARE * allowed_error)
    if is_even:
        fidelity = _first(fidelity, "samples", (*SAMPLES, REFERENCE_SAMPLES), lambda f: loss(f) <= allowed_error)
    return fidelity


def _first(
    fidelity: Fidelity, key: str, values: Sequence[int | None], is_sufficient: Callable[[Fidelity], bool]
) -> Fidelity:
    """Return the fidelity with the first sufficient value of option `key`, or with the last value if none suffices."""
    candidate = fidelity
    for value in values:
        changed: dict[str, Any] = {key: value}
        candidate = replace(fidelity, **changed)
        if is_sufficient(candidate):
            break
    return candidate


def _with_few_modes(reference: Reference, fidelity: Fidelity, allowed_loss: float) -> Fidelity:
    """Return the fidelity without modes of small response, within a relative change of the objective `allowed_loss`.

    Modes that open rotors excite stay.
    """
    maximum = reference.relative_change(fidelity) + allowed_loss
    result, modes = fidelity, reference.excited_modes
    for mode in sorted(set(modes) - reference.open_rotor_modes, key=lambda mode: reference.mode_contributions[mode]):
        modes = tuple(m for m in modes if m != mode)
        candidate = replace(fidelity, modes=modes)
        if reference.relative_change(candidate) > maximum:
            break
        result = candidate
    return result


def _description(reference: Reference, fidelity: Fidelity) -> list[str]:
    """Return descriptions of the physics that a fidelity computes, such as gas, rods and orders, for reports."""
    problem, mounting = reference.problem, reference.mounting
    orders = "every order" if fidelity.orders is None else f"orders to {fidelity.orders}"
    lines = [f"exact kinematics, {orders} of pistons and rods"]
    if ROD.is_active(problem, fidelity):
        lines.append("inertia of the rods beyond that of two masses")
    if GAS.is_active(problem, fidelity):
        lines.append(f"gas, its torque taken at {fidelity.gas_steps} steps over the cycle, {orders} of it")
    if fidelity.has_uneven_speed:
        lines.append("crank speed that varies within the cycle")
    if mounting and fidelity.mounts == "rigid":
        lines.append("mounts as if they gave no way")
    if mounting and fidelity.mounts == "frequency":
        modes = reference.excited_modes if fidelity.modes is None else fidelity.modes
        note = "; modes are of the stiffness at rest, loads of that at each frequency" if mounting.dynamic else ""
        lines.append(f"{mode_names(mounting, modes)} of the block on its mounts{note}")
    return [*lines, f"{fidelity.samples} steps over the cycle"]


def _omitted_parts(reference: Reference, fidelity: Fidelity) -> list[OmittedPart]:
    """Return the parts of the physics that a fidelity omits, with upper bounds of their effect on the objective."""
    parts = []

    def omit(what: str, why: str, **restored: Any) -> None:
        whole = replace(fidelity, **restored)
        share = reference.relative_change(fidelity, whole)
        parts.append(OmittedPart(what, why if share > 0.0 else "the objective does not count them", share, whole))

    for part in (ROD, GAS):
        if not part.is_there(reference.problem):
            parts.append(OmittedPart(part.what, "the problem describes none"))
        elif not part.is_active(reference.problem, fidelity):
            omit(part.what, "the objective hardly sees its roll moment", **part.whole)
    wrenches = [*(loads.wrench for loads in reference.best.loads), *reference.open_rotor_wrenches]
    idle = [name for k, name in enumerate(WRENCH) if not any(w.coefficients[:, k].any() for w in wrenches)]
    if idle:
        parts.append(OmittedPart("loads " + ", ".join(idle), "nothing drives them"))
    last = min(float(fidelity.orders or 8), 12.0)
    orders = [order for order in wrenches[0].orders if 0.0 < order <= last]
    silent = [f"{order:g}" for order in orders if not any(s.at(order).any() for s in reference.exciting_signals)]
    if silent:
        parts.append(OmittedPart("orders " + ", ".join(silent), "the crank star cancels them, or nothing has them"))
    if fidelity.orders is not None:
        omit(f"orders above {fidelity.orders}", "their forces are small", orders=None)
    if reference.mounting is not None:
        if fidelity.mounts == "rigid":
            omit("motion of the block", "its mounts hardly give way at these orders", mounts="frequency")
        still = [mode for mode in range(1, 7) if mode not in reference.excited_modes]
        if still:
            parts.append(OmittedPart(f"{mode_names(reference.mounting, still)} of the block", "nothing excites them"))
        if fidelity.modes is not None:
            small = [mode for mode in reference.excited_modes if mode not in fidelity.modes]
            omit(f"{mode_names(reference.mounting, small)} of the block", "what they answer is small", modes=None)
    if reference.repeats > 1:
        repeated = f"{reference.repeats - 1} of {reference.repeats} parts of the cycle"
        parts.append(OmittedPart(repeated, "the loads repeat after each"))
    finer = replace(fidelity, samples=REFERENCE_SAMPLES, gas_samples=fidelity.gas_steps)
    share = reference.relative_change(fidelity, finer)
    between = f"angles between {fidelity.samples} steps"
    return [*parts, OmittedPart(between, "the force runs smoothly through them", share, finer)]


def mode_names(mounting: ElasticMounting, modes: Iterable[int]) -> str:
    """Return the names of modes, 1 the lowest, with number, motion and natural frequency."""
    shapes = mounting.modes
    named = [f"{k} ({shapes.names[k - 1]}, {shapes.frequencies[k - 1]:.3g} Hz)" for k in modes]
    return f"{plural('mode', len(named))} {', '.join(named)}"
