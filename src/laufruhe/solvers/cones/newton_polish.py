"""Newton steps from the optimum at few samples per cycle to the optimum at many (P10).

The dual rows of an optimum at few samples are guesses between them. If the objective is smooth, a few Newton steps from
there reach the optimum at many more samples. There, the subgradient of the design gives the dual rows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from laufruhe.load_models.affine import FEASIBLE, AffineModel, AffineProblem
from laufruhe.numerics.arrays import Array
from laufruhe.prove.certificate import Bound, flatten_interior, gap_of, lower_bound
from laufruhe.solvers.cones.newton import FEW_ROWS, NewtonProgram
from laufruhe.solvers.cones.tie_break import drop_negligible

NEWTON, CONES = "Newton's method", "second-order cones"
"""Names of methods that propose unbalances."""
TARGET_GAP = 1e-6
"""Gap below which an optimum is not refined."""
REFINEMENT = 8
"""Factor of samples over the grid of the bound."""
MAX_NUMBERS = 8_000_000
"""Largest size of the slopes of all terms for which Newton steps are tried."""


@dataclass(frozen=True, eq=False)
class Optimum:
    """A design with its lower bound and its violation of limits.

    Attributes
    ----------
    x
        Decision vector, shape (n,).
    bound
        Lower bound of all designs, with its multipliers.
    problem
        Affine problem, sampled on the grid of the bound.
    gap
        Gap between objective and bound, relative to the objective.
    violation
        Largest relative excess over a limit, between the samples too.
    samples
        Samples per period of the cone program.
    zero_level
        Objective that counts as zero [SI].
    proposer
        Name of the method that proposed the design.
    is_refined
        True if Newton's method follows with more samples.
    """

    x: Array
    bound: Bound
    problem: AffineProblem
    gap: float
    violation: float
    samples: int
    zero_level: float
    proposer: str
    is_refined: bool = False

    @property
    def method(self) -> str:
        """Method in words for the certificate."""
        refinement = f" and {NEWTON}" if self.is_refined and self.proposer != NEWTON else ""
        return f"{self.proposer} at {self.samples} angles{refinement}"


def polish(model: AffineModel, coarse: Optimum, samples: int) -> Optimum:
    """Return the optimum on a grid of `samples` samples per period; the coarse one if Newton steps fail."""
    times = samples // coarse.problem.samples
    numbers = times * sum(norm.slope.size for _, norm in coarse.problem.terms)
    has_many_rows = any(len(norm.grid.weights) > FEW_ROWS for _, norm in coarse.problem.limits)
    if coarse.gap <= TARGET_GAP or numbers > MAX_NUMBERS or has_many_rows or not NewtonProgram.of(coarse.problem):
        return coarse
    fine = model.at(samples)
    program = NewtonProgram.of(fine)
    step = None if program is None else program.steps(coarse.x)
    if step is None:
        return coarse
    x, multipliers = drop_negligible(fine, step[0]), step[1]
    averaged = model.at(samples, averaged=True)
    bound = lower_bound(averaged, multipliers)
    value = fine.objective(x)
    if gap_of(value, bound.value, coarse.zero_level) > TARGET_GAP:
        bound = max(bound, lower_bound(averaged, flatten_interior(averaged, x, bound)), key=lambda proven: proven.value)
    gap, violation = gap_of(value, bound.value, coarse.zero_level), fine.violation(x)
    if gap >= coarse.gap or violation > max(coarse.violation, FEASIBLE):
        return coarse
    return replace(coarse, x=x, bound=bound, problem=fine, gap=gap, violation=violation, is_refined=True)
