"""What a solved or evaluated problem returns."""

from __future__ import annotations

import html
import math
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from enum import StrEnum
from functools import cached_property
from typing import TYPE_CHECKING

from laufruhe.errors import ModelError
from laufruhe.problem.curves import STEPS, forces_of, modes_of, orders_of
from laufruhe.problem.evaluation import Evaluation
from laufruhe.problem.measure import Side
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Certificate
from laufruhe.solvers.prices import Price
from laufruhe.solvers.stars.ranking import PhasingResult
from laufruhe.solvers.values import (
    AttainableLimit,
    DecisionRange,
    DecisionValue,
    LimitValue,
    Nearest,
    ObjectiveValue,
    RankValue,
    meaningful,
)

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

AS_GIVEN, AS_DECIDED = "as given", "as decided"


class Status(StrEnum):
    """Outcome of a solve."""

    OPTIMAL = "optimal"
    FEASIBLE = "feasible"
    INFEASIBLE = "infeasible"
    FAILED = "failed"

    @property
    def has_design(self) -> bool:
        """Tell if the result has a design within its limits."""
        return self in (Status.OPTIMAL, Status.FEASIBLE)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ResultContent:
    """Content of a result, solved now or read from a file; the fields are named as in `Result`."""

    status: Status
    objective: ObjectiveValue | None = None
    certificate: Certificate | None = None
    decisions: tuple[DecisionValue, ...] = ()
    limits: tuple[LimitValue, ...] = ()
    message: str = ""
    conflict: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Name of the problem; for a file, its name without the extension."""
        raise NotImplementedError

    def to_dataframe(self) -> pd.DataFrame:
        """Return the decisions as a table [SI], one row per decision [pandas]."""
        import pandas as pd

        names = [field.name for field in fields(DecisionValue)]
        rows = [[getattr(d, name) for name in names] for d in self.decisions]
        return pd.DataFrame(rows, columns=names).set_index("name")

    def __repr__(self) -> str:
        lines = [f"<{type(self).__name__} {self.name}: {self.status}"]
        if self.objective is not None:
            o = self.objective
            given = f"{o.initial:.6g} {o.unit}".rstrip() if math.isfinite(o.initial) else "on a resonance"
            lines.append(f"  {o.name} {f'{o.value:.6g} {o.unit}'.rstrip()} (as given {given})")
        if self.certificate is not None:
            lines.append(f"  proof {self.certificate.kind}, gap {self.certificate.gap:.1e}")
        lines += [f"  {d.name} = {d.value:.6g} {d.unit}".rstrip() for d in meaningful(self.decisions)]
        if self.message:
            lines.append(f"  {self.message}")
        return "\n".join(lines) + ">"

    def _repr_html_(self) -> str:
        lines = [html.escape(line.strip()) for line in repr(self).strip("<>").splitlines()]
        return f"<strong>{lines[0]}</strong><ul>" + "".join(f"<li>{line}</li>" for line in lines[1:]) + "</ul>"


class Details:
    """Additional data of a result that an extension provides."""

    @property
    def measured(self) -> Evaluation | None:
        """Evaluation that the objective is of; None for that of the design."""
        return None


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Result(ResultContent):
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
    details
        What the extension that decided tells beside the design.
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
    initial: Evaluation
    final: Evaluation
    error: Callable[[], float] = float
    timing: dict[str, float] = field(default_factory=dict)
    phasing: PhasingResult | None = None
    details: Details | None = None
    ranks: tuple[RankValue, ...] = ()
    reached: tuple[AttainableLimit, ...] = ()
    nearest: Nearest | None = None
    free: tuple[DecisionRange, ...] | None = None

    @property
    def name(self) -> str:
        """Name of the problem."""
        return self.problem.name

    @property
    def measured(self) -> Evaluation:
        """Evaluation that the objective is of: the design, or what its details name."""
        other = None if self.details is None else self.details.measured
        return self.final if other is None else other

    @cached_property
    def error_estimate(self) -> float:
        """Relative error of the objective from sampling the cycle; studies keep none, and do not wait for it."""
        return self.error()

    @property
    def designs(self) -> dict[str, Evaluation]:
        """Evaluations of the initial and the decided design by name; the initial one alone if nothing was decided."""
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

    @property
    def _with_loads(self) -> dict[str, Evaluation]:
        # a design on an undamped resonance has no loads
        found = {name: design for name, design in self.designs.items() if not design.resonance}
        if not found:
            raise ModelError(f"there are no finite loads: {self.final.resonance}; add damping")
        return found

    @property
    def prices(self) -> dict[Side, Price]:
        """Shadow prices of the limits, at the sides that the design stands at."""
        pairs = zip(self.problem.limits, self.limits, strict=True)
        return {(limit, shown.side): shown.price for limit, shown in pairs}
