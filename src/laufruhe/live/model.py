"""What a page needs to show any design of a problem by itself: loads that are affine in what is open (P1).

The numbers are those of `AffineModel`, the norms are named, and the page takes them as results do. What no such
map says is named, never left out without a word.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from laufruhe import units
from laufruhe.errors import ModelError
from laufruhe.files import edits
from laufruhe.files.complaints import Refused
from laufruhe.live.parts import Curve, Design, LiveModel, Reference, Shown, Slider
from laufruhe.live.saving import saved
from laufruhe.live.signals import NORMS_OF_PAGE, Signal, signal_of
from laufruhe.load_models.affine import AffineModel
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.norms import MEAN
from laufruhe.present.measures import places_of
from laufruhe.problem.channels import CHANNELS
from laufruhe.problem.decision import Decision, Domain, Kind, vector_of
from laufruhe.problem.dependence import depends, is_affine
from laufruhe.problem.evaluation import evaluate
from laufruhe.problem.measure import Limit, Measure
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.certificate import Proof
from laufruhe.solvers.prices import angle_name
from laufruhe.solvers.result import Result

ON_BLOCK = ("shaking force", "rocking couple", "roll moment")
HOW, HERE = "laufruhe page {file} follows it", "decided here, or moved beside"
OBJECTIVE = "objective"
NOTHING = "Nothing that is open here can be moved live."


def live_model(problem: Problem, result: Result, is_served: bool = False) -> LiveModel:
    """The page's model of a problem.

    Parameters
    ----------
    problem
        As it was read.
    result
        Of it, solved or evaluated: what is not affine stays as it is there.
    is_served
        Whether the page has a server, which decides and measures what does not follow.
    """
    file = f"{problem.name}.toml"
    bare = LiveModel(
        problem.name, problem.title, file, tuple(point.name for point in problem.points), problem.engine.cycle.turns,
        objective=result.problem.drawing.objective_name, unit=result.problem.objective_unit or "",
    )  # fmt: skip
    values = decided(result.problem, {entry.name: entry.value for entry in result.decisions})
    how = HERE if is_served else HOW.format(file=file)
    moving = _moving(result.problem, values)
    still = tuple(_still(result.problem, how))
    bare = replace(bare, unmoved=still, why_not="" if moving.decisions else NOTHING)
    try:
        found = _filled(bare, problem, moving, result, values, is_served)
    except ModelError as error:
        return replace(bare, why_not=f"The loads cannot be shown while decisions move: {error}.")
    return replace(found, save=saved(problem, result, moving, values))


def decided(problem: Problem, shown: Mapping[str, float]) -> dict[str, Value]:
    """Values of all decisions by name, from sizes and angles as results show them; where there is none, the start."""
    found: dict[str, Value] = {}
    for decision in problem.decisions:
        if decision.name not in shown:
            found[decision.name] = decision.start
        elif decision.is_affine and decision.set.width > 1:
            found[decision.name] = shown[decision.name] * cmath.exp(1j * shown[angle_name(decision)])
        else:
            unit = decision.set.directions[0]
            found[decision.name] = shown[decision.name] * (unit if decision.is_affine else 1.0)
    return found


def _moving(problem: Problem, values: Mapping[str, Value]) -> Problem:
    """The drawing, all but what loads are affine in fixed as it was decided."""
    fixed = [decision for decision in problem.decisions if not decision.is_affine]
    held = problem.fixed_at([values[decision.name] for decision in fixed], fixed)
    return replace(held, phasing=None, extras=())


def _filled(
    bare: LiveModel, problem: Problem, moving: Problem, result: Result, values: Mapping[str, Value], is_served: bool
) -> LiveModel:
    model = AffineModel(moving)
    kinds = {decision.kind for decision in moving.decisions}
    # where the value of a measure is known that the page cannot follow
    known = "it is measured when sliders rest" if is_served else f"its value is that of the design decided; {HOW}"
    aside = f"cannot be followed live; {known.format(file=bare.file)}"
    collected = _Collected(model, kinds, result, aside)
    curves = _curves(collected, result)
    measures = collected.measures()
    start = vector_of(model.domains)
    designs = [("given", start)]
    if result.decisions:
        designs.append(("optimum", vector_of(model.domains, [values[d.name] for d in moving.decisions])))
    designs.append(("between", _between(model.domains)))
    return replace(
        bare,
        sliders=tuple(_slider(domain, problem) for domain in model.domains),
        signals=tuple(collected.signals.values()),
        curves=curves,
        measures=measures,
        designs=tuple(_design(name, x, moving, model.domains, collected.asked) for name, x in designs),
        reference=None if is_served else _reference(result),
        unmoved=(*bare.unmoved, *collected.unmoved),
    )


class _Collected:
    """Signals of a problem, each once, and what of its measures they say."""

    def __init__(self, model: AffineModel, kinds: set[Kind], result: Result, aside: str) -> None:
        self.model, self.kinds, self.aside = model, kinds, aside
        self.decided = {found.name: found for found in result.limits}
        self.signals: dict[Measure, Signal] = {}
        self.unmoved: list[tuple[str, str]] = []
        self.asked: list[Measure | None] = []

    def signal(self, measure: Measure) -> int:
        """Number of the signal whose norm a measure is; one for all norms."""
        key = replace(measure, norm=MEAN)
        if key not in self.signals:
            self.signals[key] = signal_of(self.model, key)
        return list(self.signals).index(key)

    def measures(self) -> tuple[Shown, ...]:
        """Terms of the objective, of later ones, and limits."""
        problem, found = self.model.problem, []
        for term in problem.objective:
            found += self._shown(term.measure, OBJECTIVE, term.measure.name, weight=term.weight)
        for rank in problem.ranks[1:]:
            for term in rank.terms:
                found += self._shown(term.measure, "rank", term.measure.name)
        for limit in problem.limits:
            found += self._shown(limit.measure, "limit", limit.name, limit)
        return tuple(found)

    def _shown(
        self, measure: Measure, role: str, name: str, limit: Limit | None = None, weight: float = 1.0
    ) -> list[Shown]:
        stays = not depends(measure.channel, self.kinds, self.model.problem)
        follows = (measure.is_mass or measure.is_load) and is_affine(measure.channel, self.kinds, self.model.problem)
        follows = follows and measure.norm.name in NORMS_OF_PAGE
        self.asked.append(measure if follows and not stays else None)
        base = Shown(role, name, measure.unit, measure.norm.name, measure.norm.refinement, None, weight, _sides(limit))
        if stays and limit is None:
            return [replace(base, value=self.model.bare.value(measure))]
        if stays and limit is not None:
            found = self.model.bare.standing(limit)
            return [replace(base, sides=((found.side, found.edge),), value=found.value)]
        if follows:
            return [replace(base, signal=self.signal(measure))]
        self.unmoved.append((name, self.aside))
        known = self.decided.get(name)
        base = replace(base, followed=False, value=math.nan)
        return [replace(base, value=known.value, sides=((known.side, known.limit),)) if known else base]


def _sides(limit: Limit | None) -> tuple[tuple[str, float], ...]:
    if limit is None:
        return ()
    sides = (("at least", limit.minimum), ("at most", limit.maximum))
    return tuple((sense, edge) for sense, edge in sides if math.isfinite(edge))


def _curves(collected: _Collected, result: Result) -> tuple[Curve, ...]:
    """Forces on mounts and bearings, and what the block feels."""
    forces = [(places.title, places.channel) for places in places_of(result) if places.channel.feels_unbalances]
    block = [(name.capitalize(), CHANNELS[name]) for name in ON_BLOCK]
    return tuple(Curve(title, collected.signal(Measure(channel))) for title, channel in (*forces, *block))


def _slider(domain: Domain, problem: Problem) -> Slider:
    decision, own = domain.decision, domain.set
    return Slider(
        decision.name, decision.unit, domain.start, domain.width, own.lower, own.upper, own.angles,
        angle_name(decision), *_unit(problem, decision),
    )  # fmt: skip


def _unit(problem: Problem, decision: Decision) -> tuple[str, float]:
    """The unit that the file has, else that of reports, and its factor on an SI value."""
    if problem.origin is not None:
        with suppress(Refused, units.UnitError):
            own = edits.unit_of_bounds(problem.origin.file[0], decision.name)
            if own:
                return own, 1.0 / units.parse(f"1 {own}", decision.unit)
    return units.readable(decision.unit)


def _between(domains: Sequence[Domain]) -> Array:
    """Somewhere inside, in no special place."""
    parts = [np.zeros(0)]
    for k, domain in enumerate(domains):
        low, high = domain.set.lower, domain.set.upper
        size = low + (0.31 + 0.37 * ((0.618 * k) % 1.0)) * (high - low)
        first, last = domain.set.angles
        angle = first + 0.41 * (last - first)
        parts.append(np.array([size * math.cos(angle), size * math.sin(angle)] if domain.width > 1 else [size]))
    return np.concatenate(parts)


def _design(name: str, x: Array, moving: Problem, domains: Sequence[Domain], asked: Sequence[Measure | None]) -> Design:
    found = evaluate(moving, moving.design([domain.complex_value(x) for domain in domains]))
    told = (None if measure is None else float(found.value(measure)) for measure in asked)
    return Design(name, tuple(map(float, x)), tuple(told))


def _reference(result: Result) -> Reference | None:
    """Return what the objective is compared with as it is shown; None where another one was bounded."""
    if result.problem.extras or not result.decisions:
        return None
    certificate, objective = result.certificate, result.objective
    if certificate is None or objective is None or certificate.kind is Proof.NONE:
        return None
    if result.ranks:
        first = result.ranks[0]
        return Reference.of(first.least, first.proof, first.gap)
    return Reference.of(objective.value, certificate.kind, certificate.gap)


def _still(problem: Problem, how: str) -> Iterator[tuple[str, str]]:
    """What is open and has no slider, and why."""
    names = problem.phasing.open_names if problem.phasing is not None else ()
    yield from ((name, f"stars are chosen and not slid, so the one decided stays; {how}") for name in names)
    for decision in problem.decisions:
        if not decision.is_affine:
            yield decision.name, f"no slider here, because forces do not follow in proportion; {how}"
    for extra in problem.extras:
        why = f"shown of the drawing, without {extra.words}, so no optimum stands beside it"
        yield from ((name, why) for name in extra.open_names or (problem.objective_name,))
