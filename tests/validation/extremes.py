"""Extreme numbers, compared with 50-digit arithmetic or an analytic limit.

`tests/benchmarks/bench_extremes.py` writes them to results/benchmarks/extremes.md; the tests hold every entry to what
it guarantees.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache

import numpy as np

import tractor
from laufruhe.extensions.recorded_pressure.gas import PressureTrace
from laufruhe.machine import Block, Cycle, Engine, Mount, OperatingPoint
from laufruhe.machine.layouts import boxer, build, inline, vee
from laufruhe.numerics.norms import NORMS
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.elastic_mounts import ResonanceError, elastic_mounting
from laufruhe.physics.order_coefficients import piston_acceleration_orders
from laufruhe.physics.shaking_loads import reciprocating_loads, shaking_loads
from laufruhe.problem import channels
from laufruhe.problem.measure import Measure, Term
from laufruhe.problem.sets import Sector
from laufruhe.solvers import solve
from many_digits import acceleration_orders
from mechanisms import mechanism_of
from one_cylinder import gas_torque

EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Entry:
    """Extreme case: its guarantee and the worst measured error.

    Attributes
    ----------
    limit
        Of `measured`; zero where the guarantee is exact.
    """

    what: str
    against: str
    guarantee: str
    measured: float
    limit: float

    @property
    def holds(self) -> bool:
        return self.measured <= self.limit


def _worst(values: Sequence[float]) -> float:
    return float(max(values))


def rod_ratios() -> Entry:
    ratios = (1e-9, 1e-6, 1e-3, 0.05, 0.26, 0.5, 0.9, 0.99, 0.999)
    return Entry(
        "rod ratio 1e-9 to 0.999",
        "order coefficients of s'' in 50 digits",
        "largest error of an order over the largest order: 4e-15 to lambda 0.9, 1e-13 to 0.999; measured in these",
        _worst([_coefficient_error(lam, 0.0) / (1e-13 if lam > 0.9 else 4e-15) for lam in ratios]),
        1.0,
    )


def offsets() -> Entry:
    pairs = [
        (lam, sign * share * (1.0 - lam))
        for lam in (0.05, 0.26, 0.6)
        for share in (0.5, 0.99, 0.999)
        for sign in (1, -1)
    ]
    return Entry(
        "offset to 0.999 of the limit of turning, both sides",
        "order coefficients of s'' in 50 digits",
        "largest error of an order over the largest order: 4e-15",
        _worst([_coefficient_error(lam, eps) for lam, eps in pairs]),
        4e-15,
    )


def _coefficient_error(rod_ratio: float, offset_ratio: float) -> float:
    exact = acceleration_orders(rod_ratio, offset_ratio, 12)
    ours = piston_acceleration_orders(rod_ratio, offset_ratio, 12)
    return float(np.abs(ours - exact).max() / np.abs(exact).max())


def speeds_and_masses() -> Entry:
    unit = _single_load(1.0, 1.0)
    errors = []
    for rpm in (1.0, 30.0, 2500.0, 60_000.0):
        for mass in (1e-6, 1e-3, 1.0, 1e5):
            speed = rpm * math.pi / 30.0
            load = _single_load(speed, mass)
            expected = unit * (mass * speed**2)
            errors.append(float(np.abs(load - expected).max() / np.abs(expected).max()))
    return Entry(
        "1 to 60 000 rpm, 1 mg to 100 t",
        "loads are proportional to mass and to the square of speed",
        "relative error under 4 roundings, 9e-16",
        _worst(errors),
        9e-16,
    )


def _single_load(speed: float, mass: float) -> np.ndarray:
    engine = replace(tractor.engine([0]), mounts=())
    parts = tuple(replace(part, reciprocating_mass=mass) for part in engine.slider_cranks)
    return shaking_loads(replace(engine, slider_cranks=parts), OperatingPoint("p", speed)).coefficients


def balanced_engines() -> Entry:
    six = tractor.engine([0, 120, 240, 240, 120, 0])
    mechanism = mechanism_of(0.04, 0.15, 0.5)
    throws = [math.radians(t) for t in (0, 120, 240)] * 2
    flat, _ = build(Cycle.FOUR_STROKE, boxer(6, 0.1, 0.03), mechanism, throws)
    in_line, opposed = (
        shaking_loads(engine, OperatingPoint("p", 300.0)).coefficients
        for engine in (six, Engine("boxer", Cycle.FOUR_STROKE, flat))
    )
    loads = [in_line[:, 1:3], in_line[:, 4:], opposed[:, 1:3]]
    # orders that are multiples of the number of throws of a star do not cancel
    left = [float(np.abs(load[2 * np.array([1, 2, 3, 4, 5])]).max()) for load in loads]
    return Entry(
        "balanced engines: six in line, six flat",
        "zero",
        "forces of orders 1 to 5 (and couples in line) are 0.0",
        _worst(left),
        0.0,
    )


def starts_at_the_optimum() -> Entry:
    machine = tractor.engine([0, 120, 240, 240, 120, 0], [tractor.web("front", 0.3), tractor.web("rear", -0.3)])
    result = solve(tractor.problem(machine, ["front", "rear"]))
    return Entry(
        "optimiser started at the optimum of a balanced six",
        "no counterweight helps",
        "unbalances decided are 0.0",
        _worst([abs(rotor.unbalance) for rotor in result.final.engine.rotors]),
        0.0,
    )


def nearly_balanced() -> Entry:
    errors = []
    for delta in (1e-2, 1e-4, 1e-6, 1e-8, 1e-10):
        engine = tractor.engine([0, 120, 240, 240, 120, 0])
        first = engine.slider_cranks[0]
        heavier = first.reciprocating_mass * (1.0 + delta)
        changed = replace(engine, slider_cranks=(replace(first, reciprocating_mass=heavier), *engine.slider_cranks[1:]))
        result = reciprocating_loads(changed, 300.0).at(1)[2]
        extra = float(Fraction(heavier) - Fraction(first.reciprocating_mass))
        exact = -extra * first.crank_radius * 300.0**2 * acceleration_orders(first.rod_ratio, 0.0, 12)[1]
        errors.append(float(abs(result - exact) / abs(exact)) * delta / EPS)
    return Entry(
        "nearly balanced six: one piston heavier by 1e-2 to 1e-10",
        "the difference, in exact arithmetic",
        "relative error of the residue at most 4 roundings over its share (1e-10 heavier: 9e-6); measured in roundings",
        _worst(errors),
        4.0,
    )


def cylinder_numbers() -> Entry:
    errors = []
    for count in range(1, 49):
        order = _even_order(count)
        mechanism = mechanism_of(0.04, 0.15, 0.5)
        throws = [2.0 * math.tau * k / count for k in order]
        parts, _ = build(Cycle.FOUR_STROKE, inline(count, 0.1), mechanism, throws)
        load = reciprocating_loads(Engine("n", Cycle.FOUR_STROKE, parts), 300.0)
        unit = acceleration_orders(0.04 / 0.15, 0.0, 12)
        for harmonic in (1, 2, 4, 6):
            exact = _star(throws, harmonic) * -unit[harmonic] * 0.5 * 0.04 * 300.0**2
            errors.append(abs(load.at(harmonic)[2] - exact) / (count * abs(unit[harmonic]) * 0.5 * 0.04 * 300.0**2))
    return Entry(
        "1 to 48 cylinders, evenly fired",
        "star sums in 50 digits",
        "error under 3e-16 of the sum of the cylinders' own forces",
        _worst([float(e) for e in errors]),
        3e-16,
    )


def _even_order(count: int) -> list[int]:
    """Return the throws in a mixed order."""
    step = max(1, count // 2 - 1)
    return [(k * step) % count if math.gcd(step, count) == 1 else k for k in range(count)]


def _star(throws: Sequence[float], harmonic: int) -> complex:
    import mpmath

    with mpmath.workdps(50):
        # throws are rounded parts of a turn; the parts themselves are meant
        turns = [Fraction(t / math.tau).limit_denominator(100) for t in throws]
        total = mpmath.fsum(
            mpmath.expjpi(2 * mpmath.mpf((t * harmonic).numerator) / (t * harmonic).denominator) for t in turns
        )
        return complex(total) if abs(total) > 1e-40 else 0j


def vee_angles() -> Entry:
    mechanism = mechanism_of(0.04, 0.15, 0.5)
    throws = [math.radians(t) for t in (0, 90, 270, 180)]
    double = replace(mechanism, reciprocating_mass=1.0)
    closed, row, flat = (
        Engine("e", Cycle.FOUR_STROKE, build(Cycle.FOUR_STROKE, layout, own, pins)[0])
        for layout, own, pins in (
            (vee(8, 0.1, 0.0, bank_stagger=0.02), mechanism, throws),
            (inline(4, 0.1), double, throws),
            (vee(2, 0.1, math.pi, bank_stagger=0.02), mechanism, [0.0]),
        )
    )
    a, b = (shaking_loads(e, OperatingPoint("p", 300.0)).coefficients[:, 1:3] for e in (closed, row))
    n = min(len(a), len(b))
    apart = float(np.abs(a[:n] - b[:n]).max() / max(np.abs(b).max(), 0.5 * 0.04 * 9e4))
    second = shaking_loads(flat, OperatingPoint("p", 300.0)).at(2)[1:3]
    return Entry(
        "V angle 0 and 180 degrees",
        "an in-line engine of double mass; second order of a shared throw at 180 is zero",
        "forces agree to 4e-15 of the largest, and 0.0",
        _worst([apart, float(np.abs(second).max())]),
        4e-15,
    )


def intervals_equal_to_rounding() -> Entry:
    left = []
    for shift in (1e-16, -2e-16, 4e-16):
        mechanism = mechanism_of(0.04, 0.15, 0.5)
        throws = [0.0, math.tau / 3 + shift, 2 * math.tau / 3 - shift]
        parts, _ = build(Cycle.TWO_STROKE, inline(3, 0.1), mechanism, throws)
        left.append(float(np.abs(reciprocating_loads(Engine("t", Cycle.TWO_STROKE, parts), 300.0).at(1)[1:3]).max()))
    return Entry(
        "firing intervals equal to a rounding",
        "a three-throw star",
        "the force of first order is 0.0",
        _worst(left),
        0.0,
    )


def pressure_jump() -> Entry:
    angles = np.radians(np.arange(0.0, 720.0, 2.0))
    pressures = np.where(angles < math.radians(181.0), 40e5, 1e5)
    trace = PressureTrace(tuple(angles), tuple(pressures))
    part = tractor.engine([0], ()).slider_cranks[0]
    torque = gas_torque(trace, part, Cycle.FOUR_STROKE, 1440)
    area, radius = part.piston_area, part.crank_radius
    work = float(torque.mean()) * 4.0 * math.pi
    # the jump is a ramp between two points of the trace, from 180 to 182 degrees, where the piston all but stands
    exact = (40e5 - 101_325.0) * area * 2.0 * radius + (1e5 - 101_325.0) * area * (-2.0 * radius)
    return Entry(
        "a pressure trace that jumps from 40 to 1 bar",
        "work of constant pressures over the stroke",
        "no ringing; indicated work right to 1e-3 with points 2 degrees apart",
        abs(work / exact - 1.0),
        1e-3,
    )


def bounds_far_apart() -> Entry:
    return Entry(
        "bounds of 1e-9 and 1e8 kg m in one problem",
        "what each shaft does alone, in closed form",
        "a decision is right to 1e-5, or is none where it is worth less than 1e-6 of the objective",
        _worst([_bounded(big, small)[0] for big, small in _BOUNDS]),
        1e-5,
    )


def gap_of_bounds_far_apart() -> Entry:
    return Entry(
        "the gap stated for these",
        "the optimum in closed form",
        "not below the true one",
        _worst([_bounded(big, small)[1] for big, small in _BOUNDS]),
        0.0,
    )


_BOUNDS = ((1.0, 1e-2), (1e2, 1e-3), (1e3, 1e-6), (1e4, 1e-9), (1e6, 1e-6), (1e8, 1e-9))


@lru_cache
def _bounded(big: float, small: float) -> tuple[float, float]:
    """Return error of free and bounded unbalances of a shaft, and the excess of the true gap over the stated one."""
    rotors = [tractor.shaft_rotor("plus", 2.0, 0.0), tractor.shaft_rotor("minus", -2.0, 0.0)]
    machine = replace(tractor.engine([0, 180, 180, 0], rotors), mounts=())
    force = Term(Measure(channels.SHAKING_FORCE, NORMS["mean"]))
    problem = tractor.problem(machine, ["plus", "minus"], objective=(force,))
    free = tuple(replace(d, set=Sector(upper)) for d, upper in zip(problem.decisions, (big, small), strict=True))
    problem = replace(problem, decisions=free)
    result = solve(problem)
    # the second order turns half forwards and half backwards; only `small` of the latter can go
    each = tractor.MASS * tractor.RADIUS * tractor.LAMBDA / 2.0
    best = min(small, each)
    minimum = abs(each - best) * (2.0 * tractor.SPEED) ** 2
    assert result.objective is not None
    assert result.certificate is not None
    true_gap = (result.objective.value - minimum) / result.objective.value if minimum > 0.0 else 0.0
    plus, minus = (abs(rotor.unbalance) for rotor in result.final.engine.rotors)
    faint = minus == 0.0 and best <= 1e-6 * (each - best)
    errors = [abs(plus / each - 1.0), 0.0 if faint else abs(minus / best - 1.0)]
    return max(errors), max(true_gap - result.certificate.gap - 1e-9, 0.0)


def no_damping_near_resonance() -> Entry:
    """Return the error of one mass on four springs, driven at 1e-1 to 1e-7 from resonance, both sides."""
    import mpmath

    errors = []
    for off in (1e-1, 1e-3, 1e-5, 1e-7):
        for side in (1.0, -1.0):
            speed = _BOUNCE * math.sqrt(1.0 + side * off)
            force = abs(_bounce_force(speed))
            with mpmath.workdps(50):
                ratio = mpmath.mpf(speed) ** 2 * mpmath.mpf(_MASS) / (4 * mpmath.mpf(_SPRING))
                exact = abs(1 / (1 - ratio)) / 4
                errors.append(float(abs(force - exact) / exact) * float(abs(1 - ratio)) / EPS)
    return Entry(
        "damping 0, driven at 1e-1 to 1e-7 beside a natural frequency squared",
        "1 / (1 - r^2) in 50 digits",
        "finite; relative error at most 16 roundings over the distance 1 - r^2; measured in roundings",
        _worst(errors),
        16.0,
    )


def no_damping_at_resonance() -> Entry:
    refused = []
    for off in (0.0, 1e-12, -1e-9):
        try:
            _bounce_force(_BOUNCE * (1.0 + off))
        except ResonanceError as error:
            refused.append("bounce" in str(error) and "loss factor or damping" in str(error))
        else:
            refused.append(False)
    # the same frequency in another direction drives nothing, and is answered
    sideways = abs(_bounce_force(_BOUNCE, direction=1))
    refused.append(math.isfinite(sideways) and sideways > 0.0)
    return Entry(
        "damping 0, driven at a natural frequency",
        "the limit is infinite",
        "refused with the mode's name and a remedy within 1e-8 of the frequency squared; other modes are answered",
        float(sum(not allowed for allowed in refused)),
        0.0,
    )


_MASS, _SPRING = 120.0, 3e5
_BOUNCE = math.sqrt(4.0 * _SPRING / _MASS)


def _bounce_force(speed: float, direction: int = 2) -> complex:
    """Return the force on the first of four mounts under a unit force of first order through the centre of gravity."""
    mounts = tuple(
        Mount(f"m{k}", (x, y, 0.0), (0.4 * _SPRING, 0.4 * _SPRING, _SPRING))
        for k, (x, y) in enumerate([(0.4, 0.3), (0.4, -0.3), (-0.4, 0.3), (-0.4, -0.3)])
    )
    block = Block(_MASS, ((4.0, 0.0, 0.0), (0.0, 9.0, 0.0), (0.0, 0.0, 8.0)))
    wrench = np.zeros((2, 6), dtype=complex)
    wrench[1, direction] = 1.0
    forces = elastic_mounting(block, mounts).forces(Spectrum(Fraction(1), wrench), speed)
    return complex(forces.coefficients[1, 0, direction])


def many_optima() -> Entry:
    rotors = [tractor.shaft_rotor(f"{name}.{k}", ratio, 0.0) for k, (name, ratio) in enumerate(
        [("plus", 2.0), ("again", 2.0), ("minus", -2.0), ("more", -2.0)])]  # fmt: skip
    machine = replace(tractor.engine([0, 180, 180, 0], rotors), mounts=())
    force = Term(Measure(channels.SHAKING_FORCE, NORMS["mean"]))
    result = solve(tractor.problem(machine, [r.name for r in rotors], objective=(force,)))
    total = sum(abs(rotor.unbalance) for rotor in result.final.engine.rotors)
    minimum = tractor.MASS * tractor.RADIUS * tractor.LAMBDA
    return Entry(
        "two shafts in one place: a plane of optima",
        "the least sum of unbalances, m r lambda",
        "the lightest optimum, to 1e-6",
        abs(total / minimum - 1.0),
        1e-6,
    )


ENTRIES: tuple[Callable[[], Entry], ...] = (
    rod_ratios, offsets, speeds_and_masses, balanced_engines, starts_at_the_optimum, nearly_balanced,
    cylinder_numbers, vee_angles, intervals_equal_to_rounding, pressure_jump,
    no_damping_near_resonance, no_damping_at_resonance, bounds_far_apart, gap_of_bounds_far_apart,
    many_optima,
)  # fmt: skip


def page() -> str:
    """Return the table."""
    lines = [
        "# Numbers at the extremes",
        "",
        "The tests hold every line to its guarantee.",
        "",
        "| extreme | beside | guaranteed | measured, worst | limit |",
        "| --- | --- | --- | ---: | ---: |",
    ]
    for make in ENTRIES:
        entry = make()
        lines.append(
            f"| {entry.what} | {entry.against} | {entry.guarantee} | {entry.measured:.1e} | {entry.limit:.1e} |"
        )
    return "\n".join(lines) + "\n"
