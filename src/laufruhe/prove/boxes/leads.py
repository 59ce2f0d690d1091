"""Lower bounds of designs whose phase leads lie in a box (P13, P14).

Dual rows Z of the loads V(c, x) at the middle c of a box with half widths r_s, and multipliers of the limits, give one
function of leads and unbalances that is nowhere over the objective of a feasible design. In the box it differs from
its value at c by a part linear in the leads, least at a corner, and by a remainder of second order:

    N(V(c + d, x)) >= <Z, V(c, x)> + sum_s d_s <Z, V_s'(c, x)> - sum_s r_s^2 K_s / 2,                (P13)

K_s bounds the norm of the second derivative of the load of shaft s for every lead. Unbalances on a shaft of ratio n
turn by n d_s. Their share of V lies on an arc, between its ends and the tangents there, and d_s is sin(n d_s) / n up to
|n^2 r_s^3| / 6. The minimum over unbalances is concave in this share, so least at one of these corners. For peaks the
remainder counts the rows of Z alone: a kink of slope J at a distance a < r_s from an angle adds J (r_s - a).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.load_models.affine import AffineProblem
from laufruhe.load_models.phase_lead_model import PhaseLeadModel, PhaseLeadNorm
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import lengths
from laufruhe.numerics.norms.norm import curvature, mean_square
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.problem.decision import Domain
from laufruhe.problem.measure import Measure
from laufruhe.prove.boxes.lead_swing import LeadSwing
from laufruhe.prove.certificate import ROUNDING, Multipliers, minorant

WIDE = 1.2
"""Half an arc [rad] beyond which unbalances on it have no bound."""
SLACK = 1e-6
"""Relative violation of a limit that counts as none."""


@dataclass(frozen=True, eq=False)
class LeadBound:
    """Bound of a box.

    Attributes
    ----------
    value
        Lower bound of the objective in the box; infinite if no design is feasible.
    at_middle
        Lower bound at the middle of the box.
    pull
        Loss of the bound by each side, shape (leads,).
    broken
        Names of limits on the degree of irregularity that all designs of the box violate.
    """

    value: float
    at_middle: float
    pull: Array
    broken: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class _Rest:
    """Bounds of the second derivative of a measure by the lead of a shaft.

    Attributes
    ----------
    whole
        Upper bound of its norm.
    maximum
        Upper bound of its length between kinks, by signal, shape (signals,).
    bends
        Angles of kinks at the start leads, and jumps of slope and value there, by signal.
    """

    whole: float
    maximum: Array
    bends: tuple[tuple[Array, Array, Array], ...]


class LeadBoxes:
    """Bounds of boxes of leads.

    Parameters
    ----------
    model
        Model of a problem with open leads, and perhaps open unbalances.
    """

    def __init__(self, model: PhaseLeadModel) -> None:
        self.model = model
        problem = model.problem
        shafts = {shaft.name: shaft for shaft in problem.engine.shafts}
        self._ratios = np.array([abs(shafts[name].ratio) for name in model.names])
        self._terms = [term.measure for term in problem.load_terms]
        self._limits = [limit.measure for limit in problem.load_limits]
        self._rests = {m: [self._rest(m, s) for s in range(len(model.names))]
                       for m in dict.fromkeys([*self._terms, *self._limits]) if m.is_load}  # fmt: skip
        torque_measures = dict.fromkeys(measure for measure in problem.measures if measure.channel.depends_on_torque)
        self._swings = {measure: LeadSwing(problem, model, measure) for measure in torque_measures}

    def numbers(self, leads: Array) -> list[float]:
        """Return every degree of irregularity of the problem at some leads."""
        return [swing.minimum_over(leads, np.zeros_like(leads)) for swing in self._swings.values()]

    def degrees(self, middle: Array, half: Array) -> tuple[float, dict[str, float]]:
        """Return a lower bound of the degrees of irregularity in the objective, and of violations of their limits."""
        problem = self.model.problem
        degrees = {measure: swing.minimum_over(middle, half) for measure, swing in self._swings.items()}
        total = sum(term.weight * degrees[term.measure] for term in problem.objective if term.measure in degrees)
        over = {x.name: degrees[x.measure] / x.maximum - 1.0 for x in problem.limits if x.measure in degrees}
        return total, {name: by for name, by in over.items() if by > SLACK}

    def bound(
        self, middle: Array, half: Array, program: AffineProblem, norms: Sequence[PhaseLeadNorm],
        multipliers: Multipliers,
    ) -> LeadBound:  # fmt: skip
        """Return the bound of a box by multipliers of the program at its middle, on any grid.

        Multipliers of a program without terms prove that no design in the box is feasible, or prove nothing.

        Parameters
        ----------
        middle, half
            Middle and half widths of the box [rad], shape (leads,).
        norms
            Norms of the program with their slopes by the leads, terms before limits.
        """
        (degree, broken), (degree_here, broken_here) = self.degrees(middle, half), self.degrees(middle, 0.0 * half)
        under = minorant(program, multipliers)
        rows = [*(w * z for (w, _), z in zip(program.terms, under.multipliers.terms, strict=True)),
                *under.multipliers.limits]  # fmt: skip
        slopes, rests = np.zeros(len(middle)), np.zeros(len(middle))
        # by shaft, pairing of the dual rows with slopes and curvatures of the unbalances
        tilts = np.zeros((2, len(middle), len(under.gradient)))
        measures = [*(self._terms if program.terms else ()), *self._limits]
        for measure, led, z in zip(measures, norms, rows, strict=True):
            for s, (constant, steep, flat) in enumerate(led.derivatives):
                slopes[s] += float(np.vdot(z, constant))
                tilts[:, s] += [z.ravel() @ each.reshape(z.size, -1) for each in (flat, steep)]
                if measure.is_load:
                    rests[s] += self._remainder(measure, s, led, z, middle, float(half[s]))
        arcs = minimum_on_arcs(self.model.domains, self._ratios, half, under.gradient, slopes, tilts)
        value = under.constant + arcs - float(rests.sum())
        at_middle = under.constant + sum(domain.minimum(under.gradient) for domain in self.model.domains)
        excluded = False
        if not program.terms:
            prices = replace(under.multipliers, terms=()).shadow_prices(program)
            sizes = [maximum + norm.value(np.zeros(program.size)) for maximum, norm in program.limits]
            excluded = value > ROUNDING * sum(price * size for price, size in zip(prices, sizes, strict=True))
        return LeadBound(
            math.inf if excluded or broken else degree + max(value, 0.0),
            math.inf if broken_here else degree_here + max(at_middle, 0.0),
            rests + half * np.abs(slopes),
            tuple(broken),
        )

    def _remainder(self, measure: Measure, s: int, led: PhaseLeadNorm, z: Array, middle: Array, half: float) -> float:
        """Return an upper bound of the second order of a lead in <Z, V>."""
        rest, norm = self._rests[measure][s], led.norm
        if measure.norm.refinement == 1:
            return 0.5 * half**2 * rest.whole * norm.dual_norm(z)
        size = lengths(z).reshape(len(rest.maximum), -1)
        total = 0.5 * half**2 * float(size.sum(axis=1) @ rest.maximum)
        by = float(middle[s] - self.model.start[s])
        for k, (angles, slopes, jumps) in enumerate(rest.bends):
            used = np.flatnonzero(size[k])
            if len(used) and len(angles) and led.angles is not None:
                rows = led.angles[0 if len(led.angles) == 1 else self._point_of_signal(measure, k)]
                period = float(self.model.shares(measure)[0].bare[0].period)
                distance = np.abs(np.mod(rows[used, None] + by - angles + 0.5 * period, period) - 0.5 * period)
                kinks = np.maximum(half - distance, 0.0) @ slopes + (distance <= half) @ jumps
                total += float(size[k][used] @ kinks)
        return total

    def _point_of_signal(self, measure: Measure, signal: int) -> int:
        counted = np.flatnonzero(measure.shares(self.model.problem.points) > 0.0)
        return int(counted[signal * len(counted) // len(self._rests[measure][0].maximum)])

    def _rest(self, measure: Measure, s: int) -> _Rest:
        shares = measure.shares(self.model.problem.points)
        square, maximum, bends = 0.0, [], []
        for weight, own in zip(shares[shares > 0.0], self.model.counted(measure, s), strict=True):
            square += weight * float(np.mean(mean_square(own.series.derivative.derivative)))
            maximum.append(curvature(own)[0])
            bends += _bends(own)
        return _Rest(math.sqrt(square), np.concatenate(maximum), tuple(bends))


def minimum_on_arcs(
    domains: Sequence[Domain], ratios: Array, half: Array, gradient: Array, slopes: Array, tilts: Array
) -> float:
    """Return a lower bound of a function of leads and unbalances in a box of leads (P13).

    It is d . slopes + x . (gradient + sum_s ((cos(n_s d_s) - 1) tilts[0, s] + sin(n_s d_s) / n_s tilts[1, s]))
    with leads |d_s| <= half_s [rad] and unbalances x of the domains; n_s are the ratios of the shafts.

    Parameters
    ----------
    ratios, half, slopes
        Shape (shafts,).
    gradient, tilts
        Shapes (columns,) and (2, shafts, columns).
    """
    if not domains:
        return -float(np.abs(slopes) @ half)
    arcs = ratios * half
    if arcs.max() > WIDE:
        return -math.inf
    sides = [((math.cos(a), math.sin(a)), (math.cos(a), -math.sin(a)), (1.0 / math.cos(a), 0.0)) for a in arcs]
    minimum = math.inf
    for corner in itertools.product(*sides):
        along, across = np.array(corner).T
        by = across / ratios
        turned = gradient + (along - 1.0) @ tilts[0] + by @ tilts[1]
        minimum = min(minimum, float(by @ slopes) + sum(domain.minimum(turned) for domain in domains))
    # d differs from sin(n d) / n by the cube
    return minimum - float((np.abs(slopes) * ratios**2 * half**3).sum()) / 6.0


def _bends(signal: Spectrum) -> list[tuple[Array, Array, Array]]:
    # per place: angles of kinks, jumps of slope, jumps of value
    places = signal.coefficients.shape[1]
    if signal.kinks is None:
        return [(np.zeros(0), np.zeros(0), np.zeros(0))] * places
    jumps = signal.kinks.jumps
    return [(signal.kinks.angles, lengths(jumps[:, 1, k]), lengths(jumps[:, 0, k])) for k in range(places)]
