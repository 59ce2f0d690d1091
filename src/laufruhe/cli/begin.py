"""Where a user begins: a problem file to fill in, ready problems to copy, engines to start from."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any

import typer

from laufruhe import units
from laufruhe.errors import Complaint, InputError
from laufruhe.files import drafts, ready
from laufruhe.files.catalogue import CatalogueEngine, engine_named, engines
from laufruhe.files.complaints import Refused, nearest
from laufruhe.files.toml_text import toml_value
from laufruhe.machine.layouts import LAYOUTS
from laufruhe.report import files

_LAYOUTS = ("inline", "vee", "boxer")
_OWN = (
    ("cycle", "Cycle (four-stroke, two-stroke)", "four-stroke", str),
    ("cylinders", "Cylinders", "4", int),
    ("bank_angle", "Angle between the banks [deg]", "90", float),
    ("split_pin_angle", "Split pins: angle by which the right bank's pin leads [deg]", "0", float),
    ("bank_stagger", "Distance between opposed cylinders along the crank", "40 mm", str),
    ("firing_order", "Firing order", "", str),
    ("bore", "Bore", "80 mm", str),
    ("stroke", "Stroke", "80 mm", str),
    ("cylinder_spacing", "Distance between cylinders of a bank", "90 mm", str),
    ("rod_ratio", "Crank radius over rod length", "0.3", float),
    ("reciprocating_mass", "Reciprocating mass of a cylinder", "0.5 kg", str),
)
_UNITS = {"bank_stagger": "m", "bore": "m", "stroke": "m", "cylinder_spacing": "m", "reciprocating_mass": "kg"}
_OF_BANKS = ("bank_angle", "split_pin_angle", "bank_stagger")
_OF_SEVERAL = ("cylinder_spacing", "firing_order")
_ORDERS = {1: "1", 2: "1-2", 3: "1-3-2", 4: "1-3-4-2", 5: "1-2-4-5-3", 6: "1-5-3-6-2-4", 8: "1-8-6-2-7-3-4-5"}


def begun(file: Path, name: str | None) -> str:
    """Write a problem file with its schema beside it; what to say of it."""
    source = name if name is not None else _asked_for()
    texts = _texts(file, source)
    _write({file.parent / other: text for other, text in texts.items()})
    return f"{file}: ready to be changed; then: laufruhe solve {file}\n"


def _texts(file: Path, source: str | None) -> dict[str, str]:
    """Files to write, by name."""
    if source is None:
        draft = drafts.draft_of_table(*_described())
    elif source in engines():
        draft = drafts.draft_of_engine(source)
    elif source.removesuffix(".toml") in ready.ready():
        one = ready.ready_named(source)
        return {file.name if other == one.path.name else other: text for other, text in ready.copies([source]).items()}
    else:
        remedy = nearest(source, [*engines(), *ready.ready()])
        advice = remedy if remedy.startswith("did") else "laufruhe engines and laufruhe examples list them"
        raise _refused("--from", source, "is no engine and no ready problem", advice)
    return {file.name: draft, **dict([ready.schema_file()])}


def _someone_answers() -> bool:
    return sys.stdin.isatty()


def _asked_for() -> str | None:
    """What to begin from, as the user types it; None for an engine of their own."""
    if not _someone_answers():
        rule, remedy = "asks questions, and nobody is there to answer", "add --from with an engine or a ready problem"
        raise _refused("init", "", rule, remedy)
    typer.echo("An engine of the catalogue (laufruhe engines), a ready problem (laufruhe examples),")
    source: str = typer.prompt("or nothing, to describe your own", default="", show_default=False)
    return source.strip() or None


def _typed(key: str, read: Callable[[str], Any], text: str) -> Any:
    """An answer, or why it is asked again."""
    try:
        if read is not str or key in _UNITS:
            units.parse(str(text), _UNITS.get(key, ""))
        return read(text)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None


def _described() -> tuple[str, dict[str, Any]]:
    """Title and [engine] of an engine that the user describes."""
    title: str = typer.prompt("Title", default="My engine")
    table: dict[str, Any] = {"layout": typer.prompt(f"Layout ({', '.join(_LAYOUTS)})", default=_LAYOUTS[0])}
    if table["layout"] not in _LAYOUTS:
        raise _refused("layout", table["layout"], "is none of these", nearest(table["layout"], _LAYOUTS))
    kind = LAYOUTS[table["layout"]]
    for key, words, default, read in _OWN:
        throws = table.get("cylinders", 0) // kind.cylinders_per_throw
        # a place, or an order, of one throw means nothing; banks on common throws may stand in one plane
        alone = throws == 1 and (key == "firing_order" or table["cylinders"] == 1)
        shared = key == "bank_stagger" and kind.cylinders_per_throw > 1
        if (key in _OF_SEVERAL and alone) or shared or (key in _OF_BANKS and not kind.takes(key)):
            continue
        usual = _ORDERS.get(table["cylinders"], "") if key == "firing_order" else default
        table[key] = typer.prompt(words, default=usual, value_proc=partial(_typed, key, read))
    if "firing_order" not in table:
        return title, table
    numbers = [part.strip() for part in table["firing_order"].replace(",", "-").split("-")]
    if not all(number.isdecimal() for number in numbers):
        raise _refused("firing order", "-".join(numbers), "is no list of cylinders", "write for example 1-3-4-2")
    return title, {**table, "firing_order": [int(number) for number in numbers]}


def _refused(where: str, value: str, rule: str, remedy: str) -> InputError:
    return InputError("laufruhe", (Complaint(where, value, rule, remedy),))


def copied(names: Sequence[str], folder: Path) -> str:
    """Ready problems in a folder, with what they refer to; what to say of them."""
    texts = ready.copies(names)
    folder.mkdir(parents=True, exist_ok=True)
    _write({folder / name: text for name, text in texts.items()})
    return "".join(f"{folder / name}\n" for name in texts)


def _write(texts: Mapping[Path, str]) -> None:
    """All of them, or none where one would take the place of another file."""
    for path, text in texts.items():
        kept = path.name in ready.SCHEMAS
        if path.exists() and not kept and path.read_bytes() != text.encode():
            raise _refused("file", str(path), "exists already and is another", "name another place")
    for path, text in texts.items():
        files.write(path, text)


def listed() -> str:
    """Ready problems by what they are for."""
    lines = ["Copy one with: laufruhe examples NAME, or begin with it: laufruhe init --from NAME"]
    for use, group in groupby(ready.ready().values(), lambda one: one.use):
        lines += ["", use[:1].upper() + use[1:], *(f"  {one.name:42}{one.title}" for one in group)]
    return "\n".join(lines) + "\n"


def catalogue() -> str:
    """Engines by number of cylinders."""
    lines = ['In a problem file: engine = "KEY". As a file to begin with: laufruhe init --from KEY', ""]
    lines += [f"{'key':22}{'bore x stroke [mm]':>20}{'cm^3':>8}   engine"]
    lines += [_line(one) for one in sorted(engines().values(), key=lambda one: one.engine["cylinders"])]
    return "\n".join(lines) + "\n"


def _line(one: CatalogueEngine) -> str:
    size = " x ".join(str(one.engine[key]).removesuffix(" mm") for key in ("bore", "stroke"))
    return f"{one.key:22}{size:>20}{one.displacement.removesuffix(' cm^3'):>8}   {one.name}"


def described(names: Sequence[str]) -> str:
    """What the catalogue says of some engines."""
    return "\n".join(_described_one(_named(name)) for name in names)


def _named(name: str) -> CatalogueEngine:
    try:
        return engine_named(name, "engine")
    except Refused as refused:
        raise InputError("laufruhe", (refused.complaint,)) from None


def _described_one(found: CatalogueEngine) -> str:
    lines = [found.name, f"Source: {found.source}.", f"Displacement, as published: {found.displacement}."]
    lines += [found.note] if found.note else []
    for key, value in found.engine.items():
        lines.append(f"    {key} = {toml_value(value)}" + ("   # assumed" if key in found.assumed else ""))
    return "\n".join(lines) + "\n"
