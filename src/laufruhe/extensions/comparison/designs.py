"""Designs to compare: problem files, which are solved, and saved results, whose problems are evaluated again."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from laufruhe.cli.screen import Watched, exit_statuses
from laufruhe.cli.solve import solve
from laufruhe.errors import InputError, ModelError, refused
from laufruhe.files.reader import display_path, load, load_tables, tables_and_path
from laufruhe.machine import Engine
from laufruhe.problem.channels import Channel
from laufruhe.problem.problem import Problem
from laufruhe.report.files import RESULT
from laufruhe.report.json_result import as_json
from laufruhe.report.saved_result import SavedResult, read_result
from laufruhe.solvers import evaluate_only
from laufruhe.solvers.result import Status

SAME = 1e-6
"""Relative difference of an objective up to which a saved design counts as reproduced."""


@dataclass(frozen=True, eq=False)
class Design:
    """A design of the comparison.

    Attributes
    ----------
    name
        Head of its column.
    record
        Content of its result.json [SI].
    tables
        Tables of its problem file; empty if the result names none.
    problem, engine
        Problem, and engine of the design, with which objectives are evaluated; None if they are not known.
    note
        Reason why the engine is not known.
    """

    name: str
    record: Mapping[str, Any]
    tables: Mapping[str, Any]
    problem: Problem | None = None
    engine: Engine | None = None
    note: str = ""

    @property
    def has_design(self) -> bool:
        """True if the result has a design that meets all limits."""
        return Status(self.record["status"]).has_design

    @property
    def samples(self) -> int:
        """Number of samples over the cycle of its objective."""
        return int(self.record["fidelity"]["measured_at"])

    def has_objective_of(self, other: Design) -> bool:
        """Return True if the problem of another design has the same objective, operating points and fidelity."""
        one, two = self.problem, other.problem
        if one is None or two is None or not all(extra.evaluates for extra in one.extras):
            return False
        names = ("objective", "points", "fidelity", "extras")
        return all(getattr(one, name) == getattr(two, name) for name in names)

    def value_for(self, other: Design) -> float | None:
        """Return the objective of another design's problem for this design; None if it has no such value.

        The machine is the same if its cylinders, and the places of these loads, have the same names.
        """
        if not (self.has_design and other.record["objective"]):
            return None
        if other is self:
            value = self.record["objective"]["value"]
            return None if value is None else float(value)
        if self.engine is None or other.problem is None:
            return None
        if not all(extra.evaluates for extra in other.problem.extras):
            return None
        channels = [term.measure.channel for term in other.problem.objective]
        if not all(channel.needs.of(self.engine) for channel in channels):
            return None
        if _places(self.engine, channels) != _places(other.problem.engine, channels):
            return None
        with suppress(ModelError):
            value = _value(replace(other.problem, engine=self.engine), other.samples)
            return value if math.isfinite(value) else None
        return None


def designs_of(paths: Sequence[Path], say: Callable[[str], None]) -> list[Design]:
    """Return the designs of problem files and results; `say` reports the progress of searches."""
    if len(paths) < 2:
        raise refused("compare", str(paths[0]), "is a single design", "name two or more problem files or results")
    return [_design(path, name, say) for path, name in zip(paths, _columns(paths), strict=True)]


def _design(path: Path, name: str, say: Callable[[str], None]) -> Design:
    with exit_statuses(path):
        if path.is_dir() or path.suffix == ".json":
            return _saved(read_result(path), path, name)
        problem = load(path)
        result = solve(problem, Watched(lambda text: say(f"{name}: {text}"), problem.objective_unit or ""))
        tables = {} if problem.origin is None else problem.origin.tables
        return Design(name, json.loads(as_json(result)), tables, problem, result.final.engine)


def _saved(result: SavedResult, path: Path, name: str) -> Design:
    text = result.record.get("problem_file")
    if not text:
        return Design(name, result.record, {}, note="its result.json has no problem file")
    tables, _ = tables_and_path(text)
    design = Design(name, result.record, tables)
    try:
        problem = load_tables(tables, path / result.problem if path.is_dir() else path.with_name(result.problem))
        with_values = problem.with_values(result.values)
        if with_values.phasing is not None:
            return replace(design, note="its firing order was open; give the problem file")
        if result.objective is not None:
            value = _value(with_values, design.samples)
            if math.isclose(value, result.objective.value, rel_tol=SAME):
                return replace(design, problem=problem, engine=with_values.engine)
    except (InputError, ModelError) as error:
        return replace(design, note=str(error).partition(": ")[2])
    return replace(design, note="its problem file and decisions do not reproduce the objective")


def _value(problem: Problem, samples: int) -> float:
    objective = evaluate_only(problem, samples=samples).objective
    return math.nan if objective is None else objective.value


def _places(engine: Engine, channels: Sequence[Channel]) -> list[list[str]]:
    return [[part.name for part in engine.slider_cranks], *(list(channel.places(engine)) for channel in channels)]


def _stem(place: Path) -> str:
    return place.name if place.is_dir() else place.stem


def _columns(paths: Sequence[Path]) -> list[str]:
    """Return short names of paths, made unique by their folders, or by numbers for a path that is named twice."""
    parts = []
    for path in paths:
        place = display_path(path).resolve()
        parts.append(place.parent.parts if place.name == RESULT else (*place.parent.parts, _stem(place)))
    names = [tail[-1] for tail in parts]
    for depth in range(2, max(map(len, parts)) + 1):
        twice = [name for name, count in Counter(dict(zip(parts, names, strict=True)).values()).items() if count > 1]
        names = ["/".join(tail[-depth:]) if name in twice else name for name, tail in zip(names, parts, strict=True)]
    return [f"{name} ({names[:k].count(name) + 1})" if name in names[:k] else name for k, name in enumerate(names)]
