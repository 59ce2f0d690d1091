"""Loads of throws between bounds as linear functions over a box (E72).

Order h of a throw at the angle theta has the load c e^{i h theta}. Over theta = m + t d with t from -1 to 1 and a = h d
at most pi this is

    c e^{i h m} ((1 + cos a) / 2 + i t sin a)

up to a remainder of |c| ((1 - cos a)^2 / 4 + (a^3 / (9 root 3))^2)^(1/2): cos(a t) lies between cos a and 1, and
sin(a t) differs from its chord by at most a^3 (t - t^3) / 6. If the remainder is over |c|, it replaces the order.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from laufruhe.load_models.throw_waves import MovingPart, ThrowWaves
from laufruhe.load_models.uneven_model import rotor_throws_of
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.problem.evaluation import with_default_sampling
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Phasing, Problem

_NONE = Spectrum(Fraction(1), np.zeros((1, 6), dtype=complex))


@dataclass(frozen=True, eq=False)
class OpenThrows:
    """Throws of a crank without gas loads, some with open angles, and without open unbalances on them.

    The initial angles and their bounds [rad] have the shape (throws,).
    """

    waves: ThrowWaves
    angles: Array
    lower: Array
    upper: Array

    @property
    def open(self) -> list[int]:
        """Indices of the open throws."""
        return [int(k) for k in np.flatnonzero(self.lower < self.upper)]

    @property
    def sides(self) -> tuple[Array, Array]:
        """Bounds of the open throws [rad]."""
        return self.lower[self.open], self.upper[self.open]

    def wrenches(self, point: int) -> list[Spectrum]:
        """Return the wrench on the block from each open throw at an angle of zero, at an operating point."""

        def turned(part: MovingPart) -> Spectrum:
            wrench = part.evaluations[0].loads[point].wrench.series
            return wrench.with_coefficients(wrench.coefficients * np.exp(1j * wrench.orders * part.ahead)[:, None])

        parts = self.waves.parts
        return [sum((turned(part) for part in parts if part.pin == pin), start=_NONE) for pin in self.open]


def throws_at(problem: Problem, phasing: Phasing, candidate: Candidate) -> OpenThrows | None:
    """Return the open throws of a crank for bounds over boxes; None if boxes cannot represent them.

    The crank is turned as a whole, so that its throws are closest to their bounds.
    Gas loads are nonlinear in the throws, and open bank angles, pins or shafts are not throws.
    """
    is_unsupported = (
        problem.depends_on_gas
        or problem.fidelity.has_uneven_speed
        or any(phasing.is_geometry_open)
        or phasing.shafts.optional
    )
    if phasing.throw_bounds is None or is_unsupported:
        return None
    star_problem = with_default_sampling(replace(phasing.problem_of(candidate), phasing=None))
    weights_on_throws = rotor_throws_of(phasing, candidate)
    if any(drive.rotor in weights_on_throws for decision in star_problem.decisions for drive in decision.rotor_drives):
        return None
    lower, upper = np.transpose(phasing.throw_bounds)
    angles = np.array(candidate.throws)
    angles = np.clip(angles + math.tau * np.round((0.5 * (lower + upper) - angles) / math.tau), lower, upper)
    return OpenThrows(ThrowWaves(star_problem, phasing.layout_of(candidate), weights_on_throws), angles, lower, upper)


def along_arcs(halves: Array) -> tuple[Array, Array, Array]:
    """Return the linear approximation of e^{i a t} over t from -1 to 1, with its error, for half angles a (E72).

    The arrays have the shape of `halves`: the real middle value, the slope along i, and a bound of the error.
    """
    remainder = np.hypot(0.5 * (1.0 - np.cos(halves)), halves**3 / (9.0 * math.sqrt(3.0)))
    is_expanded = (halves <= math.pi) & (remainder < 1.0)
    middle, slope = np.where(is_expanded, 0.5 * (1.0 + np.cos(halves)), 0.0), np.where(is_expanded, np.sin(halves), 0.0)
    return middle, slope, np.where(is_expanded, remainder, 1.0)
