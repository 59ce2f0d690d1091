"""Loads without their mean over the cycle, and what of an objective is static."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from laufruhe import load, solve
from laufruhe.errors import InputError
from laufruhe.numerics.norms import NORMS
from laufruhe.present.static_load import static_sentence
from laufruhe.problem.channels import CHANNELS
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.problem.measure import Measure
from laufruhe.problem.static_load import static_part, with_loads
from problem_files import PROBLEMS

SAMPLES = 23040
FOUR = PROBLEMS / "tractor-four-lanchester.toml"


def lengths_without_mean(name: str, channel: str) -> np.ndarray:
    """Return |F - mean F| of every place, shape (samples, places), from samples of the whole signal."""
    evaluation = evaluate(load(PROBLEMS / f"{name}.toml"))
    samples = CHANNELS[channel].signal(evaluation.loads[0]).sample(SAMPLES)
    return np.linalg.norm(samples - samples.mean(axis=0), axis=-1)


@pytest.mark.parametrize("name", ["tractor-four-lanchester", "tractor-single-shafts", "vee-six-60", "geared-twin"])
@pytest.mark.parametrize("channel", ["mount force", "roll moment"])
def test_norms_are_those_of_samples_less_their_mean(name: str, channel: str) -> None:
    evaluation = evaluate(load(PROBLEMS / f"{name}.toml"))
    own = lengths_without_mean(name, channel)
    expected = {"mean": own.mean(), "rms": np.sqrt(np.mean(own**2)), "maximum": own.max()}
    for norm, value in expected.items():
        measure = Measure(CHANNELS[channel], NORMS[norm], alternating=True)
        assert evaluation.value(measure) == pytest.approx(value, rel=1e-4)


def test_the_mean_is_all_that_is_left_out() -> None:
    evaluation = evaluate(load(FOUR))
    for norm in ("mean", "rms", "maximum", "peak to peak"):
        whole = Measure(CHANNELS["shaking force"], NORMS[norm])
        # pistons and rods have no mean force
        assert evaluation.value(replace(whole, alternating=True)) == pytest.approx(evaluation.value(whole), rel=1e-9)
    orders = Measure(CHANNELS["roll moment"], orders=(2.0, 4.0))
    assert evaluation.value(replace(orders, alternating=True)) == evaluation.value(orders)
    spread = Measure(CHANNELS["roll moment"], NORMS["peak to peak"])
    assert evaluation.value(replace(spread, alternating=True)) == pytest.approx(evaluation.value(spread), rel=1e-9)


@pytest.mark.slow
def test_no_norm_is_less_than_that_of_the_mean_alone() -> None:
    for path in sorted(PROBLEMS.glob("tractor-*.toml")):
        if "[[study" in path.read_text() or "[study]" in path.read_text():
            continue
        problem = load(path)
        part = static_part(problem, evaluate(problem)) if problem.objective else None
        if part is not None:
            assert part.static <= part.whole * (1.0 + 1e-9)
            assert part.whole <= part.static + part.alternating + 1e-9 * part.whole


@pytest.mark.parametrize(("name", "static"), [("inline-twelve", 788.034), ("flat-twelve", 788.034)])
def test_an_objective_at_its_static_part_says_so(name: str, static: float) -> None:
    problem = load(PROBLEMS / f"{name}.toml")
    evaluation = evaluate(problem)
    part = static_part(problem, evaluation)
    assert part is not None
    assert part.is_floor
    assert part.static == pytest.approx(static, rel=1e-5)
    assert "No rotating part can bring the objective below it" in static_sentence(problem, evaluation)


def test_norms_that_do_not_add_have_no_share() -> None:
    problem = load(FOUR)
    evaluation = evaluate(problem)
    part = static_part(problem, evaluation)
    assert part is not None
    assert part.static + part.alternating > 1.01 * part.whole
    sentence = static_sentence(problem, evaluation)
    assert "160.5" not in sentence
    assert "%" not in sentence
    assert f"Without this mean the objective is {part.alternating:.4g} N" in sentence


def test_an_alternating_objective_names_what_it_leaves_out() -> None:
    variant = load(FOUR)
    problem, evaluation = with_loads(variant, alternating=True), evaluate(variant)
    part = static_part(problem, evaluation)
    assert part == static_part(variant, evaluation)
    assert part is not None
    assert part.whole == objective_value(variant, evaluation)
    assert part.alternating == objective_value(problem, evaluation)
    assert static_sentence(problem, evaluation).startswith(
        "The steady reaction to the mean torque, 160.5 N alone, is left out"
    )


def test_an_engine_without_gas_has_no_static_part() -> None:
    problem = load(PROBLEMS / "geared-twin.toml")
    problem = problem.changed(points=tuple(replace(point, gas=None) for point in problem.points))
    assert static_part(problem, evaluate(problem)) is None
    assert static_sentence(problem, evaluate(problem)) == ""


@pytest.mark.slow
def test_the_optimum_of_alternating_loads_is_proven_and_no_other_design_is_better() -> None:
    variant = load(FOUR)
    whole, result = solve(variant), solve(with_loads(variant, alternating=True))
    assert result.objective is not None
    assert result.certificate is not None
    assert result.objective.name == "mean alternating mount force"
    assert result.certificate.kind == "global"
    assert with_loads(result.problem, alternating=False).objective == variant.objective
    assert result.objective.value < objective_value(result.problem, whole.final)
    rng, problem = np.random.default_rng(3), result.problem
    for _ in range(40):
        values = [d.set.project(np.ones(d.set.width) * rng.uniform(-d.upper, d.upper)) for d in problem.decisions]
        units = [complex(*value) if len(value) > 1 else complex(value[0]) for value in values]
        assert objective_value(problem, evaluate(problem, problem.design(units))) > result.certificate.lower_bound


def test_the_key_of_a_file_narrows_a_measure(tmp_path) -> None:
    line = 'minimise = "mean mount force"'
    text = FOUR.read_text().replace(line, f"{line}\nalternating = true")
    path = tmp_path / "own.toml"
    path.write_text(text)
    problem = load(path)
    assert problem.objective == with_loads(load(FOUR), alternating=True).objective
    path.write_text(text.replace("alternating = true", "alternating = true\norders = [0, 2]"))
    with pytest.raises(InputError, match="contains order 0, which alternating leaves out"):
        load(path)
    path.write_text(text.replace("mean mount force", "added mass"))
    with pytest.raises(InputError, match="alternating"):
        load(path)
