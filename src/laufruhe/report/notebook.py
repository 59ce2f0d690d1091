"""Problems and results as they show themselves in a notebook."""

from __future__ import annotations

import math
from collections.abc import Iterable
from html import escape

from laufruhe.present.numbers import DASH, between, with_unit
from laufruhe.present.tables import Table
from laufruhe.problem.decision import Decision
from laufruhe.problem.problem import Problem
from laufruhe.report.sections import loads, values
from laufruhe.report.web_page import table_html
from laufruhe.report.wording import explained, headline
from laufruhe.solvers.result import Result


def result_html(result: Result) -> str:
    """Return a result as HTML: a sentence, its proof, and the tables of decisions, limits and places."""
    texts = [headline(result), *([explained(result)] if result.certificate is not None else [])]
    tables = (table for section in (values.decisions, values.limits, loads.places) for table in section(result))
    return _html(result.problem.title, texts, tables)


def problem_html(problem: Problem) -> str:
    """Return a problem as HTML: a line about the engine, the objective, and tables of decisions and limits."""
    terms = [
        f"{term.weight:g} × {term.measure.name}" if term.weight != 1.0 else term.measure.name
        for term in problem.objective
    ]
    texts = [problem.summary, *([f"Minimise {' + '.join(terms)}."] if terms else [])]
    rows = [row for decision in problem.decisions for row in _decision(decision)]
    limits = [
        [limit.name, *(_or_dash(bound, limit.measure.unit) for bound in (limit.minimum, limit.maximum))]
        for limit in problem.limits
    ]
    tables = [
        Table(("decision", "start", "bounds"), rows, title="Open numbers"),
        Table(("limit", "at least", "at most"), limits, title="Limits"),
    ]
    return _html(problem.title, texts, tables)


def _decision(decision: Decision) -> list[list[str]]:
    size, angle = decision.set.split(decision.start)
    rows = [[decision.name, with_unit(size, decision.unit), between(decision.lower, decision.upper, decision.unit)]]
    if decision.set.width > 1:
        rows.append([decision.angle_name, with_unit(angle, "rad"), between(*decision.set.angles, "rad")])
    return rows


def _or_dash(value: float, unit: str) -> str:
    return with_unit(value, unit) if math.isfinite(value) else DASH


def _html(title: str, texts: Iterable[str], tables: Iterable[Table]) -> str:
    parts = [f"<strong>{escape(title)}</strong>", *(f"<div>{escape(text)}</div>" for text in texts)]
    for table in tables:
        if table.rows:
            parts += [f"<div><em>{escape(table.title)}</em></div>", table_html(table)]
    return "\n".join(parts)
