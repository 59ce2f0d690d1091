"""Torsional vibration of the crankshaft: natural modes, vector sums, and the steady twist of every section (V1-V16).

Discs on shafts without mass turn about their even speed by small angles q:

    J q'' + C q' + K q = T,        order by order   (K + i H + i h w C - (h w)^2 J) q_h = T_h      (V5)

with the matrices of inertia J, damping C and stiffness K, the crank speed w, and the order h. T is the torque of gas,
pistons and rods on each throw (T1), and H is what hysteresis adds to K. The angle q of a disc that turns n times as
fast as the crank is its own angle over n, so that it counts with J n^2, and its shaft with k n^2 (V16). Chapter 2.9 of
the textbook explains discs and shafts, half the reciprocating mass, critical speeds, main orders and stress.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import TypeAlias

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.extensions.torsion.machine import Absorber, Torsion
from laufruhe.machine import CRANKSHAFT, Cycle, Engine, OperatingPoint, SliderCrank
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.numerics.exact_angles import as_turn, phasors
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.fidelity import EXACT, Fidelity
from laufruhe.physics.load_torque import load_torques
from laufruhe.physics.torque import cylinder_torque

Factors: TypeAlias = Callable[[Torsion, Array, float], ComplexArray]
"""Function of chain, orders and crank speed [rad/s]; returns load over twist, shape (orders, sections)."""

# least torque over response times stiffness of a damped order; least swing of the front disc that gives a mode its
# sign; relative eigenvalue that counts as zero
_SINGULAR = 1e-13
_FREE = 1e-9
_NONE = 1e-13


@dataclass(frozen=True)
class AtSpeed:
    """Natural frequencies [Hz] at a crank speed [rad/s], which sets the stiffness of pendulums (V4, V11)."""

    speed: float

    def numbers(self, chain: Torsion) -> Array:
        """Return the natural frequencies [Hz] in ascending order, shape (modes,)."""
        return natural_modes(chain, self.speed).frequencies

    def inertia(self, chain: Torsion) -> Array:
        """Return the inertia matrix of discs and rings at crank speed [kg m2], which is diagonal."""
        return np.diag(inertias(chain))

    def inertia_ratio(self, absorber: Absorber) -> float | None:
        """Return the effective over the own inertia of an absorber: 1.

        The result is None for a pendulum, which stiffens with speed.
        """
        return None if absorber.order else 1.0


@dataclass(frozen=True)
class InOrder:
    """Crank speeds [rad/s] at which an order h meets a mode (V15).

    A pendulum of inertia J that is tuned to order n acts as an inertia J / (1 - h^2/n^2).
    """

    order: float

    def numbers(self, chain: Torsion) -> Array:
        """Return the critical speeds [rad/s] in ascending order, shape (modes,) (V6)."""
        return np.asarray(math.tau * critical_modes(chain, self.order).frequencies / self.order)

    def inertia(self, chain: Torsion) -> Array:
        """Return the inertia matrix [kg m2], with J - (n/h)^2 J for each pendulum between ring and disc (V15)."""
        pulls = [complex(a.inertia * (a.order / self.order) ** 2) for a in chain.absorbers]
        return np.asarray(np.diag(inertias(chain)) - _linked(chain, [0j] * len(chain.sections) + pulls).real)

    def inertia_ratio(self, absorber: Absorber) -> float | None:
        """Return the effective over the own inertia of an absorber: 1 (ring), 1 / (1 - h^2/n^2) (pendulum).

        It is 0 if the order equals the tuning of the pendulum, so that the disc stands still. A pendulum with a spring
        has no such ratio, and None is returned.
        """
        if not absorber.order:
            return 1.0
        if absorber.stiffness:
            return None
        denominator = 1.0 - (self.order / absorber.order) ** 2
        return 1.0 / denominator if denominator else 0.0


Resonance: TypeAlias = AtSpeed | InOrder
"""Crank speed or order for which natural modes are computed."""


@dataclass(frozen=True, eq=False)
class TorsionalModes:
    """Undamped natural modes, the lowest first, without rigid rotation (V4).

    Attributes
    ----------
    frequencies
        Natural frequencies [Hz], shape (modes,).
    shapes
        Angle of every disc at crank speed (V16), shape (discs, modes), the largest of each one.
    rings
        Angle of every absorber's ring at crank speed, shape (absorbers, modes).
    """

    frequencies: Array
    shapes: Array
    rings: Array


def natural_modes(chain: Torsion, speed: float = 0.0) -> TorsionalModes:
    """Return the undamped modes at a crank speed [rad/s], which sets the stiffness of pendulums (V4)."""
    return _modes(chain, np.diag(inertias(chain)), [absorber.stiffness_at(speed) for absorber in chain.absorbers])


def critical_modes(chain: Torsion, order: float) -> TorsionalModes:
    """Return the undamped modes that an order meets, each at its critical speed (V15)."""
    return _modes(chain, InOrder(order).inertia(chain), [absorber.stiffness for absorber in chain.absorbers])


def _modes(chain: Torsion, inertia: Array, fixed: Sequence[float]) -> TorsionalModes:
    """Return the natural modes of a chain of discs: solve K q = (2 pi f)^2 J q in the twists of all links (V4).

    Some links may have no stiffness.

    `fixed` are the stiffnesses of the absorbers in these modes [N m/rad].
    """
    stiff = np.array([*(section.stiffness for section in chain.sections), *fixed])
    # no torque from outside acts on the chain, so that its angular momentum is zero
    twists = np.vstack([chain.incidence, inertia.sum(axis=0)])
    angles = np.linalg.inv(twists)[:, :-1]
    mass, has_stiffness = angles.T @ inertia @ angles, stiff > 0.0
    # a link without stiffness twists until it carries no torque
    loose = np.linalg.solve(mass[np.ix_(~has_stiffness, ~has_stiffness)], mass[np.ix_(~has_stiffness, has_stiffness)])
    root = np.sqrt(stiff[has_stiffness])
    reduced = mass[np.ix_(has_stiffness, has_stiffness)] - mass[np.ix_(has_stiffness, ~has_stiffness)] @ loose
    inverse, shapes = np.linalg.eigh(reduced / np.outer(root, root))
    # an inertia that is negative in its order has no frequency
    real = inverse > _NONE * np.abs(inverse).max()
    shapes = shapes[:, real][:, ::-1] / root[:, None]
    shapes = angles[:, has_stiffness] @ shapes - angles[:, ~has_stiffness] @ (loose @ shapes)
    count = len(chain.discs)
    shapes = shapes / shapes[np.abs(shapes).argmax(axis=0), np.arange(shapes.shape[1])]
    # the front disc swings to the positive side
    shapes = shapes * np.where(shapes[0] < -_FREE, -1.0, 1.0)
    return TorsionalModes(1.0 / np.sqrt(inverse[real][::-1]) / math.tau, shapes[:count], shapes[count:])


def vector_sums(engine: Engine, orders: Sequence[float], modes: TorsionalModes) -> Array:
    """Return the vector sums by which the cylinders excite each mode, shape (orders, modes) (V6; textbook 2.9).

    A vector sum is |sum_k a_k e^{-i h phi_k}| over the cylinders.

    phi_k is the firing angle of cylinder k, a_k the amplitude of its throw in the mode. The sum is the
    work of all cylinders over that of one cylinder at the largest amplitude.
    """
    swings, fires = [], []
    for disc, shape in zip(chain_of(engine).discs, modes.shapes, strict=True):
        for part in engine.slider_cranks:
            if part.name in disc.cylinders:
                swings.append(shape)
                fires.append(-as_turn(part.firing_angle) / engine.cycle.turns)
    multiples = np.array([round(order * engine.cycle.turns) for order in orders])
    sums = phasors(fires, multiples) @ np.array(swings)
    floor = (len(fires) + 2) * np.finfo(float).eps * np.abs(swings).sum(axis=0)
    return np.asarray(np.where(np.abs(sums) <= floor, 0.0, np.abs(sums)))


def main_orders(engine: Engine, highest: float) -> tuple[float, ...]:
    """Return the orders in which all cylinders act in phase, multiples of cylinders over turns of a cycle (V7)."""
    first = len(engine.cylinders) / engine.cycle.turns
    return tuple(k * first for k in range(1, int(highest / first + 1e-9) + 1))


def critical_speed(frequency: float, order: float) -> float:
    """Return the crank speed [rad/s] at which an order meets a natural frequency [Hz] (V6)."""
    return math.tau * frequency / order


def chain_of(engine: Engine) -> Torsion:
    """Return the chain of discs and shafts of an engine; raise `ModelError` if it has none."""
    chain = engine.extra(Torsion)
    if chain is None:
        raise ModelError("twist of the crankshaft needs its discs and shafts; add [torsion]")
    return chain


def has_torsion(engine: Engine, fidelity: Fidelity = EXACT) -> bool:
    """Return True if twist is modelled: the crankshaft has a chain of discs, and its mean speed is constant."""
    return engine.extra(Torsion) is not None and not fidelity.has_uneven_speed


def throw_torques(engine: Engine, point: OperatingPoint, fidelity: Fidelity = EXACT) -> Spectrum:
    """Return the torque of gas, pistons, rods, load and machines on every disc, (n, discs) [N m] (T1, T12, T16).

    The load acts at crank speed, on the disc where the driven machine takes its torque.

    An uneven crank speed, or a cylinder on another shaft, raises `ModelError`.
    """
    if fidelity.has_uneven_speed:
        raise ModelError("twist of the crankshaft is modelled at a constant crank speed; remove fidelity.crank_inertia")
    for part in engine.slider_cranks:
        if part.shaft != CRANKSHAFT:
            raise ModelError(
                f"the throw of {part.name} is on shaft '{part.shaft.name}'; twist is modelled for one crankshaft only"
            )
    chain = chain_of(engine)
    driven = tuple(disc.cylinders for disc in chain.discs)
    torques = _throw_torques(engine.cycle, engine.slider_cranks, driven, point, fidelity)
    at = {"": np.eye(len(driven))[chain.driven]}
    at |= {disc.name: row for disc, row in zip(chain.discs, np.eye(len(driven)), strict=True)}
    for name, torque in load_torques(engine, point, fidelity):
        torques += torque.mapped(lambda values: values[:, None]).mapped(partial(np.multiply, at[name]))
    return torques


@lru_cache(maxsize=64)
def _throw_torques(
    cycle: Cycle,
    parts: tuple[SliderCrank, ...],
    driven: tuple[tuple[str, ...], ...],
    point: OperatingPoint,
    fidelity: Fidelity,
) -> Spectrum:
    """Return the torque on each disc from its cylinders, shape (n, discs) [N m]."""
    series = [
        (k, part, cylinder_torque(cycle, part, point, fidelity))
        for k, names in enumerate(driven) for part in parts if part.name in names
    ]  # fmt: skip
    total = np.zeros((max((len(torque) for *_, torque in series), default=1), len(driven)), dtype=complex)
    for k, part, torque in series:
        total[: len(torque), k] += (
            torque * phasors([-as_turn(part.firing_angle) / cycle.turns], np.arange(len(torque)))[:, 0]
        )
    total.setflags(write=False)
    return Spectrum(cycle.base_order, total)


def receptances(chain: Torsion, orders: Array, speed: float) -> ComplexArray:
    """Return the twist of every section for one N m on every disc, shape (orders, sections, discs) [rad/(N m)] (V5).

    In order zero the load takes the torque at its own disc, and the sections from the driving disc to this one twist.
    An order on a natural frequency without damping raises `ModelError`.
    """
    count, ratios = len(chain.discs), chain.ratios[1 : len(chain.discs)]
    flexibility = np.zeros((len(orders), len(ratios), count), dtype=complex)
    is_mean = orders == 0.0
    # a section carries the torques in front of it, less that of the load if its disc is in front
    through = chain.is_in_front
    stiff = np.array([section.stiffness for section in chain.sections]) * ratios
    flexibility[is_mean] = (through * 1.0 - through[:, chain.driven, None]) / stiff[:, None]
    if np.all(is_mean):
        return flexibility
    size = count + len(chain.absorbers)
    drives = np.tile(np.eye(size, dtype=complex), (int(np.sum(~is_mean)), 1, 1))
    angles = _solved(chain, orders[~is_mean], speed, drives)[:, :count, :count]
    flexibility[~is_mean] = _twists(chain, angles)
    return flexibility


def section_stiffness(chain: Torsion, orders: Array, speed: float) -> ComplexArray:
    """Return the dynamic stiffness k (1 + i eta) + i h w c of each shaft section, (orders, sections) [N m/rad] (V8)."""
    stiff = np.array([s.stiffness * complex(1.0, s.loss_factor) for s in chain.sections])
    damping = np.array([s.damping for s in chain.sections])
    stiffness = stiff + 1j * speed * orders[:, None] * damping
    return np.asarray(np.where(orders[:, None] == 0.0, stiffness.real, stiffness))


def twist(engine: Engine, point: OperatingPoint, fidelity: Fidelity = EXACT) -> Spectrum:
    """Return the twist of each section, front end minus rear end, shape (n, sections) [rad] (V5, V16)."""
    torques, chain = throw_torques(engine, point, fidelity), chain_of(engine)
    angles = _angles(chain, torques, point.speed)[:, : len(chain.discs)]
    mean = receptances(chain, torques.orders[:1], point.speed)[0] @ torques.coefficients[0]
    return Spectrum(torques.base, np.concatenate([mean[None], _twists(chain, angles[:, :, None])[:, :, 0]]))


def shaft_torque(engine: Engine, point: OperatingPoint, fidelity: Fidelity = EXACT) -> Spectrum:
    """Return the torque in each section towards the rear, shape (n, sections) [N m] (V8)."""
    return times(twist(engine, point, fidelity), section_stiffness, chain_of(engine), point.speed)


def shaft_stress(engine: Engine, point: OperatingPoint, fidelity: Fidelity = EXACT) -> Spectrum:
    """Return the shear stress of every section with a diameter, shape (n, sections with diameter) [Pa] (V8)."""
    chain = chain_of(engine)
    sized = [k for k, section in enumerate(chain.sections) if section.diameter is not None]
    stress = times(twist(engine, point, fidelity), stress_factors, chain, point.speed)
    return stress.mapped(lambda values: values[:, sized])


def times(twisted: Spectrum, factors: Factors, chain: Torsion, speed: float) -> Spectrum:
    """Return the spectrum of a twist times the factor of each section in each order."""
    return Spectrum(twisted.base, twisted.coefficients * factors(chain, twisted.orders, speed))


def unit_factors(chain: Torsion, orders: Array, _: float) -> ComplexArray:
    """Return the factor one for every order and section, so that the load is the twist itself."""
    return np.ones((len(orders), len(chain.sections)), dtype=complex)


def stress_factors(chain: Torsion, orders: Array, speed: float) -> ComplexArray:
    """Return stress over twist, shape (orders, sections); zero for a section without a diameter (V8)."""
    moduli = np.array([0.0 if section.diameter is None else 1.0 / section.modulus for section in chain.sections])
    return np.asarray(section_stiffness(chain, orders, speed) * moduli)


def absorber_heat(engine: Engine, point: OperatingPoint, fidelity: Fidelity = EXACT) -> Array:
    """Return the mean power dissipated in each absorber, shape (absorbers,) [W] (V12)."""
    chain, torques = chain_of(engine), throw_torques(engine, point, fidelity)
    orders = torques.orders[1:]
    angles = _angles(chain, torques, point.speed)
    heat = []
    for k, absorber in enumerate(chain.absorbers):
        disc, ring, ratio = chain.links[len(chain.sections) + k]
        swing = np.abs(ratio * (angles[:, ring] - angles[:, disc])) ** 2
        heat.append(0.5 * float(np.sum(absorber.losses(orders * point.speed, point.speed) * swing)))
    return np.array(heat)


def dynamic_stiffness(chain: Torsion, orders: Array, speed: float) -> ComplexArray:
    """Return the dynamic stiffness matrix K + i H + i h w C - (h w)^2 J of the chain by order [N m/rad] (V5).

    It is affine in inertia, stiffness and damping.
    """
    rate, discs = (orders * speed)[:, None, None], len(chain.discs)
    springs = [s.stiffness * complex(1.0, s.loss_factor) for s in chain.sections]
    springs += [a.stiffness_at(speed) + 1j * a.stiffness * a.loss_factor for a in chain.absorbers]
    dampers = [*(s.damping for s in chain.sections), *(a.damping_at(speed) for a in chain.absorbers)]
    damping = _linked(chain, dampers).real
    damping[np.arange(discs), np.arange(discs)] += [disc.damping * disc.ratio**2 for disc in chain.discs]
    return np.asarray(_linked(chain, springs) + 1j * rate * damping - rate**2 * np.diag(inertias(chain)))


def _angles(chain: Torsion, torques: Spectrum, speed: float) -> ComplexArray:
    drives = np.zeros((len(torques.coefficients) - 1, len(chain.discs) + len(chain.absorbers), 1), dtype=complex)
    drives[:, : len(chain.discs), 0] = torques.coefficients[1:]
    return _solved(chain, torques.orders[1:], speed, drives)[:, :, 0]


def _solved(chain: Torsion, orders: Array, speed: float, drives: ComplexArray) -> ComplexArray:
    """Return the angles of discs and rings [rad] under torques [N m], orders above zero.

    Both have the shape (orders, discs and rings, columns).
    """
    dynamic = dynamic_stiffness(chain, orders, speed)
    try:
        angles = np.linalg.solve(dynamic, drives)
    except np.linalg.LinAlgError:
        angles = np.full_like(drives, np.inf)
    # a response that is so much larger than stiffness allows is damped by rounding alone
    size = np.abs(angles).max(axis=(1, 2)) * np.abs(dynamic).max(axis=(1, 2))
    undamped = np.flatnonzero(~(size * _SINGULAR <= np.abs(drives).max(axis=(1, 2))))
    if len(undamped):
        raise ModelError(
            f"order {orders[undamped[0]]:g} meets a natural frequency of the crankshaft at "
            f"{speed * 30.0 / math.pi:.5g} rpm, and nothing damps it; give damping, or another speed"
        )
    return np.asarray(angles)


def inertias(chain: Torsion) -> Array:
    """Return the inertias of discs and rings at crank speed, shape (discs and rings,) [kg m2] (V16)."""
    of_parts = [*(disc.inertia for disc in chain.discs), *(absorber.inertia for absorber in chain.absorbers)]
    return np.asarray(of_parts * chain.ratios**2)


def _twists(chain: Torsion, angles: ComplexArray) -> ComplexArray:
    front, rear, ratios = (np.array(column) for column in zip(*chain.links[: len(chain.sections)], strict=True))
    return np.asarray(ratios[:, None] * (angles[:, front] - angles[:, rear]))


def _linked(chain: Torsion, values: Sequence[complex]) -> ComplexArray:
    """Return the matrix of springs or dampers at crank speed from their values, sections first (V16)."""
    count = len(chain.ratios)
    matrix = np.zeros((count, count), dtype=complex)
    for (a, b, ratio), constant in zip(chain.links, values, strict=True):
        value = constant * ratio**2
        matrix[a, a] += value
        matrix[b, b] += value
        matrix[a, b] -= value
        matrix[b, a] -= value
    return matrix
