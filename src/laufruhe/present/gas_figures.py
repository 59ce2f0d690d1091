"""Key figures of the gas as text."""

from __future__ import annotations

from laufruhe.errors import counted
from laufruhe.machine import Chambers, Compressor
from laufruhe.machine.chambers import models_of
from laufruhe.physics.gas_facts import GasFacts, cylinder_facts
from laufruhe.present.numbers import DEGREE, share, trimmed
from laufruhe.problem.problem import Problem

HEAD = ("at", "peak [bar]", "peak at [deg]", "imep [bar]", "gas torque [N m]", "power [kW]", "power [kW/l]")
"""Heads of the figures of the gas."""
_LINES = 8
"""Largest number of operating points with a line of their own."""


def gas_rows(problem: Problem) -> list[tuple[str, ...]]:
    """Return a row of figures for each operating point with gas, after its name."""
    return [(name, *_figures(facts)) for name, facts in _facts(problem)]


def gas_note(problem: Problem) -> list[str]:
    """Return sentences on how the files of recorded traces were read, and on what compressors take in."""
    gases = (model for point in problem.points for model in models_of(problem.fidelity.gas_of(point)))
    chambers = (chamber for gas in gases if isinstance(gas, Chambers) for chamber in gas.chambers)
    compressors = (
        f"{chamber.name} takes in {share(chamber.diagram.volumetric_efficiency)} of the volume of its stroke."
        for chamber in chambers
        if isinstance(chamber.diagram, Compressor)
    )
    recorded = (sentence for _, facts in _facts(problem) for sentence in facts.recording)
    return list(dict.fromkeys([*recorded, *compressors]))


def gas_lines(problem: Problem) -> list[str]:
    """Return the sentences of `gas_note`, and a line for each operating point with gas."""
    lines, rows = [f"gas: {sentence}" for sentence in gas_note(problem)], gas_rows(problem)
    for name, peak, angle, imep, torque, power, density in rows[:_LINES]:
        lines.append(
            f"gas at {name}: peak {peak} bar at {angle} deg, imep {imep} bar, gas torque {torque} N m, "
            f"power {power} kW, {density} kW/l"
        )
    further = len(rows) - _LINES
    return [*lines, f"gas: the report has {counted(further, 'further operating point')}"] if further > 0 else lines


def _facts(problem: Problem) -> list[tuple[str, GasFacts]]:
    return [row for point in problem.points for row in cylinder_facts(problem.engine, point, problem.fidelity)]


def _figures(facts: GasFacts) -> list[str]:
    kilowatts, litres = 1e-3 * facts.power, 1e3 * facts.displacement
    bars = 1e-5 * facts.peak_pressure, 1e-5 * facts.imep
    numbers = bars[0], DEGREE * facts.peak_angle, bars[1], facts.torque, kilowatts, kilowatts / litres
    return [trimmed(number) for number in numbers]
