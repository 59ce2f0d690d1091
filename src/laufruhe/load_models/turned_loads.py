"""Loads of any channel as expressions of throws, banks and unbalances, with coefficients from the exact model (S37).

A cylinder that fires when phi = 0 loads by order h as A_h with its axis upright, B_h with it a quarter turn further,
D_h upside down. At a bank b and at a star angle s = theta + o - b, counted from where it fires, it loads by

    e^{i h s} ((A_h - D_h) / 2 cos b + (B_h - C_h) sin b + C_h),     C_h = (A_h + D_h) / 2,

because all of it turns with the axis but what acts along the crankshaft or about it. An unbalance U loads by
Re U times what 1 loads, and Im U times what i loads, at the one order that its shaft turns with.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from laufruhe.load_models.lines import Lines, summed
from laufruhe.load_models.lone_parts import lone, motored, only_rotors, working
from laufruhe.machine import Engine, Rotor
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Measure, selected
from laufruhe.problem.problem import Problem

QUARTERS = (0.0, 0.5 * math.pi, math.pi)
HIGHEST = 24.0
"""Order up to which a smooth program knows loads inside the crankcase: a pressure that jumps has no end of them."""
_NOTHING = 1e-12


@dataclass(frozen=True, eq=False)
class _Leaning:
    """Coefficients of a cylinder times cos b, times sin b and as they are, each of shape (orders, rows)."""

    along: ComplexArray
    across: ComplexArray
    still: ComplexArray


class TurnedLoads:
    """What a measure takes the norm of at one operating point, of a crank whose throws and banks move.

    Parameters
    ----------
    problem
        With one star and firing order.
    measure
        Of a load.
    point
        Number of the operating point.
    banks
        Whether banks move.
    left_out
        Share of the root mean square that orders left out may hold together.
    """

    def __init__(self, problem: Problem, measure: Measure, point: int, banks: bool, left_out: float) -> None:
        self._problem, self._measure, self._banks = problem, measure, banks
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
        kept = _kept(padded, left_out)
        self._orders: Array = np.asarray(kept * float(self._base), dtype=np.float64)
        self._cylinders = [_leaning([own[kept] for own in each]) for each in padded]

    def lines(self, stars: Sequence[Any], banks: Sequence[Any], unbalance: Callable[[Rotor], Any]) -> list[Lines]:
        """Of every place, from angles s and b of every cylinder [rad] and U of every rotor as (re, im)."""
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
        """Alone, at a bank, firing when phi = 0."""
        engine = self._problem.engine
        part = replace(engine.slider_cranks[k], bank=bank, throw=bank, firing_angle=0.0)
        return self._signal(working(self._point, part.name), lone(engine, k, True, part))

    def _of_unit(self, rotor: Rotor) -> list[Spectrum]:
        """Of one that is 1, and i."""
        engine = self._problem.engine
        units = (only_rotors(engine, [replace(rotor, unbalance=u)], True) for u in (1.0, 1.0j))
        return [self._signal(motored(self._point), unit) for unit in units]

    def _signal(self, problem: Problem, engine: Engine) -> Spectrum:
        (signal,) = evaluate(problem, engine).signals(self._measure.load)
        return selected(self._measure, signal.series, self._problem.engine)

    def _rows(self, spectrum: Spectrum) -> ComplexArray:
        """Coefficients of the orders of the cycle, shape (orders, places times components)."""
        own = spectrum.rebased(self._base).kept(HIGHEST).coefficients
        return np.asarray(own.reshape(len(own), -1))


def _padded(rows: ComplexArray, count: int) -> ComplexArray:
    return np.pad(rows, ((0, count - len(rows)), (0, 0)))


def _kept(rows: Sequence[Sequence[ComplexArray]], left_out: float) -> Array:
    """The first orders, that hold all but a share of the root mean square."""
    squares = np.sum([np.square(np.abs(own)).sum(axis=1) for each in rows for own in each], axis=0)
    tail = np.cumsum(squares[::-1])[::-1]
    felt = (tail > left_out**2 * tail[0]) & (squares > _NOTHING**2 * tail[0])
    return np.asarray(np.flatnonzero(felt) if felt.any() else np.zeros(1, dtype=np.intp))


def _leaning(rows: Sequence[ComplexArray]) -> _Leaning:
    """From the three banks of `QUARTERS`, or from one that stays."""
    if len(rows) == 1:
        return _Leaning(0.0 * rows[0], 0.0 * rows[0], rows[0])
    upright, across, upside = rows
    still = 0.5 * (upright + upside)
    return _Leaning(0.5 * (upright - upside), across - still, still)


def _dm(values: Array) -> Any:
    return ca.DM(np.ascontiguousarray(values))
