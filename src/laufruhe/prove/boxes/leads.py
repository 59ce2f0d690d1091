"""What no design with its leads in a box goes under (P13, P14).

Dual rows Z of the loads V(c, x) in the middle c of a box with half sides r_s, and multipliers of the limits, make one
function of leads and unbalances that the objective of no design allowed lies under. In the box it differs from its
value at c by what is linear in the leads, so least at a corner, and by a rest of second order:

    N(V(c + d, x)) >= <Z, V(c, x)> + sum_s d_s <Z, V_s'(c, x)> - sum_s r_s^2 K_s / 2,                (P13)

K_s no less than the norm of the second derivative of what shaft s brings, wherever it leads. Unbalances on a shaft of
ratio n turn by n d_s: their share of V is on an arc, which lies between its ends and the tangents there, and d_s is
sin(n d_s) / n but for |n^2 r_s^3| / 6; what is least over unbalances is concave, so least at one of these corners. Of
peaks the rest is that of the rows that Z has: there a bend of slope J that stands nearer than r_s to an angle, by a,
adds J (r_s - a).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.load_models.affine import AffineProblem
from laufruhe.load_models.led_model import LedModel, LedNorm
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import lengths
from laufruhe.numerics.norms.norm import curvature, mean_square
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.problem.decision import Domain
from laufruhe.problem.measure import Measure
from laufruhe.prove.boxes.lead_swing import LeadSwing
from laufruhe.prove.certificate import ROUNDING, Multipliers, minorant

WIDE = 1.2
"""Half an arc [rad] beyond which nothing is known of unbalances on it."""
SLACK = 1e-6
"""Relative excess over a limit that counts as none."""


@dataclass(frozen=True, eq=False)
class LeadBound:
    """Of a box.

    Attributes
    ----------
    value
        What no design in it goes under; infinite where none is allowed.
    at_middle
        The same of designs in its middle.
    pull
        What every side takes of the bound.
    broken
        Limits on how evenly the crank turns that no design in it keeps.
    """

    value: float
    at_middle: float
    pull: Array
    broken: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class _Rest:
    """Of one shaft and one measure, what its second derivative can do.

    Attributes
    ----------
    whole
        No less than its norm.
    most
        Of every signal no less than its length between bends, shape (signals,).
    bends
        Of every signal the angles at which it bends at the start of the leads, and the jumps of slope and value there.
    """

    whole: float
    most: Array
    bends: tuple[tuple[Array, Array, Array], ...]


class LeadBoxes:
    """Bounds of boxes of leads.

    Parameters
    ----------
    model
        Of the problem, with what is open of unbalances.
    """

    def __init__(self, model: LedModel) -> None:
        self.model = model
        problem = model.problem
        shafts = {shaft.name: shaft for shaft in problem.engine.shafts}
        self._ratios = np.array([abs(shafts[name].ratio) for name in model.names])
        self._terms = [term.measure for term in problem.load_terms]
        self._limits = [limit.measure for limit in problem.load_limits]
        self._rests = {m: [self._rest(m, s) for s in range(len(model.names))]
                       for m in dict.fromkeys([*self._terms, *self._limits]) if m.is_load}  # fmt: skip
        asked = dict.fromkeys(measure for measure in problem.measures if measure.channel.of_torque)
        self._swings = {measure: LeadSwing(problem, model, measure) for measure in asked}

    def numbers(self, leads: Array) -> list[float]:
        """Every degree of irregularity asked, at some leads."""
        return [swing.least(leads, np.zeros_like(leads)) for swing in self._swings.values()]

    def degrees(self, middle: Array, half: Array) -> tuple[float, dict[str, float]]:
        """What the degree of irregularity adds to the objective at least, and shares by which it breaks limits."""
        problem, found = self.model.problem, {m: swing.least(middle, half) for m, swing in self._swings.items()}
        total = sum(term.weight * found[term.measure] for term in problem.objective if term.measure in found)
        over = {x.name: found[x.measure] / x.maximum - 1.0 for x in problem.limits if x.measure in found}
        return total, {name: by for name, by in over.items() if by > SLACK}

    def bound(
        self, middle: Array, half: Array, program: AffineProblem, norms: Sequence[LedNorm], multipliers: Multipliers
    ) -> LeadBound:  # fmt: skip
        """By dual rows of the program in the middle of a box, on whatever grid this is.

        Dual rows of a program without terms show that no design in the box is allowed, or nothing.
        """
        (own, broken), (here, broken_here) = self.degrees(middle, half), self.degrees(middle, 0.0 * half)
        under = minorant(program, multipliers)
        rows = [*(w * z for (w, _), z in zip(program.terms, under.multipliers.terms, strict=True)),
                *under.multipliers.limits]  # fmt: skip
        slopes, rests = np.zeros(len(middle)), np.zeros(len(middle))
        # of what each shaft brings to the slope, and of its derivative
        tilts = np.zeros((2, len(middle), len(under.gradient)))
        measures = [*(self._terms if program.terms else ()), *self._limits]
        for measure, led, z in zip(measures, norms, rows, strict=True):
            for s, (constant, steep, flat) in enumerate(led.moved):
                slopes[s] += float(np.vdot(z, constant))
                tilts[:, s] += [z.ravel() @ each.reshape(z.size, -1) for each in (flat, steep)]
                if measure.is_load:
                    rests[s] += self._left(measure, s, led, z, middle, float(half[s]))
        arcs = least_on_arcs(self.model.domains, self._ratios, half, under.gradient, slopes, tilts)
        value = under.constant + arcs - float(rests.sum())
        at_middle = under.constant + self._least(under.gradient)
        shown = own + max(value, 0.0)
        none = value > ROUNDING * self._size(program, under.multipliers) if not program.terms else False
        return LeadBound(
            math.inf if none or broken else shown,
            math.inf if broken_here else here + max(at_middle, 0.0),
            rests + half * np.abs(slopes),
            tuple(broken),
        )

    @staticmethod
    def _size(program: AffineProblem, multipliers: Multipliers) -> float:
        prices = replace(multipliers, terms=()).shadow_prices(program)
        sizes = [most + norm.value(np.zeros(program.size)) for most, norm in program.limits]
        return sum(price * size for price, size in zip(prices, sizes, strict=True))

    def _least(self, gradient: Array) -> float:
        return sum(domain.least(gradient) for domain in self.model.domains)

    def _left(self, measure: Measure, s: int, led: LedNorm, z: Array, middle: Array, half: float) -> float:
        """What the second order of a lead can take of <Z, V>."""
        rest, norm = self._rests[measure][s], led.norm
        if measure.norm.refinement == 1:
            return 0.5 * half**2 * rest.whole * norm.dual_norm(z)
        size = lengths(z).reshape(len(rest.most), -1)
        total = 0.5 * half**2 * float(size.sum(axis=1) @ rest.most)
        by = float(middle[s] - self.model.start[s])
        for k, (angles, slopes, jumps) in enumerate(rest.bends):
            used = np.flatnonzero(size[k])
            if len(used) and len(angles) and led.angles is not None:
                rows = led.angles[k % len(led.angles)] if len(led.angles) == 1 else led.angles[self._point(measure, k)]
                period = float(self.model.shares(measure)[0].own[0].period)
                apart = np.abs(np.mod(rows[used, None] + by - angles + 0.5 * period, period) - 0.5 * period)
                near = np.maximum(half - apart, 0.0) @ slopes + (apart <= half) @ jumps
                total += float(size[k][used] @ near)
        return total

    def _point(self, measure: Measure, signal: int) -> int:
        """The operating point of a signal: they come point by point, of those that count."""
        counted = np.flatnonzero(measure.shares(self.model.problem.points) > 0.0)
        return int(counted[signal * len(counted) // len(self._rests[measure][0].most)])

    def _rest(self, measure: Measure, s: int) -> _Rest:
        shares = measure.shares(self.model.problem.points)
        square, most, bends = 0.0, [], []
        for weight, own in zip(shares[shares > 0.0], self.model.counted(measure, s), strict=True):
            square += weight * float(np.mean(mean_square(own.series.derivative.derivative)))
            most.append(curvature(own)[0])
            bends += _bends(own)
        return _Rest(math.sqrt(square), np.concatenate(most), tuple(bends))


def least_on_arcs(
    domains: Sequence[Domain], ratios: Array, half: Array, gradient: Array, slopes: Array, tilts: Array
) -> float:
    """Return a lower bound of what leads and unbalances make together in a box of leads (P13).

    It is under d . slopes + x . (gradient + sum_s ((cos(n_s d_s) - 1) tilts[0, s] + sin(n_s d_s) / n_s tilts[1, s]))
    for all leads |d_s| <= half_s [rad] and unbalances x of the domains; n_s are the ratios of the shafts.
    """
    if not domains:
        return -float(np.abs(slopes) @ half)
    arcs = ratios * half
    if arcs.max() > WIDE:
        return -math.inf
    sides = [((math.cos(a), math.sin(a)), (math.cos(a), -math.sin(a)), (1.0 / math.cos(a), 0.0)) for a in arcs]
    found = math.inf
    for corner in itertools.product(*sides):
        along, across = np.array(corner).T
        by = across / ratios
        turned = gradient + (along - 1.0) @ tilts[0] + by @ tilts[1]
        found = min(found, float(by @ slopes) + sum(domain.least(turned) for domain in domains))
    # d is sin(n d) / n but for the cube
    return found - float((np.abs(slopes) * ratios**2 * half**3).sum()) / 6.0


def _bends(signal: Spectrum) -> list[tuple[Array, Array, Array]]:
    """Of every place the angles at which a signal bends, and how much its slope and its value jump there."""
    places = signal.coefficients.shape[1]
    if signal.corners is None:
        return [(np.zeros(0), np.zeros(0), np.zeros(0))] * places
    jumps = signal.corners.jumps
    return [(signal.corners.angles, lengths(jumps[:, 1, k]), lengths(jumps[:, 0, k])) for k in range(places)]
