"""Loads of pistons, pins and gas on the block, order by order, from momentum and energy alone.

Written from docs/theory (C, L, G), apart from the package and from the plain model: momentum, angular momentum and
energy of all that moves are sampled over the cycle and differentiated by their transforms, gas is integrated panel by
panel between its bends. Positions across the crank axis are complex, z + i y (C4).
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import brentq

Table = dict[str, Any]
STEPS = 512
"""Steps of the cycle for moving parts: orders of a slider-crank fall by its rod ratio or faster."""
HIGHEST = 1024
"""Last harmonic of the cycle that gas keeps."""
AIR = 101325.0
UNITS = {
    "": 1.0, "m": 1.0, "mm": 1e-3, "kg": 1.0, "g": 1e-3, "kg m": 1.0, "kg m^2": 1.0, "Pa": 1.0, "bar": 1e5,
    "kp/cm^2": 98066.5, "N": 1.0, "N m": 1.0, "N/m": 1.0, "N/mm": 1e3, "Hz": 1.0, "deg": math.pi / 180.0, "rad": 1.0,
    "rad/s": 1.0, "rpm": math.pi / 30.0, "s": 1.0, "ms": 1e-3, "N s/m": 1.0, "m/s": 1.0, "N m/rad": 1.0, "%": 1e-2,
}  # fmt: skip


def si(quantity: Any) -> float:
    """Return a number of a problem file in SI units; without a unit as it is."""
    if not isinstance(quantity, str):
        return float(quantity)
    number, unit = re.fullmatch(r"\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*(.*)", quantity).groups()  # type: ignore[union-attr]
    return float(number) * UNITS[unit.strip()]


@dataclass(frozen=True)
class Cylinder:
    """Slider-crank: its place along the crank, angles [rad], lengths and masses."""

    x: float
    throw: float
    bank: float
    radius: float
    rod: float
    offset: float
    piston: float
    deficit: float


def crank_radius(engine: Table) -> tuple[float, float]:
    """Return the radius of the crank and length of the rod that make the stroke."""
    stroke, offset = si(engine["stroke"]), si(engine.get("offset", 0.0))

    def rod(radius: float) -> float:
        return si(engine["rod_length"]) if "rod_length" in engine else radius / float(engine["rod_ratio"])

    def over(radius: float) -> float:
        long = rod(radius)
        return math.sqrt((long + radius) ** 2 - offset**2) - math.sqrt((long - radius) ** 2 - offset**2) - stroke

    radius = 0.5 * stroke if offset == 0.0 else brentq(over, 0.2 * stroke, 0.5 * stroke, xtol=1e-17, rtol=1e-15)
    return radius, rod(radius)


def cylinders_and_pins(engine: Table) -> tuple[list[Cylinder], list[tuple[float, float, float]]]:
    """Return slider-cranks of an inline engine, a vee or a boxer, and (x, angle, m r) of what turns with its throws."""
    radius, rod = crank_radius(engine)
    throws = [math.radians(float(t)) for t in engine["throws"]]
    common = (
        radius,
        rod,
        si(engine.get("offset", 0.0)),
        si(engine["reciprocating_mass"]),
        si(engine.get("rod_inertia_deficit", 0.0)),
    )
    turning = si(engine.get("rotating_mass", 0.0)) * radius
    count = len(throws) // 2 if engine["layout"] == "boxer" else len(throws)
    at = [(0.5 * (count - 1) - k) * si(engine.get("cylinder_spacing", 0.0)) for k in range(count)]
    if engine["layout"] == "inline":
        return [Cylinder(x, t, 0.0, *common) for x, t in zip(at, throws, strict=True)], [
            (x, t, turning) for x, t in zip(at, throws, strict=True)
        ]
    stagger = si(engine.get("bank_stagger", 0.0))
    if engine["layout"] == "boxer":
        sides = [(0.5, at[k % count], t) if k < count else (-0.5, at[k % count], t) for k, t in enumerate(throws)]
        cylinders = [Cylinder(x + s * stagger, t, s * math.pi, *common) for s, x, t in sides]
        return cylinders, [(c.x, c.throw, turning) for c in cylinders]
    assert engine["layout"] == "vee"
    bank, split = math.radians(float(engine["bank_angle"])), math.radians(float(engine.get("split_pin_angle", 0.0)))
    cylinders = [
        Cylinder(x + s * stagger, t - s * split, s * bank, *common)
        for s in (0.5, -0.5) for x, t in zip(at, throws, strict=True)
    ]  # fmt: skip
    return cylinders, [(x, t, turning) for x, t in zip(at, throws, strict=True)]


def derivative(samples: np.ndarray) -> np.ndarray:
    """Return the derivative by crank angle of samples over one turn."""
    spectrum = np.fft.fft(samples, axis=-1)
    return np.fft.ifft(1j * np.fft.fftfreq(samples.shape[-1], 1.0 / samples.shape[-1]) * spectrum, axis=-1)


def of_pistons(cylinders: list[Cylinder], turns: int, count: int) -> np.ndarray:
    """Return the coefficients (count, 6), f = Re sum c_n e^(i n phi / turns), of pistons and rods at 1 rad/s."""
    phi, total = 2.0 * np.pi * np.arange(STEPS) / STEPS, np.zeros((6, STEPS))
    for c in cylinders:
        alpha = phi + c.throw - c.bank
        aside = c.radius * np.sin(alpha) - c.offset
        travel = c.radius * np.cos(alpha) + np.sqrt(c.rod**2 - aside**2) + 1j * c.offset
        place = travel * np.exp(1j * c.bank)
        speed = derivative(place)
        lean = -np.arcsin(aside / c.rod)
        lean_rate = derivative(lean.astype(complex)).real
        # angular momentum about x goes with -Im(conj(zeta) zeta'); a rod that leans turns as zeta does
        spin = -c.piston * (place.conj() * speed).imag - c.deficit * lean_rate
        energy = 0.5 * c.piston * abs(speed) ** 2 + 0.5 * c.deficit * lean_rate**2
        force = -c.piston * derivative(speed)
        total[1] += force.imag
        total[2] += force.real
        total[3] -= derivative((spin + energy).astype(complex)).real
        # a force (0, Fy, Fz) at x
        total[4] -= c.x * force.real
        total[5] += c.x * force.imag
    series = np.fft.rfft(total, axis=1).T / STEPS
    series[1:] *= 2.0
    out = np.zeros((count, 6), complex)
    orders = series[: min(len(series) - 1, (count - 1) // turns + 1)]
    out[: len(orders) * turns : turns] = orders
    return out


def of_unbalance(x: float, place: complex, ratio: float, turns: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the coefficients (count, 6) of a unit unbalance at angle 0 and at a right angle, at 1 rad/s."""
    both = []
    for angle in (0.0, 0.5 * np.pi):
        phi = 2.0 * np.pi * np.arange(64) / 64
        force = ratio**2 * np.exp(1j * (ratio * phi + angle))
        y, z = place.imag, place.real
        load = np.array(
            [0 * phi, force.imag, force.real, y * force.real - z * force.imag, -x * force.real, x * force.imag]
        )
        c = 2.0 * np.fft.rfft(load, axis=1).T / 64
        out = np.zeros((count, 6), complex)
        n = round(abs(ratio))
        out[n * turns] = c[n]
        both.append(out)
    return both[0], both[1]


# --- gas


def _panels(bends: list[float], whole: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the nodes (panels, 16) of panels of at most 2 degrees between bends, and their weights."""
    ends = np.unique(np.round([0.0, *(b % whole for b in bends), whole], 14))
    cuts = np.concatenate(
        [np.linspace(a, b, max(2, math.ceil((b - a) / math.radians(2.0)) + 1))[:-1] for a, b in pairwise(ends)]
    )
    edges = np.append(cuts, whole)
    t, w = np.polynomial.legendre.leggauss(16)
    half = 0.5 * np.diff(edges)[:, None]
    return 0.5 * (edges[:-1] + edges[1:])[:, None] + half * t, half * w


@lru_cache(maxsize=1)
def _integrals() -> np.ndarray:
    """Return integrals of polynomials through the nodes, from the start of a panel of -1 ... 1 to each node."""
    t, _ = np.polynomial.legendre.leggauss(16)
    s, w = np.polynomial.legendre.leggauss(16)
    lagrange = [np.poly1d(np.polyfit(t, np.eye(16)[k], 15)) for k in range(16)]
    return np.array([[0.5 * (b + 1.0) * float(w @ l(0.5 * (b + 1.0) * (s + 1.0) - 1.0)) for l in lagrange] for b in t])


@dataclass(frozen=True)
class Stroke:
    """Travel of a piston over a cycle that begins at its firing dead centre, alpha = 0."""

    radius: float
    rod: float
    offset: float
    area: float
    turns: int

    def height(self, a: Any) -> Any:
        return self.radius * np.cos(a) + np.sqrt(self.rod**2 - (self.radius * np.sin(a) - self.offset) ** 2)

    def slope(self, a: Any) -> Any:
        aside = self.radius * np.sin(a) - self.offset
        return -self.radius * np.sin(a) - aside * self.radius * np.cos(a) / np.sqrt(self.rod**2 - aside**2)

    @property
    def dead(self) -> tuple[float, float]:
        """Return the highest and lowest angle at which crank and rod are in line."""
        return (
            math.asin(self.offset / (self.rod + self.radius)),
            math.pi + math.asin(self.offset / (self.rod - self.radius)),
        )


def torque(gas: Table, point: Table, s: Stroke) -> np.ndarray:
    """Return the coefficients (HIGHEST + 1) of the roll moment of the gas in one cylinder that fires at 0."""
    top, bottom = s.dead
    whole = 2.0 * math.pi * s.turns
    high, low = float(s.height(top)), float(s.height(bottom))
    ratio = float(gas.get("compression_ratio", 17.0))
    minimum, maximum = 1.0 / (ratio - 1.0), ratio / (ratio - 1.0)
    entering, leaving = (si(gas.get(f"{k}_pressure", AIR)) for k in ("intake", "exhaust"))
    target = si(point.get("imep", gas.get("imep", 0.0))) - (entering - leaving if s.turns == 2 else 0.0)

    def volume(a: Any) -> Any:
        return minimum + (high - s.height(a)) / (high - low)

    bends = [top, bottom, top + 2 * math.pi, bottom + 2 * math.pi]
    make = {"seiliger": _mixed, "wiebe": _released}[gas["model"]]
    pressure, more = make(
        gas, bool(point.get("motored", False)), target, volume, (top, bottom), (minimum, maximum), entering
    )
    a, w = _panels([*bends, *more], whole)
    g = a.copy()
    # the closed part goes from the lowest place before firing to the one after it
    g[g > bottom + (s.turns - 1) * 2.0 * math.pi] -= whole
    p = np.where(g < bottom, pressure(g, w), entering)
    if s.turns == 2:
        p = np.where((g > bottom) & (g < top + 2.0 * math.pi), leaving, p)
    moment = -s.area * (p - si(gas.get("crankcase_pressure", AIR))) * s.slope(a)
    n = np.arange(HIGHEST + 1)
    turned = np.exp(-1j * np.outer(n, a.ravel()) / s.turns)
    work = turned @ (moment * w).ravel() * 2.0 / whole
    work[0] *= 0.5
    return work


def _mixed(gas: Table, motored: bool, target: float, volume: Any, dead: Any, ends: Any, entering: float) -> Any:
    """Return the pressure of the closed part of a Seiliger cycle, and where it bends besides."""
    top, bottom = dead
    minimum, maximum = ends
    n1, n2 = float(gas.get("compression_exponent", 1.35)), float(gas.get("expansion_exponent", 1.30))
    peak = entering * (maximum / minimum) ** n1
    if motored:
        return lambda a, w: entering * (maximum / volume(a)) ** n1, []

    def work(n: float, p: float, v: float, to: float) -> float:
        return p * v * math.log(to / v) if n == 1.0 else p * v * (1.0 - (v / to) ** (n - 1.0)) / (n - 1.0)

    spent, peak = work(n1, peak, minimum, maximum), si(gas["peak_pressure"])
    cut = brentq(
        lambda v: peak * (v - minimum) + work(n2, peak, v, maximum) - spent - target,
        minimum,
        maximum,
        xtol=1e-16,
        rtol=1e-15,
    )
    at = brentq(lambda a: float(volume(a)) - cut, top, bottom, xtol=1e-15, rtol=1e-15)

    def pressure(a: np.ndarray, w: np.ndarray) -> np.ndarray:
        v = volume(a)
        burnt = peak * np.minimum(1.0, cut / v) ** n2
        return np.where(a < top, entering * (maximum / v) ** n1, burnt)

    return pressure, [at]


def _released(gas: Table, motored: bool, target: float, volume: Any, dead: Any, ends: Any, entering: float) -> Any:
    """Return the same with finite heat release: p v^k grows by (k - 1) q v^(k - 1) db."""
    _, bottom = dead
    _, maximum = ends
    k = float(gas.get("heat_ratio", 1.35))
    if motored:
        return lambda a, w: entering * (maximum / volume(a)) ** k, []
    start, long = (
        math.radians(float(gas[key])) if not isinstance(gas[key], str) else si(gas[key])
        for key in ("start", "duration")
    )
    shape, rate = float(gas.get("shape", 2.0)), -math.log(1.0 - float(gas.get("completeness", 0.999)))

    def burning(a: np.ndarray) -> np.ndarray:
        x = np.clip((a - start) / long, 0.0, 1.0)
        inside = (a > start) & (a < start + long)
        return np.where(inside, rate * (shape + 1.0) * x**shape * np.exp(-rate * x ** (shape + 1.0)) / long, 0.0)

    def pressure(a: np.ndarray, w: np.ndarray) -> np.ndarray:
        v = volume(a)
        order = np.argsort(a[:, 0])
        source = ((k - 1.0) * v ** (k - 1.0) * burning(a))[order]
        half = 0.5 * w[order].sum(axis=1)
        inner = half[:, None] * (source @ _integrals().T)
        before = np.concatenate([[0.0], np.cumsum((source * w[order]).sum(axis=1))[:-1]])
        gained = np.empty_like(v)
        gained[order] = before[:, None] + inner
        cold, hot = entering * (maximum / v) ** k, gained / v**k
        closed = a < bottom
        # the work of either part over what is closed
        rise = volume(a + 1e-40j).imag / 1e-40
        did = [float(np.sum(np.where(closed, part * rise * w, 0.0))) for part in (cold, hot)]
        return cold + hot * (target - did[0]) / did[1]

    return pressure, [start, start + long]


def firing(cylinders: list[Cylinder], engine: Table) -> list[float]:
    """Return the crank angle at which each fires: its first dead centre after the cylinder before it."""
    turns, order = turns_of(engine), engine.get("firing_order")
    dead = [(c.bank - c.throw) % (2.0 * math.pi) for c in cylinders]
    if order is None:
        assert turns == 1 or len(cylinders) == 1
        return dead
    at, now = [0.0] * len(dead), dead[order[0] - 1]
    at[order[0] - 1] = now
    for k in order[1:]:
        ahead = (dead[k - 1] - now) % (2.0 * math.pi)
        now += ahead if ahead > 1e-9 else 2.0 * math.pi
        at[k - 1] = now
    return at


def turns_of(engine: Table) -> int:
    return 2 if engine["cycle"] == "four-stroke" else 1


def of_gas(gas: Table, point: Table, cylinders: list[Cylinder], engine: Table) -> np.ndarray:
    """Return the coefficients (HIGHEST + 1) of the roll moment of all cylinders."""
    c, turns = cylinders[0], turns_of(engine)
    one = torque(gas, point, Stroke(c.radius, c.rod, c.offset, 0.25 * math.pi * si(engine["bore"]) ** 2, turns))
    later = np.exp(-1j * np.outer(np.arange(HIGHEST + 1), firing(cylinders, engine)) / turns)
    return one * later.sum(axis=1)
