"""Agreement of check and solve: solve refuses no file that check accepts."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

import laufruhe
from laufruhe.cli import app
from laufruhe.errors import ModelError
from laufruhe.problem.problem import Problem
from laufruhe.solvers.methods import METHODS, refuse
from problem_files import PROBLEMS, READY, changed

HEIGHTS = (PROBLEMS / "tractor-four-shaft-heights.toml").read_text()
REFUSED = {
    "flywheel.inertia is open, but no objective or limit": changed(
        HEIGHTS, "[objective]", '[flywheel]\ninertia = { between = ["1 kg m^2", "2 kg m^2"] }\n[objective]'
    ),
}


@pytest.mark.parametrize("rule", REFUSED)
def test_check_and_solve_refuse_alike(rule: str, tmp_path: Path) -> None:
    path = tmp_path / "p.toml"
    path.write_text(REFUSED[rule])
    with pytest.raises(ModelError) as caught:
        laufruhe.solve(path)
    assert rule in str(caught.value)
    result = CliRunner().invoke(app, ["check", str(path)])
    assert result.exit_code == 2
    assert rule in result.output
    assert "ok" not in result.output.split("\n")[0]


@pytest.mark.parametrize(
    "change",
    [
        ('reciprocating_mass = "1.25 kg"', 'reciprocating_mass = { between = ["1 kg", "2 kg"] }'),
        ('name = "left"', 'name = "left"\noptional = true'),
        ('stroke = "120 mm"', 'stroke = { between = ["100 mm", "120 mm"] }'),
    ],
)
def test_every_accepted_problem_has_a_method(change: tuple[str, str]) -> None:
    problem: Problem = laufruhe.load(changed(HEIGHTS, *change))
    refuse(problem)
    assert any(method.suits(problem) for method in METHODS)


@pytest.mark.slow
def test_no_ready_problem_is_refused_or_left_without_a_bound() -> None:
    for path in READY:
        problem = laufruhe.load(path)
        refuse(problem)
        if not problem.extras and "number" not in {d.kind.name.lower() for d in problem.decisions}:
            chosen = next(method for method in METHODS if method.suits(problem))
            assert chosen is not METHODS[-1], path.stem
