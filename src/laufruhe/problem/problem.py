"""A design problem: an engine, what may be decided, what is wanted, what is forbidden."""

from __future__ import annotations

import cmath
import html
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from laufruhe.machine import Engine, OperatingPoint
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.problem.measure import ON_MOUNTS, Quantity, Subject
from laufruhe.problem.mount_design import NOTHING_ASKED, MountDesign
from laufruhe.problem.phasing import Phasing

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Drive:
    """How a decision acts on one rotor: U += gain u, or gain conj(u) when mirrored."""

    rotor: str
    gain: complex
    mirrored: bool = False


@dataclass(frozen=True)
class UnbalanceDecision:
    """A size, and an angle where that is open, that rotors' unbalances follow (C4).

    The decision is u = size e^{i angle}. With the angle fixed it is one real number
    between bounds; else it lies in the disc or the sector of the largest size.

    Attributes
    ----------
    name
        As in the problem file.
    unit
        Of the size: "kg m", "kg", or "" for a balance fraction.
    lower, upper
        Bounds of the size; the lower one is zero unless the angle is fixed.
    angle
        Bounds of the angle [rad]: equal when fixed, a whole turn apart when free.
    start
        u of the design as given.
    drives
        The rotors that follow.
    """

    name: str
    unit: str
    lower: float
    upper: float
    angle: tuple[float, float]
    start: complex
    drives: tuple[Drive, ...]

    @property
    def fixed_angle(self) -> bool:
        """Whether the size alone is open."""
        return self.angle[0] == self.angle[1]

    @property
    def free_angle(self) -> bool:
        """Whether every angle is allowed."""
        return self.angle[1] - self.angle[0] >= math.tau * (1.0 - 1e-12)

    def split(self, u: complex) -> tuple[float, float]:
        """Size and angle [rad] of a value, the angle within the bounds' own turn."""
        if self.fixed_angle:
            return (u * cmath.exp(-1j * self.angle[0])).real, self.angle[0]
        low = self.angle[0]
        return abs(u), low + (cmath.phase(u) - low) % math.tau if u != 0 else low


@dataclass(frozen=True)
class Term:
    """One weighted part of the objective."""

    quantity: Quantity
    weight: float = 1.0


@dataclass(frozen=True)
class Limit:
    """A quantity that may not exceed a value [SI]."""

    name: str
    quantity: Quantity
    maximum: float


@dataclass(frozen=True, repr=False)
class Problem:
    """Everything that a solver and a report need to know.

    Attributes
    ----------
    name
        Of the file, for results.
    title, source, assumptions
        For the reader of a report.
    engine
        The design as given; open numbers stand at their start.
    points
        Operating points.
    decisions
        What is open.
    objective
        Weighted sum of quantities to be least.
    limits
        What is forbidden.
    fidelity
        What of the physics is kept.
    tolerance
        Relative gap at which an optimum counts as proven.
    mount_design
        What of elastic mounts is open and asked.
    phasing
        What of throws, firing order and the choice of shafts is open; None if nothing is.
    """

    name: str
    title: str
    engine: Engine
    points: tuple[OperatingPoint, ...]
    decisions: tuple[UnbalanceDecision, ...] = ()
    objective: tuple[Term, ...] = ()
    limits: tuple[Limit, ...] = ()
    source: str = ""
    assumptions: tuple[str, ...] = ()
    fidelity: Fidelity = EXACT
    tolerance: float = 1e-4
    mount_design: MountDesign = NOTHING_ASKED
    phasing: Phasing | None = None

    def __repr__(self) -> str:
        return f"<Problem {self.summary}>"

    def _repr_html_(self) -> str:
        return f"<strong>{html.escape(self.title)}</strong><br>{html.escape(self.summary)}"

    @property
    def summary(self) -> str:
        """What the problem is about and what of it is open, in one line."""
        engine = self.engine
        parts = [
            self.name,
            f"{len(engine.cylinders)} cylinder(s), {engine.cycle}",
            f"{len(engine.mounts)} mount(s)",
            f"{len(self.points)} operating point(s)",
            f"{len(self.limits) + len(self.mount_design.limits)} constraint(s)",
        ]
        names = list(self.phasing.open_names) if self.phasing is not None else []
        names += [decision.name + ("" if decision.fixed_angle else " and angle") for decision in self.decisions]
        names += [decision.name for decision in self.mount_design.decisions]
        return ", ".join(parts) + "; open: " + (", ".join(names) or "nothing")

    @property
    def start(self) -> tuple[complex, ...]:
        """Decisions of the design as given."""
        return tuple(decision.start for decision in self.decisions)

    @property
    def feels_gas(self) -> bool:
        """Whether gas loads what is minimised or limited: its roll moment alone, and all where it drives the speed."""
        asked = [term.quantity for term in self.objective] + [limit.quantity for limit in self.limits]
        felt = any(quantity.subject in (*ON_MOUNTS, Subject.ROLL_MOMENT) for quantity in asked)
        has_gas = self.fidelity.gas and any(point.gas is not None for point in self.points)
        return has_gas and (felt or self.fidelity.is_uneven)

    @property
    def objective_name(self) -> str:
        """What is minimised, in words; empty where nothing is."""
        parts = [(term.weight, term.quantity.name) for term in self.objective]
        parts += [(weight, quantity.name) for quantity, weight in self.mount_design.terms]
        if len(parts) == 1 and parts[0][0] == 1.0:
            return parts[0][1]
        return " + ".join(f"{weight:g} x {name}" for weight, name in parts)

    @property
    def objective_unit(self) -> str | None:
        """SI unit of what is minimised, empty where its terms have several; None where nothing is."""
        units = {term.quantity.unit for term in self.objective}
        units |= {quantity.unit for quantity, _ in self.mount_design.terms}
        if not units:
            return None
        return units.pop() if len(units) == 1 else ""

    def at(self, fidelity: Fidelity) -> Problem:
        """The same problem at another fidelity, every design of an open star included."""
        if self.phasing is None:
            return replace(self, fidelity=fidelity)
        realise = self.phasing.realise
        phasing = replace(self.phasing, realise=lambda candidate: realise(candidate).at(fidelity))
        return replace(self, fidelity=fidelity, phasing=phasing)

    def design(self, values: Sequence[complex], mount_values: Sequence[float] | None = None) -> Engine:
        """The engine with these decisions in place of those it was given with."""
        unbalances = {rotor.name: rotor.unbalance for rotor in self.engine.rotors}
        for decision, value in zip(self.decisions, values, strict=True):
            change = value - decision.start
            for drive in decision.drives:
                unbalances[drive.rotor] += drive.gain * (change.conjugate() if drive.mirrored else change)
        rotors = tuple(replace(rotor, unbalance=unbalances[rotor.name]) for rotor in self.engine.rotors)
        engine = replace(self.engine, rotors=rotors)
        return engine if mount_values is None else self.mount_design.applied(engine, mount_values)
