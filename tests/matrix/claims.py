"""Claims that every combination must meet: one line refuses it, or every claim of its result is true."""

from __future__ import annotations

import math
import random
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import laufruhe
from laufruhe.errors import InputError, ModelError
from laufruhe.extensions.flywheel.machine import Flywheel
from laufruhe.extensions.speed_ranges.peaks import RangeResponses
from laufruhe.extensions.speed_ranges.ranges import SpeedRanges, at_speeds
from laufruhe.machine import Engine
from laufruhe.problem.evaluation import Evaluation, evaluate, objective_value
from laufruhe.problem.numerical_zero import numerical_zero
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof, gap_of, gap_tolerance_of, relative_gap
from laufruhe.solvers import Result, Status
from matrix.cells import Document, Open, OpenThrows, document_of, written

TRIES, FINE, SPEEDS = 24, 2880, 20
# relative excess over a limit at which a design that is told counts as allowed, and one that is set against it
ALLOWED, STRICTLY = 1e-5, 1e-9
# share of a value by which another way of computing it may differ
SAME = 1e-6


@dataclass(frozen=True)
class Verdict:
    """Verdict of one combination.

    Attributes
    ----------
    refused
        The line that refuses it.
    broken
        Claims that do not hold, in words.
    status, kind
        As the result says.
    """

    refused: str = ""
    broken: tuple[str, ...] = ()
    status: str = ""
    kind: str = ""


def evaluate_design(cell: Any, folder: Path) -> Verdict:
    """Return the verdict on a cell."""
    document = document_of(cell)
    path = folder / "problem.toml"
    path.write_text(written(document), encoding="utf-8")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            problem = laufruhe.load(path)
            result = laufruhe.solve(problem)
    except (InputError, ModelError) as error:
        said = str(error)
        return Verdict(said, () if said.strip() and len(said) < 400 else ("refused without a clear line",))
    except Exception as error:
        return Verdict(broken=(f"{type(error).__name__}: {error}",))
    kind = str(result.certificate.kind) if result.certificate else ""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            broken = tuple(_broken(document, _at_speeds(problem, result), result, folder))
        except (InputError, ModelError) as error:
            broken = (f"decided, and cannot be evaluated: {error}",)
    return Verdict(broken=broken, status=str(result.status), kind=kind)


def _at_speeds(problem: Problem, result: Result) -> Problem:
    """Return the problem with its speed ranges at many speeds, the peaks of the design among them."""
    extra = problem.extra(SpeedRanges)
    if extra is None:
        return problem
    speeds = {span.name: set(np.geomspace(span.low, span.high, SPEEDS).tolist()) for span in extra.ranges}
    for one in result.details.final if isinstance(result.details, RangeResponses) else ():
        speeds[one.span.name] |= set(one.speeds[one.tops].tolist())
    return at_speeds(problem, extra.ranges, {name: sorted(at) for name, at in speeds.items()})


def _broken(document: Document, problem: Problem, result: Result, folder: Path) -> Iterator[str]:
    others = list(_other_designs(document, problem, result, folder))
    if result.status is Status.FAILED:
        # a search that is not convex may end without a design, and is not contradicted by one
        if not _is_searched(problem) or any(allowed for _, allowed in others):
            yield f"failed: {result.message}"
        return
    if not _acts(document, problem):
        yield "a decision moves nothing"
    if result.status is Status.INFEASIBLE:
        if not result.conflict and not result.message:
            yield "infeasible without a reason"
        if any(allowed for _, allowed in others):
            yield "called infeasible, and a design is allowed"
        return
    if result.objective is None or result.certificate is None:
        yield "nothing was decided"
        return
    yield from _own_claims(document, problem, result, folder)
    bound, value = result.certificate.lower_bound, _evaluated(problem, result.final.engine, _fine(result))[0]
    best = min((other for other, allowed in others if allowed), default=math.inf)
    nothing = numerical_zero(problem, result.final.engine)
    # the design told is measured at its own angles
    missed = 2.0 * result.error_estimate * value
    if best < bound - gap_tolerance_of(value, SAME, nothing) - missed:
        yield f"a design of {best:.9g} lies under the bound {bound:.9g}"
    if (
        result.certificate.kind is Proof.GLOBAL
        and best < value - gap_tolerance_of(value, 2.0 * problem.tolerance, nothing) - missed
    ):
        yield f"called global at {value:.9g}, and {best:.9g} is allowed"


def _is_searched(problem: Problem) -> bool:
    """Return whether the problem has open mounts, a number that depends on loads, or throws off even steps.

    No program is convex then.
    """
    uneven = problem.phasing is not None and problem.phasing.continuous
    return (
        bool(problem.mount_decisions)
        or uneven
        or any(m.channel.is_number and m.channel.depends_on_loads for m in problem.measures)
    )


def _own_claims(document: Document, problem: Problem, result: Result, folder: Path) -> Iterator[str]:
    """Yield the claims of a result about its own design that do not hold."""
    objective, certificate = result.objective, result.certificate
    assert objective is not None
    assert certificate is not None
    value, nothing = objective.value, numerical_zero(problem, result.final.engine)
    if certificate.lower_bound > value * (1.0 + 1e-12):
        yield "its bound lies above its value"
    gap, still_open = (gap(value, certificate.lower_bound, nothing) for gap in (relative_gap, gap_of))
    if result.ranks:
        # the loss that later objectives may cause to the first is no gap
        gap = still_open = max(rank.gap for rank in result.ranks)
    if abs(gap - certificate.gap) > 1e-6 * (1.0 + gap):
        yield f"its gap is {gap:.3g}, and {certificate.gap:.3g} is told"
    if certificate.kind is Proof.GLOBAL and still_open > problem.tolerance * (1.0 + 1e-9):
        yield f"called global with a gap of {gap:.3g}"
    given = evaluate(problem, samples=result.final.samples)
    worth = objective_value(problem, given)
    fires = problem.phasing is None or problem.phasing.intervals.holds(problem.engine.firing_intervals)
    if fires and given.violation(problem.limits) <= ALLOWED and value > worth + gap_tolerance_of(value, SAME, nothing):
        yield f"worse than the design as given: {value:.9g} against {worth:.9g}"
    again = _at_speeds(_loaded(document, _values(result), _order(result), folder), result)
    found = evaluate(again, samples=result.final.samples)
    if abs(objective_value(again, found) - value) > gap_tolerance_of(value, 1e-5, nothing):
        yield f"its design is worth {objective_value(again, found):.9g}, and {value:.9g} is told"
    if found.violation(again.limits) > 2.0 * ALLOWED:
        yield f"its design breaks a limit by {found.violation(again.limits):.3g}"


def _values(result: Result) -> dict[str, float]:
    return {decision.name: decision.value for decision in result.decisions}


def _order(result: Result) -> list[int] | None:
    """Return the firing order decided with a star."""
    ranked = result.phasing.ranking if result.phasing is not None else ()
    return list(ranked[0].firing_orders[0].order) if ranked and ranked[0].firing_orders else None


def _loaded(document: Document, values: Mapping[str, float], order: list[int] | None, folder: Path) -> Problem:
    """Return the problem with values of open numbers, written and read; throws without a value follow the order."""
    document = {key: own for key, own in document.items() if key != "phasing"}
    if values.get("s built") == 0.0:
        # a shaft that is not built has no mass and no place
        values = {**values, "s.unbalance": 0.0}
        limits = document.get("constraints", [])
        document["constraints"] = [limit for limit in limits if limit["limit"] != "shaft distance"]
    if "balancer_shafts" in document:
        keys = ("optional", "shaft_mass")
        document["balancer_shafts"] = [
            {key: own for key, own in shaft.items() if key not in keys} for shaft in document["balancer_shafts"]
        ]
    engine = dict(document["engine"])
    if isinstance(engine.get("throws"), OpenThrows) and "throw 1" not in values:
        engine.pop("throws")
    if order is not None or engine.get("firing_order") == "open":
        engine["firing_order"] = order
    if engine.get("firing_order") is None:
        engine.pop("firing_order", None)
    path = folder / "decided.toml"
    path.write_text(written({**document, "engine": engine}, values), encoding="utf-8")
    return laufruhe.load(path)


def _opens(document: Any) -> Iterator[Any]:
    if isinstance(document, (Open, OpenThrows)):
        yield document
    elif isinstance(document, dict):
        for each in document.values():
            yield from _opens(each)
    elif isinstance(document, list):
        for each in document:
            yield from _opens(each)


def _drawn(document: Document, generator: random.Random) -> dict[str, float]:
    """Open numbers drawn between their bounds; a shaft that may be left out is built."""
    values: dict[str, float] = {}
    for own in _opens(document):
        if isinstance(own, Open):
            share = generator.choice([generator.random(), generator.random(), 0.0, 1.0])
            at = own.lower + share * (own.upper - own.lower)
            values[own.name] = math.radians(at) if own.unit == "deg" else at
        elif own.bounds:
            drawn = [0.0, *(math.radians(generator.uniform(*pair)) for pair in own.bounds)]
            values |= {f"throw {k + 1}": angle for k, angle in enumerate(drawn)}
    return values


def _other_designs(
    document: Document, problem: Problem, result: Result, folder: Path
) -> Iterator[tuple[float, bool]]:  # fmt: skip
    """Yield the objectives of the initial, drawn and neighbouring designs, and whether limits allow them."""
    generator, samples = random.Random(problem.title), _fine(result)
    found = evaluate(problem, samples=samples)
    if problem.phasing is None or problem.phasing.throws is not None:
        yield objective_value(problem, found), found.violation(problem.limits) <= STRICTLY
    held = _values(result)
    for k in range(TRIES):
        values = _drawn(document, generator)
        if held and k % 2:
            reach = 10.0 ** generator.uniform(-4.0, -0.5)
            values = {name: (1.0 - reach) * held.get(name, at) + reach * at for name, at in values.items()}
        if problem.phasing is not None:
            found = _of_star(document, values, result, generator, folder)
        else:
            engine = problem.design([_value(decision, values) for decision in problem.decisions])
            found = _evaluated(problem, engine, samples)
        if found is not None:
            yield found


def _of_star(
    document: Document, values: Mapping[str, float], result: Result, generator: random.Random, folder: Path
) -> tuple[float, bool] | None:
    """Return value and validity of another star and firing order: an even one if throws are open."""
    throws, order = document["engine"].get("throws"), None
    even = isinstance(throws, OpenThrows) and not throws.bounds
    if even or document["engine"].get("firing_order") == "open":
        count = len(result.initial.engine.cylinders)
        order = [1, *generator.sample(range(2, count + 1), count - 1)]
    try:
        other = _at_speeds(_loaded(document, values, order, folder), result)
    except (InputError, ModelError):
        return None
    phasing = result.problem.phasing
    if phasing is not None and not phasing.intervals.holds(other.engine.firing_intervals):
        return None
    return _evaluated(other, other.engine, _fine(result))


def _fine(result: Result) -> int:
    """Return the number of angles at which designs are compared: a bound holds for the whole cycle."""
    return max(result.final.samples, FINE)


def _evaluated(problem: Problem, engine: Engine, samples: int) -> tuple[float, bool]:
    """Return the objective of one design, infinite where it has no loads, and whether limits allow it."""
    try:
        evaluation = evaluate(problem, engine, samples)
        return objective_value(problem, evaluation), evaluation.violation(problem.limits) <= STRICTLY
    except ModelError:
        return math.inf, False


def _value(decision: Any, values: Mapping[str, float]) -> complex | float:
    """Return the value of a decision from its size and its angle."""
    size = values[decision.name]
    if decision.set.width == 1:
        return size * decision.set.directions[0] if decision.is_affine else size
    return size * complex(np.exp(1j * values[decision.name.rsplit(".", 1)[0] + ".angle"]))


def _acts(document: Document, problem: Problem) -> bool:
    """Return whether every open number changes loads, masses or the mounting of some design."""
    generator = random.Random(1)
    if problem.phasing is not None:
        return True
    for name in [own.name for own in _opens(document) if isinstance(own, Open)]:
        for _ in range(4):
            one = _drawn(document, generator)
            other = {**one, name: _drawn(document, generator)[name]}
            pair = [problem.design([_value(d, at) for d in problem.decisions]) for at in (one, other)]
            if _differ(*(evaluate(problem, engine) for engine in pair)):
                break
        else:
            return False
    return True


def _differ(one: Evaluation, other: Evaluation) -> bool:
    if one.engine.mounts != other.engine.mounts or one.engine.extra(Flywheel) != other.engine.extra(Flywheel):
        return True
    if any(a.unbalance != b.unbalance for a, b in zip(one.engine.rotors, other.engine.rotors, strict=True)):
        return True
    pairs = zip(one.loads, other.loads, strict=True)
    return any(not np.array_equal(a.wrench.coefficients, b.wrench.coefficients) for a, b in pairs)
