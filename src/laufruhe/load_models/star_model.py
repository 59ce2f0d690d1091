"""A problem as norms of rows that are affine in its star and its decisions (S11).

Throws add up: the rows of any star are those of one star, plus what it changes when
each throw is moved to its step. Gas stays out of it, because even firing of equal
cylinders gives the same roll moment in whatever order. All numbers come from the exact
model, one throw moved at a time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.load_models.affine import AffineModel, AffineNorm, AffineProblem
from laufruhe.machine.firing import star_throws
from laufruhe.machine.layouts import Layout
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import Grid, Norm
from laufruhe.numerics.spectrum import common_base
from laufruhe.physics.crank_stars import StarSpace
from laufruhe.problem.decision import Decision, Domain
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Phasing, Problem

_SAME_SLOPE = 1e-11
_ROUNDING = 1e-14


@dataclass(frozen=True, eq=False)
class StarNorm:
    """N(V0 + sum_k D[k, p_k] + (B + sum_k E[k, p_k]) x) over the steps p_k of the throws.

    Attributes
    ----------
    constant, moves
        V0 and D, shapes (k, d) and (throws, steps, k, d).
    slope, turns
        B and E, shapes (k, d, n) and (throws, steps, k, d, n); no E where unbalances act
        alike in every star.
    grid
        Weights of the rows.
    """

    norm: Norm
    constant: Array
    moves: Array
    slope: Array
    turns: Array | None
    grid: Grid

    def at(self, star: Sequence[int]) -> AffineNorm:
        """The norm of one star."""
        chosen = np.arange(len(star)), np.asarray(star, dtype=np.intp)
        constant = _cancelled(self.constant, self.moves[chosen])
        slope = self.slope if self.turns is None else _cancelled(self.slope, self.turns[chosen])
        return AffineNorm(self.norm, constant, slope, self.grid)


def _cancelled(first: Array, moves: Array) -> Array:
    whole = first + moves.sum(axis=0)
    reach = np.abs(first).max(initial=0.0) + np.abs(moves).max(initial=0.0, axis=tuple(range(1, moves.ndim))).sum()
    return np.where(np.abs(whole) <= _ROUNDING * reach, 0.0, whole)


@dataclass(frozen=True, eq=False)
class StarProblem:
    """Rows of terms and limits of every star at one number of samples."""

    terms: tuple[tuple[float, StarNorm], ...]
    limits: tuple[tuple[float, StarNorm], ...]
    domains: tuple[Domain, ...]
    samples: int

    @property
    def compressed(self) -> StarProblem:
        """The same with root mean squares in few rows (S12)."""
        terms, limits = (
            tuple((number, compressed(norm) if norm.norm.is_euclidean else norm) for number, norm in each)
            for each in (self.terms, self.limits)
        )
        return replace(self, terms=terms, limits=limits)

    def at(self, star: Sequence[int]) -> AffineProblem:
        """The problem of one star."""
        terms = tuple((weight, norm.at(star)) for weight, norm in self.terms)
        limits = tuple((maximum, norm.at(star)) for maximum, norm in self.limits)
        return AffineProblem(terms, limits, self.domains, self.samples)


class StarModel:
    """Spectra of one star and of every single move of a throw.

    Parameters
    ----------
    phasing
        What is open.
    space
        Stars allowed.
    geometry
        Bank angle and split pin [rad].
    origin
        Star that the moves are counted from; the first of the space when left out.
    """

    def __init__(
        self,
        phasing: Phasing,
        space: StarSpace,
        geometry: tuple[float | None, float | None],
        origin: tuple[int, ...] | None = None,
    ) -> None:
        self.phasing, self.space, self.geometry = phasing, space, geometry
        self.layout: Layout = phasing.layout(*geometry)
        self._origin = space.first if origin is None else origin
        self.problem = normalised(phasing.realise(phasing.star(self._origin, space.phases, geometry)))
        self._whole = AffineModel(self.problem, keep_all=True)
        self._still = self._motored(self._origin)
        self._moved = {
            (k, p): self._motored(tuple(p if j == k else step for j, step in enumerate(self._origin)))
            for k in range(1, space.throws)
            for p in range(space.phases)
            if p != self._origin[k]
        }
        self.base = common_base([model.base for model in self.models])
        for model in self.models:
            model.base, model.lead = self.base, self._whole
        self.domains = self._whole.domains
        self._cache: dict[tuple[int, bool], StarProblem] = {}

    @property
    def models(self) -> list[AffineModel]:
        """Models of the stars from which all other stars are composed."""
        return [self._whole, self._still, *self._moved.values()]

    @property
    def samples(self) -> int:
        """Steps of the problem's fidelity that fall into one period of the loads."""
        return self._whole.full_samples

    def _motored(self, star: Sequence[int]) -> AffineModel:
        throws = star_throws(self.layout, star, self.space.phases)
        candidate = Candidate(throws, None, *self.geometry, without_gas=True)
        return AffineModel(normalised(self.phasing.realise(candidate)), keep_all=True)

    def at(self, samples: int, averaged: bool = False) -> StarProblem:
        """Rows of every star at `samples` steps over the period of the loads; those of means averaged (P7)."""
        means = averaged and any(measure.is_load and measure.norm.averages for measure in self.problem.measures)
        key = samples, means
        if key not in self._cache:
            self._cache[key] = self._rows(samples, means).compressed
        return self._cache[key]

    def _rows(self, samples: int, averaged: bool) -> StarProblem:
        whole, still = self._whole.at(samples, averaged), self._still.at(samples, averaged)
        moved = {key: model.at(samples, averaged) for key, model in self._moved.items()}
        return StarProblem(
            self._norms(whole.terms, still.terms, {key: a.terms for key, a in moved.items()}),
            self._norms(whole.limits, still.limits, {key: a.limits for key, a in moved.items()}),
            self.domains,
            samples,
        )

    def _norms(
        self,
        whole: tuple[tuple[float, AffineNorm], ...],
        still: tuple[tuple[float, AffineNorm], ...],
        moved: dict[tuple[int, int], tuple[tuple[float, AffineNorm], ...]],
    ) -> tuple[tuple[float, StarNorm], ...]:
        out = []
        for number, ((weight, all_of), (_, rest)) in enumerate(zip(whole, still, strict=True)):
            own = {place: norms[number][1] for place, norms in moved.items()}
            moves = self._apart({place: norm.constant for place, norm in own.items()}, rest.constant)
            # most turn alike, which is seen before room is made for all of them
            minimum = _SAME_SLOPE * np.abs(rest.slope).max(initial=0.0)
            alike = all(np.abs(norm.slope - rest.slope).max(initial=0.0) <= minimum for norm in own.values())
            turned = None if alike else self._apart({place: norm.slope for place, norm in own.items()}, rest.slope)
            out.append((weight, StarNorm(all_of.norm, all_of.constant, moves, all_of.slope, turned, all_of.grid)))
        return tuple(out)

    def _apart(self, rows: dict[tuple[int, int], Array], still: Array) -> Array:
        out = np.zeros((self.space.throws, self.space.phases, *still.shape))
        for place, own in rows.items():
            np.subtract(own, still, out=out[place])
        return out


def normalised(problem: Problem) -> Problem:
    """Unbalances that may take any angle, counted from upright and not from a throw.

    A disc looks the same from every angle, so that they act alike in every star.
    """
    return replace(problem, decisions=tuple(_upright(decision) for decision in problem.decisions))


def _upright(decision: Decision) -> Decision:
    if not decision.rotor_drives:
        return decision
    gain = decision.rotor_drives[0].gain
    if not decision.set.free_angle or gain == 0.0:
        return decision
    turn = gain / abs(gain)
    turn = turn.conjugate() if decision.rotor_drives[0].mirrored else turn
    drives = tuple(
        replace(drive, gain=drive.gain * (turn if drive.mirrored else turn.conjugate()))
        for drive in decision.rotor_drives
    )
    return replace(decision, drives=drives, start=decision.start * turn)


def compress_rows(parts: Sequence[Array]) -> list[Array] | None:
    """Sums of these, shape (..., k, d), are as long in as few rows as they are: Q of a QR keeps every length (S12).

    None where they are as many as their numbers.
    """
    k, d = parts[0].shape[-2:]
    flat = [part.reshape(-1, k * d) for part in parts]
    matrix = np.concatenate(flat).T
    if len(matrix) <= matrix.shape[1]:
        return None
    small = np.asarray(np.linalg.qr(matrix, mode="r")).T
    own = np.split(small, np.cumsum([len(part) for part in flat])[:-1])
    return [few.reshape(*part.shape[:-2], small.shape[1], 1) for few, part in zip(own, parts, strict=True)]


def compressed(norm: StarNorm) -> StarNorm:
    """The same root mean square in as few rows as there are columns (S12)."""
    root = np.sqrt(norm.grid.weights)[:, None]
    parts = [norm.constant * root, norm.moves * root, np.moveaxis(norm.slope * root[..., None], -1, 0)]
    if norm.turns is not None:
        parts.append(np.moveaxis(norm.turns * root[..., None], -1, 2))
    few = compress_rows(parts)
    if few is None:
        return norm
    (constant, moves, slope), turns = few[:3], None if norm.turns is None else np.moveaxis(few[3], 2, -1)
    grid = Grid(np.ones(len(constant)), len(constant))
    return StarNorm(norm.norm, constant, moves, np.moveaxis(slope, 0, -1), turns, grid)
