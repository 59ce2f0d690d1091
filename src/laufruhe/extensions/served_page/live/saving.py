"""Problem file of the displayed design, with placeholders for the numbers of the sliders."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from laufruhe.errors import InputError
from laufruhe.files import edits
from laufruhe.files.complaints import Refused
from laufruhe.files.nested import texts_in
from laufruhe.files.reader import load_tables, tables_and_path
from laufruhe.files.toml_text import toml_text, toml_value
from laufruhe.machine import Engine
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.solvers.result import Result

SEARCHED = ("phasing", "robust", "search", "assembly")
"""Tables of a problem file that say how open numbers are decided."""
SAME = 1e-9


@dataclass(frozen=True)
class Saved:
    """Text of a problem file that a live page can save, with placeholders for the numbers of its sliders.

    Attributes
    ----------
    text
        TOML with texts "@name@" for numbers; empty without a file.
    numbers
        Placeholder, name in results and SI unit of every number.
    note
        Files needed in addition to it, or the reason for having no file.
    """

    text: str = ""
    numbers: tuple[tuple[str, str, str], ...] = ()
    note: str = "The problem was made in code, so there is no file to save."


NOT_SAVED = Saved()


def saved_file(problem: Problem, result: Result, slider_problem: Problem, values: Mapping[str, Value]) -> Saved:
    """Return the problem file of a design, with a placeholder for each number that a slider of the live page changes.

    These numbers are the decisions of `slider_problem`, a copy of the problem whose other numbers are fixed.
    The text of the file is empty if the reader of problem files would not accept it.
    """
    if problem.origin is None:
        return NOT_SAVED
    tables: Mapping[str, Any] = problem.origin.tables
    numbers, starts = list[tuple[str, str, str]](), list[float]()
    for decision in slider_problem.decisions:
        entries = ((decision.name, decision.unit), (decision.angle_name, "rad"))[: decision.set.width]
        numbers += [(f"@{name}@", name, unit) for name, unit in entries]
        starts += decision.set.split(decision.start)[: decision.set.width]
    try:
        for decision in result.problem.decisions:
            if not decision.is_affine:
                number = float(values[decision.name].real)
                value = number if decision.unit == "" else f"{number!r} {decision.unit}"
                fixed = math.degrees(number) if decision.unit == "rad" else value
                tables = edits.fix_number(tables, decision.name, fixed)
        if result.problem.phasing is not None:
            tables = _with_star(tables, result)
        for mark, name, _ in numbers:
            tables = edits.fix_number(tables, name, mark)
        filled = text = toml_text({key: table for key, table in tables.items() if key not in SEARCHED})
        for (mark, _, unit), start in zip(numbers, starts, strict=True):
            filled = filled.replace(toml_value(mark), file_number(start, unit))
        read = load_tables(tables_and_path(filled)[0], problem.origin.path)
    except (Refused, InputError) as error:
        return Saved(note=f"This design cannot be written as a problem file: {error}.")
    engine, slider_engine = _numbers(read.engine), _numbers(slider_problem.engine)
    is_same = engine.shape == slider_engine.shape and np.allclose(slider_engine, engine, SAME, SAME)
    if not is_same or read.fidelity != slider_problem.fidelity:
        return Saved(note="This design cannot be written as a problem file that gives the same engine.")
    files = sorted({text for _, text in texts_in(tables) if text.endswith(".csv")})
    note = f"Save it in the folder of {' and '.join(files)}." if files else ""
    return Saved(text, tuple(numbers), note)


def file_number(value: float, unit: str) -> str:
    """Return a number as a problem file writes it, in full precision."""
    if unit in ("", "rad"):
        return repr(math.degrees(value) if unit else float(value))
    return f'"{float(value)!r} {unit}"'


def _with_star(tables: Mapping[str, Any], result: Result) -> dict[str, Any]:
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


def _numbers(engine: Engine) -> np.ndarray:
    parts = [
        (np.cos(p.throw), np.sin(p.throw), np.cos(0.5 * p.firing_angle), np.sin(0.5 * p.firing_angle), p.x,
         p.reciprocating_mass)
        for p in engine.slider_cranks
    ]  # fmt: skip
    rotors = [(r.unbalance.real, r.unbalance.imag, r.shaft.ratio, *r.place) for r in engine.rotors]
    mounts = [(*mount.position, *mount.stiffness) for mount in engine.mounts]
    return np.array([number for row in (*parts, *rotors, *mounts) for number in row])
