"""Long tables of draws leave out the workbook first, then the CSV file, and the report says where all rows are."""

from __future__ import annotations

import csv
from pathlib import Path

import openpyxl
import pytest
import xarray as xr
from typer.testing import CliRunner

from laufruhe.cli import app
from laufruhe.extensions.random_studies import sampled
from laufruhe.report import study_report
from problem_files import PROBLEMS

DRAWS = 12


@pytest.mark.parametrize(("page", "tabled"), [(DRAWS, DRAWS), (DRAWS - 1, DRAWS), (DRAWS - 2, DRAWS - 1)])
def test_rows_left_out_are_named(page: int, tabled: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(study_report, "MAX_PAGE_ROWS", page)
    monkeypatch.setattr(sampled, "MAX_TABLED", tabled)
    part = f'name = "p"\nkind = "random designs"\ntitle = "T"\ndraws = {DRAWS}\n'
    case = f'[[study.parts.cases]]\nname = "one"\nproblem = "{PROBLEMS / "tractor-single.toml"}"\n'
    (tmp_path / "s.toml").write_text(f'title = "t"\n[study]\n[[study.parts]]\n{part}{case}', encoding="utf-8")
    out = tmp_path / "out"
    answer = CliRunner().invoke(app, ["study", str(tmp_path / "s.toml"), "--out", str(out), "--jobs", "1"])
    assert answer.exit_code == 0, answer.output
    report = (out / "report.md").read_text(encoding="utf-8")
    with xr.open_dataset(out / "p.nc") as data:
        assert data.sizes["draw"] == DRAWS
    assert (out / "p.csv").exists() == (tabled == DRAWS)
    assert (out / "tables.xlsx").exists() == (page == DRAWS)
    assert (f"All {DRAWS} rows are in `p.nc`" in report) == (tabled < DRAWS)
    assert (f"All {DRAWS} rows are in `p.csv` and `p.nc`" in report) == (page < DRAWS == tabled)
    if tabled == DRAWS:
        rows = list(csv.reader((out / "p.csv").read_text(encoding="utf-8").splitlines()))
        assert len(rows) == DRAWS + 1
        if page == DRAWS:
            sheet = openpyxl.load_workbook(out / "tables.xlsx")["p"]
            assert [cell.value for cell in sheet[1]] == rows[0]
