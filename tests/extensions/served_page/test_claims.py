"""Claims of the served page while it solves a simpler problem, and its last claim."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from lanes import first_fast
from laufruhe.extensions.served_page import answers, page_problem
from laufruhe.extensions.served_page.answers import Source
from laufruhe.extensions.served_page.claims import Simplification, breaks_words, conflict_claim
from laufruhe.extensions.served_page.page_state import Edit, PageState
from laufruhe.extensions.served_page.serialise import limits
from laufruhe.files.reader import load, tables_of
from laufruhe.problem.evaluation import evaluate
from laufruhe.report.sections.values import limits as limit_tables
from laufruhe.solvers.conclusion import evaluate_only
from laufruhe.solvers.values import LimitValue
from problem_files import PROBLEMS

INPUTS = Path(__file__).parent / "inputs"
OPEN_CRANK = Edit("open crank", "crank", 1)
STRONG = ("optimum", "no design", "proven", "gap", "bound", "least")
"""Words that are reserved for claims about the whole problem."""


def follow(path: Path, *edits: Edit, held: tuple[Edit, ...] = (), position: int = 0) -> dict[str, Any]:
    state = PageState(edits, held, has="later", position=position)
    return json.loads(answers.follow(Source(tables_of(path), path), state))  # type: ignore[no-any-return]


def settle(path: Path, *edits: Edit) -> dict[str, Any]:
    return json.loads(answers.settle(Source(tables_of(path), path), PageState(edits), 600.0))  # type: ignore[no-any-return]


def text_of(claim: dict[str, Any]) -> str:
    return " ".join((claim["lead"], claim["words"], claim["breaks"], claim["reference"])).lower()


def is_modest(claim: dict[str, Any]) -> bool:
    return not claim["is_last"] and not any(word in text_of(claim) for word in STRONG)


def exact(path: Path, design: dict[str, float], *edits: Edit) -> float:
    """Return the objective of a design by the exact model."""
    data = json.loads(answers.measure(Source(tables_of(path), path), PageState(edits, design=design)))
    return float(data["objective"])


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("rank-all-cranks", 2161.25, "for these shaft positions and this crank"),
        ("tractor-four-lanchester", 502.944, "for this crank"),
    ],
)
def test_a_crank_that_is_not_ranked_yet_has_an_estimate(name: str, value: float, words: str) -> None:
    path = INPUTS / f"{name}.toml" if name == "rank-all-cranks" else PROBLEMS / f"{name}.toml"
    result = follow(path, OPEN_CRANK)
    assert result["claim"]["kind"] == "held"
    assert result["claim"]["lead"].startswith("Estimate ")
    assert result["claim"]["value"] == pytest.approx(value, rel=1e-3)
    assert words in result["claim"]["words"]
    assert is_modest(result["claim"])


@pytest.mark.slow
def test_a_ranked_crank_is_proven() -> None:
    result = settle(PROBLEMS / "tractor-four-lanchester.toml", OPEN_CRANK)
    assert result["claim"]["kind"] == "proven"
    assert result["claim"]["value"] == pytest.approx(227.25, abs=0.01)
    assert result["claim"]["lead"] == "Optimum 227.25 N"
    assert "no design has less than 227.2" in result["claim"]["words"]


@pytest.mark.slow
def test_places_and_a_crank_are_decided_together_before_anything_is_proven() -> None:
    """Check a value far below any estimate with a given place or crank."""
    result = settle(INPUTS / "rank-all-cranks.toml", OPEN_CRANK)
    assert result["claim"]["value"] == pytest.approx(458.65, abs=0.02)
    assert result["claim"]["kind"] in ("proven", "found")


@pytest.mark.parametrize("name", ["rank-all-cranks", "tractor-four-lanchester"])
def test_a_limit_that_moves_has_no_bound_beside_it(name: str) -> None:
    path = INPUTS / f"{name}.toml" if name == "rank-all-cranks" else PROBLEMS / f"{name}.toml"
    result = follow(path, Edit("set", "constraints.1.max", "1.5 kg"))
    assert is_modest(result["claim"])
    assert not {"bound", "gap", "proof", "optimum"} & set(json.dumps(result).replace('"', " ").split())


@pytest.mark.parametrize(
    ("name", "minimum"), [("few-angles-below-any-design", 1508.9), ("few-angles-16-percent-below", 3837.4)]
)
def test_an_estimate_is_what_its_design_has(name: str, minimum: float) -> None:
    """Check an estimate against its design at many angles, and that no design has less."""
    path = INPUTS / f"{name}.toml"
    result = follow(path)
    assert result["claim"]["kind"] == "estimate"
    assert result["claim"]["value"] == pytest.approx(exact(path, result["design"]), rel=1e-12)
    assert result["claim"]["value"] >= minimum
    assert is_modest(result["claim"])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "value"), [("few-angles-below-any-design", 1508.9), ("few-angles-16-percent-below", 3837.4)]
)
def test_the_whole_problem_is_solved_at_enough_angles(name: str, value: float) -> None:
    result = settle(INPUTS / f"{name}.toml")
    assert result["claim"]["value"] == pytest.approx(value, rel=1e-3)
    assert result["claim"]["is_last"]


def test_a_limit_that_the_shown_design_breaks_is_marked_at_once() -> None:
    path = INPUTS / "held-mounts-break-sag.toml"
    result = follow(path)
    sag = next(limit for limit in result["limits"] if limit["name"] == "static sag")
    assert result["claim"]["kind"] == "held"
    assert "for these mounts" in result["claim"]["words"]
    assert result["claim"]["breaks"] == "breaks static sag (2.501 mm, at most 1.800 mm)"
    assert sag["broken"]
    assert sag["words"] == "broken: 2.501 mm, at most 1.800 mm"
    wide = follow(path, Edit("set", "constraints.2.max", "3 mm"))
    assert wide["claim"]["breaks"] == ""
    assert next(limit for limit in wide["limits"] if limit["name"] == "static sag")["words"] == "is 2.501 mm; has room"


def test_a_limit_of_the_ready_elastic_four_is_marked_as_it_moves() -> None:
    path = PROBLEMS / "tractor-four-elastic.toml"
    problem = load(path)
    sag = next(limit for limit in problem.limits if limit.name == "static sag")
    value = evaluate(problem).value(sag.measure)
    result = follow(path, Edit("set", "constraints.1.max", f"{value / 1.58!r} m"))
    assert "breaks static sag" in result["claim"]["breaks"]
    assert is_modest(result["claim"])


def test_limits_on_numbers_that_wait_are_named_and_measured() -> None:
    path = PROBLEMS / "soft-single-run-up.toml"
    result = follow(path)
    assert result["claim"]["words"].endswith("without the limits on run-up twist and run-up travel")
    twist = next(limit for limit in result["limits"] if limit["name"] == "run-up twist")
    assert twist["broken"] == ("run-up twist" in result["claim"]["breaks"])


def test_a_claim_carries_the_position_of_the_settings_that_it_is_about() -> None:
    path = PROBLEMS / "tractor-four-lanchester.toml"
    assert follow(path, position=41)["claim"]["position"] == 41
    data = json.loads(answers.settle(Source(tables_of(path), path), PageState(position=42), 600.0))
    assert data["claim"]["position"] == 42


def test_a_claim_names_held_decisions() -> None:
    path = INPUTS / "rank-all-cranks.toml"
    names = [decision.name for decision in load(path).decisions if not decision.is_affine]
    held = tuple(Edit("fix", name, f"{-200 if name.endswith('z') else 100 * (1 - 2 * ('right' in name))} mm")
                 for name in names)  # fmt: skip
    result = follow(path, held=held)
    assert result["claim"]["kind"] == "held"
    assert result["claim"]["words"].endswith("for these shaft positions")
    # fixed by the user, they are part of the problem
    assert follow(path, *held)["claim"]["kind"] == "estimate"


def test_words_of_what_is_simpler() -> None:
    assert not Simplification()
    both = Simplification(("these mounts", "this crank"), ("tolerances",))
    assert both.phrase == " for these mounts and this crank without tolerances"
    claim = conflict_claim(3, ("a", "b"), Simplification(("these mounts",)))
    assert claim.lead == "No design found:"
    assert claim.words == "'a' and 'b' contradict each other for these mounts. Move one of the limits"
    assert conflict_claim(3, ("a",), is_last=True).lead == "No design exists:"


@pytest.mark.parametrize(
    ("value", "side", "broken"),
    [
        (1.1, "at most", True),
        (1.0, "at most", False),
        (1.0 + 2e-5, "at most", True),
        (1.0 + 9e-6, "at most", False),
        (0.9, "at least", True),
        (1.0, "at least", False),
        (1.0 - 2e-5, "at least", True),
        (1.0 - 9e-6, "at least", False),
    ],
)
def test_page_and_report_call_the_same_limits_broken(value: float, side: str, broken: bool) -> None:
    problem = load(PROBLEMS / "tractor-four-lanchester.toml")
    limit = LimitValue("x", value, 1.0, "N", False, 0.0, side)
    assert bool(breaks_words([limit])) == broken
    assert limits([limit], problem)[0]["broken"] == broken
    result = replace(evaluate_only(problem), limits=(limit,))
    (table,) = limit_tables(result)
    assert (table.rows[0][3] == "broken") == broken


@pytest.mark.parametrize("share", first_fast([slice(0, None, 3), slice(None)], 0, 1), ids=["third", "all"])
def test_no_ready_problem_claims_more_than_an_estimate_while_it_is_followed(share: slice) -> None:
    for path in sorted(PROBLEMS.glob("*.toml"))[share]:
        tables = tables_of(path)
        if "study" in tables:
            continue
        data = json.loads(answers.follow(Source(tables, path), PageState(has="later")))
        claim = data["claim"]
        assert not claim["is_last"], path.stem
        if claim["kind"] != "no design":
            assert is_modest(claim), path.stem
        if data["design"] is not None:
            problem = load(path)
            moved = not problem.phasing and all(decision.is_affine for decision in problem.decisions)
            if moved and problem.objective and not problem.ranks:
                assert claim["value"] == pytest.approx(exact(path, data["design"]), rel=1e-9), path.stem


def test_the_exact_model_is_evaluated_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The value, all limits and the drawing of a design come from one evaluation."""
    state = []
    monkeypatch.setattr(page_problem, "evaluate", lambda *given: state.append(given) or evaluate(*given))
    path = INPUTS / "few-angles-below-any-design.toml"
    json.loads(answers.follow(Source(tables_of(path), path), PageState()))
    assert len(state) == 1
