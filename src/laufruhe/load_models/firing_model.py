"""Problem with an open firing order as norms of load rows that are affine in the order and the decisions (V9, B8).

If every cylinder has a throw of its own, a firing order assigns the cylinders to the slots of the cycle, and thereby
fixes the crank star. Loads on bearings and torques in the crankshaft are sums over the cylinders. Each cylinder adds
its own load rows, later by its slot.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from laufruhe.load_models.isolated_cylinders import isolate_cylinder, motored, only_gas_of
from laufruhe.load_models.star_model import StarModel, StarNorm, StarProblem, with_upright_angles
from laufruhe.machine.firing import even_patterns, firing_lattice, slot_order, slot_steps
from laufruhe.numerics.spectrum import Spectrum
from laufruhe.physics.crank_stars import StarSpace
from laufruhe.problem.channels import LoadChannel
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Measure, Rows, kinks_of, load_rows
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Phasing, Problem


class FiringModel(StarModel):
    """Loads of all firing orders: a crank star model whose steps are the slots of the cycle.

    Loads that do not depend on the firing order are those of the crank star. To loads inside the crankcase, the load of
    every cylinder is added, later by its slot. The same holds for the gas of cylinders that differ.

    The parameters are those of `StarModel`: `space` has the allowed firing orders, as stars of slots. `origin` has the
    slot of every cylinder in the firing order from which changes are counted.
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

        def without_inside(candidate: Candidate) -> Problem:
            problem = phasing.problem_of(candidate)
            objective = tuple(term for term in problem.objective if _is_of_star(term.measure))
            limits = tuple(limit for limit in problem.limits if _is_of_star(limit.measure))
            return replace(problem, objective=objective, limits=limits)

        star_phasing = replace(phasing, problem_of=without_inside, firing_order=slot_order(slots))
        super().__init__(star_phasing, cranks, geometry, slot_steps(phasing.cycle, slots))
        # loads that depend on the firing order have the period of the cycle
        self.base = phasing.cycle.base_order
        for model in self.models:
            model.base = self.base
        self.phasing, self.space = phasing, space
        self.problem = with_upright_angles(phasing.problem_of(phasing.fired(slots, geometry)))
        self._slots, self._origin_evaluation = slots, evaluate(self.problem)

    def _rows(self, samples: int, averaged: bool) -> StarProblem:
        stars, steps = super()._rows(samples, averaged), slot_steps(self.phasing.cycle, range(self.space.throws))
        # norms of the crank stars by slots, first of the terms and then of the limits
        star_norms = iter([norm.with_steps(steps) for _, norm in (*stars.terms, *stars.limits)])
        numbers = [(term.weight, term.measure) for term in self.problem.objective]
        numbers += [(limit.maximum, limit.measure) for limit in self.problem.load_limits]
        norms = [(number, self._norm(measure, samples, averaged, star_norms)) for number, measure in numbers]
        count = len(self.problem.objective)
        return StarProblem(tuple(norms[:count]), tuple(norms[count:]), self.domains, samples)

    def _norm(self, measure: Measure, samples: int, averaged: bool, star_norms: Iterator[StarNorm]) -> StarNorm:
        """Return a measure as a function of the firing order.

        `star_norms` yields the same measures as functions of the throw angles alone.
        """
        gas_differs = self.problem.gas_distinguishes_cylinders and measure.depends_on_gas
        if not measure.is_inside and not gas_differs:
            return next(star_norms)
        signals = [signal.with_base(self.base) for signal in self._origin_evaluation.signals(measure.load)]
        kinks, count = kinks_of(measure, signals, self.problem.engine), self.space.throws

        def rows(signals: Sequence[Spectrum]) -> Rows:
            if averaged and measure.norm.averages:
                signals = [signal.averaged(signal.period / samples) for signal in signals]
            return load_rows(measure, self.problem.points, signals, self.problem.engine, samples, kinks)

        origin = rows(signals)
        moves = np.zeros((count, count, *origin.vectors.shape))
        for k in range(1, count):
            first = self._loads_of_cylinder(measure.load, k)
            for slot in range(count):
                later = [signal.shift(Fraction(slot, count), slot * signal.period / count) for signal in first]
                moves[k, slot] = rows(later).vectors
            moves[k] -= moves[k, self._slots[k]].copy()
        if measure.load.depends_on_unbalances:
            star = next(star_norms)
            return replace(star, moves=star.moves + moves)
        slope = np.zeros((*origin.vectors.shape, sum(domain.width for domain in self.domains)))
        return StarNorm(measure.norm, origin.vectors, moves, slope, None, origin.grid)

    def _loads_of_cylinder(self, load: LoadChannel, k: int) -> list[Spectrum]:
        """Return the load spectrum of cylinder k alone, fired in slot 0, at every operating point.

        A load that depends on unbalances has only its gas part here; the rows of the crank star hold its inertia part.
        """
        engine = self.problem.engine
        part = engine.slider_cranks[k]
        first = replace(part, throw=part.throw + part.shaft.ratio * part.firing_angle, firing_angle=0.0)
        # the others keep their places, because the torque of a cylinder passes their journals
        isolated, problem = isolate_cylinder(engine, k, True, first), only_gas_of(self.problem, part.name)
        signals = evaluate(problem, isolated).signals(load)
        if load.depends_on_unbalances:
            without_gas = evaluate(motored(problem), isolated).signals(load)
            signals = [a + b.mapped(np.negative) for a, b in zip(signals, without_gas, strict=True)]
        return [signal.with_base(self.base) for signal in signals]


def _is_of_star(measure: Measure) -> bool:
    # loads that depend on the crank star at least in part
    return not measure.is_inside or measure.load.depends_on_unbalances
