"""Details of results: two designs under tolerance with the price of each tolerance, or chosen parts."""

from __future__ import annotations

from dataclasses import dataclass

from laufruhe.extensions.robust.tolerance import Population
from laufruhe.problem.evaluation import Evaluation
from laufruhe.solvers.result import ResultDetails

SHARE = 0.95
"""Share of built engines in comparisons, unless the problem sets one."""
SHARES = tuple(k / 200.0 for k in range(201))
"""Shares of engines at which pictures show quantiles."""
CONFIDENCE = 0.99
"""Confidence of intervals and bounds of shares."""


@dataclass(frozen=True)
class BuiltDesign:
    """Objective of a design and of the engines built to it [SI].

    Attributes
    ----------
    decisions
        Name, value and unit of each decision.
    drawing
        Objective of the engine without errors.
    worst
        Upper bound over all engines within the tolerances, or maximum of the random engines.
    share, low, high
        Objective that the required share of engines does not exceed, and its confidence interval.
    quantiles
        Quantiles of random engines at SHARES.
    """

    name: str
    decisions: tuple[tuple[str, float, str], ...]
    drawing: float
    worst: float
    share: float
    low: float
    high: float
    quantiles: tuple[float, ...]


@dataclass(frozen=True)
class PricedTolerance:
    """Tolerance with its shadow price.

    Attributes
    ----------
    size, unit
        Largest error [SI].
    errors
        Count of independent errors.
    price
        Fall of the objective per SI unit by which the tolerance is narrowed.
    saving
        Price times tolerance: estimate of its cost.
    """

    name: str
    size: float
    unit: str
    law: str
    scope: str
    errors: int
    price: float
    saving: float


@dataclass(frozen=True)
class RobustResult(ResultDetails):
    """Two designs under the same tolerances, and the price of each tolerance.

    Attributes
    ----------
    population
        Engines over which the objective is taken.
    exact
        True if `worst` is a bound over all engines within the tolerances, False for a maximum of random engines.
    share
        Share of engines for `BuiltDesign.share`.
    nominal, robust
        Optimum without errors, and design for built engines.
    scenarios
        Count of error sets in the program.
    divisions
        Count of nodes of the bound.
    engines, seed
        Count and seed of the random engines of the comparison, independent of those of the search.
    worst_engine
        Exact evaluation of the worst engine found of the robust design.
    exceeding, exceeding_at_most
        Count of random engines above the objective, and upper bound of their share with CONFIDENCE.
    """

    population: Population
    exact: bool
    share: float
    nominal: BuiltDesign
    robust: BuiltDesign
    tolerances: tuple[PricedTolerance, ...]
    scenarios: int
    divisions: int
    engines: int
    seed: int
    worst_engine: Evaluation
    exceeding: int
    exceeding_at_most: float

    @property
    def measured(self) -> Evaluation:
        """Evaluation with the value of the objective."""
        return self.worst_engine


@dataclass(frozen=True)
class Place:
    """Piston and rod (measured parts) that one cylinder takes in an assembly.

    Attributes
    ----------
    parts
        For each lot, the row of the part in its file, from 1.
    masses
        Reciprocating and rotating mass of each part [kg].
    """

    cylinder: str
    parts: tuple[int, ...]
    masses: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class AssemblyResult(ResultDetails):
    """Best assembly, compared with random ones [SI].

    Attributes
    ----------
    kinds
        Kind of each lot: piston or rod.
    assemblies, random
        Counts of all assemblies, and of random ones.
    looked_at
        Count of nodes of branch and bound.
    quantiles, worst
        Quantiles at SHARES and maximum of the objectives of random assemblies.
    mean_parts
        Objective with parts of mean mass.
    """

    kinds: tuple[str, ...]
    places: tuple[Place, ...]
    assemblies: float
    looked_at: int
    quantiles: tuple[float, ...]
    worst: float
    mean_parts: float
    random: int
