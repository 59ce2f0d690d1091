"""What a trade says of a fidelity's decision: how much worse it is, whether it keeps the limits, and what is left."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

import laufruhe
from cli import scenes
from laufruhe.cli.fidelity import traded
from laufruhe.errors import SolverError
from laufruhe.fidelity.error_bounds import reference
from laufruhe.files.reader import load
from laufruhe.machine import Engine
from laufruhe.numerics.workers import SERIAL, working_on
from laufruhe.physics.fidelity import Fidelity
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.problem import Problem
from laufruhe.report.trade import INDEX, choices, index, trade_document
from laufruhe.solvers.conclusion import decision_values, evaluate_only
from laufruhe.solvers.warm_start import NEAR_BOXES, _is_similar, _started_at, first_search, reoptimise
from laufruhe.studies.trade import Trade, TradeRow, trade
from problem_files import PROBLEMS


def _worth(problem: Problem, engine: Engine | None) -> float:
    assert engine is not None
    return objective_value(problem, reference(problem, engine))


def _row(name: str, solve: float, regret: float, violation: float) -> TradeRow:
    return TradeRow(name, 1e-6, 1e-5, 1e-5, 2e-5, solve, 1e-3, 100_000, 1.0 + regret, violation, regret)


def _trade(*rows: TradeRow) -> Trade:
    problem = scenes.problem_of(scenes.TIGHT)
    return Trade(problem, rows, 2.0, 1.0, None, None)


def test_a_design_beyond_a_limit_is_no_decision() -> None:
    """However much better it looks by the objective alone."""
    quick, sound = _row("quick", 1e-3, -0.2, 0.12), _row("sound", 1.0, 1e-6, 2e-7)
    assert choices(_trade(quick, sound))[1] == sound
    assert choices(_trade(quick))[1] is None
    page = str(trade_document(_trade(quick, sound), None, "trade"))
    assert "12 % beyond a limit" in page
    assert "-2.0e-01" not in page
    # a head says all, wherever a narrow screen puts its column
    assert {"error without gas", "error of auto 0.001", "regret of auto 0.001"} < set(INDEX)
    assert "no fidelity finds a design within 0.1 %" in index([_trade(quick)]).as_markdown("")


@pytest.mark.slow
def test_a_cheap_model_may_take_another_star() -> None:
    """One that the reference ranks far behind: what a fidelity decides is what a whole search of it decides."""
    problem, cheap = load(PROBLEMS / "inline-five-torsion.toml"), Fidelity(samples=96, orders=4, gas_samples=1440)
    known = first_search(problem.at(Fidelity()))
    assert known is not None
    whole = laufruhe.solve(problem.at(cheap))
    found = _worth(problem, reoptimise(problem.at(cheap), known))
    assert found == pytest.approx(_worth(problem, whole.final.engine), rel=1e-6)
    assert found > 1.1 * _worth(problem, known.final.engine)


def test_a_design_known_is_trusted_where_it_is_worth_about_the_same() -> None:
    """Its force goes with the square of the speed: 1.04 of it is 1.08 of the force, 1.1 of it 1.21."""
    problem = scenes.problem_of(scenes.TIGHT)
    known = evaluate_only(replace(problem, decisions=()))
    (point,) = problem.points
    for factor, is_like in ((1.0, True), (1.04, True), (0.96, True), (1.1, False), (0.9, False)):
        faster = replace(problem, points=(replace(point, speed=factor * point.speed),))
        assert _is_similar(faster, known) is is_like
    assert not _is_similar(problem, replace(known, objective=None))


def test_a_search_begins_at_the_design_known_and_nowhere_else() -> None:
    """Its numbers are the start and stand in the engine; nothing is proven of it, by few boxes or none."""
    problem = load(PROBLEMS / "tractor-four-shaft-heights.toml")
    sides = [(d.set.lower + 0.25 * (d.set.upper - d.set.lower)) * d.set.directions[0] for d in problem.decisions]
    values = [v.real if d.place_drives else v for d, v in zip(problem.decisions, sides, strict=True)]
    moved = problem.fixed_at(values)
    known = evaluate_only(replace(moved, decisions=()))
    entries = tuple(e for d, v in zip(problem.decisions, values, strict=True) for e in decision_values(d, v))
    begun = _started_at(problem, replace(known, problem=problem, decisions=entries))
    assert [d.start for d in begun.decisions] == pytest.approx(values)
    assert begun.engine == moved.engine
    assert (begun.search.starts, begun.search.boxes, begun.search.proves) == (1, NEAR_BOXES, False)
    rigid = scenes.problem_of(scenes.TIGHT)
    held = replace(evaluate_only(replace(rigid, decisions=())), problem=rigid, decisions=())
    told = tuple(e for d in rigid.decisions for e in decision_values(d, d.start))
    assert _started_at(rigid, replace(held, decisions=told)).search.boxes == 0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["powertrain-joined-springs", "inline-five-damper"])
def test_nothing_is_lost_by_searching_nearby(name: str) -> None:
    """By its own measure a fidelity that is about right finds a design no worse than a search from nothing does."""
    problem, cheap = load(PROBLEMS / f"{name}.toml"), Fidelity(samples=360, orders=8, gas_samples=1440)
    known, own = first_search(problem.at(Fidelity())), problem.at(cheap)
    assert known is not None
    anew, near = first_search(own), reoptimise(own, known)
    assert anew is not None
    assert near is not None
    values = [objective_value(own, evaluate(own, engine)) for engine in (near, anew.final.engine)]
    assert values[0] <= values[1] * (1.0 + 1e-5)


@pytest.mark.slow
def test_an_index_lists_what_nothing_is_traded_for(tmp_path: Path) -> None:
    paths = [PROBLEMS / f"{name}.toml" for name in ("waterworks-steam-pump", "boxer-four")]
    found, page, _ = traded(paths, tmp_path / "trade", lambda _: None)
    lines = found.as_markdown("").splitlines()
    assert (tmp_path / "trade/README.md").read_text(encoding="utf-8") == found.as_markdown("")
    assert page == "README.md"
    pump, boxer = (next(line for line in lines if path.stem in line) for path in paths)
    assert "nothing is open" in boxer
    assert "the flywheel is open" in pump
    assert {entry.name for entry in (tmp_path / "trade").glob("*.md")} == {"README.md", "boxer-four.md"}


@pytest.mark.slow
def test_what_is_measured_in_time_has_its_pages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of several problems side by side; the rest is an error that counts them."""
    quick, never = PROBLEMS / "boxer-four.toml", PROBLEMS / "inline-five.toml"

    def out_of_time(problem: Problem, *_: object) -> Trade:
        if problem.name == never.stem:
            raise SolverError("the time limit ended before any fidelity was measured; raise the time limit")
        return trade(problem)

    monkeypatch.setattr("laufruhe.cli.fidelity.trade", out_of_time)
    monkeypatch.setattr("laufruhe.cli.fidelity.is_time_over", lambda: True)
    with working_on(SERIAL), pytest.raises(SolverError, match="ended the trade after 1 of 2 problems"):
        traded([quick, never], tmp_path / "trade", lambda _: None)
    assert (tmp_path / "trade/boxer-four.md").is_file()


def test_what_a_file_asks_beyond_a_trade_is_told() -> None:
    first = ("Of 2 objectives in order the first is traded.",)
    found = replace(_trade(_row("one", 1.0, 0.0, math.nan)), left_out=first)
    assert first[0] in str(trade_document(found, None, "trade"))
