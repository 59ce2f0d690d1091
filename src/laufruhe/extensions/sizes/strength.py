"""Loads on the sections of the running gear, and their stresses (Z1-Z9).

A stress is a load inside the crankcase, linear in the masses, times a factor of the sizes alone. The crankshaft is cut
in the middle of its journals, as in the simple calculation of the sources (textbook 10.3; worked diesel G, H): the
pieces between neighbouring bearings carry the loads on them, each simply supported.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TypeVar

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.extensions.bearing_loads.machine import Bearing, bearings_of
from laufruhe.extensions.bearing_loads.physics import crank_forces, pin_forces
from laufruhe.extensions.sizes.machine import (
    Bolts,
    PistonPin,
    RunningGear,
    Shank,
    Webs,
    ring_area,
    round_inertia,
    round_modulus,
    smallest_journal,
)
from laufruhe.machine import CRANKSHAFT, Engine, OperatingPoint, SliderCrank
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.fidelity import Fidelity
from laufruhe.physics.shaking_loads import rotor_loads
from laufruhe.physics.torque import crank_torque

T = TypeVar("T")

# shear strain energy: equivalent normal stress over shear stress (textbook 10.3)
SHEAR = math.sqrt(3.0)
# the width of bosses and small end reduces the bending of a piston pin (textbook, example to eq. 93)
SPREAD = 2.0 / 3.0


# loads: sizes change them through their masses alone


def pin_moments(engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> Spectrum:
    """Return the bending moment amid each crank pin [N m], along its force, shape (n, cylinders, 3) (Z3)."""
    moments = [partial(_moment, part.x, *_span(engine, part)) for part in engine.slider_cranks]
    return _shared(engine, point, fidelity, moments)


def side_forces(engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> Spectrum:
    """Return the forces of the bearings beside each throw by loads between them [N], (n, 2 cylinders, 3) (Z4)."""
    shares: list[Callable[[float], float]] = []
    for part in engine.slider_cranks:
        front, rear = _span(engine, part)
        width = part.big_end[1] if part.big_end else 0.0
        for neighbour in (other for other in engine.slider_cranks if other.shaft == part.shaft):
            if rear.x < neighbour.x < front.x and abs(part.x - neighbour.x) > 1.5 * width:
                raise ModelError(
                    f"{part.name} and {neighbour.name} have no main bearing between them; "
                    "stresses of webs need one on either side"
                )
        shares += [partial(_lever, front.x, rear.x), partial(_lever, rear.x, front.x)]
    return _shared(engine, point, fidelity, shares)


def journal_torques(engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> Spectrum:
    """Return the torque through each main bearing [N m], output at the rear, shape (n, bearings) (Z5)."""
    return _torques(engine, point, fidelity, [bearing.x for bearing in bearings_of(engine)])


def side_loads(engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> Spectrum:
    """Return bending force [N] and torque [N m] of the journals next to each throw, shape (n, 2 cylinders, 4) (Z6)."""
    forces = side_forces(engine, point, fidelity)
    places = [bearing.x for part in engine.slider_cranks for bearing in _span(engine, part)]
    torques = _torques(engine, point, fidelity, places)
    force_columns, torque_column = np.eye(3, 4), np.eye(4)[3]
    return forces.mapped(lambda values: values @ force_columns) + torques.mapped(
        lambda values: values[..., None] * torque_column
    )


def cap_forces(engine: Engine, point: OperatingPoint, fidelity: Fidelity) -> Spectrum:
    """Return the pull of inertia alone on the big-end caps [N], as in gas exchange, shape (n, cylinders, 3) (Z8)."""
    return pin_forces(engine, replace(point, gas=None), fidelity)


def _shared(
    engine: Engine, point: OperatingPoint, fidelity: Fidelity, shares: Sequence[Callable[[float], float]]
) -> Spectrum:
    """Return sums of loads of rods, webs and weights, each times a function of its position along the crankshaft."""
    if any(part.shaft != CRANKSHAFT for part in engine.slider_cranks):
        raise ModelError("stresses are computed for engines with one crankshaft")
    by_rod = np.array([[share(part.x) for part in engine.slider_cranks] for share in shares])
    by_rod = by_rod.reshape(len(shares), len(engine.slider_cranks))
    total = crank_forces(engine, point, fidelity).mapped(partial(np.einsum, "kc,ncd->nkd", by_rod))
    for rotor in engine.rotors:
        factors = np.array([share(rotor.x) for share in shares])
        if rotor.shaft == CRANKSHAFT and rotor.unbalance and factors.any():
            load = rotor_loads((rotor,), point.speed, engine.cycle)
            total = total + load.mapped(lambda wrench: wrench[:, :3]).mapped(partial(np.einsum, "k,nd->nkd", factors))
    return total


def _torques(engine: Engine, point: OperatingPoint, fidelity: Fidelity, places: Sequence[float]) -> Spectrum:
    total = Spectrum(engine.cycle.base_order, np.zeros((1, len(places)), dtype=complex))
    if any(part.shaft != CRANKSHAFT for part in engine.slider_cranks):
        raise ModelError("stresses are computed for engines with one crankshaft")
    for part in engine.slider_cranks:
        behind = np.array([float(part.x > x) for x in places])
        if behind.any():
            torque = crank_torque(replace(engine, slider_cranks=(part,)), point, fidelity)
            total = total + torque.mapped(partial(np.einsum, "k,n->nk", behind))
    return total


def _span(engine: Engine, part: SliderCrank) -> tuple[Bearing, Bearing]:
    front = [b for b in bearings_of(engine) if b.shaft == part.shaft and b.x > part.x]
    rear = [b for b in bearings_of(engine) if b.shaft == part.shaft and b.x < part.x]
    if not front or not rear:
        raise ModelError(
            f"the throw of {part.name} has no main bearing on one side; stresses of webs and pins need two"
        )
    return min(front, key=lambda b: b.x), max(rear, key=lambda b: b.x)


def _lever(loaded: float, unloaded: float, position: float) -> float:
    share = (unloaded - position) / (unloaded - loaded)
    return share if 0.0 <= share <= 1.0 else 0.0


def _moment(section: float, front: Bearing, rear: Bearing, x: float) -> float:
    if not rear.x < x < front.x:
        return 0.0
    if x >= section:
        return (section - rear.x) * _lever(rear.x, front.x, x)
    return (front.x - section) * _lever(front.x, rear.x, x)


# factors: functions of the sizes alone


def gear_of(engine: Engine) -> RunningGear:
    """Return the running gear of an engine; raise ModelError if the engine has none."""
    gear = engine.extra(RunningGear)
    if gear is None:
        raise ModelError("a stress or clearance needs sizes of the running gear; add [running_gear]")
    return gear


def big_end_factors(engine: Engine, _: OperatingPoint) -> Array:
    """Return the reciprocal section modulus of each crank pin [1/m3], shape (cylinders,) (Z3)."""
    return np.array([1.0 / round_modulus(_pin_size(part)[0]) for part in engine.slider_cranks])


def web_factors(engine: Engine, _: OperatingPoint) -> Array:
    """Return the web stress per force on its side [1/m2]: bending plus pressure, shape (2 cylinders,) (Z4)."""
    webs = _part(engine, "webs", Webs)
    factors = []
    for part in engine.slider_cranks:
        middle = 0.5 * (_pin_size(part)[1] + webs.thickness)
        for bearing in _span(engine, part):
            lever = max(abs(bearing.x - part.x) - middle, 0.0)
            factors.append(lever / webs.modulus + 1.0 / webs.area)
    return np.array(factors)


def journal_factors(engine: Engine, _: OperatingPoint) -> Array:
    """Return the reciprocal torsion modulus of each journal [1/m3], shape (bearings,) (Z5)."""
    return np.array([0.5 / round_modulus(_journal(bearing)[0]) for bearing in bearings_of(engine)])


def side_factors(engine: Engine, _: OperatingPoint) -> Array:
    """Return edge stresses per force and torque of the journals next to each throw, shape (2 cylinders, 4) (Z6)."""
    rows = []
    for part in engine.slider_cranks:
        for diameter, width in map(_journal, _span(engine, part)):
            modulus = round_modulus(diameter)
            rows.append([*[0.5 * width / modulus] * 3, 0.5 * SHEAR / modulus])
    return np.array(rows)


def rod_stress_factors(engine: Engine, _: OperatingPoint) -> Array:
    """Return the reciprocal section of each rod [1/m2], shape (cylinders,) (Z7)."""
    return np.full(len(engine.slider_cranks), 1.0 / _part(engine, "rod", Shank).area)


def buckling_factors(engine: Engine, _: OperatingPoint) -> Array:
    """Return the reciprocal buckling load of each rod, hinged at both ends [1/N] (Z7; worked diesel H.a)."""
    stiffness = math.pi**2 * gear_of(engine).elastic_modulus * _part(engine, "rod", Shank).inertia
    return np.array([part.rod_length**2 / stiffness for part in engine.slider_cranks])


def bolt_factors(engine: Engine, _: OperatingPoint) -> Array:
    """Return the reciprocal bolt section of each big end [1/m2], shape (cylinders,) (Z8)."""
    return np.full(len(engine.slider_cranks), 1.0 / _part(engine, "bolts", Bolts).area)


def boss_factors(engine: Engine, _: OperatingPoint) -> Array:
    """Return the reciprocal boss area of each piston pin [1/m2], shape (cylinders,) (Z9; eq. 92)."""
    return _of_pins(engine, lambda pin: 1.0 / pin.boss_area)


def pin_bending_factors(engine: Engine, _: OperatingPoint) -> Array:
    """Return the bending stress of each piston pin per force [1/m2], shape (cylinders,) (Z9)."""
    return _of_pins(engine, lambda pin: SPREAD * 0.25 * pin.span / round_modulus(pin.diameter, pin.bore))


def deflection_factors(engine: Engine, _: OperatingPoint) -> Array:
    """Return the deflection of each piston pin per force [m/N], shape (cylinders,) (Z9; eq. 93)."""
    modulus = gear_of(engine).elastic_modulus
    return _of_pins(engine, lambda pin: SPREAD * pin.span**3 / (48.0 * modulus * round_inertia(pin.diameter, pin.bore)))


def ovality_factors(engine: Engine, _: OperatingPoint) -> Array:
    """Return the ovalisation of each piston pin per force [m/N], shape (cylinders,) (Z9; eq. 94)."""
    modulus = gear_of(engine).elastic_modulus

    def factor(pin: PistonPin) -> float:
        radius, wall = 0.25 * (pin.diameter + pin.bore), pin.diameter - pin.bore
        return radius**3 / (12.0 * modulus * pin.length * wall**3 / 96.0)

    return _of_pins(engine, factor)


def journal_speeds(engine: Engine, point: OperatingPoint) -> Array:
    """Return the surface speed of each journal over its projected area [1/(m s)] (Z10; worked diesel G.c.V)."""
    sizes = [(_journal(bearing), abs(bearing.shaft.ratio)) for bearing in bearings_of(engine)]
    return np.array([0.5 * ratio * point.speed * d / (d * width) for (d, width), ratio in sizes])


def throw_clearance(engine: Engine) -> float:
    """Return the smallest axial clearance of pin, webs and half journals between main bearings [m] (Z11)."""
    thickness = _part(engine, "webs", Webs).thickness
    clearances = []
    for part in engine.slider_cranks:
        bearings = _span(engine, part)
        for bearing in bearings:
            space = abs(bearing.x - part.x) - 0.5 * (_pin_size(part)[1] + _journal(bearing)[1])
            clearances.append(space - thickness)
    return min(clearances)


def running_gear_mass(engine: Engine) -> float:
    """Return the mass of the running gear: all crank pins, webs, rod shanks and piston pins [kg] (Z2)."""
    gear = gear_of(engine)
    if gear.density is None:
        raise ModelError("the mass of the running gear needs a density; add running_gear.density")
    pins = {(part.shaft, part.x, round(part.throw, 9)): part for part in engine.slider_cranks}
    total = 0.0
    for part in pins.values():
        total += 0.0 if part.big_end is None else ring_area(part.big_end[0], 0.0) * part.big_end[1]
    journal = smallest_journal(bearings_of(engine))
    for part in pins.values() if gear.webs else ():
        diameter = part.big_end[0] if part.big_end else 0.0
        reach = part.crank_radius + 0.5 * diameter + 0.5 * journal
        total += 2.0 * _part(engine, "webs", Webs).area * reach
    for part in engine.slider_cranks:
        if gear.rod is not None and not math.isinf(part.rod_length):
            total += gear.rod.area * part.rod_length
        if gear.piston_pin is not None:
            total += ring_area(gear.piston_pin.diameter, gear.piston_pin.bore) * gear.piston_pin.length
    return gear.density * total


def _of_pins(engine: Engine, factor: Callable[[PistonPin], float]) -> Array:
    return np.full(len(engine.slider_cranks), factor(_part(engine, "piston_pin", PistonPin)))


def _part(engine: Engine, name: str, kind: type[T]) -> T:
    part = gear_of(engine).part(name)
    if not isinstance(part, kind):
        raise TypeError(f"{name} is no {kind.__name__}")
    return part


def _pin_size(part: SliderCrank) -> tuple[float, float]:
    if part.big_end is None:
        raise ModelError(f"{part.name} has no big end, so its crank pin has no size; add engine.big_end")
    return part.big_end


def _journal(bearing: Bearing) -> tuple[float, float]:
    if bearing.diameter is None or bearing.width is None:
        raise ModelError(f"bearing '{bearing.name}' has no diameter or no width, so its journal has no size")
    return bearing.diameter, bearing.width
