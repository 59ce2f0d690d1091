"""All knobs of the fidelity: key in a file, automatic choice, error bound, and variants of a trade (F1, F10, F13).

A knob is one field of the fidelity that a file may set or the program chooses. The automatic choice, `explain`, the
trade, the schema and the reader of problem files use the list `KNOBS` only. A new knob needs a field of
`physics.fidelity.Fidelity`, physics that reads the field, and a class here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from laufruhe.errors import UncarriedLoadError, plural
from laufruhe.fidelity.error_bounds import REFERENCE_SAMPLES, Scale
from laufruhe.physics.elastic_mounts import ElasticMounting
from laufruhe.physics.fidelity import EXACT, CrankshaftModel, Fidelity, Kinematics, MountModel, RodModel
from laufruhe.physics.mechanism import effects_of
from laufruhe.physics.rigid_body import WRENCH
from laufruhe.problem.problem import Problem

ORDERS = (1, 2, 3, 4, 6, 8, 10, 12, 16, 20, 24, 32, 40, 48, 64, 96, 128, 192, 256, 384)
SAMPLES = tuple(48 * k for k in (1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 18, 20, 24, 30, 40, 60, 80, 120))
GAS_SAMPLES = (720, 1440, 2880, REFERENCE_SAMPLES)
GAS_ORDERS = 12
"""Last order of the gas in the variant of a trade with fewer orders of gas."""
PHYSICS_SHARE, GAS_SHARE = 0.5, 0.25
"""Fractions of the tolerance for all omitted physics, and for the samples of the gas."""
TWO_ORDER, NO_GAS = "two-order, 720 steps", "exact without gas, 720 steps"
"""Names of variants of a trade that reports mention."""
PART_SHARE = 0.1
"""Fraction of the tolerance that omitting one part may use."""
TIME_ORDERS, TIME_SAMPLES = 12, 360
"""Orders and samples of the variant of a trade in the time domain; more orders take minutes."""
RIGID = "rigid mounts, 720 steps"
"""Name of a variant of a trade that reports mention."""


@dataclass(frozen=True)
class OmittedPart:
    """Part of the physics that is not computed.

    Attributes
    ----------
    share
        Upper bound of the relative change of the objective if the part is computed.
    restored
        Fidelity with this part; None if the part is exactly zero.
    """

    what: str
    why: str
    share: float = 0.0
    restored: Fidelity | None = None


Rungs = list[tuple[str, Fidelity]]


class Knob:
    """Field of the fidelity, with its rules for the automatic choice; defaults are those of a field without effect.

    Attributes
    ----------
    key, kind, unit, schema
        Key in table [fidelity], its type, SI unit (empty without one), and keyword arguments of its pydantic field.
    is_decided
        True if the automatic choice decides it; a file with the automatic choice then may not set it.
    """

    key: ClassVar[str]
    kind: ClassVar[Any]
    unit: ClassVar[str] = ""
    schema: ClassVar[Mapping[str, Any]] = {}
    is_decided: ClassVar[bool] = True

    def refusal(self, problem: Problem, value: Any) -> tuple[str, str] | None:
        """Return (rule, remedy) if a problem cannot have this value; None if it can."""
        return None

    def chosen(self, scale: Scale, fidelity: Fidelity, allowed_error: float) -> Fidelity:
        """Return the fidelity so far with the cheapest sufficient value of this field (F10).

        The allowed error is relative to the objective, and from all fields together.
        """
        return fidelity

    def describe(self, scale: Scale, fidelity: Fidelity) -> list[str]:
        """Return descriptions of the physics that the fidelity computes in this field."""
        return []

    def left_out(self, scale: Scale, fidelity: Fidelity) -> list[OmittedPart]:
        """Return the parts that the fidelity omits in this field, with upper bounds of their effect."""
        return []

    def rungs(self, scale: Scale) -> Rungs:
        """Return the fidelities that a trade tries for this field: (name, fidelity)."""
        return []

    def without_part(self, problem: Problem) -> Rungs:
        """Return fidelities of a problem without one part of its loads: (name of the part, fidelity)."""
        return []


def first_sufficient(
    fidelity: Fidelity, key: str, values: Sequence[int | None], is_sufficient: Callable[[Fidelity], bool]
) -> Fidelity:
    """Return the fidelity with the first sufficient value of a field; with the last value if none is sufficient."""
    candidate = fidelity
    for value in values:
        changed: dict[str, Any] = {key: value}
        candidate = replace(fidelity, **changed)
        if is_sufficient(candidate):
            break
    return candidate


def omitted_part(scale: Scale, chosen: Fidelity, restored: Fidelity, what: str, why: str) -> OmittedPart:
    """Return an omitted part with the bound of its effect, from the chosen fidelity and the one with the part."""
    share = scale.relative_loss(chosen, scale.evaluation(restored))
    return OmittedPart(what, why if share > 0.0 else "the objective does not count them", share, restored)


class _Kinematics(Knob):
    key, kind = "kinematics", Kinematics
    is_decided = False

    def describe(self, scale: Scale, fidelity: Fidelity) -> list[str]:
        return [f"exact kinematics, {_orders(fidelity)} of pistons and rods"]

    def rungs(self, scale: Scale) -> Rungs:
        quick = Fidelity("two-order", 48, gas_samples=_gas_steps(scale.problem))
        return [("two-order, 48 steps", quick), (TWO_ORDER, Fidelity("two-order", 720))]


class _SwitchedPart(Knob):
    """Part of the loads that is computed or not: `whole` and `less` are fields of the fidelity with and without it.

    The part is named `what`; `rung` is the name of the variant of a trade without it.
    """

    what: ClassVar[str]
    rung: ClassVar[str]
    less: ClassVar[Mapping[str, Any]]
    whole: ClassVar[Mapping[str, Any]]

    def is_there(self, problem: Problem) -> bool:
        raise NotImplementedError

    def is_active(self, problem: Problem, fidelity: Fidelity) -> bool:
        """Return True if the problem has this part and the fidelity computes it."""
        return self.is_there(problem) and getattr(fidelity, self.key) == getattr(EXACT, self.key)

    def chosen(self, scale: Scale, fidelity: Fidelity, allowed_error: float) -> Fidelity:
        # at an uneven speed, gas and inertia affect all loads
        if fidelity.is_uneven or not self.is_there(scale.problem):
            return fidelity
        less = replace(fidelity, **self.less)
        additional_loss = scale.relative_loss(less) - scale.relative_loss(fidelity)
        return less if additional_loss <= PART_SHARE * allowed_error else fidelity

    def left_out(self, scale: Scale, fidelity: Fidelity) -> list[OmittedPart]:
        if not self.is_there(scale.problem):
            return [OmittedPart(self.what, "the problem describes none")]
        if self.is_active(scale.problem, fidelity):
            return []
        reason = "the objective hardly sees its roll moment"
        return [omitted_part(scale, fidelity, replace(fidelity, **self.whole), self.what, reason)]

    def rungs(self, scale: Scale) -> Rungs:
        return [(self.rung, Fidelity(samples=720, **self.less))] if self.is_there(scale.problem) else []

    def without_part(self, problem: Problem) -> Rungs:
        return [(self.what, replace(problem.fidelity, **self.less))] if self.is_there(problem) else []


class _Rod(_SwitchedPart):
    key, kind = "rod", RodModel
    what, rung = "inertia of the rods beyond two masses", "exact, rod of two masses, 720 steps"
    less: ClassVar = {"rod": "mass-only"}
    whole: ClassVar = {"rod": "rigid"}

    def is_there(self, problem: Problem) -> bool:
        return any(effects_of(part, EXACT)[1] for part in problem.engine.slider_cranks)

    def describe(self, scale: Scale, fidelity: Fidelity) -> list[str]:
        return ["inertia of the rods beyond that of two masses"] if self.is_active(scale.problem, fidelity) else []


class _Gas(_SwitchedPart):
    key, kind = "gas", bool
    schema: ClassVar = {"description": "false leaves the working gas out."}
    what, rung = "gas", NO_GAS
    less: ClassVar = {"gas": False, "gas_orders": None}
    whole: ClassVar = {"gas": True, "gas_samples": REFERENCE_SAMPLES}

    def is_there(self, problem: Problem) -> bool:
        return any(point.gas is not None for point in problem.points)

    def describe(self, scale: Scale, fidelity: Fidelity) -> list[str]:
        if not self.is_active(scale.problem, fidelity):
            return []
        return [f"gas, its torque taken at {fidelity.gas_steps} steps over the cycle, {_orders(fidelity)} of it"]


class _GasSamples(Knob):
    key, kind = "gas_samples", int
    schema: ClassVar = {"description": "Steps of the gas torque over the working cycle.", "ge": 48, "le": 100_000}

    def chosen(self, scale: Scale, fidelity: Fidelity, allowed_error: float) -> Fidelity:
        if not GAS.is_active(scale.problem, fidelity):
            return replace(fidelity, gas_samples=None)
        return first_sufficient(
            fidelity, self.key, GAS_SAMPLES, lambda f: scale.relative_loss(f) <= GAS_SHARE * allowed_error
        )


class _Orders(Knob):
    key, kind = "orders", int
    schema: ClassVar = {"description": "Last order kept of pistons, rods and gas.", "ge": 1}

    def chosen(self, scale: Scale, fidelity: Fidelity, allowed_error: float) -> Fidelity:
        if fidelity.is_uneven:
            return fidelity
        return first_sufficient(
            fidelity, self.key, (*ORDERS, None), lambda f: scale.relative_loss(f) <= PHYSICS_SHARE * allowed_error
        )

    def left_out(self, scale: Scale, fidelity: Fidelity) -> list[OmittedPart]:
        wrenches = [*(loads.wrench for loads in scale.best.loads), *scale.open_wrenches]
        parts = []
        idle = [name for k, name in enumerate(WRENCH) if not any(w.coefficients[:, k].any() for w in wrenches)]
        if idle:
            parts.append(OmittedPart("loads " + ", ".join(idle), "nothing drives them"))
        last = min(float(fidelity.orders or 8), 12.0)
        orders = [order for order in wrenches[0].orders if 0.0 < order <= last]
        silent = [f"{order:g}" for order in orders if not any(s.at(order).any() for s in scale.exciting_signals)]
        if silent:
            parts.append(OmittedPart("orders " + ", ".join(silent), "the crank star cancels them, or nothing has them"))
        if fidelity.orders is not None:
            what, restored = f"orders above {fidelity.orders}", replace(fidelity, orders=None)
            parts.append(omitted_part(scale, fidelity, restored, what, "their forces are small"))
        return parts

    def rungs(self, scale: Scale) -> Rungs:
        gas = _gas_steps(scale.problem)
        return [
            (f"orders to {orders}, {samples} steps", Fidelity(samples=samples, orders=orders, gas_samples=gas))
            for orders, samples in ((4, 96), (8, 192), (24, 360))
        ]

    def without_part(self, problem: Problem) -> Rungs:
        return [("orders above 2", replace(problem.fidelity, orders=2))]


class _GasOrders(Knob):
    # set by hand only: the automatic choice limits the orders of all loads
    key, kind = "gas_orders", int
    schema: ClassVar = {"description": "Last order kept of the gas alone.", "ge": 1}

    def refusal(self, problem: Problem, value: Any) -> tuple[str, str] | None:
        return None if GAS.is_there(problem) else ("is a choice of gas", "leave it out, or add [gas]")

    def rungs(self, scale: Scale) -> Rungs:
        cut = Fidelity(samples=720, gas_orders=GAS_ORDERS)
        return [(f"exact, gas to order {GAS_ORDERS}, 720 steps", cut)] if GAS.is_there(scale.problem) else []


class _Crankshaft(Knob):
    """Model of the crankshaft, set by hand only: real crankshafts lie between the two models."""

    key, kind, is_decided = "crankshaft", CrankshaftModel, False
    schema: ClassVar = {"description": "How main bearings share its loads: cut in its journals, or a continuous beam."}

    def refusal(self, problem: Problem, value: Any) -> tuple[str, str] | None:
        return None if problem.engine.bearings else ("is a choice of main bearings", "leave it out, or list them")

    def rungs(self, scale: Scale) -> Rungs:
        if not any(term.measure.is_inside for term in scale.terms):
            return []
        is_beam = scale.problem.fidelity.crankshaft == "beam"
        return [("crankshaft cut", Fidelity())] if is_beam else [("crankshaft as a beam", Fidelity(crankshaft="beam"))]


class _CrankInertia(Knob):
    key, kind, unit = "crank_inertia", float, "kg m^2"
    schema: ClassVar = {"description": "Inertia of all that turns with the crank; its speed varies within the cycle."}
    is_decided = False

    def describe(self, scale: Scale, fidelity: Fidelity) -> list[str]:
        return ["crank speed that varies within the cycle"] if fidelity.is_uneven else []


class _OfElasticMounts(Knob):
    """Knob for a block on elastic mounts; with open mounts only its exact value is allowed."""

    def refusal(self, problem: Problem, value: Any) -> tuple[str, str] | None:
        if value == getattr(EXACT, self.key):
            return None
        if problem.engine.block is None:
            return "is a choice of elastic mounts", 'leave it out, or add mounts of kind "elastic"'
        if problem.mount_decisions:
            return "cannot be set while mounts are open", "leave it out, or fix the mounts"
        return None

    def is_open(self, scale: Scale) -> bool:
        """Return True if the automatic choice may decide this field for the problem."""
        return scale.mounting is not None and not scale.problem.mount_decisions


class _Mounts(_OfElasticMounts):
    key, kind = "mounts", MountModel
    schema: ClassVar = {"description": "Elastic mounts order by order, as if they gave no way, or integrated in time."}

    def chosen(self, scale: Scale, fidelity: Fidelity, allowed_error: float) -> Fidelity:
        if not self.is_open(scale):
            return fidelity
        rigid = replace(fidelity, mounts="rigid")
        try:
            lost = scale.relative_loss(rigid)
        except UncarriedLoadError:
            return fidelity
        return rigid if lost <= scale.relative_loss(fidelity) + PART_SHARE * allowed_error else fidelity

    def describe(self, scale: Scale, fidelity: Fidelity) -> list[str]:
        return ["mounts as if they gave no way"] if scale.mounting and fidelity.mounts == "rigid" else []

    def left_out(self, scale: Scale, fidelity: Fidelity) -> list[OmittedPart]:
        if scale.mounting is None or fidelity.mounts != "rigid":
            return []
        restored = replace(fidelity, mounts="frequency")
        return [
            omitted_part(scale, fidelity, restored, "motion of the block", "its mounts hardly give way at these orders")
        ]

    def rungs(self, scale: Scale) -> Rungs:
        if scale.mounting is None or not scale.terms:
            return []
        cut, orders = Fidelity(samples=TIME_SAMPLES, orders=TIME_ORDERS), f"orders to {TIME_ORDERS}"
        return [
            (RIGID, Fidelity(samples=720, mounts="rigid")),
            (f"{orders}, {TIME_SAMPLES} steps", cut),
            *([(f"in time, {orders}", replace(cut, mounts="time"))] if scale.mounting.dynamic.has_law else []),
        ]


class _Modes(_OfElasticMounts):
    key, kind = "modes", list[int]
    schema: ClassVar = {"description": "Natural modes that answer, 1 the lowest."}

    def chosen(self, scale: Scale, fidelity: Fidelity, allowed_error: float) -> Fidelity:
        """Return the fidelity without modes of small response; modes that open rotors excite stay."""
        if fidelity.mounts != "frequency" or not self.is_open(scale):
            return fidelity
        allowed = scale.relative_loss(fidelity) + PART_SHARE * allowed_error
        result, modes = fidelity, scale.excited_modes
        for mode in sorted(set(modes) - scale.open_rotor_modes, key=lambda mode: scale.mode_contributions[mode]):
            modes = tuple(m for m in modes if m != mode)
            candidate = replace(fidelity, modes=modes)
            if scale.relative_loss(candidate) > allowed:
                break
            result = candidate
        return result

    def describe(self, scale: Scale, fidelity: Fidelity) -> list[str]:
        if scale.mounting is None or fidelity.mounts != "frequency":
            return []
        modes = scale.excited_modes if fidelity.modes is None else fidelity.modes
        note = "; modes are of the stiffness at rest, loads of that at each frequency" if scale.mounting.dynamic else ""
        return [f"{mode_names(scale.mounting, modes)} of the block on its mounts{note}"]

    def left_out(self, scale: Scale, fidelity: Fidelity) -> list[OmittedPart]:
        if scale.mounting is None:
            return []
        parts, still = [], [mode for mode in range(1, 7) if mode not in scale.excited_modes]
        if still:
            parts.append(OmittedPart(f"{mode_names(scale.mounting, still)} of the block", "nothing excites them"))
        if fidelity.modes is not None:
            silent = [mode for mode in scale.excited_modes if mode not in fidelity.modes]
            what, all_modes = f"{mode_names(scale.mounting, silent)} of the block", replace(fidelity, modes=None)
            parts.append(omitted_part(scale, fidelity, all_modes, what, "what they answer is small"))
        return parts

    def rungs(self, scale: Scale) -> Rungs:
        """Return variants with the one and the three modes of largest response."""
        if scale.mounting is None or not scale.terms:
            return []
        by_strength = sorted(scale.mode_contributions, key=lambda mode: -scale.mode_contributions[mode])
        maximum = [tuple(sorted(by_strength[:count])) for count in (1, 3) if count < len(by_strength)]
        return [
            (f"{plural('mode', len(m))} {', '.join(map(str, m))}, 720 steps", Fidelity(samples=720, modes=m))
            for m in maximum
        ]


class _Samples(Knob):
    key, kind = "samples", int
    schema: ClassVar = {"description": "Steps over the working cycle.", "ge": 48, "le": 100_000}

    def chosen(self, scale: Scale, fidelity: Fidelity, allowed_error: float) -> Fidelity:
        if fidelity.is_uneven:
            return fidelity
        lost, steps = scale.relative_loss(fidelity), (*SAMPLES, REFERENCE_SAMPLES)
        return first_sufficient(
            fidelity, self.key, steps, lambda f: lost + scale.relative_sampling_error(f) <= allowed_error
        )

    def describe(self, scale: Scale, fidelity: Fidelity) -> list[str]:
        return [f"{fidelity.samples} steps over the cycle"]

    def left_out(self, scale: Scale, fidelity: Fidelity) -> list[OmittedPart]:
        times = scale.repeats
        again = OmittedPart(f"{times - 1} of {times} parts of the cycle", "the loads repeat after each")
        finer = replace(fidelity, samples=REFERENCE_SAMPLES, gas_samples=fidelity.gas_steps)
        share = scale.relative_sampling_error(fidelity) + scale.relative_sampling_error(finer)
        between = f"angles between {fidelity.samples} steps"
        missed = OmittedPart(between, "the force runs smoothly through them", share, finer)
        return [again, missed] if times > 1 else [missed]

    def rungs(self, scale: Scale) -> Rungs:
        return [(f"exact, {samples} steps", Fidelity(samples=samples)) for samples in (720, 1440, 2880)]


GAS = _Gas()
KNOBS: tuple[Knob, ...] = (
    _Kinematics(), _Rod(), GAS, _GasSamples(), _GasOrders(), _Orders(), _CrankInertia(), _Crankshaft(),
    _Mounts(), _Modes(), _Samples(),
)  # fmt: skip


def _orders(fidelity: Fidelity) -> str:
    return "every order" if fidelity.orders is None else f"orders to {fidelity.orders}"


def _gas_steps(problem: Problem) -> int | None:
    return EXACT.samples if GAS.is_there(problem) else None


def mode_names(mounting: ElasticMounting, modes: Iterable[int]) -> str:
    """Return the names of modes, 1 the lowest, with number, motion and natural frequency."""
    shapes = mounting.modes
    named = [f"{k} ({shapes.names[k - 1]}, {shapes.frequencies[k - 1]:.3g} Hz)" for k in modes]
    return f"{plural('mode', len(named))} {', '.join(named)}"
