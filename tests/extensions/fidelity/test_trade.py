"""Test regret, violated limits and advice of a trade."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import laufruhe
from cli import scenes
from laufruhe.errors import InputError, SolverError
from laufruhe.extensions.fidelity.reference import reference
from laufruhe.extensions.fidelity.trade import Trade, TradeRow, peak_memory, timed, trade
from laufruhe.extensions.fidelity.trade_report import advice, choices, trade_document, traded
from laufruhe.files.reader import load
from laufruhe.physics.fidelity import Fidelity
from laufruhe.problem.evaluation import objective_value
from laufruhe.problem.problem import Problem
from problem_files import PROBLEMS


def _row(name: str, solve: float, regret: float, violation: float, batch: float = math.nan) -> TradeRow:
    error = math.nan if math.isnan(batch) else 5e-4
    return TradeRow(name, 1e-6, 1e-5, 1e-3, solve, solve, batch, error, 1e5, 1.0 + regret, violation, 0.1, regret)


def _trade(*rows: TradeRow) -> Trade:
    problem = scenes.problem_of(scenes.TIGHT)
    return Trade(problem, rows, 2.0, 1.0, None)


def test_a_design_beyond_a_limit_is_no_decision() -> None:
    """Check that a better objective does not excuse a broken limit."""
    quick, sound = _row("quick", 1e-3, -0.2, 0.12), _row("sound", 1.0, 1e-6, 2e-7)
    assert choices(_trade(quick, sound))[0] == sound
    assert choices(_trade(quick))[0] is None
    page = str(trade_document(_trade(quick, sound), None, "trade"))
    assert "12 % beyond a limit" in page
    assert "-2.0e-01" not in page


def test_advice_is_of_one_solve_and_of_many_designs() -> None:
    """Check the fastest fidelity of each kind of call, which may differ."""
    one, many = _row("one", 1e-2, 1e-9, 0.0, 1.0), _row("many", 1.0, 1e-9, 0.0, 1e-2)
    assert choices(_trade(one, many)) == (one, many)
    assert advice(_trade(one, many)) == "`one` for one solve (10 ms); `many` for ten thousand designs (10 ms)."
    wrong = replace(many, batch_error=0.01)
    assert choices(_trade(one, wrong)) == (one, one)


@pytest.mark.parametrize(("first", "calls"), [(0.1, 4), (1.0, 2), (3.0, 1)])
def test_a_call_is_repeated_unless_it_takes_seconds(first: float, calls: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Check that a fast call is repeated, because the first one fills caches."""
    clock = [0.0]
    monkeypatch.setattr("laufruhe.extensions.fidelity.trade.time.process_time", lambda: clock[0])
    count = 0

    def work() -> None:
        nonlocal count
        count += 1
        clock[0] += first if count == 1 else 0.8 * first

    assert timed(work)[1] == pytest.approx(first if calls == 1 else 0.8 * first)
    assert count == calls


def test_the_memory_of_a_call_is_its_largest_and_not_what_it_leaves() -> None:
    assert 8_000_000 <= peak_memory(lambda: float(np.zeros(1_000_000).sum())) < 9_000_000


@pytest.mark.slow
@pytest.mark.usefixtures("small_trade")
def test_rows_are_what_separate_calls_return() -> None:
    """Compare values with separate calls; benchmarks compare times."""
    problem = load(PROBLEMS / "tractor-single.toml")
    found = {row.name: row for row in trade(problem).rows}
    for name, fidelity in (("two-order, 720 steps", Fidelity("two-order", 720)), ("exact, 1440 steps", Fidelity())):
        row, variant = found[name], problem.at(fidelity)
        result = laufruhe.solve(variant)
        truth = objective_value(problem, reference(problem, result.final.engine))
        assert row.optimum == pytest.approx(truth, rel=1e-9)
        assert row.regret_bound == pytest.approx(result.regret_bound, rel=1e-6, abs=1e-9)
        assert row.regret <= row.regret_bound + 1e-7
        assert row.solve > 0.0
    assert found["auto 0.001"].optimum == found["exact, 1440 steps"].optimum
    assert found["auto 0.001"].batch_error <= 1e-3


def test_an_open_flywheel_is_refused_before_anything_is_measured(tmp_path: Path) -> None:
    paths = [PROBLEMS / f"{name}.toml" for name in ("boxer-four", "waterworks-steam-pump")]
    with pytest.raises(InputError, match=r"waterworks.*flywheel: is open, but fidelities are compared for a fixed"):
        traded(paths, tmp_path / "trade", lambda _: None)
    assert not (tmp_path / "trade").exists()


@pytest.mark.slow
@pytest.mark.usefixtures("small_trade")
def test_problems_finished_in_time_have_pages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Check that the finished one of two problems has a page, and that an error counts it."""
    quick, never = PROBLEMS / "boxer-four.toml", PROBLEMS / "inline-five.toml"

    def out_of_time(problem: Problem, *_: object) -> Trade:
        if problem.name == never.stem:
            raise SolverError("the time limit ended before any fidelity was measured; raise the time limit")
        return trade(problem)

    monkeypatch.setattr("laufruhe.extensions.fidelity.trade_report.trade", out_of_time)
    monkeypatch.setattr("laufruhe.extensions.fidelity.trade_report.is_time_over", lambda: True)
    with pytest.raises(SolverError, match="ended the trade after 1 of 2 problems"):
        traded([quick, never], tmp_path / "trade", lambda _: None)
    assert (tmp_path / "trade/boxer-four.md").is_file()


def test_objectives_beyond_a_trade_are_reported() -> None:
    first = ("Of 2 objectives in order the first is traded.",)
    result = replace(_trade(_row("one", 1.0, 0.0, math.nan)), left_out=first)
    assert first[0] in str(trade_document(result, None, "trade"))
