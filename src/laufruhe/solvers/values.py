"""Numbers that a result tells: decisions, limits, objectives, and what may be reached where there is no design."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from laufruhe.problem.evaluation import Evaluation, objective_value
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from laufruhe.solvers.prices import Price

NEXT_TO_NOTHING = 1e-5
APART = 0.05
"""Share of the largest decision by which two designs differ."""


@dataclass(frozen=True)
class DecisionValue:
    """Value of one decision [SI].

    Attributes
    ----------
    shadow_price
        Fall of the objective per unit by which the bound it stands at is moved outwards.
    tightening_price
        Rise per unit by which it is moved inwards, where that is another.
    """

    name: str
    value: float
    unit: str
    lower: float
    upper: float
    initial: float
    at_bound: bool
    shadow_price: float = 0.0
    tightening_price: float | None = None

    @property
    def price(self) -> Price:
        """Price of the bound on both sides."""
        other = self.tightening_price
        return Price(self.shadow_price, self.shadow_price if other is None else other)

    @property
    def is_zero(self) -> bool:
        """Tell if the value is zero up to rounding, relative to its bounds."""
        return abs(self.value) <= NEXT_TO_NOTHING * max(abs(self.lower), abs(self.upper))


def meaningful(decisions: Sequence[DecisionValue]) -> list[DecisionValue]:
    """Without angles of sizes that are none."""
    pairs = pairwise([None, *decisions])
    return [d for size, d in pairs if d is not None and not (d.name.endswith(".angle") and size and size.is_zero)]


@dataclass(frozen=True)
class DecisionRange:
    """Least and largest value of a decision among designs that an objective does not tell apart [SI]."""

    name: str
    unit: str
    low: float
    high: float


@dataclass(frozen=True)
class RankValue:
    """Result of one objective in a lexicographic order [SI].

    Attributes
    ----------
    minimum, lower_bound, gap, proof
        What was found under the limits of those before it, and how good that is.
    initial, final
        Of the design as given, and of that of the last rank.
    limit
        What those after it may make of it; None of the last.
    price
        Fall of the last objective per unit by which this one may be exceeded.
    designs
        Ends of every decision among the designs that are best by this one and those before it.
    """

    name: str
    unit: str
    initial: float
    minimum: float
    lower_bound: float
    gap: float
    proof: Proof
    final: float
    limit: float | None
    price: float
    designs: tuple[DecisionRange, ...] = ()

    @property
    def equal(self) -> tuple[DecisionRange, ...]:
        """Decisions whose ends are two designs, and not what the solver's tolerance leaves of one."""
        maximum = {found.unit: max(abs(d.high) for d in self.designs if d.unit == found.unit) for found in self.designs}
        return tuple(found for found in self.designs if found.high - found.low > APART * maximum[found.unit])


@dataclass(frozen=True)
class LimitValue:
    """Value of one limit at a design [SI].

    Attributes
    ----------
    shadow_price
        Fall of the objective per unit by which the limit is relaxed; not a number where that is not known.
    side
        "at most" or "at least".
    error_estimate
        What samples over the cycle may have missed of the value, relative, not exceeded.
    tightening_price
        Rise of the objective per unit by which the limit is tightened, where that is another; infinite where no design
        is left.
    """

    name: str
    value: float
    limit: float
    unit: str
    active: bool
    shadow_price: float
    side: str = "at most"
    error_estimate: float = 0.0
    tightening_price: float | None = None

    @property
    def price(self) -> Price:
        """Price on both sides."""
        other = self.tightening_price
        return Price(self.shadow_price, self.shadow_price if other is None else other)


@dataclass(frozen=True)
class AttainableLimit:
    """Closest value that a broken limit can reach while the other limits hold [SI].

    Attributes
    ----------
    side, limit
        "at most" or "at least", and what was asked for.
    value
        Of the design found that comes nearest, or of every one; not a number where none is told.
    bound
        What no design that keeps the other limits goes beyond; not a number where that is not known.
    proof
        Of the value.
    decisions
        Of that design.
    why, ended
        Why no design is told, and whether the search for one was ended for want of time.
    """

    name: str
    side: str
    limit: float
    unit: str
    value: float = math.nan
    bound: float = math.nan
    proof: Proof = Proof.NONE
    decisions: tuple[DecisionValue, ...] = ()
    why: str = ""
    ended: bool = False


@dataclass(frozen=True)
class Nearest:
    """The design found that breaks limits least, which is no answer: the limit that it breaks most, and how [SI].

    Attributes
    ----------
    value, violation
        Of the measure that is limited, and the share by which it is beyond the limit.
    broken
        Names of all limits that it breaks.
    """

    name: str
    side: str
    limit: float
    unit: str
    value: float
    violation: float
    broken: tuple[str, ...]
    decisions: tuple[DecisionValue, ...]


@dataclass(frozen=True)
class ObjectiveValue:
    """The objective of the design and of the one given, which is infinite where that stands on a resonance."""

    name: str
    value: float
    unit: str
    initial: float

    @classmethod
    def of(cls, problem: Problem, value: float, initial: float) -> ObjectiveValue:
        """Return the objective value of a design and of the initial design [SI]."""
        return cls(problem.objective_name, value, problem.objective_unit or "", initial)

    @classmethod
    def given(cls, problem: Problem, design: Evaluation) -> ObjectiveValue | None:
        """Return the objective value of the initial design; None without an objective."""
        value = objective_value(problem, design)
        return cls.of(problem, value, value) if problem.objective else None

    @property
    def reduction(self) -> float:
        """Share by which the initial value fell; not a number where that is infinite."""
        if math.isinf(self.initial):
            return math.nan
        return 1.0 - self.value / self.initial if self.initial else 0.0
