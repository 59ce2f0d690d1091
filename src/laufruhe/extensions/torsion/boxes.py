"""Lower bounds of RMS twist, torque and stress over boxes of discs, shafts and absorbers (V13).

The rotating inertia and the degree of irregularity are monotone in the inertia of every disc (V14), so that a corner
of the box bounds them.

The dynamic stiffness of an order is affine in inertia, stiffness and damping; the coordinate of a diameter is its
stiffness. So the response over a box is the series of E37, in coordinates in which the inertia of the centre is one.
Orders whose series may diverge are left out: a root of squares is no larger without them.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from laufruhe.errors import ModelError
from laufruhe.extensions.torsion.channels import ABSORBER_HEAT, FACTORS, RESONANCES
from laufruhe.extensions.torsion.coordinates import TwistCoordinates
from laufruhe.extensions.torsion.machine import TORSION, Torsion
from laufruhe.extensions.torsion.physics import Resonance, dynamic_stiffness, inertias, receptances, throw_torques
from laufruhe.numerics.arrays import Array, ComplexArray, Indices
from laufruhe.physics.torque import turning_inertia
from laufruhe.problem.dependence import depends, falls_with
from laufruhe.problem.evaluation import Evaluation
from laufruhe.problem.loads import PointLoads
from laufruhe.problem.measure import Limit, Measure
from laufruhe.problem.problem import Problem
from laufruhe.prove.mounts.box_norms import LinearBound, root_under
from laufruhe.prove.mounts.box_series import Expansion, LinearResponse, Sides, directions_of, inverses, mapped, series
from laufruhe.prove.mounts.ranges import SLACK

# orders whose share of the squares is less, in the middle of the bounds and at their corners, are left out
MIN_SHARE = 1e-10
MAX_CORNERS = 16
_SAME = 1e-9


@dataclass(frozen=True, eq=False)
class _Excitation:
    """Orders of one operating point, with the torques that excite the discs.

    Attributes
    ----------
    highest
        Highest multiple of the lowest order, including orders that are left out.
    torques
        Torques on discs and rings, shape (orders, discs and rings) [N m].
    mean
        Torque of order zero on each disc, shape (discs,) [N m].
    middle, sides
        Dynamic stiffness in the middle of the bounds, and its slope by each coordinate, shapes (orders, n, n) and
        (coordinates, orders, n, n).
    along, inside
        Directions of the slopes, and their components along them (E37).
    """

    loads: PointLoads
    highest: int
    orders: Array
    torques: ComplexArray
    mean: Array
    middle: ComplexArray
    sides: ComplexArray
    along: Sides
    inside: ComplexArray


class _InertiaBound:
    """Bound of the rotating inertia, or of a degree of irregularity that falls with it (T9, V14)."""

    def __init__(self, measure: Measure, evaluation: Evaluation) -> None:
        if measure.channel.inertia_value is None:
            raise TypeError(f"{measure.name} is no measure of the rotating inertia")
        self._number = measure.channel.inertia_value(measure, evaluation)
        self._rises = not falls_with(measure.channel, TORSION)
        self._engine, self._fidelity = evaluation.engine, evaluation.fidelity

    def minimum(self, chains: Sequence[Torsion]) -> float:
        """Return the minimum over a box, from the chains at its lower corner, centre and upper corner."""
        inertia = turning_inertia(self._engine.with_extra(chains[0 if self._rises else -1]), self._fidelity)
        return 0.0 if inertia is None else self._number(inertia)


class TwistBoxes:
    """Bounds of the objective on boxes of open numbers of the crankshaft (V13).

    Parameters
    ----------
    problem
        Problem with nothing but numbers of the crankshaft open.
    evaluation
        Evaluation of the initial design.
    """

    what = "boxes of discs and shafts"
    batch_size = 1

    def __init__(self, problem: Problem, evaluation: Evaluation) -> None:
        self.problem, self.coordinates = problem, TwistCoordinates(problem)
        kinds = {decision.kind for decision in problem.decisions}
        fixed_terms = [t for t in problem.objective if not depends(t.measure.channel, kinds, problem)]
        self._constant = sum(term.weight * evaluation.value(term.measure) for term in fixed_terms)
        self._terms = [(t.weight, t.measure) for t in problem.objective if _is_square(t.measure)]
        self._limits = [(limit.maximum, limit.measure) for limit in problem.limits if _is_square(limit.measure)]
        self._heat = [limit for limit in problem.limits if limit.measure.channel is ABSORBER_HEAT]
        self._numbers = [
            (limit, resonance)
            for limit in problem.limits if limit.measure.channel in RESONANCES
            for resonance in RESONANCES[limit.measure.channel](limit.measure, evaluation)
        ]  # fmt: skip
        self._turning = [
            (t.weight, _InertiaBound(t.measure, evaluation)) for t in problem.objective if _turns(t.measure)
        ]
        self._uneven = [(x.maximum, _InertiaBound(x.measure, evaluation)) for x in problem.limits if _turns(x.measure)]
        self._samples = evaluation.samples
        self._excitations = [self._excitation_at(loads) for loads in evaluation.loads]

    @property
    def is_sampled_fully(self) -> bool:
        """True if sums over orders equal sums over samples, as the bounds assume."""
        highest = max((excitation.highest for excitation in self._excitations), default=0)
        return highest <= self._samples // 2

    @property
    def has_terms(self) -> bool:
        """True if any term of the objective has a bound."""
        return bool(self._terms or self._turning)

    @property
    def knows_all(self) -> bool:
        """True if every term of the objective has a bound that converges in small boxes."""
        return all(_is_square(term.measure) or _turns(term.measure) for term in self.problem.objective)

    def bounds(self, lower: Array, upper: Array) -> tuple[Array, NDArray[np.intp]]:
        """Return the lower bound on every box, infinite for boxes without a feasible design, and the side to bisect."""
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            bounds = [self._bound(low, high) for low, high in zip(lower, upper, strict=True)]
        return np.array([value for value, _ in bounds]), np.array([side for _, side in bounds], dtype=np.intp)

    def _bound(self, lower: Array, upper: Array) -> tuple[float, int]:
        full_widths = np.maximum(self.coordinates.upper - self.coordinates.lower, 1e-300)
        widths = (upper - lower) / full_widths
        if any(self._breaks(limit, resonance, lower, upper) for limit, resonance in self._numbers):
            return math.inf, int(np.argmax(widths))
        centre, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
        chains = [self.coordinates.chain(x) for x in (lower, centre, upper)]
        if any(inertia_bound.minimum(chains) > maximum * (1.0 + SLACK) for maximum, inertia_bound in self._uneven):
            return math.inf, int(np.argmax(widths))
        twists = [self._expanded(excitation, chains[1], centre, half) for excitation in self._excitations]
        limited = ((maximum, _root_bound([(1.0, self._under(q, chains, twists))])) for maximum, q in self._limits)
        if any(bound > maximum * (1.0 + SLACK) for maximum, bound in limited):
            return math.inf, int(np.argmax(widths))
        if any(self._overheats(limit, chains, twists) for limit in self._heat):
            return math.inf, int(np.argmax(widths))
        terms = [(weight, self._under(measure, chains, twists)) for weight, measure in self._terms]
        turning = sum(weight * inertia_bound.minimum(chains) for weight, inertia_bound in self._turning)
        if terms:
            pull = np.nan_to_num(sum((w * under.scores[0] for w, under in terms), np.zeros(len(widths))))
            pull = pull / max(float(pull.max(initial=0.0)), 1e-300)
        else:
            # the rotating inertia is monotone in every inertia, and no other number moves it
            pull = widths
        return self._constant + turning + _root_bound(terms), int(np.argmax(pull + _SAME * widths))

    def _excitation_at(self, loads: PointLoads) -> _Excitation:
        """Return the orders that contribute anywhere in the bounds, judged at their middle and corners."""
        coordinates, speed = self.coordinates, loads.point.speed
        torques = throw_torques(self.problem.engine, loads.point, loads.fidelity)
        middle = 0.5 * (coordinates.lower + coordinates.upper)
        corners = itertools.islice(
            itertools.product(*zip(coordinates.lower, coordinates.upper, strict=True)), MAX_CORNERS
        )
        counted = np.zeros(len(torques.orders), dtype=bool)
        for x in (middle, *map(np.array, corners)):
            try:
                flexible = receptances(coordinates.chain(x), torques.orders, speed)
            except ModelError:
                # on a resonance all orders count
                counted[:] = True
                continue
            size = (np.abs(np.einsum("hsd,hd->hs", flexible, torques.coefficients)) ** 2).sum(axis=1)
            counted |= size > MIN_SHARE * size.sum()
        counted[0] = False
        # two samples a wave may miss all of an order
        counted[2 * np.arange(len(counted)) >= self._samples] = False
        orders = torques.orders[counted]
        chain = coordinates.chain(middle)
        drives = np.zeros((len(orders), len(chain.discs) + len(chain.absorbers)), dtype=complex)
        drives[:, : len(chain.discs)] = torques.coefficients[counted]
        middle_stiffness = dynamic_stiffness(chain, orders, speed)
        sides = []
        for k in range(len(middle)):
            # an affine function has the same slope over the whole width, with less rounding
            ends = [
                np.where(np.arange(len(middle)) == k, end, middle) for end in (coordinates.lower, coordinates.upper)
            ]
            low, high = (dynamic_stiffness(coordinates.chain(x), orders, speed) for x in ends)
            sides.append((high - low) / (coordinates.upper[k] - coordinates.lower[k]))
        highest = len(torques.coefficients) - 1
        twisted = chain.incidence[: len(chain.sections)]
        along = directions_of([
            [*side.real, *side.imag, row[:, None] * twisted]
            for side, row in zip(sides, coordinates.owners, strict=True)
        ])  # fmt: skip
        inside = along.inside(np.moveaxis(np.array(sides), 0, 1))
        mean = torques.coefficients[0].real
        return _Excitation(loads, highest, orders, drives, mean, middle_stiffness, np.array(sides), along, inside)

    def _expanded(self, excitation: _Excitation, chain: Torsion, centre: Array, half: Array) -> Expansion:
        root = np.sqrt(inertias(chain))
        scale = np.outer(root, root)
        middle = 0.5 * (self.coordinates.lower + self.coordinates.upper)
        dynamic = excitation.middle + np.tensordot(centre - middle, excitation.sides, axes=(0, 0))
        inverse = inverses(dynamic / scale)
        angles = np.einsum("lab,lb->la", inverse, excitation.torques / root)
        along = replace(excitation.along, columns=excitation.along.columns / root[:, None])
        return series(centre[None], half[None], inverse[None], along, excitation.inside, angles[None])

    def _under(self, measure: Measure, chains: Sequence[Torsion], twists: Sequence[Expansion]) -> LinearBound:
        """Return a linear lower bound of the RMS of a torque or stress over orders, sections and operating points.

        `chains` are those at the lower corner, the centre and the upper corner of the box, and `twists` the series of
        the response at each operating point.
        """
        names = [section.name for section in chains[1].sections]
        places = measure.load.places(self.problem.engine)
        chosen = np.array([names.index(places[k]) for k in measure.places(places)], dtype=np.intp)
        shares = measure.shares([excitation.loads.point for excitation in self._excitations]) / len(chosen)
        answers, weights = list[LinearResponse](), list[Array]()
        for share, excitation, twist in zip(shares, self._excitations, twists, strict=True):
            answers.append(self._alternating(measure, chains, excitation, twist, chosen))
            weights.append(np.where(measure.counted(excitation.orders), 0.5 * share, 0.0))
            if bool(measure.counted(np.zeros(1))[0]):
                answers.append(self._mean(measure, chains, excitation, chosen))
                weights.append(np.array([share]))
        parts = (
            np.concatenate([getattr(answer, part) for answer in answers], axis=1)
            for part in ("value", "slopes", "remainder", "scores")
        )
        return root_under(LinearResponse(*parts), np.concatenate(weights))

    def _alternating(
        self, measure: Measure, chains: Sequence[Torsion], excitation: _Excitation, twist: Expansion, chosen: Indices
    ) -> LinearResponse:
        """Return the alternating torque or stress of chosen shaft sections as linear functions over a box."""
        root, factors = np.sqrt(inertias(chains[1])), FACTORS[measure.channel]
        twisted = chains[1].incidence[: len(chains[1].sections)]
        scaled = twisted / root
        low, centre, high = (
            factors(chain, excitation.orders, excitation.loads.point.speed)[:, chosen, None] for chain in chains
        )
        # each factor follows its own stiffness, convex or concave: `bend` bounds the error of the secant
        turn, bend = 0.5 * (high - low), np.abs(centre - 0.5 * (high + low))[..., 0]
        owners = self.coordinates.owners[:, chosen, None]
        # slopes in coordinates of the discs, along the stiffness of each section
        slopes = owners * turn[:, None] * twisted[chosen]
        answer = mapped(twist, (centre * scaled[chosen])[None], excitation.along.along(slopes)[None])
        if not bend.any():
            return answer
        moved = np.broadcast_to(scaled[chosen], (1, len(excitation.orders), len(chosen), len(root)))
        twist_response = mapped(twist, moved)
        maximum = np.abs(twist_response.value) + np.abs(twist_response.slopes).sum(axis=2)
        maximum = maximum + twist_response.remainder[..., None]
        excess = np.linalg.norm(np.where(bend > 0.0, bend * maximum, 0.0), axis=-1)
        return replace(answer, remainder=answer.remainder + excess)

    def _mean(
        self, measure: Measure, chains: Sequence[Torsion], excitation: _Excitation, chosen: Indices
    ) -> LinearResponse:
        zero, speed, factors = np.zeros(1), excitation.loads.point.speed, FACTORS[measure.channel]
        low, centre, high = (
            ((receptances(chain, zero, speed)[0] @ excitation.mean) * factors(chain, zero, speed)[0])[chosen]
            for chain in chains
        )
        slopes = self.coordinates.owners[:, chosen] * (0.5 * (high - low))
        rest = np.array([[float(np.linalg.norm(centre - 0.5 * (high + low)))]])
        return LinearResponse(centre[None, None], slopes[None, None], rest, np.zeros((1, 1, len(slopes))))

    def _overheats(self, limit: Limit, chains: Sequence[Torsion], twists: Sequence[Expansion]) -> bool:
        """Return True if an absorber exceeds its heat limit all over a box.

        The loss per swing is smallest at the lower ends.
        """
        root = np.sqrt(inertias(chains[1]))
        for excitation, twist in zip(self._excitations, twists, strict=True):
            point = excitation.loads.point
            rate = excitation.orders * point.speed
            for k, absorber in enumerate(chains[0].absorbers if limit.measure.includes_point(point) else ()):
                row = chains[0].incidence[len(chains[0].sections) + k]
                swing = mapped(twist, np.broadcast_to(row / root, (1, len(rate), 1, len(root))))
                lost = 0.5 * absorber.losses(rate, point.speed)
                if _root_bound([(1.0, root_under(swing, lost))]) ** 2 > limit.maximum * (1.0 + SLACK):
                    return True
        return False

    def _breaks(self, limit: Limit, resonance: Resonance, lower: Array, upper: Array) -> bool:
        # V15: modes break a limit all over a box; they rise with stiffness and fall with inertia
        ends = self.coordinates.ends(lower, upper, resonance)
        if ends is None:
            return False
        low, high = (resonance.numbers(chain) for chain in ends)
        # modes count from the highest; the chain at the low corner may have fewer
        low, high = low[::-1], high[::-1][: len(low)]
        broken = (low > limit.maximum * (1.0 + SLACK)) | (high < limit.minimum * (1.0 - SLACK))
        if limit.outside is not None:
            broken |= (low > limit.outside[0] * (1.0 + SLACK)) & (high < limit.outside[1] * (1.0 - SLACK))
        return bool(np.any(broken))


def _turns(measure: Measure) -> bool:
    return measure.channel.inertia_value is not None


def _is_square(measure: Measure) -> bool:
    return measure.channel in FACTORS and measure.norm.is_euclidean


def _root_bound(terms: Sequence[tuple[float, LinearBound]]) -> float:
    slopes = sum((weight * under.slopes[0] for weight, under in terms), np.zeros(1))
    bound = sum(weight * float(under.value[0] - under.remainder[0]) for weight, under in terms) - float(
        np.abs(slopes).sum()
    )
    return max(bound, 0.0) if math.isfinite(bound) else 0.0
