"""Knobs of the fidelity for a block on elastic mounts: rigid or elastic mounts, and the natural modes (F1)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any, ClassVar

from laufruhe.errors import UncarriedLoadError, plural
from laufruhe.fidelity.error_bounds import Scale
from laufruhe.fidelity.knob import PART_SHARE, Knob, OmittedPart, Rungs, omitted_part
from laufruhe.physics.elastic_mounts import ElasticMounting
from laufruhe.physics.fidelity import EXACT, Fidelity, MountModel
from laufruhe.problem.problem import Problem

TIME_ORDERS, TIME_SAMPLES = 12, 360
"""Orders and samples of the variant of a trade in the time domain; more orders take minutes."""
RIGID = "rigid mounts, 720 steps"
"""Name of a variant of a trade that reports mention."""


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


MOUNT_KNOBS: tuple[Knob, ...] = (_Mounts(), _Modes())


def mode_names(mounting: ElasticMounting, modes: Iterable[int]) -> str:
    """Return the names of modes, 1 the lowest, with number, motion and natural frequency."""
    shapes = mounting.modes
    named = [f"{k} ({shapes.names[k - 1]}, {shapes.frequencies[k - 1]:.3g} Hz)" for k in modes]
    return f"{plural('mode', len(named))} {', '.join(named)}"
