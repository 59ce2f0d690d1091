"""Boxes of mounts and unbalances among other provers, and one open number that they prove."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

import laufruhe
from attack.own_problem import OwnModel
from laufruhe.extensions.joint_mounts import prover
from laufruhe.prove.branch_and_bound import BoxResult
from laufruhe.prove.certificate import Proof
from laufruhe.prove.mounts.provers import Question
from mounts.files import BLOCK, ENGINE, MOUNTS, problem_of
from prove.test_provers import FORCE

INPUTS = Path(__file__).parents[2] / "claims" / "inputs"


def own_of(name: str) -> OwnModel:
    return OwnModel(tomllib.loads((INPUTS / f"{name}.toml").read_text(encoding="utf-8")), 256)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["one-damper-over-41-speeds", "one-stiffness-under-transmissibility"])
def test_one_number_is_proven(name: str) -> None:
    result, own = laufruhe.solve(INPUTS / f"{name}.toml"), own_of(name)
    ((low, high),) = own.box
    designs = own.designs(np.linspace(low, high, 61)[:, None])
    minimum = float(np.where(designs.excesses.max(axis=1) <= 0.0, designs.objective, np.inf).min())
    assert result.certificate is not None
    assert result.objective is not None
    assert result.certificate.kind is Proof.GLOBAL
    assert result.certificate.gap <= 1e-3
    assert result.certificate.lower_bound <= minimum * (1.0 + 1e-6)
    assert result.objective.value <= minimum * (1.0 + 1e-6)


def test_boxes_without_progress_are_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    problem = problem_of(tmp_path, ENGINE, BLOCK, MOUNTS, FORCE)
    monkeypatch.setattr(prover, "load_bounds", lambda *_: iter([BoxResult(0.5, 1), BoxResult(0.6, 9)]))
    for known, boxes in ((0.4, 9), (0.7, 1)):
        question = Question(problem, 1.0, 0.1, bound=known)
        assert [found.boxes for found in prover.bounds_from_boxes(question)][-1] == boxes
    assert not [*prover.bounds_from_boxes(Question(problem, 1.0, 0.1, in_batch=True))]
