"""Response of an order over a box of mounts, affine in products of open numbers and motion (E42, E52, E66).

A spring whose stiffness is open adds the force t = kappa(s) u to that of the middle, u its deflection. A mount that
may move by s times h sees s h (theta x e) more of the turn theta of the block, and has the moment s h e x f more. What
is open of a damper adds i W t, t = (C - C(c)) u; where it follows what is open of stiffness, i W b t. With these
products t, s theta and s f as variables w, f without loss and that of dampers over i W each by itself, and unbalances
beside them,

    D(c) y = r0 + R u - (terms linear in w)                                                 (E42)

so that motion, deflections and mount forces are affine in v, the unbalances, Re w and Im w. Only the products are
nonlinear.
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

# least unit of a product, as a share of the largest of its kind
SMALL = 0.1


@dataclass(frozen=True, eq=False)
class Response:
    """Response of an order over a box, as complex functions of (1, v), shapes (..., d), in units of a motion.

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
        Upper bounds of the squares of v over all designs of the box, shape (d - 1,).
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
        """Return d."""
        return int(self.motion.shape[-1])


@dataclass(frozen=True, eq=False)
class ResponseBound:
    """Upper bound of the amplitude of force, or travel, of mounts by their numbers, for all designs that count."""

    mounts: tuple[int, ...]
    upper: float
    is_travel: bool

    def deflections(self, mounts: OpenMounts) -> Array:
        """Return bounds of the deflections of springs, shape (springs,): a mount has its softest direction at least."""
        bounds = np.full(mounts.mounts, math.inf)
        softest = np.bincount(mounts.stands, mounts.softest, mounts.mounts)
        for k, members in enumerate(mounts.members):
            if members[0] not in self.mounts:
                continue
            if self.is_travel:
                bounds[k] = self.upper * mounts.times[k]
            elif softest[k] > 0.0 and not mounts.dynamic:
                bounds[k] = self.upper * mounts.times[k] / softest[k]
        return np.asarray(bounds[mounts.stands])


def response_of(
    mounts: OpenMounts, loads: ComplexArray, omega: float, near: ComplexArray, bound: ResponseBound
) -> Response:
    """Return the response to one order (E42, E52).

    Parameters
    ----------
    loads
        r, and its change per unit of every column of the unbalances, shape (1 + columns, k).
    omega
        Angular frequency [rad/s].
    near
        Motions of a design, which give units, shape (k, n).
    bound
        Bound of forces or travel of the designs that count.
    """
    unit, columns = float(np.linalg.norm(near)) or 1.0, len(loads) - 1
    sizes = _units(mounts, near / unit)
    # every product is a variable in its unit
    count = len(sizes)
    variables = np.zeros((count, 1 + columns + 2 * count), dtype=complex)
    rows = np.arange(count)
    variables[rows, 1 + columns + rows], variables[rows, 1 + columns + count + rows] = sizes, 1j * sizes
    ends = np.cumsum([spring.axes.shape[1] for spring in mounts.springs] + [place.products for place in mounts.places])
    products = np.split(variables, ends[:-1]) if len(ends) else []
    springs, places = products[: len(mounts.springs)], products[len(mounts.springs) :]
    # what products add to deflections, to the elastic load on the block, and to the load of the middle
    turning, width = mounts.turning(omega), variables.shape[1]
    shifted = np.zeros((len(turning), 3, width), dtype=complex)
    moments, load = (np.zeros((mounts.size, width), dtype=complex) for _ in range(2))
    for place, part in zip(mounts.places, places, strict=True):
        turns, *place_moments = np.split(part, len(part) // len(place.aside))
        for m, reach in place.mounts:
            shifted[m] += reach * place.arms.T @ turns
        on_block = [mounts.root[:, 3:] @ place.aside.T @ each for each in place_moments]
        moments += on_block[0]
        # mounts of one place have one loss factor
        for moment, factor in zip(on_block, (turning[place.mounts[0][0]], 1j * omega), strict=False):
            load -= moment * factor
    for spring, part in zip(mounts.springs, springs, strict=True):
        factor = spring.elastic * turning[spring.mount] + 1j * omega * spring.viscous
        load -= factor * mounts.motions[spring.mount].T @ spring.axes @ part
    load[:, : 1 + columns] += loads.T / unit
    impedances = mounts.middles * turning[:, None, None] + 1j * omega * mounts.dampers
    load -= np.einsum("mia,mij,mjd->ad", mounts.motions, impedances, shifted)
    whole = sum(carried(g, z) for g, z in zip(mounts.motions, impedances, strict=True))
    dynamic = mounts.at_rest + mounts.dynamic.impedance(np.array([omega]), mounts.root.T)[0]
    motion = np.asarray(np.linalg.solve(whole + dynamic - omega**2 * np.eye(mounts.size), load), dtype=np.complex128)
    deflections = mounts.motions @ motion + shifted
    elastic, viscous = mounts.middles @ deflections, mounts.dampers @ deflections
    for spring, part in zip(mounts.springs, springs, strict=True):
        elastic[spring.mount] += spring.elastic * (spring.axes @ part)
        viscous[spring.mount] += spring.viscous * (spring.axes @ part)
    forces = elastic * turning[:, None, None] + 1j * omega * viscous
    place_loads = []
    for place in mounts.places:
        own = [np.asarray(sum(h * place.arms @ each[m] for m, h in place.mounts))
               for each in (elastic, viscous)[: 1 + place.is_damped]]  # fmt: skip
        place_loads.append(np.concatenate([place.aside @ mounts.turns @ motion, *own]))
    carried_motion = np.einsum("mia,mid->ad", mounts.motions, elastic) + moments + mounts.at_rest @ motion
    motion_bound = _motion_bound(mounts, loads, omega)
    bounds = _product_bounds(
        mounts, motion_bound, np.minimum(motion_bound * _deflections_per_motion(mounts), bound.deflections(mounts))
    )
    return Response(
        columns,
        motion,
        np.asarray(carried_motion, dtype=np.complex128),
        mounts.members,
        deflections[[int(np.argmax(mounts.stands == k)) for k in range(mounts.mounts)]] / mounts.times[:, None, None],
        _mount_forces(mounts, forces, omega, motion) / mounts.times[:, None, None],
        tuple(
            (spring.axes.T @ deflections[spring.mount], part)
            for spring, part in zip(mounts.springs, springs, strict=True)
        ),
        tuple(zip(place_loads, places, strict=True)),
        np.concatenate([np.ones(columns), *([(bounds / (unit * sizes)) ** 2] * 2)]),
        unit,
    )


def _mount_forces(mounts: OpenMounts, forces: ComplexArray, omega: float, motion: ComplexArray) -> ComplexArray:
    static = mounts.dynamic.directions @ np.diag([law.static for law in mounts.dynamic.laws]) @ mounts.dynamic.rows
    added = mounts.dynamic.forces(np.array([omega]), mounts.root.T)[0] + static.reshape(-1, 6) @ mounts.root.T
    total = np.asarray(added @ motion, dtype=np.complex128).reshape(mounts.mounts, 3, -1)
    np.add.at(total, mounts.stands, forces)
    return total


def _units(mounts: OpenMounts, near: ComplexArray) -> Array:
    """Return the rough size of every product at some motions, none much smaller than others of its kind."""
    deflections, turns = mounts.motions @ near, mounts.turns @ near
    sizes = [_lengths(spring.axes.T @ deflections[spring.mount]) for spring in mounts.springs]
    minimum = SMALL * max((float(each.max()) for each in sizes), default=0.0)
    units = [spring.size * np.maximum(each, minimum) for spring, each in zip(mounts.springs, sizes, strict=True)]
    for place in mounts.places:
        units.append(np.maximum(_lengths(place.aside @ turns), SMALL * np.linalg.norm(turns)))
        for matrices in (mounts.middles, mounts.dampers)[: 1 + place.is_damped]:
            forces = [(h, matrices[m] @ deflections[m]) for m, h in place.mounts]
            moment = _lengths(np.asarray(sum(h * place.arms @ force for h, force in forces)))
            units.append(np.maximum(moment, SMALL * sum(abs(h) * np.linalg.norm(force) for h, force in forces)))
    joined = np.concatenate([np.zeros(0), *units])
    return np.where(joined > 0.0, joined, joined.max(initial=0.0) or 1.0)


def _lengths(rows: ComplexArray) -> Array:
    return np.asarray(np.linalg.norm(rows, axis=1), dtype=np.float64)


def _product_bounds(mounts: OpenMounts, motion: float, deflections: Array) -> Array:
    # upper bounds of the products from those of motion and deflections, shape (springs,)
    turn = motion * float(np.linalg.norm(mounts.turns, 2))
    kinds = _largest(mounts, "elastic"), _largest(mounts, "viscous")
    bounds = [np.full(spring.axes.shape[1], spring.largest * deflections[spring.mount]) for spring in mounts.springs]
    for place in mounts.places:
        moments = [
            sum(abs(h) * kind[m] * deflections[m] for m, h in place.mounts) for kind in kinds[: 1 + place.is_damped]
        ]
        bounds.append(np.repeat([turn, *moments], len(place.aside)))
    return np.concatenate([np.zeros(0), *bounds])


def _deflections_per_motion(mounts: OpenMounts) -> Array:
    turn, reach = float(np.linalg.norm(mounts.turns, 2)), np.zeros(len(mounts.motions))
    for place in mounts.places:
        for m, h in place.mounts:
            reach[m] += abs(h)
    return np.array([float(np.linalg.norm(g, 2)) + h * turn for g, h in zip(mounts.motions, reach, strict=True)])


def _largest(mounts: OpenMounts, kind: Literal["elastic", "viscous"]) -> Array:
    sizes = np.linalg.norm(mounts.middles if kind == "elastic" else mounts.dampers, 2, axis=(1, 2))
    for spring in mounts.springs:
        sizes[spring.mount] += abs(getattr(spring, kind)) * spring.largest
    return np.asarray(sizes, dtype=np.float64)


def response_bound(mounts: OpenMounts, loads: ComplexArray, omega: float, travel: bool, chosen: Sequence[int]) -> float:
    """Return an upper bound of the sum of amplitudes of force, or travel, over mounts and all designs of the box.

    Parameters
    ----------
    loads
        r, and its change by the largest unbalance of every column, shape (1 + columns, k).
    omega
        Angular frequency [rad/s].
    chosen
        Numbers of the mounts of the problem.
    """
    members = [k for k, own in enumerate(mounts.members) if own[0] in chosen]
    sizes, counted = mounts.times[mounts.stands], np.isin(mounts.stands, members)
    if not travel:
        elastic, viscous = _largest(mounts, "elastic"), _largest(mounts, "viscous")
        sizes = sizes * (elastic * np.abs(mounts.turning(omega)) + omega * viscous)
    per_motion = float((_deflections_per_motion(mounts) * sizes)[counted].sum())
    if not travel:
        none = np.zeros((len(mounts.losses), 3, mounts.size), dtype=np.complex128)
        dynamic = _mount_forces(mounts, none, omega, np.eye(mounts.size, dtype=np.complex128))
        per_motion += math.sqrt(len(chosen)) * float(np.linalg.norm(dynamic))
    return _motion_bound(mounts, loads, omega) * per_motion


def _motion_bound(mounts: OpenMounts, loads: ComplexArray, omega: float) -> float:
    """Return an upper bound of |y| over the box: damping takes energy, and far above resonance the mass resists."""
    lost = mounts.lost(omega)
    even = float((mounts.losses + omega * mounts.lags).min()) * max(mounts.lowest, 0.0) * np.eye(mounts.size)
    if not mounts.dynamic:
        # all of A has the least loss of its springs
        lost = max(lost, even + omega * mounts.damping, key=lambda each: float(np.linalg.eigvalsh(each)[0]))
    rise = mounts.dynamic.impedance(np.array([omega]), mounts.root.T)[0].real
    top = mounts.highest + max(float(np.linalg.eigvalsh(rise)[-1]), 0.0)
    # at rest stiffness carries all of the load
    moving = max(float(np.linalg.eigvalsh(lost)[0]), omega**2 - top)
    resistance = moving if omega > 0.0 else mounts.lowest
    return float(np.linalg.norm(loads, axis=1).sum()) / resistance if resistance > 0.0 else math.inf


def in_parts(functions: ComplexArray) -> Array:
    """Return real and imaginary parts one after the other, shape (n, d) to (2 n, d)."""
    rows = functions.reshape(-1, functions.shape[-1])
    return np.concatenate([rows.real, rows.imag])


def squared(functions: ComplexArray) -> Array:
    """Return the sum of their squares in the moments of (1, v), shape (d, d)."""
    rows = in_parts(functions)
    return np.asarray(rows.T @ rows)


def product(first: ComplexArray, second: ComplexArray) -> Array:
    """Return Re first* second in the moments of (1, v), shape (d, d)."""
    products = in_parts(first).T @ in_parts(second)
    return np.asarray(0.5 * (products + products.T))
