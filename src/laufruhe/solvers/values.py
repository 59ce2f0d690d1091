"""Numbers of a result: decisions, limits, objectives, and attainable limits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from laufruhe.problem.evaluation import Evaluation, objective_value
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from laufruhe.solvers.prices import Price

ZERO_SHARE = 1e-5
"""Value relative to its bounds that counts as zero."""
DISTINCT_SHARE = 0.05
"""Width of a range, relative to the largest decision of its unit, above which the designs in it differ."""


class _Priced:
    """Value with shadow prices of its active bound or limit."""

    shadow_price: float
    tightening_price: float | None

    @property
    def price(self) -> Price:
        """Shadow price of the active bound or limit."""
        other = self.tightening_price
        return Price(self.shadow_price, self.shadow_price if other is None else other)


@dataclass(frozen=True)
class DecisionValue(_Priced):
    """Value of one decision [SI].

    Attributes
    ----------
    shadow_price
        Fall of the objective per unit by which the active bound is moved outwards.
    tightening_price
        Rise of the objective per unit by which the active bound is moved inwards; None if equal to `shadow_price`.
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

    def without_price(self) -> DecisionValue:
        """Return the value with an unknown shadow price if a bound is active."""
        return replace(self, shadow_price=math.nan if self.at_bound else 0.0, tightening_price=None)

    @property
    def is_zero(self) -> bool:
        """True if the value is zero up to rounding, relative to its bounds."""
        return abs(self.value) <= ZERO_SHARE * max(abs(self.lower), abs(self.upper))


def relevant_decisions(decisions: Sequence[DecisionValue]) -> list[DecisionValue]:
    """Return the decisions without the angles of unbalances that are zero."""
    pairs = pairwise([None, *decisions])
    return [d for size, d in pairs if d is not None and not (d.name.endswith(".angle") and size and size.is_zero)]


@dataclass(frozen=True)
class DecisionRange:
    """Smallest and largest value of a decision among equally good designs [SI]."""

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
        Optimum under the limits on earlier objectives, with its certificate.
    initial, final
        Value at the initial design, and at the design of the last rank.
    limit
        Limit on this objective for later ranks; None for the last rank.
    price
        Fall of the last objective per unit by which the limit is relaxed.
    designs
        Range of every decision among the designs that are optimal for this and all earlier ranks.
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
        """Decisions with a range wider than the tolerance of the solver."""
        maximum = {entry.unit: max(abs(d.high) for d in self.designs if d.unit == entry.unit) for entry in self.designs}
        return tuple(entry for entry in self.designs if entry.high - entry.low > DISTINCT_SHARE * maximum[entry.unit])


@dataclass(frozen=True)
class LimitValue(_Priced):
    """Value of one limit at a design [SI].

    Attributes
    ----------
    shadow_price
        Fall of the objective per unit by which the limit is relaxed; NaN if unknown.
    error_estimate
        Upper bound of the relative error of the value from sampling.
    window
        Smallest and largest value allowed, if there are both; `limit` is the nearer one.
    tightening_price
        Rise of the objective per unit by which the limit is tightened; None if equal to `shadow_price`, infinite if no
        design remains.
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
    window: tuple[float, float] | None = None


@dataclass(frozen=True)
class AttainableLimit:
    """Closest value that a violated limit can attain while the other limits hold [SI].

    Attributes
    ----------
    side, limit
        "at most" or "at least", and the limit of the problem.
    value, decisions
        Value of the limited measure and decisions at the nearest design; NaN and empty if no design was found.
    bound
        Bound of the measure over all designs that meet the other limits; NaN if unknown.
    why, ended
        Reason why there is no design, and True if the time limit ended the search.
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
class NearestDesign:
    """Infeasible design with the smallest violation, described by the limit with the largest violation [SI].

    Attributes
    ----------
    value, violation
        Value of the limited measure, and relative violation of the limit.
    broken
        Names of all violated limits.
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
    """Objective of the final and of the initial design [SI]; infinite at an undamped resonance."""

    name: str
    value: float
    unit: str
    initial: float

    @classmethod
    def of(cls, problem: Problem, value: float, initial: float) -> ObjectiveValue:
        """Return the objective value of a design and of the initial design [SI]."""
        return cls(problem.objective_name, value, problem.objective_unit or "", initial)

    @classmethod
    def of_initial(cls, problem: Problem, design: Evaluation) -> ObjectiveValue | None:
        """Return the objective value of the initial design; None without an objective."""
        value = objective_value(problem, design)
        return cls.of(problem, value, value) if problem.objective else None

    @property
    def reduction(self) -> float:
        """Relative reduction of the initial value; NaN if that is infinite."""
        if math.isinf(self.initial):
            return math.nan
        return 1.0 - self.value / self.initial if self.initial else 0.0
