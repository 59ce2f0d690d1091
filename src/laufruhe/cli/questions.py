"""Questions about an engine that the user describes; each answer is checked before the next question."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import typer

from laufruhe.errors import InputError, refused
from laufruhe.files.catalogue import as_text as written
from laufruhe.files.catalogue import engines
from laufruhe.files.complaints import nearest
from laufruhe.files.drafts import engine_of_table
from laufruhe.files.numbering import ALTERNATING, BY_BANK
from laufruhe.machine.layouts import LAYOUTS

Answers: TypeAlias = Mapping[str, Any]
_LAYOUTS = ("inline", "vee", "boxer")
# separators of answers that are lists, which may be empty
_SEPARATORS = {"firing_order": r"[-,;\s]+", "throws": r"[,;\s]+"}


@dataclass(frozen=True)
class _Question:
    """Question about a key of [engine] with its default answer, and all possible answers if these are few."""

    key: str
    words: str
    usual: str = ""
    choices: tuple[str, ...] = ()


_QUESTIONS = (
    _Question("layout", "Layout", "inline", choices=_LAYOUTS),
    _Question("cycle", "Cycle", "four-stroke", choices=("four-stroke", "two-stroke")),
    _Question("cylinders", "Cylinders", "4"),
    _Question("bank_angle", "Angle between the banks [deg]", "90"),
    _Question("split_pin_angle", "Split pins: angle by which the right bank's pin leads [deg]", "0"),
    _Question("bank_stagger", "Distance between opposed cylinders along the crank", "40 mm"),
    _Question("numbering", "Numbers of the cylinders", BY_BANK, choices=(BY_BANK, ALTERNATING)),
    _Question("first_bank", "Bank of cylinder 1, seen from the flywheel", "left", choices=("left", "right")),
    _Question("firing_order", "Firing order (or - to enter the angles of the throws)"),
    _Question("throws", "Angles of the throws from front to rear [deg], as in 0, 180, 180, 0"),
    _Question("firing_order", "Firing order of these throws, or - for each cylinder at its first dead centre"),
    _Question("bore", "Bore", "80 mm"),
    _Question("stroke", "Stroke", "80 mm"),
    _Question("cylinder_spacing", "Distance between cylinders of a bank", "90 mm"),
    _Question("rod_ratio", "Crank radius over rod length", "0.3"),
    _Question("reciprocating_mass", "Reciprocating mass of a cylinder", "0.5 kg"),
)


def ask_engine() -> tuple[str, dict[str, Any]]:
    """Return title and [engine] of an engine that the user describes."""
    title: str = ask("Title", "My engine", str)
    answers: dict[str, Any] = {}
    for question in _QUESTIONS:
        if _applies(question.key, answers):
            hint, usual = f" ({', '.join(question.choices)})" if question.choices else "", question.usual
            if question.key in ("numbering", "first_bank", "firing_order"):
                usual = _usual_in_catalogue(question, answers)
            answers[question.key] = ask(f"{question.words}{hint}", usual, partial(_read, question, dict(answers)))
    return title, {key: value for key, value in answers.items() if value != []}


def ask(words: str, usual: str, read: Callable[[str], Any]) -> Any:
    """Ask until `read` accepts the answer without `InputError`, and return its result."""

    def typed(text: str) -> Any:
        if not text.isprintable():
            raise typer.BadParameter("holds a character that is not printed; type it once more")
        try:
            return read(text.strip())
        except InputError as error:
            first = error.complaints[0]
            raise typer.BadParameter("; ".join(filter(None, (first.rule, first.remedy)))) from None

    return typer.prompt(words, default=usual, show_default=bool(usual), value_proc=typed)


def _applies(key: str, answers: Answers) -> bool:
    """Return True if a key applies to the engine described so far."""
    count = answers.get("cylinders")
    if not isinstance(count, int):
        return True
    kind = LAYOUTS[answers["layout"]]
    several = count > kind.cylinders_per_throw
    unordered = answers.get("firing_order") == []
    return {
        "bank_angle": kind.takes(key),
        "split_pin_angle": kind.takes(key),
        "numbering": kind.banks > 1,
        "first_bank": kind.banks > 1,
        # banks on common throws may lie in one plane
        "bank_stagger": kind.takes(key) and kind.cylinders_per_throw == 1,
        "firing_order": several and ("firing_order" not in answers or (unordered and "throws" in answers)),
        "throws": several and unordered,
        "cylinder_spacing": count > kind.banks,
    }.get(key, True)


def _read(question: _Question, before: Answers, text: str) -> Any:
    # the answer becomes what a file has
    if question.choices and text not in question.choices:
        raise refused(question.key, text, "is none of these", nearest(text, question.choices))
    separators = _SEPARATORS.get(question.key)
    value = _value(text) if separators is None else [_value(part) for part in re.split(separators, text) if part]
    _check({**before, question.key: value})
    return value


def _value(text: str) -> int | float | str:
    for read in (int, float):
        with suppress(ValueError):
            return read(text)
    return text


def _check(answers: Answers) -> None:
    """Raise `InputError` for impossible answers; later questions have their default answers."""
    table = dict(answers)
    for question in _QUESTIONS:
        if question.usual and question.key not in table and _applies(question.key, table):
            table[question.key] = _value(question.usual)
    try:
        engine_of_table("an engine", {key: value for key, value in table.items() if value != []}, Path("laufruhe"))
    except InputError as error:
        # missing keys may be answered later
        later = {f"engine.{question.key}" for question in _QUESTIONS if question.key not in answers}
        blamed = [complaint for complaint in error.complaints if complaint.where not in later]
        if blamed:
            raise InputError(error.source, tuple(blamed)) from None


def _usual_in_catalogue(question: _Question, answers: Answers) -> str:
    """Return the answer of the first possible engine of the catalogue, or the usual one."""
    numbers = {key: answers[key] for key in ("numbering", "first_bank") if key in answers}
    usual = {other.key: other.usual for other in _QUESTIONS}
    for engine in (entry.engine for entry in engines().values()):
        is_alike = engine["layout"] == answers["layout"] and len(engine.get("firing_order", ())) == answers["cylinders"]
        value = engine.get(question.key, question.usual)
        if is_alike and value and all(engine.get(key, usual[key]) == answer for key, answer in numbers.items()):
            with suppress(InputError):
                _check({**answers, question.key: value})
                return written(value) if not question.choices or value in question.choices else question.usual
    return question.usual
