"""Tolerances of a file, the numbers of the engine that they change, and one line for bad input."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from laufruhe.cli import app
from laufruhe.errors import InputError
from laufruhe.extensions.robust.tolerance import Law, Scope, tolerances_of, with_errors
from laufruhe.files.reader import load
from laufruhe.machine.rotor import grade_of, permitted_unbalance
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.problem import Problem
from problem_files import FOUR, MOUNTS, PROBLEMS, changed, shaft

TEXT = (
    changed(FOUR, "1.25 kg", "1.25 kg{}")
    + """[[operating_points]]
speed = "3000 rpm"
[objective]
minimise = "rms mount force"
"""
)


def read(folder: Path, text: str) -> Problem:
    path = folder / "engine.toml"
    path.write_text(text if "[robust]" in text else f"{text}\n[robust]\n", encoding="utf-8")
    return load(path)


@pytest.mark.parametrize(
    ("words", "size", "law", "scope"),
    [
        (" ± 2 %", 0.025, Law.UNIFORM, Scope.PIECE),
        (" +- 2%", 0.025, Law.UNIFORM, Scope.PIECE),
        (" +/- 25 g normal", 0.025, Law.NORMAL, Scope.PIECE),
        (" ± 0.025 batch", 0.025, Law.UNIFORM, Scope.BATCH),
        (" ± 1e-2 kg normal batch", 0.01, Law.NORMAL, Scope.BATCH),
    ],
)
def test_forms(tmp_path: Path, words: str, size: float, law: Law, scope: Scope) -> None:
    (tolerance,) = tolerances_of(read(tmp_path, TEXT.format(words) + MOUNTS)).tolerances
    assert tolerance.size == pytest.approx(size)
    assert (tolerance.law, tolerance.scope, tolerance.unit) == (law, scope, "kg")
    assert len(tolerance.errors) == (1 if scope is Scope.BATCH else 4)


def test_errors_move_what_they_are_of(tmp_path: Path) -> None:
    problem = read(tmp_path, TEXT.format(" ± 25 g") + MOUNTS)
    built_problem = with_errors(problem, np.array([1.0, -1.0, 0.0, 0.5]))
    masses = [part.reciprocating_mass for part in built_problem.engine.slider_cranks]
    assert masses == pytest.approx([1.275, 1.225, 1.25, 1.2625])
    batch = with_errors(read(tmp_path, TEXT.format(" ± 25 g batch") + MOUNTS), np.array([-1.0]))
    assert [part.reciprocating_mass for part in batch.engine.slider_cranks] == pytest.approx([1.225] * 4)


def test_open_unbalances_are_off_by_a_share(tmp_path: Path) -> None:
    weight = shaft(
        "left", 2, "0 mm", 'unbalance = { between = ["0 kg m", "0.05 kg m"], tolerance = "2 %" }\nangle = 90'
    )
    problem = read(tmp_path, TEXT.format("") + MOUNTS + weight)
    built_problem = with_errors(problem, np.array([1.0]))
    assert built_problem.design([0.04j]).rotors[-1].unbalance == pytest.approx(0.0408j)
    assert problem.design([0.04j]).rotors[-1].unbalance == pytest.approx(0.04j)


@pytest.mark.parametrize(
    ("old", "new", "scale"),
    [
        ("rod_ratio = 0.26", 'rod_ratio = "0.26 ± 2 %"', 0.26 * 1.02),
        ('stroke = "120 mm"', 'stroke = "120 mm ± 0.5 mm"', 0.1205),
        ('"125 mm"', '"125 mm +- 1 mm"', 0.126),
    ],
)
def test_numbers_of_the_file(tmp_path: Path, old: str, new: str, scale: float) -> None:
    """Compare an engine with an error of a number with the engine of a file with that number."""
    plain = TEXT.format("") + MOUNTS
    problem = read(tmp_path, plain.replace(old, new))
    unit = "" if "ratio" in old else " m"
    written = f'"{scale!r}{unit}"'
    other = load(plain.replace(old, f"{old.rpartition(' = ')[0]} = {written}" if " = " in old else written))
    assert with_errors(problem, np.array([1.0])).engine == other.engine
    assert with_errors(problem, np.array([0.0])).engine == problem.engine
    assert not tolerances_of(problem).is_affine


def test_angles_of_throws(tmp_path: Path) -> None:
    text = TEXT.format("").replace("firing_order", 'throws = [0, "180 deg ± 1 deg", "180 ± 1", 0]\nfiring_order')
    problem = read(tmp_path, text + MOUNTS)
    throws = [math.degrees(p.throw) for p in with_errors(problem, np.array([1.0, -0.5])).engine.slider_cranks]
    assert throws == pytest.approx([0.0, 181.0, 179.5, 0.0])


@pytest.mark.parametrize(("names", "rotor_names"), [
    ([None], ["s"]), (["a"], ["s.a"]), ([None, None], ["s.1", "s.2"]), (["a", None, "b"], ["s.a", "s.2", "s.b"]),
])  # fmt: skip
def test_errors_of_a_shaft_have_the_names_of_its_unbalances(
    tmp_path: Path, names: list[str | None], rotor_names: list[str]
) -> None:
    weights = "".join(
        f'[[balancer_shafts.unbalances]]\nx = "{10 * k} mm"\nunbalance = "0.01 kg m ± 1 %"\n'
        + ("" if name is None else f'name = "{name}"\n')
        for k, name in enumerate(names)
    )
    shafts = f'[[balancer_shafts]]\nname = "s"\nratio = 2\nposition = ["0 mm", "0 mm"]\n{weights}'
    problem = read(tmp_path, TEXT.format("") + MOUNTS + shafts)
    assert {error.name for error in tolerances_of(problem).errors} == set(rotor_names)
    assert set(rotor_names) <= {rotor.name for rotor in problem.engine.rotors}


def test_draws_stay_within(tmp_path: Path) -> None:
    for law in ("uniform", "normal"):
        text = TEXT.format(f" ± 2 % {law}") + MOUNTS + f'[tolerances]\nresidual_unbalance = "10 g cm"\nlaw = "{law}"\n'
        drawn = tolerances_of(read(tmp_path, text)).draw(np.random.default_rng(1), 20_000)
        sizes = np.hypot(drawn[:, 4::2], drawn[:, 5::2])
        assert np.abs(drawn[:, :4]).max() <= 1.0
        assert sizes.max() <= 1.0
        assert drawn.mean(axis=0) == pytest.approx(np.zeros(8), abs=0.02)
        # even over an interval and a disc; a third of the tolerance, what is beyond left out
        assert drawn[:, :4].std() == pytest.approx(1 / math.sqrt(3.0) if law == "uniform" else 0.3288, rel=0.02)
        assert np.mean(sizes**2) == pytest.approx(0.5 if law == "uniform" else 0.2107, rel=0.02)


def test_grades(tmp_path: Path) -> None:
    """Check ISO 21940-11: G 6.3 at 3000 rpm is an eccentricity of 20 um."""
    assert grade_of("G 6.3") == pytest.approx(6.3e-3)
    assert grade_of("g6.3") is None
    assert permitted_unbalance(6.3e-3, 60.0, 100.0 * math.pi) == pytest.approx(60.0 * 20.05e-6, rel=1e-3)
    text = TEXT.format("") + MOUNTS + '[tolerances]\nresidual_unbalance = "G 6.3"\nrotor_mass = "60 kg"\n'
    problem = read(tmp_path, text)
    (tolerance,) = tolerances_of(problem).tolerances
    assert tolerance.size == pytest.approx(0.5 * 60.0 * 20.05e-6, rel=1e-3)
    built_problem = with_errors(problem, np.array([0.0, 1.0, -1.0, 0.0]))
    assert [rotor.unbalance for rotor in built_problem.engine.rotors] == pytest.approx(
        [1j * tolerance.size, -tolerance.size]
    )
    assert [rotor.x for rotor in built_problem.engine.rotors] == pytest.approx([0.1875, -0.1875])
    assert objective_value(built_problem, evaluate(built_problem)) != objective_value(problem, evaluate(problem))


@pytest.mark.parametrize(
    ("words", "more", "rule"),
    [
        (" ±", "", "tolerance sign without a tolerance"),
        (" ± two", "", "unit does not fit the number"),
        (" ± 2 mm", "", "unit does not fit the number"),
        (" ± 120 %", "", "is a tolerance of 100 % or more"),
        (" ± 1.3 kg", "", "100 % of the mass or more"),
        (" ± 2 % normal uniform", "", "two distributions"),
        (" ± -1 %", "", "negative"),
        ("", '[robust]\nover = "worst case"\n', "has no tolerances"),
        (" ± 1 %", '[robust]\nover = "95"\n', "neither the worst case nor a share"),
        (" ± 1 %", '[robust]\nover = "40 %"\n', "neither the worst case nor a share"),
        (" ± 1 %", '[robust]\nover = "99.9 %"\nengines = 100\n', "none of 100 engines lies above"),
        (
            "",
            '[tolerances]\nresidual_unbalance = "G 6.3"\n',
            "is missing, but a balance grade needs the mass",
        ),
        ("", '[tolerances]\nresidual_unbalance = "6.3"\n', "neither a balance grade nor an unbalance"),
        ("", '[tolerances]\nrotor_mass = "60 kg"\n', "needs a balance grade"),
        ("", shaft("s", 2, "0 mm", 'unbalance = { between = ["0 kg m", "1 kg m"], tolerance = "1 g" }'), "percent"),
    ],
)
def test_one_line_for_what_is_wrong(tmp_path: Path, words: str, more: str, rule: str) -> None:
    with pytest.raises(InputError) as caught:
        read(tmp_path, TEXT.format(words) + MOUNTS + more)
    (complaint,) = caught.value.complaints
    assert rule in f"{complaint.rule} {complaint.remedy}"
    assert complaint.remedy


def test_several_objectives_are_refused(tmp_path: Path) -> None:
    two = '[[objective]]\nminimise = "rms mount force"\n[[objective]]\nminimise = "maximum mount force"\n'
    text = changed(TEXT, '[objective]\nminimise = "rms mount force"\n', two).format(" ± 1 %")
    with pytest.raises(InputError, match="robust: needs a single objective, and there are 2"):
        read(tmp_path, text + MOUNTS)


def test_without_robust_it_is_checked_and_leaves_no_trace() -> None:
    plain = load(TEXT.format(" ± 25 g") + MOUNTS)
    assert plain == load(TEXT.format("") + MOUNTS)
    with pytest.raises(InputError, match="100 % of the mass or more"):
        load(TEXT.format(" ± 2 kg") + MOUNTS)


def test_check_refuses_what_solve_does(tmp_path: Path) -> None:
    text = (PROBLEMS / "tractor-four-robust.toml").read_text(encoding="utf-8")
    path = tmp_path / "heights.toml"
    path.write_text(changed(text, '"-100 mm"]', '{ between = ["-200 mm", "0 mm"] }]'), encoding="utf-8")
    for command in ("check", "solve"):
        outcome = CliRunner().invoke(app, [command, str(path)])
        assert outcome.exit_code == 2
        assert "[robust] decides unbalances" in outcome.output
