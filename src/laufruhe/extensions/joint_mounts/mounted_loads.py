"""Norms of what unbalances and all else load on mounts of any numbers, and multipliers of them order by order (E69).

Rows of forces and travel at the samples of the exact model, of one set of mounts after the other; what dual rows at
these samples say of the rows on any other mounts is told by their sums over the cycle, one for every order.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from laufruhe.extensions.joint_mounts.open_throws import OpenThrows
from laufruhe.load_models.affine import AffineModel, AffineNorm
from laufruhe.numerics.arrays import Array, ComplexArray, Indices
from laufruhe.numerics.namespaces import NUMBERS
from laufruhe.numerics.spectrum import in_one_base
from laufruhe.physics.mount_numbers import mass_root
from laufruhe.physics.rigid_body import moved_wrench
from laufruhe.problem.channels import mounting_in
from laufruhe.problem.measure import Measure
from laufruhe.problem.mount_resonance import off_resonance
from laufruhe.problem.problem import Problem
from laufruhe.prove.mounts.box_response import NOTHING

COARSER = 8
"""Times as few samples from which multipliers are sought first."""


@dataclass(frozen=True, eq=False)
class Orders:
    """Orders of all operating points with a load.

    Attributes
    ----------
    points, places
        Operating point, and the order in periods of the rows, shape (w,).
    numbers, omegas
        Orders of crank speed, and their frequencies [rad/s], shape (w,).
    loads
        r of all but the unbalances, and of one unit of every column, in coordinates in which the mass is one, shape
        (w, 1 + columns, 6).
    turned
        r of what turns with every open throw at an angle of zero, shape (w, throws, 6).
    """

    points: Indices
    places: Indices
    numbers: Array
    omegas: Array
    loads: ComplexArray
    turned: ComplexArray

    def kept(self, which: Indices) -> Orders:
        """Return some of them."""
        own = self.points[which], self.places[which], self.numbers[which], self.omegas[which]
        return Orders(*own, self.loads[which], self.turned[which])


class MountedLoads:
    """Loads of a problem that is open in unbalances and numbers of mounts.

    Attributes
    ----------
    samples
        Of the rows, over their period.

    Parameters
    ----------
    throws
        That are open too; loads beside the unbalances are then without what turns with these.
    """

    def __init__(self, problem: Problem, throws: OpenThrows | None = None) -> None:
        self.problem, self._throws = problem, throws
        known = off_resonance(problem)
        self._model = AffineModel(known, keep_all=True)
        told = problem.fidelity.samples * known.engine.cycle.base_order
        if throws or self._model.full_samples * self._model.base != told:
            # rows stand where the exact model has them
            self._model = AffineModel(known, keep_all=True, whole_cycle=True)
        self.samples, self.domains = self._model.full_samples, self._model.domains
        self.root = mass_root(mounting_in(problem.engine).block)
        self._still: dict[tuple[Measure, bool], AffineNorm] = {}

    @cached_property
    def orders(self) -> Orders:
        """Return the orders that are loaded."""
        moved = moved_wrench(NUMBERS, mounting_in(self.problem.engine).block.centre_of_gravity).T @ self.root.T
        found: list[tuple[int, int, float, float, ComplexArray]] = []
        at = self._throws.given[self._throws.open] if self._throws else np.zeros(0)
        for p, (point, (bare, slopes)) in enumerate(zip(self.problem.points, self._model.wrenches(), strict=True)):
            base, series = in_one_base([bare, *slopes, *(self._throws.wrenches(p) if self._throws else ())])
            loads = series @ moved
            waves = np.exp(1j * float(base) * np.outer(at, np.arange(loads.shape[1])))
            loads[0] -= np.einsum("pk,pki->ki", waves, loads[1 + len(slopes) :])
            size = np.abs(loads).max(axis=(0, 2), initial=0.0)
            for k in np.flatnonzero(size > NOTHING * size.max(initial=0.0)):
                number, place = float(k) * float(base), int(k) * base / self._model.base
                found.append((p, round(place), number, number * point.speed, loads[:, k]))
        points, places, numbers, omegas, each = zip(*found, strict=True)
        own = np.array(points), np.array(places), np.array(numbers), np.array(omegas)
        loads, turned = np.split(np.array(each), [len(each[0]) - len(at)], axis=1)
        return Orders(*own, loads, turned)

    def still(self, measure: Measure, averaged: bool) -> AffineNorm:
        """Return a norm that mounts do not change, at their samples."""
        if (measure, averaged) not in self._still:
            self._still[measure, averaged] = self._model.norm(measure, self.samples, averaged)
        return self._still[measure, averaged]
