"""A problem as norms of rows that are affine in its firing order and its decisions (V9).

Where every cylinder has a throw of its own, a firing order is an assignment of cylinders to the slots of
the cycle, and it fixes the star. What twists the crankshaft adds up over the cylinders as forces add up over the
throws: the rows of one cylinder, later by its slot.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np

from laufruhe.load_models.star_model import StarModel, StarNorm, StarProblem, compressed, normalised
from laufruhe.machine.firing import even_patterns, firing_lattice, slot_steps
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.star_space import StarSpace
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.loads import PointLoads
from laufruhe.problem.measure import Measure, load_rows
from laufruhe.problem.problem import Phasing, Problem


def slot_space(cylinders: int, places: tuple[float, ...]) -> StarSpace:
    """Firing orders as stars of n steps to a cycle: one cylinder on each, the first on step 0."""
    return StarSpace(cylinders, ((1,) * cylinders,), places)


class FiringModel(StarModel):
    """As `StarModel`, its steps the slots of the cycle.

    What does not feel the firing order is that of the star alone. What does is that of one cylinder after another.
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
        rest = replace(phasing, realise=lambda candidate: _without_order(phasing.realise(candidate)))
        super().__init__(rest, cranks, geometry, slot_steps(phasing.cycle, slots))
        # what feels the order repeats no sooner than the cycle
        self.base = phasing.cycle.base_order
        for model in self.models:
            model.base = self.base
        self.phasing, self.space = phasing, space
        self.problem = normalised(phasing.realise(phasing.fired(slots, geometry)))
        self._slots, self._fired = slots, evaluate(self.problem)
        self._fired_at: dict[int, StarProblem] = {}

    def at(self, samples: int) -> StarProblem:
        """Rows of every firing order at `samples` steps over the cycle."""
        if samples not in self._fired_at:
            stars = super().at(samples)
            by_star = np.array(slot_steps(self.phasing.cycle, range(self.space.throws)))
            terms, limits = (
                iter([(weight, _by_slot(norm, by_star)) for weight, norm in each])
                for each in (stars.terms, stars.limits)
            )
            self._fired_at[samples] = StarProblem(
                tuple(
                    (term.weight, self._norm(term.measure, samples)) if term.measure.feels_order else next(terms)
                    for term in self.problem.objective
                ),
                tuple(
                    (limit.maximum, self._norm(limit.measure, samples)) if limit.measure.feels_order else next(limits)
                    for limit in self.problem.load_limits
                ),
                self.domains,
                samples,
            )
        return self._fired_at[samples]

    def _norm(self, measure: Measure, samples: int) -> StarNorm:
        """Rows of a measure that feels the order: of the whole engine, and of every cylinder in every slot."""
        whole = load_rows(measure, self.problem.points, self._fired.signals(measure.load), self.problem.engine, samples)
        count = self.space.throws
        moves = np.zeros((count, count, *whole.vectors.shape))
        for k in range(1, count):
            first = self._alone(measure, k)
            for slot in range(count):
                later = [signal.later(Fraction(slot, count), slot * signal.period / count) for signal in first]
                rows = load_rows(measure, self.problem.points, later, self.problem.engine, samples)
                moves[k, slot] = rows.vectors
            moves[k] -= moves[k, self._slots[k]].copy()
        slope = np.zeros((*whole.vectors.shape, sum(domain.width for domain in self.domains)))
        norm = StarNorm(measure.norm, whole.vectors, moves, slope, None, whole.grid)
        return compressed(norm) if measure.norm.is_euclidean else norm

    def _alone(self, measure: Measure, k: int) -> list[Spectrum]:
        """What one cylinder that fires in the first slot makes, at every operating point."""
        engine = self.problem.engine
        part = engine.slider_cranks[k]
        first = replace(part, throw=part.throw + part.shaft.ratio * part.firing_angle, firing_angle=0.0)
        alone = replace(engine, slider_cranks=(first,), rotors=())
        return [measure.load.signal(PointLoads(at.point, at.wrench, None, None, alone, at.fidelity))
                for at in self._fired.loads]  # fmt: skip


def _by_slot(norm: StarNorm, steps: np.ndarray[tuple[int, ...], np.dtype[np.int64]]) -> StarNorm:
    """Rows by the slot of each throw's cylinder in place of its step."""
    turns = None if norm.turns is None else norm.turns[:, steps]
    return replace(norm, moves=norm.moves[:, steps], turns=turns)


def _without_order(problem: Problem) -> Problem:
    """The problem without what changes with the firing order of one star."""
    objective = tuple(term for term in problem.objective if not term.measure.feels_order)
    return replace(problem, objective=objective, limits=tuple(x for x in problem.limits if not x.measure.feels_order))
