"""Texts of problem files that tests share, and how they are changed and read."""

from __future__ import annotations

import tomllib
from pathlib import Path

from laufruhe.files.reader import load
from laufruhe.problem.problem import Problem

PROBLEMS = Path(__file__).parents[1] / "problems"
_TABLES = {path: tomllib.loads(path.read_text(encoding="utf-8")) for path in sorted(PROBLEMS.glob("*.toml"))}
# a study file is no problem
READY = [path for path, table in _TABLES.items() if "study" not in table]
ELASTIC = [path for path in READY if _TABLES[path].get("mounts", {}).get("kind") == "elastic"]

# further keys of [engine] may follow
FOUR = """
title = "Four in line"
[engine]
layout = "inline"
cycle = "four-stroke"
stroke = "120 mm"
rod_ratio = 0.26
reciprocating_mass = "1.25 kg"
cylinder_spacing = "125 mm"
firing_order = [1, 3, 4, 2]
"""
MOUNTS = """
[mounts]
positions = [
    ["300 mm", "250 mm", "0 mm"], ["300 mm", "-250 mm", "0 mm"],
    ["-1 m", "250 mm", "0 mm"], ["-1 m", "-250 mm", "0 mm"],
]
"""


def shaft(name: str, ratio: int, y: str, unbalance: str) -> str:
    """Return a balancer shaft 100 mm under the crank with one unbalance."""
    return f"""
[[balancer_shafts]]
name = "{name}"
ratio = {ratio}
position = ["{y}", "-100 mm"]
[[balancer_shafts.unbalances]]
{unbalance}
"""


def open_unbalance(upper: str = "0.05 kg m", start: str = "", at: str = "") -> str:
    """Return the text of an open size and angle, with starts if given."""
    return (
        'radius = "20 mm"\n'
        f'unbalance = {{ between = ["0 kg m", "{upper}"]{start and f", start = {start}"} }}\n'
        f"angle = {{ between = [0, 360]{at and f', start = {at}'} }}"
    )


SECOND_ORDER_SHAFTS = shaft("left", 2, "60 mm", open_unbalance()) + shaft("right", -2, "-60 mm", open_unbalance())


def written(folder: Path, text: str, name: str = "scene") -> Path:
    """Return a problem file with this text."""
    path = folder / f"{name}.toml"
    path.write_text(text, encoding="utf-8")
    return path


def loaded(folder: Path, text: str) -> Problem:
    """Return the problem of a text."""
    return load(written(folder, text))


def changed(text: str, old: str, new: str) -> str:
    """Return the text with the first of a word replaced, which has to be there."""
    assert old in text, old
    return text.replace(old, new, 1)
