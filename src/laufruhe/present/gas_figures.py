"""Key figures of the gas as text."""

from __future__ import annotations

from laufruhe.errors import counted
from laufruhe.physics.gas_facts import GasFacts, cylinder_facts
from laufruhe.present.numbers import DEGREE, trimmed
from laufruhe.problem.advice import ADVICE
from laufruhe.problem.problem import Problem
from laufruhe.units import readable

_LINES = 8
"""Largest number of operating points with a line of their own."""


def gas_head() -> tuple[str, ...]:
    """Return the heads of the figures of the gas; the last three are those of the brake and of friction."""
    torque, power = readable("N m")[0], readable("W", "kW")[0]
    return (
        "at", "peak [bar]", "peak at [deg]", "imep [bar]", f"gas torque [{torque}]", f"gas power [{power}]",
        f"power [{power}/l]", f"brake torque [{torque}]", f"friction [{torque}]", "fmep [bar]",
    )  # fmt: skip


def gas_rows(problem: Problem) -> list[tuple[str, ...]]:
    """Return a row of figures for each operating point with gas, after its name."""
    return [(name, *_figures(facts)) for name, facts in _facts(problem)]


def gas_note(problem: Problem) -> list[str]:
    """Return the sentences of extensions about the gas."""
    return list(dict.fromkeys(sentence for advice in ADVICE.values() for sentence in advice.about_gas(problem)))


def gas_lines(problem: Problem) -> list[str]:
    """Return the sentences of `gas_note`, and a line for each operating point with gas."""
    lines, rows = [f"gas: {sentence}" for sentence in gas_note(problem)], gas_rows(problem)
    unit, power_unit = readable("N m")[0], readable("W", "kW")[0]
    for name, peak, angle, imep, torque, power, density, brake, friction, fmep in rows[:_LINES]:
        line = f"gas at {name}: peak {peak} bar at {angle} deg, imep {imep} bar, gas torque {torque} {unit}, "
        after = f"; friction {friction} {unit}, fmep {fmep} bar; brake torque {brake} {unit}" if brake != torque else ""
        lines.append(f"{line}power {power} {power_unit}, {density} {power_unit}/l{after}")
    further = len(rows) - _LINES
    return [*lines, f"gas: the report has {counted(further, 'further operating point')}"] if further > 0 else lines


def _facts(problem: Problem) -> list[tuple[str, GasFacts]]:
    return [row for point in problem.points for row in cylinder_facts(problem.engine, point, problem.fidelity)]


def _figures(facts: GasFacts) -> list[str]:
    turning, power = readable("N m")[1], readable("W", "kW")[1] * facts.power
    # friction that takes all torque leaves rounding
    brake = facts.torque - facts.friction if abs(facts.torque - facts.friction) > 1e-9 * abs(facts.torque) else 0.0
    numbers = (
        1e-5 * facts.peak_pressure, DEGREE * facts.peak_angle, 1e-5 * facts.imep, turning * facts.torque, power,
        power / (1e3 * facts.displacement), turning * brake, turning * facts.friction, 1e-5 * facts.fmep,
    )  # fmt: skip
    return [trimmed(number) for number in numbers]
