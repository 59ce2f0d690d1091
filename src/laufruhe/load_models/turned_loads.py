"""Loads as CasADi expressions of throws, banks and unbalances, with coefficients from the exact model (S19, S23, S37).

A cylinder that fires at crank angle zero has the load A_h in order h with its axis upright, B_h with the axis a quarter
turn further, and D_h upside down. With its axis at bank angle b and its throw at s = theta + o - b, where o is the pin
offset, the load is

    e^{i h s} ((A_h - D_h) / 2 cos b + (B_h - C_h) sin b + C_h),     C_h = (A_h + D_h) / 2,

because the load turns with the axis, except for its components along and about the crankshaft. The load of an unbalance
U is Re U times that of unbalance 1 plus Im U times that of unbalance i, in the order of its shaft.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from laufruhe.load_models.isolated_cylinders import (
    BANK_SAMPLES,
    isolate_cylinder,
    isolate_rotors,
    motored,
    only_gas_of,
    split_by_bank,
)
from laufruhe.load_models.symbolic_spectrum import SymbolicSpectrum, sum_spectra
from laufruhe.machine import Engine, Rotor
from laufruhe.numerics.arrays import Array, ComplexArray, Mask
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.problem.loads import PointLoads
from laufruhe.problem.problem import Problem

# relative size of an order that counts as zero
_NEGLIGIBLE = 1e-12


@dataclass(frozen=True, eq=False)
class OrderSelection:
    """Rule that selects the orders that some components of a load need.

    Attributes
    ----------
    rows
        Components to which the rule applies, with those of all places in one row.
    left_out
        Largest share of the root mean square of these components in the omitted orders together.
    gain
        Function from an order to its weight.
    """

    rows: slice
    left_out: float
    gain: Callable[[float], float] = lambda _: 1.0


@dataclass(frozen=True, eq=False)
class _BankCoefficients:
    # factors of cos b, of sin b and of 1 in the bank angle b, shape (orders, components)
    cosine: ComplexArray
    sine: ComplexArray
    constant: ComplexArray


class TurnedLoads:
    """Load at one operating point, for throws and banks at any angles.

    Parameters
    ----------
    problem
        Problem with a fixed star and firing order.
    point
        Index of the operating point.
    signal
        Function from the loads of an engine to the spectrum of interest, shape (n, places, d).
    banks
        Whether bank angles are open.
    selections
        Rules for the orders; an order is kept if any rule selects it.
    keep_places
        Whether idle cylinders keep their places, because the load has places at every cylinder.

    Attributes
    ----------
    places
        Number of places of the load.
    """

    def __init__(
        self, problem: Problem, point: int, signal: Callable[[PointLoads], Spectrum], banks: bool,
        selections: Sequence[OrderSelection], keep_places: bool,
    ) -> None:  # fmt: skip
        self._problem, self._signal, self._banks, self._keep_places = problem, signal, banks, keep_places
        self._point = replace(problem, points=(problem.points[point],))
        parts = problem.engine.slider_cranks
        cylinders = [[self._load_of_cylinder(k, bank) for bank in (BANK_SAMPLES if banks else (part.bank,))]
                     for k, part in enumerate(parts)]  # fmt: skip
        units = [self._loads_of_units(rotor) for rotor in problem.engine.rotors]
        self._base = problem.engine.cycle.base_order
        first = next(spectrum for spectra in (*cylinders, *units) for spectrum in spectra)
        self.places, self._width = first.coefficients.shape[1:]
        self._units = [[self._rows(spectrum) for spectrum in spectra] for spectra in units]
        rows = [[self._rows(spectrum) for spectrum in spectra] for spectra in cylinders]
        longest = max(len(by_order) for banked in rows for by_order in banked)
        padded = [[_padded(by_order, longest) for by_order in banked] for banked in rows]
        orders: Array = np.arange(longest, dtype=np.float64) * float(self._base)
        squares = np.sum([np.square(np.abs(by_order)) for banked in padded for by_order in banked], axis=0)
        masks = [_selected(squares[:, selection.rows].sum(axis=1), orders, selection) for selection in selections]
        selected = np.flatnonzero(np.any(masks, axis=0))
        self._orders: Array = orders[selected]
        self._cylinders = [_bank_coefficients([by_order[selected] for by_order in banked]) for banked in padded]

    def spectra(
        self, stars: Sequence[Any], banks: Sequence[Any], unbalance: Callable[[Rotor], Any]
    ) -> list[SymbolicSpectrum]:
        """Return the load at every place as spectra.

        Parameters
        ----------
        stars, banks
            Angles s and b of every cylinder [rad].
        unbalance
            Function from a rotor to the real and imaginary parts of its unbalance [kg m].
        """
        parts = [
            self._turned(coefficients, s, b) for coefficients, s, b in zip(self._cylinders, stars, banks, strict=True)
        ]
        for rotor, (real_unit, imaginary_unit) in zip(self._problem.engine.rotors, self._units, strict=True):
            indices = np.flatnonzero(np.abs(real_unit).max(axis=1) + np.abs(imaginary_unit).max(axis=1))
            if len(indices):
                u, pair = unbalance(rotor), (real_unit[indices].T, imaginary_unit[indices].T)
                real, imaginary = (_dm(a) * u[0] + _dm(b) * u[1] for a, b in (tuple(p.real for p in pair),
                                                                              tuple(p.imag for p in pair)))  # fmt: skip
                orders = np.asarray(indices * float(self._base), dtype=np.float64)
                parts.append(SymbolicSpectrum(orders, real, imaginary))
        total = sum_spectra(parts)
        d = self._width
        rows = [slice(k * d, (k + 1) * d) for k in range(self.places)]
        return [SymbolicSpectrum(total.orders, total.real[place, :], total.imaginary[place, :]) for place in rows]

    def _turned(self, coefficients: _BankCoefficients, star: Any, bank: Any) -> SymbolicSpectrum:
        count = coefficients.constant.shape[1]
        phases = ca.DM(self._orders).T * star
        cosine, sine = (ca.repmat(wave(phases), count, 1) for wave in (ca.cos, ca.sin))
        real, imaginary = _dm(coefficients.constant.real.T), _dm(coefficients.constant.imag.T)
        if self._banks:
            c, s = ca.cos(bank), ca.sin(bank)
            real = real + _dm(coefficients.cosine.real.T) * c + _dm(coefficients.sine.real.T) * s
            imaginary = imaginary + _dm(coefficients.cosine.imag.T) * c + _dm(coefficients.sine.imag.T) * s
        return SymbolicSpectrum(self._orders, real * cosine - imaginary * sine, real * sine + imaginary * cosine)

    def _load_of_cylinder(self, k: int, bank: float) -> Spectrum:
        engine = self._problem.engine
        part = replace(engine.slider_cranks[k], bank=bank, throw=bank, firing_angle=0.0)
        return self._loaded(only_gas_of(self._point, part.name), isolate_cylinder(engine, k, self._keep_places, part))

    def _loads_of_units(self, rotor: Rotor) -> list[Spectrum]:
        engine = self._problem.engine
        units = (isolate_rotors(engine, [replace(rotor, unbalance=u)], self._keep_places) for u in (1.0, 1.0j))
        return [self._loaded(motored(self._point), unit) for unit in units]

    def _loaded(self, problem: Problem, engine: Engine) -> Spectrum:
        (point,), fidelity = problem.points, problem.fidelity
        wrench = shaking_loads(engine, point, fidelity)
        return self._signal(PointLoads(point, wrench, None, moving=engine, fidelity=fidelity)).series

    def _rows(self, spectrum: Spectrum) -> ComplexArray:
        coefficients = spectrum.with_finer_base(self._base).coefficients
        return np.asarray(coefficients.reshape(len(coefficients), -1))


def _padded(rows: ComplexArray, count: int) -> ComplexArray:
    return np.pad(rows, ((0, count - len(rows)), (0, 0)))


def _selected(squares: Array, orders: Array, selection: OrderSelection) -> Mask:
    squares = squares * np.square([selection.gain(float(order)) for order in orders])
    tail = np.cumsum(squares[::-1])[::-1]
    mask = (tail > selection.left_out**2 * tail[0]) & (squares > _NEGLIGIBLE**2 * tail[0])
    return np.asarray(mask if mask.any() else np.arange(len(orders)) == 0)


def _bank_coefficients(rows: Sequence[ComplexArray]) -> _BankCoefficients:
    if len(rows) == 1:
        return _BankCoefficients(0.0 * rows[0], 0.0 * rows[0], rows[0])
    return _BankCoefficients(*split_by_bank(*rows))


def _dm(values: Array) -> Any:
    # sparse, because gas has many orders but few components
    return ca.sparsify(ca.DM(np.ascontiguousarray(values)))
