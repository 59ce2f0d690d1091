"""What a solved or evaluated problem returns."""

from __future__ import annotations

import html
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields
from enum import StrEnum
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

from laufruhe.errors import ModelError
from laufruhe.problem.curves import STEPS, forces_of, modes_of, orders_of
from laufruhe.problem.evaluation import Evaluation, objective_value
from laufruhe.problem.measure import Side
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Certificate, Proof
from laufruhe.solvers.stars.ranking import PhasingResult
from laufruhe.solvers.tolerances.assembly_result import AssemblyResult
from laufruhe.solvers.tolerances.result import RobustResult

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

AS_GIVEN, AS_DECIDED = "as given", "as decided"
NEXT_TO_NOTHING = 1e-5
APART = 0.05
"""Share of the largest decision by which two designs differ."""


class Status(StrEnum):
    """How a solve ended."""

    OPTIMAL = "optimal"
    FEASIBLE = "feasible"
    INFEASIBLE = "infeasible"
    FAILED = "failed"

    @property
    def has_design(self) -> bool:
        """Whether there is a design within its limits."""
        return self in (Status.OPTIMAL, Status.FEASIBLE)


@dataclass(frozen=True)
class DecisionValue:
    """One open number and what was decided of it [SI].

    Attributes
    ----------
    shadow_price
        Fall of the objective per unit by which the bound it stands at is moved.
    """

    name: str
    value: float
    unit: str
    lower: float
    upper: float
    initial: float
    at_bound: bool
    shadow_price: float = 0.0

    @property
    def is_nothing(self) -> bool:
        """Whether its size is a rounding of what it may be."""
        return abs(self.value) <= NEXT_TO_NOTHING * max(abs(self.lower), abs(self.upper))


def meaningful(decisions: Sequence[DecisionValue]) -> list[DecisionValue]:
    """Without angles of sizes that are none."""
    pairs = pairwise([None, *decisions])
    return [d for size, d in pairs if d is not None and not (d.name.endswith(".angle") and size and size.is_nothing)]


@dataclass(frozen=True)
class DecisionRange:
    """Least and largest value of a decision among designs that an objective does not tell apart [SI]."""

    name: str
    unit: str
    low: float
    high: float


@dataclass(frozen=True)
class RankValue:
    """One of several objectives in order [SI].

    Attributes
    ----------
    least, lower_bound, gap, proof
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
    least: float
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
        most = {found.unit: max(abs(d.high) for d in self.designs if d.unit == found.unit) for found in self.designs}
        return tuple(found for found in self.designs if found.high - found.low > APART * most[found.unit])


@dataclass(frozen=True)
class LimitValue:
    """One limit and how the design stands to it [SI].

    Attributes
    ----------
    shadow_price
        Fall of the objective per unit by which the limit is relaxed; not a number where that is not known.
    side
        "at most" or "at least".
    error_estimate
        What samples over the cycle may have missed of the value, relative, not exceeded.
    """

    name: str
    value: float
    limit: float
    unit: str
    active: bool
    shadow_price: float
    side: str = "at most"
    error_estimate: float = 0.0


@dataclass(frozen=True)
class Reached:
    """What a limit that no design keeps could be met by while the other limits hold [SI].

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
    value, excess
        Of the measure that is limited, and the share by which it is beyond the limit.
    broken
        Names of all limits that it breaks.
    """

    name: str
    side: str
    limit: float
    unit: str
    value: float
    excess: float
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
        """What a problem minimises, of a design and of the one given [SI]."""
        return cls(problem.objective_name, value, problem.objective_unit or "", initial)

    @classmethod
    def given(cls, problem: Problem, design: Evaluation) -> ObjectiveValue | None:
        """Of a design that is the one given; None where nothing is minimised."""
        value = objective_value(problem, design)
        return cls.of(problem, value, value) if problem.objective else None

    @property
    def reduction(self) -> float:
        """Share by which the initial value fell; not a number where that is infinite."""
        if math.isinf(self.initial):
            return math.nan
        return 1.0 - self.value / self.initial if self.initial else 0.0


@dataclass(frozen=True, eq=False)
class Result:
    """A design, what was proven of it, and everything a report shows.

    Attributes
    ----------
    problem
        As it was given.
    status
        How the solve ended.
    objective, certificate, decisions, limits
        Of the design; None or empty where there is none.
    initial, final
        The exact model's evaluation of the design as given and as decided.
    message
        Why there is no design, or what the reader should know.
    conflict
        Names of limits that no design meets together.
    error
        What tells the relative error of the objective from sampling the cycle; `error_estimate` asks it once.
    timing
        Seconds by what they were spent on.
    phasing
        Ranking of stars and firing orders, where these were open.
    robust
        Designs under tolerance, where built engines were decided for.
    assembly
        Which part goes where, where parts were chosen.
    ranks
        Of several objectives in order, where there are.
    reached
        Without a design: what each of the limits that conflict can reach while the others hold.
    nearest
        Where no design was found, and none is proven not to exist: the one that breaks limits least.
    free
        Ranges of decisions that the optimum leaves free, as far as designs were found; None where not looked at.
    """

    problem: Problem
    status: Status
    objective: ObjectiveValue | None
    certificate: Certificate | None
    decisions: tuple[DecisionValue, ...]
    limits: tuple[LimitValue, ...]
    initial: Evaluation
    final: Evaluation
    message: str = ""
    conflict: tuple[str, ...] = ()
    error: Callable[[], float] = float
    timing: dict[str, float] = field(default_factory=dict)
    phasing: PhasingResult | None = None
    robust: RobustResult | None = None
    assembly: AssemblyResult | None = None
    ranks: tuple[RankValue, ...] = ()
    reached: tuple[Reached, ...] = ()
    nearest: Nearest | None = None
    free: tuple[DecisionRange, ...] | None = None

    @cached_property
    def error_estimate(self) -> float:
        """Relative error of the objective from sampling the cycle; studies keep none, and do not wait for it."""
        return self.error()

    @property
    def designs(self) -> dict[str, Evaluation]:
        """As given and as decided, by these names; one where nothing was decided."""
        given = {AS_GIVEN: self.initial}
        return given if self.final is self.initial else given | {AS_DECIDED: self.final}

    def forces(self, steps: int = STEPS) -> xr.Dataset:
        """Loads on block, mounts and bearings over the crank angle, and how far mounts move, with units [xarray]."""
        return forces_of(self._with_loads, steps).dataset()

    def orders(self) -> xr.Dataset:
        """Amplitudes by order of the same loads, with units [xarray]."""
        return orders_of(self._with_loads).dataset()

    def modes(self) -> xr.Dataset:
        """Natural frequencies, loss and energy of a block on elastic mounts [xarray]; `ModelError` on rigid ones."""
        return modes_of(self.designs).dataset()

    def to_dataframe(self) -> pd.DataFrame:
        """What was decided: a row a decision, in SI [pandas]."""
        import pandas as pd

        names = [field.name for field in fields(DecisionValue)]
        rows = [[getattr(d, name) for name in names] for d in self.decisions]
        return pd.DataFrame(rows, columns=names).set_index("name")

    @property
    def _with_loads(self) -> dict[str, Evaluation]:
        """Designs that have loads: one on an undamped resonance has none."""
        found = {name: design for name, design in self.designs.items() if not design.resonance}
        if not found:
            raise ModelError(f"there are no finite loads: {self.final.resonance}; add damping")
        return found

    @property
    def prices(self) -> dict[Side, float]:
        """Shadow prices of the limits, at the sides that the design stands at."""
        pairs = zip(self.problem.limits, self.limits, strict=True)
        return {(limit, shown.side): shown.shadow_price for limit, shown in pairs}

    def __repr__(self) -> str:
        lines = [f"<Result {self.problem.name}: {self.status}"]
        if self.objective is not None:
            o = self.objective
            given = f"{o.initial:.6g} {o.unit}" if math.isfinite(o.initial) else "on a resonance"
            lines.append(f"  {o.name} {o.value:.6g} {o.unit} (as given {given})")
        if self.certificate is not None:
            lines.append(f"  proof {self.certificate.kind}, gap {self.certificate.gap:.1e}")
        lines += [f"  {d.name} = {d.value:.6g} {d.unit}".rstrip() for d in meaningful(self.decisions)]
        if self.message:
            lines.append(f"  {self.message}")
        return "\n".join(lines) + ">"

    def _repr_html_(self) -> str:
        lines = [html.escape(line.strip()) for line in repr(self).strip("<>").splitlines()]
        return f"<strong>{lines[0]}</strong><ul>" + "".join(f"<li>{line}</li>" for line in lines[1:]) + "</ul>"
