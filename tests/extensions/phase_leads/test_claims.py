"""Broken bounds of leads, which contradict a known design, and leads without the folder, which have no bound."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import laufruhe
from claims.test_broken_bounders import scaled, times, value_times
from extensions.removed_folder import run, without
from laufruhe.errors import BoundError
from laufruhe.extensions.phase_leads.bounds import LeadBoxes
from laufruhe.extensions.phase_leads.shared_gas import SharedGasBoxes
from laufruhe.files.reader import load_tables, tables_of
from problem_files import PROBLEMS

SOLVED = """
import json, sys, laufruhe
result = laufruhe.solve(sys.argv[1])
print(json.dumps((result.objective.value, str(result.certificate.kind))))
"""


@pytest.mark.slow
def test_a_broken_bounder_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    scaled(LeadBoxes, "bound", value_times(1.01))(monkeypatch)
    with pytest.raises(BoundError, match="contradicts a known design"):
        laufruhe.solve(PROBLEMS / "geared-three-leads.toml")


@pytest.mark.slow
def test_a_broken_bounder_of_leads_between_shared_chambers(monkeypatch: pytest.MonkeyPatch) -> None:
    tables = dict(tables_of(PROBLEMS / "opposed-pistons-lead.toml"))
    tables.pop("counterweights", None)
    tables["engine"] = {**tables["engine"], "crank_lead": {"between": [4, 16]}}
    tables |= {"objective": {"minimise": "rms roll moment"}, "tolerance": 1e-2, "fidelity": {"samples": 180}}
    scaled(SharedGasBoxes, "_bound", times(1.01))(monkeypatch)
    with pytest.raises(BoundError):
        laufruhe.solve(load_tables(tables, Path("shared.toml")))


@pytest.mark.slow
def test_without_the_folder_leads_are_decided_without_a_bound(tmp_path: Path) -> None:
    path = PROBLEMS / "geared-three-leads.toml"
    solved = run(without(["phase_leads"], tmp_path / "site"), "-c", SOLVED, path)
    assert solved.returncode == 0, solved.stderr
    value, kind = json.loads(solved.stdout)
    objective = laufruhe.solve(path).objective
    assert objective is not None
    assert kind != "global"
    assert value == pytest.approx(objective.value, rel=1e-3)
