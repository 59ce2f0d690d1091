"""Which objectives are sums of norms of a star's forces and couples, and with what factors (S3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from laufruhe.machine import Engine, Role
from laufruhe.machine.firing import even_patterns
from laufruhe.numerics.norms import NORMS
from laufruhe.physics.order_coefficients import orders_needed
from laufruhe.physics.shaking_loads import shaking_loads
from laufruhe.problem import channels
from laufruhe.problem.evaluation import Evaluation, evaluate
from laufruhe.problem.measure import Term
from laufruhe.problem.problem import Problem
from laufruhe.solvers.star_search import AmplitudeObjective, AmplitudeTerm

NEGLIGIBLE = 1e-13


def amplitude_objective(problem: Problem) -> AmplitudeObjective | None:
    """The objective as norms of |F_h| and |C_h|, where it is of that kind; else None.

    It is if nothing but the throws and what hangs on them makes forces and couples,
    nothing else is open, no limit can tell even stars apart, and every term is a root mean square or is
    of a single order: then no phase between orders can matter.
    """
    engine = problem.engine
    choosing = problem.phasing is not None and bool(problem.phasing.shafts.optional)
    if problem.decisions or choosing or not problem.objective or not _limits_idle(problem):
        return None
    if any(rotor.role is not Role.THROW for rotor in engine.rotors):
        return None
    single = _one_throw(engine)
    if single is None or not all(_is_amplitude(term) for term in problem.objective):
        return None
    x = single.slider_cranks[0].x
    silent = tuple(replace(point, gas=None) for point in problem.points)
    alone = evaluate(replace(problem, engine=single, points=silent))
    highest = max(len(shaking_loads(single, point, problem.fidelity).coefficients) for point in silent)
    highest = min(highest, max(orders_needed(p.rod_ratio, p.offset_ratio) for p in single.slider_cranks) + 1)
    orders = _orders(problem, highest)
    terms = tuple(_factors(term, alone, orders, abs(x)) for term in problem.objective)
    used = [
        k for k in range(len(orders))
        if any(t.force[k] > NEGLIGIBLE * max(t.force) or t.couple[k] > NEGLIGIBLE * max(t.couple) for t in terms)
    ]  # fmt: skip
    return AmplitudeObjective(
        tuple(orders[k] for k in used),
        tuple(
            AmplitudeTerm(t.weight, tuple(t.force[k] for k in used), tuple(t.couple[k] for k in used)) for t in terms
        ),
    )


def _limits_idle(problem: Problem) -> bool:
    """Whether only forces are limited, and met: of even stars the counts on the steps fix them."""
    forces = all(limit.measure.channel is channels.SHAKING_FORCE for limit in problem.limits)
    if not problem.limits or not forces or problem.phasing is None:
        return not problem.limits
    layout = problem.phasing.layout(*problem.phasing.geometries[0])
    if len(even_patterns(problem.phasing.cycle, layout)) > 1:
        return False
    given = evaluate(problem)
    return all(given.value(limit.measure) <= limit.maximum for limit in problem.limits)


def _is_amplitude(term: Term) -> bool:
    q = term.measure
    if q.channel not in (channels.SHAKING_FORCE, channels.ROCKING_COUPLE):
        return False
    return q.norm is NORMS["rms"] or (q.orders is not None and len(q.orders) == 1)


def _one_throw(engine: Engine) -> Engine | None:
    """The engine with its first throw alone; None where a throw's cylinders stand apart or at the middle."""
    first = engine.slider_cranks[0]
    same = tuple(p for p in engine.slider_cranks if p.x == first.x)
    if first.x == 0.0 or len(engine.slider_cranks) % len(same):
        return None
    rotors = tuple(rotor for rotor in engine.rotors if rotor.x == first.x)
    return Engine(engine.name, engine.cycle, same, rotors)


def _orders(problem: Problem, highest: int) -> list[int]:
    wanted: set[int] = set()
    for term in problem.objective:
        given = term.measure.orders
        wanted |= set(range(1, highest)) if given is None else {int(h) for h in given if h == int(h) and h > 0}
    return sorted(wanted)


def _factors(term: Term, alone: Evaluation, orders: Sequence[int], x: float) -> AmplitudeTerm:
    """Value of one throw's load of every order; a couple for its lever."""
    counted = term.measure.orders
    values = []
    for h in orders:
        counts = counted is None or any(float(h) == order for order in counted)
        values.append(alone.value(replace(term.measure, orders=(float(h),))) if counts else 0.0)
    none = (0.0,) * len(orders)
    if term.measure.channel is channels.SHAKING_FORCE:
        return AmplitudeTerm(term.weight, tuple(values), none)
    return AmplitudeTerm(term.weight, none, tuple(v / x for v in values))
