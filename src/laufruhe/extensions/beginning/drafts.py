"""Drafts of problem files: the usual tables with comments about what to change."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from laufruhe import units
from laufruhe.files.catalogue import engine_named
from laufruhe.files.reader import load_tables
from laufruhe.files.ready import schema_line
from laufruhe.files.toml_text import toml_text, toml_value
from laufruhe.machine import Engine, OperatingPoint
from laufruhe.numerics.spectrum import order_amplitude
from laufruhe.physics.shaking_loads import shaking_loads

SPEED = "3000 rpm"
_ASIDE = 0.25
_OVERHANG = 0.1
# smallest fraction of one cylinder's force, or of its moment about the middle, at which balancing an order pays
_WORTH = 0.02
_FORCE, _COUPLE = slice(3), slice(4, 6)
_GAS = """\
# [gas]                         # pressure on the pistons; it acts on the roll moment alone
# model = "seiliger"
# imep = "9 bar"                # indicated mean effective pressure
# peak_pressure = "70 bar"
"""
_HEAD = """\
{schema}
# Numbers with a dimension are text with a unit: "120 mm", "1.25 kg", "2500 rpm"; bare ones are degrees or plain.
# A number is left open, to be decided, as {{ between = [low, high] }}; start = value says where it stands now.
# laufruhe check FILE validates, laufruhe solve FILE decides, laufruhe evaluate FILE evaluates the initial design.

title = {title}
{engine}
[[operating_points]]            # several may follow, each with a name and a weight
speed = "{speed}"

{gas}

[mounts]                        # assumed: put yours here; x forward from the middle of the crank, y left, z up
names = ["front left", "front right", "rear left", "rear right"]
positions = [
{mounts}
]

{balance}
[objective]
minimise = "mean mount force"   # or "maximum mount force", "rms shaking force" ...
alternating = true              # without the steady reaction to the mean torque, which no weight can balance

# [[constraints]]
# limit = "maximum mount force"
# max = "900 N"
"""


def draft_of_engine(name: str) -> str:
    """Return the text of a draft problem file for a catalogue engine; raise `Refused` if no engine has this name."""
    entry = engine_named(name, "engine")
    lines = {key: f"# {key} = {toml_value(value)}" for key, value in entry.engine.items()}
    published = [line for key, line in lines.items() if key not in entry.assumed]
    assumed = [line for key, line in lines.items() if key in entry.assumed]
    table = "\n".join([
        "", f"# Published: {entry.source}.", *([f"# {entry.note}"] if entry.note else []),
        "[engine]", f'catalogue = "{entry.key}"',
        "# What it takes from there; without its #, a line takes the place of the catalogue's.", *published,
        "# Assumed, for no source gives them; the report says so until you put your own:", *assumed, "",
    ])  # fmt: skip
    tables = {"title": entry.name, "engine": dict(entry.engine), "operating_points": [{"speed": SPEED}]}
    return _draft(entry.name, table, load_tables(tables, Path(name)).engine)


def draft_of_tables(tables: Mapping[str, Any], path: Path) -> str:
    """Return the text of a draft with these tables; raise `InputError` for the file if the engine cannot exist."""
    (point,) = tables["operating_points"]
    head = {key: tables[key] for key in ("assumptions", "engine") if key in tables}
    gas = toml_text({"gas": tables["gas"]}) if "gas" in tables else _GAS
    engine = load_tables(tables, path).engine
    return _draft(tables["title"], f"{toml_text(head)}", engine, point["speed"], gas)


def _draft(title: str, engine: str, built_engine: Engine, speed: str = SPEED, gas: str = _GAS) -> str:
    half = max(abs(part.x) for part in built_engine.slider_cranks) + _OVERHANG
    places = [(x, y) for x in (half, -half) for y in (_ASIDE, -_ASIDE)]
    mounts = "\n".join(f'    ["{1e3 * x:g} mm", "{1e3 * y:g} mm", "0 mm"],' for x, y in places)
    return _HEAD.format(
        schema=schema_line(), title=toml_value(title), engine=engine, speed=speed, gas=gas.rstrip(), mounts=mounts,
        balance=_balance(built_engine, speed),
    )  # fmt: skip


def _balance(engine: Engine, speed_text: str) -> str:
    """Return the lines with counterweights and balancer shafts that may balance free forces and couples.

    Free forces and couples are those of first and second order without the roll moment. Small ones get no
    counterweight or balancer shaft. What turns with the crank gets counterweights, what turns against it a shaft.
    """
    parts, speed = engine.slider_cranks, units.parse(speed_text, "rad/s")
    wrench = shaking_loads(engine, OperatingPoint(speed_text, speed))
    moments = [(part.reciprocating_mass + part.rotating_mass) * part.crank_radius for part in parts]
    half, moment = max(abs(part.x) for part in parts), sum(moments)
    scales = np.array([1.0, half or 0.1]) * max(moments) * speed**2
    loads = [np.array([order_amplitude(wrench.at(order)[axes]) for axes in (_FORCE, _COUPLE)]) for order in (1, 2)]
    # half the amplitude that turns against the crank (C4); a couple about y and z turns as a force along z and -y
    first = wrench.at(1)
    against = 0.5 * np.abs([first[2] - 1j * first[1], first[4] + 1j * first[5]])
    is_large = [bool(np.any(load > _WORTH * scales)) for load in loads]
    free = [np.where(load < 1e-9 * scales, 0.0, load) for load in loads]
    texts = (f"order {order}: force {load[0]:.4g} N, couple {load[1]:.4g} N m" for order, load in enumerate(free, 1))
    lines = [f"# Free at {speed_text}: {'; '.join(texts)}."]
    if is_large[0]:
        lines += _webs(half, moment)
    ratio = max(part.rod_ratio for part in parts)
    places = (("front", half), ("rear", -half)) if half else (("middle", 0.0),)
    if np.any(against > _WORTH * scales):
        lines += ["# a shaft at crank speed, against the crank"]
        lines += _shaft("balancer", -1, 100, 0, places, 0.5 * moment)
    elif is_large[1]:
        lines += ["# two shafts at twice crank speed, against each other"]
        for name, turns, y in (("left", 2, 100), ("right", -2, -100)):
            lines += _shaft(name, turns, y, -100, places, 0.25 * ratio * moment)
    if not any(is_large):
        lines += ["# Nothing of first or second order is left to balance; weights are shown as an example."]
        lines += _webs(half, moment)
    return "\n".join(lines) + "\n"


def _shaft(name: str, ratio: int, y: int, z: int, places: Sequence[tuple[str, float]], moment: float) -> list[str]:
    lines = ["[[balancer_shafts]]", f'name = "{name}"', f"ratio = {ratio}"]
    lines += [f'position = ["{y} mm", "{z} mm"]   # y, z']
    for place, x in places:
        lines += ["[[balancer_shafts.unbalances]]", f'name = "{place}"', f'x = "{1e3 * x:g} mm"', *_open(moment)]
    return [*lines, ""]


def _webs(half: float, moment: float) -> list[str]:
    lines = ["# weights that turn with the crank"]
    for name, x in (("front", half), ("rear", -half)) if half else (("web", 0.0),):
        lines += ["[[counterweights]]", f'name = "{name}"', f'x = "{1e3 * x:g} mm"', *_open(moment), ""]
    return lines


def _open(moment: float) -> list[str]:
    size = f"{10.0 ** math.ceil(math.log10(moment)):.6g}" if moment else "1"
    upper = next(f"{step * float(size) / 10.0:.6g}" for step in (1, 2, 5, 10) if step * float(size) / 10.0 >= moment)
    return [f'unbalance = {{ between = ["0 kg m", "{upper} kg m"] }}', "angle = { between = [0, 360] }"]
