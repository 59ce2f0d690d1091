"""Details of results: two designs under tolerance with the price of each, and parts that were chosen."""

from __future__ import annotations

from dataclasses import dataclass

from laufruhe.extensions.robust.tolerance import Population
from laufruhe.problem.evaluation import Evaluation
from laufruhe.solvers.result import Details

SHARE = 0.95
"""Of built engines whose value every comparison shows, where no other share is asked for."""
SHARES = tuple(k / 200.0 for k in range(201))
"""Of which quantiles are kept for pictures."""
CONFIDENCE = 0.99


@dataclass(frozen=True)
class BuiltDesign:
    """Design and the engines built to it [SI].

    Attributes
    ----------
    name
        Which of the two.
    decisions
        Names and values.
    drawing
        The engine without any error.
    worst
        What no engine within the tolerances exceeds; of drawn ones the largest.
    share, low, high
        What the share of engines asked for stays below, and its interval of confidence.
    quantiles
        Of random engines, at SHARES.
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
    """Tolerance, and by how much the objective falls for each unit by which it is narrowed.

    Attributes
    ----------
    price
        Per SI unit.
    saving
        Price times tolerance: what it costs, in the first order.
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
class RobustResult(Details):
    """Two designs under the same tolerances, and which tolerance to narrow first.

    Attributes
    ----------
    over
        Of which engines the objective was taken.
    exact
        Whether the worst of all engines within the tolerances is bounded; else of those drawn.
    share
        Of engines, that `BuiltDesign.share` is of.
    nominal, robust
        The best drawing, and the design decided.
    tolerances
        The dearest first.
    scenarios
        Sets of errors in the program.
    divisions
        Parts of the errors that the bound looked at.
    engines, seed
        Drawn for the comparison, other ones than those that decided.
    worst_engine
        The exact model's evaluation of the worst engine found of the design decided.
    exceeding, exceeding_at_most
        How many of them exceed the objective, and the share of all that does, at most, with CONFIDENCE.
    """

    over: Population
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
        """Evaluation that the objective is of."""
        return self.worst_engine


@dataclass(frozen=True)
class Place:
    """Parts of a cylinder.

    Attributes
    ----------
    parts
        Of every lot the number of the part in the order of its file, from one.
    masses
        Of each what goes to and fro, and what turns with the pin [kg].
    """

    cylinder: str
    parts: tuple[int, ...]
    masses: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class AssemblyResult(Details):
    """The best assembly beside others [SI].

    Attributes
    ----------
    kinds
        Of the lots.
    assemblies
        That there are in all.
    looked_at
        Parts of them that were bounded.
    quantiles
        Of assemblies at random.
    worst
        Of these.
    mean_parts
        The objective if every part had the mean mass of its lot.
    """

    kinds: tuple[str, ...]
    places: tuple[Place, ...]
    assemblies: float
    looked_at: int
    quantiles: tuple[float, ...]
    worst: float
    mean_parts: float
    random: int
