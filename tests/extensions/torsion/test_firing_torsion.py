"""Firing orders decided against the twist of the crankshaft, alone and together with the balance."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import laufruhe
from laufruhe.extensions.torsion.physics import chain_of
from laufruhe.files.reader import load_tables, tables_of
from laufruhe.load_models.star_model import FiringModel, PairObjective
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.problem import Problem
from laufruhe.prove.certificate import Proof
from laufruhe.solvers.result import Result, Status
from laufruhe.solvers.stars.even_search import enumerate_stars
from laufruhe.solvers.stars.families import families_of
from laufruhe.solvers.stars.phasing_solver import alike_measures, torque_numbers
from problem_files import PROBLEMS

READY = PROBLEMS / "inline-five-torsion.toml"
STEPS = {"fidelity": {"samples": 360}}


def tables(**changes: Any) -> dict[str, Any]:
    return {**tables_of(READY), "constraints": [], **STEPS, **changes}


def problem_of(whole: dict[str, Any]) -> Problem:
    return load_tables(whole, Path("five.toml"))


def damped() -> dict[str, Any]:
    """Return the torsion of the crankshaft with a viscous damper on its pulley."""
    damper = {"name": "damper", "on": "pulley", "inertia": "0.01 kg m^2", "damping": "2 N m s/rad"}
    return tables()["torsion"] | {"absorbers": [damper]}


def fired(whole: dict[str, Any], order: tuple[int, ...]) -> Problem:
    """Return the problem with a firing order and the throws that it makes even."""
    engine = {key: value for key, value in whole["engine"].items() if key not in ("throws", "cylinders")}
    without = {key: value for key, value in whole.items() if key != "phasing"}
    return problem_of({**without, "engine": {**engine, "firing_order": list(order)}})


def orders_of(count: int) -> list[tuple[int, ...]]:
    return [(1, *rest) for rest in itertools.permutations(range(2, count + 1))]


def values_of(whole: dict[str, Any], count: int = 5) -> dict[tuple[int, ...], float]:
    """Return the objective of every firing order by the exact model, each engine built anew."""
    problems = {order: fired(whole, order) for order in orders_of(count)}
    return {order: objective_value(problem, evaluate(problem)) for order, problem in problems.items()}


def ranked(result: Result) -> dict[tuple[int, ...], float]:
    assert result.phasing is not None
    return {star.firing_orders[0].order: star.value for star in result.phasing.ranking}


@pytest.fixture(scope="module")
def every() -> dict[tuple[int, ...], float]:
    return values_of(tables())


def test_every_firing_order_is_ranked(every: dict[tuple[int, ...], float]) -> None:
    """Compare the ranking of all 24 firing orders by pairs of throws with the exact model; the best is proven."""
    result = laufruhe.solve(problem_of(tables(phasing={"best": 24})))
    assert result.status is Status.OPTIMAL
    actual = ranked(result)
    # an order and its mirror in time are two designs
    assert len(actual) == 24
    for order, value in actual.items():
        assert value == pytest.approx(every[order], rel=1e-9)
    assert result.objective.value == pytest.approx(min(every.values()), rel=1e-12)
    assert result.certificate.kind is Proof.GLOBAL
    assert "by pairs of throws" in result.certificate.method
    assert result.certificate.lower_bound <= min(every.values())
    assert result.certificate.lower_bound == pytest.approx(min(every.values()), rel=1e-9)


def test_peaks_are_decided_by_cuts() -> None:
    """Check peaks, which are no sum over pairs: programs of some firing orders, dual cuts for the others."""
    # a peak between the angles of fewer steps would leave a gap
    fine = {"samples": 1440}
    whole = tables(objective={"minimise": "maximum shaft torque", "sections": ["throw 5 - flywheel"]}, fidelity=fine)
    result = laufruhe.solve(problem_of({**whole, "phasing": {"best": 1}}))
    every = values_of(whole)
    assert result.objective.value == pytest.approx(min(every.values()), rel=1e-6)
    assert result.certificate.lower_bound <= min(every.values()) * (1.0 + 1e-9)
    assert result.status is Status.OPTIMAL


def test_main_orders_leave_no_choice() -> None:
    """Check that order 2.5, equal for all firing orders, is proven without a gain."""
    result = laufruhe.solve(problem_of(tables(objective={"minimise": "rms shaft stress", "orders": [2.5, 5]})))
    assert np.ptp(list(ranked(result).values())) < 1e-9 * result.objective.value
    assert result.objective.value == pytest.approx(result.objective.initial, rel=1e-9)


def test_couples_and_torsion_together(every: dict[tuple[int, ...], float]) -> None:
    """Check the least torsion among orders within a limit of the couple; a tighter limit never has less."""
    couple = {"minimise": "rms rocking couple", "orders": [1, 2]}
    couples = values_of(tables(objective=couple))
    sizes = sorted({round(value, 6) for value in couples.values()})
    before = 0.0
    for allowed in sizes[::-1]:
        limit = {"limit": "rms rocking couple", "orders": [1, 2], "max": f"{1.000001 * allowed} N m"}
        result = laufruhe.solve(problem_of(tables(constraints=[limit])))
        expected = min(every[order] for order, value in couples.items() if value <= 1.0000011 * allowed)
        assert result.objective.value == pytest.approx(expected, rel=1e-9)
        assert result.status is Status.OPTIMAL
        assert result.objective.value >= before * (1.0 - 1e-12)
        before = result.objective.value
    limit = {"limit": "rms rocking couple", "orders": [1, 2], "max": f"{0.99 * sizes[0]} N m"}
    assert laufruhe.solve(problem_of(tables(constraints=[limit]))).status is Status.INFEASIBLE


def test_a_weighted_sum_of_both() -> None:
    terms = [
        {"quantity": "rms shaft torque", "weight": 2.0},
        {"quantity": "rms rocking couple", "orders": [1, 2], "weight": 0.5},
    ]
    whole = tables(objective={"terms": terms})
    result = laufruhe.solve(problem_of(whole))
    assert result.objective.value == pytest.approx(min(values_of(whole).values()), rel=1e-9)


@pytest.mark.slow
def test_firing_orders_with_counterweights_open() -> None:
    """Compare torsion under a limit of the mount force with each firing order solved by itself."""
    places = [["250 mm", "230 mm", "0 mm"], ["250 mm", "-230 mm", "0 mm"], ["-550 mm", "0 mm", "0 mm"]]
    weights = [
        {"name": name, "opposite_throw": throw, "unbalance": {"between": ["0 kg m", "0.05 kg m"]}}
        for name, throw in (("front", 1), ("rear", 5))
    ]
    limit = {"name": "mounts", "limit": "rms mount force", "max": "600 N"}
    whole = tables(
        mounts={"positions": places}, counterweights=weights, constraints=[limit], phasing={"best": 24},
        operating_points=[{"speed": "2600 rpm"}], fidelity={"samples": 96},
    )  # fmt: skip
    result = laufruhe.solve(problem_of(whole))
    values = []
    for order in orders_of(5):
        alone = laufruhe.solve(fired(whole, order))
        values.append(alone.objective.value if alone.status is not Status.INFEASIBLE else np.inf)
    assert np.isfinite(values).any()
    assert not np.isfinite(values).all()
    assert result.objective.value == pytest.approx(min(values), rel=1e-4)
    assert result.status is Status.OPTIMAL
    assert result.limits[0].value <= 600.0 * (1.0 + 1e-6)


def test_firing_orders_of_one_star_differ() -> None:
    """Check six cylinders in pairs on a step: the cylinder of a pair that fires first makes another order."""
    six = tables(phasing={"best": 3}, objective={"minimise": "rms shaft twist"})
    six["engine"] = {**six["engine"], "cylinders": 6}
    result = laufruhe.solve(problem_of(six))
    rng = np.random.default_rng(7)
    some = [tuple(order) for order in rng.permutation(orders_of(6))[:12]]
    some += [star.firing_orders[0].order for star in result.phasing.ranking]
    for order in some:
        problem = fired(six, tuple(int(n) for n in order))
        value = objective_value(problem, evaluate(problem))
        assert value >= result.objective.value * (1.0 - 1e-9)
        for star in result.phasing.ranking:
            if star.firing_orders[0].order == order:
                assert value == pytest.approx(star.value, rel=1e-9)
    settings = {**six, "engine": {**six["engine"], "throws": [0, 120, 240, 240, 120, 0]}}
    del settings["engine"]["cylinders"]
    one_star = laufruhe.solve(problem_of(settings))
    assert one_star.status is Status.OPTIMAL
    # a star given is less freedom
    assert one_star.objective.value >= result.objective.value * (1.0 - 1e-9)
    assert one_star.phasing.ranking[0].order_count > 1


def test_the_engine_seen_from_behind() -> None:
    """Check that discs, shafts and cylinders in reverse order have the same optimum in reverse order."""
    problem = problem_of(tables())
    chain = chain_of(problem.engine)
    assert chain is not None
    assert problem.phasing is not None
    names = [part.name for part in problem.engine.slider_cranks]
    other = dict(zip(names, names[::-1], strict=True))
    discs = tuple(replace(d, cylinders=tuple(other[c] for c in d.cylinders)) for d in chain.discs[::-1])
    behind = replace(chain, discs=discs, sections=chain.sections[::-1], output="flywheel")
    star_problem_of = problem.phasing.problem_of

    def turned(candidate: Any) -> Problem:
        result = star_problem_of(candidate)
        return replace(result, engine=result.engine.with_extra(behind))

    phasing = replace(problem.phasing, problem_of=turned)
    again = laufruhe.solve(replace(turned_problem(problem, behind), phasing=phasing))
    first = laufruhe.solve(problem)
    assert again.objective.value == pytest.approx(first.objective.value, rel=1e-9)


def turned_problem(problem: Problem, chain: Any) -> Problem:
    return replace(problem, engine=problem.engine.with_extra(chain))


def test_a_peak_between_the_angles_breaks_its_limit() -> None:
    """Check that the exact model excludes a design that breaks a limit between the angles of the search."""
    peak = {"minimise": "maximum shaft torque"}
    coarse = {"fidelity": {"samples": 96, "gas_samples": 720}}
    values = values_of(tables(objective=peak, **coarse))
    rows = {order: evaluate(fired(tables(objective=peak, **coarse), order)) for order in values}
    seen = {order: float(e.rows(fired(tables(objective=peak), order).objective[0].measure).value)
            for order, e in rows.items()}  # fmt: skip
    # between what the angles see of the least one and what it is
    minimum = min(seen, key=seen.get)
    allowed = 0.5 * (seen[minimum] + values[minimum])
    assert seen[minimum] < 0.9999 * values[minimum]
    limit = {"limit": "maximum shaft torque", "max": f"{allowed} N m"}
    result = laufruhe.solve(problem_of(tables(constraints=[limit], **coarse)))
    feasible = [value for value in values.values() if value <= allowed]
    assert (result.status in (Status.OPTIMAL, Status.FEASIBLE)) == bool(feasible)
    if feasible:
        assert result.final.violation(result.problem.limits) <= 1e-5


def test_the_bound_of_all_orders_is_below_each() -> None:
    phasing = problem_of(tables()).phasing
    (family,), _ = families_of(phasing, by_firing=True)
    model = FiringModel(phasing, family.space, family.geometry)
    objective = PairObjective.from_problem(model.at(model.samples))
    whole = enumerate_stars(family.space, objective, 24)
    assert whole.complete
    assert whole.nodes == len(whole.values) == 24
    assert whole.lower_bound <= objective.values(family.space, family.stars).min()


def test_bearings_limit_what_twists() -> None:
    """Compare the least twist with that of all orders whose bearing forces are allowed."""
    bearings = [{"x": f"{x} mm"} for x in (250, 44, -250)]
    force = {"minimise": "rms main-bearing force", "bearings": ["2"]}
    loads, twists = values_of(tables(main_bearings=bearings, objective=force)), values_of(tables())
    allowed = sorted(loads.values())[len(loads) // 2] * 1.000001
    limit = {"limit": "rms main-bearing force", "bearings": ["2"], "max": f"{allowed} N"}
    result = laufruhe.solve(problem_of(tables(main_bearings=bearings, constraints=[limit])))
    expected = min(twists[order] for order, load in loads.items() if load <= allowed)
    assert result.objective.value == pytest.approx(expected, rel=1e-9)
    assert result.status is Status.OPTIMAL
    assert expected > min(twists.values()) * (1.0 + 1e-6) or loads[min(twists, key=twists.get)] <= allowed


def test_banks_that_share_throws_are_decided_order_by_order() -> None:
    """Check that banks with shared throws prove each firing order of each even star by itself."""
    vee = tables_of(PROBLEMS / "vee-eight-open.toml") | {"torsion": tables()["torsion"], **STEPS}
    vee |= {"objective": {"minimise": "rms shaft stress"}}
    vee = {key: value for key, value in vee.items() if key not in ("counterweights", "balancer_shafts", "constraints")}
    result = laufruhe.solve(problem_of(vee))
    assert result.certificate.kind is Proof.GLOBAL
    assert result.certificate.lower_bound <= min(star.value for star in result.phasing.ranking) * (1.0 + 1e-12)
    assert "72 of 72 firing orders of 9 stars" in result.certificate.method


def test_heat_of_an_absorber_depends_on_the_firing_order() -> None:
    """Compare the best order under a limit of heat with each firing order by itself; no order keeps a tiny limit."""
    torsion = damped()
    limit, few = {"limit": "absorber heat", "max": "1 MW"}, {"samples": 60}
    problems = [fired(tables(torsion=torsion, fidelity=few, constraints=[limit]), order) for order in orders_of(5)]
    evaluations = [evaluate(problem) for problem in problems]
    heats = [evaluation.value(p.limits[0].measure) for p, evaluation in zip(problems, evaluations, strict=True)]
    values = [objective_value(p, evaluation) for p, evaluation in zip(problems, evaluations, strict=True)]
    least, largest = min(heats), max(heats)
    allowed = 0.5 * (least + largest)
    assert largest > 1.01 * least
    tight = laufruhe.solve(
        problem_of(tables(torsion=torsion, fidelity=few, constraints=[{**limit, "max": f"{allowed} W"}]))
    )
    assert tight.status is Status.OPTIMAL
    assert tight.limits[0].value <= allowed
    # values of 60 samples choose the order; the result has the value of finer ones
    rows = zip(values, heats, orders_of(5), strict=True)
    _, best = min((value, order) for value, heat, order in rows if heat <= allowed)
    assert min(ranked(tight), key=ranked(tight).get) == best
    none = laufruhe.solve(problem_of(tables(torsion=torsion, fidelity=few, constraints=[{**limit, "max": "1e-6 W"}])))
    assert none.status is Status.INFEASIBLE


def test_only_numbers_of_the_torque_are_equal_for_even_stars() -> None:
    """Check that heat of an absorber and travel of a piston do not make the search solve each order by itself."""
    limits = [
        {"limit": "absorber heat", "max": "1 MW"},
        {"limit": "piston travel", "max": "1 m"},
        {"limit": "degree of irregularity", "max": 1.0},
    ]
    problem = problem_of(tables(torsion=damped(), constraints=limits))
    assert [measure.channel.name for measure in torque_numbers(problem)] == ["degree of irregularity"]
    assert {m.channel.name for m in alike_measures(problem)} == {"degree of irregularity", "piston travel"}
