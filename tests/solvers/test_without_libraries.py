"""CasADi, loaded only for open numbers that need it, and a message where it is missing."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from problem_files import PROBLEMS

QUICK = """
import sys
sys.modules |= dict.fromkeys(("casadi", "cvxpy", "matplotlib", "pandas", "scipy", "xarray"))
import laufruhe
print(laufruhe.solve(sys.argv[1]).status)
"""


@pytest.mark.slow
def test_counterweights_and_shafts_need_only_the_cone_solver() -> None:
    """Check that a solve imports no heavy library except the cone solver."""
    path = str(PROBLEMS / "tractor-four-lanchester.toml")
    process = subprocess.run([sys.executable, "-c", QUICK, path], check=True, capture_output=True, text=True)
    assert process.stdout == "optimal\n"


@pytest.mark.slow
def test_drawing_imports_no_library_of_studies_and_solvers() -> None:
    names = "casadi", "clarabel", "cvxpy", "pandas", "pydantic", "scipy", "xarray"
    code = f"import sys; sys.modules |= dict.fromkeys({names}); from laufruhe.plots import get_ready; get_ready()"
    subprocess.run([sys.executable, "-c", code], check=True)


PLAIN = """
import sys
sys.modules |= dict.fromkeys(("casadi", "cvxpy", "netCDF4", "openpyxl", "dask", "distributed"))
import laufruhe
from laufruhe.cli import app
from typer.testing import CliRunner
problem, mounts, throws, folder = sys.argv[1:]
loaded = laufruhe.load(problem)
scs, uneven = (lambda: laufruhe.solve(problem, solver="SCS")), (lambda: laufruhe.solve(throws))
for call in loaded.to_cvxpy, loaded.to_casadi, scs, uneven:
    try:
        call()
    except laufruhe.SolverError as error:
        print(error)
for words in (["solve", mounts, "--no-plots"], ["study", "sweep.toml"]):
    answer = CliRunner().invoke(app, [*words, "--out", folder + words[0]])
    print(answer.exit_code, answer.output.strip().rpartition("failed: ")[2] if answer.exit_code else "")
import xarray
print(xarray.open_dataset(f"{folder}study/one.nc").attrs["kind"])
from laufruhe.files.number_tables import _of_spreadsheet
try:
    _of_spreadsheet(b"", None)
except laufruhe.ModelError as error:
    print(error)
"""
STUDY = """
title = "Share"
[study]
[[study.parts]]
name = "one"
kind = "counterweight fraction"
title = "Share"
sweep = [{ quantity = "counterweights.web.balance_factor", from = 0, to = 1, points = 2 }]
cases = [{ name = "single", problem = "tractor-single.toml" }]
"""


@pytest.mark.slow
def test_a_plain_installation_says_what_each_call_needs(tmp_path: Path) -> None:
    """A study writes netCDF without a library of its own; other calls name the command of pip."""
    (tmp_path / "sweep.toml").write_text(STUDY, encoding="utf-8")
    name = "tractor-single.toml"
    (tmp_path / name).write_text((PROBLEMS / name).read_text(encoding="utf-8"), encoding="utf-8")
    names = ("tractor-four-lanchester", "powertrain-torque-roll", "inline-nine-uneven")
    paths = [str(PROBLEMS / f"{name}.toml") for name in names]
    process = subprocess.run(
        [sys.executable, "-c", PLAIN, *paths, "out"], check=True, capture_output=True, text=True, cwd=tmp_path
    )
    cvxpy = "the Python library cvxpy is missing; pip install cvxpy-base"
    casadi = "the Python library casadi is missing; pip install casadi"
    assert process.stdout.splitlines() == [
        cvxpy, casadi, cvxpy, casadi,
        "0 ", "0 ", "counterweight fraction",
        "is a spreadsheet, and the Python library openpyxl is missing; pip install openpyxl",
    ]  # fmt: skip
