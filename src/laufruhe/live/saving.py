"""Problem file of the displayed design, with placeholders for the numbers of the sliders."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from laufruhe.errors import InputError
from laufruhe.files import edits
from laufruhe.files.complaints import Refused
from laufruhe.files.nested import texts_in
from laufruhe.files.reader import load_tables, tables_and_path
from laufruhe.files.toml_text import toml_text
from laufruhe.machine import Engine
from laufruhe.problem.decision import Decision
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.solvers.prices import angle_name
from laufruhe.solvers.result import Result

SEARCHED = ("phasing", "robust", "search", "assembly")
"""Tables that say how something open is decided."""
SAME = 1e-9


@dataclass(frozen=True)
class Saved:
    """A problem file with placeholders for numbers.

    Attributes
    ----------
    text
        TOML, each place a text "@name@"; empty where there is none.
    numbers
        Placeholder, name in results and SI unit of every number.
    note
        Files needed in addition to it, or the reason for having no file.
    """

    text: str = ""
    numbers: tuple[tuple[str, str, str], ...] = ()
    note: str = "The problem was made in code, so there is no file to save."


NOT_SAVED = Saved()


def saved_file(problem: Problem, result: Result, moving: Problem, values: Mapping[str, Value]) -> Saved:
    """Return the file of a design with placeholders for moving decisions; empty if it would not read back."""
    if problem.origin is None:
        return NOT_SAVED
    tables, path = problem.origin.tables, problem.origin.path
    marks = _marks(moving.decisions)
    try:
        tables = _fixed(dict(tables), result, values)
        for mark, name, _ in marks:
            tables = edits.fix_number(tables, name, mark)
        text = toml_text({key: table for key, table in tables.items() if key not in SEARCHED})
        filled = _filled(text, marks, moving)
        read = load_tables(tables_and_path(filled)[0], path)
    except (Refused, InputError) as error:
        return Saved(note=f"This design cannot be written as a problem file: {error}.")
    if not _equal_engines(read.engine, moving.engine) or read.fidelity != moving.fidelity:
        return Saved(note="This design cannot be written as a problem file that gives the same engine.")
    files = sorted({text for _, text in texts_in(tables) if text.endswith(".csv")})
    note = f"Save it in the folder of {' and '.join(files)}." if files else ""
    return Saved(text, marks, note)


def _marks(decisions: Sequence[Decision]) -> tuple[tuple[str, str, str], ...]:
    marks = []
    for decision in decisions:
        marks.append((f"@{decision.name}@", decision.name, decision.unit))
        if decision.set.width > 1:
            name = angle_name(decision)
            marks.append((f"@{name}@", name, "rad"))
    return tuple(marks)


def _filled(text: str, marks: Sequence[tuple[str, str, str]], moving: Problem) -> str:
    numbers: dict[str, float] = {}
    for decision in moving.decisions:
        numbers[decision.name], numbers[angle_name(decision)] = decision.set.split(decision.start)
    for mark, name, unit in marks:
        text = text.replace(toml_text({"k": mark})[4:-1], file_number(numbers[name], unit))
    return text


def file_number(value: float, unit: str) -> str:
    """Return a number as a problem file writes it, in full precision."""
    if unit in ("", "rad"):
        return repr(math.degrees(value) if unit else float(value))
    return f'"{float(value)!r} {unit}"'


def _fixed(tables: dict[str, Any], result: Result, values: Mapping[str, Value]) -> dict[str, Any]:
    for decision in result.problem.decisions:
        if not decision.is_affine:
            number = float(values[decision.name].real)
            text = number if decision.unit == "" else f"{number!r} {decision.unit}"
            tables = edits.fix_number(tables, decision.name, math.degrees(number) if decision.unit == "rad" else text)
    return tables if result.problem.phasing is None else _with_star(tables, result)


def _with_star(tables: dict[str, Any], result: Result) -> dict[str, Any]:
    decided = {entry.name: entry.value for entry in result.decisions}
    throws = [math.degrees(decided[name]) for k in range(len(decided)) if (name := f"throw {k + 1}") in decided]
    star: dict[str, Any] = {"throws": throws} if throws and "throws" in tables["engine"] else {}
    for name in ("bank angle", "split pin angle"):
        if name in decided:
            star[name.replace(" ", "_")] = math.degrees(decided[name])
    parts = result.final.engine.cylinders
    if throws or tables["engine"].get("firing_order") == "open":
        star["firing_order"] = [k + 1 for k in sorted(range(len(parts)), key=lambda k: parts[k].firing_angle)]
    gone = [name.removesuffix(" built") for name, value in decided.items() if name.endswith(" built") and not value]
    return edits.with_star(tables, star, gone)


def _equal_engines(engine: Engine, other_engine: Engine) -> bool:
    numbers, other_numbers = map(_numbers, (engine, other_engine))
    return numbers.shape == other_numbers.shape and bool(
        np.all(np.abs(numbers - other_numbers) <= SAME * (1.0 + np.abs(numbers)))
    )


def _numbers(engine: Engine) -> np.ndarray:
    parts = [
        (np.cos(p.throw), np.sin(p.throw), np.cos(0.5 * p.firing_angle), np.sin(0.5 * p.firing_angle), p.x,
         p.reciprocating_mass)
        for p in engine.slider_cranks
    ]  # fmt: skip
    rotors = [(r.unbalance.real, r.unbalance.imag, r.shaft.ratio, *r.place) for r in engine.rotors]
    mounts = [(*mount.position, *mount.stiffness) for mount in engine.mounts]
    return np.array([number for row in (*parts, *rotors, *mounts) for number in row])
