"""Study kind `random designs`: random designs of one problem, compared with the proven optimum."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from laufruhe.extensions.random_studies.draws import VALUES, Column
from laufruhe.extensions.random_studies.sampled import Sampled, in_unit, percentiles_of, share_below
from laufruhe.load_models.batch import Designs, prepare
from laufruhe.numerics.arrays import Array
from laufruhe.present import picture as p
from laufruhe.problem.problem import Problem
from laufruhe.solvers.conclusion import decision_values
from laufruhe.studies.part import Record, variable
from laufruhe.studies.scenes import Point, ProblemFiles
from laufruhe.studies.solved import solve_scene
from laufruhe.studies.text import Text, marked_table, number

if TYPE_CHECKING:
    import xarray as xr

WITHIN = "within_limits"
_PREPARED: dict[str, tuple[Problem, Designs, list[str]]] = {}


class RandomDesigns(Sampled):
    """Open unbalances drawn even between their bounds, each design evaluated by the exact model."""

    kind: Literal["random designs"]
    own_chunk: ClassVar[int] = 10_000

    def points(self, problem_files: ProblemFiles) -> list[Point]:
        """Return the points to compute, for every case: its proven optimum, and its random designs in batches."""
        for case in self.cases:
            with problem_files.blamed(Point(case), "decisions"):
                problem = problem_files.problem(Point(case))
                prepare(problem)
            if not problem.decisions:
                raise problem_files.refused(
                    case, "decisions", "are missing, so there is nothing to draw", "open an unbalance"
                )
            unweighed = [limit.name for limit in problem.limits if limit not in problem.load_limits]
            if unweighed:
                rule = f"has '{unweighed[0]}', which is no limit on loads or masses"
                raise problem_files.refused(case, "constraints", rule, "leave it out")
        self.check_objective(problem_files)
        return [Point(case, span=span) for case in self.cases for span in (None, *self.spans())]

    def columns(self, problem_files: ProblemFiles) -> dict[str, Column]:
        """Return the columns that store a random design: objective, limits and every open number."""
        columns: dict[str, Column] = {}
        for case in self.cases:
            problem = problem_files.problem(Point(case))
            columns["objective"] = Column(problem.objective_unit or "", problem.objective_name)
            columns[WITHIN] = Column("1", "1 where a design keeps all limits")
            entries = [entry for d in problem.unbalances for entry in decision_values(d, d.start)]
            columns |= {entry.name: Column(entry.unit, entry.name) for entry in entries}
        return columns

    def answer(self, point: Point, problem_files: ProblemFiles) -> Record:
        """Return the record of one point: the proven optimum, or the values of a batch of random designs."""
        if point.span is None:
            return solve_scene(problem_files.problem(point))
        problem, designs, names = self._prepared(point, problem_files)
        u = self.random(point.span, 2 * len(problem.unbalances))
        sizes, angles = u[:, ::2].copy(), u[:, 1::2].copy()
        for k, decision in enumerate(problem.unbalances):
            low, high = decision.set.angles
            sizes[:, k] = decision.lower + (decision.upper - decision.lower) * sizes[:, k]
            angles[:, k] = low + (high - low) * angles[:, k]
        values = sizes * np.exp(1j * angles)
        rows = np.full((len(u), len(names)), math.nan)
        rows[:, names.index("objective")] = designs.objective(values)
        rows[:, names.index(WITHIN)] = designs.are_feasible(values)
        for k, decision in enumerate(problem.unbalances):
            for entry, numbers in zip(decision_values(decision, decision.start), (sizes, angles), strict=False):
                rows[:, names.index(entry.name)] = numbers[:, k]
        return {VALUES: rows}

    def dataset(self, points: Sequence[Point], records: Sequence[Mapping[str, Any]]) -> xr.Dataset:
        """Return all random designs as a dataset, with the proven optimum of every case."""
        best = [records[k] for k, point in enumerate(points) if point.span is None]
        data = self.gathered(points, records)
        about = data["objective"].attrs
        for name, words in (("objective", "optimum"), ("lower_bound", "lower bound")):
            column = variable(
                "case", [record[name] for record in best], f"{about['long_name']}, {words}", about["units"]
            )
            data[words.replace(" ", "_")] = column
        return data.assign_coords(proof=("case", [record["proof"] for record in best]))

    def _prepared(self, point: Point, problem_files: ProblemFiles) -> tuple[Problem, Designs, list[str]]:
        mark = problem_files.fingerprint(Point(point.case), self.settings())
        if mark not in _PREPARED:
            _PREPARED.clear()
            problem = problem_files.problem(Point(point.case))
            _PREPARED[mark] = problem, prepare(problem), list(self.columns(problem_files))
        return _PREPARED[mark]

    @staticmethod
    def table(data: xr.Dataset) -> list[Text]:
        """Return a table that compares the random designs of every case with its proven optimum."""
        objective, unit = in_unit(data["objective"])
        best, bound = (in_unit(data[name].assign_attrs(units=data["objective"].attrs["units"]))[0]
                       for name in ("optimum", "lower_bound"))  # fmt: skip
        head = ["case", "designs", "within limits", f"best of these [{unit}]", "median", "95 % below"]
        head += [f"optimum [{unit}]", "lower bound", "proof", "designs below the bound"]
        rows = []
        for k, name in enumerate(data["case"].values):
            feasible = _feasible(data, objective, k)
            _, middle, maximum = percentiles_of(feasible)
            cells = [str(name), f"{objective.shape[1]:,}", f"{100.0 * len(feasible) / objective.shape[1]:.3g} %"]
            minimum = float(feasible.min()) if len(feasible) else math.nan
            cells += [number(value) for value in (minimum, middle, maximum, float(best[k]), float(bound[k]))]
            cells.append(str(data["proof"].values[k]))
            rows.append([*cells, str(int((feasible < bound[k] * (1.0 - 1e-9)).sum()))])
        return [marked_table(head, rows)]

    @staticmethod
    def picture(data: xr.Dataset) -> p.Picture:
        """Draw the percentage of random designs with an objective below each value, and the proven optimum."""
        objective, unit = in_unit(data["objective"])
        best = in_unit(data["optimum"])[0]
        marks: list[p.Mark] = []
        for k, name in enumerate(data["case"].values):
            colour = p.colour(k, data.sizes["case"])
            marks.append(share_below(_feasible(data, objective, k), colour, str(name)))
            marks.append(p.Line([best[k]] * 2, [0.0, 100.0], colour, dash=p.DASHES[0], width=1.2))
        marks.append(p.Line(colour="ink", dash=p.DASHES[0], width=1.2, label="optimum"))
        x = p.Axis(f"{data['objective'].attrs['long_name']} [{unit}]")
        panel = p.Panel(marks, x, p.Axis("designs below [%]", (0.0, 100.0)))
        words = f"{data.sizes['draw']:,} designs a case, uniform between the bounds; drawn are those within limits."
        return p.Picture(data.attrs["title"], words, [panel], p.credit(data, f"Seed {data.attrs['seed']}. "))


def _feasible(data: xr.Dataset, objective: Array, k: int) -> Array:
    return np.asarray(objective[k][data[WITHIN].values[k] > 0.0])
