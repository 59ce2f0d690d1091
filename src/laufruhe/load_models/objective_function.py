"""Objective of affine loads as a function of the decision vector, with its gradient (P2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from laufruhe.errors import wrong_call
from laufruhe.load_models.affine import AffineModel, AffineNorm, AffineProblem
from laufruhe.load_models.labelled_rows import affine_problem_of, column_names, named_values
from laufruhe.numerics.arrays import Array
from laufruhe.problem.decision import column_bounds
from laufruhe.problem.problem import Problem


@dataclass(frozen=True, eq=False, repr=False)
class ObjectiveFunction:
    """Objective as a function of the decision vector x, for optimisers such as `scipy.optimize.minimize`.

    Attributes
    ----------
    names
        Name of each number of x: an unbalance with an open angle has a real and an imaginary part (C4).
    start
        Decision vector of the initial design, shape (n,) [SI].
    bounds
        Lower and upper bound of each number [SI]. Those of an open angle contain its disc or sector.
    """

    affine: AffineProblem
    names: Sequence[str]
    start: Array
    bounds: Sequence[tuple[float, float]]

    def __call__(self, x: ArrayLike) -> tuple[float, Array]:
        """Return the objective [SI] and its gradient, shape (n,); a subgradient where the objective has a kink."""
        vector = np.asarray(x, dtype=float)
        if vector.shape != self.start.shape or not np.all(np.isfinite(vector)):
            raise wrong_call(
                "x", x, f"is no vector of {len(self.start)} finite numbers", f"give {', '.join(self.names)}"
            )
        gradient = np.zeros_like(vector)
        for weight, norm in self.affine.terms:
            gradient += weight * norm.pullback(norm.subgradient(vector))
        return self.affine.objective(vector), gradient

    def __repr__(self) -> str:
        return f"<ObjectiveFunction of {', '.join(self.names)}>"

    @property
    def constraints(self) -> list[dict[str, Any]]:
        """Limits as `scipy.optimize.minimize` takes them: the share of each limit that is left, and its gradient.

        Bounds of numbers with an open angle are not among them; `values` moves a vector into these.
        """
        return [
            {"type": "ineq", "fun": partial(_share_left, maximum, norm), "jac": partial(_slope_left, maximum, norm)}
            for maximum, norm in self.affine.limits
        ]

    def values(self, x: ArrayLike) -> dict[str, float]:
        """Return the values of the open numbers by the names that results use [SI, rad], moved into their sets."""
        return named_values(self.affine.domains, np.array(x, dtype=float))


def _share_left(maximum: float, norm: AffineNorm, x: ArrayLike) -> float:
    return float(maximum - norm.value(np.asarray(x, dtype=float))) / (abs(maximum) or 1.0)


def _slope_left(maximum: float, norm: AffineNorm, x: ArrayLike) -> Array:
    vector = np.asarray(x, dtype=float)
    return -norm.pullback(norm.subgradient(vector)) / (abs(maximum) or 1.0)


def objective_function(problem: Problem) -> ObjectiveFunction:
    """Return the objective of a problem as a function of its unbalances (`Problem.objective_function`)."""
    model = AffineModel(affine_problem_of(problem))
    affine = model.at(model.full_samples, finer=True)
    bounds = list(zip(*(side.tolist() for side in column_bounds(affine.domains)), strict=True))
    return ObjectiveFunction(affine, column_names(affine.domains), affine.start, bounds)
