"""Rows of run-up and shut-down, affine in what loads are affine in (E28a)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from laufruhe.machine import Engine
from laufruhe.numerics.arrays import Array
from laufruhe.physics.linear_run import Response
from laufruhe.physics.runs import STRETCHES, point_of, responses_of
from laufruhe.problem.decision import domains_of
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import KnownRows, Problem
from laufruhe.problem.sets import Value

NEAR = 0.98
"""Share of a limit from which a row counts."""


@dataclass(frozen=True, eq=False)
class RunRows:
    """Every step of run-up and shut-down.

    Attributes
    ----------
    constants, slopes
        Of every measure, at every step and place, shapes (steps, places, d) and (steps, places, d, n).
    """

    constants: dict[Measure, Array]
    slopes: dict[Measure, Array]

    @classmethod
    def of(cls, problem: Problem, measures: Sequence[Measure]) -> RunRows | None:
        """Of some measures; None where run-ups are not linear in the loads."""
        bare = _responses(problem, problem.design([0.0] * len(problem.decisions)))
        if bare is None:
            return None
        domains = domains_of(problem.decisions)
        units = [(k, direction) for k, domain in enumerate(domains) for direction in domain.set.directions]
        constants = {measure: _rows(measure, bare) for measure in measures}
        slopes: dict[Measure, list[Array]] = {measure: [] for measure in measures}
        for k, direction in units:
            values: list[Value] = [direction if j == k else 0.0 for j in range(len(problem.decisions))]
            moved = _responses(problem, problem.design(values))
            if moved is None:
                return None
            for measure, rows in slopes.items():
                rows.append(_rows(measure, moved) - constants[measure])
        return cls(constants, {measure: np.stack(rows, axis=-1) for measure, rows in slopes.items()})

    def worst(self, measure: Measure, x: Array) -> float:
        """The largest length at x."""
        return float(self._lengths(measure, x).max())

    def near(self, measure: Measure, x: Array, height: float) -> NDArray[np.intp]:
        """Of every stretch and place the longest row, of those that come near a height at x, as flat places of rows."""
        sizes = self._lengths(measure, x)
        count = -(-len(sizes) // (2 * STRETCHES))
        found = []
        for start in range(0, len(sizes), count):
            part = sizes[start : start + count]
            tops = part.argmax(axis=0)
            kept = part[tops, np.arange(part.shape[1])] >= NEAR * height
            found.append((start + tops[kept]) * sizes.shape[1] + np.flatnonzero(kept))
        return np.concatenate(found)

    def known(self, measure: Measure, places: NDArray[np.intp]) -> KnownRows:
        """Some of the rows."""
        constant, slope = self.constants[measure], self.slopes[measure]
        d, n = slope.shape[2:]
        return KnownRows(constant.reshape(-1, d)[places], slope.reshape(-1, d, n)[places])

    def _lengths(self, measure: Measure, x: Array) -> Array:
        return np.asarray(np.linalg.norm(self.constants[measure] + self.slopes[measure] @ x, axis=-1))


def _responses(problem: Problem, engine: Engine) -> tuple[Response, ...] | None:
    run = engine.run
    if run is None:
        return None
    return responses_of(engine, point_of(run, problem.points), problem.fidelity, run)


def _rows(measure: Measure, responses: Sequence[Response]) -> Array:
    of_run = measure.channel.of_run
    if of_run is None:
        raise TypeError(f"{measure.name} is not of a run-up")
    return np.concatenate([of_run(response) for response in responses])
