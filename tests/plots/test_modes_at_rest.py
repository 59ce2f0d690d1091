"""Pictures of modes say at which stiffness they are, where that depends on frequency."""

from __future__ import annotations

import pytest

from laufruhe.files.reader import load
from laufruhe.plots.results import campbell, modes
from laufruhe.present.mounting import facts_of, stiffness_sentence
from laufruhe.problem.evaluation import evaluate
from problem_files import PROBLEMS
from ready import solved


@pytest.mark.parametrize(("name", "depends"), [("powertrain-hydraulic", True), ("powertrain-decoupling", False)])
def test_a_sentence_is_said_of_mounts_that_depend_on_frequency_alone(name: str, depends: bool) -> None:
    facts = facts_of(evaluate(load(PROBLEMS / f"{name}.toml")))
    assert ("at rest" in stiffness_sentence(facts)) is depends


@pytest.mark.slow
def test_both_pictures_of_modes_say_it_and_block_and_fluid_are_drawn() -> None:
    result = solved("powertrain-hydraulic")
    for module in (campbell, modes):
        drawn = module.figure(result)
        words = " ".join(" ".join(text.get_text().split()) for text in drawn.texts)
        assert "at rest" in words
    facts = facts_of(result.final)
    (axes,) = campbell.figure(result).axes
    heights = [
        float(line.get_ydata()[0])
        for line in axes.lines
        if line.get_linestyle() == ":" and len(set(line.get_ydata())) == 1
    ]
    assert len(facts.with_fluid) > 6
    assert all(any(abs(height - each) < 1e-9 for height in heights) for each in facts.with_fluid)
