"""Response of a block on mounts over boxes of stiffness (E37, E38, E41).

In coordinates with unit mass the impedance is D(x) = A + i B - W^2, with the stiffness matrix A, the matrix B of loss
and damping, and the angular frequency W. D is linear in the stiffnesses x, and so are the maps from motion to mount
forces. Over a box, motion and forces are a series (`laufruhe.prove.mounts.box_series`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from laufruhe.machine.mount import every_spring
from laufruhe.numerics.arrays import Array, ComplexArray, Indices
from laufruhe.numerics.namespaces import NUMBERS
from laufruhe.physics.elastic_mounts import ElasticMounting
from laufruhe.physics.mount_numbers import mass_root
from laufruhe.physics.rigid_body import moved_wrench
from laufruhe.problem import channels
from laufruhe.problem.channels import Channel, mounting_in
from laufruhe.problem.decision import real_bounds
from laufruhe.problem.evaluation import Evaluation
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem
from laufruhe.prove.mounts.box_series import Expansion, LinearResponse, directions_of, inverses, mapped, series

# relative size of a load that counts as zero
NEGLIGIBLE = 1e-13


@dataclass(frozen=True, eq=False)
class LoadedOrders:
    """Loaded orders of all operating points; a line is one order at one operating point.

    Attributes
    ----------
    points, places
        Index of the operating point, and multiple of the lowest order of the sampled period, shape (orders,).
    orders, omegas
        Orders of crank speed, and angular frequencies [rad/s], shape (orders,).
    loads
        Wrenches r in coordinates with unit mass, shape (orders, 6), or (orders, loads, 6) for several loads.
    samples
        Samples of the period; zero if some order is no multiple of its lowest order.
    """

    points: Indices
    places: Indices
    orders: Array
    omegas: Array
    loads: ComplexArray
    samples: int

    def subset(self, selection: NDArray[np.bool_] | Indices) -> LoadedOrders:
        """Return the orders that a mask or indices select."""
        indices = (self.points[selection], self.places[selection])
        numbers = (self.orders[selection], self.omegas[selection])
        return LoadedOrders(*indices, *numbers, self.loads[selection], self.samples)

    def at_rest(self) -> LoadedOrders:
        """Return the same loads with zero frequency; their responses are the forces on rigid mounts (E11)."""
        return replace(self, omegas=np.zeros_like(self.omegas))

    @property
    def is_full(self) -> bool:
        """Return True if sums over samples equal those over the period: every order has more than two samples."""
        return bool(2 * self.places.max(initial=0) < self.samples)

    def phases(self, selection: Indices) -> ComplexArray:
        """Return factors e^{i h phi} from complex amplitudes of selected orders to samples, shape (samples, orders).

        The samples cover one common period of these orders.
        """
        factor = int(np.gcd.reduce(self.places[selection])) or 1
        factor = factor if self.samples % factor == 0 else 1
        places, samples = self.places[selection] // factor, self.samples // factor
        return np.asarray(np.exp(2j * math.pi / samples * (np.outer(np.arange(samples), places) % samples)))


SQUARE = ("stiffness", "loss", "damping")
"""Names of the matrix A, and of the parts of B without and with frequency as a factor, shape (6, 6) each."""
MAPS = ("springs", "losses", "dampers")
"""Names of the maps from motion to the mount forces of stiffness, loss and damping, shape (3 mounts, 6) each."""


def is_travel(channel: Channel) -> bool:
    """Return True if a channel is the travel of mounts, not their forces."""
    return channel is channels.MOUNT_TRAVEL


class BoxModel:
    """Matrices of a problem on elastic mounts whose only open numbers are stiffnesses.

    All designs have the same wrenches on the block.

    Attributes
    ----------
    root
        Inverse square root of the mass matrix, shape (6, 6); it takes wrenches to coordinates with unit mass.
    slopes
        Derivatives of the matrices `SQUARE` and `MAPS` by every open number, shape (n, ...), by name.
    """

    def __init__(self, problem: Problem, evaluation: Evaluation) -> None:
        self.problem, self.evaluation = problem, evaluation
        decisions = problem.mount_decisions
        self.lower, self.upper = real_bounds(decisions)
        base = self.mounting(self.lower)
        self.root = mass_root(base.block)
        self.travels = (base.motions @ self.root.T).reshape(-1, 6)
        self._base, self._dynamic = self._parts(base), base.dynamic
        ends = [np.where(np.arange(len(decisions)) == j, self.upper, self.lower) for j in range(len(decisions))]
        end_matrices = [self._parts(self.mounting(end)) for end in ends]
        pairs = list(zip(end_matrices, self.upper - self.lower, strict=True))
        self.slopes = {
            name: np.array([(matrices[name] - at_lower) / width for matrices, width in pairs])
            for name, at_lower in self._base.items()
        }
        self.sides = directions_of([[slopes[j] for slopes in self.slopes.values()] for j in range(len(decisions))])
        self._inside = [self.sides.inside(self.slopes[name]) for name in SQUARE]
        self._along = [self.sides.along(self.slopes[name]) for name in MAPS]
        self.highest = float(np.linalg.eigvalsh(self._parts(self.mounting(self.upper))["stiffness"])[-1])

    def mounting(self, x: Array) -> ElasticMounting:
        """Return the mounting at stiffnesses [N/m], shape (n,)."""
        return mounting_in(self.problem.design([float(v) for v in x], self.problem.mount_decisions))

    def _parts(self, mounting: ElasticMounting) -> dict[str, Array]:
        parts, motions = (mounting.springs, mounting.losses, mounting.dampers), mounting.motions @ self.root.T
        totals = (self.root @ mounting.total(part) @ self.root.T for part in parts)
        maps = ((part @ motions).reshape(-1, 6) for part in parts)
        return dict(zip((*SQUARE, *MAPS), (*totals, *maps), strict=True))

    def loaded_orders(self, measure: Measure) -> LoadedOrders:
        """Return the orders with a load that a measure counts, with their wrenches on the block."""
        moved = self.root @ moved_wrench(NUMBERS, self.mounting(self.lower).block.centre_of_gravity)
        base, samples = self.problem.engine.cycle.base_order, self.evaluation.samples
        rows: list[tuple[int, int, float, float, ComplexArray]] = []
        for p, loads in enumerate(self.evaluation.loads):
            step = loads.wrench.base / base
            samples = samples if step.denominator == 1 else 0
            size = np.abs(loads.wrench.coefficients).max(axis=1, initial=0.0)
            for k in np.flatnonzero(size > NEGLIGIBLE * size.max(initial=0.0)):
                order = float(loads.wrench.orders[k])
                rows.append(
                    (p, int(int(k) * step), order, order * loads.point.speed, moved @ loads.wrench.coefficients[k])
                )
        points, places, orders, omegas, wrenches = zip(*rows, strict=True) if rows else ((), (), (), (), ())
        loaded_orders = LoadedOrders(
            np.array(points, dtype=np.intp), np.array(places, dtype=np.intp), np.array(orders, dtype=float),
            np.array(omegas, dtype=float), np.array(wrenches, dtype=complex).reshape(-1, 6), samples,
        )  # fmt: skip
        counted = [measure.points is None or point.name in measure.points for point in self.problem.points]
        return loaded_orders.subset(np.array(counted)[loaded_orders.points] & measure.counted(loaded_orders.orders))

    def stiffness(self, x: Array) -> Array:
        """Return the stiffness matrix A at many designs, shape (boxes, n) to (boxes, 6, 6)."""
        return self.at("stiffness", x)

    def at(self, name: str, x: Array) -> Array:
        """Return the matrix `name` of `SQUARE` or `MAPS` at many designs, shape (boxes, n) to (boxes, ...)."""
        return np.asarray(self._base[name] + np.einsum("bn,nij->bij", x - self.lower, self.slopes[name]))

    def expanded(self, loaded_orders: LoadedOrders, lower: Array, upper: Array) -> Expansion:
        """Return the motion of the block over boxes of stiffness, as a series with a bound of its remainder (E37).

        `lower` and `upper` are the bounds of the boxes [N/m], shape (boxes, n).
        """
        centres, halves = 0.5 * (lower + upper), 0.5 * (upper - lower)
        matrices = (self.at(name, centres)[:, None] for name in SQUARE)
        impedance = _dynamic(loaded_orders, *matrices) + self._dynamic.impedance(loaded_orders.omegas, self.root.T)
        impedance = impedance - loaded_orders.omegas[:, None, None] ** 2 * np.eye(6)
        inverse = inverses(np.asarray(impedance, dtype=np.complex128))
        motion = np.matmul(inverse, loaded_orders.loads[:, :, None])[..., 0]
        return series(centres, halves, inverse, self.sides, _dynamic(loaded_orders, *self._inside), motion)

    def linear_response(
        self, loaded_orders: LoadedOrders, expansion: Expansion, channel: Channel, rows: Indices, factors: Array
    ) -> LinearResponse:
        """Return mount forces or travels as linear functions on boxes (E37).

        `rows` are the indices of the mount components, and `factors` the weights on them, shape (r,).
        """
        value, slopes = self.maps(loaded_orders, expansion, channel, rows)
        return mapped(expansion, value * factors[:, None], None if slopes is None else slopes * factors[:, None])

    def maps(
        self, loaded_orders: LoadedOrders, expansion: Expansion, channel: Channel, rows: Indices
    ) -> tuple[ComplexArray, ComplexArray | None]:
        """Return maps from motion to forces or travel, (boxes, orders, r, 6), and their slopes, (..., r, m) (E37)."""
        if is_travel(channel):
            flat = self.travels[rows].astype(complex)
            return np.broadcast_to(flat, (len(expansion.centres), len(loaded_orders.omegas), *flat.shape)), None
        maps = (self.at(name, expansion.centres)[:, None, rows] for name in MAPS)
        value = _dynamic(loaded_orders, *maps) + self._dynamic.forces(loaded_orders.omegas, self.root.T)[:, rows]
        slopes = _dynamic(loaded_orders, *(matrix[rows] for matrix in self._along))
        return value, slopes * expansion.halves[:, None, None, self.sides.number_of_column]

    def largest_response(self, loaded_orders: LoadedOrders, channel: Channel) -> Array:
        """Return, for each loaded order, an upper bound of mount force or travel of any design, shape (orders,) (E41).

        It bounds the length of the vector of all mounts' amplitudes.

        Orders that are not above all natural frequencies have an infinite bound.
        """
        margin = loaded_orders.omegas**2 - self.highest
        if self._dynamic:
            # springs with frequency-dependent stiffness raise the largest eigenvalue (E50)
            added = np.linalg.eigvalsh(self._dynamic.impedance(loaded_orders.omegas, self.root.T).real)[..., -1]
            margin = margin - np.maximum(added, 0.0)
        motion = np.linalg.norm(loaded_orders.loads, axis=1) / np.where(margin > 0.0, margin, 1.0)
        motion = np.where(margin > 0.0, motion, np.inf)
        if is_travel(channel):
            return motion * float(np.linalg.norm(self.travels))
        stiffest = self.mounting(self.upper)
        # springs that share a mount count one by one, since their sum may be smaller
        separate = replace(stiffest, mounts=tuple(spring for _, spring in every_spring(stiffest.mounts)))
        maximum, top = max(len(mount.springs) for mount in stiffest.mounts), self._parts(separate)
        static = math.sqrt(maximum) * float(np.linalg.norm(top["springs"] + 1j * top["losses"]))
        static = static + np.linalg.norm(self._dynamic.forces(loaded_orders.omegas, self.root.T), axis=(1, 2))
        return np.asarray(
            motion * (static + loaded_orders.omegas * math.sqrt(maximum) * float(np.linalg.norm(top["dampers"])))
        )


def _dynamic(loaded_orders: LoadedOrders, springs: Array, losses: Array, dampers: Array) -> ComplexArray:
    # dynamic stiffnesses at the frequencies of orders, (..., i, j) to (..., orders, i, j)
    moving, omegas = (loaded_orders.omegas > 0.0)[:, None, None], loaded_orders.omegas[:, None, None]
    return np.asarray(springs + 1j * (moving * losses + omegas * dampers))
