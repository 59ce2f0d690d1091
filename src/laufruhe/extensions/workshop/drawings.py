"""Files of drawings: every body of a result as SVG, PNG and DXF."""

from __future__ import annotations

import re
from pathlib import Path

from laufruhe.errors import refused
from laufruhe.extensions.workshop.dxf import library, write_dxf
from laufruhe.extensions.workshop.part import Workshop, weights_of
from laufruhe.extensions.workshop.picture import figure_of
from laufruhe.extensions.workshop.sheet import sheet_of
from laufruhe.files.reader import display_path, load
from laufruhe.plots.letters import prepare
from laufruhe.plots.style import save_and_show
from laufruhe.problem.problem import Problem
from laufruhe.solvers.result import Result

_UNSAFE = re.compile(r"[^\w.-]+")


def problem_with_bodies(path: Path) -> Problem:
    """Return the problem of a file; raise InputError if no weight has a body, or DXF files cannot be written."""
    library()
    problem = load(path)
    if problem.engine.extra(Workshop) is None:
        rule, remedy = "is in no counterweight and no unbalance of a shaft", "describe a weight by its body"
        raise refused("body", "", rule, remedy, display_path(path))
    return problem


def write_drawings(result: Result, folder: Path) -> list[str]:
    """Write a drawing of every body of the final design in three formats; return their names without endings."""
    engine, names = result.final.engine, list[str]()
    prepare((result.problem.title, result.problem.source, *(rotor.name for rotor in engine.rotors)))
    for weight in weights_of(engine):
        name = _UNSAFE.sub("-", weight.rotor.name).strip(".-") or "weight"
        while name in names:
            name += "-2"
        save_and_show(figure_of(result, [weight]), folder / name, ("svg", "png"))
        write_dxf(sheet_of(engine, weight, result.problem.title), folder / f"{name}.dxf")
        names.append(name)
    return names
