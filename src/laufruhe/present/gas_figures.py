"""Key figures of the gas as text."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

from laufruhe.errors import counted
from laufruhe.machine import Chambers, Compressor, PressureTrace
from laufruhe.machine.chambers import GasModel, models_of
from laufruhe.physics.compressor_stages import Stage, links_of, matched_pressures
from laufruhe.physics.gas_facts import GasFacts, cylinder_facts
from laufruhe.present.numbers import DEGREE, share, trimmed
from laufruhe.problem.problem import Problem
from laufruhe.units import readable

_EXCESS = 0.005
"""Largest relative difference between delivery and intake of two stages that needs no sentence."""
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
    """Return sentences on how the files of recorded traces were read, and on what compressors take in."""
    recorded = [sentence for _, facts in _facts(problem) for sentence in facts.recording]
    speeds = defaultdict[GasModel, set[float]](set)
    for point in problem.points:
        gas = problem.fidelity.gas_of(point)
        if gas and any(isinstance(model, PressureTrace) for model in models_of(gas)):
            speeds[gas].add(point.speed)
    recorded += [
        f"One record counts at {len(several)} speeds; pressure_file of an operating point gives another."
        for several in speeds.values()
        if len(several) > 1
    ]
    gases = dict.fromkeys(problem.fidelity.gas_of(point) for point in problem.points)
    compressors = (sentence for gas in gases for sentence in _compressors(problem, gas))
    return list(dict.fromkeys([*recorded, *compressors]))


def _compressors(problem: Problem, gas: GasModel | None) -> list[str]:
    # what each stage takes in, and what one delivers more or less than the next takes in
    models = (model for model in models_of(gas) if isinstance(model, Chambers))
    chambers = [(chamber, chamber.diagram) for model in models for chamber in model.chambers]
    stages = [
        Stage(
            chamber.name, chamber.swept_volume(problem.engine.slider_cranks), diagram.back_pressure, diagram.admission,
            diagram.clearance, diagram.exponent,
        )
        for chamber, diagram in chambers
        if isinstance(diagram, Compressor)
    ]  # fmt: skip
    sentences = [
        f"{stage.name} takes in {share(stage.intake / stage.volume)} of the volume of its stroke, "
        f"{trimmed(1e3 * stage.intake)} l a turn at {trimmed(1e-5 * stage.suction)} bar "
        f"(pressure times volume: {trimmed(1e-2 * stage.amount)} bar l)."
        for stage in stages
    ]
    links = links_of(stages)
    uneven = [k for k, link in enumerate(links) if abs(link.excess) > _EXCESS]
    matched = matched_pressures(stages) if uneven else None
    for k in uneven:
        link = links[k]
        more = "more" if link.excess > 0.0 else "less"
        remedy = "no pressure between the stages makes both equal" if matched is None else (
            f"at {trimmed(1e-5 * matched[k])} bar both are equal" + " with the others matched too" * (len(links) > 1)
        )  # fmt: skip
        sentences.append(
            f"{_names(link.before)} delivers {share(abs(link.excess))} {more} than {_names(link.after)} takes in at "
            f"{trimmed(1e-5 * link.pressure)} bar, if the gas is cooled to the inlet temperature; {remedy}."
        )
    return sentences


def _names(stages: Sequence[Stage]) -> str:
    return " with ".join(stage.name for stage in stages)


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
