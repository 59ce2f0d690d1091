"""Loads inside the crankcase of an in-line engine, from positions and the law of the lever alone.

A massless rod pushes along itself. A rod with a shank has the inertia of its turn as well. Two bearings carry a load
between them as supports of a beam. Torque is work per angle, speed follows from energy, and discs on shafts answer
order by order.
"""

from __future__ import annotations

import json
import math
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.optimize import brentq

from attack.plain_electric import on_crank_and_block
from attack.plain_loads import (
    ATMOSPHERE,
    FINE,
    LAST_ORDER,
    SAMPLES,
    Machine,
    Mechanism,
    angles,
    energy_of,
    number,
    piston,
    rod_end,
    seiliger,
    shank_of,
    slope,
    travel,
)
from attack.plain_rotary import on_eccentric
from attack.plain_rotary import torque as rotor_torque

FORCES = ("main-bearing force", "crank-pin force")
OF_SHAFT = ("crank torque", "stored work", "shaft twist")
CHANNELS = (*FORCES, *OF_SHAFT)


def signal(scene: Any, machine: Machine, channel: str, orders: list[float] | None) -> np.ndarray:
    """Return a signal (points, places, samples, d) at every operating point, of some orders if they are named."""
    whole = np.stack([at(scene, machine, channel, k) for k in range(len(scene.points))])
    if orders is None:
        return whole
    parts, multiples = np.fft.rfft(whole, axis=2), np.arange(SAMPLES // 2 + 1) / machine.turns
    parts[:, :, ~np.isin(multiples, orders)] = 0.0
    return np.fft.irfft(parts, SAMPLES, axis=2)


def irregularity(scene: Any, machine: Machine, weights: np.ndarray) -> float:
    """Return the largest degree of irregularity of the points that count."""
    if "flywheel" in scene.table:
        inertia = number(scene.table["flywheel"]["inertia"])
    else:
        keys = scene.table["torsion"]
        inertia = number(keys["discs"][0]["inertia"])
        inertia += sum(number(keys["throw_inertia"]) + m.pin_mass * m.radius**2 for m in machine.mechanisms)
    return max(_uneven(scene, machine, k, inertia) for k in range(len(scene.points)) if weights[k] > 0.0)


def at(scene: Any, machine: Machine, channel: str, k: int) -> np.ndarray:
    speed, gas = scene.speeds[k], gas_at(scene, k)
    if channel in FORCES:
        pins = np.array([on_pin(m, machine.turns, speed, gas) for m in machine.mechanisms])
        signal = pins if channel == "crank-pin force" else _on_bearings(scene, machine, pins, speed)
        return np.stack([signal.imag, signal.real], axis=-1)
    torques = [torque_of(m, machine.turns, speed, gas) for m in machine.mechanisms]
    if channel == "shaft twist":
        return _twist(scene, machine, torques, speed)
    total = np.sum(torques, axis=0)
    if channel == "stored work" and "electric_machines" in scene.table:
        total = total + on_crank_and_block(scene, scene.points[k])[0]
    signal = total if channel == "crank torque" else _integral(total - total.mean(), machine.turns)
    return signal[None, :, None]


def gas_at(scene: Any, k: int) -> dict[str, Any] | None:
    point = scene.points[k]
    if "gas" not in scene.table or not point.get("gas", True):
        return None
    return {**scene.table["gas"], **({"imep": point["imep"]} if "imep" in point else {})}


def _moving(m: Mechanism, turns: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the places of crank pin and piston over the crank angle."""
    base = rod_end(m, angles(turns))
    return base, piston(base, m.rod, m.bank, m.offset)[1]


def _velocity(m: Mechanism, turns: int) -> np.ndarray:
    """Return the velocity of the piston along its axis, by the crank angle."""
    return slope(travel(m, m.ratio * angles(turns) + m.throw - m.bank), turns).real


def _pressing(m: Mechanism, turns: int, gas: dict[str, Any] | None) -> np.ndarray:
    """Return the force of the gas on the piston, along its axis from the crank."""
    if gas is None or m.fires is None:
        return np.zeros(SAMPLES)
    alike = replace(m, x=0.0, throw=0.0, bank=0.0, fires=None, piston_mass=0.0, pin_mass=0.0, shank=0.0)
    over = _over_crankcase(alike, turns, json.dumps(gas, sort_keys=True))
    fine = angles(turns, FINE)
    since = np.mod(angles(turns) - m.fires, 2.0 * np.pi * turns)
    return -0.25 * math.pi * m.bore**2 * np.interp(since, fine, over, period=2.0 * np.pi * turns)


@lru_cache(maxsize=64)
def _over_crankcase(m: Mechanism, turns: int, gas: str) -> np.ndarray:
    """Return pressure over that of the crankcase, on a fine grid from firing: the same wherever the throw stands."""
    gas_keys = json.loads(gas)
    return seiliger(gas_keys, m, turns) - number(gas_keys.get("crankcase_pressure", ATMOSPHERE))


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the moment of b at a, in a plane of complex numbers."""
    return (np.conj(a) * b).imag


def _pushed(m: Mechanism, turns: int, speed: float, gas: dict[str, Any] | None) -> tuple[np.ndarray, ...]:
    """Return the side force of the wall on the piston, and the force on the crank pin [N]."""
    base, end = _moving(m, turns)
    axis = np.exp(1j * m.bank)
    pressing = _pressing(m, turns, gas) * axis
    lost = m.piston_mass * speed**2 * slope(slope(end, turns), turns)
    moment, total = _cross(end - base, lost - pressing), lost - pressing
    for share, mass in shank_of(m):
        force = mass * speed**2 * slope(slope(base + share * (end - base), turns), turns)
        moment, total = moment + _cross(share * (end - base), force), total + force
    wall = moment / _cross(end - base, 1j * axis * np.ones(len(base)))
    return wall, wall * 1j * axis - total


def pressing_rod(m: Mechanism, turns: int, speed: float, gas: dict[str, Any] | None) -> np.ndarray:
    """Return the force along the cylinder on the rod, with half of its shank, and across it of the wall."""
    _, end = _moving(m, turns)
    mass = m.piston_mass + 0.5 * m.shank
    inertia = mass * speed**2 * (slope(slope(end, turns), turns) * np.exp(-1j * m.bank)).real
    return _pressing(m, turns, gas) - inertia + 1j * _pushed(m, turns, speed, gas)[0]


def side_force(m: Mechanism, turns: int, speed: float) -> np.ndarray:
    """Return the force of the wall on a piston without gas, with what turns its rod beside two masses [N]."""
    base, end = _moving(m, turns)
    turned = slope(slope(piston(base, m.rod, m.bank, m.offset)[2], turns), turns).real
    reach = _cross(end - base, 1j * np.exp(1j * m.bank) * np.ones(len(base)))
    return _pushed(m, turns, speed, None)[0] + m.deficit * speed**2 * turned / reach


def on_pin(m: Mechanism, turns: int, speed: float, gas: dict[str, Any] | None) -> np.ndarray:
    """Return the force of the rod on its pin [N]."""
    if m.shape is not None:
        return on_eccentric(gas, m, speed)
    return _pushed(m, turns, speed, gas)[1]


def on_shaft(scene: Any, machine: Machine, pins: Any, speed: float) -> list[tuple[float, np.ndarray]]:
    """Return the loads on the crankshaft, each with its place."""
    turned = np.exp(1j * angles(machine.turns))
    loads = [(m.x, pin) for m, pin in zip(machine.mechanisms, pins, strict=True)]
    # masses that turn with a throw beside its rod
    loads += [(m.x, m.pin_mass * speed**2 * rod_end(m, angles(machine.turns))) for m in machine.mechanisms]
    return loads + [
        (x, unbalance * speed**2 * turned) for _, x, _, _, unbalance, _, role in scene.rotors if role == "c"
    ]


def _on_bearings(scene: Any, machine: Machine, pins: np.ndarray, speed: float) -> np.ndarray:
    """Return each load shared by the two bearings beside it; an overhung load acts by its lever."""
    places = [number(b["x"]) for b in scene.table["main_bearings"]]
    out = np.zeros((len(places), SAMPLES), complex)
    loads = on_shaft(scene, machine, pins, speed)
    ranked = sorted(range(len(places)), key=lambda j: places[j])
    for x, load in loads:
        above = min(max(sum(places[j] < x for j in ranked), 1), len(ranked) - 1)
        low, high = ranked[above - 1], ranked[above]
        share = (x - places[low]) / (places[high] - places[low])
        out[high] += share * load
        out[low] += (1.0 - share) * load
    return out


def torque_of(m: Mechanism, turns: int, speed: float, gas: dict[str, Any] | None) -> np.ndarray:
    """Return the torque of one cylinder: work of the gas less the change of kinetic energy, by angle [N m]."""
    if m.shape is not None:
        fired = np.mod(angles(turns) - (m.fires or 0.0), 2.0 * np.pi)
        return np.interp(fired, angles(1, FINE), rotor_torque(gas, m), period=2.0 * np.pi) if gas else np.zeros(SAMPLES)
    return -(speed**2) * slope(energy_of(m, turns), turns).real + _pressing(m, turns, gas) * _velocity(m, turns)


def _integral(torque: np.ndarray, turns: int) -> np.ndarray:
    c = np.fft.rfft(torque)
    k = np.arange(len(c)) / turns
    return np.fft.irfft(np.where(k > 0.0, c / (1j * np.where(k > 0.0, k, 1.0)), 0.0), len(torque))


def _uneven(scene: Any, machine: Machine, k: int, wheel: float) -> float:
    """Return the degree of irregularity from the kinetic energy; the mean speed over time is that of the point."""
    speed, gas, turns = scene.speeds[k], gas_at(scene, k), machine.turns
    inertia, torque = np.full(SAMPLES, wheel), np.zeros(SAMPLES)
    for m in machine.mechanisms:
        if m.shape is not None:
            inertia += m.shape.inertia / 9.0
            torque += torque_of(m, turns, speed, gas)
            continue
        inertia += 2.0 * energy_of(m, turns)
        torque += _pressing(m, turns, gas) * _velocity(m, turns)
    torque = torque + on_crank_and_block(scene, scene.points[k])[0]
    work = _integral(torque - torque.mean(), turns)

    def mean_over_speed(energy: float) -> float:
        return float(np.mean(speed / np.sqrt(2.0 * (energy + work) / inertia))) - 1.0

    rough = 0.5 * speed**2 * inertia.mean()
    energy = brentq(mean_over_speed, -work.min() * (1.0 + 1e-9) + 1e-9 * rough, 100.0 * rough + abs(work).max())
    speeds = np.sqrt(2.0 * (energy + work) / inertia)
    return float((speeds.max() - speeds.min()) / speed)


def _twist(scene: Any, machine: Machine, torques: list[np.ndarray], speed: float) -> np.ndarray:
    """Return the angle of each disc before the next one, from the front, shape (sections, samples, 1)."""
    keys, turns = scene.table["torsion"], machine.turns
    stiff = [number(keys["crank"]["stiffness"])] * (len(torques) - 1) + [number(keys["discs"][0]["shaft"]["stiffness"])]
    damping, loss = number(keys["cylinder_damping"]), keys["loss_factor"]
    # cylinders are listed from the front; what turns beside their rods is at the crank radius
    discs = []
    for m in machine.mechanisms:
        swinging = 2.0 * float(np.mean(energy_of(m, turns)))
        discs.append(number(keys["throw_inertia"]) + m.pin_mass * m.radius**2 + swinging)
    inertia = np.array([*discs, number(keys["discs"][0]["inertia"])])
    size = len(inertia)
    links = np.zeros((size, size), complex)
    for k, stiffness in enumerate(stiff):
        links[[k, k + 1], [k, k + 1]] += stiffness * (1.0 + 1j * loss)
        links[[k, k + 1], [k + 1, k]] -= stiffness * (1.0 + 1j * loss)
    drives = np.array([np.fft.rfft(t) / SAMPLES for t in torques])
    out = np.zeros((len(stiff), drives.shape[1]), complex)
    through = np.cumsum(drives[:, 0].real)
    out[:, 0] = through / np.array(stiff)
    friction = np.diag([damping] * len(torques) + [0.0])
    for k in range(1, int(LAST_ORDER * turns)):
        rate = k / turns * speed
        answer = np.linalg.solve(links + 1j * rate * friction - rate**2 * np.diag(inertia), [*drives[:, k], 0.0])
        out[:, k] = answer[:-1] - answer[1:]
    return np.fft.irfft(out, SAMPLES, axis=1)[:, :, None] * SAMPLES
