"""Questions about an engine that the user describes; each answer is checked before the next question."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import typer

from laufruhe import units
from laufruhe.errors import Complaint, InputError, ModelError, refused
from laufruhe.files.catalogue import as_text as written
from laufruhe.files.catalogue import engines
from laufruhe.files.complaints import nearest
from laufruhe.files.numbering import ALTERNATING, BY_BANK
from laufruhe.files.reader import load_tables
from laufruhe.files.trade_words import trade_value
from laufruhe.machine import Cycle
from laufruhe.machine.layouts import LAYOUTS, LayoutKind
from laufruhe.physics.gas_facts import gas_facts

Answers: TypeAlias = dict[str, Any]
"""Values by their addresses in the file, such as engine.bore; addresses without a dot are of the interview alone."""
_BACK = "<"
"""Answer that returns to the question before."""
_MOST_CYLINDERS = 24
"""Largest number in the name of an engine that counts its cylinders; larger ones are angles in degrees."""
_LEAST_RATIO, _LARGEST_RATIO = 2.5, 8.0
"""Range of rod length over crank radius; rod length over stroke is less."""
_CHOICES = {
    "engine.cycle": ("four-stroke", "two-stroke"),
    "engine.numbering": (BY_BANK, ALTERNATING),
    "engine.first_bank": ("left", "right"),
    "fuel": ("petrol", "diesel", "none"),
}
"""Answers to questions that have few of them."""
_USUAL_LAYOUTS = ("inline", "vee", "boxer")
_LAYOUT_REMEDY = "use inline, vee or boxer, or a name such as V8, flat four or 270 twin"


@dataclass(frozen=True)
class _Question:
    """Question about a number of the file.

    Attributes
    ----------
    key
        Address that the question is about.
    words
        Text of the question.
    usual
        Default answer, or a function that returns it from the answers so far; empty without one.
    read
        Function of key, typed text and answers so far that returns values by their addresses.
    applies
        Function of the answers so far that returns True if the question has a meaning.
    """

    key: str
    words: str
    usual: str | Callable[[Answers], str]
    read: Callable[[str, str, Answers], Answers]
    applies: Callable[[Answers], bool] = lambda _: True

    def default(self, answers: Answers) -> str:
        """Return the default answer."""
        return self.usual if isinstance(self.usual, str) else self.usual(answers)


class _Back(Exception):
    """Answer that returns to the question before."""


def ask_engine(layout: Answers) -> dict[str, Any]:
    """Return title, assumptions, [engine], [gas] and operating point of an engine that the user describes.

    `layout` has the answers to the first question, or is empty.
    """
    title: Answers = {"title": ask("Title", "My engine", lambda text: text or "My engine")}
    typer.echo(f"Enter takes the answer in brackets; {_BACK} returns to the question before.")
    answers, assumed = {**title, **layout}, list[str]()
    history = [(0, title, assumed)] if layout else []
    k = 0
    while k < len(_QUESTIONS):
        question = _QUESTIONS[k]
        if question.key not in answers and question.applies(answers):
            choices = _CHOICES.get(question.key, ())
            usual = _usual_in_catalogue(question, answers)
            words = f"{question.words} ({', '.join(choices)})" if choices else question.words
            try:
                values, is_usual = ask(words, usual, partial(_read, question, answers, usual))
            except _Back:
                k, answers, assumed = history.pop() if history else (k, answers, assumed)
                continue
            history.append((k, answers, assumed))
            answers = {**answers, **values}
            if is_usual and question in _SIZES:
                assumed = [*assumed, re.split(r" \[|,", question.words)[0].lower()]
        k += 1
    notes = [f"Usual values, until you put your own: {', '.join(assumed)}."] if assumed else []
    if _kind(answers).takes("bank_stagger") and "engine.bank_stagger" not in answers:
        notes.append("Opposed cylinders have no distance along the crank, until you put bank_stagger.")
    return {**_tables(answers), **({"assumptions": notes} if notes else {})}


def layout_of(text: str) -> Answers | None:
    """Return the answers in the name of a layout, such as V8, None for another text.

    Raise `InputError` if the engine is impossible.
    """
    try:
        values = _layout("engine.layout", text, {})
    except InputError:
        return None
    _check({"title": "Layout", **values})
    return values


def ask(words: str, usual: str, read: Callable[[str], Any]) -> Any:
    """Ask until `read` accepts the answer without `InputError`, and return its result.

    `usual` is the text of the default answer, for which `read` gets an empty text. Raise `InputError` if the input
    ends and is no terminal.
    """

    def typed(text: str) -> Any:
        if not sys.stdin.isatty():
            typer.echo(text if text.isprintable() else "")
        if not text.isprintable():
            raise typer.BadParameter("holds a character that is not printed; type it once more")
        try:
            # quotes belong to files
            return read(re.sub('^"(.*)"$', r"\1", text.strip()))
        except InputError as error:
            first = error.complaints[0]
            message = "; ".join(filter(None, (first.rule, first.remedy)))
            example = f"; for example {usual}" if usual and "example" not in message else ""
            raise typer.BadParameter(message + example) from None

    try:
        return typer.prompt(f"{words} [{usual}]" if usual else words, "", show_default=False, value_proc=typed)
    except typer.Abort:
        if sys.stdin.isatty():
            raise
        typer.echo()
        remedy = "answer it, or add --from with an engine or a ready problem"
        raise refused("init", "", f"asks questions, but the input ended at '{words}'", remedy) from None


def _read(question: _Question, answers: Answers, usual: str, text: str) -> tuple[Answers, bool]:
    if text == _BACK:
        raise _Back
    values = question.read(question.key, text or usual, answers)
    try:
        _check({**answers, **values})
    except InputError as error:
        # a complaint about another key names it
        first = error.complaints[0]
        key = "" if re.sub(r"\[\d+\]", "", first.where) in values else f"{first.where}: "
        raise refused(first.where, first.value, f"{key}{first.rule}", first.remedy) from None
    return values, not text


def _tables(answers: Answers) -> dict[str, Any]:
    # the tables of a file
    tables: dict[str, Any] = {"title": answers["title"], "engine": {}}
    for key, value in answers.items():
        table, dot, name = key.partition(".")
        # an empty list is the answer that there is none
        if dot and value != []:
            tables.setdefault(table, {})[name] = value
    return {**tables, "operating_points": [tables["operating_points"]]}


def _check(answers: Answers) -> None:
    """Raise `InputError` for impossible answers; later questions have their default answers."""
    completed = dict(answers)
    for question in _QUESTIONS:
        usual = question.default(completed) if question.key not in completed and question.applies(completed) else ""
        if usual:
            completed |= question.read(question.key, usual, completed)
    if "engine.firing_order" not in answers:
        # intervals lie between the cylinders of the order
        completed.pop("engine.firing_intervals", None)
    try:
        problem = load_tables(_tables(completed), Path("laufruhe"))
        if "gas.peak_pressure" in answers:
            gas_facts(problem.engine, problem.points[0])
    except ModelError as error:
        raise InputError("laufruhe", (Complaint.from_error(error, "gas"),)) from None
    except InputError as error:
        # missing keys may be answered later
        later = {question.key for question in _QUESTIONS if question.key not in answers}
        blamed = [complaint for complaint in error.complaints if complaint.where not in later]
        if blamed:
            raise InputError(error.source, tuple(blamed)) from None


def _usual_in_catalogue(question: _Question, answers: Answers) -> str:
    """Return the answer of the first possible engine of the catalogue for numbering and order, or the usual one."""
    usual, name = question.default(answers), question.key.removeprefix("engine.")
    if name not in ("numbering", "first_bank", "firing_order"):
        return usual
    defaults = {"numbering": BY_BANK, "first_bank": "left"}
    numbers = {key: answers[f"engine.{key}"] for key in defaults if f"engine.{key}" in answers}
    for engine in (entry.engine for entry in engines().values()):
        is_alike = engine["layout"] == answers["engine.layout"] and _count(answers) == len(
            engine.get("firing_order", ())
        )
        value = engine.get(name, usual)
        if is_alike and value and all(engine.get(key, defaults[key]) == answer for key, answer in numbers.items()):
            with suppress(InputError):
                _check({**answers, question.key: value})
                return written(value) if isinstance(value, list) or value in _CHOICES[question.key] else usual
    return usual


def _value(text: str) -> int | float | str:
    for read in (int, float):
        with suppress(ValueError):
            return read(text)
    return text


def _number(key: str, text: str, _: Answers) -> Answers:
    return {key: _value(text)}


def _angle(key: str, text: str, _: Answers) -> Answers:
    # degrees, with or without their unit
    value = _value(text)
    angle = _parsed(text if isinstance(value, str) else f"{text} deg", "rad", key)
    return {key: round(math.degrees(angle), 9) if isinstance(value, str) else value}


def _choice(key: str, text: str, _: Answers) -> Answers:
    choices = _CHOICES[key]
    value = trade_value(key.removeprefix("engine."), text)
    if value not in choices:
        raise refused(key, text, "is none of these", nearest(text, choices))
    return {key: value}


def _layout(key: str, text: str, _: Answers) -> Answers:
    """Return layout, cylinders and angle of an engine such as V8, flat four or 270 twin.

    The angle of a vee is that of its banks, and that of other layouts is the first firing interval.
    """
    layouts, counts, angles = list[str](), list[int](), list[int]()
    # an L twin is a vee of 90 degrees, and an L4 is in line
    plain = re.sub("-?(zylinder|cyl\\w*)", " ", text.lower())
    plain = re.sub("reihen-?", "inline ", re.sub(r"\bl[ -]?twin", "90° vee twin", plain))
    for word, degrees in re.findall(r"(\d+|[^\W\d_]+)[\s-]*(°|deg(?:rees?)?\b|grad\b)?", plain):
        layout = trade_value("layout", word)
        # a Sechser has six
        count = trade_value("cylinders", word) or trade_value("cylinders", word.removesuffix("er"))
        if word.isdigit():
            (angles if degrees or int(word) > _MOST_CYLINDERS else counts).append(int(word))
        elif layout in _USUAL_LAYOUTS:
            layouts.append(layout)
        elif count:
            counts.append(int(count))
        else:
            raise refused(key, text, "is no layout", f"{_LAYOUT_REMEDY}; other layouts: laufruhe examples")
    if (not layouts and not counts) or len(set(layouts)) > 1 or len(counts) > 1 or len(angles) > 1:
        raise refused(key, text, "is not one layout", _LAYOUT_REMEDY)
    layout = layouts[0] if layouts else "inline"
    if angles and LAYOUTS[layout].banks == 1 and counts != [2]:
        raise refused(key, text, "has an angle, as only a vee, a boxer or a twin has", _LAYOUT_REMEDY)
    angle = "engine.bank_angle" if LAYOUTS[layout].takes("bank_angle") else "first interval"
    named = {"engine.cylinders": counts, angle: angles}
    return {key: layout, **{name: numbers[0] for name, numbers in named.items() if numbers}}


def _intervals(key: str, text: str, answers: Answers) -> Answers:
    """Return the firing intervals; the last one may be left out, as in 270 for 270-450, and even ones are none."""
    numbers = [_value(part) for part in re.split(r"[-,;\s]+", text.lower().replace("deg", "")) if part]
    if numbers and numbers[0] in ("even", "gleichmäßig", "gleichmässig", "gleich"):
        return {key: []}
    degrees = [number for number in numbers if not isinstance(number, str)]
    cycle = 720.0 if answers["engine.cycle"] == str(Cycle.FOUR_STROKE) else 360.0
    if len(degrees) == _count(answers) - 1:
        degrees.append(_value(f"{cycle - sum(degrees):g}"))  # type: ignore[arg-type]
    is_whole = len(numbers) <= len(degrees) == _count(answers) and abs(sum(degrees) - cycle) <= 1e-6
    if not is_whole or min(degrees) < 0.0:
        rule = f"does not divide the {cycle:g} deg of a cycle into {_count(answers)} intervals"
        raise refused(key, text, rule, "write even, or angles such as 270-450")
    return {key: [] if len(set(degrees)) == 1 else degrees}


def _order(key: str, text: str, answers: Answers) -> Answers:
    if text in ("", "-"):
        # throws take the place of firing intervals
        return {key: [], "engine.firing_intervals": []}
    listed = "-".join(text) if text.isdigit() and len(text) == _count(answers) else text
    numbers = [_value(part) for part in re.split(r"[-,;\s]+", listed)]
    if not all(isinstance(number, int) and 1 <= number <= _count(answers) for number in numbers):
        rule = f"is no order of the cylinders 1 to {_count(answers)}"
        raise refused(key, text, rule, f"write their numbers as they fire, or {_BACK} to change the answer before")
    return {key: numbers}


def _throws(key: str, text: str, _: Answers) -> Answers:
    if not text:
        raise refused(key, text, "is empty", f"write an angle for each throw, or {_BACK} to enter a firing order")
    return {key: [_value(part) for part in re.split(r"[,;\s]+", text) if part]}


def _rod(key: str, text: str, _: Answers) -> Answers:
    # a length, or either ratio of rod length and crank radius
    number = _value(re.sub(r"^((l ?/ ?r|r ?/ ?l|lambda)[ =:]*)?(1 ?[:/] ?)?", "", text.lower()))
    if isinstance(number, str):
        return {"engine.rod_length": text}
    if 1.0 < number < _LEAST_RATIO or number > _LARGEST_RATIO:
        rule = "has no unit, and is no usual ratio of rod length and crank radius"
        raise refused(key, text, rule, "write for example 140 mm, l/r 3.5 or lambda 0.286")
    return {key: round(1.0 / number, 6) if number > 1.0 else number}


def _mass(key: str, text: str, _: Answers) -> Answers:
    return {key: _parsed(text, "kg", key)}


def _small_end(key: str, text: str, answers: Answers) -> Answers:
    # the small end is a mass, or a share of the rod
    rod = answers["rod mass"]
    small = rod * _parsed(text, "", key) if re.fullmatch(r"[\d./ ]+%?", text) else _parsed(text, "kg", key)
    if not 0.0 <= small <= rod:
        rule = f"is not between zero and the {rod:g} kg of the rod"
        raise refused(key, text, rule, "write for example 1/3, 30 % or 0.15 kg")
    # a throw carries the big ends of all its rods; on split pins they stand to either side of its middle
    half_split = math.radians(float(answers.get("engine.split_pin_angle", 0.0))) / 2.0
    big_ends = _kind(answers).cylinders_per_throw * math.cos(half_split) * (rod - small)
    masses = {"reciprocating_mass": answers["piston mass"] + small, "rotating_mass": big_ends}
    return {"small end": small, **{f"engine.{name}": f"{mass:.6g} kg" for name, mass in masses.items()}}


def _parsed(text: str, unit: str, key: str) -> float:
    try:
        return units.parse(text, unit)
    except units.UnitError as error:
        rule, _, remedy = str(error).partition("; ")
        raise refused(key, text, rule, remedy) from None


def _fuel(key: str, text: str, answers: Answers) -> Answers:
    fuel = _choice(key, text, answers)
    return fuel if fuel[key] == "none" else {**fuel, "gas.model": "seiliger"}


def _count(answers: Answers) -> int:
    count = answers.get("engine.cylinders")
    return count if isinstance(count, int) else 1


def _kind(answers: Answers) -> LayoutKind:
    return LAYOUTS[answers["engine.layout"]]


def _has_banks(answers: Answers) -> bool:
    return _kind(answers).banks > 1


def _is_vee(answers: Answers) -> bool:
    return _kind(answers).takes("bank_angle")


def _has_throws(answers: Answers) -> bool:
    return _count(answers) > _kind(answers).cylinders_per_throw


def _length(answers: Answers, key: str) -> float:
    # the reader refuses an impossible length
    with suppress(units.UnitError):
        length = units.parse(str(answers.get(f"engine.{key}", "")), "m")
        return length if length > 0.0 else 0.08
    return 0.08


def _scaled_mass(factor: float) -> Callable[[Answers], str]:
    # kg for each litre of a cylinder, half as much more in a diesel
    def usual(answers: Answers) -> str:
        litres = 250.0 * math.pi * _length(answers, "bore") ** 2 * _length(answers, "stroke")
        return _rounded(factor * litres * (1.5 if answers.get("fuel") == "diesel" else 1.0), "kg")

    return usual


def _usual_speed(answers: Answers) -> str:
    # mean piston speed of usual engines at work
    return _rounded(30.0 * (8.0 if answers.get("fuel") == "diesel" else 12.0) / _length(answers, "stroke"), "rpm")


def _rounded(value: float, unit: str) -> str:
    return f"{float(f'{value:.2g}'):g} {unit}"


def _of_fuel(*usual: str) -> Callable[[Answers], str]:
    # values for petrol and diesel, each for four-strokes and two-strokes
    return lambda answers: usual[2 * (answers["fuel"] == "diesel") + (answers["engine.cycle"] == "two-stroke")]


def _has_gas(answers: Answers) -> bool:
    return "gas.model" in answers


_LAYOUT = (
    _Question("engine.layout", "Layout, or a name such as V8, flat four or 270 twin", "inline", _layout),
    _Question("engine.cycle", "Cycle", "four-stroke", _choice),
    _Question("engine.cylinders", "Cylinders", "4", _number),
    _Question("fuel", "Fuel, which sets usual pressures and masses", "petrol", _fuel),
    _Question("engine.bank_angle", "Angle between the banks [deg]", "90", _angle, _is_vee),
    _Question("engine.split_pin_angle", "Split pins: angle by which the right bank's pin leads [deg]", "0", _angle,
              _is_vee),
    _Question("engine.numbering", "Numbers of the cylinders", BY_BANK, _choice, _has_banks),
    _Question("engine.first_bank", "Bank of cylinder 1, seen from the flywheel", "left", _choice,
              _has_banks),
    _Question("engine.firing_intervals", "Firing intervals [deg], even or as in 270-450",
              lambda answers: f"{answers.get('first interval', 'even')}", _intervals,
              lambda answers: _has_throws(answers) and (_is_vee(answers) or not _has_banks(answers))),
    _Question("engine.firing_order", "Firing order (or - to enter the angles of the throws)",
              lambda answers: "1-2" if _count(answers) == 2 else "", _order, _has_throws),
    _Question("engine.throws", "Angles of the throws from front to rear [deg], as in 0, 180, 180, 0", "", _throws,
              lambda answers: answers.get("engine.firing_order") == []),
    _Question("order of throws", "Firing order of these throws, or - for each cylinder at its first dead centre", "",
              lambda key, text, answers: {key: "", **_order("engine.firing_order", text, answers)},
              lambda answers: bool(answers.get("engine.throws"))),
)  # fmt: skip
_SIZES = (
    _Question("engine.bore", "Bore", "80 mm", _number),
    _Question("engine.stroke", "Stroke", lambda answers: str(answers["engine.bore"]), _number),
    _Question("engine.cylinder_spacing", "Distance between cylinders of a bank",
              lambda answers: f"{1125.0 * _length(answers, 'bore'):.3g} mm", _number,
              lambda answers: _count(answers) > _kind(answers).banks),
    # banks on common throws may lie in one plane
    _Question("engine.bank_stagger", "Distance between opposed cylinders along the crank",
              lambda answers: f"{500.0 * _length(answers, 'bore'):.3g} mm", _number,
              lambda answers: _has_banks(answers) and _kind(answers).cylinders_per_throw == 1),
    _Question("engine.rod_ratio", "Rod length, or its ratio to the crank radius as l/r 3.5 or lambda 0.286", "l/r 3.5",
              _rod, lambda answers: "engine.rod_length" not in answers),
    _Question("piston mass", "Mass of a piston with rings and pin", _scaled_mass(0.9), _mass),
    _Question("rod mass", "Mass of a connecting rod", _scaled_mass(1.2), _mass),
    _Question("small end", "Small end of the rod, its mass or share", "1/3", _small_end),
    _Question("operating_points.speed", "Speed", _usual_speed, _number),
    _Question("gas.compression_ratio", "Compression ratio", _of_fuel("10", "8", "17", "16"), _number, _has_gas),
    _Question("gas.imep", "Indicated mean pressure (imep)", _of_fuel("9 bar", "6 bar", "12 bar", "9 bar"), _number,
              _has_gas),
    _Question("gas.peak_pressure", "Peak pressure", _of_fuel("60 bar", "40 bar", "140 bar", "110 bar"), _number,
              _has_gas),
)  # fmt: skip
_QUESTIONS = _LAYOUT + _SIZES
