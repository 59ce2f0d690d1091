"""What dual rows of all that is asked together say of boxes of sizes, where unbalances are open beside these (Z14).

Rows are affine in masses and unbalances, so that with the masses as decisions of their own between their ends, and
factors where they are least, a box has a cone program that no design in it goes under. Its dual rows bound the box, and
with the factors and masses of any other box they bound that one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from laufruhe.extensions.sizes.bundles import Grouped, SizeNumber, SizeReach, corner, minimum_of
from laufruhe.extensions.sizes.model import MASSES, SizeModel
from laufruhe.load_models.affine import AffineNorm, AffineProblem
from laufruhe.machine import Engine
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import Grid
from laufruhe.problem.decision import Decision, domains_of
from laufruhe.problem.sets import Interval
from laufruhe.prove.certificate import ROUNDING, Multipliers, best_bound, interpolate_duals, minorant

Ask: TypeAlias = Callable[[AffineProblem, bool], tuple[Array | None, Multipliers]]
"""A decision vector of a program, None where none is allowed, and dual rows, roughly unless told; none is trusted."""


@dataclass(frozen=True, eq=False)
class Together:
    """<Z, V> of all that is asked, less limits times their prices (P4).

    Attributes
    ----------
    constant
        Prices times limits, taken off.
    size
        Size of the terms of that difference, by which a rounding is judged.
    excludes
        Whether no terms are in it: where it is more than nothing no design is allowed.
    """

    parts: tuple[tuple[SizeNumber, tuple[Grouped, ...]], ...]
    constant: float
    size: float
    excludes: bool


class SizePrograms:
    """Programs of boxes.

    Parameters
    ----------
    terms
        Weights, and measures of loads and masses.
    limits
        The most that others may be.
    ask
        Function that proposes dual rows.
    """

    def __init__(
        self,
        model: SizeModel,
        terms: Sequence[tuple[float, SizeNumber]],
        limits: Sequence[tuple[float, SizeNumber]],
        ask: Ask,
    ) -> None:
        self._model, self._terms, self._limits, self._ask = model, tuple(terms), tuple(limits), ask

    def learned(self, lower: Array, upper: Array, reach: SizeReach, exactly: bool = False) -> Together | None:
        """Return the dual rows of a box's program; None where they bound nothing."""
        program = self.program(lower, upper, reach)
        x, multipliers = self._ask(program, exactly)
        if x is None and not exactly:
            # that a few rows of a mean cannot be met says nothing of all of them
            x, multipliers = self._ask(program, True)
        if x is not None:
            return self._together(program, best_bound(program, x, multipliers).multipliers) if program.terms else None
        stripped = replace(program, terms=())
        return self._together(stripped, minorant(stripped, interpolate_duals(stripped, multipliers)).multipliers)

    def program(self, lower: Array, upper: Array, reach: SizeReach) -> AffineProblem:
        """Return the program of a box: its masses as decisions beside the unbalances, factors where they are least."""
        half = 0.5 * (reach.high - reach.low)
        moving = [int(k) for k in np.flatnonzero(half > 0.0)]
        masses = [Decision(f"mass {k}", "kg", Interval(-half[k], half[k]), 0.0, ()) for k in moving]
        columns = [*moving, *range(MASSES, MASSES + len(self._model.start))]

        def norm(number: SizeNumber) -> AffineNorm:
            rows = self._rows(number, self._engine(number, lower, upper), reach)
            constant, slope = (np.concatenate([getattr(row, part) for row in rows]) for part in ("constant", "slope"))
            grid = rows[0].grid if len(rows) == 1 else Grid(np.full(len(constant), 1.0 / len(constant)), len(constant))
            constant = constant + slope[..., :MASSES] @ reach.middle[0]
            return AffineNorm(rows[0].norm, constant, slope[..., columns], grid)

        terms = tuple((weight, norm(number)) for weight, number in self._terms)
        limits = tuple((maximum, norm(number)) for maximum, number in self._limits)
        decisions = (*masses, *(domain.decision for domain in self._model.domains))
        return AffineProblem(terms, limits, domains_of(decisions), self._model.problem.fidelity.samples)

    def _rows(self, number: SizeNumber, engine: Engine, reach: SizeReach) -> list[AffineNorm]:
        rows = []
        for bundle in number.pieces:
            factors = self._model.factors(bundle.piece, number.measure, engine)
            lengths = bundle.lengths.scaled(factors) if factors else bundle.lengths
            rows.append(lengths.at_length(reach.middle[1]))
        return rows

    def _engine(self, number: SizeNumber, lower: Array, upper: Array) -> Engine:
        moves = np.any(number.ways)
        return self._model.engine(corner(number.ways, lower, upper)) if moves else self._model.problem.engine

    def _together(self, program: AffineProblem, rows: Multipliers) -> Together:
        """Return the dual rows of a box's program, at the factors of the start."""
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
            parts.append((number, tuple(Grouped.from_rows(bundle.lengths, rows) for bundle, rows in bundles)))
        return Together(tuple(parts), constant, size, not rows.terms)

    def minimum(self, known: Together, lower: Array, upper: Array, reach: SizeReach) -> float:
        """Return the bound of a box from dual rows; infinite where they exclude it."""
        if not known.parts:
            return 0.0
        total, rest, terms = np.zeros((1, 1)), np.zeros(1), np.ones((1, 1))
        for number, groups in known.parts:
            engine = self._engine(number, lower, upper)
            for group in groups:
                function, maximum = group.weighed(self._model.factors(group.lengths.piece, number.measure, engine))
                total = total + function
                rest = rest + group.price * maximum * group.lengths.rest
                terms = group.lengths.terms(*reach.rod)
        total[:, 0] -= known.constant
        value = float(minimum_of(total[None], terms, rest, reach)[0])
        if known.excludes:
            return math.inf if value > ROUNDING * known.size else 0.0
        return value
