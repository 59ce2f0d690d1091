"""One design as it is built: its loads as norms of rows that are affine in the errors (R2, R3)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from laufruhe.extensions.robust.tolerance import Tolerances, built, tolerances_of
from laufruhe.load_models.affine import AffineNorm
from laufruhe.load_models.batch import by_feature
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.batch_norms import BatchNorm
from laufruhe.problem.evaluation import Evaluation, evaluate, over
from laufruhe.problem.measure import Measure, bends_of
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value


class BuiltEngines:
    """Loads of one design as drawn, and what every error of a whole size adds.

    Parameters
    ----------
    problem
        Of built engines, or of one drawing.
    tolerances
        Those of the problem where None; loads have to be affine in all errors.
    values
        Of its decisions.
    samples
        Steps over the cycle.
    """

    def __init__(
        self, problem: Problem, values: Sequence[Value], samples: int, tolerances: Tolerances | None = None
    ) -> None:
        self.problem, self.samples = problem, samples
        own = tolerances_of(problem) if tolerances is None else tolerances
        units = np.concatenate([np.zeros((1, own.count)), np.eye(own.count)])
        self._built = [evaluated(built(problem, unit, own), values, samples) for unit in units]

    def norm(self, measure: Measure) -> AffineNorm:
        """Return the norm of a measure over the errors."""
        drawn, finer = self._built[0], measure.norm.refinement
        bends = None
        if measure.is_load:
            signals = over(drawn.engine.cycle.base_order, drawn.signals(measure.load))
            bends = bends_of(measure, signals, drawn.engine)
        rows = [each.rows(measure, finer * self.samples, bends) for each in self._built]
        bare = rows[0].vectors
        slope = np.stack([each.vectors - bare for each in rows[1:]], axis=-1) if rows[1:] else bare[..., None][..., :0]
        return AffineNorm(rows[0].norm, bare, np.ascontiguousarray(slope), rows[0].grid)

    @property
    def terms(self) -> tuple[tuple[float, AffineNorm], ...]:
        """Weights and norms of the objective."""
        return tuple((term.weight, self.norm(term.measure)) for term in self.problem.objective)


def evaluated(own: Problem, values: Sequence[Value], samples: int) -> Evaluation:
    """Return a design with the errors of a built problem."""
    return evaluate(own, own.design(values), samples)


def values_of(terms: Sequence[tuple[float, AffineNorm]], errors: Array) -> Array:
    """Return the weighted sum of the norms of many engines, errors of shape (engines, columns)."""
    features = np.concatenate([np.ones((len(errors), 1)), errors], axis=1)
    total = np.zeros(len(errors))
    for weight, norm in terms:
        rows = np.ascontiguousarray(by_feature(norm))
        total += weight * BatchNorm(norm.norm, rows, norm.grid).values(features)
    return total
