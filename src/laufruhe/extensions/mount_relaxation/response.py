"""Response of an order over a box of mounts, affine in products of open numbers and motion (E42, E52, E66).

An open stiffness adds the force t = kappa(s) u to that of the middle, where u is the spring's deflection. A mount with
an open place s h sees s h (theta x e) more of the block's turn theta, and has the further moment s h e x f. An open
damper adds i W t at angular frequency W, t = (C - C(c)) u; if it follows an open stiffness, it adds i W b t. The
variables w are these products: t, s theta and s f, with f without loss and the forces of dampers over i W each by
itself. Let D(c) be the dynamic stiffness at the middle c of the box, and R u the change of the load r0 by unbalances u.
The motion y of the block has

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

# smallest unit of a product, over the largest of its kind
MIN_UNIT = 0.1


@dataclass(frozen=True, eq=False)
class Response:
    """Response of an order over a box: complex coefficients of (1, v), shapes (..., d), in units of a motion (E42).

    Attributes
    ----------
    columns
        Count of unbalance columns in v.
    motion, carried
        Motion y and elastic load A y, with the stiffness matrix A, in coordinates of unit mass, shape (k, d) each.
    members
        For each mount of the relaxation, the numbers of the problem's mounts that it represents.
    deflections, forces
        Deflection and force of one member of each mount, shape (mounts, 3, d).
    springs
        For each open spring, deflection u and force t, shape (b, d) each.
    places
        For each open place, turns and moments, and s times these, shape (products, d) each.
    reach
        Upper bound of |v|^2 over all designs of the box.
    unit
        Length of the motion that counts as one.
    """

    columns: int
    motion: ComplexArray
    carried: ComplexArray
    members: tuple[tuple[int, ...], ...]
    deflections: ComplexArray
    forces: ComplexArray
    springs: tuple[tuple[ComplexArray, ComplexArray], ...]
    places: tuple[tuple[ComplexArray, ComplexArray], ...]
    reach: float
    unit: float

    @property
    def size(self) -> int:
        """Length d of (1, v)."""
        return int(self.motion.shape[-1])


@dataclass(frozen=True, eq=False)
class ResponseBound:
    """Upper bound of the force or travel amplitude of `mounts` over all better designs; `upper` [N or m]."""

    mounts: tuple[int, ...]
    upper: float
    is_travel: bool

    def deflections(self, mounts: OpenMounts) -> Array:
        """Return upper bounds of spring deflections [m], from force and softest direction, shape (springs,)."""
        bounds = np.full(mounts.mounts, math.inf)
        softest = np.bincount(mounts.spring_mounts, mounts.softest, mounts.mounts)
        for k, members in enumerate(mounts.members):
            if members[0] not in self.mounts:
                continue
            if self.is_travel:
                bounds[k] = self.upper * mounts.symmetry_factors[k]
            elif softest[k] > 0.0 and not mounts.dynamic:
                bounds[k] = self.upper * mounts.symmetry_factors[k] / softest[k]
        return np.asarray(bounds[mounts.spring_mounts])


def response_of(
    mounts: OpenMounts, loads: ComplexArray, omega: float, reference_motions: ComplexArray, bound: ResponseBound
) -> Response:
    """Return the response to the load of one order over the box of `mounts` (E42, E52).

    Parameters
    ----------
    loads
        Load r, and its change per unit of each unbalance column, shape (1 + columns, k).
    omega
        Angular frequency [rad/s].
    reference_motions
        Motions of a design, which set the units, shape (k, n).
    bound
        Bound of force or travel over better designs.
    """
    unit, columns = float(np.linalg.norm(reference_motions)) or 1.0, len(loads) - 1
    sizes = _units(mounts, reference_motions / unit)
    # columns of v: unbalances, then real and imaginary parts of the products, each in its unit
    count = len(sizes)
    variables = np.zeros((count, 1 + columns + 2 * count), dtype=complex)
    rows = np.arange(count)
    variables[rows, 1 + columns + rows], variables[rows, 1 + columns + count + rows] = sizes, 1j * sizes
    ends = np.cumsum([spring.axes.shape[1] for spring in mounts.springs] + [place.products for place in mounts.places])
    products = np.split(variables, ends[:-1]) if len(ends) else []
    springs, places = products[: len(mounts.springs)], products[len(mounts.springs) :]
    # contributions of products to deflections, to the elastic load on the block, and to the load of the middle
    stiffness_factors, width = mounts.stiffness_factors(omega), variables.shape[1]
    shifted = np.zeros((len(stiffness_factors), 3, width), dtype=complex)
    moments, load = (np.zeros((mounts.size, width), dtype=complex) for _ in range(2))
    for place, product in zip(mounts.places, places, strict=True):
        turns, *place_moments = np.split(product, len(product) // len(place.turn_axes))
        for m, reach in place.mounts:
            shifted[m] += reach * place.arms.T @ turns
        on_block = [mounts.root[:, 3:] @ place.turn_axes.T @ force for force in place_moments]
        moments += on_block[0]
        # all mounts of one place have the same loss factor
        for moment, factor in zip(on_block, (stiffness_factors[place.mounts[0][0]], 1j * omega), strict=False):
            load -= moment * factor
    for spring, product in zip(mounts.springs, springs, strict=True):
        factor = spring.elastic * stiffness_factors[spring.mount] + 1j * omega * spring.viscous
        load -= factor * mounts.motions[spring.mount].T @ spring.axes @ product
    load[:, : 1 + columns] += loads.T / unit
    impedances = mounts.middles * stiffness_factors[:, None, None] + 1j * omega * mounts.dampers
    load -= np.einsum("mia,mij,mjd->ad", mounts.motions, impedances, shifted)
    middle_stiffness = sum(carried(g, z) for g, z in zip(mounts.motions, impedances, strict=True))
    dynamic = mounts.at_rest + mounts.dynamic.impedance(np.array([omega]), mounts.root.T)[0]
    motion = np.asarray(
        np.linalg.solve(middle_stiffness + dynamic - omega**2 * np.eye(mounts.size), load), dtype=np.complex128
    )
    deflections = mounts.motions @ motion + shifted
    elastic, viscous = mounts.middles @ deflections, mounts.dampers @ deflections
    for spring, product in zip(mounts.springs, springs, strict=True):
        elastic[spring.mount] += spring.elastic * (spring.axes @ product)
        viscous[spring.mount] += spring.viscous * (spring.axes @ product)
    forces = elastic * stiffness_factors[:, None, None] + 1j * omega * viscous
    place_loads = []
    for place in mounts.places:
        place_forces = [np.asarray(sum(h * place.arms @ force[m] for m, h in place.mounts))
               for force in (elastic, viscous)[: 1 + place.is_damped]]  # fmt: skip
        place_loads.append(np.concatenate([place.turn_axes @ mounts.turns @ motion, *place_forces]))
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
        deflections[[int(np.argmax(mounts.spring_mounts == k)) for k in range(mounts.mounts)]]
        / mounts.symmetry_factors[:, None, None],
        _mount_forces(mounts, forces, omega, motion) / mounts.symmetry_factors[:, None, None],
        tuple(
            (spring.axes.T @ deflections[spring.mount], product)
            for spring, product in zip(mounts.springs, springs, strict=True)
        ),
        tuple(zip(place_loads, places, strict=True)),
        columns + 2.0 * float(np.sum((bounds / (unit * sizes)) ** 2)),
        unit,
    )


def _mount_forces(mounts: OpenMounts, forces: ComplexArray, omega: float, motion: ComplexArray) -> ComplexArray:
    static = mounts.dynamic.directions @ np.diag([law.static for law in mounts.dynamic.laws]) @ mounts.dynamic.rows
    added = mounts.dynamic.forces(np.array([omega]), mounts.root.T)[0] + static.reshape(-1, 6) @ mounts.root.T
    total = np.asarray(added @ motion, dtype=np.complex128).reshape(mounts.mounts, 3, -1)
    np.add.at(total, mounts.spring_mounts, forces)
    return total


def _units(mounts: OpenMounts, motions: ComplexArray) -> Array:
    """Return a unit for each product of motion and open number: its rough size, at least MIN_UNIT of the largest."""
    deflections, turns = mounts.motions @ motions, mounts.turns @ motions
    sizes = [_lengths(spring.axes.T @ deflections[spring.mount]) for spring in mounts.springs]
    minimum = MIN_UNIT * max((float(spring_sizes.max()) for spring_sizes in sizes), default=0.0)
    units = [
        spring.size * np.maximum(spring_sizes, minimum)
        for spring, spring_sizes in zip(mounts.springs, sizes, strict=True)
    ]
    for place in mounts.places:
        units.append(np.maximum(_lengths(place.turn_axes @ turns), MIN_UNIT * np.linalg.norm(turns)))
        for matrices in (mounts.middles, mounts.dampers)[: 1 + place.is_damped]:
            forces = [(h, matrices[m] @ deflections[m]) for m, h in place.mounts]
            moment = _lengths(np.asarray(sum(h * place.arms @ force for h, force in forces)))
            units.append(np.maximum(moment, MIN_UNIT * sum(abs(h) * np.linalg.norm(force) for h, force in forces)))
    joined = np.concatenate([np.zeros(0), *units])
    return np.where(joined > 0.0, joined, joined.max(initial=0.0) or 1.0)


def _lengths(rows: ComplexArray) -> Array:
    return np.asarray(np.linalg.norm(rows, axis=1), dtype=np.float64)


def _product_bounds(mounts: OpenMounts, motion: float, deflections: Array) -> Array:
    # upper bounds of the products from upper bounds of motion and of deflections, shape (products,)
    turn = motion * float(np.linalg.norm(mounts.turns, 2))
    kinds = _largest(mounts, "elastic"), _largest(mounts, "viscous")
    bounds = [np.full(spring.axes.shape[1], spring.largest * deflections[spring.mount]) for spring in mounts.springs]
    for place in mounts.places:
        moments = [
            sum(abs(h) * kind[m] * deflections[m] for m, h in place.mounts) for kind in kinds[: 1 + place.is_damped]
        ]
        bounds.append(np.repeat([turn, *moments], len(place.turn_axes)))
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
    """Return an upper bound of the sum of force or travel amplitudes over mounts, for all designs of the box.

    Parameters
    ----------
    loads
        Load r, and its change by the largest unbalance of each column, shape (1 + columns, k).
    omega
        Angular frequency [rad/s].
    travel
        True for travel [m], False for force [N].
    chosen
        Numbers of the mounts of the problem in the sum.
    """
    members = [k for k, numbers in enumerate(mounts.members) if numbers[0] in chosen]
    sizes, is_chosen = mounts.symmetry_factors[mounts.spring_mounts], np.isin(mounts.spring_mounts, members)
    if not travel:
        elastic, viscous = _largest(mounts, "elastic"), _largest(mounts, "viscous")
        sizes = sizes * (elastic * np.abs(mounts.stiffness_factors(omega)) + omega * viscous)
    per_motion = float((_deflections_per_motion(mounts) * sizes)[is_chosen].sum())
    if not travel:
        no_forces = np.zeros((len(mounts.losses), 3, mounts.size), dtype=np.complex128)
        dynamic = _mount_forces(mounts, no_forces, omega, np.eye(mounts.size, dtype=np.complex128))
        per_motion += math.sqrt(len(chosen)) * float(np.linalg.norm(dynamic))
    return _motion_bound(mounts, loads, omega) * per_motion


def _motion_bound(mounts: OpenMounts, loads: ComplexArray, omega: float) -> float:
    """Return an upper bound of the motion |y| over the box, by energy lost in damping or inertia above resonance."""
    loss = mounts.loss_at(omega)
    uniform_loss = float((mounts.losses + omega * mounts.lags).min()) * max(mounts.lowest, 0.0) * np.eye(mounts.size)
    if not mounts.dynamic:
        # the whole stiffness has at least the smallest loss factor of its springs
        loss = max(loss, uniform_loss + omega * mounts.damping, key=lambda matrix: float(np.linalg.eigvalsh(matrix)[0]))
    dynamic_stiffness = mounts.dynamic.impedance(np.array([omega]), mounts.root.T)[0].real
    highest = mounts.highest + max(float(np.linalg.eigvalsh(dynamic_stiffness)[-1]), 0.0)
    resistance = max(float(np.linalg.eigvalsh(loss)[0]), omega**2 - highest)
    return float(np.linalg.norm(loads, axis=1).sum()) / resistance if resistance > 0.0 else math.inf


def in_parts(functions: ComplexArray) -> Array:
    """Return the real parts of n complex functions, then their imaginary parts, shape (2 n, d)."""
    rows = functions.reshape(-1, functions.shape[-1])
    return np.concatenate([rows.real, rows.imag])


def squared(functions: ComplexArray) -> Array:
    """Return the coefficients of the sum of squared amplitudes of functions in the moments of (1, v), shape (d, d)."""
    rows = in_parts(functions)
    return np.asarray(rows.T @ rows)


def product(first: ComplexArray, second: ComplexArray) -> Array:
    """Return the coefficients of Re (first* second), summed, in the moments of (1, v), shape (d, d)."""
    products = in_parts(first).T @ in_parts(second)
    return np.asarray(0.5 * (products + products.T))
