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
from laufruhe.machine import Engine, OperatingPoint, Rotor
from laufruhe.numerics.arrays import Array, ComplexArray, Mask
from laufruhe.numerics.spectrum import Spectrum, stacked_coefficients
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
        Components to which the rule applies, among the components of all places one after another.
    left_out
        Largest share of the root mean square of these components in the omitted orders together.
    gain
        Function from an order to its weight.
    """

    rows: slice
    left_out: float
    gain: Callable[[float], float] = lambda _: 1.0


def turned_loads(
    problem: Problem, point: OperatingPoint, signal: Callable[[PointLoads], Spectrum],
    selections: Sequence[OrderSelection], keep_places: bool, angles: Sequence[tuple[Any, Any]], banks_are_open: bool,
    unbalance: Callable[[Rotor], Any],
) -> list[SymbolicSpectrum]:  # fmt: skip
    """Return a load at one operating point as an expression of throw and bank angles, one spectrum per place.

    Parameters
    ----------
    point
        Operating point.
    signal
        Function from the loads of an engine to the spectrum of interest, shape (n, places, d).
    selections
        Rules for the orders; an order is kept if any rule selects it.
    keep_places
        Whether idle cylinders keep their places, because the load has places at every cylinder.
    angles
        Angles s and b of every cylinder [rad], as in the formula of the module.
    banks_are_open
        Whether loads follow the bank angles b.
    unbalance
        Function from a rotor to the real and imaginary parts of its unbalance [kg m].
    """
    engine, at_point = problem.engine, replace(problem, points=(point,))
    base = engine.cycle.base_order

    def load(of: Problem, parts: Engine) -> Spectrum:
        wrench = shaking_loads(parts, of.points[0], of.fidelity)
        return signal(PointLoads(of.points[0], wrench, None, moving_parts=parts, fidelity=of.fidelity)).series

    def load_of_cylinder(k: int, bank: float) -> Spectrum:
        part = replace(engine.slider_cranks[k], bank=bank, throw=bank, firing_angle=0.0)
        return load(only_gas_of(at_point, part.name), isolate_cylinder(engine, k, keep_places, part))

    cylinders = [
        [load_of_cylinder(k, bank) for bank in (BANK_SAMPLES if banks_are_open else (part.bank,))]
        for k, part in enumerate(engine.slider_cranks)
    ]
    if engine.load_torque is not None:
        fixed = replace(isolate_rotors(engine, (), keep_places), load_torque=engine.load_torque)
        cylinders.append([load(motored(at_point), fixed)] * len(cylinders[0]))
        angles = [*angles, (0.0, 0.0)]
    units = [
        [
            load(motored(at_point), isolate_rotors(engine, [replace(rotor, unbalance=u)], keep_places))
            for u in (1.0, 1.0j)
        ]
        for rotor in engine.rotors
    ]
    places, d = next(spectrum for spectra in (*cylinders, *units) for spectrum in spectra).coefficients.shape[1:]
    base, stacked = stacked_coefficients([spectrum for spectra in cylinders for spectrum in spectra], base)
    # shape (cylinders, banks, orders, components)
    rows = stacked.reshape(len(cylinders), -1, stacked.shape[1], places * d)
    orders: Array = np.arange(rows.shape[2], dtype=np.float64) * float(base)
    squares = np.sum([np.square(np.abs(by_order)) for banked in rows for by_order in banked], axis=0)
    masks = [_selected(squares[:, selection.rows].sum(axis=1), orders, selection) for selection in selections]
    selected = np.flatnonzero(np.any(masks, axis=0))
    spectra = [_turned(orders[selected], banked[:, selected], *pair) for banked, pair in zip(rows, angles, strict=True)]
    for rotor, pair in zip(engine.rotors, units, strict=True):
        a, b = (np.asarray(s.with_finer_base(base).coefficients).reshape(-1, places * d) for s in pair)
        indices = np.flatnonzero(np.abs(a).max(axis=1) + np.abs(b).max(axis=1))
        if len(indices):
            u, a, b = unbalance(rotor), a[indices].T, b[indices].T
            real, imaginary = _dm(a.real) * u[0] + _dm(b.real) * u[1], _dm(a.imag) * u[0] + _dm(b.imag) * u[1]
            spectra.append(SymbolicSpectrum(np.asarray(indices * float(base)), real, imaginary))
    total = sum_spectra(spectra)
    at_places = [slice(k * d, (k + 1) * d) for k in range(places)]
    return [SymbolicSpectrum(total.orders, total.real[place, :], total.imaginary[place, :]) for place in at_places]


def _turned(orders: Array, rows: ComplexArray, star: Any, bank: Any) -> SymbolicSpectrum:
    # load of a cylinder from its coefficients at the bank angles of `BANK_SAMPLES`, or at its own
    by_bank = split_by_bank(*rows) if len(rows) > 1 else tuple(rows)
    phases = ca.DM(orders).T * star
    cosine, sine = (ca.repmat(wave(phases), rows.shape[2], 1) for wave in (ca.cos, ca.sin))
    real, imaginary = _dm(by_bank[-1].real.T), _dm(by_bank[-1].imag.T)
    if len(rows) > 1:
        c, s = ca.cos(bank), ca.sin(bank)
        real = real + _dm(by_bank[0].real.T) * c + _dm(by_bank[1].real.T) * s
        imaginary = imaginary + _dm(by_bank[0].imag.T) * c + _dm(by_bank[1].imag.T) * s
    return SymbolicSpectrum(orders, real * cosine - imaginary * sine, real * sine + imaginary * cosine)


def _selected(squares: Array, orders: Array, selection: OrderSelection) -> Mask:
    squares = squares * np.square([selection.gain(float(order)) for order in orders])
    tail = np.cumsum(squares[::-1])[::-1]
    mask = (tail > selection.left_out**2 * tail[0]) & (squares > _NEGLIGIBLE**2 * tail[0])
    return np.asarray(mask if mask.any() else np.arange(len(orders)) == 0)


def _dm(values: Array) -> Any:
    # sparse, because gas has many orders but few components
    return ca.sparsify(ca.DM(np.ascontiguousarray(values)))
