"""Lower bounds of all crank stars from the dual rows of one star (S14)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from laufruhe.load_models.star_model import StarProblem
from laufruhe.numerics.arrays import Array, Mask
from laufruhe.physics.crank_stars import Stars, StarSpace
from laufruhe.problem.decision import Domain
from laufruhe.prove.certificate import ROUNDING, Multipliers


@dataclass(frozen=True, eq=False)
class Cut:
    """Lower bound of the objective of every star from the dual rows of one star (S14).

    With throw k on step p_k it is c + sum_k A[k, p_k] + sum over decisions of min_x (g + sum_k G[k, p_k]) . x, with x
    in the set of each decision.

    Attributes
    ----------
    constant, moves
        Constant c, and its changes A by throw and step, shape (throws, steps).
    gradient, gradient_moves
        Gradient g, shape (n,), and its changes G, shape (throws, steps, n); None if all stars have one gradient.
    domains
        Sets of the decisions.
    rounding
        Largest rounding error of the bound.
    """

    constant: float
    moves: Array
    gradient: Array
    gradient_moves: Array | None
    domains: tuple[Domain, ...]
    rounding: float

    def bounds(self, stars: Stars, sets: Sequence[tuple[int, ...]], owners: Sequence[int]) -> Array:
        """Return lower bounds of stars with sets of built shafts, shape (stars, sets), at least zero.

        Parameters
        ----------
        stars
            Step of every throw, shape (stars, throws).
        sets, owners
            Indices of the optional shafts that are built, for each set; index of the optional shaft that carries each
            decision, -1 if no optional shaft does.
        """
        return np.maximum(self._sums(stars, sets, owners), 0.0)

    def excludes(self, stars: Stars, sets: Sequence[tuple[int, ...]], owners: Sequence[int]) -> Mask:
        """Return True for infeasible stars, shape (stars, sets), if the cut is from dual rows of limits alone (S45)."""
        return np.asarray(self._sums(stars, sets, owners) > self.rounding)

    def _sums(self, stars: Stars, sets: Sequence[tuple[int, ...]], owners: Sequence[int]) -> Array:
        total = np.full(len(stars), self.constant)
        for k in range(stars.shape[1]):
            total += self.moves[k, stars[:, k]]
        # min g . x of every decision, shape (stars, decisions)
        if self.gradient_moves is None:
            minima = np.tile([domain.minimum(self.gradient) for domain in self.domains], (len(stars), 1))
        else:
            gradients = np.tile(self.gradient, (len(stars), 1))
            for k in range(stars.shape[1]):
                gradients += self.gradient_moves[k, stars[:, k]]
            minima = np.array([[domain.minimum(g) for domain in self.domains] for g in gradients])
        sums = np.empty((len(stars), len(sets)))
        for column, built in enumerate(sets):
            chosen = [d for d, owner in enumerate(owners) if owner < 0 or owner in built]
            sums[:, column] = total + (minima[:, chosen].sum(axis=1) if chosen else 0.0)
        return sums

    def minimum(self, space: StarSpace) -> float:
        """Return a lower bound of the cut over all crank stars, at least zero, by assignment of throws to steps."""
        from scipy.optimize import linear_sum_assignment

        if self.gradient_moves is not None:
            return 0.0
        decided = sum(domain.minimum(self.gradient) for domain in self.domains)
        values = []
        for pattern in space.patterns:
            # the first throw stands on step 0
            places = np.repeat(np.arange(space.phases), pattern)[1:]
            cost = self.moves[1:][:, places]
            rows, columns = linear_sum_assignment(cost)
            values.append(self.moves[0, 0] + float(cost[rows, columns].sum()))
        return float(max(0.0, self.constant + decided + min(values)))


def cut_of(fine: StarProblem, multipliers: Multipliers) -> Cut:
    """Return a lower bound of the objective of every crank star (a cut), from the dual rows of one star (S14).

    `fine` is the problem of all crank stars on the grid on which the bound is to hold.
    """
    throws, steps = fine.terms[0][1].moves.shape[:2]
    size = fine.terms[0][1].slope.shape[-1]
    constant, moves, scale = 0.0, np.zeros((throws, steps)), 0.0
    gradient, gradient_moves, has_moves = np.zeros(size), np.zeros((throws, steps, size)), False
    parts = []
    for (weight, norm), rows in zip(fine.terms, multipliers.terms, strict=True):
        parts.append((weight * norm.norm.dual_feasible(norm.grid, rows), norm))
    for (maximum, norm), rows in zip(fine.limits, multipliers.limits, strict=True):
        z = norm.norm.balanced_dual(norm.grid, rows)
        price = norm.norm.dual_norm(norm.grid, z) * maximum
        constant -= price
        scale += price
        parts.append((z, norm))
    for z, norm in parts:
        sizes = np.abs(norm.constant) + np.abs(norm.moves).max(axis=1).sum(axis=0)
        scale += float(np.vdot(np.abs(z), sizes))
        constant += float(np.vdot(z, norm.constant))
        moves += np.einsum("kd,tpkd->tp", z, norm.moves)
        gradient += np.einsum("kd,kdn->n", z, norm.slope)
        if norm.slope_moves is not None:
            has_moves = True
            gradient_moves += np.einsum("kd,tpkdn->tpn", z, norm.slope_moves)
    return Cut(constant, moves, gradient, gradient_moves if has_moves else None, fine.domains, ROUNDING * scale)
