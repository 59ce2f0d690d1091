"""Loads of throws between bounds as numbers of a box (E72).

Order h of a throw loads by c e^{i h theta}. Over theta = m + t d with t from -1 to 1 and a = h d at most pi this is

    c e^{i h m} ((1 + cos a) / 2 + i t sin a)

but for a rest of |c| ((1 - cos a)^2 / 4 + (a^3 / (9 root 3))^2)^(1/2) at most: cos(a t) lies between cos a and 1, and
sin(a t) bends away from its chord by no more than a^3 (t - t^3) / 6. Where that is over |c|, the order is all rest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from laufruhe.load_models.throw_waves import Moving, ThrowWaves
from laufruhe.load_models.uneven_model import rides_of
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.problem.evaluation import with_default_sampling
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Phasing, Problem

_NONE = Spectrum(Fraction(1), np.zeros((1, 6), dtype=complex))


@dataclass(frozen=True, eq=False)
class OpenThrows:
    """Throws of a crank without gas, some of them between bounds, and nothing open that rides on them.

    Attributes
    ----------
    waves
        Of a problem whose throws stand where they are given.
    given, lower, upper
        Every throw, and its bounds [rad].
    """

    waves: ThrowWaves
    given: Array
    lower: Array
    upper: Array

    @property
    def open(self) -> list[int]:
        """Numbers of the throws that are between bounds."""
        return [int(k) for k in np.flatnonzero(self.lower < self.upper)]

    @property
    def sides(self) -> tuple[Array, Array]:
        """Bounds of the open throws [rad]."""
        return self.lower[self.open], self.upper[self.open]

    def wrenches(self, point: int) -> list[Spectrum]:
        """Return what turns with every open throw at an operating point, at an angle of zero."""
        return [
            sum((self._turned(part, point) for part in self.waves.parts if part.pin == pin), start=_NONE)
            for pin in self.open
        ]

    def _turned(self, part: Moving, point: int) -> Spectrum:
        wrench = part.found[0].loads[point].wrench.series
        return wrench.holding(wrench.coefficients * np.exp(1j * wrench.orders * part.ahead)[:, None])


def throws_at(problem: Problem, phasing: Phasing, candidate: Candidate) -> OpenThrows | None:
    """Return the throws of a design, at the turn that is nearest to their bounds; None where they are not all known.

    Gas would fire at another time with every throw, and an open bank angle, pin or shaft is no throw.
    """
    unknown = problem.feels_gas or problem.fidelity.is_uneven or any(phasing.opened) or phasing.shafts.optional
    if phasing.throw_bounds is None or unknown:
        return None
    realised, rides = (
        with_default_sampling(replace(phasing.realise(candidate), phasing=None)),
        rides_of(phasing, candidate),
    )
    if any(drive.rotor in rides for decision in realised.decisions for drive in decision.rotor_drives):
        return None
    lower, upper = np.transpose(phasing.throw_bounds)
    at = np.array(candidate.throws)
    at = np.clip(at + math.tau * np.round((0.5 * (lower + upper) - at) / math.tau), lower, upper)
    return OpenThrows(ThrowWaves(realised, phasing.layout_of(candidate), rides), at, lower, upper)


def along_arcs(halves: Array) -> tuple[Array, Array, Array]:
    """Return the middle, the slope along i and the rest of e^{i a t}, t from -1 to 1, of these a (E72)."""
    rest = np.hypot(0.5 * (1.0 - np.cos(halves)), halves**3 / (9.0 * math.sqrt(3.0)))
    near = (halves <= math.pi) & (rest < 1.0)
    told = np.where(near, 0.5 * (1.0 + np.cos(halves)), 0.0), np.where(near, np.sin(halves), 0.0)
    return *told, np.where(near, rest, 1.0)
