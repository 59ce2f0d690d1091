"""Live model of a problem: loads that are affine in the open numbers (P1).

The numbers come from `AffineModel`. Norms are given by name, and the page computes them as results do. Measures that
the model cannot compute are listed with a reason.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from laufruhe import units
from laufruhe.errors import ModelError
from laufruhe.extensions.served_page.live.parts import DisplayedMeasure, LiveModel, Slider, or_none
from laufruhe.extensions.served_page.live.saving import saved_file
from laufruhe.extensions.served_page.live.signals import NORMS_OF_PAGE, Signal, signal_of
from laufruhe.files import edits
from laufruhe.files.complaints import Refused
from laufruhe.load_models.affine import AffineModel
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import MEAN
from laufruhe.present.measures import places_of
from laufruhe.present.numbers import share
from laufruhe.problem.channels import CHANNELS
from laufruhe.problem.decision import Decision, Domain, Kind, decision_vector
from laufruhe.problem.dependence import depends, is_affine
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Limit, Measure
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.certificate import Proof
from laufruhe.solvers.result import Result

ON_BLOCK = ("shaking force", "rocking couple", "roll moment")
HOW, SERVED = "use laufruhe page {file}", "the server optimises it, or use its own control"
OBJECTIVE = "objective"
NO_SLIDERS = "None of the open numbers can be moved by a slider."


def live_model(problem: Problem, result: Result, is_served: bool = False) -> LiveModel:
    """Return the model of a live page; open numbers that are not affine keep the values of the result.

    `is_served` is True if a server decides and evaluates these numbers.
    """
    file = f"{problem.name}.toml"
    model = LiveModel(
        problem.name, problem.title, file, tuple(point.name for point in problem.points), problem.engine.cycle.turns,
        objective=result.problem.drawing.objective_name, unit=result.problem.objective_unit or "",
    )  # fmt: skip
    values = decided(result.problem, {entry.name: entry.value for entry in result.decisions})
    how = SERVED if is_served else HOW.format(file=file)
    fixed = [decision for decision in result.problem.decisions if not decision.is_affine]
    reduced = result.problem.fixed_at([values[decision.name] for decision in fixed], fixed)
    slider_problem = replace(reduced, phasing=None, extras=())
    without_slider = tuple(_without_slider(result.problem, how))
    model = replace(model, without_slider=without_slider, why_not="" if slider_problem.decisions else NO_SLIDERS)
    try:
        filled = _filled(model, problem, slider_problem, result, values, is_served)
    except ModelError as error:
        return replace(model, why_not=f"The loads cannot be shown while decisions move: {error}.")
    return replace(filled, save=saved_file(problem, result, slider_problem, values))


def decided(problem: Problem, numbers: Mapping[str, float]) -> dict[str, Value]:
    """Return values of all decisions by name, from the sizes and angles of a result; by default their start."""
    values: dict[str, Value] = {}
    for decision in problem.decisions:
        if decision.name not in numbers:
            values[decision.name] = decision.start
        elif decision.is_affine and decision.set.width > 1:
            values[decision.name] = numbers[decision.name] * cmath.exp(1j * numbers[decision.angle_name])
        else:
            unit = decision.set.directions[0]
            values[decision.name] = numbers[decision.name] * (unit if decision.is_affine else 1.0)
    return values


def _filled(
    bare: LiveModel,
    problem: Problem,
    slider_problem: Problem,
    result: Result,
    values: Mapping[str, Value],
    is_served: bool,
) -> LiveModel:
    affine = AffineModel(slider_problem)
    kinds = {decision.kind for decision in slider_problem.decisions}
    # the reason names the source of values that the page cannot compute
    source_text = "it is computed when sliders rest" if is_served else f"its value is that of the final design; {HOW}"
    aside = f"cannot be followed live; {source_text.format(file=bare.file)}"
    collected = _Collected(affine, kinds, result, aside)
    forces = [(load.display.title, load) for load in places_of(result) if load.depends_on_unbalances]
    block = [(name.capitalize(), CHANNELS[name]) for name in ON_BLOCK]
    curves = tuple(
        {"title": title, "signal": collected.signal(Measure(channel))} for title, channel in (*forces, *block)
    )
    measures = collected.measures()
    designs = [("given", decision_vector(affine.domains))]
    if result.decisions:
        designs.append(("optimum", decision_vector(affine.domains, [values[d.name] for d in slider_problem.decisions])))
    designs.append(("between", _between(affine.domains)))
    return replace(
        bare,
        sliders=tuple(_slider(domain, problem) for domain in affine.domains),
        signals=tuple(collected.signals.values()),
        curves=curves,
        measures=measures,
        designs={name: _design(x, slider_problem, affine.domains, collected.queries) for name, x in designs},
        reference=None if is_served else _reference(result),
        without_slider=(*bare.without_slider, *collected.without_slider),
    )


class _Collected:
    """Signals of a problem, each stored once, and the measures that use them."""

    def __init__(self, model: AffineModel, kinds: set[Kind], result: Result, aside: str) -> None:
        self.model, self.kinds, self.aside = model, kinds, aside
        self.decided = {limit.name: limit for limit in result.limits}
        self.signals: dict[Measure, Signal] = {}
        self.without_slider: list[tuple[str, str]] = []
        self.queries: list[Measure | None] = []

    def signal(self, measure: Measure) -> int:
        """Return the index of a measure's signal; all norms share it."""
        key = replace(measure, norm=MEAN)
        if key not in self.signals:
            self.signals[key] = signal_of(self.model, key)
        return list(self.signals).index(key)

    def measures(self) -> tuple[DisplayedMeasure, ...]:
        """Return terms of all objectives, and limits."""
        problem = self.model.problem
        later = [term.measure for rank in problem.ranks[1:] for term in rank.terms]
        return (
            *(
                self._measure(term.measure, OBJECTIVE, term.measure.name, weight=term.weight)
                for term in problem.objective
            ),
            *(self._measure(measure, "rank", measure.name) for measure in later),
            *(self._measure(limit.measure, "limit", limit.name, limit) for limit in problem.limits),
        )

    def _measure(
        self, measure: Measure, role: str, name: str, limit: Limit | None = None, weight: float = 1.0
    ) -> DisplayedMeasure:
        stays = not depends(measure.channel, self.kinds, self.model.problem)
        follows = (measure.is_mass or measure.is_load) and is_affine(measure.channel, self.kinds, self.model.problem)
        follows = follows and measure.norm.name in NORMS_OF_PAGE
        self.queries.append(measure if follows and not stays else None)
        sides = () if limit is None else sides_of(limit)
        norm = measure.norm
        base = DisplayedMeasure(role, name, measure.unit, norm.name, norm.refinement, None, weight, sides)
        if stays and limit is None:
            return replace(base, value=self.model.bare.value(measure))
        if stays and limit is not None:
            limit_state = self.model.bare.check_limit(limit)
            return replace(base, sides=((limit_state.side, limit_state.edge),), value=limit_state.value)
        if follows:
            return replace(base, signal=self.signal(measure))
        self.without_slider.append((name, self.aside))
        base = replace(base, followed=False, value=math.nan)
        if (limit_value := self.decided.get(name)) is None:
            return base
        return replace(base, value=limit_value.value, sides=((limit_value.side, limit_value.limit),))


def sides_of(limit: Limit) -> tuple[tuple[str, float], ...]:
    """Return sense and bound of each finite side of a limit [SI]."""
    sides = (("at least", limit.minimum), ("at most", limit.maximum))
    return tuple((sense, edge) for sense, edge in sides if math.isfinite(edge))


def _slider(domain: Domain, problem: Problem) -> Slider:
    decision, domain_set = domain.decision, domain.set
    return Slider(
        decision.name, decision.unit, domain.start, domain.width, domain_set.lower, domain_set.upper, domain_set.angles,
        decision.angle_name, *_unit(problem, decision),
    )  # fmt: skip


def _unit(problem: Problem, decision: Decision) -> tuple[str, float]:
    if problem.origin is not None:
        with suppress(Refused, units.UnitError):
            unit = edits.unit_of_bounds(problem.origin.tables, decision.name)
            if unit:
                return unit, 1.0 / units.parse(f"1 {unit}", decision.unit)
    return units.readable(decision.unit)


def _between(domains: Sequence[Domain]) -> Array:
    parts = [np.zeros(0)]
    for k, domain in enumerate(domains):
        low, high = domain.set.lower, domain.set.upper
        size = low + (0.31 + 0.37 * ((0.618 * k) % 1.0)) * (high - low)
        first, last = domain.set.angles
        angle = first + 0.41 * (last - first)
        parts.append(np.array([size * math.cos(angle), size * math.sin(angle)] if domain.width > 1 else [size]))
    return np.concatenate(parts)


def _design(
    x: Array, slider_problem: Problem, domains: Sequence[Domain], measures: Sequence[Measure | None]
) -> dict[str, Any]:
    evaluation = evaluate(slider_problem, slider_problem.design([domain.complex_value(x) for domain in domains]))
    values = (None if measure is None else float(evaluation.value(measure)) for measure in measures)
    return {"x": x.tolist(), "measured": [*map(or_none, values)]}


def _reference(result: Result) -> dict[str, Any] | None:
    # there is no design for comparison if another objective was bounded
    if result.problem.extras or not result.decisions:
        return None
    certificate, objective = result.certificate, result.objective
    if certificate is None or objective is None or certificate.kind is Proof.NONE:
        return None
    if result.ranks:
        first = result.ranks[0]
        return reference_of(first.minimum, first.proof, first.gap)
    return reference_of(objective.value, certificate.kind, certificate.gap)


def reference_of(value: float, proof: Proof, gap: float) -> dict[str, Any]:
    """Return a design for comparison: its objective [SI], and a name that says how it is proven."""
    names = {Proof.GLOBAL: "the proven optimum", Proof.WITHIN_GAP: f"the best design found (gap {share(gap)})"}
    name = names.get(proof, "the best design found (a local optimum)")
    return {"value": value, "name": name, "is_proven": proof is Proof.GLOBAL}


def _without_slider(problem: Problem, how: str) -> Iterator[tuple[str, str]]:
    names = problem.phasing.open_names if problem.phasing is not None else ()
    yield from ((name, f"the crank star has no slider here; {how}") for name in names)
    for decision in problem.decisions:
        if not decision.is_affine:
            yield decision.name, f"no slider here, because forces are not affine in this number; {how}"
    for extra in problem.extras:
        why = f"shown for the drawing, without {extra.words}; the optimum of the whole problem is not compared"
        yield from ((name, why) for name in extra.open_names or (problem.objective_name,))
