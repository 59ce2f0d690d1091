"""The rigid reference in 50 digits, from slider-cranks and rotors to the measure (F13).

Nothing here goes by orders but the gas: kinematics, wrenches, the mounts' normal equations
and the lengths are taken step by step in mpmath. Torque of the gas is a series that is
given: its double coefficients count as exact. The double model is then read at the same
steps, so that the difference is arithmetic and the orders' closed forms, not sampling.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from laufruhe.machine import Cycle, Engine, GasModel, Mount, OperatingPoint, Rotor
from laufruhe.numerics.namespaces import NUMBERS
from laufruhe.numerics.norms import NORMS
from laufruhe.numerics.spectrum import spectrum_of
from laufruhe.numerics.turns import Turn, as_turn
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.gas_loads import gas_torque
from laufruhe.physics.mechanism import momentum_loads
from laufruhe.physics.rigid_body import point_motion
from laufruhe.physics.wrench import plane_wrench
from laufruhe.problem import channels
from laufruhe.problem.channels import LoadChannel
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem

DIGITS = 50
STEPS, GAS_STEPS = 24, 360
FREE = 1e-20
"""Of a stiffness over the largest: what is under it is a direction that no mount carries."""
WHOLE_LOADS = Measure(channels.SHAKING_FORCE, NORMS["mean"]), Measure(channels.ROLL_MOMENT, NORMS["mean"])

Vector = list[Any]


@dataclass(frozen=True)
class RigidPart:
    """How far double precision is from 50 digits.

    Attributes
    ----------
    error
        Relative, the largest of what is covered.
    covered
        Names of the measures compared.
    """

    error: float
    covered: tuple[str, ...]


def rigid_part(problem: Problem) -> RigidPart:
    """Disagreement of double precision with 50 digits on one problem.

    Compared are the objective's own measures of loads where mounts are rigid; of elastic
    mounts, of measures of single orders and of problems that measure no load, the mean
    shaking force and roll moment.
    """
    import mpmath

    own = tuple(term.measure for term in problem.objective if _is_covered(term.measure, problem.engine))
    used = replace(problem, fidelity=Fidelity(samples=STEPS, gas_samples=GAS_STEPS))
    if not own:
        used = replace(used, points=problem.points[:1])
    evaluation, errors, names = evaluate(used), [], []
    with mpmath.workdps(DIGITS):
        wrenches = [wrench_in_digits(used.engine, point) for point in used.points]
        for quantity in own or WHOLE_LOADS:
            exact = _measure(quantity, used, wrenches)
            # a load that cancels has no relative error
            if exact > 1e-9 * _size(wrenches):
                errors.append(float(abs(mpmath.mpf(evaluation.rows(quantity, STEPS).value) - exact) / exact))
                names.append(quantity.name)
    return RigidPart(max(errors, default=0.0), tuple(names))


def _is_covered(quantity: Measure, engine: Engine) -> bool:
    if not quantity.is_load or not quantity.norm.of_row_lengths or quantity.orders is not None:
        return False
    return quantity.channel is not channels.MOUNT_TRAVEL and (
        quantity.channel is not channels.MOUNT_FORCE or engine.block is None
    )


def wrench_in_digits(engine: Engine, point: OperatingPoint) -> list[Vector]:
    """Wrench on the block at STEPS equal steps over the cycle, in mpmath's digits (L1-L5)."""
    out = []
    gas = None if point.gas is None else _gas_series(engine, point.gas)
    for k in range(STEPS):
        total: Vector = [0] * 6
        for part in engine.slider_cranks:
            _add(total, _cylinder(part, _turn_of(engine.cycle, k), point.speed))
        for rotor in engine.rotors:
            _add(total, _rotor(rotor, rotor.unbalance, 0, _turn_of(engine.cycle, k), point.speed))
        if gas is not None:
            total[3] += _gas_at(gas, k)
        out.append(total)
    return out


def _turn_of(cycle: Cycle, step: int) -> Any:
    """Crank angle of a step as a part of a turn."""
    import mpmath

    return mpmath.mpf(step * cycle.turns) / STEPS


def _exact(turn: Turn) -> Any:
    import mpmath

    return mpmath.mpf(turn) if isinstance(turn, float) else mpmath.mpf(turn.numerator) / turn.denominator


def _add(total: Vector, load: Sequence[Any]) -> None:
    for j, value in enumerate(load):
        total[j] += value


def _cylinder(part: Any, turn: Any, speed: float) -> Vector:
    """Pistons, rods and the rotating mass of one cylinder (L1-L4, L7)."""
    import mpmath

    mpf, ratio = mpmath.mpf, mpmath.mpf(part.shaft.ratio)
    alpha = 2 * mpmath.pi * (ratio * turn + _exact(part.star_turn))
    force, roll, rods = momentum_loads(part, part.motion(mpmath, alpha), (ratio * mpf(speed)) ** 2)
    force *= mpmath.expjpi(2 * _exact(as_turn(part.bank)))
    load = list(plane_wrench(force.imag, force.real, part.x, part.shaft))
    load[3] += roll + rods
    if part.rotating_mass > 0.0:
        pin = Rotor("pin", part.x, 0.0, part.shaft)
        _add(
            load,
            _rotor(pin, mpf(part.rotating_mass) * mpf(part.crank_radius), _exact(as_turn(part.throw)), turn, speed),
        )
    return load


def _rotor(rotor: Rotor, unbalance: Any, ahead: Any, turn: Any, speed: float) -> Vector:
    """U (n w)^2 e^{i n phi}, of an unbalance turned `ahead` by a part of a turn (L1)."""
    import mpmath

    ratio = mpmath.mpf(rotor.shaft.ratio)
    pull = mpmath.mpc(unbalance) * (ratio * mpmath.mpf(speed)) ** 2 * mpmath.expjpi(2 * (ratio * turn + ahead))
    return list(plane_wrench(pull.imag, pull.real, rotor.x, rotor.shaft))


def _gas_series(engine: Engine, gas: GasModel) -> list[Any]:
    """Coefficients of the gas' roll moment, every firing in its place (L5)."""
    import mpmath

    out: list[Any] = [mpmath.mpc(0)] * (GAS_STEPS // 2 + 1)
    for part in engine.slider_cranks:
        torque = spectrum_of(gas_torque(gas, part, engine.cycle, GAS_STEPS), engine.cycle.base_order).coefficients
        late = -_exact(as_turn(part.firing_angle)) / engine.cycle.turns
        for h, value in enumerate(torque):
            out[h] += mpmath.mpc(complex(value)) * mpmath.expjpi(2 * h * late)
    return out


def _gas_at(series: list[Any], step: int) -> Any:
    import mpmath

    roots = [mpmath.expjpi(mpmath.mpf(2 * k) / STEPS) for k in range(STEPS)]
    return mpmath.fsum((value * roots[h * step % STEPS]).real for h, value in enumerate(series))


def mount_maps_in_digits(mounts: Sequence[Mount]) -> list[Any]:
    """k_i G_i (sum G' k G)^+ of every mount, 3 x 6 matrices (M1, M2)."""
    import mpmath

    places = [mpmath.matrix(point_motion(NUMBERS, mount.position).tolist()) for mount in mounts]
    springs = []
    for mount in mounts:
        turned = mpmath.matrix([list(row) for row in mount.orientation])
        springs.append(turned.T * mpmath.diag(list(mount.stiffness)) * turned)
    total = mpmath.matrix(6, 6)
    for place, spring in zip(places, springs, strict=True):
        total += place.T * spring * place
    values, vectors = mpmath.eigsy(total)
    largest = max(values)
    inverse = mpmath.diag([1 / value if value > FREE * largest else mpmath.mpf(0) for value in values])
    return [spring * place * vectors * inverse * vectors.T for place, spring in zip(places, springs, strict=True)]


def _measure(quantity: Measure, problem: Problem, wrenches: Sequence[list[Vector]]) -> Any:
    """A quantity from wrenches at equal steps (P1)."""
    import mpmath

    weights = [float(share) for share in quantity.shares(problem.points)]
    squares = [_squares(quantity, problem.engine, wrench) for wrench in wrenches]
    if not (quantity.norm.sums_lengths or quantity.norm.is_euclidean):
        return mpmath.sqrt(max(max(s) for s, weight in zip(squares, weights, strict=True) if weight > 0.0))
    is_mean = quantity.norm.sums_lengths
    means = [mpmath.fsum(map(mpmath.sqrt, s) if is_mean else s) / len(s) for s in squares]
    total = mpmath.fsum(mpmath.mpf(w) * mean for w, mean in zip(weights, means, strict=True)) / mpmath.fsum(weights)
    return total if is_mean else mpmath.sqrt(total)


def _squares(quantity: Measure, engine: Engine, wrenches: list[Vector]) -> list[Any]:
    """Squared lengths of what a quantity measures, at every step and mount."""
    import mpmath

    if isinstance(quantity.channel, LoadChannel) and quantity.channel.part is not None:
        columns = range(*quantity.channel.part.indices(6))
        return [mpmath.fsum(wrench[j] ** 2 for j in columns) for wrench in wrenches]
    counted = [m.name for m in engine.mounts] if quantity.mounts is None else quantity.mounts
    factors = quantity.direction_weights or (1.0, 1.0, 1.0)
    maps = mount_maps_in_digits(engine.mounts)
    out = []
    for wrench in wrenches:
        column = mpmath.matrix(wrench)
        for mount, one in zip(engine.mounts, maps, strict=True):
            if mount.name in counted:
                force = one * column
                out.append(mpmath.fsum((factor * force[j]) ** 2 for j, factor in enumerate(factors)))
    return out


def _size(wrenches: Sequence[list[Vector]]) -> Any:
    return max((abs(value) for wrench in wrenches for load in wrench for value in load), default=0)
