"""Plausibility warnings about unusual numbers, which may have a wrong unit or decimal point."""

from __future__ import annotations

import math
from collections.abc import Container, Iterator, Sequence
from contextlib import suppress

from laufruhe.errors import Complaint, ModelError
from laufruhe.machine import Engine, OperatingPoint
from laufruhe.machine.mount import every_spring
from laufruhe.physics.gas_facts import cylinder_facts, gas_facts
from laufruhe.problem.advice import Advice
from laufruhe.problem.decision import Kind, NumberDrive
from laufruhe.problem.problem import Problem
from laufruhe.units import quantity_text

FASTEST = 30.0
"""Largest usual mean piston speed [m/s]; racing engines reach 26."""
MIN_DENSITY, MAX_DENSITY = 150.0, 20_000.0
"""Usual range of reciprocating mass over swept volume [kg/m^3]; engines that were built have about 700 to 4000."""
SHORTEST_ROD = 0.45
"""Largest usual ratio of crank radius to rod length."""
FLATTEST, LONGEST = 0.25, 5.0
"""Usual range of stroke over bore."""
MAX_UNBALANCE = 20.0
"""Largest usual unbalance of one rotor over that of all pistons and pins at their crank radius."""
_PAIR = 2
"""Cylinders that may fire within one turn of two: twins with throws at 180 degrees do."""
MAX_SAG, MIN_SAG = 0.1, 1e-6
"""Usual range of the static sag of a block on its mounts [m]; soft mounts sag about 10 mm."""

MAX_PEAK, MIN_GAS = 300e5, 0.1e5
"""Largest usual peak pressure, and least usual absolute pressure in a cylinder [Pa]; diesel engines reach 250 bar."""
MAX_KILOPASCAL = 30_000e5
"""Largest usual peak pressure if kPa are taken as bar [Pa]."""
LATEST_PEAK = math.radians(60.0)
"""Largest usual angle between firing and peak pressure."""
MAX_POWER = 250e6
"""Largest usual power over displacement [W/m^3]; racing engines without a supercharger reach 230 kW/l."""
MAX_REST = 0.02
"""Largest difference of mean torques that may be one of rounding, relative to the torque of gas and friction."""
_ROUNDING = 1e-6


def _warnings(problem: Problem) -> list[Complaint]:
    """Return warnings about unusual numbers of a problem, such as a rod ratio above 0.5."""
    engine, points = problem.engine, problem.points
    drives = (drive for decision in problem.decisions for drive in decision.drives)
    # the start of an open mass may be any
    open_masses = {drive.key[0] for drive in drives if isinstance(drive, NumberDrive) and drive.kind is Kind.PISTON}
    return [
        *_of_speed(engine, points),
        *_of_pistons(engine, open_masses),
        *_of_rotors(engine),
        *_of_mounts(engine),
        *([] if problem.fires_together or problem.phasing is not None else _of_firing(engine)),
        *_of_gas(engine, points),
        *_of_machines(engine, points),
    ]


def _of_speed(engine: Engine, points: Sequence[OperatingPoint]) -> Iterator[Complaint]:
    longest = max((part.crank_radius for part in engine.slider_cranks), default=0.0)
    for point in points:
        speed = 2.0 * longest * point.speed / math.pi
        if speed > FASTEST:
            rule = f"gives a mean piston speed of {speed:.4g} m/s; racing engines reach 26 m/s"
            yield Complaint(f"operating point {point.name}", "", rule, "check speed and stroke")


def _of_pistons(engine: Engine, open_masses: Container[str]) -> Iterator[Complaint]:
    for part in engine.slider_cranks:
        bore, stroke = part.bore or 2.0 * part.crank_radius, 2.0 * part.crank_radius
        usual = math.pi / 4.0 * bore**2 * stroke
        mass = None if part.name in open_masses else part.reciprocating_mass
        if mass == 0.0 and part.has_rod:
            rule = "makes no inertia force, so the pistons do not shake the block"
            yield Complaint("reciprocating mass", quantity_text(0.0, "kg"), rule, "check it")
        elif mass and usual > 0.0 and not MIN_DENSITY < mass / usual < MAX_DENSITY:
            # 1000 kg a cubic metre is what pistons of usual engines have
            rule = f"is that of no usual piston: one that sweeps {1e6 * usual:.4g} cm^3 has about {1e3 * usual:.2g} kg"
            yield Complaint("reciprocating mass", quantity_text(mass, "kg"), rule, "check its unit")
        if part.bore and not FLATTEST < stroke / part.bore < LONGEST:
            rule = f"is {stroke / part.bore:.3g} times the bore"
            yield Complaint("stroke", quantity_text(stroke, "m"), rule, "check stroke and bore")
        if part.crank_radius / part.rod_length > SHORTEST_ROD:
            rule = f"is {part.rod_length / part.crank_radius:.3g} crank radii, and rods of engines are longer than 2.2"
            yield Complaint("rod length", quantity_text(part.rod_length, "m"), rule, "check rod ratio or rod length")


def _of_rotors(engine: Engine) -> Iterator[Complaint]:
    total = sum((p.reciprocating_mass + p.rotating_mass) * p.crank_radius for p in engine.slider_cranks)
    for rotor in engine.rotors:
        if abs(rotor.unbalance) > MAX_UNBALANCE * total > 0.0:
            rule = f"is {abs(rotor.unbalance) / total:.3g} times that of all pistons and pins at their crank radius"
            yield Complaint(
                f"unbalance of {rotor.name}", quantity_text(abs(rotor.unbalance), "kg m"), rule, "check its unit"
            )


def _of_mounts(engine: Engine) -> Iterator[Complaint]:
    moving = sum(part.reciprocating_mass + part.rotating_mass for part in engine.slider_cranks)
    if engine.block is not None and engine.block.mass <= moving:
        rule = f"is not more than the {quantity_text(moving, 'kg')} of its pistons and cranks, which it includes"
        yield Complaint("mass of the block", quantity_text(engine.block.mass, "kg"), rule, "check its unit")
    stiffness = sum(max(spring.at_rest) for _, spring in every_spring(engine.mounts))
    if engine.block is None or not stiffness:
        return
    sag = 9.81 * engine.block.mass / stiffness
    if not MIN_SAG < sag < MAX_SAG:
        rule = f"lets {quantity_text(engine.block.mass, 'kg')} sag by about {quantity_text(sag, 'm')}"
        yield Complaint("stiffness of the mounts", "", rule, "check stiffness and mass, N/mm and N/m")


def _of_firing(engine: Engine) -> Iterator[Complaint]:
    groups = [f"{', '.join(names[:-1])} and {names[-1]}" for names in engine.simultaneous_firings]
    remedy = "give a firing order, or write fires_together = true in [engine] if that is meant"
    if groups:
        yield Complaint("firing", "", f"occurs at once in {'; in '.join(groups)}", remedy)
    fires = sorted(part.firing_angle for part in engine.cylinders)
    if len(fires) > _PAIR and fires[-1] - fires[0] < math.tau <= engine.cycle.angle - math.tau:
        rule = f"takes place in all {len(fires)} cylinders within one of the two turns of the cycle"
        yield Complaint("firing", "", rule, remedy)


def _of_gas(engine: Engine, points: Sequence[OperatingPoint]) -> Iterator[Complaint]:
    for point in points:
        facts, gas = None, point.gas
        with suppress(ModelError):
            # the evaluation reports a cycle that cannot be met
            facts = gas_facts(engine, point)
        if facts is None or gas is None:
            continue
        is_trace = gas.is_measured
        peak = quantity_text(1e-5 * facts.peak_pressure, "bar")
        if facts.peak_pressure > MAX_PEAK:
            rule = "is more than 300 bar; diesel engines reach 250 bar"
            unit = "kPa" if facts.peak_pressure < MAX_KILOPASCAL else "Pa"
            remedy = f"check pressure_unit; it may be {unit}" if is_trace else "check its unit"
            yield Complaint("peak pressure of the gas", peak, rule, remedy)
        if is_trace and facts.least_pressure < MIN_GAS:
            lowest = quantity_text(1e-5 * facts.least_pressure, "bar")
            rule = "is nearly a vacuum"
            yield Complaint(
                "least pressure of the gas", lowest, rule, "check gauge and peg; pressures must be absolute"
            )
        # nothing burns: a motored gas is its own motored gas
        if gas.motored(engine.cycle) is gas:
            continue
        lies_late = abs(facts.peak_angle) > LATEST_PEAK and facts.peak_pressure > 2.0 * abs(facts.least_pressure)
        angle = math.degrees(facts.peak_angle)
        place = f"the peak of {peak} lies {angle:.4g} deg after the firing dead centre"
        half_turns = 180.0 * round(angle / 180.0)
        change = f"{abs(half_turns):g} deg {'less' if half_turns > 0.0 else 'more'}"
        check = f"check angle_zero; {change} would move the peak to {angle - half_turns:.4g} deg"
        if not is_trace and lies_late:
            yield Complaint("peak of the gas", "", place, "check start and duration")
        elif is_trace and facts.imep < -_ROUNDING * facts.peak_pressure:
            rule = f"is {quantity_text(facts.torque, 'N m')}, so the gas takes work" + f", and {place}" * lies_late
            remedy = check if lies_late and half_turns else "check angle_zero, unless the engine was motored"
            yield Complaint("mean torque of the gas", "", rule, remedy)
        elif lies_late:
            yield Complaint("peak of the gas", "", place, check if half_turns else "check angle_zero")
        if facts.power > MAX_POWER * facts.displacement:
            power = quantity_text(1e-3 * facts.power, "kW")
            rule = f"is {1e-6 * facts.power / facts.displacement:.3g} kW for each litre; racing engines reach 230 kW"
            pressure = "pressure_unit" if is_trace else "imep"
            yield Complaint("power of the gas", power, rule, f"check {pressure}, bore, stroke and speed")


def _of_machines(engine: Engine, points: Sequence[OperatingPoint]) -> Iterator[Complaint]:
    # mean torque of coupled machines that gas and friction do not balance; a load torque takes what is left
    for point in () if engine.load_torque is not None else points:
        machines = (one for extra in engine.extras for one in extra.torques(point.name, engine.cycle.base_order))
        driving = sum(float(one.on_crank.coefficients[0].real) for one in machines)
        if not driving:
            continue
        with suppress(ModelError):
            brake_torque = sum(facts.torque - facts.friction for _, facts in cylinder_facts(engine, point))
            rest = brake_torque + driving
            # a brake takes what an engine makes beyond its generator
            if (
                brake_torque * driving < 0.0
                and abs(rest) > MAX_REST * abs(brake_torque)
                and min(brake_torque, rest) < 0.0
            ):
                verbs = ("drives", "take") if brake_torque < 0.0 else ("brakes", "give")
                rule = (
                    f"{verbs[0]} the crank, and gas and friction {verbs[1]} {quantity_text(abs(brake_torque), 'N m')}; "
                    f"the difference of {quantity_text(abs(rest), 'N m')} would change the speed"
                )
                remedy = f"give a sum of {quantity_text(-brake_torque, 'N m')}, or leave mean_torque out"
                yield Complaint("mean torque of the electric machines", quantity_text(driving, "N m"), rule, remedy)


ADVICE = Advice("numbers to check", about_problem=_warnings)
