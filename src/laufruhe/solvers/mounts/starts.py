"""Start points for a search of mounts: their evaluation by the exact model, and the best of a Latin hypercube."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from laufruhe.errors import ModelError
from laufruhe.load_models.simulated import COARSE_STEP, Peaks, peaks_of, simulated_measures
from laufruhe.numerics.arrays import Array
from laufruhe.numerics.budget import limit_time, seconds_left, until_time_limit
from laufruhe.problem.decision import domains_of, projected_vector, real_bounds
from laufruhe.problem.evaluation import Evaluation, objective_value, with_mounts
from laufruhe.problem.mount_resonance import evaluate_start, off_resonance
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.solvers.conclusion import Design, evaluate_design, unbalance_values
from laufruhe.solvers.cones.unbalances import solve_unbalances
from laufruhe.solvers.result import Result

# largest number of starts per open number, and candidates per start, which cost about as much as a search
STARTS = 4
POOL = 16
# relative gap of the unbalances of starts
START_TOLERANCE = 1e-2
# share of the remaining time for the evaluation of candidates
POOL_TIME = 0.25
# factor of the number of candidates with simulated measures, which have many local optima
SIMULATED_POOL = 4
# weight of violations with simulated measures, which most designs violate
VIOLATION_WEIGHT = 10.0
# samples per cycle and number of orders for the evaluation of candidates
POOL_SAMPLES, POOL_ORDERS = 72, 18

StartPoint: TypeAlias = tuple[list[float], Array | None]
"""Numbers of the mounts [SI], and columns of the unbalances [kg m], or None for those of the best design."""


def evaluate_design_at(problem: Problem, mounts: Iterable[float], unbalances: Iterable[Value]) -> Design | None:
    """Return the exact evaluation of a design with these mounts and unbalances; None on an undamped resonance."""
    inner, outer = iter(mounts), iter(unbalances)
    try:
        return evaluate_design(problem, [next(outer) if d.is_affine else next(inner) for d in problem.decisions])
    except ModelError:
        return None


def design_at_start(problem: Problem, start: tuple[list[float], Array]) -> Design | None:
    """Evaluate the design at a start, mounts and columns of unbalances; None on an undamped resonance."""
    unbalances = (domain.complex_value(start[1]) for domain in domains_of(problem.unbalances))
    return evaluate_design_at(problem, start[0], unbalances)


def _most_starts(problem: Problem) -> int:
    width = len(problem.mount_decisions) + sum(domain.width for domain in domains_of(problem.unbalances))
    return min(problem.search.starts, STARTS * width)


def spread_starts(lower: Array, upper: Array, count: int, seed: int = 0) -> Array:
    """Return the points of a Latin hypercube between bounds of shape (n,), shape (count, n)."""
    generator = np.random.default_rng(seed)
    cells = np.array([generator.permutation(count) for _ in lower]).T.reshape(count, len(lower))
    return lower + (cells + generator.random(cells.shape)) / count * (upper - lower)


def start_of_result(problem: Problem, result: Result) -> tuple[list[float], Array]:
    """Return the mounts of a result [SI] and its columns of unbalances [kg m], shape (columns,)."""
    values = {decision.name: decision.value for decision in result.decisions}
    mounts = [values[decision.name] for decision in problem.mount_decisions]
    return mounts, projected_vector(domains_of(problem.unbalances), unbalance_values(problem, result))


def _initial_balance(problem: Problem) -> list[complex] | None:
    if not problem.unbalances or not problem.load_terms:
        return None
    result = solve_unbalances(
        replace(off_resonance(problem).balance, tolerance=max(problem.tolerance, START_TOLERANCE))
    )
    return unbalance_values(problem, result) if result.decisions else None


def start_points(problem: Problem) -> tuple[list[tuple[list[float], Array]], float]:
    """Return start points of a mount search (numbers of mounts, unbalances), and a unit of the objective [SI].

    The first start is the initial design. The others are spread over all bounds, stiffnesses on a logarithmic scale.
    The unit is the smallest positive objective of all candidates: the solver's tolerance is relative to it.
    """
    domains, decisions = domains_of(problem.unbalances), problem.mount_decisions
    initial = evaluate_start(problem)
    # no search starts on a resonance
    count = _most_starts(problem) - (not initial.resonance)
    pool = _spread_over(problem) if count else np.zeros((0, len(decisions)))
    # higher orders hardly move the block, but take most of the time
    loads = tuple(replace(load, wrench=load.wrench.series.truncated(POOL_ORDERS)) for load in initial.loads)
    coarse = replace(initial, samples=POOL_SAMPLES, resonance="", loads=loads)
    unbalances = _initial_balance(problem)
    with limit_time(POOL_TIME * seconds_left()):
        scored = _scores(problem, coarse, pool)
    best = projected_vector(domains, [d.start for d in problem.unbalances] if unbalances is None else unbalances)
    starts = [] if initial.resonance else [([d.real_start for d in decisions], best)]
    if not count:
        return starts, objective_value(problem, initial) or 1.0
    rows, unit = _promising(problem, initial, pool, scored, count)
    for k, row in enumerate(rows):
        columns = row[len(decisions) :].copy()
        for domain in domains:
            columns[domain.columns] = domain.project(columns)
        starts.append((row[: len(decisions)].tolist(), columns if k % 2 else best))
    return starts, unit


def _spread_over(problem: Problem) -> Array:
    # shape (points, mounts and columns of unbalances)
    domains, decisions = domains_of(problem.unbalances), problem.mount_decisions
    ratio = np.array([d.is_stiffness and d.lower > 0.0 for d in decisions], dtype=bool)
    low, high = real_bounds(decisions)
    low_log, high_log = (np.where(ratio, np.log(np.where(ratio, v, 1.0)), v) for v in (low, high))
    scales = np.concatenate([domain.scale * np.ones(domain.width) for domain in domains] or [np.zeros(0)])
    ends = np.concatenate([low_log, -scales]), np.concatenate([high_log, scales])
    count = POOL * (_most_starts(problem) + 1) * (SIMULATED_POOL if simulated_measures(problem) else 1)
    points, n = spread_starts(*ends, count, problem.search.seed), len(low)
    points[:, :n] = np.where(ratio, np.exp(np.where(ratio, points[:, :n], 0.0)), points[:, :n])
    points[:, :n] = np.clip(points[:, :n], low, high)
    return points


def _promising(problem: Problem, initial: Evaluation, pool: Array, scored: Array, count: int) -> tuple[Array, float]:
    # two thirds are the best candidates of the pool, the other third is its first
    violations, values = scored.T
    finite = values[np.isfinite(values)]
    middle = float(np.median(finite)) if len(finite) else 0.0
    best = np.argsort(violations + values / (middle or 1.0), kind="stable")
    indices = list(best[: count - count // 3])
    indices += [k for k in range(len(pool)) if k not in set(indices)][: count - len(indices)]
    initial_value = math.inf if initial.resonance else objective_value(problem, initial)
    minimum = min((float(v) for v in (*finite, initial_value) if 0.0 < v < math.inf), default=1.0)
    return pool[indices], minimum


def _scores(problem: Problem, coarse: Evaluation, points: Array) -> Array:
    """Return the sum of violated limits and the objective [SI] of each candidate start, shape (points, 2).

    Points not evaluated in time have infinite rows.
    """
    if not len(points):
        return np.zeros((0, 2))
    count = len(problem.mount_decisions)
    # unbalances may still change, so ignore limits on loads if some are open
    limits = problem.mount_limits if problem.unbalances else problem.limits
    plain = problem.changed(objective=tuple(term for term in problem.objective if not term.measure.channel.simulation))
    limits = tuple(limit for limit in limits if not limit.measure.channel.simulation)
    peaks = peaks_of(problem, COARSE_STEP, is_coarse=True)
    scores = np.full((len(points), 2), math.inf)
    for k, row in until_time_limit(enumerate(points)):
        try:
            design = with_mounts(coarse, problem.design(row[:count].tolist(), problem.mount_decisions))
        except ModelError:
            continue
        excess = sum(max(design.check_limit(limit).violation, 0.0) for limit in limits)
        value = objective_value(plain, design)
        if peaks is not None and peaks.is_known:
            violation, objective = _peak_scores(problem, peaks, row)
            excess, value = VIOLATION_WEIGHT * (excess + violation), value + objective
        scores[k] = excess, value
    return scores


def _peak_scores(problem: Problem, peaks: Peaks, row: Array) -> tuple[float, float]:
    # sum of violations of limits on peaks, and their share of the objective
    parts = np.split(peaks.values(row), np.cumsum(peaks.counts)[:-1])
    maximum = dict(zip(simulated_measures(problem), map(np.max, parts), strict=True))
    excesses = (float(maximum[x.measure]) / (x.maximum or 1.0) - 1.0 for x in problem.limits if x.measure in maximum)
    terms = (term.weight * float(maximum[term.measure]) for term in problem.objective if term.measure in maximum)
    return sum(max(excess, 0.0) for excess in excesses), sum(terms)
