"""Limits of zero are equations between the decisions, which are kept to the last digit (P11).

Where the sum of all loads of a kind is to vanish, V0 + B x = 0, no cone has an inside that a solver could go through.
The rows of such limits are brought to as many equations as there are directions in which they act. Dual rows of a
limit of zero cost nothing, whatever they are, so that a bound may take those that make it level.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from laufruhe.load_models.affine import AffineProblem
from laufruhe.numerics.arrays import Array
from laufruhe.prove.certificate import Multipliers
from laufruhe.solvers.cones.program import projected

SAME = 1e-10
"""Share of what the decisions do, or of what is to vanish, under which there is nothing."""
MOST_TURNS = 40


@dataclass(frozen=True, eq=False)
class Equations:
    """matrix x = right, with rows that are orthonormal in units of the decisions.

    Attributes
    ----------
    dual
        Of every limit what makes dual rows of multipliers of the equations, shapes (k d, equations).
    shapes
        Of the rows of every limit.
    """

    matrix: Array
    right: Array
    units: Array
    dual: tuple[Array, ...]
    shapes: tuple[tuple[int, ...], ...]

    def beside(self, held: tuple[Array, Array] | None) -> tuple[Array, Array]:
        """With others that hold as well, these first."""
        if held is None:
            return self.matrix, self.right
        return np.concatenate([self.matrix, held[0]]), np.concatenate([self.right, held[1]])

    def kept(self, problem: AffineProblem, x: Array) -> Array:
        """The decisions that keep the equations, near others and in their sets."""
        for _ in range(MOST_TURNS):
            missing = self.right - self.matrix @ x
            x = x + self.units**2 * (missing @ self.matrix)
            inside = projected(problem, x.copy())
            if np.array_equal(inside, x):
                break
            x = inside
        return x

    def rows(self, prices: Array) -> list[Array]:
        """Dual rows of the limits from the multipliers of the equations."""
        own = prices[: len(self.right)]
        return [(each @ own).reshape(shape) for each, shape in zip(self.dual, self.shapes, strict=True)]


def equations_of(problem: AffineProblem, limits: Sequence[int]) -> Equations | None:
    """What some limits of zero ask of the decisions; None where there is none, or they contradict each other."""
    norms = [problem.limits[k][1] for k in limits]
    if not norms:
        return None
    units = problem.units
    slopes = [norm.slope.reshape(-1, problem.size) * units for norm in norms]
    sizes = [max(float(np.abs(norm.constant).max(initial=0.0)), float(np.abs(slope).max(initial=0.0)), 1e-300)
             for norm, slope in zip(norms, slopes, strict=True)]  # fmt: skip
    stacked = np.concatenate([slope / size for slope, size in zip(slopes, sizes, strict=True)])
    constant = np.concatenate([norm.constant.ravel() / size for norm, size in zip(norms, sizes, strict=True)])
    left, values, right = np.linalg.svd(stacked, full_matrices=False)
    acting = values > SAME * values[0]
    left, values, right = left[:, acting], values[acting], right[acting]
    along = left.T @ constant
    if np.linalg.norm(constant - left @ along) > SAME * np.linalg.norm(constant):
        return None
    dual = np.split(left / values, np.cumsum([len(slope) for slope in slopes])[:-1])
    return Equations(
        right / units, -along / values, units, tuple(own / size for own, size in zip(dual, sizes, strict=True)),
        tuple(norm.constant.shape for norm in norms),
    )  # fmt: skip


def on_grid(coarse: AffineProblem, fine: AffineProblem, found: Multipliers) -> Multipliers:
    """Dual rows of limits of zero on a finer grid, with the slope that they have on the coarse one."""
    equal = [k for k, (maximum, _) in enumerate(coarse.limits) if maximum == 0.0]
    equations = equations_of(fine, equal)
    if equations is None:
        return found
    slope = sum((coarse.limits[k][1].pulled(found.limits[k]) for k in equal), np.zeros(coarse.size))
    rows = equations.rows(equations.matrix @ (equations.units**2 * slope))
    limits = list(found.limits)
    for k, z in zip(equal, rows, strict=True):
        limits[k] = z
    return Multipliers(found.terms, tuple(limits))
