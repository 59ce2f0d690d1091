"""The rigid reference in 50 digits, from slider-cranks and rotors to the vectors that are measured (F13).

Nothing here goes by orders but the gas: kinematics, wrenches and the mounts' normal
equations are taken step by step in mpmath. Torque of the gas is a series that is given:
its double coefficients count as exact. The double model is then read at the same steps,
so that the difference is arithmetic and the orders' closed forms, not sampling.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray

from laufruhe.machine import Engine, GasModel, Mount, OperatingPoint, Rotor, SliderCrank
from laufruhe.numerics.exact_angles import Turn, as_turn
from laufruhe.numerics.namespaces import NUMBERS
from laufruhe.numerics.norms import NORMS
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.gas_loads import gas_coefficients
from laufruhe.physics.mechanism import cylinder_wrench
from laufruhe.physics.rigid_body import plane_wrench, point_motion
from laufruhe.problem import channels
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.loads import PointLoads
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem

DIGITS = 50
STEPS, GAS_ORDERS = 24, 90
# as many orders as are kept have no corners
FINE = Fidelity(samples=STEPS, gas_samples=4 * GAS_ORDERS, gas_orders=GAS_ORDERS)
FREE = 1e-20
"""Share of the largest stiffness below which no mount carries a direction."""
WHOLE_LOADS = Measure(channels.SHAKING_FORCE, NORMS["mean"]), Measure(channels.ROLL_MOMENT, NORMS["mean"])

Digits = NDArray[np.object_]


@dataclass(frozen=True)
class RigidPart:
    """Error of double precision against 50 digits.

    Attributes
    ----------
    error
        Relative, the largest of the measures covered: of the vectors' difference, which is
        not less than that of their norms.
    """

    error: float
    covered: tuple[str, ...]


def rigid_part(problem: Problem) -> RigidPart:
    """Return the disagreement of double precision with 50 digits on one problem.

    Compared are the objective's own measures of loads where mounts are rigid; of elastic
    mounts, of measures of single orders and of problems that measure no load, the mean
    shaking force and roll moment.
    """
    own = tuple(term.measure for term in problem.objective if _is_covered(term.measure, problem.engine))
    used = replace(problem, fidelity=FINE)
    if not own:
        used = replace(used, points=problem.points[:1])
    evaluation, errors, names = evaluate(used), [], []
    with mpmath.workdps(DIGITS):
        wrenches = [wrench_in_digits(used.engine, point) for point in used.points]
        size = max(float(np.abs(wrench).max()) for wrench in wrenches)
        for measure in own or WHOLE_LOADS:
            rows = evaluation.rows(measure, STEPS)
            off = np.array(rows.vectors - _vectors(measure, used, wrenches), dtype=float)
            # a load that cancels has no relative error
            if rows.value > 1e-9 * size:
                errors.append(rows.norm.value(rows.grid, off) / rows.value)
                names.append(measure.name)
    return RigidPart(max(errors, default=0.0), tuple(names))


def _is_covered(measure: Measure, engine: Engine) -> bool:
    if not measure.is_load or measure.orders is not None or measure.is_inside:
        return False
    return engine.block is None or not measure.on_mounts


def wrench_in_digits(engine: Engine, point: OperatingPoint) -> Digits:
    """Return the wrench on the block at STEPS equal steps over the cycle, shape (steps, 6) (L1-L5)."""
    rows = []
    for k in range(STEPS):
        turn = mpmath.mpf(k * engine.cycle.turns) / STEPS
        loads = [_cylinder(part, turn, point.speed) for part in engine.slider_cranks]
        loads += [_rotor(rotor, rotor.unbalance, 0, turn, point.speed) for rotor in engine.rotors]
        rows.append(np.sum(loads, axis=0))
    wrench = np.array(rows)
    if point.gas is not None:
        wrench[:, 3] += _gas_torque(engine, point.gas)
    return wrench


def _exact(turn: Turn) -> Any:
    return mpmath.mpf(turn) if isinstance(turn, float) else mpmath.mpf(turn.numerator) / turn.denominator


def _cylinder(part: SliderCrank, turn: Any, speed: float) -> Digits:
    """Return the piston, rods and the rotating mass of one cylinder (L1-L4, L7)."""
    ratio = mpmath.mpf(part.shaft.ratio)
    alpha = 2 * mpmath.pi * (ratio * turn + _exact(part.star_turn))
    axis, square = mpmath.expjpi(2 * _exact(as_turn(part.bank))), (ratio * mpmath.mpf(speed)) ** 2
    load = cylinder_wrench(part, part.motion(mpmath, alpha), axis, square)
    pin = mpmath.mpf(part.rotating_mass) * mpmath.mpf(part.crank_radius)
    return np.asarray(
        load + _rotor(Rotor("pin", part.x, 0.0, part.shaft), pin, _exact(as_turn(part.throw)), turn, speed)
    )


def _rotor(rotor: Rotor, unbalance: Any, ahead: Any, turn: Any, speed: float) -> Digits:
    """Return U (n w)^2 e^{i n phi} of an unbalance `ahead` by a part of a turn (L1)."""
    ratio = mpmath.mpf(rotor.shaft.ratio)
    pull = mpmath.mpc(unbalance) * (ratio * mpmath.mpf(speed)) ** 2 * mpmath.expjpi(2 * (ratio * turn + ahead))
    return plane_wrench(pull.imag, pull.real, rotor.x, rotor.shaft)


def _gas_torque(engine: Engine, gas: GasModel) -> Digits:
    """Return the roll moment of the gas at every step, every firing in its place (L5)."""
    series: list[Any] = [mpmath.mpc(0)] * (2 * GAS_ORDERS + 1)
    for part in engine.slider_cranks:
        torque = gas_coefficients(gas, part, engine.cycle, FINE).coefficients
        late = -_exact(as_turn(part.firing_angle)) / engine.cycle.turns
        for h, value in enumerate(torque):
            series[h] += mpmath.mpc(complex(value)) * mpmath.expjpi(2 * h * late)
    roots = [mpmath.expjpi(mpmath.mpf(2 * k) / STEPS) for k in range(STEPS)]
    return np.array([
        mpmath.fsum((value * roots[h * k % STEPS]).real for h, value in enumerate(series)) for k in range(STEPS)
    ])  # fmt: skip


def mount_maps_in_digits(mounts: Sequence[Mount]) -> list[Digits]:
    """Return k_i G_i (sum G' k G)^+ of every mount, shape (3, 6) each (M1, M2)."""
    digits = np.vectorize(mpmath.mpf, otypes=[object])
    places = [digits(point_motion(NUMBERS, mount.position)) for mount in mounts]
    turns = [digits(np.array(mount.orientation)) for mount in mounts]
    springs = [turn.T @ np.diag(digits(mount.stiffness)) @ turn for turn, mount in zip(turns, mounts, strict=True)]
    total = sum(place.T @ spring @ place for place, spring in zip(places, springs, strict=True))
    values, vectors = mpmath.eigsy(mpmath.matrix(total.tolist()))
    axes, largest = np.array(vectors.tolist()), max(values)
    inverse = axes @ np.diag([1 / value if value > FREE * largest else mpmath.mpf(0) for value in values]) @ axes.T
    return [spring @ place @ inverse for place, spring in zip(places, springs, strict=True)]


def _vectors(measure: Measure, problem: Problem, wrenches: Sequence[Digits]) -> Digits:
    """Return the vectors whose norm a measure is, in the order of `load_rows` (P1)."""
    mounts, blocks = problem.engine.mounts, []
    maps = mount_maps_in_digits(mounts) if measure.on_mounts else []
    for point, share, wrench in zip(problem.points, measure.shares(problem.points), wrenches, strict=True):
        if share > 0.0:
            # steps stand in the place of orders: a channel takes of each what it takes of the other
            steps: Any = wrench
            forces: Any = np.array([wrench @ one.T for one in maps])
            on_mounts = Spectrum(Fraction(1), forces.swapaxes(0, 1)) if maps else None
            loads = PointLoads(point, Spectrum(Fraction(1), steps), on_mounts)
            values = measure.signal(loads, problem.engine).coefficients
            blocks.append(values.swapaxes(0, 1).reshape(-1, values.shape[-1]))
    return np.concatenate(blocks)
