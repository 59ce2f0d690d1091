"""The study kind `economics`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from laufruhe.errors import ModelError, SolverError
from laufruhe.extensions.economics.worth import (
    MORE_CYLINDERS,
    PLAIN,
    SHAFTS,
    FrontPoint,
    Judgement,
    front,
    verdicts,
    worths,
)
from laufruhe.files import fields as f
from laufruhe.files.complaints import nearest
from laufruhe.files.fields import Name, Table
from laufruhe.files.study_tables import CaseTable
from laufruhe.present import picture as p
from laufruhe.present.numbers import fixed, percent
from laufruhe.problem.problem import Problem
from laufruhe.problem.static_load import with_loads
from laufruhe.studies.part import Part, Record, variable
from laufruhe.studies.scenes import Point, ProblemFiles, shafts_of
from laufruhe.studies.text import DASH, Text, marked_table, number, statement_table

if TYPE_CHECKING:
    import xarray as xr

SAME = 1e-4
"""Relative difference of forces below which proofs cannot distinguish designs."""
LINE = 0.052
"""Height of a line of text over that of its panel."""


_AT_LIMITS = {
    "force": ("minimum of the objective", "{}"),
    "lower_bound": ("lower bound of the objective", "{}"),
    "gap": ("relative gap of the proof", "1"),
    "mass": ("mass on the shafts", "kg"),
    "price": ("decrease of the objective per kilogram of shaft mass", "{} / kg"),
}
_FREE = {
    "optimum": ("force", "minimum of the objective without a mass limit", "{}"),
    "optimum_bound": ("lower_bound", "lower bound of the objective without a mass limit", "{}"),
    "optimum_mass": ("mass", "shaft mass at that minimum", "kg"),
    "optimum_counterpart": ("counterpart", "objective of that design with or without its static part", "{}"),
}


class SourceClaim(Table):
    """Statement of a source about a set of shafts, to be confirmed or refuted."""

    says: Judgement | None = None
    falls_by: Annotated[float, Field(gt=0.0, lt=1.0)] | None = f.optional("Share by which the force is said to fall.")
    against: Name = f.optional("Build that it is compared with.", PLAIN)
    where: str = f.optional("Figure or passage of the source.", "")

    @model_validator(mode="after")
    def _says_something(self) -> SourceClaim:
        if self.says is None and self.falls_by is None:
            raise f.refusal(
                "states no claim of the source; give its judgement under says, the reduction under falls_by, or both"
            )
        return self


NO_CLAIM = SourceClaim.model_construct()
_SERIES: tuple[p.Colour, ...] = ("blue", "vermilion", "green", "purple", "orange", "sky")


class BuildTable(Table):
    """Set of shafts."""

    name: Name
    case: Name | None = f.optional("Case that has these shafts; the first by default.")
    shafts: list[Name] = f.optional("Balancer shafts that are built; none makes the plain engine of another case.", [])
    claim: SourceClaim | None = None

    @model_validator(mode="after")
    def _is_not_plain(self) -> BuildTable:
        if not self.shafts and self.case is None:
            raise f.refusal(
                "has no shafts, so it equals the engine without shafts, which the study always includes; name shafts"
            )
        if len(set(self.shafts)) < len(self.shafts):
            raise f.refusal("names one shaft twice; name each shaft once")
        return self


class Economics(Part):
    """Least force over number and mass of shafts, compared with the engine with one more cylinder at equal power."""

    kind: Literal["economics"]
    alternating: bool = f.optional(
        "Judge shafts by loads without their mean over the cycle, which no shaft can balance.", True
    )
    mass_limits: list[f.Mass] = f.required("Largest masses of the shafts, ascending: the points of the front.")
    builds: list[BuildTable] = Field(min_length=1)
    more_cylinders: list[CaseTable] = Field(
        min_length=1, description="Plain engines, rebuilt at equal power; the first decides what is worth building."
    )

    @field_validator("mass_limits")
    @classmethod
    def _ascend(cls, limits: list[float]) -> list[float]:
        if len(limits) < 2:
            raise f.refusal("needs two masses or more")
        if sorted(set(limits)) != limits:
            raise f.refusal("must rise; sort the masses and name each mass once")
        return limits

    @model_validator(mode="after")
    def _names_fit(self) -> Economics:
        built = [PLAIN, *(build.name for build in self.builds)]
        names = [*built, *(case.name for case in self.more_cylinders)]
        twice = [name for name in names if names.count(name) > 1]
        if twice:
            raise f.refusal(f"has two engines called '{twice[0]}'; give each its own name ('{PLAIN}' is taken)")
        cases = [case.name for case in self.cases]
        for build in self.builds:
            if build.claim is not None and build.claim.against not in built:
                raise f.refusal(f"compares '{build.name}' with '{build.claim.against}'; use one of: {', '.join(built)}")
            if build.case is not None and build.case not in cases:
                raise f.refusal(f"builds '{build.name}' on case '{build.case}'; use one of: {', '.join(cases)}")
        for case in (*self.cases, *self.more_cylinders):
            if case.equal_power_to is not None:
                raise f.refusal(f"scales '{case.name}' to equal power itself; remove equal_power_to from its cases")
        return self

    def settings(self) -> dict[str, Any]:
        """Return the mass limits and the kind of load; names and claims change no front."""
        return {"kind": self.kind, "mass_limits": self.mass_limits, "alternating": self.alternating}

    def points(self, problem_files: ProblemFiles) -> list[Point]:
        """Return the points to compute: the engine without shafts, with each set of shafts, and with more cylinders."""
        base = self.cases[0]
        reference = problem_files.problem(Point(base))
        if not shafts_of(reference):
            raise problem_files.refused(
                base, "balancer_shafts", "is missing, so the study has no shafts to compare", "add them"
            )
        points = [Point(base, shafts=())]
        for build in self.builds:
            case = next((case for case in self.cases if case.name == build.case), base)
            names = shafts_of(problem_files.problem(Point(case)))
            for shaft in build.shafts:
                if shaft not in names:
                    rule = f"has no shaft '{shaft}', which '{build.name}' builds"
                    raise problem_files.refused(case, "balancer_shafts", rule, nearest(shaft, names))
            points.append(Point(case, shafts=tuple(build.shafts)))
        points += [_larger_engine(case, reference, problem_files) for case in self.more_cylinders]
        _check_objectives(points, problem_files)
        return points

    def answer(self, point: Point, problem_files: ProblemFiles) -> Record:
        """Return the trade-off of one engine: its least objective under each limit on the shaft mass."""
        problem = problem_files.problem(point)
        problem = with_loads(problem, alternating=True) if self.alternating else problem
        try:
            points = front(problem, self.mass_limits)
        except SolverError as error:
            raise ModelError(f"{error}; open more numbers of this problem, or name larger mass limits") from None
        return {
            "objective": problem.objective_name,
            "unit": problem.objective_unit or "",
            "shafts": len(shafts_of(problem)),
            "cylinders": len(problem.engine.cylinders),
            "points": points,
        }

    def dataset(self, points: Sequence[Point], records: Sequence[Mapping[str, Any]]) -> xr.Dataset:  # noqa: ARG002
        """Return the trade-offs of all engines as one dataset, with the source's claims about each."""
        import xarray as xr

        following = [case.name for case in self.more_cylinders]
        names = [PLAIN, *(build.name for build in self.builds), *following]
        claims = [NO_CLAIM, *(build.claim or NO_CLAIM for build in self.builds), *(NO_CLAIM for _ in following)]
        fronts, unit = np.array([record["points"] for record in records], dtype=float), records[0]["unit"]
        fields = FrontPoint._fields
        values = {
            name: variable(("build", "mass_limit"), fronts[:, :-1, fields.index(name)], words, per.format(unit))
            for name, (words, per) in _AT_LIMITS.items()
        }
        for name, (field, words, per) in _FREE.items():
            values[name] = variable("build", fronts[:, -1, fields.index(field)], words, per.format(unit))
        coords = {
            "build": names,
            "mass_limit": variable("mass_limit", self.mass_limits, "mass allowed on shafts", "kg"),
            "shafts": variable("build", [record["shafts"] for record in records], "balancer shafts"),
            "cylinders": ("build", [record["cylinders"] for record in records], {"units": "1"}),
            "standing": ("build", [PLAIN, *(SHAFTS for _ in self.builds), *(MORE_CYLINDERS for _ in following)]),
            "claim": ("build", [claim.says or "" for claim in claims], {"long_name": "claim of the source"}),
            "claimed_fall": ("build", [claim.falls_by or np.nan for claim in claims], {"units": "1"}),
            "claimed_against": ("build", [claim.against for claim in claims]),
            "claimed_where": ("build", [claim.where for claim in claims]),
        }
        data = xr.Dataset(values, coords, self.about(objective=records[0]["objective"]))
        data.attrs["counterpart"] = "with its static part" if self.alternating else "alternating part"
        return data.assign(efficient=_efficient(data))

    @staticmethod
    def table(data: xr.Dataset) -> list[Text]:
        """Return the tables of the report: engines at their optimum, verdicts, statements of the source, trade-offs."""
        judgements = worths(data)
        unit, plain = data["optimum"].attrs["units"], float(data["optimum"].isel(build=0))
        head = ["engine", "shafts", "mass on them [kg]", f"{data.attrs['objective']} [{unit}]", f"lower bound [{unit}]",
                f"{data.attrs['counterpart']} [{unit}]", "change from plain", "worth building"]  # fmt: skip
        rows = []
        for name in data["build"].values:
            row = data.sel(build=name)
            force, (worth, why) = float(row["optimum"]), judgements.get(str(name), (False, ""))
            label = f"{name}, no shafts, equal power" if str(row["standing"].item()) == MORE_CYLINDERS else str(name)
            cells = [label, str(int(row["shafts"])), fixed(float(row["optimum_mass"]), 2), number(force)]
            change = DASH if force == plain else percent(force / plain - 1.0)
            cells += [number(float(row["optimum_bound"]), 6), number(float(row["optimum_counterpart"])), change]
            rows.append([*cells, f"{'**yes**' if worth else 'no'}: {why}" if why else DASH])
        return [
            marked_table(head, rows),
            *statement_table([v for claims in verdicts(data).values() for v in claims]),
            *_front_rows(data),
        ]

    @staticmethod
    def picture(data: xr.Dataset) -> p.Picture:
        """Draw least objective over shaft mass for every set of shafts, and the engines without shafts."""
        built = _with_shafts(data)
        colours = dict(zip(built, _SERIES * (1 + len(built) // len(_SERIES)), strict=False))
        ends = (1.3 * float(data["optimum_mass"].max()) or 1.0, 1.06 * float(data["optimum"].max()))
        unit = data["optimum"].attrs["units"]
        fronts = p.Panel(
            _lines(data, colours) + _levels(data, *ends),
            p.Axis("mass on balancer shafts [kg]", (0.0, ends[0])),
            p.Axis(f"{data.attrs['objective']} [{unit}]", (0.0, ends[1])),
        )
        legend = [p.Line(colour=colour, label=name, width=2.5) for name, colour in colours.items()]
        legend.append(p.Line(dash=p.DASHES[0], width=1.2, label="more cylinders, no shafts, equal power"))
        words = "Dots: smallest force for this mass; diamonds: smallest force without a mass limit. "
        words += f"All are proven optima with a gap of at most {100.0 * float(data['gap'].max()):.1g} %. "
        words += "The mass of crank weights does not count."
        credit = p.credit(data)[:-1] + "; filled dots: no other point has less force with no more mass and shafts."
        return p.Picture(data.attrs["title"], words, [fronts], credit, (7.2, 4.6), legend=legend)


def _larger_engine(case: CaseTable, reference: Problem, problem_files: ProblemFiles) -> Point:
    """Return the study point of an engine with more cylinders, scaled to the power of the reference engine."""
    problem = problem_files.problem(Point(case))
    cylinders = len(reference.engine.slider_cranks)
    if shafts_of(problem):
        rule = f"are present, but '{case.name}' is compared without balancer shafts"
        raise problem_files.refused(case, "balancer_shafts", rule, 'add without = ["balancer_shafts"] to its case')
    if len(problem.engine.slider_cranks) <= cylinders:
        rule = f"has no more cylinders in '{case.name}' than the {cylinders} of the engine compared"
        raise problem_files.refused(case, "engine", rule, "name an engine with more")
    with problem_files.blamed(Point(case), "more_cylinders"):
        check_comparable(problem, reference)
    return Point(case.model_copy(update={"equal_power_to": cylinders}), shafts=())


def check_comparable(problem: Problem, reference: Problem) -> None:
    """Raise `ModelError` if engines differ in more than the number of cylinders (eqs. 14-17)."""
    compared: dict[str, Callable[[Problem], object]] = {
        "cycle": lambda one: one.engine.cycle,
        "bore": lambda one: {part.bore for part in one.engine.slider_cranks},
        "stroke": lambda one: {part.crank_radius for part in one.engine.slider_cranks},
        "speed": lambda one: [point.speed for point in one.points],
        "gas": lambda one: [point.gas for point in one.points],
    }
    differ = [what for what, value_of in compared.items() if value_of(problem) != value_of(reference)]
    if differ:
        raise ModelError(
            f"'{problem.name}' and '{reference.name}' differ in {' and '.join(differ)}, so their numbers of cylinders "
            "do not determine their power; give both engines the same values"
        )


def _check_objectives(points: Sequence[Point], problem_files: ProblemFiles) -> None:
    objectives: dict[str, Point] = {}
    for point in points:
        problem = problem_files.problem(point)
        problem_files.refuse_open_phasing(problem, point.case)
        objective = problem.load_terms
        if not objective or any(term.measure.is_mass for term in objective):
            rule = f"is {problem.objective_name}, which is no load" if problem.objective_name else "is missing"
            remedy = "minimise a load, such as mean mount force"
            raise problem_files.refused(
                point.case, "objective", f"{rule}, so balancer shafts have nothing to lower", remedy
            )
        objectives.setdefault(str(objective), point)
    if len(objectives) > 1:
        first, second = list(objectives.values())[:2]
        rule = f"differs between '{first.case.name}' and '{second.case.name}'"
        raise problem_files.refused(second.case, "objective", rule, "give all engines the same objective")


def _efficient(data: xr.Dataset) -> tuple[tuple[str, str], np.ndarray, dict[str, str]]:
    # points of the common front: no other has less force with no more shafts and mass
    force, shafts = data["force"].values, data["shafts"].values
    is_same_engine = data["standing"].values != MORE_CYLINDERS
    on_front = np.zeros(force.shape, dtype=bool)
    for b in np.flatnonzero(is_same_engine):
        rivals, fewer = force[is_same_engine & (shafts <= shafts[b])], force[is_same_engine & (shafts < shafts[b])]
        for k in range(force.shape[1]):
            beaten = min(rivals[:, :k].min(initial=np.inf), fewer[:, k].min(initial=np.inf))
            on_front[b, k] = force[b, k] <= rivals[:, k].min() and force[b, k] < (1.0 - SAME) * beaten
    return ("build", "mass_limit"), on_front, {"long_name": "true if no other design is better in every respect"}


def _with_shafts(data: xr.Dataset) -> list[str]:
    return [str(build) for build in data["build"].values[data["shafts"].values > 0]]


def _front_rows(data: xr.Dataset) -> list[Text]:
    built = _with_shafts(data)
    rows = []
    for limit, selected in data.sel(build=built).groupby("mass_limit"):
        best = zip(selected["force"].values.ravel(), selected["efficient"].values.ravel(), strict=True)
        rows.append([f"{limit:g}", *(f"**{force:.1f}**" if efficient else f"{force:.1f}" for force, efficient in best)])
    words = (
        f"Smallest {data.attrs['objective']} [{data['force'].attrs['units']}] by mass allowed on the shafts, proven "
    )
    words += f"to {100.0 * float(data['gap'].max()):.1g} %. Bold: no other design has less force with no more mass and "
    return [words + "shafts.", marked_table(["mass [kg]", *built], rows)]


def _lines(data: xr.Dataset, colours: Mapping[str, p.Colour]) -> list[p.Mark]:
    """Return the trade-offs as lines of decreasing width, so that overlapping lines stay visible."""
    limits = data["mass_limit"].values
    marks: list[p.Mark] = []
    for k, (name, colour) in enumerate(colours.items()):
        row = data.sel(build=name)
        mass, force = float(row["optimum_mass"]), float(row["optimum"])
        below = limits < mass
        x, y = limits[below], row["force"].values[below]
        marks.append(p.Line(np.append(x, mass), np.append(y, force), colour, width=max(4.2 - 0.9 * k, 1.2)))
        best = row["efficient"].values[below]
        marks.append(p.Line(x[best], y[best], colour, width=0.0, marker="o", size=4.0))
        marks.append(p.Line(x[~best], y[~best], colour, width=0.0, marker="o", size=4.0, hollow=True))
        marks.append(p.Line([mass], [force], colour, width=0.0, marker="D"))
    return marks


def _levels(data: xr.Dataset, right: float, high: float) -> list[p.Mark]:
    """Return horizontal lines at the objectives of engines without shafts: grey, dashed with more cylinders."""
    dashes = iter(p.DASHES * 4)
    top, marks = math.inf, list[p.Mark]()
    engines = data.isel(build=np.flatnonzero(data["shafts"].values == 0)).sortby("optimum", ascending=False)
    for name in engines["build"].values:
        force = float(engines["optimum"].sel(build=name))
        has_more_cylinders = str(engines["standing"].sel(build=name).item()) == MORE_CYLINDERS
        dash, colour = (next(dashes), "ink") if has_more_cylinders else ((), "before")
        marks.append(p.Line([0.0, right], [force, force], colour, dash=dash, width=1.2, behind=True))
        # stack the names of close levels
        top = min(force, top - LINE * high)
        place, colour = top + 0.15 * LINE * high, "ink" if has_more_cylinders else "faint"
        marks.append(p.Words(right, place, f"{name}: {force:.0f}", colour, "right", "bottom", boxed=True))
    return marks
