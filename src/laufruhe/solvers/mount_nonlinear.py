"""Mounts, and unbalances with them, from many starts; the best judged by the exact model."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from laufruhe.errors import ModelError
from laufruhe.load_models.throw_moves import ThrowMoves
from laufruhe.problem import channels
from laufruhe.problem.decision import domains_of
from laufruhe.problem.evaluation import Evaluation, evaluate, objective_value
from laufruhe.problem.measure import Measure, Term
from laufruhe.problem.mount_resonance import evaluate_start, off_resonance
from laufruhe.problem.nothing import nothing_of
from laufruhe.problem.phasing import Candidate
from laufruhe.problem.problem import Problem
from laufruhe.problem.sets import Value
from laufruhe.prove.certificate import Reach, room_of
from laufruhe.prove.subdivision import Divided, divided_bound, divides
from laufruhe.prove.transmitted_bound import transmitted_bound
from laufruhe.solvers.conclusion import FEASIBLE, KEPT, Design, Shown, concluded, judged, none_within
from laufruhe.solvers.mount_convex import CONVEX, is_convex, solve_convex_mounts
from laufruhe.solvers.mount_starts import columns_of, start_points, unbalances_of
from laufruhe.solvers.nonlinear import LocalOptimum, distinct, solve_nonlinear
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.smooth_program import SmoothProgram
from laufruhe.solvers.unbalances import solve_unbalances

Array = NDArray[np.float64]

SLACK = 1e-5
WORTH_SAYING = 1.01
MOST_MARGINS = 3
ITERATIONS = 150
MOST_AROUND = 3
# share of the size that a search counted in from which it is done again in a smaller one, and how often
SMALL = 1e-2
MOST_SIZES = 3
SPREAD = 0.4
# of the throws that a search starts from, about their star [rad]
NUDGE = 0.02


def solve_mounts(problem: Problem, workers: int | None = None) -> Result:
    """Convex where all that is asked is, else from many starts in `workers` processes."""
    return solve_convex_mounts(problem) if is_convex(problem) else solve_joint(problem, workers)


def solve_joint(problem: Problem, workers: int | None = None) -> Result:
    """The best local optimum that many starts find (E20-E24).

    Parameters
    ----------
    problem
        On elastic mounts; `search.starts` points are started from.
    workers
        Processes; as many as processors when left out.

    Raises
    ------
    SolverError
        If a process of the solver dies.
    """
    return _solved(problem, workers, None, None)[0]


def solve_moved(problem: Problem, moves: ThrowMoves, even: Result | None) -> tuple[Result, Candidate]:
    """As `solve_joint`, with throws that may leave the star of the problem; and where they were moved to (E36).

    Parameters
    ----------
    problem
        Of the star.
    moves
        What may move.
    even
        Result of the star itself, to start from first.
    """
    first = None
    if even is not None and even.decisions:
        found = {decision.name: decision.value for decision in even.decisions}
        domains = domains_of(problem.unbalances)
        mounts = [found[decision.name] for decision in problem.mount_decisions]
        first = mounts, columns_of(domains, unbalances_of(problem, even))
    result, turns = _solved(problem, None, moves, first)
    return result, moves.candidate(turns)


def _solved(
    problem: Problem, workers: int | None, moves: ThrowMoves | None, first: tuple[list[float], Array] | None
) -> tuple[Result, Array]:
    """Result, and deviations of the throws."""
    started = time.perf_counter()
    initial = evaluate_start(problem)
    points, size = start_points(problem)
    points = points if first is None else [first, *points[1:]]
    joint = SmoothProgram(problem, size, moves=moves)
    modelled = time.perf_counter()
    optima = _searched(problem, joint, points, workers)
    best, design = _first_allowed(joint, optima)
    nothing = nothing_of(problem)
    for _ in range(MOST_SIZES):
        if best is None or design is None or design.value >= SMALL * size or size <= nothing:
            break
        # a search ends at a share of the size that it counts in: again, beside what was found
        size = max(design.value, nothing)
        joint = SmoothProgram(problem, size, moves=moves)
        mounts, _ = joint.split(best.x)
        optima = _searched(problem, joint, [(mounts, _columns(joint, best.x)), *points[1:]], workers)
        best, design = _first_allowed(joint, optima)
    if design is not None and design.excess > FEASIBLE:
        best, design = _tightened(problem, joint, best, design)
    timing = {"model": modelled - started, "solve": time.perf_counter() - modelled}
    if best is None or design is None:
        return _none(problem, joint, initial, optima, timing), np.zeros(0 if moves is None else moves.size)
    proven = _rebalanced(design)
    design = design if proven is None or proven[0].value >= design.value else proven[0]
    return _result(problem, joint, initial, design, best, optima, proven, timing), joint.turns(best.x)


def _searched(
    problem: Problem, joint: SmoothProgram, points: Sequence[tuple[list[float], Array]], workers: int | None
) -> tuple[LocalOptimum, ...]:
    """Local optima from the points, and from others drawn around the best of them."""
    generator = np.random.default_rng(problem.search.seed)
    starts = [joint.start(mounts, columns, _nudged(joint, generator, k)) for k, (mounts, columns) in enumerate(points)]
    optima = solve_nonlinear(joint.program, starts, workers, ITERATIONS)
    around = distinct(optima, max(abs(optima[0].value), 1e-12), 1e-3)[:MOST_AROUND]
    if not around or len(points) < 2:
        return optima
    decisions = problem.mount_decisions
    low, high = (np.array([getattr(d, side) for d in decisions]) for side in ("lower", "upper"))
    again = []
    for k in range(max(len(points) // 2, 1)):
        x = around[k % len(around)].x
        found = np.array(joint.split(x)[0])
        mounts = found + SPREAD * generator.normal(size=len(low)) * np.minimum(high - low, np.abs(found))
        again.append(joint.start(np.clip(mounts, low, high).tolist(), _columns(joint, x), joint.turns(x)))
    more = solve_nonlinear(joint.program, again, workers, ITERATIONS)
    moved = [replace(optimum, start=optimum.start + len(points)) for optimum in more]
    return tuple(sorted((*optima, *moved), key=lambda o: (not o.usable, o.value if o.usable else o.violation, o.start)))


def _columns(joint: SmoothProgram, x: Array) -> Array:
    """Of the unbalances, as the program has them."""
    first = len(joint.problem.mount_decisions)
    return x[first : first + joint.columns]


def _nudged(joint: SmoothProgram, generator: np.random.Generator, k: int) -> Array:
    """Throws to start from: on their star first, then beside it, for a star that is its own image may be a saddle."""
    if joint.moves is None or k == 0:
        return joint.turns(np.zeros(joint.program.x.numel()))
    nudge = NUDGE * generator.normal(size=joint.moves.size)
    return np.clip(nudge, joint.moves.lower, joint.moves.upper)


def _judged(problem: Problem, mounts: list[float], unbalances: list[complex]) -> Design | None:
    found = iter(mounts), iter(unbalances)
    values: list[Value] = [next(found[1]) if decision.is_affine else next(found[0]) for decision in problem.decisions]
    try:
        return judged(problem, values)
    except ModelError:
        # a resonance without damping is no design
        return None


def _mounts(design: Design) -> list[float]:
    pairs = zip(design.problem.decisions, design.values, strict=True)
    return [value.real for decision, value in pairs if not decision.is_affine]


def _first_allowed(joint: SmoothProgram, optima: Sequence[LocalOptimum]) -> tuple[LocalOptimum | None, Design | None]:
    """The best optimum by the exact model: within limits first, then by value."""
    found = []
    for optimum in optima:
        if optimum.usable:
            design = _judged(joint.designed(optimum.x), *joint.split(optimum.x))
            if design is not None:
                found.append((optimum, design))
    if not found:
        return None, None
    return min(found, key=lambda pair: (max(pair[1].excess, SLACK), pair[1].value))


def _tightened(
    problem: Problem, loose: SmoothProgram, best: LocalOptimum | None, design: Design
) -> tuple[LocalOptimum | None, Design | None]:
    """Again with limits a little tighter: a peak between the samples breaks its limit by a little."""
    margin = 0.0
    for _ in range(MOST_MARGINS):
        if best is None or design.excess <= FEASIBLE or design.excess > 0.05:
            break
        margin += 1.05 * design.excess
        joint = SmoothProgram(problem, loose.unit, margin, loose.moves)
        again = solve_nonlinear(joint.program, [best.x], workers=1)
        better, allowed = _first_allowed(joint, again)
        if better is None or allowed is None:
            break
        best, design = better, allowed
    return best, design


def _rebalanced(design: Design) -> tuple[Design, float] | None:
    """Unbalances decided anew on the mounts found, with proof; None where that is not convex."""
    problem = design.problem
    if not problem.unbalances or not problem.load_terms or problem.mount_terms:
        return None
    if any(limit.measure.unit == "" for limit in problem.mount_limits):
        # transmissibility depends on what excites
        return None
    held = problem.design(_mounts(design), problem.mount_decisions)
    result = solve_unbalances(replace(problem, engine=held).balance)
    if result.certificate is None or result.status is not Status.OPTIMAL:
        return None
    values = unbalances_of(problem, result)
    again = _judged(problem, _mounts(design), values)
    return None if again is None or again.excess > KEPT else (again, result.certificate.gap)


def _convex_part(problem: Problem) -> Problem | None:
    """The problem without all that is not convex in the stiffnesses; None where more than these is open."""
    decisions = problem.mount_decisions
    if not decisions or not all(decision.is_stiffness for decision in decisions):
        return None
    terms = tuple(term for term in problem.mount_terms if term.measure.channel in CONVEX)
    alone = replace(problem, objective=terms or (Term(Measure(channels.TOTAL_STIFFNESS)),), decisions=decisions)
    limits = tuple(limit for limit in problem.mount_limits if is_convex(replace(alone, limits=(limit,))))
    return replace(alone, limits=limits)


def _proven_conflict(problem: Problem) -> tuple[str, ...]:
    """Limits that no stiffness within the bounds meets together, where the convex part proves it."""
    convex = _convex_part(problem)
    return () if convex is None else solve_convex_mounts(convex).conflict


def _bound(problem: Problem) -> float:
    """What no design goes under: each kind of terms alone, for none is under zero.

    Mount forces by what is transmitted at least (E34), numbers of the mounts by what of them is convex (E16-E19),
    loads of the block and masses by the unbalances alone, whatever the mounts (P4).
    """
    found, parts = transmitted_bound(problem), []
    block = tuple(term for term in problem.load_terms if not term.measure.on_mounts)
    if block:
        limits = tuple(limit for limit in problem.load_limits if not limit.measure.on_mounts)
        alone = replace(off_resonance(problem).balance, objective=block, limits=limits)
        if alone.decisions:
            parts.append(solve_unbalances(alone))
        else:
            found += objective_value(alone, evaluate(alone))
    convex = _convex_part(problem)
    if convex is not None and set(convex.objective) <= set(problem.objective):
        parts.append(solve_convex_mounts(convex))
    return found + sum(part.certificate.lower_bound for part in parts if part.certificate is not None)


def _result(
    problem: Problem,
    joint: SmoothProgram,
    initial: Evaluation,
    design: Design,
    best: LocalOptimum,
    optima: Sequence[LocalOptimum],
    proven: tuple[Design, float] | None,
    timing: dict[str, float],
) -> Result:
    nothing, divided = nothing_of(problem, design.evaluation.engine), Divided(0.0, 0)
    room = room_of(design.value, problem.tolerance, nothing)
    if joint.moves is None and design.excess <= KEPT and divides(problem):
        divided = divided_bound(problem, design.value, room)
    # throws that move are not in the bound
    if joint.moves is None and design.value - divided.bound > room:
        divided = replace(divided, bound=max(divided.bound, _bound(problem)))
    shown = Shown(
        bound=divided.bound,
        reach=Reach.NEAR if divided.boxes else Reach.ASIDE,
        kkt_residual=best.kkt_residual,
        method=_method(optima, max(design.value, nothing), proven, divided),
        prices=[joint.price(limit.name, best.multipliers) for limit in problem.limits],
    )
    return concluded(design, initial, shown, timing)


def _method(optima: Sequence[LocalOptimum], scale: float, proven: tuple[Design, float] | None, divided: Divided) -> str:
    usable = [o for o in optima if o.usable]
    apart = distinct(optima, scale)
    text = f"IPOPT from {len(optima)} start{'s' if len(optima) > 1 else ''}, {len(usable)} of which ended at "
    text += "one and the same optimum" if len(apart) == 1 else f"{len(apart)} different optima"
    if len(apart) > 1 and apart[-1].value > WORTH_SAYING * apart[0].value > 0.0:
        text += f", up to {apart[-1].value / apart[0].value:.3g} times the best"
    if proven is not None:
        text += f"; balance on these mounts proven within {proven[1]:.0e}"
    if divided.boxes:
        text += f"; bounds of stiffness divided into {divided.boxes} boxes"
    return text


def _none(
    problem: Problem,
    joint: SmoothProgram,
    initial: Evaluation,
    optima: Sequence[LocalOptimum],
    timing: dict[str, float],
) -> Result:
    """No start ended at a design within the limits: not a proof, unless the convex limits alone contradict."""
    conflict = _proven_conflict(problem)
    result = none_within(problem, initial, conflict, timing)
    if conflict:
        return result
    nearest = min(optima, key=lambda o: o.violation)
    names = _broken(joint, nearest)
    message = (
        f"no design found: from {len(optima)} starts none meets {names or 'the limits'} "
        f"(nearest misses by {nearest.violation:.3g} of a limit); relax it, or open more"
    )
    return replace(result, status=Status.FAILED, message=message)


def _broken(joint: SmoothProgram, optimum: LocalOptimum) -> str:
    program = joint.program
    g = optimum.constraints
    if len(g) != len(program.constraint_names):
        return ""
    miss = np.maximum(program.constraint_lower - g, g - program.constraint_upper)
    names = [program.constraint_names[k] for k in np.flatnonzero(miss > 1e-6)]
    return " and ".join(f"'{name}'" for name in dict.fromkeys(names) if name != "modes")
