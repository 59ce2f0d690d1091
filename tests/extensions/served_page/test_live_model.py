"""Model of a page: its loads, its file of a design, and sentences on fixed numbers."""

from __future__ import annotations

import base64
import json
import re
import zlib
from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest

import ready
from extensions.served_page.live_pages import EVERY_NORM, designs, evaluated, model_of, problem_of, with_unknown_norm
from laufruhe.extensions.served_page.live import live_model, page_assets
from laufruhe.extensions.served_page.live.model import reference_of
from laufruhe.extensions.served_page.live.saving import file_number
from laufruhe.extensions.served_page.live.section import sliders
from laufruhe.extensions.served_page.live.signals import NORMS_OF_PAGE
from laufruhe.files.reader import load
from laufruhe.numerics.spectrum import JUMP_OFFSET
from laufruhe.problem.evaluation import evaluate, objective_value
from laufruhe.prove.certificate import Proof
from laufruhe.report.result_report import result_document
from laufruhe.report.web_page import as_html
from laufruhe.solvers import evaluate_only
from laufruhe.solvers.conclusion import FEASIBILITY_TOL
from problem_files import PROBLEMS


@pytest.fixture(scope="module")
def every():
    problem = problem_of("every norm")
    return problem, model_of(problem)


def test_the_json_stands_in_a_page_and_holds_finite_numbers(every):
    _, model = every
    text = model.as_json()
    assert "<" not in text
    plain = json.loads(text)
    numbers = np.frombuffer(zlib.decompress(base64.b64decode(plain["data"])), dtype="<f8")
    assert np.isfinite(numbers).all()
    last = max(part[0] + int(np.prod(part[1])) for part in _places(plain["signals"]))
    assert last == len(numbers)


def _places(node):
    if isinstance(node, list) and len(node) == 2 and isinstance(node[1], list) and isinstance(node[0], int):
        return [node]
    inner = node.values() if isinstance(node, dict) else node if isinstance(node, list) else ()
    return [place for each in inner for place in _places(each)]


def test_every_measure_is_there_and_signals_are_shared(every):
    problem, model = every
    assert [shown.name for shown in model.measures] == [
        *(term.measure.name for term in problem.objective),
        *(limit.name for limit in problem.limits),
    ]
    assert len({shown.signal for shown in model.measures if "mount force" in shown.name}) == 1
    assert model.without_slider == ()


def test_a_saved_file_is_evaluated_alike(every):
    problem, model = every
    for values in designs(model, 3):
        text = model.save.text
        for mark, name, unit in model.save.numbers:
            text = text.replace(json.dumps(mark), file_number(values[name], unit))
        saved = load(text)
        assert saved.decisions == ()
        direct = evaluated(problem, model, values)
        from_file = evaluated(saved, model, {})
        assert objective_value(saved, from_file) == pytest.approx(objective_value(problem, direct), rel=1e-12)


@pytest.mark.parametrize(
    ("name", "still"), [("inline-five-torsion", "throws"), ("tractor-four-elastic", "front left.stiffness.x")]
)
def test_numbers_without_a_slider_are_named_with_a_remedy(name, still):
    model = model_of(load(PROBLEMS / f"{name}.toml"))
    assert still in {name for name, _ in model.without_slider}
    assert all("laufruhe page" in why for _, why in model.without_slider)
    assert bool(model.sliders) != bool(model.why_not)


def test_limits_that_no_slider_moves_stay_with_their_value():
    shown = {each.name: each for each in model_of(load(PROBLEMS / "tractor-four-elastic.toml")).measures}
    assert shown["static sag"].signal is None
    assert shown["maximum mount travel"].signal is not None


def test_unfollowed_limits_show_the_value_of_the_design():
    problem = load(PROBLEMS / "soft-single-run-up.toml")
    shown = {each.name: each for each in model_of(problem).measures}
    twist = shown["run-up twist"]
    assert not twist.followed
    assert twist.value > 0.0
    assert twist.sides[0][0] == "at most"


def test_sliders_have_the_units_of_the_file():
    in_grams = EVERY_NORM.replace('["0 kg", "2 kg"]', '["0 g", "2000 g"]')
    web, left = model_of(load(in_grams)).sliders
    assert (web.shown, web.unit, web.upper) == ("g", "kg", 2.0)
    assert web.factor == pytest.approx(1000.0)
    assert (left.shown, left.factor) == ("kg m", 1.0)


def test_a_page_too_large_says_so(every, monkeypatch):
    monkeypatch.setattr("laufruhe.extensions.served_page.live.parts.MAX_MB", 1e-3)
    assert "carries at most" in every[1].too_large


def test_a_problem_with_nothing_open_has_no_sliders():
    closed = EVERY_NORM.replace('{ between = ["0 kg", "2 kg"] }', '"1 kg"')
    closed = closed.replace('{ between = ["0 kg m", "0.05 kg m"] }', '"0.01 kg m"').replace(
        "{ between = [0, 360] }", "0"
    )
    model = model_of(load(closed))
    assert model.sliders == model.without_slider == ()


def test_headings_of_a_live_report_can_be_gone_to(every):
    result = evaluate_only(every[0])
    page = as_html(result_document(result, ["polar"], "laufruhe"), {"polar": "<svg/>"}, sliders(result))
    targets = re.findall('<h2 id="([^"]*)"', page)
    assert targets[1:3] == ["try", "pictures"]
    assert targets == re.findall('<a href="#([^"]*)"', page)
    assert page.count("<script") == 2


def test_script_and_style_ask_for_nothing():
    for text in page_assets().values():
        for word in ("http://", "https://", "import ", "eval(", "innerHTML", "url("):
            assert word not in text.replace("http://www.w3.org/2000/svg", "")


def test_a_decided_star_is_saved_from_its_result():
    result = ready.solved("vee-eight-open")
    model = live_model(result.problem, result)
    text, values = model.save.text, {entry.name: entry.value for entry in result.decisions}
    for mark, name, unit in model.save.numbers:
        text = text.replace(json.dumps(mark), file_number(values[name], unit))
    saved = load(text)
    assert saved.phasing is None
    assert objective_value(saved, evaluate(saved)) == pytest.approx(result.objective.value, rel=1e-9)
    # as the file has them
    assert {slider.shown for slider in model.sliders} == {"kg m"}


def test_norms_that_a_page_follows_are_those_of_its_script():
    script = (files("laufruhe.extensions.served_page.live") / "page" / "norms.js").read_text(encoding="utf-8")
    table = script.partition("const NORMS = {")[2].partition("};")[0]
    assert {a or b for a, b in re.findall(r'^  (?:"([^"]+)"|(\w+)):', table, re.MULTILINE)} == NORMS_OF_PAGE


def test_a_norm_that_the_script_does_not_know_is_not_followed(every):
    problem = with_unknown_norm(every[0])
    model = model_of(problem)
    unknown = [shown for shown in model.measures if shown.norm == "worst twentieth"]
    assert len(unknown) == 2
    assert all(shown.signal is None and not shown.followed for shown in unknown)
    assert all(shown.signal is not None for shown in model.measures if shown not in unknown)
    assert {name for name, why in model.without_slider if why.startswith("cannot be followed live")} == {
        shown.name for shown in unknown
    }


def test_an_unknown_channel_is_not_followed(every):
    problem = every[0]
    (term,) = problem.objective
    stranger = replace(term.measure.load, name="resultant of the mounts")
    strange = problem.changed(objective=(replace(term, measure=replace(term.measure, channel=stranger)),))
    (shown, *others) = model_of(strange).measures
    assert shown.signal is None
    assert not shown.followed
    assert all(other.followed for other in others)


@pytest.mark.parametrize(
    ("proof", "name", "proven"),
    [
        (Proof.GLOBAL, "the proven optimum", True),
        (Proof.WITHIN_GAP, "the best design found (gap 2.6 %)", False),
        (Proof.LOCAL, "the best design found (a local optimum)", False),
    ],
)
def test_a_reference_is_named_by_what_was_proven_of_it(proof, name, proven):
    result = reference_of(1.0, proof, 0.026)
    assert (result["name"], result["is_proven"]) == (name, proven)


def test_a_served_page_takes_its_reference_from_its_server(every):
    result = ready.solved("tractor-four-lanchester")
    assert live_model(result.problem, result).reference["is_proven"]
    assert live_model(result.problem, result, is_served=True).reference is None


def test_scripts_have_the_constants_of_the_package(every) -> None:
    """A page reads jumps on the same side, and judges limits with the same tolerance, as the package."""
    text = (files("laufruhe.extensions.served_page.live") / "page" / "signals.js").read_text()
    (found,) = re.findall(r"\bBEHIND = ([^,;]+)[,;]", text)
    assert float(found) == pytest.approx(JUMP_OFFSET, rel=1e-12)
    _, model = every
    assert json.loads(model.as_json())["tolerance"] == FEASIBILITY_TOL
