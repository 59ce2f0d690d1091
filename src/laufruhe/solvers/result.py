"""Result of a solve or an evaluation."""

from __future__ import annotations

import html
import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace
from enum import StrEnum
from functools import cached_property
from typing import TYPE_CHECKING, Any

from laufruhe.errors import LaufruheWarning, ModelError, wrong_call
from laufruhe.problem.curves import STEPS, forces_of, harmonics_of, modes_of, orders_of
from laufruhe.problem.error_bounds import regret_bound
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
    NearestDesign,
    ObjectiveValue,
    RankValue,
    relevant_decisions,
)
from laufruhe.units import quantity

if TYPE_CHECKING:
    import pandas as pd
    import pint
    import xarray as xr

INITIAL, FINAL = "initial", "final"
OLD_NAMES = {"as given": INITIAL, "as decided": FINAL}
"""Names of designs up to release 0.3, and the present ones."""


def present_name(name: str) -> str:
    """Return the present name of a design; warn about an old one."""
    if name in OLD_NAMES:
        warnings.warn(f"'{name}' is now '{OLD_NAMES[name]}'", LaufruheWarning, stacklevel=3)
    return OLD_NAMES.get(name, name)


class _Designs(dict[str, Evaluation]):
    def __missing__(self, name: str) -> Evaluation:
        if name not in OLD_NAMES:
            raise KeyError(name)
        return self[present_name(name)]


class Status(StrEnum):
    """Outcome of a solve."""

    OPTIMAL = "optimal"
    FEASIBLE = "feasible"
    INFEASIBLE = "infeasible"
    FAILED = "failed"

    @property
    def has_design(self) -> bool:
        """True if the result has a design that meets all limits."""
        return self in (Status.OPTIMAL, Status.FEASIBLE)


class ResultDetails:
    """Additional data of a result that an extension provides.

    Attributes
    ----------
    own_points
        Names of the operating points of the problem file; None for those of the problem.
    """

    own_points: Sequence[str] | None = None

    @property
    def measured(self) -> Evaluation | None:
        """Evaluation whose objective the result states; None for the evaluation of the final design."""
        return None

    @property
    def lines(self) -> Sequence[str]:
        """Lines of a printed result after those of the decisions."""
        return ()


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
    details: ResultDetails | None = None

    @property
    def name(self) -> str:
        """Name of the problem; for a file, its name without the extension."""
        raise NotImplementedError

    def __getitem__(self, name: str) -> float:
        """Return a decided number, the objective or a limited quantity by its name [SI]."""
        return self._named(name).value

    def quantity(self, name: str, unit: Any = "") -> pint.Quantity[float]:
        """Return a number by its name with its unit [pint], in `unit` if given."""
        entry = self._named(name)
        return quantity(entry.value, entry.unit, unit)

    def _named(self, name: str) -> DecisionValue | LimitValue | ObjectiveValue:
        objective = () if self.objective is None else (self.objective,)
        numbers: tuple[DecisionValue | LimitValue | ObjectiveValue, ...] = (*self.limits, *objective, *self.decisions)
        entries = {entry.name: entry for entry in numbers}
        if name not in entries:
            remedy = f"it has {', '.join(entries)}" if entries else "it has no numbers"
            raise wrong_call("name", name, "is no number of this result", remedy)
        return entries[name]

    def to_dataframe(self) -> pd.DataFrame:
        """Return the decisions as a table [SI], one row per decision [pandas]."""
        import pandas as pd

        names = [field.name for field in fields(DecisionValue)]
        rows = [[getattr(d, name) for name in names] for d in self.decisions]
        return pd.DataFrame(rows, columns=names).set_index("name")

    def __repr__(self) -> str:
        lines = [f"<{type(self).__name__} {self.name}: {self.status}"]
        if self.objective is not None:
            objective = self.objective
            initial = (
                f"{objective.initial:.6g} {objective.unit}".rstrip()
                if math.isfinite(objective.initial)
                else "on a resonance"
            )
            lines.append(f"  {objective.name} {f'{objective.value:.6g} {objective.unit}'.rstrip()} (initial {initial})")
        if self.certificate is not None:
            lines.append(f"  proof {self.certificate.kind}, gap {self.certificate.gap:.1e}")
        lines += [f"  {d.name} = {d.value:.6g} {d.unit}".rstrip() for d in relevant_decisions(self.decisions)]
        lines += [f"  {line}" for line in (self.details.lines if self.details is not None else ())]
        if self.message:
            lines.append(f"  {self.message}")
        return "\n".join(lines) + ">"

    def _repr_html_(self) -> str:
        lines = [html.escape(line.strip()) for line in repr(self).strip("<>").splitlines()]
        return f"<strong>{lines[0]}</strong><ul>" + "".join(f"<li>{line}</li>" for line in lines[1:]) + "</ul>"


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Result(ResultContent):
    """Design with its certificate and everything that a report shows.

    Attributes
    ----------
    problem
        Problem that was solved.
    status
        Outcome of the solve.
    objective, certificate, decisions, limits
        Numbers of the design; None or empty if there is no design.
    initial, final
        Evaluations of the initial and of the final design by the exact model.
    message
        Reason why there is no design, or a remark for the reader.
    conflict
        Names of limits that no design meets together.
    error
        Function that computes the relative error of the objective from sampling; `error_estimate` calls it once.
    timing
        Duration of each stage of the solve [s], by its name.
    phasing
        Ranking of crank stars and firing orders, if these were open.
    details
        Further data of the extension that solved the problem.
    ranks
        Results of all objectives, if there are several in lexicographic order.
    reached
        Without a design: value that each limit in conflict can attain while the others hold.
    nearest
        If the search failed: infeasible design with the smallest violation.
    free
        Ranges of decisions among equally good designs; None if they were not computed.
    """

    problem: Problem
    initial: Evaluation
    final: Evaluation
    error: Callable[[], float] = float
    timing: dict[str, float] = field(default_factory=dict)
    phasing: PhasingResult | None = None
    ranks: tuple[RankValue, ...] = ()
    reached: tuple[AttainableLimit, ...] = ()
    nearest: NearestDesign | None = None
    free: tuple[DecisionRange, ...] | None = None

    @property
    def name(self) -> str:
        """Name of the problem."""
        return self.problem.name

    @property
    def measured(self) -> Evaluation:
        """Evaluation whose objective the result states: that of `details`, or that of the final design."""
        measured = None if self.details is None else self.details.measured
        return self.final if measured is None else measured

    @cached_property
    def at_own_points(self) -> Result:
        """Result with loads at the operating points of the problem file, without those of `details`."""
        names = None if self.details is None else self.details.own_points
        if names is None:
            return self
        designs = {
            name: replace(design, loads=tuple(loads for loads in design.loads if loads.point.name in names))
            for name, design in self.designs.items()
        }
        problem = replace(self.problem, points=tuple(point for point in self.problem.points if point.name in names))
        return replace(self, problem=problem, initial=designs[INITIAL], final=designs.get(FINAL, designs[INITIAL]))

    @cached_property
    def error_estimate(self) -> float:
        """Relative error of the objective from sampling the cycle, computed at first use."""
        return self.error()

    @cached_property
    def regret_bound(self) -> float | None:
        """Largest relative excess of the exact objective of the design over the best one; None if unknown (F16)."""
        if self.objective is None or self.certificate is None or self.details is not None:
            return None
        return regret_bound(self.problem, self.final, self.certificate.lower_bound)

    @property
    def designs(self) -> dict[str, Evaluation]:
        """Evaluations of the initial and the final design by name; the initial one alone if nothing was decided."""
        final = {} if self.final is self.initial else {FINAL: self.final}
        return _Designs({INITIAL: self.initial, **final})

    def forces(self, steps: int = STEPS) -> xr.Dataset:
        """Return loads on block, mounts and bearings, and mount deflections, over the crank angle [xarray]."""
        return forces_of(self._with_loads, steps).dataset()

    def orders(self) -> xr.Dataset:
        """Return amplitudes of loads and mount deflections by order [xarray]."""
        return orders_of(self._with_loads).dataset()

    def harmonics(self) -> xr.Dataset:
        """Return the complex coefficients c of loads and mount displacements by order and direction [xarray].

        At crank angle phi the load is Re sum c e^{i h phi}. Absolute value and angle of c are the amplitude of order h
        and its phase (C8).
        """
        return harmonics_of(self._with_loads).dataset()

    def modes(self) -> xr.Dataset:
        """Return natural frequencies, loss factors, energy shares and shapes of a block on elastic mounts [xarray].

        Raises
        ------
        ModelError
            If the mounts are rigid.
        """
        return modes_of(self.designs).dataset()

    @property
    def unbalances(self) -> dict[str, complex]:
        """Unbalances of the final design at crank angle 0, by the names of weights [kg m] (C4)."""
        return {rotor.name: complex(rotor.unbalance) for rotor in self.final.engine.rotors}

    @property
    def _with_loads(self) -> dict[str, Evaluation]:
        # a design at an undamped resonance has no finite loads
        designs = {name: design for name, design in self.designs.items() if not design.resonance}
        if not designs:
            raise ModelError(f"there are no finite loads: {self.final.resonance}; add damping")
        return designs

    @property
    def prices(self) -> dict[Side, Price]:
        """Shadow prices by limit and active side."""
        pairs = zip(self.problem.limits, self.limits, strict=True)
        return {(limit, value.side): value.price for limit, value in pairs}
