"""Study kind `random scenes`: random problems, each optimised separately."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from laufruhe.errors import InputError, ModelError
from laufruhe.extensions.random_studies.draws import VALUES, Column
from laufruhe.extensions.random_studies.sampled import Sampled, in_unit, percentiles_of, share_below
from laufruhe.files import fields as f
from laufruhe.files.fields import Table
from laufruhe.files.study_tables import Span, Value, span_of
from laufruhe.numerics.arrays import Array
from laufruhe.present import picture as p
from laufruhe.solvers.conclusion import decision_values
from laufruhe.studies.part import Record
from laufruhe.studies.scenes import Point, ProblemFiles
from laufruhe.studies.solved import NOTHING_OPEN, solve_scene
from laufruhe.studies.text import Text, marked_table, number

if TYPE_CHECKING:
    import xarray as xr

STATUSES = ("optimal", "feasible", "infeasible", "failed", "impossible")
PROOFS = ("global", "global within gap", "local", "none", NOTHING_OPEN)
IMPOSSIBLE = {"status": "impossible", "proof": "none"}
SIZES = ("objective_given", "objective", "lower_bound")
_CODES = {"status": STATUSES, "proof": PROOFS}
_WORDS = {"objective_given": "initial design", "objective": "final design", "lower_bound": "lower bound"}


class DrawnTable(Table):
    """Quantity of the problem that is drawn at random, evenly between two ends."""

    quantity: str = f.required("Path in the problem file: engine.rod_ratio, counterweights.web.balance_factor.")
    first: int | float | str = Field(alias="from")
    last: int | float | str = Field(alias="to")
    spacing: Literal["linear", "log"] = "linear"

    def span(self) -> Span:
        """Return the range; raise `Refused` if its ends do not fit."""
        return span_of(self.quantity, self.first, self.last, self.spacing)


class RandomScenes(Sampled):
    """Numbers of the problem file drawn at random; every random problem is decided as by `laufruhe solve`."""

    kind: Literal["random scenes"]
    vary: list[DrawnTable] = Field(
        min_length=1, max_length=20, description="Quantities that are drawn, each uniformly and independently."
    )
    own_chunk: ClassVar[int] = 1000

    def swept_or_drawn(self) -> list[tuple[str, Callable[[], object]]]:
        """Return the readers of the drawn quantities."""
        return [(f"vary[{k + 1}]", table.span) for k, table in enumerate(self.vary)]

    def drawn(self) -> list[Span]:
        """Return the drawn quantities with their ranges."""
        return [table.span() for table in self.vary]

    def points(self, problem_files: ProblemFiles) -> list[Point]:
        """Return the batches of draws of every case; check that its problem builds at the ends of all ranges."""
        for case in self.cases:
            for span in self.drawn():
                for end in (span.low, span.high):
                    problem_files.problem(Point(case, {span.quantity: _value(span, end)}))
        self.check_objective(problem_files)
        return [Point(case, span=span) for case in self.cases for span in self.spans()]

    def columns(self, problem_files: ProblemFiles) -> dict[str, Column]:
        """Return the columns that store a random problem: drawn numbers, results and decisions."""
        spans = self.drawn()
        columns = {span.quantity: Column(span.unit, span.quantity) for span in spans}
        for case in self.cases:
            problem = problem_files.problem(Point(case, {span.quantity: _value(span, span.low) for span in spans}))
            name, unit = problem.objective_name, problem.objective_unit or ""
            columns |= {key: Column(unit, f"{name}, {words}") for key, words in _WORDS.items()}
            columns |= {key: Column("1", key) for key in _CODES}
            entries = [entry for d in problem.decisions for entry in decision_values(d, d.start)]
            columns |= {entry.name: Column(entry.unit, f"final: {entry.name}") for entry in entries}
        return columns

    def answer(self, point: Point, problem_files: ProblemFiles) -> Record:
        """Return the record of a batch of draws: each random problem is read and optimised; one row per draw."""
        assert point.span is not None
        spans, names = self.drawn(), list(self.columns(problem_files))
        shares = self.random(point.span, len(spans))
        drawn = np.stack([_numbers(span, shares[:, k]) for k, span in enumerate(spans)], axis=1)
        rows = []
        for numbers in drawn:
            changes = {span.quantity: _value(span, x) for span, x in zip(spans, numbers, strict=True)}
            try:
                record = solve_scene(problem_files.problem(replace(point, changes=changes, span=None)))
            except (InputError, ModelError):
                # an engine that cannot be built is counted
                record = IMPOSSIBLE
            row = dict(zip((span.quantity for span in spans), map(float, numbers), strict=True))
            row |= {key: float(codes.index(record[key])) for key, codes in _CODES.items()}
            row |= {key: record.get(key, math.nan) for key in SIZES} | record.get("decided", {})
            rows.append([row.get(name, math.nan) for name in names])
        return {VALUES: np.array(rows)}

    def dataset(self, points: Sequence[Point], records: Sequence[Mapping[str, Any]]) -> xr.Dataset:
        """Return all random problems as a dataset; status and proof are numbers with their meanings as attributes."""
        data = self.gathered(points, records)
        for name, codes in _CODES.items():
            meanings = " ".join(code.replace(" ", "_") for code in codes)
            about = {**data[name].attrs, "flag_values": np.arange(len(codes), dtype="int8"), "flag_meanings": meanings}
            data[name] = data[name].astype("int8").assign_attrs(about)
        return data

    @staticmethod
    def table(data: xr.Dataset) -> list[Text]:
        """Return a table with the number of results by proof for every case, and its initial and final objectives."""
        unit = in_unit(data["objective"])[1]
        head = ["case", "scenes", "proven optimum", "proven within gap or local", "infeasible", "failed", "impossible"]
        head += [f"initial: 5 % below [{unit}]", "median", "95 % below", f"final: 5 % below [{unit}]", "median"]
        head += ["95 % below", "largest gap of proven designs"]
        rows = []
        for name in data["case"].values:
            part = data.sel(case=name)
            status, proof = part["status"].values, part["proof"].values
            is_solved = np.isin(status, (0, 1))
            best = is_solved & np.isin(proof, (0, 4))
            initial, decided = (in_unit(part[key])[0] for key in SIZES[:2])
            cells = [str(name), f"{len(status):,}", f"{int(best.sum()):,}", f"{int((is_solved & ~best).sum()):,}"]
            cells += [f"{int((status == code).sum()):,}" for code in (2, 3, 4)]
            cells += [number(x) for values in (initial, decided) for x in percentiles_of(values)]
            proven = part.isel(draw=np.flatnonzero(status == 0))
            gap = (proven["objective"] - proven["lower_bound"]) / np.maximum(proven["objective"], 1e-300)
            rows.append([*cells, f"{float(gap.max()):.1e}" if gap.notnull().any() else "–"])
        return [marked_table(head, rows)]

    @staticmethod
    def picture(data: xr.Dataset) -> p.Picture:
        """Draw the percentage of random problems with an objective below each value, for initial and final designs."""
        marks: list[p.Mark] = []
        for k, name in enumerate(data["case"].values):
            part, colour = data.sel(case=name), p.colour(k, data.sizes["case"])
            marks.append(share_below(in_unit(part["objective_given"])[0], colour, f"{name}, initial", p.DASHES[0]))
            marks.append(share_below(in_unit(part["objective"])[0], colour, f"{name}, final"))
        words = str(data["objective"].attrs["long_name"]).removesuffix(", final design")
        x = p.Axis(f"{words} [{in_unit(data['objective'])[1]}]")
        panel = p.Panel(marks, x, p.Axis("scenes below [%]", (0.0, 100.0)))
        words_above = f"{data.sizes['draw']:,} random scenes a case, each optimised separately."
        return p.Picture(data.attrs["title"], words_above, [panel], p.credit(data, f"Seed {data.attrs['seed']}. "))


def _numbers(span: Span, shares: Array) -> Array:
    # numbers in a range at fractions of it
    low, high = span.low, span.high
    return low * (high / low) ** shares if span.is_log else low + (high - low) * shares


def _value(span: Span, number: float) -> Value:
    # a number as a problem file has it
    if not span.is_text:
        return float(number)
    return f"{float(number)!r}" if span.unit == "1" else f"{float(number)!r} {span.unit}"
