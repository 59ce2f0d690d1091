"""Run-ups and shut-downs that are asked about: checked where that is enough, designed for where it is not.

What else is asked is decided first, without them: a design that keeps their limits is the best with them too, and what
bounds it bounds all that keep them. Where loads add up, on mounts that stand, without bump stops, cones have the steps
of a run that matter (E28a); where mounts are open, or stops are met, a smooth program has the peaks that the exact
model tells (E28b).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from laufruhe.errors import ModelError
from laufruhe.extensions.run_ups.cones import solve_run_cones
from laufruhe.extensions.run_ups.rows import RunRows
from laufruhe.load_models.simulated import simulated_measures
from laufruhe.machine.mount import every_spring
from laufruhe.problem.decision import Kind
from laufruhe.problem.measure import Limit, Term
from laufruhe.problem.problem import Phasing, Problem
from laufruhe.solvers.conclusion import broken_limits, quoted, with_limits
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.stars.phasing_solver import even_stars, solve_every_order

_LINEAR = frozenset({Kind.UNBALANCE, Kind.SHARE})
_SMOOTH = frozenset({Kind.UNBALANCE, Kind.STIFFNESS, Kind.MOUNT})
Decide = Callable[[Problem], Result]


def solve_runs(problem: Problem, kinds: frozenset[Kind], decide: Decide) -> Result:
    """Return the best design where run-ups are minimised or limited.

    Parameters
    ----------
    kinds
        Kinds of what is open.
    decide
        Function that decides a problem without run-ups.

    Raises
    ------
    ModelError
        If a run-up is minimised over what nothing decides it by.
    """
    simulated = simulated_measures(problem)
    limits = tuple(limit for limit in problem.limits if limit.measure in simulated)
    terms = tuple(term for term in problem.objective if term.measure in simulated)
    without_runs = problem.changed(
        objective=tuple(term for term in problem.objective if term not in terms),
        limits=tuple(limit for limit in problem.limits if limit not in limits),
    )
    relaxed = None
    if without_runs.objective:
        relaxed = decide(without_runs)
        broken = broken_limits(limits, relaxed.final)
        if not relaxed.status.has_design or not (broken or terms):
            # without what is asked of run-ups nothing is missing
            return with_limits(relaxed, problem.limits)
        if relaxed.problem.fidelity != problem.fidelity:
            # its bound is of the physics that it was found accurate by
            problem = problem.at(relaxed.problem.fidelity)
    designed = _designed(problem, kinds, limits, terms, relaxed, decide)
    if designed is not None:
        return designed
    others = " and ".join(kind.name.lower() for kind in sorted(kinds - _SMOOTH)) or "this"
    if terms or relaxed is None:
        name = terms[0].measure.name
        raise ModelError(f"{name} is minimised over unbalances and mounts, not over {others}; fix it, or limit it")
    names = quoted(broken_limits(limits, relaxed.final))
    why = (
        f"the best design found breaks {names}: beside {others} a run-up is checked, not designed for; "
        f"relax it, fix {others}, or limit travel"
    )
    return replace(with_limits(relaxed, problem.limits), status=Status.FAILED, certificate=None, message=why)


def _designed(
    problem: Problem, kinds: frozenset[Kind], limits: Sequence[Limit], terms: Sequence[Term], relaxed: Result | None,
    decide: Decide,
) -> Result | None:  # fmt: skip
    """Return a design by a method for run-ups; None where there is none."""
    if problem.phasing is not None:
        return _of_stars(problem, problem.phasing, decide) if kinds <= _LINEAR | {Kind.STAR} else None
    rows = RunRows.from_problem(problem, simulated_measures(problem)) if kinds <= _LINEAR else None
    if rows is not None:
        return solve_run_cones(problem, limits, terms, rows, decide)
    if not kinds <= _SMOOTH:
        return None
    from laufruhe.extensions.run_ups.mounts import solve_run_mounts

    return solve_run_mounts(problem, relaxed)


def _of_stars(problem: Problem, phasing: Phasing, decide: Decide) -> Result | None:
    if phasing.continuous or not all(math.isinf(spring.stop_gap) for _, spring in every_spring(problem.engine.mounts)):
        return None
    return solve_every_order(problem, phasing, even_stars(phasing), lambda own, _: decide(replace(own, phasing=None)))
