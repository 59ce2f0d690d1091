"""Response of an order over a box of mounts, affine in what is open of them and adds to the middle (E42, E52, E66).

A spring whose stiffness is open adds the force t = kappa(s) u to that of the middle, u its deflection. A mount that
may move by s times h sees s h (theta x e) more of the turn theta of the block, and has the moment s h e x f more. What
is open of a damper adds i W t, t = (C - C(c)) u; where it follows what is open of stiffness, i W b t. With these
products t, s theta and s f as variables w, f without loss and that of dampers over i W each by itself, and unbalances
beside them,

    D(c) y = r0 + R u - (what is linear in w)                                               (E42)

so that motion, deflections and mount forces are affine in v, the unbalances, Re w and Im w. What is nonlinear are the
products alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from laufruhe.extensions.mount_relaxation.open_mounts import OpenMounts
from laufruhe.numerics.arrays import Array, ComplexArray
from laufruhe.physics.rigid_body import carried

# of the largest of a kind, the least that a product is counted in
SMALL = 0.1


@dataclass(frozen=True, eq=False)
class Line:
    """One order over a box, as complex functions of (1, v), shapes (..., d), in units of a motion.

    Attributes
    ----------
    columns
        Of the unbalances in v.
    motion, carried
        y, and A y in coordinates in which the mass is one, shape (k, d).
    members
        Of every mount the numbers of those of the problem that it stands for.
    deflections, forces
        Of one of these, shape (mounts, 3, d).
    springs
        Of every spring u and t, shape (b, d) each.
    places
        Of every place turns and moments (4, d), and s times these.
    reaches
        Squares that those of v are not over for any design of the box, shape (d - 1,).
    unit
        The motion that is counted as one.
    """

    columns: int
    motion: ComplexArray
    carried: ComplexArray
    members: tuple[tuple[int, ...], ...]
    deflections: ComplexArray
    forces: ComplexArray
    springs: tuple[tuple[ComplexArray, ComplexArray], ...]
    places: tuple[tuple[ComplexArray, ComplexArray], ...]
    reaches: Array
    unit: float

    @property
    def size(self) -> int:
        """d."""
        return int(self.motion.shape[-1])


@dataclass(frozen=True, eq=False)
class Felt:
    """Amplitude of force, or of travel, of mounts that no design that counts goes over.

    Attributes
    ----------
    mounts
        Their numbers.
    most
        The largest amplitude.
    """

    mounts: tuple[int, ...]
    most: float
    is_travel: bool

    def seen(self, mounts: OpenMounts) -> Array:
        """Deflections of springs that no such design goes over: a mount has its softest direction at least."""
        out = np.full(mounts.mounts, math.inf)
        soft = np.bincount(mounts.stands, mounts.softest, mounts.mounts)
        for k, own in enumerate(mounts.members):
            if own[0] not in self.mounts:
                continue
            if self.is_travel:
                out[k] = self.most * mounts.times[k]
            elif soft[k] > 0.0 and not mounts.dynamic:
                out[k] = self.most * mounts.times[k] / soft[k]
        return np.asarray(out[mounts.stands])


def line_of(mounts: OpenMounts, loads: ComplexArray, omega: float, near: ComplexArray, felt: Felt) -> Line:
    """Of one order (E42, E52).

    Parameters
    ----------
    loads
        r, and what one unit of every column of the unbalances adds, shape (1 + columns, k).
    omega
        Angular frequency [rad/s].
    near
        Motions of a design, which say what is large, shape (k, n).
    felt
        What forces or travel of designs that count are not over.
    """
    unit, columns = float(np.linalg.norm(near)) or 1.0, len(loads) - 1
    sizes = _sizes(mounts, near / unit)
    products = _products(mounts, sizes, columns)
    turning = mounts.turning(omega)
    impedances = mounts.middles * turning[:, None, None] + 1j * omega * mounts.dampers
    shifted, _, held = _added(mounts, products, omega)
    held[:, : 1 + columns] += loads.T / unit
    held -= np.einsum("mia,mij,mjd->ad", mounts.motions, impedances, shifted)
    whole = _impedance(mounts, impedances, omega)
    motion = np.asarray(np.linalg.solve(whole, held), dtype=np.complex128)
    motion_at_most = _motion_at_most(mounts, loads, omega)
    most = _most(mounts, motion_at_most, np.minimum(motion_at_most * _seen_at_most(mounts), felt.seen(mounts)))
    reaches = np.concatenate([np.ones(columns), *([(most / (unit * sizes)) ** 2] * 2)])
    return _line(mounts, products, omega, motion, (columns, reaches, unit))


def _line(
    mounts: OpenMounts, products: _Products, omega: float, motion: ComplexArray, known: tuple[int, Array, float]
) -> Line:
    """Of a motion, with columns, reaches and unit."""
    turning = mounts.turning(omega)
    shifted, moments, _ = _added(mounts, products, omega)
    columns, reaches, unit = known
    deflections = mounts.motions @ motion + shifted
    elastic, viscous = mounts.middles @ deflections, mounts.dampers @ deflections
    for spring, part in zip(mounts.springs, products.springs, strict=True):
        elastic[spring.mount] += spring.elastic * (spring.axes @ part)
        viscous[spring.mount] += spring.viscous * (spring.axes @ part)
    forces = elastic * turning[:, None, None] + 1j * omega * viscous
    held_by = [spring.axes.T @ deflections[spring.mount] for spring in mounts.springs]
    return Line(
        columns,
        motion,
        np.asarray(
            np.einsum("mia,mid->ad", mounts.motions, elastic) + moments + mounts.at_rest @ motion, dtype=np.complex128
        ),
        mounts.members,
        deflections[[int(np.argmax(mounts.stands == k)) for k in range(mounts.mounts)]] / mounts.times[:, None, None],
        _of_mounts(mounts, forces, omega, motion) / mounts.times[:, None, None],
        tuple(zip(held_by, products.springs, strict=True)),
        tuple(zip(_moved(mounts, motion, elastic, viscous), products.places, strict=True)),
        reaches,
        unit,
    )


def _impedance(mounts: OpenMounts, impedances: ComplexArray, omega: float) -> ComplexArray:
    """D(c) from those of the springs, shape (k, k)."""
    whole = sum(carried(g, z) for g, z in zip(mounts.motions, impedances, strict=True))
    added = mounts.at_rest + mounts.dynamic.impedance(np.array([omega]), mounts.root.T)[0]
    return np.asarray(whole + added - omega**2 * np.eye(mounts.size), dtype=np.complex128)


def _moved(
    mounts: OpenMounts, motion: ComplexArray, elastic: ComplexArray, viscous: ComplexArray
) -> list[ComplexArray]:
    """What s of every place multiplies: turns, and moments of springs without loss and of dampers, shape (n, d)."""
    out = []
    for place in mounts.places:
        felt = (elastic, viscous)[: 1 + place.is_damped]
        moments = [np.asarray(sum(h * place.arms @ each[m] for m, h in place.mounts)) for each in felt]
        out.append(np.concatenate([place.aside @ mounts.turns @ motion, *moments]))
    return out


def _of_mounts(mounts: OpenMounts, forces: ComplexArray, omega: float, motion: ComplexArray) -> ComplexArray:
    """Forces of springs added up by the mounts that they belong to, with those of what depends on frequency."""
    static = mounts.dynamic.directions @ np.diag([law.static for law in mounts.dynamic.laws]) @ mounts.dynamic.rows
    added = mounts.dynamic.forces(np.array([omega]), mounts.root.T)[0] + static.reshape(-1, 6) @ mounts.root.T
    out = np.asarray(added @ motion, dtype=np.complex128).reshape(mounts.mounts, 3, -1)
    np.add.at(out, mounts.stands, forces)
    return out


@dataclass(frozen=True, eq=False)
class _Products:
    """t of every spring, and what s of every place multiplies, as functions of (1, v)."""

    springs: list[ComplexArray]
    places: list[ComplexArray]
    width: int


def _products(mounts: OpenMounts, sizes: Array, columns: int) -> _Products:
    """Each counted in its size."""
    count = len(sizes)
    added = np.zeros((count, 1 + columns + 2 * count), dtype=complex)
    rows = np.arange(count)
    added[rows, 1 + columns + rows], added[rows, 1 + columns + count + rows] = sizes, 1j * sizes
    counts = [spring.axes.shape[1] for spring in mounts.springs]
    ends = np.cumsum(counts + [place.products for place in mounts.places])
    parts = np.split(added, ends[:-1]) if len(ends) else []
    return _Products(parts[: len(mounts.springs)], parts[len(mounts.springs) :], added.shape[1])


def _added(mounts: OpenMounts, products: _Products, omega: float) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """What products add to deflections, to what springs without loss do to the block, and to the load of the middle."""
    turning = mounts.turning(omega)
    shifted = np.zeros((len(turning), 3, products.width), dtype=complex)
    moments, held = (np.zeros((mounts.size, products.width), dtype=complex) for _ in range(2))
    for place, part in zip(mounts.places, products.places, strict=True):
        turns, *felt = np.split(part, len(part) // len(place.aside))
        for m, reach in place.mounts:
            shifted[m] += reach * place.arms.T @ turns
        own = [mounts.root[:, 3:] @ place.aside.T @ each for each in felt]
        moments += own[0]
        # mounts of one place have one loss factor
        for moment, factor in zip(own, (turning[place.mounts[0][0]], 1j * omega), strict=False):
            held -= moment * factor
    for spring, part in zip(mounts.springs, products.springs, strict=True):
        factor = spring.elastic * turning[spring.mount] + 1j * omega * spring.viscous
        held -= factor * mounts.motions[spring.mount].T @ spring.axes @ part
    return shifted, moments, held


def _sizes(mounts: OpenMounts, near: ComplexArray) -> Array:
    """About how large every product is at these motions, none much smaller than others of its kind."""
    deflections, turns = mounts.motions @ near, mounts.turns @ near
    seen = [_lengths(spring.axes.T @ deflections[spring.mount]) for spring in mounts.springs]
    least = SMALL * max((float(each.max()) for each in seen), default=0.0)
    found = [spring.size * np.maximum(each, least) for spring, each in zip(mounts.springs, seen, strict=True)]
    for place in mounts.places:
        found.append(np.maximum(_lengths(place.aside @ turns), SMALL * np.linalg.norm(turns)))
        for matrices in (mounts.middles, mounts.dampers)[: 1 + place.is_damped]:
            forces = [(h, matrices[m] @ deflections[m]) for m, h in place.mounts]
            moment = _lengths(np.asarray(sum(h * place.arms @ force for h, force in forces)))
            found.append(np.maximum(moment, SMALL * sum(abs(h) * np.linalg.norm(force) for h, force in forces)))
    sizes = np.concatenate([np.zeros(0), *found])
    return np.where(sizes > 0.0, sizes, sizes.max(initial=0.0) or 1.0)


def _lengths(rows: ComplexArray) -> Array:
    return np.asarray(np.linalg.norm(rows, axis=1), dtype=np.float64)


def _most(mounts: OpenMounts, motion: float, seen: Array) -> Array:
    """What every product is not over, for a motion and deflections of the mounts that are not over these."""
    turn = motion * float(np.linalg.norm(mounts.turns, 2))
    felt = _at_most(mounts, "elastic"), _at_most(mounts, "viscous")
    found = [np.full(spring.axes.shape[1], spring.most * seen[spring.mount]) for spring in mounts.springs]
    for place in mounts.places:
        moments = [sum(abs(h) * each[m] * seen[m] for m, h in place.mounts) for each in felt[: 1 + place.is_damped]]
        found.append(np.repeat([turn, *moments], len(place.aside)))
    return np.concatenate([np.zeros(0), *found])


def _seen_at_most(mounts: OpenMounts) -> Array:
    """Deflection of every mount per motion."""
    turn, reach = float(np.linalg.norm(mounts.turns, 2)), np.zeros(len(mounts.motions))
    for place in mounts.places:
        for m, h in place.mounts:
            reach[m] += abs(h)
    return np.array([float(np.linalg.norm(g, 2)) + h * turn for g, h in zip(mounts.motions, reach, strict=True)])


def _at_most(mounts: OpenMounts, kind: Literal["elastic", "viscous"]) -> Array:
    """Stiffness, or damping, of every mount."""
    found = np.linalg.norm(mounts.middles if kind == "elastic" else mounts.dampers, 2, axis=(1, 2))
    for spring in mounts.springs:
        found[spring.mount] += abs(getattr(spring, kind)) * spring.most
    return np.asarray(found, dtype=np.float64)


def most_felt(mounts: OpenMounts, loads: ComplexArray, omega: float, travel: bool, chosen: Sequence[int]) -> float:
    """The sum over mounts of the amplitudes of their forces, or travel, is not over this for any design of the box.

    Columns are counted in what each unbalance is not over.
    """
    members = [k for k, own in enumerate(mounts.members) if own[0] in chosen]
    sizes, counted = mounts.times[mounts.stands], np.isin(mounts.stands, members)
    if not travel:
        elastic, viscous = _at_most(mounts, "elastic"), _at_most(mounts, "viscous")
        sizes = sizes * (elastic * np.abs(mounts.turning(omega)) + omega * viscous)
    found = float((_seen_at_most(mounts) * sizes)[counted].sum())
    if not travel:
        found += math.sqrt(len(chosen)) * float(np.linalg.norm(_of_mounts_alone(mounts, omega)))
    return _motion_at_most(mounts, loads, omega) * found


def _of_mounts_alone(mounts: OpenMounts, omega: float) -> ComplexArray:
    """What springs whose stiffness depends on frequency do to the mounts per motion, shape (mounts, 3, k)."""
    nothing = np.zeros((len(mounts.losses), 3, mounts.size), dtype=np.complex128)
    return _of_mounts(mounts, nothing, omega, np.eye(mounts.size, dtype=np.complex128))


def _motion_at_most(mounts: OpenMounts, loads: ComplexArray, omega: float) -> float:
    """|y| of no design of the box is over this: damping takes energy, and far above resonance the mass holds.

    Columns are counted in what |u| is not over.
    """
    lost = mounts.lost(omega)
    even = float((mounts.losses + omega * mounts.lags).min()) * max(mounts.lowest, 0.0) * np.eye(mounts.size)
    if not mounts.dynamic:
        # all of A has the least loss of its springs
        lost = max(lost, even + omega * mounts.damping, key=lambda each: float(np.linalg.eigvalsh(each)[0]))
    rise = mounts.dynamic.impedance(np.array([omega]), mounts.root.T)[0].real
    top = mounts.highest + max(float(np.linalg.eigvalsh(rise)[-1]), 0.0)
    # at rest stiffness carries all of the load
    moving = max(float(np.linalg.eigvalsh(lost)[0]), omega**2 - top)
    room = moving if omega > 0.0 else mounts.lowest
    return float(np.linalg.norm(loads, axis=1).sum()) / room if room > 0.0 else math.inf


def in_parts(functions: ComplexArray) -> Array:
    """Real and imaginary parts one after the other, shape (n, d) to (2 n, d)."""
    rows = functions.reshape(-1, functions.shape[-1])
    return np.concatenate([rows.real, rows.imag])


def squared(functions: ComplexArray) -> Array:
    """The sum of their squares in the moments of (1, v), shape (d, d)."""
    rows = in_parts(functions)
    return np.asarray(rows.T @ rows)


def product(first: ComplexArray, second: ComplexArray) -> Array:
    """Re first* second in the moments of (1, v), shape (d, d)."""
    found = in_parts(first).T @ in_parts(second)
    return np.asarray(0.5 * (found + found.T))
