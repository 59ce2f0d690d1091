"""Measures from Python functions of a user: linear functions of a load, and norms without claims.

A linear function of a load is read as a matrix, so its loads are affine in the unbalances as those of the load are.
A function that replaces a norm has no bound; that it is convex is only declared, and tested at midpoints.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from laufruhe.errors import ModelError, printed, wrong_call
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import NORMS, Grid, Norm
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.problem.channels import CHANNELS, Display, LoadChannel
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.loads import PointLoads
from laufruhe.problem.measure import Limit, Measure, Term
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value

Curvature = Literal["convex", "affine", "unknown"]
DESIGNS, PAIRS, TOLERANCE = 8, 64, 1e-9
"""Random designs and pairs of loads at which a function is tested, and relative error that counts as rounding."""


class OwnNorm(Norm):
    """Function of samples, shape (angles, places, directions), averaged over operating points by their weights."""

    def __init__(self, name: str, function: Callable[[Array], float], curvature: Curvature) -> None:
        self.name = name  # type: ignore[misc]
        self.function, self.curvature = function, curvature

    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
        return OwnNorm, (self.name, self.function, self.curvature)

    @property
    def claim(self) -> str:
        """Curvature that the user declares, in words for the certificate; empty without one."""
        if self.curvature == "unknown":
            return ""
        return (
            f"'{self.name}' is {self.curvature} as declared, not proven ({PAIRS} midpoints keep to it); "
            f"if so, a local optimum over unbalances is global"
        )

    def value(self, grid: Grid, rows: Array) -> float:
        """Return the mean of the function over operating points, weighted as these are."""
        points = rows.reshape(grid.points, -1, grid.steps, rows.shape[-1]).swapaxes(1, 2)
        shares = grid.weights.reshape(grid.points, -1).sum(axis=1)
        return float(sum(share * self._of(samples) for share, samples in zip(shares, points, strict=True)))

    def _of(self, samples: Array) -> float:
        answer = np.asarray(self.function(samples))
        if answer.ndim or answer.dtype.kind not in "bif" or not 0.0 <= answer < math.inf:
            text = printed(repr(answer.tolist()), 60)
            raise ModelError(f"function '{self.name}' returned {text}; return one finite number, zero or more")
        return float(answer)

    def upper_bound(self, signals: Sequence[Spectrum], shares: Array) -> float:  # noqa: ARG002
        """Return infinity: nothing bounds an unknown function."""
        return math.inf

    def sampling_bound(self, signals: Sequence[Spectrum], shares: Array, steps: int, finest: int) -> float:
        """Return the changes of the function from the samples to finer ones, added up; an estimate."""
        times = max(2, math.ceil(finest / steps))
        values = [
            sum(
                share * self._of(signal.series.sample(n))
                for signal, share in zip(signals, shares, strict=True)
                if share
            )
            for n in (steps, 2 * steps, times * steps)
        ]
        return float(abs(values[0] - values[1]) + abs(values[1] - values[2]))


def own_measure(
    name: str,
    norm: str | Callable[[Array], float] = "mean",
    load: str | Callable[[Array], Array] = "mount force",
    of: str = "mount force",
    unit: str = "",
    curvature: Curvature = "unknown",
) -> Measure:
    """Return a measure whose load or norm is a Python function, for `Problem.with_objective` and `Problem.with_limit`.

    Parameters
    ----------
    name
        Name of the function in reports.
    norm
        Name of a norm, such as "rms"; or a function of samples, shape (angles, places, directions), over the period of
        the loads at one operating point, that returns one number, zero or more. The measure is the mean of these over
        the operating points. No bound of a function is known.
    load
        Name of a load, such as "mount force"; or a function that maps the load `of`, shape (angles, places,
        directions), linearly at each angle. It is read as a matrix, with which the proof is made.
    of
        Load that the function `load` maps.
    unit
        SI unit of the function `load`; by default that of the load.
    curvature
        "convex" or "affine" if the function `norm` is declared to be so in the load. The declaration is tested at
        random loads, and the certificate calls it declared.

    Raises
    ------
    InputError
        If a name is unknown.
    """
    listed: object = name
    if not isinstance(listed, str) or not name.strip() or CHANNELS.get(name) or NORMS.get(name):
        raise wrong_call("name", name, "is no new name", "give one that no quantity and no norm has")
    if curvature not in ("convex", "affine", "unknown"):
        raise wrong_call("curvature", curvature, "is unknown", "write convex, affine or unknown")
    source = _channel("of" if callable(load) else "load", of if callable(load) else load)
    channel = _linear_channel(name, load, source, unit) if callable(load) else source
    if callable(norm):
        return Measure(channel, OwnNorm(name, norm, curvature))
    known = NORMS.get(norm)
    if known is None:
        raise wrong_call("norm", norm, "is no norm", f"give a function, or one of {', '.join(NORMS)}")
    return Measure(channel, known)


def _channel(where: str, name: object) -> LoadChannel:
    channel = CHANNELS.get(name) if isinstance(name, str) else None
    if channel is None or not channel.is_load:
        loads = ", ".join(key for key, entry in CHANNELS.items() if entry.is_load)
        raise wrong_call(where, name, "is no load", f"give a function, or one of {loads}")
    return Measure(channel).load


def _linear_channel(name: str, function: Callable[[Array], Array], of: LoadChannel, unit: str) -> LoadChannel:
    def signal(loads: PointLoads) -> Spectrum:
        spectrum = of.signal(loads)
        matrix = _matrix(name, function, spectrum.coefficients.shape[1:])
        return spectrum.mapped(lambda values: np.tensordot(values, matrix, axes=2))

    return replace(
        of, name=name, unit=unit or of.unit, signal=signal, linear_in=of, part=None, places=lambda _: (),
        display=Display(),
    )  # fmt: skip


def _matrix(name: str, function: Callable[[Array], Array], shape: tuple[int, ...]) -> Array:
    """Return the matrix of a linear function of loads, shape (places, directions, new places, new directions).

    Raises
    ------
    ModelError
        If the function differs from its matrix at random loads.
    """
    size = math.prod(shape)
    units = np.eye(size).reshape(size, *shape)
    try:
        image = np.asarray(function(units), dtype=float)
        matrix = image.reshape(*shape, *image.shape[1:])
        probes = np.random.default_rng(size).normal(size=(12, *shape)) * np.logspace(-3.0, 6.0, 12)[:, None, None]
        deviation = np.abs(np.asarray(function(probes), dtype=float) - np.tensordot(probes, matrix, axes=2))
        scale = np.tensordot(np.abs(probes), np.abs(matrix), axes=2)
    except (TypeError, ValueError, IndexError) as error:
        rule = f"maps an array (angles, places, directions) to none of this form ({error})"
        raise ModelError(f"function '{name}' {rule}; keep all three axes") from None
    if matrix.ndim != 2 * len(shape) or np.any(deviation > TOLERANCE * scale):
        raise ModelError(
            f"function '{name}' is not linear in the load at each angle; give a norm as a function instead"
        )
    return matrix


def with_objective(problem: Problem, measure: Measure, weight: float = 1.0) -> Problem:
    """Return the problem that minimises a measure in place of its objective."""
    return _checked(problem.changed(objective=(Term(measure, weight),), ranks=()), measure)


def with_limit(problem: Problem, measure: Measure, maximum: float, name: str = "") -> Problem:
    """Return the problem with one more limit on a measure [SI]."""
    limit = Limit(name or measure.name, measure, maximum)
    return _checked(problem.changed(limits=(*problem.limits, limit)), measure)


def _checked(problem: Problem, measure: Measure) -> Problem:
    """Return the problem, after a test of its own function at random loads.

    Raises
    ------
    InputError
        If the function breaks the curvature that is declared.
    """
    if not isinstance(measure.norm, OwnNorm):
        evaluate(problem).value(measure)
        return problem
    random, norm = np.random.default_rng(0), measure.norm
    rows = [evaluate(problem.fixed_at(_random_values(problem, random))).rows(measure) for _ in range(DESIGNS)]
    for part in rows:
        norm.value(part.grid, part.vectors)
    if norm.curvature == "unknown":
        return problem
    size = max(float(np.abs(part.vectors).max()) for part in rows)
    for _ in range(PAIRS):
        a, b = (rows[k].vectors + size * random.choice([0.0, 1e-2, 1.0]) * random.normal(size=rows[k].vectors.shape)
                for k in random.integers(DESIGNS, size=2))  # fmt: skip
        low, high, middle = (norm.value(rows[0].grid, vectors) for vectors in (a, b, 0.5 * (a + b)))
        excess, error = middle - 0.5 * (low + high), TOLERANCE * max(low, high, middle)
        if excess > error or (norm.curvature == "affine" and excess < -error):
            rule = f"function '{norm.name}' is {middle:.6g} midway between loads where it is {low:.6g} and {high:.6g}"
            raise wrong_call("curvature", norm.curvature, rule, 'write "unknown", or correct the function')
    return problem


def _random_values(problem: Problem, random: np.random.Generator) -> list[Value]:
    values: list[Value] = []
    for decision in problem.decisions:
        size = random.uniform(decision.lower, decision.upper)
        angle = random.uniform(*decision.set.angles)
        values.append(size * complex(math.cos(angle), math.sin(angle)) if decision.is_affine else size)
    return values
