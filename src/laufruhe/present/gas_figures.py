"""Key figures of the gas as text."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

from laufruhe.errors import counted
from laufruhe.machine import Chambers, Compressor, OperatingPoint, PressureTrace
from laufruhe.machine.chambers import GasModel, models_of
from laufruhe.physics.compressor_stages import Stage, links_of, matched_pressures
from laufruhe.physics.gas_facts import GasFacts, cylinder_facts
from laufruhe.present.numbers import DEGREE, share, trimmed
from laufruhe.problem.problem import Problem

HEAD = ("at", "peak [bar]", "peak at [deg]", "imep [bar]", "gas torque [N m]", "gas power [kW]", "power [kW/l]",
        "brake torque [N m]")  # fmt: skip
"""Heads of the figures of the gas, before friction; the last one is after it."""
_EXCESS = 0.005
"""Largest relative difference between delivery and intake of two stages that needs no sentence."""
_LINES = 8
"""Largest number of operating points with a line of their own."""


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
    compressors = (sentence for point in problem.points for sentence in _compressors(problem, point))
    return list(dict.fromkeys([*recorded, *compressors]))


def _compressors(problem: Problem, point: OperatingPoint) -> list[str]:
    # what each stage takes in, and what one delivers more or less than the next takes in
    gases = (gas for gas in models_of(problem.fidelity.gas_of(point)) if isinstance(gas, Chambers))
    chambers = [(chamber, chamber.diagram) for gas in gases for chamber in gas.chambers]
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
    for name, peak, angle, imep, torque, power, density, brake in rows[:_LINES]:
        line = f"gas at {name}: peak {peak} bar at {angle} deg, imep {imep} bar, gas torque {torque} N m, "
        friction = f"; brake torque {brake} N m" if brake != torque else ""
        lines.append(f"{line}power {power} kW, {density} kW/l{friction}")
    further = len(rows) - _LINES
    return [*lines, f"gas: the report has {counted(further, 'further operating point')}"] if further > 0 else lines


def _facts(problem: Problem) -> list[tuple[str, GasFacts]]:
    return [row for point in problem.points for row in cylinder_facts(problem.engine, point, problem.fidelity)]


def _figures(facts: GasFacts) -> list[str]:
    kilowatts, litres = 1e-3 * facts.power, 1e3 * facts.displacement
    # friction that takes all torque leaves rounding
    brake = facts.torque - facts.friction if abs(facts.torque - facts.friction) > 1e-9 * abs(facts.torque) else 0.0
    bars = 1e-5 * facts.peak_pressure, 1e-5 * facts.imep
    numbers = bars[0], DEGREE * facts.peak_angle, bars[1], facts.torque, kilowatts, kilowatts / litres, brake
    return [trimmed(number) for number in numbers]
