"""Report of an identification: numbers with confidence intervals, what is not determined, and what is unexplained."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from laufruhe.cli.screen import Output, typed
from laufruhe.errors import refused
from laufruhe.extension import is_installed
from laufruhe.extensions.identification.estimate import CONFIDENCE, LARGE, Estimate, estimate
from laufruhe.extensions.identification.file import MEASUREMENTS, MeasurementTable, measurements_of
from laufruhe.extensions.identification.measurement import Measurement
from laufruhe.files.complaints import errors_in_file
from laufruhe.files.reader import display_path, load_tables, tables_of
from laufruhe.present.numbers import DASH, number
from laufruhe.present.tables import Table
from laufruhe.problem.problem import Problem
from laufruhe.report import files
from laufruhe.report.document import Block, Bullets, Document, Heading, Paragraph, reproduction, sources
from laufruhe.report.screen import show_document
from laufruhe.report.strict_json import strict, versions
from laufruhe.report.table_files import write_csv
from laufruhe.report.web_page import write_pages
from laufruhe.units import readable, readable_unbalance, shown_in

if TYPE_CHECKING:
    import pandas as pd

NUMBERS, IDENTIFIED = "estimates.csv", "identified.toml"
NAMES = (files.REPORT, files.PAGE, files.RESULT, NUMBERS, IDENTIFIED)
_MUCH = 0.1
"""Unexplained share above which the report warns."""


@dataclass(frozen=True, eq=False)
class Identification:
    """Estimates of the open numbers of a problem from its measurements."""

    problem: Problem
    measurements: Sequence[Measurement]
    answer: Estimate

    @property
    def numbers(self) -> pd.DataFrame:
        """Estimates in SI units by name: estimate, ends of the confidence interval, unit and remark."""
        import pandas as pd

        table = _table(self.answer, is_readable=False)
        return pd.DataFrame(table.rows, columns=list(table.head)).set_index(table.head[0])

    @property
    def unexplained(self) -> Mapping[str, float]:
        """Share of each measurement that the estimates leave unexplained, by its file."""
        return dict(zip((m.name for m in self.measurements), self.answer.unexplained, strict=True))

    @property
    def identified(self) -> Problem:
        """Problem with its open numbers fixed at their estimates, and their uncertainty as tolerances."""
        return with_estimates(self.problem, self.answer)

    def to_json(self) -> str:
        """Return the estimates as `result.json` has them."""
        return as_json(self.problem, self.measurements, self.answer)

    def __repr__(self) -> str:
        return f"<Identification {self.problem.name}\n{self.numbers}>"


def identify(problem: Problem, say: Callable[[str], None] = lambda _: None) -> Identification:
    """Return the estimates of the open numbers of a problem from its [[measurements]]; `say` reports steps."""
    origin = problem.origin
    rows = origin.tables.get(MEASUREMENTS.name) if origin is not None else None
    source = Path("problem") if origin is None else origin.path
    if not rows:
        remedy = 'add [[measurements]] with file = "orders.csv"'
        raise refused(MEASUREMENTS.name, "", "is missing, so there is nothing to identify numbers from", remedy, source)
    with errors_in_file(source):
        tables = [MeasurementTable.model_validate(table) for table in rows]
        measurements = measurements_of(problem, tables, source.parent)
        return Identification(problem, measurements, estimate(measurements, say))


def identified(path: Path, out: Path | None, say: Callable[[str], None]) -> tuple[Output, Callable[[], str]]:
    """Estimate the open numbers of a file and write the results; `say` reports steps.

    Return a function that shows the report, and one that returns JSON.
    """
    say("reading the file")
    source = display_path(path)
    identification = identify(load_tables(tables_of(path), source), say)
    problem, measurements = identification.problem, identification.measurements
    folder = out or Path("results") / f"{source.stem}-identify"
    option = "results" if out is None else "--out"
    with files.staged(files.FileSet(folder, option, "identify", NAMES)) as stage:
        with shown_in(dict(problem.shown_units)):
            document = Document(problem.title, tuple(_blocks(problem, measurements, identification.answer, str(path))))
        text = identification.to_json()
        write_csv(_table(identification.answer, is_readable=False), stage / NUMBERS)
        files.write(stage / files.RESULT, text)
        write_pages(stage, document, {}, ".svg")
        files.write(stage / IDENTIFIED, identification.identified.to_toml())
    return lambda stream: show_document(document, stream, folder, files.PAGE), lambda: text


def with_estimates(problem: Problem, answer: Estimate) -> Problem:
    """Return the problem with its open numbers fixed at their estimates.

    Sizes have their tolerance, three standard deviations, if the extension of tolerances is installed (R9).
    """
    has_tolerances = is_installed("robust")
    for domain in answer.domains:
        name, unit, parts = domain.decision.name, domain.decision.unit, answer.polar(domain)
        if domain.width == 2:
            problem = problem.fix(name, domain.complex_value(answer.values))
        size = parts[0][0]
        # a turn of an unbalance is as large an error as this size across it
        deviation = max(parts[0][1], size * parts[-1][1]) if domain.width == 2 else parts[0][1]
        text = f"{size!r} {unit}".strip()
        # a tolerance of the whole size has no meaning
        is_known = 3.0 * deviation < abs(size) and not np.any(answer.at_bounds[domain.columns])
        if has_tolerances and is_known:
            text = f"{text} ± {3.0 * deviation:.3g} {unit}".strip() + " normal batch"
        problem = problem.with_values({name: text}) if domain.width == 2 else problem.fix(name, text)
    return problem


def _blocks(problem: Problem, measurements: Sequence[Measurement], answer: Estimate, path: str) -> Iterator[Block]:
    yield from sources(problem.source, problem.assumptions)
    yield Heading("Identified numbers")
    yield _table(answer, is_readable=True)
    yield Paragraph(_minimum(answer))
    names = _column_names(answer)
    if len(answer.directions):
        yield Bullets(
            "The measurement does not determine these numbers. Each line is a change of several numbers together "
            "that leaves the computed orders as they are; measure other places or speeds, or a run with a trial "
            "weight:",
            tuple(_direction(row, names) for row in answer.directions),
        )
    yield Heading("What the numbers explain")
    yield _measurement_table(measurements, answer)
    if (worst := max(answer.unexplained)) > _MUCH:
        yield Paragraph(
            f"{number(100.0 * worst, 3)} % of a measurement is not explained. Check quantity, unit, rms or peak, the "
            "sense of the phase, places and speeds, or open another number. Until then the intervals have no meaning."
        )
    yield _place_table(measurements, answer)
    if answer.misfit is not None:
        yield Paragraph(_misfit(answer.misfit))
    yield from reproduction(typed("laufruhe", "identify", path))


def _minimum(answer: Estimate) -> str:
    share = f"{CONFIDENCE:.0%}".replace("%", " %")
    noise = "the stated deviations" if math.isinf(answer.freedom) else "the deviation of what is unexplained"
    single = (
        "All open numbers act linearly, so the least squares have one minimum."
        if answer.is_linear
        else "The least squares were started from several points; another minimum is possible."
    )
    return f"Intervals hold the true number in {share} of such measurements, by {noise}. {single}"


def _misfit(misfit: float) -> str:
    words = f"The squares of what is unexplained are {number(misfit)} times those that the deviation leads to expect."
    return words if misfit < 2.0 else f"{words} The model or the deviation is wrong."


def _column_names(answer: Estimate) -> list[str]:
    return [
        name
        for d in answer.domains
        for name in (
            (d.decision.name,) if d.width == 1 else (f"{d.decision.name} at 0 deg", f"{d.decision.name} at 90 deg")
        )
    ]


def _direction(row: np.ndarray[Any, Any], names: Sequence[str]) -> str:
    parts = [(share, name) for share, name in zip(row, names, strict=True) if abs(share) > LARGE]
    if len(parts) == 1:
        return f"{parts[0][1]} alone"
    sign = math.copysign(1.0, parts[0][0])
    return ", ".join(f"{name} {100.0 * sign * share:+.0f} %" for share, name in parts) + " of their ranges"


def _lines(answer: Estimate) -> Iterator[tuple[str, str, float, float, str]]:
    for domain in answer.domains:
        decision, parts = domain.decision, answer.polar(domain)
        is_bounded = bool(np.any(answer.at_bounds[domain.columns]))
        for name, unit, (value, deviation) in zip(
            (decision.name, decision.angle_name), (decision.unit, "rad"), parts, strict=False
        ):
            status = "at a bound" if is_bounded else "" if math.isfinite(deviation) else "not determined"
            yield name, unit, value, deviation, status


def _table(answer: Estimate, *, is_readable: bool) -> Table:
    """Return the estimates, in readable or in SI units."""
    rows = []
    for name, si_unit, value, deviation, status in _lines(answer):
        of_unit = readable_unbalance(abs(value)) if si_unit == "kg m" else readable(si_unit)
        unit, factor = of_unit if is_readable else (si_unit, 1.0)
        half = answer.half_width * deviation
        ends = (None, None) if status else (factor * (value - half), factor * (value + half))
        cells = (None if status == "not determined" else factor * value, *ends)
        texts = [DASH if x is None else number(x, 5) for x in cells]
        rows.append((name, *(texts if is_readable else cells), unit, status or DASH))
    head = ("number", "estimate", "from", "to", "unit", "remark")
    return Table(head, rows, left=(0, 4, 5))


def _measurement_table(measurements: Sequence[Measurement], answer: Estimate) -> Table:
    rows = [
        (m.name, m.channel.name, f"{int(m.mask.sum())}", number(factor * deviation), unit,
         number(100.0 * share, 3))
        for m, deviation, share in zip(measurements, answer.deviations, answer.unexplained, strict=True)
        for unit, factor in (readable(m.channel.unit),)
    ]  # fmt: skip
    head = ("file", "quantity", "amplitudes", "deviation", "unit", "unexplained [%]")
    note = "Deviation of the real and of the imaginary part. Unexplained: root mean square of measured less computed."
    return Table(head, rows, left=(0, 1, 4), note=note)


def _place_table(measurements: Sequence[Measurement], answer: Estimate) -> Table:
    rows = []
    for m, rest in zip(measurements, answer.residuals, strict=True):
        unit, factor = readable(m.channel.unit)
        for j, i in zip(*np.nonzero(m.mask.any(axis=0)), strict=True):
            sizes = [float(np.sqrt(np.nanmean(np.abs(part[:, j, i]) ** 2))) for part in (m.values, rest)]
            rows.append((m.name, m.column_names[j][i], number(factor * sizes[0]), number(factor * sizes[1]), unit))
    head = ("file", "place and direction", "measured", "unexplained", "unit")
    return Table(head, rows, left=(0, 1, 4), note="Root mean square over the rows of the file.")


def as_json(problem: Problem, measurements: Sequence[Measurement], answer: Estimate) -> str:
    """Return the result as JSON in SI units; angles in rad."""
    return strict({
        "title": problem.title,
        "versions": versions(),
        "confidence": CONFIDENCE,
        "numbers": [
            {"name": name, "unit": unit, "estimate": value, "deviation": deviation if not status else None,
             "half_width": answer.half_width * deviation if not status else None, "remark": status or None}
            for name, unit, value, deviation, status in _lines(answer)
        ],
        "columns": _column_names(answer),
        "covariance": [[x if math.isfinite(x) else None for x in row] for row in answer.covariance.tolist()],
        "undetermined": answer.directions.tolist(),
        "measurements": [
            {"file": m.name, "quantity": m.channel.name, "amplitudes": int(m.mask.sum()),
             "deviation": deviation, "unexplained": share}
            for m, deviation, share in zip(measurements, answer.deviations, answer.unexplained, strict=True)
        ],
        "misfit": answer.misfit,
        "linear": answer.is_linear,
    })  # fmt: skip
