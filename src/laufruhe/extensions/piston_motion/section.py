"""Report section of piston motion: stroke, speeds, accelerations, rod angle and side-force reversals by cylinder."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from laufruhe.extensions.piston_motion.channels import RODS, reversals_at
from laufruhe.extensions.piston_motion.motion import Extreme, PistonMotion, piston_motion, pistons_of
from laufruhe.machine import SliderCrank
from laufruhe.present.measures import decided_design
from laufruhe.present.numbers import number, trimmed
from laufruhe.present.tables import Table
from laufruhe.problem.loads import PointLoads
from laufruhe.report.section import Section
from laufruhe.solvers.result import Result
from laufruhe.units import readable


def _has_pistons(result: Result) -> bool:
    return bool(result.final.loads) and bool(pistons_of(result.final.engine))


def _has_side_forces(result: Result) -> bool:
    is_even = not result.final.fidelity.has_uneven_speed
    return is_even and _has_pistons(result) and bool(RODS.of(result.final.engine))


def _motions(result: Result) -> Iterator[tuple[PointLoads, SliderCrank, PistonMotion, Sequence[Extreme] | None]]:
    engine = result.final.engine
    has_side_force = _has_side_forces(result)
    for loads in result.final.loads:
        sets = reversals_at(engine, loads) if has_side_force else [None] * len(engine.slider_cranks)
        for part, reversals in zip(engine.slider_cranks, sets, strict=True):
            yield loads, part, piston_motion(part, loads.point.speed), reversals


def _record(result: Result) -> Mapping[str, Any]:
    record: dict[str, list[Mapping[str, Any]]] = {}
    for loads, part, motion, reversals in _motions(result):
        rates = None if reversals is None else [{"rate": one.value, "angle": one.angle} for one in reversals]
        record.setdefault(part.name, []).append(
            {"point": loads.point.name, **asdict(motion), "side_force_reversals": rates}
        )
    return record


def _tables(result: Result) -> list[Table]:
    rows: dict[tuple[str, ...], list[str]] = {}
    for loads, part, motion, reversals in _motions(result):
        fastest = max(reversals or (), key=lambda reversal: reversal.value, default=None)
        cells = (
            loads.point.name, _text(motion.stroke, "m"), _text(motion.mean_speed, "m/s"), _at(motion.speed, "m/s"),
            _at(motion.towards_crank, "m/s^2"), _at(motion.from_crank, "m/s^2"),
            _text(motion.rod_angle.value, "rad") if motion.rod_angle else "",
            "" if reversals is None else str(len(reversals)), _at(fastest, "N/s") if fastest else "",
        )  # fmt: skip
        rows.setdefault(cells, []).append(part.name.removeprefix(f"{part.noun} "))
    texts = [(cells[0], ", ".join(names), *cells[1:]) for cells, names in rows.items()]
    units = {
        "stroke": "m", "mean speed": "m/s", "largest speed": "m/s", "acceleration to crank": "m/s^2",
        "from crank": "m/s^2", "rod angle": "rad", "reversals": "", "fastest reversal": "N/s",
    }  # fmt: skip
    head = ("at", "cylinder", *(f"{word} [{readable(unit)[0]}]" if unit else word for word, unit in units.items()))
    # leave out columns without a value, such as the rod angle of a yoke
    columns = [(name, *column) for name, *column in zip(head, *texts, strict=True) if any(column)]
    head, *texts = zip(*columns, strict=True)
    note = (
        f"{decided_design(result).capitalize()}, at the mean speed of the crank. "
        "Angles behind 'at' [deg]: own crank after top dead centre, "
        "which an offset turns away from the cylinder axis."
    )
    if any(name == "reversals" for name in head):
        note += (
            " Reversals: how often the side force changes its sign in a cycle, and its rate at the fastest reversal, "
            "a measure of piston slap."
        )
    return [Table(head, texts, title="Motion of the pistons", left=2, note=note, file="piston-motion")]


def _reversals(result: Result) -> Table:
    rows = [
        (loads.point.name, part.name, math.degrees(one.angle), one.value)
        for loads, part, _, reversals in _motions(result)
        for one in reversals or ()
    ]
    return Table(("point", "cylinder", "own crank angle after top dead centre [deg]", "rate [N/s]"), rows, left=2)


def _text(value: float, unit: str) -> str:
    return number(value * readable(unit)[1])


def _at(extreme: Extreme, unit: str) -> str:
    return f"{_text(extreme.value, unit)} at {trimmed(round(math.degrees(extreme.angle), 1) + 0.0)}"


SECTION = Section(
    "piston_motion", _has_pistons, _tables, _record, ("piston-motion",),
    {"side-force-reversals": (_has_side_forces, _reversals)},
)  # fmt: skip
