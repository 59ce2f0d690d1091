"""Every entry of the table of dependences, sampled on random engines. Samples refute an entry and never prove it.

Engines are the ready ones with random masses, unbalances and speeds; what is open stands at random places within its
bounds. SMOOTH claims nothing that three samples could refute, and MASSES and SWING follow from AFFINE and SHIFT of
what they are made of. Stars are drawn of what is open of throws and firing orders.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

import laufruhe
from laufruhe.errors import LaufruheError
from laufruhe.problem.channels import CHANNELS, Channel, LoadChannel, NumberChannel
from laufruhe.problem.decision import Decision, Kind, domains_of
from laufruhe.problem.dependence import Dependence, dependence
from laufruhe.problem.evaluation import Evaluation, evaluate
from laufruhe.problem.measure import Measure, mass_rows
from laufruhe.problem.problem import Problem
from problem_files import PROBLEMS

ROUNDING = 1e-9
STEPS = 60
FEW = ("car-four-willans", "tractor-four-elastic", "single-rod-length", "tractor-four-bearings", "soft-single")


def _random(problem: Problem, rng: np.random.Generator) -> Problem:
    """Return the problem of an engine of other masses and unbalances, at other speeds."""
    engine = problem.engine
    rotors = tuple(replace(r, unbalance=r.unbalance * complex(*rng.uniform(0.5, 1.5, 2))) for r in engine.rotors)
    points = tuple(replace(point, speed=point.speed * float(rng.uniform(0.7, 1.1))) for point in problem.points)
    fidelity = replace(problem.fidelity, samples=360)
    found = replace(problem, engine=replace(engine, rotors=rotors), points=points, fidelity=fidelity)
    return replace(found, ranks=(), over=None, assembly=None)


def _values(decision: Decision, shares: np.ndarray) -> complex | float:
    """Return the value at these shares of the bounds of a decision."""
    (domain,) = domains_of([decision])
    low, high = domain.ends
    columns = low + shares[: domain.width] * (high - low)
    value = domain.complex_value(domain.project(columns) if domain.width > 1 else columns)
    return value if decision.is_affine else value.real


def _numbers(channel: Channel, evaluation: Evaluation) -> np.ndarray | None:
    """Return what a channel has of a design, of a load its signals at equal steps; None where it means nothing."""
    try:
        if isinstance(channel, LoadChannel):
            base = evaluation.engine.cycle.base_order
            signals = [signal.over(base) for signal in evaluation.signals(channel)]
            return np.concatenate([signal.series.sample(STEPS).ravel() for signal in signals])
        if isinstance(channel, NumberChannel):
            return np.array(channel.values(Measure(channel, frequency=(5.0, 15.0)), evaluation), dtype=float)
        return mass_rows(Measure(channel), evaluation.engine.rotors, evaluation.engine.slider_cranks).vectors.ravel()
    except (LaufruheError, ValueError, TypeError, AttributeError, IndexError):
        return None


def _sampled(problem: Problem, kind: Kind, rng: np.random.Generator) -> tuple[Problem, list[Evaluation]]:
    """Return three designs at equal steps along a random line of the decisions of one kind, all others held."""
    own = tuple(decision for decision in problem.decisions if decision.kind is kind)
    held = [d for d in problem.decisions if d.kind is not kind]
    middle = [_values(d, rng.uniform(0.2, 0.8, 2)) for d in held]
    found = replace(problem, engine=problem.design(middle, held), decisions=own)
    # along one number: two of a kind may be multiplied by each other
    chosen = int(rng.integers(len(own))) if kind not in (Kind.UNBALANCE, Kind.SHARE, Kind.PISTON) else None
    base, step = rng.uniform(0.15, 0.4, (len(own), 2)), rng.uniform(0.1, 0.2, (len(own), 2))
    step = step if chosen is None else np.where(np.arange(len(own))[:, None] == chosen, step, 0.0)
    designs = [[_values(d, b + k * s) for d, b, s in zip(own, base, step, strict=True)] for k in range(3)]
    return found, [evaluate(found, found.design(design)) for design in designs]


def refuted(claim: Dependence, at: Sequence[np.ndarray]) -> bool:
    """Return whether three samples at equal steps refute what is claimed."""
    a, b, c = at
    size = max(float(np.abs(each).max(initial=0.0)) for each in at)
    room = ROUNDING * max(size, 1e-9)
    if claim is Dependence.NONE:
        return bool(np.abs(b - a).max(initial=0.0) > room or np.abs(c - a).max(initial=0.0) > room)
    if claim in (Dependence.AFFINE, Dependence.BIAFFINE):
        return bool(np.abs(a - 2.0 * b + c).max(initial=0.0) > room)
    if claim is Dependence.CONVEX:
        return bool((2.0 * b - a - c).max(initial=0.0) > room)
    if claim is Dependence.MONOTONE_UP:
        return bool(min((b - a).min(initial=0.0), (c - b).min(initial=0.0)) < -room)
    if claim is Dependence.MONOTONE_DOWN:
        return bool(max((b - a).max(initial=0.0), (c - b).max(initial=0.0)) > room)
    return False


def _entries(
    names: Sequence[str], rounds: int, kinds: Sequence[Kind] = tuple(Kind)
) -> Iterator[tuple[str, Channel, Kind, Dependence, list[np.ndarray]]]:
    """Yield samples of every entry that a ready engine has something of."""
    for number, name in enumerate(names):
        problem = laufruhe.load(PROBLEMS / f"{name}.toml")
        rng = np.random.default_rng(number)
        for kind in sorted({d.kind for d in problem.decisions} & set(kinds)):
            for _ in range(rounds):
                try:
                    own, evaluations = _sampled(_random(problem, rng), kind, rng)
                except LaufruheError:
                    continue
                for channel in CHANNELS.values():
                    at = [_numbers(channel, evaluation) for evaluation in evaluations]
                    if all(each is not None and np.all(np.isfinite(each)) for each in at):
                        told = [each for each in at if each is not None]
                        if len({len(each) for each in told}) == 1:
                            yield name, channel, kind, dependence(channel, kind, own), told


def _check(names: Sequence[str], rounds: int) -> set[tuple[str, Kind]]:
    """Return the entries that were sampled; fail where one is refuted."""
    seen: set[tuple[str, Kind]] = set()
    wrong = []
    for name, channel, kind, claim, at in _entries(names, rounds):
        seen.add((channel.name, kind))
        if refuted(claim, at):
            wrong.append(f"{channel} by {kind.name} of {name} is not {claim}")
    assert not wrong, "\n".join(dict.fromkeys(wrong))
    return seen


def ready_names() -> list[str]:
    """Return the names of the ready problems that leave numbers open."""
    files = sorted(PROBLEMS.glob("*.toml"))
    texts = {path.stem: path.read_text() for path in files}
    return [name for name, text in texts.items() if "study" not in tomllib.loads(text) and "between" in text]
