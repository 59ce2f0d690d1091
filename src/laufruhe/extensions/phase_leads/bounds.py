"""Lower bounds of the objective over boxes of lead angles of geared shafts (P13, P14).

V(c, x) are the rows of the loads at the middle c of a box with half widths r_s, for unbalances x. Dual rows Z of these
rows, and multipliers of the limits, give a function of leads and unbalances that is a lower bound of the objective. In
the box the function differs from its value at c by a part linear in the leads, which is minimal at a corner, and by a
remainder of second order:

    N(V(c + d, x)) >= <Z, V(c, x)> + sum_s d_s <Z, V_s'(c, x)> - sum_s r_s^2 K_s / 2,                (P13)

K_s bounds the norm of the second derivative of the load of shaft s for every lead. A change d_s of its lead turns the
unbalances on a shaft of speed ratio n by n d_s. Their part of V lies on an arc, within the triangle of the end points
of the arc and the crossing of the tangents there. The difference of d_s and sin(n d_s) / n is at most |n^2 r_s^3| / 6.
The minimum over unbalances is concave in this part of V, so it is least at a corner of the triangle. For peaks the
remainder counts the nonzero rows of Z alone: a kink with a jump of slope J at a distance a < r_s from the angle of a
row adds J (r_s - a).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.extensions.phase_leads.model import PhaseLeadModel, PhaseLeadNorm, earlier, problem_of_shafts
from laufruhe.load_models.affine import AffineProblem
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import lengths
from laufruhe.numerics.norms.norm import curvature, mean_square
from laufruhe.numerics.spectrum import Spectrum, spectrum_of
from laufruhe.physics.torque import FINE_SPEED, turning_inertia
from laufruhe.physics.uneven_speed import driving_torque, moving_inertia, start_energy
from laufruhe.problem.decision import Domain
from laufruhe.problem.measure import Measure
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import ROUNDING, Multipliers, minorant


@dataclass(frozen=True, eq=False)
class _Part:
    """Work and inertia on one shaft, or of the fixed parts, with upper bounds of their slopes (`torque`, `slope`)."""

    work: Spectrum
    inertia: Spectrum
    torque: float
    slope: float


class LeadSwing:
    """Lower bounds of the degree of irregularity delta over boxes of lead angles (P14).

    At two crank angles a and b the squares u = w^2 of the speed differ by twice (E + W_a) / m_a - (E + W_b) / m_b. E is
    the energy at the start, W the work of the torque, and m the inertia (F2-F4). A change of a lead changes work and
    inertia on its shaft by at most this change times the largest torque, and times the largest slope of the inertia. E
    falls with W and rises with m, so the equation of E with changed W and m bounds it. With the mean speed w_0,

        delta >= (u_a - u_b) / (w_a + w_b) / w_0,   with a lower bound of the numerator and upper bounds of w_a and w_b.
    """

    def __init__(self, problem: Problem, model: PhaseLeadModel, measure: Measure) -> None:
        fidelity, inertia = problem.fidelity, turning_inertia(problem.engine, problem.fidelity)
        if inertia is None:
            raise ModelError("the degree of irregularity needs the inertia of all rotating parts; add [flywheel]")
        self._start, self._turning = model.start, inertia
        self._steps = FINE_SPEED * fidelity.samples
        names = model.names
        engines = [
            problem_of_shafts(problem, test).engine
            for test in (lambda n: n not in names, *(name.__eq__ for name in names))
        ]
        angles = problem.engine.cycle.angle * np.arange(self._steps) / self._steps
        self._points: list[tuple[float, list[_Part]]] = []
        for point in problem.points:
            if measure.includes_point(point):
                parts = []
                for engine in engines:
                    torque = driving_torque(engine, point, fidelity)
                    swing = spectrum_of(moving_inertia(engine, fidelity, angles)[0], engine.cycle.base_order)
                    slope = float(np.abs(swing.coefficients[1:] * swing.orders[1:]).sum())
                    parts.append(_Part(torque.integral, swing, largest_torque(torque), slope))
                self._points.append((point.speed, parts))

    def minimum_over(self, middle: Array, half: Array) -> float:
        """Return a lower bound on a box of leads [rad], shape (leads,): the largest bound of any operating point."""
        return max(self._minimum_at_point(speed, parts, middle, half) for speed, parts in self._points)

    def _minimum_at_point(self, speed: float, parts: Sequence[_Part], middle: Array, half: Array) -> float:
        changes = [0.0, *(middle - self._start)]
        work: Array = np.sum(
            [earlier(part.work, d).sample(self._steps) for part, d in zip(parts, changes, strict=True)], axis=0
        )
        swinging = [earlier(part.inertia, d).sample(self._steps) for part, d in zip(parts, changes, strict=True)]
        inertia: Array = self._turning + np.sum(swinging, axis=0)
        work_error = float(sum(part.torque * r for part, r in zip(parts[1:], half, strict=True)))
        inertia_error = float(sum(part.slope * r for part, r in zip(parts[1:], half, strict=True)))
        if inertia.min() <= inertia_error:
            return 0.0
        try:
            low = start_energy(work, inertia - inertia_error, speed) - work_error
            high = start_energy(work, inertia + inertia_error, speed) + work_error
        except ModelError:
            # the crank may stop
            return 0.0
        squares = (0.5 * (low + high) + work) / inertia
        a, b = int(np.argmax(squares)), int(np.argmin(squares))
        light, heavy = inertia[a] + inertia_error, inertia[b] - inertia_error
        # linear in the energy, so minimal at an end
        difference = min(
            2.0 * ((energy + work[a] - work_error) / light - (energy + work[b] + work_error) / heavy)
            for energy in (low, high)
        )
        fastest = [
            math.sqrt(2.0 * max(high + work[k] + work_error, 0.0) / (inertia[k] - inertia_error)) for k in (a, b)
        ]
        return max(float(difference), 0.0) / sum(fastest) / speed


def largest_torque(torque: Spectrum) -> float:
    """Return an upper bound of the deviation of a torque from its mean, anywhere in the cycle [N m]."""
    swing = torque.with_coefficients(np.concatenate([[0.0], torque.coefficients[1:]]))
    steps = max(8 * len(swing.coefficients), 64)
    values = np.concatenate([swing.sample(steps), swing.values(swing.kink_angles)])
    curvatures = curvature(swing.mapped(lambda values: values[:, None, None]))
    return float(np.abs(values).max() + (swing.period / steps) ** 2 / 8.0 * curvatures.max(initial=0.0))


WIDE = 1.2
"""Half an arc [rad] beyond which the unbalances on the arc have no bound."""
SLACK = 1e-6
"""Relative violation of a limit that counts as none."""


@dataclass(frozen=True, eq=False)
class LeadBound:
    """Lower bound of the objective on a box of leads; infinite if no design in the box is feasible.

    Attributes
    ----------
    at_middle
        Lower bound at the middle of the box.
    pull
        Branching scores: loss of the bound by the width of each side, shape (leads,).
    broken
        Names of the limits on degrees of irregularity that all designs in the box violate.
    """

    value: float
    at_middle: float
    pull: Array
    broken: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class _SecondDerivative:
    """Upper bounds of the second derivative of a measured load by the lead of a shaft.

    Attributes
    ----------
    norm
        Upper bound of the norm of the second derivative.
    maximum
        Largest length of the second derivative between kinks, for each signal, shape (signals,).
    kinks
        For each signal: angles of the kinks at the initial leads, and jumps of slope and value there.
    """

    norm: float
    maximum: Array
    kinks: tuple[tuple[Array, Array, Array], ...]


class LeadBoxes:
    """Lower bounds on boxes of leads, for a model with open leads and perhaps open unbalances."""

    def __init__(self, model: PhaseLeadModel) -> None:
        self.model = model
        problem = model.problem
        shafts = {shaft.name: shaft for shaft in problem.engine.shafts}
        self._ratios = np.array([abs(shafts[name].ratio) for name in model.names])
        self._terms = [term.measure for term in problem.load_terms]
        self._limits = [limit.measure for limit in problem.load_limits]
        self._curvatures = {m: [self._second_derivative(m, s) for s in range(len(model.names))]
                            for m in dict.fromkeys([*self._terms, *self._limits]) if m.is_load}  # fmt: skip
        swinging = dict.fromkeys(measure for measure in problem.measures if measure.channel.depends_on_torque)
        self._swings = {measure: LeadSwing(problem, model, measure) for measure in swinging}

    def numbers(self, leads: Array) -> list[float]:
        """Return every degree of irregularity that the problem measures at given leads [rad], shape (leads,)."""
        return [swing.minimum_over(leads, np.zeros_like(leads)) for swing in self._swings.values()]

    def degrees(self, middle: Array, half: Array) -> tuple[float, dict[str, float]]:
        """Return a lower bound of the weighted degrees of irregularity on a box of lead angles, and violated limits.

        The second result has a lower bound of the relative violation by the name of each limit that is violated.
        """
        problem = self.model.problem
        degrees = {measure: swing.minimum_over(middle, half) for measure, swing in self._swings.items()}
        total = sum(term.weight * degrees[term.measure] for term in problem.objective if term.measure in degrees)
        excess = {x.name: degrees[x.measure] / x.maximum - 1.0 for x in problem.limits if x.measure in degrees}
        return total, {name: violation for name, violation in excess.items() if violation > SLACK}

    def bound(
        self, middle: Array, half: Array, program: AffineProblem, norms: Sequence[PhaseLeadNorm],
        multipliers: Multipliers,
    ) -> LeadBound:  # fmt: skip
        """Return the lower bound of the objective on a box of lead angles, by dual rows of the program at its middle.

        The dual rows may be on any grid of samples. Those of a program without objective terms prove that no design in
        the box is feasible, or prove nothing.

        Parameters
        ----------
        middle, half
            Middle and half widths of the box [rad], shape (leads,).
        norms
            Norms of the program with their derivatives by the leads, terms before limits.
        """
        degree, broken = self.degrees(middle, half)
        degree_at_middle, broken_at_middle = self.degrees(middle, 0.0 * half)
        affine = minorant(program, multipliers)
        rows = [*(w * z for (w, _), z in zip(program.terms, affine.multipliers.terms, strict=True)),
                *affine.multipliers.limits]  # fmt: skip
        slopes, remainders = np.zeros(len(middle)), np.zeros(len(middle))
        # by shaft: dual rows times the slopes by unbalances, and times the lead derivatives of these slopes
        tilts = np.zeros((2, len(middle), len(affine.gradient)))
        measures = [*(self._terms if program.terms else ()), *self._limits]
        for measure, lead_norm, z in zip(measures, norms, rows, strict=True):
            for s, (constant, slope_derivative, shaft_slope) in enumerate(lead_norm.derivatives):
                slopes[s] += float(np.vdot(z, constant))
                tilts[:, s] += [z.ravel() @ slope.reshape(z.size, -1) for slope in (shaft_slope, slope_derivative)]
                if measure.is_load:
                    remainders[s] += self._remainder(measure, s, lead_norm, z, middle, float(half[s]))
        arcs = minimum_on_arcs(self.model.domains, self._ratios, half, affine.gradient, slopes, tilts)
        value = affine.constant + arcs - float(remainders.sum())
        at_middle = affine.constant + sum(domain.minimum(affine.gradient) for domain in self.model.domains)
        excluded = False
        if not program.terms:
            prices = replace(affine.multipliers, terms=()).shadow_prices(program)
            sizes = [maximum + norm.value(np.zeros(program.size)) for maximum, norm in program.limits]
            excluded = value > ROUNDING * sum(price * size for price, size in zip(prices, sizes, strict=True))
        return LeadBound(
            math.inf if excluded or broken else degree + max(value, 0.0),
            math.inf if broken_at_middle else degree_at_middle + max(at_middle, 0.0),
            remainders + half * np.abs(slopes),
            tuple(broken),
        )

    def _remainder(
        self, measure: Measure, s: int, lead_norm: PhaseLeadNorm, z: Array, middle: Array, half: float
    ) -> float:
        """Return an upper bound of the second-order change of <Z, V> by the lead angle of shaft s in the box.

        Z are the dual rows `z` of the measure and V its load rows; `middle` and `half` are in radians.
        """
        derivative, norm = self._curvatures[measure][s], lead_norm.norm
        if measure.norm.refinement == 1:
            return 0.5 * half**2 * derivative.norm * norm.dual_norm(z)
        size = lengths(z).reshape(len(derivative.maximum), -1)
        total = 0.5 * half**2 * float(size.sum(axis=1) @ derivative.maximum)
        change = float(middle[s] - self.model.start[s])
        for k, (angles, slopes, jumps) in enumerate(derivative.kinks):
            used = np.flatnonzero(size[k])
            if len(used) and len(angles) and lead_norm.angles is not None:
                counted = np.flatnonzero(measure.shares(self.model.problem.points) > 0.0)
                point = int(counted[k * len(counted) // len(derivative.maximum)])
                rows = lead_norm.angles[0 if len(lead_norm.angles) == 1 else point]
                period = float(self.model.shares(measure)[0].bare[0].period)
                distance = np.abs(np.mod(rows[used, None] + change - angles + 0.5 * period, period) - 0.5 * period)
                kinks = np.maximum(half - distance, 0.0) @ slopes + (distance <= half) @ jumps
                total += float(size[k][used] @ kinks)
        return total

    def _second_derivative(self, measure: Measure, s: int) -> _SecondDerivative:
        shares = measure.shares(self.model.problem.points)
        square, maximum = 0.0, []
        kinks: list[tuple[Array, Array, Array]] = []
        for weight, signal in zip(shares[shares > 0.0], self.model.counted(measure, s), strict=True):
            square += weight * float(np.mean(mean_square(signal.series.derivative.derivative)))
            maximum.append(curvature(signal))
            places = signal.coefficients.shape[1]
            if signal.kinks is None:
                kinks += [(np.zeros(0),) * 3] * places
            else:
                angles, jumps = signal.kinks.angles, signal.kinks.jumps
                kinks += [(angles, lengths(jumps[:, 1, k]), lengths(jumps[:, 0, k])) for k in range(places)]
        return _SecondDerivative(math.sqrt(square), np.concatenate(maximum), tuple(kinks))


def minimum_on_arcs(
    domains: Sequence[Domain], ratios: Array, half: Array, gradient: Array, slopes: Array, turned: Array
) -> float:
    """Return a lower bound of a function of lead angles and unbalances over a box of lead angles (P13).

    The function is d . slopes + x . g, with changes of the lead angles |d_s| <= half_s [rad], unbalances x in the
    domains, speed ratios n_s, and the gradient by the unbalances at these angles:

        g = gradient + sum_s ((cos(n_s d_s) - 1) turned[0, s] + sin(n_s d_s) / n_s turned[1, s])

    Parameters
    ----------
    domains
        Sets of the unbalances.
    ratios, half, slopes
        Speed ratio, half width of the box, and slope by the lead angle of every shaft, shape (shafts,).
    gradient, turned
        Gradient by the unbalances at the middle, shape (columns,). Part of it that turns with each shaft, and
        derivative of this part by the lead angle, shape (2, shafts, columns).
    """
    if not domains:
        return -float(np.abs(slopes) @ half)
    arcs = ratios * half
    if arcs.max() > WIDE:
        return -math.inf
    sides = [((math.cos(a), math.sin(a)), (math.cos(a), -math.sin(a)), (1.0 / math.cos(a), 0.0)) for a in arcs]
    minimum = math.inf
    for corner in itertools.product(*sides):
        cosine, sine = np.array(corner).T
        leads = sine / ratios
        corner_gradient = gradient + (cosine - 1.0) @ turned[0] + leads @ turned[1]
        minimum = min(minimum, float(leads @ slopes) + sum(domain.minimum(corner_gradient) for domain in domains))
    # d differs from sin(n d) / n by the cube
    return minimum - float((np.abs(slopes) * ratios**2 * half**3).sum()) / 6.0
