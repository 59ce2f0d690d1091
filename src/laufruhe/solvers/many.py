"""Evaluate many designs of one problem by the exact model, and tabulate their measures.

Designs that differ in numbers in which all loads are affine share one model (F12). Other designs are evaluated one by
one, by several processes if wanted.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from functools import partial
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from laufruhe import units
from laufruhe.errors import ModelError, wrong_call
from laufruhe.load_models.batch import prepare
from laufruhe.numerics.arrays import Array, ComplexArray, Indices, Mask
from laufruhe.numerics.workers import executor_for, unordered_map
from laufruhe.problem.curves import labelled
from laufruhe.problem.decision import Decision
from laufruhe.problem.dependence import is_affine
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.solvers.conclusion import FEASIBILITY_TOL

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

_FEWEST, _PIECE = 8, 50
"""Fewest designs for which one affine model pays, and number of designs in one piece of work of a process."""
_INSIDE = 1e-9
_Answer: TypeAlias = tuple[list[float] | float, str]


def evaluate_many(problem: Problem, designs: Any, jobs: int = 1) -> pd.DataFrame | xr.Dataset:
    """Return objective, terms and limits of designs [SI], a row for each (`laufruhe.evaluate_many`)."""
    # a dataset exists only where xarray is imported
    if "xarray" not in sys.modules or not isinstance(designs, sys.modules["xarray"].Dataset):
        return _table(problem, designs, jobs)
    if not designs.sizes:
        raise wrong_call(
            "designs", dict(designs), "has no dimension", "give each number along a dimension, such as design"
        )
    table = _table(problem, designs.to_dataframe()[list(designs.data_vars)], jobs)
    data = table.to_xarray().transpose(*designs.sizes).assign_coords(designs.coords)
    for name, unit in table.attrs["units"].items():
        data[name].attrs["units"] = unit or "1"
    return labelled(data)


def _table(problem: Problem, designs: Any, jobs: int) -> pd.DataFrame:
    import pandas as pd

    problem = problem.drawing
    if problem.phasing is not None:
        names = ", ".join(problem.phasing.open_names)
        raise ModelError(f"designs that are evaluated together have one crank and one firing order; fix {names}")
    columns, index = columns_of(problem, designs)
    values, inside = values_of_columns(problem.decisions, columns, len(index))
    numbers, messages = _measured(problem, values, jobs)
    named = [(term.measure.name, term.measure) for term in problem.objective]
    named += [(limit.name, limit.measure) for limit in problem.limits]
    terms, slack = numbers[:, : len(problem.objective)], numbers[:, len(named) :]
    table = {**columns, "objective": terms @ np.array([term.weight for term in problem.objective])}
    attributes = {name: unit for name, unit in _units(problem).items() if name in columns}
    attributes["objective"] = problem.objective_unit or ""
    measures: dict[str, Measure] = {}
    for (name, measure), column in zip(named, numbers.T, strict=False):
        heading = name if measures.get(name, measure) == measure else f"{name} (limit)"
        measures[heading], table[heading], attributes[heading] = measure, column, measure.unit
    is_evaluated = np.array([not message for message in messages], dtype=bool)
    frame = pd.DataFrame(table, index=index)
    frame["feasible"] = np.all(inside, axis=1) & is_evaluated & np.all(slack >= -FEASIBILITY_TOL, axis=1)
    frame["message"] = messages
    frame.attrs["units"] = attributes
    return frame


def _units(problem: Problem) -> dict[str, str]:
    # SI units of the open numbers, the angle of a size included
    named: dict[str, str] = {}
    for decision in problem.decisions:
        named[decision.name] = decision.unit
        if decision.set.width > 1:
            named[decision.angle_name] = "rad"
    return named


def columns_of(problem: Problem, designs: Any) -> tuple[dict[str, Array], Any]:
    """Return the numbers of designs by name [SI], and the index of their table."""
    import pandas as pd

    if isinstance(designs, Sequence) and not isinstance(designs, str) and all(isinstance(d, Mapping) for d in designs):
        designs = pd.DataFrame([dict(design) for design in designs])
    elif isinstance(designs, Mapping):
        try:
            designs = pd.DataFrame({name: np.atleast_1d(np.asarray(column)) for name, column in designs.items()})
        except ValueError as error:
            rule = f"does not have one number of each name for every design ({error})"
            raise wrong_call("designs", list(designs), rule, "give arrays of one length") from None
    if not isinstance(designs, pd.DataFrame):
        remedy = "give a mapping of names to arrays, a list of mappings, or a pandas DataFrame"
        raise wrong_call("designs", designs, f"is of type {type(designs).__name__}", remedy)
    unit_of = _units(problem)
    for name in designs.columns:
        if name not in unit_of:
            remedy = f"open it first with problem.open; open are {', '.join(unit_of) or 'no numbers'}"
            raise wrong_call("designs", name, "is no open number of this problem", remedy)
    return {name: _numbers(str(name), designs[name].tolist(), unit_of[name]) for name in designs.columns}, designs.index


def _numbers(name: str, column: Sequence[Any], unit: str) -> Array:
    numbers = np.empty(len(column))
    for k, number in enumerate(column):
        try:
            numbers[k] = units.parse(number, unit) if isinstance(number, str) else number
        except units.UnitError as error:
            rule, _, remedy = str(error).partition("; ")
            raise wrong_call(f"designs, {name}", number, f"of design {k} {rule}", remedy) from None
        except (TypeError, ValueError):
            raise wrong_call(f"designs, {name}", number, f"of design {k} is no number", units.advice(unit)) from None
        if math.isinf(numbers[k]):
            raise wrong_call(f"designs, {name}", number, f"of design {k} is not finite", "give a finite number")
    return numbers


def values_of_columns(
    decisions: Sequence[Decision], columns: Mapping[str, Array], count: int
) -> tuple[ComplexArray, Mask]:
    """Return the values of decisions, shape (designs, decisions), and the mask of those within their bounds.

    A number that is missing has its start value; NaN in `columns` is replaced by it.
    """
    values, inside = np.empty((count, len(decisions)), dtype=complex), np.ones((count, len(decisions)), dtype=bool)
    for k, decision in enumerate(decisions):
        size, angle = (np.full(count, start) for start in decision.set.split(decision.start))
        for part, name in ((size, decision.name), (angle, decision.angle_name)):
            if name in columns:
                missing = np.isnan(columns[name])
                columns[name][missing] = part[missing]
                part[:] = columns[name]
        edge = _INSIDE * decision.set.scale
        inside[:, k] = (size >= decision.lower - edge) & (size <= decision.upper + edge)
        if decision.set.width > 1 and not decision.set.free_angle:
            low, high = decision.set.angles
            inside[:, k] &= np.mod(angle - low + _INSIDE, math.tau) <= high - low + 2.0 * _INSIDE
        values[:, k] = size * np.exp(1j * angle) if decision.set.angles != (0.0, 0.0) else size
    return values, inside


def _measured(problem: Problem, values: ComplexArray, jobs: int) -> tuple[Array, list[str]]:
    """Return terms, limits and slacks of designs side by side, and why a design has none, from values of decisions."""
    numbers, messages = (
        np.full((len(values), len(problem.objective) + 2 * len(problem.limits)), math.nan),
        [""] * len(values),
    )
    # decisions in which every measure is affine or constant
    kinds = {decision.kind for decision in problem.unbalances}
    affine = problem.fidelity.mounts != "time" and all(is_affine(m.channel, kinds, problem) for m in problem.measures)
    shared = problem.unbalances if affine else ()
    others = [k for k, decision in enumerate(problem.decisions) if decision not in shared]
    alone: list[int] = []
    for rows in _equal_rows(values[:, others]) if shared else [np.arange(len(values))]:
        if not shared or len(rows) < _FEWEST or not _fill(numbers, rows, problem, others, values, jobs):
            alone += rows.tolist()
    pieces = [alone[k : k + _PIECE] for k in range(0, len(alone), _PIECE)]
    for piece, answers in _answers(problem, values, pieces, jobs):
        for row, (row_numbers, message) in zip(pieces[piece], answers, strict=True):
            numbers[row], messages[row] = row_numbers, message
    return numbers, messages


def _answers(
    problem: Problem, values: ComplexArray, pieces: Sequence[list[int]], jobs: int
) -> Iterator[tuple[int, list[_Answer]]]:
    """Yield the index of each piece, and the numbers and messages of its designs, evaluated one by one."""
    work, parts = partial(_one_by_one, problem), [values[piece] for piece in pieces]
    if jobs == 1 or len(pieces) < 2:
        yield from enumerate(map(work, parts))
        return
    with (
        executor_for(min(jobs, len(pieces))) as executor,
        closing(unordered_map(work, parts, executor)) as answers,
    ):
        yield from answers


def _equal_rows(values: ComplexArray) -> list[Indices]:
    # indices of equal rows, an array for each
    if not values.shape[1]:
        return [np.arange(len(values))]
    _, group = np.unique(np.hstack([values.real, values.imag]), axis=0, return_inverse=True)
    order = np.argsort(group, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(group[order])) + 1)


def _fill(
    numbers: Array, rows: Indices, problem: Problem, others: Sequence[int], values: ComplexArray, threads: int
) -> bool:
    """Fill in the numbers of designs that differ in shared decisions only, by one model; False if there is none."""
    fixed = [problem.decisions[k] for k in others]
    try:
        designs = prepare(problem.fixed_at(numbers_of(fixed, values[rows[0], others]), fixed))
    except ModelError:
        # evaluations one by one name the reason
        return False
    features = designs.features(np.delete(values[rows], others, axis=1))
    terms = [designs.values(term.measure, features, threads, designs.tolerance) for term in problem.objective]
    limits = [designs.values(limit.measure, features, threads) for limit in problem.limits]
    slack = [designs.slack(limit, column) for limit, column in zip(problem.limits, limits, strict=True)]
    numbers[rows] = np.stack([*terms, *limits, *slack], axis=1)
    return True


def _one_by_one(problem: Problem, values: ComplexArray) -> list[_Answer]:
    answers: list[_Answer] = []
    for row in values:
        try:
            evaluation = evaluate(problem.fixed_at(numbers_of(problem.decisions, row)))
            checks = [evaluation.check_limit(limit) for limit in problem.limits]
            terms = [evaluation.value(term.measure) for term in problem.objective]
        except ModelError as error:
            answers.append((math.nan, str(error)))
        else:
            row_numbers = [*terms, *(check.value for check in checks), *(-check.violation for check in checks)]
            answers.append((row_numbers, ""))
    return answers


def numbers_of(decisions: Sequence[Decision], values: ComplexArray) -> list[Value]:
    """Return the values of decisions from complex numbers, shape (decisions,); affine ones stay complex."""
    return [
        complex(value) if decision.is_affine else float(value.real)
        for decision, value in zip(decisions, values, strict=True)
    ]
