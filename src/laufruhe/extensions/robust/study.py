"""Free forces from manufacturing tolerances, at their worst and at random, and their effect on mount forces.

Hasselgruber 1964, on errors of balancing: all tolerances at their limits, summed algebraically, make about 100 kp where
the second order of a four-cylinder makes 1000 kp. So finer balancing promises nothing for engines of fewer than six
cylinders.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from laufruhe.extensions.robust.tolerance import AddedDrive, Error, PistonDrive, Tolerances
from laufruhe.extensions.robust.tolerance import Tolerance as Cause
from laufruhe.extensions.robust.worst_case import worst_case
from laufruhe.files import fields as f
from laufruhe.files.fields import Name, Table
from laufruhe.files.study_tables import CaseTable
from laufruhe.load_models.affine import AffineNorm
from laufruhe.machine import Engine, OperatingPoint
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import NORMS, Grid
from laufruhe.physics.modes import GRAVITY
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.present import picture as p
from laufruhe.present.numbers import percent
from laufruhe.problem.evaluation import evaluate, with_common_base
from laufruhe.problem.measure import MEAN_MOUNT_FORCE
from laufruhe.problem.problem import Drawing, Problem
from laufruhe.studies.part import Part, Record, variable
from laufruhe.studies.scenes import Point, ProblemFiles
from laufruhe.studies.text import NEGLIGIBLE, Text, Verdict, marked_table, number, statement_table

if TYPE_CHECKING:
    import xarray as xr

# samples of a turn, and random engines that are computed at once
ANGLES, PIECE = 360, 500
# norm of free forces, and relative gap of their worst case
MAXIMUM, CLOSE = NORMS["maximum"], 1e-5
CAUSES = ("reciprocating masses", "unbalance", "alignment")
SHARES = np.arange(201) / 200.0
MOUNTED = 200
"""Most engines with mount forces: each costs as much as a thousand free forces."""
MIN_FORCE, DENSITY_HEIGHT = 0.1, 0.7
"""Left end of the axis [kp], where smaller forces are drawn; height of a density over that of a row."""
_TOP, _STEP = -0.55, 0.3
"""Position of the lowest label above the rows, and distance of labels, in rows."""


class StudyTolerancesTable(Table):
    """Tolerances of a built engine against its drawing."""

    reciprocating_mass: f.Mass = f.optional("Tolerance of the reciprocating mass of each cylinder, either way.", 0.0)
    unbalance: f.Unbalance = f.optional("Unbalance left on each balancing plane, at any angle.", 0.0)
    planes: Annotated[int, Field(ge=1, le=48)] = 2
    alignment: f.NonNegativeLength = f.optional("Eccentricity of each aligned mass.", 0.0)
    aligned_masses: list[f.Mass] = Field(
        default_factory=list, max_length=48, description="Flywheel, clutch and whatever else is centred on the crank."
    )

    @model_validator(mode="after")
    def _is_something(self) -> StudyTolerancesTable:
        aligned = self.alignment * sum(self.aligned_masses)
        if not self.reciprocating_mass + self.unbalance + aligned > 0.0:
            raise f.refusal("are all zero; give one above zero (alignment needs aligned_masses)")
        return self

    def of(self, engine: Engine) -> Tolerances:
        """Return the tolerances of an engine, one for each cause of error with a size above zero.

        Balancing planes stand from the first throw to the last. Aligned masses stand at the last throw, where power is
        taken off (C3).
        """
        front, rear = (pick(part.x for part in engine.slider_cranks) for pick in (max, min))
        places = [float(x) for x in np.linspace(front, rear, self.planes)]
        pistons = [Error(part.name, (PistonDrive(k, self.reciprocating_mass),))
                   for k, part in enumerate(engine.slider_cranks)]  # fmt: skip
        unbalances = [_added_error(f"left unbalance {k + 1}", x, self.unbalance) for k, x in enumerate(places)]
        aligned = [
            _added_error(f"alignment {k + 1}", rear, mass * self.alignment)
            for k, mass in enumerate(self.aligned_masses)
        ]
        sizes = (self.reciprocating_mass, self.unbalance, self.alignment * sum(self.aligned_masses))
        causes = zip(CAUSES, ("kg", "kg m", "kg m"), sizes, (pistons, unbalances, aligned), strict=True)
        return Tolerances(tuple(Cause(name, unit, size, tuple(errors)) for name, unit, size, errors in causes)).nonzero


def _added_error(name: str, x: float, maximum: float) -> Error:
    return Error(name, (AddedDrive(name, x, maximum),), 2)


def _built(engine: Engine, tolerances: Tolerances, errors: Array) -> Engine:
    return tolerances.with_errors(Drawing(engine, (), (), ()), errors).engine


def _added_forces(engine: Engine, speed: float, tolerances: Tolerances) -> Array:
    point, steps = OperatingPoint("", speed), ANGLES * engine.cycle.turns
    engines = [engine, *(_built(engine, tolerances, z) for z in np.eye(tolerances.count))]
    # an engine without errors may have a shorter period, so use that of the cycle
    loads = with_common_base(engine.cycle.base_order, [shaking_loads(variant, point) for variant in engines])
    drawing, *unit_errors = (spectrum.sample(steps)[:, 1:3] for spectrum in loads)
    return np.array([forces - drawing for forces in unit_errors]).reshape(tolerances.count, steps, 2)


def worst_parts(engine: Engine, speed: float, tolerances: StudyTolerancesTable) -> dict[str, float]:
    """Return the largest free force [N] of each cause, with all its errors at their limits (R4).

    Unbalances may have any angle, so the sum of all causes is the worst case.
    """
    tolerance_set, forces, first = tolerances.of(engine), dict.fromkeys(CAUSES, 0.0), 0
    added = _added_forces(engine, speed, tolerance_set)
    for cause in tolerance_set.tolerances:
        columns = Tolerances((cause,)).columns
        count = columns[-1].stop
        slope = np.ascontiguousarray(np.moveaxis(added[first : first + count], 0, -1))
        zero, steps = np.zeros(slope.shape[:2]), len(slope)
        norm = AffineNorm(MAXIMUM, zero, slope, Grid(np.full(steps, 1.0 / steps), steps))
        forces[cause.name] = worst_case([(1.0, norm)], columns, CLOSE).bound
        first += count
    return forces


def random_forces(engine: Engine, speed: float, tolerances: StudyTolerancesTable, builds: int, seed: int) -> Array:
    """Return the largest free force over the cycle that errors add to each random engine [N], shape (builds,).

    Masses are uniform within their tolerance, unbalances within their disc.
    """
    tolerance_set = tolerances.of(engine)
    added, errors = _added_forces(engine, speed, tolerance_set), tolerance_set.draw(np.random.default_rng(seed), builds)
    # in parts: all engines at once would take gigabytes
    pieces = (np.tensordot(errors[k : k + PIECE], added, axes=1) for k in range(0, builds, PIECE))
    return np.concatenate([np.hypot(forces[..., 0], forces[..., 1]).max(axis=1) for forces in pieces])


def built(engine: Engine, tolerances: StudyTolerancesTable, random: np.random.Generator) -> Engine:
    """Return one random engine for the exact model."""
    tolerance_set = tolerances.of(engine)
    return _built(engine, tolerance_set, tolerance_set.draw(random, 1)[0])


def mean_mount_forces(
    problem: Problem, tolerances: StudyTolerancesTable, builds: int, seed: int
) -> tuple[float, Array]:
    """Return the mean mount force [N] of the drawing, and of random engines, shape (builds,)."""
    random = np.random.default_rng(seed)
    drawing = evaluate(problem).value(MEAN_MOUNT_FORCE)
    engines = (built(problem.engine, tolerances, random) for _ in range(builds))
    return drawing, np.array([evaluate(problem, engine).value(MEAN_MOUNT_FORCE) for engine in engines])


def spread(problem: Problem, tolerances: StudyTolerancesTable, builds: int = 10_000, seed: int = 1964) -> Record:
    """Return the free force [N] of an engine under tolerances, at its crank speed [rad/s].

    Keys: largest over the cycle of the drawing (`nominal`), worst addition by each cause (`causes`), mean and quantiles
    at SHARES of the random additions (`mean`, `random`), mean mount force of the drawing and quantiles of random
    engines (`mount`, `mount_random`); NaN without mounts.
    """
    engine, point = problem.engine, problem.points[0]
    added_forces = random_forces(engine, point.speed, tolerances, builds, seed)
    mount, forces = math.nan, np.full(1, math.nan)
    if engine.mounts:
        mount, forces = mean_mount_forces(problem, tolerances, min(builds, MOUNTED), seed)
    free = shaking_loads(engine, point, problem.fidelity).sample(ANGLES * engine.cycle.turns)[:, 1:3]
    return {
        "nominal": float(np.hypot(*free.T).max()),
        "causes": worst_parts(engine, point.speed, tolerances),
        "mean": float(added_forces.mean()),
        "random": np.quantile(added_forces, SHARES).tolist(),
        "mount": mount,
        "mount_random": np.quantile(forces, SHARES).tolist(),
        "speed": point.speed,
    }


_WORDS = {
    "nominal": ("largest free force of the drawing", "N"),
    "mean": ("mean of what tolerances add at random", "N"),
    "mount": ("mean mount force of the drawing", "N"),
}
_RANDOM = {
    "random": "added free force that this share of random engines does not exceed",
    "mount_random": "mean mount force that this share of built engines does not exceed",
}


class ToleranceCase(CaseTable):
    """Engine, and the statement of the source about finer balancing of it."""

    claim: Literal["promises nothing", "matters"] | None = f.optional("What the source says of finer balancing.")


class MarkTable(Table):
    """Force that the picture shows for comparison."""

    name: Name
    force: f.Force


class ToleranceStudy(Part):
    """Free forces that manufacturing tolerances leave, at their worst and at random."""

    kind: Literal["tolerance"]
    cases: list[ToleranceCase] = Field(min_length=1)  # type: ignore[assignment]
    tolerances: StudyTolerancesTable
    engines: Annotated[int, Field(ge=100, le=1_000_000)] = f.optional("Number of engines that are drawn.", 10_000)
    seed: Annotated[int, Field(ge=0)] = 1964
    marks: list[MarkTable] = Field(default_factory=list)

    def settings(self) -> dict[str, Any]:
        """Return the settings that random engines depend on; marks are for pictures alone."""
        return self.model_dump(include={"kind", "tolerances", "engines", "seed"})

    def points(self, problem_files: ProblemFiles) -> list[Point]:
        """Return the points to compute: one for each engine, at its single operating point."""
        for case in self.cases:
            if len(problem_files.problem(Point(case)).points) != 1:
                rule = f"has several in '{case.name}', and tolerances are studied at one"
                raise problem_files.refused(case, "operating_points", rule, "name an engine with one")
        return [Point(case) for case in self.cases]

    def answer(self, point: Point, problem_files: ProblemFiles) -> Record:
        """Return the record of the free forces of one engine, with the keys of `spread`."""
        return spread(problem_files.problem(point), self.tolerances, self.engines, self.seed)

    def dataset(self, points: Sequence[Point], records: Sequence[Mapping[str, Any]]) -> xr.Dataset:
        """Return the free forces of all engines as a dataset, with the claims of the source."""
        import xarray as xr

        names, forces = [mark.name for mark in self.marks], [mark.force for mark in self.marks]
        marks = {"mark_names": names, "mark_forces": forces} if names else {}
        values = {
            name: variable("case", [record[name] for record in records], *words) for name, words in _WORDS.items()
        }
        for cause in CAUSES:
            sizes = [record["causes"][cause] for record in records]
            values[f"worst_{cause.replace(' ', '_')}"] = variable("case", sizes, f"from {cause} alone", "N")
        worst = [sum(record["causes"].values()) for record in records]
        values["worst"] = variable("case", worst, "largest free force that tolerances add", "N")
        for name, words in _RANDOM.items():
            values[name] = variable(("case", "share"), [record[name] for record in records], words, "N")
        coords = {
            "case": [point.case.name for point in points],
            "share": variable("share", SHARES, "share of random engines that stay below"),
            "speed": ("case", [record["speed"] for record in records], {"units": "rad/s"}),
            "claim": ("case", [case.claim or "" for case in self.cases]),
        }
        return xr.Dataset(values, coords, self.about(seed=self.seed, engines=self.engines, **marks))

    @staticmethod
    def table(data: xr.Dataset) -> list[Text]:
        """Return tables of free forces by engine and cause [kp], and of claims with verdicts."""
        head = ["engine", "drawing [kp]", "worst sum [kp]", *(f"of it {cause} [kp]" for cause in CAUSES)]
        head += ["random: mean [kp]", "95 % below [kp]", "drawing over worst sum"]
        head += ["mean mount force, drawing [kp]", "95 % of built engines: at most"]
        rows = []
        for name in data["case"].values:
            row = data.sel(case=name)
            nominal, worst = float(row["nominal"]) / GRAVITY, float(row["worst"]) / GRAVITY
            parts = [f"{float(row['worst_' + cause.replace(' ', '_')]) / GRAVITY:.1f}" for cause in CAUSES]
            quantile = float(row["random"].sel(share=0.95, method="nearest")) / GRAVITY
            cells = [str(name), number(nominal, 3), f"{worst:.1f}", *parts, f"{float(row['mean']) / GRAVITY:.1f}"]
            cells += [f"{quantile:.1f}", f"{nominal / worst:.2g}", number(float(row["mount"]) / GRAVITY, 3)]
            rows.append([*cells, percent(rise_of(row))])
        return [marked_table(head, rows), *statement_table(verdicts(data))]

    @staticmethod
    def picture(data: xr.Dataset) -> p.Picture:
        """Return a picture with a row for each engine: density of random engines, worst sum, and drawing."""
        rows = [data.sel(case=name) for name in data["case"].values]
        stated = np.atleast_1d(data.attrs.get("mark_forces", []))
        maximum = max([float(data["nominal"].max()), float(data["worst"].max()), *stated]) / GRAVITY
        top = _TOP - 0.25 - (_STEP if len(stated) > 1 else 0.0)
        panel = p.Panel(
            [mark for k, row in enumerate(rows) for mark in _row(row, k)] + _marks(data, len(rows)),
            p.Axis(
                "largest free force over the cycle [kp]", (MIN_FORCE, max(2.0 * maximum, 10.0 * MIN_FORCE)), log=(1.0,)
            ),
            p.Axis(ends=(len(rows) - 0.5, top), ticks=[(k, _label(row)) for k, row in enumerate(rows)], grid=False),
        )
        legend: list[p.Mark] = [
            p.Area(label=f"{data.attrs['engines']:,} random engines"),
            p.Line(colour="after", marker="|", size=12.0, width=0.0, label="worst sum"),
            p.Line(marker="D", width=0.0, label="drawing"),
        ]
        legend += [p.Line(colour="faint", dash=(3.0, 2.0), label="stated")] if len(stated) else []
        words = "What tolerances add to the free force. Percents: what 95 of 100 add to the mean mount force at most."
        credit, size = p.credit(data, f"Seed {data.attrs['seed']}. "), (7.2, 0.62 * len(rows) + 0.5)
        return p.Picture(data.attrs["title"], words, [panel], credit, size, legend=legend)


def verdicts(data: xr.Dataset) -> tuple[Verdict, ...]:
    """Return a verdict on each claim of the source about finer balancing.

    Finer balancing "promises nothing" if tolerances raise the mean mount force of 95 of 100 engines by less than a
    negligible share (W1 of docs/findings/economics.md).
    """
    result = []
    why = f"W1: under {100.0 * NEGLIGIBLE:.0f} % at 95 of 100 engines built"
    for name in data["case"].values:
        row = data.sel(case=name)
        claim, rise = str(row["claim"].item()), rise_of(row)
        if claim:
            agrees = (rise < NEGLIGIBLE) == (claim == "promises nothing")
            statement, unit = f"finer balancing, {name}", "% of the mean mount force"
            result.append(Verdict(statement, claim, 100.0 * rise, unit, agrees, why))
    return tuple(result)


def rise_of(row: xr.Dataset) -> float:
    """Return the relative rise of the mean mount force at the 95 % quantile of built engines over the drawing."""
    quantile = float(row["mount_random"].sel(share=0.95, method="nearest"))
    return quantile / float(row["mount"]) - 1.0


def _label(row: xr.Dataset) -> str:
    rise = rise_of(row)
    return str(row["case"].item()) + (f"\n{percent(rise)}" if np.isfinite(rise) else "")


def _row(row: xr.Dataset, k: int) -> list[p.Mark]:
    places, density = _density(row["random"].values / GRAVITY, row["share"].values)
    worst, nominal = float(row["worst"]) / GRAVITY, float(row["nominal"]) / GRAVITY
    marker = max(nominal, MIN_FORCE)
    return [
        p.Area(places, np.full(len(places), k), k - DENSITY_HEIGHT * density),
        p.Line([worst], [k - 0.3], "after", marker="|", size=14.0, width=0.0),
        p.Words(worst * 1.08, k - 0.3, f"{worst:.0f}", "after"),
        p.Line([marker], [k - 0.3], marker="D", width=0.0),
        p.Words(marker * 1.12, k - 0.3, number(nominal, 3)),
    ]


def _density(quantiles: np.ndarray, shares: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    force = np.maximum(quantiles, 1e-6)[::8]
    steps = np.diff(np.log(force))
    density = np.diff(shares[::8]) / np.maximum(steps, 1e-9)
    middle = np.sqrt(force[1:] * force[:-1])
    places = np.concatenate([force[:1], middle, force[-1:]])
    return places, np.concatenate([[0.0], density / density.max(), [0.0]])


def _marks(data: xr.Dataset, count: int) -> list[p.Mark]:
    names, forces = (np.atleast_1d(data.attrs.get(key, [])) for key in ("mark_names", "mark_forces"))
    marks: list[p.Mark] = []
    # labels alternate between two heights, so that long names do not overlap
    for k, (name, force) in enumerate(zip(names, forces / GRAVITY if len(forces) else forces, strict=True)):
        top = _TOP - _STEP * (k % 2)
        marks.append(p.Line([force] * 2, [top, count - 0.5], "faint", width=1.2, dash=(3.0, 2.0), behind=True))
        marks.append(p.Words(force, top, f"{name}: {force:.0f}", colour="faint", across="center", along="bottom"))
    return marks
