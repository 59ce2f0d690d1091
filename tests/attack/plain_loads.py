"""Loads of an engine as a problem file describes it, from positions, momentum and energy alone.

Nothing here comes from the package: every mass has a place at many crank angles, a transform differentiates it, force
is the loss of momentum, and the roll moment is the loss of angular momentum and the reaction to the crank torque, which
at constant speed is the loss of kinetic energy. Gas works on the volume. Tables are those of a problem file whose
numbers are in base units.
"""

from __future__ import annotations

import json
import math
import os
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.optimize import brentq

from attack import plain_drives

# more of them resolve the bends of gas torque better
SAMPLES = int(os.environ.get("ATTACK_SAMPLES", "4096"))
# highest order of crank speed; higher ones are below rounding
LAST_ORDER = 60
PASCAL = {"Pa": 1.0, "bar": 1e5}


def number(text: Any) -> float:
    """Return the value of "3.5 kg" in its base unit, or of a bare number."""
    if not isinstance(text, str):
        return float(text)
    value, _, unit = text.partition(" ")
    return float(value) * PASCAL.get(unit, 1.0)


@dataclass(frozen=True)
class Knuckle:
    """Knuckle pin of an articulated rod on the master rod."""

    rod: float
    bank: float
    offset: float
    radius: float
    angle: float


@dataclass(frozen=True)
class Lever:
    """A slotted lever about a pivot beside the crank, that drives a ram."""

    pivot: float
    length: float
    height: float
    mass: float
    centre: float
    inertia: float
    weight: float
    weight_radius: float


@dataclass(frozen=True)
class Shape:
    """A rotor with three flanks: to its apexes, along the shaft, and its inertia about its centre."""

    radius: float
    width: float
    inertia: float


@dataclass(frozen=True)
class Mechanism:
    """A piston on a rod on a crank, or a ram on a lever, or a rotor on an eccentric."""

    x: float
    throw: float
    bank: float
    radius: float
    rod: float
    piston_mass: float
    pin_mass: float = 0.0
    deficit: float = 0.0
    offset: float = 0.0
    ratio: float = 1.0
    centre: complex = 0j
    knuckle: Knuckle | None = None
    lever: Lever | None = None
    linkage: plain_drives.Linkage | None = None
    displacer_mass: float | None = None
    """Mass at a second rod on the pin; None without one."""
    shape: Shape | None = None
    partner: tuple[float, float, float] | None = None
    """Radius and rod of another piston in the same cylinder, and by how much it comes first."""
    bore: float = 0.0
    shank: float = 0.0
    """Mass of a straight rod between its pins."""
    fires: float | None = None
    """Crank angle of its firing; None for one without gas of its own."""


Weights = list[tuple[float, np.ndarray]]


def angles(turns: int, samples: int = SAMPLES) -> np.ndarray:
    return 2.0 * np.pi * turns * np.arange(samples) / samples


def slope(signal: np.ndarray, turns: int) -> np.ndarray:
    """Return the derivative by the crank angle of a periodic signal (complex)."""
    c = np.fft.fft(signal)
    k = np.fft.fftfreq(len(signal), 1.0 / len(signal)) / turns
    c[np.abs(k) > LAST_ORDER] = 0.0
    return np.fft.ifft(1j * k * c)


def piston(base: np.ndarray, rod: float, bank: float, offset: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the place along the cylinder, place in the plane, and angle of a rod that starts at `base`."""
    turned = base * np.exp(-1j * bank)
    aside = turned.imag - offset
    along = turned.real + np.sqrt(rod**2 - aside**2)
    return along, np.exp(1j * bank) * (along + 1j * offset), bank - np.arcsin(aside / rod)


def rod_end(m: Mechanism, phi: np.ndarray) -> np.ndarray:
    """Return the pin that carries the rod."""
    pin = m.radius * np.exp(1j * (m.ratio * phi + m.throw))
    if m.knuckle is None:
        return pin
    k = m.knuckle
    _, _, turned = piston(pin, k.rod, k.bank, k.offset)
    return pin + k.radius * np.exp(1j * (turned + k.angle))


def shank_of(m: Mechanism) -> list[tuple[float, float]]:
    """Return the three points on a straight rod, from the crank pin, that have its mass, its centre and its inertia."""
    aside = 0.5 * math.sqrt(0.6)
    return [(0.5 + k * aside, w / 18.0 * m.shank) for k, w in ((-1, 5), (0, 8), (1, 5))] if m.shank else []


def mechanism_load(m: Mechanism, turns: int) -> np.ndarray:
    """Return the wrench at unit speed, shape (samples, 6)."""
    phi, out = angles(turns), np.zeros((SAMPLES, 6))
    base = rod_end(m, phi)
    energy = np.zeros(SAMPLES)
    masses, swings = moving(m, base)
    for mass, place in ((mass, place + m.centre) for mass, place in (*masses, (m.pin_mass, base))):
        velocity = slope(place, turns)
        force = -mass * slope(velocity, turns)
        energy += 0.5 * mass * np.abs(velocity) ** 2
        out += force_at(m.x, place, force)
    for inertia, angle in swings:
        if inertia:
            rate = turning(angle, turns)
            energy += 0.5 * inertia * rate**2
            out[:, 3] += inertia * slope(rate, turns).real
    out[:, 3] -= slope(energy, turns).real
    return out


def moving(m: Mechanism, base: np.ndarray) -> tuple[Weights, Weights]:
    """Return masses with their places without the pin at `base`, and inertias with the angles of their bodies."""
    axis = np.exp(1j * m.bank)
    if m.shape is not None:
        # it turns evenly about its centre
        return [(m.piston_mass, base)], []
    if m.lever is not None:
        masses, angle = lever_masses(m, m.lever, base)
        return masses, [(m.lever.inertia, angle)]
    if m.linkage is not None:
        masses, swings = plain_drives.rocker_masses(m.linkage, base / axis, m.piston_mass)
        return [(mass, axis * place) for mass, place in masses], swings
    if m.displacer_mass is not None:
        both = m.piston_mass, m.displacer_mass
        masses, swings = plain_drives.rhombic_masses(base / axis, m.rod, m.offset, both, m.deficit)
        return [(mass, axis * place) for mass, place in masses], swings
    _, end, swing = piston(base, m.rod, m.bank, m.offset)
    masses = [(m.piston_mass, end)]
    masses += [(mass, base + share * (end - base)) for share, mass in shank_of(m)]
    return masses, [(m.deficit, swing)]


def turning(angle: np.ndarray, turns: int) -> np.ndarray:
    """Return the rate of an angle that may gain whole turns over the cycle."""
    gained = round((2.0 * angle[-1] - angle[-2] - angle[0]) / (2.0 * np.pi)) / turns
    return slope(angle - gained * angles(turns, len(angle)), turns).real + gained


def energy_of(m: Mechanism, turns: int) -> np.ndarray:
    """Return the kinetic energy at unit speed, without parts that turn with the pin."""
    masses, swings = moving(m, rod_end(m, angles(turns)))
    energy = np.sum([0.5 * mass * np.abs(slope(place, turns)) ** 2 for mass, place in masses], axis=0)
    return energy + sum(0.5 * inertia * turning(angle, turns) ** 2 for inertia, angle in swings if inertia)


def lever_masses(m: Mechanism, lever: Lever, base: np.ndarray) -> tuple[list[tuple[float, np.ndarray]], np.ndarray]:
    """Return the ram, lever and its weight with their places, and the angle of the lever, of a crank pin at `base`."""
    axis = np.exp(1j * m.bank)
    angle = np.unwrap(np.angle(base / axis + 1j * lever.pivot))
    along, pivot = np.exp(1j * angle), -1j * lever.pivot
    ram = lever.length * np.cos(angle) + 1j * lever.height
    places = [
        (m.piston_mass, ram), (lever.mass, pivot + lever.centre * along),
        (lever.weight, pivot - lever.weight_radius * along),
    ]  # fmt: skip
    return [(mass, axis * place) for mass, place in places], angle


def force_at(x: float, place: np.ndarray | complex, force: np.ndarray) -> np.ndarray:
    """Return the wrench of a force across the crank axis."""
    zero = np.zeros(len(force))
    return np.stack(
        [zero, force.imag, force.real, -(np.conj(place) * force).imag, -x * force.real, x * force.imag], axis=1
    )


def rotor_load(x: float, place: complex, ratio: float, unbalance: complex, turns: int) -> np.ndarray:
    """Return the wrench of an unbalance at unit speed."""
    return force_at(x, place, unbalance * ratio**2 * np.exp(1j * ratio * angles(turns)))


# --- gas


def travel(m: Mechanism, alpha: np.ndarray) -> np.ndarray:
    """Return the place of the piston along its cylinder at its own crank angles."""
    pin = m.radius * np.exp(1j * alpha)
    return piston(pin, m.rod, 0.0, m.offset)[0] if m.linkage is None else plain_drives.rocker_travel(m.linkage, pin)


def top_and_bottom(m: Mechanism) -> tuple[float, float]:
    """Return own crank angles of the highest place of the piston, and of the lowest after it."""
    if m.linkage is not None:
        centres = plain_drives.rocker_dead_centres(m.linkage, m.radius)
        assert centres is not None
        return centres[:2]
    if not m.rod:
        return 0.0, math.pi
    return math.asin(m.offset / (m.rod + m.radius)), math.pi + math.asin(m.offset / (m.rod - m.radius))


def strokes_of(m: Mechanism, turns: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the share of stroke from the top, and strokes since firing, on a fine grid of own crank angles."""
    phi, (top, bottom) = angles(turns, FINE), top_and_bottom(m)
    s = travel(m, m.ratio * phi)
    highest, lowest = travel(m, np.array([top, bottom]))
    since, up = np.mod(phi - m.ratio * top, 2.0 * np.pi * turns), 2.0 * np.pi
    down = (m.ratio * (bottom - top)) % up
    strokes = np.select(
        [since < down, since < up, since < up + down], [since / down, np.full_like(s, 1.5), np.full_like(s, 2.5)], 3.5
    )
    return (highest - s) / (highest - lowest), strokes


def seiliger(gas: dict[str, Any], m: Mechanism, turns: int) -> np.ndarray:
    """Return the absolute pressure on a fine grid of one cycle from own crank angle 0, cut-off by search."""
    return mixed_cycle(gas, *strokes_of(m, turns), 2 * turns)


def mixed_cycle(gas: dict[str, Any], share: np.ndarray, strokes: np.ndarray, whole: int) -> np.ndarray:
    """Return absolute pressure where a chamber is so far from its smallest volume, so many strokes after it fires."""
    e, n1, n2 = (gas.get(k, d) for k, d in DEFAULTS.items() if k in ("compression_ratio", *EXPONENTS))
    intake, exhaust = number(gas.get("intake_pressure", ATMOSPHERE)), number(gas.get("exhaust_pressure", ATMOSPHERE))
    peak, target = number(gas["peak_pressure"]), number(gas["imep"])
    v = 1.0 / (e - 1.0) + share
    small, large = 1.0 / (e - 1.0), e / (e - 1.0)

    def pressure(cut_off: float) -> np.ndarray:
        burnt = peak * np.minimum(1.0, cut_off * small / v) ** n2
        compressed = intake * (large / v) ** n1
        if whole == 2:
            return np.where(strokes < 1.0, burnt, compressed)
        return np.select(
            [strokes < 1.0, strokes < 2.0, strokes < 3.0],
            [burnt, np.full_like(v, exhaust), np.full_like(v, intake)], compressed,
        )  # fmt: skip

    def imep(cut_off: float) -> float:
        mean = 0.5 * (pressure(cut_off) + np.roll(pressure(cut_off), -1))
        return float(np.sum(mean * (np.roll(v, -1) - v)))

    cut_off = brentq(lambda c: imep(c) - target, 1.0, e, xtol=1e-12)
    return pressure(cut_off)


def unfired(gas: dict[str, Any], valves: str, m: Mechanism, turns: int) -> np.ndarray:
    """Return the absolute pressure without combustion, as `seiliger`, with valves that move, stay closed or open."""
    e, n = (gas.get(k, DEFAULTS[k]) for k in ("compression_ratio", "compression_exponent"))
    intake, exhaust = number(gas.get("intake_pressure", ATMOSPHERE)), number(gas.get("exhaust_pressure", ATMOSPHERE))
    share, strokes = strokes_of(m, turns)
    v = 1.0 / (e - 1.0) + share
    if valves == "open":
        return np.full_like(v, intake)
    squeezed = intake * (e / (e - 1.0) / v) ** n
    if valves == "closed" or turns == 1:
        return squeezed
    # down from the firing dead centre, up and out, down and in, up
    out, back = (strokes >= 1.0) & (strokes < 2.0), (strokes >= 2.0) & (strokes < 3.0)
    return np.select([out, back], [np.full_like(v, exhaust), np.full_like(v, intake)], squeezed)


ATMOSPHERE = 101325.0
FINE = max(16 * 4096, 4 * SAMPLES)
EXPONENTS = ("compression_exponent", "expansion_exponent")
DEFAULTS = {"compression_ratio": 17.0, "compression_exponent": 1.35, "expansion_exponent": 1.3}


def gas_torque(gas: dict[str, Any], m: Mechanism, turns: int, valves: str = "") -> np.ndarray:
    """Return the coefficients of the roll moment of the gas on one piston that fires at 0, or has `valves` instead."""
    if m.shape is not None:
        from attack.plain_rotary import spectrum

        return spectrum(gas, m)
    if m.partner is not None:
        return shared_torque(gas, m, turns)
    area = 0.25 * math.pi * m.bore**2
    pressure = unfired(gas, valves, m, turns) if valves else seiliger(gas, m, turns)
    over = pressure - number(gas.get("crankcase_pressure", ATMOSPHERE))
    rise = slope(travel(m, m.ratio * angles(turns, FINE)).astype(complex), turns).real
    return np.fft.rfft(-area * over * rise)[: SAMPLES // 2 + 1] / FINE


def shared_torque(gas: dict[str, Any], m: Mechanism, turns: int) -> np.ndarray:
    """Return the coefficients for a chamber between two pistons, from the dead centre of one."""
    assert m.partner is not None
    radius, rod, ahead = m.partner
    far, step = _with(m, radius=radius, rod=rod), 1e-4

    def left(angle: Any) -> Any:
        return -travel(m, np.asarray(angle)) - travel(far, np.asarray(angle) + ahead)

    def turning(around: float) -> float:
        return brentq(lambda a: float(left(a + step) - left(a - step)), around - 1.2, around + 1.2, xtol=1e-13)

    top, bottom = turning(-0.5 * ahead), turning(np.pi - 0.5 * ahead)
    v = left(angles(turns, FINE))
    share = np.clip((v - left(top)) / (left(bottom) - left(top)), 0.0, 1.0)
    since = np.mod(angles(turns, FINE) - top, 2.0 * np.pi * turns)
    down, up = bottom - top, 2.0 * np.pi
    strokes = np.where(since < down, 0.5, 1.5)
    if turns == 2:
        strokes = np.searchsorted([down, up, up + down], since, side="right") + 0.5
    over = mixed_cycle(gas, share, strokes, 2 * turns) - number(gas.get("crankcase_pressure", ATMOSPHERE))
    area = 0.25 * math.pi * m.bore**2
    return np.fft.rfft(area * over * slope(v.astype(complex), turns).real)[: SAMPLES // 2 + 1] / FINE


def chamber_pressure(entry: dict[str, Any], x: np.ndarray, grows: np.ndarray) -> np.ndarray:
    """Return the absolute pressure over the part of the stroke from where a chamber is smallest."""
    if "pump" in entry:
        return np.where(grows, number(entry["pump"]["suction"]), number(entry["pump"]["delivery"]))
    steam = entry["steam"]
    high, low = number(steam["admission"]), number(steam["back_pressure"])
    cut, release, close, lead, c = (
        steam[key] for key in ("cut_off", "release", "compression", "lead", "clearance")
    )  # fmt: skip
    out = high * np.minimum(1.0, (cut + c) / (np.minimum(x, release) + c))
    out = out + (low - out) * np.maximum(x - release, 0.0) / max(1.0 - release, 1e-300)
    back = low * np.maximum(1.0, (close + c) / (np.maximum(x, lead) + c))
    back = back + (high - back) * np.maximum(lead - x, 0.0) / max(lead, 1e-300)
    return np.where(grows, out, back)


def chambers_torque(gas: dict[str, Any], k: int, m: Mechanism) -> np.ndarray:
    """Return coefficients of the roll moment of all chambers of cylinder k, its own crank angle counted from zero."""
    s = travel(m, m.ratio * angles(1, FINE))
    rise = slope(s.astype(complex), 1).real
    x = (s.max() - s) / np.ptp(s)
    force = np.zeros(FINE)
    for entry in gas["chambers"]:
        if k + 1 in entry.get("cylinders", [k + 1]):
            head = entry["end"] == "head"
            area = 0.25 * math.pi * (number(entry["bore"]) ** 2 - number(entry.get("rod", 0.0)) ** 2)
            over = chamber_pressure(entry, x if head else 1.0 - x, (rise < 0.0) == head) - ATMOSPHERE
            force -= area * over * (1.0 if head else -1.0)
    return np.fft.rfft(force * rise)[: SAMPLES // 2 + 1] / FINE


# --- an engine of a problem file


@dataclass(frozen=True)
class Machine:
    """Mechanisms of an engine, and how many turns its cycle has."""

    turns: int
    mechanisms: tuple[Mechanism, ...]


def turns_of(engine: dict[str, Any]) -> int:
    """Return the turns of the crank after which loads repeat; a rotor fires once a turn."""
    return 2 if engine["cycle"] == "four-stroke" and engine["layout"] != "rotary" else 1


def machine(engine: dict[str, Any], order: list[int] | None = None) -> Machine:
    """Return the mechanisms of [engine], every number closed."""
    turns = turns_of(engine)
    build = {
        "inline": _inline, "vee": _vee, "boxer": _boxer, "opposed-piston": _opposed, "radial": _radial, "parts": _parts,
        "rotary": _rotary,
    }[engine["layout"]]  # fmt: skip
    built = build(engine)
    firing = order or engine.get("firing_order")
    if "bore" in engine and firing is not None:
        built = _fired(built, list(firing), turns)
    return Machine(turns, tuple(built))


def _common(engine: dict[str, Any], part: dict[str, Any] | None = None) -> dict[str, Any]:
    entry = {**engine, **(part or {})}
    if entry.get("drive") == "swinging-yoke":
        return _yoke(entry)
    if entry.get("drive") == "crank-rocker":
        links = plain_drives.linkage(number, entry)
        radius, bore = plain_drives.rocker_radius(links, number(entry["stroke"])), number(entry.get("bore", 0.0))
        mass = number(entry["reciprocating_mass"])
        return {"radius": radius, "rod": 0.0, "piston_mass": mass, "bore": bore, "linkage": links}
    offset, deficit = number(entry.get("offset", 0.0)), number(entry.get("rod_inertia_deficit", 0.0))
    rod = number(entry["rod_length"])
    stroke = number(entry["stroke"])
    # the stroke of a piston beside the crank's axis is longer than two crank radii
    radius = 0.5 * stroke
    if offset:
        radius = brentq(
            lambda r: math.sqrt((rod + r) ** 2 - offset**2) - math.sqrt((rod - r) ** 2 - offset**2) - stroke,
            0.3 * stroke, 0.5 * stroke, xtol=1e-16,
        )  # fmt: skip
    return {
        "radius": radius, "rod": rod, "deficit": deficit, "offset": offset, "bore": number(entry.get("bore", 0.0)),
        "piston_mass": number(entry["reciprocating_mass"]) + entry.get("at_piston", 0.0),
        "shank": entry.get("shank", 0.0),
        "displacer_mass": number(entry["displacer_mass"]) if entry.get("drive") == "rhombic" else None,
    }  # fmt: skip


def _yoke(entry: dict[str, Any]) -> dict[str, Any]:
    """Return the lever of a yoke whose quick stroke takes 1 / (1 + ratio) of a turn."""
    pivot, stroke = number(entry["pivot_distance"]), number(entry["stroke"])
    radius = pivot * math.cos(math.pi / (1.0 + entry["return_ratio"]))
    length = 0.5 * stroke * pivot / radius
    lever = entry.get("lever", {})
    mass, centre, inertia = (number(lever.get(key, 0.0)) for key in ("mass", "centre_of_gravity", "inertia"))
    weight, at = number(entry.get("lever_weight", 0.0)), number(entry.get("lever_weight_radius", 0.0))
    return {
        "radius": radius, "rod": 0.0, "piston_mass": number(entry["reciprocating_mass"]),
        "lever": Lever(pivot, length, length - pivot, mass, centre, inertia, weight, at),
    }  # fmt: skip


def stations(count: int, spacing: float) -> list[float]:
    return [(0.5 * (count - 1) - k) * spacing for k in range(count)]


def _radians(values: list[Any]) -> list[float]:
    return [math.radians(float(v)) for v in values]


def own_tables(e: dict[str, Any]) -> dict[int, dict[str, Any]]:
    """Return the row of each single cylinder in the file, by its index."""
    rows = e.get("single_cylinders", [])
    return {
        n - 1: row
        for row in rows
        for n in (row["cylinders"] if isinstance(row["cylinders"], list) else [row["cylinders"]])
    }


def spots(e: dict[str, Any], count: int, banks: int) -> list[tuple[int, int]]:
    """Return the bank (0 left, 1 right, as it stands) and place from the front of every cylinder by its number."""
    per, scheme = count // banks, e.get("numbering", "one bank after the other")
    if isinstance(scheme, list):
        return [divmod(scheme.index(n), per) for n in range(1, count + 1)]
    sides = [0, 1][:banks] if e.get("first_bank", "left") == "left" else [1, 0]
    along = list(range(per)) if e.get("first_end", "front") == "front" else list(range(per))[::-1]
    if scheme == "alternating":
        return [(side, k) for k in along for side in sides]
    return [(side, k) for side in sides for k in along]


def distances(e: dict[str, Any], count: int) -> list[float]:
    """Return the places along the crank from the front, at one distance or at a list of them."""
    spacing = e.get("cylinder_spacing", 1.0)
    if not isinstance(spacing, list):
        return stations(count, number(spacing))
    gone = np.concatenate([[0.0], np.cumsum([number(v) for v in spacing])])
    return [float(0.5 * gone[-1] - x) for x in gone]


def _in_banks(e: dict[str, Any], banks: int, per_throw: int, angle: float, split: float = 0.0) -> list[Mechanism]:
    """Return the pistons of one bank or two by their numbers, and then what else turns with the throws."""
    throws, rows, common = _radians(e["throws"]), own_tables(e), _common(e)
    count, row = len(throws) * per_throw, math.radians(e.get("row_angle", 0.0))
    at, per = spots(e, count, banks), count // banks
    xs, stagger = distances(e, per), number(e.get("bank_stagger", 0.0))
    # y points to the right of an engine that turns the other way
    left = -0.5 if e.get("rotation") == "counter-clockwise" else 0.5
    pins: list[tuple[int, ...]] = []
    for bank, place in at:
        pin = (place,) if per_throw == 2 else (bank, place)
        if pin not in pins:
            pins.append(pin)
    pin_mass, parts = number(e.get("rotating_mass", 0.0)) + e.get("at_throw", 0.0), []
    turning = [[0.0, 0.0] for _ in pins]
    for k, (bank, place) in enumerate(at):
        entry = rows.get(k, {})
        numbers = _common(e, entry)
        if "offset" in entry and "stroke" not in entry:
            numbers["radius"] = common["radius"]
        side = 0.0 if banks == 1 else left * (1 - 2 * bank)
        lean = 0.5 * row * (-1.0) ** place
        if row:
            numbers["offset"] *= math.copysign(1.0, lean)
        pin = pins.index((place,) if per_throw == 2 else (bank, place))
        x = xs[place] + (0.5 - bank) * stagger * (banks > 1)
        turning[pin][0] += number(entry["rotating_mass"]) if "rotating_mass" in entry else pin_mass / per_throw
        turning[pin][1] = xs[place] if per_throw == 2 else x
        pin_of = turning[pin][0] if per_throw == 1 else 0.0
        parts.append(Mechanism(x, throws[pin] - side * split, side * angle + lean, pin_mass=pin_of, **numbers))
    if per_throw == 1:
        return parts
    still = {
        "radius": common["radius"], "rod": common["rod"] or 10.0 * common["radius"], "piston_mass": 0.0
    }  # fmt: skip
    return parts + [Mechanism(x, t, 0.0, pin_mass=m, **still) for (m, x), t in zip(turning, throws, strict=True)]


def dead_centres(mechanisms: list[Mechanism]) -> list[float]:
    """Return the angle of every crank at the top of its piston where these differ, else none."""
    tops = [top_and_bottom(m)[0] for m in mechanisms]
    return tops if max(tops) - min(tops) > 1e-12 else [0.0] * len(tops)


def _inline(e: dict[str, Any]) -> list[Mechanism]:
    return _in_banks(e, 1, 1, 0.0)


def _rotary(e: dict[str, Any]) -> list[Mechanism]:
    throws = _radians(e["throws"])
    places = stations(len(throws), number(e.get("cylinder_spacing", 1.0)))
    shape = Shape(number(e["rotor_radius"]), number(e["rotor_width"]), number(e.get("rotor_inertia", 0.0)))
    mass, pin = number(e["rotor_mass"]), number(e.get("rotating_mass", 0.0))
    return [
        Mechanism(
            x, throw, 0.0, number(e["eccentricity"]), 0.0, mass, pin, shape=shape, fires=(-throw) % (2.0 * math.pi)
        )
        for x, throw in zip(places, throws, strict=True)
    ]  # fmt: skip


def _vee(e: dict[str, Any]) -> list[Mechanism]:
    return _in_banks(e, 2, 2, math.radians(e["bank_angle"]), math.radians(e.get("split_pin_angle", 0.0)))


def _boxer(e: dict[str, Any]) -> list[Mechanism]:
    return _in_banks(e, 2, 1, math.pi)


def _with(m: Mechanism, **changed: Any) -> Mechanism:
    return Mechanism(**{**m.__dict__, **changed})


def _opposed(e: dict[str, Any]) -> list[Mechanism]:
    count, rows = len(e["throws"]), own_tables(e)
    lower = _inline(e)
    ratio, lead = int(e.get("crank_ratio", -1)), math.radians(e.get("crank_lead", 0.0))
    centre = complex(number(e["crank_distance"]))
    upper = [
        _with(m, centre=centre, ratio=ratio, bank=math.pi, throw=math.pi + ratio * (m.throw + lead)) for m in lower
    ]
    for k in range(count):
        entry = {**e, **rows.get(k, {})}
        if "second_reciprocating_mass" in entry:
            upper[k] = _with(upper[k], piston_mass=number(entry["second_reciprocating_mass"]))
    if "bore" in e:
        fires = [(m.bank - m.throw) % (2.0 * math.pi) for m in lower]
        lower = [_with(m, partner=(m.radius, m.rod, lead), fires=at) for m, at in zip(lower, fires, strict=True)]
    return lower + upper


def _parts(e: dict[str, Any]) -> list[Mechanism]:
    shafts = {s["name"]: s for s in e.get("shafts", [])}
    parts = []
    for part in e["slider_cranks"]:
        shaft = shafts.get(part.get("shaft", ""), {})
        y, z = (number(v) for v in shaft.get("position", [0.0, 0.0]))
        ratio, bank = float(shaft.get("ratio", 1)), math.radians(part.get("bank_angle", 0.0))
        # masses of a shaft are ahead by its lead
        throw = math.radians(part.get("throw", 0.0) + ratio * shaft.get("lead", 0.0))
        parts.append(
            Mechanism(
                number(part["x"]), throw, bank, pin_mass=number({**e, **part}.get("rotating_mass", 0.0)), ratio=ratio,
                centre=complex(z, y), fires=(bank - throw) / ratio if "bore" in e else None, **_common(e, part),
            )
        )  # fmt: skip
    return parts


def _radial(e: dict[str, Any]) -> list[Mechanism]:
    n, common, phi = int(e["cylinders"]), _common(e), angles(1)
    radius, rod, offset = common["radius"], common["rod"], common["offset"]
    arm, at_knuckle = number(e["knuckle_radius"]), number(e.get("knuckle_mass", 0.0))
    turned = _radians(e.get("knuckle_angles", [360.0 * k / n for k in range(1, n)]))
    highest = math.sqrt((radius + rod) ** 2 - offset**2)
    rows = own_tables(e)
    master = {**common, "piston_mass": number(rows.get(0, {}).get("reciprocating_mass", common["piston_mass"]))}
    parts = [Mechanism(0.0, 0.0, 0.0, pin_mass=number(e.get("rotating_mass", 0.0)), **master)]
    for k in range(1, n):
        bank, knuckle = 2.0 * math.pi * k / n, Knuckle(rod, 0.0, offset, arm, turned[k - 1])
        weighing = (("reciprocating_mass", common["piston_mass"]), ("knuckle_mass", at_knuckle))
        mass, pin = (number(rows.get(k, {}).get(key, default)) for key, default in weighing)

        def made(
            length: float, bank: float = bank, knuckle: Knuckle = knuckle, mass: float = mass, pin: float = pin
        ) -> Mechanism:
            entry = {**common, "rod": length, "piston_mass": mass}
            return Mechanism(0.0, 0.0, bank, pin_mass=pin, knuckle=knuckle, **entry)

        def above(length: float) -> float:
            m = made(length)
            s = piston(rod_end(m, phi), length, m.bank, offset)[0]
            i = int(np.argmax(s))
            a, b, c = s[i - 1], s[i], s[(i + 1) % len(s)]
            return float(b + (a - c) ** 2 / (8.0 * (2.0 * b - a - c)) - highest)

        length = (
            number(e["articulated_rod_length"])
            if "articulated_rod_length" in e
            else brentq(above, rod - 1.4 * arm, rod - 0.6 * arm, xtol=1e-15)
        )
        parts.append(made(length))
    return parts


def firing_angles(mechanisms: list[Mechanism], order: list[int], turns: int) -> dict[int, float]:
    """Return the crank angle at which each cylinder of an order fires: its first dead centre after the one before."""
    tops = dead_centres([m for m in mechanisms if m.piston_mass or m.bore])
    centres = {n: (mechanisms[n - 1].bank - mechanisms[n - 1].throw + tops[n - 1]) % (2.0 * math.pi) for n in order}
    now = centres[order[0]]
    at = {order[0] - 1: now}
    for cylinder in order[1:]:
        ahead = (centres[cylinder] - now) % (2.0 * math.pi)
        now += ahead if ahead > 1e-9 else 2.0 * math.pi
        at[cylinder - 1] = now
    return at


def _fired(mechanisms: list[Mechanism], order: list[int], turns: int) -> list[Mechanism]:
    """Return the cylinders with the crank angle of their throw's dead centre before which, or at which, they fire."""
    at = firing_angles(mechanisms, order, turns)
    tops = dead_centres([m for m in mechanisms if m.piston_mass or m.bore])
    return [_with(m, fires=at[k] - tops[k]) if k in at else m for k, m in enumerate(mechanisms)]


@lru_cache(maxsize=512)
def _upright_spectrum(m: Mechanism, turns: int) -> np.ndarray:
    """Return the coefficients of the transform of a mechanism's load, (n, 6)."""
    return np.fft.rfft(mechanism_load(m, turns), axis=0) / SAMPLES


def engine_spectrum(engine: Machine) -> np.ndarray:
    """Return wrench of everything that moves with the cranks at unit speed; a throw that stands ahead moves earlier."""
    orders = np.arange(SAMPLES // 2 + 1)[:, None] / engine.turns
    total = np.zeros((SAMPLES // 2 + 1, 6), complex)
    for m in engine.mechanisms:
        at_zero = _upright_spectrum(_with(m, throw=0.0, fires=None), engine.turns)
        total += at_zero * np.exp(1j * orders * m.throw / m.ratio)
    return total


@lru_cache(maxsize=64)
def _gas_spectrum(gas: str, m: Mechanism, turns: int, valves: str) -> np.ndarray:
    out = np.zeros((SAMPLES // 2 + 1, 6), complex)
    out[:, 3] = gas_torque(json.loads(gas), m, turns, valves)
    return out


def gas_spectrum(gas: dict[str, Any], engine: Machine, valves: dict[int, str] | None = None) -> np.ndarray:
    """Return the roll moment of all cylinders, each at its firing angle, with `valves` of unfired ones by index."""
    orders = np.arange(SAMPLES // 2 + 1)[:, None] / engine.turns
    total = np.zeros((SAMPLES // 2 + 1, 6), complex)
    if gas.get("chambers"):
        for k, m in enumerate(engine.mechanisms):
            if any(k + 1 in row.get("cylinders", [k + 1]) for row in gas["chambers"]) and m.piston_mass:
                once = chambers_torque(gas, k, m)[: SAMPLES // 2 // engine.turns + 1]
                phases = np.exp(1j * orders[:: engine.turns, 0][: len(once)] * (m.throw - m.bank) / m.ratio)
                total[:: engine.turns, 3][: len(once)] += once * phases
    if gas["model"] == "chambers":
        return total
    rows = own_tables(gas)
    shared = {key: value for key, value in gas.items() if key not in ("single_cylinders", "chambers")}
    for k, m in enumerate(engine.mechanisms):
        if m.fires is not None:
            upright = _with(m, throw=0.0, bank=0.0, x=0.0, pin_mass=0.0, piston_mass=0.0, shank=0.0, fires=None)
            entry = json.dumps(
                {**shared, **{key: v for key, v in rows.get(k, {}).items() if key != "cylinders"}}, sort_keys=True
            )
            one = _gas_spectrum(entry, upright, engine.turns, (valves or {}).get(k, ""))
            total += one * np.exp(-1j * orders * m.fires)
    return total
