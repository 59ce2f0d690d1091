"""A problem as norms of rows that are affine in its firing order and its decisions (V9, B8).

Where every cylinder has a throw of its own, a firing order is an assignment of cylinders to the slots of
the cycle, and it fixes the star. What loads bearings and twists the crankshaft adds up over the cylinders as
forces add up over the throws: the rows of one cylinder, later by its slot.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from laufruhe.load_models.isolated_cylinders import isolate, working
from laufruhe.load_models.star_model import StarModel, StarNorm, StarProblem, normalised
from laufruhe.machine.firing import even_patterns, firing_lattice, slot_order, slot_steps
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.crank_stars import StarSpace
from laufruhe.problem.channels import LoadChannel
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Measure, kinks_of, load_rows
from laufruhe.problem.problem import Phasing, Problem


def slot_space(cylinders: int, places: tuple[float, ...]) -> StarSpace:
    """Firing orders as stars of n steps to a cycle: one cylinder on each, the first on step 0."""
    return StarSpace(cylinders, ((1,) * cylinders,), places)


class FiringModel(StarModel):
    """A `StarModel` whose steps are the slots of the cycle.

    What does not feel the firing order is that of the star alone. To what does, the gas of each cylinder is
    added, later by its slot; what twists the crankshaft is that of one cylinder after another.
    """

    def __init__(
        self,
        phasing: Phasing,
        space: StarSpace,
        geometry: tuple[float | None, float | None],
        origin: tuple[int, ...] | None = None,
    ) -> None:
        layout, slots = phasing.layout(*geometry), space.first if origin is None else origin
        steps = firing_lattice(phasing.cycle, phasing.cylinders).steps
        cranks = StarSpace(steps, even_patterns(phasing.cycle, layout), layout.throw_positions)
        rest = replace(
            phasing, realise=lambda candidate: _of_star(phasing.realise(candidate)), firing_order=slot_order(slots)
        )
        super().__init__(rest, cranks, geometry, slot_steps(phasing.cycle, slots))
        # what feels the order repeats no sooner than the cycle
        self.base = phasing.cycle.base_order
        for model in self.models:
            model.base = self.base
        self.phasing, self.space = phasing, space
        self.problem = normalised(phasing.realise(phasing.fired(slots, geometry)))
        self._slots, self._fired = slots, evaluate(self.problem)

    def _rows(self, samples: int, averaged: bool) -> StarProblem:
        """Rows of every firing order at `samples` steps over the cycle."""
        stars, problem = super()._rows(samples, averaged), self.problem
        by_star = np.array(slot_steps(self.phasing.cycle, range(self.space.throws)))
        terms, limits = (iter([_by_slot(norm, by_star) for _, norm in each]) for each in (stars.terms, stars.limits))
        return StarProblem(
            tuple((term.weight, self._norm(term.measure, samples, averaged, terms)) for term in problem.objective),
            tuple(
                (limit.maximum, self._norm(limit.measure, samples, averaged, limits)) for limit in problem.load_limits
            ),
            self.domains,
            samples,
        )

    def _norm(self, measure: Measure, samples: int, averaged: bool, of_stars: Iterator[StarNorm]) -> StarNorm:
        """Rows of a measure: of its star, and what the slot of every cylinder adds."""
        if not measure.is_inside:
            return next(of_stars)
        signals = [signal.with_base(self.base) for signal in self._fired.signals(measure.load)]
        steps = samples if averaged and measure.norm.averages else None
        whole = load_rows(measure, self.problem.points, _averaged(signals, steps), self.problem.engine, samples)
        bends, count = kinks_of(measure, signals, self.problem.engine), self.space.throws
        moves = np.zeros((count, count, *whole.vectors.shape))
        for k in range(1, count):
            first = self._alone(measure.load, k)
            for slot in range(count):
                later = [signal.shift(Fraction(slot, count), slot * signal.period / count) for signal in first]
                moves[k, slot] = load_rows(
                    measure, self.problem.points, _averaged(later, steps), self.problem.engine, samples, bends
                ).vectors
            moves[k] -= moves[k, self._slots[k]].copy()
        if measure.load.depends_on_unbalances:
            star = next(of_stars)
            return replace(star, moves=star.moves + moves)
        slope = np.zeros((*whole.vectors.shape, sum(domain.width for domain in self.domains)))
        return StarNorm(measure.norm, whole.vectors, moves, slope, None, whole.grid)

    def _alone(self, load: LoadChannel, k: int) -> list[Spectrum]:
        """Return the loads of a cylinder firing in the first slot, per operating point: all, or gas alone."""
        engine = self.problem.engine
        part = engine.slider_cranks[k]
        first = replace(part, throw=part.throw + part.shaft.ratio * part.firing_angle, firing_angle=0.0)
        # the others stand idle: one cylinder sends its torque through the journals of the next
        alone = isolate(engine, k, True, first)
        found = []
        for at, point in zip(self._fired.loads, working(self.problem, part.name).points, strict=True):
            signal = load.signal(replace(at, point=point, moving=alone))
            if load.depends_on_unbalances:
                fidelity = replace(at.fidelity, gas=False, gas_orders=None)
                still = load.signal(replace(at, point=point, moving=alone, fidelity=fidelity))
                signal = signal + still.mapped(np.negative)
            found.append(signal.with_base(self.base))
        return found


def _averaged(signals: Sequence[Spectrum], steps: int | None) -> Sequence[Spectrum]:
    return signals if steps is None else [signal.averaged(signal.period / steps) for signal in signals]


def _by_slot(norm: StarNorm, steps: NDArray[np.int64]) -> StarNorm:
    turns = None if norm.turns is None else norm.turns[:, steps]
    return replace(norm, moves=norm.moves[:, steps], turns=turns)


def _of_star(problem: Problem) -> Problem:
    objective = tuple(term for term in problem.objective if _adds_up(term.measure))
    return replace(problem, objective=objective, limits=tuple(x for x in problem.limits if _adds_up(x.measure)))


def _adds_up(measure: Measure) -> bool:
    return not measure.is_inside or measure.load.depends_on_unbalances
