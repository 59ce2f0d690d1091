"""Report section and pictures of torsional vibration: natural modes, critical speeds and barred speed ranges."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from laufruhe.errors import counted
from laufruhe.extensions.torsion.facts import (
    TorsionFacts,
    barred_ranges,
    facts_of,
    is_twisted,
    speed_range,
    speeds_between,
    torque_over_speed,
)
from laufruhe.extensions.torsion.physics import absorber_heat, chain_of
from laufruhe.present.measures import is_changed
from laufruhe.present.numbers import DASH, RPM, fixed, number
from laufruhe.present.pictures import ResultPicture
from laufruhe.present.tables import Table
from laufruhe.report.section import Section
from laufruhe.solvers.result import FINAL, INITIAL, Result

MAX_MODES, MAX_CRITICALS = 4, 8


def _tables(result: Result) -> list[Table]:
    reach = speed_range(result)
    initial, final = facts_of(result.initial, *reach), facts_of(result.final, *reach)
    criticals = [_criticals(initial, INITIAL), *([_criticals(final, FINAL)] if is_changed(result) else [])]
    return [_modes(result, final), *criticals, _barred(result)]


def _modes(result: Result, facts: TorsionFacts) -> Table:
    names = [disc.name for disc in chain_of(result.final.engine).discs]
    modes = range(min(MAX_MODES, len(facts.modes.frequencies)))
    swings = [[fixed(swing, 3, "+") for swing in shape] for shape in facts.modes.shapes.T]
    rows = tuple((f"{m + 1}", number(float(facts.modes.frequencies[m])), *swings[m]) for m in modes)
    omitted = len(facts.modes.frequencies) - len(modes)
    remark = f" {counted(omitted, 'higher mode')} in result.json." if omitted else ""
    note = f"Undamped modes. Angle of every disc at crank speed, scaled to 1 at the largest of each mode.{remark}"
    return Table(
        ("mode", "Hz", *names), rows, title="Natural modes of the crankshaft", note=note, file="crankshaft-modes"
    )


def _criticals(facts: TorsionFacts, design: str) -> Table:
    rows = tuple(
        (number(entry.speed * RPM), f"{entry.order:g}" + (" main" if entry.is_main else ""), f"{entry.mode}",
         number(entry.vector_sum, 3, 1.0), DASH if entry.torque is None else number(entry.torque))
        for entry in facts.criticals[:MAX_CRITICALS]
    )  # fmt: skip
    main = ", ".join(f"{order:g}" for order in facts.main)
    note = (
        f"The {len(rows)} critical speeds with the largest torque, of {len(facts.criticals)} in the speed range. "
        "Vector sum: sum of the swings of the throws, with the phases of their firings. "
        f"Main orders ({main}) have the same vector sum for every firing order. "
        "Torque: amplitude of the order in the section with the largest torque."
    )
    head = ("rpm", "order", "mode", "vector sum", "torque [N m]")
    sheet = f"strongest-critical-speeds-{design}"
    return Table(head, rows, title=f"Critical speeds of the crankshaft, {design} design", note=note, file=sheet)


def _barred(result: Result) -> Table:
    rows = tuple(
        (barred.limit, f"{number(barred.lowest * RPM)} to {number(barred.highest * RPM)}")
        for barred in barred_ranges(result, result.final)
    )
    low, high = (number(speed * RPM) for speed in speed_range(result))
    note = f"Speeds between {low} and {high} rpm at which the limit is exceeded, with the load of the operating points."
    return Table(("limit", "rpm"), rows, title="Barred speed ranges", note=note, file="barred-speeds")


def _record(result: Result) -> Mapping[str, Any]:
    """Return the torsional data of the final crankshaft; crank speeds in rad/s."""
    design, problem = result.final, result.problem
    chain, reach = chain_of(design.engine), speed_range(result)
    facts = facts_of(design, *reach)
    heat = [absorber_heat(design.engine, point, problem.fidelity) for point in problem.points]
    return {
        "discs": [{"name": disc.name, "inertia": disc.inertia, "ratio": disc.ratio} for disc in chain.discs],
        "sections": [{"name": section.name, "stiffness": section.stiffness} for section in chain.sections],
        "frequencies": facts.modes.frequencies.tolist(),
        "shapes": facts.modes.shapes.T.tolist(),
        "vector_sums": [sums.tolist() for sums in facts.sums],
        "orders": list(facts.orders),
        "main_orders": list(facts.main),
        "speeds": list(reach),
        "critical_speeds": [
            {"speed": critical.speed, "order": critical.order, "mode": critical.mode, "vector_sum": critical.vector_sum,
             "main": critical.is_main, "torque": critical.torque}
            for critical in facts.criticals
        ],
        "barred": [asdict(barred) for barred in barred_ranges(result, design)],
        "absorbers": [
            {"name": absorber.name, "heat": [float(power[k]) for power in heat]}
            for k, absorber in enumerate(chain.absorbers)
        ],
    }  # fmt: skip


def _twist_response(result: Result) -> Table:
    speeds = speeds_between(result.final, *speed_range(result))
    head, columns = ["speed [rpm]"], [RPM * speeds]
    for name, design in result.designs.items():
        sections = [section.name for section in chain_of(design.engine).sections]
        head += [f"{name}: alternating torque in {section} [N m]" for section in sections]
        columns += list(torque_over_speed(design, speeds).T)
    return Table(head, np.column_stack(columns).tolist())


def _twist_modes(result: Result) -> Table:
    # swing of every disc in every natural mode of the crankshaft
    rows = []
    for name, design in result.designs.items():
        modes = facts_of(design, *speed_range(result)).modes
        discs = [disc.name for disc in chain_of(design.engine).discs]
        for m, frequency in enumerate(modes.frequencies.tolist()):
            rows += [
                [name, m + 1, frequency, disc, swing]
                for disc, swing in zip(discs, modes.shapes[:, m].tolist(), strict=True)
            ]
    return Table(["design", "mode", "natural frequency [Hz]", "disc", "swing"], rows)


def _critical_speeds(result: Result) -> Table:
    rows = [
        [name, RPM * critical.speed, critical.order, critical.mode, critical.vector_sum, critical.is_main,
         math.nan if critical.torque is None else critical.torque]
        for name, design in result.designs.items()
        for critical in facts_of(design, *speed_range(result)).criticals
    ]  # fmt: skip
    return Table(["design", "speed [rpm]", "order", "mode", "vector sum", "main order", "torque [N m]"], rows)


SECTION = Section(
    "torsion", is_twisted, _tables, _record,
    ("crankshaft-modes", "strongest-critical-speeds-initial", "strongest-critical-speeds-final", "barred-speeds"),
    {
        "twist-response": (is_twisted, _twist_response),
        "twist-modes": (is_twisted, _twist_modes),
        "critical-speeds": (is_twisted, _critical_speeds),
    },
)  # fmt: skip
MODES = ResultPicture(
    "twist_modes",
    "Torsional natural modes of the crankshaft, and the speeds at which orders meet them.",
    "laufruhe.extensions.torsion.modes_picture",
)
RESPONSE = ResultPicture(
    "twist_response",
    "Torque in the crankshaft over crank speed, and speed ranges barred by a limit.",
    "laufruhe.extensions.torsion.response_picture",
)
