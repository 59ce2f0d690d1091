"""Loads as expressions of throws, banks and unbalances, with coefficients from the exact model (S19, S23, S37).

A cylinder that fires when phi = 0 loads by order h as A_h with its axis upright, B_h with it a quarter turn further,
D_h upside down. At a bank b and at a star angle s = theta + o - b, counted from where it fires, it loads by

    e^{i h s} ((A_h - D_h) / 2 cos b + (B_h - C_h) sin b + C_h),     C_h = (A_h + D_h) / 2,

because all of it turns with the axis but what acts along the crankshaft or about it. An unbalance U loads by
Re U times what 1 loads, and Im U times what i loads, at the one order that its shaft turns with.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from laufruhe.load_models.isolated_cylinders import QUARTERS, isolate, leaning, motored, only_rotors, working
from laufruhe.load_models.lines import Lines, summed
from laufruhe.machine import Engine, Rotor
from laufruhe.numerics.arrays import Array, ComplexArray, Mask
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.problem.loads import PointLoads
from laufruhe.problem.problem import Problem

_NOTHING = 1e-12


@dataclass(frozen=True, eq=False)
class OrderSelection:
    """Which orders of some components of a load are followed.

    Attributes
    ----------
    rows
        Of the components, places one after the other.
    left_out
        Share of their root mean square that orders left out may hold together.
    gain
        What an order counts for; the same for all when left out.
    """

    rows: slice
    left_out: float
    gain: Callable[[float], float] = lambda _: 1.0


@dataclass(frozen=True, eq=False)
class _Leaning:
    along: ComplexArray
    across: ComplexArray
    still: ComplexArray


class TurnedLoads:
    """A load at one operating point, of a crank whose throws and banks move.

    Parameters
    ----------
    problem
        With one star and firing order.
    point
        Number of the operating point.
    signal
        What is felt of loads, shape (n, places, d).
    banks
        Whether banks may move.
    felt
        Which orders are followed: all that any of these follow.
    beside
        Whether the load has places of every cylinder, so that those idle stay in theirs.
    """

    def __init__(
        self, problem: Problem, point: int, signal: Callable[[PointLoads], Spectrum], banks: bool,
        felt: Sequence[OrderSelection], beside: bool,
    ) -> None:  # fmt: skip
        self._problem, self._signal, self._banks, self._beside = problem, signal, banks, beside
        self._point = replace(problem, points=(problem.points[point],))
        parts = problem.engine.slider_cranks
        found = [[self._of_cylinder(k, bank) for bank in (QUARTERS if banks else (part.bank,))]
                 for k, part in enumerate(parts)]  # fmt: skip
        units = [self._of_unit(rotor) for rotor in problem.engine.rotors]
        self._base = problem.engine.cycle.base_order
        spectra = [spectrum for own in (*found, *units) for spectrum in own]
        self.places, self._width = spectra[0].coefficients.shape[1:]
        self._units = [[self._rows(spectrum) for spectrum in own] for own in units]
        rows = [[self._rows(spectrum) for spectrum in own] for own in found]
        longest = max(len(own) for each in rows for own in each)
        padded = [[_padded(own, longest) for own in each] for each in rows]
        orders: Array = np.arange(longest, dtype=np.float64) * float(self._base)
        squares = np.sum([np.square(np.abs(own)) for each in padded for own in each], axis=0)
        kept = np.flatnonzero(np.any([_kept(squares[:, own.rows].sum(axis=1), orders, own) for own in felt], axis=0))
        self._orders: Array = orders[kept]
        self._cylinders = [_leaning([own[kept] for own in each]) for each in padded]

    def lines(self, stars: Sequence[Any], banks: Sequence[Any], unbalance: Callable[[Rotor], Any]) -> list[Lines]:
        """Return the lines of every place, from cylinder angles s and b [rad] and rotor unbalances (re, im)."""
        parts = [self._turned(own, s, b) for own, s, b in zip(self._cylinders, stars, banks, strict=True)]
        for rotor, (by_real, by_imaginary) in zip(self._problem.engine.rotors, self._units, strict=True):
            acts = np.flatnonzero(np.abs(by_real).max(axis=1) + np.abs(by_imaginary).max(axis=1))
            if len(acts):
                u, pair = unbalance(rotor), (by_real[acts].T, by_imaginary[acts].T)
                real, imaginary = (_dm(a) * u[0] + _dm(b) * u[1] for a, b in (tuple(p.real for p in pair),
                                                                              tuple(p.imag for p in pair)))  # fmt: skip
                parts.append(Lines(np.asarray(acts * float(self._base), dtype=np.float64), real, imaginary))
        whole = summed(parts)
        d = self._width
        rows = [slice(k * d, (k + 1) * d) for k in range(self.places)]
        return [Lines(whole.orders, whole.real[own, :], whole.imaginary[own, :]) for own in rows]

    def _turned(self, own: _Leaning, star: Any, bank: Any) -> Lines:
        count = own.still.shape[1]
        phases = ca.DM(self._orders).T * star
        cosine, sine = (ca.repmat(wave(phases), count, 1) for wave in (ca.cos, ca.sin))
        real, imaginary = _dm(own.still.real.T), _dm(own.still.imag.T)
        if self._banks:
            c, s = ca.cos(bank), ca.sin(bank)
            real = real + _dm(own.along.real.T) * c + _dm(own.across.real.T) * s
            imaginary = imaginary + _dm(own.along.imag.T) * c + _dm(own.across.imag.T) * s
        return Lines(self._orders, real * cosine - imaginary * sine, real * sine + imaginary * cosine)

    def _of_cylinder(self, k: int, bank: float) -> Spectrum:
        engine = self._problem.engine
        part = replace(engine.slider_cranks[k], bank=bank, throw=bank, firing_angle=0.0)
        return self._loaded(working(self._point, part.name), isolate(engine, k, self._beside, part))

    def _of_unit(self, rotor: Rotor) -> list[Spectrum]:
        engine = self._problem.engine
        units = (only_rotors(engine, [replace(rotor, unbalance=u)], self._beside) for u in (1.0, 1.0j))
        return [self._loaded(motored(self._point), unit) for unit in units]

    def _loaded(self, problem: Problem, engine: Engine) -> Spectrum:
        (point,), fidelity = problem.points, problem.fidelity
        wrench = shaking_loads(engine, point, fidelity)
        return self._signal(PointLoads(point, wrench, None, moving=engine, fidelity=fidelity)).series

    def _rows(self, spectrum: Spectrum) -> ComplexArray:
        own = spectrum.with_finer_base(self._base).coefficients
        return np.asarray(own.reshape(len(own), -1))


def _padded(rows: ComplexArray, count: int) -> ComplexArray:
    return np.pad(rows, ((0, count - len(rows)), (0, 0)))


def _kept(squares: Array, orders: Array, felt: OrderSelection) -> Mask:
    squares = squares * np.square([felt.gain(float(order)) for order in orders])
    tail = np.cumsum(squares[::-1])[::-1]
    found = (tail > felt.left_out**2 * tail[0]) & (squares > _NOTHING**2 * tail[0])
    return np.asarray(found if found.any() else np.arange(len(orders)) == 0)


def _leaning(rows: Sequence[ComplexArray]) -> _Leaning:
    if len(rows) == 1:
        return _Leaning(0.0 * rows[0], 0.0 * rows[0], rows[0])
    return _Leaning(*leaning(*rows))


def _dm(values: Array) -> Any:
    # gas has many orders and few forces: zeros are dropped
    return ca.sparsify(ca.DM(np.ascontiguousarray(values)))
