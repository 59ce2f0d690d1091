"""Lower bounds of boxes of sizes by multipliers of the whole problem, if unbalances are open too (Z14).

Rows are affine in masses and unbalances. With the masses as further decisions within their bounds, and factors at their
minimum, a box has a cone program whose optimum is a lower bound. Its multipliers bound the box, and with the factors
and masses of any other box they bound that one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from laufruhe.extensions.sizes.bundles import GroupedRows, SizeNumber, SizeReach, corner, minimum_of
from laufruhe.extensions.sizes.model import MASSES, SizeModel
from laufruhe.load_models.affine import AffineNorm, AffineProblem
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import Grid
from laufruhe.problem.decision import Decision, domains_of
from laufruhe.problem.sets import Interval
from laufruhe.prove.certificate import ROUNDING, Multipliers, best_bound, interpolate_duals, minorant

ProposeMultipliers: TypeAlias = Callable[[AffineProblem, bool], tuple[Array | None, Multipliers]]
"""Function (program, exactly) that proposes an optimum, or None if infeasible, and multipliers; neither is trusted."""


@dataclass(frozen=True, eq=False)
class CombinedMultipliers:
    """Products <Z, V> of multipliers and rows of all terms and limits, less limits times their prices (P4).

    Attributes
    ----------
    parts
        Measures with the groups of their pieces.
    constant
        Sum of prices times limits.
    size
        Sum of the absolute terms, which scales rounding errors.
    excludes
        True without terms: a positive value then proves that no design is feasible.
    """

    parts: tuple[tuple[SizeNumber, tuple[GroupedRows, ...]], ...]
    constant: float
    size: float
    excludes: bool


class SizePrograms:
    """Cone programs of boxes, with weights of measures (`terms`) and upper limits of measures (`limits`)."""

    def __init__(
        self, model: SizeModel, terms: Sequence[tuple[float, SizeNumber]], limits: Sequence[tuple[float, SizeNumber]],
        ask: ProposeMultipliers,
    ) -> None:  # fmt: skip
        self._model, self._terms, self._limits, self._propose = model, tuple(terms), tuple(limits), ask

    def multipliers_of(
        self, lower: Array, upper: Array, reach: SizeReach, exactly: bool = False
    ) -> CombinedMultipliers | None:
        """Return multipliers that bound the objective over a box of sizes, from its cone program.

        The result is None if they do not.
        """
        program = self.program(lower, upper, reach)
        x, multipliers = self._propose(program, exactly)
        if x is None and not exactly:
            # coarse samples of a mean may be infeasible although the mean itself is not
            x, multipliers = self._propose(program, True)
        if x is not None:
            return self._combined(program, best_bound(program, x, multipliers).multipliers) if program.terms else None
        stripped = replace(program, terms=())
        return self._combined(stripped, minorant(stripped, interpolate_duals(stripped, multipliers)).multipliers)

    def program(self, lower: Array, upper: Array, reach: SizeReach) -> AffineProblem:
        """Return the cone program of a box of sizes: masses and unbalances are open, factors minimal."""
        half = 0.5 * (reach.high - reach.low)
        open_masses = [int(k) for k in np.flatnonzero(half > 0.0)]
        masses = [Decision(f"mass {k}", "kg", Interval(-half[k], half[k]), 0.0, ()) for k in open_masses]
        columns = [*open_masses, *range(MASSES, MASSES + len(self._model.start))]

        def norm(number: SizeNumber) -> AffineNorm:
            engine, rows = self._model.engine_at(corner(number.monotonicity, lower, upper), number.monotonicity), []
            for bundle in number.pieces:
                factors = self._model.factors(bundle.piece.positions, number.measure, engine)
                lengths = bundle.lengths.scaled(factors) if factors else bundle.lengths
                rows.append(lengths.at_length(reach.middle[1]))
            constant, slope = (np.concatenate([getattr(row, part) for row in rows]) for part in ("constant", "slope"))
            grid = rows[0].grid if len(rows) == 1 else Grid(np.full(len(constant), 1.0 / len(constant)), len(constant))
            constant = constant + slope[..., :MASSES] @ reach.middle[0]
            return AffineNorm(rows[0].norm, constant, slope[..., columns], grid)

        terms = tuple((weight, norm(number)) for weight, number in self._terms)
        limits = tuple((maximum, norm(number)) for maximum, number in self._limits)
        decisions = (*masses, *(domain.decision for domain in self._model.domains))
        return AffineProblem(terms, limits, domains_of(decisions), self._model.problem.fidelity.samples)

    def _combined(self, program: AffineProblem, rows: Multipliers) -> CombinedMultipliers:
        """Return the combined multipliers of a box's program, at the initial factors."""
        weighted = [(number, weight * z) for (weight, number), z in zip(self._terms, rows.terms, strict=False)]
        prices, constant, size = replace(rows, terms=()).shadow_prices(program), 0.0, 0.0
        limits = zip(self._limits, program.limits, rows.limits, prices, strict=True)
        for (maximum, number), (_, norm), z, price in limits:
            if price > 0.0:
                weighted.append((number, z))
                constant += price * maximum
                size += price * (maximum + norm.value(np.zeros(program.size)))
        parts = []
        for number, z in weighted:
            cuts = np.cumsum([bundle.lengths.constant.shape[1] for bundle in number.pieces])[:-1]
            bundles = zip(number.pieces, np.split(z, cuts), strict=True)
            parts.append((number, tuple(GroupedRows.from_rows(bundle.lengths, rows) for bundle, rows in bundles)))
        return CombinedMultipliers(tuple(parts), constant, size, not rows.terms)

    def minimum(self, multipliers: CombinedMultipliers, lower: Array, upper: Array, reach: SizeReach) -> float:
        """Return the lower bound of the objective over a box of sizes by multipliers.

        It is infinite if the box is infeasible.
        """
        if not multipliers.parts:
            return 0.0
        total, remainder, terms = np.zeros((1, 1)), np.zeros(1), np.ones((1, 1))
        for number, groups in multipliers.parts:
            engine = self._model.engine_at(corner(number.monotonicity, lower, upper), number.monotonicity)
            for group in groups:
                factors = self._model.factors(group.lengths.piece.positions, number.measure, engine)
                function, maximum = group.with_factors(factors)
                total = total + function
                remainder = remainder + group.price * maximum * group.lengths.remainder
                terms = group.lengths.terms(*reach.rod)
        total[:, 0] -= multipliers.constant
        value = float(minimum_of(total[None], terms, remainder, reach)[0])
        if multipliers.excludes:
            return math.inf if value > ROUNDING * multipliers.size else 0.0
        return value
